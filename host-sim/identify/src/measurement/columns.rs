//! Which column of a file holds what, and in which unit.

use thiserror::Error;

use super::Refusal;
use super::reader::{Layout, unit_word};
use super::unit::Family;
pub use super::unit::{Reading, Unit};
use flexspline_base::csv_rows::TableProblem;
use flexspline_base::suggest::{did_you_mean, likeliest, question};

table! {
    /// The quantities of a column, each with its name in a mapping, the column it has in a file without a mapping, the
    /// unit of that column, and the largest size that a value may have, in the unit used inside (rad, s, N·m, °C):
    /// beyond it a double no longer resolves an arc-second, or nothing of the kind exists. *Guesses*.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Quantity: (&'static str, &'static str, Unit, f64) {
        /// Time.
        Time = ("time", "time_s", Unit::Second, 1e11),
        /// Generator angle.
        Generator = ("generator", "generator_rad", Unit::Radian, 1e9),
        /// Output angle.
        Output = ("output", "output_rad", Unit::Radian, 1e9),
        /// Output angle less generator over ratio.
        Error = ("error", "error_arcsec", Unit::Arcsecond, 1e9),
        /// Load torque at the output.
        Torque = ("torque", "torque_n_m", Unit::NewtonMetre, 1e9),
        /// Temperature.
        Temperature = ("temperature", "temperature_c", Unit::Celsius, 1e6),
        /// Angle of the drive against gravity.
        Orientation = ("orientation", "orientation_rad", Unit::Radian, 1e9),
    }
}

impl Quantity {
    /// Its name in a mapping.
    pub fn name(self) -> &'static str {
        self.row().0
    }

    /// The column it has in a file without a mapping, and the unit there.
    pub(crate) fn default_column(self) -> (&'static str, Unit) {
        let (_, column, unit, _) = self.row();
        (column, unit)
    }

    /// The family of its units.
    pub(crate) fn family(self) -> Family {
        self.row().2.family()
    }

    /// The largest size a value may have.
    pub(super) fn limit(self) -> f64 {
        self.row().3
    }
}

shown_by_name!(Quantity::name);

/// Options that say no mapping: what was found and what is allowed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct MappingError(String);

impl MappingError {
    fn of_columns(what: impl std::fmt::Display) -> MappingError {
        MappingError(format!(
            "--columns: {what}; for instance --columns generator=wave_gen_turns:turn,error=error_arcsec:arcsec"
        ))
    }
}

/// Names and units of columns where they differ from
/// `time_s, generator_rad, output_rad, error_arcsec, torque_n_m, temperature_c, orientation_rad`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ColumnMap {
    given: Vec<GivenColumn>,
    /// The rate of rows, Hz, if it was said.
    pub(super) rate_hz: Option<f64>,
}

/// A column that was named.
#[derive(Debug, Clone, PartialEq)]
struct GivenColumn {
    quantity: Quantity,
    column: String,
    /// `None` where neither the mapping nor the name says a unit.
    reading: Option<Reading>,
}

/// A column in use.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MappedColumn {
    /// Its contents.
    pub quantity: Quantity,
    /// Its name in the header.
    pub name: String,
    /// Where it stands, from 0.
    pub place: usize,
    /// How its numbers are read.
    pub reading: Reading,
    /// Whether the mapping says so: then it is believed.
    pub said: bool,
}

impl ColumnMap {
    /// Reads `generator=wave_gen_turns:turn,error=error_arcsec:arcsec`, or with columns by number, signs and gains
    /// `generator=#1:count/16777216,torque=#4:-N.m`. Without `:unit` a name that ends in a unit says it (`_rad`,
    /// `_deg`, `_turns`, …), else a line of units below the names, else it is that of the default column.
    pub fn parse(text: &str) -> Result<ColumnMap, MappingError> {
        ColumnMap::of_options(text, None, None)
    }

    /// The mapping of options: of the columns, empty for the names of this project; the rate of rows, Hz, for files
    /// that hold no time; the torque at the output for an ampere, N·m, where the torque is given as a current.
    ///
    /// # Errors
    /// The first that says nothing that can be used.
    pub fn of_options(columns: &str, rate_hz: Option<f64>, per_ampere: Option<f64>) -> Result<ColumnMap, MappingError> {
        if let Some(constant) = per_ampere.filter(|constant| !(constant.is_finite() && *constant != 0.0)) {
            return Err(MappingError(format!(
                "--torque-constant: found {constant}, allowed: a number other than zero, N.m for an ampere"
            )));
        }
        if let Some(rate) = rate_hz.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
            return Err(MappingError(format!("--rate: found {rate}, allowed: a rate above zero, Hz")));
        }
        let mut map = ColumnMap { rate_hz, ..ColumnMap::default() };
        for entry in columns.split(',').filter(|_| !columns.is_empty()).map(str::trim) {
            let given = given(entry, per_ampere)?;
            let (name, column) = (given.quantity, &given.column);
            match map.given.iter().find(|other| other.quantity == name || other.column == *column) {
                Some(before) if before.quantity == name => {
                    return Err(MappingError::of_columns(format!("{name} is there twice")));
                }
                Some(GivenColumn { quantity, .. }) => {
                    return Err(MappingError::of_columns(format!(
                        "column {column} stands for both {quantity} and {name}"
                    )));
                }
                None => map.given.push(given),
            }
        }
        Ok(map)
    }

    /// The entry of a quantity.
    fn given(&self, quantity: Quantity) -> Option<&GivenColumn> {
        self.given.iter().find(|given| given.quantity == quantity)
    }

    /// The column of a quantity, and whether its unit was said.
    pub(crate) fn column(&self, quantity: Quantity) -> (&str, bool) {
        self.given(quantity)
            .map_or((quantity.default_column().0, false), |given| (&given.column, given.reading.is_some()))
    }

    /// Counts in a turn of the output's encoder, negative where they fall as its angle rises, if its unit says so.
    pub fn counts_of_output(&self) -> Option<f64> {
        let reading = self.given(Quantity::Output)?.reading?;
        (reading.unit == Unit::Count).then(|| reading.gain.recip())
    }

    /// The names that are looked for.
    pub(super) fn known(&self) -> Vec<&str> {
        let defaults = Quantity::ALL.iter().map(|quantity| quantity.default_column().0);
        self.given.iter().map(|given| given.column.as_str()).chain(defaults).collect()
    }

    /// The columns in use of a file. Of output and error one is used: the one that was mapped, else the output.
    pub(super) fn resolve(&self, layout: &Layout) -> Result<Vec<MappedColumn>, TableProblem> {
        let names = &layout.names;
        let problem = |what: String| TableProblem { line: layout.header_line, what };
        // The columns that may be meant by these names, and those that are there.
        let there = |wanted: &[&str]| {
            let meant = wanted.iter().filter_map(|name| likeliest(name, names.iter().map(String::as_str)));
            let meant: String = meant.map(|name| question(name) + " ").collect();
            [separator(names), &meant, &found(layout)].concat()
        };
        let mut columns = Vec::new();
        for quantity in Quantity::ALL {
            let (given, default) = (self.given(quantity), quantity.default_column());
            let name = given.map_or(default.0, |given| given.column.as_str());
            let mut places = names.iter().enumerate().filter(|(_, n)| *n == name).map(|(place, _)| place);
            let place = places.next().or_else(|| given.and_then(|_| by_number(name, names.len())));
            if places.next().is_some() {
                return Err(problem(format!("column {name} is there twice")));
            }
            let Some(place) = place else {
                if given.is_none() {
                    continue;
                }
                let what =
                    format!("column {name} is missing, which --columns gives for {quantity}; {}", there(&[name]));
                return Err(problem(what));
            };
            let said = given.and_then(|given| given.reading);
            let below = || unit_below(quantity, place, layout);
            let reading = said.map_or_else(below, |reading| Ok(Some(reading)));
            let reading = reading.map_err(|wrong| problem(format!("column {name}: {wrong}")))?;
            let reading = reading.unwrap_or(Reading::of(default.1));
            let (name, said) = (name.to_owned(), said.is_some());
            columns.push(MappedColumn { quantity, name, place, reading, said });
        }
        let has = |quantity| columns.iter().any(|column| column.quantity == quantity);
        if !has(Quantity::Generator) {
            return Err(problem(format!("column generator_rad is missing; {}", there(&["generator_rad"]))));
        }
        let (output, error) = (has(Quantity::Output), has(Quantity::Error));
        if !output && !error {
            let there = there(&["output_rad", "error_arcsec"]);
            let what = format!("neither column output_rad nor error_arcsec is there; one is needed; {there}");
            return Err(problem(what));
        }
        if output && error {
            let spare = match (self.given(Quantity::Output), self.given(Quantity::Error)) {
                (None, Some(_)) => Quantity::Output,
                _ => Quantity::Error,
            };
            columns.retain(|column| column.quantity != spare);
        }
        Ok(columns)
    }

    /// Notes on columns that are not among the `used` ones, though they are nearly called as one that is missing.
    pub(super) fn misspelt(&self, names: &[String], used: &[MappedColumn]) -> Vec<String> {
        let is_used = |name: &str| used.iter().any(|column| column.name == name);
        let spare = || names.iter().map(String::as_str).filter(|name| !is_used(name));
        // Of output and error one is used.
        let missing = Quantity::ALL.into_iter().filter(|quantity| {
            !matches!(quantity, Quantity::Output | Quantity::Error)
                && used.iter().all(|column| column.quantity != *quantity)
        });
        let note = |quantity: Quantity| {
            let (default, _) = quantity.default_column();
            let name = likeliest(default, spare())?;
            let unit = Unit::in_name(name).filter(|unit| unit.family() == quantity.family()).map_or("UNIT", Unit::name);
            Some(format!(
                "column {name} is not used; if it is {default}, say so with --columns {quantity}={name}:{unit}"
            ))
        };
        missing.filter_map(note).collect()
    }
}

/// One entry of a mapping.
fn given(entry: &str, per_ampere: Option<f64>) -> Result<GivenColumn, MappingError> {
    let (name, column) = entry.split_once('=').ok_or_else(|| {
        MappingError::of_columns(format!("found \"{entry}\", allowed: name=column:unit, separated by commas"))
    })?;
    let name = name.trim();
    let quantity = Quantity::ALL.into_iter().find(|q| q.name() == name).ok_or_else(|| {
        let names = Quantity::ALL.map(Quantity::name);
        let hint = did_you_mean("; ", name, names);
        MappingError::of_columns(format!("found the name \"{name}\", allowed: {}{hint}", names.join(", ")))
    })?;
    let (column, reading) = match column.rsplit_once(':') {
        None => {
            let ending = Unit::in_name(column.trim()).filter(|unit| unit.family() == quantity.family());
            let text = Unit::bracketed(column).or(ending.map(Unit::name));
            (column, text.map(|text| Reading::parse(text, quantity.family(), per_ampere)).transpose())
        }
        Some((column, unit)) => (column, Reading::parse(unit, quantity.family(), per_ampere).map(Some)),
    };
    let reading = reading.map_err(|wrong| MappingError::of_columns(format!("{name}: {wrong}")))?;
    let column = column.trim().to_owned();
    if column.is_empty() {
        return Err(MappingError::of_columns(format!(
            "{name}: found no column, allowed: the name of a column of the file"
        )));
    }
    Ok(GivenColumn { quantity, column, reading })
}

/// The place that `#3`, or `3` where no column is called so, stands for.
fn by_number(name: &str, columns: usize) -> Option<usize> {
    let number: usize = name.strip_prefix('#').unwrap_or(name).parse().ok()?;
    (1..=columns).contains(&number).then(|| number - 1)
}

/// The reading by the line of units below the names; none where it has no word for the column, or a bare number.
fn unit_below(quantity: Quantity, place: usize, layout: &Layout) -> Result<Option<Reading>, Refusal> {
    let word = layout.units.get(place).map_or("", |unit| unit_word(unit));
    let written = !["", "-", "1"].contains(&word);
    written.then(|| Reading::parse(word, quantity.family(), None)).transpose()
}

/// The contents of the header, and how to name it.
fn found(layout: &Layout) -> String {
    let names = &layout.names;
    if names.iter().all(|name| name.is_empty()) {
        return "the file is empty or has no header".to_owned();
    }
    if !layout.has_names {
        return format!(
            "the first line has numbers, no names; the {} columns are mapped by number, --columns \
             generator=#1:UNIT,output=#2:UNIT",
            names.len()
        );
    }
    let more = if names.len() > 12 { ", …" } else { "" };
    let shown = names.iter().take(12).map(|name| name.chars().take(40).collect());
    let shown = shown.collect::<Vec<String>>().join(", ");
    format!(
        "found: {shown}{more}; other names are mapped with --columns generator=NAME:UNIT,… (`flexspline look FILE` \
         proposes it)"
    )
}

/// Says so if the header is separated by something else than commas.
fn separator(names: &[String]) -> &'static str {
    match names {
        [one] if one.contains([' ', '\t', ';', '|']) => "no rows of numbers were found below; ",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<String> {
        text.split(',').map(str::to_owned).collect()
    }

    fn laid_out(header: &str) -> Layout {
        let mut layout = Layout::default();
        (layout.names, layout.has_names, layout.header_line) = (names(header), true, 1);
        layout
    }

    #[test]
    fn a_mapping_names_columns_and_units() {
        let map = ColumnMap::parse("generator=wave_gen_turns:turn, error=error_arcsec,time=t_s").unwrap();
        let columns = map.resolve(&laid_out("t_s,wave_gen_turns,error_arcsec,output_rad")).unwrap();
        let said: Vec<_> =
            columns.iter().map(|c| (c.quantity.name(), c.place, c.reading.plain_unit().name())).collect();
        assert_eq!(said, [("time", 0, "s"), ("generator", 1, "turn"), ("error", 2, "arcsec")]);
        // A name may hold a colon if the unit is said, and a unit in the name is believed.
        let map = ColumnMap::parse("generator=enc:1:deg,output=load_deg").unwrap();
        let columns = map.resolve(&laid_out("enc:1,load_deg")).unwrap();
        assert_eq!((columns[0].reading.plain_unit(), columns[1].reading.plain_unit()), (Unit::Degree, Unit::Degree));
        // A place in a list is no unit.
        let map = ColumnMap::parse("generator=position[1],output=out [gon]").unwrap();
        let columns = map.resolve(&laid_out("position[1],out [gon]")).unwrap();
        assert_eq!((columns[0].reading.plain_unit(), columns[1].reading.plain_unit()), (Unit::Radian, Unit::Gon));
    }

    #[test]
    fn the_output_is_used_where_both_are_there() {
        let columns = ColumnMap::default().resolve(&laid_out("generator_rad,error_arcsec,output_rad")).unwrap();
        assert_eq!(columns[1].quantity, Quantity::Output);
    }

    #[test]
    fn columns_go_by_number_where_no_name_is_meant() {
        let map = ColumnMap::parse("generator=#2:count/4096,output=3:-deg,torque=1").unwrap();
        let columns = map.resolve(&laid_out("1,b,c")).unwrap();
        let said: Vec<_> =
            columns.iter().map(|c| (c.quantity.name(), c.place, c.reading.plain_unit().name())).collect();
        assert_eq!(said, [("generator", 1, "turn"), ("output", 2, "deg"), ("torque", 0, "N.m")]);
        assert_eq!(columns[0].reading.value(1024.0), std::f64::consts::TAU / 4.0);
        assert_eq!(columns[1].reading.value(180.0), -std::f64::consts::PI);
        let missing = ColumnMap::parse("generator=#4:deg").unwrap().resolve(&laid_out("a,b,c")).unwrap_err();
        assert!(missing.what.contains("column #4 is missing"), "{missing:?}");
    }

    #[test]
    fn wrong_mappings_are_refused_each_with_its_own_message() {
        for (text, said) in [
            ("generator", "found \"generator\""),
            ("generator=", "generator: found no column"),
            ("angle=a:rad", "found the name \"angle\""),
            ("generator=a:grad", "generator: found the unit \"grad\", allowed: rad, deg"),
            ("torque=a:rad", "torque: found the unit \"rad\", allowed: N.m"),
            ("time=a:K", "time: found the unit \"K\", allowed: s, ms"),
            ("time=a,time=b", "time is there twice"),
            ("generator=a:rad,output=a:rad", "column a stands for both generator and output"),
            ("generater=a", "temperature, orientation; did you mean `generator`?"),
            ("temp=a", "did you mean `temperature`?"),
            ("generator=a:degs", "mrad, count; did you mean `deg`?"),
            ("torque=a:n.m", "did you mean `N.m`?"),
            ("temperature=a:c", "allowed: C, K, F; did you mean `C`?"),
            ("generator=a:count", "how many counts make a turn, for instance count/16777216"),
            ("torque=a:mA", "--torque-constant"),
            ("torque=a_mA", "--torque-constant"),
            ("output=a:deg*x", "found \"*x\" after the unit"),
            ("qwertz=a", "temperature, orientation; for instance"),
            ("error=a:parsec", "did you mean `arcsec`?"),
            ("torque=torque [Nmx]", "torque: found the unit \"Nmx\", allowed: N.m, N.cm, N.mm"),
            ("generator=motor (Gon)", "generator: found the unit \"Gon\", allowed: rad, deg, gon, turn"),
            ("error=a:mil", "arcmin, arcsec, mrad, count"),
        ] {
            let error = ColumnMap::parse(text).unwrap_err().to_string();
            assert!(error.starts_with("--columns: ") && error.contains(said), "{text:?} gave {error:?}");
        }
    }

    #[test]
    fn a_missing_column_whose_misspelling_is_there_is_named() {
        let refused = |header: &str| ColumnMap::default().resolve(&laid_out(header)).unwrap_err().what;
        for (header, said) in [
            ("generator_deg,output_rad", "generator_rad is missing; did you mean `generator_deg`? found: "),
            ("Generator_Rad,output_rad", "did you mean `Generator_Rad`?"),
            ("generator_rad,ouput_rad", "did you mean `ouput_rad`?"),
            ("generator_rad,error_arcmin", "did you mean `error_arcmin`?"),
            ("generator_rad,qwertz", "one is needed; found: generator_rad, qwertz"),
            ("psi,output_rad", "generator_rad is missing; found: psi"),
        ] {
            assert!(refused(header).contains(said), "{header}: {}", refused(header));
        }
        let map = ColumnMap::parse("torque=load_nm:N.m").unwrap();
        let what = map.resolve(&laid_out("generator_rad,output_rad,load_n_m")).unwrap_err().what;
        assert!(what.contains("did you mean `load_n_m`?"), "{what}");
        // One that may be missing is not asked for, but reported.
        let noted = |header: &str| {
            let names = names(header);
            let map = ColumnMap::default();
            map.misspelt(&names, &map.resolve(&laid_out(header)).unwrap())
        };
        assert_eq!(
            noted("generator_rad,output_rad,torque_Nm,time_ms"),
            [
                "column time_ms is not used; if it is time_s, say so with --columns time=time_ms:ms",
                "column torque_Nm is not used; if it is torque_n_m, say so with --columns torque=torque_Nm:N.m"
            ]
        );
        assert_eq!(noted("generator_rad,output_rad,torque_n_m,torque_Nm,current_a,error_arcsec"), [""; 0]);
    }
}
