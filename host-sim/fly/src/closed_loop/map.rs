//! The plant's numbers: contact FEM at flank torques and phases that made no table, and the file that keeps them.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use thiserror::Error;

use super::flight::gear::{GearMap, MOST, MapHeader, node_share, parse};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Problem, SolveError, SolverSettings};

/// Temperatures of the map, °C: the ends of the flight's; tables of HHD-95 have nodes at −60 and 80.
pub(crate) const TEMPERATURES_C: [f64; 2] = [0.0, 40.0];
/// Least flank torque that is solved for, N·m; below it the error runs on along the straight line through the first two
/// nodes.
const LEAST_N_M: f64 = 1e-3;

/// A map that owns its numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct DenseMap {
    /// Which generator.
    pub kind: GeneratorKind,
    header: MapHeader,
    planes: [Vec<f64>; 2],
}

/// Why there is no map.
#[derive(Debug, Error)]
pub enum MapError {
    /// The FEM failed, or the drive did not settle.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// Friction on the flanks makes the error depend on more than phase and flank torque.
    #[error("flanks.friction_coefficient: found {0}, allowed: 0, as the plant of the closed loop is elastic")]
    Friction(f64),
    /// A file that is no map.
    #[error("{file}: line {line}: {what}")]
    File {
        /// Its name.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What is wrong and what is allowed.
        what: String,
    },
}

impl DenseMap {
    /// The map of a drive, by FEM in forward motion up to a load torque.
    pub fn compute(
        drive: &Drive,
        kind: GeneratorKind,
        largest_n_m: f64,
        settings: SolverSettings,
    ) -> Result<Self, MapError> {
        if drive.flanks.friction_coefficient != 0.0 {
            return Err(MapError::Friction(drive.flanks.friction_coefficient));
        }
        let (nodes, phases) = size(kind);
        let [cold, warm] = TEMPERATURES_C;
        let at = |temperature_c| plane(drive, kind, largest_n_m, temperature_c, settings);
        let (cold, warm) = rayon::join(|| at(cold), || at(warm));
        let header = MapHeader {
            largest_n_m,
            drag_n_m: drive.output.drag_torque_n_m,
            teeth: f64::from(drive.flexspline.teeth),
            ratio: drive.ratio(),
            temperatures_c: TEMPERATURES_C,
            phases,
            nodes,
        };
        Ok(Self { kind, header, planes: [cold?, warm?] })
    }

    /// For the plant.
    pub fn view(&self) -> GearMap<'_> {
        let [cold, warm] = &self.planes;
        GearMap { header: self.header, planes: [cold, warm] }
    }

    /// As a file: errors in arc-seconds, one line for each temperature and flank torque.
    pub fn to_csv(&self) -> String {
        let MapHeader { largest_n_m, drag_n_m, teeth, ratio, phases, nodes, .. } = self.header;
        let mut text = String::new();
        let _ = writeln!(text, "# drag_n_m={drag_n_m} teeth={teeth} ratio={ratio}");
        text.push_str("temperature_c,flank_torque_n_m");
        for phase in 0..phases {
            let _ = write!(text, ",error_arcsec_{phase}");
        }
        text.push('\n');
        for (temperature, plane) in TEMPERATURES_C.iter().zip(&self.planes) {
            for (node, row) in plane.chunks(phases).enumerate() {
                let _ = write!(text, "{temperature},{}", largest_n_m * node_share(node, nodes));
                for error in row {
                    let _ = write!(text, ",{:.3}", error * ARCSEC_PER_RAD);
                }
                text.push('\n');
            }
        }
        text
    }

    /// From a file of [`Self::to_csv`].
    pub fn parse(kind: GeneratorKind, file: &str, text: &str) -> Result<Self, MapError> {
        let mut planes = Box::new([[0.0; MOST]; 2]);
        let header = parse(text, &mut planes).map_err(|line| MapError::File {
            file: file.to_owned(),
            line,
            what: "not a line of a plant; allowed: what DenseMap::to_csv writes".to_owned(),
        })?;
        let planes = planes.map(|plane| plane[..header.nodes * header.phases].to_vec());
        Ok(Self { kind, header, planes })
    }
}

/// Flank torques and phases: where rollers leave the rim unsupported, teeth come into contact one by one with a corner
/// in the wind-up at each, and it takes more of both.
fn size(kind: GeneratorKind) -> (usize, usize) {
    match kind {
        GeneratorKind::TwoRoller => (128, 32),
        GeneratorKind::FourRoller => (96, 32),
        GeneratorKind::DoubleDisc => (64, 16),
        GeneratorKind::Cam => (48, 16),
    }
}

/// One temperature, from light load to heavy.
fn plane(
    drive: &Drive,
    kind: GeneratorKind,
    largest_n_m: f64,
    temperature_c: f64,
    settings: SolverSettings,
) -> Result<Vec<f64>, MapError> {
    let (nodes, phases) = size(kind);
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
