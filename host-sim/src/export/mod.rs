//! The same mesh, state and outlines for other programs.

pub mod inp;
mod outlines;
mod vtu;

pub use outlines::{OutlinePoint, outlines};
pub use vtu::{Frame, write_pvd, write_vtu};
