//! The picture before the verdict: what the residual looks like over everything that was recorded.

use std::f64::consts::TAU;

use super::thin::{dots, medians, middle, peaks_kept, some_rows};
use super::{DiagnosisKnown, Shown, orders, words};
use crate::page::{
    Axis, Block, Detail, Field, Figure, FigureBody, Lines, Mark, PageQuantity, Section, Series, Table, Text, Upright,
    significant,
};
use flexspline_identify::nominal::Fixed;
use flexspline_identify::residual::{Axis as Angle, Direction, Wheel};

/// Points of a spectrum.
const SPECTRUM_POINTS: usize = 700;
/// Cells of the map, across and up.
const MAP: [usize; 2] = [72, 36];
/// Medians over a quantity.
const MEDIANS: usize = 24;
/// A quantity that changes by less than this share of itself is no axis.
const CHANGES: f64 = 0.03;
/// Rows that a cell needs before its median is shown.
const FEWEST_IN_CELL: usize = 2;
const DIRECTIONS: [(f64, &str); 2] = [(1.0, "forward"), (-1.0, "backward")];

impl DiagnosisKnown<'_> {
    pub(super) fn picture_sections(&self) -> Vec<Section> {
        vec![self.looks(), self.angles(), self.spectra(), self.drift()]
    }

    fn figure(&self, id: &str, title: &str, caption: &str, body: FigureBody) -> Block {
        Block::Figure(Figure {
            id: id.into(),
            title: title.into(),
            caption: Text::new(caption),
            alt: title.into(),
            body,
        })
    }

    fn charts(&self, of: impl Fn(&Shown) -> Option<Lines>) -> Vec<(String, Lines)> {
        self.shown.iter().filter_map(|shown| Some((shown.level.id.to_owned(), of(shown)?))).collect()
    }

    fn lines(
        &self,
        id: &str,
        title: &str,
        caption: &str,
        x: Axis,
        of: impl Fn(&Shown) -> Option<Lines>,
    ) -> Option<Block> {
        let charts = self.charts(of);
        let y = Axis::new("Error less model", PageQuantity::Error);
        (!charts.is_empty()).then(|| self.figure(id, title, caption, FigureBody::Lines { x, y, charts }))
    }

    /// Rows that move in a direction.
    fn rows_in(&self, direction: f64) -> Vec<usize> {
        (0..self.rows.len()).filter(|k| self.rows.direction[*k] == direction).collect()
    }

    /// Dots and medians over a quantity, by direction.
    fn over(&self, quantity: &[f64], shown: &Shown) -> Option<Lines> {
        let values = &shown.level.residual_arcsec;
        let mut lines = Lines::default();
        let some = some_rows(self.rows.len());
        for (colour, (direction, name)) in DIRECTIONS.into_iter().enumerate() {
            let here: Vec<usize> = some.iter().copied().filter(|k| self.rows.direction[*k] == direction).collect();
            if !here.is_empty() {
                lines.series.push(dots(quantity, values, &here, name, colour));
            }
        }
        for (colour, (direction, name)) in DIRECTIONS.into_iter().enumerate() {
            let median = medians(
                quantity,
                values,
                &self.rows_in(direction),
                MEDIANS,
                &format!("{name}, median"),
                Mark::Line,
                2 + colour,
            );
            if median.points.len() > 1 {
                lines.series.push(median);
            }
        }
        (!lines.series.is_empty()).then_some(lines)
    }

    /// By generator angle, torque, temperature, speed, session.
    fn looks(&self) -> Section {
        let rows = &self.rows;
        let mut blocks = Vec::new();
        let turns: Vec<f64> = rows.generator.iter().map(|psi| psi / TAU).collect();
        blocks.extend(self.lines(
            "over-generator",
            "Over the generator angle",
            "Some rows of all, drawn evenly. This is measured error less what the model says, before anybody says why.",
            Axis::new("Generator angle", PageQuantity::Turn),
            |shown| {
                let mut lines = self.over(&turns, shown)?;
                lines.series.retain(|series| series.mark == Mark::Dots);
                Some(lines)
            },
        ));
        let maps: Vec<(String, Field)> =
            self.shown.iter().filter_map(|shown| Some((shown.level.id.to_owned(), self.map(shown)?))).collect();
        if !maps.is_empty() {
            blocks.push(self.figure(
                "map",
                "Over one turn of generator and output",
                "Median of the rows in each cell; cells that were not visited are empty. What sits on the generator \
                 stands upright, what sits on the output lies flat, what sits on the wheel that turns runs aslant.",
                FigureBody::Field {
                    x: Axis::new("Generator angle ψ in its turn", PageQuantity::Degree),
                    y: Axis::new("Output angle δ in its turn", PageQuantity::Degree),
                    z: Axis::new("Error less model", PageQuantity::Error),
                    fields: maps,
                },
            ));
        }
        if rows.recorded.torque && varies(&rows.torque) {
            blocks.extend(self.lines(
                "over-torque",
                "Over the load torque",
                "Dots are some rows, lines medians of all. A slope is stiffness, a step at zero backlash, a loop \
                 hysteresis.",
                Axis::new("Load torque", PageQuantity::Torque),
                |shown| self.over(&rows.torque, shown),
            ));
        }
        if rows.recorded.temperature && varies(&rows.temperature) {
            blocks.extend(self.lines(
                "over-temperature",
                "Over the temperature",
                "Dots are some rows, lines medians of all.",
                Axis::new("Temperature", PageQuantity::Temperature),
                |shown| self.over(&rows.temperature, shown),
            ));
        }
        if rows.recorded.time && varies(&rows.speed) {
            blocks.extend(self.lines(
                "over-speed",
                "Over the generator speed",
                "Dots are some rows, lines medians of all. Sensors read at different instants make a straight line \
                 through zero.",
                Axis::new("Generator speed", PageQuantity::Speed),
                |shown| self.over(&rows.speed, shown),
            ));
        }
        if rows.sessions.len() > 1 {
            blocks.extend(self.lines(
                "over-session",
                "By session",
                "Median of each session, and the bounds between which nine rows of ten lie.",
                Axis::new("Session", PageQuantity::Whole),
                |shown| {
                    let each: Vec<[f64; 3]> =
                        rows.sessions.iter().map(|s| middle(shown.level.residual_arcsec[s.clone()].to_vec())).collect();
                    let series = |name: &str, part: usize, mark, colour| Series {
                        name: name.into(),
                        mark,
                        colour,
                        points: each.iter().enumerate().map(|(k, m)| [(k + 1) as f64, m[part]]).collect(),
                    };
                    Some(Lines {
                        series: vec![
                            series("a twentieth below", 1, Mark::Dashed, 5),
                            series("median", 0, Mark::Points, 0),
                            series("a twentieth above", 2, Mark::Dashed, 5),
                        ],
                        ..Lines::default()
                    })
                },
            ));
        }
        blocks.extend(self.shown.iter().filter_map(group_table));
        Section { id: "picture".into(), title: "What the error looks like".into(), detail: Detail::Summary, blocks }
    }

    /// Medians over both turns.
    fn map(&self, shown: &Shown) -> Option<Field> {
        let [across, up] = MAP;
        let place = |angle: f64, of: usize| ((angle.rem_euclid(TAU) / TAU * of as f64) as usize).min(of - 1);
        let mut cells: Vec<Vec<f64>> = vec![Vec::new(); across * up];
        for (k, value) in shown.level.residual_arcsec.iter().enumerate() {
            cells[place(self.rows.output[k], up) * across + place(self.rows.generator[k], across)].push(*value);
        }
        let middle = |k: usize, of: usize| (k as f64 + 0.5) / of as f64 * 360.0;
        let z: Vec<f64> = cells
            .iter_mut()
            .map(|c| if c.len() < FEWEST_IN_CELL { f64::NAN } else { flexspline_identify::measurement::median_of(c) })
            .collect();
        // Of an output that hardly turned there is no map.
        let visited = z.iter().filter(|value| value.is_finite()).count();
        (visited * 6 >= z.len()).then(|| Field {
            x: (0..across).map(|k| middle(k, across)).collect(),
            y: (0..up).map(|k| middle(k, up)).collect(),
            z,
        })
    }

    /// What an angle is called, and what sits on it.
    fn angle_name(&self, angle: Angle) -> (&'static str, &'static str) {
        let flexspline_turns = self.sources.nominal.teeth.is_some_and(|teeth| teeth.fixed == Fixed::CircularSpline);
        match angle {
            Angle::Generator if flexspline_turns => ("ψ", "generator and circular spline"),
            Angle::Generator => ("ψ", "generator and flexspline"),
            Angle::GeneratorLessOutput if flexspline_turns => ("ψ − δ", "flexspline"),
            Angle::GeneratorLessOutput => ("ψ − δ", "circular spline"),
            Angle::Output => ("δ", "output, its encoder and its load"),
        }
    }

    fn angles(&self) -> Section {
        let mut blocks = Vec::new();
        for (angle, id) in ANGLES {
            let (symbol, wheel) = self.angle_name(angle);
            blocks.extend(self.lines(
                &format!("angle-{id}"),
                &format!("Over one turn of {symbol}: {wheel}"),
                "Medians of bins of three degrees, by direction. A sound drive has what its nominal model has, and \
                 these are flat.",
                Axis::new(format!("{symbol} in its turn"), PageQuantity::Degree),
                |shown| {
                    let mut lines = Lines::default();
                    for map in shown.picture.as_ref()?.maps.iter().filter(|map| map.axis == angle) {
                        let forward = map.direction == Direction::Forward;
                        let (name, colour) = if forward { ("forward", 0) } else { ("backward", 1) };
                        let points =
                            map.bins.iter().map(|bin| [bin.angle_rad.to_degrees(), bin.median_arcsec]).collect();
                        lines.series.push(Series { name: name.into(), mark: Mark::Line, colour, points });
                    }
                    (!lines.series.is_empty()).then_some(lines)
                },
            ));
        }
        Section {
            id: "angles".into(),
            title: "Over the angle of each wheel".into(),
            detail: Detail::Engineering,
            blocks,
        }
    }

    fn spectra(&self) -> Section {
        let (nominal, causes) = (self.sources.nominal, &self.sources.diagnosis.causes);
        let mut blocks = Vec::new();
        for (angle, id) in ANGLES {
            let (symbol, wheel) = self.angle_name(angle);
            let caption = format!(
                "Amplitude of the sine that explains most at each order ({wheel}: whole orders), and the level that \
                 noise exceeds nowhere but once in a thousand spectra. Points are lines above it. Upright: where the \
                 causes that were named put theirs."
            );
            blocks.extend(self.lines(
                &format!("orders-{id}"),
                &format!("Orders in a turn of {symbol}"),
                &caption,
                Axis::new(format!("Waves in a turn of {symbol}"), PageQuantity::Count),
                |shown| {
                    let spectrum = shown.picture.as_ref()?.spectra.iter().find(|s| s.axis == angle)?;
                    if spectrum.orders.is_empty() {
                        return None;
                    }
                    let curve = |name: &str, y: &[f64], mark, colour| Series {
                        name: name.into(),
                        mark,
                        colour,
                        points: peaks_kept(&spectrum.orders, y, SPECTRUM_POINTS),
                    };
                    let level = Series {
                        name: "level of noise".into(),
                        mark: Mark::Dashed,
                        colour: 5,
                        points: spectrum
                            .orders
                            .iter()
                            .zip(&spectrum.level_arcsec)
                            .step_by(spectrum.orders.len().div_ceil(150).max(1))
                            .map(|(x, y)| [*x, *y])
                            .collect(),
                    };
                    let mut peaks: Vec<[f64; 2]> =
                        spectrum.peaks.iter().map(|peak| [peak.order, peak.amplitude_arcsec]).collect();
                    peaks.sort_by(|a, b| a[0].total_cmp(&b[0]));
                    let mut lines = Lines {
                        series: vec![curve("amplitude", &spectrum.amplitude_arcsec, Mark::Line, 0), level],
                        ..Lines::default()
                    };
                    if !peaks.is_empty() {
                        lines.series.push(Series {
                            name: "lines".into(),
                            mark: Mark::Points,
                            colour: 1,
                            points: peaks,
                        });
                    }
                    let (low, high) = (spectrum.orders[0], spectrum.orders[spectrum.orders.len() - 1]);
                    for cause in causes {
                        let places =
                            orders::along(cause, angle, nominal).into_iter().filter(|x| (low..=high).contains(x));
                        for x in places {
                            let name = format!("{}: {}", cause.name.words(), words::order(x));
                            lines.uprights.push(Upright { name, x });
                        }
                    }
                    lines.uprights.sort_by(|a, b| a.x.total_cmp(&b.x));
                    Some(lines)
                },
            ));
        }
        blocks.extend(self.shown.iter().filter_map(|shown| self.peak_table(shown)));
        blocks.extend(self.shown.iter().filter_map(pulse_table));
        if blocks.is_empty() {
            blocks.push(Block::paragraph("The drive turned too little for orders."));
        }
        Section { id: "orders".into(), title: "Orders".into(), detail: Detail::Engineering, blocks }
    }

    /// The lines of the spectra with the parts that have such orders.
    fn peak_table(&self, shown: &Shown) -> Option<Block> {
        let mut rows = Vec::new();
        for (angle, _) in ANGLES {
            let (symbol, _) = self.angle_name(angle);
            let spectrum = shown.picture.as_ref()?.spectra.iter().find(|s| s.axis == angle);
            for peak in spectrum.into_iter().flat_map(|s| &s.peaks).take(6) {
                let parts: Vec<String> = peak
                    .named
                    .iter()
                    .map(|named| {
                        let wheel = match named.wheel {
                            Wheel::FlexsplineOrGenerator => self.angle_name(Angle::Generator).1,
                            Wheel::CircularSpline => self.angle_name(Angle::GeneratorLessOutput).1,
                            Wheel::Output => "output",
                        };
                        format!("{} of {wheel}", named.harmonic)
                    })
                    .collect();
                let parts = match parts.len() {
                    0 => "–".to_owned(),
                    1 => parts[0].clone(),
                    _ => format!("not told apart: {}", words::listed(&parts)),
                };
                rows.push(vec![
                    Text::new(format!("{} per turn of {symbol}", significant(peak.order, 5))),
                    Text::default()
                        .error(peak.amplitude_arcsec, 3)
                        .plain("\u{a0}±\u{a0}")
                        .error(peak.amplitude_std_arcsec, 2),
                    Text::new(parts),
                ]);
            }
        }
        let header = ["Order", "Amplitude", "Parts with such an order"].map(str::to_owned).into();
        let table = Table { caption: "Lines above the noise, strongest first in each angle".into(), header, rows };
        (!table.rows.is_empty()).then(|| Block::Table { choice: Some(shown.level.id.into()), table })
    }

    fn drift(&self) -> Section {
        let rows = &self.rows;
        let mut blocks = Vec::new();
        let caption = "Medians of up to 24 stretches of each session, a standard deviation on either side; breaks \
                       between sessions are taken out.";
        blocks.extend(self.lines("drift", "Over time", caption, self.time_axis(), |shown| {
            let drift = &shown.picture.as_ref()?.drift;
            let mut parts: [Vec<[f64; 2]>; 3] = Default::default();
            for session in drift {
                let Some(begin) = self.clock.begins.get(session.session) else { continue };
                let first = rows.sessions.get(session.session).map_or(0, |s| s.start);
                let start = if session.unit == "s" { rows.time[first] } else { 0.0 };
                for (k, shift) in [0.0, 1.0, -1.0].into_iter().enumerate() {
                    if let Some([x, _]) = parts[k].last().copied() {
                        parts[k].push([0.5 * (x + begin), f64::NAN]);
                    }
                    let points = session.stretches.iter();
                    parts[k].extend(points.map(|s| [begin + s.at - start, s.median_arcsec + shift * s.spread_arcsec]));
                }
            }
            let [median, above, below] = parts;
            let series = |name: &str, colour, points| Series { name: name.into(), mark: Mark::Broken, colour, points };
            Some(Lines {
                series: vec![series("median", 0, median), series("above", 5, above), series("below", 5, below)],
                uprights: self.clock.borders(),
                ..Lines::default()
            })
        }));
        blocks.extend(self.shown.iter().filter_map(|shown| {
            let noise = shown.picture.as_ref()?.noise;
            let text = Text::new("White noise of a row ")
                .error(noise.white_arcsec, 2)
                .plain("; what remembers, lines taken out, ")
                .error(noise.correlated_arcsec, 2)
                .plain(format!(
                    ", over {} rows: the data are worth {} independent rows.",
                    significant(noise.decorrelation_rows, 2),
                    significant(noise.independent_rows, 2)
                ));
            Some(Block::Paragraph { choice: Some(shown.level.id.into()), text })
        }));
        Section { id: "drift-section".into(), title: "Drift and noise".into(), detail: Detail::Engineering, blocks }
    }
}

const ANGLES: [(Angle, &str); 3] =
    [(Angle::Generator, "generator"), (Angle::GeneratorLessOutput, "generator-less-output"), (Angle::Output, "output")];

fn varies(values: &[f64]) -> bool {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    high - low > CHANGES * high.abs().max(low.abs())
}

/// Statistics of the groups of a level.
fn group_table(shown: &Shown) -> Option<Block> {
    const MOST: usize = 40;
    let picture = shown.picture.as_ref()?;
    let by = |name: &str| match name {
        "torque_n_m" => ("torque ", " N·m"),
        "temperature_c" => ("temperature ", " °C"),
        "generator_speed_rad_s" => ("speed ", " rad/s"),
        _ => ("", ""),
    };
    let rows: Vec<Vec<Text>> = picture
        .groups
        .iter()
        .filter(|grouping| match grouping.by {
            "session" => grouping.groups.len() > 1,
            // A speed that is the same throughout is parted by its noise.
            _ => match (grouping.groups.first().and_then(|g| g.range), grouping.groups.last().and_then(|g| g.range)) {
                (Some([low, _]), Some([_, high])) => varies(&[low, high]),
                _ => true,
            },
        })
        .flat_map(|grouping| grouping.groups.iter().map(|group| (by(grouping.by), group)))
        .take(MOST)
        .map(|((before, after), group)| {
            let s = group.statistics;
            let name = match group.range {
                Some([from, to]) => format!("{before}{} to {}{after}", significant(from, 3), significant(to, 3)),
                None => group.label.clone(),
            };
            let error = |arcsec: f64| Text::default().error(arcsec, 3);
            vec![
                Text::new(name),
                Text::new(s.count.to_string()),
                error(s.median_arcsec),
                error(s.spread_arcsec),
                error(s.rms_arcsec),
                error(s.low_arcsec).plain(" to ").error(s.high_arcsec, 3),
            ]
        })
        .collect();
    let header = ["Rows", "Number", "Median", "Robust spread", "rms", "Nine of ten"].map(str::to_owned).into();
    let table = Table { caption: "Error less the model, by what the drive did".into(), header, rows };
    Some(Block::Table { choice: Some(shown.level.id.into()), table })
}

/// Pulses that stay in one position.
fn pulse_table(shown: &Shown) -> Option<Block> {
    let pulses = &shown.picture.as_ref()?.pulses;
    let rows: Vec<Vec<Text>> = pulses
        .iter()
        .map(|pulse| {
            let angle = match pulse.axis {
                Angle::Generator => "ψ",
                Angle::GeneratorLessOutput => "ψ − δ",
                Angle::Output => "δ",
            };
            vec![
                Text::new(format!("{angle} = {}°", significant(pulse.position_rad.to_degrees(), 3))),
                Text::default().error(pulse.height_arcsec, 3).plain("\u{a0}±\u{a0}").error(pulse.height_std_arcsec, 2),
                Text::new(format!("{}°", significant(pulse.width_rad.to_degrees(), 2))),
                Text::new(pulse.per_turn.to_string()),
            ]
        })
        .collect();
    let header = ["Where", "Height", "Width", "In a turn"].map(str::to_owned).into();
    let table = Table { caption: "Pulses that stay in one position".into(), header, rows };
    (!table.rows.is_empty()).then(|| Block::Table { choice: Some(shown.level.id.into()), table })
}
