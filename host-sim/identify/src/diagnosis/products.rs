//! Products of white columns, block by block of the data, each pair of sets of columns once.
//!
//! A set of columns meets the same others again and again: in every trial beside the same terms, and with each block
//! left out. What is asked of the rows is only these products; sums of blocks are the products over all rows.

use std::collections::HashMap;
use std::ops::{Deref, Range};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, PoisonError, RwLock};

use crate::linear::{Gram, products};

static SETS: AtomicU64 = AtomicU64::new(0);

/// Columns that go together. A copy is the same set.
#[derive(Clone, Debug)]
pub(crate) struct Set {
    id: u64,
    columns: Arc<Vec<Vec<f64>>>,
}

impl Set {
    /// A new set.
    pub fn new(columns: Vec<Vec<f64>>) -> Set {
        Set { id: SETS.fetch_add(1, Ordering::Relaxed), columns: Arc::new(columns) }
    }
}

impl Deref for Set {
    type Target = [Vec<f64>];

    fn deref(&self) -> &[Vec<f64>] {
        &self.columns
    }
}

/// Products of each column of a set with each of another, row by row: over all rows, then over each block.
type Met = Vec<Vec<f64>>;

/// Products that are kept at most: 256 MiB. *Guess*.
const MOST_KEPT: usize = 32 << 20;

#[derive(Default)]
struct MetPairs {
    met: HashMap<(u64, u64), Arc<Met>>,
    values: usize,
}

/// All that has met over the same rows.
pub(crate) struct Products {
    /// Blocks that all rows are made of.
    pub blocks: Vec<Range<usize>>,
    kept: RwLock<MetPairs>,
}

impl Products {
    /// Nothing yet.
    pub fn over(blocks: Vec<Range<usize>>) -> Products {
        Products { blocks, kept: RwLock::default() }
    }

    /// Products of two sets; those of the older one come first.
    fn between(&self, older: &Set, newer: &Set) -> Arc<Met> {
        let key = (older.id, newer.id);
        if let Some(met) = self.kept.read().unwrap_or_else(PoisonError::into_inner).met.get(&key) {
            return met.clone();
        }
        let own = older.id == newer.id;
        let [a, b]: [Vec<&[f64]>; 2] = [older, newer].map(|set| set.iter().map(Vec::as_slice).collect());
        let mut met: Met = vec![vec![0.0; a.len() * b.len()]];
        for block in self.blocks.iter().map(|block| products(&a, &b, block.clone(), own)) {
            met[0].iter_mut().zip(&block).for_each(|(sum, product)| *sum += product);
            met.push(block);
        }
        let values = a.len() * b.len() * met.len();
        let met = Arc::new(met);
        let mut kept = self.kept.write().unwrap_or_else(PoisonError::into_inner);
        if kept.values + values > MOST_KEPT {
            *kept = MetPairs::default();
        }
        if kept.met.insert(key, met.clone()).is_none() {
            kept.values += values;
        }
        met
    }

    /// Puts the products of two sets, over a block or all rows, where `put(i, j)` wants those of column `i` of the
    /// first and `j` of the second.
    fn meet(&self, first: &Set, second: &Set, block: Option<usize>, mut put: impl FnMut(usize, usize, f64)) {
        let swapped = first.id > second.id;
        let (older, newer) = if swapped { (second, first) } else { (first, second) };
        let met = self.between(older, newer);
        for (at, product) in met[block.map_or(0, |k| k + 1)].iter().enumerate() {
            let (i, j) = (at / newer.len(), at % newer.len());
            if swapped { put(j, i, *product) } else { put(i, j, *product) }
        }
    }

    /// Products of all columns of `sets`, set after set, over a block or all rows; the last one is the data.
    pub(crate) fn gram(&self, sets: &[&Set], block: Option<usize>) -> Gram {
        let size = sets.iter().map(|set| set.len()).sum();
        let mut products = vec![0.0; size * size];
        let mut row = 0;
        for (k, first) in sets.iter().enumerate() {
            let mut column = 0;
            for second in &sets[..=k] {
                self.meet(first, second, block, |i, j, product| {
                    products[(row + i) * size + column + j] = product;
                    products[(column + j) * size + row + i] = product;
                });
                column += second.len();
            }
            row += first.len();
        }
        Gram { size, products }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(seed: usize) -> Vec<f64> {
        (0..900).map(|k| ((k * (seed + 3) + seed * seed) % 17) as f64 - 8.0).collect()
    }

    #[test]
    fn products_are_those_of_the_columns_whatever_the_order_of_the_sets() {
        let products = Products::over(vec![0..100, 100..640, 640..900]);
        let (data, base) = (Set::new(vec![column(0)]), Set::new(vec![column(1), column(2)]));
        let term = Set::new((3..6).map(column).collect());
        let sets = [&base, &term, &data];
        let columns: Vec<&[f64]> = sets.iter().flat_map(|set| set.iter()).map(Vec::as_slice).collect();
        for (part, rows) in [(None, 0..900), (Some(1), 100..640)] {
            assert_eq!(products.gram(&sets, part).products, Gram::of(&columns, rows).products);
        }
    }
}
