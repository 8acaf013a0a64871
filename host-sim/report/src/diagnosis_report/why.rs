//! Why these causes, and not others: the gate that decided for each cause of the library, and every gate that it came
//! to.

use super::{table, words};
use crate::page::{Block, Detail, Section, Text, significant};
use flexspline_identify::causes::CauseName;
use flexspline_identify::diagnosis::explain::Explanation;
use flexspline_identify::diagnosis::report::Diagnosis;
use flexspline_identify::diagnosis::trace::{Gate, Judged, Stage, Step};

/// Decisions of a cause that are shown at most.
const MOST_STEPS: usize = 12;

/// The gate that decided for each cause.
pub(super) fn in_short(diagnosis: &Diagnosis) -> Section {
    let rows = CauseName::ALL.iter().map(|cause| decided(diagnosis, *cause)).collect();
    let blocks = vec![
        Block::paragraph(
            "Every cause of the library comes to the same gates; a name needs all of them. For each cause this is the \
             gate that decided: for one that is not named the one that it did not pass.",
        ),
        table("The gate that decided for each cause", &["Cause", "Named", "What decided", "Found", "Asked for"], rows),
    ];
    Section { id: "why".into(), title: "Why these causes, and not others".into(), detail: Detail::Summary, blocks }
}

/// Every gate that the causes came to which were refined at least.
pub(super) fn gate_by_gate(diagnosis: &Diagnosis) -> Section {
    let mut blocks = vec![Block::paragraph(
        "All gates that a cause came to, in their order, for causes that were at least refined. A sentence is what \
         the gate asks of the cause. Later rounds begin with the causes that the earlier ones chose.",
    )];
    for cause in CauseName::ALL {
        let steps = diagnosis.trace.telling(*cause);
        let refined = |step: &&Step| !matches!(step.stage, Stage::Data | Stage::Tried | Stage::Rival);
        if !steps.iter().any(refined) {
            continue;
        }
        let shown = |step: &&&Step| step.stage != Stage::Rival || !step.passed();
        let rows: Vec<Vec<Text>> = steps.iter().filter(shown).take(MOST_STEPS).flat_map(|step| gates(step)).collect();
        blocks.push(table(
            &words::begun(cause.words()),
            &["Where", "It has to hold that it", "Found", "Asked for", "Held"],
            rows,
        ));
    }
    Section { id: "why-gates".into(), title: "Every gate, cause by cause".into(), detail: Detail::Engineering, blocks }
}

/// Cause, whether it is named, what decided, found, asked for.
fn decided(diagnosis: &Diagnosis, cause: CauseName) -> Vec<Text> {
    let explanation = Explanation::of(diagnosis, cause);
    let named = if explanation.named.is_some() { "yes" } else { "no" };
    let settled = || diagnosis.trace.of(cause).rev().find(|step| step.stage == Stage::Settled);
    let step = explanation.stopped.or_else(settled);
    let judged = step.and_then(Step::deciding);
    let what = match judged {
        Some(Judged { gate: Gate::Needs(need), .. }) => need.missing().to_owned(),
        Some(judged) if judged.passed => "it passed every gate".to_owned(),
        Some(judged) => format!("it does not hold that it {}", judged.gate.asks()),
        None => "the search did not come to it".to_owned(),
    };
    let mut cells = vec![Text::new(words::begun(cause.words())), Text::new(named), Text::new(what)];
    cells.extend(numbers(judged.filter(|judged| !judged.passed)));
    cells
}

/// The gates of a step, a row each.
fn gates(step: &Step) -> Vec<Vec<Text>> {
    let against = step.against.map_or_else(String::new, |label| {
        format!(" ({})", label.cause().map_or_else(|| label.to_string(), |cause| cause.words().to_owned()))
    });
    let round = if step.round > 0 { format!(", round {}", step.round) } else { String::new() };
    let place = words::begun(&format!("{}{against}{round}", step.stage.words()));
    let row = |judged: &Judged| {
        let mut cells = vec![Text::new(place.clone()), Text::new(judged.gate.asks())];
        cells.extend(numbers(Some(judged)));
        cells.push(Text::new(if judged.passed { "yes" } else { "no" }));
        cells
    };
    step.gates.iter().map(row).collect()
}

/// What was found, and what was asked for.
fn numbers(judged: Option<&Judged>) -> [Text; 2] {
    let number = |value: f64| significant(value, 3).replace('-', "−");
    match judged.map(|judged| (judged.gate, judged.value, judged.limit)) {
        Some((gate, Some(value), Some(limit))) => {
            let more = if gate.is_below() { "less than" } else { "more than" };
            [Text::new(number(value)), Text::new(format!("{more} {}", number(limit)))]
        }
        _ => [Text::new("–"), Text::new("–")],
    }
}
