//! The two wheels as a solver sees them: forces of their deformation, and a factorised tangent.

use crate::contact::{BorePressure, FlankPair};
use crate::fem::Factor;

use super::fast::Kept;
use super::state::State;

/// Elasticity of both wheels, with the contact that acts on them in the tangent.
///
/// Unknowns are two displacements of each flexspline node, then of each free circular-spline node, on the meshes of
/// [`Problem::wheels`](super::Problem::wheels).
pub(super) trait Wheels: Factor {
    /// Number of unknowns.
    fn unknowns(&self) -> usize;

    /// Prepares for the contact of pairs that are near; `widely` looks further. Whether the factor there was has become
    /// void.
    fn prepare(&mut self, near: &[FlankPair], widely: &dyn Fn() -> Vec<FlankPair>) -> bool;

    /// Places the nodes of a state that [`Wheels::assemble`] leaves aside, being far from any contact.
    fn complete(&self, state: &mut State);

    /// Places the nodes that have come near contact since the last solution, which a step of it therefore leaves
    /// behind.
    fn follow(&self, _state: &mut State) {}

    /// Begins anew at this state: subtracts the internal forces of both wheels from `force`. The tangent that
    /// [`Wheels::factorise`] factorises is the one of this state and of the contact added since.
    fn assemble(&mut self, state: &State, force: &mut [f64]);

    /// Adds the tangent of a bore edge.
    fn add_bore(&mut self, contact: &BorePressure);

    /// Adds the tangent of a pair of flanks (`PairContribution::stiffness`).
    fn add_flank(&mut self, pair: FlankPair, stiffness: Vec<f64>);

    /// The direction held by [`super::newton::ANCHOR`] while the tangent is factorised: unknowns and weights.
    fn anchor(&self) -> Vec<(usize, f64)>;

    /// Factorises the tangent, stiffened by `spring` (N/mm per mm) at every node or at some that hold the rest; false
    /// when it is not positive definite.
    fn factorise(&mut self, spring: f64) -> bool;

    /// The factor, to be used again in a state like the one it was made for; `None` where that is not worth while.
    fn keep(&self) -> Option<Kept> {
        None
    }

    /// Uses a kept factor in a state that is turned by a number of flexspline pitches against its own: it solves in the
    /// numbering of its own state.
    fn recall(&mut self, _kept: &Kept, _pitches: isize) {}

    /// Turns a vector of forces or displacements by a number of pitches of each wheel.
    fn turn(&self, _x: &mut [f64], _pitches: isize) {}
}
