//! The whole flexspline along its axis: what one harmonic of the rim does to its tubes.

use super::matrix::Symmetric;
use super::model::Flexspline3d;
use super::rim::LINES;
use super::shell::{NODE, SLOPE, Shell, U, U_SLOPE, V, V_SLOPE, W};
use super::tube::{End, Tube, mirrored};

/// Displacement of the middle surface at one place along the axis: `u = U cos n theta` along it, `v = V sin n theta`
/// around it, `w = W cos n theta` outward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Station {
    /// From the middle of the rim, mm; positive from the flange to the bottom.
    pub x_mm: f64,
    /// U, mm.
    pub along: f64,
    /// V, mm.
    pub around: f64,
    /// W, mm.
    pub outward: f64,
    /// W', rad.
    pub slope: f64,
}

/// All nodes along the axis, in one matrix.
struct AxialNodes {
    matrix: Symmetric,
    /// First unknown and place of each node, of the rim and its tubes together, in order.
    nodes: Vec<(usize, f64)>,
    /// Those under the lines that the generator presses on.
    lines: Vec<(usize, f64)>,
    held: Vec<usize>,
}

impl Flexspline3d {
    /// The flexspline where harmonic n (2 or more) of the rim has the amplitude 1 mm of an oval without stretching, its
    /// band straight and free to tilt: from the flange's end to the bottom's.
    pub fn shape(&self, n: u32) -> Vec<Station> {
        let axis = self.axis(n);
        // The band: W and its tilt, mean V and its slope, what else V does.
        let lines: Vec<usize> = axis.lines.iter().flat_map(|(first, _)| [first + W, first + V]).collect();
        let stiffness = axis.matrix.condensed(&lines, &axis.held);
        let of = |which: usize, weights: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..2 * LINES).map(|i| if i % 2 == which { weights(i / 2) } else { 0.0 }).collect()
        };
        let mut basis =
            vec![of(0, &|_| 1.0), of(1, &|_| 1.0), of(0, &|k| axis.lines[k].1), of(1, &|k| axis.lines[k].1)];
        basis.extend(
            (0..LINES - 2).map(|first| of(1, &|k| [1.0, -2.0, 1.0].get(k.wrapping_sub(first)).copied().unwrap_or(0.0))),
        );
        let parts = stiffness.in_basis(&basis).solved(&[(0, 1.0), (1, -1.0 / f64::from(n))]);
        let mut known: Vec<(usize, f64)> = axis.held.iter().map(|i| (*i, 0.0)).collect();
        for (k, line) in lines.iter().enumerate() {
            known.push((*line, basis.iter().zip(&parts).map(|(row, part)| row[k] * part).sum()));
        }
        let solved = axis.matrix.solved(&known);
        let station = |&(first, x_mm): &(usize, f64)| Station {
            x_mm,
            along: solved[first + U],
            around: solved[first + V],
            outward: solved[first + W],
            slope: solved[first + SLOPE],
        };
        axis.nodes.iter().map(station).collect()
    }

    fn axis(&self, n: u32) -> AxialNodes {
        let half = 0.5 * self.width_mm;
        // Walls in order: tube to the flange, rim, tube to the bottom.
        let mut pieces: Vec<(Shell, Vec<f64>)> = Vec::new();
        let tube_from =
            |tube: &Tube, from: f64, to: f64| (tube.shell, spread(from, to, tube.shell.elements(tube.length_mm, n)));
        if let Some((tube, _)) = &self.flange {
            pieces.push(tube_from(tube, -half - tube.length_mm, -half));
        }
        let band = self.band_mm.min(self.width_mm);
        let places: Vec<f64> = (0..LINES).map(|k| band * (k as f64 / (LINES - 1) as f64 - 0.5)).collect();
        let mut stops = places.clone();
        if band < self.width_mm * (1.0 - 1e-9) {
            stops = [vec![-half], stops, vec![half]].concat();
        }
        let mut rim = vec![stops[0]];
        for pair in stops.windows(2) {
            rim.extend(&spread(pair[0], pair[1], self.rim.elements(pair[1] - pair[0], n))[1..]);
        }
        pieces.push((self.rim, rim));
        if let Some((tube, _)) = &self.bottom {
            pieces.push(tube_from(tube, half, half + tube.length_mm));
        }
        // Where two walls meet they share all but U' and V': a node there has the unknowns of the first, and two more.
        let mut nodes: Vec<(usize, f64)> = Vec::new();
        let mut elements = Vec::new();
        let mut size = 0;
        for (wall, places) in &pieces {
            let mut at: Option<[usize; NODE]> = None;
            for &x in places {
                let meets = at.is_none() && nodes.last().is_some_and(|(_, last)| (last - x).abs() < 1e-9);
                let unknowns = if meets {
                    let (first, _) = nodes[nodes.len() - 1];
                    let mut shared: [usize; NODE] = std::array::from_fn(|i| first + i);
                    (shared[U_SLOPE], shared[V_SLOPE]) = (size, size + 1);
                    size += 2;
                    shared
                } else {
                    nodes.push((size, x));
                    size += NODE;
                    std::array::from_fn(|i| size - NODE + i)
                };
                if let Some(before) = at {
                    let both: [usize; 2 * NODE] =
                        std::array::from_fn(|i| if i < NODE { before[i] } else { unknowns[i - NODE] });
                    elements.push((*wall, both, x));
                }
                at = Some(unknowns);
            }
        }
        let mut matrix = Symmetric::zeros(size);
        let mut before = nodes[0].1;
        for (wall, unknowns, x) in elements {
            matrix.add_at(&wall.element(x - before, n), unknowns);
            before = x;
        }
        let mut held = Vec::new();
        let ends = [(&self.flange, nodes[0].0, true), (&self.bottom, nodes[nodes.len() - 1].0, false)];
        for (side, first, is_flange) in ends {
            let Some((_, end)) = side else { continue };
            match end {
                End::Free => {}
                End::Clamped => held.extend([U, V, W, SLOPE].map(|i| first + i)),
                End::InPlane => held.extend([V, W].map(|i| first + i)),
                End::Plate(plate) => {
                    let edge = if is_flange { mirrored(plate.rim(n)) } else { plate.rim(n) };
                    matrix.add_at(&edge, [U, V, W, SLOPE].map(|i| first + i));
                }
            }
        }
        let line = |place: &f64| {
            let (first, x) =
                nodes.iter().find(|(_, x)| (x - place).abs() < 1e-9).expect("the rim has a node under each line");
            (*first, *x)
        };
        let lines = places.iter().map(line).collect();
        AxialNodes { matrix, nodes, lines, held }
    }
}

/// N equal steps from one place to another, both ends included.
fn spread(from: f64, to: f64, elements: usize) -> Vec<f64> {
    (0..=elements).map(|k| from + (to - from) * k as f64 / elements as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;

    /// A cup without stretching: `W = x/L`, `V = -W/n`, `U = -R W'/n²`.
    #[test]
    fn a_cup_is_a_cone_along_its_axis() {
        let cup = Flexspline3d::of(&Drive::cup_95(), false).unwrap();
        let shape = cup.shape(2);
        let (length, radius) = (90.0, 47.275);
        let bottom = shape[shape.len() - 1];
        assert_eq!((shape[0].x_mm, bottom.x_mm), (-10.0, 90.0));
        assert_eq!((bottom.around, bottom.outward), (0.0, 0.0));
        for at in shape.iter().filter(|at| at.x_mm < 80.0) {
            let cone = (90.0 - at.x_mm) / length;
            assert!((at.outward - cone).abs() < 0.01, "{at:?} {cone}");
            assert!((at.around + 0.5 * at.outward).abs() < 0.01);
            assert!((at.along - radius / (4.0 * length)).abs() < 0.01, "U = -R W'/n², W' = -1/L: {at:?}");
        }
    }

    /// Known values at the rim otherwise: amplitude 1 in its middle, tilt and skew of the addition; and the ends are
    /// held.
    #[test]
    fn the_rim_of_the_whole_is_the_rim_that_is_coupled() {
        for drive in [Drive::hhd_95_hermetic(), Drive::cup_95(), Drive::hhd_95().with_set("sleeve.kind=hat").unwrap()] {
            let whole = Flexspline3d::of(&drive, true).unwrap();
            for n in [2, 4, 12] {
                let shape = whole.shape(n);
                let addition = whole.addition(n);
                let at = |x: f64| *shape.iter().find(|at| (at.x_mm - x).abs() < 1e-9).unwrap();
                let half = 0.5 * whole.band_mm;
                let (low, middle, high) = (at(-half), at(0.0), at(half));
                assert!((middle.outward - 1.0).abs() < 1e-9, "{n}: {middle:?}");
                let away = if drive.sleeve.has_flange() { 1.0 } else { -1.0 };
                let tilt = away * (high.outward - low.outward) / whole.band_mm;
                assert!(
                    (tilt - addition.tilt_rad_per_mm).abs() < 1e-6 + 1e-3 * tilt.abs(),
                    "{} {n}: {tilt}",
                    drive.name
                );
                let skew = away * (high.around - low.around) / whole.band_mm;
                assert!(
                    (skew - addition.skew_rad_per_mm).abs() < 1e-3,
                    "{} {n}: {skew} {}",
                    drive.name,
                    addition.skew_rad_per_mm
                );
            }
        }
    }
}
