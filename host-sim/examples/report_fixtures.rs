//! Fixtures of the browser tests in addition to real reports: packed arrays with their values, and a page whose
//! every text is hostile.
//!
//! `cargo run --release --example report_fixtures -- DIR`

use std::path::PathBuf;

use flexspline_report::Packed;
use flexspline_report::page::{
    ChartAxis, ChartSeries, Choice, FieldMap, Figure, FigureBody, Headline, Limit, Lines, Mark, Page, PageBlock,
    PageQuantity, PageSection, PageTable, RichText, Status, Upright,
};
use serde_json::{Map, Value, json};

const HOSTILE: &str = concat!(
    r#"</script></title></noscript>"><img src=x onerror="window.hacked=1">"#,
    "<script>window.hacked=1</script>&amp;'{{7*7}}<!--"
);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("usage: report_fixtures DIR")?);
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("pack.json"), serde_json::to_string(&packs())?)?;
    std::fs::write(folder.join("hostile.html"), hostile().html()?)?;
    Ok(())
}

/// Arrays of every kind: smooth, noisy, constant, at the ends of their range, empty, not finite.
fn packs() -> Vec<Value> {
    let mut random = fastrand::Rng::with_seed(1);
    let smooth: Vec<f64> = (0..5000).map(|k| 0.4 * (f64::from(k) * 0.01).sin()).collect();
    let noisy: Vec<f64> = (0..3000).map(|_| 1e3 * (random.f64() - 0.5)).collect();
    let whole: Vec<f64> = (0..337).map(f64::from).collect();
    let mut out = Vec::new();
    let mut put = |packed: Packed, values: &[f64], tolerance: f64| {
        let values: Vec<Value> =
            values.iter().map(|v| if v.is_finite() { json!(v) } else { json!(v.to_string()) }).collect();
        out.push(json!({
            "name": packed.name, "kind": packed.kind, "scale": packed.scale, "offset": packed.offset,
            "text": packed.text, "values": values, "tolerance": tolerance,
        }));
    };
    for (name, values, scale) in
        [("smooth", &smooth, 1e-4), ("noisy", &noisy, 1e-4), ("whole", &whole, 1.0), ("constant", &vec![7.25; 9], 0.25)]
    {
        let packed = Packed::steps(name, &[values.len()], scale, values);
        let tolerance = if name == "whole" { 0.0 } else { 0.51 * packed.scale };
        put(packed, values, tolerance);
    }
    let ends = [f64::NAN, f64::INFINITY, -0.0, 1e-30, -3.5e20, 0.1];
    put(Packed::floats("floats", &[6], ends), &ends, 1e-7);
    put(Packed::floats("empty", &[0], []), &[], 0.0);
    out
}

fn hostile() -> Page {
    let id = "cam".to_owned();
    let series = |mark, colour| ChartSeries {
        name: HOSTILE.into(),
        mark,
        colour,
        points: (0..20).map(|k| [f64::from(k), f64::from(k * k)]).collect(),
    };
    let axis = |quantity| ChartAxis::new(HOSTILE, quantity);
    let figure = |id: &str, body| {
        PageBlock::Figure(Figure {
            id: id.into(),
            title: HOSTILE.into(),
            caption: HOSTILE.into(),
            alt: HOSTILE.into(),
            body,
        })
    };
    let lines = Lines {
        series: vec![series(Mark::Line, 0), series(Mark::Points, 1)],
        limits: vec![Limit { name: HOSTILE.into(), y: 100.0 }],
        uprights: vec![Upright { name: HOSTILE.into(), x: 10.0 }],
    };
    let field = FieldMap { x: vec![0.0, 1.0, 2.0], y: vec![0.0, 1.0], z: vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0] };
    let table = PageTable {
        caption: HOSTILE.into(),
        header: vec![HOSTILE.into(), "value".into()],
        rows: vec![vec![HOSTILE.into(), RichText::default().error(12.5, 3)]],
    };
    let mut results = Map::new();
    results.insert(HOSTILE.into(), HOSTILE.into());
    Page {
        title: HOSTILE.into(),
        command_name: "tables",
        status: Status::BoundMissed,
        also: vec![Status::DataFaults],
        remarks: vec![HOSTILE.into()],
        choices: vec![
            Choice { id: id.clone(), name: HOSTILE.into() },
            Choice { id: "other".into(), name: "other".into() },
        ],
        choice_is: "Generator",
        headlines: vec![Headline {
            choice: None,
            answer: HOSTILE.into(),
            number: RichText::default().error(61.0, 3),
            number_is: HOSTILE.into(),
        }],
        sections: vec![PageSection {
            id: "section".into(),
            title: HOSTILE.into(),
            folded: false,
            blocks: vec![
                PageBlock::Paragraph { choice: None, text: RichText::new(HOSTILE).strong(HOSTILE) },
                PageBlock::Table { choice: None, table },
                figure(
                    "lines",
                    FigureBody::Lines {
                        x: axis(PageQuantity::Degree),
                        y: axis(PageQuantity::Error),
                        charts: vec![(id.clone(), lines)],
                    },
                ),
                figure(
                    "field",
                    FigureBody::Field {
                        x: axis(PageQuantity::Degree),
                        y: axis(PageQuantity::Torque),
                        z: axis(PageQuantity::Error),
                        fields: vec![(id, field)],
                    },
                ),
            ],
        }],
        animations: Vec::new(),
        provenance: vec![(HOSTILE.into(), HOSTILE.into())],
        results,
    }
}
