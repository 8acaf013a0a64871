//! S-shaped teeth: flanks of which a long part bears at once.
//!
//! A tooth of the flexspline goes in and out of its space on a path `c(theta)`. Where both wheels were racks it would
//! be
//!
//! `x = m (theta - k sin theta)/2,  y = k m (1 - cos theta)`,
//!
//! `theta` twice the angle from the major axis, m the pitch over pi, k = w0/m. A flank that is this path made half as
//! large, and its counterpart turned by half a turn, touch at every `theta`: tooth and space have the path's own
//! direction where they meet. This is the tooth of S. Ishikawa ("Tooth profile of spline of strain wave gearing",
//! European patent 0 266 972, 1993).
//!
//! Here the addendum of the flexspline tooth is that half path, laid around its pitch circle. It begins where the path
//! is steepest; below, the flank goes straight on. Teeth on a ring also tilt, by 1.5 w0/R, and their tips go a little
//! further around than their feet: the space is therefore not the other half path, but what the tooth leaves free as it
//! goes through its whole cycle under the cam, the neutral curve of constant length. Between `phi` of some 3 and 52
//! degrees the two then touch without clearance. The space is kept as a chain of arcs through points of this envelope,
//! exact to some nanometres.

use super::arcs::ArcChain;
use super::interference::golden;
use super::neutral::NeutralCurve;
use super::placement::rotate;
use super::ring::GeneratorKind;
use super::spec::Drive;
use crate::toml_file::Problem;
use std::f64::consts::PI;

/// Points that the arcs of a flank go through: the envelope is then met to some 3 nm (tested).
const NODES: usize = 24;
/// Half the path is left where it turns over: beyond this angle its flank would lie flatter than 45 degrees.
const LAST_THETA_DEG: f64 = 125.0;
/// Angles of the cycle, degrees from the major axis, that are looked at for the envelope, and how many. On the other
/// side the tooth stands behind.
const CYCLE_DEG: [f64; 2] = [-10.0, 85.0];
const CYCLE_STEPS: usize = 190;
/// Margin of the envelope before the tip of the tooth comes to its end, modules: there its direction is that of a
/// corner.
const BEFORE_THE_TIP: f64 = 0.02;

/// The flank of the flexspline tooth in its frame, positive-angle side, in growing radius, at reference temperature.
pub(super) fn tooth(drive: &Drive) -> Result<ArcChain, Problem> {
    let f = &drive.flexspline;
    let pitch_radius = f.pitch_radius_mm() + f.profile_shift * f.module_mm;
    // The pitch, over pi, on the circle that the tooth is half of.
    let module = 2.0 * pitch_radius / f64::from(f.teeth);
    let kappa = drive.generator.w0_mm / module;
    let addendum = f.tip_radius_mm - pitch_radius;
    let furthest = 0.5 * kappa * module * (1.0 - LAST_THETA_DEG.to_radians().cos());
    if !(addendum > 0.1 * f.module_mm && addendum < furthest && f.root_radius_mm < pitch_radius) {
        return Err(Problem::of(
            "flexspline.profile_shift",
            format!(
                "found {}: with profile = \"s\" the pitch circle at {pitch_radius:.4} mm lies between root and tip \
                 circle, 0.1 module to {furthest:.4} mm below the tip (a deflection w0 carries no higher tooth); \
                 allowed: {:.3} to {:.3}",
                f.profile_shift,
                ((f.tip_radius_mm - furthest).max(f.root_radius_mm) - f.pitch_radius_mm()) / f.module_mm,
                (f.tip_radius_mm - f.pitch_radius_mm()) / f.module_mm - 0.1,
            ),
        ));
    }
    // With k = 1 the path stands still at its beginning, and has no direction there.
    let first = if kappa < 1.0 { kappa.acos() } else { (1.0 / kappa).acos() }.max(1e-3);
    let height = |theta: f64| 0.5 * kappa * module * (1.0 - theta.cos());
    let last = (1.0 - 2.0 * (addendum + height(first)) / (kappa * module)).max(-1.0).acos();
    let back = |theta: f64| 0.25 * module * (theta - kappa * theta.sin());
    let nodes: Vec<_> = (0..=NODES)
        .map(|k| {
            let theta = first + (last - first) * k as f64 / NODES as f64;
            let r = pitch_radius + height(theta) - height(first);
            let angle = (0.25 * PI * module - (back(theta) - back(first))) / pitch_radius;
            let (rise, turn) =
                (0.5 * kappa * module * theta.sin(), -0.25 * module * (1.0 - kappa * theta.cos()) / pitch_radius);
            let (s, c) = angle.sin_cos();
            let (x, y) = (rise * c - r * turn * s, rise * s + r * turn * c);
            let length = x.hypot(y);
            ([r * c, r * s], [x / length, y / length])
        })
        .collect();
    Ok(ArcChain::through(&nodes).with_lead(pitch_radius - f.root_radius_mm))
}

/// The flank of the circular-spline space in its frame, positive-angle side, in growing radius, at reference
/// temperature.
pub(super) fn space(drive: &Drive) -> Result<ArcChain, Problem> {
    let cycle = Cycle {
        tooth: tooth(drive)?,
        curve: NeutralCurve::new(drive.generator.shape(GeneratorKind::Cam), drive.flexspline.neutral_radius_mm()),
        ratio: f64::from(drive.flexspline.teeth) / f64::from(drive.circular_spline.teeth),
    };
    let tip = drive.circular_spline.tip_radius_mm;
    let deepest = drive.flexspline.tip_radius_mm + drive.generator.w0_mm - BEFORE_THE_TIP * drive.flexspline.module_mm;
    let nothing = || {
        Problem::of(
            "circular_spline.tip_radius_mm",
            format!("found {tip}: the teeth do not reach into one another; allowed: below {deepest:.4}"),
        )
    };
    if deepest <= tip {
        return Err(nothing());
    }
    let nodes: Option<Vec<_>> = (0..=NODES)
        .map(|k| {
            let r = tip + (deepest - tip) * k as f64 / NODES as f64;
            let (angle, by_radius) = cycle.envelope(r)?;
            let (s, c) = angle.sin_cos();
            let (x, y) = (c - r * by_radius * s, s + r * by_radius * c);
            let length = x.hypot(y);
            Some(([r * c, r * s], [x / length, y / length]))
        })
        .collect();
    Ok(ArcChain::through(&nodes.ok_or_else(nothing)?).with_tail(drive.flexspline.module_mm))
}

/// A tooth on its way through a space.
struct Cycle {
    tooth: ArcChain,
    curve: NeutralCurve,
    /// Angle of the space over that of its tooth.
    ratio: f64,
}

impl Cycle {
    /// Angle, seen in the space, at which the flank of the tooth at material angle `phi` crosses the circle of radius
    /// `r`; `None` where it ends below.
    fn angle(&self, phi: f64, r: f64) -> Option<f64> {
        let (position, normal) = self.curve.position(phi);
        let axis = phi * self.ratio;
        let foot = rotate(position, (-axis).sin_cos());
        let turn @ (s, c) = (normal - axis).sin_cos();
        let place = |p: [f64; 2]| {
            let along = p[0] - self.curve.radius_mm();
            [foot[0] + along * c - p[1] * s, foot[1] + along * s + p[1] * c]
        };
        let mut at = 0.5 * self.tooth.length();
        let mut found = [0.0; 2];
        for _ in 0..6 {
            let direction = rotate(self.tooth.tangent(at), turn);
            found = place(self.tooth.point(at));
            let radius = found[0].hypot(found[1]);
            let rate = ((found[0] * direction[0] + found[1] * direction[1]) / radius).max(0.3);
            at -= (radius - r) / rate;
        }
        (0.0..=self.tooth.length() + 1e-9).contains(&at).then(|| found[1].atan2(found[0]))
    }

    /// Half angle of the space at a radius, such that the tooth just passes, and its slope with the radius (1/mm).
    fn envelope(&self, r: f64) -> Option<(f64, f64)> {
        let step = (CYCLE_DEG[1] - CYCLE_DEG[0]).to_radians() / CYCLE_STEPS as f64;
        let phi = |k: usize| CYCLE_DEG[0].to_radians() + step * k as f64;
        let behind = |phi: f64| self.angle(phi, r).map_or(f64::INFINITY, |angle| -angle);
        let widest = (0..=CYCLE_STEPS).min_by(|&i, &j| behind(phi(i)).total_cmp(&behind(phi(j))))?;
        let refined = golden(behind, phi(widest) - step, phi(widest) + step);
        let at = if behind(refined) < behind(phi(widest)) { refined } else { phi(widest) };
        let angle = self.angle(at, r)?;
        // Of all angles the widest does not change with phi: its slope is that of the tooth where it stands, on one
        // side where its tip is.
        let h = 1e-4;
        let slope = match (self.angle(at, r - h), self.angle(at, r + h)) {
            (Some(low), Some(high)) => (high - low) / (2.0 * h),
            (Some(low), None) => (angle - low) / h,
            (None, high) => (high? - angle) / h,
        };
        Some((angle, slope))
    }
}

#[cfg(test)]
mod tests {
    use super::super::interference::{RigidMesh, Side};
    use super::*;

    /// The drawing: no preload.
    fn drawn() -> Drive {
        let mut drive = Drive::s_95();
        drive.flanks.preload_um = 0.0;
        drive
    }

    fn clear_of(drive: &Drive, kind: GeneratorKind) -> Vec<(f64, f64)> {
        let mesh = RigidMesh::new(drive, kind).unwrap();
        (0..=170)
            .filter_map(|k| {
                let deg = 0.5 * f64::from(k);
                Some((deg, mesh.gap(deg.to_radians(), Side::Plus)?.gap_mm))
            })
            .collect()
    }

    /// Tooth and space touch from some degrees behind the major axis until the tip leaves, without clearance and
    /// without overlap; the tip of the space's own rounding lets the tooth out. Where racks of this height bear, of
    /// `1 - cos theta = 2 h/(k m)`, `theta/(2 pi)` of all teeth do.
    #[test]
    fn a_quarter_of_all_teeth_touch_without_clearance_and_none_overlap() {
        let gaps = clear_of(&drawn(), GeneratorKind::Cam);
        let least = gaps.iter().map(|(_, gap)| *gap).fold(f64::INFINITY, f64::min);
        assert!(least > -1e-5, "overlap of {least} mm");
        let touching = gaps.iter().filter(|(_, gap)| *gap < 5e-5).count();
        // Of 180 degrees that a flank goes through from lobe to lobe.
        let share = 0.5 * touching as f64 / 180.0;
        let f = &drawn().flexspline;
        let module = f.module_mm + 2.0 * f.profile_shift * f.module_mm / f64::from(f.teeth);
        let height = f.tip_radius_mm - f.pitch_radius_mm() - f.profile_shift * f.module_mm;
        let racks = (1.0 - 2.0 * height / 0.5).acos() / (2.0 * PI);
        assert!((module - 0.5158).abs() < 1e-3 && (0.28..0.32).contains(&racks), "{module} {racks}");
        assert!(share > 0.22 && share < racks, "{share} of {racks}");
        // Involutes touch in one place of the cycle.
        let involute = clear_of(&Drive::hhd_95(), GeneratorKind::Cam);
        let tight = involute.iter().map(|(_, gap)| *gap).fold(f64::INFINITY, f64::min);
        assert!(involute.iter().filter(|(_, gap)| *gap < tight + 5e-5).count() < 6);
    }

    /// The rack that the tooth is the limit of: with more and more teeth of one size the envelope becomes the
    /// counterpart of the tooth, the same path turned by half a turn.
    #[test]
    fn of_many_teeth_the_space_is_the_tooth_turned_around() {
        let off = |teeth: u32| {
            let mut drive = drawn();
            let scale = f64::from(teeth) / 188.0;
            let (f, c) = (&mut drive.flexspline, &mut drive.circular_spline);
            (f.teeth, c.teeth) = (teeth, teeth + 2);
            // The same teeth on a larger ring: pitch circle and all radii further out by as much as the ring grows.
            let pitch = 48.4875 * scale;
            f.profile_shift = (pitch - f.pitch_radius_mm()) / f.module_mm;
            let further = pitch - 48.4875;
            f.root_radius_mm += further;
            f.tip_radius_mm += further;
            c.tip_radius_mm += further;
            c.root_radius_mm += further;
            // k = 1: the path is steepest on the major axis, and the flanks begin on the pitch circles.
            let w0 = 2.0 * pitch / f64::from(teeth);
            drive.generator.w0_mm = w0;
            let (tooth, space) = (tooth(&drive).unwrap(), space(&drive).unwrap());
            let half_pitch = PI / f64::from(teeth);
            // Turned about the point where both pitch circles and the middle of the flank meet, a point of the addendum
            // of the tooth, h above its pitch circle, is one of the space h below its own.
            (1..8)
                .map(|k| {
                    let h = 0.04 * f64::from(k);
                    let of = |chain: &ArcChain, r: f64| {
                        let [x, y] = chain.point(chain.arc_at_radius(r));
                        r * y.atan2(x)
                    };
                    let thick = 0.5 * half_pitch * pitch - of(&tooth, pitch + h);
                    let wide = of(&space, pitch + w0 - h) - 0.5 * half_pitch * pitch;
                    (thick - wide).abs()
                })
                .fold(0.0, f64::max)
        };
        let (few, many) = (off(188), off(1880));
        assert!(many < 3e-3 && many < 0.2 * few, "{few} {many} mm");
    }

    #[test]
    fn the_chain_of_the_space_is_the_envelope_to_a_few_nanometres() {
        let drive = drawn();
        let cycle = Cycle {
            tooth: tooth(&drive).unwrap(),
            curve: NeutralCurve::new(drive.generator.shape(GeneratorKind::Cam), drive.flexspline.neutral_radius_mm()),
            ratio: 188.0 / 190.0,
        };
        let chain = space(&drive).unwrap();
        for k in 0..60 {
            let r = 48.66 + 0.01 * f64::from(k);
            let (angle, _) = cycle.envelope(r).unwrap();
            let foot = chain.foot([r * angle.cos(), r * angle.sin()]);
            assert!(foot.left.abs() < 1e-5, "{} mm off the envelope at {r}", foot.left);
        }
    }

    /// Warmth moves the wheels apart as it does involutes: the space stays as it was cut.
    #[test]
    fn a_warm_space_is_the_cold_one_larger() {
        let mut drive = drawn();
        drive.temperature.flexspline_expansion_per_k = 2e-5;
        let least = |drive: &Drive| {
            clear_of(drive, GeneratorKind::Cam).into_iter().map(|(_, gap)| gap).fold(f64::INFINITY, f64::min)
        };
        let (cold, warm) = (least(&drive), least(&drive.at_temperature(60.0)));
        assert!(warm < cold - 2e-3, "{cold} {warm}");
    }

    #[test]
    fn a_pitch_circle_off_the_teeth_is_refused_by_name() {
        for (set, says) in [
            ("flexspline.profile_shift=3.7", "pitch circle at 48.8500 mm"),
            ("flexspline.profile_shift=1", "pitch circle at 47.5000 mm"),
            ("generator.w0_mm=0.3", "a deflection w0 carries no higher tooth"),
        ] {
            let message = Drive::s_95().with_set(set).unwrap_err().to_string();
            assert!(message.contains("flexspline.profile_shift: found") && message.contains(says), "{set}: {message}");
        }
    }
}
