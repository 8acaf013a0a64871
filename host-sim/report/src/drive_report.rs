//! The page of a drive and its tables: what `tables` and `validate` write.

use std::f64::consts::TAU;

use flexspline::make::Sample;
use flexspline::{Direction, GeneratorAngle, Table};
use serde_json::{Map, Value, json};

use super::animation::{Animation, AnimationError, FRAMES};
use super::drive_figures::{
    apart, caution_words, drive_figure, less_mean, sharing_figure, sharing_lines, sheet_section, sleeve_figure,
    stress_figure, stress_lines,
};
use super::page::{
    Axis, Block, Choice, Detail, Field, Figure, FigureBody, Headline, Limit, Lines, Mark, Page, PageQuantity, Section,
    Series, Status, Table as PageTable, Text, significant,
};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::stated::TWO_SETS_OF_K;
use flexspline_design::tables::validate::{MAX_BOUND_ARCSEC, Point, Validation};
use flexspline_design::tables::{Source, TableInfo};
use flexspline_mechanics::drive::{Drive, GeneratorKind};

/// Positions over a pitch at which tables are read for curves and means.
const POSITIONS: usize = 48;
/// Torques between neighbouring nodes at which curves over the torque are read.
const BETWEEN_NODES: usize = 4;

/// A table and what is known of it.
pub struct DriveSubject<'a> {
    /// Which generator.
    pub kind: GeneratorKind,
    /// The table.
    pub table: Table<'a>,
    /// What made it, if it was made just now.
    pub info: Option<&'a TableInfo>,
    /// The samples it was made of, if they are FEM's and at hand.
    pub samples: Option<&'a [Sample]>,
    /// How it did against fresh FEM.
    pub validation: Option<&'a Validation>,
    /// The drive in motion, by fresh FEM.
    pub animation: Result<Animation, AnimationError>,
}

/// What the page is made from.
pub struct DriveSources<'a> {
    /// The drive.
    pub drive: &'a Drive,
    /// `tables` or `validate`.
    pub command_name: &'static str,
    /// The command line.
    pub command: &'a str,
    /// What made it beside the drive: name and value.
    pub inputs: Vec<(String, String)>,
    /// The tables.
    pub subjects: Vec<DriveSubject<'a>>,
}

/// The load at which a drive is shown in motion: half of what its table spans.
pub fn shown_torque_n_m(table: &Table<'_>) -> f64 {
    0.5 * f64::from(table.torque_range_n_m()[1])
}

/// A torque to four digits: those of single precision are not all meant.
fn torque_text(torque_n_m: f32) -> String {
    let torque = f64::from(torque_n_m);
    let unit = 10_f64.powf(torque.abs().max(1e-9).log10().floor() - 3.0);
    let digits = (-unit.log10().round()).max(0.0) as usize;
    let text = format!("{:.digits$}", (torque / unit).round() * unit);
    if digits == 0 { text } else { text.trim_end_matches('0').trim_end_matches('.').to_owned() }
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

    fn pitch(&self) -> f64 {
        TAU / f64::from(self.drive.flexspline.teeth)
    }

    /// Of a table made from FEM: from elsewhere it need not agree with the FEM of this drive.
    fn is_fem(&self) -> bool {
        self.subject.info.is_none_or(|info| matches!(info.source, Source::Fem { .. }))
    }

    /// Output error in steady motion by the table, arcsec; NaN where it gives none.
    fn error(&self, generator_rad: f64, torque: f32, temperature: f32, direction: Direction) -> f64 {
        GeneratorAngle::from_rad(generator_rad)
            .and_then(|angle| self.subject.table.steady_error_rad(angle, torque, temperature, direction))
            .map_or(f64::NAN, |rad| f64::from(rad) * ARCSEC_PER_RAD)
    }

    /// The mean of it over a pitch.
    fn mean(&self, torque: f32, temperature: f32, direction: Direction) -> f64 {
        let at = |k: usize| self.pitch() * k as f64 / POSITIONS as f64;
        (0..POSITIONS).map(|k| self.error(at(k), torque, temperature, direction)).sum::<f64>() / POSITIONS as f64
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
        let is_bare = self.subject.info.is_some() || self.subject.table.sheet_scatter().is_none();
        let animation = self.subject.animation.as_ref().ok().filter(|_| self.is_fem() && is_bare)?;
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
        let rms = (misses.iter().map(|m| m * m).sum::<f64>() / misses.len() as f64).sqrt();
        Some([rms, misses.iter().fold(0.0, |worst, m| f64::max(worst, m.abs()))])
    }

    fn headline(&self) -> Headline {
        let name = self.subject.kind.in_words();
        let choice = Some(self.id());
        if let Some(v) = self.subject.validation {
            return Headline {
                choice,
                answer: Text::new(format!("The {name} table misses fresh contact FEM by "))
                    .error(v.rms_arcsec, 2)
                    .plain(" rms, where the drive without a table is off by ")
                    .error(v.uncompensated_rms_arcsec, 3)
                    .plain("."),
                number: Text::default().error(v.max_arcsec, 2),
                number_is: format!("largest miss at {} points that made no table", v.points.len()),
            };
        }
        let uncorrected = Text::new(format!("Uncorrected, the {name} drive is off by up to "))
            .error(self.largest_error, 3)
            .plain(format!(" at {} N·m; ", torque_text(self.subject.table.torque_range_n_m()[1])));
        if let Some([_, worst]) = self.fresh {
            let torque = torque_text(shown_torque_n_m(&self.subject.table) as f32);
            return Headline {
                choice,
                answer: uncorrected
                    .plain("its table predicts the output to within ")
                    .error(worst, 2)
                    .plain(" of fresh FEM."),
                number: Text::default().error(worst, 2),
                number_is: format!(
                    "largest miss at {FRAMES} FEM points that made no table ({torque} N·m, {:.0} °C, forward)",
                    self.temperature
                ),
            };
        }
        let worst = f64::from(self.subject.table.projection_worst_rad()) * ARCSEC_PER_RAD;
        Headline {
            choice,
            answer: uncorrected
                .plain("what its table leaves is not measured here. It holds the samples that made it to ")
                .error(worst, 2)
                .plain(", which says nothing of other points."),
            number: Text::default().error(self.largest_error, 3),
            number_is: "largest error without a table; with one, see validate, or replay on rows that made none".into(),
        }
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
            for (direction, word, mark) in
                [(Direction::Forward, "forward", Mark::Line), (Direction::Backward, "backward", Mark::Dashed)]
            {
                let mean = self.mean(torque, self.temperature, direction);
                let points = (0..=POSITIONS).map(|k| {
                    let angle = self.pitch() * k as f64 / POSITIONS as f64;
                    [angle.to_degrees(), self.error(angle, torque, self.temperature, direction) - mean]
                });
                let name = format!("{} N·m {word}", torque_text(torque));
                lines.series.push(Series { name, mark, colour, points: points.collect() });
            }
        }
        if let Ok(animation) = &self.subject.animation {
            lines.series.push(Series {
                name: format!("{} N·m forward, fresh FEM", torque_text(animation.torque_n_m as f32)),
                mark: Mark::Points,
                colour: 1,
                points: less_mean(animation),
            });
        }
        lines
    }

    fn wind_up(&self) -> Lines {
        let of = |direction| -> Vec<[f64; 2]> {
            self.torques().into_iter().map(|t| [f64::from(t), self.mean(t, self.temperature, direction)]).collect()
        };
        let mut lines = Lines::default();
        for (name, mark, colour, direction) in
            [("forward", Mark::Line, 0, Direction::Forward), ("backward", Mark::Dashed, 1, Direction::Backward)]
        {
            lines.series.push(Series { name: name.into(), mark, colour, points: of(direction) });
        }
        if let Ok(a) = &self.subject.animation {
            let mean = a.error_arcsec.iter().sum::<f64>() / FRAMES as f64;
            lines.series.push(Series {
                name: "forward, fresh FEM".into(),
                mark: Mark::Points,
                colour: 2,
                points: vec![[a.torque_n_m, mean]],
            });
        }
        lines
    }

    fn play(&self) -> Lines {
        let [cold, warm] = self.subject.table.temperature_range_c();
        let mut temperatures = vec![cold, self.temperature, warm];
        temperatures.dedup();
        let series = temperatures.into_iter().enumerate().map(|(colour, temperature)| {
            let points = self.torques().into_iter().map(|t| {
                let [f, b] = [Direction::Forward, Direction::Backward].map(|d| self.mean(t, temperature, d));
                [f64::from(t), b - f]
            });
            let mark = if colour == 1 { Mark::Line } else { Mark::Dashed };
            Series { name: format!("{temperature:.0} °C"), mark, colour, points: points.collect() }
        });
        Lines { series: series.collect(), ..Lines::default() }
    }

    fn map(&self) -> Field {
        let nodes: Vec<f32> = self.subject.table.torque_nodes_n_m().collect();
        let angles: Vec<f64> = (0..POSITIONS).map(|k| self.pitch() * k as f64 / POSITIONS as f64).collect();
        let z = nodes.iter().flat_map(|torque| {
            let mean = self.mean(*torque, self.temperature, Direction::Forward);
            angles.iter().map(move |a| self.error(*a, *torque, self.temperature, Direction::Forward) - mean)
        });
        Field {
            x: angles.iter().map(|a| a.to_degrees()).collect(),
            y: nodes.iter().map(|t| f64::from(*t)).collect(),
            z: z.collect(),
        }
    }

    /// The table against the samples it was made of.
    fn residual(&self) -> Option<Lines> {
        let samples = self.subject.samples?;
        let ratio = self.drive.ratio();
        let series = [(Direction::Forward, "forward"), (Direction::Backward, "backward")].into_iter().enumerate().map(
            |(colour, (direction, name))| {
                let mut points: Vec<[f64; 2]> = samples
                    .iter()
                    .filter(|s| s.direction == direction)
                    .map(|s| {
                        let fem = (s.output_rad - s.generator_rad / ratio) * ARCSEC_PER_RAD;
                        let table = self.error(s.generator_rad, s.torque_n_m as f32, s.temperature_c as f32, direction);
                        [s.torque_n_m, table - fem]
                    })
                    .collect();
                // One dot to a torque and side: the largest miss either way. All are in the samples file.
                points.sort_by(|a, b| a[0].total_cmp(&b[0]));
                let worst = points.chunk_by(|a, b| a[0] == b[0]).map(|group| {
                    *group.iter().max_by(|a, b| a[1].abs().total_cmp(&b[1].abs())).expect("groups are not empty")
                });
                Series { name: name.into(), mark: Mark::Points, colour, points: worst.collect() }
            },
        );
        Some(Lines { series: series.collect(), ..Lines::default() })
    }
}

/// Points of a validation as series: misses of the table over something, by direction.
fn misses(v: &Validation, kind: &str, over: fn(&Point) -> f64) -> Lines {
    let series = [(1, "forward"), (-1, "backward")].into_iter().enumerate().map(|(colour, (direction, name))| {
        let mut points: Vec<[f64; 2]> = v
            .points
            .iter()
            .filter(|p| p.kind == kind && p.direction == direction)
            .map(|p| [over(p), p.table_arcsec - p.fem_arcsec])
            .collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Series { name: name.into(), mark: Mark::Points, colour, points: apart(points) }
    });
    let limits = [v.max_bound_arcsec, -v.max_bound_arcsec].map(|y| Limit { name: "bound of any point".into(), y });
    Lines { series: series.collect(), limits: limits.into(), ..Lines::default() }
}

/// The run back through the clearance.
fn reversal(v: &Validation) -> Lines {
    let points: Vec<&Point> = v.points.iter().filter(|p| p.kind == "reversal").collect();
    let first = points.first().map_or(0.0, |p| p.generator_rad);
    let along = |of: fn(&Point) -> f64| {
        let mut line: Vec<[f64; 2]> =
            points.iter().map(|p| [(first - p.generator_rad).abs().to_degrees(), of(p)]).collect();
        line.sort_by(|a, b| a[0].total_cmp(&b[0]));
        line
    };
    let table = along(|p| p.table_arcsec);
    let fem = along(|p| p.fem_arcsec);
    Lines {
        series: vec![
            Series { name: "table and play, as firmware has them".into(), mark: Mark::Line, colour: 0, points: table },
            Series { name: "fresh FEM".into(), mark: Mark::Points, colour: 1, points: fem },
        ],
        ..Lines::default()
    }
}

/// The page.
pub fn drive_report(sources: DriveSources<'_>) -> Page {
    let DriveSources { drive, command_name, command, inputs, subjects } = sources;
    let known: Vec<DriveKnown<'_>> = subjects.into_iter().map(|subject| DriveKnown::new(subject, drive)).collect();
    let (status, remarks) = judge(&known);
    let validated = known.iter().any(|k| k.subject.validation.is_some());
    let mut sections = vec![comparison(&known, validated), motion_section(&known)];
    if validated {
        sections.push(validation_section(&known));
    }
    let sheet = |k: &DriveKnown<'_>| k.subject.info.and_then(|info| Some((k.id(), info.data_sheet.clone()?)));
    let mut sheets = sheet_section(known.iter().filter_map(sheet).collect());
    if let Some(section) = &mut sheets {
        section.blocks.push(Block::paragraph(format!("The JSON of a table has stiffness, too: {TWO_SETS_OF_K}.")));
    }
    sections.extend(sheets);
    sections.extend(stress_section(&known));
    sections.push(table_section(&known));
    sections.push(load_section(&known));
    sections.push(reading_section());
    let mut results = Map::new();
    results.insert("tables".into(), known.iter().map(result_of).collect());
    let mut provenance = vec![
        ("Command".to_owned(), command.to_owned()),
        ("Program".to_owned(), format!("flexspline {}", env!("CARGO_PKG_VERSION"))),
        ("Drive".to_owned(), drive.name.clone()),
        ("BLAKE3 of the drive".to_owned(), blake3::Hash::from(drive.hash()).to_hex().to_string()),
    ];
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
    let title = if validated {
        format!("Tables of {} against fresh FEM", drive.name)
    } else {
        format!("Compensation tables of {}", drive.name)
    };
    Page {
        title,
        command_name,
        status,
        also: Vec::new(),
        remarks,
        choices: known.iter().map(|k| Choice { id: k.id(), name: k.subject.kind.in_words().to_owned() }).collect(),
        choice_is: "Generator",
        headlines: known.iter().map(DriveKnown::headline).collect(),
        sections,
        animations: known.into_iter().filter_map(|k| k.subject.animation.ok()).collect(),
        provenance,
        results,
    }
}

/// Whether the page can be relied on, and what to know before one does.
fn judge(known: &[DriveKnown<'_>]) -> (Status, Vec<String>) {
    let mut status = Status::Good;
    let mut remarks = Vec::new();
    let mut remark = |worse: Status, words: String| {
        status = status.max(worse);
        remarks.push(words);
    };
    for k in known {
        let name = k.subject.kind.in_words();
        if k.subject.info.is_some_and(|info| info.torque_nodes_resolved == Some(false)) {
            let words = "the torque nodes ran out before the table met the FEM everywhere; see --most-nodes";
            remark(Status::Remark, format!("{name}: {words}."));
        }
        for words in k.subject.info.iter().flat_map(|info| &info.remarks) {
            remark(Status::Remark, format!("{name}: {}.", words.replace("N.m", "N·m")));
        }
        for caution in k.subject.info.iter().flat_map(|info| &info.cautions) {
            remark(Status::Caution, format!("{name}: {}.", caution_words(caution)));
        }
        if let Some(why) = k.subject.info.and_then(|info| info.no_stress.as_ref()) {
            remark(Status::Caution, format!("{name}: no stress over three meshes: {why}."));
        }
        if let Some(turns) = k.subject.info.and_then(|info| info.turns.as_ref()) {
            remark(Status::Remark, format!("{name}: {}.", turns.remark.replace('"', "″")));
        }
        match &k.subject.animation {
            Err(error @ AnimationError::NotPeriodic { .. }) => {
                remark(Status::Remark, format!("{name}: not shown in motion: {error}."));
            }
            Err(error @ AnimationError::Simulate(_)) => {
                // A table of measured samples does not depend on this run.
                let status = if k.is_fem() { Status::NotConverged } else { Status::Remark };
                remark(status, format!("{name}: the run that shows it in motion failed: {error}."));
            }
            Ok(_) => {}
        }
        if let Some([_, worst]) = k.fresh.filter(|[_, worst]| *worst > MAX_BOUND_ARCSEC) {
            let words = format!("the table misses fresh FEM by {worst:.2}″, more than {MAX_BOUND_ARCSEC}″");
            remark(Status::BoundMissed, format!("{name}: {words}."));
        }
        if k.fresh.is_none() && k.subject.validation.is_none() {
            let words = "nothing here measures what the table leaves: validate does against fresh FEM, replay against \
                         measured rows that made no table";
            remark(Status::Remark, format!("{name}: {words}."));
        }
        if let Some(v) = k.subject.validation.filter(|v| v.status != "passed") {
            let words = format!(
                "{:.2}″ rms and {:.2}″ at most; the bounds are {:.2}″ and {:.2}″",
                v.rms_arcsec, v.max_arcsec, v.rms_bound_arcsec, v.max_bound_arcsec
            );
            remark(Status::BoundMissed, format!("{name}: {words}."));
        }
    }
    (status, remarks)
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
fn stress_section(known: &[DriveKnown<'_>]) -> Option<Section> {
    let block = |k: &DriveKnown<'_>| {
        let info = k.subject.info.filter(|info| !info.stress.is_empty())?;
        let number = |value: f64| Text::new(significant(value, 3));
        let rows = info.stress.iter().map(|stress| {
            let [low, high] = stress.interval_mpa;
            vec![Text::new(stress.place.in_words()), number(stress.von_mises_mpa), number(low), number(high)]
        });
        let [_, highest] = k.subject.table.torque_range_n_m();
        let table = PageTable {
            caption: format!("Largest von Mises stress under {} N·m, over three meshes", torque_text(highest)),
            header: ["Place", "stress, MPa", "from, MPa", "to, MPa"].map(str::to_owned).into(),
            rows: rows.collect(),
        };
        Some(Block::Table { choice: Some(k.id()), table })
    };
    let blocks: Vec<Block> = known.iter().filter_map(block).collect();
    let (id, title) = ("stress-by-place".to_owned(), "Stress, over three meshes".to_owned());
    (!blocks.is_empty()).then_some(Section { id, title, detail: Detail::Summary, blocks })
}

fn comparison(known: &[DriveKnown<'_>], validated: bool) -> Section {
    let rows = known.iter().map(|k| {
        let error = |arcsec: f64, digits| Text::default().error(arcsec, digits);
        let [_, highest] = k.subject.table.torque_range_n_m();
        let light = k.shown_torques()[0];
        let mean = |d| k.mean(light, k.temperature, d);
        let span = |direction| -> f64 {
            let at =
                |i: usize| k.error(k.pitch() * i as f64 / POSITIONS as f64, 0.5 * highest, k.temperature, direction);
            let (low, high) =
                (0..POSITIONS).map(at).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), e| (a.min(e), b.max(e)));
            high - low
        };
        // Unloaded, the clearance is crossed within the drag torque: the table's widest play.
        let backlash = k
            .play()
            .series
            .iter()
            .find(|s| s.mark == Mark::Line || s.colour == 0)
            .map_or(0.0, |s| s.points.iter().fold(0.0, |widest: f64, p| widest.max(p[1])));
        let wind_up = 0.5
            * (k.mean(highest, k.temperature, Direction::Forward)
                + k.mean(highest, k.temperature, Direction::Backward))
            - 0.5 * (mean(Direction::Forward) + mean(Direction::Backward));
        let left = match (k.subject.validation, k.fresh) {
            (Some(v), _) => error(v.rms_arcsec, 2).plain(" / ").error(v.max_arcsec, 2),
            (None, Some([rms, worst])) => error(rms, 2).plain(" / ").error(worst, 2),
            (None, None) => Text::new("–"),
        };
        vec![
            Text::new(k.subject.kind.in_words()),
            error(k.largest_error, 3),
            left,
            error(backlash, 3),
            error(wind_up, 3),
            error(span(Direction::Forward), 2),
            Text::new(torque_text(highest)),
            Text::new(k.subject.table.id().to_string()),
        ]
    });
    let left = if validated { "Left with table, rms / largest" } else { "Left with table, rms / largest*" };
    let header = [
        // What a table is for comes first: a phone shows three columns.
        "Generator",
        "Largest error",
        left,
        "Backlash",
        "Elastic wind-up",
        "Ripple at half load",
        "Load up to, N·m",
        "table_id",
    ];
    let table = PageTable {
        caption: "What each generator does to the output, and what its table leaves".into(),
        header: header.map(str::to_owned).into(),
        rows: rows.collect(),
    };
    let words = if validated {
        Text::new(
            "The table_id is what firmware returns for the table it carries: it matches this page with a device in \
             the field. Without a table the output is off by up to the second column; with it, by the third.",
        )
    } else {
        Text::new(format!(
            "The table_id is what firmware returns for the table it carries: it matches this page with a device in \
             the field. * At {FRAMES} points over a pitch, at half load, forward, at {:.0} °C: few, but none of them \
             made the table. The command validate draws many, at random loads and temperatures.",
            known.first().map_or(20.0, |k| k.temperature)
        ))
    };
    Section {
        id: "comparison".into(),
        title: "At a glance".into(),
        detail: Detail::Summary,
        blocks: vec![Block::Table { choice: None, table }, Block::Paragraph { choice: None, text: words }],
    }
}

/// The load, stretched about the drag, where the loaded flank changes.
fn load_axis(known: &[DriveKnown<'_>]) -> Axis {
    let drag = known.first().map_or(0.02, |k| k.drive.output.drag_torque_n_m);
    Axis::new("Load torque (stretched about zero)", PageQuantity::Torque).stretched(drag.max(1e-3))
}

fn charts(known: &[DriveKnown<'_>], of: impl Fn(&DriveKnown<'_>) -> Option<Lines>) -> Vec<(String, Lines)> {
    known.iter().filter_map(|k| Some((k.id(), of(k)?))).collect()
}

fn motion_section(known: &[DriveKnown<'_>]) -> Section {
    let ripple = Figure {
        id: "ripple".into(),
        title: "Error over one tooth pitch, less its mean".into(),
        caption: Text::new(
            "Output angle less generator angle over the ratio, by the table, at three loads in both directions; dots \
             are fresh FEM, the states that figure 1 shows. It repeats with every pitch of the flexspline. The mean \
             is in figure 3.",
        ),
        alt: "Curves of the output error over one tooth pitch of the generator".into(),
        body: FigureBody::Lines {
            x: Axis::linked("Generator from the beginning of a pitch"),
            y: Axis::new("Output error less mean", PageQuantity::Error),
            charts: charts(known, |k| Some(k.ripple())),
        },
    };
    let wind_up = Figure {
        id: "wind-up".into(),
        title: "Error over the load".into(),
        caption: Text::new(
            "Mean over a pitch, by the table, at the reference temperature: wind-up, and, where the load is too small \
             to hold the flanks together, the clearance. A positive load turns the output forward. Drag across to \
             zoom, double-click to come back.",
        ),
        alt: "Curves of the mean output error over the load torque, forward and backward".into(),
        body: FigureBody::Lines {
            x: Axis::new("Load torque", PageQuantity::Torque),
            y: Axis::new("Output error", PageQuantity::Error),
            charts: charts(known, |k| Some(k.wind_up())),
        },
    };
    let drive = drive_figure("at half the largest load of the table, turning forward");
    let mut blocks = vec![Block::Figure(drive), Block::Figure(ripple), Block::Figure(wind_up)];
    if known.iter().any(|k| k.subject.animation.as_ref().is_ok_and(|a| a.sleeve.is_some())) {
        blocks.push(Block::Figure(sleeve_figure()));
    }
    Section { id: "motion".into(), title: "The drive at work".into(), detail: Detail::Summary, blocks }
}

fn validation_section(known: &[DriveKnown<'_>]) -> Section {
    let of = |kind: &'static str, over: fn(&Point) -> f64| {
        charts(known, move |k| k.subject.validation.map(|v| misses(v, kind, over)))
    };
    let figure = |id: &str, title: &str, caption: &str, x: Axis, charts| {
        Block::Figure(Figure {
            id: id.into(),
            title: title.into(),
            caption: Text::new(caption),
            alt: title.into(),
            body: FigureBody::Lines { x, y: Axis::new("Table less FEM", PageQuantity::Error), charts },
        })
    };
    let mut blocks: Vec<Block> = known
        .iter()
        .filter_map(|k| {
            let v = k.subject.validation?;
            let text =
                Text::new(format!("{} points, {} increments of FEM. Root mean square ", v.points.len(), v.increments))
                    .error(v.rms_arcsec, 2)
                    .plain(" (bound ")
                    .error(v.rms_bound_arcsec, 2)
                    .plain("), largest ")
                    .error(v.max_arcsec, 2)
                    .plain(" (bound ")
                    .error(v.max_bound_arcsec, 2)
                    .plain("); in the reversal ")
                    .error(v.reversal_rms_arcsec, 2)
                    .plain(" rms, ")
                    .error(v.reversal_max_arcsec, 2)
                    .plain(" at most. ")
                    .strong(if v.status == "passed" { "Passed." } else { "Bound missed." });
            Some(Block::Paragraph { choice: Some(k.id()), text })
        })
        .collect();
    blocks.push(figure(
        "miss-torque",
        "Table less fresh FEM, over the load",
        "Loads, temperatures, directions and positions were drawn between the nodes of the table.",
        load_axis(known),
        of("steady", |p| p.torque_n_m),
    ));
    blocks.push(figure(
        "miss-temperature",
        "Table less fresh FEM, over the temperature",
        "The same points.",
        Axis::new("Temperature", PageQuantity::Temperature),
        of("steady", |p| p.temperature_c),
    ));
    blocks.push(Block::Figure(Figure {
        id: "reversal".into(),
        title: "Through the clearance at a reversal".into(),
        caption: Text::new(
            "Without load the generator turns back: the output stands until the clearance is crossed, and the error \
             grows with the generator. The line is what the core, with its play, gives from the same generator angles.",
        ),
        alt: "Output error while the generator reverses, by table and by FEM".into(),
        body: FigureBody::Lines {
            x: Axis::new("Generator travel", PageQuantity::Degree),
            y: Axis::new("Output error", PageQuantity::Error),
            charts: charts(known, |k| k.subject.validation.map(reversal)),
        },
    }));
    Section { id: "validation".into(), title: "Against fresh FEM".into(), detail: Detail::Summary, blocks }
}

fn table_section(known: &[DriveKnown<'_>]) -> Section {
    let mut blocks = vec![
        Block::Figure(Figure {
            id: "play".into(),
            title: "Play between the directions".into(),
            caption: Text::new(
                "Backward less forward error, mean over a pitch: both half-widths of the play. Below the drag of the \
                 output nothing holds the flanks together and it is the backlash; beyond, what drag and friction \
                 leave.",
            ),
            alt: "Curves of the difference between backward and forward error over the load torque".into(),
            body: FigureBody::Lines {
                x: load_axis(known),
                y: Axis::new("Backward less forward", PageQuantity::Error),
                charts: charts(known, |k| Some(k.play())),
            },
        }),
        Block::Figure(Figure {
            id: "map".into(),
            title: "Error less its mean, over pitch and load".into(),
            caption: Text::new(
                "By the table, forward. One row to each torque node, equally high: they crowd where wind-up is steep.",
            ),
            alt: "Colour map of the output error over generator angle within a pitch and load torque".into(),
            body: FigureBody::Field {
                x: Axis::new("Generator from the beginning of a pitch", PageQuantity::Degree),
                y: Axis::new("Load torque", PageQuantity::Torque),
                z: Axis::new("Output error less mean", PageQuantity::Error),
                fields: known.iter().map(|k| (k.id(), k.map())).collect(),
            },
        }),
    ];
    let residuals = charts(known, |k| k.residual());
    if !residuals.is_empty() {
        blocks.push(Block::Figure(Figure {
            id: "residual".into(),
            title: "Table less the samples that made it".into(),
            caption: Text::new(
                "The largest at each torque node, over positions and temperatures. This is what single precision and \
                 the play as a single half-width leave; it says nothing of what lies between the nodes.",
            ),
            alt: "Points of the deviation of the table from its samples over the load torque".into(),
            body: FigureBody::Lines {
                x: load_axis(known),
                y: Axis::new("Table less sample", PageQuantity::Error),
                charts: residuals,
            },
        }));
    }
    for k in known {
        let table = &k.subject.table;
        let [cold, warm] = table.temperature_range_c();
        let [low, high] = table.torque_range_n_m().map(torque_text);
        let mut rows = vec![
            vec![Text::new("table_id"), Text::new(table.id().to_string())],
            vec![Text::new("Range of the load"), Text::new(format!("{low} to {high} N·m"))],
            vec![Text::new("Range of the temperature"), Text::new(format!("{cold} to {warm} °C"))],
            vec![Text::new("Torque nodes"), Text::new(table.torque_nodes_n_m().len().to_string())],
            vec![Text::new("Temperature nodes"), Text::new(table.temperature_nodes_c().len().to_string())],
            vec![Text::new("Iterations of the inverse"), Text::new(table.inverse_iterations().to_string())],
            vec![
                Text::new("Error they leave, at most"),
                Text::default().error(f64::from(table.inverse_error_bound_rad()) * ARCSEC_PER_RAD, 2),
            ],
            vec![
                Text::new("Largest deviation from the samples"),
                Text::default().error(f64::from(table.projection_worst_rad()) * ARCSEC_PER_RAD, 2),
            ],
            vec![Text::new("Bound of the slope |N de/dψ|"), Text::new(format!("{:.4}", table.bounds().slope))],
        ];
        if let Some(info) = k.subject.info {
            rows.push(vec![Text::new("Image"), Text::new(format!("{} bytes", info.image_bytes))]);
            rows.push(vec![Text::new("Samples"), Text::new(info.samples.to_string())]);
        }
        blocks.push(Block::Table {
            choice: Some(k.id()),
            table: PageTable {
                caption: format!("The {} table", k.subject.kind.in_words()),
                header: vec!["Property".into(), "Value".into()],
                rows,
            },
        });
    }
    Section { id: "table".into(), title: "The table".into(), detail: Detail::Engineering, blocks }
}

fn load_section(known: &[DriveKnown<'_>]) -> Section {
    Section {
        id: "load".into(),
        title: "Load and stress".into(),
        detail: Detail::Engineering,
        blocks: vec![
            Block::Figure(stress_figure(charts(known, |k| Some(stress_lines(k.subject.animation.as_ref().ok()?))))),
            Block::Figure(sharing_figure(charts(known, |k| Some(sharing_lines(k.subject.animation.as_ref().ok()?))))),
        ],
    }
}

fn reading_section() -> Section {
    Section::reading(vec![
        Block::paragraph(
            "Error: output angle less generator angle over the ratio; positive when the output leads. The flexspline \
             is fixed, the circular spline is the output. Forward is growing generator angle.",
        ),
        Block::paragraph(
            "Fresh FEM means runs that made none of the tables, by the same model: agreement says that the table \
             holds what the model says, not that the model holds what a real drive does. Plane strain, quasi-static: \
             the cup of the flexspline, its skew, lubricant and speed are left out.",
        ),
        Block::paragraph(
            "Figures zoom by dragging and come back by a double click. Pointing along figure 2 turns the drive of \
             figure 1. Every figure has its numbers as a table and as CSV, in the unit that is selected.",
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torques_are_written_as_they_are_meant() {
        for (torque, text) in [(0.05_f32, "0.05"), (200.0, "200"), (-0.021, "-0.021"), (12.345_67, "12.35"), (0.0, "0")]
        {
            assert_eq!(torque_text(torque), text);
        }
    }
}
