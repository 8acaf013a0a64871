//! The plan of a campaign: everything that its drives are a function of.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::by_fem::{Conditions, wave};
use super::draw::{Drawn, MOST_DRIVES};
use super::model::{Model, Parabola, Response, SHEET, displaces};
use super::tolerance::{Tolerance, ToleranceActs, Tolerances};
use crate::data_sheet::{FIGURES, Loads, data_sheet};
use crate::kernels::{KernelError, KernelPlan, Kernels, make};
use flexspline_base::toml_file::{Problem, lines};
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Method, SolveError, SolverSettings};

/// Version of `plan.json`.
const SCHEMA: u32 = 1;
/// Shards, at most.
const MOST_SHARDS: u32 = 9999;
/// Where the parabola of what is alike everywhere is taken: the value that this share of the drives lies below, and its
/// mirror.
const OUTER_SHARE: f64 = 0.05;
/// Lost motion is told between this share of the rated load either way, as catalogues do, and at most half of the
/// campaign's load.
const LIGHT: [f64; 2] = [0.04, 0.5];
/// Positions over the tooth pitch of a data sheet.
const SHEET_POSITIONS: usize = 4;
/// Share of the drives whose displacements kernels must reach. Where teeth wedge further out, as they may at limits
/// that one drive in millions meets, kernels go on as they ended, and `reduce` counts the drives beyond.
const NEARLY_ALL: f64 = 0.99;
/// Displacement (µm for a millimetre of module) and directions of kernels that no tolerance asks for: the fewest there
/// may be.
const UNUSED: (f64, usize) = (20.0, 4);

/// What to plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlanSettings {
    /// Drives.
    pub drives: u32,
    /// Shards.
    pub shards: u32,
    /// Drives by FEM: the first.
    pub fem_drives: u32,
    /// Places over a turn of the output where they are computed.
    pub fem_places: u32,
    /// Mesh of all FEM.
    pub mesh: MeshLevel,
}

/// A plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Version of this file.
    pub schema_version: u32,
    /// Version of the program; another one makes other drives.
    pub tool_version: String,
    /// The drive as drawn, as a file.
    pub drive_toml: String,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Load, and the light load that lost motion is told at, N·m.
    pub torques_n_m: [f64; 2],
    /// Errors whose probability of being exceeded is told, arcsec.
    pub exceed_arcsec: Vec<f64>,
    /// The tolerances.
    pub tolerances: Vec<Tolerance>,
    /// Drives.
    pub drives: u32,
    /// Shards.
    pub shards: u32,
    /// Drives by FEM.
    pub fem_drives: u32,
    /// Places of each.
    pub fem_places: u32,
    /// Mesh of the FEM.
    pub mesh: String,
    /// What the FEM says of the drive as drawn, with each generator.
    pub generators: Vec<OfOne>,
    /// BLAKE3 of the text with nothing here: kernels belong to the drive, loads and tolerances beside them.
    pub blake3: String,
}

/// One generator of a plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OfOne {
    /// Kernels of what acts place by place.
    pub kernels: Kernels,
    /// What is alike everywhere.
    pub response: Response,
}

/// Why there is no plan.
#[derive(Debug, Error)]
pub enum PlanError {
    /// The file of tolerances: everything that is wrong with it.
    #[error("{}", lines(.0))]
    Tolerances(Vec<Problem>),
    /// The user has to change something.
    #[error("{0}")]
    BadInput(String),
    /// The FEM failed.
    #[error("{0}")]
    Failed(String),
}

/// Told how much is done, of how much.
pub type PlanProgress<'a> = dyn Fn(usize, usize, &str) + Sync + 'a;

/// Plans a campaign: kernels and responses by FEM.
///
/// # Errors
/// What is asked for is out of bounds, what a tolerance allows makes no drive, or the FEM finds no equilibrium.
pub fn plan(of: &Tolerances, settings: PlanSettings, progress: &PlanProgress<'_>) -> Result<Plan, PlanError> {
    let bounds = [
        ("--drives", settings.drives, 8, MOST_DRIVES),
        ("--shards", settings.shards, 1, MOST_SHARDS.min(settings.drives)),
        ("--fem", settings.fem_drives, 0, settings.drives),
        ("--fem-places", settings.fem_places, 5, 999),
    ];
    for (option, found, least, most) in bounds {
        if !(least..=most).contains(&found) {
            return Err(PlanError::BadInput(format!("{option}: found {found}, allowed: {least} to {most}")));
        }
    }
    let middle = Drawn::middle(&of.list);
    let drawn_as = with_alike(of, &middle)?;
    let rated = of.generators.iter().map(|kind| of.drive.rated_torque_n_m(*kind)).fold(f64::INFINITY, f64::min);
    let torques_n_m = [of.torque_n_m, (LIGHT[0] * rated).min(LIGHT[1] * of.torque_n_m)];
    let solver = SolverSettings { method: Method::Fast, mesh: settings.mesh, ..SolverSettings::default() };
    let kernel_plan = |kind| kernel_plan(of, kind, torques_n_m);
    let alike = of.list.iter().filter(|tolerance| tolerance.acts == ToleranceActs::Alike).count();
    let steps: usize = of.generators.iter().map(|kind| kernel_plan(*kind).steps() + 1 + 2 * alike).sum();
    let mut before = 0;
    let mut generators = Vec::new();
    for kind in &of.generators {
        let kernels = make(&drawn_as, *kind, &kernel_plan(*kind), solver, &|done| {
            progress(before + done, steps, &format!("kernels, {kind}"));
            ControlFlow::Continue(())
        })
        .map_err(|error| kernels_failed(of, *kind, &error))?;
        before += kernel_plan(*kind).steps();
        let at = Conditions { kind: *kind, temperature_c: of.temperature_c, torque_n_m: torques_n_m[0], solver };
        let response =
            response(of, &middle, at, torques_n_m, &|done| progress(before + done, steps, &format!("sheets, {kind}")))?;
        before += 1 + 2 * alike;
        generators.push(OfOne { kernels, response });
    }
    let mut plan = Plan {
        schema_version: SCHEMA,
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        drive_toml: of.drive.to_toml(),
        temperature_c: of.temperature_c,
        torques_n_m,
        exceed_arcsec: of.exceed_arcsec.clone(),
        tolerances: of.list.clone(),
        drives: settings.drives,
        shards: settings.shards,
        fem_drives: settings.fem_drives,
        fem_places: settings.fem_places,
        mesh: settings.mesh.to_string(),
        generators,
        blake3: String::new(),
    };
    plan.seal();
    Ok(plan)
}

/// The drive with the values of what is alike everywhere, and nothing else.
fn with_alike(of: &Tolerances, drawn: &Drawn) -> Result<Drive, PlanError> {
    let nothing = vec![0.0; of.list.len()];
    let sizes = of.list.iter().zip(&drawn.values).zip(&nothing);
    let values = sizes.map(|((t, value), none)| if t.acts == ToleranceActs::Alike { *value } else { *none }).collect();
    let alone = Drawn { values, teeth_um: vec![Vec::new(); of.list.len()], ..drawn.clone() };
    let mut drive = alone.drive(&of.drive, &of.list).map_err(|error| PlanError::BadInput(error.to_string()))?;
    drive.as_built = drive.as_built.uniform_part();
    Ok(drive)
}

/// Kernels at the loads of the campaign, and displacements as far as its tolerances go.
fn kernel_plan(of: &Tolerances, kind: GeneratorKind, [torque, light]: [f64; 2]) -> KernelPlan {
    let usual = KernelPlan::for_drive(&of.drive, kind);
    let reach: f64 = of.list.iter().filter(|t| displaces(t)).map(|t| t.distribution.limits[1]).sum();
    let (sizes_um, directions) = if reach > 0.0 {
        (usual.sizes_to(reach), usual.directions)
    } else {
        (vec![UNUSED.0 * of.drive.flexspline.module_mm], UNUSED.1)
    };
    let nearly_all = |t: &Tolerance| t.distribution.quantile(NEARLY_ALL);
    KernelPlan {
        torques_n_m: vec![light, torque],
        sizes_um,
        enough_um: Some(of.list.iter().filter(|t| displaces(t)).map(nearly_all).sum()),
        directions,
        temperature_c: Some(of.temperature_c),
        ..usual
    }
}

/// What is told of kernels that failed: the tolerances that ask for a displacement, and what to do about them.
fn kernels_failed(of: &Tolerances, kind: GeneratorKind, error: &KernelError) -> PlanError {
    let KernelError::Displaced { reached_um, .. } = error else {
        return PlanError::Failed(format!("{kind}: kernels of the drive as drawn: {error}"));
    };
    let told = |t: &Tolerance| {
        let most = t.distribution.quantile(NEARLY_ALL);
        format!("{} (99 of 100 drives up to {most:.1} um)", t.field)
    };
    let which: Vec<String> = of.list.iter().filter(|t| displaces(t)).map(told).collect();
    PlanError::Failed(format!(
        "{kind}: {}: {error}. The teeth wedge: give narrower limits (limits = [0, {reached_um:.3}] together), or the \
         drive more clearance (flanks.preload_um below 0), or a generator bearing that yields \
         (generator.bearing_stiffness_n_per_mm3)",
        which.join(" and ")
    ))
}

/// State of the middle drive, and a parabola for each tolerance of something alike everywhere.
fn response(
    of: &Tolerances,
    middle: &Drawn,
    at: Conditions,
    torques_n_m: [f64; 2],
    told: &(dyn Fn(usize) + Sync),
) -> Result<Response, PlanError> {
    let mut jobs: Vec<Option<(usize, f64)>> = vec![None];
    for (t, tolerance) in of.list.iter().enumerate().filter(|(_, tolerance)| tolerance.acts == ToleranceActs::Alike) {
        jobs.extend([OUTER_SHARE, 1.0 - OUTER_SHARE].map(|share| Some((t, tolerance.distribution.quantile(share)))));
    }
    let done = AtomicUsize::new(0);
    let states = jobs
        .par_iter()
        .with_max_len(1)
        .map(|job| {
            let mut drawn = middle.clone();
            if let Some((t, value)) = job {
                drawn.values[*t] = *value;
            }
            let drive = with_alike(of, &drawn)?;
            let state = state(&drive, at, torques_n_m).map_err(|error| {
                let which = job.map_or("the middle drive".to_owned(), |(t, v)| format!("{} = {v}", of.list[t].field));
                PlanError::Failed(format!("{}, {which}: {error}", at.kind))
            })?;
            told(done.fetch_add(1, Ordering::Relaxed) + 1);
            Ok(state)
        })
        .collect::<Result<Vec<Vec<f64>>, PlanError>>()?;
    let change = |k: usize| -> Vec<f64> { states[k].iter().zip(&states[0]).map(|(a, b)| a - b).collect() };
    let parabolas = jobs[1..]
        .chunks_exact(2)
        .enumerate()
        .filter_map(|(k, pair)| {
            let ((tolerance, low), (_, high)) = (pair[0]?, pair[1]?);
            let at = [low, middle.values[tolerance], high];
            Some(Parabola { tolerance, at, below: change(1 + 2 * k), above: change(2 + 2 * k) })
        })
        .collect();
    Ok(Response { middle: states[0].clone(), parabolas })
}

fn state(drive: &Drive, at: Conditions, torques_n_m: [f64; 2]) -> Result<Vec<f64>, SolveError> {
    let mut state = wave(drive, at)?;
    state.extend(wave(drive, Conditions { torque_n_m: torques_n_m[1], ..at })?);
    let loads = Loads::up_to(drive.rated_torque_n_m(at.kind));
    let (sheet, done) = data_sheet(drive, at.kind, at.temperature_c, loads, SHEET_POSITIONS, at.solver);
    done?;
    let figure = |name: &str| FIGURES.iter().find(|(known, _)| *known == name).and_then(|(_, of)| of(&sheet));
    state.extend(SHEET.iter().map(|name| figure(name).unwrap_or(f64::NAN)));
    Ok(state)
}

impl Plan {
    /// Where it stands in a campaign's folder.
    pub fn path(folder: &Path) -> PathBuf {
        folder.join("plan.json")
    }

    /// Its text, whose BLAKE3 is the hash of the plan.
    pub fn text(&self) -> String {
        let mut text = serde_json::to_string(self).expect("plain values");
        text.push('\n');
        text
    }

    /// Notes the checksum of the plan in it.
    pub(super) fn seal(&mut self) {
        self.blake3.clear();
        self.blake3 = blake3::hash(self.text().as_bytes()).to_hex().to_string();
    }

    /// Reads the plan of a folder, and its hash.
    ///
    /// # Errors
    /// There is none, it is not sound, or another version of the program made it.
    pub fn read(folder: &Path) -> Result<(Plan, [u8; 32]), PlanError> {
        let path = Plan::path(folder);
        let told = |what: String| PlanError::BadInput(format!("{}: {what}", path.display()));
        let text = fs::read_to_string(&path)
            .map_err(|error| told(format!("{error}; `flexspline campaign plan TOL.toml --out DIR` writes one")))?;
        let plan: Plan = serde_json::from_str(&text).map_err(|error| told(error.to_string()))?;
        if (plan.schema_version, plan.tool_version.as_str()) != (SCHEMA, env!("CARGO_PKG_VERSION")) {
            return Err(told(format!(
                "made by version {}, allowed: {}, which is running; plan anew",
                plan.tool_version,
                env!("CARGO_PKG_VERSION")
            )));
        }
        let unsealed = text.replacen(&format!("\"blake3\":\"{}\"", plan.blake3), "\"blake3\":\"\"", 1);
        if blake3::hash(unsealed.as_bytes()).to_hex().as_str() != plan.blake3 {
            let what = "changed after it was planned, so that its kernels may be those of another drive; plan anew";
            return Err(told(what.to_owned()));
        }
        for one in &plan.generators {
            one.kernels.check().map_err(|problem| told(problem.to_string()))?;
            if !one.response.fits(plan.tolerances.len()) {
                return Err(told("a response has not as many numbers as it should".to_owned()));
            }
        }
        plan.drive().map_err(|error| told(error.to_string()))?;
        let hash = *blake3::hash(text.as_bytes()).as_bytes();
        Ok((plan, hash))
    }

    /// The drive as drawn.
    ///
    /// # Errors
    /// Its text is no drive.
    pub fn drive(&self) -> Result<Drive, flexspline_mechanics::drive::DriveError> {
        Drive::from_toml("drive_toml", &self.drive_toml)
    }

    /// The model of each generator.
    pub fn models(&self) -> Vec<Model> {
        self.generators
            .iter()
            .map(|one| {
                let places = self.fem_places as usize;
                Model::new(&one.kernels, one.response.clone(), &self.tolerances, self.torques_n_m, places)
            })
            .collect()
    }

    /// How drives are computed by FEM.
    pub(crate) fn conditions(&self, generator: usize) -> Conditions {
        let mesh = self.mesh.parse().unwrap_or(MeshLevel::Coarse);
        Conditions {
            kind: self.generators[generator].kernels.generator,
            temperature_c: self.temperature_c,
            torque_n_m: self.torques_n_m[0],
            solver: SolverSettings { method: Method::Fast, mesh, ..SolverSettings::default() },
        }
    }

    /// The drives of a shard: every `shards`-th, so that those by FEM are spread.
    pub fn drives_of(&self, shard: u32) -> impl Iterator<Item = u32> {
        (shard..self.drives).step_by(self.shards as usize)
    }

    /// Teeth of flexspline and circular spline.
    pub fn teeth(&self) -> [u32; 2] {
        self.generators.first().map_or([0; 2], |one| one.kernels.teeth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Who is told that teeth wedge has to know which line of the file to change, and to what.
    #[test]
    fn kernels_that_fail_name_the_tolerance_and_how_far_it_may_go() {
        let text = "drive = \"HHD-95\"\ngenerator = \"cam\"\ntorque_n_m = 5\n[[tolerance]]\nfield = \
                    \"as_built.circular_spline_eccentricity_um\"\ndistribution = \"rayleigh\"\nstd = 5\n";
        let of = Tolerances::read("t.toml", text, |name| Drive::built_in(name).ok_or("no drive")).unwrap();
        let reason = SolveError::NotConverged {
            generator_rad: 0.0,
            torque_n_m: 0.0,
            reached_n_m: 0.0,
            softened_to: None,
            reason: "the iterations ran out",
            history: Vec::new(),
        };
        let error = KernelError::Displaced { size_um: 27.5, reached_um: 17.0, reason };
        let told = kernels_failed(&of, GeneratorKind::Cam, &error).to_string();
        for words in [
            "as_built.circular_spline_eccentricity_um (99 of 100 drives up to 15.2 um)",
            "limits = [0, 17",
            "27.5 um beside its axis",
        ] {
            assert!(told.contains(words), "{words}: {told}");
        }
    }
}
