//! Family V, variants: to learn how far the textbook's form of a cause is from what real units do. Each cause has three
//! to seven physical forms, none of them the plainest, with numbers drawn over wide ranges. Form and numbers are in the
//! truth. It examines nothing: what is learnt from it must not be judged by it.
//!
//! A bench whose generator follows exactly, so that all that a log shows of a form is the form.

pub mod clearance;
pub mod form;
pub mod loads;
pub mod readings;
pub mod spring;
pub mod wheels;

use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::{Drive, Unit};
use crate::hides::{Hides, Thing};
use crate::record::Record;
use crate::train::{self, Adds, Laws, Memory, Now, Pace, Session, eased, stairs};
use form::{Form, Numbers, Setting};
use std::f64::consts::{PI, TAU};

const STEP_S: f64 = 1e-3;
/// Names of the ways in which two zones share the load.
const SHARINGS: [&str; 4] = ["springs", "exponential", "hertz", "arctangent"];

#[derive(Debug, Clone)]
pub struct Variant {
    pub pace: Pace,
    /// About as many in all sessions.
    pub rows: usize,
    /// How two zones share, of [`SHARINGS`].
    sharing: usize,
    sessions: usize,
    /// Natural frequency of the load on the spring.
    load_hz: f64,
}

/// Part of a session.
#[derive(Debug, Clone, Copy)]
enum Part {
    /// On at one speed, for about an output turn.
    Around,
    /// Back and forth so slowly that rows sample the mesh of the teeth.
    Creep,
    /// Moves with stops, the load moves through zero at rest.
    Points,
    /// Sines of rising frequency, steps of the load.
    Scan,
    /// Both senses at several speeds.
    Cruise,
}

/// Makes a form by its name, and draws its numbers.
type Make = fn(Cause, &'static str, &mut Numbers, &Setting) -> Form;

/// Names of the forms of a cause, and what makes them.
fn kinds(cause: Cause) -> (&'static [&'static str], Make) {
    use Cause as C;
    match cause {
        C::CircularSplineEccentricity | C::FlexsplineRunout | C::GravitySideLoad => {
            (wheels::DISPLACED, |cause, name, n, _| wheels::displaced(cause, name, n))
        }
        C::CircularSplineOvality => (wheels::OVAL, |_, name, n, _| wheels::oval(name, n)),
        C::FlexsplinePitchError | C::CircularSplinePitchError => {
            (wheels::PITCH, |cause, name, n, _| wheels::pitch(cause, name, n))
        }
        C::GeneratorEccentricity => (wheels::LOBES, |_, name, n, _| wheels::lobes(name, n)),
        C::CamFormError => (wheels::CAM, |_, name, n, setting| wheels::cam(name, n, setting)),
        C::DamagedTooth => (wheels::TOOTH, |_, name, n, _| wheels::tooth(name, n)),
        C::BacklashGrowth => (clearance::GROWTH, |_, name, n, _| clearance::growth(name, n)),
        C::Wear => (clearance::WEAR, |_, name, n, setting| clearance::wear(name, n, setting)),
        C::ThermalClearance => (clearance::HEAT, |_, name, n, _| clearance::heat(name, n)),
        C::Ratcheting => (clearance::RATCHETING, |_, name, n, setting| clearance::ratcheting(name, n, setting)),
        C::StiffnessHardening => (spring::HARDENING, |_, name, n, _| spring::hardening(name, n)),
        C::StiffnessError => (spring::SOFT, |_, name, n, setting| spring::soft(name, n, setting)),
        C::TorsionalHysteresis => (spring::HYSTERESIS, |_, name, n, setting| spring::hysteresis(name, n, setting)),
        C::ThermalStiffness => (spring::HEAT, |_, name, n, setting| spring::heat(name, n, setting)),
        C::LubricantViscosity => (loads::DRAG, |_, name, n, setting| loads::drag(name, n, setting)),
        C::GravityTorque => (loads::ARM, |_, name, n, _| loads::arm(name, n)),
        C::TorsionalResonance => (loads::RESONANCE, |_, name, n, _| loads::resonance(name, n)),
        C::OutputEncoderEccentricity | C::GeneratorEncoderEccentricity => {
            (readings::DISC, |cause, name, n, _| readings::disc(cause, name, n))
        }
        C::SensorLatency => (readings::LATENCY, |_, name, n, _| readings::latency(name, n)),
        C::RatioError => (readings::RATIO, |_, name, n, setting| readings::ratio(name, n, setting)),
    }
}

pub fn forms(cause: Cause) -> &'static [&'static str] {
    kinds(cause).0
}

pub fn name_of(cause: Cause, one: &Hides) -> &'static str {
    forms(cause)[one.shape[3] as usize]
}

/// The form of what is hidden. Its numbers follow from the first three of its shape.
fn form_of(one: &Hides, setting: &Setting) -> Form {
    let Thing::Cause(cause) = one.thing else { unreachable!("variants hide causes alone") };
    let mut numbers = Numbers::of(one);
    let form = kinds(cause).1(cause, name_of(cause, one), &mut numbers, setting);
    Form { numbers: numbers.drawn(), ..form }
}

/// The bench with the forms that are hidden on it.
struct Bound<'a> {
    bench: &'a Variant,
    ratio: f64,
    rated_n_m: f64,
    forms: Vec<(Thing, Form)>,
}

impl Bound<'_> {
    fn form(&self, one: &Hides) -> Option<&Form> {
        self.forms.iter().find(|(thing, _)| *thing == one.thing).map(|(_, form)| form)
    }
}

impl Laws for Bound<'_> {
    fn alone(&self, over: f64) -> f64 {
        match SHARINGS[self.bench.sharing] {
            "springs" => (1.0 - over).max(0.0),
            "exponential" => (-1.3 * over).exp(),
            // The second zone has come nearer by over to the power 2/3, as points of contact do.
            "hertz" => (1.0 - over.powf(2.0 / 3.0)).max(0.0),
            _ => 1.0 - 2.0 / PI * (1.6 * over).atan(),
        }
    }

    fn add(&self, one: &Hides, now: &Now, memory: &mut Memory, to: &mut Adds) {
        if let Some(form) = self.form(one) {
            (form.add)(one.size, now, memory, to);
        }
    }

    fn wind_up(&self, one: &Hides, own: f64, torque_n_m: f64, now: &Now, memory: &mut Memory) -> f64 {
        self.form(one).map_or(0.0, |form| (form.wind_up)(one.size, own, torque_n_m / self.rated_n_m, now, memory))
    }

    fn turn(&self, wanted: [f64; 2], state: &mut [f64; 2], _load: f64, _step_s: f64) {
        *state = wanted;
    }

    /// The damper turns with the drive: no torque of steady motion.
    fn load_n_m(&self, session: &Session, at: usize, now: &Now) -> f64 {
        session.load_n_m[at] + session.inertia_kg_m2 * self.bench.pace.damping_rad_s * now.speed_rad_s / self.ratio
    }
}

impl Variant {
    pub fn draw(chance: &mut Chance) -> Self {
        let load_hz = chance.uniform(14.0, 26.0);
        let stride = *chance.of(&[16, 20, 25]);
        Self {
            pace: Pace {
                step_s: STEP_S,
                stride,
                jitter_s: chance.log_uniform(2e-6, 2e-5),
                damping_rad_s: 2.0 * chance.uniform(0.05, 0.12) * TAU * load_hz,
                lags_s: [chance.log_uniform(8.0, 40.0), chance.log_uniform(60.0, 300.0)],
                seed: chance.number(),
                orientation_known: true,
            },
            rows: (chance.log_uniform(9_000.0, 17_000.0) * 20.0 / stride as f64).clamp(8_500.0, 19_000.0) as usize,
            sharing: chance.below(SHARINGS.len()),
            sessions: 3 + chance.below(4),
            load_hz,
        }
    }

    pub fn sharing(&self) -> &'static str {
        SHARINGS[self.sharing]
    }

    pub fn numbers(&self, drive: &Drive, one: &Hides) -> Vec<(&'static str, f64)> {
        form_of(one, &Setting::of(drive, 1.0)).numbers
    }

    pub fn run(&self, drive: &Drive, unit: &Unit, hidden: &[Hides]) -> Record {
        let sessions = self.plan(drive, unit);
        let way = sessions.iter().flat_map(|session| &session.speed_rad_s).map(|v| v.abs() * STEP_S).sum();
        let setting = Setting::of(drive, way);
        let forms = hidden.iter().map(|one| (one.thing, form_of(one, &setting))).collect();
        let bound = Bound { bench: self, ratio: drive.ratio(), rated_n_m: drive.rated_n_m, forms };
        train::run(&bound, drive, unit, hidden, &sessions, &self.pace)
    }

    fn plan(&self, drive: &Drive, unit: &Unit) -> Vec<Session> {
        let mut chance = Chance::new(self.pace.seed, "variant sessions", 0);
        let chance = &mut chance;
        let steps = self.rows / self.sessions * self.pace.stride;
        // Every part at least once; each session begins with one and ends with another.
        let mut parts = vec![Part::Around, Part::Creep, Part::Points, Part::Scan, Part::Cruise, Part::Around];
        let more = [Part::Around, Part::Creep, Part::Points, Part::Scan, Part::Cruise];
        parts.extend((parts.len()..2 * self.sessions).map(|_| *chance.of(&more)));
        chance.shuffle(&mut parts);
        let mut warmth: Vec<usize> = (0..self.sessions).collect();
        chance.shuffle(&mut warmth);
        let mut turned = vec![0.0, PI / 2.0, chance.uniform(0.3, 1.2), -PI / 2.0, chance.uniform(1.8, 2.9), PI];
        chance.shuffle(&mut turned);
        let inertia_kg_m2 = drive.first_stiffness() * unit.stiffness / (TAU * self.load_hz).powi(2);
        let mut sense = chance.sign();
        let pairs = parts.chunks(2).zip(&warmth).zip(&turned);
        pairs
            .map(|((pair, warm), turned)| {
                let (mut speed, mut load) = (Vec::new(), Vec::new());
                for (at, part) in pair.iter().enumerate() {
                    let count = if at == 0 { steps / 2 } else { steps - steps / 2 };
                    sense = -sense;
                    part.fill(count, sense, chance, &mut speed, &mut load);
                }
                let base = -18.0 + 62.0 * (*warm as f64 + chance.uniform(0.1, 0.9)) / self.sessions as f64;
                let drift = chance.sign() * chance.uniform(5.0, 12.0);
                let bend = chance.uniform(0.6, 1.6);
                let over = |at: usize| at as f64 / steps as f64;
                Session {
                    pause_s: chance.log_uniform(120.0, 5400.0),
                    away_rad: chance.uniform(-0.25, 0.25) * TAU * drive.ratio().abs(),
                    speed_rad_s: eased(speed.into_iter(), 300.0, 0.02, STEP_S),
                    load_n_m: load.iter().map(|x| x * drive.rated_n_m).collect(),
                    column_c: (0..steps).map(|at| base + drift * (bend * PI * over(at)).sin()).collect(),
                    orientation_rad: *turned,
                    hung: (0.0, 0.0),
                    inertia_kg_m2,
                }
            })
            .collect()
    }
}

impl Part {
    /// Appends wanted speeds (rad/s) and loads (of the rated torque).
    fn fill(self, count: usize, sense: f64, chance: &mut Chance, speed: &mut Vec<f64>, load: &mut Vec<f64>) {
        let t = |at: usize| at as f64 * STEP_S;
        let end = t(count);
        // Nothing moves in the first and last second of a part.
        let rests = move |s: f64| s < 1.0 || s > end - 1.0;
        let most = chance.uniform(0.6, 0.95);
        let phase = chance.phase();
        match self {
            Self::Around => {
                let fast = sense * chance.log_uniform(12.0, 30.0);
                speed.extend((0..count).map(|at| if rests(t(at)) { 0.0 } else { fast }));
                load.extend(stairs(count, STEP_S, (1.5, 5.0), 0.8, chance).iter().map(|x| most * x));
            }
            Self::Creep => {
                let slow = chance.log_uniform(0.2, 0.6);
                let turns_s = chance.uniform(4.0, 8.0);
                speed.extend((0..count).map(|at| {
                    let s = t(at);
                    if rests(s) {
                        0.0
                    } else {
                        sense * slow * if (s / turns_s).rem_euclid(2.0) < 1.0 { 1.0 } else { -0.7 }
                    }
                }));
                let slowly = TAU * chance.uniform(0.08, 0.16);
                load.extend((0..count).map(|at| most * (slowly * t(at) + phase).sin()));
            }
            Self::Points => {
                let mut wishes = Vec::with_capacity(count);
                // A move and a stay are no shorter than a second and a half.
                for _ in 0..=(count as f64 * STEP_S / 1.5) as usize {
                    let (moves, stays) = (chance.uniform(0.5, 1.5), chance.uniform(1.0, 3.0));
                    let fast = chance.sign() * chance.log_uniform(4.0, 20.0);
                    let steps = |seconds: f64| (seconds / STEP_S) as usize;
                    wishes.extend(std::iter::repeat_n(0.0, steps(stays)));
                    wishes.extend(std::iter::repeat_n(fast, steps(moves)));
                }
                speed.extend(
                    wishes.into_iter().take(count).enumerate().map(|(at, v)| if rests(t(at)) { 0.0 } else { v }),
                );
                let period = chance.uniform(3.0, 7.0);
                load.extend((0..count).map(|at| most * 2.0 / PI * (TAU * t(at) / period + phase).sin().asin()));
            }
            Self::Scan => {
                let (low, high) = (chance.uniform(0.2, 0.5), chance.uniform(4.0, 8.0));
                let swing = chance.log_uniform(6.0, 20.0);
                speed.extend((0..count).map(|at| {
                    let s = t(at);
                    let share = s / end;
                    // Phase of a frequency that rises from low to high as the square of time.
                    let turns = low * s + (high - low) * share * share * s / 3.0;
                    if rests(s) {
                        0.0
                    } else {
                        swing * (TAU * turns).sin() / (1.0 + 0.3 * (low + high * share * share))
                    }
                }));
                load.extend(stairs(count, STEP_S, (0.6, 2.0), 0.08, chance).iter().map(|x| most * x));
            }
            Self::Cruise => {
                let speeds = stairs(count, STEP_S, (2.0, 4.0), 0.1, chance);
                speed.extend(speeds.iter().enumerate().map(|(at, v)| {
                    // A square, so that slow speeds are as common as fast ones.
                    if rests(t(at)) { 0.0 } else { 26.0 * v * v.abs() }
                }));
                let slowly = TAU * chance.uniform(0.1, 0.3);
                load.extend((0..count).map(|at| most * (slowly * t(at) + phase).sin()));
            }
        }
    }
}
