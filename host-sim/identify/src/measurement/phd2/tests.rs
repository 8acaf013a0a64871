use std::fmt::Write as _;

use super::super::{ColumnMap, Gear, MeasuredError, Recording, parse};
use super::*;

const HEADER: &str = "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RAGuideDistance,DECGuideDistance,RADuration,\
                      RADirection,DECDuration,DECDirection,XStep,YStep,StarMass,SNR,ErrorCode\n";
/// Ratio of the made-up mount. *Guess*: a round one; any would do.
const RATIO: f64 = 100.0;
/// Scale of the made-up camera, arcsec in a pixel. *Guess*: a usual one; any would do.
const SCALE: f64 = 1.5;
/// Amplitude of the made-up wave, arcsec. *Guess*: as mounts have it; any would do.
const AMPLITUDE: f64 = 12.0;
/// Hours of the right ascension that pass in a second, by definition.
const HOURS_A_S: f64 = 24.0 / SIDEREAL_DAY_S;

/// Error of the axis where it stands at n turns, arcsec: a wave twice a generator turn.
fn wave(axis: f64) -> f64 {
    AMPLITUDE * (2.0 * RATIO * TAU * axis + 0.4).sin()
}

/// A section as it is made: a guider that measures once in two seconds, and sends a pulse for seven tenths of what it
/// sees where it guides.
#[derive(Clone, Copy)]
struct Part<'a> {
    begins: &'a str,
    /// The lines that say where it points.
    pointing: &'a str,
    declination_deg: f64,
    /// Where the axis really stands as it begins, hours.
    axis_h: f64,
    rows: u32,
    guided: bool,
    /// Whether distances count so that a pulse west follows a positive one.
    west: f64,
    scale: &'a str,
}

const PART: Part<'static> = Part {
    begins: "2026-11-01 20:20:00",
    pointing: "RA = 5.00 hr, Dec = 35.0 deg, Hour angle = 1.00 hr",
    declination_deg: 35.0,
    axis_h: 1.0,
    rows: 1500,
    guided: true,
    west: 1.0,
    scale: "Pixel scale = 1.5 arc-sec/px, Binning = 1, Focal length = 500 mm",
};

/// The log of some sections.
fn night(parts: &[Part<'_>]) -> String {
    let mut text = "PHD2 version 2.6.13 [Linux], Log version 2.5. Log enabled at 2026-11-01 20:00:00\n\nCalibration \
                    Begins at 2026-11-01 20:10:00\nMount = M, Dec = 4.0 deg, Hour angle = 3.0 \
                    hr\nWest,1,2.5,3.1,4.0\nCalibration complete\n\n"
        .to_owned();
    for part in parts {
        let _ = write!(
            text,
            "Guiding Begins at {}\nEquipment Profile = Rig\n{}\nMount = M, connected, guiding enabled, xAngle = 30.0, \
             xRate = 4.096, yAngle = 120.0, yRate = 4.900\nNorm rates RA = 7.0\"/s @ dec 0, Dec = 6.8\"/s; ortho.err. \
             = 1.8 deg\nRA Guide Speed = 7.5 a-s/s, Dec Guide Speed = 7.5 a-s/s, Cal Dec = 4.0 deg, Last Cal Issue = \
             None\n{}\n{HEADER}",
            part.begins, part.scale, part.pointing
        );
        let cosine = part.declination_deg.to_radians().cos();
        let mut sent = 0.0;
        for k in 0..part.rows {
            let t = 2.0 * f64::from(k);
            if k % 400 == 399 {
                text += "700,1.0,\"DROP\",,,,,,,,,,,,,0,0.00,3,\"Star lost - low mass\"\n";
                continue;
            }
            // The axis leads by its error and what was sent; the star is then found on the other side.
            let leads = wave(part.axis_h / 24.0 + t / SIDEREAL_DAY_S) + 0.02 * t + sent;
            let raw = -part.west * leads * cosine / SCALE;
            let (ms, way) = if part.guided {
                ((0.7 * raw.abs() / 4.096 * 1000.0).round(), if part.west * raw > 0.0 { "W" } else { "E" })
            } else {
                (0.0, "")
            };
            let _ = writeln!(
                text,
                "{},{t:.3},\"Mount\",0.100,0.200,{raw:.3},0.100,{:.3},0.000,{ms:.0},{way},0,,,,12345,45.60,0",
                k + 1,
                0.7 * raw
            );
            let forward = if way == "W" { 1.0 } else { -1.0 };
            sent += forward * 1e-3 * ms * 4.096 * SCALE / cosine;
        }
        text += "Guiding Ends at 2026-11-01 21:10:00\n\n";
    }
    text
}

fn try_night(text: &str) -> Result<Recording, MeasuredError> {
    parse("PHD2_GuideLog.txt", text.as_bytes(), &ColumnMap::default(), &Gear::of_ratio(RATIO))
}

fn read_night(text: &str) -> Recording {
    try_night(text).unwrap()
}

/// Amplitude of the wave twice a generator turn that all sessions have in common, and what it leaves, arcsec rms. Each
/// has a zero and a drift of its own.
fn common_wave(recordings: &[Recording]) -> [f64; 2] {
    let straightened = |mut values: Vec<f64>| {
        let n = values.len() as f64;
        let x = |k: usize| k as f64 - 0.5 * (n - 1.0);
        let mean = values.iter().sum::<f64>() / n;
        let square: f64 = (0..values.len()).map(|k| x(k) * x(k)).sum();
        let slope = values.iter().enumerate().map(|(k, v)| x(k) * v).sum::<f64>() / square;
        values.iter_mut().enumerate().for_each(|(k, v)| *v -= mean + slope * x(k));
        values
    };
    let (mut sin, mut cos, mut error) = (Vec::new(), Vec::new(), Vec::new());
    for session in recordings.iter().flat_map(|recording| &recording.sessions) {
        let psi = &session.generator_rad;
        sin.extend(straightened(psi.iter().map(|psi| (2.0 * psi).sin()).collect()));
        cos.extend(straightened(psi.iter().map(|psi| (2.0 * psi).cos()).collect()));
        error.extend(straightened(session.error_rad.iter().map(|e| e * ARCSEC_PER_RAD).collect()));
    }
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (ss, sc, cc) = (dot(&sin, &sin), dot(&sin, &cos), dot(&cos, &cos));
    let (se, ce) = (dot(&sin, &error), dot(&cos, &error));
    let determinant = ss * cc - sc * sc;
    let (a, b) = ((se * cc - ce * sc) / determinant, (ce * ss - se * sc) / determinant);
    let left: f64 = (0..error.len()).map(|k| (error[k] - a * sin[k] - b * cos[k]).powi(2)).sum();
    [a.hypot(b), (left / error.len() as f64).sqrt()]
}

#[track_caller]
fn assert_one_wave(recordings: &[Recording], amplitude: f64, left: f64) {
    let [found, leaves] = common_wave(recordings);
    let notes: Vec<_> = recordings.iter().map(|of| (&of.notes, &of.faults)).collect();
    assert!((found - amplitude).abs() < left && leaves < left, "{found} arcsec, leaves {leaves}: {notes:#?}");
}

#[test]
fn what_guiding_took_out_is_put_back_whichever_way_distances_count() {
    for west in [1.0, -1.0] {
        let recording = read_night(&night(&[Part { west, ..PART }]));
        assert_eq!(recording.sessions.len(), 1, "{:?}", recording.faults);
        let notes = &recording.notes;
        assert!(notes[0].contains("guided; the unguided error is rebuilt from 1"), "{notes:?}");
        assert!(notes[1].starts_with("3 frames") && notes.len() == 2, "{notes:?}");
        assert_one_wave(&[recording], AMPLITUDE, 0.05);
    }
    let recording = read_night(&night(&[Part { guided: false, ..PART }]));
    assert!(recording.notes[0].contains("without pulses"));
    let generator = &recording.sessions[0].generator_rad;
    assert!((generator[0] - RATIO * TAU / 24.0).abs() < 1e-9, "the generator is where the hour angle has it");
    assert_one_wave(&[recording], AMPLITUDE, 0.05);
}

#[test]
fn sections_and_dithers_have_zeros_of_their_own_and_what_is_missing_is_said() {
    let text = night(&[PART]);
    let dithered = text.replacen("\n900,", "\nINFO: DITHER by 1.5, -2.25, new lock pos = 969.6, 605.2\n900,", 1);
    assert_eq!(read_night(&dithered).sessions.len(), 2);
    for (from, to, said) in [
        ("Pixel scale", "Pixels", "no \"Pixel scale"),
        ("xRate", "rate", "neither \"xRate"),
        ("Dec = 35", "Dec = 85", "declination: found 85"),
    ] {
        let text = text.replace(from, to).replace("RA Guide Speed = 7.5", "RA Guide Speed = Unknown");
        assert!(try_night(&text).unwrap_err().to_string().contains(said));
    }
}

#[test]
fn the_declination_is_read_wherever_it_stands_and_that_of_a_calibration_is_none() {
    for (pointing, declination_deg) in [
        // As the ASIAIR writes it.
        ("Dec = 69.0 deg, Hour angle = 1.00 hr, Pier side = East, Rotator pos = N/A", 69.0),
        ("Dec = -52.25 deg, Hour angle = 1.00 hr\nLast Cal Dec = 3.0 deg", -52.25),
        ("Pier side = East, Dec = 60.0 deg, Hour angle = 1.00 hr\nLock position = 5.0, 6.0, Cal Dec = 12.0 deg", 60.0),
    ] {
        let recording = read_night(&night(&[Part { pointing, declination_deg, ..PART }]));
        assert!(!recording.notes.iter().any(|note| note.contains("declination")), "{:?}", recording.notes);
        assert_one_wave(&[recording], AMPLITUDE, 0.1);
    }
    // Only that of a calibration: it is not said.
    let recording = read_night(&night(&[Part { pointing: "RA = 5.00 hr", declination_deg: 0.0, ..PART }]));
    assert!(recording.notes.iter().any(|note| note.contains("the declination is not said")));
}

/// A part that begins so long after the first, at this hour angle, on this side.
fn slewed(begins: &'static str, pointing: &'static str, axis_h: f64) -> Part<'static> {
    Part { begins, pointing, axis_h, rows: 700, ..PART }
}

#[test]
fn after_a_slew_the_generator_stands_where_the_hour_angle_has_it() {
    let three = [
        slewed(
            "2026-11-01 20:20:00",
            "RA = 5.00 hr, Dec = 35.0 deg, Hour angle = -3.10 hr, Pier side = West",
            -3.1 + 12.0,
        ),
        slewed(
            "2026-11-01 21:03:20",
            "RA = 3.00 hr, Dec = 35.0 deg, Hour angle = -0.37 hr, Pier side = West",
            -0.37 + 12.0,
        ),
        slewed("2026-11-01 22:40:10", "RA = 6.00 hr, Dec = 35.0 deg, Hour angle = 2.21 hr, Pier side = East", 2.21),
    ];
    let recording = read_night(&night(&three));
    assert_eq!(recording.sessions.len(), 3);
    assert!(recording.notes.iter().any(|note| note.contains("3 targets") && note.contains("8 deg")));
    assert_one_wave(&[recording], AMPLITUDE, 0.1);
    // Of a night that is in a file for each target.
    let files: Vec<Recording> = three.iter().map(|part| read_night(&night(&[*part]))).collect();
    assert_one_wave(&files, AMPLITUDE, 0.1);
}

#[test]
fn on_one_target_the_clock_says_more_than_an_hour_angle_that_is_rounded() {
    // The axis stands half of what is written away from what is.
    let late = 3000.0 * HOURS_A_S;
    let two = [
        slewed("2026-11-01 20:20:00", "Dec = 35.0 deg, Hour angle = 1.00 hr", 1.0049),
        slewed("2026-11-01 21:10:00", "Dec = 35.0 deg, Hour angle = 1.84 hr", 1.0049 + late),
    ];
    assert_one_wave(&[read_night(&night(&two))], AMPLITUDE, 0.1);
    // Nobody says an hour angle, as KStars: two files of a night agree by their clocks.
    let files = two.map(|part| {
        read_night(&night(&[Part {
            pointing: "RA = 5 hr, Dec = 35.0 deg, Hour angle = N/A hr, Pier side = East",
            ..part
        }]))
    });
    assert!(files[0].notes.iter().any(|note| note.contains("no hour angle")));
    assert_one_wave(&files, AMPLITUDE, 0.1);
}

#[test]
fn a_section_that_cannot_be_read_is_left_out_and_not_the_night() {
    let near_the_pole = Part {
        begins: "2026-11-01 20:05:00",
        pointing: "RA = 5.00 hr, Dec = 88.0 deg, Hour angle = 1.00 hr",
        declination_deg: 88.0,
        rows: 20,
        ..PART
    };
    let without_a_scale = Part { scale: "Pixel scale = unspecified, Binning = 1", rows: 50, ..PART };
    let later = slewed("2026-11-01 21:30:00", "Dec = 35.0 deg, Hour angle = 2.17 hr", 1.0 + 4200.0 * HOURS_A_S);
    for (bad, said) in [
        (Part { guided: false, ..near_the_pole }, "declination: found 88 deg"),
        (near_the_pole, "declination: found 88 deg"),
        (without_a_scale, "no \"Pixel scale"),
    ] {
        for parts in [[bad, PART, later], [PART, bad, later], [PART, later, bad]] {
            let recording = read_night(&night(&parts));
            assert_eq!(recording.sessions.len(), 2, "{:?}", recording.faults);
            let left_out = |note: &&String| note.contains("is left out") && note.contains(said);
            assert_eq!(recording.notes.iter().filter(left_out).count(), 1, "{:?}", recording.notes);
            assert_one_wave(&[recording], AMPLITUDE, 0.1);
        }
        assert!(try_night(&night(&[bad, bad])).unwrap_err().to_string().contains(said));
    }
}

/// A log as a locale writes it that has commas for decimals, unquoted.
fn with_commas(text: &str) -> String {
    let point = |(at, c): (usize, char)| {
        let digit = |at: Option<usize>| at.and_then(|at| text.as_bytes().get(at)).is_some_and(u8::is_ascii_digit);
        if c == '.' && digit(at.checked_sub(1)) && digit(Some(at + 1)) { ',' } else { c }
    };
    text.char_indices().map(point).collect()
}

#[test]
fn decimal_commas_are_read_as_points_unless_commas_part_the_fields() {
    for part in [
        PART,
        Part { guided: false, pointing: "Dec = -12.5 deg, Hour angle = 1.00 hr", declination_deg: -12.5, ..PART },
    ] {
        let text = night(&[part]);
        let due = read_night(&text);
        let commas = with_commas(&text);
        assert!(commas.contains("Pixel scale = 1,5 arc"));
        let rows = |change: &dyn Fn(&str) -> String| -> String {
            let of = |line: &str| {
                let is_row = line.starts_with("Frame,") || line.starts_with(|c: char| c.is_ascii_digit());
                if is_row { change(line) } else { with_commas(line) }
            };
            text.lines().map(|line| of(line) + "\n").collect()
        };
        let semicolons = rows(&|line| with_commas(&line.replace(',', ";")));
        let quoted = rows(&|line| {
            let field = |field: &str| {
                if field.contains('.') { format!("\"{}\"", with_commas(field)) } else { field.to_owned() }
            };
            line.split(',').map(field).collect::<Vec<_>>().join(",")
        });
        let refused = try_night(&commas).unwrap_err().to_string();
        assert!(refused.contains("more fields than names; allowed: decimals behind a point"), "{refused}");
        for other in [semicolons, quoted] {
            let read = read_night(&other);
            assert_eq!((&read.sessions, &read.notes), (&due.sessions, &due.notes));
        }
    }
}

#[test]
fn a_clock_that_is_set_back_within_the_night_needs_an_hour_angle() {
    let end_of_summer = Part { rows: 1800, begins: "2026-11-01 20:20:00", ..PART };
    let with_hour_angle = slewed("2026-11-01 20:10:00", "Dec = 35.0 deg, Hour angle = 2.50 hr", 2.5);
    let recording = read_night(&night(&[end_of_summer, with_hour_angle]));
    assert_eq!(recording.sessions.len(), 2);
    assert_one_wave(&[recording], AMPLITUDE, 0.1);
    let without = |part: Part<'static>| Part { pointing: "Dec = 35.0 deg, Hour angle = N/A", ..part };
    let refused = try_night(&night(&[without(end_of_summer), without(with_hour_angle)])).unwrap_err().to_string();
    assert!(refused.contains("the clock is set back") && refused.contains("a file for each clock"), "{refused}");
}
