//! What the name of a column says of what it holds.

use super::Role;

/// Words of names, in the order in which the first that fits decides: a joint's velocity is a velocity, a motor's temperature a
/// temperature. English and German, as loggers and robots have them; the list is made by hand from the logs at hand.
const WORDS: [(Role, &[&str]); 9] = [
    (Role::Speed, &["vel", "velocity", "speed", "rpm", "omega", "dq", "drehzahl", "geschwindigkeit", "acc", "jerk"]),
    (Role::Temperature, &["temp", "temperature", "temperatur", "thermo", "degc"]),
    (Role::Torque, &["torque", "trq", "tau", "moment", "drehmoment", "mom", "tq", "load_cell", "nm", "lastmoment"]),
    (Role::Current, &["current", "curr", "cur", "amp", "amps", "iq", "strom"]),
    (Role::Error, &["error", "err", "deviation", "abweichung", "fehler", "te"]),
    (Role::Time, &["time", "timestamp", "zeit", "t", "date", "datetime", "clock", "epoch", "uhrzeit", "stamp"]),
    (Role::Orientation, &["orientation", "gravity", "tilt", "roll"]),
    (
        Role::Generator,
        &[
            "generator",
            "gen",
            "wave",
            "wavegen",
            "wg",
            "motor",
            "mot",
            "motorinc",
            "rotor",
            "input",
            "inp",
            "antrieb",
            "psi",
        ],
    ),
    (
        Role::Output,
        &["output", "out", "load", "loadinc", "link", "joint", "abtrieb", "arm", "axis", "achse", "last", "delta"],
    ),
];

/// Words of what was wanted, not measured.
const COMMANDED: [&str; 8] = ["cmd", "target", "command", "setpoint", "soll", "ref", "desired", "commanded"];
/// Words of what is a scatter or a quality of something else.
const ASIDE: [&str; 6] = ["sd", "std", "sigma", "quality", "status", "flag"];

/// What a name says: the role, and whether it is that of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Said {
    pub role: Option<Role>,
    pub commanded: bool,
}

/// What the name of a column says.
pub(super) fn said(name: &str) -> Said {
    let name = name.to_lowercase();
    let plain = name.split(['[', '(']).next().unwrap_or_default();
    let words: Vec<&str> = plain
        .split(|c: char| !c.is_alphanumeric())
        .map(|word| word.trim_end_matches(|c: char| c.is_ascii_digit()))
        .filter(|word| !word.is_empty())
        .collect();
    if words.iter().any(|word| ASIDE.contains(word)) {
        return Said { role: None, commanded: false };
    }
    let commanded = words.iter().any(|word| COMMANDED.contains(word));
    // A long word also counts inside of another: motorposition, Abtriebswinkel.
    let holds = |known: &&str| words.iter().any(|word| word == known || (known.len() >= 4 && word.contains(*known)));
    let role = WORDS.iter().find(|(_, known)| known.iter().any(&holds)).map(|(role, _)| *role);
    Said { role, commanded }
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
        ] {
            assert_eq!(said(name).role, role, "{name}");
        }
        assert!(said("target_joint_angles_3").commanded && !said("joint_angles_3").commanded);
    }
}
