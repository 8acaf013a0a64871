//! The part of the tangent that is not symmetric: where flanks slip, their friction follows the pressure.
//!
//! At a point that slips under the gap g the traction along the flank is ±μ p, p = −k g. A change of the gap changes
//! the force along the flank, a slip does not change the force across it. With the symmetric rest of the tangent K and
//! the columns `s` (forces along the flank) and rows `g` (change of the gap) of all points that slip, scaled by
//! `d = ∓μ k w`, the step solves
//!
//! ```text
//! (K + Σ d s gᵀ) x = r
//! ```
//!
//! K alone is factorised. The changes of the gaps y = G x, a few hundred numbers, solve
//!
//! ```text
//! y + G K⁻¹ S D y = G K⁻¹ r,      x = K⁻¹ (r − S D y)
//! ```
//!
//! by GMRES (Saad and Schultz 1986), one solve with the factor of K an iteration.

use crate::contact::SlipPoint;
use crate::fem::dot;

use super::step::{BORDERS, OUTPUT};

/// Krylov vectors, and the reduction of the residual at which they are enough: Newton needs no better step.
const MOST_VECTORS: usize = 12;
const ENOUGH: f64 = 1e-2;

/// Forces, or displacements, of all unknowns.
#[derive(Clone)]
pub(super) struct NodalField {
    pub free: Vec<f64>,
    pub border: [f64; BORDERS],
}

/// Points that slip, pair by pair; of a pair whose face is uneven all that bear.
#[derive(Default)]
pub(super) struct Slipping {
    points: Vec<SlipPoint>,
    /// How many each pair has.
    of_pairs: Vec<usize>,
}

impl Slipping {
    pub fn clear(&mut self) {
        self.points.clear();
        self.of_pairs.clear();
    }

    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Adds the points of a pair whose local unknowns are numbered by `unknown`.
    pub fn add(&mut self, points: &[SlipPoint], unknown: impl Fn(usize) -> usize) {
        self.points.extend(points.iter().map(|point| SlipPoint { index: point.index.map(&unknown), ..*point }));
        self.of_pairs.push(points.len());
    }

    /// G x: how the gaps change, less what an uneven face gives way.
    fn gaps(&self, x: &NodalField) -> Vec<f64> {
        let gap = |p: &SlipPoint| {
            let nodes: f64 = p.index.iter().zip(&p.gap).map(|(i, g)| g * x.free[*i]).sum();
            nodes + p.gap_by_output * x.border[OUTPUT]
        };
        let mut gaps: Vec<f64> = self.points.iter().map(gap).collect();
        let mut first = 0;
        for count in &self.of_pairs {
            let of_pair = first..first + count;
            let later: f64 =
                self.points[of_pair.clone()].iter().zip(&gaps[of_pair.clone()]).map(|(p, y)| p.gives_way * y).sum();
            gaps[of_pair].iter_mut().for_each(|y| *y -= later);
            first += count;
        }
        gaps
    }

    /// S D y, times a factor, added to forces.
    fn add_forces(&self, y: &[f64], factor: f64, to: &mut NodalField) {
        for (p, y) in self.points.iter().zip(y) {
            let amount = factor * p.stiffness * y;
            for (i, s) in p.index.iter().zip(&p.slip) {
                to.free[*i] += amount * s;
            }
            to.border[OUTPUT] += amount * p.slip_by_output;
        }
    }

    /// The step for the forces `r`, where `solve` solves with K in place; nothing where it cannot.
    pub fn solve(&self, mut r: NodalField, mut solve: impl FnMut(&mut NodalField) -> Option<()>) -> Option<NodalField> {
        if self.is_empty() {
            return solve(&mut r).map(|()| r);
        }
        let mut x = r.clone();
        solve(&mut x)?;
        let none = NodalField { free: vec![0.0; r.free.len()], border: [0.0; BORDERS] };
        let mut possible = true;
        let y = gmres(&self.gaps(&x), |y| {
            let mut response = none.clone();
            self.add_forces(y, 1.0, &mut response);
            possible &= solve(&mut response).is_some();
            self.gaps(&response).iter().zip(y).map(|(response, y)| y + response).collect()
        });
        let mut x = r;
        self.add_forces(&y, -1.0, &mut x);
        solve(&mut x)?;
        possible.then_some(x)
    }
}

/// Solves `A y = b` from nothing, as well as a few Krylov vectors can.
fn gmres(b: &[f64], mut multiply: impl FnMut(&[f64]) -> Vec<f64>) -> Vec<f64> {
    let size = dot(b, b).sqrt();
    if size == 0.0 || !size.is_finite() {
        return vec![0.0; b.len()];
    }
    let mut basis = vec![b.iter().map(|x| x / size).collect::<Vec<f64>>()];
    // Columns of the triangle that rotations make of the Hessenberg matrix, and the right-hand side under them.
    let (mut columns, mut rotations) = (Vec::<Vec<f64>>::new(), Vec::<(f64, f64)>::new());
    let mut right = vec![size];
    while columns.len() < MOST_VECTORS && right[columns.len()].abs() > ENOUGH * size {
        let mut next = multiply(&basis[columns.len()]);
        let mut column = Vec::with_capacity(basis.len() + 1);
        for v in &basis {
            let along = dot(&next, v);
            next.iter_mut().zip(v).for_each(|(x, v)| *x -= along * v);
            column.push(along);
        }
        let rest = dot(&next, &next).sqrt();
        for (k, (c, s)) in rotations.iter().enumerate() {
            let (a, b) = (column[k], column[k + 1]);
            (column[k], column[k + 1]) = (c * a + s * b, c * b - s * a);
        }
        let last = columns.len();
        let radius = column[last].hypot(rest);
        if radius == 0.0 || !radius.is_finite() {
            break;
        }
        let (c, s) = (column[last] / radius, rest / radius);
        column[last] = radius;
        rotations.push((c, s));
        right.push(-s * right[last]);
        right[last] *= c;
        columns.push(column);
        if rest > 0.0 {
            basis.push(next.iter().map(|x| x / rest).collect());
        } else {
            break;
        }
    }
    let mut weights = right[..columns.len()].to_vec();
    for k in (0..columns.len()).rev() {
        weights[k] /= columns[k][k];
        for j in 0..k {
            weights[j] -= columns[k][j] * weights[k];
        }
    }
    let mut y = vec![0.0; b.len()];
    for (weight, v) in weights.iter().zip(&basis) {
        y.iter_mut().zip(v).for_each(|(y, v)| *y += weight * v);
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_that_is_not_symmetric_is_solved() {
        let n = 8;
        let a = |i: usize, j: usize| if i == j { 3.0 } else { ((3 * i + 7 * j) as f64).sin() * 0.4 };
        let multiply = |x: &[f64]| (0..n).map(|i| (0..n).map(|j| a(i, j) * x[j]).sum()).collect::<Vec<f64>>();
        let b: Vec<f64> = (0..n).map(|i| 1.0 + i as f64).collect();
        let off = |y: &[f64]| multiply(y).iter().zip(&b).map(|(x, b)| (x - b).powi(2)).sum::<f64>().sqrt();
        let found = off(&gmres(&b, multiply));
        assert!(found <= ENOUGH * dot(&b, &b).sqrt(), "{found}");
        assert_eq!(gmres(&[0.0; 3], |_| unreachable!()), [0.0; 3]);
        // The identity needs one vector.
        assert!(gmres(&b, <[f64]>::to_vec).iter().zip(&b).all(|(x, b)| (x - b).abs() < 1e-13));
    }

    /// Two unknowns held by springs, one point that slips along the second when the first closes its gap.
    #[test]
    fn a_step_takes_along_the_friction_that_follows_the_pressure() {
        let springs = [4.0, 5.0];
        let mut slipping = Slipping::default();
        let mut unit = |gap: f64, slip: f64| {
            let mut point = SlipPoint { index: [0; 12], gap: [0.0; 12], slip: [0.0; 12], ..SlipPoint::default() };
            point.index[1] = 1;
            (point.gap[0], point.slip[1], point.stiffness) = (gap, slip, 2.0);
            slipping.add(&[point], |i| i);
        };
        unit(1.0, 0.7);
        unit(-0.5, 0.2);
        let r = NodalField { free: vec![1.0, -2.0], border: [0.0; BORDERS] };
        let solve = |x: &mut NodalField| {
            x.free.iter_mut().zip(springs).for_each(|(x, k)| *x /= k);
            Some(())
        };
        let x = slipping.solve(r.clone(), solve).unwrap();
        let gaps = slipping.gaps(&x);
        let mut left = r;
        slipping.add_forces(&gaps, -1.0, &mut left);
        for k in 0..2 {
            let off = left.free[k] - springs[k] * x.free[k];
            assert!(off.abs() < 1e-2, "unknown {k}: {off}");
        }
    }

    /// Points of an uneven face move back together; those of another pair stay.
    #[test]
    fn a_face_that_gives_way_takes_it_from_the_gaps_of_its_pair() {
        let unit = |gives_way: f64| {
            let mut point = SlipPoint { gives_way, ..SlipPoint::default() };
            point.gap[0] = 1.0;
            point
        };
        let mut slipping = Slipping::default();
        slipping.add(&[unit(0.3), unit(0.2)], |i| i);
        slipping.add(&[unit(0.0)], |i| i);
        let gaps = slipping.gaps(&NodalField { free: vec![2.0; 12], border: [0.0; BORDERS] });
        assert_eq!(gaps, [1.0, 1.0, 2.0]);
    }
}
