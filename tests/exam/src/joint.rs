//! Family D: a joint in motion. Motor and load have inertia, the gear between them gives way, a servo turns the motor,
//! the load is an arm under gravity and a brake, and a logger polls both encoders one after the other.
//!
//! Equations, with the parts of [`Gear`] between them (ψ generator, p hub, θ output, T torque of the spring):
//! `J_m ψ'' = τ - friction(ψ') - N dp/dψ`, `N = f(p') - T` where a flank pushes the hub and 0 elsewhere,
//! `J_l θ'' = -(T - unseen) + load - friction(θ')`. In the clearance the hub, which has no mass, gives way until its
//! friction holds the spring. Semi-implicit Euler; dry friction takes at most the momentum that is there.

use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

use crate::ARCSEC;
use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::{Drive, Unit};
use crate::gear::{Gear, Laws, Place};
use crate::hides::{Hides, Stranger, Thing};
use crate::record::{Record, Row};

pub const STEP_S: f64 = 1.25e-4;

/// Steps that a late read may reach back: 64 ms.
const PAST: usize = 512;

/// A part of the setpoint.
#[derive(Debug, Clone, Copy)]
enum Move {
    /// Turns at a speed, rad/s.
    Turn(f64),
    /// From point to point and back with stops: speed, seconds of each move, seconds of each stop.
    Points(f64, f64, f64),
    /// Speed as a sine: amplitude, Hz.
    Swing(f64, f64),
}

/// Brake in a session.
#[derive(Debug, Clone, Copy)]
enum Brake {
    /// One torque, as a share of the rated one.
    Constant(f64),
    /// New torques every few seconds, from this stream.
    Steps(u64),
    /// Mean, amplitude, period in s.
    Sine(f64, f64, f64),
    /// Up and down within these seconds.
    Ramps(f64),
}

#[derive(Debug, Clone)]
struct Session {
    seconds: f64,
    gap_s: f64,
    moves: Vec<(f64, Move)>,
    brake: Brake,
    from_c: f64,
    drift_c: f64,
    settles_s: f64,
    orientation_rad: f64,
}

/// How the logger polls.
#[derive(Debug, Clone, Copy)]
pub struct Poll {
    pub row_s: f64,
    /// How late a row is, rms, s; the time stamp has it.
    pub late_s: f64,
    /// The output is read so much later than the generator, s. The stamp does not have it.
    pub skew_s: f64,
    /// Scatter of both instants, rms, s. The stamp does not have it.
    pub jitter_s: f64,
    /// Share of the rows whose output is read late, by half a millisecond and more with a heavy tail.
    pub late_reads: f64,
    /// Seconds by which the logger stands still after every fiftieth row, at least and at most.
    pub stalls_s: (f64, f64),
    /// Time is the number of the row times this share of the period, not a clock.
    pub counted: Option<f64>,
}

/// A joint on its bench.
#[derive(Debug, Clone)]
pub struct Joint {
    sessions: Vec<Session>,
    pub poll: Poll,
    /// Inertia of the motor with the generator, kg m².
    motor: f64,
    load: f64,
    /// Dry friction of the motor, N m; its extra at rest; and the speed at which the viscous part is as large, rad/s.
    motor_friction: (f64, f64, f64),
    /// Dry and viscous friction of the load, N m and N m s.
    load_friction: (f64, f64),
    damping: f64,
    arm: f64,
    band: f64,
    orientation_known: bool,
    polls: u64,
}

impl Joint {
    pub fn draw(drive: &Drive, chance: &mut Chance) -> Self {
        let rate_hz = *chance.of(&[100.0, 125.0, 150.0]);
        let count = 4 + chance.below(2);
        let seconds = (24_000.0 + 12_000.0 * chance.uniform(0.0, 1.0)) / rate_hz / count as f64;
        let arm_share = if chance.one_in(0.5) { 0.0 } else { chance.uniform(0.15, 0.4) };
        let turned = chance.below(3);
        let mut brakes = vec![
            Brake::Steps(chance.number()),
            Brake::Sine(chance.uniform(-0.2, 0.2), chance.uniform(0.4, 0.6), chance.uniform(5.0, 15.0)),
            Brake::Ramps(chance.uniform(8.0, 20.0)),
            Brake::Constant(chance.sign() * chance.uniform(0.2, 0.6)),
            Brake::Steps(chance.number()),
        ];
        chance.shuffle(&mut brakes);
        let mut warm: Vec<f64> = (0..count).map(|at| -25.0 + 75.0 * (at as f64 + 0.5) / count as f64).collect();
        chance.shuffle(&mut warm);
        let sessions = (0..count)
            .map(|at| {
                // Twice on, twice back: most of an output turn.
                let sense = [1.0, 1.0, -1.0, -1.0, 1.0][at];
                let cruise = (TAU * 45.0 / (0.45 * seconds)).max(chance.uniform(6.0, 13.0));
                let mut moves = vec![
                    (0.45 * seconds, Move::Turn(sense * cruise)),
                    (
                        0.20 * seconds,
                        Move::Points(chance.uniform(3.0, 9.0), chance.uniform(0.5, 1.2), chance.uniform(0.3, 1.0)),
                    ),
                    (0.12 * seconds, Move::Swing(chance.uniform(2.0, 6.0), chance.uniform(0.2, 1.2))),
                    (0.12 * seconds, Move::Turn(-sense * chance.uniform(0.1, 0.6))),
                    (0.11 * seconds, Move::Turn(-sense * chance.uniform(1.0, 4.0))),
                ];
                chance.shuffle(&mut moves);
                Session {
                    seconds,
                    gap_s: chance.log_uniform(40.0, 4000.0).round(),
                    moves,
                    brake: brakes[at],
                    from_c: warm[at] + chance.uniform(-5.0, 5.0),
                    drift_c: chance.sign() * chance.uniform(2.0, 10.0),
                    settles_s: chance.uniform(20.0, 90.0),
                    orientation_rad: if turned == 2 { 0.5 * PI * (at % 3) as f64 } else { 0.0 },
                }
            })
            .collect();
        // Above what the lines of the gear excite at these speeds: a joint that rattles through its clearance is not
        // run so.
        let mode = TAU * chance.log_uniform(12.0, 30.0);
        let stiffness = drive.first_stiffness();
        let load = stiffness / (mode * mode);
        let ratio = drive.ratio().abs();
        let dry = chance.uniform(0.02, 0.06) * drive.rated_n_m / ratio;
        Self {
            sessions,
            poll: Poll {
                row_s: 1.0 / rate_hz,
                late_s: chance.log_uniform(2e-5, 4e-4),
                // Less than any of these logs can show.
                skew_s: chance.uniform(0.0, 1e-6),
                jitter_s: chance.log_uniform(3e-6, 2e-5),
                late_reads: 0.0,
                stalls_s: (0.0, 0.0),
                counted: None,
            },
            motor: chance.uniform(0.4, 1.5) * load / (ratio * ratio),
            load,
            motor_friction: (dry, 0.5 * dry, chance.uniform(10.0, 40.0)),
            load_friction: (0.01 * drive.rated_n_m, 0.04 * stiffness / mode),
            damping: 0.01 * stiffness / mode,
            arm: arm_share * drive.rated_n_m,
            band: TAU * chance.uniform(12.0, 25.0),
            orientation_known: turned > 0,
            polls: chance.number(),
        }
    }

    /// Readings without noise.
    pub fn run(&self, drive: &Drive, unit: &Unit, hidden: &[Hides]) -> Record {
        let gear = Gear::new(drive, unit, Laws::D, hidden);
        let ratio = drive.ratio();
        let mut log = Log::new(self, &gear);
        let path: f64 =
            self.sessions.iter().map(|s| s.moves.iter().map(|(t, m)| t * m.mean_speed()).sum::<f64>()).sum();
        let mut path_done = 0.0;
        let mut start_s = 0.0;
        let mut command_rad = 0.0;
        let mut state = State::at_rest(drive, unit);
        for (number, session) in self.sessions.iter().enumerate() {
            let steps = (session.seconds / STEP_S) as usize;
            log.begin(start_s);
            let mut profile = Setpoint::default();
            let mut brake = BrakeNow::new(session.brake, drive.rated_n_m);
            let total = self.motor + self.load / (ratio * ratio);
            for at in 0..steps {
                let t = at as f64 * STEP_S;
                let speed = profile.step(session.wanted(t));
                command_rad += speed * STEP_S;
                let warm = 1.0 - (-t / session.settles_s).exp();
                let slow = 1.0 - (-t / (4.0 * session.settles_s)).exp();
                let external = brake.step(t);
                path_done += state.motor_speed.abs() * STEP_S;
                let place = Place {
                    time_s: start_s + t,
                    done: (path_done / path).min(1.0),
                    session: number,
                    generator_rad: state.generator_rad,
                    output_rad: state.output_rad,
                    torque_n_m: state.spring_n_m,
                    temperature_c: session.from_c + session.drift_c * warm,
                    housing_c: session.from_c + session.drift_c * slow,
                    orientation_rad: session.orientation_rad,
                };
                // Servo: position, and speed with an integral.
                let off = command_rad - state.generator_rad;
                let speed_off = 0.2 * self.band * off + speed - state.motor_speed;
                state.integral += 0.2 * self.band * speed_off * STEP_S;
                let motor_n_m = total * self.band * (speed_off + state.integral);
                self.step(&gear, &place, &mut state, motor_n_m, external);
                log.see(start_s + t + STEP_S, &state, &place, motor_n_m);
            }
            start_s += session.seconds + session.gap_s;
        }
        log.record
    }

    fn step(&self, gear: &Gear, place: &Place, state: &mut State, motor_n_m: f64, brake_n_m: f64) {
        let ratio = gear.drive.ratio();
        // The hub: free in the clearance, where it gives way until its friction holds the spring, or pushed by a flank.
        let before_arcsec = state.output_arcsec() - state.hub_arcsec;
        let pulls = gear.torque(before_arcsec, place) + state.slipping_n_m;
        let friction = gear.drive.friction_torque_n_m * gear.unit.friction;
        let beyond = (pulls.abs() - friction).max(0.0).copysign(pulls);
        let stiffest = gear.drive.stiffness.iter().map(|(_, k)| *k).fold(0.0, f64::max);
        let free = state.hub_arcsec + 0.9 * beyond / stiffest * ARCSEC;
        let (low, high) = gear.limits(place);
        let teeth = state.generator_rad / ratio * ARCSEC;
        let hub = free.clamp(teeth + low, teeth + high);
        // Spring and the friction parallel to it.
        let x = state.output_arcsec() - hub;
        // Between the flanks the hub has neither mass nor speed of its own, so nothing for the damper to hold on to.
        let pushed = hub != free;
        let rate = if pushed && state.pushed { (x - state.deflection_arcsec) / STEP_S } else { 0.0 };
        state.pushed = pushed;
        state.slip(gear, x);
        state.deflection_arcsec = x;
        let elastic = gear.torque(x, place) + state.slipping_n_m;
        let spring = elastic + self.damping * rate / ARCSEC;
        let hub_speed = (hub - state.hub_arcsec) / STEP_S / ARCSEC;
        let hub_friction = friction * (hub_speed / 1e-5).tanh();
        let push = if pushed { hub_friction - spring } else { 0.0 };
        let slope = 1.0 / ratio + gear.lines(state.generator_rad).1 / ARCSEC;
        state.hub_arcsec = hub;
        // Motor.
        let reaction = -push * slope;
        let (dry, at_rest, equal) = self.motor_friction;
        let before = state.motor_speed;
        let viscous = dry * before / equal;
        let driven = before + (motor_n_m + reaction - viscous) / self.motor * STEP_S;
        let dry = dry + at_rest * (-(driven / 0.5).powi(2)).exp();
        state.motor_speed = stopped(driven, dry / self.motor * STEP_S);
        state.generator_rad += state.motor_speed * STEP_S;
        // Flange and load.
        let unseen = gear.unseen(place, state.output_speed);
        let sensor = spring - unseen;
        let weight = -self.arm * (state.output_rad + place.orientation_rad).sin();
        let (dry, viscous) = self.load_friction;
        let was = state.output_speed;
        let driven = was + (-sensor + brake_n_m + weight - viscous * was) / self.load * STEP_S;
        state.output_speed = stopped(driven, dry / self.load * STEP_S);
        state.output_rad += state.output_speed * STEP_S;
        let acceleration = (state.output_speed - was) / STEP_S;
        state.spring_n_m = spring;
        // In the generator's coupling: what the teeth and half of the friction take.
        state.coupling_n_m = -reaction + 0.5 * (motor_n_m + reaction);
        let share = gear.size_of(Thing::Cause(Cause::TorsionalResonance)).map_or(0.0, |one| one.size);
        state.sensor_n_m = sensor + share * self.load * acceleration;
    }
}

impl Move {
    fn mean_speed(self) -> f64 {
        match self {
            Self::Turn(speed) => speed.abs(),
            Self::Points(speed, moves, stops) => speed * moves / (moves + stops),
            Self::Swing(speed, _) => speed * 2.0 / PI,
        }
    }
}

impl Session {
    /// Speed that the setpoint is to have, rad/s.
    fn wanted(&self, t: f64) -> f64 {
        let mut since = t;
        for (lasts, what) in &self.moves {
            if since < *lasts {
                return match *what {
                    Move::Turn(speed) => speed,
                    Move::Points(speed, moves, stops) => {
                        let cycle = since / (moves + stops);
                        let moving = cycle.fract() * (moves + stops) < moves;
                        // Two forward, one back.
                        let sense = if cycle as usize % 3 == 2 { -1.0 } else { 1.0 };
                        if moving { sense * speed } else { 0.0 }
                    }
                    Move::Swing(speed, hz) => speed * (TAU * hz * since).sin(),
                };
            }
            since -= lasts;
        }
        0.0
    }
}

/// Limits acceleration, and its change by a mean over a fiftieth of a second (an S curve).
#[derive(Default)]
struct Setpoint {
    limited: f64,
    smooth: f64,
}

impl Setpoint {
    fn step(&mut self, wanted: f64) -> f64 {
        self.limited += (wanted - self.limited).clamp(-40.0 * STEP_S, 40.0 * STEP_S);
        self.smooth += (self.limited - self.smooth) * STEP_S / 0.02;
        self.smooth
    }
}

struct BrakeNow {
    what: Brake,
    rated_n_m: f64,
    chance: Chance,
    until_s: f64,
    wanted: f64,
    now: f64,
}

impl BrakeNow {
    fn new(what: Brake, rated_n_m: f64) -> Self {
        let seed = if let Brake::Steps(seed) = what { seed } else { 0 };
        Self { what, rated_n_m, chance: Chance::new(seed, "brake", 0), until_s: 0.0, wanted: 0.0, now: 0.0 }
    }

    fn step(&mut self, t: f64) -> f64 {
        self.wanted = match self.what {
            Brake::Constant(share) => share,
            Brake::Steps(_) => {
                if t >= self.until_s {
                    self.until_s = t + self.chance.uniform(2.0, 6.0);
                    self.chance.uniform(-0.8, 0.8)
                } else {
                    self.wanted
                }
            }
            Brake::Sine(mean, amplitude, period_s) => mean + amplitude * (TAU * t / period_s).sin(),
            Brake::Ramps(period_s) => 0.8 * (4.0 * ((t / period_s).fract() - 0.5).abs() - 1.0),
        };
        self.now += (self.wanted - self.now) * STEP_S / 0.06;
        self.now * self.rated_n_m
    }
}

struct State {
    generator_rad: f64,
    motor_speed: f64,
    integral: f64,
    hub_arcsec: f64,
    pushed: bool,
    output_rad: f64,
    output_speed: f64,
    spring_n_m: f64,
    /// Part of it that slips.
    slipping_n_m: f64,
    deflection_arcsec: f64,
    /// At the torque sensor, N m.
    sensor_n_m: f64,
    coupling_n_m: f64,
}

impl State {
    fn at_rest(drive: &Drive, unit: &Unit) -> Self {
        let middle = Gear::new(drive, unit, Laws::D, &[]).lines(0.0).0;
        Self {
            generator_rad: 0.0,
            motor_speed: 0.0,
            integral: 0.0,
            hub_arcsec: middle,
            pushed: false,
            output_rad: middle / ARCSEC,
            output_speed: 0.0,
            spring_n_m: 0.0,
            slipping_n_m: 0.0,
            deflection_arcsec: 0.0,
            sensor_n_m: 0.0,
            coupling_n_m: 0.0,
        }
    }

    fn output_arcsec(&self) -> f64 {
        self.output_rad * ARCSEC
    }

    /// Solid friction parallel to the spring after Dahl (1968): it nears its limit as an exponential of the path.
    fn slip(&mut self, gear: &Gear, x: f64) {
        let Some(one) = gear.size_of(Thing::Cause(Cause::TorsionalHysteresis)) else { return };
        let stiffness = gear.drive.first_stiffness() / ARCSEC;
        let limit = one.size * stiffness;
        let path = (0.3 + 0.7 * one.shape[0]) * one.size;
        let moved = x - self.deflection_arcsec;
        let toward = limit.copysign(moved);
        self.slipping_n_m += (toward - self.slipping_n_m) * (1.0 - (-moved.abs() / path).exp());
    }
}

/// A speed less what dry friction takes in a step.
fn stopped(speed: f64, takes: f64) -> f64 {
    (speed.abs() - takes).max(0.0).copysign(speed)
}

/// The logger: reads each channel when the run passes the instant at which it polls it.
struct Log<'a> {
    gear: &'a Gear<'a>,
    poll: Poll,
    chance: Chance,
    delay_s: f64,
    current: f64,
    coupling: f64,
    coupling_play: Option<(f64, f64)>,
    floor: Option<Floor>,
    /// Instants of the next row: stamp, generator, output.
    due: [f64; 3],
    /// Readings of the row that is under way: generator, output, torque.
    row: [f64; 3],
    taken: [bool; 2],
    number: usize,
    begun_s: f64,
    stalled_s: f64,
    stamp_s: f64,
    /// The last instants with what the channels were: time, generator, output, torque.
    past: VecDeque<[f64; 4]>,
    record: Record,
}

/// A floor that swings at its own frequency, shaken at random.
struct Floor {
    size: f64,
    turn: f64,
    decay: f64,
    state: (f64, f64),
    chance: Chance,
}

impl<'a> Log<'a> {
    fn new(joint: &Joint, gear: &'a Gear<'a>) -> Self {
        let size = |thing| gear.size_of(thing).map_or(0.0, |one| one.size);
        let floor = gear.size_of(Thing::Stranger(Stranger::FloorVibration)).map(|one| Floor {
            size: one.size,
            turn: TAU * (3.0 + 6.0 * one.shape[0]) * STEP_S,
            decay: 2.0 * STEP_S,
            state: (0.0, 0.0),
            chance: Chance::new((1e9 * one.shape[1]) as u64, "floor", 0),
        });
        let play = gear.size_of(Thing::Stranger(Stranger::EncoderCouplingPlay));
        Self {
            gear,
            poll: joint.poll,
            chance: Chance::new(joint.polls, "poll", 0),
            delay_s: size(Thing::Cause(Cause::SensorLatency)),
            current: size(Thing::Stranger(Stranger::TorqueFromCurrent)),
            coupling: size(Thing::Stranger(Stranger::MotorCoupling)),
            coupling_play: play.map(|one| (one.size / ARCSEC, 0.0)),
            floor,
            due: [f64::INFINITY; 3],
            row: [0.0; 3],
            taken: [false; 2],
            number: 0,
            begun_s: 0.0,
            stalled_s: 0.0,
            stamp_s: 0.0,
            past: VecDeque::with_capacity(PAST),
            record: Record::new(joint.poll.row_s, joint.orientation_known),
        }
    }

    fn begin(&mut self, start_s: f64) {
        self.begun_s = start_s + 0.02;
        self.number = 0;
        self.stalled_s = 0.0;
        self.record.begin_session();
        self.past.clear();
        self.schedule();
    }

    fn schedule(&mut self) {
        let counted = self.number as f64 * self.poll.row_s;
        if self.number % 50 == 49 {
            self.stalled_s += self.chance.uniform(self.poll.stalls_s.0, self.poll.stalls_s.1);
        }
        let stamp = self.begun_s + counted + self.stalled_s + self.poll.late_s * self.chance.normal().abs();
        self.stamp_s = self.poll.counted.map_or(stamp, |factor| self.begun_s + factor * counted);
        let late = if self.chance.one_in(self.poll.late_reads) {
            (5e-4 * self.chance.uniform(1e-3, 1.0).powf(-0.65)).min(0.04)
        } else {
            0.0
        };
        let jitter = [self.chance.normal(), self.chance.normal()].map(|x| (self.poll.jitter_s * x).clamp(-1e-3, 1e-3));
        // Positive: the output's reading is old.
        let (generator, output) = (-(-self.delay_s).max(0.0), self.poll.skew_s + late - self.delay_s.max(0.0));
        self.due = [stamp, stamp + generator + jitter[0], stamp + output + jitter[1]];
        self.taken = [false; 2];
        self.number += 1;
    }

    fn see(&mut self, t: f64, state: &State, place: &Place, motor_n_m: f64) {
        let ratio = self.gear.drive.ratio();
        let coupling =
            self.coupling / ARCSEC * ratio.abs() * state.coupling_n_m * ratio.abs() / self.gear.drive.rated_n_m;
        let mut output = state.output_rad;
        if let Some((half, held)) = &mut self.coupling_play {
            *held = held.clamp(output - *half, output + *half);
            output = *held;
        }
        if let Some(floor) = &mut self.floor {
            let (sin, cos) = floor.turn.sin_cos();
            let (a, b) = floor.state;
            let kept = 1.0 - floor.decay;
            let kick = (2.0 * floor.decay).sqrt();
            floor.state = (kept * (a * cos - b * sin) + kick * floor.chance.normal(), kept * (a * sin + b * cos));
            output += floor.size * floor.state.0 / ARCSEC;
        }
        let torque = (1.0 - self.current) * state.sensor_n_m - self.current * motor_n_m * ratio;
        if self.past.len() == PAST {
            self.past.pop_front();
        }
        self.past.push_back([t, state.generator_rad + coupling, output, torque]);
        if !self.taken[0] && self.due[1] <= t {
            self.row[0] = self.gear.generator_reading(self.at(self.due[1], 1));
            self.row[2] = self.at(self.due[1], 3);
            self.taken[0] = true;
        }
        if !self.taken[1] && self.due[2] <= t {
            self.row[1] = self.gear.output_reading(self.at(self.due[2], 2));
            self.taken[1] = true;
        }
        if self.taken == [true; 2] {
            self.record.push(&Row {
                time_s: self.stamp_s,
                generator_rad: self.at(self.due[0], 1),
                speed_rad_s: state.motor_speed,
                torque_n_m: self.row[2],
                temperature_c: place.temperature_c,
                orientation_rad: place.orientation_rad,
            });
            self.record.generator_read_rad.push(self.row[0]);
            self.record.output_read_rad.push(self.row[1]);
            self.schedule();
        }
    }

    /// Value of a channel at an instant.
    fn at(&self, time_s: f64, channel: usize) -> f64 {
        let newest = self.past.len() - 1;
        let back = ((self.past[newest][0] - time_s) / STEP_S).clamp(0.0, newest as f64);
        let (whole, part) = (back as usize, back.fract());
        let (later, earlier) =
            (self.past[newest - whole][channel], self.past[newest.saturating_sub(whole + 1)][channel]);
        later + part * (earlier - later)
    }
}
