//! Slopes of the wind-up at its torque nodes, from the values there alone and linearly: what the image writer stores
//! and what the least squares assume. How a cubic goes between the nodes: `table/windup.rs` of `flexspline`.

use flexspline::shared::grid::{self, MAX_CLAMPED_NODES};

/// Most nodes that a slope depends on.
pub const STENCIL: usize = 5;
/// Fewest nodes of a piece whose slopes are taken over the root of the torque.
const ROOT_NODES: usize = STENCIL;
/// Where the root is zero: this part of the first interval short of the piece.
const ROOT_ORIGIN: f64 = 0.25;

/// The slope at a node as a sum over neighbouring nodes.
#[derive(Clone, Copy, Debug, Default)]
pub struct NodeSlope {
    /// The first of the nodes.
    pub first: usize,
    /// Their weights, per N·m; 0 for those not needed.
    pub weights: [f64; STENCIL],
}

impl NodeSlope {
    /// The slope of `values`, one for each node of the axis.
    pub fn of(&self, values: &[f32]) -> f64 {
        self.weights.iter().zip(values.get(self.first..).unwrap_or_default()).map(|(w, value)| w * *value as f64).sum()
    }
}

/// The slopes at all nodes of a torque axis.
pub struct Slopes {
    nodes: [NodeSlope; MAX_CLAMPED_NODES],
}

impl Slopes {
    /// For strictly increasing nodes; ones beyond the most an axis may have are left out.
    pub fn new(torque_nodes: &[f32]) -> Self {
        let axis = torque_nodes.get(..MAX_CLAMPED_NODES).unwrap_or(torque_nodes);
        let jumps = grid::jump_intervals(axis.len(), |i| axis.get(i).copied().unwrap_or(0.0));
        let mut nodes = [NodeSlope::default(); MAX_CLAMPED_NODES];
        let mut first = 0usize;
        let (mut left, mut out) = (axis, &mut nodes[..]);
        let mut after_jump = false;
        while !left.is_empty() {
            let jump_above = |len: usize| grid::is_jump(jumps, first.saturating_add(len).saturating_sub(1));
            let len = (1..left.len()).find(|&len| jump_above(len)).unwrap_or(left.len());
            let (piece, rest) = left.split_at_checked(len).unwrap_or_default();
            let (here, rest_out) = out.split_at_mut_checked(len).unwrap_or_default();
            slopes_of_piece(piece, [after_jump, !rest.is_empty()], here);
            here.iter_mut().for_each(|slope| slope.first = slope.first.saturating_add(first));
            first = first.saturating_add(len);
            (left, out, after_jump) = (rest, rest_out, true);
        }
        Self { nodes }
    }

    /// The slope at a node.
    pub fn at(&self, node: usize) -> NodeSlope {
        self.nodes.get(node).copied().unwrap_or_default()
    }
}

/// Slopes at the nodes of one piece; `jumps` states whether it ends at a jump below and above.
///
/// Of a polynomial through the nearest nodes. Wind-up starts steeply at a jump and flattens, with nodes closer together
/// there; so in a piece of five nodes or more that has a jump at one end, it is a quartic in the root u of the distance
/// from that end (plus a quarter of the first interval), which contains τ = u² and τ² = u⁴. Elsewhere a parabola in τ.
fn slopes_of_piece(piece: &[f32], jumps: [bool; 2], out: &mut [NodeSlope]) {
    let torque = |node: usize| piece.get(node).copied().unwrap_or(0.0) as f64;
    let last = piece.len().saturating_sub(1);
    let near_end = match jumps {
        _ if piece.len() < ROOT_NODES => None,
        [true, false] => Some((0, 1)),
        [false, true] => Some((last, last.saturating_sub(1))),
        _ => None,
    };
    // The variable at a node, and how fast it goes with the torque there.
    let variable = |node: usize| match near_end {
        None => (torque(node), 1.0),
        Some((end, next)) => {
            let width = torque(next) - torque(end);
            let root = libm::sqrt((torque(node) - torque(end)).abs() + ROOT_ORIGIN * width.abs());
            (root, if width < 0.0 { -0.5 / root } else { 0.5 / root })
        }
    };
    let count = if near_end.is_some() { STENCIL } else { 3 }.min(piece.len());
    for (node, slope) in out.iter_mut().enumerate() {
        let first = node.saturating_sub(count / 2).min(piece.len().saturating_sub(count));
        let (here, rate) = variable(node);
        let mut places = [0.0; STENCIL];
        places.iter_mut().take(count).zip(first..).for_each(|(place, node)| *place = variable(node).0 - here);
        let places = places.get(..count).unwrap_or_default();
        *slope =
            NodeSlope { first, weights: differentiate(places, node.saturating_sub(first)).map(|weight| weight * rate) };
    }
}

/// Weights of the derivative at 0 of the polynomial through the values at `places`; place `centre` is 0.
fn differentiate(places: &[f64], centre: usize) -> [f64; STENCIL] {
    let mut weights = [0.0; STENCIL];
    let mut sum = 0.0;
    for (own, (weight, &place)) in weights.iter_mut().zip(places).enumerate() {
        if own == centre {
            continue;
        }
        *weight = 1.0 / place;
        for (other, &other_place) in places.iter().enumerate() {
            if other != own && other != centre {
                *weight *= other_place / (other_place - place);
            }
        }
        sum += *weight;
    }
    // A constant has no slope.
    if let Some(weight) = weights.get_mut(centre) {
        *weight = -sum;
    }
    weights
}
