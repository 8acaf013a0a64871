//! Isotropic St Venant-Kirchhoff material in plane strain.
//!
//! `S = lambda tr(E) I + 2 mu E` with the Green-Lagrange strain `E`. For the strains of a strain wave drive (below
//! 2e-3) this is Hooke's law under arbitrarily large rotations.

/// Lamé constants in MPa.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneStrain {
    /// First Lamé constant (MPa).
    pub lambda: f64,
    /// Shear modulus (MPa).
    pub mu: f64,
}

impl PlaneStrain {
    /// From Young's modulus (MPa) and Poisson's ratio (below 0.5).
    pub fn new(youngs_modulus_mpa: f64, poissons_ratio: f64) -> Self {
        let (e, nu) = (youngs_modulus_mpa, poissons_ratio);
        assert!(e > 0.0 && nu > -1.0 && nu < 0.5, "material out of range: E {e}, nu {nu}");
        PlaneStrain { lambda: e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), mu: e / (2.0 * (1.0 + nu)) }
    }

    /// Second Piola-Kirchhoff stress `[S11, S22, S12]` (MPa) of the Green-Lagrange strain `[E11, E22, E12]`.
    #[inline(always)]
    pub(crate) fn stress(&self, strain: [f64; 3]) -> [f64; 3] {
        let [e11, e22, e12] = strain;
        let pressure = self.lambda * (e11 + e22);
        [pressure + 2.0 * self.mu * e11, pressure + 2.0 * self.mu * e22, 2.0 * self.mu * e12]
    }

    /// Poisson's ratio.
    #[inline]
    pub(crate) fn poissons_ratio(&self) -> f64 {
        self.lambda / (2.0 * (self.lambda + self.mu))
    }

    /// Von Mises stress (MPa) of the in-plane Cauchy stress `[s11, s22, s12]`; plane strain adds
    /// `s33 = nu (s11 + s22)`.
    #[inline]
    pub fn von_mises(&self, cauchy: [f64; 3]) -> f64 {
        let [s11, s22, s12] = cauchy;
        let s33 = self.poissons_ratio() * (s11 + s22);
        (0.5 * ((s11 - s22).powi(2) + (s22 - s33).powi(2) + (s33 - s11).powi(2)) + 3.0 * s12 * s12).sqrt()
    }
}
