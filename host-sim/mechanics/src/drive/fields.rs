//! Every number of a drive file, once: path, unit, meaning, range, and where it lives in [`Drive`]. Reading, writing,
//! overriding, checking and hashing all walk this list.

use super::as_built::{DamagedTooth, Harmonic};
use super::sleeve::{Choice, FaceLoad, Profile, SleeveKind};
use super::spec::Drive;
use crate::toml_file::{Allowed, above, from};

/// One number of the file.
pub(super) struct Field {
    /// `section.key`.
    pub path: &'static str,
    /// Meaning, for the comment in a written file.
    pub meaning: &'static str,
    pub range: Allowed,
    slot: fn(&mut Drive) -> Slot<'_>,
}

/// Where a field lives.
pub(super) enum Slot<'a> {
    Real(&'a mut f64),
    /// `"rigid"` in a file is `None`.
    RealOrRigid(&'a mut Option<f64>),
    Count(&'a mut u32),
    /// One of several names.
    Word(&'a mut dyn Choice),
    /// One number for each tooth, or none.
    List(&'a mut Vec<f64>),
    Harmonics(&'a mut Vec<Harmonic>),
    Damage(&'a mut Vec<DamagedTooth>),
}

impl Slot<'_> {
    /// True for zero, for an empty list, for a load that is even and for involutes.
    pub(crate) fn is_zero(&self) -> bool {
        match self {
            Slot::Real(number) => **number == 0.0,
            Slot::RealOrRigid(number) => **number == Some(0.0),
            Slot::Count(number) => **number == 0,
            Slot::Word(word) => [FaceLoad::Even.name(), Profile::Involute.name()].contains(&word.chosen()),
            Slot::List(list) => list.is_empty(),
            Slot::Harmonics(list) => list.is_empty(),
            Slot::Damage(list) => list.is_empty(),
        }
    }

    /// Every number that has a range of its own, `range` being that of the field: where it stands within the value, the
    /// number, the range.
    pub(crate) fn ranged<'f>(&self, range: &'f Allowed) -> Vec<(String, f64, &'f Allowed)> {
        let whole = |number: f64| vec![(String::new(), number, range)];
        match self {
            Slot::Real(number) => whole(**number),
            Slot::Count(number) => whole(f64::from(**number)),
            Slot::RealOrRigid(number) => number.map_or(Vec::new(), whole),
            Slot::Word(_) => Vec::new(),
            Slot::List(list) => list.iter().enumerate().map(|(k, x)| (format!("[{k}]"), *x, range)).collect(),
            Slot::Harmonics(list) => list
                .iter()
                .enumerate()
                .flat_map(|(k, harmonic)| {
                    [
                        (format!("[{k}].order"), f64::from(harmonic.order), &ORDER),
                        (format!("[{k}].amplitude_um"), harmonic.amplitude_um, range),
                        (format!("[{k}].phase_deg"), harmonic.phase_deg, &PHASE),
                    ]
                })
                .collect(),
            Slot::Damage(list) => {
                let depth = |(k, tooth): (usize, &DamagedTooth)| (format!("[{k}].depth_um"), tooth.depth_um, range);
                list.iter().enumerate().map(depth).collect()
            }
        }
    }
}

/// Allowed phases, degrees.
pub(super) const PHASE: Allowed = from(-360.0, 360.0);
/// Allowed orders of a harmonic; the drive narrows them.
pub(super) const ORDER: Allowed = from(1.0, 1000.0);
/// Allowed depths of a damage, µm.
pub(super) const DEPTH: Allowed = from(0.0, 500.0);
/// Allowed numbers of a damaged tooth; the drive narrows them.
pub(super) const TOOTH: Allowed = from(0.0, 2001.0);

/// The range of a field that is no number.
const NO_NUMBER: Allowed = from(0.0, 0.0);

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

/// Contents of each section of the file, for the comment in a written file.
pub(super) const SECTIONS: &[(&str, &str)] = &[
    ("flexspline", "the thin wheel with external teeth, undeformed; held by its sleeve"),
    ("circular_spline", "the ring with internal teeth; the output"),
    ("material", "of both wheels"),
    ("generator", "of all four wave generators; each takes what it has"),
    ("output", "what brakes the output beside its load"),
    (
        "sleeve",
        "what holds the rim of the flexspline: shells (hermetic: rim between two tubes; cup; hat: tube and flange), \
         springs or nothing",
    ),
    ("flanks", "where the teeth touch"),
    ("temperature", "what warmth changes"),
    (
        "as_built",
        "errors of the drive as it was made; 0 or [] is as drawn. A harmonic is amplitude cos(order (angle - phase))",
    ),
];

/// All fields, in the order of a written file.
pub(super) const ALL: &[Field] = fields! {
    flexspline.teeth: Count, from(20.0, 2000.0), "number of teeth, even";
    flexspline.module_mm: Real, from(0.05, 10.0), "module, mm";
    flexspline.profile: Word, NO_NUMBER,
        "flanks of both wheels: involutes, or S-shaped for more teeth in contact \
         (no pressure angle, a space made by its tooth)";
    flexspline.pressure_angle_deg: Real, from(10.0, 35.0), "pressure angle of the basic rack, degrees";
    flexspline.profile_shift: Real, from(-2.0, 10.0), "profile shift, modules; positive: teeth stand further out";
    flexspline.root_radius_mm: Real, above(0.0, 1000.0), "radius of the root circle, mm";
    flexspline.tip_radius_mm: Real, above(0.0, 1000.0), "radius of the tip circle, mm";
    flexspline.rim_thickness_mm: Real, above(0.0, 100.0), "rim under the root circle, mm";
    flexspline.width_mm: Real, above(0.0, 1000.0), "face width, mm";
    flexspline.root_fillet_mm: Real, from(0.002, 5.0), "radius of the root fillet, mm";
    flexspline.tip_rounding_mm: Real, from(0.002, 5.0), "radius of the tip rounding, mm";
    flexspline.face: Word, NO_NUMBER,
        "how the load lies along the face: evenly, or by slices of teeth that lean as the rim tapers";
    flexspline.taper_mrad: Real, from(-50.0, 50.0),
        "taper of the teeth along the face, mrad; positive: further in toward the open end";
    flexspline.crowning_um: Real, from(0.0, 500.0), "how far both ends of the face stand back from its middle, µm";
    circular_spline.teeth: Count, from(22.0, 2002.0), "number of teeth, two more than the flexspline";
    circular_spline.module_mm: Real, from(0.05, 10.0), "module, mm";
    circular_spline.pressure_angle_deg: Real, from(10.0, 35.0), "pressure angle of the basic rack, degrees";
    circular_spline.profile_shift: Real, from(-2.0, 10.0), "profile shift of the space, modules; positive: further out";
    circular_spline.root_radius_mm: Real, above(0.0, 1000.0), "radius of the root circle, mm";
    circular_spline.tip_radius_mm: Real, above(0.0, 1000.0), "radius of the tip circle, mm";
    circular_spline.outer_radius_mm: Real, above(0.0, 1000.0), "outer radius of the ring, held by the output, mm";
    circular_spline.root_fillet_mm: Real, from(0.002, 5.0), "radius of the root fillet, mm";
    circular_spline.tip_rounding_mm: Real, from(0.002, 5.0), "radius of the tip rounding, mm";
    material.youngs_modulus_mpa: Real, from(100.0, 1.0e6), "Young's modulus, MPa";
    material.poissons_ratio: Real, from(0.0, 0.49), "Poisson's ratio";
    material.density_kg_m3: Real, from(100.0, 30_000.0), "density, kg/m^3";
    generator.w0_mm: Real, above(0.0, 20.0), "radial displacement of the neutral layer on the major axis, outward, mm";
    generator.roller_diameter_mm: Real, above(0.0, 1000.0), "diameter of each roller, mm";
    generator.four_roller_angle_deg: Real, from(15.0, 38.0), "angle of the four rollers from the major axis, degrees";
    generator.disc_half_angle_deg: Real, from(5.0, 50.0), "half the contact angle of a disc, degrees";
    generator.bearing_stiffness_n_per_mm3: RealOrRigid, above(0.0, 1.0e7),
        "pressure per approach of the generator bearing, N/mm^3";
    output.drag_torque_n_m: Real, from(0.0, 1.0e4), "Coulomb drag on the circular spline, against its motion, N.m";
    sleeve.kind: Word, NO_NUMBER, "what holds the rim, and in how many dimensions it is computed";
    sleeve.wall_mm: Real, above(0.0, 100.0), "wall of the tubes, mm";
    sleeve.flange_side_mm: Real, above(0.0, 10_000.0), "tube from rim to flange, mm (hermetic, hat)";
    sleeve.bottom_side_mm: Real, above(0.0, 10_000.0),
        "tube from rim to the outer face of the bottom, mm (hermetic, cup)";
    sleeve.flange: Word, NO_NUMBER,
        "how the tube stands on its flange: clamped, or on a thin plate clamped to it further out";
    sleeve.bottom: Word, NO_NUMBER,
        "what closes the tube: held in its plane and free axially, a plate, or a massive body";
    sleeve.bottom_thickness_mm: Real, above(0.0, 100.0), "thickness of bottom = \"plate\", mm";
    sleeve.diaphragm_thickness_mm: Real, above(0.0, 100.0), "thickness of flange = \"diaphragm\", mm";
    sleeve.diaphragm_width_mm: Real, above(0.0, 1000.0), "from the tube to where a diaphragm is clamped, mm";
    sleeve.hub_radius_mm: Real, above(0.0, 1000.0), "hub on which the plate of a cup is clamped, radius, mm";
    sleeve.torsion_stiffness_n_m_per_rad: RealOrRigid, above(0.0, 1.0e12),
        "torsional stiffness of springs, or of what holds shells, N.m/rad";
    sleeve.lateral_stiffness_n_per_mm: Real, from(0.0, 1.0e9), "lateral stiffness of springs, rim to flange, N/mm";
    flanks.friction_coefficient: Real, from(0.0, 0.5), "Coulomb friction between the flanks";
    flanks.preload_um: Real, from(-50.0, 50.0),
        "how much deeper the flanks mesh than drawn, along their normal, µm; positive: preloaded, negative: clearance";
    temperature.reference_c: Real, from(-200.0, 300.0), "temperature at which the sizes hold, degrees C";
    temperature.minimum_c: Real, from(-200.0, 300.0), "lowest operating temperature, degrees C";
    temperature.maximum_c: Real, from(-200.0, 300.0), "highest operating temperature, degrees C";
    temperature.flexspline_expansion_per_k: Real, from(-1.0e-5, 1.0e-4),
        "linear expansion of the flexspline, 1/K; positive: longer when warmer";
    temperature.circular_spline_expansion_per_k: Real, from(-1.0e-5, 1.0e-4),
        "linear expansion of the circular spline, 1/K; positive: longer when warmer";
    temperature.generator_expansion_per_k: Real, from(-1.0e-5, 1.0e-4),
        "linear expansion of the generator, 1/K; positive: longer when warmer";
    temperature.housing_expansion_per_k: Real, from(-1.0e-5, 1.0e-4),
        "linear expansion of the circular spline's seat, 1/K; positive: longer when warmer";
    temperature.youngs_modulus_per_k: Real, from(-0.001, 0.001),
        "relative change of Young's modulus, 1/K; negative: softer when warmer";
    as_built.circular_spline_eccentricity_um: Real, from(0.0, 100.0), "toothing beside the axis it turns about, µm";
    as_built.circular_spline_eccentricity_phase_deg: Real, PHASE,
        "whereto, degrees on the circular spline, positive counter-clockwise from space 0";
    as_built.circular_spline_ovality_um: Real, from(0.0, 100.0), "amplitude of the oval, length kept, µm";
    as_built.circular_spline_ovality_phase_deg: Real, PHASE,
        "angle of a crest, degrees on the circular spline, positive counter-clockwise from space 0";
    as_built.circular_spline_pitch_harmonics: Harmonics, from(0.0, 100.0),
        "cumulative pitch error, positive counter-clockwise, [{ order, amplitude_um, phase_deg of a crest }, ...]";
    as_built.circular_spline_pitch_error_um: List, from(-100.0, 100.0),
        "position error of each space, or none, µm; positive counter-clockwise";
    as_built.circular_spline_offset_um: Real, from(0.0, 100.0), "its axis beside that of the housing, µm";
    as_built.circular_spline_offset_direction_deg: Real, PHASE,
        "whereto, degrees in the housing, positive counter-clockwise from the major axis at generator angle 0";
    as_built.flexspline_runout_um: Real, from(0.0, 100.0), "toothing beside the axis of the bore, µm";
    as_built.flexspline_runout_phase_deg: Real, PHASE,
        "whereto, degrees on the flexspline, positive counter-clockwise from tooth 0";
    as_built.flexspline_pitch_harmonics: Harmonics, from(0.0, 100.0),
        "cumulative pitch error, positive counter-clockwise, [{ order, amplitude_um, phase_deg of a crest }, ...]";
    as_built.flexspline_pitch_error_um: List, from(-100.0, 100.0),
        "position error of each tooth, or none, µm; positive counter-clockwise";
    as_built.rim_thickness_harmonics: Harmonics, from(0.0, 1000.0),
        "thickness of the rim, positive: thicker, [{ order, amplitude_um, phase_deg of a crest }, ...]";
    as_built.generator_eccentricity_um: Real, from(0.0, 100.0), "generator beside the axis it turns about, µm";
    as_built.generator_eccentricity_phase_deg: Real, PHASE,
        "whereto, degrees on the generator, positive counter-clockwise from the major axis";
    as_built.generator_lobe_asymmetry_um: Real, from(-100.0, 100.0),
        "lobe at 0 degrees less that at 180, µm; positive: the one at 0 is higher";
    as_built.cam_form_harmonics: Harmonics, from(0.0, 100.0),
        "form error of the cam, positive outward, [{ order, amplitude_um, phase_deg of a crest }, ...]";
    as_built.flexspline_wear_um: Real, from(0.0, 200.0), "depth worn off every flank, µm";
    as_built.circular_spline_wear_um: Real, from(0.0, 200.0), "depth worn off every flank, µm";
    as_built.damaged_teeth: Damage, DEPTH, "[{ wheel, tooth, flank = \"plus\", \"minus\" or \"both\", depth_um }, ...]";
    as_built.generator_warmer_k: Real, from(-100.0, 100.0),
        "generator less flexspline, K; positive: the generator is warmer";
    as_built.circular_spline_warmer_k: Real, from(-100.0, 100.0),
        "circular spline and its seat less flexspline, K; positive: they are warmer";
};

impl Field {
    /// `(section, key)`.
    pub fn split(&self) -> (&'static str, &'static str) {
        self.path.split_once('.').expect("every path has a section")
    }

    /// Meaning, unit, sign and what is allowed, for the comment in a written file.
    pub(crate) fn comment(&self, slot: &Slot<'_>) -> String {
        let range = &self.range;
        let allowed = match slot {
            Slot::Real(_) => range.to_string(),
            Slot::RealOrRigid(_) => format!("{range} or \"rigid\""),
            Slot::Count(_) => format!("a whole number, {range}"),
            Slot::Word(word) => word.names().iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", "),
            Slot::List(_) => format!("{range} each"),
            Slot::Harmonics(_) => format!("order {ORDER}, amplitude {range} µm, phase {PHASE}"),
            Slot::Damage(_) => format!("tooth from 0, depth {range} µm"),
        };
        format!("{}; {allowed}", self.meaning)
    }

    /// True if the file of this drive may leave it out: a stiffness that is not there is rigid, an imperfection that is
    /// not there is none, and of a sleeve only the sizes that it has are needed.
    pub(crate) fn is_optional(&self, drive: &Drive) -> bool {
        let sleeve = &drive.sleeve;
        match self.path {
            "sleeve.wall_mm" => !sleeve.is_shell(),
            "sleeve.flange_side_mm" => !sleeve.has_flange(),
            "sleeve.bottom_side_mm" => !sleeve.has_bottom(),
            "sleeve.lateral_stiffness_n_per_mm" => sleeve.kind != SleeveKind::Springs,
            "flexspline.pressure_angle_deg"
            | "circular_spline.pressure_angle_deg"
            | "circular_spline.profile_shift" => drive.flexspline.profile == Profile::S,
            _ if self.is_of_shells() || self.is_of_the_face() || self.is_of_the_profile() => true,
            _ => self.is_imperfection() || matches!(self.slot(&mut Drive::hhd_95()), Slot::RealOrRigid(_)),
        }
    }

    /// True for what only a sleeve of shells has.
    pub(crate) fn is_of_shells(&self) -> bool {
        self.split().0 == "sleeve" && !self.path.contains("stiffness")
    }

    /// True for what teeth that are straight along the face have not.
    pub(crate) fn is_of_the_face(&self) -> bool {
        matches!(self.path, "flexspline.face" | "flexspline.taper_mrad" | "flexspline.crowning_um")
    }

    /// True for what involutes without preload have not.
    pub(crate) fn is_of_the_profile(&self) -> bool {
        matches!(self.path, "flexspline.profile" | "flanks.preload_um")
    }

    /// True for what an ideal drive has not.
    pub(crate) fn is_imperfection(&self) -> bool {
        self.split().0 == "as_built"
    }

    pub(crate) fn slot<'a>(&self, drive: &'a mut Drive) -> Slot<'a> {
        (self.slot)(drive)
    }
}

impl Drive {
    /// A number of the file by its path, `section.key`; none of another kind than a number.
    pub fn number_mut(&mut self, path: &str) -> Option<&mut f64> {
        match ALL.iter().find(|field| field.path == path)?.slot(self) {
            Slot::Real(number) => Some(number),
            _ => None,
        }
    }
}

/// Calls `visit` with every field and its value.
pub(super) fn for_each(drive: &Drive, mut visit: impl FnMut(&Field, Slot<'_>)) {
    let mut drive = drive.clone();
    ALL.iter().for_each(|field| visit(field, field.slot(&mut drive)));
}
