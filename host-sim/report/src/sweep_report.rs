//! The page of a sweep: the answer, one picture, the Pareto front, which input matters, scatter.

use serde_json::{Map, json};

use super::page::{
    ChartAxis, ChartSeries, Choice, Headline, Lines, Mark, Page, PageBlock, PageQuantity, PageSection, PageTable,
    RichText, Status, significant,
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
/// Drives of which 95 % and 5 % are apart by less than this share do not differ. *Guess*: below the scatter of a bench.
const NO_MATTER: f64 = 0.01;
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
    let fronts = sweep.rows.iter().any(|row| row.is_front).then(|| front(of));
    let mut sections = vec![
        trade(of),
        PageSection::new("best", "The Pareto front", fronts.into_iter().collect()),
        PageSection::folded("matters", "What matters", tables(of, ranks)),
        PageSection::folded("figures", "Figure by figure", tables(of, figures)),
    ];
    sections.retain(|section| !section.blocks.is_empty());
    sections.push(PageSection::reading(vec![PageBlock::paragraph(READING)]));
    let choice = |one: &OfGenerator| Choice { id: one.generator.to_string(), name: one.generator.to_string() };
    let (choices, headlines) = if plan.is_of_tolerances() {
        sweep.generators.iter().map(|one| (choice(one), drawn(of, one))).unzip()
    } else {
        (vec![Choice { id: "all".to_owned(), name: "all generators".to_owned() }], vec![best(of)])
    };
    Page {
        title: format!("Sweep of {}", sweep.drive),
        command_name: "sweep",
        status: if of.remarks.is_empty() { Status::Good } else { Status::Remark },
        remarks: of.remarks.iter().map(|remark| format!("{remark}.")).collect(),
        choices,
        choice_is: "Generator",
        headlines,
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

/// A figure in words, with its unit if that is not an error's: `kinematic_error_pp_arcsec`, `k2_n_m_per_rad`.
fn words_of(name: &str) -> String {
    let units = [("_arcsec", ""), ("_n_m_per_rad", ", N·m/rad"), ("_n_m", ", N·m"), ("_mpa", ", MPa"), ("_um", ", µm")];
    let (words, unit) =
        units.iter().find_map(|(end, unit)| Some((name.strip_suffix(end)?, *unit))).unwrap_or((name, ""));
    let mut words = words.replace("_pp", ", peak to peak").replace('_', " ");
    words[..1].make_ascii_uppercase();
    words + unit
}

/// The first two targets, or figures that stand for them: their names.
fn targets<'a>(of: &'a SweepSources<'_>) -> [&'a str; 2] {
    let usual = if of.plan.is_of_tolerances() {
        [ERROR, "lost_motion_arcsec"]
    } else {
        ["kinematic_error_pp_arcsec", "k2_n_m_per_rad"]
    };
    let target = |k: usize, other: &'static str| of.judge.targets.get(k).map_or(other, |(name, _)| name.as_str());
    let first = target(0, usual[0]);
    [first, target(1, if first == usual[1] { usual[0] } else { usual[1] })]
}

/// Of drives drawn from tolerances with a generator: what to tighten, and the error that most stay below.
fn drawn(of: &SweepSources<'_>, one: &OfGenerator) -> Headline {
    let spread = one.figures.iter().find(|spread| spread.figure == ERROR);
    let number = spread.map_or(f64::NAN, |spread| at(spread, JUDGED));
    let matters = spread.is_some_and(|spread| at(spread, JUDGED) > (1.0 + NO_MATTER) * at(spread, SHOWN[0]));
    let first = one.ranks.iter().find(|rank| rank.figure == ERROR).map_or_else(String::new, |first| {
        let by = significant(first.correlation, 2);
        match matters {
            true => format!("Tighten {} first: the error follows it most (rank correlation {by}). ", first.input),
            false => "None of the tolerances matters: the error is nearly the same in all drives. ".to_owned(),
        }
    });
    let count = of.sweep.rows.iter().filter(|row| row.generator == one.generator).count();
    let answer = RichText::new(format!("{first}Of {count} drives 95 % stay below ")).error(number, 3).plain(".");
    let number_is = "error peak to peak that 95 % of the drives stay below".to_owned();
    Headline { choice: Some(one.generator.to_string()), answer, number: RichText::arcsec(number, 3), number_is }
}

/// Of variants: which is best in the first target, and which in the second.
fn best(of: &SweepSources<'_>) -> Headline {
    let SweepSources { plan, sweep, judge, .. } = of;
    let front = judge.front(plan, &sweep.rows);
    let mut best = judge.targets.iter().take(2).filter_map(|(name, sense)| {
        let figure = plan.figure(name)?;
        let cost = |row: &VariantRow| sense.cost(name, row.figures[figure], row.generator);
        let row = *front.iter().min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
        Some((name, *sense, row, row.figures[figure]))
    });
    let Some((name, _, first, number)) = best.next() else {
        let answer = format!("None of {} variants meets the constraints.", sweep.rows.len());
        return Headline::new(answer.into(), RichText::new("–"), "variants that meet the constraints");
    };
    let sets = |row: &VariantRow| {
        let sets =
            plan.columns.iter().zip(&plan.variants[row.variant]).map(|(path, value)| format!("{path} = {value}"));
        [row.generator.in_words().to_owned()].into_iter().chain(sets).collect::<Vec<_>>().join(", ")
    };
    let answer = format!("Best of {} variants that meet the constraints: {}", sweep.meet, sets(first));
    let mut answer = RichText::new(answer);
    if let Some((other, sense, row, second)) = best.next() {
        let most = if sense == Sense::Least { "least" } else { "largest" };
        let of = if std::ptr::eq(row, first) { "the same".to_owned() } else { sets(row) };
        answer = answer.plain(format!("; {most} {}: {of}, ", words_of(other)));
        answer.0.extend(value(other, second).0);
    }
    Headline::new(answer.plain("."), value(name, number), format!("{}, of the best", words_of(name)))
}

/// A table for each generator; none without rows.
fn tables(of: &SweepSources<'_>, make: impl Fn(&OfGenerator) -> PageTable) -> Vec<PageBlock> {
    let table = |one: &OfGenerator| {
        let table = make(one);
        let choice = of.plan.is_of_tolerances().then(|| one.generator.to_string());
        (choice, PageTable { caption: format!("{}: {}", one.generator, table.caption), ..table })
    };
    let all = of.sweep.generators.iter().map(table).filter(|(_, table)| !table.rows.is_empty());
    all.map(|(choice, table)| PageBlock::Table { choice, table }).collect()
}

/// Points of a generator's variants in a chart.
fn points(of: &SweepSources<'_>, place: &dyn Fn(&VariantRow) -> [f64; 2]) -> Vec<ChartSeries> {
    let series = |name: String, colour: usize, mark: Mark, which: &dyn Fn(&VariantRow) -> bool| {
        let points = of.sweep.rows.iter().filter(|row| which(row)).map(place);
        let points = points.filter(|[x, y]| x.is_finite() && y.is_finite()).take(MOST_POINTS);
        ChartSeries::sorted(name, mark, colour, points.collect())
    };
    let of_generator = |(colour, one): (usize, &OfGenerator)| {
        let (kind, name) = (one.generator, one.generator.in_words());
        let meets = series(name.to_owned(), colour, Mark::Dots, &|row| row.generator == kind && row.meets);
        let front = |row: &VariantRow| row.generator == kind && row.is_front;
        [meets, series(format!("{name}, Pareto-optimal"), colour, Mark::Points, &front)]
    };
    let fails = series("does not meet the constraints".to_owned(), 5, Mark::Dots, &|row| !row.meets);
    let mut all: Vec<_> = of.sweep.generators.iter().enumerate().flat_map(of_generator).chain([fails]).collect();
    all.retain(|series| !series.points.is_empty());
    all
}

/// The targets over the field where one alone varies, else variants by two figures: by two targets, drives drawn from
/// tolerances by their error and their lost motion.
fn trade(of: &SweepSources<'_>) -> PageSection {
    let [first, second] = targets(of);
    let place = |name: &str| of.plan.figure(name).unwrap_or_default();
    let axis = |name: &str| ChartAxis::new(words_of(name), quantity(name));
    let caption = format!("Each point is a variant; of each kind at most {MOST_POINTS} are shown.");
    let number = |row: &VariantRow| of.plan.variants[row.variant][0].parse().unwrap_or(f64::NAN);
    let field = of.plan.columns.first().filter(|_| of.plan.columns.len() == 1);
    let mut blocks = Vec::new();
    if let Some(field) = field.filter(|_| of.sweep.rows.iter().all(|row| number(row).is_finite())) {
        for (id, name) in [("curve", first), ("second-curve", second)] {
            let mut series = points(of, &|row| [number(row), row.figures[place(name)]]);
            let lines = series.iter_mut().filter(|series| series.colour < 5 && series.mark == Mark::Dots);
            lines.for_each(|series| series.mark = Mark::Line);
            let title = format!("{} over {field}", words_of(name));
            let axes = [ChartAxis::new(field.as_str(), PageQuantity::Count), axis(name)];
            blocks.push(PageBlock::lines(id, title, caption.as_str(), axes, Lines::of(series).for_every_choice()));
        }
    }
    let title = format!("{} against {}", words_of(second), words_of(first));
    let series = points(of, &|row| [row.figures[place(first)], row.figures[place(second)]]);
    let axes = [axis(first), axis(second)];
    blocks.push(PageBlock::lines("trade", title, caption, axes, Lines::of(series).for_every_choice()));
    PageSection::new("picture", "The variants", blocks)
}

/// The Pareto front, the targets first.
fn front(of: &SweepSources<'_>) -> PageBlock {
    let SweepSources { plan, sweep, judge, .. } = of;
    let (first, others): (Vec<&str>, Vec<&str>) =
        plan.figures().into_iter().partition(|name| judge.targets.iter().any(|(target, _)| target == name));
    let word = |sense: Sense| if sense == Sense::Least { "least" } else { "most" };
    let better = judge.targets.iter().map(|(name, sense)| format!("{} {name}", word(*sense)));
    let better = better.collect::<Vec<_>>().join(", ");
    let row = |row: &VariantRow| -> Vec<RichText> {
        let cells = |names: &[&str]| -> Vec<RichText> {
            names.iter().map(|name| value(name, plan.figure(name).map_or(f64::NAN, |k| row.figures[k]))).collect()
        };
        let values = plan.variants[row.variant].iter().cloned().map(RichText::new).collect();
        let head = vec![(row.variant + 1).to_string().into(), row.generator.in_words().into()];
        [head, cells(&first), values, cells(&others)].concat()
    };
    let columns = plan.columns.iter().map(String::as_str);
    let head = ["Variant", "Generator"].into_iter();
    let header: Vec<&str> = head.chain(first.iter().copied()).chain(columns).chain(others.iter().copied()).collect();
    let caption = format!("Variants that no other beats in all of: {better}. All variants are in sweep.csv");
    let rows = judge.front(plan, &sweep.rows).into_iter();
    PageBlock::table(caption, &header, rows.take(MOST_ROWS).map(row).collect())
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
