//! `flexspline fly`: a joint with mass in closed loop.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Args;

use super::context::{Context, image_file};
use super::{Failure, bad_file, bad_input, report};
use flexspline_base::figures;
use flexspline_base::output::Outputs;
use flexspline_base::suggest::did_you_mean;
use flexspline_fly::fly::{ByController, Flown, Results, SCENARIOS, built_in, example, read, results, settles_in};
use flexspline_report::flight_report;

/// Fly a joint with mass in closed loop: motor, servo, drive, friction, load and wind; with and without compensation
///
/// SCENARIO is antenna, rover, camera or telescope, or a TOML file that starts from one of them. The unit flown was
/// built with errors; the table knows the drive as designed, with its diagnosed lines, or calibrated. Writes
/// flight.json and report.html.
///
/// With --tables FILE.fxt the drive of that table flies in the place of HHD-95: built with the same errors, and the
/// core has the file itself where the scenario's table is "nominal".
///
/// A servo that is not stable is a result, and no failed run: exit code 0, `stable` is false. One under which the joint
/// runs away is a failed run.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline fly antenna
  flexspline fly camera --json
  flexspline fly antenna --example > own.toml
  flexspline fly own.toml --out flight
  flexspline fly camera --tables out/cam.fxt")]
pub(super) struct Fly {
    /// antenna, rover, camera, telescope, or a TOML file
    #[arg(value_name = "SCENARIO")]
    scenario: String,
    /// A table whose drive flies, as flexspline tables writes it [default: HHD-95 with the scenario's generator]
    #[arg(long, value_name = "FILE")]
    tables: Option<PathBuf>,
    /// Print the scenario as a file with every field, what it is and what is allowed, and fly nothing
    #[arg(long, conflicts_with_all = ["tables", "no_report"])]
    example: bool,
    /// Write no report.html
    #[arg(long)]
    no_report: bool,
}

impl Fly {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        context.refuse_drive(
            "a flight has the drive of a table; allowed: --tables FILE.fxt, which `flexspline tables` makes of a drive",
        )?;
        if self.example {
            let flown = scenario(&self.scenario)?;
            let base = built_in(&self.scenario).map_or(SCENARIOS[0], |_| &self.scenario);
            let file = example(base, flown);
            return context.print_data(&serde_json::json!({ "file": &file }), || file.clone());
        }
        let mut flown = scenario(&self.scenario)?;
        if let Some(file) = &self.tables {
            flown = flown.with_table(&image_file(file)?).map_err(bad_file(file))?;
        }
        flown.carries().map_err(|why| Failure::BadInput(format!("{}: {why}", self.scenario)))?;
        let out = context.out()?;
        let (progress, done) = (context.progress("fly"), AtomicUsize::new(0));
        let progress_line = || {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress.set(done, flown.seconds_of_all(), "seconds of all joints");
        };
        let flight =
            flown.fly_watched(&progress_line).map_err(|why| Failure::Failed(format!("{}: {why}", self.scenario)))?;
        drop(progress);
        let results = results(&flown, &flight);
        let mut outputs = Outputs::new();
        outputs.json(&out.join("flight.json"), &results)?;
        if !self.no_report {
            let page = flight_report::page(&flown, &flight, &results, &context.command);
            report::write(&page, out, &mut outputs)?;
        }
        outputs.finish()?;
        context.print(&results, || text(&results, out, !self.no_report))
    }
}

/// The scenario of a name, or of a file.
pub(super) fn scenario(name: &str) -> Result<Flown, Failure> {
    read(name, &text_of(name)?).map_err(bad_input)
}

/// A scenario's file: of a name, one that only starts from it.
fn text_of(name: &str) -> Result<String, Failure> {
    if built_in(name).is_some() {
        return Ok(format!("base = {name:?}\n"));
    }
    std::fs::read_to_string(name).map_err(|error| {
        let hint = did_you_mean("; ", name, SCENARIOS);
        Failure::BadInput(format!(
            "scenario: found {name:?}, which cannot be read as a file ({error}); allowed: {}, or a TOML file{hint}",
            SCENARIOS.join(", ")
        ))
    })
}

fn text(results: &Results, out: &Path, report: bool) -> String {
    let mut text = format!(
        "{}, {} generator, {:.0} s; torque {}, table {}\n{:22}{:>10}{:>10}{:>14}{:>12}\n",
        results.scenario,
        results.generator,
        results.seconds,
        results.torque,
        results.table,
        "",
        "rms ″",
        "max ″",
        "ripple ″/s",
        "settles ±2″"
    );
    let columns = [&results.rms_arcsec, &results.max_arcsec, &results.velocity_ripple].map(ByController::all);
    let settles = results.settle_s.as_ref().map(ByController::all);
    for (k, name) in flexspline_motion::flight::CONTROLLERS.iter().enumerate() {
        let [rms, max, ripple] = columns.map(|column| column[k]);
        let ripple = if ripple.is_finite() { format!("{ripple:.1}") } else { "–".to_owned() };
        let settles = settles.map_or_else(|| "–".to_owned(), |seconds| settles_in(seconds[k]));
        let _ = writeln!(text, "{:22}{rms:10.2}{max:10.2}{ripple:>14}{settles:>12}", name.replace('_', " "));
    }
    text += &figures::lines(&results.figures());
    let _ = match (results.stable, results.servo_is_near_the_edge()) {
        (false, _) => {
            writeln!(text, "NOT stable: the servo swings, and no figure above says what a correction is worth")
        }
        (true, true) => writeln!(text, "stable, but near the edge"),
        (true, false) => writeln!(text, "stable"),
    };
    for remark in &results.remarks {
        let _ = writeln!(text, "caution: {remark}");
    }
    let written = if report { "report.html and flight.json" } else { "flight.json" };
    let _ = write!(text, "{written} in {}", out.display());
    text
}
