//! Both wheels of a drive, condensed.

use flexspline_algebra::{MatRef, cholesky, product};
use pulp::Arch;
use rayon::prelude::*;

use crate::fem::material::PlaneStrain;
use crate::mesh::WheelMesh;

use super::corotation::CoRotation;
use super::dense::{Eliminate, Multiply, MultiplyTransposed, one, one_mut};
use super::skin::Skin;
use super::superelement::Superelement;

/// A condensed cell, ready for elimination.
#[derive(Debug, Clone)]
pub struct Cell {
    /// Unknowns on flanks, bore, and one face.
    unknowns: [usize; 3],
    /// Its turning frame.
    pub frame: CoRotation,
    /// Stiffness of all its nodes, column-major.
    pub stiffness: Vec<f64>,
    /// Force of its nodes while the housing's seat is displaced by 1 mm outwards.
    pub seat: Vec<f64>,
    /// Flexibility of the flank nodes while the others stand still, f x f.
    pub flank_flexibility: Vec<f64>,
    /// Displacement of the flank nodes against that of the others, f x r: `K_ff^-1 K_fr`.
    pub flank_coupling: Vec<f64>,
    /// Stiffness of the other nodes while no force acts on the flanks, r x r.
    pub body: Vec<f64>,
    /// Stiffness with the bore nodes eliminated, nothing touching them (see `Eliminate`).
    pub free_body: Vec<f64>,
}

impl Cell {
    fn new(element: &Superelement) -> Cell {
        let (n, [f, b, _]) = (element.kept(), element.unknowns);
        let r = n - f;
        let k = element.stiffness.as_ref();
        let factor = cholesky(k.submatrix(0, 0, f, f)).expect("a tooth held at its foot is stiff");
        let flexibility = factor.inverse();
        let coupling = factor.solve(k.submatrix(0, f, f, r));
        let body = k.submatrix(f, f, r, r) - product(k.submatrix(f, 0, r, f), coupling.as_ref());
        let columns = |m: MatRef<'_>| -> Vec<f64> { m.col_iter().flat_map(|c| c.iter().copied()).collect() };
        let body = columns(body.as_ref());
        let mut free_body = body.clone();
        let (panel, rest) = free_body.split_at_mut(r * b);
        assert!(Arch::new().dispatch(Eliminate { panel, rest, m: r, sign: 1.0 }), "a cell held at its faces is stiff");
        Cell {
            unknowns: element.unknowns,
            frame: CoRotation::new(&element.position, (f + b) / 2),
            stiffness: columns(k),
            seat: columns(element.seat.as_ref()),
            flank_flexibility: columns(flexibility.as_ref()),
            flank_coupling: columns(coupling.as_ref()),
            body,
            free_body,
        }
    }

    /// The cell without its flank nodes, which no force acts on.
    fn without_flanks(&self) -> Cell {
        let [f, b, face] = self.unknowns;
        let mut seat = self.seat[f..].to_vec();
        let flanks = one(&self.seat[..f]);
        let y = one_mut(&mut seat);
        Arch::new().dispatch(MultiplyTransposed { a: &self.flank_coupling, x: flanks, sign: -1.0, y });
        Cell {
            unknowns: [0, b, face],
            frame: self.frame.without(f / 2),
            stiffness: self.body.clone(),
            seat,
            flank_flexibility: Vec::new(),
            flank_coupling: Vec::new(),
            body: self.body.clone(),
            free_body: self.free_body.clone(),
        }
    }

    /// Unknowns on the flanks.
    pub(crate) fn flank(&self) -> usize {
        self.unknowns[0]
    }

    /// Unknowns on the bore, between the faces.
    pub(crate) fn bore(&self) -> usize {
        self.unknowns[1]
    }

    /// Unknowns on one face.
    pub(crate) fn face(&self) -> usize {
        self.unknowns[2]
    }

    /// Displacements of the flank nodes that no force acts on, from those of the other nodes and of the seat, in the
    /// frame.
    pub(crate) fn free_flanks(&self, arch: Arch, body: &[f64], seat_mm: f64) -> Vec<f64> {
        let mut flanks = vec![0.0; self.flank()];
        arch.dispatch(Multiply { a: &self.flank_coupling, x: one(body), sign: -1.0, y: one_mut(&mut flanks) });
        if seat_mm != 0.0 {
            let seat = one(&self.seat[..self.flank()]);
            arch.dispatch(Multiply { a: &self.flank_flexibility, x: seat, sign: -seat_mm, y: one_mut(&mut flanks) });
        }
        flanks
    }
}

/// One wheel, condensed.
#[derive(Debug, Clone)]
pub struct CondensedWheel {
    /// The nodes that are kept.
    pub skin: Skin,
    /// Cells that differ: whole, and without their flank nodes.
    cells: Vec<[Cell; 2]>,
    /// Which of them each cell of the ring is.
    class: Vec<usize>,
    /// How the nodes that were condensed away follow.
    elements: Vec<Superelement>,
    /// Unknowns of every cell among those of both wheels, in the order of the cell.
    unknowns: Vec<Vec<u32>>,
    /// First unknown of this wheel.
    pub first_unknown: usize,
}

impl CondensedWheel {
    /// Condenses a wheel whose unknowns begin with `first_unknown`; `held` are the nodes that the housing holds.
    pub fn new(
        whole: &WheelMesh,
        material: &PlaneStrain,
        first_unknown: usize,
        held: impl Fn(u32) -> bool + Sync,
    ) -> CondensedWheel {
        let skin = Skin::new(whole, &held);
        let class = (0..whole.teeth).map(|j| whole.sector_class(j)).collect();
        let representatives: Vec<usize> = (0..whole.sector_classes()).collect();
        let condense = |j: &usize| Superelement::new(whole, material, &skin.cell_nodes(whole, *j, &held));
        let elements: Vec<Superelement> = representatives.par_iter().map(condense).collect();
        let cells = elements
            .iter()
            .map(|element| {
                let cell = Cell::new(element);
                let bare = cell.without_flanks();
                [cell, bare]
            })
            .collect();
        let first = first_unknown as u32;
        let of_cell = |j: usize| skin.cell(j).iter().flat_map(|n| [first + 2 * n, first + 2 * n + 1]).collect();
        let unknowns = (0..whole.teeth).map(of_cell).collect();
        CondensedWheel { skin, cells, class, elements, unknowns, first_unknown }
    }

    /// Number of cells around the ring.
    pub fn count(&self) -> usize {
        self.class.len()
    }

    /// Unknowns on a face.
    pub fn face(&self) -> usize {
        self.cells[0][0].face()
    }

    /// The cell at a place of the ring, with its flank nodes or without, and its unknowns.
    pub fn cell(&self, place: usize, flanks: bool) -> (&Cell, &[u32]) {
        let [whole, bare] = &self.cells[self.class[place]];
        let unknowns = &self.unknowns[place];
        if flanks { (whole, unknowns) } else { (bare, &unknowns[whole.flank()..]) }
    }

    /// How the nodes of a cell that were condensed away follow, and by how many sectors this cell stands further than
    /// the one that was condensed.
    pub fn element(&self, place: usize) -> (&Superelement, usize) {
        let class = self.class[place];
        (&self.elements[class], place - class)
    }

    /// All nodes of the wheel `whole`, those of the skin in place: the displacements `kept` of the skin.
    pub fn spread(&self, whole: &WheelMesh, kept: &[f64]) -> Vec<f64> {
        let per_sector = self.skin.mesh.nodes_per_sector;
        let mut field = vec![0.0; 2 * whole.nodes.len()];
        for (n, u) in kept.chunks_exact(2).enumerate() {
            let node = whole.node((n / per_sector) as isize, self.skin.original[n % per_sector]);
            field[2 * node..2 * node + 2].copy_from_slice(u);
        }
        field
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;
    use crate::fem::element::{PACKED, linear_stiffness, packed_index};
    use crate::mesh::MeshLevel;

    const STEEL: (f64, f64) = (206_000.0, 0.3);

    fn steel() -> PlaneStrain {
        PlaneStrain::new(STEEL.0, STEEL.1)
    }

    /// Forces of the whole linear wheel under displacements `u`.
    fn forces(mesh: &WheelMesh, u: &[f64]) -> Vec<f64> {
        let mut force = vec![0.0; u.len()];
        for (element, points) in mesh.elements.iter().zip(&mesh.gauss) {
            let packed: [f64; PACKED] = linear_stiffness(points, &steel());
            let at = |i: usize| 2 * element[i / 2] as usize + i % 2;
            for i in 0..16 {
                for j in 0..16 {
                    force[at(i)] += packed[packed_index(i, j)] * u[at(j)];
                }
            }
        }
        force
    }

    /// Displacements of kept nodes, small: spread over the wheel by the cells, they leave no force on what was
    /// condensed, and the forces on what was kept are those of the condensed cells.
    fn condensation_is_exact(mesh: &WheelMesh, held: impl Fn(u32) -> bool + Sync + Copy, seat_mm: f64) {
        let wheel = CondensedWheel::new(mesh, &steel(), 0, held);
        let mut rng = fastrand::Rng::with_seed(11);
        let kept: Vec<f64> = (0..2 * wheel.skin.mesh.nodes.len()).map(|_| 1e-3 * (rng.f64() - 0.5)).collect();
        let mut u = wheel.spread(mesh, &kept);
        let mut expected = vec![0.0; kept.len()];
        let angle = |j: usize| wheel.skin.cell_nodes(mesh, j, held).angle;
        for j in 0..wheel.count() {
            let (cell, unknowns) = wheel.cell(j, true);
            let (element, further) = wheel.element(j);
            let mut q: Vec<f64> = unknowns.iter().map(|k| kept[*k as usize]).collect();
            super::super::tangent::rotate_pairs(&mut q, (-angle(j)).sin_cos());
            let mut interior = element.recover(&q, seat_mm);
            super::super::tangent::rotate_pairs(&mut interior, angle(j).sin_cos());
            for (n, x) in element.interior().0.iter().zip(interior.chunks_exact(2)) {
                let sector = *n as usize / mesh.nodes_per_sector + further;
                let node = mesh.node(sector as isize, *n % mesh.nodes_per_sector as u32);
                u[2 * node..2 * node + 2].copy_from_slice(x);
            }
            let mut f: Vec<f64> = cell.seat.iter().map(|s| s * seat_mm).collect();
            Arch::new().dispatch(Multiply { a: &cell.stiffness, x: one(&q), sign: 1.0, y: one_mut(&mut f) });
            super::super::tangent::rotate_pairs(&mut f, angle(j).sin_cos());
            unknowns.iter().zip(&f).for_each(|(k, f)| expected[*k as usize] += f);
        }
        for (n, x) in mesh.nodes.iter().enumerate().filter(|(n, _)| held(*n as u32)) {
            let r = x[0].hypot(x[1]);
            u[2 * n] = seat_mm * x[0] / r;
            u[2 * n + 1] = seat_mm * x[1] / r;
        }
        let force = forces(mesh, &u);
        let scale = force.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        let expected = wheel.spread(mesh, &expected);
        let off = (0..mesh.nodes.len())
            .filter(|n| !held(*n as u32))
            .flat_map(|n| [2 * n, 2 * n + 1])
            .map(|k| (force[k] - expected[k]).abs())
            .fold(0.0, f64::max);
        println!("{:?}: forces off by {off:.1e} of {scale:.1e} N/mm", mesh.kind);
        assert!(scale > 1.0 && off < 1e-9 * scale, "{off} of {scale}");
    }

    #[test]
    fn both_wheels_are_condensed_exactly() {
        let drive = Drive::hhd_95();
        condensation_is_exact(&WheelMesh::flexspline(&drive, MeshLevel::Coarse).unwrap(), |_| false, 0.0);
        let ring = WheelMesh::circular_spline(&drive, MeshLevel::Coarse).unwrap();
        let outer = |n: u32| ring.nodes[n as usize][0].hypot(ring.nodes[n as usize][1]) > ring.base_radius - 1e-6;
        condensation_is_exact(&ring, outer, 2e-3);
    }

    #[test]
    fn a_rim_that_varies_is_condensed_tooth_by_tooth() {
        let mut drive = Drive::hhd_95();
        drive.as_built.rim_thickness_harmonics =
            vec![crate::drive::Harmonic { order: 3, amplitude_um: 40.0, phase_deg: 10.0 }];
        let mesh = WheelMesh::flexspline(&drive, MeshLevel::Coarse).unwrap();
        assert!(mesh.sector_classes() > 1);
        condensation_is_exact(&mesh, |_| false, 0.0);
    }

    #[test]
    fn flanks_without_force_follow_as_they_do_in_the_whole_cell() {
        let mesh = WheelMesh::flexspline(&Drive::hhd_95(), MeshLevel::Coarse).unwrap();
        let wheel = CondensedWheel::new(&mesh, &steel(), 0, |_| false);
        let ((bare, _), (whole, _)) = (wheel.cell(0, false), wheel.cell(0, true));
        let arch = Arch::new();
        let body: Vec<f64> = (0..whole.bore() + 2 * whole.face()).map(|k| (k as f64).sin()).collect();
        let all: Vec<f64> = whole.free_flanks(arch, &body, 0.0).into_iter().chain(body.iter().copied()).collect();
        let mut force = vec![0.0; all.len()];
        arch.dispatch(Multiply { a: &whole.stiffness, x: one(&all), sign: 1.0, y: one_mut(&mut force) });
        let mut expected = vec![0.0; whole.flank()];
        let mut on_body = vec![0.0; body.len()];
        arch.dispatch(Multiply { a: &bare.stiffness, x: one(&body), sign: 1.0, y: one_mut(&mut on_body) });
        expected.extend(on_body);
        let scale = expected.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        assert!(force.iter().zip(&expected).all(|(f, e)| (f - e).abs() < 1e-9 * scale));
    }
}
