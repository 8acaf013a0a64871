//! Friction: one tooth in one space, pressed, slid forth and back, by our contact and by CalculiX on the same nodes.
//!
//! ```text
//!      space (outer circle and faces held)        slide: along the flank, forth, a little back, back
//!     ----.        .----                          press: along the normal of the flank
//!          \/----\/
//!          /      \     tooth (bore and faces moved as one)
//!      ---'        '---
//! ```
//!
//! Both cells are elastic, so that a slide of a fraction of a micrometre sticks in one part of the flank and
//! slips in the other, and one of micrometres slips everywhere. Solved here with the elements and the flank contact of
//! the drive ([`FlankContact`]), by Newton's method with the slope of the friction by the gap in it; in CalculiX by
//! face-to-face contact with the same penalty, the same stick slope and `*FRICTION`. Compared are the torque on the
//! output, the force along the flank over that across it, the torque by which forth and back differ, and the share that
//! sticks.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use flexspline_mechanics::contact::{
    Configuration, FlankContact, FlankLaw, FlankPair, FrictionHistory, PairContribution,
};
use flexspline_mechanics::drive::{ActiveFlank, Drive, DriveError, FlankDeviations, Side, ToothFlank};
use flexspline_mechanics::fem::element::{PACKED, add_tangent_and_force, packed_index};
use flexspline_mechanics::fem::material::PlaneStrain;
use flexspline_mechanics::mesh::{MeshLevel, WheelMesh};

use crate::Claims;
use crate::case::AS_IN_THE_DECK;
use crate::dat::{at_step, tables};
use crate::program::{Limits, ccx_alone};

/// Coefficients: of the typical drive, and a dry one.
const COEFFICIENTS: [f64; 2] = [0.08, 0.2];
/// Penalty of both programs, N/mm³, and the stick slope that a drive takes of it.
const PENALTY: f64 = 5e6;
const STICK_SLOPE: f64 = 0.1 * PENALTY;
/// How far the tooth is pressed beyond where it touches, mm.
const PRESSED_MM: f64 = 2e-3;
/// The slides, in coefficients of friction times [`PRESSED_MM`]: pressed, slipping forth, turned back and partly stuck,
/// slipping back, turned forth and partly stuck.
const SLIDES: [f64; 5] = [0.0, 4.0, 3.2, -4.0, -3.2];
/// Those that slip everywhere; the next of each is the way turned back.
const FORTH: usize = 1;
const BACK: usize = 3;
/// Increments that CalculiX takes to each of them, ours being one: tips bear on lines, which CalculiX finds once in an
/// increment. In one, and slides twice as long, its torque was 0.5 to 1 % from ours.
const PARTS: usize = 8;
/// Largest relative difference of the torque on the output. Found: 0.22 %.
const TORQUE: f64 = 0.005;
/// Of the change of the force along the flank over that across it: from forth to back, and where the way turns. Found:
/// 0.21 and 0.25 %. A difference of 0.0004 to 0.0016 that is the same forth and back, its cause not found, falls out of
/// it.
const ALONG: f64 = 0.01;
/// Of the torque by which forth and back differ. Found: 1.8 %: the difference of two torques that are 25 times as
/// large.
const LOST: f64 = 0.03;
/// Difference of the share that sticks where the way turned: by length here, by the number of points in CalculiX, which
/// does not print their lengths. Found: 0.037.
const STICKS: f64 = 0.05;
/// Newton's method ends when no force is further from balance, N/mm, of hundreds.
const BALANCE: f64 = 1e-7;
const MOST_ITERATIONS: usize = 60;
/// A step that leaves more than this part of what was out of balance gained nothing. A guess.
const GAIN: f64 = 0.9;
/// A traction below this part of the limit sticks.
const STUCK: f64 = 0.999;
/// Where a run stops being worth waiting for; it takes three seconds.
const LIMITS: Limits = Limits { cpu_s: 60.0, memory_mb: 2000.0 };
const PAIR: FlankPair = FlankPair { tooth: 0, space: 0, side: Side::Plus };

/// Load of the space in a place of the path.
#[derive(Debug, Clone, Copy)]
struct Borne {
    /// Force on the space across the flank and along it, N/mm.
    force: [f64; 2],
    /// Torque on the output, N mm/mm.
    torque: f64,
    /// Share of the touching flank that sticks.
    sticks: f64,
}

impl Borne {
    /// Force along the flank over that across it.
    fn along(&self) -> f64 {
        self.force[1] / self.force[0]
    }
}

/// A wheel's sector with everything around it held.
struct Cell<'m> {
    mesh: &'m WheelMesh,
    /// Its nodes, and whether each is held.
    nodes: BTreeMap<usize, bool>,
}

impl<'m> Cell<'m> {
    fn new(mesh: &'m WheelMesh) -> Cell<'m> {
        let held = |n: usize| {
            let [x, y] = mesh.nodes[n];
            let on_face = (y.atan2(x).abs() - 0.5 * mesh.pitch()).abs() < 1e-9;
            on_face || (x.hypot(y) - mesh.base_radius).abs() < 1e-9
        };
        let elements = &mesh.elements[..mesh.elements_per_sector];
        Cell { mesh, nodes: elements.iter().flatten().map(|n| (*n as usize, held(*n as usize))).collect() }
    }

    /// Adds force and tangent of the elements; `row` gives the unknown of a degree of freedom, if it is free.
    fn add(&self, material: &PlaneStrain, u: &[f64], row: impl Fn(usize) -> Option<usize>, system: &mut System) {
        let elements = self.mesh.elements[..self.mesh.elements_per_sector].iter();
        for (nodes, points) in elements.zip(&self.mesh.gauss) {
            let dof: [usize; 16] = std::array::from_fn(|i| 2 * nodes[i / 2] as usize + i % 2);
            let (mut stiffness, mut force) = ([0.0; PACKED], [0.0; 16]);
            add_tangent_and_force(points, material, &dof.map(|k| u[k]), &mut stiffness, &mut force);
            let rows = dof.map(&row);
            for (i, at) in rows.iter().enumerate() {
                let Some(at) = *at else { continue };
                system.residual[at] += force[i];
                for (j, column) in rows.iter().enumerate() {
                    if let Some(column) = *column {
                        system.matrix[at][column] += stiffness[packed_index(i, j)];
                    }
                }
            }
        }
    }
}

/// Forces that are out of balance, and their slope by the unknowns.
struct System {
    matrix: Vec<Vec<f64>>,
    residual: Vec<f64>,
}

impl System {
    fn new(unknowns: usize) -> System {
        System { matrix: vec![vec![0.0; unknowns]; unknowns], residual: vec![0.0; unknowns] }
    }

    /// Elimination by the largest pivot of each column: friction makes the matrix unsymmetric.
    fn solve(mut self) -> Vec<f64> {
        let n = self.residual.len();
        for k in 0..n {
            let size = |i: &usize| self.matrix[*i][k].abs();
            let pivot = (k..n).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(k);
            self.matrix.swap(k, pivot);
            self.residual.swap(k, pivot);
            let (above, below) = self.matrix.split_at_mut(k + 1);
            let first = &above[k];
            for (i, row) in below.iter_mut().enumerate().filter(|(_, row)| row[k] != 0.0) {
                let factor = row[k] / first[k];
                row[k..].iter_mut().zip(&first[k..]).for_each(|(x, y)| *x -= factor * y);
                self.residual[k + 1 + i] -= factor * self.residual[k];
            }
        }
        for k in (0..n).rev() {
            let known: f64 = (k + 1..n).map(|j| self.matrix[k][j] * self.residual[j]).sum();
            self.residual[k] = (self.residual[k] - known) / self.matrix[k][k];
        }
        self.residual
    }
}

/// The pair of cells, ready to be pressed.
struct Pressed<'m> {
    tooth: Cell<'m>,
    space: Cell<'m>,
    flanks: FlankContact<'m>,
    material: PlaneStrain,
    /// Unknowns of the degrees of freedom of tooth and space, where they are free.
    rows: [Vec<Option<usize>>; 2],
    unknowns: usize,
    /// Normal of the flank of the space, into the space, and its tangent.
    normal: [f64; 2],
    tangent: [f64; 2],
    /// Where the tooth touches first, as a displacement of its cell.
    touching: [f64; 2],
}

impl<'m> Pressed<'m> {
    /// The tooth moved out by `out_mm`, then along the normal of the flank until it touches.
    fn new(
        meshes: [&'m WheelMesh; 2],
        flanks: FlankContact<'m>,
        material: PlaneStrain,
        out_mm: f64,
    ) -> Result<Pressed<'m>, String> {
        let [tooth, space] = meshes.map(Cell::new);
        let mut unknowns = 0;
        let rows = [&tooth, &space].map(|cell| {
            let mut rows = vec![None; 2 * cell.mesh.nodes.len()];
            for n in cell.nodes.iter().filter(|(_, held)| !**held).map(|(n, _)| *n) {
                for row in &mut rows[2 * n..2 * n + 2] {
                    *row = Some(unknowns);
                    unknowns += 1;
                }
            }
            rows
        });
        let middle = flanks.tooth.point(0.5 * (flanks.tooth.start_radius + flanks.tooth.junction_radius));
        let foot = flanks.space.foot_internal([middle[0] + out_mm, middle[1]]);
        let (normal, tangent) = (foot.normal, foot.tangent);
        let mut pressed =
            Pressed { tooth, space, flanks, material, rows, unknowns, normal, tangent, touching: [out_mm, 0.0] };
        let v = vec![0.0; 2 * pressed.space.mesh.nodes.len()];
        for _ in 0..8 {
            let u = pressed.moved(pressed.touching);
            let gap = pressed.flanks.smallest_gap(PAIR, configuration(&u, &v));
            if !gap.is_finite() {
                return Err("the tooth is nowhere near the flank of its space".to_owned());
            }
            pressed.touching.iter_mut().zip(normal).for_each(|(x, n)| *x -= gap * n);
        }
        Ok(pressed)
    }

    /// The tooth's cell moved as one.
    fn moved(&self, by: [f64; 2]) -> Vec<f64> {
        by.repeat(self.tooth.mesh.nodes.len())
    }

    /// How far the held nodes of the tooth stand from where it touches, in a place of the path.
    fn held(&self, friction: f64, slide: f64) -> [f64; 2] {
        let along = slide * friction * PRESSED_MM;
        std::array::from_fn(|k| -PRESSED_MM * self.normal[k] + along * self.tangent[k])
    }

    /// Our solution along the path.
    fn ours(&self, friction: f64) -> Result<Vec<Borne>, String> {
        let law = FlankLaw { stiffness: PENALTY, stick_stiffness: STICK_SLOPE, friction };
        let (mut u, mut v) = (self.moved(self.touching), vec![0.0; 2 * self.space.mesh.nodes.len()]);
        let mut history = FrictionHistory::new();
        let mut stood = [0.0; 2];
        let mut path = Vec::new();
        for slide in SLIDES {
            let mut points = self.flanks.layout(PAIR, configuration(&u, &v)).points;
            self.flanks.start_friction((PAIR, configuration(&u, &v)), &history, &mut points);
            let stands = self.held(friction, slide);
            let by = [stands[0] - stood[0], stands[1] - stood[1]];
            u.chunks_exact_mut(2).for_each(|u| (u[0], u[1]) = (u[0] + by[0], u[1] + by[1]));
            stood = stands;
            let mut iterations = 0;
            let (mut step, mut smallest) = (vec![0.0; self.unknowns], f64::INFINITY);
            let pair = loop {
                let mut system = System::new(self.unknowns);
                self.tooth.add(&self.material, &u, |k| self.rows[0][k], &mut system);
                self.space.add(&self.material, &v, |k| self.rows[1][k], &mut system);
                let pair = self.flanks.evaluate((PAIR, configuration(&u, &v)), law, &points);
                let fs = self.flanks.fs_nodes(PAIR).flat_map(|n| [2 * n, 2 * n + 1]).map(|k| self.rows[0][k]);
                let cs = self.flanks.cs_nodes(PAIR).flat_map(|n| [2 * n, 2 * n + 1]).map(|k| self.rows[1][k]);
                let rows: Vec<Option<usize>> = fs.chain(cs).collect();
                if let Some(pair) = &pair {
                    add_contact(pair, &rows, &mut system);
                }
                let largest = system.residual.iter().fold(0.0_f64, |most, force| most.max(force.abs()));
                if largest < BALANCE {
                    break pair.ok_or("the tooth came off its space")?;
                }
                iterations += 1;
                if iterations > MOST_ITERATIONS {
                    return Err(format!(
                        "no balance after {MOST_ITERATIONS} iterations, friction {friction}, slide {slide}"
                    ));
                }
                // Points that stick and slip by turns send whole steps to and fro: half of a step goes back where it
                // gained nothing.
                if largest < GAIN * smallest {
                    smallest = largest;
                    step = system.solve();
                } else {
                    step.iter_mut().for_each(|x| *x *= -0.5);
                    smallest = f64::INFINITY;
                }
                for (values, rows) in [(&mut u, &self.rows[0]), (&mut v, &self.rows[1])] {
                    for (value, row) in values.iter_mut().zip(rows) {
                        *value -= row.map_or(0.0, |row| step[row]);
                    }
                }
            };
            let at = configuration(&u, &v);
            history = self.flanks.friction_history((PAIR, at), law, &points);
            let mut sticks = [0.0; 2];
            let mut tractions = history.iter();
            self.flanks.gaps((PAIR, at), &points, f64::INFINITY, &mut |gap, _, weight| {
                let limit = -friction * PENALTY * gap;
                let traction = tractions.next().map_or(0.0, |(_, traction)| traction.abs());
                if limit > 0.0 {
                    sticks[0] += weight;
                    sticks[1] += if traction < STUCK * limit { weight } else { 0.0 };
                }
            });
            path.push(self.borne(pair.resultant, pair.torque, sticks[1] / sticks[0]));
        }
        Ok(path)
    }

    fn borne(&self, force: [f64; 2], torque: f64, sticks: f64) -> Borne {
        let along = |c: [f64; 2]| force[0] * c[0] + force[1] * c[1];
        Borne { force: [-along(self.normal), along(self.tangent)], torque, sticks }
    }
}

fn configuration<'s>(u: &'s [f64], v: &'s [f64]) -> Configuration<'s> {
    Configuration { u, v, output_rad: 0.0, leans: &[] }
}

fn add_contact(pair: &PairContribution, rows: &[Option<usize>], system: &mut System) {
    let n = rows.len();
    for (i, at) in rows.iter().enumerate() {
        let Some(at) = *at else { continue };
        system.residual[at] -= pair.force[i];
        for (j, column) in rows.iter().enumerate() {
            if let Some(column) = *column {
                system.matrix[at][column] += pair.stiffness[i.max(j) * n + i.min(j)];
            }
        }
    }
    for point in &pair.slipping {
        for (i, slip) in point.index.iter().zip(&point.slip) {
            for (j, gap) in point.index.iter().zip(&point.gap) {
                if let (Some(at), Some(column)) = (rows[*i], rows[*j]) {
                    system.matrix[at][column] += point.stiffness * slip * gap;
                }
            }
        }
    }
}

/// Both coefficients; what is to stand in the last line.
pub fn friction(ccx: &Path, out: &Path, claims: &mut Claims) -> Result<String, String> {
    let drive = Drive::hhd_95().with_sets(AS_IN_THE_DECK).map_err(|error| error.to_string())?;
    let fs = WheelMesh::flexspline(&drive, MeshLevel::Standard).map_err(|error| error.to_string())?;
    let cs = WheelMesh::circular_spline(&drive, MeshLevel::Standard).map_err(|error| error.to_string())?;
    let flank = |outline: Result<ToothFlank, _>| outline.map(|o| ActiveFlank::new(&o));
    let error = |error: DriveError| error.to_string();
    let tooth = flank(ToothFlank::external(&drive)).map_err(error)?;
    let space = flank(ToothFlank::internal(&drive)).map_err(error)?;
    let deviations = FlankDeviations::new(&drive);
    let flanks = FlankContact::new(&fs, &cs, tooth, space, &deviations);
    let material = PlaneStrain::new(drive.material.youngs_modulus_mpa, drive.material.poissons_ratio);
    let pressed = Pressed::new([&fs, &cs], flanks, material, drive.generator.w0_mm)?;
    let mut lines = Vec::new();
    for coefficient in COEFFICIENTS {
        let folder = out.join(format!("friction-{coefficient}"));
        std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        let (deck, held) = deck(&pressed, &drive, coefficient);
        std::fs::write(folder.join("friction.inp"), deck).map_err(|error| error.to_string())?;
        let used = ccx_alone(ccx, &folder, "friction", LIMITS)?;
        let theirs = theirs(&folder.join("friction.dat"), &pressed, &held, coefficient)?;
        println!("== friction {coefficient} between a tooth and its space; CalculiX {:.1} s", used.cpu_s);
        let ours = pressed.ours(coefficient)?;
        lines.push(summary(coefficient, &ours, &theirs, claims));
    }
    Ok(lines.join(", "))
}

fn summary(coefficient: f64, ours: &[Borne], theirs: &[Borne], claims: &mut Claims) -> String {
    for (slide, path) in SLIDES.iter().zip(ours.iter().zip(theirs)) {
        println!("  slid by {slide} coefficients of the press, ours and CalculiX:");
        for borne in [path.0, path.1] {
            println!(
                "    {:.2} N/mm across, {:.5} of it along, {:.1} N mm/mm on the output, {:.1} % sticks",
                borne.force[0],
                borne.along(),
                borne.torque,
                100.0 * borne.sticks
            );
        }
    }
    let apart = |of: &dyn Fn(&[Borne]) -> f64| of(ours) / of(theirs) - 1.0;
    let largest = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
    let torque = largest(&mut ours.iter().zip(theirs).map(|(a, b)| a.torque / b.torque - 1.0));
    let slipping = apart(&|path| path[FORTH].along() - path[BACK].along());
    let lost = apart(&|path| path[BACK].torque - path[FORTH].torque);
    let turned = [FORTH, BACK].map(|k| apart(&|path| path[k + 1].along() - path[k].along()));
    let turned = largest(&mut turned.into_iter());
    let sticks = largest(&mut [FORTH, BACK].into_iter().map(|k| ours[k + 1].sticks - theirs[k + 1].sticks));
    let percent = |part: f64| 100.0 * part;
    claims.check(&format!("torque within {:.1} %", percent(TORQUE)), torque <= TORQUE);
    claims.check(
        &format!("slipping, change of force along over across within {:.0} %", percent(ALONG)),
        slipping.abs() <= ALONG,
    );
    claims.check(&format!("what sliding turns round of the torque within {:.0} %", percent(LOST)), lost.abs() <= LOST);
    claims.check(&format!("turned back, change of the same within {:.0} %", percent(ALONG)), turned <= ALONG);
    claims.check(&format!("share that sticks within {:.0} % of the contact", percent(STICKS)), sticks <= STICKS);
    format!(
        "friction {coefficient}: torque {:.2} %, slipping {:+.2} %, torque turned round {:+.2} %, partly stuck {:.2} \
         %, share that sticks {:.3}",
        percent(torque),
        percent(slipping),
        percent(lost),
        percent(turned),
        sticks
    )
}

/// The deck, and the numbers in it of the nodes that hold the space, with their places.
fn deck(pressed: &Pressed, drive: &Drive, friction: f64) -> (String, BTreeMap<usize, [f64; 2]>) {
    let mut text = String::from("*NODE, NSET=ALL\n");
    let mut numbers = [BTreeMap::new(), BTreeMap::new()];
    let mut held = [BTreeMap::new(), BTreeMap::new()];
    let mut next = 1;
    for (k, cell) in [&pressed.tooth, &pressed.space].into_iter().enumerate() {
        let by = if k == 0 { pressed.touching } else { [0.0; 2] };
        for (n, is_held) in &cell.nodes {
            let [x, y] = cell.mesh.nodes[*n];
            let _ = writeln!(text, "{next}, {:.12e}, {:.12e}, 0.", x + by[0], y + by[1]);
            numbers[k].insert(*n, next);
            if *is_held {
                held[k].insert(next, [x, y]);
            }
            next += 1;
        }
    }
    let mut faces = [String::new(), String::new()];
    let mut element = 1;
    text += "*ELEMENT, TYPE=CPE8R, ELSET=CELLS\n";
    for (k, cell) in [&pressed.tooth, &pressed.space].into_iter().enumerate() {
        let flank = &cell.mesh.flanks[PAIR.side.index()];
        let middles: Vec<usize> = flank.nodes.iter().skip(1).step_by(2).map(|n| cell.mesh.node(0, *n)).collect();
        for nodes in &cell.mesh.elements[..cell.mesh.elements_per_sector] {
            let written: Vec<String> = nodes.iter().map(|n| numbers[k][&(*n as usize)].to_string()).collect();
            let _ = writeln!(text, "{element}, {}", written.join(", "));
            for side in (0..4).filter(|side| middles.contains(&(nodes[4 + side] as usize))) {
                let _ = writeln!(faces[k], "{element}, S{}", side + 1);
            }
            element += 1;
        }
    }
    let list = |nodes: &BTreeMap<usize, [f64; 2]>| nodes.keys().map(|n| format!("{n},\n")).collect::<String>();
    let [tooth, space] = held.each_ref().map(list);
    let material = &drive.material;
    let _ = write!(
        text,
        "*NSET, NSET=TOOTH_HELD\n{tooth}*NSET, NSET=SPACE_HELD\n{space}*SURFACE, NAME=TOOTH_FLANK\n{}*SURFACE, \
         NAME=SPACE_FLANK\n{}*MATERIAL, NAME=STEEL\n*ELASTIC\n{:e}, {}\n*SOLID SECTION, ELSET=CELLS, \
         MATERIAL=STEEL\n1.\n*SURFACE INTERACTION, NAME=SLIDING\n*SURFACE BEHAVIOR, \
         PRESSURE-OVERCLOSURE=LINEAR\n{PENALTY:e}\n*FRICTION\n{friction}, {STICK_SLOPE:e}\n*CONTACT PAIR, \
         INTERACTION=SLIDING, TYPE=SURFACE TO SURFACE\nTOOTH_FLANK, SPACE_FLANK\n",
        faces[0], faces[1], material.youngs_modulus_mpa, material.poissons_ratio,
    );
    let part = 1.0 / PARTS as f64;
    for slide in SLIDES {
        let [x, y] = pressed.held(friction, slide);
        let _ = write!(
            text,
            "*STEP, NLGEOM, INC=200\n*STATIC\n{part}, 1., {part}, {part}\n*BOUNDARY\nSPACE_HELD, 1, 2\nTOOTH_HELD, 1, \
             1, {x:.12e}\nTOOTH_HELD, 2, 2, {y:.12e}\n*NODE PRINT, NSET=SPACE_HELD, FREQUENCY=1000\nRF\n*CONTACT \
             PRINT, SLAVE=TOOTH_FLANK, MASTER=SPACE_FLANK, FREQUENCY=1000\nCSTR, CF\n*END STEP\n"
        );
    }
    let [_, space] = held;
    (text, space)
}

/// Load of the space in CalculiX: the forces that hold it.
fn theirs(
    dat: &Path,
    pressed: &Pressed,
    held: &BTreeMap<usize, [f64; 2]>,
    friction: f64,
) -> Result<Vec<Borne>, String> {
    let text = std::fs::read_to_string(dat).map_err(|error| format!("{}: {error}", dat.display()))?;
    let (forces, stresses) = parted(&text);
    let tables = tables(&forces).map_err(|error| format!("{}: {error}", dat.display()))?;
    let step = |k: usize| {
        let rows = at_step(&tables, "SPACE_HELD", k + 1);
        let rows = rows.ok_or_else(|| format!("{}: no forces at the end of step {}", dat.display(), k + 1))?;
        let (mut force, mut torque) = ([0.0; 2], 0.0);
        for row in rows {
            let [x, y] = *held.get(&(row[0] as usize)).ok_or("a force on a node that is not held")?;
            // The space is held against what it bears.
            let on = [-row[1], -row[2]];
            torque += x * on[1] - y * on[0];
            force = [force[0] + on[0], force[1] + on[1]];
        }
        let sticking = stresses.get(k).filter(|at| !at.is_empty()).ok_or("no contact stress")?;
        let sticks = sticking.iter().filter(|[p, t]| t.abs() < STUCK * friction * p).count();
        Ok(pressed.borne(force, torque, sticks as f64 / sticking.len() as f64))
    };
    (0..SLIDES.len()).map(step).collect()
}

/// The tables of forces, and of each step pressure and traction (MPa) in the points of contact.
fn parted(text: &str) -> (String, Vec<Vec<[f64; 2]>>) {
    let (mut forces, mut stresses) = (String::new(), Vec::<Vec<[f64; 2]>>::new());
    let mut in_forces = false;
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let numbers: Vec<f64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        if line.contains(" for set ") {
            in_forces = true;
        } else if line.contains("contact stress") {
            in_forces = false;
            stresses.push(Vec::new());
        }
        if in_forces && line.trim_start().starts_with("statistics") {
            in_forces = false;
        }
        if in_forces {
            forces += line;
            forces.push('\n');
        } else if let ([_, _, pressure, one, other], Some(at)) = (&numbers[..], stresses.last_mut()) {
            at.push([*pressure, one.hypot(*other)]);
        }
    }
    (forces, stresses)
}
