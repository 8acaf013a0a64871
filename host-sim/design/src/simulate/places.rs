//! Stress of the flexspline at named places of its surface, and what it tends to as the mesh becomes finer.
//!
//! The largest nodal stress of a mesh grows with the mesh: 176, 199, 244, 268 MPa in a root fillet of HHD-95 (cam, 50 N
//! m) on meshes of which each has twice the elements of the one before in each direction. A fillet is narrow, and
//! stress falls steeply under it. Its surface is free, so that the strain along the surface says all: `E / (1 - nu^2)`
//! times it is the stress (plane strain), and it comes from displacements along the edge, which converge faster: 250,
//! 297, 306 MPa. On bore and flanks, where something presses, nodal values are taken.
//!
//! The drive is solved on three meshes, each with the nodes of the one before. The stress is that of the finest; its
//! interval is three times what the last step moved, the grid convergence index of P. J. Roache (J. Fluids Eng. 116
//! (1994) 405) for two meshes of first order, 3 % at least. Nothing is added by extrapolation: the peak is sampled at
//! points that move with the mesh and has no single order. Extrapolated (Richardson) it was found to lie 5 % (cam, 100
//! N m) and 3 % (two rollers, 10 N m) above CalculiX on a mesh twice as fine; the finest mesh 3.0 and 2.5 %.

use std::collections::HashMap;

use serde::Serialize;

use super::stress::nodal_von_mises;
use crate::cautions::YIELD_MPA;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::fem::material::PlaneStrain;
use flexspline_mechanics::mesh::{MeshLevel, WheelMesh};
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Method, Problem, SolveError, SolverSettings, State};

/// Times the elements of the coarse mesh in each direction.
pub const MESHES: [usize; 3] = [1, 2, 4];
/// Roache's factor of safety where meshes are not known to converge in order.
const SAFETY: f64 = 3.0;
/// Half of the interval, over the stress, at least: what two cases differ from CalculiX.
const LEAST_HALF: f64 = 0.03;

/// A place on the surface of the flexspline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// From the end of one flank over fillet and root land to the next.
    RootFillet,
    /// The bore.
    Bore,
    /// The flanks.
    Flank,
}

impl Place {
    /// All of them.
    pub(crate) const ALL: [Place; 3] = [Place::RootFillet, Place::Bore, Place::Flank];

    /// As it is printed.
    pub fn in_words(self) -> &'static str {
        match self {
            Place::RootFillet => "root fillet",
            Place::Bore => "bore",
            Place::Flank => "flank",
        }
    }
}

/// Stress at a place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlaceStress {
    /// Where.
    pub place: Place,
    /// Largest von Mises stress, of the finest mesh, MPa.
    pub von_mises_mpa: f64,
    /// Where it lies, MPa.
    pub interval_mpa: [f64; 2],
    /// The largest of each mesh, MPa.
    pub by_mesh_mpa: [f64; MESHES.len()],
    /// The tooth of the flexspline, from 0, that has it on the finest mesh.
    pub tooth: usize,
    /// How it bears the waves of the generator; of root fillets of steel.
    pub fatigue: Option<Fatigue>,
}

/// How a place bears a stress that comes and goes, of quenched and tempered steel (34CrNiMo6).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Fatigue {
    /// Half of what the stress moves by in a turn of the generator, MPa.
    pub amplitude_mpa: f64,
    /// The middle, MPa; positive in tension.
    pub mean_mpa: f64,
    /// Turns of the generator that are to be borne; missing where any number is.
    pub turns: Option<u64>,
    /// How many times as large both may be.
    pub safety: f64,
}

/// Tensile strength, MPa. *Source*: 34CrNiMo6 +QT, 16 to 40 mm (EN 10083-3: 1100 to 1300 MPa).
const TENSILE_MPA: f64 = 1100.0;
/// Share of it that may alternate endlessly. *Source*: FKM Guideline (2012), no case-hardened nor stainless steels.
const ALTERNATING: f64 = 0.45;
/// Cycles from which that is so, and the power of them by which it falls below. *Source*: the same.
const KNEE: (f64, f64) = (1e6, 0.2);
/// Young's moduli of such steels, MPa. *Source*: EN 10083 and EN 10088 have 200 to 215 GPa; and some room.
const STEEL_MPA: [f64; 2] = [190e3, 220e3];

impl Fatigue {
    /// By the line of Goodman, from what alternating stress alone to what a steady one alone may be.
    fn of([amplitude_mpa, mean_mpa]: [f64; 2], turns: Option<u64>) -> Fatigue {
        // Two waves pass in a turn.
        let cycles = turns.map_or(KNEE.0, |turns| (2.0 * turns as f64).min(KNEE.0));
        let bears_mpa = ALTERNATING * TENSILE_MPA * (KNEE.0 / cycles).powf(KNEE.1);
        let used = amplitude_mpa / bears_mpa.min(TENSILE_MPA) + mean_mpa.max(0.0) / TENSILE_MPA;
        Fatigue { amplitude_mpa, mean_mpa, turns, safety: used.recip() }
    }

    /// What it is for, and of what.
    pub fn in_words(&self) -> (String, String) {
        let Fatigue { amplitude_mpa, mean_mpa, .. } = self;
        let turns = self.turns.map_or_else(|| "any number of".to_owned(), |turns| turns.to_string());
        (
            format!("for {turns} turns of the generator, in steel of {TENSILE_MPA} MPa"),
            format!(
                "amplitude {amplitude_mpa:.0}, mean {mean_mpa:.0} MPa (Goodman); 34CrNiMo6 by EN 10083-3, of which \
                 {:.0} % alternate endlessly (FKM Guideline); the bottom of a cup is not looked at",
                100.0 * ALTERNATING
            ),
        )
    }
}

/// Nodes of an edge of one sector: corner, midside, corner, each by local number and the sectors it lies further.
pub type SurfaceEdge = [(u32, usize); 3];

/// The edges of one sector of the flexspline on root fillets and root land.
pub fn fillet_edges(mesh: &WheelMesh) -> Vec<SurfaceEdge> {
    let per_sector = mesh.nodes_per_sector;
    // An edge between two sectors is met once as the far end of this one and once as the near end: counted where it
    // begins.
    let mut edges: HashMap<[(u32, usize); 2], (usize, SurfaceEdge)> = HashMap::new();
    for element in &mesh.elements[..mesh.elements_per_sector] {
        for k in 0..4 {
            let edge = [element[k], element[4 + k], element[(k + 1) % 4]]
                .map(|n| (n % per_sector as u32, n as usize / per_sector));
            let first = edge[0].1.min(edge[2].1);
            let mut ends = [edge[0], edge[2]].map(|(local, sector)| (local, sector - first));
            ends.sort_unstable();
            edges.entry(ends).or_insert((0, edge)).0 += 1;
        }
    }
    let radius = |(local, sector): (u32, usize)| {
        let [x, y] = mesh.nodes[mesh.node(sector as isize, local)];
        x.hypot(y)
    };
    let bore: Vec<u32> = mesh.base_edges.iter().map(|edge| edge.nodes[1].0).collect();
    let in_fillet = |edge: &SurfaceEdge| !bore.contains(&edge[1].0) && radius(edge[1]) < mesh.flanks[0].radii[0];
    let mut found: Vec<SurfaceEdge> =
        edges.into_values().filter(|(count, edge)| *count == 1 && in_fillet(edge)).map(|(_, edge)| edge).collect();
    found.sort_unstable();
    found
}

/// Largest von Mises stress (MPa) along a free edge of a mesh; `moved` has the displacements of its nodes.
pub fn edge_stress(positions: [[f64; 2]; 3], moved: [[f64; 2]; 3], material: &PlaneStrain) -> f64 {
    along_edge(positions, moved, material).into_iter().map(f64::abs).fold(0.0, f64::max)
}

/// Von Mises stress (MPa), positive in tension, by the stretch of a free edge at its two points of integration.
fn along_edge(positions: [[f64; 2]; 3], moved: [[f64; 2]; 3], material: &PlaneStrain) -> [f64; 2] {
    let stretched = [0, 1, 2].map(|a| [0, 1].map(|axis| positions[a][axis] + moved[a][axis]));
    let length = |nodes: &[[f64; 2]; 3], x: f64| {
        let slopes = [x - 0.5, -2.0 * x, x + 0.5];
        let [dx, dy] = [0, 1].map(|axis| (0..3).map(|a| slopes[a] * nodes[a][axis]).sum::<f64>());
        dx.hypot(dy)
    };
    let PlaneStrain { lambda, mu, .. } = *material;
    let stiffness = 4.0 * mu * (lambda + mu) / (lambda + 2.0 * mu);
    [-1.0, 1.0].map(|side| {
        let x = side / 3f64.sqrt();
        let strain = length(&stretched, x) / length(&positions, x) - 1.0;
        material.von_mises([stiffness * strain, 0.0, 0.0]).copysign(strain)
    })
}

/// Positions and displacements of the nodes of an edge at a tooth.
fn edge_at(mesh: &WheelMesh, u: &[f64], edge: &SurfaceEdge, tooth: usize) -> [[[f64; 2]; 3]; 2] {
    let nodes = edge.map(|(local, further)| mesh.node((tooth + further) as isize, local));
    [nodes.map(|n| mesh.nodes[n]), nodes.map(|n| [u[2 * n], u[2 * n + 1]])]
}

/// Amplitude and mean of the stress along each piece of the fillets in a turn, MPa: what one tooth sees all see now.
fn fillet_cycles(problem: &Problem, state: &State) -> Vec<[f64; 2]> {
    let mesh = &problem.flexspline;
    let cycles = |edge: SurfaceEdge| {
        let of_tooth = |tooth: usize| {
            let [positions, moved] = edge_at(mesh, &state.u, &edge, tooth);
            along_edge(positions, moved, &problem.material)
        };
        let by_tooth: Vec<[f64; 2]> = (0..mesh.teeth).map(of_tooth).collect();
        [0, 1].map(|point| {
            let of = || by_tooth.iter().map(|of| of[point]);
            let (low, high) = (of().fold(f64::INFINITY, f64::min), of().fold(f64::NEG_INFINITY, f64::max));
            [0.5 * (high - low), 0.5 * (high + low)]
        })
    };
    fillet_edges(mesh).into_iter().flat_map(cycles).collect()
}

/// The largest von Mises stress of the flexspline at each place (MPa), and its tooth. `state` has all nodes.
pub(crate) fn largest_by_place(problem: &Problem, state: &State) -> [(f64, usize); 3] {
    let nodal = nodal_von_mises(&problem.flexspline, &problem.material, &state.u);
    largest_of(&problem.flexspline, &problem.material, &state.u, &nodal)
}

/// The same of displacements and the nodal stress of them.
pub(super) fn largest_of(mesh: &WheelMesh, material: &PlaneStrain, u: &[f64], nodal_mpa: &[f64]) -> [(f64, usize); 3] {
    let most = |of_tooth: &dyn Fn(usize) -> f64| {
        (0..mesh.teeth).map(|tooth| (of_tooth(tooth), tooth)).fold((0.0, 0), |a, b| if b.0 > a.0 { b } else { a })
    };
    let fillets = fillet_edges(mesh);
    let in_fillet = |tooth: usize| {
        let of_edge = |edge: &SurfaceEdge| {
            let [positions, moved] = edge_at(mesh, u, edge, tooth);
            edge_stress(positions, moved, material)
        };
        fillets.iter().map(of_edge).fold(0.0, f64::max)
    };
    let bore: Vec<u32> = mesh.base_edges.iter().flat_map(|edge| [edge.nodes[0].0, edge.nodes[1].0]).collect();
    let flanks: Vec<u32> = mesh.flanks.iter().flat_map(|flank| flank.nodes.iter().copied()).collect();
    let of_nodes = |nodes: &[u32], tooth: usize| {
        nodes.iter().map(|n| nodal_mpa[tooth * mesh.nodes_per_sector + *n as usize]).fold(0.0, f64::max)
    };
    [most(&in_fillet), most(&|tooth| of_nodes(&bore, tooth)), most(&|tooth| of_nodes(&flanks, tooth))]
}

/// The drive at rest at a generator angle under a load, on each of the meshes; its fillets are to bear so many `turns`
/// of the generator, or any number.
///
/// # Errors
/// No equilibrium.
pub fn stress_by_place(
    drive: &Drive,
    kind: GeneratorKind,
    temperature_c: f64,
    (generator_rad, torque_n_m): (f64, f64),
    settings: SolverSettings,
    turns: Option<u64>,
) -> Result<Vec<PlaceStress>, SolveError> {
    let mut by_mesh = [[(0.0, 0); 3]; MESHES.len()];
    let mut cycles = Vec::new();
    for (found, refine) in by_mesh.iter_mut().zip(MESHES) {
        let at = (generator_rad, torque_n_m);
        (*found, cycles) = on_mesh(drive, kind, temperature_c, at, refine, settings, |problem, state| {
            (largest_by_place(problem, state), fillet_cycles(problem, state))
        })?;
    }
    let is_steel = (STEEL_MPA[0]..=STEEL_MPA[1]).contains(&drive.material.youngs_modulus_mpa);
    let all = cycles.into_iter().filter(|_| is_steel).map(|cycle| Fatigue::of(cycle, turns));
    let hardest = all.min_by(|a, b| a.safety.total_cmp(&b.safety));
    let of = |(k, place): (usize, Place)| {
        let by_mesh_mpa = by_mesh.map(|found| found[k].0);
        let (von_mises_mpa, half) = of_meshes(by_mesh_mpa);
        let interval_mpa = [(von_mises_mpa - half).max(0.0), von_mises_mpa + half];
        let (tooth, fatigue) = (by_mesh[MESHES.len() - 1][k].1, hardest.filter(|_| place == Place::RootFillet));
        PlaceStress { place, von_mises_mpa, interval_mpa, by_mesh_mpa, tooth, fatigue }
    };
    Ok(Place::ALL.into_iter().enumerate().map(of).collect())
}

/// Stress in the root fillets on one mesh from which on a finer one judges it, over where steel yields: meshes twice as
/// fine had up to 1.3 times that of the coarse one, and down to a third.
const NEAR_YIELD: f64 = 0.7;

/// The largest stress in the root fillets, MPa, as the mesh of a run has it and as it is judged: near the limit of
/// steel by a finer mesh, the drive at rest in the same place, where that finds equilibrium.
pub(crate) fn judged_fillet_mpa(
    drive: &Drive,
    kind: GeneratorKind,
    temperature_c: f64,
    at: (f64, f64),
    settings: SolverSettings,
    by_run_mpa: f64,
) -> [f64; 2] {
    let refine = MESHES[if settings.mesh == MeshLevel::Fine { 2 } else { 1 }];
    let finer = |problem: &Problem, state: &State| largest_by_place(problem, state)[0].0;
    let judged = (by_run_mpa > NEAR_YIELD * YIELD_MPA)
        .then(|| on_mesh(drive, kind, temperature_c, at, refine, settings, finer))
        .and_then(Result::ok);
    [by_run_mpa, judged.unwrap_or(by_run_mpa)]
}

/// Result of `look` for the drive at rest under a load on a coarse mesh, with this multiple of the elements.
///
/// # Errors
/// No equilibrium.
pub fn on_mesh<R>(
    drive: &Drive,
    kind: GeneratorKind,
    temperature_c: f64,
    (generator_rad, torque_n_m): (f64, f64),
    refine: usize,
    settings: SolverSettings,
    look: impl FnOnce(&Problem, &State) -> R,
) -> Result<R, SolveError> {
    let settings = SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, refine, ..settings };
    let problem = Problem::new(drive, kind, temperature_c, settings)?;
    let mut motion = Motion::deformed_or_turned_in(&problem, generator_rad)?;
    motion.load(torque_n_m)?;
    Ok(look(&problem, &problem.whole_state(motion.state())))
}

/// The value of the finest of three meshes, and half the width of its interval.
fn of_meshes([_, middle, fine]: [f64; 3]) -> (f64, f64) {
    let half = (SAFETY * (fine - middle).abs()).max(LEAST_HALF * fine.abs());
    (fine, half)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::mesh::MeshDensity;

    #[test]
    fn the_interval_is_what_the_last_mesh_moved_three_times_over() {
        let (value, half) = of_meshes([281.0, 330.0, 346.0]);
        assert!(value == 346.0 && half == 48.0);
        let (value, half) = of_meshes([299.0, 300.0, 300.0]);
        assert!(
            value == 300.0 && (half - 9.0).abs() < 1e-9,
            "what no longer moves is not known to the last digit: {half}"
        );
    }

    /// Near the limit a finer mesh judges, far below it costs nothing.
    #[test]
    fn a_fillet_near_the_limit_is_judged_by_a_finer_mesh() {
        let settings = SolverSettings { mesh: MeshLevel::Coarse, ..SolverSettings::default() };
        let judged = |by_run_mpa: f64| {
            judged_fillet_mpa(&Drive::hhd_95(), GeneratorKind::Cam, 20.0, (0.0, 40.0), settings, by_run_mpa)
        };
        assert_eq!(judged(240.0), [240.0; 2]);
        let [one, finer] = judged(1777.0);
        assert!(one == 1777.0 && (270.0..300.0).contains(&finer), "{finer}");
    }

    #[test]
    fn the_surface_is_found_with_nothing_of_the_inside() {
        let drive = Drive::hhd_95();
        for refine in [1, 2] {
            let density = MeshLevel::Coarse.flexspline().times(refine);
            let mesh = WheelMesh::flexspline_as_fine_as(&drive, &density).unwrap();
            let edges = fillet_edges(&mesh);
            let radius = |(local, further): (u32, usize)| {
                let [x, y] = mesh.nodes[mesh.node(further as isize, local)];
                x.hypot(y)
            };
            let wheel = &drive.flexspline;
            let on = |r: f64| r > wheel.root_radius_mm - 1e-6 && r < mesh.flanks[0].radii[0] + 1e-6;
            assert!(edges.iter().flatten().all(|node| on(radius(*node))));
            // Both halves: half a fillet and half the land, and the other half of the fillet.
            let MeshDensity([_, space_columns, _, _, fillet_elements, _]) = density;
            assert_eq!(edges.len(), 2 * (space_columns + fillet_elements));
        }
    }

    #[test]
    fn a_tooth_sees_in_a_turn_what_all_see_at_once() {
        let (drive, settings) = (Drive::hhd_95(), SolverSettings::default());
        let cycle = |generator_rad: f64| {
            let look = |problem: &Problem, state: &State| fillet_cycles(problem, state)[0];
            on_mesh(&drive, GeneratorKind::Cam, 20.0, (generator_rad, 40.0), 1, settings, look).unwrap()
        };
        let ([amplitude, mean], turned) = (cycle(0.0), cycle(0.77));
        assert!((turned[0] / amplitude - 1.0).abs() < 0.05 && (turned[1] - mean).abs() < 0.05 * amplitude);
        assert!(amplitude > 50.0 && mean.abs() < amplitude);
    }

    #[test]
    fn a_stress_that_comes_and_goes_is_borne_by_the_line_of_goodman() {
        let safety = |cycle, turns| Fatigue::of(cycle, turns).safety;
        assert!((safety([247.5, 0.0], None) - 2.0).abs() < 1e-12, "half of 45 % of 1100 MPa");
        assert!((safety([247.5, 275.0], None) - 4.0 / 3.0).abs() < 1e-12);
        assert_eq!(safety([247.5, -100.0], None), safety([247.5, 0.0], None), "pressure helps, and is not counted");
        let fewer = safety([247.5, 0.0], Some(500_000 / 32));
        assert!((fewer - 4.0).abs() < 1e-5, "a 32nd of the cycles, twice the stress: {fewer}");
        assert!((safety([1100.0, 0.0], Some(1)) - 1.0).abs() < 1e-12, "no more than breaks it at once");
    }

    /// A rectangle's edge that is stretched and turned has Hooke's stress of plane strain, and none of the turn.
    #[test]
    fn a_stretched_edge_has_the_stress_of_hooke() {
        let steel = PlaneStrain::new(206_000.0, 0.3);
        let edge = [[1.0, 0.0], [1.5, 0.0], [2.0, 0.0]];
        let (sin, cos) = 0.7_f64.sin_cos();
        let moved = edge.map(|[x, _]| [1.001 * x * cos - x, 1.001 * x * sin]);
        let expected = 206_000.0 / (1.0 - 0.09) * 1e-3 * (1.0 - 0.3 + 0.09_f64).sqrt();
        assert!((edge_stress(edge, moved, &steel) / expected - 1.0).abs() < 1e-9);
        assert!(edge_stress(edge, edge.map(|[x, _]| [cos * x - x, sin * x]), &steel) < 1e-6);
    }
}
