//! The drive as its catalogue describes it, and the one on the bench: another unit of the same kind.

use std::fmt::Write;

use crate::ARCSEC;
use crate::chance::Chance;

/// The wheel that the housing holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fixed {
    /// The circular spline turns with the output.
    Flexspline,
    /// The flexspline turns with the output, against the generator.
    CircularSpline,
}

/// Place of a wheel in pairs.
pub const FLEXSPLINE: usize = 0;
/// The same of the other wheel.
pub const CIRCULAR_SPLINE: usize = 1;

/// A line of the kinematic error over the generator angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Harmonic {
    pub order: f64,
    pub amplitude_arcsec: f64,
    pub phase_rad: f64,
}

/// The catalogue: `nominal.toml` of the diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    pub flexspline_teeth: u32,
    pub circular_spline_teeth: u32,
    pub fixed: Fixed,
    /// Torque from which each stiffness holds, N m, and the stiffness, N m/rad; the first torque is zero.
    pub stiffness: Vec<(f64, f64)>,
    /// Full width of the clearance.
    pub backlash_arcsec: f64,
    /// Load below which the output stays where it is inside the clearance, N m.
    pub friction_torque_n_m: f64,
    pub harmonics: Vec<Harmonic>,
    /// Largest torque of the runs, N m. Not in `nominal.toml`.
    pub rated_n_m: f64,
}

/// Relative spread of units, one standard deviation.
pub const STIFFNESS_SPREAD: f64 = 0.03;
pub const BACKLASH_SPREAD: f64 = 0.05;
/// Relative spread of the amplitude of each line.
pub const HARMONIC_SPREAD: f64 = 0.20;
/// Spread of the phase of each line, rad.
pub const PHASE_SPREAD_RAD: f64 = 0.05;
/// Relative spread of the friction in the clearance. Not in `nominal.toml`: it moves single rows at a reversal.
pub const FRICTION_SPREAD: f64 = 0.02;

impl Drive {
    /// A drive out of the catalogue: half of them the 188/190 of the project, a third with the circular spline held.
    pub fn draw(chance: &mut Chance) -> Self {
        let (flexspline_teeth, circular_spline_teeth) =
            if chance.one_in(0.5) { (188, 190) } else { *chance.of(&[(200, 202), (160, 162), (198, 200), (120, 122)]) };
        let fixed = if chance.one_in(0.33) { Fixed::CircularSpline } else { Fixed::Flexspline };
        let stiffness_n_m_per_rad = chance.log_uniform(1.5e4, 1.0e5).round();
        let wind_up_arcsec = chance.uniform(80.0, 250.0);
        let rated_n_m = stiffness_n_m_per_rad * wind_up_arcsec / ARCSEC;
        let stiffness = if chance.one_in(0.25) {
            let (t1, t2) = (0.15 * rated_n_m, 0.55 * rated_n_m);
            let k = stiffness_n_m_per_rad;
            vec![
                (0.0, (0.75 * k).round()),
                ((10.0 * t1).round() / 10.0, k),
                ((10.0 * t2).round() / 10.0, (1.15 * k).round()),
            ]
        } else {
            vec![(0.0, stiffness_n_m_per_rad)]
        };
        let mut drive = Self {
            flexspline_teeth,
            circular_spline_teeth,
            fixed,
            stiffness,
            backlash_arcsec: chance.uniform(20.0, 90.0).round(),
            friction_torque_n_m: (1000.0 * rated_n_m * chance.uniform(0.02, 0.06)).round() / 1000.0,
            harmonics: Vec::new(),
            rated_n_m,
        };
        let moving = 2.0 * drive.teeth_of(other(fixed)).recip() * drive.teeth_of(fixed);
        let mut lines = vec![(2.0, 5.0, 18.0), (moving, 3.0, 10.0), (4.0, 1.0, 4.0), (1.0, 0.5, 2.0)];
        lines.truncate(2 + chance.below(3));
        for (order, low, high) in lines {
            drive.harmonics.push(Harmonic {
                order,
                amplitude_arcsec: (100.0 * chance.log_uniform(low, high)).round() / 100.0,
                phase_rad: (1e4 * chance.phase()).round() / 1e4,
            });
        }
        drive
    }

    fn teeth_of(&self, wheel: Fixed) -> f64 {
        f64::from(match wheel {
            Fixed::Flexspline => self.flexspline_teeth,
            Fixed::CircularSpline => self.circular_spline_teeth,
        })
    }

    /// Teeth of the wheel that stands still: periods of the mesh per generator turn.
    pub fn mesh_order(&self) -> f64 {
        self.teeth_of(self.fixed)
    }

    pub fn output_teeth(&self) -> f64 {
        self.teeth_of(other(self.fixed))
    }

    /// Generator turns per output turn, with the sense (Willis, generator as the carrier).
    pub fn ratio(&self) -> f64 {
        let (f, c) = (f64::from(self.flexspline_teeth), f64::from(self.circular_spline_teeth));
        match self.fixed {
            Fixed::Flexspline => c / (c - f),
            Fixed::CircularSpline => -f / (c - f),
        }
    }

    /// Angles of the first zone of contact on the flexspline and on the circular spline, rad.
    pub fn wheels_rad(&self, generator_rad: f64, output_rad: f64) -> [f64; 2] {
        let rest = generator_rad - output_rad;
        if self.fixed == Fixed::Flexspline { [generator_rad, rest] } else { [rest, generator_rad] }
    }

    /// Motion of the teeth by the lines of a unit at a generator angle, arcsec.
    pub fn lines_arcsec(&self, unit: &Unit, generator_rad: f64) -> f64 {
        let lines = self.harmonics.iter().zip(&unit.harmonics);
        lines
            .map(|(h, (scale, shift))| {
                h.amplitude_arcsec * scale * (h.order * generator_rad + h.phase_rad + shift).sin()
            })
            .sum()
    }

    pub fn first_stiffness(&self) -> f64 {
        self.stiffness[0].1
    }

    /// Wind-up at a load of the same sign, arcsec.
    pub fn wind_up_arcsec(&self, load_n_m: f64) -> f64 {
        let load = load_n_m.abs();
        let mut sum = 0.0;
        for (at, &(from, k)) in self.stiffness.iter().enumerate() {
            let to = self.stiffness.get(at + 1).map_or(f64::INFINITY, |next| next.0);
            sum += (load.min(to) - from).max(0.0) / k;
        }
        sum.copysign(load_n_m) * ARCSEC
    }

    pub fn nominal_toml(&self) -> String {
        let fixed = match self.fixed {
            Fixed::Flexspline => "flexspline",
            Fixed::CircularSpline => "circular_spline",
        };
        let stiffness = match self.stiffness.as_slice() {
            [(_, k)] => format!("{k:.1}"),
            parts => {
                format!("[{}]", parts.iter().map(|(t, k)| format!("[{t:.1}, {k:.1}]")).collect::<Vec<_>>().join(", "))
            }
        };
        let mut text = format!(
            "[drive]\nflexspline_teeth = {}\ncircular_spline_teeth = {}\nfixed = \
             \"{fixed}\"\n\n[nominal]\nstiffness_n_m_per_rad = {stiffness}\nbacklash_arcsec = \
             {:.1}\nfriction_torque_n_m = {:.3}\ntemperature_c = 20.0\n",
            self.flexspline_teeth, self.circular_spline_teeth, self.backlash_arcsec, self.friction_torque_n_m
        );
        for line in &self.harmonics {
            let _ = write!(
                text,
                "\n[[nominal.harmonic]]\norder_per_generator_turn = {:?}\namplitude_arcsec = {:?}\nphase_rad = {:?}\n",
                line.order, line.amplitude_arcsec, line.phase_rad
            );
        }
        let _ = write!(
            text,
            "\n[nominal.unit_to_unit]\nstiffness = {STIFFNESS_SPREAD}\nbacklash = {BACKLASH_SPREAD}\nharmonic = \
             {HARMONIC_SPREAD}\nharmonic_phase_rad = {PHASE_SPREAD_RAD}\n"
        );
        text
    }
}

fn other(wheel: Fixed) -> Fixed {
    match wheel {
        Fixed::Flexspline => Fixed::CircularSpline,
        Fixed::CircularSpline => Fixed::Flexspline,
    }
}

/// The drive on the bench, relative to its catalogue.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    pub stiffness: f64,
    pub backlash: f64,
    /// Friction in the clearance over nominal.
    pub friction: f64,
    /// Amplitude over nominal and shift of phase (rad) of each line.
    pub harmonics: Vec<(f64, f64)>,
    pub offset_arcsec: f64,
    /// Stiffness of the teeth over that of the whole drive: what the two zones share by.
    pub tooth_stiffness: f64,
}

impl Unit {
    pub fn nominal(drive: &Drive) -> Self {
        Self {
            stiffness: 1.0,
            backlash: 1.0,
            friction: 1.0,
            harmonics: vec![(1.0, 0.0); drive.harmonics.len()],
            offset_arcsec: 0.0,
            tooth_stiffness: 8.0,
        }
    }

    pub fn draw(drive: &Drive, chance: &mut Chance) -> Self {
        let mut spread = |relative: f64| relative * chance.normal().clamp(-2.5, 2.5);
        Self {
            stiffness: 1.0 + spread(STIFFNESS_SPREAD),
            backlash: 1.0 + spread(BACKLASH_SPREAD),
            friction: 1.0 + spread(FRICTION_SPREAD),
            harmonics: drive
                .harmonics
                .iter()
                .map(|_| (1.0 + spread(HARMONIC_SPREAD), spread(PHASE_SPREAD_RAD)))
                .collect(),
            offset_arcsec: if chance.one_in(0.5) { 0.0 } else { chance.uniform(-60.0, 60.0) },
            tooth_stiffness: chance.uniform(6.0, 12.0),
        }
    }
}
