//! Whose error it is: that of the output's encoder, of the generator's encoder, or of the gear. The waves that were
//! fitted are handed out with their covariance; nothing is fitted again.
//!
//! The error of an encoder is a curve over its own turn, the same at any load and on either flank. Of the gear, by the
//! signatures of causes in `docs/explanation/theory.md`:
//!
//! - The teeth mesh in two zones, half a turn of the generator apart, that turn with it. What a wheel does comes in
//!   waves of the generator, alone or against the output. A wave of the output alone is of second order (both wheels
//!   displaced) and changes with load and flank, or the weight of an arm makes it by the wind-up.
//! - Equal zones cancel the odd orders of the generator. What is left of them, and an eccentric generator, changes with
//!   load and flank.
//! - A pitch error of the fixed wheel makes even orders of the generator and changes with neither. No log tells them
//!   from the generator's encoder, unless the body of that was turned.
//!
//! A wave that may be the gear's stays whole with the gear, so that the three add up to the one table.

use std::f64::consts::TAU;

use serde::Serialize;

use super::interval::{ModelUncertainty, OF_95};
use super::parts::{GENERATOR_ORDERS, PartName, State, flank, usual_arcsec};
use super::reading::OFFSET;
use super::rows::Rows;
use super::{BOTH_WAYS, Calibration, LEAST_GAIN, Model, Prior};
use crate::misfit::about_mean;
use flexspline_base::units::ARCSEC_PER_RAD;

/// A wave of the gear changes with load or flank by at least this share of what stays of it, as an amplitude. *Guess*:
/// of a displaced wheel it changes by the sine of twice the angle at which the flanks bear and keeps its cosine, 0.8 at
/// 20°; an eccentric generator that the load presses in keeps as much as it loses.
const LEAST_CHANGE: f64 = 0.5;
/// A wave is an encoder's if no more than this share of it may be another's. *Guess*.
const MOST_OF_ANOTHER: f64 = 0.5;
/// Orders of the output that the weight of an arm makes by a wind-up that hardens. *Guess*.
const ORDERS_OF_A_WEIGHT: u32 = 3;

/// An encoder and the curve over its turn.
struct EncoderTurn {
    of: &'static str,
    turn: &'static str,
    part: PartName,
}

const ENCODERS: [EncoderTurn; 2] = [
    EncoderTurn { of: "encoder_output", turn: "output", part: PartName::OutputAngle },
    EncoderTurn { of: "encoder_generator", turn: "generator", part: PartName::GeneratorAngle },
];
const GEAR: &str = "gear";

/// The three parts of an error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Split {
    /// Output encoder, generator encoder, gear.
    pub parts: Vec<SplitPart>,
}

/// One of them.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SplitPart {
    /// Whose: `encoder_output`, `encoder_generator`, `gear`.
    pub of: &'static str,
    /// Over the rows, at the output, arcsec.
    pub rms_arcsec: f64,
    /// Half width of the interval that holds it with 95 %, with what may be another part's, rms over the rows, arcsec.
    pub half_width_arcsec: f64,
    /// Why nothing was recorded that shows its waves, where that is so: it may have any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_told: Option<String>,
    /// Its waves over the turns of the encoders.
    pub shares: Vec<WaveShare>,
}

/// A wave `amplitude cos(order angle - phase)` of the error at the output.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WaveShare {
    /// Whose turn: `output` or `generator`.
    pub turn: &'static str,
    /// Waves in a turn.
    pub order: u32,
    /// Amplitude, arcsec.
    pub amplitude_arcsec: f64,
    /// Phase by the generator angle of the logs, deg.
    pub phase_deg: f64,
    /// Half width of the interval of the wave, with what of it may be the gear's, arcsec.
    pub half_width_arcsec: f64,
    /// Least and largest share that the encoder of this turn has in it.
    pub of_encoder: [f64; 2],
    /// Why it was given to its part, and what to record where it stays whole.
    pub why: String,
}

/// An entry of an encoder's table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EncoderEntry {
    /// Which, from 0.
    pub entry: usize,
    /// Angle that the log reads there, deg.
    pub reading_deg: f64,
    /// Reading less truth, at the encoder, arcsec.
    pub error_arcsec: f64,
    /// To be added to the counts of the encoder.
    pub counts: Option<i64>,
}

/// Of what changes the waves of a gear, and none of an encoder, what was recorded; with the size that the changes may
/// have before the rows say anything, arcsec.
pub(super) fn recorded_changes(
    rows: &Rows,
    model: &Model,
    prior: &Prior<'_>,
    noise_arcsec: f64,
) -> Vec<(PartName, f64)> {
    let [low, high] = model.scales.torque_n_m;
    let winds_up = model.under_arcsec(high, prior) - model.under_arcsec(low, prior) > noise_arcsec;
    let forward = rows.rows.iter().filter(|row| flank(&row.at, model.scales.friction_n_m) > 0.0).count();
    let both = (BOTH_WAYS..=1.0 - BOTH_WAYS).contains(&(forward as f64 / rows.rows.len().max(1) as f64));
    let all = [(PartName::WavesByLoad, winds_up), (PartName::WavesByFlank, both)];
    let waves = ENCODERS.iter().filter_map(|encoder| model.of(encoder.part)).flatten();
    let largest = waves.fold(0.0, |most: f64, k| most.max(model.coefficients[k].abs()));
    let sized = |part| (part, largest.max(usual_arcsec(part, &model.scales)));
    all.into_iter().filter(|(_, recorded)| *recorded).map(|(part, _)| sized(part)).collect()
}

/// Waves that are handed out, and what is known of them.
pub(super) struct SplitWaves<'a> {
    pub model: &'a Model,
    pub known: &'a ModelUncertainty,
    /// The same with the changes that were recorded.
    pub changing: &'a ModelUncertainty,
    pub changes: &'a [(PartName, f64)],
    pub has_torque: bool,
    /// Parts that nothing was recorded of, and why.
    pub lacking: Vec<(PartName, String)>,
}

impl SplitWaves<'_> {
    /// Amplitude that the gear may have of a wave at the encoder of whose turn it is, arcsec; infinite if all, and why.
    fn of_gear(&self, encoder: &EncoderTurn, order: u32) -> (f64, Option<String>) {
        let of_output = encoder.part == PartName::OutputAngle;
        let turned = format!(
            "; turn the body of the {} encoder by {:.0} deg and calibrate again: what turns with it is the encoder's",
            encoder.turn,
            180.0 / f64::from(order)
        );
        if !of_output && order.is_multiple_of(2) {
            let why = format!("a pitch error of the fixed wheel does the same at any load and both ways{turned}");
            return (f64::INFINITY, Some(why));
        }
        if of_output && order <= ORDERS_OF_A_WEIGHT && !self.has_torque {
            let why = format!("the weight of an arm does the same by the wind-up: record the torque{turned}");
            return (f64::INFINITY, Some(why));
        }
        // Waves of the output stand behind those of the generator.
        let first = 2 * (order - 1 + u32::from(of_output) * u32::from(GENERATOR_ORDERS)) as usize;
        let change = |(part, _): &(PartName, f64)| {
            let [sine, cosine] = [0, 1].map(|k| self.changing.std_of(*part, first + k).unwrap_or(f64::INFINITY));
            OF_95 * sine.hypot(cosine)
        };
        match self.changes.iter().map(change).reduce(f64::max) {
            Some(most) => (most / LEAST_CHANGE, None),
            None => {
                let why = "one load on one flank was recorded: record both directions, and several loads";
                (f64::INFINITY, Some(why.to_owned()))
            }
        }
    }

    /// Hands the waves out; also the model of the gear. `prior` is the gear's.
    pub fn split(&self, states: &[State], prior: &Prior<'_>) -> (Split, Model) {
        let model = self.model;
        let mut gear = model.clone();
        let mut parts = [ENCODERS[0].of, ENCODERS[1].of, GEAR].map(|of| SplitPart { of, ..SplitPart::default() });
        // What may be the gear's of the waves of each encoder, mean squares.
        let mut open = [0.0; 2];
        let mut owner = vec![2; model.coefficients.len()];
        for (which, encoder) in ENCODERS.iter().enumerate() {
            if model.of(encoder.part).is_none() {
                // What gains too little to be fitted may be there.
                open[which] = LEAST_GAIN * self.known.noise.rms_arcsec.powi(2);
            }
            if let Some((part, why)) = self.lacking.iter().find(|(part, _)| *part == encoder.part) {
                open[which] = (OF_95 * usual_arcsec(*part, &model.scales)).powi(2);
                parts[which].not_told = Some(why.clone());
            }
            for (begin, order) in model.of(encoder.part).unwrap_or(0..0).step_by(2).zip(1..) {
                let [sine, cosine] = [0, 1].map(|k| model.coefficients[begin + k]);
                let [a, b] = [2, 1].map(|k| self.known.std_of(encoder.part, 2 * order as usize - k).unwrap_or(0.0));
                let (amplitude, own) = (sine.hypot(cosine), OF_95 * a.hypot(b) / 2.0_f64.sqrt());
                // What the load hides is shown, noise is not.
                if amplitude < own.min(self.known.noise.rms_arcsec) {
                    continue;
                }
                let (of_gear, why_all) = self.of_gear(encoder, order);
                let of_gear = of_gear.min(amplitude);
                let half_width = own.hypot(of_gear);
                let is_encoders = why_all.is_none() && half_width <= MOST_OF_ANOTHER * amplitude;
                let why = why_all.unwrap_or_else(|| {
                    format!(
                        "known to ±{own:.2} arcsec; as far as it may change with load and flank, ±{of_gear:.2} of it \
                         may be the gear's{}",
                        if is_encoders { "" } else { ": record several loads at the same angles, both ways" }
                    )
                });
                // What may be another's is open in both: of a wave that stays whole with the gear all of it.
                open[which] += 0.5 * if is_encoders { of_gear } else { amplitude }.powi(2);
                if is_encoders {
                    owner[begin..begin + 2].fill(which);
                    gear.coefficients[begin..begin + 2].fill(0.0);
                }
                parts[if is_encoders { which } else { 2 }].shares.push(WaveShare {
                    turn: encoder.turn,
                    order,
                    amplitude_arcsec: amplitude,
                    phase_deg: sine.atan2(cosine).to_degrees(),
                    half_width_arcsec: half_width,
                    of_encoder: [(1.0 - half_width / amplitude).max(0.0), 1.0],
                    why,
                });
            }
        }
        let count = states.len().max(1) as f64;
        for (which, part) in parts.iter_mut().enumerate() {
            let mut own = model.clone();
            own.coefficients.iter_mut().zip(&owner).filter(|of| *of.1 != which).for_each(|of| *of.0 = 0.0);
            let is_gear = part.of == GEAR;
            let says = |at: &State| if is_gear { own.says_arcsec(at, prior) } else { own.adds_arcsec(at) };
            part.rms_arcsec = about_mean(&states.iter().map(says).collect::<Vec<f64>>());
            let has = |k: usize| owner.get(k).map_or(is_gear, |owner| *owner == which);
            let variance = states.iter().map(|at| self.known.variance_of(at, has)).sum::<f64>() / count;
            let (of_no_part, open) =
                if is_gear { (self.known.of_no_part_arcsec, open.iter().sum()) } else { (0.0, open[which]) };
            part.half_width_arcsec = (OF_95.powi(2) * (variance + of_no_part.powi(2)) + open).sqrt();
        }
        (Split { parts: parts.into() }, gear)
    }
}

impl Calibration {
    /// The tables of the encoders, each with its name and this number of entries over a turn of the encoder; that of
    /// the output in counts as well, if it is known how many make a turn, negative where they fall as the angle rises.
    /// It goes by the zero of the first log.
    pub fn encoder_tables(
        &self,
        entries: usize,
        counts_of_output: Option<f64>,
    ) -> Vec<(&'static str, Vec<EncoderEntry>)> {
        let parts = self.split.iter().flat_map(|split| &split.parts).filter(|part| part.of != GEAR);
        let zero_rad =
            self.readings.iter().find(|reading| reading.name == OFFSET).map_or(0.0, |zero| zero.value) / ARCSEC_PER_RAD;
        let table = |part: &SplitPart| {
            let of_output = part.of == ENCODERS[0].of;
            // What the generator reads too far, the output lacks.
            let (zero_rad, factor, counts) =
                if of_output { (zero_rad, 1.0, counts_of_output) } else { (0.0, -self.ratio, None) };
            let entry = |entry: usize| {
                let reading_rad =
                    (TAU * entry as f64 / entries as f64 * counts.unwrap_or(1.0).signum()).rem_euclid(TAU);
                let wave = |share: &WaveShare| {
                    let angle = f64::from(share.order) * (reading_rad - zero_rad);
                    share.amplitude_arcsec * (angle - share.phase_deg.to_radians()).cos()
                };
                let error_arcsec = part.shares.iter().fold(0.0, |sum, share| sum + factor * wave(share));
                let in_counts = |counts: f64| (-error_arcsec / ARCSEC_PER_RAD / TAU * counts).round() as i64;
                EncoderEntry {
                    entry,
                    reading_deg: reading_rad.to_degrees(),
                    error_arcsec,
                    counts: counts.map(in_counts),
                }
            };
            (part.of, (0..entries).map(entry).collect())
        };
        parts.map(table).collect()
    }
}
