//! Offsets of the flanks of an as-built drive from those of the ideal one.
//!
//! Teeth and spaces are rigid bodies of their own here: each is turned about the axis of its wheel and then displaced,
//! in the frame that has the axis of the ideal tooth or space along +x. What is worn or broken off a flank opens the
//! gap along the normal: the parallel of an involute at that depth.

use super::as_built::{DamagedFlank, Wheel, direction, oval, sum_at};
use super::interference::Side;
use super::spec::Drive;
use std::f64::consts::TAU;

/// Rotates a vector by the angle of this sine and cosine.
#[inline]
pub fn rotate(v: [f64; 2], (sin, cos): (f64, f64)) -> [f64; 2] {
    [cos * v[0] - sin * v[1], sin * v[0] + cos * v[1]]
}

/// A rigid displacement in the plane: `x -> R x + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Sine and cosine of the rotation about the origin, counter-clockwise.
    pub turn: (f64, f64),
    /// Translation after it, mm.
    pub translation: [f64; 2],
}

impl Placement {
    /// This placement seen in the mirror `y -> -y`, in which flanks of the minus side are looked at.
    #[inline]
    pub(crate) fn seen_from(self, side: Side) -> Placement {
        match side {
            Side::Plus => self,
            Side::Minus => Placement {
                turn: (-self.turn.0, self.turn.1),
                translation: [self.translation[0], -self.translation[1]],
            },
        }
    }

    /// Where a point of the ideal part is.
    #[inline]
    pub fn place(&self, p: [f64; 2]) -> [f64; 2] {
        let turned = rotate(p, self.turn);
        [turned[0] + self.translation[0], turned[1] + self.translation[1]]
    }

    /// The point of the ideal part that is at `p`.
    #[inline]
    pub(crate) fn recover(&self, p: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.turn;
        rotate([p[0] - self.translation[0], p[1] - self.translation[1]], (-sin, cos))
    }
}

/// Deviations of the flanks of both wheels, by tooth of the flexspline and by space of the circular spline.
#[derive(Debug, Clone, PartialEq)]
pub struct FlankDeviations {
    /// Of each flexspline tooth, in its frame.
    pub teeth: Vec<Placement>,
    /// Of each circular-spline space, in its frame, which turns about the axis of the output.
    pub spaces: Vec<Placement>,
    /// Depth missing on the plus and the minus flank of each flexspline tooth, mm.
    pub tooth_depth: Vec<[f64; 2]>,
    /// Depth missing on the plus and the minus flank of each circular-spline space, mm; a preload is depth too much.
    pub space_depth: Vec<[f64; 2]>,
    /// Axis that the circular spline turns about, in the housing, mm. Its torque is the moment about this axis: that of
    /// its own bearing.
    pub axis: [f64; 2],
    /// No point of a flank is further from its ideal place than this, mm; both wheels and the axis together.
    pub largest: f64,
}

impl FlankDeviations {
    /// Those of a drive.
    pub fn new(drive: &Drive) -> FlankDeviations {
        let built = &drive.as_built;
        let (f, c) = (&drive.flexspline, &drive.circular_spline);
        let scaled = |amount_um: f64, angle_deg: f64| direction(angle_deg).map(|x| 1e-3 * amount_um * x);

        let runout = scaled(built.flexspline_runout_um, built.flexspline_runout_phase_deg);
        let middle = 0.5 * (f.root_radius_mm + f.tip_radius_mm);
        let teeth: Vec<Placement> = (0..f.teeth as usize)
            .map(|tooth| {
                let angle = TAU * tooth as f64 / f64::from(f.teeth);
                let along = sum_at(&built.flexspline_pitch_harmonics, angle)
                    + built.flexspline_pitch_error_um.get(tooth).copied().unwrap_or(0.0);
                Placement { turn: (1e-3 * along / middle).sin_cos(), translation: rotate(runout, (-angle).sin_cos()) }
            })
            .collect();

        let eccentricity = scaled(built.circular_spline_eccentricity_um, built.circular_spline_eccentricity_phase_deg);
        let middle = 0.5 * (c.root_radius_mm + c.tip_radius_mm);
        let crest = built.circular_spline_ovality_phase_deg.to_radians();
        let spaces: Vec<Placement> = (0..c.teeth as usize)
            .map(|space| {
                let angle = TAU * space as f64 / f64::from(c.teeth);
                let along = sum_at(&built.circular_spline_pitch_harmonics, angle)
                    + built.circular_spline_pitch_error_um.get(space).copied().unwrap_or(0.0);
                let (out, aside, rotation) = oval(1e-3 * built.circular_spline_ovality_um, middle, angle - crest);
                // The ring turns about its middle circle, not about the axis: the rotation about the axis carries that
                // circle along by `rotation * middle`, which the translation takes back.
                let turn = 1e-3 * along / middle + rotation;
                let [x, y] = rotate(eccentricity, (-angle).sin_cos());
                Placement { turn: turn.sin_cos(), translation: [x + out, y + aside - middle * rotation] }
            })
            .collect();

        let mut tooth_depth = vec![[1e-3 * built.flexspline_wear_um; 2]; teeth.len()];
        let mut space_depth = vec![[1e-3 * (built.circular_spline_wear_um - drive.flanks.preload_um); 2]; spaces.len()];
        for damaged in &built.damaged_teeth {
            for side in Side::BOTH {
                let hit = match damaged.flank {
                    DamagedFlank::Both => true,
                    DamagedFlank::Plus => side == Side::Plus,
                    DamagedFlank::Minus => side == Side::Minus,
                };
                if !hit {
                    continue;
                }
                let tooth = damaged.tooth as usize;
                let depth = match (damaged.wheel, side) {
                    (Wheel::Flexspline, side) => &mut tooth_depth[tooth][side.index()],
                    // A tooth of the circular spline bounds the space behind it with its clockwise flank, which is the
                    // counter-clockwise flank of that space, and the space ahead of it with the other.
                    (Wheel::CircularSpline, Side::Minus) => &mut space_depth[tooth][Side::Plus.index()],
                    (Wheel::CircularSpline, Side::Plus) => {
                        let ahead = (tooth + 1) % spaces.len();
                        &mut space_depth[ahead][Side::Minus.index()]
                    }
                };
                *depth += 1e-3 * damaged.depth_um;
            }
        }

        let axis = scaled(built.circular_spline_offset_um, built.circular_spline_offset_direction_deg);
        let of = |placements: &[Placement], outer: f64| {
            placements
                .iter()
                .map(|p| outer * p.turn.0.abs() + p.translation[0].hypot(p.translation[1]))
                .fold(0.0, f64::max)
        };
        let largest = of(&teeth, f.tip_radius_mm) + of(&spaces, c.root_radius_mm) + axis[0].hypot(axis[1]);
        FlankDeviations { teeth, spaces, tooth_depth, space_depth, axis, largest }
    }
}

#[cfg(test)]
mod tests {
    use super::super::as_built::{DamagedTooth, Harmonic};
    use super::*;

    #[test]
    fn an_ideal_drive_stands_where_it_should() {
        let ideal = FlankDeviations::new(&Drive::hhd_95());
        assert!(ideal.teeth.len() == 188 && ideal.spaces.len() == 190 && ideal.largest == 0.0);
        let nominal = Placement { turn: (0.0, 1.0), translation: [0.0; 2] };
        assert!(ideal.teeth.iter().chain(&ideal.spaces).all(|placement| *placement == nominal));
        assert!(ideal.tooth_depth.iter().chain(&ideal.space_depth).flatten().all(|depth| *depth == 0.0));
        assert_eq!(ideal.axis, [0.0; 2]);
    }

    /// A point of sector `k` of `teeth`, given in its frame, in the frame of the wheel.
    fn on_wheel(p: [f64; 2], k: usize, teeth: f64) -> [f64; 2] {
        Placement { turn: (TAU * k as f64 / teeth).sin_cos(), translation: [0.0; 2] }.place(p)
    }

    #[test]
    fn eccentric_rings_are_moved_as_a_whole() {
        let mut drive = Drive::hhd_95();
        drive.as_built.flexspline_runout_um = 10.0;
        drive.as_built.flexspline_runout_phase_deg = 40.0;
        drive.as_built.circular_spline_eccentricity_um = 7.0;
        drive.as_built.circular_spline_eccentricity_phase_deg = -100.0;
        let moved = FlankDeviations::new(&drive);
        for (placements, teeth, amount, phase) in
            [(&moved.teeth, 188.0, 0.01, 40f64), (&moved.spaces, 190.0, 0.007, -100f64)]
        {
            for (k, placement) in placements.iter().enumerate() {
                let p = [48.7, 0.4];
                let (a, b) = (on_wheel(p, k, teeth), on_wheel(placement.place(p), k, teeth));
                let (sin, cos) = phase.to_radians().sin_cos();
                assert!((b[0] - a[0] - amount * cos).abs() < 1e-13 && (b[1] - a[1] - amount * sin).abs() < 1e-13);
            }
        }
        assert!((moved.largest - 0.017).abs() < 1e-12);
    }

    #[test]
    fn pitch_errors_are_arcs_at_half_the_height_of_the_teeth() {
        let mut drive = Drive::hhd_95();
        drive.as_built.flexspline_pitch_harmonics = vec![Harmonic { order: 2, amplitude_um: 5.0, phase_deg: 90.0 }];
        drive.as_built.flexspline_pitch_error_um = (0..188).map(|k| if k == 3 { -2.0 } else { 0.0 }).collect();
        let moved = FlankDeviations::new(&drive);
        for (k, placement) in moved.teeth.iter().enumerate() {
            let expected = 5e-3 * (2.0 * (TAU * k as f64 / 188.0 - TAU / 4.0)).cos() - if k == 3 { 2e-3 } else { 0.0 };
            let [x, y] = placement.place([48.35, 0.0]);
            assert!((48.35 * y.atan2(x) - expected).abs() < 1e-12 && (x.hypot(y) - 48.35).abs() < 1e-12);
        }
    }

    #[test]
    fn an_oval_moves_the_middle_of_the_teeth_and_turns_them() {
        let mut drive = Drive::hhd_95();
        drive.as_built.circular_spline_ovality_um = 10.0;
        drive.as_built.circular_spline_ovality_phase_deg = 15.0;
        let moved = FlankDeviations::new(&drive);
        let middle = 49.05;
        for (k, placement) in moved.spaces.iter().enumerate() {
            let from_crest = TAU * k as f64 / 190.0 - 15f64.to_radians();
            let [x, y] = placement.place([middle, 0.0]);
            assert!((x - middle - 0.01 * (2.0 * from_crest).cos()).abs() < 1e-5);
            assert!((y + 0.005 * (2.0 * from_crest).sin()).abs() < 1e-6);
            let d = rotate([1.0, 0.0], placement.turn);
            assert!((d[1] - 1.5 * 0.01 / middle * (2.0 * from_crest).sin()).abs() < 1e-9);
        }
    }

    #[test]
    fn depth_is_missing_where_it_is_said_to_be() {
        let mut drive = Drive::hhd_95();
        drive.as_built.circular_spline_wear_um = 1.0;
        let damaged = |wheel, tooth, flank| DamagedTooth { wheel, tooth, flank, depth_um: 50.0 };
        drive.as_built.damaged_teeth = vec![
            damaged(Wheel::Flexspline, 7, DamagedFlank::Minus),
            damaged(Wheel::CircularSpline, 189, DamagedFlank::Both),
        ];
        let found = FlankDeviations::new(&drive);
        for (k, depth) in found.tooth_depth.iter().enumerate() {
            assert_eq!(*depth, if k == 7 { [0.0, 0.05] } else { [0.0, 0.0] });
        }
        for (k, depth) in found.space_depth.iter().enumerate() {
            // Tooth 189 stands between space 189 and space 0.
            let expected = match k {
                189 => [0.051, 0.001],
                0 => [0.001, 0.051],
                _ => [0.001, 0.001],
            };
            assert!((depth[0] - expected[0]).abs() < 1e-15 && (depth[1] - expected[1]).abs() < 1e-15, "space {k}");
        }
    }

    #[test]
    fn a_placement_seen_in_the_mirror_is_that_of_the_mirrored_point() {
        let placement = Placement { turn: 0.02f64.sin_cos(), translation: [0.01, -0.03] };
        let p = [48.0, 0.3];
        let [x, y] = placement.place(p);
        let mirrored = placement.seen_from(Side::Minus).place([p[0], -p[1]]);
        assert!((mirrored[0] - x).abs() < 1e-13 && (mirrored[1] + y).abs() < 1e-13);
        let back = placement.recover([x, y]);
        assert!((back[0] - p[0]).abs() < 1e-13 && (back[1] - p[1]).abs() < 1e-13);
    }
}
