//! Fields that vary, and the variants made of their values.

use std::str::FromStr;

use fastrand::Rng;
use thiserror::Error;

/// Values of a range where their number is not given.
const USUAL_VALUES: usize = 5;
/// Values of a range, at most.
const MOST_VALUES: usize = 1000;

/// A field of a file and the values it takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Vary {
    /// Path of the field, such as `flexspline.rim_thickness_mm`.
    pub path: String,
    /// Its values on a grid, as a drive file would have them; both ends of a range are among them.
    pub values: Vec<String>,
    /// The ends of a range.
    range: Option<[f64; 2]>,
}

/// A `PATH=VALUES` that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "--vary: found {found:?}, {what}; allowed: PATH=FROM..TO, PATH=FROM..TO:N (N values, 1 to {MOST_VALUES}) or \
     PATH=VALUE,VALUE,…"
)]
pub struct VaryError {
    found: String,
    what: &'static str,
}

impl FromStr for Vary {
    type Err = VaryError;

    fn from_str(text: &str) -> Result<Vary, VaryError> {
        let wrong = |what| VaryError { found: text.to_owned(), what };
        let (path, values) = text.split_once('=').ok_or_else(|| wrong("which has no ="))?;
        let path = path.trim();
        if path.is_empty() {
            return Err(wrong("which names no field"));
        }
        let Some((from, rest)) = values.split_once("..") else {
            let list = apart(values);
            if list.iter().any(String::is_empty) {
                return Err(wrong("which has an empty value"));
            }
            return Ok(Vary { path: path.to_owned(), values: list, range: None });
        };
        let (to, count) = rest.split_once(':').map_or((rest, Ok(USUAL_VALUES)), |(to, n)| (to, n.trim().parse()));
        let number = |end: &str| end.trim().parse::<f64>().ok().filter(|end| end.is_finite());
        // A third point would be one of the number.
        let (Some(from), Some(to), false) = (number(from), number(to), rest.starts_with('.')) else {
            return Err(wrong("whose ends are not two numbers"));
        };
        let count = count.ok().filter(|count| (1..=MOST_VALUES).contains(count));
        let count = count.ok_or_else(|| wrong("whose number of values is not allowed"))?;
        let at = |k: usize| from + (to - from) * k as f64 / (count - 1).max(1) as f64;
        let values = (0..count).map(|k| written(at(k))).collect();
        Ok(Vary { path: path.to_owned(), values, range: Some([from, to]) })
    }
}

/// Splits at the commas outside brackets.
fn apart(values: &str) -> Vec<String> {
    let (mut found, mut depth) = (vec![String::new()], 0_usize);
    for letter in values.chars() {
        depth = match letter {
            '[' => depth + 1,
            ']' => depth.saturating_sub(1),
            _ => depth,
        };
        match found.last_mut() {
            Some(last) if letter != ',' || depth > 0 => last.push(letter),
            _ => found.push(String::new()),
        }
    }
    found.iter().map(|value| value.trim().to_owned()).collect()
}

/// Whether a field of the drive is a manufacturing error, which nobody chooses.
pub fn is_error_of_making(path: &str) -> bool {
    path.starts_with("as_built.")
}

impl Vary {
    /// A value that it takes more than once; numbers are compared as numbers.
    pub(super) fn repeated(&self) -> Option<&String> {
        let same = |a: &String, b: &String| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => a == b,
            _ => a == b,
        };
        let is_again = |k: &usize| self.values[..*k].iter().any(|other| same(other, &self.values[*k]));
        (1..self.values.len()).find(is_again).map(|k| &self.values[k])
    }

    /// Its value at a place of 0 (first) to 1 (excluded).
    fn at(&self, place: f64) -> String {
        match self.range {
            Some([from, to]) => written(from + (to - from) * place),
            None => self.values[((place * self.values.len() as f64) as usize).min(self.values.len() - 1)].clone(),
        }
    }
}

/// A number as a drive file has it, to nine digits: whole numbers without a point, so that fields of whole numbers take
/// them.
fn written(value: f64) -> String {
    let rounded: f64 = format!("{value:.8e}").parse().unwrap_or(value);
    format!("{rounded}")
}

/// Every combination of the values of all fields; the last field changes fastest.
pub(super) fn grid(vary: &[Vary]) -> Vec<Vec<String>> {
    vary.iter().fold(vec![Vec::new()], |variants, field| {
        let with = |variant: &Vec<String>| {
            field.values.iter().map(|value| variant.iter().chain([value]).cloned().collect()).collect::<Vec<_>>()
        };
        variants.iter().flat_map(with).collect()
    })
}

/// `count` variants that fill all ranges at once, a Latin hypercube.
pub(crate) fn filling(vary: &[Vary], count: usize, seed: u64) -> Vec<Vec<String>> {
    let points = latin(count, vary.len(), &mut Rng::with_seed(seed));
    points.iter().map(|point| vary.iter().zip(point).map(|(field, place)| field.at(*place)).collect()).collect()
}

/// `count` points of a Latin hypercube in the open unit cube: each of `count` equal parts of every axis holds one.
pub(crate) fn latin(count: usize, axes: usize, random: &mut Rng) -> Vec<Vec<f64>> {
    let mut points = vec![Vec::with_capacity(axes); count];
    for _ in 0..axes {
        let mut parts: Vec<usize> = (0..count).collect();
        random.shuffle(&mut parts);
        for (point, part) in points.iter_mut().zip(parts) {
            point.push((part as f64 + random.f64().max(f64::MIN_POSITIVE)) / count as f64);
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Vary {
        text.parse().unwrap()
    }

    #[test]
    fn ranges_and_lists_are_read_as_they_are_written() {
        assert_eq!(read("generator.w0_mm=0.4..0.5:3").values, ["0.4", "0.45", "0.5"]);
        assert_eq!(read("flexspline.teeth=180..220:3").values, ["180", "200", "220"]);
        assert_eq!(read("sleeve.kind=cup, hat").values, ["cup", "hat"]);
        assert_eq!(read("a.b=1..2").values.len(), USUAL_VALUES);
        assert_eq!(read("a.b=-1..-2:1").values, ["-1"]);
        assert_eq!(read("a.b=1e-3..2e-3:2").values, ["0.001", "0.002"]);
    }

    #[test]
    fn what_cannot_be_read_says_what_is_allowed() {
        for text in [
            "a.b",
            "=1..2",
            "a.b=1..x",
            "a.b=1..2:0",
            "a.b=1..2:2000",
            "a.b=1..2:1.5",
            "a.b=1,,2",
            "a.b=",
            "a.b=1..inf",
            "a.b=1...2",
        ] {
            let error = text.parse::<Vary>().unwrap_err().to_string();
            assert!(error.contains(text) && error.contains("allowed: PATH=FROM..TO"), "{error}");
        }
    }

    #[test]
    fn a_value_that_comes_twice_is_found_however_it_is_written() {
        let repeated = |text: &str| read(text).repeated().cloned();
        assert_eq!(repeated("a=1..1").as_deref(), Some("1"));
        assert_eq!(repeated("a=1,2,1.0").as_deref(), Some("1.0"));
        assert_eq!(repeated("a=cup,hat,cup").as_deref(), Some("cup"));
        assert_eq!((repeated("a=1..1:1"), repeated("a=1..1:2").as_deref()), (None, Some("1")));
        assert_eq!((repeated("a=1..2:9"), repeated("a=1,10"), repeated("a=cup")), (None, None, None));
    }

    #[test]
    fn a_grid_has_every_combination_once() {
        let variants = grid(&[read("a=1..2:2"), read("b=x,y,z")]);
        assert_eq!(variants.len(), 6);
        assert_eq!(variants[0], ["1", "x"]);
        assert_eq!(variants[1], ["1", "y"]);
        assert_eq!(variants[5], ["2", "z"]);
    }

    /// Sixteen points of a Latin hypercube have one in each sixteenth of every range.
    #[test]
    fn drawn_variants_fill_every_range_evenly() {
        let vary = [read("a=0..16"), read("b=0..16"), read("c=p,q")];
        let variants = filling(&vary, 16, 1);
        for field in 0..2 {
            let mut cells: Vec<usize> = variants.iter().map(|v| v[field].parse::<f64>().unwrap() as usize).collect();
            cells.sort_unstable();
            assert_eq!(cells, (0..16).collect::<Vec<_>>());
        }
        assert_eq!(variants.iter().filter(|v| v[2] == "p").count(), 8);
        assert_eq!(filling(&vary, 16, 1), variants);
        assert_ne!(filling(&vary, 16, 2), variants);
    }
}
