//! Every number of a drive file, once: path, unit, meaning, range, and where it lives in [`Drive`]. Reading, writing,
//! overriding, checking and hashing all walk this list.

use super::spec::Drive;

/// One number of the file.
pub(super) struct Field {
    /// `section.key`.
    pub path: &'static str,
    /// What it is, for the comment in a written file.
    pub meaning: &'static str,
    pub range: Range,
    slot: fn(&mut Drive) -> Slot<'_>,
}

/// Where a field lives.
pub(super) enum Slot<'a> {
    Real(&'a mut f64),
    /// `"rigid"` in a file is `None`.
    RealOrRigid(&'a mut Option<f64>),
    Count(&'a mut u32),
}

/// Allowed values; the lower end belongs to it unless `above`.
pub(super) struct Range {
    pub low: f64,
    pub high: f64,
    above: bool,
}

impl Range {
    /// Why `number` is refused, if it is.
    pub fn refusal(&self, number: f64) -> Option<String> {
        // false for NaN
        let high_enough = if self.above { number > self.low } else { number >= self.low };
        let inside = high_enough && number <= self.high;
        (!inside).then(|| format!("found {number}, allowed: {self}"))
    }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let from = if self.above { "above " } else { "" };
        write!(f, "{from}{} to {}", self.low, self.high)
    }
}

const fn from(low: f64, high: f64) -> Range {
    Range { low, high, above: false }
}

const fn above(low: f64, high: f64) -> Range {
    Range { low, high, above: true }
}

macro_rules! fields {
    ($($section:ident . $key:ident : $slot:ident, $range:expr, $meaning:literal;)*) => {
        &[$(Field {
            path: concat!(stringify!($section), ".", stringify!($key)),
            meaning: $meaning,
            range: $range,
            slot: |drive| Slot::$slot(&mut drive.$section.$key),
        }),*]
    };
}

/// All fields, in the order of a written file.
pub(super) const ALL: &[Field] = fields! {
    flexspline.teeth: Count, from(20.0, 2000.0), "number of teeth, even";
    flexspline.module_mm: Real, from(0.05, 10.0), "module, mm";
    flexspline.pressure_angle_deg: Real, from(10.0, 35.0), "pressure angle of the basic rack, degrees";
    flexspline.profile_shift: Real, from(-2.0, 10.0), "profile shift, modules";
    flexspline.root_radius_mm: Real, above(0.0, 1000.0), "radius of the root circle, mm";
    flexspline.tip_radius_mm: Real, above(0.0, 1000.0), "radius of the tip circle, mm";
    flexspline.rim_thickness_mm: Real, above(0.0, 100.0), "rim under the root circle, mm";
    flexspline.width_mm: Real, above(0.0, 1000.0), "face width, mm";
    flexspline.root_fillet_mm: Real, from(0.002, 5.0), "radius of the root fillet, mm";
    flexspline.tip_rounding_mm: Real, from(0.002, 5.0), "radius of the tip rounding, mm";
    circular_spline.teeth: Count, from(22.0, 2002.0), "number of teeth, two more than the flexspline";
    circular_spline.module_mm: Real, from(0.05, 10.0), "module, mm";
    circular_spline.pressure_angle_deg: Real, from(10.0, 35.0), "pressure angle of the basic rack, degrees";
    circular_spline.profile_shift: Real, from(-2.0, 10.0), "profile shift of the space, modules";
    circular_spline.root_radius_mm: Real, above(0.0, 1000.0), "radius of the root circle, mm";
    circular_spline.tip_radius_mm: Real, above(0.0, 1000.0), "radius of the tip circle, mm";
    circular_spline.outer_radius_mm: Real, above(0.0, 1000.0), "outer radius of the ring, held by the output, mm";
    circular_spline.root_fillet_mm: Real, from(0.002, 5.0), "radius of the root fillet, mm";
    circular_spline.tip_rounding_mm: Real, from(0.002, 5.0), "radius of the tip rounding, mm";
    material.youngs_modulus_mpa: Real, from(100.0, 1.0e6), "Young's modulus, MPa";
    material.poissons_ratio: Real, from(0.0, 0.49), "Poisson's ratio";
    material.density_kg_m3: Real, from(100.0, 30_000.0), "density, kg/m^3";
    generator.w0_mm: Real, above(0.0, 20.0), "radial displacement of the neutral layer on the major axis, mm";
    generator.roller_diameter_mm: Real, above(0.0, 1000.0), "diameter of each roller, mm";
    generator.four_roller_angle_deg: Real, from(15.0, 38.0), "angle of the four rollers from the major axis, degrees";
    generator.disc_half_angle_deg: Real, from(5.0, 50.0), "half the contact angle of a disc, degrees";
    generator.bearing_stiffness_n_per_mm3: RealOrRigid, above(0.0, 1.0e7), "pressure per approach of the generator bearing, N/mm^3";
    output.drag_torque_n_m: Real, from(0.0, 1.0e4), "Coulomb drag on the circular spline, N.m";
    sleeve.torsion_stiffness_n_m_per_rad: RealOrRigid, above(0.0, 1.0e12), "torsional stiffness, rim to flange, N.m/rad";
    sleeve.lateral_stiffness_n_per_mm: Real, from(0.0, 1.0e9), "lateral stiffness, rim to flange, N/mm";
    flanks.friction_coefficient: Real, from(0.0, 0.5), "Coulomb friction between the flanks";
    temperature.reference_c: Real, from(-200.0, 300.0), "temperature at which the sizes hold, degrees C";
    temperature.minimum_c: Real, from(-200.0, 300.0), "lowest operating temperature, degrees C";
    temperature.maximum_c: Real, from(-200.0, 300.0), "highest operating temperature, degrees C";
    temperature.flexspline_expansion_per_k: Real, from(-1.0e-5, 1.0e-4), "linear expansion of the flexspline, 1/K";
    temperature.circular_spline_expansion_per_k: Real, from(-1.0e-5, 1.0e-4), "linear expansion of the circular spline, 1/K";
    temperature.generator_expansion_per_k: Real, from(-1.0e-5, 1.0e-4), "linear expansion of the generator, 1/K";
    temperature.housing_expansion_per_k: Real, from(-1.0e-5, 1.0e-4), "linear expansion of the circular spline's seat, 1/K";
    temperature.youngs_modulus_per_k: Real, from(-0.001, 0.001), "relative change of Young's modulus, 1/K";
};

impl Field {
    /// `(section, key)`.
    pub fn split(&self) -> (&'static str, &'static str) {
        self.path.split_once('.').expect("every path has a section")
    }

    pub fn slot<'a>(&self, drive: &'a mut Drive) -> Slot<'a> {
        (self.slot)(drive)
    }
}

/// Calls `visit` with every field and its value, `None` for rigid.
pub(super) fn for_each(drive: &Drive, mut visit: impl FnMut(&Field, Option<f64>)) {
    let mut drive = drive.clone();
    for field in ALL {
        let value = match field.slot(&mut drive) {
            Slot::Real(number) => Some(*number),
            Slot::RealOrRigid(number) => *number,
            Slot::Count(number) => Some(f64::from(*number)),
        };
        visit(field, value);
    }
}
