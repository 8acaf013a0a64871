//! moteus: `motor_position.sources.N.compensation_table` (fw/motor_position.h), a correction of the encoder on the
//! generator.
//!
//! 256 `int8` over a turn of the encoder, in 127ths of `compensation_scale`, which is a fraction of a turn. The comment
//! beside the table says that a value holds in the middle of its bin; `lerp`, its test and
//! `utils/compensate_encoder.py` take it at the left edge, and so does this. Single precision throughout.

use std::f64::consts::TAU;
use std::fmt::Write;

use flexspline::Direction;

use super::hats::Hats;
use super::{FIT_POINTS, Origin, Player, Refusal, Section, Written, mean};

/// `kCompensationSize`.
const SIZE: usize = 256;
/// Encoder sources of a controller.
const SOURCES: u8 = 3;
/// Most counts to a turn: beyond, single precision no longer holds every count.
const MAX_CPR: u32 = 1 << 24;

/// A compensation table and its lookup.
#[derive(Debug, Clone)]
pub struct Moteus {
    directions: Vec<Direction>,
    ratio: f64,
    source: u8,
    cpr: u32,
    table: Vec<i8>,
    scale: f32,
}

impl Moteus {
    /// Fits the table of an encoder source of `cpr` counts to a generator turn, for motion in these directions.
    pub fn fit(section: &Section<'_>, source: u8, cpr: u32, directions: &[Direction]) -> Result<Moteus, Refusal> {
        if source >= SOURCES {
            return Err(Refusal::Impossible(format!("--source: found {source}; allowed: 0 to {}", SOURCES - 1)));
        }
        if !(SIZE as u32..=MAX_CPR).contains(&cpr) {
            return Err(Refusal::Impossible(format!("--cpr: found {cpr}; allowed: {SIZE} to {MAX_CPR}")));
        }
        let samples = section.samples(None, FIT_POINTS, directions);
        let zero = mean(samples.iter().map(|sample| sample.error_rad));
        let mut hats = Hats::new(SIZE, 0.0, TAU / SIZE as f64, true);
        for sample in &samples {
            // What the encoder has to say is where the output is: the reading, and the error through the ratio.
            hats.add(sample.generator_rad, (sample.error_rad - zero) * section.ratio() / TAU);
        }
        let turns = hats.solve();
        let scale = turns.iter().fold(0.0, |most, value| f64::max(most, value.abs())) as f32;
        let steps = |value: &f64| if scale > 0.0 { (value / f64::from(scale) * 127.0).round() as i8 } else { 0 };
        let table = turns.iter().map(steps).collect();
        Ok(Moteus { directions: directions.to_vec(), ratio: section.ratio(), source, cpr, table, scale })
    }

    /// What the firmware adds to a reading in counts: `lerp`, and the sum in `float`.
    fn added_counts(&self, count: u32) -> f64 {
        let cpr = self.cpr as f32;
        let ratio = count as f32 * (1.0 / cpr);
        let size = SIZE as f32;
        let left = ((ratio * size) as usize).min(SIZE - 1);
        let fraction = (ratio - left as f32 / size) * size;
        let scale = self.scale / 127.0;
        let value = |index: usize| f32::from(self.table[index % SIZE]) * scale;
        let turns = value(left) * (1.0 - fraction) + value(left + 1) * fraction;
        f64::from(count as f32 + turns * cpr) - f64::from(count as f32)
    }
}

impl Player for Moteus {
    fn correction_rad(&self, led_rad: f64, _: Direction) -> f64 {
        let turn = (led_rad * self.ratio / TAU).rem_euclid(1.0);
        let count = ((turn * f64::from(self.cpr)) as u32).min(self.cpr - 1);
        // A reading that says more makes the loop hold the output further back.
        -self.added_counts(count) / f64::from(self.cpr) * TAU / self.ratio
    }

    fn directions(&self) -> &[Direction] {
        &self.directions
    }

    fn takes_a_side(&self) -> bool {
        true
    }

    fn points(&self) -> String {
        format!("{SIZE} bytes over a generator turn, none of what changes from turn to turn")
    }

    fn files(&self, _: &Origin) -> Vec<Written> {
        let mut text = String::new();
        for (k, value) in self.table.iter().enumerate() {
            let _ = writeln!(text, "conf set motor_position.sources.{}.compensation_table.{k} {value}", self.source);
        }
        let _ = writeln!(text, "conf set motor_position.sources.{}.compensation_scale {}", self.source, self.scale);
        // Every line is a command to the device: there is no comment.
        vec![Written::text("moteus.cfg", text)]
    }

    fn notes(&self) -> Vec<String> {
        vec![
            format!(
                "write it with moteus_tool --write-config moteus.cfg, then conf write; the zero of source {} has to \
                 be the generator's (sources.{}.offset, .sign)",
                self.source, self.source
            ),
            "where that source commutates the motor, calibrate the motor again with the table in force".to_owned(),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lookup_is_that_of_the_firmwares_own_test() {
        // Table, scale and answers of MotorPositionCompensation in fw/test/motor_position_test.cc, without the wrap.
        let mut table = vec![0i8; SIZE];
        table[..4].copy_from_slice(&[10, 0, -5, -2]);
        let (directions, cpr) = (super::super::BOTH.to_vec(), 16_384);
        let moteus = Moteus { directions, ratio: 1.0, source: 0, cpr, table, scale: 1.27 };
        for (raw, wanted) in [
            (0u32, 1638.4),
            (32, 851.2),
            (63, 88.6),
            (64, 64.0),
            (96, 16_070.4),
            (127, 15_704.6),
            (128, 15_692.8),
            (160, 15_970.56),
            (192, 16_248.32),
        ] {
            let found = (f64::from(raw) + moteus.added_counts(raw)).rem_euclid(16_384.0);
            assert!((found - wanted).abs() < 1e-2 * wanted.abs(), "{raw}: {found}, wanted {wanted}");
        }
    }
}
