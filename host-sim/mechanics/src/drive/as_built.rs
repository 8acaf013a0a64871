//! Deviations of a real drive from its drawing: errors of the size of micrometres, each zero in an ideal drive.
//!
//! Conventions, the same for all:
//!
//! * µm and degrees; angles count counter-clockwise **on the body of the part**: on the flexspline from tooth 0, on the
//!   circular spline from space 0 (so they turn with the output), on the generator from its major axis (so they turn
//!   with the generator), in the housing from where the major axis stands at generator angle zero.
//! * A harmonic is `amplitude cos(order (angle - phase))`: its phase is the angle of a crest.
//! * A position error counts counter-clockwise, as an arc at half the height of the teeth.
//! * Sizes hold at every temperature: 10 µm grow by 5 nm in 50 K.
//!
//! # How they enter the model
//!
//! All of them but one are exact offsets of the surfaces in contact, against meshes that stay nominal: teeth and spaces
//! are displaced and turned as rigid bodies ([`super::FlankDeviations`]), a worn flank lies deeper along its normal,
//! the outline of the generator is displaced and deformed ([`super::GeneratorOutline`]), the axis of the circular
//! spline is offset from that of the housing. The mesh then misses the change of stiffness by a change of shape,
//! and that is small: a tooth is 0.8 mm thick and gives way by 1 to 2 µm at rated load, so that 5 µm of shape are below
//! a hundredth of nearly nothing. Measured (cam, coarse mesh, `tests/as_built.rs`): 5 µm taken off every flank, once as
//! an offset and once in the mesh, leave the output 0.02″ apart at 2 N·m and 0.04″ apart at 100 N·m, where it stands at
//! 78″. Thickness of the rim is the exception: it bends with the cube, 10 µm of 1.2 mm is 2.5 %. It goes into the mesh,
//! sector by sector ([`RimVariation`]).
//!
//! An imperfect drive does not repeat from tooth to tooth any more. What still does, with period `2 pi / z_f` in the
//! generator angle: any generator (a constant shape), uniform wear, a difference in temperature.

use super::fields::{DEPTH, PHASE, section};
use super::sleeve::{Choice, choice};
use super::spec::Drive;
use crate::toml_file::{Problem, from};
use serde::{Serialize, Serializer};
use std::f64::consts::PI;

section! {
    /// Imperfections of a drive as built; all zero or empty is the ideal drive. Field names are the keys of
    /// `[as_built]`.
    #[derive(Default)]
    AsBuilt = as_built,
        "errors of the drive as it was made; 0 or [] is as drawn. A harmonic is amplitude cos(order (angle - phase))";
    /// How far the toothing of the circular spline is offset from the axis it turns about, µm.
    circular_spline_eccentricity_um: Real, from(0.0, 100.0), "toothing beside the axis it turns about, µm";
    /// Whereto, degrees on the circular spline.
    circular_spline_eccentricity_phase_deg: Real, PHASE,
        "whereto, degrees on the circular spline, positive counter-clockwise from space 0";
    /// The toothing of the circular spline is pressed to an oval: amplitude of its radius, µm. The ring keeps its
    /// length: a point moves by `a cos 2(angle - phase)` outward and `-a/2 sin 2(angle - phase)` along the ring, and
    /// the teeth turn by `3a/(2r) sin 2(angle - phase)`.
    circular_spline_ovality_um: Real, from(0.0, 100.0), "amplitude of the oval, length kept, µm";
    /// Angle of a crest of the oval, degrees on the circular spline.
    circular_spline_ovality_phase_deg: Real, PHASE,
        "angle of a crest, degrees on the circular spline, positive counter-clockwise from space 0";
    /// Cumulative pitch error of the circular spline by harmonic: position error of its spaces along the pitch.
    circular_spline_pitch_harmonics: Harmonics, from(0.0, 100.0),
        "cumulative pitch error, positive counter-clockwise, [{ order, amplitude_um, phase_deg of a crest }, ...]";
    /// Position error of each space of the circular spline, µm, space 0 first; none, or one for each. Adds to the
    /// harmonics.
    circular_spline_pitch_error_um: List, from(-100.0, 100.0),
        "position error of each space, or none, µm; positive counter-clockwise";
    /// How far the axis that the circular spline turns about is offset from the axis of the housing, about which the
    /// generator turns, µm: misalignment, or what a side load makes of the output bearing.
    circular_spline_offset_um: Real, from(0.0, 100.0), "its axis beside that of the housing, µm";
    /// Whereto, degrees in the housing.
    circular_spline_offset_direction_deg: Real, PHASE,
        "whereto, degrees in the housing, positive counter-clockwise from the major axis at generator angle 0";
    /// How far the toothing of the flexspline is offset from the axis of its bore, µm. This is its kinematic part; the
    /// wall that is then thicker on one side is order 1 of [`AsBuilt::rim_thickness_harmonics`], which has the same
    /// kinematic part and takes the place of this one.
    flexspline_runout_um: Real, from(0.0, 100.0), "toothing beside the axis of the bore, µm";
    /// Whereto, degrees on the flexspline.
    flexspline_runout_phase_deg: Real, PHASE,
        "whereto, degrees on the flexspline, positive counter-clockwise from tooth 0";
    /// Cumulative pitch error of the flexspline by harmonic: position error of its teeth along the pitch.
    flexspline_pitch_harmonics: Harmonics, from(0.0, 100.0),
        "cumulative pitch error, positive counter-clockwise, [{ order, amplitude_um, phase_deg of a crest }, ...]";
    /// Position error of each tooth of the flexspline, µm, tooth 0 first; none, or one for each. Adds to the harmonics.
    flexspline_pitch_error_um: List, from(-100.0, 100.0),
        "position error of each tooth, or none, µm; positive counter-clockwise";
    /// Thickness of the flexspline's rim by harmonic. The teeth are true, the bore is not: where the rim is thicker,
    /// the bore stands further in.
    rim_thickness_harmonics: Harmonics, from(0.0, 1000.0),
        "thickness of the rim, positive: thicker, [{ order, amplitude_um, phase_deg of a crest }, ...]";
    /// How far the generator is offset from the axis it turns about, µm.
    generator_eccentricity_um: Real, from(0.0, 100.0), "generator beside the axis it turns about, µm";
    /// Whereto, degrees on the generator.
    generator_eccentricity_phase_deg: Real, PHASE,
        "whereto, degrees on the generator, positive counter-clockwise from the major axis";
    /// How much higher the lobe of the generator at 0° stands than the one at 180°, µm: half of it is added to the one
    /// and taken from the other. The rollers or disc of a lobe are moved along the normal on which they were placed
    /// (for two rollers or discs an eccentricity of half the asymmetry along the major axis); a cam takes the form
    /// `a/2 cos 3 angle`, as order 1 would be an eccentricity.
    generator_lobe_asymmetry_um: Real, from(-100.0, 100.0),
        "lobe at 0 degrees less that at 180, µm; positive: the one at 0 is higher";
    /// Form error of the cam by harmonic, along its outward normal; other generators are circles and have none.
    cam_form_harmonics: Harmonics, from(0.0, 100.0),
        "form error of the cam, positive outward, [{ order, amplitude_um, phase_deg of a crest }, ...]";
    /// Depth worn off every flank of the flexspline, µm.
    flexspline_wear_um: Real, from(0.0, 200.0), "depth worn off every flank, µm";
    /// Depth worn off every flank of the circular spline, µm.
    circular_spline_wear_um: Real, from(0.0, 200.0), "depth worn off every flank, µm";
    /// Teeth that lack more than that.
    damaged_teeth: Damage, DEPTH, "[{ wheel, tooth, flank = \"plus\", \"minus\" or \"both\", depth_um }, ...]";
    /// How much warmer the generator is than the flexspline, K.
    generator_warmer_k: Real, from(-100.0, 100.0), "generator less flexspline, K; positive: the generator is warmer";
    /// How much warmer the circular spline, and what holds it, is than the flexspline, K. Its stiffness stays that of
    /// the drive's temperature: 30 K are 1 % of a part that gives a tenth of the compliance.
    circular_spline_warmer_k: Real, from(-100.0, 100.0),
        "circular spline and its seat less flexspline, K; positive: they are warmer";
}

/// One harmonic of an error around a part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Harmonic {
    /// Waves around the part.
    pub order: u32,
    /// Amplitude, µm.
    pub amplitude_um: f64,
    /// Angle of a crest, degrees on the part.
    pub phase_deg: f64,
}

impl Harmonic {
    /// Value at an angle of the part, µm.
    pub fn at(&self, angle_rad: f64) -> f64 {
        self.amplitude_um * (f64::from(self.order) * (angle_rad - self.phase_deg.to_radians())).cos()
    }
}

/// Sum of harmonics at an angle, µm.
pub(super) fn sum_at(harmonics: &[Harmonic], angle_rad: f64) -> f64 {
    harmonics.iter().map(|harmonic| harmonic.at(angle_rad)).sum()
}

choice! {
    /// A wheel of the drive.
    Wheel {
        /// The external one.
        Flexspline = "flexspline",
        /// The internal one.
        CircularSpline = "circular_spline",
    }
}

choice! {
    /// Flanks of a tooth.
    DamagedFlank {
        /// The one on the counter-clockwise side of the tooth.
        Plus = "plus",
        /// The one on its clockwise side.
        Minus = "minus",
        /// Both.
        Both = "both",
    }
}

/// A tooth that lacks material on its flanks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DamagedTooth {
    /// Of which wheel.
    pub wheel: Wheel,
    /// Which tooth, from 0. Tooth `k` of the circular spline stands on the counter-clockwise side of its space `k`.
    pub tooth: u32,
    /// On which of its flanks.
    pub flank: DamagedFlank,
    /// Depth missing along the normal, µm.
    pub depth_um: f64,
}

impl AsBuilt {
    /// True if nothing of it acts.
    #[cfg(test)]
    pub(crate) fn is_ideal(&self) -> bool {
        self.first_not_uniform().is_none()
            && self.flexspline_wear_um == 0.0
            && self.circular_spline_wear_um == 0.0
            && self.generator_warmer_k == 0.0
            && self.circular_spline_warmer_k == 0.0
    }

    /// The first field, as it stands in a file, that takes from the drive what tables of one tooth pitch and one
    /// direction are made by: that it repeats from tooth to tooth, and that it is its own mirror image. Uniform wear
    /// and a difference in temperature leave both.
    pub fn first_not_uniform(&self) -> Option<&'static str> {
        let acts = |harmonics: &[Harmonic]| harmonics.iter().any(|harmonic| harmonic.amplitude_um != 0.0);
        let any = |list: &[f64]| list.iter().any(|x| *x != 0.0);
        [
            (self.circular_spline_eccentricity_um != 0.0, "as_built.circular_spline_eccentricity_um"),
            (self.circular_spline_ovality_um != 0.0, "as_built.circular_spline_ovality_um"),
            (acts(&self.circular_spline_pitch_harmonics), "as_built.circular_spline_pitch_harmonics"),
            (any(&self.circular_spline_pitch_error_um), "as_built.circular_spline_pitch_error_um"),
            (self.circular_spline_offset_um != 0.0, "as_built.circular_spline_offset_um"),
            (self.flexspline_runout_um != 0.0, "as_built.flexspline_runout_um"),
            (acts(&self.flexspline_pitch_harmonics), "as_built.flexspline_pitch_harmonics"),
            (any(&self.flexspline_pitch_error_um), "as_built.flexspline_pitch_error_um"),
            (acts(&self.rim_thickness_harmonics), "as_built.rim_thickness_harmonics"),
            (self.generator_eccentricity_um != 0.0, "as_built.generator_eccentricity_um"),
            (self.generator_lobe_asymmetry_um != 0.0, "as_built.generator_lobe_asymmetry_um"),
            (acts(&self.cam_form_harmonics), "as_built.cam_form_harmonics"),
            (self.damaged_teeth.iter().any(|tooth| tooth.depth_um != 0.0), "as_built.damaged_teeth"),
        ]
        .into_iter()
        .find_map(|(acts, field)| acts.then_some(field))
    }

    /// The drive's errors without the fields that [`AsBuilt::first_not_uniform`] looks for.
    pub fn uniform_part(&self) -> AsBuilt {
        AsBuilt {
            flexspline_wear_um: self.flexspline_wear_um,
            circular_spline_wear_um: self.circular_spline_wear_um,
            generator_warmer_k: self.generator_warmer_k,
            circular_spline_warmer_k: self.circular_spline_warmer_k,
            ..AsBuilt::default()
        }
    }

    /// Reports values that do not fit the rest of the drive.
    pub(super) fn fit(&self, drive: &Drive, problems: &mut Vec<Problem>) {
        let (zf, zc) = (drive.flexspline.teeth, drive.circular_spline.teeth);
        for (key, list, teeth, of) in [
            ("flexspline_pitch_error_um", &self.flexspline_pitch_error_um, zf, "tooth of the flexspline"),
            (
                "circular_spline_pitch_error_um",
                &self.circular_spline_pitch_error_um,
                zc,
                "space of the circular spline",
            ),
        ] {
            if !list.is_empty() && list.len() != teeth as usize {
                let what = format!("found {} numbers, allowed: none, or {teeth}, one for each {of}", list.len());
                problems.push(Problem::of(&format!("as_built.{key}"), what));
            }
        }
        for (key, harmonics, most, why) in [
            ("flexspline_pitch_harmonics", &self.flexspline_pitch_harmonics, zf / 2, "two teeth to a wave"),
            ("circular_spline_pitch_harmonics", &self.circular_spline_pitch_harmonics, zc / 2, "two spaces to a wave"),
            ("rim_thickness_harmonics", &self.rim_thickness_harmonics, zf / 6, "six sectors of the mesh to a wave"),
            ("cam_form_harmonics", &self.cam_form_harmonics, zf / 6, "six teeth to a wave"),
        ] {
            for (k, harmonic) in harmonics.iter().enumerate().filter(|(_, harmonic)| harmonic.order > most) {
                let what = format!("found {}, allowed: 1 to {most} ({why})", harmonic.order);
                problems.push(Problem::of(&format!("as_built.{key}[{k}].order"), what));
            }
        }
        for (k, damaged) in self.damaged_teeth.iter().enumerate() {
            let teeth = if damaged.wheel == Wheel::Flexspline { zf } else { zc };
            if damaged.tooth >= teeth {
                let what = format!("found {}, allowed: 0 to {}", damaged.tooth, teeth - 1);
                problems.push(Problem::of(&format!("as_built.damaged_teeth[{k}].tooth"), what));
            }
        }
        let varies: f64 = self.rim_thickness_harmonics.iter().map(|harmonic| 1e-3 * harmonic.amplitude_um).sum();
        let most = 0.2 * drive.flexspline.rim_thickness_mm;
        if varies > most {
            let what = format!(
                "found {:.1} µm in all, allowed: up to {:.1} µm, a fifth of rim_thickness_mm",
                1e3 * varies,
                1e3 * most
            );
            problems.push(Problem::of("as_built.rim_thickness_harmonics", what));
        }
    }
}

/// How the thickness of the rim varies around the flexspline; positive is thicker, the bore further in.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RimVariation {
    harmonics: Vec<Harmonic>,
}

impl RimVariation {
    /// That of a drive.
    pub fn of(drive: &Drive) -> RimVariation {
        let acting = |harmonic: &&Harmonic| harmonic.amplitude_um != 0.0;
        RimVariation { harmonics: drive.as_built.rim_thickness_harmonics.iter().filter(acting).copied().collect() }
    }

    /// True for a rim of one thickness.
    pub(crate) fn is_none(&self) -> bool {
        self.harmonics.is_empty()
    }

    /// Thickness above the nominal one at an angle of the flexspline, mm.
    pub fn at(&self, angle_rad: f64) -> f64 {
        1e-3 * sum_at(&self.harmonics, angle_rad)
    }

    /// After how many of `sectors` equal sectors the rim repeats: 1 for a rim of one thickness.
    pub(crate) fn repeats_after(&self, sectors: usize) -> usize {
        let common = self.harmonics.iter().fold(sectors, |common, h| greatest_common_divisor(common, h.order as usize));
        if self.is_none() { 1 } else { sectors / common }
    }
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

/// Radial displacement, displacement along the ring and rotation of an inextensible ring of radius `radius` pressed to
/// an oval of amplitude `amplitude`, at the angle `from_crest` from a crest.
pub(super) fn oval(amplitude: f64, radius: f64, from_crest: f64) -> (f64, f64, f64) {
    let (sin, cos) = (2.0 * from_crest).sin_cos();
    (amplitude * cos, -0.5 * amplitude * sin, 1.5 * amplitude / radius * sin)
}

/// Unit vector at an angle in degrees.
pub(super) fn direction(angle_deg: f64) -> [f64; 2] {
    // the axes exactly: what lies on the major axis leaves the drive symmetric about it
    let quarters = angle_deg / 90.0;
    if quarters == quarters.round() {
        return [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][quarters.rem_euclid(4.0) as usize];
    }
    let (sin, cos) = (angle_deg * PI / 180.0).sin_cos();
    [cos, sin]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_rim_repeats_after_the_common_period_of_its_harmonics() {
        let with = |orders: &[u32]| {
            let harmonic = |&order: &u32| Harmonic { order, amplitude_um: 1.0, phase_deg: 7.0 };
            RimVariation { harmonics: orders.iter().map(harmonic).collect() }
        };
        for (orders, after) in
            [(&[][..], 1), (&[1], 188), (&[2], 94), (&[4], 47), (&[2, 4], 94), (&[4, 5], 188), (&[3], 188)]
        {
            let rim = with(orders);
            assert_eq!(rim.repeats_after(188), after, "{orders:?}");
            for k in 0..50 {
                let angle = 0.1234 * f64::from(k);
                let turned = angle + TAU * after as f64 / 188.0;
                assert!((rim.at(angle) - rim.at(turned)).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn an_oval_ring_keeps_its_length() {
        let (amplitude, radius, step) = (0.01, 49.0, 1e-5);
        for k in 0..20 {
            let angle = 0.31 * f64::from(k);
            let v = |angle| oval(amplitude, radius, angle).1;
            let w = |angle| oval(amplitude, radius, angle).0;
            let slope = |f: &dyn Fn(f64) -> f64| (f(angle + step) - f(angle - step)) / (2.0 * step);
            assert!((slope(&v) + w(angle)).abs() < 1e-11, "stretched at {angle}");
            let rotation = (v(angle) - slope(&w)) / radius;
            assert!((oval(amplitude, radius, angle).2 - rotation).abs() < 1e-12);
        }
    }

    #[test]
    fn directions_of_the_axes_are_exact() {
        assert_eq!(direction(0.0), [1.0, 0.0]);
        assert_eq!(direction(-90.0), [0.0, -1.0]);
        assert_eq!(direction(270.0), [0.0, -1.0]);
        assert_eq!(direction(360.0), [1.0, 0.0]);
        let [x, y] = direction(30.0);
        assert!((x - 0.75f64.sqrt()).abs() < 1e-15 && (y - 0.5).abs() < 1e-15);
    }

    #[test]
    fn only_what_is_the_same_everywhere_leaves_the_tables_of_one_pitch() {
        let mut as_built = AsBuilt { flexspline_wear_um: 3.0, generator_warmer_k: 5.0, ..AsBuilt::default() };
        assert!(!as_built.is_ideal() && as_built.first_not_uniform().is_none());
        as_built.cam_form_harmonics = vec![Harmonic { order: 4, amplitude_um: 0.0, phase_deg: 0.0 }];
        assert_eq!(as_built.first_not_uniform(), None);
        as_built.cam_form_harmonics[0].amplitude_um = 1.0;
        assert_eq!(as_built.first_not_uniform(), Some("as_built.cam_form_harmonics"));
        assert!(AsBuilt::default().is_ideal());
    }
}
