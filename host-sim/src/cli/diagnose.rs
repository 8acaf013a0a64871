//! `flexspline diagnose`: what the simulation gets wrong in measured data, why, and what the extension gains.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueHint};
use flexspline::Table;
use serde::Serialize;

use super::context::{Context, quoted};
use super::synthesize::gear;
use super::tables::fresh_table;
use super::{Failure, names, report, say};
use crate::causes::CauseName;
use crate::diagnosis::explain::Explanation;
use crate::diagnosis::report::{Compensation, Diagnosis};
use crate::diagnosis::{Extended, Settings, diagnose_extended};
use crate::drive::{Drive, GeneratorKind};
use crate::extension::{
    Agreement, CauseEntry, Evaluation, EvaluationError, ExtendedTables, FoundGeometry, Model, Remake, TableSubject,
    causes_to_toml, check_by_fem, evaluate, found_geometry,
};
use crate::kernels::Kernels;
use crate::measurement::{ColumnMap, Fault, Recording, Session, read};
use crate::mesh::MeshLevel;
use crate::nominal::Nominal;
use crate::output::Outputs;
use crate::stepping::{Method, SolverSettings};
use crate::synthesize::Sizes;
use crate::tables::{MadeTable, c_header, rust_source};
use crate::units::ARCSEC_PER_RAD;

/// Find what the simulation gets wrong in measured data, name the cause, measure what the extension gains
///
/// Reads a CSV with a generator angle and an output angle (or error_arcsec), if wanted time_s, torque_n_m, temperature_c and
/// orientation_rad; writes diagnosis.json. The nominal model is a catalogue's (--model) or that of a table (--tables). Where causes are
/// found it writes drive-extended.toml, which `flexspline` loads again as --model or --drive, and where tables that hold the causes
/// leave less error in sessions that took no part, <G>-extended.fxt, .json, .rs and .h.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline diagnose measured.csv --model nominal.toml
  flexspline diagnose measured.csv --tables out --generator cam
  flexspline diagnose measured.csv --model nominal.toml --explain torsional_hysteresis
  flexspline diagnose measured.csv --tables out --generator cam --remake-tables --out diagnosed")]
pub(super) struct Diagnose {
    /// Measured rows: CSV with a header; columns as --columns says
    #[arg(value_name = "DATA.csv", value_hint = ValueHint::FilePath)]
    data: PathBuf,
    /// Nominal model from the catalogue, or one that was extended before: then what is found is beyond it
    #[arg(long, value_name = "nominal.toml", value_hint = ValueHint::FilePath, conflicts_with = "tables", required_unless_present = "tables")]
    model: Option<PathBuf>,
    /// Folder of tables made by `flexspline tables` from the drive of --drive
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    tables: Option<PathBuf>,
    /// Wave generator whose table is used, and that names the extended one: two-roller, four-roller, double-disc or cam
    #[arg(long, value_name = "G", default_value = "cam", value_parser = names::generator(), hide_possible_values = true)]
    generator: GeneratorKind,
    /// Make the extended tables by FEM from drive-extended.toml; without it they are sampled from the extended model
    #[arg(long, requires = "tables")]
    remake_tables: bool,
    /// Mesh of FEM runs: coarse, standard or fine [default: that of the table]
    #[arg(long, value_name = "LEVEL", requires = "tables", value_parser = names::mesh(), hide_possible_values = true)]
    mesh: Option<MeshLevel>,
    /// Names and units of columns that are not called time_s, generator_rad, output_rad, error_arcsec, torque_n_m, temperature_c,
    /// orientation_rad, for instance generator=wave_gen_turns:turn,error=error_arcsec:arcsec; units are rad, deg, turn, arcmin,
    /// arcsec, s, ms, N.m, C, K [default: these names]
    #[arg(long, value_name = "MAP", default_value = "", hide_default_value = true)]
    columns: String,
    /// Say why this cause was named or not (snake case, for instance flexspline_runout); with --json the gates that it came to
    #[arg(long, value_name = "CAUSE")]
    explain: Option<String>,
    /// Do not write report.html
    #[arg(long)]
    no_report: bool,
}

/// `diagnosis.json`: the diagnosis, the faults of the data and what was written.
#[derive(Serialize)]
struct Written<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    extension: &'a Extension,
    data_faults: &'a [Fault],
    notes: &'a [String],
    command: &'a str,
}

/// What became of the causes.
#[derive(Default, Serialize)]
struct Extension {
    /// Files written beside diagnosis.json.
    files: Vec<String>,
    /// Why extended tables were not written.
    #[serde(skip_serializing_if = "Option::is_none")]
    tables_not_written: Option<String>,
    /// Identity of the extended table.
    #[serde(skip_serializing_if = "Option::is_none")]
    table_id: Option<String>,
    /// Whether the extended tables are of the FEM of the extended drive; else they are sampled from the extended model.
    tables_by_fem: bool,
    /// Fields of the drive that hold causes.
    drive_fields: Vec<String>,
    /// What the FEM of that drive says.
    #[serde(skip_serializing_if = "Option::is_none")]
    fem_agreement: Option<Agreement>,
    /// Causes that stand in `[extension]` of drive-extended.toml.
    named_causes: Vec<CauseName>,
    /// Compensation by session held out, and which causes are in the tables.
    #[serde(skip_serializing_if = "Option::is_none")]
    compensation: Option<Evaluation>,
}

/// The nominal model, with the table that made it and its drive.
struct Subject<'a> {
    nominal: Nominal,
    table: Option<Table<'a>>,
    model: Option<Model>,
    drive: Drive,
}

/// Rows that are diagnosed at most: 1.5 GB of memory.
const MOST_ROWS: usize = 1_000_000;

impl Diagnose {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let map = if self.columns.is_empty() { Ok(ColumnMap::default()) } else { ColumnMap::parse(&self.columns) };
        let map = map.map_err(|error| Failure::BadInput(format!("--columns: {error}")))?;
        let asked = self.explain.as_deref().map(str::parse::<CauseName>).transpose();
        let asked = asked.map_err(|error| Failure::BadInput(format!("--explain: {error}")))?;
        let image = self.image()?;
        let subject = self.subject(context, image.as_deref())?;
        let mut recording =
            read(&self.data, &map, &gear(&subject.nominal)).map_err(|error| Failure::BadInput(error.to_string()))?;
        self.take_away_known(&subject, &mut recording)?;
        recording.average_to(MOST_ROWS);
        // Before there is much work.
        context.out()?;
        let settings = Settings {
            verbose: context.verbose(),
            asked,
            pitch_radius_mm: subject.drive.circular_spline.pitch_radius_mm(),
            ..Settings::default()
        };
        let bad =
            |error: crate::diagnosis::DiagnosisError| Failure::BadInput(format!("{}: {error}", self.data.display()));
        let mut progress = context.progress("diagnose");
        let (mut diagnosis, extended) = diagnose_extended(
            &recording.sessions,
            &subject.nominal,
            subject.table.as_ref(),
            &settings,
            |done, of, what| progress.set(done, of + 1, what),
        )
        .map_err(bad)?;
        progress.set(4, 5, "compensation by the core");
        let hash = image.as_deref().map_or_else(
            || *blake3::hash(subject.model.as_ref().map_or_else(String::new, Model::to_toml).as_bytes()).as_bytes(),
            |_| subject.drive.hash(),
        );
        let name = if self.tables.is_some() { subject.drive.name.clone() } else { "catalogue drive".to_owned() };
        let table_subject = TableSubject { kind: self.generator, drive: format!("{name}-extended"), hash };
        let tables = tables_of(&subject, &table_subject, &recording.sessions);
        let mut extension = Extension::default();
        let causes: Vec<CauseName> = diagnosis.causes.iter().map(|cause| cause.name).collect();
        let remake = |fitted: &Extended| -> Result<Option<Vec<u8>>, String> {
            let entries: Vec<CauseEntry> = fitted.causes().iter().map(CauseEntry::of_fitted).collect();
            let of = (&subject.nominal, subject.table.as_ref());
            let found = found_geometry(&subject.drive, fitted, &entries, of, tables.orientation_rad)
                .map_err(|error| error.to_string())?;
            match self.remade(context, &found, self.mesh(&subject)) {
                Ok(made) => Ok(made.map(|made| made.image)),
                Err(Failure::BadInput(what) | Failure::Failed(what)) => Err(what),
            }
        };
        let remake: Option<&Remake<'_>> = if self.remake_tables { Some(&remake) } else { None };
        match evaluate(&recording.sessions, &causes, &tables, &settings, remake) {
            Ok(evaluation) => {
                diagnosis.compensation = Compensation {
                    rms_uncompensated_arcsec: evaluation.rms_uncompensated_arcsec,
                    rms_nominal_tables_arcsec: evaluation.rms_nominal_tables_arcsec,
                    rms_extended_tables_arcsec: evaluation.rms_extended_tables_arcsec,
                };
                extension.tables_not_written = evaluation.worth_writing().err();
                extension.compensation = Some(evaluation);
            }
            // The FEM failed, or was stopped.
            Err(EvaluationError::Remake(what)) => return Err(Failure::Failed(what)),
            Err(error) => extension.tables_not_written = Some(error.to_string()),
        }
        drop(progress);
        let out = context.out()?;
        let mut outputs = Outputs::new();
        if !diagnosis.causes.is_empty() {
            self.extend(context, &subject, &tables, &diagnosis, &extended, &mut extension, &mut outputs)?;
        }
        let written = Written {
            diagnosis: &diagnosis,
            extension: &extension,
            data_faults: &recording.faults,
            notes: &recording.notes,
            command: &context.command,
        };
        outputs.json(&out.join("diagnosis.json"), &written)?;
        if !self.no_report {
            let inputs = [Some(self.data.as_path()), self.model.as_deref()];
            let (nominal, table) = (&subject.nominal, subject.table.as_ref());
            let page = report::diagnosis(context, inputs, &recording, nominal, table, &diagnosis, &extended);
            report::write(&page, out, &mut outputs)?;
        }
        outputs.finish()?;
        if let Some(cause) = asked {
            let explanation = Explanation::of(&diagnosis, cause);
            return context.print(&explanation, || explanation.text().trim_end().to_owned());
        }
        context.print(&written, || {
            let next = say::next(&self.next(&diagnosis, &extension, out));
            text(&recording, &diagnosis, &extension, out, !self.no_report) + &next
        })
    }

    /// How the extended drive is used.
    fn next(&self, diagnosis: &Diagnosis, extension: &Extension, out: &Path) -> Vec<String> {
        if diagnosis.causes.is_empty() {
            return Vec::new();
        }
        let drive = quoted(&out.join("drive-extended.toml").display().to_string());
        if self.model.is_some() {
            return vec![format!("flexspline diagnose NEW.csv --model {drive}")];
        }
        if extension.drive_fields.is_empty() {
            return Vec::new();
        }
        let folder = quoted(&out.join("extended").display().to_string());
        vec![format!("flexspline tables --generator {} --drive {drive} --out {folder}", self.generator)]
    }

    /// The mesh of FEM runs.
    fn mesh(&self, subject: &Subject<'_>) -> MeshLevel {
        let of_table = || subject.table.as_ref().and_then(|table| table.mesh_level().parse().ok());
        self.mesh.or_else(of_table).unwrap_or(MeshLevel::Coarse)
    }

    /// The bytes of the table that was asked for.
    fn image(&self) -> Result<Option<Vec<u8>>, Failure> {
        let Some(folder) = &self.tables else { return Ok(None) };
        let path = folder.join(format!("{}.fxt", self.generator));
        std::fs::read(&path).map(Some).map_err(|error| Failure::BadInput(format!("{}: {error}", path.display())))
    }

    fn subject<'i>(&self, context: &Context, image: Option<&'i [u8]>) -> Result<Subject<'i>, Failure> {
        let drive = context.drive()?;
        let bad = |what: String| Failure::BadInput(what);
        match (&self.model, image) {
            (Some(path), _) => {
                let model = Model::read(path).map_err(|error| bad(error.to_string()))?;
                Ok(Subject { nominal: model.nominal.clone(), table: None, model: Some(model), drive })
            }
            (None, Some(image)) => {
                let file = self.tables.clone().unwrap_or_default().join(format!("{}.fxt", self.generator));
                let file = file.display();
                let table = Table::check(image).map_err(|error| bad(format!("{file}: {error}")))?;
                if table.drive_hash() != drive.hash() {
                    let of = blake3::Hash::from(table.drive_hash()).to_hex();
                    let given = blake3::Hash::from(drive.hash()).to_hex();
                    return Err(bad(format!(
                        "{file}: the table was made from the drive with BLAKE3 {of}, and --drive {} has {given}; give the \
                         drive that made the table, with every --set",
                        drive.name
                    )));
                }
                let nominal = Nominal { kernels: self.kernels(&table)?, ..Nominal::of_table(&table) };
                Ok(Subject { nominal, table: Some(table), model: None, drive })
            }
            (None, None) => Err(bad("expected --model or --tables".to_owned())),
        }
    }

    /// The influence kernels that stand beside the table, if there are any.
    fn kernels(&self, table: &Table<'_>) -> Result<Option<Arc<Kernels>>, Failure> {
        let path = self.tables.clone().unwrap_or_default().join(format!("{}.kernels.json", self.generator));
        let bad = |what: String| Failure::BadInput(format!("{}: {what}", path.display()));
        if !path.exists() {
            return Ok(None);
        }
        let text = std::fs::read_to_string(&path).map_err(|error| bad(error.to_string()))?;
        let kernels = Kernels::from_json(&text).map_err(bad)?;
        let of = blake3::Hash::from(table.drive_hash()).to_hex();
        if kernels.drive_blake3 != of.as_str() || kernels.generator != self.generator {
            return Err(bad(format!(
                "found kernels of the {} of the drive with BLAKE3 {}, allowed: those of the {} of {of}, as the table's",
                kernels.generator, kernels.drive_blake3, self.generator
            )));
        }
        Ok(Some(Arc::new(kernels)))
    }

    /// Takes what a model says of causes known before from the errors.
    fn take_away_known(&self, subject: &Subject<'_>, recording: &mut Recording) -> Result<(), Failure> {
        let Some(model) = subject.model.as_ref().filter(|model| !model.causes.is_empty()) else { return Ok(()) };
        let added = model
            .added_arcsec(&recording.sessions, sizes(&subject.drive))
            .map_err(|what| Failure::BadInput(format!("{}: {what}", self.data.display())))?;
        for (session, added) in recording.sessions.iter_mut().zip(added) {
            session.error_rad.iter_mut().zip(added).for_each(|(e, a)| *e -= a / ARCSEC_PER_RAD);
        }
        let names: Vec<&str> = model.causes.iter().map(|cause| cause.name.as_str()).collect();
        recording.notes.push(format!("the model holds {} already; what is found is beyond that", names.join(", ")));
        Ok(())
    }

    /// Writes the extended drive, and the extended tables if they are worth it.
    #[allow(clippy::too_many_arguments)]
    fn extend(
        &self,
        context: &Context,
        subject: &Subject<'_>,
        tables: &ExtendedTables<'_>,
        diagnosis: &Diagnosis,
        extended: &Extended,
        extension: &mut Extension,
        outputs: &mut Outputs,
    ) -> Result<(), Failure> {
        let out = context.out()?;
        let mut made: Option<MadeTable> = None;
        let toml = match &subject.model {
            Some(known) => {
                let mut model = Model::of_diagnosis(&subject.nominal, diagnosis);
                model.causes.splice(0..0, known.causes.iter().cloned());
                extension.named_causes = model.causes.iter().map(|cause| cause.name).collect();
                header(context) + &model.to_toml()
            }
            None => {
                let found = self.geometry(context, subject, tables, diagnosis, extended, extension)?;
                extension.drive_fields = found.mapped.iter().flat_map(|mapped| mapped.fields.clone()).collect();
                extension.named_causes = found.rest.iter().map(|cause| cause.name).collect();
                if self.remake_tables && extension.tables_not_written.is_none() {
                    made = self.remade(context, &found, self.mesh(subject))?;
                    extension.tables_by_fem = made.is_some();
                }
                header(context) + &found.drive.to_toml() + &causes_to_toml(&found.rest)
            }
        };
        let mut put = |name: String, content: &[u8]| -> Result<(), Failure> {
            outputs.file(&out.join(&name), |file| file.write_all(content))?;
            extension.files.push(name);
            Ok(())
        };
        put("drive-extended.toml".to_owned(), toml.as_bytes())?;
        if extension.tables_not_written.is_some() {
            return Ok(());
        }
        let mut made = match made {
            Some(made) => made,
            None => match tables.extended(extended) {
                Ok(made) => made,
                Err(error) => {
                    extension.tables_not_written = Some(error.to_string());
                    return Ok(());
                }
            },
        };
        made.info.command.clone_from(&context.command);
        let json = serde_json::to_vec_pretty(&made.info).map_err(|error| Failure::Failed(error.to_string()))?;
        put(format!("{}-extended.fxt", made.kind), &made.image)?;
        put(format!("{}-extended.json", made.kind), &json)?;
        put(format!("{}-extended.rs", made.kind), rust_source(&made).as_bytes())?;
        put(format!("{}-extended.h", made.kind), c_header(&made).as_bytes())?;
        extension.table_id = Some(made.info.table_id);
        Ok(())
    }

    /// The drive with the causes that are geometry, as far as the FEM bears them out.
    fn geometry(
        &self,
        context: &Context,
        subject: &Subject<'_>,
        tables: &ExtendedTables<'_>,
        diagnosis: &Diagnosis,
        extended: &Extended,
        extension: &mut Extension,
    ) -> Result<FoundGeometry, Failure> {
        let of = (&subject.nominal, subject.table.as_ref());
        let causes: Vec<CauseEntry> = diagnosis.causes.iter().map(CauseEntry::of).collect();
        let found = found_geometry(&subject.drive, extended, &causes, of, tables.orientation_rad)
            .map_err(|error| Failure::Failed(format!("the causes make no drive: {error}")))?;
        if !found.mapped.iter().any(|mapped| mapped.by_angle) {
            return Ok(found);
        }
        let mut progress = context.progress("FEM of the extended drive");
        progress.set(0, 1, "a few places on either flank");
        let settings = SolverSettings { method: Method::Fast, mesh: self.mesh(subject), ..SolverSettings::default() };
        let agreement =
            check_by_fem((&subject.drive, &found), self.generator, settings, extended, of, tables.orientation_rad)
                .map_err(|error| Failure::Failed(format!("the FEM of the extended drive: {error}")))?;
        extension.fem_agreement = Some(agreement);
        if agreement.difference_rms_arcsec < WORST_AGREEMENT * agreement.found_rms_arcsec {
            return Ok(found);
        }
        // The FEM of such a drive does something else: the causes are kept by name, not as a shape that is not theirs.
        let (shapes, others): (Vec<CauseEntry>, Vec<CauseEntry>) = causes
            .into_iter()
            .partition(|cause| found.mapped.iter().any(|mapped| mapped.by_angle && mapped.cause == cause.name));
        let mut without = found_geometry(&subject.drive, extended, &others, of, tables.orientation_rad)
            .map_err(|error| Failure::Failed(format!("the causes make no drive: {error}")))?;
        without.rest.splice(0..0, shapes);
        Ok(without)
    }

    /// The table of the extended drive by FEM, if the drive holds all that a table can.
    fn remade(&self, context: &Context, found: &FoundGeometry, mesh: MeshLevel) -> Result<Option<MadeTable>, Failure> {
        // What is in no field of the drive would be missing in a table by FEM.
        let in_tables = found.rest.iter().any(|cause| cause.name.no_place_in_a_table().is_none());
        if in_tables {
            return Ok(None);
        }
        fresh_table(context, &found.drive, self.generator, mesh).map(Some)
    }
}

/// What the FEM of an extended drive may differ by from the causes found, as a share of them, for these to be taken for shapes of it.
const WORST_AGREEMENT: f64 = 0.5;

/// The first lines of a file that was written here.
fn header(context: &Context) -> String {
    format!("# Written by flexspline {}: {}\n", env!("CARGO_PKG_VERSION"), context.command)
}

fn sizes(drive: &Drive) -> Sizes {
    Sizes {
        pitch_radius_mm: drive.circular_spline.pitch_radius_mm(),
        base_radius_mm: drive.circular_spline.base_radius_mm(),
    }
}

/// Axes of the tables of these data.
fn tables_of<'a>(subject: &'a Subject<'_>, of: &'a TableSubject, sessions: &[Session]) -> ExtendedTables<'a> {
    let all = |column: fn(&Session) -> Option<&Vec<f64>>| {
        sessions.iter().filter_map(column).flatten().copied().fold(None, |range: Option<[f64; 2]>, value| {
            Some(range.map_or([value; 2], |[low, high]| [low.min(value), high.max(value)]))
        })
    };
    let torque = all(|s| s.torque_n_m.as_ref()).unwrap_or([0.0; 2]);
    let temperature = all(|s| s.temperature_c.as_ref()).unwrap_or([subject.nominal.temperature_c; 2]);
    let orientation = all(|s| s.orientation_rad.as_ref());
    ExtendedTables {
        nominal: &subject.nominal,
        table: subject.table.as_ref(),
        subject: of,
        torque_n_m: torque[0].abs().max(torque[1].abs()),
        temperatures_c: temperature,
        orientation_rad: match orientation {
            Some([low, high]) if high - low > 1e-3 => None,
            Some([low, _]) => Some(low),
            None => None,
        },
    }
}

fn text(recording: &Recording, diagnosis: &Diagnosis, extension: &Extension, out: &Path, with_page: bool) -> String {
    let mut text = format!("{}: {} rows, {} sessions\n", recording.file, recording.rows, recording.sessions.len());
    for fault in &recording.faults {
        text += &format!("data fault: {}\n", fault.what);
    }
    for note in &recording.notes {
        text += &format!("note: {note}\n");
    }
    text += &diagnosis.text();
    if let Some(evaluation) = &extension.compensation {
        let _ = writeln!(
            text,
            "pointing error the core leaves in sessions held out, arcsec rms\n  session      rows   no table    nominal   extended"
        );
        for s in &evaluation.sessions {
            let _ = writeln!(
                text,
                "  {:>7} {:>9} {:>10.2} {:>10.2} {:>10.2}",
                s.session + 1,
                s.rows,
                s.rms_uncompensated_arcsec,
                s.rms_nominal_tables_arcsec,
                s.rms_extended_tables_arcsec
            );
        }
        let _ = writeln!(
            text,
            "  {:>7} {:>9} {:>10.2} {:>10.2} {:>10.2}",
            "all",
            evaluation.sessions.iter().map(|s| s.rows).sum::<usize>(),
            evaluation.rms_uncompensated_arcsec,
            evaluation.rms_nominal_tables_arcsec,
            evaluation.rms_extended_tables_arcsec
        );
        for left in &evaluation.not_applied {
            let _ = writeln!(text, "  not in the tables: {}, {}", left.cause, left.reason);
        }
    }
    if !diagnosis.causes.is_empty() {
        for field in &extension.drive_fields {
            let _ = writeln!(text, "extended drive: {field}");
        }
        if let Some(agreement) = &extension.fem_agreement {
            let _ = writeln!(
                text,
                "FEM of the extended drive: {:.2} arcsec rms from the causes found, of {:.2}",
                agreement.difference_rms_arcsec, agreement.found_rms_arcsec
            );
        }
        if let Some(why) = &extension.tables_not_written {
            let _ = writeln!(text, "no extended tables: {why}");
        }
    }
    let mut files = vec!["diagnosis.json".to_owned()];
    files.extend(with_page.then(|| "report.html (for any browser)".to_owned()));
    files.extend(extension.files.iter().cloned());
    text + &format!("wrote to {}/: {}", out.display(), files.join(", "))
}
