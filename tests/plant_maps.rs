//! The wind-up that `flexspline fly` gives its built-in drives is that of contact FEM at other torques, phases and
//! another temperature than those of the map.

use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::tables::{self, samples};
use flexspline_fly::plant_map::GearMap;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Method, Problem, SolverSettings};

/// The table of a generator, of other contact FEM than its map.
pub(crate) fn image(kind: GeneratorKind) -> Vec<u8> {
    let file = format!("{}/firmware/samples/{kind}.samples.csv", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(&file).unwrap();
    let samples = samples::parse(&file, &bytes).unwrap();
    tables::from_samples(&Drive::hhd_95(), kind, &samples, &file, &bytes, Default::default()).unwrap().image
}

#[test]
fn a_plant_map_is_what_contact_fem_says() {
    let settings = SolverSettings { method: Method::Fast, ..SolverSettings::default() };
    for (kind, torques, bound) in
        [(GeneratorKind::Cam, [0.5, 7.0, 90.0], 0.1), (GeneratorKind::TwoRoller, [0.3, 1.1, 9.0], 0.3)]
    {
        let (drive, temperature_c) = (Drive::hhd_95(), 29.0);
        let wind_up = GearMap::of(kind).at(temperature_c);
        let problem = Problem::new(&drive, kind, temperature_c, settings).unwrap();
        let mut motion = Motion::deformed(&problem, 0.0).unwrap();
        let mut worst = 0.0_f64;
        for torque_n_m in torques {
            motion.load(torque_n_m).unwrap();
            while motion.settle_on(0.25 * motion.pitch()).unwrap() {}
            for turn in [0.21, 0.33, 0.27] {
                let angle = motion.state().generator_rad + turn * motion.pitch();
                motion.turn_to(angle).unwrap();
                // In forward motion the drag of the output is on the flanks, too.
                let flank_n_m = torque_n_m - drive.output.drag_torque_n_m;
                let by_map = wind_up.elastic_error_rad(angle, flank_n_m, 1.0);
                worst = worst.max((by_map - motion.error_rad()).abs() * ARCSEC_PER_RAD);
            }
        }
        println!("{kind}: the map misses fresh FEM by {worst:.3}\" at most");
        assert!(worst < bound, "{kind}: {worst}");
    }
}
