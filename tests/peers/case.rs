//! One deck, run by CalculiX and by our solvers, and how far they are apart.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::process::Command;

use flexspline_export::STABILISING_TORSION;
use flexspline_mechanics::drive::{Drive, FewNumbers, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Method, Problem, SolverSettings};

use crate::dat::{at_step, tables};
use crate::ours::{Journey, Stop, displacement, journey, run_cpu_s, stress};
use crate::program::{Limits, Used, run};

/// Arc-seconds in a radian.
pub const ARCSEC: f64 = 180.0 * 3600.0 / PI;
/// A feature that a deck cannot express is taken out of the drive, for both programs: the drag of the output, and the
/// rounding of the tips, which our contact knows and the mesh does not (0.03 mm of it softens the load curve by 0.1″).
pub const AS_IN_THE_DECK: [&str; 3] =
    ["output.drag_torque_n_m=0", "flexspline.tip_rounding_mm=0.002", "circular_spline.tip_rounding_mm=0.002"];
/// The step of a deck that ends with the load on. One follows for each rotation increment, then one to the last load.
const LOAD_STEP: usize = 3;
/// Increments of the run in which our solvers are timed: 1 rad, a third of the protocol of the paper.
const RUN: usize = 100;
/// Times that our solvers go through the path.
const REPEAT: usize = 3;

/// Case to run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Case {
    /// Teeth of a drive from a few numbers; without them HHD-95.
    pub teeth: Option<u32>,
    /// The generator.
    pub generator: GeneratorKind,
    /// The mesh.
    pub mesh: MeshLevel,
    /// Load, N m.
    pub torque_n_m: f64,
    /// Load of the last step, N m.
    pub last_torque_n_m: f64,
    /// Rotation increments.
    pub increments: usize,
    /// Size of each, rad.
    pub step_rad: f64,
    /// Contact penalties on bore and flanks, N/mm³, the same in both programs.
    pub penalties: [f64; 2],
}

/// Results of CalculiX.
pub struct Peer {
    /// Output angle (rad) at the end of the load step, of each rotation step and of the last.
    pub output_rad: Vec<f64>,
    /// Iterations to each of these.
    pub iterations: Vec<usize>,
    /// Processor time of each of these, s.
    pub cpu_s: Vec<f64>,
    /// Of the whole run.
    pub used: Used,
    bore: Vec<Vec<Vec<f64>>>,
    stress: Vec<Vec<Vec<f64>>>,
}

/// One of our solvers beside it.
pub struct Comparison {
    /// Which.
    pub solver: Method,
    /// Largest difference of the output angle over all steps, arc-seconds.
    pub output_arcsec: f64,
    /// Largest difference of what the output turns in a rotation increment, arc-seconds.
    pub increment_arcsec: f64,
    /// Wind-up between the two loads: CalculiX's and ours, arc-seconds.
    pub wind_up_arcsec: [f64; 2],
    /// Largest difference of a displacement of the bore, µm, and the largest displacement.
    pub bore_um: [f64; 2],
    /// Difference of the von Mises stress at the integration points of the bore row: the largest, what 99 % keep to,
    /// the root mean square; and the largest stress, MPa.
    pub stress_mpa: [f64; 4],
    /// Processor time of ours in a rotation increment of a run, s.
    pub cpu_s: f64,
    /// The same in the increments that CalculiX went, the first after the load.
    pub first_cpu_s: f64,
    /// Memory of ours, MB.
    pub memory_mb: f64,
}

impl Comparison {
    /// Relative difference of the wind-up.
    pub fn wind_up(&self) -> f64 {
        let [peer, ours] = self.wind_up_arcsec;
        (peer / ours - 1.0).abs()
    }

    /// Difference of the stress away from single points, relative to the largest stress.
    pub fn stress(&self) -> f64 {
        self.stress_mpa[1] / self.stress_mpa[3]
    }
}

impl Case {
    /// A name for its folder and its lines.
    pub fn name(&self) -> String {
        let teeth = self.teeth.map_or(String::new(), |teeth| format!("{teeth}-teeth-"));
        format!("{teeth}{}-{}", self.generator, self.mesh)
    }

    /// The drive of both programs.
    fn drive(&self) -> Result<Drive, String> {
        let made = self.teeth.map_or(Ok(Drive::hhd_95()), |teeth| {
            // The module of HHD-95.
            let module_mm = Drive::hhd_95().flexspline.module_mm;
            let few = FewNumbers { teeth, module_mm, bore_mm: None, generator: self.generator };
            few.drive("SMALL").map(|made| made.drive)
        });
        made.and_then(|drive| drive.with_sets(AS_IN_THE_DECK)).map_err(|error| error.to_string())
    }

    /// Names drive, generator and mesh to the command.
    fn add_arguments(&self, command: &mut Command, folder: &Path) -> Result<(), String> {
        let file = folder.join("drive.toml");
        std::fs::write(&file, self.drive()?.to_toml()).map_err(|error| format!("{}: {error}", file.display()))?;
        command.arg("--drive").arg(file);
        command.args(["--generator", self.generator.name(), "--mesh", &self.mesh.to_string()]);
        Ok(())
    }

    /// The deck as the command writes it.
    pub fn export(&self, flexspline: &Path, folder: &Path) -> Result<PathBuf, String> {
        let numbers = [
            ("--torque-n-m", self.torque_n_m),
            ("--last-torque-n-m", self.last_torque_n_m),
            ("--step-rad", self.step_rad),
            ("--bore-penalty", self.penalties[0]),
            ("--flank-penalty", self.penalties[1]),
        ];
        let mut command = Command::new(flexspline);
        command.args(["export", "--format", "inp", "--quiet"]);
        std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        self.add_arguments(&mut command, folder)?;
        command.args(["--increments", &self.increments.to_string()]);
        for (option, value) in numbers {
            command.args([option, &value.to_string()]);
        }
        command.arg("--out").arg(folder);
        let limits = Limits { cpu_s: 60.0, memory_mb: 4000.0 };
        run(&mut command, &folder.join("export.log"), None, limits)?;
        let deck = folder.join(format!("{}.inp", self.generator));
        Ok(deck)
    }

    /// CalculiX on the deck.
    pub fn calculix(&self, ccx: &Path, deck: &Path, limits: Limits) -> Result<Peer, String> {
        let (folder, job) = (deck.parent().unwrap_or(Path::new(".")), deck.with_extension(""));
        let (dat, sta) = (deck.with_extension("dat"), deck.with_extension("sta"));
        for old in [&dat, &sta] {
            let _ = std::fs::remove_file(old);
        }
        let mut command = Command::new("nice");
        command.args(["-n", "15"]).arg(ccx).arg(job.file_name().ok_or("a deck has a name")?);
        command.current_dir(folder).env("OMP_NUM_THREADS", "1");
        let used = run(&mut command, &folder.join("ccx.log"), Some(&sta), limits)?;
        let read = |path: &Path| std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()));

        let stops = self.increments + 2;
        let mut peer = Peer {
            output_rad: Vec::new(),
            iterations: vec![0; stops],
            cpu_s: vec![0.0; stops],
            used,
            bore: Vec::new(),
            stress: Vec::new(),
        };
        // Two lines of heading; then step, increment, attempt, iterations.
        let mut before_s = peer.used.cpu_at_line_s.get(1).copied().unwrap_or(0.0);
        for (line, cpu_s) in read(&sta)?.lines().zip(&peer.used.cpu_at_line_s).skip(2) {
            let numbers: Vec<&str> = line.split_whitespace().collect();
            let number = |k: usize| numbers.get(k).and_then(|n| n.parse::<usize>().ok());
            let (Some(step), Some(iterations)) = (number(0), number(3)) else {
                return Err(format!("{}: found {line:?}, which is no increment", sta.display()));
            };
            if let Some(k) = step.checked_sub(LOAD_STEP).filter(|k| *k < stops) {
                peer.iterations[k] += iterations;
                peer.cpu_s[k] += cpu_s - before_s;
            }
            before_s = *cpu_s;
        }
        let tables = tables(&read(&dat)?).map_err(|error| format!("{}: {error}", dat.display()))?;
        for k in 0..stops {
            let step = LOAD_STEP + k;
            let rows = |set: &str| {
                let rows = at_step(&tables, set, step).filter(|rows| !rows.is_empty());
                rows.ok_or_else(|| format!("{}: no {set} at the end of step {step}", dat.display()))
            };
            peer.output_rad.push(rows("OUTPUT")?[0][1]);
            peer.bore.push(rows("BORE")?.to_vec());
            peer.stress.push(rows("BORE_ROW")?.to_vec());
        }
        Ok(peer)
    }

    /// Our model of the same drive.
    pub fn problem(&self, method: Method) -> Result<Problem, String> {
        let drive = self.drive()?;
        let [bore_penalty, flank_penalty] = self.penalties;
        let settings = SolverSettings {
            method,
            mesh: self.mesh,
            bore_penalty: Some(bore_penalty),
            flank_penalty,
            ..SolverSettings::default()
        };
        Problem::new(&drive, self.generator, drive.temperature.reference_c, settings).map_err(|error| error.to_string())
    }

    /// How far the output of our model would be from where it is if it had the penalties that it comes with,
    /// arc-seconds.
    pub fn penalty_arcsec(&self, problem: &Problem, peer: &Peer) -> Result<f64, String> {
        let settings = SolverSettings { mesh: self.mesh, ..SolverSettings::default() };
        let (drive, kind) = (&problem.drive, problem.kind);
        let own = Problem::new(drive, kind, drive.temperature.reference_c, settings).map_err(|e| e.to_string())?;
        let stops = self.stops(peer, drive.flexspline.width_mm);
        let [theirs, ours] = [problem, &own].map(|problem| journey(problem, &stops, 1));
        let pairs = theirs?.states.into_iter().zip(ours?.states);
        Ok(pairs.map(|(a, b)| (a.output_rad - b.output_rad).abs() * ARCSEC).fold(0.0, f64::max))
    }

    /// The stops of our path: the generator as in the deck, the load less what the deck's spring on the output takes.
    fn stops(&self, peer: &Peer, width_mm: f64) -> Vec<Stop> {
        let load = |k: usize| if k > self.increments { self.last_torque_n_m } else { self.torque_n_m };
        let angle = |k: usize| k.min(self.increments) as f64 * self.step_rad;
        let spring = |output_rad: f64| STABILISING_TORSION * output_rad * width_mm * 1e-3;
        peer.output_rad.iter().enumerate().map(|(k, output)| (angle(k), load(k) - spring(*output))).collect()
    }

    /// One of our solvers along the same path.
    pub fn compare(
        &self,
        problem: &Problem,
        peer: &Peer,
        flexspline: &Path,
        folder: &Path,
    ) -> Result<Comparison, String> {
        let solver = problem.settings.method;
        let stops = self.stops(peer, problem.drive.flexspline.width_mm);
        let Journey { states, cpu } = journey(problem, &stops, REPEAT)?;
        let turned: Vec<f64> = states.iter().map(|state| state.output_rad).collect();
        let largest = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
        let apart = |k: usize| (peer.output_rad[k] - turned[k]) * ARCSEC;
        let last = self.increments + 1;
        let wound = |angles: &[f64]| (angles[self.increments] - angles[last]) * ARCSEC;

        let mut bore_um = [0.0_f64; 2];
        let (mut most_mpa, mut apart_mpa) = (0.0_f64, Vec::new());
        for (k, state) in states.iter().enumerate() {
            for row in &peer.bore[k] {
                let ours = displacement(state, row[0] as usize - 1);
                bore_um[0] = bore_um[0].max(1e3 * (row[1] - ours[0]).hypot(row[2] - ours[1]));
                bore_um[1] = bore_um[1].max(1e3 * ours[0].hypot(ours[1]));
            }
            // The eight points of the brick that CalculiX makes of an element: the second four repeat the first.
            for row in peer.stress[k].iter().filter(|row| row[1] <= 4.0) {
                let ours = stress(problem, state, row[0] as usize - 1)[row[1] as usize - 1];
                let ours = problem.material.von_mises(ours);
                let theirs = problem.material.von_mises([row[2], row[3], row[5]]);
                apart_mpa.push((theirs - ours).abs());
                most_mpa = most_mpa.max(ours);
            }
        }
        apart_mpa.sort_by(f64::total_cmp);
        let quantile =
            |part: f64| apart_mpa.get((part * (apart_mpa.len() - 1) as f64) as usize).copied().unwrap_or(0.0);
        let rms = (apart_mpa.iter().map(|x| x * x).sum::<f64>() / apart_mpa.len().max(1) as f64).sqrt();
        let stress_mpa = [quantile(1.0), quantile(0.99), rms, most_mpa];
        let rotation = &cpu[1..=self.increments];
        Ok(Comparison {
            solver,
            output_arcsec: largest(&mut (0..=last).map(apart)),
            increment_arcsec: largest(&mut (1..=self.increments).map(|k| apart(k) - apart(k - 1))),
            wind_up_arcsec: [wound(&peer.output_rad), wound(&turned)],
            bore_um,
            stress_mpa,
            cpu_s: run_cpu_s(problem, stops[0], self.step_rad, RUN)?,
            first_cpu_s: rotation.iter().map(|cpu| cpu.as_secs_f64()).sum::<f64>() / rotation.len() as f64,
            memory_mb: self.memory(&stops, solver, flexspline, folder)?,
        })
    }

    /// Memory of the command that goes the same way.
    fn memory(&self, stops: &[Stop], solver: Method, flexspline: &Path, folder: &Path) -> Result<f64, String> {
        let path = folder.join("path.csv");
        let rows: String = stops.iter().map(|(angle, torque)| format!("{angle},{torque}\n")).collect();
        std::fs::write(&path, format!("generator_rad,torque_n_m\n{rows}")).map_err(|error| error.to_string())?;
        let mut command = Command::new(flexspline);
        command.args(["simulate", "--quiet", "--solver", &solver.to_string()]);
        self.add_arguments(&mut command, folder)?;
        for (option, value) in [("--bore-penalty", self.penalties[0]), ("--flank-penalty", self.penalties[1])] {
            command.args([option, &value.to_string()]);
        }
        command.arg("--path").arg(&path).arg("--out").arg(folder.join(solver.to_string()));
        let limits = Limits { cpu_s: 600.0, memory_mb: 8000.0 };
        Ok(run(&mut command, &folder.join(format!("{solver}.log")), None, limits)?.memory_mb)
    }
}
