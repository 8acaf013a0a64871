//! Families D to H, variants, and perfect drives under faults of the logger: plants of their own that share nothing
//! with families A to C but the catalogue's drive, the noise of the sensors and the scores.

pub mod arm;
pub mod gear;
pub mod gimbal;
pub mod hides;
pub mod joint;
pub mod logger;
pub mod metrology;
pub mod oracle;
pub mod rig;
pub mod train;
pub mod variants;

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::case::{Draw, Kind, Plant};
use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::{Drive, Fixed, Unit};
use crate::effect::Family;
use crate::motion::Motion;
use crate::noise::{Sensors, csv};
use crate::plant::Readings;
use crate::truth::{Hidden, Truth, rounded};
use arm::Arm;
use gimbal::Gimbal;
use hides::{Hides, Stranger, Thing};
use joint::Joint;
use logger::LoggerFault;
use metrology::Metrology;
use oracle::{Oracle, residual};
use rig::Rig;
use variants::Variant;

/// What the drive stands on.
#[derive(Debug, Clone)]
pub enum Stand {
    /// Family D.
    Joint(Joint),
    /// Family E.
    Bench(Metrology),
    /// Family F.
    Rig(Rig),
    /// Family G.
    Gimbal(Gimbal),
    /// Family H.
    Arm(Arm),
    /// Family V.
    Variant(Variant),
}

impl Stand {
    /// Readings without noise, with these effects.
    fn run(&self, drive: &Drive, unit: &Unit, hidden: &[Hides]) -> (Motion, Readings) {
        match self {
            Self::Joint(joint) => joint.run(drive, unit, hidden),
            Self::Bench(bench) => bench.run(drive, unit, hidden),
            Self::Rig(rig) => rig.run(drive, unit, hidden),
            Self::Gimbal(gimbal) => gimbal.run(drive, unit, hidden),
            Self::Arm(arm) => arm.run(drive, unit, hidden),
            Self::Variant(variant) => variant.run(drive, unit, hidden),
        }
    }

    /// Whether it is one of those that march in time as `train` does.
    fn marches(&self) -> bool {
        matches!(self, Self::Gimbal(_) | Self::Arm(_) | Self::Variant(_))
    }
}

/// A case of families D to H or V, or a perfect drive under a fault of the logger.
#[derive(Debug, Clone)]
pub struct Fresh {
    seed: u64,
    index: u64,
    kind: Kind,
    /// Catalogue.
    pub drive: Drive,
    /// On the bench.
    pub unit: Unit,
    stand: Stand,
    sensors: Sensors,
    /// What is hidden.
    pub hidden: Vec<Hides>,
    fault: Option<LoggerFault>,
    weighed: Vec<Hidden>,
    removable_rms_arcsec: f64,
    floor_arcsec: f64,
}

/// So many times over the limit of detection an effect is aimed at, at least and at most; what comes out at less than
/// the third is drawn anew.
const AIM: (f64, f64, f64) = (2.0, 15.0, 1.3);
/// Draws of a case before one that is too small is taken as it is; it then counts as below the limit.
const DRAWS: u64 = 12;
const BLOCK: u64 = 10;
/// The same of variants: large causes show best how far a form is from the textbook's.
const AIM_OF_VARIANTS: (f64, f64, f64) = (4.0, 30.0, 2.6);

impl Fresh {
    /// Draws the case of this seed and index.
    pub fn draw(seed: u64, index: u64, draw: &Draw) -> Self {
        for attempt in 0.. {
            let case = Self::attempt(seed, index, attempt, draw);
            let least = case.aim().2;
            if attempt + 1 == DRAWS || case.weighed.iter().all(|one| one.over_limit >= least) {
                return case;
            }
        }
        unreachable!("the last draw is taken")
    }

    fn attempt(seed: u64, index: u64, attempt: u64, draw: &Draw) -> Self {
        let plant = if draw.kind == Some(Kind::Logger) { Plant::D } else { draw.family.unwrap_or(Plant::D) };
        let mut chance = Chance::new(seed, "fresh", index * DRAWS + attempt);
        let (kind, things, fault) = plan(seed, index, plant, draw, &mut chance);
        let drive = Drive::draw(&mut chance);
        let perfect = kind == Kind::Logger;
        let unit = if perfect { Unit::nominal(&drive) } else { Unit::draw(&drive, Family::A, &mut chance) };
        let mut sensors = Sensors::draw(&drive, &mut chance);
        let stand = if plant == Plant::E {
            // A collimator reads finer than an encoder and drifts with the room.
            sensors.white_arcsec *= 0.4;
            sensors.wander_arcsec = chance.uniform(0.2, 0.8);
            sensors.wander_s = chance.log_uniform(60.0, 600.0);
            sensors.output_step_rad = std::f64::consts::TAU / f64::from(1 << 24);
            Stand::Bench(Metrology::draw(&drive, &things, &mut chance))
        } else if plant == Plant::F {
            // Counts: 15 to 17 bit in a turn of the motor, 19 to 22 bit of the output.
            sensors.white_arcsec *= 0.5;
            sensors.wander_arcsec *= 0.5;
            let step = |bits: usize| std::f64::consts::TAU / f64::from(1 << bits);
            sensors.generator_step_rad = step(15 + chance.below(3));
            sensors.output_step_rad = step(19 + chance.below(4));
            Stand::Rig(Rig::draw(&drive, &mut chance))
        } else if plant == Plant::G {
            sensors.white_arcsec *= 0.7;
            Stand::Gimbal(Gimbal::draw(&drive, &mut chance))
        } else if plant == Plant::H {
            sensors.white_arcsec *= 0.6;
            sensors.wander_arcsec *= 0.6;
            Stand::Arm(Arm::draw(&drive, &mut chance))
        } else if plant == Plant::V {
            sensors.white_arcsec *= 0.7;
            sensors.wander_arcsec *= 0.7;
            Stand::Variant(Variant::draw(&mut chance))
        } else {
            let mut joint = Joint::draw(&drive, &mut chance);
            if let Some(fault) = fault {
                joint = joint.polled(fault.poll(joint.poll, &mut chance));
            }
            Stand::Joint(joint)
        };
        let mut case = Self {
            seed,
            index,
            kind,
            drive,
            unit,
            stand,
            sensors,
            hidden: Vec::new(),
            fault,
            weighed: Vec::new(),
            removable_rms_arcsec: 0.0,
            floor_arcsec: 0.0,
        };
        case.hide(things, &mut chance);
        case
    }

    /// Sizes what is hidden through the oracle, and weighs it.
    fn hide(&mut self, things: Vec<Thing>, chance: &mut Chance) {
        let (motion, readings) = self.run(&[]);
        let jitter_s = match &self.stand {
            Stand::Joint(joint) => Some(joint.poll.jitter_s),
            Stand::Rig(rig) => Some(rig.jitter_s),
            Stand::Gimbal(Gimbal { pace, .. }) | Stand::Arm(Arm { pace, .. }) => Some(pace.jitter_s),
            Stand::Variant(variant) => Some(variant.pace.jitter_s),
            Stand::Bench(_) => None,
        };
        let zeroed = matches!(&self.stand, Stand::Bench(bench) if bench.zeroed || bench.restarted);
        let oracle = Oracle::new(&self.drive, &self.unit, &motion, &readings, &self.sensors, jitter_s, zeroed);
        self.floor_arcsec = oracle.floor_arcsec.hypot(self.sensors.wander_arcsec);
        let clean = residual(&self.drive, &motion, &readings);
        let left = |hidden: &[Hides]| {
            let (motion, readings) = self.run(hidden);
            residual(&self.drive, &motion, &readings)
        };
        let white = self.sensors.white_arcsec;
        let mut hidden = Vec::new();
        let mut far = chance.one_in(0.5);
        for thing in things {
            let mut one = Hides::draw(thing, &self.drive, chance);
            if self.has_distance() {
                one.shape[3] = if far { chance.uniform(0.7, 1.0) } else { chance.uniform(0.0, 0.3) };
                far = !far;
            }
            if let (Stand::Variant(_), Thing::Cause(cause)) = (&self.stand, thing) {
                one.shape[3] = chance.below(variants::forms(cause).len()) as f64;
            }
            let aim = self.aim();
            let target = chance.log_uniform(aim.0, aim.1);
            // A whole tooth, or nothing.
            let whole = self.stand.marches() && thing == Thing::Cause(Cause::Ratcheting);
            for _ in 0..if whole { 0 } else { 4 } {
                let added = oracle.added(&left(std::slice::from_ref(&one)), &clean);
                let over = oracle.weigh(&added).over_limit(white);
                if (0.8..1.25).contains(&(over / target)) {
                    break;
                }
                one = one.sized(one.size * (target / over.max(1e-3)).clamp(0.02, 50.0), &self.drive);
            }
            hidden.push(one);
        }
        let all = if hidden.is_empty() { clean.clone() } else { left(&hidden) };
        let mut weighed = Vec::new();
        for (at, one) in hidden.iter().enumerate() {
            let mut rest = hidden.clone();
            rest.remove(at);
            let without = if rest.is_empty() { clean.clone() } else { left(&rest) };
            let added = oracle.added(&all, &without);
            let weight = oracle.weigh(&added);
            let over_limit = weight.over_limit(white);
            let own = if let Thing::Cause(cause) = one.thing { Some(cause) } else { None };
            let mut like = if over_limit >= 1.0 { oracle.look_alikes(&added, own, white) } else { Vec::new() };
            let same = own.filter(|_| over_limit >= 1.0 && self.stand.marches());
            let same = same.and_then(|cause| same_axis(cause, self.drive.fixed, &motion.orientation_rad));
            if let Some(same) = same.filter(|same| like.iter().all(|(cause, _)| cause != same)) {
                like.push((same, 0.0));
            }
            let last = match &self.stand {
                Stand::Gimbal(_) | Stand::Arm(_) => "distance",
                Stand::Variant(_) => "form",
                _ => "shape_4",
            };
            let names = ["shape_1", "shape_2", "shape_3", last];
            let mut numbers: BTreeMap<String, f64> =
                names.iter().zip(one.shape).map(|(name, value)| ((*name).to_owned(), value)).collect();
            numbers.insert(one.unit().to_owned(), one.size);
            if let Stand::Variant(variant) = &self.stand {
                let drawn = variant.numbers(&self.drive, one).into_iter();
                numbers.extend(drawn.map(|(name, value)| (name.to_owned(), value)));
            }
            weighed.push(Hidden {
                name: one.thing.name().to_owned(),
                numbers,
                rms_arcsec: rounded(weight.rms_arcsec),
                d: rounded(weight.d),
                over_limit: rounded(over_limit),
                look_alikes: like.into_iter().map(|(cause, d)| (cause.name().to_owned(), rounded(d))).collect(),
                parameters: self.parameters(one),
            });
        }
        if !hidden.is_empty() {
            self.removable_rms_arcsec = oracle.weigh(&oracle.added(&all, &clean)).rms_arcsec;
        }
        (self.hidden, self.weighed) = (hidden, weighed);
    }

    /// So many times over the limit of detection an effect is aimed at, at least and at most, and drawn anew below.
    fn aim(&self) -> (f64, f64, f64) {
        if matches!(self.stand, Stand::Variant(_)) { AIM_OF_VARIANTS } else { AIM }
    }

    /// Whether the fourth number of a law is its distance from the textbook: near in half of what is hidden, far in the
    /// other.
    fn has_distance(&self) -> bool {
        matches!(self.stand, Stand::Gimbal(_) | Stand::Arm(_))
    }

    fn parameters(&self, one: &Hides) -> BTreeMap<String, f64> {
        let Thing::Cause(cause) = one.thing else { return BTreeMap::new() };
        // Far from the textbook a size has more than one reading.
        let far = self.has_distance() && (one.shape[3] > 0.5 || cause == Cause::RatioError);
        if far || matches!(self.stand, Stand::Variant(_)) {
            return BTreeMap::new();
        }
        let joint = !matches!(self.stand, Stand::Bench(_));
        let named = match cause {
            Cause::StiffnessError => Some(("stiffness_ratio", self.unit.stiffness * (1.0 + one.size))),
            Cause::BacklashGrowth if joint => {
                Some(("growth_arcsec", one.size + (self.unit.backlash - 1.0) * self.drive.backlash_arcsec))
            }
            Cause::SensorLatency => Some(("delay_s", one.size)),
            Cause::OutputEncoderEccentricity | Cause::GeneratorEncoderEccentricity => {
                Some(("amplitude_arcsec", one.size))
            }
            Cause::RatioError => Some(("ratio_relative_error", one.size)),
            Cause::GravityTorque => Some(("torque_n_m", one.size)),
            Cause::ThermalStiffness if joint => Some(("stiffness_relative_per_k", one.size)),
            _ => None,
        };
        named.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }

    /// Readings without noise, with these effects.
    pub fn run(&self, hidden: &[Hides]) -> (Motion, Readings) {
        self.stand.run(&self.drive, &self.unit, hidden)
    }

    /// `data.csv`.
    pub fn data(&self) -> String {
        let mut chance = Chance::new(self.seed, "fresh noise", self.index);
        let (motion, mut readings) = self.run(&self.hidden);
        let offset = self.unit.offset_arcsec / crate::ARCSEC;
        readings.output_rad.iter_mut().for_each(|out| *out += offset);
        if let Stand::Bench(bench) = &self.stand {
            let mut session = 0;
            let shifts = bench.shifts();
            for at in 0..motion.time_s.len() {
                if motion.session_start.get(session + 1) == Some(&at) {
                    session += 1;
                }
                readings.output_rad[at] += shifts[session].0;
                readings.generator_rad[at] -= shifts[session].1;
            }
        }
        let mut rows = self.sensors.rows(&motion, &readings, &mut chance);
        if let Some(fault) = self.fault {
            fault.spoil(&mut rows, &motion.session_start, &self.drive, &mut chance);
        }
        csv(&rows, motion.orientation_known)
    }

    /// `nominal.toml`.
    pub fn nominal_toml(&self) -> String {
        self.fault.map_or(self.drive.clone(), |fault| fault.told(&self.drive)).nominal_toml()
    }

    /// Residual of the catalogue's model without noise, that of the unit alone, and what each hidden effect adds: for
    /// plots.
    pub fn parts(&self) -> String {
        let left = |hidden: &[Hides]| {
            let (motion, readings) = self.run(hidden);
            residual(&self.drive, &motion, &readings)
        };
        let (motion, readings) = self.run(&self.hidden);
        let (all, unit) = (residual(&self.drive, &motion, &readings), left(&[]));
        let mut header =
            String::from("time_s,generator_rad,output_rad,torque_n_m,temperature_c,residual_arcsec,unit_arcsec");
        let mut added = Vec::new();
        for (at, one) in self.hidden.iter().enumerate() {
            let _ = write!(header, ",{}", one.thing.name());
            let mut rest = self.hidden.clone();
            rest.remove(at);
            added.push(left(&rest));
        }
        let mut text = header + "\n";
        for at in 0..all.len() {
            let _ = write!(
                text,
                "{:.5},{:.7},{:.9},{:.4},{:.2},{:.4},{:.4}",
                motion.time_s[at],
                readings.generator_rad[at],
                readings.output_rad[at],
                motion.torque_n_m[at],
                motion.temperature_c[at],
                all[at],
                unit[at]
            );
            for without in &added {
                let _ = write!(text, ",{:.4}", all[at] - without[at]);
            }
            text.push('\n');
        }
        text
    }

    /// The case, told.
    pub fn truth(&self, name: String) -> Truth {
        let mut hidden = self.weighed.clone();
        if let Some(fault) = self.fault {
            let told = fault.told_by().iter().map(|name| ((*name).to_owned(), 0.0)).collect();
            let over_limit = f64::from(u8::from(fault.is_to_be_told()));
            hidden.push(Hidden { name: fault.name().to_owned(), over_limit, look_alikes: told, ..Hidden::default() });
        }
        let (motion, _) = self.run(&[]);
        let mut bench = Vec::new();
        if let Stand::Bench(stand) = &self.stand {
            let told = [(stand.zeroed, "zeroed"), (stand.restarted, "counter_restarted"), (stand.chamber, "chamber")];
            bench.extend(told.into_iter().filter(|(there, _)| *there).map(|(_, name)| name.to_owned()));
        }
        if let Stand::Variant(variant) = &self.stand {
            let causes = self.hidden.iter().filter_map(|one| match one.thing {
                Thing::Cause(cause) => Some(format!("{}/{}", cause.name(), variants::name_of(cause, one))),
                Thing::Stranger(_) => None,
            });
            bench.extend(causes);
            if !self.hidden.is_empty() {
                bench.push(format!("zones/{}", variant.sharing()));
            }
        }
        let told_family = match (&self.stand, self.kind) {
            (_, Kind::Logger) => "logger",
            (Stand::Joint(_), _) => "D",
            (Stand::Bench(_), _) => "E",
            (Stand::Rig(_), _) => "F",
            (Stand::Gimbal(_), _) => "G",
            (Stand::Arm(_), _) => "H",
            (Stand::Variant(_), _) => "V",
        };
        Truth {
            name,
            seed: self.seed,
            index: self.index,
            kind: self.kind.name().to_owned(),
            family: told_family.to_owned(),
            poor: Vec::new(),
            bench,
            hidden,
            removable_rms_arcsec: rounded(self.removable_rms_arcsec),
            floor_arcsec: rounded(self.floor_arcsec),
            white_arcsec: rounded(self.sensors.white_arcsec),
            turns: rounded(motion.turns()),
        }
    }
}

/// What a displaced axis cannot be told from while the housing never turns: gravity holds it in the housing, as the
/// wheel does that the housing holds. The oracle's linear span does not see it where zones share by a law of their own.
fn same_axis(cause: Cause, fixed: Fixed, orientation_rad: &[f64]) -> Option<Cause> {
    let held = if fixed == Fixed::Flexspline { Cause::FlexsplineRunout } else { Cause::CircularSplineEccentricity };
    // Half a turn brings the one zone to the place of the other.
    let turned = orientation_rad.iter().any(|angle| (angle - orientation_rad[0]).sin().abs() > 0.05);
    match cause {
        _ if turned => None,
        Cause::GravitySideLoad => Some(held),
        _ if cause == held => Some(Cause::GravitySideLoad),
        _ => None,
    }
}

/// Kind of the case, what is hidden, and the fault of the logger.
fn plan(
    seed: u64,
    index: u64,
    plant: Plant,
    draw: &Draw,
    chance: &mut Chance,
) -> (Kind, Vec<Thing>, Option<LoggerFault>) {
    if draw.kind == Some(Kind::Logger) {
        let all = LoggerFault::ALL;
        let fault = draw.fault.unwrap_or(all[(index % all.len() as u64) as usize]);
        return (Kind::Logger, Vec::new(), Some(fault));
    }
    let (causes, strangers) = match plant {
        Plant::E => (hides::OF_BENCHES, Stranger::OF_BENCHES),
        Plant::F => (Cause::ALL, Stranger::OF_RIGS),
        Plant::G => (Cause::ALL, gimbal::STRANGERS),
        Plant::H => (Cause::ALL, arm::STRANGERS),
        _ => (Cause::ALL, Stranger::OF_JOINTS),
    };
    let mut kinds = [Kind::Single; BLOCK as usize];
    if plant == Plant::V {
        kinds[0] = Kind::Null;
    } else {
        kinds[..2].fill(Kind::Null);
        kinds[2..4].fill(Kind::Outside);
        kinds[4] = Kind::Compound;
    }
    if matches!(plant, Plant::G | Plant::H) {
        kinds[5] = Kind::Compound;
    }
    let (block, place) = (index / BLOCK, (index % BLOCK) as usize);
    Chance::new(seed, "fresh kinds", block).shuffle(&mut kinds);
    let mut kind = kinds[place];
    let in_block = kinds.iter().filter(|other| **other == kind).count() as u64;
    let mut number = block * in_block + kinds[..place].iter().filter(|other| **other == kind).count() as u64;
    if let Some(only) = draw.kind.or(draw.cause.map(|_| Kind::Single)) {
        (kind, number) = (only, index);
    }
    let in_turn = |count: usize, purpose: &str| {
        let mut order: Vec<usize> = (0..count).collect();
        Chance::new(seed, purpose, number / count as u64).shuffle(&mut order);
        order[(number % count as u64) as usize]
    };
    let things = match kind {
        Kind::Single => {
            vec![Thing::Cause(draw.cause.unwrap_or_else(|| causes[in_turn(causes.len(), "fresh singles")]))]
        }
        Kind::Outside => vec![Thing::Stranger(strangers[in_turn(strangers.len(), "fresh outside")])],
        Kind::Compound => {
            let mut all = causes.to_vec();
            chance.shuffle(&mut all);
            all.into_iter().take(2).map(Thing::Cause).collect()
        }
        Kind::Null | Kind::Fault | Kind::Logger => Vec::new(),
    };
    (kind, things, None)
}

#[cfg(test)]
mod tests;
