//! Flexspline flank on circular-spline flank: unilateral, with Coulomb friction.
//!
//! Integration points lie on the flexspline flank. A point `X + u`, seen from the frame that turns with the circular
//! spline, has the gap
//!
//! `g = n(s) . (x - V(s) - P(s))`,
//!
//! with P(s) the exact outline of the circular spline (flank and tip rounding), V its interpolated displacement, and s
//! the foot of `x - V`. To first order in the slope of V (1e-3; the neglected second order is below 1e-6 of the gap)
//! all derivatives of g are those of one vector `c = n - (n . dV/ds) t`: +c on the flexspline, −c on the circular
//! spline, so that action equals reaction and the moment on the output is that of the forces themselves.
//!
//! As built ([`FlankDeviations`]) the point becomes that of a tooth displaced as a rigid body, and P(s) the outline of
//! a space displaced likewise; the axis of the circular spline may be offset from that of the housing, and a worn flank
//! adds its depth to g. All are constants, so that c and its work stay what they were. The frame that turns with the
//! circular spline has its origin on the axis of the output bearing: `x` counts from there, and the torque on the
//! output is the moment about it, wherever toothing and housing have theirs.

use crate::fem::element::edge_shape;
use crate::mesh::{FlankMesh, WheelMesh, rotate};

use super::face::{Across, Bearing, FaceLaw, Lean};
use super::hertz::{FacePoint, peak_pressure_mpa};
use super::quadrature::gauss_legendre;
use crate::drive::{ActiveFlank, FlankDeviations, Foot, Placement, Side, golden};

/// Flanks further apart than this do not touch within an increment that a layout is made for, mm: the reach of the
/// search for pairs.
const NEAR_ENOUGH_MM: f64 = 0.02;

/// Law of the flanks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlankLaw {
    /// Penalty: pressure per penetration, N/mm³.
    pub stiffness: f64,
    /// Tangential stiffness while sticking, N/mm³.
    pub stick_stiffness: f64,
    /// Coulomb friction coefficient.
    pub friction: f64,
}

/// A flexspline tooth side facing a circular-spline space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FlankPair {
    /// Flexspline tooth.
    pub tooth: usize,
    /// Circular-spline space.
    pub space: usize,
    /// Which side of both.
    pub side: Side,
}

/// A place on the flexspline flank, in the frame of its tooth, plus side.
#[derive(Debug, Clone, Copy)]
pub struct FlankPlace {
    /// Undeformed position.
    pub position: [f64; 2],
    /// Edge of the flank mesh that carries it.
    pub edge: usize,
    /// Shape functions there.
    pub shape: [f64; 3],
}

impl FlankPlace {
    fn new(mesh: &FlankMesh, position: [f64; 2], radius_mm: f64) -> FlankPlace {
        let (edge, xi) = mesh.locate(radius_mm);
        FlankPlace { position, edge, shape: edge_shape(xi) }
    }
}

/// An integration point on the flexspline flank.
#[derive(Debug, Clone, Copy)]
pub struct FlankPoint {
    /// Where it is.
    pub place: FlankPlace,
    /// Arc length it stands for, mm.
    pub weight: f64,
    /// Arc length along the outline, from root to tip.
    pub arc: f64,
    /// Tangential traction at the start of the increment, MPa, along the tangent of the circular-spline flank.
    pub start_traction: f64,
    /// Arc length of the foot on the circular spline at the start of the increment.
    pub start_foot: f64,
}

/// Tangential tractions along a flank at the end of an increment, by arc length.
pub type FrictionHistory = Vec<(f64, f64)>;

/// Integration points of a pair, laid out for one increment.
#[derive(Debug, Clone)]
pub struct FlankLayout {
    /// Radius on the tooth that faces the corner of the space, if it lies on the flank.
    pub corner: Option<f64>,
    /// The points, from root to tip.
    pub points: Vec<FlankPoint>,
}

/// Geometry of both flanks and their meshes.
pub struct FlankContact<'a> {
    fs_mesh: &'a WheelMesh,
    cs_mesh: &'a WheelMesh,
    /// The flexspline flank.
    pub tooth: ActiveFlank,
    /// The circular-spline flank.
    pub space: ActiveFlank,
    deviations: &'a FlankDeviations,
    /// A few points of the plus and of the minus flank of a tooth.
    coarse: [Vec<FlankPlace>; 2],
    /// Sine and cosine of the angle of each flexspline tooth and of each circular-spline space.
    fs_turns: Vec<(f64, f64)>,
    cs_turns: Vec<(f64, f64)>,
    rule: Vec<(f64, f64)>,
    /// The load along the face, where it is not even.
    face: Option<FaceLaw>,
}

/// Contribution of one pair. Local nodes: flexspline flank nodes, then circular-spline flank nodes; two unknowns each.
#[derive(Debug, Clone, Default)]
pub struct PairContribution {
    /// Nodal forces on the wheels, global frame for the flexspline, turning frame for the circular spline (N/mm).
    pub force: Vec<f64>,
    /// Torque on the circular spline (N mm/mm).
    pub torque: f64,
    /// Tangent, n x n by rows; its lower triangle.
    pub stiffness: Vec<f64>,
    /// Coupling with the output angle.
    pub border: Vec<f64>,
    /// Stiffness against the output angle alone.
    pub corner: f64,
    /// Resultant force on the circular spline in its frame (N/mm) and the moment arm's point of attack (mm).
    pub resultant: [f64; 2],
    /// Force-weighted point of attack, in the turning frame.
    pub attack: [f64; 2],
    /// The points that slip: what the tangent leaves out.
    pub slipping: Vec<SlipPoint>,
    /// Mean load over the face, N/mm.
    pub load: f64,
    /// How the load lies along the face, where it is not even.
    pub along_face: Option<AlongFace>,
}

/// A point of a pair that bears: its place along the flank, how far from the axis of the circular spline it and its
/// foot stand, mm, and the arc length of the foot.
struct BearingPoint {
    place: FacePoint,
    radius: f64,
    foot_radius: f64,
    foot_arc: f64,
}

/// Where a pair bears.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BearingPlace {
    /// Normal force of the pair, N for each mm of the face.
    pub load: f64,
    /// Largest pressure, MPa (`FlankContact::peak_pressure_mpa`).
    pub peak_mpa: f64,
    /// Share of the force on a tip: on its rounding, or within one rounding radius of where that begins; of the tooth
    /// of the flexspline, and of the teeth of the circular spline.
    pub on_tips: [f64; 2],
    /// How much further from the axis the tip of the tooth stands than the tips of the circular spline do, mm: what it
    /// reaches into the space.
    pub reach_mm: f64,
}

/// How the load of a pair lies along the face, and what a slope s of its offsets (`FaceLaw::slope`) changes.
#[derive(Debug, Clone, PartialEq)]
pub struct AlongFace {
    /// Peak over mean.
    pub peak_over_mean: f64,
    /// Share of the face that bears.
    pub share: f64,
    /// Force on s: mean over the face of load times place, N.
    pub moment: f64,
    /// Tangent between s and the local unknowns.
    pub by_node: Vec<f64>,
    /// Between s and the output angle.
    pub by_output: f64,
    /// Of s alone, N.
    pub by_slope: f64,
}

/// A point that slips: a change of its gap changes the force along the flank, by `stiffness` times the change along
/// `slip`.
#[derive(Debug, Clone, Copy, Default)]
pub struct SlipPoint {
    /// Unknowns of its nodes.
    pub index: [usize; 12],
    /// How the gap changes with them.
    pub gap: [f64; 12],
    /// How it changes with the output angle (mm/rad).
    pub gap_by_output: f64,
    /// How the tooth slips along the flank with the unknowns.
    pub slip: [f64; 12],
    /// How it slips with the output angle (mm/rad).
    pub slip_by_output: f64,
    /// Change of the force that resists the slip, of one sign or the other, over that of the gap (N/mm per mm).
    pub stiffness: f64,
    /// How much the face gives way at all points of the pair as this gap closes by itself (mm/mm); 0 where it is even.
    pub gives_way: f64,
}

/// Displacements and output angle at which contact is evaluated.
#[derive(Clone, Copy)]
pub struct Configuration<'s> {
    /// Flexspline, global frame, x and y of each node.
    pub u: &'s [f64],
    /// Circular spline, frame turning with it.
    pub v: &'s [f64],
    /// Output angle, rad.
    pub output_rad: f64,
    /// How each flexspline tooth leans along its face; empty where none does.
    pub leans: &'s [Lean],
}

/// A pair, and what it is evaluated at.
pub type PairAt<'s> = (FlankPair, Configuration<'s>);

/// Displacements of a pair's flank nodes in local frames (tooth frame and space frame, mirrored for the minus side).
struct LocalField {
    fs: Vec<[f64; 2]>,
    cs: Vec<[f64; 2]>,
    /// Rotation from the tooth frame to the space frame.
    turn: (f64, f64),
    /// Where the tooth stands in its frame, seen from the axis of the circular spline.
    tooth: Placement,
    /// Where the space stands in its frame.
    space: Placement,
    /// Depth missing on both flanks, less what the face is nearer somewhere than in the plane slice.
    depth: f64,
    /// The offsets along the face, where there are any.
    across: Option<Across>,
    /// No point of the circular-spline flank is displaced by more.
    largest_cs: f64,
}

impl<'a> FlankContact<'a> {
    /// Contact between the flanks of two meshes, the flanks offset from their nominal places by `deviations`.
    pub fn new(
        fs_mesh: &'a WheelMesh,
        cs_mesh: &'a WheelMesh,
        tooth: ActiveFlank,
        space: ActiveFlank,
        deviations: &'a FlankDeviations,
    ) -> Self {
        let (a, b) = (tooth.start_radius, tooth.junction_radius);
        let coarse = Side::BOTH.map(|side| {
            let point = |i: i32| {
                let radius = a + (b - a) * f64::from(i) / 6.0;
                FlankPlace::new(&fs_mesh.flanks[side.index()], tooth.point(radius), radius)
            };
            // a smooth ring has no flanks
            let points = if fs_mesh.flanks[side.index()].nodes.is_empty() { 0..0 } else { 0..7 };
            points.map(point).collect()
        });
        let turns = |mesh: &WheelMesh| (0..mesh.teeth).map(|sector| mesh.sector_angle(sector).sin_cos()).collect();
        let (fs_turns, cs_turns) = (turns(fs_mesh), turns(cs_mesh));
        let rule = gauss_legendre(4);
        FlankContact { fs_mesh, cs_mesh, tooth, space, deviations, coarse, fs_turns, cs_turns, rule, face: None }
    }

    /// This contact with a law of the load along the face.
    pub(crate) fn with_face(self, face: Option<FaceLaw>) -> Self {
        FlankContact { face, ..self }
    }

    /// Flank nodes of the flexspline side of a pair.
    pub fn fs_nodes(&self, pair: FlankPair) -> impl Iterator<Item = usize> + '_ {
        self.fs_flank(pair).nodes.iter().map(move |&n| self.fs_mesh.node(pair.tooth as isize, n))
    }

    /// Flank nodes of the circular-spline side of a pair.
    pub fn cs_nodes(&self, pair: FlankPair) -> impl Iterator<Item = usize> + '_ {
        self.cs_flank(pair).nodes.iter().map(move |&n| self.cs_mesh.node(pair.space as isize, n))
    }

    fn fs_flank(&self, pair: FlankPair) -> &FlankMesh {
        &self.fs_mesh.flanks[pair.side.index()]
    }

    fn cs_flank(&self, pair: FlankPair) -> &FlankMesh {
        &self.cs_mesh.flanks[pair.side.index()]
    }

    /// Pairs whose flanks are closer than `reach_mm` (or overlap) in this configuration.
    pub fn near_pairs(&self, at: Configuration, reach_mm: f64) -> Vec<FlankPair> {
        let mut pairs = Vec::new();
        let insets = self.tooth.half_angle(self.tooth.tip_radius);
        let lowest = self.space.tip_radius - 0.05 - self.deviations.largest - self.largest_offset(at);
        let spaces = self.cs_mesh.teeth as isize;
        for tooth in 0..self.fs_mesh.teeth {
            for side in Side::BOTH {
                // The space whose axis is nearest to the tip of the flank.
                let Some(&tip) = self.fs_mesh.flanks[side.index()].nodes.last() else {
                    continue;
                };
                let tip = self.fs_mesh.node(tooth as isize, tip);
                let x = self.fs_mesh.nodes[tip];
                let p = [x[0] + at.u[2 * tip], x[1] + at.u[2 * tip + 1]];
                if p[0] * p[0] + p[1] * p[1] < lowest * lowest {
                    continue;
                }
                let angle = p[1].atan2(p[0]) - at.output_rad - side.sign() * insets;
                let space = (angle / self.cs_mesh.pitch()).round() as isize;
                let pair = FlankPair { tooth, space: space.rem_euclid(spaces) as usize, side };
                if self.is_near(pair, at, reach_mm) {
                    pairs.push(pair);
                }
            }
        }
        pairs
    }

    /// Smallest gap of a pair at a few points of the flank (mm), where the face is nearest.
    pub fn smallest_gap(&self, pair: FlankPair, at: Configuration) -> f64 {
        let field = &self.local_field(pair, at);
        let gap = |place| self.counted_gap(pair, field, self.seen_from_space(field, place));
        self.coarse[pair.side.index()].iter().map(gap).fold(f64::INFINITY, f64::min)
    }

    /// Whether that is less than `reach_mm`, which of most points a glance says.
    pub(crate) fn is_near(&self, pair: FlankPair, at: Configuration, reach_mm: f64) -> bool {
        let field = &self.local_field(pair, at);
        self.coarse[pair.side.index()].iter().any(|place| {
            let x = self.seen_from_space(field, place);
            self.least_distance(field, x) <= reach_mm && self.counted_gap(pair, field, x) < reach_mm
        })
    }

    /// Gap at a point; infinite outside the space's flank, unless the face is uneven: its offsets may bring the
    /// rounding of a tip to bear alone.
    fn counted_gap(&self, pair: FlankPair, field: &LocalField, x: [f64; 2]) -> f64 {
        let foot = self.foot(pair, field, x);
        let outside = field.across.is_none() && foot.radius < self.space.tip_radius + 1e-9;
        if outside { f64::INFINITY } else { foot.distance }
    }

    /// A lower bound of the gap at a point: it leaves out the rounding of the tip, and no displacement of the circular
    /// spline brings the flank nearer than its own length.
    #[inline]
    fn least_distance(&self, field: &LocalField, x: [f64; 2]) -> f64 {
        self.space.least_distance(field.space.recover(x)) + field.depth - field.largest_cs
    }

    fn local_field(&self, pair: FlankPair, at: Configuration) -> LocalField {
        let sign = pair.side.sign();
        let local = |mesh: &WheelMesh, sector: usize, turn: (f64, f64), u: &[f64]| -> Vec<[f64; 2]> {
            let first = mesh.node(sector as isize, 0);
            let nodes = mesh.flanks[pair.side.index()].nodes.iter();
            let displacement = |n: &u32| {
                let k = 2 * (first + *n as usize);
                let d = rotate([u[k], u[k + 1]], (-turn.0, turn.1));
                [d[0], sign * d[1]]
            };
            nodes.map(displacement).collect()
        };
        let (fs_turn, cs_turn) = (self.fs_turns[pair.tooth], self.cs_turns[pair.space]);
        let cs = local(self.cs_mesh, pair.space, cs_turn, at.v);
        let longest = cs.iter().map(|v| v[0] * v[0] + v[1] * v[1]).fold(0.0, f64::max).sqrt();
        let angle = self.fs_mesh.sector_angle(pair.tooth) - self.cs_mesh.sector_angle(pair.space) - at.output_rad;
        let deviations = self.deviations;
        let (mut tooth, side) = (deviations.teeth[pair.tooth], pair.side.index());
        if deviations.axis != [0.0; 2] {
            let axis = rotate(deviations.axis, (-fs_turn.0, fs_turn.1));
            tooth.translation = [tooth.translation[0] - axis[0], tooth.translation[1] - axis[1]];
        }
        let lean = at.leans.get(pair.tooth).copied().unwrap_or_default();
        let across = self.face.and_then(|face| face.across(lean, pair.side));
        let early = across.as_ref().map_or(0.0, Across::early_mm);
        LocalField {
            fs: local(self.fs_mesh, pair.tooth, fs_turn, at.u),
            cs,
            turn: (sign * angle).sin_cos(),
            tooth: tooth.seen_from(pair.side),
            space: deviations.spaces[pair.space].seen_from(pair.side),
            depth: deviations.tooth_depth[pair.tooth][side] + deviations.space_depth[pair.space][side] - early,
            across,
            // Between three nodes a parabola goes beyond them by a quarter at most.
            largest_cs: 1.25 * longest,
        }
    }

    /// Largest reduction of the gap by the faces, mm.
    fn largest_offset(&self, at: Configuration) -> f64 {
        let Some(face) = self.face else { return 0.0 };
        0.5 * face.width_mm * at.leans.iter().map(|lean| lean[0].hypot(lean[1])).fold(0.0, f64::max)
    }

    /// How the pair bears along its face: `None` where it is open, nothing later and nothing softer where the face is
    /// even.
    fn bearing(&self, pair: FlankPair, field: &LocalField, law: FlankLaw, points: &[FlankPoint]) -> Option<Bearing> {
        let Some(across) = &field.across else { return Some(Bearing::EVEN) };
        let near = points.iter().filter_map(|point| {
            let x = self.seen_from_space(field, &point.place);
            if self.least_distance(field, x) > 0.0 {
                return None;
            }
            let foot = self.foot(pair, field, x);
            (foot.distance < 0.0).then_some((foot.distance, point.weight))
        });
        across.bearing(law, &near.collect::<Vec<_>>())
    }

    /// Load of a pair over its mean, at equal steps along the face and growing away from what holds the flexspline;
    /// nothing where the pair is open or its load is even.
    pub fn load_over_mean(&self, (pair, at): PairAt<'_>, law: FlankLaw, points: &[FlankPoint]) -> Vec<f64> {
        let field = self.local_field(pair, at);
        let bearing = self.bearing(pair, &field, law, points);
        match (&field.across, bearing) {
            (Some(across), Some(bearing)) => across.load_over_mean(&bearing),
            _ => Vec::new(),
        }
    }

    /// Foot, on the deformed circular spline, of a point given in the space frame, whose origin lies on the axis of the
    /// output.
    #[inline]
    fn foot(&self, pair: FlankPair, field: &LocalField, x: [f64; 2]) -> Foot {
        let cs = self.cs_flank(pair);
        // The displacement at the foot decides the foot; its slope of 1e-3 makes the second look exact.
        let mut foot = self.space.foot_internal(field.space.recover(x));
        for _ in 0..2 {
            let (e, xi) = cs.locate(foot.radius);
            let n = edge_shape(xi);
            let v: [f64; 2] = std::array::from_fn(|k| (0..3).map(|i| n[i] * field.cs[2 * e + i][k]).sum());
            foot = self.space.foot_internal(field.space.recover([x[0] - v[0], x[1] - v[1]]));
        }
        foot.distance += field.depth;
        foot.normal = rotate(foot.normal, field.space.turn);
        foot.tangent = rotate(foot.tangent, field.space.turn);
        foot
    }

    /// A point of the flexspline flank in the space frame.
    #[inline]
    fn seen_from_space(&self, field: &LocalField, place: &FlankPlace) -> [f64; 2] {
        let mut x = field.tooth.place(place.position);
        for (i, n) in place.shape.iter().enumerate() {
            let d = field.fs[2 * place.edge + i];
            x[0] += n * d[0];
            x[1] += n * d[1];
        }
        rotate(x, field.turn)
    }

    /// Integration points of a pair for an increment that is expected to end near `at`: panels between the edges of the
    /// mesh, refined where pressure ends sharply, at the tip of the tooth and where the tip of the space bears on it.
    pub fn layout(&self, pair: FlankPair, at: Configuration) -> FlankLayout {
        const REFINEMENT: [f64; 4] = [0.001, 0.004, 0.016, 0.064];
        let field = self.local_field(pair, at);
        let flank = self.fs_flank(pair);
        let (start, end) = (self.tooth.start_radius, self.tooth.junction_radius);
        let mut breaks: Vec<f64> = flank.radii.iter().step_by(2).copied().filter(|r| *r < end).collect();
        breaks.push(end);
        breaks.extend(REFINEMENT[1..].iter().map(|d| end - d));
        let corner = self.radius_facing_corner(pair, &field);
        if let Some(corner) = corner {
            breaks.push(corner);
            breaks.extend(REFINEMENT.iter().flat_map(|d| [corner - d, corner + d]));
        }
        // Curved flanks bear on a few micrometres in their middle, between the points of a panel.
        if self.tooth.is_s_shaped() {
            for nearest in self.nearest_radii(pair, &field) {
                breaks.push(nearest);
                breaks.extend(REFINEMENT.iter().flat_map(|d| [nearest - d, nearest + d]));
            }
        }
        breaks.retain(|r| (start..=end).contains(r));
        breaks.push(start);
        breaks.sort_by(f64::total_cmp);
        breaks.dedup_by(|a, b| *a - *b < 2e-4);
        if let Some(last) = breaks.last_mut() {
            *last = end;
        }
        let mut points = Vec::with_capacity(4 * (breaks.len() + 3));
        let arc_of = |r: f64| self.tooth.arc_at(r);
        let point = |position: [f64; 2], radius: f64, weight: f64, arc: f64| {
            let place = FlankPlace::new(flank, position, radius);
            FlankPoint { place, weight, arc, start_traction: 0.0, start_foot: 0.0 }
        };
        for panel in breaks.windows(2) {
            let (middle, half) = (0.5 * (panel[0] + panel[1]), 0.5 * (panel[1] - panel[0]));
            for (xi, w) in &self.rule {
                let r = middle + half * xi;
                points.push(point(self.tooth.point(r), r, w * half * self.tooth.arc_rate(r), arc_of(r)));
            }
        }
        // Round the tip, carried by the last edge.
        let rho = self.tooth.rounding_radius;
        let full = rho * self.tooth.rounding_sweep;
        let mut from = 0.0;
        for to in REFINEMENT[..3].iter().map(|d| d.min(full)) {
            let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
            if half > 0.0 {
                for (xi, w) in &self.rule {
                    let s = middle + half * xi;
                    let [x, y] = self.tooth.rounding_point(s / rho);
                    points.push(point([x, y], x.hypot(y), w * half, arc_of(end) + s));
                }
            }
            from = to;
        }
        FlankLayout { corner, points }
    }

    /// Radii on the tooth where its flank comes nearest to that of the space, each against its neighbourhood.
    fn nearest_radii(&self, pair: FlankPair, field: &LocalField) -> Vec<f64> {
        const PLACES: usize = 32;
        let flank = self.fs_flank(pair);
        let gap = |r: f64| {
            let place = FlankPlace::new(flank, self.tooth.point(r), r);
            self.foot(pair, field, self.seen_from_space(field, &place)).distance
        };
        let (start, end) = (self.tooth.start_radius, self.tooth.junction_radius);
        let at = |k: usize| start + (end - start) * k as f64 / PLACES as f64;
        let gaps: Vec<f64> = (0..=PLACES).map(|k| gap(at(k))).collect();
        (1..PLACES)
            .filter(|&k| gaps[k] < NEAR_ENOUGH_MM && gaps[k] <= gaps[k - 1] && gaps[k] < gaps[k + 1])
            .map(|k| golden(gap, at(k - 1), at(k + 1)))
            .collect()
    }

    /// Radius on the tooth that faces the corner of the space in this configuration.
    pub(crate) fn corner(&self, pair: FlankPair, at: Configuration) -> Option<f64> {
        self.radius_facing_corner(pair, &self.local_field(pair, at))
    }

    /// Radius on the tooth that faces the joint of flank and tip rounding of the space.
    fn radius_facing_corner(&self, pair: FlankPair, field: &LocalField) -> Option<f64> {
        let flank = self.fs_flank(pair);
        let corner = self.space.junction_radius;
        let facing = |r: f64| {
            let place = FlankPlace::new(flank, self.tooth.point(r), r);
            self.space.foot_radius(field.space.recover(self.seen_from_space(field, &place)))
        };
        let mut r = corner - (facing(self.tooth.junction_radius) - self.tooth.junction_radius);
        for _ in 0..4 {
            r += corner - facing(r);
        }
        (self.tooth.start_radius..self.tooth.junction_radius).contains(&r).then_some(r)
    }

    /// Sets where each point stood at the start of the increment, for friction.
    pub fn start_friction(&self, (pair, at): PairAt<'_>, history: &FrictionHistory, points: &mut [FlankPoint]) {
        let field = self.local_field(pair, at);
        for point in points {
            let x = self.seen_from_space(&field, &point.place);
            let foot = self.foot(pair, &field, x);
            point.start_foot = foot.arc;
            point.start_traction = interpolate(history, point.arc);
        }
    }

    /// Tangential tractions at the end of an increment; nothing of a pair that is open.
    pub fn friction_history(&self, (pair, at): PairAt<'_>, law: FlankLaw, points: &[FlankPoint]) -> FrictionHistory {
        let Some((_, touches)) = self.touches((pair, at), law, points) else { return FrictionHistory::new() };
        let history = |(point, touch): (&FlankPoint, &BearingPoint)| {
            let pressure = (-law.stiffness * touch.place.gap).max(0.0);
            (point.arc, traction(law, pressure, point, touch.foot_arc).0)
        };
        points.iter().zip(&touches).map(history).collect()
    }

    /// Largest pressure of a pair, MPa, by its force and the shape of its gap (`Problem::contact_modulus_mpa`); where
    /// the load along the face is largest. Nothing of a pair that is open.
    pub(crate) fn peak_pressure_mpa(
        &self,
        (pair, at): PairAt<'_>,
        law: FlankLaw,
        points: &[FlankPoint],
        modulus_mpa: f64,
    ) -> f64 {
        self.touches((pair, at), law, points)
            .map_or(0.0, |(bearing, touches)| self.peak_of(&bearing, &touches, modulus_mpa))
    }

    /// Where a pair bears, whether on flanks or on tips; nothing of a pair that is open.
    pub fn bearing_place(
        &self,
        (pair, at): PairAt<'_>,
        law: FlankLaw,
        points: &[FlankPoint],
        modulus_mpa: f64,
    ) -> Option<BearingPlace> {
        let (bearing, touches) = self.touches((pair, at), law, points)?;
        let (tooth, space) = (&self.tooth, &self.space);
        let tooth_tip_from = tooth.arc_at(tooth.junction_radius) - tooth.rounding_radius;
        // On the circular spline the tip lies inward.
        let space_tip_to = space.junction_radius + space.rounding_radius;
        let (mut load, mut on_tips, mut reach_mm) = (0.0, [0.0; 2], f64::NEG_INFINITY);
        for BearingPoint { place: FacePoint { arc, force, .. }, radius, foot_radius, .. } in &touches {
            reach_mm = reach_mm.max(radius - space.tip_radius);
            load += force;
            on_tips[0] += if *arc >= tooth_tip_from { *force } else { 0.0 };
            on_tips[1] += if *foot_radius <= space_tip_to { *force } else { 0.0 };
        }
        (load > 0.0).then(|| BearingPlace {
            load,
            peak_mpa: self.peak_of(&bearing, &touches, modulus_mpa),
            on_tips: on_tips.map(|force| force / load),
            reach_mm,
        })
    }

    /// How a pair bears, and each of its points; nothing of a pair that is open.
    fn touches(
        &self,
        (pair, at): PairAt<'_>,
        law: FlankLaw,
        points: &[FlankPoint],
    ) -> Option<(Bearing, Vec<BearingPoint>)> {
        let field = self.local_field(pair, at);
        let bearing = self.bearing(pair, &field, law, points)?;
        let touch = |point: &FlankPoint| {
            let x = self.seen_from_space(&field, &point.place);
            let foot = self.foot(pair, &field, x);
            let gap = foot.distance + bearing.later_mm;
            let place = FacePoint { arc: point.arc, gap, force: law.stiffness * point.weight * (-gap).max(0.0) };
            BearingPoint { place, radius: x[0].hypot(x[1]), foot_radius: foot.radius, foot_arc: foot.arc }
        };
        let touches = points.iter().map(touch).collect();
        Some((bearing, touches))
    }

    fn peak_of(&self, bearing: &Bearing, touches: &[BearingPoint], modulus_mpa: f64) -> f64 {
        let places: Vec<FacePoint> = touches.iter().map(|touch| touch.place).collect();
        let least_radius = 1.0 / (1.0 / self.tooth.rounding_radius + 1.0 / self.space.rounding_radius);
        peak_pressure_mpa(&places, bearing.peak_over_mean, modulus_mpa, least_radius)
    }

    /// Gap of the integration points where the face is nearest, how it changes as the output alone turns (mm/rad), and
    /// their weight; with the offsets along the face, where there are any. Points that a glance finds further apart
    /// than `within_mm` are left out.
    pub fn gaps(
        &self,
        (pair, at): PairAt<'_>,
        points: &[FlankPoint],
        within_mm: f64,
        report: &mut impl FnMut(f64, f64, f64),
    ) -> Option<Across> {
        let field = self.local_field(pair, at);
        for point in points {
            let x = self.seen_from_space(&field, &point.place);
            if self.least_distance(&field, x) > within_mm {
                continue;
            }
            let foot = self.foot(pair, &field, x);
            let [nx, ny] = foot.normal;
            report(foot.distance, pair.side.sign() * (nx * x[1] - ny * x[0]), point.weight);
        }
        field.across
    }

    /// Forces and tangent of a pair; nothing while it is open.
    pub fn evaluate(&self, (pair, at): PairAt<'_>, law: FlankLaw, points: &[FlankPoint]) -> Option<PairContribution> {
        self.evaluate_with_gap((pair, at), law, points).0
    }

    /// [`FlankContact::evaluate`], and the smallest gap of the points (mm).
    pub(crate) fn evaluate_with_gap(
        &self,
        (pair, at): PairAt<'_>,
        law: FlankLaw,
        points: &[FlankPoint],
    ) -> (Option<PairContribution>, f64) {
        let mut smallest_gap = f64::INFINITY;
        let field = self.local_field(pair, at);
        let (nf, nc) = (field.fs.len(), field.cs.len());
        let n = 2 * (nf + nc);
        let sign = pair.side.sign();
        let (fs_turn, cs_turn) = (self.fs_turns[pair.tooth], self.cs_turns[pair.space]);
        let back = (-field.turn.0, field.turn.1);
        let cs = self.cs_flank(pair);
        let mut out: Option<PairContribution> = None;
        // An open pair is open by its gaps where the face is nearest.
        let bearing = self.bearing(pair, &field, law, points);
        let later = bearing.map_or(0.0, |bearing| bearing.later_mm);
        let mut uneven = field.across.is_some().then(|| MeanBearing::new(n));
        for point in points {
            let x = self.seen_from_space(&field, &point.place);
            // Most points are open, and a glance says so.
            let least = self.least_distance(&field, x);
            if least > 0.0 {
                smallest_gap = smallest_gap.min(least);
                continue;
            }
            let foot = self.foot(pair, &field, x);
            smallest_gap = smallest_gap.min(foot.distance);
            let gap = foot.distance + later;
            if gap >= 0.0 {
                continue;
            }
            let out = out.get_or_insert_with(|| PairContribution {
                force: vec![0.0; n],
                stiffness: vec![0.0; n * n],
                border: vec![0.0; n],
                ..PairContribution::default()
            });
            let pressure = -law.stiffness * gap;
            let (cs_edge, xi) = cs.locate(foot.radius);
            let cs_shape = edge_shape(xi);
            // Slope of the displacement along the flank; none beyond the ends of the mesh.
            let slope: f64 = if xi.abs() < 1.0 {
                let derivative = crate::fem::element::edge_shape_derivative(xi);
                let span = cs.radii[2 * cs_edge + 2] - cs.radii[2 * cs_edge];
                let rate = 2.0 / span * foot.radius_rate;
                (0..3)
                    .map(|i| {
                        let v = field.cs[2 * cs_edge + i];
                        derivative[i] * rate * (foot.normal[0] * v[0] + foot.normal[1] * v[1])
                    })
                    .sum()
            } else {
                0.0
            };
            let direction = [foot.normal[0] - slope * foot.tangent[0], foot.normal[1] - slope * foot.tangent[1]];
            let (friction, stick) = traction(law, pressure, point, foot.arc);

            // Derivative of the gap (or of the slip) with respect to the twelve nodal unknowns and the output angle.
            let gradient = |c: [f64; 2]| -> ([f64; 12], f64) {
                let on_tooth = rotate(c, back);
                let on_tooth = rotate([on_tooth[0], sign * on_tooth[1]], fs_turn);
                let on_space = rotate([c[0], sign * c[1]], cs_turn);
                let mut g = [0.0; 12];
                for i in 0..3 {
                    for k in 0..2 {
                        g[2 * i + k] = point.place.shape[i] * on_tooth[k];
                        g[6 + 2 * i + k] = -cs_shape[i] * on_space[k];
                    }
                }
                // x turns backwards as the output turns forwards.
                let by_output = sign * (c[0] * x[1] - c[1] * x[0]);
                (g, by_output)
            };
            let (g, g_output) = gradient(direction);
            let (s, s_output) = if law.friction > 0.0 { gradient(foot.tangent) } else { ([0.0; 12], 0.0) };
            let normal_load = pressure * point.weight;
            let tangential_load = friction * point.weight;
            let index: [usize; 12] = std::array::from_fn(|i| {
                if i < 6 { 2 * (2 * point.place.edge) + i } else { 2 * (nf + 2 * cs_edge) + i - 6 }
            });
            let (kn, kt) = (law.stiffness * point.weight, stick * point.weight);
            for i in 0..12 {
                out.force[index[i]] += normal_load * g[i] - tangential_load * s[i];
                out.border[index[i]] += kn * g[i] * g_output + kt * s[i] * s_output;
                let row = &mut out.stiffness[index[i] * n..(index[i] + 1) * n];
                for half in [0, 6].iter().filter(|half| **half <= i) {
                    for (entry, j) in row[index[*half]..][..6].iter_mut().zip(*half..) {
                        *entry += kn * g[i] * g[j] + kt * s[i] * s[j];
                    }
                }
            }
            // Where the face is uneven, points that stick move it back as well.
            let slips = stick == 0.0 && friction != 0.0;
            if slips || (uneven.is_some() && law.friction > 0.0) {
                out.slipping.push(SlipPoint {
                    index,
                    gap: g,
                    gap_by_output: g_output,
                    slip: s,
                    slip_by_output: s_output,
                    stiffness: if slips { -friction / pressure * kn } else { 0.0 },
                    gives_way: if uneven.is_some() { kn } else { 0.0 },
                });
            }
            out.load += normal_load;
            if let Some(uneven) = &mut uneven {
                uneven.add(&index, &g, g_output, kn);
            }
            out.torque += normal_load * g_output - tangential_load * s_output;
            out.corner += kn * g_output * g_output + kt * s_output * s_output;
            // Force on the circular spline, for reports.
            let on_space: [f64; 2] =
                std::array::from_fn(|k| tangential_load * foot.tangent[k] - normal_load * direction[k]);
            let on_space = rotate([on_space[0], sign * on_space[1]], cs_turn);
            let x_space = rotate([x[0], sign * x[1]], cs_turn);
            for k in 0..2 {
                out.resultant[k] += on_space[k];
                out.attack[k] += normal_load * x_space[k];
            }
        }
        if let (Some(out), Some(bearing), Some(uneven)) = (&mut out, bearing, uneven) {
            let factor = uneven.soften(out, bearing.softness);
            out.slipping.iter_mut().for_each(|point| point.gives_way *= factor);
            out.along_face = Some(AlongFace {
                peak_over_mean: bearing.peak_over_mean,
                share: bearing.share,
                moment: bearing.moment,
                by_output: uneven.by_output * bearing.later_by_slope,
                by_node: uneven.by_node.into_iter().map(|by| by * bearing.later_by_slope).collect(),
                by_slope: bearing.moment_by_slope,
            });
        }
        (out, smallest_gap)
    }
}

/// How the mean load of a pair changes with its unknowns: what an uneven face takes from the tangent.
struct MeanBearing {
    /// By the nodes (N/mm per mm) and by the output angle.
    by_node: Vec<f64>,
    by_output: f64,
    /// By all gaps together.
    stiffness: f64,
}

impl MeanBearing {
    fn new(unknowns: usize) -> MeanBearing {
        MeanBearing { by_node: vec![0.0; unknowns], by_output: 0.0, stiffness: 0.0 }
    }

    /// Adds a point with the derivatives of its gap.
    fn add(&mut self, index: &[usize; 12], gap: &[f64; 12], gap_by_output: f64, stiffness: f64) {
        for (i, g) in index.iter().zip(gap) {
            self.by_node[*i] += stiffness * g;
        }
        self.by_output += stiffness * gap_by_output;
        self.stiffness += stiffness;
    }

    /// A mean load that grows by q moves the flank back by `softness * q`: one spring in series with all points. By how
    /// much it moves back for what the gaps alone would add to the load (mm²/N).
    fn soften(&self, out: &mut PairContribution, softness: f64) -> f64 {
        let factor = softness / (1.0 + softness * self.stiffness);
        if factor == 0.0 {
            return factor;
        }
        let n = self.by_node.len();
        for (i, a) in self.by_node.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            out.border[i] -= factor * a * self.by_output;
            for (entry, b) in out.stiffness[i * n..=i * n + i].iter_mut().zip(&self.by_node) {
                *entry -= factor * a * b;
            }
        }
        out.corner -= factor * self.by_output * self.by_output;
        factor
    }
}

/// Tangential traction (MPa, positive where it holds the flexspline back from growing arc) and the stiffness it adds.
#[inline]
fn traction(law: FlankLaw, pressure: f64, point: &FlankPoint, foot_arc: f64) -> (f64, f64) {
    if law.friction == 0.0 || pressure <= 0.0 {
        return (0.0, 0.0);
    }
    let limit = law.friction * pressure;
    let trial = point.start_traction + law.stick_stiffness * (foot_arc - point.start_foot);
    if trial.abs() <= limit { (trial, law.stick_stiffness) } else { (trial.signum() * limit, 0.0) }
}

/// Linear interpolation in a history sorted by arc length; nothing beyond its ends.
fn interpolate(history: &FrictionHistory, arc: f64) -> f64 {
    let after = history.partition_point(|(s, _)| *s < arc);
    if after == 0 || after == history.len() {
        return 0.0;
    }
    let ((s0, t0), (s1, t1)) = (history[after - 1], history[after]);
    if s1 > s0 { t0 + (t1 - t0) * (arc - s0) / (s1 - s0) } else { t0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Drive, ToothFlank};
    use crate::mesh::MeshLevel;

    fn with_flanks(test: impl Fn(&FlankContact, &WheelMesh, &WheelMesh)) {
        let drive = Drive::hhd_95();
        let fs = WheelMesh::flexspline(&drive, MeshLevel::Coarse).unwrap();
        let cs = WheelMesh::circular_spline(&drive, MeshLevel::Coarse).unwrap();
        let tooth = ActiveFlank::new(&ToothFlank::external(&drive).unwrap());
        let space = ActiveFlank::new(&ToothFlank::internal(&drive).unwrap());
        let deviations = FlankDeviations::new(&drive);
        test(&FlankContact::new(&fs, &cs, tooth, space, &deviations), &fs, &cs);
    }

    const PAIR: FlankPair = FlankPair { tooth: 0, space: 0, side: Side::Plus };

    /// Parallel curves of an involute are the involute turned: the gap of an involute falls by base radius times angle.
    #[test]
    fn turning_the_space_changes_the_gap_by_the_base_radius() {
        with_flanks(|flanks, fs, cs| {
            let (u, v) = (vec![0.0; 2 * fs.nodes.len()], vec![0.0; 2 * cs.nodes.len()]);
            let gap = |side, output_rad| {
                flanks.smallest_gap(FlankPair { side, ..PAIR }, Configuration { u: &u, v: &v, output_rad, leans: &[] })
            };
            let start = gap(Side::Plus, 0.0);
            assert!(start > 0.0 && start < 0.5, "tooth 0 stands in space 0 with {start} mm");
            for turn in [1e-5, 1e-4, -1e-4] {
                let change = gap(Side::Plus, turn) - start;
                assert!((change - turn * flanks.space.lever()).abs() < 1e-9, "{turn}: {change}");
                assert!((gap(Side::Minus, -turn) - gap(Side::Plus, turn)).abs() < 1e-12, "not mirrored at {turn}");
            }
        });
    }

    /// The lower bound that lets open points and far pairs go without their foot never exceeds the gap at the foot.
    #[test]
    fn the_glance_is_a_lower_bound_of_the_gap() {
        with_flanks(|flanks, fs, cs| {
            let wave = |n: usize, size: f64| (0..2 * n).map(|i| size * (1.7 * i as f64).sin()).collect::<Vec<f64>>();
            let (u, v) = (wave(fs.nodes.len(), 5e-3), wave(cs.nodes.len(), 5e-3));
            let (mut tightest, mut rounded) = (f64::INFINITY, 0);
            for k in 0..40 {
                let at = Configuration { u: &u, v: &v, output_rad: 1e-4 * f64::from(k) - 2e-3, leans: &[] };
                for side in Side::BOTH {
                    let pair = FlankPair { side, ..PAIR };
                    let field = flanks.local_field(pair, at);
                    for point in flanks.layout(pair, at).points {
                        let x = flanks.seen_from_space(&field, &point.place);
                        let (foot, least) = (flanks.foot(pair, &field, x), flanks.least_distance(&field, x));
                        assert!(least <= foot.distance.max(0.0), "{least} of {}", foot.distance);
                        tightest = tightest.min(foot.distance - least);
                        rounded += usize::from(foot.radius < flanks.space.junction_radius);
                    }
                    let gap = flanks.smallest_gap(pair, at);
                    for reach in [0.01, 0.04, 0.1] {
                        assert_eq!(flanks.is_near(pair, at, reach), gap < reach, "{gap} within {reach}");
                    }
                }
            }
            assert!(tightest < 5e-3 && rounded > 0, "a useless bound: {tightest}, {rounded} on the rounding");
        });
    }

    #[test]
    fn pressed_flanks_push_back_and_open_flanks_do_not() {
        with_flanks(|flanks, fs, cs| {
            let (u, v) = (vec![0.0; 2 * fs.nodes.len()], vec![0.0; 2 * cs.nodes.len()]);
            let law = FlankLaw { stiffness: 1e6, stick_stiffness: 1e5, friction: 0.0 };
            let at = |output_rad| Configuration { u: &u, v: &v, output_rad, leans: &[] };
            let gap = flanks.smallest_gap(PAIR, at(0.0));
            let closing = -(gap + 1e-4) / flanks.space.lever();
            let layout = flanks.layout(PAIR, at(closing));
            assert!(flanks.evaluate((PAIR, at(0.0)), law, &layout.points).is_none());
            let pressed = flanks.evaluate((PAIR, at(closing)), law, &layout.points).unwrap();
            // The space was turned back onto the plus side of the tooth: it is pushed forward.
            assert!(pressed.torque > 0.0 && pressed.corner > 0.0 && pressed.load > 0.0);
            let covered: f64 = layout.points.iter().map(|point| point.weight).sum();
            assert!(pressed.load <= 1e6 * 1.01e-4 * covered, "{} N/mm on {covered} mm", pressed.load);
            let moment = pressed.attack[0] * pressed.resultant[1] - pressed.attack[1] * pressed.resultant[0];
            assert!(moment.is_finite());
            // Twice the penalty, twice the force.
            let stiffer = FlankLaw { stiffness: 2e6, ..law };
            let twice = flanks.evaluate((PAIR, at(closing)), stiffer, &layout.points).unwrap();
            assert!((twice.torque / pressed.torque - 2.0).abs() < 1e-12);
        });
    }

    /// Forces and their tangent of a pair that bears on part of its face: by its nodes, by the output angle, and by a
    /// slope along the face.
    #[test]
    fn the_tangent_of_an_uneven_face_is_the_slope_of_its_forces() {
        with_flanks(|flanks, fs, cs| {
            let law = FlankLaw { stiffness: 1e6, stick_stiffness: 1e5, friction: 0.0 };
            let face = FaceLaw::new(&flanks.tooth, 20.0, 2e-3, 3e-5);
            let deviations = flanks.deviations;
            let flanks =
                FlankContact::new(fs, cs, flanks.tooth.clone(), flanks.space.clone(), deviations).with_face(Some(face));
            let (u, v) = (vec![0.0; 2 * fs.nodes.len()], vec![0.0; 2 * cs.nodes.len()]);
            let lean = |slope: f64| -> Vec<Lean> { vec![[slope / face.slope([1.0, 0.0], Side::Plus), 0.0]; 1] };
            let straight = flanks.smallest_gap(PAIR, Configuration { u: &u, v: &v, output_rad: 0.0, leans: &[] });
            let closing = -(straight - 2e-3) / flanks.space.lever();
            let slope = -1.2e-3;
            let layout = flanks.layout(PAIR, Configuration { u: &u, v: &v, output_rad: closing, leans: &lean(slope) });
            let of = |u: &[f64], output_rad: f64, slope: f64| {
                let leans = lean(slope);
                flanks
                    .evaluate((PAIR, Configuration { u, v: &v, output_rad, leans: &leans }), law, &layout.points)
                    .unwrap()
            };
            let here = of(&u, closing, slope);
            let along = here.along_face.clone().unwrap();
            assert!((0.1..0.9).contains(&along.share), "{}", along.share);
            let n = here.force.len();
            let scale = here.stiffness.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let nodes: Vec<usize> = flanks.fs_nodes(PAIR).collect();
            // Normals that turn on the roundings are left out of every tangent.
            let turning = here.load / flanks.space.rounding_radius;
            let step = 1e-8;
            for j in 0..2 * nodes.len() {
                let moved = |by: f64| {
                    let mut u = u.clone();
                    u[2 * nodes[j / 2] + j % 2] += by;
                    of(&u, closing, slope)
                };
                let (after, before) = (moved(step), moved(-step));
                for i in j..n {
                    let found = -(after.force[i] - before.force[i]) / (2.0 * step);
                    let expected = here.stiffness[i * n + j];
                    assert!((found - expected).abs() < 1e-4 * scale + turning, "{i} {j}: {found} {expected}");
                }
                let found = -(after.torque - before.torque) / (2.0 * step);
                assert!(
                    (found - here.border[j]).abs() < 50.0 * (1e-4 * scale + turning),
                    "{j}: {found} {}",
                    here.border[j]
                );
                let moment = |pair: &PairContribution| pair.along_face.as_ref().unwrap().moment;
                let found = -(moment(&after) - moment(&before)) / (2.0 * step);
                let largest = along.by_node.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
                assert!((found - along.by_node[j]).abs() < 1e-3 * largest, "{j}: {found} {}", along.by_node[j]);
            }
            let (after, before) = (of(&u, closing, slope + step), of(&u, closing, slope - step));
            let moment = |pair: &PairContribution| pair.along_face.as_ref().unwrap().moment;
            let found = -(moment(&after) - moment(&before)) / (2.0 * step);
            assert!((found / along.by_slope - 1.0).abs() < 1e-3, "{found} {}", along.by_slope);
            let found = -(after.torque - before.torque) / (2.0 * step);
            assert!((found / along.by_output - 1.0).abs() < 1e-3, "{found} {}", along.by_output);
        });
    }

    /// The weights of a layout add up to the length of the flank and of the first part of the rounding.
    #[test]
    fn the_points_of_a_layout_cover_the_flank() {
        with_flanks(|flanks, fs, cs| {
            let (u, v) = (vec![0.0; 2 * fs.nodes.len()], vec![0.0; 2 * cs.nodes.len()]);
            for output_rad in [0.0, -1e-3, 2e-3] {
                let layout = flanks.layout(PAIR, Configuration { u: &u, v: &v, output_rad, leans: &[] });
                let tooth = &flanks.tooth;
                let (a, b) = (tooth.start_radius, tooth.junction_radius);
                let rounding = (tooth.rounding_radius * tooth.rounding_sweep).min(0.016);
                let expected = tooth.arc_at(b) - tooth.arc_at(a) + rounding;
                let found: f64 = layout.points.iter().map(|p| p.weight).sum();
                assert!((found - expected).abs() < 1e-12, "{found} mm of {expected} mm");
                assert!(layout.points.windows(2).all(|p| p[0].arc < p[1].arc), "not from root to tip");
                for p in &layout.points {
                    assert!((p.place.shape.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                }
            }
        });
    }

    #[test]
    fn friction_sticks_up_to_its_limit() {
        let law = FlankLaw { stiffness: 1e7, stick_stiffness: 1e6, friction: 0.1 };
        let point = FlankPoint {
            place: FlankPlace { position: [0.0; 2], edge: 0, shape: [0.0; 3] },
            weight: 1.0,
            arc: 0.0,
            start_traction: 2.0,
            start_foot: 0.5,
        };
        let (sticking, stiffness) = traction(law, 100.0, &point, 0.5 + 3e-6);
        assert!((sticking - 5.0).abs() < 1e-9 && stiffness == 1e6);
        assert_eq!(traction(law, 100.0, &point, 0.5 + 3e-5), (10.0, 0.0));
        assert_eq!(traction(law, 100.0, &point, 0.5 - 3e-5), (-10.0, 0.0));
        assert_eq!(traction(law, -1.0, &point, 0.6), (0.0, 0.0));
        assert_eq!(traction(FlankLaw { friction: 0.0, ..law }, 100.0, &point, 0.6), (0.0, 0.0));
    }

    #[test]
    fn history_is_interpolated_within_and_forgotten_without() {
        let history = vec![(1.0, 10.0), (2.0, 20.0)];
        assert!((interpolate(&history, 1.25) - 12.5).abs() < 1e-12);
        assert_eq!(interpolate(&history, 0.5), 0.0);
        assert_eq!(interpolate(&history, 2.5), 0.0);
        assert_eq!(interpolate(&Vec::new(), 1.0), 0.0);
    }
}
