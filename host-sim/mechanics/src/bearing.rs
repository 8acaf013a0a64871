//! The rolling bearing of a wave generator by a closed form: how far its balls give way under load.
//!
//! The approach of a ball between two races of usual osculation, both contacts together, is `4.37e-4 (Q²/d)^(1/3)` mm
//! (Palmgren, *Ball and Roller Bearing Engineering*, 1959).

/// Balls of one size around a generator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Balls {
    /// How many.
    pub count: u32,
    /// Diameter, mm.
    pub diameter_mm: f64,
}

impl Balls {
    /// Those that `HHD-95-typical` takes for its bore of 93.35 mm, in proportion: 23 balls, 0.076 bores in diameter. A
    /// guess: makers publish neither.
    pub fn in_proportion(bore_mm: f64) -> Balls {
        Balls { count: 23, diameter_mm: 7.1 / 93.35 * bore_mm }
    }

    /// Approach of both races under a ball that carries `load_n`, mm.
    pub(crate) fn approach_mm(&self, load_n: f64) -> f64 {
        4.37e-4 * (load_n * load_n / self.diameter_mm).cbrt()
    }

    /// Change of load over change of approach, N/mm; balls stiffen as they are loaded.
    pub(crate) fn stiffness_n_per_mm(&self, load_n: f64) -> f64 {
        1.5 * load_n / self.approach_mm(load_n)
    }

    /// That of all balls over a bore of this diameter and width: pressure per approach, N/mm³, as
    /// `generator.bearing_stiffness_n_per_mm3`.
    pub fn bedding_n_per_mm3(&self, load_n: f64, bore_mm: f64, width_mm: f64) -> f64 {
        let each_mm = std::f64::consts::PI * bore_mm / f64::from(self.count);
        self.stiffness_n_per_mm(load_n) / (each_mm * width_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The documentation of `HHD-95-typical` derives its bedding of 170 N/mm³ from this: 10 µm and 4.4e4 N/mm at 300 N.
    #[test]
    fn balls_give_way_as_those_of_the_typical_drive() {
        let balls = Balls { count: 23, diameter_mm: 7.1 };
        assert!((balls.approach_mm(300.0) / 10e-3 - 1.0).abs() < 0.03, "{}", balls.approach_mm(300.0));
        assert!((balls.stiffness_n_per_mm(300.0) / 4.4e4 - 1.0).abs() < 0.03);
        let bedding = balls.bedding_n_per_mm3(300.0, 93.35, 20.0);
        assert!((bedding / 170.0 - 1.0).abs() < 0.03, "{bedding}");
        assert_eq!(Balls::in_proportion(93.35), balls);
        assert!((Balls::in_proportion(0.5 * 93.35).diameter_mm - 3.55).abs() < 1e-12);
        // Palmgren turned around, (delta d^(1/3) / 4.37e-4)^1.5: 10 µm of this ball are 291.7 N.
        assert!((balls.approach_mm(291.7) / 0.010 - 1.0).abs() < 1e-3, "{}", balls.approach_mm(291.7));
        // Tangent of a load that grows with the 3/2 power of the approach.
        let (q, step) = (200.0, 1e-3);
        let secant = 2.0 * step / (balls.approach_mm(q + step) - balls.approach_mm(q - step));
        assert!((secant / balls.stiffness_n_per_mm(q) - 1.0).abs() < 1e-6);
    }
}
