//! The whole flexspline in three dimensions as a VTK unstructured grid: toothed rim and tubes, deformed.
//!
//! The rim is the plane mesh at places across its face (`VTK_HEXAHEDRON`, 12, between them): each node moves as its
//! plane slice does, and off the middle of the face by tilt and skew of the rim. The tubes are their middle surfaces
//! (`VTK_QUAD`, 9). Both follow the waves of the rim, n of 2 and more, that the contact FEM found
//! ([`flexspline_mechanics::sleeve`]); what turns or shifts the flexspline as a body (n = 0 and 1) is on the plane
//! slice alone.
//!
//! | field | on | what |
//! |---|---|---|
//! | `displacement` | points | from the undeformed flexspline, mm; z is the axis, from the flange to the bottom |
//! | `part` | cells | 0 toothed rim, 1 tube to the flange, 2 tube to the bottom |
//!
//! Points are deformed positions, mm; a filter such as ParaView's Warp By Vector makes more of them. Arrays as in
//! [`super::vtu`].

use std::f64::consts::TAU;
use std::io::{self, Write};

use super::vtu::CellGrid;
use flexspline_mechanics::mesh::MeshError;
use flexspline_mechanics::sleeve::{Flexspline3d, Station};
use flexspline_mechanics::stepping::{Problem, State};

/// Slices of the face, and of the circle of a tube.
const FACE_SLICES: usize = 8;
const CIRCLE_SLICES: usize = 192;

const VTK_QUAD: u8 = 9;
const VTK_HEXAHEDRON: u8 = 12;

/// One harmonic of the rim: its shape along the axis for 1 mm, and its amplitudes.
struct RimWave {
    n: f64,
    amplitudes: [f64; 2],
    shape: Vec<Station>,
}

impl RimWave {
    /// Displacement of the middle surface by station: along, around, outward, and the slope of the last.
    fn at(&self, station: &Station, angle: f64) -> [f64; 4] {
        let (sin, cos) = (self.n * angle).sin_cos();
        let [a, b] = self.amplitudes;
        let (even, odd) = (a * cos + b * sin, a * sin - b * cos);
        [station.along * even, station.around * odd, station.outward * even, station.slope * even]
    }
}

impl CellGrid {
    fn point(&mut self, at: [f64; 3], moved: [f64; 3]) {
        self.points.extend((0..3).map(|k| (at[k] + moved[k]) as f32));
        self.displacements.extend(moved.map(|x| x as f32));
    }
}

/// Writes the whole flexspline of a drive with a sleeve of shells, in a state. Nothing but the rim for a drive without.
///
/// # Errors
/// An impossible mesh of the teeth, or one of `out`.
pub fn write_whole_flexspline(out: &mut dyn Write, problem: &Problem, state: &State) -> io::Result<()> {
    let shells = Flexspline3d::of(&problem.drive, true).map_err(|error: MeshError| io::Error::other(error))?;
    let waves: Vec<RimWave> = problem
        .rim_waves(state)
        .into_iter()
        .map(|(n, amplitudes)| RimWave { n: f64::from(n), amplitudes, shape: shells.shape(n) })
        .collect();
    let mut grid = CellGrid { part: "part", ..CellGrid::default() };
    add_rim(&mut grid, problem, state, &waves);
    add_tubes(&mut grid, &shells, &waves);
    grid.write(out)
}

/// The plane mesh across the face: corners of its elements alone.
fn add_rim(grid: &mut CellGrid, problem: &Problem, state: &State, waves: &[RimWave]) {
    let state = &*problem.whole_state(state);
    let mesh = &problem.flexspline;
    let radius = problem.drive.flexspline.neutral_radius_mm();
    let half = 0.5 * problem.drive.flexspline.width_mm;
    let mut number = vec![usize::MAX; mesh.nodes.len()];
    let mut corners = Vec::new();
    for &node in mesh.elements.iter().flat_map(|element| &element[..4]) {
        let node = node as usize;
        if number[node] == usize::MAX {
            number[node] = corners.len();
            corners.push(node);
        }
    }
    // Middle of the rim, and the slopes of W and V there, by wave.
    let middle: Vec<(Station, f64, f64)> = waves.iter().map(|wave| slopes(&wave.shape)).collect();
    for slice in 0..=FACE_SLICES {
        let z = half * (2.0 * slice as f64 / FACE_SLICES as f64 - 1.0);
        for &node in &corners {
            let [x, y] = mesh.nodes[node];
            let (r, angle) = (x.hypot(y), y.atan2(x));
            let above = r - radius;
            let (mut along, mut out, mut around) = (0.0, 0.0, 0.0);
            for (wave, (station, tilt, skew)) in waves.iter().zip(&middle) {
                let leaning =
                    Station { around: skew + above / radius * (skew + wave.n * tilt), outward: *tilt, ..*station };
                let [u, v, w, slope] = wave.at(&leaning, angle);
                along += u - above * slope;
                out += z * w;
                around += z * v;
            }
            let (sin, cos) = angle.sin_cos();
            let [dx, dy] = [state.u[2 * node], state.u[2 * node + 1]];
            grid.point([x, y, z], [dx + out * cos - around * sin, dy + out * sin + around * cos, along]);
        }
    }
    let layer = corners.len();
    for slice in 0..FACE_SLICES {
        for element in &mesh.elements {
            let below: [usize; 4] = std::array::from_fn(|k| slice * layer + number[element[k] as usize]);
            grid.cell(&[below, below.map(|n| n + layer)].concat(), VTK_HEXAHEDRON, 0);
        }
    }
}

/// The station in the middle of the rim, with the slopes of W and V along the axis there.
fn slopes(shape: &[Station]) -> (Station, f64, f64) {
    let k = (1..shape.len() - 1).min_by(|a, b| shape[*a].x_mm.abs().total_cmp(&shape[*b].x_mm.abs())).unwrap_or(0);
    let (before, after) = (shape[k - 1], shape[k + 1]);
    let over = |of: fn(&Station) -> f64| (of(&after) - of(&before)) / (after.x_mm - before.x_mm);
    (shape[k], over(|s| s.outward), over(|s| s.around))
}

fn add_tubes(grid: &mut CellGrid, shells: &Flexspline3d, waves: &[RimWave]) {
    let half = 0.5 * shells.width_mm + 1e-9;
    let Some(first) = waves.first() else { return };
    // Other harmonics need other elements: all are read at the places of the first.
    let places: Vec<f64> = first.shape.iter().map(|station| station.x_mm).collect();
    for (part, there) in [(1, shells.flange.is_some()), (2, shells.bottom.is_some())] {
        let of_part = |x: &&f64| if part == 1 { **x <= -half + 2e-9 } else { **x >= half - 2e-9 };
        let places: Vec<f64> = places.iter().filter(of_part).copied().collect();
        if !there {
            continue;
        }
        let from = grid.points.len() / 3;
        for z in &places {
            for k in 0..CIRCLE_SLICES {
                let angle = TAU * k as f64 / CIRCLE_SLICES as f64;
                let (sin, cos) = angle.sin_cos();
                let (mut along, mut around, mut out) = (0.0, 0.0, 0.0);
                for wave in waves {
                    let [u, v, w, _] = wave.at(&station_at(&wave.shape, *z), angle);
                    (along, around, out) = (along + u, around + v, out + w);
                }
                let at = [shells.rim.radius_mm * cos, shells.rim.radius_mm * sin, *z];
                grid.point(at, [out * cos - around * sin, out * sin + around * cos, along]);
            }
        }
        for row in 0..places.len().saturating_sub(1) {
            for k in 0..CIRCLE_SLICES {
                let next = (k + 1) % CIRCLE_SLICES;
                let [a, b] = [row, row + 1].map(|row| from + row * CIRCLE_SLICES);
                grid.cell(&[a + k, a + next, b + next, b + k], VTK_QUAD, part);
            }
        }
    }
}

/// A shape between its stations.
pub fn station_at(shape: &[Station], x_mm: f64) -> Station {
    let after = shape.partition_point(|station| station.x_mm < x_mm).clamp(1, shape.len() - 1);
    let (a, b) = (shape[after - 1], shape[after]);
    let part = ((x_mm - a.x_mm) / (b.x_mm - a.x_mm)).clamp(0.0, 1.0);
    let between = |a: f64, b: f64| a + part * (b - a);
    Station {
        x_mm,
        along: between(a.along, b.along),
        around: between(a.around, b.around),
        outward: between(a.outward, b.outward),
        slope: between(a.slope, b.slope),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::drive::{Drive, GeneratorKind};
    use flexspline_mechanics::mesh::MeshLevel;
    use flexspline_mechanics::stepping::{Method, SolverSettings};

    /// Where rim and tube meet they move together; the bottom of a cup stays round; and at the open end the cone is
    /// widest.
    #[test]
    fn the_parts_of_a_cup_hang_together() {
        let settings = SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() };
        let problem = Problem::new(&Drive::cup_95(), GeneratorKind::Cam, 20.0, settings).unwrap();
        let state = problem.starting_shape(0.0);
        let shells = Flexspline3d::of(&problem.drive, true).unwrap();
        let waves: Vec<RimWave> = problem
            .rim_waves(&state)
            .into_iter()
            .map(|(n, amplitudes)| RimWave { n: f64::from(n), amplitudes, shape: shells.shape(n) })
            .collect();
        assert!((waves[0].amplitudes[0] / 0.5 - 1.0).abs() < 0.02 && waves[0].amplitudes[1].abs() < 1e-3);
        let mut grid = CellGrid::default();
        add_rim(&mut grid, &problem, &state, &waves);
        let rim = grid.points.len() / 3;
        add_tubes(&mut grid, &shells, &waves);
        let at = |n: usize| -> [f64; 3] { std::array::from_fn(|k| f64::from(grid.points[3 * n + k])) };
        let moved = |n: usize| -> [f64; 3] { std::array::from_fn(|k| f64::from(grid.displacements[3 * n + k])) };
        // On the major axis: the first ring of the tube, and the node of the rim's bore nearest to it.
        let tube = moved(rim);
        let edge = (0..rim)
            .filter(|n| (at(*n)[2] - moved(*n)[2] - 10.0).abs() < 1e-4)
            .min_by(|a, b| {
                let off = |n: usize| (at(n)[0] - at(rim)[0]).hypot(at(n)[1] - at(rim)[1]);
                off(*a).total_cmp(&off(*b))
            })
            .unwrap();
        for (a, b) in moved(edge).into_iter().zip(tube) {
            assert!((a - b).abs() < 0.02, "{:?} {tube:?}", moved(edge));
        }
        let last = grid.points.len() / 3 - CIRCLE_SLICES;
        assert!(moved(last)[0].abs() < 1e-6, "held in its plane");
        let widest = (0..rim).map(|n| moved(n)[0]).fold(0.0, f64::max);
        assert!((0.53..0.60).contains(&widest), "w0 and half a face of cone: {widest}");
        assert!(grid.connectivity.iter().all(|n| (*n as usize) < grid.points.len() / 3));
        let mut file = Vec::new();
        write_whole_flexspline(&mut file, &problem, &state).unwrap();
        assert!(String::from_utf8(file).unwrap().contains(&format!("NumberOfCells=\"{}\"", grid.types.len())));
    }
}
