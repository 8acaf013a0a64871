//! The page of a diagnosis: what an analyst with a log file sees.
//!
//! The answer first, in one sentence and one number; then the picture before the verdict, which nobody has to believe;
//! then what explains it, what that gains, what is wrong with the data, and what to record next. Residuals come row by
//! row in three levels (nominal, recalibrated, with the causes), and a selector shows the picture of each: what the
//! causes explain is gone in the last.

mod orders;
mod picture;
mod thin;
mod why;
mod words;

use std::borrow::Cow;

use rayon::prelude::*;
use serde_json::{Map, Value, json};

use super::page::{
    Axis, Block, Choice, Detail, EVERY_CHOICE, Figure, FigureBody, Headline, Lines, Mark, Page, PageQuantity, Section,
    Status, Table as PageTable, Text, significant,
};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_identify::causes::CauseName;
use flexspline_identify::diagnosis::base::{BETWEEN_READINGS, CHANGE_OF_FLANK};
use flexspline_identify::diagnosis::report::{Cause, Diagnosis, Finding, Parameter, Verdict};
use flexspline_identify::diagnosis::rows::Rows;
use flexspline_identify::diagnosis::{Extended, Series};
use flexspline_identify::measurement::{Gear, Recording, Session};
use flexspline_identify::nominal::Nominal;
use flexspline_identify::residual::Picture;
use thin::Clock;

/// Rows of which a picture is made, at most: beyond, every so many are left out evenly.
const MOST_ROWS: usize = 400_000;
/// Bins of a turn.
const TURN_BINS: usize = 72;

/// What is left of the measured error by one model.
#[derive(Debug, Clone)]
pub struct Level {
    /// Which model; letters.
    pub id: &'static str,
    /// What the reader sees.
    pub name: &'static str,
    /// Measured error less the model, arcsec, a value for each row of all sessions.
    pub residual_arcsec: Vec<f64>,
}

/// What one cause adds.
#[derive(Debug, Clone)]
pub struct Part {
    /// Its name.
    pub cause: CauseName,
    /// What it adds to the prediction, arcsec, a value for each row of all sessions.
    pub adds_arcsec: Vec<f64>,
}

/// What each model leaves of the rows, and what each cause adds, from what the model that was found says of all
/// sessions.
pub fn levels_and_parts(series: &[Series], extended: &Extended, diagnosis: &Diagnosis) -> (Vec<Level>, Vec<Part>) {
    let joined = |of: &dyn Fn(&Series) -> Vec<f64>| series.iter().flat_map(of).collect::<Vec<f64>>();
    let level = |id, name, residual_arcsec| Level { id, name, residual_arcsec };
    let mut levels = vec![
        level("nominal", "nominal", joined(&Series::less_nominal)),
        level("recalibrated", "recalibrated", joined(&Series::less_recalibrated)),
    ];
    // What was tried and not named is in no model that a reader is shown.
    if diagnosis.causes.is_empty() {
        return (levels, Vec::new());
    }
    levels.push(level("extended", "with the causes", joined(&Series::less_extended)));
    let parts = extended
        .causes()
        .iter()
        .enumerate()
        .map(|(k, cause)| Part {
            cause: cause.name(),
            adds_arcsec: joined(&|s| s.cause_arcsec.get(k).cloned().unwrap_or_default()),
        })
        .collect();
    (levels, parts)
}

/// What the page is made from.
pub struct DiagnosisSources<'a> {
    /// The data.
    pub recording: &'a Recording,
    /// The model.
    pub nominal: &'a Nominal,
    /// What was found.
    pub diagnosis: &'a Diagnosis,
    /// What each model leaves; the nominal model first.
    pub levels: Vec<Level>,
    /// What each cause adds.
    pub parts: Vec<Part>,
    /// The command line.
    pub command: &'a str,
    /// What else made it: name and value.
    pub inputs: Vec<(String, String)>,
}

/// A level with what its figures are drawn from.
struct Shown {
    level: Level,
    picture: Option<Picture>,
}

/// All that figures are drawn from.
struct DiagnosisKnown<'a> {
    sources: DiagnosisSources<'a>,
    rows: Rows,
    clock: Clock,
    shown: Vec<Shown>,
}

/// The page of a diagnosis.
pub fn page(mut sources: DiagnosisSources<'_>) -> Page {
    let (nominal, recording) = (sources.nominal, sources.recording);
    let mut rows = Rows::new(&recording.sessions, nominal);
    let mut sessions: Cow<'_, [Session]> = Cow::Borrowed(&recording.sessions);
    if recording.sessions.iter().any(|session| session.len() <= 3) {
        sessions = recording.sessions.iter().filter(|session| session.len() > 3).cloned().collect();
    }
    let mut levels = std::mem::take(&mut sources.levels);
    levels.retain(|level| level.residual_arcsec.len() == rows.len());
    sources.parts.retain(|part| part.adds_arcsec.len() == rows.len());
    let every = rows.len().div_ceil(MOST_ROWS);
    if every > 1 {
        sessions = sessions.iter().map(|session| thinned(session, every)).collect();
        let columns = levels.iter_mut().map(|level| &mut level.residual_arcsec);
        for column in columns.chain(sources.parts.iter_mut().map(|part| &mut part.adds_arcsec)) {
            *column = rows.sessions.iter().flat_map(|s| column[s.clone()].iter().step_by(every).copied()).collect();
        }
        rows = Rows::new(&sessions, nominal);
    }
    let gear = Gear::of_ratio(nominal.ratio);
    let shown = levels
        .into_par_iter()
        .map(|level| {
            let in_rad: Vec<Vec<f64>> = rows
                .sessions
                .iter()
                .map(|s| level.residual_arcsec[s.clone()].iter().map(|e| e / ARCSEC_PER_RAD).collect())
                .collect();
            Shown { picture: Picture::of(&sessions, &in_rad, &gear).ok(), level }
        })
        .collect();
    DiagnosisKnown { clock: Clock::new(&rows), rows, shown, sources }.page()
}

/// Every so many rows of a session.
fn thinned(session: &Session, every: usize) -> Session {
    fn some<T: Copy>(values: &[T], every: usize) -> Vec<T> {
        values.iter().step_by(every).copied().collect()
    }
    let column = |values: &Option<Vec<f64>>| values.as_ref().map(|values| some(values, every));
    Session {
        line: some(&session.line, every),
        time_s: column(&session.time_s),
        generator_rad: some(&session.generator_rad, every),
        error_rad: some(&session.error_rad, every),
        torque_n_m: column(&session.torque_n_m),
        temperature_c: column(&session.temperature_c),
        orientation_rad: column(&session.orientation_rad),
        loudness: column(&session.loudness),
        own_zero: session.own_zero,
        zero_off_rad: session.zero_off_rad,
        unsure_s: session.unsure_s,
        coarse_rad: session.coarse_rad,
        mean_over_s: session.mean_over_s,
    }
}

fn table(caption: &str, header: &[&str], rows: Vec<Vec<Text>>) -> Block {
    let header = header.iter().map(|&cell| cell.to_owned()).collect();
    Block::Table { choice: None, table: PageTable { caption: caption.into(), header, rows } }
}

impl DiagnosisKnown<'_> {
    fn page(&self) -> Page {
        let DiagnosisSources { recording, nominal, diagnosis, command, inputs, .. } = &self.sources;
        let (status, also) = self.status();
        let mut sections = vec![self.in_short()];
        sections.extend(self.picture_sections());
        sections.push(self.before_and_after());
        sections.extend(self.causes());
        sections.push(why::in_short(self.sources.diagnosis));
        sections.push(why::gate_by_gate(self.sources.diagnosis));
        sections.push(self.gain());
        sections.push(self.next());
        sections.push(self.data());
        sections.push(self.reading());
        let mut provenance = vec![("Command".to_owned(), (*command).to_owned())];
        provenance.push(("Version".into(), format!("flexspline {}", env!("CARGO_PKG_VERSION"))));
        provenance.push(("Measured data".into(), recording.file.clone()));
        provenance.push(("Rows".into(), recording.rows.to_string()));
        let teeth = nominal
            .teeth
            .map_or_else(String::new, |teeth| format!(", {} and {} teeth", teeth.flexspline, teeth.circular_spline));
        provenance.push(("Gear".into(), format!("ratio {}{teeth}", nominal.ratio)));
        provenance.extend(inputs.iter().cloned());
        let choices: Vec<Choice> = self
            .shown
            .iter()
            .map(|shown| Choice { id: shown.level.id.into(), name: shown.level.name.into() })
            .collect();
        let mut results = Map::new();
        results.insert("diagnosis".into(), serde_json::to_value(diagnosis).unwrap_or(Value::Null));
        results.insert("data_faults".into(), json!(recording.faults));
        results.insert("tooth_steps".into(), json!(recording.tooth_steps));
        results.insert("notes".into(), json!(recording.notes));
        let name = std::path::Path::new(&recording.file).file_name();
        let name = name.map_or_else(|| recording.file.clone(), |name| name.to_string_lossy().into_owned());
        Page {
            title: format!("Diagnosis of {name}"),
            command_name: "diagnose",
            status,
            also,
            remarks: self.remarks(),
            choices,
            choice_is: "Error less the model:",
            headlines: vec![self.headline()],
            sections,
            animations: Vec::new(),
            provenance,
            results,
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

    /// What departs from the nominal model beyond noise, arcsec rms. Lines that averages hide are not in the residual:
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
        let listed = |mut text: Text| {
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
        // Never a second percentage beside the confidence: what proves the causes is what they leave.
        let fell = |from: f64, to: f64| Text::default().error(from, 2).plain(" → ").error(to, 2);
        let (corrected, held) = (diagnosis.compensation, diagnosis.held_out);
        // A table cannot correct every cause: what a sensor reads wrong the output does not do.
        let corrects = corrected.rms_extended_tables_arcsec != corrected.rms_nominal_tables_arcsec;
        let (share, share_is) = if corrected.is_known() && corrects {
            (
                fell(corrected.rms_nominal_tables_arcsec, corrected.rms_extended_tables_arcsec),
                "rms left after correction in {}, with the nominal table and with one that holds the causes",
            )
        } else {
            (fell(held.rms_before_arcsec, held.rms_after_arcsec), "rms in {}, without the causes and with them")
        };
        let share_is = share_is.replace("{}", self.left_out());
        let (answer, number, number_is) = match diagnosis.verdict {
            Verdict::Explained => (listed(Text::new("Explained by ")), share, share_is),
            Verdict::PartlyExplained => (listed(Text::new("Partly explained by ")), share, share_is),
            Verdict::Unknown if diagnosis.finding == Finding::DataUnusable => (
                Text::new(format!(
                    "Data not usable: {}.",
                    self.sources.recording.unusable.as_deref().unwrap_or("their faults hide what the drive does")
                )),
                Text::default().error(self.departure_arcsec(), 2),
                "rms beyond noise, of which nothing can be said".to_owned(),
            ),
            Verdict::Unknown => (
                Text::new(
                    "Unknown: the drive departs from the nominal model, and no cause in the library explains how.",
                ),
                Text::default().error(self.departure_arcsec(), 2),
                "rms beyond noise, of unknown cause".to_owned(),
            ),
            Verdict::None => (
                Text::new(
                    "Nothing found: the drive does what the nominal model says, within noise and the spread between \
                     units.",
                ),
                Text::default().error(diagnosis.residual.rms_before_arcsec, 3),
                "rms error of the nominal model, recalibrated to this unit".to_owned(),
            ),
        };
        Headline { choice: None, answer, number, number_is }
    }

    /// What the headline leaves out and a reader has to know.
    fn in_short(&self) -> Section {
        let diagnosis = self.sources.diagnosis;
        let (held, left) = (diagnosis.held_out, diagnosis.residual);
        let mut blocks = Vec::new();
        if !diagnosis.causes.is_empty() {
            blocks.push(Block::paragraph(
                Text::new(
                    "The model behind the tables is adapted to the zero, stiffness and backlash of these data, which \
                     a table on board is not, and so leaves another error: ",
                )
                .error(held.rms_before_arcsec, 3)
                .plain(" → ")
                .error(held.rms_after_arcsec, 3)
                .plain(format!(" rms in {}, without the causes and with them; ", self.left_out()))
                .error(left.rms_before_arcsec, 3)
                .plain(" → ")
                .error(left.rms_after_arcsec, 3)
                .plain(" in the data that it was fitted to. Noise and wander of the measurement are ")
                .error(left.noise_floor_arcsec, 3)
                .plain("."),
            ));
        } else {
            blocks.push(Block::paragraph(
                Text::new("The nominal model, recalibrated to this unit, leaves ")
                    .error(left.rms_before_arcsec, 3)
                    .plain(" rms. Noise and wander of the measurement are ")
                    .error(left.noise_floor_arcsec, 3)
                    .plain("."),
            ));
        }
        for cause in &diagnosis.causes {
            let alike = alike(cause);
            if alike.is_empty() {
                continue;
            }
            blocks.push(Block::paragraph(
                Text::new("These data do not tell ")
                    .strong(cause.name.words())
                    .plain(format!(" from {}.", words::listed(&alike))),
            ));
        }
        if let Some(something) = diagnosis.unexplained.first() {
            let more = diagnosis.unexplained.len() - 1;
            let text = Text::new(if diagnosis.causes.is_empty() {
                "What departs looks like "
            } else {
                "Without a known cause: "
            })
            .strong(something.looks_like.replace('_', " "))
            .plain(", ")
            .error(something.size_arcsec, 2)
            .plain(if more > 0 {
                format!(" rms, and {} more below.", words::counted(more))
            } else {
                " rms.".into()
            });
            blocks.push(Block::paragraph(text));
        }
        if let Some(next) = &diagnosis.next_experiment {
            blocks.push(Block::paragraph(Text::new("To record next: ").plain(format!("{next}."))));
        }
        Section { id: "short".into(), title: "In short".into(), detail: Detail::Summary, blocks }
    }

    /// Faults of the data, a sentence each, and what there is beside the causes.
    fn remarks(&self) -> Vec<String> {
        const MOST: usize = 5;
        let recording = self.sources.recording;
        let mut remarks: Vec<String> = recording
            .faults
            .iter()
            .take(MOST)
            .map(|fault| format!("Data fault: {}; {}.", words::fault(fault.name), fault.what.trim_end_matches('.')))
            .collect();
        if recording.faults.len() > MOST {
            remarks.push(format!("{} more data faults are in the table below.", recording.faults.len() - MOST));
        }
        if !recording.tooth_steps.is_empty() {
            let steps = words::counted(recording.tooth_steps.len());
            remarks.push(format!(
                "The output is off by whole teeth after {steps} steps: the drive has ratcheted, or was re-assembled."
            ));
        }
        remarks
    }

    fn before_and_after(&self) -> Section {
        let series = |k: usize, shown: &Shown| {
            thin::envelope(&self.rows, &self.clock, &shown.level.residual_arcsec, shown.level.name, [5, 0, 1][k.min(2)])
        };
        let over_time = Lines {
            series: self.shown.iter().enumerate().map(|(k, shown)| series(k, shown)).collect(),
            uprights: self.clock.borders(),
            ..Lines::default()
        };
        let every: Vec<usize> = (0..self.rows.len()).collect();
        let turn: Vec<f64> = self.rows.generator.iter().map(|psi| psi.to_degrees().rem_euclid(360.0)).collect();
        let over_turn = Lines {
            series: self
                .shown
                .iter()
                .enumerate()
                .map(|(k, shown)| {
                    let colour = [5, 0, 1][k.min(2)];
                    thin::medians(
                        &turn,
                        &shown.level.residual_arcsec,
                        &every,
                        TURN_BINS,
                        shown.level.name,
                        Mark::Line,
                        colour,
                    )
                })
                .collect(),
            ..Lines::default()
        };
        let added = Lines {
            series: self
                .sources
                .parts
                .iter()
                .enumerate()
                .map(|(k, part)| {
                    let name = part.cause.words();
                    thin::envelope(&self.rows, &self.clock, &part.adds_arcsec, name, k)
                })
                .collect(),
            uprights: self.clock.borders(),
            ..Lines::default()
        };
        let y = || Axis::new("Error less model", PageQuantity::Error);
        let figure = |id: &str, title: &str, caption: &str, x: Axis, lines: Lines| {
            Block::Figure(Figure {
                id: id.into(),
                title: title.into(),
                caption: Text::new(caption),
                alt: title.into(),
                body: FigureBody::Lines { x, y: y(), charts: vec![(EVERY_CHOICE.into(), lines)] },
            })
        };
        let mut blocks = vec![
            figure(
                "over-time",
                "What each model leaves, over time",
                "Least and largest of each stretch of rows, so that single rows show. Nominal: the model as it was \
                 given. Recalibrated: its zero, stiffness, backlash and harmonics as this unit has them, within the \
                 spread between units. With the causes: what was named is in the model. Breaks between sessions are \
                 taken out.",
                self.time_axis(),
                over_time,
            ),
            figure(
                "over-turn",
                "What each model leaves, over the generator's turn",
                "Medians of all rows, both directions together. What is flat here may still depend on load or \
                 direction: see the figures above, with the selector at the top.",
                Axis::new("Generator angle in its turn", PageQuantity::Degree),
                over_turn,
            ),
        ];
        if !added.series.is_empty() {
            blocks.push(Block::Figure(Figure {
                id: "added".into(),
                title: "What each cause adds, over time".into(),
                caption: Text::new("Least and largest of each stretch of rows of what it adds to the prediction."),
                alt: "Curves of what each cause adds to the predicted error over time".into(),
                body: FigureBody::Lines {
                    x: self.time_axis(),
                    y: Axis::new("Adds to the error", PageQuantity::Error),
                    charts: vec![(EVERY_CHOICE.into(), added)],
                },
            }));
        }
        Section { id: "before-after".into(), title: "Before and after".into(), detail: Detail::Summary, blocks }
    }

    fn time_axis(&self) -> Axis {
        if self.rows.recorded.time {
            Axis::new("Time, breaks taken out", PageQuantity::Second)
        } else {
            Axis::new("Row", PageQuantity::Count)
        }
    }

    /// The causes and what is beside them.
    fn causes(&self) -> Option<Section> {
        let diagnosis = self.sources.diagnosis;
        let mut blocks = Vec::new();
        if !diagnosis.causes.is_empty() {
            let rows = diagnosis
                .causes
                .iter()
                .map(|cause| {
                    let alike = alike(cause);
                    vec![
                        Text::new(words::begun(cause.name.words())),
                        Text::new(words::percent(cause.confidence)),
                        Text::default().error(cause.size_arcsec, 3),
                        Text::new(words::percent(cause.held_out_gain)),
                        Text::new(words::parameters(cause)),
                        Text::new(if alike.is_empty() { "none".to_owned() } else { words::listed(&alike) }),
                    ]
                })
                .collect();
            blocks.push(table(
                "Causes, strongest first",
                &[
                    "Cause",
                    "Confidence",
                    "Size, rms",
                    "Gain left out",
                    "Parameters ± one standard deviation",
                    "Look-alikes",
                ],
                rows,
            ));
            blocks.push(Block::paragraph(format!(
                "Confidence: that it is this cause and not its best rival, given that it is one of the library. Gain: \
                 share of the squared error of the recalibrated nominal model that it removes in {}. Look-alikes: \
                 causes that these data cannot tell from it. Parameters are of the law that was fitted; µm are \
                 displacements on the pitch circle.",
                self.left_out()
            )));
            for cause in &diagnosis.causes {
                blocks.push(Block::paragraph(
                    Text::default().strong(words::begun(cause.name.words())).plain(format!(": {}.", cause.name.does())),
                ));
            }
        }
        if !diagnosis.unexplained.is_empty() {
            let rows = diagnosis
                .unexplained
                .iter()
                .map(|left| {
                    vec![
                        Text::new(words::begun(&left.looks_like.replace('_', " "))),
                        Text::default().error(left.size_arcsec, 3),
                    ]
                })
                .collect();
            blocks.push(table("What is there and has no known cause", &["It looks like", "Size, rms"], rows));
            let sure = if diagnosis.verdict == Verdict::Unknown {
                "Names of causes in this table say what the remainder resembles most; they are not a finding."
            } else {
                "These describe the remainder; they are no causes, and nothing of them is in the extended model."
            };
            blocks.push(Block::paragraph(sure));
        }
        (!blocks.is_empty()).then(|| Section {
            id: "causes".into(),
            title: "Causes".into(),
            detail: Detail::Summary,
            blocks,
        })
    }

    /// What the causes gain.
    fn gain(&self) -> Section {
        let Diagnosis { residual, held_out, compensation, .. } = self.sources.diagnosis;
        let error = |arcsec: f64| Text::default().error(arcsec, 3);
        let row = |name: String, before: f64, after: f64| {
            let change = if before > 0.0 { format!("{:+.0} %", 100.0 * (after / before - 1.0)) } else { "–".into() };
            vec![Text::new(name), error(before), error(after), Text::new(change.replace('-', "−"))]
        };
        let all = table(
            "Error of the prediction, rms",
            &["Over", "Recalibrated nominal", "With the causes", "Change"],
            vec![
                row("all data".into(), residual.rms_before_arcsec, residual.rms_after_arcsec),
                row(self.left_out().into(), held_out.rms_before_arcsec, held_out.rms_after_arcsec),
            ],
        );
        let noise = Block::paragraph(
            Text::new("Noise and wander of the measurement are ").error(residual.noise_floor_arcsec, 3).plain(format!(
                " of it{}; {} of the squared error beyond that is left unexplained.",
                match residual.rows_averaged {
                    0 | 1 => String::new(),
                    rows => format!(" in means of {rows} rows"),
                },
                words::percent(residual.unexplained_fraction)
            )),
        );
        let rest = |arcsec: f64| {
            let none = compensation.rms_uncompensated_arcsec;
            let share = if none > 0.0 { format!("{:.0} %", 100.0 * arcsec / none) } else { "–".into() };
            vec![error(arcsec), Text::new(share)]
        };
        let line = |name: &str, arcsec: f64| [vec![Text::new(name)], rest(arcsec)].concat();
        let pointing = table(
            "Pointing error with the output corrected, rms about the mean",
            &["Correction", "Left", "Of uncorrected"],
            vec![
                line("none", compensation.rms_uncompensated_arcsec),
                line("nominal tables", compensation.rms_nominal_tables_arcsec),
                line(&format!("extended tables, in {}", self.left_out()), compensation.rms_extended_tables_arcsec),
            ],
        );
        // The number that a joint feels, then what is behind it.
        let mut blocks = vec![pointing, all, noise];
        let rows = self.recalibrated_rows();
        if !rows.is_empty() {
            blocks.push(table("The nominal model as this unit has it", &["Parameter", "Against nominal"], rows));
            blocks.push(Block::paragraph(
                "Within the spread between units: wind-up and clearance by these shares of nominal, each harmonic by \
                 a share of its amplitude in phase with it and a quarter of a wave before it. The zero is that of the \
                 encoder.",
            ));
        }
        Section { id: "gain".into(), title: "What it gains".into(), detail: Detail::Summary, blocks }
    }

    /// What floats in the nominal model, with its order where it is a harmonic.
    fn recalibrated_rows(&self) -> Vec<Vec<Text>> {
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
            Some((place, format!("Harmonic of order {}, {phase}", words::order(order))))
        };
        let mut rows: Vec<(usize, Vec<Text>)> = recalibrated
            .iter()
            .map(|(name, p)| {
                let value = recalibrated_value(name, *p);
                let plain = if name == "stiffness" { "wind-up".to_owned() } else { name.replace('_', " ") };
                let (place, name) = wave(name).map_or((0, words::begun(&plain)), |(place, text)| (1 + place, text));
                (place, vec![Text::new(name), value])
            })
            .collect();
        rows.sort_by_key(|(place, _)| *place);
        rows.into_iter().map(|(_, row)| row).collect()
    }

    fn next(&self) -> Section {
        let text = match &self.sources.diagnosis.next_experiment {
            Some(next) => Text::default().strong("Record next: ").plain(format!("{next}.")),
            None if self.sources.diagnosis.verdict == Verdict::Unknown => Text::new(
                "The same motion again, on another day, shows whether the remainder is the drive's. Torque, \
                 temperature and orientation, where they were not recorded, tell more causes apart.",
            ),
            None => Text::new("Nothing: no two causes that these data cannot tell apart explain them equally well."),
        };
        Section {
            id: "next".into(),
            title: "What to record next".into(),
            detail: Detail::Summary,
            blocks: vec![Block::paragraph(text)],
        }
    }

    /// The data: sessions, faults, notes.
    fn data(&self) -> Section {
        const MOST: usize = 60;
        let recording = self.sources.recording;
        let mut blocks = Vec::new();
        if recording.faults.is_empty() {
            blocks.push(Block::paragraph("No faults were found in the data."));
        } else {
            let rows = recording
                .faults
                .iter()
                .take(MOST)
                .map(|fault| {
                    let when = match (fault.time_s, fault.until_s) {
                        (Some(a), Some(b)) if b > a => format!("{} to {}", words::seconds(a), words::seconds(b)),
                        (Some(a), _) => words::seconds(a),
                        _ => "–".into(),
                    };
                    let lines = if fault.last_line > fault.first_line {
                        format!("{} to {}", fault.first_line, fault.last_line)
                    } else {
                        fault.first_line.to_string()
                    };
                    vec![
                        Text::new(words::begun(words::fault(fault.name))),
                        Text::new(when),
                        Text::new(lines),
                        Text::new(fault.rows.to_string()),
                        fault.size_arcsec.map_or_else(|| Text::new("–"), |size| Text::default().error(size, 3)),
                        Text::new(words::treatment(fault.treatment)),
                        Text::new(fault.what.clone()),
                        Text::new(fault.advice),
                    ]
                })
                .collect();
            blocks.push(table(
                "Faults of the data",
                &["Fault", "When", "Lines of the file", "Rows", "Size", "Done", "What it is", "What to change"],
                rows,
            ));
            if recording.faults.len() > MOST {
                blocks.push(Block::paragraph(format!("{} more are in diagnosis.json.", recording.faults.len() - MOST)));
            }
        }
        if !recording.tooth_steps.is_empty() {
            let rows = recording
                .tooth_steps
                .iter()
                .take(MOST)
                .map(|step| {
                    vec![
                        Text::new(step.time_s.map_or_else(|| format!("line {}", step.line), words::seconds)),
                        Text::default().error(step.size_arcsec, 4),
                        Text::new(step.pitches.to_string()),
                    ]
                })
                .collect();
            blocks.push(table("Steps of whole teeth", &["When", "Size", "Tooth pitches"], rows));
        }
        blocks.extend(
            recording
                .notes
                .iter()
                .map(|note| Block::paragraph(format!("{}.", words::begun(note.trim_end_matches('.'))))),
        );
        let range = |values: Option<&Vec<f64>>| {
            let Some(values) = values else { return "–".to_owned() };
            let (low, high) =
                values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
            format!("{} to {}", significant(low, 3), significant(high, 3))
        };
        let rows = recording
            .sessions
            .iter()
            .take(MOST)
            .enumerate()
            .map(|(k, session)| {
                let turns = session.generator_rad.iter().map(|psi| psi / std::f64::consts::TAU).collect::<Vec<_>>();
                let cells = [
                    (k + 1).to_string(),
                    session.len().to_string(),
                    range(session.time_s.as_ref()),
                    range(Some(&turns)),
                    range(session.torque_n_m.as_ref()),
                    range(session.temperature_c.as_ref()),
                ];
                cells.map(Text::from).into()
            })
            .collect();
        blocks.push(table(
            "Sessions",
            &["Session", "Rows", "Time, s", "Generator, turns", "Torque, N·m", "Temperature, °C"],
            rows,
        ));
        if recording.sessions.len() > MOST {
            blocks.push(Block::paragraph(format!("{} more sessions.", recording.sessions.len() - MOST)));
        }
        let detail = if recording.faults.is_empty() { Detail::Engineering } else { Detail::Summary };
        Section { id: "data".into(), title: "The data".into(), detail, blocks }
    }

    fn reading(&self) -> Section {
        Section::reading(vec![
            Block::paragraph(
                "Error: output angle less generator angle over the ratio; positive when the output leads. ψ is the \
                 angle of the generator, δ that of the output. Forward is growing generator angle.",
            ),
            Block::paragraph(
                "The selector shows the same figures of what the nominal model leaves, of what it leaves recalibrated \
                 to this unit, and of what is left with the causes that were named. A cause that is right takes its \
                 marks away in the last without putting others in their place.",
            ),
            Block::paragraph(format!(
                "A name is given only where a cause gains in {}, where no rival does as well, and where it is large \
                 enough against noise and against how wrong its law may be. What does not meet that is described and \
                 not named.",
                self.left_out()
            )),
            Block::paragraph(
                "Figures zoom by dragging and come back by a double click. Every figure has its numbers as a table \
                 and as CSV, in the unit that is selected; of many rows it holds what is drawn, which is a part of \
                 them.",
            ),
            Block::paragraph(format!("Verdict: {}.", words::verdict(self.sources.diagnosis.verdict))),
        ])
    }
}

/// What these data do not tell from a cause, in words.
fn alike(cause: &Cause) -> Vec<String> {
    cause.look_alikes.iter().map(|name| name.words().to_owned()).chain(cause.or_the_log()).collect()
}

/// What floats in the nominal model, in its unit: the zero as an error, times in milliseconds, the rest as a share.
fn recalibrated_value(name: &str, p: Parameter) -> Text {
    if name.starts_with("zero") {
        return Text::default().error(p.value, 3).plain("\u{a0}±\u{a0}").error(p.std, 2);
    }
    let words = if [BETWEEN_READINGS, CHANGE_OF_FLANK].contains(&name) {
        let ms = |seconds: f64| significant(1e3 * seconds, 2);
        format!("{}\u{a0}±\u{a0}{}\u{a0}ms", ms(p.value), ms(p.std))
    } else {
        format!("{:+.1}\u{a0}±\u{a0}{:.1}\u{a0}%", 100.0 * p.value, 100.0 * p.std)
    };
    Text::new(words.replace('-', "−"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::page::Span;
    use flexspline_identify::diagnosis::report::{Cause, Compensation, HeldOut, Residual, Unexplained};
    use flexspline_identify::diagnosis::trace::Trace;
    use flexspline_identify::measurement::{Fault, FaultName, Measures, Treatment};
    use flexspline_identify::synthesize::catalogue_drive;

    #[test]
    fn times_that_float_are_shown_in_milliseconds_and_the_rest_as_shares() {
        let shown = |name: &str| recalibrated_value(name, Parameter { value: -4.2e-3, std: 1.1e-3 });
        assert_eq!(shown(CHANGE_OF_FLANK), Text::new("−4.2\u{a0}±\u{a0}1.1\u{a0}ms"));
        assert_eq!(shown(BETWEEN_READINGS), shown(CHANGE_OF_FLANK));
        assert_eq!(shown("backlash"), Text::new("−0.4\u{a0}±\u{a0}0.1\u{a0}%"));
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
            tooth_steps: Vec::new(),
            notes: Vec::new(),
            unusable: None,
        }
    }

    fn diagnosis(verdict: Verdict, causes: &[CauseName]) -> Diagnosis {
        let cause = |name: &CauseName| Cause {
            name: *name,
            confidence: 0.97,
            parameters: BTreeMap::new(),
            held_out_gain: 0.8,
            size_arcsec: 12.0,
            look_alikes: vec![CauseName::SensorLatency],
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
            compensation: Compensation::default(),
            unexplained: vec![Unexplained { looks_like: "slow motion".into(), size_arcsec: 30.0 }],
            recalibrated: BTreeMap::new(),
            noise_arcsec: [5.0, 0.0],
            wander_correlation_s: 1.0,
            next_experiment: None,
            ratio_proposed: None,
            experiment_for_asked: None,
            zeros: Vec::new(),
            set_aside: None,
            trace: Trace::default(),
        }
    }

    fn page_of(diagnosis: &Diagnosis, faults: Vec<Fault>) -> Page {
        let (recording, nominal) = (recording(faults), catalogue_drive());
        let rows = Rows::new(&recording.sessions, &nominal);
        let level = Level { id: "nominal", name: "nominal", residual_arcsec: rows.error.clone() };
        page(DiagnosisSources {
            recording: &recording,
            nominal: &nominal,
            diagnosis,
            levels: vec![level],
            parts: Vec::new(),
            command: "flexspline diagnose",
            inputs: Vec::new(),
        })
    }

    fn words(text: &Text) -> String {
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
            // With a fault of the data a good page is stamped so, and any other beside what it is.
            let faulty = page_of(&diagnosis(verdict, causes), vec![jump()]);
            let stamps: Vec<Status> = [faulty.status].into_iter().chain(faulty.also).collect();
            assert!(stamps.contains(&Status::DataFaults) && !stamps.contains(&Status::Good), "{stamps:?}");
            assert_eq!(stamps.contains(&status), status != Status::Good);
            assert!(faulty.remarks[0].contains("index jump of an encoder; the output jumps."), "{:?}", faulty.remarks);
        }
        // What a joint would feel comes first where it was evaluated.
        let mut evaluated = diagnosis(Verdict::Explained, &[CauseName::Wear]);
        evaluated.compensation = Compensation {
            rms_uncompensated_arcsec: 20.0,
            rms_nominal_tables_arcsec: 8.0,
            rms_extended_tables_arcsec: 3.0,
        };
        assert_eq!(words(&page_of(&evaluated, Vec::new()).headlines[0].number), "8″ → 3″");
    }

    #[test]
    fn a_long_record_is_thinned_and_its_page_is_small() {
        let page = page_of(&diagnosis(Verdict::Explained, &[CauseName::Wear]), Vec::new());
        let html = page.html().unwrap();
        assert!(html.len() < 600_000, "{} bytes", html.len());
        assert!(
            html.contains("made &#60;up&#62;.csv") || html.contains("made &lt;up&gt;.csv"),
            "the name is not escaped"
        );
        let session = &recording(Vec::new()).sessions[0];
        let third = thinned(session, 3);
        assert_eq!((third.len(), third.generator_rad[1]), (1000, session.generator_rad[3]));
        assert_eq!(third.time_s.as_ref().unwrap()[999], session.time_s.as_ref().unwrap()[2997]);
        // The wave is in the spectrum of what was measured, at its order.
        let figure = |id: &str| {
            page.sections.iter().flat_map(|s| &s.blocks).find_map(|block| match block {
                Block::Figure(figure) if figure.id == id => Some(figure.clone()),
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
