use std::f64::consts::TAU;
use std::fs;

use super::draw::{Drawn, draw, sets};
use super::model::{FIGURES, Parabola, Response, SHEET, STATE, WAVE};
use super::plan::HowComputed;
use super::tolerance::{Distribution, DistributionForm, ToleranceActs};
use super::*;
use crate::kernels::{Eccentric, KERNELS_SCHEMA, Kernels, LoadKernels, WheelKernels};
use crate::stated::Stated;
use flexspline_base::statistics::{mean, std_dev};
use flexspline_mechanics::drive::{AsBuilt, Drive, GeneratorKind, Wheel};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Problem, SolverSettings};

/// arcsec for a micrometre of displaced axis, in the test kernels.
const PER_UM: f64 = 2.0;

/// Test kernels: a third of a wheel shares the load, and the error is proportional to the displacement of an axis.
fn kernels() -> Kernels {
    let (positions, repeats, directions) = (8, 2, 24);
    let wheel = |teeth: usize, sign: f64| {
        let n = teeth * positions / repeats;
        let weight = |k: usize| {
            let angle = TAU * k as f64 / (2 * n) as f64;
            sign * (0.02 + 0.03 * (2.0 * angle).cos() + 0.01 * (2.0 * angle).sin())
        };
        let along: Vec<f64> = (0..n).map(weight).collect();
        let none = vec![0.0; n];
        WheelKernels { along, outward: none.clone(), turned: none.clone(), plus_flank: none.clone(), minus_flank: none }
    };
    let load = |torque_n_m| LoadKernels {
        torque_n_m,
        flexspline: wheel(188, 1.0),
        circular_spline: wheel(190, -1.0),
        generator: vec![0.0; 188 * positions / repeats],
    };
    let by_direction: Vec<f64> =
        (0..directions).map(|d| 10.0 * PER_UM * (TAU * f64::from(d) / f64::from(directions)).cos()).collect();
    Kernels {
        schema_version: KERNELS_SCHEMA,
        generator: GeneratorKind::Cam,
        drive_blake3: String::new(),
        mesh: "coarse".to_owned(),
        temperature_c: 20.0,
        ratio: 95.0,
        teeth: [188, 190],
        positions,
        repeats,
        loads: vec![load(1.0), load(10.0)],
        eccentric: Eccentric {
            sizes_um: vec![10.0],
            torques_n_m: vec![1.0, 10.0],
            directions: directions as usize,
            deviation_arcsec: vec![vec![by_direction.clone(), by_direction]],
        },
    }
}

fn tolerances(text: &str) -> Tolerances {
    Tolerances::read("t.toml", text, |name| Drive::built_in(name).ok_or("no drive")).unwrap()
}

fn refused(text: &str) -> String {
    Tolerances::read("t.toml", text, |name| Drive::built_in(name).ok_or("no drive")).unwrap_err().to_string()
}

const ECCENTRIC: &str =
    "[[tolerance]]\nfield = \"as_built.circular_spline_eccentricity_um\"\ndistribution = \"rayleigh\"\nstd = 1.5\n";
const TEETH: &str =
    "[[tolerance]]\nfield = \"as_built.flexspline_pitch_error_um\"\ndistribution = \"normal\"\nstd = 2.0\n";
const THICK: &str =
    "[[tolerance]]\nfield = \"flexspline.rim_thickness_mm\"\ndistribution = \"normal\"\nplus_minus = 0.03\n";

/// A plan of test kernels.
fn plan_of(text: &str, draws: usize) -> VariantPlan {
    let of = tolerances(text);
    let alike = of.list.iter().filter(|t| t.acts == ToleranceActs::Alike);
    let parabolas = alike.map(|t| Parabola {
        field: t.field.clone(),
        at: [0.05, 0.5, 0.95].map(|share| t.distribution.quantile(share)),
        below: vec![-0.1; STATE],
        above: vec![0.1; STATE],
    });
    let response = Response { middle: vec![0.0; STATE], parabolas: parabolas.collect() };
    planned(&of, response, draws)
}

fn planned(of: &Tolerances, response: Response, draws: usize) -> VariantPlan {
    let split = |set: String| set.split_once('=').map(|(path, value)| (path.to_owned(), value.to_owned())).unwrap();
    let lines: Vec<Vec<(String, String)>> =
        draw(&of.list, draws, 1).iter().map(|one| sets(&of.list, one).into_iter().map(split).collect()).collect();
    let columns = lines[0].iter().map(|(path, _)| path.clone()).collect();
    let variants = lines.into_iter().map(|line| line.into_iter().map(|(_, value)| value).collect()).collect();
    let by = HowComputed::Kernels { torques_n_m: [10.0, 1.0], kernels: Box::new(kernels()), response };
    VariantPlan::new((&of.drive, None), &[GeneratorKind::Cam], (columns, variants), by, MeshLevel::Coarse)
}

/// A plan of the data sheets of fields that vary.
fn of_fields(vary: &[&str], generators: &[GeneratorKind]) -> Result<VariantPlan, PlanError> {
    let vary: Vec<Vary> = vary.iter().map(|text| text.parse().unwrap()).collect();
    let settings = PlanSettings { draws: None, seed: 1, mesh: MeshLevel::Coarse };
    VariantPlan::of_fields(&Drive::hhd_95(), None, &vary, generators, (None, 4), settings)
}

/// The sweep of a plan, by one shard.
fn swept(plan: &VariantPlan, judge: Judge) -> ReducedSweep {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan.write(folder.path()).unwrap();
    run(&plan, folder.path(), Shard::WHOLE, &|_, _, _| ()).unwrap();
    reduce(&plan, folder.path(), &judge.of(&plan).unwrap(), false).unwrap()
}

/// A row with figures that were made up.
fn row(plan: &VariantPlan, variant: usize, figures: &[(&str, f64)]) -> VariantRow {
    let mut all = vec![f64::NAN; plan.figures().len()];
    for (name, value) in [("rigid_gap_um", 1.0), ("largest_n_m", 200.0)].iter().chain(figures) {
        all[plan.figure(name).unwrap()] = *value;
    }
    let empty = VariantRow::empty(plan, variant, GeneratorKind::Cam);
    VariantRow { status: RunStatus::Converged, figures: all, ..empty }
}

#[test]
fn the_example_is_read_and_mistakes_are_named_by_line_field_value_and_what_is_allowed() {
    assert_eq!(tolerances(EXAMPLE).list.len(), 7);
    for (text, due) in [
        ("drive = \"HHD-96\"\n", "t.toml: drive: no drive"),
        ("torque_n_m = -3\n", "t.toml:1: torque_n_m: found -3, allowed: above 0 to 200"),
        ("torque = 3\n", "did you mean `torque_n_m`?"),
        ("generator = \"camm\"\n", "did you mean `cam`?"),
        ("", "tolerance: missing; give at least one [[tolerance]]"),
        ("[[tolerance]]\ndistribution = \"normal\"\n", "t.toml:1: tolerance[0].field: missing"),
        (
            "[[tolerance]]\nfield = \"generator.w0\"\ndistribution = \"normal\"\nstd = 1\n",
            "did you mean `generator.w0_mm`?",
        ),
        (
            "[[tolerance]]\nfield = \"sleeve.kind\"\ndistribution = \"normal\"\nstd = 1\n",
            "t.toml:2: tolerance[0].field: found \"sleeve.kind\"",
        ),
        (
            "[[tolerance]]\nfield = \"as_built.cam_form_harmonics\"\ndistribution = \"normal\"\nstd = 1\n",
            "for which there are no kernels",
        ),
        (
            "[[tolerance]]\nfield = \"as_built.flexspline_pitch_harmonics\"\ndistribution = \"rayleigh\"\nstd = 1\n",
            "order: missing",
        ),
        (
            "[[tolerance]]\nfield = \"as_built.flexspline_runout_um\"\ndistribution = \"normal\"\nstd = 1\n",
            "allowed: \"rayleigh\"",
        ),
        (
            "[[tolerance]]\nfield = \"generator.w0_mm\"\ndistribution = \"uniform\"\nlimits = [2, 1]\n",
            "t.toml:4: tolerance[0].limits",
        ),
        (
            "[[tolerance]]\nfield = \"generator.w0_mm\"\ndistribution = \"normal\"\nstd = 0.001\nlimits = [0.9, 1]\n",
            "hardly ever keeps",
        ),
        (
            "[[tolerance]]\nfield = \"generator.w0_mm\"\ndistribution = \"normal\"\nstd = -1\n",
            "tolerance[0].std: found -1, allowed: above 0",
        ),
        (
            "[[tolerance]]\nfield = \"generator.w0_mm\"\ndistribution = \"normal\"\nmean = 0.8\nstd = 0.001\n",
            "t.toml:4: tolerance[0]: mean: \"generator.w0_mm\" is 0.5 in the drive, and the tolerance scatters about \
             0.8, 300 standard deviations",
        ),
        (
            "[[tolerance]]\nfield = \"generator.w0_mm\"\ndistribution = \"uniform\"\nlimits = [0.8, 0.81]\n",
            "t.toml:4: tolerance[0]: limits: \"generator.w0_mm\" is 0.5 in the drive",
        ),
    ] {
        let said = refused(text);
        assert!(said.contains(due) && said.contains("t.toml"), "{said}");
    }
    assert!(refused(&format!("{ECCENTRIC}{ECCENTRIC}")).contains("twice"));
    // A middle that is near, a wide distribution, and a field that is 0 as drawn are allowed.
    for (field, law) in [
        ("generator.w0_mm", "\"normal\"\nmean = 0.51\nstd = 0.0005"),
        ("generator.w0_mm", "\"normal\"\nmean = 0.56\nstd = 0.02\nlimits = [0.49, 0.51]"),
        ("as_built.flexspline_wear_um", "\"normal\"\nmean = 10\nstd = 0.5"),
    ] {
        tolerances(&format!("[[tolerance]]\nfield = \"{field}\"\ndistribution = {law}\n"));
    }
    let said = refused(&format!("{ECCENTRIC}{}", THICK.replace("0.03", "50")));
    assert!(said.starts_with("t.toml:5: tolerance[1]: ") && said.contains("makes no drive"), "{said}");
    let said = refused(&THICK.replace("plus_minus = 0.03", "std = 0.01\nlimits = [4, 1]"));
    assert!(said.contains("the least first"), "{said}");
    assert!(refused(&format!("drive = \"HHD-95-typical\"\n{ECCENTRIC}")).contains("as drawn"));
}

#[test]
fn a_distribution_is_truncated_at_its_limits() {
    let within = Distribution { form: DistributionForm::Normal, mean: 5.0, std: 1.0, limits: [5.0, 6.0] };
    // Half of those between 0 and 1 standard deviation lie below 0.4419 (tables: 0.5 + 0.3413 / 2).
    assert!((within.quantile(0.5) - 5.4419).abs() < 1e-3);
    assert!((within.quantile(1e-9) - 5.0).abs() < 1e-6 && (within.quantile(1.0 - 1e-9) - 6.0).abs() < 1e-6);
    let size = Distribution { form: DistributionForm::Rayleigh, mean: 0.0, std: 2.0, limits: [0.0, 11.0] };
    assert!((size.quantile(0.95) - 2.0 * (-2.0 * 0.05f64.ln()).sqrt()).abs() < 1e-4);
}

#[test]
fn drawn_drives_fill_the_tolerances_and_differ() {
    let of = tolerances(&format!("{ECCENTRIC}{TEETH}{THICK}"));
    let all = draw(&of.list, 64, 7);
    assert_eq!(draw(&of.list, 64, 7), all);
    assert_ne!(draw(&of.list, 64, 8), all);
    // One of 64 drives in each sixty-fourth of the sizes.
    let share = |drive: &Vec<Drawn>| 64.0 * (1.0 - (-0.5 * (drive[0].value / 1.5_f64).powi(2)).exp());
    let mut cells: Vec<usize> = all.iter().map(|drive| share(drive) as usize).collect();
    cells.sort_unstable();
    assert_eq!(cells, (0..64).collect::<Vec<usize>>());
    // Errors of teeth have their standard deviation, and are independent of those of the next drive.
    let teeth: Vec<f64> = all.iter().flat_map(|drive| drive[1].teeth_um.clone()).collect();
    assert!((std_dev(&teeth) / 2.0 - 1.0).abs() < 0.02 && mean(&teeth).abs() < 0.05);
    let next: f64 = all[0][1].teeth_um.iter().zip(&all[1][1].teeth_um).map(|(a, b)| a * b).sum();
    assert!((next / 188.0).abs() < 4.0 * 4.0 / 188f64.sqrt());
    let sets = sets(&of.list, &all[5]);
    let built = Drive::hhd_95().with_sets(sets.iter().map(String::as_str)).unwrap();
    assert_eq!(built.as_built.flexspline_pitch_error_um, all[5][1].teeth_um);
    assert_eq!(built.as_built.circular_spline_eccentricity_phase_deg, all[5][0].phase_deg);
    assert_eq!(built.flexspline.rim_thickness_mm, all[5][2].value);
}

#[test]
fn harmonics_of_a_field_are_one_cell() {
    let one = |order| {
        format!(
            "[[tolerance]]\nfield = \"as_built.flexspline_pitch_harmonics\"\norder = {order}\ndistribution = \
                 \"uniform\"\nlimits = [0.0, 9.0]\n"
        )
    };
    let of = tolerances(&format!("{}{}", one(2), one(3)));
    let drawn = &draw(&of.list, 8, 1)[0];
    let built = Drive::hhd_95().with_sets(sets(&of.list, drawn).iter().map(String::as_str)).unwrap();
    let found: Vec<(u32, f64)> =
        built.as_built.flexspline_pitch_harmonics.iter().map(|h| (h.order, h.amplitude_um)).collect();
    assert_eq!(found, [(2, drawn[0].value), (3, drawn[1].value)]);
}

#[test]
fn errors_of_single_pitches_add_up_and_close() {
    let of = tolerances(&TEETH.replace("std", "errors = \"pitch\"\nstd"));
    let teeth = &draw(&of.list, 8, 1)[0][0].teeth_um;
    let pitches: Vec<f64> = (0..188).map(|k| teeth[(k + 1) % 188] - teeth[k]).collect();
    assert!(mean(&pitches).abs() < 1e-12 && (std_dev(&pitches) / 2.0 - 1.0).abs() < 0.2);
    assert!(std_dev(teeth) > 3.0, "a random walk goes far");
}

/// Figures by test kernels of a drive with these fields.
fn figures((kernels, response): &(Kernels, Response), sets: &[&str]) -> Vec<f64> {
    let built = Drive::hhd_95().with_sets(sets.iter().copied()).unwrap().as_built;
    model::KernelModel::new(kernels, response.clone(), [10.0, 1.0]).figures(&built, &[])
}

/// A harmonic of the pitch and a displaced axis do what their kernels say, whichever way they are summed.
#[test]
fn the_model_is_that_of_the_kernels() {
    let of = (kernels(), Response { middle: vec![0.0; STATE], parabolas: Vec::new() });
    let at = |name: &str| FIGURES.iter().position(|known| *known == name).unwrap();
    let harmonic = "as_built.flexspline_pitch_harmonics=[{order = 2, amplitude_um = 3.0, phase_deg = 12.0}]";
    let pitch = figures(&of, &[harmonic]);
    let [c, s] = kernels().pitch_error(Wheel::Flexspline, 2, 10.0);
    let expected = 3.0 * c.hypot(s);
    assert!((pitch[at("error_pp_arcsec")] / expected - 2.0).abs() < 4e-3, "{} {expected}", pitch[0]);
    assert!((pitch[at("error_rms_arcsec")] / expected - 0.5f64.sqrt()).abs() < 2e-3);
    let eccentric =
        ["as_built.circular_spline_eccentricity_um=4", "as_built.circular_spline_eccentricity_phase_deg=37"];
    let apart = figures(&of, &eccentric);
    assert!((apart[at("error_rms_arcsec")] / (4.0 * PER_UM) - 0.5f64.sqrt()).abs() < 2e-3, "{apart:?}");
    assert!((apart[at("error_pp_arcsec")] / (8.0 * PER_UM) - 1.0).abs() < 2e-3);
    assert!((apart[at("axes_apart_um")] - 4.0).abs() < 1e-9);
}

/// Random errors of the teeth add the same to the error by kernels and by contact FEM, place by place.
#[test]
fn kernels_agree_with_fem() {
    let of = tolerances(include_str!("../../../../examples/sweep/teeth.toml"));
    let settings = PlanSettings { draws: Some(8), seed: 1, mesh: MeshLevel::Coarse };
    let plan = VariantPlan::of_tolerances(&of, settings, &|_, _, _| ()).unwrap();
    let model = plan.model().unwrap();
    let places: Vec<f64> = (0..5).map(|j| 95.0 * f64::from(j) / 5.0).collect();
    let by_fem = |drive: &Drive| -> Vec<f64> {
        let problem =
            Problem::new(drive, GeneratorKind::Cam, of.temperature_c, SolverSettings::fast(plan.mesh)).unwrap();
        let error = |turns: &f64| {
            let mut motion = Motion::deformed_or_turned_in(&problem, TAU * turns).unwrap();
            motion.load(of.torque_n_m).unwrap();
            motion.error_arcsec()
        };
        places.iter().map(error).collect()
    };
    // At whole pitches, as kernels are of settled motion and this FEM of a drive that is deformed afresh.
    let (alike, alike_by_fem) = (AsBuilt::default(), by_fem(&of.drive));
    let (mut off, mut size) = (0.0, 0.0);
    for variant in 0..4 {
        let drive = plan.drive_of(variant, GeneratorKind::Cam).unwrap();
        let added = places.iter().zip(by_fem(&drive)).zip(&alike_by_fem).map(|((turns, fem), fem_alike)| {
            let by_kernels = [&drive.as_built, &alike].map(|built| model.error_at(built, *turns, 95.0));
            [by_kernels[0] - by_kernels[1], fem - fem_alike]
        });
        let (by_kernels, fem): (Vec<f64>, Vec<f64>) = added.map(|[kernels, fem]| (kernels, fem)).unzip();
        let apart: Vec<f64> = by_kernels.iter().zip(&fem).map(|(kernels, fem)| kernels - fem).collect();
        // The zero of the output is set for each drive.
        off += std_dev(&apart).powi(2);
        size += std_dev(&fem).powi(2);
    }
    println!("kernels less FEM: {:.4} of the errors", (off / size).sqrt());
    assert!(off.sqrt() < 0.05 * size.sqrt(), "{off} {size}");
}

/// A drive whose axis takes more of the play than there is has none: its lost motion is the wind-up of its stiffness.
#[test]
fn flanks_do_not_overlap() {
    let mut of = (kernels(), Response { middle: vec![0.0; STATE], parabolas: Vec::new() });
    // Half the play under either light load, and stiffnesses of N·m/rad.
    let play = 6.0;
    of.1.middle[WAVE..2 * WAVE].fill(0.5 * play);
    of.1.middle[2 * WAVE + 1..2 * WAVE + 4].copy_from_slice(&[2e5, 3e5, 4e5]);
    // A displaced axis takes of it in every direction.
    of.0.eccentric.deviation_arcsec[0][0].fill(-10.0 * PER_UM);
    let at = |name: &str| FIGURES.iter().position(|known| *known == name).unwrap();
    let wind_up = 2.0 / 4e5 * 206_264.8;
    for (size, expected, closed) in [(0.0, play, 0.0), (1.0, play - 2.0 * PER_UM, 0.0), (5.0, wind_up, 100.0)] {
        let all = figures(&of, &[&format!("as_built.circular_spline_eccentricity_um={size}")]);
        for figure in ["lost_motion_arcsec", "most_lost_motion_arcsec"] {
            assert!((all[at(figure)] - expected).abs() < 1e-6, "{size}: {} {expected}", all[at(figure)]);
        }
        assert_eq!(all[at("play_closed_percent")], closed);
    }
    assert_eq!(of.1.middle.len(), 2 * WAVE + SHEET.len());
}

/// The eccentricity makes the error of these kernels; the rim changes it by a hundredth.
#[test]
fn rank_correlation_finds_the_tolerance_that_matters() {
    let sweep = swept(&plan_of(&format!("{THICK}{ECCENTRIC}"), 200), Judge::default());
    let of = &sweep.generators[0];
    let ranks: Vec<&RankCorrelation> = of.ranks.iter().filter(|rank| rank.figure == "error_pp_arcsec").collect();
    assert_eq!(ranks[0].input, "as_built.circular_spline_eccentricity_um");
    assert!(ranks[0].correlation > 0.99 && ranks[1].correlation.abs() < 0.2, "{ranks:?}");
    // Closed form: twice a size of Rayleigh's distribution; the rim adds 0.1 arcsec at most, the same everywhere.
    let spread = of.figures.iter().find(|spread| spread.figure == "error_pp_arcsec").unwrap();
    let median = spread.quantiles.iter().find(|quantile| quantile.share == 0.5).unwrap();
    let truth = 2.0 * PER_UM * 1.5 * (2.0 * 2f64.ln()).sqrt();
    assert!(median.low.unwrap() < truth && truth < median.high.unwrap(), "{median:?}, {truth}");
    assert!(of.front.is_empty());
}

/// A file of results cut anywhere is finished to the same bytes, and shards have the rows of the whole.
#[test]
fn a_shard_that_was_cut_off_is_finished_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan_of(&format!("{ECCENTRIC}{THICK}"), 9).write(folder.path()).unwrap();
    let whole = run(&plan, folder.path(), Shard::WHOLE, &|_, _, _| ()).unwrap();
    assert_eq!(whole, Ran { there: 0, computed: 9 });
    let file = Shard::WHOLE.path(folder.path());
    let bytes = fs::read(&file).unwrap();
    for at in (0..bytes.len()).step_by(97) {
        fs::write(&file, &bytes[..at]).unwrap();
        let again = run(&plan, folder.path(), Shard::WHOLE, &|_, _, _| ()).unwrap();
        assert_eq!((again.there + again.computed, fs::read(&file).unwrap() == bytes), (9, true), "cut at {at}");
    }
    let lines = |text: &[u8]| String::from_utf8(text.to_vec()).unwrap().lines().map(str::to_owned).collect::<Vec<_>>();
    let mut rows = lines(&bytes)[..1].to_vec();
    for number in 1..=2 {
        let shard: Shard = format!("{number}/2").parse().unwrap();
        run(&plan, folder.path(), shard, &|_, _, _| ()).unwrap();
        rows.extend(lines(&fs::read(shard.path(folder.path())).unwrap())[1..].to_vec());
    }
    assert_eq!(rows, lines(&bytes));
    for wrong in ["0/2", "3/2", "1", "a/b", "1/0"] {
        assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
    }
}

#[test]
fn missing_results_are_named_and_those_of_another_plan_refused() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan_of(&format!("{ECCENTRIC}{THICK}"), 16).write(folder.path()).unwrap();
    let second = Shard { number: 2, of: 2 };
    run(&plan, folder.path(), second, &|_, _, _| ()).unwrap();
    let reduced = |partial| reduce(&plan, folder.path(), &Judge::default(), partial);
    let said = reduced(false).unwrap_err().to_string();
    assert!(said.contains("8 of 16 runs are missing, of the variants 1, 2,") && said.contains("sweep run"), "{said}");
    let part = reduced(true).unwrap();
    assert_eq!((part.missing, part.rows.len()), (8, 8));
    let other = plan_of(ECCENTRIC, 16);
    assert!(other.write(folder.path()).unwrap_err().to_string().contains("results of another plan"));
    let elsewhere = tempfile::tempdir().unwrap();
    let other = plan_of(&format!("{ECCENTRIC}{THICK}"), 17).write(elsewhere.path()).unwrap();
    fs::create_dir(elsewhere.path().join("results")).unwrap();
    fs::copy(second.path(folder.path()), second.path(elsewhere.path())).unwrap();
    let said = run(&other, elsewhere.path(), second, &|_, _, _| ()).unwrap_err().to_string();
    assert!(said.contains(&format!("results of the plan {}", plan.hash)), "{said}");
    // Another shard says so before it computes.
    let said = run(&other, elsewhere.path(), Shard { number: 1, of: 2 }, &|_, _, _| ()).unwrap_err().to_string();
    assert!(said.contains("0002-of-0002.csv: results of the plan"), "{said}");
    assert!(reduce(&other, elsewhere.path(), &Judge::default(), true).is_err());
    fs::copy(second.path(folder.path()), Shard::WHOLE.path(folder.path())).unwrap();
    let said = run(&plan, folder.path(), Shard::WHOLE, &|_, _, _| ()).unwrap_err().to_string();
    assert!(said.contains("not the rows of this shard"), "{said}");
    // One variant with two results, in two files; the same result twice is one.
    assert_eq!(reduced(true).unwrap().rows.len(), 8);
    let text = fs::read_to_string(second.path(folder.path())).unwrap();
    let last = text.lines().last().unwrap();
    let figure = last.split(',').nth(4).unwrap();
    let text = text.replace(last, &last.replacen(figure, &format!("1{figure}"), 1));
    fs::write(Shard::WHOLE.path(folder.path()), text).unwrap();
    let said = reduced(true).unwrap_err().to_string();
    assert!(said.contains("0002-of-0002.csv: another result of variant 16 with cam"), "{said}");
}

#[test]
fn a_plan_is_read_as_it_was_written_and_its_lines_may_be_edited() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan_of(&format!("{ECCENTRIC}{THICK}"), 8).write(folder.path()).unwrap();
    assert_eq!(VariantPlan::read(folder.path()).unwrap(), plan);
    let csv = folder.path().join("plan.csv");
    let text = fs::read_to_string(&csv).unwrap();
    fs::write(&csv, format!("{text}9,1.5,0,2.1\n10,1.5,0,thick\n")).unwrap();
    let edited = VariantPlan::read(folder.path()).unwrap();
    assert!(edited.variants.len() == 10 && edited.hash != plan.hash);
    run(&edited, folder.path(), Shard::WHOLE, &|_, _, _| ()).unwrap();
    let sweep = reduce(&edited, folder.path(), &Judge::default(), false).unwrap();
    assert_eq!((sweep.converged, sweep.refused), (9, 1));
    for (wrong, due) in [
        (format!("{text}11,1,0,2\n"), "plan.csv:10: variant: found \"11\", allowed: 1, 2, 3"),
        ("a,b\n1,2\n".to_owned(), "allowed: variant, then fields"),
        (
            text.replace("rim_thickness_mm", "rim_thicknes_mm"),
            "plan.csv: no variant makes a drive; the first: --set flexspline.rim_thicknes_mm",
        ),
        ("variant,a\n".to_owned(), "found no variant"),
        ("variant,a\n1,2,3\n".to_owned(), "plan.csv: CSV error"),
    ] {
        fs::write(&csv, wrong).unwrap();
        let said = VariantPlan::read(folder.path()).unwrap_err().to_string();
        assert!(said.contains(due), "{said}");
    }
    fs::write(&csv, &text).unwrap();
    let json = fs::read_to_string(folder.path().join("plan.json")).unwrap();
    fs::write(folder.path().join("plan.json"), json.replacen(env!("CARGO_PKG_VERSION"), "0.0.1", 1)).unwrap();
    assert!(VariantPlan::read(folder.path()).unwrap_err().to_string().contains("plan anew"));
}

#[test]
fn fields_that_make_no_drive_are_refused_before_anything_runs() {
    let said = |vary: &[&str]| of_fields(vary, &[GeneratorKind::Cam]).unwrap_err().to_string();
    assert!(said(&["flexspline.rim_thicknes_mm=1..2"]).contains("rim_thickness_mm"));
    assert!(said(&["flexspline.rim_thickness_mm=-2..-1"]).contains("no variant makes a drive"));
    assert!(said(&["generator.w0_mm=0.4..0.5", "generator.w0_mm=0.4..0.5"]).contains("generator.w0_mm twice"));
    assert!(said(&["generator.w0_mm=0.4,0.40"]).contains("found the value 0.40 twice"));
    assert!(said(&[]).contains("found 0 of them"));
    let field = |k: u32| format!("a.f{k}=0..1:1000");
    assert!(said(&[&field(0), &field(1)]).contains("found 1000000 variants, allowed: 1 to 100000"));
}

#[test]
fn constraints_leave_out_and_the_front_is_pareto_optimal() {
    let plan = of_fields(&["generator.w0_mm=0.46..0.5:5"], &[GeneratorKind::Cam]).unwrap();
    let mut rows: Vec<VariantRow> = [(1.0, 300.0), (2.0, 200.0), (1.9992, 250.0), (0.5, 500.0), (2.0, 200.0)]
        .iter()
        .enumerate()
        .map(|(k, (e, s))| row(&plan, k, &[("kinematic_error_pp_arcsec", *e), ("max_von_mises_mpa", *s)]))
        .collect();
    rows[1].figures[plan.figure("rigid_gap_um").unwrap()] = -1.0;
    let least = |name: &str| (name.to_owned(), Sense::Least);
    let constraints = vec!["max_von_mises_mpa=..400".parse().unwrap()];
    let judge = Judge { constraints, targets: vec![least("kinematic_error_pp_arcsec"), least("max_von_mises_mpa")] };
    let judge = judge.of(&plan).unwrap();
    judge.mark(&plan, &mut rows);
    // The second interferes, the fourth breaks the constraint, the fifth beats the third: no mesh settles 0.0008″.
    assert_eq!(rows.iter().map(|row| row.meets).collect::<Vec<_>>(), [true, false, true, false, true]);
    assert_eq!(rows.iter().map(|row| row.is_front).collect::<Vec<_>>(), [true, false, false, false, true]);
}

#[test]
fn the_front_is_of_all_generators_and_of_teeth_that_play() {
    let kinds = [GeneratorKind::Cam, GeneratorKind::DoubleDisc];
    let plan = of_fields(&["generator.w0_mm=0.46..0.5:2"], &kinds).unwrap();
    let (error, backlash) = ("kinematic_error_pp_arcsec", "backlash_arcsec");
    let of = |k: usize, e, b| row(&plan, k / 2, &[(error, e), (backlash, b)]);
    let mut rows = vec![of(0, 2.0, 30.0), of(1, 1.0, 30.0), of(2, 0.5, -20.0), of(3, 3.0, 0.0)];
    rows.iter_mut().zip(kinds.iter().cycle()).for_each(|(row, kind)| row.generator = *kind);
    let judge = Judge { constraints: Vec::new(), targets: vec![(error.to_owned(), Sense::Least)] }.of(&plan).unwrap();
    judge.mark(&plan, &mut rows);
    assert_eq!(rows.iter().map(|row| row.meets).collect::<Vec<_>>(), [true, true, false, true]);
    assert_eq!(rows.iter().map(|row| row.is_front).collect::<Vec<_>>(), [false, true, false, false]);
    // Its order is that of the first target, whichever generator comes first among the rows.
    rows[0].is_front = true;
    let front: Vec<GeneratorKind> = judge.front(&plan, &rows).iter().map(|row| row.generator).collect();
    assert_eq!(front, [GeneratorKind::DoubleDisc, GeneratorKind::Cam]);
}

/// The variant made worse has the smaller error where it was looked at; it is compared with those made alike alone.
#[test]
fn variants_are_compared_with_those_made_alike() {
    let vary = ["flexspline.rim_thickness_mm=1.0,1.2", "as_built.circular_spline_eccentricity_um=0,10"];
    let plan = of_fields(&vary, &[GeneratorKind::Cam]).unwrap();
    let errors = [0.380, 0.324, 0.5, 0.3].iter().enumerate();
    let mut rows: Vec<VariantRow> = errors.map(|(k, e)| row(&plan, k, &[("kinematic_error_pp_arcsec", *e)])).collect();
    let targets = vec![("kinematic_error_pp_arcsec".to_owned(), Sense::Least)];
    Judge { constraints: Vec::new(), targets }.mark(&plan, &mut rows);
    assert!(rows.iter().all(|row| row.meets));
    assert_eq!(rows.iter().map(|row| row.is_front).collect::<Vec<_>>(), [true, false, false, true]);
}

#[test]
fn a_constraint_that_cannot_be_read_says_what_is_allowed() {
    for text in ["bore_mpa", "bore_mpa=3", "bore_mpa=..", "bore_mpa=5..4", "bore_mpa=x.."] {
        assert!(text.parse::<Constraint>().unwrap_err().to_string().contains("LEAST..MOST"), "{text}");
    }
    let plan = of_fields(&["generator.w0_mm=0.5"], &[GeneratorKind::Cam]).unwrap();
    let judge = Judge { constraints: vec!["max_mises_mpa=..3".parse().unwrap()], targets: Vec::new() };
    let said = judge.of(&plan).unwrap_err().to_string();
    assert!(said.contains("did you mean") && said.contains("max_von_mises_mpa"), "{said}");
    let targets = vec![("error_pp_arcsec".to_owned(), Sense::Least)];
    let said = Judge { constraints: Vec::new(), targets }.of(&plan_of(ECCENTRIC, 8)).unwrap_err().to_string();
    assert!(said.contains("allowed with --vary"), "{said}");
}

/// K1, K2 and K3 are those of the loads of the data sheet, unless another largest load is asked for.
#[test]
fn the_loads_are_those_of_the_data_sheet() {
    let (drive, kind) = (Drive::hhd_95(), GeneratorKind::Cam);
    let (t1_n_m, t2_n_m) = (Some(29.0), Some(108.0));
    let stated = Stated { t1_n_m, t2_n_m, rated_torque_n_m: Some(153.0), ..Stated::default() };
    let settings = PlanSettings { draws: None, seed: 1, mesh: MeshLevel::Coarse };
    let vary = ["generator.w0_mm=0.5".parse().unwrap()];
    let plan = VariantPlan::of_fields(&drive, Some(&stated), &vary, &[kind], (None, 4), settings).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for plan in [&plan, &plan.write(folder.path()).unwrap()] {
        let of = plan.loads(&drive, kind, None);
        assert_eq!((of.t1_n_m, of.t2_n_m, of.largest_n_m), (29.0, 108.0, 153.0));
        assert_eq!(plan.loads(&drive, kind, Some(50.0)).largest_n_m, 50.0);
    }
    let plan = of_fields(&["generator.w0_mm=0.5"], &[kind]).unwrap();
    assert_eq!(plan.loads(&drive, kind, None).largest_n_m, drive.rated_torque_n_m(kind));
}
