//! Very long recordings, averaged: a diagnosis holds dozens of columns of all rows in memory, and no cause needs more
//! than a million.

use super::{Recording, Session};

impl Recording {
    /// Averages neighbouring rows where there are more than `most`, and says so in the notes; sessions stay apart.
    pub(crate) fn average_to(&mut self, most: usize) {
        let rows: usize = self.sessions.iter().map(Session::len).sum();
        let together = rows.div_ceil(most.max(1));
        if together <= 1 {
            return;
        }
        let mean = |rows: &[f64]| rows.iter().sum::<f64>() / rows.len() as f64;
        for session in &mut self.sessions {
            let line = session.line.iter().copied().step_by(together).collect();
            *session = session.each(line, |values| values.chunks(together).map(mean).collect());
        }
        let left: usize = self.sessions.iter().map(Session::len).sum();
        self.notes.push(format!(
            "{rows} rows: every {together} neighbours are averaged, {left} rows are diagnosed; what repeats within \
             {together} rows cannot be seen (cut the file to see it)"
        ));
    }
}

#[cfg(test)]
mod tests {
    use crate::measurement::{ColumnMap, Gear, parse};

    #[test]
    fn rows_are_averaged_within_sessions_alone() {
        let mut text = "time_s,generator_rad,error_arcsec,torque_n_m\n".to_owned();
        for row in 0..50 {
            let t = f64::from(row);
            let gap = f64::from(row / 25);
            text += &format!("{},{},{},{t}\n", 0.01 * t + gap, 0.1 * t, 2.0 * (t * 0.7).sin());
        }
        let gear = Gear::of_ratio(-94.0);
        let whole = parse("x.csv", text.as_bytes(), &ColumnMap::default(), &gear).unwrap();
        let mut recording = whole.clone();
        recording.average_to(50);
        assert_eq!(recording, whole);
        recording.average_to(20);
        let [first, second] = recording.sessions.as_slice() else { panic!("two sessions") };
        assert_eq!((first.len(), second.len()), (9, 9));
        assert_eq!((first.line[1], second.line[0]), (whole.sessions[0].line[3], whole.sessions[1].line[0]));
        let torque = first.torque_n_m.as_ref().unwrap();
        assert_eq!((torque[0], torque[8]), (1.0, 24.0));
        assert!((second.generator_rad[0] - 2.6).abs() < 1e-12);
        assert!(recording.notes.last().unwrap().starts_with("50 rows: every 3 neighbours are averaged, 18 rows"));
    }
}
