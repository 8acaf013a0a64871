//! Whether the generator zero of measured rows is whole turns off that of a table.
//!
//! A table of a drive whose error does not repeat in each turn says another error a turn later. A motor that was homed
//! in another turn reads the same within its turn, and the table adds the error of another place: it may leave more
//! than there was. The rows show it by the turn at which the table leaves least of them.

use flexspline::{Prediction, Table};
use serde::Serialize;

use super::replay::{MeasuredRow, by_core};
use flexspline_base::units::ARCSEC_PER_RAD;

/// Rows that a turn is looked for with, about.
const LOOKED_AT: usize = 2000;
/// The zero is said to be off if another turn leaves less than this share of what the table leaves as the rows
/// stand. *Guess*: of an output eccentric once a turn a zero that is off by a turn of hundred leaves a sixteenth of it,
/// which is next to nothing beside a residual.
const LEAVES: f64 = 0.7;
/// Turns that leave less than this share more than the best are as likely. *Guess*.
const AS_LIKELY: f64 = 1.05;

/// Whole turns of the motor between the generator zero of the rows and that of the table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TurnsOff {
    /// The generator angle of the rows reads n turns more than that of the table.
    pub turns: i64,
    /// The fewest and the most turns that leave about as little.
    pub likely: [i64; 2],
    /// What the table leaves of the rows about their mean with these turns taken off, arcsec rms; of a sample of them.
    pub rms_residual_arcsec: f64,
}

impl TurnsOff {
    /// What to know of it, and what to do.
    #[must_use]
    pub fn text(&self, rms_residual_arcsec: f64) -> String {
        let Self { turns, likely: [fewest, most], rms_residual_arcsec: so } = self;
        let ahead = if *turns > 0 { "more" } else { "less" };
        let likely =
            if fewest == most { String::new() } else { format!(" ({fewest} to {most} leave about as little)") };
        let off = format!("{}{}", if *turns > 0 { "-" } else { "+" }, turns.abs());
        format!(
            "the motor's zero is off by whole turns: the generator angle reads {} turns {ahead} than that of the \
             table{likely}; the table leaves {rms_residual_arcsec:.1} arcsec rms as the rows stand, and {so:.1} \
             without these turns. Home the motor in the turn of the table, or take them off: --columns \
             generator=NAME:turn{off} (in the unit of the column; in rad {:+.6})",
            turns.abs(),
            -std::f64::consts::TAU * *turns as f64
        )
    }
}

/// Some of the rows, evenly.
fn some(rows: &[MeasuredRow]) -> Vec<&MeasuredRow> {
    rows.iter().step_by(rows.len().div_ceil(LOOKED_AT).max(1)).collect()
}

/// What the table leaves of rows about their mean, arcsec rms, with the generator's zero and the torque's sign changed.
fn left(table: &Table<'_>, rows: &[&MeasuredRow], off_rad: f64, sign: f64) -> f64 {
    let states = rows.iter().map(|row| [row.generator_rad - off_rad, sign * row.torque_n_m, row.temperature_c]);
    let residual = |(row, said): (&&MeasuredRow, Prediction)| {
        row.error_arcsec - f64::from(said.transmission_error_rad) * ARCSEC_PER_RAD
    };
    about_mean(&rows.iter().zip(by_core(table, states)).map(residual).collect::<Vec<_>>())
}

/// What the table leaves of the rows with the torque's sign turned, arcsec rms; `None` unless that is clearly less than
/// what it leaves of them as they stand, and than they have without it.
#[must_use]
pub(crate) fn torque_turned(table: &Table<'_>, rows: &[MeasuredRow]) -> Option<f64> {
    let some = some(rows);
    let measured: Vec<f64> = some.iter().map(|row| row.error_arcsec).collect();
    let [stands, turned] = [1.0, -1.0].map(|sign| left(table, &some, 0.0, sign));
    (turned < LEAVES * stands.min(about_mean(&measured))).then_some(turned)
}

/// Looks for the turn at which the table leaves least of the rows; `None` if that is the one in which they stand, or is
/// not clear.
#[must_use]
pub(crate) fn turns_off(table: &Table<'_>, rows: &[MeasuredRow]) -> Option<TurnsOff> {
    let some = some(rows);
    let left = |turns: i64| left(table, &some, std::f64::consts::TAU * turns as f64, 1.0);
    let measured: Vec<f64> = some.iter().map(|row| row.error_arcsec).collect();
    // A turn of the output later the table is the same.
    let half = (0.5 * table.drive().exact_ratio().abs()).ceil() as i64;
    let all: Vec<(i64, f64)> = (-half..=half).map(|turns| (turns, left(turns))).collect();
    let (best, least) = all.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.abs().cmp(&b.0.abs())))?;
    let stands = all.iter().find(|(turns, _)| *turns == 0)?.1;
    // A table that still takes nothing is no table of these rows, wherever they begin.
    if best == 0 || least >= LEAVES * stands.min(about_mean(&measured)) {
        return None;
    }
    let likely = |turns: &i64| all.iter().any(|(other, left)| other == turns && *left <= AS_LIKELY * least);
    let run = |by: i64| (1..).map(|k| best + by * k).take_while(likely).last().unwrap_or(best);
    Some(TurnsOff { turns: best, likely: [run(-1), run(1)], rms_residual_arcsec: least })
}

/// Root mean square about the mean.
pub(super) fn about_mean(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline::{GeneratorAngle, PlayState};
    use flexspline_design::tables::{SampleOptions, from_samples, samples};
    use flexspline_mechanics::drive::{Drive, GeneratorKind};

    /// Rows of the drive of a table, loaded there and back, whose torque counts the other way; as it should; and none.
    #[test]
    fn a_torque_of_the_wrong_sign_is_reported_and_no_other() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/firmware/samples/cam.samples.csv");
        let bytes = std::fs::read(file).unwrap();
        let read = samples::parse("cam", &bytes).unwrap();
        let options = SampleOptions::default();
        let made = from_samples(&Drive::hhd_95(), GeneratorKind::Cam, &read, "cam", &bytes, options).unwrap();
        let table = Table::check(&made.image).unwrap();
        let rows = |load_n_m: f64, sign: f64| -> Vec<MeasuredRow> {
            let mut play = PlayState::unknown();
            let row = |k: u32| {
                let (generator_rad, torque_n_m) = (0.3 * f64::from(k), load_n_m * (0.01 * f64::from(k)).sin());
                let generator = GeneratorAngle::from_rad(generator_rad).unwrap();
                let said = table.forward(&mut play, generator, torque_n_m as f32, 20.0);
                let error_arcsec = f64::from(said.transmission_error_rad) * ARCSEC_PER_RAD;
                MeasuredRow { generator_rad, error_arcsec, torque_n_m: sign * torque_n_m, temperature_c: 20.0 }
            };
            (0..1500).map(row).collect()
        };
        assert!(torque_turned(&table, &rows(100.0, -1.0)).is_some_and(|left| left < 1.0));
        assert_eq!(torque_turned(&table, &rows(100.0, 1.0)), None);
        assert_eq!(torque_turned(&table, &rows(0.0, -1.0)), None);
    }
}
