//! Outlines of the teeth: five pieces from the middle of the root land to the middle of the tip land.
//!
//! In the tooth frame (axis of the flexspline tooth, or of the circular-spline *space*, along +x) the half outline on
//! the positive-angle side is, in this order, an arc of the root circle, a root fillet, the flank, a tip rounding and
//! an arc of the tip circle. The negative side is its mirror image about the x axis.
//!
//! ```text
//!   flexspline tooth (material below the line)       circular-spline space (material above the line)
//!         tip land                                          root land
//!        .--------x (axis)                                  x--------.
//!       /  rounding                                         (axis)    \ fillet
//!      / involute                                                      \ involute
//!   __/ fillet                                                          \__ tip land
//!   root land                                                      rounding
//! ```
//!
//! Both are walked with the material on the right: the left normal of the tangent points out of the material.
//!
//! Involute: at radius `r` the half angle of the flexspline tooth, and of the circular-spline space, is
//! `(pi/2 + 2 x tan a)/z + inv a - inv a_r` with `cos a_r = r_b/r`. Written by the roll angle `u = tan a_r`, the point
//! is `r_b e(beta) + r_b u e'(beta)` with `beta = half angle at the base - u`, which makes offset curves, and so the
//! centres of fillets and roundings, closed forms. S-shaped flanks are chains of arcs (`s_tooth`).

use super::arcs::ArcChain;
use super::error::DriveError;
use super::interference::halved;
use super::s_tooth;
use super::sleeve::Profile;
use super::spec::Drive;
use crate::toml_file::Problem;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

/// Kind of a piece of the outline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PieceKind {
    /// Arc of the root circle.
    RootLand,
    /// Arc between root circle and flank.
    RootFillet,
    /// The flank that bears: involute, or S-shaped.
    Flank,
    /// Arc between flank and tip circle.
    TipRounding,
    /// Arc of the tip circle.
    TipLand,
}

impl PieceKind {
    /// In words, for messages.
    pub const fn name(self) -> &'static str {
        match self {
            PieceKind::RootLand => "root land",
            PieceKind::RootFillet => "root fillet",
            PieceKind::Flank => "flank",
            PieceKind::TipRounding => "tip rounding",
            PieceKind::TipLand => "tip land",
        }
    }
}

/// One analytic piece; its parameter `t` runs over `0..=1` from the root side to the tip side, uniform in arc length.
#[derive(Debug, Clone, PartialEq)]
pub struct OutlinePiece {
    /// Kind of the piece.
    pub kind: PieceKind,
    curve: ToothCurve,
}

#[derive(Debug, Clone, PartialEq)]
enum ToothCurve {
    Arc {
        centre: [f64; 2],
        radius: f64,
        start: f64,
        sweep: f64,
    },
    /// From `from` to `to`: roll angle of an involute, arc length of a chain.
    Flank {
        shape: FlankShape,
        from: f64,
        to: f64,
    },
}

impl OutlinePiece {
    /// Point, mm.
    pub fn point(&self, t: f64) -> [f64; 2] {
        match self.curve {
            ToothCurve::Flank { shape: FlankShape::Chain(ref chain), from, to } => chain.point(from + t * (to - from)),
            ToothCurve::Arc { centre, radius, start, sweep } => {
                let (s, c) = (start + t * sweep).sin_cos();
                [centre[0] + radius * c, centre[1] + radius * s]
            }
            ToothCurve::Flank { shape: FlankShape::Involute { base_radius, half_base }, from, to } => {
                let u = roll(from, to, t);
                let (s, c) = (half_base - u).sin_cos();
                [base_radius * (c - u * s), base_radius * (s + u * c)]
            }
        }
    }

    /// Unit tangent in the direction of growing `t`.
    pub(crate) fn tangent(&self, t: f64) -> [f64; 2] {
        match self.curve {
            ToothCurve::Flank { shape: FlankShape::Chain(ref chain), from, to } => {
                chain.tangent(from + t * (to - from)).map(|x| (to - from).signum() * x)
            }
            ToothCurve::Arc { start, sweep, .. } => {
                let (s, c) = (start + t * sweep).sin_cos();
                let sign = sweep.signum();
                [-sign * s, sign * c]
            }
            ToothCurve::Flank { shape: FlankShape::Involute { half_base, .. }, from, to } => {
                let (s, c) = (half_base - roll(from, to, t)).sin_cos();
                let sign = (to - from).signum();
                [sign * c, sign * s]
            }
        }
    }

    /// Unit normal out of the material.
    pub(crate) fn normal(&self, t: f64) -> [f64; 2] {
        let [x, y] = self.tangent(t);
        [-y, x]
    }

    /// Curvature, 1/mm, positive where the material is convex.
    pub(crate) fn curvature(&self, t: f64) -> f64 {
        match self.curve {
            ToothCurve::Flank { shape: FlankShape::Chain(ref chain), from, to } => {
                -(to - from).signum() * chain.curvature(from + t * (to - from))
            }
            ToothCurve::Arc { radius, sweep, .. } => -sweep.signum() / radius,
            ToothCurve::Flank { shape: FlankShape::Involute { base_radius, .. }, from, to } => {
                (to - from).signum() / (base_radius * roll(from, to, t))
            }
        }
    }

    /// Length, mm.
    pub fn length(&self) -> f64 {
        match self.curve {
            ToothCurve::Flank { shape: FlankShape::Chain(_), from, to } => (to - from).abs(),
            ToothCurve::Arc { radius, sweep, .. } => radius * sweep.abs(),
            ToothCurve::Flank { shape: FlankShape::Involute { base_radius, .. }, from, to } => {
                0.5 * base_radius * (to * to - from * from).abs()
            }
        }
    }
}

/// Roll angle at a part `t` of the length of an involute.
fn roll(from: f64, to: f64, t: f64) -> f64 {
    (from * from + t * (to * to - from * from)).sqrt()
}

/// One half of the outline of a tooth (external) or of a space (internal), root to tip, on the positive-angle side.
#[derive(Debug, Clone, PartialEq)]
pub struct ToothFlank {
    pieces: [OutlinePiece; 5],
    /// Radii at which root fillet, flank and tip rounding end, mm.
    ends: [f64; 3],
    shape: FlankShape,
    /// Radius of the root circle and of the tip circle, mm.
    circles: (f64, f64),
    internal: bool,
    teeth: u32,
}

/// The flank of a wheel, whose fields are named alike on both; its S-shaped one is made by `$chain`.
macro_rules! of_wheel {
    ($drive:ident, $wheel:expr, $section:literal, $internal:literal, $chain:path, $scale:expr) => {{
        let wheel = &$wheel;
        let half_base = half_angle_at_base(wheel.teeth, wheel.profile_shift, wheel.pressure_angle_rad());
        let shape = match $drive.flexspline.profile {
            Profile::Involute => FlankShape::Involute { base_radius: wheel.base_radius_mm(), half_base },
            Profile::S => FlankShape::Chain(Arc::new($chain(&$drive.as_dimensioned())?.scaled($scale))),
        };
        Self::new(&WheelNumbers {
            section: $section,
            internal: $internal,
            teeth: wheel.teeth,
            shape,
            root_radius: wheel.root_radius_mm,
            tip_radius: wheel.tip_radius_mm,
            fillet: wheel.root_fillet_mm,
            rounding: wheel.tip_rounding_mm,
        })
    }};
}

impl ToothFlank {
    /// The flexspline tooth.
    pub fn external(drive: &Drive) -> Result<Self, DriveError> {
        let scale = drive.thermal_state.flexspline_scale;
        of_wheel!(drive, drive.flexspline, "flexspline", false, s_tooth::tooth, scale)
    }

    /// The circular-spline space.
    pub fn internal(drive: &Drive) -> Result<Self, DriveError> {
        let scale = drive.thermal_state.circular_spline_scale;
        of_wheel!(drive, drive.circular_spline, "circular_spline", true, s_tooth::space, scale)
    }

    fn new(wheel: &WheelNumbers) -> Result<Self, DriveError> {
        let &WheelNumbers { internal, root_radius, tip_radius, fillet, rounding, .. } = wheel;
        let half_pitch = PI / f64::from(wheel.teeth);
        // seen from the free side a fillet centre, from the material a rounding centre; both are one offset of the
        // involute and of a circle, on the higher-angle side (+1) or the lower one (-1)
        let side = if internal { -1.0 } else { 1.0 };
        let root = wheel.corner("root_fillet_mm", root_radius, fillet, side)?;
        let tip = wheel.corner("tip_rounding_mm", tip_radius, rounding, -side)?;
        if (tip.along - root.along) * side <= 0.0 {
            return Err(wheel.refuse(
                "root_fillet_mm",
                fillet,
                &format!("leaves no flank below the tip rounding of {rounding} mm; a smaller radius is needed"),
            ));
        }
        // where the lands meet the corners, measured from the tooth or space axis
        let (land_at_root, land_at_tip) =
            if internal { (root.angle, half_pitch - tip.angle) } else { (half_pitch - root.angle, tip.angle) };
        if land_at_root <= 0.0 {
            return Err(wheel.refuse(
                "root_fillet_mm",
                fillet,
                &format!(
                    "does not fit: the root land would be {:.4} mm wide; a smaller fillet is needed",
                    2.0 * land_at_root * root_radius
                ),
            ));
        }
        if land_at_tip <= 0.0 {
            return Err(wheel.refuse(
                "tip_rounding_mm",
                rounding,
                &format!(
                    "does not fit: the tooth would be {:.4} mm thick at the tip land; a smaller rounding, another \
                     tip_radius_mm or profile_shift is needed",
                    2.0 * land_at_tip * tip_radius
                ),
            ));
        }
        let arc = |kind, centre, radius, start: f64, end: f64| OutlinePiece {
            kind,
            curve: ToothCurve::Arc { centre, radius, start, sweep: end - start },
        };
        let (from, to) = (root.along, tip.along);
        let flank = ToothCurve::Flank { shape: wheel.shape.clone(), from, to };
        // The outline of a tooth begins in the middle of the root land and ends on the axis, that of a space the other
        // way round; fillet and rounding change places with the side of the material.
        let (begins, ends) = if internal { (0.0, half_pitch) } else { (half_pitch, 0.0) };
        let (fillet_back, rounding_back) = if internal { (0.0, PI) } else { (PI, 0.0) };
        let (fillet_ends, rounding_begins) = (root.direction - side * FRAC_PI_2, tip.direction + side * FRAC_PI_2);
        let origin = [0.0, 0.0];
        let pieces = [
            arc(PieceKind::RootLand, origin, root_radius, begins, root.angle),
            arc(PieceKind::RootFillet, root.centre, fillet, root.angle - fillet_back, fillet_ends),
            OutlinePiece { kind: PieceKind::Flank, curve: flank },
            arc(PieceKind::TipRounding, tip.centre, rounding, rounding_begins, tip.angle - rounding_back),
            arc(PieceKind::TipLand, origin, tip_radius, tip.angle, ends),
        ];
        let circles = (root_radius, tip_radius);
        let ends = [1, 2, 3].map(|k| {
            let [x, y] = pieces[k].point(1.0);
            x.hypot(y)
        });
        Ok(ToothFlank { pieces, ends, shape: wheel.shape.clone(), circles, internal, teeth: wheel.teeth })
    }

    /// The five pieces, root to tip; each starts where the one before ends, with the same tangent.
    pub fn pieces(&self) -> &[OutlinePiece] {
        &self.pieces
    }

    /// The curve of the flank, without its ends.
    pub(super) fn shape(&self) -> &FlankShape {
        &self.shape
    }

    /// The piece of one kind.
    pub(crate) fn piece(&self, kind: PieceKind) -> &OutlinePiece {
        &self.pieces[kind as usize]
    }

    /// True for a circular-spline space (material outside), false for a flexspline tooth.
    pub fn is_internal(&self) -> bool {
        self.internal
    }

    /// Half the angular pitch, `pi / z`, rad: the outline covers `0..=half_pitch`.
    pub(crate) fn half_pitch(&self) -> f64 {
        PI / f64::from(self.teeth)
    }

    /// Length of the half outline, mm.
    pub fn length(&self) -> f64 {
        self.pieces.iter().map(OutlinePiece::length).sum()
    }

    /// Radius, mm, of the root circle and of the tip circle.
    pub(crate) fn root_and_tip_radius(&self) -> (f64, f64) {
        self.circles
    }

    /// Polar angle of the outline at `radius`, fillet and rounding included; `None` beyond root or tip circle.
    pub(crate) fn angle_at_radius(&self, radius: f64) -> Option<f64> {
        let (root, tip) = self.root_and_tip_radius();
        if radius < root.min(tip) || radius > root.max(tip) {
            return None;
        }
        let toward_tip = if self.internal { -1.0 } else { 1.0 };
        let within = self.ends.iter().position(|end| (end - radius) * toward_tip >= 0.0);
        let piece = &self.pieces[1 + within.unwrap_or(2)];
        Some(match piece.curve {
            ToothCurve::Flank { shape: FlankShape::Chain(ref chain), .. } => {
                let [x, y] = chain.point(chain.arc_at_radius(radius));
                y.atan2(x)
            }
            ToothCurve::Flank { shape: FlankShape::Involute { base_radius, half_base }, .. } => {
                let u = ((radius / base_radius).powi(2) - 1.0).max(0.0).sqrt();
                half_base - (u - u.atan())
            }
            ToothCurve::Arc { centre: [x, y], radius: rho, .. } => {
                // the fillet of a tooth and the rounding of a space bulge toward lower angles
                let lower = (piece.kind == PieceKind::RootFillet) != self.internal;
                let c = x.hypot(y);
                let off = ((radius * radius + c * c - rho * rho) / (2.0 * radius * c)).clamp(-1.0, 1.0).acos();
                y.atan2(x) + if lower { -off } else { off }
            }
        })
    }
}

/// The curve of a flank, in growing radius.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum FlankShape {
    /// Half angle at the base circle, rad.
    Involute {
        base_radius: f64,
        half_base: f64,
    },
    Chain(Arc<ArcChain>),
}

/// The numbers of one wheel that its outline needs.
struct WheelNumbers {
    section: &'static str,
    internal: bool,
    teeth: u32,
    shape: FlankShape,
    root_radius: f64,
    tip_radius: f64,
    fillet: f64,
    rounding: f64,
}

/// A corner arc tangent to the flank and to a circle about the wheel centre.
struct Corner {
    centre: [f64; 2],
    /// polar angle of the centre, and of the point of tangency with the circle
    angle: f64,
    /// where it is tangent to the flank: roll angle of an involute, arc length of a chain
    along: f64,
    /// direction of the flank there, in growing radius
    direction: f64,
}

impl WheelNumbers {
    /// Corner arc of radius `rho` at the circle `radius`; its centre lies on the higher-angle side of the flank
    /// (`side` = 1) or on the lower (-1), and beyond the circle on the same count for an external root or an internal
    /// tip, within it for the others.
    fn corner(&self, field: &str, radius: f64, rho: f64, side: f64) -> Result<Corner, DriveError> {
        let distance = radius + side * rho;
        match &self.shape {
            &FlankShape::Involute { base_radius: rb, half_base } => {
                // offset involute: |C|^2 = r_b^2 + (r_b u + side rho)^2 = (radius + side rho)^2
                let square = distance * distance - rb * rb;
                let roll = (square.max(0.0).sqrt() - side * rho) / rb;
                if square <= 0.0 || roll <= 0.0 {
                    return Err(self.refuse(
                        field,
                        rho,
                        &format!("meets no involute: base circle radius {rb:.4} mm, circle radius {radius:.4} mm"),
                    ));
                }
                let direction = half_base - roll;
                let angle = direction + square.sqrt().atan2(rb);
                Ok(Corner { centre: [distance * angle.cos(), distance * angle.sin()], angle, along: roll, direction })
            }
            FlankShape::Chain(chain) => {
                let offset = |s: f64| {
                    let ([x, y], t) = (chain.point(s), chain.tangent(s));
                    [x - side * rho * t[1], y + side * rho * t[0]]
                };
                let beyond = |s: f64| {
                    let [x, y] = offset(s);
                    x.hypot(y) - distance
                };
                // The parallel curve grows in radius where the flank does, unless the corner is rounder than the flank.
                let (low, high) = (-rho, chain.length() + rho);
                if beyond(low) >= 0.0 || beyond(high) <= 0.0 {
                    return Err(self.refuse(field, rho, &format!("meets no flank at the circle of {radius:.4} mm")));
                }
                let [low, _] = halved(low, high, |s| beyond(s) <= 0.0);
                let (centre, t) = (offset(low), chain.tangent(low));
                Ok(Corner { centre, angle: centre[1].atan2(centre[0]), along: low, direction: t[1].atan2(t[0]) })
            }
        }
    }

    fn refuse(&self, field: &str, value: f64, what: &str) -> DriveError {
        Problem::of(&format!("{}.{field}", self.section), format!("{value} mm {what}")).into()
    }
}

/// Half the angle of the tooth (space) where its involute meets the base circle.
fn half_angle_at_base(teeth: u32, shift: f64, pressure_angle: f64) -> f64 {
    let tan = pressure_angle.tan();
    (FRAC_PI_2 + 2.0 * shift * tan) / f64::from(teeth) + tan - pressure_angle
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;

    fn flanks() -> [ToothFlank; 2] {
        let drive = Drive::hhd_95();
        [ToothFlank::external(&drive).unwrap(), ToothFlank::internal(&drive).unwrap()]
    }

    fn polar([x, y]: [f64; 2]) -> (f64, f64) {
        (x.hypot(y), y.atan2(x))
    }

    #[test]
    fn pieces_join_with_the_same_tangent() {
        for flank in flanks() {
            for pair in flank.pieces().windows(2) {
                let (a, b) = (pair[0].point(1.0), pair[1].point(0.0));
                let gap = (a[0] - b[0]).hypot(a[1] - b[1]);
                assert!(gap < 1e-13, "{:?} to {:?}: {gap} mm", pair[0].kind, pair[1].kind);
                let (a, b) = (pair[0].tangent(1.0), pair[1].tangent(0.0));
                let kink = (a[0] - b[0]).hypot(a[1] - b[1]);
                assert!(kink < 1e-12, "{:?} to {:?}: {kink} rad", pair[0].kind, pair[1].kind);
            }
        }
    }

    #[test]
    fn the_outline_covers_half_a_pitch_from_root_to_tip() {
        let [tooth, space] = flanks();
        let (r, a) = polar(tooth.pieces()[0].point(0.0));
        assert!((r - 47.875).abs() < 1e-13 && (a - PI / 188.0).abs() < 1e-15);
        let (r, a) = polar(tooth.pieces()[4].point(1.0));
        assert!((r - 48.825).abs() < 1e-13 && a.abs() < 1e-15);
        let (r, a) = polar(space.pieces()[0].point(0.0));
        assert!((r - 49.45).abs() < 1e-13 && a.abs() < 1e-15);
        let (r, a) = polar(space.pieces()[4].point(1.0));
        assert!((r - 48.65).abs() < 1e-13 && (a - PI / 190.0).abs() < 1e-15);
    }

    #[test]
    fn tangent_curvature_and_length_agree_with_differences() {
        let step = 1e-5;
        for flank in flanks() {
            for piece in flank.pieces() {
                for t in [0.1, 0.5, 0.9] {
                    let (a, b) = (piece.point(t - step), piece.point(t + step));
                    let chord = (b[0] - a[0]).hypot(b[1] - a[1]);
                    assert!((chord / (2.0 * step) / piece.length() - 1.0).abs() < 1e-7, "{:?}", piece.kind);
                    let tangent = piece.tangent(t);
                    let cross = (b[0] - a[0]) * tangent[1] - (b[1] - a[1]) * tangent[0];
                    let dot = (b[0] - a[0]) * tangent[0] + (b[1] - a[1]) * tangent[1];
                    assert!(cross.abs() / chord < 1e-7 && dot > 0.0, "{:?}", piece.kind);
                    // convex material turns the tangent to the right
                    let (a, b) = (piece.tangent(t - step), piece.tangent(t + step));
                    let turn = a[0] * b[1] - a[1] * b[0];
                    let curvature = -turn / chord;
                    assert!(
                        (curvature - piece.curvature(t)).abs() < 1e-5 * piece.curvature(t).abs() + 1e-6,
                        "{:?}: {curvature} {}",
                        piece.kind,
                        piece.curvature(t)
                    );
                }
            }
        }
    }

    #[test]
    fn thicknesses_of_the_default_design() {
        // to the sharp corners: tooth 0.391 at its tip and 1.221 at its root, circular-spline tooth 0.603 at its tip,
        // space 0.288 at its root (mm)
        let drive = Drive::hhd_95();
        let width = |teeth: u32, shift: f64, base: f64, r: f64| {
            let u = ((r / base).powi(2) - 1.0).sqrt();
            2.0 * r * (half_angle_at_base(teeth, shift, 20f64.to_radians()) - (u - u.atan()))
        };
        let (f, c) = (&drive.flexspline, &drive.circular_spline);
        assert!((f.base_radius_mm() - 44.16555).abs() < 1e-5 && (c.base_radius_mm() - 44.63540).abs() < 1e-5);
        let tooth = |r| width(f.teeth, f.profile_shift, f.base_radius_mm(), r);
        let space = |r| width(c.teeth, c.profile_shift, c.base_radius_mm(), r);
        assert!((tooth(48.825) - 0.391).abs() < 6e-4, "{}", tooth(48.825));
        assert!((tooth(47.875) - 1.221).abs() < 6e-4, "{}", tooth(47.875));
        assert!((space(49.45) - 0.288).abs() < 6e-4, "{}", space(49.45));
        let cs_tooth = 2.0 * PI * 48.65 / 190.0 - space(48.65);
        assert!((cs_tooth - 0.603).abs() < 6e-4, "{cs_tooth}");
    }

    #[test]
    fn the_angle_at_a_radius_lies_on_the_outline() {
        for flank in flanks() {
            for piece in &flank.pieces()[1..4] {
                for k in 0..=20 {
                    let (r, angle) = polar(piece.point(f64::from(k) / 20.0));
                    let (root, tip) = flank.root_and_tip_radius();
                    let found = flank.angle_at_radius(r.clamp(root.min(tip), root.max(tip))).unwrap();
                    // at the circles the outline is tangent to them, which halves the digits
                    let tolerance = if k == 0 || k == 20 { 1e-8 } else { 1e-11 };
                    assert!((found - angle).abs() < tolerance, "{:?} at {r}: {found} {angle}", piece.kind);
                }
            }
            assert_eq!(flank.angle_at_radius(50.0), None);
            assert_eq!(flank.angle_at_radius(47.0), None);
        }
    }

    #[test]
    fn roundings_go_down_to_five_micrometres_and_up_until_the_land_is_gone() {
        let mut drive = Drive::hhd_95();
        drive.flexspline.tip_rounding_mm = 0.005;
        drive.circular_spline.tip_rounding_mm = 0.005;
        assert!(
            (ToothFlank::external(&drive).unwrap().piece(PieceKind::TipRounding).curvature(0.5) - 200.0).abs() < 1e-9
        );
        assert!(ToothFlank::internal(&drive).is_ok());
        drive.flexspline.tip_rounding_mm = 0.4;
        let message = ToothFlank::external(&drive).unwrap_err().to_string();
        assert!(message.starts_with("flexspline.tip_rounding_mm: 0.4 mm does not fit"), "{message}");
        drive.circular_spline.root_fillet_mm = 0.3;
        let message = ToothFlank::internal(&drive).unwrap_err().to_string();
        assert!(message.starts_with("circular_spline.root_fillet_mm: 0.3 mm does not fit"), "{message}");
    }
}
