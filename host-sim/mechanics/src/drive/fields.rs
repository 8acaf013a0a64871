//! Every number of a drive file, once: path, unit, meaning, range, and where it lives in [`Drive`], section by section
//! beside the struct that holds it. Reading, writing, overriding, checking and hashing all walk this list.

use super::as_built::{AsBuilt, DamagedTooth, Harmonic};
use super::sleeve::{Choice, FaceLoad, Profile, Sleeve, SleeveKind};
use super::spec::{CircularSpline, Drive, Flanks, Flexspline, Generators, Material, OutputLoadPath, Temperature};
use crate::toml_file::{Allowed, from};

/// One number of the file.
pub(super) struct Field {
    /// `section.key`.
    pub path: &'static str,
    /// Meaning, for the comment in a written file.
    pub meaning: &'static str,
    pub range: Allowed,
    pub slot: fn(&mut Drive) -> Slot<'_>,
}

/// A section of the file.
pub(super) struct FieldSection {
    pub name: &'static str,
    /// For the comment in a written file.
    pub contents: &'static str,
    pub fields: &'static [Field],
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
pub(super) const NO_NUMBER: Allowed = from(0.0, 0.0);

/// What a slot of a kind holds.
macro_rules! held {
    (Real) => { f64 };
    (RealOrRigid) => { Option<f64> };
    (Count) => { u32 };
    (Word $choice:ident) => { $choice };
    (List) => { Vec<f64> };
    (Harmonics) => { Vec<Harmonic> };
    (Damage) => { Vec<DamagedTooth> };
}
pub(super) use held;

/// A section of the file: the struct that holds it, and what the file says of each field.
macro_rules! section {
    (
        $(#[$about:meta])* $type:ident = $section:ident, $contents:literal;
        $($(#[$doc:meta])* $key:ident: $slot:ident $(($choice:ident))?, $range:expr, $meaning:literal;)*
    ) => {
        #[derive(Debug, Clone, PartialEq, Serialize)]
        $(#[$about])*
        pub struct $type {
            $($(#[$doc])* pub $key: super::fields::held!($slot $($choice)?)),*
        }

        impl $type {
            pub(super) const SECTION: super::fields::FieldSection = super::fields::FieldSection {
                name: stringify!($section),
                contents: $contents,
                fields: &[$(super::fields::Field {
                    path: concat!(stringify!($section), ".", stringify!($key)),
                    meaning: $meaning,
                    range: $range,
                    slot: |drive| super::fields::Slot::$slot(&mut drive.$section.$key),
                }),*],
            };
        }
    };
}
pub(super) use section;

/// All sections, in the order of a written file.
pub(super) static SECTIONS: [FieldSection; 9] = [
    Flexspline::SECTION,
    CircularSpline::SECTION,
    Material::SECTION,
    Generators::SECTION,
    OutputLoadPath::SECTION,
    Sleeve::SECTION,
    Flanks::SECTION,
    Temperature::SECTION,
    AsBuilt::SECTION,
];

/// All fields, in the order of a written file.
pub(super) fn all() -> impl Iterator<Item = &'static Field> {
    SECTIONS.iter().flat_map(|section| section.fields)
}

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

    /// True for what involutes without preload, of a drive that is its FEM alone, have not.
    pub(crate) fn is_of_the_profile(&self) -> bool {
        matches!(self.path, "flexspline.profile" | "flanks.preload_um" | "output.contact_compliance")
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
        match all().find(|field| field.path == path)?.slot(self) {
            Slot::Real(number) => Some(number),
            _ => None,
        }
    }
}

/// Calls `visit` with every field and its value.
pub(super) fn for_each(drive: &Drive, mut visit: impl FnMut(&Field, Slot<'_>)) {
    let mut drive = drive.clone();
    all().for_each(|field| visit(field, field.slot(&mut drive)));
}
