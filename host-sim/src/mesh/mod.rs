//! Meshes of the two wheels: one tooth sector, repeated exactly around the ring.

mod density;
mod sector;
mod wheel;

pub use density::{MeshDensity, MeshLevel};
pub use sector::MeshError;
pub use wheel::{Edge, FlankMesh, WheelKind, WheelMesh};
