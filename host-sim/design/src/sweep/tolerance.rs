//! The file of tolerances: a drive, its load, and the tolerances of its drawing.

use std::fmt::Display;

use toml::Spanned;
use toml::de::DeValue;

use super::PlanError;
use super::draw::{Drawn, sets};
use crate::stated::short;
use flexspline_base::statistics::{normal_cdf, normal_quantile};
use flexspline_base::suggest::{likeliest_path, question};
use flexspline_base::toml_file::{
    Allowed, Entries, Refused, TomlFile, above, any, each_of, from, lines, one_of, real, text, whole,
};
use flexspline_mechanics::drive::{Drive, DriveError, FieldKind, GeneratorKind};

/// A commented file of tolerances.
pub const EXAMPLE: &str = include_str!("example.toml");

/// Tolerances of a file, at most.
const MOST_TOLERANCES: usize = 60;
/// Standard deviations in the `plus_minus` of a normal distribution: the "natural tolerance" of quality control.
const SIGMAS: f64 = 3.0;
/// Default limits of a normal or Rayleigh distribution, standard deviations: one drive in millions lies outside.
const FAR: f64 = 5.5;

/// The middle of a tolerance of a number that is not 0, such as a wear, is refused if it is more standard deviations
/// than the first number, and more than this share, away from the value of the drive: guesses beyond any drawing.
const FAR_OFF: (f64, f64) = (10.0, 0.1);

/// The contents of a file of tolerances.
#[derive(Debug, Clone, PartialEq)]
pub struct Tolerances {
    /// The drive as drawn.
    pub drive: Drive,
    /// The generator.
    pub generator: GeneratorKind,
    /// Load, N·m.
    pub torque_n_m: f64,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// The tolerances.
    pub list: Vec<FieldTolerance>,
}

/// One tolerance.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldTolerance {
    /// The field of the drive, as `--set` takes it.
    pub field: String,
    /// How it acts.
    pub acts: ToleranceActs,
    /// How it scatters.
    pub distribution: Distribution,
}

/// How a field acts, and by which kernels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ToleranceActs {
    /// It changes the drive everywhere alike: FEM of three drives gives a parabola of every figure.
    Alike,
    /// It displaces or deforms a part in a random direction.
    Directed,
    /// A harmonic of the pitch of a wheel, its phase random.
    Harmonic {
        /// Waves around the wheel.
        order: u32,
    },
    /// A random error of every tooth of a wheel.
    Teeth {
        /// Teeth of the wheel.
        count: usize,
        /// The error that is distributed.
        errors: TeethError,
    },
}

/// A random error of teeth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TeethError {
    /// Of the position of each tooth, independently.
    Position,
    /// Of each single pitch: positions are their sum around the wheel, closed.
    Pitch,
}

/// A distribution within limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distribution {
    /// Its form.
    pub form: DistributionForm,
    /// Mean of a normal distribution.
    pub mean: f64,
    /// Standard deviation of a normal distribution, and of a component of Rayleigh's.
    pub std: f64,
    /// Least and largest value; values outside are never drawn (truncated, not clipped).
    pub limits: [f64; 2],
}

/// The form of a distribution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DistributionForm {
    /// Gaussian.
    Normal,
    /// Even between the limits.
    Uniform,
    /// Size of a displacement whose two components are Gaussian.
    Rayleigh,
}

impl Distribution {
    /// Share below `x`, without limits.
    fn below(&self, x: f64) -> f64 {
        let Distribution { form, mean, std, limits: [low, high] } = *self;
        match form {
            DistributionForm::Normal => normal_cdf((x - mean) / std),
            DistributionForm::Uniform => ((x - low) / (high - low)).clamp(0.0, 1.0),
            DistributionForm::Rayleigh if x > 0.0 => -libm::expm1(-0.5 * (x / std) * (x / std)),
            DistributionForm::Rayleigh => 0.0,
        }
    }

    /// The value that a share `u`, 0 to 1 and neither, lies below.
    pub(crate) fn quantile(&self, u: f64) -> f64 {
        let Distribution { form, mean, std, limits: [low, high] } = *self;
        let [least, most] = self.limits.map(|end| self.below(end));
        let share = least + u * (most - least);
        let value = match form {
            DistributionForm::Normal => mean + std * normal_quantile(share),
            DistributionForm::Uniform => low + u * (high - low),
            DistributionForm::Rayleigh => std * (-2.0 * libm::log1p(-share)).sqrt(),
        };
        value.clamp(low, high)
    }

    /// The value that all others scatter about.
    pub(super) fn middle(&self) -> f64 {
        if self.form == DistributionForm::Normal { self.mean } else { self.quantile(0.5) }
    }

    /// Standard deviation of a distribution of numbers, as if there were no limits on a normal one.
    fn std_dev(&self) -> f64 {
        let [low, high] = self.limits;
        if self.form == DistributionForm::Normal { self.std } else { (high - low) / 12f64.sqrt() }
    }
}

impl ToleranceActs {
    /// How the field `at` a place of the file acts; `order` where one is given.
    fn of(
        at: &Spanned<DeValue<'_>>,
        field: &str,
        order: Option<u32>,
        errors: TeethError,
        drive: &Drive,
    ) -> Result<ToleranceActs, Refused> {
        let refused = |what: String| Err(Refused::because(at, what));
        match field.strip_prefix("as_built.").unwrap_or_default() {
            "flexspline_pitch_harmonics" | "circular_spline_pitch_harmonics" => match order {
                Some(order) => Ok(ToleranceActs::Harmonic { order }),
                None => refused("order: missing; give the waves around the wheel".to_owned()),
            },
            "circular_spline_eccentricity_um"
            | "circular_spline_ovality_um"
            | "circular_spline_offset_um"
            | "flexspline_runout_um"
            | "generator_eccentricity_um" => Ok(ToleranceActs::Directed),
            "flexspline_pitch_error_um" => Ok(ToleranceActs::Teeth { count: drive.flexspline.teeth as usize, errors }),
            "circular_spline_pitch_error_um" => {
                Ok(ToleranceActs::Teeth { count: drive.circular_spline.teeth as usize, errors })
            }
            "rim_thickness_harmonics" | "cam_form_harmonics" | "damaged_teeth" | "generator_lobe_asymmetry_um" => {
                refused(format!(
                    "field: found {field:?}, for which there are no kernels; allowed of [as_built]: eccentricity, \
                     ovality and offset of the circular spline, runout of the flexspline, eccentricity of the \
                     generator, pitch errors and their harmonics, wear, differences of temperature"
                ))
            }
            angle if angle.ends_with("_phase_deg") || angle.ends_with("_direction_deg") => {
                refused(format!("field: found {field:?}, which is drawn with its size; leave it out"))
            }
            _ => Ok(ToleranceActs::Alike),
        }
    }
}

const KEYS: [&str; 5] = ["drive", "generator", "torque_n_m", "temperature_c", "tolerance"];
const TOLERANCE_KEYS: [&str; 8] = ["field", "order", "errors", "distribution", "mean", "std", "limits", "plus_minus"];
const TWO_LIMITS: &str = "two numbers, the least first, then a larger one";
const ANY_ORDER: Allowed = from(1.0, 1000.0);
const POSITIVE: Allowed = above(0.0, 1e9);
const FORMS: [(&str, DistributionForm); 3] = [
    ("normal", DistributionForm::Normal),
    ("uniform", DistributionForm::Uniform),
    ("rayleigh", DistributionForm::Rayleigh),
];

impl Tolerances {
    /// Reads a file; `drive` finds the drive that it names.
    ///
    /// # Errors
    /// Everything that is wrong with it: file, line, field, the value found and what is allowed.
    pub fn read<E: Display>(
        name: &str,
        file_text: &str,
        drive: impl FnOnce(&str) -> Result<Drive, E>,
    ) -> Result<Tolerances, PlanError> {
        let mut file = TomlFile::new(name, file_text);
        match Tolerances::of_file(&mut file, drive) {
            Some(tolerances) if file.is_sound() => Ok(tolerances),
            _ => Err(PlanError::BadInput(lines(&file.problems()))),
        }
    }

    fn of_file<E: Display>(
        file: &mut TomlFile<'_>,
        drive: impl FnOnce(&str) -> Result<Drive, E>,
    ) -> Option<Tolerances> {
        let table = file.parse()?;
        file.refuse_unknown_keys(&table, &KEYS, &["tolerance"]);
        let value = |key: &str| -> Option<&Spanned<DeValue<'_>>> { table.get(key) };
        let named = value("drive").map_or(Some("HHD-95".to_owned()), |value| file.take("drive", text(value)))?;
        let drive = drive(&named).map_err(|why| file.refuse_whole("drive", why.to_string())).ok()?;
        if let Some(field) = drive.as_built.first_not_uniform() {
            file.refuse_whole(
                "drive",
                format!(
                    "{field} is not zero: give the drive as drawn; kernels are of first order about a drive that \
                     repeats from tooth to tooth, and about one unit there would be as many of them as teeth"
                ),
            );
        }
        let known = GeneratorKind::ALL.map(|kind| (kind.name(), kind));
        let generator = value("generator").and_then(|value| file.take("generator", one_of(&known, value)));
        let generator = generator.unwrap_or(GeneratorKind::Cam);
        let rated = drive.rated_torque_n_m(generator);
        let mut number = |key: &str, allowed: &Allowed, usual: f64| {
            value(key).and_then(|value| file.take(key, real(allowed, value))).unwrap_or(usual)
        };
        let torque_n_m = number("torque_n_m", &above(0.0, rated), RATED_SHARE * rated);
        let limits = &drive.temperature;
        let temperature_c = number("temperature_c", &from(limits.minimum_c, limits.maximum_c), limits.reference_c);
        let Some(value) = value("tolerance") else {
            file.refuse_whole("tolerance", "missing; give at least one [[tolerance]]".to_owned());
            return None;
        };
        let list = file.take("tolerance", each_of(value, "tables [[tolerance]]", |entry| tolerance(entry, &drive)))?;
        if !(1..=MOST_TOLERANCES).contains(&list.len()) {
            file.refuse(value.span(), "tolerance", format!("found {}, allowed: 1 to {MOST_TOLERANCES}", list.len()));
        }
        let twice = |a: &FieldTolerance, b: &FieldTolerance| {
            let are_harmonics = matches!(a.acts, ToleranceActs::Harmonic { .. });
            a.field == b.field && (a.acts == b.acts || !are_harmonics)
        };
        if let Some(k) = (1..list.len()).find(|k| list[..*k].iter().any(|a| twice(a, &list[*k]))) {
            let what = format!("found {:?} twice, allowed: once", list[k].field);
            file.refuse(value.span(), &format!("tolerance[{k}]"), what);
        }
        Some(Tolerances { drive, generator, torque_n_m, temperature_c, list })
    }

    /// The drive with these values of the tolerances.
    ///
    /// # Errors
    /// They make no drive.
    pub(super) fn drive_with(&self, drawn: &[Drawn]) -> Result<Drive, DriveError> {
        self.drive.with_sets(sets(&self.list, drawn).iter().map(String::as_str))
    }
}

/// Default load over the rated one: a guess at the usual load of a joint.
const RATED_SHARE: f64 = 0.25;

/// One `[[tolerance]]`.
fn tolerance(entry: &Spanned<DeValue<'_>>, drive: &Drive) -> Result<FieldTolerance, Refused> {
    let table = Entries::of(entry, &TOLERANCE_KEYS)?;
    let field = table.needed("field", text)?;
    let place = |key: &str| -> &Spanned<DeValue<'_>> { table.table.get(key).unwrap_or(entry) };
    let order = table.given("order", |value| whole(&ANY_ORDER, value))?;
    let errors = [("position", TeethError::Position), ("pitch", TeethError::Pitch)];
    let errors = table.given("errors", |value| one_of(&errors, value))?;
    let acts = ToleranceActs::of(place("field"), &field, order, errors.unwrap_or(TeethError::Position), drive)?;
    let teeth = if let ToleranceActs::Teeth { count, .. } = acts { Some(count) } else { None };
    let nominal = match acts {
        ToleranceActs::Alike => nominal(place("field"), drive, &field).map_err(|refused| refused.within(".field"))?,
        _ => 0.0,
    };
    let is_size = acts != ToleranceActs::Alike && teeth.is_none();
    let form = table.needed("distribution", |value| one_of(&FORMS, value))?;
    let mean = table.given("mean", any)?;
    let std = table.given("std", |value| real(&POSITIVE, value))?;
    let half = table.given("plus_minus", |value| real(&POSITIVE, value))?;
    let limits = table.given("limits", |value| match each_of(value, TWO_LIMITS, any)?[..] {
        [low, high] if low < high => Ok([low, high]),
        _ => Err(Refused::found(value, TWO_LIMITS)),
    })?;
    let [is_normal, is_uniform, is_rayleigh] = FORMS.map(|(_, known)| known == form);
    let wrong = |key: &str, what: &str| Err(Refused::because(place(key), format!("{key}: {what}")));
    for (key, is_wrong, allowed) in [
        ("errors", errors.is_some() && teeth.is_none(), "with errors of every tooth alone"),
        ("order", order.is_some() && !matches!(acts, ToleranceActs::Harmonic { .. }), "with pitch harmonics alone"),
        (
            "distribution",
            is_normal && is_size,
            "\"rayleigh\" (both components normal) or \"uniform\", of a size in a random direction",
        ),
        ("distribution", is_rayleigh && !is_size, "\"normal\" or \"uniform\", of what is no size in a direction"),
        ("mean", mean.is_some() && !is_normal, "with distribution = \"normal\""),
        ("std", std.is_some() && (half.is_some() || is_uniform), "with normal or rayleigh, and without plus_minus"),
        ("plus_minus", half.is_some() && is_rayleigh, "with normal or uniform"),
    ] {
        if is_wrong {
            return wrong(key, &format!("found it with {field:?}, allowed: {allowed}"));
        }
    }
    let (given_mean, mean) = (mean.is_some(), mean.unwrap_or(nominal));
    let std = std.or(half.map(|half| half / SIGMAS));
    let reach = half.or(std.map(|std| FAR * std));
    let usual = reach.map(|reach| [if is_size { 0.0 } else { mean - reach }, mean + reach]);
    let (Some(limits), true) = (limits.or(usual), std.is_some() || is_uniform) else {
        let what = if is_uniform { "limits, nor plus_minus" } else { "std, nor plus_minus (3 std) of normal" };
        return Err(Refused::because(entry, format!("found no {what}")));
    };
    let distribution = Distribution { form, mean, std: std.unwrap_or_default(), limits };
    // A size is never negative, and part of the distribution has to lie within the limits.
    if is_size && limits[0] < 0.0 {
        return wrong("limits", "found a size below 0, allowed: 0 or more");
    }
    let [least, most] = limits.map(|end| distribution.below(end));
    if most - least < LEAST_INSIDE {
        return wrong("limits", "found limits that the distribution hardly ever keeps, allowed: wider ones");
    }
    let (middle, std) = (distribution.middle(), distribution.std_dev());
    let off = (middle - nominal).abs();
    if nominal != 0.0 && off > FAR_OFF.0 * std && off > FAR_OFF.1 * nominal.abs() {
        let (key, off, about, std) = (if given_mean { "mean" } else { "limits" }, off / std, short(middle), short(std));
        let what = format!(
            "{field:?} is {nominal} in the drive, and the tolerance scatters about {about}, {off:.0} standard \
             deviations of {std} away; allowed: about the value of the drive, which its file or --set changes"
        );
        return wrong(key, &what);
    }
    let list = [FieldTolerance { field, acts, distribution }];
    for value in limits {
        let teeth_um = vec![value; teeth.unwrap_or_default()];
        let sets = sets(&list, &[Drawn { value, teeth_um, ..Drawn::default() }]);
        if let Err(error) = drive.with_sets(sets.iter().map(String::as_str)) {
            let what = format!("{:?} at its limit {value} makes no drive: {error}", list[0].field);
            return Err(Refused::because(entry, what));
        }
    }
    let [tolerance] = list;
    Ok(tolerance)
}

/// Share of a distribution that must lie within its limits: below it a quantile has no digits left.
const LEAST_INSIDE: f64 = 1e-6;

/// The number that a field of the drive, named `at` a place, holds.
fn nominal(at: &Spanned<DeValue<'_>>, drive: &Drive, field: &str) -> Result<f64, Refused> {
    let fields = drive.fields();
    let Some(found) = fields.iter().find(|known| known.path == field) else {
        let paths: Vec<&str> = fields.iter().map(|known| known.path).collect();
        let hint = likeliest_path(field, &paths).map_or_else(String::new, |meant| format!("; {}", question(meant)));
        let what = format!("found {field:?}, allowed: a field of the drive, as --set takes it{hint}");
        return Err(Refused::because(at, what));
    };
    let value = found.value.as_deref().unwrap_or("a list");
    value.parse().ok().filter(|_| found.kind != FieldKind::Count).ok_or_else(|| {
        let what =
            format!("found {field:?}, which is {value} in this drive, allowed: a field of numbers with a fraction");
        Refused::because(at, what)
    })
}
