//! Torque nodes where the drive needs them.
//!
//! Wind-up and ripple change where further teeth take load: under rollers several times below a tenth of the rated
//! torque, under a cam hardly at all. So the nodes are not guessed: between two nodes the FEM is asked at the middle
//! (of the square roots), and where the table made so far misses it, the middle becomes a node. The same core code
//! reads the trial table as will read the final one.

use flexspline::{Direction, GeneratorAngle, ImageError, Table};
use flexspline_make::{ProjectError, WriteError};

use super::project::{TableError, trial_table};
use rayon::prelude::*;

use super::sweep::{Computed, KnownNode, Sampler, SweepPlan, TorqueSweepError, Work, symmetric_nodes};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::{Drive, GeneratorKind};

/// How nodes are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeChoice {
    /// Largest torque, N m.
    pub largest_n_m: f64,
    /// Nodes on each side of zero, beside the pair at the drag torque, at most.
    pub most: usize,
    /// Difference between table and FEM, arcsec, above which a node is added.
    pub tolerance_arcsec: f64,
}

/// The nodes and what was computed to find them.
#[derive(Debug, Clone)]
pub(crate) struct ChosenNodes {
    /// Torque nodes, symmetric about zero, ascending, N m.
    pub torque_nodes_n_m: Vec<f32>,
    /// Those that were sampled, at the first temperature.
    pub known: Vec<KnownNode>,
    /// Whether the table meets the tolerance at the middle of every interval; if not, the nodes ran out.
    pub resolved: bool,
    /// Work spent.
    pub work: Work,
}

/// Nodes on each side that the choice starts with.
const FIRST_NODES: usize = 5;

/// Chooses the torque nodes of a generator at the first temperature of the plan, that of the `sampler`. The drive is
/// without its imperfections: where wind-up bends is a matter of the rim and its support, and they do not move that.
pub(crate) fn choose_torque_nodes(
    drive: &Drive,
    kind: GeneratorKind,
    plan: &SweepPlan,
    choice: NodeChoice,
    sampler: &Sampler<'_>,
) -> Result<ChosenNodes, TorqueSweepError> {
    let all = symmetric_nodes(drive.output.drag_torque_n_m, choice.largest_n_m, FIRST_NODES);
    let nodes: Vec<f32> = all.into_iter().filter(|t| f64::from(*t) > drive.output.drag_torque_n_m).collect();
    let mut work = Work::default();
    let mut loaded = sampler.loaded(&nodes, &mut work)?;
    let mut sampled = sampler.nodes(&loaded, &mut work)?;
    let open = nodes.windows(2).map(|w| [w[0], w[1]]).collect();
    let refined = refined(nodes, open, choice.most + 1, choice.tolerance_arcsec, |nodes, middles| {
        sampled.retain(|node| nodes.contains(&node.torque));
        let trial = accepted(trial_table(drive, kind, plan, nodes, &sampled))?;
        let miss = |points: &[Computed]| {
            trial.as_ref().map_or(f64::INFINITY, |image| ARCSEC_PER_RAD * worst_miss(image, points))
        };
        // From the state of the nearest lighter load.
        let asked = |middle: &f32| {
            let mut work = Work::default();
            let lighter = loaded.iter().filter(|state| state.torque < *middle);
            let from = lighter.max_by(|a, b| a.torque.total_cmp(&b.torque)).unwrap_or(&sampler.unloaded);
            let state = sampler.load(from, *middle, &mut work)?;
            let missed = |points: &[Computed]| miss(points) > choice.tolerance_arcsec;
            let (node, whole) = sampler.sample(&state, missed, &mut work)?;
            Ok((state, node, whole, work))
        };
        let asked = middles.par_iter().with_max_len(1).map(asked).collect::<Result<Vec<_>, TorqueSweepError>>()?;
        let mut misses = Vec::new();
        for (state, node, whole, more) in asked {
            work.add(more);
            misses.push(miss(&node.points));
            if whole {
                loaded.push(state);
                sampled.push(node);
            }
        }
        Ok::<_, TorqueSweepError>(misses)
    })?;
    let nodes = refined.nodes;
    sampled.retain(|node| nodes.contains(&node.torque));
    let drag = drive.output.drag_torque_n_m;
    let before_jump = (2.0 * drag - f64::from(nodes[0])) as f32;
    let positive: Vec<f32> = std::iter::once(before_jump).chain(nodes).collect();
    Ok(ChosenNodes {
        torque_nodes_n_m: positive.iter().rev().map(|t| -t).chain(positive.iter().copied()).collect(),
        known: sampled,
        resolved: refined.resolved,
        work,
    })
}

/// Torque nodes as they were put in.
pub struct Refined {
    /// Ascending.
    pub nodes: Vec<f32>,
    /// Whether no middle of an interval is missed by more than the tolerance; if not, the nodes ran out.
    pub resolved: bool,
}

/// Puts a node into the middle (of the roots) of every interval of `open` where the table of the nodes so far misses by
/// more than `tolerance`, the worst first, and looks into the halves again, until nothing is missed or there are `most`
/// nodes. `misses` is given the nodes so far and the middles that are asked for.
pub fn refined<E>(
    mut nodes: Vec<f32>,
    mut open: Vec<[f32; 2]>,
    most: usize,
    tolerance: f64,
    mut misses: impl FnMut(&[f32], &[f32]) -> Result<Vec<f64>, E>,
) -> Result<Refined, E> {
    while !open.is_empty() && nodes.len() < most {
        open.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let middles: Vec<f32> = open.iter().map(|[low, high]| middle(*low, *high)).collect();
        let mut missed: Vec<(f64, f32)> = misses(&nodes, &middles)?.into_iter().zip(middles).collect();
        missed.retain(|(miss, _)| *miss > tolerance);
        missed.sort_by(|a, b| b.0.total_cmp(&a.0));
        open.clear();
        for (_, middle) in missed {
            if nodes.len() < most {
                let place = nodes.partition_point(|node| *node < middle);
                open.extend([[nodes[place - 1], middle], [middle, nodes[place]]]);
                nodes.insert(place, middle);
            }
        }
    }
    Ok(Refined { nodes, resolved: open.is_empty() })
}

/// The middle of the roots of two loads; of loads of either sign their mean.
fn middle(low: f32, high: f32) -> f32 {
    let (a, b) = (f64::from(low), f64::from(high));
    if a * b <= 0.0 {
        return f64::midpoint(a, b) as f32;
    }
    (a.signum() * f64::midpoint(a.abs().sqrt(), b.abs().sqrt()).powi(2)) as f32
}

/// A trial table, or none: with few nodes the curve through them may swing so far that the core would not take it.
pub fn accepted<T>(trial: Result<T, TableError>) -> Result<Option<T>, TableError> {
    match trial {
        Ok(trial) => Ok(Some(trial)),
        Err(TableError::Project(ProjectError::Write(WriteError::Refused(
            ImageError::Falls { .. } | ImageError::Steep { .. },
        )))) => Ok(None),
        Err(other) => Err(other),
    }
}

/// Largest difference between a trial table and samples of one torque, rad.
fn worst_miss(image: &[u8], points: &[Computed]) -> f64 {
    let Ok(table) = Table::check(image) else { return f64::INFINITY };
    points
        .iter()
        .map(|point| {
            let s = point.sample;
            let said = GeneratorAngle::from_rad(s.generator_rad).and_then(|g| {
                table.steady_error_rad(g, s.torque_n_m as f32, s.temperature_c as f32, Direction::Forward)
            });
            let error = s.output_rad - s.generator_rad / table.drive().exact_ratio();
            said.map_or(f64::INFINITY, |said| (f64::from(said) - error).abs())
        })
        .fold(0.0, f64::max)
}
