//! A finished table and what is said about it in JSON.

use flexspline_make::Sample;
use serde::Serialize;

use super::complete::Completed;
use crate::cautions::Caution;
use crate::data_sheet::Stiffness;
use crate::simulate::PlaceStress;
use crate::stated::{SheetBeside, Stated, short};
use flexspline_mechanics::drive::GeneratorKind;

/// A finished table.
#[derive(Debug, Clone)]
pub struct MadeTable {
    /// Which generator.
    pub kind: GeneratorKind,
    /// The `.fxt` image.
    pub image: Vec<u8>,
    /// Its description in JSON.
    pub info: TableInfo,
    /// The samples of its sweep, if it was swept.
    pub samples: Option<Vec<Sample>>,
}

impl MadeTable {
    /// The samples of its sweep as the FEM has them, without what a data sheet added.
    pub fn fem_samples(&self) -> Option<Vec<Sample>> {
        let mut samples = self.samples.clone()?;
        if let Some(completed) = &self.info.completed {
            samples.iter_mut().for_each(|s| s.output_rad -= completed.spring.torsion_rad(s.torque_n_m));
        }
        Some(samples)
    }
}

/// Origin of a table, its contents and range of validity.
#[derive(Debug, Clone, Serialize)]
pub struct TableInfo {
    /// Version of this object.
    pub schema_version: u32,
    /// "made": every check of the core passed.
    pub status: &'static str,
    /// First 16 hex digits of the BLAKE3 of the image's contents.
    pub table_id: String,
    /// Generator.
    pub generator: String,
    /// Name of the drive.
    pub drive: String,
    /// BLAKE3 of the drive, hex.
    pub drive_blake3: String,
    /// Program that made the table.
    pub tool: String,
    /// Where the samples come from.
    pub source: Source,
    /// Size of the image, bytes.
    pub image_bytes: usize,
    /// Torque nodes, N m.
    pub torque_nodes_n_m: Vec<f32>,
    /// Whether the FEM was met between all torque nodes when they were chosen; null where they were given.
    pub torque_nodes_resolved: Option<bool>,
    /// Temperature nodes, °C.
    pub temperature_nodes_c: Vec<f32>,
    /// Nodes over one tooth pitch.
    pub ripple_nodes: usize,
    /// Samples used, both directions.
    pub samples: usize,
    /// Largest deviation of the table from its samples, arcsec.
    pub projection_worst_arcsec: f64,
    /// Root mean square of that deviation, arcsec.
    pub projection_rms_arcsec: f64,
    /// Bound of |N de/dpsi| in steady motion; below 1 the inverse exists.
    pub slope_bound: f32,
    /// Iterations of the inverse and the error they leave, arcsec.
    pub inverse_iterations: u8,
    /// Error left by these iterations, arcsec.
    pub inverse_error_arcsec: f64,
    /// Largest backlash (both half-widths) of any node, arcsec.
    pub backlash_arcsec: f64,
    /// Error in the middle of the play at the ends of the torque axis, arcsec.
    pub wind_up_arcsec: [f64; 2],
    /// Stiffness as defined in catalogues; null for a table that was not made by FEM of a drive.
    pub stiffness: Option<Stiffness>,
    /// Cautions on the table; empty for a sound drive.
    pub cautions: Vec<Caution>,
    /// Further remarks, in words; left out where there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
    /// Values of the data sheet in the drive's file, next to the computed ones; left out where the file has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data_sheet: Option<SheetBeside>,
    /// A data sheet's additions; left out where none was used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub completed: Option<Completed>,
    /// Stress in root fillets, on bore and flanks under the largest load of the table, over three meshes; left out
    /// unless it was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stress: Vec<PlaceStress>,
    /// Why there is no stress although it was asked for; left out where there is, or where it was not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_stress: Option<String>,
    /// Residual over whole turns of a drive that does not repeat from tooth to tooth; null for one that does.
    pub turns: Option<TurnsInfo>,
    /// Command line, once known.
    pub command: String,
}

impl TableInfo {
    /// Where the table ends short of the rated torque of a data sheet, that it does, and whether the drive bears that
    /// torque as far as the sheet was computed.
    pub fn short_of_sheet(&self, stated: &Stated) -> Option<String> {
        let ends_n_m = self.torque_nodes_n_m.last().copied().map(f64::from)?;
        let last_n_m = self.data_sheet.as_ref().and_then(|beside| beside.sheet.last_stable_n_m);
        short_of_sheet(ends_n_m, stated.rated_torque_n_m?, last_n_m)
    }
}

/// That a table ends short of a rated torque, and what is known of that torque: the last load that was borne, where it
/// was looked for.
fn short_of_sheet(ends_n_m: f64, rated_n_m: f64, last_n_m: Option<f64>) -> Option<String> {
    // Nodes are of single precision.
    if rated_n_m <= ends_n_m * (1.0 + 1e-6) {
        return None;
    }
    let found = match last_n_m {
        Some(last_n_m) if last_n_m < rated_n_m => {
            format!("the last load with an equilibrium under this generator was {} N·m", short(last_n_m))
        }
        _ => format!("--torque-n-m {rated_n_m} asks for it"),
    };
    Some(format!(
        "the table ends at {} N·m, and the data sheet rates the drive {} N·m: beyond its end a table extrapolates; \
         {found}",
        short(ends_n_m),
        short(rated_n_m)
    ))
}

/// A drive that does not repeat from tooth to tooth, and what its table has no room for: one curve for each of the
/// angles, the same under every load, for either flank.
#[derive(Debug, Clone, Serialize)]
pub struct TurnsInfo {
    /// Places over the turns of generator and output, for each sign of the load.
    pub places: usize,
    /// Torque by torque, in the order of the nodes.
    pub by_torque: Vec<TurnsAtTorque>,
    /// Remark on the torque nodes.
    pub remark: String,
}

/// Whole turns under one torque: forward and backward motion, all temperatures.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct TurnsAtTorque {
    /// Torque node, N m.
    pub torque_n_m: f32,
    /// Range of the drive's error over the places, the ripple within a pitch left out, arcsec. So few places see most,
    /// not all, of its transmission accuracy.
    pub drive_peak_to_peak_arcsec: f64,
    /// Residual with the table, arcsec: root mean square.
    pub left_rms_arcsec: f64,
    /// Largest difference between table and samples, arcsec.
    pub left_worst_arcsec: f64,
}

/// Where samples come from.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Source {
    /// Contact FEM.
    Fem {
        /// Solver.
        solver: String,
        /// Mesh level.
        mesh: String,
        /// Unknowns.
        degrees_of_freedom: usize,
        /// Positions over one pitch at each torque and temperature.
        positions: usize,
        /// Which samples were computed and which mirrored.
        sampled: String,
        /// Increments solved.
        increments: usize,
        /// Newton iterations.
        iterations: usize,
        /// Largest residual, relative to the contact forces.
        worst_residual: f64,
        /// Wall seconds of the sweep, other sweeps running beside it.
        wall_s: f64,
    },
    /// A file.
    File {
        /// Its name.
        name: String,
        /// BLAKE3 of its bytes, hex.
        blake3: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table that ends at 32 N·m beside a sheet that rates the drive 52: said, with what was found of that load.
    #[test]
    fn a_table_that_ends_short_of_the_rated_torque_says_so() {
        assert_eq!(short_of_sheet(52.0, 52.0, None), None);
        assert_eq!(short_of_sheet(f64::from(52.1_f32), 52.1, None), None);
        for last_n_m in [None, Some(52.0)] {
            let words = short_of_sheet(32.0, 52.0, last_n_m).unwrap();
            assert!(words.contains("ends at 32 N·m") && words.ends_with("--torque-n-m 52 asks for it"), "{words}");
        }
        let words = short_of_sheet(3.2, 52.0, Some(20.5)).unwrap();
        assert!(words.ends_with("under this generator was 20.5 N·m") && !words.contains("asks for"), "{words}");
    }
}
