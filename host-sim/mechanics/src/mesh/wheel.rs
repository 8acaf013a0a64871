//! A whole wheel: the half sector mirrored, and the sector repeated around the ring.
//!
//! Sector j of the flexspline is centred on tooth j, sector j of the circular spline on space j; sector 0 on the +x
//! axis, numbers growing counter-clockwise. Node `k` of sector `j` has the number `j * nodes_per_sector + k` and is the
//! rotated image of node `k` of sector 0: whatever repeats from tooth to tooth in the drive repeats in the mesh.
//!
//! A rim of varying thickness ([`RimVariation`]) moves the nodes between bore and interface circle along their radii;
//! numbers and elements stay what they are, and [`WheelMesh::sector_class`] says which sectors are images of one
//! another still.

use std::collections::HashMap;
use std::f64::consts::TAU;

use super::density::{MeshDensity, MeshLevel};
use super::sector::{EdgeTag, HalfOutline, HalfSector, MeshError, Point};
use crate::drive::{ActiveFlank, Drive, RimVariation, Side, ToothFlank, rotate};
use crate::fem::element::{GaussPoint, gauss_points};

/// Which wheel a mesh is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WheelKind {
    /// External teeth on a flexible rim; sectors centred on teeth.
    Flexspline,
    /// Internal teeth in a stiff ring; sectors centred on spaces.
    CircularSpline,
}

/// Three nodes of an element edge: start, middle, end, by node number within the sector and sector offset (0 or 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    /// Local node number and sector offset of each node.
    pub nodes: [(u32, u32); 3],
}

/// The flank edges of one sector side: a chain of nodes from root to tip at known radii of the undeformed flank.
#[derive(Debug, Clone, PartialEq)]
pub struct FlankMesh {
    /// Local node numbers along the flank, root to tip: corner, midside, corner, …
    pub nodes: Vec<u32>,
    /// Radius of each of these nodes, mm (ascending on the flexspline, descending on the circular spline).
    pub radii: Vec<f64>,
}

impl FlankMesh {
    /// Number of element edges.
    pub fn edges(&self) -> usize {
        (self.nodes.len() - 1) / 2
    }

    /// The edge that carries the flank point of radius `radius_mm` and its coordinate in [-1, 1]; points beyond an end
    /// are carried by the end itself.
    #[inline]
    pub(crate) fn locate(&self, radius_mm: f64) -> (usize, f64) {
        let (first, last) = (self.radii[0], self.radii[self.radii.len() - 1]);
        let edges = self.edges();
        let along = ((radius_mm - first) / (last - first)).clamp(0.0, 1.0) * edges as f64;
        let edge = (along as usize).min(edges - 1);
        (edge, 2.0 * (along - edge as f64) - 1.0)
    }
}

/// Mesh of a wheel.
#[derive(Debug, Clone)]
pub struct WheelMesh {
    /// Which wheel.
    pub kind: WheelKind,
    /// Teeth, equal to the number of sectors.
    pub teeth: usize,
    /// Nodes that a sector owns (those on its far boundary belong to the next).
    pub nodes_per_sector: usize,
    /// Node positions, undeformed (mm).
    pub nodes: Vec<Point>,
    /// Node numbers of each element, counter-clockwise, corners first.
    pub elements: Vec<[u32; 8]>,
    /// Elements of one sector.
    pub elements_per_sector: usize,
    /// Integration points of each element.
    pub gauss: Vec<[GaussPoint; 4]>,
    /// Flanks of one sector: plus side, minus side.
    pub flanks: [FlankMesh; 2],
    /// Edges of one sector on the bore or the outer circle, counter-clockwise.
    pub base_edges: Vec<Edge>,
    /// Radius of that circle (mm), for a rim of nominal thickness.
    pub base_radius: f64,
    /// How the rim varies around the wheel.
    pub rim: RimVariation,
}

impl WheelMesh {
    /// Meshes the flexspline.
    pub fn flexspline(drive: &Drive, level: MeshLevel) -> Result<WheelMesh, MeshError> {
        WheelMesh::flexspline_as_fine_as(drive, &level.flexspline())
    }

    /// Meshes the flexspline with the given numbers of elements; meshes of which one has twice as many in each
    /// direction have the coarser's nodes.
    pub fn flexspline_as_fine_as(drive: &Drive, density: &MeshDensity) -> Result<WheelMesh, MeshError> {
        let wheel = &drive.flexspline;
        let interface_radius = wheel.root_radius_mm - 0.3 * wheel.rim_thickness_mm;
        WheelMesh::new(
            WheelKind::Flexspline,
            &ToothFlank::external(drive)?,
            wheel.bore_radius_mm(),
            interface_radius,
            density,
        )?
        .with_rim(RimVariation::of(drive), interface_radius)
    }

    /// Meshes the circular spline.
    pub fn circular_spline(drive: &Drive, level: MeshLevel) -> Result<WheelMesh, MeshError> {
        WheelMesh::circular_spline_as_fine_as(drive, &level.circular_spline())
    }

    /// Meshes the circular spline with the given numbers of elements.
    pub(crate) fn circular_spline_as_fine_as(drive: &Drive, density: &MeshDensity) -> Result<WheelMesh, MeshError> {
        let wheel = &drive.circular_spline;
        let tooth_height = wheel.root_radius_mm - wheel.tip_radius_mm;
        let rim = wheel.outer_radius_mm - wheel.root_radius_mm;
        WheelMesh::new(
            WheelKind::CircularSpline,
            &ToothFlank::internal(drive)?,
            wheel.outer_radius_mm,
            wheel.root_radius_mm + (0.5 * tooth_height).min(0.4 * rim),
            density,
        )
    }

    /// The mesh with a rim that varies: its base circle moved inward by the thickness added, what lies between it and
    /// `fixed_radius` by a part that falls linearly.
    pub(crate) fn with_rim(mut self, rim: RimVariation, fixed_radius: f64) -> Result<WheelMesh, MeshError> {
        if !rim.is_none() {
            for p in &mut self.nodes {
                let r = p[0].hypot(p[1]);
                let part = ((fixed_radius - r) / (fixed_radius - self.base_radius)).max(0.0);
                let stretch = 1.0 - part * rim.at(p[1].atan2(p[0])) / r;
                *p = [p[0] * stretch, p[1] * stretch];
            }
            self.gauss = integration_points(self.kind, &self.elements, &self.nodes)?;
        }
        self.rim = rim;
        Ok(self)
    }

    /// A smooth ring: `sectors` elements around, `rows` through its thickness, no flanks.
    pub fn smooth_ring(bore_radius: f64, thickness: f64, sectors: usize, rows: usize) -> Result<WheelMesh, MeshError> {
        let half_pitch = std::f64::consts::PI / sectors as f64;
        let at = |row: f64, angle: f64| {
            let r = bore_radius + thickness * row / rows as f64;
            [r * angle.cos(), r * angle.sin()]
        };
        let elements = (0..rows)
            .map(|row| {
                let (inner, outer, middle) = (row as f64, row as f64 + 1.0, row as f64 + 0.5);
                [
                    at(inner, 0.0),
                    at(outer, 0.0),
                    at(outer, half_pitch),
                    at(inner, half_pitch),
                    at(middle, 0.0),
                    at(outer, 0.5 * half_pitch),
                    at(middle, half_pitch),
                    at(inner, 0.5 * half_pitch),
                ]
            })
            .collect();
        let half = HalfSector { elements, edges: vec![(0, 3, EdgeTag::Base(0))] };
        WheelMesh::assemble(WheelKind::Flexspline, sectors, bore_radius, half)
    }

    fn new(
        kind: WheelKind,
        profile: &ToothFlank,
        base_radius: f64,
        interface_radius: f64,
        density: &MeshDensity,
    ) -> Result<WheelMesh, MeshError> {
        let half_pitch = profile.half_pitch();
        let teeth = (std::f64::consts::PI / half_pitch).round() as usize;
        let active = ActiveFlank::new(profile);
        // Profiles are given about the tooth (external) or the space (internal); the half sector wants the tooth axis.
        let to_tooth_frame = |p: Point| match kind {
            WheelKind::Flexspline => p,
            WheelKind::CircularSpline => {
                let (r, a) = (p[0].hypot(p[1]), half_pitch - p[1].atan2(p[0]));
                [r * a.cos(), r * a.sin()]
            }
        };
        let root = |t: f64| {
            let [land, fillet] = [&profile.pieces()[0], &profile.pieces()[1]];
            to_tooth_frame(if t < 1.0 { land.point(t) } else { fillet.point(t - 1.0) })
        };
        let flank = |r: f64| to_tooth_frame(active.point(r));
        let half = HalfSector::new(
            &HalfOutline {
                half_pitch,
                base_radius,
                interface_radius,
                root: &root,
                flank: &flank,
                flank_start_radius: active.start_radius,
                tip_radius: active.tip_radius,
            },
            density,
        );
        WheelMesh::assemble(kind, teeth, base_radius, half)
    }

    fn assemble(kind: WheelKind, teeth: usize, base_radius: f64, half: HalfSector) -> Result<WheelMesh, MeshError> {
        let half_pitch = std::f64::consts::PI / teeth as f64;
        let pitch = 2.0 * half_pitch;
        // The half sector as it stands lies on the plus side of a tooth; about a space it is the minus side, turned by
        // half a pitch. Its mirror image is the other half.
        let upper = |p: Point| match kind {
            WheelKind::Flexspline => p,
            WheelKind::CircularSpline => {
                let q = rotate(p, (-half_pitch).sin_cos());
                [q[0], -q[1]]
            }
        };
        let mirror = |p: Point| [p[0], -p[1]];
        let mut nodes = NodeTable::new(half_pitch, pitch);
        let mut template: Vec<[(u32, u32); 8]> = Vec::new();
        let mut base_edges: Vec<(f64, Edge)> = Vec::new();
        let mut flanks: [Vec<(usize, Edge)>; 2] = [Vec::new(), Vec::new()];
        for side in Side::BOTH {
            // Turning a space half over reverses the order of its nodes; so does mirroring.
            let reversed = (kind == WheelKind::CircularSpline) != (side == Side::Minus);
            let place = |p: Point| {
                if side == Side::Plus { upper(p) } else { mirror(upper(p)) }
            };
            let first = template.len();
            for element in &half.elements {
                let mut placed = element.map(place);
                if reversed {
                    placed = reverse_order(placed);
                }
                template.push(placed.map(|p| nodes.find_or_add(p)));
            }
            for (element, edge, tag) in &half.edges {
                let local = if reversed { 3 - edge } else { *edge };
                let n = template[first + element];
                let edge = Edge { nodes: [n[local], n[4 + local], n[(local + 1) % 4]] };
                match tag {
                    EdgeTag::Base(_) => {
                        let angle = nodes.angle(edge.nodes[1]);
                        base_edges.push((angle, edge));
                    }
                    EdgeTag::Flank(row) => flanks[side.index()].push((*row, edge)),
                }
            }
        }
        base_edges.sort_by(|a, b| a.0.total_cmp(&b.0));
        let base_edges = base_edges.into_iter().map(|(_, edge)| nodes.counter_clockwise(edge)).collect();
        let flanks = flanks.map(|mut side| {
            side.sort_by_key(|(row, _)| *row);
            nodes.flank_chain(kind, &side)
        });

        let nodes_per_sector = nodes.points.len();
        let mut all_nodes = Vec::with_capacity(nodes_per_sector * teeth);
        let mut elements = Vec::with_capacity(template.len() * teeth);
        for sector in 0..teeth {
            let turn = (TAU * sector as f64 / teeth as f64).sin_cos();
            all_nodes.extend(nodes.points.iter().map(|p| rotate(*p, turn)));
            for element in &template {
                elements.push(
                    element
                        .map(|(node, offset)| (((sector + offset as usize) % teeth) * nodes_per_sector) as u32 + node),
                );
            }
        }
        let gauss = integration_points(kind, &elements, &all_nodes)?;
        Ok(WheelMesh {
            kind,
            teeth,
            nodes_per_sector,
            nodes: all_nodes,
            elements,
            elements_per_sector: template.len(),
            gauss,
            flanks,
            base_edges,
            base_radius,
            rim: RimVariation::default(),
        })
    }

    /// Sectors of the same class are congruent: one is the other turned by their distance around the ring. Classes
    /// count from 0 and sector `c` is of class `c`, so that each can be treated once, at its first sector.
    #[inline]
    pub(crate) fn sector_class(&self, sector: usize) -> usize {
        sector % self.sector_classes()
    }

    /// How many classes of sectors there are: one, unless the rim varies.
    pub(crate) fn sector_classes(&self) -> usize {
        self.rim.repeats_after(self.teeth)
    }

    /// Number of a node given by sector and local number; the sector may lie beyond either end of the ring.
    #[inline]
    pub fn node(&self, sector: isize, local: u32) -> usize {
        sector.rem_euclid(self.teeth as isize) as usize * self.nodes_per_sector + local as usize
    }

    /// Nodes of a base edge of a sector.
    #[inline]
    pub fn edge_nodes(&self, sector: usize, edge: &Edge) -> [usize; 3] {
        edge.nodes.map(|(local, offset)| self.node((sector + offset as usize) as isize, local))
    }

    /// Angle of the axis of a sector, rad.
    #[inline]
    pub fn sector_angle(&self, sector: usize) -> f64 {
        TAU * sector as f64 / self.teeth as f64
    }

    /// Angular pitch, rad.
    pub fn pitch(&self) -> f64 {
        TAU / self.teeth as f64
    }
}

/// Integration points of every element.
fn integration_points(
    kind: WheelKind,
    elements: &[[u32; 8]],
    nodes: &[Point],
) -> Result<Vec<[GaussPoint; 4]>, MeshError> {
    elements
        .iter()
        .map(|element| {
            let coordinates = element.map(|n| nodes[n as usize]);
            gauss_points(&coordinates).map_err(|folded| MeshError::Folded {
                wheel: match kind {
                    WheelKind::Flexspline => "flexspline",
                    WheelKind::CircularSpline => "circular spline",
                },
                radius_mm: coordinates[0][0].hypot(coordinates[0][1]),
                jacobian: folded.jacobian,
            })
        })
        .collect()
}

/// An element with its nodes in the opposite sense; local edge e becomes 3 − e.
fn reverse_order<T: Copy>(n: [T; 8]) -> [T; 8] {
    [n[0], n[3], n[2], n[1], n[7], n[6], n[5], n[4]]
}

/// Nodes of a sector, merged by position; those on the far boundary are the next sector's nodes on its near boundary.
struct NodeTable {
    half_pitch: f64,
    pitch: f64,
    points: Vec<Point>,
    index: HashMap<(i64, i64), u32>,
}

impl NodeTable {
    /// Positions closer than this (mm) are one node.
    const MERGE: f64 = 1e-6;

    fn new(half_pitch: f64, pitch: f64) -> Self {
        NodeTable { half_pitch, pitch, points: Vec::new(), index: HashMap::new() }
    }

    fn find_or_add(&mut self, p: Point) -> (u32, u32) {
        let (r, angle) = (p[0].hypot(p[1]), p[1].atan2(p[0]));
        let far = angle > self.half_pitch - Self::MERGE / r;
        let q = if far { [r * (angle - self.pitch).cos(), r * (angle - self.pitch).sin()] } else { p };
        let cell = q.map(|x| (x / Self::MERGE).round() as i64);
        for dx in -1..=1 {
            for dy in -1..=1 {
                if let Some(&node) = self.index.get(&(cell[0] + dx, cell[1] + dy)) {
                    return (node, u32::from(far));
                }
            }
        }
        let node = self.points.len() as u32;
        self.points.push(q);
        self.index.insert((cell[0], cell[1]), node);
        (node, u32::from(far))
    }

    fn angle(&self, (node, offset): (u32, u32)) -> f64 {
        let p = self.points[node as usize];
        p[1].atan2(p[0]) + f64::from(offset) * self.pitch
    }

    fn counter_clockwise(&self, edge: Edge) -> Edge {
        let [a, m, b] = edge.nodes;
        if self.angle(a) < self.angle(b) { edge } else { Edge { nodes: [b, m, a] } }
    }

    /// Chains flank edges from root to tip. Their radii are evenly spaced, as the mesher lays them.
    fn flank_chain(&self, kind: WheelKind, rows: &[(usize, Edge)]) -> FlankMesh {
        let radius = |(node, _): (u32, u32)| {
            let p = self.points[node as usize];
            p[0].hypot(p[1])
        };
        let outwards = kind == WheelKind::Flexspline;
        let mut nodes = Vec::new();
        let mut radii = Vec::new();
        for (_, edge) in rows {
            let [a, m, b] = edge.nodes;
            let ordered = if (radius(a) < radius(b)) == outwards { [a, m, b] } else { [b, m, a] };
            for n in ordered.into_iter().skip(usize::from(!nodes.is_empty())) {
                nodes.push(n.0);
                radii.push(radius(n));
            }
        }
        FlankMesh { nodes, radii }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Harmonic;
    use std::collections::{BTreeMap, BTreeSet};

    fn meshes(level: MeshLevel) -> [WheelMesh; 2] {
        let drive = Drive::hhd_95();
        [WheelMesh::flexspline(&drive, level).unwrap(), WheelMesh::circular_spline(&drive, level).unwrap()]
    }

    fn profile(kind: WheelKind) -> (ToothFlank, ActiveFlank) {
        let drive = Drive::hhd_95();
        let profile = match kind {
            WheelKind::Flexspline => ToothFlank::external(&drive),
            WheelKind::CircularSpline => ToothFlank::internal(&drive),
        }
        .unwrap();
        let flank = ActiveFlank::new(&profile);
        (profile, flank)
    }

    /// Area between the base circle and the outline: root land, fillet, involute, and the tip circle, half a pitch of
    /// it by `r² dθ / 2`, times the number of halves.
    fn area_of_outline(mesh: &WheelMesh) -> f64 {
        let (profile, involute) = profile(mesh.kind);
        let mut outline: Vec<Point> = Vec::new();
        for piece in &profile.pieces()[..2] {
            outline.extend((0..=2000).map(|k| piece.point(f64::from(k) / 2000.0)));
        }
        let (start, tip) = (involute.start_radius, involute.tip_radius);
        outline.extend((0..=2000).map(|k| involute.point(start + (tip - start) * f64::from(k) / 2000.0)));
        let swept: f64 = outline.windows(2).map(|p| 0.5 * (p[0][0] * p[1][1] - p[0][1] * p[1][0])).sum::<f64>().abs();
        // The tip land is a circle: from the axis of the tooth, or to the edge of the space.
        let land = match mesh.kind {
            WheelKind::Flexspline => involute.half_angle(tip),
            WheelKind::CircularSpline => profile.half_pitch() - involute.half_angle(tip),
        };
        let half = swept + 0.5 * tip * tip * land;
        let base = 0.5 * mesh.base_radius * mesh.base_radius * profile.half_pitch();
        2.0 * mesh.teeth as f64 * (half - base).abs()
    }

    #[test]
    fn areas_are_those_of_the_outlines() {
        for (level, allowed) in [(MeshLevel::Coarse, 1e-4), (MeshLevel::Standard, 1e-4), (MeshLevel::Fine, 1e-5)] {
            for mesh in meshes(level) {
                let found: f64 = mesh.gauss.iter().flatten().map(|point| point.area).sum();
                let expected = area_of_outline(&mesh);
                let error = found / expected - 1.0;
                println!("{level} {:?}: {found:.6} mm², outline {expected:.6} mm², {error:.1e}", mesh.kind);
                assert!(error.abs() <= allowed, "{level} {:?}: {found} mm², outline {expected} mm²", mesh.kind);
            }
        }
    }

    #[test]
    fn sectors_repeat_exactly() {
        for mesh in meshes(MeshLevel::Standard) {
            for sector in 0..mesh.teeth {
                let (s, c) = mesh.sector_angle(sector).sin_cos();
                for local in 0..mesh.nodes_per_sector {
                    let (p, q) = (mesh.nodes[local], mesh.nodes[sector * mesh.nodes_per_sector + local]);
                    let turned = [c * p[0] - s * p[1], s * p[0] + c * p[1]];
                    assert!((turned[0] - q[0]).hypot(turned[1] - q[1]) < 1e-12);
                }
                for e in 0..mesh.elements_per_sector {
                    let (first, here) = (&mesh.gauss[e], &mesh.gauss[sector * mesh.elements_per_sector + e]);
                    assert!(first.iter().zip(here).all(|(a, b)| (a.area / b.area - 1.0).abs() < 1e-10));
                    for (a, b) in mesh.elements[e].iter().zip(mesh.elements[sector * mesh.elements_per_sector + e]) {
                        let shifted = (*a as usize + sector * mesh.nodes_per_sector) % mesh.nodes.len();
                        assert_eq!(shifted, b as usize);
                    }
                }
            }
        }
    }

    #[test]
    fn a_varying_rim_moves_the_bore_and_repeats_by_classes() {
        let mut drive = Drive::hhd_95();
        drive.as_built.rim_thickness_harmonics = vec![
            Harmonic { order: 4, amplitude_um: 30.0, phase_deg: 11.0 },
            Harmonic { order: 8, amplitude_um: 5.0, phase_deg: 0.0 },
        ];
        let plain = WheelMesh::flexspline(&Drive::hhd_95(), MeshLevel::Standard).unwrap();
        let mesh = WheelMesh::flexspline(&drive, MeshLevel::Standard).unwrap();
        assert_eq!((plain.sector_classes(), plain.sector_class(100)), (1, 0));
        assert_eq!(mesh.sector_classes(), 47);
        for (p, q) in plain.nodes.iter().zip(&mesh.nodes) {
            let (r, angle) = (p[0].hypot(p[1]), p[1].atan2(p[0]));
            let inward = r - q[0].hypot(q[1]);
            let thicker = 0.03 * (4.0 * (angle - 11f64.to_radians())).cos() + 0.005 * (8.0 * angle).cos();
            let part = ((47.515 - r) / (47.515 - 46.675)).max(0.0);
            assert!((inward - part * thicker).abs() < 1e-12, "at {r}, {angle}: {inward}");
        }
        for sector in 0..mesh.teeth {
            let class = mesh.sector_class(sector);
            let (s, c) = (mesh.sector_angle(sector) - mesh.sector_angle(class)).sin_cos();
            for local in 0..mesh.nodes_per_sector {
                let p = mesh.nodes[class * mesh.nodes_per_sector + local];
                let q = mesh.nodes[sector * mesh.nodes_per_sector + local];
                assert!((c * p[0] - s * p[1] - q[0]).hypot(s * p[0] + c * p[1] - q[1]) < 1e-12);
            }
        }
        // Between classes they are not.
        let radius = |sector: usize| {
            let [a, _, _] = mesh.edge_nodes(sector, &mesh.base_edges[0]);
            mesh.nodes[a][0].hypot(mesh.nodes[a][1])
        };
        assert!((radius(0) - radius(20)).abs() > 1e-3);
    }

    #[test]
    fn edges_lie_on_circle_and_involute() {
        for level in MeshLevel::ALL {
            for mesh in meshes(level) {
                let (_, involute) = profile(mesh.kind);
                let mut end = None;
                for edge in &mesh.base_edges {
                    let [a, _, b] = mesh.edge_nodes(0, edge);
                    for n in mesh.edge_nodes(0, edge) {
                        let p = mesh.nodes[n];
                        assert!((p[0].hypot(p[1]) - mesh.base_radius).abs() < 1e-12);
                    }
                    assert!(end.is_none_or(|end| end == a), "base edges do not follow one another");
                    end = Some(b);
                }
                for side in Side::BOTH {
                    let flank = &mesh.flanks[side.index()];
                    assert_eq!(flank.nodes.len(), flank.radii.len());
                    for (&node, &radius) in flank.nodes.iter().zip(&flank.radii) {
                        let p = mesh.nodes[node as usize];
                        assert!((p[0].hypot(p[1]) - radius).abs() < 1e-12);
                        let off = radius * (side.sign() * p[1].atan2(p[0]) - involute.half_angle(radius));
                        assert!(off.abs() < 1e-12, "{level} {:?} {side:?}: {off} mm off at {radius} mm", mesh.kind);
                    }
                    for (k, &radius) in flank.radii.iter().enumerate() {
                        let (edge, xi) = flank.locate(radius);
                        assert!(
                            (2.0 * edge as f64 + xi + 1.0 - k as f64).abs() < 1e-9,
                            "node {k} found at {edge} {xi}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn nodes_are_shared_by_neighbours_and_by_nobody_else() {
        for level in MeshLevel::ALL {
            for mesh in meshes(level) {
                let mut corners: BTreeSet<u32> = BTreeSet::new();
                let mut edges: BTreeMap<u32, (BTreeSet<u32>, usize)> = BTreeMap::new();
                for element in &mesh.elements {
                    assert_eq!(element.iter().collect::<BTreeSet<_>>().len(), 8, "an element uses a node twice");
                    corners.extend(element[..4].iter());
                    for k in 0..4 {
                        let ends = BTreeSet::from([element[k], element[(k + 1) % 4]]);
                        let edge = edges.entry(element[4 + k]).or_insert((ends.clone(), 0));
                        assert_eq!(edge.0, ends, "a midside node serves two edges");
                        edge.1 += 1;
                    }
                }
                assert!(edges.keys().all(|middle| !corners.contains(middle)));
                assert_eq!(corners.len() + edges.len(), mesh.nodes.len(), "nodes that no element uses");
                assert!(edges.values().all(|(_, users)| *users <= 2), "an edge of three elements");
                // A ring: corners - edges + elements = 0, and two closed boundaries.
                assert_eq!(corners.len() + mesh.elements.len(), edges.len());
                let single = edges.values().filter(|(_, users)| *users == 1).count();
                assert_eq!(single % mesh.teeth, 0);
                // Midside nodes lie near the middle of their edges: nothing is shared across the ring.
                for (middle, (ends, _)) in &edges {
                    let at = |n: &u32| mesh.nodes[*n as usize];
                    let ends: Vec<Point> = ends.iter().map(at).collect();
                    let length = (ends[0][0] - ends[1][0]).hypot(ends[0][1] - ends[1][1]);
                    let p = at(middle);
                    let off = (p[0] - 0.5 * (ends[0][0] + ends[1][0])).hypot(p[1] - 0.5 * (ends[0][1] + ends[1][1]));
                    assert!(
                        off < 0.3 * length,
                        "{level} {:?}: midside node {off} mm off an edge of {length} mm",
                        mesh.kind
                    );
                }
            }
        }
    }
}
