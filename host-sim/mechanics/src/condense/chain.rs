//! Block factorisation of the faces around both rings.
//!
//! Unknowns come in blocks: the nodes of one face, or the tractions of one pair of flanks. A block matrix is a sum of
//! dense contributions, each over a few blocks that are near one another on the ring. Blocks are eliminated one after
//! the other around the ring, the last one closing it (multifrontal method, Duff and Reid 1983); with tractions as
//! unknowns the matrix is quasi-definite: their blocks are negative definite, those of the faces positive, and any
//! order serves (Vanderbei 1995).

use pulp::{Arch, Simd, WithSimd};

use super::dense::{Backward, Eliminate, Forward, add, kernel};

/// A block of unknowns.
#[derive(Debug, Clone, Copy)]
pub struct ChainBlock {
    /// Number of unknowns.
    pub size: usize,
    /// +1 for displacements, −1 for tractions.
    pub sign: f64,
    /// Place in the order of elimination; ties by number.
    pub key: f64,
}

/// An eliminated block.
#[derive(Debug, Clone)]
struct Panel {
    block: u32,
    size: usize,
    sign: f64,
    /// Unknowns of the front.
    order: usize,
    /// Later blocks that it couples with.
    later: Vec<u32>,
    /// Start of its values.
    start: usize,
}

/// Factor of a block matrix.
#[derive(Debug, Clone, Default)]
pub struct Chain {
    arch: Arch,
    panels: Vec<Panel>,
    values: Vec<f64>,
    /// First unknown of each block in a right-hand side, and the number of all.
    offsets: Vec<usize>,
    /// Work space: what was left of fronts, used up.
    spare: Vec<Vec<f64>>,
}

impl Chain {
    /// Factorises the sum of contributions over these blocks each; false when a block has not its sign. Each is asked
    /// for when the first of its blocks is eliminated, and gives its symmetric matrix, column-major, of which the lower
    /// triangle is read, or is refused.
    pub fn factorise(
        &mut self,
        blocks: &[ChainBlock],
        contributions: &[Vec<u32>],
        mut matrix_of: impl FnMut(usize, &mut dyn FnMut(&[f64])) -> bool,
    ) -> bool {
        self.panels.clear();
        self.values.clear();
        self.offsets.clear();
        self.offsets.push(0);
        for block in blocks {
            self.offsets.push(self.unknowns() + block.size);
        }
        let mut order: Vec<u32> = (0..blocks.len() as u32).filter(|&b| blocks[b as usize].size > 0).collect();
        order.sort_by(|a, b| blocks[*a as usize].key.total_cmp(&blocks[*b as usize].key).then(a.cmp(b)));
        let mut rank = vec![u32::MAX; blocks.len()];
        for (r, &b) in order.iter().enumerate() {
            rank[b as usize] = r as u32;
        }
        // Contributions wait at the first of their blocks; so do the updates that eliminated blocks leave behind, each
        // what is left of a front.
        let first = |of: &Vec<u32>| of.iter().map(|b| rank[*b as usize]).min();
        let mut waiting: Vec<(u32, usize)> =
            contributions.iter().enumerate().filter_map(|(c, of)| Some((first(of)?, c))).collect();
        waiting.sort_unstable();
        let mut waiting = waiting.as_slice();
        let mut updates: Vec<(usize, Vec<f64>)> = Vec::new();
        let mut offset = vec![0_usize; blocks.len()];
        for &block in &order {
            let (sources, later) =
                waiting.split_at(waiting.partition_point(|(first, _)| *first <= rank[block as usize]));
            waiting = later;
            let of_block = |(panel, _): &mut (usize, Vec<f64>)| self.panels[*panel].later[0] == block;
            let updates_here: Vec<(usize, Vec<f64>)> = updates.extract_if(.., of_block).collect();
            let mut members = vec![block];
            sources.iter().for_each(|(_, c)| members.extend(&contributions[*c]));
            updates_here.iter().for_each(|(panel, _)| members.extend(&self.panels[*panel].later));
            members.sort_unstable_by_key(|b| rank[*b as usize]);
            members.dedup();
            let mut m = 0;
            for b in &members {
                offset[*b as usize] = m;
                m += blocks[*b as usize].size;
            }
            let ChainBlock { size, sign, .. } = blocks[block as usize];
            let start = self.values.len();
            self.values.resize(start + m * size, 0.0);
            let panel = &mut self.values[start..];
            let mut rest = self.spare.pop().unwrap_or_default();
            rest.clear();
            rest.resize(m * (m - size), 0.0);
            let mut add = |of: &[u32], matrix: &[f64], before: usize| {
                let (panel, rest) = (&mut *panel, &mut rest[..]);
                self.arch.dispatch(AddBlocks { panel, rest, m, of, matrix, before, blocks, offset: &offset });
            };
            if !sources.iter().all(|(_, c)| matrix_of(*c, &mut |matrix| add(&contributions[*c], matrix, 0))) {
                return false;
            }
            for (panel, matrix) in &updates_here {
                let Panel { later, size, .. } = &self.panels[*panel];
                add(later, matrix, *size);
            }
            if !self.arch.dispatch(Eliminate { panel, rest: &mut rest, m, sign }) {
                return false;
            }
            self.spare.extend(updates_here.into_iter().map(|(_, matrix)| matrix));
            members.remove(0);
            if !members.is_empty() {
                updates.push((self.panels.len(), rest));
            }
            self.panels.push(Panel { block, size, sign, order: m, later: members, start });
        }
        true
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.offsets.last().copied().unwrap_or(0)
    }

    /// First unknown of each block in a right-hand side.
    pub fn offset(&self, block: usize) -> usize {
        self.offsets[block]
    }

    /// Solves in place for W right-hand sides.
    pub fn solve<const W: usize>(&self, x: &mut [[f64; W]]) {
        assert_eq!(x.len(), self.unknowns());
        let range = |block: u32| self.offsets[block as usize]..self.offsets[block as usize + 1];
        let mut later = Vec::new();
        for panel in &self.panels {
            later.clear();
            later.resize(panel.order - panel.size, [0.0; W]);
            let (values, own) = (&self.values[panel.start..], &mut x[range(panel.block)]);
            self.arch.dispatch(Forward { panel: values, sign: panel.sign, x: own, rest: &mut later });
            let to = panel.later.iter().flat_map(|b| range(*b));
            for (at, gained) in to.zip(&later) {
                x[at].iter_mut().zip(gained).for_each(|(x, g)| *x += g);
            }
        }
        for panel in self.panels.iter().rev() {
            later.clear();
            panel.later.iter().for_each(|b| later.extend_from_slice(&x[range(*b)]));
            let (values, own) = (&self.values[panel.start..], &mut x[range(panel.block)]);
            self.arch.dispatch(Backward { panel: values, sign: panel.sign, x: own, rest: &later });
        }
    }
}

// Adds the lower triangle of a matrix over blocks to that of a front, `before` values of each column left out.
kernel!(AddBlocks {
    panel: &'a mut [f64], rest: &'a mut [f64], m: usize, of: &'a [u32], matrix: &'a [f64], before: usize,
    blocks: &'a [ChainBlock], offset: &'a [usize]
} -> (), |simd| {
    let stride = before + of.iter().map(|b| blocks[*b as usize].size).sum::<usize>();
    let mut columns = matrix.chunks_exact(stride);
    let mut diagonal = before;
    for (jb, &b) in of.iter().enumerate() {
        let (to, size) = (offset[b as usize], blocks[b as usize].size);
        for (j, values) in columns.by_ref().take(size).enumerate() {
            let own = &mut column(panel, rest, m, to + j)[to + j..to + size];
            add(simd, own, &values[diagonal + j..diagonal + size]);
            let mut row = diagonal + size;
            for &a in &of[jb + 1..] {
                let (from, size) = (offset[a as usize], blocks[a as usize].size);
                let values = &values[row..row + size];
                if from > to {
                    add(simd, &mut column(panel, rest, m, to + j)[from..from + size], values);
                } else {
                    values.iter().enumerate().for_each(|(i, x)| column(panel, rest, m, from + i)[to + j] += x);
                }
                row += size;
            }
        }
        diagonal += size;
    }
});

/// Column k of a front, of which the panel has the first ones.
#[inline(always)]
fn column<'a>(panel: &'a mut [f64], rest: &'a mut [f64], m: usize, k: usize) -> &'a mut [f64] {
    let start = k * m;
    if start < panel.len() { &mut panel[start..start + m] } else { &mut rest[start - panel.len()..][..m] }
}

#[cfg(test)]
mod tests {
    use super::super::dense::one_mut;
    use super::*;

    /// A closed ring of blocks of both signs, every contribution over three neighbours.
    #[test]
    fn a_closed_ring_is_solved() {
        let sizes = [4, 2, 3, 5, 1, 4, 2, 3, 0, 4];
        let count = sizes.len();
        let blocks: Vec<ChainBlock> = sizes
            .iter()
            .enumerate()
            .map(|(k, &size)| ChainBlock {
                size,
                sign: if k % 4 == 1 { -1.0 } else { 1.0 },
                key: ((k * 7) % count) as f64,
            })
            .collect();
        let mut rng = fastrand::Rng::with_seed(3);
        let contributions: Vec<(Vec<u32>, Vec<f64>)> = (0..count)
            .map(|k| {
                let members: Vec<u32> = [k, (k + 2) % count, (k + 1) % count].iter().map(|b| *b as u32).collect();
                let n: usize = members.iter().map(|b| sizes[*b as usize]).sum();
                let signs: Vec<f64> = members
                    .iter()
                    .flat_map(|b| std::iter::repeat_n(blocks[*b as usize].sign, sizes[*b as usize]))
                    .collect();
                let mut matrix = vec![0.0; n * n];
                for j in 0..n {
                    for i in j..n {
                        matrix[i + j * n] = if i == j { 9.0 * signs[i] } else { rng.f64() - 0.5 };
                    }
                }
                (members, matrix)
            })
            .collect();
        let mut chain = Chain::default();
        let (over, matrices): (Vec<_>, Vec<_>) = contributions.into_iter().unzip();
        let give = |c: usize, add: &mut dyn FnMut(&[f64])| {
            add(&matrices[c]);
            true
        };
        assert!(chain.factorise(&blocks, &over, give));
        let b: Vec<f64> = (0..chain.unknowns()).map(|i| (i as f64 * 1.7).sin()).collect();
        let mut x = b.clone();
        chain.solve(one_mut(&mut x));
        let mut residual: Vec<f64> = b.iter().map(|b| -b).collect();
        for (of, matrix) in over.iter().zip(&matrices) {
            let index: Vec<usize> =
                of.iter().flat_map(|b| (0..sizes[*b as usize]).map(|i| chain.offset(*b as usize) + i)).collect();
            let n = index.len();
            for j in 0..n {
                for i in j..n {
                    let a = matrix[i + j * n];
                    residual[index[i]] += a * x[index[j]];
                    if i != j {
                        residual[index[j]] += a * x[index[i]];
                    }
                }
            }
        }
        assert!(residual.iter().all(|r| r.abs() < 1e-12), "{residual:?}");
    }
}
