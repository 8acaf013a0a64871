//! Words for causes, parameters and faults.

use serde::Serialize;
use serde_json::json;

use crate::page::RichText;
use flexspline_identify::diagnosis::report::{Cause, Parameter};

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

/// A confidence, percent; never more than 99.
pub(super) fn percent(share: f64) -> String {
    format!("{:.0} %", (100.0 * share).clamp(0.0, 100.0))
}

/// A name of diagnosis.json in words.
pub(super) fn of(name: &impl Serialize) -> String {
    json!(name).as_str().unwrap_or_default().replace('_', " ")
}

/// All parameters of a cause, by their names in diagnosis.json.
pub(super) fn parameters(cause: &Cause) -> String {
    let of = |(name, p): (&&str, &Parameter)| {
        let [value, std] = p.digits().map(|number| number.replace('-', "−"));
        format!("{name} {value}\u{a0}±\u{a0}{std}")
    };
    cause.parameters.iter().map(of).collect::<Vec<_>>().join("; ")
}

/// A cause with its confidence and size: `eccentricity of the circular spline (97 %, 12″ rms)`.
pub(super) fn named(text: RichText, cause: &Cause) -> RichText {
    text.plain(format!("{} ({}, ", cause.name.words(), percent(cause.confidence)))
        .error(cause.size_arcsec, 2)
        .plain(" rms)")
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_identify::measurement::FaultName;

    #[test]
    fn lists_read_like_sentences() {
        let items: Vec<String> = ["a", "b", "c"].map(str::to_owned).into();
        assert_eq!((listed(&items[..1]).as_str(), listed(&items).as_str()), ("a", "a, b and c"));
        assert_eq!((begun("über").as_str(), of(&FaultName::ReadJitter).as_str()), ("Über", "read jitter"));
    }
}
