//! Properties of a drive that the reader needs.

/// Ratio, tooth pitch and largest plausible torque of a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gear {
    /// Turns of the generator for one of the output, negative if the output turns against it.
    pub ratio: f64,
    /// Pitch of the teeth by which the output skips when the drive ratchets, rad at the output: 2π over the teeth of
    /// the wheel that turns. `None` for a gear without known teeth.
    pub tooth_pitch_rad: Option<f64>,
    /// Ratio with the other wheel fixed; `None` for a gear without known teeth.
    pub other_wheel_ratio: Option<f64>,
    /// Torques beyond this, N·m, are in another unit, unless the mapping says theirs.
    pub plausible_torque_n_m: f64,
}

impl Gear {
    /// Torque beyond which a unit is wrong where no drive says more, N·m: drives of common sizes do not take it even
    /// for a moment. *Guess*.
    pub(crate) const LARGEST_TORQUE_N_M: f64 = 10_000.0;

    /// A gear of which the ratio is known.
    pub fn of_ratio(ratio: f64) -> Gear {
        Gear { ratio, tooth_pitch_rad: None, other_wheel_ratio: None, plausible_torque_n_m: Gear::LARGEST_TORQUE_N_M }
    }

    /// A strain wave gear by its teeth; the flexspline is fixed, or the circular spline.
    pub fn of_teeth(flexspline: u32, circular_spline: u32, flexspline_fixed: bool) -> Gear {
        let (f, c) = (f64::from(flexspline), f64::from(circular_spline));
        let (on_ring, on_flexspline) = ((c / (c - f), c), (-f / (c - f), f));
        let ((ratio, turning), (other, _)) =
            if flexspline_fixed { (on_ring, on_flexspline) } else { (on_flexspline, on_ring) };
        Gear {
            tooth_pitch_rad: Some(std::f64::consts::TAU / turning),
            other_wheel_ratio: Some(other),
            ..Gear::of_ratio(ratio)
        }
    }
}
