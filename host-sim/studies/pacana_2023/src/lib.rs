//! The paper's protocol beside the paper's results, claim by claim.
//!
//! Pacana et al. (Appl. Sci. 13, 2023) turned a plane model of a hermetic harmonic drive by +1 rad and −2 rad under
//! four wave generators. Here the same is done with the drive of this project, by contact FEM; each statement of the
//! paper gets the number that would bear it out, a criterion, and a verdict that follows from the two.
//!
//! 1. `runs`: the protocol, standard and with another mesh, increment and penalty;
//! 2. `metrics`: what a run comes to; `rank`: when one is more than another;
//! 3. `claims`: the statements, in the order of the paper; `claim`: how a verdict comes about; `paper`: its numbers;
//! 4. `experiments`: what would have to be changed to get the paper's 10′ to 21′.

#![forbid(unsafe_code)]

pub mod claim;
mod claims;
pub(crate) mod experiments;
pub(crate) mod metrics;
pub mod page;
pub(crate) mod paper;
pub(crate) mod rank;
pub(crate) mod runs;

use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;

use claim::{Claim, Verdict};
use claims::Evidence;
use experiments::Experiment;
use flexspline_design::simulate::SimulateError;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use rank::{Agreement, Measured, kendall_tau};
use runs::{ProtocolRun, RunRecord, Runs, Variant};

/// Version of the layout of `reproduce.json`.
pub(crate) const REPRODUCE_SCHEMA: u32 = 1;

/// How thorough.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReproduceSettings {
    /// Mesh of the standard runs.
    pub mesh: MeshLevel,
    /// Fewer variants and experiments.
    pub quick: bool,
}

impl ReproduceSettings {
    /// The other discretisations that give the spread.
    pub fn variants(&self) -> Vec<Variant> {
        if self.quick {
            return vec![Variant::Penalty(2.0)];
        }
        let meshes = [MeshLevel::Coarse, MeshLevel::Standard].into_iter().filter(|level| *level != self.mesh);
        meshes
            .map(Variant::Mesh)
            .chain([Variant::HalfIncrement, Variant::Penalty(2.0), Variant::Penalty(0.5)])
            .collect()
    }
}

/// A metric of the four generators with its spread, and how it ranks them.
#[derive(Debug, Clone, Serialize)]
pub struct Ranking {
    /// What is ranked.
    pub metric: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// By generator: value, spread, variants.
    pub measured: Vec<(&'static str, Measured)>,
    /// Against the paper's order of errors, of the generators that have a value.
    pub against_paper: Agreement,
}

/// All there is to say.
pub struct Reproduction {
    /// The drive.
    pub drive: Drive,
    /// What was asked for.
    pub settings: ReproduceSettings,
    /// The protocol runs.
    pub runs: Runs,
    /// Claims and verdicts.
    pub claims: Vec<Claim>,
    /// Metrics with their spread.
    pub rankings: Vec<Ranking>,
    /// Changes of the model and what they do.
    pub experiments: Vec<Experiment>,
    /// Runs of the drive itself that found no equilibrium, in words.
    pub not_converged: Vec<String>,
    /// Changed models that have none, in words: what comes of the change, and no failure. A changed model need not be
    /// one that stands.
    pub changes_without_equilibrium: Vec<String>,
    /// Time, s.
    pub wall_s: f64,
}

/// The content of `reproduce.json`.
#[derive(Serialize)]
pub struct PaperRecord<'a> {
    /// Layout of this object.
    pub schema_version: u32,
    /// Version of the program.
    pub tool_version: &'static str,
    /// The command line.
    pub command: &'a str,
    /// `converged`, or `not converged` when some run of the drive as it is found no equilibrium.
    pub status: &'static str,
    /// Name of the drive.
    pub drive: &'a str,
    /// BLAKE3 of its physics.
    pub drive_blake3: String,
    /// Mesh of the standard runs.
    pub mesh: String,
    /// Whether this is the quick form.
    pub quick: bool,
    /// How many claims have which verdict.
    pub counts: BTreeMap<&'static str, usize>,
    /// The claims.
    pub claims: &'a [Claim],
    /// Metrics with their spread.
    pub rankings: &'a [Ranking],
    /// Changes of the model and what they do.
    pub experiments: &'a [Experiment],
    /// The change that comes nearest to the paper's errors.
    pub nearest: Option<&'static str>,
    /// Every run of the protocol.
    pub runs: Vec<RunRecord>,
    /// Runs of the drive as it is that found no equilibrium.
    pub not_converged: &'a [String],
    /// Changed models that have no equilibrium: a result of the change.
    pub changes_without_equilibrium: &'a [String],
    /// Time, s.
    pub wall_s: f64,
}

/// Runs everything. `observe` may stop it.
pub fn reproduce(
    drive: &Drive,
    settings: ReproduceSettings,
    observe: &runs::Observe<'_>,
) -> Result<Reproduction, SimulateError> {
    let begun = Instant::now();
    // All runs at once: they share the cores, and progress counts them together.
    let mut jobs = runs::jobs(drive, settings.mesh, &settings.variants());
    let protocol = jobs.len();
    jobs.extend(experiments::jobs(drive, settings.quick));
    let mut results = runs::run_all(&jobs, observe)?;
    if let Some(refused) = results.iter().find_map(|r| r.as_ref().err().filter(|error| error.is_bad_input())) {
        return Err(refused.clone());
    }
    let tried = results.split_off(protocol);
    let runs = Runs(
        jobs.into_iter()
            .zip(results)
            .map(|(job, outcome)| ProtocolRun {
                kind: job.kind,
                torque_n_m: job.torque_n_m,
                variant: job.variant,
                outcome,
            })
            .collect(),
    );
    let experiments = experiments::conclude(tried, settings.quick);
    let claims = claims::all(&Evidence { drive, runs: &runs });
    let rankings = rankings(&runs);
    let mut not_converged: Vec<String> = runs
        .0
        .iter()
        .filter_map(|run| {
            let error = run.outcome.as_ref().err()?.to_string();
            Some(format!(
                "{}, {} N·m, {}: {}",
                run.kind.in_words(),
                run.torque_n_m,
                run.variant,
                without_history(&error)
            ))
        })
        .collect();
    let mut changes_without_equilibrium = Vec::new();
    for experiment in &experiments {
        let told = if experiment.is_unchanged { &mut not_converged } else { &mut changes_without_equilibrium };
        let failed = experiment.effects.iter().filter(|effect| effect.metrics.is_none());
        told.extend(failed.map(|e| format!("“{}”, {}: {}", experiment.name, e.generator, without_history(&e.status))));
    }
    Ok(Reproduction {
        drive: drive.clone(),
        settings,
        runs,
        claims,
        rankings,
        experiments,
        not_converged,
        changes_without_equilibrium,
        wall_s: begun.elapsed().as_secs_f64(),
    })
}

/// An error without the residuals of its iterations, which `reproduce.json` has.
fn without_history(error: &str) -> &str {
    error.split("; relative residual").next().unwrap_or(error)
}

fn rankings(runs: &Runs) -> Vec<Ranking> {
    type Metric = fn(&metrics::ProtocolMetrics) -> Option<f64>;
    let metrics: [(&'static str, &'static str, f64, Metric); 6] = [
        ("largest error, no load", "arcsec", 0.0, |m| Some(m.largest_out_arcsec.max(m.largest_back_arcsec))),
        ("backlash, no load", "arcsec", 0.0, |m| Some(2.0 * m.half_width_arcsec?)),
        ("dwell of the generator, no load", "rad", 0.0, |m| m.dwell_rad),
        ("ripple, no load", "arcsec", 0.0, |m| m.ripple_pp_arcsec),
        ("largest von Mises stress, no load", "MPa", 0.0, |m| Some(m.peak_mpa)),
        ("mean lag against 200 N·m", "arcsec", -paper::TORQUE_N_M, |m| Some(m.lag_forward_arcsec?.abs())),
    ];
    metrics
        .into_iter()
        .map(|(metric, unit, torque, of)| {
            let known: Vec<(GeneratorKind, u32, Measured)> = paper::ERROR_RANK
                .into_iter()
                .map(|(kind, rank)| (kind, rank, runs.measure(kind, torque, of)))
                .filter(|(_, _, measured)| measured.value.is_finite())
                .collect();
            let ranks: Vec<u32> = known.iter().map(|(_, rank, _)| *rank).collect();
            let ours: Vec<Measured> = known.iter().map(|(_, _, measured)| measured.clone()).collect();
            Ranking {
                metric,
                unit,
                against_paper: kendall_tau(&ranks, &ours),
                measured: known.into_iter().map(|(kind, _, measured)| (kind.name(), measured)).collect(),
            }
        })
        .collect()
}

impl Reproduction {
    /// How many claims have a verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.claims.iter().filter(|claim| claim.verdict == verdict).count()
    }

    /// The change of the model that comes nearest to the paper's errors.
    pub fn nearest(&self) -> Option<&Experiment> {
        experiments::nearest(&self.experiments)
    }

    /// What is written to `reproduce.json`.
    pub fn record<'a>(&'a self, command: &'a str) -> PaperRecord<'a> {
        PaperRecord {
            schema_version: REPRODUCE_SCHEMA,
            tool_version: env!("CARGO_PKG_VERSION"),
            command,
            status: if self.not_converged.is_empty() { "converged" } else { "not converged" },
            drive: &self.drive.name,
            drive_blake3: blake3::Hash::from(self.drive.hash()).to_hex().to_string(),
            mesh: self.settings.mesh.to_string(),
            quick: self.settings.quick,
            counts: Verdict::ALL.into_iter().map(|v| (v.name(), self.count(v))).collect(),
            claims: &self.claims,
            rankings: &self.rankings,
            experiments: &self.experiments,
            nearest: self.nearest().map(|e| e.id),
            runs: self.runs.0.iter().map(ProtocolRun::record).collect(),
            not_converged: &self.not_converged,
            changes_without_equilibrium: &self.changes_without_equilibrium,
            wall_s: self.wall_s,
        }
    }
}
