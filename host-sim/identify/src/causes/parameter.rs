//! Parameters of causes and of data faults: their names, kinds, ranges and usual values.

use std::f64::consts::TAU;
use std::fmt;

use serde::{Serialize, Serializer};

table! {
    /// The name of a parameter; the unit is its end.
    #[allow(missing_docs, reason = "the names say it")]
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
    pub enum ParameterName: &'static str {
        AmplitudeArcsec = "amplitude_arcsec",
        AmplitudeUm = "amplitude_um",
        AngleRad = "angle_rad",
        ArcsecPerHour = "arcsec_per_hour",
        BendPerK = "bend_per_k",
        Channel = "channel",
        ClearanceArcsecPerK = "clearance_arcsec_per_k",
        DampingRatio = "damping_ratio",
        DeeperArcsec = "deeper_arcsec",
        DelayS = "delay_s",
        DepthUm = "depth_um",
        DragBendPerK = "drag_bend_per_k",
        DragNM = "drag_n_m",
        DurationS = "duration_s",
        Encoder = "encoder",
        Events = "events",
        EveryRows = "every_rows",
        Exponent = "exponent",
        FrequencyHz = "frequency_hz",
        FullLoadNM = "full_load_n_m",
        Gain = "gain",
        GeneratorAmplitudeArcsec = "generator_amplitude_arcsec",
        GrowthArcsec = "growth_arcsec",
        HalfLashArcsec = "half_lash_arcsec",
        HalfLoadNM = "half_load_n_m",
        HalfWidthArcsec = "half_width_arcsec",
        HardeningArcsec = "hardening_arcsec",
        HardeningExponent = "hardening_exponent",
        Harmonic = "harmonic",
        JitterMs = "jitter_ms",
        JumpArcsec = "jump_arcsec",
        LagS = "lag_s",
        PerK = "per_k",
        PhaseRad = "phase_rad",
        PressedArcsec = "pressed_arcsec",
        RatioRelativeError = "ratio_relative_error",
        RelativeDragPerK = "relative_drag_per_k",
        Share = "share",
        SizeArcsec = "size_arcsec",
        SizeUm = "size_um",
        SlipTorqueNM = "slip_torque_n_m",
        SpeedExponent = "speed_exponent",
        StepArcsec = "step_arcsec",
        StepS = "step_s",
        StiffnessRatio = "stiffness_ratio",
        StiffnessRelativePerK = "stiffness_relative_per_k",
        TimeS = "time_s",
        Tooth = "tooth",
        TorqueNM = "torque_n_m",
        Turns = "turns",
        Wheel = "wheel",
        WidthRad = "width_rad",
    }
}

/// Kinds of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A size: how wrong a law is, is a share of it.
    Size,
    /// The direction of a wave or a place on a wheel, which half a turn brings back: how wrong a law is, is an angle.
    Angle,
    /// A count or a choice: no law is a little wrong about it.
    Count,
}

impl ParameterName {
    /// As it stands in files.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        self.row()
    }

    /// Its kind.
    #[must_use]
    pub const fn kind(self) -> Kind {
        match self {
            ParameterName::PhaseRad | ParameterName::AngleRad => Kind::Angle,
            ParameterName::Harmonic
            | ParameterName::Tooth
            | ParameterName::Wheel
            | ParameterName::Events
            | ParameterName::EveryRows
            | ParameterName::Turns
            | ParameterName::Encoder
            | ParameterName::Channel => Kind::Count,
            _ => Kind::Size,
        }
    }
}

impl fmt::Display for ParameterName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl Serialize for ParameterName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

/// Value of a parameter that is not given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Usual {
    /// Always this.
    Value(f64),
    /// This share of the largest torque of the data.
    OfLoad(f64),
    /// Drawn evenly between two numbers.
    Drawn(f64, f64),
    /// A time drawn between two shares of the data.
    Instant(f64, f64),
    /// One tooth pitch of the wheel that turns.
    ToothPitch,
    /// Follows from the other form in which the same may be given.
    Follows,
}

/// A parameter of a cause or of a data fault, as it may be given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterSpec {
    /// Name; the unit is its end.
    pub name: ParameterName,
    /// Its description.
    pub meaning: &'static str,
    /// Allowed values, both ends with them.
    pub range: [f64; 2],
    /// Value if it is not given.
    pub usual: Usual,
    /// Words that may stand for 0, 1, 2, ...; none for a number.
    pub words: &'static [&'static str],
}

impl ParameterSpec {
    /// Allowed values, in words.
    #[must_use]
    pub fn allowed(&self) -> String {
        let [low, high] = self.range;
        let words = self.words.join(", ");
        if words.is_empty() { format!("{low} to {high}") } else { format!("{words} (or {low} to {high})") }
    }
}

/// How one form of a parameter follows from another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Factor {
    /// Arcsec for a micrometre along the normal of the flanks.
    AlongNormal,
    /// Arcsec for a micrometre along the pitch circle.
    AlongPitch,
    /// Arcsec for a micrometre of a ring that is pressed to an oval and keeps its length.
    Oval,
    /// Radians for a tooth of the wheel.
    Tooth,
    /// Arcsec at the generator for one at the output.
    Ratio,
}

/// A parameter that is a number.
#[must_use]
pub const fn number(name: ParameterName, meaning: &'static str, low: f64, high: f64, usual: Usual) -> ParameterSpec {
    ParameterSpec { name, meaning, range: [low, high], usual, words: &[] }
}

pub(crate) const fn phase(meaning: &'static str) -> ParameterSpec {
    number(ParameterName::PhaseRad, meaning, -TAU, TAU, Usual::Drawn(0.0, TAU))
}

pub(crate) const fn microns(meaning: &'static str, usual: f64) -> ParameterSpec {
    number(ParameterName::AmplitudeUm, meaning, 0.0, 100.0, Usual::Value(usual))
}

pub(crate) const ARCSECONDS: ParameterSpec =
    number(ParameterName::AmplitudeArcsec, "the same at the output", 0.0, 1000.0, Usual::Follows);
pub(crate) const HALF_LOAD: ParameterSpec =
    number(ParameterName::HalfLoadNM, "load at which more teeth have halved it", 0.01, 1e6, Usual::OfLoad(0.35));
pub(crate) const HARMONIC: ParameterSpec =
    number(ParameterName::Harmonic, "waves around the wheel", 1.0, 12.0, Usual::Value(2.0));
/// The instant of an event.
pub const TIME: ParameterSpec = number(ParameterName::TimeS, "when", -1e9, 1e12, Usual::Instant(0.3, 0.7));
pub(crate) const WHEELS: &[&str] = &["flexspline", "circular_spline"];
/// Words for the parameter `encoder`.
pub(crate) const ENCODERS: &[&str] = &["generator", "output"];
