//! A scenario from a file: a built-in one, and what is otherwise. And such a file, to start from.

use std::fmt::Write as _;

use flexspline_base::toml_file::{
    Allowed, Problem, Refused, TomlFile, each_of, from, number, one_of, real, text, whole,
};
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_motion::scenario::{Leg, Scenario, TableKnown, TorqueKnown};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::built_in::{SCENARIOS, built_in};
use super::results::PACES_HZ;
use super::{Flown, FlyError};

/// Temperatures of a flight, °C: what tables of HHD-95 have.
const COLDEST_C: f64 = -60.0;
const WARMEST_C: f64 = 80.0;
/// Slower gusts than this are none within a flight, Hz.
const SLOWEST_GUST_HZ: f64 = 1e-3;
/// A flight lasts from the first to the second, s.
const LASTS_S: [f64; 2] = [3.0, 3600.0];
/// Torques on the load, N·m, and frequencies of them, Hz.
const TORQUE: Allowed = from(-200.0, 200.0);
const HZ: Allowed = from(0.0, 50.0);

/// A field of a file: its path, what it is, and where its value goes.
struct Field<'s> {
    path: &'static str,
    what: &'static str,
    to: To<'s>,
}

/// Where a value goes, and which are allowed.
enum To<'s> {
    Name(&'s mut String),
    Number(&'s mut f64, Allowed),
    Pair(&'s mut [f64; 2], [Allowed; 2]),
    Word(&'s mut u32, Allowed),
    Count(&'s mut usize, Allowed),
    Legs(&'s mut Vec<Leg>),
    Generator(&'s mut GeneratorKind),
    Torque(&'s mut TorqueKnown),
    Table(&'s mut TableKnown),
}

/// Every field but `base`, in the order of a file.
fn fields(flown: &mut Flown) -> Vec<Field<'_>> {
    let Flown { kind, scenario, .. } = flown;
    let Scenario { load, servo, .. } = scenario;
    let most_late = servo.steps as f64;
    let field = |path, what, to| Field { path, what, to };
    let n = |path, what, to, low, high| Field { path, what, to: To::Number(to, from(low, high)) };
    let accelerates = &mut scenario.acceleration_rad_s2;
    let (fed, known) = (&mut scenario.load_fed_forward, &mut scenario.friction_known);
    let pulls = "weight times arm, N·m, and the output angle where it pulls forward most, rad";
    let [speed, position, integral] = PACES_HZ;
    let corner = "corner of the integral of the speed loop, Hz";
    let late = "fifths of a tick from a sample to the torque that it asks for";
    vec![
        field("name", "name in the results", To::Name(&mut scenario.name)),
        field("generator", "wave generator of the drive", To::Generator(kind)),
        field("legs", "legs: how long, s, and the rate of the output, rad/s", To::Legs(&mut scenario.legs)),
        n("acceleration_rad_s2", "acceleration of the target between legs, rad/s²", accelerates, 1e-6, 10.0),
        n("load_kg_m2", "inertia of the load, kg·m²", &mut scenario.load_kg_m2, 0.01, 1e3),
        n("drag_n_m", "Coulomb drag of the output, N·m", &mut scenario.drag_n_m, 0.0, 10.0),
        n("damping", "share of critical damping of the twist", &mut scenario.damping, 1e-4, 0.5),
        n("temperature_c", "temperature at the beginning, °C", &mut scenario.temperature_c, COLDEST_C, WARMEST_C),
        n("warming_k_s", "warming of the lubricant, K/s", &mut scenario.warming_k_s, -1.0, 1.0),
        n("friction", "friction on the motor's side, times that of an eRob80", &mut scenario.friction, 0.0, 10.0),
        n("friction_known", "share of that friction fed forward to the servo", known, 0.0, 1.0),
        n("load_fed_forward", "share of a torque known on the load fed forward to the servo", fed, 0.0, 1.0),
        field("torque", "from what the torque is known in flight", To::Torque(&mut scenario.torque)),
        n("torque_noise_n_m", "noise of that torque, N·m rms", &mut scenario.torque_noise_n_m, 0.0, 10.0),
        field("table", "what the table knows of the unit", To::Table(&mut scenario.table)),
        field("seed", "start of the random numbers", To::Word(&mut scenario.seed, from(0.0, f64::from(u32::MAX)))),
        field("load.bias_n_m", "torque on the load that is always there, N·m", To::Number(&mut load.bias_n_m, TORQUE)),
        field("load.swing", "slow swing: N·m, Hz", To::Pair(&mut load.swing, [TORQUE, HZ])),
        field("load.gust", "gusts: N·m rms, corner in Hz", To::Pair(&mut load.gust, [from(0.0, 100.0), HZ])),
        field("load.step", "steps up and down: N·m, period in s", To::Pair(&mut load.step, [TORQUE, from(0.0, 1e3)])),
        field("load.gravity", pulls, To::Pair(&mut load.gravity, [TORQUE, from(-10.0, 10.0)])),
        n("servo.inertia_kg_m2", "inertia of motor and generator, kg·m²", &mut servo.inertia_kg_m2, 1e-6, 1.0),
        n("servo.largest_n_m", "largest torque of the motor, N·m", &mut servo.largest_n_m, 0.01, 100.0),
        n("servo.position_hz", "bandwidth of the position loop, Hz", &mut servo.position_hz, position[0], position[1]),
        n("servo.speed_hz", "bandwidth of the speed loop, Hz", &mut servo.speed_hz, speed[0], speed[1]),
        n("servo.integral_hz", corner, &mut servo.integral_hz, integral[0], integral[1]),
        n("servo.jitter_s", "the encoder is read up to so much too late, s", &mut servo.jitter_s, 0.0, 1e-3),
        field("servo.late_steps", late, To::Count(&mut servo.late_steps, from(0.0, most_late))),
        field("servo.encoder_bits", "bits in a turn of the motor", To::Word(&mut servo.encoder_bits, from(8.0, 30.0))),
    ]
}

impl To<'_> {
    /// Takes a value of a file.
    fn take(self, value: &Spanned<DeValue<'_>>) -> Result<(), Refused> {
        match self {
            To::Name(to) => *to = text(value)?,
            To::Number(to, allowed) => *to = real(&allowed, value)?,
            To::Pair(to, allowed) => *to = pair(&allowed, value)?,
            To::Word(to, allowed) => *to = whole(&allowed, value)?,
            To::Count(to, allowed) => *to = whole(&allowed, value)? as usize,
            To::Legs(to) => *to = each_of(value, "an array of [seconds, rad/s]", leg)?,
            To::Generator(to) => *to = one_of(&generators(), value)?,
            To::Torque(to) => *to = one_of(&TorqueKnown::NAMES, value)?,
            To::Table(to) => *to = one_of(&TableKnown::NAMES, value)?,
        }
        Ok(())
    }

    /// The value as a file has it, and what is allowed.
    fn shown(&self) -> (String, String) {
        match self {
            To::Name(name) => (format!("{name:?}"), "any text".to_owned()),
            To::Number(value, allowed) => (format!("{value:?}"), allowed.to_string()),
            To::Pair(values, [a, b]) => (format!("{values:?}"), format!("{a}; {b}")),
            To::Word(value, allowed) => (value.to_string(), allowed.to_string()),
            To::Count(value, allowed) => (value.to_string(), allowed.to_string()),
            To::Legs(legs) => {
                let legs: Vec<[f64; 2]> = legs.iter().map(|leg| [leg.seconds, leg.rate_rad_s]).collect();
                (format!("{legs:?}"), format!("{} to {} s in all, -1 to 1 rad/s", LASTS_S[0], LASTS_S[1]))
            }
            To::Generator(kind) => named(&generators(), **kind),
            To::Torque(known) => named(&TorqueKnown::NAMES, **known),
            To::Table(known) => named(&TableKnown::NAMES, **known),
        }
    }
}

fn generators() -> [(&'static str, GeneratorKind); 4] {
    GeneratorKind::ALL.map(|kind| (kind.name(), kind))
}

fn named<T: PartialEq>(names: &[(&'static str, T)], found: T) -> (String, String) {
    let all: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
    (format!("{:?}", name_of(names, found)), all.join(", "))
}

/// The name of a value among names.
pub(super) fn name_of<T: PartialEq>(names: &[(&'static str, T)], found: T) -> &'static str {
    names.iter().find(|(_, meant)| *meant == found).map_or("", |(name, _)| name)
}

fn pair(allowed: &[Allowed; 2], value: &Spanned<DeValue<'_>>) -> Result<[f64; 2], Refused> {
    let Some([a, b]) = value.get_ref().as_array().and_then(|array| array.get(..)) else {
        return Err(Refused::found(value, "two numbers, [a, b]"));
    };
    let at = |k: usize, value| real(&allowed[k], value).map_err(|refused| refused.within(format!("[{k}]")));
    Ok([at(0, a)?, at(1, b)?])
}

fn leg(value: &Spanned<DeValue<'_>>) -> Result<Leg, Refused> {
    let array = value.get_ref().as_array();
    let numbers: Vec<f64> =
        array.into_iter().flatten().map(|value| number(value.get_ref()).unwrap_or(f64::NAN)).collect();
    match numbers[..] {
        [seconds, rate_rad_s] if seconds > 0.0 && rate_rad_s.abs() <= 1.0 => Ok(Leg { seconds, rate_rad_s }),
        _ => {
            let allowed = "[seconds, rad/s] with seconds above 0 and a rate of -1 to 1 rad/s";
            Err(Refused::because(value, format!("found {numbers:?}, allowed: {allowed}")))
        }
    }
}

/// The value at a path of one or two keys.
fn at<'t, 'i>(table: &'t DeTable<'i>, path: &str) -> Option<&'t Spanned<DeValue<'i>>> {
    match path.split_once('.') {
        Some((section, key)) => table.get(section)?.get_ref().as_table()?.get(key),
        None => table.get(path),
    }
}

/// Reads a file.
///
/// # Errors
/// [`FlyError::Scenario`]: file and line, field, value found and what is allowed.
pub fn read(name: &str, text: &str) -> Result<Flown, FlyError> {
    let mut file = TomlFile::new(name, text);
    let flown = file.parse().and_then(|table| read_table(&mut file, &table));
    match (file.problems().into_iter().next(), flown) {
        (None, Some(flown)) => Ok(flown),
        (problem, _) => Err(FlyError::Scenario(problem.unwrap_or_else(|| Problem::of("", "no scenario")))),
    }
}

fn read_table(file: &mut TomlFile<'_>, table: &DeTable<'_>) -> Option<Flown> {
    let Some(base) = table.get("base") else {
        file.refuse_whole("base", format!("missing; give one of {}", SCENARIOS.join(", ")));
        return None;
    };
    let mut flown = file.take("base", one_of(&SCENARIOS.map(|name| (name, name)), base)).and_then(built_in)?;
    let fields = fields(&mut flown);
    let known: Vec<&str> = std::iter::once("base").chain(fields.iter().map(|field| field.path)).collect();
    file.refuse_unknown_keys(table, &known, &[]);
    for section in ["load", "servo"] {
        if table.contains_key(section) {
            file.section(table, section);
        }
    }
    for Field { path, to, .. } in fields {
        if let Some(value) = at(table, path) {
            file.take(path, to.take(value));
        }
    }
    // Limits on several fields together.
    let scenario = &flown.scenario;
    let mut refuse = |path: &str, what: String| match at(table, path) {
        Some(value) => file.refuse(value.span(), path, what),
        None => file.refuse_whole(path, what),
    };
    // No legs are 0 s, and not -0.
    let seconds = scenario.seconds() + 0.0;
    let [shortest, longest] = LASTS_S;
    if !(shortest..=longest).contains(&seconds) {
        refuse("legs", format!("found {seconds} s in all, allowed: {shortest} to {longest} s"));
    }
    let ends_c = scenario.temperature_at_c(seconds);
    if !(COLDEST_C..=WARMEST_C).contains(&ends_c) {
        let allowed = format!("a flight that ends at {COLDEST_C} to {WARMEST_C} °C");
        refuse("warming_k_s", format!("found an end at {ends_c:.0} °C, allowed: {allowed}"));
    }
    let [gust_n_m, gust_hz] = scenario.load.gust;
    if gust_n_m > 0.0 && gust_hz < SLOWEST_GUST_HZ {
        let allowed = format!("{SLOWEST_GUST_HZ} to 50 for gusts above 0 N·m");
        refuse("load.gust", format!("found a corner of {gust_hz} Hz, allowed: {allowed}"));
    }
    Some(flown)
}

/// A file that flies what is given, with every field, what it is and what is allowed.
pub fn example(base: &str, mut flown: Flown) -> String {
    let mut file = format!(
        "# A scenario for `flexspline fly FILE`: {base}, with every field. A line that is left out is as in the \
         scenario\n# that `base` names.\nbase = {base:?}  # {}\n",
        SCENARIOS.join(", ")
    );
    let mut section = "";
    for Field { path, what, to } in fields(&mut flown) {
        let (of, key) = path.split_once('.').unwrap_or(("", path));
        if of != section {
            let _ = writeln!(file, "\n[{of}]");
            section = of;
        }
        let (value, allowed) = to.shown();
        let _ = writeln!(file, "# {what}; allowed: {allowed}\n{key} = {value}");
    }
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_example_is_the_scenario_and_each_of_its_lines_counts() {
        for name in SCENARIOS {
            let flown = built_in(name).unwrap();
            let file = example(name, flown.clone());
            assert_eq!(read("own.toml", &file).unwrap(), flown, "{file}");
        }
        let changed = example("camera", built_in("rover").unwrap());
        let mut rover = built_in("rover").unwrap();
        assert_eq!(read("own.toml", &changed).unwrap(), rover);
        // No field but those listed: a scenario all of whose fields differ is recognised by its file.
        for Field { path, to, .. } in fields(&mut rover) {
            let before = example("rover", built_in("rover").unwrap());
            match to {
                To::Name(to) => to.push('2'),
                To::Number(to, _) => *to *= 0.99,
                To::Pair(to, _) => to[0] += 0.5,
                To::Word(to, _) => *to += 1,
                To::Count(to, _) => *to += 1,
                To::Legs(to) => to[0].seconds += 1.0,
                To::Generator(to) => *to = GeneratorKind::TwoRoller,
                To::Torque(to) => *to = TorqueKnown::Not,
                To::Table(to) => *to = TableKnown::Extended,
            }
            assert!(before.contains(&format!("{} = ", path.rsplit('.').next().unwrap())), "{path}");
        }
        assert_eq!(read("own.toml", &example("antenna", rover.clone())).unwrap(), rover);
    }

    #[test]
    fn a_file_changes_what_it_names_and_a_bad_one_says_where() {
        let good =
            "base = \"camera\"\ntorque = \"in_mesh\"\nlegs = [[2.0, 0.0], [3.0, 0.01]]\n[load]\nbias_n_m = 2.0\n";
        let flown = read("own.toml", good).unwrap();
        assert_eq!(flown.scenario.torque, TorqueKnown::InMesh);
        assert_eq!((flown.scenario.legs.len(), flown.scenario.load.bias_n_m), (2, 2.0));
        let said = |text: &str| read("own.toml", text).unwrap_err().to_string();
        for (text, begins) in [
            (
                "base = \"anntena\"",
                "own.toml:1: base: found \"anntena\", allowed: \"antenna\", \"rover\", \"camera\", \"telescope\"; did \
                 you mean `antenna`?",
            ),
            ("drag_n_m = 1.0", "own.toml: base: missing; give one of antenna, rover, camera, telescope"),
            ("base = \"rover\"\ndrag_n_m = -1.0", "own.toml:2: drag_n_m: found -1, allowed: 0 to 10"),
            ("base = \"rover\"\ndrag_n_m = true", "own.toml:2: drag_n_m: found true, allowed: 0 to 10"),
            ("base = \"rover\"\nload = 3.0", "own.toml:2: load: found 3.0, allowed: a table [load]"),
            ("base = \"rover\"\nload.swing = [1.0]", "own.toml:2: load.swing: found an array, allowed: two numbers"),
            ("base = \"rover\"\nload.swing = [1.0, 90]", "own.toml:2: load.swing[1]: found 90, allowed: 0 to 50"),
            (
                "base = \"rover\"\ntorque = \"mesh\"",
                "own.toml:2: torque: found \"mesh\", allowed: \"on_load\", \"in_mesh\", \"current\", \"none\"",
            ),
            (
                "base = \"rover\"\n[servo]\nencoder_bits = 40",
                "own.toml:3: servo.encoder_bits: found 40, allowed: 8 to 30",
            ),
            ("base = \"rover\"\n[servo]\nlate_steps = 6", "own.toml:3: servo.late_steps: found 6, allowed: 0 to 5"),
            ("base = \"rover\"\nspeed = 1", "own.toml:2: speed: unknown key"),
        ] {
            let found = said(text);
            assert!(found.starts_with(begins), "{found}");
        }
        let misspelt = said("base = \"rover\"\n[servo]\nencoder_bit = 20");
        assert!(misspelt.starts_with("own.toml:3: servo.encoder_bit: unknown key"), "{misspelt}");
        assert!(misspelt.contains("did you mean `servo.encoder_bits`?"), "{misspelt}");
        let hot = said("base = \"telescope\"\nwarming_k_s = 1.0");
        assert!(hot.starts_with("own.toml:2: warming_k_s: found an end at 82 °C, allowed: "), "{hot}");
        for (text, begins) in [
            (
                "legs = [[2.0, 0.0], [2.0, 0.0, 9.0]]",
                "own.toml:2: legs[1]: found [2.0, 0.0, 9.0], allowed: [seconds, rad/s]",
            ),
            ("legs = [[2.0, 0.0], [2.0, 1e6]]", "own.toml:2: legs[1]: found [2.0, 1000000.0], allowed: "),
            ("legs = []", "own.toml:2: legs: found 0 s in all, allowed: 3 to 3600 s"),
            (
                "load.gust = [1.0, 0.0]",
                "own.toml:2: load.gust: found a corner of 0 Hz, allowed: 0.001 to 50 for gusts above 0 N·m",
            ),
        ] {
            let found = said(&format!("base = \"camera\"\n{text}\n"));
            assert!(found.starts_with(begins), "{found}");
        }
    }
}
