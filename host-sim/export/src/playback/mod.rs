//! A table for controllers that play a correction of their own: a curve over the output at one load, and the image of
//! the core for cFS and F´.
//!
//! The mean error is left out of every curve: homing holds a constant offset. Figures are about the mean.

mod cfs;
mod fprime;

use std::f64::consts::TAU;
use std::fmt::Write;

use flexspline::{Direction, GeneratorAngle, Table};
use serde::Serialize;

pub use cfs::{MAX_TABLE_BYTES, TableNameError, cfs};
pub use fprime::{ComponentError, fprime};

use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_identify::replay::{MeasuredRow, ReplayedRow};

/// Both directions of the output.
pub const BOTH: [Direction; 2] = [Direction::Forward, Direction::Backward];
/// Points in each direction at which the model is judged: prime, so that no order of the drive divides it.
const JUDGE_POINTS: u32 = 32_749;
/// Most rounds of a fixed-point iteration; the correction changes much less than the angle, so each gains a digit.
const ROUNDS: usize = 60;

/// Sign of the errors in files that hold the image.
const SIGN: &str = "that of the core: actual less nominal";

/// Names and contents of files, and notes for their user.
pub type Made = (Vec<(&'static str, Vec<u8>)>, Vec<String>);

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

/// A point of a section in steady motion.
struct SectionSample {
    /// Output angle that the generator leads to through the ratio, rad.
    led_rad: f64,
    direction: Direction,
    /// Output error, rad.
    error_rad: f64,
}

impl TableSection<'_> {
    fn sample(&self, led_rad: f64, direction: Direction) -> SectionSample {
        let generator = led_rad * self.table.drive().exact_ratio();
        let generator = GeneratorAngle::from_rad(generator).unwrap_or(GeneratorAngle::ZERO);
        let [torque, temperature] = [self.torque_n_m, self.temperature_c].map(|value| value as f32);
        let error = self.table.steady_error_rad(generator, torque, temperature, direction);
        SectionSample { led_rad, direction, error_rad: f64::from(error.unwrap_or(0.0)) }
    }

    /// Output turns after which the error repeats: those that take a whole number of generator turns.
    fn period_turns(&self) -> u32 {
        let drive = self.table.drive();
        let waves = u32::from(drive.circular_spline_teeth() - drive.flexspline_teeth());
        (1..waves).find(|turns| (drive.exact_ratio() * f64::from(*turns)).fract().abs() < 1e-9).unwrap_or(waves)
    }

    /// Evenly spaced points over the whole period, in each of the directions.
    fn samples(&self, directions: &[Direction]) -> Vec<SectionSample> {
        let step = TAU * f64::from(self.period_turns()) / f64::from(JUDGE_POINTS);
        let of = |direction: &Direction| {
            let direction = *direction;
            (0..JUDGE_POINTS).map(move |k| self.sample(step * f64::from(k), direction))
        };
        directions.iter().flat_map(of).collect()
    }

    /// Lines of a comment in a file made of this section, each after `prefix`: table, tool, load, sign.
    fn comment(&self, prefix: &str, sign: &str) -> String {
        format!(
            "{prefix}flexspline {} table_id {}\n{prefix}load {} N.m, {} degrees C\n{prefix}sign: {sign}\n",
            env!("CARGO_PKG_VERSION"),
            self.table.id(),
            self.torque_n_m,
            self.temperature_c
        )
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
    directions: Vec<Direction>,
    step_rad: f64,
    mean_arcsec: f64,
    /// Arcsec, one list for each direction.
    corrections: Vec<Vec<f64>>,
}

impl Curve {
    /// Corrections that bring the output to where it was asked for, with this number of points to a generator turn.
    pub fn new(section: TableSection<'_>, points_per_turn: u32, directions: &[Direction]) -> Curve {
        let turns = f64::from(section.period_turns());
        let points = (section.table.drive().exact_ratio().abs() * turns).round() as u32 * points_per_turn;
        let step_rad = TAU * turns / f64::from(points);
        let mean_rad = mean(section.samples(directions).iter().map(|sample| sample.error_rad));
        let correction = |k: u32, direction: Direction| {
            let asked = step_rad * f64::from(k);
            let led = shifted_to(asked, |led| section.sample(led, direction).error_rad - mean_rad);
            // As the file has it.
            ((led - asked) * ARCSEC_PER_RAD * 1e4).round() / 1e4
        };
        let column = |direction: &Direction| (0..points).map(|k| correction(k, *direction)).collect();
        let corrections = directions.iter().map(column).collect();
        Curve { directions: directions.to_vec(), step_rad, mean_arcsec: mean_rad * ARCSEC_PER_RAD, corrections }
    }

    /// Correction that is in force where the generator leads the output to `led_rad`, arcsec; `None` in a direction
    /// that the curve was not made for.
    fn played_arcsec(&self, led_rad: f64, direction: Direction) -> Option<f64> {
        let values = &self.corrections[self.directions.iter().position(|known| *known == direction)?];
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
        let point = |sample: SectionSample| {
            let error = sample.error_rad * ARCSEC_PER_RAD;
            let played = self.played_arcsec(sample.led_rad, sample.direction).unwrap_or(0.0);
            [error, error + played, 0.0]
        };
        let points: Vec<[f64; 3]> = section.samples(&self.directions).into_iter().map(point).collect();
        PlaybackResidual { rms_core_arcsec: bound, ..PlaybackResidual::new(&points) }
    }

    /// The CSV: output asked for, generator angle before the correction (rad), corrections to be added (arcsec).
    pub fn csv(&self, section: TableSection<'_>) -> (&'static str, Vec<u8>) {
        let ratio = section.table.drive().exact_ratio();
        let mut text = section.comment("# ", "the correction is added to the output angle asked for");
        let _ = writeln!(text, "# ratio {ratio}\n# mean_error_arcsec {:.4}", self.mean_arcsec);
        text += "output_rad,generator_rad";
        for direction in &self.directions {
            text += if *direction == Direction::Forward { ",forward_arcsec" } else { ",backward_arcsec" };
        }
        for k in 0..self.corrections[0].len() {
            let asked = self.step_rad * k as f64;
            let _ = write!(text, "\n{asked:.9},{:.9}", asked * ratio);
            self.corrections.iter().for_each(|column| text += &format!(",{:.4}", column[k]));
        }
        ("playback.csv", (text + "\n").into_bytes())
    }
}

/// A name of C or FPP.
fn word(text: &str) -> bool {
    let plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    plain && text.as_bytes().first().is_some_and(|byte| !byte.is_ascii_digit())
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    values.sum::<f64>() / count
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
        let means: [f64; 3] = std::array::from_fn(|k| mean(points.iter().map(|point| point[k])));
        let off = |k: usize| points.iter().map(move |point| point[k] - means[k]);
        let rms = |k: usize| mean(off(k).map(|value| value * value)).sqrt();
        PlaybackResidual {
            rows: points.len(),
            mean_left_out_arcsec: means[0],
            rms_uncorrected_arcsec: rms(0),
            rms_played_arcsec: rms(1),
            max_played_arcsec: off(1).fold(0.0, |most, value| most.max(value.abs())),
            rms_core_arcsec: rms(2),
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

/// Direction of the output at each row: that of the step to it; at rest, the one before; at the start, the first there
/// is.
fn directions_of(rows: &[MeasuredRow], ratio: f64) -> Vec<Direction> {
    let step = |k: usize| {
        let moved = (rows[k].generator_rad - rows[k - 1].generator_rad) / ratio;
        (moved != 0.0).then_some(if moved > 0.0 { Direction::Forward } else { Direction::Backward })
    };
    let first = (1..rows.len()).find_map(step).unwrap_or(Direction::Forward);
    let of = |now: &mut Direction, k: usize| {
        *now = (k > 0).then(|| step(k)).flatten().unwrap_or(*now);
        Some(*now)
    };
    (0..rows.len()).scan(first, of).collect()
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
        let row =
            |generator_rad| MeasuredRow { generator_rad, error_arcsec: 0.0, torque_n_m: 0.0, temperature_c: 20.0 };
        let rows = [0.0, 0.0, 1.0, 1.0, 0.5, 0.5].map(row);
        use Direction::{Backward, Forward};
        assert_eq!(directions_of(&rows, 95.0), [Forward, Forward, Forward, Forward, Backward, Backward]);
        assert_eq!(directions_of(&rows, -94.0), [Backward, Backward, Backward, Backward, Forward, Forward]);
    }
}
