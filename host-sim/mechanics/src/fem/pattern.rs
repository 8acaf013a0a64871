//! Sparsity pattern of a symmetric matrix whose unknowns come in pairs (x and y of a node), lower triangle by columns.

/// Position of an entry that the matrix does not store, by definition.
const ABSENT: u32 = u32::MAX;

/// Positions of the lower triangle over some nodes, packed by rows (see [`crate::fem::element`]). Entries of fixed
/// nodes and of nodes that do not couple are absent.
#[derive(Debug, Clone)]
pub struct PackedPositions(Vec<u32>);

impl PackedPositions {
    /// Adds a packed lower triangle to the values.
    #[inline]
    pub fn scatter<'a>(&self, packed: impl IntoIterator<Item = &'a f64>, values: &mut [f64]) {
        for (position, entry) in self.0.iter().zip(packed).filter(|(position, _)| **position != ABSENT) {
            values[*position as usize] += entry;
        }
    }
}

/// Lower-triangular pattern in compressed columns; node n has the unknowns 2n and 2n+1.
#[derive(Debug, Clone)]
pub struct Pattern {
    /// Start of each column among the values.
    pub column_starts: Vec<u32>,
    /// Row of each value, ascending in a column.
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
            for own in [x, x + 1] {
                column_starts.push(rows.len() as u32);
                rows.extend(own..x + 2);
                rows.extend(list.iter().flat_map(|&n| [2 * n, 2 * n + 1]));
            }
        }
        column_starts.push(rows.len() as u32);
        Pattern { column_starts, rows }
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.column_starts.len() - 1
    }

    /// Number of stored values.
    pub fn stored(&self) -> usize {
        self.rows.len()
    }

    /// Position of the entry of two unknowns, if the matrix stores it.
    fn position(&self, a: u32, b: u32) -> Option<u32> {
        let (row, column) = (a.max(b), a.min(b) as usize);
        let start = self.column_starts[column] as usize;
        let below = self.rows[start..self.column_starts[column + 1] as usize].binary_search(&row).ok()?;
        Some((start + below) as u32)
    }

    /// Positions of the lower triangle over these nodes; `None` marks a fixed node.
    pub fn positions(&self, nodes: &[Option<u32>]) -> PackedPositions {
        let unknowns: Vec<Option<u32>> = nodes.iter().flat_map(|n| [n.map(|n| 2 * n), n.map(|n| 2 * n + 1)]).collect();
        let entry = |a: Option<u32>, b: Option<u32>| self.position(a?, b?);
        let pairs = unknowns.iter().enumerate().flat_map(|(i, a)| unknowns[..=i].iter().map(move |b| (*a, *b)));
        PackedPositions(pairs.map(|(a, b)| entry(a, b).unwrap_or(ABSENT)).collect())
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
    fn positions_address_the_lower_triangle() {
        let groups: Vec<Vec<u32>> = vec![vec![0, 2, 1], vec![2, 3]];
        let pattern = Pattern::new(4, groups.iter().map(Vec::as_slice), std::iter::empty());
        assert_eq!(pattern.unknowns(), 8);
        assert!(pattern.position(1, 6).is_none());
        let entry = |position: u32| {
            let column = pattern.column_starts.partition_point(|&s| s <= position) - 1;
            (pattern.rows[position as usize], column as u32)
        };
        for nodes in [[0, 1], [1, 0], [2, 0], [2, 3], [3, 2]] {
            let positions = pattern.positions(&nodes.map(Some)).0;
            for i in 0..4 {
                for j in 0..=i {
                    let [r, c] = [i, j].map(|k| 2 * nodes[k / 2] + k as u32 % 2);
                    assert_eq!(entry(positions[i * (i + 1) / 2 + j]), (r.max(c), r.min(c)));
                }
            }
        }
        let of_fixed = pattern.positions(&[Some(1), None, Some(3)]).0;
        assert_eq!(of_fixed.iter().filter(|position| **position != ABSENT).count(), 6);
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
