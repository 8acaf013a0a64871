//! Wave generator on the bore of the flexspline: unilateral, frictionless (it rolls).

use crate::drive::{GeneratorOutline, OutlineFoot, rotate};
use crate::fem::element::edge_shape;
use crate::mesh::WheelMesh;

use super::quadrature::gauss_legendre;

/// Stiffness of the contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoreLaw {
    /// Penalty and, in series, the bearing of the generator: pressure per penetration, N/mm³.
    pub stiffness: f64,
}

impl BoreLaw {
    /// Penalty in series with a bearing stiffness (both N/mm³); no bearing means rigid.
    pub fn new(penalty: f64, bearing: Option<f64>) -> BoreLaw {
        BoreLaw { stiffness: bearing.map_or(penalty, |b| 1.0 / (1.0 / penalty + 1.0 / b)) }
    }
}

/// Integration points on the bore: the same in every edge.
#[derive(Debug, Clone)]
pub struct BoreContact {
    /// Nodes of each edge around the bore: start, middle, end.
    pub edges: Vec<[u32; 3]>,
    /// Angle of the middle of each edge, rad, ascending from that of edge 0.
    pub middle_angles: Vec<f64>,
    /// Undeformed place of start, middle and end of each edge, on the exact bore.
    places: Vec<[[f64; 2]; 3]>,
    /// Undeformed place of each integration point, edge by edge.
    point_places: Vec<[f64; 2]>,
    /// Weight (mm) and shape functions of each point of an edge.
    points: Vec<(f64, [f64; 3])>,
}

/// Largest deviation of the gap along an edge of 0.4 mm from a quadratic, mm: of the distance from a circle of 13 mm
/// the fourth order is 1e-7 mm.
const BORE_SMOOTHNESS: f64 = 1e-6;

/// Edges known to be open, and for how long.
#[derive(Debug, Clone, Default)]
pub struct OpenEdges {
    /// How far (mm) any node may have moved, all steps added up; the generator stands still.
    pub moved: f64,
    /// Each edge is open until the nodes have moved this far.
    until: Vec<f64>,
}

/// Contact of one edge.
#[derive(Debug, Clone)]
pub struct BorePressure {
    /// Which edge.
    pub edge: usize,
    /// Nodal forces on the flexspline (N/mm), x and y of start, middle, end.
    pub force: [f64; 6],
    /// Tangent, packed lower triangle of 6 x 6.
    pub stiffness: [f64; 21],
    /// Moment of the contact forces about the axis, on the flexspline (N mm/mm).
    pub moment: f64,
    /// Largest pressure (MPa) and where it acts.
    pub peak: f64,
    /// Energy stored in the penalty (N mm/mm).
    pub energy: f64,
}

impl BoreContact {
    /// Points on the bore of a mesh, `per_edge` to an edge. Sixteen make the passing of nodes under a roller invisible.
    pub fn new(mesh: &WheelMesh, per_edge: usize) -> BoreContact {
        let mut edges = Vec::new();
        let mut middle_angles = Vec::new();
        let per_sector = mesh.base_edges.len();
        let width = mesh.pitch() / per_sector as f64;
        for sector in 0..mesh.teeth {
            for (k, edge) in mesh.base_edges.iter().enumerate() {
                edges.push(mesh.edge_nodes(sector, edge).map(|n| n as u32));
                middle_angles.push(mesh.sector_angle(sector) + (k as f64 + 0.5 - 0.5 * per_sector as f64) * width);
            }
        }
        let half_angle = 0.5 * width;
        let rule = gauss_legendre(per_edge);
        // Where the rim is thicker the bore stands further in.
        let on_bore = |angle: f64| -> [f64; 2] {
            let radius = if mesh.rim.is_none() { mesh.base_radius } else { mesh.base_radius - mesh.rim.at(angle) };
            let (s, c) = angle.sin_cos();
            [radius * c, radius * s]
        };
        let places = middle_angles.iter().map(|m| [m - half_angle, m + 0.0, m + half_angle].map(on_bore)).collect();
        let point_places = middle_angles
            .iter()
            .flat_map(|m| rule.iter().map(move |(xi, _)| m + xi * half_angle))
            .map(on_bore)
            .collect();
        let points =
            rule.iter().map(|(xi, weight)| (weight * half_angle * mesh.base_radius, edge_shape(*xi))).collect();
        BoreContact { edges, middle_angles, places, point_places, points }
    }

    /// Contact of the bore displaced by `u` (x and y of each node) with the generator turned by `generator_rad`, edge
    /// by edge; edges without contact are not reported. Passes over edges that `open` knows to be open, and updates it
    /// for others.
    pub fn evaluate(
        &self,
        law: BoreLaw,
        outline: &GeneratorOutline,
        generator_rad: f64,
        u: &[f64],
        open: &mut OpenEdges,
        mut report: impl FnMut(&BorePressure),
    ) {
        let turn @ (sin, cos) = generator_rad.sin_cos();
        let feet_of = |points: &[[f64; 2]], feet: &mut Vec<OutlineFoot>| {
            let points: Vec<[f64; 2]> = points.iter().map(|x| rotate(*x, (-sin, cos))).collect();
            outline.nearest_each(&points, feet);
            feet.iter_mut().for_each(|foot| foot.normal = rotate(foot.normal, turn));
        };
        open.until.resize(self.edges.len(), 0.0);
        let node_u = |edge: usize| self.edges[edge].map(|n| [u[2 * n as usize], u[2 * n as usize + 1]]);
        let is_known = |edge: &usize| open.moved < open.until[*edge];
        let looked_at: Vec<usize> = (0..self.edges.len()).filter(|edge| !is_known(edge)).collect();
        // Where an edge begins the one before has ended, if it is looked at.
        let begins = |k: usize| k == 0 || looked_at[k - 1] + 1 != looked_at[k];
        let mut points = Vec::with_capacity(3 * looked_at.len());
        for (k, &edge) in looked_at.iter().enumerate() {
            let moved = self.places[edge].iter().zip(node_u(edge)).map(|(x, u)| [x[0] + u[0], x[1] + u[1]]);
            points.extend(moved.skip(usize::from(!begins(k))));
        }
        let (mut ends, mut feet) = (Vec::new(), Vec::new());
        feet_of(&points, &mut ends);
        let mut ends = ends.iter().map(|foot| foot.distance);
        let mut next = || ends.next().expect("one for each point");
        let mut before = 0.0;
        for (k, &edge) in looked_at.iter().enumerate() {
            let gaps = [if begins(k) { next() } else { before }, next(), next()];
            before = gaps[2];
            // Along the edge the gap is quadratic to BORE_SMOOTHNESS, and a quadratic lies above its Bernstein
            // coefficients.
            let bound = gaps[0].min(gaps[2]).min(2.0 * gaps[1] - 0.5 * (gaps[0] + gaps[2])) - BORE_SMOOTHNESS;
            if bound > 0.0 {
                open.until[edge] = open.moved + bound;
                continue;
            }
            let mut contact =
                BorePressure { edge, force: [0.0; 6], stiffness: [0.0; 21], moment: 0.0, peak: 0.0, energy: 0.0 };
            let mut touching = false;
            let node_u = node_u(edge);
            points.clear();
            points.extend(self.points.iter().zip(&self.point_places[edge * self.points.len()..]).map(
                |((_, n), place)| {
                    [0, 1].map(|k| place[k] + n[0] * node_u[0][k] + n[1] * node_u[1][k] + n[2] * node_u[2][k])
                },
            ));
            feet_of(&points, &mut feet);
            for (((weight, n), x), foot) in self.points.iter().zip(&points).zip(&feet) {
                if foot.distance >= 0.0 {
                    continue;
                }
                touching = true;
                let pressure = -law.stiffness * foot.distance;
                let load = pressure * weight;
                contact.peak = contact.peak.max(pressure);
                contact.energy -= 0.5 * load * foot.distance;
                let f = [load * foot.normal[0], load * foot.normal[1]];
                contact.moment += x[0] * f[1] - x[1] * f[0];
                // Hessian of the penalty energy: normal stiffness and, from the curvature of the outline, a small
                // destabilising tangential part.
                let normal = law.stiffness * weight;
                let tangential = -load * foot.curvature / (1.0 + foot.curvature * foot.distance);
                let [nx, ny] = foot.normal;
                let k = [
                    normal * nx * nx + tangential * ny * ny,
                    (normal - tangential) * nx * ny,
                    normal * ny * ny + tangential * nx * nx,
                ];
                for a in 0..3 {
                    contact.force[2 * a] += n[a] * f[0];
                    contact.force[2 * a + 1] += n[a] * f[1];
                    for b in 0..=a {
                        let nn = n[a] * n[b];
                        let row_x = a * (2 * a + 1);
                        let row_y = row_x + 2 * a + 1;
                        contact.stiffness[row_x + 2 * b] += nn * k[0];
                        if b < a {
                            contact.stiffness[row_x + 2 * b + 1] += nn * k[1];
                        }
                        contact.stiffness[row_y + 2 * b] += nn * k[1];
                        contact.stiffness[row_y + 2 * b + 1] += nn * k[2];
                    }
                }
            }
            if touching {
                report(&contact);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Drive, GeneratorKind};
    use crate::mesh::MeshLevel;

    #[test]
    fn a_bearing_acts_in_series() {
        assert_eq!(BoreLaw::new(1e6, None).stiffness, 1e6);
        assert!((BoreLaw::new(1e6, Some(1e6)).stiffness - 5e5).abs() < 1e-6);
        assert!((BoreLaw::new(1e9, Some(170.0)).stiffness - 170.0).abs() < 1e-3);
    }

    #[test]
    fn edges_and_weights_go_once_around_the_bore() {
        let mesh = WheelMesh::flexspline(&Drive::hhd_95(), MeshLevel::Coarse).unwrap();
        let bore = BoreContact::new(&mesh, 16);
        for (edge, next) in bore.edges.iter().zip(bore.edges.iter().cycle().skip(1)) {
            assert_eq!(edge[2], next[0]);
        }
        for (nodes, angle) in bore.edges.iter().zip(&bore.middle_angles) {
            let x = mesh.nodes[nodes[1] as usize];
            let (s, c) = angle.sin_cos();
            assert!((x[0] * s - x[1] * c).abs() < 1e-12 && x[0] * c + x[1] * s > 0.0);
        }
        let around = bore.points.iter().map(|(weight, _)| weight).sum::<f64>() * bore.edges.len() as f64;
        assert!((around - std::f64::consts::TAU * mesh.base_radius).abs() < 1e-10);
    }

    /// An undeformed bore stands on the rollers only: on the major axis of wherever the generator points.
    #[test]
    fn rollers_push_outward_where_they_stand() {
        let drive = Drive::hhd_95();
        let mesh = WheelMesh::flexspline(&drive, MeshLevel::Coarse).unwrap();
        let bore = BoreContact::new(&mesh, 16);
        let outline = GeneratorOutline::new(&drive, GeneratorKind::TwoRoller).unwrap();
        let u = vec![0.0; 2 * mesh.nodes.len()];
        for turned in [0.0, 0.7, 0.7 + std::f64::consts::PI] {
            let (mut sum, mut outward, mut moment) = ([0.0; 2], 0.0, 0.0);
            bore.evaluate(BoreLaw::new(1e4, None), &outline, turned, &u, &mut OpenEdges::default(), |edge| {
                let angle = bore.middle_angles[edge.edge];
                assert!((2.0 * (angle - turned)).cos() > 0.9, "contact at {angle}, generator at {turned}");
                let (s, c) = angle.sin_cos();
                for a in 0..3 {
                    sum = [sum[0] + edge.force[2 * a], sum[1] + edge.force[2 * a + 1]];
                    outward += c * edge.force[2 * a] + s * edge.force[2 * a + 1];
                }
                moment += edge.moment;
            });
            assert!(outward > 1e3, "{outward} N/mm");
            let unbalanced = sum[0].hypot(sum[1]) / outward;
            assert!(unbalanced < 1e-9, "the two rollers differ by {unbalanced}");
            // Every force points at the axis of its roller, and the rollers stand on the major axis.
            let arm = moment / outward;
            assert!(arm.abs() < 1e-3, "the forces of one roller miss the axis of the drive by {arm} mm");
        }
    }
}
