//! From results to answers: what meets the constraints, the Pareto front, scatter, and which input matters.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use super::judge::Judge;
use super::model::CLOSED;
use super::plan::{PlanError, VariantPlan, csv_of};
use super::run::{RunStatus, VariantRow, results_in};
use flexspline_base::statistics::{Quantile, correlation, mean, quantile, std_dev};
use flexspline_mechanics::drive::GeneratorKind;

/// Shares of the variants whose quantiles are reported.
const SHARES: [f64; 6] = [0.01, 0.05, 0.5, 0.9, 0.95, 0.99];
/// Variants without results that are named.
const MOST_NAMED: usize = 5;

/// A sweep, reduced: `sweep.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReducedSweep {
    /// Version of this form.
    pub schema_version: u32,
    /// Version of the program.
    pub tool_version: &'static str,
    /// Hash of the plan.
    pub plan: String,
    /// The drive.
    pub drive: String,
    /// Variants of the plan.
    pub variants: usize,
    /// Runs without results; a run is a variant with a generator.
    pub missing: usize,
    /// Runs by how they ended.
    pub converged: usize,
    /// No equilibrium from some load on.
    pub failed: usize,
    /// Values that make no drive.
    pub refused: usize,
    /// Runs that meet every constraint.
    pub meet: usize,
    /// By generator.
    pub generators: Vec<OfGenerator>,
    /// Every row.
    #[serde(skip)]
    pub rows: Vec<VariantRow>,
}

/// Results with one generator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OfGenerator {
    /// The generator.
    pub generator: GeneratorKind,
    /// The Pareto front, best in the first target first: numbers of variants, from 1.
    pub front: Vec<usize>,
    /// Scatter of the figures over the variants that converged.
    pub figures: Vec<FigureSpread>,
    /// Rank correlations of inputs and figures, the strongest of each figure first.
    pub ranks: Vec<RankCorrelation>,
    /// Drives whose axes are further apart than the kernels reach: their errors are extrapolated.
    pub beyond_kernels: usize,
    /// Drives without play at some place: lost motion there is the wind-up alone.
    pub play_closed: usize,
}

/// Scatter of a figure.
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

/// Spearman's rank correlation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RankCorrelation {
    /// The figure.
    pub figure: &'static str,
    /// The field; of a harmonic with its order.
    pub input: String,
    /// −1 to 1.
    pub correlation: f64,
}

/// Reduces the results in the folder of a sweep; `partial` accepts missing ones.
///
/// # Errors
/// Results are missing or damaged, or of another plan: the file, and the command that computes them.
pub fn reduce(plan: &VariantPlan, folder: &Path, judge: &Judge, partial: bool) -> Result<ReducedSweep, PlanError> {
    let (mut rows, missing) = gathered(plan, folder, partial)?;
    judge.mark(plan, &mut rows);
    let inputs = inputs(plan);
    let generators = plan.generators.iter().map(|kind| of_generator(plan, *kind, judge, &rows, &inputs)).collect();
    let ended = |status| rows.iter().filter(|row| row.status == status).count();
    Ok(ReducedSweep {
        schema_version: 1,
        tool_version: env!("CARGO_PKG_VERSION"),
        plan: plan.hash.clone(),
        drive: plan.drive.name.clone(),
        variants: plan.variants.len(),
        missing,
        converged: ended(RunStatus::Converged),
        failed: ended(RunStatus::Failed),
        refused: ended(RunStatus::Refused),
        meet: rows.iter().filter(|row| row.meets).count(),
        generators,
        rows,
    })
}

/// Rows of all files of results, by variant, then by generator, and how many are missing.
fn gathered(plan: &VariantPlan, folder: &Path, partial: bool) -> Result<(Vec<VariantRow>, usize), PlanError> {
    let results = folder.join("results");
    let found = results_in(plan, folder)?;
    let all = (0..plan.variants.len()).flat_map(|k| (0..plan.generators.len()).map(move |g| (k, g)));
    let missing: Vec<usize> = all.filter(|of| !found.contains_key(of)).map(|(k, _)| k + 1).collect();
    if found.is_empty() || (!partial && !missing.is_empty()) {
        let named: Vec<String> = missing.iter().take(MOST_NAMED).map(ToString::to_string).collect();
        return Err(PlanError::Failed(format!(
            "{}: {} of {} runs are missing, of the variants {}{}; `flexspline sweep run {}` computes them{}",
            results.display(),
            missing.len(),
            plan.variants.len() * plan.generators.len(),
            named.join(", "),
            if missing.len() > named.len() { " and more" } else { "" },
            folder.display(),
            if found.is_empty() { "" } else { ", --partial reduces what is there" },
        )));
    }
    Ok((found.into_values().collect(), missing.len()))
}

fn of_generator(
    plan: &VariantPlan,
    generator: GeneratorKind,
    judge: &Judge,
    rows: &[VariantRow],
    inputs: &[(String, Vec<f64>)],
) -> OfGenerator {
    let sound = rows.iter().filter(|row| row.generator == generator && row.status == RunStatus::Converged);
    let sound: Vec<&VariantRow> = sound.collect();
    let column = |k: usize| sound.iter().map(move |row| row.figures[k]);
    let (mut figures, mut ranks) = (Vec::new(), Vec::new());
    for (k, figure) in plan.figures().into_iter().enumerate() {
        let mut sorted: Vec<f64> = column(k).filter(|x| x.is_finite()).collect();
        if sorted.is_empty() {
            continue;
        }
        sorted.sort_by(f64::total_cmp);
        let quantiles = SHARES.iter().map(|share| quantile(&sorted, *share)).collect();
        figures.push(FigureSpread { figure, mean: mean(&sorted), std: std_dev(&sorted), quantiles });
        let of_input = |(input, of): &(String, Vec<f64>)| {
            let pairs = sound.iter().map(|row| of[row.variant]).zip(column(k));
            Some(RankCorrelation { figure, input: input.clone(), correlation: rank_correlation(pairs)? })
        };
        let mut of_figure: Vec<RankCorrelation> = inputs.iter().filter_map(of_input).collect();
        of_figure.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
        ranks.extend(of_figure);
    }
    let above =
        |name: &str, limit: f64| plan.figure(name).map_or(0, |k| column(k).filter(|value| *value > limit).count());
    OfGenerator {
        generator,
        front: judge.front(plan, sound.iter().copied()).iter().map(|row| row.variant + 1).collect(),
        figures,
        ranks,
        beyond_kernels: above("axes_apart_um", plan.reach_um()),
        play_closed: above(CLOSED, 0.0),
    }
}

/// Spearman's rank correlation of the pairs of numbers; none where one of both is the same in all pairs.
fn rank_correlation(pairs: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let (a, b): (Vec<f64>, Vec<f64>) = pairs.filter(|(a, b)| a.is_finite() && b.is_finite()).unzip();
    correlation(&ranks(&a), &ranks(&b))
}

/// Ranks of numbers; equal numbers share the mean of their ranks.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut place = 0;
    for equal in order.chunk_by(|a, b| values[*a] == values[*b]) {
        let middle = place as f64 + 0.5 * (equal.len() - 1) as f64;
        equal.iter().for_each(|k| ranks[*k] = middle);
        place += equal.len();
    }
    ranks
}

/// Numbers that vary from variant to variant, by name: of a list of errors their root mean square, of harmonics the
/// amplitude of each order. Directions, phases and words are none.
fn inputs(plan: &VariantPlan) -> Vec<(String, Vec<f64>)> {
    let is_angle = |column: &String| column.ends_with("_phase_deg") || column.ends_with("_direction_deg");
    let mut found: BTreeMap<(usize, Option<i64>), Vec<f64>> = BTreeMap::new();
    for (k, _) in plan.columns.iter().enumerate().filter(|(_, column)| !is_angle(column)) {
        for (variant, values) in plan.variants.iter().enumerate() {
            for (order, value) in numbers(&values[k]) {
                found.entry((k, order)).or_insert_with(|| vec![f64::NAN; plan.variants.len()])[variant] = value;
            }
        }
    }
    let name = |(k, order): (usize, Option<i64>)| {
        plan.columns[k].clone() + &order.map_or_else(String::new, |order| format!(", order {order}"))
    };
    found.into_iter().map(|(of, values)| (name(of), values)).collect()
}

/// Numbers of a cell of `plan.csv`, each with its order if it is a harmonic.
fn numbers(cell: &str) -> Vec<(Option<i64>, f64)> {
    if let Ok(number) = cell.parse() {
        return vec![(None, number)];
    }
    let table = format!("cell = {cell}").parse::<toml::Table>();
    let Some(list) = table.ok().and_then(|table| table.get("cell")?.as_array().cloned()) else { return Vec::new() };
    let number = |value: &toml::Value| value.as_float().or_else(|| Some(value.as_integer()? as f64));
    let harmonic = |value: &toml::Value| Some((value.get("order")?.as_integer(), number(value.get("amplitude_um")?)?));
    let squares: Vec<f64> = list.iter().filter_map(number).map(|x| x * x).collect();
    let rms = (!squares.is_empty()).then(|| (None, mean(&squares).sqrt()));
    list.iter().filter_map(harmonic).chain(rms).collect()
}

impl ReducedSweep {
    /// `sweep.csv`: every run with the numbers and words that its variant sets, its figures and marks.
    ///
    /// # Errors
    /// None but of memory.
    pub fn csv(&self, plan: &VariantPlan) -> Result<Vec<u8>, PlanError> {
        let is_short = |k: &usize| plan.variants.iter().all(|values| !values[*k].starts_with('['));
        let fields: Vec<usize> = (0..plan.columns.len()).filter(is_short).collect();
        let columns = fields.iter().map(|k| plan.columns[*k].as_str());
        let end = ["status", "meets", "front", "why", "cautions"];
        let header = ["variant", "generator"].into_iter().chain(columns).chain(plan.figures()).chain(end);
        let line = |row: &VariantRow| {
            let head = [(row.variant + 1).to_string(), row.generator.to_string()];
            let values: Vec<String> = fields.iter().map(|k| plan.variants[row.variant][*k].clone()).collect();
            let marks = [row.status.name().to_owned(), row.meets.to_string(), row.is_front.to_string()];
            [&head[..], &values, &row.cells(), &marks, &[row.why.clone(), row.cautions.clone()]].concat()
        };
        csv_of([header.map(str::to_owned).collect()].into_iter().chain(self.rows.iter().map(line)))
    }
}
