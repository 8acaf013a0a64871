//! Where the generator goes: the built-in paths, and paths from a CSV file.

use std::fmt;
use std::ops::RangeInclusive;

use thiserror::Error;

use flexspline_base::csv_rows::rows;
use flexspline_base::suggest::{likeliest, question};

/// Largest generator angle of a path, rad: 1600 turns, far beyond what a quasi-static run is for.
const LARGEST_ANGLE_RAD: f64 = 1e4;
/// Largest torque of a path, N m: beyond it no drive of this kind is in one piece.
pub(super) const LARGEST_TORQUE_N_M: f64 = 1e5;

/// A generator path.
#[derive(Debug, Clone, PartialEq)]
pub enum Path {
    /// The protocol of the paper: deform, +1 rad, −2 rad.
    Paper,
    /// One flexspline tooth pitch of a settled drive.
    Pitch,
    /// One generator turn of a settled drive.
    Turn,
    /// Point by point. The drive is deformed where the first point is.
    Points(Vec<PathPoint>),
}

impl Path {
    /// The built-in path of that name.
    pub fn built_in(name: &str) -> Option<Path> {
        match name {
            "paper" => Some(Path::Paper),
            "pitch" => Some(Path::Pitch),
            "turn" => Some(Path::Turn),
            _ => None,
        }
    }
}

impl fmt::Display for Path {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Path::Paper => "paper",
            Path::Pitch => "pitch",
            Path::Turn => "turn",
            Path::Points(_) => "points",
        })
    }
}

/// A point of a path; what it leaves open is as in the settings of the run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PathPoint {
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Load torque, N m.
    pub torque_n_m: Option<f64>,
    /// Temperature, °C.
    pub temperature_c: Option<f64>,
}

/// A path file that is refused. Its text is one line per problem.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}", .problems.join("\n"))]
pub struct PathError {
    /// Every problem found: place, value found and what is allowed; never empty.
    pub problems: Vec<String>,
}

/// Problems reported of one file before the rest is only counted.
const REPORTED: usize = 10;

/// Columns of a path file.
const COLUMNS: [&str; 3] = ["generator_rad", "torque_n_m", "temperature_c"];

/// Reads a path: CSV with a header, `generator_rad` and, if wanted, `torque_n_m` and `temperature_c`, in any order.
/// Lines that begin with `#` are comments. Other columns are ignored, so that a `results.csv` is a path too, unless
/// their name is nearly one of the three. `temperatures_c` are those that the drive is made for.
pub fn read_path(
    file_name: &str,
    text: &str,
    temperatures_c: RangeInclusive<f64>,
) -> Result<Vec<PathPoint>, PathError> {
    let allowed = [-LARGEST_ANGLE_RAD..=LARGEST_ANGLE_RAD, -LARGEST_TORQUE_N_M..=LARGEST_TORQUE_N_M, temperatures_c];
    let mut lines = rows(text);
    let (header_line, names) = lines.next().unwrap_or((1, vec![""]));
    let columns = find_columns(&names)
        .map_err(|what| PathError { problems: vec![format!("{file_name}:{header_line}: {what}")] })?;

    let mut points = Vec::new();
    let mut problems = Vec::new();
    for (number, row) in lines {
        let place = format!("{file_name}:{number}");
        if row.len() != names.len() {
            let (found, allowed) = (row.len(), names.len());
            problems.push(format!("{place}: found {found} fields, allowed: {allowed}, as in the header"));
            continue;
        }
        let mut values = [None; 3];
        for (k, name) in COLUMNS.iter().enumerate() {
            let Some(cell) = columns[k].map(|column| row[column]) else {
                continue;
            };
            match cell.parse::<f64>() {
                Ok(number) if allowed[k].contains(&number) => values[k] = Some(number),
                _ => problems.push(format!(
                    "{place}: {name}: found {cell:?}, allowed: a number from {} to {}",
                    allowed[k].start(),
                    allowed[k].end()
                )),
            }
        }
        if let [Some(generator_rad), torque_n_m, temperature_c] = values {
            points.push(PathPoint { generator_rad, torque_n_m, temperature_c });
        }
    }
    if problems.len() > REPORTED {
        let more = problems.len() - REPORTED;
        problems.truncate(REPORTED);
        problems.push(format!("{file_name}: and {more} more"));
    }
    if problems.is_empty() && points.is_empty() {
        problems.push(format!("{file_name}: no rows after the header; a path needs at least one"));
    }
    if problems.is_empty() { Ok(points) } else { Err(PathError { problems }) }
}

/// Position of each column of [`COLUMNS`], or what is wrong with the header.
fn find_columns(header: &[&str]) -> Result<[Option<usize>; 3], String> {
    let mut found = [None; 3];
    for (position, name) in header.iter().enumerate() {
        if let Some(known) = COLUMNS.iter().position(|known| known == name)
            && found[known].replace(position).is_some()
        {
            return Err(format!("column {name} is there twice"));
        }
    }
    // A column that was meant but misspelt would silently not act.
    for (known, _) in COLUMNS.iter().zip(found).filter(|(_, found)| found.is_none()) {
        let spare = header.iter().copied().filter(|name| !COLUMNS.contains(name));
        if let Some(name) = likeliest(known, spare) {
            return Err(format!("found column {name:?}; {}", question(known)));
        }
    }
    if found[0].is_none() {
        let names = header.join(", ");
        return Err(format!(
            "found columns {names:?}, required: generator_rad; allowed too: torque_n_m, temperature_c"
        ));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str, text: &str) -> Result<Vec<PathPoint>, PathError> {
        read_path(name, text, -60.0..=80.0)
    }

    #[test]
    fn columns_come_in_any_order_with_comments_between() {
        let text = "\u{feff}# warm, loaded\ntemperature_c, other ,generator_rad,torque_n_m\n20, x, 0.0, 5\n# \
                    on\n60,y,-0.5,-5e0\n";
        let points = read("p.csv", text).unwrap();
        let point = |generator_rad, torque, temperature| PathPoint {
            generator_rad,
            torque_n_m: Some(torque),
            temperature_c: Some(temperature),
        };
        assert_eq!(points, [point(0.0, 5.0, 20.0), point(-0.5, -5.0, 60.0)]);
        let bare = read("p.csv", "generator_rad\n1\n").unwrap();
        assert_eq!(bare, [PathPoint { generator_rad: 1.0, ..Default::default() }]);
    }

    #[test]
    fn every_wrong_file_gets_its_own_message() {
        let cases = [
            ("", "p.csv:1: found columns \"\", required: generator_rad"),
            ("generator_rad\n", "p.csv: no rows after the header"),
            ("angle,torque_n_m\n0,0\n", "p.csv:1: found columns \"angle, torque_n_m\", required: generator_rad"),
            ("generator_deg\n0\n", "p.csv:1: found column \"generator_deg\"; did you mean `generator_rad`?"),
            ("generator_rad,torque\n0,0\n", "p.csv:1: found column \"torque\"; did you mean `torque_n_m`?"),
            ("generator_rad,torque_nm\n0,0\n", "p.csv:1: found column \"torque_nm\"; did you mean `torque_n_m`?"),
            ("generator_rad,generator_rad\n0,0\n", "p.csv:1: column generator_rad is there twice"),
            (
                "generator_rad\n0\n# x\nNaN\n",
                "p.csv:4: generator_rad: found \"NaN\", allowed: a number from -10000 to 10000",
            ),
            ("generator_rad\n0\n1e9\n", "p.csv:3: generator_rad: found \"1e9\", allowed"),
            ("generator_rad,torque_n_m\n0,inf\n", "p.csv:2: torque_n_m: found \"inf\", allowed"),
            ("generator_rad,torque_n_m\n0,\n", "p.csv:2: torque_n_m: found \"\", allowed"),
            ("generator_rad,torque_n_m\n0,1\n0.1\n", "p.csv:3: found 1 fields, allowed: 2"),
            (
                "generator_rad,temperature_c\n0,81\n",
                "p.csv:2: temperature_c: found \"81\", allowed: a number from -60 to 80",
            ),
            ("generator_rad\n0,01\n", "p.csv:2: found 2 fields, allowed: 1"),
        ];
        for (text, start) in cases {
            let message = read("p.csv", text).unwrap_err().to_string();
            assert!(message.starts_with(start), "{text:?} gave {message}");
        }
    }

    #[test]
    fn all_problems_come_at_once_and_many_are_counted() {
        let text = "generator_rad,torque_n_m\na,b\n0,c\n";
        assert_eq!(read("p.csv", text).unwrap_err().problems.len(), 3);
        let text = format!("generator_rad\n{}", "x\n".repeat(50));
        let problems = read("p.csv", &text).unwrap_err().problems;
        assert_eq!((problems.len(), problems[10].as_str()), (11, "p.csv: and 40 more"));
    }
}
