//! The page of a campaign: how errors scatter, what makes them, what to tighten first, what tables leave, kernels
//! beside FEM.

use serde_json::{Map, json};

use super::page::{
    Axis, Block, Choice, Detail, Figure, FigureBody, Headline, Limit, Lines, Mark, Page, PageQuantity, Section, Series,
    Status, Table, Text, Upright, significant,
};
use super::study_report::{heading, value};
use flexspline_design::campaign::{Campaign, JUDGED, OfGenerator, Plan, SHARED, Tightened};
use flexspline_mechanics::drive::Drive;

/// Points of the curve of the distribution.
const CURVE: usize = 200;
/// Rows of the worst drives.
const WORST: usize = 20;

/// What the page is made from.
pub struct CampaignSources<'a> {
    /// The plan.
    pub plan: &'a Plan,
    /// The beginning of its hash.
    pub plan_hash: &'a str,
    /// The drive as drawn.
    pub drive: &'a Drive,
    /// The command line.
    pub command: &'a str,
    /// What came out.
    pub campaign: &'a Campaign,
}

/// The page.
pub fn page(of: CampaignSources<'_>) -> Page {
    let CampaignSources { plan, campaign, .. } = of;
    let all = &campaign.generators;
    let mut remarks = Vec::new();
    if !campaign.missing.is_empty() {
        remarks.push(format!(
            "PARTIAL: {} of {} drives; {} of {} shards are missing.",
            campaign.drives,
            campaign.planned,
            campaign.missing.len(),
            plan.shards
        ));
    }
    for one in all {
        if one.beyond_kernels > 0 {
            remarks.push(format!(
                "{}: the axes of {} drives stand further apart than the kernels know; their errors are extrapolated.",
                one.generator, one.beyond_kernels
            ));
        }
        if one.play_closed > 0 {
            remarks.push(format!(
                "{}: on {} of {} drives no play is left somewhere by kernels; lost motion there is the elastic \
                 wind-up alone.",
                one.generator, one.play_closed, campaign.drives
            ));
        }
        if let Some(fem) = one.fem.as_ref().filter(|fem| fem.figures.is_empty()) {
            remarks.push(format!(
                "{}: drives by FEM are too few for a correlation: {}, {} are needed; largest difference {}″.",
                one.generator,
                fem.drives,
                fem.drives_needed,
                significant(fem.largest_difference_arcsec, 3)
            ));
        }
        if one.fem_failed > 0 {
            remarks.push(format!("{}: {} drives by FEM found no equilibrium.", one.generator, one.fem_failed));
        }
    }
    if of.drive.flanks.friction_coefficient > 0.0 {
        remarks.push("Kernels leave friction out; the wave, the data sheet and the drives by FEM have it.".to_owned());
    }
    let mut results = Map::new();
    results.insert("campaign".to_owned(), json!(campaign));
    let mut sections = vec![scatter(&of), left(&of), tighten(&of), shares(&of)];
    sections.extend(by_fem(&of));
    sections.push(worst(&of));
    sections.push(tolerances(&of));
    sections.push(reading());
    Page {
        title: format!("Campaign of {}", of.drive.name),
        command_name: "campaign",
        status: if remarks.is_empty() { Status::Good } else { Status::Remark },
        also: Vec::new(),
        remarks,
        choices: all
            .iter()
            .map(|one| Choice { id: one.generator.to_string(), name: one.generator.to_string() })
            .collect(),
        choice_is: "Generator",
        headlines: all.iter().map(headline).collect(),
        sections,
        animations: Vec::new(),
        provenance: vec![
            ("command".to_owned(), of.command.to_owned()),
            ("plan_hash".to_owned(), of.plan_hash.to_owned()),
            ("load".to_owned(), format!("{} N·m", plan.torques_n_m[0])),
            ("temperature".to_owned(), format!("{} °C", plan.temperature_c)),
            ("mesh of the FEM".to_owned(), plan.mesh.clone()),
            ("drive_hash".to_owned(), blake3::Hash::from_bytes(of.drive.hash()).to_hex().to_string()),
        ],
        results,
    }
}

fn headline(one: &OfGenerator) -> Headline {
    let first = one.tighten.first();
    let answer = match first {
        Some(first) if first.gain_arcsec.low > 0.0 => Text::new(format!(
            "Tighten {} first for the error, peak to peak: halved, 95 % of {} drives stay below ",
            first.tolerance, first.drives
        ))
        .error(first.after_arcsec, 3)
        .plain(", now below "),
        _ => Text::new(format!("No tolerance alone buys much; of {} drives 95 % stay below ", one.errors.len())),
    };
    let told = first.filter(|first| first.gain_arcsec.low > 0.0).map(|first| first.before_arcsec);
    let number = one.figures.first().and_then(|f| f.quantiles.iter().find(|q| q.share == JUDGED));
    let value = number.map_or(f64::NAN, |q| q.value);
    Headline {
        choice: Some(one.generator.to_string()),
        answer: answer.error(told.unwrap_or(value), 3).plain("."),
        number: Text::default().error(value, 3),
        number_is: "error peak to peak that 95 % of the drives stay below".to_owned(),
    }
}

/// A table for each generator.
fn tables(of: &CampaignSources<'_>, make: impl Fn(&OfGenerator) -> Table) -> Vec<Block> {
    let block = |one: &OfGenerator| Block::Table { choice: Some(one.generator.to_string()), table: make(one) };
    of.campaign
        .generators
        .iter()
        .map(block)
        .filter(|block| !matches!(block, Block::Table { table, .. } if table.rows.is_empty()))
        .collect()
}

fn words(list: &[&str]) -> Vec<String> {
    list.iter().map(|word| (*word).to_owned()).collect()
}

/// Shares and errors (arcsec) below this are shown as nothing.
const NOTHING: f64 = 1e-5;

fn percent(share: f64) -> String {
    // An estimate of a share may lie a little below none.
    let shown = if share < NOTHING { 0.0 } else { 100.0 * share };
    format!("{} %", significant(shown, 3))
}

fn percents(low: f64, high: f64) -> Text {
    Text::new(format!("{} to {}", percent(low), percent(high)))
}

fn scatter(of: &CampaignSources<'_>) -> Section {
    let charts = of
        .campaign
        .generators
        .iter()
        .map(|one| {
            let n = one.errors.len();
            let point = |k: usize| {
                let rank = (k * (n - 1)) / (CURVE - 1).max(1);
                [one.errors[rank], 100.0 * (rank + 1) as f64 / n as f64]
            };
            let points: Vec<[f64; 2]> = (0..CURVE).map(point).collect();
            let series = vec![Series { name: "drives below".to_owned(), mark: Mark::Line, colour: 0, points }];
            let limits = vec![Limit { name: "95 %".to_owned(), y: 100.0 * JUDGED }];
            let mut uprights: Vec<Upright> =
                one.exceeded.iter().map(|e| Upright { name: format!("{}″", e.above), x: e.above }).collect();
            uprights.push(Upright { name: "as drawn".to_owned(), x: one.middle_error_pp_arcsec });
            (one.generator.to_string(), Lines { series, limits, uprights })
        })
        .collect();
    let figure = Figure {
        id: "scatter".to_owned(),
        title: "How many drives stay below an error".to_owned(),
        caption: Text::new("Error under the load, peak to peak over a turn of the output."),
        alt: "Share of the drives over the error that they stay below".to_owned(),
        body: FigureBody::Lines {
            x: Axis::new("error, peak to peak", PageQuantity::Error),
            y: Axis::new("drives below, %", PageQuantity::Count),
            charts,
        },
    };
    let mut blocks = vec![Block::Figure(figure)];
    blocks.extend(tables(of, |one| {
        let row = |e: &flexspline_design::campaign::Exceeded| {
            vec![Text::default().error(e.above, 3), Text::new(percent(e.of.value)), percents(e.of.low, e.of.high)]
        };
        Table {
            caption: "Drives above a limit, with 95 % intervals".to_owned(),
            header: words(&["Error above", "drives", "interval"]),
            rows: one.exceeded.iter().map(row).collect(),
        }
    }));
    blocks.extend(tables(of, |one| {
        let shown = [0.05, 0.5, JUDGED, 0.99];
        let rows = one.figures.iter().map(|figure| {
            let mut row = vec![
                Text::new(heading(figure.figure)),
                value(figure.figure, Some(figure.mean)),
                value(figure.figure, Some(figure.std)),
            ];
            row.extend(shown.iter().map(|share| {
                value(figure.figure, figure.quantiles.iter().find(|q| q.share == *share).map(|q| q.value))
            }));
            let judged = figure.quantiles.iter().find(|q| q.share == JUDGED);
            row.extend([judged.and_then(|q| q.low), judged.and_then(|q| q.high)].map(|end| value(figure.figure, end)));
            row
        });
        Table {
            caption: "Figures of the drives; the interval is that of the 95 % value, – where the drives are too few \
                      to bound it"
                .to_owned(),
            header: words(&["Figure", "mean", "std", "5 %", "50 %", "95 %", "99 %", "from", "to"]),
            rows: rows.collect(),
        }
    }));
    Section { id: "scatter".to_owned(), title: "How the drives scatter".to_owned(), detail: Detail::Summary, blocks }
}

fn left(of: &CampaignSources<'_>) -> Section {
    let blocks = tables(of, |one| {
        let rows = [
            ("no table", "no_table_rms_arcsec"),
            ("the table of the drive as drawn", "nominal_table_rms_arcsec"),
            ("a table of each unit", "unit_table_rms_arcsec"),
        ]
        .into_iter()
        .filter_map(|(what, name)| {
            let figure = one.figures.iter().find(|figure| figure.figure == name)?;
            let at = |share: f64| figure.quantiles.iter().find(|q| q.share == share).map(|q| q.value);
            let cells = [Some(figure.mean), at(0.5), at(JUDGED), at(0.99)].map(|x| value(name, x));
            Some([Text::new(what)].into_iter().chain(cells).collect())
        });
        Table {
            caption: "Error that is left, rms over a turn of the output and both signs of the load".to_owned(),
            header: words(&["With", "mean", "half of the drives below", "95 % below", "99 % below"]),
            rows: rows.collect(),
        }
    });
    Section { id: "left".to_owned(), title: "What tables leave".to_owned(), detail: Detail::Summary, blocks }
}

fn tighten(of: &CampaignSources<'_>) -> Section {
    let blocks = SHARED.iter().flat_map(|figure| tables(of, |one| ranking(of.plan, one, figure))).collect();
    Section { id: "tighten".to_owned(), title: "What to tighten first".to_owned(), detail: Detail::Summary, blocks }
}

/// What halving each tolerance does to a figure.
fn ranking(plan: &Plan, one: &OfGenerator, figure: &str) -> Table {
    let ranked: Vec<&Tightened> = one.tighten.iter().filter(|t| t.figure == figure).collect();
    let mut header = words(&["Tolerance, halved", "95 % below", "gain", "from", "to"]);
    if ranked.iter().any(|t| !t.above.is_empty()) {
        let limits = plan.exceed_arcsec.iter();
        header.extend(limits.flat_map(|x| [format!("above {x}″, now"), format!("above {x}″, halved")]));
    }
    let rows = ranked.iter().map(|t| {
        let mut row = vec![Text::new(t.tolerance.clone())];
        let gain = [t.after_arcsec, t.gain_arcsec.value, t.gain_arcsec.low, t.gain_arcsec.high];
        row.extend(gain.map(|x| Text::default().error(if x.abs() < NOTHING { 0.0 } else { x }, 3)));
        row.extend(t.above.iter().flat_map(|[_, before, after]| [before, after].map(|x| Text::new(percent(*x)))));
        row
    });
    let drives = ranked.first().map_or(0, |t| t.drives);
    Table {
        caption: format!(
            "{}: each tolerance halved, the others as they are, the first {drives} drives by kernels",
            heading(figure)
        ),
        header,
        rows: rows.collect(),
    }
}

fn shares(of: &CampaignSources<'_>) -> Section {
    let mut blocks = Vec::new();
    for (k, figure) in SHARED.iter().enumerate() {
        blocks.extend(tables(of, |one| {
            let rows = one.shares[k].shares.iter().map(|share| {
                let (first, total) = (share.first, share.total);
                vec![
                    Text::new(share.tolerance.clone()),
                    Text::new(percent(first.value)),
                    percents(first.low, first.high),
                    Text::new(percent(total.value)),
                    percents(total.low, total.high),
                ]
            });
            Table {
                caption: format!("Share of the variance of: {}", heading(figure)),
                header: words(&["Tolerance", "alone", "interval", "with others", "interval"]),
                rows: rows.collect(),
            }
        }));
    }
    Section { id: "shares".to_owned(), title: "What makes the scatter".to_owned(), detail: Detail::Summary, blocks }
}

fn by_fem(of: &CampaignSources<'_>) -> Option<Section> {
    let all = &of.campaign.generators;
    if all.iter().all(|one| one.fem.is_none()) {
        return None;
    }
    let charts = all
        .iter()
        .map(|one| {
            let mut points = one.pairs.clone();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let line = [points.first(), points.last()].into_iter().flatten().map(|p| [p[0], p[0]]).collect();
            let series = vec![
                Series { name: "drives".to_owned(), mark: Mark::Points, colour: 0, points },
                Series { name: "the same by both".to_owned(), mark: Mark::Dashed, colour: 5, points: line },
            ];
            (one.generator.to_string(), Lines { series, ..Lines::default() })
        })
        .collect();
    let figure = Figure {
        id: "fem".to_owned(),
        title: "Kernels beside FEM".to_owned(),
        caption: Text::new(format!(
            "Error peak to peak at {} places over a turn of the output, by both.",
            of.plan.fem_places
        )),
        alt: "Error of drives by FEM over that by kernels".to_owned(),
        body: FigureBody::Lines {
            x: Axis::new("by kernels", PageQuantity::Error),
            y: Axis::new("by FEM", PageQuantity::Error),
            charts,
        },
    };
    let mut blocks = vec![Block::Figure(figure)];
    blocks.extend(tables(of, |one| Table {
        caption: "Means by FEM, alone and with the kernels of all drives as control variate".to_owned(),
        header: words(&[
            "Figure",
            "drives",
            "correlation",
            "off, rms",
            "off, most",
            "kernels",
            "FEM alone",
            "from",
            "to",
            "with control",
            "from",
            "to",
        ]),
        rows: one
            .fem
            .iter()
            .flat_map(|fem| {
                fem.figures.iter().map(|f| {
                    let mut row = vec![
                        Text::new(heading(f.figure)),
                        Text::new(fem.drives.to_string()),
                        Text::new(significant(f.correlation, 4)),
                    ];
                    let numbers = [
                        f.off_rms_arcsec,
                        f.off_most_arcsec,
                        f.kernels_mean,
                        f.plain.value,
                        f.plain.low,
                        f.plain.high,
                        f.controlled.value,
                        f.controlled.low,
                        f.controlled.high,
                    ];
                    row.extend(numbers.map(|x| value(f.figure, Some(x))));
                    row
                })
            })
            .collect(),
    }));
    blocks.extend(tables(of, |one| Table {
        caption: "Drives above a limit at these places, by FEM with control, or why that is not told".to_owned(),
        header: words(&["Above", "kernels", "correlation", "by FEM"]),
        rows: one
            .fem
            .iter()
            .flat_map(|fem| {
                fem.tails.iter().map(|t| {
                    let told = match (&t.controlled, &t.refused) {
                        (Some(of), _) => {
                            Text::new(format!("{} ({} to {})", percent(of.value), percent(of.low), percent(of.high)))
                        }
                        (None, why) => Text::new(why.clone().unwrap_or_default()),
                    };
                    let r = t.correlation.map_or("–".to_owned(), |r| significant(r, 3));
                    vec![Text::default().error(t.above_arcsec, 3), Text::new(percent(t.kernels)), Text::new(r), told]
                })
            })
            .collect(),
    }));
    Some(Section { id: "fem".to_owned(), title: "Kernels beside FEM".to_owned(), detail: Detail::Engineering, blocks })
}

fn worst(of: &CampaignSources<'_>) -> Section {
    let blocks = tables(of, |one| {
        let header = ["Drive", "error", "file"].into_iter().map(str::to_owned);
        let rows = one.worst.iter().take(WORST).map(|w| {
            let mut row = vec![
                Text::new(w.drive.to_string()),
                Text::default().error(w.error_pp_arcsec, 3),
                Text::new(format!("worst/{}/{}", one.generator, w.file)),
            ];
            row.extend(w.values.iter().map(|x| Text::new(significant(*x, 4))));
            row
        });
        Table {
            caption: "The drives with the largest errors, peak to peak, and what was drawn".to_owned(),
            header: header.chain(of.plan.tolerances.iter().map(|t| t.name.clone())).collect(),
            rows: rows.collect(),
        }
    });
    Section { id: "worst".to_owned(), title: "The worst drives".to_owned(), detail: Detail::Engineering, blocks }
}

fn tolerances(of: &CampaignSources<'_>) -> Section {
    let row = |t: &flexspline_design::campaign::Tolerance| {
        vec![Text::new(t.name.clone()), Text::new(t.field.clone()), Text::new(t.distribution.to_string())]
    };
    let table = Table {
        caption: "What the drives were drawn from".to_owned(),
        header: words(&["Tolerance", "field", "distribution"]),
        rows: of.plan.tolerances.iter().map(row).collect(),
    };
    Section {
        id: "tolerances".to_owned(),
        title: "The tolerances".to_owned(),
        detail: Detail::Engineering,
        blocks: vec![Block::Table { choice: None, table }],
    }
}

fn reading() -> Section {
    Section::reading(vec![Block::paragraph(
        "Drives are computed by influence kernels of contact FEM: linear in the errors of single teeth, interpolated \
         in the distance of the axes, parabolas in every other dimension, each as if the others were as drawn. The \
         drives by FEM say how good that is for these tolerances. Intervals hold with 95 %: of quantiles by order \
         statistics, of probabilities after Wilson, of shares and gains by eight replicates. A table of each unit is \
         one without noise, with the curves that a table has room for: eight orders of the generator's turn, eight of \
         the turn against the output, six of the output's.",
    )])
}
