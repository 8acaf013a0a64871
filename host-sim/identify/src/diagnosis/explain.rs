//! Why a cause was named, or was not: one screen from the [trace](super::trace), for any cause of the library.

use std::fmt::Write as _;

use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

use super::candidate::Label;
use super::report::{Cause, Diagnosis};
use super::trace::{Entries, Gate, Judged, Stage, Step};
use crate::causes::CauseName;

/// Why a cause was named, or was not.
pub struct Explanation<'a> {
    /// The cause.
    pub cause: CauseName,
    /// It as it was named.
    pub named: Option<&'a Cause>,
    /// The decision against it; none for a cause that is named.
    pub stopped: Option<&'a Step>,
    /// Causes named that these data do not tell it from.
    pub alike: Vec<CauseName>,
    /// Rise of the misfit with it in the place of each cause named.
    pub in_place_of: Vec<(CauseName, f64)>,
    /// What to record, or to give, to learn more of it.
    pub record: Vec<String>,
    /// Gain of evidence where it was last measured.
    pub evidence: Option<f64>,
    /// Its size where it was last measured, arcsec rms.
    pub size_arcsec: Option<f64>,
    /// The decisions that tell of it.
    pub steps: Vec<&'a Step>,
}

impl<'a> Explanation<'a> {
    /// What a diagnosis says of a cause.
    #[must_use]
    pub fn of(diagnosis: &'a Diagnosis, cause: CauseName) -> Explanation<'a> {
        let trace = &diagnosis.trace;
        let named = diagnosis.causes.iter().find(|found| found.name == cause);
        let steps = trace.telling(cause);
        let last = |gates: &[Gate]| {
            let of = |step: &&Step| step.gates.iter().find(|judged| gates.contains(&judged.gate)).and_then(|j| j.value);
            steps.iter().rev().find_map(of)
        };
        let stopped = if named.is_some() { None } else { trace.stopped(cause) };
        let alike: Vec<CauseName> = diagnosis
            .causes
            .iter()
            .filter(|found| found.look_alikes.contains(&cause))
            .map(|found| found.name)
            .collect();
        let rival = |step: &&Step| step.stage == Stage::Rival && step.gates.iter().any(|j| j.gate == Gate::AsRival);
        let in_place_of = steps
            .iter()
            .copied()
            .filter(|step| rival(step))
            .filter_map(|step| Some((step.against?.cause()?, step.gates.first()?.value?)))
            .filter(|(of, _)| diagnosis.causes.iter().any(|found| found.name == *of))
            .collect();
        let need = stopped.and_then(|step| {
            step.gates.iter().find_map(|judged| match judged.gate {
                Gate::Needs(need) => Some(need),
                _ => None,
            })
        });
        let mut record: Vec<String> = need.and_then(|need| need.remedy()).map(str::to_owned).into_iter().collect();
        if named.is_some_and(|found| !found.look_alikes.is_empty()) || !alike.is_empty() {
            record.extend(diagnosis.next_experiment.clone());
        }
        if named.is_none() && record.is_empty() {
            record.extend(diagnosis.experiment_for_asked.clone());
        }
        Explanation {
            cause,
            named,
            stopped,
            alike,
            in_place_of,
            record,
            evidence: last(&[Gate::Evidence]),
            size_arcsec: last(&[Gate::Size, Gate::SizeIfClear]),
            steps,
        }
    }

    /// Why, in a sentence or two.
    #[must_use]
    pub(crate) fn because(&self) -> String {
        if let Some(found) = self.named {
            let alike = if found.look_alikes.is_empty() { "" } else { "; these data do not tell it from others" };
            return format!("It is named, with a confidence of {:.0} %{alike}.", 100.0 * found.confidence);
        }
        let Some(step) = self.stopped else {
            return "It is not named: the search never came to it.".to_owned();
        };
        let Some(judged) = step.deciding() else { return "It is not named.".to_owned() };
        if let Gate::Needs(need) = judged.gate {
            return format!("These data cannot speak of it: {}.", need.missing());
        }
        let mut text = format!("It is not named: {}", where_it_fell(step));
        let _ = write!(text, " it did not hold that it {}", judged.gate.asks());
        if let Some(numbers) = numbers(judged) {
            let _ = write!(text, ": {numbers}");
        }
        if let (Some(against), Gate::First | Gate::Refined) = (step.against, judged.gate) {
            let _ = write!(text, "; {against} was taken");
        }
        text.push('.');
        if !self.alike.is_empty() {
            let _ = write!(text, " These data do not tell it from {}, which is named.", names(&self.alike));
        }
        text
    }

    /// One screen.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = format!("{}: {}, {}\n", self.cause, self.cause.words(), self.cause.does());
        let _ = writeln!(text, "{}", self.because());
        if let (Some(evidence), Some(size)) = (self.evidence, self.size_arcsec) {
            let _ = writeln!(text, "evidence {evidence:.1}, size {size:.2} arcsec rms where it was last measured");
        }
        for (of, rise) in &self.in_place_of {
            let verb = if *rise < 0.0 { "lowers" } else { "raises" };
            let _ = writeln!(
                text,
                "in the place of {of} it {verb} the misfit by {:.0} (25 are five standard deviations)",
                rise.abs()
            );
        }
        let told = self.steps.iter().filter(|step| step.stage != Stage::Data && !is_plain_rival(step));
        for (shown, step) in told.enumerate() {
            if shown == MOST_STEPS {
                text.push_str("  ... the rest is in diagnosis.json under trace\n");
                break;
            }
            let round = if step.round > 0 { format!(", round {}", step.round) } else { String::new() };
            let against = step.against.map_or_else(String::new, |label: Label| format!(", against {label}"));
            let _ = writeln!(text, "  {}{round}{against}:", step.stage.words());
            for judged in &step.gates {
                let sign = if judged.passed { '+' } else { '-' };
                let numbers = numbers(judged).map_or_else(String::new, |numbers| format!(": {numbers}"));
                let _ = writeln!(text, "    {sign} it {}{numbers}", judged.gate.asks());
            }
        }
        for record in &self.record {
            let _ = writeln!(text, "to learn more: {record}");
        }
        text
    }
}

/// Steps on a screen. *Guess*: each takes a few of the 24 lines of a terminal.
const MOST_STEPS: usize = 6;

/// A rival that neither tells better nor looks alike says nothing on a screen.
fn is_plain_rival(step: &Step) -> bool {
    step.stage == Stage::Rival && (step.passed() || step.gates.iter().any(|judged| judged.gate == Gate::AsRival))
}

/// `found 0.82, asked for more than 1.50`.
#[must_use]
pub fn numbers(judged: &Judged) -> Option<String> {
    let (value, limit) = (judged.value?, judged.limit?);
    let more = if judged.gate.is_below() { "less" } else { "more" };
    Some(format!("found {}, asked for {more} than {}", number(value), number(limit)))
}

/// Three digits, no more than two decimals.
fn number(value: f64) -> String {
    if value.abs() >= 100.0 { format!("{value:.0}") } else { format!("{value:.2}") }
}

fn where_it_fell(step: &Step) -> String {
    match step.against {
        Some(against) if step.stage == Stage::Exchange || step.stage == Stage::Rival => {
            format!("{} ({against}),", step.stage.words())
        }
        _ => format!("{},", step.stage.words()),
    }
}

fn names(causes: &[CauseName]) -> String {
    causes.iter().map(|cause| cause.as_str()).collect::<Vec<_>>().join(", ")
}

impl Serialize for Explanation<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("schema_version", &1)?;
        map.serialize_entry("cause", &self.cause)?;
        map.serialize_entry("named", &self.named.is_some())?;
        map.serialize_entry("because", &self.because())?;
        map.serialize_entry("evidence", &self.evidence)?;
        map.serialize_entry("size_arcsec", &self.size_arcsec)?;
        let alike = self.named.map_or(&self.alike, |found| &found.look_alikes);
        map.serialize_entry("look_alikes", alike)?;
        map.serialize_entry("record", &self.record)?;
        map.serialize_entry("trace", &Entries(self.steps.clone()))?;
        map.end()
    }
}
