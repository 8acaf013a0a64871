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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshDensity {
    /// Columns of the half tooth.
    pub tooth_columns: usize,
    /// Columns from the middle of the fillet to the space axis: half fillet and root land.
    pub space_columns: usize,
    /// Rows of the rim below the interface circle.
    pub rim_rows: usize,
    /// Rows between the interface circle and the fillet.
    pub root_rows: usize,
    /// Elements on the upper half of the fillet.
    pub fillet_elements: usize,
    /// Elements on the flank.
    pub flank_elements: usize,
}

impl MeshDensity {
    /// Multiple of the elements in each direction.
    pub fn times(self, factor: usize) -> MeshDensity {
        MeshDensity {
            tooth_columns: factor * self.tooth_columns,
            space_columns: factor * self.space_columns,
            rim_rows: factor * self.rim_rows,
            root_rows: factor * self.root_rows,
            fillet_elements: factor * self.fillet_elements,
            flank_elements: factor * self.flank_elements,
        }
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
        let [tooth_columns, space_columns, rim_rows, root_rows, fillet_elements, flank_elements] = match self {
            MeshLevel::Coarse => [1, 1, 1, 1, 1, 2],
            MeshLevel::Standard => [2, 2, 2, 2, 1, 3],
            MeshLevel::Fine => [4, 4, 4, 4, 2, 6],
        };
        MeshDensity { tooth_columns, space_columns, rim_rows, root_rows, fillet_elements, flank_elements }
    }

    /// Density of the circular spline: a solid ring that needs little, and flanks that need as much as the load is
    /// narrow.
    pub fn circular_spline(self) -> MeshDensity {
        let [tooth_columns, space_columns, rim_rows, root_rows, fillet_elements, flank_elements] = match self {
            MeshLevel::Coarse => [1, 1, 1, 1, 1, 2],
            MeshLevel::Standard => [1, 1, 1, 1, 1, 5],
            MeshLevel::Fine => [2, 2, 2, 2, 2, 10],
        };
        MeshDensity { tooth_columns, space_columns, rim_rows, root_rows, fillet_elements, flank_elements }
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
