//! How fine the meshes are: three levels, each about twice as fine as the one before in both directions.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::suggest::UnknownName;

/// Elements of one half sector of a wheel, in each direction.
///
/// ```text
///              tip
///            +-----+
///            |  B  | flank        A rim, B tooth, C foot of the fillet and root land
///            |     +--.
///            |    /  C `--+ root land
///            +---+--------+       interface circle
///            |   A        |
///            +------------+       bore (flexspline) or outer radius (circular spline)
///        tooth axis    space axis
/// ```
///
/// In this order: columns of the half tooth; columns from the middle of the fillet to the space axis, half fillet and
/// root land; rows of the rim below the interface circle; rows between the interface circle and the fillet; elements on
/// the upper half of the fillet; elements on the flank.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshDensity(pub [usize; 6]);

impl MeshDensity {
    /// Multiple of the elements in each direction.
    pub fn times(self, factor: usize) -> MeshDensity {
        MeshDensity(self.0.map(|elements| factor * elements))
    }
}

/// A named pair of densities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MeshLevel {
    /// For quick looks and tests.
    Coarse,
    /// The default: the output angle is within 0.1″ of the next level.
    Standard,
    /// For refinement studies.
    Fine,
}

impl MeshLevel {
    /// All levels, coarse to fine.
    pub const ALL: [MeshLevel; 3] = [MeshLevel::Coarse, MeshLevel::Standard, MeshLevel::Fine];
    /// Their names.
    pub const NAMES: [&'static str; 3] = ["coarse", "standard", "fine"];

    /// Density of the flexspline. Two rows at the root matter most: the rim bends between the teeth, and one row there
    /// is 0.4″ out in the wind-up of the four-roller drive at 50 N·m, columns and rim rows hardly count.
    pub fn flexspline(self) -> MeshDensity {
        MeshDensity(match self {
            MeshLevel::Coarse => [1, 1, 1, 1, 1, 2],
            MeshLevel::Standard => [2, 2, 2, 2, 1, 3],
            MeshLevel::Fine => [4, 4, 4, 4, 2, 6],
        })
    }

    /// Density of the circular spline: a solid ring that needs little, and flanks that need as much as the load is
    /// narrow.
    pub fn circular_spline(self) -> MeshDensity {
        MeshDensity(match self {
            MeshLevel::Coarse => [1, 1, 1, 1, 1, 2],
            MeshLevel::Standard => [1, 1, 1, 1, 1, 5],
            MeshLevel::Fine => [2, 2, 2, 2, 2, 10],
        })
    }
}

impl fmt::Display for MeshLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::NAMES[*self as usize])
    }
}

impl FromStr for MeshLevel {
    type Err = UnknownName;

    fn from_str(text: &str) -> Result<Self, UnknownName> {
        let unknown = || UnknownName { what: "mesh level", found: text.to_owned(), known: &Self::NAMES };
        Self::ALL.into_iter().find(|level| Self::NAMES[*level as usize] == text).ok_or_else(unknown)
    }
}
