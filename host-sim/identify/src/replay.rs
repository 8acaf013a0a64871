//! The core run over measured rows, open loop: what it would have predicted, row by row.
//!
//! The rows are read and checked as those of a calibration ([`crate::known_rows`]), and whatever was converted or left
//! out is reported. Without a torque the table is read at 0 N·m.

use flexspline::{GeneratorAngle, PlayState, Prediction, Quality, Table};
use serde::Serialize;

use crate::calibrate::{CalibrationFile, INSIDE, MOST_ERROR_RAD, OF_95, WindUpTorque, check_ratio_of, on_zero_of};
use crate::extension::{left_by_core, less, without_zero};
use crate::known_rows::parse_known;
use crate::measurement::{
    ColumnMap, Fault, FaultName, MeasuredError, Quantity, Recording, Session, Treatment, quantile_of, white_noise,
};
use crate::misfit::{LEAVES, about_mean, explained};
use crate::nominal::Nominal;
use crate::wind_up::along;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::tables::was_recorded;

/// A measured row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredRow {
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Output error, arcsec.
    pub error_arcsec: f64,
    /// Load torque, N m.
    pub torque_n_m: f64,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Rows without a gap have the same: of each the output has a zero of its own.
    pub session: usize,
}

/// A row of `replay.csv`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ReplayedRow {
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Load torque, N m.
    pub torque_n_m: f64,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Output error as measured, arcsec.
    pub measured_arcsec: f64,
    /// Output error as the core predicts it, arcsec.
    pub predicted_arcsec: f64,
    /// Measured less predicted, arcsec.
    pub residual_arcsec: f64,
    /// Uncertainty, arcsec: what the core states of the flank, and the half width of the calibration, if there was one.
    pub uncertainty_arcsec: f64,
    /// Quality of the prediction.
    pub quality: &'static str,
    /// Torque that the wind-up says, with its least and its most, N m, infinite beyond the loads of the table; of rows
    /// without a torque against their mean.
    pub torque_from_wind_up_n_m: f64,
    /// See above.
    pub torque_from_wind_up_low_n_m: f64,
    /// See above.
    pub torque_from_wind_up_high_n_m: f64,
}

/// `summary.json` of a replay.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ReplaySummary {
    /// Version of this object.
    pub schema_version: u32,
    /// "in range", or "extrapolated" if any row lies outside the table, or where it was not recorded.
    pub status: &'static str,
    /// Table.
    pub table_id: String,
    /// Rows.
    pub rows: usize,
    /// Root mean square of the measured error about its mean, arcsec.
    pub rms_measured_arcsec: f64,
    /// Root mean square of the residual about its mean, arcsec.
    pub rms_residual_arcsec: f64,
    /// Largest residual about the mean, arcsec.
    pub max_residual_arcsec: f64,
    /// Mean residual: the zero of the output encoder, which no table can know, arcsec.
    pub mean_residual_arcsec: f64,
    /// Rows by quality: in range, uncertain, extrapolated, disabled.
    pub rows_by_quality: [usize; 4],
    /// The load at which torques from the wind-up are zero: `no load`, or, of rows without a torque, `mean row`.
    pub torque_counts_from: &'static str,
    /// Residual of the table with the torque's sign turned, arcsec rms, where the rows show that it is.
    pub torque_turned_rms_arcsec: Option<f64>,
    /// Why the table gains less than it could, or nothing.
    pub remarks: Vec<String>,
    /// Faults of the log.
    pub data_faults: Vec<Fault>,
    /// Notes on it.
    pub notes: Vec<String>,
    /// Command line, once known.
    pub command: String,
}

/// Names of the [`flexspline::Quality`] of a prediction, in its order.
const QUALITIES: [&str; 4] = ["in range", "uncertain", "extrapolated", "disabled"];

/// Of rows where a table was not recorded.
const ELSEWHERE: &str = "are where the table was not recorded over the output's turn, or within 10 deg of that: its \
                         error there, and torques from the wind-up, are not known";

impl ReplaySummary {
    /// Remarks where the table gains less than it could, or nothing: each explanation that the rows allow.
    fn of_gain(&self, mut why: Vec<String>) -> Vec<String> {
        let (measured, left) = (self.rms_measured_arcsec, self.rms_residual_arcsec);
        why.extend(self.torque_turned_rms_arcsec.map(|turned| {
            format!(
                "the torque has the wrong sign: with the other one the residual is {turned:.1} arcsec rms; positive is \
                 what turns the output forward: --columns torque=NAME:-N.m"
            )
        }));
        let mut nothing = "";
        if left > measured {
            nothing = ": the table is worse than none here";
            if why.is_empty() {
                let unexplained = "no sign of the torque explains that; is it the table of this unit, with the \
                                   generator zero of these rows?";
                why.push(unexplained.to_owned());
            }
        }
        let several = if why.len() > 1 { "these rows allow several reasons: " } else { "" };
        let says = |why: String| {
            format!(
                "the residual with the table is {left:.1} arcsec rms, {measured:.1} without it{nothing}; {several}{why}"
            )
        };
        (!why.is_empty()).then(|| says(why.join("; or "))).into_iter().collect()
    }
}

/// Rows of a log, with what was found in it.
#[derive(Debug, Clone, PartialEq)]
pub struct RowsRead {
    /// The rows, what was converted as it is meant.
    pub rows: Vec<MeasuredRow>,
    /// Faults of the log.
    pub faults: Vec<Fault>,
    /// Notes.
    pub notes: Vec<String>,
}

/// Reads measured rows of the drive of a table; `temperature_c` stands where the file has no such column. With
/// `on_zero` a generator that started at another zero is put on that of the table: not where something is judged that
/// is played without a zero of its own.
///
/// # Errors
/// They cannot be read, their torque is in another unit, or they are of another ratio.
pub fn read(
    file: &str,
    bytes: impl Into<Vec<u8>>,
    columns: &ColumnMap,
    table: &Table<'_>,
    temperature_c: f64,
    on_zero: bool,
) -> Result<RowsRead, MeasuredError> {
    let nominal = Nominal::of_table(table);
    let recording = parse_known(file, bytes, columns, &nominal, Some(table))?;
    let on_one = |recording| on_own_zeros(table, on_zero_of(table, recording), temperature_c);
    let mut read = rows_of(if on_zero { on_one(recording) } else { recording }, nominal.ratio, temperature_c)?;
    let elsewhere = read.rows.iter().filter(|row| !was_recorded(table, row.generator_rad)).count();
    read.notes.extend((elsewhere > 0).then(|| format!("{elsewhere} rows {ELSEWHERE}")));
    Ok(read)
}

/// A log of which sessions have zeros of their own, with what a table leaves in each about its zero.
pub(crate) fn on_own_zeros(table: &Table<'_>, mut log: Recording, temperature_c: f64) -> Recording {
    let own: Vec<bool> = log.sessions.iter().map(|session| session.own_zero).collect();
    if own.iter().skip(1).any(|own| *own) {
        let left: Vec<Vec<f64>> =
            log.sessions.iter().map(|session| left_by_core(table, session, temperature_c)).collect();
        let about_zero = without_zero(left.clone(), &vec![false; own.len()], &own);
        let zeros = left.iter().zip(&about_zero).map(|(left, about)| vec![left[0] - about[0]; left.len()]);
        less(&mut log.sessions, zeros.collect::<Vec<Vec<f64>>>().iter());
    }
    log
}

/// The rows of a recording, if a table can be played over them.
fn rows_of(mut recording: Recording, ratio: f64, temperature_c: f64) -> Result<RowsRead, MeasuredError> {
    let other_unit = (FaultName::UnitMismatch, Some(Quantity::Torque), Treatment::Masked);
    let is_in_it = |fault: &&Fault| (fault.name, fault.channel, fault.treatment) == other_unit;
    // Without its torque the table would be read where the drive never was.
    if let Some(fault) = recording.faults.iter().find(is_in_it) {
        let (file, line) = (recording.file.clone(), Some(fault.first_line));
        return Err(MeasuredError { file, line, what: fault.what.clone() });
    }
    let said = check_ratio_of(&recording, ratio, MOST_ERROR_RAD)?;
    recording.notes.extend(said);
    if recording.sessions.iter().all(|session| session.torque_n_m.is_none()) {
        let what =
            "no torque: the table is read at 0 N·m, and the torque from the wind-up counts from that of the mean row";
        recording.notes.push(what.to_owned());
    }
    let rows = measured_rows(&recording.sessions, temperature_c).collect();
    Ok(RowsRead { rows, faults: recording.faults, notes: recording.notes })
}

/// The rows of sessions; `temperature_c` stands where none was recorded.
pub(crate) fn measured_rows<'a>(
    sessions: impl IntoIterator<Item = &'a Session>,
    temperature_c: f64,
) -> impl Iterator<Item = MeasuredRow> {
    sessions.into_iter().enumerate().flat_map(move |(number, session)| {
        let measured = session.states(temperature_c).zip(&session.error_rad);
        measured.map(move |([generator_rad, torque_n_m, temperature_c], error)| MeasuredRow {
            generator_rad,
            error_arcsec: error * ARCSEC_PER_RAD,
            torque_n_m,
            temperature_c,
            session: number,
        })
    })
}

/// The core over rows of generator angle (rad), torque (N·m) and temperature (°C), from a state it does not know.
pub(crate) fn by_core(table: &Table<'_>, rows: impl Iterator<Item = [f64; 3]>) -> impl Iterator<Item = Prediction> {
    let mut play = PlayState::unknown();
    rows.map(move |[generator_rad, torque_n_m, temperature_c]| {
        // The reader bounds the angle, far inside the range of the angle type.
        let generator = GeneratorAngle::from_rad(generator_rad).unwrap_or(GeneratorAngle::ZERO);
        table.forward(&mut play, generator, torque_n_m as f32, temperature_c as f32)
    })
}

/// Why a table leaves much of rows, but for the torque's sign: what `explained` found, or what its calibration knows.
fn reasons([other_load, delay]: [Option<f64>; 2], calibrated: &CalibrationFile, left_arcsec: f64) -> Vec<String> {
    let delay = delay.map(|without| {
        format!(
            "`calibrate` took a delay between the two angles out of its rows, which these still have: without what \
             goes with the speed the residual is {without:.1} arcsec rms"
        )
    });
    let other_load = other_load.map(|without| {
        format!(
            "the load follows the angle of the output here, and another stiffness and output wave would reduce the \
             residual to {without:.1} arcsec rms: the rows may be of another posture or payload than those of the \
             table; calibrate on both together"
        )
    });
    let (as_recorded, anywhere) = (calibrated.half_width_as_recorded_arcsec, calibrated.half_width_arcsec);
    let one_load = calibrated.load_with_output_angle.filter(|_| left_arcsec > as_recorded).map(|correlation| {
        format!(
            "the table was calibrated on a load that goes with the angle of the output (correlation \
             {correlation:.2}), and under other loads, or none, it is off by ±{anywhere:.0} arcsec; calibrate on both \
             together"
        )
    });
    delay.into_iter().chain(other_load.or(one_load)).collect()
}

/// Where loads that the table does not hold leave much of rows: how many these are, and what is left without them.
fn beyond_loads(table: &Table<'_>, rows: &[MeasuredRow], residuals: &[f64]) -> Option<String> {
    let [low, high] = table.torque_range_n_m().map(f64::from);
    let holds = |(row, residual): (&MeasuredRow, &f64)| (low..=high).contains(&row.torque_n_m).then_some(*residual);
    let held: Vec<f64> = rows.iter().zip(residuals).filter_map(holds).collect();
    let left = about_mean(&held);
    let rest =
        if held.is_empty() { String::new() } else { format!("without them the residual is {left:.1} arcsec rms; ") };
    (left < LEAVES * about_mean(residuals)).then(|| {
        format!(
            "{} of {} rows are at loads that the table does not hold, {low:.2} to {high:.2} N·m; {rest}calibrate on \
             both together",
            rows.len() - held.len(),
            rows.len()
        )
    })
}

/// Runs the core over the rows, from a state it does not know. `calibrated` is what the calibration of the table says,
/// if there was one.
pub fn replay(
    table: &Table<'_>,
    rows: &[MeasuredRow],
    calibrated: Option<CalibrationFile>,
) -> (Vec<ReplayedRow>, ReplaySummary) {
    let calibrated = calibrated.unwrap_or_default();
    let mut by_quality = [0; 4];
    let states = rows.iter().map(|row| [row.generator_rad, row.torque_n_m, row.temperature_c]);
    let mut said: Vec<Prediction> = by_core(table, states).collect();
    for (said, _) in said.iter_mut().zip(rows).filter(|(_, row)| !was_recorded(table, row.generator_rad)) {
        said.quality = said.quality.max(Quality::Extrapolated);
    }
    let predicted = said.iter().map(|said| f64::from(said.transmission_error_rad) * ARCSEC_PER_RAD);
    let measured: Vec<f64> = rows.iter().map(|row| row.error_arcsec).collect();
    let residuals: Vec<f64> =
        measured.iter().zip(predicted).map(|(measured, predicted)| measured - predicted).collect();
    let mean_residual_arcsec = residuals.iter().sum::<f64>() / residuals.len().max(1) as f64;
    let off: Vec<f64> = residuals.iter().map(|residual| (residual - mean_residual_arcsec).abs()).collect();
    let [torque_turned_rms_arcsec, found @ ..] = explained(table, rows, calibrated.has_delay());
    let rms_residual_arcsec = about_mean(&residuals);
    let reasons = beyond_loads(table, rows, &residuals)
        .map_or_else(|| reasons(found, &calibrated, rms_residual_arcsec), |beyond| vec![beyond]);
    let torques = torques_read(table, rows, &off, calibrated.torque_from_wind_up);
    let replayed =
        rows.iter().zip(&said).zip(residuals.iter().zip(torques)).map(|((row, said), (residual, torque))| {
            by_quality[said.quality as usize] += 1;
            ReplayedRow {
                generator_rad: row.generator_rad,
                torque_n_m: row.torque_n_m,
                temperature_c: row.temperature_c,
                measured_arcsec: row.error_arcsec,
                predicted_arcsec: f64::from(said.transmission_error_rad) * ARCSEC_PER_RAD,
                residual_arcsec: *residual,
                uncertainty_arcsec: f64::from(said.uncertainty_rad) * ARCSEC_PER_RAD + calibrated.half_width_arcsec,
                quality: QUALITIES[said.quality as usize],
                torque_from_wind_up_n_m: torque[0],
                torque_from_wind_up_low_n_m: torque[1],
                torque_from_wind_up_high_n_m: torque[2],
            }
        });
    let replayed: Vec<ReplayedRow> = replayed.collect();
    let mut summary = ReplaySummary {
        schema_version: 1,
        status: if by_quality[2] + by_quality[3] == 0 { "in range" } else { "extrapolated" },
        table_id: table.id().to_string(),
        rows: replayed.len(),
        rms_measured_arcsec: about_mean(&measured),
        rms_residual_arcsec,
        max_residual_arcsec: off.iter().copied().fold(0.0, f64::max),
        mean_residual_arcsec,
        rows_by_quality: by_quality,
        torque_counts_from: if has_torque(rows) { "no load" } else { "mean row" },
        torque_turned_rms_arcsec,
        ..ReplaySummary::default()
    };
    summary.remarks = summary.of_gain(reasons);
    (replayed, summary)
}

/// Whether rows have a torque; without one torques from the wind-up count from that of the mean row.
pub(crate) fn has_torque(rows: &[MeasuredRow]) -> bool {
    rows.iter().any(|row| row.torque_n_m != 0.0)
}

/// Torques that the wind-up says, each with its least and its most. The intervals are of what the calibration left, or
/// of the noise of the rows if that is more. Without a calibration they are of what the table leaves of the rows;
/// without a torque, of the noise of the rows and of what the table leaves of its samples.
fn torques_read(
    table: &Table<'_>,
    rows: &[MeasuredRow],
    off_arcsec: &[f64],
    calibrated: Option<WindUpTorque>,
) -> Vec<[f64; 3]> {
    let errors: Vec<f64> = rows.iter().map(|row| row.error_arcsec).collect();
    let noise_arcsec = white_noise([&errors[..]]);
    let half_width_arcsec = if let Some(calibrated) = &calibrated {
        calibrated.half_width_arcsec.max(OF_95 * noise_arcsec)
    } else if has_torque(rows) {
        quantile_of(&mut off_arcsec.to_vec(), INSIDE)
    } else {
        OF_95 * noise_arcsec.hypot(f64::from(table.projection_rms_rad()) * ARCSEC_PER_RAD)
    };
    let hysteresis = calibrated.and_then(|calibrated| calibrated.hysteresis).unwrap_or_default();
    along(table, rows, &hysteresis, |curve, row, error_rad| {
        let half_rad = half_width_arcsec / ARCSEC_PER_RAD;
        let [of_row @ .., _] = curve.next([row.generator_rad, error_rad, row.temperature_c, half_rad, f64::NAN]);
        of_row
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_rows::FEW;
    use crate::measurement::{Gear, parse_at_least};

    /// Rows by the ratio alone, with this project's own columns.
    fn parse(file: &str, bytes: &[u8], ratio: f64, temperature_c: f64) -> Result<Vec<MeasuredRow>, MeasuredError> {
        let recording = parse_at_least(FEW, file, bytes, &ColumnMap::default(), &Gear::of_ratio(ratio))?;
        rows_of(recording, ratio, temperature_c).map(|read| read.rows)
    }

    #[test]
    fn error_and_output_columns_say_the_same() {
        let by_error = parse("a.csv", b"error_arcsec,generator_rad\n12.5,0.5\n9,0.6\n", 95.0, 20.0).unwrap();
        let output = 0.5 / 95.0 + 12.5 / ARCSEC_PER_RAD;
        let next = 0.6 / 95.0 + 9.0 / ARCSEC_PER_RAD;
        let text = format!("generator_rad,output_rad,torque_n_m\n0.5,{output},3\n0.6,{next},3\n");
        let by_output = parse("b.csv", text.as_bytes(), 95.0, 20.0).unwrap();
        assert!((by_error[0].error_arcsec - by_output[0].error_arcsec).abs() < 1e-9);
        assert_eq!((by_output[0].torque_n_m, by_output[0].temperature_c), (3.0, 20.0));
    }

    /// Three turns of a drive of ratio 95 whose columns are wrong.
    #[test]
    fn an_output_that_does_not_turn_with_the_generator_is_refused() {
        let read = |output: fn(f64, f64) -> f64| {
            let row = |k: u32| {
                let generator = 0.1 * f64::from(k);
                format!("{generator},{}\n", output(generator, generator / 95.0 + 1e-3 * generator.sin()))
            };
            let rows: String = (0..190).map(row).collect();
            parse("m.csv", format!("generator_rad,output_rad\n{rows}").as_bytes(), 95.0, 20.0)
        };
        assert_eq!(read(|_, output| output).unwrap().len(), 190);
        for (output, said) in [
            ((|_, output| -output) as fn(f64, f64) -> f64, "--columns output=output_rad:-rad"),
            (|_, output| output.to_degrees(), "--columns output=output_rad:deg"),
        ] {
            let refused = read(output).unwrap_err().to_string();
            assert!(refused.contains(said), "{refused}");
        }
        for (ratio, said) in [(61.0, "asks for 0.010526"), (101.0, "found 95, but the generator turns 101.0")] {
            let row = |k: u32| format!("{},{}\n", 0.7 * f64::from(k), 0.7 * f64::from(k) / ratio);
            let rows: String = (0..190).map(row).collect();
            let text = format!("generator_rad,output_rad\n{rows}");
            let refused = parse("m.csv", text.as_bytes(), 95.0, 20.0).unwrap_err().to_string();
            assert!(refused.contains(said), "{refused}");
        }
    }

    /// A torque that no drive bears is refused, a value that is missing is left out.
    #[test]
    fn a_torque_in_another_unit_is_refused_and_rows_without_a_value_are_left_out() {
        let text = |torque: f64, cell: &str| {
            let row = |k: u32| {
                let psi = 0.3 * f64::from(k);
                let output = if k == 40 { cell.to_owned() } else { (psi / 95.0 + 1e-5 * psi.sin()).to_string() };
                format!("{psi},{output},{}\n", torque * (0.05 * f64::from(k)).sin())
            };
            "generator_rad,output_rad,torque_n_m\n".to_owned() + &(0..200).map(row).collect::<String>()
        };
        let refused = parse("m.csv", text(5e4, "0.126").as_bytes(), 95.0, 20.0).unwrap_err();
        assert!(refused.line == Some(2) && refused.what.contains("10000 N·m is the most"), "{refused}");
        for cell in ["", "1e400"] {
            assert_eq!(parse("m.csv", text(5.0, cell).as_bytes(), 95.0, 20.0).unwrap().len(), 199, "{cell}");
        }
    }
}
