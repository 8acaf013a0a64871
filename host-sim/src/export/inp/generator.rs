//! The wave generator as bodies of a deck: strips of elements behind the outline, every node prescribed.
//!
//! A node stands at `p0` before assembly and at `p` when the generator has its form, major axis along +x; turned by psi it
//! stands at `R(psi) p`. Three numbers move all nodes, and they enter linearly:
//!
//! `u = form (p - p0) + c p + s J p`,  `form` from 0 to 1, then `c = cos psi - 1`, `s = sin psi`, `J` a quarter turn.
//!
//! So the whole body hangs on three degrees of freedom by linear equations, exactly rigid wherever c and s lie on the circle.
//! The work-conjugate forces to c and s are the torque of the generator, `M = cos(psi) F_s - sin(psi) F_c`; CalculiX prints
//! no forces that come through equations, so that torque cannot be read from its output.
//!
//! Before assembly the cam is a circle that just fits the undeformed bore; rollers and discs stand pulled in along their
//! arm. Faces are quadratic through points of the exact outline: on the sharpest of them, a roller of 13 mm radius, the
//! parabola of a [`FACET`] leaves its circle by less than 0.1 nm.

use std::f64::consts::TAU;

use super::Point;
use crate::drive::GeneratorOutline;

/// Length of a contact face, mm: about that of an edge of the bore.
const FACET: f64 = 0.4;
/// Depth of a strip behind its face, mm.
const DEPTH: f64 = 1.0;
/// Half the arc of a roller that is meshed, rad: the rim wraps a few degrees of it.
const ROLLER_ARC: f64 = 1.0;
/// Half the arc of a disc that is meshed, rad: the discs of the two lobes cross near a quarter turn.
const DISC_ARC: f64 = 1.45;
/// What lies between the generator before assembly and the bore, mm.
const CLEARANCE: f64 = 1e-4;

/// The bodies of a generator, node numbers from 0.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct GeneratorBody {
    /// Where each node stands before assembly, mm.
    pub before: Vec<Point>,
    /// Where it stands with the form of the generator, major axis along +x, mm.
    pub formed: Vec<Point>,
    /// Elements; the second edge of each (from corner 1 to corner 2) lies on the outline.
    pub elements: Vec<[u32; 8]>,
}

/// A point of an outline, its unit outward normal, and the same before assembly.
type FacePoint = [(Point, Point); 2];

impl GeneratorBody {
    /// Meshes the outline of a generator that goes into a bore of `bore_radius` (mm).
    pub fn new(outline: &GeneratorOutline, bore_radius: f64) -> GeneratorBody {
        let mut body = GeneratorBody { before: Vec::new(), formed: Vec::new(), elements: Vec::new() };
        let Some((centre, radius)) = outline.circle() else {
            let facets = (TAU * bore_radius / FACET).ceil() as usize;
            let ring = outline.polyline(2 * facets);
            let points = ring[0].iter().enumerate().map(|(k, &formed)| {
                let radial = unit_at(TAU * k as f64 / (2 * facets) as f64);
                let r = bore_radius - CLEARANCE;
                [([r * radial[0], r * radial[1]], radial), (formed, outline.nearest(formed).normal)]
            });
            body.add_strip(&points.collect::<Vec<_>>(), true);
            return body;
        };
        let reach = centre[0].hypot(centre[1]) + radius;
        let arm = unit_at(centre[1].atan2(centre[0]));
        let pulled_in = reach - bore_radius + CLEARANCE;
        let half_arc = if radius < 0.5 * bore_radius { ROLLER_ARC } else { DISC_ARC };
        let half_facets = (half_arc * radius / FACET).ceil();
        let signs: &[[f64; 2]] = if centre[1] == 0.0 {
            &[[1.0, 1.0], [-1.0, 1.0]]
        } else {
            &[[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]
        };
        for [sx, sy] in signs {
            let (centre, arm) = ([sx * centre[0], sy * centre[1]], [sx * arm[0], sy * arm[1]]);
            let middle = arm[1].atan2(arm[0]);
            let points = (0..=4 * half_facets as usize).map(|k| {
                let normal = unit_at(middle + half_arc * (0.5 * k as f64 / half_facets - 1.0));
                let formed = [centre[0] + radius * normal[0], centre[1] + radius * normal[1]];
                let before = [formed[0] - pulled_in * arm[0], formed[1] - pulled_in * arm[1]];
                [(before, normal), (formed, normal)]
            });
            body.add_strip(&points.collect::<Vec<_>>(), false);
        }
        body
    }

    /// Adds a strip behind a counter-clockwise chain of face points at corners and midsides.
    fn add_strip(&mut self, face: &[FacePoint], closed: bool) {
        let first = self.before.len() as u32;
        let mut place = |depth: f64, [before, formed]: &FacePoint| {
            let at = |(p, n): &(Point, Point)| [p[0] - depth * n[0], p[1] - depth * n[1]];
            self.before.push(at(before));
            self.formed.push(at(formed));
        };
        // Per corner: face, middle, back; per midside: face, back.
        for (k, point) in face.iter().enumerate() {
            place(0.0, point);
            if k % 2 == 0 {
                place(0.5 * DEPTH, point);
            }
            place(DEPTH, point);
        }
        let last = self.before.len() as u32;
        let facets = if closed { face.len() / 2 } else { (face.len() - 1) / 2 };
        for k in 0..facets as u32 {
            let here = first + 5 * k;
            let next = if here + 5 < last { here + 5 } else { first };
            self.elements.push([here + 2, here, next, next + 2, here + 1, here + 3, next + 1, here + 4]);
        }
    }
}

fn unit_at(angle: f64) -> Point {
    [angle.cos(), angle.sin()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Drive, GeneratorKind};
    use crate::element::{edge_shape, gauss_points};

    fn body(kind: GeneratorKind) -> (GeneratorOutline, GeneratorBody) {
        let drive = Drive::hhd_95();
        let outline = GeneratorOutline::new(&drive, kind).unwrap();
        let body = GeneratorBody::new(&outline, drive.flexspline.bore_radius_mm());
        (outline, body)
    }

    #[test]
    fn faces_lie_on_the_exact_outline_between_the_nodes_too() {
        for kind in GeneratorKind::ALL {
            let (outline, body) = body(kind);
            for element in &body.elements {
                let [a, m, b] = [element[1], element[5], element[2]].map(|n| body.formed[n as usize]);
                for xi in [-1.0, -0.6, -0.3, 0.0, 0.45, 0.8] {
                    let n = edge_shape(xi);
                    let p = std::array::from_fn(|k| n[0] * a[k] + n[1] * m[k] + n[2] * b[k]);
                    let off = outline.nearest(p).distance;
                    assert!(off.abs() < 2e-7, "{kind}: {off} mm off the outline at {p:?}");
                }
            }
        }
    }

    #[test]
    fn elements_are_sound_before_and_after_and_use_every_node() {
        for kind in GeneratorKind::ALL {
            let (_, body) = body(kind);
            let mut used = vec![false; body.before.len()];
            for element in &body.elements {
                for nodes in [&body.before, &body.formed] {
                    assert!(gauss_points(&element.map(|n| nodes[n as usize])).is_ok(), "{kind}: folded");
                }
                for &n in element {
                    used[n as usize] = true;
                }
            }
            assert!(used.iter().all(|used| *used), "{kind}: a node without element");
        }
    }

    #[test]
    fn before_assembly_the_generator_fits_the_bore_and_its_form_does_not() {
        let bore = Drive::hhd_95().flexspline.bore_radius_mm();
        for kind in GeneratorKind::ALL {
            let (_, body) = body(kind);
            let reach = |nodes: &[Point]| nodes.iter().map(|p| p[0].hypot(p[1])).fold(0.0, f64::max);
            assert!((bore - reach(&body.before) - CLEARANCE).abs() < 1e-6, "{kind}: {}", reach(&body.before));
            assert!(reach(&body.formed) > bore + 0.2, "{kind}: {}", reach(&body.formed));
        }
    }
}
