//! The play (backlash) operator, as an interval while its position is not known.
//!
//! With the nominal output `x`, and centre `c` and half-width `h ≥ 0` of the play there and under the load, the output
//! follows `p ← clamp(p, x + c − h, x + c + h)`: it stands, held by the drag, until a flank takes it along, whether the
//! flank comes by motion or by a load that goes. Its error is `e = p − x`; after steady motion forward the output lags,
//! `e₊ = c − h`, backward `e₋ = c + h`.
//!
//! After a reset nobody knows on which side of its play the drive rests. The state therefore is a lower and an upper
//! bound of the offset `e − c`, both moved by the same operator. Each move and each reversal can only bring them
//! closer; after one move through the full play they are equal, and from then on they stay equal.
//!
//! Everything is in integer counts of 2⁻³² output turn: the result depends on the turning points only, not on how
//! many steps a motion is cut into, and no rounding builds up.

use crate::angle::{OutputAngle, RAD_PER_COUNT};
use crate::crc::{seal, unseal};
use crate::whole::{high, low};

/// A direction of motion of the *output*.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// The output angle grows.
    Forward,
    /// The output angle shrinks.
    Backward,
}

impl Direction {
    /// +1 forward, −1 backward.
    #[must_use]
    pub const fn sign(self) -> f32 {
        match self {
            Self::Forward => 1.0,
            Self::Backward => -1.0,
        }
    }
}

/// Largest half-width of a table in counts, 0.05 rad.
pub const MAX_HALF_COUNTS: i32 = 34_178_720;
/// Most that may be added to the mean or the half-width of a table, counts, 0.049 rad.
pub(crate) const MAX_ADDED_COUNTS: i32 = (1 << 25) - 1;
/// Largest half-width of a play in counts, 0.2 rad: far above any table with what may be added to it, far below
/// overflow.
const MAX_PLAY_COUNTS: i32 = 1 << 27;

/// Largest error that any table can give, with its rounding and the largest adjustment of mean and half-width, counts.
pub(crate) const MOST_ERROR_COUNTS: u32 =
    MAX_HALF_COUNTS as u32 + (MAX_HALF_COUNTS as u32 >> 8) + 2 * MAX_ADDED_COUNTS as u32;

/// Largest error that is kept, counts, while nothing was known of the table.
const MOST_KEPT_COUNTS: u32 = MOST_ERROR_COUNTS + MAX_PLAY_COUNTS as u32;

/// Where the drive rests inside its play: all that must survive a reset.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlayState {
    /// Nominal output at the last update.
    nominal: OutputAngle,
    /// Estimated output less nominal at the last update, in counts.
    error: i32,
    /// Bounds of `e − c` in counts.
    lower: i32,
    upper: i32,
    /// Half-width at the last update, in counts; −1 before the first.
    half: i32,
}

impl Default for PlayState {
    fn default() -> Self {
        Self::unknown()
    }
}

impl PlayState {
    /// Bytes of a saved state.
    pub const SAVED_BYTES: usize = 28;

    /// After a reset: anywhere inside the play.
    pub const fn unknown() -> Self {
        Self { nominal: OutputAngle::ZERO, error: 0, lower: i32::MIN, upper: i32::MAX, half: -1 }
    }

    /// Known to have last moved in `direction` through the full play.
    pub const fn after_motion(direction: Direction) -> Self {
        let side = match direction {
            Direction::Forward => i32::MIN,
            Direction::Backward => i32::MAX,
        };
        Self { nominal: OutputAngle::ZERO, error: 0, lower: side, upper: side, half: -1 }
    }

    /// The nominal output of the last update; `None` before the first.
    #[must_use]
    pub const fn nominal(&self) -> Option<OutputAngle> {
        if self.half < 0 { None } else { Some(self.nominal) }
    }

    /// Whether both bounds have met.
    #[must_use]
    pub const fn is_known(&self) -> bool {
        self.lower == self.upper
    }

    /// Estimate of the offset from the centre, `e − c`, in radians: the middle of the interval, 0 before the first
    /// update.
    #[must_use]
    pub fn offset_rad(&self) -> f32 {
        if self.half < 0 { 0.0 } else { self.offset_counts() as f32 * RAD_PER_COUNT }
    }

    /// The same in counts, after the first update.
    #[must_use]
    pub const fn offset_counts(&self) -> i32 {
        self.lower.wrapping_add(self.upper) >> 1
    }

    /// Half the width of the interval in radians: the estimate is wrong by no more.
    #[must_use]
    pub fn uncertainty_rad(&self) -> f32 {
        self.uncertainty_counts() as f32 * RAD_PER_COUNT
    }

    /// The same in counts.
    pub(crate) const fn uncertainty_counts(&self) -> i32 {
        let width = self.upper.saturating_sub(self.lower);
        (width >> 1).wrapping_add(width & 1)
    }

    /// Estimated actual output at the last update; `None` before the first.
    #[must_use]
    pub const fn output(&self) -> Option<OutputAngle> {
        if self.half < 0 { None } else { Some(self.output_or_zero()) }
    }

    /// The same; 0 before the first update.
    pub(crate) const fn output_or_zero(&self) -> OutputAngle {
        self.nominal.offset_counts(self.error as i64)
    }

    /// The nominal output of the last update; 0 before the first.
    pub(crate) const fn nominal_or_zero(&self) -> OutputAngle {
        self.nominal
    }

    /// The error at the last update, counts.
    pub(crate) const fn error_counts(&self) -> i32 {
        self.error
    }

    /// Nominal output; error, bounds and half-width: all of it.
    #[inline(always)]
    pub(crate) const fn parts(&self) -> (i64, [i32; 4]) {
        (self.nominal.counts(), [self.error, self.lower, self.upper, self.half])
    }

    /// From its parts, if an update can have left them.
    pub(crate) fn of(nominal: i64, [error, lower, upper, half]: [i32; 4]) -> Option<Self> {
        let started = (0..=MAX_PLAY_COUNTS).contains(&half) && lower >= half.wrapping_neg() && upper <= half;
        let fresh = half == -1 && (lower == i32::MIN || lower == i32::MAX);
        let possible = lower <= upper && error.unsigned_abs() <= MOST_KEPT_COUNTS;
        let state = Self { nominal: OutputAngle::from_counts(nominal), error, lower, upper, half };
        (possible && (started || fresh)).then_some(state)
    }

    /// Whether the output rests on the forward flank of its play, and whether on the backward one, once the generator
    /// has moved on to this nominal output: as far as that is known.
    pub(crate) const fn flanks_at(mut self, nominal: OutputAngle) -> [bool; 2] {
        let _ = self.follow(nominal, 0, 0, false);
        let has_flanks = self.half > 0;
        [has_flanks & (self.upper == self.half.wrapping_neg()), has_flanks & (self.lower == self.half)]
    }

    /// Whether there was an update.
    pub(crate) const fn is_started(&self) -> bool {
        self.half >= 0
    }

    /// Moves the play to `nominal`, with the centre and half-width there in counts; the error `p − x`, and the bounds
    /// of the offset as they would be if no flank had taken the output along ([`Self::take_back`]).
    ///
    /// Without either (`sane` is false: they could not be computed) it follows the motion with the centre and
    /// half-width of the last update; before the first with a half-width that is wider than any. Masks instead of
    /// choices: the same work for all.
    #[inline(always)]
    pub(crate) const fn follow(&mut self, nominal: OutputAngle, centre: i32, half: i32, sane: bool) -> (i32, [i32; 2]) {
        let mask = (sane as i32).wrapping_neg();
        let started = !(self.half >> 31);
        let last = if self.half < 0 { MAX_PLAY_COUNTS } else { self.half };
        let half = last ^ (last ^ half) & mask;
        let half = if half as u32 > MAX_PLAY_COUNTS as u32 { MAX_PLAY_COUNTS } else { half };
        let last = self.error.wrapping_sub(self.offset_counts()) & started;
        let centre = last ^ (last ^ centre) & mask;
        // How far the middle of the play went, while the output stayed.
        let moved = nominal.minus_near_counts(self.nominal).saturating_add(centre.wrapping_sub(last)) & started;
        let free = [self.lower.saturating_sub(moved), self.upper.saturating_sub(moved)];
        let [lower, upper] = free;
        self.lower = clamped(lower, half);
        self.upper = clamped(upper, half);
        self.nominal = nominal;
        self.half = half;
        self.error = centre.wrapping_add(self.offset_counts());
        (self.error, free)
    }

    /// As [`Self::follow`]: the error.
    #[inline(always)]
    #[doc(hidden)]
    pub const fn update(&mut self, nominal: OutputAngle, centre: i32, half: i32, sane: bool) -> i32 {
        let (error, _) = self.follow(nominal, centre, half, sane);
        error
    }

    /// The last move was none: the output is where it was before it, which the next move goes on from. `free` is what
    /// [`Self::follow`] gave; nothing is done where `mask` is 0 and not all ones.
    #[inline(always)]
    pub(crate) const fn take_back(&mut self, free: [i32; 2], mask: i32) {
        let ([lower, upper], offset) = (free, self.offset_counts());
        self.lower ^= (self.lower ^ lower) & mask;
        self.upper ^= (self.upper ^ upper) & mask;
        // The centre stays.
        self.error = self.error.wrapping_add(self.offset_counts().wrapping_sub(offset));
    }

    /// The estimate of the centre changed, not the position of the drive in its play: the estimated output moves as
    /// far.
    #[inline(always)]
    #[doc(hidden)]
    pub const fn shift(&mut self, counts: i32) {
        self.error = self.error.wrapping_add(counts & !(self.half >> 31));
    }

    /// The state as bytes, with a CRC-32, for storage across a reset.
    #[must_use]
    pub fn save(&self) -> [u8; Self::SAVED_BYTES] {
        let mut bytes = [0; Self::SAVED_BYTES];
        let (nominal, parts) = self.parts();
        seal(&mut bytes, [low(nominal), high(nominal)].into_iter().chain(parts.map(|part| part as u32)));
        bytes
    }

    /// A state from [`Self::save`]; `None` if the bytes are damaged.
    ///
    /// Restore only if the joint cannot have moved meanwhile, else start from [`Self::unknown`].
    #[must_use]
    pub fn restore(bytes: &[u8; Self::SAVED_BYTES]) -> Option<Self> {
        let mut next = unseal(bytes)?;
        let nominal = next() as i64 | (next() as i64) << 32;
        Self::of(nominal, [next(), next(), next(), next()].map(|part| part as i32))
    }
}

/// `offset` within ±`half`, half ≥ 0.
const fn clamped(offset: i32, half: i32) -> i32 {
    let least = half.wrapping_neg();
    let above = if offset < least { least } else { offset };
    if above > half { half } else { above }
}

bits_of!(PlayState { nominal, error, lower, upper, half });

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HALF: i32 = 100_000;

    fn run(state: &mut PlayState, from: i64, path: &[i32]) -> i64 {
        let mut x = from;
        for &step in path {
            x += step as i64;
            let _ = state.update(OutputAngle::from_counts(x), 0, HALF, true);
        }
        x
    }

    fn known() -> PlayState {
        let mut state = PlayState::after_motion(Direction::Forward);
        let _ = state.update(OutputAngle::ZERO, 0, HALF, true);
        state
    }

    /// Before the first update nothing is said of a place; after it all is, of a play without width too.
    #[test]
    fn a_state_tells_its_place_from_the_first_update_on() {
        for half in [0, 1, HALF] {
            let mut state = PlayState::after_motion(Direction::Forward);
            assert_eq!((state.nominal(), state.output(), state.offset_rad()), (None, None, 0.0));
            state.shift(7);
            assert_eq!(state, PlayState::after_motion(Direction::Forward), "nothing to be shifted yet");
            let error = state.update(OutputAngle::from_counts(90), 40, half, true);
            assert_eq!(error, 40 - half);
            assert_eq!(state.nominal(), Some(OutputAngle::from_counts(90)));
            assert_eq!(state.output(), Some(OutputAngle::from_counts(90 + 40 - half as i64)));
            assert_eq!(state.offset_rad(), -half as f32 * RAD_PER_COUNT);
            state.shift(7);
            assert_eq!(state.output(), Some(OutputAngle::from_counts(90 + 40 - half as i64 + 7)));
            assert_eq!((state.lower, state.upper), (-half, -half));
        }
    }

    /// Without a sane half-width that of the last update holds, also where it was zero.
    #[test]
    fn a_play_without_width_keeps_none_through_updates_that_are_not_sane() {
        let mut state = known();
        let _ = state.update(OutputAngle::ZERO, 0, 0, true);
        let error = state.update(OutputAngle::from_counts(500), 12, 34, false);
        assert_eq!((error, state.half, state.lower, state.upper), (0, 0, 0, 0));
    }

    /// 0.05 rad and a 256th of it, twice the largest adjustment of 2²⁵ − 1 counts, and a play of 2²⁷: as in
    /// core/c99/flexspline_table.c.
    #[test]
    fn a_state_is_made_of_parts_that_an_update_can_leave_alone() {
        const MOST: i32 = 34_178_720 + 133_510 + 67_108_862 + 134_217_728;
        let of = |error, lower, upper, half| PlayState::of(3, [error, lower, upper, half]);
        for error in [MOST, -MOST] {
            assert!(of(error, -HALF, HALF, HALF).is_some() && of(error + error.signum(), -HALF, HALF, HALF).is_none());
        }
        for side in [i32::MIN, i32::MAX] {
            assert!(of(0, side, i32::MAX, -1).is_some() && of(0, side, i32::MAX, -2).is_none());
        }
        assert!(of(0, 5, i32::MAX, -1).is_none(), "no side");
        assert!(of(0, -HALF - 1, HALF, HALF).is_none() && of(0, -HALF, HALF + 1, HALF).is_none());
        assert!(of(0, 1, 0, HALF).is_none(), "no interval");
    }

    #[test]
    fn an_unknown_state_shrinks_with_motion_and_stays_known() {
        let mut state = PlayState::unknown();
        assert_eq!(state.offset_rad(), 0.0);
        run(&mut state, 0, &[0]);
        assert_eq!((state.lower, state.upper), (-HALF, HALF));
        let x = run(&mut state, 0, &[HALF / 2]);
        assert_eq!((state.lower, state.upper), (-HALF, HALF / 2));
        let x = run(&mut state, x, &[-HALF]);
        assert_eq!((state.lower, state.upper), (0, HALF));
        assert!(!state.is_known());
        let x = run(&mut state, x, &[HALF]);
        assert_eq!((state.lower, state.upper), (-HALF, 0));
        // Reversals inside the gap add no information; a stroke through the whole play does.
        run(&mut state, x, &[-2 * HALF, 17, -5]);
        assert!(state.is_known());
        assert_eq!(state.uncertainty_rad(), 0.0);
    }

    #[test]
    fn hostile_half_widths_stay_in_bounds() {
        for half in [i32::MIN, -1, 0, i32::MAX] {
            let mut state = PlayState::unknown();
            let _ = state.update(OutputAngle::ZERO, 0, half, true);
            let _ = state.update(OutputAngle::from_counts(i64::MIN), 0, half, true);
            assert!((0..=MAX_PLAY_COUNTS).contains(&state.half), "{half}");
            assert!(-state.half <= state.lower && state.lower <= state.upper && state.upper <= state.half);
        }
    }

    #[test]
    fn damaged_saved_states_are_refused() {
        for state in [PlayState::unknown(), known(), PlayState::after_motion(Direction::Backward)] {
            let saved = state.save();
            assert_eq!(PlayState::restore(&saved), Some(state));
            for bit in 0..PlayState::SAVED_BYTES * 8 {
                let mut damaged = saved;
                damaged[bit / 8] ^= 1 << (bit % 8);
                assert_eq!(PlayState::restore(&damaged), None, "bit {bit}");
            }
        }
        let disordered = PlayState { lower: 5, upper: -5, half: 10, nominal: OutputAngle::ZERO, error: 0 };
        assert_eq!(PlayState::restore(&disordered.save()), None);
        for error in [i32::MIN, i32::MAX, 240_000_000] {
            let far = PlayState { lower: -5, error, ..disordered };
            assert_eq!(PlayState::restore(&PlayState { upper: 5, ..far }.save()), None, "{error}");
        }
        for (lower, upper) in [(-11, 5), (5, 11)] {
            let outside = PlayState { lower, upper, ..disordered };
            assert_eq!(PlayState::restore(&outside.save()), None);
        }
    }

    proptest! {
        /// The truth, wherever it started, never leaves the interval; the interval never widens.
        #[test]
        fn the_interval_holds_every_possible_truth(
            start in -HALF..=HALF, path in prop::collection::vec(-3 * HALF..3 * HALF, 1..30),
        ) {
            let mut interval = PlayState::unknown();
            run(&mut interval, 0, &[0]);
            let mut truth = PlayState { lower: start, upper: start, ..interval };
            let (mut x, mut width) = (0, 2 * HALF);
            for step in path {
                run(&mut truth, x, &[step]);
                x = run(&mut interval, x, &[step]);
                prop_assert!(interval.lower <= truth.lower && truth.upper <= interval.upper);
                prop_assert!(interval.upper - interval.lower <= width);
                width = interval.upper - interval.lower;
            }
        }
    }
}
