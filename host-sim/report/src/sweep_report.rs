//! The page of a sweep: the answer, one picture, the Pareto front, which input matters, scatter.

use serde_json::{Map, json};

use super::page::{
    ChartAxis, ChartSeries, Choice, Detail, Headline, Lines, Mark, Page, PageBlock, PageQuantity, PageSection,
    PageTable, RichText, Status, significant,
};
use flexspline_design::sweep::{
    FigureSpread, Judge, OfGenerator, RankCorrelation, ReducedSweep, Sense, VariantPlan, VariantRow,
};

/// Rows of the table of the Pareto front.
const MOST_ROWS: usize = 25;
/// Least rank correlation of the table: a guess at what matters.
const LEAST_RANK: f64 = 0.1;
/// Points of one kind in the picture, at most.
const MOST_POINTS: usize = 5000;
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
    let tables = [
        ("best", "The Pareto front", Detail::Summary, tables(of, |one| front(of, one))),
        ("matters", "What matters", Detail::Summary, tables(of, ranks)),
        ("figures", "Figure by figure", Detail::Engineering, tables(of, figures)),
    ];
    let mut sections = vec![trade(of)];
    for (id, title, detail, blocks) in tables {
        if !blocks.is_empty() {
            sections.push(PageSection::new(id, title, detail, blocks));
        }
    }
    sections.push(PageSection::reading(vec![PageBlock::paragraph(READING)]));
    let choice = |one: &OfGenerator| Choice { id: one.generator.to_string(), name: one.generator.to_string() };
    Page {
        title: format!("Sweep of {}", sweep.drive),
        command_name: "sweep",
        status: if of.remarks.is_empty() { Status::Good } else { Status::Remark },
        remarks: of.remarks.iter().map(|remark| format!("{remark}.")).collect(),
        choices: sweep.generators.iter().map(choice).collect(),
        choice_is: "Generator",
        headlines: sweep.generators.iter().map(|one| headline(of, one)).collect(),
        sections,
        provenance: vec![
            ("command".to_owned(), of.command.to_owned()),
            ("plan".to_owned(), plan.hash.clone()),
            ("drive_hash".to_owned(), blake3::Hash::from_bytes(plan.drive.hash()).to_hex().to_string()),
        ],
        results: Map::from_iter([("sweep".to_owned(), json!(sweep))]),
        ..Page::default()
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

/// A figure to three digits, in the unit of its name.
fn value(name: &str, value: f64) -> RichText {
    if quantity(name) == PageQuantity::Error && value.is_finite() {
        RichText::arcsec(value, 3)
    } else {
        significant(value, 3).into()
    }
}

/// Rows of a generator.
fn rows<'a>(of: &'a SweepSources<'_>, one: &OfGenerator) -> impl Iterator<Item = &'a VariantRow> {
    let kind = one.generator;
    of.sweep.rows.iter().filter(move |row| row.generator == kind)
}

fn headline(of: &SweepSources<'_>, one: &OfGenerator) -> Headline {
    let choice = Some(one.generator.to_string());
    let count = rows(of, one).count();
    if of.plan.is_of_tolerances() {
        let spread = one.figures.iter().find(|spread| spread.figure == ERROR);
        let number = spread.map_or(f64::NAN, |spread| at(spread, JUDGED));
        let first = one.ranks.iter().find(|rank| rank.figure == ERROR).map_or_else(String::new, |first| {
            let by = significant(first.correlation, 2);
            format!("Tighten {} first: the error follows it most (rank correlation {by}). ", first.input)
        });
        let answer = RichText::new(format!("{first}Of {count} drives 95 % stay below ")).error(number, 3).plain(".");
        let number_is = "error peak to peak that 95 % of the drives stay below".to_owned();
        return Headline { choice, answer, number: RichText::arcsec(number, 3), number_is };
    }
    let meet = rows(of, one).filter(|row| row.meets).count();
    let optimal = match one.front.len() {
        0 => String::new(),
        count => format!("; {count} of them are Pareto-optimal"),
    };
    let target = of.judge.targets.first().map_or("", |(name, _)| name.as_str());
    let best = rows(of, one).find(|row| Some(&(row.variant + 1)) == one.front.first());
    let best = best.and_then(|row| Some(row.figures[of.plan.figure(target)?]));
    Headline {
        choice,
        answer: RichText::new(format!("{meet} of {count} variants meet the constraints{optimal}.")),
        number: value(target, best.unwrap_or(f64::NAN)),
        number_is: format!("{target}, of the best"),
    }
}

/// A table for each generator; none without rows.
fn tables(of: &SweepSources<'_>, make: impl Fn(&OfGenerator) -> PageTable) -> Vec<PageBlock> {
    let table = |one: &OfGenerator| (Some(one.generator.to_string()), make(one));
    let all = of.sweep.generators.iter().map(table).filter(|(_, table)| !table.rows.is_empty());
    all.map(|(choice, table)| PageBlock::Table { choice, table }).collect()
}

/// Variants by two figures: by two targets, drives drawn from tolerances by their error and their lost motion.
fn trade(of: &SweepSources<'_>) -> PageSection {
    let usual = if of.plan.is_of_tolerances() {
        [ERROR, "lost_motion_arcsec"]
    } else {
        ["kinematic_error_pp_arcsec", "k2_n_m_per_rad"]
    };
    let target = |k: usize, other: &'static str| of.judge.targets.get(k).map_or(other, |(name, _)| name.as_str());
    let first = target(0, usual[0]);
    let second = target(1, if first == usual[1] { usual[0] } else { usual[1] });
    let [x, y] = [first, second].map(|name| of.plan.figure(name).unwrap_or_default());
    let chart = |one: &OfGenerator| {
        let series = |name: &str, colour: usize, mark: Mark, which: &dyn Fn(&VariantRow) -> bool| {
            let points = rows(of, one).filter(|row| which(row)).map(|row| [row.figures[x], row.figures[y]]);
            let points = points.filter(|[x, y]| x.is_finite() && y.is_finite()).take(MOST_POINTS);
            ChartSeries::sorted(name, mark, colour, points.collect())
        };
        let series = vec![
            series("does not meet", 5, Mark::Dots, &|row| !row.meets),
            series("meets", 0, Mark::Points, &|row| row.meets && !row.is_front),
            series("Pareto-optimal", 1, Mark::Points, &|row| row.is_front),
        ];
        (one.generator.to_string(), Lines::of(series))
    };
    let (title, charts) = (format!("{second} against {first}"), of.sweep.generators.iter().map(chart).collect());
    let axes = [first, second].map(|name| ChartAxis::new(name, quantity(name)));
    let caption = format!("Each point is a variant; of each kind at most {MOST_POINTS} are shown.");
    let figure = PageBlock::lines("trade", title.as_str(), caption, axes, charts);
    PageSection::new("trade", title, Detail::Summary, vec![figure])
}

/// The Pareto front, the targets first.
fn front(of: &SweepSources<'_>, one: &OfGenerator) -> PageTable {
    let targets = &of.judge.targets;
    let (first, others): (Vec<&str>, Vec<&str>) =
        of.plan.figures().into_iter().partition(|name| targets.iter().any(|(target, _)| target == name));
    let word = |sense: Sense| if sense == Sense::Least { "least" } else { "most" };
    let better = targets.iter().map(|(name, sense)| format!("{} {name}", word(*sense))).collect::<Vec<_>>().join(", ");
    let row = |number: &usize| {
        let row = rows(of, one).find(|row| row.variant + 1 == *number)?;
        let cells = |names: &[&str]| -> Vec<RichText> {
            names.iter().map(|name| value(name, of.plan.figure(name).map_or(f64::NAN, |k| row.figures[k]))).collect()
        };
        let values = of.plan.variants[row.variant].iter().cloned().map(RichText::new).collect();
        Some([vec![number.to_string().into()], cells(&first), values, cells(&others)].concat())
    };
    let columns = of.plan.columns.iter().map(String::as_str);
    let header = ["Variant"].into_iter().chain(first.iter().copied()).chain(columns).chain(others.iter().copied());
    PageTable {
        caption: format!("Variants that no other beats in all of: {better}. All variants are in sweep.csv"),
        header: header.map(str::to_owned).collect(),
        rows: one.front.iter().take(MOST_ROWS).filter_map(row).collect(),
    }
}

/// Rank correlations of each figure, the strongest first.
fn ranks(one: &OfGenerator) -> PageTable {
    let shown = one.ranks.iter().filter(|rank| rank.correlation.abs() >= LEAST_RANK);
    let row = |rank: &RankCorrelation| {
        vec![rank.figure.into(), rank.input.clone().into(), significant(rank.correlation, 2).into()]
    };
    PageTable {
        caption: format!("Rank correlations from {LEAST_RANK} on; all are in sweep.json"),
        header: ["Figure", "Input", "Rank correlation"].map(str::to_owned).to_vec(),
        rows: shown.map(row).collect(),
    }
}

/// Scatter of each figure.
fn figures(one: &OfGenerator) -> PageTable {
    let rows = one.figures.iter().map(|spread| {
        let judged = spread.quantiles.iter().find(|quantile| quantile.share == JUDGED);
        let ends = [judged.and_then(|q| q.low), judged.and_then(|q| q.high)].map(|end| end.unwrap_or(f64::NAN));
        let cells = [spread.mean, spread.std].into_iter().chain(SHOWN.map(|share| at(spread, share))).chain(ends);
        [spread.figure.into()].into_iter().chain(cells.map(|x| value(spread.figure, x))).collect()
    });
    let header = ["Figure", "mean", "std", "5 %", "50 %", "95 %", "99 %", "from", "to"].map(str::to_owned).to_vec();
    let caption = "Figures of the variants that converged; the interval is that of the 95 % value".to_owned();
    PageTable { caption, header, rows: rows.collect() }
}

/// A quantile of a figure.
fn at(spread: &FigureSpread, share: f64) -> f64 {
    spread.quantiles.iter().find(|quantile| quantile.share == share).map_or(f64::NAN, |quantile| quantile.value)
}
