//! Forward and inverse: what the output does, and what to command so that it does what is wanted.
//!
//! Signs: `transmission_error = actual − ideal` at the output; the command correction is its negative times the ratio
//! ([`Drive::corrected_command`](crate::Drive::corrected_command)). Positive load torque turns the
//! output forward.
//!
//! No search or loop whose length depends on the inputs, no heap, no panic, no libm. Instructions on a Cortex-M4F (release,
//! LTO), for 25 torques, 3 temperatures and 16 ripple nodes; they vary by at most 29 with the inputs, and holding still takes
//! less:
//!
//! | table | iterations | forward | inverse | step |
//! |---|---|---|---|---|
//! | ripple only | 1 | 793 | 1028 | 1477 |
//! | ripple and A, B, C | 1 | 940 | 1175 | 1771 |
//! | the same with steep curves | 5 | 940 | 2666 | 3253 |

use crate::angle::{GeneratorAngle, OutputAngle, RAD_PER_COUNT};
use crate::hysteresis::{Direction, PlayState};
use crate::table::{Bounds, OperatingPoint, Play, Quality, Table, larger};

/// Error of the inverse that the number of its iterations aims at, rad at the output: 0.02″, far below what a table misses of
/// its samples.
pub const INVERSE_TOLERANCE_RAD: f32 = 1.0e-7;
/// Most iterations of an inverse.
pub const MAX_INVERSE_ITERATIONS: u8 = 8;

impl Bounds {
    /// Iterations that bring the error below [`INVERSE_TOLERANCE_RAD`], 1 to 8; each takes it down to `slope` of itself.
    pub(crate) fn inverse_iterations(self) -> u8 {
        let mut error_rad = self.periodic_rad * self.slope;
        let mut iterations = 1u8;
        while error_rad > INVERSE_TOLERANCE_RAD && iterations < MAX_INVERSE_ITERATIONS {
            error_rad *= self.slope;
            iterations = iterations.saturating_add(1);
        }
        iterations
    }
}

/// What the output is expected to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Actual output angle: nominal plus transmission error.
    pub output: OutputAngle,
    /// Nominal output angle: generator over ratio.
    pub nominal: OutputAngle,
    /// Actual minus nominal, rad; 0 when disabled.
    pub transmission_error_rad: f32,
    /// The error lies within ± this of the value given, as far as play and jumps go, rad. What the table itself missed of
    /// its samples comes on top: [`Table::projection_worst_rad`].
    pub uncertainty_rad: f32,
    /// How far to trust it.
    pub quality: Quality,
}

/// What to command for a wanted output angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Generator angle to go to.
    pub generator: GeneratorAngle,
    /// The transmission error expected there, rad; 0 when disabled. The output is expected at the nominal output of
    /// `generator` plus this: the target, but for the case told at [`Approach::From`].
    pub predicted_error_rad: f32,
    /// As in [`Prediction`].
    pub uncertainty_rad: f32,
    /// How far to trust it.
    pub quality: Quality,
}

/// From which side of the play a target is reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Approach<'s> {
    /// Steady motion in this direction.
    Moving(Direction),
    /// From where the drive rests now: forward if the target is ahead of the output, backward if behind it. A reversal
    /// takes up the whole play at once; limiting the rate of that is the caller's part. A target within
    /// [`Table::inverse_error_bound_rad`] plus 8 counts (1.2e-8 rad) of where the output is holds the generator still, so
    /// that rounding cannot make it cross the play to and fro.
    ///
    /// While the play is crossed the output still moves with the centre of the table. A reversal smaller than that movement
    /// (at most [`Bounds::slope`] times the width of the play) has its target inside the play, where
    /// no side is in contact; it is then missed by what [`Command::predicted_error_rad`] says.
    ///
    /// A state that was never updated gives the middle of the play, with its half-width as uncertainty.
    From(&'s PlayState),
}

/// Targets this close to the output leave the generator where it is: the rounding of forward and inverse.
const HOLD_RAD: f32 = 8.0 * RAD_PER_COUNT;

/// Which side of the play the output will be on: e = centre − sign·half-width.
#[derive(Clone, Copy)]
enum Side {
    Steady(Direction),
    Middle,
}

impl Side {
    fn error_rad(self, play: Play) -> f32 {
        match self {
            Self::Steady(direction) => play.centre_rad - direction.sign() * play.half_width_rad,
            Self::Middle => play.centre_rad,
        }
    }
}

/// A motion that ends on one side of the play.
struct Move {
    side: Side,
    uncertainty_rad: f32,
    /// Where the play rests before, if that is known.
    resting: Option<OutputAngle>,
}

impl Move {
    /// How far the play rests beyond the side it is taken up on at `nominal`, signed like the error: 0 if that side is
    /// reached.
    fn short_of_contact_rad(&self, nominal: OutputAngle, play: Play) -> f32 {
        let (Side::Steady(direction), Some(resting)) = (self.side, self.resting) else {
            return 0.0;
        };
        let sign = direction.sign();
        let reached = nominal.offset_rad(-sign * play.half_width_rad);
        sign * larger(sign * resting.minus_rad(reached), 0.0)
    }
}

/// How a target is reached from where the drive rests.
enum Departure {
    Hold(Command),
    Move(Move),
}

impl Prediction {
    fn disabled(nominal: OutputAngle, uncertainty_rad: f32) -> Self {
        let quality = Quality::Disabled;
        Self { output: nominal, nominal, transmission_error_rad: 0.0, uncertainty_rad, quality }
    }
}

impl Table<'_> {
    /// Output angle for a generator angle, with the play followed in `state`.
    ///
    /// Call it once for every measured generator angle, in order: the play lives on the turning points. If torque or
    /// temperature is not finite the answer is `Disabled` with no error, and `state` follows the motion with the half-width
    /// of the last good step.
    #[must_use]
    pub fn forward(
        &self,
        state: &mut PlayState,
        generator: GeneratorAngle,
        torque_n_m: f32,
        temperature_c: f32,
    ) -> Prediction {
        self.follow(self.at(torque_n_m, temperature_c).as_ref(), state, generator)
    }

    /// Generator angle that brings the output to `target`.
    ///
    /// Solves `nominal(ψ) + e(ψ) = target` by fixed-point steps from the mean error; that they contract, and how many are
    /// needed, was found when the table was accepted. If an input is not finite the ideal command is given and marked
    /// `Disabled`.
    #[must_use]
    pub fn inverse(&self, target: OutputAngle, torque_n_m: f32, temperature_c: f32, approach: Approach<'_>) -> Command {
        self.aim(self.at(torque_n_m, temperature_c).as_ref(), target, approach)
    }

    /// One tick: [`Self::forward`] at the measured generator angle, then [`Self::inverse`] from there to the target. Locates
    /// torque and temperature once; the answers are the same.
    #[must_use]
    pub fn step(
        &self,
        state: &mut PlayState,
        measured: GeneratorAngle,
        target: OutputAngle,
        torque_n_m: f32,
        temperature_c: f32,
    ) -> (Prediction, Command) {
        let point = self.at(torque_n_m, temperature_c);
        let prediction = self.follow(point.as_ref(), state, measured);
        (prediction, self.aim(point.as_ref(), target, Approach::From(state)))
    }

    /// Transmission error in steady motion in `direction`, rad; `None` if an input is not finite.
    #[must_use]
    pub fn steady_error_rad(
        &self,
        generator: GeneratorAngle,
        torque_n_m: f32,
        temperature_c: f32,
        direction: Direction,
    ) -> Option<f32> {
        let point = self.at(torque_n_m, temperature_c)?;
        let phases = self.drive.phases(generator, self.drive.nominal_output(generator));
        Some(Side::Steady(direction).error_rad(self.play_at(&point, phases)?))
    }

    /// Iterations of an inverse: fixed when the table was accepted, so that every call does the same work.
    #[must_use]
    pub const fn inverse_iterations(&self) -> u8 {
        self.inverse_iterations
    }

    /// Largest error that the iterations leave in the inverse, rad at the output, beyond the rounding of angles (2 counts,
    /// 3e-9 rad).
    #[must_use]
    pub fn inverse_error_bound_rad(&self) -> f32 {
        (0..self.inverse_iterations).fold(self.bounds.periodic_rad, |error, _| error * self.bounds.slope)
    }

    fn follow(&self, point: Option<&OperatingPoint>, state: &mut PlayState, generator: GeneratorAngle) -> Prediction {
        let nominal = self.drive.nominal_output(generator);
        let phases = self.drive.phases(generator, nominal);
        let Some((point, play)) = point.and_then(|point| Some((point, self.play_at(point, phases)?))) else {
            state.coast(nominal);
            return Prediction::disabled(nominal, self.error_limit_rad);
        };
        let transmission_error_rad = state.update(nominal, play.centre_rad, play.half_width_rad);
        Prediction {
            output: nominal.offset_rad(transmission_error_rad),
            nominal,
            transmission_error_rad,
            uncertainty_rad: state.uncertainty_rad() + point.jump_rad,
            quality: point.quality_if_known(state.is_known()),
        }
    }

    fn aim(&self, point: Option<&OperatingPoint>, target: OutputAngle, approach: Approach<'_>) -> Command {
        point.and_then(|point| self.solve(point, target, approach)).unwrap_or(Command {
            generator: self.drive.nominal_generator(target),
            predicted_error_rad: 0.0,
            uncertainty_rad: self.error_limit_rad,
            quality: Quality::Disabled,
        })
    }

    fn solve(&self, point: &OperatingPoint, target: OutputAngle, approach: Approach<'_>) -> Option<Command> {
        let motion = match approach {
            Approach::Moving(direction) => Move { side: Side::Steady(direction), uncertainty_rad: 0.0, resting: None },
            Approach::From(state) => match self.departure(target, point, state) {
                Departure::Hold(command) => return Some(command),
                Departure::Move(motion) => motion,
            },
        };
        let mut play = Play { centre_rad: point.mean_rad, half_width_rad: point.half_width_rad };
        for _ in 0..self.inverse_iterations {
            let (generator, nominal) = self.drive.corrected_command(target, motion.side.error_rad(play));
            play = self.play_at(point, self.drive.phases(generator, nominal))?;
        }
        let error_rad = motion.side.error_rad(play);
        let (generator, nominal) = self.drive.corrected_command(target, error_rad);
        Some(Command {
            generator,
            predicted_error_rad: error_rad + motion.short_of_contact_rad(nominal, play),
            uncertainty_rad: motion.uncertainty_rad + point.jump_rad,
            quality: point.quality_if_known(motion.uncertainty_rad <= 0.0),
        })
    }

    /// Whether and to which side the play must be taken up on the way from `state` to `target`.
    fn departure(&self, target: OutputAngle, point: &OperatingPoint, state: &PlayState) -> Departure {
        let (Some(nominal), Some(output)) = (state.nominal(), state.output()) else {
            let uncertainty_rad = point.half_width_rad;
            return Departure::Move(Move { side: Side::Middle, uncertainty_rad, resting: None });
        };
        let ahead_rad = target.minus_rad(output);
        if ahead_rad.abs() <= self.inverse_error_bound_rad() + HOLD_RAD {
            return Departure::Hold(Command {
                generator: self.drive.nominal_generator(nominal),
                predicted_error_rad: output.minus_rad(nominal),
                uncertainty_rad: state.uncertainty_rad() + point.jump_rad,
                quality: point.quality_if_known(state.is_known()),
            });
        }
        // A target inside the interval may lie on the other side of the output: then the whole play is in doubt.
        let guess = ahead_rad.abs() <= state.uncertainty_rad();
        Departure::Move(Move {
            side: Side::Steady(if ahead_rad > 0.0 { Direction::Forward } else { Direction::Backward }),
            uncertainty_rad: if guess { 2.0 * point.half_width_rad } else { 0.0 },
            resting: Some(nominal.offset_rad(state.offset_rad())),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{self, ARCSEC};
    use core::f64::consts::TAU;
    use proptest::prelude::*;
    use std::sync::LazyLock;
    use std::vec::Vec;

    static IMAGE: LazyLock<Vec<u8>> = LazyLock::new(|| fixture::image(true));

    fn table() -> Table<'static> {
        Table::check(&IMAGE).unwrap()
    }

    fn angle(rad: f64) -> GeneratorAngle {
        GeneratorAngle::from_rad(rad).unwrap()
    }

    #[test]
    fn the_output_lags_the_motion_and_both_directions_match_the_closed_form() {
        let table = table();
        let mut state = PlayState::unknown();
        for (torque, temperature) in [(5.0f32, 20.0f32), (-0.7, 35.0), (33.0, -40.0)] {
            for direction in [Direction::Forward, Direction::Backward] {
                let mut last = None;
                for i in 0..4000 {
                    let generator = 40.0 + direction.sign() as f64 * i as f64 * 1e-3;
                    last = Some((generator, table.forward(&mut state, angle(generator), torque, temperature)));
                }
                let (generator, found) = last.unwrap();
                let truth = fixture::error(generator, torque as f64, temperature as f64, direction, true);
                assert!((found.transmission_error_rad as f64 - truth).abs() < 0.01 * ARCSEC);
                assert_eq!((found.quality, found.uncertainty_rad), (Quality::InRange, 0.0));
                let output = generator / 95.0 + truth;
                assert!((found.output.to_rad() - output).abs() < 0.01 * ARCSEC);
                let moved = found.output.minus_rad(found.nominal);
                assert!((moved - found.transmission_error_rad).abs() < 2e-9);
            }
        }
    }

    #[test]
    fn after_a_reset_the_error_is_an_interval_that_shrinks() {
        let table = table();
        let mut state = PlayState::unknown();
        let first = table.forward(&mut state, angle(1.0), 5.0, 20.0);
        assert_eq!(first.quality, Quality::Uncertain);
        let error = |direction| fixture::error(1.0, 5.0, 20.0, direction, true);
        let (low, high) = (error(Direction::Forward), error(Direction::Backward));
        assert!((first.transmission_error_rad as f64 - 0.5 * (low + high)).abs() < 0.01 * ARCSEC);
        assert!((first.uncertainty_rad as f64 - 0.5 * (high - low)).abs() < 0.01 * ARCSEC);
        // The play at 5 N·m is 100 µrad wide: 9.5 mrad of the generator.
        let mut before = first.uncertainty_rad;
        for i in 1..=12 {
            let now = table.forward(&mut state, angle(1.0 + 1e-3 * i as f64), 5.0, 20.0);
            assert!(now.uncertainty_rad <= before);
            before = now.uncertainty_rad;
        }
        assert_eq!(before, 0.0);
    }

    #[test]
    fn inside_a_jump_the_answer_says_how_much_it_does_not_know() {
        let table = table();
        let mut state = PlayState::after_motion(Direction::Forward);
        let at = |state: &mut PlayState, torque| table.forward(state, angle(1.0), torque, 20.0);
        let below = at(&mut state, 1.49);
        let above = at(&mut state, 1.51);
        assert_eq!((below.quality, above.quality), (Quality::InRange, Quality::InRange));
        let inside = at(&mut state, 1.5);
        assert_eq!(inside.quality, Quality::Uncertain);
        // Forward motion changes flank here: the whole backlash of 60″ is in doubt.
        let step = above.transmission_error_rad - below.transmission_error_rad;
        assert!((step as f64 - 60.0 * ARCSEC).abs() < 0.2 * ARCSEC, "{}", step as f64 / ARCSEC);
        for side in [below, above] {
            let off = (side.transmission_error_rad - inside.transmission_error_rad).abs();
            assert!(off <= inside.uncertainty_rad);
        }
        assert!(inside.uncertainty_rad < 1.1 * step);
        let command = table.inverse(OutputAngle::ZERO, 1.5, 20.0, Approach::Moving(Direction::Forward));
        assert_eq!((command.quality, command.uncertainty_rad > 0.9 * step), (Quality::Uncertain, true));
    }

    #[test]
    fn beyond_the_range_the_edge_holds_and_is_marked() {
        let table = table();
        let mut state = PlayState::after_motion(Direction::Backward);
        let edge = table.forward(&mut state, angle(2.0), 50.0, 80.0);
        assert_eq!(edge.quality, Quality::InRange);
        for (torque, temperature) in [(50.1, 80.0), (50.0, 80.1), (1e30, 1e30)] {
            let beyond = table.forward(&mut state, angle(2.0), torque, temperature);
            assert_eq!(beyond.quality, Quality::Extrapolated);
            assert_eq!(beyond.transmission_error_rad, edge.transmission_error_rad);
        }
    }

    #[test]
    fn bad_inputs_disable_the_correction_and_keep_the_play() {
        let table = table();
        let mut state = PlayState::after_motion(Direction::Forward);
        let _ = table.forward(&mut state, angle(1.0), 5.0, 20.0);
        let (mut blind, mut seeing) = (state, state);
        for (torque, temperature) in [(f32::NAN, 20.0), (5.0, f32::INFINITY), (f32::NEG_INFINITY, f32::NAN)] {
            let found = table.forward(&mut blind, angle(1.005), torque, temperature);
            assert_eq!((found.quality, found.transmission_error_rad), (Quality::Disabled, 0.0));
            assert_eq!(found.output, found.nominal);
            let command = table.inverse(OutputAngle::new(1, 7), torque, temperature, Approach::From(&blind));
            assert_eq!((command.quality, command.predicted_error_rad), (Quality::Disabled, 0.0));
            assert_eq!(command.generator, table.drive().nominal_generator(OutputAngle::new(1, 7)));
        }
        // A motion and its way back while blind leave the play where a seeing step would.
        for generator in [1.005, 0.998] {
            let _ = table.forward(&mut blind, angle(generator), f32::NAN, 20.0);
            let _ = table.forward(&mut seeing, angle(generator), 5.0, 20.0);
        }
        let difference = blind.offset_rad() - seeing.offset_rad();
        assert!(difference.abs() < 0.3 * ARCSEC as f32, "{}", difference as f64 / ARCSEC);
    }

    #[test]
    fn memory_damaged_after_the_check_disables_the_correction() {
        let table = table();
        let mut image = IMAGE.clone();
        let start = image.len() - 1000;
        image[start..].fill(0x7f);
        let records = table.records.len() * 4;
        let first = table.body_bytes - records;
        let damaged = Table { records: image[first..table.body_bytes].as_chunks().0, ..table };
        let mut state = PlayState::unknown();
        let found = damaged.forward(&mut state, angle(1.0), 50.0, 80.0);
        assert_eq!((found.quality, found.transmission_error_rad), (Quality::Disabled, 0.0));
        assert_eq!(state, PlayState::unknown());
    }

    #[test]
    fn a_reversal_commands_the_whole_play_and_a_hold_nothing() {
        let table = table();
        let mut state = PlayState::after_motion(Direction::Forward);
        let start = angle(3.0);
        let here = table.forward(&mut state, start, 5.0, 20.0);
        let held = table.inverse(here.output, 5.0, 20.0, Approach::From(&state));
        assert!(held.generator.minus_counts(start).abs() <= 48, "{:?}", held.generator.minus_counts(start));
        let difference = held.predicted_error_rad - here.transmission_error_rad;
        assert!(difference.abs() < 1e-9, "{difference}");

        let back = here.output.offset_rad(-2e-5);
        let command = table.inverse(back, 5.0, 20.0, Approach::From(&state));
        let play = (2.0 * 1.5 / 3.0e4 + 2e-5) * 95.0;
        let moved = -command.generator.minus_rad(start) as f64;
        assert!((moved - play).abs() < 0.05 * play, "{moved} {play}");
        let there = table.forward(&mut state, command.generator, 5.0, 20.0);
        assert!(there.output.minus_rad(back).abs() < 0.02 * ARCSEC as f32);
    }

    #[test]
    fn a_state_never_updated_gives_the_middle() {
        let table = table();
        let command = table.inverse(OutputAngle::new(0, 9), 5.0, 20.0, Approach::From(&PlayState::unknown()));
        assert_eq!(command.quality, Quality::Uncertain);
        assert!((command.uncertainty_rad as f64 - 5.0e-5).abs() < 0.2 * ARCSEC);
        let mean = |target| {
            let at = |direction| table.inverse(target, 5.0, 20.0, Approach::Moving(direction)).predicted_error_rad;
            0.5 * (at(Direction::Forward) + at(Direction::Backward))
        };
        let difference = command.predicted_error_rad - mean(OutputAngle::new(0, 9));
        assert!(difference.abs() < 0.2 * ARCSEC as f32);
    }

    #[test]
    fn the_stated_error_of_the_inverse_is_small() {
        assert!(table().inverse_error_bound_rad() < 0.2 * ARCSEC as f32);
    }

    proptest! {
        #[test]
        fn inverse_after_forward_is_the_identity(
            generator in -1000.0f64..1000.0, torque in -55.0f32..55.0, temperature in -50.0f32..90.0, forward: bool,
        ) {
            let table = table();
            let direction = if forward { Direction::Forward } else { Direction::Backward };
            let mut state = PlayState::after_motion(direction);
            let there = table.forward(&mut state, angle(generator), torque, temperature);
            let command = table.inverse(there.output, torque, temperature, Approach::Moving(direction));
            // Seen from the generator, an error at the output counts ratio times, and 1/(1 − slope) more.
            let bound = table.inverse_error_bound_rad() + 4.0 * RAD_PER_COUNT;
            let difference = command.generator.minus_rad(angle(generator)).abs();
            prop_assert!(difference <= 95.0 * bound * 1.2, "{} {}", difference, bound);
            prop_assert!((command.predicted_error_rad - there.transmission_error_rad).abs() <= bound);
            prop_assert_eq!(command.quality, there.quality);
        }

        #[test]
        fn forward_after_inverse_reaches_the_target(
            target in any::<i64>(), torque in -50.0f32..50.0, temperature in -40.0f32..80.0, forward: bool,
        ) {
            let table = table();
            // Within the turns that the generator can count.
            let target = OutputAngle::from_counts(target >> 8);
            let direction = if forward { Direction::Forward } else { Direction::Backward };
            let command = table.inverse(target, torque, temperature, Approach::Moving(direction));
            let mut state = PlayState::after_motion(direction);
            let there = table.forward(&mut state, command.generator, torque, temperature);
            let bound = table.inverse_error_bound_rad() + 4.0 * RAD_PER_COUNT;
            prop_assert!(there.output.minus_rad(target).abs() <= bound, "{}", there.output.minus_rad(target));
        }

        #[test]
        fn any_input_gives_finite_answers(
            steps in prop::collection::vec((any::<i64>(), any::<f32>(), any::<f32>()), 1..20),
        ) {
            let table = table();
            let mut state = PlayState::unknown();
            for (counts, torque, temperature) in steps {
                let generator = GeneratorAngle::from_counts(counts);
                let found = table.forward(&mut state, generator, torque, temperature);
                prop_assert!(found.transmission_error_rad.abs() <= 1.001 * table.error_limit_rad());
                prop_assert!(found.uncertainty_rad >= 0.0 && found.uncertainty_rad.is_finite());
                let command = table.inverse(found.output, torque, temperature, Approach::From(&state));
                prop_assert!(command.predicted_error_rad.abs() <= 1.001 * table.error_limit_rad());
            }
        }

        #[test]
        fn tracking_ends_where_it_should_whatever_the_path(
            targets in prop::collection::vec(-2.0e-3f64..2.0e-3, 1..30), torque in -50.0f32..50.0,
        ) {
            // Inside a jump forward and backward are both uncertain; elsewhere the loop must close exactly.
            prop_assume!((torque.abs() - 1.5).abs() > 0.02);
            let table = table();
            let mut state = PlayState::after_motion(Direction::Forward);
            let _ = table.forward(&mut state, GeneratorAngle::ZERO, torque, 20.0);
            for target in targets {
                let target = OutputAngle::from_rad(target).unwrap();
                let command = table.inverse(target, torque, 20.0, Approach::From(&state));
                let there = table.forward(&mut state, command.generator, torque, 20.0);
                let expected = there.nominal.offset_rad(command.predicted_error_rad);
                let missed = there.output.minus_rad(expected).abs() as f64;
                prop_assert!(missed < 0.05 * ARCSEC, "{} arcsec from what was predicted", missed / ARCSEC);
                // The widest play here: half the backlash of 60″ and the drag, both ways.
                let width = 2.0 * 45.0 * ARCSEC;
                let off = there.output.minus_rad(target).abs() as f64;
                prop_assert!(off < table.bounds().slope as f64 * width, "{} arcsec off", off / ARCSEC);
            }
        }
    }

    #[test]
    fn a_reversal_within_the_play_says_by_how_much_it_misses() {
        let table = table();
        let mut state = PlayState::after_motion(Direction::Forward);
        let _ = table.forward(&mut state, GeneratorAngle::ZERO, -25.221724, 20.0);
        let mut off = [0.0; 2];
        for (target, off) in [0.001_749_479_8, 0.001_747_644_2].into_iter().zip(&mut off) {
            let target = OutputAngle::from_rad(target).unwrap();
            let command = table.inverse(target, -25.221724, 20.0, Approach::From(&state));
            let there = table.forward(&mut state, command.generator, -25.221724, 20.0);
            let unforeseen = there.transmission_error_rad - command.predicted_error_rad;
            assert!((unforeseen.abs() as f64) < 0.01 * ARCSEC, "{unforeseen}");
            *off = there.output.minus_rad(target).abs() as f64 / ARCSEC;
        }
        // The first is reached in contact; on the way to the second the centre itself moves the output past it.
        assert!(off[0] < 0.01 && off[1] > 0.05, "{off:?} arcsec");
    }

    #[test]
    fn steady_tracking_meets_every_target() {
        let table = table();
        let mut state = PlayState::after_motion(Direction::Forward);
        let _ = table.forward(&mut state, GeneratorAngle::ZERO, 5.0, 20.0);
        for i in 0..20_000i32 {
            // Forward 1000 steps, backward 1000 steps; each step exceeds what the centre moves across the play.
            let place = if (i / 1000) % 2 == 0 { i % 1000 } else { 1000 - i % 1000 };
            let target = OutputAngle::from_rad(1e-3 + place as f64 * 2.0e-5).unwrap();
            let command = table.inverse(target, 5.0, 20.0, Approach::From(&state));
            let there = table.forward(&mut state, command.generator, 5.0, 20.0);
            let off = there.output.minus_rad(target).abs() as f64;
            assert!(off < 0.05 * ARCSEC, "step {i}: {} arcsec", off / ARCSEC);
        }
    }

    #[test]
    fn a_million_steps_of_forward_leave_no_drift() {
        let table = table();
        let mut state = PlayState::after_motion(Direction::Forward);
        let start = angle(2.0);
        let first = table.forward(&mut state, start, 5.0, 20.0);
        let stroke = angle(TAU * 0.003);
        // To and fro inside the play: nothing may creep.
        for _ in 0..500_000 {
            let _ = table.forward(&mut state, start.offset_counts(-(stroke.counts() >> 4)), 5.0, 20.0);
            let _ = table.forward(&mut state, start, 5.0, 20.0);
        }
        assert_eq!(table.forward(&mut state, start, 5.0, 20.0), first);
    }
}
