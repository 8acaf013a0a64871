//! Words for causes, parameters and faults.

use crate::page::{Text, significant};
use flexspline_identify::diagnosis::report::{Cause, Parameter, Verdict};
use flexspline_identify::measurement::{FaultName, Treatment};

/// The first letter made large.
pub(super) fn begun(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// A list in words: `a, b and c`.
pub(super) fn listed(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// A number of things up to twelve in words.
pub(super) fn counted(n: usize) -> String {
    const WORDS: [&str; 13] =
        ["no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"];
    WORDS.get(n).map_or_else(|| n.to_string(), |word| (*word).to_owned())
}

/// A confidence, percent; never more than 99.
pub(super) fn percent(share: f64) -> String {
    format!("{:.0} %", (100.0 * share).clamp(0.0, 100.0))
}

/// How a verdict is called in a table.
pub(super) fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::None => "nothing found",
        Verdict::Explained => "explained",
        Verdict::PartlyExplained => "partly explained",
        Verdict::Unknown => "unknown",
    }
}

/// Endings of the names of parameters, and the unit that each stands for; the longest first.
const UNITS: [(&str, &str); 16] = [
    ("_arcsec_per_k", "″/K"),
    ("_per_k_arcsec", "″/K"),
    ("_n_m_per_rad", "N·m/rad"),
    ("_relative_per_k", "/K"),
    ("_per_k", "/K"),
    ("_arcsec", "″"),
    ("_n_m", "N·m"),
    ("_um", "µm"),
    ("_mm", "mm"),
    ("_rad", "rad"),
    ("_deg", "°"),
    ("_hz", "Hz"),
    ("_ppm", "ppm"),
    ("_ms", "ms"),
    ("_s", "s"),
    ("_c", "°C"),
];

/// Decimals that show two digits of the uncertainty.
fn decimals(p: Parameter) -> usize {
    let fine = if p.std > 0.0 && p.std.is_finite() { p.std } else { 0.01 * p.value.abs().max(1e-6) };
    (1.0 - fine.log10().floor()).clamp(0.0, 8.0) as usize
}

/// A parameter with its uncertainty and unit.
pub(super) fn parameter(name: &str, p: Parameter) -> String {
    let (words, unit) = UNITS
        .iter()
        .find_map(|(ending, unit)| name.strip_suffix(ending).map(|words| (words, *unit)))
        .unwrap_or((name, ""));
    if p.std == 0.0 && p.value.fract() == 0.0 {
        return format!("{} {}{}{unit}", words.replace('_', " "), p.value, if unit.is_empty() { "" } else { " " });
    }
    let (places, gap) = (decimals(p), if unit.is_empty() || unit.starts_with(['″', '/', '°']) { "" } else { " " });
    let number = |v: f64| format!("{v:.places$}").replace('-', "−");
    format!("{} {}\u{a0}±\u{a0}{}{gap}{unit}", words.replace('_', " "), number(p.value), number(p.std))
}

/// All parameters of a cause.
pub(super) fn parameters(cause: &Cause) -> String {
    cause.parameters.iter().map(|(name, p)| parameter(name, *p)).collect::<Vec<_>>().join("; ")
}

/// A cause with what a reader has to know of it at once: `eccentricity of the circular spline (97 %, 12″ rms)`.
pub(super) fn named(text: Text, cause: &Cause) -> Text {
    text.plain(format!("{} ({}, ", cause.name.words(), percent(cause.confidence)))
        .error(cause.size_arcsec, 2)
        .plain(" rms)")
}

/// A fault in words.
pub(super) fn fault(name: FaultName) -> &'static str {
    match name {
        FaultName::EncoderIndexJump => "index jump of an encoder",
        FaultName::FrozenChannel => "frozen channel",
        FaultName::MissingSamples => "missing samples",
        FaultName::ClockError => "clock error",
        FaultName::Outliers => "outliers",
        FaultName::UnitMismatch => "wrong unit, sign or column",
        FaultName::Quantisation => "coarse resolution",
        FaultName::Drift => "drift",
        FaultName::ReadJitter => "angles not read at one instant",
        FaultName::Stalls => "a logger that stands still",
        FaultName::CounterRestart => "a counter that begins anew",
        FaultName::TorqueSign => "wrong sign of the torque",
        FaultName::TorqueScale => "torque of another shaft, unit or origin",
        FaultName::TorqueZero => "zero of the torque sensor",
        FaultName::PositionJump => "a position that jumps",
        FaultName::AveragedRows => "rows that are means",
    }
}

/// What was done about a fault.
pub(super) fn treatment(treatment: Treatment) -> &'static str {
    match treatment {
        Treatment::Repaired => "repaired",
        Treatment::Masked => "left out",
        Treatment::Kept => "left as it is",
    }
}

/// An order: four digits, whole ones without a point.
pub(super) fn order(order: f64) -> String {
    let text = significant(order, 4);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A time, s.
pub(super) fn seconds(time_s: f64) -> String {
    format!("{time_s:.2} s")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_have_the_digits_of_their_uncertainty_and_a_unit() {
        for (name, value, std, text) in [
            ("amplitude_um", 9.8123, 0.4321, "amplitude 9.81 ± 0.43 µm"),
            ("growth_arcsec", -12.0, 3.0, "growth −12.0 ± 3.0″"),
            ("clearance_arcsec_per_k", 1.234_56, 0.012, "clearance 1.235 ± 0.012″/K"),
            ("delay_s", 0.002, 0.000_05, "delay 0.002000 ± 0.000050 s"),
            ("harmonic", 2.0, 0.0, "harmonic 2"),
            ("torque_n_m", 8.1, 0.2, "torque 8.10 ± 0.20 N·m"),
        ] {
            assert_eq!(parameter(name, Parameter { value, std }).replace('\u{a0}', " "), text);
        }
    }

    #[test]
    fn lists_read_like_sentences() {
        let items: Vec<String> = ["a", "b", "c"].map(str::to_owned).into();
        assert_eq!((listed(&items[..1]).as_str(), listed(&items).as_str()), ("a", "a, b and c"));
        assert_eq!((order(2.0).as_str(), order(1.978_9).as_str(), order(188.0).as_str()), ("2", "1.979", "188"));
        assert_eq!((begun("über").as_str(), counted(2).as_str(), counted(14).as_str()), ("Über", "two", "14"));
    }
}
