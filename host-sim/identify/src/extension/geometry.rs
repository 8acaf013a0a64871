//! Causes that are geometry, as fields of a drive that the FEM runs.
//!
//! Not the numbers of a cause are read, but its part of the error under a light load on either flank: it is
//! projected on the order that the imperfection has, and turned into size and place by the kinematics of rigid teeth.
//! With `A` in arc-seconds, `x` the angle of the wave on the part, `a` the flank angle, `+-` the flank that carries
//! under a positive and a negative load:
//!
//! | imperfection | error |
//! |---|---|
//! | displaced by `e` towards `d` | `-+ e / r_b \|sin(x - d +- a)\|`, second order `4 / 3 pi` of it |
//! | pitch error `p cos k(x - f)` | `+p / r cos k(x - f)` on the flexspline, `-` on the circular spline, even `k` |
//! | oval `w cos 2(x - c)` | `w / r (sin 2(x - c) / 2 +- tan a cos 2(x - c))` |
//! | depth `w` off every flank | `+- w / r_b` |

use std::f64::consts::{PI, TAU};

use flexspline::Table;
use num_complex::Complex;

use super::model::CauseEntry;
use crate::causes::ParameterName as Name;
use crate::diagnosis::Extended;
use crate::measurement::Session;
use crate::nominal::Nominal;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::{DamagedFlank, DamagedTooth, Drive, DriveError, Harmonic, SleeveKind, Wheel};

/// Load under which causes are looked at, N·m: light, as loads let more teeth share what is displaced.
const PROBE_N_M: f64 = 2.0;
/// Positions over a turn of the output; a prime.
const POSITIONS: usize = 1009;
/// The largest sizes that a drive file takes, µm.
const LARGEST_UM: f64 = 100.0;

/// A drive with the causes that are geometry, and the rest.
#[derive(Clone, Debug)]
pub(crate) struct FoundGeometry {
    /// The drive.
    pub drive: Drive,
    /// The fields that hold causes, `path = value`.
    pub fields: Vec<String>,
    /// Causes that no field of a drive holds.
    pub rest: Vec<CauseEntry>,
}

/// A wave `A cos(k x - p)` as `z = 2 mean(e exp(i k x)) = A exp(i p)`.
type Wave = Complex<f64>;

fn wave_of(error: &[f64], angle: impl Fn(usize) -> f64, order: f64) -> Wave {
    let n = error.len().max(1) as f64;
    error.iter().enumerate().map(|(k, e)| Wave::cis(order * angle(k)) * (2.0 / n * e)).sum()
}

/// The part of each cause under the probing load on either flank, over a turn of the output.
pub(crate) struct Probe {
    generator: Vec<f64>,
    ratio: f64,
    /// Under the positive and the negative load; per cause.
    error: [Vec<Vec<f64>>; 2],
}

impl Probe {
    /// Projection of a cause on an order of the angle on the flexspline or the circular spline.
    fn wave(&self, cause: usize, on_circular_spline: bool, order: f64) -> [Wave; 2] {
        let share = if on_circular_spline { 1.0 - 1.0 / self.ratio } else { 1.0 };
        [0, 1].map(|flank| wave_of(&self.error[flank][cause], |k| share * self.generator[k], order))
    }
}

/// `A exp(2 i d)` of what is displaced towards `d`; `a` is the flank angle.
fn displaced([plus, minus]: [Wave; 2], a: f64) -> Wave {
    let second = 4.0 / (3.0 * PI);
    (plus * Wave::cis(2.0 * a) - minus * Wave::cis(-2.0 * a)) * (0.5 / second)
}

/// `A exp(2 i c)` of an oval with a crest at `c`; `a` is the flank angle.
fn oval([plus, minus]: [Wave; 2], a: f64) -> Wave {
    let tan = a.tan();
    // Least squares of z = A exp(2 i c) (i/2 +- tan a) on both flanks.
    let part = |z: Wave, sign: f64| z * Wave::cis(-PI / 2.0) * 0.5 + z * (sign * tan);
    (part(plus, 1.0) + part(minus, -1.0)) * (0.5 / (0.25 + tan * tan))
}

fn degrees(phase: f64) -> f64 {
    phase.to_degrees().rem_euclid(360.0)
}

/// A cause on its way into a drive.
pub(crate) struct Placing<'a> {
    drive: &'a Drive,
    found: &'a mut Drive,
    nominal: &'a Nominal,
    cause: &'a CauseEntry,
    probe: &'a Probe,
    /// Which of the causes of the probe it is.
    at: usize,
    /// Whether the drive stays at one angle against gravity.
    at_one_orientation: bool,
    /// The fields that were set, `path = value`.
    fields: Vec<String>,
}

/// Rounded to four digits behind the point.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// Arc-seconds at a radius (mm), µm.
fn um(arcsec: f64, radius_mm: f64) -> f64 {
    1e3 * arcsec / ARCSEC_PER_RAD * radius_mm
}

impl Placing<'_> {
    fn value(&self, name: Name) -> Option<f64> {
        self.cause.parameters.get(name.as_str()).copied()
    }

    /// Changes a number of the file, and says what it is then: a coefficient per kelvin as a power of ten.
    fn set(&mut self, path: &str, change: impl FnOnce(f64) -> f64) {
        if let Some(number) = self.found.number_mut(path) {
            *number = change(*number);
            let number = if path.ends_with("_per_k") { format!("{number:e}") } else { number.to_string() };
            self.fields.push(format!("{path} = {number}"));
        }
    }

    /// Size and place of the second order of what the cause adds, at a radius (mm).
    fn set_second_order(
        &mut self,
        on_circular_spline: bool,
        read: fn([Wave; 2], f64) -> Wave,
        radius_mm: f64,
        [size, phase]: [&str; 2],
    ) {
        let flank_angle_rad = self.drive.circular_spline.bearing_flank_angle_rad();
        let wave = read(self.probe.wave(self.at, on_circular_spline, 2.0), flank_angle_rad);
        self.set(size, |_| rounded(um(wave.norm(), radius_mm)));
        self.set(phase, |_| rounded(degrees(0.5 * wave.arg())));
    }

    /// An offset of the circular spline in a fixed direction, if the drive stays at one angle against gravity.
    pub(crate) fn set_offset(&mut self) {
        if self.at_one_orientation {
            let paths = ["as_built.circular_spline_offset_um", "as_built.circular_spline_offset_direction_deg"];
            self.set_displacement(false, paths);
        }
    }

    /// An oval: along the pitch circle.
    pub(crate) fn set_ovality(&mut self) {
        let paths = ["as_built.circular_spline_ovality_um", "as_built.circular_spline_ovality_phase_deg"];
        self.set_second_order(true, oval, self.drive.circular_spline.pitch_radius_mm(), paths);
    }

    /// A displacement: along the normal of the flanks.
    pub(crate) fn set_displacement(&mut self, on_circular_spline: bool, paths: [&str; 2]) {
        let base_mm = self.drive.circular_spline.base_radius_mm();
        self.set_second_order(on_circular_spline, displaced, base_mm, paths);
    }

    /// Harmonics of the pitch of a wheel.
    pub(crate) fn set_pitch_harmonics(&mut self, wheel: Wheel) {
        let on_circular_spline = wheel == Wheel::CircularSpline;
        let (f, c, built) = (&self.drive.flexspline, &self.drive.circular_spline, &mut self.found.as_built);
        let (field, list, radius, sign) = if on_circular_spline {
            let radius = 0.5 * (c.root_radius_mm + c.tip_radius_mm);
            ("circular_spline_pitch_harmonics", &mut built.circular_spline_pitch_harmonics, radius, -1.0)
        } else {
            let radius = 0.5 * (f.root_radius_mm + f.tip_radius_mm);
            ("flexspline_pitch_harmonics", &mut built.flexspline_pitch_harmonics, radius, 1.0)
        };
        // Two lobes that share the load alike cancel odd orders; their size says nothing of the wheel.
        for order in [2_u32, 4, 6] {
            let [plus, minus] = self.probe.wave(self.at, on_circular_spline, f64::from(order));
            let wave = (plus + minus) * (0.5 * sign);
            let amplitude_um = rounded(um(wave.norm(), radius));
            if amplitude_um >= 0.1 {
                let phase_deg = rounded(degrees(wave.arg() / f64::from(order)));
                self.fields.push(format!(
                    "as_built.{field}: order = {order}, amplitude_um = {amplitude_um}, phase_deg = {phase_deg}"
                ));
                list.push(Harmonic { order, amplitude_um, phase_deg });
            }
        }
    }

    /// A damaged tooth, on the flanks on which the data show it.
    pub(crate) fn set_damaged_tooth(&mut self) {
        let [tooth, wheel, depth] = [Name::Tooth, Name::Wheel, Name::DepthUm].map(|name| self.value(name));
        let (Some(tooth), Some(wheel), Some(depth)) = (tooth, wheel, depth) else { return };
        let (wheel, teeth) = match wheel < 0.5 {
            true => (Wheel::Flexspline, self.drive.flexspline.teeth),
            false => (Wheel::CircularSpline, self.drive.circular_spline.teeth),
        };
        // Under a positive load the clockwise flanks of the flexspline bear, and the others of the circular spline.
        let felt = [0, 1].map(|flank: usize| {
            self.probe.error[flank][self.at].iter().fold(0.0, |most: f64, error| most.max(error.abs()))
        });
        let flank = match (felt[0] > felt[1]) == (wheel == Wheel::Flexspline) {
            _ if felt[0].min(felt[1]) > 0.5 * felt[0].max(felt[1]) => DamagedFlank::Both,
            true => DamagedFlank::Minus,
            false => DamagedFlank::Plus,
        };
        let damaged = DamagedTooth {
            wheel,
            tooth: (tooth.rem_euclid(f64::from(teeth))) as u32 % teeth,
            flank,
            depth_um: (depth.clamp(0.0, 500.0) * 100.0).round() / 100.0,
        };
        self.fields.push(format!(
            "as_built.damaged_teeth: wheel = {}, tooth = {}, flank = {}, depth_um = {}",
            wheel.name(),
            damaged.tooth,
            flank.name(),
            damaged.depth_um
        ));
        self.found.as_built.damaged_teeth.push(damaged);
    }

    /// A wider clearance: wear of the flanks of both wheels.
    pub(crate) fn set_wear(&mut self) {
        let Some(growth) = self.value(Name::GrowthArcsec).filter(|growth| *growth > 0.0) else { return };
        // Half of it from the flanks of either wheel.
        let depth = 0.25 * um(growth, self.drive.circular_spline.base_radius_mm());
        for path in ["as_built.flexspline_wear_um", "as_built.circular_spline_wear_um"] {
            self.set(path, |before| rounded(before + depth));
        }
    }

    /// A clearance that follows the temperature: expansion of circular spline and housing.
    pub(crate) fn set_expansion(&mut self) {
        let Some(per_k) = self.value(Name::ClearanceArcsecPerK) else { return };
        // A ring that grows by dr opens its spaces by 2 dr tan a / r.
        let more = per_k / ARCSEC_PER_RAD / (2.0 * self.drive.circular_spline.bearing_flank_angle_rad().tan());
        for path in ["temperature.circular_spline_expansion_per_k", "temperature.housing_expansion_per_k"] {
            self.set(path, |before| before + more);
        }
    }

    /// Another stiffness: of the sleeve where the drive is softer, of the material where it is stiffer.
    pub(crate) fn set_stiffness(&mut self) {
        let Some(ratio) = self.value(Name::StiffnessRatio).filter(|ratio| *ratio > 0.0) else { return };
        if ratio >= 1.0 {
            return self.set("material.youngs_modulus_mpa", |modulus| rounded(modulus * ratio));
        }
        // What gives more is put in series: the sleeve.
        let nominal_k = self.nominal.stiffness.last().map_or(f64::INFINITY, |[_, k]| *k);
        let before = self.drive.sleeve.torsion_stiffness_n_m_per_rad.map_or(0.0, |k| 1.0 / k);
        let k = (1.0 / (before + (1.0 / ratio - 1.0) / nominal_k)).round();
        self.found.sleeve.torsion_stiffness_n_m_per_rad = Some(k);
        if self.found.sleeve.kind == SleeveKind::None {
            self.found.sleeve.kind = SleeveKind::Springs;
            self.fields.push("sleeve.kind = \"springs\"".to_owned());
        }
        self.fields.push(format!("sleeve.torsion_stiffness_n_m_per_rad = {k}"));
    }

    /// A stiffness that follows the temperature: Young's modulus.
    pub(crate) fn set_stiffness_per_k(&mut self) {
        let Some(per_k) = self.value(Name::StiffnessRelativePerK) else { return };
        if (self.found.temperature.youngs_modulus_per_k + per_k).abs() <= 1e-3 {
            self.set("temperature.youngs_modulus_per_k", |before| before + per_k);
        }
    }
}

/// Puts the causes that are geometry into a drive.
///
/// # Errors
/// The drive that comes of it is none: sizes that do not fit.
pub(crate) fn found_geometry(
    drive: &Drive,
    extended: &Extended,
    causes: &[CauseEntry],
    (nominal, table): (&Nominal, Option<&Table<'_>>),
    orientation_rad: Option<f64>,
) -> Result<FoundGeometry, DriveError> {
    let step = TAU * nominal.ratio.abs() / POSITIONS as f64;
    let generator: Vec<f64> = (0..POSITIONS).map(|k| k as f64 * step).collect();
    let error_under = |load: f64| {
        let time_s = (0..POSITIONS).map(|k| 1e4 * k as f64).collect();
        let others = [load, nominal.temperature_c, orientation_rad.unwrap_or(0.0)];
        let session = Session::imagined(time_s, generator.clone(), others.map(|value| vec![value; POSITIONS]));
        extended.predict(&[session], nominal, table).remove(0).cause_arcsec
    };
    let load = PROBE_N_M.max(1.5 * nominal.friction_torque_n_m);
    let error = [load, -load].map(error_under);
    let probe = Probe { generator, ratio: nominal.ratio, error };
    let mut found = drive.clone();
    let (mut fields, mut rest) = (Vec::new(), Vec::new());
    for cause in causes {
        let Some(at) = extended.causes().iter().position(|fitted| fitted.name() == cause.name) else {
            rest.push(cause.clone());
            continue;
        };
        let mut placing = Placing {
            drive,
            found: &mut found,
            nominal,
            cause,
            probe: &probe,
            at,
            at_one_orientation: orientation_rad.is_some(),
            fields: Vec::new(),
        };
        (cause.name.spec().place)(&mut placing);
        let set = placing.fields;
        let b = &found.as_built;
        let displaced = [b.circular_spline_eccentricity_um, b.flexspline_runout_um, b.circular_spline_offset_um];
        let largest = displaced.into_iter().fold(b.circular_spline_ovality_um, f64::max);
        if set.is_empty() || largest > LARGEST_UM {
            rest.push(cause.clone());
        } else {
            fields.extend(set);
        }
    }
    if !fields.is_empty() {
        found.name = format!("{}-extended", drive.name);
    }
    found.check()?;
    Ok(FoundGeometry { drive: found, fields, rest })
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::drive::{AsBuilt, GeneratorKind};
    use flexspline_mechanics::mesh::MeshLevel;
    use flexspline_mechanics::motion::Motion;
    use flexspline_mechanics::stepping::{Method, Problem, SolveError, SolverSettings};

    /// Error of the drive deformed at a generator angle, then loaded, arcsec.
    fn stands(problem: &Problem, generator_rad: f64, torque_n_m: f64) -> Result<f64, SolveError> {
        let mut motion = Motion::deformed_or_turned_in(problem, generator_rad)?;
        motion.load(torque_n_m)?;
        Ok(motion.error_arcsec())
    }

    /// Errors by the closed forms above, over a turn of the output.
    fn waves(error: impl Fn(f64, f64) -> f64, order: f64) -> [Wave; 2] {
        let x = |k: usize| TAU * k as f64 / 720.0;
        [1.0, -1.0].map(|flank| wave_of(&(0..720).map(|k| error(x(k), flank)).collect::<Vec<f64>>(), x, order))
    }

    #[test]
    fn size_and_place_come_back_from_the_closed_forms() {
        let a = 0.4;
        let wave = displaced(waves(|x, flank| -flank * 30.0 * (x - 0.7 + flank * a).sin().abs(), 2.0), a);
        assert!((wave.norm() - 30.0).abs() < 0.01 && (0.5 * wave.arg() - 0.7).abs() < 1e-3, "{wave:?}");
        let two = |x: f64| 2.0 * (x - 0.4);
        let wave = oval(waves(|x, flank| 20.0 * (0.5 * two(x).sin() + flank * a.tan() * two(x).cos()), 2.0), a);
        assert!((wave.norm() - 20.0).abs() < 0.01 && (0.5 * wave.arg() - 0.4).abs() < 1e-3, "{wave:?}");
    }

    /// The FEM of a drive that is known, read by the same formulas: signs and places of every field.
    #[test]
    #[ignore = "long: tests/run slow"]
    fn the_fem_agrees_with_the_closed_forms_in_sign_place_and_size() {
        type Change = fn(&mut AsBuilt);
        type Read = fn([Wave; 2], f64) -> Wave;
        const PARTS: usize = 5;
        /// Size, µm, and place, degrees.
        const AT: (f64, f64) = (5.0, 50.0);
        fn whole([plus, minus]: [Wave; 2], _: f64) -> Wave {
            (plus + minus) * 0.5
        }
        let settings = SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() };
        // Half a turn of the wave on the part, in as few places as separate the second order from the fourth and sixth.
        let share = |on_circular_spline: bool| if on_circular_spline { 94.0 / 95.0 } else { 1.0 };
        let psi = |k: usize, share: f64| k as f64 * PI / PARTS as f64 / share;
        // At these places, with either flank.
        let errors = |drive: &Drive, share: f64| {
            let problem = Problem::new(drive, GeneratorKind::Cam, 20.0, settings).unwrap();
            let at = |k, flank: f64| stands(&problem, psi(k, share), flank * PROBE_N_M).unwrap();
            [1.0, -1.0].map(|flank| (0..PARTS).map(|k| at(k, flank)).collect::<Vec<f64>>())
        };
        let ideal = [false, true].map(|on_circular_spline| errors(&Drive::hhd_95(), share(on_circular_spline)));
        let cases: [(&str, Change, Read, bool, f64); 6] = [
            (
                "circular-spline eccentricity",
                |b| (b.circular_spline_eccentricity_um, b.circular_spline_eccentricity_phase_deg) = AT,
                displaced,
                true,
                44.635,
            ),
            (
                "flexspline runout",
                |b| (b.flexspline_runout_um, b.flexspline_runout_phase_deg) = AT,
                displaced,
                false,
                44.635,
            ),
            (
                "axis displaced",
                |b| (b.circular_spline_offset_um, b.circular_spline_offset_direction_deg) = AT,
                displaced,
                false,
                44.635,
            ),
            ("ovality", |b| (b.circular_spline_ovality_um, b.circular_spline_ovality_phase_deg) = AT, oval, true, 48.7),
            (
                "flexspline pitch",
                |b| b.flexspline_pitch_harmonics = vec![Harmonic { order: 2, amplitude_um: AT.0, phase_deg: AT.1 }],
                whole,
                false,
                48.35,
            ),
            (
                "circular-spline pitch",
                |b| {
                    b.circular_spline_pitch_harmonics = vec![Harmonic { order: 2, amplitude_um: AT.0, phase_deg: AT.1 }]
                },
                |waves, a| -whole(waves, a),
                true,
                49.05,
            ),
        ];
        let (size_um, place_deg) = AT;
        for (what, change, read, on_circular_spline, radius) in cases {
            let mut drive = Drive::hhd_95();
            change(&mut drive.as_built);
            let share = share(on_circular_spline);
            let found = errors(&drive, share);
            let found = [0, 1].map(|flank| {
                let ideal = &ideal[usize::from(on_circular_spline)][flank];
                let beyond: Vec<f64> = found[flank].iter().zip(ideal).map(|(built, ideal)| built - ideal).collect();
                wave_of(&beyond, |k| share * psi(k, share), 2.0)
            });
            let wave = read(found, drive.circular_spline.bearing_flank_angle_rad());
            let size = 1e3 * wave.norm() / ARCSEC_PER_RAD * radius;
            let place = (0.5 * wave.arg()).to_degrees().rem_euclid(180.0);
            println!("{what}: {size:.3} um at {place:.2} degrees, made {size_um} at {place_deg}");
            assert!((size / size_um - 1.0).abs() < 0.15, "{what}: {size} um of {size_um}");
            assert!((place - place_deg).abs() < 7.0, "{what}: at {place} degrees of {place_deg}");
        }
    }
}
