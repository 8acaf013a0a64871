//! Faults of the data: what goes wrong between the sensors and the file.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use super::catalogue::{Effect, Hidden};
use super::gauss;
use crate::causes::ParameterName;
use crate::measurement::{FaultName, Session};
use flexspline_base::units::ARCSEC_PER_RAD;

/// Columns of a row.
const HEADER: &str = "time_s,generator_rad,output_rad,torque_n_m,temperature_c,orientation_rad\n";
/// Places of them.
const TIME: usize = 0;
const OUTPUT: usize = 2;
const TORQUE: usize = 3;

/// The rows as CSV text, with the faults among `effects` in them. `ratio` makes output angles of errors.
#[must_use]
pub fn to_csv(sessions: &[Session], ratio: f64, effects: &[Effect], random: &mut fastrand::Rng) -> String {
    let mut rows: Vec<[f64; 6]> = Vec::new();
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
        if let Hidden::Fault(fault) = effect.definition.what {
            spoil(&mut rows, fault, effect, random);
        }
    }
    let mut text = String::with_capacity(80 * rows.len());
    text.push_str(HEADER);
    for row in rows {
        for (k, value) in row.iter().enumerate() {
            let comma = if k > 0 { "," } else { "" };
            // Digits that the sensor does not have would only fill the disc: 1e-9 rad is 0.0002".
            let _ = match k {
                _ if !value.is_finite() => write!(text, "{comma}"),
                TIME => write!(text, "{comma}{value:.6}"),
                1 | OUTPUT => write!(text, "{comma}{value:.9}"),
                _ => write!(text, "{comma}{value:.4}"),
            };
        }
        text.push('\n');
    }
    text
}

fn spoil(rows: &mut Vec<[f64; 6]>, fault: FaultName, effect: &Effect, random: &mut fastrand::Rng) {
    use ParameterName as Name;
    let v = |name: Name| effect.value(name);
    let first = rows.first().map_or(0.0, |row| row[TIME]);
    match fault {
        FaultName::EncoderIndexJump => {
            let (time, size) = (v(Name::TimeS), v(Name::SizeArcsec) / ARCSEC_PER_RAD);
            rows.iter_mut().filter(|row| row[TIME] >= time).for_each(|row| row[OUTPUT] += size);
        }
        FaultName::FrozenChannel => {
            let (from, until) = (v(Name::TimeS), v(Name::TimeS) + v(Name::DurationS));
            let channel = 1 + v(Name::Channel) as usize;
            let mut held = None;
            for row in rows.iter_mut().filter(|row| (from..until).contains(&row[TIME])) {
                row[channel] = *held.get_or_insert(row[channel]);
            }
        }
        FaultName::MissingSamples => {
            let share = v(Name::Share);
            rows.iter_mut().filter(|_| random.f64() < share).for_each(|row| row[OUTPUT] = f64::NAN);
        }
        FaultName::ClockError => {
            let (time, step) = (v(Name::TimeS), v(Name::StepS));
            rows.iter_mut().filter(|row| row[TIME] >= time).for_each(|row| row[TIME] -= step);
        }
        FaultName::Outliers => {
            let (share, size) = (v(Name::Share), v(Name::SizeArcsec) / ARCSEC_PER_RAD);
            for row in rows.iter_mut() {
                if random.f64() < share {
                    row[OUTPUT] += size * (0.5 + 0.5 * random.f64()) * if random.bool() { 1.0 } else { -1.0 };
                }
            }
        }
        FaultName::UnitMismatch => rows.iter_mut().for_each(|row| row[OUTPUT] = row[OUTPUT].to_degrees()),
        FaultName::Quantisation => {
            let step = (v(Name::StepArcsec) / ARCSEC_PER_RAD).max(1e-12);
            rows.iter_mut().for_each(|row| row[OUTPUT] = (row[OUTPUT] / step).round() * step);
        }
        FaultName::Drift => {
            let rate = v(Name::ArcsecPerHour) / 3600.0 / ARCSEC_PER_RAD;
            rows.iter_mut().for_each(|row| row[OUTPUT] += rate * (row[TIME] - first));
        }
        FaultName::ReadJitter => {
            let jitter_s = 1e-3 * v(Name::JitterMs);
            let speeds: Vec<f64> = rows
                .windows(2)
                .map(|pair| (pair[1][OUTPUT] - pair[0][OUTPUT]) / (pair[1][TIME] - pair[0][TIME]).max(1e-9))
                .collect();
            for (row, speed) in rows.iter_mut().zip(speeds) {
                row[OUTPUT] += jitter_s * gauss(random) * speed;
            }
        }
        FaultName::Stalls => {
            // Rows that are not written while it stands still, and a time that counts those that are.
            let (every, lasts_s) = (v(Name::EveryRows) as usize, v(Name::DurationS));
            let (mut kept, mut lost_s): (Vec<[f64; 6]>, f64) = (Vec::new(), 0.0);
            let (mut since, mut last_s, mut until_s) = (0, first, f64::NEG_INFINITY);
            for row in rows.iter() {
                if row[TIME] < until_s {
                    lost_s += row[TIME] - last_s;
                } else {
                    kept.push(*row);
                    if let Some(kept) = kept.last_mut() {
                        kept[TIME] -= lost_s;
                    }
                    since += 1;
                    if since == every {
                        (since, until_s) = (0, row[TIME] + lasts_s);
                    }
                }
                last_s = row[TIME];
            }
            *rows = kept;
        }
        FaultName::CounterRestart => {
            let usual = rows.windows(2).map(|pair| pair[1][TIME] - pair[0][TIME]).fold(f64::INFINITY, f64::min);
            let gap = rows.windows(2).position(|pair| pair[1][TIME] - pair[0][TIME] > 20.0 * usual);
            let from = gap.map_or(rows.len(), |gap| gap + 1);
            rows[from..].iter_mut().for_each(|row| row[1] += TAU * v(Name::Turns).round());
        }
        FaultName::TorqueSign => rows.iter_mut().for_each(|row| row[TORQUE] = -row[TORQUE]),
        FaultName::TorqueScale => rows.iter_mut().for_each(|row| row[TORQUE] *= v(Name::Factor)),
        FaultName::TorqueZero => rows.iter_mut().for_each(|row| row[TORQUE] += v(Name::TorqueNM)),
        FaultName::PositionJump => {
            let (time, off) = (v(Name::TimeS), TAU * v(Name::Turns).round());
            rows.iter_mut().filter(|row| row[TIME] >= time).for_each(|row| row[1] += off);
        }
        FaultName::AveragedRows => average(rows, 0.5 * v(Name::DurationS)),
    }
}

/// Makes angles and torque of each row the mean of those about it, no farther than so long: over a gap no row reaches.
fn average(rows: &mut [[f64; 6]], half_s: f64) {
    let read = rows.to_vec();
    let (mut from, mut to) = (0, 0);
    for row in rows.iter_mut() {
        let time = row[TIME];
        while read[from][TIME] < time - half_s - 1e-9 {
            from += 1;
        }
        while to < read.len() && read[to][TIME] <= time + half_s + 1e-9 {
            to += 1;
        }
        for column in 1..=TORQUE {
            row[column] = read[from..to].iter().map(|row| row[column]).sum::<f64>() / (to - from) as f64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DrawnUnit, MotionPlan, Sensors, Sizes, catalogue_drive, parse, synthesize};
    use super::*;
    use crate::measurement::{ColumnMap, Gear, parse as read};

    fn recording(effect: &str) -> crate::measurement::Recording {
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
        read("data.csv", text.as_bytes(), &ColumnMap::default(), &Gear::of_teeth(188, 190, true)).unwrap()
    }

    #[test]
    fn a_zero_that_drifts_over_the_breaks_is_no_other_zero_in_each_session() {
        let faults = recording("drift:arcsec_per_hour=3000").faults;
        let drift = faults.iter().find(|fault| fault.name == FaultName::Drift).expect("a drift");
        let rate = drift.measures.arcsec_per_hour.unwrap();
        assert!((rate / 3000.0 - 1.0).abs() < 0.03, "{rate}");
        assert!(faults.iter().all(|fault| fault.name != FaultName::PositionJump));
    }

    #[test]
    fn each_fault_is_found_by_its_name_in_what_is_read_back() {
        for (effect, name) in [
            ("encoder_index_jump:size_arcsec=200", FaultName::EncoderIndexJump),
            ("frozen_channel:channel=output,duration_s=3", FaultName::FrozenChannel),
            ("missing_samples", FaultName::MissingSamples),
            ("clock_error", FaultName::ClockError),
            ("outliers", FaultName::Outliers),
            ("unit_mismatch", FaultName::UnitMismatch),
            ("quantisation", FaultName::Quantisation),
            ("drift:arcsec_per_hour=300", FaultName::Drift),
            ("read_jitter:jitter_ms=2", FaultName::ReadJitter),
            ("stalls", FaultName::Stalls),
            ("counter_restart", FaultName::CounterRestart),
            ("position_jump", FaultName::PositionJump),
        ] {
            let found: Vec<FaultName> = recording(effect).faults.iter().map(|fault| fault.name).collect();
            assert!(found.contains(&name), "{effect}: {found:?}");
        }
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
