//! A table by FEM: torque nodes chosen, swept, projected. Whoever makes a table of a drive makes it here.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use thiserror::Error;

use super::complete::{CompletionError, KNEE_NODES, SheetStiffness};
use super::info::MadeTable;
use super::project::{TableError, empirical_percent, from_sweep};
use super::sweep::{Sampler, SweepPlan, SweepProgress, TorqueSweepError, planned_increments};
use super::torque_nodes::{NodeChoice, choose_torque_nodes};
use super::turns::{DEVIATION_INCREMENTS, sweep_turns};
use crate::cautions::{Caution, LookedAt, rigid_gap_um, room_as_built_arcsec};
use crate::data_sheet::{Stiffness, empirical_in_words};
use crate::relief::tips_that_bear;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::stepping::{Method, SolveError, SolverSettings};

/// How a table is made.
#[derive(Debug, Clone, PartialEq)]
pub struct TableSettings {
    /// How its torque nodes are chosen.
    pub torque_nodes: NodeChoice,
    /// Temperature nodes, ascending, °C.
    pub temperature_nodes_c: Vec<f32>,
    /// Samples over one tooth pitch.
    pub positions: usize,
    /// Numerical method of the FEM.
    pub solver: SolverSettings,
    /// A data sheet that completes the table.
    pub sheet: Option<SheetStiffness>,
}

/// Torque nodes on each side at most, and the miss (arcsec) at which one is added: for a drive that repeats from tooth
/// to tooth, and for one whose imperfections are sampled at every node and leave more than nodes do.
const CHOICES: [(usize, f64); 2] = [(28, 0.6), (12, 2.0)];
/// Torque nodes on each side that are the bound of what can be asked for: an axis has room for them, with the pair at
/// the drag torque and the end.
const MOST_NODES: usize = 30;
/// The largest torque must be this multiple of the drag of the output, or there is no wind-up to sample.
const LEAST_OVER_DRAG: f64 = 20.0;
/// Samples over one tooth pitch where nobody says how many. A guess.
const POSITIONS: usize = 8;
/// Largest torque, N m.
const MOST_TORQUE_N_M: f64 = 1e4;
/// Tolerances of the choice of nodes, arcsec.
const TOLERANCES_ARCSEC: [f64; 2] = [0.01, 60.0];

impl TableSettings {
    /// Default settings of a table: nodes as the FEM asks for them up to the generator's rated
    /// torque, the ends of the operating temperatures (wind-up is linear between them to 0.05″, as
    /// Young's modulus is), eight positions, the fast solver on the standard mesh.
    pub fn for_generator(drive: &Drive, kind: GeneratorKind) -> TableSettings {
        let (most, tolerance_arcsec) = CHOICES[usize::from(!repeats(drive))];
        let temperature = &drive.temperature;
        TableSettings {
            torque_nodes: NodeChoice { largest_n_m: drive.rated_torque_n_m(kind), most, tolerance_arcsec },
            temperature_nodes_c: [temperature.minimum_c, temperature.maximum_c].map(|t| t as f32).to_vec(),
            positions: POSITIONS,
            solver: SolverSettings { method: Method::Fast, ..SolverSettings::default() },
            sheet: None,
        }
    }

    /// Increments that a table will take, about, before its torque nodes are chosen: as many as with the most nodes.
    pub fn most_increments(&self, drive: &Drive) -> usize {
        let most = self.torque_nodes.most;
        // The middles of intervals are looked at too, about one for each node that is found.
        over_turns(drive) + planned_increments(drive, self, most, 0) + most
    }

    /// Refuses settings that make no table of this drive.
    ///
    /// # Errors
    /// The setting that is out of its range.
    pub fn check(&self, drive: &Drive) -> Result<(), MakeError> {
        let refuse = |setting, found: String, allowed: String| Err(MakeError::Setting { setting, found, allowed });
        let NodeChoice { largest_n_m, tolerance_arcsec, .. } = self.torque_nodes;
        let least = LEAST_OVER_DRAG * drive.output.drag_torque_n_m;
        if !(largest_n_m > least && largest_n_m <= MOST_TORQUE_N_M) {
            let allowed = format!(
                "more than {least} ({LEAST_OVER_DRAG} times the drag of the output), at most {MOST_TORQUE_N_M}"
            );
            return refuse("torque_n_m", largest_n_m.to_string(), allowed);
        }
        let [low, high] = TOLERANCES_ARCSEC;
        if !(low..=high).contains(&tolerance_arcsec) {
            return refuse("node_tolerance_arcsec", tolerance_arcsec.to_string(), format!("{low} to {high}"));
        }
        let range = &drive.temperature;
        let within = |t: &f32| (range.minimum_c as f32..=range.maximum_c as f32).contains(t);
        if let Some(wrong) = self.temperature_nodes_c.iter().find(|t| !within(t)) {
            let allowed = format!("{} to {} C, the operating range of the drive", range.minimum_c, range.maximum_c);
            return refuse("temperatures_c", wrong.to_string(), allowed);
        }
        if self.temperature_nodes_c.is_empty() {
            return refuse("temperatures_c", "none".to_owned(), "at least one".to_owned());
        }
        Ok(())
    }
}

/// Why no table was made.
#[derive(Debug, Error)]
pub enum MakeError {
    /// A setting is out of its range.
    #[error("{setting}: found {found}; allowed: {allowed}")]
    Setting {
        /// Which.
        setting: &'static str,
        /// Its value.
        found: String,
        /// Allowed values.
        allowed: String,
    },
    /// The sweep ended early.
    #[error(transparent)]
    Sweep(#[from] TorqueSweepError),
    /// The samples make no table.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The data sheet does not complete the table.
    #[error(transparent)]
    Sheet(#[from] CompletionError),
}

impl MakeError {
    /// Whether the input is to blame, not the run.
    pub fn is_bad_input(&self) -> bool {
        matches!(
            self,
            MakeError::Setting { .. }
                | MakeError::Sheet(_)
                | MakeError::Sweep(TorqueSweepError::Solve(SolveError::Drive(_) | SolveError::Mesh(_)))
        )
    }
}

/// How far a table is.
#[derive(Debug, Clone, Copy)]
pub struct TableProgress {
    /// Increments that it will take, about; before the torque nodes are chosen as many as with the most nodes.
    pub expected: usize,
    /// The last increment.
    pub last: SweepProgress,
}

/// Called after every increment, from any thread; may ask to stop.
pub type TableObserver<'a> = dyn Fn(TableProgress) -> ControlFlow<()> + Sync + 'a;

/// Makes the table of a drive with one generator by contact FEM.
///
/// # Errors
/// A setting out of range, a drive that is impossible, no convergence, or stopped by the observer.
pub fn make(
    drive: &Drive,
    kind: GeneratorKind,
    settings: &TableSettings,
    observe: &TableObserver<'_>,
) -> Result<MadeTable, MakeError> {
    settings.check(drive)?;
    let clock = Instant::now();
    let mut plan = SweepPlan {
        torque_nodes_n_m: Vec::new(),
        temperature_nodes_c: settings.temperature_nodes_c.clone(),
        positions: settings.positions,
    };
    let done = AtomicUsize::new(0);
    let mut choice = settings.torque_nodes;
    let expected = AtomicUsize::new(settings.most_increments(drive));
    let report = |last: SweepProgress| {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        let expected = expected.load(Ordering::Relaxed).max(done);
        observe(TableProgress { expected, last })
    };
    let repeating = Drive { as_built: drive.as_built.uniform_part(), ..drive.clone() };
    let first = plan.temperature_nodes_c[0];
    let sampler = Sampler::new(&repeating, kind, plan.positions, first, settings.solver, &report)?;
    if settings.sheet.is_some() {
        // An axis has room for the most that can be asked for, not for more.
        choice.most = choice.most.min(MOST_NODES - KNEE_NODES);
    }
    let chosen = choose_torque_nodes(&repeating, kind, &plan, choice, &sampler)?;
    let nodes = &chosen.torque_nodes_n_m;
    plan.torque_nodes_n_m = settings.sheet.as_ref().map_or(nodes.clone(), |sheet| sheet.with_knees(nodes));
    let left =
        over_turns(drive) + planned_increments(drive, settings, plan.torque_nodes_n_m.len() / 2, chosen.known.len());
    expected.store(done.load(Ordering::Relaxed) + left, Ordering::Relaxed);
    let largest_n_m = plan.torque_nodes_n_m.iter().copied().map(f64::from).fold(0.0, f64::max);
    // Tips are looked at on a core that the sweep leaves idle.
    let sweep = || sweep_turns(drive, kind, &plan, &chosen.known, &sampler, settings.solver, &report);
    let (swept, tips) = rayon::join(sweep, || tips_that_bear(drive, kind, largest_n_m, &mut None));
    let mut swept = swept?;
    swept.work.add(chosen.work);
    let peak_flank_pressure_mpa = swept.work.peak_flank_pressure_mpa;
    let wall_s = || clock.elapsed().as_secs_f64();
    let mut made = match &settings.sheet {
        None => from_sweep(drive, &plan, swept, settings.solver, wall_s(), "")?,
        Some(sheet) => {
            let fem = from_sweep(drive, &plan, swept.clone(), settings.solver, wall_s(), "")?;
            let table = flexspline::Table::check(&fem.image).map_err(|e| TableError::Project(e.into()))?;
            let completed = sheet.completes(drive, &table)?;
            swept.samples.iter_mut().for_each(|s| s.output_rad += completed.spring.torsion_rad(s.torque_n_m));
            let mut made = from_sweep(drive, &plan, swept, settings.solver, wall_s(), &sheet.mark())?;
            made.info.remarks.push(completed.in_words());
            made.info.completed = Some(completed);
            made
        }
    };
    made.info.torque_nodes_resolved = Some(chosen.resolved);
    let table = flexspline::Table::check(&made.image).map_err(|e| TableError::Project(e.into()))?;
    let [_, whole] = made.info.wind_up_arcsec;
    made.info.remarks.extend(empirical_percent(&table).map(|percent| empirical_in_words(whole, largest_n_m, percent)));
    let looked = LookedAt {
        rigid_gap_um: rigid_gap_um(drive, kind),
        room_as_built_arcsec: room_as_built_arcsec(drive, kind),
        peak_flank_pressure_mpa: Some(peak_flank_pressure_mpa),
        tip_contact: tips.ok().flatten(),
        slope_bound: Some(f64::from(made.info.slope_bound)),
        ..LookedAt::default()
    };
    made.info.cautions = Caution::of_stiffness(drive).into_iter().chain(looked.cautions()).collect();
    made.info.stiffness = Stiffness::of_table(drive, &table);
    Ok(made)
}

/// Increments that imperfections take.
fn over_turns(drive: &Drive) -> usize {
    if repeats(drive) { 0 } else { DEVIATION_INCREMENTS }
}

/// Whether one tooth pitch says all of a drive.
fn repeats(drive: &Drive) -> bool {
    drive.as_built.first_not_uniform().is_none()
}
