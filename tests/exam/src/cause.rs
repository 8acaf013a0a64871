//! The causes that the contract names, and the numbers of each.

use serde::{Serialize, Serializer};

use crate::drive::Drive;
use crate::effect::{Range, Spec};

macro_rules! causes {
    ($($variant:ident $name:literal),* $(,)?) => {
        /// One physical cause of a discrepancy.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[allow(missing_docs, reason = "the names say it")]
        pub enum Cause { $($variant),* }

        impl Cause {
            /// All, in the order of the contract.
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            /// As `diagnosis.json` writes it.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),* }
            }
        }
    };
}

causes! {
    CircularSplineEccentricity "circular_spline_eccentricity",
    FlexsplineRunout "flexspline_runout",
    CircularSplineOvality "circular_spline_ovality",
    FlexsplinePitchError "flexspline_pitch_error",
    CircularSplinePitchError "circular_spline_pitch_error",
    GeneratorEccentricity "generator_eccentricity",
    CamFormError "cam_form_error",
    DamagedTooth "damaged_tooth",
    BacklashGrowth "backlash_growth",
    Wear "wear",
    StiffnessHardening "stiffness_hardening",
    StiffnessError "stiffness_error",
    TorsionalHysteresis "torsional_hysteresis",
    ThermalClearance "thermal_clearance",
    ThermalStiffness "thermal_stiffness",
    LubricantViscosity "lubricant_viscosity",
    GravityTorque "gravity_torque",
    GravitySideLoad "gravity_side_load",
    TorsionalResonance "torsional_resonance",
    OutputEncoderEccentricity "output_encoder_eccentricity",
    GeneratorEncoderEccentricity "generator_encoder_eccentricity",
    SensorLatency "sensor_latency",
    RatioError "ratio_error",
    Ratcheting "ratcheting",
}

impl Serialize for Cause {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl std::str::FromStr for Cause {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|cause| cause.name() == name);
        found.copied().ok_or_else(|| {
            let names: Vec<_> = Self::ALL.iter().map(|cause| cause.name()).collect();
            format!("`{name}` is no cause; one of {}", names.join(", "))
        })
    }
}

impl Cause {
    /// Size, range and shape. Ranges: from below what a good encoder shows to what stops a drive.
    pub fn spec(self, drive: &Drive) -> Spec {
        use Range::{Linear, Log, Phase, Seed};
        let rated = drive.rated_n_m;
        let of = |size, low: f64, high: f64, shape: &[(&'static str, Range)]| Spec {
            size,
            range: (low, high),
            signed: false,
            shape: shape.to_vec(),
        };
        let signed = |spec: Spec| Spec { signed: true, ..spec };
        let pitch: &[(&str, Range)] = &[
            ("phase_2_rad", Phase),
            ("phase_1_rad", Phase),
            ("share_1", Linear(0.0, 0.7)),
            ("phase_4_rad", Phase),
            ("share_4", Linear(0.0, 0.35)),
            ("profile", Seed),
        ];
        match self {
            Self::CircularSplineEccentricity => of("amplitude_arcsec", 1.0, 80.0, &[("phase_rad", Phase)]),
            Self::FlexsplineRunout => {
                of("amplitude_arcsec", 1.0, 80.0, &[("phase_rad", Phase), ("wall_phase_rad", Phase)])
            }
            Self::CircularSplineOvality => of("amplitude_arcsec", 1.0, 100.0, &[("phase_rad", Phase)]),
            Self::FlexsplinePitchError | Self::CircularSplinePitchError => of("amplitude_arcsec", 1.0, 60.0, pitch),
            Self::GeneratorEccentricity => of(
                "amplitude_arcsec",
                1.0,
                60.0,
                &[
                    ("flexspline_phase_rad", Phase),
                    ("circular_spline_phase_rad", Phase),
                    ("flexspline_share", Linear(0.25, 0.75)),
                    ("tooth_share", Linear(0.3, 0.9)),
                ],
            ),
            Self::CamFormError => {
                of("amplitude_arcsec", 0.3, 15.0, &[("phase_rad", Phase), ("flank_phase_rad", Linear(0.3, 1.5))])
            }
            Self::DamagedTooth => of(
                "amplitude_arcsec",
                4.0,
                150.0,
                &[
                    ("position_rad", Phase),
                    ("wheel", Linear(0.0, 1.0)),
                    ("flank", Linear(-1.0, 1.0)),
                    ("half_width_rad", Linear(0.17, 0.45)),
                ],
            ),
            Self::BacklashGrowth => of("growth_arcsec", 3.0, 250.0, &[("phase_rad", Phase)]),
            Self::Wear => of("growth_arcsec", 3.0, 200.0, &[("running_in", Linear(0.1, 0.5))]),
            Self::StiffnessHardening => of("relative_at_rated", 0.03, 2.0, &[("knee", Linear(0.1, 0.3))]),
            Self::StiffnessError => signed(of("relative", 0.02, 0.6, &[])),
            Self::TorsionalHysteresis => of("half_width_arcsec", 1.0, 80.0, &[("yield", Linear(0.2, 0.7))]),
            Self::ThermalClearance => signed(of("arcsec_per_k", 0.02, 4.0, &[("lag_s", Log(40.0, 400.0))])),
            Self::ThermalStiffness => signed(of("relative_per_k", 2e-4, 8e-3, &[])),
            Self::LubricantViscosity => of("drag_n_m", 0.002 * rated, 0.5 * rated, &[("steepness", Linear(0.6, 1.4))]),
            Self::GravityTorque => of("torque_n_m", 0.003 * rated, 0.6 * rated, &[("phase_rad", Phase)]),
            Self::GravitySideLoad => of("amplitude_arcsec", 1.0, 80.0, &[("phase_rad", Phase)]),
            Self::TorsionalResonance => {
                of("participation", 0.01, 1.0, &[("frequency_hz", Log(4.0, 25.0)), ("damping_ratio", Log(0.01, 0.08))])
            }
            Self::OutputEncoderEccentricity => of("amplitude_arcsec", 0.5, 120.0, &[("phase_rad", Phase)]),
            Self::GeneratorEncoderEccentricity => of("amplitude_arcsec", 0.3, 40.0, &[("phase_rad", Phase)]),
            Self::SensorLatency => signed(of("delay_s", 2e-5, 1e-2, &[("skew", Linear(-0.6, 0.6))])),
            Self::RatioError => signed(of("relative", 1e-7, 1e-3, &[])),
            Self::Ratcheting => of("teeth", 1.0, 1.000_001, &[("when", Linear(0.25, 0.75))]),
        }
    }
}
