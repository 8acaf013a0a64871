//! Condensation of the wheels onto the nodes that touch something.
//!
//! A wheel is a ring of congruent cells: a flexspline tooth from one space axis to the next, a circular-spline tooth
//! from one space axis to the next. Of each cell only the nodes on its two faces, on the bore and on the flanks are
//! kept (`Skin`); the others follow from them, exactly, because a cell is linear in the frame that turns with it
//! (`Superelement`, computed once for all congruent cells). Large rotations of the flexspline are those of the frames
//! ([`CoRotation`]).

mod chain;
mod corotation;
mod dense;
mod model;
mod skin;
mod superelement;
mod tangent;

pub use chain::{Chain, ChainBlock};
pub use corotation::{CellState, CoRotation};
pub(crate) use dense::{Multiply, kernel};
pub use dense::{one, one_mut};
pub use model::{Cell, CondensedWheel};
pub use tangent::{
    CellAt, CellPlacement, CellTangent, Sides, Traction, Turn, back, put, rotate_pairs, rotate_sides, take,
};
pub(crate) use tangent::{Reduce, dot};
