//! How fine the meshes are: three levels, each about twice as fine as the one before in both directions.

use std::fmt;
use std::str::FromStr;

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
    /// Elements on the involute flank.
    pub flank_elements: usize,
}

/// A named pair of densities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum MeshLevel {
    /// For quick looks and tests.
    Coarse,
    /// What ships: the output angle is within 0.1″ of the next level.
    Standard,
    /// For refinement studies.
    Fine,
}

impl MeshLevel {
    /// All levels, coarse to fine.
    pub const ALL: [MeshLevel; 3] = [MeshLevel::Coarse, MeshLevel::Standard, MeshLevel::Fine];

    /// Density of the flexspline.
    pub fn flexspline(self) -> MeshDensity {
        match self {
            MeshLevel::Coarse => MeshDensity {
                tooth_columns: 2,
                space_columns: 1,
                rim_rows: 2,
                root_rows: 1,
                fillet_elements: 1,
                flank_elements: 2,
            },
            MeshLevel::Standard => MeshDensity {
                tooth_columns: 2,
                space_columns: 2,
                rim_rows: 2,
                root_rows: 1,
                fillet_elements: 1,
                flank_elements: 4,
            },
            MeshLevel::Fine => MeshDensity {
                tooth_columns: 4,
                space_columns: 4,
                rim_rows: 4,
                root_rows: 2,
                fillet_elements: 2,
                flank_elements: 8,
            },
        }
    }

    /// Density of the circular spline, whose solid ring needs less than the bending flexspline.
    pub fn circular_spline(self) -> MeshDensity {
        match self {
            MeshLevel::Coarse => MeshDensity {
                tooth_columns: 1,
                space_columns: 1,
                rim_rows: 2,
                root_rows: 1,
                fillet_elements: 1,
                flank_elements: 2,
            },
            MeshLevel::Standard => MeshDensity {
                tooth_columns: 2,
                space_columns: 1,
                rim_rows: 2,
                root_rows: 1,
                fillet_elements: 1,
                flank_elements: 3,
            },
            MeshLevel::Fine => MeshDensity {
                tooth_columns: 4,
                space_columns: 2,
                rim_rows: 4,
                root_rows: 2,
                fillet_elements: 2,
                flank_elements: 6,
            },
        }
    }
}

impl fmt::Display for MeshLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            MeshLevel::Coarse => "coarse",
            MeshLevel::Standard => "standard",
            MeshLevel::Fine => "fine",
        })
    }
}

impl FromStr for MeshLevel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        MeshLevel::ALL
            .into_iter()
            .find(|level| level.to_string() == text)
            .ok_or_else(|| format!("mesh level \"{text}\": allowed are coarse, standard, fine"))
    }
}
