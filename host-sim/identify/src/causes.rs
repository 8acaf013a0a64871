//! The causes of the library, and everything that belongs to a cause but its laws.
//!
//! A [`CauseName`] says what the cause is called, in words and in files, which orders it makes, what its misfit may be
//! taken for, what data have to hold to speak of it, whether a table or a drive can hold it, and which parameters it
//! has. Every property is an exhaustive match: the compiler asks a new cause for each of them. The laws are not here:
//! the diagnosis fits its own (`crate::diagnosis::candidate`), and [`crate::synthesize`] hides others, so that a
//! mistake in one does not hide in the other.

mod parameter;

use std::f64::consts::TAU;
use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};
use thiserror::Error;

use Multiple::{Fixed, Harmonic, ToothMesh};
use Usual::{Follows, OfLoad, ToothPitch, Value};
use flexspline_base::suggest::did_you_mean;
use flexspline_mechanics::drive::Wheel;
use parameter::{ARCSECONDS, ENCODERS, HALF_LOAD, HARMONIC, WHEELS, microns, phase};
pub use parameter::{Factor, Kind, Parameter, ParameterName, TIME, Usual, number};

macro_rules! causes {
    ($($(#[$doc:meta])* $cause:ident = $name:literal,)*) => {
        /// A physical cause of the library.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum CauseName {
            $($(#[$doc])* $cause,)*
        }

        impl CauseName {
            /// Every cause.
            pub const ALL: &[CauseName] = &[$(CauseName::$cause,)*];

            /// Its name in files, snake case.
            #[must_use]
            pub const fn as_str(self) -> &'static str {
                match self {
                    $(CauseName::$cause => $name,)*
                }
            }
        }
    };
}

causes! {
    /// The axis of the circular spline stands beside that of the generator.
    CircularSplineEccentricity = "circular_spline_eccentricity",
    /// The axis of the flexspline's toothing stands beside that of its bore.
    FlexsplineRunout = "flexspline_runout",
    /// The circular spline is pressed to an oval.
    CircularSplineOvality = "circular_spline_ovality",
    /// The teeth of the flexspline are out of place along the pitch.
    FlexsplinePitchError = "flexspline_pitch_error",
    /// The teeth of the circular spline are out of place along the pitch.
    CircularSplinePitchError = "circular_spline_pitch_error",
    /// The generator stands beside its axis.
    GeneratorEccentricity = "generator_eccentricity",
    /// The generator has another shape than the drawn one.
    CamFormError = "cam_form_error",
    /// A tooth lacks material.
    DamagedTooth = "damaged_tooth",
    /// A tooth of the circular spline is cracked at its root.
    CrackedToothRoot = "cracked_tooth_root",
    /// The clearance is wider throughout the data.
    BacklashGrowth = "backlash_growth",
    /// The clearance widens during the data.
    Wear = "wear",
    /// The drive is stiffer the higher the load.
    StiffnessHardening = "stiffness_hardening",
    /// The drive has another stiffness than the nominal one.
    StiffnessError = "stiffness_error",
    /// Contacts slip inside the drive: the output lags the torque.
    TorsionalHysteresis = "torsional_hysteresis",
    /// The clearance follows the temperature.
    ThermalClearance = "thermal_clearance",
    /// The stiffness follows the temperature.
    ThermalStiffness = "thermal_stiffness",
    /// The lubricant drags the output.
    LubricantViscosity = "lubricant_viscosity",
    /// Gravity turns an unbalanced load, which the torque column does not hold.
    GravityTorque = "gravity_torque",
    /// A weight pushes the circular spline aside.
    GravitySideLoad = "gravity_side_load",
    /// The inertia of the load swings on the spring of the drive.
    TorsionalResonance = "torsional_resonance",
    /// The disc of the output encoder stands off its axis.
    OutputEncoderEccentricity = "output_encoder_eccentricity",
    /// The disc of the generator's encoder stands off its axis.
    GeneratorEncoderEccentricity = "generator_encoder_eccentricity",
    /// The output encoder reads twice around wrong: a tilted disc, a magnet that is not square.
    OutputEncoderTilt = "output_encoder_tilt",
    /// The generator's encoder reads twice around wrong.
    GeneratorEncoderTilt = "generator_encoder_tilt",
    /// An encoder divides its periods unevenly: four and more waves around it.
    EncoderSubdivision = "encoder_subdivision",
    /// The output of a row is older than its generator.
    SensorLatency = "sensor_latency",
    /// The ratio is another one.
    RatioError = "ratio_error",
    /// Teeth have skipped.
    Ratcheting = "ratcheting",
}

/// What the misfit of a law may be taken for: most of all another law of its kin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kin {
    /// Shape and place of wheels and generator: waves of the generator angle.
    Shape,
    /// Follows the torque: springs.
    Torque,
    /// Follows the motion: a reading that comes late.
    Motion,
    /// Follows both: friction inside.
    Friction,
    /// Drag that follows the speed.
    Drag,
    /// Width of the clearance.
    Clearance,
    /// A pulse at a place: what any wrong shape leaves, in time or in angle.
    Pulse,
    /// Like nothing else.
    Unlike,
}

impl Kin {
    /// How much of what one is wrong by may look like the other. That it is all of it for kin is the definition; the
    /// rest is *chosen*, on cases that a state before got wrong (`docs/evidence/diagnosis.md`).
    #[must_use]
    pub(crate) fn share(self, other: Kin) -> f64 {
        match (self, other) {
            (_, Kin::Pulse) | (Kin::Pulse, Kin::Shape) | (Kin::Friction, Kin::Torque) => 1.0,
            (Kin::Friction | Kin::Motion | Kin::Drag, Kin::Friction | Kin::Motion | Kin::Drag) => 1.0,
            (Kin::Unlike, _) | (_, Kin::Unlike) => 0.5,
            (a, b) if a == b => 1.0,
            // What a spring's law is wrong by goes with the torque alone: it opens no loop and follows no motion.
            (Kin::Torque, _) => 0.25,
            _ => 0.5,
        }
    }
}

/// What data have to hold to speak of a cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Need {
    /// The numbers of teeth.
    Teeth,
    /// Enough generator turns that a place comes again.
    Turns,
    /// A load on the output, and its column.
    Load,
    /// A spring in the nominal model.
    Spring,
    /// The temperature.
    Temperature,
    /// Temperatures apart from each other, or from the nominal one.
    TemperatureSpan,
    /// The time.
    Time,
    /// A generator that moves.
    Motion,
    /// A speed or a load that changes fast enough to make a load swing, in rows that are read at one instant.
    Swings,
    /// An output that turns through half a turn.
    HalfOutputTurn,
    /// So much use that a drive may have worn meanwhile.
    Use,
    /// A lasting jump of the error by whole teeth.
    Jump,
}

impl Need {
    /// Why the cause cannot be judged without it.
    #[must_use]
    pub const fn missing(self) -> &'static str {
        match self {
            Need::Teeth => "the model gives a ratio and no numbers of teeth",
            Need::Turns => "the generator makes too few turns for one place to come again",
            Need::Load => "no load was recorded",
            Need::Spring => "the nominal model does not wind up",
            Need::Temperature => "no temperature was recorded",
            Need::TemperatureSpan => "the temperature stays close to the nominal one",
            Need::Time => "no time was recorded",
            Need::Motion => "the generator does not move",
            Need::Swings => {
                "speed and load stay as they are, or rows are means over some time: no load is seen to swing"
            }
            Need::HalfOutputTurn => "the output turns through less than half a turn",
            Need::Use => "the drive is used too little for wear in between",
            Need::Jump => "the error has no lasting jump by whole teeth",
        }
    }

    /// What would have to be recorded, or given; nothing that a new recording brings about at will.
    #[must_use]
    pub(crate) const fn remedy(self) -> Option<&'static str> {
        match self {
            Need::Teeth => Some("give the numbers of teeth in the nominal model"),
            Need::Turns => Some("record a dozen generator turns or more in one piece"),
            Need::Load => Some("load the output, and record the torque (torque_n_m)"),
            Need::Spring => Some("give the stiffness in the nominal model"),
            Need::Temperature => Some("record the temperature (temperature_c), cold and warm"),
            Need::TemperatureSpan => Some("record sessions at temperatures that differ by 20 K or more"),
            Need::Time => Some("record the time of each row (time_s)"),
            Need::Motion => Some("record the drive in motion, at several speeds"),
            Need::Swings => {
                Some("record steps of the load, stops and starts, and several speeds, each row read at one instant")
            }
            Need::HalfOutputTurn => Some("turn the output through a whole turn"),
            Need::Use => Some("record again after hours of use, with the same zero"),
            Need::Jump => None,
        }
    }
}

/// What an order is counted against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// The wave on the flexspline.
    Flexspline,
    /// The wave on the circular spline.
    CircularSpline,
    /// The wave on the wheel that the parameter `wheel` names.
    OfWheel,
    /// The generator.
    Generator,
    /// The output.
    Output,
    /// Generator or output, as the parameter `encoder` says.
    OfEncoder,
}

/// How often a wave comes in a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Multiple {
    /// So often.
    Fixed(f64),
    /// As the parameter `harmonic` says; without it once and twice.
    Harmonic,
    /// As often as the flexspline has teeth.
    ToothMesh,
}

/// Whether a table can hold a cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum InTable {
    /// It can.
    Yes,
    /// It can where the drive stays at one angle against gravity.
    AtOneOrientation,
    /// It cannot, and why.
    No(&'static str),
}

/// The field of a drive file that holds a cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DriveField {
    /// Eccentricity of the circular spline.
    CircularSplineEccentricity,
    /// Runout of the flexspline.
    FlexsplineRunout,
    /// Offset of the circular spline in a fixed direction; only of a drive that stays at one angle against gravity.
    CircularSplineOffset,
    /// Oval of the circular spline.
    CircularSplineOvality,
    /// Harmonics of the pitch of a wheel.
    PitchHarmonics(Wheel),
    /// A damaged tooth.
    DamagedTooth,
    /// Wear of the flanks of both wheels.
    FlankWear,
    /// Expansion of circular spline and housing.
    Expansion,
    /// Stiffness: of the sleeve where the drive is softer, of the material where it is stiffer.
    Stiffness,
    /// Change of Young's modulus with temperature.
    StiffnessPerKelvin,
}

/// No cause has this name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "found \"{found}\"{}; allowed: {}",
    did_you_mean("; ", found, CauseName::ALL.iter().map(|cause| cause.as_str())),
    CauseName::ALL.iter().map(|cause| cause.as_str()).collect::<Vec<_>>().join(", ")
)]
pub struct UnknownCause {
    /// The name found.
    pub found: String,
}

impl FromStr for CauseName {
    type Err = UnknownCause;
    fn from_str(name: &str) -> Result<CauseName, UnknownCause> {
        let known = CauseName::ALL.iter().find(|cause| cause.as_str() == name);
        known.copied().ok_or_else(|| UnknownCause { found: name.to_owned() })
    }
}

impl fmt::Display for CauseName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl Serialize for CauseName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl CauseName {
    /// What it is called in a sentence.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            CauseName::CircularSplineEccentricity => "eccentricity of the circular spline",
            CauseName::FlexsplineRunout => "runout of the flexspline",
            CauseName::CircularSplineOvality => "oval circular spline",
            CauseName::FlexsplinePitchError => "pitch error of the flexspline",
            CauseName::CircularSplinePitchError => "pitch error of the circular spline",
            CauseName::GeneratorEccentricity => "eccentricity of the generator",
            CauseName::CamFormError => "form error of the generator",
            CauseName::DamagedTooth => "damaged tooth",
            CauseName::CrackedToothRoot => "cracked tooth root",
            CauseName::BacklashGrowth => "wider backlash",
            CauseName::Wear => "wear",
            CauseName::StiffnessHardening => "hardening stiffness",
            CauseName::StiffnessError => "other stiffness",
            CauseName::TorsionalHysteresis => "torsional hysteresis",
            CauseName::ThermalClearance => "clearance with temperature",
            CauseName::ThermalStiffness => "stiffness with temperature",
            CauseName::LubricantViscosity => "drag of the lubricant",
            CauseName::GravityTorque => "unbalanced load",
            CauseName::GravitySideLoad => "side load by gravity",
            CauseName::TorsionalResonance => "torsional resonance",
            CauseName::OutputEncoderEccentricity => "eccentricity of the output encoder",
            CauseName::GeneratorEncoderEccentricity => "eccentricity of the generator encoder",
            CauseName::OutputEncoderTilt => "tilt of the output encoder",
            CauseName::GeneratorEncoderTilt => "tilt of the generator encoder",
            CauseName::EncoderSubdivision => "subdivision error of an encoder",
            CauseName::SensorLatency => "time between the sensors",
            CauseName::RatioError => "another ratio",
            CauseName::Ratcheting => "ratcheting",
        }
    }

    /// What it does to the error, in a few words.
    #[must_use]
    pub const fn does(self) -> &'static str {
        match self {
            CauseName::CircularSplineEccentricity => {
                "its axis beside the axis of the generator: two waves in a turn of the generator against the circular \
                 spline"
            }
            CauseName::FlexsplineRunout => "its axis beside the axis of the generator: two waves in a generator turn",
            CauseName::CircularSplineOvality => "pressed out of round: two waves in a turn against the circular spline",
            CauseName::FlexsplinePitchError => "teeth out of place: whole orders of the generator turn",
            CauseName::CircularSplinePitchError => {
                "teeth out of place: whole orders of a turn against the circular spline"
            }
            CauseName::GeneratorEccentricity => "one lobe carries more: odd orders, once in a turn above all",
            CauseName::CamFormError => {
                "a shape that is not the drawn one: tooth mesh and even orders of the generator turn"
            }
            CauseName::DamagedTooth => "a pulse each time a lobe passes one place",
            CauseName::CrackedToothRoot => {
                "softer each time a lobe passes one tooth of the circular spline: nothing there without load"
            }
            CauseName::BacklashGrowth => "more clearance than nominal throughout the data",
            CauseName::Wear => "a clearance that widens from the first row to the last",
            CauseName::StiffnessHardening => "stiffer the higher the load",
            CauseName::StiffnessError => "wind-up in proportion to nominal, of another size",
            CauseName::TorsionalHysteresis => "the output lags the torque by what slipping contacts hold",
            CauseName::ThermalClearance => "backlash that follows the temperature",
            CauseName::ThermalStiffness => "wind-up that follows the temperature",
            CauseName::LubricantViscosity => "a load against the motion that grows with speed and cold",
            CauseName::GravityTorque => "gravity on the load, which the torque column does not hold",
            CauseName::GravitySideLoad => "a weight that pushes the wheels out of centre",
            CauseName::TorsionalResonance => "the inertia of the load on the spring of the drive",
            CauseName::OutputEncoderEccentricity => "one wave in an output turn, whatever the load",
            CauseName::GeneratorEncoderEccentricity => "one wave in a generator turn, whatever the load",
            CauseName::OutputEncoderTilt => "two waves in an output turn, whatever the load",
            CauseName::GeneratorEncoderTilt => {
                "two waves in a generator turn, the same on both flanks and under any load"
            }
            CauseName::EncoderSubdivision => {
                "four waves or a multiple in a turn of an encoder, whatever the load and the speed"
            }
            CauseName::SensorLatency => {
                "output and generator are read at different instants: an error in proportion to speed"
            }
            CauseName::RatioError => "the error grows with the angle",
            CauseName::Ratcheting => "teeth that skipped",
        }
    }

    /// What it is, where it is hidden in made-up data.
    #[must_use]
    pub const fn meaning(self) -> &'static str {
        match self {
            CauseName::CircularSplineEccentricity => "toothing of the circular spline beside the axis it turns about",
            CauseName::FlexsplineRunout => "toothing of the flexspline beside the axis of its bore",
            CauseName::CircularSplineOvality => "circular spline pressed to an oval that keeps its length",
            CauseName::FlexsplinePitchError => "cumulative pitch error of the flexspline",
            CauseName::CircularSplinePitchError => "cumulative pitch error of the circular spline",
            CauseName::GeneratorEccentricity => "generator beside its axis: one lobe carries more",
            CauseName::CamFormError => "form error of the generator",
            CauseName::DamagedTooth => "a tooth that lacks material",
            CauseName::CrackedToothRoot => "a tooth of the circular spline that bends more than its neighbours",
            CauseName::BacklashGrowth => "a wider clearance throughout",
            CauseName::Wear => "a clearance that widens with travel",
            CauseName::StiffnessHardening => "stiffer the higher the load",
            CauseName::StiffnessError => "another stiffness than nominal",
            CauseName::TorsionalHysteresis => "springs that slip: the output lags the torque",
            CauseName::ThermalClearance => "a clearance that follows the temperature",
            CauseName::ThermalStiffness => "a stiffness that follows the temperature",
            CauseName::LubricantViscosity => {
                "drag of the lubricant on the output, that the torque column does not hold"
            }
            CauseName::GravityTorque => "an unbalanced load that the torque column does not hold",
            CauseName::GravitySideLoad => "weight that pushes the circular spline aside",
            CauseName::TorsionalResonance => "the load's inertia on the drive's spring",
            CauseName::OutputEncoderEccentricity => "disc of the output encoder off its axis",
            CauseName::GeneratorEncoderEccentricity => "disc of the generator's encoder off its axis",
            CauseName::OutputEncoderTilt => "output encoder that is tilted, or whose magnet is not square on its axis",
            CauseName::GeneratorEncoderTilt => {
                "generator's encoder that is tilted, or whose magnet is not square on its axis"
            }
            CauseName::EncoderSubdivision => "an encoder that divides its periods unevenly",
            CauseName::SensorLatency => "the output's reading is older than the generator's",
            CauseName::RatioError => "an error in proportion to the output angle",
            CauseName::Ratcheting => "teeth that skip",
        }
    }

    /// What its misfit may be taken for.
    #[must_use]
    pub(crate) const fn kin(self) -> Kin {
        match self {
            CauseName::CircularSplineEccentricity
            | CauseName::FlexsplineRunout
            | CauseName::CircularSplineOvality
            | CauseName::FlexsplinePitchError
            | CauseName::CircularSplinePitchError
            | CauseName::GeneratorEccentricity
            | CauseName::GravitySideLoad
            // Wheels make waves of the generator angle, too.
            | CauseName::GeneratorEncoderTilt => Kin::Shape,
            CauseName::DamagedTooth | CauseName::CrackedToothRoot => Kin::Pulse,
            CauseName::StiffnessHardening
            | CauseName::StiffnessError
            | CauseName::ThermalStiffness
            | CauseName::GravityTorque => Kin::Torque,
            CauseName::SensorLatency => Kin::Motion,
            CauseName::TorsionalHysteresis => Kin::Friction,
            CauseName::LubricantViscosity => Kin::Drag,
            CauseName::BacklashGrowth | CauseName::Wear | CauseName::ThermalClearance => Kin::Clearance,
            // The tooth mesh is an order of its own; the rest is like nothing that a drive does.
            CauseName::CamFormError
            | CauseName::TorsionalResonance
            | CauseName::OutputEncoderEccentricity
            | CauseName::GeneratorEncoderEccentricity
            | CauseName::OutputEncoderTilt
            | CauseName::EncoderSubdivision
            | CauseName::RatioError
            | CauseName::Ratcheting => Kin::Unlike,
        }
    }

    /// What data have to hold to speak of it.
    #[must_use]
    pub(crate) const fn needs(self) -> &'static [Need] {
        match self {
            CauseName::CircularSplineEccentricity
            | CauseName::FlexsplineRunout
            | CauseName::CircularSplineOvality
            | CauseName::FlexsplinePitchError
            | CauseName::CircularSplinePitchError
            | CauseName::GeneratorEccentricity
            | CauseName::CamFormError
            | CauseName::GravitySideLoad => &[Need::Teeth],
            CauseName::DamagedTooth => &[Need::Teeth, Need::Turns],
            CauseName::CrackedToothRoot => &[Need::Teeth, Need::Turns, Need::Load],
            CauseName::StiffnessHardening | CauseName::StiffnessError | CauseName::TorsionalHysteresis => &[Need::Load],
            CauseName::ThermalClearance => &[Need::Temperature, Need::TemperatureSpan],
            CauseName::ThermalStiffness => &[Need::Temperature, Need::TemperatureSpan, Need::Load],
            CauseName::LubricantViscosity => &[Need::Time, Need::Motion],
            CauseName::GravityTorque => &[Need::Spring],
            CauseName::TorsionalResonance => &[Need::Time, Need::Swings],
            CauseName::SensorLatency => &[Need::Time],
            CauseName::Ratcheting => &[Need::Teeth, Need::Jump],
            CauseName::Wear => &[Need::Use],
            CauseName::BacklashGrowth
            | CauseName::OutputEncoderEccentricity
            | CauseName::GeneratorEncoderEccentricity
            | CauseName::GeneratorEncoderTilt
            | CauseName::EncoderSubdivision
            | CauseName::RatioError => &[],
            CauseName::OutputEncoderTilt => &[Need::HalfOutputTurn],
        }
    }

    /// The orders that it makes, each counted against a turn: for marks in spectra.
    #[must_use]
    pub const fn orders(self) -> &'static [(Turn, Multiple)] {
        match self {
            CauseName::CircularSplineEccentricity => {
                &[(Turn::CircularSpline, Fixed(2.0)), (Turn::CircularSpline, Fixed(4.0))]
            }
            CauseName::FlexsplineRunout => &[(Turn::Flexspline, Fixed(2.0)), (Turn::Flexspline, Fixed(4.0))],
            CauseName::CircularSplineOvality => &[(Turn::CircularSpline, Fixed(2.0))],
            CauseName::FlexsplinePitchError => &[(Turn::Flexspline, Harmonic)],
            CauseName::CircularSplinePitchError => &[(Turn::CircularSpline, Harmonic)],
            CauseName::GeneratorEccentricity => &[(Turn::Flexspline, Fixed(1.0)), (Turn::CircularSpline, Fixed(1.0))],
            CauseName::CamFormError => {
                &[(Turn::Generator, Fixed(4.0)), (Turn::Generator, Fixed(6.0)), (Turn::Generator, ToothMesh)]
            }
            CauseName::DamagedTooth => {
                &[(Turn::OfWheel, Fixed(2.0)), (Turn::OfWheel, Fixed(4.0)), (Turn::OfWheel, Fixed(6.0))]
            }
            CauseName::CrackedToothRoot => &[
                (Turn::CircularSpline, Fixed(2.0)),
                (Turn::CircularSpline, Fixed(4.0)),
                (Turn::CircularSpline, Fixed(6.0)),
            ],
            CauseName::GravitySideLoad => &[(Turn::Generator, Fixed(2.0)), (Turn::Generator, Fixed(4.0))],
            CauseName::GeneratorEncoderEccentricity => &[(Turn::Generator, Fixed(1.0))],
            CauseName::GeneratorEncoderTilt => &[(Turn::Generator, Fixed(2.0))],
            CauseName::OutputEncoderTilt => &[(Turn::Output, Fixed(2.0))],
            CauseName::EncoderSubdivision => &[(Turn::OfEncoder, Harmonic)],
            CauseName::OutputEncoderEccentricity | CauseName::GravityTorque => &[(Turn::Output, Fixed(1.0))],
            // They follow load, time, temperature or speed.
            CauseName::BacklashGrowth
            | CauseName::Wear
            | CauseName::StiffnessHardening
            | CauseName::StiffnessError
            | CauseName::TorsionalHysteresis
            | CauseName::ThermalClearance
            | CauseName::ThermalStiffness
            | CauseName::LubricantViscosity
            | CauseName::TorsionalResonance
            | CauseName::SensorLatency
            | CauseName::RatioError
            | CauseName::Ratcheting => &[],
        }
    }

    /// Whether something that is no cause of the library makes just the same, whatever is recorded: a shaft that is
    /// bent or misaligned before the encoder of the output, two waves in a turn like an encoder that is tilted.
    #[must_use]
    pub(crate) const fn has_a_double_outside(self) -> bool {
        matches!(self, CauseName::OutputEncoderTilt)
    }

    /// Whether a load on the output makes much the same: an error that goes with the speed, the direction or the angle
    /// of the output.
    #[must_use]
    pub(crate) const fn is_made_by_loads(self) -> bool {
        matches!(
            self,
            CauseName::SensorLatency
                | CauseName::LubricantViscosity
                | CauseName::TorsionalHysteresis
                | CauseName::TorsionalResonance
                | CauseName::BacklashGrowth
                | CauseName::GravityTorque
                | CauseName::OutputEncoderEccentricity
                | CauseName::RatioError
        )
    }

    /// Why a table holds no error of the output's encoder.
    pub(crate) const OF_THE_OUTPUT_ENCODER: &'static str = "the output's encoder is wrong here, not the joint";

    /// Whether a table can hold it.
    #[must_use]
    pub(crate) const fn in_table(self) -> InTable {
        match self {
            CauseName::CircularSplineEccentricity
            | CauseName::FlexsplineRunout
            | CauseName::CircularSplineOvality
            | CauseName::FlexsplinePitchError
            | CauseName::CircularSplinePitchError
            | CauseName::GeneratorEccentricity
            | CauseName::CamFormError
            | CauseName::DamagedTooth
            | CauseName::CrackedToothRoot
            | CauseName::BacklashGrowth
            | CauseName::StiffnessHardening
            | CauseName::StiffnessError
            | CauseName::ThermalClearance
            | CauseName::ThermalStiffness
            | CauseName::GeneratorEncoderEccentricity
            | CauseName::GeneratorEncoderTilt
            | CauseName::EncoderSubdivision => InTable::Yes,
            CauseName::OutputEncoderEccentricity | CauseName::OutputEncoderTilt => {
                InTable::No(Self::OF_THE_OUTPUT_ENCODER)
            }
            CauseName::GravityTorque | CauseName::GravitySideLoad => InTable::AtOneOrientation,
            CauseName::SensorLatency | CauseName::LubricantViscosity => {
                InTable::No("it follows the speed, and a table knows none")
            }
            CauseName::TorsionalResonance => {
                InTable::No("it follows the motion in time, and a table knows steady motion alone")
            }
            CauseName::TorsionalHysteresis => {
                InTable::No("it depends on the torques before, and a table knows the present one alone")
            }
            CauseName::Ratcheting => InTable::No("it happens at an instant"),
            CauseName::RatioError => InTable::No("it grows from turn to turn, and a table repeats"),
            CauseName::Wear => InTable::No("it grows with use, and a table stays"),
        }
    }

    /// Why no table holds it, whatever the drive, if none does.
    #[must_use]
    pub(crate) const fn no_place_in_a_table(self) -> Option<&'static str> {
        match self.in_table() {
            InTable::No(why) => Some(why),
            InTable::Yes | InTable::AtOneOrientation => None,
        }
    }

    /// The field of a drive file that holds it, if one does.
    #[must_use]
    pub(crate) const fn drive_field(self) -> Option<DriveField> {
        match self {
            CauseName::CircularSplineEccentricity => Some(DriveField::CircularSplineEccentricity),
            CauseName::FlexsplineRunout => Some(DriveField::FlexsplineRunout),
            CauseName::GravitySideLoad => Some(DriveField::CircularSplineOffset),
            CauseName::CircularSplineOvality => Some(DriveField::CircularSplineOvality),
            CauseName::FlexsplinePitchError => Some(DriveField::PitchHarmonics(Wheel::Flexspline)),
            CauseName::CircularSplinePitchError => Some(DriveField::PitchHarmonics(Wheel::CircularSpline)),
            CauseName::DamagedTooth => Some(DriveField::DamagedTooth),
            CauseName::BacklashGrowth | CauseName::Wear => Some(DriveField::FlankWear),
            CauseName::ThermalClearance => Some(DriveField::Expansion),
            CauseName::StiffnessError => Some(DriveField::Stiffness),
            CauseName::ThermalStiffness => Some(DriveField::StiffnessPerKelvin),
            CauseName::GeneratorEccentricity
            | CauseName::CamFormError
            | CauseName::StiffnessHardening
            | CauseName::TorsionalHysteresis
            | CauseName::LubricantViscosity
            | CauseName::GravityTorque
            | CauseName::TorsionalResonance
            | CauseName::OutputEncoderEccentricity
            | CauseName::GeneratorEncoderEccentricity
            | CauseName::OutputEncoderTilt
            | CauseName::GeneratorEncoderTilt
            | CauseName::EncoderSubdivision
            | CauseName::SensorLatency
            | CauseName::RatioError
            | CauseName::CrackedToothRoot
            | CauseName::Ratcheting => None,
        }
    }

    /// Its parameters as they may be given, under the names that the diagnosis reports.
    #[must_use]
    pub(crate) const fn parameters(self) -> &'static [Parameter] {
        use ParameterName as Name;
        match self {
            CauseName::CircularSplineEccentricity => {
                const { &[microns("how far", 10.0), ARCSECONDS, phase("whereto, on the circular spline"), HALF_LOAD] }
            }
            CauseName::FlexsplineRunout => {
                const { &[microns("how far", 10.0), ARCSECONDS, phase("whereto, on the flexspline"), HALF_LOAD] }
            }
            CauseName::GravitySideLoad => {
                const { &[microns("how far", 10.0), ARCSECONDS, phase("whereto, against gravity"), HALF_LOAD] }
            }
            CauseName::CircularSplineOvality => {
                const {
                    &[
                        microns("of the radius", 8.0),
                        ARCSECONDS,
                        phase("angle of a crest of what both flanks have alike"),
                    ]
                }
            }
            CauseName::FlexsplinePitchError | CauseName::CircularSplinePitchError => {
                const { &[microns("along the pitch", 5.0), ARCSECONDS, HARMONIC, phase("angle of a crest of the error")] }
            }
            CauseName::GeneratorEccentricity => {
                const {
                    &[
                        microns("once around each wheel: what the deeper lobe shows of the teeth", 2.0),
                        ARCSECONDS,
                        phase("whereto, on the generator"),
                        number(
                            Name::DeeperArcsec,
                            "how much deeper one lobe is: what it takes of the clearance at either flank",
                            0.0,
                            1000.0,
                            Value(20.0),
                        ),
                        HALF_LOAD,
                    ]
                }
            }
            CauseName::CamFormError => {
                const { &[microns("of the error it makes", 3.0), ARCSECONDS, phase("of the form")] }
            }
            CauseName::DamagedTooth => {
                const {
                    &[
                        number(Name::DepthUm, "depth that lacks, along the normal", 0.0, 500.0, Value(10.0)),
                        number(
                            Name::AmplitudeArcsec,
                            "the same at the output, under the largest load",
                            0.0,
                            3000.0,
                            Follows,
                        ),
                        Parameter {
                            words: WHEELS,
                            ..number(Name::Wheel, "0 flexspline, 1 circular spline", 0.0, 1.0, Value(0.0))
                        },
                        number(Name::Tooth, "which one, from 0", 0.0, 2000.0, Value(40.0)),
                        number(Name::AngleRad, "the same as an angle on the wheel", -TAU, TAU, Follows),
                        number(Name::WidthRad, "half the arc over which it is felt", 0.02, 0.6, Value(0.15)),
                    ]
                }
            }
            CauseName::CrackedToothRoot => {
                const {
                    &[
                        number(
                            Name::AmplitudeArcsec,
                            "by which it winds up more at the full load",
                            0.0,
                            1000.0,
                            Value(30.0),
                        ),
                        number(Name::FullLoadNM, "the torque at which it is stated", 1e-3, 1e6, OfLoad(1.0)),
                        number(
                            Name::AngleRad,
                            "where the tooth, or the one opposite, is on the circular spline",
                            -TAU,
                            TAU,
                            Value(1.2),
                        ),
                        number(Name::WidthRad, "half the arc over which it is felt", 0.02, 0.6, Value(0.15)),
                    ]
                }
            }
            CauseName::BacklashGrowth => {
                const { &[number(Name::GrowthArcsec, "whole width over nominal", 0.0, 10_000.0, Value(40.0))] }
            }
            CauseName::Wear => {
                const { &[number(Name::GrowthArcsec, "whole width, first row to last", 0.0, 10_000.0, Value(40.0))] }
            }
            CauseName::StiffnessHardening => {
                const {
                    &[
                        number(
                            Name::HardeningArcsec,
                            "by which the wind-up falls short at the full load",
                            0.0,
                            1000.0,
                            Value(20.0),
                        ),
                        number(Name::HardeningExponent, "of the torque", 1.2, 8.0, Value(3.0)),
                        number(Name::FullLoadNM, "the torque at which it is stated", 1e-3, 1e6, OfLoad(1.0)),
                    ]
                }
            }
            CauseName::StiffnessError => {
                const { &[number(Name::StiffnessRatio, "true over nominal", 0.05, 20.0, Value(0.8))] }
            }
            CauseName::TorsionalHysteresis => {
                const {
                    &[
                        number(
                            Name::HalfWidthArcsec,
                            "half the opening of the large loop at zero torque",
                            0.0,
                            1000.0,
                            Value(15.0),
                        ),
                        number(Name::SlipTorqueNM, "at which the middle spring slips", 1e-3, 1e6, OfLoad(0.2)),
                    ]
                }
            }
            CauseName::ThermalClearance => {
                const {
                    &[
                        number(Name::ClearanceArcsecPerK, "whole width, wider when warm", -50.0, 50.0, Value(-1.0)),
                        number(Name::LagS, "with which it follows", 0.0, 1e5, Value(0.0)),
                    ]
                }
            }
            CauseName::ThermalStiffness => {
                const { &[number(Name::StiffnessRelativePerK, "of the stiffness", -0.02, 0.02, Value(-0.004))] }
            }
            CauseName::LubricantViscosity => {
                const {
                    &[
                        number(Name::DragNM, "at the mean speed and the nominal temperature", 0.0, 1e5, OfLoad(0.1)),
                        number(Name::SpeedExponent, "of the speed", 0.2, 1.2, Value(2.0 / 3.0)),
                        number(Name::RelativeDragPerK, "of the drag", -0.15, 0.0, Value(-0.035)),
                    ]
                }
            }
            CauseName::GravityTorque => {
                const {
                    &[
                        number(Name::TorqueNM, "m g l", 0.0, 1e5, OfLoad(0.2)),
                        phase("of sin(output + orientation + phase)"),
                    ]
                }
            }
            CauseName::TorsionalResonance => {
                const {
                    &[
                        number(Name::FrequencyHz, "of the free oscillation", 0.1, 1000.0, Value(8.0)),
                        number(Name::DampingRatio, "of critical damping", 0.001, 0.9, Value(0.03)),
                    ]
                }
            }
            CauseName::OutputEncoderEccentricity => {
                const {
                    &[
                        number(Name::AmplitudeArcsec, "at the output", 0.0, 10_000.0, Value(20.0)),
                        phase("of sin(output + phase)"),
                    ]
                }
            }
            CauseName::GeneratorEncoderEccentricity => {
                const {
                    &[
                        number(Name::AmplitudeArcsec, "at the output", 0.0, 1000.0, Value(10.0)),
                        number(Name::GeneratorAmplitudeArcsec, "the same at the generator", 0.0, 1e5, Follows),
                        phase("of sin(generator + phase)"),
                    ]
                }
            }
            CauseName::OutputEncoderTilt => {
                const {
                    &[
                        number(Name::AmplitudeArcsec, "at the output", 0.0, 10_000.0, Value(15.0)),
                        phase("of sin(2 output + phase)"),
                    ]
                }
            }
            CauseName::GeneratorEncoderTilt => {
                const {
                    &[
                        number(Name::AmplitudeArcsec, "at the output", 0.0, 1000.0, Value(8.0)),
                        number(Name::GeneratorAmplitudeArcsec, "the same at the generator", 0.0, 1e5, Follows),
                        phase("of sin(2 generator + phase)"),
                    ]
                }
            }
            CauseName::EncoderSubdivision => {
                const {
                    &[
                        number(Name::AmplitudeArcsec, "at the output", 0.0, 1000.0, Value(6.0)),
                        number(Name::GeneratorAmplitudeArcsec, "the same at the generator", 0.0, 1e5, Follows),
                        number(Name::Harmonic, "waves in a turn of the encoder", 3.0, 65_536.0, Value(4.0)),
                        Parameter {
                            words: ENCODERS,
                            ..number(Name::Encoder, "0 generator, 1 output", 0.0, 1.0, Value(0.0))
                        },
                        phase("of sin(harmonic angle + phase)"),
                    ]
                }
            }
            CauseName::SensorLatency => {
                const { &[number(Name::DelayS, "positive: the output's is older", -0.1, 0.1, Value(0.002))] }
            }
            CauseName::RatioError => {
                const { &[number(Name::RatioRelativeError, "of the output angle", -0.01, 0.01, Value(1e-4))] }
            }
            CauseName::Ratcheting => {
                const { &[number(Name::JumpArcsec, "of the output, whole teeth", -1e5, 1e5, ToothPitch), TIME] }
            }
        }
    }

    /// Two parameters that say the same, and the factor from the first to the second.
    #[must_use]
    pub(crate) const fn twins(self) -> &'static [(ParameterName, ParameterName, Factor)] {
        use ParameterName as Name;
        match self {
            CauseName::CircularSplineEccentricity | CauseName::FlexsplineRunout | CauseName::GravitySideLoad => {
                &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongNormal)]
            }
            CauseName::FlexsplinePitchError
            | CauseName::CircularSplinePitchError
            | CauseName::GeneratorEccentricity
            | CauseName::CamFormError => &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongPitch)],
            CauseName::CircularSplineOvality => &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::Oval)],
            CauseName::DamagedTooth => &[
                (Name::DepthUm, Name::AmplitudeArcsec, Factor::AlongNormal),
                (Name::Tooth, Name::AngleRad, Factor::Tooth),
            ],
            CauseName::GeneratorEncoderEccentricity
            | CauseName::GeneratorEncoderTilt
            | CauseName::EncoderSubdivision => {
                &[(Name::AmplitudeArcsec, Name::GeneratorAmplitudeArcsec, Factor::Ratio)]
            }
            CauseName::BacklashGrowth
            | CauseName::Wear
            | CauseName::StiffnessHardening
            | CauseName::StiffnessError
            | CauseName::TorsionalHysteresis
            | CauseName::ThermalClearance
            | CauseName::ThermalStiffness
            | CauseName::LubricantViscosity
            | CauseName::GravityTorque
            | CauseName::TorsionalResonance
            | CauseName::OutputEncoderEccentricity
            | CauseName::OutputEncoderTilt
            | CauseName::SensorLatency
            | CauseName::RatioError
            | CauseName::CrackedToothRoot
            | CauseName::Ratcheting => &[],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_reads_back_and_a_misspelt_one_gets_a_suggestion() {
        for cause in CauseName::ALL {
            assert_eq!(cause.as_str().parse(), Ok(*cause));
            assert_eq!(serde_json::to_value(cause).unwrap(), cause.as_str());
        }
        let error = "circular_spline_ecentricity".parse::<CauseName>().unwrap_err().to_string();
        let begins =
            "found \"circular_spline_ecentricity\"; did you mean `circular_spline_eccentricity`?; allowed: circular";
        assert!(error.starts_with(begins), "{error}");
        assert!("qwertz".parse::<CauseName>().unwrap_err().to_string().starts_with("found \"qwertz\"; allowed: "));
    }

    #[test]
    fn no_two_causes_share_a_name_and_none_shows_its_file_name_to_a_reader() {
        let names: std::collections::HashSet<&str> = CauseName::ALL.iter().map(|cause| cause.as_str()).collect();
        assert_eq!(names.len(), CauseName::ALL.len());
        for cause in CauseName::ALL {
            let said = [cause.words(), cause.does(), cause.meaning()];
            assert!(said.iter().all(|words| !words.is_empty() && !words.contains('_')), "{cause}: {said:?}");
        }
    }

    #[test]
    fn usual_values_are_allowed_and_twins_are_parameters() {
        for cause in CauseName::ALL {
            for parameter in cause.parameters() {
                let [low, high] = parameter.range;
                if let Value(value) = parameter.usual {
                    assert!((low..=high).contains(&value), "{cause} {}", parameter.name);
                }
            }
            let has = |name: ParameterName| cause.parameters().iter().any(|parameter| parameter.name == name);
            assert!(cause.twins().iter().all(|(a, b, _)| has(*a) && has(*b)), "{cause}");
        }
    }

    #[test]
    fn what_follows_speed_time_or_the_past_has_no_place_in_a_table() {
        for cause in [
            CauseName::SensorLatency,
            CauseName::TorsionalResonance,
            CauseName::TorsionalHysteresis,
            CauseName::Ratcheting,
            CauseName::RatioError,
            CauseName::OutputEncoderEccentricity,
            CauseName::OutputEncoderTilt,
        ] {
            assert!(cause.no_place_in_a_table().is_some(), "{cause}");
        }
        for cause in
            [CauseName::CircularSplineEccentricity, CauseName::BacklashGrowth, CauseName::GeneratorEncoderEccentricity]
        {
            assert!(cause.no_place_in_a_table().is_none(), "{cause}");
        }
    }
}
