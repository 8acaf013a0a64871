//! Angles that turn forever: integer turns and a 32-bit fraction of a turn.
//!
//! One count is 2⁻³² turn = 1.463e-9 rad = 3.0e-4″. Sums and differences of angles are integer and exact, so nothing
//! drifts however long a joint turns. The two angles of a drive are two types: subtracting a [`GeneratorAngle`] from an
//! [`OutputAngle`] does not compile. Positive is counter-clockwise for both, seen from the same side.
//!
//! Turns wrap at ±2³¹, after some 680 years at 6000 turns a minute.
//!
//! On the path of a control step only `offset_rad` and `minus_rad` touch floating point, with one conversion each;
//! `from_rad` and `to_rad` are for the host and for start-up.

use core::f64::consts::TAU;

/// Radians in one count: 2π·2⁻³².
pub const RAD_PER_COUNT: f32 = (TAU / 4_294_967_296.0) as f32;
/// Counts in one radian: 2³²/2π.
pub const COUNTS_PER_RAD: f32 = (4_294_967_296.0 / TAU) as f32;

/// A small angle in counts, rounded to nearest, clamped to ±half a turn; NaN gives 0.
pub fn counts_from_rad(small_rad: f32) -> i32 {
    let counts = small_rad * COUNTS_PER_RAD;
    // `as` truncates towards zero and saturates; half a count makes it round to nearest.
    (counts + if counts < 0.0 { -0.5 } else { 0.5 }) as i32
}

macro_rules! angle {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[must_use]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub struct $name {
            counts: i64,
        }

        impl $name {
            /// Zero turns.
            pub const ZERO: Self = Self { counts: 0 };

            /// `turns` whole turns and `fraction`·2⁻³² of a turn: −¼ turn is `new(-1, 3 << 30)`.
            pub const fn new(turns: i32, fraction: u32) -> Self {
                Self { counts: ((turns as i64) << 32) | fraction as i64 }
            }

            /// From counts of 2⁻³² turn.
            pub const fn from_counts(counts: i64) -> Self {
                Self { counts }
            }

            /// In counts of 2⁻³² turn.
            #[must_use]
            pub const fn counts(self) -> i64 {
                self.counts
            }

            /// Whole turns, rounded down.
            #[must_use]
            pub const fn turns(self) -> i32 {
                (self.counts >> 32) as i32
            }

            /// Fraction of a turn beyond the whole turns, in 2⁻³² turn.
            #[must_use]
            pub const fn fraction(self) -> u32 {
                self.counts as u32
            }

            /// From radians, to the nearest count; `None` if not finite or beyond ±2³¹ turns.
            ///
            /// For the host and for start-up: double precision is emulated on a Cortex-M4F. Above 1e6 rad the
            /// double itself is coarser than a count.
            #[must_use]
            pub fn from_rad(rad: f64) -> Option<Self> {
                let counts = rad / TAU * 4_294_967_296.0;
                if counts.is_nan() || counts.abs() >= 9.223_372e18 {
                    return None;
                }
                let half = if counts < 0.0 { -0.5 } else { 0.5 };
                Some(Self { counts: (counts + half) as i64 })
            }

            /// As [`Self::from_rad`], of an angle with its unit; a number is in radians.
            #[must_use]
            pub fn of(angle: impl Into<f64>) -> Option<Self> {
                Self::from_rad(angle.into())
            }

            /// In radians; exact to 2⁻⁵³ of the angle. For the host and for start-up.
            #[must_use]
            pub fn to_rad(self) -> f64 {
                self.counts as f64 * (TAU / 4_294_967_296.0)
            }

            /// This angle plus a count of 2⁻³² turns; wraps.
            pub const fn offset_counts(self, counts: i64) -> Self {
                Self { counts: self.counts.wrapping_add(counts) }
            }

            /// This angle plus a small one in radians, to the nearest count (or the nearest `f32`, if that is
            /// coarser); clamped to ±π. NaN adds nothing.
            pub fn offset_rad(self, small_rad: f32) -> Self {
                self.offset_counts(counts_from_rad(small_rad) as i64)
            }

            /// `self − other` in counts; wraps with the turns.
            #[must_use]
            pub const fn minus_counts(self, other: Self) -> i64 {
                self.counts.wrapping_sub(other.counts)
            }

            /// `self − other` in counts, clamped to ±half a turn.
            #[must_use]
            pub const fn minus_small_counts(self, other: Self) -> i32 {
                let counts = self.minus_counts(other);
                let (high, low) = ((counts >> 32) as i32, counts as i32);
                // All ones or all zeros above the sign of the lower half: it fits. Else the limit on its side.
                if high == low >> 31 { low } else { (high >> 31) ^ i32::MAX }
            }

            /// `self − other` in radians, clamped to ±π; relative error at most 1.2e-7.
            #[must_use]
            pub fn minus_rad(self, other: Self) -> f32 {
                self.minus_small_counts(other) as f32 * RAD_PER_COUNT
            }
        }
    };
}

angle! {
    /// Angle ψ of the wave generator relative to the fixed member of the drive.
    GeneratorAngle
}
angle! {
    /// Angle δ of the output member relative to the fixed member of the drive.
    OutputAngle
}

impl OutputAngle {
    /// `self − other` in counts if that is within half a turn, else a quarter turn with its sign: half the instructions
    /// of clamping it, for what only asks whether it is far.
    #[must_use]
    #[inline(always)]
    pub(crate) const fn minus_near_counts(self, other: Self) -> i32 {
        let counts = self.minus_counts(other);
        let (high, low) = ((counts >> 32) as i32, counts as i32);
        if high == low >> 31 { low } else { (high >> 31) ^ (i32::MAX >> 1) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_quarter_turn_back_is_minus_one_turn_and_three_quarters() {
        let angle = GeneratorAngle::from_rad(-TAU / 4.0).unwrap();
        assert_eq!(angle, GeneratorAngle::new(-1, 3 << 30));
        assert_eq!((angle.turns(), angle.fraction()), (-1, 3 << 30));
        assert_eq!(angle.to_rad(), -TAU / 4.0);
    }

    #[test]
    fn a_million_steps_and_back_end_where_they_began() {
        let start = GeneratorAngle::new(-3, 12_345);
        let mut angle = start;
        for _ in 0..1_000_000 {
            angle = angle.offset_counts(1_234_567_891);
        }
        assert_eq!(angle.minus_counts(start), 1_234_567_891_000_000);
        for _ in 0..1_000_000 {
            angle = angle.offset_counts(-1_234_567_891);
        }
        assert_eq!(angle, start);
    }

    #[test]
    fn turns_wrap_and_differences_survive_it() {
        let last = OutputAngle::new(i32::MAX, u32::MAX);
        let next = last.offset_counts(1);
        assert_eq!(next, OutputAngle::new(i32::MIN, 0));
        assert_eq!(next.minus_counts(last), 1);
    }

    #[test]
    fn bad_numbers_have_no_angle_and_add_nothing() {
        for bad in [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e11, -1e11] {
            assert_eq!(OutputAngle::from_rad(bad), None, "{bad}");
        }
        assert_eq!(OutputAngle::ZERO.offset_rad(f32::NAN), OutputAngle::ZERO);
        assert_eq!(OutputAngle::ZERO.offset_rad(f32::INFINITY).counts(), i32::MAX as i64);
        assert_eq!(OutputAngle::new(7, 0).minus_rad(OutputAngle::ZERO), core::f32::consts::PI);
        assert_eq!(OutputAngle::ZERO.minus_rad(OutputAngle::new(7, 0)), -core::f32::consts::PI);
    }

    #[test]
    fn what_is_far_is_a_quarter_turn_on_its_side() {
        let minus = |counts: i64| OutputAngle::from_counts(counts).minus_near_counts(OutputAngle::ZERO);
        let (most, least) = (i32::MAX as i64, i32::MIN as i64);
        for near in [0, 5, -5, most, least] {
            assert_eq!(minus(near), near as i32);
        }
        for far in [most + 2, 1 << 40, i64::MAX] {
            assert_eq!((minus(far), minus(-far)), ((1 << 30) - 1, -(1 << 30)));
        }
        assert_eq!(minus(least - 1), -(1 << 30));
    }

    proptest! {
        #[test]
        fn radians_round_trip_to_half_a_count(rad in -1000.0f64..1000.0) {
            let angle = GeneratorAngle::from_rad(rad).unwrap();
            prop_assert!((angle.to_rad() - rad).abs() <= 0.51 * TAU / 4_294_967_296.0);
        }

        #[test]
        fn small_offsets_come_back(start in any::<i64>(), small in -0.02f32..0.02) {
            let angle = OutputAngle::from_counts(start);
            let back = angle.offset_rad(small).minus_rad(angle);
            // Half a count, and the rounding of the `f32` itself.
            let allowed = 0.74e-9 + 1.2e-7 * small.abs();
            prop_assert!((back - small).abs() <= allowed, "{} {}", back, small);
        }
    }
}
