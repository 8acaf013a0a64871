//! Wind-up of the four built-in drives by contact FEM, for `flexspline fly`; some 12 minutes:
//!
//! ```sh
//! cargo run --release --example plant_maps -- host-sim/fly/plant [GENERATOR...]
//! ```

use std::error::Error;
use std::path::Path;

use flexspline_base::output::write_whole;
use flexspline_fly::plant_map::GearMap;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::stepping::{Method, SolverSettings};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (folder, kinds) = arguments.split_first().ok_or("allowed: FOLDER [GENERATOR...]")?;
    let settings = SolverSettings { method: Method::Fast, ..SolverSettings::default() };
    for kind in GeneratorKind::ALL.into_iter().filter(|kind| kinds.is_empty() || kinds.contains(&kind.to_string())) {
        let map = GearMap::compute(&Drive::hhd_95(), kind, kind.rated_torque_n_m(), settings)?;
        write_whole(&Path::new(folder).join(format!("{kind}.csv")), |file| file.write_all(map.to_csv().as_bytes()))?;
        println!("{kind}");
    }
    Ok(())
}
