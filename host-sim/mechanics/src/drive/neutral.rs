//! The deformed neutral curve at exactly constant length.
//!
//! The first-order shape `R + w(alpha)` is longer than `2 pi R` by second-order terms. The exact curve is
//! `r(alpha) = R + w(alpha) + c` with the constant `c` (about -5 µm for HHD-95) that restores the perimeter; a material
//! point at undeformed angle `phi` from the major axis lies at arc length `R phi` along it. Against a flank gap of 7 µm
//! neither correction can be left out.

use super::ring::RingShape;
use std::f64::consts::{FRAC_PI_2, PI};

/// Cells of the arc-length table in each smooth part of a quarter. The quintic interpolation error falls with the
/// sixth power of the cell; at 64 cells it is below round-off (tested against direct integration).
const CELLS: usize = 64;

/// An inextensible ring of radius `R` pushed into the shape of one wave generator, in the generator frame.
#[derive(Debug, Clone)]
pub struct NeutralCurve {
    shape: RingShape,
    radius_mm: f64,
    constant_mm: f64,
    parts: Vec<SmoothPart>,
}

/// Polar angle against material angle over one smooth part of `0..pi/2`, on equal cells of the material angle.
#[derive(Debug, Clone)]
struct SmoothPart {
    start: f64,
    cell: f64,
    /// polar angle, first and second derivative by the cell coordinate
    nodes: Vec<[f64; 3]>,
}

impl NeutralCurve {
    /// The curve of a ring with neutral radius `radius_mm` under `shape`.
    pub fn new(shape: RingShape, radius_mm: f64) -> Self {
        let mut curve = NeutralCurve { shape, radius_mm, constant_mm: 0.0, parts: Vec::new() };
        let breaks: Vec<f64> = match curve.shape.break_angle() {
            b if b > 0.0 => vec![0.0, b, FRAC_PI_2],
            _ => vec![0.0, FRAC_PI_2],
        };
        // Newton on the perimeter; its derivative by c is the mean cosine of the slope, close to one
        for _ in 0..6 {
            let quarter: f64 = breaks.windows(2).map(|ab| curve.length_between(ab[0], ab[1])).sum();
            curve.constant_mm += radius_mm - quarter / FRAC_PI_2;
        }
        let mut start = 0.0;
        for ab in breaks.windows(2) {
            let length = curve.length_between(ab[0], ab[1]) / radius_mm;
            let cell = length / CELLS as f64;
            let mut nodes = vec![curve.node(ab[0], cell)];
            for k in 1..=CELLS {
                let from = nodes[k - 1][0];
                let mut alpha = from + nodes[k - 1][1];
                for _ in 0..5 {
                    let miss = curve.gauss(from, alpha) - cell * radius_mm;
                    alpha -= miss / curve.speed(alpha);
                }
                nodes.push(curve.node(if k == CELLS { ab[1] } else { alpha }, cell));
            }
            curve.parts.push(SmoothPart { start, cell, nodes });
            start += length;
        }
        curve
    }

    /// Radius `R` of the undeformed neutral layer, mm.
    pub fn radius_mm(&self) -> f64 {
        self.radius_mm
    }

    /// The second-order constant `c`, mm.
    pub fn constant_mm(&self) -> f64 {
        self.constant_mm
    }

    /// `[r, r', r'']` of the exact curve at polar angle `alpha`.
    pub fn polar(&self, alpha: f64) -> [f64; 3] {
        let [w, dw, ddw] = self.shape.radial(alpha);
        [self.radius_mm + self.constant_mm + w, dw, ddw]
    }

    /// [`NeutralCurve::polar`] of a cam at the angle of this sine and cosine.
    #[inline(always)]
    pub(crate) fn cam_at(&self, direction: (f64, f64)) -> [f64; 3] {
        let [w, dw, ddw] = self.shape.cam_at(direction);
        [self.radius_mm + self.constant_mm + w, dw, ddw]
    }

    /// Polar angle of the material point at undeformed angle `phi`.
    pub(crate) fn polar_angle(&self, phi: f64) -> f64 {
        let turns = (phi / PI).round();
        let p = phi - PI * turns;
        let q = p.abs().min(FRAC_PI_2);
        let part = self.parts.iter().rev().find(|part| q >= part.start).unwrap_or(&self.parts[0]);
        let position = (q - part.start) / part.cell;
        let k = (position as usize).min(part.nodes.len() - 2);
        let alpha = quintic(part.nodes[k], part.nodes[k + 1], position - k as f64);
        alpha.copysign(p) + PI * turns
    }

    /// Place of the material point at undeformed angle `phi`, and the direction angle of the outward normal there;
    /// exact arc length, any real `phi`. The rotation of the material is `normal_angle - phi`.
    pub fn position(&self, phi: f64) -> ([f64; 2], f64) {
        let alpha = self.polar_angle(phi);
        let [r, dr, _] = self.polar(alpha);
        ([r * alpha.cos(), r * alpha.sin()], alpha - dr.atan2(r))
    }

    fn speed(&self, alpha: f64) -> f64 {
        let [r, dr, _] = self.polar(alpha);
        r.hypot(dr)
    }

    fn node(&self, alpha: f64, cell: f64) -> [f64; 3] {
        let [r, dr, ddr] = self.polar(alpha);
        let speed = r.hypot(dr);
        let first = cell * self.radius_mm / speed;
        let second = -first * first * dr * (r + ddr) / (speed * speed);
        [alpha, first, second]
    }

    /// Arc length between two polar angles inside one smooth part.
    fn length_between(&self, from: f64, to: f64) -> f64 {
        let step = (to - from) / CELLS as f64;
        (0..CELLS).map(|k| self.gauss(from + step * k as f64, from + step * (k + 1) as f64)).sum()
    }

    /// Five-point Gauss integral of the speed over a short interval.
    fn gauss(&self, from: f64, to: f64) -> f64 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let root = 2.0 * (10.0_f64 / 7.0).sqrt();
        let (x1, x2) = ((5.0 - root).sqrt() / 3.0, (5.0 + root).sqrt() / 3.0);
        let (w1, w2) = ((322.0 + 13.0 * 70.0_f64.sqrt()) / 900.0, (322.0 - 13.0 * 70.0_f64.sqrt()) / 900.0);
        let pair = |x: f64| self.speed(middle - half * x) + self.speed(middle + half * x);
        half * (self.speed(middle) * 128.0 / 225.0 + w1 * pair(x1) + w2 * pair(x2))
    }
}

/// Quintic Hermite interpolation between nodes of value, first and second derivative, at `t` in 0..1.
fn quintic(a: [f64; 3], b: [f64; 3], t: f64) -> f64 {
    let rise = b[0] - a[0] - a[1] - 0.5 * a[2];
    let slope = b[1] - a[1] - a[2];
    let bend = b[2] - a[2];
    let c3 = 10.0 * rise - 4.0 * slope + 0.5 * bend;
    let c4 = -15.0 * rise + 7.0 * slope - bend;
    let c5 = 6.0 * rise - 3.0 * slope + 0.5 * bend;
    a[0] + t * (a[1] + t * (0.5 * a[2] + t * (c3 + t * (c4 + t * c5))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Drive, GeneratorKind};

    fn curves() -> Vec<NeutralCurve> {
        let drive = Drive::hhd_95();
        let radius = drive.flexspline.neutral_radius_mm();
        GeneratorKind::ALL.map(|kind| NeutralCurve::new(drive.generator.shape(kind), radius)).into()
    }

    /// Perimeter by a fine polygon, corrected by Richardson extrapolation: shares nothing with the Gauss rule.
    fn perimeter(curve: &NeutralCurve) -> f64 {
        let polygon = |n: usize| -> f64 {
            let at = |k: usize| {
                let alpha = 2.0 * PI * k as f64 / n as f64;
                let r = curve.polar(alpha)[0];
                [r * alpha.cos(), r * alpha.sin()]
            };
            (0..n).map(|k| (at(k + 1)[0] - at(k)[0]).hypot(at(k + 1)[1] - at(k)[1])).sum()
        };
        // 30 degrees, where the shapes change, is a corner of both polygons
        let (coarse, fine) = (polygon(3600), polygon(7200));
        fine + (fine - coarse) / 3.0
    }

    #[test]
    fn the_perimeter_is_that_of_the_undeformed_ring() {
        for curve in curves() {
            let error = perimeter(&curve) - 2.0 * PI * curve.radius_mm();
            assert!(error.abs() < 1e-9, "{:?}: {error} mm", curve.shape);
        }
    }

    #[test]
    fn second_order_constants() {
        // -4.8 µm (two-roller) .. -6.8 µm (four-roller at 35 degrees); the cam's is -w0²/R to leading order
        let c = |shape| 1e3 * NeutralCurve::new(shape, 47.275).constant_mm();
        let cam = c(RingShape::cam(0.5));
        assert!((cam + 5.29).abs() < 0.01, "cam {cam} µm");
        let two = c(RingShape::two_roller(0.5));
        assert!((two + 4.8).abs() < 0.05, "two-roller {two} µm");
        let four = c(RingShape::four_roller(0.5, 35f64.to_radians()));
        assert!((four + 6.8).abs() < 0.05, "four-roller {four} µm");
    }

    #[test]
    fn material_points_lie_at_equal_arc_lengths() {
        for curve in curves() {
            let mut worst = 0.0_f64;
            for k in 1..1000 {
                let phi = FRAC_PI_2 * f64::from(k) / 1000.0;
                let alpha = curve.polar_angle(phi);
                let b = curve.shape.break_angle();
                let length = if alpha > b {
                    curve.length_between(0.0, b) + curve.length_between(b, alpha)
                } else {
                    curve.length_between(0.0, alpha)
                };
                worst = worst.max((length - phi * curve.radius_mm()).abs());
            }
            assert!(worst < 1e-12, "{:?}: {worst} mm", curve.shape);
        }
    }

    #[test]
    fn position_is_periodic_and_mirrored_and_near_the_first_order() {
        for curve in curves() {
            for k in 0..50 {
                let phi = 0.03 * f64::from(k);
                let ([x, y], normal) = curve.position(phi);
                let ([xm, ym], mirrored) = curve.position(-phi);
                assert!((x - xm).abs() + (y + ym).abs() + (normal + mirrored).abs() < 1e-13);
                let ([xp, yp], turned) = curve.position(phi + 3.0 * PI);
                assert!((x + xp).abs() + (y + yp).abs() + (turned - normal - 3.0 * PI).abs() < 1e-12);
                // w0²/R is 5 µm; positions and rotation differ by a few of those
                let alpha = y.atan2(x);
                assert!((alpha * curve.radius_mm() - phi * curve.radius_mm() - curve.shape.v(phi)).abs() < 0.012);
                let theta = curve.shape.theta(phi, curve.radius_mm);
                assert!((normal - phi - theta).abs() < 6e-4, "{} {theta}", normal - phi);
            }
        }
    }

    #[test]
    fn the_normal_is_square_to_the_curve() {
        for curve in curves() {
            for k in 0..60 {
                let (phi, step) = (0.1 * f64::from(k) + 0.013, 1e-5);
                let (a, _) = curve.position(phi - step);
                let (b, _) = curve.position(phi + step);
                let (_, normal) = curve.position(phi);
                let along = (b[0] - a[0]) * normal.cos() + (b[1] - a[1]) * normal.sin();
                assert!(along.abs() < 1e-9 && (b[0] - a[0]).hypot(b[1] - a[1]) > 9e-4);
            }
        }
    }
}
