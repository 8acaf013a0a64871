//! The protocol of a paper and its results, claim by claim, against the contact FEM of this project.
//!
//! Pacana, Siwiec, Pacana et al., *Numerical Analysis of the Kinematic Accuracy of the Hermetic Harmonic Drive in Space
//! Vehicles*, Appl. Sci. 13 (2023), turned a plane model of a hermetic harmonic drive by +1 rad and −2 rad under four
//! wave generators. Here [`flexspline_design::simulate::Path::Paper`] does the same with another drive.
//!
//! 1. `runs`: the protocol, standard and with another mesh, increment and penalty, and the metrics of a run;
//! 2. [`claims`]: the statements of the paper, each with its numbers and bounds, from which the verdict follows;
//! 3. `page`: the table of the claims, and pictures of the errors.

#![forbid(unsafe_code)]

pub mod claims;
mod page;
mod runs;

use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;

use claims::{ClaimVerdict, JudgedClaim, judged};
use flexspline_design::simulate::SimulateError;
use flexspline_mechanics::drive::Drive;
use flexspline_mechanics::mesh::MeshLevel;
pub use page::page;
pub use runs::{Observe, PaperRun, RunMetrics};

/// Version of the layout of `reproduce.json`.
const REPRODUCE_SCHEMA: u32 = 2;

/// The content of `reproduce.json`, and the drive.
#[derive(Serialize)]
pub struct Reproduction {
    /// Layout of this object.
    pub schema_version: u32,
    /// Version of the program.
    pub tool_version: &'static str,
    /// The command line.
    pub command: String,
    /// `converged`, or `not converged` when a run of the unchanged drive found no equilibrium.
    pub status: &'static str,
    /// Name of the drive.
    pub drive: String,
    /// BLAKE3 of its physics.
    pub drive_blake3: String,
    /// Mesh of the standard runs.
    pub mesh: String,
    /// Whether one other discretisation was run instead of the others.
    pub quick: bool,
    /// Number of claims by verdict.
    pub counts: BTreeMap<&'static str, usize>,
    /// The claims.
    pub claims: Vec<JudgedClaim>,
    /// Every run of the protocol.
    pub runs: Vec<PaperRun>,
    /// Runs of the unchanged drive that found no equilibrium.
    pub not_converged: Vec<String>,
    /// Time, s.
    pub wall_s: f64,
}

/// Runs the protocol on `mesh` and judges the claims; `quick` runs fewer discretisations.
///
/// # Errors
/// The drive or the mesh is refused. A run without equilibrium is a part of the result.
pub fn reproduce(
    drive: &Drive,
    mesh: MeshLevel,
    quick: bool,
    command: &str,
    observe: &Observe<'_>,
) -> Result<Reproduction, SimulateError> {
    let begun = Instant::now();
    let runs = runs::run_all(drive, mesh, quick, observe)?;
    let claims = judged(drive, &runs);
    let count = |verdict| claims.iter().filter(|claim| claim.verdict == verdict).count();
    let counts = ClaimVerdict::ALL.map(|verdict| (verdict.into(), count(verdict))).into();
    // A changed model needs no equilibrium: its status says so.
    let failed = runs.iter().filter(|run| run.metrics.is_none() && run.variant != runs::ONE_POINT);
    let not_converged: Vec<String> = failed
        .map(|run| {
            let error = run.status.split("; relative residual").next().unwrap_or(&run.status);
            format!("{}, {} N·m, {}: {error}", run.generator.in_words(), run.torque_n_m, run.variant)
        })
        .collect();
    Ok(Reproduction {
        schema_version: REPRODUCE_SCHEMA,
        tool_version: env!("CARGO_PKG_VERSION"),
        command: command.to_owned(),
        status: if not_converged.is_empty() { "converged" } else { "not converged" },
        drive: drive.name.clone(),
        drive_blake3: blake3::Hash::from(drive.hash()).to_hex().to_string(),
        mesh: mesh.to_string(),
        quick,
        counts,
        claims,
        runs,
        not_converged,
        wall_s: begun.elapsed().as_secs_f64(),
    })
}
