//! The page of a flight: tracking, spectrum, torque, the servo's loop, limits.

use std::f64::consts::TAU;

use flexspline_motion::flight::{COMPENSATED, CONTROLLERS, Flight};
use flexspline_motion::loops::OpenLoop;
use serde_json::{Map, json};

use super::page::{
    Axis, Block, Choice, Detail, EVERY_CHOICE, Figure, FigureBody, Headline, Limit, Lines, Mark, Page, PageQuantity,
    Section, Series, Status, Table, Text, Upright,
};
use flexspline_fly::fly::{ByController, Flown, LEAST_DISTANCE, LEAST_PHASE_MARGIN_DEG, Results, spectrum};

/// The page; `command` is the line that made it.
#[must_use]
pub fn page(flown: &Flown, flight: &Flight, results: &Results, command: &str) -> Page {
    let mut named = Map::new();
    named.insert("flight".to_owned(), json!(results));
    let remarks = results.remarks.clone();
    let status = if results.servo_is_near_the_edge() || !results.stable {
        Status::Caution
    } else if remarks.is_empty() {
        Status::Good
    } else {
        Status::Remark
    };
    Page {
        title: format!("Flight {}, {} generator", results.scenario, results.generator),
        command_name: "fly",
        status,
        also: Vec::new(),
        remarks,
        choices: vec![Choice { id: "flight".to_owned(), name: results.scenario.clone() }],
        choice_is: "flight",
        headlines: vec![headline(results)],
        sections: vec![
            tracking(flight, results),
            details(flown, flight, results),
            servo(flown, flight, results),
            reading(),
        ],
        animations: Vec::new(),
        provenance: vec![
            ("command".to_owned(), command.to_owned()),
            ("digest of all errors".to_owned(), results.digest.clone()),
        ],
        results: named,
    }
}

fn headline(results: &Results) -> Headline {
    let rms = &results.rms_arcsec;
    Headline {
        choice: None,
        answer: Text::new("The compensated joint points to ")
            .error(rms.compensated, 3)
            .plain(" rms, where it leaves ")
            .error(rms.none, 3)
            .plain(" without compensation and ")
            .error(rms.fourier_by_direction, 3)
            .plain(" with an error map by angle and direction."),
        number: Text::default().error(rms.compensated, 3),
        number_is: "output less target, rms".to_owned(),
    }
}

fn cells(of: &ByController<f64>) -> [f64; 5] {
    [of.none, of.fourier, of.fourier_by_direction, of.compensated, of.ideal]
}

/// Amplitude up to which a spectrum is linear, arcsec: lines that no pointing budget counts. A guess.
const FAINT_ARCSEC: f64 = 0.01;

/// A curve to each controller, that of the core over all others: an ideal lies close to it.
fn drawn(points: impl Fn(usize) -> Vec<[f64; 2]>) -> Vec<Series> {
    let mut order: Vec<usize> = (0..CONTROLLERS.len()).collect();
    order.sort_by_key(|k| *k == COMPENSATED);
    let series =
        |k: usize| Series { name: CONTROLLERS[k].replace('_', " "), mark: Mark::Line, colour: k, points: points(k) };
    order.into_iter().map(series).collect()
}

fn tracking(flight: &Flight, results: &Results) -> Section {
    let columns = [&results.rms_arcsec, &results.max_arcsec, &results.velocity_ripple].map(cells);
    let rows = CONTROLLERS
        .iter()
        .enumerate()
        .map(|(k, name)| {
            let mut row = vec![Text::new(name.replace('_', " "))];
            row.extend(columns[..2].iter().map(|column| Text::default().error(column[k], 3)));
            let ripple = columns[2][k];
            row.push(Text::new(if ripple.is_finite() { format!("{ripple:.1} ″/s") } else { "–".to_owned() }));
            row.push(results.settle_s.as_ref().map_or(Text::new("–"), |s| Text::new(format!("{:.2} s", cells(s)[k]))));
            row
        })
        .collect();
    let table = Table {
        caption: "Output less target; speed of the output less the target's while that is even; time to settle after \
                  a slew"
            .to_owned(),
        header: ["Controller", "rms", "largest", "velocity ripple", "settles in"].map(str::to_owned).to_vec(),
        rows,
    };
    let over_time = |column: usize| -> Vec<Series> {
        drawn(|k| flight.flown[k].rows.iter().map(|row| [row[0], row[column]]).collect())
    };
    let figure = |id: &str, title: &str, caption: &str, y: Axis, series: Vec<Series>| {
        Block::Figure(Figure {
            id: id.to_owned(),
            title: title.to_owned(),
            caption: Text::new(caption),
            alt: format!("{title}, a curve to each controller"),
            body: FigureBody::Lines {
                x: Axis::new("Time", PageQuantity::Second),
                y,
                charts: vec![(EVERY_CHOICE.to_owned(), Lines { series, ..Lines::default() })],
            },
        })
    };
    Section {
        id: "tracking".to_owned(),
        title: "Tracking".to_owned(),
        detail: Detail::Summary,
        blocks: vec![
            Block::Table { choice: None, table },
            figure(
                "error",
                "Error over time",
                "Output less target. All controllers fly the same unit under the same sky.",
                Axis::new("Error", PageQuantity::Error),
                over_time(1),
            ),
            figure(
                "mesh",
                "Torque in the mesh",
                "What the flanks carry: load, drag, and what inertia asks for.",
                Axis::new("Torque", PageQuantity::Torque),
                over_time(2),
            ),
        ],
    }
}

fn details(flown: &Flown, flight: &Flight, results: &Results) -> Section {
    let line = |name: &str, value: String| vec![Text::new(name), Text::new(value)];
    let [margin, at_hz] = results.phase_margin_deg;
    let [held, free] = results.resonances_hz;
    let [all, held_back, not] = results.limited_ticks;
    let mut rows = vec![
        line("Phase margin of the servo, load attached", format!("{margin:.0}° at {at_hz:.0} Hz")),
        line("Its least distance from −1", format!("{:.2}", results.servo_distance)),
        line("Resonance, motor held / free", format!("{held:.0} Hz / {free:.0} Hz")),
        line("Low-pass of the torque", format!("{:.2} Hz", results.bandwidth_hz)),
        line("Stable after a knock", if results.stable { "yes" } else { "no" }.to_owned()),
        line("Ticks in which the motor gave all it has", all.to_string()),
        line("Ticks in which the limiter held back", held_back.to_string()),
        line("Ticks without a correction", not.to_string()),
        line(
            "Of what an ideal inverse removes the core removes",
            results.removed.map_or("–".to_owned(), |share| format!("{:.1} %", 100.0 * share)),
        ),
    ];
    if let Some(share) = results.torque_within_bound {
        rows.push(line(
            "Ticks in which the torque by the motor's current is within its bound",
            format!("{:.1} %", 100.0 * share),
        ));
    }
    let series = drawn(|k| spectrum(&flown.scenario, &flight.flown[k]));
    let figure = Figure {
        id: "spectrum".to_owned(),
        title: "Spectrum of the error".to_owned(),
        caption: Text::new("Amplitude of lines, from windows of 4 s."),
        alt: "Amplitude of the error over frequency, a curve to each controller".to_owned(),
        body: FigureBody::Lines {
            x: Axis::new("Frequency, Hz", PageQuantity::Count).stretched(1.0),
            y: Axis::new("Amplitude", PageQuantity::Error).stretched(FAINT_ARCSEC),
            charts: vec![(EVERY_CHOICE.to_owned(), Lines { series, ..Lines::default() })],
        },
    };
    let header = ["", "Value"].map(str::to_owned).to_vec();
    let table = Table { caption: "Loops and limits".to_owned(), header, rows };
    Section {
        id: "loops".to_owned(),
        title: "Spectrum, loops and limits".to_owned(),
        detail: Detail::Summary,
        blocks: vec![Block::Figure(figure), Block::Table { choice: None, table }],
    }
}

/// Sizes of the open loop that the pictures show. A guess: what is far from 1 says nothing about margins.
const SIZES: [f64; 2] = [1e-2, 1e2];
/// Size of the open loop up to which it is in the picture of the complex plane. A guess.
const NEAR: f64 = 2.5;
/// Points of a circle. A guess: they nearly touch.
const CIRCLE: u32 = 120;

/// The servo's open loop, with the margins in it.
fn servo(flown: &Flown, flight: &Flight, results: &Results) -> Section {
    let open: Vec<OpenLoop> = flight.joint.servo_loop(&flown.scenario.servo).collect();
    let shown = |at: &&OpenLoop| (SIZES[0]..=SIZES[1]).contains(&at.size());
    let line = |value: fn(&OpenLoop) -> f64| Series {
        name: "open loop".to_owned(),
        mark: Mark::Line,
        colour: 0,
        points: open.iter().filter(shown).map(|at| [at.hz, value(at)]).collect(),
    };
    let from_edge = |at: &OpenLoop| (at.real + 1.0).hypot(at.imaginary);
    let nearest = open.iter().min_by(|a, b| from_edge(a).total_cmp(&from_edge(b)));
    let [margin, at_hz] = results.phase_margin_deg;
    let is_stable = results.servo_distance > 0.0;
    let margin_in_words = format!("phase margin {margin:.0}° at {at_hz:.0} Hz");
    let uprights: Vec<Upright> = [
        (margin.is_finite() && is_stable).then(|| Upright { name: margin_in_words.clone(), x: at_hz }),
        nearest.map(|at| Upright { name: format!("nearest to −1 at {:.0} Hz", at.hz), x: at.hz }),
    ]
    .into_iter()
    .flatten()
    .collect();
    let sound_deg = LEAST_PHASE_MARGIN_DEG - 180.0;
    let bode = |id: &str, title: &str, caption: &str, y: Axis, series: Series, limits: Vec<Limit>| {
        Block::Figure(Figure {
            id: id.to_owned(),
            title: title.to_owned(),
            caption: Text::new(caption),
            alt: format!("{title} over frequency, with its margins: {margin_in_words}"),
            body: FigureBody::Lines {
                x: Axis::new("Frequency, Hz", PageQuantity::Count).stretched(1.0),
                y,
                charts: vec![(
                    EVERY_CHOICE.to_owned(),
                    Lines { series: vec![series], limits, uprights: uprights.clone() },
                )],
            },
        })
    };
    let limit = |name: &str, y: f64| Limit { name: name.to_owned(), y };
    let sorted = |mut points: Vec<[f64; 2]>| {
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points
    };
    // No two points of the circle share an x, of which a chart keeps one.
    let around = |k: u32| {
        let (sin, cos) = (TAU * (f64::from(k) + 0.25) / f64::from(CIRCLE)).sin_cos();
        [LEAST_DISTANCE * cos - 1.0, LEAST_DISTANCE * sin]
    };
    let series = |name: String, mark, colour, points| Series { name, mark, colour, points: sorted(points) };
    let mut in_plane = vec![
        series(
            "open loop".to_owned(),
            Mark::Dots,
            0,
            open.iter().filter(|at| at.size() < NEAR).map(|at| [at.real, at.imaginary]).collect(),
        ),
        series(format!("{LEAST_DISTANCE} from −1"), Mark::Dots, 5, (0..CIRCLE).map(around).collect()),
        series("−1".to_owned(), Mark::Points, 1, vec![[-1.0, 0.0]]),
    ];
    in_plane.extend(nearest.map(|at| {
        let name = format!("nearest to −1: {:.2} at {:.0} Hz", from_edge(at), at.hz);
        series(name, Mark::Points, 2, vec![[at.real, at.imaginary]])
    }));
    if is_stable && let Some(crossing) = open.iter().find(|at| at.hz >= at_hz && margin.is_finite()) {
        in_plane.push(series(margin_in_words.clone(), Mark::Points, 3, vec![[crossing.real, crossing.imaginary]]));
    }
    let nyquist = Block::Figure(Figure {
        id: "nyquist".to_owned(),
        title: "Open loop of the servo in the complex plane".to_owned(),
        caption: Text::new(
            "Nyquist's picture, from low frequencies at the left or below to half of the sampling frequency at the \
             origin. A sound servo stays out of the circle around −1.",
        ),
        alt: format!("The open loop beside the point −1; least distance {:.2}", results.servo_distance),
        body: FigureBody::Lines {
            x: Axis::new("Real part", PageQuantity::Count),
            y: Axis::new("Imaginary part", PageQuantity::Count),
            charts: vec![(EVERY_CHOICE.to_owned(), Lines { series: in_plane, ..Lines::default() })],
        },
    });
    Section {
        id: "servo".to_owned(),
        title: "The servo and its margins".to_owned(),
        detail: Detail::Summary,
        blocks: vec![
            bode(
                "bode-gain",
                "Gain of the servo's open loop",
                "Motor, load and servo with the delay of its ticks. Where the gain is 1 (0 dB) the phase margin is \
                 taken.",
                Axis::new("Gain, dB", PageQuantity::Count),
                line(|at| 20.0 * at.size().log10()),
                vec![limit("0 dB", 0.0)],
            ),
            bode(
                "bode-phase",
                "Phase of the servo's open loop",
                "The phase margin is what is left to −180° where the gain is 1.",
                Axis::new("Phase", PageQuantity::Degree),
                line(OpenLoop::phase_deg),
                vec![limit("−180°", -180.0), limit(&format!("{LEAST_PHASE_MARGIN_DEG}° of margin"), sound_deg)],
            ),
            nyquist,
        ],
    }
}

fn reading() -> Section {
    Section::reading(vec![Block::paragraph(
        "The unit has wind-up, clearance and tooth ripple of the contact FEM of HHD-95, is 6 % stiffer with 2″ more \
         clearance, and has lines of eccentric wheels, pitch errors and an eccentric encoder that the nominal table \
         does not know. The two error maps hold the unit's own error over the angles, recorded without noise at the \
         mean load. The ideal is told the unit's own law and the true torque; what it leaves is the servo's: \
         friction, gusts, reversals. Friction is that of an eRob80 of ratio 100 as identified by Rhoban/bam.",
    )])
}
