//! Tables of the extended model: sampled in steady motion, both ways, at the nodes of torque and temperature, and
//! projected by the core's own code.

use std::f64::consts::TAU;

use flexspline::{Direction, Table};
use flexspline_make::{Harmonics, MissingDirection, Plan, Sample};

use super::model::Model;
use crate::calibrate::{APART, JUMP_HALF_WIDTH, ONE_TEMPERATURE_K, RIPPLE_NODES};
use crate::causes::{CauseName, InTable, OF_THE_OUTPUT_ENCODER};
use crate::diagnosis::{Extended, PipelineError, Series, nominal_arcsec};
use crate::measurement::Session;
use crate::nominal::Nominal;
use crate::synthesize::Sizes;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::tables::{MadeTable, from_plan, places_that_tell_apart};
use flexspline_mechanics::drive::GeneratorKind;

/// Positions over a whole turn of the output, at least and at most. Fitted are a few dozen numbers at each load.
const LEAST_POSITIONS: usize = 151;
const MOST_POSITIONS: usize = 1009;
/// Orders that a model may have in addition to those fitted: of errors that the clearance rectifies.
const FURTHER_ORDERS: [u16; 3] = [8, 10, 12];
/// Tooth meshes of higher order than this are none in the model.
const MESHES: u16 = 4;
/// Positions that a session runs through before those that are sampled: the play comes to rest.
const BEFORE: usize = 40;
/// Orders fitted: of the generator and of the generator against the output, and of the output.
const ORDERS: [u16; 5] = [1, 2, 3, 4, 6];
const OUTPUT_ORDERS: [u16; 2] = [1, 2];
/// Nodes of the torque axis on each side where no table gives them, and how they crowd towards the friction.
const TORQUE_STEPS: u32 = 9;
const CROWDING: f64 = 1.6;
/// Friction that a model without any is given, of the largest torque: the play needs a torque at which it changes
/// flanks.
const LEAST_FRICTION: f64 = 1e-3;
/// Half-width (rad) below zero that is taken for what the projection leaves.
const NEGATIVE_HALF_WIDTH_RAD: f64 = 1e-4;

/// Nodes symmetric about zero: a pair at either side of the friction, where the flank changes, and further ones up to
/// the largest torque.
fn torque_nodes(friction: f64, largest: f64) -> Vec<f32> {
    let half = JUMP_HALF_WIDTH * friction;
    let further = (1..=TORQUE_STEPS).map(|k| {
        let share = (f64::from(k) / f64::from(TORQUE_STEPS)).powf(CROWDING);
        friction + half + (largest - friction - half) * share
    });
    let positive: Vec<f64> = [friction - half, friction + half].into_iter().chain(further).collect();
    positive.iter().rev().map(|t| -t).chain(positive.iter().copied()).map(|t| t as f32).collect()
}

/// Positions over a whole turn of the output on which no order of the tooth mesh, of the generator, of the generator
/// against the output, or of the output folds onto another: a prime.
fn positions(ratio: f64, teeth: f64) -> usize {
    let ratio = ratio.abs();
    let turns = [ratio, ratio - 1.0, ratio + 1.0];
    let of_generator =
        ORDERS.iter().chain(&FURTHER_ORDERS).flat_map(|k| turns.map(|per_turn| f64::from(*k) * per_turn));
    let of_output = OUTPUT_ORDERS.iter().map(|k| f64::from(*k));
    let of_mesh = (1..=MESHES).map(|k| f64::from(k) * teeth * ratio);
    let orders: Vec<f64> = of_generator.chain(of_output).chain(of_mesh).chain([0.0]).collect();
    places_that_tell_apart(&orders, [LEAST_POSITIONS, MOST_POSITIONS], APART)
}

/// The inputs of tables of an extended model.
pub struct ExtendedTables<'a> {
    /// The nominal model.
    pub nominal: &'a Nominal,
    /// The table that takes its place, if there is one.
    pub table: Option<&'a Table<'a>>,
    /// The model whose causes were known before, if there are any.
    pub known: Option<(&'a Model, Sizes)>,
    /// Generator that names the file.
    pub kind: GeneratorKind,
    /// Name of the drive.
    pub drive: String,
    /// BLAKE3 of the drive, or of the nominal model.
    pub hash: [u8; 32],
    /// Torque, N·m, and temperatures, °C, of the data, where no table gives the axes.
    pub torque_n_m: f64,
    /// Least and largest.
    pub temperatures_c: [f64; 2],
    /// Angle against gravity at which the drive stays, rad; `None` if it is turned about, or not known.
    pub orientation_rad: Option<f64>,
}

impl ExtendedTables<'_> {
    /// Why a cause is not in a table of this drive, if it is not; of the encoder, whether it is that of the output.
    pub(crate) fn left_out(&self, cause: CauseName, at_output: bool) -> Option<&'static str> {
        match cause.spec().in_table {
            InTable::Yes if at_output => Some(OF_THE_OUTPUT_ENCODER),
            InTable::Yes => None,
            InTable::AtOneOrientation => {
                self.orientation_rad.is_none().then_some("the drive is turned against gravity")
            }
            InTable::No(why) => Some(why),
        }
    }

    /// The nominal model, with the causes known before, as a table.
    ///
    /// # Errors
    /// The samples make no table; the causes known before cannot be simulated.
    pub(crate) fn nominal(&self, extended: Option<&Extended>) -> Result<MadeTable, PipelineError> {
        let of = if self.known.is_some() { "extended model" } else { "nominal model" };
        self.make(of, |sessions| {
            let nominal = nominal_arcsec(sessions, self.nominal, self.table, extended).into_iter();
            nominal.map(|nominal| [nominal.clone(), nominal]).collect()
        })
    }

    /// The extended model as a table, without the causes that have no place there. The zero of the encoder is not in
    /// it.
    ///
    /// # Errors
    /// As [`ExtendedTables::nominal`].
    pub(crate) fn extended(&self, extended: &Extended) -> Result<MadeTable, PipelineError> {
        let causes = extended.causes().iter();
        let left_out: Vec<bool> =
            causes.map(|cause| self.left_out(cause.name(), cause.at_output()).is_some()).collect();
        self.make("extended model", |sessions| {
            let error = |mut series: Series| {
                for (part, _) in series.cause_arcsec.iter().zip(&left_out).filter(|(_, out)| **out) {
                    series.extended_arcsec.iter_mut().zip(part).for_each(|(sum, part)| *sum -= part);
                }
                [series.nominal_arcsec, series.extended_arcsec]
            };
            extended.predict(sessions, self.nominal, self.table).into_iter().map(error).collect()
        })
    }

    /// What the causes known before add to each session, arcsec, those aside that have no place in a table.
    fn known_arcsec(&self, sessions: &[Session]) -> Result<Vec<Vec<f64>>, PipelineError> {
        let Some((model, sizes)) = self.known else { return Ok(vec![Vec::new(); sessions.len()]) };
        let mut model = model.clone();
        model.causes.retain(|cause| self.left_out(cause.name, cause.at_output()).is_none());
        model.added_arcsec(sessions, sizes).map_err(PipelineError::Known)
    }

    fn axes(&self) -> (Vec<f32>, Vec<f32>) {
        if let Some(table) = self.table {
            return (table.torque_nodes_n_m().collect(), table.temperature_nodes_c().collect());
        }
        let largest = self.torque_n_m.max(1e-3);
        let friction = self.nominal.friction_torque_n_m.max(LEAST_FRICTION * largest);
        let torques = torque_nodes(friction, largest.max(3.0 * friction));
        let [low, high] = self.temperatures_c;
        let middle = f64::midpoint(low, high);
        let temperatures = if high - low > ONE_TEMPERATURE_K { vec![low, high] } else { vec![middle] };
        (torques, temperatures.into_iter().map(|celsius| celsius as f32).collect())
    }

    /// A table called `of` of what is predicted for sessions: by the nominal model, and in all, arcsec.
    fn make(
        &self,
        of: &str,
        predicted: impl FnOnce(&[Session]) -> Vec<[Vec<f64>; 2]>,
    ) -> Result<MadeTable, PipelineError> {
        let (torques, temperatures) = self.axes();
        let drive = self.table.map_or_else(|| self.nominal.core_drive(), |table| Ok(*table.drive()))?;
        let samples = self.sample(predicted, &torques, &temperatures)?;
        let plan = Plan {
            drive,
            torque_nodes_n_m: &torques,
            temperature_nodes_c: &temperatures,
            ripple_nodes: RIPPLE_NODES,
            generator: Harmonics::of(&ORDERS),
            material: Harmonics::of(&ORDERS),
            output: Harmonics::of(&OUTPUT_ORDERS),
            missing_direction: MissingDirection::Refuse,
            negative_half_width_tolerance_rad: NEGATIVE_HALF_WIDTH_RAD,
            deviation_limit_rad: f64::from(flexspline::Table::MAX_ERROR_RAD),
        };
        Ok(from_plan(&self.drive, self.hash, self.kind, &plan, &samples, (of, u64::MAX))?)
    }

    /// Steady motion both ways through a whole turn of the output at every node.
    fn sample(
        &self,
        predicted: impl FnOnce(&[Session]) -> Vec<[Vec<f64>; 2]>,
        torques: &[f32],
        temperatures: &[f32],
    ) -> Result<Vec<Sample>, PipelineError> {
        let ratio = self.nominal.ratio;
        // Without teeth there is no mesh.
        let positions = positions(ratio, self.nominal.teeth.map_or(0.5, |teeth| f64::from(teeth.flexspline)));
        let mut sessions = Vec::new();
        for &temperature in temperatures {
            for &torque in torques {
                for turn in [1.0, -1.0] {
                    sessions.push(self.steady(turn, positions, [torque, temperature], sessions.len()));
                }
            }
        }
        let mut predicted = predicted(&sessions);
        for ([_, error], known) in predicted.iter_mut().zip(self.known_arcsec(&sessions)?) {
            error.iter_mut().zip(known).for_each(|(error, known)| *error += known);
        }
        let mut samples = Vec::new();
        let mut beyond = 0.0;
        for (session, [nominal, error]) in sessions.iter().zip(&predicted) {
            let rises = session.generator_rad[1] > session.generator_rad[0];
            let direction = if rises == (ratio > 0.0) { Direction::Forward } else { Direction::Backward };
            let rows = session.states(0.0).zip(nominal.iter().zip(error)).skip(BEFORE);
            for ([generator_rad, torque_n_m, temperature_c], (nominal, error)) in rows {
                beyond += error - nominal;
                let output_rad = generator_rad / ratio + error / ARCSEC_PER_RAD;
                samples.push(Sample { generator_rad, torque_n_m, temperature_c, direction, output_rad });
            }
        }
        // The zero of the encoder: what is left when both signs of load, both directions and all angles have their
        // part.
        let zero = beyond / samples.len().max(1) as f64 / ARCSEC_PER_RAD;
        samples.iter_mut().for_each(|sample| sample.output_rad -= zero);
        Ok(samples)
    }

    fn steady(&self, turn: f64, positions: usize, at: [f32; 2], number: usize) -> Session {
        let step = turn * TAU * self.nominal.ratio.abs() / positions as f64;
        let rows = BEFORE + positions;
        // So slow that nothing of it depends on speed.
        let time_s = (0..rows).map(|k| 1e4 * (k + 2 * rows * number) as f64).collect();
        let generator_rad = (0..rows).map(|k| (k as f64 - BEFORE as f64) * step).collect();
        let [torque, temperature] = at.map(f64::from);
        let others = [torque, temperature, self.orientation_rad.unwrap_or(0.0)].map(|value| vec![value; rows]);
        Session::imagined(time_s, generator_rad, others)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_rise_and_the_jump_is_known_for_one() {
        for (friction, largest) in [(1.5, 40.0), (0.04, 40.0), (10.0, 30.0), (1e-3, 1.0)] {
            let nodes = torque_nodes(friction, largest);
            assert!(nodes.windows(2).all(|pair| pair[0] < pair[1]), "{nodes:?}");
            assert!((f64::from(nodes[nodes.len() - 1]) / largest - 1.0).abs() < 1e-6);
            let width = |k: usize| nodes[k + 1] - nodes[k];
            let jump = nodes.len() / 2;
            assert!(width(jump + 1) > 8.0 * width(jump) && width(jump - 1) > 8.0 * width(jump), "{nodes:?}");
        }
    }

    #[test]
    fn no_order_folds_onto_another() {
        for (ratio, teeth, fixed) in
            [(95.0, 188i64, 1i64), (-94.0, 188, -1), (50.0, 100, 1), (121.0, 240, 1), (160.0, 318, 1)]
        {
            let count = positions(ratio, teeth as f64) as i64;
            assert!(count < 400, "{count} positions for {ratio}");
            let folded = |per_output_turn: i64| {
                let rest = per_output_turn.rem_euclid(count);
                rest.min(count - rest)
            };
            let generator = ratio.abs() as i64;
            let orders = ORDERS.iter().flat_map(|k| [generator, generator - fixed].map(|of| of * i64::from(*k)));
            let mesh = (1..=4).map(|k| teeth * generator * k);
            let mut all: Vec<i64> = orders.chain([1, 2]).chain(mesh).map(folded).chain([0]).collect();
            all.sort_unstable();
            assert!(all.windows(2).all(|pair| pair[0] < pair[1]), "{ratio}: {all:?}");
        }
    }
}
