//! The meaning of a column's name and unit.

use super::Role;
use crate::measurement::{Family, Unit};

/// Words of names, in the order in which the first that fits decides: a joint's velocity is a velocity, a motor's
/// temperature a temperature. English and German, as loggers, robots and controllers have them; the list is made by
/// hand from the logs at hand. A word of four letters and more also counts inside of another.
const WORDS: [(Role, &[&str]); 9] = [
    (
        Role::Speed,
        &[
            "vel", "velo", "speed", "spd", "rpm", "omega", "dq", "qd", "qdot", "dtheta", "drehzahl", "geschwin", "acc",
            "accel", "jerk",
        ],
    ),
    (Role::Temperature, &["temp", "thermo", "degc"]),
    (Role::Torque, &["torque", "trq", "tau", "effort", "moment", "mom", "tq", "nm"]),
    (Role::Current, &["curr", "cur", "amp", "amps", "iq", "strom"]),
    (Role::Error, &["error", "err", "deviatio", "abweich", "fehler", "te"]),
    (Role::Time, &["time", "zeit", "t", "date", "clock", "epoch", "stamp"]),
    (Role::Orientation, &["orientat", "gravity", "tilt", "roll"]),
    (Role::Generator, &["generato", "gen", "wave", "wg", "motor", "mot", "rotor", "input", "inp", "antrieb", "psi"]),
    (Role::Output, &["output", "out", "load", "link", "joint", "abtrieb", "arm", "last", "delta"]),
];

/// Words of an angle, of whatever shaft.
const ANGLES: [&str; 12] =
    ["position", "pos", "actpos", "angle", "winkel", "theta", "phi", "q", "encoder", "enc", "inc", "rotation"];
/// Words of what was wanted, not measured.
const COMMANDED: [&str; 15] = [
    "cmd", "target", "command", "setpoint", "soll", "ref", "desired", "demand", "goal", "set", "setpos", "des", "d",
    "planned", "request",
];
/// Words of what is a scatter or a quality of something else, or what a controller has not reached yet.
const ASIDE: [&str; 11] =
    ["sd", "std", "sigma", "quality", "status", "flag", "seq", "sequence", "crc", "tracking", "schlepp"];

/// The meaning of a column's name and unit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct NameMeaning {
    /// Its contents.
    pub role: Option<Role>,
    /// Whether it is that of a command.
    pub commanded: bool,
    /// Whether it is an angle, of whatever shaft.
    pub angle: bool,
    /// Whether it is of something else altogether: a scatter, a counter of messages.
    pub aside: bool,
    /// The number of the joint in a robot.
    pub joint: Option<u32>,
}

/// The meaning of a name, and of the unit that stands in a line of its own if there is one. Units count before words: a
/// load in N·m is a torque, whatever it is called.
pub(super) fn said(name: &str, unit: Option<&str>) -> NameMeaning {
    let words = words(name);
    let is = |known: &str| words.iter().any(|word| word == known);
    // A long word also counts inside of another: motorposition, Abtriebswinkel.
    let holds = |known: &str| is(known) || words.iter().any(|word| known.len() >= 4 && word.contains(known));
    let any = |known: &[&str]| known.iter().any(|known| holds(known));
    let joint = joint(name);
    if any(&ASIDE) || is("following") {
        return NameMeaning { aside: true, joint, ..NameMeaning::default() };
    }
    let by_unit = role_by_unit(name, unit);
    let angle = by_unit.map_or_else(|| any(&ANGLES), |role| role == Role::Unknown);
    let fits = |role: Role| match by_unit {
        Some(Role::Unknown) => matches!(role, Role::Error | Role::Orientation | Role::Generator | Role::Output),
        // A drive's "current position" is not one in amperes.
        None => !(role == Role::Current && angle),
        _ => true,
    };
    let by_words = WORDS.iter().find(|(role, known)| fits(*role) && any(known)).map(|(role, _)| *role);
    let role = match by_unit {
        Some(Role::Current) => by_words.filter(|role| *role == Role::Torque).or(Some(Role::Current)),
        Some(Role::Time) => by_words.or(Some(Role::Time)),
        Some(Role::Unknown) | None => by_words,
        certain => certain,
    };
    let angle = angle && role.is_none_or(|role| role.is_angle());
    NameMeaning { role, commanded: any(&COMMANDED), angle, aside: false, joint }
}

/// The role by the unit in a line of its own, in brackets, or at the end of a name; [`Role::Unknown`] for an angle, of
/// whatever shaft.
fn role_by_unit(name: &str, line: Option<&str>) -> Option<Role> {
    let Some(text) = line.or_else(|| Unit::bracketed(name)) else {
        // A single letter at the end of a name is a letter more often than a unit: phase_A, sensor_C.
        let unit = Unit::in_name(name).filter(|unit| matches!(unit.family(), Family::Angle | Family::Torque));
        return unit.and_then(role_of).filter(|role| *role != Role::Current || name.ends_with("_mA"));
    };
    let text = text.trim().trim_matches(['[', ']', '(', ')']).trim();
    let lower = text.to_lowercase();
    let per_time = ["/s", "/min", "/sec", "/h", "s^-1", "s-1"].iter().any(|end| lower.contains(end));
    if per_time || ["rpm", "1/min", "u/min", "min-1"].contains(&lower.as_str()) {
        return Some(Role::Speed);
    }
    Unit::in_brackets(text).and_then(role_of)
}

fn role_of(unit: Unit) -> Option<Role> {
    match unit {
        Unit::Ampere | Unit::Milliampere => Some(Role::Current),
        // A transducer of anything.
        Unit::Volt => None,
        unit => Some(match unit.family() {
            Family::Angle => Role::Unknown,
            Family::Torque => Role::Torque,
            Family::Temperature => Role::Temperature,
            Family::Time => Role::Time,
        }),
    }
}

/// The words of a name, lower case, whole and parted where a capital follows a small letter: `ActPos` is `actpos`,
/// `act` and `pos`.
fn words(name: &str) -> Vec<String> {
    let plain = name.split(['[', '(']).next().unwrap_or_default();
    let mut words = Vec::new();
    for whole in plain.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()) {
        words.push(whole.to_lowercase());
        let letters: Vec<char> = whole.chars().collect();
        let borders = (1..letters.len()).filter(|k| letters[*k].is_uppercase() && letters[k - 1].is_lowercase());
        let borders: Vec<usize> = [0].into_iter().chain(borders).chain([letters.len()]).collect();
        if borders.len() > 2 {
            let parts =
                borders.windows(2).map(|ends| letters[ends[0]..ends[1]].iter().collect::<String>().to_lowercase());
            // A letter alone is none of the words: TMotor.
            words.extend(parts.filter(|part| part.chars().count() > 1));
        }
    }
    let without_numbers = words.iter().map(|word| word.trim_end_matches(|c: char| c.is_ascii_digit()).to_owned());
    without_numbers.filter(|word| !word.is_empty()).collect()
}

/// The number of a joint or an axis in a name: the last number, if it is a small one. `#3` is a place in the file, and
/// no name.
fn joint(name: &str) -> Option<u32> {
    if name.starts_with('#') || !name.contains(char::is_alphabetic) {
        return None;
    }
    let bytes = name.as_bytes();
    let end = 1 + bytes.iter().rposition(u8::is_ascii_digit)?;
    let start = bytes[..end].iter().rposition(|byte| !byte.is_ascii_digit()).map_or(0, |before| before + 1);
    name[start..end].parse().ok().filter(|number| *number < 100)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_what_they_hold() {
        for (name, role) in [
            ("time_s", Some(Role::Time)),
            ("Zeit", Some(Role::Time)),
            ("Timestamp", Some(Role::Time)),
            ("encoder_motorinc_3", Some(Role::Generator)),
            ("encoder_loadinc_3", Some(Role::Output)),
            ("joint_velocity_3", Some(Role::Speed)),
            ("joint_torque_current_3", Some(Role::Torque)),
            ("motor_temp", Some(Role::Temperature)),
            ("Motorstrom [A]", Some(Role::Current)),
            ("wave_gen_turns", Some(Role::Generator)),
            ("error_arcsec", Some(Role::Error)),
            ("star_sd_arcsec", None),
            ("Abtriebswinkel (deg)", Some(Role::Output)),
            ("Drehmoment [Nm]", Some(Role::Torque)),
            ("q3", None),
            ("#4", None),
            ("field.effort0", Some(Role::Torque)),
            ("/joint_states/motor_3/effort", Some(Role::Torque)),
            ("Axis2.Torque", Some(Role::Torque)),
            ("Axis1.ActPos", None),
            ("Axis1.ActVelo", Some(Role::Speed)),
            ("motor [rpm]", Some(Role::Speed)),
            ("joint (rad/s)", Some(Role::Speed)),
            ("load (Nm)", Some(Role::Torque)),
            ("load (deg)", Some(Role::Output)),
            ("TMotor [°C]", Some(Role::Temperature)),
            ("current_position", None),
            ("motor_current", Some(Role::Current)),
            ("phase_A", None),
        ] {
            assert_eq!(said(name, None).role, role, "{name}");
        }
        // A line of units decides as brackets do.
        assert_eq!(said("load", Some("Nm")).role, Some(Role::Torque));
        assert_eq!(said("Kanal 3", Some("[rad/s]")).role, Some(Role::Speed));
    }

    #[test]
    fn names_show_angles_and_commands_and_joints() {
        for name in ["field.position0", "Axis1.ActPos", "q3", "theta_2", "Kanal [deg]", "current_position", "motor_enc"]
        {
            assert!(said(name, None).angle && !said(name, None).commanded, "{name}");
        }
        for name in ["effort0", "dq3", "temp_2", "x", "position_sd", "torque_angle_Nm"] {
            assert!(!said(name, None).angle, "{name}");
        }
        for name in ["target_joint_angles_3", "Axis1.SetPos", "q_d", "Sollposition", "motor_setpoint", "pos_ref"] {
            assert!(said(name, None).commanded, "{name}");
        }
        for (name, joint) in [
            ("joint_angles_3", Some(3)),
            ("Axis1.ActPos", Some(1)),
            ("field.position0", Some(0)),
            ("position[2]", Some(2)),
            ("J4 torque [Nm]", Some(4)),
            ("#6", None),
            ("12.5", None),
            ("motor", None),
            ("channel_20231", None),
        ] {
            assert_eq!(said(name, None).joint, joint, "{name}");
        }
    }
}
