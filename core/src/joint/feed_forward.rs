//! Rate and acceleration of the corrected command, for the speed loop and the current of a servo.

use super::runtime::Joint;
use crate::angle::{OutputAngle, RAD_PER_COUNT, counts_from_rad};
use crate::play::Direction;
use crate::store::Store;
use crate::table::{Approach, Quality};

/// Over a shorter way than this slopes are rounding of counts, rad of the output: 34 counts.
const SHORTEST_WAY_RAD: f32 = 5e-8;

impl Joint {
    /// Rate and acceleration of the generator, rad/s and rad/s², so that the output moves as it shall: as
    /// [`Self::rate_ahead`], and the acceleration that goes with it, where the target itself moves at `rate_rad_s`
    /// and with `acceleration_rad_s2`:
    /// ```text
    /// dψ/dt = ψ'·v,   d²ψ/dt² = ψ''·v² + ψ'·a
    /// ```
    /// with the generator angle `ψ(δ)` that the table wants for an output angle `δ` under this torque. Three inverse
    /// solutions.
    ///
    /// Inertia of motor and generator times this acceleration is the torque to feed forward to the motor's current.
    /// The torque for the load's inertia is that inertia times `acceleration_rad_s2` over the ratio: the output moves
    /// as the target does. Both are NaN where the table gives nothing, or a number is not finite.
    #[must_use]
    pub fn motion_ahead(
        &self,
        store: &Store,
        target: OutputAngle,
        [rate_rad_s, acceleration_rad_s2]: [f32; 2],
        torque_n_m: f32,
        ahead_s: f32,
    ) -> [f32; 2] {
        let direction = if rate_rad_s < 0.0 { Direction::Backward } else { Direction::Forward };
        let way = self.way_rad(rate_rad_s, ahead_s);
        let at = |way: f32| self.inverse(store, target.offset_rad(way), torque_n_m, Approach::Moving(direction));
        let [before, now, after] = [at(-way), at(0.0), at(way)];
        let nothing = [f32::NAN; 2];
        if [before, now, after].iter().any(|command| command.quality == Quality::Disabled) {
            return nothing;
        }
        let slope = after.generator.minus_rad(before.generator) / (2.0 * way);
        // In counts, as their difference is small.
        let came = now.generator.minus_counts(before.generator);
        let bent = after.generator.minus_counts(now.generator).wrapping_sub(came) as f32 * RAD_PER_COUNT;
        let per_way = rate_rad_s / way;
        let along = if rate_rad_s == 0.0 { self.drive().ratio() } else { slope };
        let ahead = [slope * rate_rad_s, bent * per_way * per_way + along * acceleration_rad_s2];
        if ahead.into_iter().all(f32::is_finite) { ahead } else { nothing }
    }

    /// Half of the way over which slopes are taken, rad: that of the target in half of `ahead_s`, but no less than
    /// counts of both angles resolve, and no more than a quarter of the generator's turn.
    fn way_rad(&self, rate_rad_s: f32, ahead_s: f32) -> f32 {
        let ratio = self.drive().ratio();
        let most = core::f32::consts::FRAC_PI_2 / if ratio < 0.0 { -ratio } else { ratio };
        let way = 0.5 * ahead_s * if rate_rad_s < 0.0 { -rate_rad_s } else { rate_rad_s };
        let way = if way < SHORTEST_WAY_RAD {
            SHORTEST_WAY_RAD
        } else if way > most {
            most
        } else {
            way
        };
        // In whole counts, as the target moves.
        counts_from_rad(way) as f32 * RAD_PER_COUNT
    }

    /// Rate at which the generator has to turn so that the output moves at `rate_rad_s`, rad/s: the nominal rate and
    /// the error's contribution, by the table's slope along the way of the target (over `ahead_s`, some ticks).
    ///
    /// Torque and flank are the same at both ends. So nothing that a torque does comes through here, and what is fed
    /// forward cannot feed back: the differences of the command itself do, and make a loop that compensates a torque in
    /// the mesh ring. NaN where the table gives nothing. Two inverse solutions: for a tick that has the time, or every
    /// few ticks.
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
        let way = self.way_rad(rate_rad_s, ahead_s);
        let at = |way: f32| self.inverse(store, target.offset_rad(way), torque_n_m, Approach::Moving(direction));
        let (before, after) = (at(-way), at(way));
        if before.quality == Quality::Disabled || after.quality == Quality::Disabled {
            return f32::NAN;
        }
        let rate = after.generator.minus_rad(before.generator) / (2.0 * way) * rate_rad_s;
        if rate.is_finite() { rate } else { f32::NAN }
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

    #[test]
    fn whatever_the_way_ahead_the_rate_is_near_the_ratio_or_not_a_number() {
        let (one, two) = (fixture::image(true), fixture::image(true));
        let mut store = Store::new();
        let joint = Joint::new(fixture::drive(), LIMITS, Overrun::HoldLast).unwrap();
        store.activate(&Images::new(&one, &two), &fixture::drive(), 20.0).unwrap();
        let ratio = fixture::drive().ratio();
        for rate in [1e-30_f32, 1e-9, -1e-7, 1e-4, 0.1, -5.0, 10.0, 1e30] {
            for ahead_s in [1e-30_f32, 1e-9, 1e-3, 4e-3, 0.1, 1e3, 1e30] {
                let motion = joint.motion_ahead(&store, OutputAngle::ZERO, [rate, 0.1], 5.0, ahead_s);
                let off = motion[0] / (rate * ratio) - 1.0;
                assert!(off.abs() < 0.1 || (rate.abs() > 1e29 && motion[0].is_nan()), "{rate} {ahead_s}: {motion:?}");
                assert_eq!(motion[0].is_nan(), motion[1].is_nan());
                let alone = joint.rate_ahead(&store, OutputAngle::ZERO, rate, 5.0, ahead_s);
                assert!(alone == motion[0] || motion[0].is_nan(), "{rate} {ahead_s}");
            }
        }
        for [rate, acceleration, ahead_s] in
            [[f32::NAN, 0.0, 1e-3], [0.1, f32::INFINITY, 1e-3], [0.1, f32::MAX, 1e-3], [0.1, 0.0, f32::NAN]]
        {
            let motion = joint.motion_ahead(&store, OutputAngle::ZERO, [rate, acceleration], 5.0, ahead_s);
            assert!(motion[0].is_nan() && motion[1].is_nan(), "{motion:?}");
        }
    }

    /// Against differences of the inverse over longer ways, in double precision; and a target that accelerates from
    /// rest wants the ratio.
    #[test]
    fn the_acceleration_is_that_of_the_exact_inverse() {
        let (one, two) = (fixture::image(true), fixture::image(true));
        let images = Images::new(&one, &two);
        let mut store = Store::new();
        let joint = Joint::new(fixture::drive(), LIMITS, Overrun::HoldLast).unwrap();
        let ask = |store: &Store, target, motion| joint.motion_ahead(store, target, motion, 5.0, 4e-3);
        let blind = ask(&store, OutputAngle::ZERO, [0.01, 0.0]);
        assert!(blind[0].is_nan() && blind[1].is_nan());
        store.activate(&images, &fixture::drive(), 20.0).unwrap();
        let ratio = fixture::drive().exact_ratio();
        let mut most = 0.0_f64;
        for k in 0..40 {
            for [rate, acceleration] in [[0.05_f32, 0.0], [-0.04, 0.3], [0.05, -0.2]] {
                let target = OutputAngle::from_rad(0.003 * f64::from(k)).unwrap();
                let direction = if rate < 0.0 { Direction::Backward } else { Direction::Forward };
                let at = |s: f64| {
                    let way = f64::from(rate) * s + 0.5 * f64::from(acceleration) * s * s;
                    joint.inverse(&store, target.offset_rad(way as f32), 5.0, Approach::Moving(direction)).generator
                };
                let h = 2e-3;
                let [came, goes] = [at(0.0).minus_counts(at(-h)), at(h).minus_counts(at(0.0))];
                let exact = (goes - came) as f64 * core::f64::consts::TAU / 4_294_967_296.0 / (h * h);
                let found = ask(&store, target, [rate, acceleration]);
                assert_eq!(found[0], joint.rate_ahead(&store, target, rate, 5.0, 4e-3));
                // Places are counts: half of one at the output is 0.02 rad/s² of the generator over 2 ms. The way of
                // one that accelerates is not even: where the slope (91 to 97 here) bends within 2 ms, part of its
                // change comes in, times the target's acceleration.
                let off = (f64::from(found[1]) - exact).abs();
                assert!(
                    off < 0.1 + 2.5 * f64::from(acceleration.abs()),
                    "{k} {rate} {acceleration}: {found:?} {exact}"
                );
                most = most.max((f64::from(found[1]) - ratio * f64::from(acceleration)).abs());
            }
        }
        // The curvature of the error is there.
        assert!(most > 0.5, "{most}");
        let starts = ask(&store, OutputAngle::ZERO, [0.0, 0.1]);
        assert_eq!(starts[0], 0.0);
        assert!((f64::from(starts[1]) - 0.1 * ratio).abs() < 1e-4, "{starts:?}");
    }
}
