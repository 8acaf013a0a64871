//! The active flank of a tooth as a distance field: the flank and its tip rounding, in closed form.
//!
//! Parallel curves of an involute are the same involute turned about the base circle, so the distance of a point at
//! polar `(rho, theta)` is `r_b (H(rho) - theta)` with `H(rho)` the half angle of the flank at radius rho: exact,
//! without a search. An S-shaped flank is a chain of arcs, and the distance that to the nearest of them.

use super::arcs::ArcChain;
use super::tooth::{FlankShape, PieceKind, ToothFlank};
use std::sync::Arc;

/// Flank on the positive-angle side, with the rounding at the tip.
#[derive(Debug, Clone, PartialEq)]
pub struct ActiveFlank {
    curve: FlankCurve,
    /// Radius where the root fillet ends and the flank begins, mm.
    pub start_radius: f64,
    /// Radius where the flank ends and the rounding begins, mm.
    pub junction_radius: f64,
    /// Radius of the tip circle, mm.
    pub tip_radius: f64,
    /// Point and arc length of that joint.
    junction: [f64; 2],
    junction_arc: f64,
    /// Centre of the rounding.
    rounding_centre: [f64; 2],
    /// Radius of the rounding, mm.
    pub rounding_radius: f64,
    /// Angle subtended by the rounding, rad.
    pub rounding_sweep: f64,
}

#[derive(Debug, Clone, PartialEq)]
enum FlankCurve {
    Involute(Involute),
    /// In growing radius: material on the right of a tooth, on the left of a space.
    Chain(Arc<ArcChain>),
}

/// An involute on the positive-angle side.
#[derive(Debug, Clone, PartialEq)]
struct Involute {
    base_radius: f64,
    /// Half angle of the flank at the base circle, rad.
    half_base: f64,
    /// Roll angle half way up the flank, tangent of the pressure angle there, and `half_base` plus that pressure angle.
    middle_roll: f64,
    half_base_and_middle: f64,
}

/// Foot of a point on the flank.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foot {
    /// Signed distance, positive outside the material, mm.
    pub distance: f64,
    /// Unit normal out of the material.
    pub normal: [f64; 2],
    /// Unit tangent in the direction of growing radius on the flank, continued round the tip.
    pub tangent: [f64; 2],
    /// Radius of the foot (mm); on the rounding, the radius of the foot there.
    pub radius: f64,
    /// d(radius)/d(arc length) at the foot along the tangent.
    pub radius_rate: f64,
    /// Arc length of the foot along the flank, growing with the tangent, mm (of an involute zero where it leaves its
    /// base circle).
    pub arc: f64,
}

impl Involute {
    /// Arc length, from where it leaves its base circle, at a radius.
    fn arc_at(&self, radius: f64) -> f64 {
        0.5 * (radius * radius - self.base_radius * self.base_radius).max(0.0) / self.base_radius
    }

    fn half_angle(&self, radius: f64) -> f64 {
        self.half_base - involute_function(radius / self.base_radius)
    }

    fn point(&self, radius: f64) -> [f64; 2] {
        let (s, c) = self.half_angle(radius).sin_cos();
        [radius * c, radius * s]
    }

    /// Length of the tangent from a point to the base circle, and signed distance of the point from the involute
    /// continued beyond its ends.
    ///
    /// `r_b (H(rho) - theta)`, `H = half_base - roll + atan roll`, the two arc tangents taken as one of a small
    /// argument: `atan roll - theta = atan(middle) + atan z`.
    #[inline(always)]
    fn distance(&self, p: [f64; 2]) -> (f64, f64) {
        let rho_squared = p[0] * p[0] + p[1] * p[1];
        let along = (rho_squared - self.base_radius * self.base_radius).max(1e-12).sqrt();
        let roll = along / self.base_radius;
        let (beyond, both) = (roll - self.middle_roll, 1.0 + roll * self.middle_roll);
        let z = (beyond * p[0] - both * p[1]) / (both * p[0] + beyond * p[1]);
        let angle = if z.abs() < SMALL_TANGENT && p[0] > 0.0 {
            self.half_base_and_middle - roll + small_arc_tangent(z)
        } else {
            self.half_base - (roll - roll.atan()) - p[1].atan2(p[0])
        };
        (along, self.base_radius * angle)
    }

    /// Foot of a point on the flank of a space; nothing beyond the joint with the rounding.
    #[inline(always)]
    fn foot_internal(&self, p: [f64; 2], junction_radius: f64) -> Option<Foot> {
        let (along, distance) = self.distance(p);
        let foot_along = along + distance;
        let radius = (self.base_radius * self.base_radius + foot_along * foot_along).sqrt();
        if radius < junction_radius {
            return None;
        }
        // Normal into the space: -(sin a e_rho + cos a e_theta), a the pressure angle at rho; sine and cosine over rho.
        let rho_squared = p[0] * p[0] + p[1] * p[1];
        let (sin, cos) = (along / rho_squared, self.base_radius / rho_squared);
        let normal = [-(sin * p[0] - cos * p[1]), -(sin * p[1] + cos * p[0])];
        let tangent = [cos * p[0] + sin * p[1], cos * p[1] - sin * p[0]];
        let arc = 0.5 * foot_along * foot_along / self.base_radius;
        Some(Foot { distance, normal, tangent, radius, radius_rate: self.base_radius / radius, arc })
    }
}

impl ActiveFlank {
    /// From the outline of a tooth (or space).
    pub fn new(outline: &ToothFlank) -> ActiveFlank {
        let flank = outline.piece(PieceKind::Flank);
        let rounding = outline.piece(PieceKind::TipRounding);
        let radius = |p: [f64; 2]| p[0].hypot(p[1]);
        let (start_radius, junction_radius) = (radius(flank.point(0.0)), radius(flank.point(1.0)));
        let rounding_radius = 1.0 / rounding.curvature(0.5).abs();
        let (p, n) = (rounding.point(0.0), rounding.normal(0.0));
        let curve = match outline.shape() {
            &FlankShape::Involute { base_radius, half_base } => {
                let middle = 0.5 * (start_radius + junction_radius) / base_radius;
                let middle_roll = (middle * middle - 1.0).max(0.0).sqrt();
                FlankCurve::Involute(Involute {
                    base_radius,
                    half_base,
                    middle_roll,
                    half_base_and_middle: half_base + middle_roll.atan(),
                })
            }
            FlankShape::Chain(chain) => FlankCurve::Chain(Arc::clone(chain)),
        };
        let mut found = ActiveFlank {
            curve,
            start_radius,
            junction_radius,
            tip_radius: outline.root_and_tip_radius().1,
            junction: p,
            junction_arc: 0.0,
            rounding_centre: [p[0] - rounding_radius * n[0], p[1] - rounding_radius * n[1]],
            rounding_radius,
            rounding_sweep: rounding.length() / rounding_radius,
        };
        found.junction_arc = found.arc_at(junction_radius);
        found
    }

    /// Whether both wheels have curved flanks that meet in their middle, not at their tips.
    pub(crate) fn is_s_shaped(&self) -> bool {
        matches!(self.curve, FlankCurve::Chain(_))
    }

    /// Arc length of the flank at a radius, as [`Foot::arc`] counts it, mm.
    pub(crate) fn arc_at(&self, radius: f64) -> f64 {
        match &self.curve {
            FlankCurve::Involute(involute) => involute.arc_at(radius),
            FlankCurve::Chain(chain) => chain.arc_at_radius(radius),
        }
    }

    /// Half angle of the flank at a radius (also beyond the junction), rad.
    pub(crate) fn half_angle(&self, radius: f64) -> f64 {
        match &self.curve {
            FlankCurve::Involute(involute) => involute.half_angle(radius),
            FlankCurve::Chain(_) => {
                let [x, y] = self.point(radius);
                y.atan2(x)
            }
        }
    }

    /// Point of the flank at a radius (also beyond the junction, up to the sharp tip corner).
    pub fn point(&self, radius: f64) -> [f64; 2] {
        match &self.curve {
            FlankCurve::Involute(involute) => involute.point(radius),
            FlankCurve::Chain(chain) => chain.point(chain.arc_at_radius(radius)),
        }
    }

    /// d(arc length)/d(radius) of the flank.
    pub(crate) fn arc_rate(&self, radius: f64) -> f64 {
        match &self.curve {
            FlankCurve::Involute(involute) => radius / involute.base_radius,
            FlankCurve::Chain(chain) => {
                let s = chain.arc_at_radius(radius);
                let ([x, y], t) = (chain.point(s), chain.tangent(s));
                x.hypot(y) / (x * t[0] + y * t[1])
            }
        }
    }

    /// Lever arm of the normal about the axis, half way up the flank, mm: of an involute everywhere, its base radius.
    pub(crate) fn lever(&self) -> f64 {
        let middle = 0.5 * (self.start_radius + self.junction_radius);
        middle / self.arc_rate(middle)
    }

    /// Point of the rounding at an angle from the junction towards the tip land (0 to `rounding_sweep`).
    pub(crate) fn rounding_point(&self, angle: f64) -> [f64; 2] {
        let arm = [self.junction[0] - self.rounding_centre[0], self.junction[1] - self.rounding_centre[1]];
        // On the positive side the outline turns clockwise round the tip, of a tooth as of a space.
        let (s, c) = (-angle).sin_cos();
        [self.rounding_centre[0] + c * arm[0] - s * arm[1], self.rounding_centre[1] + s * arm[0] + c * arm[1]]
    }

    /// Unit normal at the joint of flank and rounding.
    fn junction_normal(&self) -> [f64; 2] {
        [0, 1].map(|k| (self.junction[k] - self.rounding_centre[k]) / self.rounding_radius)
    }

    /// Signed distance of a point from the flank of a space continued beyond its ends. A tip rounding lies behind it:
    /// the distance to the flank with its rounding is at least this.
    #[inline]
    pub(crate) fn least_distance(&self, p: [f64; 2]) -> f64 {
        match &self.curve {
            FlankCurve::Involute(involute) => involute.distance(p).1,
            FlankCurve::Chain(chain) => -chain.foot(p).left,
        }
    }

    /// Radius of the foot of a point on the flank of a space continued beyond its ends.
    #[inline]
    pub(crate) fn foot_radius(&self, p: [f64; 2]) -> f64 {
        match &self.curve {
            FlankCurve::Involute(involute) => {
                let (along, distance) = involute.distance(p);
                involute.base_radius.hypot(along + distance)
            }
            FlankCurve::Chain(chain) => {
                let [x, y] = chain.point(chain.foot(p).arc);
                x.hypot(y)
            }
        }
    }

    /// Foot of a point on the flank of a space (internal wheel), in the frame of that space.
    #[inline(always)]
    pub fn foot_internal(&self, p: [f64; 2]) -> Foot {
        let on_flank = match &self.curve {
            FlankCurve::Involute(involute) => involute.foot_internal(p, self.junction_radius),
            FlankCurve::Chain(chain) => self.foot_on_chain(chain, p),
        };
        on_flank.unwrap_or_else(|| self.foot_on_rounding(p))
    }

    /// Foot on a chain, whose material lies to the left; nothing beyond the joint with the rounding.
    fn foot_on_chain(&self, chain: &ArcChain, p: [f64; 2]) -> Option<Foot> {
        let foot = chain.foot(p);
        if foot.arc < self.junction_arc {
            return None;
        }
        let [tx, ty] = foot.tangent;
        let on = [p[0] + foot.left * ty, p[1] - foot.left * tx];
        let radius = on[0].hypot(on[1]);
        Some(Foot {
            distance: -foot.left,
            normal: [ty, -tx],
            tangent: foot.tangent,
            radius,
            radius_rate: (on[0] * tx + on[1] * ty) / radius,
            arc: foot.arc,
        })
    }

    #[inline(always)]
    fn foot_on_rounding(&self, p: [f64; 2]) -> Foot {
        let arm = [p[0] - self.rounding_centre[0], p[1] - self.rounding_centre[1]];
        let length = (arm[0] * arm[0] + arm[1] * arm[1]).sqrt().max(1e-12);
        let normal = [arm[0] / length, arm[1] / length];
        let tangent = [-normal[1], normal[0]];
        let foot = [
            self.rounding_centre[0] + self.rounding_radius * normal[0],
            self.rounding_centre[1] + self.rounding_radius * normal[1],
        ];
        let radius = (foot[0] * foot[0] + foot[1] * foot[1]).sqrt();
        let radius_rate = (foot[0] * tangent[0] + foot[1] * tangent[1]) / radius;
        // The tangent follows on from that of the flank, which grows in radius.
        let (tangent, radius_rate) =
            if radius_rate < 0.0 { (tangent.map(|x| -x), -radius_rate) } else { (tangent, radius_rate) };
        let start = self.junction_normal();
        let turned = (start[0] * normal[1] - start[1] * normal[0]).abs().asin();
        let arc = self.junction_arc - self.rounding_radius * turned;
        Foot { distance: length - self.rounding_radius, normal, tangent, radius, radius_rate, arc }
    }
}

/// Tangents below which the series of [`small_arc_tangent`] is exact to round-off: the first term left out is 2e-21.
const SMALL_TANGENT: f64 = 0.05;

/// Arc tangent of a small number.
#[inline]
fn small_arc_tangent(z: f64) -> f64 {
    let s = z * z;
    z * (1.0 - s * (1.0 / 3.0 - s * (1.0 / 5.0 - s * (1.0 / 7.0 - s * (1.0 / 9.0 - s * (1.0 / 11.0 - s / 13.0))))))
}

/// inv a = tan a - a with cos a = 1 / ratio.
fn involute_function(ratio: f64) -> f64 {
    let tan = (ratio * ratio - 1.0).max(0.0).sqrt();
    tan - tan.atan()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;

    fn involute(flank: &ActiveFlank) -> &Involute {
        match &flank.curve {
            FlankCurve::Involute(involute) => involute,
            FlankCurve::Chain(_) => panic!("no involute"),
        }
    }

    fn space() -> (ActiveFlank, ToothFlank) {
        let outline = ToothFlank::internal(&Drive::hhd_95()).unwrap();
        (ActiveFlank::new(&outline), outline)
    }

    #[test]
    fn distance_along_a_normal_is_exact() {
        let (flank, outline) = space();
        for kind in [PieceKind::Flank, PieceKind::TipRounding] {
            let piece = outline.piece(kind);
            for t in [0.02, 0.3, 0.7, 0.98] {
                for d in [-0.01, 0.0, 0.004, 0.05] {
                    let (p, n) = (piece.point(t), piece.normal(t));
                    let foot = flank.foot_internal([p[0] + d * n[0], p[1] + d * n[1]]);
                    assert!((foot.distance - d).abs() < 1e-12, "{kind:?} {t} {d}: {}", foot.distance);
                    assert!((foot.normal[0] - n[0]).abs() + (foot.normal[1] - n[1]).abs() < 1e-12);
                    assert!((foot.radius - p[0].hypot(p[1])).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn the_distance_by_series_is_the_distance_by_arc_tangents() {
        let (flank, _) = space();
        let flank = involute(&flank);
        let mut by_series = 0;
        for k in 0..400 {
            let (r, angle) = (47.5 + 0.006 * f64::from(k), 0.05 * (2.4 * f64::from(k)).sin());
            let p = [r * angle.cos(), r * angle.sin()];
            let along = (r * r - flank.base_radius * flank.base_radius).sqrt();
            let roll = along / flank.base_radius;
            let expected = flank.base_radius * (flank.half_base - (roll - roll.atan()) - angle);
            let (tangent, distance) = flank.distance(p);
            assert!(
                (distance - expected).abs() < 2e-14 && (tangent - along).abs() < 1e-11,
                "{p:?}: {distance} {expected}"
            );
            by_series += usize::from((roll.atan() - flank.middle_roll.atan() - angle).abs() < SMALL_TANGENT);
        }
        assert!(by_series > 250 && by_series < 400);
        for k in -10..=10 {
            let z = 0.005 * f64::from(k);
            assert!((small_arc_tangent(z) - z.atan()).abs() < 1e-17);
        }
    }

    #[test]
    fn normal_is_the_gradient_and_continuous_round_the_tip() {
        let (flank, _) = space();
        let h = 1e-6;
        for r in [48.64, 48.66, 48.9, 49.3] {
            let p = [r, r * (flank.half_angle(r) - 3e-4)];
            let foot = flank.foot_internal(p);
            let slope = |dx: f64, dy: f64| {
                (flank.foot_internal([p[0] + dx, p[1] + dy]).distance
                    - flank.foot_internal([p[0] - dx, p[1] - dy]).distance)
                    / (2.0 * h)
            };
            assert!((slope(h, 0.0) - foot.normal[0]).abs() < 1e-6, "at {r}");
            assert!((slope(0.0, h) - foot.normal[1]).abs() < 1e-6, "at {r}");
            assert!((foot.normal[0] * foot.tangent[0] + foot.normal[1] * foot.tangent[1]).abs() < 1e-12);
        }
    }

    #[test]
    fn rounding_meets_flank_and_tip_circle() {
        let drive = Drive::hhd_95();
        let (space, _) = space();
        let tooth = ToothFlank::external(&drive).unwrap();
        let tooth = ActiveFlank::new(&tooth);
        for (flank, tip) in [(space, drive.circular_spline.tip_radius_mm), (tooth, drive.flexspline.tip_radius_mm)] {
            let start = flank.rounding_point(0.0);
            let junction = flank.point(flank.junction_radius);
            assert!((start[0] - junction[0]).abs() + (start[1] - junction[1]).abs() < 1e-12);
            let end = flank.rounding_point(flank.rounding_sweep);
            assert!((end[0].hypot(end[1]) - tip).abs() < 1e-10, "{} {tip}", end[0].hypot(end[1]));
        }
    }
}
