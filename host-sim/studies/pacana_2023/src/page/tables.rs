//! Tables of the page.

use crate::Reproduction;
use crate::claim::{Check, Claim, Number, Of, Verdict};
use crate::metrics::ProtocolMetrics;
use crate::rank::Agreement;
use crate::runs::torques_of;
use flexspline_base::units::ARCMIN_PER_RAD;
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_report::page::{Table, Text, significant};

fn header<const N: usize>(words: [&str; N]) -> Vec<String> {
    words.map(str::to_owned).into()
}

/// A number with its unit; angles of the output follow the unit switch.
fn number(value: f64, unit: &str, digits: usize) -> Text {
    match unit {
        _ if !value.is_finite() => Text::new("–"),
        "′" => Text::default().error(60.0 * value, digits),
        "″" | "arcsec" => Text::default().error(value, digits),
        "" => Text::new(significant(value, digits)),
        "°" => Text::new(format!("{}°", significant(value, digits))),
        unit => Text::new(format!("{} {unit}", significant(value, digits))),
    }
}

fn join(mut left: Text, right: Text) -> Text {
    left.0.extend(right.0);
    left
}

/// Numbers with what they are of.
fn numbers(of: &[Number]) -> Text {
    let mut text = Text::default();
    for (k, n) in of.iter().filter(|n| n.value.is_finite()).enumerate() {
        let name = if n.name.is_empty() { String::new() } else { format!("{} ", n.name) };
        text = join(text.plain(format!("{}{name}", if k > 0 { ", " } else { "" })), number(n.value, n.unit, 3));
    }
    if text.0.is_empty() { Text::new("–") } else { text }
}

/// The paper's numbers and ours.
fn paper_and_ours(claim: &Claim) -> Text {
    let finite = |of: &[Number]| of.iter().any(|n| n.value.is_finite());
    match (finite(&claim.paper), finite(&claim.ours)) {
        (true, true) => join(join(Text::new("Paper: "), numbers(&claim.paper)).plain(". Ours: "), numbers(&claim.ours)),
        (true, false) => join(Text::new("Paper: "), numbers(&claim.paper)),
        (false, true) => join(Text::new("Ours: "), numbers(&claim.ours)),
        (false, false) => Text::new("None"),
    }
}

/// Parts of the paper, in order.
pub(super) fn parts(r: &Reproduction) -> Vec<&'static str> {
    let mut parts: Vec<&'static str> = r.claims.iter().map(|claim| claim.part).collect();
    parts.dedup();
    parts
}

/// How many claims have which verdict, by part of the paper.
pub(super) fn by_part(r: &Reproduction) -> Table {
    let count = |of: &dyn Fn(&Claim) -> bool| Text::new(r.claims.iter().filter(|claim| of(claim)).count().to_string());
    let row = |name: &str, within: &dyn Fn(&Claim) -> bool| {
        let cells = Verdict::ALL.into_iter().map(|verdict| count(&|claim| within(claim) && claim.verdict == verdict));
        [Text::new(name)].into_iter().chain(cells).collect::<Vec<Text>>()
    };
    let mut rows: Vec<Vec<Text>> = parts(r).into_iter().map(|part| row(part, &|claim| claim.part == part)).collect();
    rows.push(row("All", &|_| true));
    Table {
        caption: "Claims of the paper by verdict".into(),
        header: [&["Part of the paper"][..], &Verdict::ALL.map(Verdict::name)]
            .concat()
            .into_iter()
            .map(Into::into)
            .collect(),
        rows,
    }
}

/// The claims of a part.
pub(super) fn claims(r: &Reproduction, part: &str) -> Table {
    let rows = r.claims.iter().filter(|claim| claim.part == part).map(|claim| {
        vec![
            Text::new(claim.id),
            Text::default().strong(claim.verdict.name()),
            Text::new(format!("{} [{}]", claim.says, claim.place)),
            paper_and_ours(claim),
            Text::new(claim.reason.clone()),
        ]
    });
    Table {
        caption: part.into(),
        header: header(["Claim", "Verdict", "What the paper says", "Numbers", "Why"]),
        rows: rows.collect(),
    }
}

fn error(value: Option<f64>) -> Text {
    value.map_or_else(|| Text::new("–"), |arcsec| Text::default().error(arcsec, 3))
}

/// Effects of the changes on one generator.
pub(super) fn experiments(r: &Reproduction, kind: GeneratorKind) -> Option<Table> {
    let rows: Vec<Vec<Text>> = r
        .experiments
        .iter()
        .filter_map(|experiment| {
            let effect = experiment.effects.iter().find(|e| e.generator == kind.name())?;
            let Some(m) = effect.metrics else {
                let mut row = vec![Text::new(experiment.name), Text::new("no equilibrium")];
                row.resize(9, Text::new("–"));
                return Some(row);
            };
            // A mean or a range over a slow wave is neither a lag nor a ripple.
            let steady = |value: Option<f64>| error(value.filter(|_| m.drift_arcsec.is_some_and(|d| d < 1.0)));
            Some(vec![
                Text::new(experiment.name),
                error(effect.largest_arcmin.map(|arcmin| 60.0 * arcmin)),
                error(Some(m.error_at_turn_arcsec)),
                error(Some(m.error_at_end_arcsec)),
                error(m.drift_arcsec),
                steady(m.lag_forward_arcsec),
                steady(m.ripple_pp_arcsec),
                steady(m.half_width_arcsec),
                error(m.lost_motion_arcsec),
            ])
        })
        .collect();
    let paper = crate::paper::error_rad(kind).map(|rad| rad * ARCMIN_PER_RAD);
    (!rows.is_empty()).then(|| Table {
        caption: match paper {
            Some(arcmin) => {
                format!("Changes of the model, {}; the paper has {arcmin:.1}′ as the largest error", kind.in_words())
            }
            None => format!("Changes of the model, {}; the paper gives no number", kind.in_words()),
        },
        header: header([
            "Change",
            "Largest error",
            "At +1 rad",
            "At −1 rad",
            "Drift*",
            "Mean lag",
            "Ripple",
            "Half-width at reversal",
            "0–A against B–C",
        ]),
        rows,
    })
}

/// What is changed, and what to take away.
pub(super) fn takeaways(r: &Reproduction) -> Table {
    let rows =
        r.experiments.iter().map(|e| vec![Text::new(e.name), Text::new(e.what.clone()), Text::new(e.takeaway.clone())]);
    Table {
        caption: "What was changed and what it shows. *Drift: how far the error moves between a pitch and one many \
                  whole pitches on, 0 in a sound drive; where it is more than 1″ there is no steady lag, ripple or \
                  half-width"
            .into(),
        header: header(["Change", "Exactly", "To take away"]),
        rows: rows.collect(),
    }
}

/// Every metric of the standard runs.
pub(super) fn metrics(r: &Reproduction) -> Table {
    type Column = (&'static str, fn(&ProtocolMetrics) -> Option<f64>);
    let columns: [Column; 7] = [
        ("Largest error", |m| Some(m.largest_out_arcsec.max(m.largest_back_arcsec))),
        ("Mean lag forward", |m| m.lag_forward_arcsec),
        ("Mean lag backward", |m| m.lag_backward_arcsec),
        ("Ripple", |m| m.ripple_pp_arcsec),
        ("Half-width at reversal", |m| m.half_width_arcsec),
        ("Dwell over the ratio", |m| m.dwell_arcsec),
        ("0–A against B–C", |m| m.lost_motion_arcsec),
    ];
    let runs =
        GeneratorKind::ALL.into_iter().flat_map(|kind| torques_of(kind).iter().map(move |&torque| (kind, torque)));
    let rows = runs.filter_map(|(kind, torque)| {
        let solved = r.runs.get(kind, torque)?;
        let name =
            if torque == 0.0 { kind.in_words().to_owned() } else { format!("{}, {torque:+.0} N·m", kind.in_words()) };
        let mut row = vec![Text::new(name.replace('-', "\u{2011}").replace(" \u{2011}", " −"))];
        row.extend(columns.iter().map(|(_, of)| error(of(&solved.metrics))));
        row.push(number(solved.metrics.peak_mpa, "MPa", 3));
        row.push(number(solved.peak_from_major_deg, "°", 2));
        Some(row)
    });
    let mut names: Vec<String> = vec!["Run".into()];
    names.extend(columns.iter().map(|(name, _)| (*name).to_owned()));
    names.extend(["Largest stress".to_owned(), "from the major axis".to_owned()]);
    Table { caption: format!("The protocol, {} mesh", r.settings.mesh), header: names, rows: rows.collect() }
}

fn agreement(a: &Agreement) -> String {
    format!("{:+.1} ({} as in the paper, {} reversed, {} undecided)", a.tau, a.concordant, a.discordant, a.undecided)
        .replace('-', "−")
}

/// Metrics with their spread.
pub(super) fn rankings(r: &Reproduction) -> Table {
    let order = ["four-roller", "two-roller", "double-disc", "cam"];
    let rows = r.rankings.iter().map(|ranking| {
        let mut row = vec![Text::new(ranking.metric)];
        row.extend(order.map(|name| {
            let found = ranking.measured.iter().find(|(kind, _)| *kind == name);
            found.map_or_else(
                || Text::new("–"),
                |(_, m)| join(number(m.value, ranking.unit, 4).plain(" ± "), number(m.spread, ranking.unit, 2)),
            )
        }));
        row.push(Text::new(format!("tau {}", agreement(&ranking.against_paper))));
        row
    });
    Table {
        caption: "Value ± spread over all discretisations, and how the order compares with the paper's".into(),
        header: header(["Metric", "Four-roller", "Two-roller", "Double disc", "Cam", "Against the paper's order"]),
        rows: rows.collect(),
    }
}

fn bounds(check: &Check) -> String {
    let of = |x: f64| significant(x, 4);
    match (check.at_least, check.at_most) {
        (Some(low), Some(high)) if low == high => format!("is {}", of(low)),
        (Some(low), Some(high)) => format!("within {} and {}", of(low), of(high)),
        (Some(low), None) => format!("at least {}", of(low)),
        (None, Some(high)) => format!("at most {}", of(high)),
        (None, None) => "none".into(),
    }
}

/// Metric, checks and bounds of every claim.
pub(super) fn checks(r: &Reproduction) -> Table {
    let mut rows = Vec::new();
    for claim in &r.claims {
        let head = || vec![Text::new(claim.id), Text::new(claim.metric)];
        if let Some(missing) = claim.missing {
            let cells = [format!("missing: {missing}"), "–".into(), "–".into(), "–".into()];
            rows.push(head().into_iter().chain(cells.map(Text::new)).collect());
        }
        for check in &claim.checks {
            let whose = if check.of == Of::Paper { "the paper's" } else { "ours" };
            let unit = if check.unit.is_empty() { String::new() } else { format!(" {}", check.unit) };
            let value = if check.value.is_finite() { significant(check.value, 4) } else { "–".into() };
            let cells = [
                format!("{whose}: {}", check.what),
                format!("{value}{unit}"),
                format!("{}{unit}", bounds(check)),
                if check.passes() { "holds".into() } else { "fails".to_owned() },
            ];
            rows.push(head().into_iter().chain(cells.map(Text::new)).collect());
        }
    }
    Table {
        caption: "What decided".into(),
        header: header(["Claim", "Metric", "Check", "Value", "Has to be", "Outcome"]),
        rows,
    }
}
