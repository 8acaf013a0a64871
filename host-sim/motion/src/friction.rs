//! Friction of motor and generator, and hysteresis of the drive.

/// Friction on the motor's side, all at the output: Coulomb and Stribeck parts with and without load, and viscous drag,
/// the last growing in the cold.
///
/// ```text
/// friction = base + load_base·|F| + exp(−|v/v_s|^α)·(stribeck + load_stribeck·|F|),   drag = viscous·v
/// ```
/// with the torque in the mesh `F` and the speed `v` of motor over ratio: model M4 of M. Duclusaud, G. Passault and
/// others, "Extended friction models for the physics simulation of servo actuators", arXiv:2410.08650.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Coulomb part, N·m.
    pub base_n_m: f64,
    /// Coulomb part for each N·m in the mesh.
    pub load_base: f64,
    /// Stiction above sliding friction, N·m.
    pub stribeck_n_m: f64,
    /// Stiction above sliding friction for each N·m in the mesh.
    pub load_stribeck: f64,
    /// Speed over which sticking ends, rad/s.
    pub stribeck_rad_s: f64,
    /// How suddenly.
    pub stribeck_exponent: f64,
    /// Viscous, N·m·s/rad.
    pub viscous_n_m_s: f64,
    /// Temperature at which all that holds, °C.
    pub reference_c: f64,
    /// Kelvin by which it has to get colder for the drag to be e times as large.
    pub cold_k: f64,
}

/// Kelvin for a factor e: three times the torque without load at −10 °C that there is at 20 °C, as catalogues' curves
/// of the no-load running torque go. A prior, not measured by us.
pub(crate) const CATALOGUE_COLD_K: f64 = 27.3;

impl Friction {
    /// None.
    pub const NONE: Friction = Friction {
        base_n_m: 0.0,
        load_base: 0.0,
        stribeck_n_m: 0.0,
        load_stribeck: 0.0,
        stribeck_rad_s: 1.0,
        stribeck_exponent: 1.0,
        viscous_n_m_s: 0.0,
        reference_c: 20.0,
        cold_k: CATALOGUE_COLD_K,
    };

    /// eRob80 with a strain wave drive of ratio 100: `params/erob80_100/m4.json` of the repository Rhoban/bam (commit
    /// f016154).
    pub const EROB80_100: Friction = Friction {
        base_n_m: 1.25e-4,
        load_base: 2.13e-6,
        stribeck_n_m: 4.382,
        load_stribeck: 0.1661,
        stribeck_rad_s: 1.977,
        stribeck_exponent: 3.0,
        viscous_n_m_s: 9.029,
        ..Friction::NONE
    };

    /// Factor on the friction at every speed and load.
    pub fn times(&self, share: f64) -> Self {
        Self {
            base_n_m: share * self.base_n_m,
            load_base: share * self.load_base,
            stribeck_n_m: share * self.stribeck_n_m,
            load_stribeck: share * self.load_stribeck,
            viscous_n_m_s: share * self.viscous_n_m_s,
            ..*self
        }
    }

    /// Factor of the cold.
    pub fn cold(&self, temperature_c: f64) -> f64 {
        libm::exp((self.reference_c - temperature_c) / self.cold_k)
    }

    /// Coulomb friction at a speed, with a torque in the mesh, N·m.
    pub(crate) fn level_n_m(&self, rate_rad_s: f64, mesh_n_m: f64) -> f64 {
        let [idle, by_load] = self.parts(rate_rad_s);
        idle + by_load * mesh_n_m.abs()
    }

    /// Coulomb friction at a speed: without load, N·m, and what each N·m in the mesh adds.
    pub fn parts(&self, rate_rad_s: f64) -> [f64; 2] {
        let slow = libm::exp(-libm::pow((rate_rad_s / self.stribeck_rad_s).abs(), self.stribeck_exponent));
        [self.base_n_m + slow * self.stribeck_n_m, self.load_base + slow * self.load_stribeck]
    }
}
