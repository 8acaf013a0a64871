//! A table for controllers that play a correction of their own: a curve over the output at one load, and the image of
//! the core for cFS and F´.
//!
//! The mean error is left out of every curve: homing holds a constant offset. Figures are about the mean.

mod cfs;
mod fprime;

use std::f64::consts::TAU;
use std::fmt::Write;

use flexspline::shared::grid::MAX_PERIODIC_NODES;
use flexspline::{Direction, GeneratorAngle, Table};
use serde::Serialize;
use thiserror::Error;

pub use cfs::{MAX_TABLE_BYTES, cfs};
pub use fprime::fprime;

use flexspline_base::robust::rms;
use flexspline_base::statistics::mean;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_identify::measurement::directions;
use flexspline_identify::replay::{MeasuredRow, ReplayedRow};

/// Both directions of the output.
pub const BOTH: [Direction; 2] = [Direction::Forward, Direction::Backward];
/// Points in each direction at which the model is judged: prime, so that no order of the drive divides it.
const JUDGE_POINTS: u32 = 32_749;
/// Points to a generator turn of a curve, at most: a guess, some 20 to the pitch of a wheel of 200 teeth.
pub const MOST_POINTS_PER_TURN: u32 = 4096;
/// Most rounds of a fixed-point iteration; the correction changes much less than the angle, so each gains a digit.
const ROUNDS: usize = 60;

/// Names and contents of files.
pub type Files = Vec<(&'static str, Vec<u8>)>;

/// A name that the other program does not take.
#[derive(Debug, Error)]
#[error("{option}: found {found}; allowed: {allowed}")]
pub struct NameError {
    option: &'static str,
    found: String,
    allowed: &'static str,
}

/// A table at one load and temperature.
#[derive(Clone, Copy)]
pub struct TableSection<'a> {
    /// The table.
    pub table: &'a Table<'a>,
    /// Load, N·m, finite.
    pub torque_n_m: f64,
    /// Temperature, °C, finite.
    pub temperature_c: f64,
}

impl TableSection<'_> {
    /// Output error in steady motion where the generator leads the output to `led_rad` through the ratio, rad.
    fn error_rad(&self, led_rad: f64, direction: Direction) -> f64 {
        let generator = GeneratorAngle::from_rad(led_rad * self.table.drive().exact_ratio());
        let [torque, temperature] = [self.torque_n_m, self.temperature_c].map(|value| value as f32);
        let generator = generator.unwrap_or(GeneratorAngle::ZERO);
        f64::from(self.table.steady_error_rad(generator, torque, temperature, direction).unwrap_or(0.0))
    }

    /// Output turns after which the error repeats: those that take a whole number of generator turns.
    fn period_turns(&self) -> u32 {
        let drive = self.table.drive();
        let waves = u32::from(drive.circular_spline_teeth() - drive.flexspline_teeth());
        (1..waves).find(|turns| (drive.exact_ratio() * f64::from(*turns)).fract().abs() < 1e-9).unwrap_or(waves)
    }

    /// Points to a generator turn that show every order of the table, at twice the highest (the sampling theorem): as
    /// many as its finest curve has nodes, that over the tooth pitch, or at least those of a curve over the turn.
    pub fn points_per_turn(&self) -> u32 {
        let ripple = self.table.ripple_axis().len() as u32 * u32::from(self.table.drive().ripple_order());
        ripple.clamp(MAX_PERIODIC_NODES as u32, MOST_POINTS_PER_TURN)
    }

    /// Evenly spaced points over the whole period, in each of the directions: led angle, direction, error, rad.
    fn samples(&self, directions: impl IntoIterator<Item = Direction>) -> Vec<(f64, Direction, f64)> {
        let step = TAU * f64::from(self.period_turns()) / f64::from(JUDGE_POINTS);
        let sample = |direction: Direction, k: u32| {
            let led = step * f64::from(k);
            (led, direction, self.error_rad(led, direction))
        };
        directions.into_iter().flat_map(|direction| (0..JUDGE_POINTS).map(move |k| sample(direction, k))).collect()
    }

    /// Lines of a comment in a file made of this section: table, tool, load, sign.
    fn comment(&self, sign: &str) -> String {
        let TableSection { table, torque_n_m, temperature_c } = self;
        let made = format!("# flexspline {} table_id {}\n", env!("CARGO_PKG_VERSION"), table.id());
        made + &format!("# load {torque_n_m} N.m, {temperature_c} degrees C\n# sign: {sign}\n")
    }
}

/// The angle for which `angle + shift(angle)` is `target`, for a shift that changes less than its angle does.
fn shifted_to(target: f64, shift: impl Fn(f64) -> f64) -> f64 {
    let mut angle = target;
    for _ in 0..ROUNDS {
        let moved = target - shift(angle) - angle;
        angle += moved;
        if moved.abs() < 1e-14 {
            break;
        }
    }
    angle
}

/// Corrections at evenly spaced outputs over the whole period, linear between them.
#[derive(Debug, Clone)]
pub struct Curve {
    step_rad: f64,
    mean_arcsec: f64,
    /// Arcsec, by direction.
    corrections: Vec<(Direction, Vec<f64>)>,
}

impl Curve {
    /// Corrections that bring the output to where it was asked for, with this number of points to a generator turn.
    pub fn new(section: TableSection<'_>, points_per_turn: u32, directions: &[Direction]) -> Curve {
        let turns = f64::from(section.period_turns());
        let points = (section.table.drive().exact_ratio().abs() * turns).round() as u32 * points_per_turn;
        let step_rad = TAU * turns / f64::from(points);
        let errors: Vec<f64> =
            section.samples(directions.iter().copied()).into_iter().map(|(.., error)| error).collect();
        let mean_rad = mean(&errors);
        let correction = |k: u32, direction: Direction| {
            let asked = step_rad * f64::from(k);
            let led = shifted_to(asked, |led| section.error_rad(led, direction) - mean_rad);
            // As the file has it.
            ((led - asked) * ARCSEC_PER_RAD * 1e4).round() / 1e4
        };
        let column = |direction: &Direction| (*direction, (0..points).map(|k| correction(k, *direction)).collect());
        Curve { step_rad, mean_arcsec: mean_rad * ARCSEC_PER_RAD, corrections: directions.iter().map(column).collect() }
    }

    /// Correction that is in force where the generator leads the output to `led_rad`, arcsec; `None` in a direction
    /// that the curve was not made for.
    fn played_arcsec(&self, led_rad: f64, direction: Direction) -> Option<f64> {
        let (_, values) = self.corrections.iter().find(|(known, _)| *known == direction)?;
        let lookup = |asked: f64| {
            let at = (asked / self.step_rad).rem_euclid(values.len() as f64);
            let low = values[at as usize % values.len()];
            low + at.fract() * (values[(at as usize + 1) % values.len()] - low)
        };
        Some(lookup(shifted_to(led_rad, |asked| lookup(asked) / ARCSEC_PER_RAD)))
    }

    /// Residual on the table's own model: steady motion at the section's load. The core's is the bound of its inverse.
    pub fn on_model(&self, section: TableSection<'_>) -> PlaybackResidual {
        let bound = f64::from(section.table.inverse_error_bound_rad()) * ARCSEC_PER_RAD;
        let directions = self.corrections.iter().map(|(direction, _)| *direction);
        let point = |(led, direction, error)| {
            let error = error * ARCSEC_PER_RAD;
            [error, error + self.played_arcsec(led, direction).unwrap_or(0.0), 0.0]
        };
        let points: Vec<[f64; 3]> = section.samples(directions).into_iter().map(point).collect();
        PlaybackResidual { rms_core_arcsec: bound, ..PlaybackResidual::new(&points) }
    }

    /// The CSV: output asked for, generator angle before the correction (rad), corrections to be added (arcsec).
    pub fn csv(&self, section: TableSection<'_>) -> Files {
        let ratio = section.table.drive().exact_ratio();
        let mut text = section.comment("the correction is added to the output angle asked for");
        let _ = write!(text, "# ratio {ratio}\n# mean_error_arcsec {:.4}\noutput_rad,generator_rad", self.mean_arcsec);
        for (direction, _) in &self.corrections {
            text += if *direction == Direction::Forward { ",forward_arcsec" } else { ",backward_arcsec" };
        }
        for k in 0..self.corrections[0].1.len() {
            let asked = self.step_rad * k as f64;
            let _ = write!(text, "\n{asked:.9},{:.9}", asked * ratio);
            self.corrections.iter().for_each(|(_, column)| text += &format!(",{:.4}", column[k]));
        }
        vec![("playback.csv", (text + "\n").into_bytes())]
    }
}

/// A name of C or FPP.
fn word(text: &str) -> bool {
    let plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    plain && text.as_bytes().first().is_some_and(|byte| !byte.is_ascii_digit())
}

/// Errors with and without a playback, arcsec.
#[derive(Debug, Clone, Serialize)]
pub struct PlaybackResidual {
    /// Points or rows.
    pub rows: usize,
    /// Mean error, left out of all that follows.
    pub mean_left_out_arcsec: f64,
    /// Error without playback.
    pub rms_uncorrected_arcsec: f64,
    /// Residual with it.
    pub rms_played_arcsec: f64,
    /// Largest residual.
    pub max_played_arcsec: f64,
    /// Residual of the core with the same table.
    pub rms_core_arcsec: f64,
}

impl PlaybackResidual {
    /// Of points with error, residual and residual of the core, arcsec.
    fn new(points: &[[f64; 3]]) -> PlaybackResidual {
        let [(mean_left_out_arcsec, error), (_, played), (_, core)] = [0, 1, 2].map(|k| {
            let values: Vec<f64> = points.iter().map(|point| point[k]).collect();
            let middle = mean(&values);
            (middle, values.iter().map(|value| value - middle).collect::<Vec<f64>>())
        });
        PlaybackResidual {
            rows: points.len(),
            mean_left_out_arcsec,
            rms_uncorrected_arcsec: rms(&error),
            rms_played_arcsec: rms(&played),
            max_played_arcsec: played.iter().fold(0.0, |most, value| most.max(value.abs())),
            rms_core_arcsec: rms(&core),
        }
    }

    /// On measured rows, and what the core left of them; without a curve the core plays. Rows in a direction that the
    /// curve was not made for are left out.
    pub fn on_data(
        section: TableSection<'_>,
        rows: &[MeasuredRow],
        replayed: &[ReplayedRow],
        curve: Option<&Curve>,
    ) -> PlaybackResidual {
        let ratio = section.table.drive().exact_ratio();
        let point = |((row, core), direction): ((&MeasuredRow, &ReplayedRow), Direction)| {
            let played = match curve {
                Some(curve) => row.error_arcsec + curve.played_arcsec(row.generator_rad / ratio, direction)?,
                None => core.residual_arcsec,
            };
            Some([row.error_arcsec, played, core.residual_arcsec])
        };
        let rows = rows.iter().zip(replayed).zip(directions_of(rows, ratio));
        PlaybackResidual::new(&rows.filter_map(point).collect::<Vec<_>>())
    }
}

/// Direction of the output at each row.
fn directions_of(rows: &[MeasuredRow], ratio: f64) -> Vec<Direction> {
    let generators: Vec<f64> = rows.iter().map(|row| row.generator_rad).collect();
    let of = |way: f64| if way * ratio > 0.0 { Direction::Forward } else { Direction::Backward };
    directions(&generators).into_iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shifted_angle_is_found() {
        let shift = |angle: f64| 0.3 * (2.0 * angle).sin();
        for k in 0..100 {
            let angle = 0.1 * f64::from(k);
            assert!((shifted_to(angle + shift(angle), shift) - angle).abs() < 1e-12);
        }
    }

    #[test]
    fn a_row_at_rest_keeps_its_direction() {
        let row = |generator_rad| MeasuredRow {
            generator_rad,
            error_arcsec: 0.0,
            torque_n_m: 0.0,
            temperature_c: 20.0,
            session: 0,
        };
        let rows = [0.0, 0.0, 1.0, 1.0, 0.5, 0.5].map(row);
        use Direction::{Backward, Forward};
        assert_eq!(directions_of(&rows, 95.0), [Forward, Forward, Forward, Forward, Backward, Backward]);
        assert_eq!(directions_of(&rows, -94.0), [Backward, Backward, Backward, Backward, Forward, Forward]);
    }
}
