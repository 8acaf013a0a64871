//! Least squares for a lookup that interpolates linearly between evenly spaced nodes.

/// Sums of the normal equations: a tridiagonal matrix, closed to a ring where the lookup wraps.
#[derive(Debug, Clone)]
pub(crate) struct Hats {
    from: f64,
    step: f64,
    ring: bool,
    /// Of each node: with itself, with the next, with the values.
    rows: Vec<[f64; 3]>,
}

/// Added to the diagonal, relative to its mean: a node that no sample reaches keeps to its neighbours' scale and zero.
const RIDGE: f64 = 1e-9;

impl Hats {
    /// Nodes at `from + k·step`; with `ring` the last is followed by the first.
    pub fn new(nodes: usize, from: f64, step: f64, ring: bool) -> Hats {
        Hats { from, step, ring, rows: vec![[0.0; 3]; nodes] }
    }

    /// A wanted value at a place. Beyond the ends of an open lookup nothing is wanted.
    pub fn add(&mut self, place: f64, value: f64) {
        let nodes = self.rows.len();
        let at = (place - self.from) / self.step;
        let at = if self.ring { at.rem_euclid(nodes as f64) } else { at };
        let last = if self.ring { nodes } else { nodes - 1 };
        if !(0.0..=last as f64).contains(&at) {
            return;
        }
        let low = (at as usize).min(last - 1);
        let high = (low + 1) % nodes;
        let weight = at - low as f64;
        let rest = 1.0 - weight;
        self.rows[low][0] += rest * rest;
        self.rows[high][0] += weight * weight;
        self.rows[low][1] += rest * weight;
        self.rows[low][2] += rest * value;
        self.rows[high][2] += weight * value;
    }

    /// The values at the nodes.
    pub(crate) fn solve(&self) -> Vec<f64> {
        let nodes = self.rows.len();
        let mean = self.rows.iter().map(|row| row[0]).sum::<f64>() / nodes as f64;
        let mut diagonal: Vec<f64> = self.rows.iter().map(|row| row[0] + RIDGE * mean).collect();
        let beside: Vec<f64> = self.rows.iter().map(|row| row[1]).collect();
        let values: Vec<f64> = self.rows.iter().map(|row| row[2]).collect();
        let corner = if self.ring { beside[nodes - 1] } else { 0.0 };
        if corner == 0.0 {
            return tridiagonal(&diagonal, &beside, values);
        }
        // The ring is a line plus a matrix of rank one (Sherman and Morrison).
        let gamma = -diagonal[0];
        diagonal[0] -= gamma;
        diagonal[nodes - 1] -= corner * corner / gamma;
        let line = tridiagonal(&diagonal, &beside, values);
        let mut closing = vec![0.0; nodes];
        closing[0] = gamma;
        closing[nodes - 1] += corner;
        let closing = tridiagonal(&diagonal, &beside, closing);
        let through = |x: &[f64]| x[0] + corner / gamma * x[nodes - 1];
        let share = through(&line) / (1.0 + through(&closing));
        line.iter().zip(&closing).map(|(x, z)| x - share * z).collect()
    }
}

/// Solves a symmetric tridiagonal system.
fn tridiagonal(diagonal: &[f64], beside: &[f64], mut values: Vec<f64>) -> Vec<f64> {
    let nodes = diagonal.len();
    let mut pivots = diagonal.to_vec();
    for k in 1..nodes {
        let share = beside[k - 1] / pivots[k - 1];
        pivots[k] -= share * beside[k - 1];
        values[k] -= share * values[k - 1];
    }
    values[nodes - 1] /= pivots[nodes - 1];
    for k in (0..nodes - 1).rev() {
        values[k] = (values[k] - beside[k] * values[k + 1]) / pivots[k];
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(nodes: &[f64], at: f64) -> f64 {
        let (low, weight) = (at as usize, at.fract());
        nodes[low] * (1.0 - weight) + nodes[(low + 1) % nodes.len()] * weight
    }

    #[test]
    fn what_a_lookup_can_hold_is_found_again_open_and_in_a_ring() {
        let truth = [0.5, -1.0, 2.0, 0.25, -0.75];
        for (ring, last) in [(true, 5.0), (false, 4.0)] {
            let mut hats = Hats::new(5, 10.0, 0.5, ring);
            for k in 0..97 {
                let at = last * f64::from(k) / 97.0;
                hats.add(10.0 + 0.5 * at, value(&truth, at));
            }
            for (found, wanted) in hats.solve().iter().zip(truth) {
                assert!((found - wanted).abs() < 1e-7, "{ring}: {found} for {wanted}");
            }
        }
    }
}
