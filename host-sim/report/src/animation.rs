//! The drive in motion, small enough for a page.
//!
//! A drive in steady motion repeats with the flexspline pitch p: at generator angle ψ + p everything, both wheels and
//! the generator, stands as at ψ, turned by p about the axis. What happens to tooth j at ψ is therefore what happened
//! to tooth 0 at ψ − j p, seen from the frame of the tooth: one function of the *phase* θ = j p − ψ describes all teeth
//! at all times. For the circular spline with its pitch q the phase is j q + ψ/ratio − ψ, and because p and q differ by
//! p/ratio that is (j − ψ/p) q: the same count of pitches. Where both wheels have an even number of teeth, two waves
//! make half a turn of phase enough.
//!
//! A FEM run over one pitch in [`FRAMES`] increments samples this function at `FRAMES` phases to each pitch, at once
//! for every tooth. A page draws sector j of a wheel at generator angle ψ from sample `FRAMES (j − ψ/p)`, interpolated,
//! whatever the angle: a whole turn, and more, from eight frames. Exact for drives that are alike from tooth to tooth;
//! others are refused.

use serde::Serialize;

use super::pack::Packed;
use super::sleeve_view::SleeveView;
use flexspline_design::simulate::stress::nodal_von_mises;
use flexspline_design::simulate::{Observation, Path, Row, SimulateError, SimulationSettings, simulate};
use flexspline_mechanics::contact::{BoreContact, BoreLaw, Configuration, FlankLaw, FlankPair, OpenEdges};
use flexspline_mechanics::drive::{Drive, GeneratorKind, Side};
use flexspline_mechanics::mesh::{MeshError, WheelMesh, rotate};
use flexspline_mechanics::stepping::{Problem, SolveError, SolverSettings, State};
use std::ops::ControlFlow;

/// Frames to a flexspline pitch.
pub const FRAMES: usize = 8;
/// Step (mm) in which displacements are stored: 0.1 µm.
const DISPLACEMENT_STEP_MM: f64 = 1e-4;
/// Flanks closer than this (mm) may touch between the points that the search looks at.
const NEAR_MM: f64 = 0.01;

/// One wheel: its first sector, and what happens to the sector in the course of a wave. Its arrays are packed apart.
#[derive(Debug, Clone, Serialize)]
pub struct WheelMotion {
    /// Sectors around the wheel.
    pub sectors: usize,
    /// Samples to half a turn of phase (or to a whole one, where the teeth are odd): the period of the fields below.
    pub samples: usize,
    /// Undeformed nodes of sector 0, axis along +x, mm.
    #[serde(skip)]
    pub nodes: Vec<[f64; 2]>,
    /// Elements: local node and sector (0 or 1) of eight nodes, corners first.
    #[serde(skip)]
    pub elements: Vec<[(usize, usize); 8]>,
    /// Displacement in the frame of the sector, mm: `[node][x, y][sample]`.
    #[serde(skip)]
    pub displacement_mm: Vec<f64>,
    /// Von Mises stress, MPa: `[node][sample]`.
    #[serde(skip)]
    pub von_mises_mpa: Vec<f64>,
}

/// Rows of [`Animation::forces`].
pub(crate) const FORCE_ROWS: usize = 10;

/// A drive over one pitch of steady motion. Its arrays are packed apart.
#[derive(Debug, Clone, Serialize)]
pub struct Animation {
    /// Which generator.
    #[serde(skip)]
    pub kind: GeneratorKind,
    /// [`FRAMES`], for the page's script.
    pub frames: usize,
    /// Load, N m.
    pub torque_n_m: f64,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Teeth to the ratio: generator turns to one output turn.
    pub ratio: f64,
    /// The flexspline, in its own frame, which stands.
    pub flexspline: WheelMotion,
    /// The circular spline, in the frame that turns with the output.
    pub circular_spline: WheelMotion,
    /// Closed outlines of the generator at angle 0, mm.
    #[serde(skip)]
    pub generator: Vec<Vec<[f64; 2]>>,
    /// Forces on a flexspline tooth in its frame, by sample: force x, y (N) and point x, y (mm) on its plus flank; the
    /// same of its minus flank; force x, y of the generator on its piece of the bore. `[row][sample]`.
    #[serde(skip)]
    pub forces: Vec<f64>,
    /// Radius at which the generator bears, mm.
    pub bore_radius_mm: f64,
    /// Error of the output at the frames, arcsec, by generator angle 0, p/8, … 7p/8.
    pub error_arcsec: Vec<f64>,
    /// The rows of the run, in the same order.
    pub rows: Vec<Row>,
    /// Largest stress anywhere, MPa: the end of the colour scale.
    pub peak_mpa: f64,
    /// The flexspline in three dimensions, of a drive whose sleeve is shells.
    pub sleeve: Option<SleeveView>,
}

/// Why there is no animation.
#[derive(Debug, thiserror::Error)]
pub enum AnimationError {
    /// The drive does not repeat from tooth to tooth.
    #[error("the drive does not repeat from tooth to tooth ({field}), so that one pitch does not show its whole turn")]
    NotPeriodic {
        /// The field of the drive.
        field: &'static str,
    },
    /// The run failed.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
}

/// Runs the drive over one pitch under a load and takes it down.
pub fn animate(
    drive: &Drive,
    kind: GeneratorKind,
    torque_n_m: f64,
    solver: SolverSettings,
) -> Result<Animation, AnimationError> {
    if let Some(field) = drive.as_built.first_not_uniform() {
        return Err(AnimationError::NotPeriodic { field });
    }
    let settings = SimulationSettings {
        torque_n_m,
        solver,
        increment_rad: Some(std::f64::consts::TAU / f64::from(drive.flexspline.teeth) / FRAMES as f64),
        ..SimulationSettings::new(kind, Path::Pitch)
    };
    let mut passing = Passing::new(drive);
    simulate(drive, &settings, &mut |now| {
        passing.see(now);
        ControlFlow::Continue(())
    })?;
    let made = passing.finish().map_err(|error| SimulateError::from(SolveError::from(error)))?;
    Ok(made.expect("a pitch has all frames"))
}

/// How near to a frame, in frames, a generator angle has to be: what rounding leaves of an angle of a thousand turns is
/// less.
const AT_A_FRAME: f64 = 1e-6;

/// A run that is watched for a pitch of steady motion: where its rows pass all frames one after the other, they are an
/// animation.
pub(crate) struct Passing {
    uniform: bool,
    taken: Option<Animation>,
    sleeve: Option<Result<Option<SleeveView>, MeshError>>,
    /// The rows at the frames so far, one after the other.
    rows: Vec<Row>,
}

impl Passing {
    /// Before the run.
    pub fn new(drive: &Drive) -> Passing {
        let uniform = drive.as_built.first_not_uniform().is_none();
        Passing { uniform, taken: None, sleeve: None, rows: Vec::new() }
    }

    /// Looks at an increment of the run.
    pub fn see(&mut self, now: &Observation<'_>) {
        let Some(row) = now.row.filter(|row| self.uniform && row.settled && self.rows.len() < FRAMES) else { return };
        let at = frames(now.problem, row.generator_rad);
        if (at - at.round()).abs() > AT_A_FRAME {
            return;
        }
        let goes_on = self.rows.last().is_none_or(|last| {
            let step = at - frames(now.problem, last.generator_rad);
            (step.abs() - 1.0).abs() < 2.0 * AT_A_FRAME
                && row.turn_rad * last.turn_rad > 0.0
                && (row.torque_n_m, row.temperature_c) == (last.torque_n_m, last.temperature_c)
        });
        if !goes_on {
            (self.taken, self.sleeve) = (None, None);
            self.rows.clear();
        }
        self.sleeve.get_or_insert_with(|| SleeveView::of(now.problem, now.state, &row.face));
        self.taken.get_or_insert_with(|| Animation::new(now.problem)).add(now.problem, now.state);
        self.rows.push(row.clone());
    }

    /// The animation; none where the run passed no whole pitch.
    ///
    /// # Errors
    /// The drive has no sleeve that can be shown.
    pub fn finish(self) -> Result<Option<Animation>, MeshError> {
        let Some(taken) = self.taken.filter(|_| self.rows.len() == FRAMES) else { return Ok(None) };
        let sleeve = self.sleeve.transpose()?.flatten();
        Ok(Some(Animation { sleeve, ..taken.finish(self.rows) }))
    }
}

impl WheelMotion {
    fn new(mesh: &WheelMesh, both_even: bool) -> WheelMotion {
        let per_sector = mesh.nodes_per_sector;
        let samples = FRAMES * if both_even { mesh.teeth / 2 } else { mesh.teeth };
        let place = |n: u32| (n as usize % per_sector, n as usize / per_sector);
        WheelMotion {
            sectors: mesh.teeth,
            samples,
            nodes: mesh.nodes[..per_sector].to_vec(),
            elements: mesh.elements[..mesh.elements_per_sector].iter().map(|e| e.map(place)).collect(),
            displacement_mm: vec![0.0; 2 * per_sector * samples],
            von_mises_mpa: vec![0.0; per_sector * samples],
        }
    }

    /// The sample that a sector is at in a frame; `frame` counts eighths of a pitch of the generator from angle 0.
    fn sample(&self, sector: usize, frame: i64) -> usize {
        (FRAMES as i64 * sector as i64 - frame).rem_euclid(self.samples as i64) as usize
    }

    /// Sectors that give every sample once.
    fn sampled(&self) -> std::ops::Range<usize> {
        0..self.samples / FRAMES
    }

    fn add(&mut self, mesh: &WheelMesh, field: &[f64], stress: &[f64], frame: i64) {
        for sector in self.sampled() {
            let s = self.sample(sector, frame);
            let (sin, cos) = mesh.sector_angle(sector).sin_cos();
            for k in 0..self.nodes.len() {
                let n = mesh.node(sector as isize, k as u32);
                let [x, y] = [field[2 * n], field[2 * n + 1]];
                self.displacement_mm[2 * k * self.samples + s] = cos * x + sin * y;
                self.displacement_mm[(2 * k + 1) * self.samples + s] = cos * y - sin * x;
                self.von_mises_mpa[k * self.samples + s] = stress[n];
            }
        }
    }

    /// Where a node of a sector is at a frame, in the frame of the wheel, mm.
    #[cfg(test)]
    fn position(&self, sector: usize, node: usize, frame: i64) -> [f64; 2] {
        let s = self.sample(sector, frame);
        let x = self.nodes[node][0] + self.displacement_mm[2 * node * self.samples + s];
        let y = self.nodes[node][1] + self.displacement_mm[(2 * node + 1) * self.samples + s];
        let (sin, cos) = (std::f64::consts::TAU * sector as f64 / self.sectors as f64).sin_cos();
        [cos * x - sin * y, sin * x + cos * y]
    }
}

/// Forces of the generator on the first teeth (N), added up over the piece of the bore under each, in the frame of the
/// tooth.
fn bore_forces(problem: &Problem, state: &State, teeth: usize) -> Vec<[f64; 2]> {
    let bore = BoreContact::new(problem.wheels().0, problem.settings.bore_points(problem.kind));
    let law =
        BoreLaw::new(problem.settings.bore_penalty(problem.kind), problem.drive.generator.bearing_stiffness_n_per_mm3);
    let width = problem.drive.flexspline.width_mm;
    let per_sector = bore.edges.len() / problem.flexspline.teeth;
    let mut forces = vec![[0.0; 2]; teeth];
    bore.evaluate(law, &problem.outline, state.generator_rad, &state.u, &mut OpenEdges::default(), |edge| {
        if let Some(sum) = forces.get_mut(edge.edge / per_sector) {
            for (k, force) in edge.force.iter().enumerate() {
                sum[k % 2] += force * width;
            }
        }
    });
    for (sector, force) in forces.iter_mut().enumerate() {
        *force = rotate(*force, (-problem.flexspline.sector_angle(sector)).sin_cos());
    }
    forces
}

/// A generator angle, counted in frames.
fn frames(problem: &Problem, generator_rad: f64) -> f64 {
    generator_rad * FRAMES as f64 / problem.flexspline.pitch()
}

/// Which eighth of a pitch a generator angle is.
fn frame_of(problem: &Problem, state: &State) -> i64 {
    frames(problem, state.generator_rad).round() as i64
}

/// The force of a flank of the circular spline on a tooth of the flexspline, in the frame of the tooth.
pub(super) struct FlankForce {
    /// The tooth, from 0.
    pub(super) tooth: usize,
    /// Which of its flanks.
    pub(super) side: Side,
    /// Force on the tooth, N.
    pub(super) force_n: [f64; 2],
    /// Where the resultant attacks, mm.
    point_mm: [f64; 2],
}

/// The normal forces of the flanks that bear on the teeth that are `wanted`, as resultants.
pub(super) fn flank_forces(problem: &Problem, state: &State, wanted: impl Fn(usize) -> bool) -> Vec<FlankForce> {
    let flanks = problem.flanks();
    let at = Configuration { u: &state.u, v: &state.v, output_rad: state.output_rad, leans: &state.leans };
    let law = FlankLaw { stiffness: problem.settings.flank_penalty, stick_stiffness: 0.0, friction: 0.0 };
    let width = problem.drive.flexspline.width_mm;
    let of_pair = |pair: FlankPair| {
        let layout = flanks.layout(pair, at);
        let contact = flanks.evaluate((pair, at), law, &layout.points)?;
        let [fx, fy] = contact.resultant;
        let force = fx.hypot(fy);
        // From the frame of the output to that of the tooth; the force on the tooth is the reaction.
        let turn = (state.output_rad - problem.flexspline.sector_angle(pair.tooth)).sin_cos();
        let force_n = rotate([-fx * width, -fy * width], turn);
        let point_mm = rotate(contact.attack.map(|x| x / force), turn);
        Some(FlankForce { tooth: pair.tooth, side: pair.side, force_n, point_mm })
    };
    flanks.near_pairs(at, NEAR_MM).into_iter().filter(|pair| wanted(pair.tooth)).filter_map(of_pair).collect()
}

/// Samples as they come in.
impl Animation {
    fn new(problem: &Problem) -> Animation {
        let both_even = problem.flexspline.teeth.is_multiple_of(2) && problem.circular_spline.teeth.is_multiple_of(2);
        let flexspline = WheelMotion::new(&problem.flexspline, both_even);
        Animation {
            kind: problem.kind,
            frames: FRAMES,
            torque_n_m: 0.0,
            temperature_c: 0.0,
            ratio: problem.drive.ratio(),
            forces: vec![0.0; FORCE_ROWS * flexspline.samples],
            flexspline,
            circular_spline: WheelMotion::new(&problem.circular_spline, both_even),
            generator: problem.outline.polyline(180),
            bore_radius_mm: problem.flexspline.base_radius,
            error_arcsec: vec![0.0; FRAMES],
            rows: Vec::new(),
            peak_mpa: 0.0,
            sleeve: None,
        }
    }

    fn add(&mut self, problem: &Problem, state: &State) {
        let frame = frame_of(problem, state);
        let whole = problem.whole_state(state);
        let stress = |mesh: &WheelMesh, field: &[f64]| nodal_von_mises(mesh, &problem.material, field);
        let (fs, cs) = (&problem.flexspline, &problem.circular_spline);
        self.flexspline.add(fs, &whole.u, &stress(fs, &whole.u), frame);
        self.circular_spline.add(cs, &whole.v, &stress(cs, &whole.v), frame);
        self.error_arcsec[frame.rem_euclid(FRAMES as i64) as usize] = problem.error_rad(state).to_degrees() * 3600.0;
        let sampled = self.flexspline.sampled();
        for found in flank_forces(problem, state, |tooth| sampled.contains(&tooth)) {
            let row = if found.side == Side::Plus { 0 } else { 4 };
            self.put(row, found.tooth, frame, found.force_n);
            self.put(row + 2, found.tooth, frame, found.point_mm);
        }
        for (sector, force) in bore_forces(problem, state, sampled.len()).into_iter().enumerate() {
            self.put(8, sector, frame, force);
        }
    }

    /// Adds `values` to rows of the forces, for the tooth of the sector.
    fn put(&mut self, row: usize, sector: usize, frame: i64, values: [f64; 2]) {
        let (s, samples) = (self.flexspline.sample(sector, frame), self.flexspline.samples);
        for (k, value) in values.into_iter().enumerate() {
            self.forces[(row + k) * samples + s] += value;
        }
    }

    fn finish(self, rows: Vec<Row>) -> Animation {
        let wheels = [&self.flexspline, &self.circular_spline];
        let peak_mpa = wheels.iter().flat_map(|wheel| wheel.von_mises_mpa.iter().copied()).fold(0.0, f64::max);
        let Row { torque_n_m, temperature_c, .. } = rows[0];
        Animation { torque_n_m, temperature_c, rows, peak_mpa, ..self }
    }
}

impl WheelMotion {
    /// Edges of sector 0 that belong to one element alone: start, middle, end, each as in [`WheelMotion::elements`].
    pub(crate) fn outline(&self) -> Vec<[(usize, usize); 3]> {
        // An edge between two sectors appears once in sector 0 and once, a sector on, in its neighbour.
        let key = |a: (usize, usize), b: (usize, usize)| {
            let least = a.1.min(b.1);
            let (a, b) = ((a.0, a.1 - least), (b.0, b.1 - least));
            (a.min(b), a.max(b))
        };
        let edges = || self.elements.iter().flat_map(|e| (0..4).map(|k| [e[k], e[4 + k], e[(k + 1) % 4]]));
        let mut users = std::collections::HashMap::new();
        for [a, _, b] in edges() {
            *users.entry(key(a, b)).or_insert(0) += 1;
        }
        edges().filter(|[a, _, b]| users[&key(*a, *b)] == 1).collect()
    }

    /// Its arrays for a page, named `<prefix>.nodes` and so on.
    fn pack(&self, prefix: &str, peak_mpa: f64) -> Vec<Packed> {
        let name = |part: &str| format!("{prefix}.{part}");
        let nodes = self.nodes.len();
        let elements = self.elements.iter().flatten().map(|(node, sector)| (node + sector * nodes) as f64);
        let outline: Vec<f64> =
            self.outline().iter().flatten().map(|(node, sector)| (node + sector * nodes) as f64).collect();
        // Beyond the end of the colour scale all colours are alike.
        vec![
            Packed::floats(name("nodes"), &[nodes, 2], self.nodes.iter().flatten().copied()),
            Packed::steps(name("elements"), &[self.elements.len(), 8], 1.0, &elements.collect::<Vec<_>>()),
            Packed::steps(name("outline"), &[self.outline().len(), 3], 1.0, &outline),
            Packed::steps(name("displacement"), &[nodes, 2, self.samples], DISPLACEMENT_STEP_MM, &self.displacement_mm),
            Packed::steps(name("stress"), &[nodes, self.samples], peak_mpa / 255.0, &self.von_mises_mpa),
        ]
    }
}

impl Animation {
    /// Its arrays for a page; names begin with the name of the generator.
    pub(crate) fn pack(&self) -> Vec<Packed> {
        let kind = self.kind;
        let mut packed = self.flexspline.pack(&format!("{kind}.flexspline"), self.peak_mpa);
        packed.extend(self.circular_spline.pack(&format!("{kind}.circular-spline"), self.peak_mpa));
        let points = self.generator.iter().map(Vec::len).next().unwrap_or(0);
        let outline = self.generator.iter().flatten().flatten().copied();
        packed.push(Packed::floats(format!("{kind}.generator"), &[self.generator.len(), points, 2], outline));
        let samples = self.flexspline.samples;
        // Newtons and millimetres both want about three digits beyond the point less than single precision has.
        packed.push(Packed::steps(format!("{kind}.forces"), &[FORCE_ROWS, samples], 1e-3, &self.forces));
        packed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::mesh::MeshLevel;

    /// Eight frames of one pitch must give back every node of every sector in a drive that has gone on for another
    /// pitch.
    #[test]
    fn eight_frames_describe_every_tooth_at_any_time() {
        let drive = Drive::hhd_95();
        let torque = 10.0;
        let animation = animate(&drive, GeneratorKind::Cam, torque, SolverSettings::fast(MeshLevel::Coarse)).unwrap();
        let pitch = std::f64::consts::TAU / 188.0;
        let far: Vec<_> = (0..=24)
            .map(|k| flexspline_design::simulate::PathPoint {
                generator_rad: pitch * f64::from(k) / 8.0,
                ..Default::default()
            })
            .collect();
        let settings = SimulationSettings {
            torque_n_m: torque,
            solver: SolverSettings::fast(MeshLevel::Coarse),
            ..SimulationSettings::new(GeneratorKind::Cam, Path::Points(far))
        };
        let mut checked = 0;
        let worst = |motion: &WheelMotion, mesh: &WheelMesh, field: &[f64], frame: i64| {
            let mut worst = 0.0_f64;
            for sector in 0..mesh.teeth {
                for k in 0..mesh.nodes_per_sector {
                    let n = mesh.node(sector as isize, k as u32);
                    let [x, y] = motion.position(sector, k, frame);
                    let at = [mesh.nodes[n][0] + field[2 * n], mesh.nodes[n][1] + field[2 * n + 1]];
                    worst = worst.max((x - at[0]).hypot(y - at[1]));
                }
            }
            worst
        };
        let mut passing = Passing::new(&drive);
        simulate(&drive, &settings, &mut |now| {
            passing.see(now);
            if now.row.is_some_and(|row| row.settled && row.step > 16) {
                let frame = frame_of(now.problem, now.state);
                let whole = now.problem.whole_state(now.state);
                let fs = worst(&animation.flexspline, &now.problem.flexspline, &whole.u, frame);
                let cs = worst(&animation.circular_spline, &now.problem.circular_spline, &whole.v, frame);
                assert!(fs < 1e-5 && cs < 1e-5, "frame {frame}: {fs} mm, {cs} mm");
                checked += 1;
            }
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(checked, 8);
        // What passes a pitch on its way is the same animation.
        let passed = passing.finish().unwrap().expect("a pitch of steady motion");
        let differ = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(differ(&passed.flexspline.displacement_mm, &animation.flexspline.displacement_mm) < 1e-5);
        assert!(differ(&passed.error_arcsec, &animation.error_arcsec) < 0.02);
        assert_eq!(passed.torque_n_m, torque);
        assert!(animation.peak_mpa > 100.0);
    }

    /// The arrows hold the load: their moments about the axis are the torque less the drag, and the generator carries
    /// what the flanks press inwards.
    #[test]
    fn the_forces_that_are_shown_hold_the_load() {
        let drive = Drive::hhd_95();
        let torque = 50.0;
        let a = animate(&drive, GeneratorKind::Cam, torque, SolverSettings::fast(MeshLevel::Coarse)).unwrap();
        let samples = a.flexspline.samples;
        let at = |row: usize, s: usize| a.forces[row * samples + s];
        for frame in 0..FRAMES {
            let (mut moment, mut inward, mut outward) = (0.0, 0.0, 0.0);
            for s in (frame..samples).step_by(FRAMES) {
                for row in [0, 4] {
                    moment += at(row + 2, s) * at(row + 1, s) - at(row + 3, s) * at(row, s);
                    inward -= at(row, s);
                }
                outward += at(8, s);
            }
            // Samples are half the teeth; the load turns the output forward and the drag holds it back.
            let found = 2e-3 * moment;
            assert!((found / (torque - drive.output.drag_torque_n_m) - 1.0).abs() < 0.01, "{found} N·m");
            assert!(inward > 0.0 && outward > inward, "{inward} N inwards, {outward} N outwards");
        }
    }

    /// A pitch that is passed under another load half way, or in steps that are no eighths, is none.
    #[test]
    fn what_is_no_steady_pitch_is_not_shown() {
        let drive = Drive::hhd_95();
        let pitch = std::f64::consts::TAU / 188.0;
        for (parts, half_way_n_m, shown) in [(8, 10.0, true), (8, 12.0, false), (7, 10.0, false)] {
            // A little less than two pitches: after a change at the first there is no second whole one.
            let points = (0..=2 * parts - 2).map(|k| flexspline_design::simulate::PathPoint {
                generator_rad: pitch * f64::from(k) / f64::from(parts),
                torque_n_m: Some(if k < parts { 10.0 } else { half_way_n_m }),
                temperature_c: None,
            });
            let path = Path::Points(points.collect());
            let settings = SimulationSettings {
                solver: SolverSettings::fast(MeshLevel::Coarse),
                ..SimulationSettings::new(GeneratorKind::Cam, path)
            };
            let mut passing = Passing::new(&drive);
            let mut settled = 0;
            simulate(&drive, &settings, &mut |now| {
                passing.see(now);
                settled += usize::from(now.row.is_some_and(|row| row.settled));
                ControlFlow::Continue(())
            })
            .unwrap();
            assert_eq!(passing.finish().unwrap().is_some(), shown, "{parts} parts, {half_way_n_m} N m");
            assert!(settled >= FRAMES, "{settled} settled rows of {parts} parts, {half_way_n_m} N m");
        }
    }

    #[test]
    fn what_does_not_repeat_is_refused() {
        let drive = Drive::hhd_95().with_set("as_built.circular_spline_eccentricity_um=10").unwrap();
        let error = animate(&drive, GeneratorKind::Cam, 0.0, SolverSettings::fast(MeshLevel::Coarse)).unwrap_err();
        assert!(error.to_string().contains("as_built.circular_spline_eccentricity_um"), "{error}");
    }

    /// Four generators on the standard mesh have to fit a page of 1.5 MB; the coarse mesh has half its nodes.
    #[test]
    fn a_drive_in_motion_is_small() {
        let a =
            animate(&Drive::hhd_95(), GeneratorKind::TwoRoller, 10.0, SolverSettings::fast(MeshLevel::Coarse)).unwrap();
        let packed = a.pack();
        let characters: usize = packed.iter().map(|p| p.text.len()).sum();
        let numbers = a.flexspline.displacement_mm.len() + a.circular_spline.displacement_mm.len();
        println!("{} kB for {numbers} displacements and their stresses", characters / 1000);
        assert!(characters < 120_000, "{characters}");
        let fine = packed.iter().find(|p| p.name == "two-roller.flexspline.displacement").unwrap();
        assert_eq!(fine.scale, DISPLACEMENT_STEP_MM);
    }
}
