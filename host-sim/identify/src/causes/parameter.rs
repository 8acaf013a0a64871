//! Parameters of causes and of data faults: their names, kinds, ranges and usual values.

use std::f64::consts::TAU;

use serde::Serialize;

table! {
    /// The name of a parameter; the unit is its end.
    #[allow(missing_docs, reason = "the names say it")]
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum ParameterName: (&'static str, Kind) {
        AmplitudeArcsec = ("amplitude_arcsec", Kind::Size),
        AmplitudeUm = ("amplitude_um", Kind::Other),
        AngleRad = ("angle_rad", Kind::Angle),
        ArcsecPerHour = ("arcsec_per_hour", Kind::Other),
        BendPerK = ("bend_per_k", Kind::Other),
        Channel = ("channel", Kind::Count),
        ClearanceArcsecPerK = ("clearance_arcsec_per_k", Kind::Size),
        DampingRatio = ("damping_ratio", Kind::Other),
        DeeperArcsec = ("deeper_arcsec", Kind::Size),
        DelayS = ("delay_s", Kind::Size),
        DepthUm = ("depth_um", Kind::Other),
        DragBendPerK = ("drag_bend_per_k", Kind::Other),
        DragNM = ("drag_n_m", Kind::Size),
        DurationS = ("duration_s", Kind::Other),
        Encoder = ("encoder", Kind::Count),
        Events = ("events", Kind::Count),
        EveryRows = ("every_rows", Kind::Count),
        Exponent = ("exponent", Kind::Other),
        FrequencyHz = ("frequency_hz", Kind::Other),
        FullLoadNM = ("full_load_n_m", Kind::Other),
        Gain = ("gain", Kind::Other),
        GeneratorAmplitudeArcsec = ("generator_amplitude_arcsec", Kind::Other),
        GrowthArcsec = ("growth_arcsec", Kind::Size),
        HalfLashArcsec = ("half_lash_arcsec", Kind::Other),
        HalfLoadNM = ("half_load_n_m", Kind::Other),
        HalfWidthArcsec = ("half_width_arcsec", Kind::Size),
        HardeningArcsec = ("hardening_arcsec", Kind::Size),
        HardeningExponent = ("hardening_exponent", Kind::Other),
        Harmonic = ("harmonic", Kind::Count),
        JitterMs = ("jitter_ms", Kind::Other),
        JumpArcsec = ("jump_arcsec", Kind::Size),
        LagS = ("lag_s", Kind::Other),
        PerK = ("per_k", Kind::Other),
        PhaseRad = ("phase_rad", Kind::Angle),
        PressedArcsec = ("pressed_arcsec", Kind::Other),
        RatioRelativeError = ("ratio_relative_error", Kind::Size),
        RelativeDragPerK = ("relative_drag_per_k", Kind::Other),
        Share = ("share", Kind::Other),
        SizeArcsec = ("size_arcsec", Kind::Other),
        SizeUm = ("size_um", Kind::Other),
        SlipTorqueNM = ("slip_torque_n_m", Kind::Other),
        SpeedExponent = ("speed_exponent", Kind::Other),
        StepArcsec = ("step_arcsec", Kind::Other),
        StepS = ("step_s", Kind::Other),
        StiffnessRatio = ("stiffness_ratio", Kind::Size),
        StiffnessRelativePerK = ("stiffness_relative_per_k", Kind::Size),
        TimeS = ("time_s", Kind::Other),
        Tooth = ("tooth", Kind::Count),
        TorqueNM = ("torque_n_m", Kind::Size),
        Turns = ("turns", Kind::Count),
        Wheel = ("wheel", Kind::Count),
        WidthRad = ("width_rad", Kind::Other),
    }
}

/// Kinds of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A size by which causes are judged: how wrong a law is, is a share of it.
    Size,
    /// A shape, or a size in other units. So is the gain of a resonance: it trades with the damping, while what it adds
    /// is known.
    Other,
    /// The direction of a wave or a place on a wheel, which half a turn brings back: how wrong a law is, is an angle.
    Angle,
    /// A count or a choice: no law is a little wrong about it.
    Count,
}

impl ParameterName {
    /// As it stands in files.
    pub const fn as_str(self) -> &'static str {
        self.row().0
    }

    /// Its kind.
    pub const fn kind(self) -> Kind {
        self.row().1
    }
}

shown_by_name!(ParameterName::as_str);

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
