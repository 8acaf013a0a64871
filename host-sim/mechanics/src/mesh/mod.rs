//! Meshes of the two wheels: one tooth sector, repeated exactly around the ring.

mod density;
mod sector;
mod wheel;

pub use density::{MeshDensity, MeshLevel};
pub use sector::{MeshError, Point};
pub use wheel::{Edge, FlankMesh, WheelKind, WheelMesh};

/// Rotates a vector by the angle of this sine and cosine.
#[inline]
pub fn rotate(p: Point, (sin, cos): (f64, f64)) -> Point {
    [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1]]
}
