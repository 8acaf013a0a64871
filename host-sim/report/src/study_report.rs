//! The page of a study: the front, what each field does, curves or maps of every figure.

use serde_json::{Map, json};

use super::page::{
    Axis, Block, Choice, Detail, EVERY_CHOICE, Field, Figure, FigureBody, Headline, Limit, Lines, Mark, Page,
    PageQuantity, Section, Series, Status, Table, Text, significant,
};
use flexspline_design::data_sheet::{DataSheet, FIGURES, FigureOf};
use flexspline_design::study::{
    Asked, Basis, LAST_STABLE, Nearest, RunStatus, Sense, Study, StudyEffect, StudyRun, StudySettings, Trust, figure,
};
use flexspline_mechanics::drive::{Drive, GeneratorKind};

/// Rows of the table of the best.
const MOST_ROWS: usize = 25;

/// What the page is made from.
pub struct StudySources<'a> {
    /// The drive that was varied.
    pub drive: &'a Drive,
    /// The command line.
    pub command: &'a str,
    /// What was studied.
    pub settings: &'a StudySettings,
    /// What came out.
    pub study: &'a Study,
    /// What the fields do.
    pub effects: &'a [StudyEffect],
    /// What is asked, each alone.
    pub asked: &'a [Asked],
    /// What comes nearest, of generators where nothing meets.
    pub nearest: &'a [Nearest],
    /// What else has to be known.
    pub remarks: &'a [String],
}

/// The page.
pub fn page(of: StudySources<'_>) -> Page {
    let StudySources { settings, study, .. } = of;
    let ended = |status| study.runs.iter().filter(|run| run.status == status).count();
    let (failed, refused) = (ended(RunStatus::Failed), ended(RunStatus::Refused));
    let interfere = study.runs.iter().filter(|run| run.sheet.rigid_gap_um.is_some_and(|gap| gap < 0.0)).count();
    let remarks: Vec<String> = [
        (failed, "found no equilibrium from some load on; their last stable load is in study.csv"),
        (refused, "make no drive; why is in study.csv"),
        (interfere, "have teeth that interfere when rigid; they meet nothing"),
    ]
    .into_iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, what)| format!("{count} of {} runs {what}.", study.runs.len()))
    .chain(
        settings
            .generators
            .iter()
            .filter(|kind| !of_kind(study, **kind).any(|run| run.meets))
            .map(|kind| format!("No variant with the {} generator meets what has to be kept.", kind.in_words())),
    )
    .chain(of.remarks.iter().map(|remark| format!("{remark}.")))
    .collect();
    let kinds = &settings.generators;
    let mut results = Map::new();
    results.insert("effects".to_owned(), json!(of.effects));
    results.insert("runs".to_owned(), json!(study.runs));
    results.insert("asked".to_owned(), json!(of.asked));
    results.insert("nearest".to_owned(), json!(of.nearest));
    let mut sections = vec![best(&of)];
    sections.extend(does(&of));
    sections.push(trade(&of));
    sections.extend(off(&of));
    sections.push(curves(&of));
    sections.push(reading());
    Page {
        title: format!("Study of {}", of.drive.name),
        command_name: "study",
        status: if remarks.is_empty() { Status::Good } else { Status::Remark },
        also: Vec::new(),
        remarks,
        choices: kinds.iter().map(|kind| Choice { id: kind.to_string(), name: kind.to_string() }).collect(),
        choice_is: "Generator",
        headlines: kinds.iter().map(|kind| headline(&of, *kind)).collect(),
        sections,
        animations: Vec::new(),
        provenance: vec![
            ("command".to_owned(), of.command.to_owned()),
            ("better".to_owned(), better(settings)),
            ("drive_hash".to_owned(), blake3::Hash::from_bytes(of.drive.hash()).to_hex().to_string()),
        ],
        results,
    }
}

/// The targets in words.
fn better(settings: &StudySettings) -> String {
    let words = |sense| if sense == Sense::Least { "least" } else { "most" };
    let each = settings.targets.iter().map(|target| format!("{} {}", words(target.sense), target.figure));
    each.collect::<Vec<_>>().join(", ")
}

/// Endings of names that say a unit, longest first, the unit, and what a page takes it for.
const UNITS: [(&str, &str, PageQuantity); 16] = [
    ("_n_m_per_rad", "N·m/rad", PageQuantity::Count),
    ("_n_per_mm3", "N/mm³", PageQuantity::Count),
    ("_n_per_mm", "N/mm", PageQuantity::Count),
    ("_kg_m3", "kg/m³", PageQuantity::Count),
    ("_percent", "%", PageQuantity::Count),
    ("_arcsec", "arcsec", PageQuantity::Error),
    ("_per_k", "1/K", PageQuantity::Count),
    ("_mrad", "mrad", PageQuantity::Count),
    ("_n_m", "N·m", PageQuantity::Torque),
    ("_mpa", "MPa", PageQuantity::Stress),
    ("_deg", "degrees", PageQuantity::Count),
    ("_mm", "mm", PageQuantity::Count),
    ("_um", "µm", PageQuantity::Count),
    ("_n", "N", PageQuantity::Force),
    ("_c", "°C", PageQuantity::Count),
    ("_k", "K", PageQuantity::Count),
];

/// A name in words, and its unit: that of its ending, or `modules` of a profile shift.
fn in_words(name: &str) -> (String, Option<&'static str>, PageQuantity) {
    let words = |stem: &str| stem.replace("_pp", " peak to peak").replace(['_', '.'], " ");
    if name.ends_with("profile_shift") {
        return (words(name), Some("modules"), PageQuantity::Count);
    }
    let found = UNITS.iter().find_map(|(ending, unit, quantity)| Some((name.strip_suffix(ending)?, *unit, *quantity)));
    match found {
        Some((stem @ ("k1" | "k2" | "k3"), unit, quantity)) => (stem.to_uppercase(), Some(unit), quantity),
        Some((stem, unit, quantity)) => (words(stem), Some(unit), quantity),
        None => (words(name), None, PageQuantity::Count),
    }
}

/// A figure as a reader takes it: what it is with its unit, and its quantity. A unit that the page adds or changes is
/// left to it.
fn shown(name: &str) -> (String, PageQuantity) {
    match in_words(name) {
        (words, Some(unit), PageQuantity::Count) => (format!("{words}, {unit}"), PageQuantity::Count),
        (words, _, quantity) => (words, quantity),
    }
}

/// A figure or field at the head of a column. Errors have their unit in every cell, where the reader changes it.
pub(super) fn heading(name: &str) -> String {
    match in_words(name) {
        (words, _, PageQuantity::Error) => words,
        (words, Some(unit), _) => format!("{words}, {unit}"),
        (words, None, _) => words,
    }
}

pub(super) fn value(name: &str, value: Option<f64>) -> Text {
    match value {
        None => Text::new("–"),
        Some(value) if shown(name).1 == PageQuantity::Error => Text::default().error(value, 3),
        Some(value) => Text::new(significant(value, 3)),
    }
}

/// A figure of a run; a last stable load that is a bound says so.
fn of_run(name: &str, of: fn(&DataSheet) -> Option<f64>, run: &StudyRun) -> Text {
    match of(&run.sheet) {
        Some(load) if name == LAST_STABLE && run.bears_all() => Text::new(format!("≥ {}", significant(load, 3))),
        figure => value(name, figure),
    }
}

fn of_kind(study: &Study, kind: GeneratorKind) -> impl Iterator<Item = &StudyRun> {
    study.runs.iter().filter(move |run| run.generator == kind)
}

fn headline(of: &StudySources<'_>, kind: GeneratorKind) -> Headline {
    let count = of_kind(of.study, kind).count();
    let meet = of_kind(of.study, kind).filter(|run| run.meets).count();
    let name = of.settings.targets.first().map_or("kinematic_error_pp_arcsec", |target| target.figure);
    let of_figure = figure(name).ok();
    let front = of.study.front(kind, &of.settings.targets);
    let (answer, number) = match (front.first(), of_figure) {
        (Some(best), Some((_, figure))) => {
            let number = value(name, figure(&best.sheet));
            (
                format!("{meet} of {count} variants meet what has to be kept; nothing beats {} of them.", front.len()),
                number,
            )
        }
        _ => return nothing_meets(of, kind, count),
    };
    Headline {
        choice: Some(kind.to_string()),
        answer: Text::new(answer),
        number,
        number_is: format!("{}, of the best", heading(name)),
    }
}

/// Where no variant meets what has to be kept: the nearest one, and what it misses first.
fn nothing_meets(of: &StudySources<'_>, kind: GeneratorKind, count: usize) -> Headline {
    let mut answer = Text::new(format!("None of {count} variants meets what has to be kept."));
    let (mut number, mut number_is) = (Text::new("–"), String::new());
    if let Some(nearest) = of.nearest.iter().find(|nearest| nearest.generator == kind) {
        answer = answer.plain(format!(" Variant {} comes nearest", nearest.variant));
        let mut before = ": ";
        for miss in &nearest.misses {
            answer = answer.plain(format!("{before}{} ", heading(miss.figure)));
            answer.0.extend(value(miss.figure, miss.value).0);
            answer = answer.plain(format!(", asked is {} ", miss.side()));
            answer.0.extend(value(miss.figure, Some(miss.limit)).0);
            before = "; ";
        }
        answer = answer.plain(".");
        if let Some(miss) = nearest.misses.first() {
            (number, number_is) = (value(miss.figure, miss.value), format!("{}, of the nearest", heading(miss.figure)));
        }
    }
    Headline { choice: Some(kind.to_string()), answer, number, number_is }
}

/// What is asked, each thing alone, of every generator; nothing where nothing is asked and every variant is sound.
fn asked(of: &StudySources<'_>) -> Vec<Block> {
    let lacking = |asked: &&Asked| asked.meet_alone < asked.of;
    if of.settings.constraints.is_empty() && !of.asked.iter().any(|asked| lacking(&asked)) {
        return Vec::new();
    }
    let header = ["Asked", "variants that have it", "of", "found from", "to"].map(str::to_owned).to_vec();
    let block = |kind: &GeneratorKind| {
        let row = |asked: &Asked| {
            let figure = asked.what.split_once('=').map_or("", |(figure, _)| figure);
            let end = |k: usize| value(figure, asked.found.map(|found| found[k]));
            let [meet, all] = [asked.meet_alone, asked.of].map(|count| Text::new(count.to_string()));
            vec![Text::new(asked.what.clone()), meet, all, end(0), end(1)]
        };
        let rows = of.asked.iter().filter(|asked| asked.generator == *kind).map(row).collect();
        let caption = "What is asked of a variant, each thing alone".to_owned();
        Block::Table { choice: Some(kind.to_string()), table: Table { caption, header: header.clone(), rows } }
    };
    of.settings.generators.iter().map(block).collect()
}

fn best(of: &StudySources<'_>) -> Section {
    // What decides comes first: a phone shows three columns.
    let decides = |name: &str| of.settings.targets.iter().any(|target| target.figure == name);
    let (first, others): (Vec<FigureOf>, Vec<FigureOf>) = FIGURES.iter().copied().partition(|(name, _)| decides(name));
    let headings = |figures: &[FigureOf]| figures.iter().map(|(name, _)| heading(name)).collect::<Vec<_>>();
    let header = [
        vec!["Variant".to_owned()],
        headings(&first),
        of.study.fields.iter().map(|path| heading(path)).collect(),
        vec!["basis".to_owned()],
        headings(&others),
    ]
    .concat();
    let tables = of
        .settings
        .generators
        .iter()
        .map(|kind| {
            let front = of.study.front(*kind, &of.settings.targets);
            let rows = front.iter().take(MOST_ROWS).map(|run| {
                let figures =
                    |all: &[FigureOf]| all.iter().map(|(name, of)| of_run(name, *of, run)).collect::<Vec<_>>();
                [
                    vec![Text::new(run.variant.to_string())],
                    figures(&first),
                    run.values.iter().cloned().map(Text::new).collect(),
                    vec![Text::new(run.basis.name())],
                    figures(&others),
                ]
                .concat()
            });
            let rows: Vec<Vec<Text>> = rows.collect();
            let caption = if front.len() > MOST_ROWS {
                format!("The first {MOST_ROWS} of {} variants that nothing beats; all are in study.csv", front.len())
            } else {
                "Variants that nothing beats in every target".to_owned()
            };
            let table = Table { caption, header: header.clone(), rows };
            Block::Table { choice: Some(kind.to_string()), table }
        })
        .collect::<Vec<Block>>();
    let blocks = tables.into_iter().chain(asked(of)).collect();
    Section { id: "best".to_owned(), title: "The best".to_owned(), detail: Detail::Summary, blocks }
}

/// What each field does to each figure, from its least value to its largest.
fn does(of: &StudySources<'_>) -> Option<Section> {
    let header: Vec<String> = ["Figure".to_owned()]
        .into_iter()
        .chain(of.study.fields.iter().map(|path| heading(path)))
        .chain(["straight, %".to_owned()])
        .collect();
    let blocks: Vec<Block> = of
        .settings
        .generators
        .iter()
        .filter_map(|kind| {
            let rows: Vec<Vec<Text>> = of
                .effects
                .iter()
                .filter(|effect| effect.generator == *kind)
                .map(|effect| {
                    let changes = effect.change.iter().map(|change| value(effect.figure, *change));
                    let straight = Text::new(significant(100.0 * effect.straight, 3));
                    [Text::new(heading(effect.figure))].into_iter().chain(changes).chain([straight]).collect()
                })
                .collect();
            let caption = "Change of each figure from the least to the largest value of a field, the others held: the \
                           slopes of a straight line through all variants, and the share of the scatter that it \
                           explains";
            let table = Table { caption: caption.to_owned(), header: header.clone(), rows };
            (!table.rows.is_empty()).then(|| Block::Table { choice: Some(kind.to_string()), table })
        })
        .collect();
    let (id, title) = ("does".to_owned(), "What each field does".to_owned());
    (!blocks.is_empty()).then_some(Section { id, title, detail: Detail::Summary, blocks })
}

/// What estimated figures are off by; nothing where all are computed.
fn off(of: &StudySources<'_>) -> Option<Section> {
    let header = ["Figure", "off, median", "of how far variants differ, %", "ranks", "off, rms", "off, most"];
    let blocks: Vec<Block> = of
        .settings
        .generators
        .iter()
        .filter_map(|kind| {
            let estimated = of_kind(of.study, *kind).filter(|run| run.basis == Basis::Estimated).count();
            let row = |trust: &Trust| {
                let share = trust.share_of_spread_percent.map_or_else(|| "–".to_owned(), |share| significant(share, 2));
                vec![
                    Text::new(heading(trust.figure)),
                    value(trust.figure, Some(trust.median_off)),
                    Text::new(share),
                    Text::new(if trust.useless { "no: the middle value is as good" } else { "yes" }),
                    value(trust.figure, Some(trust.rms)),
                    value(trust.figure, Some(trust.largest)),
                ]
            };
            let rows: Vec<Vec<Text>> =
                of.study.trust.iter().filter(|trust| trust.generator == *kind).map(row).collect();
            let caption = format!(
                "{estimated} variants are estimated by a surface through the others. What it is off by where a \
                 computed variant is left out of it"
            );
            let table = Table { caption, header: header.map(str::to_owned).to_vec(), rows };
            (!table.rows.is_empty()).then(|| Block::Table { choice: Some(kind.to_string()), table })
        })
        .collect();
    let (id, title) = ("off".to_owned(), "How far to trust estimates".to_owned());
    (!blocks.is_empty()).then_some(Section { id, title, detail: Detail::Summary, blocks })
}

/// The first two targets against one another.
fn trade(of: &StudySources<'_>) -> Section {
    let [first, second] = match of.settings.targets.as_slice() {
        [first, second, ..] => [first.figure, second.figure],
        [only] if only.figure == "kinematic_error_pp_arcsec" => [only.figure, "k2_n_m_per_rad"],
        [only] => [only.figure, "kinematic_error_pp_arcsec"],
        [] => ["kinematic_error_pp_arcsec", "k2_n_m_per_rad"],
    };
    let get = |name: &str, run: &StudyRun| figure(name).ok().and_then(|(_, f)| f(&run.sheet));
    let series = |kind: GeneratorKind, name: &str, colour: usize, mark: Mark, which: &dyn Fn(&StudyRun) -> bool| {
        let mut points: Vec<[f64; 2]> = of_kind(of.study, kind)
            .filter(|run| which(run))
            .filter_map(|run| Some([get(first, run)?, get(second, run)?]))
            .collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Series { name: name.to_owned(), mark, colour, points }
    };
    let charts = of
        .settings
        .generators
        .iter()
        .map(|kind| {
            let lines = Lines {
                series: vec![
                    series(*kind, "does not meet", 5, Mark::Dots, &|run| !run.meets),
                    series(*kind, "meets", 0, Mark::Points, &|run| run.meets && !run.front),
                    series(*kind, "nothing beats it", 1, Mark::Points, &|run| run.front),
                ],
                ..Lines::default()
            };
            (kind.to_string(), lines)
        })
        .collect();
    let axis = |name: &str| {
        let (words, quantity) = shown(name);
        Axis::new(words, quantity)
    };
    let figure = Figure {
        id: "trade".to_owned(),
        title: format!("{} against {}", shown(second).0, shown(first).0),
        caption: Text::new("Each point is a variant."),
        alt: "Every variant by two of its figures; those that nothing beats stand out".to_owned(),
        body: FigureBody::Lines { x: axis(first), y: axis(second), charts },
    };
    Section {
        id: "trade".to_owned(),
        title: "What one pays with what".to_owned(),
        detail: Detail::Summary,
        blocks: vec![Block::Figure(figure)],
    }
}

/// Every figure over the fields: curves of one field, maps of two on a grid, points of more.
fn curves(of: &StudySources<'_>) -> Section {
    let grid = of.settings.spread.is_none();
    let blocks: Vec<Block> = FIGURES
        .iter()
        .filter(|(_, figure)| of.study.runs.iter().any(|run| figure(&run.sheet).is_some()))
        .flat_map(|(name, _)| match of.study.fields.len() {
            1 => vec![curve(of, name, 0, true)],
            2 if grid => map(of, name).map_or_else(|| all_curves(of, name), |map| vec![map]),
            _ => all_curves(of, name),
        })
        .map(Block::Figure)
        .collect();
    Section { id: "curves".to_owned(), title: "Figure by figure".to_owned(), detail: Detail::Engineering, blocks }
}

fn all_curves(of: &StudySources<'_>, name: &'static str) -> Vec<Figure> {
    (0..of.study.fields.len()).map(|field| curve(of, name, field, false)).collect()
}

/// Where a value of a field stands on an axis: its number, or for words its place among them.
fn place(of: &StudySources<'_>, field: usize, value: &str) -> f64 {
    value.parse().unwrap_or_else(|_| {
        let grid = of.settings.vary[field].grid();
        grid.iter().position(|word| word == value).map_or(f64::NAN, |k| k as f64)
    })
}

/// What the data sheet says of a figure, where it was computed at the loads of the sheet.
fn stated(of: &StudySources<'_>, name: &str) -> Option<f64> {
    let stated = of.settings.stated.as_ref().filter(|_| of.settings.torque_n_m.is_none())?;
    match name {
        "k1_n_m_per_rad" => stated.k1_n_m_per_rad,
        "k2_n_m_per_rad" => stated.k2_n_m_per_rad,
        "k3_n_m_per_rad" => stated.k3_n_m_per_rad,
        _ => None,
    }
}

fn curve(of: &StudySources<'_>, name: &'static str, field: usize, alone: bool) -> Figure {
    let figure = figure(name).ok().map(|(_, figure)| figure);
    let points = |kind: GeneratorKind| {
        let mut points: Vec<[f64; 2]> = of_kind(of.study, kind)
            .map(|run| [place(of, field, &run.values[field]), figure.and_then(|of| of(&run.sheet)).unwrap_or(f64::NAN)])
            .collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points
    };
    let limits = || -> Vec<Limit> {
        let kept = of.settings.constraints.iter().filter(|kept| kept.figure == name);
        kept.flat_map(|kept| [("at least", kept.least), ("at most", kept.most)])
            .filter(|(_, y)| y.is_finite())
            .chain(stated(of, name).map(|y| ("data sheet", y)))
            .map(|(name, y)| Limit { name: name.to_owned(), y })
            .collect()
    };
    let kinds = &of.settings.generators;
    // Of one field all generators share a chart; of several each has its own.
    let charts = if alone {
        let series = kinds
            .iter()
            .enumerate()
            .map(|(colour, kind)| Series { name: kind.to_string(), mark: Mark::Broken, colour, points: points(*kind) })
            .collect();
        vec![(EVERY_CHOICE.to_owned(), Lines { series, limits: limits(), ..Lines::default() })]
    } else {
        let chart = |kind: &GeneratorKind| {
            let series =
                vec![Series { name: "variants".to_owned(), mark: Mark::Points, colour: 0, points: points(*kind) }];
            (kind.to_string(), Lines { series, limits: limits(), ..Lines::default() })
        };
        kinds.iter().map(chart).collect()
    };
    let (words, quantity) = shown(name);
    let over = heading(&of.study.fields[field]);
    Figure {
        id: format!("{}-{field}", name.replace('_', "-")),
        title: format!("{words} over {over}"),
        caption: Text::default(),
        alt: format!("{words} of every variant over {over}"),
        body: FigureBody::Lines { x: Axis::new(over, PageQuantity::Count), y: Axis::new(words, quantity), charts },
    }
}

/// A figure over a grid of two fields of numbers.
fn map(of: &StudySources<'_>, name: &'static str) -> Option<Figure> {
    let (_, figure) = figure(name).ok()?;
    let axis = |field: usize| -> Option<Vec<f64>> {
        let values: Option<Vec<f64>> = of.settings.vary[field].grid().iter().map(|value| value.parse().ok()).collect();
        let mut values = values?;
        values.sort_by(f64::total_cmp);
        values.dedup();
        (values.len() > 1).then_some(values)
    };
    let (x, y) = (axis(0)?, axis(1)?);
    let fields = of
        .settings
        .generators
        .iter()
        .map(|kind| {
            let mut z = vec![f64::NAN; x.len() * y.len()];
            for run in of_kind(of.study, *kind) {
                let at = |axis: &[f64], value: &str| {
                    let value: f64 = value.parse().ok()?;
                    axis.iter().position(|known| *known == value)
                };
                if let (Some(i), Some(j), Some(value)) =
                    (at(&x, &run.values[0]), at(&y, &run.values[1]), figure(&run.sheet))
                {
                    z[j * x.len() + i] = value;
                }
            }
            (kind.to_string(), Field { x: x.clone(), y: y.clone(), z })
        })
        .collect();
    let (words, quantity) = shown(name);
    let [across, up] = [0, 1].map(|field| Axis::new(heading(&of.study.fields[field]), PageQuantity::Count));
    Some(Figure {
        id: name.replace('_', "-"),
        title: format!("{words} over both fields"),
        caption: Text::default(),
        alt: format!("{words} in colour over {} and {}", heading(&of.study.fields[0]), heading(&of.study.fields[1])),
        body: FigureBody::Field { x: across, y: up, z: Axis::new(words, quantity), fields },
    })
}

fn reading() -> Section {
    Section::reading(vec![Block::paragraph(
        "Each variant is loaded from first contact with its generator held, and then turned by a tooth pitch under \
         the largest load. K1 is the secant of its torsion up to T1, K2 from T1 to T2, K3 above; the clearance of the \
         teeth is no part of them. Stress in root fillets (root fillet) is found by the strain of their surface. The \
         largest nodal value (max von mises) grows with the mesh, and is too low in fillets. A caution judges the \
         larger of both; simulate --stress tells the stress of one variant over three meshes.",
    )])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of what a study can be asked, all but a ratio, and every field of a drive that ends in a unit, have it in the
    /// heading of a column.
    #[test]
    fn figures_and_fields_say_their_units() {
        for (name, due) in [
            ("k1_n_m_per_rad", "K1, N·m/rad"),
            ("max_von_mises_mpa", "max von mises, MPa"),
            ("kinematic_error_pp_arcsec", "kinematic error peak to peak"),
            ("lobe_force_n", "lobe force, N"),
            ("tilt_mrad", "tilt, mrad"),
            ("last_stable_n_m", "last stable, N·m"),
            ("teeth_in_contact_percent", "teeth in contact, %"),
            ("load_across_face_peak_over_mean", "load across face peak over mean"),
            ("flexspline.rim_thickness_mm", "flexspline rim thickness, mm"),
            ("circular_spline.profile_shift", "circular spline profile shift, modules"),
            ("generator.bearing_stiffness_n_per_mm3", "generator bearing stiffness, N/mm³"),
            ("as_built.generator_warmer_k", "as built generator warmer, K"),
        ] {
            assert_eq!(heading(name), due);
        }
        let without: Vec<&str> =
            FIGURES.iter().filter(|(name, _)| in_words(name).1.is_none()).map(|(name, _)| *name).collect();
        assert_eq!(without, ["load_across_face_peak_over_mean"]);
    }
}
