//! `flexspline export --format csv|cfs|fprime --tables FILE.fxt`: a table for controllers that play it themselves.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::context::{Context, image_file, table_of};
use super::export::{Format, Given};
use super::logs::LogOptions;
use super::replay::measured;
use super::{Failure, bad_input, within};
use flexspline_base::output::Outputs;
use flexspline_export::playback::{
    BOTH, Curve, MAX_TABLE_BYTES, MOST_POINTS_PER_TURN, PlaybackResidual, TableSection, cfs, fprime,
};
use flexspline_identify::replay::{RowsRead, replay};

/// Data with fewer rows are not judged: a guess, some rows to each half wave of order 2 over a few generator turns.
const FEWEST_ROWS: usize = 32;
/// A file that leaves more than this share of a unit's error is refused: a guess.
const POINTLESS: f64 = 0.7;

/// Options of these formats.
#[derive(Debug, Args)]
#[command(next_help_heading = "Playback of a table: csv, cfs, fprime")]
pub(super) struct PlaybackOptions {
    /// Measured rows of the unit, on which the residual is computed too
    #[arg(long, value_name = "LOG.csv", requires = "tables")]
    data: Option<PathBuf>,
    #[command(flatten)]
    logs: LogOptions,
    /// Write even if the correction does not help this unit, the table exceeds the default size of cFS, or an
    /// unrelated file would be overwritten
    #[arg(long)]
    force: bool,
    /// Points of the csv to each generator turn, 8 to 4096 [default: twice the highest order of the table]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(8..=MOST_POINTS_PER_TURN.into()))]
    points_per_turn: Option<u32>,
    /// Directions of the output in the csv, each a column: both, + or - [default: both]
    #[arg(long, value_parser = ["both", "+", "-"], value_name = "D", hide_possible_values = true)]
    direction: Option<String>,
    /// Full name of the table: cfs [default: FLEXSPLINE.TABLE]
    #[arg(long, value_name = "APP.TABLE")]
    table_name: Option<String>,
    /// Spacecraft of the file header: cfs [default: 0, refused where ids are checked]
    #[arg(long, value_name = "ID")]
    spacecraft_id: Option<u32>,
    /// Processor of the file header: cfs [default: 0, likewise]
    #[arg(long, value_name = "ID")]
    processor_id: Option<u32>,
    /// Component instance that has the parameters: fprime [default: Ref.joint]
    #[arg(long, value_name = "NAME")]
    component: Option<String>,
}

impl PlaybackOptions {
    /// Its options, whether each is given, and the formats that have a use for it.
    pub(super) fn given(&self) -> [Given; 8] {
        const ALL: &[Format] = &[Format::Playback, Format::Cfs, Format::Fprime];
        [
            ("--data", self.data.is_some(), ALL),
            ("--force", self.force, ALL),
            ("--points-per-turn", self.points_per_turn.is_some(), &ALL[..1]),
            ("--direction", self.direction.is_some(), &ALL[..1]),
            ("--table-name", self.table_name.is_some(), &[Format::Cfs]),
            ("--spacecraft-id", self.spacecraft_id.is_some(), &[Format::Cfs]),
            ("--processor-id", self.processor_id.is_some(), &[Format::Cfs]),
            ("--component", self.component.is_some(), &[Format::Fprime]),
        ]
    }

    /// Makes, judges and writes; `load` is torque and temperature where they are given.
    pub(super) fn run(
        &self,
        context: &Context,
        format: Format,
        tables: Option<&Path>,
        load: [Option<f64>; 2],
    ) -> Result<(), Failure> {
        let missing = || Failure::BadInput("--tables: needed by cfs and fprime; allowed: a .fxt image".to_owned());
        let tables = tables.ok_or_else(missing)?;
        let image = image_file(tables)?;
        let table = table_of(tables, &image)?;
        // In the middle of the table's range where nothing is given.
        let within = |option: &str, value: Option<f64>, range: [f32; 2]| {
            let [least, most] = range.map(f64::from);
            within(option, value.unwrap_or(0.5 * (least + most)), least, most)
        };
        let torque_n_m = within("--torque-n-m", load[0], table.torque_range_n_m())?;
        let temperature_c = within("--temperature-c", load[1], table.temperature_range_c())?;
        let section = TableSection { table: &table, torque_n_m, temperature_c };
        let mut curve = None;
        let files = match format {
            Format::Cfs if image.len() > MAX_TABLE_BYTES && !self.force => {
                let what = "more than the default of CFE_PLATFORM_TBL_MAX_SNGL_TABLE_SIZE";
                let what = format!("the image has {} bytes, {what}, {MAX_TABLE_BYTES}", image.len());
                return Err(Failure::BadInput(format!("{what}; --force writes it all the same")));
            }
            Format::Cfs => {
                let ids = [self.spacecraft_id, self.processor_id].map(Option::unwrap_or_default);
                let name = self.table_name.as_deref().unwrap_or("FLEXSPLINE.TABLE");
                cfs(section, &image, name, ids).map_err(bad_input)?
            }
            Format::Fprime => {
                fprime(section, &image, self.component.as_deref().unwrap_or("Ref.joint")).map_err(bad_input)?
            }
            _ => {
                let directions = match self.direction.as_deref() {
                    Some("+") => &BOTH[..1],
                    Some("-") => &BOTH[1..],
                    _ => &BOTH[..],
                };
                let made = Curve::new(section, self.points_per_turn.unwrap_or(section.points_per_turn()), directions);
                curve.insert(made).csv(section)
            }
        };
        let judged = self.data.as_ref().map(|data| self.judge(data, section, curve.as_ref()));
        let (playback, notes) = judged.transpose()?.unzip();
        let notes = notes.unwrap_or_default();
        let out = context.out()?;
        let written: Vec<PathBuf> = files.iter().map(|(name, _)| out.join(name)).collect();
        let summary = out.join("playback.json");
        let own = |old: Vec<u8>| old.windows(10).any(|word| word.eq_ignore_ascii_case(b"flexspline"));
        let is_foreign = |path: &&PathBuf| !self.force && std::fs::read(path).is_ok_and(|old| !own(old));
        if let Some(path) = written.iter().chain([&summary]).find(is_foreign) {
            return Err(Failure::BadInput(format!(
                "{}: exists, and is not of this program; choose another --out, or --force writes over it",
                path.display()
            )));
        }
        let mut outputs = Outputs::new();
        for (path, (_, bytes)) in written.iter().zip(&files) {
            outputs.file(path, |to| to.write_all(bytes))?;
        }
        let (id, model) = (table.id().to_string(), curve.map(|curve| curve.on_model(section)));
        let mut played = json!({
            "schema_version": 1, "format": format, "table_id": &id, "written": &written, "notes": &notes,
            "tool": concat!("flexspline ", env!("CARGO_PKG_VERSION")),
            "torque_n_m": torque_n_m, "temperature_c": temperature_c,
        });
        let mut text = format!("table {id}, {torque_n_m} N·m, {temperature_c} degrees C");
        for (name, of, residual) in
            [("model", "the table's own model", model), ("playback", "the unit's data", playback)]
        {
            let Some(residual) = residual else { continue };
            text += &format!(
                "\n  {of}, arcsec rms: {:.3} uncorrected, {:.3} with this playback, {:.3} with the core",
                residual.rms_uncorrected_arcsec, residual.rms_played_arcsec, residual.rms_core_arcsec
            );
            played[name] = json!(residual);
        }
        outputs.json(&summary, &played)?;
        outputs.finish()?;
        text.extend(notes.iter().map(|note| format!("\nnote: {note}")));
        let written: Vec<String> = written.iter().map(|file| file.display().to_string()).collect();
        context.print(&played, || format!("{text}\nwrote {}", written.join(", ")))
    }

    /// The residual on the data of a unit; refuses a file that does not help it.
    fn judge(
        &self,
        data: &Path,
        section: TableSection<'_>,
        curve: Option<&Curve>,
    ) -> Result<(PlaybackResidual, Vec<String>), Failure> {
        let RowsRead { rows, faults, notes } = measured(data, &self.logs, section.table, section.temperature_c, false)?;
        let (replayed, summary) = replay(section.table, &rows, None);
        let faults = faults.into_iter().map(|fault| fault.what);
        let mut notes: Vec<String> = faults.chain(notes).chain(summary.remarks).collect();
        let extrapolated = summary.rows_by_quality[2];
        if extrapolated > 0 {
            let of = format!("{extrapolated} of {} rows", rows.len());
            notes.push(format!("{of} lie beyond the loads or temperatures of the table"));
        }
        let residual = PlaybackResidual::on_data(section, &rows, &replayed, curve);
        let PlaybackResidual { rms_uncorrected_arcsec: error, rms_played_arcsec: left, rms_core_arcsec: core, .. } =
            residual;
        if residual.rows < FEWEST_ROWS {
            let what = format!("found {} rows in the directions of the curve", residual.rows);
            return Err(Failure::BadInput(format!("--data: {what}; allowed: at least {FEWEST_ROWS}")));
        }
        if left <= POINTLESS * error {
            return Ok((residual, notes));
        }
        let why = if core <= POINTLESS * error {
            "so the data belong to it, and hold what this playback does not know: other loads, or play"
        } else {
            "so the data do not belong to this table: another unit, another zero or sign of the generator, the output \
             or the error (--columns error=NAME:-arcsec), another ratio"
        };
        let what = format!(
            "the unit's data: the residual of this playback is {left:.2} arcsec rms of {error:.2}, more than {:.0} %; \
             with the same table in the core it is {core:.2}, {why}",
            100.0 * POINTLESS
        );
        if !self.force {
            let known: String = notes.iter().map(|note| format!("; {note}")).collect();
            return Err(Failure::BadInput(format!("{what}{known}; --force writes it all the same")));
        }
        notes.push(format!("written by --force: {what}"));
        Ok((residual, notes))
    }
}
