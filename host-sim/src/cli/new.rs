//! `flexspline new`: a file to start from, with every field explained.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::context::quoted;
use super::made::{Clearance, as_sold, balls_n_per_mm3, with_formulas, with_s_teeth};
use super::{Context, Failure, bad_input, say};
use flexspline_base::output::write_whole;
use flexspline_base::suggest::UnknownName;
use flexspline_design::catalogue::{self, SERIES};
use flexspline_design::cautions::Caution;
use flexspline_design::relief::relieve_tips;
use flexspline_design::simulate::TipContact;
use flexspline_design::sketch::sketch;
use flexspline_design::stated::{Stated, TEMPLATE};
use flexspline_identify::nominal::Nominal;
use flexspline_mechanics::drive::{Drive, DriveError, FewNumbers, GeneratorKind, MadeDrive, Profile};

/// Write a commented drive file, or a catalogue model, to edit
///
/// A drive file (the default) has every size, stiffness and imperfection of a drive for the FEM, each with its unit,
/// meaning, sign and allowed range; as it stands it is the drive that it was made from. --teeth and --module
/// (or --like, the name of a catalogue's size) make a drive of one's own, whose teeth clear one another; what follows
/// from them has its formula in the file. It has a cup and balls in proportion, which are guesses since no catalogue
/// prints them, and from i = 50 to 160 the compliance that catalogues have beside them (output.contact_compliance);
/// --plane leaves all of it out. With --like its [data_sheet] is filled in where the catalogue's figures are at hand.
/// Friction and errors of making are left out. --set flexspline.profile=s makes S-shaped teeth for the cam. Beside the
/// file its sizes are drawn, to scale (.svg). A catalogue model (a file with "nominal" in its name, or --kind nominal)
/// has the few numbers that a catalogue gives, for `diagnose --model` and `synthesize --model`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline new drive.toml
  flexspline new drive.toml --teeth 200 --module 0.32 --bore 62 --generator cam
  flexspline new drive.toml --like CSG-25-80
  flexspline new drive.toml --like CSG-25-80 --set flexspline.profile=s
  flexspline new drive.toml --drive HHD-95-typical --set generator.w0_mm=0.49
  flexspline new nominal.toml")]
pub(super) struct New {
    /// The file to write
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Kind of file [default: nominal if the file is called so, else drive]
    #[arg(long, value_enum)]
    kind: Option<NewKind>,
    /// Teeth of the flexspline, even; the circular spline has two more
    #[arg(long, value_name = "Z", requires = "module", allow_negative_numbers = true)]
    #[arg(conflicts_with = "like")]
    teeth: Option<u32>,
    /// Module, mm
    #[arg(long, value_name = "MM", allow_negative_numbers = true, conflicts_with = "like")]
    module: Option<f64>,
    /// Ratio, instead of --teeth (twice the ratio: circular spline held) or to check them
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    ratio: Option<f64>,
    /// Diameter of the flexspline's bore, undeformed, mm [default: 1.97 times the pitch radius]
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    bore: Option<f64>,
    /// Generator under which the rigid backlash is made one arc-minute
    #[arg(long, value_name = "G", default_value = "cam")]
    generator: GeneratorKind,
    /// Teeth and module as a catalogue's size has them: SERIES-SIZE-RATIO, with a pitch diameter of 2.54 mm a size
    /// (Harmonic Drive)
    #[arg(long, value_name = "NAME")]
    like: Option<String>,
    /// Replace the file if it is there
    #[arg(long)]
    force: bool,
    /// Without cup, balls and contact_compliance: much stiffer than any drive that is sold
    #[arg(long)]
    plane: bool,
    /// Do not run a drive of one's own under its rated load: tips that clash there are then not lowered, nor reported
    #[arg(long)]
    no_run: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
enum NewKind {
    /// A drive for the FEM
    Drive,
    /// A drive as its catalogue has it, without FEM
    Nominal,
}

/// Result with `--json`.
#[derive(Serialize)]
struct NewReport {
    schema_version: u32,
    kind: NewKind,
    written: Vec<PathBuf>,
    /// Of the drive that a drive file holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    drive_hash: Option<String>,
    /// Of a drive of one's own: under which generators its teeth clear.
    #[serde(skip_serializing_if = "Option::is_none")]
    teeth: Option<Clearance>,
    /// Catalogue values of a drive that is like one of its sizes, if at hand.
    #[serde(skip_serializing_if = "Option::is_none")]
    data_sheet: Option<Stated>,
    /// What to know of its stiffness; of a drive file.
    #[serde(skip_serializing_if = "Option::is_none")]
    caution: Option<Caution>,
    /// Of a drive of one's own: how its tips passed one another under its rated load.
    #[serde(skip_serializing_if = "Option::is_none")]
    under_load: Option<UnderLoad>,
    /// Of teeth that bind: the number that lets them clear, for `--set`, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    clears_with: Option<String>,
    /// Commands to type next.
    next: Vec<String>,
}

/// How a drive of one's own did under its rated load.
#[derive(Serialize)]
struct UnderLoad {
    /// The load, N·m.
    torque_n_m: f64,
    /// The generator that it was run with.
    generator: GeneratorKind,
    /// Relief of the flexspline's tips so that they pass those of the circular spline freely, mm.
    tips_lowered_mm: f64,
    /// Remaining contact of tips.
    tip_contact: Option<TipContact>,
    /// Why the run gave no result.
    not_solved: Option<String>,
}

impl UnderLoad {
    /// As a line.
    fn text(&self) -> String {
        let under = format!("under {} N·m, {} generator", self.torque_n_m, self.generator);
        match (&self.not_solved, &self.tip_contact) {
            (Some(why), _) => format!("not run {under}: {why}"),
            (None, Some(tips)) => format!("caution: {under}, {}", tips.in_words()),
            (None, None) if self.tips_lowered_mm > 0.0 => format!(
                "{under}, tips pass one another freely, after flexspline.tip_radius_mm was lowered by {:.4} mm: as \
                 drawn they bore on one another outside the teeth in mesh",
                self.tips_lowered_mm
            ),
            (None, None) => format!("{under}, tips pass one another freely"),
        }
    }
}

impl New {
    /// The drive like a size of a catalogue, as its file would have it, with every `--set`, and its data sheet.
    pub(super) fn like(
        context: &Context,
        name: &str,
        generators: &[GeneratorKind],
    ) -> Result<(Drive, Option<Stated>), Failure> {
        let generator = if let [one] = generators { *one } else { GeneratorKind::Cam };
        let few = numbers_like(name, generator, None)?;
        let mut made = as_sold(context, few.drive(name).map_err(|error| refused(&error, true))?)?;
        let sheet = sheet_like(name);
        run_under_load(context, generator, &mut made, sheet.as_ref())?;
        Ok((context.with_sets(made.drive)?, sheet))
    }

    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let few = self.few()?;
        let numbers = few.as_ref().map(|(_, numbers)| *numbers);
        let made = match few {
            Some(_) if context.has_drive() => {
                let what = "--drive: found it beside --teeth, --module or --like; give one of them";
                return Err(Failure::BadInput(what.to_owned()));
            }
            Some((name, few)) => {
                let made = few.drive(&name).map_err(|error| refused(&error, self.like.is_some()))?;
                let made = if self.asks_for_s_teeth(context)? { with_s_teeth(made)? } else { made };
                Some(if self.plane { made } else { as_sold(context, made)? })
            }
            None => None,
        };
        let kind = self.kind.unwrap_or_else(|| self.kind_by_name());
        let files = self.files(kind)?;
        let data_sheet = self.like.as_deref().and_then(sheet_like).filter(|_| kind == NewKind::Drive);
        let mut made = made;
        let under_load = match &mut made {
            Some(made) if kind == NewKind::Drive && !self.no_run => {
                run_under_load(context, self.generator, made, data_sheet.as_ref())?
            }
            _ => None,
        };
        let drive = match &made {
            Some(made) => context.with_sets(made.drive.clone())?,
            None => context.drive()?,
        };
        let shown = self.file.display().to_string();
        let file = quoted(&shown);
        let own = made.as_ref().filter(|_| kind == NewKind::Drive);
        let teeth = own.map(|_| Clearance::of(&drive)).transpose().map_err(bad_input)?;
        if let Some(teeth) = teeth.as_ref().filter(|_| drive.flexspline.profile == Profile::S) {
            teeth.check_s_teeth()?;
        }
        let binds = |teeth: &&Clearance| !teeth.clear.contains(&self.generator);
        let is_involute = drive.flexspline.profile == Profile::Involute;
        let mended = teeth.as_ref().filter(binds).and(numbers).filter(|_| is_involute);
        let shift = mended.and_then(|numbers| numbers.shift(&drive).ok());
        let (texts, drive_hash, next) = match kind {
            NewKind::Drive => {
                let hash = blake3::Hash::from_bytes(drive.hash()).to_hex().to_string();
                let next = next_of(&file, teeth.as_ref(), self.generator);
                let text = match own {
                    Some(made) => head(teeth.as_ref()) + &with_formulas(made, &drive),
                    None => drive.to_toml(),
                };
                let sheet = data_sheet.as_ref().map_or_else(|| TEMPLATE.to_owned(), Stated::to_toml);
                (vec![text + &sheet, sketch(&drive).map_err(bad_input)?], Some(hash), next)
            }
            NewKind::Nominal => {
                let next = vec![
                    format!("flexspline synthesize --model {file} --effect circular_spline_eccentricity --out try"),
                    format!("flexspline diagnose try/data.csv --model {file} --out try"),
                ];
                (vec![Nominal::template(drive.flexspline.teeth, drive.circular_spline.teeth)], None, next)
            }
        };
        for (file, text) in files.iter().zip(&texts) {
            write_whole(file, |out| out.write_all(text.as_bytes())).map_err(bad_input)?;
        }
        let written = NewReport {
            schema_version: 1,
            kind,
            written: files,
            drive_hash,
            teeth,
            data_sheet,
            caution: Caution::of_stiffness(&drive).filter(|_| kind == NewKind::Drive),
            under_load,
            clears_with: shift.map(|shift| format!("circular_spline.profile_shift={shift}")),
            next,
        };
        context.print(&written, || {
            let what = match kind {
                NewKind::Drive => format!(
                    "the drive {}, every field explained; ratio {} with the flexspline held, as it is simulated, {} \
                     with the circular spline held",
                    drive.name,
                    drive.ratio(),
                    1.0 - drive.ratio()
                ),
                NewKind::Nominal => "a catalogue model: put in the numbers of your drive".to_owned(),
            };
            format!("wrote {shown}: {what}{}{}", self.more(&written), say::next(&written.next))
        })
    }

    /// Teeth, data sheet and what is left out of a drive of one's own, a line each.
    fn more(&self, written: &NewReport) -> String {
        let mut lines: Vec<String> = written.caution.iter().map(|of| format!("caution: {}", of.words)).collect();
        lines.extend(written.teeth.iter().map(Clearance::text));
        let binds = written.teeth.as_ref().is_some_and(|teeth| !teeth.clear.contains(&self.generator));
        let none = "up to 3.5 lets them clear; those of the same drive without --set clear";
        lines.extend(binds.then(|| match &written.clears_with {
            Some(set) => format!("caution: the teeth bind; they clear with --set {set}"),
            None => format!("caution: the teeth bind, and no circular_spline.profile_shift {none}"),
        }));
        lines.extend(written.under_load.iter().map(UnderLoad::text));
        match (&self.like, &written.data_sheet) {
            (Some(_), Some(sheet)) => {
                let missing = if sheet.rated_torque_n_m.is_some() { Vec::new() } else { sheet.assumed() };
                let without = if missing.is_empty() {
                    String::new()
                } else {
                    format!("; not at hand, to be filled in: {}", missing.join(", "))
                };
                lines.push(format!(
                    "[data_sheet] filled in: {}{without}",
                    sheet.source.as_deref().unwrap_or("the catalogue")
                ));
            }
            (Some(name), None) if written.kind == NewKind::Drive => lines.push(format!(
                "[data_sheet] is empty, fill it in: the figures of {name} are not at hand; those of {} are",
                catalogue::sizes_in_words()
            )),
            _ => {}
        }
        lines.iter().map(|line| format!("\n{line}")).collect()
    }

    /// Whether S-shaped teeth are asked for, which are drawn for the cam.
    fn asks_for_s_teeth(&self, context: &Context) -> Result<bool, Failure> {
        let asked = context.set_to(PROFILE).is_some_and(|profile| profile.eq_ignore_ascii_case("s"));
        if asked && self.generator != GeneratorKind::Cam {
            return Err(Failure::BadInput(format!(
                "--generator: found {}, allowed with --set {PROFILE}=s: cam, whose way through the teeth their space \
                 is cut by",
                self.generator
            )));
        }
        Ok(asked)
    }

    /// Name and numbers of a drive of one's own, if it is asked for.
    fn few(&self) -> Result<Option<(String, FewNumbers)>, Failure> {
        let bad = |what: String| Err(Failure::BadInput(what));
        if let Some(name) = &self.like {
            let few = numbers_like(name, self.generator, self.bore)?;
            let ratio = few.teeth / 2;
            if self.ratio.is_some_and(|asked| asked.abs() != f64::from(ratio)) {
                return bad(format!(
                    "--ratio: found {:?}, allowed: {ratio}, as {name} has it",
                    self.ratio.unwrap_or_default()
                ));
            }
            return Ok(Some((name.clone(), few)));
        }
        let Some(module_mm) = self.module else {
            if self.bore.is_some() || self.ratio.is_some() {
                return bad("--bore, --ratio: found without a drive to make; add --module and --teeth or \
                            --ratio, or --like"
                    .to_owned());
            }
            return Ok(None);
        };
        let teeth = match (self.teeth, self.ratio) {
            (Some(teeth), None) => teeth,
            (None, None) => return bad("--module: found alone, allowed: with --teeth or --ratio".to_owned()),
            (None, Some(ratio)) if ratio.abs().fract() == 0.0 => 2 * ratio.abs() as u32,
            (Some(teeth), Some(ratio)) if [0, 1].map(|held| f64::from(teeth / 2 + held)).contains(&ratio.abs()) => {
                teeth
            }
            (Some(teeth), Some(ratio)) => {
                return bad(format!(
                    "--ratio: found {ratio}, allowed: {} (circular spline held) or {} (flexspline held) with {teeth} \
                     teeth and two waves; for this ratio: --teeth {}",
                    teeth / 2,
                    teeth / 2 + 1,
                    2.0 * ratio.abs().round(),
                ));
            }
            (None, Some(ratio)) => return bad(format!("--ratio: found {ratio}, allowed: a whole number, or --teeth")),
        };
        Ok(Some((
            self.file.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
            FewNumbers { teeth, module_mm, bore_mm: self.bore, generator: self.generator },
        )))
    }

    fn kind_by_name(&self) -> NewKind {
        let name = self.file.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
        if name.contains("nominal") { NewKind::Nominal } else { NewKind::Drive }
    }

    /// What is written: the file, and behind it the sketch of a drive. Refuses a place where nothing may be.
    fn files(&self, kind: NewKind) -> Result<Vec<PathBuf>, Failure> {
        let refuse = |file: &Path, what: &str| Err(Failure::BadInput(format!("{}: {what}", file.display())));
        if self.file.is_dir() {
            return refuse(&self.file, "is a folder; allowed: the name of a file");
        }
        let sketch = (kind == NewKind::Drive).then(|| self.file.with_extension("svg"));
        if sketch.as_ref() == Some(&self.file) {
            return refuse(&self.file, "is where the sketch goes; allowed: a name with another ending, as .toml");
        }
        let files: Vec<PathBuf> = [self.file.clone()].into_iter().chain(sketch).collect();
        let is_there = |file: &&PathBuf| file.symlink_metadata().is_ok() && !self.force;
        if let Some(file) = files.iter().find(is_there) {
            return refuse(file, "is there already; give another name, or --force to replace it");
        }
        match self.file.parent() {
            Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
                refuse(&self.file, &format!("there is no folder {}", folder.display()))
            }
            _ => Ok(files),
        }
    }
}

/// Pitch diameter for each size, mm: 63.5 of size 25, as the catalogues of Harmonic Drive have it.
const CATALOGUE_MM_PER_SIZE: f64 = 2.54;

/// The field that is lowered where tips clash.
const TIP_RADIUS: &str = "flexspline.tip_radius_mm";

/// The field that says which teeth.
const PROFILE: &str = "flexspline.profile";

/// The numbers of a drive like a size of a catalogue.
fn numbers_like(name: &str, generator: GeneratorKind, bore_mm: Option<f64>) -> Result<FewNumbers, Failure> {
    let Some((series, size, ratio)) = size_and_ratio(name) else {
        return Err(Failure::BadInput(format!(
            "--like: found {name:?}, allowed: SERIES-SIZE-RATIO as CSF-25-100, size 5 to 100, ratio 30 to 320; a \
             built-in drive goes with --drive"
        )));
    };
    if catalogue::series(series).is_none() {
        let unknown = UnknownName { what: "--like: found the series", found: series.to_owned(), known: &SERIES };
        return Err(bad_input(unknown));
    }
    let teeth = 2 * ratio;
    Ok(FewNumbers { teeth, module_mm: CATALOGUE_MM_PER_SIZE * size / f64::from(teeth), bore_mm, generator })
}

/// The data sheet of a size of a catalogue, if it is at hand.
fn sheet_like(name: &str) -> Option<Stated> {
    let (series, size, ratio) = size_and_ratio(name)?;
    catalogue::sheet(series, size, ratio)
}

/// Runs a drive of one's own under its rated load, and lowers its tips until they pass one another freely. Nothing
/// of a drive that binds as drawn.
fn run_under_load(
    context: &Context,
    generator: GeneratorKind,
    made: &mut MadeDrive,
    sheet: Option<&Stated>,
) -> Result<Option<UnderLoad>, Failure> {
    let drive = context.with_sets(made.drive.clone())?;
    if !Clearance::of(&drive).map_err(bad_input)?.clear.contains(&generator) {
        return Ok(None);
    }
    let torque_n_m = Stated::rated_n_m(sheet, &drive, generator);
    let progress = context.progress("run under load");
    let mut runs = 0;
    let mut report = |what: &str| {
        progress.set(runs, 0, what);
        runs += 1;
    };
    let relief = relieve_tips(&drive, generator, torque_n_m, context.set_to(TIP_RADIUS).is_none(), &mut report);
    let mut under = UnderLoad { torque_n_m, generator, tips_lowered_mm: 0.0, tip_contact: None, not_solved: None };
    match relief {
        Ok(relief) => {
            if relief.lowered_mm > 0.0 {
                made.drive.flexspline.tip_radius_mm = relief.tip_radius_mm;
                let so = if relief.left.is_some() { "still bear on one another" } else { "pass one another freely" };
                for (_, formula) in made.formulas.iter_mut().filter(|(path, _)| *path == TIP_RADIUS) {
                    *formula +=
                        &format!(", lowered by {:.4} mm: so tips {so} under {torque_n_m} N·m", relief.lowered_mm);
                }
            }
            (under.tips_lowered_mm, under.tip_contact) = (relief.lowered_mm, relief.left);
        }
        Err(error) => {
            let (balls, proportion) = (drive.generator.bearing_stiffness_n_per_mm3, balls_n_per_mm3(&drive));
            let field = "its balls are soft: generator.bearing_stiffness_n_per_mm3";
            let soft = balls.filter(|balls| *balls < proportion);
            let soft = soft.map(|balls| format!("; {field} is {balls}, in proportion it is {proportion}"));
            under.not_solved = Some(error.to_string() + &soft.unwrap_or_default());
        }
    }
    Ok(Some(under))
}

/// Head of a file: how its teeth clear, and what no catalogue prints.
fn head(teeth: Option<&Clearance>) -> String {
    let teeth = teeth.map_or_else(String::new, |teeth| format!("# As made here, {}.\n", teeth.text()));
    teeth + "# Friction of the flanks and errors of making ([as_built]) are yours to add: no catalogue prints them.\n"
}

/// Next commands for a drive file: none that fails. Where teeth bind under a generator nobody wants its table,
/// and where they bind under all of them nobody wants the drive.
fn next_of(file: &str, teeth: Option<&Clearance>, drawn_for: GeneratorKind) -> Vec<String> {
    let tables = format!("flexspline tables --drive {file}");
    let clear = teeth.map_or(&GeneratorKind::ALL[..], |teeth| &teeth.clear);
    match clear {
        [] => Vec::new(),
        all if all.len() == GeneratorKind::ALL.len() => {
            vec![format!("flexspline drive --check --drive {file}"), tables]
        }
        some => {
            let kind = some.iter().find(|kind| **kind == drawn_for).unwrap_or(&some[0]);
            vec![format!("{tables} --generator {kind}")]
        }
    }
}

/// Series, size and ratio of `CSF-25-100`: the last two are numbers.
fn size_and_ratio(name: &str) -> Option<(&str, f64, u32)> {
    let mut parts = name.rsplit('-');
    let ratio: u32 = parts.next()?.parse().ok()?;
    let size: f64 = parts.next()?.parse().ok()?;
    let series = parts.next()?;
    let named = series.starts_with(|first: char| first.is_ascii_alphabetic());
    (named && (30..=320).contains(&ratio) && (5.0..=100.0).contains(&size)).then_some((series, size, ratio))
}

/// A drive that cannot be, by the options that asked for it.
fn refused(error: &DriveError, like: bool) -> Failure {
    let says = error.problems.iter().map(|problem| match problem.field.as_str() {
        "teeth" | "module" if like => format!("--like: {problem}"),
        "teeth" | "module" | "bore" => format!("--{problem}"),
        _ => problem.to_string(),
    });
    Failure::BadInput(says.collect::<Vec<_>>().join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rim of 5 mm under teeth of 120 x 0.5 mm: they bind under every generator, and no command is proposed that
    /// would fail.
    #[test]
    fn teeth_that_bind_under_every_generator_have_no_next_command() {
        let few = FewNumbers { teeth: 120, module_mm: 0.5, bore_mm: None, generator: GeneratorKind::Cam };
        let sound = few.drive("d").unwrap().drive;
        let thick = sound.with_set("flexspline.rim_thickness_mm=5").unwrap();
        let clearance = Clearance::of(&thick).unwrap();
        assert_eq!(next_of("d.toml", Some(&clearance), GeneratorKind::Cam), [""; 0]);
        assert!(clearance.text().ends_with("all four: this drive binds"), "{}", clearance.text());
        let clears = Clearance::of(&sound).unwrap();
        assert_eq!(next_of("d.toml", Some(&clears), GeneratorKind::Cam).len(), 2);
        assert_eq!(next_of("d.toml", None, GeneratorKind::Cam).len(), 2);
        let some = |clear: &[GeneratorKind]| Clearance { clear: clear.to_vec(), ..clearance.clone() };
        let (disc, rollers) = (GeneratorKind::DoubleDisc, GeneratorKind::TwoRoller);
        for (drawn_for, due) in [(disc, "double-disc"), (GeneratorKind::Cam, "two-roller")] {
            let next = next_of("d.toml", Some(&some(&[rollers, disc])), drawn_for);
            assert_eq!(next, [format!("flexspline tables --drive d.toml --generator {due}")]);
        }
    }
}
