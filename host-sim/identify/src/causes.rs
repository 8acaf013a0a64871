//! The causes of the library.
//!
//! A [`CauseName`] is the name of a cause. All else that there is of it is one value, its `CauseSpec`, next to its law
//! in a file of `crate::diagnosis::candidate`: words, needs, parameters, place in a table and in a drive, the
//! laws that the diagnosis fits, and the one that [`crate::synthesize`] hides. The list below has a line for each.

mod parameter;
pub(crate) mod spec;

use std::str::FromStr;

use serde::Serialize;

use crate::diagnosis::candidate::{dynamic, geometry, lobes, sensor, stiffness, thermal};
use crate::synthesize::EffectError;
pub use parameter::{Factor, Kind, ParameterName, ParameterSpec, TIME, Usual, number};
use spec::CauseSpec;
pub(crate) use spec::OF_THE_OUTPUT_ENCODER;

table! {
    /// A physical cause of the library.
    #[allow(missing_docs, reason = "the properties of each say what it is")]
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum CauseName: &'static CauseSpec {
        CircularSplineEccentricity = &geometry::CIRCULAR_SPLINE_ECCENTRICITY,
        FlexsplineRunout = &geometry::FLEXSPLINE_RUNOUT,
        CircularSplineOvality = &geometry::CIRCULAR_SPLINE_OVALITY,
        FlexsplinePitchError = &geometry::FLEXSPLINE_PITCH_ERROR,
        CircularSplinePitchError = &geometry::CIRCULAR_SPLINE_PITCH_ERROR,
        GeneratorEccentricity = &lobes::GENERATOR_ECCENTRICITY,
        CamFormError = &geometry::CAM_FORM_ERROR,
        DamagedTooth = &geometry::DAMAGED_TOOTH,
        CrackedToothRoot = &stiffness::CRACKED_TOOTH_ROOT,
        BacklashGrowth = &stiffness::BACKLASH_GROWTH,
        Wear = &stiffness::WEAR,
        StiffnessHardening = &stiffness::STIFFNESS_HARDENING,
        StiffnessError = &stiffness::STIFFNESS_ERROR,
        TorsionalHysteresis = &stiffness::TORSIONAL_HYSTERESIS,
        ThermalClearance = &thermal::THERMAL_CLEARANCE,
        ThermalStiffness = &thermal::THERMAL_STIFFNESS,
        LubricantViscosity = &thermal::LUBRICANT_VISCOSITY,
        GravityTorque = &dynamic::GRAVITY_TORQUE,
        GravitySideLoad = &geometry::GRAVITY_SIDE_LOAD,
        TorsionalResonance = &dynamic::TORSIONAL_RESONANCE,
        OutputEncoderEccentricity = &sensor::OUTPUT_ENCODER_ECCENTRICITY,
        GeneratorEncoderEccentricity = &sensor::GENERATOR_ENCODER_ECCENTRICITY,
        OutputEncoderTilt = &sensor::OUTPUT_ENCODER_TILT,
        GeneratorEncoderTilt = &sensor::GENERATOR_ENCODER_TILT,
        EncoderSubdivision = &sensor::ENCODER_SUBDIVISION,
        SensorLatency = &sensor::SENSOR_LATENCY,
        RatioError = &sensor::RATIO_ERROR,
        Ratcheting = &stiffness::RATCHETING,
    }
}

/// Laws whose misfit may be taken for each other: most of all within a kin.
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

table! {
    /// A condition that data have to meet before they say anything of a cause.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
    pub enum Need: (&'static str, Option<&'static str>) {
        /// The numbers of teeth.
        #[serde(rename = "needs_teeth")]
        Teeth = ("the model gives a ratio and no numbers of teeth",
            Some("give the numbers of teeth in the nominal model")),
        /// Enough generator turns that a place comes again.
        #[serde(rename = "needs_turns")]
        Turns = ("the generator makes too few turns for one place to come again",
            Some("record a dozen generator turns or more in one piece")),
        /// A load on the output, and its column.
        #[serde(rename = "needs_torque")]
        Load = ("no load was recorded", Some("load the output, and record the torque (torque_n_m)")),
        /// A load that turns back.
        #[serde(rename = "needs_load_that_turns")]
        LoadTurns = ("the load turns back in no session: no loop is seen",
            Some("raise the load and lower it again in one session")),
        /// A spring in the nominal model.
        #[serde(rename = "needs_stiffness")]
        Spring = ("the nominal model does not wind up", Some("give the stiffness in the nominal model")),
        /// The temperature.
        #[serde(rename = "needs_temperature")]
        Temperature = ("no temperature was recorded", Some("record the temperature (temperature_c), cold and warm")),
        /// Temperatures apart from each other, or from the nominal one.
        #[serde(rename = "needs_temperatures")]
        TemperatureSpan = ("the temperature stays close to the nominal one",
            Some("record sessions at temperatures that differ by 20 K or more")),
        /// The time.
        #[serde(rename = "needs_time")]
        Time = ("no time was recorded", Some("record the time of each row (time_s)")),
        /// A generator that moves.
        #[serde(rename = "needs_motion")]
        Motion = ("the generator does not move", Some("record the drive in motion, at several speeds")),
        /// A speed or a load that changes fast enough to make a load swing, in rows that are read at one instant.
        #[serde(rename = "needs_changes")]
        Swings = ("speed and load stay as they are, or rows are means over some time: no load is seen to swing",
            Some("record steps of the load, stops and starts, and several speeds, each row read at one instant")),
        /// So much use that a drive may have worn meanwhile.
        #[serde(rename = "needs_use")]
        Use = ("the drive is used too little for wear in between",
            Some("record again after hours of use, with the same zero")),
        /// A lasting jump of the error by whole teeth.
        #[serde(rename = "needs_jump")]
        Jump = ("the error has no lasting jump by whole teeth", None),
    }
}

impl Need {
    /// Why the cause cannot be judged without it.
    pub const fn missing(self) -> &'static str {
        self.row().0
    }

    /// The recording, or the number, that would meet it; none where no recording does at will.
    pub(crate) const fn remedy(self) -> Option<&'static str> {
        self.row().1
    }
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

impl FromStr for CauseName {
    type Err = EffectError;
    fn from_str(name: &str) -> Result<CauseName, EffectError> {
        let known = CauseName::ALL.iter().find(|cause| cause.as_str() == name);
        let allowed = || CauseName::ALL.map(CauseName::as_str);
        known.copied().ok_or_else(|| EffectError::unknown("found ", name, &allowed()))
    }
}

shown_by_name!(CauseName::as_str);

impl CauseName {
    /// Its entry in the table of causes.
    pub(crate) fn spec(self) -> &'static CauseSpec {
        self.row()
    }

    /// Its name in files, snake case.
    pub fn as_str(self) -> &'static str {
        self.spec().name
    }

    /// Its name in a sentence.
    pub fn words(self) -> &'static str {
        self.spec().words
    }

    /// Its effect on the error, in a few words.
    pub fn does(self) -> &'static str {
        self.spec().does
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Usual::Value;

    #[test]
    fn a_name_reads_back_and_a_misspelt_one_gets_a_suggestion() {
        for cause in CauseName::ALL {
            assert_eq!(cause.as_str().parse(), Ok(cause));
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
            let said = [cause.words(), cause.does()];
            assert!(said.iter().all(|words| !words.is_empty() && !words.contains('_')), "{cause}: {said:?}");
        }
    }

    #[test]
    fn usual_values_are_allowed_and_twins_are_parameters() {
        for cause in CauseName::ALL {
            for parameter in cause.spec().parameters {
                let [low, high] = parameter.range;
                if let Value(value) = parameter.usual {
                    assert!((low..=high).contains(&value), "{cause} {}", parameter.name);
                }
            }
            let has = |name: ParameterName| cause.spec().parameters.iter().any(|parameter| parameter.name == name);
            assert!(cause.spec().twins.iter().all(|(a, b, _)| has(*a) && has(*b)), "{cause}");
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
            assert!(matches!(cause.spec().in_table, InTable::No(_)), "{cause}");
        }
        for cause in
            [CauseName::CircularSplineEccentricity, CauseName::BacklashGrowth, CauseName::GeneratorEncoderEccentricity]
        {
            assert!(!matches!(cause.spec().in_table, InTable::No(_)), "{cause}");
        }
    }
}
