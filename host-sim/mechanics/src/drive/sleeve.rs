//! Support of the flexspline's rim: its sleeve or cup, or springs in its place.

use serde::{Serialize, Serializer};

use super::error::Misfits;
use super::fields::{NO_NUMBER, section};
use crate::toml_file::{above, from};

/// A choice among names in a drive file.
pub(super) trait Choice {
    /// All names.
    fn names(&self) -> Vec<&'static str>;
    /// The name chosen.
    fn chosen(&self) -> &'static str;
    /// Chooses by name; false, and nothing changed, for a name that is none.
    fn choose(&mut self, name: &str) -> bool;
}

macro_rules! choice {
    ($(#[$about:meta])* $type:ident { $($(#[$doc:meta])* $variant:ident = $name:literal),* $(,)? }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum $type {
            $($(#[$doc])* $variant),*
        }

        impl $type {
            /// All of them.
            pub const ALL: &[$type] = &[$($type::$variant),*];

            /// Its name in a drive file.
            pub const fn name(self) -> &'static str {
                match self {
                    $($type::$variant => $name),*
                }
            }
        }

        impl Choice for $type {
            fn names(&self) -> Vec<&'static str> {
                Self::ALL.iter().map(|one| one.name()).collect()
            }

            fn chosen(&self) -> &'static str {
                self.name()
            }

            fn choose(&mut self, name: &str) -> bool {
                Self::ALL.iter().find(|one| one.name() == name).map(|one| *self = *one).is_some()
            }
        }

        impl Serialize for $type {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.name())
            }
        }
    };
}
pub(super) use choice;

choice! {
    /// Support of the rim.
    SleeveKind {
        /// The rim in the middle of a closed sleeve: a tube to the flange on one side, a tube with a bottom on the
        /// other.
        Hermetic = "hermetic",
        /// The rim at the open end of a cup, whose bottom is on the shaft.
        Cup = "cup",
        /// The rim at the open end of a tube with a flange (a silk hat).
        Hat = "hat",
        /// Two springs on the rim, in torsion and sideways; a plane model.
        Springs = "springs",
        /// Nothing but that it does not turn; a plane model.
        None = "none",
    }
}

choice! {
    /// How the tube stands on its flange.
    Flange {
        /// Clamped.
        Rigid = "rigid",
        /// On a thin ring-shaped plate that is clamped further out.
        Diaphragm = "diaphragm",
    }
}

choice! {
    /// The form of the flanks of both wheels.
    Profile {
        /// Involutes.
        Involute = "involute",
        /// S-shaped: the path of a tooth made half as large, and the space that it leaves free on its way under the
        /// cam.
        S = "s",
    }
}

choice! {
    /// How the load lies along the face of the teeth.
    FaceLoad {
        /// Evenly: teeth stay straight, whatever the rim does.
        Even = "even",
        /// Slice by slice: teeth lean along their face as the rim tapers, and by their taper and crowning.
        Slices = "slices",
    }
}

choice! {
    /// End of the other tube.
    Bottom {
        /// Held in its plane, free along the axis: a bottom that is stiff as a membrane and bends without force.
        Disc = "disc",
        /// A plate of finite thickness.
        Plate = "plate",
        /// Clamped: a massive bottom.
        Clamped = "clamped",
    }
}

section! {
    /// The sleeve of the flexspline.
    Sleeve = sleeve,
        "what holds the rim of the flexspline: shells (hermetic: rim between two tubes; cup; hat: tube and flange), \
         springs or nothing";
    /// Support of the rim.
    kind: Word(SleeveKind), NO_NUMBER, "what holds the rim, and in how many dimensions it is computed";
    /// Wall of the tubes, mm.
    wall_mm: Real, above(0.0, 100.0), "wall of the tubes, mm";
    /// From the rim to the flange, mm (hermetic sleeve, hat).
    flange_side_mm: Real, above(0.0, 10_000.0), "tube from rim to flange, mm (hermetic, hat)";
    /// From the rim to the outer face of the bottom, mm (hermetic sleeve, cup).
    bottom_side_mm: Real, above(0.0, 10_000.0), "tube from rim to the outer face of the bottom, mm (hermetic, cup)";
    /// How the tube stands on its flange.
    flange: Word(Flange), NO_NUMBER,
        "how the tube stands on its flange: clamped, or on a thin plate clamped to it further out";
    /// End of the other tube.
    bottom: Word(Bottom), NO_NUMBER,
        "what closes the tube: held in its plane and free axially, a plate, or a massive body";
    /// Thickness of a bottom that is a plate, mm.
    bottom_thickness_mm: Real, above(0.0, 100.0), "thickness of bottom = \"plate\", mm";
    /// Thickness of a flange that is a diaphragm, mm.
    diaphragm_thickness_mm: Real, above(0.0, 100.0), "thickness of flange = \"diaphragm\", mm";
    /// How far outside the tube a diaphragm is clamped, mm.
    diaphragm_width_mm: Real, above(0.0, 1000.0), "from the tube to where a diaphragm is clamped, mm";
    /// Radius of the hub on which the bottom of a cup is clamped, mm.
    hub_radius_mm: Real, above(0.0, 1000.0), "hub on which the plate of a cup is clamped, radius, mm";
    /// Torsional stiffness, N·m/rad, of springs in place of the sleeve, or of what holds a sleeve of shells; `None` is
    /// rigid.
    torsion_stiffness_n_m_per_rad: RealOrRigid, above(0.0, 1.0e12),
        "torsional stiffness of springs, or of what holds shells, N·m/rad";
    /// Lateral stiffness of springs in place of the sleeve, N/mm; 0 leaves the rim to the generator.
    lateral_stiffness_n_per_mm: Real, from(0.0, 1.0e9), "lateral stiffness of springs, rim to flange, N/mm";
}

impl Default for Sleeve {
    /// No third dimension, and the sizes of the sleeve that HHD-95 would have: 0.5 mm, 140 mm on both sides, a rigid
    /// flange. The plate of a bottom, the diaphragm and the hub are of usual proportions.
    fn default() -> Sleeve {
        Sleeve {
            kind: SleeveKind::Springs,
            wall_mm: 0.5,
            flange_side_mm: 140.0,
            bottom_side_mm: 140.0,
            flange: Flange::Rigid,
            bottom: Bottom::Disc,
            bottom_thickness_mm: 2.0,
            diaphragm_thickness_mm: 0.5,
            diaphragm_width_mm: 15.0,
            hub_radius_mm: 20.0,
            torsion_stiffness_n_m_per_rad: None,
            lateral_stiffness_n_per_mm: 0.0,
        }
    }
}

impl Sleeve {
    /// Whether it is shells, in three dimensions.
    pub fn is_shell(&self) -> bool {
        matches!(self.kind, SleeveKind::Hermetic | SleeveKind::Cup | SleeveKind::Hat)
    }

    /// Whether it has a tube to a flange.
    pub fn has_flange(&self) -> bool {
        matches!(self.kind, SleeveKind::Hermetic | SleeveKind::Hat)
    }

    /// Whether it has a tube to a bottom.
    pub fn has_bottom(&self) -> bool {
        matches!(self.kind, SleeveKind::Hermetic | SleeveKind::Cup)
    }

    /// Whether its sizes go together, on a rim of this neutral radius.
    pub(super) fn fit(&self, radius_mm: f64, misfits: &mut Misfits<'_>) {
        const TORSION: &str = "sleeve.torsion_stiffness_n_m_per_rad";
        const LATERAL: &str = "sleeve.lateral_stiffness_n_per_mm";
        let is_stiff = self.lateral_stiffness_n_per_mm != 0.0;
        if !self.is_shell() {
            if self.kind == SleeveKind::None {
                let rigid = ", allowed with kind = \"none\": \"rigid\" (springs need kind = \"springs\")";
                misfits.require(self.torsion_stiffness_n_m_per_rad.is_none(), TORSION, rigid);
                let zero = ", allowed with kind = \"none\": 0 (springs need kind = \"springs\")";
                misfits.require(!is_stiff, LATERAL, zero);
            }
            return;
        }
        let thin = 0.1 * radius_mm;
        let allowed = format!(", allowed: up to {thin:.4} (a tenth of the neutral radius: a thin shell)");
        misfits.require(self.wall_mm <= thin, "sleeve.wall_mm", allowed);
        let shortest = 2.0 * self.wall_mm;
        for (field, length, there) in [
            ("sleeve.flange_side_mm", self.flange_side_mm, self.has_flange()),
            ("sleeve.bottom_side_mm", self.bottom_side_mm, self.has_bottom()),
        ] {
            let allowed = format!(", allowed: at least {shortest} (two walls: a tube)");
            misfits.require(!there || length >= shortest, field, allowed);
        }
        let kind = self.kind.name();
        let zero = format!(", allowed with kind = \"{kind}\": 0 (the shells hold the rim sideways)");
        misfits.require(!is_stiff, LATERAL, zero);
        if self.has_bottom() && self.bottom == Bottom::Plate && self.bottom_side_mm >= shortest {
            let thickest = (self.bottom_side_mm - shortest).min(0.2 * radius_mm);
            let allowed = format!(", allowed: up to {thickest:.4} (a plate inside the end of the tube)");
            misfits.require(self.bottom_thickness_mm <= thickest, "sleeve.bottom_thickness_mm", allowed);
            let widest = 0.95 * radius_mm;
            let fits = self.kind != SleeveKind::Cup || self.hub_radius_mm <= widest;
            let allowed = format!(", allowed: up to {widest:.4} (inside the tube)");
            misfits.require(fits, "sleeve.hub_radius_mm", allowed);
        }
        if self.has_flange() && self.flange == Flange::Diaphragm {
            let thickest = 0.2 * radius_mm;
            let allowed = format!(", allowed: up to {thickest:.4} (a thin plate)");
            misfits.require(self.diaphragm_thickness_mm <= thickest, "sleeve.diaphragm_thickness_mm", allowed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::spec::Drive;

    /// Tables and results of drives without shells stand under the hash they had before there were any.
    #[test]
    fn sizes_of_shells_count_only_where_there_are_shells() {
        let drive = Drive::hhd_95();
        let thicker = drive.with_set("sleeve.wall_mm=0.7").unwrap();
        assert_eq!(thicker.hash(), drive.hash());
        assert_eq!(drive.hash(), Drive::hhd_95_plane().hash());
        let hermetic = drive.with_set("sleeve.kind=hermetic").unwrap();
        assert_ne!(hermetic.hash(), drive.hash());
        assert_ne!(hermetic.hash(), thicker.with_set("sleeve.kind=hermetic").unwrap().hash());
        assert_ne!(hermetic.hash(), hermetic.with_set("sleeve.flange=diaphragm").unwrap().hash());
    }

    #[test]
    fn a_warm_sleeve_is_larger() {
        let warm = Drive::cup_95().at_temperature(70.0);
        let scale = warm.thermal_state.flexspline_scale;
        assert!((warm.sleeve.wall_mm / 0.7 - scale).abs() < 1e-12 && scale > 1.0);
    }
}
