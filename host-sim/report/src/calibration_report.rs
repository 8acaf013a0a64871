//! The page of a calibration: what is left, which parts, and the curves.

use serde_json::{Map, json};

use super::page::{
    ChartAxis, ChartSeries, Choice, Headline, Lines, Mark, Page, PageBlock, PageQuantity, PageSection, RichText, Status,
};
use flexspline_identify::calibrate::{Calibrated, Calibration, PartSays, Split, SplitPart};

/// Points of a series on the page, at most.
const MOST_POINTS: usize = 4000;

/// The page.
pub fn page(made: &Calibrated) -> Page {
    let c = &made.calibration;
    let reading = PageSection::reading(vec![PageBlock::paragraph(
        "A table of one unit says what its error is, not why: two causes that look alike in these logs are one part \
         here. It holds for the torques, temperatures and angles recorded. Held-out figures leave out each \
         file or block in turn: parts, smoothness and coefficients are found without it.",
    )]);
    Page {
        title: format!("Calibration of one unit, ratio {}", c.ratio),
        command_name: "calibrate",
        status: if c.notes.is_empty() { Status::Good } else { Status::Remark },
        also: if c.data_faults.is_empty() { Vec::new() } else { vec![Status::DataFaults] },
        remarks: c.notes.clone(),
        choices: vec![Choice { id: "unit".to_owned(), name: "this unit".to_owned() }],
        choice_is: "unit",
        headlines: vec![headline(c)],
        sections: [left(made), parts(c)].into_iter().chain(c.split.as_ref().map(split)).chain([reading]).collect(),
        provenance: vec![
            ("command".to_owned(), c.command.clone()),
            ("table_id".to_owned(), c.table_id.clone()),
            ("logs".to_owned(), c.files.join(", ")),
        ],
        results: Map::from_iter([("calibration".to_owned(), json!(c))]),
        ..Page::default()
    }
}

fn headline(c: &Calibration) -> Headline {
    let kept = c.parts.iter().filter(|part| part.kept).count();
    let words = format!(
        "With the table of this unit the held-out error is {{}} rms of {{}}{}, and {{}} over all rows in the core; it \
         adds {kept} part{} to the prior model.",
        if c.has_delay() { ", the delay between the readings taken out" } else { "" },
        if kept == 1 { "" } else { "s" }
    );
    Headline::new(
        RichText::filled(
            &words,
            &[c.held_out.rms_after_arcsec, c.held_out.rms_before_arcsec, c.core.rms_after_arcsec].map(|rms| (rms, 3)),
        ),
        RichText::arcsec(c.held_out.rms_after_arcsec, 3),
        "held-out error with the table, rms".to_owned(),
    )
}

fn left(made: &Calibrated) -> PageSection {
    let c = &made.calibration;
    let measured = if c.has_delay() { "As measured less the delay" } else { "As measured" };
    let header = [measured, "Prior model, held out", "Table, held out", "All rows", "All rows, table in the core"];
    let (held, core) = (c.held_out, c.core);
    let of_held = [held.rms_before_arcsec, held.rms_prior_arcsec, held.rms_after_arcsec];
    let rms = of_held.into_iter().chain([core.rms_before_arcsec, core.rms_after_arcsec]);
    let rows = vec![rms.map(|arcsec| RichText::arcsec(arcsec, 3)).collect()];
    let every = made.shown.len().div_ceil(MOST_POINTS).max(1);
    let series = |name, colour, at: usize| {
        let points = made.shown.iter().step_by(every).map(|row| [row[0] / std::f64::consts::TAU, row[at]]);
        ChartSeries::sorted(name, Mark::Dots, colour, points.collect())
    };
    let figure = PageBlock::lines(
        "over-output",
        "Error over the output angle",
        "Rows in steady motion, before and after; here the table has seen all of them.",
        [ChartAxis::new("Output", PageQuantity::Turn), ChartAxis::new("Error", PageQuantity::Error)],
        Lines::of(vec![series("measured", 0, 1), series("residual", 1, 2)]).for_every_choice(),
    );
    let table = PageBlock::table("Error, root mean square", &header, rows);
    PageSection::new("left", "Residual", vec![table, figure])
}

fn parts(c: &Calibration) -> PageSection {
    let row = |part: &PartSays| {
        let gain = part.held_out_gain.map_or("–".to_owned(), |gain| format!("{:.1} %", 100.0 * gain));
        vec![
            part.name.replace('_', " ").into(),
            if part.kept { "kept" } else { "refused" }.into(),
            gain.into(),
            part.size_arcsec.map_or("–".into(), |size| RichText::arcsec(size, 3)),
            part.why.clone().into(),
        ]
    };
    let caption = "Parts of the model; the gain is the share of the held-out variance that a part explains, the size \
                   half of peak to peak";
    let header = ["Part", "Verdict", "Gain", "Size", "Why"];
    let table = PageBlock::table(caption, &header, c.parts.iter().map(row).collect());
    PageSection::new("parts", "Its parts", vec![table])
}

fn split(split: &Split) -> PageSection {
    let row = |part: &SplitPart| {
        let [rms, half_width] = [part.rms_arcsec, part.half_width_arcsec].map(|arcsec| RichText::arcsec(arcsec, 3));
        vec![part.of.replace('_', " ").into(), rms, half_width]
    };
    let header = ["Part", "Error at the output, rms", "± (95 %)"];
    let rows = split.parts.iter().map(row).collect();
    PageSection::new("split", "Encoder or gear", vec![PageBlock::table("What each has of the error", &header, rows)])
}
