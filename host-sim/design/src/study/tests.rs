use super::*;
use crate::data_sheet::FIGURES;
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::Method;

pub(super) fn settings(vary: &[&str]) -> StudySettings {
    StudySettings {
        vary: vary.iter().map(|text| text.parse().unwrap()).collect(),
        spread: None,
        seed: 1,
        generators: vec![GeneratorKind::Cam],
        torque_n_m: None,
        stated: None,
        positions: 4,
        constraints: Vec::new(),
        targets: vec![StudyTarget::new("kinematic_error_pp_arcsec", Sense::Least).unwrap()],
        compute_all: false,
        solver: SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() },
    }
}

fn quietly(settings: &StudySettings) -> Result<Study, StudyError> {
    study(&Drive::hhd_95(), settings, &|_, _, _| ControlFlow::Continue(()))
}

/// A run with figures that were made up.
pub(super) fn made_up(variant: usize, value: f64, error: f64, stress: f64) -> StudyRun {
    StudyRun {
        variant,
        generator: GeneratorKind::Cam,
        values: vec![value.to_string()],
        status: RunStatus::Converged,
        basis: Basis::Computed,
        why: None,
        cautions: Vec::new(),
        loads: None,
        sheet: DataSheet {
            rigid_gap_um: Some(1.0),
            kinematic_error_pp_arcsec: Some(error),
            max_von_mises_mpa: Some(stress),
            ..DataSheet::default()
        },
        meets: false,
        front: false,
    }
}

/// A thicker rim is stiffer, most where two rollers bend it most, and presses on them harder: the signs are known
/// without FEM.
#[test]
fn a_thicker_rim_is_stiffer_under_two_rollers() {
    let mut settings = settings(&["flexspline.rim_thickness_mm=1.4..2.2:2"]);
    settings.generators = vec![GeneratorKind::TwoRoller];
    let study = quietly(&settings).unwrap();
    let [thin, thick] = [&study.runs[0].sheet, &study.runs[1].sheet];
    println!("{thin:?}\n{thick:?}");
    assert!(thick.k1_n_m_per_rad.unwrap() > 2.0 * thin.k1_n_m_per_rad.unwrap());
    assert!(thick.k2_n_m_per_rad.unwrap() > 1.1 * thin.k2_n_m_per_rad.unwrap());
    assert!(thick.wind_up_arcsec.unwrap() < thin.wind_up_arcsec.unwrap());
    assert!(thick.peak_generator_pressure_mpa.unwrap() > thin.peak_generator_pressure_mpa.unwrap());
}

#[test]
fn a_field_that_is_not_there_is_told_before_anything_runs() {
    let error = quietly(&settings(&["flexspline.rim_thicknes_mm=1..2"])).unwrap_err().to_string();
    assert!(error.contains("rim_thickness_mm"), "{error}");
    let error = quietly(&settings(&["flexspline.rim_thickness_mm=-2..-1"])).unwrap_err();
    assert!(matches!(error, StudyError::NoDrive { .. }), "{error}");
    let twice = quietly(&settings(&["generator.w0_mm=0.4..0.5", "generator.w0_mm=0.4..0.5"])).unwrap_err();
    assert!(matches!(twice, StudyError::Fields { .. }), "{twice}");
}

/// What makes no drive is a row that says why, beside the others.
#[test]
fn a_variant_that_makes_no_drive_is_refused_with_its_reason_and_the_rest_runs() {
    let study = quietly(&settings(&["flexspline.rim_thickness_mm=-1,2"])).unwrap();
    assert_eq!(study.runs[0].status, RunStatus::Refused);
    assert!(study.runs[0].why.as_ref().unwrap().contains("rim_thickness_mm"));
    assert_eq!(study.runs[1].status, RunStatus::Converged);
    // A drive as drawn has no room of its own as built.
    let told = |name: &str| name != "room_as_built_arcsec";
    let known = FIGURES.iter().filter(|(name, _)| told(name));
    assert!(
        known.into_iter().all(|(name, of)| of(&study.runs[1].sheet).is_some_and(f64::is_finite) || panic!("{name}"))
    );
}

/// Rollers that would overlap are refused of the generator that has them, and of no other.
#[test]
fn a_variant_has_to_suit_the_generator_that_it_runs_with_alone() {
    let mut settings = settings(&["generator.roller_diameter_mm=40,41"]);
    settings.generators = vec![GeneratorKind::Cam, GeneratorKind::FourRoller];
    let study = quietly(&settings).unwrap();
    let told: Vec<&str> = study.runs.iter().map(|run| run.status.name()).collect();
    assert_eq!(told, ["converged", "refused", "converged", "refused"]);
    assert!(study.runs[1].why.as_ref().unwrap().contains("too large for the four-roller generator"));
    settings.generators = vec![GeneratorKind::FourRoller];
    assert!(matches!(quietly(&settings), Err(StudyError::NoDrive { .. })));
}

#[test]
fn constraints_leave_out_and_the_front_is_what_nothing_beats() {
    let targets = [("kinematic_error_pp_arcsec", Sense::Least), ("max_von_mises_mpa", Sense::Least)]
        .map(|(name, sense)| StudyTarget::new(name, sense).unwrap());
    let mut runs = [(1.0, 300.0), (2.0, 200.0), (3.0, 250.0), (0.5, 500.0), (2.0, 200.0)]
        .map(|(e, s)| made_up(1, 1.0, e, s))
        .to_vec();
    runs[1].sheet.rigid_gap_um = Some(-1.0);
    judge::judge(&mut runs, &["max_von_mises_mpa=..400".parse().unwrap()], &targets, &[]);
    let told: Vec<(bool, bool)> = runs.iter().map(|run| (run.meets, run.front)).collect();
    // The second interferes, the third is beaten by the fifth, the fourth breaks the constraint.
    assert_eq!(told, [(true, true), (false, false), (true, false), (false, false), (true, true)]);
}

/// The one made worse has the smaller error where it was looked at. It is no better for that, and the one as drawn
/// comes first.
#[test]
fn variants_are_compared_with_those_made_alike() {
    let targets = [StudyTarget::new("kinematic_error_pp_arcsec", Sense::Least).unwrap()];
    let mut runs: Vec<StudyRun> = Vec::new();
    for (rim, off, error) in [("1.0", "0", 0.380), ("1.0", "10", 0.324), ("1.2", "0", 0.5), ("1.2", "10", 0.3)] {
        let mut run = made_up(runs.len() + 1, 1.0, error, 100.0);
        run.values = vec![rim.to_owned(), off.to_owned()];
        runs.push(run);
    }
    let fields =
        ["flexspline.rim_thickness_mm", "as_built.circular_spline_eccentricity_um"].map(str::to_owned).to_vec();
    let errors = errors_of_making(&fields);
    assert_eq!(errors, [1]);
    judge::judge(&mut runs, &[], &targets, &errors);
    let study = Study { fields, runs, trust: Vec::new() };
    let front: Vec<usize> = study.front(GeneratorKind::Cam, &targets).iter().map(|run| run.variant).collect();
    assert_eq!(front, [1, 4]);
}

#[test]
fn a_constraint_that_cannot_be_read_says_what_is_allowed() {
    for text in [
        "max_von_mises_mpa",
        "max_von_mises_mpa=3",
        "max_von_mises_mpa=..",
        "max_von_mises_mpa=5..4",
        "max_von_mises_mpa=x..",
    ] {
        let error = text.parse::<Constraint>().unwrap_err().to_string();
        assert!(error.contains("LEAST..MOST"), "{error}");
    }
    let error = "max_mises_mpa=..3".parse::<Constraint>().unwrap_err().to_string();
    assert!(error.contains("did you mean") && error.contains("max_von_mises_mpa"), "{error}");
}

#[test]
fn effects_are_the_slopes_of_what_is_straight() {
    let runs: Vec<StudyRun> = (0..6).map(|k| made_up(k, f64::from(k as u32), 10.0 - 1.5 * k as f64, 7.0)).collect();
    let study = Study { fields: vec!["a".into()], runs, trust: Vec::new() };
    let effect = effects(&study, GeneratorKind::Cam, "kinematic_error_pp_arcsec").unwrap();
    assert!((effect.change[0].unwrap() + 7.5).abs() < 1e-9 && (effect.straight - 1.0).abs() < 1e-12);
    assert!(effects(&study, GeneratorKind::Cam, "backlash_arcsec").is_none());
}

/// K1, K2 and K3 stand beside those of the catalogue at its own loads, unless another largest load is asked for.
#[test]
fn the_loads_are_those_of_the_data_sheet() {
    let (drive, mut settings) = (Drive::hhd_95(), settings(&["generator.w0_mm=0.5"]));
    let largest = drive.rated_torque_n_m(GeneratorKind::Cam);
    assert_eq!(settings.loads(&drive, GeneratorKind::Cam), Loads::up_to(largest));
    let (t1_n_m, t2_n_m) = (Some(29.0), Some(108.0));
    settings.stated = Some(Stated { t1_n_m, t2_n_m, rated_torque_n_m: Some(153.0), ..Stated::default() });
    let stated = Loads { t1_n_m: 29.0, t2_n_m: 108.0, largest_n_m: 153.0 };
    assert_eq!(settings.loads(&drive, GeneratorKind::Cam), stated);
    settings.torque_n_m = Some(50.0);
    assert_eq!(settings.loads(&drive, GeneratorKind::Cam), Loads::up_to(50.0));
}

/// The largest load goes with the size of a variant: HHD-95 twice as wide is loaded twice as far.
#[test]
fn a_last_stable_load_is_refused_where_no_variant_is_loaded_so_far() {
    let (drive, kind) = (Drive::hhd_95(), GeneratorKind::Cam);
    let width = drive.flexspline.width_mm;
    let mut settings = settings(&[&format!("flexspline.width_mm={width},{}", 2.0 * width)]);
    let largest = drive.rated_torque_n_m(kind);
    let begins = |settings: &StudySettings| match variants(&drive, settings) {
        Ok(_) => None,
        Err(StudyError::BeyondLoad { largest_n_m, .. }) => Some(largest_n_m),
        Err(other) => panic!("{other}"),
    };
    let keep = |times: f64| vec![format!("{LAST_STABLE}={}..", times * largest).parse().unwrap()];
    settings.constraints = keep(1.5);
    assert_eq!(begins(&settings), None);
    settings.constraints = keep(2.5);
    assert_eq!(begins(&settings), Some(2.0 * largest));
    // A load that is asked for, and one that is stated, are those of every variant.
    settings.constraints = keep(1.5);
    settings.torque_n_m = Some(largest);
    assert_eq!(begins(&settings), Some(largest));
    settings.torque_n_m = None;
    settings.stated = Some(Stated { rated_torque_n_m: Some(largest), ..Stated::default() });
    assert_eq!(begins(&settings), Some(largest));
}

/// Two rollers bear a tenth of what a cam does, and a catalogue rates the cam.
#[test]
fn a_sheet_that_loads_a_generator_beyond_its_table_is_told() {
    let (drive, mut settings) = (Drive::hhd_95(), settings(&["generator.w0_mm=0.5"]));
    let beyond = |settings: &StudySettings| {
        [GeneratorKind::TwoRoller, GeneratorKind::Cam].map(|kind| settings.sheet_beyond_table_n_m(&drive, kind))
    };
    assert_eq!(beyond(&settings), [None; 2]);
    settings.stated = Some(Stated { k1_n_m_per_rad: Some(1e4), ..Stated::default() });
    assert_eq!(beyond(&settings), [None; 2]);
    settings.stated = Some(Stated { rated_torque_n_m: Some(153.0), ..Stated::default() });
    assert_eq!(beyond(&settings), [Some(153.0), None]);
    settings.torque_n_m = Some(153.0);
    assert_eq!(beyond(&settings), [None; 2]);
}

/// A run may bear the largest load and fail in the turn after it.
#[test]
fn a_last_stable_load_that_is_the_largest_is_a_bound_however_the_run_ended() {
    let mut run = made_up(1, 1.0, 1.0, 200.0);
    run.loads = Some(Loads::up_to(10.0));
    assert!(run.bears_all());
    run.status = RunStatus::Failed;
    for (last, basis, bears) in [
        (None, Basis::Computed, false),
        (Some(9.9), Basis::Computed, false),
        (Some(10.0), Basis::Computed, true),
        (Some(10.0), Basis::Estimated, false),
    ] {
        (run.sheet.last_stable_n_m, run.basis) = (last, basis);
        assert_eq!(run.bears_all(), bears, "{last:?} {basis:?}");
    }
}

/// The stress is even in `a`, which varies about zero; nothing depends on `b`.
#[test]
fn a_field_is_idle_where_no_figure_changes_with_it_and_not_where_a_line_has_no_slope() {
    let run = |k: usize, a: f64, b: f64| {
        let mut run = made_up(k, a, 1.0, 200.0 + a * a);
        run.values.push(b.to_string());
        run
    };
    let places = [-5.0, 0.0, 5.0].into_iter().flat_map(|a| [1.0, 2.0, 3.0].map(|b| (a, b)));
    let runs: Vec<StudyRun> = places.enumerate().map(|(k, (a, b))| run(k + 1, a, b)).collect();
    let mut study = Study { fields: vec!["a".into(), "b".into()], runs, trust: Vec::new() };
    let slope = effects(&study, GeneratorKind::Cam, "max_von_mises_mpa").unwrap().change[0].unwrap();
    assert!(slope.abs() < 1e-9, "{slope}");
    let idle = |study: &Study| [0, 1].map(|field| is_idle(study, GeneratorKind::Cam, field));
    assert_eq!(idle(&study), [false, true]);
    // A variant that fails where its neighbours do not is a change, too.
    study.runs[4].status = RunStatus::Failed;
    assert_eq!(idle(&study), [false; 2]);
    // Spread variants that differ in every field tell a field that does nothing where all are the same alone.
    study.runs = [(1.0, 1.0), (2.0, 3.0)].map(|(a, b)| run(1, a, b)).to_vec();
    assert_eq!(idle(&study), [false; 2]);
    study.runs.truncate(1);
    assert_eq!(idle(&study), [false; 2]);
}

#[test]
fn a_study_that_is_stopped_gives_nothing() {
    let stopped =
        study(&Drive::hhd_95(), &settings(&["generator.w0_mm=0.48..0.49:4"]), &|_, _, _| ControlFlow::Break(()));
    assert_eq!(stopped.unwrap_err(), StudyError::Stopped);
}
