//! A whole contact problem: a drive, its generator, loads, and the kinematic error over one tooth pitch under each.
//!
//! ```sh
//! cargo run --release --example contact
//! ```

use flexspline_sim::drive::{Drive, GeneratorKind};
use flexspline_sim::mesh::MeshLevel;
use flexspline_sim::motion::Motion;
use flexspline_sim::stepping::{Method, Problem, SolveError, SolverSettings};

fn main() -> Result<(), SolveError> {
    // The built-in drive; `Drive::from_toml` reads another, `with_set` changes a field.
    let drive = Drive::hhd_95();
    // Teeth condensed onto the nodes that touch something, on the mesh of the quick tests.
    let settings = SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() };
    // Meshes, outlines, contact and holding, at one temperature; immutable while it is solved.
    let problem = Problem::new(&drive, GeneratorKind::Cam, drive.temperature.reference_c, settings)?;
    // The cam deforms the flexspline: teeth mesh at both ends of the major axis, the output stands in the middle of its
    // clearance.
    let mut motion = Motion::deformed(&problem, 0.0)?;
    println!("torque N.m  generator rad  error\"  flanks in contact");
    for torque_n_m in [0.0, 10.0, 50.0] {
        motion.load(torque_n_m)?;
        // Forward until the drive has settled, then one flexspline pitch in eight increments.
        for place in motion.settled_pitch(1.0, 8)? {
            let flanks = place.increment.flank_contacts;
            println!("{torque_n_m:10}  {:13.5}  {:+6.2}  {flanks:17}", place.generator_rad, place.error_arcsec);
        }
    }
    Ok(())
}
