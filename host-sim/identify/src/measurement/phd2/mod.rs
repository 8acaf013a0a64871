//! Guide logs of PHD2 (and KStars and the ASIAIR, which write the same): the error of a mount's hour axis against the
//! stars, with what guiding took out put back.
//!
//! ```text
//! unguided error = distance of the star − Σ pulses sent before     (a pulse west sets the axis forward)
//! generator      = ratio · (hour axis as the section begins + sidereal rate · time)
//! ```
//!
//! Distances are pixels in the sky: times the pixel scale, over the cosine of the declination they are angles of the
//! axis. A pulse moves the axis by its duration at the rate that the mount was calibrated with. Each section
//! `Guiding Begins` and each dither begins a session with a zero of its own. Times are those of the section, on the
//! clock of its first line. [`axis`] says where the axis stands, [`text`] what a line says.
//!
//! A section that cannot be read (no pixel scale, too near to the pole) is left out, which a note says; it is an error
//! where none is left.

mod axis;
mod text;

use std::f64::consts::TAU;

use super::columns::Quantity;
use super::log::Log;
use super::reader::clock;
use axis::Pointing;
use flexspline_base::csv_rows::TableProblem;
use flexspline_base::units::ARCSEC_PER_RAD;
use text::{Header, WrittenNumber, number, said, word_of};

/// One turn of the sky, s. *Source*: the mean sidereal day in seconds of UT1, 86 400 / 1.002 737 909 35.
const SIDEREAL_DAY_S: f64 = 86_164.090_5;
/// Beyond this declination a distance in the sky says too little of the axis, deg. *Guess*: there an axis moves a star
/// by a sixth of its own way.
const HIGHEST_DECLINATION_DEG: f64 = 80.0;
/// Whether a file that begins so is a guide log.
pub(super) fn is_one(head: &[u8]) -> bool {
    let first = head.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let has = |what: &[u8]| first.windows(what.len()).any(|part| part.eq_ignore_ascii_case(what));
    has(b"PHD2") && has(b"log version")
}

/// A section: what it says of itself, and its rows.
#[derive(Default)]
struct GuideSection {
    /// Its first line.
    line: u64,
    pointing: Pointing,
    /// Arc-seconds in the sky for a pixel.
    scale: Option<f64>,
    declination_deg: Option<f64>,
    /// Pixels in the sky for a second of a pulse, and arc-seconds of the axis.
    x_rate: Option<f64>,
    guide_speed: Option<f64>,
    /// The header of its table.
    table: Option<Header>,
    /// Angle by which pulses have set the axis forward, arcsec.
    sent_arcsec: f64,
    frames: Vec<Frame>,
    pulses: u32,
    /// Rows without a star, or of another mount.
    lost: u32,
    /// Pulses west where the distance was positive, less those where it was negative.
    west_of_positive: i64,
    /// Why it cannot be read.
    problem: Option<TableProblem>,
}

/// A row before its sign is known: arc-seconds of the axis.
struct Frame {
    line: u64,
    session: u32,
    /// Since the section began, s.
    time_s: f64,
    distance: f64,
    sent: f64,
}

impl GuideSection {
    /// Takes what a line above the rows says.
    fn learn(&mut self, line: &str) {
        let value = |word: &str, units: &[&str]| said(line, word, units).map(|written| written.value);
        let positive = |word: &str| value(word, &[]).filter(|rate| *rate > 0.0);
        self.scale = positive("Pixel scale = ").or(self.scale);
        self.declination_deg = value("Dec = ", &["deg"]).or(self.declination_deg);
        self.x_rate = positive("xRate = ").or(self.x_rate);
        self.guide_speed = positive("RA Guide Speed = ").or(self.guide_speed);
        let hours = said(line, "Hour angle = ", &["h"]).filter(|hours: &WrittenNumber| hours.value.abs() <= 24.0);
        self.pointing.hour_angle = hours.or(self.pointing.hour_angle);
        if let Some(side) = word_of(line, "Pier side = ") {
            self.pointing.west = side.eq_ignore_ascii_case("west");
        }
    }

    /// Takes a row; says what of the section does not allow it.
    fn take(&mut self, line: &str, number_of_line: u64, session: u32) -> Result<(), TableProblem> {
        let Some(header) = &self.table else { return Ok(()) };
        if !line.trim_start_matches('"').starts_with(|first: char| first.is_ascii_digit()) {
            return Ok(());
        }
        let problem = |what: String| TableProblem { line: number_of_line, what };
        let columns = ["Time", "mount", "RARawDistance", "RADuration", "RADirection", "ErrorCode"];
        let fields = header.fields(line, columns).ok_or_else(|| {
            problem("more fields than names; allowed: decimals behind a point, or behind a comma in quotes".to_owned())
        })?;
        let [time_s, mount, distance, duration, direction, error] = &fields;
        let of_a_star = mount.eq_ignore_ascii_case("mount") && number(error).is_none_or(|code| code == 0.0);
        let (Some(time_s), Some(distance), true) = (number(time_s), number(distance), of_a_star) else {
            self.lost += 1;
            return Ok(());
        };
        let scale = self.scale.ok_or_else(|| {
            problem(
                "no \"Pixel scale = ... arc-sec/px\" above; allowed: a guide log that says its pixel scale".to_owned(),
            )
        })?;
        let declination = self.declination_deg.unwrap_or(0.0);
        if declination.abs() > HIGHEST_DECLINATION_DEG {
            let most = HIGHEST_DECLINATION_DEG;
            return Err(problem(format!("declination: found {declination} deg, allowed: -{most} to {most}")));
        }
        let of_axis = scale / declination.to_radians().cos();
        self.frames.push(Frame {
            line: number_of_line,
            session,
            time_s,
            distance: distance * of_axis,
            sent: self.sent_arcsec,
        });
        let duration_s = 1e-3 * number(duration).unwrap_or(0.0).abs();
        let forward = match direction.to_ascii_uppercase().chars().next() {
            Some('W') if duration_s > 0.0 => 1.0,
            Some('E') if duration_s > 0.0 => -1.0,
            _ => return Ok(()),
        };
        let rate = self.x_rate.map(|rate| rate * of_axis).or(self.guide_speed).ok_or_else(|| {
            problem(
                "a pulse, but neither \"xRate = ...\" nor \"RA Guide Speed = ...\" above; allowed: a log that says \
                 its guide rate"
                    .to_owned(),
            )
        })?;
        self.sent_arcsec += forward * duration_s * rate;
        self.pulses += 1;
        self.west_of_positive += if (distance > 0.0) == (forward > 0.0) { 1 } else { -1 };
        Ok(())
    }
}

/// Reads a guide log of an axis with this ratio; the rows and what is to be said of them.
pub(super) fn read(bytes: &[u8], ratio: f64) -> Result<(Log, Vec<String>), TableProblem> {
    let mut sections: Vec<GuideSection> = Vec::new();
    let (mut guiding, mut session) = (false, 0_u32);
    for (line, number) in bytes.split(|byte| *byte == b'\n').zip(1_u64..) {
        let line = String::from_utf8_lossy(line);
        let line = line.trim();
        if let Some(at) = line.trim_start_matches('"').strip_prefix("Guiding Begins at ") {
            session += 1;
            guiding = true;
            let begins_s = clock::seconds(at.trim_end_matches([',', ';', '\t', '"', ' '])).unwrap_or(0.0);
            let pointing = Pointing { begins_s, ..Pointing::default() };
            sections.push(GuideSection { line: number, pointing, ..GuideSection::default() });
            continue;
        }
        if line.starts_with("Guiding Ends") || line.starts_with("Calibration Begins") {
            guiding = false;
        }
        let Some(section) = sections.last_mut().filter(|_| guiding) else { continue };
        if line.starts_with("INFO: DITHER") || line.contains("LOCK POSITION") {
            // The star is held elsewhere.
            session += 1;
            section.sent_arcsec = 0.0;
        } else if let Some(header) = Header::of(line) {
            section.table = Some(header);
        } else if section.table.is_none() {
            section.learn(line);
        } else if section.problem.is_none() {
            section.problem = section.take(line, number, session).err();
        }
    }
    let mut notes = Vec::new();
    let mut first_problem = None;
    sections.retain_mut(|section| {
        let Some(problem) = section.problem.take() else { return !section.frames.is_empty() || section.lost > 0 };
        let (at, of) = (problem.line, section.line);
        notes.push(format!("the section that begins in line {of} is left out: {} (line {at})", problem.what));
        first_problem.get_or_insert(problem);
        false
    });
    if let Some(problem) = first_problem.filter(|_| sections.iter().all(|section| section.frames.is_empty())) {
        return Err(problem);
    }
    let back = sections.windows(2).find(|pair| pair[1].pointing.begins_s < pair[0].pointing.begins_s);
    if let Some([_, section]) = back
        && sections.iter().all(|section| section.pointing.hour_angle.is_none())
    {
        let what =
            "the clock is set back, and no hour angle says where the axis stands; allowed: a file for each clock";
        return Err(TableProblem { line: section.line, what: what.to_owned() });
    }
    let pointings: Vec<Pointing> = sections.iter().map(|section| section.pointing).collect();
    let (stands, of_axis) = axis::stands(&pointings, ratio);
    notes.extend(of_axis);
    Ok(of_sections(&sections, &stands, ratio, notes))
}

/// The rows of all sections as one log.
fn of_sections(sections: &[GuideSection], stands: &[f64], ratio: f64, further: Vec<String>) -> (Log, Vec<String>) {
    let total = |of: fn(&GuideSection) -> i64| sections.iter().map(of).sum::<i64>();
    let pulses = total(|section| section.pulses.into());
    let lost = total(|section| section.lost.into());
    // A star is followed by a pulse west where the axis lags.
    let lags = if total(|section| section.west_of_positive) >= 0 { -1.0 } else { 1.0 };
    let mut notes = vec![if pulses > 0 {
        format!("a guide log: guided; the unguided error is rebuilt from {pulses} pulses")
    } else {
        "a guide log without pulses: unguided; whether the error leads or lags is as PHD2 usually counts, west positive"
            .to_owned()
    }];
    if lost > 0 {
        notes.push(format!("{lost} frames without a star, or of another mount, are left out"));
    }
    if sections.iter().any(|section| !section.frames.is_empty() && section.declination_deg.is_none()) {
        notes.push(
            "the declination is not said: 0 is taken, and the error is too small if the star was elsewhere".to_owned(),
        );
    }
    notes.extend(further);
    let frames = || {
        let of = sections.iter().zip(stands);
        of.flat_map(|(section, stands)| section.frames.iter().map(move |frame| (section, *stands, frame)))
    };
    let column = |of: &dyn Fn(&GuideSection, f64, &Frame) -> f64| -> Vec<f64> {
        frames().map(|(section, stands, frame)| of(section, stands, frame)).collect()
    };
    let mut log = Log::default();
    log.line = frames().map(|(.., frame)| frame.line).collect();
    log.session = frames().map(|(.., frame)| frame.session - 1).collect();
    log.put(Quantity::Time, column(&|section, _, frame| section.pointing.begins_s + frame.time_s));
    log.put(Quantity::Generator, column(&|_, stands, frame| ratio * TAU * (stands + frame.time_s / SIDEREAL_DAY_S)));
    log.put(Quantity::Error, column(&|_, _, frame| (lags * frame.distance - frame.sent) / ARCSEC_PER_RAD));
    (log, notes)
}

#[cfg(test)]
mod tests;
