//! Shape of a thin inextensible ring under each wave generator, to first order in the deflection `w0`.
//!
//! With `phi` the angle from the major axis, `w` the radial displacement (outward +) and `v` the circumferential one
//! (with `phi` +): `v' = -w` (inextensible), the mean of `w` over a quarter is zero, `w(0) = w0`. Both are given on
//! `0..pi/2` and continue with period pi, `w` even and `v` odd. The rollers and the ends of the disc arc are
//! concentrated radial forces, where `w'''` jumps; `w''` is continuous everywhere.
//!
//! Source: inextensional bending of a thin curved bar with circular axis, S. Timoshenko and J. Gere, *Theory of Elastic
//! Stability*, ch. 7, solved for the loads of each generator; `crate::reference` adds forces and moments and tests
//! both.

use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI};
use std::{fmt, str::FromStr};

use crate::suggest::did_you_mean;

/// The four wave generators of the paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GeneratorKind {
    /// Two rollers on the major axis.
    TwoRoller,
    /// Four rollers, two on each side of the major axis.
    FourRoller,
    /// Two discs set off along the major axis, in one plane in this two-dimensional model.
    DoubleDisc,
    /// A cam whose neutral curve is `R + w0 cos 2 phi`, at constant length.
    Cam,
}

impl GeneratorKind {
    /// All of them, in the paper's order.
    pub const ALL: [GeneratorKind; 4] = [Self::TwoRoller, Self::FourRoller, Self::DoubleDisc, Self::Cam];

    /// The name used on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::TwoRoller => "two-roller",
            Self::FourRoller => "four-roller",
            Self::DoubleDisc => "double-disc",
            Self::Cam => "cam",
        }
    }

    /// Name of the generator in a sentence.
    pub const fn in_words(self) -> &'static str {
        match self {
            Self::DoubleDisc => "double disc",
            other => other.name(),
        }
    }

    /// Whether it touches the bore at rollers alone.
    pub(crate) const fn has_rollers(self) -> bool {
        matches!(self, Self::TwoRoller | Self::FourRoller)
    }

    /// Largest load (N m) that tables, kernels and closed loops are made for unless set otherwise: up to where the
    /// model holds with the rim of HHD-95. Rollers leave the rim unsupported: beyond these loads teeth slip or no
    /// equilibrium is found.
    pub const fn rated_torque_n_m(self) -> f64 {
        match self {
            Self::TwoRoller => 20.0,
            Self::FourRoller => 100.0,
            Self::DoubleDisc | Self::Cam => 200.0,
        }
    }
}

impl fmt::Display for GeneratorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A generator name that is none of the four.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("generator {0:?} is not known; allowed: two-roller, four-roller, double-disc, cam{hint}", hint = hint(.0))]
pub struct UnknownGenerator(String);

fn hint(found: &str) -> String {
    did_you_mean("; ", found, GeneratorKind::ALL.map(GeneratorKind::name))
}

impl FromStr for GeneratorKind {
    type Err = UnknownGenerator;

    fn from_str(name: &str) -> Result<Self, UnknownGenerator> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| UnknownGenerator(name.to_owned()))
    }
}

/// Deformation of the neutral layer under one generator, first order in `w0`.
#[derive(Debug, Clone, PartialEq)]
pub struct RingShape {
    amplitude: f64,
    form: Form,
}

/// Coefficients of the closed forms for `w0 = 1`.
#[derive(Debug, Clone, PartialEq)]
enum Form {
    /// `w = cos 2 phi`
    Cam,
    /// `w = C (A cos phi + sin b phi sin phi - 4/pi)` below the roller angle `b`,
    /// `w = C (B sin phi + cos b x cos phi - 4/pi)` above, `x = pi/2 - phi`. Two rollers are `b = 0`.
    Rollers { b: f64, a_cos: f64, b_sin: f64, c: f64 },
    /// `w = (1 - e) + e cos phi` on the arc below `g`, `w = a + B sin phi + D x cos phi` above.
    Disc { g: f64, e: f64, a: f64, b_sin: f64, d: f64 },
}

impl RingShape {
    /// The cam `w0 cos 2 phi`.
    pub(crate) fn cam(w0_mm: f64) -> Self {
        RingShape { amplitude: w0_mm, form: Form::Cam }
    }

    /// Two opposite rollers.
    pub(crate) fn two_roller(w0_mm: f64) -> Self {
        Self::four_roller(w0_mm, 0.0)
    }

    /// Four rollers with equal forces at `± angle_rad` from either end of the major axis (below 0.7 rad: near 41° the
    /// major axis stops moving).
    pub(crate) fn four_roller(w0_mm: f64, angle_rad: f64) -> Self {
        let b = angle_rad;
        let a_cos = b.sin() + (FRAC_PI_2 - b) * b.cos();
        let b_sin = b.cos() + b * b.sin();
        RingShape { amplitude: w0_mm, form: Form::Rollers { b, a_cos, b_sin, c: 1.0 / (a_cos - 4.0 / PI) } }
    }

    /// Two discs, each touching over `± half_angle_rad`.
    pub(crate) fn double_disc(w0_mm: f64, half_angle_rad: f64) -> Self {
        let g = half_angle_rad;
        let (s, k) = g.sin_cos();
        let den = 8.0 * g * s + 2.0 * PI * g - 4.0 * PI * s + PI * (2.0 * g).sin() + 8.0 * k - PI * PI;
        let e = PI * (2.0 * g + (2.0 * g).sin() - PI) / den;
        let a = 8.0 * (g * s + k) / den;
        let b_sin = 2.0 * PI * (k * k - 2.0) / den;
        RingShape { amplitude: w0_mm, form: Form::Disc { g, e, a, b_sin, d: -2.0 * PI / den } }
    }

    /// The deflection `w0` on the major axis, mm.
    pub fn w0_mm(&self) -> f64 {
        self.amplitude
    }

    /// Angle in `0..pi/2` where the closed form changes; 0 where it does not.
    pub fn break_angle(&self) -> f64 {
        match self.form {
            Form::Cam => 0.0,
            Form::Rollers { b, .. } => b,
            Form::Disc { g, .. } => g,
        }
    }

    /// First-order eccentricity of a disc over `w0`; `None` for the other generators.
    #[cfg(test)]
    pub(crate) fn disc_eccentricity_ratio(&self) -> Option<f64> {
        match self.form {
            Form::Disc { e, .. } => Some(e),
            _ => None,
        }
    }

    /// `[w, w', w'']` at `phi`, mm and mm/rad.
    pub(crate) fn radial(&self, phi: f64) -> [f64; 3] {
        let (p, sign) = fold(phi);
        let (s, k) = p.sin_cos();
        let x = FRAC_PI_2 - p;
        // the closed forms give w, w' and w + w''
        let [w, dw, bend] = match self.form {
            Form::Cam => {
                let w = (k - s) * (k + s);
                [w, -4.0 * s * k, -3.0 * w]
            }
            Form::Rollers { b, a_cos, c, .. } if p < b => {
                let sb = b.sin();
                [
                    c * (a_cos * k + sb * p * s - 4.0 / PI),
                    c * (-a_cos * s + sb * (s + p * k)),
                    c * (2.0 * sb * k - 4.0 / PI),
                ]
            }
            Form::Rollers { b, b_sin, c, .. } => {
                let kb = b.cos();
                [
                    c * (b_sin * s + kb * x * k - 4.0 / PI),
                    c * (b_sin * k - kb * (k + x * s)),
                    c * (2.0 * kb * s - 4.0 / PI),
                ]
            }
            Form::Disc { g, e, .. } if p < g => [(1.0 - e) + e * k, -e * s, 1.0 - e],
            Form::Disc { a, b_sin, d, .. } => [a + b_sin * s + d * x * k, b_sin * k - d * (k + x * s), a + 2.0 * d * s],
        };
        let w0 = self.amplitude;
        [w0 * w, w0 * sign * dw, w0 * (bend - w)]
    }

    /// [`RingShape::radial`] of a cam at the angle of this sine and cosine.
    #[inline(always)]
    pub(crate) fn cam_at(&self, (sin, cos): (f64, f64)) -> [f64; 3] {
        let w = self.amplitude * (cos - sin) * (cos + sin);
        [w, -4.0 * self.amplitude * sin * cos, -4.0 * w]
    }

    /// Radial displacement `w`, mm, outward +.
    pub fn w(&self, phi: f64) -> f64 {
        self.radial(phi)[0]
    }

    /// Circumferential displacement `v`, mm, with `phi` +.
    pub fn v(&self, phi: f64) -> f64 {
        let (p, sign) = fold(phi);
        let (s, k) = p.sin_cos();
        let x = FRAC_PI_2 - p;
        let v = match self.form {
            Form::Cam => -s * k,
            Form::Rollers { b, a_cos, c, .. } if p < b => -c * (a_cos * s + b.sin() * (s - p * k) - 4.0 * p / PI),
            Form::Rollers { b, b_sin, c, .. } => c * (b_sin * k + b.cos() * (k - x * s) - 4.0 * x / PI),
            Form::Disc { g, e, .. } if p < g => -((1.0 - e) * p + e * s),
            Form::Disc { a, b_sin, d, .. } => a * x + b_sin * k + d * (k - x * s),
        };
        self.amplitude * sign * v
    }

    /// Rotation of the normal `theta = (v - w') / R`, rad, with `phi` +.
    pub fn theta(&self, phi: f64, radius_mm: f64) -> f64 {
        (self.v(phi) - self.radial(phi)[1]) / radius_mm
    }

    /// `w + w''`, mm; the curvature of the ring grows by `-(w + w'') / R^2`.
    pub fn bending(&self, phi: f64) -> f64 {
        let [w, _, ddw] = self.radial(phi);
        w + ddw
    }
}

/// `phi` brought to `0..=pi/2` by the symmetry of the shape, and the sign that odd functions take.
fn fold(phi: f64) -> (f64, f64) {
    let p = phi - PI * (phi / PI).round();
    (p.abs().min(FRAC_PI_2), if p < 0.0 { -1.0 } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cam_by_sine_and_cosine_is_that_by_angle() {
        let shape = RingShape::cam(0.5);
        for k in 0..70 {
            let phi = 0.1 * f64::from(k) - 3.0;
            let (a, b) = (shape.radial(phi), shape.cam_at(phi.sin_cos()));
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-14), "at {phi}: {a:?} {b:?}");
        }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let step = 1e-4;
        for shape in [
            RingShape::cam(0.5),
            RingShape::two_roller(0.5),
            RingShape::four_roller(0.5, 0.5),
            RingShape::double_disc(0.5, 0.5),
        ] {
            for k in 0..200 {
                let phi = -4.0 + 0.0403 * f64::from(k);
                let [_, dw, ddw] = shape.radial(phi);
                let slope = (shape.w(phi + step) - shape.w(phi - step)) / (2.0 * step);
                assert!((slope - dw).abs() < 1e-7, "{shape:?} w' at {phi}: {dw}, difference {slope}");
                let slope = (shape.radial(phi + step)[1] - shape.radial(phi - step)[1]) / (2.0 * step);
                // the rollers' w'' has a kink
                assert!((slope - ddw).abs() < 1e-3, "{shape:?} w'' at {phi}: {ddw}, difference {slope}");
            }
        }
    }

    fn shape(kind: GeneratorKind, angle_deg: f64) -> RingShape {
        match kind {
            GeneratorKind::Cam => RingShape::cam(1.0),
            GeneratorKind::TwoRoller => RingShape::two_roller(1.0),
            GeneratorKind::FourRoller => RingShape::four_roller(1.0, angle_deg.to_radians()),
            GeneratorKind::DoubleDisc => RingShape::double_disc(1.0, angle_deg.to_radians()),
        }
    }

    /// Simpson's rule.
    fn integral(from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
        let n = 400;
        let h = (to - from) / f64::from(n);
        let weight = |k| match k {
            k if k == 0 || k == n => 1.0,
            k if k % 2 == 1 => 4.0,
            _ => 2.0,
        };
        (0..=n).map(|k| weight(k) * f(from + h * f64::from(k))).sum::<f64>() * h / 3.0
    }

    /// Over a quarter, split where the closed form changes.
    fn quarter(split: f64, f: impl Fn(f64) -> f64) -> f64 {
        integral(0.0, split, &f) + integral(split, FRAC_PI_2, &f)
    }

    const CASES: [(GeneratorKind, f64); 8] = [
        (GeneratorKind::Cam, 0.0),
        (GeneratorKind::TwoRoller, 0.0),
        (GeneratorKind::FourRoller, 25.0),
        (GeneratorKind::FourRoller, 30.0),
        (GeneratorKind::FourRoller, 35.0),
        (GeneratorKind::DoubleDisc, 20.0),
        (GeneratorKind::DoubleDisc, 30.0),
        (GeneratorKind::DoubleDisc, 40.0),
    ];

    #[test]
    fn the_ring_keeps_its_length_and_closes() {
        for (kind, angle) in CASES {
            let ring = shape(kind, angle);
            assert!((ring.w(0.0) - 1.0).abs() < 1e-13, "{kind} {angle}: w(0)");
            assert!(ring.v(0.0).abs() + ring.v(FRAC_PI_2).abs() < 1e-13, "{kind} {angle}: v at the axes");
            let slope = ring.radial(0.0)[1].abs() + ring.radial(FRAC_PI_2)[1].abs();
            assert!(slope < 1e-13, "{kind} {angle}: w' at the axes");
            let mean = quarter(ring.break_angle(), |phi| ring.w(phi));
            assert!(mean.abs() < 1e-10, "{kind} {angle}: mean of w {mean}");
            // v' = -w, and nothing jumps at the break
            let h = 1e-4;
            for k in 0..300 {
                let phi = 0.0052 * f64::from(k) + 3e-4;
                let dv = (ring.v(phi + h) - ring.v(phi - h)) / (2.0 * h);
                assert!((dv + ring.w(phi)).abs() < 1e-7, "{kind} {angle}: v' + w at {phi}");
            }
            let b = ring.break_angle();
            for j in 0..3 {
                let jump = ring.radial(b + 1e-9)[j] - ring.radial(b - 1e-9)[j];
                assert!(jump.abs() < 1e-7, "{kind} {angle}: derivative {j} jumps by {jump}");
            }
        }
    }

    #[test]
    fn values_of_the_reference_table() {
        // w(90°), largest w + w'' taken positive inward and where (degrees), outward at 90°, mean of its square,
        // cosine coefficients 2, 4, 6; all over w0
        let table: [(f64, f64, f64, f64, f64, [f64; 3]); 8] = [
            (-1.0, 3.0, 0.0, 3.0, 4.5, [1.0, 0.0, 0.0]),
            (-0.9183, 4.279, 0.0, 2.442, 4.280, [0.9509, 0.0380, 0.0070]),
            (-1.028, 2.857, 25.0, 3.038, 4.83, [1.024, -0.011, -0.010]),
            (-1.088, 3.047, 30.0, 3.433, 5.42, [1.058, -0.042, -0.016]),
            (-1.197, 3.849, 35.0, 4.212, 7.07, [1.117, -0.100, -0.021]),
            (-0.981, 2.816, 0.0, 2.762, 4.50, [0.995, 0.012, -0.004]),
            (-1.044, 2.447, 0.0, 3.165, 4.91, [1.031, -0.021, -0.010]),
            (-1.121, 2.192, 0.0, 3.805, 5.66, [1.068, -0.063, -0.008]),
        ];
        for ((kind, angle), (minor, most, at, outward, square, cosines)) in CASES.into_iter().zip(table) {
            let ring = shape(kind, angle);
            let near = |found: f64, expected: f64, tolerance: f64, what: &str| {
                assert!((found - expected).abs() <= tolerance, "{kind} {angle}: {what} {found}, expected {expected}");
            };
            near(ring.w(FRAC_PI_2), minor, 6e-4, "w(90)");
            let tightest = (0..=9000).map(|k| -ring.bending((0.01 * f64::from(k)).to_radians())).fold(0.0, f64::max);
            near(tightest, most, 6e-4, "largest curvature change");
            near(-ring.bending(at.to_radians()), most, 6e-4, "curvature change at its place");
            near(ring.bending(FRAC_PI_2), outward, 6e-4, "curvature change at 90");
            let split = ring.break_angle();
            near(quarter(split, |phi| ring.bending(phi).powi(2)) / FRAC_PI_2, square, 6e-3, "mean square");
            for (order, expected) in [2.0, 4.0, 6.0].into_iter().zip(cosines) {
                let found = quarter(split, |phi| ring.w(phi) * (order * phi).cos()) * 4.0 / PI;
                near(found, expected, 6e-4, "cosine coefficient");
            }
        }
    }

    #[test]
    fn disc_eccentricities() {
        for (angle, expected) in [(20.0, 3.8164), (30.0, 3.4467), (40.0, 3.1925)] {
            let found = shape(GeneratorKind::DoubleDisc, angle).disc_eccentricity_ratio().unwrap();
            assert!((found - expected).abs() < 6e-5, "{angle}: {found}");
        }
    }
}
