//! A scenario from a file: a built-in one, and what is otherwise.

use flexspline_mechanics::drive::GeneratorKind;
use flexspline_motion::scenario::{Leg, TableKnown, TorqueKnown};
use serde::Deserialize;

use super::built_in::{SCENARIOS, built_in};
use super::{Flown, FlyError};
use flexspline_base::suggest::did_you_mean;
use flexspline_base::toml_file::{Problem, TomlFile};

/// What a file may say.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    base: String,
    name: Option<String>,
    generator: Option<String>,
    legs: Option<Vec<Vec<f64>>>,
    acceleration_rad_s2: Option<f64>,
    load_kg_m2: Option<f64>,
    drag_n_m: Option<f64>,
    damping: Option<f64>,
    temperature_c: Option<f64>,
    warming_k_s: Option<f64>,
    friction: Option<f64>,
    friction_known: Option<f64>,
    load_fed_forward: Option<f64>,
    torque: Option<String>,
    torque_noise_n_m: Option<f64>,
    table: Option<String>,
    seed: Option<u32>,
    load: Option<LoadFile>,
    servo: Option<ServoFile>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct LoadFile {
    bias_n_m: Option<f64>,
    swing: Option<[f64; 2]>,
    gust: Option<[f64; 2]>,
    step: Option<[f64; 2]>,
    gravity: Option<[f64; 2]>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ServoFile {
    inertia_kg_m2: Option<f64>,
    largest_n_m: Option<f64>,
    position_hz: Option<f64>,
    speed_hz: Option<f64>,
    integral_hz: Option<f64>,
    late_steps: Option<usize>,
    encoder_bits: Option<u32>,
    jitter_s: Option<f64>,
}

const TORQUES: [(&str, TorqueKnown); 4] = [
    ("on_load", TorqueKnown::OnLoad),
    ("in_mesh", TorqueKnown::InMesh),
    ("current", TorqueKnown::Current),
    ("none", TorqueKnown::Not),
];
const TABLES: [(&str, TableKnown); 3] =
    [("nominal", TableKnown::Nominal), ("extended", TableKnown::Extended), ("calibrated", TableKnown::Calibrated)];
/// Temperatures of a flight, °C: what tables of HHD-95 have.
const COLDEST_C: f64 = -60.0;
const WARMEST_C: f64 = 80.0;
/// Every key.
const KEYS: [&str; 30] = [
    "base",
    "name",
    "generator",
    "legs",
    "acceleration_rad_s2",
    "load_kg_m2",
    "drag_n_m",
    "damping",
    "temperature_c",
    "warming_k_s",
    "friction",
    "friction_known",
    "load_fed_forward",
    "torque",
    "torque_noise_n_m",
    "table",
    "seed",
    "load.bias_n_m",
    "load.swing",
    "load.gust",
    "load.step",
    "load.gravity",
    "servo.inertia_kg_m2",
    "servo.largest_n_m",
    "servo.position_hz",
    "servo.speed_hz",
    "servo.integral_hz",
    "servo.late_steps",
    "servo.encoder_bits",
    "servo.jitter_s",
];
/// Slower gusts than this are none within a flight, Hz.
const SLOWEST_GUST_HZ: f64 = 1e-3;
/// Longest flight, s.
const LONGEST_S: f64 = 3600.0;

pub(super) fn refused(file: &str, field: &str, what: String) -> FlyError {
    FlyError::Scenario(Problem { place: file.to_owned(), field: field.to_owned(), what })
}

/// Sets values that were given, within their bounds.
struct Setter<'f> {
    file: &'f str,
}

impl Setter<'_> {
    fn refused(&self, field: &str, found: impl std::fmt::Display, allowed: &str) -> FlyError {
        refused(self.file, field, format!("found {found}, allowed: {allowed}"))
    }

    fn number(&self, field: &str, to: &mut f64, found: Option<f64>, [least, most]: [f64; 2]) -> Result<(), FlyError> {
        let Some(found) = found else { return Ok(()) };
        if !(found >= least && found <= most) {
            return Err(self.refused(field, found, &format!("{least} to {most}")));
        }
        *to = found;
        Ok(())
    }

    fn pair(
        &self,
        field: &str,
        to: &mut [f64; 2],
        found: Option<[f64; 2]>,
        bounds: [[f64; 2]; 2],
    ) -> Result<(), FlyError> {
        let Some([a, b]) = found else { return Ok(()) };
        self.number(&format!("{field}[0]"), &mut to[0], Some(a), bounds[0])?;
        self.number(&format!("{field}[1]"), &mut to[1], Some(b), bounds[1])
    }

    fn named<T: Copy>(
        &self,
        field: &str,
        to: &mut T,
        found: Option<&String>,
        names: &[(&str, T)],
    ) -> Result<(), FlyError> {
        let Some(found) = found else { return Ok(()) };
        let known = names.iter().find(|(name, _)| name == found);
        let allowed: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
        let hint = || did_you_mean("; ", found, allowed.iter().copied());
        *to = known.ok_or_else(|| self.refused(field, format!("{found:?}"), &(allowed.join(", ") + &hint())))?.1;
        Ok(())
    }
}

/// Reads a file.
///
/// # Errors
/// [`FlyError::Scenario`]: file, field, value found and what is allowed.
pub fn read(name: &str, text: &str) -> Result<Flown, FlyError> {
    let mut whole = TomlFile::new(name, text);
    if let Some(table) = whole.parse() {
        whole.refuse_unknown_keys(&table, &KEYS, &[]);
    }
    if let Some(problem) = whole.problems().into_iter().next() {
        return Err(FlyError::Scenario(problem));
    }
    let file: File =
        toml::from_str(text).map_err(|error| refused(name, "", error.to_string().trim_end().to_owned()))?;
    let set = Setter { file: name };
    let mut flown = built_in(&file.base).ok_or_else(|| {
        let hint = did_you_mean("; ", &file.base, SCENARIOS);
        set.refused("base", format!("{:?}", file.base), &(SCENARIOS.join(", ") + &hint))
    })?;
    if let Some(generator) = &file.generator {
        let kind = generator.parse::<GeneratorKind>();
        flown.kind = kind.map_err(|error| refused(name, "generator", error.to_string()))?;
    }
    let scenario = &mut flown.scenario;
    if let Some(own) = &file.name {
        scenario.name.clone_from(own);
    }
    if let Some(legs) = &file.legs {
        scenario.legs.clear();
        for (at, leg) in legs.iter().enumerate() {
            match leg[..] {
                [seconds, rate_rad_s] if seconds > 0.0 && rate_rad_s.abs() <= 1.0 => {
                    scenario.legs.push(Leg { seconds, rate_rad_s });
                }
                _ => {
                    let allowed = "[seconds, rad/s] with seconds above 0 and a rate of -1 to 1 rad/s";
                    return Err(set.refused(&format!("legs[{at}]"), format!("{leg:?}"), allowed));
                }
            }
        }
        // No legs are 0 s, and not -0.
        let seconds = scenario.seconds() + 0.0;
        if !(3.0..=LONGEST_S).contains(&seconds) {
            return Err(set.refused("legs", format!("{seconds} s in all"), &format!("3 to {LONGEST_S} s")));
        }
    }
    set.number("acceleration_rad_s2", &mut scenario.acceleration_rad_s2, file.acceleration_rad_s2, [1e-6, 10.0])?;
    set.number("load_kg_m2", &mut scenario.load_kg_m2, file.load_kg_m2, [0.01, 1e3])?;
    set.number("drag_n_m", &mut scenario.drag_n_m, file.drag_n_m, [0.0, 10.0])?;
    set.number("damping", &mut scenario.damping, file.damping, [1e-4, 0.5])?;
    set.number("temperature_c", &mut scenario.temperature_c, file.temperature_c, [COLDEST_C, WARMEST_C])?;
    set.number("warming_k_s", &mut scenario.warming_k_s, file.warming_k_s, [-1.0, 1.0])?;
    let ends_c = scenario.temperature_at_c(scenario.seconds());
    if !(COLDEST_C..=WARMEST_C).contains(&ends_c) {
        let allowed = format!("a flight that ends at {COLDEST_C} to {WARMEST_C} °C");
        return Err(set.refused("warming_k_s", format!("an end at {ends_c:.0} °C"), &allowed));
    }
    set.number("friction", &mut scenario.friction, file.friction, [0.0, 10.0])?;
    set.number("friction_known", &mut scenario.friction_known, file.friction_known, [0.0, 1.0])?;
    set.number("load_fed_forward", &mut scenario.load_fed_forward, file.load_fed_forward, [0.0, 1.0])?;
    set.number("torque_noise_n_m", &mut scenario.torque_noise_n_m, file.torque_noise_n_m, [0.0, 10.0])?;
    set.named("torque", &mut scenario.torque, file.torque.as_ref(), &TORQUES)?;
    set.named("table", &mut scenario.table, file.table.as_ref(), &TABLES)?;
    scenario.seed = file.seed.unwrap_or(scenario.seed);
    if let Some(load) = &file.load {
        let to = &mut scenario.load;
        let (torque, hz) = ([-200.0, 200.0], [0.0, 50.0]);
        set.number("load.bias_n_m", &mut to.bias_n_m, load.bias_n_m, torque)?;
        set.pair("load.swing", &mut to.swing, load.swing, [torque, hz])?;
        set.pair("load.gust", &mut to.gust, load.gust, [[0.0, 100.0], hz])?;
        if to.gust[0] > 0.0 && to.gust[1] < SLOWEST_GUST_HZ {
            let allowed = format!("{SLOWEST_GUST_HZ} to 50 for gusts above 0 N.m");
            return Err(set.refused("load.gust[1]", to.gust[1], &allowed));
        }
        set.pair("load.step", &mut to.step, load.step, [torque, [0.0, 1e3]])?;
        set.pair("load.gravity", &mut to.gravity, load.gravity, [torque, [-10.0, 10.0]])?;
    }
    if let Some(servo) = &file.servo {
        let to = &mut scenario.servo;
        set.number("servo.inertia_kg_m2", &mut to.inertia_kg_m2, servo.inertia_kg_m2, [1e-6, 1.0])?;
        set.number("servo.largest_n_m", &mut to.largest_n_m, servo.largest_n_m, [0.01, 100.0])?;
        set.number("servo.position_hz", &mut to.position_hz, servo.position_hz, [0.1, 100.0])?;
        set.number("servo.speed_hz", &mut to.speed_hz, servo.speed_hz, [0.1, 200.0])?;
        set.number("servo.integral_hz", &mut to.integral_hz, servo.integral_hz, [0.0, 100.0])?;
        set.number("servo.jitter_s", &mut to.jitter_s, servo.jitter_s, [0.0, 1e-3])?;
        to.late_steps = servo.late_steps.unwrap_or(to.late_steps);
        if to.late_steps > to.steps {
            return Err(set.refused("servo.late_steps", to.late_steps, &format!("0 to {} fifths of a tick", to.steps)));
        }
        to.encoder_bits = servo.encoder_bits.unwrap_or(to.encoder_bits);
        if !(8..=30).contains(&to.encoder_bits) {
            return Err(set.refused("servo.encoder_bits", to.encoder_bits, "8 to 30"));
        }
    }
    Ok(flown)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A key that is read and not in the list would be refused.
    #[test]
    fn every_key_is_read() {
        let value = |key: &str| match key {
            "base" => "\"rover\"",
            "name" => "\"own\"",
            "generator" => "\"cam\"",
            "torque" => "\"none\"",
            "table" => "\"nominal\"",
            "legs" => "[[2.0, 0.0], [2.0, 0.01]]",
            "load.swing" | "load.gust" | "load.step" | "load.gravity" => "[1.0, 0.5]",
            "seed" | "servo.late_steps" => "1",
            "servo.encoder_bits" => "16",
            "servo.jitter_s" | "warming_k_s" => "1e-3",
            _ => "0.3",
        };
        let lines = KEYS.iter().map(|key| format!("{key} = {}\n", value(key)));
        let found = read("own.toml", &lines.collect::<String>());
        assert_eq!(found.unwrap().scenario.servo.speed_hz, 0.3);
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
                "own.toml: base: found \"anntena\", allowed: antenna, rover, camera, telescope; did you mean \
                 `antenna`?",
            ),
            ("base = \"rover\"\ndrag_n_m = -1.0", "own.toml: drag_n_m: found -1, allowed: 0 to 10"),
            (
                "base = \"rover\"\ntorque = \"mesh\"",
                "own.toml: torque: found \"mesh\", allowed: on_load, in_mesh, current, none",
            ),
            (
                "base = \"rover\"\n[servo]\nencoder_bits = 40",
                "own.toml: servo.encoder_bits: found 40, allowed: 8 to 30",
            ),
        ] {
            let found = said(text);
            assert!(found.starts_with(begins), "{found}");
        }
        assert!(said("base = \"rover\"\nspeed = 1").starts_with("own.toml:2: speed: "));
        let misspelt = said("base = \"rover\"\n[servo]\nencoder_bit = 20");
        assert!(misspelt.starts_with("own.toml:3: servo.encoder_bit: unknown key"), "{misspelt}");
        assert!(misspelt.contains("did you mean `servo.encoder_bits`?"), "{misspelt}");
        let hot = said("base = \"telescope\"\nwarming_k_s = 1.0");
        for (text, begins) in [
            (
                "legs = [[2.0, 0.0], [2.0, 0.0, 9.0]]",
                "own.toml: legs[1]: found [2.0, 0.0, 9.0], allowed: [seconds, rad/s]",
            ),
            ("legs = [[2.0, 0.0], [2.0, 1e6]]", "own.toml: legs[1]: found [2.0, 1000000.0], allowed: "),
            ("legs = []", "own.toml: legs: found 0 s in all, allowed: 3 to 3600 s"),
            ("load.gust = [1.0, 0.0]", "own.toml: load.gust[1]: found 0, allowed: 0.001 to 50 for gusts above 0 N.m"),
        ] {
            let found = said(&format!("base = \"camera\"\n{text}\n"));
            assert!(found.starts_with(begins), "{found}");
        }
        assert!(hot.starts_with("own.toml: warming_k_s: found an end at 82 °C, allowed: "), "{hot}");
    }
}
