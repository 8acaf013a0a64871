//! `drive-extended.toml` of a drive known from its catalogue: `nominal.toml` with its numbers as the data have them,
//! and the causes found.
//!
//! ```toml
//! [[extension.cause]]
//! name = "sensor_latency"
//! [extension.cause.parameters]
//! delay_s = 0.002
//! ```
//!
//! A diagnosis also writes `[extension.cause.fit]`: the model of the cause as it was fitted. It predicts what the cause
//! adds as long as the parameters are those of the fit. A cause written by hand, or changed, is simulated from its
//! parameters by [`crate::synthesize`], under the names that `diagnosis.json` gives them.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

use flexspline::FixedMember;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::causes::{CauseName, InTable, OF_THE_OUTPUT_ENCODER, ParameterName as Name};
use crate::diagnosis::base::PlayLaw;
use crate::diagnosis::candidate::LawUnits;
use crate::diagnosis::prepare::Jump;
use crate::diagnosis::report::{Cause, Diagnosis, Parameter};
use crate::diagnosis::{Extended, FittedLaw, added_by};
use crate::measurement::Session;
use crate::nominal::{Harmonic, Nominal, Teeth};
use crate::synthesize::{Effect, EffectError, Sizes, added_arcsec, completed};
use flexspline_base::toml_file::{Entries, Refused, TomlFile, any, each_of, entries_of, one_of, text as text_of};
use flexspline_mechanics::drive::{DriveError, Problem};

/// A cause with the values of its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct CauseEntry {
    /// Its name.
    pub name: CauseName,
    /// Parameters by name; the unit is the end of the name.
    pub parameters: BTreeMap<String, f64>,
    /// The model that was fitted, if the cause comes from a diagnosis.
    pub fit: Option<FittedLaw>,
}

impl CauseEntry {
    /// Whether it is of the encoder at the output, where it may be of either encoder.
    pub(crate) fn at_output(&self) -> bool {
        self.parameters.get(Name::Encoder.as_str()) == Some(&1.0)
    }

    /// Whether the output's encoder is wrong, and not the joint.
    pub(crate) fn of_output_encoder(&self) -> bool {
        match self.name.spec().in_table {
            InTable::Yes => self.at_output(),
            InTable::No(why) => why == OF_THE_OUTPUT_ENCODER,
            InTable::AtOneOrientation => false,
        }
    }
}

/// A nominal model with causes.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The nominal model.
    pub nominal: Nominal,
    /// Causes found in addition.
    pub causes: Vec<CauseEntry>,
}

impl Model {
    /// Reads `nominal.toml` or `drive-extended.toml`.
    ///
    /// # Errors
    /// The file cannot be read; or every problem found, as [`Nominal::from_toml`] names them.
    pub fn read(path: &Path) -> Result<Model, DriveError> {
        Model::read_hashed(path).map(|(model, _)| model)
    }

    /// The same with the BLAKE3 of the file.
    ///
    /// # Errors
    /// As [`Model::read`].
    pub(crate) fn read_hashed(path: &Path) -> Result<(Model, [u8; 32]), DriveError> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| {
            let problem = Problem { place: file.clone(), field: String::new(), what: error.to_string() };
            DriveError { problems: vec![problem] }
        })?;
        Ok((Model::from_toml(&file, &text)?, *blake3::hash(text.as_bytes()).as_bytes()))
    }

    /// The model in the text of such a file.
    ///
    /// # Errors
    /// Every problem found, each with file, field, value found and what is allowed.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Model, DriveError> {
        let nominal = Nominal::from_toml(file_name, text)?;
        let causes = causes_in(file_name, text)?;
        Ok(Model { nominal, causes })
    }

    /// The nominal model recalibrated, with the causes of a diagnosis as they were fitted.
    #[must_use]
    pub(crate) fn of_diagnosis(nominal: &Nominal, diagnosis: &Diagnosis, fitted: &Extended) -> Model {
        let of = |cause: &Cause| CauseEntry::of(cause.name, &cause.parameters).fitted_by(fitted, nominal);
        let causes = diagnosis.causes.iter().map(of).collect();
        let change = |name: &str| diagnosis.recalibrated.get(name).map_or(0.0, |p| p.value);
        let mut nominal = nominal.clone();
        // A relative change of the wind-up is the inverse one of the stiffness.
        nominal.stiffness.iter_mut().for_each(|[_, k]| *k /= (1.0 + change("stiffness")).max(0.05));
        nominal.backlash_arcsec *= (1.0 + change("backlash")).max(0.0);
        if nominal.spread.harmonic > 0.0 {
            // In phase and in quadrature, one pair for each harmonic that has an amplitude.
            let changes = numbered(&diagnosis.recalibrated, "harmonic");
            let waves = nominal.harmonics.iter_mut().filter(|h| h.amplitude_arcsec != 0.0);
            for (harmonic, pair) in waves.zip(changes.chunks_exact(2)) {
                let (along, across) = (1.0 + pair[0], pair[1]);
                harmonic.amplitude_arcsec *= along.hypot(across);
                harmonic.phase_rad += across.atan2(along);
            }
        }
        Model { nominal, causes }
    }

    /// Sum of the causes in the error of each session, arcsec: by the models that were fitted where the causes have
    /// them, and by [`crate::synthesize`] where they have none.
    ///
    /// # Errors
    /// A parameter that does not fit the sessions.
    pub(crate) fn added_arcsec(&self, sessions: &[Session], sizes: Sizes) -> Result<Vec<Vec<f64>>, EffectError> {
        let fitted: Vec<(CauseName, &FittedLaw)> =
            self.causes.iter().filter_map(|cause| Some((cause.name, cause.fit.as_ref()?))).collect();
        let by_fit = added_by(&fitted, sessions, &self.nominal);
        let simulated = |cause: &&CauseEntry| by_fit.is_none() || cause.fit.is_none();
        let effects: Vec<Effect> = self.causes.iter().filter(simulated).filter_map(CauseEntry::effect).collect();
        let mut added = by_fit.unwrap_or_else(|| sessions.iter().map(|session| vec![0.0; session.len()]).collect());
        if !effects.is_empty() {
            let motion = completed(sessions, 100.0, self.nominal.temperature_c);
            let more = added_arcsec(&self.nominal, sizes, &effects, &motion)?;
            // A session of one row has no motion to simulate.
            let rows = added.iter_mut().filter(|session| session.len() > 1).flatten();
            rows.zip(more).for_each(|(sum, more)| *sum += more);
        }
        Ok(added)
    }

    /// The file.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let n = &self.nominal;
        let drive = match n.teeth {
            Some(Teeth { flexspline, circular_spline, fixed }) => {
                let fixed = if fixed == FixedMember::Flexspline { "flexspline" } else { "circular_spline" };
                format!(
                    "flexspline_teeth = {flexspline}\ncircular_spline_teeth = {circular_spline}\nfixed = \"{fixed}\""
                )
            }
            None => format!("ratio = {:?}", n.ratio),
        };
        let steps = n.stiffness.iter().map(|[torque, k]| format!("[{torque:?}, {k:?}]")).collect::<Vec<_>>().join(", ");
        let harmonic = |h: &Harmonic| {
            format!(
                "\n[[nominal.harmonic]]\norder_per_generator_turn = {:?}\namplitude_arcsec = {:?}\nphase_rad = {:?}\n",
                h.order_per_generator_turn, h.amplitude_arcsec, h.phase_rad
            )
        };
        let (harmonics, s) = (n.harmonics.iter().map(harmonic).collect::<String>(), n.spread);
        format!(
            "[drive]\n{drive}\n\n[nominal]\nstiffness_n_m_per_rad = [{steps}]\nbacklash_arcsec = \
             {:?}\nfriction_torque_n_m = {:?}\ntemperature_c = \
             {:?}\n{harmonics}\n[nominal.unit_to_unit]\nstiffness = {:?}\nbacklash = {:?}\nharmonic = {:?}\n{}",
            n.backlash_arcsec,
            n.friction_torque_n_m,
            n.temperature_c,
            s.stiffness,
            s.backlash,
            s.harmonic,
            causes_to_toml(&self.causes)
        )
    }
}

/// The causes in the part `[extension]` of a file, a drive's or a model's.
///
/// # Errors
/// An error and its line.
pub fn causes_in(file_name: &str, text: &str) -> Result<Vec<CauseEntry>, DriveError> {
    let mut file = TomlFile::new(file_name, text);
    let causes = file.parse().map_or_else(Vec::new, |table| causes_of(&mut file, &table));
    if file.is_sound() { Ok(causes) } else { Err(DriveError { problems: file.problems() }) }
}

fn causes_of(file: &mut TomlFile<'_>, table: &DeTable<'_>) -> Vec<CauseEntry> {
    let Some(extension) = table.get("extension").and_then(|_| file.section(table, "extension")) else {
        return Vec::new();
    };
    for key in extension.keys().filter(|key| key.get_ref() != "cause") {
        let field = extension.path(key.get_ref());
        file.refuse(key.span(), &field, "unknown key; allowed: cause".to_owned());
    }
    let known: Vec<(&'static str, CauseName)> = CauseName::ALL.iter().map(|cause| (cause.as_str(), *cause)).collect();
    let causes = extension.each(file, "cause", |entry| {
        let cause = Entries::of(entry, &["name", "parameters", "fit"])?;
        let name = cause.needed("name", |v| one_of(&known, v))?;
        let parameters: BTreeMap<String, f64> = cause.given("parameters", |v| entries_of(v, any))?.unwrap_or_default();
        let fit = cause.given("fit", fit_of)?.filter(|(of, _)| *of == fingerprint(&parameters)).map(|(_, fit)| fit);
        let cause = CauseEntry { name, parameters, fit };
        cause.checked_effect().map_err(|error| Refused::because(entry, error.to_string()))?;
        Ok(cause)
    });
    causes.unwrap_or_default()
}

/// The part `[extension]` of a file; nothing without causes.
pub fn causes_to_toml(causes: &[CauseEntry]) -> String {
    let mut text = String::new();
    for cause in causes {
        let _ = writeln!(text, "\n[[extension.cause]]\nname = \"{}\"\n[extension.cause.parameters]", cause.name);
        for (name, value) in &cause.parameters {
            let _ = writeln!(text, "{name} = {value:?}");
        }
        if let Some(fit) = &cause.fit {
            write_fit(&mut text, fit, &cause.parameters);
        }
    }
    text
}

/// A hash of the parameters: those of a fit have that of the fit.
fn fingerprint(parameters: &BTreeMap<String, f64>) -> String {
    let mut hash = blake3::Hasher::new();
    for (name, value) in parameters {
        hash.update(name.as_bytes());
        hash.update(&value.to_bits().to_le_bytes());
    }
    hash.finalize().to_hex()[..16].to_owned()
}

/// A number of [`LawUnits`] and its name in a file.
type ScaleField = (&'static str, fn(&mut LawUnits) -> &mut f64);

const SCALES: [ScaleField; 6] = [
    ("load_n_m", |s| &mut s.load),
    ("mean_speed_rad_s", |s| &mut s.mean_speed),
    ("begin_s", |s| &mut s.begin_s),
    ("duration_s", |s| &mut s.duration_s),
    ("travel_rad", |s| &mut s.travel),
    ("arcsec_per_um", |s| &mut s.arcsec_per_um),
];

fn write_fit(text: &mut String, fit: &FittedLaw, parameters: &BTreeMap<String, f64>) {
    let mut units = fit.scales.clone();
    let counted_in = SCALES.map(|(name, of)| format!("{name} = {:?}", of(&mut units))).join(", ");
    let jump = |jump: &Jump| {
        let [begin, half, over] = jump.time_s;
        format!("{:?}", [begin, half, over, jump.height_arcsec])
    };
    let jumps = fit.scales.jumps.iter().map(jump).collect::<Vec<String>>().join(", ");
    text.push_str(
        "# The model of this cause as it was fitted. It counts as long as the parameters above are not changed.\n\
         [extension.cause.fit]\n",
    );
    let values = [
        format!("{:?}", fingerprint(parameters)),
        format!("{:?}", fit.variant),
        format!("{:?}", fit.play.as_str()),
        format!("{:?}", fit.beside[0]),
        format!("{:?}", fit.beside[1]),
        format!("{:?}", fit.shape),
        format!("{:?}", fit.coefficients),
        format!("{{ {counted_in} }}"),
        format!("[{jumps}]"),
    ];
    for (name, value) in FIT.iter().zip(values) {
        let _ = writeln!(text, "{name} = {value}");
    }
}

/// Fields of a fit.
const FIT: [&str; 9] =
    ["of", "variant", "play", "stiffness_n_m_per_rad", "backlash_arcsec", "shape", "coefficients", "scales", "jumps"];

/// A fit, and the fingerprint of the parameters that it belongs to.
fn fit_of(value: &Spanned<DeValue<'_>>) -> Result<(String, FittedLaw), Refused> {
    let fit = Entries::of(value, &FIT)?;
    let numbers = |v: &Spanned<DeValue<'_>>| each_of(v, "[ numbers ]", any);
    let mut scales = LawUnits::default();
    let given = fit.needed("scales", |v| entries_of(v, any))?;
    for (name, of) in SCALES {
        *of(&mut scales) = *given
            .get(name)
            .ok_or_else(|| Refused::because(value, format!("scales.{name}: missing; give a number")))?;
    }
    for jump in fit.given("jumps", |v| each_of(v, "[ jumps ]", numbers))?.unwrap_or_default() {
        let &[begin, half, over, height_arcsec] = jump.as_slice() else {
            return Err(Refused::because(value, format!("found a jump of {} numbers, allowed: 4", jump.len())));
        };
        scales.jumps.push(Jump { time_s: [begin, half, over], height_arcsec });
    }
    let law = FittedLaw {
        variant: fit.needed("variant", text_of)?,
        play: fit.needed("play", |v| one_of(&PlayLaw::ALL.map(|play| (play.as_str(), play)), v))?,
        shape: fit.needed("shape", numbers)?,
        coefficients: fit.needed("coefficients", numbers)?,
        beside: [fit.needed("stiffness_n_m_per_rad", any)?, fit.needed("backlash_arcsec", any)?],
        scales,
    };
    Ok((fit.needed("of", text_of)?, law))
}

/// Values of `name`, `name 4`, `name 5`, ... in the order of their numbers.
fn numbered(parameters: &BTreeMap<String, Parameter>, name: &str) -> Vec<f64> {
    let mut found: Vec<(usize, f64)> = parameters
        .iter()
        .filter_map(|(key, p)| {
            let rest = key.strip_prefix(name)?;
            let number = if rest.is_empty() { 0 } else { rest.trim().parse().ok()? };
            Some((number, p.value))
        })
        .collect();
    found.sort_by_key(|(number, _)| *number);
    found.into_iter().map(|(_, value)| value).collect()
}

impl CauseEntry {
    /// A cause with the parameters that were found.
    #[must_use]
    pub(crate) fn of(name: CauseName, parameters: &BTreeMap<&'static str, Parameter>) -> CauseEntry {
        let parameters = parameters.iter().map(|(name, found)| ((*name).to_owned(), found.value)).collect();
        CauseEntry { name, parameters, fit: None }
    }

    /// The cause with the model that was fitted, for a nominal model.
    #[must_use]
    pub(crate) fn fitted_by(self, extended: &Extended, nominal: &Nominal) -> CauseEntry {
        let at = extended.causes().iter().position(|cause| cause.name() == self.name);
        CauseEntry { fit: at.and_then(|at| extended.fitted_law(at, nominal)), ..self }
    }

    /// The effect that simulates it, if there is one.
    #[must_use]
    pub fn effect(&self) -> Option<Effect> {
        self.checked_effect().ok()
    }

    fn checked_effect(&self) -> Result<Effect, EffectError> {
        let twice = [Name::AmplitudeUm, Name::DepthUm, Name::Tooth, Name::GeneratorAmplitudeArcsec];
        let given = |name: Name| self.parameters.get(name.as_str()).copied();
        let known = given(Name::AmplitudeArcsec).or(given(Name::AngleRad)).is_some();
        Effect::of_cause(self.name, |name| match name {
            // Of two forms of the same, the one in arc-seconds and radians.
            name if known && twice.contains(&name) => None,
            Name::PhaseRad => Some(given(name)?.rem_euclid(TAU)),
            Name::Wheel | Name::Harmonic => Some(given(name)?.round()),
            _ => given(name),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesize::catalogue_drive;

    fn model() -> Model {
        let entry = |name: CauseName, parameters: &[(&str, f64)]| CauseEntry {
            name,
            parameters: parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
            fit: None,
        };
        Model {
            nominal: catalogue_drive(),
            causes: vec![
                entry(CauseName::SensorLatency, &[("delay_s", 0.0021)]),
                entry(
                    CauseName::FlexsplineRunout,
                    &[("amplitude_arcsec", 31.0), ("amplitude_um", 7.0), ("phase_rad", 3.0), ("half_load_n_m", 9.0)],
                ),
            ],
        }
    }

    #[test]
    fn what_is_written_reads_back_the_same() {
        let model = model();
        assert_eq!(Model::from_toml("d.toml", &model.to_toml()).unwrap(), model);
        let effects: Vec<Effect> = model.causes.iter().filter_map(CauseEntry::effect).collect();
        assert_eq!(effects.len(), 2);
        assert_eq!(effects[0].given(Name::DelayS), Some(0.0021));
        assert_eq!((effects[1].given(Name::AmplitudeArcsec), effects[1].given(Name::AmplitudeUm)), (Some(31.0), None));
    }

    #[test]
    fn a_wrong_extension_is_refused_by_field_and_value() {
        let text = model().to_toml();
        for (from, to, message) in [
            (
                "sensor_latency",
                "sensor_lag",
                "d.toml:28: extension.cause[0].name: found \"sensor_lag\", allowed: \"circ",
            ),
            (
                "delay_s = 0.0021",
                "delay_s = \"old\"",
                "d.toml:30: extension.cause[0].parameters.delay_s: found \"old\", allowed: a number",
            ),
            (
                "[extension.cause.parameters]",
                "[extension.cause.numbers]",
                "d.toml:29: extension.cause[0].numbers: unknown key; allowed: name, parameters, fit",
            ),
        ] {
            let error = Model::from_toml("d.toml", &text.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.starts_with(message), "{to}: {error}");
        }
    }

    #[test]
    fn harmonics_take_the_changes_of_their_own() {
        let parameter = |value| Parameter { value, std: 0.0 };
        let recalibrated: BTreeMap<String, Parameter> =
            [("backlash", 9.0), ("harmonic", 0.1), ("harmonic 4", 0.2), ("harmonic 10", 0.4), ("harmonic 5", 0.3)]
                .map(|(name, value)| (name.to_owned(), parameter(value)))
                .into();
        assert_eq!(numbered(&recalibrated, "harmonic"), [0.1, 0.2, 0.3, 0.4]);
    }
}
