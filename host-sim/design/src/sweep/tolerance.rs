//! The file of tolerances: a drive, its load, and the tolerances of its drawing.

use std::fmt::Display;

use toml::Spanned;
use toml::de::DeValue;

use super::PlanError;
use super::draw::{Drawn, sets};
use crate::stated::short;
use flexspline_base::statistics::{normal_cdf, normal_quantile};
use flexspline_base::suggest::likeliest_path;
use flexspline_base::toml_file::{Allowed, Entries, Refused, TomlFile, above, any, each_of, from, one_of, text, whole};
use flexspline_mechanics::drive::{Drive, GeneratorKind, Wheel};

/// A commented file of tolerances.
pub const EXAMPLE: &str = include_str!("example.toml");

/// Tolerances of a file, at most.
const MOST_TOLERANCES: usize = 60;
/// Standard deviations in the `plus_minus` of a normal distribution: the "natural tolerance" of quality control.
const SIGMAS: f64 = 3.0;
/// Default limits of a normal or Rayleigh distribution, standard deviations: one drive in millions lies outside.
const FAR: f64 = 5.5;

/// The middle of a tolerance is refused if it is more standard deviations than the first number, and more than this
/// share, away from the value of the drive: guesses beyond any drawing.
const FAR_OFF: (f64, f64) = (10.0, 0.1);

/// The contents of a file of tolerances.
#[derive(Debug, Clone, PartialEq)]
pub struct Tolerances {
    /// The drive as drawn.
    pub drive: Drive,
    /// The generators.
    pub generators: Vec<GeneratorKind>,
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
        /// Of which wheel.
        wheel: Wheel,
        /// Waves around it.
        order: u32,
    },
    /// A random error of every tooth of a wheel.
    Teeth {
        /// Of which wheel.
        wheel: Wheel,
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
    pub law: DistributionForm,
    /// Least and largest value; values outside are never drawn (truncated, not clipped).
    pub limits: [f64; 2],
}

/// The form of a distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DistributionForm {
    /// Gaussian.
    Normal {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        std: f64,
    },
    /// Even between the limits.
    Uniform,
    /// Size of a displacement whose two components are Gaussian.
    Rayleigh {
        /// Standard deviation of a component.
        std: f64,
    },
}

impl Distribution {
    /// Share below `x`, without limits.
    fn below(&self, x: f64) -> f64 {
        match self.law {
            DistributionForm::Normal { mean, std } => normal_cdf((x - mean) / std),
            DistributionForm::Uniform => ((x - self.limits[0]) / (self.limits[1] - self.limits[0])).clamp(0.0, 1.0),
            DistributionForm::Rayleigh { std } if x > 0.0 => -libm::expm1(-0.5 * (x / std) * (x / std)),
            DistributionForm::Rayleigh { .. } => 0.0,
        }
    }

    /// The value that a share `u`, 0 to 1 and neither, lies below.
    pub(crate) fn quantile(&self, u: f64) -> f64 {
        let [low, high] = self.limits;
        let [least, most] = self.limits.map(|end| self.below(end));
        let share = least + u * (most - least);
        let value = match self.law {
            DistributionForm::Normal { mean, std } => mean + std * normal_quantile(share),
            DistributionForm::Uniform => low + u * (high - low),
            DistributionForm::Rayleigh { std } => std * (-2.0 * libm::log1p(-share)).sqrt(),
        };
        value.clamp(low, high)
    }

    /// Why a distribution about another value than that of the drive is refused; none within [`FAR_OFF`], or where the
    /// field is 0 as drawn, such as a wear.
    fn far_from_drive(&self, nominal: f64) -> Option<String> {
        let [low, high] = self.limits;
        let (middle, std) = match self.law {
            DistributionForm::Normal { mean, std } => (mean, std),
            DistributionForm::Uniform => (0.5 * (low + high), (high - low) / 12f64.sqrt()),
            DistributionForm::Rayleigh { .. } => return None,
        };
        let off = (middle - nominal).abs();
        (nominal != 0.0 && off > FAR_OFF.0 * std && off > FAR_OFF.1 * nominal.abs()).then(|| {
            format!(
                "the tolerance scatters about {}, {:.0} standard deviations of {} away; allowed: about the value of \
                 the drive, which its file or --set changes",
                short(middle),
                off / std,
                short(std)
            )
        })
    }
}

impl ToleranceActs {
    /// How the field `at` a place acts; `order` where one is given.
    fn of(
        at: &Spanned<DeValue<'_>>,
        field: &str,
        order: Option<u32>,
        errors: TeethError,
    ) -> Result<ToleranceActs, Refused> {
        let refused = |what| Err(Refused::because(at, what));
        let section_key = field.strip_prefix("as_built.");
        let harmonic = |wheel| match order {
            Some(order) => Ok(ToleranceActs::Harmonic { wheel, order }),
            None => refused("order: missing; give the waves around the wheel".to_owned()),
        };
        let acts = match section_key {
            Some("flexspline_pitch_harmonics") => return harmonic(Wheel::Flexspline),
            Some("circular_spline_pitch_harmonics") => return harmonic(Wheel::CircularSpline),
            Some(
                "circular_spline_eccentricity_um"
                | "circular_spline_ovality_um"
                | "circular_spline_offset_um"
                | "flexspline_runout_um"
                | "generator_eccentricity_um",
            ) => ToleranceActs::Directed,
            Some("flexspline_pitch_error_um") => ToleranceActs::Teeth { wheel: Wheel::Flexspline, errors },
            Some("circular_spline_pitch_error_um") => ToleranceActs::Teeth { wheel: Wheel::CircularSpline, errors },
            Some(
                "rim_thickness_harmonics" | "cam_form_harmonics" | "damaged_teeth" | "generator_lobe_asymmetry_um",
            ) => {
                return refused(format!(
                    "field: found {field:?}, for which there are no kernels; allowed of [as_built]: eccentricity, \
                     ovality and offset of the circular spline, runout of the flexspline, eccentricity of the \
                     generator, pitch errors and their harmonics, wear, differences of temperature"
                ));
            }
            Some(phase) if phase.ends_with("_phase_deg") || phase.ends_with("_direction_deg") => {
                return refused(format!("field: found {field:?}, which is drawn with its size; leave it out"));
            }
            _ => ToleranceActs::Alike,
        };
        match order {
            Some(order) => refused(format!("order: found {order} with {field:?}, allowed: with pitch harmonics alone")),
            None => Ok(acts),
        }
    }
}

const KEYS: [&str; 5] = ["drive", "generator", "torque_n_m", "temperature_c", "tolerance"];
const TOLERANCE_KEYS: [&str; 8] = ["field", "order", "errors", "distribution", "mean", "std", "limits", "plus_minus"];
const TWO_LIMITS: &str = "two numbers, the least first, then a larger one";
const ANY_ORDER: Allowed = from(1.0, 1000.0);
const POSITIVE: Allowed = above(0.0, 1e9);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LawName {
    Normal,
    Uniform,
    Rayleigh,
}

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
        let refused = |file: TomlFile<'_>| PlanError::Tolerances(file.problems());
        let Some(table) = file.parse() else { return Err(refused(file)) };
        let mut known: Vec<String> = KEYS.iter().map(|key| (*key).to_owned()).collect();
        known.extend(TOLERANCE_KEYS.iter().map(|key| format!("tolerance.{key}")));
        file.refuse_unknown_keys(&table, &known.iter().map(String::as_str).collect::<Vec<_>>(), &[]);
        let value = |key: &str| -> Option<&Spanned<DeValue<'_>>> { table.get(key) };
        let named = value("drive").map_or(Some("HHD-95".to_owned()), |value| file.take("drive", text(value)));
        let Some(named) = named else { return Err(refused(file)) };
        let drive = match drive(&named) {
            Ok(drive) => drive,
            Err(why) => {
                file.refuse_whole("drive", why.to_string());
                return Err(refused(file));
            }
        };
        if let Some(field) = drive.as_built.first_not_uniform() {
            file.refuse_whole(
                "drive",
                format!(
                    "{field} is not zero: give the drive as drawn; kernels are of first order about a drive that \
                     repeats from tooth to tooth, and about one unit there would be as many of them as teeth"
                ),
            );
        }
        let generators = match value("generator") {
            None => vec![GeneratorKind::Cam],
            Some(value) => file.take("generator", generators(value)).unwrap_or_default(),
        };
        let rated = generators.iter().map(|kind| drive.rated_torque_n_m(*kind)).fold(f64::INFINITY, f64::min);
        let rated = if rated.is_finite() { rated } else { 1.0 };
        let torque_n_m = match value("torque_n_m") {
            None => RATED_SHARE * rated,
            Some(value) => {
                file.take("torque_n_m", flexspline_base::toml_file::real(&above(0.0, rated), value)).unwrap_or(rated)
            }
        };
        let limits = &drive.temperature;
        let temperature_c = match value("temperature_c") {
            None => limits.reference_c,
            Some(value) => file
                .take(
                    "temperature_c",
                    flexspline_base::toml_file::real(&from(limits.minimum_c, limits.maximum_c), value),
                )
                .unwrap_or(limits.reference_c),
        };
        let mut list = Vec::new();
        match value("tolerance") {
            None => file.refuse_whole("tolerance", "missing; give at least one [[tolerance]]".to_owned()),
            Some(value) => {
                let read = each_of(value, "tables [[tolerance]]", |entry| tolerance(entry, &drive));
                list = file.take("tolerance", read).unwrap_or_default();
                if file.is_sound() && !(1..=MOST_TOLERANCES).contains(&list.len()) {
                    let what = format!("found {}, allowed: 1 to {MOST_TOLERANCES}", list.len());
                    file.refuse(value.span(), "tolerance", what);
                }
                let twice = |a: &FieldTolerance, b: &FieldTolerance| {
                    let are_harmonics = matches!(a.acts, ToleranceActs::Harmonic { .. });
                    a.field == b.field && (a.acts == b.acts || !are_harmonics)
                };
                if let Some((k, _)) = list.iter().enumerate().find(|(k, b)| list[..*k].iter().any(|a| twice(a, b))) {
                    let what = format!("found {:?} twice, allowed: once", list[k].field);
                    file.refuse(value.span(), &format!("tolerance[{k}]"), what);
                }
                if file.is_sound() {
                    let spans = value.get_ref().as_array().into_iter().flatten().map(Spanned::span);
                    for (k, span) in spans.enumerate().take(list.len()) {
                        if let Some(what) = limit_without_drive(&drive, &list, k) {
                            file.refuse(span, &format!("tolerance[{k}]"), what);
                        }
                    }
                }
            }
        }
        if file.is_sound() {
            Ok(Tolerances { drive, generators, torque_n_m, temperature_c, list })
        } else {
            Err(refused(file))
        }
    }
}

/// Why a tolerance at one of its limits, the others in their middle, makes no drive; none where both limits do.
fn limit_without_drive(drive: &Drive, list: &[FieldTolerance], k: usize) -> Option<String> {
    let tolerance = &list[k];
    tolerance.distribution.limits.into_iter().find_map(|limit| {
        let mut drawn = Drawn::middle(list);
        drawn[k].value = limit;
        if let ToleranceActs::Teeth { wheel, .. } = tolerance.acts {
            drawn[k].teeth_um = vec![limit; teeth(drive, wheel)];
        }
        let sets = sets(list, &drawn);
        let error = drive.with_sets(sets.iter().map(String::as_str)).err()?;
        Some(format!("{:?} at its limit {limit} makes no drive: {error}", tolerance.field))
    })
}

/// Teeth of a wheel.
pub(super) fn teeth(drive: &Drive, wheel: Wheel) -> usize {
    match wheel {
        Wheel::Flexspline => drive.flexspline.teeth as usize,
        Wheel::CircularSpline => drive.circular_spline.teeth as usize,
    }
}

/// Default load over the rated one: a guess at the usual load of a joint.
const RATED_SHARE: f64 = 0.25;

fn generators(value: &Spanned<DeValue<'_>>) -> Result<Vec<GeneratorKind>, Refused> {
    let known: Vec<(&'static str, GeneratorKind)> =
        GeneratorKind::ALL.into_iter().map(|kind| (kind.name(), kind)).collect();
    match value.get_ref() {
        DeValue::Array(_) => {
            let all = each_of(value, "generators", |one| one_of(&known, one))?;
            let twice = all.iter().enumerate().any(|(k, kind)| all[..k].contains(kind));
            if all.is_empty() || twice {
                return Err(Refused::because(
                    value,
                    "found none or one twice, allowed: different generators".to_owned(),
                ));
            }
            Ok(all)
        }
        DeValue::String(word) if word == "all" => Ok(GeneratorKind::ALL.to_vec()),
        _ => Ok(vec![one_of(&known, value)?]),
    }
}

/// One `[[tolerance]]`.
fn tolerance(entry: &Spanned<DeValue<'_>>, drive: &Drive) -> Result<FieldTolerance, Refused> {
    let table = Entries::of(entry, &TOLERANCE_KEYS)?;
    let field = table.needed("field", text)?;
    let place = |key: &str| -> &Spanned<DeValue<'_>> { table.table.get(key).unwrap_or(entry) };
    let order = table.given("order", |value| whole(&ANY_ORDER, value))?;
    let errors = [("position", TeethError::Position), ("pitch", TeethError::Pitch)];
    let errors_given = table.given("errors", |value| one_of(&errors, value))?;
    let acts = ToleranceActs::of(place("field"), &field, order, errors_given.unwrap_or(TeethError::Position))?;
    if errors_given.is_some() && !matches!(acts, ToleranceActs::Teeth { .. }) {
        let what = format!("errors: found it with {field:?}, allowed: with errors of every tooth alone");
        return Err(Refused::because(place("errors"), what));
    }
    let nominal = match acts {
        ToleranceActs::Alike => nominal(place("field"), drive, &field).map_err(|refused| refused.within(".field"))?,
        _ => 0.0,
    };
    let laws = [("normal", LawName::Normal), ("uniform", LawName::Uniform), ("rayleigh", LawName::Rayleigh)];
    let law = table.needed("distribution", |value| one_of(&laws, value))?;
    let number = |key: &'static str| table.given(key, any);
    let (mean, std, half) = (
        number("mean")?,
        table.given("std", |value| flexspline_base::toml_file::real(&POSITIVE, value))?,
        table.given("plus_minus", |value| flexspline_base::toml_file::real(&POSITIVE, value))?,
    );
    let limits = table.given("limits", |value| {
        let pair = each_of(value, TWO_LIMITS, any)?;
        match pair[..] {
            [low, high] if low < high => Ok([low, high]),
            _ => Err(Refused::found(value, TWO_LIMITS)),
        }
    })?;
    let is_size = !matches!(acts, ToleranceActs::Alike | ToleranceActs::Teeth { .. });
    let wrong = |key: &str, what: &str| Refused::because(place(key), format!("{key}: {what}"));
    if mean.is_some() && (law != LawName::Normal || is_size) {
        return Err(wrong("mean", "allowed: with distribution = \"normal\" of a field that is no size in a direction"));
    }
    if std.is_some() && (half.is_some() || law == LawName::Uniform) {
        return Err(wrong("std", "allowed: with normal or rayleigh, and without plus_minus"));
    }
    let middle = mean.unwrap_or(nominal);
    let missing = |what: &str| Refused::because(entry, format!("found no {what}"));
    let distribution = match law {
        LawName::Normal if is_size => {
            let what = format!(
                "distribution: found \"normal\" for {field:?}, a size in a random direction; allowed: \"rayleigh\" \
                 (both components normal), \"uniform\""
            );
            return Err(Refused::because(place("distribution"), what));
        }
        LawName::Normal => {
            let std = std.or(half.map(|h| h / SIGMAS)).ok_or_else(|| missing("std, nor plus_minus (3 std)"))?;
            let within = half.map_or([middle - FAR * std, middle + FAR * std], |h| [middle - h, middle + h]);
            Distribution { law: DistributionForm::Normal { mean: middle, std }, limits: limits.unwrap_or(within) }
        }
        LawName::Uniform => {
            let around = half.map(|h| if is_size { [0.0, h] } else { [middle - h, middle + h] });
            let limits = limits.or(around).ok_or_else(|| missing("limits, nor plus_minus"))?;
            Distribution { law: DistributionForm::Uniform, limits }
        }
        LawName::Rayleigh if !is_size => {
            let what = format!(
                "distribution: found \"rayleigh\" for {field:?}, which is no size in a direction; allowed: \
                 \"normal\", \"uniform\""
            );
            return Err(Refused::because(place("distribution"), what));
        }
        LawName::Rayleigh => {
            let std = std.ok_or_else(|| missing("std (of each component)"))?;
            Distribution { law: DistributionForm::Rayleigh { std }, limits: limits.unwrap_or([0.0, FAR * std]) }
        }
    };
    // A size is never negative, and part of the distribution has to lie within the limits.
    if is_size && distribution.limits[0] < 0.0 {
        return Err(wrong("limits", "found a size below 0, allowed: 0 or more"));
    }
    let [least, most] = distribution.limits.map(|end| distribution.below(end));
    if most - least < LEAST_INSIDE {
        return Err(wrong("limits", "found limits that the distribution hardly ever keeps, allowed: wider ones"));
    }
    if let Some(what) = distribution.far_from_drive(nominal).filter(|_| matches!(acts, ToleranceActs::Alike)) {
        let key = if mean.is_some() { "mean" } else { "limits" };
        return Err(wrong(key, &format!("{field:?} is {nominal} in the drive, and {what}")));
    }
    Ok(FieldTolerance { field, acts, distribution })
}

/// Share of a distribution that must lie within its limits: below it a quantile has no digits left.
const LEAST_INSIDE: f64 = 1e-6;

/// The number that a field of the drive, named `at` a place, holds.
fn nominal(at: &Spanned<DeValue<'_>>, drive: &Drive, field: &str) -> Result<f64, Refused> {
    let refused = |what| Err(Refused::because(at, what));
    // Every field of a written drive stands on a line of its own, with its section above.
    let written = drive.to_toml();
    let table = match written.parse::<toml::Table>() {
        Ok(table) => table,
        Err(error) => return refused(error.to_string()),
    };
    let found = field.split_once('.').and_then(|(section, key)| table.get(section)?.get(key));
    match found {
        Some(toml::Value::Float(number)) => Ok(*number),
        Some(toml::Value::Integer(_)) => {
            refused(format!("found {field:?}, a whole number, allowed: fields that scatter"))
        }
        Some(other) => {
            refused(format!("found {field:?}, which is {other} in this drive, allowed: a field that is a number"))
        }
        None => {
            let paths: Vec<String> = table
                .iter()
                .filter_map(|(section, keys)| Some((section, keys.as_table()?)))
                .flat_map(|(section, keys)| keys.keys().map(move |key| format!("{section}.{key}")))
                .collect();
            let known: Vec<&str> = paths.iter().map(String::as_str).collect();
            let hint =
                likeliest_path(field, &known).map_or_else(String::new, |meant| format!("; did you mean `{meant}`?"));
            refused(format!("found {field:?}, allowed: a field of the drive, as --set takes it{hint}"))
        }
    }
}
