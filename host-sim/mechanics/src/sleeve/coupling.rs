//! Contribution of the third dimension to a plane slice of the rim.
//!
//! A slice in plane strain has the ring of the rim already, over all its width. The rest is the stiffness of the whole
//! flexspline less that of the same rim moved alike over all its width: a 2 x 2 matrix K in the amplitudes of
//! `w = W cos n theta` and `v = V sin n theta`, for a generator that holds W on its band and loads around the rim that
//! are spread evenly.
//!
//! One direction of it is the oval without stretching, `e = (1, -1/n)`. The other stretches the rim around, which the
//! slice resists a thousand times as much itself, and which it does by itself, to second order, when it turns by finite
//! angles; a linear shell would take that for a load. So the rest acts as the one term `½ k a²` that is exact along e,
//! forces included: `k = e·K e`, `a = (K e / k)·(W, V)`. With the ring of the slice it gives the whole flexspline's K
//! under a radial load to 0.2 % (a test).

use std::f64::consts::PI;

use super::matrix::Symmetric;
use super::model::Flexspline3d;

/// Stiffness that one harmonic of the rim has in addition to the plane slice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Addition {
    /// Waves around the rim.
    pub n: u32,
    /// k, N/mm for the full circle: force on the amplitude a, over a.
    pub stiffness_n_per_mm: f64,
    /// Part of W in a.
    pub radial: f64,
    /// Part of V in a; W and V are those of the middle surface of the rim.
    pub around: f64,
    /// Tilt of the rim along the axis for a = 1 mm, rad/mm; positive: it grows away from what holds the flexspline.
    pub tilt_rad_per_mm: f64,
    /// Slope of V along the axis for a = 1 mm, rad/mm, in the same direction: how far the teeth are turned askew.
    pub skew_rad_per_mm: f64,
}

impl Flexspline3d {
    /// Addition of harmonic n (2 or more) to the plane slice.
    pub(crate) fn addition(&self, n: u32) -> Addition {
        let whole = self.at(n).band_and_turn();
        let oval = [1.0, -1.0 / f64::from(n)];
        let force = self.rest(n, &whole).map(|row| row[0] * oval[0] + row[1] * oval[1]);
        let stiffness = force[0] * oval[0] + force[1] * oval[1];
        // Tilt and slope follow W and V freely.
        let slope = |k: usize| {
            let free = whole.condensed(&[0, k, 2], &[]);
            -(free.at(1, 0) * oval[0] + free.at(1, 2) * oval[1]) / free.at(1, 1)
        };
        Addition {
            n,
            stiffness_n_per_mm: stiffness,
            radial: force[0] / stiffness,
            around: force[1] / stiffness,
            tilt_rad_per_mm: self.away() * slope(1),
            skew_rad_per_mm: self.away() * slope(3),
        }
    }

    /// The whole, in W, tilt and V of its band, less the plane slice, in W and V.
    fn rest(&self, n: u32, whole: &Symmetric) -> [[f64; 2]; 2] {
        let free = whole.condensed(&[0, 2], &[]);
        let slice = self.slice(n);
        std::array::from_fn(|i| std::array::from_fn(|j| free.at(i, j) - slice[i][j]))
    }

    /// The rim in plane strain, in W and V: membrane `(n V + W)/R` and bending `(n² W + n V)/R²` alone.
    fn slice(&self, n: u32) -> [[f64; 2]; 2] {
        let (r, n) = (self.rim.radius_mm, f64::from(n));
        let strain = [1.0 / r, n / r];
        let curvature = [n * n / (r * r), n / (r * r)];
        let area = PI * r * self.width_mm;
        let (c, d) = (self.rim.membrane(), self.rim.bending() * self.rim.ribs.bending_around);
        std::array::from_fn(|i| {
            std::array::from_fn(|j| area * (c * strain[i] * strain[j] + d * curvature[i] * curvature[j]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;

    /// Stiffness of W, V moving freely.
    fn radial(k: [[f64; 2]; 2]) -> f64 {
        k[0][0] - k[0][1] * k[1][0] / k[1][1]
    }

    /// Slice and addition together are the whole flexspline, for a load on the band.
    #[test]
    fn the_slice_with_its_addition_is_the_whole() {
        let hermetic = "sleeve.kind=hermetic,sleeve.flange_side_mm=80,sleeve.bottom_side_mm=80,sleeve.wall_mm=0.7";
        let long = Drive::hhd_95().with_set("sleeve.kind=hermetic").unwrap();
        let short = Drive::hhd_95().with_set(hermetic).unwrap();
        for drive in [long, short, Drive::cup_95()] {
            let whole = Flexspline3d::of(&drive, true).unwrap();
            for n in [2, 3, 4, 6, 9, 12] {
                let Addition { stiffness_n_per_mm, radial: w, around: v, .. } = whole.addition(n);
                let slice = whole.slice(n);
                let part = [w, v];
                let both = std::array::from_fn(|i| {
                    std::array::from_fn(|j| slice[i][j] + stiffness_n_per_mm * part[i] * part[j])
                });
                let (found, expected) = (radial(both), whole.harmonic(n).k_band_n_per_mm);
                assert!((found / expected - 1.0).abs() < 2e-3, "n {n}: {found} {expected}");
                assert!((w - v / f64::from(n) - 1.0).abs() < 1e-12, "a is W of an oval");
                assert!(stiffness_n_per_mm > 0.0);
            }
        }
    }

    /// A cup cones without stretching: `W = w0 x/L`, and V follows W as in any oval, `V = -W/n`; so do their slopes.
    /// The rim is stiff enough for n = 2 to take the shape of the tube.
    #[test]
    fn the_teeth_of_a_cup_are_skewed_as_its_cone_is() {
        let cup = Flexspline3d::of(&Drive::cup_95(), true).unwrap().addition(2);
        let ratio = cup.skew_rad_per_mm / cup.tilt_rad_per_mm;
        assert!((ratio + 0.5).abs() < 0.01 && cup.tilt_rad_per_mm > 0.0, "{ratio}");
        // Two equal sides: neither tilt nor skew.
        let mut both = Flexspline3d::of(&Drive::hhd_95().with_set("sleeve.kind=hermetic").unwrap(), true).unwrap();
        both.bottom = both.flange;
        let both = both.addition(2);
        assert!(both.tilt_rad_per_mm.abs() + both.skew_rad_per_mm.abs() < 1e-9, "{both:?}");
    }

    /// An oval generator that holds W tilts the rim as the band under it does.
    #[test]
    fn the_tilt_is_that_of_the_band() {
        let whole = Flexspline3d::of(&Drive::cup_95(), true).unwrap();
        let (found, expected) = (whole.addition(2).tilt_rad_per_mm, whole.harmonic(2).tilt_rad_per_mm);
        assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    }
}
