//! A drive known only from its catalogue: `nominal.toml`.
//!
//! Nominal output = generator / ratio + harmonics + play (backlash, loaded by torque) + wind-up (torque). Angles are
//! radians, errors arc-seconds at the output, torque N·m, positive where it turns the output forward.

use std::f64::consts::TAU;
use std::sync::Arc;

use flexspline::{FixedMember, Table};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::calibrate::{GOLDEN, State, steady};
use crate::measurement::Gear;
use crate::parts::HALF_A_LOST_MOTION_ARCSEC;
use crate::residual::harmonics;
use flexspline_base::toml_file::{Allowed, Refused, Section, TomlFile, from, number, one_of, real, whole};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::kernels::Kernels;
use flexspline_design::tables::dead_zone_n_m;
use flexspline_mechanics::drive::DriveError;

/// The farthest that a drive winds up, rad: torques beyond are in another unit. *Source*: 69 arcmin at the ratcheting
/// torque of the softest drive of the catalogue (CSG-14-80), the largest of 44.
const FARTHEST_WIND_UP_RAD: f64 = 0.02;

/// Places over a tooth pitch that an error of a table is averaged over. *Guess*: twice its nodes.
const STEPS_OF_A_PITCH: u32 = 16;
/// Places over an output turn that waves of a table are fitted to. *Guess*: dozens for each of its orders.
const PLACES_OF_A_TURN: u32 = 4000;
/// Half a backlash, or a wind-up, that shows nowhere, arcsec. *Guess*: it stands for none where one may be.
const LEAST_ARCSEC: f64 = 0.1;
/// Spread of a stiffness that nobody has stated, at least. *Guess*: all of it.
pub(crate) const UNSTATED: f64 = 1.0;
/// Waves in a turn of the generator, or of its wave on the wheel that turns, that every strain wave gear has, and their
/// first overtone.
pub(crate) const OF_TWO_LOBES: [f64; 2] = [2.0, 4.0];

/// Tooth counts of a strain wave drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Teeth {
    /// Of the flexspline.
    pub flexspline: u32,
    /// Of the circular spline.
    pub circular_spline: u32,
    /// Which of them is fixed.
    pub fixed: FixedMember,
}

impl Teeth {
    /// The drive as the core knows it.
    ///
    /// # Errors
    /// No pair of wheels has these teeth.
    pub(crate) fn core_drive(self) -> Result<flexspline::Drive, flexspline::DriveError> {
        let narrow = |count: u32| u16::try_from(count).unwrap_or(u16::MAX);
        flexspline::Drive::new(narrow(self.flexspline), narrow(self.circular_spline), self.fixed)
    }

    /// Of the wheel that is the output.
    pub(crate) const fn of_output(self) -> u32 {
        match self.fixed {
            FixedMember::Flexspline => self.circular_spline,
            FixedMember::CircularSpline => self.flexspline,
        }
    }
}

/// A ratio that no table can be of.
#[derive(Debug, thiserror::Error)]
pub enum NoSuchWheels {
    /// The core refuses the wheels.
    #[error("ratio {ratio}: {why}")]
    Core {
        /// The ratio.
        ratio: f64,
        /// What the core says.
        why: flexspline::DriveError,
    },
    /// No two wheels have it.
    #[error(
        "ratio: found {0}, allowed: a ratio that wheels with two teeth of difference have, a whole number or a half; \
         or a model with the teeth, --model nominal.toml"
    )]
    Ratio(f64),
}

/// One harmonic of the nominal output error, `amplitude sin(order generator + phase)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonic {
    /// Periods per generator turn; need not be whole.
    pub order_per_generator_turn: f64,
    /// Amplitude, arcsec.
    pub amplitude_arcsec: f64,
    /// Phase, rad.
    pub phase_rad: f64,
}

/// Relative spread (one standard deviation) between units that is no discrepancy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Of the torsional stiffness.
    pub stiffness: f64,
    /// Of the backlash.
    pub backlash: f64,
    /// Of the amplitude of each harmonic.
    pub harmonic: f64,
    /// Of its phase, rad.
    pub harmonic_phase_rad: f64,
}

/// The nominal model.
#[derive(Clone, Debug, PartialEq)]
pub struct Nominal {
    /// Generator turns per output turn, signed.
    pub ratio: f64,
    /// Teeth; `None` for a gear of another kind, known by its ratio.
    pub teeth: Option<Teeth>,
    /// Torsional stiffness (N·m/rad) from each torque (N·m) on; the first torque is 0.
    pub stiffness: Vec<[f64; 2]>,
    /// Backlash, arcsec: the whole width of the play.
    pub backlash_arcsec: f64,
    /// Friction of the output inside the clearance, N·m.
    pub friction_torque_n_m: f64,
    /// Temperature that the numbers hold at, °C.
    pub temperature_c: f64,
    /// Kinematic error.
    pub harmonics: Vec<Harmonic>,
    /// Spread between units.
    pub spread: Spread,
    /// What deviations of its geometry do, where the contact FEM has computed it.
    pub kernels: Option<Arc<Kernels>>,
}

impl Nominal {
    /// The gear, for the reader of data.
    pub fn gear(&self) -> Gear {
        let gear = match self.teeth {
            Some(teeth) => {
                Gear::of_teeth(teeth.flexspline, teeth.circular_spline, teeth.fixed == FixedMember::Flexspline)
            }
            None => Gear::of_ratio(self.ratio),
        };
        let stiffest = self.stiffness.iter().fold(f64::INFINITY, |_, [_, stiffness]| *stiffness);
        Gear { plausible_torque_n_m: (stiffest * FARTHEST_WIND_UP_RAD).min(gear.plausible_torque_n_m), ..gear }
    }

    /// Wind-up under a torque, arcsec, of the sign of the torque.
    pub fn wind_up_arcsec(&self, torque_n_m: f64) -> f64 {
        let load = torque_n_m.abs();
        let mut angle_rad = 0.0;
        for (k, &[from, stiffness]) in self.stiffness.iter().enumerate() {
            let to = self.stiffness.get(k + 1).map_or(f64::INFINITY, |next| next[0]);
            if load > from {
                angle_rad += (load.min(to) - from) / stiffness;
            }
        }
        angle_rad.copysign(torque_n_m) * ARCSEC_PER_RAD
    }

    /// Kinematic error at a generator angle, arcsec.
    pub fn harmonics_arcsec(&self, generator_rad: f64) -> f64 {
        self.harmonics
            .iter()
            .map(|h| h.amplitude_arcsec * (h.order_per_generator_turn * generator_rad + h.phase_rad).sin())
            .sum()
    }

    /// The teeth; of a model that gives a ratio alone, those of the strain wave drive of two waves that has it:
    /// `z_c / 2` with the flexspline fixed, `-z_f / 2` with the circular spline fixed, and two teeth of difference.
    pub fn teeth_or_of_two_waves(&self) -> Teeth {
        self.teeth.unwrap_or_else(|| {
            let more = (2.0 * self.ratio.abs()).round().max(3.0) as u32;
            if self.ratio > 0.0 {
                Teeth { flexspline: more - 2, circular_spline: more, fixed: FixedMember::Flexspline }
            } else {
                Teeth { flexspline: more, circular_spline: more + 2, fixed: FixedMember::CircularSpline }
            }
        })
    }

    /// The drive as the core knows it.
    ///
    /// # Errors
    /// No pair of wheels has this ratio.
    pub(crate) fn core_drive(&self) -> Result<flexspline::Drive, NoSuchWheels> {
        let ratio = self.ratio;
        let drive = self.teeth_or_of_two_waves().core_drive().map_err(|why| NoSuchWheels::Core { ratio, why })?;
        if (drive.exact_ratio() / ratio - 1.0).abs() > 1e-9 {
            return Err(NoSuchWheels::Ratio(ratio));
        }
        Ok(drive)
    }

    /// What a table says of wind-up and backlash: the part of the error that is odd in the torque, at mid temperature;
    /// the backlash is what is left of it as the torque goes to zero, or what the direction does without a load, if the
    /// table has no loads of both signs. Kinematic error is left to the table's own prediction.
    pub fn of_table(table: &Table<'_>) -> Nominal {
        let drive = table.drive();
        let teeth = Teeth {
            flexspline: u32::from(drive.flexspline_teeth()),
            circular_spline: u32::from(drive.circular_spline_teeth()),
            fixed: drive.fixed(),
        };
        let [low, high] = table.temperature_range_c();
        let temperature = f32::midpoint(low, high).clamp(low, high);
        let [from, to] = table.torque_range_n_m().map(f64::from);
        let sign = if to >= -from { 1.0 } else { -1.0 };
        let (largest, both) = (from.abs().max(to.abs()), (-from).min(to).max(0.0));
        // Mean of the error over a flexspline pitch.
        let mean = |torque_n_m: f64, way: f64| -> f64 {
            let step = TAU / f64::from(teeth.flexspline) / f64::from(STEPS_OF_A_PITCH);
            let at = State { torque_n_m, temperature_c: f64::from(temperature), way, ..State::default() };
            let places = (0..STEPS_OF_A_PITCH).map(|k| State { generator_rad: f64::from(k) * step, ..at });
            places.map(|at| steady(table, &at, 0.0)).sum::<f64>() / f64::from(STEPS_OF_A_PITCH) / ARCSEC_PER_RAD
        };
        // Beyond the loads of both signs the error counts from the middle of theirs, or of both ways under the least.
        let least = 0.0_f64.clamp(from, to);
        let [forward, backward] = [1.0, -1.0].map(|way| mean(least, way));
        let middle =
            if both > 0.0 { 0.5 * (mean(both, 1.0) + mean(-both, 1.0)) } else { f64::midpoint(forward, backward) };
        let odd = |torque: f64| match torque <= both {
            true => 0.5 * (mean(torque, 1.0) - mean(-torque, 1.0)),
            false => sign * (mean(sign * torque, 1.0) - middle),
        };
        // Below the jump of its torque axis the direction says which flank carries, and no load does.
        let beyond = |share: f64| (share * largest).max((1.01 + share) * dead_zone_n_m(table));
        let at: Vec<f64> = [0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0].into_iter().map(beyond).collect();
        let angles: Vec<f64> = at.iter().map(|torque| odd(*torque)).collect();
        let slope = |k: usize| ((angles[k + 1] - angles[k]) / (at[k + 1] - at[k])).max(1e-12);
        // Without loads of both signs the motion says which flank carries, where nothing loads it.
        let by_motion = if least == 0.0 { 0.5 * (backward - forward) } else { 0.0 };
        let half_backlash_rad = if both > 0.0 { angles[0] - at[0] * slope(0) } else { by_motion }.max(0.0);
        let stiffness = (0..at.len() - 1).map(|k| [if k == 0 { 0.0 } else { at[k] }, 1.0 / slope(k)]).collect();
        Nominal {
            ratio: drive.exact_ratio(),
            teeth: Some(teeth),
            stiffness,
            backlash_arcsec: 2.0 * half_backlash_rad * ARCSEC_PER_RAD,
            friction_torque_n_m: 0.0,
            temperature_c: f64::from(temperature),
            harmonics: Vec::new(),
            spread: USUAL_SPREAD,
            kernels: None,
        }
    }

    /// That of a table whose gear is known by its ratio alone, with the waves that the two lobes of a generator make in
    /// a turn of it and of the wave on the wheel that turns.
    pub(crate) fn of_table_by_ratio(table: &Table<'_>, ratio: f64) -> Nominal {
        let nominal = Nominal::of_table(table);
        let at = State { temperature_c: nominal.temperature_c, way: 1.0, ..State::default() };
        let steady_at = |psi: &f64| steady(table, &State { generator_rad: *psi, ..at }, 0.0);
        let angles: Vec<f64> = (0..PLACES_OF_A_TURN).map(|k| TAU * ratio * (f64::from(k) * GOLDEN).fract()).collect();
        let errors: Vec<f64> = angles.iter().map(steady_at).collect();
        let on_wheel = OF_TWO_LOBES.map(|order| order * (1.0 - 1.0 / ratio));
        let orders = [OF_TWO_LOBES, on_wheel].concat();
        let harmonics = harmonics(&angles, &errors, &orders).map_or_else(Vec::new, |(_, lines)| lines);
        let harmonics = harmonics.into_iter().map(|line| Harmonic {
            order_per_generator_turn: line.order,
            amplitude_arcsec: line.amplitude,
            phase_rad: line.phase_rad,
        });
        // A spring that is soft under light loads, and play, are much alike to a calibration, and both float.
        let half_arcsec = (0.5 * nominal.backlash_arcsec).max(LEAST_ARCSEC);
        let backlash = HALF_A_LOST_MOTION_ARCSEC / half_arcsec;
        // Nor does a calibration know a spring, where loads go with the angle of the output or each log keeps to one.
        let [low, high] = table.torque_range_n_m().map(f64::from);
        let any = FARTHEST_WIND_UP_RAD * ARCSEC_PER_RAD / nominal.wind_up_arcsec(high.max(-low)).max(LEAST_ARCSEC);
        let spread = Spread { stiffness: any.max(UNSTATED), backlash, ..nominal.spread };
        let (harmonics, backlash_arcsec) = (harmonics.collect(), 2.0 * half_arcsec);
        let friction_torque_n_m = dead_zone_n_m(table);
        Nominal { ratio, teeth: None, harmonics, backlash_arcsec, friction_torque_n_m, spread, ..nominal }
    }

    /// A commented `nominal.toml` to fill in, of a drive with these teeth and a fixed flexspline: every key with unit,
    /// meaning, sign and what is allowed. It is read back as it stands.
    pub fn template(flexspline_teeth: u32, circular_spline_teeth: u32) -> String {
        let Spread { stiffness, backlash, harmonic, .. } = USUAL_SPREAD;
        let (fewest, most) = (TEETH.low, TEETH.high);
        format!(
            "\
# A drive known from its catalogue, for `flexspline diagnose DATA.csv --model THIS`: put in the numbers of yours.
# Output angle = generator / ratio + harmonics + play (backlash, loaded by torque) + wind-up (torque).
# Errors are arc-seconds at the output, positive where it leads; torque is positive where it turns the output forward.

[drive]  # the teeth, or the ratio alone
flexspline_teeth = {flexspline_teeth}         # number of teeth; {fewest} to {most}
circular_spline_teeth = {circular_spline_teeth}    # number of teeth; 1 to {MOST_TEETH_MORE} more than the flexspline
fixed = \"flexspline\"           # the wheel that does not turn; \"flexspline\" or \"circular_spline\"
# ratio = -100.0               # generator turns to one of the output, instead of the three above, for a gear of
                               # another kind; negative: they turn opposite ways; 1 to {LARGEST_RATIO:e} or \
             -{LARGEST_RATIO:e} to -1

[nominal]
# Torsional stiffness, N·m/rad, {STIFFNESS}: one number, or that from each torque (N·m, the first is 0) on, as \
             catalogues
# give K1, K2, K3 beyond the torques 0, T1, T2.
stiffness_n_m_per_rad = [[0.0, 20000.0], [10.0, 27000.0], [30.0, 30000.0]]
backlash_arcsec = 60.0         # whole width of the play at the output, arcsec; {BACKLASH}
friction_torque_n_m = 1.5      # load below which the output rests inside the play, N·m; {FRICTION}; 0 if left out
temperature_c = 20.0           # at which these numbers hold, degrees C; {TEMPERATURE}; 20 if left out

[[nominal.harmonic]]  # kinematic error: amplitude sin(order generator + phase); once for each harmonic, or not at all
order_per_generator_turn = 2.0 # periods to a turn of the generator, need not be whole; {ORDER}
amplitude_arcsec = 10.0        # half of peak to peak, arcsec; positive: the output leads where the sine is positive; \
             {AMPLITUDE}
phase_rad = 0.0                # at generator angle 0, rad; {PHASE}

[nominal.unit_to_unit]  # by how much units of this type differ without a fault: one standard deviation over the number
stiffness = {stiffness:?}               # of the stiffness; {SHARE}; {stiffness} if left out
backlash = {backlash:?}                # of the backlash; {SHARE}; {backlash} if left out
harmonic = {harmonic:?}                 # of the harmonics, of their amplitude; {SHARE}; {harmonic} if left out
# harmonic_phase_rad = 0.05    # of their phases, rad; {SHARE}; the number of the amplitudes if left out: a wave of \
             any phase, so large
"
        )
    }

    /// Reads `nominal.toml`.
    ///
    /// # Errors
    /// Every problem found, each with file, line, field, value found and what is allowed.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Nominal, DriveError> {
        let mut file = TomlFile::new(file_name, text);
        let nominal = file.parse().and_then(|table| Nominal::of_file(&mut file, &table));
        match nominal.filter(|_| file.is_sound()) {
            Some(nominal) => Ok(nominal),
            None => Err(DriveError { problems: file.problems() }),
        }
    }

    /// Reads a file that has been parsed; nothing where what is wrong with it leaves no model.
    fn of_file(file: &mut TomlFile<'_>, table: &DeTable<'_>) -> Option<Nominal> {
        if table.contains_key("flexspline") && !table.contains_key("nominal") {
            let what = "it is the file of a drive; allowed: a nominal model, with [drive] and [nominal]; a drive goes \
                        with its table: --drive FILE --tables DIR, without --model";
            file.refuse_whole("", what.to_owned());
            return None;
        }
        // What a diagnosis found stands in [extension], which `crate::extension` reads.
        file.refuse_unknown_keys(table, &KEYS, &["extension"]);
        if !file.is_sound() {
            return None;
        }
        let drive = file.section(table, "drive");
        let nominal = file.section(table, "nominal");
        let (ratio, teeth) = drive.and_then(|drive| ratio_and_teeth(file, &drive))?;
        let nominal = nominal?;
        let stiffness = nominal.needed(file, "stiffness_n_m_per_rad", stiffness);
        let backlash = nominal.needed(file, "backlash_arcsec", |v| real(&BACKLASH, v));
        let friction = nominal.given(file, "friction_torque_n_m", |v| real(&FRICTION, v));
        let temperature = nominal.given(file, "temperature_c", |v| real(&TEMPERATURE, v));
        let harmonics = nominal.sections(file, "harmonic").iter().map(|section| harmonic(file, section)).collect();
        let spread = nominal.section(file, "unit_to_unit").map_or(USUAL_SPREAD, |section| spread(file, &section));
        Some(Nominal {
            ratio,
            teeth,
            stiffness: stiffness?,
            backlash_arcsec: backlash?,
            friction_torque_n_m: friction.unwrap_or(0.0),
            temperature_c: temperature.unwrap_or(USUAL_TEMPERATURE_C),
            harmonics,
            spread,
            kernels: None,
        })
    }
}

/// Spread assumed where the file gives none: stiffness, backlash, harmonics of drives of one type.
const USUAL_SPREAD: Spread = Spread { stiffness: 0.03, backlash: 0.05, harmonic: 0.20, harmonic_phase_rad: 0.20 };

/// Temperature at which numbers hold where none is given, °C.
pub(crate) const USUAL_TEMPERATURE_C: f64 = 20.0;

/// Every key of the file; those of `nominal.harmonic` are of each entry.
const KEYS: [&str; 18] = [
    "drive",
    "drive.flexspline_teeth",
    "drive.circular_spline_teeth",
    "drive.fixed",
    "drive.ratio",
    "nominal",
    "nominal.stiffness_n_m_per_rad",
    "nominal.backlash_arcsec",
    "nominal.friction_torque_n_m",
    "nominal.temperature_c",
    "nominal.harmonic",
    "nominal.harmonic.order_per_generator_turn",
    "nominal.harmonic.amplitude_arcsec",
    "nominal.harmonic.phase_rad",
    "nominal.unit_to_unit.stiffness",
    "nominal.unit_to_unit.backlash",
    "nominal.unit_to_unit.harmonic",
    "nominal.unit_to_unit.harmonic_phase_rad",
];

const TEETH: Allowed = from(20.0, 2000.0);
/// Most teeth that the circular spline has more than the flexspline.
const MOST_TEETH_MORE: u32 = 12;
const LARGEST_RATIO: f64 = 1e6;
const STIFFNESS: Allowed = from(1e-3, 1e12);
const BACKLASH: Allowed = from(0.0, 1e5);
const FRICTION: Allowed = from(0.0, 1e6);
const TEMPERATURE: Allowed = from(-273.0, 500.0);
const ORDER: Allowed = from(1e-6, 1e5);
const AMPLITUDE: Allowed = from(-1e5, 1e5);
const PHASE: Allowed = from(-100.0, 100.0);
const SHARE: Allowed = from(0.0, 1.0);

/// One stiffness, or that from each torque on: `[torque, stiffness]`.
fn stiffness(value: &Spanned<DeValue>) -> Result<Vec<[f64; 2]>, Refused> {
    let allowed = "a stiffness in N·m/rad or a list [[0.0, K1], [T1, K2], ...]";
    let pair = |step: &Spanned<DeValue>| match step.get_ref().as_array().map(|pair| (pair.len(), pair)) {
        Some((2, pair)) => number(pair[0].get_ref()).zip(number(pair[1].get_ref())).map(|(torque, k)| [torque, k]),
        _ => None,
    };
    let steps: Option<Vec<[f64; 2]>> = match value.get_ref() {
        DeValue::Array(steps) => steps.iter().map(pair).collect(),
        one => number(one).map(|stiffness| vec![[0.0, stiffness]]),
    };
    let steps = steps.ok_or_else(|| Refused::found(value, allowed))?;
    let rising = steps.windows(2).all(|pair| pair[0][0] < pair[1][0]);
    let sound = steps.iter().all(|&[torque, k]| torque.is_finite() && STIFFNESS.refusal(k).is_none());
    if steps.first().is_none_or(|first| first[0] != 0.0) || !rising || !sound {
        let what =
            format!("found {steps:?} as [torque, stiffness], allowed: torques from 0 upward, stiffness {STIFFNESS}");
        return Err(Refused::because(value, what));
    }
    Ok(steps)
}

fn harmonic(file: &mut TomlFile<'_>, section: &Section<'_, '_>) -> Harmonic {
    // What is refused has been told; the file is not read then, whatever stands here.
    let mut needed = |key: &str, allowed: &Allowed| section.needed(file, key, |v| real(allowed, v)).unwrap_or(f64::NAN);
    Harmonic {
        order_per_generator_turn: needed("order_per_generator_turn", &ORDER),
        amplitude_arcsec: needed("amplitude_arcsec", &AMPLITUDE),
        phase_rad: needed("phase_rad", &PHASE),
    }
}

fn spread(file: &mut TomlFile<'_>, section: &Section<'_, '_>) -> Spread {
    let mut share = |key: &str, usual: f64| section.given(file, key, |v| real(&SHARE, v)).unwrap_or(usual);
    let harmonic = share("harmonic", USUAL_SPREAD.harmonic);
    Spread {
        stiffness: share("stiffness", USUAL_SPREAD.stiffness),
        backlash: share("backlash", USUAL_SPREAD.backlash),
        harmonic,
        harmonic_phase_rad: share("harmonic_phase_rad", harmonic),
    }
}

/// The ratio, and the teeth if they are given instead of it.
fn ratio_and_teeth(file: &mut TomlFile<'_>, drive: &Section<'_, '_>) -> Option<(f64, Option<Teeth>)> {
    match ["flexspline_teeth", "circular_spline_teeth", "ratio"].map(|key| drive.has(key)) {
        [true, true, false] => {
            let f = drive.needed(file, "flexspline_teeth", |v| whole(&TEETH, v))?;
            let more = from(f64::from(f + 1), f64::from(f + MOST_TEETH_MORE));
            let c = drive.needed(file, "circular_spline_teeth", |v| {
                whole(&more, v).map_err(|refused| Refused {
                    what: format!("{}, more than the flexspline's {f}", refused.what),
                    ..refused
                })
            })?;
            let names = [("flexspline", FixedMember::Flexspline), ("circular_spline", FixedMember::CircularSpline)];
            let fixed = match drive.has("fixed") {
                true => drive.needed(file, "fixed", |v| one_of(&names, v))?,
                false => FixedMember::Flexspline,
            };
            let waves = f64::from(c - f);
            let ratio = match fixed {
                FixedMember::Flexspline => f64::from(c) / waves,
                FixedMember::CircularSpline => -f64::from(f) / waves,
            };
            Some((ratio, Some(Teeth { flexspline: f, circular_spline: c, fixed })))
        }
        [false, false, true] => {
            let sizes = from(1.0, LARGEST_RATIO);
            let ratio = drive.needed(file, "ratio", |v| match number(v.get_ref()) {
                Some(ratio) if sizes.refusal(ratio.abs()).is_none() => Ok(ratio),
                _ => Err(Refused::found(v, "1 to 1e6 or -1e6 to -1")),
            })?;
            Some((ratio, None))
        }
        given => {
            let names = ["flexspline_teeth", "circular_spline_teeth", "ratio"];
            let found: Vec<&str> =
                names.into_iter().zip(given).filter(|(_, there)| *there).map(|(name, _)| name).collect();
            let found = if found.is_empty() { "neither".to_owned() } else { found.join(", ") };
            let what = format!("expected flexspline_teeth and circular_spline_teeth, or ratio alone; found {found}");
            file.refuse_whole("drive", what);
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[drive]\nflexspline_teeth = 188\ncircular_spline_teeth = 190\nfixed = \
                        \"flexspline\"\n[nominal]\nstiffness_n_m_per_rad = [[0.0, 20000.0], [10.0, \
                        40000.0]]\nbacklash_arcsec = 60.0\nfriction_torque_n_m = \
                        1.5\n[[nominal.harmonic]]\norder_per_generator_turn = 2.0\namplitude_arcsec = 10.0\nphase_rad \
                        = 0.4\n";

    #[test]
    fn a_file_is_read() {
        let nominal = Nominal::from_toml("n.toml", TEXT).unwrap();
        assert_eq!((nominal.ratio, nominal.temperature_c, nominal.spread), (95.0, 20.0, USUAL_SPREAD));
        assert_eq!(nominal.harmonics.len(), 1);
        let wind_up_rad = nominal.wind_up_arcsec(-30.0) / ARCSEC_PER_RAD;
        assert!((wind_up_rad + 10.0 / 20000.0 + 20.0 / 40000.0).abs() < 1e-15);
        let other = TEXT.replace("fixed = \"flexspline\"", "fixed = \"circular_spline\"");
        assert_eq!(Nominal::from_toml("n.toml", &other).unwrap().ratio, -94.0);
        let by_ratio = "[drive]\nratio = -6.0\n[nominal]\nstiffness_n_m_per_rad = 3e4\nbacklash_arcsec = 60\n";
        let nominal = Nominal::from_toml("n.toml", by_ratio).unwrap();
        assert_eq!((nominal.ratio, nominal.teeth, nominal.friction_torque_n_m), (-6.0, None, 0.0));
        let teeth = |ratio: f64| Nominal { ratio, ..nominal.clone() }.teeth_or_of_two_waves();
        assert_eq!(teeth(95.0), Teeth { flexspline: 188, circular_spline: 190, fixed: FixedMember::Flexspline });
        assert_eq!(teeth(-94.0), Teeth { flexspline: 188, circular_spline: 190, fixed: FixedMember::CircularSpline });
    }

    #[test]
    fn the_template_is_read_back_as_it_stands() {
        let text = Nominal::template(188, 190);
        let nominal = Nominal::from_toml("n.toml", &text).unwrap();
        assert_eq!((nominal.ratio, nominal.backlash_arcsec, nominal.friction_torque_n_m), (95.0, 60.0, 1.5));
        assert_eq!((nominal.stiffness.len(), nominal.harmonics.len(), nominal.spread), (3, 1, USUAL_SPREAD));
        assert_eq!(nominal.teeth.map(|t| t.fixed), Some(FixedMember::Flexspline));
        for key in KEYS {
            assert!(text.contains(key.rsplit('.').next().unwrap()), "the template says nothing of {key}");
        }
        let by_ratio: String = text
            .lines()
            .filter(|line| {
                !["flexspline_teeth", "circular_spline_teeth", "fixed"].iter().any(|key| line.starts_with(key))
            })
            .map(|line| line.replace("# ratio", "ratio") + "\n")
            .collect();
        assert_eq!(Nominal::from_toml("n.toml", &by_ratio).unwrap().ratio, -100.0);
    }

    #[test]
    fn misspelt_keys_get_a_suggestion_all_at_once_and_garbage_gets_none() {
        for (from, to, message) in [
            ("[drive]", "[Drive]", "n.toml:1: Drive: unknown key; did you mean `drive`?; allowed: drive, nominal"),
            (
                "phase_rad",
                "phase_deg",
                "n.toml:12: nominal.harmonic.phase_deg: unknown key; did you mean `nominal.harmonic.phase_rad`?",
            ),
            (
                "fixed = \"flexspline\"",
                "fixed = \"circular-spline\"",
                "n.toml:4: drive.fixed: found \"circular-spline\", allowed: \"flexspline\", \"circular_spline\"; did \
                 you mean `circular_spline`?",
            ),
            ("friction_torque_n_m", "qwertz", "n.toml:8: nominal.qwertz: unknown key; allowed: "),
        ] {
            let text = TEXT.replacen(from, to, 1);
            let error = Nominal::from_toml("n.toml", &text).unwrap_err().to_string();
            assert!(error.starts_with(message), "{to}: {error}");
        }
        let drive = Nominal::from_toml("d.toml", "[flexspline]\nteeth = 188\n[generator]\nw0 = 1\n").unwrap_err();
        assert!(
            drive.problems.len() == 1 && drive.to_string().contains("d.toml: it is the file of a drive"),
            "{drive}"
        );
        let two = TEXT.replace("friction_torque_n_m", "friction_torque").replace("phase_rad", "phase");
        assert_eq!(Nominal::from_toml("n.toml", &two).unwrap_err().problems.len(), 2);
    }
}
