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
use core::num::NonZeroU16;

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
    flexspline_teeth: NonZeroU16,
    circular_spline_teeth: NonZeroU16,
    waves: NonZeroU16,
    fixed: FixedMember,
    ratio: f32,
}

/// Where the periodic parts of a table are read, each as a fraction of its own period in 2⁻³².
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
    /// A drive from its tooth counts.
    ///
    /// # Errors
    /// [`DriveError`] unless `1 ≤ flexspline_teeth < circular_spline_teeth`.
    pub fn new(flexspline_teeth: u16, circular_spline_teeth: u16, fixed: FixedMember) -> Result<Self, DriveError> {
        let bad = DriveError { flexspline_teeth, circular_spline_teeth };
        let fs = NonZeroU16::new(flexspline_teeth).ok_or(bad)?;
        let cs = NonZeroU16::new(circular_spline_teeth).ok_or(bad)?;
        let waves = circular_spline_teeth.checked_sub(flexspline_teeth).and_then(NonZeroU16::new).ok_or(bad)?;
        let ratio = match fixed {
            FixedMember::Flexspline => cs.get() as f32 / waves.get() as f32,
            FixedMember::CircularSpline => -(fs.get() as f32) / waves.get() as f32,
        };
        Ok(Self { flexspline_teeth: fs, circular_spline_teeth: cs, waves, fixed, ratio })
    }

    /// Teeth of the flexspline.
    #[must_use]
    pub const fn flexspline_teeth(&self) -> u16 {
        self.flexspline_teeth.get()
    }

    /// Teeth of the circular spline.
    #[must_use]
    pub const fn circular_spline_teeth(&self) -> u16 {
        self.circular_spline_teeth.get()
    }

    /// The member that stands still.
    #[must_use]
    pub const fn fixed(&self) -> FixedMember {
        self.fixed
    }

    /// Generator turns in one output turn, signed: +95 for 188/190 teeth with the flexspline fixed.
    #[must_use]
    pub const fn ratio(&self) -> f32 {
        self.ratio
    }

    /// The ratio to double precision, for the host.
    #[must_use]
    pub fn exact_ratio(&self) -> f64 {
        let (teeth, waves) = self.turns_and_waves();
        let magnitude = teeth.get() as f64 / waves.get() as f64;
        match self.fixed {
            FixedMember::Flexspline => magnitude,
            FixedMember::CircularSpline => -magnitude,
        }
    }

    /// Ripple periods in one generator turn: the teeth of the fixed member.
    #[must_use]
    pub const fn ripple_order(&self) -> u16 {
        match self.fixed {
            FixedMember::Flexspline => self.flexspline_teeth.get(),
            FixedMember::CircularSpline => self.circular_spline_teeth.get(),
        }
    }

    /// |ratio| as teeth over waves.
    const fn turns_and_waves(&self) -> (NonZeroU16, NonZeroU16) {
        match self.fixed {
            FixedMember::Flexspline => (self.circular_spline_teeth, self.waves),
            FixedMember::CircularSpline => (self.flexspline_teeth, self.waves),
        }
    }

    const fn with_sign(&self, counts: i64) -> i64 {
        match self.fixed {
            FixedMember::Flexspline => counts,
            FixedMember::CircularSpline => counts.wrapping_neg(),
        }
    }

    /// The ideal output angle `generator/ratio`, to half a count of the exact quotient at any number of turns.
    ///
    /// Integer only: six 32-bit divisions, no 64-bit one.
    #[must_use]
    pub fn nominal_output(&self, generator: GeneratorAngle) -> OutputAngle {
        let (teeth, waves) = self.turns_and_waves();
        OutputAngle::from_counts(self.with_sign(scale(generator.counts(), waves, teeth)))
    }

    /// The generator angle `output·ratio` of an ideal drive, to half a count; wraps beyond ±2³¹ generator turns.
    #[must_use]
    pub fn nominal_generator(&self, output: OutputAngle) -> GeneratorAngle {
        let (teeth, waves) = self.turns_and_waves();
        GeneratorAngle::from_counts(self.with_sign(scale(output.counts(), teeth, waves)))
    }

    /// Where the periodic parts of a table are read at this generator angle; `nominal` is its nominal output.
    #[must_use]
    pub fn phases(&self, generator: GeneratorAngle, nominal: OutputAngle) -> Phases {
        Phases {
            generator: generator.fraction(),
            material: generator.fraction().wrapping_sub(nominal.fraction()),
            output: nominal.fraction(),
            tooth: generator.fraction().wrapping_mul(self.ripple_order() as u32),
        }
    }

    /// The generator angle that brings an output with this error to `target`, and the nominal output there:
    /// `target·ratio + command_correction` with `command_correction = −predicted_error·ratio`.
    ///
    /// The error is at the output, positive when the output is ahead of ideal. This is the one place where the sign of the
    /// correction is set. NaN corrects nothing.
    #[must_use]
    pub fn corrected_command(&self, target: OutputAngle, predicted_error_rad: f32) -> (GeneratorAngle, OutputAngle) {
        let nominal = target.offset_rad(-predicted_error_rad);
        (self.nominal_generator(nominal), nominal)
    }
}

/// `counts·mul/div` to the nearest integer, halves away from zero; wraps like the angles.
///
/// Exact: whole turns and the rest are divided apart. Straight-line code, the same work for all values.
fn scale(counts: i64, mul: NonZeroU16, div: NonZeroU16) -> i64 {
    let magnitude = counts.unsigned_abs();
    let turns = (magnitude >> 32) as u32;
    let divisor = core::num::NonZeroU32::from(div);
    let whole = turns / divisor;
    let rest = ((turns % divisor) as u64) << 32 | (magnitude & 0xffff_ffff);
    // rest < div·2³², so the product is below 2⁶⁴ − 2⁴⁸ and the half divisor cannot overflow it.
    let product = rest.wrapping_mul(mul.get() as u64).wrapping_add((div.get() >> 1) as u64);
    let mut quotient = 0u64;
    let mut remainder = 0u32;
    for digit in [48, 32, 16, 0] {
        let part = remainder << 16 | (product >> digit) as u16 as u32;
        quotient = quotient << 16 | (part / divisor) as u64;
        remainder = part % divisor;
    }
    let whole_turns = (whole as u64).wrapping_mul(mul.get() as u64) << 32;
    let scaled = whole_turns.wrapping_add(quotient) as i64;
    if counts < 0 { scaled.wrapping_neg() } else { scaled }
}

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

    #[test]
    fn the_correction_opposes_the_error_for_both_senses() {
        let (generator, nominal) = hhd_95().corrected_command(OutputAngle::ZERO, 0.01);
        assert!((nominal.to_rad() + 0.01).abs() < 1e-9);
        assert!((generator.to_rad() + 0.01 * 95.0).abs() < 1e-7);
        let reversed = Drive::new(190, 192, FixedMember::CircularSpline).unwrap();
        let (generator, _) = reversed.corrected_command(OutputAngle::ZERO, 0.01);
        assert!((generator.to_rad() - 0.01 * 95.0).abs() < 1e-7);
        let (generator, _) = reversed.corrected_command(OutputAngle::new(1, 0), f32::NAN);
        assert_eq!(generator, GeneratorAngle::new(-95, 0));
    }

    proptest! {
        #[test]
        fn scaling_is_exact_division(counts in any::<i64>(), mul in 1u16.., div in 1u16..) {
            let exact = counts.unsigned_abs() as u128 * mul as u128 + (div / 2) as u128;
            let exact = (exact / div as u128) as u64 as i64;
            let exact = if counts < 0 { exact.wrapping_neg() } else { exact };
            let mul = NonZeroU16::new(mul).unwrap();
            let div = NonZeroU16::new(div).unwrap();
            prop_assert_eq!(scale(counts, mul, div), exact);
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
