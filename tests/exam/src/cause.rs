//! The causes that the written contract names.

macro_rules! causes {
    ($($variant:ident $name:literal),* $(,)?) => {
        /// One physical cause of a discrepancy.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Cause { $($variant),* }

        impl Cause {
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
