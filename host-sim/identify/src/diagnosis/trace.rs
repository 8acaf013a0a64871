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
    pub enum Stage: &'static str {
        /// Before the search: can these data speak of the cause at all?
        Data = "the data",
        /// A law is tried at many places, none of them refined.
        Tried = "tried at many places",
        /// Laws are refined, and compared beside those chosen before.
        Forward = "refined together with the causes chosen before",
        /// A law that was chosen has to earn its place again beside a later one.
        Backward = "held against what was chosen after it",
        /// How a law that was chosen stands when the search is over.
        Settled = "at the end of the search",
        /// What has no name beside a cause must not be too large.
        Understood = "together with unnamed terms",
        /// Every rival is refitted in the place of a cause.
        Rival = "against its rivals",
        /// The verdict over all causes together.
        Verdict = "the verdict",
    }
}

impl Stage {
    /// Its words for a reader.
    pub const fn words(self) -> &'static str {
        self.row()
    }
}

table! {
    /// A gate that a law has to pass, and what it asks, as a sentence of which the law is the subject.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Gate: &'static str {
        /// A parameter of the nominal model has left its tolerance, in standard deviations between units.
        Tolerance = "takes a parameter of the nominal model out of its tolerance (standard deviations between units)",
        /// There is room: this many causes, or deviations, are chosen at most.
        Room = "finds room next to the models chosen already",
        /// Tried at many places it gains as much evidence as the last law that was refined.
        Refined = "gains as much evidence, not yet refined, as the laws that are refined",
        /// Its signs and sizes make sense.
        Sense = "has signs and sizes that make sense",
        /// Its deviations are no larger than this share of the law itself.
        Deviations = "is larger than its own deviations (their share of it)",
        /// Refined it gains any evidence.
        Gain = "gains evidence when it is refined",
        /// No other law gains more.
        First = "gains more evidence than any other law",
        /// It gains evidence over the model without it.
        Evidence = "gains evidence over the model without it (natural logarithm)",
        /// It is large enough, arcsec.
        Size = "is large enough (arcsec rms)",
        /// It is large enough for a cause that is clear, arcsec.
        SizeIfClear = "is large enough for a cause that is clear (arcsec rms)",
        /// What nothing else explains of it is larger than what the laws of the other causes may be wrong by, arcsec.
        Alone = "is larger than what the laws of the other causes may be wrong by (arcsec rms)",
        /// It predicts sessions that it was not fitted to.
        LeftOut = "predicts sessions that it was not fitted to (gain)",
        /// A line of the generator's angle does not grow with the speed.
        NoGrowthWithSpeed = "does not grow with the speed (growth of its amplitude, standard deviations; negative \
            where it fades)",
        /// A load that was not recorded may make it: no more is left than this many times the noise.
        LoadKnown = "leaves no more than noise, as a load that was not recorded may make it (times the noise)",
        /// No line in time that has no name, near its frequency, is as large as this against it.
        NoLineBeside = "does not stand beside a line in time near its frequency that nothing in the drive drives (its \
            size as a share of the cause)",
        /// It is this many times its own uncertainty.
        KnownWell = "is well determined next to unnamed terms (times its own uncertainty)",
        /// The best known of its sizes is this many times its standard deviation.
        ToldFromZero = "has a size that differs from zero (times its standard deviation)",
        /// Rivals raise the misfit by this much.
        ToldApart = "is distinguishable from a rival (rise of the misfit with the rival in its place)",
        /// As a rival it would lower the misfit against the cause that was named.
        AsRival = "tells the data better in the place of a cause that was named (rise of the misfit)",
        /// All causes together predict sessions left out no worse than the nominal model, arcsec rms.
        NoWorse = "predicts sessions left out, with the others named (arcsec rms)",
        ;
        /// The data hold what it needs.
        #[serde(untagged)]
        Needs(Need) = missing
    }
}

impl Gate {
    /// What it asks, as a sentence of which the law is the subject.
    pub const fn asks(self) -> &'static str {
        self.row()
    }
}

/// A gate with what came to it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// The gate.
    pub gate: Gate,
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
    pub fn above(gate: Gate, value: f64, limit: f64) -> Judged {
        Judged { gate, value: Some(value), limit: Some(limit), is_below: false, passed: value > limit }
    }

    /// The value has to be below the limit.
    pub fn below(gate: Gate, value: f64, limit: f64) -> Judged {
        Judged { is_below: true, passed: value < limit, ..Judged::above(gate, value, limit) }
    }

    /// A value that is no number.
    pub fn plain(gate: Gate, passed: bool) -> Judged {
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
    pub stage: Stage,
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
    pub fn of(&self, cause: CauseName) -> impl DoubleEndedIterator<Item = &Decision> {
        self.steps.iter().filter(move |step| step.label == Label::Cause(cause))
    }

    /// The decision that says why a cause was not named: of the last stage that it came to, the one of the law that
    /// came farthest. None if all gates let it through to the end.
    pub fn stopped(&self, cause: CauseName) -> Option<&Decision> {
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
    pub fn telling(&self, cause: CauseName) -> Vec<&Decision> {
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
