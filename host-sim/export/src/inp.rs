//! The drive as an input deck for CalculiX (2.20) and Abaqus: the same mesh, contact, holding and load.
//!
//! Keywords and their meaning are those of the CalculiX CrunchiX 2.20 user's manual; all of them are Abaqus keywords
//! too. Lengths mm, forces N, stresses MPa. The model is a slice of 1 mm: forces and moments are per mm of face width.
//!
//! | part | in the deck |
//! |---|---|
//! | wheels | our nodes and elements, `CPE8R`, 2 x 2 points, as [`flexspline_mechanics::fem::element`] |
//! | material | `*ELASTIC` under `NLGEOM`: St Venant-Kirchhoff, as ours |
//! | generator | bodies with the exact outline, every node prescribed ([`generator`]) |
//! | contact | `SURFACE TO SURFACE`, linear penalty of our stiffness, `*FRICTION` if the drive has any |
//! | flexspline | mean rotation of the bore held, mean displacement on the lateral spring ([`holding`]) |
//! | circular spline | every node of its outer circle on one rotation, the node `OUTPUT`, which carries the load |
//!
//! Steps: `1` the generator takes its form, the circular spline away from the teeth (contact removed); `2` the circular
//! spline is turned against the teeth by a little more than the rigid clearance; `3` it is let go and the load comes
//! on; then one for each rotation increment, and if wanted a last one to another load.
//!
//! Differences from our model:
//! * Flanks are the faces of the elements, parabolas through three points of the involute (1 nm off it on the standard
//!   mesh), and tips are sharp: the rounding of a tip is in our contact but in no mesh. 0.03 mm of it is 0.05 to 0.08″
//!   of output at 50 N·m, and all that CalculiX and we differ by beyond its own scatter.
//! * The circular spline turns by a linear equation, which stretches it by `theta²/2`: at an output angle of 1e-3 rad
//!   its teeth stand 25 nm too far out, 0.05″ of output. Ours turns exactly. Its small strains are Green-Lagrange here,
//!   linear in ours.
//! * Springs of [`STABILISING_TORSION`] on the output and [`STABILISING_LATERAL`] on the bore hold what nothing else
//!   holds before the parts touch. The first takes 1e-4 rad times itself off the load: 0.1 N mm of 2500.
//! * The Coulomb drag of the output is left out: [`Deck::new`] refuses a drive that has it rather than drop it
//!   silently.
//! * CalculiX pairs points of the faces once in an increment and keeps to the tangents there ([`generator`]). Teeth and
//!   cam slide too little in a step for that to show. The rim creeps along two rollers by 0.1 mm as 20 N·m come on,
//!   which leaves the output 19″ of 600″ behind. Rollers therefore stand for [`STANDS`] more steps after each load and
//!   one after each rotation, which pair again and move nothing: two rollers on the coarse mesh are then 0.9″ from
//!   ours, 0.4″ of it the stretch above. (One run with these steps put in by hand; the peer check compares the cam.)
//! * Within a step the nodes of the generator move along straight lines: only states at the ends of steps count.
//!
//! Abaqus was not at hand: that it reads the deck is a claim from its documented syntax, not from a run. The second
//! number under `*FRICTION` is CalculiX's stick slope; Abaqus takes it for a slip rate, which changes nothing where
//! there is one row. A degree of freedom 3 that is held has a meaning only for CalculiX, which makes bricks of plane
//! elements.

mod generator;
mod holding;
mod sleeve;

use std::io::{self, Write};
use std::ops::Range;

use thiserror::Error;

use flexspline_mechanics::contact::BoreLaw;
use flexspline_mechanics::drive::{DriveError, RigidMesh};
use flexspline_mechanics::mesh::{MeshError, WheelMesh};
use flexspline_mechanics::stepping::Problem;

use generator::GeneratorBody;
use holding::bore_sums;
pub use sleeve::SleeveDeck;

/// A point in the plane, mm.
type Point = [f64; 2];

/// Torsional spring from the output to ground, N mm/rad per mm of width.
pub const STABILISING_TORSION: f64 = 1e3;
/// Lateral spring from the mean of the bore to ground where the drive has a softer sleeve, N/mm per mm of width.
pub(crate) const STABILISING_LATERAL: f64 = 1.0;
/// Modulus of the generator, MPa: all its nodes are prescribed, and what strains it must not enter the force balance.
const GENERATOR_MODULUS: f64 = 1.0;
/// How far the circular spline is turned against the teeth before the load, in rigid clearances: enough that many bear,
/// about 50 N·m under the cam. Fewer (1.2) made CalculiX hesitate which.
const BEARING_TURN: f64 = 1.5;

/// Steps in which a loaded roller drive stands, to pair its faces again.
const STANDS: usize = 2;

/// Actions of the deck after the generator has its form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeckSettings {
    /// Load torque on the output, N m, positive turns it forward.
    pub torque_n_m: f64,
    /// Load that a last step brings it to, N m, the generator standing: the wind-up between the two.
    pub last_torque_n_m: Option<f64>,
    /// Rotation increments, one step each.
    pub increments: usize,
    /// Size of each, rad, positive forward.
    pub step_rad: f64,
}

/// A drive that a deck cannot say.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DeckError {
    /// The outline is impossible.
    #[error(transparent)]
    Outline(#[from] DriveError),
    /// Drag on the output.
    #[error(
        "output.drag_torque_n_m: found {0}, and a deck has no Coulomb drag on the output; allowed: 0 (--set \
         output.drag_torque_n_m=0)"
    )]
    Drag(f64),
    /// A sleeve in three dimensions.
    #[error(
        "sleeve.kind: found \"{0}\", and a deck is plane where it has contact; allowed: \"springs\", \"none\" (--set \
         sleeve.kind=springs)"
    )]
    Shells(&'static str),
    /// An end of the sleeve that the deck in three dimensions has not.
    #[error(
        "sleeve.{field}: found \"{found}\", and the deck in three dimensions has no plates; allowed: {allowed} (--set \
         sleeve.{field}=…)"
    )]
    End {
        /// Field of the sleeve.
        field: &'static str,
        /// Its value.
        found: &'static str,
        /// Allowed contents of a deck.
        allowed: &'static str,
    },
    /// An impossible mesh.
    #[error(transparent)]
    Mesh(MeshError),
    /// No backlash to take up.
    #[error("the teeth of the drive have no clearance: rigid backlash {0:.3e} rad; a deck needs some to start from")]
    NoClearance(f64),
}

/// One term of a linear equation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EquationTerm {
    /// Node number.
    pub node: usize,
    /// Degree of freedom: 1 or 2.
    pub dof: u8,
    /// Its factor.
    pub coefficient: f64,
}

/// `sum of coefficient times displacement = 0`; the first term is the dependent one.
pub type Equation = Vec<EquationTerm>;

/// A face of an element: element number and face 1 to 4, face e running from corner e to the next.
pub type Face = (usize, usize);

/// A spring to ground.
#[derive(Debug, Clone, PartialEq)]
struct GroundSpring {
    name: &'static str,
    node: usize,
    stiffness: f64,
}

/// The deck before it is written. Node and element numbers count from 1 and have no gaps.
pub struct Deck<'p> {
    problem: &'p Problem,
    settings: DeckSettings,
    /// Node positions; number n is at n - 1.
    pub nodes: Vec<Point>,
    /// Nodes of the elements; number e is at e - 1.
    pub elements: Vec<[usize; 8]>,
    /// Linear equations.
    pub equations: Vec<Equation>,
    /// Element numbers of flexspline, circular spline, generator.
    pub bodies: [Range<usize>; 3],
    /// Nodes of the bore, once around.
    pub bore: Vec<usize>,
    /// Nodes of the outer circle of the circular spline.
    pub outer: Vec<usize>,
    /// Faces of the bore, the flanks of the flexspline, those of the circular spline, the generator.
    pub surfaces: [Vec<Face>; 4],
    /// Node whose first degree of freedom is the output angle (rad), and the second the displacement of the outer
    /// circle (mm).
    pub output: usize,
    generator: GeneratorBody,
    /// Number of the first node of the generator.
    pub first_generator_node: usize,
    springs: Vec<GroundSpring>,
    /// How far the outer circle is pressed outward, mm.
    seat_mm: f64,
    bearing_turn_rad: f64,
}

impl<'p> Deck<'p> {
    /// The deck of a problem. The generator starts at angle zero.
    pub fn new(problem: &'p Problem, settings: DeckSettings) -> Result<Deck<'p>, DeckError> {
        let drive = &problem.drive;
        if drive.output.drag_torque_n_m != 0.0 {
            return Err(DeckError::Drag(drive.output.drag_torque_n_m));
        }
        if drive.sleeve.is_shell() {
            return Err(DeckError::Shells(drive.sleeve.kind.name()));
        }
        let backlash_rad = RigidMesh::new(drive, problem.kind)?.report(problem.kind).map_or(0.0, |r| r.backlash_rad);
        if backlash_rad <= 0.0 {
            return Err(DeckError::NoClearance(backlash_rad));
        }
        let way = if settings.torque_n_m < 0.0 { -1.0 } else { 1.0 };
        let width = drive.flexspline.width_mm;
        let (fs, cs) = (&problem.flexspline, &problem.circular_spline);

        let thermal = &drive.thermal_state;
        let mut deck = Deck {
            problem,
            settings,
            nodes: Vec::new(),
            elements: Vec::new(),
            equations: Vec::new(),
            bodies: [0..0, 0..0, 0..0],
            bore: Vec::new(),
            outer: Vec::new(),
            surfaces: Default::default(),
            output: 0,
            generator: GeneratorBody::new(&problem.outline, fs),
            first_generator_node: 0,
            springs: Vec::new(),
            seat_mm: drive.circular_spline.outer_radius_mm
                * (thermal.housing_scale / thermal.circular_spline_scale - 1.0),
            bearing_turn_rad: 0.5 * BEARING_TURN * backlash_rad * way,
        };
        deck.add_wheels([fs, cs]);
        deck.add_generator();
        deck.hold_circular_spline(cs, fs.nodes.len());
        deck.hold_flexspline(
            fs,
            drive.sleeve.torsion_stiffness_n_m_per_rad.map(|k| 1e3 * k / width),
            (drive.sleeve.lateral_stiffness_n_per_mm / width).max(STABILISING_LATERAL),
        );
        Ok(deck)
    }

    fn add_wheels(&mut self, wheels: [&WheelMesh; 2]) {
        for (k, mesh) in wheels.into_iter().enumerate() {
            let (first_node, first_element) = (self.nodes.len() + 1, self.elements.len() + 1);
            self.nodes.extend(&mesh.nodes);
            self.elements.extend(mesh.elements.iter().map(|element| element.map(|n| first_node + n as usize)));
            self.bodies[k] = first_element..self.elements.len() + 1;
            // A midside node on a surface belongs to one element: it names the face.
            let mut face_of = vec![None; mesh.nodes.len()];
            for (e, element) in mesh.elements.iter().enumerate() {
                for side in 0..4 {
                    face_of[element[4 + side] as usize] = Some((first_element + e, side + 1));
                }
            }
            let face = |n: usize| face_of[n].expect("the middle of an edge belongs to an element");
            for sector in 0..mesh.teeth {
                for edge in &mesh.base_edges {
                    let [start, middle, _] = mesh.edge_nodes(sector, edge);
                    let circle = if k == 0 { &mut self.bore } else { &mut self.outer };
                    circle.extend([first_node + start, first_node + middle]);
                    if k == 0 {
                        self.surfaces[0].push(face(middle));
                    }
                }
                for flank in &mesh.flanks {
                    let middles = flank.nodes.iter().skip(1).step_by(2);
                    self.surfaces[1 + k].extend(middles.map(|&n| face(mesh.node(sector as isize, n))));
                }
            }
        }
    }

    fn add_generator(&mut self) {
        let (first_node, first_element) = (self.nodes.len() + 1, self.elements.len() + 1);
        self.first_generator_node = first_node;
        self.nodes.extend(self.generator.before());
        self.elements.extend(self.generator.elements.iter().map(|element| element.map(|n| first_node + n as usize)));
        self.bodies[2] = first_element..self.elements.len() + 1;
        self.surfaces[3].extend(self.bodies[2].clone().map(|e| (e, 2)));
    }

    /// Outer circle: `u = theta J x + seat x / r`.
    fn hold_circular_spline(&mut self, mesh: &WheelMesh, nodes_before: usize) {
        self.output = self.add_helper();
        for &node in &self.outer {
            let [x, y] = mesh.nodes[node - 1 - nodes_before];
            let r = x.hypot(y);
            for (dof, turned, along) in [(1, -y, x), (2, x, y)] {
                self.equations.push(vec![
                    EquationTerm { node, dof, coefficient: 1.0 },
                    EquationTerm { node: self.output, dof: 1, coefficient: -turned },
                    EquationTerm { node: self.output, dof: 2, coefficient: -along / r },
                ]);
            }
        }
        self.springs.push(GroundSpring {
            name: "OUTPUT_STABILISER",
            node: self.output,
            stiffness: STABILISING_TORSION,
        });
    }

    /// Bore: mean rotation zero, or on the spring of the sleeve; mean displacement on the lateral spring.
    fn hold_flexspline(&mut self, mesh: &WheelMesh, torsion: Option<f64>, lateral: f64) {
        let first = self.nodes.len() + 1;
        let last = mesh.teeth - 1;
        // The sum over the whole bore of a rotation that is held has no node.
        let sum_node = |sector: usize, which: usize| {
            (torsion.is_some() || which > 0 || sector < last).then_some(if sector < last || torsion.is_some() {
                first + 3 * sector + which
            } else {
                first + 3 * sector + which - 1
            })
        };
        let sums = bore_sums(mesh, |n| n + 1, sum_node);
        for _ in 0..3 * mesh.teeth - usize::from(torsion.is_none()) {
            self.add_helper();
        }
        self.equations.extend(sums.equations);
        let edges = sums.edges as f64;
        let per_radian = edges * mesh.base_radius;
        let springs = [
            ("SLEEVE_TORSION", 0, torsion.map(|k| k / (per_radian * per_radian))),
            ("SLEEVE_LATERAL_X", 1, Some(lateral / (edges * edges))),
            ("SLEEVE_LATERAL_Y", 2, Some(lateral / (edges * edges))),
        ];
        for (name, which, stiffness) in springs {
            if let (Some(node), Some(stiffness)) = (sum_node(last, which), stiffness) {
                self.springs.push(GroundSpring { name, node, stiffness });
            }
        }
    }

    /// A node of no element, on the axis.
    fn add_helper(&mut self) -> usize {
        self.nodes.push([0.0, 0.0]);
        self.nodes.len()
    }

    /// Writes the deck.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let Problem { drive, kind, flexspline, circular_spline, .. } = self.problem;
        writeln!(
            out,
            "*HEADING\n{}, {kind} generator, {:.3} N.m, flexspline {} and circular spline {} elements",
            drive.name,
            self.settings.torque_n_m,
            flexspline.elements.len(),
            circular_spline.elements.len()
        )?;
        if drive.as_built.first_not_uniform().is_some() {
            writeln!(
                out,
                "** flanks and generator as drawn: imperfections of the drive as built are not in this deck"
            )?;
        }
        writeln!(out, "** mm, N, MPa; a slice of 1 mm: forces and moments are per mm of face width")?;
        self.write_mesh(out)?;
        self.write_properties(out)?;
        self.write_contact(out)?;
        for (k, step) in self.steps().iter().enumerate() {
            self.write_step(out, k, step)?;
        }
        Ok(())
    }

    fn write_mesh(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "*NODE, NSET=ALL_NODES")?;
        for (n, [x, y]) in self.nodes.iter().enumerate() {
            writeln!(out, "{}, {}, {}, 0.", n + 1, short(*x), short(*y))?;
        }
        for (body, name) in self.bodies.iter().zip(["FLEXSPLINE", "CIRCULAR_SPLINE", "GENERATOR"]) {
            writeln!(out, "*ELEMENT, TYPE=CPE8R, ELSET={name}")?;
            for e in body.clone() {
                let [a, b, c, d, ab, bc, cd, da] = self.elements[e - 1];
                writeln!(out, "{e}, {a}, {b}, {c}, {d}, {ab}, {bc}, {cd}, {da}")?;
            }
        }
        for (number, GroundSpring { name, node, stiffness }) in (self.elements.len() + 1..).zip(&self.springs) {
            writeln!(out, "*ELEMENT, TYPE=SPRING1, ELSET={name}\n{number}, {node}")?;
            writeln!(out, "*SPRING, ELSET={name}\n1\n{}", short(*stiffness))?;
        }
        let sets = [("BORE", self.bore.as_slice()), ("OUTER_CIRCLE", &self.outer), ("OUTPUT", &[self.output])];
        for (name, nodes) in sets {
            writeln!(out, "*NSET, NSET={name}")?;
            list(out, nodes.iter().copied())?;
        }
        writeln!(out, "*ELSET, ELSET=BORE_ROW")?;
        list(out, self.surfaces[0].iter().map(|(element, _)| *element))?;
        for (faces, name) in self.surfaces.iter().zip(SURFACES) {
            writeln!(out, "*SURFACE, NAME={name}, TYPE=ELEMENT")?;
            for (element, face) in faces {
                writeln!(out, "{element}, S{face}")?;
            }
        }
        for terms in &self.equations {
            equation(out, terms.iter().copied())?;
        }
        Ok(())
    }

    fn write_properties(&self, out: &mut dyn Write) -> io::Result<()> {
        let material = &self.problem.drive.material;
        for (name, modulus) in [("STEEL", material.youngs_modulus_mpa), ("PRESCRIBED", GENERATOR_MODULUS)] {
            writeln!(out, "*MATERIAL, NAME={name}\n*ELASTIC\n{}, {}", short(modulus), short(material.poissons_ratio))?;
        }
        for (body, material) in [("FLEXSPLINE", "STEEL"), ("CIRCULAR_SPLINE", "STEEL"), ("GENERATOR", "PRESCRIBED")] {
            writeln!(out, "*SOLID SECTION, ELSET={body}, MATERIAL={material}\n1.")?;
        }
        Ok(())
    }

    fn write_contact(&self, out: &mut dyn Write) -> io::Result<()> {
        let [bore, fs_flanks, cs_flanks, generator] = SURFACES;
        let Problem { drive, kind, settings, .. } = self.problem;
        let law = BoreLaw::new(settings.bore_penalty(*kind), drive.generator.bearing_stiffness_n_per_mm3);
        let pairs = [
            ("ROLLING", law.stiffness, 0.0, bore, generator),
            ("SLIDING", settings.flank_penalty, drive.flanks.friction_coefficient, fs_flanks, cs_flanks),
        ];
        for (name, stiffness, friction, dependent, independent) in pairs {
            writeln!(out, "*SURFACE INTERACTION, NAME={name}")?;
            writeln!(out, "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{}", short(stiffness))?;
            if friction > 0.0 {
                writeln!(out, "*FRICTION\n{}, {}", short(friction), short(0.1 * stiffness))?;
            }
            writeln!(out, "*CONTACT PAIR, INTERACTION={name}, TYPE=SURFACE TO SURFACE\n{dependent}, {independent}")?;
        }
        Ok(())
    }

    fn steps(&self) -> Vec<DeckStep> {
        let load = |torque_n_m: f64| DeckOutput::Loaded(self.problem.per_width(torque_n_m));
        let loaded = DeckStep { generator_rad: 0.0, output: load(self.settings.torque_n_m), flanks: None };
        let mut steps = vec![
            DeckStep { output: DeckOutput::Held(0.0), flanks: Some("REMOVE"), ..loaded },
            DeckStep { output: DeckOutput::Held(self.bearing_turn_rad), flanks: Some("ADD"), ..loaded },
        ];
        let turned = |k| DeckStep { generator_rad: k as f64 * self.settings.step_rad, ..loaded };
        let rollers = self.generator.is_rollers();
        let stands = |steps: usize| 1 + if rollers { steps } else { 0 };
        steps.extend(std::iter::repeat_n(loaded, stands(STANDS)));
        steps.extend((1..=self.settings.increments).flat_map(|k| std::iter::repeat_n(turned(k), stands(1))));
        if let Some(torque_n_m) = self.settings.last_torque_n_m {
            let last = DeckStep { output: load(torque_n_m), ..turned(self.settings.increments) };
            steps.extend(std::iter::repeat_n(last, stands(STANDS)));
        }
        steps
    }

    fn write_step(&self, out: &mut dyn Write, k: usize, step: &DeckStep) -> io::Result<()> {
        let [_, fs_flanks, cs_flanks, _] = SURFACES;
        writeln!(out, "** step {}: generator at {} rad", k + 1, short(step.generator_rad))?;
        // One increment to a step; the program halves it where it has to. Where flanks meet it finds its way in less
        // than half the iterations from a first step of half the way: 22 for 55 with the cam on the coarse mesh.
        let first = if step.flanks == Some("ADD") { "0.5" } else { "1." };
        writeln!(out, "*STEP, NLGEOM, INC=200\n*STATIC\n{first}, 1.")?;
        if let Some(change) = step.flanks {
            writeln!(out, "*MODEL CHANGE, TYPE=CONTACT PAIR, {change}\n{fs_flanks}, {cs_flanks}")?;
        }
        writeln!(out, "*BOUNDARY, OP=NEW")?;
        let stand = self.generator.at(step.generator_rad);
        for (node, position) in (self.first_generator_node..).zip(&stand) {
            for (i, before) in self.nodes[node - 1].iter().enumerate() {
                writeln!(out, "{node}, {0}, {0}, {1}", i + 1, short(position[i] - before))?;
            }
        }
        writeln!(out, "{0}, 2, 2, {1}", self.output, short(self.seat_mm))?;
        if let DeckOutput::Held(angle) = step.output {
            writeln!(out, "{0}, 1, 1, {1}", self.output, short(angle))?;
        }
        // A node of a spring has all its degrees of freedom; the spring holds the first.
        for spring in &self.springs {
            let first = if spring.node == self.output { 3 } else { 2 };
            writeln!(out, "{}, {first}, 3", spring.node)?;
        }
        if let DeckOutput::Loaded(load) = step.output {
            writeln!(out, "*CLOAD, OP=NEW\n{}, 1, {}", self.output, short(load))?;
        }
        // Of each step its end: the frequency is beyond its increments.
        for set in ["OUTPUT", "BORE"] {
            writeln!(out, "*NODE PRINT, NSET={set}, FREQUENCY=1000\nU")?;
        }
        writeln!(out, "*EL PRINT, ELSET=BORE_ROW, FREQUENCY=1000\nS")?;
        writeln!(out, "*END STEP")
    }
}

/// Names of [`Deck::surfaces`].
const SURFACES: [&str; 4] = ["BORE_FACE", "FLEXSPLINE_FLANKS", "CIRCULAR_SPLINE_FLANKS", "GENERATOR_FACE"];

#[derive(Clone, Copy)]
enum DeckOutput {
    /// At an angle, rad.
    Held(f64),
    /// Free to turn under a load, N mm per mm of width.
    Loaded(f64),
}

/// One step of the deck: where everything stands at its end.
#[derive(Clone, Copy)]
struct DeckStep {
    generator_rad: f64,
    output: DeckOutput,
    /// Change of the contact of the flanks: `REMOVE`, `ADD`.
    flanks: Option<&'static str>,
}

/// A number in at most 20 characters, which is what CalculiX reads of one.
fn short(value: f64) -> String {
    let plain = format!("{value}");
    if plain.len() <= 20 && plain.contains('.') {
        return plain;
    }
    if value == value.trunc() && value.abs() < 1e9 {
        return format!("{value:.0}.");
    }
    let digits = if value < 0.0 { 11 } else { 12 };
    format!("{value:.digits$e}")
}

/// A linear equation, four terms to a line.
fn equation(out: &mut dyn Write, terms: impl Iterator<Item = EquationTerm>) -> io::Result<()> {
    let words: Vec<String> = terms.map(|t| format!("{}, {}, {}", t.node, t.dof, short(t.coefficient))).collect();
    writeln!(out, "*EQUATION\n{}", words.len())?;
    words.chunks(4).try_for_each(|line| writeln!(out, "{}", line.join(", ")))
}

/// Numbers, sixteen to a line.
fn list(out: &mut dyn Write, numbers: impl Iterator<Item = usize>) -> io::Result<()> {
    let numbers: Vec<String> = numbers.map(|n| n.to_string()).collect();
    for line in numbers.chunks(16) {
        writeln!(out, "{}", line.join(", "))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::drive::{Drive, GeneratorKind};
    use flexspline_mechanics::mesh::MeshLevel;
    use flexspline_mechanics::stepping::SolverSettings;
    use std::collections::{BTreeMap, BTreeSet};

    fn drive() -> Drive {
        Drive::hhd_95().with_set("output.drag_torque_n_m=0").unwrap()
    }

    fn problem(drive: &Drive, kind: GeneratorKind) -> Problem {
        let settings = SolverSettings { mesh: MeshLevel::Coarse, ..SolverSettings::default() };
        Problem::new(drive, kind, drive.temperature.reference_c, settings).unwrap()
    }

    const SETTINGS: DeckSettings =
        DeckSettings { torque_n_m: 50.0, last_torque_n_m: Some(-20.0), increments: 2, step_rad: 0.01 };

    /// A deck as any reader of keywords sees it: blocks of a keyword line and its data lines.
    fn blocks(deck: &Deck<'_>) -> Vec<(String, Vec<Vec<String>>)> {
        let mut text = Vec::new();
        deck.write(&mut text).unwrap();
        let mut blocks: Vec<(String, Vec<Vec<String>>)> = Vec::new();
        for line in String::from_utf8(text).unwrap().lines().filter(|line| !line.starts_with("**")) {
            if line.starts_with('*') {
                blocks.push((line.to_owned(), Vec::new()));
            } else {
                let words = line.split(',').map(|word| word.trim().to_owned()).collect();
                blocks.last_mut().unwrap().1.push(words);
            }
        }
        blocks
    }

    fn number<T: std::str::FromStr>(word: &str) -> T {
        word.parse().unwrap_or_else(|_| panic!("{word:?} is no number"))
    }

    #[test]
    fn the_deck_read_back_is_the_mesh() {
        for kind in GeneratorKind::ALL {
            let drive = drive();
            let problem = problem(&drive, kind);
            let deck = Deck::new(&problem, SETTINGS).unwrap();
            let blocks = blocks(&deck);
            let (_, nodes) = blocks.iter().find(|(keyword, _)| keyword.starts_with("*NODE, NSET")).unwrap();
            let meshes = [&problem.flexspline, &problem.circular_spline];
            let ours = meshes.into_iter().flat_map(|mesh| &mesh.nodes);
            for (k, (line, x)) in nodes.iter().zip(ours).enumerate() {
                assert_eq!(number::<usize>(&line[0]), k + 1);
                for i in 0..2 {
                    assert!((number::<f64>(&line[1 + i]) - x[i]).abs() < 1e-11, "node {}", k + 1);
                }
            }
            let mut used = BTreeSet::new();
            let mut next = 1;
            let mut first_node = 0;
            let elements: BTreeMap<&str, _> = blocks
                .iter()
                .filter_map(|(keyword, lines)| Some((keyword.strip_prefix("*ELEMENT, TYPE=CPE8R, ELSET=")?, lines)))
                .collect();
            for (set, mesh) in
                [("FLEXSPLINE", Some(meshes[0])), ("CIRCULAR_SPLINE", Some(meshes[1])), ("GENERATOR", None)]
            {
                if let Some(mesh) = mesh {
                    assert_eq!(elements[set].len(), mesh.elements.len());
                }
                for (k, line) in elements[set].iter().enumerate() {
                    assert_eq!(number::<usize>(&line[0]), next, "numbers without gaps");
                    next += 1;
                    let nodes: Vec<usize> = line[1..].iter().map(|n| number(n)).collect();
                    if let Some(mesh) = mesh {
                        assert_eq!(nodes, mesh.elements[k].map(|n| first_node + 1 + n as usize));
                    }
                    used.extend(nodes);
                }
                first_node += mesh.map_or(0, |mesh| mesh.nodes.len());
            }
            for equation in &deck.equations {
                used.extend(equation.iter().map(|term| term.node));
            }
            assert_eq!(used.len(), nodes.len(), "{kind}: a node that nothing uses");
            assert_eq!(used.last(), Some(&nodes.len()));
        }
    }

    #[test]
    fn no_number_is_too_long_for_calculix() {
        let drive = Drive::hhd_95_typical().with_set("output.drag_torque_n_m=0").unwrap();
        let problem = problem(&drive, GeneratorKind::FourRoller);
        let deck = Deck::new(&problem, SETTINGS).unwrap();
        for (keyword, lines) in blocks(&deck).iter().filter(|(keyword, _)| keyword != "*HEADING") {
            for word in lines.iter().flatten().filter(|word| word.parse::<f64>().is_ok()) {
                assert!(word.len() <= 20, "{keyword}: {word}");
            }
        }
        for value in [0.0, 1.0, -0.1 / 3.0, -1.0 / 3e7, 206_000.0, 5e7, -123.456_789_012_345_67, 1e-300] {
            let text = short(value);
            assert!(text.len() <= 20 && text.contains('.'), "{text}");
            assert!((text.parse::<f64>().unwrap() - value).abs() <= 1e-11 * value.abs(), "{text} for {value}");
        }
    }

    #[test]
    fn surfaces_and_sets_lie_where_their_names_say() {
        let drive = drive();
        let problem = problem(&drive, GeneratorKind::Cam);
        let deck = Deck::new(&problem, SETTINGS).unwrap();
        let radius = |node: usize| deck.nodes[node - 1][0].hypot(deck.nodes[node - 1][1]);
        let face = |(element, face): Face| {
            let nodes = deck.elements[element - 1];
            [nodes[face - 1], nodes[3 + face], nodes[face % 4]]
        };
        let (fs, cs) = (&drive.flexspline, &drive.circular_spline);
        let bore: BTreeSet<usize> = deck.surfaces[0].iter().flat_map(|f| face(*f)).collect();
        assert_eq!(bore, deck.bore.iter().copied().collect());
        assert!(bore.iter().all(|n| (radius(*n) - fs.bore_radius_mm()).abs() < 1e-9));
        assert!(deck.outer.iter().all(|n| (radius(*n) - cs.outer_radius_mm).abs() < 1e-9));
        assert_eq!(deck.outer.len(), 2 * problem.circular_spline.base_edges.len() * 190);
        let flanks = [(1, 188, fs.root_radius_mm, fs.tip_radius_mm), (2, 190, cs.tip_radius_mm, cs.root_radius_mm)];
        for (surface, teeth, inner, outer) in flanks {
            let mesh = [&problem.flexspline, &problem.circular_spline][surface - 1];
            assert_eq!(deck.surfaces[surface].len(), 2 * teeth * mesh.flanks[0].edges());
            for f in &deck.surfaces[surface] {
                let nodes = face(*f);
                assert!(nodes.iter().all(|n| radius(*n) > inner - 1e-9 && radius(*n) < outer + 1e-9));
                let along = (radius(nodes[0]) - radius(nodes[2])).abs();
                assert!(along > 0.1, "a flank runs from root to tip, not around: {along}");
            }
        }
        let reach = deck.surfaces[3].iter().flat_map(|f| face(*f)).map(radius).fold(0.0, f64::max);
        assert!(reach < fs.bore_radius_mm() && reach > fs.bore_radius_mm() - 1e-3, "{reach}");
    }

    #[test]
    fn a_unit_of_output_turns_the_outer_circle() {
        let problem = problem(&drive(), GeneratorKind::Cam);
        let deck = Deck::new(&problem, SETTINGS).unwrap();
        let mut turned = 0;
        for equation in deck.equations.iter().filter(|equation| deck.outer.contains(&equation[0].node)) {
            let [first, angle, seat] = equation[..] else { panic!("{equation:?}") };
            let [x, y] = deck.nodes[first.node - 1];
            let r = x.hypot(y);
            let expected = if first.dof == 1 { (-y, x / r) } else { (x, y / r) };
            assert_eq!(
                (first.coefficient, angle.node, angle.dof, seat.node, seat.dof),
                (1.0, deck.output, 1, deck.output, 2)
            );
            assert!((angle.coefficient + expected.0).abs() < 1e-12 && (seat.coefficient + expected.1).abs() < 1e-12);
            turned += 1;
        }
        assert_eq!(turned, 2 * deck.outer.len());
    }

    #[test]
    fn steps_say_where_everything_stands() {
        let problem = problem(&drive(), GeneratorKind::Cam);
        let deck = Deck::new(&problem, SETTINGS).unwrap();
        let blocks = blocks(&deck);
        let of = |keyword: &str| -> Vec<&Vec<Vec<String>>> {
            blocks.iter().filter(|(k, _)| k.starts_with(keyword)).map(|(_, lines)| lines).collect()
        };
        assert_eq!((of("*STEP").len(), of("*END STEP").len()), (6, 6));
        let loads: Vec<f64> = of("*CLOAD").iter().map(|lines| number(&lines[0][2])).collect();
        // 50 and -20 N.m on 20 mm, in N mm per mm.
        assert_eq!(loads, [2500.0, 2500.0, 2500.0, -1000.0]);
        let held: Vec<bool> = of("*BOUNDARY")
            .iter()
            .map(|lines| lines.iter().any(|l| number::<usize>(&l[0]) == deck.output && l[1] == "1"))
            .collect();
        assert_eq!(held, [true, true, false, false, false, false]);
        // Faces of the generator stand on the outline turned by its angle.
        for (lines, psi) in of("*BOUNDARY").iter().zip([0.0_f64, 0.0, 0.0, 0.01, 0.02, 0.02]) {
            let mut moved: BTreeMap<usize, Point> = BTreeMap::new();
            for line in lines.iter().filter(|line| line.len() == 4) {
                moved.entry(number(&line[0])).or_default()[number::<usize>(&line[1]) - 1] = number(&line[3]);
            }
            let (s, c) = psi.sin_cos();
            for (element, face) in &deck.surfaces[3] {
                let node = deck.elements[element - 1][3 + face];
                let p: Point = std::array::from_fn(|i| deck.nodes[node - 1][i] + moved[&node][i]);
                let off = problem.outline.nearest([c * p[0] + s * p[1], c * p[1] - s * p[0]]).distance;
                assert!(off.abs() < 1e-9, "{off} mm off the turned outline");
            }
        }
    }

    #[test]
    fn rollers_stand_after_what_makes_the_rim_creep() {
        let angles = |kind| -> Vec<f64> {
            let problem = problem(&drive(), kind);
            let deck = Deck::new(&problem, SETTINGS).unwrap();
            deck.steps().iter().map(|step| step.generator_rad).collect()
        };
        assert_eq!(angles(GeneratorKind::DoubleDisc), [0.0, 0.0, 0.0, 0.01, 0.02, 0.02]);
        let rollers = [0.0, 0.0, 0.0, 0.0, 0.0, 0.01, 0.01, 0.02, 0.02, 0.02, 0.02, 0.02];
        assert_eq!(angles(GeneratorKind::FourRoller), rollers);
    }

    #[test]
    fn drag_is_refused_by_name() {
        let error = Deck::new(&problem(&Drive::hhd_95(), GeneratorKind::Cam), SETTINGS).err().unwrap();
        assert!(error.to_string().starts_with("output.drag_torque_n_m: found 0.02"), "{error}");
    }

    #[test]
    fn a_sleeve_of_shells_is_refused_by_name() {
        let problem = problem(&Drive::cup_95().with_set("output.drag_torque_n_m=0").unwrap(), GeneratorKind::Cam);
        let error = Deck::new(&problem, SETTINGS).err().unwrap().to_string();
        assert!(error.starts_with("sleeve.kind: found \"cup\", and a deck is plane where it has contact"), "{error}");
    }

    #[test]
    fn friction_and_a_soft_sleeve_are_in_the_deck_when_the_drive_has_them() {
        let typical = Drive::hhd_95_typical().with_set("output.drag_torque_n_m=0").unwrap();
        let keywords = |drive: &Drive| -> Vec<String> {
            let problem = problem(drive, GeneratorKind::Cam);
            let deck = Deck::new(&problem, SETTINGS).unwrap();
            blocks(&deck).into_iter().map(|(keyword, _)| keyword).collect()
        };
        for (drive, expected) in [(typical, true), (drive(), false)] {
            let keywords = keywords(&drive);
            assert_eq!(keywords.iter().any(|k| k == "*FRICTION"), expected);
            assert_eq!(keywords.iter().any(|k| k == "*SPRING, ELSET=SLEEVE_TORSION"), expected);
        }
    }
}
