//! The rolling bearing of a wave generator by closed forms: how balls give way, and what they cost.
//!
//! * **Approach** of a ball between two races of usual osculation, both contacts together: `4.37e-4 (Q²/d)^(1/3)` mm
//!   (Palmgren, *Ball and Roller Bearing Engineering*, 1959).
//! * **Friction** of a bearing, the sum of what lubricant and load take: `M0 = 1e-7 f0 (nu n)^(2/3) d_m³` N·mm from nu
//!   n = 2000 cSt/min on, `160e-7 f0 d_m³` below; `M1 = f1 P d_m` (Palmgren; Harris, *Rolling Bearing Analysis*,
//!   "friction in rolling bearings"). A generator is loaded at two lobes, so P is the sum of all ball loads and no
//!   resultant.
//! * **Viscosity** over temperature: `lg lg (nu + 0.7) = A - B lg T` (Walther; ASTM D341), T in kelvin.
//!
//! f0 depends on how much grease there is and is the least known number here.

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

/// A lubricant by the two numbers of its line in Walther's chart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lubricant {
    /// A.
    pub a: f64,
    /// B.
    pub b: f64,
}

impl Lubricant {
    /// Mineral oil of ISO VG 32 (86 cSt at 20 °C).
    pub const MINERAL_VG_32: Lubricant = Lubricant { a: 9.5308, b: 3.7466 };
    /// Perfluoropolyether Z25, of greases for space (270 cSt at 20 °C).
    pub const PFPE_Z25: Lubricant = Lubricant { a: 4.0658, b: 1.4916 };

    /// Kinematic viscosity, cSt.
    pub fn viscosity_cst(&self, temperature_c: f64) -> f64 {
        let lines = self.a - self.b * (temperature_c + 273.15).log10();
        10_f64.powf(10_f64.powf(lines)) - 0.7
    }
}

/// nu n below which the lubricant's part no longer falls, cSt/min.
const SLOW: f64 = 2000.0;

/// Torque of the lubricant, N·mm; mean diameter of the bearing in mm, speed in turns a minute.
pub fn lubricant_torque_n_mm(f0: f64, viscosity_cst: f64, speed_rpm: f64, mean_diameter_mm: f64) -> f64 {
    // 2000^(2/3) is 159: the two branches meet to 1 %.
    1e-7 * f0 * (viscosity_cst * speed_rpm).max(SLOW).powf(2.0 / 3.0) * mean_diameter_mm.powi(3)
}

/// Torque of the load, N·mm; `load_n` is the sum of the loads of all balls.
pub fn load_torque_n_mm(f1: f64, load_n: f64, mean_diameter_mm: f64) -> f64 {
    f1 * load_n * mean_diameter_mm
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

    /// Kinematic viscosities of the two lubricants, cSt, at 20, -20 and -40 °C; mineral oil at -20 °C.
    #[test]
    fn lubricants_thicken_in_the_cold_as_their_sheets_say() {
        for (temperature_c, expected) in [(20.0, 270.0), (-20.0, 1060.0), (-40.0, 2640.0)] {
            let found = Lubricant::PFPE_Z25.viscosity_cst(temperature_c);
            assert!((found / expected - 1.0).abs() < 0.05, "{temperature_c}: {found}");
        }
        // What VG 32 means (ISO 3448): 32 cSt at 40 °C.
        let named = Lubricant::MINERAL_VG_32.viscosity_cst(40.0);
        assert!((named / 32.0 - 1.0).abs() < 0.01, "{named}");
        for (temperature_c, expected) in [(20.0, 86.0), (-20.0, 2300.0)] {
            let found = Lubricant::MINERAL_VG_32.viscosity_cst(temperature_c);
            assert!((found / expected - 1.0).abs() < 0.05, "{temperature_c}: {found}");
        }
    }

    /// Slow bearings: `160e-7 f0 d_m³`. Eight times the speed of a fast one: four times the torque.
    #[test]
    fn lubricant_takes_more_with_speed_and_no_less_at_rest() {
        let slow = lubricant_torque_n_mm(1.0, 100.0, 1.0, 50.0);
        assert!((slow / (160e-7 * 50_f64.powi(3)) - 1.0).abs() < 0.01, "{slow}");
        let [once, eightfold] = [500.0, 4000.0].map(|speed| lubricant_torque_n_mm(1.0, 100.0, speed, 50.0));
        assert!((eightfold / once - 4.0).abs() < 1e-9);
        assert!((lubricant_torque_n_mm(2.5, 100.0, 500.0, 50.0) / once - 2.5).abs() < 1e-12);
        assert!((load_torque_n_mm(5e-4, 2000.0, 50.0) - 50.0).abs() < 1e-12);
    }
}
