//! Every decision of a diagnosis: which law was judged, at which stage, by which gates, with which values and limits.
//!
//! The verdict alone does not say why a cause was *not* named. The trace does: of each cause it knows how far it came,
//! and the gate that stopped it. What `diagnosis.json` has under `trace`, what the report shows and what `--explain`
//! says are all made from it. What is collected are numbers that the search has in hand anyway, some hundred of them.

use serde::Serialize;
use serde::ser::Serializer;

use super::candidate::Label;
use crate::causes::{CauseName, Need};

table! {
    /// Where in the search a decision fell.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub(crate) enum Stage: &'static str {
        Data = "the data",
        Tried = "tried at many places",
        Forward = "refined together with the causes chosen before",
        Backward = "held against what was chosen after it",
        Settled = "at the end of the search",
        Understood = "together with unnamed terms",
        Rival = "against its rivals",
        Verdict = "the verdict",
    }
}

table! {
    /// A gate that a law has to pass, and what it asks, as a sentence of which the law is the subject.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub(crate) enum Gate: &'static str {
        Tolerance = "takes a parameter of the nominal model out of its tolerance (standard deviations between units)",
        Room = "finds room next to the models chosen already",
        Refined = "gains as much evidence, not yet refined, as the laws that are refined",
        Sense = "has signs and sizes that make sense",
        Deviations = "is larger than its own deviations (their share of it)",
        Gain = "gains evidence when it is refined",
        First = "gains more evidence than any other law",
        Evidence = "gains evidence over the model without it (natural logarithm)",
        Size = "is large enough (arcsec rms)",
        SizeIfClear = "is large enough for a cause that is clear (arcsec rms)",
        Alone = "is larger than what the laws of the other causes may be wrong by (arcsec rms)",
        LeftOut = "predicts sessions that it was not fitted to (gain)",
        NoGrowthWithSpeed = "does not grow with the speed (growth of its amplitude, standard deviations; negative \
            where it fades)",
        LoadKnown = "leaves no more than noise, as a load that was not recorded may make it (times the noise)",
        NoLineBeside = "does not stand beside a line in time near its frequency that nothing in the drive drives (its \
            size as a share of the cause)",
        KnownWell = "is well determined next to unnamed terms (times its own uncertainty)",
        ToldFromZero = "has a size that differs from zero (times its standard deviation)",
        ToldApart = "is distinguishable from a rival (rise of the misfit with the rival in its place)",
        AsRival = "tells the data better in the place of a cause that was named (rise of the misfit)",
        NoWorse = "predicts sessions left out, with the others named (arcsec rms)",
        ;
        /// The data hold what it needs.
        #[serde(untagged)]
        Needs(Need) = missing
    }
}

/// A gate with what came to it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// The gate.
    pub(crate) gate: Gate,
    /// The value, if it is a number.
    pub value: Option<f64>,
    /// The limit.
    pub limit: Option<f64>,
    /// Whether the value has to be below the limit, not above.
    #[serde(skip)]
    pub is_below: bool,
    /// Whether it let it through.
    pub passed: bool,
}

impl Judged {
    /// The value has to be above the limit.
    pub(crate) fn above(gate: Gate, value: f64, limit: f64) -> Judged {
        Judged { gate, value: Some(value), limit: Some(limit), is_below: false, passed: value > limit }
    }

    /// The value has to be below the limit.
    pub(crate) fn below(gate: Gate, value: f64, limit: f64) -> Judged {
        Judged { is_below: true, passed: value < limit, ..Judged::above(gate, value, limit) }
    }

    /// A value that is no number.
    pub(crate) fn plain(gate: Gate, passed: bool) -> Judged {
        Judged { gate, value: None, limit: None, is_below: false, passed }
    }
}

/// Whether all gates let it through.
pub(crate) fn passed(gates: &[Judged]) -> bool {
    gates.iter().all(|judged| judged.passed)
}

/// One judgement of one law.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// The law that was judged.
    pub label: Label,
    /// Where.
    pub(crate) stage: Stage,
    /// In which round of the search, from 1; 0 before it.
    pub round: usize,
    /// What it was held against, if that was another law.
    pub against: Option<Label>,
    /// The gates that it came to, in their order.
    pub gates: Vec<Judged>,
}

impl Decision {
    /// Whether all gates let it through.
    pub fn passed(&self) -> bool {
        passed(&self.gates)
    }

    /// The gate that decided: the first that did not let it through, or the last of those that did.
    pub fn deciding(&self) -> Option<&Judged> {
        self.gates.iter().find(|judged| !judged.passed).or(self.gates.last())
    }
}

/// All decisions in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    steps: Vec<Decision>,
    /// The round of the search that is going on, from 1; 0 before it.
    pub(super) round: usize,
}

impl Trace {
    /// A decision on a law or a cause, held against another where there is one.
    pub(super) fn decided(&mut self, stage: Stage, label: Label, against: Option<Label>, gates: Vec<Judged>) {
        self.steps.push(Decision { label, stage, round: self.round, against, gates });
    }

    /// Decisions on a cause, in their order.
    pub(crate) fn of(&self, cause: CauseName) -> impl DoubleEndedIterator<Item = &Decision> {
        self.steps.iter().filter(move |step| step.label == Label::Cause(cause))
    }

    /// The decision that says why a cause was not named: of the last stage that it came to, the one of the law that
    /// came farthest. None if all gates let it through to the end.
    pub(crate) fn stopped(&self, cause: CauseName) -> Option<&Decision> {
        let search = |step: &&Decision| step.stage != Stage::Rival;
        let last = self.of(cause).rev().find(search)?;
        if last.passed() {
            return None;
        }
        let gained = |step: &Decision| {
            [Gate::Evidence, Gate::Gain, Gate::First, Gate::Refined]
                .into_iter()
                .find_map(|gate| step.gates.iter().find(|judged| judged.gate == gate)?.value)
                .unwrap_or(f64::NEG_INFINITY)
        };
        let beside = self.of(cause).filter(|step| step.round == last.round && !step.passed() && search(step));
        beside.max_by(|a, b| a.stage.cmp(&b.stage).then(gained(a).total_cmp(&gained(b))))
    }

    /// The decisions that say what became of a cause: those of the last round that it was judged in, and from any round
    /// those where it was chosen, given up, or held against a rival.
    pub(crate) fn telling(&self, cause: CauseName) -> Vec<&Decision> {
        let last = self.of(cause).map(|step| step.round).max().unwrap_or(0);
        let tells = |step: &&Decision| {
            step.round == last || !matches!(step.stage, Stage::Tried | Stage::Forward) || step.passed()
        };
        self.of(cause).filter(tells).collect()
    }
}

/// One gate of a step, as it stands in `diagnosis.json`.
#[derive(Serialize)]
struct TraceEntry<'a> {
    cause: String,
    stage: Stage,
    round: usize,
    #[serde(flatten)]
    judged: &'a Judged,
    #[serde(skip_serializing_if = "Option::is_none")]
    against: Option<String>,
}

/// Decisions as they stand in files: gate by gate.
pub(crate) struct TraceEntries<'a>(pub Vec<&'a Decision>);

impl Serialize for TraceEntries<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let entry = |step: &Decision, judged| {
            let (cause, against) = (step.label.to_string(), step.against.map(|against| against.to_string()));
            TraceEntry { cause, stage: step.stage, round: step.round, judged, against }
        };
        serializer.collect_seq(self.0.iter().flat_map(|step| step.gates.iter().map(move |judged| entry(step, judged))))
    }
}

impl Serialize for Trace {
    /// The deciding gates of each cause, cause after cause.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        TraceEntries(CauseName::ALL.iter().flat_map(|cause| self.telling(*cause)).collect()).serialize(serializer)
    }
}
