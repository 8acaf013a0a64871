//! A joint flown by every controller, each with its own motor, drive and load under one sky.

use core::f64::consts::TAU;
use std::panic::resume_unwind;
use std::thread::ScopedJoinHandle;

use flexspline::{
    ActivateError, Direction, Drive, Flags, GeneratorAngle, Images, Limits, OutputAngle, Quality, SettingError, Store,
    Table, TorqueReading, TorqueSettings,
};
use flexspline_make::ProjectError;

use super::friction::Friction;
use super::gear::{Gear, GearLine, SampledSpring, Spring};
use super::loops::{LoopTorquePath as Path, TwoMasses};
use super::noise::NoiseSource;
use super::on_board::{self, OnBoard, OnBoardOutput};
use super::plant::{JointPlant, PlantSettings};
use super::scenario::{Moment, Scenario, TableKnown, TorqueKnown};
pub use super::score::ARCSEC_PER_RAD;
use super::score::Score;
use super::servo::{Servo, ServoCommand};
use super::table::{Sampling, image};

mod one;

pub use one::{OneJoint, Ticked};

/// Controllers, in the order of the results.
pub const CONTROLLERS: [&str; 5] = ["none", "fourier", "fourier_by_direction", "compensated", "ideal"];
/// Joints that a flight has: those, and one on a drive without errors.
pub const JOINTS: usize = CONTROLLERS.len() + 1;
/// The core among them.
pub const COMPENSATED: usize = 3;

/// The ideal among them.
pub const IDEAL: usize = 4;

/// Time at the beginning that is not scored, s: all start at rest without knowing where in their play.
pub const START_UP_S: f64 = 2.0;
/// Limits of every correction, suited to the servo.
const RATE_RAD_S: f64 = 0.05;
const ACCELERATION_RAD_S2: f64 = 5.0;
/// Nearer targets keep the flank, rad: 0.5″.
const HOLD_RAD: f32 = 2.4e-6;
/// Drag that tables are made with, N·m: that of the drive as designed.
pub const TABLE_DRAG_N_M: f64 = 0.02;
/// Distance that the loop of a torque in the mesh keeps from +1, with a drive a fifth stiffer or softer than its table
/// says.
pub const DISTANCE: [f64; 2] = [0.5, 0.2];
/// Widest low-pass of a torque, Hz: a tenth of the sampling frequency of usual torque sensors (guess).
const WIDEST_HZ: f64 = 100.0;
/// Slope and curvature along the way are taken over this time, s.
const AHEAD_S: f32 = 4e-3;
/// A torque in the mesh that is less than this part of the drag does not change the flank: while flanks cross it passes
/// through zero. *Guess*.
const HELD_OF_DRAG: f64 = 0.2;
/// Nor does one for this long after it did, in time constants of the servo's position loop: the correction's own way
/// across the play has to die away. With none a load 0.1 N·m below the drag of four rollers changed the flank over and
/// over, 52″ for 32 without compensation; with ten 18.
const SETTLES: f64 = 10.0;
/// Range of the torque sensor: this multiple of the largest load that is to be expected, and these N·m for what inertia
/// and servo add. *Guess*.
const SENSOR_RANGE: [f64; 2] = [3.0, 10.0];
/// And no less than this multiple of the range of the table, so that no load in it is refused as a reading, and one
/// beyond is reported as such. *Guess*.
const SENSOR_BEYOND_TABLE: f64 = 1.5;
/// After a change of the target's rate the motor's current gives no torque for this time, s: friction builds up anew.
const SETTLES_S: f64 = 0.3;
/// A command that comes back by more than this has turned, rad: 0.5″.
const TURNED_RAD: f64 = HOLD_RAD as f64;
/// Part of the target's rate that a correction by the motor's current may have.
const SLOWER: f64 = 0.3;
/// For so long gravity pulls the same way more, s. *Guess*.
const TURNS_S: f64 = 1.0;
/// A bound is this many standard deviations: what is heard is not normal where the motor sticks and slips, and 2.5 hold
/// in 94.6 % of the ticks of the antenna with a cam, whose servo has a phase margin of 16° alone.
const SURE: f64 = 3.0;
/// Noise of the torque from the current, behind its low-pass, for its bound, N·m.
const CURRENT_SURE_N_M: f64 = 0.5;
/// Low-pass of the torque from the motor's current, Hz: the motor's own acceleration comes from two differences of
/// the encoder.
const CURRENT_HZ: f64 = 2.0;
/// Noise of the samples of a calibrated table, rad: a reading has 1″, and a hundred of them, a tenth of a second at 1
/// kHz, are averaged at each place. Of single readings the curve of the tooth pitch would be noise of some 0.5″, which
/// costs nothing in pointing and ripples by tens of ″/s.
const CALIBRATION_NOISE_RAD: f64 = 0.1 / ARCSEC_PER_RAD;
/// Share of the lines that an extended table knows.
const EXTENDED_SHARE: f64 = 0.95;

/// A drive as designed and as built.
#[derive(Clone, Debug, PartialEq)]
pub struct JointUnit {
    /// Tooth counts.
    pub drive: Drive,
    /// As designed.
    pub nominal: Gear,
    /// As built.
    pub built: Gear,
}

impl JointUnit {
    /// A unit of a drive whose nominal spring was sampled from a map: with the lines that wheels eccentric by 10 µm,
    /// pitch errors of 2 µm and an encoder eccentric by 2 µm make in HHD-95 (amplitudes by the closed forms of rigid
    /// wheels), 6 % stiffer, and with 2″ more clearance. None of it is in the nominal table.
    pub fn of_spring(drive: Drive, spring: SampledSpring) -> Self {
        let ratio = drive.exact_ratio();
        Self::of_gear(drive, Gear { ratio, lines: Vec::new(), spring: Spring::Sampled(Box::new(spring)) })
    }

    /// A unit of a drive as designed, with the same beside it: lines, stiffness and clearance.
    pub fn of_gear(drive: Drive, nominal: Gear) -> Self {
        let line = |[generator, output, arcsec, phase_rad]: [f64; 4]| {
            GearLine::of(&[generator, output, arcsec / ARCSEC_PER_RAD, phase_rad])
        };
        let beside = [
            [2.0, -2.0, 19.5, 0.9],
            [4.0, -4.0, 3.9, 2.0],
            [2.0, 0.0, 8.5, 0.3],
            [1.0, 0.0, 3.0, 1.7],
            [0.0, 1.0, 10.0, 0.5],
        ];
        let lines = nominal.lines.iter().copied().chain(beside.map(line)).collect();
        let spring = match &nominal.spring {
            Spring::Sampled(sampled) => Spring::Sampled(Box::new(sampled.as_built(1.06, 2.0 / ARCSEC_PER_RAD))),
            cubic @ Spring::Cubic { .. } => cubic.clone(),
        };
        let built = Gear { ratio: nominal.ratio, lines, spring };
        Self { drive, nominal, built }
    }

    /// Built without errors: no lines, no ripple of the tooth pitch. What ripples with it is encoder, servo, friction
    /// and wind.
    pub fn flawless(&self) -> Self {
        let spring = match &self.built.spring {
            Spring::Sampled(sampled) => Spring::Sampled(Box::new(sampled.without_ripple())),
            cubic @ Spring::Cubic { .. } => cubic.clone(),
        };
        Self { built: Gear { lines: Vec::new(), spring, ..self.built }, ..self.clone() }
    }

    /// Source of a table's samples.
    fn known(&self, table: TableKnown) -> Gear {
        match table {
            TableKnown::Nominal => self.nominal.clone(),
            TableKnown::Extended => {
                let shrunk = |line: &GearLine| GearLine { amplitude_rad: EXTENDED_SHARE * line.amplitude_rad, ..*line };
                Gear { lines: self.built.lines.iter().map(shrunk).collect(), ..self.nominal.clone() }
            }
            TableKnown::Calibrated => self.built.clone(),
        }
    }
}

/// Flight of one controller's joint.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flown {
    /// Output less target, arcsec.
    pub error: Score,
    /// Speed of the output less the target's, arcsec/s.
    pub ripple: Score,
    /// Torque in the mesh, N·m.
    pub mesh: Score,
    /// Ticks in which the motor gave all it has, the limiter held back, nothing was corrected.
    pub limits: [u32; 3],
    /// Every n ticks: time, error (arcsec), mesh torque (N·m).
    pub rows: Vec<[f64; 3]>,
    /// Errors of every tick, arcsec, for a spectrum.
    pub errors: Vec<f32>,
    /// Share of ticks in which the torque from the current lay within the bound that was stated with it.
    pub within_bound: f64,
    /// All bits of all errors.
    pub digest: u64,
}

/// A flight: the results by controller.
#[derive(Clone, Debug)]
pub struct Flight {
    /// By controller.
    pub flown: [Flown; CONTROLLERS.len()],
    /// No compensation, of a drive without errors: what of the velocity ripple is not the drive's.
    pub flawless: Flown,
    /// Whether the servo is stable with this load, and the compensated joint comes to rest after a knock as the one
    /// without compensation does.
    pub stable: bool,
    /// From what the torque was known: nothing, where no low-pass of the torque in the mesh keeps the margin.
    pub torque: TorqueKnown,
    /// Low-pass of the torque, Hz.
    pub bandwidth_hz: f64,
    /// Phase margin of the servo (degrees, at Hz) with the load, and its least distance from −1.
    pub phase_margin_deg: [f64; 2],
    /// See there.
    pub servo_distance: f64,
    /// Motor, load and what is between, as the servo's loop is judged by.
    pub joint: TwoMasses,
    /// Resonances with the motor held and free, Hz.
    pub resonances_hz: [f64; 2],
}

/// Parts that every lane has.
#[derive(Clone)]
struct LaneParts {
    scenario: Scenario,
    unit: JointUnit,
    /// Twice, as a joint has it.
    image: [Vec<u8>; 2],
    /// Largest torque of its table, N·m.
    table_n_m: f64,
    masses: TwoMasses,
    /// Stiffness under a tenth of the largest load.
    soft_n_m_per_rad: f64,
    /// From what the torque is known, as far as it may be used.
    torque: TorqueKnown,
    bandwidth_hz: f64,
}

impl LaneParts {
    fn images(&self) -> Images<'_> {
        let [image, twin] = &self.image;
        Images::new(image, twin)
    }

    fn on_board_settings(&self) -> on_board::OnBoardSettings {
        let scenario = &self.scenario;
        let tick_s = scenario.servo.tick_s as f32;
        // What the low-pass leaves of white noise.
        let turned = TAU * self.bandwidth_hz * scenario.servo.tick_s;
        let behind = (turned / (2.0 + turned)).sqrt();
        let on_load = matches!(self.torque, TorqueKnown::OnLoad | TorqueKnown::Not);
        let passing = if on_load { 0.0 } else { HELD_OF_DRAG * scenario.drag_n_m };
        on_board::OnBoardSettings {
            limits: Limits {
                tick_s,
                rate_rad_s: RATE_RAD_S as f32,
                acceleration_rad_s2: ACCELERATION_RAD_S2 as f32,
                generator_rate_rad_s: 600.0,
                debounce_ticks: 5,
                deadband_rad: HOLD_RAD,
            },
            torque: TorqueSettings {
                tick_s,
                bandwidth_hz: self.bandwidth_hz as f32,
                drag_n_m: scenario.drag_n_m as f32,
                table_drag_n_m: TABLE_DRAG_N_M as f32,
                hold_n_m: (3.0 * behind * scenario.torque_noise_n_m).max(passing) as f32,
                settle_s: (SETTLES / (TAU * scenario.servo.position_hz)) as f32,
                largest_n_m: (SENSOR_RANGE[0] * scenario.largest_n_m() + SENSOR_RANGE[1])
                    .max(SENSOR_BEYOND_TABLE * self.table_n_m) as f32,
            },
            expected_n_m: scenario.mean_n_m() as f32,
            ahead_s: AHEAD_S,
            temperature_c: scenario.temperature_c as f32,
        }
    }
}

/// Why a joint is not flown, or not to its end.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FlightError {
    /// The gear makes no table.
    #[error("no table: {0}")]
    Table(#[from] ProjectError),
    /// A setting of the core's joint.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The core does not take the table.
    #[error("the table cannot be flown: {0}")]
    Activate(#[from] ActivateError),
    /// The load is further from its target than any joint that is controlled.
    #[error("{controller}: the joint runs away at {time_s:.2} s")]
    RunsAway {
        /// Its controller, one of [`CONTROLLERS`] or "by_torque".
        controller: &'static str,
        /// Time since the start, s.
        time_s: f64,
    },
}

/// Flies a scenario, with the image of a table that was made before, or one made for it; `each_second` is called by
/// each controller's joint for each second that it flew.
///
/// # Errors
/// [`FlightError`].
pub fn fly_watched(
    scenario: &Scenario,
    unit: &JointUnit,
    image: Option<Vec<u8>>,
    each_second: &(dyn Fn() + Sync),
) -> Result<Flight, FlightError> {
    let made = made(scenario, unit, image)?;
    let flawless = LaneParts { unit: unit.flawless(), ..made.clone() };
    let (flown, flawless) = std::thread::scope(|threads| {
        let start = |made, kind| threads.spawn(move || lane(made, kind, each_second));
        let flying: [_; CONTROLLERS.len()] = core::array::from_fn(|kind| start(&made, kind));
        let flawless = start(&flawless, 0);
        let landed = |lane: ScopedJoinHandle<'_, _>| lane.join().unwrap_or_else(|panic| resume_unwind(panic));
        (flying.map(landed), landed(flawless))
    });
    let [none, fourier, by_direction, compensated, ideal] = flown;
    let margin = made.masses.servo(&scenario.servo);
    Ok(Flight {
        flown: [none?, fourier?, by_direction?, compensated?, ideal?],
        flawless: flawless?,
        stable: margin.stable && stable(&made)?,
        torque: made.torque,
        bandwidth_hz: made.bandwidth_hz,
        phase_margin_deg: made.masses.phase_margin_deg(&scenario.servo),
        servo_distance: if margin.stable { margin.distance } else { 0.0 },
        joint: made.masses,
        resonances_hz: [made.masses.locked_hz(), made.masses.free_hz()],
    })
}

/// Flies one controller alone.
///
/// # Errors
/// As [`fly_watched`].
pub fn fly_one(scenario: &Scenario, unit: &JointUnit, controller: usize) -> Result<Flown, FlightError> {
    lane(&made(scenario, unit, None)?, controller, &|| {})
}

/// The image of the table that a scenario's joint flies with; `id` makes its id of what is hashed for it.
///
/// # Errors
/// [`FlightError::Table`].
pub fn table_image(
    scenario: &Scenario,
    unit: &JointUnit,
    id: impl FnOnce(&[u8]) -> [u8; 8],
) -> Result<Vec<u8>, FlightError> {
    let largest_n_m = 1.5 * scenario.largest_n_m() + 1.0;
    let noise_rad = if scenario.table == TableKnown::Calibrated { CALIBRATION_NOISE_RAD } else { 0.0 };
    let sampling = Sampling { largest_n_m, drag_n_m: TABLE_DRAG_N_M, temperature_c: scenario.temperature_c, noise_rad };
    Ok(image(&unit.known(scenario.table), unit.drive, &sampling, id)?)
}

/// With the image of a table that was made before, or one made for the scenario.
fn made(scenario: &Scenario, unit: &JointUnit, image: Option<Vec<u8>>) -> Result<LaneParts, FlightError> {
    let image = image.map_or_else(|| table_image(scenario, unit, |_| [0; 8]), Ok)?;
    // The stiffest that the flight comes to: the loop of the mesh torque is judged by what the table says there.
    let stiffness = stiffness(&unit.nominal, scenario.largest_n_m());
    let masses = TwoMasses {
        motor_kg_m2: motor_kg_m2(scenario, unit),
        load_kg_m2: scenario.load_kg_m2,
        stiffness,
        damping_s: damping_s(scenario, unit),
        ratio: unit.nominal.ratio,
    };
    // At light load the drive is softer: the low-pass has to do for both.
    let soft = TwoMasses { stiffness: self::stiffness(&unit.nominal, 0.1 * scenario.largest_n_m()), ..masses };
    // No loop limits what is known on the load.
    let known_hz = scenario.best_low_pass_hz(WIDEST_HZ);
    let path = Path { gain: 1.0, bandwidth_hz: 0.0, late_s: 0.0, rate_fed_forward: false };
    let widest = |masses: &TwoMasses| masses.widest_hz(&scenario.servo, &path, DISTANCE, WIDEST_HZ);
    let both = widest(&masses).zip(widest(&soft)).map(|(a, b)| a.min(b));
    // Where no low-pass keeps the margin the torque in the mesh is not used.
    let (torque, bandwidth_hz) = match (scenario.torque, both) {
        (TorqueKnown::InMesh, Some(hz)) => (TorqueKnown::InMesh, hz.min(known_hz)),
        (TorqueKnown::Current, Some(hz)) => (TorqueKnown::Current, hz.min(CURRENT_HZ)),
        (TorqueKnown::OnLoad, _) => (TorqueKnown::OnLoad, known_hz),
        _ => (TorqueKnown::Not, known_hz),
    };
    Ok(LaneParts {
        scenario: scenario.clone(),
        unit: unit.clone(),
        table_n_m: Table::check(&image).map_or(0.0, |table| {
            let [least, most] = table.torque_range_n_m();
            f64::from(most.max(-least))
        }),
        image: [image.clone(), image],
        masses,
        soft_n_m_per_rad: soft.stiffness,
        torque,
        bandwidth_hz,
    })
}

/// Slope of the wind-up around a torque, N·m/rad.
fn stiffness(gear: &Gear, torque_n_m: f64) -> f64 {
    let at = |share: f64| gear.error_under_rad(0.0, share * torque_n_m.max(0.1), 1.0);
    0.4 * torque_n_m.max(0.1) / (at(1.2) - at(0.8))
}

fn motor_kg_m2(scenario: &Scenario, unit: &JointUnit) -> f64 {
    scenario.servo.inertia_kg_m2 * unit.nominal.ratio * unit.nominal.ratio
}

/// The damping's time from the part of critical damping at the stiffness of the largest load.
fn damping_s(scenario: &Scenario, unit: &JointUnit) -> f64 {
    let stiffness = stiffness(&unit.nominal, scenario.largest_n_m());
    let free = stiffness * (1.0 / motor_kg_m2(scenario, unit) + 1.0 / scenario.load_kg_m2);
    2.0 * scenario.damping / free.sqrt()
}

fn plant(made: &LaneParts) -> JointPlant {
    let LaneParts { scenario, unit, .. } = made;
    let settings = PlantSettings {
        motor_kg_m2: motor_kg_m2(scenario, unit),
        load_kg_m2: scenario.load_kg_m2,
        gear: unit.built.clone(),
        damping_s: damping_s(scenario, unit),
        friction: Friction::EROB80_100.times(scenario.friction),
        drag_n_m: scenario.drag_n_m,
        gravity: scenario.load.gravity,
    };
    JointPlant::new(settings, scenario.temperature_c)
}

/// Inputs of a controller in a tick.
struct TickInput {
    generator: GeneratorAngle,
    moment: Moment,
    direction: Direction,
    reading: TorqueReading,
    /// For the ideal alone: the torque in the mesh if the load were at rest, N·m.
    mesh_n_m: f64,
}

impl TickInput {
    fn on_board(&self, made: &LaneParts) -> on_board::OnBoardInput {
        let Moment { target_rad, rate_rad_s, acceleration_rad_s2, .. } = self.moment;
        on_board::OnBoardInput {
            generator: self.generator,
            target: OutputAngle::from_rad(target_rad).unwrap_or(OutputAngle::ZERO),
            motion: [rate_rad_s, acceleration_rad_s2].map(|value| value as f32),
            direction: self.direction,
            reading: self.reading,
            inertia_n_m: (made.scenario.load_kg_m2 * acceleration_rad_s2) as f32,
        }
    }
}

/// Ways to command the generator.
enum JointController {
    Uncompensated,
    Fourier(Box<Fourier>),
    Ideal(Box<Ideal>),
    Core(Box<Core>),
}

/// A command, its rate and acceleration, and what the limiter and the table could not do.
struct Commanded {
    command: GeneratorAngle,
    rate_rad_s: f64,
    acceleration_rad_s2: f64,
    held_back: bool,
    not_corrected: bool,
    /// How far the core trusts it; none of what commands without the core.
    quality: Option<Quality>,
}

/// Moves a correction within limits, as the core does.
#[derive(Default)]
struct CorrectionLimiter {
    at: f64,
    speed: f64,
}

impl CorrectionLimiter {
    fn go(&mut self, goal: f64, tick_s: f64) -> f64 {
        // As in whole ticks the core stops: with half of the acceleration.
        let step = ACCELERATION_RAD_S2 * tick_s;
        let lag = (goal - self.at) / tick_s;
        let (away, braking) = (lag.abs(), 0.5 * step);
        let ticks = libm::floor(0.5 * ((1.0 + 8.0 * away / braking).sqrt() - 1.0));
        let stoppable = (away + 0.5 * braking * ticks * (ticks + 1.0)) / (ticks + 1.0);
        let wanted = libm::copysign(stoppable, lag);
        self.speed = wanted.clamp(self.speed - step, self.speed + step).clamp(-RATE_RAD_S, RATE_RAD_S);
        self.at += self.speed * tick_s;
        self.at
    }
}

/// Points of a curve over a tooth pitch.
const CURVE: usize = 64;

/// The unit's own error over the angles, recorded at the mean load: what a motion controller's error map holds.
struct Fourier {
    lines: Gear,
    teeth: f64,
    /// Forward and backward, or their mean twice.
    curves: [[f64; CURVE]; 2],
    limiter: CorrectionLimiter,
}

impl Fourier {
    fn new(made: &LaneParts, by_direction: bool) -> Self {
        let LaneParts { scenario, unit, .. } = made;
        let plain = Gear { lines: Vec::new(), ..unit.built.clone() };
        let teeth = f64::from(unit.drive.ripple_order());
        let mut curves = [1.0, -1.0].map(|way| {
            let mesh = scenario.mean_n_m() - way * scenario.drag_n_m;
            let at = |k: usize| plain.error_under_rad(TAU / teeth * k as f64 / CURVE as f64, mesh, -way);
            core::array::from_fn(at)
        });
        if !by_direction {
            let [forward, backward] = curves;
            let mean: [f64; CURVE] = core::array::from_fn(|k| 0.5 * (forward[k] + backward[k]));
            curves = [mean; 2];
        }
        Self { lines: unit.built.clone(), teeth, curves, limiter: CorrectionLimiter::default() }
    }

    fn error(&self, output_rad: f64, direction: Direction) -> f64 {
        let curve = &self.curves[usize::from(direction == Direction::Backward)];
        let mut error = 0.0;
        for _ in 0..2 {
            let generator = (output_rad - error) * self.lines.ratio;
            let place = libm::fmod(generator * self.teeth / TAU, 1.0);
            let place = (place - libm::floor(place)) * CURVE as f64;
            let (first, share) = (place as usize % CURVE, place - libm::floor(place));
            let ripple = curve[first] + share * (curve[(first + 1) % CURVE] - curve[first]);
            error = ripple + self.lines.error(generator, output_rad)[0];
        }
        error
    }
}

/// The unit itself, and the true torque: no table can do better, but for what the joint's motion adds.
struct Ideal {
    gear: Gear,
    limiter: CorrectionLimiter,
}

/// The core.
struct Core {
    on_board: OnBoard,
    store: Store,
    /// Of the last tick.
    last: Option<(on_board::OnBoardInput, OnBoardOutput)>,
}

impl JointController {
    fn new(made: &LaneParts, kind: usize) -> Result<Self, FlightError> {
        let LaneParts { scenario, unit, .. } = made;
        Ok(match kind {
            0 => Self::Uncompensated,
            1 | 2 => Self::Fourier(Box::new(Fourier::new(made, kind == 2))),
            COMPENSATED => {
                let on_board = OnBoard::new(unit.drive, &made.on_board_settings())?;
                let mut store = Store::new();
                store.activate(&made.images(), &unit.drive, scenario.temperature_c as f32)?;
                Self::Core(Box::new(Core { on_board, store, last: None }))
            }
            _ => Self::Ideal(Box::new(Ideal { gear: unit.built.clone(), limiter: CorrectionLimiter::default() })),
        })
    }

    fn tick(&mut self, made: &LaneParts, input: &TickInput) -> Commanded {
        let Moment { target_rad, rate_rad_s, acceleration_rad_s2, .. } = input.moment;
        let (ratio, tick_s) = (made.unit.nominal.ratio, made.scenario.servo.tick_s);
        // A correction, and what it does along the way of the target.
        let corrected = |[before, goal, after]: [f64; 3], limiter: &mut CorrectionLimiter| {
            let correction = limiter.go(goal, tick_s);
            let command = GeneratorAngle::from_rad((target_rad - correction) * ratio).unwrap_or(GeneratorAngle::ZERO);
            let ahead = f64::from(AHEAD_S);
            let (slope, bent) = ((after - before) / ahead, 4.0 * (after - 2.0 * goal + before) / (ahead * ahead));
            let along = if rate_rad_s == 0.0 { 0.0 } else { slope / rate_rad_s };
            let slowly = on_board::passes_slowly(&made.unit.drive, rate_rad_s as f32, tick_s as f32);
            let bent = if slowly { bent } else { 0.0 };
            Commanded {
                command,
                rate_rad_s: (rate_rad_s - slope) * ratio,
                acceleration_rad_s2: (acceleration_rad_s2 * (1.0 - along) - bent) * ratio,
                held_back: (goal - correction).abs() > 5e-7,
                not_corrected: false,
                quality: None,
            }
        };
        let times = [-0.5, 0.0, 0.5].map(|part| part * f64::from(AHEAD_S));
        match self {
            Self::Uncompensated => corrected([0.0; 3], &mut CorrectionLimiter::default()),
            Self::Fourier(fourier) => {
                let at = |time: f64| fourier.error(target_rad + rate_rad_s * time, input.direction);
                corrected(times.map(at), &mut fourier.limiter)
            }
            Self::Ideal(ideal) => {
                let way = if input.direction == Direction::Forward { -1.0 } else { 1.0 };
                let at = |time: f64| {
                    let target = target_rad + rate_rad_s * time;
                    let mut error = 0.0;
                    for _ in 0..2 {
                        error = ideal.gear.error_under_rad((target - error) * ratio, input.mesh_n_m, way);
                    }
                    error
                };
                corrected(times.map(at), &mut ideal.limiter)
            }
            Self::Core(core) => core.tick(made, input),
        }
    }
}

impl Core {
    fn tick(&mut self, made: &LaneParts, input: &TickInput) -> Commanded {
        let Moment { rate_rad_s, acceleration_rad_s2, .. } = input.moment;
        let board = input.on_board(made);
        let given = self.on_board.tick(&made.images(), &mut self.store, &board);
        self.last = Some((board, given));
        let OnBoardOutput { out, ahead, .. } = given;
        // Without a table as the ratio has it.
        let [rate, acceleration] = if ahead[0].is_nan() {
            [rate_rad_s, acceleration_rad_s2].map(|value| value * made.unit.nominal.ratio)
        } else {
            ahead.map(f64::from)
        };
        Commanded {
            command: out.command,
            rate_rad_s: rate,
            acceleration_rad_s2: acceleration,
            held_back: out.flags.contains(Flags::HELD_BACK),
            not_corrected: out.flags.contains(Flags::NOT_CORRECTED),
            quality: Some(out.quality),
        }
    }
}

/// The torque as the joint knows it in a tick.
struct Sensing {
    noise: NoiseSource,
    before_rad_s: f64,
    friction: Friction,
    even_s: f64,
    /// Torque on the load and friction beyond what is known, from the motor's current, N·m.
    likely_n_m: [f64; 2],
    /// Their variances, and between them what they share, N²·m².
    spread: [f64; 3],
    /// Torque on the load that is believed by now, N·m.
    told_n_m: f64,
    /// The drag, with the sign of the last motion, N·m.
    drag_n_m: f64,
    /// It lies within ± this of the true one.
    bound_n_m: f64,
    /// Torque known on the load behind its low-pass, for the servo, N·m; NaN before the first.
    fed_n_m: f64,
    /// The way in which the motor was last commanded: 1, −1, or 0 before it was.
    way: f64,
    /// Whether the target stood in the tick before: 1 or 0.
    stood: f64,
    /// Distance commanded that way, rad at the output.
    furthest_rad: f64,
}

impl Sensing {
    fn new(scenario: &Scenario) -> Self {
        let friction = known_friction(scenario, scenario.temperature_c);
        let unknown = (1.0 - scenario.friction_known) * friction.level_n_m(0.0, 0.0);
        Self {
            noise: NoiseSource::new(scenario.seed ^ 0x9b1d),
            before_rad_s: 0.0,
            friction,
            even_s: 0.0,
            likely_n_m: [scenario.mean_n_m(), 0.0],
            spread: [scenario.load_wanders().1, 0.0, unknown * unknown],
            told_n_m: scenario.mean_n_m(),
            drag_n_m: scenario.drag_n_m,
            bound_n_m: f64::INFINITY,
            fed_n_m: f64::NAN,
            way: 0.0,
            stood: 1.0,
            furthest_rad: 0.0,
        }
    }

    fn read(&mut self, made: &LaneParts, plant: &JointPlant, servo: &mut Servo, now: &Moment) -> TorqueReading {
        let scenario = &made.scenario;
        let noise = scenario.torque_noise_n_m * self.noise.normal();
        if scenario.warming_k_s != 0.0 {
            self.friction = known_friction(scenario, scenario.temperature_at_c(now.time_s));
        }
        match made.torque {
            TorqueKnown::OnLoad => {
                let known = on_load_n_m(scenario, now) + noise;
                let turned = TAU * made.bandwidth_hz * scenario.servo.tick_s;
                let share = if self.fed_n_m.is_finite() { turned / (1.0 + turned) } else { 1.0 };
                let before = if self.fed_n_m.is_finite() { self.fed_n_m } else { 0.0 };
                self.fed_n_m = before + share * (known - before);
                TorqueReading::OnLoad(known as f32)
            }
            TorqueKnown::Not => TorqueReading::OnLoad(scenario.mean_n_m() as f32),
            TorqueKnown::InMesh => TorqueReading::InMesh((plant.mesh_n_m() + noise) as f32),
            TorqueKnown::Current => {
                self.by_current(made, servo, now);
                TorqueReading::InMesh((self.told_n_m - self.drag_n_m) as f32)
            }
        }
    }

    /// Torque on the load, and what of the friction is not known, by the motor's current; kept as a torque on the load,
    /// as that does not change at a reversal, and the one in the mesh does by twice the drag.
    fn by_current(&mut self, made: &LaneParts, servo: &mut Servo, now: &Moment) {
        let scenario = &made.scenario;
        let tick_s = scenario.servo.tick_s;
        let rate = servo.rate_rad_s();
        let before = core::mem::replace(&mut self.before_rad_s, rate);
        let even = now.rate_rad_s != 0.0 && now.acceleration_rad_s2 == 0.0;
        self.even_s = if even { self.even_s + tick_s } else { 0.0 };
        if now.rate_rad_s != 0.0 {
            self.drag_n_m = libm::copysign(scenario.drag_n_m, now.rate_rad_s);
        }
        let (wanders, most) = scenario.load_wanders();
        let [load, ..] = &mut self.spread;
        let [weight, _] = scenario.load.gravity;
        let turned = weight * now.rate_rad_s;
        *load = (*load + tick_s * (wanders + turned * turned * TURNS_S)).min(most);
        let pulls_n_m = self.drag_n_m - servo.current_n_m();
        // The encoder shows which way the motor slides, and whether it does.
        if rate * before > 0.0 && self.even_s >= SETTLES_S {
            self.heard_sliding(made, rate, pulls_n_m + made.masses.motor_kg_m2 * (rate - before) / tick_s);
        } else if rate == 0.0 && before == 0.0 {
            self.heard_stuck(pulls_n_m);
        }
        // The friction has the sign of the target's rate only as long as the correction is slower than that.
        let [likely, _] = self.likely_n_m;
        let most = SLOWER * now.rate_rad_s.abs() * tick_s * made.soft_n_m_per_rad;
        self.told_n_m += (likely - self.told_n_m).clamp(-most, most);
        // At rest the drag may have either sign.
        let unknown = if now.rate_rad_s == 0.0 { 2.0 * scenario.drag_n_m } else { 0.0 };
        let turning = scenario.load_kg_m2 * now.acceleration_rad_s2.abs();
        let [load, ..] = self.spread;
        let held_back = (likely - self.told_n_m).abs();
        // What of the friction grows with the load and is not known moves with it, and no reversal separates the two.
        let [_, by_load] = self.friction.parts(now.rate_rad_s);
        let rubs = (1.0 - scenario.friction_known) * by_load * likely.abs();
        self.bound_n_m = SURE * load.sqrt() + unknown + turning + held_back + rubs + CURRENT_SURE_N_M;
    }

    /// A motor that slides at a rate: what pulls at it less the friction, by a Kalman filter. The friction turns over
    /// where the motor turns back, and the load does not, so that one motion to and fro separates them.
    fn heard_sliding(&mut self, made: &LaneParts, rate_rad_s: f64, pulls_n_m: f64) {
        let scenario = &made.scenario;
        let way = libm::copysign(1.0, rate_rad_s);
        let heard = pulls_n_m + scenario.friction_known * self.rubbing_n_m(rate_rad_s, self.told_n_m - self.drag_n_m);
        let share = 1.0 - libm::exp(-TAU * made.bandwidth_hz * scenario.servo.tick_s);
        let [load, shared, friction] = &mut self.spread;
        // What is heard is load less friction by the way, with noise that this low-pass makes as small as stated.
        let along = [*load - way * *shared, *shared - way * *friction];
        let all = along[0] - way * along[1] + CURRENT_SURE_N_M * CURRENT_SURE_N_M / share;
        let gain = along.map(|part| part / all);
        let [likely, more] = &mut self.likely_n_m;
        let missed = heard - (*likely - way * *more);
        *likely += gain[0] * missed;
        *more += gain[1] * missed;
        *load -= gain[0] * along[0];
        *shared -= gain[0] * along[1];
        *friction -= gain[1] * along[1];
    }

    /// A motor that sticks: its friction takes up whatever it can, either way, so the load is no further from what
    /// pulls than that. However long it sticks, no more is known.
    fn heard_stuck(&mut self, pulls_n_m: f64) {
        let level = self.friction.level_n_m(0.0, pulls_n_m.abs() + self.friction.level_n_m(0.0, pulls_n_m));
        let [likely, _] = &mut self.likely_n_m;
        *likely = likely.clamp(pulls_n_m - level, pulls_n_m + level);
        // So that the bound reaches to the further end.
        let furthest = (level + (*likely - pulls_n_m).abs()) / SURE;
        let [load, shared, _] = &mut self.spread;
        let less = (furthest * furthest / *load).min(1.0);
        *load *= less;
        *shared *= less.sqrt();
    }

    /// Part of the load that the motor has to hold, N·m at the output: of a torque known on the load, less the drag of
    /// the last motion. Its inertia is fed forward as the target's acceleration.
    fn held_n_m(&self, scenario: &Scenario, way: f64) -> f64 {
        if self.fed_n_m.is_finite() { self.fed_n_m - way * scenario.drag_n_m } else { 0.0 }
    }

    /// Friction fed forward to the servo, N·m at the output: against the way in which the motor moves, and where
    /// the target stands, moved last or was corrected to.
    ///
    /// At rest it stays. Taken off there, the integral part would hold the friction instead, and as the target moves on
    /// the motor would be given it twice. Where the torque comes from the mesh or the motor the correction tells the
    /// way but once: else it would be a relay in a loop.
    fn rubbing_told_n_m(&mut self, made: &LaneParts, rate_rad_s: f64, command_rad: f64, mesh_n_m: f64) -> f64 {
        let scenario = &made.scenario;
        let loops = matches!(made.torque, TorqueKnown::InMesh | TorqueKnown::Current);
        let gone = command_rad - self.furthest_rad;
        if rate_rad_s != 0.0 {
            self.way = libm::copysign(1.0, rate_rad_s);
        } else if gone.abs() > TURNED_RAD && !(loops && self.way != 0.0) {
            self.way = libm::copysign(1.0, gone);
        }
        if rate_rad_s != 0.0 || gone * self.way > 0.0 {
            self.furthest_rad = command_rad;
        }
        let level = self.friction.level_n_m(rate_rad_s, mesh_n_m);
        scenario.friction_known * (self.way * level + self.friction.viscous_n_m_s * rate_rad_s)
    }

    /// Friction that a rate has to overcome, N·m at the output.
    fn rubbing_n_m(&self, rate_rad_s: f64, mesh_n_m: f64) -> f64 {
        if rate_rad_s == 0.0 {
            return 0.0;
        }
        let level = self.friction.level_n_m(rate_rad_s, mesh_n_m);
        libm::copysign(level, rate_rad_s) + self.friction.viscous_n_m_s * rate_rad_s
    }
}

/// Friction that is known of the motor's side: at the temperature of a sensor on the drive.
fn known_friction(scenario: &Scenario, temperature_c: f64) -> Friction {
    let friction = Friction::EROB80_100.times(scenario.friction);
    friction.times(friction.cold(temperature_c))
}

/// Torque of gravity and wind on the load, N·m.
fn on_load_n_m(scenario: &Scenario, now: &Moment) -> f64 {
    let [weight, most_at] = scenario.load.gravity;
    now.outside_n_m[0] + weight * libm::cos(now.target_rad - most_at)
}

/// Rows of a flight in the report, at most.
const ROWS: f64 = 4000.0;

struct JointLane {
    plant: JointPlant,
    servo: Servo,
    sensing: Sensing,
    controller: JointController,
    direction: Direction,
}

impl JointLane {
    fn new(made: &LaneParts, kind: usize) -> Result<Self, FlightError> {
        let scenario = &made.scenario;
        Ok(Self {
            plant: plant(made),
            servo: Servo::new(scenario.servo, made.unit.nominal.ratio, scenario.seed),
            sensing: Sensing::new(scenario),
            controller: JointController::new(made, kind)?,
            direction: Direction::Forward,
        })
    }

    fn tick(&mut self, made: &LaneParts, now: &Moment) -> Commanded {
        let scenario = &made.scenario;
        let generator = self.servo.read(self.plant.angle_rad[0], self.plant.rate_rad_s[0]);
        let reading = self.sensing.read(made, &self.plant, &mut self.servo, now);
        let stood = self.sensing.stood;
        self.sensing.stood = f64::from(u8::from(now.rate_rad_s == 0.0));
        if now.rate_rad_s != 0.0 {
            self.direction = if now.rate_rad_s > 0.0 { Direction::Forward } else { Direction::Backward };
        }
        let way = if self.direction == Direction::Forward { 1.0 } else { -1.0 };
        // As on board: while a target speeds up the flank does not change.
        let inertia_n_m = scenario.load_kg_m2 * now.acceleration_rad_s2;
        let even_n_m = on_load_n_m(scenario, now) - way * scenario.drag_n_m;
        let mesh_n_m = if even_n_m.abs() > inertia_n_m.abs() { even_n_m - inertia_n_m } else { even_n_m };
        let input = TickInput { generator, moment: *now, direction: self.direction, reading, mesh_n_m };
        let commanded = self.controller.tick(made, &input);
        let command_rad = commanded.command.to_rad() / made.unit.nominal.ratio;
        let fed = made.torque == TorqueKnown::OnLoad && scenario.load_fed_forward > 0.0;
        // The load, which moves as the target does, has to be accelerated too.
        let load = scenario.load_kg_m2 / made.masses.motor_kg_m2 * made.unit.nominal.ratio;
        let asked = ServoCommand {
            command: commanded.command,
            rate_rad_s: commanded.rate_rad_s,
            acceleration_rad_s2: commanded.acceleration_rad_s2 + now.acceleration_rad_s2 * load,
            torque_n_m: (self.sensing.rubbing_told_n_m(made, now.rate_rad_s, command_rad, mesh_n_m)
                - scenario.load_fed_forward * self.sensing.held_n_m(scenario, way))
                / made.unit.nominal.ratio,
            starts: if fed && stood != 0.0 && now.rate_rad_s != 0.0 { way } else { 0.0 },
        };
        if scenario.warming_k_s != 0.0 {
            self.plant.set_temperature(scenario.temperature_at_c(now.time_s));
        }
        let [first, last] = now.outside_n_m;
        let tick_s = scenario.servo.tick_s;
        self.plant.go(&mut self.servo, &asked, |time| first + (last - first) * time / tick_s);
        commanded
    }
}

fn lane(made: &LaneParts, kind: usize, each_second: &(dyn Fn() + Sync)) -> Result<Flown, FlightError> {
    let scenario = &made.scenario;
    let mut lane = JointLane::new(made, kind)?;
    let every = (scenario.seconds() / scenario.servo.tick_s / ROWS).ceil().max(1.0) as usize;
    let mut flown = Flown { digest: 0xcbf2_9ce4_8422_2325, ..Flown::default() };
    let mut within = 0_u32;
    let second = (1.0 / scenario.servo.tick_s) as usize;
    for (tick, now) in scenario.moments().enumerate() {
        let error = (lane.plant.angle_rad[1] - now.target_rad) * ARCSEC_PER_RAD;
        let ripple = (lane.plant.rate_rad_s[1] - now.rate_rad_s) * ARCSEC_PER_RAD;
        let mesh = lane.plant.mesh_n_m();
        if !error.is_finite() || error.abs() > 1e6 {
            return Err(FlightError::RunsAway { controller: CONTROLLERS[kind], time_s: now.time_s });
        }
        flown.digest = (flown.digest ^ error.to_bits()).wrapping_mul(0x0100_0000_01b3);
        if tick % second == second - 1 {
            each_second();
        }
        let commanded = lane.tick(made, &now);
        if now.time_s >= START_UP_S {
            flown.error.add(error);
            if now.steady {
                flown.ripple.add(ripple);
            }
            let off = lane.sensing.told_n_m - on_load_n_m(scenario, &now);
            within += u32::from(off.abs() <= lane.sensing.bound_n_m);
            flown.mesh.add(mesh);
            flown.errors.push(error as f32);
            let limits = [lane.servo.saturated(), commanded.held_back, commanded.not_corrected];
            flown.limits.iter_mut().zip(limits).for_each(|(count, there)| *count += u32::from(there));
        }
        if tick % every == 0 {
            flown.rows.push([now.time_s, error, mesh]);
        }
    }
    flown.within_bound = f64::from(within) / flown.errors.len().max(1) as f64;
    Ok(flown)
}

/// A target that stands, a knock, and what is left of it 2.5 s later: speed of the load (rad/s rms) about its mean,
/// which a slow low-pass moves, in three of six half seconds. What rings does so in each of them; a servo that unwinds
/// its integral part while the motor sticks lets it slip once, at any time.
fn left_of_a_knock(made: &LaneParts, kind: usize) -> Result<f64, FlightError> {
    let mut lane = JointLane::new(made, kind)?;
    let tick_s = made.scenario.servo.tick_s;
    let outside = made.scenario.load.bias_n_m + 0.5 * made.scenario.load.swing[0];
    let ticks = |seconds: f64| (seconds / tick_s) as u32;
    let mut tick = 0;
    let mut fly = |lane: &mut JointLane, ticks: u32| {
        let (mut left, mut sum) = (Score::default(), 0.0);
        for _ in 0..ticks {
            lane.tick(
                made,
                &Moment { time_s: f64::from(tick) * tick_s, outside_n_m: [outside; 2], ..Moment::default() },
            );
            left.add(lane.plant.rate_rad_s[1]);
            sum += lane.plant.rate_rad_s[1];
            tick += 1;
        }
        let mean = sum / f64::from(left.count().max(1));
        (left.rms() * left.rms() - mean * mean).max(0.0).sqrt()
    };
    // Until a slow low-pass follows, the motor creeps after the torque that it reports, and sticks and slips: that is
    // no ringing.
    fly(&mut lane, ticks(1.0 + TIME_CONSTANTS / (TAU * made.bandwidth_hz)));
    let mut rates = lane.plant.rate_rad_s;
    rates[1] += 1e-3;
    lane.plant.set_motion(lane.plant.angle_rad, rates);
    fly(&mut lane, ticks(2.5));
    let mut left = [0.0; HALF_SECONDS];
    left.fill_with(|| fly(&mut lane, ticks(0.5)));
    left.sort_by(f64::total_cmp);
    Ok(left[HALF_SECONDS / 2 - 1])
}

/// Half seconds after a knock in half of which a joint is quiet that comes to rest: a slip, and what it leaves ringing,
/// takes up to a second.
const HALF_SECONDS: usize = 6;

/// Time constants of the torque's low-pass before the knock: what is left of a step of it is 3e-4.
const TIME_CONSTANTS: f64 = 8.0;

/// Speed below which a joint counts as at rest, rad/s: 4″/s, with an encoder that steps.
const AT_REST_RAD_S: f64 = 2e-5;

/// Whether the compensated joint comes to rest after a knock as the one without compensation does, with all that flies:
/// limiter, hold, rate and acceleration fed forward, the torque's path. And the low-pass that the torque got, Hz; none
/// where a torque in the mesh may not be used.
///
/// # Errors
/// As [`fly_watched`].
pub fn comes_to_rest(scenario: &Scenario, unit: &JointUnit) -> Result<(bool, Option<f64>), FlightError> {
    let made = made(scenario, unit, None)?;
    let used = made.torque == scenario.torque;
    Ok((stable(&made)?, used.then_some(made.bandwidth_hz)))
}

fn stable(made: &LaneParts) -> Result<bool, FlightError> {
    // What noise moves is no ringing.
    let quiet = LaneParts { scenario: Scenario { torque_noise_n_m: 0.0, ..made.scenario.clone() }, ..made.clone() };
    let [without, with] = [0, COMPENSATED].map(|kind| left_of_a_knock(&quiet, kind));
    Ok(with? <= (2.0 * without?).max(AT_REST_RAD_S))
}
