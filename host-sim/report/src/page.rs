//! The parts of a page. A command fills in a [`Page`] and writes [`Page::html`]; nothing here knows what a table or
//! a diagnosis is.
//!
//! - A page answers its reader's question first: a [`Headline`] of one sentence and one number, under a [`Status`] that
//!   also stands in the page's JSON block and decides the command's exit code.
//! - It may speak of several *choices* (the four generators): a selector shows one at a time. Text and tables marked
//!   with a choice, and every figure, follow it. A page of one thing has one choice and no selector.
//! - [`PageSection`]s hold text, tables and [`Figure`]s, numbered in their order: first one row of figures and the
//!   picture, then what to do next; all else is folded.
//! - Errors of the output are stored in arc-seconds and shown in the unit that the reader picks: give them as
//!   [`RichText::error`] in text, and as [`PageQuantity::Error`] on an axis.
//! - A [`FigureBody::Drive`] shows the [`Animation`]s of the page. Charts whose x axis is [`ChartAxis::over_pitch`]
//!   turn its generator, and are turned by it.

use std::fmt;

use askama::Template;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::animation::Animation;
use super::assets::{self, SCRIPT, STYLE};
use super::pack::Packed;
use flexspline_base::figures::NamedFigure;
use flexspline_mechanics::drive::Drive;

/// Whether what the page says can be relied on, best first; what is wrong is stamped on it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Status {
    /// Every check passed.
    #[default]
    Good,
    /// Holds, with a remark that the reader has to know.
    Remark,
    /// A drive that is not to be built as it stands.
    Caution,
    /// Measured data had faults, which were repaired or left out.
    DataFaults,
    /// Something is wrong with the unit, and it has a name.
    FaultFound,
    /// The unit departs from what is nominal, and what does it has no name.
    NotUnderstood,
    /// A bound was missed.
    BoundMissed,
    /// Some run did not converge.
    NotConverged,
}

impl Status {
    /// As in the JSON block.
    pub fn name(self) -> &'static str {
        match self {
            Status::Good => "good",
            Status::Remark => "remark",
            Status::Caution => "caution",
            Status::DataFaults => "data faults",
            Status::FaultFound => "fault found",
            Status::NotUnderstood => "not understood",
            Status::BoundMissed => "bound missed",
            Status::NotConverged => "not converged",
        }
    }

    /// Whether the command that made the page has failed.
    pub fn is_failure(self) -> bool {
        matches!(self, Status::BoundMissed | Status::NotConverged)
    }
}

/// A piece of text: words, or an error of the output that follows the unit switch.
#[derive(Debug, Clone, PartialEq)]
pub enum Span {
    /// Words.
    Plain(String),
    /// Words that stand out.
    Strong(String),
    /// An error in arc-seconds, with its number of significant digits.
    Error {
        /// The value.
        arcsec: f64,
        /// Significant digits.
        digits: usize,
    },
}

/// Text of [`Span`]s.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RichText(pub Vec<Span>);

impl RichText {
    /// Text that begins with these words.
    pub fn new(words: impl Into<String>) -> RichText {
        RichText(vec![Span::Plain(words.into())])
    }

    /// Words in which each `{}` is an error of the output: its value, arcsec, and significant digits.
    pub fn filled(words: &str, errors: &[(f64, usize)]) -> RichText {
        let mut parts = words.splitn(errors.len() + 1, "{}");
        let begin = RichText::new(parts.next().unwrap_or_default());
        parts.zip(errors).fold(begin, |text, (words, (arcsec, digits))| text.error(*arcsec, *digits).plain(words))
    }

    /// An error of the output alone, arcsec, to `digits` significant digits.
    pub fn arcsec(arcsec: f64, digits: usize) -> RichText {
        RichText::default().error(arcsec, digits)
    }

    /// Goes on with words.
    pub fn plain(mut self, words: impl Into<String>) -> RichText {
        self.0.push(Span::Plain(words.into()));
        self
    }

    /// Goes on with words that stand out.
    pub fn strong(mut self, words: impl Into<String>) -> RichText {
        self.0.push(Span::Strong(words.into()));
        self
    }

    /// Goes on with an error of the output, arcsec, to `digits` significant digits.
    pub fn error(mut self, arcsec: f64, digits: usize) -> RichText {
        self.0.push(Span::Error { arcsec, digits });
        self
    }
}

/// As a terminal shows it.
impl fmt::Display for RichText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|span| match span {
            Span::Plain(words) | Span::Strong(words) => f.write_str(words),
            Span::Error { arcsec, digits } => write!(f, "{} arcsec", significant(*arcsec, *digits)),
        })
    }
}

impl From<&str> for RichText {
    fn from(words: &str) -> RichText {
        RichText::new(words)
    }
}

impl From<String> for RichText {
    fn from(words: String) -> RichText {
        RichText::new(words)
    }
}

/// A number to significant digits, as the page's script writes it.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let magnitude = if value == 0.0 { digits as f64 - 1.0 } else { value.abs().log10().floor() };
    let decimals = (digits as f64 - 1.0 - magnitude).clamp(0.0, 6.0) as usize;
    format!("{value:.decimals$}").replace('-', "−")
}

impl Span {
    /// An error as it stands before the script has run.
    fn in_arcsec(arcsec: &f64, digits: &usize) -> String {
        format!("{}″", significant(*arcsec, *digits))
    }
}

/// The error and its sign, for the section on how to read a page.
pub const SIGNS: &str = "Error: output angle less generator angle over the ratio; positive when the output leads. \
                         Forward is growing generator angle.";

/// Stands for every choice where a figure is the same for all of them.
pub const EVERY_CHOICE: &str = "every";

/// Something the page can show one at a time.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Choice {
    /// Looked up by; letters, digits and hyphens.
    pub id: String,
    /// Name, as the reader sees it.
    pub name: String,
}

/// The answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Headline {
    /// Of which choice; `None` for all.
    pub choice: Option<String>,
    /// One sentence.
    pub answer: RichText,
    /// The one number.
    pub number: RichText,
    /// Its name, in a few words.
    pub number_is: String,
}

impl Headline {
    /// An answer for all choices.
    pub fn new(answer: RichText, number: RichText, number_is: impl Into<String>) -> Headline {
        Headline { choice: None, answer, number, number_is: number_is.into() }
    }
}

/// A part of the page under a title.
#[derive(Debug, Clone)]
pub struct PageSection {
    /// Anchor; letters, digits and hyphens.
    pub id: String,
    /// Title.
    pub title: String,
    /// Whether the reader opens it.
    pub folded: bool,
    /// Its text, tables and figures.
    pub blocks: Vec<PageBlock>,
}

/// A piece of a section.
#[derive(Debug, Clone)]
pub enum PageBlock {
    /// A paragraph.
    Paragraph {
        /// Of which choice; `None` for all.
        choice: Option<String>,
        /// The words.
        text: RichText,
    },
    /// A table.
    Table {
        /// Of which choice; `None` for all.
        choice: Option<String>,
        /// The table.
        table: PageTable,
    },
    /// A figure.
    Figure(Figure),
}

/// A table; the first cell of each row is its heading.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PageTable {
    /// Its caption.
    pub caption: String,
    /// Headings of the columns.
    pub header: Vec<String>,
    /// Rows, as long as the header.
    pub rows: Vec<Vec<RichText>>,
}

impl PageBlock {
    /// Words, whatever is chosen.
    pub fn paragraph(text: impl Into<RichText>) -> PageBlock {
        PageBlock::Paragraph { choice: None, text: text.into() }
    }

    /// A table, whatever is chosen.
    pub fn table(caption: impl Into<String>, header: &[&str], rows: Vec<Vec<RichText>>) -> PageBlock {
        let header = header.iter().map(|&cell| cell.to_owned()).collect();
        PageBlock::Table { choice: None, table: PageTable { caption: caption.into(), header, rows } }
    }

    /// The figures of a result, the list that the terminal prints, whatever is chosen.
    pub fn figures(caption: impl Into<String>, figures: &[NamedFigure]) -> PageBlock {
        let row = |figure: &NamedFigure| {
            let NamedFigure { caveat, what, .. } = figure;
            let semicolon = if what.is_empty() || caveat.is_empty() { "" } else { "; " };
            let [name, number] = on_a_page(figure);
            vec![name, number, format!("{what}{semicolon}{caveat}").into()]
        };
        PageBlock::table(caption, &["Figure", "Value", "What it is"], figures.iter().map(row).collect())
    }

    /// Of the figures of a result, those of these names in one row.
    pub fn row(caption: impl Into<String>, figures: &[NamedFigure], names: &[&str]) -> PageBlock {
        let named = names.iter().filter_map(|name| figures.iter().find(|figure| figure.name == *name));
        let (header, row): (Vec<String>, Vec<RichText>) =
            named.map(on_a_page).map(|[name, number]| (name.to_string(), number)).unzip();
        PageBlock::Table { choice: None, table: PageTable { caption: caption.into(), header, rows: vec![row] } }
    }

    /// A figure of curves and points, a chart to each choice. Its title is also its alternative text.
    pub fn lines(
        id: impl Into<String>,
        title: impl Into<String>,
        caption: impl Into<RichText>,
        [x, y]: [ChartAxis; 2],
        charts: Vec<(String, Lines)>,
    ) -> PageBlock {
        PageBlock::Figure(Figure::of(id, title, caption, FigureBody::Lines { x, y, charts }))
    }

    /// This block, shown for one choice alone.
    pub fn of_choice(self, id: impl Into<String>) -> PageBlock {
        match self {
            PageBlock::Paragraph { text, .. } => PageBlock::Paragraph { choice: Some(id.into()), text },
            PageBlock::Table { table, .. } => PageBlock::Table { choice: Some(id.into()), table },
            figure @ PageBlock::Figure(_) => figure,
        }
    }
}

/// Name and value of a figure of a result, with its unit.
fn on_a_page(NamedFigure { name, value, unit, .. }: &NamedFigure) -> [RichText; 2] {
    let number = match *unit {
        "arcsec" => RichText::arcsec(*value, 4),
        "" => RichText::new(significant(*value, 3)),
        unit => format!("{}\u{a0}{}", significant(*value, 4), unit.replace("deg", "°")).into(),
    };
    let mut name = name.clone();
    name[..1].make_ascii_uppercase();
    [name.into(), number]
}

impl Figure {
    /// A figure whose title is also its alternative text.
    pub fn of(
        id: impl Into<String>,
        title: impl Into<String>,
        caption: impl Into<RichText>,
        body: FigureBody,
    ) -> Figure {
        let title = title.into();
        Figure { id: id.into(), alt: title.clone(), title, caption: caption.into(), body }
    }
}

impl PageSection {
    /// A section that is open from the first.
    pub fn new(id: &str, title: impl Into<String>, blocks: Vec<PageBlock>) -> PageSection {
        PageSection { id: id.into(), title: title.into(), folded: false, blocks }
    }

    /// A section that the reader opens.
    pub fn folded(id: &str, title: impl Into<String>, blocks: Vec<PageBlock>) -> PageSection {
        PageSection { folded: true, ..PageSection::new(id, title, blocks) }
    }

    /// How to read the page: the last section, folded.
    pub fn reading(mut blocks: Vec<PageBlock>) -> PageSection {
        blocks.push(PageBlock::paragraph(
            "Figures zoom by dragging and come back by a double click. Every figure has its numbers as a table and as \
             CSV, in the unit that is selected: the points that are drawn.",
        ));
        PageSection::folded("reading", "How to read this page", blocks)
    }
}

impl PageTable {
    /// Whether a column holds words and no numbers: those stand to the left.
    fn is_words(&self, column: &usize) -> bool {
        let cells = || self.rows.iter().filter_map(|row| row.get(*column)).filter_map(|text| text.0.first());
        let words = |span: &Span| match span {
            Span::Plain(words) | Span::Strong(words) => words.chars().next().is_some_and(char::is_alphabetic),
            Span::Error { .. } => false,
        };
        cells().count() > 0 && cells().all(words)
    }
}

/// A numbered figure.
#[derive(Debug, Clone)]
pub struct Figure {
    /// Anchor; letters, digits and hyphens.
    pub id: String,
    /// Title, in a few words.
    pub title: String,
    /// Caption.
    pub caption: RichText,
    /// Alternative text, for those who cannot see it.
    pub alt: String,
    /// The figure itself.
    pub body: FigureBody,
}

/// The drawing of a figure.
#[derive(Debug, Clone)]
pub enum FigureBody {
    /// The drive, to scale, in motion: the page's animations.
    Drive,
    /// The flexspline with its sleeve, in three dimensions: what the page's animations have of it.
    Sleeve,
    /// A drawing that is there, as SVG.
    Svg(String),
    /// Curves and points over an axis, one chart to each choice.
    Lines {
        /// Across.
        x: ChartAxis,
        /// Up.
        y: ChartAxis,
        /// By choice.
        charts: Vec<(String, Lines)>,
    },
    /// A field over two axes in colour, one to each choice.
    Field {
        /// Across.
        x: ChartAxis,
        /// Up.
        y: ChartAxis,
        /// In colour.
        z: ChartAxis,
        /// By choice.
        fields: Vec<(String, FieldMap)>,
    },
}

/// Kinds of values, which decide the unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PageQuantity {
    /// Small angle at the output, stored in arcsec, shown in what the reader picks.
    Error,
    /// Angle, degrees.
    Degree,
    /// Torque, N m.
    Torque,
    /// Stress or pressure, MPa.
    Stress,
    /// Force, N.
    Force,
    /// Temperature, °C.
    Temperature,
    /// Time, s.
    Second,
    /// Angle, whole turns.
    Turn,
    /// Speed, rad/s.
    Speed,
    /// A number without a unit.
    Count,
    /// A whole number without a unit.
    Whole,
}

/// An axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChartAxis {
    /// Its title, without unit.
    pub label: String,
    /// Its quantity.
    pub quantity: PageQuantity,
    /// Whether it is the generator angle from a pitch's beginning, and linked with the drive.
    pub linked: bool,
    /// Linear between minus and plus this, logarithmic beyond, for what changes most around zero.
    pub stretched: Option<f64>,
}

impl ChartAxis {
    /// An axis of its own.
    pub fn new(label: impl Into<String>, quantity: PageQuantity) -> ChartAxis {
        ChartAxis { label: label.into(), quantity, linked: false, stretched: None }
    }

    /// The generator angle over a pitch, linked with the drive.
    pub fn over_pitch() -> ChartAxis {
        ChartAxis { linked: true, ..ChartAxis::new("Generator from the beginning of a pitch", PageQuantity::Degree) }
    }

    /// This axis, linear within `within` of zero and logarithmic beyond.
    pub(crate) fn stretched(self, within: f64) -> ChartAxis {
        ChartAxis { stretched: Some(within), ..self }
    }
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mark {
    /// A line.
    Line,
    /// A line that values which are not finite break; other lines join across them.
    Broken,
    /// A dashed line.
    Dashed,
    /// Points alone.
    Points,
    /// Many points, small.
    Dots,
}

/// Points of a chart that belong together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChartSeries {
    /// In the legend.
    pub name: String,
    /// How it is drawn.
    pub mark: Mark,
    /// Which of the six colours; equal colours belong together.
    pub colour: usize,
    /// `[x, y]`, x ascending.
    #[serde(skip)]
    pub points: Vec<[f64; 2]>,
}

impl ChartSeries {
    /// A series.
    pub fn new(name: impl Into<String>, mark: Mark, colour: usize, points: Vec<[f64; 2]>) -> ChartSeries {
        ChartSeries { name: name.into(), mark, colour, points }
    }

    /// A series of points in any order.
    pub fn sorted(name: impl Into<String>, mark: Mark, colour: usize, mut points: Vec<[f64; 2]>) -> ChartSeries {
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        ChartSeries::new(name, mark, colour, points)
    }
}

/// A level across a chart that has a name, such as a bound.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Limit {
    /// Its name.
    pub name: String,
    /// Where.
    pub y: f64,
}

/// A place across a chart that has a name, such as the border between two sessions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Upright {
    /// Its name.
    pub name: String,
    /// Where.
    pub x: f64,
}

/// One chart.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct Lines {
    /// Curves and points.
    pub series: Vec<ChartSeries>,
    /// Named levels.
    pub limits: Vec<Limit>,
    /// Named places.
    pub uprights: Vec<Upright>,
}

impl Lines {
    /// A chart of these series alone.
    pub fn of(series: Vec<ChartSeries>) -> Lines {
        Lines { series, ..Lines::default() }
    }

    /// This chart, whatever is chosen.
    pub fn for_every_choice(self) -> Vec<(String, Lines)> {
        vec![(EVERY_CHOICE.to_owned(), self)]
    }

    /// Columns: every x that occurs, then each series at it, NaN where it has no point.
    fn columns(&self) -> Vec<Vec<f64>> {
        let mut x: Vec<f64> = self.series.iter().flat_map(|s| s.points.iter().map(|p| p[0])).collect();
        x.sort_by(f64::total_cmp);
        x.dedup();
        let mut columns = vec![x.clone()];
        for series in &self.series {
            let mut column = vec![f64::NAN; x.len()];
            for [at, y] in &series.points {
                // Two points of one series at one x (a jump) keep the later; series that jump are split by who makes
                // them.
                column[x.partition_point(|v| v < at)] = *y;
            }
            columns.push(column);
        }
        columns
    }
}

/// A field over a grid.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FieldMap {
    /// Nodes across, ascending.
    pub x: Vec<f64>,
    /// Nodes up, ascending.
    pub y: Vec<f64>,
    /// Values, row by row from the lowest; NaN where there is none.
    pub z: Vec<f64>,
}

/// A report.
#[derive(Debug, Clone, Default)]
pub struct Page {
    /// Title, for the browser's tab and the top of the page.
    pub title: String,
    /// Which command: `tables`, `validate`, …
    pub command_name: &'static str,
    /// Whether it can be relied on.
    pub status: Status,
    /// Further stamps.
    pub also: Vec<Status>,
    /// Reasons for the status, a sentence each.
    pub remarks: Vec<String>,
    /// The choices, at least one.
    pub choices: Vec<Choice>,
    /// Label of the selector.
    pub choice_is: &'static str,
    /// Answers, one for all or one to each choice.
    pub headlines: Vec<Headline>,
    /// Sections.
    pub sections: Vec<PageSection>,
    /// Drives in motion.
    pub animations: Vec<Animation>,
    /// Provenance of the page: name and value.
    pub provenance: Vec<(String, String)>,
    /// The results for programs, by name.
    pub results: Map<String, Value>,
}

/// Version of the JSON block.
pub(crate) const PAGE_SCHEMA: u32 = 1;

/// Beginning of the JSON block of a page.
const BLOCK: &str = "id=\"flexspline-report\">";

/// The command that wrote a page, of its text; nothing of what is none of ours.
pub fn command_of(html: &str) -> Option<String> {
    let (_, block) = html.split_once(BLOCK)?;
    let json: Value = serde_json::from_str(block.split_once("</script")?.0).ok()?;
    let command = json["report"].as_str()?;
    command.bytes().all(|letter| letter.is_ascii_lowercase()).then(|| command.to_owned())
}

/// Provenance of a page of a drive: the command, this program, the drive and its hash.
pub fn made_of_drive(command: &str, drive: &Drive) -> Vec<(String, String)> {
    [
        ("Command", command.to_owned()),
        ("Program", format!("flexspline {}", env!("CARGO_PKG_VERSION"))),
        ("Drive", drive.name.clone()),
        ("BLAKE3 of the drive", blake3::Hash::from(drive.hash()).to_hex().to_string()),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into()
}

#[derive(Template)]
#[template(path = "report.html")]
struct PageTemplate<'a> {
    page: &'a Page,
    numbered: Vec<(usize, &'a Figure)>,
    json: String,
    packed: Vec<Packed>,
    policy: String,
    style: &'a str,
    script: String,
    version: &'a str,
}

impl PageTemplate<'_> {
    fn number(&self, figure: &Figure) -> usize {
        self.numbered.iter().find(|(_, f)| f.id == figure.id).map_or(0, |(number, _)| *number)
    }
}

impl Page {
    /// The page, whole: one file that asks the network for nothing.
    pub fn html(&self) -> Result<String, askama::Error> {
        let figures = || {
            self.sections.iter().flat_map(|section| &section.blocks).filter_map(|block| match block {
                PageBlock::Figure(figure) => Some(figure),
                _ => None,
            })
        };
        let mut packed: Vec<Packed> = self.animations.iter().flat_map(Animation::pack).collect();
        let mut described = Map::new();
        for (number, figure) in (1..).zip(figures()) {
            let (value, arrays) = describe(number, figure);
            described.insert(figure.id.clone(), value);
            packed.extend(arrays);
        }
        let animations: Map<String, Value> = self.animations.iter().map(|a| (a.kind.to_string(), json!(a))).collect();
        let json = json!({
            "schema_version": PAGE_SCHEMA,
            "report": self.command_name,
            "title": self.title,
            "status": self.status.name(),
            "also": self.also.iter().map(|status| status.name()).collect::<Vec<_>>(),
            "remarks": self.remarks,
            "choices": self.choices,
            "results": self.results,
            "provenance": self.provenance.iter().cloned().collect::<std::collections::BTreeMap<_, _>>(),
            "figures": described,
            "animations": animations,
        });
        let script = SCRIPT.clone();
        PageTemplate {
            page: self,
            numbered: (1..).zip(figures()).collect(),
            // A script element ends at the first "</script", whatever surrounds it.
            json: serde_json::to_string(&json).expect("plain values").replace('<', "\\u003c"),
            packed,
            policy: assets::policy(STYLE.as_str(), &script),
            style: STYLE.as_str(),
            script,
            version: env!("CARGO_PKG_VERSION"),
        }
        .render()
    }
}

/// The description of a figure for the page's script, and its numbers.
fn describe(number: usize, figure: &Figure) -> (Value, Vec<Packed>) {
    let mut arrays = Vec::new();
    let mut value = match &figure.body {
        FigureBody::Drive => json!({ "kind": "drive" }),
        FigureBody::Sleeve => json!({ "kind": "sleeve" }),
        FigureBody::Svg(svg) => json!({ "kind": "svg", "svg": svg }),
        FigureBody::Lines { x, y, charts } => {
            for (choice, chart) in charts {
                let columns = chart.columns();
                let shape = [columns.len(), columns[0].len()];
                let name = format!("{choice}/{}", figure.id);
                arrays.push(Packed::floats(name, &shape, columns.into_iter().flatten()));
            }
            let charts: Map<String, Value> = charts.iter().map(|(id, chart)| (id.clone(), json!(chart))).collect();
            json!({ "kind": "lines", "x": x, "y": y, "charts": charts })
        }
        FigureBody::Field { x, y, z, fields } => {
            for (choice, FieldMap { x, y, z }) in fields {
                for (part, shape, values) in
                    [("x", vec![x.len()], x), ("y", vec![y.len()], y), ("z", vec![y.len(), x.len()], z)]
                {
                    let name = format!("{choice}/{}/{part}", figure.id);
                    arrays.push(Packed::floats(name, &shape, values.iter().copied()));
                }
            }
            let charts: Vec<&String> = fields.iter().map(|(choice, _)| choice).collect();
            json!({ "kind": "field", "x": x, "y": y, "z": z, "charts": charts })
        }
    };
    value["number"] = number.into();
    value["title"] = figure.title.as_str().into();
    (value, arrays)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOSTILE: &str = r#"</script><script>alert(1)</script>"'&{{1}}<!--"#;

    fn page(status: Status) -> Page {
        let series =
            ChartSeries { name: HOSTILE.into(), mark: Mark::Line, colour: 0, points: vec![[0.0, 1.0], [1.0, 3.0]] };
        let lines = Lines {
            series: vec![series],
            limits: vec![Limit { name: HOSTILE.into(), y: 2.0 }],
            uprights: vec![Upright { name: HOSTILE.into(), x: 0.5 }],
        };
        let figure = Figure {
            id: "figure".into(),
            title: HOSTILE.into(),
            caption: HOSTILE.into(),
            alt: HOSTILE.into(),
            body: FigureBody::Lines {
                x: ChartAxis::new(HOSTILE, PageQuantity::Torque).stretched(0.02),
                y: ChartAxis::new(HOSTILE, PageQuantity::Error),
                charts: vec![("one".into(), lines)],
            },
        };
        Page {
            title: HOSTILE.into(),
            command_name: "tables",
            status,
            also: Vec::new(),
            remarks: vec![HOSTILE.into()],
            choices: vec![Choice { id: "one".into(), name: HOSTILE.into() }],
            choice_is: "Generator",
            headlines: vec![Headline {
                choice: Some("one".into()),
                answer: RichText::new(HOSTILE).error(-12.345, 3),
                number: RichText::default().error(0.5, 2),
                number_is: HOSTILE.into(),
            }],
            sections: vec![PageSection {
                id: "section".into(),
                title: HOSTILE.into(),
                folded: false,
                blocks: vec![PageBlock::Figure(figure)],
            }],
            animations: Vec::new(),
            provenance: vec![(HOSTILE.into(), HOSTILE.into())],
            results: Map::from_iter([(HOSTILE.to_owned(), Value::from(HOSTILE))]),
        }
    }

    /// The text between the first `<script … id="flexspline-report">` and the next `</script`, as a browser ends it.
    fn json_block(html: &str) -> Value {
        let (_, after) = html.split_once(r#"id="flexspline-report">"#).unwrap();
        serde_json::from_str(after.split_once("</script").unwrap().0).unwrap()
    }

    #[test]
    fn hostile_text_is_text_wherever_it_stands() {
        let html = page(Status::Good).html().unwrap();
        // Outside our own script and style nothing of it is markup.
        assert_eq!(html.matches("<script>alert").count(), 0);
        assert_eq!(html.matches("<script").count(), 3, "JSON, one packed array, the module");
        assert_eq!(html.matches("<!--").count(), 0);
        let json = json_block(&html);
        assert_eq!(json["title"], HOSTILE);
        assert_eq!(json["figures"]["figure"]["charts"]["one"]["series"][0]["name"], HOSTILE);
        assert_eq!(json["results"][HOSTILE], HOSTILE);
    }

    #[test]
    fn a_page_says_of_itself_which_command_wrote_it() {
        assert_eq!(command_of(&page(Status::Good).html().unwrap()).as_deref(), Some("tables"));
        assert_eq!(command_of("<!doctype html><p>another page"), None);
        assert_eq!(command_of("id=\"flexspline-report\">{\"report\":\"../x\"}</script>"), None);
    }

    #[test]
    fn the_status_is_on_the_page_in_the_json_and_decides_the_command() {
        for (status, name, failure) in [
            (Status::Good, "good", false),
            (Status::Remark, "remark", false),
            (Status::Caution, "caution", false),
            (Status::DataFaults, "data faults", false),
            (Status::FaultFound, "fault found", false),
            (Status::NotUnderstood, "not understood", false),
            (Status::BoundMissed, "bound missed", true),
            (Status::NotConverged, "not converged", true),
        ] {
            let html = page(status).html().unwrap();
            assert_eq!(json_block(&html)["status"], name);
            assert!(html.contains(&format!(r#"class="stamp {}">{name}<"#, name.replace(' ', "-"))), "{name}");
            assert_eq!(status.is_failure(), failure);
        }
    }

    #[test]
    fn errors_carry_their_value_for_the_unit_switch() {
        let html = page(Status::Good).html().unwrap();
        assert!(html.contains(r#"<data class="error" value="-12.345" data-digits="3">−12.3″</data>"#));
    }

    #[test]
    fn words_are_filled_with_errors_and_what_is_left_of_the_words_stays() {
        let text = RichText::filled("from {} to {}, not {}", &[(1.5, 2), (-3.0, 3)]);
        let due = RichText::new("from ").error(1.5, 2).plain(" to ").error(-3.0, 3).plain(", not {}");
        assert_eq!(text, due);
    }

    #[test]
    fn figures_of_the_terminal_are_rows_with_their_unit() {
        let figure = |name: &str, unit, caveat: &str| NamedFigure {
            name: name.into(),
            value: 23.456,
            unit,
            decimals: 1,
            caveat: caveat.into(),
            what: "what it is".into(),
        };
        let figures = [figure("backlash", "arcsec", ""), figure("torque", "N·m", "a remark")];
        let PageBlock::Table { table, .. } = PageBlock::figures("caption", &figures) else { panic!("no table") };
        assert_eq!(table.rows[0], ["Backlash".into(), RichText::arcsec(23.456, 4), "what it is".into()]);
        assert_eq!(table.rows[1], ["Torque", "23.46\u{a0}N·m", "what it is; a remark"].map(RichText::from));
    }

    #[test]
    fn numbers_have_significant_digits() {
        for (value, digits, text) in
            [(0.0, 3, "0"), (12.345, 3, "12.3"), (-0.012345, 2, "−0.012"), (1234.5, 2, "1234"), (f64::NAN, 2, "–")]
        {
            assert_eq!(significant(value, digits), text);
        }
    }

    #[test]
    fn series_of_different_points_share_their_axis() {
        let of = |points: &[[f64; 2]]| ChartSeries {
            name: String::new(),
            mark: Mark::Line,
            colour: 0,
            points: points.into(),
        };
        let lines = Lines { series: vec![of(&[[0.0, 1.0], [2.0, 3.0]]), of(&[[1.0, 5.0]])], ..Lines::default() };
        let columns = lines.columns();
        assert_eq!(columns[0], [0.0, 1.0, 2.0]);
        assert!(columns[1][1].is_nan() && columns[1][2] == 3.0 && columns[2][1] == 5.0);
    }
}
