//! Meshes of the two wheels: one tooth sector, repeated exactly around the ring.

mod density;
mod sector;
mod wheel;

pub use crate::drive::rotate;
pub use density::{MeshDensity, MeshLevel};
pub use sector::{MeshError, Point};
pub use wheel::{Edge, FlankMesh, WheelKind, WheelMesh};
