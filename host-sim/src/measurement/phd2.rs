//! Guide logs of PHD2 (and KStars, which writes the same): the error of a mount's hour axis against the stars, with what guiding took out put
//! back.
//!
//! ```text
//! unguided error = distance of the star − Σ pulses sent before     (a pulse west sets the axis forward)
//! generator      = ratio · sidereal rate · time
//! ```
//!
//! Distances are pixels in the sky: times the pixel scale, over the cosine of the declination they are angles of the axis. A pulse moves the axis
//! by its duration at the rate that the mount was calibrated with. Each section `Guiding Begins` and each dither begins a session with a zero of
//! its own. Times are those of the section, on the clock of its first line.

use std::f64::consts::TAU;
use std::io::{BufRead, BufReader, Read};

use super::reader::clock;
use super::columns::{Quantity, Unit};
use super::csv_rows::TableProblem;
use super::log::Log;
use crate::units::ARCSEC_PER_RAD;

/// A turn of the sky, s.
const SIDEREAL_DAY_S: f64 = 86_164.090_5;
/// Beyond this declination a distance in the sky says too little of the axis, deg.
const HIGHEST_DECLINATION_DEG: f64 = 80.0;
/// Columns of a row, by the names of its header.
const COLUMNS: [&str; 6] = ["Time", "mount", "RARawDistance", "RADuration", "RADirection", "ErrorCode"];

/// Whether a file that begins so is a guide log.
pub(super) fn is_one(head: &[u8]) -> bool {
    let first = head.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let has = |what: &[u8]| first.windows(what.len()).any(|part| part.eq_ignore_ascii_case(what));
    has(b"PHD2") && has(b"log version")
}

/// What a section says of itself.
#[derive(Default)]
struct Section {
    begins_s: f64,
    /// Arc-seconds in the sky for a pixel.
    scale: Option<f64>,
    declination_deg: Option<f64>,
    /// Pixels in the sky for a second of a pulse, and arc-seconds of the axis.
    x_rate: Option<f64>,
    guide_speed: Option<f64>,
    places: Option<[Option<usize>; COLUMNS.len()]>,
    /// What pulses have set the axis forward by, arcsec.
    sent_arcsec: f64,
}

/// A row before its sign is known: arc-seconds of the axis.
struct Frame {
    line: u64,
    session: u32,
    time_s: f64,
    distance: f64,
    sent: f64,
}

/// Reads a guide log of an axis with this ratio; the rows and what is to be said of them.
pub(super) fn read(source: impl Read, ratio: f64) -> Result<(Log, Vec<String>), TableProblem> {
    let mut frames: Vec<Frame> = Vec::new();
    let mut section: Option<Section> = None;
    let (mut session, mut pulses, mut lost, mut no_declination) = (0_u32, 0_u32, 0_u32, false);
    // Pulses west where the distance was positive, less those where it was negative.
    let mut west_of_positive = 0_i64;
    for (line, number) in BufReader::new(source).split(b'\n').zip(1_u64..) {
        let problem = |what: String| TableProblem { line: number, what };
        let line = line.map_err(|error| problem(error.to_string()))?;
        let line = String::from_utf8_lossy(&line);
        let line = line.trim();
        if let Some(at) = line.strip_prefix("Guiding Begins at ") {
            session += 1;
            section = Some(Section { begins_s: clock::seconds(at).unwrap_or(0.0), ..Section::default() });
            continue;
        }
        if line.starts_with("Guiding Ends") || line.starts_with("Calibration Begins") {
            section = None;
        }
        let Some(section) = section.as_mut() else { continue };
        if line.starts_with("INFO: DITHER") || line.contains("LOCK POSITION") {
            // The star is held elsewhere.
            session += 1;
            section.sent_arcsec = 0.0;
        } else if line.starts_with("Frame,") {
            let names: Vec<&str> = line.split(',').collect();
            section.places = Some(COLUMNS.map(|column| names.iter().position(|name| *name == column)));
        } else if let Some(places) = section.places {
            let fields: Vec<&str> = line.split(',').map(|field| field.trim().trim_matches('"')).collect();
            if fields[0].parse::<u64>().is_err() {
                continue;
            }
            let field = |k: usize| places[k].and_then(|place| fields.get(place)).copied().unwrap_or_default();
            let number_of = |k: usize| field(k).parse::<f64>().ok().filter(|value| value.is_finite());
            let (Some(time), Some(distance)) = (number_of(0), number_of(2)) else {
                lost += 1;
                continue;
            };
            if !field(1).eq_ignore_ascii_case("mount") || number_of(5).is_some_and(|code| code != 0.0) {
                lost += 1;
                continue;
            }
            let scale = section.scale.ok_or_else(|| {
                problem(
                    "no \"Pixel scale = ... arc-sec/px\" above; allowed: a guide log that says its pixel scale"
                        .to_owned(),
                )
            })?;
            no_declination |= section.declination_deg.is_none();
            let declination = section.declination_deg.unwrap_or(0.0);
            if declination.abs() > HIGHEST_DECLINATION_DEG {
                let most = HIGHEST_DECLINATION_DEG;
                return Err(problem(format!("declination: found {declination} deg, allowed: -{most} to {most}")));
            }
            let of_axis = scale / declination.to_radians().cos();
            frames.push(Frame {
                line: number,
                session,
                time_s: section.begins_s + time,
                distance: distance * of_axis,
                sent: section.sent_arcsec,
            });
            let duration_s = 1e-3 * number_of(3).unwrap_or(0.0).abs();
            let forward = match field(4).to_ascii_uppercase().chars().next() {
                Some('W') => 1.0,
                Some('E') => -1.0,
                _ => 0.0,
            };
            if duration_s > 0.0 && forward != 0.0 {
                let rate = section.x_rate.map(|rate| rate * of_axis).or(section.guide_speed).ok_or_else(|| {
                    problem("a pulse, but neither \"xRate = ...\" nor \"RA Guide Speed = ...\" above; allowed: a log that says its guide rate".to_owned())
                })?;
                section.sent_arcsec += forward * duration_s * rate;
                pulses += 1;
                west_of_positive += if (distance > 0.0) == (forward > 0.0) { 1 } else { -1 };
            }
        } else {
            section.scale = after(line, "Pixel scale = ").or(section.scale);
            section.declination_deg =
                after(line, "Dec = ").filter(|_| line.starts_with("RA = ")).or(section.declination_deg);
            section.x_rate = after(line, "xRate = ").filter(|rate| *rate > 0.0).or(section.x_rate);
            section.guide_speed = after(line, "RA Guide Speed = ").filter(|rate| *rate > 0.0).or(section.guide_speed);
        }
    }
    // A star is followed by a pulse west where the axis lags.
    let lags = if west_of_positive >= 0 { -1.0 } else { 1.0 };
    let mut notes = vec![if pulses > 0 {
        format!("a guide log: guided; the unguided error is rebuilt from {pulses} pulses")
    } else {
        "a guide log without pulses: unguided; whether the error leads or lags is as PHD2 usually counts, west positive"
            .to_owned()
    }];
    if lost > 0 {
        notes.push(format!("{lost} frames without a star, or of another mount, are left out"));
    }
    if no_declination {
        notes.push(
            "the declination is not said: 0 is taken, and the error is too small if the star was elsewhere".to_owned(),
        );
    }
    let column = |of: &dyn Fn(&Frame) -> f64| frames.iter().map(of).collect::<Vec<f64>>();
    let mut log = Log::default();
    log.line = frames.iter().map(|frame| frame.line).collect();
    log.session = frames.iter().map(|frame| frame.session - 1).collect();
    let begins = frames.first().map_or(0.0, |frame| frame.time_s);
    log.put(Quantity::Time, column(&|frame| frame.time_s));
    log.put(Quantity::Generator, column(&|frame| ratio * TAU * (frame.time_s - begins) / SIDEREAL_DAY_S));
    log.put(Quantity::Error, column(&|frame| (lags * frame.distance - frame.sent) / ARCSEC_PER_RAD));
    Ok((log, notes))
}

/// The number behind a word.
fn after(line: &str, word: &str) -> Option<f64> {
    let rest = &line[line.find(word)? + word.len()..];
    let end = rest.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | 'e'))).unwrap_or(rest.len());
    rest[..end].parse().ok()
}

/// The columns of such a log as if they had been mapped.
pub(super) fn columns() -> Vec<super::columns::Column> {
    [(Quantity::Time, Unit::Second), (Quantity::Generator, Unit::Radian), (Quantity::Error, Unit::Radian)]
        .into_iter()
        .enumerate()
        .map(|(place, (quantity, unit))| super::columns::Column {
            quantity,
            name: COLUMNS[[0, 0, 2][place]].to_owned(),
            place,
            unit,
            reading: super::columns::Reading::of(unit),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::{ColumnMap, Gear, Recording, parse};
    use super::*;
    use std::fmt::Write as _;

    const HEADER: &str = "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RAGuideDistance,DECGuideDistance,RADuration,RADirection,DECDuration,DECDirection,XStep,YStep,StarMass,SNR,ErrorCode\n";
    const RATIO: f64 = 100.0;
    const SCALE: f64 = 1.5;
    const DECLINATION_DEG: f64 = 35.0;

    /// Error of the axis, arcsec: a wave twice a generator turn and a drift.
    fn error(t: f64) -> f64 {
        let generator = RATIO * TAU * t / SIDEREAL_DAY_S;
        12.0 * (2.0 * generator + 0.4).sin() + 0.02 * t
    }

    /// A night that is guided or not: a guider that measures once in two seconds and sends a pulse for seven tenths of what it sees.
    fn night(guided: bool, west: f64) -> String {
        let mut text = "PHD2 version 2.6.13 [Linux], Log version 2.5. Log enabled at 2026-11-01 20:00:00\n\n\
                        Calibration Begins at 2026-11-01 20:10:00\nWest,1,2.5,3.1,4.0\nCalibration complete\n\n\
                        Guiding Begins at 2026-11-01 20:20:00\nEquipment Profile = Rig\n"
            .to_owned();
        let _ = write!(
            text,
            "Pixel scale = {SCALE} arc-sec/px, Binning = 1, Focal length = 500 mm\n\
             Mount = M, connected, guiding enabled, xAngle = 30.0, xRate = 4.096, yAngle = 120.0, yRate = 4.900\n\
             RA = 5.00 hr, Dec = {DECLINATION_DEG} deg, Hour angle = 1.00 hr\n{HEADER}"
        );
        let cosine = DECLINATION_DEG.to_radians().cos();
        let mut sent = 0.0;
        for k in 0..1500 {
            let t = 2.0 * f64::from(k);
            if k % 400 == 399 {
                text += "700,1.0,\"DROP\",,,,,,,,,,,,,0,0.00,3,\"Star lost - low mass\"\n";
                continue;
            }
            // The axis leads by its error and what was sent; the star is then found on the other side.
            let leads = error(t) + sent;
            let raw = -west * leads * cosine / SCALE;
            let (ms, way) = if guided {
                ((0.7 * raw.abs() / 4.096 * 1000.0).round(), if west * raw > 0.0 { "W" } else { "E" })
            } else {
                (0.0, "")
            };
            let _ = writeln!(
                text,
                "{},{t:.3},\"Mount\",0.1,0.2,{raw:.4},0.1,{:.3},0,{ms:.0},{way},0,,,,12345,45.6,0",
                k + 1,
                0.7 * raw
            );
            let forward = if way == "W" { 1.0 } else { -1.0 };
            sent += forward * 1e-3 * ms * 4.096 * SCALE / cosine;
        }
        text + "Guiding Ends at 2026-11-01 21:10:00\n"
    }

    fn read_night(text: &str) -> Recording {
        parse("PHD2_GuideLog.txt", text.as_bytes(), &ColumnMap::default(), &Gear::of_ratio(RATIO)).unwrap()
    }

    fn off(recording: &Recording) -> f64 {
        let session = &recording.sessions[0];
        let generator = &session.generator_rad;
        let left = generator.iter().zip(&session.error_rad);
        let left: Vec<f64> =
            left.map(|(psi, e)| e * ARCSEC_PER_RAD - error(psi / RATIO / TAU * SIDEREAL_DAY_S)).collect();
        let mean = left.iter().sum::<f64>() / left.len() as f64;
        left.iter().map(|e| (e - mean).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn what_guiding_took_out_is_put_back_whichever_way_distances_count() {
        for west in [1.0, -1.0] {
            let recording = read_night(&night(true, west));
            assert_eq!(recording.sessions.len(), 1, "{:?}", recording.faults);
            assert!(off(&recording) < 0.05, "{}", off(&recording));
            assert!(
                recording.notes[0].contains("guided; the unguided error is rebuilt from 1"),
                "{:?}",
                recording.notes
            );
            assert!(recording.notes[1].starts_with("3 frames"), "{:?}", recording.notes);
        }
        let recording = read_night(&night(false, 1.0));
        assert!(off(&recording) < 0.01 && recording.notes[0].contains("without pulses"), "{}", off(&recording));
    }

    #[test]
    fn sections_and_dithers_have_zeros_of_their_own_and_what_is_missing_is_said() {
        let text = night(true, 1.0);
        let dithered = text.replacen("\n900,", "\nINFO: DITHER by 1.5, -2.25, new lock pos = 969.6, 605.2\n900,", 1);
        assert_eq!(read_night(&dithered).sessions.len(), 2);
        for (from, to, said) in [
            ("Pixel scale", "Pixels", "no \"Pixel scale"),
            ("xRate", "rate", "neither \"xRate"),
            ("Dec = 35", "Dec = 85", "declination: found 85"),
        ] {
            let refused =
                parse("g.txt", text.replace(from, to).as_bytes(), &ColumnMap::default(), &Gear::of_ratio(RATIO));
            assert!(refused.unwrap_err().to_string().contains(said));
        }
    }
}
