//! State of the drive: everything that changes as the generator turns.

use std::collections::BTreeMap;

use crate::contact::{FrictionHistory, Lean};
use crate::drive::Side;

/// Configuration and history after a converged increment.
#[derive(Debug, Clone)]
pub struct State {
    /// Displacements of the flexspline, global frame, x and y of each node (mm).
    pub u: Vec<f64>,
    /// Displacements of the circular spline in the frame that turns with it (mm).
    pub v: Vec<f64>,
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Load torque on the output, N m (positive turns it forward).
    pub torque_n_m: f64,
    /// Output angle, rad.
    pub output_rad: f64,
    /// Output angle at which the drag of the output would vanish, rad.
    pub drag_anchor_rad: f64,
    /// Moment of the sleeve on the bore, per mm of width (N mm/mm).
    pub sleeve_moment: f64,
    /// Lateral force of the sleeve on the bore (N/mm).
    pub lateral_force: [f64; 2],
    /// Tangential tractions on the flanks of flexspline teeth (only with friction).
    pub friction: BTreeMap<(usize, Side), FrictionHistory>,
    /// How each flexspline tooth leans along its face, outward and around, away from what holds the flexspline (rad):
    /// by the waves of the rim and its taper. Empty where the load along the face is even.
    pub leans: Vec<Lean>,
    /// Output turn per generator turn of the last increment: what the predictor expects to go on.
    pub output_rate: f64,
    /// Sense in which the generator last turned: +1, −1, or 0 before it moved.
    pub travel: f64,
}
