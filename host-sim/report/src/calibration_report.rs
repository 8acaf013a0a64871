//! The page of a calibration: what is left, which parts, and the curves.

use serde_json::{Map, json};

use super::page::{
    Axis, Block, Choice, Detail, EVERY_CHOICE, Figure, FigureBody, Headline, Lines, Mark, Page, PageQuantity, Section,
    Series, Status, Table, Text,
};
use flexspline_identify::calibrate::{Calibrated, Calibration};

/// Points of a series on the page, at most.
const MOST_POINTS: usize = 4000;

/// The page.
#[must_use]
pub fn page(made: &Calibrated) -> Page {
    let c = &made.calibration;
    let mut results = Map::new();
    results.insert("calibration".to_owned(), json!(c));
    let mut also = Vec::new();
    if !c.data_faults.is_empty() {
        also.push(Status::DataFaults);
    }
    Page {
        title: format!("Calibration of one unit, ratio {}", c.ratio),
        command_name: "calibrate",
        status: if c.notes.is_empty() { Status::Good } else { Status::Remark },
        also,
        remarks: c.notes.clone(),
        choices: vec![Choice { id: "unit".to_owned(), name: "this unit".to_owned() }],
        choice_is: "unit",
        headlines: vec![headline(c)],
        sections: vec![left(made), parts(c), reading()],
        animations: Vec::new(),
        provenance: vec![
            ("command".to_owned(), c.command.clone()),
            ("table_id".to_owned(), c.table_id.clone()),
            ("logs".to_owned(), c.files.join(", ")),
        ],
        results,
    }
}

fn headline(c: &Calibration) -> Headline {
    let kept = c.parts.iter().filter(|part| part.kept).count();
    Headline {
        choice: None,
        answer: Text::new(format!(
            "The table of this unit has {kept} part{} beside what was known; where nothing was fitted it leaves ",
            if kept == 1 { "" } else { "s" }
        ))
        .error(c.held_out.rms_after_arcsec, 3)
        .plain(" rms of ")
        .error(c.held_out.rms_before_arcsec, 3)
        .plain(if c.reading_delay.is_some() { ", the delay between the readings taken out." } else { "." }),
        number: Text::default().error(c.held_out.rms_after_arcsec, 3),
        number_is: format!("left, rms, in {} left out", c.left_out),
    }
}

fn left(made: &Calibrated) -> Section {
    let c = &made.calibration;
    let row = |name: &str, arcsec: f64| vec![Text::new(name), Text::default().error(arcsec, 3)];
    let measured = if c.reading_delay.is_some() { "As measured less the delay" } else { "As measured" };
    let with_delay = c.reading_delay.iter().flat_map(|delay| {
        [
            row("As measured, with the delay, all rows", delay.rms_before_arcsec),
            row("Left by the core, which does not know the delay, all rows", delay.rms_after_arcsec),
        ]
    });
    let table = Table {
        caption: "What is left, root mean square".to_owned(),
        header: vec!["Of".to_owned(), "Error".to_owned()],
        rows: [
            row(&format!("{measured}, rows in steady motion"), c.held_out.rms_before_arcsec),
            row("With what was known before, where nothing was fitted", c.held_out.rms_prior_arcsec),
            row("With the table, where nothing was fitted", c.held_out.rms_after_arcsec),
            row(&format!("{measured}, all rows"), c.core.rms_before_arcsec),
            row("Left by the core with this table, all rows", c.core.rms_after_arcsec),
        ]
        .into_iter()
        .chain(with_delay)
        .collect(),
    };
    let every = made.shown.len().div_ceil(MOST_POINTS).max(1);
    let series = |name: &str, colour: usize, at: usize| {
        let mut points: Vec<[f64; 2]> =
            made.shown.iter().step_by(every).map(|row| [row[0] / std::f64::consts::TAU, row[at]]).collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Series { name: name.to_owned(), mark: Mark::Dots, colour, points }
    };
    let lines = Lines { series: vec![series("measured", 0, 1), series("left by the table", 1, 2)], ..Lines::default() };
    let figure = Figure {
        id: "over-output".to_owned(),
        title: "Error over the output angle".to_owned(),
        caption: Text::new("Rows in steady motion, before and after; here the table has seen all of them."),
        alt: "The measured error and what the table leaves of it, over turns of the output".to_owned(),
        body: FigureBody::Lines {
            x: Axis::new("Output", PageQuantity::Turn),
            y: Axis::new("Error", PageQuantity::Error),
            charts: vec![(EVERY_CHOICE.to_owned(), lines)],
        },
    };
    Section {
        id: "left".to_owned(),
        title: "What is left".to_owned(),
        detail: Detail::Summary,
        blocks: vec![Block::Table { choice: None, table }, Block::Figure(figure)],
    }
}

fn parts(c: &Calibration) -> Section {
    let rows = c
        .parts
        .iter()
        .map(|part| {
            let gain = part.held_out_gain.map_or("–".to_owned(), |gain| format!("{:.1} %", 100.0 * gain));
            let size = part.size_arcsec.map_or(Text::new("–"), |size| Text::default().error(size, 3));
            vec![
                Text::new(part.name.replace('_', " ")),
                Text::new(if part.kept { "kept" } else { "refused" }),
                Text::new(gain),
                size,
                Text::new(part.why.clone()),
            ]
        })
        .collect();
    let header = ["Part", "Verdict", "Gain", "Size", "Why"].map(str::to_owned).to_vec();
    let caption = "Parts; the gain is the share of the squares before that a part takes where nothing was fitted, the \
                   size half of peak to peak";
    Section {
        id: "parts".to_owned(),
        title: "Its parts".to_owned(),
        detail: Detail::Summary,
        blocks: vec![Block::Table { choice: None, table: Table { caption: caption.to_owned(), header, rows } }],
    }
}

fn reading() -> Section {
    Section::reading(vec![Block::paragraph(
        "A table of one unit says what its error is, not why: two causes that look alike in these logs are one part \
         here. It holds for the torques, temperatures and angles recorded. The figures where nothing was fitted leave \
         out each file, session or block in turn; which parts there are, how smooth they are and their coefficients \
         are then found without it.",
    )])
}
