//! Forces, moments and stress of the thin ring under each wave generator, all per unit width.
//!
//! The ring bends by `M = E' I (w + w'') / R²` (moment taken positive where the curvature falls) and is inextensible.
//! From equilibrium of an unloaded arc the shear is `M'/R`, so a concentrated radial force is the jump of
//! `E' I (w + w'')' / R³` over its point, and a pressed arc of constant curvature carries its normal force
//! as a uniform pressure. `E' = E / (1 - nu²)` (plane strain), `I = s³/12`.
//!
//! Source: bending of a thin curved bar with circular axis, S. Timoshenko and J. Gere, *Theory of Elastic Stability*,
//! ch. 7. The displacements are [`RingShape`].

use crate::drive::{Drive, GeneratorKind, RingShape};
use std::f64::consts::{FRAC_PI_2, PI};

/// The bending of a smooth ring without teeth.
#[derive(Debug, Clone)]
pub struct RingBending {
    kind: GeneratorKind,
    shape: RingShape,
    radius_mm: f64,
    thickness_mm: f64,
    /// `E'`, MPa
    modulus_mpa: f64,
}

/// Load of the generator, outward, per mm of width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactLoads {
    /// Each concentrated radial force, N/mm: at the two rollers, the four rollers, or the four ends of the disc arcs.
    pub force_n_per_mm: f64,
    /// Angle of the force from the nearest end of the major axis, rad.
    pub force_angle_rad: f64,
    /// Uniform pressure on the disc arcs, MPa (zero for rollers).
    pub pressure_mpa: f64,
}

impl RingBending {
    /// The rim of `drive`, as if it had no teeth, under the generator of `kind`.
    pub fn of_rim(drive: &Drive, kind: GeneratorKind) -> Self {
        RingBending {
            kind,
            shape: drive.generator.shape(kind),
            radius_mm: drive.flexspline.neutral_radius_mm(),
            thickness_mm: drive.flexspline.rim_thickness_mm,
            modulus_mpa: drive.material.plane_strain_modulus_mpa(),
        }
    }

    /// Bending stiffness `E' I` per width, N·mm.
    pub(crate) fn stiffness_n_mm(&self) -> f64 {
        self.modulus_mpa * self.thickness_mm.powi(3) / 12.0
    }

    /// Change of curvature `-(w + w'') / R²`, 1/mm, positive where the ring bends tighter.
    #[cfg(test)]
    pub(crate) fn curvature_change(&self, phi: f64) -> f64 {
        -self.shape.bending(phi) / (self.radius_mm * self.radius_mm)
    }

    /// Bending stress at the outer fibre, MPa, tension positive: `E' (s/2)` times the change of curvature.
    #[cfg(test)]
    pub(crate) fn outer_stress_mpa(&self, phi: f64) -> f64 {
        self.modulus_mpa * 0.5 * self.thickness_mm * self.curvature_change(phi)
    }

    /// Loads of the generator; `None` for the cam, whose pressure is spread over its whole circumference.
    pub fn contact_loads(&self) -> Option<ContactLoads> {
        let unit = self.stiffness_n_mm() / self.radius_mm.powi(3);
        let w0 = self.shape.w0_mm();
        let b = self.shape.break_angle();
        let (force, pressure) = match self.kind {
            GeneratorKind::Cam => return None,
            GeneratorKind::TwoRoller => (4.0 * w0 / (FRAC_PI_2 - 4.0 / PI), 0.0),
            GeneratorKind::FourRoller => {
                let a = b.sin() + (FRAC_PI_2 - b) * b.cos();
                (2.0 * w0 / (a - 4.0 / PI), 0.0)
            }
            GeneratorKind::DoubleDisc => {
                // w + w'' = a + 2 D sin phi beyond the arc
                let two_d = (self.shape.bending(FRAC_PI_2) - self.shape.bending(b)) / (1.0 - b.sin());
                (two_d * b.cos(), two_d * b.sin() / self.radius_mm)
            }
        };
        Some(ContactLoads { force_n_per_mm: unit * force, force_angle_rad: b, pressure_mpa: unit * pressure })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn the_loads_do_the_work_that_bends_the_ring() {
        // Clapeyron: sum of force times displacement = integral of E' I (w + w'')² / R³
        for kind in [GeneratorKind::TwoRoller, GeneratorKind::FourRoller, GeneratorKind::DoubleDisc] {
            let ring = RingBending::of_rim(&Drive::hhd_95(), kind);
            let loads = ring.contact_loads().unwrap();
            let split = ring.shape.break_angle();
            let r = ring.radius_mm;
            let energy =
                4.0 * quarter(split, |phi| ring.shape.bending(phi).powi(2)) * ring.stiffness_n_mm() / r.powi(3);
            let forces = if kind == GeneratorKind::TwoRoller { 2.0 } else { 4.0 };
            let by_forces = forces * loads.force_n_per_mm * ring.shape.w(loads.force_angle_rad);
            let arc = integral(0.0, split, |phi| loads.pressure_mpa * r * ring.shape.w(phi));
            let work = by_forces + 4.0 * arc;
            assert!((work / energy - 1.0).abs() < 1e-9, "{kind}: {work} against {energy}");
        }
    }

    #[test]
    fn forces_and_stresses_of_the_default_design() {
        let ring = |kind| RingBending::of_rim(&Drive::hhd_95(), kind);
        let two = ring(GeneratorKind::TwoRoller);
        let unit = two.stiffness_n_mm() * 0.5 / two.radius_mm.powi(3);
        assert!((two.contact_loads().unwrap().force_n_per_mm / unit - 13.443).abs() < 6e-4);
        let four = ring(GeneratorKind::FourRoller).contact_loads().unwrap();
        assert!((four.force_n_per_mm / unit - 2.0 / 0.133660).abs() < 1e-3);
        assert!(ring(GeneratorKind::Cam).contact_loads().is_none());
        let largest = |kind| {
            let ring = ring(kind);
            (0..=900).map(|k| ring.outer_stress_mpa((0.1 * f64::from(k)).to_radians()).abs()).fold(0.0, f64::max)
        };
        for (kind, mpa) in [
            (GeneratorKind::Cam, 91.0),
            (GeneratorKind::TwoRoller, 130.0),
            (GeneratorKind::FourRoller, 104.0),
            (GeneratorKind::DoubleDisc, 96.0),
        ] {
            assert!((largest(kind) - mpa).abs() < 0.7, "{kind}: {} MPa", largest(kind));
        }
        // on the major axis the ring is bent tighter: tension outside
        assert!(two.outer_stress_mpa(0.0) > 0.0 && two.outer_stress_mpa(FRAC_PI_2) < 0.0);
    }
}
