//! The page of a diagnosis: what an analyst with a log file sees.
//!
//! The answer first, in one sentence and one number; then the causes, the picture and what to record next; the rest is
//! folded: the gain, the pictures of orders and over time, the data. Residuals come row by row in three levels
//! (nominal, recalibrated, with the causes), and a selector shows the picture of each: the last is without what the
//! causes explain.

mod picture;
mod thin;
mod words;

use rayon::prelude::*;
use serde_json::json;

use super::page::{
    ChartAxis, Choice, Headline, Lines, Page, PageBlock, PageQuantity, PageSection, RichText, SIGNS, Status,
    significant,
};
use flexspline_base::robust::least_and_most;
use flexspline_design::stated;
use flexspline_identify::causes::CauseName;
use flexspline_identify::diagnosis::base::{BETWEEN_READINGS, CHANGE_OF_FLANK};
use flexspline_identify::diagnosis::report::{Cause, Diagnosis, Finding, Parameter, Unexplained, Verdict};
use flexspline_identify::diagnosis::rows::Rows;
use flexspline_identify::diagnosis::{Series, WrittenTable};
use flexspline_identify::measurement::{Fault, Recording, Session};
use flexspline_identify::nominal::Nominal;
use flexspline_identify::residual::Picture;
use thin::Clock;

/// Rows that a table of the data shows at most; the rest is in diagnosis.json.
const MOST: usize = 60;

/// Inputs of the page.
pub struct DiagnosisSources<'a> {
    /// The data.
    pub recording: &'a Recording,
    /// The model.
    pub nominal: &'a Nominal,
    /// The diagnosis.
    pub diagnosis: &'a Diagnosis,
    /// The table that it ends in.
    pub table: &'a WrittenTable,
    /// What the models predict for the rows of each session.
    pub series: &'a [Series],
    /// The causes of these series, in their order.
    pub causes: Vec<CauseName>,
    /// The command line.
    pub command: &'a str,
    /// Further provenance: name and value.
    pub inputs: Vec<(String, String)>,
}

/// The residual of one model, and its picture.
struct Level {
    /// Which model; letters.
    id: &'static str,
    /// Name, as the reader sees it.
    name: &'static str,
    /// Measured error less the model, arcsec, a value for each row of all sessions.
    residual_arcsec: Vec<f64>,
    picture: Option<Picture>,
}

/// All that figures are drawn from.
struct DiagnosisKnown<'a> {
    sources: DiagnosisSources<'a>,
    rows: Rows,
    clock: Clock,
    /// The nominal model first.
    levels: Vec<Level>,
    /// What each cause adds to the prediction, arcsec, a value for each row of all sessions.
    parts: Vec<(CauseName, Vec<f64>)>,
}

/// A model: letters, its name, and what it predicts.
type PredictedBy = (&'static str, &'static str, fn(&Series) -> &[f64]);

/// The page of a diagnosis.
pub fn page(sources: DiagnosisSources<'_>) -> Page {
    let DiagnosisSources { recording, nominal, diagnosis, series, causes, .. } = &sources;
    let rows = Rows::new(&recording.sessions, nominal);
    let models: [PredictedBy; 3] = [
        ("nominal", "nominal", |series| &series.nominal_arcsec),
        ("recalibrated", "recalibrated", |series| &series.recalibrated_arcsec),
        ("extended", "with the causes", |series| &series.extended_arcsec),
    ];
    // What was tried and not named is in no model that a reader is shown.
    let (models, causes) =
        if diagnosis.causes.is_empty() { (&models[..2], &[][..]) } else { (&models[..], &causes[..]) };
    let level = |&(id, name, predicted): &PredictedBy| {
        let residual_arcsec: Vec<f64> = series.iter().flat_map(|series| series.less(predicted(series))).collect();
        let picture = Picture::of(&rows, &residual_arcsec, nominal.ratio).ok();
        Level { id, name, residual_arcsec, picture }
    };
    let levels = models.par_iter().map(level).filter(|level| level.residual_arcsec.len() == rows.len()).collect();
    let part = |(k, cause): (usize, &CauseName)| {
        let of_session = |series: &Series| series.cause_arcsec.get(k).cloned().unwrap_or_default();
        (*cause, series.iter().flat_map(of_session).collect::<Vec<f64>>())
    };
    let parts = causes.iter().enumerate().map(part).filter(|(_, adds)| adds.len() == rows.len()).collect();
    DiagnosisKnown { clock: Clock::new(&rows), rows, levels, parts, sources }.page()
}

impl DiagnosisKnown<'_> {
    fn page(&self) -> Page {
        let DiagnosisSources { recording, nominal, diagnosis, command, inputs, .. } = &self.sources;
        let (status, also) = self.status();
        let [picture, pictures @ ..] = self.picture_sections();
        let mut sections: Vec<PageSection> = self.causes().into_iter().chain([picture, self.next()]).collect();
        sections.extend([self.gain(), self.before_and_after()]);
        sections.extend(pictures);
        sections.extend([self.data(), self.reading()]);
        let teeth = nominal
            .teeth
            .map_or_else(String::new, |teeth| format!(", {} and {} teeth", teeth.flexspline, teeth.circular_spline));
        let mut provenance = vec![
            ("Command".to_owned(), (*command).to_owned()),
            ("Version".to_owned(), format!("flexspline {}", env!("CARGO_PKG_VERSION"))),
            ("Measured data".to_owned(), recording.file.clone()),
            ("Rows".to_owned(), recording.rows.to_string()),
            ("Gear".to_owned(), format!("ratio {}{teeth}", nominal.ratio)),
        ];
        provenance.extend(inputs.iter().cloned());
        let choice = |level: &Level| Choice { id: level.id.into(), name: level.name.into() };
        let results = [
            ("diagnosis", json!(diagnosis)),
            ("data_faults", json!(recording.faults)),
            ("notes", json!(recording.notes)),
        ];
        let name = std::path::Path::new(&recording.file).file_name();
        let name = name.map_or_else(|| recording.file.clone(), |name| name.to_string_lossy().into_owned());
        Page {
            title: format!("Diagnosis of {name}"),
            command_name: "diagnose",
            status,
            also,
            remarks: self.remarks(),
            choices: self.levels.iter().map(choice).collect(),
            choice_is: "Error less the model:",
            headlines: vec![self.headline()],
            sections,
            provenance,
            results: results.map(|(name, value)| (name.to_owned(), value)).into_iter().collect(),
            ..Page::default()
        }
    }

    fn status(&self) -> (Status, Vec<Status>) {
        let faults = !self.sources.recording.faults.is_empty();
        // What was found about the unit, not how well a curve fits.
        let status = match self.sources.diagnosis.finding {
            Finding::FaultFound => Status::FaultFound,
            Finding::NotUnderstood => Status::NotUnderstood,
            Finding::DataUnusable => return (Status::DataFaults, Vec::new()),
            Finding::NothingFound if faults => return (Status::DataFaults, Vec::new()),
            Finding::NothingFound => Status::Good,
        };
        (status, if faults { vec![Status::DataFaults] } else { Vec::new() })
    }

    /// `sessions left out`, or what stands for them.
    fn left_out(&self) -> &'static str {
        if self.rows.sessions.len() >= 3 {
            "sessions left out of the fit"
        } else {
            "quarters of the data left out of the fit"
        }
    }

    /// Departure from the nominal model beyond noise, arcsec rms. Lines that averages hide are not in the residual:
    /// where that is no more than noise they are what departs. Otherwise what was found is part of it, and two parts
    /// may cancel one another.
    fn departure_arcsec(&self) -> f64 {
        let (left, unexplained) = (self.sources.diagnosis.residual, &self.sources.diagnosis.unexplained);
        let beyond = (left.rms_before_arcsec.powi(2) - left.noise_floor_arcsec.powi(2)).max(0.0).sqrt();
        let found = unexplained.iter().map(|u| u.size_arcsec).fold(0.0, f64::max);
        if beyond > left.noise_floor_arcsec { beyond } else { beyond.max(found) }
    }

    fn headline(&self) -> Headline {
        let diagnosis = self.sources.diagnosis;
        let causes = &diagnosis.causes;
        let listed = |mut text: RichText| {
            for (k, cause) in causes.iter().enumerate() {
                let between = match k {
                    0 => "",
                    k if k + 1 == causes.len() => " and ",
                    _ => ", ",
                };
                text = words::named(text.plain(between), cause);
            }
            text.plain(".")
        };
        // No second percentage next to the confidence: the residuals prove the causes.
        let fell = |from: f64, to: f64| RichText::arcsec(from, 2).plain(" → ").error(to, 2);
        let (corrected, held) = (diagnosis.compensation, diagnosis.held_out);
        let written = self.sources.table;
        let (share, share_is) = match &written.file {
            Some(file) if corrected.is_known() => {
                let (nominal, left) = (corrected.rms_nominal_tables_arcsec, written.rms_left_out_arcsec);
                // A nominal table that was fitted to these rows is no measure.
                let none = (corrected.rms_uncompensated_arcsec, "without a table");
                let (before, without) = if left < nominal { (nominal, "with the nominal table") } else { none };
                (fell(before, left), format!("left after correction, {without} and with {file}"))
            }
            _ => (fell(held.rms_before_arcsec, held.rms_after_arcsec), "without the causes and with them".to_owned()),
        };
        let share_is = format!("rms in {}, {share_is}", self.left_out());
        let explained = |how: &str| match diagnosis.open_between(CauseName::words) {
            Some(open) => format!("{how}, {}.", open.replace(" %", "\u{a0}%")).into(),
            None => listed(format!("{how} by ").into()),
        };
        let departure = RichText::arcsec(self.departure_arcsec(), 2);
        let (answer, number, number_is) = match diagnosis.verdict {
            Verdict::Explained => (explained("Explained"), share, share_is.as_str()),
            Verdict::PartlyExplained => (explained("Partly explained"), share, share_is.as_str()),
            Verdict::Unknown if diagnosis.finding == Finding::DataUnusable => {
                let why = self.sources.recording.unusable.as_deref();
                let why = why.unwrap_or("their faults hide what the drive does");
                let answer = format!("Data not usable: {why}.").into();
                (answer, departure, "rms beyond noise, of which nothing can be said")
            }
            Verdict::Unknown => {
                let answer =
                    "Unknown: the drive departs from the nominal model, and no cause in the library explains how.";
                (answer.into(), departure, "rms beyond noise, of unknown cause")
            }
            Verdict::None => {
                let answer = "Nothing found: the drive does what the nominal model says, within noise and the spread \
                              between units.";
                let number = RichText::arcsec(diagnosis.residual.rms_before_arcsec, 3);
                (answer.into(), number, "rms error of the nominal model, recalibrated to this unit")
            }
        };
        Headline::new(answer, number, number_is)
    }

    /// The table, and faults of the data, a sentence each.
    fn remarks(&self) -> Vec<String> {
        const FIRST: usize = 5;
        let recording = self.sources.recording;
        let mut remarks = vec![format!("{}.", self.sources.table.text().replacen("table:", "Table:", 1))];
        let fault =
            |fault: &Fault| format!("Data fault: {}; {}.", words::of(&fault.name), fault.what.trim_end_matches('.'));
        remarks.extend(recording.faults.iter().take(FIRST).map(fault));
        if recording.faults.len() > FIRST {
            remarks.push(format!("{} more data faults are in the table below.", recording.faults.len() - FIRST));
        }
        remarks
    }

    fn before_and_after(&self) -> PageSection {
        let over_time = |id, title, caption, y, curves: &mut dyn Iterator<Item = (&'static str, &[f64], usize)>| {
            let series = curves.map(|(name, of, colour)| thin::envelope(&self.rows, &self.clock, of, name, colour));
            let chart = Lines { series: series.collect(), uprights: self.clock.borders(), ..Lines::default() };
            let axes = [self.time_axis(), ChartAxis::new(y, PageQuantity::Error)];
            PageBlock::lines(id, title, caption, axes, chart.for_every_choice())
        };
        let levels = self.levels.iter().zip([5, 0, 1]);
        let mut blocks = vec![over_time(
            "over-time",
            "Residual of each model over time",
            "Least and largest of each stretch of rows, so that single rows show. Nominal: the model as it was given. \
             Recalibrated: its zero, stiffness, backlash and harmonics as this unit has them, within the spread \
             between units. With the causes: what was named is in the model. Breaks between sessions are taken out.",
            "Error less model",
            &mut levels.map(|(level, colour)| (level.name, level.residual_arcsec.as_slice(), colour)),
        )];
        if !self.parts.is_empty() {
            let parts = self.parts.iter().enumerate();
            blocks.push(over_time(
                "added",
                "What each cause adds, over time",
                "Least and largest of each stretch of rows of what it adds to the prediction.",
                "Adds to the error",
                &mut parts.map(|(k, (cause, adds))| (cause.words(), adds.as_slice(), k)),
            ));
        }
        PageSection::folded("before-after", "Before and after", blocks)
    }

    fn time_axis(&self) -> ChartAxis {
        if self.rows.recorded.time {
            ChartAxis::new("Time, breaks taken out", PageQuantity::Second)
        } else {
            ChartAxis::new("Row", PageQuantity::Count)
        }
    }

    /// The causes, and what has none.
    fn causes(&self) -> Option<PageSection> {
        let diagnosis = self.sources.diagnosis;
        let mut blocks = Vec::new();
        if !diagnosis.causes.is_empty() {
            let row = |cause: &Cause| {
                let alike = alike(cause);
                vec![
                    words::begun(cause.name.words()).into(),
                    words::percent(cause.confidence).into(),
                    RichText::arcsec(cause.size_arcsec, 3),
                    words::percent(cause.held_out_gain).into(),
                    words::parameters(cause).into(),
                    if alike.is_empty() { "none".into() } else { words::listed(&alike).into() },
                ]
            };
            let header = [
                "Cause",
                "Confidence",
                "Size, rms",
                "Gain left out",
                "Parameters ± one standard deviation",
                "Look-alikes",
            ];
            let rows = diagnosis.causes.iter().map(row).collect();
            blocks.push(PageBlock::table("Causes, likeliest first", &header, rows));
            let does =
                diagnosis.causes.iter().map(|of| format!("{}: {}.", words::begun(of.name.words()), of.name.does()));
            blocks.push(PageBlock::paragraph(does.collect::<Vec<_>>().join(" ")));
        }
        if !diagnosis.unexplained.is_empty() {
            let row = |left: &Unexplained| {
                vec![words::begun(&left.looks_like.replace('_', " ")).into(), RichText::arcsec(left.size_arcsec, 3)]
            };
            let rows = diagnosis.unexplained.iter().map(row).collect();
            blocks.push(PageBlock::table("The residual without a known cause", &["It looks like", "Size, rms"], rows));
            let sure = if diagnosis.verdict == Verdict::Unknown {
                "Names of causes in this table say what the remainder resembles most; they are not a finding."
            } else {
                "These describe the remainder; they are no causes, and nothing of them is in the extended model."
            };
            blocks.push(PageBlock::paragraph(sure));
        }
        (!blocks.is_empty()).then(|| PageSection::new("causes", "Causes", blocks))
    }

    /// The gain of the causes.
    fn gain(&self) -> PageSection {
        let Diagnosis { residual, held_out, compensation, noise_arcsec, wander_correlation_s, .. } =
            self.sources.diagnosis;
        let row = |name: &str, before: f64, after: f64| {
            let change = if before > 0.0 { format!("{:+.0} %", 100.0 * (after / before - 1.0)) } else { "–".into() };
            let [before, after] = [before, after].map(|arcsec| RichText::arcsec(arcsec, 3));
            vec![name.into(), before, after, change.replace('-', "−").into()]
        };
        let all = PageBlock::table(
            "Error of the prediction, rms",
            &["Over", "Recalibrated nominal", "With the causes", "Change"],
            vec![
                row("all data", residual.rms_before_arcsec, residual.rms_after_arcsec),
                row(self.left_out(), held_out.rms_before_arcsec, held_out.rms_after_arcsec),
            ],
        );
        let means = match residual.rows_averaged {
            0 | 1 => String::new(),
            rows => format!(" in means of {rows} rows"),
        };
        let unit = if self.rows.recorded.time { "s" } else { "rows" };
        let noise = format!(
            "Noise and drift of the measurement are {{}} of it{means}: white noise of {{}} in a row, and red noise of \
             {{}} with a correlation time of {} {unit}. {} of the squared error beyond that is left unexplained. A \
             table on board is not adapted to the zero, stiffness and backlash of these data, and so leaves another \
             error.",
            significant(*wander_correlation_s, 2),
            words::percent(residual.unexplained_fraction)
        );
        let [white, red] = *noise_arcsec;
        let errors = [(residual.noise_floor_arcsec, 3), (white, 2), (red, 2)];
        let noise = PageBlock::paragraph(RichText::filled(&noise, &errors));
        let none = compensation.rms_uncompensated_arcsec;
        let line = |name: &str, arcsec: f64| {
            let share = if none > 0.0 { format!("{:.0} %", 100.0 * arcsec / none) } else { "–".into() };
            vec![name.into(), RichText::arcsec(arcsec, 3), share.into()]
        };
        let pointing = PageBlock::table(
            "Pointing error with the output corrected, rms about the mean",
            &["Correction", "Left", "Of uncorrected"],
            vec![
                line("none", none),
                line("nominal tables", compensation.rms_nominal_tables_arcsec),
                line(&format!("extended tables, in {}", self.left_out()), compensation.rms_extended_tables_arcsec),
            ]
            .into_iter()
            .chain(compensation.rms_calibrated_table_arcsec.map(|left| line("calibrated table", left)))
            .collect(),
        );
        // The number that a joint feels, then what is behind it.
        let mut blocks = vec![pointing, all, noise];
        let rows = self.recalibrated_rows();
        if !rows.is_empty() {
            let header = ["Parameter", "Against nominal"];
            blocks.push(PageBlock::table("The nominal model as this unit has it", &header, rows));
            blocks.push(PageBlock::paragraph(
                "Within the spread between units: wind-up and clearance by these shares of nominal, each harmonic by \
                 a share of its amplitude in phase with it and a quarter of a wave before it. The zero is that of the \
                 encoder.",
            ));
        }
        PageSection::folded("gain", "What it gains", blocks)
    }

    /// The free parameters of the nominal model, with the order of a harmonic.
    fn recalibrated_rows(&self) -> Vec<Vec<RichText>> {
        let recalibrated = &self.sources.diagnosis.recalibrated;
        // Harmonics are numbered by their place, two for each of the model.
        let mut waves: Vec<(usize, &String)> = recalibrated
            .keys()
            .filter(|name| name.starts_with("harmonic"))
            .map(|name| (name.trim_start_matches(|c: char| !c.is_ascii_digit()).parse().unwrap_or(0), name))
            .collect();
        waves.sort_unstable();
        let known = waves.len() == 2 * self.sources.nominal.harmonics.len();
        let wave = |name: &String| {
            let place = waves.iter().position(|(_, other)| *other == name).filter(|_| known)?;
            let order = self.sources.nominal.harmonics[place / 2].order_per_generator_turn;
            let phase = if place % 2 == 0 { "in phase" } else { "a quarter before" };
            Some((place, format!("Harmonic of order {}, {phase}", stated::short(order))))
        };
        let mut rows: Vec<(usize, Vec<RichText>)> = recalibrated
            .iter()
            .map(|(name, p)| {
                let value = recalibrated_value(name, *p);
                let plain = if name == "stiffness" { "wind-up".to_owned() } else { name.replace('_', " ") };
                let (place, name) = wave(name).map_or((0, words::begun(&plain)), |(place, text)| (1 + place, text));
                (place, vec![RichText::new(name), value])
            })
            .collect();
        rows.sort_by_key(|(place, _)| *place);
        rows.into_iter().map(|(_, row)| row).collect()
    }

    fn next(&self) -> PageSection {
        let text = match &self.sources.diagnosis.next_experiment {
            Some(next) => RichText::default().strong("Record next: ").plain(format!("{next}.")),
            None if self.sources.diagnosis.verdict == Verdict::Unknown => RichText::new(
                "The same motion again, on another day, shows whether the remainder is the drive's. Torque, \
                 temperature and orientation, where they were not recorded, distinguish more causes.",
            ),
            None => RichText::new("Nothing: no two causes explain these data equally well."),
        };
        PageSection::new("next", "What to record next", vec![PageBlock::paragraph(text)])
    }

    /// The data: sessions, faults, notes.
    fn data(&self) -> PageSection {
        let recording = self.sources.recording;
        let mut blocks = Vec::new();
        if recording.faults.is_empty() {
            blocks.push(PageBlock::paragraph("No faults were found in the data."));
        } else {
            let row = |fault: &Fault| {
                let when = match (fault.time_s, fault.until_s) {
                    (Some(a), Some(b)) if b > a => format!("{a:.2} s to {b:.2} s"),
                    (Some(a), _) => format!("{a:.2} s"),
                    _ => "–".into(),
                };
                let lines = if fault.last_line > fault.first_line {
                    format!("{} to {}", fault.first_line, fault.last_line)
                } else {
                    fault.first_line.to_string()
                };
                vec![
                    words::begun(&words::of(&fault.name)).into(),
                    when.into(),
                    lines.into(),
                    fault.rows.to_string().into(),
                    fault.size_arcsec.map_or("–".into(), |size| RichText::arcsec(size, 3)),
                    words::of(&fault.treatment).into(),
                    fault.what.clone().into(),
                    fault.advice.into(),
                ]
            };
            let header = ["Fault", "When", "Lines of the file", "Rows", "Size", "Done", "What it is", "What to change"];
            blocks.extend(limited("Faults of the data", &header, &recording.faults, row));
        }
        let note = |note: &String| PageBlock::paragraph(format!("{}.", words::begun(note.trim_end_matches('.'))));
        blocks.extend(recording.notes.iter().map(note));
        let range = |values: Option<&Vec<f64>>| {
            let Some(values) = values else { return RichText::new("–") };
            let (low, high) = least_and_most(values.iter().copied());
            format!("{} to {}", significant(low, 3), significant(high, 3)).into()
        };
        let row = |(k, session): &(usize, &Session)| {
            let turns = session.generator_rad.iter().map(|psi| psi / std::f64::consts::TAU).collect::<Vec<_>>();
            let columns = [&session.time_s, &Some(turns), &session.torque_n_m, &session.temperature_c];
            let counts = [k + 1, session.len()].map(|count| count.to_string().into());
            counts.into_iter().chain(columns.map(|values| range(values.as_ref()))).collect()
        };
        let sessions: Vec<(usize, &Session)> = recording.sessions.iter().enumerate().collect();
        let header = ["Session", "Rows", "Time, s", "Generator, turns", "Torque, N·m", "Temperature, °C"];
        blocks.extend(limited("Sessions", &header, &sessions, row));
        PageSection::folded("data", "The data", blocks)
    }

    fn reading(&self) -> PageSection {
        PageSection::reading(vec![
            PageBlock::paragraph(format!("{SIGNS} ψ is the angle of the generator, δ that of the output.")),
            PageBlock::paragraph(
                "The selector shows the same figures of what the nominal model leaves, of what it leaves recalibrated \
                 to this unit, and of what is left with the causes that were named. A cause that is right takes its \
                 marks away in the last without putting others in their place.",
            ),
            PageBlock::paragraph(format!(
                "Confidence: that it is this cause and not its best rival, given that it is one of the library. Gain: \
                 share of the squared error of the recalibrated nominal model that it removes in {}. Look-alikes: \
                 causes that these data cannot distinguish from it. Parameters are of the model that was fitted; µm \
                 are displacements on the pitch circle.",
                self.left_out()
            )),
        ])
    }
}

/// A table of the first [`MOST`] items, and how many more there are.
fn limited<T>(caption: &str, header: &[&str], items: &[T], row: impl Fn(&T) -> Vec<RichText>) -> Vec<PageBlock> {
    let mut blocks = vec![PageBlock::table(caption, header, items.iter().take(MOST).map(row).collect())];
    if items.len() > MOST {
        blocks.push(PageBlock::paragraph(format!("{} more are left out here.", items.len() - MOST)));
    }
    blocks
}

/// The look-alikes of a cause, in words.
fn alike(cause: &Cause) -> Vec<String> {
    cause.look_alikes.iter().map(|name| name.words().to_owned()).chain(cause.outside_the_library()).collect()
}

/// A free parameter of the nominal model: the zero as an error, times in milliseconds, drag in N·m, else a share.
fn recalibrated_value(name: &str, p: Parameter) -> RichText {
    if name.starts_with("zero") {
        return RichText::arcsec(p.value, 3).plain("\u{a0}±\u{a0}").error(p.std, 2);
    }
    let words = if [BETWEEN_READINGS, CHANGE_OF_FLANK].contains(&name) {
        format!("{}\u{a0}±\u{a0}{}\u{a0}ms", significant(1e3 * p.value, 2), significant(1e3 * p.std, 2))
    } else if name.starts_with("drag") {
        format!("{}\u{a0}±\u{a0}{}\u{a0}N·m", significant(p.value, 2), significant(p.std, 2))
    } else {
        format!("{:+.1}\u{a0}±\u{a0}{:.1}\u{a0}%", 100.0 * p.value, 100.0 * p.std)
    };
    RichText::new(words.replace('-', "−"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::page::{FigureBody, Span};
    use flexspline_identify::diagnosis::report::{Compensation, HeldOut, Residual, SetOfCauses};
    use flexspline_identify::diagnosis::trace::Trace;
    use flexspline_identify::measurement::{FaultName, Measures, Treatment};
    use flexspline_identify::synthesize::catalogue_drive;

    #[test]
    fn times_that_float_are_shown_in_milliseconds_drag_in_newton_metres_and_the_rest_as_shares() {
        let shown = |name: &str| recalibrated_value(name, Parameter { value: -4.2e-3, std: 1.1e-3 });
        assert_eq!(shown(CHANGE_OF_FLANK), RichText::new("−4.2\u{a0}±\u{a0}1.1\u{a0}ms"));
        assert_eq!(shown(BETWEEN_READINGS), shown(CHANGE_OF_FLANK));
        assert_eq!(shown("drag 6"), RichText::new("−0.0042\u{a0}±\u{a0}0.0011\u{a0}N·m"));
        assert_eq!(shown("backlash"), RichText::new("−0.4\u{a0}±\u{a0}0.1\u{a0}%"));
    }

    /// Two short sessions with an error of one wave in a generator turn.
    fn recording(faults: Vec<Fault>) -> Recording {
        let session = |from: f64| {
            let generator_rad: Vec<f64> = (0..3000).map(|k| 0.05 * f64::from(k)).collect();
            Session {
                line: (2..3002).collect(),
                time_s: Some((0..3000).map(|k| from + 0.01 * f64::from(k)).collect()),
                error_rad: generator_rad.iter().map(|psi| 1e-4 * psi.sin()).collect(),
                generator_rad,
                ..Session::default()
            }
        };
        Recording {
            file: "folder/made <up>.csv".into(),
            rows: 6000,
            sessions: vec![session(0.0), session(1000.0)],
            faults,
            notes: Vec::new(),
            unusable: None,
        }
    }

    fn diagnosis(verdict: Verdict, causes: &[CauseName]) -> Diagnosis {
        let cause = |name: &CauseName| Cause {
            name: *name,
            confidence: 0.97,
            evidence: 40.0,
            evidence_by: Default::default(),
            parameters: BTreeMap::new(),
            held_out_gain: 0.8,
            size_arcsec: 12.0,
            look_alikes: vec![CauseName::SensorLatency],
            look_alike_outside: None,
        };
        Diagnosis {
            schema_version: 1,
            verdict,
            finding: Finding::of(verdict),
            causes: causes.iter().map(cause).collect(),
            residual: Residual {
                rms_before_arcsec: 13.0,
                rms_after_arcsec: 5.0,
                noise_floor_arcsec: 5.0,
                unexplained_fraction: 0.0,
                rows_averaged: 1,
            },
            held_out: HeldOut { rms_before_arcsec: 10.0, rms_after_arcsec: 5.0 },
            posterior: Vec::new(),
            hints: Vec::new(),
            compensation: Compensation::default(),
            unexplained: vec![Unexplained { looks_like: "slow motion".into(), size_arcsec: 30.0 }],
            recalibrated: BTreeMap::new(),
            noise_arcsec: [5.0, 0.0],
            wander_correlation_s: 1.0,
            next_experiment: None,
            experiment_for_asked: None,
            zeros: Vec::new(),
            fitted_faults: Vec::new(),
            set_aside: None,
            trace: Trace::default(),
        }
    }

    fn page_of(diagnosis: &Diagnosis, faults: Vec<Fault>) -> Page {
        let (recording, nominal) = (recording(faults), catalogue_drive());
        let rows = Rows::new(&recording.sessions, &nominal);
        let series = |session: &std::ops::Range<usize>| Series {
            measured_arcsec: rows.error[session.clone()].to_vec(),
            nominal_arcsec: vec![0.0; session.len()],
            ..Series::default()
        };
        page(DiagnosisSources {
            recording: &recording,
            nominal: &nominal,
            diagnosis,
            table: &WrittenTable {
                file: Some("calibrated.fxt".into()),
                rms_left_out_arcsec: 2.0,
                ..WrittenTable::default()
            },
            series: &rows.sessions.iter().map(series).collect::<Vec<_>>(),
            causes: Vec::new(),
            command: "flexspline diagnose",
            inputs: Vec::new(),
        })
    }

    fn words(text: &RichText) -> String {
        let word = |span: &Span| match span {
            Span::Plain(words) | Span::Strong(words) => words.clone(),
            Span::Error { arcsec, .. } => format!("{arcsec:.0}″"),
        };
        text.0.iter().map(word).collect()
    }

    #[test]
    fn each_verdict_has_its_stamp_its_sentence_and_its_number() {
        let jump = || Fault {
            name: FaultName::EncoderIndexJump,
            channel: None,
            time_s: Some(41.2),
            until_s: Some(41.2),
            first_line: 77,
            last_line: 77,
            rows: 1,
            size_arcsec: Some(53.0),
            treatment: Treatment::Repaired,
            what: "the output jumps".into(),
            advice: FaultName::EncoderIndexJump.advice(),
            measures: Measures::default(),
        };
        for (verdict, causes, status, begins, number) in [
            (
                Verdict::Explained,
                &[CauseName::Wear][..],
                Status::FaultFound,
                "Explained by wear (97 %, 12″ rms).",
                "10″ → 5″",
            ),
            (
                Verdict::PartlyExplained,
                &[CauseName::Wear, CauseName::Ratcheting],
                Status::FaultFound,
                "Partly explained by wear (97 %, 12″ rms) and ratcheting",
                "10″ → 5″",
            ),
            (Verdict::Unknown, &[], Status::NotUnderstood, "Unknown: ", "12″"),
            (Verdict::None, &[], Status::Good, "Nothing found: ", "13″"),
        ] {
            let page = page_of(&diagnosis(verdict, causes), Vec::new());
            assert_eq!((page.status, page.also.len()), (status, 0));
            let headline = &page.headlines[0];
            assert!(words(&headline.answer).starts_with(begins), "{}", words(&headline.answer));
            assert_eq!(words(&headline.number), number);
            // With a fault of the data a good page is stamped so, and any other in addition to its own stamp.
            let faulty = page_of(&diagnosis(verdict, causes), vec![jump()]);
            let stamps: Vec<Status> = [faulty.status].into_iter().chain(faulty.also).collect();
            assert!(stamps.contains(&Status::DataFaults) && !stamps.contains(&Status::Good), "{stamps:?}");
            assert_eq!(stamps.contains(&status), status != Status::Good);
            assert!(faulty.remarks[1].contains("encoder index jump; the output jumps."), "{:?}", faulty.remarks);
        }
        // What the written table gains comes first where it was evaluated, and what is open is said with its odds.
        let mut evaluated = diagnosis(Verdict::Explained, &[CauseName::Wear]);
        evaluated.compensation = Compensation {
            rms_uncompensated_arcsec: 20.0,
            rms_nominal_tables_arcsec: 8.0,
            rms_calibrated_table_arcsec: None,
            rms_extended_tables_arcsec: 3.0,
        };
        evaluated.posterior = [(vec![CauseName::Wear], 0.4), (vec![CauseName::Ratcheting], 0.3), (Vec::new(), 0.1)]
            .map(|(set, probability)| SetOfCauses { set, probability })
            .into();
        let headline = page_of(&evaluated, Vec::new()).headlines.remove(0);
        assert_eq!(words(&headline.number), "8″ → 2″");
        assert_eq!(words(&headline.answer), "Explained, not decided between wear (40\u{a0}%), ratcheting (30\u{a0}%).");
    }

    #[test]
    fn a_page_is_small_and_has_the_wave_in_its_spectrum() {
        let page = page_of(&diagnosis(Verdict::Explained, &[CauseName::Wear]), Vec::new());
        let html = page.html().unwrap();
        assert!(html.len() < 600_000, "{} bytes", html.len());
        assert!(
            html.contains("made &#60;up&#62;.csv") || html.contains("made &lt;up&gt;.csv"),
            "the name is not escaped"
        );
        // The wave is in the spectrum of what was measured, at its order.
        let figure = |id: &str| {
            page.sections.iter().flat_map(|s| &s.blocks).find_map(|block| match block {
                PageBlock::Figure(figure) if figure.id == id => Some(figure.clone()),
                _ => None,
            })
        };
        let Some(FigureBody::Lines { charts, .. }) = figure("orders-generator").map(|figure| figure.body) else {
            panic!("no spectrum")
        };
        let curve = &charts[0].1.series[0].points;
        let peak = curve.iter().max_by(|a, b| a[1].total_cmp(&b[1])).unwrap();
        assert!((peak[0] - 1.0).abs() < 0.02 && (peak[1] - 20.6).abs() < 0.5, "{peak:?}");
    }
}
