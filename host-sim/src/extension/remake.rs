//! A table by FEM, with the choices that the command `tables` makes if it is told nothing.

use std::time::Instant;

use thiserror::Error;

use crate::drive::{Drive, GeneratorKind};
use crate::stepping::SolverSettings;
use crate::tables::sweep::{Observer, SweepError, SweepPlan};
use crate::tables::torque_nodes::{NodeChoice, choose_torque_nodes};
use crate::tables::turns::{deviation_increments, sweep_turns};
use crate::tables::{MadeTable, TableError, from_sweep};
use crate::units::ARCSEC_PER_RAD;

/// Why no table was made.
#[derive(Debug, Error)]
pub enum RemakeError {
    /// The sweep ended early.
    #[error(transparent)]
    Sweep(#[from] SweepError),
    /// The samples make no table.
    #[error(transparent)]
    Table(#[from] TableError),
}

/// Torque nodes on each side at most, and the miss at which one is added, arcsec: those of `tables`, for a drive that repeats from tooth
/// to tooth and for one that does not.
const MOST_NODES: [usize; 2] = [28, 12];
const NODE_TOLERANCE_ARCSEC: [f64; 2] = [0.6, 2.0];

/// Increments that [`make_table`] usually takes, for a progress bar.
#[must_use]
pub fn usual_increments(drive: &Drive) -> usize {
    let turns = if drive.as_built.first_not_uniform().is_some() { deviation_increments() } else { 0 };
    turns + if drive.flanks.friction_coefficient > 0.0 { 800 } else { 170 }
}

/// Sweeps the drive and projects the samples.
///
/// # Errors
/// No convergence, or stopped by the observer.
pub fn make_table(
    drive: &Drive,
    kind: GeneratorKind,
    settings: SolverSettings,
    observe: &Observer<'_>,
) -> Result<MadeTable, RemakeError> {
    let clock = Instant::now();
    let mut plan = SweepPlan::for_generator(drive, kind);
    let turns = usize::from(drive.as_built.first_not_uniform().is_some());
    let choice = NodeChoice {
        largest_n_m: kind.rated_torque_n_m(),
        most: MOST_NODES[turns],
        tolerance_rad: NODE_TOLERANCE_ARCSEC[turns] / ARCSEC_PER_RAD,
    };
    let chosen = choose_torque_nodes(drive, kind, &plan, choice, settings, observe)?;
    plan.torque_nodes_n_m = chosen.torque_nodes_n_m;
    let mut swept = sweep_turns(drive, kind, &plan, &chosen.known, settings, observe)?;
    swept.increments += chosen.increments;
    swept.iterations += chosen.iterations;
    swept.worst_residual = swept.worst_residual.max(chosen.worst_residual);
    let mut made = from_sweep(drive, &plan, &swept, settings, clock.elapsed().as_secs_f64())?;
    made.info.torque_nodes_resolved = Some(chosen.resolved);
    Ok(made)
}
