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
use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

use crate::causes::{CauseName, InTable, OF_THE_OUTPUT_ENCODER, ParameterName as Name};
use crate::diagnosis::report::{Cause, Diagnosis, Parameter};
use crate::diagnosis::{Extended, FittedLaw, added_by};
use crate::measurement::Session;
use crate::nominal::{Harmonic, Nominal, Teeth};
use crate::synthesize::{Effect, EffectError, Sizes, added_arcsec, completed};
use flexspline_base::toml_file::{Entries, Refused, TomlFile, any, entries_of, one_of};
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
    pub(crate) fn of_diagnosis(nominal: &Nominal, diagnosis: &Diagnosis, fitted: &Extended) -> Model {
        let of = |cause: &Cause| {
            let entry = CauseEntry::of(cause.name, &cause.parameters);
            CauseEntry { fit: fitted.fitted_law(cause.name, nominal, fingerprint(&entry.parameters)), ..entry }
        };
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
            // What any drive may have is known of this one, and a file holds no larger share.
            s.stiffness.min(1.0),
            s.backlash.min(1.0),
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
        let fit = cause.given("fit", fit_of)?.filter(|fit| fit.of == fingerprint(&parameters));
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
            let fit = toml::to_string(fit).expect("names and numbers");
            text += "# The model of this cause as it was fitted. It counts as long as the parameters above are not \
                     changed.\n[extension.cause.fit]\n";
            text += &fit.replace("[scales]", "[extension.cause.fit.scales]");
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

/// A fit.
fn fit_of(value: &Spanned<DeValue<'_>>) -> Result<FittedLaw, Refused> {
    FittedLaw::deserialize(ValueDeserializer::from(value.clone()))
        .map_err(|error| Refused::because(value, error.message().to_owned()))
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
    pub(crate) fn of(name: CauseName, parameters: &BTreeMap<&'static str, Parameter>) -> CauseEntry {
        let parameters = parameters.iter().map(|(name, found)| ((*name).to_owned(), found.value)).collect();
        CauseEntry { name, parameters, fit: None }
    }

    /// The effect that simulates it, if there is one.
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
        let mut model = model();
        model.nominal.spread.stiffness = 1.0;
        let text = model.to_toml();
        assert_eq!(Model::from_toml("d.toml", &text).unwrap(), model);
        model.nominal.spread.stiffness = 40.0;
        assert_eq!(model.to_toml(), text, "a spread that is as good as none");
        let effects: Vec<Effect> = model.causes.iter().filter_map(CauseEntry::effect).collect();
        assert_eq!(effects.len(), 2);
        assert_eq!(effects[0].given(Name::DelayS), Some(0.0021));
        assert_eq!((effects[1].given(Name::AmplitudeArcsec), effects[1].given(Name::AmplitudeUm)), (Some(31.0), None));
    }

    #[test]
    fn a_fit_in_one_line_or_in_tables_is_the_same_and_belongs_to_its_parameters() {
        let mut model = model();
        model.causes.truncate(1);
        let fit = format!(
            "[extension.cause.fit]\nof = {:?}\nvariant = \"\"\nplay = \"pushed\"\nstiffness_n_m_per_rad = \
             30000\nbacklash_arcsec = 60.0\nshape = []\ncoefficients = [0.0021, -1e-9]\nscales = {{ load_n_m = 12.5, \
             mean_speed_rad_s = 3.0, begin_s = 0.0, duration_s = 9.0, travel_rad = 40.0, arcsec_per_um = 4.2 }}\njumps \
             = [[1.0, 1.5, 2.0, 6800.0]]\n",
            fingerprint(&model.causes[0].parameters)
        );
        let text = model.to_toml() + &fit;
        let read = |text: &str| Model::from_toml("d.toml", text);
        let known = read(&text).unwrap();
        assert!(known.causes[0].fit.is_some());
        assert_eq!(read(&known.to_toml()), Ok(known));
        assert!(read(&text.replace("0.0021\n", "0.003\n")).unwrap().causes[0].fit.is_none());
        for (from, to, message) in [
            ("begin_s = 0.0, ", "", "extension.cause[0].fit: missing field `begin_s`"),
            (
                "\"pushed\"",
                "\"pulled\"",
                "unknown variant `pulled`, expected one of `held`, `pushed`, `sign`, `smooth`",
            ),
        ] {
            let error = read(&text.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
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
