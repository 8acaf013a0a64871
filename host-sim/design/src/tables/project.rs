//! From samples to the table image that firmware reads.
//!
//! The projection itself is the core's ([`flexspline_make`]), the same code on the host and on board. Here its plan is
//! laid: which nodes, which harmonics the samples can distinguish, and where the table came from.

use flexspline::{FixedMember, Table};
use flexspline_make::{
    Harmonics, MAX_RIPPLE_NODES, MissingDirection, Plan, ProjectError, Provenance, Sample, Workspace, make_image,
};
use thiserror::Error;

use super::info::{MadeTable, Source, TableInfo, TurnsAtTorque, TurnsInfo};
use super::sweep::{KnownNode, SweepPlan, TorqueSweep, mirror};
use crate::cautions::LookedAt;
use flexspline_base::robust::{least_and_most, rms};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::stepping::SolverSettings;

/// Turns of the output that separate 2 per generator turn from 2 per turn of the generator against the output.
const OUTPUT_TURNS_FOR_HARMONICS: f64 = 0.5;
/// Orders fitted where the samples cover enough turns: per generator turn, per turn against the output, per output
/// turn.
pub(super) const GENERATOR_ORDERS: [u16; 4] = [1, 2, 3, 4];
pub(super) const MATERIAL_ORDERS: [u16; 4] = [1, 2, 3, 4];
pub(super) const OUTPUT_ORDERS: [u16; 2] = [1, 2];
/// Torques of a sample file closer than this share of the largest are one node.
const SAME_TORQUE: f64 = 1e-6;
/// Deviation (rad) that FEM samples may have from the table; they are exact but for rounding.
const FEM_DEVIATION_RAD: f64 = 1e-6;
/// Largest deviation (rad) of a sample from the table for a drive with imperfections, whose error changes with the load
/// in ways that a table has no room for: 120″. What it is stands in the table; only what is no drive at all is refused.
const AS_BUILT_DEVIATION_RAD: f64 = 6e-4;
/// Negative half-width (rad) taken for the noise of the contact discretisation: 0.1″.
const HALF_WIDTH_NOISE_RAD: f64 = 5e-7;

/// Places of a turn of the output over which a curve's mean is taken: no multiple of an order.
const PLACES_OF_A_MEAN: u32 = 101;
/// Samples of one temperature hold this far about it, K: a log without a temperature is of a room, and no thermometer
/// keeps to one number. A guess.
const ONE_TEMPERATURE_K: f32 = 5.0;
/// Where the samples of a table come from, unless from a mesh.
const SAMPLES: &str = "samples";

/// Why no table was made.
#[derive(Debug, Error)]
pub enum TableError {
    /// The samples make no table.
    #[error("the samples make no table: {0}")]
    Project(ProjectError),
    /// Drive not of the kind that tables are for.
    #[error("drive {drive}: tooth counts {flexspline} and {circular_spline} make no drive of two waves: {reason}")]
    Teeth {
        /// Name of the drive.
        drive: String,
        /// Teeth.
        flexspline: u32,
        /// Teeth.
        circular_spline: u32,
        /// Why.
        reason: String,
    },
}

/// Options for samples that are not ours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleOptions {
    /// Half-width (rad) where only one direction was sampled; without it that is an error.
    pub half_width_rad: Option<f64>,
    /// Deviation (rad) from the table that a sample may have.
    pub deviation_limit_rad: f64,
}

impl Default for SampleOptions {
    fn default() -> Self {
        SampleOptions { half_width_rad: None, deviation_limit_rad: 20.0 / ARCSEC_PER_RAD }
    }
}

/// The table of a FEM sweep; its image says of the mesh what the solver had, and this mark.
pub(crate) fn from_sweep(
    drive: &Drive,
    plan: &SweepPlan,
    sweep: TorqueSweep,
    solver: SolverSettings,
    wall_s: f64,
    mark: &str,
) -> Result<MadeTable, TableError> {
    let mesh = solver.mesh.to_string();
    let mark = empirical_mark(drive, plan, &sweep.samples) + mark;
    let repeats = drive.as_built.first_not_uniform().is_none();
    let source = Source::Fem {
        solver: solver.method.to_string(),
        mesh: mesh.to_owned(),
        degrees_of_freedom: sweep.degrees_of_freedom,
        positions: plan.positions,
        sampled: if repeats {
            "forward motion over one flexspline pitch at every torque and temperature node; backward motion is its \
             mirror image"
        } else {
            "the drive without imperfections in forward motion over one flexspline pitch at every torque and \
             temperature node, backward motion its mirror image; what the imperfections add without friction, at five \
             loads of either sign and places spread over the turns of generator and output, at reference temperature"
        }
        .to_owned(),
        increments: sweep.work.increments,
        iterations: sweep.work.iterations,
        worst_residual: sweep.work.worst_residual,
        wall_s,
    };
    let core_plan = fem_plan(drive, plan)?;
    let mut made = make(
        (&drive.name, drive.hash()),
        sweep.kind,
        &core_plan,
        &sweep.samples,
        source,
        &(mesh.clone() + &mark),
        sweep.work.worst_residual,
    )?;
    if sweep.places > 0 {
        let table = Table::check(&made.image).map_err(|e| TableError::Project(e.into()))?;
        made.info.turns = Some(turns_info(drive, plan, &sweep, &table));
    }
    made.samples = Some(sweep.samples);
    Ok(made)
}

/// Before the percent that [`empirical_percent`] reads.
const EMPIRICAL_MARK: &str = ", empirical ";

/// End of the mesh level of a table whose samples are not FEM alone.
fn empirical_mark(drive: &Drive, plan: &SweepPlan, samples: &[Sample]) -> String {
    let largest_n_m = plan.torque_nodes_n_m.last().copied().map_or(0.0, f64::from);
    let errors = samples.iter().filter(|sample| sample.torque_n_m == largest_n_m);
    let (sum, count) = errors.fold((0.0, 0.0), |(sum, count), sample| {
        (sum + sample.output_rad - sample.generator_rad / drive.ratio(), count + 1.0)
    });
    let percent = 100.0 * drive.contact_wind_up_rad(largest_n_m) * count / sum;
    // Three digits have no room.
    if percent > 0.0 { format!("{EMPIRICAL_MARK}{:.0} %", percent.min(99.0)) } else { String::new() }
}

/// Percent of a table's wind-up at its largest torque that are no FEM but `output.contact_compliance`: what ends its
/// mesh level, `, empirical 27 %`.
pub fn empirical_percent(table: &Table<'_>) -> Option<f64> {
    let (_, percent) = table.mesh_level().split_once(EMPIRICAL_MARK)?;
    percent.strip_suffix(" %")?.parse().ok()
}

/// Parts of the output's turn, each with rows or without. *Chosen*: six to the period of the highest wave of a
/// calibration.
pub const PARTS_OF_A_TURN: usize = 36;
/// Angles this near to either side of a place, deg, show what is there. *Chosen*: a quarter of a period of that wave.
const NEAR_DEG: usize = 15;

/// The parts of the output's turn, a bit each, with some of these angles, rad, near to either side of the middle.
pub fn parts_between(angles: impl Iterator<Item = f64>) -> u64 {
    let mut there = [false; 360];
    angles.for_each(|angle| there[(angle.to_degrees().rem_euclid(360.0) as usize).min(359)] = true);
    let near = |from: usize| (from..from + NEAR_DEG).any(|degree| there[degree % 360]);
    let middle = |part: usize| 360 + (2 * part + 1) * 180 / PARTS_OF_A_TURN;
    let is_between = |part: &usize| near(middle(*part) - NEAR_DEG) && near(middle(*part));
    (0..PARTS_OF_A_TURN).filter(is_between).fold(0, |parts, part| parts | 1 << part)
}

/// Before the number whose bits are the parts that [`was_recorded`] reads.
const TURN_MARK: &str = ", turn ";

/// Whether a table was recorded where the generator stands here: by what ends its mesh level, `, turn 0000003f0`, a bit
/// for each part of the output's turn. A table that does not say was everywhere.
pub fn was_recorded(table: &Table<'_>, generator_rad: f64) -> bool {
    let turns = generator_rad / table.drive().exact_ratio() / std::f64::consts::TAU;
    let part = (turns.rem_euclid(1.0) * PARTS_OF_A_TURN as f64) as usize % PARTS_OF_A_TURN;
    let marked = table.mesh_level().split_once(TURN_MARK);
    marked.and_then(|(_, parts)| u64::from_str_radix(parts, 16).ok()).is_none_or(|parts| parts >> part & 1 == 1)
}

/// A table of forward samples at positive torque `nodes` alone, for choosing nodes: the other quadrants are filled by
/// mirror images that neglect the drag. Only its image is wanted.
pub(super) fn trial_table(
    drive: &Drive,
    kind: GeneratorKind,
    plan: &SweepPlan,
    nodes: &[f32],
    known: &[KnownNode],
) -> Result<Vec<u8>, TableError> {
    let both = [flexspline::Direction::Forward, flexspline::Direction::Backward];
    let before_jump = 2.0 * drive.output.drag_torque_n_m as f32 - nodes[0];
    let mut samples = Vec::new();
    for node in known {
        for sample in node.points.iter().map(|point| &point.sample) {
            let mirrored = mirror(sample);
            for direction in both {
                samples.push(Sample { direction, ..*sample });
                samples.push(Sample { direction, ..mirrored });
                if node.torque == nodes[0] {
                    samples.push(Sample { direction, torque_n_m: -f64::from(before_jump), ..*sample });
                    samples.push(Sample { direction, torque_n_m: f64::from(before_jump), ..mirrored });
                }
            }
        }
    }
    // The jump of the trial lies between the middle pair, where no middle is ever asked.
    let positive: Vec<f32> = std::iter::once(before_jump).chain(nodes.iter().copied()).collect();
    let torque_nodes: Vec<f32> = positive.iter().rev().map(|t| -t).chain(positive.iter().copied()).collect();
    let core_plan = Plan {
        torque_nodes_n_m: &torque_nodes,
        temperature_nodes_c: &plan.temperature_nodes_c[..1],
        deviation_limit_rad: f64::from(flexspline::Table::MAX_ERROR_RAD),
        ..fem_plan(drive, plan)?
    };
    let source = Source::File { name: String::new(), blake3: String::new() };
    make((&drive.name, drive.hash()), kind, &core_plan, &samples, source, "trial", 0.0).map(|table| table.image)
}

/// Plan of the projection of a table of FEM samples.
fn fem_plan<'a>(drive: &Drive, plan: &'a SweepPlan) -> Result<Plan<'a>, TableError> {
    let repeats = drive.as_built.first_not_uniform().is_none();
    let harmonics = |orders| Harmonics::of(if repeats { &[] } else { orders });
    Ok(Plan {
        drive: core_drive(drive)?,
        torque_nodes_n_m: &plan.torque_nodes_n_m,
        temperature_nodes_c: &plan.temperature_nodes_c,
        ripple_nodes: plan.positions.min(MAX_RIPPLE_NODES),
        generator: harmonics(&GENERATOR_ORDERS),
        material: harmonics(&MATERIAL_ORDERS),
        output: harmonics(&OUTPUT_ORDERS),
        missing_direction: MissingDirection::Refuse,
        negative_half_width_tolerance_rad: if repeats { HALF_WIDTH_NOISE_RAD } else { AS_BUILT_DEVIATION_RAD },
        deviation_limit_rad: if repeats { FEM_DEVIATION_RAD } else { AS_BUILT_DEVIATION_RAD },
    })
}

/// The table of samples from elsewhere: every torque and temperature that occurs is a node, the ripple has as many
/// nodes as every node has positions, and harmonics are fitted where the samples cover enough turns to distinguish
/// them.
pub fn from_samples(
    drive: &Drive,
    kind: GeneratorKind,
    samples: &[Sample],
    name: &str,
    bytes: &[u8],
    options: SampleOptions,
) -> Result<MadeTable, TableError> {
    let torques = distinct(samples.iter().map(|s| s.torque_n_m));
    let temperatures = distinct(samples.iter().map(|s| s.temperature_c));
    let snapped: Vec<Sample> = samples
        .iter()
        .map(|s| Sample {
            torque_n_m: f64::from(nearest(&torques, s.torque_n_m)),
            temperature_c: f64::from(nearest(&temperatures, s.temperature_c)),
            ..*s
        })
        .collect();
    let (least, most) = least_and_most(snapped.iter().map(|s| s.generator_rad));
    let long = (most - least) / std::f64::consts::TAU >= OUTPUT_TURNS_FOR_HARMONICS * drive.ratio().abs();
    let harmonics = |orders| Harmonics::of(if long { orders } else { &[] });
    let plan = Plan {
        drive: core_drive(drive)?,
        torque_nodes_n_m: &torques,
        temperature_nodes_c: &temperatures,
        ripple_nodes: ripple_nodes(drive, &snapped),
        generator: harmonics(&GENERATOR_ORDERS),
        material: harmonics(&MATERIAL_ORDERS),
        output: harmonics(&OUTPUT_ORDERS),
        missing_direction: options
            .half_width_rad
            .map_or(MissingDirection::Refuse, |rad| MissingDirection::HalfWidth { rad }),
        negative_half_width_tolerance_rad: options.deviation_limit_rad,
        deviation_limit_rad: options.deviation_limit_rad,
    };
    let source = Source::File { name: name.to_owned(), blake3: blake3::hash(bytes).to_hex().to_string() };
    make((&drive.name, drive.hash()), kind, &plan, &snapped, source, SAMPLES, 0.0)
}

/// The table of samples of a model called `of`, laid out by a plan, of a drive that is known by name and hash alone,
/// from rows in these [parts](was_recorded) of the output's turn; 0 where they are too few for that.
pub fn from_plan(
    name: &str,
    hash: [u8; 32],
    kind: GeneratorKind,
    plan: &Plan<'_>,
    samples: &[Sample],
    (of, recorded): (&str, u64),
) -> Result<MadeTable, TableError> {
    let source = Source::File { name: of.to_owned(), blake3: blake3::Hash::from(hash).to_hex().to_string() };
    let is_whole = recorded == 0 || recorded.trailing_ones() as usize >= PARTS_OF_A_TURN;
    let mark = if is_whole { String::new() } else { format!("{TURN_MARK}{recorded:09x}") };
    make((name, hash), kind, plan, samples, source, &(SAMPLES.to_owned() + &mark), 0.0)
}

fn make(
    (name, hash): (&str, [u8; 32]),
    kind: GeneratorKind,
    plan: &Plan<'_>,
    samples: &[Sample],
    source: Source,
    mesh: &str,
    residual: f64,
) -> Result<MadeTable, TableError> {
    let mut numbers = vec![0.0; plan.numbers_len() + plan.kept_len(samples.len())];
    let mut marks = vec![0; plan.marks_len()];
    let mut values = vec![0.0; plan.values_len()];
    let mut image = vec![0; plan.image_bytes()];
    let workspace = Workspace { numbers: &mut numbers, marks: &mut marks, values: &mut values };
    let span = |nodes: &[f32]| [nodes[0], nodes[nodes.len() - 1]];
    let largest =
        samples.iter().map(|s| (s.output_rad - s.generator_rad / plan.drive.exact_ratio()).abs()).fold(0.0, f64::max);
    let provenance = Provenance {
        generator_kind: core_kind(kind),
        drive_hash: hash,
        tool_version: concat!("flexspline ", env!("CARGO_PKG_VERSION")),
        mesh_level: mesh,
        solver_residual: residual as f32,
        torque_range_n_m: span(plan.torque_nodes_n_m),
        temperature_range_c: match plan.temperature_nodes_c {
            [one] if mesh.starts_with(SAMPLES) => [one - ONE_TEMPERATURE_K, one + ONE_TEMPERATURE_K],
            nodes => span(nodes),
        },
        error_limit_rad: (1.5 * largest + 1e-4).min(f64::from(flexspline::Table::MAX_ERROR_RAD)) as f32,
    };
    let id = |contents: &[u8]| {
        let mut id = [0; 8];
        id.copy_from_slice(&blake3::hash(contents).as_bytes()[..8]);
        id
    };
    let fit = make_image(plan, &provenance, samples, workspace, &mut image, id).map_err(TableError::Project)?;
    image.truncate(fit.image_bytes);
    let table = Table::check(&image).map_err(|e| TableError::Project(e.into()))?;
    // Curves over whole turns are averaged; the ripple of a pitch is too small to matter.
    let curves = [plan.generator, plan.material, plan.output].iter().any(|curve| !curve.orders.is_empty());
    let places = if curves { PLACES_OF_A_MEAN } else { 1 };
    let turn = std::f64::consts::TAU * plan.drive.exact_ratio() / f64::from(places);
    let at = |torque: f32| {
        let temperature = plan.temperature_nodes_c[plan.temperature_nodes_c.len() / 2];
        let error = |direction| {
            let there = |k: u32| {
                let angle = flexspline::GeneratorAngle::from_rad(f64::from(k) * turn)?;
                table.steady_error_rad(angle, torque, temperature, direction).map(f64::from)
            };
            (0..places).map(|k| there(k).unwrap_or(f64::NAN)).sum::<f64>() / f64::from(places) * ARCSEC_PER_RAD
        };
        [error(flexspline::Direction::Forward), error(flexspline::Direction::Backward)]
    };
    let [first, last] = span(plan.torque_nodes_n_m);
    let backlash = plan.torque_nodes_n_m.iter().map(|t| at(*t)).map(|[f, b]| b - f).fold(0.0, f64::max);
    let info = TableInfo {
        schema_version: 1,
        status: "made",
        table_id: table.id().to_string(),
        generator: kind.to_string(),
        drive: name.to_owned(),
        drive_blake3: blake3::Hash::from(hash).to_hex().to_string(),
        tool: provenance.tool_version.to_owned(),
        source,
        image_bytes: fit.image_bytes,
        torque_nodes_n_m: plan.torque_nodes_n_m.to_vec(),
        torque_nodes_resolved: None,
        temperature_nodes_c: plan.temperature_nodes_c.to_vec(),
        ripple_nodes: plan.ripple_nodes,
        samples: fit.used,
        projection_worst_arcsec: fit.worst_rad * ARCSEC_PER_RAD,
        projection_rms_arcsec: fit.rms_rad * ARCSEC_PER_RAD,
        slope_bound: table.bounds().slope,
        inverse_iterations: table.inverse_iterations(),
        inverse_error_arcsec: f64::from(table.inverse_error_bound_rad()) * ARCSEC_PER_RAD,
        backlash_arcsec: backlash,
        wind_up_arcsec: [first, last].map(|t| 0.5 * at(t).iter().sum::<f64>()),
        stiffness: None,
        cautions: LookedAt { slope_bound: Some(f64::from(table.bounds().slope)), ..LookedAt::default() }.cautions(),
        data_sheet: None,
        completed: None,
        stress: Vec::new(),
        no_stress: None,
        remarks: Vec::new(),
        turns: None,
        command: String::new(),
    };
    Ok(MadeTable { kind, info, image, samples: None })
}

/// The finished table, read by the core, against the samples over whole turns.
fn turns_info(drive: &Drive, plan: &SweepPlan, sweep: &TorqueSweep, table: &Table<'_>) -> TurnsInfo {
    let error = |s: &Sample| (s.output_rad - s.generator_rad / drive.ratio()) * ARCSEC_PER_RAD;
    let left = |s: &Sample| {
        let said = flexspline::GeneratorAngle::from_rad(s.generator_rad)
            .and_then(|g| table.steady_error_rad(g, s.torque_n_m as f32, s.temperature_c as f32, s.direction));
        said.map_or(f64::NAN, |rad| f64::from(rad) * ARCSEC_PER_RAD) - error(s)
    };
    let by_torque: Vec<TurnsAtTorque> = plan
        .torque_nodes_n_m
        .iter()
        .map(|&torque_n_m| {
            let here: Vec<&Sample> = sweep.samples.iter().filter(|s| s.torque_n_m as f32 == torque_n_m).collect();
            // The places of one sample of the sweep follow one another.
            let range = |places: &[&Sample]| {
                let (least, most) = least_and_most(places.iter().map(|s| error(s)));
                most - least
            };
            let left: Vec<f64> = here.iter().map(|s| left(s)).collect();
            TurnsAtTorque {
                torque_n_m,
                drive_peak_to_peak_arcsec: here.chunks(sweep.places).map(range).fold(0.0, f64::max),
                left_rms_arcsec: rms(&left),
                left_worst_arcsec: left.iter().fold(0.0, |worst, e| e.abs().max(worst)),
            }
        })
        .collect();
    let largest = |of: fn(&TurnsAtTorque) -> f64| by_torque.iter().map(of).fold(0.0, f64::max);
    let remark = format!(
        "at these places over whole turns the drive's error ranges over up to {:.1}\"; the table has one curve for \
         each angle, the same under every load, and leaves {:.1}\" rms and {:.1}\" at most where the curves change \
         with load and flank",
        largest(|t| t.drive_peak_to_peak_arcsec),
        largest(|t| t.left_rms_arcsec),
        largest(|t| t.left_worst_arcsec)
    );
    TurnsInfo { places: sweep.places, by_torque, remark }
}

/// The drive as the core knows it.
pub fn core_drive(drive: &Drive) -> Result<flexspline::Drive, TableError> {
    let (fs, cs) = (drive.flexspline.teeth, drive.circular_spline.teeth);
    let refuse =
        |reason: String| TableError::Teeth { drive: drive.name.clone(), flexspline: fs, circular_spline: cs, reason };
    let narrow = |teeth: u32| u16::try_from(teeth).map_err(|_| refuse(format!("{teeth} teeth; at most {}", u16::MAX)));
    flexspline::Drive::new(narrow(fs)?, narrow(cs)?, FixedMember::Flexspline).map_err(|e| refuse(e.to_string()))
}

/// The generator as the core knows it.
pub fn core_kind(kind: GeneratorKind) -> flexspline::GeneratorKind {
    match kind {
        GeneratorKind::TwoRoller => flexspline::GeneratorKind::TwoRoller,
        GeneratorKind::FourRoller => flexspline::GeneratorKind::FourRoller,
        GeneratorKind::DoubleDisc => flexspline::GeneratorKind::DoubleDisc,
        GeneratorKind::Cam => flexspline::GeneratorKind::Cam,
    }
}

/// Distinct values, ascending, as table nodes.
fn distinct(values: impl Iterator<Item = f64>) -> Vec<f32> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let scale = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let mut nodes: Vec<f32> = Vec::new();
    for value in values {
        if nodes.last().is_none_or(|last| value - f64::from(*last) > SAME_TORQUE * scale) {
            nodes.push(value as f32);
        }
    }
    nodes
}

fn nearest(nodes: &[f32], value: f64) -> f32 {
    let distance = |node: f32| (f64::from(node) - value).abs();
    nodes.iter().copied().min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(value as f32)
}

/// As many nodes over the pitch as the poorest node and direction has different positions; none below four.
fn ripple_nodes(drive: &Drive, samples: &[Sample]) -> usize {
    let teeth = f64::from(drive.flexspline.teeth);
    let mut positions = std::collections::BTreeMap::<(u64, u64, bool), Vec<f64>>::new();
    for s in samples {
        let key = (s.torque_n_m.to_bits(), s.temperature_c.to_bits(), s.direction == flexspline::Direction::Forward);
        positions.entry(key).or_default().push((s.generator_rad * teeth / std::f64::consts::TAU).rem_euclid(1.0));
    }
    let poorest = positions
        .into_values()
        .map(|mut phases| {
            phases.sort_by(f64::total_cmp);
            phases.dedup_by(|a, b| *a - *b < 1e-3);
            // A first and a last that meet across the wrap are one.
            let wrapped = phases.len() > 1 && phases[0] + 1.0 - phases[phases.len() - 1] < 1e-3;
            phases.len() - usize::from(wrapped)
        })
        .min()
        .unwrap_or(0);
    match poorest {
        0..4 => 0,
        4.. => poorest.min(16),
    }
}
