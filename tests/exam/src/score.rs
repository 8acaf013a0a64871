//! Scores: what each answer is worth beside the truth, and all of them together.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write;

use crate::answer::Answer;
use crate::outside::ALSO_CALLED;
use crate::rate::Rate;
use crate::truth::Truth;

/// One name that was said.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Said {
    /// Cause.
    pub name: String,
    /// As stated.
    pub confidence: f64,
    /// It is hidden: what a confidence promises.
    pub right: bool,
    /// It is hidden, or cannot be told from what is by the oracle.
    pub alike: bool,
    /// It is hidden, or what is hidden stands among the look-alikes that the answer lists with it.
    pub listed: bool,
}

/// One case, judged. `None`: not asked of this case.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Judged {
    /// Directory of the data.
    pub name: String,
    /// Of the case.
    pub index: u64,
    /// Sort.
    pub kind: String,
    /// Laws.
    pub family: String,
    /// What the excitation lacks.
    pub poor: Vec<String>,
    /// What the bench does beside the drive.
    pub bench: Vec<String>,
    /// Faults of the data that were named.
    pub faults: Vec<String>,
    /// What is hidden, with the times over the limit.
    pub hidden: Vec<(String, f64)>,
    /// Distance of each hidden law from the textbook's, where the family has one.
    #[serde(default)]
    pub distances: Vec<Option<f64>>,
    /// What was named.
    pub named: Vec<String>,
    /// Verdict, or what went wrong.
    pub verdict: String,
    /// First name is a hidden cause that counts, or its look-alike by the oracle.
    pub first: Option<bool>,
    /// First name is exactly a hidden cause.
    pub first_strict: Option<bool>,
    /// As `first`, or a hidden cause stands among the look-alikes that the answer itself lists.
    pub first_or_listed: Option<bool>,
    /// The names are the hidden causes that count, no more and no fewer.
    pub exact: Option<bool>,
    /// Something was named on a null.
    pub null_named: Option<bool>,
    /// A null was called anything but `none`.
    pub null_not_none: Option<bool>,
    /// Something was named on an effect outside.
    pub outside_named: Option<bool>,
    /// An effect outside that counts was called `unknown`.
    pub outside_unknown: Option<bool>,
    /// A fault of the data was named.
    pub fault_named: Option<bool>,
    /// A cause was named for a fault of the data.
    pub fault_blamed: Option<bool>,
    /// A fault was named in data that have none.
    pub fault_invented: Option<bool>,
    /// A cause was named for a fault of the logger.
    pub logger_named: Option<bool>,
    /// A cause was named for a fault of the logger that is not the same thing by another name.
    pub logger_misled: Option<bool>,
    /// A fault of the logger that can be told was told.
    pub logger_told: Option<bool>,
    /// A wrong name on what cannot be detected.
    pub below_limit_misnamed: Option<bool>,
    /// A cause that is not there was named beside or instead.
    pub false_name: Option<bool>,
    /// Share of the held-out variance above the noise that was removed.
    pub removed: Option<f64>,
    /// The extended model is worse than the recalibrated nominal one on held-out data.
    pub worse: Option<bool>,
    /// Each name.
    pub said: Vec<Said>,
    /// (cause, parameter, value, standard deviation, truth) of each comparable parameter.
    pub intervals: Vec<(String, String, f64, f64, f64)>,
    /// Names that were asked: (hidden, found).
    pub found: Vec<(String, bool)>,
    /// Run time, s.
    pub seconds: f64,
    /// No readable answer.
    pub failed: bool,
}

/// Judges one answer.
pub fn judge(truth: &Truth, answer: &Result<Answer, String>, seconds: f64) -> Judged {
    let mut judged = Judged {
        name: truth.name.clone(),
        index: truth.index,
        kind: truth.kind.clone(),
        family: truth.family.clone(),
        poor: truth.poor.clone(),
        bench: truth.bench.clone(),
        faults: Vec::new(),
        hidden: truth.hidden.iter().map(|hidden| (hidden.name.clone(), hidden.over_limit)).collect(),
        distances: truth.hidden.iter().map(|hidden| hidden.numbers.get("distance").copied()).collect(),
        named: Vec::new(),
        verdict: String::new(),
        first: None,
        first_strict: None,
        first_or_listed: None,
        exact: None,
        null_named: None,
        null_not_none: None,
        outside_named: None,
        outside_unknown: None,
        fault_named: None,
        fault_blamed: None,
        fault_invented: None,
        logger_named: None,
        logger_misled: None,
        logger_told: None,
        below_limit_misnamed: None,
        false_name: None,
        removed: None,
        worse: None,
        said: Vec::new(),
        intervals: Vec::new(),
        found: Vec::new(),
        seconds,
        failed: answer.is_err(),
    };
    let nothing = Answer { verdict: "failed".into(), causes: Vec::new(), data_faults: Vec::new(), held_out: None };
    let answer = match answer {
        Ok(answer) => answer,
        Err(error) => {
            judged.verdict = error.clone();
            &nothing
        }
    };
    if judged.verdict.is_empty() {
        judged.verdict.clone_from(&answer.verdict);
    }
    judged.named = answer.causes.iter().map(|cause| cause.name.clone()).collect();
    judged.faults = answer.data_faults.iter().map(|fault| fault.name.clone()).collect();
    let is_hidden = |name: &str| truth.hidden.iter().any(|hidden| hidden.is_called(name));
    let any_named = !answer.causes.is_empty();
    match truth.kind.as_str() {
        "null" => {
            judged.null_named = Some(any_named);
            judged.null_not_none = is_quiet(&truth.bench).then(|| answer.verdict != "none");
        }
        "outside" if !truth.outside_looks_named() => {
            let also_called = |name: &str| {
                let is =
                    |(effect, cause): &(&str, &str)| *cause == name && truth.hidden.iter().any(|h| h.name == *effect);
                ALSO_CALLED.iter().any(is)
            };
            let wrong = answer.causes.iter().any(|cause| !also_called(&cause.name));
            judged.outside_named = Some(wrong);
            if truth.hidden.iter().any(|hidden| hidden.counts()) {
                judged.outside_unknown = Some(answer.verdict == "unknown" || any_named && !wrong);
            }
        }
        "fault" => {
            judged.fault_named = Some(answer.data_faults.iter().any(|fault| is_hidden(&fault.name)));
            judged.fault_blamed = Some(any_named);
        }
        "logger" => {
            judged.logger_named = Some(any_named);
            judged.logger_misled = Some(judged.named.iter().any(|name| !is_hidden(name)));
            if truth.hidden.iter().any(|hidden| hidden.counts()) {
                let told = judged.faults.iter().chain(&judged.named).any(|name| is_hidden(name));
                judged.logger_told = Some(told);
            }
        }
        "single" | "compound" => {
            let counted: Vec<_> = truth.hidden.iter().filter(|hidden| hidden.counts()).collect();
            let false_name = judged.named.iter().any(|name| !is_hidden(name));
            if counted.is_empty() {
                judged.below_limit_misnamed = Some(false_name);
            } else {
                judged.false_name = Some(false_name);
                let first = answer.causes.first();
                let right = first.is_some_and(|first| is_hidden(&first.name));
                judged.first = Some(right);
                judged.first_strict =
                    Some(first.is_some_and(|first| truth.hidden.iter().any(|hidden| hidden.name == first.name)));
                judged.first_or_listed = Some(
                    right
                        || first.is_some_and(|first| {
                            let listed = first.look_alikes.iter().take(3);
                            listed.into_iter().any(|name| truth.hidden.iter().any(|hidden| hidden.name == *name))
                        }),
                );
                let found: Vec<bool> =
                    counted.iter().map(|hidden| judged.named.iter().any(|name| hidden.is_called(name))).collect();
                // Two hidden causes may not both be found by one name.
                let enough = judged.named.len() >= counted.len() && judged.named.len() <= truth.hidden.len();
                judged.exact = Some(!false_name && enough && found.iter().all(|found| *found));
                judged.found = counted.iter().map(|hidden| hidden.name.clone()).zip(found).collect();
            }
            for named in &answer.causes {
                let Some(hidden) = truth.hidden.iter().find(|hidden| hidden.name == named.name && hidden.counts())
                else {
                    continue;
                };
                for (parameter, value) in &hidden.parameters {
                    if let Some(estimate) = named.parameters.get(parameter)
                        && let Some(std) = estimate.std
                        && std > 0.0
                    {
                        let mut value = *value;
                        if parameter.starts_with("phase") {
                            value = estimate.value + crate::teeth::wrapped(value - estimate.value);
                        }
                        let interval = (named.name.clone(), parameter.clone(), estimate.value, std, value);
                        judged.intervals.push(interval);
                    }
                }
            }
        }
        _ => {}
    }
    if truth.kind == "null" && is_quiet(&truth.bench) {
        judged.fault_invented = Some(!answer.data_faults.is_empty());
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
    if let Some(held_out) = answer.held_out {
        let (before, after) = (held_out.rms_before_arcsec.powi(2), held_out.rms_after_arcsec.powi(2));
        judged.worse = Some(held_out.rms_after_arcsec > 1.002 * held_out.rms_before_arcsec);
        let floor = truth.floor_arcsec.powi(2);
        let named_kind = truth.kind == "single" || truth.kind == "compound";
        if named_kind && judged.first.is_some() && before - floor > 0.1 * truth.removable_rms_arcsec.powi(2) {
            judged.removed = Some(((before - after) / (before - floor)).min(1.0));
        }
    } else if judged.first.is_some() {
        judged.removed = Some(0.0);
    }
    judged
}

/// Whether a bench adds nothing that a log shows. One that was set to zero anew, or whose counter started again, is a
/// discrepancy of its own.
fn is_quiet(bench: &[String]) -> bool {
    bench.iter().all(|what| what == "chamber")
}

/// What came of the names that were said with a confidence.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Level {
    /// Least confidence.
    pub from: f64,
    /// Least confidence of the next level.
    pub to: f64,
    /// Mean of what was stated: what share should be right.
    pub stated: f64,
    /// Names that are hidden.
    pub right: Rate,
    /// Wilson's interval of that.
    pub interval: (f64, f64),
    /// Names that are hidden, or alike by the oracle.
    pub alike: Rate,
    /// Names that are hidden, or list what is.
    pub listed: Rate,
}

/// Of the causes named with a confidence, how many are right.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reliability {
    /// From the lowest confidence to the highest.
    pub levels: Vec<Level>,
}

/// Bounds of the levels: one of four or more, of three, of two causes alike; below and above 90 %; 99 %.
const LEVELS: [f64; 7] = [0.0, 0.29, 0.4, 0.6, 0.895, 0.985, 1.01];

impl Reliability {
    /// From names.
    pub fn of<'a>(names: impl IntoIterator<Item = &'a Said>) -> Self {
        let names: Vec<_> = names.into_iter().collect();
        let levels = LEVELS.windows(2).map(|bounds| {
            let (from, to) = (bounds[0], bounds[1]);
            let within: Vec<_> = names.iter().filter(|said| (from..to).contains(&said.confidence)).collect();
            let rate = |is: &dyn Fn(&Said) -> bool| Rate::over(within.iter().map(|said| Some(is(said))));
            let stated = within.iter().map(|said| said.confidence).sum::<f64>() / within.len().max(1) as f64;
            let right = rate(&|said| said.right);
            let (alike, listed) = (rate(&|said| said.alike), rate(&|said| said.listed));
            Level { from, to, stated, right, interval: right.interval(), alike, listed }
        });
        Self { levels: levels.filter(|level| level.right.of > 0).collect() }
    }

    fn write(&self, text: &mut String) {
        for level in &self.levels {
            let _ = writeln!(
                text,
                "  {:5.1} %   {}   alike {:>3}   listed {:>3}",
                100.0 * level.stated,
                level.right,
                level.alike.right,
                level.listed.right
            );
        }
    }
}

/// What is told of each family.
const OF_A_FAMILY: [&str; 20] = [
    "first_name",
    "first_name_or_listed",
    "exact",
    "exact_near",
    "exact_far",
    "listed_near",
    "listed_far",
    "found_near",
    "found_far",
    "compound_exact",
    "two_exact",
    "false_name",
    "null_named",
    "null_not_none",
    "fault_invented",
    "outside_named",
    "outside_unknown",
    "logger_named",
    "logger_told",
    "failed",
];

/// A value that counts on a condition.
fn when(condition: bool, value: Option<bool>) -> Option<bool> {
    if condition { value } else { None }
}

fn single(judged: &Judged) -> bool {
    judged.kind == "single"
}

/// A single whose law lies so far from the textbook's.
fn single_at(judged: &Judged, from: f64, to: f64) -> bool {
    single(judged) && judged.distances.iter().flatten().any(|distance| (from..to).contains(distance))
}

/// Rates over some cases, by name.
fn rates_of(cases: &[&Judged]) -> Vec<(&'static str, Rate)> {
    let rate = |ask: &dyn Fn(&Judged) -> Option<bool>| Rate::over(cases.iter().map(|j| ask(j)));
    let found = |from: f64, to: f64| {
        let at = move |j: &Judged, name: &str| {
            let place = j.hidden.iter().position(|(other, _)| other == name);
            place.and_then(|place| *j.distances.get(place)?).is_some_and(|d| (from..to).contains(&d))
        };
        Rate::over(cases.iter().flat_map(|j| j.found.iter().map(move |(name, yes)| when(at(j, name), Some(*yes)))))
    };
    vec![
        ("first_name", rate(&|j| when(single(j), j.first))),
        ("first_name_rich", rate(&|j| when(single(j) && j.poor.is_empty(), j.first))),
        ("first_name_poor", rate(&|j| when(!j.poor.is_empty(), j.first))),
        ("first_name_family_a", rate(&|j| when(single(j) && j.family == "A", j.first))),
        ("first_name_family_b", rate(&|j| when(single(j) && j.family == "B", j.first))),
        ("first_name_family_c", rate(&|j| when(single(j) && j.family == "C", j.first))),
        ("first_name_family_d", rate(&|j| when(single(j) && j.family == "D", j.first))),
        ("first_name_family_e", rate(&|j| when(single(j) && j.family == "E", j.first))),
        ("first_name_family_f", rate(&|j| when(single(j) && j.family == "F", j.first))),
        ("first_name_family_g", rate(&|j| when(single(j) && j.family == "G", j.first))),
        ("first_name_family_h", rate(&|j| when(single(j) && j.family == "H", j.first))),
        ("first_name_strict", rate(&|j| when(single(j), j.first_strict))),
        ("first_name_or_listed", rate(&|j| when(single(j), j.first_or_listed))),
        ("exact", rate(&|j| when(single(j), j.exact))),
        ("exact_near", rate(&|j| when(single_at(j, 0.0, 0.5), j.exact))),
        ("exact_far", rate(&|j| when(single_at(j, 0.5, 1.1), j.exact))),
        ("listed_near", rate(&|j| when(single_at(j, 0.0, 0.5), j.first_or_listed))),
        ("listed_far", rate(&|j| when(single_at(j, 0.5, 1.1), j.first_or_listed))),
        ("found_near", found(0.0, 0.5)),
        ("found_far", found(0.5, 1.1)),
        ("compound_first", rate(&|j| when(j.kind == "compound", j.first))),
        ("compound_exact", rate(&|j| when(j.kind == "compound", j.exact))),
        ("two_exact", rate(&|j| when(j.kind == "compound" && j.hidden.len() == 2, j.exact))),
        ("false_name", rate(&|j| j.false_name)),
        ("null_named", rate(&|j| j.null_named)),
        ("null_not_none", rate(&|j| j.null_not_none)),
        ("outside_named", rate(&|j| j.outside_named)),
        ("outside_unknown", rate(&|j| j.outside_unknown)),
        ("below_limit_misnamed", rate(&|j| j.below_limit_misnamed)),
        ("fault_named", rate(&|j| j.fault_named)),
        ("fault_blamed_on_a_cause", rate(&|j| j.fault_blamed)),
        ("fault_invented", rate(&|j| j.fault_invented)),
        ("logger_named", rate(&|j| j.logger_named)),
        ("logger_misled", rate(&|j| j.logger_misled)),
        ("logger_told", rate(&|j| j.logger_told)),
        ("worse_than_recalibrated", rate(&|j| j.worse)),
        ("failed", rate(&|j| Some(j.failed))),
    ]
}

/// All cases together.
#[derive(Debug, Clone, Serialize)]
pub struct Scores {
    /// Name, share and interval of each rate.
    pub rates: Vec<(&'static str, Rate, (f64, f64))>,
    /// Mean share of the removable held-out variance that was removed, and its standard error.
    pub removed_mean: (f64, f64),
    /// Median of the same.
    pub removed_median: f64,
    /// Mean square of confidence less right.
    pub brier: f64,
    /// Share right by stated confidence.
    pub reliability: Reliability,
    /// The same of each family.
    pub reliability_by_family: Vec<(String, Reliability)>,
    /// Names said with 90 % or more that are right, by cause.
    pub sure_by_cause: BTreeMap<String, Rate>,
    /// Rates of each family.
    pub families: Vec<(String, Vec<(&'static str, Rate)>)>,
    /// First name right where the bench does this beside the drive, or nothing (singles that count).
    pub by_bench: Vec<(String, Rate)>,
    /// Found against times over the limit of detection: bounds, rate.
    pub by_size: Vec<(f64, f64, Rate)>,
    /// By hidden cause (singles that count): what came first, how often.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
    /// Coverage of 95 % intervals by cause and parameter.
    pub coverage: BTreeMap<String, Rate>,
    /// Run time, s: median and largest.
    pub seconds: (f64, f64),
    /// Cases.
    pub cases: usize,
}

impl Scores {
    /// Gathers.
    pub fn of(all: &[Judged]) -> Self {
        let rate = |ask: &dyn Fn(&Judged) -> Option<bool>| Rate::over(all.iter().map(ask));
        let mut rates = rates_of(&all.iter().collect::<Vec<_>>());
        let compound = all.iter().filter(|j| j.kind == "compound");
        rates.push(("compound_recall", Rate::over(compound.flat_map(|j| j.found.iter().map(|(_, yes)| Some(*yes))))));
        let intervals = all.iter().flat_map(|j| &j.intervals);
        let covered = |(_, _, value, std, truth): &(String, String, f64, f64, f64)| (value - truth).abs() <= 1.96 * std;
        rates.push(("coverage_95", Rate::over(intervals.clone().map(|i| Some(covered(i))))));
        let mut coverage: BTreeMap<String, Rate> = BTreeMap::new();
        for interval in intervals {
            let entry = coverage.entry(format!("{} {}", interval.0, interval.1)).or_default();
            entry.of += 1;
            entry.right += usize::from(covered(interval));
        }

        let mut removed: Vec<f64> = all.iter().filter_map(|j| j.removed).collect();
        removed.sort_by(f64::total_cmp);
        let count = removed.len().max(1) as f64;
        let mean = removed.iter().sum::<f64>() / count;
        let spread = (removed.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count / count).sqrt();

        let names: Vec<&Said> = all.iter().flat_map(|j| &j.said).collect();
        let mut sure_by_cause: BTreeMap<String, Rate> = BTreeMap::new();
        for said in names.iter().filter(|said| said.confidence >= 0.9) {
            let rate = sure_by_cause.entry(said.name.clone()).or_default();
            rate.of += 1;
            rate.right += usize::from(said.right);
        }
        let mut families: Vec<String> = all.iter().map(|j| j.family.clone()).collect();
        families.sort();
        families.dedup();
        let reliability_by_family = families
            .iter()
            .map(|family| {
                let of = all.iter().filter(|j| j.family == *family).flat_map(|j| &j.said);
                (family.clone(), Reliability::of(of))
            })
            .collect();
        let families = families
            .into_iter()
            .map(|family| {
                let of: Vec<_> = all.iter().filter(|j| j.family == family).collect();
                let of_all = rates_of(&of);
                let of_name = |name: &&str| of_all.iter().find(|(other, _)| other == name).cloned();
                let rates = OF_A_FAMILY.iter().filter_map(of_name).collect();
                (family, rates)
            })
            .collect();
        let brier = names.iter().map(|said| (said.confidence - f64::from(u8::from(said.right))).powi(2)).sum::<f64>()
            / names.len().max(1) as f64;
        let reliability = Reliability::of(names);

        let mut benches: Vec<&String> = all.iter().flat_map(|j| &j.bench).collect();
        benches.sort();
        benches.dedup();
        let with = |what: &String| rate(&|j| when(single(j) && j.bench.contains(what), j.first));
        let mut by_bench: Vec<(String, Rate)> = benches.into_iter().map(|what| (what.clone(), with(what))).collect();
        if !by_bench.is_empty() {
            let plain = rate(&|j| when(single(j) && is_quiet(&j.bench), j.first));
            by_bench.push(("one zero, one count".to_owned(), plain));
        }

        let sizes = [0.0, 0.3, 0.6, 1.0, 1.5, 2.5, 5.0, 10.0, 1e9];
        let singles: Vec<_> = all.iter().filter(|j| single(j)).collect();
        let by_size = sizes
            .windows(2)
            .map(|b| {
                let within = singles.iter().filter(|j| (b[0]..b[1]).contains(&j.hidden[0].1));
                // Below the limit there is no look-alike to excuse a name.
                let found = within.map(|j| Some(j.first.unwrap_or_else(|| j.named.first() == Some(&j.hidden[0].0))));
                (b[0], b[1], Rate::over(found))
            })
            .collect();

        let mut confusion: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
        for judged in singles.iter().filter(|j| j.first.is_some()) {
            let said = judged.named.first().cloned().unwrap_or_else(|| format!("({})", judged.verdict));
            let said = if judged.first == Some(true) && said != judged.hidden[0].0 { format!("{said}*") } else { said };
            *confusion.entry(judged.hidden[0].0.clone()).or_default().entry(said).or_default() += 1;
        }
        let mut seconds: Vec<f64> = all.iter().map(|j| j.seconds).collect();
        seconds.sort_by(f64::total_cmp);
        let middle = |sorted: &[f64]| sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        Self {
            rates: rates.into_iter().map(|(name, rate)| (name, rate, rate.interval())).collect(),
            removed_mean: (mean, spread),
            removed_median: middle(&removed),
            brier,
            reliability,
            reliability_by_family,
            sure_by_cause,
            families,
            by_bench,
            by_size,
            confusion,
            coverage,
            seconds: (middle(&seconds), seconds.last().copied().unwrap_or(0.0)),
            cases: all.len(),
        }
    }

    /// One rate.
    pub fn rate(&self, name: &str) -> Option<Rate> {
        self.rates.iter().find(|(found, ..)| *found == name).map(|(_, rate, _)| *rate)
    }

    /// For people.
    pub fn table(&self) -> String {
        let mut text = format!("{} cases                    share  counts    [95 % interval]\n", self.cases);
        for (name, rate, _) in self.rates.iter().filter(|(_, rate, _)| rate.of > 0) {
            let _ = writeln!(text, "  {name:<26}{rate}");
        }
        let _ = writeln!(
            text,
            "  removable variance removed, held out: mean {:.3} ± {:.3}, median {:.3}",
            self.removed_mean.0, self.removed_mean.1, self.removed_median
        );
        let _ = writeln!(
            text,
            "  Brier {:.4}; run time median {:.1} s, largest {:.1} s",
            self.brier, self.seconds.0, self.seconds.1
        );
        if self.families.len() > 1 {
            for (family, rates) in &self.families {
                let _ = writeln!(text, "\nfamily {family}");
                for (name, rate) in rates.iter().filter(|(_, rate)| rate.of > 0) {
                    let _ = writeln!(text, "  {name:<26}{rate}");
                }
            }
        }
        text.push_str(
            "\nstated (mean): of these right; right or alike by the oracle; right or listed beside the name\n",
        );
        self.reliability.write(&mut text);
        if self.reliability_by_family.len() > 1 {
            for (family, reliability) in &self.reliability_by_family {
                let _ = writeln!(text, "  family {family}");
                reliability.write(&mut text);
            }
        }
        let wrong = self.sure_by_cause.iter().filter(|(_, rate)| rate.right < rate.of);
        let mut wrong: Vec<_> = wrong.map(|(cause, rate)| format!("{cause} {}/{}", rate.right, rate.of)).collect();
        if !wrong.is_empty() {
            wrong.sort();
            let _ = writeln!(text, "  with 90 % or more, right less than always: {}", wrong.join(", "));
        }
        if !self.by_bench.is_empty() {
            text.push_str("\nsingles by what the bench does: first name right\n");
            for (what, rate) in &self.by_bench {
                let _ = writeln!(text, "  {what:<26}{rate}");
            }
        }
        text.push_str("\nsingles by size (times the limit of detection): first name right\n");
        for (from, to, rate) in self.by_size.iter().filter(|(_, _, rate)| rate.of > 0) {
            let to = if *to > 1e6 { "".to_owned() } else { format!("{to}") };
            let _ = writeln!(text, "  {from:>4} .. {to:<4} {rate}");
        }
        text.push_str("\nhidden single that counts: first names (* = look-alike by the oracle)\n");
        for (hidden, said) in &self.confusion {
            let said: Vec<_> = said.iter().map(|(name, count)| format!("{name} {count}")).collect();
            let _ = writeln!(text, "  {hidden:<31} {}", said.join(", "));
        }
        if !self.coverage.is_empty() {
            text.push_str("\n95 % intervals that hold the truth\n");
            for (name, rate) in &self.coverage {
                let _ = writeln!(text, "  {name:<48} {rate}");
            }
        }
        text
    }
}

impl Judged {
    /// Whether someone should look at it.
    pub fn went_wrong(&self) -> bool {
        self.failed
            || self.first == Some(false)
            || self.exact == Some(false)
            || [self.null_named, self.outside_named, self.below_limit_misnamed, self.worse].contains(&Some(true))
            || [self.outside_unknown, self.fault_named].contains(&Some(false))
            || [self.fault_blamed, self.fault_invented, self.logger_named].contains(&Some(true))
            || self.logger_told == Some(false)
            || self.null_not_none == Some(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_confidence_falls_into_one_level() {
        let said =
            |confidence: f64, right: bool| Said { name: "wear".into(), confidence, right, alike: true, listed: right };
        let names =
            [(0.25, true), (1.0 / 3.0, false), (0.5, true), (0.5, false), (0.97, true), (0.9, false), (0.99, true)];
        let names = names.map(|(confidence, right)| said(confidence, right));
        let levels = Reliability::of(&names).levels;
        let counts: Vec<_> =
            levels.iter().map(|level| (level.right.right, level.right.of, level.alike.right)).collect();
        assert_eq!(counts, [(1, 1, 1), (0, 1, 1), (1, 2, 2), (1, 2, 2), (1, 1, 1)]);
        assert!((levels[3].stated - 0.935).abs() < 1e-12);
    }
}
