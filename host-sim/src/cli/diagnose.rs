//! `flexspline diagnose`: what the simulation gets wrong in measured data, why, and what the extension gains.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};

use super::context::{Context, quoted, table_image};
use super::logs::LogOptions;
use super::{Failure, bad_file, bad_input, report, say};
use flexspline_base::output::Outputs;
use flexspline_design::kernels::Kernels;
use flexspline_identify::causes::CauseName;
use flexspline_identify::diagnosis::explain::Explanation;
use flexspline_identify::diagnosis::pipeline::{
    Diagnosed, Extension, Made, PipelineError, Subject, diagnose_rows, parse_rows,
};
use flexspline_identify::diagnosis::report::Diagnosis;
use flexspline_identify::diagnosis::{FittedCause, Settings};
use flexspline_identify::extension::Model;
use flexspline_identify::measurement::{ColumnMap, Recording, bytes_of};
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_report::diagnosis_report::{self, DiagnosisSources};

/// Find what the simulation gets wrong in measured data, name the cause, measure what the extension gains
///
/// Reads a CSV with a generator angle and an output angle (or error_arcsec), if wanted time_s, torque_n_m,
/// temperature_c and orientation_rad; writes diagnosis.json. The nominal model is a catalogue's (--model), that of a
/// table (--tables), or of the ratio alone (--ratio) with wind-up and backlash fitted to the same rows. Where causes
/// are found it writes drive-extended.toml, to be given again as the input was: with --model in the place of a
/// nominal.toml, or with --drive beside --tables. Of two tables it writes the one that leaves less error in rows that
/// took no part, if it leaves less than none, and less than the nominal table or no more than the nominal model: that
/// of the causes as <G>-extended.fxt, that of a calibration of the same rows as calibrated.fxt, each with .json, .rs
/// and .h. Neither has an error that was found in the output's encoder; calibrated.fxt of `flexspline calibrate` does.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("known").required(true).args(["tables", "model", "ratio"]))]
#[command(after_help = "\
Examples:
  flexspline diagnose bench.log --ratio 101 --columns generator=#1:turn,output=#2:deg
  flexspline diagnose measured.csv --model nominal.toml
  flexspline diagnose measured.csv --tables out --generator cam
  flexspline diagnose measured.csv --model nominal.toml --explain torsional_hysteresis
  flexspline diagnose measured.csv --tables out --generator cam --out diagnosed")]
pub(super) struct Diagnose {
    /// Measured rows: CSV with a header; columns as --columns says
    #[arg(value_name = "DATA.csv")]
    data: PathBuf,
    /// Nominal model from the catalogue, or one that was extended before: then what is found is beyond it
    #[arg(long, value_name = "nominal.toml")]
    model: Option<PathBuf>,
    /// Folder of tables made by `flexspline tables` from the drive of --drive
    #[arg(long, value_name = "DIR")]
    tables: Option<PathBuf>,
    /// Generator turns per output turn, negative if they turn in opposite directions, if nothing else is known
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    ratio: Option<f64>,
    /// Wave generator whose table is used, and that names the extended one: two-roller, four-roller, double-disc or cam
    #[arg(long, value_name = "G", default_value = "cam")]
    generator: GeneratorKind,
    #[command(flatten)]
    logs: LogOptions,
    /// Say why this cause was named or not (snake case, for instance flexspline_runout); with --json the gates that it
    /// came to. Several with commas, or repeated: a list in JSON, and without what to record to tell them apart
    #[arg(long, value_name = "CAUSE", value_delimiter = ',')]
    explain: Vec<String>,
    /// Do not consider this cause, which is known not to be there; several with commas, or repeated [default: none]
    #[arg(long, value_name = "CAUSE", value_delimiter = ',')]
    without: Vec<String>,
    /// Do not write report.html
    #[arg(long)]
    no_report: bool,
}

/// Causes by their names, of an option.
fn causes(option: &str, names: &[String]) -> Result<Vec<CauseName>, Failure> {
    let causes = names.iter().map(|name| name.trim().parse::<CauseName>()).collect::<Result<Vec<_>, _>>();
    causes.map_err(|error| Failure::BadInput(format!("{option}: {error}")))
}

impl Diagnose {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let map = self.logs.map()?;
        let explained = causes("--explain", &self.explain)?;
        let without = causes("--without", &self.without)?;
        let image = self.tables.as_ref().map(|folder| table_image(folder, self.generator)).transpose()?;
        let failed = |error: PipelineError| self.failed(&error);
        let (file, bytes) = bytes_of(&self.data).map_err(bad_input)?;
        let mut subject = self.subject(context, image.as_ref(), (&file, &bytes, &map))?;
        let recording = parse_rows(&file, bytes, &map, &mut subject).map_err(failed)?;
        // Before there is much work.
        let out = context.out()?;
        // The data that would separate a cause from the strongest named one are looked for in one log only.
        let asked = explained.first().copied().filter(|_| explained.len() == 1);
        let options = Settings { asked, without: &without, ..Settings::default() };
        let progress = context.progress("diagnose");
        let done = diagnose_rows(recording, &subject, &options, |done, of, what| progress.set(done, of, what))
            .map_err(failed)?;
        drop(progress);
        let mut made = done.extend(&subject).map_err(failed)?;
        let mut outputs = Outputs::new();
        self.write(context, &mut made, out, &mut outputs)?;
        let Diagnosed { recording, diagnosis, extended, .. } = &done;
        let extension = &made.extension;
        let written = done.file(extension, &context.command);
        outputs.json(&out.join("diagnosis.json"), &written)?;
        if !self.no_report {
            let hashed = |path: &Path| {
                let bytes = std::fs::read(path).ok()?;
                Some((format!("BLAKE3 of {}", path.display()), blake3::hash(&bytes).to_string()))
            };
            let (nominal, table) = (&subject.nominal, subject.table.as_ref());
            let files = [Some(self.data.as_path()), self.model.as_deref()].into_iter().flatten().filter_map(hashed);
            let page = diagnosis_report::page(DiagnosisSources {
                recording,
                nominal,
                diagnosis,
                table: &extension.table,
                series: &extended.predict(&recording.sessions, nominal, table),
                causes: extended.causes().iter().map(FittedCause::name).collect(),
                command: &context.command,
                inputs: files.chain(table.map(|table| ("table_id".to_owned(), table.id().to_string()))).collect(),
            });
            report::write(&page, out, &mut outputs)?;
        }
        outputs.finish()?;
        let explanations: Vec<Explanation<'_>> =
            explained.iter().map(|cause| Explanation::of(diagnosis, *cause)).collect();
        match explanations.as_slice() {
            [] => {}
            [one] => return context.print(one, || one.text().trim_end().to_owned()),
            several => {
                let texts = || several.iter().map(|one| one.text().trim_end().to_owned()).collect::<Vec<_>>();
                return context.print(&serde_json::json!({ "explanations": several }), || texts().join("\n\n"));
            }
        }
        context.print(&written, || {
            let next = say::next(&self.next(diagnosis, extension, out));
            text(recording, diagnosis, extension, out, !self.no_report) + &next
        })
    }

    /// The failure, with the file where the error does not name it.
    fn failed(&self, error: &PipelineError) -> Failure {
        let what = match error {
            PipelineError::Known(_) | PipelineError::Diagnosis(_) => format!("{}: {error}", self.data.display()),
            _ => error.to_string(),
        };
        if error.is_bad_input() { Failure::BadInput(what) } else { Failure::Failed(what) }
    }

    /// How the extended drive is used.
    fn next(&self, diagnosis: &Diagnosis, extension: &Extension, out: &Path) -> Vec<String> {
        if diagnosis.causes.is_empty() {
            return Vec::new();
        }
        let drive = quoted(&out.join("drive-extended.toml").display().to_string());
        if self.tables.is_none() {
            return vec![format!("flexspline diagnose NEW.csv --model {drive}")];
        }
        if extension.drive_fields.is_empty() {
            return Vec::new();
        }
        let folder = quoted(&out.join("extended").display().to_string());
        vec![format!("flexspline tables --generator {} --drive {drive} --out {folder}", self.generator)]
    }

    /// The drive that the rows are of; `image` is the table that was asked for, with its file.
    fn subject<'i>(
        &self,
        context: &Context,
        image: Option<&'i (PathBuf, Vec<u8>)>,
        (file, bytes, map): (&str, &[u8], &ColumnMap),
    ) -> Result<Subject<'i>, Failure> {
        let drive = context.drive()?;
        match (&self.model, image) {
            (Some(path), _) => {
                let model = Model::read(path).map_err(bad_input)?;
                Ok(Subject::of_model(model, drive, self.generator))
            }
            (None, Some((file, image))) => {
                let subject = Subject::of_table(image, drive, self.generator).map_err(bad_file(file))?;
                let file = file.with_file_name(format!("{}.kernels.json", self.generator));
                match kernels(&file)? {
                    Some(kernels) => subject.with_kernels(kernels).map_err(bad_file(&file)),
                    None => Ok(subject),
                }
            }
            (None, None) => {
                let log = (file, bytes.to_vec(), map);
                let subject = Subject::of_ratio(self.ratio.unwrap_or_default(), (drive, self.generator), log);
                subject.map_err(|error| self.failed(&error))
            }
        }
    }

    /// Writes the extended drive and table, as far as they were made.
    fn write(&self, context: &Context, made: &mut Made, out: &Path, outputs: &mut Outputs) -> Result<(), Failure> {
        for (_, table) in &mut made.tables {
            table.info.command.clone_from(&context.command);
        }
        let header = format!("# Written by flexspline {}: {}\n", env!("CARGO_PKG_VERSION"), context.command);
        let toml = made.drive_toml.as_ref().map(|toml| (header + toml).into_bytes());
        let toml = toml.map(|toml| ("drive-extended.toml".to_owned(), toml));
        for (name, content) in toml.into_iter().chain(made.table_files()) {
            outputs.file(&out.join(&name), |file| file.write_all(&content))?;
            made.extension.files.push(name);
        }
        Ok(())
    }
}

/// The influence kernels of a file, if there is one.
fn kernels(path: &Path) -> Result<Option<Kernels>, Failure> {
    if !path.exists() {
        return Ok(None);
    }
    let text = std::fs::read_to_string(path).map_err(bad_file(path))?;
    Kernels::from_json(&text).map_err(bad_file(path)).map(Some)
}

fn text(recording: &Recording, diagnosis: &Diagnosis, extension: &Extension, out: &Path, with_page: bool) -> String {
    let mut text = format!("{}: {} rows, {} sessions\n", recording.file, recording.rows, recording.sessions.len());
    for fault in &recording.faults {
        text += &format!("data fault: {}\n  to change: {}\n", fault.what, fault.advice);
    }
    for note in &recording.notes {
        text += &format!("note: {note}\n");
    }
    let _ = writeln!(text, "{}", extension.table.text());
    text += &diagnosis.text();
    for field in &extension.drive_fields {
        let _ = writeln!(text, "extended drive: {field}");
    }
    let mut files = vec!["diagnosis.json".to_owned()];
    files.extend(with_page.then(|| "report.html (for any browser)".to_owned()));
    files.extend(extension.files.iter().cloned());
    text + &format!("wrote to {}/: {}", out.display(), files.join(", "))
}
