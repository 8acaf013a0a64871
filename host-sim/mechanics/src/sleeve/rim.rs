//! The toothed rim as a band of shell, with whatever hangs on its two edges.

use super::matrix::Symmetric;
use super::shell::{NODE, SLOPE, Shell, U, V, W};
use super::tube::{Edge, mirrored};

/// Lines on which a generator presses on the band under it. Lines closer together than about two walls only sharpen the
/// pressure at the edges of the band, which no theory of shells resolves: 11 in place of 5 add 0.3 % to the stiffness.
pub(super) const LINES: usize = 5;
/// The line in the middle of the rim.
const MIDDLE: usize = LINES / 2;

/// One harmonic of the rim and all that hangs on it. The axis points from the flange to the bottom.
pub(super) struct Rim {
    matrix: Symmetric,
    /// First unknown of the node under each line.
    lines: [usize; LINES],
    /// Where these are along the axis, mm from the middle.
    places: [f64; LINES],
}

impl Rim {
    /// A rim of this width whose generator presses on a band of another, with what hangs on its edges: that on the
    /// flange's side and that on the bottom's, either seen along an axis that leads away from the rim.
    pub fn new(wall: &Shell, width_mm: f64, band_mm: f64, n: u32, sides: [Option<Edge>; 2]) -> Rim {
        let band = band_mm.min(width_mm);
        let places: [f64; LINES] = std::array::from_fn(|k| band * (k as f64 / (LINES - 1) as f64 - 0.5));
        let ends = [-0.5 * width_mm, 0.5 * width_mm];
        let mut stops = vec![ends[0]];
        stops.extend(places);
        stops.push(ends[1]);
        let (mut elements, mut lines, mut node) = (Vec::new(), Vec::new(), 0);
        for pair in stops.windows(2) {
            let length = pair[1] - pair[0];
            if length > 1e-9 * width_mm {
                let count = wall.elements(length, n);
                elements.extend(std::iter::repeat_n(length / count as f64, count));
                node += count;
            }
            lines.push(node * NODE);
        }
        let mut matrix = Symmetric::zeros((elements.len() + 1) * NODE);
        let mut last = (0.0, wall.element(1.0, n));
        for (k, length) in elements.iter().enumerate() {
            if last.0 != *length {
                last = (*length, wall.element(*length, n));
            }
            matrix.add_at(&last.1, std::array::from_fn(|i| k * NODE + i));
        }
        let far = elements.len() * NODE;
        let [flange, bottom] = sides;
        for (side, first) in [(flange.map(mirrored), 0), (bottom, far)] {
            if let Some(edge) = side {
                matrix.add_at(&edge, [U, V, W, SLOPE].map(|i| first + i));
            }
        }
        Rim { matrix, lines: std::array::from_fn(|k| lines[k]), places }
    }

    /// Stiffness of the middle line in some of U, V, W and slope, all others moving freely.
    pub fn middle(&self, unknowns: &[usize]) -> Symmetric {
        let keep: Vec<usize> = unknowns.iter().map(|i| self.lines[MIDDLE] + i).collect();
        self.matrix.condensed(&keep, &[])
    }

    /// Stiffness of a band that moves outward by W at its middle and tilts by an angle, in these two.
    pub(crate) fn band(&self) -> Symmetric {
        let keep: Vec<usize> = self.lines.iter().map(|first| first + W).collect();
        self.matrix.condensed(&keep, &[]).in_basis(&[vec![1.0; LINES], self.places.to_vec()])
    }

    /// Stiffness of the band in its W, tilt, mean V, and slope of V along the axis: loads around the rim are spread
    /// evenly over the lines.
    pub(crate) fn band_and_turn(&self) -> Symmetric {
        let of = |k: usize| self.lines.iter().map(move |first| first + k);
        let keep: Vec<usize> = of(W).chain(of(V)).collect();
        let none = vec![0.0; LINES];
        let mut basis = vec![[vec![1.0; LINES], none.clone()].concat(), [self.places.to_vec(), none.clone()].concat()];
        basis.push([none.clone(), vec![1.0; LINES]].concat());
        basis.push([none.clone(), self.places.to_vec()].concat());
        // V of the single lines beside mean and slope: second differences have neither, the lines being equally far
        // apart.
        for k in 0..LINES - 2 {
            let mut apart = vec![0.0; 2 * LINES];
            for (at, weight) in [1.0, -2.0, 1.0].into_iter().enumerate() {
                apart[LINES + k + at] = weight;
            }
            basis.push(apart);
        }
        self.matrix.condensed(&keep, &[]).in_basis(&basis).condensed(&[0, 1, 2, 3], &[])
    }
}
