//! Perfect drives on a bench: what really happens, at eight instants for each row of the log that will be written.

use std::f64::consts::{PI, TAU};

use flexspline::{GeneratorAngle, PlayState};
use flexspline_sim::diagnosis::Subject;
use flexspline_sim::tables::dead_zone_n_m;

use crate::chance::Chance;

/// An arc-second, rad.
pub const ARCSEC: f64 = PI / 648_000.0;
/// Instants to a row.
const FINER: usize = 8;
/// Rows of a record.
const ROWS: [f64; 2] = [8000.0, 20_000.0];
/// Rows per second.
const RATE_HZ: [f64; 2] = [100.0, 1000.0];
/// Fastest speed of the generator, rad/s, and how far it may turn in a row, rad: a logger is chosen for the speed of
/// its bench.
const SPEED: [f64; 2] = [4.0, 120.0];
const TURNS_IN_A_ROW_RAD: f64 = 0.2;
/// Largest load as a share of the rated one.
const LOAD: [f64; 2] = [0.3, 0.9];
/// Noise of the output's encoder, arcsec; that of the torque as a share of its range.
const NOISE_ARCSEC: [f64; 2] = [0.5, 4.0];
const TORQUE_NOISE: [f64; 2] = [2e-4, 2e-3];
/// Time in which the output goes from one flank to the other where nothing holds it, s: of most benches, and of those
/// with a large load.
const FLANK_S: f64 = 0.004;
const SLOW_FLANK_S: [f64; 2] = [0.006, 0.03];
/// A unit is within so many standard deviations of its drawing.
const WORST_UNIT: f64 = 1.5;

/// How benches move and load.
const MOTIONS: [&str; 3] = ["there and back", "swings", "moves"];
const LOADS: [&str; 4] = ["ramps", "sine", "steps", "friction"];

/// A drive with what it is held against.
pub struct Drive<'a> {
    pub name: String,
    pub subject: Subject<'a>,
    pub rated_n_m: f64,
}

/// What a bench does, drawn by the seed.
pub struct Bench {
    pub rate_hz: f64,
    pub sessions: usize,
    /// Rows of a session.
    pub rows: usize,
    pub load_n_m: f64,
    pub speed_rad_s: f64,
    pub noise_arcsec: f64,
    pub torque_noise_n_m: f64,
    /// Bits to a turn of the generator's and of the output's encoder.
    pub bits: [u32; 2],
    pub with_temperature: bool,
    pub motion: &'static str,
    pub load: &'static str,
    /// Time in which the output goes from one flank to the other where nothing holds it, s.
    pub flank_s: f64,
}

/// What happens in a session.
pub struct Truth {
    /// Time of the first instant, s, and from one to the next.
    pub begin_s: f64,
    step_s: f64,
    generator: Vec<f64>,
    output: Vec<f64>,
    torque: Vec<f64>,
}

impl Truth {
    /// Generator, output and torque at a time, rad and N·m; before and after the session what it begins and ends with.
    pub fn at(&self, time_s: f64) -> [f64; 3] {
        let place = ((time_s - self.begin_s) / self.step_s).clamp(0.0, (self.generator.len() - 1) as f64);
        let first = (place as usize).min(self.generator.len() - 2);
        let share = place - first as f64;
        [&self.generator, &self.output, &self.torque].map(|of| of[first] + share * (of[first + 1] - of[first]))
    }

    /// Seconds that it takes.
    pub fn lasts_s(&self) -> f64 {
        self.step_s * (self.generator.len() - 1) as f64
    }
}

impl Bench {
    pub fn drawn(drive: &Drive<'_>, chance: &mut Chance) -> Bench {
        let rate_hz = (chance.by_ratio(RATE_HZ) / 10.0).round() * 10.0;
        let sessions = *chance.of(&[1, 1, 2, 3, 4, 6]);
        let load_n_m = drive.rated_n_m * chance.between(LOAD);
        Bench {
            rate_hz,
            sessions,
            rows: (chance.between(ROWS) / sessions as f64) as usize,
            load_n_m,
            speed_rad_s: chance.by_ratio(SPEED).min(TURNS_IN_A_ROW_RAD * rate_hz),
            noise_arcsec: chance.by_ratio(NOISE_ARCSEC),
            torque_noise_n_m: load_n_m * chance.by_ratio(TORQUE_NOISE),
            bits: [*chance.of(&[16, 18, 20]), *chance.of(&[22, 24, 26])],
            with_temperature: chance.is(0.7),
            motion: MOTIONS[chance.below(MOTIONS.len())],
            load: LOADS[chance.below(LOADS.len())],
            flank_s: FLANK_S,
        }
    }

    /// With a load that is slow to go to its other flank.
    pub fn with_slow_flanks(&mut self, chance: &mut Chance) {
        self.flank_s = chance.by_ratio(SLOW_FLANK_S);
    }

    /// With several sessions, which some faults need.
    pub fn in_sessions(&mut self, chance: &mut Chance) {
        let rows = self.rows * self.sessions;
        self.sessions = *chance.of(&[3, 4, 6]);
        self.rows = rows / self.sessions;
    }

    /// What a perfect unit of the drive does in each session; `ratio_off` is by how much its ratio is another than the
    /// model's.
    pub fn run(&self, drive: &Drive<'_>, ratio_off: f64, chance: &mut Chance) -> Vec<Truth> {
        let unit = Unit::drawn(drive, chance);
        let mut begin_s = 0.0;
        let mut at = chance.between([-300.0, 300.0]);
        (0..self.sessions)
            .map(|_| {
                let truth = self.session(drive, ratio_off, &unit, begin_s, at, chance);
                begin_s += truth.lasts_s() + chance.between([60.0, 1500.0]);
                at = truth.generator.last().copied().unwrap_or(at);
                truth
            })
            .collect()
    }

    fn session(
        &self,
        drive: &Drive<'_>,
        ratio_off: f64,
        unit: &Unit,
        begin_s: f64,
        from_rad: f64,
        chance: &mut Chance,
    ) -> Truth {
        let step_s = 1.0 / (self.rate_hz * FINER as f64);
        let count = self.rows * FINER;
        let lasts_s = count as f64 * step_s;
        let generator = self.motion(count, step_s, lasts_s, from_rad, chance);
        let torque = self.torque(&generator, step_s, lasts_s, chance);
        let error = unit.error(drive, &generator, &torque, step_s, self.flank_s);
        let ratio = drive.subject.nominal.ratio + ratio_off;
        let output = generator.iter().zip(&error).map(|(psi, error)| psi / ratio + error * ARCSEC).collect();
        Truth { begin_s, step_s, generator, output, torque }
    }

    /// Angle of the generator: speeds that are asked for, through a servo with a limit of acceleration.
    fn motion(&self, count: usize, step_s: f64, lasts_s: f64, from_rad: f64, chance: &mut Chance) -> Vec<f64> {
        let legs = (chance.between([3.0, 8.0]) as usize).max(2);
        let speeds: Vec<f64> = (0..legs)
            .map(|leg| {
                let sign = if leg % 2 == 0 { 1.0 } else { -1.0 };
                self.speed_rad_s * sign * *chance.of(&[0.3, 0.6, 1.0])
            })
            .collect();
        let swings: Vec<[f64; 3]> = (0..3)
            .map(|_| {
                [chance.between([0.2, 1.0]), TAU * chance.between([1.5, 9.0]) / lasts_s, chance.between([0.0, TAU])]
            })
            .collect();
        let size: f64 = swings.iter().map(|swing| swing[0]).sum();
        let steepest = self.speed_rad_s / 0.1;
        let (mut psi, mut speed) = (from_rad, 0.0);
        (0..count)
            .map(|k| {
                let t = k as f64 * step_s;
                let leg = legs as f64 * t / lasts_s;
                let asked = match self.motion {
                    "there and back" => speeds[(leg as usize).min(legs - 1)],
                    "swings" => {
                        self.speed_rad_s * swings.iter().map(|[a, w, p]| a * (w * t + p).sin()).sum::<f64>() / size
                    }
                    // A move, and a rest of a third of the time.
                    _ => {
                        let of_move = (4.0 * leg).fract();
                        if of_move < 0.67 { speeds[(leg as usize).min(legs - 1)] } else { 0.0 }
                    }
                };
                let most = steepest * step_s;
                speed += ((asked - speed) * step_s / 0.02).clamp(-most, most);
                psi += speed * step_s;
                psi
            })
            .collect()
    }

    fn torque(&self, generator: &[f64], step_s: f64, lasts_s: f64, chance: &mut Chance) -> Vec<f64> {
        let cycles = chance.between([2.0, 12.0]);
        let (phase, middle) = (chance.between([0.0, 1.0]), chance.between([-0.3, 0.3]));
        let levels: Vec<f64> = (0..64).map(|_| chance.between([-1.0, 1.0])).collect();
        let (mut at, mut drag) = (0.0, 0.0);
        (0..generator.len())
            .map(|k| {
                let turns = cycles * k as f64 * step_s / lasts_s + phase;
                let turned = generator[k] - generator[k.max(1) - 1];
                let wanted = match self.load {
                    "ramps" => 4.0 * ((turns + 0.25).rem_euclid(1.0) - 0.5).abs() - 1.0,
                    "sine" => middle + (1.0 - middle.abs()) * (TAU * turns).sin(),
                    "steps" => levels[(2.0 * turns) as usize % levels.len()],
                    // A brake against the motion, and a load that swings.
                    _ => {
                        drag += (-(turned / step_s / (0.02 * self.speed_rad_s)).tanh() - drag) * step_s / 0.03;
                        0.4 * drag + 0.6 * (TAU * turns).sin()
                    }
                };
                at += (wanted - at) * if k == 0 { 1.0 } else { step_s / 0.02 };
                self.load_n_m * at
            })
            .collect()
    }
}

/// By what a unit differs from its drawing, which is no fault.
struct Unit {
    wind_up: f64,
    clearance: f64,
    harmonics: Vec<[f64; 2]>,
    zero_arcsec: f64,
}

impl Unit {
    fn drawn(drive: &Drive<'_>, chance: &mut Chance) -> Unit {
        let spread = drive.subject.nominal.spread;
        let mut by = |spread: f64| spread * chance.gauss().clamp(-WORST_UNIT, WORST_UNIT);
        Unit {
            wind_up: 1.0 + by(spread.stiffness),
            clearance: 1.0 + by(spread.backlash),
            harmonics: (drive.subject.nominal.harmonics.iter())
                .map(|_| [1.0 + by(spread.harmonic), by(0.5 * spread.harmonic_phase_rad)])
                .collect(),
            zero_arcsec: chance.between([-200.0, 200.0]),
        }
    }

    /// Error of the output, arcsec.
    fn error(&self, drive: &Drive<'_>, generator: &[f64], torque: &[f64], step_s: f64, flank_s: f64) -> Vec<f64> {
        let (nominal, table) = (&drive.subject.nominal, drive.subject.table.as_ref());
        let half = 0.5 * nominal.backlash_arcsec;
        let friction = table.map_or(nominal.friction_torque_n_m, dead_zone_n_m);
        let mut play = PlayState::unknown();
        let (mut wanted, mut side) = (torque[0].signum(), torque[0].signum());
        (0..generator.len())
            .map(|k| {
                let (psi, load) = (generator[k], torque[k]);
                let turned = (psi - generator[k.max(1) - 1]) / nominal.ratio / ARCSEC;
                if load.abs() > friction {
                    wanted = load.signum();
                } else if half > 0.0 {
                    // The generator uses up the clearance, and pushes the output.
                    wanted = (wanted - turned / half).clamp(-1.0, 1.0);
                }
                let lag = wanted - side;
                side += lag * (step_s / flank_s).min(1.0);
                let wind_up = nominal.wind_up_arcsec(load);
                let drawn = match table {
                    Some(table) => {
                        let angle = GeneratorAngle::from_rad(psi).unwrap_or(GeneratorAngle::ZERO);
                        let temperature = nominal.temperature_c as f32;
                        let said = table.forward(&mut play, angle, load as f32, temperature);
                        f64::from(said.transmission_error_rad) / ARCSEC + (self.wind_up - 1.0) * wind_up
                    }
                    None => {
                        let waves = nominal.harmonics.iter().zip(&self.harmonics).map(|(wave, [more, later])| {
                            let at = wave.order_per_generator_turn * psi + wave.phase_rad + later;
                            more * wave.amplitude_arcsec * at.sin()
                        });
                        waves.sum::<f64>() + self.wind_up * wind_up + self.clearance * half * side
                    }
                };
                self.zero_arcsec + drawn
            })
            .collect()
    }
}
