//! Both wheels of a drive, condensed.

use faer::Mat;
use faer::Side as Triangle;
use faer::linalg::solvers::Solve;

use crate::material::PlaneStrain;
use crate::mesh::WheelMesh;

use super::corotation::CoRotation;
use super::dense::Kernels;
use super::skin::Skin;
use super::superelement::Superelement;

/// A condensed cell, ready for elimination.
#[derive(Debug, Clone)]
pub struct Cell {
    /// Its stiffness and recovery.
    pub element: Superelement,
    /// Its turning frame.
    pub frame: CoRotation,
    /// Stiffness of all kept nodes, column-major.
    pub stiffness: Vec<f64>,
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
    fn new(element: Superelement) -> Cell {
        let (n, f) = (element.kept(), element.unknowns[0]);
        let r = n - f;
        let k = element.stiffness.as_ref();
        let factor = k.submatrix(0, 0, f, f).llt(Triangle::Lower).expect("a tooth held at its foot is stiff");
        let flexibility = factor.solve(Mat::<f64>::identity(f, f));
        let coupling = factor.solve(k.submatrix(0, f, f, r));
        let body = k.submatrix(f, f, r, r) - k.submatrix(f, 0, r, f) * &coupling;
        let b = element.unknowns[1];
        let columns = |m: &Mat<f64>| -> Vec<f64> { m.col_iter().flat_map(|c| c.iter().copied().collect::<Vec<_>>()).collect() };
        let body: Vec<f64> = columns(&body);
        let mut free_body = body.clone();
        assert!(Kernels::default().eliminate(&mut free_body, r, b, 1.0), "a cell held at its faces is stiff");
        Cell {
            frame: CoRotation::new(&element),
            stiffness: columns(&element.stiffness),
            flank_flexibility: columns(&flexibility),
            flank_coupling: columns(&coupling),
            body,
            free_body,
            element,
        }
    }

    /// Unknowns on the flanks.
    pub fn flank(&self) -> usize {
        self.element.unknowns[0]
    }

    /// Unknowns on the bore, between the faces.
    pub fn bore(&self) -> usize {
        self.element.unknowns[1]
    }

    /// Unknowns on one face.
    pub fn face(&self) -> usize {
        self.element.unknowns[2]
    }
}

/// One wheel, condensed.
#[derive(Debug, Clone)]
pub struct CondensedWheel {
    /// The nodes that are kept.
    pub skin: Skin,
    /// Cells that differ.
    pub cells: Vec<Cell>,
    /// Which of them each cell of the ring is.
    pub class: Vec<usize>,
    /// Unknowns of every cell among those of both wheels, in the order of the cell.
    pub unknowns: Vec<Vec<u32>>,
    /// First unknown of this wheel.
    pub first_unknown: usize,
}

impl CondensedWheel {
    /// Condenses a wheel whose unknowns begin with `first_unknown`; `held` are the nodes that the housing holds.
    pub fn new(
        whole: &WheelMesh,
        material: &PlaneStrain,
        first_unknown: usize,
        held: impl Fn(u32) -> bool,
    ) -> CondensedWheel {
        let skin = Skin::new(whole, &held);
        let class = vec![0; whole.teeth];
        let cells = vec![Cell::new(Superelement::new(whole, material, &skin.cell_nodes(whole, 0, &held)))];
        let first = first_unknown as u32;
        let of_cell = |j: usize| skin.cell(j).iter().flat_map(|n| [first + 2 * n, first + 2 * n + 1]).collect();
        let unknowns = (0..whole.teeth).map(of_cell).collect();
        CondensedWheel { skin, cells, class, unknowns, first_unknown }
    }

    /// The condensed cell at a place of the ring.
    pub fn cell(&self, place: usize) -> &Cell {
        &self.cells[self.class[place]]
    }
}
