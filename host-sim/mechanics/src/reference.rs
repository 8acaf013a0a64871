//! The path of a flexspline tooth past a circular-spline tooth by the formulae (1)-(10) of Pacana, Siwiec, Pacana et
//! al.,
//! *Numerical analysis of the kinematic accuracy of the hermetic harmonic drive in space vehicles*, Appl. Sci. 13
//! (2023).
//!
//! Frame fixed to the circular spline, its origin on the undeformed neutral radius `R` on the axis of the tooth that is
//! met at the minor axis: `w` counts outward from `R`, `v` counter-clockwise. The angle `phi` is that of the tooth
//! from the major axis (the only reading of (5) and (6) without contradiction: at the minor axis, `phi = pi/2`, tooth
//! stands on tooth, at the major axis, `phi = 0`, it is half a pitch `(pi/2)/i = pi/z_c` away, in the space).
//!
//! The formulae are first order: against exact kinematics they are off by up to 6 µm radially, of which 5.3 µm is the
//! second-order constant of [`crate::drive::NeutralCurve`]. Good for a drawing, not for a flank gap of 7 µm.

use crate::drive::{Drive, GeneratorKind, RingShape};
use std::f64::consts::FRAC_PI_2;

/// A point in the paper's frame, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToothPathPoint {
    /// Outward from the undeformed neutral radius.
    pub w_mm: f64,
    /// Circumferential, counter-clockwise.
    pub v_mm: f64,
}

/// Tooth tip and tooth root along the mesh cycle.
#[derive(Debug, Clone)]
pub struct ToothPath {
    shape: RingShape,
    /// `R`, mm
    neutral_radius: f64,
    /// `r_a1`, mm
    flexspline_tip: f64,
    /// `r_a2`, `r_f2`, mm
    circular_spline_tip: f64,
    circular_spline_root: f64,
    /// `i`
    ratio: f64,
}

impl ToothPath {
    /// The path in `drive` with the generator of `kind`.
    pub fn new(drive: &Drive, kind: GeneratorKind) -> Self {
        ToothPath {
            shape: drive.generator.shape(kind),
            neutral_radius: drive.flexspline.neutral_radius_mm(),
            flexspline_tip: drive.flexspline.tip_radius_mm,
            circular_spline_tip: drive.circular_spline.tip_radius_mm,
            circular_spline_root: drive.circular_spline.root_radius_mm,
            ratio: drive.ratio(),
        }
    }

    /// Tip of the circular-spline tooth, (1) and (3).
    pub fn circular_spline_tip(&self) -> ToothPathPoint {
        ToothPathPoint { w_mm: self.circular_spline_tip - self.neutral_radius, v_mm: 0.0 }
    }

    /// Root of the circular-spline tooth, (2) and (4).
    pub fn circular_spline_root(&self) -> ToothPathPoint {
        ToothPathPoint { w_mm: self.circular_spline_root - self.neutral_radius, v_mm: 0.0 }
    }

    /// Angle of the tooth from the major axis when the generator has turned by `turned_rad` from the minor axis, (5).
    pub fn angle_after(turned_rad: f64) -> f64 {
        FRAC_PI_2 - turned_rad
    }

    /// How far the circular-spline tooth has moved on from the flexspline tooth, rad, (6).
    pub(crate) fn output_angle(&self, phi: f64) -> f64 {
        (FRAC_PI_2 - phi) / self.ratio
    }

    /// Tip of the flexspline tooth on its axis, (7) and (9).
    pub fn flexspline_tip(&self, phi: f64) -> ToothPathPoint {
        self.point_at(self.flexspline_tip, phi)
    }

    fn point_at(&self, radius: f64, phi: f64) -> ToothPathPoint {
        let (w, v) = (self.shape.w(phi), self.shape.v(phi));
        let theta = self.shape.theta(phi, self.neutral_radius);
        let phi2 = self.output_angle(phi);
        ToothPathPoint {
            w_mm: (radius + w) * phi2.cos() - self.neutral_radius, // (7), (8)
            v_mm: v + (radius - self.neutral_radius) * theta - (radius + w) * phi2, // (9), (10)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::NeutralCurve;

    #[test]
    fn tooth_on_tooth_at_the_minor_axis_and_in_the_space_at_the_major_axis() {
        let drive = Drive::hhd_95();
        for kind in GeneratorKind::ALL {
            let path = ToothPath::new(&drive, kind);
            let minor = path.flexspline_tip(ToothPath::angle_after(0.0));
            assert!(
                minor.v_mm.abs() < 1e-12 && minor.w_mm < path.circular_spline_tip().w_mm - 0.2,
                "{kind}: {minor:?}"
            );
            let major = path.flexspline_tip(ToothPath::angle_after(FRAC_PI_2));
            let half_pitch = std::f64::consts::PI / 190.0;
            assert!((major.v_mm + (48.825 + 0.5) * half_pitch).abs() < 1e-9, "{kind}: {major:?}");
            // working depth 0.675, clearance to the root 0.125
            assert!((major.w_mm - path.circular_spline_tip().w_mm - 0.675).abs() < 0.007, "{kind}: {major:?}");
            assert!((path.circular_spline_root().w_mm - major.w_mm - 0.125).abs() < 0.007, "{kind}: {major:?}");
        }
    }

    #[test]
    fn the_formulae_against_exact_kinematics() {
        let drive = Drive::hhd_95();
        let radius = drive.flexspline.neutral_radius_mm();
        let path = ToothPath::new(&drive, GeneratorKind::Cam);
        let curve = NeutralCurve::new(drive.generator.shape(GeneratorKind::Cam), radius);
        let (mut radial, mut tangential) = (0.0_f64, 0.0_f64);
        for k in 0..=900 {
            let phi = (0.1 * f64::from(k)).to_radians();
            let ([x, y], normal) = curve.position(phi);
            let height = drive.flexspline.tip_radius_mm - radius;
            let (x, y) = (x + height * normal.cos(), y + height * normal.sin());
            let from_tooth_axis = y.atan2(x) - phi - path.output_angle(phi);
            let exact = [x.hypot(y) * from_tooth_axis.cos() - radius, x.hypot(y) * from_tooth_axis.sin()];
            let paper = path.flexspline_tip(phi);
            radial = radial.max((paper.w_mm - exact[0]).abs());
            tangential = tangential.max((paper.v_mm - exact[1]).abs());
        }
        assert!((5.3e-3..=5.95e-3).contains(&radial), "radially {radial} mm");
        assert!((0.5e-3..=1.25e-3).contains(&tangential), "tangentially {tangential} mm");
    }
}
