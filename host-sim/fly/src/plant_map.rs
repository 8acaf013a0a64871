//! Wind-up of the built-in drives: contact FEM at flank torques and phases that made no table, and the file that keeps
//! it.
//!
//! On frictionless flanks the drive is elastic: the error of the output depends on the phase within a tooth pitch and
//! on the torque that the flanks carry, and jumps by the clearance where this torque changes sign.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Problem, SolveError, SolverSettings};

/// Temperatures of a map that is computed, °C; between and beyond them the error is linear, because Young's modulus is.
const TEMPERATURES_C: [f64; 2] = [0.0, 40.0];
/// Least flank torque that is solved for, N·m; below it the error runs on along the straight line through the first two
/// nodes.
const LEAST_N_M: f64 = 1e-3;
/// Points of the interpolation over the phase.
const WIDTH: usize = 6;

/// Errors of the output at two temperatures.
#[derive(Debug, Clone, PartialEq)]
pub struct GearMap {
    /// Largest flank torque, N·m.
    pub largest_n_m: f64,
    /// Coulomb drag of the output, N·m.
    pub drag_n_m: f64,
    /// Teeth of the flexspline, which stands: periods of the ripple in one generator turn.
    pub teeth: f64,
    /// Generator over output.
    pub ratio: f64,
    temperatures_c: [f64; 2],
    /// Phases within one flexspline pitch, at the middle of as many equal parts.
    phases: usize,
    /// Error under positive flank torque at each temperature, rad: by flank torque, then phase.
    planes: [Vec<f64>; 2],
}

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    /// The FEM failed, or the drive did not settle.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// Friction on the flanks makes the error depend on more than phase and flank torque.
    #[error("flanks.friction_coefficient: found {0}, allowed: 0, as a map is elastic")]
    Friction(f64),
    /// A file that is no map.
    #[error("{file}: line {line}: not a line of a map; allowed: as GearMap::to_csv writes it")]
    File {
        /// Its name.
        file: String,
        /// Line, from 1.
        line: usize,
    },
}

impl GearMap {
    /// The map of a drive, by FEM in forward motion up to a load torque.
    ///
    /// # Errors
    /// [`MapError::Solve`], [`MapError::Friction`].
    pub fn compute(
        drive: &Drive,
        kind: GeneratorKind,
        largest_n_m: f64,
        settings: SolverSettings,
    ) -> Result<Self, MapError> {
        if drive.flanks.friction_coefficient != 0.0 {
            return Err(MapError::Friction(drive.flanks.friction_coefficient));
        }
        let [cold, warm] = TEMPERATURES_C;
        let at = |temperature_c| plane(drive, kind, largest_n_m, temperature_c, settings);
        let (cold, warm) = rayon::join(|| at(cold), || at(warm));
        Ok(Self {
            largest_n_m,
            drag_n_m: drive.output.drag_torque_n_m,
            teeth: f64::from(drive.flexspline.teeth),
            ratio: drive.ratio(),
            temperatures_c: TEMPERATURES_C,
            phases: size(kind)[1],
            planes: [cold?, warm?],
        })
    }

    /// As a file: a comment with drag, teeth and ratio, a header, then one line for each temperature and flank torque;
    /// errors in arc-seconds.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let Self { largest_n_m, drag_n_m, teeth, ratio, phases, .. } = *self;
        let mut text = format!("# drag_n_m={drag_n_m} teeth={teeth} ratio={ratio}\ntemperature_c,flank_torque_n_m");
        for phase in 0..phases {
            let _ = write!(text, ",error_arcsec_{phase}");
        }
        text.push('\n');
        for (temperature, plane) in self.temperatures_c.iter().zip(&self.planes) {
            let nodes = plane.len() / phases;
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
    ///
    /// # Errors
    /// [`MapError::File`].
    pub fn parse(file: &str, text: &str) -> Result<Self, MapError> {
        read(text).map_err(|line| MapError::File { file: file.to_owned(), line })
    }

    /// The drive at a temperature, °C.
    #[must_use]
    pub fn at(&self, temperature_c: f64) -> WindUp {
        let Self { largest_n_m, teeth, phases, temperatures_c: [cold, warm], .. } = *self;
        let share = (temperature_c - cold) / (warm - cold);
        let [first, second] = &self.planes;
        let mut plane = vec![0.0; phases];
        plane.extend(first.iter().zip(second).map(|(a, b)| a + share * (b - a)));
        // Where the load vanishes: the parabola through the first three nodes, which are evenly spaced in the fourth
        // root.
        for phase in 0..phases {
            let at = |row: usize| plane[row * phases + phase];
            plane[phase] = 3.0 * at(1) - 3.0 * at(2) + at(3);
        }
        WindUp { largest_n_m, teeth, phases, plane }
    }
}

/// A map from its file; the line, from 1, that is none.
fn read(text: &str) -> Result<GearMap, usize> {
    let mut lines = (1_usize..).zip(text.lines());
    let (_, first) = lines.next().ok_or(1_usize)?;
    let named = |name: &str| {
        let words = first.split_whitespace().filter_map(|word| word.split_once('='));
        words.filter(|(key, _)| *key == name).find_map(|(_, number)| number.parse::<f64>().ok()).ok_or(1_usize)
    };
    let (drag_n_m, teeth, ratio) = (named("drag_n_m")?, named("teeth")?, named("ratio")?);
    let phases = lines.next().ok_or(2_usize)?.1.split(',').count().saturating_sub(2);
    let mut temperatures_c = [f64::NAN; 2];
    let mut planes = [Vec::new(), Vec::new()];
    let (mut largest_n_m, mut last) = (0.0, 3);
    for (number, line) in lines {
        let fields: Result<Vec<f64>, _> = line.split(',').map(str::parse).collect();
        let fields = fields.ok().filter(|fields| fields.len() == phases + 2).ok_or(number)?;
        let (temperature, torque) = (fields[0], fields[1]);
        let warm = usize::from(!planes[0].is_empty() && temperature != temperatures_c[0]);
        if torque.is_nan() || torque <= 0.0 {
            return Err(number);
        }
        temperatures_c[warm] = temperature;
        planes[warm].extend(fields[2..].iter().map(|error| error / ARCSEC_PER_RAD));
        (largest_n_m, last) = (torque, number);
    }
    let [cold, warm] = planes.each_ref().map(Vec::len);
    let whole = temperatures_c[0] < temperatures_c[1] && cold == warm && cold >= 4 * phases && phases >= 8;
    if whole { Ok(GearMap { largest_n_m, drag_n_m, teeth, ratio, temperatures_c, phases, planes }) } else { Err(last) }
}

/// Error of the output of a drive at one temperature.
#[derive(Debug, Clone, PartialEq)]
pub struct WindUp {
    largest_n_m: f64,
    teeth: f64,
    phases: usize,
    /// By flank torque, then phase; the first row is no flank torque.
    plane: Vec<f64>,
}

impl WindUp {
    /// Error of the output with a flank torque at a generator angle, rad; exactly none on the flanks is the limit from
    /// the side of `sign`.
    #[must_use]
    pub fn elastic_error_rad(&self, generator_rad: f64, flank_n_m: f64, sign: f64) -> f64 {
        let phases = self.phases;
        let nodes = self.plane.len() / phases - 1;
        let turns = self.teeth * generator_rad * (1.0 / TAU);
        // A drive is its own mirror image.
        let turns = sign * turns;
        let phase = (turns - libm::floor(turns)) * phases as f64 - 0.5;
        let root = libm::sqrt(libm::sqrt((sign * flank_n_m).max(0.0) / self.largest_n_m)) * nodes as f64;
        let row = (root as usize).clamp(1, nodes - 2);
        let along = root - row as f64;
        let (below, above) = (along + 1.0, along - 1.0);
        let beyond = along - 2.0;
        let rows = [
            -along * above * beyond * (1.0 / 6.0),
            below * above * beyond * 0.5,
            -below * along * beyond * 0.5,
            below * along * above * (1.0 / 6.0),
        ];
        let first = libm::floor(phase);
        let columns = lagrange(phase - first);
        let first = first as isize - (WIDTH as isize / 2 - 1);
        let mut error = 0.0;
        for (k, row_weight) in rows.iter().enumerate() {
            let mut at_row = 0.0;
            for (j, weight) in columns.iter().enumerate() {
                let column = (first + j as isize).rem_euclid(phases as isize) as usize;
                at_row += weight * self.plane[(row + k - 1) * phases + column];
            }
            error += row_weight * at_row;
        }
        sign * error
    }
}

/// Weights of the six points −2 … 3 at a place between 0 and 1.
fn lagrange(x: f64) -> [f64; WIDTH] {
    let [a, b, c, d, e, f] = [x + 2.0, x + 1.0, x, x - 1.0, x - 2.0, x - 3.0];
    let (ab, ef) = (a * b, e * f);
    let (cd, abc, def) = (c * d, ab * c, d * ef);
    [
        b * cd * ef * (-1.0 / 120.0),
        a * cd * ef * (1.0 / 24.0),
        ab * def * (-1.0 / 12.0),
        abc * ef * (1.0 / 12.0),
        ab * cd * f * (-1.0 / 24.0),
        ab * cd * e * (1.0 / 120.0),
    ]
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
fn plane(
    drive: &Drive,
    kind: GeneratorKind,
    largest_n_m: f64,
    temperature_c: f64,
    settings: SolverSettings,
) -> Result<Vec<f64>, MapError> {
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
