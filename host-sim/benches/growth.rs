//! How the cost of a steady increment of the fast solver grows with teeth and with elements.
//!
//! ```text
//! cargo bench --bench growth
//! ```
//!
//! Prints a line for each drive and each mesh level: CPU milliseconds of an increment (median of several rounds, the
//! machine being shared), Newton iterations, factorisations and contacts, how the time is made up (the solver's own
//! wall clocks), and of the set-up. At the end the exponents `d log(y) / d log(N)` by least squares, of time and of
//! what touches, for teeth and for degrees of freedom; 1 is in proportion.
//!
//! Drives of other tooth counts are HHD-95 grown or shrunk at the same module ([`with_teeth`]). They turn by the same
//! fraction of a tooth pitch in each increment (0.01 rad of HHD-95) under a torque in proportion to the tooth count,
//! which leaves the share of teeth in contact about as it is; in proportion to its square, which loads each tooth of a
//! rigid wheel alike, more of them come to bear. What the generator supports is not similar whatever is done: w0 is one
//! module, so a rim of more teeth is bent less and more of it lies on a cam. The four-roller generator touches in a few
//! places however many teeth there are. The exponent depends on this choice of loads: say which when quoting it.

mod common;

use std::time::Duration;

use cpu_time::ProcessTime;
use flexspline_sim::drive::{Drive, GeneratorKind, RigidMesh};
use flexspline_sim::mesh::MeshLevel;
use flexspline_sim::stepping::{Effort, Method, Problem, SolverSettings};

use common::{Run, SETTLING, STEP_RAD};

const GENERATORS: [GeneratorKind; 2] = [GeneratorKind::Cam, GeneratorKind::FourRoller];
const TEETH: [u32; 3] = [100, 188, 300];
/// Of HHD-95.
const TORQUE_N_M: f64 = 50.0;
/// Rounds, and increments in each: after ten the phase within a tooth pitch comes round.
const ROUNDS: usize = 5;
const ROUND: usize = 20;

/// HHD-95 with another number of teeth of the same module: the wheels grow with the tooth count, and with them rim,
/// ring and rollers; tooth heights, fillets, clearances and the deflection w0 stay.
///
/// The teeth keep their place on the involute (profile shift and addendum in proportion to the tooth count), so that
/// the angle of the flanks, the thickness of the teeth in modules and the clearance stay as they were.
fn with_teeth(teeth: u32) -> Drive {
    let mut drive = Drive::hhd_95();
    let scale = f64::from(teeth) / f64::from(drive.flexspline.teeth);
    drive.name = format!("HHD-95 of {teeth} teeth");
    let f = &mut drive.flexspline;
    let moved = 0.5 * (f.root_radius_mm + f.tip_radius_mm) * (scale - 1.0);
    f.teeth = teeth;
    f.profile_shift *= scale;
    f.root_radius_mm += moved;
    f.tip_radius_mm += moved;
    f.rim_thickness_mm *= scale;
    let shift_of_a_tooth = f.profile_shift / f64::from(teeth);
    let c = &mut drive.circular_spline;
    // What the shift of the spaces is beyond that of the teeth is clearance.
    let clearance = c.profile_shift - shift_of_a_tooth * f64::from(c.teeth);
    let ring = c.outer_radius_mm - c.root_radius_mm;
    c.teeth = teeth + 2;
    c.profile_shift = shift_of_a_tooth * f64::from(c.teeth) + clearance;
    c.root_radius_mm += moved;
    c.tip_radius_mm += moved;
    c.outer_radius_mm = c.root_radius_mm + ring * scale;
    drive.generator.roller_diameter_mm *= scale;
    drive
}

/// Says what was made of the drive, and that its wheels mesh.
fn describe(drive: &Drive) {
    let rigid = RigidMesh::new(drive, GeneratorKind::Cam).expect("the drive is sound");
    let report = rigid.report(GeneratorKind::Cam).expect("the flanks meet");
    let radius = drive.flexspline.pitch_radius_mm();
    println!(
        "{}: pitch radius {radius:.2} mm, rim {:.2} mm, w0 {:.2} mm, rigid backlash {:.1} um at the pitch circle, {} \
         interferences",
        drive.name,
        drive.flexspline.rim_thickness_mm,
        drive.generator.w0_mm,
        report.backlash_rad * radius * 1e3,
        report.interferences.len(),
    );
    assert!(report.interferences.is_empty(), "a drive whose wheels interfere says nothing");
}

/// One measured case.
struct Case {
    teeth: f64,
    degrees_of_freedom: f64,
    ms: f64,
    flanks: f64,
    bore_edges: f64,
}

fn measure(drive: &Drive, kind: GeneratorKind, mesh: MeshLevel) -> Case {
    let settings = SolverSettings { method: Method::Fast, mesh, ..SolverSettings::default() };
    let scale = f64::from(drive.flexspline.teeth) / f64::from(Drive::hhd_95().flexspline.teeth);
    let clock = ProcessTime::now();
    let problem = Problem::new(drive, kind, drive.temperature.reference_c, settings).expect("the drive is sound");
    let set_up = clock.elapsed();
    let mut run = Run::new(&problem, TORQUE_N_M * scale, STEP_RAD / scale, SETTLING);
    let mut rounds: Vec<(Duration, usize, Effort)> = (0..ROUNDS)
        .map(|_| {
            run.reset();
            let clock = ProcessTime::now();
            (0..ROUND).for_each(|_| run.advance());
            (clock.elapsed(), run.iterations, run.motion.take_effort())
        })
        .collect();
    rounds.sort_by_key(|(time, ..)| *time);
    let (time, iterations, effort) = rounds[ROUNDS / 2];
    let each = |time: Duration| time.as_secs_f64() * 1e3 / ROUND as f64;
    let [flanks, bore_edges] = run.contacts;
    println!(
        "{kind} {}/{} {mesh}, {} dof: {:.2} ms CPU, {:.1} iterations, {:.2} factorisations, {flanks} flanks and \
         {bore_edges} bore edges touch; clocks: assembly {:.2}, contact {:.2}, factorisation {:.2}, solution {:.2} \
         ms; set-up {:.0} ms CPU",
        problem.flexspline.teeth,
        problem.circular_spline.teeth,
        problem.degrees_of_freedom(),
        each(time),
        iterations as f64 / ROUND as f64,
        effort.factorisations as f64 / ROUND as f64,
        each(effort.assembly),
        each(effort.contact),
        each(effort.factorisation),
        each(effort.solution),
        set_up.as_secs_f64() * 1e3,
    );
    Case {
        teeth: problem.flexspline.teeth as f64,
        degrees_of_freedom: problem.degrees_of_freedom() as f64,
        ms: each(time),
        flanks: flanks as f64,
        bore_edges: bore_edges as f64,
    }
}

/// Slope of log y over log x by least squares.
fn exponent(cases: &[Case], x: fn(&Case) -> f64, y: fn(&Case) -> f64) -> f64 {
    let logs: Vec<(f64, f64)> = cases.iter().map(|case| (x(case).ln(), y(case).ln())).collect();
    let n = logs.len() as f64;
    let middle = |part: fn(&(f64, f64)) -> f64| logs.iter().map(part).sum::<f64>() / n;
    let (mx, my) = (middle(|p| p.0), middle(|p| p.1));
    logs.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>() / logs.iter().map(|p| (p.0 - mx).powi(2)).sum::<f64>()
}

fn exponents(kind: GeneratorKind, cases: &[Case], name: &str, of: fn(&Case) -> f64) -> String {
    format!(
        "{kind}: d log / d log({name}): time {:.2}, flanks that touch {:.2}, bore edges that touch {:.2}",
        exponent(cases, of, |case| case.ms),
        exponent(cases, of, |case| case.flanks),
        exponent(cases, of, |case| case.bore_edges),
    )
}

fn main() {
    let drives = TEETH.map(with_teeth);
    drives.iter().for_each(describe);
    let mut summary = Vec::new();
    for kind in GENERATORS {
        let by_teeth = drives.each_ref().map(|drive| measure(drive, kind, MeshLevel::Standard));
        summary.push(exponents(kind, &by_teeth, "teeth", |case| case.teeth));
        let by_mesh = MeshLevel::ALL.map(|mesh| measure(&Drive::hhd_95(), kind, mesh));
        summary.push(exponents(kind, &by_mesh, "degrees of freedom", |case| case.degrees_of_freedom));
    }
    summary.iter().for_each(|line| println!("{line}"));
}
