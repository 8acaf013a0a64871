//! Both wheels of a drive, condensed.

use faer::Side as Triangle;
use faer::{Mat, MatRef};
use faer::linalg::solvers::Solve;
use rayon::prelude::*;

use crate::material::PlaneStrain;
use crate::mesh::WheelMesh;

use super::corotation::CoRotation;
use super::dense::Kernels;
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
    /// The same with the bore nodes eliminated, nothing touching them (see [`Kernels::eliminate`]).
    pub free_body: Vec<f64>,
}

impl Cell {
    fn new(element: &Superelement) -> Cell {
        let (n, [f, b, _]) = (element.kept(), element.unknowns);
        let r = n - f;
        let k = element.stiffness.as_ref();
        let factor = k.submatrix(0, 0, f, f).llt(Triangle::Lower).expect("a tooth held at its foot is stiff");
        let flexibility = factor.solve(Mat::<f64>::identity(f, f));
        let coupling = factor.solve(k.submatrix(0, f, f, r));
        let body = k.submatrix(f, f, r, r) - k.submatrix(f, 0, r, f) * &coupling;
        let columns = |m: MatRef<'_, f64>| -> Vec<f64> { m.col_iter().flat_map(|c| c.iter().copied()).collect() };
        let body = columns(body.as_ref());
        let mut free_body = body.clone();
        assert!(Kernels::default().eliminate(&mut free_body, r, b, 1.0), "a cell held at its faces is stiff");
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
        Kernels::default().multiply_transposed_add(&self.flank_coupling, &self.seat[..f], -1.0, &mut seat);
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
    pub fn flank(&self) -> usize {
        self.unknowns[0]
    }

    /// Unknowns on the bore, between the faces.
    pub fn bore(&self) -> usize {
        self.unknowns[1]
    }

    /// Unknowns on one face.
    pub fn face(&self) -> usize {
        self.unknowns[2]
    }

    /// Displacements of the flank nodes that no force acts on, from those of the other nodes and of the seat, in the frame.
    pub fn free_flanks(&self, kernels: Kernels, body: &[f64], seat_mm: f64) -> Vec<f64> {
        let mut flanks = vec![0.0; self.flank()];
        kernels.multiply_add(&self.flank_coupling, body, -1.0, &mut flanks);
        if seat_mm != 0.0 {
            kernels.multiply_add(&self.flank_flexibility, &self.seat[..self.flank()], -seat_mm, &mut flanks);
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

    /// How the nodes of a cell that were condensed away follow, and by how many sectors this cell stands further than the one
    /// that was condensed.
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
