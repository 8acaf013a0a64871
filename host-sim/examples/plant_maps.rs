//! Wind-up of the four built-in drives by contact FEM, for `flexspline fly`; some 12 minutes:
//!
//! ```sh
//! cargo run --release --example plant_maps -- host-sim/fly/plant [GENERATOR...]
//! ```

use std::error::Error;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

use flexspline_base::output::write_whole;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Method, Problem, SolveError, SolverSettings};

/// Temperatures of a map, °C; between and beyond them the error is linear, because Young's modulus is.
const TEMPERATURES_C: [f64; 2] = [0.0, 40.0];
/// Least flank torque that is solved for, N·m; below it the error runs on along the straight line through the first two
/// nodes.
const LEAST_N_M: f64 = 1e-3;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (folder, kinds) = arguments.split_first().ok_or("allowed: FOLDER [GENERATOR...]")?;
    for kind in GeneratorKind::ALL.into_iter().filter(|kind| kinds.is_empty() || kinds.contains(&kind.to_string())) {
        let map = map(&Drive::hhd_95(), kind)?;
        write_whole(&Path::new(folder).join(format!("{kind}.csv")), |file| file.write_all(map.as_bytes()))?;
        println!("{kind}");
    }
    Ok(())
}

/// The map of a drive in forward motion: a comment with drag, teeth and ratio, a header, then one line for each
/// temperature and flank torque; errors in arc-seconds.
fn map(drive: &Drive, kind: GeneratorKind) -> Result<String, SolveError> {
    let [nodes, phases] = size(kind);
    let (drag_n_m, teeth) = (drive.output.drag_torque_n_m, drive.flexspline.teeth);
    let mut text =
        format!("# drag_n_m={drag_n_m} teeth={teeth} ratio={}\ntemperature_c,flank_torque_n_m", drive.ratio());
    for phase in 0..phases {
        let _ = write!(text, ",error_arcsec_{phase}");
    }
    text.push('\n');
    let [cold, warm] = TEMPERATURES_C;
    let (first, second) = rayon::join(|| plane(drive, kind, cold), || plane(drive, kind, warm));
    for (temperature_c, plane) in [(cold, first?), (warm, second?)] {
        for (node, row) in plane.chunks(phases).enumerate() {
            let _ = write!(text, "{temperature_c},{}", kind.rated_torque_n_m() * node_share(node, nodes));
            for error in row {
                let _ = write!(text, ",{:.3}", error * ARCSEC_PER_RAD);
            }
            text.push('\n');
        }
    }
    Ok(text)
}

/// Flank torque of node `k` of `n`, from 0, as a share of the largest: evenly spaced in the fourth root.
fn node_share(k: usize, n: usize) -> f64 {
    let part = (k + 1) as f64 / n as f64;
    part * part * part * part
}

/// Flank torques and phases: where rollers leave the rim unsupported, teeth come into contact one by one with a corner
/// in the wind-up at each, and it takes more of both.
fn size(kind: GeneratorKind) -> [usize; 2] {
    match kind {
        GeneratorKind::TwoRoller => [128, 32],
        GeneratorKind::FourRoller => [96, 32],
        GeneratorKind::DoubleDisc => [64, 16],
        GeneratorKind::Cam => [48, 16],
    }
}

/// One temperature, from light load to heavy.
fn plane(drive: &Drive, kind: GeneratorKind, temperature_c: f64) -> Result<Vec<f64>, SolveError> {
    let settings = SolverSettings { method: Method::Fast, ..SolverSettings::default() };
    let largest_n_m = kind.rated_torque_n_m();
    let [nodes, phases] = size(kind);
    let share = |node| node_share(node, nodes);
    let problem = Problem::new(drive, kind, temperature_c, settings)?;
    let step = TAU / f64::from(drive.flexspline.teeth) / phases as f64;
    let at = |index: usize| (index as f64 + 0.5) * step;
    let mut motion = Motion::deformed(&problem, at(0))?;
    let mut index = 0;
    let mut plane = vec![0.0; nodes * phases];
    let solved = (0..nodes).find(|node| largest_n_m * share(*node) >= LEAST_N_M).unwrap_or(nodes);
    for node in solved..nodes {
        let torque_n_m = drive.output.drag_torque_n_m + largest_n_m * share(node);
        motion.load(torque_n_m)?;
        while motion.settle_on(step)? {
            index += 1;
        }
        for _ in 0..phases {
            index += 1;
            motion.turn_to(at(index))?;
            plane[node * phases + index % phases] = motion.error_rad();
        }
    }
    let [first, second] = [solved, solved + 1].map(share);
    for node in 0..solved {
        let along = (share(node) - first) / (second - first);
        for phase in 0..phases {
            let [a, b] = [solved, solved + 1].map(|node| plane[node * phases + phase]);
            plane[node * phases + phase] = a + along * (b - a);
        }
    }
    Ok(plane)
}
