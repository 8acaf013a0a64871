//! From the register of an encoder to an angle and back.
//!
//! A register counts a fixed number of steps in a turn and begins anew somewhere: after a turn (a single-turn encoder),
//! or after 2ᴺ counts (a timer that counts edges, a multi-turn encoder). An [`Encoder`] says which; an [`EncoderState`]
//! follows it. What is kept is the whole number of counts since the zero, and the angle is made anew of that each time,
//! to the nearest 2⁻³² turn: nothing drifts however long a joint turns, also where the counts in a turn are no power of
//! two, and a count more never is an angle less.
//!
//! Settings and state are kept as words under a sum ([`whole`](../whole.rs)): where one word was hit by an upset it is
//! mended in the next call; what is lost gives no angle.

use crate::whole::{Sealed, high, low, sum_of};
use core::fmt;

/// Where a register begins anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EncoderWrap {
    /// After a turn: readings are 0 to the counts in a turn less one.
    Turn,
    /// After 2ᴺ counts: readings have N bits, 1 to 64. A signed register is taken by its bits.
    Bits(u8),
}

/// How an encoder counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct EncoderSettings {
    /// Counts in a turn, 2 to 2³¹: four times the lines of an incremental one.
    pub counts_per_turn: u32,
    /// Where the register begins anew.
    pub wrap: EncoderWrap,
    /// Whether it counts up where the angle falls.
    pub reversed: bool,
    /// Reading at the angle 0, counts: -2⁶² to 2⁶².
    pub zero_counts: i64,
}

/// Which setting cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderError {
    /// Name of the setting.
    pub name: &'static str,
    /// Value found.
    pub found: i64,
}

impl fmt::Display for EncoderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}: not within its range", self.name, self.found)
    }
}

impl core::error::Error for EncoderError {}

/// An encoder: all that does not change while it turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Encoder {
    /// Counts in a turn; bits of the register (0: a turn) and in the byte above whether it is reversed; the zero, low
    /// and high word.
    settings: Sealed<[u32; 4]>,
}

/// Where an encoder is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderState {
    /// The last reading, and the counts since the zero, as the register counts: low and high words.
    at: Sealed<[u32; 4]>,
}

impl EncoderSettings {
    const fn words(&self) -> [u32; 4] {
        let bits = match self.wrap {
            EncoderWrap::Turn => 0,
            EncoderWrap::Bits(bits) => bits as u32,
        };
        [self.counts_per_turn, bits | (self.reversed as u32) << 8, low(self.zero_counts), high(self.zero_counts)]
    }

    const fn of([counts_per_turn, marks, low, high]: [u32; 4]) -> Self {
        let bits = marks as u8;
        let wrap = if bits == 0 { EncoderWrap::Turn } else { EncoderWrap::Bits(bits) };
        Self { counts_per_turn, wrap, reversed: marks >> 8 != 0, zero_counts: (high as i64) << 32 | low as i64 }
    }
}

/// The last reading, and the counts since the zero.
#[derive(Clone, Copy)]
struct At {
    reading: u64,
    since_zero: i64,
}

impl EncoderState {
    /// Nowhere: it is not whole.
    pub const NOWHERE: Self = Self { at: Sealed::of([0; 4], 0) };

    fn of(At { reading, since_zero }: At) -> Self {
        Self { at: Sealed::new([low(reading as i64), high(reading as i64), low(since_zero), high(since_zero)]) }
    }

    fn open(&self) -> Option<At> {
        let [low, high, since_low, since_high] = self.at.open()?;
        let long = |low: u32, high: u32| (high as u64) << 32 | low as u64;
        Some(At { reading: long(low, high), since_zero: long(since_low, since_high) as i64 })
    }

    /// Whether it is lost to an upset that cannot be mended: [`Encoder::start`] it again.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.at.open().is_none()
    }
}

/// Largest zero, counts: what is left of 64 bits is for the way from it.
const MOST_ZERO: i64 = 1 << 62;

impl Encoder {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EncoderError`] names the first that is out of its range.
    pub const fn new(settings: EncoderSettings) -> Result<Self, EncoderError> {
        let EncoderSettings { counts_per_turn, wrap, zero_counts, .. } = settings;
        if counts_per_turn < 2 || counts_per_turn > 1 << 31 {
            return Err(EncoderError { name: "counts_per_turn", found: counts_per_turn as i64 });
        }
        if let EncoderWrap::Bits(bits) = wrap
            && (bits < 1 || bits > 64)
        {
            return Err(EncoderError { name: "bits", found: bits as i64 });
        }
        if zero_counts < -MOST_ZERO || zero_counts > MOST_ZERO {
            return Err(EncoderError { name: "zero_counts", found: zero_counts });
        }
        let words = settings.words();
        Ok(Self { settings: Sealed::of(words, sum_of(&words)) })
    }

    fn settings(&self) -> Option<EncoderSettings> {
        self.settings.open().map(EncoderSettings::of)
    }

    /// Makes the settings whole, where they lie in memory and an upset hit a word of them; false if they are lost, and
    /// the encoder has to be made anew. For a slow rate group: until then each call mends a copy.
    pub fn mend(&mut self) -> bool {
        self.settings.mend()
    }

    /// Whether the settings are lost to an upset that cannot be mended.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.settings.open().is_none()
    }

    /// Where it is by its first reading: of all angles with this reading the one nearest to `near_counts` (2⁻³² turn),
    /// which is 0 or what was known before a reset. `None` if the register cannot read that, or the settings are lost.
    #[must_use]
    pub fn start(&self, reading: u64, near_counts: i64) -> Option<EncoderState> {
        let settings = self.settings()?;
        let near = settings.since_zero(near_counts);
        let there = settings.register(near.wrapping_add(settings.zero_counts));
        let way = settings.way(there, reading)?;
        Some(EncoderState::of(At { reading, since_zero: near.wrapping_add(way) }))
    }

    /// Takes a reading: less than half of what the register counts since the one before, or half of it backward. False,
    /// and nothing has changed, if the register cannot read that, or settings or state are lost: give the tick no
    /// sample then.
    ///
    /// One wrong reading, half of the register away, moves it by all that the register counts, for good: the encoder of
    /// a joint's generator is read by [`Joint::read`](crate::Joint::read), which sees to that.
    #[must_use]
    pub fn read(&self, state: &mut EncoderState, reading: u64) -> bool {
        let read = || {
            let (settings, at) = (self.settings()?, state.open()?);
            let way = settings.way(at.reading, reading)?;
            Some(EncoderState::of(At { reading, since_zero: at.since_zero.wrapping_add(way) }))
        };
        let next = read();
        *state = next.unwrap_or(*state);
        next.is_some()
    }

    /// As [`Self::read`] while a reading is no further from the one before than a tick allows. Else from the angle that
    /// was believed last, that number of ticks after three in a row were, while the generator cannot have made half of
    /// what the register counts since, nor in two ticks more: by those that angle may be off where it was a wrong one
    /// within the largest move. The angle; `None` as above, and where three moves of a tick are half of what the
    /// register counts; and the state is lost where nothing says which turn it is.
    pub(crate) fn read_near(
        &self,
        state: &mut EncoderState,
        reading: u64,
        believed: Option<(i64, u32)>,
        largest_move: i32,
    ) -> Option<i64> {
        let settings = self.settings().filter(|settings| settings.half_is_more_than(largest_move, 3))?;
        let at = state.open()?;
        let way = settings.way(at.reading, reading)?;
        let since_zero = match believed {
            Some((angle, ticks)) if way.unsigned_abs() > settings.counts_of(largest_move) => {
                if !settings.half_is_more_than(largest_move, ticks.saturating_add(2)) {
                    *state = EncoderState::NOWHERE;
                    return None;
                }
                let from = settings.since_zero(angle);
                let way = settings.way(settings.register(from.wrapping_add(settings.zero_counts)), reading)?;
                from.wrapping_add(way)
            }
            _ => at.since_zero.wrapping_add(way),
        };
        *state = EncoderState::of(At { reading, since_zero });
        Some(settings.angle(since_zero))
    }

    /// The angle, 2⁻³² turn, to the nearest: for [`GeneratorAngle::from_counts`](crate::GeneratorAngle::from_counts) or
    /// [`OutputAngle::from_counts`](crate::OutputAngle::from_counts). `None` if settings or state are lost.
    #[must_use]
    pub fn angle(&self, state: &EncoderState) -> Option<i64> {
        let (settings, at) = (self.settings()?, state.open()?);
        Some(settings.angle(at.since_zero))
    }

    /// Register value at an angle, to the nearest count: for a drive that is commanded in counts of its
    /// encoder. 0 if the settings are lost ([`Self::mend`]).
    #[must_use]
    pub fn reading(&self, angle_counts: i64) -> u64 {
        let there = |settings: EncoderSettings| {
            settings.register(settings.since_zero(angle_counts).wrapping_add(settings.zero_counts))
        };
        self.settings().map_or(0, there)
    }
}

impl EncoderSettings {
    /// Angle of a number of counts since the zero, 2⁻³² turn, to the nearest.
    fn angle(&self, since_zero: i64) -> i64 {
        let per_turn = self.counts_per_turn;
        let counts = self.signed(since_zero);
        let turns = counts.checked_div_euclid(per_turn as i64).unwrap_or(0);
        let within = counts.checked_rem_euclid(per_turn as i64).unwrap_or(0) as u64;
        // Below 2³¹ turns in 32 bits: rounding up at the end of a turn carries into the next.
        let fraction = (within << 32).wrapping_add(per_turn as u64 >> 1).checked_div(per_turn as u64).unwrap_or(0);
        (turns << 32).wrapping_add(fraction as i64)
    }

    /// Counts since the zero at an angle, as the register counts.
    fn since_zero(&self, angle_counts: i64) -> i64 {
        let per_turn = self.counts_per_turn;
        let whole = (angle_counts >> 32).wrapping_mul(per_turn as i64);
        let part = (angle_counts as u32 as u64).wrapping_mul(per_turn as u64).wrapping_add(1 << 31) >> 32;
        self.signed(whole.wrapping_add(part as i64))
    }

    const fn signed(&self, counts: i64) -> i64 {
        if self.reversed { counts.wrapping_neg() } else { counts }
    }

    /// Register value at the given total count.
    fn register(&self, counts: i64) -> u64 {
        match self.wrap {
            EncoderWrap::Turn => counts.checked_rem_euclid(self.counts_per_turn as i64).unwrap_or(0) as u64,
            EncoderWrap::Bits(bits) => counts as u64 & mask(bits),
        }
    }

    /// A move, 2⁻³² turn, in counts, rounded up.
    const fn counts_of(&self, largest_move: i32) -> u64 {
        ((largest_move as u64).wrapping_mul(self.counts_per_turn as u64) >> 32).wrapping_add(1)
    }

    /// Whether that number of such moves is less than half of what the register counts.
    const fn half_is_more_than(&self, largest_move: i32, number: u32) -> bool {
        let most = match self.wrap {
            EncoderWrap::Turn => self.counts_per_turn as u64,
            EncoderWrap::Bits(bits) => mask(bits),
        };
        self.counts_of(largest_move).wrapping_mul((number as u64).wrapping_mul(2)) < most
    }

    /// The shorter way from a reading to another; `None` if the register cannot read the other.
    fn way(&self, from: u64, to: u64) -> Option<i64> {
        match self.wrap {
            EncoderWrap::Turn => {
                let turn = self.counts_per_turn as i64;
                let to = i64::try_from(to).ok().filter(|&to| to < turn)?;
                let way = to.wrapping_sub(from as i64);
                let twice = way.wrapping_shl(1);
                Some(if twice >= turn {
                    way.wrapping_sub(turn)
                } else if twice < turn.wrapping_neg() {
                    way.wrapping_add(turn)
                } else {
                    way
                })
            }
            EncoderWrap::Bits(bits) => {
                let above = 64u32.saturating_sub(bits as u32);
                let way = to.wrapping_sub(from).wrapping_shl(above) as i64;
                (to <= mask(bits)).then_some(way.wrapping_shr(above))
            }
        }
    }
}

/// A number with N ones as its lowest bits.
const fn mask(bits: u8) -> u64 {
    u64::MAX.wrapping_shr(64u32.saturating_sub(bits as u32))
}

bits_of!(Encoder { settings });
bits_of!(EncoderState { at });

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SETTINGS: EncoderSettings =
        EncoderSettings { counts_per_turn: 20_000, wrap: EncoderWrap::Bits(16), reversed: false, zero_counts: 0 };

    fn made(settings: EncoderSettings) -> Encoder {
        Encoder::new(settings).unwrap()
    }

    #[test]
    fn a_quarter_turn_is_a_quarter_turn_either_way() {
        for (reversed, zero_counts, reading, quarters) in
            [(false, 0, 5000, 1), (true, 0, 5000, -1), (false, 5000, 0, -1), (true, 5000, 0, 1), (false, -5000, 0, 1)]
        {
            let encoder = made(EncoderSettings { reversed, zero_counts, wrap: EncoderWrap::Turn, ..SETTINGS });
            let state = encoder.start(reading, 0).unwrap();
            assert_eq!(encoder.angle(&state).unwrap(), quarters << 30, "{reversed} {zero_counts}");
            assert_eq!(encoder.reading(quarters << 30), reading);
        }
    }

    #[test]
    fn a_timer_of_sixteen_bits_turns_for_ever() {
        // 20 000 counts in a turn do not go into 2^16: no turn begins where the register does.
        let encoder = made(SETTINGS);
        let mut state = encoder.start(0, 0).unwrap();
        let (mut counted, mut last) = (0i64, 0);
        for step in 0..3_000_000i64 {
            counted += 7919 + step % 13;
            assert!(encoder.read(&mut state, counted as u64 & 0xffff));
            let angle = encoder.angle(&state).unwrap();
            assert!(angle > last);
            last = angle;
        }
        // More than a million turns, and not a count is missing.
        let exact = (i128::from(counted) << 33) / 20_000;
        assert_eq!(i128::from(last), (exact + 1) >> 1);
        for _ in 0..3_000_000 {
            counted -= 7919;
            assert!(encoder.read(&mut state, counted as u64 & 0xffff));
        }
        assert_eq!(i128::from(encoder.angle(&state).unwrap()), (((i128::from(counted) << 33) / 20_000) + 1) >> 1);
    }

    #[test]
    fn after_a_reset_it_is_where_it_is_known_to_be() {
        for wrap in [EncoderWrap::Turn, EncoderWrap::Bits(16)] {
            let encoder = made(EncoderSettings { wrap, zero_counts: 777, ..SETTINGS });
            let near = (41 << 32) + 12_345;
            // Nearly a third of a turn on either side.
            for moved in [-6_000, -1, 0, 1, 6_000] {
                let there = near + (moved << 32) / 20_000;
                let state = encoder.start(encoder.reading(there), near).unwrap();
                assert!((encoder.angle(&state).unwrap() - there).abs() <= (1 << 31) / 20_000 + 1, "{wrap:?} {moved}");
            }
            assert!(encoder.angle(&encoder.start(0, 0).unwrap()).unwrap().abs() < 8 << 32);
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let named = |settings| Encoder::new(settings).unwrap_err().name;
        assert_eq!(named(EncoderSettings { counts_per_turn: 1, ..SETTINGS }), "counts_per_turn");
        assert_eq!(named(EncoderSettings { counts_per_turn: (1 << 31) + 1, ..SETTINGS }), "counts_per_turn");
        assert_eq!(named(EncoderSettings { wrap: EncoderWrap::Bits(0), ..SETTINGS }), "bits");
        assert_eq!(named(EncoderSettings { wrap: EncoderWrap::Bits(65), ..SETTINGS }), "bits");
        assert_eq!(named(EncoderSettings { zero_counts: i64::MIN, ..SETTINGS }), "zero_counts");
        let (bits, turn) = (made(SETTINGS), made(EncoderSettings { wrap: EncoderWrap::Turn, ..SETTINGS }));
        assert_eq!((bits.start(1 << 16, 0), turn.start(20_000, 0), turn.start(u64::MAX, 0)), (None, None, None));
        let mut state = turn.start(19_999, 0).unwrap();
        let before = state;
        assert!(!turn.read(&mut state, 20_000));
        assert_eq!(state, before);
        // Half of what it counts is backward, as the shorter way is not known.
        assert!(turn.read(&mut state, 9_999));
        assert_eq!(turn.angle(&state).unwrap() - turn.angle(&before).unwrap(), -1 << 31);
    }

    proptest! {
        /// Every count comes back from its angle, wherever it is.
        #[test]
        fn counts_come_back(
            per_turn in 2u32..=1 << 31, counts in -(1i64 << 60)..1 << 60, bits in 32u8..=64, reversed in any::<bool>(),
        ) {
            let counts = counts.clamp(-i64::from(per_turn) << 30, i64::from(per_turn) << 30);
            let wrap = EncoderWrap::Bits(bits);
            let encoder = made(EncoderSettings { counts_per_turn: per_turn, wrap, reversed, zero_counts: 0 });
            let settings = encoder.settings().unwrap();
            let at = At { reading: settings.register(counts), since_zero: counts };
            let state = EncoderState::of(at);
            let angle = encoder.angle(&state).unwrap();
            prop_assert_eq!(settings.since_zero(angle), counts);
            prop_assert_eq!(encoder.reading(angle), at.reading);
            let sign = if reversed { -1 } else { 1 };
            let exact = (i128::from(sign * counts) << 32) as f64 / f64::from(per_turn);
            prop_assert!((angle as f64 - exact).abs() <= 0.5 + 1e-15 * exact.abs());
            // A count more is more.
            let next = EncoderState::of(At { since_zero: counts + sign, ..at });
            prop_assert!(encoder.angle(&next).unwrap() > angle);
            prop_assert_eq!(encoder.start(at.reading, angle), Some(state));
        }
    }
}
