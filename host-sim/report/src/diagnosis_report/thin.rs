//! Forty thousand rows to what a chart can show: the least and the largest of each stretch, medians of bins, some rows
//! of all.

use std::ops::Range;

use crate::page::{ChartSeries, Mark, Upright};
use flexspline_base::robust::{least_and_most, median_of};
use flexspline_identify::diagnosis::rows::Rows;

/// Stretches of a chart over time.
const STRETCHES: usize = 500;
/// Medians over a quantity, and rows that each needs.
const MEDIANS: usize = 24;
const FEWEST_IN_MEDIAN: usize = 12;
/// Rows that are shown as dots.
const DOTS: usize = 1600;
/// Breaks between sessions, as a share of all the time that was recorded.
const BREAK: f64 = 0.012;

/// Time with the breaks between sessions taken out, or row numbers where no time was recorded.
pub(super) struct Clock {
    /// Of each row.
    pub at: Vec<f64>,
    /// Where each session begins.
    pub begins: Vec<f64>,
}

impl Clock {
    pub fn new(rows: &Rows) -> Clock {
        let recorded: f64 = rows.sessions.iter().map(|s| rows.time[s.end - 1] - rows.time[s.start]).sum();
        let gap = if rows.sessions.len() > 1 { BREAK * recorded } else { 0.0 };
        let (mut at, mut begins, mut now) = (Vec::with_capacity(rows.len()), Vec::new(), 0.0);
        for session in &rows.sessions {
            let first = rows.time[session.start];
            begins.push(now);
            at.extend(rows.time[session.clone()].iter().map(|t| now + t - first));
            now += rows.time[session.end - 1] - first + gap;
        }
        Clock { at, begins }
    }

    /// Names of the sessions where they begin; of many, some.
    pub(crate) fn borders(&self) -> Vec<Upright> {
        let every = self.begins.len().div_ceil(12);
        let named = |k: usize| if k.is_multiple_of(every) { format!("session {}", k + 1) } else { String::new() };
        let all = self.begins.iter().enumerate().map(|(k, x)| Upright { name: named(k), x: *x });
        if self.begins.len() > 1 { all.collect() } else { Vec::new() }
    }
}

/// Stretches of rows, none across sessions, in proportion to their rows.
fn stretches(rows: &Rows) -> Vec<Range<usize>> {
    let size = rows.len().div_ceil(STRETCHES).max(1);
    let of_session = |session: &Range<usize>| {
        let end = session.end;
        session.clone().step_by(size).map(move |from| from..(from + size).min(end))
    };
    rows.sessions.iter().flat_map(of_session).collect()
}

/// Least and largest value of each stretch, so that nothing that stands out is lost; the line breaks between sessions.
pub(super) fn envelope(rows: &Rows, clock: &Clock, values: &[f64], name: &str, colour: usize) -> ChartSeries {
    let mut points: Vec<[f64; 2]> = Vec::new();
    for part in stretches(rows) {
        if part.start > 0 && rows.sessions.iter().any(|s| s.start == part.start) {
            points.push([0.5 * (clock.at[part.start - 1] + clock.at[part.start]), f64::NAN]);
        }
        let place = |k: &usize| values[*k];
        let least = part.clone().min_by(|a, b| place(a).total_cmp(&place(b)));
        let most = part.clone().max_by(|a, b| place(a).total_cmp(&place(b)));
        let (Some(least), Some(most)) = (least, most) else { continue };
        if part.len() == 1 {
            points.push([clock.at[part.start], values[least]]);
            continue;
        }
        // Both at places that all series share; what came first stands first.
        let (first, second) = if least < most { (least, most) } else { (most, least) };
        points.push([clock.at[part.start], values[first]]);
        points.push([clock.at[part.start + part.len() / 2], values[second]]);
    }
    ChartSeries::new(name, Mark::Broken, colour, points)
}

/// Which rows are shown as dots: one of each stretch of equally many, drawn, so that they fall in with no rhythm of the
/// drive.
pub(super) fn some_rows(rows: usize) -> Vec<usize> {
    if rows <= DOTS {
        return (0..rows).collect();
    }
    let mut random = fastrand::Rng::with_seed(17);
    (0..DOTS)
        .map(|k| {
            let (from, to) = (k * rows / DOTS, (k + 1) * rows / DOTS);
            from + random.usize(0..to - from)
        })
        .collect()
}

/// Some rows as dots.
pub(super) fn dots(over: &[f64], values: &[f64], rows: &[usize], name: &str, colour: usize) -> ChartSeries {
    ChartSeries::sorted(name, Mark::Dots, colour, rows.iter().map(|k| [over[*k], values[*k]]).collect())
}

/// Medians of bins of equal width over a quantity, ascending, where a bin has rows enough.
pub(super) fn medians(over: &[f64], values: &[f64], rows: impl Iterator<Item = usize> + Clone) -> Vec<[f64; 2]> {
    let (low, high) = least_and_most(rows.clone().map(|k| over[k]).filter(|x| x.is_finite()));
    let mut bins: Vec<(Vec<f64>, f64)> = vec![(Vec::new(), 0.0); MEDIANS];
    if high > low {
        for k in rows {
            let place = ((over[k] - low) / (high - low) * MEDIANS as f64) as usize;
            let bin = &mut bins[place.min(MEDIANS - 1)];
            bin.0.push(values[k]);
            bin.1 += over[k];
        }
    }
    let enough = bins.iter_mut().filter(|(values, _)| values.len() >= FEWEST_IN_MEDIAN);
    enough.map(|(values, sum)| [*sum / values.len() as f64, median_of(values)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_identify::measurement::Session;
    use flexspline_identify::synthesize::catalogue_drive;

    fn rows(lengths: &[usize]) -> Rows {
        let mut from = 0.0;
        let sessions: Vec<Session> = lengths
            .iter()
            .map(|n| {
                from += 1000.0;
                Session {
                    line: (0..*n as u64).collect(),
                    time_s: Some((0..*n).map(|k| from + 0.01 * k as f64).collect()),
                    generator_rad: (0..*n).map(|k| 0.02 * k as f64).collect(),
                    error_rad: vec![0.0; *n],
                    ..Session::default()
                }
            })
            .collect();
        Rows::new(&sessions, &catalogue_drive())
    }

    #[test]
    fn an_envelope_keeps_what_stands_out_and_breaks_between_sessions() {
        let rows = rows(&[20_000, 20_000]);
        let mut values = vec![0.0; 40_000];
        (values[12_345], values[30_001]) = (7.0, -9.0);
        let clock = Clock::new(&rows);
        let series = envelope(&rows, &clock, &values, "x", 0);
        assert!(series.points.len() <= 2 * STRETCHES + 5, "{}", series.points.len());
        assert!(series.points.iter().any(|p| p[1] == 7.0) && series.points.iter().any(|p| p[1] == -9.0));
        assert_eq!(series.points.iter().filter(|p| p[1].is_nan()).count(), 1);
        assert!(series.points.windows(2).all(|p| p[0][0] < p[1][0]));
        // The break of a quarter of an hour is a small one here.
        assert!(clock.begins[1] < 1.05 * 200.0, "{:?}", clock.begins);
        assert_eq!(clock.borders().len(), 2);
    }

    #[test]
    fn dots_are_some_of_all_rows_and_medians_are_of_all() {
        let all: Vec<usize> = (0..40_000).collect();
        let some = some_rows(40_000);
        assert_eq!(some.len(), DOTS);
        assert!(some.windows(2).all(|pair| pair[0] < pair[1]) && some[DOTS - 1] > 39_900);
        assert_eq!(some_rows(3), [0, 1, 2]);
        let over: Vec<f64> = all.iter().map(|k| (*k % 100) as f64).collect();
        let values: Vec<f64> = over.iter().map(|x| 3.0 * x).collect();
        let points = medians(&over, &values, 0..40_000);
        assert_eq!(points.len(), 24);
        assert!(points.iter().all(|[x, y]| (y - 3.0 * x).abs() < 3.0), "{points:?}");
        assert_eq!(medians(&[1.0; 50], &[1.0; 50], 0..50), [] as [[f64; 2]; 0]);
    }
}
