//! What the paper says, as constants with the place they come from, and the arithmetic of its own numbers.
//!
//! Pacana, Siwiec, Pacana et al., *Numerical Analysis of the Kinematic Accuracy of the Hermetic Harmonic Drive in Space
//! Vehicles*, Appl. Sci. 13 (2023). Charts without numbers in the text are not read off.

use flexspline_base::units::ARCMIN_PER_RAD;
use flexspline_mechanics::drive::GeneratorKind;
use std::f64::consts::{FRAC_PI_2, PI};

/// Gear ratio `i`: section 4, first paragraph on the angle of rotation.
pub const RATIO: f64 = 95.0;
/// Travel of the generator to the first reversal, rad: section 3, last paragraph.
pub(crate) const TRAVEL_RAD: f64 = 1.0;
/// Largest error of the four-roller drive, rad: text of figure 13.
pub(crate) const ERROR_FOUR_ROLLER_RAD: f64 = 0.006_224_7;
/// Largest error of the four-roller drive as the paper converts it, arc-minutes.
pub(crate) const ERROR_FOUR_ROLLER_ARCMIN: f64 = 21.0;
/// Largest error of the double-disc drive, rad: below figure 13; not converted there.
pub(crate) const ERROR_DOUBLE_DISC_RAD: f64 = 0.004_134_4;
/// Largest error of the cam drive, rad: below figure 13.
pub(crate) const ERROR_CAM_RAD: f64 = 0.003;
/// Largest error of the cam drive as the paper converts it, arc-minutes ("about 4").
pub(crate) const ERROR_CAM_ARCMIN: f64 = 4.0;
/// Kinematic error that makers recommend, arc-minutes, least and most: below figure 13.
pub(crate) const RECOMMENDED_ARCMIN: [f64; 2] = [1.0, 9.0];
/// Load of the circular spline, N m ("about"): before figure 14.
pub const TORQUE_N_M: f64 = 200.0;
/// Thickness of the plane model, mm ("unit thickness"): section 3, on the plane model.
pub(crate) const MODEL_THICKNESS_MM: f64 = 1.0;
/// Face width of the toothed rim, mm: not given.
pub(crate) const FACE_WIDTH_MM: Option<f64> = None;
/// How the curves of figures 14 and 15 are labelled: no load (black), load with the motion (green), against it (red).
pub(crate) const LOAD_LABELS: [u32; 3] = [0, 2, 2];
/// Whether the load matters for the accuracy: section 4, above figure 16 ("significant impact"), and section 5 ("no
/// negative effect … regardless of its direction").
pub(crate) const LOAD_MATTERS: [bool; 2] = [true, false];
/// Backlash of the double-disc drive, arc-minutes: below figure 17.
pub(crate) const BACKLASH_DOUBLE_DISC_ARCMIN: f64 = 1.16;
/// Backlash of the cam drive, arc-minutes: below figure 17.
pub(crate) const BACKLASH_CAM_ARCMIN: f64 = 0.98;
/// Backlash that makers recommend for standard and for special drives, arc-minutes: below figure 17.
pub(crate) const BACKLASH_LIMITS_ARCMIN: [f64; 2] = [2.5, 1.5];
/// `φ` at the moment `t = 0` by formula (5).
pub(crate) const PHI_AT_START_BY_FORMULA: f64 = FRAC_PI_2;
/// `φ` at the "initial moment" by the text below figure 6.
pub(crate) const PHI_AT_START_BY_TEXT: f64 = 0.0;

/// The errors of figure 13 that the text gives a number for, rad.
pub fn error_rad(kind: GeneratorKind) -> Option<f64> {
    match kind {
        GeneratorKind::TwoRoller => None,
        GeneratorKind::FourRoller => Some(ERROR_FOUR_ROLLER_RAD),
        GeneratorKind::DoubleDisc => Some(ERROR_DOUBLE_DISC_RAD),
        GeneratorKind::Cam => Some(ERROR_CAM_RAD),
    }
}

/// The order of the errors that the paper gives: the larger rank has the larger error; two-roller is "similar" to
/// four-roller.
pub(crate) const ERROR_RANK: [(GeneratorKind, u32); 4] = [
    (GeneratorKind::FourRoller, 2),
    (GeneratorKind::TwoRoller, 2),
    (GeneratorKind::DoubleDisc, 1),
    (GeneratorKind::Cam, 0),
];

/// Travel of the output while the generator turns by [`TRAVEL_RAD`], arc-minutes.
pub(crate) fn output_travel_arcmin() -> f64 {
    TRAVEL_RAD / RATIO * ARCMIN_PER_RAD
}

/// An error of the paper as a share of what the output turns in all.
pub(crate) fn share_of_travel(error_rad: f64) -> f64 {
    error_rad * ARCMIN_PER_RAD / output_travel_arcmin()
}

/// Circular-spline teeth for which formula (6) puts a tooth that is on a tooth at the minor axis into a space at the
/// major axis: half a pitch `π/z` in a quarter turn of the generator.
pub fn circular_spline_teeth() -> f64 {
    PI / (FRAC_PI_2 / RATIO)
}

/// Tangential force per mm of width that the load is in a model of a given thickness, at a radius, N/mm.
pub(crate) fn line_load_n_per_mm(radius_mm: f64, width_mm: f64) -> f64 {
    1e3 * TORQUE_N_M / (radius_mm * width_mm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_numbers_in_arc_minutes() {
        assert!((ERROR_FOUR_ROLLER_RAD * ARCMIN_PER_RAD - 21.40).abs() < 0.005);
        assert!((ERROR_DOUBLE_DISC_RAD * ARCMIN_PER_RAD - 14.21).abs() < 0.005);
        // Not 4.
        assert!((ERROR_CAM_RAD * ARCMIN_PER_RAD - 10.31).abs() < 0.005);
        assert!((output_travel_arcmin() - 36.19).abs() < 0.005);
        assert!((share_of_travel(ERROR_FOUR_ROLLER_RAD) - 0.591).abs() < 5e-4);
        assert!((share_of_travel(ERROR_CAM_RAD) - 0.285).abs() < 5e-4);
    }

    #[test]
    fn formula_six_asks_for_190_teeth() {
        assert!((circular_spline_teeth() - 190.0).abs() < 1e-9);
    }

    #[test]
    fn the_load_in_a_model_of_unit_thickness() {
        assert!((line_load_n_per_mm(48.7, MODEL_THICKNESS_MM) - 4107.0).abs() < 1.0);
        assert!((line_load_n_per_mm(48.7, 20.0) - 205.3).abs() < 0.1);
    }
}
