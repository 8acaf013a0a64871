//! One case: which drive, which run, what is hidden. A seed and an index give the same case whatever else is drawn.

use serde::Serialize;

use crate::bench::Bench;
use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::{Drive, Unit};
use crate::effect::{Effect, Family, What};
use crate::fault::Fault;
use crate::fresh::logger::LoggerFault;
use crate::motion::{Motion, Poor};
use crate::noise::{Sensors, csv};
use crate::outside::Outside;
use crate::plant::{self, Readings};

/// What sort of case it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Nothing is hidden.
    Null,
    /// One cause.
    Single,
    /// Two or three causes.
    Compound,
    /// An effect outside the library.
    Outside,
    /// A fault of the data: drawn only when asked for.
    Fault,
    /// A perfect drive under a fault of the logger: drawn only when asked for.
    Logger,
}

impl Kind {
    /// In truth files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Null => "null",
            Self::Single => "single",
            Self::Compound => "compound",
            Self::Outside => "outside",
            Self::Fault => "fault",
            Self::Logger => "logger",
        }
    }
}

/// Whose plant: three sets of laws for one plant, and six plants of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, clap::ValueEnum)]
pub enum Plant {
    /// The plainer textbook laws.
    A,
    /// Other laws for the same physics.
    B,
    /// A third set.
    C,
    /// A joint in motion: inertia, servo, polled encoders.
    D,
    /// A slow bench for metrology: stops, weights, sessions set to zero anew.
    E,
    /// An acceptance rig: motor against load motor, counts over a bus.
    F,
    /// A gimbal of a spacecraft: stepper motor, passes, chamber; laws near the textbook and far from it.
    G,
    /// An arm at work: servo, payloads, sensor of the joint's torque; laws near the textbook and far from it.
    H,
    /// Variants: forms of each cause as real units have them. For learning how far the textbook is from them; never
    /// counted as an examination.
    V,
}

impl Plant {
    /// Laws of the first plant.
    fn laws(self) -> Option<Family> {
        match self {
            Self::A => Some(Family::A),
            Self::B => Some(Family::B),
            Self::C => Some(Family::C),
            Self::D | Self::E | Self::F | Self::G | Self::H | Self::V => None,
        }
    }
}

/// Which cases are drawn.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Draw {
    /// One family alone [default: A, B and C, case by case]
    #[arg(long, value_enum, ignore_case = true)]
    pub family: Option<Plant>,
    /// Cases of one kind alone [default: in 25 cases 5 nulls, 10 singles, 6 compounds, 4 outside the library; of
    /// families D to F in 10 cases 2, 5, 1 and 2, of G and H 2, 4, 2 and 2, of V 1 and 9]
    #[arg(long, value_enum)]
    pub kind: Option<Kind>,
    /// Singles of one cause alone
    #[arg(long, value_name = "NAME")]
    pub cause: Option<Cause>,
    /// With `--kind logger`: this fault alone [default: each in turn]
    #[arg(long, value_enum, value_name = "NAME")]
    pub fault: Option<LoggerFault>,
    /// Poor excitation: of this kind in every case, or `--rich` for none [default: in 6 of 25 cases]
    #[arg(long, value_enum)]
    pub poor: Option<Poor>,
    /// No poor excitation
    #[arg(long, conflicts_with = "poor")]
    pub rich: bool,
    /// Sizes well above the limit of detection alone (3 to 20 times)
    #[arg(long)]
    pub clear: bool,
}

impl Draw {
    /// Whether the cases come from the plants of [`crate::fresh`].
    pub fn is_fresh(&self) -> bool {
        self.kind == Some(Kind::Logger) || self.family.is_some_and(|family| family.laws().is_none())
    }

    /// What no plant can show.
    ///
    /// # Errors
    /// Kinds of which family V has none.
    pub fn check(&self) -> Result<(), String> {
        match (self.family, self.kind) {
            (Some(Plant::V), Some(kind @ (Kind::Outside | Kind::Fault | Kind::Logger))) => {
                Err(format!("--kind {} with --family v: variants have null, single and compound", kind.name()))
            }
            _ => Ok(()),
        }
    }

    /// As it would be typed.
    pub fn options(&self) -> String {
        let mut text = String::new();
        let mut add = |option: &str, value: Option<String>| {
            if let Some(value) = value {
                text.push_str(&format!(" --{option} {value}"));
            }
        };
        let name = |value: Option<clap::builder::PossibleValue>| value.map(|value| value.get_name().to_owned());
        use clap::ValueEnum;
        add("family", self.family.and_then(|f| name(f.to_possible_value())));
        add("kind", self.kind.and_then(|k| name(k.to_possible_value())));
        add("cause", self.cause.map(|c| c.name().to_owned()));
        add("fault", self.fault.map(|f| f.name().to_owned()));
        add("poor", self.poor.and_then(|p| name(p.to_possible_value())));
        if self.rich {
            text.push_str(" --rich");
        }
        if self.clear {
            text.push_str(" --clear");
        }
        text
    }
}

/// A case with all that is to know of it.
#[derive(Debug, Clone)]
pub struct Case {
    /// Seed of the examination.
    pub seed: u64,
    /// Of the case.
    pub index: u64,
    /// Directory of its data: says nothing.
    pub name: String,
    /// Sort.
    pub kind: Kind,
    /// Laws.
    pub family: Family,
    /// What its excitation lacks.
    pub poor: Vec<Poor>,
    /// Catalogue.
    pub drive: Drive,
    /// Bench.
    pub unit: Unit,
    /// Run.
    pub motion: Motion,
    /// Noise.
    pub sensors: Sensors,
    /// What is hidden.
    pub effects: Vec<Effect>,
    /// What is wrong with the data.
    pub fault: Option<Fault>,
}

const BLOCK: u64 = 25;

impl Case {
    /// Draws the case of this seed and index.
    pub fn draw(seed: u64, index: u64, draw: &Draw) -> Self {
        let plan = Plan::new(seed, index, draw);
        let mut chance = Chance::new(seed, "case", index);
        let drawn = *chance.of(&Family::ALL);
        let family = draw.family.and_then(Plant::laws).unwrap_or(drawn);
        let name = Self::name(seed, index);
        let drive = Drive::draw(&mut chance);
        let unit = Unit::draw(&drive, family, &mut chance);
        let motion = Motion::draw(&drive, &plan.poor, &mut chance);
        let sensors = Sensors::draw(&drive, &mut chance);
        let mut effects = Vec::new();
        if !plan.hidden.is_empty() {
            let mut bench = Bench::new(&drive, &unit, &motion, &sensors, &[]);
            for what in plan.hidden {
                let target = match plan.kind {
                    _ if draw.clear => chance.log_uniform(3.0, 20.0),
                    Kind::Single if chance.one_in(0.25) => chance.log_uniform(0.1, 1.0),
                    Kind::Compound | Kind::Outside if chance.one_in(0.12) => chance.log_uniform(0.1, 1.0),
                    _ => chance.log_uniform(1.2, 20.0),
                };
                let effect = Effect::draw(what, family, &drive, &mut chance);
                effects.push(sized(effect, target, &mut bench, &drive, &sensors));
            }
        }
        let (kind, poor, fault) = (plan.kind, plan.poor, plan.fault);
        Self { seed, index, name, kind, family, poor, drive, unit, motion, sensors, effects, fault }
    }

    /// Directory of the data of a case.
    pub fn name(seed: u64, index: u64) -> String {
        format!("{:012x}", Chance::new(seed, "name", index).number() >> 16)
    }

    /// Readings without noise.
    pub fn readings(&self) -> Readings {
        plant::run(&self.drive, &self.unit, &self.motion, &self.effects)
    }

    /// `data.csv`.
    pub fn data(&self) -> String {
        let mut chance = Chance::new(self.seed, "noise", self.index);
        let mut rows = self.sensors.rows(&self.motion, &self.readings(), &mut chance);
        if let Some(fault) = self.fault {
            let row_s = self.motion.step_s * self.motion.stride as f64;
            fault.spoil(&mut rows, row_s, self.sensors.all_arcsec(&self.drive), &mut chance);
        }
        csv(&rows, self.motion.orientation_known)
    }
}

/// The size at which an effect stands this many times over the limit of detection, within what a drive can show.
fn sized(mut effect: Effect, target: f64, bench: &mut Bench, drive: &Drive, sensors: &Sensors) -> Effect {
    let spec = effect.what.spec(drive);
    if effect.what == What::Cause(Cause::Ratcheting) {
        effect.size = effect.size.round();
        return effect;
    }
    // Size and miss of the last step, in logarithms.
    let mut last: Option<(f64, f64)> = None;
    for _ in 0..6 {
        let contribution = bench.signature(&effect);
        let over = bench.weigh(&contribution).over_limit(sensors.white_arcsec);
        let miss = (over / target).ln();
        if over < 1e-4 || miss.abs() < 0.1 {
            break;
        }
        let at = effect.size.abs().ln();
        let step = match last {
            // Beyond the aim: the effect grows faster than its size, so the aim lies between the two (false position).
            Some((was_at, was_miss)) if was_miss * miss < 0.0 => -miss * (at - was_at) / (miss - was_miss),
            _ => -miss,
        };
        last = Some((at, miss));
        let size = (at + step.clamp(-3.5, 3.4)).exp();
        effect.size = size.clamp(0.02 * spec.range.0, spec.range.1).copysign(effect.size);
    }
    effect
}

/// What a case is to be.
struct Plan {
    kind: Kind,
    hidden: Vec<What>,
    poor: Vec<Poor>,
    fault: Option<Fault>,
}

impl Plan {
    fn new(seed: u64, index: u64, draw: &Draw) -> Self {
        let (block, place) = (index / BLOCK, (index % BLOCK) as usize);
        let mut kinds = [Kind::Single; BLOCK as usize];
        kinds[..5].fill(Kind::Null);
        kinds[5..11].fill(Kind::Compound);
        kinds[11..15].fill(Kind::Outside);
        Chance::new(seed, "kinds", block).shuffle(&mut kinds);
        let mut kind = kinds[place];
        let ordinal = |of: Kind| {
            let in_block = kinds.iter().filter(|kind| **kind == of).count() as u64;
            block * in_block + kinds[..place].iter().filter(|kind| **kind == of).count() as u64
        };
        // Each cause comes up as often as any other.
        let in_turn = |ordinal: u64, count: usize, purpose: &str| {
            let mut order: Vec<usize> = (0..count).collect();
            Chance::new(seed, purpose, ordinal / count as u64).shuffle(&mut order);
            order[(ordinal % count as u64) as usize]
        };
        let mut number = ordinal(kind);
        if let Some(only) = draw.kind.or(draw.cause.map(|_| Kind::Single)) {
            (kind, number) = (only, index);
        }
        let mut chance = Chance::new(seed, "plan", index);
        let hidden = match kind {
            Kind::Null | Kind::Fault | Kind::Logger => Vec::new(),
            Kind::Single => vec![What::Cause(
                draw.cause.unwrap_or_else(|| Cause::ALL[in_turn(number, Cause::ALL.len(), "singles")]),
            )],
            Kind::Outside => vec![What::Outside(Outside::ALL[in_turn(number, Outside::ALL.len(), "outside")])],
            Kind::Compound => {
                let mut all = Cause::ALL.to_vec();
                chance.shuffle(&mut all);
                all.into_iter().take(if number % 3 == 2 { 3 } else { 2 }).map(What::Cause).collect()
            }
        };
        let mut places: Vec<usize> = (0..BLOCK as usize).collect();
        Chance::new(seed, "poor", block).shuffle(&mut places);
        let mut poor = Vec::new();
        if let Some(only) = draw.poor {
            poor.push(only);
        } else if !draw.rich && places[place] < 6 {
            poor.push(Poor::ALL[in_turn(block * 6 + places[place] as u64, Poor::ALL.len(), "poor kinds")]);
            if chance.one_in(0.3) {
                let second = *chance.of(Poor::ALL);
                let clash = |a, b| poor.contains(&a) && second == b || poor.contains(&b) && second == a;
                if !poor.contains(&second)
                    && !clash(Poor::SlowOnly, Poor::FewTurns)
                    && !clash(Poor::Unloaded, Poor::ConstantTorque)
                {
                    poor.push(second);
                }
            }
        }
        let fault = (kind == Kind::Fault).then(|| Fault::ALL[in_turn(number, Fault::ALL.len(), "faults")]);
        Self { kind, hidden, poor, fault }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_holds_the_promised_shares() {
        let plans: Vec<_> = (0..100).map(|index| Plan::new(9, index, &Draw::default())).collect();
        let count = |kind| plans.iter().filter(|plan| plan.kind == kind).count();
        assert_eq!((count(Kind::Null), count(Kind::Outside), count(Kind::Compound)), (20, 16, 24));
        assert_eq!(plans.iter().filter(|plan| !plan.poor.is_empty()).count(), 24);
        assert_eq!(plans.iter().filter(|plan| plan.kind == Kind::Compound && plan.hidden.len() == 3).count(), 8);
    }

    #[test]
    fn every_family_comes_up_as_often_as_the_others() {
        let nulls = Draw { kind: Some(Kind::Null), ..Draw::default() };
        let drawn: Vec<_> = (0..90).map(|index| Case::draw(5, index, &nulls).family).collect();
        for family in Family::ALL {
            let count = drawn.iter().filter(|one| **one == family).count();
            assert!((18..=42).contains(&count), "{family:?}: {count} of 90");
        }
    }

    /// Errors of the wheels that two zones share grow faster than their size: the search must not swing from one side
    /// to the other.
    #[test]
    fn sizes_are_found_where_an_effect_grows_faster_than_its_size() {
        for (at, cause) in [Cause::CircularSplineEccentricity, Cause::GeneratorEccentricity, Cause::GravitySideLoad]
            .into_iter()
            .enumerate()
        {
            for family in [Plant::A, Plant::B, Plant::C] {
                let draw =
                    Draw { family: Some(family), cause: Some(cause), clear: true, rich: true, ..Draw::default() };
                for index in 0..3 {
                    let case = Case::draw(8, 3 * at as u64 + index, &draw);
                    let mut bench = Bench::new(&case.drive, &case.unit, &case.motion, &case.sensors, &[]);
                    let contribution = bench.signature(&case.effects[0]);
                    let over = bench.weigh(&contribution).over_limit(case.sensors.white_arcsec);
                    let largest = case.effects[0].what.spec(&case.drive).range.1;
                    // Asked from 3 to 20.
                    let found = (2.5..24.0).contains(&over) || case.effects[0].size == largest;
                    assert!(found, "{} {family:?}: {over} at {}", cause.name(), case.effects[0].size);
                }
            }
        }
    }

    #[test]
    fn a_case_is_repeated_by_seed_and_index() {
        let data = |index| blake3::hash(Case::draw(7, index, &Draw::default()).data().as_bytes());
        assert_eq!(data(3), data(3));
        assert_ne!(data(3), data(4));
    }
}
