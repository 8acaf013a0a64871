//! The same mesh, state, outlines and problem for other programs.

pub mod fmu;
mod inp;
mod outlines;
pub mod playback;
mod vtu;
mod vtu_whole;

pub use inp::{
    Deck, DeckError, DeckSettings, Equation, Face, STABILISING_LATERAL, STABILISING_TORSION, SleeveDeck, Term,
};
pub use outlines::{OutlinePoint, outlines};
pub(crate) use vtu::base64;
pub use vtu::{Frame, write_pvd, write_vtu};
pub use vtu_whole::write_whole_flexspline;
