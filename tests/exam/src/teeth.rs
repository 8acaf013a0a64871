//! Two zones of engaged teeth share the load: what each wheel's errors do to the output.
//!
//! Rigid wheels, a spring in each zone. A zone touches the flank that turns the output forward at `upper`, the other one at
//! `lower` (arcsec at the output, relative to the driven position). Without load the zone that comes first holds; a load
//! presses it in until the second touches, and from there both share. So odd errors of a wheel vanish under load and are
//! rectified without it.

use crate::effect::Family;

/// Where each zone touches, relative to half the clearance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Zones {
    /// Limits of forward motion.
    pub upper: [f64; 2],
    /// Limits of backward motion.
    pub lower: [f64; 2],
}

impl Zones {
    /// A displacement of the wheel's axis: `x` is the angle on the wheel from the displacement to the first zone, `amplitude`
    /// the displacement over radius and cosine of the pressure angle.
    pub fn displace(&mut self, x: f64, amplitude: f64, pressure_angle_rad: f64) {
        let (plus, minus) = ((x + pressure_angle_rad).sin(), (x - pressure_angle_rad).sin());
        for (zone, sign) in [1.0, -1.0].into_iter().enumerate() {
            self.upper[zone] += sign * amplitude * plus;
            self.lower[zone] += sign * amplitude * minus;
        }
    }

    /// Positions of the teeth in each zone, forward positive, the same for both flanks.
    pub fn shift(&mut self, zone: usize, position: f64) {
        self.upper[zone] += position;
        self.lower[zone] += position;
    }

    /// Opens both flanks of both zones (radial motion of the teeth).
    pub fn open(&mut self, by: f64) {
        for zone in 0..2 {
            self.upper[zone] += by;
            self.lower[zone] -= by;
        }
    }

    /// Lowest and highest position of the output inside the clearance. `press` is the load over the tooth stiffness, arcsec.
    pub fn limits(&self, clearance: f64, press: f64, family: Family) -> (f64, f64) {
        let half = 0.5 * clearance;
        let [a, b] = self.upper;
        let [c, d] = self.lower;
        let high = half + first(a, b, press.max(0.0), family);
        let low = -half - first(-c, -d, (-press).max(0.0), family);
        if low > high {
            let middle = 0.5 * (low + high);
            return (middle, middle);
        }
        (low, high)
    }
}

/// Where the output rests on two zones that touch at `a` and `b`.
fn first(a: f64, b: f64, press: f64, family: Family) -> f64 {
    let (mean, half) = (0.5 * (a + b), 0.5 * (a - b).abs());
    match family {
        // Two springs of half the stiffness: the first alone until it gave way by their distance.
        Family::A => (mean - half + press).min(mean),
        // Many teeth in each zone, entering one after another: a smooth transition.
        Family::B => mean - half * (2.0 * half / (4.0 + 1.6 * press)).tanh(),
    }
}

/// Position of the teeth of a wheel around its circumference, as a sum of harmonics; forward positive, arcsec.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile(Vec<(f64, f64, f64)>);

impl Profile {
    /// From order, amplitude and phase, each averaged over the engaged arc (`half_arc_rad` to both sides).
    pub fn new(lines: impl IntoIterator<Item = (f64, f64, f64)>, half_arc_rad: f64) -> Self {
        let averaged = lines.into_iter().map(|(k, amplitude, phase)| {
            let x = k * half_arc_rad;
            (k, amplitude * x.sin() / x, phase)
        });
        Self(averaged.collect())
    }

    /// At an angle on the wheel.
    pub fn at(&self, angle_rad: f64) -> f64 {
        self.0.iter().map(|(k, amplitude, phase)| amplitude * (k * angle_rad + phase).cos()).sum()
    }
}

/// A pulse of height 1 as a tooth at angle 0 passes a zone: raised cosine over the engaged arc.
pub fn pulse(angle_rad: f64, half_width_rad: f64) -> f64 {
    let x = wrapped(angle_rad) / half_width_rad;
    if x.abs() < 1.0 { 0.5 + 0.5 * (std::f64::consts::PI * x).cos() } else { 0.0 }
}

/// The angle in -π..π.
pub fn wrapped(angle_rad: f64) -> f64 {
    angle_rad - std::f64::consts::TAU * (angle_rad / std::f64::consts::TAU).round()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Closed form: one flank of an eccentric wheel follows -|sin|, of mean 2/π and second and fourth order
    /// 0.424 and 0.085 of the amplitude.
    #[test]
    fn an_eccentric_wheel_rectifies() {
        let count = 720;
        let one_flank = |at: usize| {
            let x = TAU * at as f64 / count as f64;
            let mut zones = Zones::default();
            zones.displace(x, 10.0, 0.42);
            zones.limits(60.0, 0.0, Family::A).1 - 30.0
        };
        let order = |n: f64| {
            let sum = |f: fn(f64) -> f64| -> f64 {
                (0..count).map(|at| one_flank(at) * f(n * TAU * at as f64 / count as f64)).sum::<f64>() * 2.0
                    / count as f64
            };
            sum(f64::cos).hypot(sum(f64::sin))
        };
        let mean: f64 = (0..count).map(one_flank).sum::<f64>() / count as f64;
        assert!((mean + 10.0 * 2.0 / std::f64::consts::PI).abs() < 1e-3);
        assert!((order(2.0) - 4.244).abs() < 0.01 && (order(4.0) - 0.849).abs() < 0.01);
        assert!(order(1.0) < 1e-9 && order(3.0) < 1e-9);
    }

    #[test]
    fn load_brings_both_zones_in_and_odd_errors_vanish() {
        let mut zones = Zones::default();
        zones.displace(0.7, 10.0, 0.42);
        for family in [Family::A, Family::B] {
            let free = zones.limits(60.0, 0.0, family).1;
            let pressed = zones.limits(60.0, 500.0, family).1;
            assert!(free < 30.0 - 4.0 && (pressed - 30.0).abs() < 0.3, "{free} {pressed}");
        }
    }

    #[test]
    fn flanks_that_clash_leave_no_clearance() {
        let mut zones = Zones::default();
        zones.displace(1.57, 100.0, 0.42);
        let (low, high) = zones.limits(20.0, 0.0, Family::A);
        assert_eq!(low, high);
    }
}
