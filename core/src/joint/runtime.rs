//! The fixed-step runtime of one joint: one call for each tick, with the same work in each.
//!
//! In this order: the measured generator angle is judged; torque and temperature are located in the table; the play follows the
//! generator (forward); the target is turned into a correction (inverse); mode and overrun policy say how much of it is wanted;
//! a limiter moves the correction there; the scrubber of the table does its slice. What slower rate groups do is called by the
//! firmware after [`Joint::tick`], in an order that is fixed in its source ([`RateGroup`](crate::RateGroup)).
//!
//! | what happens | what the joint does | flag |
//! |---|---|---|
//! | no sample | keeps the last generator angle: the play does not move | [`Flags::SAMPLE_LOST`] |
//! | a sample further from the last one than a tick allows | takes it for a glitch, as no sample; if it stays for `patience` ticks, takes it as true, with the side of the play unknown | [`Flags::GLITCH`] |
//! | torque or temperature not finite, or the table in doubt | keeps the last correction for `patience` ticks, then fades it out | [`Flags::NOT_CORRECTED`] |
//! | torque or temperature out of range | corrects with the value at the edge | [`Quality::Extrapolated`](crate::Quality::Extrapolated) |
//! | a tick came late | by [`Overrun`] | [`Flags::OVERRUN`] |
//! | a reversal, or anything else that wants a faster correction | the limiter holds it back; by how much is in [`Output::held_back_rad`] | [`Flags::HELD_BACK`] |
//! | an upset in the state | an interval of the play that cannot be is taken for unknown; of two corrections that differ the nearer to the goal counts | [`Flags::STATE_TORN`] |
//! | reset | [`JointState::restore`] goes on where it was, [`JointState::new`] starts with no correction and the side of the play unknown; both within the limits | |

use super::adjustment::{Adjustment, bounded};
use super::limits::{Limits, SettingError, checked};
use super::mode::{Mode, Overrun};
use super::signals::{Flags, Input, Output};
use super::state::{FINE, JointState};
use crate::angle::{GeneratorAngle, OutputAngle, RAD_PER_COUNT};
use crate::drive::Drive;
use crate::num;
use crate::play::PlayState;
use crate::store::{Images, Store};
use crate::table::{Approach, Command, Estimate, Memory, Model, Prediction, departure};

/// Less than a count.
const WITHIN: i32 = FINE - 1;

/// One joint: all that does not change while it runs. Can be made at compile time and lie in flash.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    drive: Drive,
    overrun: Overrun,
    /// Fine counts in a tick, and in a tick more each tick.
    rate: i32,
    acceleration: i32,
    /// A quarter of the square of the acceleration.
    quarter_square: f32,
    largest_move: i32,
    patience: u32,
    /// Twice the ticks of a fade, and the part of the correction that one tick of it takes.
    fade: u32,
    fade_step: f32,
}

#[inline(always)]
const fn within(value: i32, least: i32, most: i32) -> i32 {
    let above = if value > least { value } else { least };
    if above < most { above } else { most }
}

impl Joint {
    /// A joint with this drive.
    ///
    /// # Errors
    /// [`SettingError`]: a limit that is not finite and positive, or beyond 0.05 rad (rate) or half a turn (generator) in a tick,
    /// or a rate below 9e-11 rad in a tick.
    pub const fn new(drive: Drive, limits: Limits, overrun: Overrun) -> Result<Self, SettingError> {
        let Limits { tick_s, rate_rad_s, acceleration_rad_s2, generator_rate_rad_s, patience } = limits;
        let tick = tick_s as f64;
        let tick_ok = checked("tick_s", tick_s, tick, [0.0, 1.0e3]);
        if let Err(error) = tick_ok {
            return Err(error);
        }
        // Slower than one part in a tick would be no correction at all.
        let bounds = [1.0, num::counts(0.05) * FINE as f64];
        let rate = match checked("rate_rad_s", rate_rad_s, num::counts(rate_rad_s as f64 * tick) * FINE as f64, bounds)
        {
            Ok(rate) => rate,
            Err(error) => return Err(error),
        };
        let per_tick = num::counts(acceleration_rad_s2 as f64 * tick * tick) * FINE as f64;
        let acceleration = match checked("acceleration_rad_s2", acceleration_rad_s2, per_tick, [0.0, 1.0e12]) {
            Ok(acceleration) => acceleration,
            Err(error) => return Err(error),
        };
        // More than from full speed to full speed back is not needed, and would drown what is left to go in rounding.
        let acceleration = if acceleration < 2.0 * rate { acceleration } else { 2.0 * rate };
        let per_tick = num::counts(generator_rate_rad_s as f64 * tick);
        let largest_move = match checked("generator_rate_rad_s", generator_rate_rad_s, per_tick, [0.0, 2_147_483_000.0])
        {
            Ok(counts) => counts as i32,
            Err(error) => return Err(error),
        };
        let ticks = match overrun {
            Overrun::FadeOut { ticks } => ticks,
            Overrun::SkipAndCount | Overrun::HoldLast => 0,
        };
        let fade_step = if ticks == 0 { 0.0 } else { 1.0 / ticks as f32 };
        let fade = ticks as u32;
        // A whole number of fine counts, no less than one and no more than asked for otherwise.
        let most = i32::MAX as f32 / 4.0;
        let acceleration = if acceleration < most { acceleration } else { most } as i32;
        let acceleration = if acceleration < 1 { 1 } else { acceleration };
        let gain = acceleration as f32;
        let quarter_square = 0.25 * gain * gain;
        let rate = if rate < 1.0 { 1 } else { rate as i32 };
        Ok(Self {
            drive,
            overrun,
            rate,
            acceleration,
            quarter_square,
            largest_move,
            patience: patience as u32,
            fade,
            fade_step,
        })
    }

    /// The drive.
    #[must_use]
    pub const fn drive(&self) -> &Drive {
        &self.drive
    }

    /// Output angle for a generator angle, with the play followed in `play`: as [`crate::Table::forward`], from the copies.
    #[must_use]
    pub fn forward(
        &self,
        store: &Store,
        play: &mut PlayState,
        generator: GeneratorAngle,
        torque_n_m: f32,
    ) -> Prediction {
        self.model(store).follow(&store.locate_here(torque_n_m, 0, 0), play, generator)
    }

    /// Generator angle that brings the output to `target`: as [`crate::Table::inverse`], from the copies.
    #[must_use]
    pub fn inverse(&self, store: &Store, target: OutputAngle, torque_n_m: f32, approach: Approach<'_>) -> Command {
        self.model(store).aim(&store.locate_here(torque_n_m, 0, 0), target, approach)
    }

    #[inline(always)]
    fn model<'s>(&'s self, store: &'s Store) -> Model<'s, Store> {
        Model { memory: store, drive: &self.drive }
    }

    /// One tick.
    ///
    /// Instructions are counted by `tests/firmware`; the same number in every tick with the same table.
    #[must_use]
    pub fn tick(&self, images: &Images<'_>, store: &mut Store, state: &mut JointState, input: &Input) -> Output {
        let Adjustment { mean_counts, half_width_counts } = input.adjustment;
        let mean_counts = bounded(mean_counts);
        let point = store.locate(input.torque_n_m, mean_counts, bounded(half_width_counts));
        let torn = (state.told_twice() != state.output) | !state.play.is_ordered();
        // An adjustment is learnt, not moved; the one before a reset is in what was saved.
        let learnt = mean_counts.wrapping_sub(state.adjusted);
        state.play.shift(if state.started { learnt } else { 0 });
        state.adjusted = mean_counts;
        let (generator, sample_flags, doubted) = self.judge(state, input);
        if torn | doubted {
            state.play = PlayState::unknown();
        }
        let model = self.model(store);
        let now = model.estimate(&point, &mut state.play, generator);
        state.output = state.told_twice();
        let Estimate { output, error, mut doubt, .. } = now;
        let from = departure(store.plan(), &point, input.target, &state.play, output);
        let (found, allowed) = model.solve(&point, input.target, from.backward, &mut doubt);
        let sane = now.sane & allowed & doubt.none();
        // The correction that leaves the generator where it is.
        let still = from.ahead.wrapping_add(error);
        let wanted = if from.hold { still } else { found };
        let aimed = from.uncertainty.wrapping_add(point.jump);
        let aimed = if sane { aimed } else { store.plan().limit };
        let uncertainty = if aimed > now.uncertainty { aimed } else { now.uncertainty };
        let known = state.play.is_known() & (from.uncertainty <= 0);

        let (goal, late) = self.goal(state, input, wanted, sane);
        let (correction, one) = self.limit(state, goal);
        store.tend(images, doubt, point.whole);

        let held_back = goal.wrapping_sub(correction);
        let flags = sample_flags
            .with(Flags::OVERRUN, late)
            .with(Flags::HELD_BACK, held_back.wrapping_add(WITHIN) as u32 > (2 * WITHIN) as u32)
            .with(Flags::NOT_CORRECTED, !sane)
            .with(Flags::TABLE_DOUBT, !doubt.none())
            .with(Flags::STATE_TORN, torn | !one);
        let counts = correction >> FINE.trailing_zeros();
        Output {
            command: self.drive.nominal_generator(input.target.offset_counts((counts as i64).wrapping_neg())),
            output,
            transmission_error_rad: error as f32 * RAD_PER_COUNT,
            uncertainty_rad: uncertainty as f32 * RAD_PER_COUNT,
            correction_rad: correction as f32 * (RAD_PER_COUNT / FINE as f32),
            held_back_rad: held_back as f32 * (RAD_PER_COUNT / FINE as f32),
            quality: point.quality(sane, known),
            flags,
        }
    }

    /// The generator angle to believe, and whether it tells that the play is not where it was thought.
    #[inline(always)]
    fn judge(&self, state: &mut JointState, input: &Input) -> (GeneratorAngle, Flags, bool) {
        let (lost, sample) = match input.generator {
            Some(sample) => (false, sample),
            None => (true, state.generator),
        };
        // Outside ± the largest move.
        let most = self.largest_move as i64;
        let beyond = sample.minus_counts(state.generator).wrapping_add(most) as u64;
        let far = (beyond > most.wrapping_mul(2) as u64) & state.started;
        // Arithmetic instead of choices: the compiler makes branches of choices, and then ticks differ.
        let glitches = state.glitches.wrapping_add(1).wrapping_mul(far as u32);
        let believed = glitches > self.patience;
        state.glitches = glitches.wrapping_mul(!believed as u32);
        let glitch = far & !believed;
        let away = sample.minus_counts(state.generator) & (glitch as i64).wrapping_neg();
        let generator = sample.offset_counts(away.wrapping_neg());
        state.generator = generator;
        state.started |= !lost;
        (generator, Flags::default().with(Flags::SAMPLE_LOST, lost).with(Flags::GLITCH, glitch), believed)
    }

    /// The correction wanted in this tick, fine counts, and whether the tick came late.
    #[inline(always)]
    fn goal(&self, state: &mut JointState, input: &Input, wanted: i32, sane: bool) -> (i32, bool) {
        let late = input.missed_ticks > 0;
        state.missed_ticks = state.missed_ticks.wrapping_add(input.missed_ticks as u32);
        let blind = u32::from(!sane);
        state.uncorrected = state.uncorrected.saturating_add(1).wrapping_mul(blind);
        let kept = state.goal;
        let wanted = if sane { wanted.wrapping_mul(FINE) } else { kept };
        let off = (state.uncorrected > self.patience) | matches!(state.mode, Mode::Off | Mode::Safe);
        let keep = (state.mode == Mode::Hold) | late & (self.overrun == Overrun::HoldLast);
        let wanted = if off { 0 } else { wanted };
        let wanted = if keep { kept } else { wanted };
        // Down in `fade` ticks, none for as many; without that policy `fade` is 0.
        let start = self.fade.wrapping_mul(2);
        let left = state.fading.saturating_sub(1);
        state.fading = left ^ (left ^ start) & (late as u32).wrapping_neg();
        let part = state.fading.saturating_sub(self.fade) as f32 * self.fade_step;
        let faded = (wanted as f32 * part) as i32;
        let goal = if state.fading > 0 { faded } else { wanted };
        state.goal = wanted;
        (goal, late)
    }

    /// Moves the correction towards the goal, and tells whether its two copies were one.
    ///
    /// The goal's own speed is followed; what lies between is closed as fast as it can be stopped again: in steps of one tick,
    /// from a distance `l` with `√(a²/4 + 2al) − a/2`.
    #[inline(always)]
    fn limit(&self, state: &mut JointState, goal: i32) -> (i32, bool) {
        let [one, other] = state.correction;
        let nearer = goal.abs_diff(one) <= goal.abs_diff(other);
        let before = if nearer { one } else { other };
        let pace = goal.wrapping_sub(state.aimed);
        let lag = state.aimed.wrapping_sub(before);
        state.aimed = goal;
        let away = lag.unsigned_abs();
        let gain = self.acceleration as f32;
        let stoppable = num::sqrt(self.quarter_square + (gain + gain) * away as f32) - 0.5 * gain;
        let stoppable = stoppable as u32;
        let stoppable = (if stoppable < away { stoppable } else { away }) as i32;
        let side = lag >> 31;
        let wanted = pace.saturating_add((stoppable ^ side).wrapping_sub(side));
        let (slower, faster) =
            (state.speed.wrapping_sub(self.acceleration), state.speed.wrapping_add(self.acceleration));
        let speed = within(within(wanted, slower, faster), self.rate.wrapping_neg(), self.rate);
        state.speed = speed;
        let correction = before.wrapping_add(speed);
        state.correction = [correction; 2];
        (correction, one == other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crc::crc32;
    use crate::fixture::{self, ARCSEC, LIMITS};
    use crate::joint::mode::ModeError;
    use crate::joint::state::{MOST_FINE, SAVED_JOINT_BYTES};
    use crate::play::SAVED_STATE_BYTES;
    use crate::table::Quality;
    use proptest::prelude::*;
    use std::sync::LazyLock;
    use std::vec::Vec;

    static IMAGE: LazyLock<Vec<u8>> = LazyLock::new(|| fixture::image(true));

    /// Rate in a tick, and its change from tick to tick, rad.
    const RATE_RAD: f64 = 5e-5;
    const ACCELERATION_RAD: f64 = 2e-6;

    /// Less than this is rounding.
    const COUNT: f32 = 1.5e-9;

    struct Loop {
        joint: Joint,
        store: Store,
        state: JointState,
        generator: GeneratorAngle,
        /// Corrections of the last ticks, rad.
        before: [f64; 2],
    }

    impl Loop {
        fn new(overrun: Overrun) -> Self {
            let mut store = Store::new();
            store.activate(&Images::new(&IMAGE, &IMAGE), &fixture::drive(), 20.0).unwrap();
            let mut state = JointState::new();
            state.request(Mode::Tracking).unwrap();
            let joint = Joint::new(fixture::drive(), LIMITS, overrun).unwrap();
            Self { joint, store, state, generator: GeneratorAngle::ZERO, before: [0.0; 2] }
        }

        fn input(&self, target_rad: f64) -> Input {
            let target = OutputAngle::from_rad(target_rad).unwrap();
            Input {
                generator: Some(self.generator),
                target,
                torque_n_m: 5.0,
                missed_ticks: 0,
                adjustment: Adjustment::default(),
            }
        }

        /// One tick; no correction may jump.
        fn tick(&mut self, input: &Input) -> Output {
            let out = self.joint.tick(&Images::new(&IMAGE, &IMAGE), &mut self.store, &mut self.state, input);
            let now = out.correction_rad as f64;
            let [last, before] = self.before;
            assert!((now - last).abs() <= 1.0001 * RATE_RAD + 2e-9, "rate {}", now - last);
            let change = (now - last) - (last - before);
            assert!(change.abs() <= 1.0001 * ACCELERATION_RAD + 2e-9, "acceleration {change}");
            self.before = [now, last];
            out
        }

        /// Follows the command, towards a target that moves by this in a tick.
        fn run(&mut self, ticks: usize, from_rad: f64, step_rad: f64) -> Output {
            let mut out = None;
            for i in 0..ticks {
                let found = self.tick(&self.input(from_rad + step_rad * i as f64));
                self.generator = found.command;
                out = Some(found);
            }
            out.unwrap()
        }
    }

    #[test]
    fn the_correction_comes_within_its_limits_and_then_follows() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        let first = run.tick(&run.input(1e-3));
        assert!(first.flags.contains(Flags::HELD_BACK) && first.held_back_rad.abs() > 1e-5);
        let last = run.run(400, 1e-3, 1e-5);
        assert_eq!(last.flags, Flags::default());
        assert!(last.held_back_rad.abs() < COUNT);
        assert!(last.correction_rad.abs() > 1e-5);
        // A reversal wants the whole play at once and gets it within the limits.
        let reversed = run.run(3, 1e-3 + 400.0 * 1e-5, -1e-5);
        assert!(reversed.flags.contains(Flags::HELD_BACK));
        let after = run.run(400, 1e-3 + 397.0 * 1e-5, -1e-5);
        assert!(after.held_back_rad.abs() < COUNT);
    }

    #[test]
    fn modes_change_only_as_they_may_and_never_jump() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        let tracking = run.run(300, 1e-3, 1e-5);
        run.state.request(Mode::Hold).unwrap();
        let held = run.run(50, 4e-3, 1e-5);
        assert!((held.correction_rad - tracking.correction_rad).abs() < COUNT);
        run.state.request(Mode::Safe).unwrap();
        for refused in [Mode::Tracking, Mode::Hold] {
            assert_eq!(run.state.request(refused), Err(ModeError { from: Mode::Safe, to: refused }));
        }
        let safe = run.run(300, 4.5e-3, 0.0);
        assert_eq!((safe.correction_rad, run.state.mode()), (0.0, Mode::Safe));
        assert_eq!(safe.command, fixture::drive().nominal_generator(run.input(4.5e-3).target));
        run.state.request(Mode::Off).unwrap();
        assert_eq!(run.state.request(Mode::Hold), Err(ModeError { from: Mode::Off, to: Mode::Hold }));
        run.state.request(Mode::Tracking).unwrap();
        assert!(run.run(300, 4.5e-3, 1e-5).correction_rad != 0.0);
    }

    #[test]
    fn lost_samples_leave_the_play_where_it_is() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        let play = *run.state.play();
        for _ in 0..20 {
            let out = run.tick(&Input { generator: None, ..run.input(4e-3) });
            assert!(out.flags.contains(Flags::SAMPLE_LOST));
        }
        assert_eq!(run.state.play(), &play);
        assert!(!run.tick(&run.input(4e-3)).flags.contains(Flags::SAMPLE_LOST));
    }

    #[test]
    fn a_glitch_is_not_believed_and_a_new_place_is_with_the_side_unknown() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        let before = run.run(300, 1e-3, 1e-5);
        let (play, good) = (*run.state.play(), run.generator);
        run.generator = good.offset_rad(1.0);
        let out = run.tick(&run.input(4e-3));
        assert!(out.flags.contains(Flags::GLITCH));
        assert_eq!(run.state.play(), &play);
        run.generator = good;
        assert!(!run.tick(&run.input(4e-3)).flags.contains(Flags::GLITCH));
        // It stays: believed after five ticks.
        run.generator = good.offset_rad(1.0);
        for i in 0..6 {
            let out = run.tick(&run.input(4e-3));
            assert_eq!(out.flags.contains(Flags::GLITCH), i < 5, "{i}");
            assert_eq!(run.state.play().is_known(), i < 5, "{i}");
        }
        assert!(before.quality == Quality::InRange);
        assert_eq!(run.tick(&run.input(4e-3)).quality, Quality::Uncertain);
    }

    #[test]
    fn without_torque_the_last_correction_is_kept_and_then_fades() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        let before = run.run(300, 1e-3, 1e-5);
        for i in 0..6 {
            let out = run.tick(&Input { torque_n_m: f32::NAN, ..run.input(4e-3) });
            assert!(out.flags.contains(Flags::NOT_CORRECTED) && out.quality == Quality::Disabled);
            assert_eq!((out.correction_rad - before.correction_rad).abs() < COUNT, i < 5, "{i}");
        }
        let blind = Input { torque_n_m: f32::NAN, ..run.input(4e-3) };
        for _ in 0..300 {
            let _ = run.tick(&blind);
        }
        assert_eq!(run.tick(&blind).correction_rad, 0.0);
        // And back, within the limits.
        assert!(run.run(300, 4e-3, 1e-5).held_back_rad.abs() < COUNT);
    }

    #[test]
    fn torque_out_of_range_is_marked_and_corrected_with_the_edge() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        let out = run.tick(&Input { torque_n_m: 51.0, ..run.input(1e-3) });
        assert_eq!(out.quality, Quality::Extrapolated);
        let mut edge = Loop::new(Overrun::SkipAndCount);
        let at = edge.tick(&Input { torque_n_m: 50.0, ..edge.input(1e-3) });
        assert_eq!(out.transmission_error_rad, at.transmission_error_rad);
        assert_eq!(at.quality, Quality::Uncertain);
    }

    #[test]
    fn overruns_do_what_their_policy_says() {
        let late = |run: &Loop| Input { missed_ticks: 3, ..run.input(4e-3) };
        let mut skip = Loop::new(Overrun::SkipAndCount);
        skip.run(300, 1e-3, 1e-5);
        let out = skip.tick(&late(&skip));
        assert!(out.flags.contains(Flags::OVERRUN));
        assert!(out.held_back_rad.abs() < COUNT);
        assert_eq!(skip.state.missed_ticks(), 3);

        let mut hold = Loop::new(Overrun::HoldLast);
        let before = hold.run(300, 1e-3, 1e-5);
        let elsewhere = Input { target: hold.input(4.2e-3).target, ..late(&hold) };
        assert!((hold.tick(&elsewhere).correction_rad - before.correction_rad).abs() < COUNT);

        let mut fade = Loop::new(Overrun::FadeOut { ticks: 400 });
        fade.run(300, 1e-3, 1e-5);
        let mut corrections = std::vec![fade.tick(&late(&fade)).correction_rad.abs()];
        for _ in 0..1300 {
            corrections.push(fade.tick(&fade.input(4e-3)).correction_rad.abs());
        }
        assert!(corrections[..400].windows(2).all(|pair| pair[1] <= pair[0] + 2e-9));
        assert!(corrections[410..790].iter().all(|&c| c == 0.0), "{:?}", &corrections[405..420]);
        assert!(corrections[1300] > 0.9 * corrections[0]);
        assert_eq!(fade.state.missed_ticks(), 3);
    }

    #[test]
    fn a_reset_in_the_middle_of_a_reversal_goes_on_where_it_was_or_starts_anew() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        run.run(8, 4e-3, -1e-5);
        let saved = run.state.save();
        let mut restored = JointState::restore(&saved).unwrap();
        restored.request(Mode::Tracking).unwrap();
        run.state = restored;
        // `tick` asserts the limits across the reset.
        let on = run.run(3, 3.92e-3, -1e-5);
        assert!(on.flags.contains(Flags::HELD_BACK) && on.quality == Quality::InRange);
        for bit in 0..SAVED_JOINT_BYTES * 8 {
            let mut damaged = saved;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(JointState::restore(&damaged), None, "bit {bit}");
        }
        // Without what was saved: no correction at first, the side unknown, then known again.
        let mut state = JointState::new();
        state.request(Mode::Tracking).unwrap();
        (run.state, run.before) = (state, [0.0; 2]);
        let first = run.tick(&run.input(3.9e-3));
        assert_eq!(first.quality, Quality::Uncertain);
        assert!(first.uncertainty_rad > 1e-5);
        assert_eq!(run.run(600, 3.9e-3, -1e-5).uncertainty_rad, 0.0);
    }

    /// Flips in what changes while running: what can be told is flagged, and the correction stays within its limits.
    #[test]
    fn upsets_of_the_state_never_make_the_correction_jump() {
        type Flip = fn(&mut JointState, u32);
        let flips: [(Flip, bool); 9] = [
            (|s, bit| s.output = s.output.offset_counts(1 << bit), true),
            (|s, bit| s.correction[0] ^= 1 << bit, true),
            (|s, bit| s.correction[1] ^= 1 << bit, true),
            (|s, bit| s.play.flip(2, bit), true),
            (|s, bit| s.adjusted ^= 1 << bit, true),
            (|s, bit| s.play.flip(0, bit), false),
            (|s, bit| s.play.flip(1, bit), false),
            (|s, bit| s.goal ^= 1 << bit, false),
            (|s, bit| s.aimed ^= 1 << bit, false),
        ];
        for (number, (flip, told)) in flips.into_iter().enumerate() {
            for bit in 0..31 {
                let mut run = Loop::new(Overrun::SkipAndCount);
                let before = run.run(300, 1e-3, 1e-5);
                assert_eq!(before.quality, Quality::InRange);
                flip(&mut run.state, bit);
                let out = run.tick(&run.input(4e-3));
                if !(5..7).contains(&number) {
                    assert_eq!(out.flags.contains(Flags::STATE_TORN), told, "{number} bit {bit}");
                } else {
                    // One bound of a known play moved: no longer known, or taken for unknown.
                    let said = out.quality == Quality::Uncertain || out.flags.contains(Flags::STATE_TORN);
                    let same = out.transmission_error_rad as f64 - before.transmission_error_rad as f64;
                    assert!(said || same.abs() < 0.05 * ARCSEC, "{number} bit {bit}");
                }
                run.run(600, 4e-3, 1e-5);
                let healed = run.run(3, 1e-2, 1e-5);
                assert_eq!(healed.quality, Quality::InRange, "{number} bit {bit}");
                assert!(healed.held_back_rad.abs() < COUNT, "{number} bit {bit}");
            }
        }
    }

    #[test]
    fn an_adjustment_is_added_to_estimate_and_command_alike() {
        let adjusted = Adjustment::from_rad(3e-5, 1.0e-5);
        let mut runs = [Adjustment::default(), adjusted].map(|adjustment| {
            let mut run = Loop::new(Overrun::SkipAndCount);
            let mut last = None;
            for i in 0..900 {
                // Forward, then backward.
                let place = if i < 450 { i } else { 900 - i };
                let input = Input { adjustment, ..run.input(1e-3 + 1e-5 * place as f64) };
                let out = run.tick(&input);
                if let Some(target) = last.filter(|_| i % 450 > 400) {
                    // Where the last command was meant to bring the output.
                    assert!(out.output.minus_rad(target).abs() < 4.0 * COUNT, "{i}");
                }
                run.generator = out.command;
                last = Some(input.target);
            }
            run
        });
        // Backward to 0.095, forward to 0.195.
        for (path, expected) in [([0.2, 0.095], 3e-5 + 1e-5), ([0.095, 0.195], 3e-5 - 1e-5)] {
            let error = |run: &mut Loop, adjustment| {
                let [_, error] = path.map(|rad| {
                    let generator = GeneratorAngle::from_rad(rad);
                    run.tick(&Input { generator, adjustment, ..run.input(1e-3) }).transmission_error_rad
                });
                error
            };
            let [plain, run] = &mut runs;
            let gained = error(run, adjusted) - error(plain, Adjustment::default());
            assert!((gained - expected).abs() < 4.0 * COUNT, "{path:?}: {gained:e}");
        }
    }

    #[test]
    fn adjustments_are_bounded_and_never_turn_the_play_inside_out() {
        let (least, most) = (-Adjustment::MAX_COUNTS - 1, Adjustment::MAX_COUNTS);
        assert_eq!(
            Adjustment::from_rad(f32::NAN, f32::NEG_INFINITY),
            Adjustment { mean_counts: 0, half_width_counts: least }
        );
        assert_eq!(Adjustment::from_rad(1e-6, 0.06), Adjustment { mean_counts: 684, half_width_counts: most });
        let tick = |adjustment| {
            let mut run = Loop::new(Overrun::SkipAndCount);
            run.run(300, 1e-3, 1e-5);
            let at = run.generator.offset_rad(1e-3);
            let out = run.tick(&Input { adjustment, generator: Some(at), ..run.input(4e-3) });
            (out, run)
        };
        let closed = |counts| Adjustment { mean_counts: 0, half_width_counts: counts };
        for (wild, bounded) in [(i32::MIN, least), (i32::MAX, most)] {
            assert_eq!(tick(closed(wild)).0, tick(closed(bounded)).0);
            let mean = |counts| Adjustment { mean_counts: counts, half_width_counts: 0 };
            let (found, same) = (tick(mean(wild)).0, tick(mean(bounded)).0);
            assert_eq!(found, same);
            assert!(found.quality == Quality::InRange && found.transmission_error_rad.abs() > 0.048);
        }
        // No play is left but what the ripple needs, 0.1″, and forward and backward differ by no more.
        let (out, run) = tick(closed(least));
        assert_eq!(out.quality, Quality::InRange);
        let back = Input { generator: Some(run.generator), adjustment: closed(least), ..run.input(4e-3) };
        let (mut there, mut run) = (out.transmission_error_rad as f64, run);
        for input in [back, Input { generator: Some(run.generator.offset_rad(1e-3)), ..back }] {
            let now = run.tick(&input).transmission_error_rad as f64;
            assert!((now - there).abs() < 0.6 * ARCSEC, "{}", (now - there) / ARCSEC);
            there = now;
        }
        assert!(run.tick(&back).uncertainty_rad == 0.0);
    }

    #[test]
    fn settings_that_make_no_sense_are_named() {
        let named = |limits: Limits| Joint::new(fixture::drive(), limits, Overrun::HoldLast).unwrap_err().name;
        assert_eq!(named(Limits { tick_s: 0.0, ..LIMITS }), "tick_s");
        assert_eq!(named(Limits { rate_rad_s: f32::NAN, ..LIMITS }), "rate_rad_s");
        assert_eq!(named(Limits { rate_rad_s: 60.0, ..LIMITS }), "rate_rad_s");
        // Not a part of a count in a tick: the correction would never move.
        assert_eq!(named(Limits { rate_rad_s: 9.0e-8, ..LIMITS }), "rate_rad_s");
        assert_eq!(named(Limits { acceleration_rad_s2: -1.0, ..LIMITS }), "acceleration_rad_s2");
        assert_eq!(named(Limits { generator_rate_rad_s: f32::INFINITY, ..LIMITS }), "generator_rate_rad_s");
    }

    /// What is left to go must not drown in the rounding of a large acceleration.
    #[test]
    fn an_acceleration_beyond_need_does_not_make_the_correction_jitter() {
        for step in 0..60 {
            let acceleration_rad_s2 = 1.0e6 * 1.06f32.powi(step);
            let mut run = Loop::new(Overrun::SkipAndCount);
            run.joint =
                Joint::new(fixture::drive(), Limits { acceleration_rad_s2, ..LIMITS }, Overrun::SkipAndCount).unwrap();
            let images = Images::new(&IMAGE, &IMAGE);
            for tick in 0..400 {
                let input = run.input(1e-3);
                let out = run.joint.tick(&images, &mut run.store, &mut run.state, &input);
                run.generator = out.command;
                assert!(tick < 200 || out.held_back_rad.abs() < COUNT, "{acceleration_rad_s2}, tick {tick}: {out:?}");
            }
        }
    }

    /// With a checksum that fits: what no joint can have saved is refused all the same.
    #[test]
    fn impossible_saved_states_are_refused() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        let saved = run.state.save();
        let changed = |at: usize, value: [u8; 4]| {
            let mut bytes = saved;
            bytes[at..at + 4].copy_from_slice(&value);
            let (before, sum) = bytes.split_last_chunk_mut::<4>().unwrap();
            *sum = crc32(before).to_le_bytes();
            JointState::restore(&bytes)
        };
        let most = MOST_FINE as i32;
        for correction in [most + 1, -most - 1, i32::MIN] {
            assert_eq!(changed(SAVED_STATE_BYTES, correction.to_le_bytes()), None, "{correction}");
        }
        for speed in [f32::NAN, f32::INFINITY, -6e8, 1e30] {
            assert_eq!(changed(SAVED_STATE_BYTES + 4, speed.to_le_bytes()), None, "{speed}");
        }
        for correction in [most, -most, 0] {
            assert!(changed(SAVED_STATE_BYTES, correction.to_le_bytes()).is_some(), "{correction}");
        }
    }

    proptest! {
        /// Whatever comes in, the correction moves within its limits and stays within the table's.
        #[test]
        fn any_input_keeps_the_limits(
            inputs in prop::collection::vec((any::<bool>(), -2e-3f64..2e-3, -0.1f64..0.1, any::<f32>(), 0u16..3), 1..200),
            policy in 0u8..3, adjusted in any::<bool>(), mean_counts in any::<i32>(), half_width_counts in any::<i32>(),
        ) {
            let policies = [Overrun::SkipAndCount, Overrun::HoldLast, Overrun::FadeOut { ticks: 7 }];
            let mut run = Loop::new(policies[policy as usize]);
            for (present, target, moved, torque, missed) in inputs {
                run.generator = run.generator.offset_rad(moved as f32);
                let sample = present.then_some(run.generator);
                let (adjustment, most) = if adjusted {
                    (Adjustment { mean_counts, half_width_counts }, 0.13)
                } else {
                    (Adjustment::default(), 0.03)
                };
                let missed_ticks = missed / 2;
                let input = Input { generator: sample, torque_n_m: torque, missed_ticks, adjustment, ..run.input(target) };
                let out = run.tick(&input);
                prop_assert!(out.correction_rad.abs() <= most);
                prop_assert!(out.uncertainty_rad.is_finite() && out.transmission_error_rad.is_finite());
            }
        }
    }
}
