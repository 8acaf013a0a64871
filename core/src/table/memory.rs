//! The words of a table as a step reads them: in one copy, or in two that are compared.

use super::bounds::MAX_INVERSE_ITERATIONS;

/// Words in which two copies of a table disagreed while they were read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Doubt(pub u32);

impl Doubt {
    /// Whether everything read was beyond doubt.
    #[inline(always)]
    pub const fn none(self) -> bool {
        self.0 == 0
    }
}

/// The words of a table, in one copy or in two that are compared as they are read.
pub(crate) trait Memory {
    /// Where things are.
    fn plan(&self) -> &PointPlan;

    /// `N` words from word `at`. What two copies disagree in is added to `doubt`.
    fn words<const N: usize>(&self, at: usize, doubt: &mut Doubt) -> [u32; N];

    /// Half words of records from half word `at`: the first of `2·N` halves is the low one of the first word. Where
    /// there are temperatures, blended with those at the hotter one: how many half words further they are, and their
    /// share in 2⁻¹⁴.
    fn halves<const N: usize>(&self, at: usize, hotter: (usize, i32), doubt: &mut Doubt) -> [u32; N];
}

/// 2⁻²⁴ cells in one.
pub(crate) const CELL: i32 = 1 << 24;

/// Where the ripple and the curves of a table are, and what else a step needs of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PointPlan {
    pub ripple_nodes: u32,
    pub ripple_unit: u32,
    /// A sum of ripple units and weights, in 2⁻¹⁴, times this is 2⁻²⁴ cells of the ripple at the output, times 2³²;
    /// signed like the ratio.
    pub ripple_cells: i32,
    /// Nodes and place of A, B, C, 16 bits each.
    pub curves: [u32; 3],
    /// Largest error the table may give, counts.
    pub limit: i32,
    pub iterations: u32,
    /// Targets this close to the output leave the generator where it is, counts.
    pub hold: i32,
    /// Width of a cell of the ripple's axis at the output, counts; signed like the ratio.
    pub cell_width: f32,
    /// How far the ripple takes the half-width below H at most, counts; 0 where it is not needed.
    pub play_ripple: i32,
}

impl PointPlan {
    /// Iterations of an inverse; whatever the memory that holds the table says, no more than the most allowed.
    #[inline(always)]
    pub const fn iterations(&self) -> u32 {
        let most = MAX_INVERSE_ITERATIONS as u32;
        if self.iterations < most { self.iterations } else { most }
    }

    /// Values of one direction in a record: [`ripple_row`](super::ripple_row), of a number that is known to be small.
    #[inline(always)]
    pub const fn row(&self) -> usize {
        (self.ripple_nodes as usize).wrapping_add(5) & !1
    }

    /// 2⁻²⁴ cells in counts.
    #[inline(always)]
    pub fn counts_of(&self, cells: i32) -> i32 {
        (cells as f32 * (self.cell_width * (1.0 / CELL as f32))) as i32
    }

    /// Whether there is a ripple and no A, B, C, and one iteration of the inverse is enough.
    #[inline(always)]
    pub const fn is_simple(&self) -> bool {
        (self.iterations == 1) & (self.ripple_nodes > 0) & !self.has_curves()
    }

    /// Whether there is any of A, B, C.
    #[inline(always)]
    pub const fn has_curves(&self) -> bool {
        let [a, b, c] = self.curves;
        (a | b | c) >> 16 != 0
    }
}

bits_of!(PointPlan {
    ripple_nodes,
    ripple_unit,
    ripple_cells,
    curves,
    limit,
    iterations,
    hold,
    cell_width,
    play_ripple
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_is_simple_with_a_ripple_one_iteration_and_no_curve() {
        let simple = PointPlan { iterations: 1, ripple_nodes: 8, ..PointPlan::default() };
        assert!(simple.is_simple());
        for curve in 0..3 {
            let mut plan = simple;
            plan.curves[curve] = 4 << 16;
            assert!(plan.has_curves() && !plan.is_simple());
        }
        assert!(
            !PointPlan { iterations: 2, ..simple }.is_simple() && !PointPlan { ripple_nodes: 0, ..simple }.is_simple()
        );
    }
}
