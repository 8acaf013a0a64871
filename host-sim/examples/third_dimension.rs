//! Plane, cup and hermetic, with all four generators: `third_dimension [TORQUE_N_M [LEVEL]]`
//!
//! The figures of each drive as a catalogue would print them ([`flexspline_design::data_sheet`]), one row for each
//! drive and generator, with the load even along the face and with the face in slices, as a Markdown table. Torque 50
//! N·m and coarse mesh by default; a LEVEL is coarse, standard or fine. Where a drive finds no equilibrium its row has
//! the figures until there, and it ends with 1.

use std::process::ExitCode;
use std::time::Instant;

use flexspline_design::data_sheet::{DataSheet, Loads, data_sheet};
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Method, SolverSettings};
use rayon::prelude::*;

/// Torque of the docs, N·m.
const TORQUE_N_M: f64 = 50.0;
/// Positions over a tooth pitch.
const POSITIONS: usize = 8;
/// Taper of the rows with slices, mrad: that of the lowest peak along the face of `HHD-95-hermetic` under its cam, in
/// steps of 0.2; of a cup the tilt of its rim under the cam.
const TAPERS_MRAD: [(&str, f64); 2] = [("HHD-95-hermetic", 0.6), ("CUP-95", 5.5)];

/// A drive of the table and what was done to it.
struct Variant {
    drive: Drive,
    face: String,
}

fn variants() -> Vec<Variant> {
    let built_in = |name: &str| Drive::built_in(name).unwrap_or_else(|| panic!("{name} is built in"));
    let mut all: Vec<Variant> = ["HHD-95-plane", "CUP-95", "HHD-95-hermetic"]
        .map(|name| Variant { drive: built_in(name), face: "even".into() })
        .into();
    for (name, taper_mrad) in TAPERS_MRAD {
        for taper in [0.0, taper_mrad] {
            let sets = ["flexspline.face=slices".to_owned(), format!("flexspline.taper_mrad={taper}")];
            let drive = built_in(name).with_sets(sets.iter().map(String::as_str)).expect("fields of a drive");
            let face = if taper == 0.0 { "slices".into() } else { format!("slices, tapered by {taper} mrad") };
            all.push(Variant { drive, face });
        }
    }
    all
}

/// A column: its head, and its cell of a sheet.
type Column = (&'static str, fn(&DataSheet) -> Option<String>);

const COLUMNS: [Column; 9] = [
    ("backlash, ″", |s| Some(format!("{:.1}", s.backlash_arcsec?))),
    ("wind-up, ″", |s| Some(format!("{:.1}", s.wind_up_arcsec?))),
    ("error p-p, ″", |s| Some(format!("{:.2}", s.kinematic_error_pp_arcsec?))),
    ("von Mises, MPa", |s| Some(format!("{:.0}", s.max_von_mises_mpa?))),
    ("flank, MPa", |s| Some(format!("{:.0}", s.peak_flank_pressure_mpa?))),
    ("lobe, kN", |s| Some(format!("{:.2}", 1e-3 * s.lobe_force_n?))),
    ("tilt, mrad", |s| Some(format!("{:.2}", s.tilt_mrad?))),
    ("peak over mean", |s| Some(format!("{:.1}", s.load_across_face_peak_over_mean?))),
    ("teeth, %", |s| Some(format!("{:.1}", s.teeth_in_contact_percent?))),
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let torque_n_m = arguments.first().map_or(Some(TORQUE_N_M), |text| text.parse().ok().filter(|t: &f64| *t > 0.0));
    let level = match arguments.get(1).map(String::as_str) {
        None | Some("coarse") => Some(MeshLevel::Coarse),
        Some("standard") => Some(MeshLevel::Standard),
        Some("fine") => Some(MeshLevel::Fine),
        Some(_) => None,
    };
    let (Some(torque_n_m), Some(mesh)) = (torque_n_m, level) else {
        eprintln!("third_dimension [TORQUE_N_M [LEVEL]]: a torque above 0; coarse, standard or fine");
        return ExitCode::from(2);
    };
    let solver = SolverSettings { method: Method::Fast, mesh, ..SolverSettings::default() };
    let variants = variants();
    let jobs: Vec<(&Variant, GeneratorKind)> = variants
        .iter()
        .flat_map(|variant| GeneratorKind::ALL.into_iter().rev().map(move |kind| (variant, kind)))
        .collect();
    let rows: Vec<(String, bool)> = jobs
        .into_par_iter()
        .with_max_len(1)
        .map(|(Variant { drive, face }, kind)| {
            let (clock, temperature) = (Instant::now(), drive.temperature.reference_c);
            let (sheet, done) = data_sheet(drive, kind, temperature, Loads::up_to(torque_n_m), POSITIONS, solver);
            let ended = done.as_ref().err().map_or_else(String::new, |error| format!(": {error}"));
            eprintln!("{} {face}, {kind}, {:.1} s{ended}", drive.name, clock.elapsed().as_secs_f64());
            let cells = COLUMNS.map(|(_, of)| of(&sheet).unwrap_or_else(|| "—".into()));
            (format!("| `{}`, {face} | {kind} | {} |", drive.name, cells.join(" | ")), done.is_ok())
        })
        .collect();
    println!("| {torque_n_m} N·m | generator | {} |", COLUMNS.map(|(head, _)| head).join(" | "));
    println!("|{}", "---|".repeat(COLUMNS.len() + 2));
    rows.iter().for_each(|(row, _)| println!("{row}"));
    ExitCode::from(u8::from(rows.iter().any(|(_, whole)| !whole)))
}
