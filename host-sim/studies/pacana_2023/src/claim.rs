//! A claim of the paper beside what the model says, and the verdict, which follows from numbers alone.

use serde::Serialize;

use flexspline_mechanics::drive::GeneratorKind;

/// What comes of a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, PartialOrd, Ord)]
pub enum Verdict {
    /// Every check of the model passes.
    #[serde(rename = "reproduced")]
    Reproduced,
    /// Some check of the model fails.
    #[serde(rename = "not reproduced")]
    NotReproduced,
    /// The paper contradicts itself.
    #[serde(rename = "inconsistent in the paper")]
    Inconsistent,
    /// The paper gives too little to hold the model against, or the run that would tell failed.
    #[serde(rename = "not testable")]
    NotTestable,
}

impl Verdict {
    /// All of them.
    pub const ALL: [Verdict; 4] =
        [Verdict::Reproduced, Verdict::NotReproduced, Verdict::Inconsistent, Verdict::NotTestable];

    /// As in the JSON.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Reproduced => "reproduced",
            Verdict::NotReproduced => "not reproduced",
            Verdict::Inconsistent => "inconsistent in the paper",
            Verdict::NotTestable => "not testable",
        }
    }
}

/// Whose number a check looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Of {
    /// Ours: it passes or the claim is not reproduced.
    Model,
    /// The paper's own: it passes or the paper is inconsistent.
    Paper,
}

/// A number and the bounds it has to keep.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// Whose number.
    pub of: Of,
    /// What it is.
    pub what: String,
    /// The number; `null` where a run did not converge.
    pub value: f64,
    /// Its unit; empty for a plain number.
    pub unit: &'static str,
    /// Lower bound.
    pub at_least: Option<f64>,
    /// Upper bound.
    pub at_most: Option<f64>,
}

impl Check {
    /// Whether the number keeps its bounds.
    pub fn passes(&self) -> bool {
        self.at_least.is_none_or(|bound| self.value >= bound) && self.at_most.is_none_or(|bound| self.value <= bound)
    }
}

/// A number of the paper or of ours, for reading.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Number {
    /// What it is of, for instance a generator; may be empty.
    pub name: String,
    /// The value; `null` where a run did not converge.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
}

/// One claim.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Claim {
    /// Looked up by.
    pub id: &'static str,
    /// What part of the paper it belongs to.
    pub part: &'static str,
    /// Figure, formula or section.
    pub place: &'static str,
    /// What the paper says.
    pub says: String,
    /// Its numbers.
    pub paper: Vec<Number>,
    /// What is measured, exactly.
    pub metric: &'static str,
    /// Our numbers.
    pub ours: Vec<Number>,
    /// What decides.
    pub checks: Vec<Check>,
    /// What the paper does not give and the claim would need.
    pub missing: Option<&'static str>,
    /// What comes of it: see [`verdict`].
    pub verdict: Verdict,
    /// Why, in a sentence.
    pub reason: String,
}

/// The verdict, from the checks alone: a failed check of the paper's own numbers is an inconsistency; what is missing,
/// or a number that no run gave, leaves a claim untestable; else the model's checks decide.
pub fn verdict(checks: &[Check], missing: bool) -> Verdict {
    let of = |whose| checks.iter().filter(move |check| check.of == whose);
    if of(Of::Paper).any(|check| !check.passes()) {
        return Verdict::Inconsistent;
    }
    if missing || checks.is_empty() || of(Of::Model).any(|check| check.value.is_nan()) {
        return Verdict::NotTestable;
    }
    if checks.iter().all(Check::passes) { Verdict::Reproduced } else { Verdict::NotReproduced }
}

/// A claim as it is written down.
pub struct Draft(Claim);

/// A claim that the paper makes at a place.
pub fn claim(id: &'static str, place: &'static str, says: impl Into<String>) -> Draft {
    Draft(Claim {
        id,
        part: "",
        place,
        says: says.into(),
        paper: Vec::new(),
        metric: "",
        ours: Vec::new(),
        checks: Vec::new(),
        missing: None,
        verdict: Verdict::NotTestable,
        reason: String::new(),
    })
}

impl Draft {
    /// A number of the paper.
    pub fn paper(mut self, name: impl Into<String>, value: f64, unit: &'static str) -> Draft {
        self.0.paper.push(Number { name: name.into(), value, unit });
        self
    }

    /// What is measured.
    pub fn metric(mut self, metric: &'static str) -> Draft {
        self.0.metric = metric;
        self
    }

    /// A number of ours.
    pub fn ours(mut self, name: impl Into<String>, value: f64, unit: &'static str) -> Draft {
        self.0.ours.push(Number { name: name.into(), value, unit });
        self
    }

    /// A number of ours for each of some generators; `of` goes behind their names.
    pub(crate) fn ours_each(
        self,
        kinds: impl IntoIterator<Item = GeneratorKind>,
        of: &str,
        value: impl Fn(GeneratorKind) -> f64,
        unit: &'static str,
    ) -> Draft {
        kinds.into_iter().fold(self, |draft, kind| draft.ours(format!("{}{of}", kind.in_words()), value(kind), unit))
    }

    fn check(
        mut self,
        of: Of,
        what: impl Into<String>,
        value: f64,
        unit: &'static str,
        bounds: [Option<f64>; 2],
    ) -> Draft {
        let [at_least, at_most] = bounds;
        self.0.checks.push(Check { of, what: what.into(), value, unit, at_least, at_most });
        self
    }

    /// Ours must be at least this.
    pub fn at_least(self, what: impl Into<String>, value: f64, unit: &'static str, bound: f64) -> Draft {
        self.check(Of::Model, what, value, unit, [Some(bound), None])
    }

    /// Ours must be at most this.
    pub fn at_most(self, what: impl Into<String>, value: f64, unit: &'static str, bound: f64) -> Draft {
        self.check(Of::Model, what, value, unit, [None, Some(bound)])
    }

    /// Ours must be within a share of the paper's.
    pub fn within(self, what: impl Into<String>, value: f64, unit: &'static str, paper: f64, share: f64) -> Draft {
        let bounds = [paper * (1.0 - share), paper * (1.0 + share)].map(Some);
        self.check(Of::Model, what, value, unit, bounds)
    }

    /// The paper's own numbers must keep these bounds.
    pub(crate) fn paper_keeps(
        self,
        what: impl Into<String>,
        value: f64,
        unit: &'static str,
        bounds: [Option<f64>; 2],
    ) -> Draft {
        self.check(Of::Paper, what, value, unit, bounds)
    }

    /// The paper does not give this.
    pub fn missing(mut self, what: &'static str) -> Draft {
        self.0.missing = Some(what);
        self
    }

    /// The claim, judged; `reason` is told the verdict.
    pub fn because(self, reason: impl FnOnce(Verdict) -> String) -> Claim {
        let mut claim = self.0;
        claim.verdict = verdict(&claim.checks, claim.missing.is_some());
        let unsolved = claim.missing.is_none() && claim.verdict == Verdict::NotTestable;
        claim.reason = if unsolved { "A run that would tell did not converge.".into() } else { reason(claim.verdict) };
        claim
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(draft: Draft) -> Verdict {
        draft.because(|_| String::new()).verdict
    }

    fn plain() -> Draft {
        claim("id", "Fig. 0", "says")
    }

    #[test]
    fn the_verdict_follows_from_the_checks() {
        assert_eq!(of(plain().within("x", 1.0, "′", 1.16, 0.25)), Verdict::Reproduced);
        assert_eq!(of(plain().within("x", 0.5, "′", 21.4, 0.25)), Verdict::NotReproduced);
        assert_eq!(of(plain().at_least("x", 2.9, "", 3.0)), Verdict::NotReproduced);
        assert_eq!(of(plain().at_least("x", 3.1, "", 3.0).at_most("y", 2.0, "", 1.0)), Verdict::NotReproduced);
        assert_eq!(of(plain().at_most("x", 0.9, "", 1.0)), Verdict::Reproduced);
        assert_eq!(of(plain()), Verdict::NotTestable);
    }

    #[test]
    fn the_papers_own_arithmetic_comes_first() {
        let wrong = plain().paper_keeps("converted", 10.3, "′", [Some(3.5), Some(4.5)]).at_least("x", 1.0, "", 0.0);
        assert_eq!(of(wrong), Verdict::Inconsistent);
        let right = plain().paper_keeps("converted", 21.4, "′", [Some(20.5), Some(21.5)]).at_least("x", 1.0, "", 0.0);
        assert_eq!(of(right), Verdict::Reproduced);
    }

    #[test]
    fn what_no_run_gave_is_not_judged() {
        let claim = plain().at_most("x", f64::NAN, "", 1.0).because(|_| "because".into());
        assert_eq!(
            (claim.verdict, claim.reason.as_str()),
            (Verdict::NotTestable, "A run that would tell did not converge.")
        );
        assert_eq!(of(plain().at_most("x", 0.0, "", 1.0).missing("a width")), Verdict::NotTestable);
    }
}
