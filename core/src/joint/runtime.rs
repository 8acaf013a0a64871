//! The fixed-step runtime of one joint: one call for each tick, with the same work in each.
//!
//! In this order: the measured generator angle is judged; torque and temperature are located in the table; the play
//! follows the generator (forward); the target is turned into a correction (inverse); mode and overrun policy say how
//! much of it is wanted; a limiter moves the correction there; settings, state and what is known of the table are
//! checked. What slower rate groups do is called by the firmware after [`Joint::tick`], in an order that is fixed in
//! its source.
//!
//! | what happens | what the joint does | flag |
//! |---|---|---|
//! | no sample | keeps the last angle and the play; the error is known to the table's limit | [`Flags::SAMPLE_LOST`] |
//! | a sample too far off | ignores it; accepts it after `debounce_ticks`, play side unknown | [`Flags::GLITCH`] |
//! | a sample out and back | takes back what it did to the play in the next tick, however far | [`Flags::GLITCH`] |
//! | input not finite, table in doubt | keeps it for `debounce_ticks`, then withdraws it | [`Flags::NOT_CORRECTED`] |
//! | an adjustment larger than any may be | takes the largest one | [`Flags::BOUNDED`] |
//! | an adjustment that is not known | adds its uncertainty | [`Uncertain`](crate::Quality::Uncertain) |
//! | an adjustment that is lost | as an input that is not finite | [`Flags::NOT_CORRECTED`] |
//! | torque or temperature out of range | uses the value at the edge | [`Extrapolated`](crate::Quality::Extrapolated) |
//! | a tick came late | by [`Overrun`]; the sample may be further off, by tick missed | [`Flags::OVERRUN`] |
//! | a target that leaps | commands the leap: the correction alone is limited | |
//! | a mode or a fade that does not follow the table | [`Output::held_back_rad`] | [`Flags::HELD_BACK`] |
//! | a reversal, or another fast correction | limits the rate: [`Output::held_back_rad`] | [`Flags::HELD_BACK`] |
//! | an upset in the state | takes the other copy, else safe mode | [`Flags::STATE_TORN`], [`Flags::SAFE`] |
//! | an upset in the settings | takes the other copy, else commands the last sample or 0 | [`Flags::JOINT_TORN`] |
//! | an upset in the table | repairs it and repeats the tick, else does not use it | [`Flags::TABLE_DOUBT`] |
//! | a target nearer than `deadband_rad` | is reached on the flank that bears already | |
//! | no sample since a reset | no new correction; the first is compared with a saved one | [`Flags::NOT_CORRECTED`] |
//! | reset | [`JointState::restore`] goes on; [`JointState::new`] starts uncorrected, play side unknown | |

use super::adjustment::bounded;
use super::limits::{LEAST_TICK_S, Limits, SettingError, checked};
use super::mode::Overrun;
use super::signals::{Flags, Input, Output};
use super::state::{
    BEND_TO_SIGN, CopyStatus, FINE, FIRST_IN_A_ROW, FLANK, FLANK_BACKWARD, FLANK_BEFORE, FLANK_FORWARD, FLANK_SHIFT,
    GAP, IN_A_ROW, JointState, Kept, LastSamples, MENDED, MODE, SAMPLED, SEEN, STEP_TO_SIGN, UNSEEN,
};
use crate::angle::{GeneratorAngle, OutputAngle, RAD_PER_COUNT};
use crate::drive::Drive;
use crate::encoder::{Encoder, EncoderState};
use crate::num;
use crate::play::PlayState;
use crate::store::{Images, Store};
use crate::table::{
    Approach, Command, Estimate, MAX_ERROR_RAD, Memory, OperatingPoint, Prediction, Quality, TableModel, departure,
};
use crate::whole::{SUMS_START, pair, same, sums};
use core::num::NonZeroU32;

/// Less than a count.
const WITHIN: i32 = FINE - 1;
/// Without a given acceleration a sample that is out and back is taken back where it needs full speed in less than 2⁶
/// ticks. A guess: 64 ms at a thousand ticks a second.
const SPIKE_SHIFT: u32 = 6;

/// One joint: all that does not change while it runs. Can be made at compile time and lie in flash; in memory an upset
/// of one of its two copies is noticed in the tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    copies: [JointSettings; 2],
}

/// The settings of a joint, with sums over all of it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct JointSettings {
    drive: Drive,
    /// All ones if a late tick keeps the correction, else 0.
    hold_late: u32,
    /// Fine counts in a tick, and in a tick more each tick.
    rate: i32,
    acceleration: i32,
    largest_move: i32,
    /// A sample whose way differs by more from that of the one before is a glitch; one that takes back more than the
    /// other is held against the one before. Counts.
    largest_bend: i32,
    spike: i32,
    tick_s: f32,
    debounce_ticks: u16,
    /// Ticks of a fade, and the part of the correction that one tick of it takes.
    fade: u16,
    fade_step: f32,
    /// Nearer than this the flank is kept, counts.
    hold: i32,
    sums: [u32; 2],
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
    /// [`SettingError`]: a limit that is not finite and positive, or beyond 0.05 rad (rate, hold) or half a turn
    /// (generator) in a tick, or a rate below 1.8e-10 rad in a tick, an acceleration below that in a tick more each
    /// tick, a fastest generator below 1.5e-9 rad in a tick, a hold below that, or a tick below 1e-7 s.
    pub const fn new(drive: Drive, limits: Limits, overrun: Overrun) -> Result<Self, SettingError> {
        Ok(Self { copies: [tried!(JointSettings::new(drive, limits, overrun)); 2] })
    }

    /// With a largest acceleration of the generator, rad/s²: a sample that would need more is a glitch, and one that is
    /// out and back within two ticks is taken back. A multiple of what motor and load can do; no less than
    /// `deadband_rad` allows for noise.
    ///
    /// Without it a sample may need full speed in one tick, and one that is out and back a 64th of that in each.
    ///
    /// A sample that comes back is believed, even where its way exceeds the fastest generator: the way holds the error
    /// of the sample before, which by itself was within the limits.
    ///
    /// # Errors
    /// [`SettingError`] if it is not finite, or below 1.5e-9 rad in a tick more each tick; or if the joint is lost.
    pub const fn with_generator_acceleration(self, rad_s2: f32) -> Result<Self, SettingError> {
        let Some(settings) = self.sound() else { return Err(SettingError { name: "joint", found: f32::NAN }) };
        let per_tick = num::counts(rad_s2 as f64 * settings.tick_s as f64 * settings.tick_s as f64);
        let bend = tried!(checked("generator_acceleration_rad_s2", rad_s2, per_tick, [1.0, f64::MAX])) as i32;
        // From full speed to full speed back is all that samples within the largest move can do.
        let bend = within(bend, settings.noise(), settings.largest_move.saturating_mul(2));
        Ok(Self { copies: [JointSettings { largest_bend: bend, spike: bend, ..*settings }.sealed(); 2] })
    }

    /// The drive; one tooth and one wave, of which no table is, where the settings are lost.
    #[must_use]
    pub const fn drive(&self) -> &Drive {
        match self.sound() {
            Some(settings) => &settings.drive,
            None => &Drive::SMALLEST,
        }
    }

    /// Sums over the settings: they distinguish this joint from others in saved data.
    pub(super) fn sums(&self) -> [u32; 2] {
        self.sound().map_or([0; 2], |settings| settings.sums)
    }

    /// The settings that are whole.
    const fn sound(&self) -> Option<&JointSettings> {
        match &self.copies {
            [first, _] if first.is_whole() => Some(first),
            [_, second] if second.is_whole() => Some(second),
            _ => None,
        }
    }

    /// Whether the settings are lost: neither copy is whole, and it has to be made anew.
    #[must_use]
    pub const fn is_lost(&self) -> bool {
        self.sound().is_none()
    }

    /// Makes a copy of the settings that is not whole anew from the other; false if neither is, and the joint has to be
    /// made anew. For a slow rate group, where the joint lies in memory.
    pub fn mend(&mut self) -> bool {
        let Some(&sound) = self.sound() else { return false };
        self.copies = [sound; 2];
        true
    }

    /// Output angle for a generator angle, with the play followed in `play`: as [`crate::Table::forward`], from the
    /// copies. Disabled, as [`Self::inverse`], where the settings are lost or the table is for another drive.
    pub fn forward(
        &self,
        store: &Store,
        play: &mut PlayState,
        generator: GeneratorAngle,
        torque_n_m: f32,
    ) -> Prediction {
        let (model, point) = self.at(store, torque_n_m);
        model.follow(&point, play, generator)
    }

    /// Generator angle that brings the output to `target`: as [`crate::Table::inverse`], from the copies.
    pub fn inverse(&self, store: &Store, target: OutputAngle, torque_n_m: f32, approach: Approach<'_>) -> Command {
        let (model, point) = self.at(store, torque_n_m);
        model.aim(&point, target, approach)
    }

    /// The generator angle of a reading of its encoder, to give to the next [`Self::tick`].
    ///
    /// A reading that the tick does not believe ([`Flags::GLITCH`]) moves no turn: one that is further from the one
    /// before than a tick allows is taken from the angle that was believed last, for N ticks; in N + 2 the generator
    /// cannot make half of what the register counts. So the turns are right as soon as the readings are, if no more
    /// than N − 1 in a row were wrong: 3 where a register of one turn is read a thousand times a second at 500 rad/s.
    /// After more the encoder is lost ([`EncoderState::is_lost`]): start it anew from what is known otherwise. Wrong
    /// readings that agree with each other for longer than the joint's patience, or until the generator could have got
    /// there, are believed, as nothing tells them from motion: then, too, start it anew. A tick that is missed counts
    /// as one of the N at this call, as two at later ones.
    ///
    /// `None`: the register cannot read that; joint or encoder are lost; or `generator_rate_rad_s` allows a sixth of
    /// what the register counts in a tick, so that motion hides a wrong bit.
    #[must_use]
    pub fn read(
        &self,
        state: &JointState,
        encoder: &Encoder,
        at: &mut EncoderState,
        reading: u64,
    ) -> Option<GeneratorAngle> {
        let (now, ..) = state.open();
        let believed = (now.seen() == SAMPLED).then(|| (now.generator.counts(), now.unseen().saturating_add(1)));
        let counts = encoder.read_near(at, reading, believed, self.sound()?.largest_move);
        counts.map(GeneratorAngle::from_counts)
    }

    /// The table at a torque, for the drive of settings that are whole: a table for another one gives nothing.
    #[inline(always)]
    pub(super) fn at<'s>(&'s self, store: &'s Store, torque_n_m: f32) -> (TableModel<'s, Store>, OperatingPoint) {
        let drive = self.drive();
        let torque_n_m = if store.is_for(drive) { torque_n_m } else { f32::NAN };
        (TableModel { memory: store, drive }, store.locate_whole(torque_n_m))
    }

    /// One tick.
    ///
    /// Instructions are counted by `tests/firmware`; the same number in every tick with the same table. A tick that
    /// finds something not whole mends it, as far as it can, and is done a second time.
    #[must_use]
    pub fn tick(&self, images: &Images<'_>, store: &mut Store, state: &mut JointState, input: &Input) -> Output {
        let [first, _] = &self.copies;
        let found = first.attempt(images, store, state, input, false);
        if found.flags.contains(Flags::AGAIN) { self.again(images, store, state, input) } else { found }
    }

    /// Mends what is not whole, and does the tick again.
    #[cold]
    #[inline(never)]
    fn again(&self, images: &Images<'_>, store: &mut Store, state: &mut JointState, input: &Input) -> Output {
        let [first, _] = &self.copies;
        let joint_torn = !first.is_whole();
        let Some(settings) = self.sound() else {
            let (kept, _, found) = state.open();
            let flags =
                Flags::NOT_CORRECTED.with(Flags::JOINT_TORN, true).with(Flags::STATE_TORN, found != CopyStatus::Whole);
            return Output {
                command: kept.generator,
                output: OutputAngle::ZERO,
                transmission_error_rad: 0.0,
                uncertainty_rad: MAX_ERROR_RAD,
                correction_rad: 0.0,
                held_back_rad: 0.0,
                quality: Quality::Disabled,
                flags,
            };
        };
        let table_torn = store.mend(images, input.torque_n_m);
        let mut found = settings.attempt(images, store, state, input, true);
        found.flags = found.flags.with(Flags::JOINT_TORN, joint_torn).with(Flags::TABLE_DOUBT, table_torn);
        found
    }
}

impl JointSettings {
    const fn new(drive: Drive, limits: Limits, overrun: Overrun) -> Result<Self, SettingError> {
        let Limits { tick_s, rate_rad_s, acceleration_rad_s2, generator_rate_rad_s, debounce_ticks, deadband_rad } =
            limits;
        let tick = tick_s as f64;
        tried!(checked("tick_s", tick_s, tick, [LEAST_TICK_S, 1.0e3]));
        // Slower than one part in a tick would be no correction at all.
        let bounds = [1.0, num::counts(0.05) * FINE as f64];
        let per_tick = num::counts(rate_rad_s as f64 * tick) * FINE as f64;
        let rate = tried!(checked("rate_rad_s", rate_rad_s, per_tick, bounds));
        let per_tick = num::counts(acceleration_rad_s2 as f64 * tick * tick) * FINE as f64;
        let acceleration = tried!(checked("acceleration_rad_s2", acceleration_rad_s2, per_tick, [1.0, 1.0e12]));
        // More than from full speed to full speed back is not needed, and would drown what is left to go in rounding.
        let acceleration = if acceleration < 2.0 * rate { acceleration } else { 2.0 * rate };
        let per_tick = num::counts(generator_rate_rad_s as f64 * tick);
        let bounds = [1.0, 2_147_483_000.0];
        let largest_move = tried!(checked("generator_rate_rad_s", generator_rate_rad_s, per_tick, bounds)) as i32;
        let hold = num::counts(deadband_rad as f64);
        if deadband_rad != 0.0 {
            tried!(checked("deadband_rad", deadband_rad, hold, [1.0, num::counts(0.05)]));
        }
        let (fade, hold_late) = match overrun {
            Overrun::FadeOut { ticks } => (ticks, 0),
            Overrun::SkipAndCount => (0, 0),
            Overrun::HoldLast => (0, u32::MAX),
        };
        let fade_step = if fade == 0 { 0.0 } else { 1.0 / fade as f32 };
        // A whole number of fine counts, no less than one and no more than asked for otherwise.
        let acceleration = within(acceleration as i32, 1, 1 << 29);
        let rate = within(rate as i32, 1, i32::MAX);
        let hold = hold as i32;
        // One tick more can still be counted.
        let debounce_ticks = if debounce_ticks == u16::MAX { debounce_ticks.wrapping_sub(1) } else { debounce_ticks };
        let settings = Self {
            drive,
            hold_late,
            rate,
            acceleration,
            largest_move,
            largest_bend: largest_move,
            spike: 0,
            tick_s,
            debounce_ticks,
            fade,
            fade_step,
            hold,
            sums: [0; 2],
        };
        Ok(Self { spike: within(largest_move >> SPIKE_SHIFT, settings.noise(), largest_move), ..settings }.sealed())
    }

    const fn sealed(self) -> Self {
        Self { sums: pair(self.of_words()), ..self }
    }

    /// A change of the way from tick to tick that noise makes, counts of the generator: twice the dead band, which is
    /// three times the peak.
    const fn noise(&self) -> i32 {
        let way = self.drive.nominal_generator(OutputAngle::from_counts((self.hold as i64).wrapping_mul(2)));
        let counts = way.counts().unsigned_abs();
        if counts > self.largest_move as u64 { self.largest_move } else { counts as i32 }
    }

    /// Sums over everything but the sums.
    #[inline(never)]
    const fn of_words(&self) -> u64 {
        let [a, b, c, d, e, f, g, h, i, j, k] = self.drive.words();
        sums!(
            SUMS_START;
            a,
            b,
            c,
            d,
            e,
            f,
            g,
            h,
            i,
            j,
            k,
            self.hold_late,
            self.rate as u32,
            self.acceleration as u32,
            self.largest_move as u32,
            self.largest_bend as u32,
            self.spike as u32,
            self.tick_s.to_bits(),
            self.debounce_ticks as u32 | (self.fade as u32) << 16,
            self.fade_step.to_bits(),
            self.hold as u32,
        )
    }

    #[inline(always)]
    const fn is_whole(&self) -> bool {
        same(pair(self.of_words()), self.sums)
    }

    /// One tick; asks for another ([`Flags::AGAIN`]) without having changed the state if something it read was not
    /// whole, unless it is the second.
    #[inline(never)]
    fn attempt(
        &self,
        images: &Images<'_>,
        store: &Store,
        state: &mut JointState,
        input: &Input,
        second: bool,
    ) -> Output {
        let (mut now, mut samples, found) = state.open();
        // One that is lost is no input, like a torque that is no number.
        let (torque_n_m, [mean_given, half_given, off]) = match input.adjustment.open() {
            Some(counts) => (input.torque_n_m, counts),
            None => (f32::NAN, [now.adjusted, 0, 0]),
        };
        let (mean_counts, half_width_counts) = (bounded(mean_given), bounded(half_given));
        let is_bounded = (mean_counts ^ mean_given) | (half_width_counts ^ half_given) != 0;
        let point = store.locate(torque_n_m, mean_counts, half_width_counts);
        // An adjustment is learnt, not moved.
        now.play.shift(mean_counts.wrapping_sub(now.adjusted));
        now.adjusted = mean_counts;
        let (flags, good) = self.judge(&mut now, &mut samples, input);
        let model = TableModel { memory: store, drive: &self.drive };
        let Estimate { output, error, mut doubt, uncertainty, free, sane, .. } =
            model.estimate(&point, &mut now.play, now.generator);
        samples.free = free;
        // Another flank may bear where the target is within what the adjustment is off by, and the dead band.
        let doubtful = off.wrapping_add(self.hold & off.wrapping_neg() >> 31);
        let from = departure(store.plan(), &point, input.target, &now.play, (output, doubtful));
        // The flank that the last motion went to is kept for a target that is near.
        let near = (from.ahead.saturating_abs() < self.hold) & (now.marks & FLANK != 0);
        let last = now.marks & FLANK_BACKWARD != 0;
        // Arithmetic instead of choices: the compiler makes branches of choices, and then ticks differ.
        let backward = from.backward ^ ((from.backward ^ last) & near);
        let (found_there, allowed) = model.solve(&point, input.target, backward, &mut doubt);
        let mine = store.is_for(&self.drive);
        let sane = sane & allowed & mine & doubt.none() & (now.seen() == SAMPLED);
        let hold = from.hold & !near;
        // The correction that leaves the generator where it is.
        let still = from.ahead.wrapping_add(error);
        let mask = (hold as i32).wrapping_neg();
        let wanted = found_there ^ (found_there ^ still) & mask;
        let open = from.guess ^ (from.guess ^ from.unknown) & mask;
        // Where the generator is is not known in this tick: the error is any that the table gives.
        let unseen = point.most(store.plan()).wrapping_add(error.wrapping_abs()) & !good;
        let known = now.play.is_known() & (open <= 0) & (unseen | off == 0);
        let aimed = open.wrapping_add(point.jump);
        let aimed = if sane { aimed } else { store.plan().limit };
        let uncertainty = if aimed > uncertainty { aimed } else { uncertainty };
        let uncertainty = if unseen > uncertainty { unseen } else { uncertainty };
        let uncertainty = uncertainty.wrapping_add(off);
        // One bit for each flank.
        let flank = FLANK_FORWARD << backward as u32;
        let before = now.marks;
        let flank = before ^ (before ^ flank) & (sane as u32).wrapping_neg();
        now.marks = before & !(FLANK | FLANK_BEFORE | MENDED) | flank & FLANK | (before & FLANK) << FLANK_SHIFT;

        let (goal, late) = self.goal(&mut now, input, wanted, sane);
        let correction = self.limit(&mut now, goal, point.most(store.plan()).wrapping_mul(FINE));
        let (whole, other_images) = store.table_status(images);
        let again = !(whole & self.is_whole() & doubt.none());
        if now.seen() == 0 {
            // Nothing was seen of the generator yet.
            now.play = PlayState::unknown();
        }
        if !again | second {
            state.close(&now, &samples);
            state.missed(input.missed_ticks);
        }

        // Of what the table wants, whoever holds it back.
        let wanted = if sane { wanted.wrapping_mul(FINE) } else { goal };
        let held_back = wanted.wrapping_sub(correction);
        let flags = flags
            .with(Flags::OVERRUN, late)
            .with(Flags::HELD_BACK, held_back.wrapping_add(WITHIN) as u32 > (2 * WITHIN) as u32)
            .with(Flags::NOT_CORRECTED, !sane)
            .with(Flags::TABLE_DOUBT, !doubt.none() | store.is_for_another(&self.drive))
            .with(Flags::STATE_TORN, (found != CopyStatus::Whole) | (before & MENDED != 0))
            .with(Flags::SAFE, now.marks & MODE == MODE)
            .with(Flags::OTHER_IMAGES, other_images)
            .with(Flags::BOUNDED, is_bounded)
            .with(Flags::AGAIN, again & !second);
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

    /// Judges the sample: keeps the accepted generator angle, and its information on the play. All ones where it
    /// is believed, else 0.
    #[inline(never)]
    fn judge(&self, now: &mut Kept, samples: &mut LastSamples, input: &Input) -> (Flags, i32) {
        let (lost, sample) = match input.generator {
            Some(sample) => (false, sample),
            None => (true, now.generator),
        };
        let seen = now.seen();
        // Arithmetic instead of choices: the compiler makes branches of choices, and then ticks differ. Where a
        // difference fits 32 bits its sign shows which number is larger.
        let all = |sign: i32| sign >> 31;
        let way = sample.minus_counts(now.generator);
        let step = way as i32;
        // Zero where the way fits 32 bits.
        let wide = (way >> 32) as i32 ^ all(step);
        let wide = wide | wide.wrapping_neg();
        // Outside ± the largest move in each tick since the last sample, which fits 48 bits. Without one that was saved
        // the first is believed wherever it is.
        let was_seen = (seen as i32).wrapping_neg();
        let gap = ((now.marks & GAP) >> GAP.trailing_zeros()).wrapping_add(input.missed_ticks as u32).wrapping_add(1);
        let most = (self.largest_move as u32 as u64).wrapping_mul(gap as u64);
        let far = (most.wrapping_sub(way.unsigned_abs()) >> 32) as i32 & was_seen;
        // The way of a tick that came late is that of several.
        let on_time = all((input.missed_ticks as i32).wrapping_sub(1));
        let in_a_row = (now.marks & IN_A_ROW) as i32 & on_time;
        let present = !(lost as i32).wrapping_neg();
        let (one_step, one_bend) = (in_a_row << STEP_TO_SIGN & present, in_a_row << BEND_TO_SIGN & present);
        let bend = step.saturating_sub(samples.step);
        let size = bend ^ all(bend);
        // The sample before was out, and this one is back: without that one the way would hardly have changed.
        let without = bend.saturating_add(samples.bend).saturating_add(samples.bend);
        let straight = (without ^ all(without)).wrapping_sub(size >> 1).wrapping_sub(1);
        let back = all(one_bend & self.spike.wrapping_sub(size) & straight & !wide);
        let bent = one_step & self.largest_bend.wrapping_sub(size);
        let far = all(far | bent) & !back;
        let debounce_ticks = self.debounce_ticks as u32;
        let glitches = (now.glitches as u32).wrapping_add(1) & far as u32;
        let believed = all(debounce_ticks.wrapping_sub(glitches) as i32);
        now.glitches = (glitches & !believed as u32) as u16;
        let glitch = far & !believed;
        now.generator = sample.offset_counts((way & glitch as i64).wrapping_neg());
        let good = present & !glitch;
        let seen_now = seen ^ (seen ^ SAMPLED) & good as u32;
        now.play.take_back(samples.free, back);
        // What moved the flank is taken back with it.
        let flank = (now.marks ^ now.marks >> FLANK_SHIFT) & FLANK & back as u32;
        // One more in a row; one in which a new place is believed has no way.
        let row = ((in_a_row as u32) << 1 | FIRST_IN_A_ROW) & IN_A_ROW & (good & !believed) as u32;
        // One or two may each look like motion and be wrong, in a late tick by the way of as many more.
        let settled = all((row as i32) << BEND_TO_SIGN) as u32;
        let missed = input.missed_ticks;
        let unseen = (now.unseen() as u16).saturating_add(1).saturating_add(missed).saturating_add(missed);
        let unseen = (unseen as u32) << UNSEEN.trailing_zeros() & !settled;
        let gap = gap.min(GAP >> GAP.trailing_zeros()) << GAP.trailing_zeros() & !present as u32;
        now.marks = (now.marks & !(SEEN | IN_A_ROW | UNSEEN | GAP)) ^ flank | seen_now | row | unseen | gap;
        let half_way = (step >> 1).wrapping_add(samples.step >> 1);
        samples.step = step ^ (step ^ half_way) & back;
        samples.bend = bend & !back;
        // After too long without an answer of the table nobody followed the play.
        let late = debounce_ticks.wrapping_sub(now.uncorrected as u32) >> 31;
        if believed as u32 | seen >> SAMPLED.trailing_zeros() & late != 0 {
            // The play is not where it was thought.
            now.play = PlayState::unknown();
            now.marks &= !IN_A_ROW;
        }
        (Flags::default().with(Flags::SAMPLE_LOST, lost).with(Flags::GLITCH, (glitch | back) & 1 != 0), good)
    }

    /// The correction wanted in this tick, fine counts, and whether the tick came late.
    #[inline(always)]
    fn goal(&self, now: &mut Kept, input: &Input, wanted: i32, sane: bool) -> (i32, bool) {
        let late = input.missed_ticks > 0;
        now.uncorrected = now.uncorrected.saturating_add(1).wrapping_mul(!sane as u16);
        let kept = now.goal;
        let wanted = if sane { wanted.wrapping_mul(FINE) } else { kept };
        let mode = now.marks & MODE;
        // Off or safe: the two bits are the same. Of hold and safe the upper one is set.
        let off = (now.uncorrected > self.debounce_ticks) | ((mode ^ (mode >> 1)) & 1 == 0);
        let late_mask = (late as u32).wrapping_neg();
        let keep = (mode >> 1).wrapping_neg() | (late_mask & self.hold_late);
        let wanted = if off { 0 } else { wanted ^ (wanted ^ kept) & keep as i32 };
        // Down in `fade` ticks, late or not, and none for as many, with each late one anew; without that policy `fade`
        // is 0.
        let left = now.fading.saturating_sub(1);
        let start = left.max((self.fade as u32) << (now.fading == 0) as u32);
        now.fading = left ^ (left ^ start) & late_mask;
        let part = now.fading.saturating_sub(self.fade as u32) as f32 * self.fade_step;
        let faded = (wanted as f32 * part) as i32;
        let goal = if now.fading > 0 { faded } else { wanted };
        now.goal = wanted;
        (goal, late)
    }

    /// Moves the correction towards the goal, and never beyond `most`, whatever state it is in.
    ///
    /// As fast as it can be stopped there in whole ticks, braking with half of the acceleration `b`: from a distance
    /// `l` the speed is `(l + b·n(n + 1)/2)/(n + 1)`, with the number `n` of braking ticks that brings that between
    /// `n·b` and `(n + 1)·b`. So it never leaves the range of the goals that it was given, and a goal that moves by
    /// less than `b` in a tick is where it is. Braking with all of the acceleration takes a fifth less time, and lets
    /// slow noise out 7 % larger than it came in.
    #[inline(always)]
    fn limit(&self, now: &mut Kept, goal: i32, most: i32) -> i32 {
        let before = now.correction;
        let lag = goal.wrapping_sub(before);
        let away = lag.unsigned_abs();
        let side = lag >> 31;
        let braking = (self.acceleration as u32).wrapping_add(1) >> 1;
        // Rounded up, so that it is right or one too many.
        let root = num::sqrt::<2>(1.0 + 8.0 * (away as f32 / braking as f32));
        let ticks = (0.5 * (root * (1.0 + 6e-6) - 1.0)) as u32;
        let lost = |ticks: u32| braking.wrapping_mul(ticks).wrapping_mul(ticks.wrapping_add(1)) >> 1;
        let ticks = ticks.wrapping_sub((lost(ticks) > away) as u32);
        let stoppable = away.wrapping_add(lost(ticks)) / NonZeroU32::MIN.saturating_add(ticks);
        let wanted = (stoppable as i32 ^ side).wrapping_sub(side);
        let (slower, faster) = (now.speed.wrapping_sub(self.acceleration), now.speed.wrapping_add(self.acceleration));
        let speed = within(within(wanted, slower, faster), self.rate.wrapping_neg(), self.rate);
        // Where a smaller table was activated it is on its way back, and goes no further out.
        let least = most.wrapping_neg();
        let least = if before < least { before } else { least };
        let most = if before > most { before } else { most };
        let correction = within(before.wrapping_add(speed), least, most);
        now.speed = correction.wrapping_sub(before);
        now.correction = correction;
        correction
    }
}

bits_of!(Joint { copies });
bits_of!(JointSettings {
    drive,
    hold_late,
    rate,
    acceleration,
    largest_move,
    largest_bend,
    spike,
    tick_s,
    debounce_ticks,
    fade,
    fade_step,
    hold,
    sums,
});

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crc::crc32;
    use crate::encoder::{EncoderSettings, EncoderWrap};
    use crate::fixture::{self, ARCSEC, LIMITS};
    use crate::joint::Adjustment;
    use crate::joint::mode::{Mode, ModeError};
    use crate::joint::state::{MOST_FINE, RestoreError};
    use crate::table::Quality;
    use crate::upset::Upset;
    use proptest::prelude::*;
    use std::sync::LazyLock;
    use std::vec::Vec;

    static IMAGES: LazyLock<[Vec<u8>; 2]> = LazyLock::new(|| [fixture::image(true), fixture::image(true)]);

    fn images() -> Images<'static> {
        Images::new(&IMAGES[0], &IMAGES[1])
    }

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
            store.activate(&images(), &fixture::drive(), 20.0).unwrap();
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
            let out = self.joint.tick(&images(), &mut self.store, &mut self.state, input);
            // As it is kept: the output is rounded to 24 bits, and a large one to more than the change of a tick may
            // be off.
            let now = self.state.open().0.correction as f64 * (RAD_PER_COUNT as f64 / FINE as f64);
            assert!(
                (out.correction_rad as f64 - now).abs() <= f32::EPSILON as f64 * now.abs(),
                "reported {out:?}, kept {now}"
            );
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
    fn a_target_that_leaps_is_commanded_and_the_correction_keeps_its_limits() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        // A radian of the output, 94 of the generator; `tick` asserts the limits of the correction.
        let leap = Input { target: run.input(1.0).target, ..run.input(0.0) };
        let out = run.tick(&leap);
        let plain = fixture::drive().nominal_generator(leap.target);
        let nominal = fixture::drive().ratio() as f64 * out.correction_rad as f64;
        assert!((plain.minus_rad(out.command) as f64 - nominal).abs() < 1e-6 * nominal.abs() + 1e-6);
        assert_eq!(out.flags.with(Flags::HELD_BACK, true), Flags::HELD_BACK);
    }

    /// Where nothing is whole and nothing was seen the command is no place to go to.
    #[test]
    fn without_settings_the_command_is_the_last_sample_or_zero() {
        for ticks in [0, 30] {
            let mut run = Loop::new(Overrun::SkipAndCount);
            for i in 0..ticks {
                let out = run.tick(&run.input(0.1 + 1e-5 * i as f64));
                run.generator = out.command;
            }
            let last = run.state.open().0.generator;
            for bit in [3, run.joint.bits() / 2 + 90] {
                run.joint.flip(bit, &mut std::string::String::new());
            }
            let input = run.input(0.2);
            let out = run.joint.tick(&images(), &mut run.store, &mut run.state, &input);
            assert!(out.flags.contains(Flags::JOINT_TORN) && out.flags.contains(Flags::NOT_CORRECTED));
            assert_eq!((out.command, out.command == GeneratorAngle::ZERO), (last, ticks == 0));
        }
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

    /// At nearly full speed, after lost samples, the first late by two ticks or not: the next is believed if the
    /// generator can be there, and else a glitch.
    #[test]
    fn the_sample_after_lost_ones_is_judged_by_all_ticks_since_the_last() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        let fastest = LIMITS.generator_rate_rad_s * LIMITS.tick_s;
        for (lost, missed) in (1..13).flat_map(|lost| [(lost, 0), (lost, 2)]) {
            for (part, glitch) in [(0.95, false), (1.05, true)] {
                let (mut state, input) = (run.state, run.input(4e-3));
                let mut tick = |input| run.joint.tick(&images(), &mut run.store, &mut state, &input).flags;
                for tick_of in 0..lost {
                    let missed_ticks = if tick_of == 0 { missed } else { 0 };
                    assert!(tick(Input { generator: None, missed_ticks, ..input }).contains(Flags::SAMPLE_LOST));
                }
                let way = num::counts(f64::from(part * fastest) * f64::from(lost + missed + 1)) as i64;
                let there = run.generator.offset_counts(way);
                assert_eq!(tick(Input { generator: Some(there), ..input }).contains(Flags::GLITCH), glitch, "{lost}");
                // One tick further: what was lost counts once.
                let last = if glitch { run.generator } else { there };
                let beyond = last.offset_rad(1.05 * fastest);
                assert!(tick(Input { generator: Some(beyond), ..input }).contains(Flags::GLITCH), "{lost}");
                assert!(state.play().is_known());
            }
        }
    }

    /// No number and no flag says "perfect" where nothing is seen, or where nothing is corrected.
    #[test]
    fn what_is_not_seen_or_not_corrected_is_told() {
        let follows = |out: &Output| out.quality == Quality::InRange && out.flags == Flags::default();
        let mut run = Loop::new(Overrun::FadeOut { ticks: 400 });
        let seen = run.run(300, 1e-3, 1e-5);
        assert!(follows(&seen) && seen.uncertainty_rad < 1e-6);
        let limit = crate::table::Table::check(&IMAGES[0]).unwrap().error_limit_rad();
        // No sample, and one that is not believed: the error is any that the table gives.
        for generator in [None, Some(run.generator.offset_rad(3.0))] {
            for _ in 0..3 {
                let out = run.tick(&Input { generator, ..run.input(4e-3) });
                let most = limit + out.transmission_error_rad.abs();
                assert!(out.quality == Quality::Uncertain && out.uncertainty_rad >= 0.999 * most, "{out:?}");
            }
        }
        assert!(follows(&run.run(100, 4e-3, 1e-5)));
        // What is left at the output while the mode, or a fade, does not follow the table.
        let wanted = run.run(100, 5e-3, 1e-5).correction_rad;
        let reported = |out: &Output| {
            let lacks = (out.held_back_rad + out.correction_rad - wanted).abs();
            out.flags.contains(Flags::HELD_BACK) && out.quality == Quality::InRange && lacks < 0.1 * wanted.abs()
        };
        let _ = run.tick(&Input { missed_ticks: 1, ..run.input(6e-3) });
        for tick in 1..790 {
            let out = run.tick(&run.input(6e-3));
            assert!(reported(&out), "fade, tick {tick}: {out:?}");
        }
        assert!(follows(&run.run(100, 6e-3, 1e-5)));
        run.state.request(Mode::Hold).unwrap();
        let held = run.run(3, 7e-3, -1e-5);
        assert!(held.flags.contains(Flags::HELD_BACK) && held.held_back_rad.abs() > 1e-5, "{held:?}");
        run.state.request(Mode::Off).unwrap();
        let off = run.run(300, 7e-3, 1e-5);
        // Of the flank that leads from where the output is to the target, which is behind it now.
        let lacks = off.held_back_rad.abs() > wanted.abs() && off.flags.contains(Flags::HELD_BACK);
        assert!(off.correction_rad == 0.0 && lacks, "{off:?} {wanted}");
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

    /// Every bit of a reading, wrong once, at every speed that the limit allows and everywhere in the register; bits of
    /// a register that is no power of two, too.
    #[test]
    fn a_wrong_bit_of_a_reading_moves_no_turn() {
        let made = |counts_per_turn, wrap, reversed| {
            Encoder::new(EncoderSettings { counts_per_turn, wrap, reversed, zero_counts: 1234 }).unwrap()
        };
        let encoders = [
            (made(65_536, EncoderWrap::Turn, false), 16),
            (made(20_000, EncoderWrap::Turn, true), 15),
            (made(20_000, EncoderWrap::Bits(16), true), 16),
            (made(4096, EncoderWrap::Bits(14), false), 14),
        ];
        // Nearly all of 700 rad/s.
        let fastest = (0.11 * 4_294_967_296.0) as i64;
        let (mut lost, mut hidden, mut trials) = (0, 0, 0);
        for (encoder, bits) in encoders {
            for (bit, place, speed) in (0..bits)
                .flat_map(|bit| (0..8).map(move |place| (bit, place)))
                .flat_map(|(bit, place)| (-4..=4).map(move |speed| (bit, place, speed * fastest / 4)))
            {
                let mut run = Loop::new(Overrun::SkipAndCount);
                let at = |tick: i64| (3 << 32) + place * (7 << 29) + tick * speed;
                let mut now = encoder.start(encoder.reading(at(0)), at(0)).unwrap();
                let mut alone = now;
                for tick in 0..14 {
                    let good = encoder.reading(at(tick));
                    let reading = if tick == 4 { good ^ 1 << bit } else { good };
                    let generator = run.joint.read(&run.state, &encoder, &mut now, reading);
                    let _ = encoder.read(&mut alone, reading);
                    let off = generator.map_or(0, |found| found.counts() - at(tick)).abs();
                    assert!(tick == 4 || generator.is_some() && off <= 1 << 21, "bit {bit}, {speed}: {off}");
                    let out = run.tick(&Input { generator, torque_n_m: 5.0, ..run.input(0.0) });
                    // Where the joint has it, but for what motion within the limit may be; or it does not believe it.
                    let off = (run.state.open().0.generator.counts() - at(tick)).abs();
                    let reported = out.flags.contains(Flags::GLITCH) || out.flags.contains(Flags::SAMPLE_LOST);
                    hidden += (off > 2 * fastest + (1 << 23) && !reported) as u32;
                    assert!(tick < 11 || off <= 1 << 21 && !reported, "bit {bit}, {speed}, tick {tick}: {off}");
                }
                lost += ((encoder.angle(&alone).unwrap() - at(13)).abs() > 1 << 31) as u32;
                trials += 1;
            }
        }
        // An encoder that nobody judges loses turns.
        assert_eq!((hidden, trials), (0, 61 * 8 * 9));
        assert!(lost > 200, "{lost}");
    }

    /// A bit of a reading is wrong once while the joint holds: how far the estimate is off in that tick, and at most
    /// after it, ″ (by the table, with a play of its own that follows the generator); the flag in that tick, and in the
    /// next.
    fn after_a_wrong_bit(joint: &Joint, wrong: i64) -> ([f64; 2], [bool; 2]) {
        let mut run = Loop::new(Overrun::SkipAndCount);
        (run.joint, run.generator) = (*joint, GeneratorAngle::from_rad(0.095).unwrap());
        let table = crate::table::Table::check(&IMAGES[0]).unwrap();
        let (mut truth, mut worst, mut flags) = (PlayState::unknown(), [0.0f64; 2], [false; 2]);
        for tick in 0..1400_usize {
            if tick == 350 {
                run.state.request(Mode::Hold).unwrap();
            }
            let place = 1e-3 + 1e-5 * tick.min(300) as f64;
            let seen = run.generator.offset_counts(if tick == 400 { wrong } else { 0 });
            let there = table.forward(&mut truth, run.generator, 5.0, 20.0);
            let input = Input { generator: Some(seen), ..run.input(place) };
            let out = run.joint.tick(&images(), &mut run.store, &mut run.state, &input);
            run.generator = out.command;
            if tick >= 400 {
                let worst = &mut worst[usize::from(tick > 400)];
                *worst = worst.max(f64::from(out.output.minus_rad(there.output)).abs() / ARCSEC);
            }
            let glitch = out.flags.contains(Flags::GLITCH);
            match tick {
                400 | 401 => flags[tick - 400] = glitch,
                _ => assert!(!glitch, "tick {tick}"),
            }
        }
        (worst, flags)
    }

    /// Every bit of an encoder of 20 bits at 600 rad/s: what one reading did to the play is taken back, and with an
    /// acceleration that is given is not done.
    #[test]
    fn a_lone_wrong_reading_moves_the_play_for_no_longer_than_its_tick() {
        let limits = Limits { rate_rad_s: 0.1, acceleration_rad_s2: 20.0, generator_rate_rad_s: 600.0, ..LIMITS };
        let joint = Joint::new(fixture::drive(), limits, Overrun::SkipAndCount).unwrap();
        let given = joint.with_generator_acceleration(3000.0).unwrap();
        let count_rad = core::f64::consts::TAU / 1_048_576.0;
        // Where no acceleration is too large it is for good: by the whole play, 100 µrad.
        let ([_, then], flags) = after_a_wrong_bit(&joint.with_generator_acceleration(1e9).unwrap(), 1 << 28);
        assert!(then > 20.0 && flags == [false; 2], "{then}");
        for (bit, sign) in (0..20).flat_map(|bit| [(bit, 1), (bit, -1)]) {
            let wrong = sign << (12 + bit);
            // At the output, ″.
            let size = f64::from(1 << bit) * count_rad / 95.0 / ARCSEC;
            let ([at_first, then], [at_once, next]) = after_a_wrong_bit(&joint, wrong);
            std::println!("bit {bit} {sign}: {size:.2} off: {at_first:.2} and then {then:.2}, {at_once} {next}");
            // 600 rad/s in 64 ticks, and that in two: 4.7e-3 rad of the generator. A glitch is beyond 0.6 rad.
            let seen = f64::from(1 << bit) * count_rad > 4.7e-3;
            assert_eq!([at_once, next], [bit >= 17, seen && bit < 17], "bit {bit}");
            assert!(if seen { then < 0.01 } else { then <= 1.02 * size + 0.01 }, "bit {bit}: {then}");
            let ([at_first, then], flags) = after_a_wrong_bit(&given, wrong);
            let (beyond, back) = (f64::from(1 << bit) * count_rad > 3e-3, f64::from(1 << bit) * count_rad > 1.5e-3);
            assert_eq!(flags, [beyond, back && !beyond], "bit {bit}, with an acceleration");
            assert!(if back { then < 0.01 } else { then <= 1.02 * size + 0.01 }, "bit {bit}: {then}");
            assert!(!beyond || at_first < 0.01, "bit {bit}: {at_first}");
        }
    }

    /// A generator that accelerates as much as it may, and turns back, is believed.
    #[test]
    fn motion_within_the_acceleration_is_no_glitch() {
        let joint = Joint::new(fixture::drive(), LIMITS, Overrun::SkipAndCount).unwrap();
        let joint = joint.with_generator_acceleration(3000.0).unwrap();
        for most in [2.9e-3, 0.0] {
            let mut run = Loop::new(Overrun::SkipAndCount);
            let (mut at, mut speed, mut missed) = (0.0f64, 0.0f64, 0);
            for tick in 0..2000 {
                // To 600 rad/s, back to -600, and so on; now and then a tick is missed.
                speed = (speed + if tick / 400 % 2 == 0 { most } else { -most }).clamp(-0.6, 0.6);
                at += speed;
                if tick % 97 == 96 && speed.abs() < 0.3 {
                    missed = 1;
                    continue;
                }
                let missed_ticks = core::mem::take(&mut missed);
                let generator = GeneratorAngle::from_rad(at);
                let input = Input { generator, missed_ticks, ..run.input(at / 95.0) };
                let out = joint.tick(&images(), &mut run.store, &mut run.state, &input);
                assert!(!out.flags.contains(Flags::GLITCH), "{most} {tick}");
            }
        }
        let named = |rad_s2| joint.with_generator_acceleration(rad_s2).unwrap_err().name;
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-6] {
            assert_eq!(named(bad), "generator_acceleration_rad_s2");
        }
    }

    /// 500 rad/s, and one sample short by 0.3 rad: the way back is 0.8 rad, and a tick at full speed 0.6 rad.
    #[test]
    fn a_sample_that_comes_back_is_believed_beyond_the_fastest_generator() {
        let limits = Limits { generator_rate_rad_s: 600.0, ..LIMITS };
        let joint = Joint::new(fixture::drive(), limits, Overrun::SkipAndCount).unwrap();
        let mut run = Loop::new(Overrun::SkipAndCount);
        for tick in 0..40 {
            let at = 0.5 * f64::from(tick);
            let seen = if tick == 20 { at - 0.3 } else { at };
            let input = Input { generator: GeneratorAngle::from_rad(seen), ..run.input(at / 95.0) };
            let out = joint.tick(&images(), &mut run.store, &mut run.state, &input);
            assert_eq!(out.flags.contains(Flags::GLITCH), tick == 21, "tick {tick}");
            let output = OutputAngle::from_rad(seen / f64::from(joint.drive().ratio())).unwrap();
            let off_rad = out.output.minus_rad(output);
            assert!(off_rad.abs() < 1e-3, "tick {tick}: {off_rad}");
        }
    }

    /// Wrong readings in a row of a register of one turn, at every speed to the limit: as long as the turn can be known
    /// it is; after that the joint has no sample.
    #[test]
    fn wrong_readings_in_a_row_lose_no_turn_unsaid() {
        let limits = Limits { generator_rate_rad_s: 500.0, ..LIMITS };
        let settings =
            EncoderSettings { counts_per_turn: 1 << 20, wrap: EncoderWrap::Turn, reversed: false, zero_counts: 0 };
        let encoder = Encoder::new(settings).unwrap();
        let fastest = (0.0795 * 4_294_967_296.0) as i64;
        let mut seed = 1u64;
        let mut any = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            seed >> 44
        };
        let (mut unsaid, mut said, mut kept) = ([0; 9], [0; 9], [0; 9]);
        for trial in 0..6000_usize {
            let (wrongs, speed) = (1 + trial % 8, (trial as i64 / 8 % 9 - 4) * fastest / 4);
            let mut run = Loop::new(Overrun::SkipAndCount);
            run.joint = Joint::new(fixture::drive(), limits, Overrun::SkipAndCount).unwrap();
            let at = |tick: i64| (3 << 32) + tick * speed;
            let mut now = encoder.start(encoder.reading(at(0)), at(0)).unwrap();
            for tick in 0..40 {
                let wrong = (5..5 + wrongs as i64).contains(&tick);
                let reading = if wrong { any() } else { encoder.reading(at(tick)) };
                let generator = run.joint.read(&run.state, &encoder, &mut now, reading);
                let input = Input { generator, ..run.input(0.0) };
                let _ = run.joint.tick(&images(), &mut run.store, &mut run.state, &input);
                if tick == 39 {
                    let off = generator.map(|found| (found.counts() - at(tick)).abs() > 1 << 31);
                    let number = match off {
                        Some(true) => &mut unsaid,
                        Some(false) => &mut kept,
                        None => &mut said,
                    };
                    number[wrongs] += 1;
                    assert_eq!(generator.is_none(), now.is_lost());
                }
            }
        }
        std::println!("turns by wrong readings in a row: lost {unsaid:?}, said {said:?}, kept {kept:?}");
        // Six ticks of 0.0796 turn are less than half of one: three readings. Three and more that were each believed,
        // as one of six is at this limit, take the joint too far.
        assert_eq!((&unsaid[..3], &said[..4]), (&[0; 3][..], &[0; 4][..]));
        assert!(said[8] > 500 && unsaid.into_iter().all(|unsaid| unsaid < 100));
    }

    /// Every bit of joint and state between two ticks: what is asked of them then is what it was.
    #[test]
    fn no_single_bit_of_joint_or_state_changes_what_they_answer() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        let (store, target, generator) = (&run.store, run.input(5e-3).target, run.generator.offset_rad(0.01));
        let read = run.state.play().output().unwrap();
        let answers = |joint: &Joint, state: &JointState| {
            let mut play = *state.play();
            let moving = Approach::Moving(crate::Direction::Backward);
            (
                joint.forward(store, &mut play, generator, 5.0),
                [moving, Approach::From(state.play())].map(|approach| joint.inverse(store, target, 5.0, approach)),
                joint.rate_ahead(store, target, 0.01, 5.0, 4e-3),
                joint.motion_ahead(store, target, [0.01, 0.1], 5.0, 4e-3),
                (
                    joint.locate(store, target, 1e-5, 5.0, 1.0),
                    joint.torque(store, state.play(), &Adjustment::default(), run.generator, read, 1e-6),
                ),
                (*joint.drive(), state.mode(), *state.play()),
            )
        };
        let expected = answers(&run.joint, &run.state);
        assert!(expected.0.quality == Quality::InRange && expected.2.is_finite());
        assert_eq!([expected.4.0.quality, expected.4.1.quality], [Quality::InRange; 2]);
        for bit in 0..run.joint.bits() {
            let mut joint = run.joint;
            joint.flip(bit, &mut std::string::String::new());
            assert_eq!(answers(&joint, &run.state), expected, "joint, bit {bit}");
        }
        for bit in 0..run.state.bits() {
            let mut state = run.state;
            state.flip(bit, &mut std::string::String::new());
            assert_eq!(answers(&run.joint, &state), expected, "state, bit {bit}");
        }
        // What is lost gives nothing.
        let (mut joint, mut state) = (run.joint, run.state);
        for bit in [3, joint.bits() / 2 + 90] {
            joint.flip(bit, &mut std::string::String::new());
        }
        for bit in [0, state.bits() / 2 + 40] {
            state.flip(bit, &mut std::string::String::new());
        }
        let (forward, inverse, rate, motion, (located, torque), _) = answers(&joint, &run.state);
        assert_eq!([located.quality, torque.quality], [Quality::Disabled; 2]);
        assert!(joint.is_lost() && rate.is_nan() && motion[1].is_nan());
        assert!([forward.quality, inverse[0].quality, inverse[1].quality] == [Quality::Disabled; 3]);
        assert_eq!((state.mode(), *state.play()), (Mode::Safe, PlayState::unknown()));
    }

    /// Where motion is as large as what a wrong bit does, no reading is taken.
    #[test]
    fn a_limit_that_hides_a_wrong_bit_is_refused() {
        let settings =
            EncoderSettings { counts_per_turn: 4096, wrap: EncoderWrap::Turn, reversed: false, zero_counts: 0 };
        let run = Loop::new(Overrun::SkipAndCount);
        for (rate, wrap, taken) in [
            (1040.0, EncoderWrap::Turn, true),
            (1050.0, EncoderWrap::Turn, false),
            (2090.0, EncoderWrap::Bits(13), true),
            (2100.0, EncoderWrap::Bits(13), false),
        ] {
            let limits = Limits { generator_rate_rad_s: rate, ..LIMITS };
            let joint = Joint::new(fixture::drive(), limits, Overrun::SkipAndCount).unwrap();
            let encoder = Encoder::new(EncoderSettings { wrap, ..settings }).unwrap();
            let mut at = encoder.start(0, 0).unwrap();
            let before = at;
            assert_eq!(joint.read(&run.state, &encoder, &mut at, 8).is_some(), taken, "{rate}");
            assert_eq!(at != before, taken);
        }
        let mut nowhere = EncoderState::NOWHERE;
        assert_eq!(run.joint.read(&run.state, &Encoder::new(settings).unwrap(), &mut nowhere, 8), None);
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

    const POLICIES: [Overrun; 3] = [Overrun::SkipAndCount, Overrun::HoldLast, Overrun::FadeOut { ticks: 40 }];

    /// However many ticks come late: off, safe and a torque that is lost for good leave no correction.
    #[test]
    fn an_end_is_an_end_in_late_ticks() {
        for (policy, missed_ticks, hold) in
            POLICIES.into_iter().flat_map(|policy| [(policy, 0, false), (policy, 0, true), (policy, 1, false)])
        {
            for (mode, torque_n_m) in [(Mode::Off, 5.0), (Mode::Safe, 5.0), (Mode::Tracking, f32::NAN)] {
                let mut run = Loop::new(policy);
                let before = run.run(300, 1e-3, 1e-5);
                assert!(before.correction_rad.abs() > 1e-5);
                if hold {
                    run.state.request(Mode::Hold).unwrap();
                }
                if mode != Mode::Tracking {
                    run.state.request(mode).unwrap();
                }
                let mut out = before;
                for tick in 0..300 {
                    out = run.tick(&Input { torque_n_m, missed_ticks, ..run.input(4e-3) });
                    run.generator = out.command;
                    // A lost torque is borne for five ticks.
                    let kept = mode == Mode::Tracking && tick < 5 && policy != POLICIES[2];
                    assert!(!kept || (out.correction_rad - before.correction_rad).abs() < COUNT, "{policy:?} {tick}");
                }
                assert_eq!(out.correction_rad, 0.0, "{policy:?} {missed_ticks} {hold} {mode:?}");
                assert_eq!(out.flags.contains(Flags::HELD_BACK), torque_n_m.is_finite(), "{policy:?} {mode:?}");
            }
        }
    }

    /// Ticks late in every one, in every second one, and in bursts: none within its time, as long as they come late,
    /// and back afterwards.
    #[test]
    fn a_fade_goes_on_in_late_ticks() {
        let late: [fn(usize) -> bool; 4] = [|_| true, |tick| tick % 2 == 0, |tick| tick % 40 == 0, |tick| tick % 7 < 3];
        for late in late {
            let mut run = Loop::new(POLICIES[2]);
            let before = run.run(300, 1e-3, 1e-5).correction_rad.abs();
            for tick in 0..600 {
                let missed_ticks = u16::from(late(tick));
                let out = run.tick(&Input { missed_ticks, ..run.input(4e-3) });
                run.generator = out.command;
                // The limiter takes its time after the fade.
                assert!(tick < 70 || out.correction_rad == 0.0, "{tick}: {out:?}");
                assert!(tick < 1 || out.flags.contains(Flags::HELD_BACK), "{tick}: {out:?}");
            }
            let back = run.run(300, 4e-3, 0.0);
            assert!(back.correction_rad.abs() > 0.5 * before && back.held_back_rad.abs() < COUNT, "{back:?}");
        }
    }

    /// As far away as the ticks since the last one allow, however many those are, and no further.
    #[test]
    fn a_late_sample_may_be_further_away() {
        let in_a_tick = f64::from(LIMITS.generator_rate_rad_s) * f64::from(LIMITS.tick_s);
        for missed_ticks in [0u16, 1, 2, 7, 100, u16::MAX] {
            for share in [-1.001, -0.999, 0.999, 1.001] {
                let mut run = Loop::new(Overrun::SkipAndCount);
                let _ = run.tick(&run.input(0.0));
                let way_rad = share * in_a_tick * (f64::from(missed_ticks) + 1.0);
                let input = Input { generator: GeneratorAngle::from_rad(way_rad), missed_ticks, ..run.input(0.0) };
                let glitch = run.tick(&input).flags.contains(Flags::GLITCH);
                assert_eq!(glitch, share.abs() > 1.0, "{missed_ticks} missed, {share}");
            }
        }
    }

    #[test]
    fn a_reset_in_the_middle_of_a_reversal_goes_on_where_it_was_or_starts_anew() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        run.run(8, 4e-3, -1e-5);
        let saved = run.state.save(&run.joint, &run.store);
        let mut restored = JointState::restore(&saved, &run.joint, &run.store).unwrap();
        restored.request(Mode::Tracking).unwrap();
        run.state = restored;
        // `tick` asserts the limits across the reset.
        let on = run.run(3, 3.92e-3, -1e-5);
        assert!(on.flags.contains(Flags::HELD_BACK) && on.quality == Quality::InRange);
        for bit in 0..JointState::SAVED_BYTES * 8 {
            let mut damaged = saved;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(JointState::restore(&damaged, &run.joint, &run.store).is_err(), "bit {bit}");
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

    /// Flips in what changes while running: reported in the next tick, which is otherwise that without the flip.
    #[test]
    fn an_upset_of_the_state_is_told_and_mended_in_the_next_tick() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        let input = run.input(4e-3);
        let (sound, mut expected) = (run.state, run.state);
        let reference = run.joint.tick(&images(), &mut run.store.clone(), &mut expected, &input);
        let mut noticed = 0;
        // The last word only counts.
        for bit in 0..sound.bits() - 32 {
            let mut state = sound;
            state.flip(bit, &mut std::string::String::new());
            let found = run.joint.tick(&images(), &mut run.store.clone(), &mut state, &input);
            let reported = found.flags.contains(Flags::STATE_TORN);
            noticed += usize::from(reported);
            assert_eq!(
                Output { flags: reference.flags.with(Flags::STATE_TORN, reported), ..reference },
                found,
                "bit {bit}"
            );
            assert_eq!(state, expected, "bit {bit}");
        }
        // Those of the first copy; the second is written over.
        assert_eq!(noticed, (sound.bits() - 32) / 2);
    }

    /// Both copies are hit: the joint is safe, and says so until it is asked for another mode.
    #[test]
    fn a_state_that_is_lost_leaves_the_joint_safe() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        for bit in [0, run.state.bits() / 2 + 40] {
            run.state.flip(bit, &mut std::string::String::new());
        }
        // Its speed is lost too, so not within the acceleration.
        let input = run.input(4e-3);
        let out = run.joint.tick(&images(), &mut run.store, &mut run.state, &input);
        run.before = [f64::from(out.correction_rad), f64::from(out.correction_rad) + 2e-6];
        assert!(out.flags.contains(Flags::STATE_TORN) && out.flags.contains(Flags::SAFE), "{out:?}");
        assert_eq!((run.state.mode(), out.quality), (Mode::Safe, Quality::Uncertain));
        assert!(run.run(300, 4e-3, 0.0).flags.contains(Flags::SAFE));
        run.state.request(Mode::Off).unwrap();
        run.state.request(Mode::Tracking).unwrap();
        assert_eq!(run.run(900, 4e-3, 1e-5).quality, Quality::InRange);
    }

    /// A mode that is asked for between an upset and the next tick does not hide it.
    #[test]
    fn an_upset_is_told_though_a_mode_was_asked_for_meanwhile() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        run.state.flip(70, &mut std::string::String::new());
        run.state.request(Mode::Hold).unwrap();
        assert!(run.tick(&run.input(4e-3)).flags.contains(Flags::STATE_TORN));
        assert!(!run.tick(&run.input(4e-3)).flags.contains(Flags::STATE_TORN));
    }

    #[test]
    fn an_upset_of_the_joint_is_told_until_it_is_made_anew() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        let input = run.input(4e-3);
        let mut state = run.state;
        let reference = run.joint.tick(&images(), &mut run.store.clone(), &mut state, &input);
        let sound = run.joint;
        for bit in 0..sound.bits() {
            let (mut joint, mut state) = (sound, run.state);
            joint.flip(bit, &mut std::string::String::new());
            let found = joint.tick(&images(), &mut run.store.clone(), &mut state, &input);
            let reported = bit < sound.bits() / 2;
            let expected = Output { flags: reference.flags.with(Flags::JOINT_TORN, reported), ..reference };
            assert_eq!(found, expected, "bit {bit}");
            assert!(joint.mend() && joint == sound);
        }
        // Neither copy is whole: the generator stays where it is.
        let mut joint = sound;
        for bit in [3, sound.bits() / 2 + 90] {
            joint.flip(bit, &mut std::string::String::new());
        }
        let found = joint.tick(&images(), &mut run.store, &mut run.state, &input);
        assert!(found.flags.contains(Flags::JOINT_TORN) && found.flags.contains(Flags::NOT_CORRECTED));
        assert_eq!((found.quality, found.correction_rad, joint.mend()), (Quality::Disabled, 0.0, false));
        assert!(found.command.minus_rad(run.generator).abs() < 0.1);
    }

    #[test]
    fn an_adjustment_is_added_to_estimate_and_command_alike() {
        let adjusted = Adjustment::from_rad(3e-5, 1.0e-5);
        let mut runs = [Adjustment::default(), adjusted].map(|adjustment| {
            let mut run = Loop::new(Overrun::SkipAndCount);
            // Leaps, and not readings that are out and back.
            run.joint = run.joint.with_generator_acceleration(1e9).unwrap();
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
        assert_eq!(Adjustment::from_rad(f32::NAN, f32::NEG_INFINITY), Adjustment::new(0, least));
        assert_eq!(Adjustment::from_rad(1e-6, 0.06), Adjustment::new(684, most));
        let tick = |adjustment| {
            let mut run = Loop::new(Overrun::SkipAndCount);
            run.run(300, 1e-3, 1e-5);
            let at = run.generator.offset_rad(1e-3);
            let out = run.tick(&Input { adjustment, generator: Some(at), ..run.input(4e-3) });
            (out, run)
        };
        let closed = |counts| Adjustment::new(0, counts);
        for (wild, bounded) in [(i32::MIN, least), (i32::MAX, most)] {
            let mean = |counts| Adjustment::new(counts, 0);
            let (found, same) = (tick(mean(wild)).0, tick(mean(bounded)).0);
            // The same, and only what is beyond is reported.
            for (found, same) in [(tick(closed(wild)).0, tick(closed(bounded)).0), (found, same)] {
                assert!(found.flags.contains(Flags::BOUNDED) && !same.flags.contains(Flags::BOUNDED));
                assert_eq!(Output { flags: same.flags, ..found }, same);
            }
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

    /// Every bit of what is kept of an adjustment between two ticks; and two words of it, which are not used.
    #[test]
    fn an_upset_of_an_adjustment_is_mended_or_not_used() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        let adjustment = Adjustment::from_rad(-1.4e-4, 1e-5);
        let tick = |run: &Loop, adjustment| {
            let (mut store, mut state) = (run.store.clone(), run.state);
            run.joint.tick(&images(), &mut store, &mut state, &Input { adjustment, ..run.input(4e-3) })
        };
        for _ in 0..100 {
            let out = run.tick(&Input { adjustment, ..run.input(4e-3) });
            run.generator = out.command;
        }
        let expected = tick(&run, adjustment);
        assert!(expected.quality == Quality::InRange && expected.uncertainty_rad == 0.0);
        for bit in 0..adjustment.bits() {
            let mut hit = adjustment;
            hit.flip(bit, &mut std::string::String::new());
            assert_eq!(tick(&run, hit), expected, "{bit}");
            assert_eq!(hit.plus(Adjustment::default()), adjustment);
            hit.flip((bit + 40) % adjustment.bits(), &mut std::string::String::new());
            let lost = tick(&run, hit);
            assert!(lost.flags.contains(Flags::NOT_CORRECTED) && lost.quality == Quality::Disabled, "{bit}: {lost:?}");
            assert_eq!(lost.correction_rad, expected.correction_rad, "{bit}");
            // And what is added to it.
            let lost = tick(&run, hit.plus(adjustment));
            assert!(lost.flags.contains(Flags::NOT_CORRECTED), "{bit}");
        }
        // What its maker does not know the tick does not know either.
        let open = tick(&run, adjustment.with_uncertainty(1e-5));
        assert!(open.quality == Quality::Uncertain && (open.uncertainty_rad - 1e-5).abs() < 2e-9, "{open:?}");
        assert_eq!(open.command, expected.command);
        for unknown in [f32::NAN, -1.0, 1.0] {
            assert_eq!(adjustment.with_uncertainty(unknown).uncertainty_rad(), Adjustment::MAX_RAD);
        }
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
        // Too small to matter in a tick.
        assert_eq!(named(Limits { tick_s: 1e-40, ..LIMITS }), "tick_s");
        assert_eq!(named(Limits { rate_rad_s: 1e-40, ..LIMITS }), "rate_rad_s");
        assert_eq!(named(Limits { acceleration_rad_s2: 1e-40, ..LIMITS }), "acceleration_rad_s2");
        assert_eq!(named(Limits { generator_rate_rad_s: 1e-40, ..LIMITS }), "generator_rate_rad_s");
        assert_eq!(named(Limits { deadband_rad: 1e-40, ..LIMITS }), "deadband_rad");
        assert_eq!(named(Limits { generator_rate_rad_s: f32::INFINITY, ..LIMITS }), "generator_rate_rad_s");
    }

    /// The remaining way must not drown in the rounding of a large acceleration.
    #[test]
    fn an_acceleration_beyond_need_does_not_make_the_correction_jitter() {
        for step in 0..60 {
            let acceleration_rad_s2 = 1.0e6 * 1.06f32.powi(step);
            let mut run = Loop::new(Overrun::SkipAndCount);
            run.joint =
                Joint::new(fixture::drive(), Limits { acceleration_rad_s2, ..LIMITS }, Overrun::SkipAndCount).unwrap();
            let images = images();
            for tick in 0..400 {
                let input = run.input(1e-3);
                let out = run.joint.tick(&images, &mut run.store, &mut run.state, &input);
                run.generator = out.command;
                assert!(tick < 200 || out.held_back_rad.abs() < COUNT, "{acceleration_rad_s2}, tick {tick}: {out:?}");
            }
        }
    }

    /// A limiter alone: fine counts in a tick and in a tick more each tick.
    struct Limited {
        settings: JointSettings,
        now: Kept,
    }

    impl Limited {
        fn new(rate: i32, acceleration: i32) -> Self {
            let Joint { copies: [settings, _] } = Joint::new(fixture::drive(), LIMITS, Overrun::SkipAndCount).unwrap();
            Self { settings: JointSettings { rate, acceleration, ..settings }, now: JointState::new().open().0 }
        }

        /// One tick; no limit is broken by a single count.
        fn go(&mut self, goal: i32) -> i32 {
            let (before, speed) = (self.now.correction, self.now.speed);
            let found = self.settings.limit(&mut self.now, goal, MOST_FINE as i32);
            let moved = found - before;
            assert!(moved == self.now.speed && moved.abs() <= self.settings.rate, "rate {moved}");
            assert!((moved - speed).abs() <= self.settings.acceleration, "acceleration {}", moved - speed);
            found
        }
    }

    #[test]
    fn a_step_ends_where_it_is_asked_to_without_going_beyond() {
        for acceleration in [1, 2, 7, 1000, 30_000, 40_000_000] {
            for goal in [1, 5, 999, 1_000_003, -70_000_000, MOST_FINE as i32] {
                let mut limited = Limited::new(100_000_000, acceleration);
                let (mut before, mut ticks) = (0, 0);
                while before != goal {
                    let now = limited.go(goal);
                    assert!(
                        now.abs() <= goal.abs() && (now - before).signum() == goal.signum(),
                        "{acceleration} {goal}: {now}"
                    );
                    (before, ticks) = (now, ticks + 1);
                }
                // Speeding up with all, braking with half of it: √(6·way/acceleration); and rounding to whole ticks and
                // counts.
                let least = (6.0 * f64::from(goal.abs()) / f64::from(acceleration)).sqrt();
                assert!(f64::from(ticks) <= 1.01 * least + 8.0, "{acceleration} {goal}: {ticks} {least}");
            }
        }
    }

    #[test]
    fn a_goal_slower_than_half_of_the_acceleration_is_where_it_is_and_a_faster_one_is_ahead_by_what_stopping_takes() {
        for (pace, lag) in [(500, 0), (-500, 0), (2500, 5000), (-2500, -5000)] {
            let mut limited = Limited::new(100_000, 1000);
            let mut found = 0;
            for k in 1..=50 {
                found = limited.go(k * pace);
            }
            // 2000, 1500, 1000 and 500 more, if the goal stopped here.
            assert_eq!(50 * pace - found, lag, "{pace}");
        }
    }

    /// Noise of every colour, and of every size against the acceleration: never larger than it came in.
    #[test]
    fn noise_comes_out_no_larger_than_it_came_in() {
        let mut seed = 1_u32;
        let mut white = || {
            let mut one = || {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(seed >> 8) / f64::from(1 << 23) - 1.0
            };
            one() + one() + one() + one()
        };
        for acceleration in [10, 100, 1000, 10_000, 100_000, 1_000_000] {
            for share in [1.0, 0.4, 0.1, 0.03, 0.01, 0.003] {
                let mut limited = Limited::new(i32::MAX / 8, acceleration);
                let (mut slow, mut sums) = (0.0, [[0.0; 2]; 2]);
                for _ in 0..20_000 {
                    slow += share * (white() - slow);
                    let goal = (1e5 * slow) as i32;
                    for (sum, value) in sums.iter_mut().zip([goal, limited.go(goal)]) {
                        *sum = [sum[0] + f64::from(value), sum[1] + f64::from(value).powi(2)];
                    }
                }
                let [came, left] = sums.map(|[sum, squares]| (squares / 2e4 - (sum / 2e4).powi(2)).sqrt());
                assert!(left <= came, "acceleration {acceleration}, share {share}: {came} in, {left} out");
            }
        }
    }

    /// With a checksum that fits: what no joint can have saved is refused all the same.
    #[test]
    fn impossible_saved_states_are_refused() {
        let mut run = Loop::new(Overrun::SkipAndCount);
        run.run(300, 1e-3, 1e-5);
        let saved = run.state.save(&run.joint, &run.store);
        let changed = |at: usize, value: [u8; 4]| {
            let mut bytes = saved;
            bytes[at..at + 4].copy_from_slice(&value);
            let (before, sum) = bytes.split_last_chunk_mut::<4>().unwrap();
            *sum = crc32(before).to_le_bytes();
            JointState::restore(&bytes, &run.joint, &run.store)
        };
        const CORRECTION: usize = 56;
        let most = MOST_FINE as i32;
        for correction in [most + 1, -most - 1, i32::MIN] {
            let found = changed(CORRECTION, correction.to_le_bytes());
            assert_eq!(found, Err(RestoreError::Impossible), "{correction}");
        }
        for speed in [most + 1, i32::MIN] {
            assert_eq!(changed(CORRECTION + 4, speed.to_le_bytes()), Err(RestoreError::Impossible), "{speed}");
        }
        for flank in [1u32, 48, 64] {
            assert_eq!(changed(64, flank.to_le_bytes()), Err(RestoreError::Impossible), "{flank}");
        }
        for correction in [most, -most, 0] {
            assert!(changed(CORRECTION, correction.to_le_bytes()).is_ok(), "{correction}");
        }
        // A flank before any sample.
        let mut bytes = JointState::new().save(&run.joint, &run.store);
        bytes[64] = 16;
        let (before, sum) = bytes.split_last_chunk_mut::<4>().unwrap();
        *sum = crc32(before).to_le_bytes();
        assert_eq!(JointState::restore(&bytes, &run.joint, &run.store), Err(RestoreError::Impossible));
    }

    proptest! {
        /// Whatever it is asked for, the correction stays between what it was asked for.
        #[test]
        fn the_correction_never_leaves_the_range_of_its_goals(
            goals in prop::collection::vec((-(MOST_FINE as i32)..MOST_FINE as i32, 0u32..26, 1u8..40), 1..60),
            rate in 1i32..300_000_000, acceleration in 1u32..29,
        ) {
            let mut limited = Limited::new(rate, (1 << acceleration) | 1);
            let (mut least, mut most) = (0, 0);
            for (goal, smaller, ticks) in goals {
                let goal = goal >> smaller;
                (least, most) = (least.min(goal), most.max(goal));
                for _ in 0..ticks {
                    let found = limited.go(goal);
                    prop_assert!((least..=most).contains(&found), "{found} outside {least} to {most}");
                }
            }
        }

        /// Whatever comes in, the correction moves within its limits and stays within the table's.
        #[test]
        fn any_input_keeps_the_limits(
            inputs in prop::collection::vec(
                (any::<bool>(), -2e-3f64..2e-3, -0.1f64..0.1, any::<f32>(), 0u16..3), 1..200,
            ),
            policy in 0u8..3, adjusted in any::<bool>(), mean_counts in any::<i32>(), half_width_counts in any::<i32>(),
        ) {
            let policies = [Overrun::SkipAndCount, Overrun::HoldLast, Overrun::FadeOut { ticks: 7 }];
            let mut run = Loop::new(policies[policy as usize]);
            for (present, target, moved, torque, missed) in inputs {
                run.generator = run.generator.offset_rad(moved as f32);
                let sample = present.then_some(run.generator);
                let (adjustment, most) = if adjusted {
                    (Adjustment::new(mean_counts, half_width_counts), 0.13)
                } else {
                    (Adjustment::default(), 0.03)
                };
                let missed_ticks = missed / 2;
                let input = Input {
                    generator: sample, torque_n_m: torque, missed_ticks, adjustment, ..run.input(target)
                };
                let out = run.tick(&input);
                prop_assert!(out.correction_rad.abs() <= most);
                prop_assert!(out.uncertainty_rad.is_finite() && out.transmission_error_rad.is_finite());
            }
        }
    }
}
