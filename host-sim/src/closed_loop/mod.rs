//! The core in a closed loop with the simulated drive.
pub mod fem;
pub mod flight;
pub mod inertia;
pub mod map;
