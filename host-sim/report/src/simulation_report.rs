//! The page of a run along a path: what was found, the error along the path, the loop over the torque, how the teeth
//! share the load, and the drive in motion where the path settles for a tooth pitch.

use std::f64::consts::TAU;
use std::ops::Range;

use serde_json::{Map, json};

use super::animation::{Animation, Passing, flank_forces};
use super::drive_figures::{
    BEARS, OfRow, STRESSES, STRESSES_ARE, apart, caution_words, drive_figure, less_mean, mean_arcsec, sharing_axes,
    sharing_figure, sharing_lines, sheet_section, sizes_section, sleeve_figure, stress_figure, stress_lines,
};
use super::page::{
    ChartAxis, ChartSeries, Choice, FieldMap, Figure, FigureBody, Headline, Lines, Mark, Page, PageBlock, PageQuantity,
    PageSection, RichText, SIGNS, Status, made_of_drive,
};
use flexspline_design::data_sheet::empirical_in_words;
use flexspline_design::simulate::{Observation, Row, Simulation, Summary, TipContact};
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
/// Figures that stand above the picture, where the path has them.
const FIRST_FIGURES: [&str; 7] = [
    "kinematic error, peak to peak",
    "backlash",
    "lost motion at the reversal",
    "wind-up from mid-backlash",
    "wind-up, elastic part",
    "largest flank pressure",
    "mean torque of the generator",
];
/// Teeth that a map shows beyond the last that bears, so that its end is seen.
const TEETH_BESIDE: usize = 2;

/// Forces and the drive in motion, which the page needs in addition to the rows, gathered while the run goes on.
pub struct MotionSeen {
    passing: Passing,
    teeth: Vec<[Vec<f64>; 2]>,
}

impl MotionSeen {
    /// Before the run.
    pub fn new(drive: &Drive) -> MotionSeen {
        MotionSeen { passing: Passing::new(drive), teeth: Vec::new() }
    }

    /// Looks at an increment of the run.
    pub fn add(&mut self, now: &Observation<'_>) {
        self.passing.see(now);
        if now.row.is_none() {
            return;
        }
        let teeth = now.problem.flexspline.teeth;
        let mut flanks = [vec![0.0; teeth], vec![0.0; teeth]];
        for found in flank_forces(now.problem, now.state, |_| true) {
            let [x, y] = found.force_n;
            flanks[usize::from(found.side == Side::Minus)][found.tooth] += x.hypot(y);
        }
        self.teeth.push(flanks);
    }
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
    seen: MotionSeen,
) -> Result<Page, MeshError> {
    let Simulation { rows, summary } = simulation;
    let motion = seen.passing.finish()?;
    let known = RunKnown { drive, kind, summary, rows, teeth: &seen.teeth, motion: motion.as_ref() };
    let sheet = summary.data_sheet.as_ref().and_then(|sheet| sheet_section(vec![(kind.to_string(), sheet.clone())]));
    let mut sections: Vec<PageSection> = [known.in_motion(), known.along_path(), sheet].into_iter().flatten().collect();
    if let Some(first) = sections.first_mut() {
        first.blocks.insert(0, PageBlock::row(known.caption(), &summary.figures(), &FIRST_FIGURES));
    }
    sections.extend([known.found(), known.load(), sizes_section(drive)?, known.reading()]);
    let empirical = summary.wind_up_parts.last().zip(summary.torque_n_m);
    let remark = empirical
        .map(|(part, torque_n_m)| empirical_in_words(100.0 * part.arcsec / part.percent, torque_n_m, part.percent));
    let remarks: Vec<String> = summary.cautions.iter().map(caution_words).chain(remark).collect();
    Ok(Page {
        title: format!("{} along a path", drive.name),
        command_name: "simulate",
        status: match (summary.cautions.is_empty(), remarks.is_empty()) {
            (true, true) => Status::Good,
            (true, false) => Status::Remark,
            _ => Status::Caution,
        },
        remarks: remarks.into_iter().map(|remark| remark + ".").collect(),
        choices: vec![Choice { id: kind.to_string(), name: kind.in_words().to_owned() }],
        choice_is: "Generator",
        headlines: vec![known.headline()],
        sections,
        provenance: known.provenance(),
        results: Map::from_iter([("simulate".to_owned(), json!(summary))]),
        animations: motion.into_iter().collect(),
        ..Page::default()
    })
}

impl RunKnown<'_> {
    fn headline(&self) -> Headline {
        let (summary, name) = (self.summary, self.kind.in_words());
        if let Some(tips) = summary.tip_contact.filter(TipContact::counts) {
            let answer = RichText::new(format!("In the {name} drive {}.", tips.in_words().replace(" deg", "°")));
            let share = RichText::new(format!("{:.1} %", 100.0 * tips.share));
            return Headline::new(answer, share, "of the load on tips that should pass freely");
        }
        let ripple = summary.kinematic_error_pp_arcsec;
        let errors = || self.rows.iter().map(|row| row.error_arcsec);
        let (low, high) = (errors().fold(f64::INFINITY, f64::min), errors().fold(f64::NEG_INFINITY, f64::max));
        // The sentence, its errors, and which of them is the number.
        let (mut words, mut found, number, number_is) = if let Some(backlash) = summary.backlash_arcsec {
            let words = format!("Without load the {name} drive has a backlash of {{}}");
            (words, vec![backlash], backlash, "backlash at the output")
        } else if let (Some(wind_up), Some(torque)) = (summary.wind_up_arcsec, summary.torque_n_m) {
            let elastic = summary.wind_up_elastic_arcsec;
            let of_it = elastic.map_or("", |_| ", {} of it elastic");
            let torque = plain(torque);
            let words = format!(
                "Under {torque} N·m the {name} drive is wound up by {{}} from the middle of its backlash{of_it}"
            );
            (words, [wind_up].into_iter().chain(elastic).collect(), wind_up, "wind-up from mid-backlash")
        } else if let Some(ripple) = ripple {
            let words = format!("Turning one way, the error of the {name} drive ripples by {{}} peak to peak");
            (words, vec![ripple], ripple, "kinematic error, peak to peak")
        } else {
            let to = if low < high { " to {}" } else { "" };
            let words = format!("Along the path the output of the {name} drive is off by {{}}{to}");
            let largest = if high.abs() < low.abs() { low } else { high };
            (words, vec![low, high], largest, "largest error along the path")
        };
        if let Some(ripple) = ripple.filter(|ripple| found != [*ripple]) {
            words += "; turning, its error ripples by {} peak to peak";
            found.push(ripple);
        }
        let found: Vec<(f64, usize)> = found.into_iter().map(|arcsec| (arcsec, 3)).collect();
        Headline::new(RichText::filled(&(words + "."), &found), RichText::arcsec(number, 3), number_is)
    }

    /// Drive, generator, loads.
    fn caption(&self) -> String {
        let load = match (self.summary.torque_n_m, self.summary.temperature_c) {
            (Some(torque), Some(celsius)) => format!("{} N·m, {} °C", plain(torque), plain(celsius)),
            (None, Some(celsius)) => format!("loads of the path, {} °C", plain(celsius)),
            (Some(torque), None) => format!("{} N·m, temperatures of the path", plain(torque)),
            (None, None) => "loads and temperatures of the path".to_owned(),
        };
        format!("{} with {} generator: {load}", self.drive.name, self.kind.in_words())
    }

    /// The figures of the summary.
    fn found(&self) -> PageSection {
        let table = PageBlock::figures(format!("All figures of {}", self.caption()), &self.summary.figures());
        PageSection::folded("found", "All figures", vec![table])
    }

    /// The drive in motion, where the path passes a whole pitch.
    fn in_motion(&self) -> Option<PageSection> {
        let motion = self.motion?;
        let way = if motion.rows[0].turn_rad > 0.0 { "forward" } else { "backward" };
        let load = plain(motion.torque_n_m);
        let series = ChartSeries::new(format!("{load} N·m {way}"), Mark::Line, 0, less_mean(motion));
        let caption = RichText::new(
            "Output angle less generator angle over the ratio, the states that figure 1 shows: it repeats with every \
             pitch of the flexspline. The mean is ",
        );
        let ripple = PageBlock::lines(
            "ripple",
            "Error over one tooth pitch, less its mean",
            caption.error(mean_arcsec(motion), 4).plain("."),
            [ChartAxis::over_pitch(), ChartAxis::new("Output error less mean", PageQuantity::Error)],
            self.chart(Lines::of(vec![series])),
        );
        let mut blocks = vec![PageBlock::Figure(drive_figure(&format!("under {load} N·m, turning {way}"))), ripple];
        blocks.extend(motion.sleeve.as_ref().map(|_| PageBlock::Figure(sleeve_figure())));
        Some(PageSection::new("motion", "The drive at work", blocks))
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
    fn along_path(&self) -> Option<PageSection> {
        let error = |row: &Row| row.error_arcsec;
        let figure = |id, title, caption, x, series| {
            let y = ChartAxis::new("Output error", PageQuantity::Error);
            PageBlock::lines(id, title, caption, [x, y], self.chart(Lines::of(series)))
        };
        let mut blocks = Vec::new();
        let turns = one_way(self.rows, |row| row.generator_rad);
        // Rows between those that are shown in motion say more of the ripple.
        if !turns.is_empty() && self.motion.is_none_or(|motion| motion.rows.len() < self.rows.len()) {
            blocks.push(figure(
                "error",
                "Error over the generator angle",
                "Output angle less generator angle over the ratio; positive when the output leads. A line to each \
                 stretch in which the generator goes one way, as far as there are few. Where it turns back without \
                 load the output stands until the clearance is crossed.",
                ChartAxis::new("Generator", PageQuantity::Degree),
                of_stretches(self.rows, &turns, |row| row.generator_rad.to_degrees(), error, ["forward", "backward"]),
            ));
        }
        let loads = one_way(self.rows, |row| row.torque_n_m);
        if loads.iter().any(|(_, stretch)| stretch.len() >= ROWS_OF_A_LOOP) {
            let words = ["torque growing", "torque falling"];
            blocks.push(figure(
                "torsion",
                "Error over the torque",
                "The torsion of the output, its clearance included, as a torsion test draws it: the slope is the \
                 compliance, and what lies between growing and falling torque is lost to friction and drag. A \
                 positive torque turns the output forward.",
                ChartAxis::new("Load torque", PageQuantity::Torque),
                of_stretches(self.rows, &loads, |row| row.torque_n_m, error, words),
            ));
        }
        (!blocks.is_empty()).then(|| PageSection::new("path", "Along the path", blocks))
    }

    /// How the teeth share the load along the path, stress, pressures, contacts, the torque of the generator.
    fn load(&self) -> PageSection {
        let mut blocks = Vec::new();
        if let Some(motion) = self.motion {
            blocks.push(stress_figure(self.chart(stress_lines(motion))));
            blocks.push(sharing_figure(self.chart(sharing_lines(motion))));
        }
        if self.rows.len() > 1 {
            let (axis, places) = self.along();
            let curves = |id, title, caption: &str, y, of: &[OfRow]| {
                let series = of.iter().enumerate().map(|(colour, (name, of))| {
                    let points = places.iter().map(|(x, k)| [*x, of(&self.rows[*k])]).collect();
                    ChartSeries::new(*name, Mark::Line, colour, points)
                });
                PageBlock::lines(id, title, caption, [axis.clone(), y], self.chart(Lines::of(series.collect())))
            };
            if !self.is_all_in_motion() {
                blocks.extend(self.map(&axis, &places));
                let caption = format!("Of every row. {STRESSES_ARE}");
                let title = "Largest stress and pressures along the path";
                let y = ChartAxis::new("Stress, pressure", PageQuantity::Stress);
                blocks.push(curves("path-stress", title, &caption, y, &STRESSES));
            }
            blocks.push(curves(
                "contacts",
                "Flanks that carry load",
                "Of both lobes together.",
                ChartAxis::new("Tooth flanks", PageQuantity::Whole),
                &[("tooth flanks", |row| row.flank_contacts as f64)],
            ));
            blocks.push(curves(
                "generator-torque",
                "Torque of the generator",
                "On the flexspline, quasi-static. Less the load over the ratio it is friction and drag, and what the \
                 teeth store from place to place. Positive turns the generator forward.",
                ChartAxis::new("Torque of the generator", PageQuantity::Torque),
                &[("generator", |row| row.generator_torque_n_m)],
            ));
        }
        PageSection::folded("load", "Load and stress", blocks)
    }

    /// The axis of figures along the path, and the places of the rows, ascending: generator or torque where that goes
    /// one way all along, else the step.
    fn along(&self) -> (ChartAxis, Vec<(f64, usize)>) {
        let goes_one_way = |of: fn(&Row) -> f64| {
            let all = self.rows.len();
            matches!(one_way(self.rows, of).as_slice(), [(_, stretch)] if stretch.len() == all)
        };
        let (axis, of): (ChartAxis, fn(&Row) -> f64) = if goes_one_way(|row| row.generator_rad) {
            (ChartAxis::new("Generator", PageQuantity::Degree), |row| row.generator_rad.to_degrees())
        } else if goes_one_way(|row| row.torque_n_m) {
            (ChartAxis::new("Load torque", PageQuantity::Torque), |row| row.torque_n_m)
        } else {
            (ChartAxis::new("Step, as in results.csv", PageQuantity::Whole), |row| row.step as f64)
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

    /// The force on the teeth in colour along the path, where it is long enough and any tooth bears.
    fn map(&self, axis: &ChartAxis, places: &[(f64, usize)]) -> Option<PageBlock> {
        if self.rows.len() < ROWS_OF_A_MAP {
            return None;
        }
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
        let field = FieldMap {
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
        let caption = format!(
            "Force on each flexspline tooth: positive on its {}, negative on its {}. Teeth that bear nothing are left \
             out; the angle is that from the major axis, to half a tooth.{most}{lobes}",
            BEARS[0], BEARS[1]
        );
        let [y, z] = sharing_axes();
        let (x, fields) = (axis.clone(), vec![(self.kind.to_string(), field)]);
        let body = FigureBody::Field { x, y, z, fields };
        Some(PageBlock::Figure(Figure::of("map", "Which teeth bear along the path", caption, body)))
    }

    fn reading(&self) -> PageSection {
        let motion = if self.motion.is_some() {
            "The drive in motion is made of the first tooth pitch of the path on which it had settled under one load, \
             at eighths of the pitch."
        } else {
            "There is no drive in motion: the path has no settled tooth pitch with rows at its eighths, as pitch and \
             turn have, or the drive differs from tooth to tooth."
        };
        PageSection::reading(vec![
            PageBlock::paragraph(format!(
                "{SIGNS} The flexspline is fixed, the circular spline is the output. Every row of the path is in \
                 results.csv; a figure that the path cannot give is left out. Plane strain, quasi-static: no inertia, \
                 no lubricant, no speed."
            )),
            PageBlock::paragraph(motion),
        ])
    }

    fn provenance(&self) -> Vec<(String, String)> {
        let summary = self.summary;
        let fem = format!(
            "{} solver, {} mesh, {} degrees of freedom, {} increments, residual at most {:.1e}",
            summary.solver, summary.mesh, summary.degrees_of_freedom, summary.increments, summary.residual_worst
        );
        let mut made = made_of_drive(&summary.command, self.drive);
        made.push(("Path".to_owned(), format!("{}, {} rows", summary.path, summary.rows)));
        made.push(("FEM".to_owned(), fem));
        made
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
) -> Vec<ChartSeries> {
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
            ChartSeries::new(name, Mark::Dots, colour, points)
        };
        return [(growing, true), (falling, false)].into_iter().enumerate().map(of_way).collect();
    }
    let one_load = |rows: &[Row]| rows.iter().all(|row| row.torque_n_m == rows[0].torque_n_m);
    let mut series: Vec<ChartSeries> = Vec::new();
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
        series.push(ChartSeries::new(name, mark, colour, ascending(&mut rows_of_it.iter())));
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
        let mut seen = MotionSeen::new(&drive);
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
        // Rows whose lines would hide one another are dots, each of which keeps its place in a table.
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
                PageBlock::Figure(figure) if figure.id == id => Some(&figure.body),
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
