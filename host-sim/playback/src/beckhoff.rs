//! Beckhoff: the table of `MC_TableBasedPositionCompensation` (TwinCAT NC, library Tc2_MC2), and the compensation value
//! list `kw.ssfk` of TwinCAT CNC. Both are closed: simulated from their manual pages
//! (docs/how-to/export_to_controllers.md).

use std::f64::consts::TAU;
use std::fmt::Write;

use flexspline::Direction;

use super::hats::Hats;
use super::{BOTH, FIT_POINTS, Origin, Player, Refusal, Section, Written, degrees, met, wanted};

/// Most entries that are written: what a PLC program of this length is still edited with, a guess.
const MAX_ENTRIES: u32 = 20_000;
/// Default number of points of an NC table to a generator turn: order 2 is then left with 0.3 % of itself.
const NC_POINTS_A_TURN: f64 = 32.0;
/// A compensation value list holds fewer entries than this, if it does not say `max_points` (P-COMP-00059).
const CNC_DEFAULT_POINTS: u32 = 1500;
/// Units of a compensation value list in a degree: 0.0001 degrees for a rotary axis (P-COMP-00023).
const CNC_UNITS: f64 = 1e4;

/// Evenly spaced values over a travel of the output, linear between them.
#[derive(Debug, Clone)]
struct TravelCurve {
    from: f64,
    step: f64,
    /// The last value stands where the first does, a turn on.
    ring: bool,
    values: Vec<f64>,
}

impl TravelCurve {
    /// Least squares over pairs of place and value; a ring repeats its first value at its end.
    fn fit(pairs: &[(f64, f64)], travel: [f64; 2], step: f64, entries: usize, ring: bool) -> TravelCurve {
        let mut hats = Hats::new(if ring { entries - 1 } else { entries }, travel[0], step, ring);
        pairs.iter().for_each(|(place, value)| hats.add(*place, *value));
        let mut values = hats.solve();
        if ring {
            values.push(values[0]);
        }
        TravelCurve { from: travel[0], step, ring, values }
    }

    fn at(&self, place: f64) -> f64 {
        let last = self.values.len() - 1;
        let at = (place - self.from) / self.step;
        let at = if self.ring { at.rem_euclid(last as f64) } else { at.clamp(0.0, last as f64) };
        let low = (at as usize).min(last - 1);
        let weight = at - low as f64;
        self.values[low] + weight * (self.values[low + 1] - self.values[low])
    }
}

/// A whole turn is the travel of a modulo axis.
fn whole_turn([from, to]: [f64; 2]) -> bool {
    (to - from - TAU).abs() < 1e-9
}

fn too_many(entries: u32) -> Refusal {
    Refusal::Impossible(format!("--points: found {entries}; allowed: 3 to {MAX_ENTRIES}"))
}

/// An array of `ST_PositionCompensationTableElement`: `Position` uncorrected, `Compensation` added to it. One value for
/// both directions. The page does not say how a value between two positions is found: taken as linear.
#[derive(Debug, Clone)]
pub struct Nc {
    directions: Vec<Direction>,
    travel: [f64; 2],
    points_a_turn: f64,
    /// Degrees of both.
    curve: TravelCurve,
}

impl Nc {
    /// Fits a table over a travel of the output (rad) for motion in these directions.
    pub fn fit(
        section: &Section<'_>,
        travel: [f64; 2],
        points: Option<u32>,
        directions: &[Direction],
    ) -> Result<Nc, Refusal> {
        let turns = (travel[1] - travel[0]) / TAU * section.ratio().abs();
        let entries = points.unwrap_or((NC_POINTS_A_TURN * turns).ceil() as u32 + 1);
        if !(3..=MAX_ENTRIES).contains(&entries) {
            return Err(too_many(entries));
        }
        let step = (travel[1] - travel[0]) / f64::from(entries - 1);
        let samples = section.samples(Some(travel), FIT_POINTS, directions);
        let mut curve = TravelCurve::fit(&wanted(&samples), travel, step, entries as usize, whole_turn(travel));
        // As the file says it: nine decimals of a degree.
        curve.values.iter_mut().for_each(|value| *value = (value.to_degrees() * 1e9).round() / 1e9);
        Ok(Nc { directions: directions.to_vec(), travel, points_a_turn: f64::from(entries - 1) / turns, curve })
    }
}

impl Player for Nc {
    fn correction_rad(&self, led_rad: f64, _: Direction) -> f64 {
        met(led_rad, |output| self.curve.at(output).to_radians())
    }

    fn directions(&self) -> &[Direction] {
        &self.directions
    }

    fn takes_a_side(&self) -> bool {
        true
    }

    fn travel(&self) -> Option<[f64; 2]> {
        Some(self.travel)
    }

    fn points(&self) -> String {
        format!(
            "{} entries over {} are {:.1} to a generator turn",
            self.curve.values.len(),
            degrees(self.travel),
            self.points_a_turn
        )
    }

    fn files(&self, origin: &Origin) -> Vec<Written> {
        let last = self.curve.values.len() - 1;
        let mut text = String::from("(*\n");
        for line in origin.lines("Compensation is added to Position; degrees of the output axis") {
            let _ = writeln!(text, "  {line}");
        }
        let directions = match self.directions[..] {
            [Direction::Forward] => "of motion in the positive direction only: set TableParameter.Direction so",
            [Direction::Backward] => "of motion in the negative direction only: set TableParameter.Direction so",
            _ => "for both directions: WorkDirectionBoth",
        };
        let _ = writeln!(text, "  values {directions}\n*)\n{{attribute 'qualified_only'}}\nVAR_GLOBAL CONSTANT");
        let _ = writeln!(text, "    FLEXSPLINE_LAST : UDINT := {last};\nEND_VAR\nVAR_GLOBAL");
        let _ = writeln!(
            text,
            "    FlexsplineParameter : ST_PositionCompensationTableParameter := (MinPosition := {:.9}, MaxPosition := \
             {:.9}, NoOfTableElements := {}, Modulo := {});",
            self.travel[0].to_degrees(),
            self.travel[1].to_degrees(),
            last + 1,
            if self.curve.ring { "TRUE" } else { "FALSE" }
        );
        let _ = writeln!(text, "    FlexsplineTable : ARRAY [0..{last}] OF ST_PositionCompensationTableElement := [");
        for (k, value) in self.curve.values.iter().enumerate() {
            let position = (self.curve.from + self.curve.step * k as f64).to_degrees();
            let comma = if k == last { "" } else { "," };
            let _ = writeln!(text, "        (Position := {position:.9}, Compensation := {value:.9}){comma}");
        }
        text += "    ];\nEND_VAR\n";
        vec![Written::text("flexspline_compensation.TcGVL.st", text)]
    }

    fn notes(&self) -> Vec<String> {
        vec!["the manual does not say how a value between two positions is found; taken as linear".to_owned()]
    }
}

/// A compensation value list: position errors (actual less setpoint) in 0.0001 degrees, one column for each direction.
#[derive(Debug, Clone)]
pub struct Cnc {
    travel: [f64; 2],
    points_a_turn: f64,
    /// Most entries that were asked for.
    asked: Option<u32>,
    /// Place of the first entry and distance of two, 0.0001 degrees.
    start: i64,
    interval: i64,
    /// Forward and backward: errors in 0.0001 degrees.
    curves: [TravelCurve; 2],
}

impl Cnc {
    /// Fits a list over a travel of the output, rad.
    pub fn fit(section: &Section<'_>, travel: [f64; 2], points: Option<u32>) -> Result<Cnc, Refusal> {
        let most = points.unwrap_or(CNC_DEFAULT_POINTS - 1);
        if !(3..=MAX_ENTRIES).contains(&most) {
            return Err(too_many(most));
        }
        let [start, end] = travel.map(|end| (end.to_degrees() * CNC_UNITS).round() as i64);
        // A whole number of units between two, and for a ring of steps in a turn.
        let steps = (i64::from(most) / 2..i64::from(most)).rev().find(|steps| (end - start) % steps == 0);
        let (interval, steps) = match steps {
            Some(steps) => ((end - start) / steps, steps),
            None if whole_turn(travel) => return Err(too_many(most)),
            None => {
                let interval = (end - start + i64::from(most) - 2) / (i64::from(most) - 1);
                (interval, (end - start + interval - 1) / interval)
            }
        };
        if interval < 1 {
            return Err(Refusal::Impossible(format!(
                "--points: {most} over {} are nearer to each other than 0.0001 deg",
                degrees(travel)
            )));
        }
        let step = (interval as f64 / CNC_UNITS).to_radians();
        let from = (start as f64 / CNC_UNITS).to_radians();
        let reach = [from, from + step * steps as f64];
        let samples = section.samples(Some(travel), FIT_POINTS, &BOTH);
        let pairs = wanted(&samples);
        let (forward, backward) = pairs.split_at(pairs.len() / 2);
        let curves = [forward, backward].map(|pairs| {
            let mut curve = TravelCurve::fit(pairs, reach, step, steps as usize + 1, whole_turn(travel));
            curve.values.iter_mut().for_each(|value| *value = (-value.to_degrees() * CNC_UNITS).round());
            curve
        });
        let turns = step / TAU * section.ratio().abs();
        Ok(Cnc { travel, points_a_turn: 1.0 / turns, asked: points, start, interval, curves })
    }
}

impl Player for Cnc {
    fn correction_rad(&self, led_rad: f64, direction: Direction) -> f64 {
        let curve = &self.curves[usize::from(direction == Direction::Backward)];
        met(led_rad, |output| -(curve.at(output) / CNC_UNITS).to_radians())
    }

    fn travel(&self) -> Option<[f64; 2]> {
        Some(self.travel)
    }

    fn points(&self) -> String {
        format!(
            "{} entries over {} are {:.1} to a generator turn",
            self.curves[0].values.len(),
            degrees(self.travel),
            self.points_a_turn
        )
    }

    fn files(&self, origin: &Origin) -> Vec<Written> {
        let entries = self.curves[0].values.len();
        let mut text = String::new();
        for line in origin.lines("position error, actual less setpoint, in 0.0001 deg") {
            let _ = writeln!(text, "# {line}");
        }
        let header = [
            ("unit", 1),
            ("interval", self.interval),
            ("kw_startpos", self.start),
            ("kw_nr_max", entries as i64),
            ("bilateral", 1),
            ("modulo", i64::from(self.curves[0].ring)),
        ];
        if entries >= CNC_DEFAULT_POINTS as usize {
            let _ = writeln!(text, "kw.ssfk.max_points {}", entries + 1);
        }
        for (name, value) in header {
            let _ = writeln!(text, "kw.ssfk.{name} {value}");
        }
        for (column, curve) in ["pos", "neg"].into_iter().zip(&self.curves) {
            for (k, value) in curve.values.iter().enumerate() {
                let _ = writeln!(text, "kw.ssfk.table[{k}].{column} {}", *value as i64);
            }
        }
        vec![Written::text("achskw.lis", text)]
    }

    fn notes(&self) -> Vec<String> {
        let entries = self.curves[0].values.len();
        let more = entries >= CNC_DEFAULT_POINTS as usize;
        let more =
            more.then(|| format!("kw.ssfk.max_points {} needs a CNC of build V3.1.3079.06 or later", entries + 1));
        let mut notes =
            vec!["add kopf.achs_nr and kopf.log_achs_name of the axis; switch on by lr_param.ssfk 1".to_owned()];
        notes.extend(more);
        notes.extend(self.asked.filter(|asked| *asked as usize != entries).map(|asked| {
            format!(
                "--points {asked}: {entries} entries were written, {} units of 0.0001 deg apart; a list has one \
                 distance, a whole number of units, and entries at that distance fill {}",
                self.interval,
                degrees(self.travel)
            )
        }));
        notes
    }
}
