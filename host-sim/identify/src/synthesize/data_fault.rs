//! Faults of the data: what goes wrong between the sensors and the file.

use std::f64::consts::TAU;

use super::catalogue::Effect;
use super::gauss;
use crate::causes::{ParameterName as Name, ParameterSpec, TIME as INSTANT, Usual::Value, number};
use crate::measurement::{FaultName, Session};
use flexspline_base::units::ARCSEC_PER_RAD;

/// Columns of a row.
const HEADER: &str = "time_s,generator_rad,output_rad,torque_n_m,temperature_c,orientation_rad\n";
/// Places of them.
const TIME: usize = 0;
const GENERATOR: usize = 1;
const OUTPUT: usize = 2;

/// The rows of a file, column by column as in its header.
type Cells = Vec<[f64; 6]>;

/// A fault that can be hidden in data.
pub(super) struct DataFault {
    /// Its name.
    pub name: FaultName,
    /// In words.
    pub meaning: &'static str,
    /// Its parameters.
    pub parameters: &'static [ParameterSpec],
    /// Puts it into the rows.
    spoil: fn(&mut Cells, &dyn Fn(Name) -> f64, &mut fastrand::Rng),
}

const CHANNELS: &[&str] = &["generator", "output", "torque", "temperature"];

/// The faults of the data in the order of lists.
pub(super) const FAULTS: [DataFault; 12] = [
    DataFault {
        name: FaultName::EncoderIndexJump,
        meaning: "the count of the output encoder is off from an instant on",
        parameters: &[number(Name::SizeArcsec, "of the jump", -1e5, 1e5, Value(60.0)), INSTANT],
        spoil: |rows, v, _| from_an_instant(rows, v, OUTPUT, v(Name::SizeArcsec) / ARCSEC_PER_RAD),
    },
    DataFault {
        name: FaultName::FrozenChannel,
        meaning: "a channel repeats one value",
        parameters: &[
            ParameterSpec { words: CHANNELS, ..number(Name::Channel, "which one", 0.0, 3.0, Value(1.0)) },
            INSTANT,
            number(Name::DurationS, "how long", 0.0, 1e6, Value(3.0)),
        ],
        spoil: |rows, v, _| {
            let (from, until) = (v(Name::TimeS), v(Name::TimeS) + v(Name::DurationS));
            let channel = 1 + v(Name::Channel) as usize;
            let mut held = None;
            for row in rows.iter_mut().filter(|row| (from..until).contains(&row[TIME])) {
                row[channel] = *held.get_or_insert(row[channel]);
            }
        },
    },
    DataFault {
        name: FaultName::MissingSamples,
        meaning: "rows without an output angle",
        parameters: &[number(Name::Share, "of the rows", 0.0, 0.5, Value(0.02))],
        spoil: |rows, v, random| {
            let share = v(Name::Share);
            rows.iter_mut().filter(|_| random.f64() < share).for_each(|row| row[OUTPUT] = f64::NAN);
        },
    },
    DataFault {
        name: FaultName::ClockError,
        meaning: "time runs back",
        parameters: &[number(Name::StepS, "by which", 1e-4, 1e4, Value(0.5)), INSTANT],
        spoil: |rows, v, _| from_an_instant(rows, v, TIME, -v(Name::StepS)),
    },
    DataFault {
        name: FaultName::Outliers,
        meaning: "single rows far off",
        parameters: &[
            number(Name::Share, "of the rows", 0.0, 0.1, Value(0.002)),
            number(Name::SizeArcsec, "of the largest", 0.0, 1e6, Value(600.0)),
        ],
        spoil: |rows, v, random| {
            let (share, size) = (v(Name::Share), v(Name::SizeArcsec) / ARCSEC_PER_RAD);
            for row in rows.iter_mut() {
                if random.f64() < share {
                    row[OUTPUT] += size * (0.5 + 0.5 * random.f64()) * if random.bool() { 1.0 } else { -1.0 };
                }
            }
        },
    },
    DataFault {
        name: FaultName::UnitMismatch,
        meaning: "the output angle is in degrees and says radians",
        parameters: &[],
        spoil: |rows, _, _| rows.iter_mut().for_each(|row| row[OUTPUT] = row[OUTPUT].to_degrees()),
    },
    DataFault {
        name: FaultName::Quantisation,
        meaning: "a coarse output encoder",
        parameters: &[number(Name::StepArcsec, "its step", 0.0, 1e5, Value(30.0))],
        spoil: |rows, v, _| {
            let step = (v(Name::StepArcsec) / ARCSEC_PER_RAD).max(1e-12);
            rows.iter_mut().for_each(|row| row[OUTPUT] = (row[OUTPUT] / step).round() * step);
        },
    },
    DataFault {
        name: FaultName::Drift,
        meaning: "a zero that moves with time",
        parameters: &[number(Name::ArcsecPerHour, "how fast", -1e6, 1e6, Value(300.0))],
        spoil: |rows, v, _| {
            let first = rows.first().map_or(0.0, |row| row[TIME]);
            let rate = v(Name::ArcsecPerHour) / 3600.0 / ARCSEC_PER_RAD;
            rows.iter_mut().for_each(|row| row[OUTPUT] += rate * (row[TIME] - first));
        },
    },
    DataFault {
        name: FaultName::ReadJitter,
        meaning: "the two angles are not read at one instant",
        parameters: &[number(Name::JitterMs, "scatter of the time between them", 0.0, 100.0, Value(0.5))],
        spoil: |rows, v, random| {
            let jitter_s = 1e-3 * v(Name::JitterMs);
            let speed =
                |pair: &[[f64; 6]]| (pair[1][OUTPUT] - pair[0][OUTPUT]) / (pair[1][TIME] - pair[0][TIME]).max(1e-9);
            let speeds: Vec<f64> = rows.windows(2).map(speed).collect();
            for (row, speed) in rows.iter_mut().zip(speeds) {
                row[OUTPUT] += jitter_s * gauss(random) * speed;
            }
        },
    },
    DataFault {
        name: FaultName::Stalls,
        meaning: "the logger stands still now and then, and its time counts on",
        parameters: &[
            number(Name::EveryRows, "after this number of rows", 2.0, 1e5, Value(50.0)),
            number(Name::DurationS, "for how long", 0.0, 1e3, Value(0.05)),
        ],
        // Rows that are not written while it stands still, and a time that counts those that are.
        spoil: |rows, v, _| {
            let (every, lasts_s) = (v(Name::EveryRows) as usize, v(Name::DurationS));
            let first = rows.first().map_or(0.0, |row| row[TIME]);
            let (mut lost_s, mut since, mut last_s, mut until_s) = (0.0, 0, first, f64::NEG_INFINITY);
            rows.retain_mut(|row| {
                let time = row[TIME];
                let written = time >= until_s;
                if written {
                    row[TIME] -= lost_s;
                    since += 1;
                    if since == every {
                        (since, until_s) = (0, time + lasts_s);
                    }
                } else {
                    lost_s += time - last_s;
                }
                last_s = time;
                written
            });
        },
    },
    DataFault {
        name: FaultName::CounterRestart,
        meaning: "the count of the generator begins anew in the sessions after the first",
        parameters: &[number(Name::Turns, "off by", -1e5, 1e5, Value(7.0))],
        spoil: |rows, v, _| {
            let usual = rows.windows(2).map(|pair| pair[1][TIME] - pair[0][TIME]).fold(f64::INFINITY, f64::min);
            let gap = rows.windows(2).position(|pair| pair[1][TIME] - pair[0][TIME] > 20.0 * usual);
            let from = gap.map_or(rows.len(), |gap| gap + 1);
            rows[from..].iter_mut().for_each(|row| row[GENERATOR] += TAU * v(Name::Turns).round());
        },
    },
    DataFault {
        name: FaultName::PositionJump,
        meaning: "the generator's angle leaps by whole turns",
        parameters: &[number(Name::Turns, "by how many", -1e5, 1e5, Value(16.0)), INSTANT],
        spoil: |rows, v, _| from_an_instant(rows, v, GENERATOR, TAU * v(Name::Turns).round()),
    },
];

/// Adds to a column from the instant `time_s` on.
fn from_an_instant(rows: &mut Cells, v: &dyn Fn(Name) -> f64, column: usize, more: f64) {
    let from = v(Name::TimeS);
    rows.iter_mut().filter(|row| row[TIME] >= from).for_each(|row| row[column] += more);
}

/// The rows as CSV text, with the faults among `effects` in them. `ratio` makes output angles of errors.
pub fn to_csv(sessions: &[Session], ratio: f64, effects: &[Effect], random: &mut fastrand::Rng) -> String {
    let mut rows = Cells::new();
    for session in sessions {
        let output = session.output_rad(ratio);
        let at = |column: &Option<Vec<f64>>, k: usize| column.as_ref().map_or(0.0, |values| values[k]);
        rows.extend((0..session.len()).map(|k| {
            [
                at(&session.time_s, k),
                session.generator_rad[k],
                output[k],
                at(&session.torque_n_m, k),
                at(&session.temperature_c, k),
                at(&session.orientation_rad, k),
            ]
        }));
    }
    for effect in effects {
        let of = |fault: &&DataFault| effect.definition.name == fault.name.as_str();
        if let Some(fault) = FAULTS.iter().find(of) {
            (fault.spoil)(&mut rows, &|name| effect.value(name), random);
        }
    }
    let mut text = csv::Writer::from_writer(Vec::with_capacity(80 * rows.len()));
    // Digits that the sensor does not have would only fill the disc: 1e-9 rad is 0.0002".
    let digits = |column: usize| [6, 9, 9, 4, 4, 4][column];
    let written = |(column, value): (usize, &f64)| {
        if value.is_finite() { format!("{value:.*}", digits(column)) } else { String::new() }
    };
    let records = rows.iter().map(|row| text.write_record(row.iter().enumerate().map(written)));
    records.collect::<Result<(), _>>().expect("memory takes what is written");
    let bytes = text.into_inner().expect("memory takes what is written");
    HEADER.to_owned() + &String::from_utf8(bytes).expect("numbers are text")
}

#[cfg(test)]
mod tests {
    use super::super::{DrawnUnit, MotionPlan, Sensors, Sizes, catalogue_drive, parse, synthesize};
    use super::*;
    use crate::measurement::{ColumnMap, Gear, MeasuredError, Recording, parse as read};

    fn recording(effect: &str) -> Recording {
        read_back(effect).unwrap()
    }

    fn read_back(effect: &str) -> Result<Recording, MeasuredError> {
        let nominal = catalogue_drive();
        let plan = MotionPlan { sessions: 8, rows: 1500, rate_hz: 100.0, speed_rad_s: 6.0, torque_n_m: 40.0 };
        let mut random = fastrand::Rng::with_seed(5);
        let motion = plan.excite(&mut random);
        let unit = DrawnUnit::draw(&nominal, &mut random);
        let sensors = Sensors { white_arcsec: 2.0, wander_arcsec: 0.5, wander_s: 12.0, encoder_bits: 22 };
        let sizes = Sizes { pitch_radius_mm: 48.7, base_radius_mm: 44.6 };
        let hidden = [parse(effect).unwrap()];
        let made = synthesize((&nominal, None), sizes, &hidden, motion, &sensors, &unit, &mut random).unwrap();
        let text = to_csv(&made.sessions, nominal.ratio, &made.effects, &mut random);
        read("data.csv", text.as_bytes(), &ColumnMap::default(), &Gear::of_teeth(188, 190, true))
    }

    #[test]
    fn each_fault_is_found_by_its_name_in_what_is_read_back() {
        for (effect, name) in [
            ("frozen_channel:channel=output,duration_s=3", FaultName::FrozenChannel),
            ("missing_samples", FaultName::MissingSamples),
            ("clock_error", FaultName::ClockError),
            ("outliers", FaultName::Outliers),
            ("quantisation", FaultName::Quantisation),
            ("read_jitter:jitter_ms=2", FaultName::ReadJitter),
            ("stalls", FaultName::Stalls),
            ("counter_restart", FaultName::CounterRestart),
            ("position_jump", FaultName::PositionJump),
        ] {
            let found: Vec<FaultName> = recording(effect).faults.iter().map(|fault| fault.name).collect();
            assert!(found.contains(&name), "{effect}: {found:?}");
        }
        let refused = read_back("unit_mismatch").unwrap_err().to_string();
        assert!(refused.contains("--columns output=output_rad:deg"), "{refused}");
        // Where the load crosses zero for a row, the flank changes for a row: that is taken for an outlier, and nothing
        // else is.
        assert!(recording("wear").faults.iter().all(|f| f.name == FaultName::Outliers && f.rows < 60));
    }

    #[test]
    fn what_is_written_reads_back_in_sessions() {
        let recording = recording("wear:growth_arcsec=10");
        assert_eq!(recording.sessions.len(), 8);
        assert!(recording.sessions.iter().all(|s| s.len() > 1480 && s.torque_n_m.is_some()));
    }
}
