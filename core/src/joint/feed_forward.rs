//! The rate of the corrected command, for the speed loop of a servo.

use super::runtime::Joint;
use crate::angle::OutputAngle;
use crate::play::Direction;
use crate::store::Store;
use crate::table::{Approach, Quality};

impl Joint {
    /// Rate at which the generator has to turn so that the output moves at `rate_rad_s`, rad/s: the nominal rate and what the error adds to it, by
    /// the table's slope along the way of the target (over `ahead_s`, some ticks).
    ///
    /// Torque and flank are the same at both ends. So nothing that a torque does comes through here, and what is fed forward cannot feed
    /// back: the differences of the command itself do, and make a loop that compensates a torque in the mesh ring. NaN where the table
    /// gives nothing. Two inverse solutions: for a tick that has the time, or every few ticks.
    #[must_use]
    pub fn rate_ahead(
        &self,
        store: &Store,
        target: OutputAngle,
        rate_rad_s: f32,
        torque_n_m: f32,
        ahead_s: f32,
    ) -> f32 {
        let direction = if rate_rad_s < 0.0 { Direction::Backward } else { Direction::Forward };
        let half = rate_rad_s * ahead_s * 0.5;
        let at = |way: f32| self.inverse(store, target.offset_rad(way), torque_n_m, Approach::Moving(direction));
        let (before, after) = (at(-half), at(half));
        if before.quality == Quality::Disabled || after.quality == Quality::Disabled {
            return f32::NAN;
        }
        after.generator.minus_rad(before.generator) / ahead_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{self, LIMITS};
    use crate::joint::Overrun;
    use crate::store::Images;

    #[test]
    fn the_rate_is_that_of_the_exact_inverse() {
        let (one, two) = (fixture::image(true), fixture::image(true));
        let images = Images::new(&one, &two);
        let mut store = Store::new();
        let joint = Joint::new(fixture::drive(), LIMITS, Overrun::HoldLast).unwrap();
        assert!(joint.rate_ahead(&store, OutputAngle::ZERO, 0.01, 5.0, 0.01).is_nan());
        store.activate(&images, &fixture::drive(), 20.0).unwrap();
        let ratio = fixture::drive().exact_ratio();
        let mut differs = 0.0_f64;
        for k in 0..40 {
            for rate in [0.01_f32, -0.02] {
                let target = OutputAngle::from_rad(0.003 * f64::from(k)).unwrap();
                let direction = if rate < 0.0 { Direction::Backward } else { Direction::Forward };
                let at = |s: f32| {
                    joint.inverse(&store, target.offset_rad(rate * s), 5.0, Approach::Moving(direction)).generator
                };
                let exact = f64::from(at(2e-3).minus_rad(at(-2e-3))) / 4e-3;
                let found = f64::from(joint.rate_ahead(&store, target, rate, 5.0, 4e-3));
                assert!((found - exact).abs() < 1e-4 * exact.abs(), "{k}: {found} {exact}");
                differs = differs.max((found / (f64::from(rate) * ratio) - 1.0).abs());
            }
        }
        // The slope of the error is there.
        assert!(differs > 1e-4, "{differs}");
    }
}
