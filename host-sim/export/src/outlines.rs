//! Outlines of tooth, space and generator as points, for CAD or a drawing.

use serde::Serialize;

use flexspline_mechanics::drive::{Drive, DriveError, GeneratorKind, GeneratorOutline, OutlinePiece, ToothFlank};

/// A point of an outline.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutlinePoint {
    /// `flexspline_tooth`, `circular_spline_space` or `generator`.
    pub part: &'static str,
    /// Piece of the outline: `root land` … of a tooth, the number of the closed curve of a generator.
    pub piece: String,
    /// Position in the part's own frame, mm: the axis of the tooth, of the space, or the major axis along +x.
    pub x_mm: f64,
    /// See `x_mm`.
    pub y_mm: f64,
}

/// The whole outline of a flexspline tooth and of a circular-spline space, from the root land on the side of negative
/// angles over the tip to that of positive angles (for the space from tip land to tip land), and the closed curves of
/// the generator, `per_piece` intervals to a piece. Joints appear in both pieces that meet there.
pub fn outlines(drive: &Drive, kind: GeneratorKind, per_piece: usize) -> Result<Vec<OutlinePoint>, DriveError> {
    let mut points = Vec::new();
    for (part, profile) in
        [("flexspline_tooth", ToothFlank::external(drive)?), ("circular_spline_space", ToothFlank::internal(drive)?)]
    {
        let pieces = profile.pieces();
        // The half outline is given on the positive side, from root to tip. A tooth is walked root, tip, root; a space,
        // whose tips are at its ends, tip, root, tip.
        let internal = profile.is_internal();
        for (side, rootwards) in [(-1.0, internal), (1.0, !internal)] {
            let mut walk: Vec<(&OutlinePiece, usize)> =
                pieces.iter().flat_map(|piece| (0..=per_piece).map(move |k| (piece, k))).collect();
            if rootwards {
                walk.reverse();
            }
            for (piece, k) in walk {
                let [x, y] = piece.point(k as f64 / per_piece as f64);
                let piece = piece.kind.name().to_owned();
                points.push(OutlinePoint { part, piece, x_mm: x, y_mm: side * y });
            }
        }
    }
    let around = 8 * per_piece;
    let curves = GeneratorOutline::new(drive, kind)?.polyline(around);
    for (curve, polyline) in curves.iter().enumerate() {
        for [x_mm, y_mm] in polyline.iter().chain(polyline.first()) {
            points.push(OutlinePoint { part: "generator", piece: curve.to_string(), x_mm: *x_mm, y_mm: *y_mm });
        }
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walk(part: &str) -> Vec<[f64; 2]> {
        let points = outlines(&Drive::hhd_95(), GeneratorKind::FourRoller, 12).unwrap();
        points.iter().filter(|p| p.part == part).map(|p| [p.x_mm, p.y_mm]).collect()
    }

    #[test]
    fn tooth_and_space_are_one_unbroken_line_over_a_whole_pitch() {
        for (part, teeth, ends_at, middle_at) in
            [("flexspline_tooth", 188.0, 47.875, 48.825), ("circular_spline_space", 190.0, 48.65, 49.45)]
        {
            let line = walk(part);
            let radius = |p: [f64; 2]| p[0].hypot(p[1]);
            let angle = |p: [f64; 2]| p[1].atan2(p[0]);
            for pair in line.windows(2) {
                let step = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
                assert!(step < 0.12, "{part}: a gap of {step} mm");
            }
            let (first, last) = (line[0], line[line.len() - 1]);
            let pitch = std::f64::consts::TAU / teeth;
            assert!((angle(last) - angle(first) - pitch).abs() < 1e-9, "{part}");
            assert!((radius(first) - ends_at).abs() < 1e-9 && (radius(last) - ends_at).abs() < 1e-9);
            let middle = line[line.len() / 2];
            assert!((radius(middle) - middle_at).abs() < 1e-9 && angle(middle).abs() < 1e-9, "{part}");
        }
    }

    #[test]
    fn the_generator_has_a_closed_curve_for_each_roller() {
        let points = outlines(&Drive::hhd_95(), GeneratorKind::FourRoller, 12).unwrap();
        for curve in ["0", "1", "2", "3"] {
            let on: Vec<_> = points.iter().filter(|p| p.part == "generator" && p.piece == curve).collect();
            assert_eq!(on.first(), on.last());
            assert_eq!(on.len(), 97);
        }
    }
}
