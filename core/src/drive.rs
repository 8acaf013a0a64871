//! Tooth counts, the signed ratio, and the nominal motion in integers.
//!
//! With `fs` teeth on the flexspline, `cs` on the circular spline and `waves = cs − fs`:
//!
//! | fixed | output | ratio = generator/output | ripple periods in a generator turn |
//! |---|---|---|---|
//! | flexspline | circular spline | `+cs/(cs − fs)` | `fs` |
//! | circular spline | flexspline | `−fs/(cs − fs)` | `cs` |
//!
//! The ratio is Willis' equation with the generator as carrier. The ripple period is one tooth pitch of the *fixed*
//! member: turning the generator by it maps that member onto itself, so for a perfect drive everything but the nominal
//! step of the output repeats.

use crate::angle::{GeneratorAngle, OutputAngle};
use crate::error::DriveError;
use crate::whole::{high, low};

/// The member bolted to the housing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FixedMember {
    /// The flexspline stands, the circular spline is the output and turns with the generator.
    Flexspline,
    /// The circular spline stands, the flexspline is the output and turns against the generator.
    CircularSpline,
}

/// A drive as far as its nominal motion goes: tooth counts and which member is fixed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    flexspline_teeth: u16,
    circular_spline_teeth: u16,
    /// All ones if the circular spline is fixed, else 0.
    reversed: i32,
    /// |1/ratio| and |ratio|.
    to_output: ToothRatio,
    to_generator: ToothRatio,
    /// Tooth pitches of the fixed member in one output turn.
    tooth_rate: Rate,
}

/// Where the periodic parts of a table are read, each as a fraction of its own period in 2⁻³².
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phases {
    /// ψ: the generator relative to the fixed member, one period a generator turn.
    pub generator: u32,
    /// ψ − δ: the generator relative to the output member ("material phase"), `fs/cs` of ψ with the flexspline fixed.
    pub material: u32,
    /// δ: the output relative to the fixed member, one period an output turn.
    pub output: u32,
    /// Position inside one tooth pitch of the fixed member, `teeth·ψ` modulo one turn.
    pub tooth: u32,
}

impl Drive {
    /// That of one tooth and one wave, where there is none yet.
    pub(crate) const SMALLEST: Self = Self {
        flexspline_teeth: 1,
        circular_spline_teeth: 2,
        reversed: 0,
        to_output: ToothRatio::new(1, 2),
        to_generator: ToothRatio::new(2, 1),
        tooth_rate: Rate::new(ToothRatio::new(2, 1), 1, false),
    };

    /// A drive from its tooth counts.
    ///
    /// # Errors
    /// [`DriveError`] unless `1 ≤ flexspline_teeth < circular_spline_teeth ≤ 2·flexspline_teeth`.
    pub const fn new(
        flexspline_teeth: u16,
        circular_spline_teeth: u16,
        fixed: FixedMember,
    ) -> Result<Self, DriveError> {
        let bad = DriveError { flexspline_teeth, circular_spline_teeth };
        let (fs, cs) = (flexspline_teeth, circular_spline_teeth);
        let waves = cs.saturating_sub(fs);
        // The generator turns faster than the output, or a count of it would be several of the output.
        if fs == 0 || waves == 0 || waves > fs {
            return Err(bad);
        }
        let (teeth, ripple_order, reversed) = match fixed {
            FixedMember::Flexspline => (cs, fs, 0),
            FixedMember::CircularSpline => (fs, cs, -1),
        };
        let (to_output, to_generator) = (ToothRatio::new(waves, teeth), ToothRatio::new(teeth, waves));
        Ok(Self {
            flexspline_teeth,
            circular_spline_teeth,
            reversed,
            to_output,
            to_generator,
            tooth_rate: Rate::new(to_generator, ripple_order, reversed < 0),
        })
    }

    /// Teeth of the flexspline.
    #[must_use]
    pub const fn flexspline_teeth(&self) -> u16 {
        self.flexspline_teeth
    }

    /// Teeth of the circular spline.
    #[must_use]
    pub const fn circular_spline_teeth(&self) -> u16 {
        self.circular_spline_teeth
    }

    /// The member that stands still.
    #[must_use]
    pub const fn fixed(&self) -> FixedMember {
        if self.reversed == 0 { FixedMember::Flexspline } else { FixedMember::CircularSpline }
    }

    /// Generator turns in one output turn, signed: +95 for 188/190 teeth with the flexspline fixed.
    #[must_use]
    pub const fn ratio(&self) -> f32 {
        let (teeth, waves) = self.turns_and_waves();
        let magnitude = teeth as f32 / waves as f32;
        if self.reversed == 0 { magnitude } else { -magnitude }
    }

    /// The ratio to double precision, for the host.
    #[must_use]
    pub fn exact_ratio(&self) -> f64 {
        let (teeth, waves) = self.turns_and_waves();
        let magnitude = teeth as f64 / waves as f64;
        if self.reversed == 0 { magnitude } else { -magnitude }
    }

    /// Ripple periods in one generator turn: the teeth of the fixed member.
    #[must_use]
    pub const fn ripple_order(&self) -> u16 {
        if self.reversed == 0 { self.flexspline_teeth } else { self.circular_spline_teeth }
    }

    /// |ratio| as teeth over waves.
    const fn turns_and_waves(&self) -> (u16, u16) {
        let teeth = if self.reversed == 0 { self.circular_spline_teeth } else { self.flexspline_teeth };
        (teeth, self.circular_spline_teeth.wrapping_sub(self.flexspline_teeth))
    }

    const fn with_sign(&self, counts: i64) -> i64 {
        // Without a branch.
        let mask = self.reversed as i64;
        (counts ^ mask).wrapping_sub(mask)
    }

    /// Teeth and fixed member in a word: two drives have the same only if they are the same.
    #[inline(always)]
    pub(crate) const fn word(&self) -> u32 {
        (self.flexspline_teeth as u32 | (self.circular_spline_teeth as u32) << 16) ^ self.reversed as u32
    }

    /// The ideal output angle `generator/ratio`, to half a count below a million turns, to 5/4 count at any number.
    ///
    /// Integer only, no division: five 32-bit multiplications.
    pub const fn nominal_output(&self, generator: GeneratorAngle) -> OutputAngle {
        OutputAngle::from_counts(self.with_sign(self.to_output.of(generator.counts())))
    }

    /// The generator angle `output·ratio` of an ideal drive, with the same error; wraps beyond ±2³¹ generator turns.
    pub const fn nominal_generator(&self, output: OutputAngle) -> GeneratorAngle {
        GeneratorAngle::from_counts(self.with_sign(self.to_generator.of(output.counts())))
    }

    /// Where the periodic parts of a table are read at this generator angle; `nominal` is its nominal output.
    pub fn phases(&self, generator: GeneratorAngle, nominal: OutputAngle) -> Phases {
        Phases {
            generator: generator.fraction(),
            material: generator.fraction().wrapping_sub(nominal.fraction()),
            output: nominal.fraction(),
            tooth: generator.fraction().wrapping_mul(self.ripple_order() as u32),
        }
    }

    /// Phases from the nominal output alone, each phase within 2⁻³² of a period at any number of turns.
    pub(crate) const fn phases_at_output(&self, nominal: OutputAngle) -> Phases {
        // Not kept: what is kept is checked in every tick.
        let generator = Rate::new(self.to_generator, 1, self.reversed < 0).phase(nominal.counts());
        Phases {
            generator,
            material: generator.wrapping_sub(nominal.fraction()),
            output: nominal.fraction(),
            tooth: self.tooth_rate.phase(nominal.counts()),
        }
    }

    /// The tooth phase of [`Self::phases_at_output`] alone.
    #[must_use]
    pub(crate) const fn tooth_at_output(&self, nominal: OutputAngle) -> u32 {
        self.tooth_rate.phase(nominal.counts())
    }

    /// Tooth pitches of the fixed member in one output turn, signed like the ratio.
    pub(crate) const fn tooth_periods(&self) -> f32 {
        self.ratio() * self.ripple_order() as f32
    }
}

/// A ratio of tooth counts: a whole part and 64 fractional bits, the last 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ToothRatio {
    whole: u32,
    fraction: u64,
}

impl ToothRatio {
    /// `mul/div`, by long division in digits of 16 bits.
    const fn new(mul: u16, div: u16) -> Self {
        let divisor = div as u32;
        // A zero divisor cannot be; `checked` keeps the panic path out.
        let (Some(whole), Some(mut remainder)) = ((mul as u32).checked_div(divisor), (mul as u32).checked_rem(divisor))
        else {
            return Self { whole: 0, fraction: 0 };
        };
        let mut fraction = 0u64;
        let mut digit = 0;
        while digit < 4 {
            let part = remainder << 16;
            if let (Some(quotient), Some(rest)) = (part.checked_div(divisor), part.checked_rem(divisor)) {
                fraction = fraction << 16 | quotient as u64;
                remainder = rest;
            }
            digit = u32::wrapping_add(digit, 1);
        }
        let up = remainder.wrapping_mul(2) >= divisor;
        // Rounding up cannot carry into the whole part: the fraction is at most (div - 1)/div, div < 2^16.
        // An even fraction keeps the largest partial sums of `of` within 64 bits.
        Self { whole, fraction: fraction.wrapping_add(up as u64) & !1 }
    }

    /// `counts·factor`, to within 5/4 count (half of one below 2²⁰ turns); wraps like the angles. The same work for all
    /// values.
    const fn of(self, counts: i64) -> i64 {
        let (high, low) = (counts >> 32, counts as u32 as u64);
        let (fraction_high, fraction_low) = ((self.fraction >> 32) as i64, self.fraction as u32 as u64);
        // Partial products of 32 bits each; the lowest but for its carry, rounded at half a count.
        let lowest = low.wrapping_mul(fraction_low) >> 32;
        let middle = low.wrapping_mul(fraction_high as u64).wrapping_add(lowest);
        let other = high.wrapping_mul(fraction_low as i64).wrapping_add(middle as u32 as i64).wrapping_add(1 << 31);
        let scaled = high.wrapping_mul(fraction_high).wrapping_add((middle >> 32) as i64).wrapping_add(other >> 32);
        counts.wrapping_mul(self.whole as i64).wrapping_add(scaled)
    }
}

/// Periods in one output turn, signed like the ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Rate {
    /// 32 whole and 32 fractional bits, rounded down.
    periods: i64,
    /// 32 more: what they leave after millions of turns is not nothing where the ratio is no multiple of 2⁻³².
    rest: u32,
}

impl Rate {
    /// N times a factor.
    const fn new(factor: ToothRatio, times: u16, reversed: bool) -> Self {
        let times = times as u64;
        let low = (factor.fraction as u32 as u64).wrapping_mul(times);
        let whole = ((factor.whole as u64) << 32).wrapping_add(factor.fraction >> 32);
        let (periods, rest) = (whole.wrapping_mul(times).wrapping_add(low >> 32) as i64, low as u32);
        if !reversed {
            return Self { periods, rest };
        }
        let rest = rest.wrapping_neg();
        Self { periods: (!periods).wrapping_add((rest == 0) as i64), rest }
    }

    /// The phase at an output angle, 2⁻³² of a period. The same work for all angles.
    #[inline(always)]
    const fn phase(self, counts: i64) -> u32 {
        let turns = counts >> 32;
        let late = (turns.wrapping_mul(self.rest as i64) >> 32) as u32;
        ((counts.wrapping_mul(self.periods) >> 32) as u32).wrapping_add(late)
    }
}

impl Drive {
    /// All of it in words.
    #[inline(always)]
    pub(crate) const fn words(&self) -> [u32; 11] {
        let Self { to_output, to_generator, tooth_rate, .. } = *self;
        [
            self.flexspline_teeth as u32 | (self.circular_spline_teeth as u32) << 16,
            self.reversed as u32,
            to_output.whole,
            to_output.fraction as u32,
            (to_output.fraction >> 32) as u32,
            to_generator.whole,
            to_generator.fraction as u32,
            (to_generator.fraction >> 32) as u32,
            low(tooth_rate.periods),
            high(tooth_rate.periods),
            tooth_rate.rest,
        ]
    }
}

bits_of!(Drive { flexspline_teeth, circular_spline_teeth, reversed, to_output, to_generator, tooth_rate });
bits_of!(ToothRatio { whole, fraction });
bits_of!(Rate { periods, rest });

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn hhd_95() -> Drive {
        Drive::new(188, 190, FixedMember::Flexspline).unwrap()
    }

    #[test]
    fn the_ratio_has_the_sign_of_willis() {
        assert_eq!(hhd_95().ratio(), 95.0);
        assert_eq!(Drive::new(190, 192, FixedMember::CircularSpline).unwrap().ratio(), -95.0);
        assert_eq!(Drive::new(200, 202, FixedMember::Flexspline).unwrap().ratio(), 101.0);
        assert_eq!(Drive::new(201, 203, FixedMember::Flexspline).unwrap().ratio(), 101.5);
        let thirds =
            [FixedMember::Flexspline, FixedMember::CircularSpline].map(|fixed| Drive::new(200, 203, fixed).unwrap());
        assert_eq!(thirds.map(|drive| drive.exact_ratio()), [203.0 / 3.0, -200.0 / 3.0]);
    }

    #[test]
    fn impossible_tooth_counts_are_refused() {
        for (fs, cs) in [(0, 2), (190, 188), (188, 188), (0, 0)] {
            let found = Drive::new(fs, cs, FixedMember::Flexspline);
            assert_eq!(found, Err(DriveError { flexspline_teeth: fs, circular_spline_teeth: cs }));
        }
    }

    #[test]
    fn one_output_turn_is_exactly_the_ratio() {
        let drive = hhd_95();
        assert_eq!(drive.nominal_output(GeneratorAngle::new(95, 0)), OutputAngle::new(1, 0));
        assert_eq!(drive.nominal_output(GeneratorAngle::new(-95_000_000, 0)), OutputAngle::new(-1_000_000, 0));
        let reversed = Drive::new(190, 192, FixedMember::CircularSpline).unwrap();
        assert_eq!(reversed.nominal_output(GeneratorAngle::new(95, 0)), OutputAngle::new(-1, 0));
        assert_eq!(reversed.nominal_generator(OutputAngle::new(-2, 0)), GeneratorAngle::new(190, 0));
    }

    #[test]
    fn the_material_phase_is_94_95_of_the_generator_and_the_tooth_phase_188() {
        let drive = hhd_95();
        // 9.5 generator turns: 0.1 output turns, 9.4 turns relative to the output, half of 188·½ = 0 pitches.
        let generator = GeneratorAngle::new(9, 1 << 31);
        let phases = drive.phases(generator, drive.nominal_output(generator));
        assert_eq!(phases.generator, 1 << 31);
        assert!((phases.output as f64 / 4_294_967_296.0 - 0.1).abs() < 2.4e-10);
        assert!((phases.material as f64 / 4_294_967_296.0 - 0.4).abs() < 2.4e-10);
        assert_eq!(phases.tooth, 0);
        let half_pitch = GeneratorAngle::from_rad(core::f64::consts::PI / 188.0).unwrap();
        let tooth = drive.phases(half_pitch, drive.nominal_output(half_pitch)).tooth;
        assert!(tooth.abs_diff(1 << 31) <= 94, "{tooth}");
    }

    proptest! {
        #[test]
        fn scaling_is_division_to_about_a_count(counts in any::<i64>(), mul in 1u16.., div in 1u16..) {
            let exact = counts as i128 * mul as i128;
                        let found = ToothRatio::new(mul, div).of(counts) as i128;
            // Both modulo 2^64: the angles wrap.
            let off = (exact - found * div as i128).rem_euclid((div as i128) << 64);
            let off = off.min(((div as i128) << 64) - off);
            prop_assert!(4 * off <= 5 * div as i128 + 4, "{off} of {div}");
        }

        #[test]
        fn phases_at_the_output_are_those_of_the_generator(
            turns in -1_000_000i32..1_000_000, fraction in any::<u32>(),
        ) {
            let drives = [
                (188, 190, FixedMember::Flexspline), (190, 192, FixedMember::CircularSpline),
                (201, 203, FixedMember::CircularSpline), (200, 203, FixedMember::Flexspline),
            ];
            for (fs, cs, fixed) in drives {
                let drive = Drive::new(fs, cs, fixed).unwrap();
                let nominal = OutputAngle::new(turns, fraction);
                let generator = drive.nominal_generator(nominal);
                let (there, here) = (drive.phases(generator, nominal), drive.phases_at_output(nominal));
                prop_assert_eq!(there.output, here.output);
                for (a, b) in [
                    (there.generator, here.generator), (there.tooth, here.tooth), (there.material, here.material),
                ] {
                    // A count of the generator, which is rounded to 5/4, is as many counts of the tooth phase as there
                    // are teeth.
                    let off = (a.wrapping_sub(b) as i32).unsigned_abs();
                    prop_assert!(off <= 2 * u32::from(cs), "{off}");
                }
            }
        }

        #[test]
        fn nominal_motion_inverts(turns in -1_000_000i32..1_000_000, fraction in any::<u32>()) {
            for drive in [hhd_95(), Drive::new(201, 203, FixedMember::CircularSpline).unwrap()] {
                let output = OutputAngle::new(turns, fraction);
                prop_assert_eq!(drive.nominal_output(drive.nominal_generator(output)), output);
            }
        }
    }
}
