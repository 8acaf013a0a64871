//! Contact FEM of strain wave (harmonic) drives, the compensation tables made from it, and what measured data add.
//!
//! ```text
//! drive.toml -> Drive -> Problem -> Motion -> make_tables -> image (.fxt), read by the crate `flexspline`
//!                                     |
//!                        simulate, make_kernels, sweep, reproduce, fly
//! measured.csv -> parse_log -> Picture, calibrate, diagnose -> Model -> drive and tables, extended
//! ```
//!
//! Each name is here once, by what one wants to do; the crates behind them (`flexspline-mechanics`, `-design`,
//! `-identify`, `-fly`, `-export`, `-report`) have all the rest.
//!
//! Lengths are mm, forces N, torques N m, angles rad, temperatures °C, and a name carries any other unit. A positive
//! load turns the output forward; the error is output angle minus generator angle over the ratio, positive when the
//! output leads.
//!
//! # Describe a drive
//!
//! ```
//! use flexspline_sim::{Drive, DriveError};
//!
//! let drive = Drive::hhd_95();
//! assert_eq!((drive.flexspline.teeth, drive.circular_spline.teeth, drive.ratio()), (188, 190, 95.0));
//! let again: Result<Drive, DriveError> = Drive::from_toml("drive.toml", &drive.to_toml());
//! assert_eq!(again?, drive);
//! # Ok::<(), DriveError>(())
//! ```
//!
//! # Deform, load and turn it
//!
//! ```
//! use flexspline_sim::{Drive, GeneratorKind, MeshLevel, Method, Motion, Problem, SolverSettings};
//!
//! let drive = Drive::hhd_95();
//! let settings = SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() };
//! let problem = Problem::new(&drive, GeneratorKind::Cam, drive.temperature.reference_c, settings)?;
//! let mut motion = Motion::deformed(&problem, 0.0)?;
//! motion.settle(motion.pitch() / 8.0)?;
//! // Driven forward without load, the output lags by half the clearance of 0.987'.
//! assert!((motion.error_arcsec() + 0.5 * 0.987 * 60.0).abs() < 1.0);
//! # Ok::<(), flexspline_sim::SolveError>(())
//! ```
//!
//! # Simulate a path
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use flexspline_sim::{Drive, GeneratorKind, Path, PathPoint, SimulateError, SimulationSettings, simulate};
//!
//! let point = |generator_rad| PathPoint { generator_rad, torque_n_m: Some(10.0), temperature_c: None };
//! let mut settings = SimulationSettings::new(GeneratorKind::Cam, Path::Points(vec![point(0.0), point(0.01)]));
//! settings.solver.mesh = flexspline_sim::MeshLevel::Coarse;
//! let simulation = simulate(&Drive::hhd_95(), &settings, &mut |_| ControlFlow::Continue(()))?;
//! assert_eq!((simulation.rows.len(), simulation.summary.status), (2, "converged"));
//! # Ok::<(), SimulateError>(())
//! ```
//!
//! # Make a table
//!
//! [`make_tables`] computes its samples by FEM; these were computed before.
//!
//! ```
//! use flexspline::Table;
//! use flexspline_sim::{Drive, GeneratorKind, SampleOptions, read_samples, table_of_samples};
//!
//! let file = "../tests/firmware/samples/cam.samples.csv";
//! let (samples, bytes) = (read_samples(file.as_ref())?, std::fs::read(file)?);
//! let options = SampleOptions::default();
//! let made = table_of_samples(&Drive::hhd_95(), GeneratorKind::Cam, &samples, "cam", &bytes, options)?;
//! let table = Table::check(&made.image)?;
//! assert_eq!(table.drive().flexspline_teeth(), 188);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Look at a log
//!
//! ```
//! use flexspline_sim::{look, raw};
//!
//! let looked = look(&[raw::parse("joint3.csv", std::fs::read("../examples/lara8/joint3.csv")?)?])?;
//! assert_eq!(looked.ratio_proposed, Some(101.0));
//! assert!(looked.columns_option.unwrap().contains("generator=encoder_motorinc_3"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Read it and see its error
//!
//! ```
//! use flexspline_sim::{Gear, Nominal, Picture, Rows};
//! # use flexspline_sim::{ColumnMap, parse_log};
//! # let columns = ColumnMap::parse("time=t_s:s,generator=wave_gen_turns:turn,error=error_arcsec:arcsec")?;
//! # let file = "../examples/csf17_100/error_vs_input.csv";
//!
//! let log = parse_log(file, std::fs::read(file)?, &columns, &Gear::of_ratio(100.0))?;
//! let model = "../examples/csf17_100/nominal.toml";
//! let nominal = Nominal::from_toml(model, &std::fs::read_to_string(model)?)?;
//! let rows = Rows::new(&log.sessions, &nominal);
//! let picture = Picture::of(&rows, &rows.error, nominal.ratio)?;
//! // Two waves a generator turn, 21 arcsec.
//! let largest = &picture.spectra[0].peaks[0];
//! assert!((largest.order - 2.0).abs() < 0.1 && (largest.amplitude_arcsec - 21.0).abs() < 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Calibrate one unit
//!
//! ```
//! use flexspline_sim::{ColumnMap, Gear, GeneratorKind, Prior, calibrate, parse_log};
//!
//! let columns = ColumnMap::parse("time=t_s:s,generator=wave_gen_turns:turn,error=error_arcsec:arcsec")?;
//! let file = "../examples/csf17_100/error_vs_input.csv";
//! let log = parse_log(file, std::fs::read(file)?, &columns, &Gear::of_ratio(100.0))?;
//! let made = calibrate(&[log], &Prior::of_ratio(100.0, GeneratorKind::Cam))?;
//! assert!(made.calibration.core.rms_after_arcsec < 0.4 * made.calibration.core.rms_before_arcsec);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Name what the simulation gets wrong
//!
//! ```
//! use flexspline_sim::{ColumnMap, Drive, GeneratorKind, Model, Settings, Subject, diagnose, parse_rows};
//!
//! let model = Model::read("../examples/csf17_100/nominal.toml".as_ref())?;
//! let mut subject = Subject::of_model(model, Drive::hhd_95(), GeneratorKind::Cam);
//! let columns = ColumnMap::parse("time=t_s:s,generator=wave_gen_turns:turn,error=error_arcsec:arcsec")?;
//! let log = std::fs::read("../examples/csf17_100/error_vs_input.csv")?;
//! let rows = parse_rows("error_vs_input.csv", log, &columns, &mut subject)?;
//! let diagnosed = diagnose(rows, &subject, &Settings::default(), |_, _, _| ())?;
//! // 2.5 turns of the generator cannot say which wheel it is.
//! assert!(diagnosed.diagnosis.causes.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Play a table over measured rows
//!
//! ```
//! use flexspline_sim::{MeasuredRow, replay};
//! # use flexspline_sim::{Drive, GeneratorKind, SampleOptions, read_samples, table_of_samples};
//! # let file = "../tests/firmware/samples/cam.samples.csv";
//! # let (samples, bytes) = (read_samples(file.as_ref())?, std::fs::read(file)?);
//! # let options = SampleOptions::default();
//! # let made = table_of_samples(&Drive::hhd_95(), GeneratorKind::Cam, &samples, "cam", &bytes, options)?;
//! # let table = flexspline::Table::check(&made.image)?;
//!
//! let still = MeasuredRow { generator_rad: 0.0, error_arcsec: 0.0, torque_n_m: 5.0, temperature_c: 20.0, session: 0 };
//! let row = |k| MeasuredRow { generator_rad: 0.01 * f64::from(k), ..still };
//! let (rows, summary) = replay(&table, &(0..50).map(row).collect::<Vec<_>>(), None);
//! assert_eq!((rows.len(), rows[49].quality), (50, "in range"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Fly it
//!
//! ```
//! use flexspline_sim::{flight_named, flight_results};
//!
//! let camera = flight_named("camera").expect("a scenario of that name is built in");
//! let results = flight_results(&camera, &camera.fly()?);
//! assert!(results.stable && results.rms_arcsec.compensated < results.rms_arcsec.none);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

// Describe a drive.
pub use flexspline_design::catalogue::{sheet as catalogue_sheet, sizes_in_words};
pub use flexspline_design::stated::Stated;
pub use flexspline_identify::nominal::Nominal;
pub use flexspline_mechanics::drive::{AsBuilt, Drive, DriveError, FewNumbers, GeneratorKind, UnknownGenerator};

// Deform, load and turn it.
pub use flexspline_mechanics::mesh::MeshLevel;
pub use flexspline_mechanics::motion::Motion;
pub use flexspline_mechanics::stepping::{Method, Problem, SolveError, SolverSettings, State};

// Simulate a path; the sheet of a drive; many drives; a published study.
pub use flexspline_design::data_sheet::{DataSheet, Loads, data_sheet};
pub use flexspline_design::simulate::{
    Path, PathPoint, SimulateError, Simulation, SimulationSettings, Summary, read_path, simulate,
};
pub use flexspline_design::sweep::{
    Judge, PlanSettings, ReducedSweep, Shard, Tolerances, VariantPlan, Vary, reduce as reduce_sweep, run as run_sweep,
};
pub use flexspline_pacana_2023::reproduce;

// Make tables, and compare them with fresh FEM.
pub use flexspline_design::kernels::{Kernels, make as make_kernels};
pub use flexspline_design::tables::samples::read as read_samples;
pub use flexspline_design::tables::{
    MadeTable, MakeError, SampleOptions, TableError, TableSettings, Validation, ValidationSettings,
    from_samples as table_of_samples, make as make_tables, validate as validate_tables,
};

// Read measured data.
pub use flexspline_identify::diagnosis::rows::Rows;
pub use flexspline_identify::look::{Looked, look};
pub use flexspline_identify::measurement::{
    ColumnMap, Fault, Gear, MappingError, MeasuredError, Recording, Session, parse as parse_log, raw,
};
pub use flexspline_identify::residual::Picture;

// Calibrate, diagnose, extend the model, play a table over measured rows, make rows with a hidden cause.
pub use flexspline_identify::calibrate::{Calibrated, Calibration, CalibrationError, Prior, calibrate};
pub use flexspline_identify::causes::CauseName;
pub use flexspline_identify::diagnosis::{
    Diagnosed, Diagnosis, Explanation, PipelineError, Settings, Subject, diagnose_rows as diagnose, parse_rows,
};
pub use flexspline_identify::extension::{Model, left_by_core};
pub use flexspline_identify::replay::{MeasuredRow, ReplaySummary, ReplayedRow, replay};
pub use flexspline_identify::synthesize::{Synthesized, synthesize};

// Fly it.
pub use flexspline_fly::fly::{
    Flown, FlyError, Results, built_in as flight_named, read as read_flight, results as flight_results,
};

// Hand it to other programs.
pub use flexspline_export::bundle::Bundle;
pub use flexspline_export::fmu::{Fmu, compensation as compensation_fmu, joint as joint_fmu};
pub use flexspline_export::{Deck, DeckSettings, write_vtu, write_whole_flexspline};
