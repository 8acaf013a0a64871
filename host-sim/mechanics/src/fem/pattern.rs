//! Sparsity pattern of a symmetric matrix whose unknowns come in pairs (x and y of a node), lower triangle by columns.

/// Where the 2 x 2 block of a node pair (a, b) lies among the values: entry (i, j) is at `base + i * row + j * column`,
/// i counting components of a, j of b.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BlockPosition {
    /// Position of entry (0, 0).
    pub base: u32,
    /// Step to the next component of a.
    pub row: u32,
    /// Step to the next component of b.
    pub column: u32,
}

impl BlockPosition {
    /// Adds the entries of a block to the values.
    #[inline]
    pub(crate) fn add(&self, entry: impl Fn(usize, usize) -> f64, values: &mut [f64]) {
        for i in 0..2 {
            for j in 0..2 {
                values[self.base as usize + i * self.row as usize + j * self.column as usize] += entry(i, j);
            }
        }
    }
}

/// Positions of an 8-node element: for nodes `a > b` the block at `a (a-1)/2 + b`, for each node its diagonal block as
/// positions of (x, x), (y, x), (y, y). Blocks of fixed nodes are absent.
#[derive(Debug, Clone)]
pub struct ElementPositions {
    off_diagonal: [Option<BlockPosition>; 28],
    diagonal: [Option<[u32; 2]>; 8],
}

impl ElementPositions {
    /// Adds a packed lower triangle (see [`crate::fem::element`]) to the values.
    #[inline]
    pub fn scatter(&self, packed: &[f64; crate::fem::element::PACKED], values: &mut [f64]) {
        for a in 0..8 {
            let row_x = a * (2 * a + 1);
            let row_y = row_x + 2 * a + 1;
            for b in 0..a {
                if let Some(p) = self.off_diagonal[a * (a - 1) / 2 + b] {
                    p.add(|i, j| packed[[row_x, row_y][i] + 2 * b + j], values);
                }
            }
            if let Some([xx, yy]) = self.diagonal[a] {
                values[xx as usize] += packed[row_x + 2 * a];
                values[xx as usize + 1] += packed[row_y + 2 * a];
                values[yy as usize] += packed[row_y + 2 * a + 1];
            }
        }
    }
}

/// Lower-triangular pattern in compressed columns; node n has the unknowns 2n and 2n+1.
#[derive(Debug, Clone)]
pub struct Pattern {
    /// Later neighbours of each node, ascending.
    neighbours: Vec<Vec<u32>>,
    /// Start of each column among the values.
    pub column_starts: Vec<u32>,
    /// Row of each value.
    pub rows: Vec<u32>,
}

impl Pattern {
    /// From groups of nodes that couple with one another, and pairs of groups that couple across.
    pub fn new<'a>(
        nodes: usize,
        groups: impl Iterator<Item = &'a [u32]>,
        pairs: impl Iterator<Item = (&'a [u32], &'a [u32])>,
    ) -> Pattern {
        let mut neighbours: Vec<Vec<u32>> = vec![Vec::with_capacity(12); nodes];
        let mut couple = |a: u32, b: u32| {
            let (low, high) = if a < b { (a, b) } else { (b, a) };
            if low != high {
                neighbours[low as usize].push(high);
            }
        };
        for group in groups {
            for (i, &a) in group.iter().enumerate() {
                for &b in &group[..i] {
                    couple(a, b);
                }
            }
        }
        for (first, second) in pairs {
            for &a in first {
                for &b in second {
                    couple(a, b);
                }
            }
        }
        for list in &mut neighbours {
            list.sort_unstable();
            list.dedup();
        }
        let mut column_starts = Vec::with_capacity(2 * nodes + 1);
        let mut rows = Vec::new();
        for (node, list) in neighbours.iter().enumerate() {
            let x = 2 * node as u32;
            column_starts.push(rows.len() as u32);
            rows.extend([x, x + 1]);
            rows.extend(list.iter().flat_map(|&n| [2 * n, 2 * n + 1]));
            column_starts.push(rows.len() as u32);
            rows.push(x + 1);
            rows.extend(list.iter().flat_map(|&n| [2 * n, 2 * n + 1]));
        }
        column_starts.push(rows.len() as u32);
        Pattern { neighbours, column_starts, rows }
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.column_starts.len() - 1
    }

    /// Number of stored values.
    pub fn stored(&self) -> usize {
        self.rows.len()
    }

    /// Block of two different nodes, if they couple.
    pub(crate) fn block(&self, a: u32, b: u32) -> Option<BlockPosition> {
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        let k = self.neighbours[low as usize].binary_search(&high).ok()? as u32;
        let first = self.column_starts[2 * low as usize] + 2 + 2 * k;
        let second = self.column_starts[2 * low as usize + 1] + 1 + 2 * k;
        let across = second - first;
        Some(if a > b {
            BlockPosition { base: first, row: 1, column: across }
        } else {
            BlockPosition { base: first, row: across, column: 1 }
        })
    }

    /// Positions of (x, x) and (y, y) of a node; (y, x) follows (x, x).
    pub(crate) fn diagonal(&self, node: u32) -> [u32; 2] {
        [self.column_starts[2 * node as usize], self.column_starts[2 * node as usize + 1]]
    }

    /// Positions of an element given by its nodes; `None` marks a fixed node.
    ///
    /// # Panics
    /// When the element was not among the groups of the pattern.
    pub fn element(&self, nodes: &[Option<u32>; 8]) -> ElementPositions {
        let mut positions = ElementPositions { off_diagonal: [None; 28], diagonal: [None; 8] };
        for a in 0..8 {
            positions.diagonal[a] = nodes[a].map(|n| self.diagonal(n));
            for b in 0..a {
                if let (Some(na), Some(nb)) = (nodes[a], nodes[b]) {
                    positions.off_diagonal[a * (a - 1) / 2 + b] =
                        Some(self.block(na, nb).expect("element nodes are in the pattern"));
                }
            }
        }
        positions
    }

    /// `y += A x` for the symmetric matrix with these values.
    #[cfg(test)]
    pub(crate) fn multiply_add(&self, values: &[f64], x: &[f64], y: &mut [f64]) {
        for column in 0..self.unknowns() {
            let (start, end) = (self.column_starts[column] as usize, self.column_starts[column + 1] as usize);
            let mut sum = values[start] * x[column];
            for (&row, &value) in self.rows[start + 1..end].iter().zip(&values[start + 1..end]) {
                y[row as usize] += value * x[column];
                sum += value * x[row as usize];
            }
            y[column] += sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_address_the_lower_triangle() {
        let groups: Vec<Vec<u32>> = vec![vec![0, 2, 1], vec![2, 3]];
        let pattern = Pattern::new(4, groups.iter().map(Vec::as_slice), std::iter::empty());
        assert_eq!(pattern.unknowns(), 8);
        assert!(pattern.block(0, 3).is_none());
        let entry = |position: u32| {
            let column = pattern.column_starts.partition_point(|&s| s <= position) - 1;
            (pattern.rows[position as usize], column as u32)
        };
        for (a, b) in [(0, 1), (1, 0), (2, 0), (2, 3), (3, 2)] {
            let p = pattern.block(a, b).unwrap();
            for i in 0..2 {
                for j in 0..2 {
                    let (row, column) = entry(p.base + i * p.row + j * p.column);
                    let (r, c) = (2 * a + i, 2 * b + j);
                    assert_eq!((row, column), (r.max(c), r.min(c)));
                }
            }
        }
    }

    #[test]
    fn multiplication_is_symmetric() {
        let groups = [vec![0, 1], vec![1, 2]];
        let pattern = Pattern::new(3, groups.iter().map(Vec::as_slice), std::iter::empty());
        let values: Vec<f64> = (0..pattern.stored()).map(|i| (i as f64 * 0.7).cos()).collect();
        let (x, y): (Vec<f64>, Vec<f64>) = (0..6).map(|i| ((i as f64).sin(), (i as f64 * 2.1).cos())).unzip();
        let (mut ax, mut ay) = (vec![0.0; 6], vec![0.0; 6]);
        pattern.multiply_add(&values, &x, &mut ax);
        pattern.multiply_add(&values, &y, &mut ay);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(p, q)| p * q).sum::<f64>();
        assert!((dot(&y, &ax) - dot(&x, &ay)).abs() < 1e-14);
    }
}
