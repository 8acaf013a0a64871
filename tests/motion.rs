//! A drive taken through a path, with the errors it makes on the way.

use std::f64::consts::{PI, TAU};

use flexspline_sim::drive::{DamagedFlank, DamagedTooth, Drive, GeneratorKind, Harmonic, Wheel};
use flexspline_sim::mesh::MeshLevel;
use flexspline_sim::stepping::{Increment, Problem, Solver, SolverSettings, State};

/// Arc-seconds in a radian.
pub const ARCSEC: f64 = 180.0 * 3600.0 / PI;
/// Arc-minutes in a radian.
pub const ARCMIN: f64 = 180.0 * 60.0 / PI;

/// Default settings on a mesh.
pub fn on(mesh: MeshLevel) -> SolverSettings {
    SolverSettings { mesh, ..SolverSettings::default() }
}

/// HHD-95 with a generator at its reference temperature.
pub fn hhd_95(kind: GeneratorKind, mesh: MeshLevel) -> Problem {
    problem(&Drive::hhd_95(), kind, on(mesh))
}

/// A drive with a generator at its reference temperature.
pub fn problem(drive: &Drive, kind: GeneratorKind, settings: SolverSettings) -> Problem {
    Problem::new(drive, kind, drive.temperature.reference_c, settings).unwrap_or_else(|error| panic!("{kind}: {error}"))
}

/// HHD-95 with every imperfection there is, each of a few micrometres.
pub fn imperfect() -> Drive {
    let mut drive = Drive::hhd_95();
    let built = &mut drive.as_built;
    built.circular_spline_eccentricity_um = 2.0;
    built.circular_spline_eccentricity_phase_deg = 50.0;
    built.circular_spline_ovality_um = 2.0;
    built.circular_spline_ovality_phase_deg = 25.0;
    built.circular_spline_pitch_harmonics = vec![Harmonic { order: 3, amplitude_um: 1.5, phase_deg: 12.0 }];
    built.circular_spline_pitch_error_um = (0..190).map(|k| 0.5 * (1.9 * f64::from(k)).sin()).collect();
    built.circular_spline_offset_um = 2.0;
    built.circular_spline_offset_direction_deg = -70.0;
    built.flexspline_runout_um = 1.5;
    built.flexspline_runout_phase_deg = 100.0;
    built.flexspline_pitch_harmonics = vec![Harmonic { order: 2, amplitude_um: 2.0, phase_deg: 30.0 }];
    built.flexspline_pitch_error_um = (0..188).map(|k| 0.5 * (2.3 * f64::from(k)).cos()).collect();
    built.rim_thickness_harmonics = vec![Harmonic { order: 3, amplitude_um: 3.0, phase_deg: -40.0 }];
    built.generator_eccentricity_um = 3.0;
    built.generator_eccentricity_phase_deg = 20.0;
    built.generator_lobe_asymmetry_um = 2.0;
    built.cam_form_harmonics = vec![Harmonic { order: 5, amplitude_um: 1.0, phase_deg: 8.0 }];
    built.flexspline_wear_um = 1.0;
    built.circular_spline_wear_um = 1.5;
    built.damaged_teeth = vec![
        DamagedTooth { wheel: Wheel::Flexspline, tooth: 2, flank: DamagedFlank::Minus, depth_um: 2.0 },
        DamagedTooth { wheel: Wheel::CircularSpline, tooth: 187, flank: DamagedFlank::Both, depth_um: 2.0 },
    ];
    built.generator_warmer_k = 2.0;
    built.circular_spline_warmer_k = -3.0;
    drive
}

/// Mean of some numbers.
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value;
        count += 1.0;
    }
    sum / count
}

/// Largest minus least of some numbers.
pub fn range(values: impl IntoIterator<Item = f64> + Clone) -> f64 {
    values.clone().into_iter().fold(f64::NEG_INFINITY, f64::max) - values.into_iter().fold(f64::INFINITY, f64::min)
}

/// A converged increment and the transmission error at its end.
#[derive(Debug, Clone)]
pub struct Sample {
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Output angle minus generator angle over the ratio, arc-seconds.
    pub error_arcsec: f64,
    /// What the solver says of it.
    pub increment: Increment,
}

/// A drive on its way.
pub struct Run<'p> {
    /// The solver; its memory of the states it passed is that of this run alone.
    pub solver: Solver<'p>,
    /// Where the drive stands.
    pub state: State,
    problem: &'p Problem,
}

impl<'p> Run<'p> {
    /// The drive assembled with its generator at zero, and without load.
    pub fn new(problem: &'p Problem) -> Run<'p> {
        let mut solver = Solver::new(problem);
        let (state, _) = solver.deform(0.0).unwrap_or_else(|error| panic!("{}: {error}", problem.kind));
        Run { solver, state, problem }
    }

    /// The same with a load on the output.
    pub fn loaded(problem: &'p Problem, torque_n_m: f64) -> Run<'p> {
        let mut run = Run::new(problem);
        run.to(0.0, torque_n_m);
        run
    }

    /// A solver that remembers nothing goes on from here.
    pub fn forget(&mut self) {
        self.solver = Solver::new(self.problem);
    }

    /// One increment to a generator angle and a load.
    pub fn to(&mut self, generator_rad: f64, torque_n_m: f64) -> Sample {
        let (state, increment) = self
            .solver
            .increment(&self.state, generator_rad, torque_n_m)
            .unwrap_or_else(|error| panic!("{}: {error}", self.problem.kind));
        self.state = state;
        Sample { generator_rad, error_arcsec: self.error_arcsec(), increment }
    }

    /// Turns the generator by `turn_rad` in equal increments under the load there is.
    pub fn turn(&mut self, turn_rad: f64, increments: usize) -> Vec<Sample> {
        let start = self.state.generator_rad;
        (1..=increments)
            .map(|k| self.to(start + turn_rad * k as f64 / increments as f64, self.state.torque_n_m))
            .collect()
    }

    /// One flexspline pitch to settle in the sense of `sense` (+1 or -1), the next in equal increments reported.
    pub fn settled_pitch(&mut self, sense: f64, increments: usize) -> Vec<Sample> {
        let pitch = self.pitch();
        self.turn(sense * pitch, increments);
        self.turn(sense * pitch, increments)
    }

    /// Transmission error here, arc-seconds.
    pub fn error_arcsec(&self) -> f64 {
        (self.state.output_rad - self.state.generator_rad / self.problem.drive.ratio()) * ARCSEC
    }

    /// Pitch of the flexspline, rad: the period of a perfect drive.
    pub fn pitch(&self) -> f64 {
        TAU / f64::from(self.problem.drive.flexspline.teeth)
    }
}

/// Mean error of a stretch, arc-seconds.
pub fn mean_error(samples: &[Sample]) -> f64 {
    mean(samples.iter().map(|sample| sample.error_arcsec))
}

/// Mean generator torque of a stretch, N m.
pub fn mean_generator_torque(samples: &[Sample]) -> f64 {
    mean(samples.iter().map(|sample| sample.increment.generator_torque_n_m))
}

/// Mean Newton iterations of a stretch.
pub fn mean_iterations(samples: &[Sample]) -> f64 {
    mean(samples.iter().map(|sample| sample.increment.iterations as f64))
}
