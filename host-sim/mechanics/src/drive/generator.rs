//! Outlines of the wave generators, as the bore of the flexspline meets them.
//!
//! The neutral curve of each generator at exactly constant length, moved inward along its normal by half the rim, is
//! the bore it is meant to make. The cam is that curve; the rollers and discs are circles placed against it. All are
//! evaluated analytically, never as facets. The outline is symmetric about both axes.
//!
//! As built ([`super::AsBuilt`]) it may stand beside the axis it turns about, one lobe may be higher than the other,
//! and a cam may have a form error `d(angle)` along its normal, the angle being that of the foot on the neutral curve.
//! The distance to such a cam is `distance - d(angle of the foot)`, which leaves out the square of the slope of `d`: 10
//! µm at order 8 have a slope of 2e-3.

use super::as_built::{Harmonic, direction};
use super::error::DriveError;
use super::interference::halved;
use super::neutral::NeutralCurve;
use super::ring::{GeneratorKind, RingShape};
use super::spec::Drive;
use crate::toml_file::Problem;
use pulp::{Arch, NullaryFnOnce};
use std::f64::consts::TAU;

/// A Newton step, rad, below which the next one is below round-off: convergence is quadratic, with a factor near one.
const LAST_STEP: f64 = 1e-8;
/// Turns, rad, whose sine and cosine are those of a short series, exact to round-off.
const SMALL: f64 = 5e-3;
/// Points whose feet are looked for together: a vector of the widest unit there is. *Guess*.
const LANES: usize = 8;

/// A wave generator in its own frame (major axis along +x).
#[derive(Debug, Clone)]
pub struct GeneratorOutline {
    neutral: NeutralCurve,
    /// inward offset from the neutral curve to the bore, mm
    offset: f64,
    /// thermal expansion against the size at reference temperature
    scale: f64,
    /// where the outline stands beside the axis it turns about, mm
    centre: [f64; 2],
    contour: Contour,
    arch: Arch,
}

#[derive(Debug, Clone)]
enum Contour {
    /// The offset neutral curve itself, and its form error.
    Cam { form: Vec<Harmonic> },
    /// Circles at `(x, ± y)` and, on the other lobe, at `(-x, ± y)`: two of them when `y` is zero.
    Circles { lobe: [f64; 2], other_lobe: [f64; 2], radius: f64 },
}

/// Form error of a cam at an angle, and its first and second derivative by it; mm.
fn form_error(form: &[Harmonic], angle: f64) -> [f64; 3] {
    form.iter().fold([0.0; 3], |sum, harmonic| {
        let order = f64::from(harmonic.order);
        let amplitude = 1e-3 * harmonic.amplitude_um;
        let (sin, cos) = (order * (angle - harmonic.phase_deg.to_radians())).sin_cos();
        [sum[0] + amplitude * cos, sum[1] - amplitude * order * sin, sum[2] - amplitude * order * order * cos]
    })
}

/// The closest point of the outline to some point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutlineFoot {
    /// Signed distance from outline to point, mm: positive outside (a gap), negative inside (interference).
    pub distance: f64,
    /// Unit outward normal of the outline at the foot: the gradient of the distance. That of a cam with a form error is
    /// longer by half the square of its slope, 1e-6.
    pub normal: [f64; 2],
    /// Curvature of the outline at the foot, 1/mm, positive where convex.
    pub curvature: f64,
}

impl GeneratorOutline {
    /// The generator of `kind` in `drive`: made to fit the flexspline at reference temperature, then expanded to the
    /// drive's temperature.
    pub fn new(drive: &Drive, kind: GeneratorKind) -> Result<Self, DriveError> {
        let cold = drive.thermal_state.flexspline_scale;
        let rim = drive.flexspline.rim_thickness_mm / cold;
        let radius = drive.flexspline.neutral_radius_mm() / cold;
        let generator = &drive.generator;
        let offset = 0.5 * rim;
        let neutral = NeutralCurve::new(generator.shape(kind), radius);
        let roller = 0.5 * generator.roller_diameter_mm;
        let circles = |centre: [f64; 2], radius| Contour::Circles { lobe: centre, other_lobe: centre, radius };
        let mut contour = match kind {
            GeneratorKind::Cam => Contour::Cam { form: Vec::new() },
            GeneratorKind::TwoRoller => circles([neutral.polar(0.0)[0] - offset - roller, 0.0], roller),
            GeneratorKind::FourRoller => {
                let ([x, y], normal) = neutral.position(generator.four_roller_angle_deg.to_radians());
                let inward = offset + roller;
                circles([x - inward * normal.cos(), y - inward * normal.sin()], roller)
            }
            GeneratorKind::DoubleDisc => {
                // A circle with its centre on the major axis, through the bore there, and as large as the bore lets it
                // be: it touches the bore again within a few degrees of the end of the arc.
                let vertex = neutral.polar(0.0)[0] - offset;
                let through = |phi: f64| {
                    let [x, y] = bore_point(&neutral, offset, phi);
                    let sagitta = vertex - x;
                    (y * y + sagitta * sagitta) / (2.0 * sagitta)
                };
                let g = generator.disc_half_angle_deg.to_radians();
                let radius = least(through, 0.8 * g, g + 10f64.to_radians());
                circles([vertex - radius, 0.0], radius)
            }
        };
        if let Contour::Circles { lobe: [x, y], radius, .. } = contour {
            let apart = if kind == GeneratorKind::FourRoller { x.min(y) } else { x };
            if kind.has_rollers() && apart <= radius {
                return Err(Problem::of(
                    "generator.roller_diameter_mm",
                    format!(
                        "{} mm is too large for the {kind} generator in a bore of radius {:.3} mm: the rollers would \
                         overlap; allowed: below {:.3} mm",
                        2.0 * radius,
                        neutral.radius_mm() - offset,
                        2.0 * apart
                    ),
                )
                .into());
            }
        }
        let built = &drive.as_built;
        let higher = 0.5 * built.generator_lobe_asymmetry_um;
        match &mut contour {
            Contour::Cam { form } => {
                form.extend(built.cam_form_harmonics.iter().filter(|harmonic| harmonic.amplitude_um != 0.0));
                if higher != 0.0 {
                    form.push(Harmonic { order: 3, amplitude_um: higher, phase_deg: 0.0 });
                }
            }
            Contour::Circles { lobe, other_lobe, .. } => {
                let normal = match kind {
                    GeneratorKind::FourRoller => neutral.position(generator.four_roller_angle_deg.to_radians()).1,
                    _ => 0.0,
                };
                let (sin, cos) = normal.sin_cos();
                *lobe = [lobe[0] + 1e-3 * higher * cos, lobe[1] + 1e-3 * higher * sin];
                *other_lobe = [other_lobe[0] - 1e-3 * higher * cos, other_lobe[1] - 1e-3 * higher * sin];
            }
        }
        let centre =
            direction(built.generator_eccentricity_phase_deg).map(|x| 1e-3 * built.generator_eccentricity_um * x);
        Ok(GeneratorOutline {
            neutral,
            offset,
            scale: drive.thermal_state.generator_scale,
            centre,
            contour,
            arch: Arch::new(),
        })
    }

    /// Where the outline stands beside the axis it turns about, in the generator frame, mm.
    pub(crate) fn centre(&self) -> [f64; 2] {
        self.centre.map(|x| x * self.scale)
    }

    /// The neutral curve the generator is made for, at reference temperature.
    pub fn neutral(&self) -> &NeutralCurve {
        &self.neutral
    }

    /// Circle centre in the first quadrant (or on the axis), from the centre of the outline, and the radius, mm; `None`
    /// for the cam.
    pub fn circle(&self) -> Option<([f64; 2], f64)> {
        match self.contour {
            Contour::Cam { .. } => None,
            Contour::Circles { lobe, radius, .. } => Some((lobe.map(|x| x * self.scale), radius * self.scale)),
        }
    }

    /// Closest point of the outline to `point`, in the generator frame.
    pub fn nearest(&self, point: [f64; 2]) -> OutlineFoot {
        let mut feet = Vec::new();
        self.nearest_each(&[point], &mut feet);
        feet[0]
    }

    /// Closest points of the outline to `points`, in the generator frame. For circles, the circle of the quadrant of a
    /// point, which is the closest one; for a cam, as many at once as a vector unit takes.
    pub(crate) fn nearest_each(&self, points: &[[f64; 2]], feet: &mut Vec<OutlineFoot>) {
        let (s, [cx, cy]) = (self.scale, self.centre);
        let within = |[x, y]: [f64; 2]| [x / s - cx, y / s - cy];
        feet.clear();
        match &self.contour {
            Contour::Circles { lobe, other_lobe, radius } => feet.extend(points.iter().map(|point| {
                let [px, py] = within(*point);
                let [x, y] = if px.is_sign_negative() { *other_lobe } else { *lobe };
                let dx = px - x.copysign(px);
                let dy = py - if y == 0.0 { 0.0 } else { y.copysign(py) };
                let length = (dx * dx + dy * dy).sqrt();
                let normal = if length > 0.0 { [dx / length, dy / length] } else { [1.0, 0.0] };
                OutlineFoot { distance: (length - radius) * s, normal, curvature: 1.0 / (radius * s) }
            })),
            Contour::Cam { form } => {
                for points in points.chunks(LANES) {
                    let at = std::array::from_fn(|k| within(points[k.min(points.len() - 1)]));
                    let found = self.arch.dispatch(FeetOnNeutral { neutral: &self.neutral, at: &at });
                    feet.extend(at.iter().zip(found).take(points.len()).map(|(at, found)| {
                        self.on_cam(form, *at, found.unwrap_or_else(|| self.foot_by_scan(*at).sin_cos()))
                    }));
                }
            }
        }
    }

    /// The foot of a point on a cam, that on the neutral curve being known.
    fn on_cam(&self, form: &[Harmonic], [px, py]: [f64; 2], (sin, cos): (f64, f64)) -> OutlineFoot {
        let s = self.scale;
        let [r, dr, ddr] = self.neutral.cam_at((sin, cos));
        let speed = (r * r + dr * dr).sqrt();
        let normal = [(r * cos + dr * sin) / speed, (r * sin - dr * cos) / speed];
        let from_neutral = (px - r * cos) * normal[0] + (py - r * sin) * normal[1];
        let bend = (r * r + 2.0 * dr * dr - r * ddr) / (speed * speed * speed);
        let foot = OutlineFoot {
            distance: (from_neutral + self.offset) * s,
            normal,
            curvature: bend / (1.0 - self.offset * bend) / s,
        };
        if form.is_empty() {
            return foot;
        }
        let [error, rate, bent] = form_error(form, sin.atan2(cos));
        // Arc per angle through the point, and along the outline.
        let (at_point, at_outline) = (speed * (1.0 + bend * from_neutral), speed * (1.0 - bend * self.offset));
        let slope = rate / at_point;
        let curvature = foot.curvature * s;
        OutlineFoot {
            distance: foot.distance - error * s,
            normal: [normal[0] + slope * normal[1], normal[1] - slope * normal[0]],
            curvature: (curvature - bent / (at_outline * at_outline) - curvature * curvature * error) / s,
        }
    }

    /// Closed polylines of `points` points each, for drawing.
    pub fn polyline(&self, points: usize) -> Vec<Vec<[f64; 2]>> {
        let turn = |k: usize| TAU * k as f64 / points as f64;
        let placed = |[x, y]: [f64; 2]| [(x + self.centre[0]) * self.scale, (y + self.centre[1]) * self.scale];
        match &self.contour {
            Contour::Cam { form } => {
                let bore = |k| {
                    let phi = turn(k);
                    let ([x, y], normal) = self.neutral.position(phi);
                    let out = form_error(form, self.neutral.polar_angle(phi))[0] - self.offset;
                    placed([x + out * normal.cos(), y + out * normal.sin()])
                };
                vec![(0..points).map(bore).collect()]
            }
            Contour::Circles { lobe: [x, y], other_lobe: [xo, yo], radius } => {
                let centres: Vec<[f64; 2]> = if *y == 0.0 {
                    vec![[*x, 0.0], [-xo, 0.0]]
                } else {
                    vec![[*x, *y], [-xo, *yo], [-xo, -yo], [*x, -y]]
                };
                let circle = |[x, y]: [f64; 2]| {
                    let on = |k| placed([x + radius * f64::cos(turn(k)), y + radius * f64::sin(turn(k))]);
                    (0..points).map(on).collect()
                };
                centres.into_iter().map(circle).collect()
            }
        }
    }

    /// Polar angle of the point of the neutral curve closest to a point, by a scan and bisection.
    fn foot_by_scan(&self, [px, py]: [f64; 2]) -> f64 {
        const SCAN: usize = 256;
        let squared = |alpha: f64| {
            let r = self.neutral.polar(alpha)[0];
            (px - r * alpha.cos()).powi(2) + (py - r * alpha.sin()).powi(2)
        };
        let at = |k: usize| TAU * k as f64 / SCAN as f64;
        let best = (0..SCAN).min_by(|&i, &j| squared(at(i)).total_cmp(&squared(at(j)))).unwrap_or(0);
        // (p - P)·P' falls through zero at the closest point
        let before = |alpha: f64| foot_residual(&self.neutral, [px, py], alpha.sin_cos()).0 > 0.0;
        let [low, high] = halved(at(best) - at(1), at(best) + at(1), before);
        0.5 * (low + high)
    }
}

/// `(p - P) · P'` on the neutral curve of a cam and its derivative by the polar angle, given by its sine and cosine.
#[inline(always)]
fn foot_residual(neutral: &NeutralCurve, [px, py]: [f64; 2], (sin, cos): (f64, f64)) -> (f64, f64) {
    let [r, dr, ddr] = neutral.cam_at((sin, cos));
    // along and across the radius direction
    let (a, b) = (px * cos + py * sin, py * cos - px * sin);
    let f = a * dr + b * r - r * dr;
    (f, a * (ddr - r) + 2.0 * b * dr - dr * dr - r * ddr)
}

/// Sine and cosine of the polar angle of the points of the neutral curve of a cam closest to some points: the cam is
/// parallel to it, so the foot on the cam has the same normal. Newton from the direction of the point, which at the
/// bore is off by 3e-4 rad; nothing where it strays (points near the centre). Without branches, so that it is compiled
/// for the vector unit.
struct FeetOnNeutral<'a> {
    neutral: &'a NeutralCurve,
    at: &'a [[f64; 2]; LANES],
}

impl NullaryFnOnce for FeetOnNeutral<'_> {
    type Output = [Option<(f64, f64)>; LANES];

    #[inline(always)]
    fn call(self) -> Self::Output {
        let (mut sin, mut cos) = ([0.0; LANES], [0.0; LANES]);
        for (k, [px, py]) in self.at.iter().enumerate() {
            let rho = (px * px + py * py).sqrt();
            (sin[k], cos[k]) = (py / rho, px / rho);
        }
        let (mut found, mut strayed) = ([false; LANES], [false; LANES]);
        for _ in 0..8 {
            for k in 0..LANES {
                let (f, df) = foot_residual(self.neutral, self.at[k], (sin[k], cos[k]));
                let step = f / df;
                let (s, c) = turned_by((sin[k], cos[k]), -step);
                (sin[k], cos[k]) = if found[k] { (sin[k], cos[k]) } else { (s, c) };
                strayed[k] |= !(found[k] || (df < 0.0 && step.abs() < SMALL));
                found[k] |= step.abs() < LAST_STEP;
            }
            if found.iter().all(|found| *found) {
                break;
            }
        }
        std::array::from_fn(|k| (found[k] && !strayed[k]).then_some((sin[k], cos[k])))
    }
}

impl super::spec::Generators {
    /// First-order shape of the neutral layer under the generator of `kind`.
    pub fn shape(&self, kind: GeneratorKind) -> RingShape {
        match kind {
            GeneratorKind::TwoRoller => RingShape::two_roller(self.w0_mm),
            GeneratorKind::FourRoller => RingShape::four_roller(self.w0_mm, self.four_roller_angle_deg.to_radians()),
            GeneratorKind::DoubleDisc => RingShape::double_disc(self.w0_mm, self.disc_half_angle_deg.to_radians()),
            GeneratorKind::Cam => RingShape::cam(self.w0_mm),
        }
    }
}

/// Sine and cosine of an angle turned by less than [`SMALL`], where the series are exact to round-off.
#[inline(always)]
fn turned_by((sin, cos): (f64, f64), by: f64) -> (f64, f64) {
    let square = by * by;
    let (s, c) = (by * (1.0 - square / 6.0 * (1.0 - square / 20.0)), 1.0 - 0.5 * square * (1.0 - square / 12.0));
    (sin * c + cos * s, cos * c - sin * s)
}

/// Point of the intended bore under the material point `phi` of the neutral curve.
fn bore_point(neutral: &NeutralCurve, offset: f64, phi: f64) -> [f64; 2] {
    let ([x, y], normal) = neutral.position(phi);
    [x - offset * normal.cos(), y - offset * normal.sin()]
}

/// Least value of a function with one valley between `low` and `high`, by golden section.
fn least(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let section = 0.5 * (5f64.sqrt() - 1.0);
    // 40 cuts narrow the interval 2e8-fold, which leaves the minimum itself at round-off
    for _ in 0..40 {
        let width = section * (high - low);
        if f(high - width) < f(low + width) {
            high = low + width;
        } else {
            low = high - width;
        }
    }
    f(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline(kind: GeneratorKind) -> GeneratorOutline {
        GeneratorOutline::new(&Drive::hhd_95(), kind).unwrap()
    }

    #[test]
    fn sizes_of_the_default_design() {
        let circle = |kind| outline(kind).circle().unwrap();
        let ([x, _], radius) = circle(GeneratorKind::TwoRoller);
        assert!((x - 34.170).abs() < 5e-4 && radius == 13.0, "two-roller at {x}");
        let ([x, y], _) = circle(GeneratorKind::FourRoller);
        assert!((x - 29.608).abs() < 5e-4 && (y - 16.633).abs() < 5e-4, "four-roller at {x}, {y}");
        // the reference figures 1.667 and 45.503, rounded, stand 0.64 µm proud at the vertex
        let ([x, _], radius) = circle(GeneratorKind::DoubleDisc);
        assert!((x - 1.667).abs() < 5e-4 && (x + radius - 47.1694).abs() < 5e-5, "disc {x} {radius}");
        let cam = outline(GeneratorKind::Cam);
        let major = cam.nearest([50.0, 0.0]).distance;
        let minor = cam.nearest([0.0, 50.0]).distance;
        assert!((50.0 - major - 47.1697).abs() < 5e-5 && (50.0 - minor - 46.1697).abs() < 5e-5, "{major} {minor}");
    }

    #[test]
    fn sizes_at_other_angles() {
        let circle = |kind, roller: f64, disc: f64| {
            let mut drive = Drive::hhd_95();
            drive.generator.four_roller_angle_deg = roller;
            drive.generator.disc_half_angle_deg = disc;
            GeneratorOutline::new(&drive, kind).unwrap().circle().unwrap()
        };
        for (angle, x, y) in [(25.0, 30.972, 14.055), (35.0, 28.038, 19.086)] {
            let ([found_x, found_y], _) = circle(GeneratorKind::FourRoller, angle, 30.0);
            assert!((found_x - x).abs() < 6e-4 && (found_y - y).abs() < 6e-4, "{angle}: {found_x} {found_y}");
        }
        for (angle, e, radius) in [(20.0, 1.837, 45.333), (40.0, 1.549, 45.620)] {
            let ([found_e, _], found_radius) = circle(GeneratorKind::DoubleDisc, 30.0, angle);
            assert!(
                (found_e - e).abs() < 2e-3 && (found_radius - radius).abs() < 2e-3,
                "{angle}: {found_e} {found_radius}"
            );
        }
    }

    #[test]
    fn discs_and_rollers_do_not_stand_proud_of_the_bore_they_are_made_for() {
        for kind in [GeneratorKind::TwoRoller, GeneratorKind::FourRoller, GeneratorKind::DoubleDisc] {
            for disc in [20.0, 30.0, 40.0] {
                let mut drive = Drive::hhd_95();
                drive.generator.disc_half_angle_deg = disc;
                let outline = GeneratorOutline::new(&drive, kind).unwrap();
                let gap = |k: u32| {
                    let phi = (0.01 * f64::from(k)).to_radians();
                    let bore = bore_point(&outline.neutral, outline.offset, phi);
                    outline.nearest(bore).distance
                };
                let least = (0..=9000).map(gap).fold(f64::INFINITY, f64::min);
                assert!(least.abs() < 1e-8, "{kind} {disc}: {least} mm");
                // 0.5 µm off over the whole arc that the disc should touch
                let arc = (0..=(100.0 * disc) as u32).map(gap).fold(0.0, f64::max);
                assert!(kind != GeneratorKind::DoubleDisc || arc < 5e-4, "{disc}: {arc} mm");
            }
        }
    }

    /// Random-looking points near the bore.
    fn points() -> impl Iterator<Item = [f64; 2]> {
        (0..4000).map(|k| {
            let angle = 2.399_963 * f64::from(k);
            let r = 46.0 + 1.5 * (0.618_034 * f64::from(k)).fract();
            [r * angle.cos(), r * angle.sin()]
        })
    }

    #[test]
    fn the_cam_foot_is_a_foot() {
        let cam = outline(GeneratorKind::Cam);
        for p in points() {
            let foot = cam.nearest(p);
            // the foot lies on the cam: its own distance is zero, and its normal the same
            let q = [p[0] - foot.distance * foot.normal[0], p[1] - foot.distance * foot.normal[1]];
            let again = cam.nearest(q);
            assert!(again.distance.abs() < 1e-13, "{p:?}: {}", again.distance);
            let turn = foot.normal[0] * again.normal[1] - foot.normal[1] * again.normal[0];
            assert!(turn.abs() < 1e-14, "{p:?}: {turn}");
        }
    }

    /// The normal is the gradient of the distance; returned is by what it turns along the outline.
    fn turns_as_its_gradient(outline: &GeneratorOutline, kind: GeneratorKind, p: [f64; 2], foot: &OutlineFoot) -> f64 {
        let step = 1e-5;
        let d = |dx, dy| outline.nearest([p[0] + dx, p[1] + dy]).distance;
        let gradient = [(d(step, 0.0) - d(-step, 0.0)) / (2.0 * step), (d(0.0, step) - d(0.0, -step)) / (2.0 * step)];
        let error = (gradient[0] - foot.normal[0]).hypot(gradient[1] - foot.normal[1]);
        assert!(error < 1e-8, "{kind} {p:?}: {error}");
        let q = [p[0] - foot.distance * foot.normal[0], p[1] - foot.distance * foot.normal[1]];
        let n = |s: f64| outline.nearest([q[0] - s * foot.normal[1], q[1] + s * foot.normal[0]]).normal;
        let (a, b) = (n(-step), n(step));
        (a[0] * b[1] - a[1] * b[0]) / (2.0 * step)
    }

    #[test]
    fn the_foot_is_the_closest_point_and_gradient_and_curvature_agree_with_differences() {
        for kind in GeneratorKind::ALL {
            let outline = outline(kind);
            let line: Vec<[f64; 2]> = outline.polyline(20_000).concat();
            // not on an axis, where the circles of two quadrants meet
            for p in points().skip(1).step_by(97) {
                let foot = outline.nearest(p);
                let closest = line.iter().map(|q| (p[0] - q[0]).hypot(p[1] - q[1])).fold(f64::INFINITY, f64::min);
                if kind != GeneratorKind::DoubleDisc {
                    // points of the drawing are 15 µm apart; one disc may hide part of the other,
                    // and the drawing still shows it
                    assert!(
                        closest >= foot.distance.abs() - 1e-9 && closest < foot.distance.hypot(0.01),
                        "{kind} {p:?}: {} {closest}",
                        foot.distance
                    );
                }
                let turn = turns_as_its_gradient(&outline, kind, p, &foot);
                assert!((turn - foot.curvature).abs() < 1e-6, "{kind} {p:?}: {turn} {}", foot.curvature);
            }
        }
    }

    fn malformed(kind: GeneratorKind) -> GeneratorOutline {
        let mut drive = Drive::hhd_95();
        let built = &mut drive.as_built;
        built.generator_eccentricity_um = 20.0;
        built.generator_eccentricity_phase_deg = 70.0;
        built.generator_lobe_asymmetry_um = 8.0;
        built.cam_form_harmonics = vec![
            Harmonic { order: 4, amplitude_um: 10.0, phase_deg: 10.0 },
            Harmonic { order: 7, amplitude_um: 3.0, phase_deg: -50.0 },
        ];
        GeneratorOutline::new(&drive, kind).unwrap()
    }

    #[test]
    fn gradient_and_curvature_of_a_malformed_generator_agree_with_differences() {
        for kind in GeneratorKind::ALL {
            let outline = malformed(kind);
            for p in points().skip(1).step_by(97) {
                let foot = outline.nearest(p);
                assert!((foot.normal[0].hypot(foot.normal[1]) - 1.0).abs() < 4e-6);
                let q = [p[0] - foot.distance * foot.normal[0], p[1] - foot.distance * foot.normal[1]];
                assert!(outline.nearest(q).distance.abs() < 2e-5 * foot.distance.abs().max(1e-3), "{kind} {p:?}");
                let turn = turns_as_its_gradient(&outline, kind, p, &foot);
                assert!((turn / foot.curvature - 1.0).abs() < 1e-3, "{kind} {p:?}: {turn} {}", foot.curvature);
            }
        }
    }

    #[test]
    fn the_drawing_of_a_malformed_generator_lies_on_its_outline() {
        for kind in GeneratorKind::ALL {
            let outline = malformed(kind);
            for p in outline.polyline(720).concat() {
                // a disc lies within the other one over part of its circle
                let distance = outline.nearest(p).distance;
                assert!(kind == GeneratorKind::DoubleDisc || distance.abs() < 1e-8, "{kind} {p:?}: {distance}");
            }
        }
    }

    #[test]
    fn form_errors_are_where_and_as_large_as_they_say() {
        let mut drive = Drive::hhd_95();
        let along = |outline: &GeneratorOutline, angle: f64| {
            let p = [46.7 * angle.cos(), 46.7 * angle.sin()];
            outline.nearest(p).distance
        };
        // Order 2 with its crest on the major axis is a higher cam.
        drive.as_built.cam_form_harmonics = vec![Harmonic { order: 2, amplitude_um: 5.0, phase_deg: 0.0 }];
        let higher = GeneratorOutline::new(&drive, GeneratorKind::Cam).unwrap();
        let ideal = outline(GeneratorKind::Cam);
        for (angle, error) in [(0.0, 5e-3), (TAU / 4.0, -5e-3), (TAU / 2.0, 5e-3)] {
            let found = along(&ideal, angle) - along(&higher, angle);
            assert!((found - error).abs() < 1e-12, "{angle}: {found}");
        }
        // One lobe is higher than the other by the asymmetry, whatever the generator.
        drive.as_built.cam_form_harmonics.clear();
        drive.as_built.generator_lobe_asymmetry_um = 6.0;
        for (kind, at) in [
            (GeneratorKind::Cam, 0.0),
            (GeneratorKind::TwoRoller, 0.0),
            (GeneratorKind::DoubleDisc, 0.0),
            (GeneratorKind::FourRoller, 29.33f64.to_radians()),
        ] {
            let uneven = GeneratorOutline::new(&drive, kind).unwrap();
            let change = |angle| 1e3 * (along(&outline(kind), angle) - along(&uneven, angle));
            let (one, other) = (change(at), change(TAU / 2.0 + at));
            assert!((one - 3.0).abs() < 0.01 && (other + 3.0).abs() < 0.01, "{kind}: {one} {other}");
        }
        // An eccentric generator stands further out on the side it is displaced to.
        let mut drive = Drive::hhd_95();
        drive.as_built.generator_eccentricity_um = 10.0;
        drive.as_built.generator_eccentricity_phase_deg = 90.0;
        let moved = GeneratorOutline::new(&drive, GeneratorKind::Cam).unwrap();
        let change = |angle| 1e3 * (along(&ideal, angle) - along(&moved, angle));
        assert!((change(TAU / 4.0) - 10.0).abs() < 1e-9 && (change(-TAU / 4.0) + 10.0).abs() < 1e-9);
    }

    #[test]
    fn points_near_the_centre_find_a_foot_too() {
        let cam = outline(GeneratorKind::Cam);
        for k in 0..100 {
            let angle = 0.0628 * f64::from(k) + 0.01;
            for r in [0.01, 0.5, 1.0, 2.0, 10.0, 40.0] {
                let p = [r * f64::cos(angle), r * f64::sin(angle)];
                let foot = cam.nearest(p);
                let q = [p[0] - foot.distance * foot.normal[0], p[1] - foot.distance * foot.normal[1]];
                assert!(cam.nearest(q).distance.abs() < 1e-9, "{p:?}");
                // inside, and no further than the minor axis allows
                assert!(foot.distance < 0.0 && foot.distance >= -46.17 - 1e-3, "{p:?}: {}", foot.distance);
            }
        }
    }
}
