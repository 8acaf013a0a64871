//! Tables against fresh FEM at points that made none of them, through the core code that firmware links.
//!
//! Torques, temperatures, directions and positions are drawn between the nodes; the drive is settled under each torque
//! and then followed over a few positions. A run at zero torque is also reversed, so that the play operator is seen
//! crossing the backlash.
//!
//! A drive that does not repeat from tooth to tooth is deformed anew for each torque, anywhere in the turns of
//! generator and output. Its table says how far it is from its own samples, for it has no room for all that such a
//! drive does: the bounds are wider by one and a half times that much.

use std::f64::consts::TAU;

use flexspline::{Direction, GeneratorAngle, PlayState, Quality, Table};
use serde::Serialize;
use thiserror::Error;

use super::complete::MissingSpring;
use super::project::core_kind;
use flexspline_base::robust::rms;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Problem, SolveError, SolverSettings};

/// Allowed deviation of a table from fresh FEM, arcsec: root mean square and largest.
pub const RMS_BOUND_ARCSEC: f64 = 0.5;
/// Largest difference, arcsec.
pub const MAX_BOUND_ARCSEC: f64 = 2.0;

/// How much more than a table states of itself at the places it was made of it may miss at a dozen others: the root
/// mean square of twelve differences scatters by a fifth.
const ELSEWHERE: f64 = 1.5;

/// How to validate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValidationSettings {
    /// Torques drawn.
    pub torques: usize,
    /// Temperatures drawn; the torques are shared among them.
    pub temperatures: usize,
    /// Positions at each torque.
    pub positions: usize,
    /// Seed of the draw.
    pub seed: u64,
    /// Numerical method of the fresh FEM.
    pub solver: SolverSettings,
    /// A data sheet's addition to the table: the FEM does not have it.
    pub spring: Option<MissingSpring>,
}

impl Default for ValidationSettings {
    fn default() -> Self {
        ValidationSettings {
            torques: 12,
            temperatures: 3,
            positions: 4,
            seed: 1,
            solver: SolverSettings::default(),
            spring: None,
        }
    }
}

/// One point.
#[derive(Debug, Clone, Serialize)]
pub struct Point {
    /// "steady" or "reversal".
    pub kind: &'static str,
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Torque, N m.
    pub torque_n_m: f64,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// +1 forward, −1 backward.
    pub direction: i8,
    /// Output error by FEM, arcsec.
    pub fem_arcsec: f64,
    /// Output error by the table, arcsec.
    pub table_arcsec: f64,
}

impl Point {
    fn difference(&self) -> f64 {
        self.table_arcsec - self.fem_arcsec
    }
}

/// How a table did.
#[derive(Debug, Clone, Serialize)]
pub struct Validation {
    /// Generator.
    pub generator: String,
    /// Table.
    pub table_id: String,
    /// "passed" or "bound missed".
    pub status: &'static str,
    /// Allowed deviation from fresh FEM, arcsec: root mean square. Of a drive that does not repeat from tooth to tooth
    /// `RMS_BOUND_ARCSEC` and one and a half times what the table states itself.
    pub rms_bound_arcsec: f64,
    /// Largest, arcsec; likewise.
    pub max_bound_arcsec: f64,
    /// Root mean square difference at all points, arcsec.
    pub rms_arcsec: f64,
    /// Largest difference, arcsec.
    pub max_arcsec: f64,
    /// Root mean square of the difference between table and FEM in the reversal alone, arcsec.
    pub reversal_rms_arcsec: f64,
    /// Largest difference in the reversal, arcsec.
    pub reversal_max_arcsec: f64,
    /// Root mean square error of the drive itself at these points: what is left without any table, arcsec.
    pub uncompensated_rms_arcsec: f64,
    /// Increments solved.
    pub increments: usize,
    /// The points.
    pub points: Vec<Point>,
}

/// Why a table could not be validated.
#[derive(Debug, Error)]
pub enum ValidateError {
    /// The FEM failed, or the drive did not settle.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// The table is of another drive.
    #[error(
        "the table is of a drive with BLAKE3 {found}, the drive given ({name}) has {given}; name the drive with \
         --drive and --set"
    )]
    OtherDrive {
        /// Hash in the table, hex.
        found: String,
        /// Name of the drive given.
        name: String,
        /// Its hash.
        given: String,
    },
    /// The generator is not one that is simulated.
    #[error("the table names no generator that can be simulated")]
    UnknownGenerator,
    /// The core gave no correction where it should.
    #[error("the table gives no correction at {torque_n_m} N·m and {temperature_c} °C")]
    Disabled {
        /// Torque, N m.
        torque_n_m: f64,
        /// Temperature, °C.
        temperature_c: f64,
    },
}

/// The generator that a table is of.
pub fn generator_of(table: &Table<'_>) -> Option<GeneratorKind> {
    GeneratorKind::ALL.into_iter().find(|kind| core_kind(*kind) == table.generator_kind())
}

/// The generator of a table, if the table is of this drive.
pub fn check_drive(drive: &Drive, table: &Table<'_>) -> Result<GeneratorKind, ValidateError> {
    let kind = generator_of(table).ok_or(ValidateError::UnknownGenerator)?;
    if table.drive_hash() != drive.hash() {
        return Err(ValidateError::OtherDrive {
            found: blake3::Hash::from(table.drive_hash()).to_hex().to_string(),
            name: drive.name.clone(),
            given: blake3::Hash::from(drive.hash()).to_hex().to_string(),
        });
    }
    Ok(kind)
}

/// Compares a table with fresh FEM. `observe` receives the increments done and about how many there will be.
pub fn validate(
    drive: &Drive,
    table: &Table<'_>,
    settings: &ValidationSettings,
    observe: &mut dyn FnMut(usize, usize),
) -> Result<Validation, ValidateError> {
    let kind = check_drive(drive, table)?;
    let repeats = drive.as_built.first_not_uniform().is_none();
    let whole_turns = TAU * drive.ratio().abs();
    let mut random = fastrand::Rng::with_seed(settings.seed);
    let draws = draw(&mut random, drive, table, settings);
    let total = settings.torques * (settings.positions + 3) + settings.temperatures + REVERSAL_STEPS + 6;
    let mut fresh =
        FreshRun { drive, table, spring: settings.spring, observe, increments: 0, total, points: Vec::new() };
    for (k, (temperature_c, torques)) in draws.iter().enumerate() {
        let problem = Problem::new(drive, kind, *temperature_c, settings.solver)?;
        let mut motion = Motion::deformed(&problem, random.f64() * if repeats { 1.0 } else { whole_turns })?;
        let unloaded = motion.state().clone();
        if k == 0 {
            fresh.reversal(&mut motion, *temperature_c)?;
        }
        // Either sign is a chain from light to heavy.
        for sign in [1.0, -1.0] {
            motion.go_back(unloaded.clone());
            let mut chain: Vec<f64> = torques.iter().copied().filter(|t| t * sign > 0.0).collect();
            chain.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
            for torque_n_m in chain {
                if !repeats {
                    motion.deform(whole_turns * random.f64())?;
                }
                fresh.steady(&mut motion, torque_n_m, *temperature_c, settings.positions, &mut random)?;
            }
        }
    }
    Ok(fresh.conclude(kind))
}

/// Torques to look at, by temperature: half of them spread evenly, half by orders of magnitude, either sign.
fn draw(
    random: &mut fastrand::Rng,
    drive: &Drive,
    table: &Table<'_>,
    settings: &ValidationSettings,
) -> Vec<(f64, Vec<f64>)> {
    let [lowest, highest] = table.torque_range_n_m().map(f64::from);
    let [coldest, warmest] = table.temperature_range_c().map(f64::from);
    let drag = drive.output.drag_torque_n_m;
    let mut draws: Vec<(f64, Vec<f64>)> =
        (0..settings.temperatures).map(|_| (coldest + (warmest - coldest) * random.f64(), Vec::new())).collect();
    for k in 0..settings.torques {
        let limit = if k % 2 == 0 { highest } else { lowest };
        let share = if k % 4 < 2 {
            random.f64()
        } else {
            let least = (2.0 * drag / limit.abs()).clamp(1e-6, 1.0);
            least.powf(random.f64())
        };
        let slot = k % settings.temperatures;
        draws[slot].1.push(limit * share.max(1e-3));
    }
    draws
}

/// Increments of the reversal.
const REVERSAL_STEPS: usize = 16;
/// Increments to a flexspline pitch while the drive settles.
const SETTLING_STEPS: f64 = 8.0;

struct FreshRun<'a> {
    drive: &'a Drive,
    table: &'a Table<'a>,
    spring: Option<MissingSpring>,
    observe: &'a mut dyn FnMut(usize, usize),
    increments: usize,
    total: usize,
    points: Vec<Point>,
}

impl FreshRun<'_> {
    fn report(&mut self) {
        self.increments += 1;
        (self.observe)(self.increments, self.total.max(self.increments));
    }

    /// Moves until the drive has settled.
    fn settle(&mut self, motion: &mut Motion<'_>, sign: f64) -> Result<(), ValidateError> {
        let step = sign * motion.pitch() / SETTLING_STEPS;
        while motion.settle_on(step)? {
            self.report();
        }
        Ok(())
    }

    fn steady(
        &mut self,
        motion: &mut Motion<'_>,
        torque_n_m: f64,
        temperature_c: f64,
        positions: usize,
        random: &mut fastrand::Rng,
    ) -> Result<(), ValidateError> {
        let sign = if random.bool() { 1.0 } else { -1.0 };
        motion.load(torque_n_m)?;
        self.report();
        self.settle(motion, sign)?;
        for _ in 0..positions {
            motion.turn(sign * motion.pitch() * (0.1 + 0.2 * random.f64()))?;
            self.report();
            let mut play = PlayState::after_motion(if sign > 0.0 { Direction::Forward } else { Direction::Backward });
            self.compare("steady", motion, temperature_c, sign, &mut play)?;
        }
        Ok(())
    }

    /// Unloaded, forward, then backward through the backlash and on.
    fn reversal(&mut self, motion: &mut Motion<'_>, temperature_c: f64) -> Result<(), ValidateError> {
        let [lowest, highest] = self.table.torque_range_n_m();
        if lowest > 0.0 || highest < 0.0 {
            return Ok(());
        }
        self.settle(motion, 1.0)?;
        let mut play = PlayState::after_motion(Direction::Forward);
        self.compare("reversal", motion, temperature_c, 1.0, &mut play)?;
        let steady = |direction| {
            self.table
                .steady_error_rad(GeneratorAngle::ZERO, 0.0, temperature_c as f32, direction)
                .map_or(0.0, f64::from)
        };
        let backlash = steady(Direction::Backward) - steady(Direction::Forward);
        let turn = -1.6 * backlash * self.drive.ratio() / REVERSAL_STEPS as f64;
        for _ in 0..REVERSAL_STEPS {
            motion.turn(turn)?;
            self.report();
            self.compare("reversal", motion, temperature_c, -1.0, &mut play)?;
        }
        Ok(())
    }

    fn compare(
        &mut self,
        kind: &'static str,
        motion: &Motion<'_>,
        temperature_c: f64,
        sign: f64,
        play: &mut PlayState,
    ) -> Result<(), ValidateError> {
        let state = motion.state();
        let disabled = ValidateError::Disabled { torque_n_m: state.torque_n_m, temperature_c };
        let Some(generator) = GeneratorAngle::from_rad(state.generator_rad) else { return Err(disabled) };
        let prediction = self.table.forward(play, generator, state.torque_n_m as f32, temperature_c as f32);
        if prediction.quality == Quality::Disabled {
            return Err(disabled);
        }
        let added_rad = self.spring.map_or(0.0, |spring| spring.torsion_rad(state.torque_n_m));
        self.points.push(Point {
            kind,
            generator_rad: state.generator_rad,
            torque_n_m: state.torque_n_m,
            temperature_c,
            direction: if sign > 0.0 { 1 } else { -1 },
            fem_arcsec: motion.error_arcsec() + added_rad * ARCSEC_PER_RAD,
            table_arcsec: f64::from(prediction.transmission_error_rad) * ARCSEC_PER_RAD,
        });
        Ok(())
    }

    fn conclude(self, kind: GeneratorKind) -> Validation {
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let all: Vec<f64> = self.points.iter().map(Point::difference).collect();
        let reversal: Vec<f64> = self.points.iter().filter(|p| p.kind == "reversal").map(Point::difference).collect();
        let bare: Vec<f64> = self.points.iter().map(|p| p.fem_arcsec).collect();
        let mut bounds = [RMS_BOUND_ARCSEC, MAX_BOUND_ARCSEC];
        if self.drive.as_built.first_not_uniform().is_some() {
            bounds[0] += ELSEWHERE * f64::from(self.table.projection_rms_rad()) * ARCSEC_PER_RAD;
            bounds[1] += ELSEWHERE * f64::from(self.table.projection_worst_rad()) * ARCSEC_PER_RAD;
        }
        let passed = rms(&all) <= bounds[0] && largest(&all) <= bounds[1];
        Validation {
            generator: kind.to_string(),
            table_id: self.table.id().to_string(),
            status: if passed { "passed" } else { "bound missed" },
            rms_bound_arcsec: bounds[0],
            max_bound_arcsec: bounds[1],
            rms_arcsec: rms(&all),
            max_arcsec: largest(&all),
            reversal_rms_arcsec: rms(&reversal),
            reversal_max_arcsec: largest(&reversal),
            uncompensated_rms_arcsec: rms(&bare),
            increments: self.increments,
            points: self.points,
        }
    }
}
