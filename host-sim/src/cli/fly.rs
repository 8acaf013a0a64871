//! `flexspline fly`: a joint with mass in closed loop.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Args;

use super::context::Context;
use super::{Failure, report};
use crate::fly::{ByController, Flown, Results, SCENARIOS, built_in, read, results};
use crate::output::Outputs;
use crate::report::flight_report;
use crate::suggest::did_you_mean;

/// Fly a joint with mass in closed loop: motor, servo, drive, friction, load and wind; with and without compensation
///
/// SCENARIO is antenna, rover, camera or telescope, or a TOML file that starts from one of them. The unit flown was built with errors; the table knows the
/// drive as designed, with its diagnosed lines, or calibrated. Writes flight.json and report.html.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline fly antenna
  flexspline fly camera --json
  flexspline fly own.toml --out flight")]
pub(super) struct Fly {
    /// antenna, rover, camera, telescope, or a TOML file
    #[arg(value_name = "SCENARIO")]
    scenario: String,
    /// Write no report.html
    #[arg(long)]
    no_report: bool,
}

impl Fly {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        if let Some(option) = context.changes_the_drive() {
            let what = "a flight has the unit of its scenario; allowed: table, load, servo and more in a scenario file (docs/motion.md)";
            return Err(Failure::BadInput(format!("{option}: {what}")));
        }
        let flown = scenario(&self.scenario)?;
        let out = context.out()?;
        let (progress, done) = (Mutex::new(context.progress("fly")), AtomicUsize::new(0));
        let told = || {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            if let Ok(mut bar) = progress.lock() {
                bar.set(done, flown.seconds_of_all(), "seconds of all joints");
            }
        };
        let flight = flown.fly_told(&told).map_err(Failure::Failed)?;
        drop(progress);
        let results = results(&flown, &flight).ok_or_else(|| Failure::Failed("a controller is missing".to_owned()))?;
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
    if let Some(flown) = built_in(name) {
        return Ok(flown);
    }
    let text = std::fs::read_to_string(name).map_err(|error| {
        let hint = did_you_mean("; ", name, SCENARIOS);
        Failure::BadInput(format!(
            "scenario: found {name:?}, which cannot be read as a file ({error}); allowed: {}, or a TOML file{hint}",
            SCENARIOS.join(", ")
        ))
    })?;
    read(name, &text).map_err(Failure::BadInput)
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
        "settles s"
    );
    let line = |of: &ByController<f64>| [of.none, of.fourier, of.fourier_by_direction, of.compensated, of.ideal];
    let columns = [&results.rms_arcsec, &results.max_arcsec, &results.velocity_ripple].map(line);
    let settles = results.settle_s.as_ref().map(line);
    for (k, name) in flexspline_motion::flight::CONTROLLERS.iter().enumerate() {
        let [rms, max, ripple] = columns.map(|column| column[k]);
        let ripple = if ripple.is_finite() { format!("{ripple:.1}") } else { "–".to_owned() };
        let settles = settles.map_or_else(|| "–".to_owned(), |seconds| format!("{:.2}", seconds[k]));
        let _ = writeln!(text, "{:22}{rms:10.2}{max:10.2}{ripple:>14}{settles:>12}", name.replace('_', " "));
    }
    let [margin, at_hz] = results.phase_margin_deg;
    let removed = match results.removed {
        Some(share) => format!("removed {:.1} % of what an ideal inverse removes", 100.0 * share),
        None => "an ideal inverse removes next to nothing here".to_owned(),
    };
    let _ = writeln!(
        text,
        "{removed}; {}; servo's phase margin {margin:.0}° at {at_hz:.0} Hz",
        if results.stable { "stable" } else { "NOT stable" }
    );
    let written = if report { "report.html and flight.json" } else { "flight.json" };
    let _ = write!(text, "{written} in {}", out.display());
    text
}
