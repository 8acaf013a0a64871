//! The drive: what `drive.toml` says, the tooth outlines, and the wave generators.
//!
//! Lengths are mm, forces N, stresses MPa, angles rad; a field in another unit says so in its name. The flexspline is
//! fixed and the circular spline is the output (two waves, ratio `+z_c / (z_c - z_f)`).
//!
//! Frames:
//! * the **generator frame** has the major axis along +x;
//! * the **tooth frame** has the axis of the flexspline tooth, or of the circular-spline *space*, along +x;
//! * at output zero and generator angle zero all of them coincide: flexspline tooth 0 stands in circular-spline
//!   space 0 on the major axis.
//!
//! Angles count counter-clockwise.

mod arcs;
mod as_built;
mod error;
mod few;
mod fields;
mod file;
mod flank;
mod generator;
mod interference;
mod listed;
mod neutral;
mod placement;
mod ring;
mod s_tooth;
mod sleeve;
mod spec;
mod tooth;

pub use as_built::{AsBuilt, DamagedFlank, DamagedTooth, Harmonic, RimVariation, Wheel};
pub use error::DriveError;
pub use few::{FewNumbers, MadeDrive};
pub use flank::{ActiveFlank, Foot};
pub use generator::{GeneratorOutline, OutlineFoot};
pub use interference::{FlankGap, MeshReport, RigidMesh, Room, Side};
pub(crate) use interference::{golden, halved};
pub use listed::{FieldKind, ListedField};
pub use neutral::NeutralCurve;
pub use placement::{FlankDeviations, Placement, rotate};
pub use ring::{GeneratorKind, RingShape, UnknownGenerator};
pub use sleeve::{Bottom, FaceLoad, Flange, Profile, Sleeve, SleeveKind};
pub use spec::{
    CircularSpline, Drive, Flanks, Flexspline, Generators, Material, OutputLoadPath, Temperature, ThermalState,
};
pub use tooth::{OutlinePiece, PieceKind, ToothFlank};

pub use crate::toml_file::Problem;
