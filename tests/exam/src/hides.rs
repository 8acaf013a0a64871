//! Hidden effects: a cause of the contract, or a stranger to it.

use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::Drive;

macro_rules! strangers {
    ($($variant:ident $name:literal),* $(,)?) => {
        /// An effect that is no cause of the contract.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Stranger { $($variant),* }

        impl Stranger {
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),* }
            }
        }
    };
}

strangers! {
    MotorCoupling "motor_coupling_compliance",
    SpurStage "spur_stage_before_the_generator",
    CableSpring "cable_spring",
    EncoderCouplingPlay "encoder_coupling_play",
    FloorVibration "floor_vibration",
    TorqueFromCurrent "torque_from_current",
    PolygonFaces "polygon_faces",
    SlowCreep "slow_creep",
    IndexTable "index_table_error",
    SwingingWeight "swinging_weight",
    AirConditioning "air_conditioning",
    HarnessSnap "harness_that_snaps_over",
    SunOnMount "sun_on_the_encoder_mount",
    WheelHum "reaction_wheel_hum",
    MountSettles "mount_settles_after_pauses",
    LooseBolts "loose_flange_bolts",
    BrakeReleasesLate "brake_releases_late",
    TorqueSensorCreep "torque_sensor_creep",
    NeighbourMachine "neighbouring_machine",
    ScalePatch "patch_of_the_tape_scale",
    ChainRolls "energy_chain_rolls",
}

impl Stranger {
    pub const OF_JOINTS: &[Self] = &[
        Self::MotorCoupling,
        Self::SpurStage,
        Self::CableSpring,
        Self::EncoderCouplingPlay,
        Self::FloorVibration,
        Self::TorqueFromCurrent,
    ];
    pub const OF_BENCHES: &[Self] =
        &[Self::PolygonFaces, Self::SlowCreep, Self::IndexTable, Self::SwingingWeight, Self::AirConditioning];
}

/// Causes that a bench that stands still while it reads can show.
pub const OF_BENCHES: &[Cause] = &[
    Cause::CircularSplineEccentricity,
    Cause::FlexsplineRunout,
    Cause::CircularSplineOvality,
    Cause::FlexsplinePitchError,
    Cause::CircularSplinePitchError,
    Cause::GeneratorEccentricity,
    Cause::BacklashGrowth,
    Cause::Wear,
    Cause::StiffnessHardening,
    Cause::StiffnessError,
    Cause::TorsionalHysteresis,
    Cause::ThermalClearance,
    Cause::ThermalStiffness,
    Cause::GravityTorque,
    Cause::GravitySideLoad,
    Cause::OutputEncoderEccentricity,
    Cause::GeneratorEncoderEccentricity,
    Cause::RatioError,
    Cause::Ratcheting,
];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Thing {
    Cause(Cause),
    Stranger(Stranger),
}

impl Thing {
    pub fn name(self) -> &'static str {
        match self {
            Self::Cause(cause) => cause.name(),
            Self::Stranger(stranger) => stranger.name(),
        }
    }
}

/// One hidden effect with its size and four numbers between 0 and 1 that its law takes for phases, places and seeds.
#[derive(Debug, Clone, PartialEq)]
pub struct Hides {
    pub thing: Thing,
    /// In the unit of [`Hides::unit`].
    pub size: f64,
    pub shape: [f64; 4],
}

impl Hides {
    /// Draws shape and sign; the size is the middle of the range.
    pub fn draw(thing: Thing, drive: &Drive, chance: &mut Chance) -> Self {
        let (low, high) = range(thing, drive);
        let signed = matches!(
            thing,
            Thing::Cause(
                Cause::StiffnessError
                    | Cause::ThermalClearance
                    | Cause::ThermalStiffness
                    | Cause::SensorLatency
                    | Cause::RatioError
            )
        );
        let sign = if signed { chance.sign() } else { 1.0 };
        let shape = [(); 4].map(|()| chance.uniform(0.0, 1.0));
        Self { thing, size: sign * (low * high).sqrt(), shape }
    }

    /// An angle of the shape, rad.
    pub fn phase(&self, at: usize) -> f64 {
        std::f64::consts::TAU * self.shape[at]
    }

    /// The same with another size, held in its range.
    pub fn sized(&self, size: f64, drive: &Drive) -> Self {
        let (low, high) = range(self.thing, drive);
        Self { size: size.abs().clamp(0.05 * low, high).copysign(self.size), ..self.clone() }
    }

    pub fn unit(&self) -> &'static str {
        match self.thing {
            Thing::Cause(Cause::StiffnessError | Cause::RatioError) => "relative",
            Thing::Cause(Cause::StiffnessHardening) => "relative_at_rated",
            Thing::Cause(Cause::ThermalClearance) => "arcsec_per_k",
            Thing::Cause(Cause::ThermalStiffness) => "relative_per_k",
            Thing::Cause(Cause::LubricantViscosity | Cause::GravityTorque) => "torque_n_m",
            Thing::Cause(Cause::TorsionalResonance) => "share_of_inertia",
            Thing::Cause(Cause::SensorLatency) => "delay_s",
            Thing::Cause(Cause::Ratcheting) => "teeth",
            Thing::Stranger(Stranger::TorqueFromCurrent) => "share",
            _ => "amplitude_arcsec",
        }
    }
}

/// Smallest and largest size that a drive or a bench can show.
pub fn range(thing: Thing, drive: &Drive) -> (f64, f64) {
    let rated = drive.rated_n_m;
    match thing {
        Thing::Cause(cause) => match cause {
            Cause::StiffnessError => (0.03, 0.5),
            Cause::StiffnessHardening => (0.05, 1.5),
            Cause::ThermalClearance => (0.05, 3.0),
            Cause::ThermalStiffness => (3e-4, 7e-3),
            Cause::LubricantViscosity => (0.003 * rated, 0.3 * rated),
            Cause::GravityTorque => (0.005 * rated, 0.4 * rated),
            Cause::TorsionalResonance => (0.05, 1.0),
            Cause::SensorLatency => (1e-4, 8e-3),
            Cause::RatioError => (2e-7, 3e-4),
            Cause::Ratcheting => (1.0, 1.0),
            Cause::CamFormError => (0.5, 12.0),
            Cause::BacklashGrowth | Cause::Wear => (4.0, 200.0),
            Cause::DamagedTooth => (6.0, 120.0),
            _ => (1.0, 70.0),
        },
        Thing::Stranger(Stranger::TorqueFromCurrent) => (0.1, 1.0),
        Thing::Stranger(_) => (1.0, 40.0),
    }
}
