//! The picture before the verdict: what the residual looks like over everything that was recorded.

use std::f64::consts::TAU;

use super::thin::{dots, medians, some_rows};
use super::{DiagnosisKnown, Level, words};
use crate::page::{
    ChartAxis, ChartSeries, FieldMap, Figure, FigureBody, Lines, Mark, PageBlock, PageQuantity, PageSection, RichText,
    significant,
};
use flexspline::FixedMember;
use flexspline_base::robust::{least_and_most, median_of};
use flexspline_identify::residual::Axis as Angle;

/// Cells of the map, across and up.
const MAP: [usize; 2] = [72, 36];
/// A quantity that changes by less than this share of itself is no axis.
const CHANGES: f64 = 0.03;
/// Rows that a cell needs before its median is shown.
const FEWEST_IN_CELL: usize = 2;
const DIRECTIONS: [(f64, &str); 2] = [(1.0, "forward"), (-1.0, "backward")];

impl DiagnosisKnown<'_> {
    /// The picture that shows most, and the others.
    pub(super) fn picture_sections(&self) -> [PageSection; 3] {
        let [first, others] = self.looks();
        [first, others, self.spectra()]
    }

    fn lines(
        &self,
        id: &str,
        title: &str,
        caption: &str,
        x: ChartAxis,
        of: impl Fn(&Level) -> Option<Lines>,
    ) -> Option<PageBlock> {
        let chart = |level: &Level| Some((level.id.to_owned(), of(level)?));
        let charts: Vec<_> = self.levels.iter().filter_map(chart).collect();
        let axes = [x, ChartAxis::new("Error less model", PageQuantity::Error)];
        (!charts.is_empty()).then(|| PageBlock::lines(id, title, caption, axes, charts))
    }

    /// Rows that move in a direction.
    fn rows_in(&self, direction: f64) -> impl Iterator<Item = usize> + Clone {
        (0..self.rows.len()).filter(move |k| self.rows.direction[*k] == direction)
    }

    /// Dots and medians over a quantity, by direction.
    fn over(&self, quantity: &[f64], level: &Level) -> Option<Lines> {
        let values = &level.residual_arcsec;
        let mut lines = Lines::default();
        let some = some_rows(self.rows.len());
        for (colour, (direction, name)) in DIRECTIONS.into_iter().enumerate() {
            let here: Vec<usize> = some.iter().copied().filter(|k| self.rows.direction[*k] == direction).collect();
            if !here.is_empty() {
                lines.series.push(dots(quantity, values, &here, name, colour));
            }
        }
        for (colour, (direction, name)) in DIRECTIONS.into_iter().enumerate() {
            let points = medians(quantity, values, self.rows_in(direction));
            if points.len() > 1 {
                lines.series.push(ChartSeries::new(format!("{name}, median"), Mark::Line, 2 + colour, points));
            }
        }
        (!lines.series.is_empty()).then_some(lines)
    }

    /// By both angles, and by generator angle, torque, temperature, speed, session.
    fn looks(&self) -> [PageSection; 2] {
        let rows = &self.rows;
        let mut blocks = Vec::new();
        let maps: Vec<(String, FieldMap)> =
            self.levels.iter().filter_map(|level| Some((level.id.to_owned(), self.map(level)?))).collect();
        if !maps.is_empty() {
            let caption = "Median of the rows in each cell; cells that were not visited are empty. What sits on the \
                           generator stands upright, what sits on the output lies flat, what sits on the wheel that \
                           turns runs aslant.";
            let body = FigureBody::Field {
                x: ChartAxis::new("Generator angle ψ in its turn", PageQuantity::Degree),
                y: ChartAxis::new("Output angle δ in its turn", PageQuantity::Degree),
                z: ChartAxis::new("Error less model", PageQuantity::Error),
                fields: maps,
            };
            blocks.push(PageBlock::Figure(Figure::of("map", "Over one turn of generator and output", caption, body)));
        }
        let turns: Vec<f64> = rows.generator.iter().map(|psi| psi / TAU).collect();
        blocks.extend(self.lines(
            "over-generator",
            "Over the generator angle",
            "Some rows of all, drawn evenly. This is measured error less what the model says, before anybody says why.",
            ChartAxis::new("Generator angle", PageQuantity::Turn),
            |level| {
                let mut lines = self.over(&turns, level)?;
                lines.series.retain(|series| series.mark == Mark::Dots);
                Some(lines)
            },
        ));
        for (recorded, values, id, over, axis, sees) in [
            (
                rows.recorded.torque,
                &rows.torque,
                "torque",
                "load torque",
                ChartAxis::new("Load torque", PageQuantity::Torque),
                "A slope is stiffness, a step at zero backlash, a loop hysteresis.",
            ),
            (
                rows.recorded.temperature,
                &rows.temperature,
                "temperature",
                "temperature",
                ChartAxis::new("Temperature", PageQuantity::Temperature),
                "A slope is stiffness or clearance that changes with the temperature.",
            ),
            (
                rows.recorded.time,
                &rows.speed,
                "speed",
                "generator speed",
                ChartAxis::new("Generator speed", PageQuantity::Speed),
                "Sensors read at different instants make a straight line through zero.",
            ),
        ] {
            if recorded && varies(values) {
                let caption = format!("Dots are some rows, lines medians of all. {sees}");
                let title = format!("Over the {over}");
                let over = |level: &Level| self.over(values, level);
                blocks.extend(self.lines(&format!("over-{id}"), &title, &caption, axis, over));
            }
        }
        let others = blocks.split_off(blocks.len().min(1));
        let title = "What the error looks like";
        [PageSection::new("picture", title, blocks), PageSection::folded("more", "By angle, load and speed", others)]
    }

    /// Medians over both turns.
    fn map(&self, level: &Level) -> Option<FieldMap> {
        let [across, up] = MAP;
        let place = |angle: f64, of: usize| ((angle.rem_euclid(TAU) / TAU * of as f64) as usize).min(of - 1);
        let mut cells: Vec<Vec<f64>> = vec![Vec::new(); across * up];
        for (k, value) in level.residual_arcsec.iter().enumerate() {
            cells[place(self.rows.output[k], up) * across + place(self.rows.generator[k], across)].push(*value);
        }
        let middle = |k: usize, of: usize| (k as f64 + 0.5) / of as f64 * 360.0;
        let z: Vec<f64> =
            cells.iter_mut().map(|c| if c.len() < FEWEST_IN_CELL { f64::NAN } else { median_of(c) }).collect();
        // Of an output that hardly turned there is no map.
        let visited = z.iter().filter(|value| value.is_finite()).count();
        (visited * 6 >= z.len()).then(|| FieldMap {
            x: (0..across).map(|k| middle(k, across)).collect(),
            y: (0..up).map(|k| middle(k, up)).collect(),
            z,
        })
    }

    /// The symbol of an angle, and the parts that turn with it.
    fn angle_name(&self, angle: Angle) -> (&'static str, &'static str) {
        let flexspline_turns =
            self.sources.nominal.teeth.is_some_and(|teeth| teeth.fixed == FixedMember::CircularSpline);
        match angle {
            Angle::Generator if flexspline_turns => ("ψ", "generator and circular spline"),
            Angle::Generator => ("ψ", "generator and flexspline"),
            Angle::GeneratorLessOutput if flexspline_turns => ("ψ − δ", "flexspline"),
            Angle::GeneratorLessOutput => ("ψ − δ", "circular spline"),
            Angle::Output => ("δ", "output, its encoder and its load"),
        }
    }

    fn spectra(&self) -> PageSection {
        let mut blocks = Vec::new();
        for (angle, id) in ANGLES {
            let (symbol, wheel) = self.angle_name(angle);
            let caption = format!(
                "Amplitude of the sine that explains most at each order ({wheel}: whole orders), and the level that \
                 noise exceeds nowhere but once in a thousand spectra. Points are lines above it."
            );
            blocks.extend(self.lines(
                &format!("orders-{id}"),
                &format!("Orders in a turn of {symbol}"),
                &caption,
                ChartAxis::new(format!("Waves in a turn of {symbol}"), PageQuantity::Count),
                |level| {
                    let spectrum = level.picture.as_ref()?.spectra.iter().find(|s| s.axis == angle)?;
                    if spectrum.orders.is_empty() {
                        return None;
                    }
                    let x = &spectrum.orders;
                    let curve = |y: &[f64]| x.iter().zip(y).map(|(x, y)| [*x, *y]).collect();
                    let (amplitude, noise) = (curve(&spectrum.amplitude_arcsec), curve(&spectrum.level_arcsec));
                    let peaks = spectrum.peaks.iter().map(|peak| [peak.order, peak.amplitude_arcsec]).collect();
                    let mut series = vec![
                        ChartSeries::new("amplitude", Mark::Line, 0, amplitude),
                        ChartSeries::new("level of noise", Mark::Dashed, 5, noise),
                    ];
                    if !spectrum.peaks.is_empty() {
                        series.push(ChartSeries::sorted("lines", Mark::Points, 1, peaks));
                    }
                    Some(Lines::of(series))
                },
            ));
        }
        blocks.extend(self.levels.iter().filter_map(|level| self.peak_table(level)));
        if blocks.is_empty() {
            blocks.push(PageBlock::paragraph("The drive turned too little for orders."));
        }
        PageSection::folded("orders", "Orders", blocks)
    }

    /// The lines of the spectra with the parts that have such orders.
    fn peak_table(&self, level: &Level) -> Option<PageBlock> {
        let mut rows = Vec::new();
        for (angle, _) in ANGLES {
            let (symbol, _) = self.angle_name(angle);
            let spectrum = level.picture.as_ref()?.spectra.iter().find(|s| s.axis == angle);
            for peak in spectrum.into_iter().flat_map(|s| &s.peaks).take(6) {
                let parts: Vec<String> = peak
                    .named
                    .iter()
                    .map(|named| {
                        let wheel = match named.axis {
                            Angle::Output => "output",
                            axis => self.angle_name(axis).1,
                        };
                        format!("{} of {wheel}", named.harmonic)
                    })
                    .collect();
                let parts = match parts.len() {
                    0 => "–".to_owned(),
                    1 => parts[0].clone(),
                    _ => format!("not distinguished: {}", words::listed(&parts)),
                };
                rows.push(vec![
                    RichText::new(format!("{} per turn of {symbol}", significant(peak.order, 5))),
                    plus_minus(peak.amplitude_arcsec, peak.amplitude_std_arcsec),
                    RichText::new(parts),
                ]);
            }
        }
        let header = ["Order", "Amplitude", "Parts with such an order"];
        let caption = "Lines above the noise, strongest first in each angle";
        (!rows.is_empty()).then(|| PageBlock::table(caption, &header, rows).of_choice(level.id))
    }
}

const ANGLES: [(Angle, &str); 3] =
    [(Angle::Generator, "generator"), (Angle::GeneratorLessOutput, "generator-less-output"), (Angle::Output, "output")];

fn varies(values: &[f64]) -> bool {
    let (low, high) = least_and_most(values.iter().copied());
    high - low > CHANGES * high.abs().max(low.abs())
}

/// A value in arcsec with its standard deviation.
fn plus_minus(value: f64, std: f64) -> RichText {
    RichText::arcsec(value, 3).plain("\u{a0}±\u{a0}").error(std, 2)
}
