//! Values of a data sheet, read from `[data_sheet]` of a drive's file, next to the contact FEM's values.
//!
//! ```toml
//! [data_sheet]
//! source = "Harmonic Drive CSF-20-100"
//! rated_torque_n_m = 40.0
//! t1_n_m = 7.0
//! t2_n_m = 25.0
//! k1_n_m_per_rad = 16e3
//! accuracy_arcmin = 1.0
//! unit_scatter_percent = 30.0
//! ```
//!
//! Every key may be left out. The computed figures are those of [`crate::data_sheet`] at the loads of the sheet. Three
//! are computed for the sake of a stated one alone: the width of the hysteresis loop, whether the drive holds the
//! ratcheting torque, and the torque that starts the generator.

use serde::{Deserialize, Serialize};

use crate::catalogue::UNIT_SCATTER_PERCENT;
use crate::cautions::Caution;
use crate::data_sheet::{DataSheet, Loads, data_sheet};
use flexspline_base::toml_file::{Allowed, TomlFile, above, from, real, text, yes_or_no};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::{Drive, DriveError, GeneratorKind};
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Problem, SolveError, SolverSettings};

const TORQUE: Allowed = above(0.0, 1e6);
const STIFFNESS: Allowed = above(0.0, 1e9);
const ARCMIN: Allowed = from(0.0, 600.0);
const PERCENT: Allowed = above(0.0, 99.0);
const ARCMIN_PER_RAD: f64 = ARCSEC_PER_RAD / 60.0;
/// Positions over the tooth pitch, as in `sweep --vary`.
const POSITIONS: usize = 6;
/// Steps of the load on the way to the ratcheting torque, and of the unloading of a drive with friction. A guess.
const STEPS: u32 = 4;
/// Halvings of such a step on the way to the ratcheting torque, by which the search ends. A guess: the torque is then
/// known to an eighth of a step.
const HALVINGS: usize = 3;
/// Steps over a tooth pitch in which the generator is turned to find the torque that starts it.
const STARTING_STEPS: usize = 6;

/// The numbers of `[data_sheet]`, in their order: between its source and whether it completes the model.
const NUMBERS: [(&str, Allowed); 12] = [
    ("rated_torque_n_m", TORQUE),
    ("t1_n_m", TORQUE),
    ("t2_n_m", TORQUE),
    ("k1_n_m_per_rad", STIFFNESS),
    ("k2_n_m_per_rad", STIFFNESS),
    ("k3_n_m_per_rad", STIFFNESS),
    ("hysteresis_loss_arcmin", ARCMIN),
    ("lost_motion_arcmin", ARCMIN),
    ("ratcheting_torque_n_m", TORQUE),
    ("starting_torque_n_m", TORQUE),
    ("accuracy_arcmin", ARCMIN),
    ("unit_scatter_percent", PERCENT),
];

/// Every key of `[data_sheet]`.
fn keys() -> impl Iterator<Item = &'static str> {
    ["source"].into_iter().chain(NUMBERS.map(|(key, _)| key)).chain(["completes_model"])
}

/// The section as a comment, for files to be filled in.
pub const TEMPLATE: &str = "
# [data_sheet]  # what a catalogue prints of this drive; simulate and tables show what is computed beside it; any line \
                            may be left out
# source = \"catalogue, type\"
# rated_torque_n_m = 0.0
# t1_n_m = 0.0                 # K1 from first contact to T1
# t2_n_m = 0.0                 # K2 from T1 to T2, K3 from there to the rated torque
# k1_n_m_per_rad = 0.0
# k2_n_m_per_rad = 0.0
# k3_n_m_per_rad = 0.0
# hysteresis_loss_arcmin = 0.0
# lost_motion_arcmin = 0.0
# ratcheting_torque_n_m = 0.0
# starting_torque_n_m = 0.0
# accuracy_arcmin = 0.0
# unit_scatter_percent = 30.0  # how far units scatter about K1, K2, K3, if the catalogue says so
# completes_model = true       # tables takes the compliance and loss that the FEM lacks from here
";

/// Values of a data sheet.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Stated {
    /// Which sheet.
    pub source: Option<String>,
    /// Rated torque, N·m.
    pub rated_torque_n_m: Option<f64>,
    /// End of the first range of stiffness, N·m.
    pub t1_n_m: Option<f64>,
    /// End of the second, N·m.
    pub t2_n_m: Option<f64>,
    /// Stiffness up to T1, N·m/rad.
    pub k1_n_m_per_rad: Option<f64>,
    /// Stiffness from T1 to T2, N·m/rad.
    pub k2_n_m_per_rad: Option<f64>,
    /// Stiffness above T2, N·m/rad.
    pub k3_n_m_per_rad: Option<f64>,
    /// Width of the loop of the output at no load, after the rated torque either way, arcmin.
    pub hysteresis_loss_arcmin: Option<f64>,
    /// Turn of the output between 4 % of the rated torque either way, arcmin.
    pub lost_motion_arcmin: Option<f64>,
    /// Torque at which teeth jump, N·m.
    pub ratcheting_torque_n_m: Option<f64>,
    /// Torque on the generator that starts the drive without load, N·m.
    pub starting_torque_n_m: Option<f64>,
    /// Transmission accuracy, peak to peak, arcmin.
    pub accuracy_arcmin: Option<f64>,
    /// How far units scatter about the stiffness and the torques of the sheet, ± percent.
    pub unit_scatter_percent: Option<f64>,
    /// Whether tables take from here what the FEM lacks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub completes_model: Option<bool>,
}

impl Stated {
    /// `[data_sheet]` of a drive file; none where the file has none.
    ///
    /// # Errors
    /// Every key that is unknown or out of its range, with its line.
    pub fn of_file(name: &str, file_text: &str) -> Result<Option<Stated>, DriveError> {
        let mut file = TomlFile::new(name, file_text);
        let Some(table) = file.parse().filter(|table| table.contains_key("data_sheet")) else { return Ok(None) };
        let stated = Stated::read(&mut file, &table);
        match stated.filter(|_| file.is_sound()) {
            Some(stated) => Ok(Some(stated)),
            None => Err(DriveError { problems: file.problems() }),
        }
    }

    /// The section as a drive file has it; what is not stated is a comment, to be filled in.
    pub fn to_toml(&self) -> String {
        let stated = serde_json::json!(self);
        let line = |key: &str| match &stated[key] {
            serde_json::Value::Null => format!("# {key} = \n"),
            // Numbers and texts are written as in TOML.
            value => format!("{key} = {value}\n"),
        };
        let head = "\n[data_sheet]  # what a catalogue prints; simulate and tables show what is computed beside it; \
                    any line may be left out\n";
        head.to_owned() + &keys().map(line).collect::<String>()
    }

    fn read(file: &mut TomlFile<'_>, table: &toml::de::DeTable<'_>) -> Option<Stated> {
        let section = file.section(table, "data_sheet")?;
        let known: Vec<String> = keys().map(|key| section.path(key)).collect();
        let others: Vec<&str> =
            table.keys().map(|key| key.get_ref().as_ref()).filter(|key| *key != "data_sheet").collect();
        file.refuse_unknown_keys(table, &known.iter().map(String::as_str).collect::<Vec<_>>(), &others);
        let mut numbers = serde_json::Map::new();
        for (key, allowed) in NUMBERS {
            numbers
                .extend(section.given(file, key, |value| real(&allowed, value)).map(|of| (key.to_owned(), of.into())));
        }
        let mut stated: Stated = serde_json::from_value(numbers.into()).ok()?;
        stated.source = section.given(file, "source", text);
        stated.completes_model = section.given(file, "completes_model", yes_or_no);
        // No drive winds up by a radian: what does is in another unit.
        let k = [stated.k1_n_m_per_rad, stated.k2_n_m_per_rad, stated.k3_n_m_per_rad];
        let k = k.into_iter().flatten().fold(f64::INFINITY, f64::min);
        if let Some(load) = stated.t1_n_m.or(stated.t2_n_m).or(stated.rated_torque_n_m).filter(|load| k < *load) {
            let what = format!(
                "found K of {k} N·m/rad, by which {load} N·m turn the output by more than a radian; catalogues print \
                 10⁴ N·m/rad: is it {}?",
                short(1e4 * k)
            );
            file.refuse_whole("data_sheet", what);
        }
        // The rated torque may be below T2, even T1: catalogues have it so at i = 50 (CSG-32-50, HFUC-90-50).
        let rated_n_m = stated.rated_torque_n_m.filter(|_| stated.t2_n_m.is_none());
        for (name, above) in [("t2", stated.t2_n_m), ("rated_torque", rated_n_m)] {
            if let (Some(t1), Some(above)) = (stated.t1_n_m, above)
                && t1 >= above
            {
                let what = format!("found t1 {t1:?} and {name} {above:?}, allowed: t1 below {name}");
                file.refuse_whole("data_sheet", what);
            }
        }
        Some(stated)
    }

    /// That a load is far beyond the rated one, or above the ratcheting torque of the sheet.
    pub fn load_caution(&self, drive: &Drive, kind: GeneratorKind, load_n_m: f64) -> Option<Caution> {
        Caution::of_load(load_n_m, Stated::rated_n_m(Some(self), drive, kind), self.ratcheting_torque_n_m)
    }

    /// How far units scatter, as the sheet has it or, where it is silent, the catalogue.
    pub(crate) fn scatter_percent(&self) -> f64 {
        self.unit_scatter_percent.unwrap_or(UNIT_SCATTER_PERCENT)
    }

    /// Takes what [`Caution::of_stiffness`] says away where a sheet has a stiffness, whose ratio says it better.
    pub fn retain(sheet: Option<&Stated>, cautions: &mut Vec<Caution>) {
        let stiffness = sheet.and_then(|of| of.k1_n_m_per_rad.or(of.k2_n_m_per_rad).or(of.k3_n_m_per_rad));
        cautions.retain(|caution| stiffness.is_none() || caution.figure != "stiffness");
    }

    /// The loads of the sheet; what it does not say is in the usual proportion to what it says, or to `rated_n_m`.
    pub(crate) fn loads(&self, rated_n_m: f64) -> Loads {
        let usual = Loads::up_to(1.0);
        let by_t2 = self.t2_n_m.map(|t2| t2 / usual.t2_n_m);
        let by_t1 = self.t1_n_m.map(|t1| t1 / usual.t1_n_m);
        let rated = self.rated_torque_n_m.filter(|_| !self.is_rated_within_t2());
        // As it is printed, so that who types it has the same load.
        let printed = |load: f64| short(load).parse().unwrap_or(load);
        let largest_n_m = rated.or(by_t2.or(by_t1).map(printed)).unwrap_or(rated_n_m);
        let t2_n_m = match (self.t2_n_m, self.t1_n_m) {
            (Some(t2), _) => t2,
            // What is stated stays: the other end is put where there is room.
            (None, Some(t1)) if t1 >= usual.t2_n_m * largest_n_m => 0.5 * (t1 + largest_n_m),
            (None, _) => usual.t2_n_m * largest_n_m,
        };
        let t1_n_m = self.t1_n_m.unwrap_or_else(|| {
            let t1 = usual.t1_n_m * largest_n_m;
            if t1 < t2_n_m { t1 } else { usual.t1_n_m / usual.t2_n_m * t2_n_m }
        });
        Loads { t1_n_m, t2_n_m, largest_n_m }
    }

    /// The load that counts as rated of a drive with a sheet: the largest of `loads`, which is a cam's; with
    /// another generator, or without a sheet, that of the drive's size.
    pub fn rated_n_m(stated: Option<&Stated>, drive: &Drive, kind: GeneratorKind) -> f64 {
        let by_size_n_m = drive.rated_torque_n_m(kind);
        let stated = stated.filter(|_| kind == GeneratorKind::Cam);
        stated.map_or(by_size_n_m, |stated| stated.loads(by_size_n_m).largest_n_m)
    }

    /// Whether the rated torque leaves no range above T2: K3 then takes a larger load.
    fn is_rated_within_t2(&self) -> bool {
        self.rated_torque_n_m.zip(self.t2_n_m).is_some_and(|(rated, t2)| rated <= t2)
    }

    /// The loads that it does not state, by their keys; the rated torque, too, if it is not above T2 and the largest
    /// load is another.
    pub fn assumed(&self) -> Vec<&'static str> {
        let rated = self.rated_torque_n_m.filter(|_| !self.is_rated_within_t2());
        let loads = [("t1_n_m", self.t1_n_m), ("t2_n_m", self.t2_n_m), ("rated_torque_n_m", rated)];
        loads.into_iter().filter(|(_, stated)| stated.is_none()).map(|(key, _)| key).collect()
    }
}

/// One figure, stated and computed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Beside {
    /// The key in `[data_sheet]`.
    pub figure: &'static str,
    /// As the sheet has it.
    pub stated: f64,
    /// As FEM has it; missing where the drive was not brought so far.
    pub computed: Option<f64>,
    /// Computed over stated; missing where either is missing or nothing is stated.
    pub ratio: Option<f64>,
    /// Whether the ratio is within the scatter of units; missing of a figure that has none.
    pub within_scatter: Option<bool>,
    /// Meaning of the computed figure, and what it leaves out.
    pub words: &'static str,
}

/// A data sheet beside what is computed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SheetBeside {
    /// The generator.
    pub generator: GeneratorKind,
    /// As the drive file has it.
    pub stated: Stated,
    /// The loads of the computed figures.
    pub loads: Loads,
    /// Those of the loads that the sheet does not state, by their keys: they are guesses.
    pub assumed: Vec<&'static str>,
    /// Everything that a catalogue prints, computed.
    pub sheet: DataSheet,
    /// Figure by figure, those that are stated.
    pub beside: Vec<Beside>,
    /// Why figures are missing.
    pub why: Option<String>,
}

/// Of a figure: its name for readers and its unit, the loads of the sheet that it is for, and what is computed.
fn described(figure: &'static str) -> (&'static str, &'static str, &'static [&'static str], &'static str) {
    match figure {
        "k1_n_m_per_rad" => ("K1", "N·m/rad", &["t1_n_m"], "secant from first contact to T1"),
        "k2_n_m_per_rad" => ("K2", "N·m/rad", &["t1_n_m", "t2_n_m"], "secant from T1 to T2"),
        "k3_n_m_per_rad" => ("K3", "N·m/rad", &["t2_n_m", RATED], "secant from T2 to the rated torque"),
        "hysteresis_loss_arcmin" => (
            "Hysteresis loss",
            "′",
            &[RATED],
            "clearance and friction of the flanks; friction elsewhere is no part of it",
        ),
        "lost_motion_arcmin" => {
            ("Lost motion", "′", &[RATED], "between 4 % of the rated torque either way, clearance included")
        }
        "ratcheting_torque_n_m" => (
            "Ratcheting torque",
            "N·m",
            &[],
            "largest torque with an equilibrium, by simulate --ratcheting: looked for up to the stated one",
        ),
        "starting_torque_n_m" => (
            "Starting torque",
            "N·m",
            &[],
            "drag of the output and friction of the flanks; bearings and seals of the generator are no part of it",
        ),
        "accuracy_arcmin" => (
            "Transmission accuracy",
            "′",
            &[RATED],
            "over a tooth pitch under the rated torque; what errors of single teeth and axes add over a turn is no \
             part of it",
        ),
        other => (other, "", &[], ""),
    }
}

/// The key of the load that most figures are for.
const RATED: &str = "rated_torque_n_m";

/// Computes what is stated, at a temperature; the ratcheting torque, which takes longest, if it is to be `looked_for`.
/// Stiffness has in series what a table was completed with up to T1, up to T2 and above: `added`, rad/(N·m).
pub fn beside(
    drive: &Drive,
    kind: GeneratorKind,
    temperature_c: f64,
    stated: &Stated,
    settings: SolverSettings,
    looked_for: bool,
    added: [f64; 3],
) -> SheetBeside {
    let loads = stated.loads(drive.rated_torque_n_m(kind));
    let (sheet, done) = data_sheet(drive, kind, temperature_c, loads, POSITIONS, settings);
    let mut why = done.err();
    let mut further = |wanted: Option<f64>, of: &dyn Fn(Problem, f64) -> Result<f64, SolveError>| -> Option<f64> {
        let wanted = wanted?;
        let found = Problem::new(drive, kind, temperature_c, settings).and_then(|problem| of(problem, wanted));
        found.map_err(|error| why.get_or_insert(error)).ok()
    };
    let loop_arcmin = further(stated.hysteresis_loss_arcmin, &|problem, _| hysteresis_arcmin(&problem, loads, &sheet));
    let ratcheting = stated.ratcheting_torque_n_m.filter(|_| looked_for);
    let held_n_m = further(ratcheting, &|problem, wanted| held_n_m(problem, loads, wanted));
    let starting_n_m = further(stated.starting_torque_n_m, &|problem, _| starting_n_m(&problem));
    let arcmin = |arcsec: Option<f64>| arcsec.map(|x| x / 60.0);
    let k = [sheet.k1_n_m_per_rad, sheet.k2_n_m_per_rad, sheet.k3_n_m_per_rad];
    let [k1, k2, k3] = std::array::from_fn(|range| k[range].map(|fem| (fem.recip() + added[range]).recip()));
    // The error of tips that clash is no accuracy of the drive.
    let clash = sheet.tip_contact.filter(|tips| tips.counts());
    let accuracy = arcmin(sheet.kinematic_error_pp_arcsec.filter(|_| clash.is_none()));
    let figures = [
        ("k1_n_m_per_rad", stated.k1_n_m_per_rad, k1),
        ("k2_n_m_per_rad", stated.k2_n_m_per_rad, k2),
        ("k3_n_m_per_rad", stated.k3_n_m_per_rad, k3),
        ("hysteresis_loss_arcmin", stated.hysteresis_loss_arcmin, loop_arcmin),
        ("lost_motion_arcmin", stated.lost_motion_arcmin, arcmin(sheet.lost_motion_arcsec)),
        ("ratcheting_torque_n_m", stated.ratcheting_torque_n_m, held_n_m),
        ("starting_torque_n_m", stated.starting_torque_n_m, starting_n_m),
        ("accuracy_arcmin", stated.accuracy_arcmin, accuracy),
    ];
    let beside = figures
        .into_iter()
        .filter_map(|(figure, value, computed)| {
            let scatter = figure.starts_with('k').then(|| stated.scatter_percent());
            let stated = value?;
            // A pitch is not a turn, and what bears all that was looked for may bear more.
            let compares = match figure {
                "accuracy_arcmin" => false,
                "ratcheting_torque_n_m" => computed.is_some_and(|held| held < stated),
                _ => true,
            };
            let ratio = computed.map(|computed| computed / stated).filter(|ratio| compares && ratio.is_finite());
            let within_scatter = ratio.zip(scatter).map(|(ratio, percent)| (ratio - 1.0).abs() <= 1e-2 * percent);
            let (_, _, _, words) = described(figure);
            Some(Beside { figure, stated, computed, ratio, within_scatter, words })
        })
        .collect();
    SheetBeside {
        generator: kind,
        stated: stated.clone(),
        loads,
        assumed: stated.assumed(),
        sheet,
        beside,
        why: why.map(|error| error.to_string()).or(clash.map(|tips| tips.in_words())),
    }
}

/// Width of the loop at no load, arcmin: the drive is loaded to the rated torque one way and let go to a light touch,
/// then the other. Without friction it comes back the way it went: the clearance alone.
fn hysteresis_arcmin(problem: &Problem, loads: Loads, sheet: &DataSheet) -> Result<f64, SolveError> {
    if problem.drive.flanks.friction_coefficient == 0.0
        && let Some(backlash) = sheet.backlash_arcsec
    {
        return Ok(backlash / 60.0);
    }
    let touch = crate::data_sheet::touch_n_m(&problem.drive, loads);
    let mut motion = Motion::deformed(problem, 0.0)?;
    let start = motion.state().clone();
    let mut ends = [0.0; 2];
    for (end, way) in ends.iter_mut().zip([1.0, -1.0]) {
        motion.go_back(start.clone());
        let between = |k: u32| touch + (loads.largest_n_m - touch) * f64::from(k) / f64::from(STEPS);
        for k in (0..=STEPS).chain((0..STEPS).rev()) {
            motion.load(way * between(k))?;
        }
        *end = motion.error_rad();
    }
    Ok((ends[0] - ends[1]) * ARCMIN_PER_RAD)
}

/// The largest torque, up to the one that is wanted, at which the drive at rest finds equilibrium.
fn held_n_m(mut problem: Problem, loads: Loads, wanted_n_m: f64) -> Result<f64, SolveError> {
    problem.settings.max_halvings = HALVINGS;
    let mut motion = Motion::deformed(&problem, 0.0)?;
    let mut held = 0.0;
    let first = loads.largest_n_m.min(wanted_n_m);
    for k in 0..=STEPS {
        let torque = first + (wanted_n_m - first) * f64::from(k) / f64::from(STEPS);
        match motion.load(torque) {
            Ok(()) => held = torque,
            Err(SolveError::NotConverged { reached_n_m, .. }) => return Ok(reached_n_m.max(held)),
            Err(SolveError::OutOfRange { .. }) => return Ok(held),
            Err(error) => return Err(error),
        }
    }
    Ok(held)
}

/// The largest torque of the generator over a tooth pitch without load, N·m.
fn starting_n_m(problem: &Problem) -> Result<f64, SolveError> {
    let mut motion = Motion::deformed(problem, 0.0)?;
    let step = motion.pitch() / STARTING_STEPS as f64;
    motion.settle(step)?;
    let places = motion.turn_in(motion.pitch(), STARTING_STEPS)?;
    Ok(places.iter().map(|place| place.increment.generator_torque_n_m.abs()).fold(0.0, f64::max))
}

/// Reason of the difference between the stiffness of a table and that of a data sheet.
pub const TWO_SETS_OF_K: &str = "K of a table is read off its nodes, with ranges that end at 21, 72 and 100 % of its \
                                 largest torque, in the middle of both directions; K beside the data sheet is by \
                                 secants of the FEM, with what completed the table, to the torques of the sheet";

impl SheetBeside {
    /// In lines, as the commands print it.
    pub fn text(&self) -> String {
        let of = self.stated.source.as_deref().map_or_else(String::new, |source| format!(" ({source})"));
        let mut lines = format!(
            "data sheet{of}, {} generator, {} N·m\n  {:<24}{:>12}{:>12}{:>11}\n",
            self.generator,
            self.loads_in_words(),
            "",
            "stated",
            "computed",
            "ratio"
        );
        for row in &self.beside {
            let is_least = row.figure == "ratcheting_torque_n_m" && row.computed >= Some(row.stated);
            let computed = row.computed.map_or_else(|| "-".to_owned(), short);
            let computed = if is_least { format!("≥{computed}") } else { computed };
            let ratio = row.ratio.map_or_else(|| "-".to_owned(), short);
            lines += &format!(
                "  {:<24}{:>12}{computed:>12}{ratio:>11}  {}\n",
                row.figure,
                short(row.stated),
                row.remark(self)
            );
        }
        if let Some(what) = self.assumed_in_words() {
            lines += &format!("  {what}\n");
        }
        if let Some(why) = &self.why {
            lines += &format!("  not all of it was computed: {why}\n");
        }
        lines
    }

    /// That stiffness is not that of the sheet's units, and what to do; nothing where it is within their scatter.
    pub fn caution(&self) -> Option<Caution> {
        let off = || self.beside.iter().filter(|row| row.within_scatter == Some(false));
        let ratios = || off().filter_map(|row| row.ratio);
        let value = ratios().max_by(|a, b| a.ln().abs().total_cmp(&b.ln().abs()))?;
        let each = off().zip(ratios()).map(|(row, ratio)| format!("{} {ratio:.2}", row.in_words().0));
        let percent = self.stated.scatter_percent();
        let way_out = if ratios().all(|ratio| ratio > 1.0) {
            "; tables --complete-from-data-sheet adds what is missing"
        } else {
            ""
        };
        let words = format!(
            "stiffness over the data sheet's is {}, and units scatter by ±{percent:.0} %: the wind-up of a real unit \
             differs{way_out}",
            each.collect::<Vec<_>>().join(", ")
        );
        Some(Caution { figure: "data_sheet", value, limit: 1.0 + 1e-2 * percent, words })
    }

    /// The three loads in N·m, each that is not of the sheet marked as assumed.
    pub fn loads_in_words(&self) -> String {
        let Loads { t1_n_m, t2_n_m, largest_n_m } = self.loads;
        let largest = if self.stated.is_rated_within_t2() { "largest" } else { "rated" };
        let loads = [("T1", "t1_n_m", t1_n_m), ("T2", "t2_n_m", t2_n_m), (largest, "rated_torque_n_m", largest_n_m)];
        let word = |(name, key, load): (&str, &str, f64)| {
            let assumed = if self.assumed.contains(&key) { " (assumed)" } else { "" };
            format!("{name} {}{assumed}", short(load))
        };
        loads.map(word).join(" ")
    }

    /// Where assumed loads come from; nothing where all are stated.
    pub fn assumed_in_words(&self) -> Option<String> {
        let Loads { t1_n_m: t1, t2_n_m: t2, .. } = Loads::up_to(100.0);
        let from = if self.stated.is_rated_within_t2() {
            "the stated rated torque is not above T2, and K3 takes a larger load"
        } else if self.assumed.len() == 3 {
            "the rated torque is what a table of this generator spans by default"
        } else {
            "from the stated ones"
        };
        let keys = self.assumed.join(", ");
        let what = format!("guessed: {keys}; {from}; T1 : T2 : rated = {t1} : {t2} : 100, as of a CSF-25-100");
        (!keys.is_empty()).then_some(what)
    }
}

impl Beside {
    /// Name and unit of the figure.
    pub fn in_words(&self) -> (&'static str, &'static str) {
        let (name, unit, ..) = described(self.figure);
        (name, unit)
    }

    /// Meaning of the figure, whether it depends on assumed loads, and whether it is within the scatter of units.
    pub fn remark(&self, of: &SheetBeside) -> String {
        let percent = of.stated.scatter_percent();
        let (_, _, hangs_on, _) = described(self.figure);
        let assumed = if hangs_on.iter().any(|key| of.assumed.contains(key)) { "at assumed loads; " } else { "" };
        let scatter = match self.within_scatter {
            Some(true) => format!("; within the ±{percent:.0} % that units scatter"),
            Some(false) => format!("; outside the ±{percent:.0} % that units scatter"),
            None => String::new(),
        };
        format!("{assumed}{}{scatter}", self.words)
    }
}

/// Four digits that count.
pub fn short(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e6).contains(&value.abs()) {
        return format!("{value:.3e}");
    }
    let digits = (3 - value.abs().max(1e-9).log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torques_are_written_as_they_are_meant() {
        for (torque, text) in [(0.05_f32, "0.05"), (200.0, "200"), (-0.021, "-0.021"), (12.345_67, "12.35"), (0.0, "0")]
        {
            assert_eq!(short(torque.into()), text);
        }
    }

    use flexspline_mechanics::mesh::MeshLevel;

    fn shown(stated: Stated, beside: Vec<Beside>) -> SheetBeside {
        let (generator, loads, assumed) = (GeneratorKind::Cam, stated.loads(20.0), stated.assumed());
        SheetBeside { generator, stated, loads, assumed, sheet: DataSheet::default(), beside, why: None }
    }

    /// A stiffness that is stated, and computed over it.
    fn row(figure: &'static str, stated: f64, ratio: Option<f64>) -> Beside {
        let within_scatter = ratio.map(|ratio| (ratio - 1.0).abs() <= 0.3);
        Beside { figure, stated, computed: ratio.map(|of| stated * of), ratio, within_scatter, words: "secant" }
    }

    #[test]
    fn a_sheet_is_read_and_every_mistake_has_its_line() {
        let read = |body: &str| Stated::of_file("d.toml", &format!("base = \"HHD-95\"\n[data_sheet]\n{body}\n"));
        let stated = read("t1_n_m = 7\nk1_n_m_per_rad = 16e3\nsource = \"CSF\"").unwrap().unwrap();
        assert_eq!((stated.t1_n_m, stated.k1_n_m_per_rad), (Some(7.0), Some(16e3)));
        assert_eq!(Stated::of_file("d.toml", "base = \"HHD-95\""), Ok(None));
        for (body, place, words) in [
            ("k1 = 5", "d.toml:3", "k1_n_m_per_rad"),
            ("k2_n_m_per_rad = -5", "d.toml:3", "found -5"),
            ("t2_n_m = 48\nk1_n_m_per_rad = 3.1", "", "found K of 3.1 N·m/rad, by which 48 N·m turn the output"),
            ("t1_n_m = 25\nt2_n_m = 7", "", "found t1 25.0 and t2 7.0, allowed: t1 below t2"),
        ] {
            let error = read(body).unwrap_err().to_string();
            assert!(error.contains(place) && error.contains(words), "{error}");
        }
    }

    #[test]
    fn the_template_has_every_key_and_reads_once_it_is_filled_in() {
        assert!(keys().all(|key| TEMPLATE.contains(&format!("# {key} = "))));
        let filled = TEMPLATE.replace("\n# ", "\n").replace(" = 0.0", " = 5.0").replace("t1_n_m = 5.0", "t1_n_m = 1.0");
        let filled = filled.replace("t2_n_m = 5.0", "t2_n_m = 2.0");
        assert_eq!(Stated::of_file("d.toml", &filled).unwrap().unwrap().t2_n_m, Some(2.0));
    }

    #[test]
    fn loads_that_are_not_stated_are_in_proportion() {
        let usual = Loads::up_to(50.0);
        assert_eq!(Stated::default().loads(50.0), usual);
        let stated = Stated { t2_n_m: Some(36.0), ..Stated::default() };
        assert!((stated.loads(1.0).largest_n_m - 50.0).abs() < 1e-9);
        // CSF-25-100: T2 is 48 N·m. What is rated is what is printed, and a cam's.
        let stated = crate::catalogue::sheet("CSF", 25.0, 100).unwrap();
        let drive = Drive::hhd_95();
        let rated = |stated, kind| Stated::rated_n_m(stated, &drive, kind);
        assert_eq!(rated(Some(&stated), GeneratorKind::Cam), 66.67);
        assert_eq!(rated(Some(&stated), GeneratorKind::TwoRoller), 20.0);
        assert_eq!(rated(None, GeneratorKind::Cam), 200.0);
    }

    /// Whatever is stated alone is used as it is, and each load is above the one before.
    #[test]
    fn a_stated_load_is_never_moved_and_an_assumed_one_is_marked() {
        for (t1, t2, rated) in [(29.0, 108.0, 153.0), (90.0, 95.0, 100.0), (0.1, 0.2, 100.0)] {
            for given in 0..8 {
                let stated = Stated {
                    t1_n_m: (given & 1 > 0).then_some(t1),
                    t2_n_m: (given & 2 > 0).then_some(t2),
                    rated_torque_n_m: (given & 4 > 0).then_some(rated),
                    k1_n_m_per_rad: Some(1e4),
                    ..Stated::default()
                };
                let loads = stated.loads(20.0);
                let kept = |stated: Option<f64>, load: f64| stated.is_none_or(|stated| stated == load);
                assert!(kept(stated.t1_n_m, loads.t1_n_m) && kept(stated.t2_n_m, loads.t2_n_m), "{given}: {loads:?}");
                assert!(kept(stated.rated_torque_n_m, loads.largest_n_m), "{given}: {loads:?}");
                assert!(0.0 < loads.t1_n_m && loads.t1_n_m < loads.t2_n_m, "{given}: {loads:?}");
                assert!(loads.t2_n_m < loads.largest_n_m, "{given}: {loads:?}");
                let sheet = shown(stated, Vec::new());
                assert_eq!(sheet.assumed.len(), 3 - (given as u32).count_ones() as usize);
                assert_eq!(sheet.text().matches("(assumed)").count(), sheet.assumed.len(), "{}", sheet.text());
                assert_eq!(sheet.assumed_in_words().is_some(), given < 7);
                let k1 = row("k1_n_m_per_rad", 1e4, None);
                assert_eq!(k1.remark(&sheet).contains("at assumed loads"), given & 1 == 0);
            }
        }
    }

    /// A drive 7.7 times as stiff as its sheet is no good page; one within what units scatter is.
    #[test]
    fn stiffness_beyond_what_units_scatter_is_a_caution() {
        let caution = |k1: f64, k2: f64| {
            let rows = [("k1_n_m_per_rad", k1), ("k2_n_m_per_rad", k2)];
            shown(Stated::default(), rows.map(|(figure, ratio)| row(figure, 1e4, Some(ratio))).to_vec()).caution()
        };
        assert_eq!(caution(1.2, 0.8), None);
        let stiff = caution(7.7, 1.2).unwrap();
        assert!(stiff.value == 7.7 && stiff.words.starts_with("stiffness over the data sheet's is K1 7.70, and"));
        assert!(stiff.words.contains("30 %") && stiff.words.contains("--complete-from-data-sheet"), "{}", stiff.words);
        // Softer is further off here, and no sheet completes it.
        let soft = caution(1.5, 0.2).unwrap();
        assert!(soft.value == 0.2 && soft.words.contains("K1 1.50, K2 0.20") && !soft.words.contains("--complete"));
        let retained = |sheet: Stated| {
            let mut cautions = Vec::from_iter(Caution::of_stiffness(&Drive::hhd_95()));
            Stated::retain(Some(&sheet), &mut cautions);
            cautions.len()
        };
        assert_eq!([None, Some(3e4)].map(|k2| retained(Stated { k2_n_m_per_rad: k2, ..Stated::default() })), [1, 0]);
    }

    /// CSG-32-50 is rated at 99 N·m, and its T2 is 108 N·m. A rated torque of T2 leaves nothing for K3 either.
    #[test]
    fn a_rated_torque_below_t2_is_taken_and_k3_has_a_larger_load() {
        let text = "base = \"HHD-95\"\n[data_sheet]\nt1_n_m = 29\nt2_n_m = 108\nrated_torque_n_m = 99\n";
        let stated = Stated::of_file("d.toml", text).unwrap().unwrap();
        let loads = stated.loads(20.0);
        assert_eq!((loads.t1_n_m, loads.t2_n_m, loads.largest_n_m.round()), (29.0, 108.0, 150.0));
        assert_eq!(stated.assumed(), ["rated_torque_n_m"]);
        let shown = shown(stated, Vec::new());
        let text = shown.text();
        assert!(
            text.contains("T2 108 largest 150 (assumed) N·m")
                && text.contains("guessed: rated_torque_n_m; the stated rated torque is not above T2"),
            "{text}"
        );
        let stated = Stated { t1_n_m: None, rated_torque_n_m: Some(108.0), ..shown.stated };
        let (loads, assumed) = (stated.loads(20.0), stated.assumed());
        assert_eq!((loads.largest_n_m, &assumed[..]), (150.0, &["t1_n_m", "rated_torque_n_m"][..]));
        let said = SheetBeside { stated, loads, assumed, ..shown }.assumed_in_words().unwrap();
        assert!(said.contains("guessed: t1_n_m, rated_torque_n_m; the stated"), "{said}");
    }

    /// Friction of the flanks widens the loop; without it the loop is the clearance. A torque that the drive bears is
    /// held. A sheet filled in with a figure in a wrong unit: every column is a word of its own.
    #[test]
    fn columns_stand_apart_whatever_the_ratio() {
        let stated = Stated { k1_n_m_per_rad: Some(3.1), ..Stated::default() };
        let beside = [244_747.3, 2.447e11, 0.98].map(|ratio| row("k1_n_m_per_rad", 3.1, Some(ratio)));
        let text = shown(stated, beside.to_vec()).text();
        let rows: Vec<Vec<&str>> =
            text.lines().filter(|line| line.contains("k1_")).map(|line| line.split_whitespace().collect()).collect();
        assert!(rows.iter().all(|row| row.len() >= 4 && row[1] == "3.1" && row[3].parse::<f64>().is_ok()), "{text}");
        assert_eq!(rows[2][3], "0.98");
    }

    #[test]
    #[ignore = "long: tests/run slow"]
    fn the_loop_is_the_clearance_and_what_friction_adds() {
        let stated = Stated {
            rated_torque_n_m: Some(50.0),
            k2_n_m_per_rad: Some(1.0),
            hysteresis_loss_arcmin: Some(1.0),
            ratcheting_torque_n_m: Some(80.0),
            starting_torque_n_m: Some(0.01),
            unit_scatter_percent: Some(30.0),
            ..Stated::default()
        };
        let of = |drive: &Drive| {
            beside(drive, GeneratorKind::Cam, 20.0, &stated, SolverSettings::fast(MeshLevel::Coarse), true, [0.0; 3])
        };
        let get =
            |of: &SheetBeside, name: &str| of.beside.iter().find(|row| row.figure == name).unwrap().computed.unwrap();
        let smooth = of(&Drive::hhd_95());
        println!("{}", smooth.text());
        assert!(smooth.why.is_none());
        let clearance = smooth.sheet.backlash_arcsec.unwrap() / 60.0;
        assert_eq!(get(&smooth, "hysteresis_loss_arcmin"), clearance);
        assert_eq!(get(&smooth, "ratcheting_torque_n_m"), 80.0);
        assert_eq!(smooth.beside[0].within_scatter, Some(false));
        let rough = of(&Drive::hhd_95().with_set("flanks.friction_coefficient=0.1").unwrap());
        println!("{}", rough.text());
        // Some hundredths of an arc-second.
        let wider = get(&rough, "hysteresis_loss_arcmin") - clearance;
        assert!((1e-4..2e-3).contains(&wider), "{wider}");
        assert!(get(&rough, "starting_torque_n_m") > get(&smooth, "starting_torque_n_m"));
    }
}
