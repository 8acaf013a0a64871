//! Why these causes, and not others: the gate that decided for each cause of the library. Every gate of a cause is in
//! diagnosis.json, and `diagnose --explain` prints it.

use super::words;
use crate::page::{PageBlock, PageSection, RichText, significant};
use flexspline_identify::causes::CauseName;
use flexspline_identify::diagnosis::explain::Explanation;
use flexspline_identify::diagnosis::report::Diagnosis;
use flexspline_identify::diagnosis::trace::{Decision, Gate, Judged, Stage};

/// The gate that decided for each cause.
pub(super) fn in_short(diagnosis: &Diagnosis) -> PageSection {
    let rows = CauseName::ALL.iter().map(|cause| decided(diagnosis, *cause)).collect();
    let header = ["Cause", "Named", "What decided", "Found", "Asked for"];
    let blocks = vec![
        PageBlock::paragraph(
            "Every cause of the library comes to the same gates; a name needs all of them. For each cause this is the \
             gate that decided: for one that is not named the one that it did not pass. diagnose --explain CAUSE \
             prints all gates of a cause.",
        ),
        PageBlock::table("The gate that decided for each cause", &header, rows),
    ];
    PageSection::folded("why", "Why these causes, and not others", blocks)
}

/// Cause, whether it is named, what decided, found, asked for.
fn decided(diagnosis: &Diagnosis, cause: CauseName) -> Vec<RichText> {
    let explanation = Explanation::of(diagnosis, cause);
    let named = if explanation.named { "yes" } else { "no" };
    let settled = || diagnosis.trace.of(cause).rev().find(|step| step.stage == Stage::Settled);
    let step = explanation.stopped.or_else(settled);
    let judged = step.and_then(Decision::deciding);
    let what = match judged {
        Some(Judged { gate: Gate::Needs(need), .. }) => need.missing().to_owned(),
        Some(judged) if judged.passed => "it passed every gate".to_owned(),
        Some(judged) => format!("it does not hold that it {}", judged.gate.asks()),
        None => "the search did not come to it".to_owned(),
    };
    let mut cells = vec![RichText::new(words::begun(cause.words())), RichText::new(named), RichText::new(what)];
    cells.extend(numbers(judged.filter(|judged| !judged.passed)));
    cells
}

/// The value found, and the limit.
fn numbers(judged: Option<&Judged>) -> [RichText; 2] {
    let number = |value: f64| significant(value, 3).replace('-', "−");
    match judged {
        Some(Judged { value: Some(value), limit: Some(limit), is_below, .. }) => {
            let more = if *is_below { "less than" } else { "more than" };
            [RichText::new(number(*value)), RichText::new(format!("{more} {}", number(*limit)))]
        }
        _ => [RichText::new("–"), RichText::new("–")],
    }
}
