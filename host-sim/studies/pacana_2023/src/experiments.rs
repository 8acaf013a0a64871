//! What would have to be changed in the model to get the paper's errors of 10′ to 21′: each suspect alone, through the
//! same protocol.

use serde::Serialize;

use super::metrics::ProtocolMetrics;
use super::paper;
use super::runs::{Job, Solved, Variant};
use flexspline_base::units::ARCMIN_PER_RAD;
use flexspline_design::simulate::SimulateError;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Holding, Method, SolverSettings};

/// Errors beyond this are shown and told both ways, arc-minutes.
pub(crate) const LARGE_ARCMIN: f64 = 5.0;

/// A change of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// Nothing.
    None,
    /// The error counted from the other flank, as when the output had last been driven backwards: no run of its own.
    StartUp,
    /// Hardly any drag on the output.
    NoDrag,
    /// One straight facet for each flank of both wheels.
    Facets,
    /// Contact so soft that it is hardly one.
    SoftContact,
    /// Friction between the flanks and some drag.
    Friction,
    /// The paper's load as a drag on the output.
    Drag,
    /// The rim held at a single point of its bore, on the major axis at the start.
    OnePoint,
    /// The rim held at one point, where the error comes out at zero at the turn.
    OnePointAside,
    /// The rim held at four points.
    FourPoints,
}

/// Angle of the point of [`Change::OnePointAside`] from the major axis at the start, degrees: by the cam's
/// `v = −(w0/2) sin 2φ` the error then is zero again after 1 rad, at `φ = (3π + 2)/4`, which is 163.6° or −16.4°.
const ASIDE_DEG: i32 = -16;
/// Friction coefficient and drag of [`Change::Friction`].
const FRICTION: (f64, f64) = (0.15, 20.0);
/// Penalties of [`Change::SoftContact`], N/mm³: the least that are accepted.
const SOFT: f64 = 1e3;
/// Drag of [`Change::NoDrag`], N m: with none at all an output that carries no load has no equilibrium.
const HARDLY_ANY_DRAG: f64 = 1e-3;

impl Change {
    /// All of them, in the order of the page.
    pub const ALL: [Change; 10] = [
        Change::None,
        Change::StartUp,
        Change::NoDrag,
        Change::Facets,
        Change::SoftContact,
        Change::Friction,
        Change::Drag,
        Change::OnePoint,
        Change::OnePointAside,
        Change::FourPoints,
    ];

    /// Looked up by.
    pub fn id(self) -> &'static str {
        match self {
            Change::None => "as-it-is",
            Change::StartUp => "start-up",
            Change::NoDrag => "no-drag",
            Change::Facets => "facets",
            Change::SoftContact => "soft-contact",
            Change::Friction => "friction",
            Change::Drag => "drag",
            Change::OnePoint => "one-point",
            Change::OnePointAside => "one-point-aside",
            Change::FourPoints => "four-points",
        }
    }

    /// In a few words.
    pub fn name(self) -> &'static str {
        match self {
            Change::None => "as it is",
            Change::StartUp => "start-up counted",
            Change::NoDrag => "no drag",
            Change::Facets => "flanks of one facet",
            Change::SoftContact => "soft contact",
            Change::Friction => "friction and drag",
            Change::Drag => "drag of 200 N·m",
            Change::OnePoint => "rim held at one point",
            Change::OnePointAside => "one point, 16° aside",
            Change::FourPoints => "rim held at four points",
        }
    }

    /// What is changed, exactly.
    pub fn what(self) -> String {
        match self {
            Change::None => "Nothing is changed; coarse mesh, as in all these runs.".into(),
            Change::StartUp => "The error is set to zero with the output against its other flank, as if it had last \
                                been driven backwards; the run is the one above."
                .into(),
            Change::NoDrag => format!("Drag on the output {HARDLY_ANY_DRAG} N·m in place of 0.02 N·m."),
            Change::Facets => "Each flank of both wheels is a single straight facet, as on a mesh with one linear \
                               element there."
                .into(),
            Change::SoftContact => {
                format!("All contact penalties {SOFT:.0} N/mm³, a thousandth of what is used and less.")
            }
            Change::Friction => format!(
                "Friction coefficient {} between the flanks and a drag of {} N·m on the output.",
                FRICTION.0, FRICTION.1
            ),
            Change::Drag => format!(
                "The output is braked with the paper's {} N·m in either direction, in place of being loaded.",
                paper::TORQUE_N_M
            ),
            Change::OnePoint => "The flexspline is kept from turning at a single node of its bore, on the major axis \
                                 at the start, in place of the mean of the bore."
                .into(),
            Change::OnePointAside => format!("The same at a node −{}° from the major axis.", ASIDE_DEG.abs()),
            Change::FourPoints => {
                "The flexspline is kept from turning by the mean of four nodes of its bore, 90° apart.".into()
            }
        }
    }

    /// The change as the subject of a sentence.
    fn subject(self) -> &'static str {
        match self {
            Change::None => "the drive as it is",
            Change::StartUp => "an error counted from the other flank",
            Change::NoDrag => "an output without drag",
            Change::Facets => "a flank of one facet",
            Change::SoftContact => "soft contact",
            Change::Friction => "friction with drag",
            Change::Drag => "an output braked by 200 N·m",
            Change::OnePoint => "a rim held at one point",
            Change::OnePointAside => "a rim held at one point aside",
            Change::FourPoints => "a rim held at four points",
        }
    }

    /// What such numbers would come from.
    fn source(self) -> &'static str {
        match self {
            Change::None => "the clearance and the ripple of the drive as it is",
            Change::StartUp => "taking up the clearance at the start",
            Change::NoDrag => "an output that nothing holds back",
            Change::Facets => "straight facets in place of the flanks",
            Change::SoftContact => "contact that is too soft",
            Change::Friction => "friction of the flanks with some drag",
            Change::Drag => "an output that is braked by 200 N·m and lags by its wind-up either way",
            Change::OnePoint => {
                "a rim that is kept from turning at a single point, whose tangential displacement v in the wave is \
                 then read as motion of the output"
            }
            Change::OnePointAside => {
                "the same point held elsewhere, where the error may vanish at 1 rad and be larger on the way back"
            }
            Change::FourPoints => {
                "a rim that is kept from turning at four points, of whose v the second harmonic cancels"
            }
        }
    }

    /// Whether a generator is run with it. Two rollers do not hold the rim against such a drag; held at one point
    /// between them it finds no equilibrium by this solver, near 0.3 rad.
    fn suits(self, kind: GeneratorKind) -> bool {
        let beyond = matches!(self, Change::Drag | Change::Friction | Change::OnePoint | Change::OnePointAside);
        kind != GeneratorKind::TwoRoller || !beyond
    }

    fn apply(self, drive: &mut Drive, solver: &mut SolverSettings) {
        match self {
            Change::None | Change::StartUp => {}
            Change::NoDrag => drive.output.drag_torque_n_m = HARDLY_ANY_DRAG,
            Change::Facets => solver.flank_facets = Some(1),
            Change::SoftContact => {
                solver.flank_penalty = SOFT;
                solver.bore_penalty = Some(SOFT);
            }
            Change::Friction => {
                (drive.flanks.friction_coefficient, drive.output.drag_torque_n_m) = FRICTION;
            }
            Change::Drag => drive.output.drag_torque_n_m = paper::TORQUE_N_M,
            Change::OnePoint => solver.holding = Holding::Points { count: 1, first_deg: 0 },
            Change::OnePointAside => solver.holding = Holding::Points { count: 1, first_deg: ASIDE_DEG },
            Change::FourPoints => solver.holding = Holding::Points { count: 4, first_deg: 0 },
        }
    }
}

/// What a change does to one drive; errors count from where the drive was deformed.
#[derive(Debug, Clone, Serialize)]
pub struct ExperimentEffect {
    /// Wave generator.
    pub generator: &'static str,
    /// `converged`, or why not.
    pub status: String,
    /// Metrics with the change.
    pub metrics: Option<ProtocolMetrics>,
    /// Largest error of the whole path, arc-minutes.
    pub largest_arcmin: Option<f64>,
    /// What the paper has for it, arc-minutes, if it gives a number.
    pub paper_arcmin: Option<f64>,
    /// Error over generator angle (rad, arcsec) on the way out and on the way back.
    #[serde(skip)]
    pub curves: [Vec<[f64; 2]>; 2],
}

/// A change and what it does.
#[derive(Debug, Clone, Serialize)]
pub struct Experiment {
    /// Looked up by.
    pub id: &'static str,
    /// In a few words.
    pub name: &'static str,
    /// What is changed, exactly.
    pub what: String,
    /// By generator.
    pub effects: Vec<ExperimentEffect>,
    /// Mean of |ln(largest error / the paper's)| over the generators that the paper has a number for; 0 is the paper's
    /// size.
    pub distance: Option<f64>,
    /// Whether the largest error lies within the paper's 10.3′ to 21.4′ for every generator that has a number.
    pub reaches: bool,
    /// The drive as it is, or a reading of its run: here a run without equilibrium is a failure.
    #[serde(skip)]
    pub is_unchanged: bool,
    /// What is changed, as the subject of a sentence.
    #[serde(skip)]
    pub subject: &'static str,
    /// The sentence to take away.
    pub takeaway: String,
}

/// Generators of the experiments.
pub(super) fn generators(quick: bool) -> &'static [GeneratorKind] {
    if quick { &[GeneratorKind::FourRoller, GeneratorKind::Cam] } else { &GeneratorKind::ALL }
}

/// Changes that are tried.
pub(super) fn changes(quick: bool) -> Vec<Change> {
    let few = [Change::None, Change::StartUp, Change::Facets, Change::OnePoint];
    Change::ALL.into_iter().filter(|change| !quick || few.contains(change)).collect()
}

/// The runs, in the order that [`conclude`] expects.
pub(super) fn jobs(drive: &Drive, quick: bool) -> Vec<Job> {
    let runs = changes(quick).into_iter().filter(|change| *change != Change::StartUp);
    runs.flat_map(|change| {
        generators(quick).iter().filter(move |kind| change.suits(**kind)).map(move |&kind| {
            let mut drive = drive.clone();
            let mut solver =
                SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() };
            change.apply(&mut drive, &mut solver);
            Job { drive, kind, torque_n_m: 0.0, variant: Variant::Standard, solver, keep_rows: true, snapshot: false }
        })
    })
    .collect()
}

fn largest(metrics: &ProtocolMetrics) -> f64 {
    metrics.largest_out_arcsec.max(metrics.largest_back_arcsec) / 60.0
}

/// What the runs of [`jobs`] say.
pub(super) fn conclude(results: Vec<Result<Solved, SimulateError>>, quick: bool) -> Vec<Experiment> {
    let mut results = results.into_iter();
    let mut experiments: Vec<Experiment> = Vec::new();
    for change in changes(quick) {
        let effects: Vec<ExperimentEffect> = if change == Change::StartUp {
            experiments[0].effects.iter().map(counted_from_the_other_flank).collect()
        } else {
            let suited = generators(quick).iter().filter(|kind| change.suits(**kind));
            suited.map(|&kind| effect(kind, results.next().expect("a result to each job"))).collect()
        };
        experiments.push(experiment(change, effects));
    }
    experiments
}

fn effect(kind: GeneratorKind, result: Result<Solved, SimulateError>) -> ExperimentEffect {
    let paper_arcmin = paper::error_rad(kind).map(|rad| rad * ARCMIN_PER_RAD);
    let (status, solved) = match result {
        Ok(solved) => ("converged".to_owned(), Some(solved)),
        Err(error) => (error.to_string(), None),
    };
    let curves = solved.as_ref().map_or_else(Default::default, |s| curves(&s.rows));
    let start_arcsec = solved.as_ref().and_then(|s| s.rows.first()).map_or(0.0, |row| row.error_arcsec);
    let metrics = solved.map(|s| s.metrics);
    let largest_arcmin = metrics.as_ref().map(largest);
    let effect = ExperimentEffect { generator: kind.name(), status, metrics, largest_arcmin, paper_arcmin, curves };
    // A rim that is held aside of the axis stands turned from the start.
    shifted(effect, -start_arcsec)
}

/// Error over the generator angle, way out and way back, both with growing angle.
pub(crate) fn curves(rows: &[flexspline_design::simulate::Row]) -> [Vec<[f64; 2]>; 2] {
    let turn = super::metrics::turn_of(rows);
    let line = |rows: &[flexspline_design::simulate::Row]| {
        rows.iter().map(|row| [row.generator_rad, row.error_arcsec]).collect()
    };
    let (out, mut back): (Vec<_>, Vec<_>) = (line(&rows[..=turn]), line(&rows[turn..]));
    back.reverse();
    [out, back]
}

/// The motion of `base` with zero on the flank that the output leaves.
fn counted_from_the_other_flank(base: &ExperimentEffect) -> ExperimentEffect {
    let half = base.metrics.and_then(|metrics| metrics.half_width_arcsec).unwrap_or(0.0);
    let mut effect = shifted(base.clone(), -half);
    // It begins there.
    if let Some(first) = effect.curves[0].first_mut() {
        first[1] = 0.0;
    }
    effect
}

/// `effect` with every error larger by `more_arcsec`.
fn shifted(mut effect: ExperimentEffect, more_arcsec: f64) -> ExperimentEffect {
    let Some(metrics) = &mut effect.metrics else { return effect };
    for curve in &mut effect.curves {
        curve.iter_mut().for_each(|point| point[1] += more_arcsec);
    }
    let most = |curve: &[[f64; 2]]| curve.iter().map(|p| p[1].abs()).fold(0.0, f64::max);
    metrics.largest_out_arcsec = most(&effect.curves[0]);
    metrics.largest_back_arcsec = most(&effect.curves[1]);
    metrics.lag_forward_arcsec = metrics.lag_forward_arcsec.map(|e| e + more_arcsec);
    metrics.lag_backward_arcsec = metrics.lag_backward_arcsec.map(|e| e + more_arcsec);
    metrics.error_at_turn_arcsec += more_arcsec;
    metrics.error_at_end_arcsec += more_arcsec;
    effect.largest_arcmin = Some(largest(metrics));
    effect
}

fn experiment(change: Change, effects: Vec<ExperimentEffect>) -> Experiment {
    let pairs: Vec<(f64, f64)> = effects.iter().filter_map(|e| e.largest_arcmin.zip(e.paper_arcmin)).collect();
    let all = pairs.len() == effects.iter().filter(|e| e.paper_arcmin.is_some()).count();
    let distance = (all && !pairs.is_empty())
        .then(|| pairs.iter().map(|(ours, paper)| (ours / paper).ln().abs()).sum::<f64>() / pairs.len() as f64);
    let reaches = all && reaches(pairs.iter().map(|(ours, _)| *ours));
    let sizes: Vec<String> = effects.iter().map(size).collect();
    let some = pairs.iter().any(|(ours, _)| self::reaches([*ours].into_iter()));
    let beyond = all && pairs.iter().all(|(ours, _)| *ours > paper::ERROR_CAM_RAD * ARCMIN_PER_RAD);
    let begins = match (reaches, beyond, some) {
        (true, ..) => "Such numbers come from",
        (false, true, _) => "Such numbers, and larger ones, come from",
        (false, false, true) => "For some of the generators such numbers come from",
        (false, false, false) => "Such numbers do not come from",
    };
    let takeaway = format!("{begins} {}: {}.", change.source(), sizes.join(", "));
    Experiment {
        id: change.id(),
        name: change.name(),
        what: change.what(),
        effects,
        distance,
        reaches,
        is_unchanged: matches!(change, Change::None | Change::StartUp),
        subject: change.subject(),
        takeaway,
    }
}

/// The size of an error in words: of a large one also where.
fn size(effect: &ExperimentEffect) -> String {
    let name = effect.generator.replace("double-", "double ");
    match (effect.largest_arcmin, &effect.metrics) {
        (Some(largest), Some(m)) if largest > LARGE_ARCMIN => format!(
            "{largest:.1}′ ({name}: {:.1}′ on the way out, {:.1}′ at +1 rad, {:.1}′ on the way back)",
            m.largest_out_arcsec / 60.0,
            m.error_at_turn_arcsec.abs() / 60.0,
            m.largest_back_arcsec / 60.0
        ),
        (Some(largest), _) => format!("{largest:.1}′ ({name})"),
        (None, _) => format!("no equilibrium ({name})"),
    }
}

/// Whether all errors lie where the paper's do, arc-minutes.
fn reaches(mut largest_arcmin: impl Iterator<Item = f64>) -> bool {
    let [low, high] = [paper::ERROR_CAM_RAD, paper::ERROR_FOUR_ROLLER_RAD].map(|rad| rad * ARCMIN_PER_RAD);
    largest_arcmin.all(|largest| (low..=high).contains(&largest))
}

/// The change whose errors come nearest to the paper's.
pub fn nearest(experiments: &[Experiment]) -> Option<&Experiment> {
    experiments
        .iter()
        .filter(|e| e.distance.is_some())
        .min_by(|a, b| a.distance.partial_cmp(&b.distance).expect("numbers"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn metrics(largest_arcsec: f64) -> ProtocolMetrics {
        ProtocolMetrics {
            largest_out_arcsec: largest_arcsec,
            largest_back_arcsec: 0.5 * largest_arcsec,
            lag_forward_arcsec: Some(-30.0),
            lag_backward_arcsec: Some(30.0),
            ripple_pp_arcsec: Some(0.4),
            half_width_arcsec: Some(30.0),
            dwell_rad: Some(0.03),
            dwell_arcsec: Some(60.0),
            error_at_turn_arcsec: -30.0,
            error_at_end_arcsec: 30.0,
            lost_motion_arcsec: Some(60.0),
            drift_arcsec: Some(0.0),
            peak_mpa: 100.0,
        }
    }

    fn of(kind: GeneratorKind, largest_arcsec: f64) -> ExperimentEffect {
        let metrics = metrics(largest_arcsec);
        ExperimentEffect {
            generator: kind.name(),
            status: "converged".into(),
            largest_arcmin: Some(largest(&metrics)),
            metrics: Some(metrics),
            paper_arcmin: paper::error_rad(kind).map(|rad| rad * ARCMIN_PER_RAD),
            curves: [vec![[0.0, 0.0], [1.0, -30.0]], vec![[-1.0, 30.0], [1.0, -30.0]]],
        }
    }

    #[test]
    fn what_reaches_the_papers_size_is_told_from_what_does_not() {
        let both = |cam: f64, four: f64| vec![of(GeneratorKind::FourRoller, four), of(GeneratorKind::Cam, cam)];
        let small = experiment(Change::Facets, both(40.0, 40.0));
        let large = experiment(Change::OnePoint, both(900.0, 1100.0));
        assert!(!small.reaches && small.takeaway.starts_with("Such numbers do not come"), "{}", small.takeaway);
        assert!(small.takeaway.contains("0.7′ (four-roller)"), "{}", small.takeaway);
        assert!(large.reaches && large.takeaway.starts_with("Such numbers come from a rim"), "{}", large.takeaway);
        let one = experiment(Change::Drag, both(80.0, 630.0));
        assert!(!one.reaches && one.takeaway.starts_with("For some"), "{}", one.takeaway);
        let more = experiment(Change::OnePointAside, both(1700.0, 1800.0));
        assert!(!more.reaches && more.takeaway.starts_with("Such numbers, and larger"), "{}", more.takeaway);
        assert!(more.takeaway.contains("(cam: 28.3′ on the way out, 0.5′ at +1 rad, 14.2′ on the way back)"));
        assert!(large.distance < small.distance);
        let experiments = [small, large];
        assert_eq!(nearest(&experiments).unwrap().id, "one-point");
        let mut failed = of(GeneratorKind::Cam, 900.0);
        failed.largest_arcmin = None;
        let failed = experiment(Change::Drag, vec![of(GeneratorKind::FourRoller, 900.0), failed]);
        assert!(!failed.reaches && failed.distance.is_none() && !failed.is_unchanged);
        assert!(experiment(Change::None, both(40.0, 40.0)).is_unchanged);
    }

    #[test]
    fn counted_from_the_other_flank_the_lag_is_the_whole_clearance() {
        let moved = counted_from_the_other_flank(&of(GeneratorKind::Cam, 30.0));
        let metrics = moved.metrics.unwrap();
        assert_eq!((metrics.lag_forward_arcsec, metrics.lag_backward_arcsec), (Some(-60.0), Some(0.0)));
        assert_eq!((metrics.largest_out_arcsec, metrics.largest_back_arcsec), (60.0, 60.0));
        assert_eq!((moved.largest_arcmin, moved.curves[0][0][1]), (Some(1.0), 0.0));
        assert_eq!(metrics.half_width_arcsec, Some(30.0));
    }

    #[test]
    fn the_papers_size_is_ten_to_twenty_one_arc_minutes() {
        assert!(
            reaches([10.4, 21.3].into_iter()) && !reaches([10.0, 20.0].into_iter()) && !reaches([22.0].into_iter())
        );
    }
}
