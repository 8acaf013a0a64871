//! Two zones of engaged teeth share the load: what each wheel's errors do to the output.
//!
//! Rigid wheels, a spring in each zone. A zone touches the flank that turns the output forward at `upper`, the other
//! one at `lower` (arcsec at the output, relative to the driven position). Without load the zone that comes first
//! holds; a load presses it in until the second touches, and from there both share. So odd errors of a wheel vanish
//! under load and are rectified without it.

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
    /// A displacement of the wheel's axis: `x` is the angle on the wheel from the displacement to the first zone,
    /// `amplitude` the displacement over radius and cosine of the pressure angle.
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

    /// Lowest and highest position of the output inside the clearance. `press` is the load over the tooth stiffness,
    /// arcsec.
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
        Family::C => mean - half + entering(half, press),
    }
}

/// Deflection of the teeth (arcsec) at which a force that grows with its power 3/2 is as stiff as the linear spring.
const EQUAL_PRESS_ARCSEC: f64 = 20.0;

/// How far a load presses the output beyond where it would rest on two zones that touch together, from where the first
/// of two zones touches that are `2 half` apart, arcsec.
///
/// The gaps of a zone grow with the square of the distance from its middle, so teeth enter as the root of the
/// deflection δ and the force is as δ^(3/2) (derived here; the power of Hertz 1882 for a sphere): δ₁^(3/2) + (δ₁ - 2
/// half)₊^(3/2) = 2 δ₀^(3/2), where δ₀ is the deflection of equal zones.
fn entering(half: f64, press: f64) -> f64 {
    let force = |deflection: f64| deflection.max(0.0).powf(1.5);
    let equal = (EQUAL_PRESS_ARCSEC * press * press).cbrt();
    let alone = 2.0_f64.powf(2.0 / 3.0) * equal;
    if alone <= 2.0 * half {
        return alone - equal;
    }
    // Newton from above: the force is convex.
    let mut deflection = equal + half;
    for _ in 0..20 {
        let second = (deflection - 2.0 * half).max(0.0);
        let excess = force(deflection) + force(second) - 2.0 * force(equal);
        if excess <= 1e-12 * force(deflection) {
            break;
        }
        deflection -= excess / (1.5 * (deflection.sqrt() + second.sqrt()));
    }
    deflection - equal
}

/// Position of the teeth of a wheel around its circumference, as a sum of harmonics; forward positive, arcsec. Held is
/// the factor of `exp(i k angle)`, real and imaginary part, for each order `k` from zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile(Vec<(f64, f64)>);

impl Profile {
    /// From order (a whole number), amplitude and phase, each averaged over the engaged arc (`half_arc_rad` to both
    /// sides).
    pub fn new(lines: impl IntoIterator<Item = (f64, f64, f64)>, half_arc_rad: f64) -> Self {
        Self::averaged(lines, |k| (k * half_arc_rad).sin() / (k * half_arc_rad))
    }

    /// The same where the teeth in the middle of the arc carry more: weights fall as a parabola to its ends.
    pub fn carried_by_the_middle(lines: impl IntoIterator<Item = (f64, f64, f64)>, half_arc_rad: f64) -> Self {
        Self::averaged(lines, |k| {
            let x = k * half_arc_rad;
            3.0 * (x.sin() - x * x.cos()) / x.powi(3)
        })
    }

    fn averaged(lines: impl IntoIterator<Item = (f64, f64, f64)>, left: impl Fn(f64) -> f64) -> Self {
        let mut coefficients = Vec::new();
        for (k, amplitude, phase) in lines {
            let order = k as usize;
            if coefficients.len() <= order {
                coefficients.resize(order + 1, (0.0, 0.0));
            }
            let (sin, cos) = phase.sin_cos();
            let of_order: &mut (f64, f64) = &mut coefficients[order];
            of_order.0 += amplitude * left(k) * cos;
            of_order.1 += amplitude * left(k) * sin;
        }
        Self(coefficients)
    }

    /// At an angle on the wheel.
    pub fn at(&self, angle_rad: f64) -> f64 {
        // The polynomial at exp(i angle) by Horner: a plant asks a hundred million times.
        let (sin, cos) = angle_rad.sin_cos();
        let highest_first = self.0.iter().rev();
        highest_first.fold((0.0, 0.0), |(re, im), (a, b)| (re * cos - im * sin + a, re * sin + im * cos + b)).0
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
        for family in Family::ALL {
            let free = zones.limits(60.0, 0.0, family).1;
            let pressed = zones.limits(60.0, 500.0, family).1;
            assert!(free < 30.0 - 4.0 && (pressed - 30.0).abs() < 0.3, "{free} {pressed}");
        }
    }

    /// The second zone comes in without a jump, and the forces of both zones are those of the load.
    #[test]
    fn teeth_that_enter_by_their_gaps_balance_the_load() {
        let half = 6.0;
        let mut last = 0.0;
        for at in 1..4000 {
            let press = 0.02 * f64::from(at);
            let equal = (EQUAL_PRESS_ARCSEC * press * press).cbrt();
            let gained = entering(half, press);
            let (first, second) = (gained + equal, (gained + equal - 2.0 * half).max(0.0));
            let missing = first.powf(1.5) + second.powf(1.5) - 2.0 * equal.powf(1.5);
            assert!(missing.abs() < 1e-6 * equal.powf(1.5), "{missing} at {press}");
            assert!(gained > last && gained - last < 0.2 && gained < half, "{last} {gained} at {press}");
            last = gained;
        }
        // Far beyond their distance the two zones share all but half²/4δ₀ of it.
        let equal = (EQUAL_PRESS_ARCSEC * 6400.0_f64).cbrt();
        assert!((half - entering(half, 80.0) - half * half / (4.0 * equal)).abs() < 0.02);
    }

    #[test]
    fn flanks_that_clash_leave_no_clearance() {
        let mut zones = Zones::default();
        zones.displace(1.57, 100.0, 0.42);
        let (low, high) = zones.limits(20.0, 0.0, Family::A);
        assert_eq!(low, high);
    }
}
