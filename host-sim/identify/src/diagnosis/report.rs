//! `diagnosis.json` and its text.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::Serialize;

use super::thresholds::verdict::LEAST_GAIN_OF_A_NAME;
use super::trace::Trace;
use crate::causes::{CauseName, ParameterName};
use crate::extension::Evaluation;
use crate::measurement::FaultName;

/// A set of causes is open from this share of the likeliest's probability on. *Guess*.
const OPEN: f64 = 0.5;
/// Sets that are listed, at most. *Chosen*: a headline of four lines.
const SHOWN: usize = 4;

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing beyond noise and unit-to-unit spread.
    None,
    /// Causes found, nothing significant left.
    Explained,
    /// Causes found, and a significant remainder.
    PartlyExplained,
    /// A real discrepancy that no cause in the library explains.
    Unknown,
}

/// What was found about the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Finding {
    /// Something is wrong with it, and it has a name.
    FaultFound,
    /// It does what the nominal model says, within noise and the spread between units.
    NothingFound,
    /// It departs from the nominal model, and what does it has no name.
    NotUnderstood,
    /// The data do not say: what is wrong with them hides what the unit does.
    DataUnusable,
}

impl Finding {
    /// What follows from a verdict, as long as the data are usable.
    pub const fn of(verdict: Verdict) -> Finding {
        match verdict {
            Verdict::None => Finding::NothingFound,
            Verdict::Explained | Verdict::PartlyExplained => Finding::FaultFound,
            Verdict::Unknown => Finding::NotUnderstood,
        }
    }

    /// For a reader.
    pub const fn words(self) -> &'static str {
        match self {
            Finding::FaultFound => "fault found",
            Finding::NothingFound => "nothing found",
            Finding::NotUnderstood => "not understood",
            Finding::DataUnusable => "data not usable",
        }
    }
}

/// A parameter with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Value.
    pub value: f64,
    /// One standard deviation.
    pub std: f64,
}

/// Writes a probability with what can be known of it.
fn four_digits<S: serde::Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64((1e4 * value).round() / 1e4)
}

/// A cause.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cause {
    /// Its name.
    pub name: CauseName,
    /// Probability that it is this one and not the best rival, given that it is one of the library.
    #[serde(serialize_with = "four_digits")]
    pub confidence: f64,
    /// Evidence for it: natural logarithm of the ratio to the model without it.
    pub evidence: f64,
    /// Where that comes from.
    pub evidence_by: EvidenceBy,
    /// Parameters; the unit is the end of the name.
    pub parameters: BTreeMap<&'static str, Parameter>,
    /// Share of the squared error left by the recalibrated nominal model that this cause removes in sessions it was not
    /// fitted to.
    pub held_out_gain: f64,
    /// Root mean square of what it explains, arcsec.
    pub size_arcsec: f64,
    /// Causes that these data cannot tell from it, at most three.
    pub look_alikes: Vec<CauseName>,
    /// What makes the same and is no cause of the library; it counts as one look-alike more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub look_alike_outside: Option<&'static str>,
}

/// By how much a cause lowers half the sum of the squared residuals, in units of the noise.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct EvidenceBy {
    /// In each session that was fitted.
    pub session: Vec<f64>,
    /// In forward and backward motion of the generator.
    pub direction: BTreeMap<&'static str, f64>,
    /// Under light, middle and heavy loads: thirds of the largest.
    pub load: BTreeMap<&'static str, f64>,
}

/// Causes that may be there together, and no others.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SetOfCauses {
    /// The causes; none where what was found is outside the library, or nothing.
    pub set: Vec<CauseName>,
    /// Probability of the set.
    #[serde(serialize_with = "four_digits")]
    pub probability: f64,
}

impl Cause {
    /// What is no cause of the library and cannot be told from this one by these data: it, or a wrong log.
    pub fn outside_the_library(&self) -> impl Iterator<Item = String> {
        let ratio = self.parameters.get(ParameterName::StiffnessRatio.as_str());
        let ratio = ratio.filter(|_| self.name == CauseName::StiffnessError);
        let torque = ratio.map(|ratio| format!("a torque that is recorded {:.2} times as large as it is", ratio.value));
        self.look_alike_outside.map(str::to_owned).into_iter().chain(torque)
    }
}

/// Residual over all data used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Residual {
    /// Of the recalibrated nominal model.
    pub rms_before_arcsec: f64,
    /// With the causes.
    pub rms_after_arcsec: f64,
    /// White noise and wander.
    pub noise_floor_arcsec: f64,
    /// Share of the explainable squared error that is left.
    pub unexplained_fraction: f64,
    /// Neighbouring rows of a long record whose mean counts as one, in all of these.
    pub rows_averaged: usize,
}

/// Residual over sessions that took no part in the fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct HeldOut {
    /// Of the nominal model, recalibrated on the other sessions.
    pub rms_before_arcsec: f64,
    /// With the causes, fitted to the other sessions.
    pub rms_after_arcsec: f64,
}

/// Pointing error that is left when the output is corrected, rms about the mean, arcsec.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Compensation {
    /// Without correction.
    pub rms_uncompensated_arcsec: f64,
    /// Corrected by the nominal model as it stands.
    pub rms_nominal_tables_arcsec: f64,
    /// Corrected by the table of a calibration of the other sessions; absent where it makes none.
    pub rms_calibrated_table_arcsec: Option<f64>,
    /// Corrected by the model with the causes, in sessions that took no part in the fit.
    pub rms_extended_tables_arcsec: f64,
}

impl Compensation {
    /// The least that is left without a table, with the nominal and with the calibrated one, arcsec.
    pub(super) fn without_causes_arcsec(&self) -> f64 {
        let calibrated = self.rms_calibrated_table_arcsec.unwrap_or(f64::INFINITY);
        self.rms_uncompensated_arcsec.min(self.rms_nominal_tables_arcsec).min(calibrated)
    }

    /// Whether it was evaluated: no data are without any error.
    pub fn is_known(&self) -> bool {
        self.rms_uncompensated_arcsec > 0.0
    }
}

/// A cause that was found and gains too little in sessions left out to be named.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hint {
    /// Its name.
    pub name: CauseName,
    /// Share of the rms in sessions left out that it takes of what the other causes leave.
    pub gain: f64,
    /// Why it is no cause.
    pub why_not_a_cause: String,
}

/// Something found that has no name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unexplained {
    /// What it looks like.
    pub looks_like: String,
    /// Root mean square, arcsec.
    pub size_arcsec: f64,
}

/// A fault of the data as it was fitted beside the causes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedFault {
    /// Its name.
    pub name: FaultName,
    /// Session in which it begins, from 0.
    pub session: usize,
    /// When in that, s.
    pub since_s: f64,
    /// A step, arcsec, or a drift, arcsec/h.
    pub size: Parameter,
}

/// The result of a diagnosis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Version of this object.
    pub schema_version: u32,
    /// Verdict.
    pub verdict: Verdict,
    /// What was found about the unit.
    pub finding: Finding,
    /// Causes, likeliest first.
    pub causes: Vec<Cause>,
    /// Sets of causes, likeliest first: each cause or what these data do not tell from it. Empty where none is named.
    pub posterior: Vec<SetOfCauses>,
    /// Causes that gain too little to be named.
    pub hints: Vec<Hint>,
    /// Over all data.
    pub residual: Residual,
    /// Over sessions left out.
    pub held_out: HeldOut,
    /// What a correction by the model would leave.
    pub compensation: Compensation,
    /// What is there and has no name.
    pub unexplained: Vec<Unexplained>,
    /// Base parameters as the data have them, with their names: relative change.
    pub recalibrated: BTreeMap<String, Parameter>,
    /// White noise of a row and wander, arcsec.
    pub noise_arcsec: [f64; 2],
    /// Correlation time of the wander, s.
    pub wander_correlation_s: f64,
    /// What to record to tell look-alikes apart.
    pub next_experiment: Option<String>,
    /// Of the cause that was asked about, if it is not named: what to record to tell it from those that are.
    #[serde(skip)]
    pub experiment_for_asked: Option<String>,
    /// Where the bench sets its zero anew in each session: that of every session less that of the first. Told as a
    /// fault of the data.
    #[serde(skip)]
    pub zeros: Vec<Parameter>,
    /// Faults of the data that were found beside the causes. Told with those.
    #[serde(skip)]
    pub fitted_faults: Vec<FittedFault>,
    /// Why the rows that are left to judge by say nothing of the unit, where too many had to be set aside.
    #[serde(skip)]
    pub set_aside: Option<String>,
    /// Every decision: why these causes, and not others.
    pub trace: Trace,
}

impl Parameter {
    /// The value and its standard deviation as text: four decimals, or powers of ten where these would show nothing of
    /// either.
    pub fn digits(&self) -> [String; 2] {
        let all = [self.value, self.std];
        if all.iter().any(|v| *v != 0.0 && v.abs() < 5e-4) {
            all.map(|v| if v == 0.0 { "0".into() } else { format!("{v:.3e}") })
        } else {
            all.map(|v| format!("{v:.4}"))
        }
    }
}

impl Hint {
    /// A cause with this gain.
    pub(super) fn of(name: CauseName, gain: f64) -> Hint {
        let (gain_percent, least) = (100.0 * gain, 100.0 * LEAST_GAIN_OF_A_NAME);
        let why_not_a_cause =
            format!("it reduces the held-out rms by {gain_percent:.1} %; a cause by {least:.0} % at least");
        Hint { name, gain, why_not_a_cause }
    }
}

impl Diagnosis {
    /// Takes over what the core leaves in sessions left out. Causes explain the error in part if they, or their table,
    /// leave more there than the best of no table, the nominal and the calibrated one, by what counts as a gain of a
    /// name.
    pub(super) fn compensated(&mut self, evaluation: &Evaluation) {
        self.compensation = evaluation.left;
        let least = (1.0 - LEAST_GAIN_OF_A_NAME).recip() * evaluation.left.without_causes_arcsec();
        let by_table = !evaluation.applied.is_empty() && evaluation.left.rms_extended_tables_arcsec > least;
        if self.verdict == Verdict::Explained && (by_table || self.held_out.rms_after_arcsec > least) {
            self.verdict = Verdict::PartlyExplained;
        }
    }

    /// Takes back all causes: the data do not say what the unit does. `advice` is what to change at the bench.
    pub(super) fn say_nothing_of_the_unit(&mut self, advice: &str) {
        let unnamed = |cause: Cause| Unexplained {
            looks_like: format!("{} (the data do not tell)", cause.name),
            size_arcsec: cause.size_arcsec,
        };
        let causes = std::mem::take(&mut self.causes);
        self.unexplained.extend(causes.into_iter().map(unnamed));
        self.posterior.clear();
        self.hints.clear();
        (self.verdict, self.finding) = (Verdict::Unknown, Finding::DataUnusable);
        self.held_out.rms_after_arcsec = self.held_out.rms_before_arcsec;
        self.next_experiment = Some(format!("{advice}; then the same run again"));
    }

    /// The sets of causes that the data do not decide between, with their odds; causes by `name`.
    pub fn open_between(&self, name: fn(CauseName) -> &'static str) -> Option<String> {
        let least = OPEN * self.posterior.first()?.probability;
        let of_set = |of: &SetOfCauses| {
            let names: Vec<&str> = of.set.iter().map(|cause| name(*cause)).collect();
            let names = if names.is_empty() { "none of the library".to_owned() } else { names.join(" with ") };
            format!("{names} ({:.0} %)", 100.0 * of.probability)
        };
        let mut open: Vec<String> = self.posterior.iter().filter(|of| of.probability >= least).map(of_set).collect();
        if let Some(more @ 1..) = open.len().checked_sub(SHOWN) {
            open.truncate(SHOWN);
            open.push(format!("{more} other sets"));
        }
        (open.len() > 1).then(|| format!("not decided between {}", open.join(", ")))
    }

    /// A few lines for a terminal.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let verdict = match self.verdict {
            Verdict::None => "nothing beyond noise and unit-to-unit spread",
            Verdict::Explained => "explained",
            Verdict::PartlyExplained => "partly explained",
            Verdict::Unknown if self.finding == Finding::DataUnusable => "these data support none",
            Verdict::Unknown => "a discrepancy that no known cause explains",
        };
        let _ = writeln!(text, "finding: {}", self.finding.words());
        let open = self.open_between(CauseName::as_str).map(|open| format!(", {open}")).unwrap_or_default();
        let _ = writeln!(text, "verdict: {verdict}{open}");
        for cause in &self.causes {
            let _ = writeln!(
                text,
                "  {} ({:.0} %), {:.1} arcsec rms",
                cause.name,
                100.0 * cause.confidence,
                cause.size_arcsec
            );
            for (name, p) in &cause.parameters {
                let [value, std] = p.digits();
                let _ = writeln!(text, "    {name:<32} {value:>12} +- {std}");
            }
            let alike = cause.look_alikes.iter().map(|alike| alike.as_str().to_owned());
            let alike: Vec<String> = alike.chain(cause.outside_the_library()).collect();
            if !alike.is_empty() {
                let _ = writeln!(text, "    indistinguishable from: {}", alike.join(", "));
            }
        }
        for Hint { name, why_not_a_cause, .. } in &self.hints {
            let _ = writeln!(text, "  hint only: {name}, {why_not_a_cause}");
        }
        for left in &self.unexplained {
            let _ = writeln!(text, "  without a cause: {}, {:.1} arcsec rms", left.looks_like, left.size_arcsec);
        }
        let (r, h) = (&self.residual, &self.held_out);
        let _ = writeln!(text, "residual after stiffness, backlash and offsets are fitted to these data, arcsec rms");
        let _ = writeln!(
            text,
            "  held out: {:.2} without the causes, {:.2} with them",
            h.rms_before_arcsec, h.rms_after_arcsec
        );
        let _ = writeln!(
            text,
            "  fitted data{}: {:.2} without the causes, {:.2} with them, of which {:.2} is noise",
            if r.rows_averaged > 1 { format!(", means of {} rows", r.rows_averaged) } else { String::new() },
            r.rms_before_arcsec,
            r.rms_after_arcsec,
            r.noise_floor_arcsec
        );
        if let Some(next) = &self.next_experiment {
            let _ = writeln!(text, "next: {next}");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_confidence_is_written_with_four_digits() {
        let written = |value: f64| four_digits(&value, serde_json::value::Serializer).unwrap();
        assert_eq!([0.989_999_997_9, 1.0 / 3.0].map(written), [0.99, 0.3333]);
    }

    /// Causes that leave more in rows left out than a table without names are not all of it.
    #[test]
    fn causes_that_leave_more_than_a_calibrated_table_do_not_explain_the_error() {
        let nominal = crate::synthesize::catalogue_drive();
        let session = |k: usize| crate::measurement::Session {
            line: (0..600).collect(),
            generator_rad: (0..600).map(|row| 0.11 * row as f64).collect(),
            error_rad: (0..600).map(|row| 1e-6 * ((row * 7919 + k) % 13) as f64).collect(),
            ..Default::default()
        };
        let sessions: Vec<_> = (0..3).map(session).collect();
        let settings = crate::diagnosis::Settings::default();
        let found = crate::diagnosis::diagnose(&sessions, &nominal, None, &settings, |_, _, _| {}).unwrap().0;
        let after = |rms_after_arcsec, extended, calibrated, applied: &[CauseName]| {
            let left = Compensation {
                rms_uncompensated_arcsec: 90.0,
                rms_nominal_tables_arcsec: 40.0,
                rms_calibrated_table_arcsec: calibrated,
                rms_extended_tables_arcsec: extended,
            };
            let applied = applied.to_vec();
            let evaluation = Evaluation { left, applied, ..Evaluation::default() };
            let held_out = HeldOut { rms_after_arcsec, ..found.held_out };
            let mut diagnosis = Diagnosis { verdict: Verdict::Explained, held_out, ..found.clone() };
            diagnosis.compensated(&evaluation);
            assert_eq!(diagnosis.compensation, left);
            diagnosis.verdict
        };
        let cause = [CauseName::BacklashGrowth];
        assert_eq!(after(5.0, 5.1, Some(5.1), &cause), Verdict::Explained);
        assert_eq!(after(5.0, 5.2, Some(3.0), &cause), Verdict::PartlyExplained);
        assert_eq!(after(5.0, 40.0, Some(3.0), &[]), Verdict::PartlyExplained);
        // What no table can hold is explained by names alone.
        assert_eq!(after(5.0, 40.0, Some(12.0), &[]), Verdict::Explained);
        assert_eq!(after(41.0, 40.0, None, &[]), Verdict::Explained, "within what counts as a gain");
    }

    #[test]
    fn a_name_that_gains_too_little_is_a_hint() {
        assert!(Hint::of(CauseName::Wear, 0.02).why_not_a_cause.contains("it reduces the held-out rms by 2.0 %"));
        assert!(Hint::of(CauseName::Wear, -0.1).why_not_a_cause.contains("rms by -10.0 %"));
    }

    #[test]
    fn small_sizes_are_told_in_powers_of_ten() {
        assert_eq!((Parameter { value: -1.234e-5, std: 2e-7 }).digits(), ["-1.234e-5", "2.000e-7"]);
        assert_eq!((Parameter { value: 1.0, std: 0.0 }).digits(), ["1.0000", "0.0000"]);
        assert_eq!((Parameter { value: 3.25, std: 1e-4 }).digits(), ["3.250e0", "1.000e-4"]);
    }
}
