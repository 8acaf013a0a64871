//! `flexspline fly`: a joint with mass in closed loop.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Args;
use serde::Serialize;

use super::context::{Context, image_file};
use super::{Failure, report};
use flexspline_base::figures;
use flexspline_base::output::Outputs;
use flexspline_base::suggest::did_you_mean;
use flexspline_design::sweep::Vary;
use flexspline_fly::fly::{
    ByController, Flown, FlyError, Results, SCENARIOS, VariedFlight, built_in, every, example, fly_varied, read,
    results,
};
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
/// A servo that is not stable is a result, and no failed run: exit code 0, `stable` is false.
///
/// With --vary, or for all scenarios, flights are put side by side: a row for each, to the screen and to flights.json.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline fly antenna
  flexspline fly camera --json
  flexspline fly all --vary table=nominal,extended,calibrated
  flexspline fly antenna --vary generator=cam,four-roller --vary torque=on_load,current
  flexspline fly antenna --example > own.toml
  flexspline fly own.toml --out flight
  flexspline fly camera --tables out/cam.fxt --vary table=nominal,calibrated")]
pub(super) struct Fly {
    /// antenna, rover, camera, telescope, a TOML file, or all (those with a name)
    #[arg(value_name = "SCENARIO")]
    scenario: String,
    /// A field of the scenario file and its values: FIELD=VALUE,VALUE,..., FIELD=FROM..TO (5 values) or
    /// FIELD=FROM..TO:N; repeat for more fields [default: as the scenario has it]
    #[arg(long, value_name = "FIELD=VALUES", allow_hyphen_values = true)]
    vary: Vec<Vary>,
    /// A table whose drive flies, as flexspline tables writes it [default: HHD-95 with the scenario's generator]
    #[arg(long, value_name = "FILE")]
    tables: Option<PathBuf>,
    /// Print the scenario as a file with every field, what it is and what is allowed, and fly nothing
    #[arg(long, conflicts_with_all = ["vary", "tables", "no_report"])]
    example: bool,
    /// Write no report.html
    #[arg(long)]
    no_report: bool,
}

impl Fly {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        if let Some(option) = context.changes_the_drive() {
            let what = "a flight has the drive of a table; allowed: --tables FILE.fxt, which `flexspline tables` \
                        makes of a drive";
            return Err(Failure::BadInput(format!("{option}: {what}")));
        }
        if self.example && self.scenario == "all" {
            let allowed = SCENARIOS.join(", ");
            return Err(Failure::BadInput(format!("scenario: found all, allowed for an example: {allowed}")));
        }
        if self.example {
            let flown = scenario(&self.scenario)?;
            let base = built_in(&self.scenario).map_or(SCENARIOS[0], |_| &self.scenario);
            let file = example(base, flown);
            return context.print_data(&serde_json::json!({ "file": &file }), || file.clone());
        }
        if self.scenario == "all" || !self.vary.is_empty() {
            return self.side_by_side(context);
        }
        let flown = on_its_drive(scenario(&self.scenario)?, self.table()?.as_ref())?;
        flown.carries().map_err(|why| Failure::BadInput(format!("{}: {why}", self.scenario)))?;
        let out = context.out()?;
        if !self.no_report {
            report::before(context, out, "fly", None);
        }
        let (progress, done) = (Mutex::new(context.progress("fly")), AtomicUsize::new(0));
        let progress_line = || {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            if let Ok(mut bar) = progress.lock() {
                bar.set(done, flown.seconds_of_all(), "seconds of all joints");
            }
        };
        let flight =
            flown.fly_told(&progress_line).map_err(|why| Failure::Failed(format!("{}: {why}", self.scenario)))?;
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

    /// The table that is given: its file, and its bytes.
    fn table(&self) -> Result<Option<(&Path, Vec<u8>)>, Failure> {
        let Some(file) = &self.tables else { return Ok(None) };
        if self.vary.iter().any(|vary| vary.path == "generator") {
            let what = "--vary generator: found with --tables, whose table has its generator; allowed: one of the two";
            return Err(Failure::BadInput(what.to_owned()));
        }
        Ok(Some((file, image_file(file)?)))
    }
}

/// With the drive of the table that is given.
fn on_its_drive(flown: Flown, table: Option<&(&Path, Vec<u8>)>) -> Result<Flown, Failure> {
    let Some((file, image)) = table else { return Ok(flown) };
    flown.with_table(image).map_err(|error| Failure::BadInput(format!("{}: {error}", file.display())))
}

/// Flights side by side.
#[derive(Serialize)]
struct Flights {
    flights: Vec<VariedFlight>,
}

impl Fly {
    /// Every combination of what varies, of one scenario or all.
    fn side_by_side(&self, context: &Context) -> Result<(), Failure> {
        let names = if self.scenario == "all" { SCENARIOS.to_vec() } else { vec![self.scenario.as_str()] };
        let own = self.table()?;
        let mut flights = Vec::new();
        for name in names {
            for (varied, flown) in every(name, &text_of(name)?, &self.vary).map_err(refused)? {
                flights.push((varied, on_its_drive(flown, own.as_ref())?));
            }
        }
        let out = context.out()?;
        let (progress, done) = (Mutex::new(context.progress("fly")), AtomicUsize::new(0));
        let all = flights.iter().map(|(_, flown)| flown.seconds_of_all()).sum();
        let progress_line = || {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            if let Ok(mut bar) = progress.lock() {
                bar.set(done, all, "seconds of all joints");
            }
        };
        let found = Flights {
            flights: flights.into_iter().map(|(varied, flown)| fly_varied(varied, &flown, &progress_line)).collect(),
        };
        drop(progress);
        if let [VariedFlight { not_flown: Some(reason), .. }] = &found.flights[..] {
            return Err(Failure::BadInput(format!("{}: {reason}", self.scenario)));
        }
        let mut outputs = Outputs::new();
        outputs.json(&out.join("flights.json"), &found)?;
        outputs.finish()?;
        context.print(&found, || table(&found.flights, out))
    }
}

/// A row for each flight.
fn table(flights: &[VariedFlight], out: &Path) -> String {
    let label = |flight: &VariedFlight| {
        let scenario = flight.results.iter().map(|results| results.scenario.clone());
        scenario.chain(flight.varied.iter().map(|(_, value)| value.clone())).collect::<Vec<_>>().join(" ")
    };
    let width = flights.iter().map(|flight| label(flight).chars().count()).max().unwrap_or(0).max(8);
    let mut text = format!(
        "{:width$}  rms ″: none  angle  by way   core  ideal  removed  ripple ″/s: none   core  ideal  floor  settles \
         s: none  core  bound holds  stable\n",
        "scenario"
    );
    let part = |share: Option<f64>| share.map_or("–".to_owned(), |share| format!("{:.1} %", 100.0 * share));
    let number = |value: f64| if value.is_finite() { format!("{value:.1}") } else { "–".to_owned() };
    for flight in flights {
        let Some(results) = &flight.results else {
            let _ =
                writeln!(text, "{:width$}  not flown: {}", label(flight), flight.not_flown.as_deref().unwrap_or(""));
            continue;
        };
        let (rms, ripple) = (&results.rms_arcsec, &results.velocity_ripple);
        let settles = results.settle_s.as_ref();
        let settles = |of: fn(&ByController<f64>) -> f64| settles.map_or("–".to_owned(), |s| format!("{:.2}", of(s)));
        let _ = writeln!(
            text,
            "{:width$} {:>12.2} {:>6.2} {:>7.2} {:>6.2} {:>6.2} {:>8} {:>17} {:>6} {:>6} {:>6} {:>16} {:>5} {:>12} \
             {:>7}",
            label(flight),
            rms.none,
            rms.fourier,
            rms.fourier_by_direction,
            rms.compensated,
            rms.ideal,
            part(results.removed),
            number(ripple.none),
            number(ripple.compensated),
            number(ripple.ideal),
            number(results.velocity_ripple_floor),
            settles(|s| s.none),
            settles(|s| s.compensated),
            part(results.torque_within_bound),
            match (results.stable, results.servo_is_near_the_edge()) {
                (false, _) => "NO",
                (true, true) => "barely",
                (true, false) => "yes",
            }
        );
    }
    for flight in flights {
        for remark in flight.results.iter().flat_map(|results| &results.remarks) {
            let _ = writeln!(text, "caution: {}: {remark}", label(flight));
        }
    }
    text + &format!("flights.json in {}", out.display())
}

/// The scenario of a name, or of a file.
pub(super) fn scenario(name: &str) -> Result<Flown, Failure> {
    read(name, &text_of(name)?).map_err(refused)
}

fn refused(error: FlyError) -> Failure {
    Failure::BadInput(error.to_string())
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
