//! `flexspline export --format eqmod|onstepx|linuxcnc|beckhoff|moteus|odrive|ros2|cfs|fprime`: tables for others'
//! playback.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum, ValueHint};
use flexspline::{Direction, Table};
use serde::Serialize;

use super::context::{Context, image_file};
use super::logs::LogOptions;
use super::replay::measured;
use super::{Failure, say};
use flexspline_base::output::Outputs;
use flexspline_identify::replay::{RowsRead, replay};
use flexspline_playback::{
    BOTH, Cfs, Cnc, CompType, DataFigures, Eqmod, EqmodMount, FEWEST_ROWS, Fprime, LinuxCnc, MAX_TABLE_BYTES,
    MAX_TRIPLETS, ModelFigures, Moteus, Nc, OnStepX, Origin, Player, Refusal, Ros2, Section, Written, core_on_model,
    on_data, on_model, worth_it,
};

/// Whose playback.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PlaybackFormat {
    Eqmod,
    Onstepx,
    Linuxcnc,
    Beckhoff,
    Moteus,
    Odrive,
    Ros2,
    Cfs,
    Fprime,
}

use PlaybackFormat::{
    Beckhoff, Cfs as CfsFormat, Eqmod as EqmodFormat, Fprime as FprimeFormat, Linuxcnc, Odrive, Onstepx,
};

impl PlaybackFormat {
    fn name(self) -> &'static str {
        match self {
            EqmodFormat => "eqmod",
            Onstepx => "onstepx",
            Linuxcnc => "linuxcnc",
            Beckhoff => "beckhoff",
            Self::Moteus => "moteus",
            Odrive => "odrive",
            Self::Ros2 => "ros2",
            CfsFormat => "cfs",
            FprimeFormat => "fprime",
        }
    }

    /// Where the lookup that is simulated is described; docs/how-to/export_to_controllers.md names files and versions.
    fn source(self) -> &'static str {
        match self {
            EqmodFormat => "PEC.bas of EQASCOM",
            Onstepx => "src/telescope/mount/pec of OnStepX",
            Linuxcnc => "src/emc/motion of LinuxCNC",
            Beckhoff => "manual pages of Tc2_MC2 and TF5200",
            Self::Moteus => "fw/motor_position.h of moteus",
            Odrive => "Firmware/MotorControl/controller.cpp of ODrive",
            Self::Ros2 => "simple_transmission.hpp of ros2_control",
            CfsFormat => "cFE and elf2cfetbl",
            FprimeFormat => "fprime and fprime-gds",
        }
    }
}

/// Directions of motion a lookup is made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Directions {
    Both,
    Forward,
    Backward,
}

/// Which of Beckhoff's controllers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum BeckhoffController {
    /// MC_TableBasedPositionCompensation of TwinCAT NC
    Nc,
    /// Compensation value list kw.ssfk of TwinCAT CNC
    Cnc,
}

/// Options of a device's lookup.
#[derive(Debug, Args)]
#[command(next_help_heading = "Playback")]
pub(super) struct PlaybackOptions {
    /// Measured rows of the unit, on which the residual is computed too
    #[arg(long, value_name = "LOG.csv", value_hint = ValueHint::FilePath, requires = "tables")]
    data: Option<PathBuf>,
    #[command(flatten)]
    logs: LogOptions,
    /// Write even if the correction is useless, the table exceeds the default size of cFS, or an unrelated file would
    /// be overwritten
    #[arg(long)]
    force: bool,
    /// Directions of motion of the output: moteus and beckhoff have one value for both [default: both]; eqmod and
    /// onstepx track in one [default: forward]
    #[arg(long, value_enum, value_name = "D", hide_possible_values = true)]
    direction: Option<Directions>,
    /// Output angle at which the lookup starts, degrees: linuxcnc, beckhoff [default: 0]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    from_deg: Option<f64>,
    /// Output angle at which it ends, degrees, at most a turn later: linuxcnc, beckhoff [default: a turn later]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    to_deg: Option<f64>,
    /// Number of points of the lookup: linuxcnc [default: 256], beckhoff [default: 32 per generator turn, on a CNC at
    /// most 1499 in all]
    #[arg(long, value_name = "N")]
    points: Option<u32>,
    /// COMP_FILE_TYPE of linuxcnc: 0 actual positions, 1 trims [default: 1]
    #[arg(long, value_name = "TYPE", value_parser = clap::value_parser!(u8).range(0..=1))]
    comp_type: Option<u8>,
    /// Which of Beckhoff's controllers: nc or cnc [default: nc]
    #[arg(long, value_enum, value_name = "C", hide_possible_values = true)]
    controller: Option<BeckhoffController>,
    /// Motor steps per degree of the output: onstepx, AXIS1_STEPS_PER_DEGREE [default: 12800]
    #[arg(long, value_name = "STEPS")]
    steps_per_degree: Option<f64>,
    /// Buffer of onstepx, s: PEC_BUFFER_SIZE_LIMIT [default: 720]
    #[arg(long, value_name = "S")]
    buffer_s: Option<u32>,
    /// Motor steps per output turn: eqmod [default: 9024000]
    #[arg(long, value_name = "STEPS")]
    steps_per_turn: Option<f64>,
    /// Rate at a divider of 1: eqmod, arcsec/s [default: 9325.46154]
    #[arg(long, value_name = "RATE")]
    track_factor: Option<f64>,
    /// Step counter of the mount where the generator stands at its zero: eqmod [default: 0]
    #[arg(long, value_name = "STEPS", allow_negative_numbers = true)]
    motor_zero: Option<i32>,
    /// Encoder source of moteus on the generator: 0 to 2 [default: 0]
    #[arg(long, value_name = "N")]
    source: Option<u8>,
    /// Counts of that encoder per turn: moteus [default: 16384]
    #[arg(long, value_name = "COUNTS")]
    cpr: Option<u32>,
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
    /// Bytes of a parameter: fprime [default: 500]
    #[arg(long, value_name = "N")]
    part_bytes: Option<u32>,
}

/// Result with `--json`, and `playback.json`.
#[derive(Serialize)]
struct Played {
    schema_version: u32,
    format: &'static str,
    table_id: String,
    tool: String,
    /// What was simulated. Nothing was tried on hardware.
    simulated_from: &'static str,
    tried_on_hardware: bool,
    written: Vec<PathBuf>,
    model: ModelFigures,
    #[serde(skip_serializing_if = "Option::is_none")]
    playback: Option<DataFigures>,
    notes: Vec<String>,
}

/// What a format comes to: its files, and its lookup if that is not the core.
struct FormatFiles {
    player: Option<Box<dyn Player>>,
    files: Vec<Written>,
    notes: Vec<String>,
}

impl From<Refusal> for Failure {
    fn from(refusal: Refusal) -> Failure {
        match refusal {
            Refusal::Impossible(what) => Failure::BadInput(what),
            Refusal::Pointless(what) => Failure::BadInput(format!("{what}; --force writes it all the same")),
        }
    }
}

impl PlaybackOptions {
    /// Refuses options that the format has no use for.
    pub(super) fn check(&self, format: Option<PlaybackFormat>) -> Result<(), Failure> {
        use PlaybackFormat::{Moteus, Ros2};
        let track: &[_] = &[EqmodFormat, Onstepx];
        let travel: &[_] = &[Linuxcnc, Beckhoff];
        let sided: &[_] = &[EqmodFormat, Onstepx, Beckhoff, Moteus];
        let any: &[_] = &[EqmodFormat, Onstepx, Linuxcnc, Beckhoff, Moteus, Ros2, CfsFormat, FprimeFormat];
        let options = [
            ("--data", self.data.is_some(), any),
            (self.logs.given().unwrap_or_default(), self.logs.given().is_some(), any),
            ("--force", self.force, any),
            ("--direction", self.direction.is_some(), sided),
            ("--direction both", self.direction == Some(Directions::Both), &sided[2..]),
            ("--from-deg", self.from_deg.is_some(), travel),
            ("--to-deg", self.to_deg.is_some(), travel),
            ("--points", self.points.is_some(), travel),
            ("--comp-type", self.comp_type.is_some(), &travel[..1]),
            ("--controller", self.controller.is_some(), &travel[1..]),
            ("--steps-per-degree", self.steps_per_degree.is_some(), &track[1..]),
            ("--buffer-s", self.buffer_s.is_some(), &track[1..]),
            ("--steps-per-turn", self.steps_per_turn.is_some(), &track[..1]),
            ("--track-factor", self.track_factor.is_some(), &track[..1]),
            ("--motor-zero", self.motor_zero.is_some(), &track[..1]),
            ("--source", self.source.is_some(), &[Moteus]),
            ("--cpr", self.cpr.is_some(), &[Moteus]),
            ("--table-name", self.table_name.is_some(), &[CfsFormat]),
            ("--spacecraft-id", self.spacecraft_id.is_some(), &[CfsFormat]),
            ("--processor-id", self.processor_id.is_some(), &[CfsFormat]),
            ("--component", self.component.is_some(), &[FprimeFormat]),
            ("--part-bytes", self.part_bytes.is_some(), &[FprimeFormat]),
        ];
        for (option, given, used) in options {
            if given && !format.is_some_and(|format| used.contains(&format)) {
                let used: Vec<&str> = used.iter().map(|format| format.name()).collect();
                return Err(Failure::BadInput(format!(
                    "{option}: this format has no use for it; allowed with --format {}",
                    used.join(", ")
                )));
            }
        }
        if let Some(option) = self.logs.given().filter(|_| self.data.is_none()) {
            return Err(Failure::BadInput(format!("{option}: says how --data is read; allowed with --data")));
        }
        if self.logs.given() == Some("--torque-constant") {
            let what = "--torque-constant: is for a torque column in A or mA; allowed with --columns, which names it";
            return Err(Failure::BadInput(what.to_owned()));
        }
        for (option, value) in [
            ("--steps-per-degree", self.steps_per_degree),
            ("--steps-per-turn", self.steps_per_turn),
            ("--track-factor", self.track_factor),
        ] {
            if let Some(value) = value.filter(|value| !(value.is_finite() && (1.0..=1e9).contains(value))) {
                return Err(Failure::BadInput(format!("{option}: found {value}; allowed: 1 to 1e9")));
            }
        }
        Ok(())
    }

    /// Makes, judges and writes; `load` is torque and temperature as far as they are said.
    pub(super) fn run(
        &self,
        context: &Context,
        format: PlaybackFormat,
        tables: Option<&Path>,
        load: [Option<f64>; 2],
    ) -> Result<(), Failure> {
        let tables = tables.ok_or_else(|| {
            Failure::BadInput(format!("--tables: needed by --format {}; allowed: a .fxt image", format.name()))
        })?;
        let image = image_file(tables)?;
        let table =
            Table::check(&image).map_err(|error| Failure::BadInput(format!("{}: {error}", tables.display())))?;
        let [torque_n_m, temperature_c] = section_of(&table, load)?;
        let section = Section::new(&table, torque_n_m, temperature_c);
        let origin = Origin { table_id: table.id().to_string(), torque_n_m, temperature_c };
        let made = self.make(format, &section, &image, &origin)?;
        let player = made.player.as_deref();
        let model = match player {
            Some(player) => on_model(&table, torque_n_m, temperature_c, player),
            None => core_on_model(&table, torque_n_m, temperature_c),
        };
        if let Some(player) = player.filter(|_| !self.force) {
            worth_it(&section, &model, player)?;
        }
        let mut notes = made.notes;
        notes.extend(model.note());
        let playback = match &self.data {
            Some(data) => self.judge(data, &table, [torque_n_m, temperature_c], player, &mut notes)?,
            None => None,
        };
        let out = context.out()?;
        let mut outputs = Outputs::new();
        let mut written = Vec::new();
        self.refuse_foreign(out, &made.files)?;
        for file in &made.files {
            let path = out.join(&file.name);
            outputs.file(&path, |to| to.write_all(&file.bytes))?;
            written.push(path);
        }
        let played = Played {
            schema_version: 1,
            format: format.name(),
            table_id: origin.table_id,
            tool: concat!("flexspline ", env!("CARGO_PKG_VERSION")).to_owned(),
            simulated_from: format.source(),
            tried_on_hardware: false,
            written,
            model,
            playback,
            notes,
        };
        outputs.json(&out.join("playback.json"), &played)?;
        outputs.finish()?;
        context.print(&played, || text(&played) + &say::next(&[]))
    }

    fn judge(
        &self,
        data: &Path,
        table: &Table<'_>,
        [torque_n_m, temperature_c]: [f64; 2],
        player: Option<&dyn Player>,
        notes: &mut Vec<String>,
    ) -> Result<Option<DataFigures>, Failure> {
        let RowsRead { rows, faults, notes: noticed } = measured(data, &self.logs, table, temperature_c)?;
        notes.extend(faults.into_iter().map(|fault| fault.what).chain(noticed));
        let (replayed, _) = replay(table, &rows);
        let figures = on_data(table, torque_n_m, &rows, &replayed, player)?;
        if figures.rows < FEWEST_ROWS {
            notes.push(format!(
                "not judged by the data: {} rows lie where this device plays, fewer than {FEWEST_ROWS}",
                figures.rows
            ));
            return Ok(None);
        }
        let known = figures.notes(table, torque_n_m);
        match figures.worth_it() {
            Err(Refusal::Pointless(why)) if self.force => notes.push(format!("written by --force. {why}")),
            Err(Refusal::Pointless(why)) => {
                let why: Vec<String> = std::iter::once(why).chain(known).collect();
                return Err(Refusal::Pointless(why.join("; ")).into());
            }
            other => other?,
        }
        notes.extend(known);
        Ok(Some(figures))
    }

    /// Refuses to write over files of another hand; `playback.json` has the id of a table, too.
    fn refuse_foreign(&self, out: &Path, files: &[Written]) -> Result<(), Failure> {
        let foreign = |file: &&Written| {
            let old = std::fs::read(out.join(&file.name));
            !self.force && old.is_ok_and(|old| !file.replaces(&old))
        };
        let figures = Written { name: "playback.json".to_owned(), bytes: b"table_id".to_vec() };
        match files.iter().chain([&figures]).find(foreign) {
            Some(file) => Err(Failure::BadInput(format!(
                "{}: exists, and is not of this program; choose another --out, or --force writes over it",
                out.join(&file.name).display()
            ))),
            None => Ok(()),
        }
    }

    fn make(
        &self,
        format: PlaybackFormat,
        section: &Section<'_>,
        image: &[u8],
        origin: &Origin,
    ) -> Result<FormatFiles, Failure> {
        let of = |player: Box<dyn Player>| FormatFiles {
            files: player.files(origin),
            notes: player.notes(),
            player: Some(player),
        };
        Ok(match format {
            EqmodFormat => {
                let mount = EqmodMount {
                    steps_a_turn: self.steps_per_turn.unwrap_or(9_024_000.0),
                    track_factor: self.track_factor.unwrap_or(9_325.461_54),
                    motor_zero: i64::from(self.motor_zero.unwrap_or(0)),
                };
                of(Box::new(Eqmod::fit(section, self.tracking(), mount)?))
            }
            Onstepx => {
                let steps = self.steps_per_degree.unwrap_or(12_800.0);
                of(Box::new(OnStepX::fit(section, self.tracking(), steps, self.buffer_s.unwrap_or(720))?))
            }
            Linuxcnc => {
                let kind = if self.comp_type == Some(0) { CompType::Actual } else { CompType::Trim };
                of(Box::new(LinuxCnc::fit(section, self.travel()?, self.points.unwrap_or(MAX_TRIPLETS), kind)?))
            }
            Beckhoff if self.controller == Some(BeckhoffController::Cnc) => {
                if self.direction.is_some() {
                    return Err(Failure::BadInput(
                        "--direction: a list of the CNC has a column for each direction; allowed with --controller nc"
                            .into(),
                    ));
                }
                of(Box::new(Cnc::fit(section, self.travel()?, self.points)?))
            }
            Beckhoff => of(Box::new(Nc::fit(section, self.travel()?, self.points, self.directions())?)),
            PlaybackFormat::Moteus => {
                let (source, cpr) = (self.source.unwrap_or(0), self.cpr.unwrap_or(16_384));
                of(Box::new(Moteus::fit(section, source, cpr, self.directions())?))
            }
            Odrive => {
                return Err(Failure::BadInput(
                    "odrive: nothing of its firmware fits. Its one map, anticogging, is a torque over 3600 places of \
                     an encoder turn and moves no position; compensate before input_pos, with the core"
                        .into(),
                ));
            }
            PlaybackFormat::Ros2 => of(Box::new(Ros2::fit(section))),
            CfsFormat => {
                if image.len() > MAX_TABLE_BYTES && !self.force {
                    return Err(Failure::BadInput(format!(
                        "the image has {} bytes, more than the default of CFE_PLATFORM_TBL_MAX_SNGL_TABLE_SIZE, \
                         {MAX_TABLE_BYTES}; --force writes it all the same",
                        image.len()
                    )));
                }
                let name = self.table_name.as_deref().unwrap_or("FLEXSPLINE.TABLE");
                let table = Cfs::new(image, name, self.spacecraft_id.unwrap_or(0), self.processor_id.unwrap_or(0))?;
                FormatFiles { player: None, files: table.files(origin), notes: table.notes() }
            }
            FprimeFormat => {
                let component = self.component.as_deref().unwrap_or("Ref.joint");
                let parameters = Fprime::new(image, component, self.part_bytes.unwrap_or(500))?;
                FormatFiles { player: None, files: parameters.files(origin), notes: parameters.notes() }
            }
        })
    }

    /// Travel of the output, rad.
    fn travel(&self) -> Result<[f64; 2], Failure> {
        let from = self.from_deg.unwrap_or(0.0);
        let to = self.to_deg.unwrap_or(from + 360.0);
        if !(from.abs() <= 1e6 && to - from > 0.0 && to - from <= 360.0) {
            return Err(Failure::BadInput(format!(
                "--from-deg, --to-deg: found {from} to {to}; allowed: up to 360 degrees, the second above the first"
            )));
        }
        Ok([from.to_radians(), to.to_radians()])
    }

    fn tracking(&self) -> Direction {
        if self.direction == Some(Directions::Backward) { Direction::Backward } else { Direction::Forward }
    }

    fn directions(&self) -> &'static [Direction] {
        match self.direction {
            None | Some(Directions::Both) => &BOTH,
            Some(Directions::Forward) => &BOTH[..1],
            Some(Directions::Backward) => &BOTH[1..],
        }
    }
}

/// Load and temperature of the section: as said, within what the table holds for, or the middle of that.
fn section_of(table: &Table<'_>, load: [Option<f64>; 2]) -> Result<[f64; 2], Failure> {
    let ranges = [table.torque_range_n_m(), table.temperature_range_c()].map(|range| range.map(f64::from));
    let mut section = [0.0; 2];
    for (k, option) in ["--torque-n-m", "--temperature-c"].into_iter().enumerate() {
        let [least, most] = ranges[k];
        section[k] = load[k].unwrap_or(0.5 * (least + most));
        if !(least..=most).contains(&section[k]) {
            return Err(Failure::BadInput(format!(
                "{option}: found {}; allowed: {least} to {most}, what the table holds for",
                section[k]
            )));
        }
    }
    Ok(section)
}

fn text(played: &Played) -> String {
    let model = &played.model;
    let mut lines = vec![
        format!("table {}, {} N.m, {} degrees C", played.table_id, model.torque_n_m, model.temperature_c),
        format!("  table's own model, uncorrected, rms {:>12.3} arcsec", model.rms_uncorrected_arcsec),
        format!("  left by this playback, rms         {:>12.3} arcsec", model.rms_played_arcsec),
        format!("  left by this playback, largest     {:>12.3} arcsec", model.max_played_arcsec),
        format!("  mean error, left out of all these  {:>12.3} arcsec", model.mean_left_out_arcsec),
    ];
    for load in &model.loads {
        lines.push(format!(
            "  at {:>8.2} N.m, less the same mean {:>12.3} arcsec uncorrected, left {:>12.3} arcsec",
            load.torque_n_m, load.rms_uncorrected_arcsec, load.rms_played_arcsec
        ));
    }
    if let Some(data) = &played.playback {
        lines.push(format!(
            "  the unit's data, {} rows, rms    {:>12.3} arcsec",
            data.rows, data.rms_uncorrected_arcsec
        ));
        lines.push(format!("  left by this playback, rms         {:>12.3} arcsec", data.rms_played_arcsec));
        lines.push(format!("  left by the core, rms              {:>12.3} arcsec", data.rms_core_arcsec));
        lines.push(format!("  mean of the data, left out         {:>12.3} arcsec", data.mean_left_out_arcsec));
    }
    lines.push(format!("simulated from {}; not tried on hardware", played.simulated_from));
    lines.extend(played.notes.iter().map(|note| format!("note: {note}")));
    let files: Vec<String> = played.written.iter().map(|file| file.display().to_string()).collect();
    lines.push(format!("wrote {}", files.join(", ")));
    lines.join("\n")
}
