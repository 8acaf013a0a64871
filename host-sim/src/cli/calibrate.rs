//! `flexspline calibrate`: logs of one unit to its table.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};
use flexspline::Table;

use super::context::{Context, quoted, table_image, table_of};
use super::logs::LogOptions;
use super::{Failure, bad_input, report, say};
use flexspline_base::output::Outputs;
use flexspline_design::tables::{c_header, rust_source};
use flexspline_identify::calibrate::{
    Bench, Calibrated, Calibration, CalibrationError, Planned, Prior, Split, TorqueLoop, calibrate,
    calibrate_and_split, one_in, plan,
};
use flexspline_identify::diagnosis::Subject;
use flexspline_identify::extension::Model;
use flexspline_identify::known_rows::parse_known;
use flexspline_identify::measurement::bytes_of;
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_report::calibration_report;

/// Make the table of one unit from its logs, whatever the cause of its error
///
/// Subtracts the nominal model or table from the measurement and fits the residual with smooth parts: wind-up over
/// torque, play by direction, curves over generator, tooth and output angle, temperature. A part is kept if it improves
/// the prediction of files or blocks that were left out of the fit. Writes calibrated.fxt, .h and .rs, for readings of
/// the output's encoder as they are, calibration.json and report.html.
///
/// Of a log in which the generator stands and the load goes round it makes no table, but says by how much the output
/// gives way by play, and whether the loop rejects play or contact of curved bodies (Hertz): torque_loop.json.
///
/// --plan reports what to record before there is a log: the most informative passes of the bench in the time available,
/// with the accuracy to expect. It writes plan.csv and plan.json.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("known").required(true).args(["tables", "model", "ratio"]))]
#[command(after_help = "\
Examples:
  flexspline calibrate --plan --ratio 101 --load-n-m=-30,30 --speed-rpm 60 --rate 100
  flexspline calibrate bench.log --ratio 101 --columns generator=#1:turn,output=#2:deg
  flexspline calibrate monday.csv tuesday.csv --model nominal.toml --out unit7
  flexspline calibrate measured.csv --tables out --generator cam")]
pub(super) struct Calibrate {
    /// Logs of one unit; several files are sessions, each with its own offset
    #[arg(value_name = "LOG", required_unless_present = "plan")]
    logs: Vec<PathBuf>,
    /// Report what to record on a bench, instead of reading logs
    #[arg(long, conflicts_with = "logs")]
    plan: bool,
    /// Folder of tables made by `flexspline tables`; the one of --generator is the starting point
    #[arg(long, value_name = "DIR")]
    tables: Option<PathBuf>,
    /// Nominal model from the catalogue as the starting point, or one extended with causes by `flexspline diagnose`
    #[arg(long, value_name = "nominal.toml")]
    model: Option<PathBuf>,
    /// Generator turns per output turn, negative if they turn in opposite directions, if nothing else is known
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    ratio: Option<f64>,
    /// Wave generator recorded in the table: two-roller, four-roller, double-disc or cam
    #[arg(long, value_name = "G", default_value = "cam")]
    generator: GeneratorKind,
    #[command(flatten)]
    columns: LogOptions,
    #[command(flatten)]
    bench: BenchOptions,
    /// Also split the error into what the output encoder, the generator encoder and the gear have of it: gear.fxt,
    /// encoder_output.csv and encoder_generator.csv, which add up to calibrated.fxt
    #[arg(long, conflicts_with = "plan")]
    split: bool,
    /// Entries in the tables of the encoders, and counts in a turn of the output's, negative if they fall as its angle
    /// rises: 32:4096 [default: 256, counts of the output column]
    #[arg(long, value_name = "N[:COUNTS]", allow_hyphen_values = true, requires = "split")]
    #[arg(value_parser = encoder_table)]
    encoder_table: Option<(usize, Option<f64>)>,
    /// Do not write report.html
    #[arg(long)]
    no_report: bool,
}

/// Abilities of the bench, for --plan.
#[derive(Debug, Args)]
struct BenchOptions {
    /// Time on the bench for --plan, minutes [default: 60]
    #[arg(long, value_name = "MIN", requires = "plan")]
    minutes: Option<f64>,
    /// Largest generator speed for --plan, rpm [default: 60]
    #[arg(long, value_name = "RPM", requires = "plan")]
    speed_rpm: Option<f64>,
    /// Least and largest load at the output for --plan, N·m [default: none]
    #[arg(long, value_name = "LOW,HIGH", value_delimiter = ',', allow_hyphen_values = true, requires = "plan")]
    load_n_m: Vec<f64>,
    /// Lowest and highest temperature for --plan, degrees C [default: one, 20]
    #[arg(long, value_name = "LOW,HIGH", value_delimiter = ',', allow_hyphen_values = true, requires = "plan")]
    temperatures_c: Vec<f64>,
    /// Travel of the output for --plan, deg [default: a turn, 0,360]
    #[arg(long, value_name = "FROM,TO", value_delimiter = ',', allow_hyphen_values = true, requires = "plan")]
    travel_deg: Vec<f64>,
    /// White noise of the error (output minus generator over ratio) that --plan assumes, arcsec [default: 1]
    #[arg(long, value_name = "ARCSEC", requires = "plan")]
    noise_arcsec: Option<f64>,
    /// Drift of the sensors within a minute that --plan assumes, arcsec [default: 0.5]
    #[arg(long, value_name = "ARCSEC", requires = "plan")]
    wander_arcsec: Option<f64>,
}

impl BenchOptions {
    fn bench(&self, rate_hz: Option<f64>, temperature_c: f64) -> Result<Bench, Failure> {
        let usual = Bench::default();
        let pair = |name: &str, values: &[f64], usual: [f64; 2]| match values {
            [] => Ok(usual),
            [one] => Ok([*one, *one]),
            [low, high] => Ok([*low, *high]),
            more => Err(Failure::BadInput(format!("{name}: found {} numbers, allowed: one or two", more.len()))),
        };
        let bench = Bench {
            minutes: self.minutes.unwrap_or(usual.minutes),
            rate_hz: rate_hz.unwrap_or(usual.rate_hz),
            speed_rpm: self.speed_rpm.unwrap_or(usual.speed_rpm),
            torque_n_m: pair("--load-n-m", &self.load_n_m, usual.torque_n_m)?,
            temperature_c: pair("--temperatures-c", &self.temperatures_c, [temperature_c; 2])?,
            output_deg: pair("--travel-deg", &self.travel_deg, usual.output_deg)?,
            noise_arcsec: self.noise_arcsec.unwrap_or(usual.noise_arcsec),
            wander_arcsec: self.wander_arcsec.unwrap_or(usual.wander_arcsec),
            wander_s: usual.wander_s,
        };
        bench.problem().map_or(Ok(bench), |problem| Err(Failure::BadInput(problem)))
    }
}

/// Entries of an encoder's table, unless they are said. *Guess*.
const USUAL_ENTRIES: usize = 256;

/// Reads `N` or `N:COUNTS`.
fn encoder_table(text: &str) -> Result<(usize, Option<f64>), &'static str> {
    let (entries, counts) = text.split_once(':').map_or((text, None), |(entries, counts)| (entries, Some(counts)));
    let entries = entries.parse().ok().filter(|entries| (2..=65_536).contains(entries));
    let counts = counts.map(|counts| counts.parse().ok().filter(|counts: &i64| (2..=1 << 40).contains(&counts.abs())));
    match (entries, counts) {
        (Some(entries), None) => Ok((entries, None)),
        (Some(entries), Some(Some(counts))) => Ok((entries, Some(counts as f64))),
        _ => Err("allowed: 2 to 65536 entries, as in 32, or with the counts in a turn, as in 32:4096"),
    }
}

/// First column of plan.csv.
const PLAN_BEGINS: &str = "log";

impl Calibrate {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        context.refuse_drive("a calibration has the drive of --tables, --model or --ratio")?;
        let map = self.columns.map()?;
        let image = self.tables.as_ref().map(|folder| table_image(folder, self.generator)).transpose()?;
        let table = image.as_ref().map(|(file, bytes)| table_of(file, bytes)).transpose()?;
        let (prior, model) = self.prior(table.as_ref())?;
        if self.plan {
            return self.write_plan(context, &prior);
        }
        let files = self
            .logs
            .iter()
            .map(|file| {
                let (file, bytes) = bytes_of(file)?;
                parse_known(&file, bytes, &map, &prior.nominal, prior.table)
            })
            .collect::<Result<Vec<_>, _>>();
        let mut files = files.map_err(bad_input)?;
        if let Some(found) = TorqueLoop::of(&files) {
            let (out, mut outputs) = (context.out()?, Outputs::new());
            outputs.json(&out.join("torque_loop.json"), &found)?;
            outputs.finish()?;
            return context.print(&found, || format!("{found}\nwrote to {}/: torque_loop.json", out.display()));
        }
        let subject = |model| context.drive().map(|drive| Subject::of_model(model, drive, self.generator));
        let subject = model.map(subject).transpose()?;
        let known =
            subject.map_or(Ok(None), |subject| subject.known_before(&mut files, self.split)).map_err(bad_input)?;
        let known = known.as_ref().map(|made| table_of(Path::new("drive-extended"), &made.image)).transpose()?;
        let prior = known.as_ref().map_or(prior, |known| Prior::of_table(known, self.generator));
        let out = context.out()?;
        let (entries, counts) = self.encoder_table.unwrap_or((USUAL_ENTRIES, None));
        let counts = counts.or_else(|| map.counts_of_output());
        if self.encoder_table.is_some() && counts.is_none() {
            return Err(Failure::BadInput(format!(
                "--encoder-table: found {entries} without counts in a turn, which --columns does not say of the \
                 output; allowed: {entries}:COUNTS"
            )));
        }
        let calibrate = if self.split { calibrate_and_split } else { calibrate };
        let mut made = calibrate(&files, &prior).map_err(|error| self.failed(&error))?;
        made.calibration.command.clone_from(&context.command);
        made.table.info.command.clone_from(&context.command);
        let mut outputs = Outputs::new();
        let mut put = |name: &str, content: &[u8]| outputs.file(&out.join(name), |file| file.write_all(content));
        put("calibrated.fxt", &made.table.image)?;
        put("calibrated.h", c_header(&made.table).as_bytes())?;
        put("calibrated.rs", rust_source(&made.table).as_bytes())?;
        if let Some(gear) = &made.gear {
            put("gear.fxt", &gear.image)?;
        }
        for (encoder, table) in made.calibration.encoder_tables(entries, counts) {
            outputs.csv(&out.join(format!("{encoder}.csv")), table)?;
        }
        outputs.json(&out.join("calibration.json"), &made.calibration)?;
        if !self.no_report {
            report::write(&calibration_report::page(&made), out, &mut outputs)?;
        }
        outputs.finish()?;
        let table = quoted(&out.join("calibrated.fxt").display().to_string());
        let next = say::next(&[format!("flexspline replay --tables {table} ANOTHER.log")]);
        context.print(&made.calibration, || text(&made, out, !self.no_report) + &next)
    }

    /// Says what to record.
    fn write_plan(&self, context: &Context, prior: &Prior<'_>) -> Result<(), Failure> {
        let bench = self.bench.bench(self.columns.rate, prior.nominal.temperature_c)?;
        let mut planned = plan(prior, &bench).map_err(bad_input)?;
        planned.command.clone_from(&context.command);
        let out = context.out_for_plan(PLAN_BEGINS)?;
        let mut outputs = Outputs::new();
        outputs.csv(&out.join("plan.csv"), &planned.passes)?;
        outputs.json(&out.join("plan.json"), &planned)?;
        outputs.finish()?;
        context.print(&planned, || planned_text(&planned, out))
    }

    /// The failure, with the files where the error does not name one.
    fn failed(&self, error: &CalibrationError) -> Failure {
        let files: Vec<String> = self.logs.iter().map(|file| file.display().to_string()).collect();
        let what = error.of_files(&files);
        if error.is_bad_input() { Failure::BadInput(what) } else { Failure::Failed(what) }
    }

    /// The starting point, with the model where it is one.
    fn prior<'t>(&self, table: Option<&'t Table<'t>>) -> Result<(Prior<'t>, Option<Model>), Failure> {
        if let Some(table) = table {
            return Ok((Prior::of_table(table, self.generator), None));
        }
        if let Some(path) = &self.model {
            return Prior::of_file(path, self.generator).map(|(prior, model)| (prior, Some(model))).map_err(bad_input);
        }
        let prior = Prior::of_given_ratio(self.ratio.unwrap_or_default(), self.generator);
        prior.map(|prior| (prior, None)).map_err(bad_input)
    }
}

/// A plan for a reader.
fn planned_text(planned: &Planned, out: &Path) -> String {
    let logs = planned.passes.iter().map(|pass| pass.log).max().unwrap_or(0);
    let mut text = format!(
        "{}: {} passes in {:.0} minutes, each there and back with a second of rest at either end; {} rows in a \
         second\n",
        planned.drive,
        planned.passes.len(),
        planned.minutes,
        planned.bench.rate_hz
    );
    if logs > 1 {
        text += "each temperature is a log of its own, recorded when the drive has settled there; the encoders keep \
                 their zeros\n";
    }
    text += "   log   output, deg           generator, turns      rpm   load, N·m     C\n";
    for p in &planned.passes {
        let _ = writeln!(
            text,
            "  {:>4}  {:>7.1} to {:>7.1}   {:>8.2} to {:>8.2} {:>7.1} {:>10.2} {:>6.1}",
            p.log,
            p.from_output_deg,
            p.to_output_deg,
            p.from_generator_turn,
            p.to_generator_turn,
            p.speed_rpm,
            p.torque_n_m,
            p.temperature_c
        );
    }
    for why in &planned.cannot {
        let _ = writeln!(text, "these logs cannot show: {why}");
    }
    let _ = writeln!(
        text,
        "error of the parts to expect, arcsec rms: {:.2}, for a noise of {:.2}, {:.2} of it drift; what no part \
         models, and an eccentric output encoder, come on top",
        planned.expected_rms_arcsec,
        planned.noise.rms_arcsec,
        planned.noise.lasting_arcsec()
    );
    text + &format!("wrote to {}/: plan.csv, plan.json", out.display())
}

/// Error bound of a table; a figure that differs much from the first is printed as well.
fn held(c: &Calibration) -> String {
    /// A guess.
    const DIFFERS: f64 = 1.25;
    let mut text = format!("error with the table: ±{:.2} arcsec (95 % interval)", c.half_width_arcsec);
    if c.half_width_arcsec > DIFFERS * c.half_width_as_recorded_arcsec {
        let _ = write!(
            text,
            " over all its loads and angles, ±{:.2} in states as recorded",
            c.half_width_as_recorded_arcsec
        );
    }
    if c.half_width_at_another_pace_arcsec > DIFFERS * c.half_width_arcsec {
        let _ = write!(
            text,
            " at the speed recorded, ±{:.2} at another, as a delay between the readings would look like backlash here",
            c.half_width_at_another_pace_arcsec
        );
    }
    text
}

/// Whose error it is, for a reader.
fn split_text(split: &Split) -> String {
    let mut text = "of the error, arcsec rms over the rows, at the output:\n".to_owned();
    for part in &split.parts {
        let why = part.not_told.as_ref().map_or_else(String::new, |why| format!(": not told, {why}"));
        let _ = writeln!(text, "  {:<17} {:.2} ± {:.2}{why}", part.of, part.rms_arcsec, part.half_width_arcsec);
        for w in &part.shares {
            let [least, most] = w.of_encoder.map(|share| 100.0 * share);
            let _ = writeln!(
                text,
                "    {} order {}: {:.2} arcsec, {least:.0} to {most:.0} % of it the encoder's: {}",
                w.turn, w.order, w.amplitude_arcsec, w.why
            );
        }
    }
    text
}

fn text(made: &Calibrated, out: &Path, with_page: bool) -> String {
    let Calibration { held_out, core, parts, .. } = &made.calibration;
    let c = &made.calibration;
    let every = one_in(c.rows);
    let mut text = format!(
        "{}: {} rows, of which {} in steady motion are fitted{}; {} {} left out in turn\n",
        c.files.join(", "),
        c.rows,
        c.rows_fitted,
        if every > 1.0 { format!(" (of a long log one in {every:.1})") } else { String::new() },
        c.folds,
        c.left_out
    );
    for fault in &c.data_faults {
        let _ = writeln!(text, "data fault: {}", fault.what);
    }
    for note in &c.notes {
        let _ = writeln!(text, "note: {note}");
    }
    for part in parts {
        let size = part.size_arcsec.map_or(String::new(), |size| format!(", {size:.1} arcsec"));
        let gain = part.held_out_gain.map_or("    –".to_owned(), |gain| format!("{:>5.1}", 100.0 * gain));
        let kept = if part.kept { "kept   " } else { "refused" };
        let _ = writeln!(text, "  {:<16} {kept} {gain} % of all{size}  {}", part.name, part.why);
    }
    if let Some(found) = &c.alignment {
        let used = if found.told { "used" } else { "these logs cannot show it, not used" };
        let _ = writeln!(
            text,
            "phase of the table: its generator angle 0 is where the logs read {:.3} ± {:.3} deg (it repeats every \
             {:.3} deg): {used}; {}",
            found.generator_zero_deg, found.generator_half_width_deg, found.repeats_deg, found.why
        );
    }
    let as_measured = if c.has_delay() { "as measured less the delay" } else { "as measured" };
    let removed = 100.0 * (1.0 - core.rms_after_arcsec / core.rms_before_arcsec);
    let _ = writeln!(
        text,
        "held-out error in steady motion, arcsec rms: {:.2} {as_measured}, {:.2} with the prior model, {:.2} with the \
         table",
        held_out.rms_before_arcsec, held_out.rms_prior_arcsec, held_out.rms_after_arcsec
    );
    let _ = writeln!(
        text,
        "all rows, reversals included, arcsec rms: {:.2} {as_measured}, {:.2} with table {} in the core ({removed:.1} \
         % less)",
        core.rms_before_arcsec, core.rms_after_arcsec, c.table_id
    );
    let _ = writeln!(text, "{}", held(c));
    if let Some(torque) = &c.torque_from_wind_up {
        let _ = writeln!(
            text,
            "torque from the wind-up, held out: error {:.2} N·m rms, mean {:+.2}; {:.0} of 100 rows within their 95 % \
             interval",
            torque.rms_n_m,
            torque.bias_n_m,
            100.0 * torque.inside
        );
    }
    let mut files = vec!["calibrated.fxt", "calibrated.h", "calibrated.rs", "calibration.json"];
    if let Some(split) = &c.split {
        text += &split_text(split);
        files.extend(["gear.fxt", "encoder_output.csv", "encoder_generator.csv"]);
    }
    files.extend(with_page.then_some("report.html (for any browser)"));
    text + &format!("wrote to {}/: {}", out.display(), files.join(", "))
}
