//! CalculiX beside flexspline: the same deck, the same path, the same machine.
//!
//! For each case the command `flexspline export --format inp` writes a deck, `ccx` runs it on one thread, and each of
//! our solvers goes the same way on the same mesh: deformed, loaded, turned in increments, and at the end brought to
//! another load. Compared are the output angle, the wind-up between the two loads, the displacements of the bore, the
//! stress along it, and what both cost. The short form is a small drive with the cam on the coarse mesh; `--long` adds
//! HHD-95 and its standard mesh. A cup and a closed sleeve in solid elements stand beside our shells, a fine mesh of
//! one root fillet beside the stress that `simulate --stress` reports. A tooth slid along its space with friction
//! stands beside our flank contact. Teeth that lean along their face are solved in three dimensions and by our slices.
//! Rollers are not compared: see the header of `export/inp.rs`.
//!
//! Prints what it finds, a line for each claim, and one line of ratios at the end; ends with 1 if a claim fails.

mod case;
mod dat;
mod friction;
mod ours;
mod program;
mod root;
mod sleeve;
mod slices;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_mechanics::mesh::MeshLevel;

use case::{Case, Comparison};
use flexspline_mechanics::stepping::Method;
use ours::SOLVERS;
use program::Limits;

/// Contact penalties on bore and flanks in both programs, N/mm³. Ours is 5e7 on the flanks; ten times less moves the
/// output by 0.1″ and spares CalculiX iterations. Printed with each case: what our own penalties would change.
const PENALTIES: [f64; 2] = [1e6, 5e6];
/// Largest difference of the output angle, arc-seconds: 0.015 was found on both meshes.
const OUTPUT_ARCSEC: f64 = 0.1;
/// Largest relative difference of the wind-up.
const WIND_UP: f64 = 0.01;
/// Difference of the stress that 99 % of the points along the bore keep to, relative to the largest stress: CalculiX
/// itself moves single points by 0.5 to 2 MPa from run to run, with the last digits of the deck.
const STRESS: f64 = 0.03;
/// How many times less processor time than CalculiX an increment of our solver takes: from 60 000 unknowns on, and
/// below.
fn cpu_ratio(solver: Method, unknowns: usize) -> f64 {
    match (solver, unknowns >= LARGE) {
        (Method::Reference, true) => 60.0,
        (Method::Reference, false) => 20.0,
        (Method::Fast, true) => 2000.0,
        (Method::Fast, false) => 300.0,
    }
}
/// Unknowns from which the larger ratio is asserted.
const LARGE: usize = 60_000;

/// Run CalculiX and flexspline on the same deck and compare them
#[derive(Debug, Parser)]
struct Options {
    /// HHD-95 on both meshes too
    #[arg(long)]
    long: bool,
    /// Only this case, by its name; "root" for the root fillets, "friction" for the sliding tooth, "slices" for leaning
    /// teeth alone
    #[arg(long)]
    case: Option<String>,
    /// Folder for decks and outputs
    #[arg(long, default_value = "target/peers")]
    out: PathBuf,
    /// The program CalculiX
    #[arg(long, default_value = "ccx")]
    ccx: PathBuf,
    /// The command flexspline [default: beside this program]
    #[arg(long)]
    flexspline: Option<PathBuf>,
}

/// Claims, counted.
#[derive(Default)]
struct Claims {
    failed: usize,
}

impl Claims {
    fn check(&mut self, what: &str, holds: bool) {
        println!("  {} {what}", if holds { "ok    " } else { "FAILED" });
        self.failed += usize::from(!holds);
    }
}

fn main() -> ExitCode {
    let options = Options::parse();
    let mut claims = Claims::default();
    match peers(&options, &mut claims) {
        Ok(line) => println!("peers: {line}"),
        Err(error) => {
            println!("peers: FAILED: {error}");
            return ExitCode::FAILURE;
        }
    }
    if claims.failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn peers(options: &Options, claims: &mut Claims) -> Result<String, String> {
    let flexspline = match &options.flexspline {
        Some(path) => path.clone(),
        None => std::env::current_exe().map_err(|error| error.to_string())?.with_file_name("flexspline"),
    };
    let flexspline = std::path::absolute(flexspline).map_err(|error| error.to_string())?;
    let hhd_95 = Case {
        teeth: None,
        generator: GeneratorKind::Cam,
        mesh: MeshLevel::Coarse,
        torque_n_m: 50.0,
        last_torque_n_m: 25.0,
        increments: 2,
        step_rad: 0.01,
        penalties: PENALTIES,
    };
    // An increment of CalculiX takes more than a minute for HHD-95: the short form turns a drive of half of its
    // teeth once, and by a third of the angle.
    let short =
        Case { teeth: Some(100), torque_n_m: 8.0, last_torque_n_m: 4.0, increments: 1, step_rad: 0.003, ..hhd_95 };
    let mut cases = vec![short];
    if options.long || options.case.is_some() {
        cases.push(hhd_95);
        cases.push(Case { mesh: MeshLevel::Standard, ..hhd_95 });
    }
    if options.case.as_deref() == Some("root") {
        return root::fillets(&options.ccx, &options.out, claims);
    }
    if options.case.as_deref() == Some("friction") {
        return friction::friction(&options.ccx, &options.out, claims);
    }
    if options.case.as_deref() == Some("slices") {
        return slices::slices(&options.ccx, &options.out, options.long, claims);
    }
    if let Some(name) = &options.case {
        let names: Vec<String> = cases.iter().map(Case::name).collect();
        cases.retain(|case| case.name() == *name);
        if cases.is_empty() {
            return Err(format!("--case: found {name:?}, allowed: {}", names.join(", ")));
        }
    }
    let mut lines = Vec::new();
    if options.case.is_none() {
        lines.push(sleeve::sleeves(&options.ccx, &flexspline, &options.out, claims)?);
        lines.push(root::fillets(&options.ccx, &options.out, claims)?);
        lines.push(friction::friction(&options.ccx, &options.out, claims)?);
        lines.push(slices::slices(&options.ccx, &options.out, options.long, claims)?);
    }
    for case in cases {
        lines.push(beside(&case, options, &flexspline, claims)?);
    }
    Ok(lines.join("; "))
}

/// One case: everything that is printed and claimed about it, and its part of the last line.
fn beside(case: &Case, options: &Options, flexspline: &Path, claims: &mut Claims) -> Result<String, String> {
    let folder = options.out.join(case.name());
    let unknowns = case.problem(Method::Reference)?.degrees_of_freedom();
    println!("== {} at {} N·m, {unknowns} dof", case.name(), case.torque_n_m);
    let deck = case.export(flexspline, &folder)?;
    let peer = case.calculix(&options.ccx, &deck, Limits { cpu_s: 3600.0, memory_mb: 6000.0 })?;
    let rotation = &peer.cpu_s[1..=case.increments];
    let peer_cpu_s = rotation.iter().sum::<f64>() / rotation.len() as f64;
    println!(
        "  CalculiX: {:.0} s in all, {peer_cpu_s:.1} s per rotation increment, iterations {:?} (load, rotations, \
         load), {:.0} MB",
        peer.used.cpu_s, peer.iterations, peer.used.memory_mb
    );
    let mut costs = vec![format!("CalculiX {peer_cpu_s:.1} s")];
    let mut memory = vec![format!("CalculiX {:.0} MB", peer.used.memory_mb)];
    let mut agreement = String::new();
    for solver in SOLVERS {
        let problem = case.problem(solver)?;
        let ours = case.compare(&problem, &peer, flexspline, &folder)?;
        let ratio = peer_cpu_s / ours.cpu_s;
        report(&ours, ratio);
        if solver == Method::Reference {
            let moved = case.penalty_arcsec(&problem, &peer)?;
            println!("  our own penalties instead move our output by up to {moved:.3}\"");
        }
        let needed = cpu_ratio(solver, unknowns);
        claims.check(&format!("output within {OUTPUT_ARCSEC}\""), ours.output_arcsec <= OUTPUT_ARCSEC);
        claims.check(&format!("wind-up within {:.0} %", 100.0 * WIND_UP), ours.wind_up() <= WIND_UP);
        claims.check(&format!("stress along the bore within {:.0} %", 100.0 * STRESS), ours.stress() <= STRESS);
        claims.check(&format!("at least {needed} times less processor time"), ratio >= needed);
        costs.push(format!("{} {:.4} s ({ratio:.0}x)", solver, ours.cpu_s));
        memory.push(format!("{} {:.0} MB", solver, ours.memory_mb));
        if solver == Method::Reference {
            agreement = format!(
                "output angle differs {:.2}\", wind-up {:.2} %, stress {:.2} %",
                ours.output_arcsec,
                100.0 * ours.wind_up(),
                100.0 * ours.stress()
            );
        }
    }
    let line = format!(
        "{} {unknowns} dof, CPU per {} rad increment: {}; {agreement}; memory {}",
        case.name(),
        case.step_rad,
        costs.join(", "),
        memory.join(", ")
    );
    Ok(line)
}

fn report(ours: &Comparison, ratio: f64) {
    let [peer_wound, wound] = ours.wind_up_arcsec;
    let [apart_um, moved_um] = ours.bore_um;
    let [apart_mpa, common_mpa, rms_mpa, most_mpa] = ours.stress_mpa;
    println!(
        "  {}: {:.4} s per rotation increment of a run ({ratio:.0} times less), {:.4} s in the first after the load, \
         {:.0} MB",
        ours.solver, ours.cpu_s, ours.first_cpu_s, ours.memory_mb
    );
    println!(
        "  output angle: up to {:.3}\" apart, increments up to {:.3}\"",
        ours.output_arcsec, ours.increment_arcsec
    );
    println!("  wind-up between the loads: {peer_wound:.3}\" and {wound:.3}\"");
    println!("  bore: displacements up to {apart_um:.3} um apart, of {moved_um:.0} um");
    println!(
        "  von Mises along the bore: up to {apart_mpa:.2} MPa apart, 99 % within {common_mpa:.2} (rms {rms_mpa:.3}), \
         of {most_mpa:.0} MPa"
    );
}
