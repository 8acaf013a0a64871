//! Angles with their unit: for settings, which are numbers in radians.
//!
//! ```
//! use flexspline::{Arcsec, Degrees, OutputAngle};
//!
//! let deadband_rad: f32 = Arcsec(0.2).rad(); // a field of `Limits`
//! let target = OutputAngle::of(Degrees(12.5)).ok_or("beyond 2^31 turns")?;
//! assert!((target.to_rad() - f64::from(Degrees(12.5))).abs() < 1e-9 && deadband_rad > 9.6e-7);
//! # Ok::<(), &str>(())
//! ```

use core::f64::consts::PI;

macro_rules! unit {
    ($(#[$doc:meta])* $name:ident: $in_half_turn:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
        pub struct $name(pub f64);

        impl $name {
            /// In radians, as the number that settings take.
            #[must_use]
            pub const fn rad(self) -> f32 {
                (self.0 * (PI / $in_half_turn)) as f32
            }
        }

        /// In radians.
        impl From<$name> for f64 {
            fn from($name(angle): $name) -> Self {
                angle * (PI / $in_half_turn)
            }
        }
    };
}

unit! {
    /// An angle in degrees.
    Degrees: 180.0
}
unit! {
    /// An angle in arcseconds.
    Arcsec: 648_000.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GeneratorAngle, OutputAngle};

    #[test]
    fn an_angle_is_the_same_in_every_unit() {
        let quarter = Some(OutputAngle::new(0, 1 << 30));
        assert_eq!(OutputAngle::of(Degrees(90.0)), quarter);
        assert_eq!(OutputAngle::of(Arcsec(324_000.0)), quarter);
        assert_eq!(OutputAngle::of(core::f64::consts::FRAC_PI_2), quarter);
        assert_eq!(GeneratorAngle::of(Degrees(-90.0)), Some(GeneratorAngle::new(-1, 3 << 30)));
        assert_eq!(GeneratorAngle::of(Degrees(f64::NAN)), None);
        assert!((Arcsec(1.0).rad() - 4.848_137e-6).abs() < 1e-12);
        assert_eq!(Degrees(1.0).rad(), Arcsec(3600.0).rad());
    }
}
