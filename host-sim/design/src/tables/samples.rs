//! Samples of steady motion: what a table is made from, whether computed here, by another program, or measured.
//!
//! CSV with the columns `generator_rad, torque_n_m, temperature_c, direction, output_rad` in any order; further columns
//! are ignored, lines that begin with `#` are comments. `direction` is +1 while the output turns forward, −1 backward.

use std::path::Path;

use flexspline::Direction;
use flexspline_make::Sample;
use thiserror::Error;

use flexspline_base::csv_rows::{self, TableProblem};
use flexspline_base::suggest::did_you_mean;

/// The columns, in the order in which they are written.
pub const COLUMNS: [&str; 5] = ["generator_rad", "torque_n_m", "temperature_c", "direction", "output_rad"];

/// Largest sizes that a sample may have: beyond them a unit is wrong, not the drive unusual.
const LIMITS: [(&str, f64, &str); 4] = [
    ("generator_rad", 1e6, "rad"),
    ("torque_n_m", 1e5, "N·m"),
    ("temperature_c", 1e3, "°C"),
    ("output_rad", 1e6, "rad"),
];

/// A sample file that cannot be used.
#[derive(Debug, Error)]
#[error("{file}: {what}")]
pub struct SampleError {
    file: String,
    what: String,
}

/// Reads a sample file.
pub fn read(path: &Path) -> Result<Vec<Sample>, SampleError> {
    let file = path.display().to_string();
    let text = std::fs::read(path).map_err(|error| SampleError { file: file.clone(), what: error.to_string() })?;
    parse(&file, &text)
}

/// Reads samples from the bytes of a file called `file`.
pub fn parse(file: &str, text: &[u8]) -> Result<Vec<Sample>, SampleError> {
    let refused = |what: String| SampleError { file: file.to_owned(), what };
    let at = |TableProblem { line, what }| refused(format!("line {line}: {what}"));
    let text = csv_rows::text(text).map_err(at)?;
    let mut rows = csv_rows::rows(&text);
    let (line, header) = rows.next().unwrap_or((1, Vec::new()));
    let mut places = [0; 5];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        *place = place_of(name, line, &header).map_err(at)?;
    }
    let sample = |(line, row): (u64, Vec<&str>)| sample(line, &row, places).map_err(at);
    let samples = rows.map(sample).collect::<Result<Vec<Sample>, SampleError>>()?;
    if samples.is_empty() {
        return Err(refused("no samples after the header".to_owned()));
    }
    Ok(samples)
}

/// Where a column stands.
fn place_of(name: &str, line: u64, header: &[&str]) -> Result<usize, TableProblem> {
    let mut places = (0..header.len()).filter(|place| header[*place] == name);
    let what = match (places.next(), places.next()) {
        (Some(place), None) => return Ok(place),
        (Some(_), Some(_)) => format!("column {name} is there twice"),
        (None, _) => format!("column {name} is missing{}", did_you_mean("; ", name, header.iter().copied())),
    };
    Err(TableProblem { line, what: format!("{what}; needed are {}", COLUMNS.join(", ")) })
}

/// The sample in a row; the error says field, value and what is allowed.
fn sample(line: u64, row: &[&str], places: [usize; 5]) -> Result<Sample, TableProblem> {
    let wrong = |what: String| TableProblem { line, what };
    let mut numbers = [0.0_f64; 5];
    for ((number, place), name) in numbers.iter_mut().zip(places).zip(COLUMNS) {
        let Some(text) = row.get(place) else {
            return Err(wrong(format!("{} fields, but {name} is field {}", row.len(), place + 1)));
        };
        *number = text.parse().map_err(|_| wrong(format!("{name} is \"{text}\", not a number")))?;
        if !number.is_finite() {
            return Err(wrong(format!("{name} is {number}; a finite number is needed")));
        }
    }
    let [generator_rad, torque_n_m, temperature_c, direction, output_rad] = numbers;
    let direction = match direction {
        1.0 => Direction::Forward,
        -1.0 => Direction::Backward,
        other => return Err(wrong(format!("direction is {other}; allowed are 1 and -1"))),
    };
    for ((name, limit, unit), value) in LIMITS.iter().zip([generator_rad, torque_n_m, temperature_c, output_rad]) {
        if value.abs() > *limit {
            return Err(wrong(format!("{name} is {value} {unit}; at most {limit:e} {unit} is plausible")));
        }
    }
    Ok(Sample { generator_rad, torque_n_m, temperature_c, direction, output_rad })
}

/// The samples as CSV text; reading it back gives the same numbers.
pub fn to_csv(samples: &[Sample]) -> String {
    let mut text = COLUMNS.join(",");
    text.push('\n');
    for s in samples {
        let direction = s.direction.sign();
        text.push_str(&format!(
            "{},{},{},{direction},{}\n",
            s.generator_rad, s.torque_n_m, s.temperature_c, s.output_rad
        ));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Sample {
        Sample {
            generator_rad: 0.1 + 0.2,
            torque_n_m: -1.0 / 3.0,
            temperature_c: 20.0,
            direction: Direction::Backward,
            output_rad: 0.003_16,
        }
    }

    #[test]
    fn what_is_written_is_read_back_to_the_bit() {
        let samples = [sample(), Sample { direction: Direction::Forward, ..sample() }];
        assert_eq!(parse("s.csv", to_csv(&samples).as_bytes()).unwrap(), samples);
    }

    #[test]
    fn columns_may_come_in_any_order_with_others_among_them() {
        let text =
            "# from a bench\noutput_rad, note ,direction,temperature_c,torque_n_m,generator_rad\n0.01,x,1,20,5,0.95\n";
        let read = parse("s.csv", text.as_bytes()).unwrap();
        assert_eq!(read[0].generator_rad, 0.95);
        assert_eq!(read[0].output_rad, 0.01);
    }
}
