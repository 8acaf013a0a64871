//! Why a cause was named, or was not: one screen from the [trace](super::trace), for any cause of the library.

use std::fmt::Write as _;

use serde::Serialize;

use super::report::Diagnosis;
use super::trace::{Decision, Gate, Judged, Stage, TraceEntries};
use crate::causes::CauseName;

/// Why a cause was named, or was not.
#[derive(Serialize)]
pub struct Explanation<'a> {
    schema_version: u32,
    /// The cause.
    pub cause: CauseName,
    /// Whether it was named.
    pub named: bool,
    /// Why, in a sentence or two.
    because: String,
    /// Gain of evidence where it was last measured.
    evidence: Option<f64>,
    /// Its size where it was last measured, arcsec rms.
    size_arcsec: Option<f64>,
    /// If it was named its look-alikes, else the causes named that these data do not tell it from.
    look_alikes: Vec<CauseName>,
    /// What to record, or to give, to learn more of it.
    record: Vec<String>,
    /// The decisions on it.
    trace: TraceEntries<'a>,
    /// The decision against it; none for a cause that is named.
    #[serde(skip)]
    pub stopped: Option<&'a Decision>,
}

impl<'a> Explanation<'a> {
    /// Reads out of a diagnosis what it says of a cause.
    pub fn of(diagnosis: &'a Diagnosis, cause: CauseName) -> Explanation<'a> {
        let trace = &diagnosis.trace;
        let named = diagnosis.causes.iter().find(|found| found.name == cause);
        let steps = trace.telling(cause);
        let last = |gates: &[Gate]| {
            let of =
                |step: &&Decision| step.gates.iter().find(|judged| gates.contains(&judged.gate)).and_then(|j| j.value);
            steps.iter().rev().find_map(of)
        };
        let stopped = if named.is_some() { None } else { trace.stopped(cause) };
        let look_alikes = match named {
            Some(found) => found.look_alikes.clone(),
            None => {
                let alike = diagnosis.causes.iter().filter(|found| found.look_alikes.contains(&cause));
                alike.map(|found| found.name).collect()
            }
        };
        let need = stopped.into_iter().flat_map(|step| &step.gates).find_map(|judged| match judged.gate {
            Gate::Needs(need) => Some(need),
            _ => None,
        });
        let mut record: Vec<String> = need.and_then(|need| need.remedy()).map(str::to_owned).into_iter().collect();
        if !look_alikes.is_empty() {
            record.extend(diagnosis.next_experiment.clone());
        }
        if named.is_none() && record.is_empty() {
            record.extend(diagnosis.experiment_for_asked.clone());
        }
        let because = match named {
            Some(found) => {
                let alike = if look_alikes.is_empty() { "" } else { "; these data do not tell it from others" };
                format!("It is named, with a confidence of {:.0} %{alike}.", 100.0 * found.confidence)
            }
            None => not_named(stopped, &look_alikes),
        };
        let (evidence, size_arcsec) = (last(&[Gate::Evidence]), last(&[Gate::Size, Gate::SizeIfClear]));
        let (named, trace) = (named.is_some(), TraceEntries(steps));
        Explanation {
            schema_version: 1,
            cause,
            named,
            because,
            evidence,
            size_arcsec,
            look_alikes,
            record,
            trace,
            stopped,
        }
    }

    /// One screen.
    pub fn text(&self) -> String {
        let mut text = format!("{}: {}, {}\n", self.cause, self.cause.words(), self.cause.does());
        let _ = writeln!(text, "{}", self.because);
        if let (Some(evidence), Some(size)) = (self.evidence, self.size_arcsec) {
            let _ = writeln!(text, "evidence {evidence:.1}, size {size:.2} arcsec rms where it was last measured");
        }
        let TraceEntries(steps) = &self.trace;
        let told = steps.iter().filter(|step| step.stage != Stage::Data);
        for (shown, step) in told.enumerate() {
            if shown == MOST_STEPS {
                text.push_str("  ... the rest is in diagnosis.json under trace\n");
                break;
            }
            let round = if step.round > 0 { format!(", round {}", step.round) } else { String::new() };
            let against = step.against.map_or_else(String::new, |label| format!(", against {label}"));
            let _ = writeln!(text, "  {}{round}{against}:", step.stage.row());
            for judged in &step.gates {
                let sign = if judged.passed { '+' } else { '-' };
                let numbers = numbers(judged).map_or_else(String::new, |numbers| format!(": {numbers}"));
                let _ = writeln!(text, "    {sign} it {}{numbers}", judged.gate.row());
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

/// `found 0.82, asked for more than 1.50`.
pub fn numbers(judged: &Judged) -> Option<String> {
    let (value, limit) = (judged.value?, judged.limit?);
    let more = if judged.is_below { "less" } else { "more" };
    Some(format!("found {}, asked for {more} than {}", number(value), number(limit)))
}

/// Three digits, no more than two decimals.
fn number(value: f64) -> String {
    if value.abs() >= 100.0 { format!("{value:.0}") } else { format!("{value:.2}") }
}

/// Why a cause was not named: the decision against it, and the causes named that it is not told from.
fn not_named(stopped: Option<&Decision>, alike: &[CauseName]) -> String {
    let Some(step) = stopped else { return "It is not named: the search never came to it.".to_owned() };
    let Some(judged) = step.deciding() else { return "It is not named.".to_owned() };
    if let Gate::Needs(need) = judged.gate {
        return format!("These data cannot speak of it: {}.", need.missing());
    }
    let mut text = format!("It is not named: {}", step.stage.row());
    match step.against {
        Some(against) if step.stage == Stage::Rival => text += &format!(" ({against})"),
        _ => {}
    }
    let _ = write!(text, ", it did not hold that it {}", judged.gate.row());
    if let Some(numbers) = numbers(judged) {
        let _ = write!(text, ": {numbers}");
    }
    if let (Some(against), Gate::First | Gate::Refined) = (step.against, judged.gate) {
        let _ = write!(text, "; {against} was taken");
    }
    text.push('.');
    if !alike.is_empty() {
        let names: Vec<&str> = alike.iter().map(|cause| cause.as_str()).collect();
        let _ = write!(text, " These data do not tell it from {}, which is named.", names.join(", "));
    }
    text
}
