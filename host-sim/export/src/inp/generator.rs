//! The wave generator as bodies of a deck: strips of elements behind the outline, every node prescribed.
//!
//! A rigid generator without friction acts by its outline alone; which of its points lies where along it is free. The
//! points follow the bore: each face of cam and discs stays opposite the edge of the bore that it faces, its nodes
//! where the rim of exactly constant length would put the nodes of that edge, projected onto the outline, and rollers
//! roll. Turning the generator by 0.01 rad then moves a face by some 10 µm, outward or inward, instead of sliding it
//! along the bore by 0.5 mm. CalculiX needs that: it pairs points of the faces at the start of an increment and keeps
//! to the tangent there (`precontact` in its `nonlingeo.c`), so that a bore that has slid by s along a generator ends
//! `s²/2R` inside it: 2.4 µm, and 13″ of output, for 0.01 rad.
//!
//! Before assembly cam and discs are a circle that just fits the undeformed bore; rollers stand pulled in along their
//! arm. Faces are quadratic through points of the exact outline: parabolas that leave the sharpest of them, a roller of
//! 13 mm radius, by less than 1 nm.

use std::f64::consts::TAU;

use super::Point;
use flexspline_mechanics::drive::GeneratorOutline;
use flexspline_mechanics::mesh::{WheelMesh, rotate};

/// Depth of a strip behind its face, mm.
const DEPTH: f64 = 1.0;
/// Length of a face of a roller, mm.
const ROLLER_FACE: f64 = 0.2;
/// Gap between the generator before assembly and the bore, mm.
const CLEARANCE: f64 = 1e-4;

/// The bodies of a generator. Node numbers count from 0.
#[derive(Debug, Clone)]
pub(super) struct GeneratorBody {
    outline: GeneratorOutline,
    bore_radius: f64,
    shape: SurfaceShape,
    /// Elements; the second edge of each (from corner 1 to corner 2) lies on the outline.
    pub elements: Vec<[u32; 8]>,
}

#[derive(Debug, Clone)]
enum SurfaceShape {
    /// A ring with its faces opposite the edges of the bore: material angles of corners and midsides in turn.
    Ring(Vec<f64>),
    /// Circles about these centres: corners and midsides of each.
    Rollers { centres: Vec<Point>, radius: f64, points: usize },
}

/// A point of the outline and the unit vector out of the body there.
type FacePoint = (Point, Point);

impl GeneratorBody {
    /// Meshes the outline of a generator that goes into the bore of `mesh`.
    pub fn new(outline: &GeneratorOutline, mesh: &WheelMesh) -> GeneratorBody {
        let circle = outline.circle().filter(|(_, radius)| *radius < 0.5 * mesh.base_radius);
        let (shape, strips) = match circle {
            None => {
                let points = 2 * mesh.teeth * mesh.base_edges.len();
                let first = -0.5 * mesh.pitch();
                (
                    SurfaceShape::Ring((0..points).map(|k| first + TAU * k as f64 / points as f64).collect()),
                    vec![points],
                )
            }
            Some(([x, y], radius)) => {
                let points = 2 * (TAU * radius / ROLLER_FACE).ceil() as usize;
                let centres =
                    if y == 0.0 { vec![[x, 0.0], [-x, 0.0]] } else { vec![[x, y], [-x, y], [-x, -y], [x, -y]] };
                let strips = vec![points; centres.len()];
                (SurfaceShape::Rollers { centres, radius, points }, strips)
            }
        };
        let mut elements = Vec::new();
        let mut first = 0;
        for points in strips {
            // Nodes of a corner: face, middle, back; of a midside: face, back.
            let after = first + 5 * points as u32 / 2;
            for here in (first..after).step_by(5) {
                let next = if here + 5 < after { here + 5 } else { first };
                elements.push([here + 2, here, next, next + 2, here + 1, here + 3, next + 1, here + 4]);
            }
            first = after;
        }
        GeneratorBody { outline: outline.clone(), bore_radius: mesh.base_radius, shape, elements }
    }

    /// Whether the rim touches it in narrow places and may creep along them.
    pub(crate) fn is_rollers(&self) -> bool {
        matches!(self.shape, SurfaceShape::Rollers { .. })
    }

    /// Where the nodes stand before assembly, mm.
    pub fn before(&self) -> Vec<Point> {
        match &self.shape {
            SurfaceShape::Ring(angles) => nodes_behind(angles.iter().map(|angle| {
                let radial = unit_at(*angle);
                (radial.map(|x| (self.bore_radius - CLEARANCE) * x), radial)
            })),
            SurfaceShape::Rollers { centres, radius, .. } => {
                let pulled = |c: &Point| {
                    let arm = c[0].hypot(c[1]);
                    let to = self.bore_radius - CLEARANCE - radius;
                    c.map(|x| x * to / arm)
                };
                self.rollers(&centres.iter().map(pulled).collect::<Vec<_>>(), 0.0)
            }
        }
    }

    /// Where they stand with the generator at an angle (rad), mm.
    pub fn at(&self, generator_rad: f64) -> Vec<Point> {
        let turned = generator_rad.sin_cos();
        match &self.shape {
            SurfaceShape::Ring(angles) => nodes_behind(angles.iter().map(|angle| {
                let (point, normal) = self.opposite(angle - generator_rad);
                (rotate(point, turned), rotate(normal, turned))
            })),
            SurfaceShape::Rollers { centres, radius, .. } => {
                let centres: Vec<Point> = centres.iter().map(|c| rotate(*c, turned)).collect();
                // The bore passes the generator by its own radius times the angle.
                self.rollers(&centres, generator_rad * (1.0 - self.bore_radius / radius))
            }
        }
    }

    /// The point of the outline opposite the bore at a material angle, in the frame of the generator.
    fn opposite(&self, material_angle: f64) -> FacePoint {
        let ([x, y], normal) = self.outline.neutral().position(material_angle);
        let inward = self.outline.neutral().radius_mm() - self.bore_radius;
        let n = unit_at(normal);
        let mut point = [x - inward * n[0], y - inward * n[1]];
        // One step along the normal lands on the outline, but for what a change of the nearest circle or round-off
        // leaves.
        for _ in 0..3 {
            let foot = self.outline.nearest(point);
            point = [point[0] - foot.distance * foot.normal[0], point[1] - foot.distance * foot.normal[1]];
        }
        (point, self.outline.nearest(point).normal)
    }

    fn rollers(&self, centres: &[Point], turned_rad: f64) -> Vec<Point> {
        let SurfaceShape::Rollers { radius, points, .. } = self.shape else { return Vec::new() };
        let mut nodes = Vec::new();
        for centre in centres {
            nodes.extend(nodes_behind((0..points).map(|k| {
                let normal = unit_at(turned_rad + TAU * k as f64 / points as f64);
                ([centre[0] + radius * normal[0], centre[1] + radius * normal[1]], normal)
            })));
        }
        nodes
    }
}

/// Nodes of a strip: of corners on the face, halfway and behind, of midsides on the face and behind.
fn nodes_behind(face: impl Iterator<Item = FacePoint>) -> Vec<Point> {
    let mut nodes = Vec::new();
    for (k, (p, n)) in face.enumerate() {
        let behind = |depth: f64| [p[0] - depth * n[0], p[1] - depth * n[1]];
        nodes.push(p);
        if k % 2 == 0 {
            nodes.push(behind(0.5 * DEPTH));
        }
        nodes.push(behind(DEPTH));
    }
    nodes
}

fn unit_at(angle: f64) -> Point {
    [angle.cos(), angle.sin()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::drive::{Drive, GeneratorKind};
    use flexspline_mechanics::fem::element::{edge_shape, gauss_points};
    use flexspline_mechanics::mesh::MeshLevel;

    fn body(kind: GeneratorKind) -> GeneratorBody {
        let drive = Drive::hhd_95();
        let outline = GeneratorOutline::new(&drive, kind).unwrap();
        GeneratorBody::new(&outline, &WheelMesh::flexspline(&drive, MeshLevel::Coarse).unwrap())
    }

    #[test]
    fn faces_lie_on_the_exact_outline_between_the_nodes_too() {
        for kind in GeneratorKind::ALL {
            let body = body(kind);
            for psi in [0.0, 0.3] {
                let nodes = body.at(psi);
                for element in &body.elements {
                    let [a, m, b] =
                        [element[1], element[5], element[2]].map(|n| rotate(nodes[n as usize], f64::sin_cos(-psi)));
                    // Where the discs cross there is a corner that no bore touches.
                    if kind == GeneratorKind::DoubleDisc && a[0].abs().min(b[0].abs()) < 1.0 {
                        continue;
                    }
                    for xi in [-1.0, -0.6, -0.3, 0.0, 0.45, 0.8] {
                        let n = edge_shape(xi);
                        let p = std::array::from_fn(|k| n[0] * a[k] + n[1] * m[k] + n[2] * b[k]);
                        let off = body.outline.nearest(p).distance;
                        assert!(off.abs() < 1e-6, "{kind}: {off} mm off the outline at {p:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn faces_follow_the_bore_and_do_not_slide_along_it() {
        for kind in GeneratorKind::ALL {
            let body = body(kind);
            let (start, end) = (body.at(0.0), body.at(0.01));
            // Where the generator reaches farthest out, the bore lies on it.
            let radius = |p: &Point| p[0].hypot(p[1]);
            let reach = start.iter().map(radius).fold(0.0, f64::max);
            for (p, q) in start.iter().zip(&end).filter(|(p, _)| radius(p) > reach - 0.01) {
                let along = (q[1] * p[0] - q[0] * p[1]) / radius(p);
                assert!(along.abs() < 0.02, "{kind}: slides by {along} mm");
            }
        }
    }

    #[test]
    fn elements_are_sound_before_and_after_and_use_every_node() {
        for kind in GeneratorKind::ALL {
            let body = body(kind);
            let placed = [body.before(), body.at(0.0), body.at(1.0)];
            let mut used = vec![false; placed[0].len()];
            for element in &body.elements {
                for nodes in &placed {
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
            let body = body(kind);
            let reach = |nodes: &[Point]| nodes.iter().map(|p| p[0].hypot(p[1])).fold(0.0, f64::max);
            let (before, formed) = (reach(&body.before()), reach(&body.at(0.0)));
            assert!(bore - before > 0.9 * CLEARANCE && bore - before < 1e-2, "{kind}: {before}");
            assert!(formed > bore + 0.2, "{kind}: {formed}");
        }
    }
}
