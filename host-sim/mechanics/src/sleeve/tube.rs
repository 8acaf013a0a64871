//! A tube, condensed on the edge where the rim begins.

use super::matrix::Symmetric;
use super::plate::Plate;
use super::shell::{NODE, SLOPE, Shell, U, V, W};

/// Stiffness of what hangs on an edge, in the edge's U, V, W and slope W' (N, mm; amplitudes of one harmonic).
pub(super) type Edge = [[f64; 4]; 4];

/// Support of the far end of a tube.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum End {
    /// Nothing.
    Free,
    /// U, V, W and the slope are zero.
    Clamped,
    /// V and W are zero: held in its plane, free along the axis.
    InPlane,
    /// A plate.
    Plate(Plate),
}

/// A tube with its far end; its own axis points from the rim to that end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tube {
    /// Its wall.
    pub shell: Shell,
    /// From the rim to the end, mm.
    pub length_mm: f64,
}

impl Tube {
    /// Stiffness of the near edge at harmonic n. Slopes and U count along the tube's own axis.
    pub(super) fn edge(&self, n: u32, end: End) -> Edge {
        self.edge_with(self.shell.elements(self.length_mm, n), n, end)
    }

    /// Stiffness of an edge of a tube of N elements: they are eliminated one after the other, from the far end
    /// on.
    pub(super) fn edge_with(&self, elements: usize, n: u32, end: End) -> Edge {
        let element = self.shell.element(self.length_mm / elements as f64, n);
        let mut held: Vec<usize> = match end {
            End::Clamped => vec![U, V, W, SLOPE],
            End::InPlane => vec![V, W],
            End::Free | End::Plate(_) => Vec::new(),
        };
        let mut beyond = Symmetric::zeros(NODE);
        if let End::Plate(plate) = end {
            beyond.add_at(&plate.rim(n), [U, V, W, SLOPE]);
        }
        for _ in 0..elements {
            let mut front = Symmetric::zeros(2 * NODE);
            front.add_at(&element, std::array::from_fn(|i| i));
            front.add_at(&beyond.array::<NODE>(), std::array::from_fn(|i| NODE + i));
            let near: Vec<usize> = (0..NODE).collect();
            let fixed: Vec<usize> = held.iter().map(|i| NODE + i).collect();
            beyond = front.condensed(&near, &fixed);
            held.clear();
        }
        // The wall of the rim is another: U' and V' of this one are its own.
        beyond.condensed(&[U, V, W, SLOPE], &[]).array()
    }
}

/// An edge seen along an axis that points the other way.
pub(super) fn mirrored(edge: Edge) -> Edge {
    let sign = |i: usize| if i == U || i == SLOPE { -1.0 } else { 1.0 };
    std::array::from_fn(|i| std::array::from_fn(|j| sign(i) * sign(j) * edge[i][j]))
}

#[cfg(test)]
mod tests {
    use super::super::shell::Ribs;
    use super::*;

    fn tube(radius_mm: f64, thickness_mm: f64, youngs_modulus_mpa: f64, length_mm: f64) -> Tube {
        let shell = Shell { radius_mm, thickness_mm, youngs_modulus_mpa, poissons_ratio: 0.3, ribs: Ribs::NONE };
        Tube { shell, length_mm }
    }

    /// Computed apart from this program, by Fourier shells of the same theory; there the clamp is at x = 0, here at the
    /// far end.
    #[test]
    fn a_clamped_tube_has_the_stiffness_found_elsewhere() {
        let wall = tube(47.275, 0.7, 206_000.0, 80.0);
        let at = |n: u32| mirrored(wall.edge(n, End::Clamped));
        let two = at(2);
        for (i, j, expected) in [
            (U, U, 485_817.7),
            (U, V, -112_283.9),
            (U, W, 8126.1),
            (U, SLOPE, -7444.3),
            (V, V, 225_277.6),
            (V, W, 79_317.0),
            (V, SLOPE, -170_214.1),
            (W, W, 42_244.0),
            (W, SLOPE, -93_130.1),
            (SLOPE, SLOPE, 421_805.6),
        ] {
            assert!((two[i][j] / expected - 1.0).abs() < 3e-4, "{i} {j}: {} {expected}", two[i][j]);
            assert!((two[i][j] - two[j][i]).abs() < 1e-6 * two[i][i].max(two[j][j]));
        }
        let four = at(4);
        for (i, expected) in [(U, 785_972.3), (V, 635_917.4), (W, 39_443.3), (SLOPE, 397_904.0)] {
            assert!((four[i][i] / expected - 1.0).abs() < 3e-4, "{i}: {} {expected}", four[i][i]);
        }
    }

    /// MacNeal and Harder (1985): a cylinder of radius 300 and length 600 between diaphragms, pinched in the middle,
    /// 1.8248e-5; by this theory, with harmonics to 120, 1.8240e-5.
    #[test]
    fn a_pinched_cylinder_gives_way_as_known() {
        let half = tube(300.0, 3.0, 3e6, 300.0);
        let mut displacement = 0.0;
        for n in (0..=120).step_by(2) {
            let edge = half.edge(n, End::InPlane);
            let mut middle = Symmetric::zeros(4);
            middle.add_at(&edge, [0, 1, 2, 3]);
            middle.add_at(&mirrored(edge), [0, 1, 2, 3]);
            // Both loads do work on each harmonic.
            displacement += 2.0 / middle.condensed(&[W], &[]).at(0, 0);
        }
        assert!((displacement / 1.8240e-5 - 1.0).abs() < 2e-4, "{displacement:e}");
    }

    #[test]
    fn more_elements_change_nothing() {
        for n in [0, 1, 2, 6, 12, 24] {
            let wall = tube(47.275, 0.7, 206_000.0, 80.0);
            let few = wall.shell.elements(80.0, n);
            let coarse = wall.edge_with(few, n, End::Clamped);
            let fine = wall.edge_with(2 * few, n, End::Clamped);
            for i in 0..4 {
                assert!(
                    (coarse[i][i] - fine[i][i]).abs() <= 3e-4 * fine[i][i],
                    "n {n}, {i}: {} {}",
                    coarse[i][i],
                    fine[i][i]
                );
            }
        }
    }

    /// Torsion of a clamped tube is `2 pi G R t / L` for its V, and the curvature of the wall adds `9/4 t²/12R²` of
    /// that.
    #[test]
    fn torsion_is_that_of_a_tube() {
        let wall = tube(47.275, 0.7, 206_000.0, 80.0);
        let shear = 206_000.0 / 2.6;
        let expected = 2.0 * std::f64::consts::PI * shear * 47.275 * 0.7 / 80.0;
        let found = wall.edge(0, End::Clamped)[V][V];
        let curved = 1.0 + 2.25 * 0.49 / (12.0 * 47.275 * 47.275);
        assert!((found / (expected * curved) - 1.0).abs() < 1e-9, "{found} {expected}");
    }

    #[test]
    fn a_free_tube_resists_no_rigid_motion() {
        let wall = tube(47.275, 0.7, 206_000.0, 80.0);
        let [still, moved] = [0, 1].map(|n| wall.edge(n, End::Free));
        assert!(still[U][U].abs() + still[V][V].abs() < 1e-6 * wall.edge(0, End::Clamped)[V][V]);
        // Moved across: W = 1, V = -1.
        let across = moved[W][W] - 2.0 * moved[W][V] + moved[V][V];
        assert!(across.abs() < 1e-6 * moved[W][W], "{across} of {}", moved[W][W]);
    }
}
