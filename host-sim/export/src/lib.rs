//! The same mesh, state, outlines and problem for other programs.
#![forbid(unsafe_code)]

pub mod bundle;
pub mod fmu;
mod inp;
mod outlines;
pub mod playback;
mod shipped;
mod vtu;
mod vtu_whole;

pub use inp::{Deck, DeckError, DeckSettings, Equation, EquationTerm, Face, STABILISING_TORSION, SleeveDeck};

pub use outlines::{OutlinePoint, outlines};
pub use vtu::base64;
pub use vtu::{VtuFrame, write_pvd, write_vtu};
pub use vtu_whole::{station_at, write_whole_flexspline};
