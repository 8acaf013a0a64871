//! A map of drives that a designer may draw: `map_of_drives COUNT SEED FILE.csv [FIRST [slices]]`
//!
//! Drive i is a pure function of the seed and i: 60 to 400 teeth, a module of 0.1 to 1 mm, one of the four generators,
//! a rim up to a quarter thinner or thicker than the proportions of HHD-95, no friction or up to 0.15, a load of 10 %
//! of the rated one up to all of it, and what holds the rim: springs, nothing, a cup, a hat or a closed sleeve of usual
//! proportions. With `slices` the teeth of those with shells lean with the rim (`flexspline.face`), straight, as they
//! were drawn for no cone. For each it is told whether it
//!
//! - converged: the data sheet of the drive (`flexspline sweep`) is whole, and what it says can be true;
//! - was cautioned: so, too, with something to know before it is built;
//! - was refused before anything was computed, with the reason;
//! - failed, with the reason and the last stable load;
//! - was silently wrong: whole, but it cannot be true, and nothing was said.
//!
//! The rows go to the file as they come, the sums to the screen. It ends with 1 if any drive is silently wrong, or if
//! more than 1 % failed.

use std::fs::File;
use std::io::Write as _;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use flexspline_design::data_sheet::{DataSheet, Loads, data_sheet};
use flexspline_mechanics::drive::{Drive, FewNumbers, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Method, SolverSettings};
use rayon::prelude::*;

const TEETH: [f64; 2] = [60.0, 400.0];
const MODULE_MM: [f64; 2] = [0.1, 1.0];
const RIM: [f64; 2] = [0.75, 1.25];
const MOST_FRICTION: f64 = 0.15;
const LOADS: [f64; 2] = [0.1, 1.0];
const SLEEVES: [&str; 5] = ["springs", "none", "cup", "hat", "hermetic"];
/// Positions over a tooth pitch, as in `sweep --vary`.
const POSITIONS: usize = 6;
/// Share of drives that may fail.
const MAY_FAIL: f64 = 0.01;
/// A backlash by FEM may be larger than that of rigid teeth (the rim gives way), but not by this factor and these
/// arc-seconds.
const BACKLASH: (f64, f64) = (4.0, 120.0);

/// What a drive of the map is.
struct Drawn {
    kind: GeneratorKind,
    load_share: f64,
    sleeve: &'static str,
    few: FewNumbers,
    sets: Vec<String>,
}

struct Row {
    drawn: Drawn,
    verdict: &'static str,
    why: String,
    sheet: DataSheet,
    loads: Option<Loads>,
    seconds: f64,
}

fn drawn(seed: u64, number: usize, slices: bool) -> Drawn {
    let mut random = fastrand::Rng::with_seed(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ number as u64);
    let mut between = |[low, high]: [f64; 2]| low + (high - low) * random.f64();
    // Sizes are spread by their ratio: as many drives from 0.1 to 0.2 mm as from 0.5 to 1.
    let by_ratio = |[low, high]: [f64; 2], share: f64| low * (high / low).powf(share);
    let teeth = 2 * (by_ratio(TEETH, between([0.0, 1.0])) / 2.0).round() as u32;
    let module_mm = (by_ratio(MODULE_MM, between([0.0, 1.0])) * 1e3).round() * 1e-3;
    let rim = between(RIM);
    let friction = if between([0.0, 1.0]) < 0.5 { 0.0 } else { between([0.0, MOST_FRICTION]) };
    let load_share = between(LOADS);
    let kind = GeneratorKind::ALL[random.usize(..GeneratorKind::ALL.len())];
    let sleeve = SLEEVES[random.usize(..SLEEVES.len())];
    // Proportions of the sleeve of HHD-95: length, wall, hub of its pitch radius of 47 mm.
    let radius = 0.5 * module_mm * f64::from(teeth);
    let scaled = |of_hhd_95: f64| (of_hhd_95 * radius / 47.0 * 1e4).round() * 1e-4;
    let rim_mm = (1.2 * radius / 47.0 * rim * 1e4).round() * 1e-4;
    let mut sets = vec![
        format!("flexspline.rim_thickness_mm={rim_mm}"),
        format!("flanks.friction_coefficient={friction:.4}"),
        format!("sleeve.kind={sleeve}"),
    ];
    if sleeve != "springs" && sleeve != "none" {
        let long = scaled(if sleeve == "hermetic" { 140.0 } else { 60.0 });
        sets.push(format!("sleeve.wall_mm={}", scaled(0.5)));
        sets.push(format!("sleeve.flange_side_mm={long}"));
        sets.push(format!("sleeve.bottom_side_mm={long}"));
        sets.push(format!("sleeve.bottom_thickness_mm={}", scaled(2.0)));
        sets.push(format!("sleeve.hub_radius_mm={}", scaled(20.0)));
        if slices {
            sets.push("flexspline.face=slices".to_owned());
        }
    }
    let few = FewNumbers { teeth, module_mm, bore_mm: None, generator: kind };
    Drawn { kind, load_share, sleeve, few, sets }
}

fn run(seed: u64, number: usize, slices: bool) -> Row {
    let clock = Instant::now();
    let mut row = Row {
        drawn: drawn(seed, number, slices),
        verdict: "refused",
        why: String::new(),
        sheet: DataSheet::default(),
        loads: None,
        seconds: 0.0,
    };
    let made =
        row.drawn.few.drive("map").and_then(|made| made.drive.with_sets(row.drawn.sets.iter().map(String::as_str)));
    match made {
        Err(error) => row.why = error.to_string(),
        Ok(drive) => compute(&drive, &mut row),
    }
    row.seconds = clock.elapsed().as_secs_f64();
    row
}

fn compute(drive: &Drive, row: &mut Row) {
    let kind = row.drawn.kind;
    let loads = Loads::up_to(row.drawn.load_share * drive.rated_torque_n_m(kind));
    let solver = SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() };
    let (sheet, done) = data_sheet(drive, kind, drive.temperature.reference_c, loads, POSITIONS, solver);
    (row.sheet, row.loads) = (sheet, Some(loads));
    let cautions = sheet.looked().cautions();
    (row.verdict, row.why) = match (done, impossible(&sheet)) {
        (Err(error), _) if error.is_bad_input() => ("refused", error.to_string()),
        (Err(error), _) => ("failed", error.to_string()),
        (Ok(()), _) if !cautions.is_empty() => {
            ("cautioned", cautions.iter().map(|caution| caution.words.as_str()).collect::<Vec<_>>().join("; "))
        }
        (Ok(()), Some(what)) => ("silent", what),
        (Ok(()), None) => ("converged", String::new()),
    };
}

/// What a whole sheet says that cannot be true.
fn impossible(sheet: &DataSheet) -> Option<String> {
    let positive = [
        ("k1", sheet.k1_n_m_per_rad),
        ("k2", sheet.k2_n_m_per_rad),
        ("k3", sheet.k3_n_m_per_rad),
        ("wind-up", sheet.wind_up_arcsec),
        ("stress", sheet.max_von_mises_mpa),
        ("teeth in contact", sheet.teeth_in_contact_percent),
    ];
    for (what, value) in positive {
        if !value.is_some_and(|value| value.is_finite() && value > 0.0) {
            return Some(format!("{what} is {value:?}"));
        }
    }
    let (backlash, lost) = (sheet.backlash_arcsec?, sheet.lost_motion_arcsec?);
    if !(backlash >= -1e-6 && backlash < BACKLASH.0 * 60.0 + BACKLASH.1) {
        return Some(format!("backlash is {backlash} arcsec"));
    }
    if lost + 1e-6 < backlash {
        return Some(format!("lost motion of {lost} arcsec is less than the backlash of {backlash}"));
    }
    None
}

const HEADER: &str =
    "drive,teeth,module_mm,generator,sleeve,load_share,largest_n_m,verdict,seconds,last_stable_n_m,sets,why";

/// A row of the file.
fn line(number: usize, row: &Row) -> String {
    let of = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.6}"));
    let Drawn { kind, load_share, sleeve, few, sets } = &row.drawn;
    format!(
        "{number},{},{},{kind},{sleeve},{load_share:.3},{},{},{:.2},{},{},\"{}\"",
        few.teeth,
        few.module_mm,
        of(row.loads.map(|loads| loads.largest_n_m)),
        row.verdict,
        row.seconds,
        of(row.sheet.last_stable_n_m),
        sets.join(" "),
        row.why.replace('"', "'"),
    )
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let numbers = || Some((arguments.first()?.parse().ok()?, arguments.get(1)?.parse().ok()?));
    let (Some((count, seed)), Some(file)): (Option<(usize, u64)>, _) = (numbers(), arguments.get(2)) else {
        eprintln!("map_of_drives COUNT SEED FILE.csv [FIRST [slices]]");
        return ExitCode::from(2);
    };
    let first: usize = arguments.get(3).and_then(|first| first.parse().ok()).unwrap_or(0);
    let slices = arguments.get(4).is_some_and(|face| face == "slices");
    let out = match File::create(file).and_then(|mut out| writeln!(out, "{HEADER}").map(|()| out)) {
        Ok(out) => Mutex::new(out),
        Err(error) => {
            eprintln!("{file}: {error}");
            return ExitCode::from(2);
        }
    };
    let (done, lost) = (AtomicUsize::new(0), AtomicBool::new(false));
    let rows: Vec<Row> = (first..first + count)
        .into_par_iter()
        .with_max_len(1)
        .map(|number| {
            let row = run(seed, number, slices);
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            let mut out = out.lock().unwrap_or_else(PoisonError::into_inner);
            if let Err(error) = writeln!(out, "{}", line(number, &row)) {
                eprintln!("{file}: {error}");
                lost.store(true, Ordering::Relaxed);
            }
            eprintln!("{done}/{count} drive {number}: {} in {:.1} s {}", row.verdict, row.seconds, row.why);
            row
        })
        .collect();
    if lost.into_inner() {
        return ExitCode::from(2);
    }
    let of = |verdict: &str| rows.iter().filter(|row| row.verdict == verdict).count();
    for verdict in ["converged", "cautioned", "refused", "failed", "silent"] {
        println!("{verdict:<10} {:>4} of {count}", of(verdict));
    }
    let mut seconds: Vec<f64> = rows.iter().map(|row| row.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let at = |share: f64| seconds[((seconds.len() - 1) as f64 * share).round() as usize];
    println!("seconds: median {:.2}, 95 % {:.2}, longest {:.2}", at(0.5), at(0.95), at(1.0));
    let bad = of("silent") > 0 || of("failed") as f64 > MAY_FAIL * count as f64;
    ExitCode::from(u8::from(bad))
}
