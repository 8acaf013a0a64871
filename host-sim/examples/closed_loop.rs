//! The closed loop by hand.
//!
//! ```sh
//! cargo run --release --example closed_loop -- map host-sim/fly/plant [GENERATOR...]    # contact FEM, minutes
//! cargo run --release --example closed_loop -- fly antenna|brief TABLES [OUT]
//! cargo run --release --example closed_loop -- rover TABLES
//! ```
//! `TABLES` is a folder of `<generator>.fxt`. With `OUT` every tick of the flights is written there as CSV. `fly brief`
//! prints, line by line, what the program `antenna` prints on the target, and `rover` what `rover` does.

use std::error::Error;
use std::path::Path;

use flexspline_sim::closed_loop::flight::antenna::COLUMNS;
use flexspline_sim::closed_loop::flight::gear::DenseGear;
use flexspline_sim::closed_loop::flight::profile::{ANTENNA, BRIEF, Profile};
use flexspline_sim::closed_loop::flight::{self, RigidPlant};
use flexspline_sim::closed_loop::map::DenseMap;
use flexspline_sim::closed_loop::{fly, write_flight};
use flexspline_sim::drive::{Drive, GeneratorKind};
use flexspline_sim::output::write_whole;
use flexspline_sim::stepping::{Method, SolverSettings};

#[allow(dead_code)] // Only the target asks for the gain of a joint.
#[path = "../../tests/firmware/src/rover.rs"]
mod rover;

use rover::RoverJoint;

/// The order of the target's programs.
const KINDS: [GeneratorKind; 4] =
    [GeneratorKind::Cam, GeneratorKind::DoubleDisc, GeneratorKind::FourRoller, GeneratorKind::TwoRoller];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["map", folder, kinds @ ..] => make_maps(Path::new(folder), kinds),
        ["rover", tables] => rover(Path::new(tables)),
        ["fly", profile, tables, out @ ..] => {
            let profile = match *profile {
                "antenna" => ANTENNA,
                "brief" => BRIEF,
                other => return Err(format!("profile: found {other}, allowed: antenna, brief").into()),
            };
            println!("{COLUMNS}");
            for kind in KINDS {
                let plant = format!("host-sim/fly/plant/{kind}.csv");
                let map = DenseMap::parse(kind, &plant, &std::fs::read_to_string(&plant)?)?;
                let image = std::fs::read(Path::new(tables).join(format!("{kind}.fxt")))?;
                let out = out.first().map(Path::new);
                let gear = DenseGear::new(map.view(), profile.temperature_c[0]);
                run(kind, &image, gear, &profile, out)?;
            }
            Ok(())
        }
        _ => Err("allowed: map FOLDER [GENERATOR...], fly PROFILE TABLES [OUT], rover TABLES".into()),
    }
}

fn make_maps(folder: &Path, kinds: &[&str]) -> Result<(), Box<dyn Error>> {
    let settings = SolverSettings { method: Method::Fast, ..SolverSettings::default() };
    for kind in KINDS.iter().filter(|kind| kinds.is_empty() || kinds.contains(&kind.to_string().as_str())) {
        let map = DenseMap::compute(&Drive::hhd_95(), *kind, kind.rated_torque_n_m(), settings)?;
        write_whole(&folder.join(format!("{kind}.csv")), |file| file.write_all(map.to_csv().as_bytes()))?;
        println!("{kind}");
    }
    Ok(())
}

fn run<P: RigidPlant + Clone>(
    kind: GeneratorKind,
    image: &[u8],
    plant: P,
    profile: &Profile,
    out: Option<&Path>,
) -> Result<(), Box<dyn Error>> {
    let mut rows = Vec::new();
    let plants = std::array::from_fn(|_| plant.clone());
    let twin = image.to_vec();
    let antenna = fly([image, &twin], plants, profile, kind.rated_torque_n_m(), &mut |row| rows.push(row))
        .ok_or_else(|| format!("{kind}: the table cannot be flown"))?;
    let mut text = String::new();
    antenna.write(&kind.to_string(), &mut text)?;
    print!("{text}");
    if let Some(folder) = out {
        std::fs::create_dir_all(folder)?;
        write_flight(&folder.join(format!("{kind}.flight.csv")), &rows, 1)?;
    }
    Ok(())
}

fn rover(tables: &Path) -> Result<(), Box<dyn Error>> {
    let [first_c, _] = BRIEF.temperature_c;
    for (number, kind) in KINDS.into_iter().enumerate() {
        let plant = format!("host-sim/fly/plant/{kind}.csv");
        let map = DenseMap::parse(kind, &plant, &std::fs::read_to_string(&plant)?)?;
        let image = std::fs::read(tables.join(format!("{kind}.fxt")))?;
        let twin = image.clone();
        let (name, largest) = (kind.to_string(), kind.rated_torque_n_m());
        let gear = DenseGear::new(map.view(), first_c);
        let mut joint = RoverJoint::new(number as u32, &name, [&image, &twin], gear, largest, first_c)
            .ok_or_else(|| format!("{kind}: the table cannot be flown"))?;
        for (tick, moment) in BRIEF.moments(largest).enumerate() {
            joint.tick(tick as u32, &moment);
        }
        let mut text = String::new();
        joint.write(&mut text)?;
        print!("{text}");
    }
    Ok(())
}
