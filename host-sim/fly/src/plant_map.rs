//! Wind-up of the built-in drives: contact FEM at flank torques and phases that made no table, from the files of
//! `plant/` (`host-sim/examples/plant_maps.rs` makes them).
//!
//! On frictionless flanks the drive is elastic: the error of the output depends on the phase within a tooth pitch and
//! on the torque that the flanks carry, and jumps by the clearance where this torque changes sign.

use std::f64::consts::TAU;

use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::GeneratorKind;

/// Points of the interpolation over the phase.
const WIDTH: usize = 6;

/// Errors of the output at two temperatures.
#[derive(Debug, Clone, PartialEq)]
pub struct GearMap {
    /// Largest flank torque, N·m.
    pub largest_n_m: f64,
    /// Teeth of the flexspline, which stands: periods of the ripple in one generator turn.
    pub teeth: f64,
    /// °C; between and beyond them the error is linear, because Young's modulus is.
    temperatures_c: [f64; 2],
    /// Phases within one flexspline pitch, at the middle of as many equal parts.
    phases: usize,
    /// Error under positive flank torque at each temperature, rad: by flank torque, then phase.
    planes: [Vec<f64>; 2],
}

impl GearMap {
    /// That of HHD-95 with this generator.
    ///
    /// # Panics
    /// Never: the maps are those of this crate.
    pub fn of(kind: GeneratorKind) -> Self {
        let text = match kind {
            GeneratorKind::TwoRoller => include_str!("../plant/two-roller.csv"),
            GeneratorKind::FourRoller => include_str!("../plant/four-roller.csv"),
            GeneratorKind::DoubleDisc => include_str!("../plant/double-disc.csv"),
            GeneratorKind::Cam => include_str!("../plant/cam.csv"),
        };
        Self::parse(text).expect("the files of plant/ are maps")
    }

    /// From the text of a file: a comment with the teeth, a header, then one line for each temperature and flank
    /// torque, with errors in arc-seconds. `None` if it is no map.
    fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        let (_, teeth) = lines.next()?.split_once("teeth=")?;
        let teeth = teeth.split_whitespace().next()?.parse().ok()?;
        let phases = lines.next()?.split(',').count().checked_sub(2)?;
        let row = |line: &str| {
            let fields: Option<Vec<f64>> = line.split(',').map(|field| field.parse().ok()).collect();
            fields.filter(|fields| fields.len() == phases + 2)
        };
        let rows = lines.map(row).collect::<Option<Vec<_>>>()?;
        let (cold, warm) = rows.split_at(rows.len() / 2);
        let (first, last) = (cold.first()?, warm.last()?);
        let plane = |rows: &[Vec<f64>]| rows.iter().flat_map(|row| &row[2..]).map(|e| e / ARCSEC_PER_RAD).collect();
        Some(Self {
            largest_n_m: last[1],
            teeth,
            temperatures_c: [first[0], last[0]],
            phases,
            planes: [plane(cold), plane(warm)],
        })
    }

    /// The drive at a temperature, °C.
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
