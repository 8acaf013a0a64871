//! Cases: what is hidden where, in which size, and what an oracle could know of it. A seed and an index are one case.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use clap::ValueEnum;

use crate::ARCSEC;
use crate::arm::{self, Arm};
use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::{Drive, Fixed, Unit};
use crate::gimbal::{self, Gimbal};
use crate::hides::{self, Hides, Stranger, Thing};
use crate::joint::Joint;
use crate::logger::LoggerFault;
use crate::metrology::Metrology;
use crate::noise::{Sensors, csv};
use crate::oracle::{Oracle, residual};
use crate::record::Record;
use crate::truth::{Hidden, Truth, rounded};

/// Contents of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// Nothing.
    Null,
    /// One cause.
    Single,
    /// Two causes.
    Compound,
    /// An effect that is no cause of the contract.
    Outside,
    /// A fault of the logger on a perfect drive: drawn only when asked for.
    Logger,
}

/// Whose plant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Family {
    /// A joint in motion: inertia, servo, polled encoders.
    D,
    /// A slow bench for metrology: stops, weights, sessions set to zero anew.
    E,
    /// A gimbal of a spacecraft: stepper motor, passes, chamber; models near the textbook and far from it.
    G,
    /// An arm at work: servo, payloads, sensor of the joint's torque; models near the textbook and far from it.
    H,
}

impl Family {
    /// Marches as [`crate::train`] does; the fourth number of a model is its distance from the textbook.
    fn marches(self) -> bool {
        matches!(self, Self::G | Self::H)
    }

    /// Causes and strangers that such a bench can show.
    fn things(self) -> (&'static [Cause], &'static [Stranger]) {
        match self {
            Self::D => (Cause::ALL, Stranger::OF_JOINTS),
            Self::E => (hides::OF_BENCHES, Stranger::OF_BENCHES),
            Self::G => (Cause::ALL, gimbal::STRANGERS),
            Self::H => (Cause::ALL, arm::STRANGERS),
        }
    }
}

/// Which cases are drawn.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Draw {
    /// One family alone [default: D, E, G and H in turn]
    #[arg(long, value_enum, ignore_case = true)]
    pub family: Option<Family>,
    /// Cases of one kind alone [default: of 10 cases of D and E 2 nulls, 5 singles, 1 compound, 2 outside the library;
    /// of G and H 2, 4, 2 and 2]
    #[arg(long, value_enum)]
    pub kind: Option<Kind>,
    /// Singles of one cause alone
    #[arg(long, value_name = "NAME")]
    pub cause: Option<Cause>,
    /// With `--kind logger`: this fault alone [default: each in turn]
    #[arg(long, value_enum, value_name = "NAME")]
    pub fault: Option<LoggerFault>,
}

impl Draw {
    /// As they would be typed.
    pub fn options(&self) -> String {
        let options = [
            ("family", self.family.map(name_of)),
            ("kind", self.kind.map(name_of)),
            ("cause", self.cause.map(|cause| cause.name().to_owned())),
            ("fault", self.fault.map(name_of)),
        ];
        let typed = options.into_iter().filter_map(|(option, value)| Some(format!(" --{option} {}", value?)));
        typed.collect()
    }

    fn family_of(&self, index: u64) -> Family {
        let in_turn = [Family::D, Family::E, Family::G, Family::H];
        // Faults of loggers are those of a logger that polls.
        let all = if self.kind == Some(Kind::Logger) { Family::D } else { in_turn[(index % 4) as usize] };
        self.family.unwrap_or(all)
    }
}

/// As the command line has it.
fn name_of(value: impl ValueEnum) -> String {
    value.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned())
}

/// The bench of a drive.
#[derive(Debug, Clone)]
enum Stand {
    Joint(Joint),
    Bench(Metrology),
    Gimbal(Gimbal),
    Arm(Arm),
}

impl Stand {
    fn run(&self, drive: &Drive, unit: &Unit, hidden: &[Hides]) -> Record {
        match self {
            Self::Joint(joint) => joint.run(drive, unit, hidden),
            Self::Bench(bench) => bench.run(drive, unit, hidden),
            Self::Gimbal(gimbal) => gimbal.run(drive, unit, hidden),
            Self::Arm(arm) => arm.run(drive, unit, hidden),
        }
    }

    /// Scatter of the instants of reading where the drive moves meanwhile.
    fn jitter_s(&self) -> Option<f64> {
        match self {
            Self::Joint(joint) => Some(joint.poll.jitter_s),
            Self::Gimbal(Gimbal { pace, .. }) | Self::Arm(Arm { pace, .. }) => Some(pace.jitter_s),
            Self::Bench(_) => None,
        }
    }
}

/// One case.
#[derive(Debug, Clone)]
pub struct Case {
    seed: u64,
    index: u64,
    kind: Kind,
    family: Family,
    /// Catalogue.
    drive: Drive,
    /// On the bench.
    unit: Unit,
    stand: Stand,
    sensors: Sensors,
    hidden: Vec<Hides>,
    pub fault: Option<LoggerFault>,
    weighed: Vec<Hidden>,
    removable_rms_arcsec: f64,
    floor_arcsec: f64,
}

/// Times the limit of detection at which an effect is aimed, at least and at most.
const AIM: (f64, f64) = (2.0, 15.0);
/// Times the limit of detection below which a case is drawn anew.
const LEAST: f64 = 1.3;
/// Draws of a case before one that is too small is taken as it is; it then counts as below the limit.
const DRAWS: u64 = 12;
const BLOCK: u64 = 10;

impl Case {
    /// Draws the case of this seed and index.
    pub fn draw(seed: u64, index: u64, draw: &Draw) -> Self {
        for attempt in 0.. {
            let case = Self::attempt(seed, index, attempt, draw);
            if attempt + 1 == DRAWS || case.weighed.iter().all(|one| one.over_limit >= LEAST) {
                return case;
            }
        }
        unreachable!("the last draw is taken")
    }

    fn attempt(seed: u64, index: u64, attempt: u64, draw: &Draw) -> Self {
        let mut chance = Chance::new(seed, "fresh", index * DRAWS + attempt);
        let family = draw.family_of(index);
        let (kind, things, fault) = plan(seed, index, family, draw, &mut chance);
        let drive = Drive::draw(&mut chance);
        let perfect = kind == Kind::Logger;
        let unit = if perfect { Unit::nominal(&drive) } else { Unit::draw(&drive, &mut chance) };
        let mut sensors = Sensors::draw(&drive, &mut chance);
        let stand = match family {
            _ if perfect => {
                let mut joint = Joint::draw(&drive, &mut chance);
                joint.poll = fault.map_or(joint.poll, |fault| fault.poll(joint.poll, &mut chance));
                Stand::Joint(joint)
            }
            Family::D => Stand::Joint(Joint::draw(&drive, &mut chance)),
            Family::E => {
                // A collimator reads finer than an encoder and drifts with the room.
                sensors.white_arcsec *= 0.4;
                sensors.wander_arcsec = chance.uniform(0.2, 0.8);
                sensors.wander_s = chance.log_uniform(60.0, 600.0);
                sensors.output_step_rad = TAU / f64::from(1 << 24);
                Stand::Bench(Metrology::draw(&drive, &things, &mut chance))
            }
            Family::G => {
                sensors.white_arcsec *= 0.7;
                Stand::Gimbal(Gimbal::draw(&drive, &mut chance))
            }
            Family::H => {
                sensors.white_arcsec *= 0.6;
                sensors.wander_arcsec *= 0.6;
                Stand::Arm(Arm::draw(&drive, &mut chance))
            }
        };
        let mut case = Self {
            seed,
            index,
            kind,
            family,
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

    fn run(&self, hidden: &[Hides]) -> Record {
        self.stand.run(&self.drive, &self.unit, hidden)
    }

    /// Sizes what is hidden through the oracle, and weighs it.
    fn hide(&mut self, things: Vec<Thing>, chance: &mut Chance) {
        let healthy = self.run(&[]);
        let zeroed = matches!(&self.stand, Stand::Bench(bench) if bench.zeroed || bench.restarted);
        let oracle = Oracle::new(&self.drive, &self.unit, &healthy, &self.sensors, self.stand.jitter_s(), zeroed);
        self.floor_arcsec = oracle.floor_arcsec.hypot(self.sensors.wander_arcsec);
        let clean = residual(&self.drive, &healthy);
        let left = |hidden: &[Hides]| {
            if hidden.is_empty() { clean.clone() } else { residual(&self.drive, &self.run(hidden)) }
        };
        let white = self.sensors.white_arcsec;
        let mut hidden = Vec::new();
        let mut far = chance.one_in(0.5);
        for thing in things {
            let mut one = Hides::draw(thing, &self.drive, chance);
            if self.family.marches() {
                one.shape[3] = if far { chance.uniform(0.7, 1.0) } else { chance.uniform(0.0, 0.3) };
                far = !far;
            }
            let target = chance.log_uniform(AIM.0, AIM.1);
            // A whole tooth, or nothing.
            let whole = self.family.marches() && thing == Thing::Cause(Cause::Ratcheting);
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
        let all = left(&hidden);
        let mut weighed = Vec::new();
        for (at, one) in hidden.iter().enumerate() {
            let mut rest = hidden.clone();
            rest.remove(at);
            let added = oracle.added(&all, &left(&rest));
            let weight = oracle.weigh(&added);
            let over_limit = weight.over_limit(white);
            let mut look_alikes = BTreeMap::new();
            if over_limit >= 1.0 {
                let own = if let Thing::Cause(cause) = one.thing { Some(cause) } else { None };
                look_alikes.extend(oracle.look_alikes(&added, own, white));
                let same = own.filter(|_| self.family.marches());
                let same = same.and_then(|cause| same_axis(cause, self.drive.fixed, &healthy.orientation_rad));
                if let Some(same) = same {
                    look_alikes.entry(same).or_insert(0.0);
                }
            }
            let look_alikes = look_alikes.into_iter().map(|(cause, d)| (cause.name().to_owned(), rounded(d))).collect();
            weighed.push(Hidden {
                name: one.thing.name().to_owned(),
                numbers: self.numbers(one),
                rms_arcsec: rounded(weight.rms_arcsec),
                d: rounded(weight.d),
                over_limit: rounded(over_limit),
                look_alikes,
                parameters: self.parameters(one),
            });
        }
        if !hidden.is_empty() {
            self.removable_rms_arcsec = oracle.weigh(&oracle.added(&all, &clean)).rms_arcsec;
        }
        (self.hidden, self.weighed) = (hidden, weighed);
    }

    /// Size and shape by name.
    fn numbers(&self, one: &Hides) -> BTreeMap<String, f64> {
        let last = if self.family.marches() { "distance" } else { "shape_4" };
        let names = ["shape_1", "shape_2", "shape_3", last];
        let mut numbers: BTreeMap<_, _> =
            names.iter().zip(one.shape).map(|(name, value)| ((*name).to_owned(), value)).collect();
        numbers.insert(one.unit().to_owned(), one.size);
        numbers
    }

    /// Parameters that a diagnosis may state with an interval, where the contract's units leave no choice.
    fn parameters(&self, one: &Hides) -> BTreeMap<String, f64> {
        let Thing::Cause(cause) = one.thing else { return BTreeMap::new() };
        // Far from the textbook a size has more than one reading.
        if self.family.marches() && (one.shape[3] > 0.5 || cause == Cause::RatioError) {
            return BTreeMap::new();
        }
        let moves = self.family != Family::E;
        let named = match cause {
            Cause::StiffnessError => Some(("stiffness_ratio", self.unit.stiffness * (1.0 + one.size))),
            Cause::BacklashGrowth if moves => {
                Some(("growth_arcsec", one.size + (self.unit.backlash - 1.0) * self.drive.backlash_arcsec))
            }
            Cause::SensorLatency => Some(("delay_s", one.size)),
            Cause::OutputEncoderEccentricity | Cause::GeneratorEncoderEccentricity => {
                Some(("amplitude_arcsec", one.size))
            }
            Cause::RatioError => Some(("ratio_relative_error", one.size)),
            Cause::GravityTorque => Some(("torque_n_m", one.size)),
            Cause::ThermalStiffness if moves => Some(("stiffness_relative_per_k", one.size)),
            _ => None,
        };
        named.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }

    /// Directory of the data: says nothing.
    pub fn name(&self) -> String {
        format!("{:012x}", Chance::new(self.seed, "name", self.index).number() >> 16)
    }

    /// `data.csv`.
    pub fn data(&self) -> String {
        let mut chance = Chance::new(self.seed, "fresh noise", self.index);
        let mut run = self.run(&self.hidden);
        let offset = self.unit.offset_arcsec / ARCSEC;
        run.output_read_rad.iter_mut().for_each(|out| *out += offset);
        if let Stand::Bench(bench) = &self.stand {
            let mut session = 0;
            let shifts = bench.shifts();
            for at in 0..run.time_s.len() {
                if run.session_start.get(session + 1) == Some(&at) {
                    session += 1;
                }
                run.output_read_rad[at] += shifts[session].0;
                run.generator_read_rad[at] -= shifts[session].1;
            }
        }
        let mut rows = self.sensors.rows(&run, &mut chance);
        if let Some(fault) = self.fault {
            fault.spoil(&mut rows, &run.session_start, &self.drive, &mut chance);
        }
        csv(&rows, run.orientation_known)
    }

    /// `nominal.toml`.
    pub fn nominal_toml(&self) -> String {
        self.fault.map_or(self.drive.clone(), |fault| fault.catalogue(&self.drive)).nominal_toml()
    }

    pub fn truth(&self) -> Truth {
        let mut hidden = self.weighed.clone();
        if let Some(fault) = self.fault {
            let look_alikes = fault.reported_as().iter().map(|name| ((*name).to_owned(), 0.0)).collect();
            let over_limit = f64::from(u8::from(fault.can_be_reported()));
            hidden.push(Hidden { name: fault.name().to_owned(), over_limit, look_alikes, ..Hidden::default() });
        }
        let mut bench = Vec::new();
        if let Stand::Bench(stand) = &self.stand {
            let does = [(stand.zeroed, "zeroed"), (stand.restarted, "counter_restarted"), (stand.chamber, "chamber")];
            bench.extend(does.into_iter().filter(|(there, _)| *there).map(|(_, name)| name.to_owned()));
        }
        let family = if self.kind == Kind::Logger { "logger".to_owned() } else { format!("{:?}", self.family) };
        Truth {
            name: self.name(),
            seed: self.seed,
            index: self.index,
            kind: name_of(self.kind),
            family,
            poor: [],
            bench,
            hidden,
            removable_rms_arcsec: rounded(self.removable_rms_arcsec),
            floor_arcsec: rounded(self.floor_arcsec),
            white_arcsec: rounded(self.sensors.white_arcsec),
            turns: rounded(self.run(&[]).turns()),
        }
    }
}

/// Cause that looks like a displaced axis while the housing never turns: gravity holds it in the housing, as the
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
    family: Family,
    draw: &Draw,
    chance: &mut Chance,
) -> (Kind, Vec<Thing>, Option<LoggerFault>) {
    if draw.kind == Some(Kind::Logger) {
        let all = LoggerFault::ALL;
        let fault = draw.fault.unwrap_or(all[(index % all.len() as u64) as usize]);
        return (Kind::Logger, Vec::new(), Some(fault));
    }
    let (causes, strangers) = family.things();
    use Kind::{Compound, Null, Outside, Single};
    let mut kinds = match family {
        Family::D | Family::E => [Null, Null, Outside, Outside, Compound, Single, Single, Single, Single, Single],
        Family::G | Family::H => [Null, Null, Outside, Outside, Compound, Compound, Single, Single, Single, Single],
    };
    let (block, place) = (index / BLOCK, (index % BLOCK) as usize);
    Chance::new(seed, "fresh kinds", block).shuffle(&mut kinds);
    let mut kind = kinds[place];
    let in_block = kinds.iter().filter(|other| **other == kind).count() as u64;
    let mut number = block * in_block + kinds[..place].iter().filter(|other| **other == kind).count() as u64;
    if let Some(only) = draw.kind.or(draw.cause.map(|_| Single)) {
        (kind, number) = (only, index);
    }
    // Each comes up as often as any other.
    let in_turn = |count: usize, purpose: &str| {
        let mut order: Vec<usize> = (0..count).collect();
        Chance::new(seed, purpose, number / count as u64).shuffle(&mut order);
        order[(number % count as u64) as usize]
    };
    let things = match kind {
        Single => {
            vec![Thing::Cause(draw.cause.unwrap_or_else(|| causes[in_turn(causes.len(), "fresh singles")]))]
        }
        Outside => vec![Thing::Stranger(strangers[in_turn(strangers.len(), "fresh outside")])],
        Compound => {
            let mut all = causes.to_vec();
            chance.shuffle(&mut all);
            all.into_iter().take(2).map(Thing::Cause).collect()
        }
        Null | Kind::Logger => Vec::new(),
    };
    (kind, things, None)
}
