//! From a file of measured rows to a verdict, the extended drive and its tables: what the command `diagnose` computes.
//!
//! ```text
//! file -> Recording -> less what the model knows -> diagnose -> Diagnosis, Extended
//!                                                                            |
//!         tables worth it? <- evaluate (sessions held out, read by the core) +-> drive-extended.toml
//! ```
//!
//! [`Subject`] is what the rows are held against. [`parse_rows`] and [`diagnose_rows`] come to the verdict;
//! [`Diagnosed::extend`] makes the extended drive and its tables. Nothing is printed or written here.

use std::sync::Arc;

use blake3::Hash;
use flexspline::{ImageError, Table};
use serde::Serialize;
use thiserror::Error;

use super::base::WAVE_OF_LOAD;
use super::report::{Cause, Diagnosis};
use super::{DiagnosisError, Extended, Settings, diagnose};
use super::{channels, zeros};
use crate::calibrate::{CalibrationError, LEAST_GAIN, MOST_ERROR_RAD, Prior, calibrated_table, check_ratio_of};
use crate::causes::{CauseName, OF_THE_OUTPUT_ENCODER};
use crate::extension::{
    CauseEntry, Evaluation, ExtendedTables, Model, TableKind, causes_to_toml, evaluate, found_geometry, less,
};
use crate::known_rows::parse_known;
use crate::measurement::{
    ColumnMap, Fault, FaultName, MeasuredError, Quantity, Recording, Session, Treatment, least_and_most, parse,
};
use crate::nominal::{NoSuchWheels, Nominal};
use crate::synthesize::{EffectError, Sizes};
use flexspline_design::kernels::Kernels;
use flexspline_design::tables::{MadeTable, TableError, c_header, rust_source};
use flexspline_mechanics::drive::{Drive, DriveError, GeneratorKind};

/// A drive that is known from its catalogue, as tables name it.
const CATALOGUE_DRIVE: &str = "catalogue drive";
/// Rows that are diagnosed at most. *Chosen* for the memory that they take, 1.5 GB.
const MOST_ROWS: usize = 1_000_000;

/// Why first waves of the output are no cause's.
const GOES_WITH_OUTPUT: &str = "the load goes with the angle of the output, as the weight of an arm does: wind-up and \
                                one wave in a turn of the output are one here, and no cause of such a wave is named; \
                                record other loads at the same angles, or give the stiffness (--model)";
/// Advice where an error leaps so often that no row counts.
const IS_IT_THIS_DRIVE: &str = "see that ratio, units and zeros of both angles are right and that the rows are of \
                                this drive; record it under a load that keeps one flank";

/// Why a file was not diagnosed, or what was found not extended.
#[derive(Debug, Error)]
pub enum PipelineError {
    /// The bytes are no table.
    #[error("{0}")]
    Image(ImageError),
    /// The table is of another drive.
    #[error(
        "the table was made from the drive with BLAKE3 {of}, and --drive {drive} has {given}; give the drive that \
         made the table, with every --set"
    )]
    OtherDrive {
        /// Hash in the table.
        of: String,
        /// The drive given.
        drive: String,
        /// Its hash.
        given: String,
    },
    /// The kernels are of another drive or generator.
    #[error(
        "found kernels of the {found} of the drive with BLAKE3 {found_of}, allowed: those of the {kind} of {of}, as \
         the table's"
    )]
    OtherKernels {
        /// Their generator.
        found: GeneratorKind,
        /// Their drive.
        found_of: String,
        /// The table's generator.
        kind: GeneratorKind,
        /// The table's drive.
        of: String,
    },
    /// The rows cannot be read.
    #[error(transparent)]
    Read(#[from] MeasuredError),
    /// What the model knows already does not fit the rows.
    #[error(transparent)]
    Known(EffectError),
    /// The rows cannot be diagnosed.
    #[error(transparent)]
    Diagnosis(#[from] DiagnosisError),
    /// The causes make no drive.
    #[error("the causes make no drive: {0}")]
    NoDrive(#[from] DriveError),
    /// The samples make no table.
    #[error(transparent)]
    Table(#[from] TableError),
    /// No table can be of the ratio.
    #[error(transparent)]
    Wheels(#[from] NoSuchWheels),
    /// A calibration of the rows makes no table, or they turn by another ratio.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

impl PipelineError {
    /// Whether the input is to blame, and not the run.
    pub fn is_bad_input(&self) -> bool {
        match self {
            PipelineError::Calibration(error) => error.is_bad_input(),
            PipelineError::NoDrive(_) | PipelineError::Table(_) | PipelineError::Wheels(_) => false,
            _ => true,
        }
    }
}

/// Names of causes that a model holds, and what these add to the error of each row of each session, arcsec.
type Known = Option<(String, Vec<Vec<f64>>)>;

/// What measured rows are held against: a catalogue's model, or a table made by FEM; and the drive.
pub struct Subject<'a> {
    /// Nominal model.
    pub nominal: Nominal,
    /// The table that takes its place in the prediction.
    pub table: Option<Table<'a>>,
    /// The model with the causes that it holds already.
    pub model: Option<Model>,
    /// The drive.
    pub drive: Drive,
    /// Its generator.
    pub kind: GeneratorKind,
    /// What was taken for known of it, where the rows themselves say the rest.
    note: Option<String>,
}

impl<'a> Subject<'a> {
    /// A drive known from its catalogue, or extended before.
    pub fn of_model(model: Model, drive: Drive, kind: GeneratorKind) -> Subject<'static> {
        Subject { nominal: model.nominal.clone(), table: None, model: Some(model), drive, kind, note: None }
    }

    /// A drive known by its ratio: wind-up and backlash are those that a calibration of the same rows finds, so that no
    /// name stands on a guess of them. `bytes` of a log called `file`.
    ///
    /// # Errors
    /// No gear has this ratio; the rows cannot be read, or make no table.
    pub fn of_ratio(
        ratio: f64,
        (drive, kind): (Drive, GeneratorKind),
        (file, bytes, columns): (&str, Vec<u8>, &ColumnMap),
    ) -> Result<Subject<'static>, PipelineError> {
        let prior = Prior::of_given_ratio(ratio, kind)?;
        let log = parse_known(file, bytes, columns, &prior.nominal, None)?;
        let made = calibrated_table(&[log], &prior)?;
        let table = Table::check(&made.image).map_err(PipelineError::Image)?;
        let nominal = Nominal::of_table_by_ratio(&table, ratio);
        let waves = nominal.harmonics.iter().map(|of| format!("{:.1}", of.amplitude_arcsec));
        let note = format!(
            "the ratio alone was given: 2 and 4 waves in a turn of the generator, and on the wheel that turns, of {} \
             arcsec, count as the gear's own, which every strain wave gear has; an encoder of the generator that is \
             tilted makes the same",
            waves.collect::<Vec<String>>().join(", ")
        );
        let subject = Subject::of_model(Model { nominal, causes: Vec::new() }, drive, kind);
        Ok(Subject { note: Some(note), ..subject })
    }

    /// A drive with its table.
    ///
    /// # Errors
    /// The bytes are no table, or that of another drive.
    pub fn of_table(image: &'a [u8], drive: Drive, kind: GeneratorKind) -> Result<Subject<'a>, PipelineError> {
        let table = Table::check(image).map_err(PipelineError::Image)?;
        if table.drive_hash() != drive.hash() {
            let hex = |hash| Hash::from(hash).to_hex().to_string();
            let (of, given) = (hex(table.drive_hash()), hex(drive.hash()));
            return Err(PipelineError::OtherDrive { of, drive: drive.name, given });
        }
        Ok(Subject { nominal: Nominal::of_table(&table), table: Some(table), model: None, drive, kind, note: None })
    }

    /// With the influence kernels of the drive.
    ///
    /// # Errors
    /// They are those of another drive or generator.
    pub fn with_kernels(mut self, kernels: Kernels) -> Result<Subject<'a>, PipelineError> {
        let of = Hash::from(self.drive.hash()).to_hex().to_string();
        if kernels.drive_blake3 != of || kernels.generator != self.kind {
            let (found, found_of) = (kernels.generator, kernels.drive_blake3);
            return Err(PipelineError::OtherKernels { found, found_of, kind: self.kind, of });
        }
        self.nominal.kernels = Some(Arc::new(kernels));
        Ok(self)
    }

    /// BLAKE3 of what made the nominal model: the drive, or the model itself.
    fn hash(&self) -> [u8; 32] {
        let model = || self.model.as_ref().map_or_else(String::new, Model::to_toml);
        if self.table.is_some() { self.drive.hash() } else { *blake3::hash(model().as_bytes()).as_bytes() }
    }

    /// The model, if it holds causes that were found before.
    fn extended(&self) -> Option<&Model> {
        self.model.as_ref().filter(|model| !model.causes.is_empty())
    }

    /// What those of that model's causes that are `wanted` add to the error of each session, arcsec, with their names.
    fn known_arcsec(&self, recording: &Recording, wanted: fn(&CauseEntry) -> bool) -> Result<Known, PipelineError> {
        let Some(mut model) = self.extended().cloned() else { return Ok(None) };
        model.causes.retain(wanted);
        if model.causes.is_empty() {
            return Ok(None);
        }
        let added = model.added_arcsec(&recording.sessions, Sizes::of(&self.drive)).map_err(PipelineError::Known)?;
        let names: Vec<&str> = model.causes.iter().map(|cause| cause.name.as_str()).collect();
        Ok(Some((names.join(", "), added)))
    }

    /// Rows as they were measured, what was known before among their errors, but for errors of the output's encoder.
    fn as_measured(&self, recording: &Recording) -> Result<Option<Recording>, PipelineError> {
        let of_the_joint = |cause: &CauseEntry| !cause.of_output_encoder();
        let Some((_, mut added)) = self.known_arcsec(recording, of_the_joint)? else { return Ok(None) };
        added.iter_mut().flatten().for_each(|added| *added = -*added);
        let mut recording = recording.clone();
        less(&mut recording.sessions, added.iter());
        Ok(Some(recording))
    }

    /// The table of a model that holds causes, for a calibration of these recordings to begin with; none of another.
    /// Errors of the output's encoder, which has no place in a table, are taken from the recordings, and noted, unless
    /// whose error it is will be `split`.
    ///
    /// # Errors
    /// It makes no table, or does not fit the recordings.
    pub fn known_before(&self, files: &mut [Recording], split: bool) -> Result<Option<MadeTable>, PipelineError> {
        for file in files.iter_mut().filter(|_| !split) {
            let Some((names, added)) = self.known_arcsec(file, CauseEntry::of_output_encoder)? else { continue };
            less(&mut file.sessions, added.iter());
            file.notes.push(format!(
                "{}: the model's {names} is taken from the rows and not in the table: {OF_THE_OUTPUT_ENCODER}",
                file.file
            ));
        }
        self.known_table(files)
    }

    /// The table of a model that holds causes, over the loads and temperatures of these recordings; none of another.
    ///
    /// # Errors
    /// It makes no table.
    fn known_table(&self, files: &[Recording]) -> Result<Option<MadeTable>, PipelineError> {
        let made = |_| tables_of(self, files).nominal(None);
        self.extended().map(made).transpose()
    }

    /// What a calibration of the same rows begins with: the table given, that of causes known before, or the model.
    fn prior<'t>(&'t self, known: Option<&'t Table<'t>>) -> Prior<'t> {
        match known.or(self.table.as_ref()) {
            Some(table) => Prior::of_table(table, self.kind),
            None => Prior { hash: self.hash(), ..Prior::of_nominal(self.nominal.clone(), CATALOGUE_DRIVE, self.kind) },
        }
    }

    fn against(&self) -> (&Nominal, Option<&Table<'a>>) {
        (&self.nominal, self.table.as_ref())
    }
}

/// Measured rows with all that is said of them.
pub struct Diagnosed {
    /// The rows, what the model knew taken away.
    pub recording: Recording,
    /// The verdict; its compensation is what the core leaves in sessions held out.
    pub diagnosis: Diagnosis,
    /// The extended model.
    pub extended: Extended,
    /// The table of the causes known before.
    known_table: Option<MadeTable>,
    /// Compensation by session held out.
    pub evaluation: Evaluation,
}

/// Reads rows, takes away what the model knows already, and averages rows that are too many: `bytes` of a file called
/// `file`. The friction of the play that the rows show takes the place of the subject's.
///
/// # Errors
/// The rows cannot be read, or do not fit what the model knows.
pub fn parse_rows(
    file: &str,
    bytes: impl Into<Vec<u8>>,
    columns: &ColumnMap,
    subject: &mut Subject<'_>,
) -> Result<Recording, PipelineError> {
    let mut recording = parse(file, bytes, columns, &subject.nominal.gear())?;
    recording.notes.extend(subject.note.clone());
    recording.notes.extend(check_ratio_of(&recording, subject.nominal.ratio, MOST_ERROR_RAD)?);
    if let Some((names, added)) = subject.known_arcsec(&recording, |_| true)? {
        less(&mut recording.sessions, added.iter());
        recording.notes.push(format!("the model holds {names} already; what is found is beyond that"));
    }
    let (nominal, table) = subject.against();
    channels::check_degrees(&mut recording, columns, nominal)?;
    recording.unusable = channels::check_torque(&mut recording, nominal, table);
    if recording.unusable.is_none() {
        channels::take_friction(&mut recording, &mut subject.nominal, subject.table.as_ref());
        // The zero is where the output changes its flank, if it is known from elsewhere how friction shifts that.
        let (nominal, table) = subject.against();
        if table.is_some() || nominal.friction_torque_n_m > 0.0 && subject.note.is_none() {
            channels::check_zero(&mut recording, nominal, table);
        }
    }
    recording.average_to(MOST_ROWS);
    Ok(recording)
}

/// Diagnoses rows, and says what the core leaves of their error with tables of what was found.
/// `progress(done, of, what)` is called with how far it is.
///
/// # Errors
/// The rows cannot be diagnosed; a table that was to be made by FEM was not.
pub fn diagnose_rows(
    mut recording: Recording,
    subject: &Subject<'_>,
    settings: &Settings<'_>,
    mut progress: impl FnMut(usize, usize, &str),
) -> Result<Diagnosed, PipelineError> {
    let pitch_radius_mm = subject.drive.circular_spline.pitch_radius_mm();
    let settings = Settings { pitch_radius_mm, ..*settings };
    let (nominal, table) = subject.against();
    let (mut diagnosis, extended) =
        diagnose(&recording.sessions, nominal, table, &settings, |done, of, what| progress(done, of + 1, what))?;
    zeros::tell(&mut recording, &diagnosis.zeros);
    recording.notes.extend(diagnosis.recalibrated.contains_key(WAVE_OF_LOAD).then(|| GOES_WITH_OUTPUT.to_owned()));
    diagnosis.fitted_faults.iter().for_each(|fault| zeros::tell_fitted(&mut recording, fault));
    if recording.unusable.is_some() {
        // What makes them unusable is a channel that had to be left out.
        let masked = |fault: &&Fault| fault.treatment == Treatment::Masked && fault.channel == Some(Quantity::Torque);
        let advice =
            recording.faults.iter().rfind(masked).map_or(FaultName::TorqueScale.advice(), |fault| fault.advice);
        diagnosis.say_nothing_of_the_unit(advice);
    } else if let Some(why) = diagnosis.set_aside.take() {
        recording.notes.push(why.clone());
        recording.unusable = Some(why);
        diagnosis.say_nothing_of_the_unit(IS_IT_THIS_DRIVE);
    }
    progress(4, 5, "compensation by the core");
    let measured = subject.as_measured(&recording)?;
    // A model whose causes make no table predicts all the same.
    let known_table = subject.known_table(std::slice::from_ref(&recording)).unwrap_or_else(|error| {
        recording.notes.push(format!("the causes known before make no table: {error}"));
        None
    });
    let known = known_table.as_ref().map(|made| Table::check(&made.image)).transpose().map_err(PipelineError::Image)?;
    let tables = tables_of(subject, std::slice::from_ref(&recording));
    let causes: Vec<CauseName> = diagnosis.causes.iter().map(|cause| cause.name).collect();
    let rows = [&recording, measured.as_ref().unwrap_or(&recording)];
    let (found, prior) = ((&extended, causes.as_slice()), subject.prior(known.as_ref()));
    let evaluation = evaluate(rows, found, &tables, &prior);
    diagnosis.compensated(&evaluation);
    Ok(Diagnosed { recording, diagnosis, extended, known_table, evaluation })
}

/// The table that a diagnosis ends in.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WrittenTable {
    /// What it was made of.
    pub kind: TableKind,
    /// Its image beside `diagnosis.json`.
    pub file: Option<String>,
    /// What it leaves in rows left out of the fit, or the least that is left without it, arcsec rms.
    pub rms_left_out_arcsec: f64,
    /// Why this one.
    pub why: String,
}

impl WrittenTable {
    /// A line for a reader.
    pub fn text(&self) -> String {
        let what = match (self.kind, &self.file) {
            (TableKind::Extended, Some(file)) => format!("that of the causes, {file}"),
            (_, Some(file)) => format!("the calibrated one, {file}"),
            (_, None) => "none is written".to_owned(),
        };
        format!("table: {what}; {}", self.why)
    }
}

/// What became of the causes, as it stands in `diagnosis.json`.
#[derive(Default, Serialize)]
pub struct Extension {
    /// Files written beside diagnosis.json.
    pub files: Vec<String>,
    /// Which table is written, and why that one.
    #[serde(skip)]
    pub table: WrittenTable,
    /// Why extended tables were not written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tables_not_written: Option<String>,
    /// Identity of the table that is written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table_id: Option<String>,
    /// Fields of the drive that hold causes.
    pub drive_fields: Vec<String>,
    /// Causes that stand in `[extension]` of drive-extended.toml.
    pub named_causes: Vec<CauseName>,
    /// Compensation by session held out, and which causes are in the tables.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compensation: Option<Evaluation>,
}

/// The extended drive and its tables, where they are worth it.
#[derive(Default)]
pub struct Made {
    /// What became of the causes; no file is written yet.
    pub extension: Extension,
    /// `drive-extended.toml`; none where no cause was found.
    pub drive_toml: Option<String>,
    /// Tables with the names of their files, the one that leaves least first: the extended table wherever it gains, the
    /// calibrated one where it leaves less.
    pub tables: Vec<(String, MadeTable)>,
}

impl Made {
    /// The files of the tables with their contents; of each the image first.
    pub fn table_files(&self) -> Vec<(String, Vec<u8>)> {
        let files = |(stem, made): &(String, MadeTable)| {
            let info = serde_json::to_vec_pretty(&made.info).unwrap_or_default();
            [
                ("fxt", made.image.clone()),
                ("json", info),
                ("rs", rust_source(made).into_bytes()),
                ("h", c_header(made).into_bytes()),
            ]
            .map(|(ending, content)| (format!("{stem}.{ending}"), content))
        };
        self.tables.iter().flat_map(files).collect()
    }
}

/// `diagnosis.json`: the diagnosis, the faults of the data and what was written.
#[derive(Serialize)]
pub struct DiagnosisFile<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    table: &'a WrittenTable,
    extension: &'a Extension,
    data_faults: &'a [Fault],
    notes: &'a [String],
    command: &'a str,
}

impl Diagnosed {
    /// What `diagnosis.json` holds, with what became of the causes, and the command that asked.
    pub fn file<'a>(&'a self, extension: &'a Extension, command: &'a str) -> DiagnosisFile<'a> {
        let Recording { faults, notes, .. } = &self.recording;
        let table = &extension.table;
        DiagnosisFile { diagnosis: &self.diagnosis, table, extension, data_faults: faults, notes, command }
    }

    /// Makes the extended drive where causes were found, and the table that leaves least in rows left out, if one
    /// gains.
    ///
    /// # Errors
    /// The causes make no drive; no table of it is made.
    pub fn extend(&self, subject: &Subject<'_>) -> Result<Made, PipelineError> {
        let evaluation = &self.evaluation;
        let mut extension = Extension { compensation: Some(evaluation.clone()), ..Extension::default() };
        let tables = tables_of(subject, std::slice::from_ref(&self.recording));
        // A model is no table yet; one that was fitted to these rows is no measure of one that has not seen them all.
        let most_of_nominal = match (&subject.table, &subject.note) {
            (Some(_), _) => 1.0 - LEAST_GAIN,
            (None, None) => 1.0 / (1.0 - LEAST_GAIN),
            (None, Some(_)) => f64::INFINITY,
        };
        let gain = evaluation.tables_that_gain(most_of_nominal);
        let mut drive_toml = None;
        if let Some(known) = subject.model.as_ref().filter(|_| !self.diagnosis.causes.is_empty()) {
            let mut model = Model::of_diagnosis(&subject.nominal, &self.diagnosis, &self.extended);
            model.causes.splice(0..0, known.causes.iter().cloned());
            extension.named_causes = model.causes.iter().map(|cause| cause.name).collect();
            drive_toml = Some(model.to_toml());
        } else if !self.diagnosis.causes.is_empty() {
            let entry = |cause: &Cause| CauseEntry::of(cause.name, &cause.parameters);
            let causes: Vec<CauseEntry> = self.diagnosis.causes.iter().map(entry).collect();
            let orientation_rad = tables.orientation_rad;
            let found = found_geometry(&subject.drive, &self.extended, &causes, subject.against(), orientation_rad)?;
            extension.drive_fields.clone_from(&found.fields);
            extension.named_causes = found.rest.iter().map(|cause| cause.name).collect();
            drive_toml = Some(found.drive.to_toml() + &causes_to_toml(&found.rest));
        }
        let (mut made_tables, mut why) = (Vec::new(), evaluation.words());
        for (kind, left) in gain {
            let made = match kind {
                TableKind::Extended => tables.extended(&self.extended),
                _ if made_tables.is_empty() => self.calibrated(subject, &tables),
                _ => continue,
            };
            match made {
                Ok(made) => made_tables.push((kind, left, made)),
                Err(error) => why += &format!("; {error}"),
            }
        }
        let stem = |kind: TableKind| match kind {
            TableKind::Extended => format!("{}-extended", subject.kind),
            _ => "calibrated".to_owned(),
        };
        extension.table = match made_tables.first() {
            Some(&(kind, rms_left_out_arcsec, _)) => {
                WrittenTable { kind, file: Some(format!("{}.fxt", stem(kind))), rms_left_out_arcsec, why }
            }
            None => {
                let least = evaluation.left.rms_uncompensated_arcsec.min(evaluation.left.rms_nominal_tables_arcsec);
                WrittenTable { rms_left_out_arcsec: least, why, ..WrittenTable::default() }
            }
        };
        let extended = made_tables.iter().any(|(kind, ..)| *kind == TableKind::Extended);
        if !extended && !self.diagnosis.causes.is_empty() {
            extension.tables_not_written = Some(extension.table.text());
        }
        extension.table_id = made_tables.first().map(|(.., made)| made.info.table_id.clone());
        let tables = made_tables.into_iter().map(|(kind, _, made)| (stem(kind), made)).collect();
        Ok(Made { extension, drive_toml, tables })
    }

    /// The table of a calibration of the same rows, less what a cause of the output's encoder adds.
    fn calibrated(&self, subject: &Subject<'_>, tables: &ExtendedTables<'_>) -> Result<MadeTable, PipelineError> {
        let mut recording = subject.as_measured(&self.recording)?.unwrap_or_else(|| self.recording.clone());
        let series = self.extended.predict(&self.recording.sessions, &subject.nominal, subject.table.as_ref());
        for (k, cause) in self.extended.causes().iter().enumerate() {
            if tables.left_out(cause.name(), cause.at_output()) == Some(OF_THE_OUTPUT_ENCODER) {
                less(&mut recording.sessions, series.iter().map(|series| &series.cause_arcsec[k]));
            }
        }
        let known = self.known_table.as_ref().map(|made| Table::check(&made.image)).transpose();
        let known = known.map_err(PipelineError::Image)?;
        Ok(calibrated_table(&[recording], &subject.prior(known.as_ref()))?)
    }
}

/// Tables of the extended model over what the rows hold: their largest torque, their temperatures, the angle against
/// gravity if it stays.
fn tables_of<'a>(subject: &'a Subject<'_>, files: &[Recording]) -> ExtendedTables<'a> {
    let all = |column: fn(&Session) -> Option<&Vec<f64>>| {
        let values = files.iter().flat_map(|file| &file.sessions).filter_map(column).flatten().copied();
        let (low, high) = least_and_most(values);
        (low <= high).then_some([low, high])
    };
    let torque = all(|s| s.torque_n_m.as_ref()).unwrap_or([0.0; 2]);
    let temperature = all(|s| s.temperature_c.as_ref()).unwrap_or([subject.nominal.temperature_c; 2]);
    let orientation = all(|s| s.orientation_rad.as_ref());
    let name = if subject.table.is_some() { subject.drive.name.as_str() } else { CATALOGUE_DRIVE };
    ExtendedTables {
        nominal: &subject.nominal,
        table: subject.table.as_ref(),
        known: subject.extended().map(|model| (model, Sizes::of(&subject.drive))),
        kind: subject.kind,
        drive: format!("{name}-extended"),
        hash: subject.hash(),
        torque_n_m: torque[0].abs().max(torque[1].abs()),
        temperatures_c: temperature,
        orientation_rad: orientation.filter(|[low, high]| high - low <= 1e-3).map(|[low, _]| low),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnosis::report::Finding;
    use crate::synthesize::catalogue_drive;
    use flexspline_base::units::ARCSEC_PER_RAD;

    /// The finding, the notes and the diagnosis on terminal of a drive under 12 N·m, one way, with this error beside
    /// what its model says, arcsec.
    fn found(error_arcsec: impl Fn(f64) -> f64) -> (Finding, Vec<String>, String) {
        let nominal = catalogue_drive();
        let model = Model { nominal: nominal.clone(), causes: Vec::new() };
        let mut subject = Subject::of_model(model, Drive::hhd_95(), GeneratorKind::Cam);
        let mut text = "time_s,generator_rad,error_arcsec,torque_n_m\n".to_owned();
        let mut random = fastrand::Rng::with_seed(5);
        for k in 0..1800 {
            let psi = 0.06 * f64::from(k);
            let load = nominal.wind_up_arcsec(12.0) + 0.5 * nominal.backlash_arcsec + nominal.harmonics_arcsec(psi);
            let error = load + error_arcsec(psi) + 2.0 * (random.f64() - 0.5);
            text += &format!("{:.2},{psi:.6},{error:.4},12\n", 0.01 * f64::from(k));
        }
        let recording = parse_rows("gear.csv", text.as_bytes(), &ColumnMap::default(), &mut subject).unwrap();
        let done = diagnose_rows(recording, &subject, &Settings::default(), |_, _, _| {}).unwrap();
        (done.diagnosis.finding, done.recording.notes.clone(), done.diagnosis.text())
    }

    /// What a log says of a drive known by its ratio, 95: each row has generator angle, error, arcsec, and load, N·m.
    fn by_ratio(row: impl Fn(f64, f64) -> [f64; 3]) -> (Subject<'static>, Diagnosed) {
        by_ratio_and(None, row)
    }

    /// The same where a model states more than the ratio.
    fn by_ratio_and(stated: Option<Nominal>, row: impl Fn(f64, f64) -> [f64; 3]) -> (Subject<'static>, Diagnosed) {
        let (mut text, columns) = ("time_s,generator_rad,error_arcsec,torque_n_m\n".to_owned(), ColumnMap::default());
        let mut random = fastrand::Rng::with_seed(8);
        for k in 0..12_000 {
            let [psi, error, load] = row(f64::from(k), random.f64() - 0.5);
            let read = error + 2.0 * random.f64();
            text += &format!("{:.2},{psi:.6},{read:.4},{load:.4}\n", 0.01 * f64::from(k));
        }
        let (drive, kind, text) = (Drive::hhd_95(), GeneratorKind::Cam, text.into_bytes());
        let mut subject = match stated {
            Some(nominal) => Subject::of_model(Model { nominal, causes: Vec::new() }, drive, kind),
            None => Subject::of_ratio(95.0, (drive, kind), ("gear.csv", text.clone(), &columns)).unwrap(),
        };
        let rows = parse_rows("gear.csv", text, &columns, &mut subject).unwrap();
        let done = diagnose_rows(rows, &subject, &Settings::default(), |_, _, _| {}).unwrap();
        (subject, done)
    }

    /// Way and generator angle at one pace, there and back in 4800 rows.
    fn there_and_back(k: f64) -> (f64, f64) {
        let k = k.rem_euclid(4800.0);
        (if k < 2400.0 { 1.0 } else { -1.0 }, 0.05 * (2400.0 - (k - 2400.0).abs()))
    }

    /// Lost motion at one pace, of a hardening spring: a delay between the angles would be much the same.
    #[test]
    fn lost_motion_at_one_pace_is_no_delay() {
        let (_, done) = by_ratio(|k, _| {
            let ((way, psi), load) = (there_and_back(k), 25.0 * (k / 480.0).floor().rem_euclid(5.0) - 50.0);
            [psi, 6.0 * load / (1.0 + load.abs() / 50.0) - 20.0 * way + 20.0 * (2.0 * psi + 0.4).sin(), load]
        });
        assert_eq!(done.diagnosis.finding, Finding::NothingFound, "{}", done.diagnosis.text());
    }

    /// A drive that stands while its load changes: what winds it up turns round with its output.
    #[test]
    fn friction_turns_round_with_a_load_that_changes_at_rest() {
        let (_, done) = by_ratio(|k, _| {
            let (part, row) = ((k / 2400.0).floor(), k.rem_euclid(2400.0));
            let load = |part: f64| -> f64 { [40.0, -20.0, 30.0, -40.0, 10.0, -30.0][part as usize] };
            let (forth, change) = (1.0 - 2.0 * part.rem_euclid(2.0), load(part + 1.0) - load(part));
            let more = change * ((row - 2000.0) / 200.0).clamp(0.0, 1.0);
            // Friction gives way by some arc-seconds before it slips.
            let (way, load) = (if (6.0 * more).abs() < 5.0 { forth } else { change.signum() }, load(part) + more);
            let psi = 50.0 + forth * (0.05 * row.min(1800.0) - 45.0);
            [psi, 6.0 * load - 20.0 * way + 20.0 * (2.0 * psi + 0.4).sin(), load]
        });
        assert_eq!(done.diagnosis.finding, Finding::NothingFound, "{}", done.diagnosis.text());
    }

    /// A load in steps, N·m.
    fn in_steps(k: f64) -> f64 {
        [12.0, -24.0, 32.0, -40.0, 20.0, -8.0][k as usize / 200 % 6]
    }

    /// Friction takes a spring over a corner of its stiffness: there it gives more one way than the other.
    #[test]
    fn a_corner_of_the_spring_within_friction_is_no_cause() {
        let stiffness = vec![[0.0, 2e4], [8.0, 3e4]];
        let nominal = Nominal { stiffness, friction_torque_n_m: 2.0, ..catalogue_drive() };
        let (_, done) = by_ratio_and(Some(nominal.clone()), |k, _| {
            let ((way, psi), load) = (there_and_back(k), in_steps(k));
            let carried = nominal.wind_up_arcsec(load - 2.0 * way * nominal.ratio.signum());
            [psi, nominal.harmonics_arcsec(psi) + carried + 0.5 * nominal.backlash_arcsec * load.signum(), load]
        });
        assert_eq!(done.diagnosis.finding, Finding::NothingFound, "{}", done.diagnosis.text());
    }

    /// A load centres a wheel, and moves no teeth; without clearance both flanks bind.
    #[test]
    fn a_wave_that_the_load_halves_is_an_eccentricity() {
        let nominal = Nominal { backlash_arcsec: 0.0, ..catalogue_drive() };
        let (_, done) = by_ratio_and(Some(nominal.clone()), |k, _| {
            let (psi, load) = (0.05 * k, in_steps(k));
            let wave = 20.0 * (2.0 * psi * (1.0 - 1.0 / nominal.ratio)).sin() / (1.0 + load.abs() / 25.0);
            [psi, nominal.harmonics_arcsec(psi) + nominal.wind_up_arcsec(load) + wave, load]
        });
        assert!(done.diagnosis.text().contains("  circular_spline_eccentricity ("), "{}", done.diagnosis.text());
    }

    /// Without a load the motion alone chooses the flank, and friction that is stated is one with play.
    #[test]
    fn lost_motion_of_a_stated_friction_is_no_wider_clearance() {
        let nominal = catalogue_drive();
        let half = 0.5 * nominal.backlash_arcsec + nominal.wind_up_arcsec(nominal.friction_torque_n_m);
        let (_, done) = by_ratio_and(Some(nominal.clone()), |k, _| {
            let (way, psi) = there_and_back(k);
            [psi, nominal.harmonics_arcsec(psi) - half * way * nominal.ratio.signum(), 0.0]
        });
        assert_eq!(done.diagnosis.finding, Finding::NothingFound, "{}", done.diagnosis.text());
    }

    #[test]
    fn rows_that_are_all_set_aside_are_no_sound_drive() {
        let spur =
            |amplitude: f64, rad: f64| move |psi: f64| amplitude * (psi / rad * std::f64::consts::PI).sin().signum();
        for (amplitude, rad) in [(1280.0, 6.0), (1280.0, 2.0), (4000.0, 9.0)] {
            let (finding, notes, text) = found(spur(amplitude, rad));
            if finding != Finding::NotUnderstood && finding != Finding::FaultFound {
                assert_eq!(finding, Finding::DataUnusable, "{text}");
                assert!(notes.iter().any(|note| note.contains("rows are left to judge by")), "{notes:?}");
                assert!(!text.contains("-0.00"), "{text}");
            }
        }
        let (finding, notes, _) = found(|_| 0.0);
        assert_eq!(finding, Finding::NothingFound);
        assert!(!notes.iter().any(|note| note.contains("judge by")), "{notes:?}");
    }

    /// Through 65 degrees of the output a tilt of its encoder and an eccentricity are told apart as far as they can be.
    #[test]
    fn two_waves_a_turn_have_their_name_in_a_part_of_it() {
        let (finding, _, text) = found(|psi| 30.0 * (2.0 * psi / 95.0 + 0.5).sin());
        assert!(finding == Finding::FaultFound && text.contains("  output_encoder_tilt ("), "{text}");
    }

    /// A ratio alone: wind-up, play with its friction and the waves of two lobes are those of the rows.
    #[test]
    fn a_ratio_alone_takes_spring_and_friction_from_the_rows() {
        let nominal = catalogue_drive();
        let (subject, done) = by_ratio(|k, _| {
            let ((way, psi), load) = (there_and_back(k), 30.0 * (k / 300.0).sin());
            let carries = load - 1.5 * way;
            let error = nominal.wind_up_arcsec(carries) + 0.5 * nominal.backlash_arcsec * carries.signum();
            [psi, error + 30.0 * (2.0 * psi + 0.4).sin(), load]
        });
        let spring = |of: &Nominal| of.wind_up_arcsec(25.0) - of.wind_up_arcsec(10.0);
        let (found, true_one) = (spring(&subject.nominal), spring(&nominal));
        assert!((found / true_one - 1.0).abs() < 0.05, "{found} for {true_one}");
        let found = subject.nominal.friction_torque_n_m;
        assert!((found / 1.5 - 1.0).abs() < 0.2, "{found} for 1.5");
        assert_eq!(done.diagnosis.finding, Finding::NothingFound, "{}", done.diagnosis.text());
        let note = "on the wheel that turns, of 30.0, 0.1, 0.0, 0.0 arcsec, count as the gear's own";
        assert!(done.recording.notes.iter().any(|of| of.contains(note)), "{:?}", done.recording.notes);
        let (drive, columns) = ((Drive::hhd_95(), GeneratorKind::Cam), ColumnMap::default());
        let other = Subject::of_ratio(1.0, drive, ("g.csv", Vec::new(), &columns));
        assert!(other.err().unwrap().to_string().starts_with("--ratio: found 1, allowed: 2 to 10000"));
    }

    /// An arm: its weight goes with the angle of the output, and the noise of its torque is no word on whose a wave is.
    #[test]
    fn a_weight_leaves_open_whose_a_wave_of_the_output_is() {
        let angle = |k: f64| 300.0 * (1.0 - (k * std::f64::consts::PI / 3000.0).cos());
        let weight = |k: f64| 30.0 * (angle(k) / 95.0 - 0.4).sin();
        let (_, done) = by_ratio(|k, noise| {
            let (psi, load) = (angle(k), weight(k));
            let error = 8.0 * load + 30.0 * (psi / 95.0 + 1.1).sin() + 20.0 * (2.0 * psi).sin();
            [psi, error, load + 0.2 * noise]
        });
        let read = done.recording.sessions[0].torque_n_m.iter().flatten();
        assert!(read.zip(0..).all(|(read, k)| (read - weight(f64::from(k))).abs() < 0.01));
        assert_ne!(done.diagnosis.finding, Finding::FaultFound, "{}", done.diagnosis.text());
        assert!(done.recording.notes.iter().any(|note| note == GOES_WITH_OUTPUT), "{:?}", done.recording.notes);
        // A model that states the spring does not: here it is stiffer than the drive.
        let stiffness = vec![[0.0, ARCSEC_PER_RAD / 6.0]];
        let stated = Nominal { ratio: 95.0, teeth: None, stiffness, backlash_arcsec: 0.0, ..catalogue_drive() };
        let (_, done) = by_ratio_and(Some(stated.clone()), |k, noise| {
            [angle(k), 8.0 * weight(k) + stated.harmonics_arcsec(angle(k)), weight(k) + 0.2 * noise]
        });
        assert!(done.diagnosis.text().contains("stiffness_ratio      "), "{}", done.diagnosis.text());
    }

    /// A sensor that is switched off, or on the motor's side: a weight may have turned the joint all the same.
    #[test]
    fn a_torque_that_is_noise_about_zero_is_none() {
        let (_, done) = by_ratio(|k, noise| {
            let psi = there_and_back(k).1;
            [psi, 30.0 * (psi / 95.0).sin() + 20.0 * (2.0 * psi).sin(), 0.1 * noise]
        });
        assert!(done.recording.sessions.iter().all(|session| session.torque_n_m.is_none()));
        assert!(done.diagnosis.text().contains("a load that was not recorded"), "{}", done.diagnosis.text());
    }

    /// A model that holds a tilt of the output's encoder: a calibration has it neither in its rows nor in its table.
    #[test]
    fn the_output_encoders_error_is_taken_from_the_rows_of_a_calibration() {
        let nominal = catalogue_drive();
        let cause = "\n[[extension.cause]]\nname = \"output_encoder_tilt\"\n[extension.cause.parameters]\n\
                     amplitude_arcsec = 40.0\nphase_rad = 0.3\n";
        let text = Model { nominal: nominal.clone(), causes: Vec::new() }.to_toml() + cause;
        let model = Model::from_toml("drive-extended.toml", &text).unwrap();
        let subject = Subject::of_model(model, Drive::hhd_95(), GeneratorKind::Cam);
        let mut text = "time_s,generator_rad,error_arcsec\n".to_owned();
        for k in 0..4000 {
            let (psi, t) = (0.2 * f64::from(k), 0.01 * f64::from(k));
            let tilt = 40.0 * (2.0 * psi / nominal.ratio + 0.3).sin();
            text += &format!("{t:.2},{psi:.4},{:.6}\n", nominal.harmonics_arcsec(psi) + tilt);
        }
        let mut files = [parse("m.csv", text.as_bytes(), &ColumnMap::default(), &nominal.gear()).unwrap()];
        assert!(subject.known_before(&mut files, false).unwrap().is_some());
        let session = &files[0].sessions[0];
        let left = session.generator_rad.iter().zip(&session.error_rad);
        let off = left.map(|(psi, error)| (error * ARCSEC_PER_RAD - nominal.harmonics_arcsec(*psi)).abs());
        assert!(off.fold(0.0, f64::max) < 0.5);
        assert!(files[0].notes.iter().any(|note| note.contains("output_encoder_tilt")), "{:?}", files[0].notes);
    }
}
