//! Candidate causes: each a law of physics with named parameters, re-simulated on the data's own excitation.
//!
//! A [`Law`] turns shape parameters (what enters non-linearly: a slip torque, a time constant, a place) into columns
//! whose coefficients enter linearly. Laws in the field differ from those here in detail, so each carries *nuisance*
//! columns: the directions in which its law is likely to be wrong, with coefficients of the order of a share of the
//! main ones. A deviation of that kind then breeds no second cause. What each follows and why:
//! docs/explanation/theory.md, "Signatures of causes".

mod among;
mod displaced;
pub(crate) mod dynamic;
mod generic;
pub(crate) mod geometry;
mod kernel;
mod label;
pub(crate) mod lobes;
mod named;
pub(crate) mod sensor;
mod simulated;
pub(crate) mod stiffness;
pub(crate) mod thermal;

use std::borrow::Cow;
use std::f64::consts::PI;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use serde::{Deserialize, Serialize};

use super::base::Base;
use super::prepare::{Jump, whole_pitches};
use super::rows::Rows;
use super::thresholds::selection::AFTER_WHEELS;
use crate::causes::{CauseName, Kin, Need, ParameterName};
use crate::linear::Prior;
use crate::measurement::turns;
use crate::nominal::Nominal;
use flexspline_base::robust::least_and_most;
use flexspline_design::kernels::Kernels;

pub(crate) use among::{Acting, Among, Zones, added, left_by, together};
pub(crate) use generic::{index_step, line, maps, unnamed};
pub(crate) use geometry::standing_pitch_error;
pub(crate) use label::{Label, Per};
pub use named::{Coefficients, Shaped, Tag};
pub(crate) use simulated::{Simulated, Values};

/// The rows that laws are evaluated on, and what is known of them.
#[derive(Clone, Copy)]
pub struct Excitation<'a> {
    /// The rows.
    pub rows: &'a Rows,
    /// Nominal model.
    pub nominal: &'a Nominal,
    /// Nominal prediction and its parts.
    pub base: &'a Base,
    /// Units of the coefficients.
    pub scales: &'a LawUnits,
    /// Change of half the clearance by other causes, row by row, arcsec.
    pub widened: Option<&'a [f64]>,
    /// How far other causes bring one zone of teeth ahead of the other.
    pub zones: Option<&'a Zones>,
}

/// Generator turns below which a pulse in one place is not distinguishable from a wave; as in the picture of a
/// residual.
const FEWEST_TURNS_OF_PULSES: f64 = 6.0;
/// At temperatures closer to each other than this, and this close to the nominal one, K, nothing thermal can be seen
/// from a changed constant.
const LEAST_SPAN_K: f64 = 2.0;
const LEAST_OFF_NOMINAL_K: f64 = 5.0;

/// Least use in which a drive may have worn: generator turns, and seconds from the first row to the last where time is
/// known. Steel teeth under oil wear by micrometres in hours: this is where even a dry or a plastic one has hardly
/// begun.
const USED_TURNS: f64 = 20.0;
const USED_S: f64 = 60.0;

/// A load has turned back by this share of the largest. *Guess*: contacts that slip earlier open no loop worth a name.
const TURNS_BACK: f64 = 0.1;

/// A load that nobody recorded on an unloaded drive may be this many times its friction, or wind it up by so much,
/// arcsec.
const UNLOADED_FRICTIONS: f64 = 4.0;
const UNLOADED_ARCSEC: f64 = 20.0;

impl<'a> Excitation<'a> {
    /// The recorded one.
    pub fn new(rows: &'a Rows, nominal: &'a Nominal, base: &'a Base, scales: &'a LawUnits) -> Excitation<'a> {
        Excitation { rows, nominal, base, scales, widened: None, zones: None }
    }

    /// Other rows, with the nominal model over them, and nothing that other causes change.
    pub(crate) fn over(&self, rows: &'a Rows, base: &'a Base) -> Excitation<'a> {
        Excitation { rows, base, ..*self }
    }

    /// The error less what is predicted and what is `explained` already (nothing if it is empty), row by row, arcsec.
    pub(crate) fn left(&self, explained: &[f64]) -> Vec<f64> {
        let explained = explained.iter().chain(std::iter::repeat(&0.0));
        let predicted = self.base.prediction.iter().zip(explained);
        self.rows.error.iter().zip(predicted).map(|(error, (nominal, more))| error - nominal - more).collect()
    }

    /// Whether the output is not loaded beyond friction, which then says nothing of the flank that carries.
    pub(crate) fn unloaded(&self) -> bool {
        self.scales.load < self.nominal.friction_torque_n_m
    }

    /// The first need of a cause that these data do not meet.
    pub(crate) fn lacks(&self, cause: CauseName) -> Option<Need> {
        cause.spec().needs.iter().copied().find(|need| !self.meets(*need))
    }

    fn meets(&self, need: Need) -> bool {
        let rows = self.rows;
        match need {
            Need::Teeth => self.nominal.teeth.is_some(),
            Need::Turns => rows.travel.last().is_some_and(|travel| *travel >= FEWEST_TURNS_OF_PULSES * 2.0 * PI),
            Need::Load => self.scales.load > 0.0,
            Need::LoadTurns => rows.sessions.iter().any(|session| {
                let turns = turns(&rows.torque[session.clone()], TURNS_BACK * self.scales.load);
                turns.windows(2).any(|pair| pair[0].0 * pair[1].0 < 0.0)
            }),
            Need::Spring => self.nominal.wind_up_arcsec(1.0) > LEAST_WIND_UP_ARCSEC,
            Need::Temperature => rows.recorded.temperature,
            Need::TemperatureSpan => {
                let (low, high) = least_and_most(rows.temperature.iter().copied());
                high - low > LEAST_SPAN_K || (low - self.nominal.temperature_c).abs() > LEAST_OFF_NOMINAL_K
            }
            Need::Time => rows.recorded.time,
            Need::Motion => rows.speed.iter().any(|w| *w != 0.0),
            Need::Swings => dynamic::makes_a_load_swing(self),
            Need::Use => {
                let turned = rows.travel.last().is_some_and(|travel| *travel >= USED_TURNS * 2.0 * PI);
                let lasts = rows.recorded.time && self.scales.duration_s >= USED_S;
                if rows.recorded.time { turned && lasts } else { turned }
            }
            Need::Jump => {
                let jumps = &self.scales.jumps;
                !jumps.is_empty() && jumps.iter().all(|jump| whole_pitches(self.nominal, jump.height_arcsec).is_some())
            }
        }
    }

    /// From the least output angle to the largest, rad.
    pub(crate) fn output_span_rad(&self) -> f64 {
        let (low, high) = least_and_most(self.rows.output.iter().copied());
        (high - low).max(0.0)
    }

    /// The influence kernels of the drive, if it has them.
    fn kernels(&self) -> Option<&'a Arc<Kernels>> {
        self.nominal.kernels.as_ref().filter(|_| self.nominal.teeth.is_some())
    }

    /// Nominal wind-up at rest, arcsec/N·m; none for a drive that does not give.
    fn slope_at_rest(&self) -> Option<f64> {
        let slope = self.nominal.wind_up_arcsec(1e-3) / 1e-3;
        (slope > 0.0).then_some(slope)
    }

    /// Scale of a load that the torque column does not hold, N·m. Without a load on the output that column is noise,
    /// and says nothing of what its friction and its spring bear.
    fn plausible_load(&self) -> f64 {
        let wound_up = self.slope_at_rest().map_or(0.0, |slope| UNLOADED_ARCSEC / slope);
        self.scales.load.max(UNLOADED_FRICTIONS * self.nominal.friction_torque_n_m).max(wound_up)
    }

    /// Wind-up (arcsec) by a load in addition to the recorded torque at row `k`, `torque` (N·m) being both.
    fn wound_up(&self, k: usize, torque: f64) -> f64 {
        self.nominal.wind_up_arcsec(torque) - self.base.wind_up[k]
    }
}

/// Units of the coefficients of laws: taken from the rows that a model is fitted to, kept where it predicts
/// others.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LawUnits {
    /// Scale of the load, N·m; 0 without torque.
    #[serde(rename = "load_n_m")]
    pub load: f64,
    /// Mean speed of the generator while it moves, rad/s.
    #[serde(rename = "mean_speed_rad_s")]
    pub mean_speed: f64,
    /// Time of the first row, s.
    pub begin_s: f64,
    /// From the first row to the last, s.
    pub duration_s: f64,
    /// Travel of the generator from the first row to the last, rad.
    #[serde(rename = "travel_rad")]
    pub travel: f64,
    /// Arcsec at the output for 1 µm on the pitch circle.
    pub arcsec_per_um: f64,
    /// Jumps found in the data.
    #[serde(skip)]
    pub jumps: Vec<Jump>,
}

impl LawUnits {
    /// Of these rows.
    pub fn new(rows: &Rows, pitch_radius_mm: f64, jumps: Vec<Jump>) -> LawUnits {
        let (mut moving, mut turned) = (0usize, 0.0);
        for speed in rows.speed.iter().filter(|speed| **speed != 0.0) {
            moving += 1;
            turned += speed.abs();
        }
        let begin_s = rows.time.first().copied().unwrap_or(0.0);
        LawUnits {
            load: rows.load_scale(),
            mean_speed: turned / moving.max(1) as f64,
            begin_s,
            duration_s: rows.time.last().copied().unwrap_or(0.0) - begin_s,
            travel: rows.travel.last().copied().unwrap_or(0.0),
            arcsec_per_um: flexspline_base::units::ARCSEC_PER_RAD * 1e-3 / pitch_radius_mm,
            jumps,
        }
    }
}

/// A shape parameter.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    /// Its name.
    pub name: ParameterName,
    /// Least plausible value.
    pub low: f64,
    /// Largest plausible value.
    pub high: f64,
    /// Values tried first, spread over the range: evenly, or by factors if `log`.
    pub tried: usize,
    /// By factors.
    pub log: bool,
    /// The range closes on itself: an angle.
    pub cyclic: bool,
}

impl Shape {
    fn by_factors(name: ParameterName, low: f64, high: f64, tried: usize) -> Shape {
        Shape { name, low, high, tried, log: true, cyclic: false }
    }
    fn evenly(name: ParameterName, low: f64, high: f64, tried: usize) -> Shape {
        Shape { name, low, high, tried, log: false, cyclic: false }
    }
    fn angle(name: ParameterName, period: f64, tried: usize) -> Shape {
        Shape { name, low: 0.0, high: period, tried, log: false, cyclic: true }
    }

    /// The value at a place between 0 and 1.
    pub fn value(&self, place: f64) -> f64 {
        let place = if self.cyclic { place.rem_euclid(1.0) } else { place.clamp(0.0, 1.0) };
        if self.log { self.low * (self.high / self.low).powf(place) } else { self.low + (self.high - self.low) * place }
    }

    /// The place of a value.
    pub fn place(&self, value: f64) -> f64 {
        if self.log {
            ((value.max(1e-300) / self.low).ln() / (self.high / self.low).ln()).clamp(0.0, 1.0)
        } else {
            let place = (value - self.low) / (self.high - self.low);
            if self.cyclic { place.rem_euclid(1.0) } else { place.clamp(0.0, 1.0) }
        }
    }

    /// Places tried first.
    fn places(&self) -> Vec<f64> {
        let count = self.tried.max(1) as f64;
        (0..self.tried.max(1)).map(|k| (k as f64 + if self.cyclic { 0.0 } else { 0.5 }) / count).collect()
    }
}

/// The prior of the coefficient of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Tolerance {
    /// A parameter of the law.
    Main(Prior),
    /// A deviation of the law: its size is of the order of this share of the main coefficients.
    Nuisance(f64),
    /// A deviation that comes with the cause by right, and may well be the larger part of it: clearance that a wheel
    /// off its place takes.
    Beside(f64),
}

/// A column of a law.
#[derive(Clone, Debug)]
pub(crate) struct Regressor {
    /// Its role, by which its coefficient is found.
    pub role: Tag,
    /// Arcsec per unit of the coefficient, row by row.
    pub values: Vec<f64>,
    /// The prior of the coefficient.
    pub tolerance: Tolerance,
}

impl Regressor {
    fn new(values: Vec<f64>, tolerance: Tolerance) -> Regressor {
        Regressor { role: Tag::PLAIN, values, tolerance }
    }

    /// The column with a role.
    fn called(self, role: Tag) -> Regressor {
        Regressor { role, ..self }
    }
}

/// A main column with a coefficient around zero.
fn main(values: Vec<f64>, std: f64) -> Regressor {
    main_about(0.0, values, std)
}

/// A main column with a coefficient around `mean`.
fn main_about(mean: f64, values: Vec<f64>, std: f64) -> Regressor {
    Regressor::new(values, Tolerance::Main(Prior { mean, std }))
}

/// A nuisance column.
fn nuisance(values: Vec<f64>, share: f64) -> Regressor {
    Regressor::new(values, Tolerance::Nuisance(share))
}

/// A column of what comes with a cause.
fn beside(values: Vec<f64>, share: f64) -> Regressor {
    Regressor::new(values, Tolerance::Beside(share))
}

/// A parameter for the report: name and value.
pub(crate) type Named = (ParameterName, f64);

type MakeColumns = Arc<dyn Fn(&Excitation<'_>, Shaped<'_>) -> Vec<Regressor> + Send + Sync>;
type MakeParameters = Arc<dyn Fn(&Excitation<'_>, Shaped<'_>, Coefficients<'_>) -> Vec<Named> + Send + Sync>;
type IsPhysical = Arc<dyn Fn(Shaped<'_>, Coefficients<'_>) -> bool + Send + Sync>;
type AddedLoad = Arc<dyn Fn(&Excitation<'_>, Shaped<'_>) -> Vec<f64> + Send + Sync>;
type Apart = Arc<dyn Fn(&Excitation<'_>, Shaped<'_>, Coefficients<'_>) -> Zones + Send + Sync>;
type Beginnings = Arc<dyn Fn(Shaped<'_>, Coefficients<'_>) -> Vec<Vec<f64>> + Send + Sync>;

/// A linear law close to a law that is none: its coefficients say where to begin with the shape parameters.
#[derive(Clone)]
pub(crate) struct Lead {
    columns: MakeColumns,
    beginnings: Beginnings,
}

/// Laws made so far: each has a number of its own.
static LAWS: AtomicU64 = AtomicU64::new(0);

/// One law of one cause: what it is about, how it is evaluated, how it may be wrong, how it is looked for, and how it
/// acts on others.
#[derive(Clone)]
pub(crate) struct Law {
    /// A number that no other law has.
    pub id: u64,
    /// Its subject.
    pub label: Label,
    /// Which of several models of one cause it is: a word that stays the same from one recording to the next.
    pub variant: Cow<'static, str>,
    /// Shape parameters.
    pub shapes: Vec<Shape>,
    /// Columns at given shape parameters.
    columns: MakeColumns,
    /// Parameters for the report from shape parameters and coefficients.
    parameters: MakeParameters,
    /// Whether shape parameters and coefficients make sense, signs above all.
    physical: IsPhysical,
    /// How it may be wrong.
    pub wrong: Wrong,
    /// How it is looked for.
    pub search: Search,
    /// How it acts on other causes, and they on it.
    pub acts: Acts,
}

/// How a law may be wrong.
#[derive(Clone, Copy, Debug)]
pub struct Wrong {
    /// Share of its size by which it may be wrong: a finding smaller than that next to it may be its own misfit.
    pub misfit: f64,
    /// The same where it may look like a deviation without a name.
    pub misfit_unnamed: f64,
    /// The laws that the misfit resembles.
    pub kin: Kin,
    /// Largest size of all nuisance over that of the main columns.
    pub most_nuisance: f64,
    /// Relative uncertainty of its parameters in addition to that of the data: that of the law itself.
    pub doubt: f64,
    /// It says something about sessions that it was not fitted to.
    pub foretells: bool,
}

/// How a law is looked for.
#[derive(Clone, Default)]
pub(crate) struct Search {
    /// Where to begin.
    pub lead: Option<Lead>,
    /// With its nuisance columns, as its main ones mean nothing without them.
    pub whole: bool,
    /// Natural logarithm of the odds against it before any data, among the other laws.
    pub odds_against: f64,
    /// All its columns are taken out before the noise is measured, those of its deviations too: a free profile has its
    /// finest detail in them, a long delay what comes with it.
    pub whole_beside_noise: bool,
}

/// How a law acts on other causes, and they on it.
#[derive(Clone, Default)]
pub(crate) struct Acts {
    /// Load (N·m, row by row) that the cause adds to the torque that was recorded.
    load: Option<AddedLoad>,
    /// How far it brings one zone of teeth ahead of the other.
    pub zones: Option<Apart>,
    /// The effect of other causes on the zones of teeth and on the clearance enters the law.
    pub meets_zones: bool,
    /// Much of it shows while the play is crossed, in rows that do not count for the sizes of others.
    pub in_crossings: bool,
    /// If set, the law is a base parameter out of tolerance: its name in [`Base::floating`].
    pub tolerance_of: Option<&'static str>,
}

/// A drive winds up by more than this under 1 N·m, arcsec. *Guess*: the stiffest of catalogues a hundred times as far.
const LEAST_WIND_UP_ARCSEC: f64 = 1e-4;
/// Size of all deviations over that of the law, at most: beyond, the law is there for its deviations.
const MOST_NUISANCE: f64 = 0.9;
/// Size of all deviations over that of the law, at most, for laws that are well known, and whose deviations are those
/// of another cause.
const MOST_NUISANCE_OF_KNOWN: f64 = 0.6;

/// Share by which the law of a contact, a friction or a lubricant may be wrong.
const USUAL_MISFIT: f64 = 0.10;
/// Share by which a law of pure geometry and counting may be wrong: sensors, ratio, skipped teeth.
const EXACT_MISFIT: f64 = 0.02;
/// Share by which a law of shape may be wrong: signatures depend on generator and load.
const SHAPE_MISFIT: f64 = 0.2;
/// Relative uncertainty of parameters of such laws, and of exact ones.
const USUAL_DOUBT: f64 = 0.03;
const EXACT_DOUBT: f64 = 0.005;

impl Law {
    fn new(
        label: impl Into<Label>,
        columns: impl Fn(&Excitation<'_>, Shaped<'_>) -> Vec<Regressor> + Send + Sync + 'static,
    ) -> Law {
        let label = label.into();
        Law {
            id: LAWS.fetch_add(1, Ordering::Relaxed),
            label,
            variant: Cow::Borrowed(""),
            shapes: Vec::new(),
            columns: Arc::new(columns),
            parameters: Arc::new(|_, _, _| Vec::new()),
            physical: Arc::new(|_, _| true),
            wrong: Wrong {
                misfit: USUAL_MISFIT,
                misfit_unnamed: 0.0,
                kin: label.kin(),
                most_nuisance: MOST_NUISANCE,
                doubt: USUAL_DOUBT,
                foretells: true,
            },
            search: Search::default(),
            acts: Acts::default(),
        }
    }
    /// The cause it is about; none for a deviation without one.
    pub(crate) const fn cause(&self) -> Option<CauseName> {
        self.label.cause()
    }
    /// Whether it is about a cause of the library.
    pub const fn named(&self) -> bool {
        self.cause().is_some()
    }
    /// Whether it is the bench's zero in each session: what nobody can foretell of a session, and what says nothing of
    /// the drive.
    pub(crate) const fn is_zero_of_sessions(&self) -> bool {
        !self.wrong.foretells && !matches!(self.label, Label::Fault { .. })
    }
    /// Whether it is told of the data, and says nothing of the drive.
    pub(crate) const fn is_of_the_data(&self) -> bool {
        matches!(self.label, Label::Fault { .. }) || self.is_zero_of_sessions()
    }
    /// Whether it is about this cause.
    pub fn is(&self, cause: CauseName) -> bool {
        self.cause() == Some(cause)
    }
    fn variant(mut self, variant: impl Into<Cow<'static, str>>) -> Law {
        self.variant = variant.into();
        self
    }
    fn of_shape(mut self) -> Law {
        self.wrong.misfit = SHAPE_MISFIT;
        self
    }
    fn exact(mut self) -> Law {
        self.wrong.misfit = EXACT_MISFIT;
        self.wrong.doubt = EXACT_DOUBT;
        self
    }
    fn well_known(mut self) -> Law {
        self.wrong.most_nuisance = MOST_NUISANCE_OF_KNOWN;
        self
    }
    /// An encoder that reads what a wheel may do as well: odds are on the wheel, and its misfit may look like this law.
    fn after_wheels(mut self) -> Law {
        self.search.odds_against = AFTER_WHEELS;
        self.kin_of_shapes()
    }
    /// A law that the misfit of wheels may look like: of an eccentric spline whose flanks bind, a second order of the
    /// output of a sixth of its size.
    fn kin_of_shapes(mut self) -> Law {
        self.wrong.kin = Kin::Shape;
        self
    }
    fn shapes(mut self, shapes: impl IntoIterator<Item = Shape>) -> Law {
        self.shapes = shapes.into_iter().collect();
        self
    }
    fn parameters_by(
        mut self,
        parameters: impl Fn(&Excitation<'_>, Shaped<'_>, Coefficients<'_>) -> Vec<Named> + Send + Sync + 'static,
    ) -> Law {
        self.parameters = Arc::new(parameters);
        self
    }
    fn physical_if(mut self, physical: impl Fn(Shaped<'_>, Coefficients<'_>) -> bool + Send + Sync + 'static) -> Law {
        self.physical = Arc::new(physical);
        self
    }
    fn adds_load(mut self, load: impl Fn(&Excitation<'_>, Shaped<'_>) -> Vec<f64> + Send + Sync + 'static) -> Law {
        self.acts.load = Some(Arc::new(load));
        // It moves the torque at which the play is crossed.
        self.acts.in_crossings = true;
        self
    }
    fn parts_zones(
        mut self,
        apart: impl Fn(&Excitation<'_>, Shaped<'_>, Coefficients<'_>) -> Zones + Send + Sync + 'static,
    ) -> Law {
        self.acts.zones = Some(Arc::new(apart));
        self
    }
    fn led_by(
        mut self,
        columns: impl Fn(&Excitation<'_>, Shaped<'_>) -> Vec<Regressor> + Send + Sync + 'static,
        beginnings: impl Fn(Shaped<'_>, Coefficients<'_>) -> Vec<Vec<f64>> + Send + Sync + 'static,
    ) -> Law {
        self.search.lead = Some(Lead { columns: Arc::new(columns), beginnings: Arc::new(beginnings) });
        self
    }

    fn shaped<'s>(&'s self, values: &'s [f64]) -> Shaped<'s> {
        Shaped::new(&self.shapes, values)
    }

    /// Columns at values of the shape parameters.
    pub(crate) fn columns(&self, on: &Excitation<'_>, values: &[f64]) -> Vec<Regressor> {
        (self.columns)(on, self.shaped(values))
    }

    /// Columns of the lead at values of the shape parameters; those of the law where it has no lead.
    pub(crate) fn lead_columns(&self, on: &Excitation<'_>, values: &[f64]) -> Vec<Regressor> {
        match &self.search.lead {
            Some(lead) => (lead.columns)(on, self.shaped(values)),
            None => self.columns(on, values),
        }
    }

    /// Values of the shape parameters to begin with, from those tried and the coefficients of the columns of the lead;
    /// nothing without a lead.
    pub(crate) fn beginnings(&self, values: &[f64], coefficients: Coefficients<'_>) -> Vec<Vec<f64>> {
        let lead = self.search.lead.as_ref();
        lead.map_or_else(Vec::new, |lead| (lead.beginnings)(self.shaped(values), coefficients))
    }

    /// Parameters for the report.
    pub(crate) fn parameters(&self, on: &Excitation<'_>, values: &[f64], coefficients: Coefficients<'_>) -> Vec<Named> {
        (self.parameters)(on, self.shaped(values), coefficients)
    }

    /// Whether shape parameters and coefficients make sense, signs above all.
    pub(crate) fn physical(&self, values: &[f64], coefficients: Coefficients<'_>) -> bool {
        (self.physical)(self.shaped(values), coefficients)
    }

    /// Load (N·m, row by row) that the cause adds to the torque that was recorded, if it adds any.
    pub fn load(&self, on: &Excitation<'_>, values: &[f64]) -> Option<Vec<f64>> {
        self.acts.load.as_ref().map(|load| load(on, self.shaped(values)))
    }

    /// Whether it adds a load.
    pub(crate) fn is_load(&self) -> bool {
        self.acts.load.is_some()
    }

    /// How far it brings one zone of teeth ahead of the other, if it does.
    pub(crate) fn zones(&self, on: &Excitation<'_>, values: &[f64], coefficients: Coefficients<'_>) -> Option<Zones> {
        self.acts.zones.as_ref().map(|apart| apart(on, self.shaped(values), coefficients))
    }

    /// Which of the shape parameters has this name.
    pub(crate) fn shape_at(&self, name: ParameterName) -> Option<usize> {
        self.shapes.iter().position(|shape| shape.name == name)
    }

    /// Which of the shape parameters are the direction and the size of a displacement, if it is one.
    pub(crate) fn displacement_at(&self) -> Option<[usize; 2]> {
        Some([self.shape_at(ParameterName::PhaseRad)?, self.shape_at(ParameterName::SizeArcsec)?])
    }

    /// Places of the shape parameters as another law has those of the same name; in the middle where it has none.
    pub(crate) fn places_like(&self, other: &Law, places: &[f64]) -> Vec<f64> {
        let of = |shape: &Shape| other.shape_at(shape.name).and_then(|at| places.get(at)).copied().unwrap_or(0.5);
        self.shapes.iter().map(of).collect()
    }

    /// How much of its size another law may be named for wrongly.
    pub(crate) fn misfit_as(&self, other: &Law) -> f64 {
        if !other.named() {
            return self.wrong.misfit.max(self.wrong.misfit_unnamed);
        }
        self.wrong.misfit * self.wrong.kin.share(other.wrong.kin)
    }

    /// Values of the shape parameters at places between 0 and 1.
    pub fn values(&self, places: &[f64]) -> Vec<f64> {
        self.shapes.iter().zip(places).map(|(shape, place)| shape.value(*place)).collect()
    }

    /// Places of values of the shape parameters.
    pub fn places(&self, values: &[f64]) -> Vec<f64> {
        self.shapes.iter().zip(values).map(|(shape, value)| shape.place(*value)).collect()
    }

    /// All combinations of places tried first.
    pub(crate) fn tried(&self) -> Vec<Vec<f64>> {
        let mut tried = vec![Vec::new()];
        for shape in &self.shapes {
            tried = tried
                .iter()
                .flat_map(|so_far: &Vec<f64>| {
                    shape.places().into_iter().map(|place| so_far.iter().copied().chain([place]).collect())
                })
                .collect();
        }
        tried
    }
}

/// Every law of every cause that the data can speak about.
pub fn library(on: &Excitation<'_>) -> Vec<Law> {
    CauseName::ALL
        .iter()
        .filter(|cause| on.lacks(**cause).is_none())
        .flat_map(|cause| (cause.spec().laws)(on))
        .collect()
}

/// A column made row by row.
fn by_row(on: &Excitation<'_>, value: impl Fn(usize) -> f64) -> Vec<f64> {
    (0..on.rows.len()).map(value).collect()
}

/// A column made of two others, row by row.
fn of_both(a: &[f64], b: &[f64], value: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| value(*a, *b)).collect()
}

/// Products of two columns, row by row.
fn times(a: &[f64], b: &[f64]) -> Vec<f64> {
    of_both(a, b, |a, b| a * b)
}

/// Amplitude and phase of `c cos(x) + s sin(x) = amplitude cos(x − phase)`.
fn polar(c: f64, s: f64) -> (f64, f64) {
    (c.hypot(s), s.atan2(c))
}

/// The parameters of what has a size, in micrometres and at the output, and a direction.
fn directed(um: f64, arcsec: f64, phase_rad: f64) -> Vec<Named> {
    use ParameterName as Name;
    vec![(Name::AmplitudeUm, um), (Name::AmplitudeArcsec, arcsec), (Name::PhaseRad, phase_rad)]
}

/// Amplitude and phase of a wave by its coefficients.
fn of_wave(c: Coefficients<'_>, role: Tag) -> (f64, f64) {
    let [cos, sin] = c.wave(role);
    polar(cos, sin)
}
