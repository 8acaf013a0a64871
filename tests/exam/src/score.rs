//! Scores: what each answer is worth against the truth, and all of them together.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write;

use crate::answer::Answer;
use crate::rate::Rate;
use crate::truth::Truth;

/// Rates of the table. A case is asked only what its kind allows.
pub const RATES: [&str; 26] = [
    // Singles that count: the first name is hidden or cannot be told from it; is hidden; or it lists what is hidden.
    "first_name",
    "first_name_strict",
    "first_name_or_listed",
    // Singles that count: the names are what is hidden, no more and no fewer.
    "exact",
    // The same where the model is near the textbook's, and far from it.
    "exact_near",
    "exact_far",
    "listed_near",
    "listed_far",
    // Each hidden cause that counts: named at all.
    "found_near",
    "found_far",
    "compound_first",
    "compound_exact",
    "compound_recall",
    // Singles and compounds that count: a cause that is not there was named.
    "false_name",
    // Nothing that counts is hidden: a name that is wrong.
    "below_limit_misnamed",
    "null_named",
    "null_not_none",
    "fault_invented",
    "outside_named",
    "outside_unknown",
    // Faults of loggers: a cause was named; one that is not the fault by another name; the fault was reported.
    "logger_named",
    "logger_misled",
    "logger_told",
    // Half of the removable variance of held-out rows was removed.
    "removed_half",
    // Intervals at 95 % that hold the truth.
    "coverage_95",
    "failed",
];

/// One name that was said.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Said {
    pub name: String,
    pub confidence: f64,
    /// It is hidden: what a confidence promises.
    pub right: bool,
    /// It is hidden, or the oracle cannot tell it from what is.
    pub alike: bool,
    /// It is hidden, or what is hidden stands among the look-alikes that the answer lists with it.
    pub listed: bool,
}

/// One case, judged.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Judged {
    /// Directory of the data.
    pub name: String,
    pub index: u64,
    pub kind: String,
    pub family: String,
    pub bench: Vec<String>,
    /// Hidden effects with the times over the limit.
    pub hidden: Vec<(String, f64)>,
    /// Causes that were named.
    pub named: Vec<String>,
    /// Faults of the data that were named.
    pub faults: Vec<String>,
    /// Verdict, or what went wrong.
    pub verdict: String,
    /// Answers to what is asked of this case, by the name of the rate.
    pub asked: Vec<(String, bool)>,
    pub said: Vec<Said>,
    /// Share of the removable variance that was removed.
    pub removed: Option<f64>,
    /// Run time.
    pub seconds: f64,
}

impl Judged {
    fn ask(&mut self, rate: &str, answer: bool) {
        debug_assert!(RATES.contains(&rate), "{rate}");
        self.asked.push((rate.to_owned(), answer));
    }

    /// Answers to one rate.
    pub fn asked<'a>(&'a self, rate: &'a str) -> impl Iterator<Item = bool> + 'a {
        self.asked.iter().filter(move |(name, _)| name == rate).map(|(_, answer)| *answer)
    }

    /// Whether someone should look at it.
    pub fn went_wrong(&self) -> bool {
        let good = ["first_name", "exact", "compound_first", "compound_exact", "outside_unknown", "logger_told"];
        let bad = ["null_named", "null_not_none", "fault_invented", "outside_named", "below_limit_misnamed"];
        let bad = bad.iter().chain(&["logger_misled", "failed"]);
        good.iter().any(|rate| self.asked(rate).any(|yes| !yes))
            || bad.clone().any(|rate| self.asked(rate).any(|yes| yes))
    }
}

/// Judges one answer.
pub fn judge(truth: &Truth, answer: &Result<Answer, String>, seconds: f64) -> Judged {
    let mut judged = Judged {
        name: truth.name.clone(),
        index: truth.index,
        kind: truth.kind.clone(),
        family: truth.family.clone(),
        bench: truth.bench.clone(),
        hidden: truth.hidden.iter().map(|hidden| (hidden.name.clone(), hidden.over_limit)).collect(),
        seconds,
        ..Judged::default()
    };
    judged.ask("failed", answer.is_err());
    let nothing = Answer { verdict: "failed".into(), causes: Vec::new(), data_faults: Vec::new(), held_out: None };
    let (answer, verdict) = match answer {
        Ok(answer) => (answer, &answer.verdict),
        Err(error) => (&nothing, error),
    };
    judged.verdict.clone_from(verdict);
    judged.named = answer.causes.iter().map(|cause| cause.name.clone()).collect();
    judged.faults = answer.data_faults.iter().map(|fault| fault.name.clone()).collect();
    let any_named = !answer.causes.is_empty();
    let is_hidden = |name: &str| truth.hidden.iter().any(|hidden| hidden.is_called(name));
    let counts = truth.hidden.iter().any(|hidden| hidden.counts());
    let named = |judged: &Judged| judged.named.iter().any(|name| !is_hidden(name));
    match truth.kind.as_str() {
        "null" => {
            judged.ask("null_named", any_named);
            // A bench that was set to zero anew, or whose counter started again, is a discrepancy of its own.
            if truth.bench.iter().all(|what| what == "chamber") {
                judged.ask("null_not_none", answer.verdict != "none");
                judged.ask("fault_invented", !answer.data_faults.is_empty());
            }
        }
        "outside" if !truth.outside_looks_named() => {
            judged.ask("outside_named", any_named);
            if counts {
                judged.ask("outside_unknown", answer.verdict == "unknown");
            }
        }
        "logger" => {
            let misled = named(&judged);
            judged.ask("logger_named", any_named);
            judged.ask("logger_misled", misled);
            if counts {
                let reported = judged.faults.iter().chain(&judged.named).any(|name| is_hidden(name));
                judged.ask("logger_told", reported);
            }
        }
        "single" | "compound" if counts => judge_names(&mut judged, truth, answer),
        "single" | "compound" => {
            let misnamed = named(&judged);
            judged.ask("below_limit_misnamed", misnamed);
        }
        _ => {}
    }
    let is = |name: &str| truth.kind != "outside" && truth.hidden.iter().any(|hidden| hidden.name == name);
    judged.said = answer
        .causes
        .iter()
        .map(|cause| Said {
            name: cause.name.clone(),
            confidence: cause.confidence,
            right: is(&cause.name),
            alike: is_hidden(&cause.name) && truth.kind != "outside",
            listed: is(&cause.name) || cause.look_alikes.iter().any(|name| is(name)),
        })
        .collect();
    judged
}

/// Asks what a hidden cause that counts allows.
fn judge_names(judged: &mut Judged, truth: &Truth, answer: &Answer) {
    let is_hidden = |name: &str| truth.hidden.iter().any(|hidden| hidden.is_called(name));
    let is = |name: &str| truth.hidden.iter().any(|hidden| hidden.name == name);
    let side = |hidden: &crate::truth::Hidden| {
        hidden.numbers.get("distance").map(|distance| if *distance < 0.5 { "near" } else { "far" })
    };
    let counted: Vec<_> = truth.hidden.iter().filter(|hidden| hidden.counts()).collect();
    let false_name = judged.named.iter().any(|name| !is_hidden(name));
    judged.ask("false_name", false_name);
    let first = answer.causes.first();
    let right = first.is_some_and(|first| is_hidden(&first.name));
    let mut all_found = true;
    for hidden in &counted {
        let found = judged.named.iter().any(|name| hidden.is_called(name));
        all_found &= found;
        if let Some(side) = side(hidden) {
            judged.ask(&format!("found_{side}"), found);
        }
        if truth.kind == "compound" {
            judged.ask("compound_recall", found);
        }
    }
    // Two hidden causes may not both be found by one name.
    let enough = (counted.len()..=truth.hidden.len()).contains(&judged.named.len());
    let exact = !false_name && enough && all_found;
    if truth.kind == "compound" {
        judged.ask("compound_first", right);
        judged.ask("compound_exact", exact);
    } else {
        let listed = right || first.is_some_and(|first| first.look_alikes.iter().take(3).any(|name| is(name)));
        judged.ask("first_name", right);
        judged.ask("first_name_strict", first.is_some_and(|first| is(&first.name)));
        judged.ask("first_name_or_listed", listed);
        judged.ask("exact", exact);
        if let Some(side) = side(counted[0]) {
            judged.ask(&format!("exact_{side}"), exact);
            judged.ask(&format!("listed_{side}"), listed);
        }
    }
    for cause in &answer.causes {
        let Some(hidden) = counted.iter().find(|hidden| hidden.name == cause.name) else { continue };
        for (parameter, value) in &hidden.parameters {
            if let Some(estimate) = cause.parameters.get(parameter)
                && let Some(std) = estimate.std.filter(|std| *std > 0.0)
            {
                judged.ask("coverage_95", (estimate.value - value).abs() <= 1.96 * std);
            }
        }
    }
    let floor = truth.floor_arcsec.powi(2);
    judged.removed = match answer.held_out {
        None => Some(0.0),
        Some(held_out) => {
            let (before, after) = (held_out.rms_before_arcsec.powi(2), held_out.rms_after_arcsec.powi(2));
            let removable = before - floor > 0.1 * truth.removable_rms_arcsec.powi(2);
            removable.then(|| ((before - after) / (before - floor)).min(1.0))
        }
    };
    if let Some(removed) = judged.removed {
        judged.ask("removed_half", removed >= 0.5);
    }
}

/// Names that were said with a confidence.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Level {
    /// Least confidence.
    pub from: f64,
    /// Mean of what was stated: what share should be right.
    pub stated: f64,
    pub right: Rate,
    /// Wilson's interval of that.
    pub interval: (f64, f64),
    pub alike: Rate,
    pub listed: Rate,
}

/// Bounds of the levels: one of four or more, of three, of two causes alike; below and above 90 %; 99 %.
const LEVELS: [f64; 7] = [0.0, 0.29, 0.4, 0.6, 0.895, 0.985, 1.01];

/// Of the causes named with a confidence, how many are right, from the lowest confidence to the highest.
pub fn reliability<'a>(names: impl IntoIterator<Item = &'a Said>) -> Vec<Level> {
    let names: Vec<_> = names.into_iter().collect();
    let levels = LEVELS.windows(2).map(|bounds| {
        let within: Vec<_> = names.iter().filter(|said| (bounds[0]..bounds[1]).contains(&said.confidence)).collect();
        let rate = |is: &dyn Fn(&Said) -> bool| Rate::over(within.iter().map(|said| is(said)));
        let stated = within.iter().map(|said| said.confidence).sum::<f64>() / within.len().max(1) as f64;
        let right = rate(&|said| said.right);
        let (alike, listed) = (rate(&|said| said.alike), rate(&|said| said.listed));
        Level { from: bounds[0], stated, right, interval: right.interval(), alike, listed }
    });
    levels.filter(|level| level.right.of > 0).collect()
}

/// Scores of some cases.
#[derive(Debug, Clone, Serialize)]
pub struct Scores {
    /// Name, counts and interval of each rate that was asked.
    pub rates: Vec<(&'static str, Rate, (f64, f64))>,
    /// Share right by stated confidence.
    pub reliability: Vec<Level>,
    /// Mean share of the removable held-out variance that was removed.
    pub removed_mean: f64,
    /// By hidden cause (singles that count): what came first, how often.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
    /// Run time, s: median and largest.
    pub seconds: (f64, f64),
    pub cases: usize,
}

impl Scores {
    /// Gathers.
    pub fn of(all: &[&Judged]) -> Self {
        let rate = |name: &'static str| Rate::over(all.iter().flat_map(|judged| judged.asked(name)));
        let rates = RATES.map(|name| (name, rate(name))).into_iter().filter(|(_, rate)| rate.of > 0);
        let removed: Vec<f64> = all.iter().filter_map(|judged| judged.removed).collect();
        let mut confusion: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
        for judged in all {
            let Some(right) = judged.asked("first_name").next() else { continue };
            let hidden = &judged.hidden[0].0;
            let said = judged.named.first().cloned().unwrap_or_else(|| format!("({})", judged.verdict));
            let said = if right && said != *hidden { format!("{said}*") } else { said };
            *confusion.entry(hidden.clone()).or_default().entry(said).or_default() += 1;
        }
        let mut seconds: Vec<f64> = all.iter().map(|judged| judged.seconds).collect();
        seconds.sort_by(f64::total_cmp);
        Self {
            rates: rates.map(|(name, rate)| (name, rate, rate.interval())).collect(),
            reliability: reliability(all.iter().flat_map(|judged| &judged.said)),
            removed_mean: removed.iter().sum::<f64>() / removed.len().max(1) as f64,
            confusion,
            seconds: (seconds.get(seconds.len() / 2).copied().unwrap_or(0.0), seconds.last().copied().unwrap_or(0.0)),
            cases: all.len(),
        }
    }

    /// One rate; nothing of nothing where it was not asked.
    pub fn rate(&self, name: &str) -> Rate {
        self.rates.iter().find(|(found, ..)| *found == name).map_or(Rate::default(), |(_, rate, _)| *rate)
    }

    fn write(&self, text: &mut String) {
        for (name, rate, _) in &self.rates {
            let _ = writeln!(text, "  {name:<26}{rate}");
        }
        text.push_str("  stated (mean): of these right; right or alike by the oracle; right or listed with the name\n");
        for level in &self.reliability {
            let Level { stated, right, alike, listed, .. } = level;
            let (alike, listed) = (alike.right, listed.right);
            let _ = writeln!(text, "  {:5.1} %   {right}   alike {alike:>3}   listed {listed:>3}", 100.0 * stated);
        }
    }
}

/// Scores of all cases and of each family.
#[derive(Debug, Clone, Serialize)]
pub struct Gathered {
    #[serde(flatten)]
    pub all: Scores,
    pub families: BTreeMap<String, Scores>,
}

impl Gathered {
    pub fn of(cases: &[Judged]) -> Self {
        let mut families: BTreeMap<String, Vec<&Judged>> = BTreeMap::new();
        for judged in cases {
            families.entry(judged.family.clone()).or_default().push(judged);
        }
        let families = families.into_iter().map(|(family, of)| (family, Scores::of(&of))).collect();
        Self { all: Scores::of(&cases.iter().collect::<Vec<_>>()), families }
    }

    /// For people.
    pub fn table(&self) -> String {
        let all = &self.all;
        let mut text = format!("{} cases                    share  counts    [95 % interval]\n", all.cases);
        all.write(&mut text);
        let (median, largest) = all.seconds;
        let _ = writeln!(text, "  run time median {median:.1} s, largest {largest:.1} s");
        if all.rate("removed_half").of > 0 {
            let _ = writeln!(text, "  removable variance removed, held out: mean {:.3}", all.removed_mean);
        }
        if self.families.len() > 1 {
            for (family, scores) in &self.families {
                let _ = writeln!(text, "\nfamily {family}");
                scores.write(&mut text);
            }
        }
        text.push_str("\nhidden single that counts: first names (* = look-alike by the oracle)\n");
        for (hidden, said) in &all.confusion {
            let said: Vec<_> = said.iter().map(|(name, count)| format!("{name} {count}")).collect();
            let _ = writeln!(text, "  {hidden:<31} {}", said.join(", "));
        }
        text
    }
}
