//! The page of a flight: tracking, spectrum, torque, the servo's loop, limits.

use flexspline_motion::flight::{COMPENSATED, CONTROLLERS, Flight};
use flexspline_motion::loops::OpenLoop;
use serde_json::{Map, json};

use super::page::{
    ChartAxis, ChartSeries, Choice, Headline, Limit, Lines, Mark, Page, PageBlock, PageQuantity, PageSection, RichText,
    Status, Upright,
};
use flexspline_fly::fly::{ByController, Flown, LEAST_PHASE_MARGIN_DEG, Results, settles_in, spectrum};

/// The page; `command` is the line that made it.
pub fn page(flown: &Flown, flight: &Flight, results: &Results, command: &str) -> Page {
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
        provenance: vec![
            ("command".to_owned(), command.to_owned()),
            ("digest of all errors".to_owned(), results.digest.clone()),
        ],
        results: Map::from_iter([("flight".to_owned(), json!(results))]),
        ..Page::default()
    }
}

fn headline(results: &Results) -> Headline {
    let rms = &results.rms_arcsec;
    let words = "The pointing error of the compensated joint is {} rms; it is {} without compensation and {} with an \
                 error map by angle and direction.";
    let answer =
        RichText::filled(words, &[rms.compensated, rms.none, rms.fourier_by_direction].map(|arcsec| (arcsec, 3)));
    Headline::new(answer, RichText::arcsec(rms.compensated, 3), "output less target, rms")
}

/// Amplitude up to which a spectrum is linear, arcsec: lines that no pointing budget counts. A guess.
const FAINT_ARCSEC: f64 = 0.01;

/// A curve to each controller, that of the core over all others: an ideal lies close to it.
fn drawn(points: impl Fn(usize) -> Vec<[f64; 2]>) -> Vec<ChartSeries> {
    let mut order: Vec<usize> = (0..CONTROLLERS.len()).collect();
    order.sort_by_key(|k| *k == COMPENSATED);
    let series = |k: usize| ChartSeries::new(CONTROLLERS[k].replace('_', " "), Mark::Line, k, points(k));
    order.into_iter().map(series).collect()
}

fn tracking(flight: &Flight, results: &Results) -> PageSection {
    let columns = [&results.rms_arcsec, &results.max_arcsec, &results.velocity_ripple].map(ByController::all);
    let settles = results.settle_s.as_ref().map(ByController::all);
    let row = |(k, name): (usize, &&str)| {
        let [rms, largest, ripple] = columns.map(|column| column[k]);
        vec![
            name.replace('_', " ").into(),
            RichText::arcsec(rms, 3),
            RichText::arcsec(largest, 3),
            if ripple.is_finite() { format!("{ripple:.1} ″/s").into() } else { "–".into() },
            settles.map_or("–".into(), |seconds| settles_in(seconds[k]).into()),
        ]
    };
    let caption = "Output less target; speed of the output less the target's while that is even; time after a slew \
                   until it stays within 2″ of the target";
    let header = ["Controller", "rms", "largest", "velocity ripple", "settles"];
    let table = PageBlock::table(caption, &header, CONTROLLERS.iter().enumerate().map(row).collect());
    let over_time = |id, title, caption, y, column: usize| {
        let series = drawn(|k| flight.flown[k].rows.iter().map(|row| [row[0], row[column]]).collect());
        let x = ChartAxis::new("Time", PageQuantity::Second);
        PageBlock::lines(id, title, caption, [x, y], Lines::of(series).for_every_choice())
    };
    let error = over_time(
        "error",
        "Error over time",
        "Output less target. All controllers fly the same unit under the same sky.",
        ChartAxis::new("Error", PageQuantity::Error),
        1,
    );
    let mesh = over_time(
        "mesh",
        "Torque in the mesh",
        "The torque that the flanks carry: load, drag and inertia.",
        ChartAxis::new("Torque", PageQuantity::Torque),
        2,
    );
    PageSection::new("tracking", "Tracking", vec![table, error, mesh])
}

fn over_frequency() -> ChartAxis {
    ChartAxis::new("Frequency, Hz", PageQuantity::Count).stretched(1.0)
}

fn details(flown: &Flown, flight: &Flight, results: &Results) -> PageSection {
    let spectrum = PageBlock::lines(
        "spectrum",
        "Spectrum of the error",
        "Amplitude of lines, from windows of 4 s.",
        [over_frequency(), ChartAxis::new("Amplitude", PageQuantity::Error).stretched(FAINT_ARCSEC)],
        Lines::of(drawn(|k| spectrum(&flown.scenario, &flight.flown[k]))).for_every_choice(),
    );
    let stable = if results.stable { "stable" } else { "not stable" };
    let table = PageBlock::figures(format!("Loops and limits; {stable} after a knock"), &results.figures());
    PageSection::new("loops", "Spectrum, loops and limits", vec![spectrum, table])
}

/// Sizes of the open loop that the pictures show. A guess: what is far from 1 says nothing about margins.
const SIZES: [f64; 2] = [1e-2, 1e2];

/// The servo's open loop over the frequency, with the margins in it.
fn servo(flown: &Flown, flight: &Flight, results: &Results) -> PageSection {
    let open: Vec<OpenLoop> = flight.joint.servo_loop(&flown.scenario.servo).collect();
    let from_edge = |at: &OpenLoop| (at.real + 1.0).hypot(at.imaginary);
    let nearest = open.iter().min_by(|a, b| from_edge(a).total_cmp(&from_edge(b)));
    let [margin, at_hz] = results.phase_margin_deg;
    let crossing = (margin.is_finite() && results.servo_distance > 0.0)
        .then(|| Upright { name: format!("phase margin {margin:.0}° at {at_hz:.0} Hz"), x: at_hz });
    let nearest = nearest.map(|at| Upright { name: format!("nearest to −1 at {:.0} Hz", at.hz), x: at.hz });
    let uprights: Vec<Upright> = crossing.into_iter().chain(nearest).collect();
    let bode = |id, title, caption, y, value: fn(&OpenLoop) -> f64, limits: Vec<Limit>| {
        let shown = open.iter().filter(|at| (SIZES[0]..=SIZES[1]).contains(&at.size()));
        let points = shown.map(|at| [at.hz, value(at)]).collect();
        let series = vec![ChartSeries::new("open loop", Mark::Line, 0, points)];
        let chart = Lines { series, limits, uprights: uprights.clone() };
        PageBlock::lines(id, title, caption, [over_frequency(), y], chart.for_every_choice())
    };
    let limit = |name: String, y: f64| Limit { name, y };
    let gain = bode(
        "bode-gain",
        "Gain of the servo's open loop",
        "Motor, load and servo with the delay of its ticks. Where the gain is 1 (0 dB) the phase margin is taken.",
        ChartAxis::new("Gain, dB", PageQuantity::Count),
        |at| 20.0 * at.size().log10(),
        vec![limit("0 dB".to_owned(), 0.0)],
    );
    let sound = limit(format!("{LEAST_PHASE_MARGIN_DEG}° of margin"), LEAST_PHASE_MARGIN_DEG - 180.0);
    let phase = bode(
        "bode-phase",
        "Phase of the servo's open loop",
        "The phase margin is the distance to −180° where the gain is 1.",
        ChartAxis::new("Phase", PageQuantity::Degree),
        OpenLoop::phase_deg,
        vec![limit("−180°".to_owned(), -180.0), sound],
    );
    PageSection::new("servo", "The servo and its margins", vec![gain, phase])
}

fn reading() -> PageSection {
    PageSection::reading(vec![PageBlock::paragraph(
        "The unit has wind-up, clearance and tooth ripple of the drive of --tables, else of HHD-95, is 6 % stiffer \
         with 2″ more clearance, and has lines of eccentric wheels, pitch errors and an eccentric encoder that the \
         nominal table does not know. Both error maps hold the unit's own error over the angles, at the mean load, \
         also where gravity varies. The ideal knows the unit's own model and the true torque; its residual is the \
         servo's: friction, gusts, reversals. Friction is that of an eRob80, ratio 100, by Rhoban/bam.",
    )])
}
