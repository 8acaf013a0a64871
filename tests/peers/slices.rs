//! Leaning teeth in three dimensions: a few teeth of a loaded drive across their whole face, by CalculiX in solid
//! elements with contact, and by our plane slice with slices across the face ([`FaceLoad::Slices`]).
//!
//! ```text
//!      outer circle and cut faces: as our plane solution has them, turned by the output
//!     |    ___    ___    |
//!     |___/   \__/   \___|   spaces
//!      ___     __     ___
//!     |   \___/  \___/   |   teeth
//!     |__________________|
//!      bore and cut faces: as our plane solution has them, and lean times the place along the face
//! ```
//!
//! The plane meshes are extruded along the face. The flexspline's part starts undeformed where the plane solution has
//! it as a rigid body. Compared are the torque on the circular spline at the same output angle; that difference as an
//! output angle, by CalculiX's own stiffness against a small turn of the output; and the load along the face. CalculiX
//! prints no load by place: it is the penalty times the overclosure that its displacements give at our integration
//! points, relative to its mean.
//!
//! [`FaceLoad::Slices`]: flexspline_mechanics::drive::FaceLoad

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt::Write as _;
use std::path::Path;

use flexspline_mechanics::contact::{Configuration, FlankContact, FlankLaw, FlankPair, gauss_legendre};
use flexspline_mechanics::drive::{Drive, GeneratorKind, Side};
use flexspline_mechanics::mesh::{MeshLevel, WheelMesh};
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Method, Problem, SolverSettings, State};

use crate::Claims;
use crate::case::{ARCSEC, AS_IN_THE_DECK};
use crate::dat::{Table, at_step};
use crate::program::{Limits, calculix};

/// Penalty of both programs, N/mm³.
const PENALTY: f64 = 5e6;
const LAW: FlankLaw = FlankLaw { stiffness: PENALTY, stick_stiffness: 0.0, friction: 0.0 };
/// The loads, N m. A step of CalculiX each; then the last with the output turned on by [`NUDGE_RAD`].
const LOADS_N_M: [f64; 2] = [25.0, 50.0];
const NUDGE_RAD: f64 = 1e-6;
/// A load that takes the play away and winds nothing up, N m.
const TOUCH_N_M: f64 = 0.1;
/// Turn of the generator away from symmetry, in pitches.
const TURN: f64 = 0.3;
/// Pairs that stand further apart do not bear, mm.
const NEAR_MM: f64 = 0.01;
/// Parts of the face in which loads are compared, and steps to each.
const BINS: usize = 8;
const STEPS: usize = 12;
/// Straight teeth, and teeth tapered against the tilt of the rim.
const STRAIGHT: Face = Face::Slices(0.0);
const TAPERED: Face = Face::Slices(0.6);
/// Largest relative difference of the torque where nothing leans: the deck against our contact. Found: 0.6 %.
const EVEN_TORQUE: f64 = 0.01;
/// Largest difference of the output, as a part of the wind-up. Found: 0.1 %.
const OF_WIND_UP: f64 = 0.005;
/// Largest difference of the load along the face, as a part of its peak. Found: 5 % straight, 13 to 14 % tapered, where
/// 10 % was the aim.
const ALONG_STRAIGHT: f64 = 0.08;
const ALONG_TAPERED: f64 = 0.16;
/// Where a run stops being worth waiting for.
const LIMITS: Limits = Limits { cpu_s: 900.0, memory_mb: 4000.0 };

/// Ends along the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Ends {
    /// Nothing holds the ends of the face.
    Free,
    /// They move as normals of the rim do: plane strain where nothing leans.
    Plane,
    /// Layers that know nothing of one another, each in plane strain: slices without their compliance C.
    Apart,
}

/// How teeth lean in a case.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Face {
    Even,
    /// With a taper, mrad.
    Slices(f64),
}

/// Problem to solve. One tooth alone has its cut faces held right beside it, where the mean of the face has them.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Case {
    name: &'static str,
    face: Face,
    /// Teeth: that number about the one that bears most, or all that bear at one lobe and one to either side.
    teeth: Option<usize>,
    layers: usize,
    ends: Ends,
}

/// Results.
struct Found {
    /// Relative difference of the torque, CalculiX's over ours, at each load.
    torque: [f64; 2],
    /// How far our output is ahead by that, arc-seconds, and as a part of the wind-up.
    output_arcsec: [f64; 2],
    of_wind_up: [f64; 2],
    /// Load over its mean in parts of the face, of the pair that bears most at the last load: CalculiX's and ours.
    along: [Vec<f64>; 2],
}

impl Found {
    /// Largest difference of the load along the face over its largest.
    fn along_apart(&self) -> f64 {
        let [theirs, ours] = &self.along;
        let largest = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
        largest(&mut theirs.iter().zip(ours).map(|(a, b)| a - b)) / largest(&mut theirs.iter().copied())
    }
}

fn turned([x, y]: [f64; 2], angle_rad: f64) -> [f64; 2] {
    let (s, c) = angle_rad.sin_cos();
    [c * x - s * y, s * x + c * y]
}

fn configuration(state: &State) -> Configuration<'_> {
    Configuration { u: &state.u, v: &state.v, output_rad: state.output_rad, leans: &state.leans }
}

/// How the rim leans by its waves, anywhere around it.
struct Leaning {
    /// At each tooth: outward, the slope of that around, and around in the neutral layer (rad).
    teeth: Vec<[f64; 3]>,
    neutral_mm: f64,
}

impl Leaning {
    /// From the leans of the teeth half way up them: normals being straight, what is at a height z above the
    /// neutral layer leans around by `G + z/R (G - dT/dθ)`, T the lean outward.
    fn new(drive: &Drive, leans: &[[f64; 2]]) -> Leaning {
        let wheel = &drive.flexspline;
        let neutral_mm = wheel.neutral_radius_mm();
        let height = 0.5 * (wheel.root_radius_mm + wheel.tip_radius_mm) / neutral_mm - 1.0;
        let (n, taper) = (leans.len(), 1e-3 * wheel.taper_mrad);
        let step = TAU / n as f64;
        let teeth = (0..n).map(|k| {
            let out = |further: usize| leans[(k + further) % n][0];
            let slope = (8.0 * (out(1) - out(n - 1)) - (out(2) - out(n - 2))) / (12.0 * step);
            [leans[k][0] + taper, slope, (leans[k][1] + height * slope) / (1.0 + height)]
        });
        Leaning { teeth: teeth.collect(), neutral_mm }
    }

    /// By a cubic through four teeth.
    fn at(&self, angle_rad: f64) -> [f64; 3] {
        let n = self.teeth.len();
        let place = (angle_rad / TAU).rem_euclid(1.0) * n as f64;
        let t = place.fract();
        let weights = [
            -t * (t - 1.0) * (t - 2.0) / 6.0,
            (t * t - 1.0) * (t - 2.0) / 2.0,
            -t * (t + 1.0) * (t - 2.0) / 2.0,
            t * (t * t - 1.0) / 6.0,
        ];
        let first = place as usize + n - 1;
        std::array::from_fn(|i| (0..4).map(|k| weights[k] * self.teeth[(first + k) % n][i]).sum())
    }

    /// Displacement for 1 mm along the face.
    fn lean(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (angle, height) = (y.atan2(x), x.hypot(y) / self.neutral_mm - 1.0);
        let [out, slope, around] = self.at(angle);
        turned([out, around + height * (around - slope)], angle)
    }

    /// Displacement along the axis that goes with it, without shear, nothing at the angle `from_rad`.
    fn axial_mm(&self, [x, y]: [f64; 2], from_rad: f64) -> f64 {
        let angle = y.atan2(x);
        let by = (angle - from_rad + PI).rem_euclid(TAU) - PI;
        let rule = gauss_legendre(4);
        let around: f64 = rule.iter().map(|(xi, w)| 0.5 * w * self.at(from_rad + 0.5 * by * (1.0 + xi))[2]).sum();
        -self.neutral_mm * around * by - (x.hypot(y) - self.neutral_mm) * self.at(angle)[0]
    }
}

/// The drive of a case, loaded.
struct Loaded {
    problem: Problem,
    /// At each load, on all nodes.
    states: Vec<State>,
    wind_up_arcsec: Vec<f64>,
}

/// A pair that bears, its mean load (N/mm) and torque on the circular spline (N mm/mm).
type Bears = (FlankPair, f64, f64);

impl Loaded {
    fn new(face: Face) -> Result<Loaded, String> {
        let set = match face {
            Face::Even => "flexspline.face=even".to_owned(),
            Face::Slices(taper_mrad) => format!("flexspline.face=slices,flexspline.taper_mrad={taper_mrad}"),
        };
        let drive = Drive::hhd_95_hermetic().with_sets(AS_IN_THE_DECK).and_then(|drive| drive.with_set(&set));
        let drive = drive.map_err(|error| error.to_string())?;
        let settings = SolverSettings {
            method: Method::Fast,
            mesh: MeshLevel::Coarse,
            flank_penalty: PENALTY,
            ..SolverSettings::default()
        };
        let problem = Problem::new(&drive, GeneratorKind::Cam, drive.temperature.reference_c, settings)
            .map_err(|error| error.to_string())?;
        let (mut states, mut wind_up_arcsec) = (Vec::new(), Vec::new());
        let mut motion = Motion::deformed(&problem, 0.0).map_err(|error| error.to_string())?;
        motion.load(TOUCH_N_M).map_err(|error| error.to_string())?;
        motion.turn(TURN * motion.pitch()).map_err(|error| error.to_string())?;
        let touch_arcsec = motion.error_arcsec();
        for load in LOADS_N_M {
            motion.load(load).map_err(|error| error.to_string())?;
            wind_up_arcsec.push(motion.error_arcsec() - touch_arcsec);
            states.push(problem.whole_state(motion.state()).into_owned());
        }
        drop(motion);
        Ok(Loaded { problem, states, wind_up_arcsec })
    }

    fn flanks(&self) -> FlankContact<'_> {
        self.problem.flanks_on(&self.problem.flexspline, &self.problem.circular_spline)
    }

    fn last(&self) -> &State {
        &self.states[self.states.len() - 1]
    }

    fn bears(&self, state: &State) -> Vec<Bears> {
        let (flanks, at) = (self.flanks(), configuration(state));
        let of_pair = |pair: FlankPair| {
            let found = flanks.evaluate((pair, at), LAW, &flanks.layout(pair, at).points)?;
            (found.load > 0.0).then_some((pair, found.load, found.torque))
        };
        flanks.near_pairs(at, NEAR_MM).into_iter().filter_map(of_pair).collect()
    }

    /// The pair that bears most at the last load, first tooth and space of those about it, and how many.
    fn chosen(&self, teeth: Option<usize>) -> Result<(FlankPair, [usize; 2], usize), String> {
        let bears = self.bears(self.last());
        let most = bears.iter().max_by(|a, b| a.1.total_cmp(&b.1)).ok_or("no pair bears")?.0;
        let [n, spaces] = [&self.problem.flexspline, &self.problem.circular_spline].map(|mesh| mesh.teeth);
        let bears = |tooth: usize| bears.iter().any(|(pair, ..)| pair.tooth == tooth % n);
        let (before, count) = match teeth {
            Some(teeth) => ((teeth - 1) / 2, teeth),
            None => {
                // One beside those that bear, on either side.
                let before = (1..n).find(|k| !bears(most.tooth + n - k)).unwrap_or(0);
                let after = (1..n).find(|k| !bears(most.tooth + k)).unwrap_or(0);
                (before, before + after + 1)
            }
        };
        Ok((most, [(most.tooth + n - before) % n, (most.space + spaces - before) % spaces], count))
    }
}

/// Part of a case in one wheel.
struct Part<'m> {
    mesh: &'m WheelMesh,
    sectors: Vec<usize>,
    elements: Vec<[usize; 8]>,
    /// Nodes of the plane mesh, and whether each is held.
    held: BTreeMap<usize, bool>,
    /// Angle of its middle, rad.
    middle_rad: f64,
    /// Numbers in the deck: node of the plane mesh, layer, and lower, middle or upper in it.
    numbers: BTreeMap<(usize, usize, usize), usize>,
}

impl<'m> Part<'m> {
    fn new(mesh: &'m WheelMesh, first: usize, count: usize) -> Part<'m> {
        let sectors: Vec<usize> = (0..count).map(|k| (first + k) % mesh.teeth).collect();
        let per = mesh.elements_per_sector;
        let elements: Vec<[usize; 8]> = sectors
            .iter()
            .flat_map(|sector| &mesh.elements[sector * per..(sector + 1) * per])
            .map(|nodes| nodes.map(|n| n as usize))
            .collect();
        let middle_rad = mesh.sector_angle(first) + 0.5 * (count - 1) as f64 * mesh.pitch();
        let is_held = |n: usize| {
            let [x, y] = turned(mesh.nodes[n], -middle_rad);
            let on_cut = (y.atan2(x).abs() - 0.5 * count as f64 * mesh.pitch()).abs() < 1e-9;
            on_cut || (x.hypot(y) - mesh.base_radius).abs() < 1e-9
        };
        let held = elements.iter().flatten().map(|n| (*n, is_held(*n))).collect();
        Part { mesh, sectors, elements, held, middle_rad, numbers: BTreeMap::new() }
    }

    /// Nodes along a flank, from root to tip.
    fn flank(&self, sector: usize, side: Side) -> Vec<usize> {
        self.mesh.flanks[side.index()].nodes.iter().map(|n| self.mesh.node(sector as isize, *n)).collect()
    }

    /// Nodes at places of the face, as lower, middle and upper of each layer.
    fn number(&mut self, layers: usize, apart: bool, next: &mut usize) {
        let corners: BTreeSet<usize> = self.elements.iter().flat_map(|nodes| nodes[..4].to_vec()).collect();
        for layer in 0..layers {
            for n in self.held.keys() {
                for level in (0..3).filter(|level| *level != 1 || corners.contains(n)) {
                    let below = (level == 0 && !apart && layer > 0).then(|| self.numbers[&(*n, layer - 1, 2)]);
                    let number = below.unwrap_or(*next);
                    *next += usize::from(below.is_none());
                    self.numbers.insert((*n, layer, level), number);
                }
            }
        }
    }
}

/// Ends of layers along the face, mm from its middle: thinner toward both ends.
fn ends_of_layers(layers: usize, width_mm: f64) -> Vec<f64> {
    let place = |k: usize| 2.0 * k as f64 / layers as f64 - 1.0;
    (0..=layers).map(|k| 0.25 * width_mm * (place(k) + (FRAC_PI_2 * place(k)).sin())).collect()
}

/// The deck of a case.
struct Deck<'l> {
    loaded: &'l Loaded,
    case: Case,
    parts: [Part<'l>; 2],
    layers_mm: Vec<f64>,
    leaning: Vec<Option<Leaning>>,
    /// From where to where the part of the flexspline is moved as one, and by which angle.
    moved: ([f64; 2], [f64; 2], f64),
}

impl<'l> Deck<'l> {
    fn new(loaded: &'l Loaded, case: Case, first: [usize; 2], count: usize) -> Deck<'l> {
        let problem = &loaded.problem;
        let mut next = 1;
        let parts = [(&problem.flexspline, first[0]), (&problem.circular_spline, first[1])].map(|(mesh, first)| {
            let mut part = Part::new(mesh, first, count);
            part.number(case.layers, case.ends == Ends::Apart, &mut next);
            part
        });
        let leaning = loaded
            .states
            .iter()
            .map(|state| (case.face != Face::Even).then(|| Leaning::new(&problem.drive, &state.leans)));
        let u = &loaded.last().u;
        let places = parts[0].held.keys().map(|n| {
            let x = problem.flexspline.nodes[*n];
            [x, [x[0] + u[2 * n], x[1] + u[2 * n + 1]]]
        });
        let places: Vec<[[f64; 2]; 2]> = places.collect();
        let [from, to] = [0, 1]
            .map(|k| [0, 1].map(|axis| places.iter().map(|place| place[k][axis]).sum::<f64>() / places.len() as f64));
        let (mut across, mut along) = (0.0, 0.0);
        for [a, b] in &places {
            let (a, b) = ([a[0] - from[0], a[1] - from[1]], [b[0] - to[0], b[1] - to[1]]);
            across += a[0] * b[1] - a[1] * b[0];
            along += a[0] * b[0] + a[1] * b[1];
        }
        let layers_mm = ends_of_layers(case.layers, problem.drive.flexspline.width_mm);
        Deck { loaded, case, parts, layers_mm, leaning: leaning.collect(), moved: (from, to, across.atan2(along)) }
    }

    /// Place along the face of what is lower, middle or upper in a layer, mm.
    fn place_mm(&self, layer: usize, level: usize) -> f64 {
        let [a, b] = [self.layers_mm[layer], self.layers_mm[layer + 1]];
        a + 0.5 * level as f64 * (b - a)
    }

    /// Place along the face that decides the lean.
    fn leans_at_mm(&self, layer: usize, level: usize) -> f64 {
        self.place_mm(layer, if self.case.ends == Ends::Apart { 1 } else { level })
    }

    /// Where a node of the flexspline is drawn: teeth stand further in along the face by their taper.
    fn drawn(&self, n: usize, x_mm: f64) -> [f64; 2] {
        let wheel = &self.loaded.problem.drive.flexspline;
        let ([x, y], bore) = (self.parts[0].mesh.nodes[n], wheel.bore_radius_mm());
        let (r, angle, pitch) = (x.hypot(y), y.atan2(x), self.parts[0].mesh.pitch());
        // The rim between bore and teeth tapers with them, along its own radii.
        let part = ((r - bore) / (wheel.root_radius_mm - bore)).min(1.0);
        let outward = if part < 1.0 { angle } else { (angle / pitch).round() * pitch };
        let [dx, dy] = turned([-1e-3 * wheel.taper_mrad * part * x_mm, 0.0], outward);
        [x + dx, y + dy]
    }

    /// Where a node of wheel `k` starts.
    fn start(&self, k: usize, n: usize, x_mm: f64) -> [f64; 2] {
        if k == 1 {
            return turned(self.parts[1].mesh.nodes[n], self.loaded.last().output_rad);
        }
        let ([x, y], (from, to, angle)) = (self.drawn(n, x_mm), self.moved);
        let [x, y] = turned([x - from[0], y - from[1]], angle);
        [x + to[0], y + to[1]]
    }

    /// Where a held node is at the end of a step.
    fn end(&self, k: usize, n: usize, x_mm: f64, step: usize) -> [f64; 2] {
        let load = step.min(LOADS_N_M.len() - 1);
        let state = &self.loaded.states[load];
        let x = self.parts[k].mesh.nodes[n];
        if k == 1 {
            let nudge = if step > load { NUDGE_RAD } else { 0.0 };
            return turned([x[0] + state.v[2 * n], x[1] + state.v[2 * n + 1]], state.output_rad + nudge);
        }
        let drawn = self.drawn(n, x_mm);
        let lean = self.leaning[load].as_ref().map_or([0.0; 2], |leaning| leaning.lean(x));
        std::array::from_fn(|axis| drawn[axis] + state.u[2 * n + axis] + lean[axis] * x_mm)
    }

    fn text(&self) -> String {
        let mut text = String::from("*NODE, NSET=ALL\n");
        for (k, part) in self.parts.iter().enumerate() {
            let mut written = BTreeSet::new();
            for ((n, layer, level), number) in &part.numbers {
                if written.insert(*number) {
                    let [x, y] = self.start(k, *n, self.leans_at_mm(*layer, *level));
                    let _ = writeln!(text, "{number}, {x:.12e}, {y:.12e}, {:.12e}", self.place_mm(*layer, *level));
                }
            }
        }
        let mut faces = [const { [const { String::new() }; 2] }; 2];
        let mut element = 1;
        text += "*ELEMENT, TYPE=C3D20R, ELSET=CELLS\n";
        for (part, faces) in self.parts.iter().zip(&mut faces) {
            let middles = Side::BOTH.map(|side| {
                let flanks = part.sectors.iter().flat_map(|sector| part.flank(*sector, side).into_iter().skip(1));
                flanks.step_by(2).collect::<BTreeSet<usize>>()
            });
            for layer in 0..self.case.layers {
                for nodes in &part.elements {
                    let number = |k: usize, level: usize| part.numbers[&(nodes[k], layer, level)].to_string();
                    let level = |nodes: std::ops::Range<usize>, level: usize| nodes.map(move |k| (k, level));
                    let order = level(0..4, 0).chain(level(0..4, 2)).chain(level(4..8, 0)).chain(level(4..8, 2));
                    let list: Vec<String> = order.chain(level(0..4, 1)).map(|(k, l)| number(k, l)).collect();
                    let _ = writeln!(text, "{element}, {},\n{}", list[..10].join(", "), list[10..].join(", "));
                    for (faces, middles) in faces.iter_mut().zip(&middles) {
                        for edge in (0..4).filter(|edge| middles.contains(&nodes[4 + edge])) {
                            // Faces 3 to 6 of a brick stand on the edges of its first.
                            let _ = writeln!(faces, "{element}, S{}", edge + 3);
                        }
                    }
                    element += 1;
                }
            }
        }
        let list = |nodes: BTreeSet<usize>| nodes.iter().map(|n| format!("{n},\n")).collect::<String>();
        let flank_nodes = self.parts.iter().flat_map(|part| {
            let sides = Side::BOTH.into_iter();
            let nodes: BTreeSet<usize> =
                sides.flat_map(|side| part.sectors.iter().flat_map(move |sector| part.flank(*sector, side))).collect();
            let of_flanks = part.numbers.iter().filter(move |((n, ..), _)| nodes.contains(n));
            of_flanks.map(|(_, number)| *number).collect::<Vec<_>>()
        });
        let _ = write!(
            text,
            "*NSET, NSET=SPACE_HELD\n{}*NSET, NSET=FLANKS\n{}",
            list(self.space_held().into_keys().collect()),
            list(flank_nodes.collect())
        );
        for side in Side::BOTH.map(Side::index) {
            let [tooth, space] = [&faces[0][side], &faces[1][side]];
            let _ = write!(text, "*SURFACE, NAME=TOOTH{side}\n{tooth}*SURFACE, NAME=SPACE{side}\n{space}");
        }
        let material = &self.loaded.problem.drive.material;
        let _ = write!(
            text,
            "*MATERIAL, NAME=STEEL\n*ELASTIC\n{:e}, {}\n*SOLID SECTION, ELSET=CELLS, MATERIAL=STEEL\n*SURFACE \
             INTERACTION, NAME=BEARING\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{PENALTY:e}\n*CONTACT PAIR, \
             INTERACTION=BEARING, TYPE=SURFACE TO SURFACE\nTOOTH0, SPACE0\nTOOTH1, SPACE1\n",
            material.youngs_modulus_mpa, material.poissons_ratio
        );
        for step in 0..=LOADS_N_M.len() {
            text += "*STEP, NLGEOM, INC=200\n*STATIC\n0.5, 1.\n*BOUNDARY\n";
            for (k, part) in self.parts.iter().enumerate() {
                self.hold(k, part, step, &mut text);
            }
            text += "*NODE PRINT, NSET=SPACE_HELD, FREQUENCY=1000\nRF\n*NODE PRINT, NSET=FLANKS, \
                     FREQUENCY=1000\nU\n*END STEP\n";
        }
        text
    }

    /// Displacements of what is held of wheel `k` at the end of a step.
    fn hold(&self, k: usize, part: &Part, step: usize, text: &mut String) {
        let leaning = self.leaning[step.min(LOADS_N_M.len() - 1)].as_ref().filter(|_| k == 0);
        let mut held_along = false;
        let mut written = BTreeSet::new();
        for ((n, layer, level), number) in &part.numbers {
            if !written.insert(*number) {
                continue;
            }
            let (x_mm, is_held) = (self.leans_at_mm(*layer, *level), part.held[n]);
            if is_held {
                let (start, end) = (self.start(k, *n, x_mm), self.end(k, *n, x_mm, step));
                for axis in 0..2 {
                    let _ = writeln!(text, "{number}, {0}, {0}, {1:.12e}", axis + 1, end[axis] - start[axis]);
                }
            }
            let at_end = (*layer, *level) == (0, 0) || (*layer, *level) == (self.case.layers - 1, 2);
            let axial_mm = match self.case.ends {
                Ends::Apart => Some(0.0),
                Ends::Plane => at_end
                    .then(|| leaning.map_or(0.0, |leaning| leaning.axial_mm(part.mesh.nodes[*n], part.middle_rad))),
                // What is held across the axis cannot tilt.
                Ends::Free => (is_held && !held_along).then_some(0.0),
            };
            if let Some(axial_mm) = axial_mm {
                held_along = true;
                let _ = writeln!(text, "{number}, 3, 3, {axial_mm:.12e}");
            }
        }
    }

    /// Held nodes of the circular spline, by number, with their places.
    fn space_held(&self) -> BTreeMap<usize, [f64; 2]> {
        let part = &self.parts[1];
        let held = part.numbers.iter().filter(|((n, ..), _)| part.held[n]);
        held.map(|((n, ..), number)| (*number, self.start(1, *n, 0.0))).collect()
    }

    /// Torque on the circular spline at the end of a step, N mm.
    fn torque(&self, tables: &[Table], step: usize) -> Result<f64, String> {
        let rows = at_step(tables, "SPACE_HELD", step + 1).ok_or("no forces at the end of a step")?;
        let held = self.space_held();
        let torque = rows.iter().map(|row| {
            let [x, y] = held.get(&(row[0] as usize)).ok_or("a force on a node that is not held")?;
            // It is held against what it bears.
            Ok(y * row[1] - x * row[2])
        });
        torque.sum()
    }

    /// Load of a pair (N/mm) at equal steps along the face, by CalculiX's displacements at the end of a step.
    fn along(&self, tables: &[Table], step: usize, pair: FlankPair) -> Result<Vec<f64>, String> {
        let rows = at_step(tables, "FLANKS", step + 1).ok_or("no displacements at the end of a step")?;
        let moved: BTreeMap<usize, [f64; 2]> = rows.iter().map(|row| (row[0] as usize, [row[1], row[2]])).collect();
        let flanks = self.loaded.flanks();
        let output_rad = self.loaded.last().output_rad;
        let [mut u, mut v] = [0, 1].map(|k| vec![0.0; 2 * self.parts[k].mesh.nodes.len()]);
        let width = self.loaded.problem.drive.flexspline.width_mm;
        let at_step = |k: usize| {
            let x_mm = width * (k as f64 / (BINS * STEPS) as f64 - 0.5);
            let layer = self.layers_mm[1..self.case.layers].iter().filter(|end| **end < x_mm).count();
            let [a, b] = [self.layers_mm[layer], self.layers_mm[layer + 1]];
            let zeta = 2.0 * (x_mm - a) / (b - a) - 1.0;
            for (k, displacements) in [&mut u, &mut v].into_iter().enumerate() {
                let part = &self.parts[k];
                let chain = part.flank([pair.tooth, pair.space][k], pair.side);
                let place = |n: usize, level: usize| {
                    let start = self.start(k, n, self.leans_at_mm(layer, level));
                    let by = moved.get(&part.numbers[&(n, layer, level)]).copied().unwrap_or([f64::NAN; 2]);
                    [start[0] + by[0], start[1] + by[1]]
                };
                for (i, n) in chain.iter().enumerate() {
                    let mut at = [0.0; 2];
                    let mut add = |weight: f64, n: usize, level: usize| {
                        at.iter_mut().zip(place(n, level)).for_each(|(at, x)| *at += weight * x);
                    };
                    let (below, above, between) = (0.5 * (1.0 - zeta), 0.5 * (1.0 + zeta), 1.0 - zeta * zeta);
                    if i % 2 == 0 {
                        add(-zeta * below, *n, 0);
                        add(between, *n, 1);
                        add(zeta * above, *n, 2);
                    } else {
                        // In the middle of a face of eight nodes.
                        add(below, *n, 0);
                        add(above, *n, 2);
                        for n in [chain[i - 1], chain[i + 1]] {
                            add(0.5 * between, n, 1);
                            add(-0.25 * between, n, 0);
                            add(-0.25 * between, n, 2);
                        }
                    }
                    let at = if k == 0 { at } else { turned(at, -output_rad) };
                    for axis in 0..2 {
                        displacements[2 * n + axis] = at[axis] - part.mesh.nodes[*n][axis];
                    }
                }
            }
            let at = Configuration { u: &u, v: &v, output_rad, leans: &[] };
            let found = flanks.evaluate((pair, at), LAW, &flanks.layout(pair, at).points);
            found.map_or(0.0, |found| found.load)
        };
        let loads: Vec<f64> = (0..=BINS * STEPS).map(at_step).collect();
        if loads.iter().all(|load| load.is_finite()) { Ok(loads) } else { Err("a flank without displacements".into()) }
    }
}

/// Mean over equal steps, straight between them.
fn mean(values: &[f64]) -> f64 {
    values.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).sum::<f64>() / (values.len() - 1) as f64
}

/// Means in parts of the face, over the mean of all.
fn in_parts(values: &[f64]) -> Vec<f64> {
    let steps = (values.len() - 1) / BINS;
    (0..BINS).map(|k| mean(&values[k * steps..=(k + 1) * steps]) / mean(values)).collect()
}

fn found(ccx: &Path, out: &Path, case: Case) -> Result<Found, String> {
    let loaded = Loaded::new(case.face)?;
    let (most, first, count) = loaded.chosen(case.teeth)?;
    let deck = Deck::new(&loaded, case, first, count);
    let folder = out.join(format!("slices-{}", case.name));
    std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    std::fs::write(folder.join("slices.inp"), deck.text()).map_err(|error| error.to_string())?;
    let (used, tables) = calculix(ccx, &folder, "slices", LIMITS)?;

    println!("== {}: {count} teeth, {} layers, CalculiX {:.1} s", case.name, case.layers, used.cpu_s);
    let width = loaded.problem.drive.flexspline.width_mm;
    let (flanks, n) = (loaded.flanks(), loaded.problem.flexspline.teeth);
    let mut torques = Vec::new();
    let mut along = Default::default();
    for (step, state) in loaded.states.iter().enumerate() {
        let mut bears = loaded.bears(state);
        bears.retain(|(pair, ..)| (pair.tooth + n - first[0]) % n < count);
        let ours = width * bears.iter().map(|(.., torque)| torque).sum::<f64>();
        torques.push([deck.torque(&tables, step)?, ours]);
        for (pair, load, _) in bears {
            let at = configuration(state);
            let mut over_mean = flanks.load_over_mean((pair, at), LAW, &flanks.layout(pair, at).points);
            if over_mean.is_empty() {
                over_mean = vec![1.0; BINS + 1];
            }
            let theirs = deck.along(&tables, step, pair)?;
            let parts = [in_parts(&theirs), in_parts(&over_mean)];
            println!(
                "  {} N·m, tooth {}: {:.2} and {load:.2} N/mm, over the mean along the face {:.2?} and {:.2?}",
                LOADS_N_M[step],
                pair.tooth,
                mean(&theirs),
                parts[0],
                parts[1]
            );
            if pair == most {
                along = parts;
            }
        }
    }
    let nudged = deck.torque(&tables, LOADS_N_M.len())?;
    let stiffness = (nudged - torques[LOADS_N_M.len() - 1][0]) / NUDGE_RAD;
    let of = |of: &dyn Fn(usize) -> f64| [of(0), of(1)];
    let torque = of(&|k| torques[k][0] / torques[k][1] - 1.0);
    let output_arcsec = of(&|k| (torques[k][1] - torques[k][0]) / stiffness * ARCSEC);
    let of_wind_up = of(&|k| output_arcsec[k] / loaded.wind_up_arcsec[k]);
    let found = Found { torque, output_arcsec, of_wind_up, along };
    println!(
        "  torque {:+.2?} %, output {:+.3?}\" of {:.2?}\" of wind-up, load along the face {:.3} of its peak, {:.2e} N \
         mm/rad",
        found.torque.map(|part| 100.0 * part),
        found.output_arcsec,
        loaded.wind_up_arcsec,
        found.along_apart(),
        stiffness
    );
    Ok(found)
}

/// The cases of the short form, then those that only the long one has.
fn cases(long: bool) -> Vec<Case> {
    let short = Case { name: "even", face: Face::Even, teeth: Some(1), layers: 2, ends: Ends::Plane };
    let apart = Case { name: "tapered-apart", face: TAPERED, teeth: None, layers: 12, ends: Ends::Apart };
    let mut cases = vec![short, apart, Case { name: "straight-apart", face: STRAIGHT, ..apart }];
    if long {
        for (face, free, plane) in
            [(STRAIGHT, "straight-free", "straight-plane"), (TAPERED, "tapered-free", "tapered-plane")]
        {
            cases.push(Case { name: free, face, ends: Ends::Free, ..apart });
            cases.push(Case { name: plane, face, ends: Ends::Plane, ..apart });
        }
    }
    cases
}

/// Every case; what is to stand in the last line.
pub fn slices(ccx: &Path, out: &Path, long: bool, claims: &mut Claims) -> Result<String, String> {
    let mut lines = Vec::new();
    for case in cases(long) {
        let found = found(ccx, out, case)?;
        let most = |values: [f64; 2]| values.iter().map(|x| x.abs()).fold(0.0, f64::max);
        let percent = |part: f64| 100.0 * part;
        if case.face == Face::Even {
            claims.check(&format!("torque within {:.0} %", percent(EVEN_TORQUE)), most(found.torque) <= EVEN_TORQUE);
            lines.push(format!("even face in solids: torque {:.2} %", percent(most(found.torque))));
            continue;
        }
        let bound = if case.face == STRAIGHT { ALONG_STRAIGHT } else { ALONG_TAPERED };
        claims.check(
            &format!("output within {:.1} % of the wind-up", percent(OF_WIND_UP)),
            most(found.of_wind_up) <= OF_WIND_UP,
        );
        claims.check(
            &format!("load along the face within {:.0} % of its peak", percent(bound)),
            found.along_apart() <= bound,
        );
        lines.push(format!(
            "slices in solids, {}: torque {:+.1} %, output {:+.2}\" ({:+.2} % of the wind-up), load along the face \
             {:.0} % of its peak",
            case.name,
            percent(found.torque[1]),
            found.output_arcsec[1],
            percent(found.of_wind_up[1]),
            percent(found.along_apart())
        ));
    }
    Ok(lines.join("; "))
}
