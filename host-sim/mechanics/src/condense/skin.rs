//! The nodes of a wheel that are kept, as a mesh of their own for contact and predictor.

use std::collections::HashMap;

use crate::mesh::{Edge, FlankMesh, WheelKind, WheelMesh};

use super::superelement::CellNodes;

/// A wheel reduced to the nodes on the faces between its cells, on the bore and on the flanks.
///
/// `mesh` numbers them sector by sector as the whole mesh does, has its flanks and base edges, and no elements: contact
/// and travelling-wave predictor work on it as on the whole.
#[derive(Debug, Clone)]
pub struct Skin {
    /// The kept nodes.
    pub mesh: WheelMesh,
    /// Number in the whole mesh of each node of sector 0.
    pub original: Vec<u32>,
    /// Nodes on a face.
    face: usize,
    /// Nodes of sector 0 on the bore between its faces, as numbers of the skin.
    bore: Vec<u32>,
}

impl Skin {
    /// Skin of a wheel. `held` says which nodes the housing holds; they are no part of it.
    pub fn new(whole: &WheelMesh, held: impl Fn(u32) -> bool) -> Skin {
        let face = face_nodes(whole, &held);
        let mut original = face.clone();
        let keep = |n: u32, original: &mut Vec<u32>| {
            if (n as usize) < whole.nodes_per_sector && !held(n) && !original.contains(&n) {
                original.push(n);
            }
        };
        if whole.kind == WheelKind::Flexspline {
            for edge in &whole.base_edges {
                for (n, offset) in edge.nodes {
                    if offset == 0 {
                        keep(n, &mut original);
                    }
                }
            }
        }
        let bore = (face.len() as u32..original.len() as u32).collect();
        for flank in &whole.flanks {
            for &n in &flank.nodes {
                keep(n, &mut original);
            }
        }
        let number: HashMap<u32, u32> = original.iter().enumerate().map(|(k, &n)| (n, k as u32)).collect();
        let flanks = whole.flanks.each_ref().map(|flank| FlankMesh {
            nodes: flank.nodes.iter().map(|n| number[n]).collect(),
            radii: flank.radii.clone(),
        });
        let base_edges = if whole.kind == WheelKind::Flexspline {
            whole.base_edges.iter().map(|e| Edge { nodes: e.nodes.map(|(n, offset)| (number[&n], offset)) }).collect()
        } else {
            Vec::new()
        };
        let nodes = (0..whole.teeth)
            .flat_map(|sector| original.iter().map(move |&n| whole.nodes[whole.node(sector as isize, n)]))
            .collect();
        let mesh = WheelMesh {
            kind: whole.kind,
            teeth: whole.teeth,
            nodes_per_sector: original.len(),
            nodes,
            elements: Vec::new(),
            elements_per_sector: 0,
            gauss: Vec::new(),
            flanks,
            base_edges,
            base_radius: whole.base_radius,
            rim: whole.rim.clone(),
        };
        Skin { mesh, original, face: face.len(), bore }
    }

    /// Kept nodes of a cell, by number in the skin, in the order of [`CellNodes::kept`].
    ///
    /// Cell j of the flexspline is sector j; cell t of the circular spline is the tooth between the spaces t and t + 1.
    pub(crate) fn cell(&self, cell: usize) -> Vec<u32> {
        let at = |sector: usize, n: &u32| self.mesh.node(sector as isize, *n) as u32;
        let minus = cell + usize::from(self.mesh.kind == WheelKind::CircularSpline);
        let [plus_flank, minus_flank] = &self.mesh.flanks;
        let face = 0..self.face as u32;
        let mut nodes: Vec<u32> = plus_flank.nodes.iter().map(|n| at(cell, n)).collect();
        nodes.extend(minus_flank.nodes.iter().map(|n| at(minus, n)));
        nodes.extend(self.bore.iter().map(|n| at(cell, n)));
        nodes.extend(face.clone().map(|n| at(cell, &n)));
        nodes.extend(face.map(|n| at(cell + 1, &n)));
        nodes
    }

    /// A cell in the whole mesh.
    pub(crate) fn cell_nodes(&self, whole: &WheelMesh, cell: usize, held: impl Fn(u32) -> bool) -> CellNodes {
        let per_sector = self.mesh.nodes_per_sector as u32;
        let original = |n: &u32| whole.node((n / per_sector) as isize, self.original[(n % per_sector) as usize]) as u32;
        let kept = self.cell(cell).iter().map(original).collect();
        let (count, pitch) = (whole.elements_per_sector, whole.pitch());
        let of_sector = |sector: usize| (sector % whole.teeth) * count..(sector % whole.teeth + 1) * count;
        // The first half of the elements of a sector lies on the plus side.
        let (elements, angle): (Vec<usize>, f64) = match whole.kind {
            WheelKind::Flexspline => (of_sector(cell).collect(), cell as f64 * pitch),
            WheelKind::CircularSpline => (
                of_sector(cell).take(count / 2).chain(of_sector(cell + 1).skip(count / 2)).collect(),
                (cell as f64 + 0.5) * pitch,
            ),
        };
        let mut held_nodes: Vec<u32> = elements.iter().flat_map(|&e| whole.elements[e]).filter(|n| held(*n)).collect();
        held_nodes.sort_unstable();
        held_nodes.dedup();
        CellNodes {
            kept,
            flank: self.mesh.flanks.iter().map(|f| f.nodes.len()).sum(),
            bore: self.bore.len(),
            face: self.face,
            held: held_nodes,
            elements,
            angle,
        }
    }
}

/// Nodes of sector 0 on the face between two cells, from the axis outwards: on the near boundary of a flexspline
/// sector, on the space axis of a circular-spline sector.
fn face_nodes(whole: &WheelMesh, held: &impl Fn(u32) -> bool) -> Vec<u32> {
    let axis = match whole.kind {
        WheelKind::Flexspline => -0.5 * whole.pitch(),
        WheelKind::CircularSpline => 0.0,
    };
    let radius = |n: u32| whole.nodes[n as usize][0].hypot(whole.nodes[n as usize][1]);
    let mut nodes: Vec<u32> = (0..whole.nodes_per_sector as u32)
        .filter(|&n| {
            let x = whole.nodes[n as usize];
            (x[1].atan2(x[0]) - axis).abs() * radius(n) < 1e-7 && !held(n)
        })
        .collect();
    nodes.sort_by(|a, b| radius(*a).total_cmp(&radius(*b)));
    nodes
}
