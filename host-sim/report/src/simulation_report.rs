//! The page of a run along a path: what was found, the error along the path, the loop over the torque, how the teeth
//! share the load, and the drive in motion where the path settles for a tooth pitch.

use std::f64::consts::TAU;
use std::ops::Range;

use serde_json::{Map, json};

use super::animation::{Animation, FRAMES, Passing, bore_forces, flank_forces};
use super::drive_figures::{
    BEARS, OfRow, STRESSES, STRESSES_ARE, apart, caution_words, drive_figure, less_mean, sharing_figure, sharing_lines,
    sheet_section, sleeve_figure, stress_figure, stress_lines,
};
use super::page::{
    Axis, Block, Choice, Detail, Field, Figure, FigureBody, Headline, Lines, Mark, Page, PageQuantity, Section, Series,
    Status, Table, Text, significant,
};
use super::study_report::{heading, value};
use flexspline_design::data_sheet::{FIGURES, FigureOf};
use flexspline_design::simulate::{Observation, Row, Simulation, Summary, TipContact, Told};
use flexspline_design::stated;
use flexspline_mechanics::drive::{Drive, GeneratorKind, Side};
use flexspline_mechanics::mesh::MeshError;

/// One-way stretches that each have a line of their own in a chart; of more, all of one way are dots of one colour.
const MOST_STRETCHES: usize = 6;
/// Columns of the map of the teeth at most: what a screen shows apart.
const MOST_COLUMNS: usize = 240;
/// Rows from which a map says more than a curve.
const ROWS_OF_A_MAP: usize = 4;
/// Rows of one stretch of the torque from which it is drawn as a curve: fewer are a load that is changed, not a test of
/// torsion.
const ROWS_OF_A_LOOP: usize = 3;
/// Teeth that a map shows beside the last that bears: that it ends there is then seen.
const TEETH_BESIDE: usize = 2;

/// What the page needs of a run beside its rows, gathered while it goes on.
pub struct Seen {
    passing: Passing,
    teeth: Vec<[Vec<f64>; 2]>,
    /// The row of the largest pressure between flanks so far: that pressure, the row's place, what the generator bears
    /// on each tooth.
    highest: (f64, usize, Vec<f64>),
}

impl Seen {
    /// Before the run.
    pub fn new(drive: &Drive) -> Seen {
        Seen { passing: Passing::new(drive), teeth: Vec::new(), highest: (f64::NEG_INFINITY, 0, Vec::new()) }
    }

    /// Looks at an increment of the run.
    pub fn add(&mut self, now: &Observation<'_>) {
        self.passing.see(now);
        let Some(row) = now.row else { return };
        let teeth = now.problem.flexspline.teeth;
        let mut flanks = [vec![0.0; teeth], vec![0.0; teeth]];
        for found in flank_forces(now.problem, now.state, |_| true) {
            flanks[usize::from(found.side == Side::Minus)][found.tooth] += length(found.force_n);
        }
        if row.peak_flank_pressure_mpa > self.highest.0 {
            let bore = bore_forces(now.problem, now.state, teeth).into_iter().map(length).collect();
            self.highest = (row.peak_flank_pressure_mpa, self.teeth.len(), bore);
        }
        self.teeth.push(flanks);
    }
}

fn length([x, y]: [f64; 2]) -> f64 {
    x.hypot(y)
}

/// Four digits that count, as text has them.
fn plain(value: f64) -> String {
    stated::short(value).replace('-', "−")
}

/// A run and what was seen of it.
struct RunKnown<'a> {
    drive: &'a Drive,
    kind: GeneratorKind,
    summary: &'a Summary,
    rows: &'a [Row],
    teeth: &'a [[Vec<f64>; 2]],
    highest: &'a (f64, usize, Vec<f64>),
    motion: Option<&'a Animation>,
}

/// The page of a run of `drive` with the generator `kind`.
///
/// # Errors
/// The drive has no sleeve that can be shown.
pub fn simulation_report(
    drive: &Drive,
    kind: GeneratorKind,
    simulation: &Simulation,
    seen: Seen,
) -> Result<Page, MeshError> {
    let Simulation { rows, summary } = simulation;
    let motion = seen.passing.finish()?;
    let known =
        RunKnown { drive, kind, summary, rows, teeth: &seen.teeth, highest: &seen.highest, motion: motion.as_ref() };
    let mut sections = vec![known.found()];
    sections.extend(summary.data_sheet.as_ref().and_then(|sheet| {
        let mut section = sheet_section(vec![(kind.to_string(), sheet.clone())])?;
        section.blocks.push(known.computed_sheet());
        Some(section)
    }));
    sections.extend([known.in_motion(), known.along_path()].into_iter().flatten());
    sections.push(known.load());
    sections.push(known.reading());
    let remarks: Vec<String> = summary.cautions.iter().map(|caution| format!("{}.", caution_words(caution))).collect();
    Ok(Page {
        title: format!("{} along a path", drive.name),
        command_name: "simulate",
        status: if remarks.is_empty() { Status::Good } else { Status::Caution },
        also: Vec::new(),
        remarks,
        choices: vec![Choice { id: kind.to_string(), name: kind.in_words().to_owned() }],
        choice_is: "Generator",
        headlines: vec![known.headline()],
        sections,
        provenance: known.provenance(),
        results: Map::from_iter([("simulate".to_owned(), json!(summary))]),
        animations: motion.into_iter().collect(),
    })
}

impl RunKnown<'_> {
    fn headline(&self) -> Headline {
        let (summary, name) = (self.summary, self.kind.in_words());
        let ripples = |text: Text| match summary.kinematic_error_pp_arcsec {
            Some(arcsec) => text.plain("; turning, its error ripples by ").error(arcsec, 3).plain(" peak to peak."),
            None => text.plain("."),
        };
        let errors = || self.rows.iter().map(|row| row.error_arcsec);
        if let Some(tips) = summary.tip_contact.filter(TipContact::counts) {
            return Headline {
                choice: None,
                answer: Text::new(format!("In the {name} drive {}.", tips.in_words().replace(" deg", "°"))),
                number: Text::new(format!("{:.1} %", 100.0 * tips.share)),
                number_is: "of the load on tips that should pass freely".into(),
            };
        }
        let (answer, number, number_is) = if let Some(backlash) = summary.backlash_arcsec {
            let answer = Text::new(format!("Without load the {name} drive has a backlash of ")).error(backlash, 3);
            (ripples(answer), backlash, "backlash at the output")
        } else if let (Some(wind_up), Some(torque)) = (summary.wind_up_arcsec, summary.torque_n_m) {
            let answer = Text::new(format!("Under {} N·m the {name} drive is wound up by ", plain(torque)))
                .error(wind_up, 3)
                .plain(" from the middle of its backlash");
            let answer = match summary.wind_up_elastic_arcsec {
                Some(elastic) => answer.plain(", ").error(elastic, 3).plain(" of it elastic"),
                None => answer,
            };
            (ripples(answer), wind_up, "wind-up from mid-backlash")
        } else if let Some(ripple) = summary.kinematic_error_pp_arcsec {
            let answer = Text::new(format!("Turning one way, the error of the {name} drive ripples by "));
            (answer.error(ripple, 3).plain(" peak to peak."), ripple, "kinematic error, peak to peak")
        } else {
            let (low, high) = (errors().fold(f64::INFINITY, f64::min), errors().fold(f64::NEG_INFINITY, f64::max));
            let answer = Text::new(format!("Along the path the output of the {name} drive is off by ")).error(low, 3);
            let answer = if low < high { answer.plain(" to ").error(high, 3) } else { answer };
            (answer.plain("."), if high.abs() < low.abs() { low } else { high }, "largest error along the path")
        };
        let number = Text::default().error(number, 3);
        Headline { choice: None, answer, number, number_is: number_is.into() }
    }

    /// The figures of the summary.
    fn found(&self) -> Section {
        let row = |told: Told| {
            let unit = told.unit.replace("N.m", "N·m");
            let number = match told.unit {
                "arcsec" => Text::default().error(told.value, 4),
                "" => Text::new(significant(told.value, 3)),
                _ => Text::new(format!("{}\u{a0}{unit}", significant(told.value, 4))),
            };
            let comma = if told.caveat.is_empty() { "" } else { "; " };
            let mut name = told.name;
            name[..1].make_ascii_uppercase();
            vec![Text::new(name), number, Text::new(format!("{}{comma}{}", told.what, told.caveat))]
        };
        let load = match (self.summary.torque_n_m, self.summary.temperature_c) {
            (Some(torque), Some(celsius)) => format!("{} N·m, {} °C", plain(torque), plain(celsius)),
            (None, Some(celsius)) => format!("loads of the path, {} °C", plain(celsius)),
            (Some(torque), None) => format!("{} N·m, temperatures of the path", plain(torque)),
            (None, None) => "loads and temperatures of the path".to_owned(),
        };
        let table = Table {
            caption: format!("{} with {} generator: {load}", self.drive.name, self.kind.in_words()),
            header: ["Figure", "Value", "What it is"].map(str::to_owned).into(),
            rows: self.summary.told().into_iter().map(row).collect(),
        };
        Section {
            id: "found".into(),
            title: "What was found".into(),
            detail: Detail::Summary,
            blocks: vec![Block::Table { choice: None, table }],
        }
    }

    /// All that a catalogue prints, computed at the loads of the drive's data sheet.
    fn computed_sheet(&self) -> Block {
        let sheet = self.summary.data_sheet.as_ref().map(|beside| beside.sheet).unwrap_or_default();
        let row = |(name, of): &FigureOf| Some(vec![Text::new(heading(name)), value(name, Some(of(&sheet)?))]);
        let table = Table {
            caption: "What a catalogue prints, all that was computed, at the same loads".into(),
            header: ["Figure", "computed"].map(str::to_owned).into(),
            rows: FIGURES.iter().filter_map(row).collect(),
        };
        Block::Table { choice: None, table }
    }

    /// The drive in motion, where the path passes a whole pitch.
    fn in_motion(&self) -> Option<Section> {
        let motion = self.motion?;
        let way = if motion.rows[0].turn_rad > 0.0 { "forward" } else { "backward" };
        let load = format!("under {} N·m, turning {way}", plain(motion.torque_n_m));
        let series = Series {
            name: format!("{} N·m {way}", plain(motion.torque_n_m)),
            mark: Mark::Line,
            colour: 0,
            points: less_mean(motion),
        };
        let ripple = Figure {
            id: "ripple".into(),
            title: "Error over one tooth pitch, less its mean".into(),
            caption: Text::new(
                "Output angle less generator angle over the ratio, the states that figure 1 shows: it repeats with \
                 every pitch of the flexspline. The mean is ",
            )
            .error(motion.error_arcsec.iter().sum::<f64>() / FRAMES as f64, 4)
            .plain("."),
            alt: "Curve of the output error over one tooth pitch of the generator".into(),
            body: FigureBody::Lines {
                x: Axis::linked("Generator from the beginning of a pitch"),
                y: Axis::new("Output error less mean", PageQuantity::Error),
                charts: self.chart(Lines { series: vec![series], ..Lines::default() }),
            },
        };
        let mut blocks = vec![
            Block::Figure(drive_figure(&load)),
            Block::Figure(ripple),
            Block::Figure(stress_figure(self.chart(stress_lines(motion)))),
            Block::Figure(sharing_figure(self.chart(sharing_lines(motion)))),
        ];
        blocks.extend(motion.sleeve.as_ref().map(|_| Block::Figure(sleeve_figure())));
        let (id, title) = ("motion".to_owned(), "The drive at work".to_owned());
        Some(Section { id, title, detail: Detail::Summary, blocks })
    }

    /// A chart of the one choice.
    fn chart(&self, lines: Lines) -> Vec<(String, Lines)> {
        vec![(self.kind.to_string(), lines)]
    }

    /// Whether all of the path is in the pitch that is shown in motion.
    fn is_all_in_motion(&self) -> bool {
        let Some(motion) = self.motion else { return false };
        let turn = |rows: &[Row]| rows.iter().map(|row| row.turn_rad.abs()).sum::<f64>();
        turn(self.rows) < 1.5 * std::f64::consts::TAU / f64::from(self.drive.flexspline.teeth)
            && motion.rows.len() <= self.rows.len()
    }

    /// The error along the path: over the generator, and over the torque where that goes through a range.
    fn along_path(&self) -> Option<Section> {
        let error = |row: &Row| row.error_arcsec;
        let figure = |id: &str, title: &str, caption: &str, x: Axis, lines: Lines| {
            Block::Figure(Figure {
                id: id.into(),
                title: title.into(),
                caption: Text::new(caption),
                alt: format!("Curves: {}", title.to_lowercase()),
                body: FigureBody::Lines {
                    x,
                    y: Axis::new("Output error", PageQuantity::Error),
                    charts: self.chart(lines),
                },
            })
        };
        let mut blocks = Vec::new();
        let turns = one_way(self.rows, |row| row.generator_rad);
        // Rows between those that are shown in motion say more of the ripple.
        if !turns.is_empty() && self.motion.is_none_or(|motion| motion.rows.len() < self.rows.len()) {
            let series =
                of_stretches(self.rows, &turns, |row| row.generator_rad.to_degrees(), error, ["forward", "backward"]);
            blocks.push(figure(
                "error",
                "Error over the generator angle",
                "Output angle less generator angle over the ratio; positive when the output leads. A line to each \
                 stretch in which the generator goes one way, as far as there are few. Where it turns back without \
                 load the output stands until the clearance is crossed.",
                Axis::new("Generator", PageQuantity::Degree),
                Lines { series, ..Lines::default() },
            ));
        }
        let loads = one_way(self.rows, |row| row.torque_n_m);
        if loads.iter().any(|(_, stretch)| stretch.len() >= ROWS_OF_A_LOOP) {
            let words = ["torque growing", "torque falling"];
            let series = of_stretches(self.rows, &loads, |row| row.torque_n_m, error, words);
            blocks.push(figure(
                "torsion",
                "Error over the torque",
                "The torsion of the output, its clearance included, as a torsion test draws it: the slope is the \
                 compliance, and what lies between growing and falling torque is lost to friction and drag. A \
                 positive torque turns the output forward.",
                Axis::new("Load torque", PageQuantity::Torque),
                Lines { series, ..Lines::default() },
            ));
        }
        let (id, title) = ("path".to_owned(), "Along the path".to_owned());
        (!blocks.is_empty()).then_some(Section { id, title, detail: Detail::Summary, blocks })
    }

    /// How the teeth share the load along the path, stress, pressures, contacts, the torque of the generator.
    fn load(&self) -> Section {
        let mut blocks = Vec::new();
        if self.motion.is_none() {
            blocks.push(Block::Figure(self.sharing_at_a_row()));
        }
        if self.rows.len() > 1 {
            let (axis, places) = self.along();
            let curves = |id: &str, title: &str, caption: &str, y: Axis, of: &[OfRow]| {
                let series = of.iter().enumerate().map(|(colour, (name, of))| Series {
                    name: (*name).to_owned(),
                    mark: Mark::Line,
                    colour,
                    points: places.iter().map(|(x, k)| [*x, of(&self.rows[*k])]).collect(),
                });
                let charts = self.chart(Lines { series: series.collect(), ..Lines::default() });
                Block::Figure(Figure {
                    id: id.into(),
                    title: title.into(),
                    caption: Text::new(caption),
                    alt: format!("Curves: {}", title.to_lowercase()),
                    body: FigureBody::Lines { x: axis.clone(), y, charts },
                })
            };
            if !self.is_all_in_motion() {
                blocks.extend(self.map(&axis, &places).map(Block::Figure));
                let caption = format!("Of every row. {STRESSES_ARE}");
                let title = "Largest stress and pressures along the path";
                let y = Axis::new("Stress, pressure", PageQuantity::Stress);
                blocks.push(curves("path-stress", title, &caption, y, &STRESSES));
            }
            blocks.push(curves(
                "contacts",
                "Flanks that carry load",
                "Of both lobes together.",
                Axis::new("Tooth flanks", PageQuantity::Whole),
                &[("tooth flanks", |row| row.flank_contacts as f64)],
            ));
            blocks.push(curves(
                "generator-torque",
                "Torque of the generator",
                "On the flexspline, quasi-static: what is left of it beside the load over the ratio is friction and \
                 drag, and what the teeth store from place to place. Positive turns the generator forward.",
                Axis::new("Torque of the generator", PageQuantity::Torque),
                &[("generator", |row| row.generator_torque_n_m)],
            ));
        }
        Section { id: "load".into(), title: "Load and stress".into(), detail: Detail::Engineering, blocks }
    }

    /// What the rows are drawn over, and the places of the rows, ascending: generator or torque where that goes one way
    /// all along, else the step.
    fn along(&self) -> (Axis, Vec<(f64, usize)>) {
        let goes_one_way = |of: fn(&Row) -> f64| matches!(one_way(self.rows, of).as_slice(), [(_, stretch)] if stretch.len() == self.rows.len());
        let (axis, of): (Axis, fn(&Row) -> f64) = if goes_one_way(|row| row.generator_rad) {
            (Axis::new("Generator", PageQuantity::Degree), |row| row.generator_rad.to_degrees())
        } else if goes_one_way(|row| row.torque_n_m) {
            (Axis::new("Load torque", PageQuantity::Torque), |row| row.torque_n_m)
        } else {
            (Axis::new("Step, as in results.csv", PageQuantity::Whole), |row| row.step as f64)
        };
        let mut places: Vec<(f64, usize)> = self.rows.iter().map(of).zip(0..).collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        (axis, places)
    }

    /// Of every tooth its angle from the major axis, degrees, ascending from -90 so that no lobe is cut, and the tooth,
    /// at a row.
    fn around_major_axis(&self, row: &Row) -> Vec<(f64, usize)> {
        let teeth = i64::from(self.drive.flexspline.teeth);
        let pitch = TAU / teeth as f64;
        let nearest = (row.generator_rad / pitch).round() as i64;
        (-teeth / 4..teeth - teeth / 4)
            .map(|k| {
                let angle = pitch * (k + nearest) as f64 - row.generator_rad;
                (angle.to_degrees(), (k + nearest).rem_euclid(teeth) as usize)
            })
            .collect()
    }

    /// Whether one half of the ring says all: the other lobe carries the same.
    fn is_half_enough(&self) -> bool {
        let Drive { flexspline, circular_spline, as_built, .. } = self.drive;
        as_built.first_not_uniform().is_none()
            && flexspline.teeth.is_multiple_of(2)
            && circular_spline.teeth.is_multiple_of(2)
    }

    /// What bears on every tooth at the row of the largest pressure between flanks.
    fn sharing_at_a_row(&self) -> Figure {
        let (_, at, bore) = self.highest;
        let row = &self.rows[*at];
        let places = self.around_major_axis(row);
        let series = |colour: usize, mark, of: &dyn Fn(usize) -> f64| Series {
            name: BEARS[colour].into(),
            mark,
            colour,
            points: places.iter().map(|(x, tooth)| [*x, of(*tooth)]).collect(),
        };
        let flank = |side: usize| {
            move |tooth: usize| Some(self.teeth[*at][side][tooth]).filter(|n| *n > 0.0).unwrap_or(f64::NAN)
        };
        let lines = Lines {
            series: vec![
                series(0, Mark::Points, &flank(0)),
                series(1, Mark::Points, &flank(1)),
                series(2, Mark::Dashed, &|tooth| bore[tooth]),
            ],
            ..Lines::default()
        };
        Figure {
            id: "sharing".into(),
            title: "How the teeth share the load".into(),
            caption: Text::new(format!(
                "Force on each flexspline tooth by its angle from the major axis, at step {}, where the pressure \
                 between flanks is largest ({} N·m, generator at {}°): of each flank that bears, and of the generator \
                 on the piece of bore under the tooth.",
                row.step,
                plain(row.torque_n_m),
                plain(row.generator_rad.to_degrees()),
            )),
            alt: "Points of the force on every tooth over its angle from the major axis".into(),
            body: FigureBody::Lines {
                x: Axis::new("Tooth from the major axis", PageQuantity::Degree),
                y: Axis::new("Force", PageQuantity::Force),
                charts: self.chart(lines),
            },
        }
    }

    /// The force on the teeth in colour along the path, where it is long enough and any tooth bears.
    fn map(&self, axis: &Axis, places: &[(f64, usize)]) -> Option<Figure> {
        let groups: Vec<&[(f64, usize)]> = places.chunks(places.len().div_ceil(MOST_COLUMNS)).collect();
        let teeth = self.drive.flexspline.teeth as usize;
        let lines = if self.is_half_enough() { teeth / 2 } else { teeth };
        let mut forces = vec![vec![f64::NAN; groups.len()]; lines];
        for (column, (_, k)) in
            groups.iter().enumerate().flat_map(|(column, group)| group.iter().map(move |at| (column, at)))
        {
            for ((_, tooth), line) in self.around_major_axis(&self.rows[*k]).into_iter().zip(&mut forces) {
                let [plus, minus] = [0, 1].map(|side| self.teeth[*k][side][tooth]);
                // Of a group of rows the largest: single rows of it would beat with the teeth.
                let (force, known) = (plus - minus, line[column]);
                if (plus > 0.0 || minus > 0.0) && (known.is_nan() || force.abs() > known.abs()) {
                    line[column] = force;
                }
            }
        }
        // Beyond the teeth that bear there is nothing to see.
        let bears = |line: &Vec<f64>| line.iter().any(|force| force.is_finite());
        let first = forces.iter().position(bears)?.saturating_sub(TEETH_BESIDE);
        let last = (forces.iter().rposition(bears)? + TEETH_BESIDE).min(lines - 1);
        let angle = |line: usize| 360.0 / teeth as f64 * (line as f64 - (teeth / 4) as f64);
        let field = Field {
            x: groups.iter().map(|group| group[group.len() / 2].0).collect(),
            y: (first..=last).map(angle).collect(),
            z: forces[first..=last].concat(),
        };
        let most = if groups.len() < places.len() {
            format!(" A column has the largest of {} rows.", groups[0].len())
        } else {
            String::new()
        };
        let lobes = if self.is_half_enough() { " The other lobe carries the same." } else { "" };
        (self.rows.len() >= ROWS_OF_A_MAP).then(|| Figure {
            id: "map".into(),
            title: "Which teeth bear along the path".into(),
            caption: Text::new(format!(
                "Force on each flexspline tooth: positive on its {}, negative on its {}. Teeth that bear nothing are \
                 left out; the angle is that from the major axis, to half a tooth.{most}{lobes}",
                BEARS[0], BEARS[1]
            )),
            alt: "Colour map of the force on the teeth over the path and their angle from the major axis".into(),
            body: FigureBody::Field {
                x: axis.clone(),
                y: Axis::new("Tooth from the major axis", PageQuantity::Degree),
                z: Axis::new("Force on the tooth", PageQuantity::Force),
                fields: vec![(self.kind.to_string(), field)],
            },
        })
    }

    fn reading(&self) -> Section {
        let motion = if self.motion.is_some() {
            "The drive in motion is made of the first tooth pitch of the path on which it had settled under one load, \
             at eighths of the pitch."
        } else {
            "There is no drive in motion: the path has no settled tooth pitch with rows at its eighths, as pitch and \
             turn have, or the drive differs from tooth to tooth."
        };
        Section::reading(vec![
            Block::paragraph(
                "Error: output angle less generator angle over the ratio; positive when the output leads. The \
                 flexspline is fixed, the circular spline is the output. Forward is growing generator angle. Every \
                 row of the path is in results.csv.",
            ),
            Block::paragraph(
                "Plane strain, quasi-static: no inertia, no lubricant, no speed. What is settled, and how means are \
                 taken, is in summary.json's documentation: a figure that the path cannot give is left out.",
            ),
            Block::paragraph(motion),
        ])
    }

    fn provenance(&self) -> Vec<(String, String)> {
        let summary = self.summary;
        let fem = format!(
            "{} solver, {} mesh, {} degrees of freedom, {} increments, residual at most {:.1e}",
            summary.solver, summary.mesh, summary.degrees_of_freedom, summary.increments, summary.residual_worst
        );
        [
            ("Command", summary.command.clone()),
            ("Program", format!("flexspline {}", summary.tool_version)),
            ("Drive", summary.drive.clone()),
            ("BLAKE3 of the drive", summary.drive_hash.clone()),
            ("Path", format!("{}, {} rows", summary.path, summary.rows)),
            ("FEM", fem),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into()
    }
}

/// Stretches of at least two rows in which `x` goes one way, and whether it grows. Each begins where the one before
/// ended, unless something else than `x` changed there.
fn one_way(rows: &[Row], x: impl Fn(&Row) -> f64) -> Vec<(bool, Range<usize>)> {
    let mut found: Vec<(bool, Range<usize>)> = Vec::new();
    for k in 1..rows.len() {
        let step = x(&rows[k]) - x(&rows[k - 1]);
        match found.last_mut() {
            _ if step == 0.0 => {}
            Some((grows, stretch)) if *grows == (step > 0.0) && stretch.end == k => stretch.end = k + 1,
            _ => found.push((step > 0.0, k - 1..k + 1)),
        }
    }
    found
}

/// Stretches as lines, solid where `x` grows and dashed where it falls; many of them as dots of two colours.
fn of_stretches(
    rows: &[Row],
    stretches: &[(bool, Range<usize>)],
    x: impl Fn(&Row) -> f64,
    y: impl Fn(&Row) -> f64,
    [growing, falling]: [&str; 2],
) -> Vec<Series> {
    let ascending = |rows: &mut dyn Iterator<Item = &Row>| {
        // Two ways pass the same places but for rounding; a page has them in single precision, where they are one.
        let mut points: Vec<[f64; 2]> = rows.map(|row| [f64::from(x(row) as f32), y(row)]).collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points
    };
    if stretches.len() > MOST_STRETCHES {
        let of_way = |(colour, (name, way)): (usize, (&str, bool))| {
            let of_it = stretches.iter().filter(|(grows, _)| *grows == way);
            let points = apart(ascending(&mut of_it.flat_map(|(_, stretch)| &rows[stretch.clone()])));
            Series { name: name.to_owned(), mark: Mark::Dots, colour, points }
        };
        return [(growing, true), (falling, false)].into_iter().enumerate().map(of_way).collect();
    }
    let one_load = |rows: &[Row]| rows.iter().all(|row| row.torque_n_m == rows[0].torque_n_m);
    let mut series: Vec<Series> = Vec::new();
    for (colour, (grows, stretch)) in stretches.iter().enumerate() {
        let rows_of_it = &rows[stretch.clone()];
        let mut name = (if *grows { growing } else { falling }).to_owned();
        if !one_load(rows) && one_load(rows_of_it) {
            name += &format!(", {} N·m", plain(rows_of_it[0].torque_n_m));
        }
        let namesakes = series.iter().filter(|known| known.name.split(" (").next() == Some(&name)).count();
        if namesakes > 0 {
            name += &format!(" ({})", namesakes + 1);
        }
        let mark = if *grows { Mark::Line } else { Mark::Dashed };
        series.push(Series { name, mark, colour, points: ascending(&mut rows_of_it.iter()) });
    }
    series
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use flexspline_design::simulate::{Path, PathPoint, SimulationSettings, simulate};
    use flexspline_mechanics::mesh::MeshLevel;
    use flexspline_mechanics::stepping::{Method, SolverSettings};

    /// Generator there and back without load, then a torque at rest that comes and goes.
    #[test]
    fn ways_are_told_apart_and_the_teeth_that_bear_hold_the_load() {
        let drive = Drive::hhd_95();
        let turns = [0.0, 0.01, 0.02, 0.01, 0.0].map(|angle| (angle, 0.0));
        let loads = [5.0, 10.0, 5.0, -10.0].map(|torque| (0.0, torque));
        let points = [turns.as_slice(), &loads].concat();
        let point = |(generator_rad, torque): &(f64, f64)| PathPoint {
            generator_rad: *generator_rad,
            torque_n_m: Some(*torque),
            temperature_c: None,
        };
        let path = Path::Points(points.iter().map(point).collect());
        let solver = SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() };
        let settings = SimulationSettings { solver, ..SimulationSettings::new(GeneratorKind::Cam, path) };
        let mut seen = Seen::new(&drive);
        let run = simulate(&drive, &settings, &mut |now| {
            seen.add(now);
            ControlFlow::Continue(())
        })
        .unwrap();
        // A way back begins where the way there ended; what the torque does at rest is no way of the generator.
        let turns = one_way(&run.rows, |row| row.generator_rad);
        assert_eq!(turns, [(true, 0..3), (false, 2..5)]);
        assert_eq!(one_way(&run.rows, |row| row.torque_n_m), [(true, 4..7), (false, 6..9)]);
        let drawn = |stretches: &[(bool, Range<usize>)]| {
            of_stretches(&run.rows, stretches, |row| row.generator_rad, |row| row.error_arcsec, ["there", "back"])
        };
        let series = drawn(&turns);
        assert_eq!((series[1].name.as_str(), series[1].mark), ("back, 0 N·m", Mark::Dashed));
        assert_eq!(series[1].points.iter().map(|p| p[0] as f32).collect::<Vec<_>>(), [0.0, 0.01, 0.02], "ascending");
        // So many that lines would hide one another are dots, each of which keeps its place in a table.
        let many = drawn(&[turns.as_slice(); 4].concat());
        assert_eq!(many.iter().map(|s| (s.mark, s.points.len())).collect::<Vec<_>>(), [(Mark::Dots, 12); 2]);
        assert!(many[0].points.windows(2).all(|pair| pair[0][0] < pair[1][0]));

        // A forward load is borne by flanks towards falling angles, a backward one by the others: together a little
        // more than the load over the radius, since flanks lean by some 20 to 30 degrees.
        let radius_m = 1e-3 * drive.flexspline.root_radius_mm;
        for (at, bears) in [(6, 1), (8, 0)] {
            let sum = |side: usize| seen.teeth[at][side].iter().sum::<f64>();
            let of_load = sum(bears) / (10.0 / radius_m);
            assert!((1.0..1.25).contains(&of_load), "{of_load} at row {at}");
            assert!(sum(1 - bears) < 0.02 * sum(bears), "{} N on the other flanks at row {at}", sum(1 - bears));
        }
        let page = simulation_report(&drive, GeneratorKind::Cam, &run, seen).unwrap();
        let figure = |id: &str| {
            page.sections.iter().flat_map(|section| &section.blocks).find_map(|block| match block {
                Block::Figure(figure) if figure.id == id => Some(&figure.body),
                _ => None,
            })
        };
        let Some(FigureBody::Field { fields, .. }) = figure("map") else { panic!("no map") };
        let field = &fields[0].1;
        let column = |at: usize| field.z.iter().skip(at).step_by(run.rows.len()).filter(|force| force.is_finite());
        // Signs diverge about zero; of a drive whose lobes are alike one is shown, and the teeth that bear lie near its
        // middle.
        assert!(column(6).all(|force| *force <= 0.0) && column(8).all(|force| *force >= 0.0));
        let bearing: Vec<f64> = (0..field.y.len())
            .filter(|line| field.z[line * run.rows.len() + 6] < -1.0)
            .map(|line| field.y[line])
            .collect();
        assert!(!bearing.is_empty() && bearing.iter().all(|angle| angle.abs() < 60.0), "{bearing:?}");
    }
}
