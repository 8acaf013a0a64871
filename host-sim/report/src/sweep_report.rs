//! The page of a sweep: the answer, one picture, the Pareto front, which input matters, scatter.

use serde_json::{Map, json};

use super::page::{
    ChartAxis, ChartSeries, Choice, Detail, Figure, FigureBody, Headline, Limit, Lines, Mark, Page, PageBlock,
    PageQuantity, PageSection, PageTable, RichText, Status, significant,
};
use flexspline_design::sweep::{Judge, OfGenerator, ReducedSweep, Sense, VariantPlan, VariantRow};

/// Rows of the table of the Pareto front.
const MOST_ROWS: usize = 25;
/// Points of the curve of a distribution.
const CURVE: usize = 200;
/// Share of the drives whose error is the headline of drives drawn from tolerances.
const JUDGED: f64 = 0.95;
/// Quantiles of the table of scatter.
const SHOWN: [f64; 4] = [0.05, 0.5, JUDGED, 0.99];
/// The error of drives drawn from tolerances.
const ERROR: &str = "error_pp_arcsec";

/// The contents of the page.
pub struct SweepSources<'a> {
    /// The plan.
    pub plan: &'a VariantPlan,
    /// The command line.
    pub command: &'a str,
    /// Constraints and targets.
    pub judge: &'a Judge,
    /// The results.
    pub sweep: &'a ReducedSweep,
    /// Remarks on the results.
    pub remarks: &'a [String],
}

/// The page.
pub fn page(of: &SweepSources<'_>) -> Page {
    let SweepSources { plan, sweep, .. } = of;
    let mut results = Map::new();
    results.insert("sweep".to_owned(), json!(sweep));
    let mut sections = vec![picture(of)];
    sections.extend(front(of));
    sections.extend(
        [
            ("matters", "What matters", Detail::Summary, tables(of, ranks)),
            ("figures", "Figure by figure", Detail::Engineering, tables(of, figures)),
        ]
        .into_iter()
        .filter(|(.., blocks)| !blocks.is_empty())
        .map(|(id, title, detail, blocks)| PageSection {
            id: id.to_owned(),
            title: title.to_owned(),
            detail,
            blocks,
        }),
    );
    sections.push(PageSection::reading(vec![PageBlock::paragraph(READING)]));
    let choice = |one: &OfGenerator| Choice { id: one.generator.to_string(), name: one.generator.to_string() };
    Page {
        title: format!("Sweep of {}", sweep.drive),
        command_name: "sweep",
        status: if of.remarks.is_empty() { Status::Good } else { Status::Remark },
        also: Vec::new(),
        remarks: of.remarks.iter().map(|remark| format!("{remark}.")).collect(),
        choices: sweep.generators.iter().map(choice).collect(),
        choice_is: "Generator",
        headlines: sweep.generators.iter().map(|one| headline(of, one)).collect(),
        sections,
        animations: Vec::new(),
        provenance: vec![
            ("command".to_owned(), of.command.to_owned()),
            ("plan".to_owned(), plan.hash.clone()),
            ("drive_hash".to_owned(), blake3::Hash::from_bytes(plan.drive.hash()).to_hex().to_string()),
        ],
        results,
    }
}

const READING: &str = "A data sheet is computed by contact FEM: the drive is loaded from first contact with its \
    generator held, and then turned by a tooth pitch under the largest load. K1 is the secant of its torsion up to \
    T1, K2 from T1 to T2, K3 above. A drive drawn from tolerances is computed by influence kernels of the drive as \
    drawn over a turn of the output: linear in the errors of single teeth, interpolated in the distance of the axes, \
    a parabola in every other dimension, each as if the others were as drawn, without friction. A rank correlation \
    (Spearman) of 1 or −1 says that the figure follows this input alone. Intervals hold with 95 %. Figures and \
    fields have the names of the columns of sweep.csv, which end in their unit.";

/// Quantity of a figure on the page, by the unit in its name.
fn quantity(name: &str) -> PageQuantity {
    if name.ends_with("_arcsec") { PageQuantity::Error } else { PageQuantity::Count }
}

fn value(name: &str, value: Option<f64>) -> RichText {
    match value {
        None => RichText::new("–"),
        Some(value) if quantity(name) == PageQuantity::Error => RichText::default().error(value, 3),
        Some(value) => RichText::new(significant(value, 3)),
    }
}

/// A quantile of a figure.
fn quantile(one: &OfGenerator, figure: &str, share: f64) -> Option<f64> {
    let spread = one.figures.iter().find(|spread| spread.figure == figure)?;
    spread.quantiles.iter().find(|quantile| quantile.share == share).map(|quantile| quantile.value)
}

/// Rows of a generator, whether they meet, and whether they are Pareto-optimal.
fn rows<'a>(of: &'a SweepSources<'_>, one: &OfGenerator) -> impl Iterator<Item = &'a (VariantRow, bool, bool)> {
    let kind = one.generator;
    of.sweep.rows.iter().filter(move |(row, ..)| row.generator == kind)
}

fn headline(of: &SweepSources<'_>, one: &OfGenerator) -> Headline {
    let choice = Some(one.generator.to_string());
    if of.plan.is_of_tolerances() {
        let number = quantile(one, ERROR, JUDGED).unwrap_or(f64::NAN);
        let first = one.ranks.iter().find(|rank| rank.figure == ERROR);
        let answer = first.map_or_else(RichText::default, |first| {
            let by = significant(first.correlation, 2);
            RichText::new(format!("Tighten {} first: the error follows it most (rank correlation {by}). ", first.input))
        });
        let drives = rows(of, one).count();
        return Headline {
            choice,
            answer: answer.plain(format!("Of {drives} drives 95 % stay below ")).error(number, 3).plain("."),
            number: RichText::default().error(number, 3),
            number_is: "error peak to peak that 95 % of the drives stay below".to_owned(),
        };
    }
    let count = rows(of, one).count();
    let meet = rows(of, one).filter(|(_, meets, _)| *meets).count();
    let target = of.judge.targets.first().map_or("", |(name, _)| name.as_str());
    let best = rows(of, one).find(|(row, ..)| Some(&(row.variant + 1)) == one.front.first());
    let best = best.and_then(|(row, ..)| Some(row.figures[of.plan.figure(target)?]));
    let optimal = match one.front.len() {
        0 => String::new(),
        count => format!("; {count} of them are Pareto-optimal"),
    };
    Headline {
        choice,
        answer: RichText::new(format!("{meet} of {count} variants meet the constraints{optimal}.")),
        number: value(target, best),
        number_is: format!("{target}, of the best"),
    }
}

/// A table for each generator; none without rows.
fn tables(of: &SweepSources<'_>, make: impl Fn(&OfGenerator) -> PageTable) -> Vec<PageBlock> {
    let table = |one: &OfGenerator| (Some(one.generator.to_string()), make(one));
    let all = of.sweep.generators.iter().map(table).filter(|(_, table)| !table.rows.is_empty());
    all.map(|(choice, table)| PageBlock::Table { choice, table }).collect()
}

fn words(list: &[&str]) -> Vec<String> {
    list.iter().map(|word| (*word).to_owned()).collect()
}

/// Variants by two targets; drives drawn from tolerances by how many stay below an error.
fn picture(of: &SweepSources<'_>) -> PageSection {
    let figure = if of.plan.is_of_tolerances() { distribution(of) } else { trade(of) };
    let (id, title) = (figure.id.clone(), figure.title.clone());
    PageSection { id, title, detail: Detail::Summary, blocks: vec![PageBlock::Figure(figure)] }
}

fn trade(of: &SweepSources<'_>) -> Figure {
    let target = |k: usize, other: &'static str| of.judge.targets.get(k).map_or(other, |(name, _)| name.as_str());
    let first = target(0, "kinematic_error_pp_arcsec");
    let second = target(1, if first == "k2_n_m_per_rad" { "kinematic_error_pp_arcsec" } else { "k2_n_m_per_rad" });
    let (x, y) = (of.plan.figure(first).unwrap_or_default(), of.plan.figure(second).unwrap_or_default());
    let chart = |one: &OfGenerator| {
        let series = |name: &str, colour: usize, mark: Mark, which: &dyn Fn(bool, bool) -> bool| {
            let chosen = rows(of, one).filter(|(_, meets, front)| which(*meets, *front));
            let points = chosen.map(|(row, ..)| [row.figures[x], row.figures[y]]);
            let mut points: Vec<[f64; 2]> = points.filter(|[x, y]| x.is_finite() && y.is_finite()).collect();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            ChartSeries { name: name.to_owned(), mark, colour, points }
        };
        let series = vec![
            series("does not meet", 5, Mark::Dots, &|meets, _| !meets),
            series("meets", 0, Mark::Points, &|meets, front| meets && !front),
            series("Pareto-optimal", 1, Mark::Points, &|_, front| front),
        ];
        (one.generator.to_string(), Lines { series, ..Lines::default() })
    };
    let axis = |name: &str| ChartAxis::new(name, quantity(name));
    Figure {
        id: "trade".to_owned(),
        title: format!("{second} against {first}"),
        caption: RichText::new("Each point is a variant."),
        alt: "Every variant by two of its figures; the Pareto-optimal ones stand out".to_owned(),
        body: FigureBody::Lines {
            x: axis(first),
            y: axis(second),
            charts: of.sweep.generators.iter().map(chart).collect(),
        },
    }
}

fn distribution(of: &SweepSources<'_>) -> Figure {
    let error = of.plan.figure(ERROR).unwrap_or_default();
    let chart = |one: &OfGenerator| {
        let mut errors: Vec<f64> = rows(of, one).map(|(row, ..)| row.figures[error]).collect();
        errors.retain(|error| error.is_finite());
        errors.sort_by(f64::total_cmp);
        let n = errors.len();
        let ranks = (0..CURVE.min(n)).map(|k| k * (n - 1) / (CURVE.min(n) - 1).max(1));
        let points = ranks.map(|rank| [errors[rank], 100.0 * (rank + 1) as f64 / n as f64]).collect();
        let series = vec![ChartSeries { name: "drives below".to_owned(), mark: Mark::Line, colour: 0, points }];
        let limits = vec![Limit { name: "95 %".to_owned(), y: 100.0 * JUDGED }];
        (one.generator.to_string(), Lines { series, limits, ..Lines::default() })
    };
    Figure {
        id: "distribution".to_owned(),
        title: "Drives that stay below an error".to_owned(),
        caption: RichText::new("Error under the load, peak to peak over a turn of the output."),
        alt: "Share of the drives over the error that they stay below".to_owned(),
        body: FigureBody::Lines {
            x: ChartAxis::new("error, peak to peak", PageQuantity::Error),
            y: ChartAxis::new("drives below, %", PageQuantity::Count),
            charts: of.sweep.generators.iter().map(chart).collect(),
        },
    }
}

/// The Pareto front, the targets first.
fn front(of: &SweepSources<'_>) -> Option<PageSection> {
    let names = of.plan.figures();
    let decides = |name: &&str| of.judge.targets.iter().any(|(target, _)| target == name);
    let (first, others): (Vec<&str>, Vec<&str>) = names.iter().copied().partition(decides);
    let fields: Vec<&str> = of.plan.columns.iter().map(String::as_str).collect();
    let header = [words(&["Variant"]), words(&first), words(&fields), words(&others)].concat();
    let better = of
        .judge
        .targets
        .iter()
        .map(|(name, sense)| format!("{} {name}", if *sense == Sense::Least { "least" } else { "most" }));
    let better = better.collect::<Vec<_>>().join(", ");
    let blocks = tables(of, |one| {
        let rows = one.front.iter().take(MOST_ROWS).filter_map(|number| {
            let (row, ..) = rows(of, one).find(|(row, ..)| row.variant + 1 == *number)?;
            let cells = |names: &[&str]| -> Vec<RichText> {
                names.iter().map(|name| value(name, of.plan.figure(name).map(|k| row.figures[k]))).collect()
            };
            let values = of.plan.variants[row.variant].iter().cloned().map(RichText::new).collect();
            Some([vec![RichText::new(number.to_string())], cells(&first), values, cells(&others)].concat())
        });
        let caption = format!("Variants that no other beats in all of: {better}. All variants are in sweep.csv");
        PageTable { caption, header: header.clone(), rows: rows.collect() }
    });
    let (id, title) = ("best".to_owned(), "The Pareto front".to_owned());
    (!blocks.is_empty()).then_some(PageSection { id, title, detail: Detail::Summary, blocks })
}

/// Rank correlations, an input to a column.
fn ranks(one: &OfGenerator) -> PageTable {
    let mut inputs: Vec<&str> = Vec::new();
    for rank in &one.ranks {
        if !inputs.contains(&rank.input.as_str()) {
            inputs.push(&rank.input);
        }
    }
    let row = |figure: &'static str| {
        let of = |input: &&str| one.ranks.iter().find(|rank| rank.figure == figure && rank.input == **input);
        let cell = |input| RichText::new(of(input).map_or("–".to_owned(), |rank| significant(rank.correlation, 2)));
        let cells: Vec<RichText> = inputs.iter().map(cell).collect();
        [vec![RichText::new(figure)], cells].concat()
    };
    let has = |figure: &&str| one.ranks.iter().any(|rank| rank.figure == *figure);
    PageTable {
        caption: "Rank correlation of each figure with each input".to_owned(),
        header: [words(&["Figure"]), words(&inputs)].concat(),
        rows: one.figures.iter().map(|spread| spread.figure).filter(has).map(row).collect(),
    }
}

fn figures(one: &OfGenerator) -> PageTable {
    let rows = one.figures.iter().map(|spread| {
        let shown = SHOWN.map(|share| quantile(one, spread.figure, share));
        let judged = spread.quantiles.iter().find(|quantile| quantile.share == JUDGED);
        let ends = [judged.and_then(|q| q.low), judged.and_then(|q| q.high)];
        let cells = [Some(spread.mean), Some(spread.std)].into_iter().chain(shown).chain(ends);
        [RichText::new(spread.figure)].into_iter().chain(cells.map(|x| value(spread.figure, x))).collect()
    });
    PageTable {
        caption: "Figures of the variants that converged; the interval is that of the 95 % value".to_owned(),
        header: words(&["Figure", "mean", "std", "5 %", "50 %", "95 %", "99 %", "from", "to"]),
        rows: rows.collect(),
    }
}
