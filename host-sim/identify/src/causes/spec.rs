//! The table of causes: the properties of each beside its law.

use std::f64::consts::TAU;

use super::ParameterName as Name;
use super::parameter::{ARCSECONDS, ENCODERS, HALF_LOAD, HARMONIC, WHEELS, microns, phase};
use super::{CauseName, Factor, InTable, Kin, Multiple, Need, Parameter, TIME, Turn, Usual, number};
use crate::diagnosis::candidate::geometry::{self, Angle};
use crate::diagnosis::candidate::{Excitation, Simulated, Values, dynamic, lobes, sensor, stiffness, thermal};
use crate::extension::DriveField;
use Multiple::{Fixed, Harmonic, ToothMesh};
use Usual::{Follows, OfLoad, ToothPitch, Value};

/// The properties of a cause.
pub(crate) struct CauseSpec {
    /// The cause.
    of: CauseName,
    /// Its name in a sentence.
    pub words: &'static str,
    /// Its effect on the error, in a few words.
    pub does: &'static str,
    /// The physical defect, as the list of effects to synthesize describes it.
    pub meaning: &'static str,
    /// The laws that its misfit resembles.
    pub kin: Kin,
    /// The conditions that data have to meet before it is considered.
    pub needs: &'static [Need],
    /// The orders that it makes, each counted against a turn: for marks in spectra.
    pub orders: &'static [(Turn, Multiple)],
    /// Whether a table can hold it.
    pub in_table: InTable,
    /// The field of a drive file that holds it, if one does.
    pub drive_field: Option<DriveField>,
    /// Its parameters as they may be given, under the names that the diagnosis reports.
    pub parameters: &'static [Parameter],
    /// Pairs of parameters of which one follows from the other, with the factor from the first to the second.
    pub twins: &'static [(Name, Name, Factor)],
    /// Whether a load on the output makes much the same error, one that goes with the speed, the direction or the angle
    /// of the output.
    pub made_by_loads: bool,
    /// Whether something outside the library makes the same error, whatever is recorded: a shaft that is bent or
    /// misaligned before the output's encoder makes two waves in a turn, as a tilted encoder does.
    pub double_outside: bool,
    /// The cause with known parameters, as its law makes it.
    pub simulated: fn(&Excitation<'_>, Values<'_>) -> Simulated,
}

/// A cause without texts and parameters, like no other law, which a table can hold and no field of a drive.
const fn plain(of: CauseName) -> CauseSpec {
    CauseSpec {
        of,
        words: "",
        does: "",
        meaning: "",
        kin: Kin::Unlike,
        needs: &[],
        orders: &[],
        in_table: InTable::Yes,
        drive_field: None,
        parameters: &[],
        twins: &[],
        made_by_loads: false,
        double_outside: false,
        simulated: |_, _| unreachable!("each cause has its own"),
    }
}

/// Why a table holds no error of the output's encoder.
pub(crate) const OF_THE_OUTPUT_ENCODER: &str = "the output's encoder is wrong here, not the joint";

/// The causes in the order of [`CauseName::ALL`].
pub(super) static SPECS: [CauseSpec; CauseName::ALL.len()] = [
    CauseSpec {
        words: "eccentricity of the circular spline",
        does: "its axis beside the axis of the generator: two waves in a turn of the generator against the circular \
                 spline",
        meaning: "toothing of the circular spline beside the axis it turns about",
        kin: Kin::Shape,
        needs: &[Need::Teeth],
        orders: &[(Turn::CircularSpline, Fixed(2.0)), (Turn::CircularSpline, Fixed(4.0))],
        drive_field: DriveField::CIRCULAR_SPLINE_ECCENTRICITY,
        parameters: &[microns("how far", 10.0), ARCSECONDS, phase("whereto, on the circular spline"), HALF_LOAD],
        twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongNormal)],
        simulated: |on, p| {
            geometry::simulated_displacement(CauseName::CircularSplineEccentricity, Angle::CircularSpline, on, p)
        },
        ..plain(CauseName::CircularSplineEccentricity)
    },
    CauseSpec {
        words: "runout of the flexspline",
        does: "its axis beside the axis of the generator: two waves in a generator turn",
        meaning: "toothing of the flexspline beside the axis of its bore",
        kin: Kin::Shape,
        needs: &[Need::Teeth],
        orders: &[(Turn::Flexspline, Fixed(2.0)), (Turn::Flexspline, Fixed(4.0))],
        drive_field: DriveField::FLEXSPLINE_RUNOUT,
        parameters: &[microns("how far", 10.0), ARCSECONDS, phase("whereto, on the flexspline"), HALF_LOAD],
        twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongNormal)],
        simulated: |on, p| geometry::simulated_displacement(CauseName::FlexsplineRunout, Angle::Flexspline, on, p),
        ..plain(CauseName::FlexsplineRunout)
    },
    CauseSpec {
        words: "oval circular spline",
        does: "pressed out of round: two waves in a turn against the circular spline",
        meaning: "circular spline pressed to an oval that keeps its length",
        kin: Kin::Shape,
        needs: &[Need::Teeth],
        orders: &[(Turn::CircularSpline, Fixed(2.0))],
        drive_field: DriveField::CIRCULAR_SPLINE_OVALITY,
        parameters: &[
            microns("of the radius", 8.0),
            ARCSECONDS,
            phase("angle of a crest of what both flanks have alike"),
        ],
        twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::Oval)],
        simulated: |_, p| geometry::simulated_ovality(p),
        ..plain(CauseName::CircularSplineOvality)
    },
    CauseSpec {
        words: "pitch error of the flexspline",
        does: "teeth out of place: whole orders of the generator turn",
        meaning: "cumulative pitch error of the flexspline",
        kin: Kin::Shape,
        needs: &[Need::Teeth],
        orders: &[(Turn::Flexspline, Harmonic)],
        drive_field: DriveField::FLEXSPLINE_PITCH,
        parameters: &[microns("along the pitch", 5.0), ARCSECONDS, HARMONIC, phase("angle of a crest of the error")],
        twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongPitch)],
        simulated: |_, p| geometry::simulated_pitch(CauseName::FlexsplinePitchError, Angle::Flexspline, p),
        ..plain(CauseName::FlexsplinePitchError)
    },
    CauseSpec {
        words: "pitch error of the circular spline",
        does: "teeth out of place: whole orders of a turn against the circular spline",
        meaning: "cumulative pitch error of the circular spline",
        kin: Kin::Shape,
        needs: &[Need::Teeth],
        orders: &[(Turn::CircularSpline, Harmonic)],
        drive_field: DriveField::CIRCULAR_SPLINE_PITCH,
        parameters: &[microns("along the pitch", 5.0), ARCSECONDS, HARMONIC, phase("angle of a crest of the error")],
        twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongPitch)],
        simulated: |_, p| geometry::simulated_pitch(CauseName::CircularSplinePitchError, Angle::CircularSpline, p),
        ..plain(CauseName::CircularSplinePitchError)
    },
    CauseSpec {
        words: "eccentricity of the generator",
        does: "one lobe carries more: odd orders, once in a turn above all",
        meaning: "generator beside its axis: one lobe carries more",
        kin: Kin::Shape,
        needs: &[Need::Teeth],
        orders: &[(Turn::Flexspline, Fixed(1.0)), (Turn::CircularSpline, Fixed(1.0))],
        parameters: &[
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
        ],
        twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongPitch)],
        simulated: lobes::simulated_generator_eccentricity,
        ..plain(CauseName::GeneratorEccentricity)
    },
    CauseSpec {
        words: "form error of the generator",
        does: "a shape that is not the drawn one: tooth mesh and even orders of the generator turn",
        meaning: "form error of the generator",
        needs: &[Need::Teeth],
        orders: &[(Turn::Generator, Fixed(4.0)), (Turn::Generator, Fixed(6.0)), (Turn::Generator, ToothMesh)],
        parameters: &[microns("of the error it makes", 3.0), ARCSECONDS, phase("of the form")],
        twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongPitch)],
        simulated: |_, p| geometry::simulated_cam_form_error(p),
        ..plain(CauseName::CamFormError)
    },
    CauseSpec {
        words: "damaged tooth",
        does: "a pulse each time a lobe passes one place",
        meaning: "a tooth that lacks material",
        kin: Kin::Pulse,
        needs: &[Need::Teeth, Need::Turns],
        orders: &[(Turn::OfWheel, Fixed(2.0)), (Turn::OfWheel, Fixed(4.0)), (Turn::OfWheel, Fixed(6.0))],
        drive_field: DriveField::DAMAGED_TOOTH,
        parameters: &[
            number(Name::DepthUm, "depth that lacks, along the normal", 0.0, 500.0, Value(10.0)),
            number(Name::AmplitudeArcsec, "the same at the output, under the largest load", 0.0, 3000.0, Follows),
            Parameter { words: WHEELS, ..number(Name::Wheel, "0 flexspline, 1 circular spline", 0.0, 1.0, Value(0.0)) },
            number(Name::Tooth, "which one, from 0", 0.0, 2000.0, Value(40.0)),
            number(Name::AngleRad, "the same as an angle on the wheel", -TAU, TAU, Follows),
            number(Name::WidthRad, "half the arc over which it is felt", 0.02, 0.6, Value(0.15)),
        ],
        twins: &[
            (Name::DepthUm, Name::AmplitudeArcsec, Factor::AlongNormal),
            (Name::Tooth, Name::AngleRad, Factor::Tooth),
        ],
        simulated: |_, p| geometry::simulated_damaged_tooth(p),
        ..plain(CauseName::DamagedTooth)
    },
    CauseSpec {
        words: "cracked tooth root",
        does: "softer each time a lobe passes one tooth of the circular spline: nothing there without load",
        meaning: "a tooth of the circular spline that bends more than its neighbours",
        kin: Kin::Pulse,
        needs: &[Need::Teeth, Need::Turns, Need::Load],
        orders: &[
            (Turn::CircularSpline, Fixed(2.0)),
            (Turn::CircularSpline, Fixed(4.0)),
            (Turn::CircularSpline, Fixed(6.0)),
        ],
        parameters: &[
            number(Name::AmplitudeArcsec, "by which it winds up more at the full load", 0.0, 1000.0, Value(30.0)),
            number(Name::FullLoadNM, "the torque at which it is stated", 1e-3, 1e6, OfLoad(1.0)),
            number(
                Name::AngleRad,
                "where the tooth, or the one opposite, is on the circular spline",
                -TAU,
                TAU,
                Value(1.2),
            ),
            number(Name::WidthRad, "half the arc over which it is felt", 0.02, 0.6, Value(0.15)),
        ],
        simulated: stiffness::simulated_crack,
        ..plain(CauseName::CrackedToothRoot)
    },
    CauseSpec {
        words: "wider backlash",
        does: "more clearance than nominal throughout the data",
        meaning: "a wider clearance throughout",
        kin: Kin::Clearance,
        drive_field: DriveField::FLANK_WEAR,
        made_by_loads: true,
        parameters: &[number(Name::GrowthArcsec, "whole width over nominal", 0.0, 10_000.0, Value(40.0))],
        simulated: stiffness::simulated_backlash_growth,
        ..plain(CauseName::BacklashGrowth)
    },
    CauseSpec {
        words: "wear",
        does: "a clearance that widens from the first row to the last",
        meaning: "a clearance that widens with travel",
        kin: Kin::Clearance,
        needs: &[Need::Use],
        in_table: InTable::No("it grows with use, and a table stays"),
        drive_field: DriveField::FLANK_WEAR,
        parameters: &[number(Name::GrowthArcsec, "whole width, first row to last", 0.0, 10_000.0, Value(40.0))],
        simulated: |_, p| stiffness::simulated_wear(p),
        ..plain(CauseName::Wear)
    },
    CauseSpec {
        words: "hardening stiffness",
        does: "stiffer the higher the load",
        meaning: "stiffer the higher the load",
        kin: Kin::Torque,
        needs: &[Need::Load],
        parameters: &[
            number(
                Name::HardeningArcsec,
                "by which the wind-up falls short at the full load",
                0.0,
                1000.0,
                Value(20.0),
            ),
            number(Name::HardeningExponent, "of the torque", 1.2, 8.0, Value(3.0)),
            number(Name::FullLoadNM, "the torque at which it is stated", 1e-3, 1e6, OfLoad(1.0)),
        ],
        simulated: stiffness::simulated_hardening,
        ..plain(CauseName::StiffnessHardening)
    },
    CauseSpec {
        words: "other stiffness",
        does: "wind-up in proportion to nominal, of another size",
        meaning: "another stiffness than nominal",
        kin: Kin::Torque,
        needs: &[Need::Load],
        drive_field: DriveField::STIFFNESS,
        parameters: &[number(Name::StiffnessRatio, "true over nominal", 0.05, 20.0, Value(0.8))],
        simulated: |_, p| stiffness::simulated_stiffness_error(p),
        ..plain(CauseName::StiffnessError)
    },
    CauseSpec {
        words: "torsional hysteresis",
        does: "the output lags the torque by what slipping contacts hold",
        meaning: "springs that slip: the output lags the torque",
        kin: Kin::Friction,
        needs: &[Need::Load],
        in_table: InTable::No("it depends on the torques before, and a table knows the present one alone"),
        made_by_loads: true,
        parameters: &[
            number(
                Name::HalfWidthArcsec,
                "half the opening of the large loop at zero torque",
                0.0,
                1000.0,
                Value(15.0),
            ),
            number(Name::SlipTorqueNM, "at which the middle spring slips", 1e-3, 1e6, OfLoad(0.2)),
        ],
        simulated: stiffness::simulated_hysteresis,
        ..plain(CauseName::TorsionalHysteresis)
    },
    CauseSpec {
        words: "clearance with temperature",
        does: "backlash that follows the temperature",
        meaning: "a clearance that follows the temperature",
        kin: Kin::Clearance,
        needs: &[Need::Temperature, Need::TemperatureSpan],
        drive_field: DriveField::EXPANSION,
        parameters: &[
            number(Name::ClearanceArcsecPerK, "whole width, wider when warm", -50.0, 50.0, Value(-1.0)),
            number(Name::LagS, "with which it follows", 0.0, 1e5, Value(0.0)),
        ],
        simulated: thermal::simulated_clearance,
        ..plain(CauseName::ThermalClearance)
    },
    CauseSpec {
        words: "stiffness with temperature",
        does: "wind-up that follows the temperature",
        meaning: "a stiffness that follows the temperature",
        kin: Kin::Torque,
        needs: &[Need::Temperature, Need::TemperatureSpan, Need::Load],
        drive_field: DriveField::STIFFNESS_PER_KELVIN,
        parameters: &[number(Name::StiffnessRelativePerK, "of the stiffness", -0.02, 0.02, Value(-0.004))],
        simulated: |_, p| thermal::simulated_stiffness(p),
        ..plain(CauseName::ThermalStiffness)
    },
    CauseSpec {
        words: "drag of the lubricant",
        does: "a load against the motion that grows with speed and cold",
        meaning: "drag of the lubricant on the output, that the torque column does not hold",
        kin: Kin::Drag,
        needs: &[Need::Time, Need::Motion],
        in_table: InTable::No("it follows the speed, and a table knows none"),
        made_by_loads: true,
        parameters: &[
            number(Name::DragNM, "at the mean speed and the nominal temperature", 0.0, 1e5, OfLoad(0.1)),
            number(Name::SpeedExponent, "of the speed", 0.2, 1.2, Value(2.0 / 3.0)),
            number(Name::RelativeDragPerK, "of the drag", -0.15, 0.0, Value(-0.035)),
        ],
        simulated: thermal::simulated_drag,
        ..plain(CauseName::LubricantViscosity)
    },
    CauseSpec {
        words: "unbalanced load",
        does: "gravity on the load, which the torque column does not hold",
        meaning: "an unbalanced load that the torque column does not hold",
        kin: Kin::Torque,
        needs: &[Need::Spring],
        orders: &[(Turn::Output, Fixed(1.0))],
        in_table: InTable::AtOneOrientation,
        made_by_loads: true,
        parameters: &[
            number(Name::TorqueNM, "m g l", 0.0, 1e5, OfLoad(0.2)),
            phase("of sin(output + orientation + phase)"),
        ],
        simulated: dynamic::simulated_gravity_torque,
        ..plain(CauseName::GravityTorque)
    },
    CauseSpec {
        words: "side load by gravity",
        does: "a weight that pushes the wheels out of centre",
        meaning: "weight that pushes the circular spline aside",
        kin: Kin::Shape,
        needs: &[Need::Teeth],
        orders: &[(Turn::Generator, Fixed(2.0)), (Turn::Generator, Fixed(4.0))],
        in_table: InTable::AtOneOrientation,
        drive_field: DriveField::CIRCULAR_SPLINE_OFFSET,
        parameters: &[microns("how far", 10.0), ARCSECONDS, phase("whereto, against gravity"), HALF_LOAD],
        twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongNormal)],
        simulated: |on, p| geometry::simulated_displacement(CauseName::GravitySideLoad, Angle::Gravity(1.0), on, p),
        ..plain(CauseName::GravitySideLoad)
    },
    CauseSpec {
        words: "torsional resonance",
        does: "the inertia of the load on the spring of the drive",
        meaning: "the load's inertia on the drive's spring",
        needs: &[Need::Time, Need::Swings],
        in_table: InTable::No("it follows the motion in time, and a table knows steady motion alone"),
        made_by_loads: true,
        parameters: &[
            number(Name::FrequencyHz, "of the free oscillation", 0.1, 1000.0, Value(8.0)),
            number(Name::DampingRatio, "of critical damping", 0.001, 0.9, Value(0.03)),
        ],
        simulated: dynamic::simulated_resonance,
        ..plain(CauseName::TorsionalResonance)
    },
    CauseSpec {
        words: "eccentricity of the output encoder",
        does: "one wave in an output turn, whatever the load",
        meaning: "disc of the output encoder off its axis",
        orders: &[(Turn::Output, Fixed(1.0))],
        in_table: InTable::No(OF_THE_OUTPUT_ENCODER),
        made_by_loads: true,
        parameters: &[
            number(Name::AmplitudeArcsec, "at the output", 0.0, 10_000.0, Value(20.0)),
            phase("of sin(output + phase)"),
        ],
        simulated: |_, p| sensor::simulated_encoder(CauseName::OutputEncoderEccentricity, true, 1.0, p),
        ..plain(CauseName::OutputEncoderEccentricity)
    },
    CauseSpec {
        words: "eccentricity of the generator encoder",
        does: "one wave in a generator turn, whatever the load",
        meaning: "disc of the generator's encoder off its axis",
        orders: &[(Turn::Generator, Fixed(1.0))],
        parameters: &[
            number(Name::AmplitudeArcsec, "at the output", 0.0, 1000.0, Value(10.0)),
            number(Name::GeneratorAmplitudeArcsec, "the same at the generator", 0.0, 1e5, Follows),
            phase("of sin(generator + phase)"),
        ],
        twins: &[(Name::AmplitudeArcsec, Name::GeneratorAmplitudeArcsec, Factor::Ratio)],
        simulated: |_, p| sensor::simulated_encoder(CauseName::GeneratorEncoderEccentricity, false, 1.0, p),
        ..plain(CauseName::GeneratorEncoderEccentricity)
    },
    CauseSpec {
        words: "tilt of the output encoder",
        does: "two waves in an output turn, whatever the load",
        meaning: "output encoder that is tilted, or whose magnet is not square on its axis",
        needs: &[Need::HalfOutputTurn],
        orders: &[(Turn::Output, Fixed(2.0))],
        in_table: InTable::No(OF_THE_OUTPUT_ENCODER),
        parameters: &[
            number(Name::AmplitudeArcsec, "at the output", 0.0, 10_000.0, Value(15.0)),
            phase("of sin(2 output + phase)"),
        ],
        double_outside: true,
        simulated: |_, p| sensor::simulated_encoder(CauseName::OutputEncoderTilt, true, 2.0, p),
        ..plain(CauseName::OutputEncoderTilt)
    },
    CauseSpec {
        words: "tilt of the generator encoder",
        does: "two waves in a generator turn, the same on both flanks and under any load",
        meaning: "generator's encoder that is tilted, or whose magnet is not square on its axis",
        kin: Kin::Shape,
        orders: &[(Turn::Generator, Fixed(2.0))],
        parameters: &[
            number(Name::AmplitudeArcsec, "at the output", 0.0, 1000.0, Value(8.0)),
            number(Name::GeneratorAmplitudeArcsec, "the same at the generator", 0.0, 1e5, Follows),
            phase("of sin(2 generator + phase)"),
        ],
        twins: &[(Name::AmplitudeArcsec, Name::GeneratorAmplitudeArcsec, Factor::Ratio)],
        simulated: |_, p| sensor::simulated_encoder(CauseName::GeneratorEncoderTilt, false, 2.0, p),
        ..plain(CauseName::GeneratorEncoderTilt)
    },
    CauseSpec {
        words: "subdivision error of an encoder",
        does: "four waves or a multiple in a turn of an encoder, whatever the load and the speed",
        meaning: "an encoder that divides its periods unevenly",
        orders: &[(Turn::OfEncoder, Harmonic)],
        parameters: &[
            number(Name::AmplitudeArcsec, "at the output", 0.0, 1000.0, Value(6.0)),
            number(Name::GeneratorAmplitudeArcsec, "the same at the generator", 0.0, 1e5, Follows),
            number(Name::Harmonic, "waves in a turn of the encoder", 3.0, 65_536.0, Value(4.0)),
            Parameter { words: ENCODERS, ..number(Name::Encoder, "0 generator, 1 output", 0.0, 1.0, Value(0.0)) },
            phase("of sin(harmonic angle + phase)"),
        ],
        twins: &[(Name::AmplitudeArcsec, Name::GeneratorAmplitudeArcsec, Factor::Ratio)],
        simulated: |_, p| {
            sensor::simulated_encoder(CauseName::EncoderSubdivision, p(Name::Encoder) > 0.5, p(Name::Harmonic), p)
        },
        ..plain(CauseName::EncoderSubdivision)
    },
    CauseSpec {
        words: "time between the sensors",
        does: "output and generator are read at different instants: an error in proportion to speed",
        meaning: "the output's reading is older than the generator's",
        kin: Kin::Motion,
        needs: &[Need::Time],
        in_table: InTable::No("it follows the speed, and a table knows none"),
        made_by_loads: true,
        parameters: &[number(Name::DelayS, "positive: the output's is older", -0.1, 0.1, Value(0.002))],
        simulated: |_, p| sensor::simulated_latency(p),
        ..plain(CauseName::SensorLatency)
    },
    CauseSpec {
        words: "another ratio",
        does: "the error grows with the angle",
        meaning: "an error in proportion to the output angle",
        in_table: InTable::No("it grows from turn to turn, and a table repeats"),
        made_by_loads: true,
        parameters: &[number(Name::RatioRelativeError, "of the output angle", -0.01, 0.01, Value(1e-4))],
        simulated: |_, p| sensor::simulated_ratio_error(p),
        ..plain(CauseName::RatioError)
    },
    CauseSpec {
        words: "ratcheting",
        does: "teeth that skipped",
        meaning: "teeth that skip",
        needs: &[Need::Teeth, Need::Jump],
        in_table: InTable::No("it happens at an instant"),
        parameters: &[number(Name::JumpArcsec, "of the output, whole teeth", -1e5, 1e5, ToothPitch), TIME],
        simulated: |_, p| stiffness::simulated_ratcheting(p),
        ..plain(CauseName::Ratcheting)
    },
];

const _: () = {
    let mut k = 0;
    while k < SPECS.len() {
        assert!(SPECS[k].of as usize == k, "the table has another order than the names");
        k += 1;
    }
};
