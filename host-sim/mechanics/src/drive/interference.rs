//! Do the teeth clear one another, and by how much? Rigid teeth on the exactly inextensible neutral curve.
//!
//! The generator turns under a fixed flexspline, so in the generator frame a flexspline tooth of material angle `phi`
//! sits at [`NeutralCurve::position`], its axis along the normal, and the circular-spline space it belongs to has its
//! axis at `phi z_f / z_c`. The mesh therefore depends on `phi` alone: each tooth goes through the whole cycle
//! `-pi/2..pi/2` as the generator turns half a turn, tooth `k` being at `phi = 2 pi k / z_f - psi`.
//!
//! The gap at a point of the flexspline flank is the angle, seen from the axis, to the flank of the space at the same
//! radius, fillets and roundings of both wheels included; positive is open. Turning the circular spline by `e` changes
//! every gap by exactly `e`, so the least gap on each side is what it can turn: their sum is the rigid backlash.
//!
//! Not covered: a preload of the flanks ([`super::Flanks::preload_um`]), elastic deflection, imperfections
//! ([`super::AsBuilt`]; these are the nominal teeth), and tips meeting roots radially ([`super::Drive::check`] asks for
//! clearance there).

use super::as_built::{direction, sum_at};
use super::error::DriveError;
use super::neutral::NeutralCurve;
use super::placement::{FlankDeviations, rotate};
use super::ring::GeneratorKind;
use super::spec::Drive;
use super::tooth::{OutlinePiece, PieceKind, ToothFlank};
use flexspline_base::robust::least_and_most;
use flexspline_base::statistics::mean;
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt;

/// Steps of the scan over the mesh cycle; the least gap found is then refined between its neighbours.
const CYCLE_STEPS: usize = 720;
/// Points tried on each piece of a flank before refining.
const PIECE_STEPS: usize = 12;
/// Places over a turn of the output at which teeth as built are looked at: some twenty in each turn of the generator of
/// a drive of ratio 100 (and no whole number of them, so that each turn is seen in others), where errors of teeth and
/// axes change little between two.
const PLACES: usize = 1999;
/// Generator angles within one tooth pitch at which the backlash is taken.
const PITCH_STEPS: usize = 24;

/// A flank of a flexspline tooth or of a circular-spline space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// The flank on the counter-clockwise side: it limits turning the circular spline backward.
    Plus,
    /// Its mirror image on the clockwise side: it limits turning the circular spline forward.
    Minus,
}

impl Side {
    /// Both sides.
    pub const BOTH: [Side; 2] = [Side::Plus, Side::Minus];

    /// +1 or −1.
    pub fn sign(self) -> f64 {
        if self == Side::Plus { 1.0 } else { -1.0 }
    }

    /// 0 or 1.
    pub fn index(self) -> usize {
        self as usize
    }
}

/// The least gap on one flank of one tooth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FlankGap {
    /// Circumferential gap, mm, positive where open.
    pub gap_mm: f64,
    /// The gap as an angle of the circular spline, rad.
    pub gap_rad: f64,
    /// Material angle of the tooth from the major axis, rad: tooth `k` is there at generator angle
    /// `2 pi k / z_f - material_angle_rad`.
    pub material_angle_rad: f64,
    /// Flank of the flexspline tooth.
    pub side: Side,
    /// Where on the undeformed flexspline tooth, radius in mm.
    pub flexspline_radius_mm: f64,
    /// On which piece of its outline.
    #[serde(serialize_with = "piece_name")]
    pub flexspline_piece: PieceKind,
    /// Where on the circular spline, radius in mm.
    pub circular_spline_radius_mm: f64,
}

fn piece_name<S: serde::Serializer>(piece: &PieceKind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(piece.name())
}

impl fmt::Display for FlankGap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = if self.side == Side::Plus { "positive" } else { "negative" };
        let state = if self.gap_mm < 0.0 { "interferes by" } else { "clears by" };
        write!(
            f,
            "flexspline tooth 0, {side} flank, {} at radius {:.3} mm, {state} {:.1} µm at generator angle {:.2}°",
            self.flexspline_piece.name(),
            self.flexspline_radius_mm,
            1e3 * self.gap_mm.abs(),
            -self.material_angle_rad.to_degrees(),
        )
    }
}

/// Smallest free rotation of the output with rigid teeth as built.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Room {
    /// Free rotation of the output, rad; negative where both flanks would have to give way.
    pub least_rad: f64,
    /// Generator angle at which that is, rad.
    pub generator_rad: f64,
}

/// The least gap of a tooth at a place of the cycle, and how it changes.
#[derive(Debug, Clone, Copy)]
struct LeastGap {
    gap_rad: f64,
    radius_mm: f64,
    /// Change of the gap (rad) with the distance of the tooth from the axis (mm): the flank of the space leans.
    by_radius: f64,
}

/// The rigid mesh of one generator.
#[derive(Debug, Clone)]
pub struct RigidMesh {
    tooth: ToothFlank,
    /// Points that are tried on its pieces from the root fillet on.
    tried: Vec<[[f64; 2]; PIECE_STEPS + 1]>,
    space: ToothFlank,
    curve: NeutralCurve,
    flexspline_teeth: f64,
    circular_spline_teeth: f64,
}

/// Result of [`RigidMesh::report`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeshReport {
    /// The generator.
    pub generator: GeneratorKind,
    /// The least gap of all, over the whole cycle and both flanks.
    pub least: FlankGap,
    /// Rotation of the circular spline between both flanks, rad, mean over one tooth pitch of generator angle;
    /// negative if the teeth bind.
    pub backlash_rad: f64,
    /// Change of the least gap of one flank over one tooth pitch, largest minus smallest, rad: the kinematic error of
    /// rigid teeth.
    pub ripple_rad: f64,
    /// The worst point of every stretch of the cycle where a flank interferes; empty for a sound mesh.
    pub interferences: Vec<FlankGap>,
}

impl RigidMesh {
    /// Overlap that is none, mm: S-shaped flanks are drawn to touch without clearance, and are kept to some nanometres.
    /// A guess, far above these and far below what an error of manufacture is.
    pub const TOUCHES_MM: f64 = 1e-4;

    /// The mesh of `drive` with the generator of `kind`.
    ///
    /// At another than reference temperature the deflection grows with the flexspline; a generator that expands
    /// otherwise than the flexspline changes its fit in the bore, which takes elasticity and is left out.
    pub fn new(drive: &Drive, kind: GeneratorKind) -> Result<Self, DriveError> {
        let mut warm = drive.generator.clone();
        warm.w0_mm *= drive.thermal_state.flexspline_scale;
        let tooth = ToothFlank::external(drive)?;
        let points = |piece: &OutlinePiece| std::array::from_fn(|k| piece.point(k as f64 / PIECE_STEPS as f64));
        Ok(RigidMesh {
            tried: tooth.pieces()[1..].iter().map(points).collect(),
            tooth,
            space: ToothFlank::internal(drive)?,
            curve: NeutralCurve::new(warm.shape(kind), drive.flexspline.neutral_radius_mm()),
            flexspline_teeth: f64::from(drive.flexspline.teeth),
            circular_spline_teeth: f64::from(drive.circular_spline.teeth),
        })
    }

    /// Least gap on one flank of the tooth at material angle `phi`; `None` where that flank does not reach past the
    /// tips of the circular spline.
    pub(crate) fn gap(&self, phi: f64, side: Side) -> Option<FlankGap> {
        // the place of the tooth seen from the axis of its space
        let (position, normal) = self.curve.position(phi);
        let space_axis = phi * self.flexspline_teeth / self.circular_spline_teeth;
        let foot = rotate(position, (-space_axis).sin_cos());
        let (s, c) = (normal - space_axis).sin_cos();
        let sign = side.sign();
        let (_, space_tip) = self.space.root_and_tip_radius();

        // Radius and gap (rad) at a point of the tooth; none inside the tips of the circular spline.
        let gap_at = |[px, py]: [f64; 2]| -> Option<[f64; 2]> {
            let (along, across) = (px - self.curve.radius_mm(), sign * py);
            let place = [foot[0] + along * c - across * s, foot[1] + along * s + across * c];
            let radius = place[0].hypot(place[1]);
            if radius < space_tip {
                return None;
            }
            // beyond the root circle there is no space left
            let half_space = self.space.angle_at_radius(radius).unwrap_or(0.0);
            Some([radius, half_space - sign * place[1].atan2(place[0])])
        };
        let value = |gap: &Option<[f64; 2]>| gap.map_or(f64::INFINITY, |[_, gap_rad]| gap_rad);

        let mut best: Option<FlankGap> = None;
        for (piece, points) in self.tooth.pieces()[1..].iter().zip(&self.tried) {
            let tried = points.map(gap_at);
            let least = (0..=PIECE_STEPS).min_by(|&i, &j| value(&tried[i]).total_cmp(&value(&tried[j])));
            let Some(k) = least.filter(|&k| tried[k].is_some()) else {
                continue;
            };
            let [low, high] = [k.saturating_sub(1), (k + 1).min(PIECE_STEPS)].map(|k| k as f64 / PIECE_STEPS as f64);
            let refined = piece.point(golden(|t| value(&gap_at(piece.point(t))), low, high));
            for (point, gap) in [(points[k], tried[k]), (refined, gap_at(refined))] {
                let Some([radius, gap_rad]) = gap.filter(|[_, gap]| best.is_none_or(|best| *gap < best.gap_rad)) else {
                    continue;
                };
                best = Some(FlankGap {
                    gap_mm: gap_rad * radius,
                    gap_rad,
                    material_angle_rad: phi,
                    side,
                    flexspline_radius_mm: point[0].hypot(point[1]),
                    flexspline_piece: piece.kind,
                    circular_spline_radius_mm: radius,
                });
            }
        }
        best
    }

    /// Gaps over the whole mesh cycle, both flanks.
    pub fn report(&self, generator: GeneratorKind) -> Option<MeshReport> {
        let (least, interferences) = self.scan()?;
        let (backlash_rad, ripple_rad) = self.room();
        Some(MeshReport { generator, least, backlash_rad, ripple_rad, interferences })
    }

    /// Generators under which the teeth of a drive interfere, and the least gap there.
    pub fn interfering(drive: &Drive) -> Result<Vec<(GeneratorKind, FlankGap)>, DriveError> {
        let of = |kind| {
            let found = RigidMesh::new(drive, kind)?.scan();
            Ok(found.filter(|(_, interferences)| !interferences.is_empty()).map(|(least, _)| (kind, least)))
        };
        GeneratorKind::ALL.into_par_iter().filter_map(|kind| of(kind).transpose()).collect()
    }

    /// The least gap over the cycle, and the worst point of every stretch that interferes.
    fn scan(&self) -> Option<(FlankGap, Vec<FlankGap>)> {
        let step = PI / CYCLE_STEPS as f64;
        let mut least: Option<FlankGap> = None;
        let mut interferences = Vec::new();
        for side in [Side::Plus, Side::Minus] {
            let cycle: Vec<Option<FlankGap>> =
                (0..=CYCLE_STEPS).map(|k| self.gap(-FRAC_PI_2 + step * k as f64, side)).collect();
            let value = |k: usize| cycle[k].map_or(f64::INFINITY, |gap| gap.gap_rad);
            let overlap = |k: usize| cycle[k].map_or(0.0, |gap| -gap.gap_mm);
            let lowest = |stretch: std::ops::Range<usize>| -> Option<FlankGap> {
                let k = stretch.min_by(|&i, &j| value(i).total_cmp(&value(j)))?;
                let coarse = cycle[k]?;
                let angle = |phi: f64| self.gap(phi, side).map_or(f64::INFINITY, |gap| gap.gap_rad);
                let phi = golden(angle, coarse.material_angle_rad - step, coarse.material_angle_rad + step);
                Some(self.gap(phi, side).filter(|fine| fine.gap_rad < coarse.gap_rad).unwrap_or(coarse))
            };
            let found = lowest(0..cycle.len())?;
            if least.is_none_or(|least| found.gap_rad < least.gap_rad) {
                least = Some(found);
            }
            let mut k = 0;
            while k < cycle.len() {
                let end = (k..cycle.len()).find(|&j| overlap(j) <= Self::TOUCHES_MM).unwrap_or(cycle.len());
                interferences.extend(lowest(k..end));
                k = end + 1;
            }
        }

        Some((least?, interferences))
    }

    /// Backlash and ripple, rad: one pitch of generator angle, all teeth that can touch.
    pub(super) fn room(&self) -> (f64, f64) {
        let pitch = TAU / self.flexspline_teeth;
        let within = (FRAC_PI_2 / pitch) as i32;
        // Forward; backward the same places are passed as in a mirror, the other way around.
        let room = |k: usize| {
            let psi = pitch * k as f64 / PITCH_STEPS as f64;
            let gaps = (-within..=within + 1).filter_map(|tooth| self.gap(f64::from(tooth) * pitch - psi, Side::Minus));
            gaps.map(|gap| gap.gap_rad).fold(f64::INFINITY, f64::min)
        };
        let rooms: Vec<f64> = (0..PITCH_STEPS).into_par_iter().map(room).collect();
        let (low, high) = least_and_most(rooms.iter().copied());
        (2.0 * mean(&rooms), high - low)
    }

    /// Free rotation of the output at the tightest place of a whole turn, with the teeth as built and rigid.
    ///
    /// Errors of teeth, spaces, axes, rim and generator move each tooth against its space, to first order: its least
    /// gap as drawn opens and closes by what the motion has along the normal of the flank. A turn of the output is
    /// looked at in 1999 places. Missing where the teeth never meet.
    pub fn room_as_built(&self, drive: &Drive, generator: GeneratorKind) -> Option<Room> {
        let moved = FlankDeviations::new(drive);
        let built = &drive.as_built;
        let cycles = Side::BOTH.map(|side| self.cycle(side));
        let (teeth, spaces) = (moved.teeth.len(), moved.spaces.len());
        let eccentric =
            direction(built.generator_eccentricity_phase_deg).map(|x| 1e-3 * built.generator_eccentricity_um * x);
        let ratio = self.circular_spline_teeth / (self.circular_spline_teeth - self.flexspline_teeth);
        let mut tightest: Option<Room> = None;
        for place in 0..PLACES {
            let psi = TAU * ratio * place as f64 / PLACES as f64;
            let mut room = [f64::INFINITY; 2];
            for (tooth, at) in moved.teeth.iter().enumerate() {
                // The tooth in the generator's frame, and the lobe that it is with: with every lobe it has passed it is
                // a space further.
                let phi = TAU * tooth as f64 / teeth as f64 - psi;
                let lobe = (phi / PI).round();
                let space = (tooth as i64 + lobe as i64).rem_euclid(spaces as i64) as usize;
                let from_lobe = phi - PI * lobe;
                let axis = psi + PI * lobe + from_lobe * self.flexspline_teeth / self.circular_spline_teeth;
                let space_at = moved.spaces[space];
                let of_axis = rotate(moved.axis, (-axis).sin_cos());
                let of_generator = rotate(eccentric, (psi - axis).sin_cos());
                let mut out = 1e-3 * sum_at(&built.rim_thickness_harmonics, TAU * tooth as f64 / teeth as f64)
                    + 0.5e-3 * built.generator_lobe_asymmetry_um * phi.cos();
                if generator == GeneratorKind::Cam {
                    out += 1e-3 * sum_at(&built.cam_form_harmonics, phi);
                }
                let radial = at.translation[0] - space_at.translation[0] - of_axis[0] + of_generator[0] + out;
                for side in Side::BOTH {
                    let Some(nearest) = at_phase(&cycles[side.index()], from_lobe) else { continue };
                    let r = nearest.radius_mm;
                    let along = at.translation[1] - space_at.translation[1] - of_axis[1]
                        + of_generator[1]
                        + r * (at.turn.0 - space_at.turn.0);
                    let k = side.index();
                    let missing = moved.tooth_depth[tooth][k] + moved.space_depth[space][k];
                    let gap = nearest.gap_rad + nearest.by_radius * radial - side.sign() * along / r
                        + missing * (1.0 + (r * nearest.by_radius).powi(2)).sqrt() / r;
                    room[k] = room[k].min(gap);
                }
            }
            let least_rad = room[0] + room[1];
            if least_rad.is_finite() && tightest.is_none_or(|tightest| least_rad < tightest.least_rad) {
                tightest = Some(Room { least_rad, generator_rad: psi });
            }
        }
        tightest
    }

    /// The least gaps of one flank over the cycle, from -pi/2 to pi/2.
    fn cycle(&self, side: Side) -> Vec<Option<LeastGap>> {
        /// Distance over which the lean of a flank is taken, mm.
        const NEAR_MM: f64 = 1e-4;
        (0..=CYCLE_STEPS)
            .map(|k| {
                let gap = self.gap(-FRAC_PI_2 + PI * k as f64 / CYCLE_STEPS as f64, side)?;
                let radius_mm = gap.circular_spline_radius_mm;
                let around = [-NEAR_MM, NEAR_MM].map(|d| self.space.angle_at_radius(radius_mm + d));
                let by_radius = match around {
                    [Some(inside), Some(outside)] => (outside - inside) / (2.0 * NEAR_MM),
                    _ => 0.0,
                };
                Some(LeastGap { gap_rad: gap.gap_rad, radius_mm, by_radius })
            })
            .collect()
    }

    /// The least gap of [`RigidMesh::report`] alone, which takes a quarter of its time.
    pub fn least(&self) -> Option<FlankGap> {
        self.scan().map(|(least, _)| least)
    }
}

/// A cycle between its places; none where the flank meets none there.
fn at_phase(cycle: &[Option<LeastGap>], phi: f64) -> Option<LeastGap> {
    let along = ((phi + FRAC_PI_2) / PI).clamp(0.0, 1.0) * CYCLE_STEPS as f64;
    let k = (along as usize).min(CYCLE_STEPS - 1);
    let (a, b, t) = (cycle[k]?, cycle[k + 1]?, along - k as f64);
    let mix = |a: f64, b: f64| a + (b - a) * t;
    Some(LeastGap {
        gap_rad: mix(a.gap_rad, b.gap_rad),
        radius_mm: mix(a.radius_mm, b.radius_mm),
        by_radius: mix(a.by_radius, b.by_radius),
    })
}

/// The ends of a range after sixty halvings, to the last digit: `is_low` holds below the place sought.
pub(crate) fn halved(mut low: f64, mut high: f64, is_low: impl Fn(f64) -> bool) -> [f64; 2] {
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if is_low(middle) { low = middle } else { high = middle }
    }
    [low, high]
}

/// Argument of the least value of a function with one valley between `low` and `high`.
pub(crate) fn golden(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let section = 0.5 * (5f64.sqrt() - 1.0);
    let mut left = high - section * (high - low);
    let mut right = low + section * (high - low);
    let (mut at_left, mut at_right) = (f(left), f(right));
    // 30 cuts narrow the interval 2e6-fold: a minimum is then known to 1e-12 of its depth
    for _ in 0..30 {
        if at_left < at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - section * (high - low);
            at_left = f(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + section * (high - low);
            at_right = f(right);
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(drive: &Drive, kind: GeneratorKind) -> MeshReport {
        RigidMesh::new(drive, kind).unwrap().report(kind).unwrap()
    }

    /// An ideal drive has the room of its backlash at the tightest phase. A spline off its axis, or an oval one,
    /// presses teeth into their spaces: the room falls by twice what the flank's lean makes of the displacement, or
    /// more; wear opens it by its depth on both flanks of both wheels.
    #[test]
    fn teeth_as_built_leave_less_room_and_worn_ones_more() {
        let room = |set: &str| {
            let drive = Drive::hhd_95().with_set(set).unwrap();
            let mesh = RigidMesh::new(&drive, GeneratorKind::Cam).unwrap();
            mesh.room_as_built(&drive, GeneratorKind::Cam).unwrap().least_rad
        };
        let ideal = room("as_built.flexspline_wear_um=0");
        let sheet = report(&Drive::hhd_95(), GeneratorKind::Cam);
        assert!((ideal - sheet.backlash_rad).abs() < 0.02 * sheet.backlash_rad, "{ideal} {}", sheet.backlash_rad);
        let worn = room("as_built.flexspline_wear_um=5");
        assert!(worn - ideal > 2.0 * 5e-3 / 49.0 && worn - ideal < 2.4 * 5e-3 / 49.0, "{worn} {ideal}");
        let [near, far] = [5.0, 40.0].map(|um| room(&format!("as_built.circular_spline_eccentricity_um={um}")));
        assert!(near < ideal && far < 0.0 && far < near, "{ideal} {near} {far}");
        // The room is the least of many that are straight in the displacement: it falls in proportion, or faster once
        // another tooth is tightest.
        let faster = (far - ideal) / (near - ideal);
        assert!((8.0 - 1e-6..12.0).contains(&faster), "{ideal} {near} {far}");
        assert!(room("as_built.circular_spline_ovality_um=20") < ideal);
        assert!(room("as_built.circular_spline_offset_um=40") < 0.0);
    }

    fn rounded(tip_rounding_mm: f64) -> Drive {
        let mut drive = Drive::hhd_95();
        drive.flexspline.tip_rounding_mm = tip_rounding_mm;
        drive.circular_spline.tip_rounding_mm = tip_rounding_mm;
        drive
    }

    const ARCMIN: f64 = PI / (180.0 * 60.0);

    #[test]
    fn gaps_backlash_and_ripple_of_the_default_design() {
        use GeneratorKind::*;
        // an independent program with sharp tips: least gap (µm), at (degrees), backlash ('), ripple (")
        let sharp = [
            (Cam, 6.9, 4.5, 0.98, 0.43),
            (DoubleDisc, 7.3, 5.0, 1.04, 0.38),
            (TwoRoller, 6.3, 4.0, 0.89, 0.60),
            (FourRoller, 7.6, 5.0, 1.08, 0.32),
        ];
        for rounding in [0.005, 0.03] {
            for (kind, gap_um, at_deg, backlash, ripple) in sharp {
                let found = report(&rounded(rounding), kind);
                let gap = 1e3 * found.least.gap_mm;
                assert!((gap - gap_um).abs() < 0.08, "{kind}: {gap} µm");
                let at = found.least.material_angle_rad.to_degrees().abs();
                assert!((at - at_deg).abs() < 0.6, "{kind}: {at}°");
                let play = found.backlash_rad / ARCMIN;
                assert!((play - backlash).abs() < 0.02, "{kind}: {play}'");
                let wave = 60.0 * found.ripple_rad / ARCMIN;
                assert!((wave - ripple).abs() < 0.06, "{kind}: {wave}\"");
                assert_eq!(found.interferences, []);
            }
        }
    }

    /// Tips 0.125 mm nearer to each other: a working depth of 1.6 modules.
    #[test]
    fn a_deeper_mesh_interferes_where_the_tips_pass() {
        let mut drive = rounded(0.005);
        drive.circular_spline.tip_radius_mm -= 0.125;
        let depth = drive.flexspline.tip_radius_mm + drive.generator.w0_mm - drive.circular_spline.tip_radius_mm;
        assert!((depth - 0.8).abs() < 1e-12);
        for kind in [GeneratorKind::Cam, GeneratorKind::TwoRoller, GeneratorKind::DoubleDisc] {
            let found = report(&drive, kind);
            assert_eq!(found.interferences.len(), 2, "{kind}: one on each flank");
            let [positive, negative] = found.interferences[..] else { unreachable!() };
            assert_eq!((positive.side, negative.side), (Side::Plus, Side::Minus));
            let at = positive.material_angle_rad.to_degrees();
            assert!((60.0..64.0).contains(&at), "{kind}: {at}°");
            assert!(positive.gap_mm < -1e-3, "{kind}: {}", positive.gap_mm);
            let worst = positive.gap_rad.min(negative.gap_rad);
            assert!((found.least.gap_rad - worst).abs() < 1e-12);
            assert_eq!(positive.flexspline_piece, PieceKind::TipRounding);
            let message = positive.to_string();
            assert!(
                message.starts_with("flexspline tooth 0, positive flank, tip rounding at radius 48.82"),
                "{message}"
            );
            assert!(message.contains("interferes by") && message.contains("at generator angle -6"), "{message}");
        }
        assert_eq!(report(&drive, GeneratorKind::FourRoller).interferences, []);
    }

    /// Both wheels without profile shift, same depth and clearances: 1.5 mm smaller everywhere.
    fn without_shift() -> Drive {
        let mut drive = rounded(0.005);
        let (f, c) = (&mut drive.flexspline, &mut drive.circular_spline);
        f.profile_shift -= 3.0;
        c.profile_shift -= 3.0;
        for radius in [&mut f.root_radius_mm, &mut f.tip_radius_mm, &mut c.root_radius_mm, &mut c.tip_radius_mm] {
            *radius -= 1.5;
        }
        drive
    }

    #[test]
    fn without_profile_shift_the_teeth_interfere() {
        let found = report(&without_shift(), GeneratorKind::Cam);
        let (gap, at) = (1e3 * found.least.gap_mm, found.least.material_angle_rad.to_degrees().abs());
        assert!((-17.0..-15.0).contains(&gap) && (54.0..56.0).contains(&at), "{gap} µm at {at}°");
        // a tenth of a module deeper it is 35 µm at 58 degrees
        let mut drive = without_shift();
        drive.circular_spline.tip_radius_mm -= 0.05;
        let found = report(&drive, GeneratorKind::Cam);
        let (gap, at) = (1e3 * found.least.gap_mm, found.least.material_angle_rad.to_degrees().abs());
        assert!((-40.0..-30.0).contains(&gap) && (56.0..59.0).contains(&at), "{gap} µm at {at}°");
    }

    #[test]
    fn the_deflection_that_works_for_every_generator() {
        // 0.475 to 0.515 mm; below it the two-roller clashes first, above 0.52 all bind at the axis
        for (w0, sound) in [(0.465, 3), (0.475, 4), (0.5, 4), (0.515, 4), (0.525, 0)] {
            let mut drive = rounded(0.005);
            drive.generator.w0_mm = w0;
            let clear = |kind: &GeneratorKind| report(&drive, *kind).interferences.is_empty();
            let count = GeneratorKind::ALL.iter().filter(|kind| clear(kind)).count();
            assert_eq!(count, sound, "w0 = {w0}");
        }
    }

    #[test]
    fn slopes_of_the_backlash() {
        let backlash = |edit: &dyn Fn(&mut Drive)| {
            let mut drive = rounded(0.005);
            edit(&mut drive);
            report(&drive, GeneratorKind::Cam).backlash_rad / ARCMIN
        };
        let per_shift = (backlash(&|d| d.circular_spline.profile_shift += 0.01) - backlash(&|_| ())) / 0.01;
        assert!((per_shift - 26.0).abs() < 0.5, "{per_shift}' per unit of shift");
        let per_um = (backlash(&|d| d.generator.w0_mm += 0.002) - backlash(&|d| d.generator.w0_mm -= 0.002)) / 4.0;
        assert!((per_um + 0.052).abs() < 0.002, "{per_um}' per µm of w0");
    }

    #[test]
    fn both_flanks_mirror_each_other() {
        let mesh = RigidMesh::new(&Drive::hhd_95(), GeneratorKind::FourRoller).unwrap();
        for k in 0..80 {
            let phi = 0.013 * f64::from(k) - 0.4;
            let (a, b) = (mesh.gap(phi, Side::Plus).unwrap(), mesh.gap(-phi, Side::Minus).unwrap());
            assert!((a.gap_rad - b.gap_rad).abs() < 1e-13, "{phi}: {} {}", a.gap_rad, b.gap_rad);
        }
        assert_eq!(mesh.gap(FRAC_PI_2, Side::Plus), None);
    }

    /// The gap against the plain distance of two dense polylines, before and after the space is turned to close it.
    #[test]
    fn turning_the_space_by_the_gap_makes_the_outlines_touch() {
        let mesh = RigidMesh::new(&Drive::hhd_95(), GeneratorKind::DoubleDisc).unwrap();
        for phi in [-0.3, 0.0, 0.08, 0.5, 0.8] {
            let gap = mesh.gap(phi, Side::Plus).unwrap();
            let ([x, y], normal) = mesh.curve.position(phi);
            let (s, c) = normal.sin_cos();
            let dense = |flank: &ToothFlank| -> Vec<[f64; 2]> {
                let pieces = flank.pieces().iter();
                pieces.flat_map(|piece| (0..=400).map(|k| piece.point(f64::from(k) / 400.0))).collect()
            };
            let tooth: Vec<[f64; 2]> = dense(&mesh.tooth)
                .into_iter()
                .map(|[px, py]| {
                    [x + (px - mesh.curve.radius_mm()) * c - py * s, y + (px - mesh.curve.radius_mm()) * s + py * c]
                })
                .collect();
            let distance = |turn: f64| {
                let (s, c) = (phi * 188.0 / 190.0 + turn).sin_cos();
                let space = dense(&mesh.space).into_iter().map(|[px, py]| [px * c - py * s, px * s + py * c]);
                space
                    .flat_map(|p| tooth.iter().map(move |q| (p[0] - q[0]).hypot(p[1] - q[1])))
                    .fold(f64::INFINITY, f64::min)
            };
            assert!(distance(-gap.gap_rad) < 2e-3, "{phi}: {}", distance(-gap.gap_rad));
            // half closed, between half the gap and that times the cosine of the steepest pressure angle
            let half = distance(-0.5 * gap.gap_rad) / gap.gap_mm;
            assert!((0.3..0.6).contains(&half), "{phi}: {half} of {} mm", gap.gap_mm);
        }
    }

    #[test]
    fn warming_one_wheel_takes_the_backlash_and_warming_both_does_not() {
        let mut drive = Drive::hhd_95();
        let backlash = |drive: &Drive| report(drive, GeneratorKind::Cam).backlash_rad / ARCMIN;
        let cold = backlash(&drive);
        assert!((backlash(&drive.at_temperature(60.0)) - cold).abs() < 1e-9);
        // flexspline warmer: -2 dr tan a / r, with dr = 0.56 µm/K at the teeth and the pressure angle 24.7° there
        let expected = -2.0 * 11.5e-6 * 24.7f64.to_radians().tan() / ARCMIN;
        drive.temperature.circular_spline_expansion_per_k = 0.0;
        let per_k = (backlash(&drive.at_temperature(25.0)) - cold) / 5.0;
        assert!((per_k / expected - 1.0).abs() < 0.03, "{per_k}'/K, expected {expected}");
    }
}
