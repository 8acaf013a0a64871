//! A data sheet completes the table of a drive that is known from its catalogue alone: the table has the stiffness of
//! the sheet, says so in all its files, and states what single units may be off.
//!
//! ```text
//!   CSF-25-100 --contact FEM--> table --+ spring: 1/K of the sheet - 1/K of the FEM --> completed table
//!                                 |                                                         |
//!   made-up unit: FEM + K of the sheet, each range off by up to 30 % ----turned and loaded--> error left
//! ```
//!
//! The sheet: Harmonic Drive, CSF-25-100: K1 31 000 N·m/rad to T1 14 N·m, K2 50 000 to T2 48 N·m, K3 57 000 above; a
//! unit may be 30 % off. The torsion of a unit is arithmetic of this file, not the spring that was added. Wrong if this
//! fails: a range, a sign, a secant over another range, scatter of stiffness taken for scatter of wind-up, a mark that
//! is lost on the way to firmware, or a table that changes although nothing was asked for.

use flexspline::{Direction, GeneratorAngle, PlayState, Quality, Table};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_tests::command::Desk;
use serde_json::Value;

const T_N_M: [f64; 2] = [14.0, 48.0];
const K_N_M_PER_RAD: [f64; 3] = [31e3, 50e3, 57e3];
const SCATTER: f64 = 0.3;
const LARGEST_N_M: f64 = 62.0;
/// Allowed deviation of a table from its samples' drive between its nodes: the bound of `validate`.
const MISS_ARCSEC: f64 = 2.0;
const FIRST_CONTACT_N_M: f64 = 0.05;
const TEMPERATURE_C: f32 = 20.0;

/// Torsion of springs with these stiffnesses, rad.
fn torsion_rad(stiffness: [f64; 3], torque_n_m: f64) -> f64 {
    let load = torque_n_m.abs();
    let [t1, t2] = T_N_M;
    let parts = [load.min(t1), (load.min(t2) - t1).max(0.0), (load - t2).max(0.0)];
    parts.iter().zip(stiffness).map(|(part, k)| part / k).sum::<f64>().copysign(torque_n_m)
}

/// In the middle between both directions, rad.
fn middle_rad(table: &Table<'_>, torque_n_m: f64) -> f64 {
    let at = |direction| {
        let angle = GeneratorAngle::default();
        f64::from(table.steady_error_rad(angle, torque_n_m as f32, TEMPERATURE_C, direction).unwrap())
    };
    0.5 * (at(Direction::Forward) + at(Direction::Backward))
}

/// Secants over the ranges of the sheet.
fn secants(table: &Table<'_>) -> [f64; 3] {
    let [t1, t2] = T_N_M;
    [[FIRST_CONTACT_N_M, t1], [t1, t2], [t2, LARGEST_N_M]]
        .map(|[from, to]| (to - from) / (middle_rad(table, to) - middle_rad(table, from)))
}

/// Root mean squares of what is left of a unit without a table, with that of the FEM, with the completed one, arcsec;
/// and the share of ticks in which the completed one is off by no more than it states.
fn flown(fem: &Table<'_>, completed: &Table<'_>, unit: [f64; 3]) -> ([f64; 3], f64) {
    const TICKS: u32 = 20_000;
    /// Of the load in a flight, and of the generator: there and back.
    const WAVES: f64 = 7.0;
    let [mut play, mut play_of_fem, mut play_of_unit] = [PlayState::default(); 3];
    let (mut sums, mut counted, mut held) = ([0.0; 3], 0.0, 0.0);
    for tick in 0..TICKS {
        let phase = std::f64::consts::TAU * f64::from(tick) / f64::from(TICKS);
        let torque = LARGEST_N_M * (WAVES * phase).sin() * (0.3 + 0.7 * (0.5 * phase).sin());
        let generator = GeneratorAngle::from_rad(40.0 * (3.0 * phase).sin()).unwrap();
        let ask =
            |table: &Table<'_>, play: &mut PlayState| table.forward(play, generator, torque as f32, TEMPERATURE_C);
        let drawn = ask(fem, &mut play_of_unit);
        // Play and ripple of the drawing, the torsion of the unit.
        let by_fem = f64::from(drawn.transmission_error_rad);
        let drawn_torsion =
            middle_rad(fem, torque) - middle_rad(fem, FIRST_CONTACT_N_M.min(torque.abs()).copysign(torque));
        let truth = by_fem - drawn_torsion + torsion_rad(unit, torque);
        let found = ask(completed, &mut play);
        let alone = ask(fem, &mut play_of_fem);
        if drawn.quality != Quality::InRange {
            continue;
        }
        counted += 1.0;
        let left =
            [0.0, alone.transmission_error_rad, found.transmission_error_rad].map(|said| truth - f64::from(said));
        sums.iter_mut().zip(left).for_each(|(sum, left)| *sum += left * left);
        let stated = found.uncertainty_rad + completed.sheet_uncertainty_rad(torque as f32, TEMPERATURE_C);
        held += f64::from(u8::from(left[2].abs() <= f64::from(stated) + MISS_ARCSEC / ARCSEC_PER_RAD));
    }
    assert!(counted > 0.9 * f64::from(TICKS), "{counted}");
    (sums.map(|sum| (sum / counted).sqrt() * ARCSEC_PER_RAD), held / counted)
}

#[test]
#[ignore = "long: tests/run slow"]
fn a_drive_like_a_catalogues_is_right_to_the_scatter_of_the_catalogue() {
    let desk = Desk::new();
    let how = "--generator cam --torque-n-m 62 --mesh coarse --temperatures-c=20 --positions 6 \
               --most-nodes 12 --no-report --json";
    let sheet = "--like CSF-25-100 --complete-from-data-sheet";
    let report = desk.line(&format!("tables {how} {sheet} --out completed")).done().json();
    let drive = "--drive completed/drive-completed.toml";
    // The file completes its tables; what it states of the sheet left out, the FEM stands alone.
    let alone = desk.read("completed/drive-completed.toml").replace("completes_model = true", "");
    desk.write("alone.toml", &alone);
    let bare = desk.line(&format!("tables {how} --drive alone.toml --out fem")).done().json();
    let bytes = |folder: &str| std::fs::read(desk.path(&format!("{folder}/cam.fxt"))).unwrap();
    let (bare_bytes, completed_bytes) = (bytes("fem"), bytes("completed"));
    let (fem, completed) = (Table::check(&bare_bytes).unwrap(), Table::check(&completed_bytes).unwrap());

    // Marked in image, JSON, source files and drive file; the table of the FEM is not.
    assert_eq!((fem.sheet_scatter(), fem.mesh_level()), (None, "coarse"));
    assert!(completed.sheet_scatter().is_some_and(|scatter| (f64::from(scatter) - SCATTER).abs() < 1e-6));
    assert_eq!(completed.mesh_level(), "coarse, sheet +-30 %");
    assert_eq!(bare["tables"][0]["completed"], Value::Null);
    let of = &report["tables"][0]["completed"];
    assert_eq!(
        (of["scatter_percent"].as_f64(), &of["source"]),
        (Some(30.0), &Value::from("Harmonic Drive CSF-25-100"))
    );
    for file in ["cam.h", "cam.rs"] {
        assert!(desk.read(&format!("completed/{file}")).contains("completed by Harmonic Drive CSF-25-100"), "{file}");
        assert!(!desk.read(&format!("fem/{file}")).contains("completed by"), "{file}");
    }
    assert!(desk.read("completed/drive-completed.toml").contains("\n# cam: added "));
    let again = desk.line(&format!("tables {how} {drive} --out again")).done().json();
    assert_eq!(again["tables"][0]["table_id"], report["tables"][0]["table_id"]);

    // K1, K2, K3 are those of the sheet.
    let (found, by_fem) = (secants(&completed), secants(&fem));
    println!("K of the sheet {K_N_M_PER_RAD:?}, completed {found:.0?}, FEM {by_fem:.0?}");
    for (found, due) in found.iter().zip(K_N_M_PER_RAD) {
        assert!((found / due - 1.0).abs() < 0.01, "{found} {due}");
    }
    assert!(by_fem[0] > 1.3 * K_N_M_PER_RAD[0], "{by_fem:?}");

    // Units within the scatter: near the softest and the stiffest that there are, and such as are drawn.
    let mut random = fastrand::Rng::with_seed(45);
    let near = 0.9 * SCATTER;
    let mut units = vec![[1.0 - near; 3], [1.0 + near; 3]];
    units.extend((0..4).map(|_| [(); 3].map(|()| 1.0 + SCATTER * (2.0 * random.f64() - 1.0))));
    for unit in units {
        let stiffness = std::array::from_fn(|k| unit[k] * K_N_M_PER_RAD[k]);
        let ([without, with_fem, with_sheet], held) = flown(&fem, &completed, stiffness);
        println!("{unit:.2?}: {without:.1}, {with_fem:.1}, {with_sheet:.1} arcsec left; {:.2} % held", 100.0 * held);
        assert!(held >= 0.95 && with_sheet < with_fem && with_fem < without, "{unit:?}");
    }

    // The sheet's part is known to validate, from the JSON beside the image, and without it the table is refused.
    let check = format!("validate --tables completed {drive} --mesh coarse --solver fast --no-report --torques 8");
    let checked = desk.line(&format!("{check} --temperatures 1 --out checked --json")).done().json();
    println!("against fresh FEM and the spring: {} arcsec rms", checked["tables"][0]["rms_arcsec"]);
    std::fs::remove_file(desk.path("completed/cam.json")).unwrap();
    desk.refused(&check, "a data sheet completed this table");

    // Two rollers are softer than the sheet's cam: no table, and no scatter of units in its place.
    desk.refused(&format!("tables {} {sheet} --out soft", how.replace("cam", "two-roller")), "and the FEM has");
    assert!(!desk.path("soft/two-roller.fxt").exists());

    // A sheet without K3 completes nothing, and says what it lacks.
    desk.write("short.toml", &alone.replace("k3_n_m_per_rad", "# k3_n_m_per_rad"));
    let line = format!("tables {how} --drive short.toml --complete-from-data-sheet");
    desk.refused(&line, "data_sheet: found no k3_n_m_per_rad");
}
