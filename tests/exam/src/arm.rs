//! Family H: the wrist of a robot's arm, or the hub of a rover's wheel, at work. A servo turns the generator through
//! spins, picks and places, a weave, a scan, jogs and stops on the brake; the payload changes from session to session
//! and hangs, with tools that press, behind the sensor of the joint's torque; the bus logs 250 rows a second, of which
//! each second or third is kept.
//!
//! Each law has a form of the textbook and one of a real part; `shape[3]` is the distance between the two, 0 to 1.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::ARCSEC;
use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::{Drive, Unit};
use crate::gimbal::{hardened, slip};
use crate::hides::{Hides, Stranger, Thing};
use crate::record::Record;
use crate::train::{self, Adds, Laws, Memory, Now, Pace, Session, eased, near_zero, place, stairs};

/// Effects outside the library that such an arm shows.
pub const STRANGERS: &[Stranger] = &[
    Stranger::BrakeReleasesLate,
    Stranger::TorqueSensorCreep,
    Stranger::NeighbourMachine,
    Stranger::ScalePatch,
    Stranger::ChainRolls,
];

const STEP_S: f64 = 5e-4;
const PRESSURE_RAD: f64 = 0.44;
/// Generator speed at which the size is the drag of the grease, rad/s.
const DRAG_AT_RAD_S: f64 = 8.0;
/// Torque, over the rated one, at which each part of the hysteresis slips, and its share once all slip; the first alone
/// is the textbook's.
const SLIPS: [(f64, f64); 5] = [(0.2, 1.0), (0.05, 0.1), (0.11, 0.2), (0.22, 0.3), (0.42, 0.4)];

#[derive(Debug, Clone)]
pub struct Arm {
    pub pace: Pace,
    /// Of all sessions.
    pub rows: usize,
    sessions: usize,
    drive: Drive,
    servo_rad_s: f64,
    /// How far the rated load draws the motor from where it should be.
    drawn_rad: f64,
    /// Pole pairs times slots, and size of the ripple of the motor.
    cogging: (f64, f64),
    /// Of the empty flange on the spring, Hz.
    load_hz: f64,
    turned: bool,
}

impl Arm {
    pub fn draw(drive: &Drive, chance: &mut Chance) -> Self {
        let orientation = chance.below(4);
        Self {
            pace: Pace {
                step_s: STEP_S,
                stride: *chance.of(&[16, 24]),
                jitter_s: chance.log_uniform(2e-6, 1.5e-5),
                damping_rad_s: chance.uniform(10.0, 20.0),
                lags_s: [chance.log_uniform(15.0, 60.0), chance.log_uniform(120.0, 300.0)],
                seed: chance.number(),
                orientation_known: orientation != 0,
            },
            rows: 27_000 + chance.below(16_000),
            sessions: 4 + chance.below(3),
            drive: drive.clone(),
            servo_rad_s: chance.uniform(60.0, 130.0),
            drawn_rad: chance.log_uniform(0.001, 0.01),
            cogging: (*chance.of(&[24.0, 36.0, 42.0]), chance.log_uniform(5e-5, 5e-4)),
            load_hz: chance.uniform(17.0, 32.0),
            turned: orientation > 1,
        }
    }

    pub fn run(&self, drive: &Drive, unit: &Unit, hidden: &[Hides]) -> Record {
        train::run(self, drive, unit, hidden, &self.plan(), &self.pace)
    }

    /// Commands and surroundings of each session.
    fn plan(&self) -> Vec<Session> {
        let mut chance = Chance::new(self.pace.seed, "arm", 0);
        let count = self.rows / self.sessions * self.pace.stride;
        let rated = self.drive.rated_n_m;
        let mut rooms: Vec<f64> = (0..self.sessions)
            .map(|at| -18.0 + 62.0 * (at as f64 + chance.uniform(0.1, 0.9)) / self.sessions as f64)
            .collect();
        chance.shuffle(&mut rooms);
        let mut payloads = [0.65, 0.05, 0.4, 0.2, 0.55, 0.1];
        chance.shuffle(&mut payloads);
        let stiffness = self.drive.first_stiffness();
        let senses = [1.0, 1.0, -1.0, -1.0, 1.0, -1.0];
        let (first, upright) = (chance.sign(), FRAC_PI_2 * chance.below(4) as f64);
        (0..self.sessions)
            .map(|session| {
                let tool = stairs(count, STEP_S, (0.8, 5.0), 0.12, &mut chance);
                let (period_s, phase) = (chance.uniform(7.0, 20.0), chance.phase());
                // A light payload leaves room for heavy work.
                let press = (0.9 - payloads[session]) * rated;
                let work = chance.below(3);
                let load_n_m = (0..count).map(|at| {
                    let x = TAU * at as f64 * STEP_S / period_s + phase;
                    press
                        * match work {
                            0 => tool[at],
                            1 => x.sin(),
                            _ => 0.5 * tool[at] + 0.5 * x.sin(),
                        }
                });
                let load_n_m = load_n_m.collect();
                let (warming_c, warming_s) = (chance.uniform(3.0, 14.0), chance.uniform(20.0, 70.0));
                let column_c = (0..count).map(|at| {
                    let t = at as f64 * STEP_S;
                    rooms[session] + warming_c * (1.0 - (-t / warming_s).exp())
                });
                let column_c = column_c.collect();
                let hangs = payloads[session] * chance.uniform(0.8, 1.0);
                Session {
                    pause_s: if session == 0 { 0.0 } else { chance.log_uniform(100.0, 5000.0).round() },
                    away_rad: if session == 0 { chance.uniform(-300.0, 300.0) } else { chance.uniform(-20.0, 20.0) },
                    speed_rad_s: self.speeds(count, first * senses[session], &mut chance),
                    load_n_m,
                    column_c,
                    // The link before the wrist stands otherwise, at any angle.
                    orientation_rad: upright + if self.turned { chance.uniform(-PI, PI) } else { 0.0 },
                    hung: (hangs * rated, chance.phase()),
                    inertia_kg_m2: stiffness / (TAU * self.load_hz).powi(2) * (1.0 + 1.2 * hangs),
                }
            })
            .collect()
    }

    /// A spin, picks and places, a weave, a scan of the resonance, jogs, stops on the brake.
    fn speeds(&self, count: usize, sense: f64, chance: &mut Chance) -> Vec<f64> {
        let seconds = count as f64 * STEP_S;
        let shares = [0.36, 0.25, 0.14, 0.1, 0.1, 0.05];
        let mut order = [0, 1, 2, 3, 4, 5];
        chance.shuffle(&mut order);
        // Two spins pass more than half a turn of the output.
        let spin = f64::max(chance.uniform(5.0, 11.0), 0.65 * PI * self.drive.ratio().abs() / (0.36 * seconds));
        let (weave, scan) = (chance.uniform(2.0, 6.0), chance.uniform(0.8, 1.6));
        let mut wishes = Vec::with_capacity(count);
        for kind in order {
            let lasts = shares[kind] * seconds;
            let (mut from_s, mut moves_s, mut rests_s, mut peak) = (0.0, 0.0, 0.0, 0.0);
            for at in 0..(lasts / STEP_S) as usize {
                let t = at as f64 * STEP_S;
                if t >= from_s + moves_s + rests_s {
                    from_s = t;
                    (moves_s, rests_s) = (chance.uniform(0.7, 1.8), chance.uniform(0.2, 0.8));
                    peak = chance.sign() * chance.uniform(3.0, 13.0);
                }
                let x = ((t - from_s) / moves_s).min(1.0);
                wishes.push(match kind {
                    0 => sense * spin,
                    // Quintic in the angle.
                    1 => peak * 16.0 * (x * (1.0 - x)).powi(2),
                    2 => weave * ((TAU * 1.3 * t).sin() + 0.6 * (TAU * 0.23 * t).sin()),
                    3 => scan * (TAU * t * (1.0 + 0.5 * 12.0 * t / lasts)).sin(),
                    4 => 0.06 * peak,
                    _ => 0.0,
                });
            }
        }
        wishes.resize(count, 0.0);
        eased(wishes.into_iter(), 90.0, 0.01, STEP_S)
    }

    /// A torque on the flange that winds the spring up by so much.
    fn torque_of(&self, arcsec: f64) -> f64 {
        arcsec * self.drive.first_stiffness() / ARCSEC
    }
}

impl Laws for Arm {
    /// Two zones after Hertz: the second bears once the first has given way by what is between them.
    fn alone(&self, over: f64) -> f64 {
        let given = over.powf(2.0 / 3.0);
        if given < 1.0 { 1.0 - 0.74 * given } else { 0.26 * given.powf(-2.85) }
    }

    fn turn(&self, wanted: [f64; 2], state: &mut [f64; 2], load: f64, step_s: f64) {
        let w = self.servo_rad_s;
        let (slots, ripple) = self.cogging;
        let drawn = self.drawn_rad * load * self.drive.ratio().signum() + ripple * (slots * state[0]).sin();
        state[1] += step_s * (w * w * (wanted[0] - state[0] + drawn) + 1.5 * w * (wanted[1] - state[1]));
        state[0] += step_s * state[1];
    }

    /// The tool, and the payload where it hangs.
    fn load_n_m(&self, session: &Session, at: usize, now: &Now) -> f64 {
        let (hangs, phase) = session.hung;
        session.load_n_m[at] + hangs * (now.output_rad + session.orientation_rad + phase).sin()
    }

    fn wind_up(&self, one: &Hides, own: f64, torque_n_m: f64, now: &Now, memory: &mut Memory) -> f64 {
        let Thing::Cause(cause) = one.thing else { return 0.0 };
        let (size, d) = (one.size, one.shape[3]);
        let load = torque_n_m / self.drive.rated_n_m;
        match cause {
            // What is soft is a joint that gives only once its bolts' friction is overcome.
            Cause::StiffnessError => own * (1.0 / (1.0 + size * (1.0 - 0.6 * d * (-(load / 0.3).powi(2)).exp())) - 1.0),
            // From a cube to parts that seat one after the other: soft at first, then all at once.
            Cause::StiffnessHardening => {
                let rated = self.drive.wind_up_arcsec(self.drive.rated_n_m);
                hardened(own, rated, |q| {
                    let seated = 1.3 * q / (q + 0.3);
                    let factor = 1.0 + size * ((1.0 - d) * q * q + d * seated);
                    (factor, size * (2.0 * (1.0 - d) * q + d * 0.39 / (q + 0.3).powi(2)))
                })
            }
            // A bonded joint that softens within some 20 K.
            Cause::ThermalStiffness => {
                let warmer = now.gear_c - 20.0;
                let soft = 1.0 + size * ((1.0 - d) * warmer + d * 34.0 * (warmer / 16.0).tanh());
                own * (1.0 / soft.max(0.35) - 1.0)
            }
            // Preisach's relays with the torque as their input, as stops in parallel.
            Cause::TorsionalHysteresis => {
                let parts = SLIPS.map(|(at, share)| (at, share * if at == SLIPS[0].0 { 1.0 - d } else { d }));
                let steep: f64 = parts.iter().map(|(at, share)| share / at).sum::<f64>() / self.drive.rated_n_m;
                let held = f64::max(1.0, steep * self.torque_of(size) / 0.6);
                let change = (torque_n_m - memory[5]) / (held * self.drive.rated_n_m);
                memory[5] = torque_n_m;
                let mut sum = 0.0;
                for ((at, share), stop) in parts.iter().zip(&mut memory[..5]) {
                    *stop = (*stop + change / at).clamp(-1.0, 1.0);
                    sum += share * *stop;
                }
                -size * sum
            }
            _ => 0.0,
        }
    }

    fn add(&self, one: &Hides, now: &Now, memory: &mut Memory, to: &mut Adds) {
        let (size, d) = (one.size, one.shape[3]);
        let (p, q, r) = (one.phase(0), one.phase(1), one.phase(2));
        let load = now.load.abs().min(1.5);
        // The play of a bearing lets an axis lie elsewhere for loads of either sense.
        let side = (6.0 * now.load).tanh();
        let [flexspline, circular] = now.wheel_rad;
        let (dt, orientation) = (now.step_s, now.orientation_rad);
        let displaced = |to: &mut Adds, angle_rad: f64, moved: f64, sized: f64| {
            for zone in 0..2 {
                let a = place(angle_rad, zone) - p - moved;
                let sized = sized * if zone == 1 { 1.0 - 0.3 * d } else { 1.0 };
                to.displaced(zone, sized, a, PRESSURE_RAD);
            }
        };
        match one.thing {
            Thing::Cause(cause) => match cause {
                Cause::CircularSplineEccentricity => {
                    displaced(to, circular, 0.35 * d * side, size * (1.0 - 0.4 * d * (2.0 * load).tanh()));
                }
                // A cup that cones, and a seam of its wall.
                Cause::FlexsplineRunout => {
                    displaced(to, flexspline, 0.0, size);
                    for zone in 0..2 {
                        let a = place(flexspline, zone) + q;
                        to.both(zone, d * size * (0.3 * (4.0 * a).sin() + 0.3 * side * (2.0 * a + r).sin()));
                    }
                }
                // Two bolts press it, and the housing of aluminium more or less of it with the temperature.
                Cause::CircularSplineOvality => {
                    let a = 2.0 * circular + p;
                    let more = size * (1.0 + 0.012 * d * (now.housing_c - 20.0));
                    for zone in 0..2 {
                        to.both(zone, more * (a.sin() + 0.22 * d * (3.0 * a + q).sin()));
                    }
                }
                Cause::FlexsplinePitchError | Cause::CircularSplinePitchError => {
                    let wheel = if cause == Cause::FlexsplinePitchError { flexspline } else { circular };
                    // A hob that was moved on from sector to sector leaves teeth of a saw.
                    let saw = |x: f64| (0.97 * x.sin()).asin() / FRAC_PI_2;
                    for zone in 0..2 {
                        let a = place(wheel, zone);
                        let led = (2.0 * a + p).sin() + 0.35 * (a + q).sin() + 0.2 * (4.0 * a + r).sin();
                        let hobbed = 0.9 * saw(a + q) + 0.9 * saw(2.0 * a + p) + 0.5 * saw(3.0 * a + r);
                        to.both(zone, size * ((1.0 - d) * led + d * hobbed));
                        to.zones[zone][1] -= 0.35 * d * size * saw(2.0 * a + r);
                    }
                }
                Cause::GeneratorEccentricity => {
                    for zone in 0..2 {
                        let deep = if zone == 0 { 0.8 * size } else { -0.8 * size * (1.0 - 0.5 * d) };
                        to.zones[zone][0] -= deep;
                        to.zones[zone][1] += deep;
                        let (f, c) = (place(flexspline, zone) + p, place(circular, zone) + q);
                        to.both(zone, size * (0.5 * f.sin() + 0.6 * c.sin() + 0.25 * d * (3.0 * f + r).sin()));
                    }
                }
                // The profile was ground in four quarters: the line of the teeth swells twice a turn.
                Cause::CamFormError => {
                    let a = self.drive.mesh_order() * now.generator_rad + p;
                    let swells = 1.0 + 0.5 * d * (2.0 * now.generator_rad + r).cos();
                    let sized = size * swells / (1.0 + 0.7 * d * load);
                    let second = 0.3 * d * (2.0 * a + q).sin();
                    to.flanks[0] += sized * (a.sin() + second);
                    to.flanks[1] += sized * ((1.0 + 0.3 * d) * (a + 0.8).sin() + second);
                }
                // A dent has raised its rim: that zone bears too early, most at light load.
                Cause::DamagedTooth => {
                    let wheel = if one.shape[1] < 0.5 { flexspline } else { circular };
                    for zone in 0..2 {
                        let a = near_zero(place(wheel, zone) - p);
                        let width = 0.26 / (1.0 + 0.5 * d * load);
                        let plain = if a.abs() < width { (FRAC_PI_2 * a / width).cos().powi(2) } else { 0.0 };
                        let climbs = if a < 0.0 { (3.0 * a / width).exp() } else { (1.0 - 2.0 * a / width).max(0.0) };
                        let raised = size * ((1.0 - d) * plain + d * climbs);
                        if one.shape[2] < 0.67 {
                            to.zones[zone][0] -= raised;
                        }
                        if one.shape[2] > 0.33 {
                            to.zones[zone][1] += raised * (1.0 - 0.4 * d);
                        }
                    }
                }
                Cause::BacklashGrowth => {
                    let worked = 1.0 + 0.45 * d * (now.output_rad + p).sin();
                    to.wider(size * worked * (0.5 - 0.25 * d), size * worked * (0.5 + 0.25 * d));
                }
                // Running in, and most where the arm works most.
                Cause::Wear => {
                    let grown = size * ((1.0 - d) * now.path + d * now.path.max(0.0).sqrt());
                    let worked = 1.0 + 0.45 * d * (now.output_rad + p).sin();
                    to.wider(grown * worked * (0.5 - 0.2 * d), grown * worked * (0.5 + 0.2 * d));
                }
                // The housing closes in on the gear late, and not beyond what its fit allows.
                Cause::ThermalClearance => {
                    let (gear, housing) = (now.gear_c - 20.0, now.housing_c - 20.0);
                    let late = 26.0 * ((0.4 * gear + 0.8 * housing) / 24.0).tanh();
                    let more = size * ((1.0 - d) * gear + d * late);
                    to.wider(more * (0.5 - 0.2 * d), more * (0.5 + 0.2 * d));
                }
                // Newton with an exponential, to Bingham with Vogel's.
                Cause::LubricantViscosity => {
                    let speed = now.output_rad_s * self.drive.ratio().abs() / DRAG_AT_RAD_S;
                    let plain = (-0.035 * (now.gear_c - 20.0)).exp();
                    let vogel = (450.0 * (1.0 / (now.gear_c + 95.0) - 1.0 / 115.0)).exp();
                    let thick = ((1.0 - d) * plain + d * vogel).min(5.0);
                    let flow = (1.0 - 0.65 * d) * speed.clamp(-2.0, 2.0) + 0.65 * d * (speed / 0.2).tanh();
                    to.unseen_n_m -= size * thick * flow;
                }
                // The link hangs lower than its angle says.
                Cause::GravityTorque => {
                    let a = now.output_rad + orientation + p;
                    to.unseen_n_m += size * (a + 0.45 * d * (a + q).sin()).sin();
                }
                Cause::GravitySideLoad => {
                    let sized = size * (1.0 - 0.3 * d * load);
                    displaced(to, now.generator_rad + orientation, 0.4 * d * side, sized);
                }
                // A tool changer on a bracket before the sensor; further off its spring hardens and its joint rubs.
                Cause::TorsionalResonance => {
                    let w = TAU * 4.5 * 2.5_f64.powf(one.shape[0]);
                    let damping = 0.01 + 0.04 * one.shape[1];
                    let (at, speed) = (memory[0], memory[1]);
                    let hard = 1.0 + 0.6 * d * (at / 30.0).powi(2).min(2.0);
                    let rub = w * w * 1.5 * d * (speed / (0.5 * w)).tanh();
                    let back = w * w * at * hard + 2.0 * damping * w * speed + rub;
                    memory[1] -= dt * (now.output_arcsec_s2 + back);
                    memory[0] += dt * memory[1];
                    to.unseen_n_m += size * now.inertia_kg_m2 * back / ARCSEC;
                }
                Cause::OutputEncoderEccentricity => {
                    let a = now.output_rad + p;
                    to.output_arcsec += size * ((a + 0.45 * d * (a + q).sin()).sin() + 0.12 * d * (3.0 * a + r).sin());
                }
                Cause::GeneratorEncoderEccentricity => {
                    let a = now.generator_rad + p;
                    to.generator_arcsec +=
                        size * ((a + 0.45 * d * (a + q).sin()).sin() + 0.12 * d * (3.0 * a + r).sin());
                }
                // A reading waits for its turn on the bus.
                Cause::SensorLatency => {
                    let cycle = (now.time_s / 0.004).floor();
                    let turn = (cycle * 0.618_034 + (cycle * 1.3).sin() * 43_758.5).fract().abs() - 0.5;
                    to.delay_s += size * (1.0 + 1.4 * d * turn);
                }
                // A wheel that rolls on a rail and slips more one way under load.
                Cause::RatioError => {
                    let creeps = 1.0 + 0.6 * d * (4.0 * now.load).tanh();
                    memory[0] += size * creeps * now.moved_rad / self.drive.ratio() * ARCSEC;
                    to.wider(memory[0], -memory[0]);
                }
                Cause::Ratcheting => {
                    let slipped = slip(one, d, 0.3, now, memory);
                    let pitch = TAU / self.drive.output_teeth() * ARCSEC;
                    to.wider(slipped * pitch, -slipped * pitch);
                }
                Cause::StiffnessError
                | Cause::StiffnessHardening
                | Cause::TorsionalHysteresis
                | Cause::ThermalStiffness => {}
            },
            Thing::Stranger(stranger) => match stranger {
                // A second brake on the flange lets go a second after each start.
                Stranger::BrakeReleasesLate => {
                    memory[0] = if now.speed_rad_s.abs() < 0.05 { 0.0 } else { memory[0] + dt };
                    let holds = 1.0 / (1.0 + ((memory[0] - 0.8) / 0.1).exp());
                    let sense = (now.output_rad_s * self.drive.ratio().abs() / 1.5).tanh();
                    to.unseen_n_m -= self.torque_of(2.0 * size) * holds * sense;
                }
                // The bonded gauges give way under a load that stays.
                Stranger::TorqueSensorCreep => {
                    memory[0] += (now.load - memory[0]) * dt / (6.0 + 14.0 * one.shape[0]);
                    to.torque_n_m += self.torque_of(size) * (memory[0] - now.load);
                }
                // A press next to it strikes and the floor rings.
                Stranger::NeighbourMachine => {
                    let since = (now.time_s + 10.0 * one.shape[0]).rem_euclid(3.0 + 4.0 * one.shape[1]);
                    let rings = (TAU * (4.0 + 4.0 * one.shape[2]) * since).sin() * (-since / 0.6).exp();
                    to.output_arcsec += 3.0 * size * rings;
                }
                // A tape glued around the joint stands off over a patch.
                Stranger::ScalePatch => {
                    let a = near_zero(now.output_rad - p).abs();
                    let width = 0.2 + 0.3 * one.shape[1];
                    to.output_arcsec += 2.5 * size / (1.0 + ((a - width) / 0.03).min(40.0).exp());
                }
                // An energy chain resists to a third of a radian after each turn back, then rolls.
                Stranger::ChainRolls => {
                    let turned = now.output_rad_s * dt / 0.35;
                    memory[0] += turned - turned.abs() * memory[0];
                    to.unseen_n_m -= self.torque_of(1.5 * size) * memory[0];
                }
                _ => {}
            },
        }
    }
}
