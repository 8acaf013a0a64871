//! Reading TOML files: every mistake of a file named at once, each by line, field, value found and what is allowed.
//!
//! Drives, nominal models and what a diagnosis adds to either are read by these parts: `TomlFile` keeps what is wrong
//! with a file, `Section` is a table of it, and `real`, `whole`, `one_of`, `each_of` and `Entries` read values.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;

use serde::Serialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::suggest::{did_you_mean, likeliest_path, question};

/// One thing that is wrong with a file, or with what it describes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Problem {
    /// File and line (`drive.toml:12`), or `--set`; empty for a drive made in a program. A page asks for fields.
    #[serde(skip)]
    pub place: String,
    /// Path of the field as it stands in the file, `flexspline.teeth`; empty if no field is to blame.
    pub field: String,
    /// The value found and what is allowed, or what does not fit.
    pub what: String,
}

impl Problem {
    /// A problem of `field`, its place not known yet.
    pub fn of(field: &str, what: impl Into<String>) -> Self {
        Problem { place: String::new(), field: field.to_owned(), what: what.into() }
    }
}

impl std::error::Error for Problem {}

/// Problems, one a line.
pub fn lines(problems: &[Problem]) -> String {
    problems.iter().map(Problem::to_string).collect::<Vec<_>>().join("\n")
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for part in [&self.place, &self.field] {
            if !part.is_empty() {
                write!(f, "{part}: ")?;
            }
        }
        f.write_str(&self.what)
    }
}

/// Allowed values; the lower end belongs to it unless `above`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allowed {
    /// Least.
    pub low: f64,
    /// Largest.
    pub high: f64,
    above: bool,
}

/// From `low` to `high`, both allowed.
pub const fn from(low: f64, high: f64) -> Allowed {
    Allowed { low, high, above: false }
}

/// Above `low`, to `high`.
pub const fn above(low: f64, high: f64) -> Allowed {
    Allowed { low, high, above: true }
}

impl Allowed {
    /// Why `number` is refused, if it is.
    pub fn refusal(&self, number: f64) -> Option<String> {
        // false for NaN
        let high_enough = if self.above { number > self.low } else { number >= self.low };
        let inside = high_enough && number <= self.high;
        (!inside).then(|| format!("found {number}, allowed: {self}"))
    }
}

impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let from = if self.above { "above " } else { "" };
        if self.high >= 1e6 {
            write!(f, "{from}{} to {:e}", self.low, self.high)
        } else {
            write!(f, "{from}{} to {}", self.low, self.high)
        }
    }
}

/// A file that is being read, with what is wrong so far.
pub struct TomlFile<'a> {
    name: &'a str,
    text: &'a str,
    /// With the byte they start at, for the order.
    problems: Vec<(usize, Problem)>,
}

impl<'a> TomlFile<'a> {
    /// The text of a file, with the name under which problems are reported.
    pub fn new(name: &'a str, text: &'a str) -> Self {
        TomlFile { name, text, problems: Vec::new() }
    }

    /// The name of the file.
    pub fn name(&self) -> &'a str {
        self.name
    }

    /// The file as a table; nothing if it is not TOML, which then is a problem.
    pub fn parse(&mut self) -> Option<DeTable<'a>> {
        match DeTable::parse(self.text) {
            Ok(table) => Some(table.into_inner()),
            Err(error) => {
                let at = error.span().unwrap_or(0..0);
                let found =
                    self.text.get(at.clone()).filter(|t| !t.trim().is_empty() && t.len() < 40 && !t.contains('\n'));
                let found = found.map(|t| format!(" {t:?}")).unwrap_or_default();
                self.refuse(at, "", format!("not TOML: {}{found}", error.message()));
                None
            }
        }
    }

    /// Line of a byte, from 1.
    pub fn line(&self, byte: usize) -> usize {
        1 + self.text.as_bytes().iter().take(byte).filter(|&&b| b == b'\n').count()
    }

    /// Something is wrong at a place.
    pub fn refuse(&mut self, at: Range<usize>, field: &str, what: String) {
        let place = format!("{}:{}", self.name, self.line(at.start));
        self.problems.push((at.start, Problem { place, field: field.to_owned(), what }));
    }

    /// Something is missing, or wrong at no line of its own.
    pub fn refuse_whole(&mut self, field: &str, what: String) {
        let problem = Problem { place: self.name.to_owned(), field: field.to_owned(), what };
        self.problems.push((self.text.len(), problem));
    }

    /// Whether nothing is wrong so far.
    pub fn is_sound(&self) -> bool {
        self.problems.is_empty()
    }

    /// A value, or nothing where it is refused.
    pub fn take<T>(&mut self, path: &str, read: Result<T, Refused>) -> Option<T> {
        match read {
            Ok(value) => Some(value),
            Err(Refused { span, at, what }) => {
                self.refuse(span, &format!("{path}{at}"), what);
                None
            }
        }
    }

    /// A table of the file.
    pub fn section<'t, 'i>(&mut self, table: &'t DeTable<'i>, key: &str) -> Option<Section<'t, 'i>> {
        let Some(value): Option<&Spanned<DeValue>> = table.get(key) else {
            self.refuse_whole(key, format!("missing; give a table [{key}]"));
            return None;
        };
        let entries = Entries::of_any(value, || format!("a table [{key}]"));
        Some(Section { path: key.to_owned(), entries: self.take(key, entries)? })
    }

    /// Refuses every key whose path is not among `known`, nor leads to one of them; `left_out` are read by others. The
    /// paths in arrays are those of one entry.
    pub fn refuse_unknown_keys(&mut self, table: &DeTable<'_>, known: &[&str], left_out: &[&str]) {
        self.refuse_unknown_keys_in("", table, known, left_out);
    }

    fn refuse_unknown_keys_in(&mut self, section: &str, table: &DeTable<'_>, known: &[&str], left_out: &[&str]) {
        for (key, value) in table {
            let name = key.get_ref().as_ref();
            let path = if section.is_empty() { name.to_owned() } else { format!("{section}.{name}") };
            let holds =
                |known: &&str| **known == path || known.strip_prefix(&*path).is_some_and(|rest| rest.starts_with('.'));
            if left_out.contains(&path.as_str()) {
                continue;
            }
            if !known.iter().any(holds) {
                self.refuse(key.span(), &path, unknown_key(&path, known));
                continue;
            }
            match value.get_ref() {
                DeValue::Table(inner) => self.refuse_unknown_keys_in(&path, inner, known, left_out),
                DeValue::Array(entries) => {
                    for entry in entries.iter().filter_map(|entry| entry.get_ref().as_table()) {
                        self.refuse_unknown_keys_in(&path, entry, known, left_out);
                    }
                }
                _ => {}
            }
        }
    }

    /// All that is wrong, in the order of the file.
    pub fn problems(mut self) -> Vec<Problem> {
        self.problems.sort_by_key(|(at, _)| *at);
        self.problems.into_iter().map(|(_, problem)| problem).collect()
    }
}

/// Message for an unknown key.
fn unknown_key(path: &str, known: &[&str]) -> String {
    let section = path.rsplit_once('.').map_or("", |(section, _)| section);
    let hint = likeliest_path(path, known).map_or_else(String::new, |path| format!("; {}", question(path)));
    let inside = |known: &&str| match section {
        "" => Some(known.split('.').next().unwrap_or(known).to_owned()),
        _ => known.strip_prefix(section)?.strip_prefix('.')?.split('.').next().map(str::to_owned),
    };
    let mut allowed: Vec<String> = known.iter().filter_map(inside).collect();
    allowed.dedup();
    format!("unknown key{hint}; allowed: {}", allowed.join(", "))
}

/// A table of a file, whose keys are known already.
pub struct Section<'t, 'i> {
    path: String,
    entries: Entries<'t, 'i>,
}

impl<'t, 'i> Section<'t, 'i> {
    /// Whether a key is there.
    pub fn has(&self, key: &str) -> bool {
        self.entries.table.contains_key(key)
    }

    /// The path of a key.
    pub fn path(&self, key: &str) -> String {
        format!("{}.{key}", self.path)
    }

    /// A value that may be left out; refused and nothing where it is wrong.
    pub fn given<T>(
        &self,
        file: &mut TomlFile<'_>,
        key: &str,
        read: impl Fn(&Spanned<DeValue<'i>>) -> Result<T, Refused>,
    ) -> Option<T> {
        let read = self.entries.given(key, read);
        file.take(&self.path, read)?
    }

    /// A value that must be there; refused and nothing where it is missing or wrong.
    pub fn needed<T>(
        &self,
        file: &mut TomlFile<'_>,
        key: &str,
        read: impl Fn(&Spanned<DeValue<'i>>) -> Result<T, Refused>,
    ) -> Option<T> {
        let read = self.entries.needed(key, read);
        file.take(&self.path, read)
    }

    /// The keys, with their places.
    pub fn keys(&self) -> impl Iterator<Item = &'t Spanned<Cow<'i, str>>> {
        self.entries.table.keys()
    }

    /// The elements of an array; nothing where it is left out or wrong.
    pub fn each<T>(
        &self,
        file: &mut TomlFile<'_>,
        key: &str,
        read: impl Fn(&Spanned<DeValue<'i>>) -> Result<T, Refused>,
    ) -> Option<Vec<T>> {
        self.given(file, key, |value| each_of(value, "an array", &read))
    }

    /// A table within; nothing where it is left out or is none.
    pub fn section(&self, file: &mut TomlFile<'_>, key: &str) -> Option<Section<'t, 'i>> {
        let value: &'t Spanned<DeValue<'i>> = self.entries.table.get(key)?;
        let path = self.path(key);
        let entries = file.take(&path, Entries::of_any(value, || format!("a table [{path}]")))?;
        Some(Section { path, entries })
    }

    /// The tables of an array, `path[k]`; none where it is left out or is none.
    pub fn sections(&self, file: &mut TomlFile<'_>, key: &str) -> Vec<Section<'t, 'i>> {
        let Some(value) = self.entries.table.get(key) else { return Vec::new() };
        let value: &'t Spanned<DeValue<'i>> = value;
        let path = self.path(key);
        let Some(array) = value.get_ref().as_array() else {
            file.take::<()>(&path, Err(Refused::found(value, format!("tables [[{path}]]"))));
            return Vec::new();
        };
        let section = |(k, entry): (usize, &'t Spanned<DeValue<'i>>)| {
            let path = format!("{path}[{k}]");
            let entries = file.take(&path, Entries::of_any(entry, || "a table".to_owned()))?;
            Some(Section { path, entries })
        };
        array.iter().enumerate().filter_map(section).collect()
    }
}

/// Why a value is refused.
#[derive(Debug)]
pub struct Refused {
    /// Where it stands in its file.
    pub span: Range<usize>,
    /// Where within the value, `[1].order`; empty for the value itself.
    pub at: String,
    /// Value found and values allowed.
    pub what: String,
}

impl Refused {
    /// The value is not what is allowed.
    pub fn found(value: &Spanned<DeValue>, allowed: impl fmt::Display) -> Refused {
        Refused::because(value, format!("found {}, allowed: {allowed}", shown(value.get_ref())))
    }

    /// The value is wrong for a reason.
    pub fn because(value: &Spanned<DeValue>, what: String) -> Refused {
        Refused { span: value.span(), at: String::new(), what }
    }

    /// This refusal, seen from outside of the part `at`.
    pub fn within(self, at: impl fmt::Display) -> Refused {
        Refused { at: format!("{at}{}", self.at), ..self }
    }

    /// The problem of the field at a path, its place not known yet.
    pub fn of(self, path: &str) -> Problem {
        Problem::of(&format!("{path}{}", self.at), self.what)
    }
}

fn in_range(allowed: &Allowed, value: &Spanned<DeValue>, number: f64) -> Result<f64, Refused> {
    allowed.refusal(number).map_or(Ok(number), |what| Err(Refused::because(value, what)))
}

/// A number.
pub fn real(allowed: &Allowed, value: &Spanned<DeValue>) -> Result<f64, Refused> {
    in_range(allowed, value, number(value.get_ref()).ok_or_else(|| Refused::found(value, allowed))?)
}

/// Any number.
pub fn any(value: &Spanned<DeValue>) -> Result<f64, Refused> {
    number(value.get_ref()).ok_or_else(|| Refused::found(value, "a number"))
}

/// A number without a fraction.
pub fn whole(allowed: &Allowed, value: &Spanned<DeValue>) -> Result<u32, Refused> {
    let whole = number(value.get_ref()).filter(|_| value.get_ref().is_integer());
    let whole = whole.ok_or_else(|| Refused::found(value, format!("a whole number, {allowed}")))?;
    Ok(in_range(allowed, value, whole)? as u32)
}

/// True or false.
pub fn yes_or_no(value: &Spanned<DeValue>) -> Result<bool, Refused> {
    value.get_ref().as_bool().ok_or_else(|| Refused::found(value, "true or false"))
}

/// A word.
pub fn text(value: &Spanned<DeValue>) -> Result<String, Refused> {
    value.get_ref().as_str().map(str::to_owned).ok_or_else(|| Refused::found(value, "a string"))
}

/// One of several names, for what it means.
pub fn one_of<T: Copy>(known: &[(&'static str, T)], value: &Spanned<DeValue>) -> Result<T, Refused> {
    let word = value.get_ref().as_str();
    let found = known.iter().find(|(name, _)| word == Some(name));
    found.map(|(_, meant)| *meant).ok_or_else(|| {
        let names: Vec<String> = known.iter().map(|(name, _)| format!("{name:?}")).collect();
        let hint = word.map(|found| did_you_mean("; ", found, known.iter().map(|(name, _)| *name)));
        Refused::found(value, names.join(", ") + &hint.unwrap_or_default())
    })
}

/// The elements of an array, each read by `read`.
pub fn each_of<'i, T>(
    value: &Spanned<DeValue<'i>>,
    allowed: &str,
    mut read: impl FnMut(&Spanned<DeValue<'i>>) -> Result<T, Refused>,
) -> Result<Vec<T>, Refused> {
    let array = value.get_ref().as_array().ok_or_else(|| Refused::found(value, allowed))?;
    array
        .iter()
        .enumerate()
        .map(|(k, element)| read(element).map_err(|refused| refused.within(format!("[{k}]"))))
        .collect()
}

/// The entries of a table.
pub struct Entries<'t, 'i> {
    /// The table.
    pub table: &'t DeTable<'i>,
    span: Range<usize>,
}

impl<'t, 'i> Entries<'t, 'i> {
    /// Of a table that holds no keys but these.
    pub fn of(value: &'t Spanned<DeValue<'i>>, known: &[&'static str]) -> Result<Self, Refused> {
        let entries = Entries::of_any(value, || format!("{{ {} }}", known.join(", ")))?;
        for key in entries.table.keys() {
            let name = key.get_ref().as_ref();
            if !known.contains(&name) {
                let hint = did_you_mean("; ", name, known.iter().copied());
                let what = format!("unknown key{hint}; allowed: {}", known.join(", "));
                return Err(Refused { span: key.span(), at: format!(".{name}"), what });
            }
        }
        Ok(entries)
    }

    /// Of any table.
    fn of_any(value: &'t Spanned<DeValue<'i>>, allowed: impl Fn() -> String) -> Result<Self, Refused> {
        let table = value.get_ref().as_table().ok_or_else(|| Refused::found(value, allowed()))?;
        Ok(Entries { table, span: value.span() })
    }

    /// A value that may be left out.
    pub fn given<T>(
        &self,
        key: &str,
        read: impl Fn(&Spanned<DeValue<'i>>) -> Result<T, Refused>,
    ) -> Result<Option<T>, Refused> {
        let value: Option<&Spanned<DeValue<'i>>> = self.table.get(key);
        value.map(|value| read(value).map_err(|refused| refused.within(format!(".{key}")))).transpose()
    }

    /// A value that must be there.
    pub fn needed<T>(
        &self,
        key: &str,
        read: impl Fn(&Spanned<DeValue<'i>>) -> Result<T, Refused>,
    ) -> Result<T, Refused> {
        let missing = || Refused { span: self.span.clone(), at: format!(".{key}"), what: "missing".to_owned() };
        self.given(key, read)?.ok_or_else(missing)
    }
}

/// The entries of a table of any keys, each read by `read`.
pub fn entries_of<'i, T>(
    value: &Spanned<DeValue<'i>>,
    read: impl Fn(&Spanned<DeValue<'i>>) -> Result<T, Refused>,
) -> Result<BTreeMap<String, T>, Refused> {
    let entries = Entries::of_any(value, || "a table".to_owned())?;
    let entry = |key: &Spanned<Cow<'i, str>>| {
        let name = key.get_ref().to_string();
        let value = entries.needed(&name, &read)?;
        Ok((name, value))
    };
    entries.table.keys().map(entry).collect()
}

/// The number of a TOML value, if it is one.
pub fn number(value: &DeValue) -> Option<f64> {
    match value {
        DeValue::Integer(integer) => {
            i64::from_str_radix(&integer.as_str().replace('_', ""), integer.radix()).ok().map(|n| n as f64)
        }
        DeValue::Float(float) => float.as_str().replace('_', "").parse().ok(),
        _ => None,
    }
}

/// A value as a message shows it.
pub fn shown(value: &DeValue) -> String {
    match value {
        DeValue::String(text) => format!("{text:?}"),
        DeValue::Integer(integer) => integer.to_string(),
        DeValue::Float(float) => float.to_string(),
        DeValue::Boolean(truth) => truth.to_string(),
        DeValue::Datetime(_) => "a date".to_owned(),
        DeValue::Array(_) => "an array".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}
