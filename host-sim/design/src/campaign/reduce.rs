//! From shards to answers.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;
use thiserror::Error;

use super::draw::{Draw, drawn};
use super::model::{CLOSED, FIGURES, Model};
use super::plan::Plan;
use super::shard::{Shard, ShardState, column_names, look, path, strangers};
use super::tolerance::Tolerance;
use super::variance::{Share, shares};
use flexspline_base::statistics::{
    Exceeded, Interval, Quantile, correlation, exceeded, mean, of_replicates, quantile, std_dev,
};
use flexspline_mechanics::drive::{Drive, GeneratorKind};

/// Shares of the drives whose quantiles are told.
const SHARES: [f64; 7] = [0.01, 0.05, 0.5, 0.9, 0.95, 0.99, 0.999];
/// Drives that are written as files.
const WORST: usize = 20;
/// Figures whose variance is shared out.
pub const SHARED: [&str; 3] = ["error_pp_arcsec", "lost_motion_arcsec", "unit_table_rms_arcsec"];
/// Points of each replicate of the shares: a power of two, at least and at most, and no more than an eighth of the
/// drives.
const SHARE_POINTS: [u32; 2] = [16, 256];
/// Drives, at most, that a tolerance is halved for.
const HALVED_DRIVES: usize = 2048;
/// Blocks of these, for intervals.
const BLOCKS: usize = 8;
/// The quantile that tightening is judged by.
pub const JUDGED: f64 = 0.95;
/// Below this correlation of drives above a limit, by kernels and by FEM, and with fewer of either than that, a
/// probability is not corrected.
const LEAST_CORRELATION: f64 = 0.5;
const LEAST_ABOVE: usize = 10;
/// Fewest drives by FEM that have a correlation, means and probabilities.
const LEAST_FEM: usize = 8;

/// A campaign, reduced.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Campaign {
    /// Drives that are in.
    pub drives: usize,
    /// Drives of the plan.
    pub planned: u32,
    /// Shards that are missing.
    pub missing: Vec<u32>,
    /// By generator.
    pub generators: Vec<OfGenerator>,
}

/// What came out with one generator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OfGenerator {
    /// The generator.
    pub generator: GeneratorKind,
    /// Error of the middle drive, peak to peak, arcsec.
    pub middle_error_pp_arcsec: f64,
    /// How the figures scatter.
    pub figures: Vec<FigureSpread>,
    /// How often the error, peak to peak, is above the limits of the plan.
    pub exceeded: Vec<Exceeded>,
    /// Shares of the variance, of [`SHARED`].
    pub shares: Vec<FigureShares>,
    /// What halving each tolerance buys for each of [`SHARED`], one after the other, most first.
    pub tighten: Vec<Tightened>,
    /// Kernels beside FEM.
    pub fem: Option<FemComparison>,
    /// Drives by FEM that found no equilibrium.
    pub fem_failed: usize,
    /// Drives whose axes stand further apart than any that the kernels know.
    pub beyond_kernels: usize,
    /// Drives that have no play left at some place: lost motion there is the wind-up alone.
    pub play_closed: usize,
    /// The worst drives.
    pub worst: Vec<WorstDrive>,
    /// Errors of the drives, peak to peak, sorted, arcsec.
    #[serde(skip)]
    pub errors: Vec<f64>,
    /// Errors at the places of the FEM: by kernels and by FEM, peak to peak, arcsec.
    #[serde(skip)]
    pub pairs: Vec<[f64; 2]>,
}

/// How a figure scatters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FigureSpread {
    /// The figure.
    pub figure: &'static str,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub std: f64,
    /// Quantiles.
    pub quantiles: Vec<Quantile>,
}

/// Shares of the variance of a figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FigureShares {
    /// The figure.
    pub figure: &'static str,
    /// By tolerance.
    pub shares: Vec<Share>,
}

/// What a tolerance buys that is halved.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tightened {
    /// The figure.
    pub figure: &'static str,
    /// The tolerance.
    pub tolerance: String,
    /// Drives that this was found with: the first of those that are in.
    pub drives: usize,
    /// What 95 % of these drives stay below in this figure, before, arcsec.
    pub before_arcsec: f64,
    /// And with the tolerance halved, the draws the same.
    pub after_arcsec: f64,
    /// What is gained, arcsec.
    pub gain_arcsec: Interval,
    /// Share of the drives whose error is above each limit of the plan, before and after; nothing of other figures.
    pub above: Vec<[f64; 3]>,
}

/// Kernels beside FEM, on the drives that both have. Figures are those at the places of the FEM.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FemComparison {
    /// Drives.
    pub drives: usize,
    /// Drives that correlation, means and probabilities take.
    pub drives_needed: usize,
    /// Largest difference of the error, peak to peak, by kernels and by FEM, arcsec.
    pub largest_difference_arcsec: f64,
    /// By figure; nothing of too few drives.
    pub figures: Vec<Controlled>,
    /// Probabilities of an error above a limit; nothing of too few drives.
    pub tails: Vec<Tail>,
}

/// A mean by FEM, with the kernels as control variate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Controlled {
    /// The figure.
    pub figure: &'static str,
    /// Correlation of kernels and FEM.
    pub correlation: f64,
    /// Kernels less FEM, mean over the drives, arcsec: what kernels of first order get wrong of every drive.
    pub off_mean_arcsec: f64,
    /// Kernels less FEM, root mean square over the drives, arcsec.
    pub off_rms_arcsec: f64,
    /// Kernels less FEM, the largest of any drive, arcsec.
    pub off_most_arcsec: f64,
    /// FEM for a change of 1 by kernels.
    pub slope: f64,
    /// Mean by kernels of all drives.
    pub kernels_mean: f64,
    /// Mean by FEM alone.
    pub plain: Interval,
    /// Mean by FEM, controlled by the kernels of all drives.
    pub controlled: Interval,
}

/// A probability by FEM, with the kernels as control variate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tail {
    /// The limit, arcsec.
    pub above_arcsec: f64,
    /// By kernels, at the places of the FEM.
    pub kernels: f64,
    /// Correlation of being above.
    pub correlation: Option<f64>,
    /// By FEM with control, or none.
    pub controlled: Option<Interval>,
    /// Why not.
    pub refused: Option<String>,
}

/// One of the worst.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorstDrive {
    /// Its number.
    pub drive: u32,
    /// Its error, peak to peak, arcsec.
    pub error_pp_arcsec: f64,
    /// Its file in the folder, once written.
    pub file: String,
    /// What was drawn.
    pub values: Vec<f64>,
    /// The drive as a file.
    #[serde(skip)]
    pub toml: String,
}

/// Why a campaign is not reduced.
#[derive(Debug, Error)]
pub enum ReduceError {
    /// Shards are missing or damaged.
    #[error("{0}")]
    Incomplete(String),
    /// A file that does not belong here.
    #[error("{0}")]
    Foreign(String),
}

/// Reduces the campaign in a folder; `partial` takes what is there.
///
/// # Errors
/// Shards are missing and `partial` is not asked for, damaged, or of another plan; each is named with what to do.
pub fn reduce(plan: &Plan, hash: &[u8; 32], folder: &Path, partial: bool) -> Result<Campaign, ReduceError> {
    let (shards, missing) = gathered(plan, hash, folder, partial)?;
    let models = plan.models();
    let drives = shards.iter().map(|shard| shard.drive.len()).sum::<usize>() / plan.generators.len().max(1);
    let drawn_as = plan.drive().map_err(|error| ReduceError::Foreign(error.to_string()))?;
    let generators =
        models.iter().enumerate().map(|(g, model)| of_generator(plan, hash, &drawn_as, &shards, g, model)).collect();
    Ok(Campaign { drives, planned: plan.drives, missing, generators })
}

/// The sound shards, and which are missing.
fn gathered(plan: &Plan, hash: &[u8; 32], folder: &Path, partial: bool) -> Result<(Vec<Shard>, Vec<u32>), ReduceError> {
    let run = |shard: u32| format!("flexspline campaign run {} --shard {shard}", folder.display());
    let (mut shards, mut missing, mut damaged) = (Vec::new(), Vec::new(), Vec::new());
    for shard in 0..plan.shards {
        match look(plan, hash, folder, shard) {
            ShardState::Valid(rows) => shards.push(rows),
            ShardState::Missing => missing.push(shard),
            ShardState::Damaged(why) => {
                damaged.push(format!("{}: {why}; {}", path(folder, shard).display(), run(shard)))
            }
            ShardState::Foreign(what) => {
                return Err(ReduceError::Foreign(format!("{}: {what}; remove it", path(folder, shard).display())));
            }
        }
    }
    if let Some(stranger) = strangers(plan, folder).first() {
        return Err(ReduceError::Foreign(format!("{}: no shard of this plan; remove it", stranger.display())));
    }
    if !damaged.is_empty() {
        return Err(ReduceError::Incomplete(damaged.join("\n")));
    }
    if shards.is_empty() || (!partial && !missing.is_empty()) {
        let commands: Vec<String> = missing.iter().take(MOST_NAMED).map(|shard| run(*shard)).collect();
        let more = missing.len().saturating_sub(MOST_NAMED);
        let more =
            if more > 0 { format!("\nand {more} more; `--shard all` runs whatever is missing") } else { String::new() };
        return Err(ReduceError::Incomplete(format!(
            "{} of {} shards are missing{}:\n{}{more}",
            missing.len(),
            plan.shards,
            if shards.is_empty() { "" } else { " (--partial reduces what is there)" },
            commands.join("\n")
        )));
    }
    Ok((shards, missing))
}

/// Missing shards that are named.
const MOST_NAMED: usize = 20;

/// A row of a shard: the drive, and its columns.
type Row = (u32, Vec<f64>);

fn rows_of(shards: &[Shard], generator: usize) -> Vec<Row> {
    let row = |shard: &Shard, k: usize| {
        (shard.drive[k] as u32, shard.columns.iter().map(|column| column[k]).collect::<Vec<f64>>())
    };
    let mut rows: Vec<Row> = shards
        .iter()
        .flat_map(|shard| {
            let mine = (0..shard.drive.len()).filter(|k| shard.generator[*k] as usize == generator);
            mine.map(|k| row(shard, k)).collect::<Vec<Row>>()
        })
        .collect();
    rows.sort_by_key(|(drive, _)| *drive);
    rows
}

fn of_generator(
    plan: &Plan,
    hash: &[u8; 32],
    drawn_as: &Drive,
    shards: &[Shard],
    g: usize,
    model: &Model,
) -> OfGenerator {
    let rows = rows_of(shards, g);
    let names = column_names(plan);
    let column = |name: &str| -> Vec<f64> {
        let at = names.iter().position(|known| known == name).unwrap_or(0);
        rows.iter().map(|(_, row)| row[at]).collect()
    };
    let spread = |figure: &'static str| {
        let mut values = column(figure);
        values.sort_by(f64::total_cmp);
        let quantiles = SHARES.iter().map(|share| quantile(&values, *share)).collect();
        FigureSpread { figure, mean: mean(&values), std: std_dev(&values), quantiles }
    };
    let errors = column(FIGURES[0]);
    let teeth = plan.teeth();
    let at = |name: &str| FIGURES.iter().position(|known| *known == name).unwrap_or(0);
    let shared: Vec<usize> = SHARED.iter().map(|name| at(name)).collect();
    let evaluated = |drawn: &super::Drawn| {
        let all = model.figures(drawn);
        shared.iter().map(|k| all[*k]).collect::<Vec<f64>>()
    };
    let points = (plan.drives / BLOCKS as u32).clamp(SHARE_POINTS[0], SHARE_POINTS[1]);
    let points = 1 << points.ilog2();
    let all_shares = shares(&plan.tolerances, teeth, hash, points, &evaluated);
    let apart = column("axes_apart_um");
    let known = plan.generators[g].kernels.eccentric.sizes_um.last().copied().unwrap_or(0.0);
    let fem_pp = column("fem_places_pp_arcsec");
    let fem_rms = column("fem_places_rms_arcsec");
    let failed = rows.iter().zip(&fem_pp).filter(|((i, _), fem)| *i < plan.fem_drives && fem.is_nan()).count();
    let pp = column("places_pp_arcsec");
    let pairs = pp.iter().zip(&fem_pp).filter(|(_, fem)| fem.is_finite()).map(|(k, fem)| [*k, *fem]).collect();
    let compared = [("places_pp_arcsec", &pp, &fem_pp), ("places_rms_arcsec", &column("places_rms_arcsec"), &fem_rms)];
    let mut sorted = errors.clone();
    sorted.sort_by(f64::total_cmp);
    let middle = model.figures(&super::Drawn::middle(&plan.tolerances));
    OfGenerator {
        generator: plan.generators[g].kernels.generator,
        middle_error_pp_arcsec: middle[0],
        figures: FIGURES.iter().map(|figure| spread(figure)).collect(),
        exceeded: plan.exceed_arcsec.iter().map(|limit| exceeded(&errors, *limit)).collect(),
        shares: SHARED.iter().zip(all_shares).map(|(figure, shares)| FigureShares { figure, shares }).collect(),
        tighten: tighten(plan, hash, model, &rows),
        fem: comparison(&compared, &plan.exceed_arcsec),
        fem_failed: failed,
        beyond_kernels: apart.iter().filter(|size| **size > known).count(),
        play_closed: column(CLOSED).iter().filter(|share| **share > 0.0).count(),
        worst: worst(plan, hash, drawn_as, &rows, &errors),
        errors: sorted,
        pairs,
    }
}

/// Each tolerance halved, on the same draws of the first drives that are in.
fn tighten(plan: &Plan, hash: &[u8; 32], model: &Model, rows: &[Row]) -> Vec<Tightened> {
    let draw = Draw::of_plan(hash);
    let in_it: Vec<u32> = rows.iter().take(HALVED_DRIVES).map(|(drive, _)| *drive).collect();
    let columns = SHARED.map(|name| FIGURES.iter().position(|known| *known == name).unwrap_or(0));
    // By figure of `SHARED`, by drive.
    let figures = |tolerances: &[Tolerance]| -> Vec<Vec<f64>> {
        let all: Vec<Vec<f64>> = in_it
            .par_iter()
            .map(|i| model.figures(&drawn(tolerances, plan.teeth(), &draw.point(tolerances.len(), *i))))
            .collect();
        columns.iter().map(|column| all.iter().map(|of| of[*column]).collect()).collect()
    };
    let before = figures(&plan.tolerances);
    let after: Vec<Vec<Vec<f64>>> = (0..plan.tolerances.len())
        .map(|t| {
            let mut halved = plan.tolerances.clone();
            halved[t].distribution = halved[t].distribution.halved();
            figures(&halved)
        })
        .collect();
    let of_figure = |(f, figure): (usize, &&'static str)| {
        let mut ranked: Vec<Tightened> = plan
            .tolerances
            .iter()
            .zip(&after)
            .map(|(tolerance, after)| tightened(figure, &tolerance.name, [&before[f], &after[f]], &plan.exceed_arcsec))
            .collect();
        ranked.sort_by(|a, b| b.gain_arcsec.value.total_cmp(&a.gain_arcsec.value));
        ranked
    };
    SHARED.iter().enumerate().flat_map(of_figure).collect()
}

/// A figure of the same drives before and after.
fn tightened(figure: &'static str, tolerance: &str, [before, after]: [&Vec<f64>; 2], limits: &[f64]) -> Tightened {
    let [was, is] = [before, after].map(|all| {
        let mut sorted = all.clone();
        sorted.sort_by(f64::total_cmp);
        quantile(&sorted, JUDGED).value
    });
    let blocks = BLOCKS.min(before.len());
    let gains: Vec<f64> = (0..blocks).map(|b| judged(before, b) - judged(after, b)).collect();
    let mut gain_arcsec = of_replicates(&gains);
    let shift = was - is - gain_arcsec.value;
    gain_arcsec = Interval { value: was - is, low: gain_arcsec.low + shift, high: gain_arcsec.high + shift };
    // Limits are those of the error.
    let limits = if figure == FIGURES[0] { limits } else { &[] };
    let share = |of: &[f64], limit: f64| exceeded(of, limit).of.value;
    Tightened {
        figure,
        tolerance: tolerance.to_owned(),
        drives: before.len(),
        before_arcsec: was,
        after_arcsec: is,
        gain_arcsec,
        above: limits.iter().map(|x| [*x, share(before, *x), share(after, *x)]).collect(),
    }
}

/// The quantile of one block of every [`BLOCKS`]-th drive.
fn judged(errors: &[f64], block: usize) -> f64 {
    let mut mine: Vec<f64> = errors.iter().copied().skip(block).step_by(BLOCKS).collect();
    mine.sort_by(f64::total_cmp);
    quantile(&mine, JUDGED).value
}

/// Kernels and FEM on the same drives; `of` are figures by kernels of all drives and by FEM of some.
pub(super) fn comparison(of: &[(&'static str, &Vec<f64>, &Vec<f64>)], limits: &[f64]) -> Option<FemComparison> {
    let pairs = |kernels: &[f64], fem: &[f64]| -> (Vec<f64>, Vec<f64>) {
        kernels.iter().zip(fem).filter(|(_, fem)| fem.is_finite()).map(|(k, f)| (*k, *f)).unzip()
    };
    let (_, kernels, fem) = of.first()?;
    let (some, by_fem) = pairs(kernels, fem);
    if by_fem.is_empty() {
        return None;
    }
    let largest_difference_arcsec = some.iter().zip(&by_fem).map(|(k, f)| (k - f).abs()).fold(0.0, f64::max);
    let told = |figures, tails| {
        Some(FemComparison {
            drives: by_fem.len(),
            drives_needed: LEAST_FEM,
            largest_difference_arcsec,
            figures,
            tails,
        })
    };
    if by_fem.len() < LEAST_FEM {
        return told(Vec::new(), Vec::new());
    }
    let figures = of
        .iter()
        .map(|(figure, kernels, fem)| {
            let (some, by_fem) = pairs(kernels, fem);
            let (slope, controlled) = controlled(kernels, &some, &by_fem);
            let off: Vec<f64> = some.iter().zip(&by_fem).map(|(kernels, fem)| kernels - fem).collect();
            Controlled {
                figure,
                off_mean_arcsec: mean(&off),
                off_rms_arcsec: (off.iter().map(|x| x * x).sum::<f64>() / off.len() as f64).sqrt(),
                off_most_arcsec: off.iter().fold(0.0, |most, x| x.abs().max(most)),
                correlation: correlation(&some, &by_fem).unwrap_or(0.0),
                slope,
                kernels_mean: mean(kernels),
                plain: with_half(mean(&by_fem), half_width(std_dev(&by_fem), by_fem.len())),
                controlled,
            }
        })
        .collect();
    let mut limits = limits.to_vec();
    let mut sorted = by_fem.clone();
    sorted.sort_by(f64::total_cmp);
    limits.push(quantile(&sorted, 0.5).value);
    let tails = limits.iter().map(|limit| tail(*limit, kernels, &some, &by_fem)).collect();
    told(figures, tails)
}

/// Half of a 95 % interval of a mean.
fn half_width(std: f64, count: usize) -> f64 {
    1.96 * std / (count as f64).sqrt()
}

fn with_half(value: f64, half: f64) -> Interval {
    Interval { value, low: value - half, high: value + half }
}

/// Slope of FEM over kernels, and the mean by FEM with the mean of all kernels in place of that of some.
fn controlled(all: &[f64], some: &[f64], by_fem: &[f64]) -> (f64, Interval) {
    let (ms, mf) = (mean(some), mean(by_fem));
    let square: f64 = some.iter().map(|x| (x - ms) * (x - ms)).sum();
    let product: f64 = some.iter().zip(by_fem).map(|(x, y)| (x - ms) * (y - mf)).sum();
    let slope = if square > 0.0 { product / square } else { 0.0 };
    let rest: Vec<f64> = some.iter().zip(by_fem).map(|(x, y)| y - slope * x).collect();
    let value = mf + slope * (mean(all) - ms);
    let half = half_width(std_dev(&rest), rest.len()).hypot(slope * half_width(std_dev(all), all.len()));
    (slope, with_half(value, half))
}

fn tail(limit: f64, all: &[f64], some: &[f64], by_fem: &[f64]) -> Tail {
    let above = |values: &[f64]| -> Vec<f64> { values.iter().map(|x| f64::from(u8::from(*x > limit))).collect() };
    let (all, some, by_fem) = (above(all), above(some), above(by_fem));
    let count = |values: &[f64]| values.iter().filter(|x| **x > 0.0).count();
    let fewest = [&some, &by_fem].into_iter().map(|v| count(v).min(v.len() - count(v))).min().unwrap_or(0);
    let correlation = correlation(&some, &by_fem);
    let refused = if fewest < LEAST_ABOVE {
        Some(format!("{fewest} of {} drives on one side of the limit, {LEAST_ABOVE} are needed", some.len()))
    } else if correlation.is_none_or(|r| r < LEAST_CORRELATION) {
        Some(format!("kernels and FEM agree too little on which drives are above: {LEAST_CORRELATION} is needed"))
    } else {
        None
    };
    let controlled = refused.is_none().then(|| {
        let of = controlled(&all, &some, &by_fem).1;
        Interval { value: of.value.clamp(0.0, 1.0), low: of.low.clamp(0.0, 1.0), high: of.high.clamp(0.0, 1.0) }
    });
    Tail { above_arcsec: limit, kernels: mean(&all), correlation, controlled, refused }
}

/// The drives with the largest error, the largest first.
fn worst(plan: &Plan, hash: &[u8; 32], drawn_as: &Drive, rows: &[Row], errors: &[f64]) -> Vec<WorstDrive> {
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_by(|a, b| errors[*b].total_cmp(&errors[*a]).then(a.cmp(b)));
    let draw = Draw::of_plan(hash);
    order
        .iter()
        .take(WORST)
        .enumerate()
        .filter_map(|(rank, k)| {
            let drive = rows[*k].0;
            let drawn = draw.drive(&plan.tolerances, plan.teeth(), drive);
            let mut built = drawn.drive(drawn_as, &plan.tolerances).ok()?;
            built.name = format!("{} {drive}", drawn_as.name);
            Some(WorstDrive {
                drive,
                error_pp_arcsec: errors[*k],
                file: format!("{:02}-drive-{drive:05}.toml", rank + 1),
                values: drawn.values,
                toml: built.to_toml(),
            })
        })
        .collect()
}

/// Files of the worst drives, below the folder.
pub fn worst_path(folder: &Path, generator: GeneratorKind, worst: &WorstDrive) -> PathBuf {
    folder.join("worst").join(generator.to_string()).join(&worst.file)
}
