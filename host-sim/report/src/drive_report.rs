//! The page of a drive and its tables: what `tables` and `validate` write.

use std::f64::consts::TAU;

use flexspline::{Direction, GeneratorAngle, Table};
use serde_json::{Map, Value, json};

use super::animation::{Animation, AnimationError, FRAMES};
use super::drive_figures::{
    apart, caution_words, drive_figure, less_mean, mean_arcsec, sharing_figure, sharing_lines, sheet_section,
    sizes_section, sleeve_figure, stress_figure, stress_lines,
};
use super::page::{
    ChartAxis, ChartSeries, Choice, Headline, Limit, Lines, Mark, Page, PageBlock, PageQuantity, PageSection, RichText,
    SIGNS, Status, made_of_drive, significant,
};
use flexspline_base::robust::{least_and_most, rms};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::stated::{TWO_SETS_OF_K, short};
use flexspline_design::tables::validate::{MAX_BOUND_ARCSEC, Point, Validation};
use flexspline_design::tables::{Source, TableInfo};
use flexspline_mechanics::drive::{Drive, GeneratorKind};

/// Positions over a pitch at which tables are read for curves and means.
const POSITIONS: usize = 48;
/// Torques between neighbouring nodes at which curves over the torque are read.
const BETWEEN_NODES: usize = 4;

/// Both ways of the generator: what a legend calls each, and how it is drawn.
const WAYS: [(Direction, &str, Mark); 2] =
    [(Direction::Forward, "forward", Mark::Line), (Direction::Backward, "backward", Mark::Dashed)];

/// A table and what is known of it.
pub struct DriveSubject<'a> {
    /// Which generator.
    pub kind: GeneratorKind,
    /// The table.
    pub table: Table<'a>,
    /// Its record, if it was made just now.
    pub info: Option<&'a TableInfo>,
    /// How it did against fresh FEM.
    pub validation: Option<&'a Validation>,
    /// The drive in motion, by fresh FEM.
    pub animation: Result<Animation, AnimationError>,
}

/// Inputs of the page.
pub struct DriveSources<'a> {
    /// The drive.
    pub drive: &'a Drive,
    /// `tables` or `validate`.
    pub command_name: &'static str,
    /// The command line.
    pub command: &'a str,
    /// Further provenance: name and value.
    pub inputs: Vec<(String, String)>,
    /// The tables.
    pub subjects: Vec<DriveSubject<'a>>,
}

/// The load at which a drive is shown in motion: half of what its table spans.
pub fn shown_torque_n_m(table: &Table<'_>) -> f64 {
    0.5 * f64::from(table.torque_range_n_m()[1])
}

/// A subject with what is derived from it.
struct DriveKnown<'a> {
    subject: DriveSubject<'a>,
    drive: &'a Drive,
    /// Temperature of curves, °C: the drive's reference, within the table's range.
    temperature: f32,
    /// Table against the frames of the animation: root mean square and largest, arcsec.
    fresh: Option<[f64; 2]>,
    largest_error: f64,
}

impl<'a> DriveKnown<'a> {
    fn new(subject: DriveSubject<'a>, drive: &'a Drive) -> DriveKnown<'a> {
        let [cold, warm] = subject.table.temperature_range_c();
        let temperature = (drive.temperature.reference_c as f32).clamp(cold, warm);
        let mut known = DriveKnown { subject, drive, temperature, fresh: None, largest_error: 0.0 };
        known.fresh = known.check_fresh();
        known.largest_error = known
            .torques()
            .iter()
            .flat_map(|t| [Direction::Forward, Direction::Backward].map(|d| known.mean(*t, known.temperature, d)))
            .fold(0.0, |largest, e| largest.max(e.abs()));
        known
    }

    fn id(&self) -> String {
        self.subject.kind.to_string()
    }

    /// Of a table made from FEM: from elsewhere it need not agree with the FEM of this drive.
    fn is_fem(&self) -> bool {
        self.subject.info.is_none_or(|info| matches!(info.source, Source::Fem { .. }))
    }

    /// Generator angle of a position of a pitch, rad.
    fn position(&self, k: usize) -> f64 {
        TAU / f64::from(self.drive.flexspline.teeth) * k as f64 / POSITIONS as f64
    }

    /// Output error in steady motion by the table, arcsec; NaN where it gives none.
    fn error(&self, generator_rad: f64, torque: f32, temperature: f32, direction: Direction) -> f64 {
        GeneratorAngle::from_rad(generator_rad)
            .and_then(|angle| self.subject.table.steady_error_rad(angle, torque, temperature, direction))
            .map_or(f64::NAN, |rad| f64::from(rad) * ARCSEC_PER_RAD)
    }

    /// The mean of it over a pitch.
    fn mean(&self, torque: f32, temperature: f32, direction: Direction) -> f64 {
        let errors = (0..POSITIONS).map(|k| self.error(self.position(k), torque, temperature, direction));
        errors.sum::<f64>() / POSITIONS as f64
    }

    /// Torques at which curves over the torque are read: the nodes and some between them.
    fn torques(&self) -> Vec<f32> {
        let nodes: Vec<f32> = self.subject.table.torque_nodes_n_m().collect();
        let mut all: Vec<f32> = nodes
            .windows(2)
            .flat_map(|pair| {
                (0..BETWEEN_NODES).map(|k| pair[0] + (pair[1] - pair[0]) * k as f32 / BETWEEN_NODES as f32)
            })
            .collect();
        all.extend(nodes.last());
        all
    }

    /// The table against the frames of the animation, which made no table.
    fn check_fresh(&self) -> Option<[f64; 2]> {
        // What a data sheet added is known from what made the table alone.
        let compares = self.is_fem() && (self.subject.info.is_some() || self.subject.table.sheet_scatter().is_none());
        let animation = self.subject.animation.as_ref().ok().filter(|_| compares)?;
        let misses: Vec<f64> = animation
            .rows
            .iter()
            .map(|row| {
                let table =
                    self.error(row.generator_rad, row.torque_n_m as f32, row.temperature_c as f32, Direction::Forward);
                let added = self.subject.info.and_then(|info| info.completed.as_ref());
                let added_rad = added.map_or(0.0, |added| added.spring.torsion_rad(row.torque_n_m));
                table - row.error_arcsec - added_rad * ARCSEC_PER_RAD
            })
            .collect();
        Some([rms(&misses), misses.iter().fold(0.0, |worst, m| f64::max(worst, m.abs()))])
    }

    fn headline(&self) -> Headline {
        let name = self.subject.kind.in_words();
        let uncorrected = format!(
            "Uncorrected, the {name} drive is off by up to {{}} at {} N·m; ",
            short(self.subject.table.torque_range_n_m()[1].into())
        );
        let headline = if let Some(v) = self.subject.validation {
            let answer = format!(
                "The {name} table misses fresh contact FEM by {{}} rms, where the drive without a table is off by {{}}."
            );
            Headline::new(
                RichText::filled(&answer, &[(v.rms_arcsec, 2), (v.uncompensated_rms_arcsec, 3)]),
                RichText::arcsec(v.max_arcsec, 2),
                format!("largest miss at {} points that made no table", v.points.len()),
            )
        } else if let Some([_, worst]) = self.fresh {
            let answer = uncorrected + "its table predicts the output to within {} of fresh FEM.";
            Headline::new(
                RichText::filled(&answer, &[(self.largest_error, 3), (worst, 2)]),
                RichText::arcsec(worst, 2),
                format!(
                    "largest miss at {FRAMES} FEM points that made no table ({} N·m, {:.0} °C, forward)",
                    short(shown_torque_n_m(&self.subject.table)),
                    self.temperature
                ),
            )
        } else {
            let worst = f64::from(self.subject.table.projection_worst_rad()) * ARCSEC_PER_RAD;
            let answer = uncorrected
                + "the error with its table is not measured here. It holds the samples that made it to {}, which \
                   says nothing of other points.";
            Headline::new(
                RichText::filled(&answer, &[(self.largest_error, 3), (worst, 2)]),
                RichText::arcsec(self.largest_error, 3),
                "largest error without a table; with one, see validate, or replay on rows that made none",
            )
        };
        Headline { choice: Some(self.id()), ..headline }
    }

    /// Torques whose ripple is shown: the lightest load, what the animation has, the largest.
    fn shown_torques(&self) -> Vec<f32> {
        let largest = self.subject.table.torque_range_n_m()[1];
        let light = (2.5 * self.drive.output.drag_torque_n_m as f32).max(1e-3 * largest);
        vec![light, 0.5 * largest, largest]
    }

    fn ripple(&self) -> Lines {
        let mut lines = Lines::default();
        for (colour, torque) in self.shown_torques().into_iter().enumerate() {
            for (direction, word, mark) in WAYS {
                let mean = self.mean(torque, self.temperature, direction);
                let points = (0..=POSITIONS).map(|k| {
                    let angle = self.position(k);
                    [angle.to_degrees(), self.error(angle, torque, self.temperature, direction) - mean]
                });
                let name = format!("{} N·m {word}", short(torque.into()));
                lines.series.push(ChartSeries::new(name, mark, colour, points.collect()));
            }
        }
        if let Ok(animation) = &self.subject.animation {
            let name = format!("{} N·m forward, fresh FEM", short(animation.torque_n_m));
            lines.series.push(ChartSeries::new(name, Mark::Points, 1, less_mean(animation)));
        }
        lines
    }

    fn wind_up(&self) -> Lines {
        let of = |(colour, (direction, name, mark)): (usize, (Direction, &str, Mark))| {
            let mean = |t: f32| [f64::from(t), self.mean(t, self.temperature, direction)];
            ChartSeries::new(name, mark, colour, self.torques().into_iter().map(mean).collect())
        };
        let mut series: Vec<ChartSeries> = WAYS.into_iter().enumerate().map(of).collect();
        // The FEM lacks what a data sheet adds.
        let is_bare = self.subject.table.sheet_scatter().is_none();
        if let Some(a) = self.subject.animation.as_ref().ok().filter(|_| is_bare) {
            let point = vec![[a.torque_n_m, mean_arcsec(a)]];
            series.push(ChartSeries::new("forward, fresh FEM", Mark::Points, 2, point));
        }
        Lines::of(series)
    }

    /// Backward less forward error, mean over a pitch, at a torque.
    fn play_at(&self, torque: f32, temperature: f32) -> f64 {
        let [forward, backward] = [Direction::Forward, Direction::Backward].map(|d| self.mean(torque, temperature, d));
        backward - forward
    }

    fn play(&self) -> Lines {
        let [cold, warm] = self.subject.table.temperature_range_c();
        let mut temperatures = vec![cold, self.temperature, warm];
        temperatures.dedup();
        let series = temperatures.into_iter().enumerate().map(|(colour, temperature)| {
            let points = self.torques().into_iter().map(|t| [f64::from(t), self.play_at(t, temperature)]);
            let mark = if colour == 1 { Mark::Line } else { Mark::Dashed };
            ChartSeries::new(format!("{temperature:.0} °C"), mark, colour, points.collect())
        });
        Lines::of(series.collect())
    }

    /// A row of the comparison.
    fn compared(&self) -> Vec<RichText> {
        let [_, highest] = self.subject.table.torque_range_n_m();
        let middle = |torque: f32| {
            let mean = |d| self.mean(torque, self.temperature, d);
            0.5 * (mean(Direction::Forward) + mean(Direction::Backward))
        };
        let wind_up = middle(highest) - middle(self.shown_torques()[0]);
        let at = |k: usize| self.error(self.position(k), 0.5 * highest, self.temperature, Direction::Forward);
        let (low, high) = least_and_most((0..POSITIONS).map(at));
        // Unloaded, the clearance is crossed within the drag torque: the table's widest play.
        let plays = self.torques().into_iter().map(|t| self.play_at(t, self.temperature));
        let left = self.subject.validation.map(|v| [v.rms_arcsec, v.max_arcsec]).or(self.fresh);
        vec![
            RichText::new(self.subject.kind.in_words()),
            RichText::arcsec(self.largest_error, 3),
            left.map_or("–".into(), |[rms, worst]| RichText::arcsec(rms, 2).plain(" / ").error(worst, 2)),
            RichText::arcsec(plays.fold(0.0, f64::max), 3),
            RichText::arcsec(wind_up, 3),
            RichText::arcsec(high - low, 2),
            RichText::new(short(highest.into())),
            RichText::new(self.subject.table.id().to_string()),
        ]
    }
}

/// Points of a validation as series: misses of the table over something, by direction.
fn misses(v: &Validation, over: fn(&Point) -> f64) -> Lines {
    let series = [(1, "forward"), (-1, "backward")].into_iter().enumerate().map(|(colour, (direction, name))| {
        let steady = v.points.iter().filter(|p| p.kind == "steady" && p.direction == direction);
        let points = steady.map(|p| [over(p), p.table_arcsec - p.fem_arcsec]).collect();
        let sorted = ChartSeries::sorted(name, Mark::Points, colour, points);
        ChartSeries { points: apart(sorted.points), ..sorted }
    });
    let limits = [v.max_bound_arcsec, -v.max_bound_arcsec].map(|y| Limit { name: "bound of any point".into(), y });
    Lines { series: series.collect(), limits: limits.into(), ..Lines::default() }
}

/// The run back through the clearance.
fn reversal(v: &Validation) -> Lines {
    let points: Vec<&Point> = v.points.iter().filter(|p| p.kind == "reversal").collect();
    let first = points.first().map_or(0.0, |p| p.generator_rad);
    let along = |name: &str, mark, colour, of: fn(&Point) -> f64| {
        let points = points.iter().map(|p| [(first - p.generator_rad).abs().to_degrees(), of(p)]);
        ChartSeries::sorted(name, mark, colour, points.collect())
    };
    Lines::of(vec![
        along("table and play, as firmware has them", Mark::Line, 0, |p| p.table_arcsec),
        along("fresh FEM", Mark::Points, 1, |p| p.fem_arcsec),
    ])
}

/// The page.
pub fn drive_report(sources: DriveSources<'_>) -> Page {
    let DriveSources { drive, command_name, command, inputs, subjects } = sources;
    let known: Vec<DriveKnown<'_>> = subjects.into_iter().map(|subject| DriveKnown::new(subject, drive)).collect();
    let (status, remarks) = judge(&known);
    let validated = known.iter().any(|k| k.subject.validation.is_some());
    let mut sections = vec![comparison(&known, validated), motion_section(&known)];
    if validated {
        sections.extend(validation_sections(&known));
    }
    let sheet = |k: &DriveKnown<'_>| k.subject.info.and_then(|info| Some((k.id(), info.data_sheet.clone()?)));
    let mut sheets = sheet_section(known.iter().filter_map(sheet).collect());
    if let Some(section) = &mut sheets {
        section.blocks.push(PageBlock::paragraph(format!("The JSON of a table has stiffness, too: {TWO_SETS_OF_K}.")));
    }
    sections.extend(sheets);
    sections.extend(stress_section(&known));
    sections.push(table_section(&known));
    sections.push(load_section(&known));
    sections.extend(known.first().and_then(|k| sizes_section(k.drive).ok()));
    sections.push(reading_section());
    let mut results = Map::new();
    results.insert("tables".into(), known.iter().map(result_of).collect());
    let mut provenance = made_of_drive(command, drive);
    provenance.extend(inputs);
    for k in &known {
        provenance.push((format!("table_id, {}", k.subject.kind.in_words()), k.subject.table.id().to_string()));
        if let Some(Source::Fem { solver, mesh, degrees_of_freedom, worst_residual, .. }) =
            k.subject.info.map(|info| &info.source)
        {
            provenance.push((
                format!("FEM, {}", k.subject.kind.in_words()),
                format!(
                    "{solver} solver, {mesh} mesh, {degrees_of_freedom} degrees of freedom, residual at most \
                     {worst_residual:.1e}"
                ),
            ));
        }
    }
    for a in known.iter().filter_map(|k| k.subject.animation.as_ref().ok()) {
        let residual = a.rows.iter().map(|row| row.residual).fold(0.0, f64::max);
        provenance.push((
            format!("In motion, {}", a.kind.in_words()),
            format!(
                "fast solver, {FRAMES} frames of one pitch, {} N·m, {} °C, residual at most {residual:.1e}",
                a.torque_n_m, a.temperature_c
            ),
        ));
    }
    Page {
        title: if validated {
            format!("Tables of {} against fresh FEM", drive.name)
        } else {
            format!("Compensation tables of {}", drive.name)
        },
        command_name,
        status,
        remarks,
        choices: known.iter().map(|k| Choice { id: k.id(), name: k.subject.kind.in_words().to_owned() }).collect(),
        choice_is: "Generator",
        headlines: known.iter().map(DriveKnown::headline).collect(),
        sections,
        animations: known.into_iter().filter_map(|k| k.subject.animation.ok()).collect(),
        provenance,
        results,
        ..Page::default()
    }
}

/// Whether the page can be relied on, and what to know before one does.
fn judge(known: &[DriveKnown<'_>]) -> (Status, Vec<String>) {
    let mut status = Status::Good;
    let mut remarks: Vec<(String, Vec<&str>)> = Vec::new();
    for k in known {
        let mut remark = |worse: Status, words: String| {
            status = status.max(worse);
            match remarks.iter_mut().find(|(said, _)| *said == words) {
                Some((_, of)) => of.push(k.subject.kind.in_words()),
                None => remarks.push((words, vec![k.subject.kind.in_words()])),
            }
        };
        if let Some(info) = k.subject.info {
            if info.torque_nodes_resolved == Some(false) {
                let words = "the torque nodes ran out before the table met the FEM everywhere; see --most-nodes";
                remark(Status::Remark, words.to_owned());
            }
            for words in &info.remarks {
                remark(Status::Remark, words.clone());
            }
            for caution in &info.cautions {
                remark(Status::Caution, caution_words(caution));
            }
            if let Some(why) = &info.no_stress {
                remark(Status::Caution, format!("no stress over three meshes: {why}"));
            }
            if let Some(turns) = &info.turns {
                remark(Status::Remark, turns.remark.replace('"', "″"));
            }
        }
        match &k.subject.animation {
            Err(error @ AnimationError::NotPeriodic { .. }) => {
                remark(Status::Remark, format!("not shown in motion: {error}"));
            }
            Err(error @ AnimationError::Simulate(_)) => {
                // A table of measured samples does not depend on this run.
                let status = if k.is_fem() { Status::NotConverged } else { Status::Remark };
                remark(status, format!("the run that shows it in motion failed: {error}"));
            }
            Ok(_) => {}
        }
        if let Some([_, worst]) = k.fresh.filter(|[_, worst]| *worst > MAX_BOUND_ARCSEC) {
            let words = format!("the table misses fresh FEM by {worst:.2}″, more than {MAX_BOUND_ARCSEC}″");
            remark(Status::BoundMissed, words);
        }
        if k.fresh.is_none() && k.subject.validation.is_none() {
            let words = "nothing here measures the error with the table: validate does against fresh FEM, replay \
                         against measured rows that made no table";
            remark(Status::Remark, words.to_owned());
        }
        if let Some(v) = k.subject.validation.filter(|v| v.status != "passed") {
            let words = format!(
                "{:.2}″ rms and {:.2}″ at most; the bounds are {:.2}″ and {:.2}″",
                v.rms_arcsec, v.max_arcsec, v.rms_bound_arcsec, v.max_bound_arcsec
            );
            remark(Status::BoundMissed, words);
        }
    }
    (status, remarks.into_iter().map(|(words, of)| format!("{}: {words}.", of.join(", "))).collect())
}

/// A value as its JSON file has it: single precision there has the digits it needs, as a [`Value`] all of double
/// precision.
fn as_written(info: &TableInfo) -> Value {
    serde_json::to_string(info).and_then(|text| serde_json::from_str(&text)).expect("plain values")
}

fn result_of(k: &DriveKnown<'_>) -> Value {
    let [rms, worst] = k.fresh.map_or([None; 2], |pair| pair.map(Some));
    json!({
        "generator": k.subject.kind.to_string(),
        "table_id": k.subject.table.id().to_string(),
        "largest_error_arcsec": k.largest_error,
        "fresh_fem_rms_arcsec": rms,
        "fresh_fem_max_arcsec": worst,
        "table": k.subject.info.map(as_written),
        "validation": k.subject.validation.map(|v| json!({
            "status": v.status,
            "points": v.points.len(),
            "rms_arcsec": v.rms_arcsec,
            "max_arcsec": v.max_arcsec,
            "reversal_rms_arcsec": v.reversal_rms_arcsec,
            "reversal_max_arcsec": v.reversal_max_arcsec,
            "uncompensated_rms_arcsec": v.uncompensated_rms_arcsec,
        })),
    })
}

/// Stress over three meshes, where it was asked for.
fn stress_section(known: &[DriveKnown<'_>]) -> Option<PageSection> {
    let block = |k: &DriveKnown<'_>| {
        let info = k.subject.info.filter(|info| !info.stress.is_empty())?;
        let rows = info.stress.iter().map(|stress| {
            let [low, high] = stress.interval_mpa;
            let numbers = [stress.von_mises_mpa, low, high].map(|value| RichText::new(significant(value, 3)));
            let safety = stress.fatigue.map_or_else(String::new, |of| significant(of.safety, 3));
            [vec![RichText::new(stress.place.in_words())], numbers.into(), vec![RichText::new(safety)]].concat()
        });
        let [_, highest] = k.subject.table.torque_range_n_m();
        let caption = format!("Largest von Mises stress under {} N·m, over three meshes", short(highest.into()));
        let header = ["Place", "stress, MPa", "from, MPa", "to, MPa", "safety against fatigue"];
        Some(PageBlock::table(caption, &header, rows.collect()).of_choice(k.id()))
    };
    let blocks: Vec<PageBlock> = known.iter().filter_map(block).collect();
    let title = "Stress, over three meshes";
    (!blocks.is_empty()).then(|| PageSection::new("stress-by-place", title, blocks))
}

fn comparison(known: &[DriveKnown<'_>], validated: bool) -> PageSection {
    let header = [
        // The purpose of a table comes first: a phone shows three columns.
        "Generator",
        "Largest error",
        if validated { "Residual with table, rms / largest" } else { "Residual with table, rms / largest*" },
        "Backlash",
        "Elastic wind-up",
        "Ripple at half load",
        "Load up to, N·m",
        "table_id",
    ];
    let caption = "Error of the output under each generator, and the residual with its table";
    let table = PageBlock::table(caption, &header, known.iter().map(DriveKnown::compared).collect());
    let matches = "The table_id is what firmware returns for the table it carries: it matches this page with a device \
                   in the field.";
    let words = if validated {
        format!("{matches} Without a table the output is off by up to the second column; with it, by the third.")
    } else {
        format!(
            "{matches} * At {FRAMES} points over a pitch, at half load, forward, at {:.0} °C: few, but none of them \
             made the table. The command validate draws many, at random loads and temperatures.",
            known.first().map_or(20.0, |k| k.temperature)
        )
    };
    PageSection::new("comparison", "At a glance", vec![table, PageBlock::paragraph(words)])
}

/// The load, stretched about the drag, where the loaded flank changes.
fn load_axis(known: &[DriveKnown<'_>]) -> ChartAxis {
    let drag = known.first().map_or(0.02, |k| k.drive.output.drag_torque_n_m);
    ChartAxis::new("Load torque (stretched about zero)", PageQuantity::Torque).stretched(drag.max(1e-3))
}

fn charts(known: &[DriveKnown<'_>], of: impl Fn(&DriveKnown<'_>) -> Option<Lines>) -> Vec<(String, Lines)> {
    known.iter().filter_map(|k| Some((k.id(), of(k)?))).collect()
}

fn motion_section(known: &[DriveKnown<'_>]) -> PageSection {
    let error = |label: &str| ChartAxis::new(label, PageQuantity::Error);
    let mut blocks = vec![
        PageBlock::Figure(drive_figure("at half the largest load of the table, turning forward")),
        PageBlock::lines(
            "ripple",
            "Error over one tooth pitch, less its mean",
            "Output angle less generator angle over the ratio, by the table, at three loads in both directions; dots \
             are fresh FEM, the states that figure 1 shows. It repeats with every pitch of the flexspline. The mean \
             is in figure 3.",
            [ChartAxis::over_pitch(), error("Output error less mean")],
            charts(known, |k| Some(k.ripple())),
        ),
        PageBlock::lines(
            "wind-up",
            "Error over the load",
            "Mean over a pitch, by the table, at the reference temperature: wind-up, and, where the load is too small \
             to hold the flanks together, the clearance. A positive load turns the output forward. Drag across to \
             zoom, double-click to come back.",
            [ChartAxis::new("Load torque", PageQuantity::Torque), error("Output error")],
            charts(known, |k| Some(k.wind_up())),
        ),
    ];
    if known.iter().any(|k| k.subject.animation.as_ref().is_ok_and(|a| a.sleeve.is_some())) {
        blocks.push(PageBlock::Figure(sleeve_figure()));
    }
    PageSection::new("motion", "The drive at work", blocks)
}

fn validation_sections(known: &[DriveKnown<'_>]) -> [PageSection; 2] {
    let words = |k: &DriveKnown<'_>| {
        let v = k.subject.validation?;
        let (points, increments) = (v.points.len(), v.increments);
        let words = format!(
            "{points} points, {increments} increments of FEM. Root mean square {{}} (bound {{}}), largest {{}} (bound \
             {{}}); in the reversal {{}} rms, {{}} at most. "
        );
        let bounded = [v.rms_arcsec, v.rms_bound_arcsec, v.max_arcsec, v.max_bound_arcsec];
        let all = [&bounded[..], &[v.reversal_rms_arcsec, v.reversal_max_arcsec]].concat();
        let text = RichText::filled(&words, &all.iter().map(|arcsec| (*arcsec, 2)).collect::<Vec<_>>());
        let text = text.strong(if v.status == "passed" { "Passed." } else { "Bound missed." });
        Some(PageBlock::paragraph(text).of_choice(k.id()))
    };
    let mut blocks: Vec<PageBlock> = known.iter().filter_map(words).collect();
    let missed = |id, title, caption, x, over: fn(&Point) -> f64| {
        let y = ChartAxis::new("Table less FEM", PageQuantity::Error);
        PageBlock::lines(id, title, caption, [x, y], charts(known, |k| Some(misses(k.subject.validation?, over))))
    };
    blocks.push(missed(
        "miss-torque",
        "Table less fresh FEM, over the load",
        "Loads, temperatures, directions and positions were drawn between the nodes of the table.",
        load_axis(known),
        |p| p.torque_n_m,
    ));
    let more = vec![
        missed(
            "miss-temperature",
            "Table less fresh FEM, over the temperature",
            "The same points.",
            ChartAxis::new("Temperature", PageQuantity::Temperature),
            |p| p.temperature_c,
        ),
        PageBlock::lines(
            "reversal",
            "Through the clearance at a reversal",
            "Without load the generator turns back: the output stands until the clearance is crossed, and the error \
             grows with the generator. The line is what the core, with its play, gives from the same generator angles.",
            [
                ChartAxis::new("Generator travel", PageQuantity::Degree),
                ChartAxis::new("Output error", PageQuantity::Error),
            ],
            charts(known, |k| k.subject.validation.map(reversal)),
        ),
    ];
    [
        PageSection::new("validation", "Against fresh FEM", blocks),
        PageSection::folded("validation-more", "Fresh FEM over the temperature, and at a reversal", more),
    ]
}

fn table_section(known: &[DriveKnown<'_>]) -> PageSection {
    let mut blocks = vec![PageBlock::lines(
        "play",
        "Play between the directions",
        "Backward less forward error, mean over a pitch: both half-widths of the play. Below the drag of the output \
         nothing holds the flanks together and it is the backlash; beyond, what drag and friction leave.",
        [load_axis(known), ChartAxis::new("Backward less forward", PageQuantity::Error)],
        charts(known, |k| Some(k.play())),
    )];
    for k in known {
        let table = &k.subject.table;
        let [cold, warm] = table.temperature_range_c();
        let [low, high] = table.torque_range_n_m().map(|torque| short(torque.into()));
        let arcsec = |rad: f32| RichText::arcsec(f64::from(rad) * ARCSEC_PER_RAD, 2);
        let mut rows = vec![
            ("Range of the load", format!("{low} to {high} N·m").into()),
            ("Range of the temperature", format!("{cold} to {warm} °C").into()),
            ("Torque nodes", table.torque_nodes_n_m().len().to_string().into()),
            ("Temperature nodes", table.temperature_nodes_c().len().to_string().into()),
            ("Error of the inverse, at most", arcsec(table.inverse_error_bound_rad())),
            ("Largest deviation from the samples", arcsec(table.projection_worst_rad())),
        ];
        if let Some(info) = k.subject.info {
            rows.push(("Image", format!("{} bytes", info.image_bytes).into()));
            rows.push(("Samples", info.samples.to_string().into()));
        }
        let rows = rows.into_iter().map(|(name, value)| vec![name.into(), value]).collect();
        let caption = format!("The {} table", k.subject.kind.in_words());
        blocks.push(PageBlock::table(caption, &["Property", "Value"], rows).of_choice(k.id()));
    }
    PageSection::folded("table", "The table", blocks)
}

fn load_section(known: &[DriveKnown<'_>]) -> PageSection {
    let of = |lines: fn(&Animation) -> Lines| charts(known, |k| k.subject.animation.as_ref().ok().map(lines));
    let figures = [stress_figure(of(stress_lines)), sharing_figure(of(sharing_lines))];
    PageSection::folded("load", "Load and stress", figures.into())
}

fn reading_section() -> PageSection {
    PageSection::reading(vec![
        PageBlock::paragraph(format!("{SIGNS} The flexspline is fixed, the circular spline is the output.")),
        PageBlock::paragraph(
            "Fresh FEM means runs that made none of the tables, by the same model: agreement says that the table \
             holds what the model says, not that the model holds what a real drive does. Teeth and rim are a slice in \
             plane strain, quasi-static; a cup or sleeve acts on it by the stiffness of its shell, where the drive has \
             one. Lubricant and speed are left out. Pointing along figure 2 turns the drive of figure 1.",
        ),
    ])
}
