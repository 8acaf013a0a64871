//! Which column of a file holds what, and in which unit.

use std::fmt;

use thiserror::Error;

use super::csv_rows::TableProblem;
use crate::suggest::{did_you_mean, likeliest, question};

/// What a column may hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Time.
    Time,
    /// Generator angle.
    Generator,
    /// Output angle.
    Output,
    /// Output angle less generator over ratio.
    Error,
    /// Load torque at the output.
    Torque,
    /// Temperature.
    Temperature,
    /// Angle of the drive against gravity.
    Orientation,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Quantity; 7] = [
        Quantity::Time,
        Quantity::Generator,
        Quantity::Output,
        Quantity::Error,
        Quantity::Torque,
        Quantity::Temperature,
        Quantity::Orientation,
    ];

    /// Its name in a mapping.
    pub fn name(self) -> &'static str {
        match self {
            Quantity::Time => "time",
            Quantity::Generator => "generator",
            Quantity::Output => "output",
            Quantity::Error => "error",
            Quantity::Torque => "torque",
            Quantity::Temperature => "temperature",
            Quantity::Orientation => "orientation",
        }
    }

    /// The column it has in a file without a mapping, and the unit there.
    pub fn default_column(self) -> (&'static str, Unit) {
        match self {
            Quantity::Time => ("time_s", Unit::Second),
            Quantity::Generator => ("generator_rad", Unit::Radian),
            Quantity::Output => ("output_rad", Unit::Radian),
            Quantity::Error => ("error_arcsec", Unit::Arcsecond),
            Quantity::Torque => ("torque_n_m", Unit::NewtonMetre),
            Quantity::Temperature => ("temperature_c", Unit::Celsius),
            Quantity::Orientation => ("orientation_rad", Unit::Radian),
        }
    }

    /// The units it may have.
    pub fn units(self) -> &'static [Unit] {
        match self {
            Quantity::Time => &[Unit::Second, Unit::Millisecond],
            Quantity::Torque => &[Unit::NewtonMetre],
            Quantity::Temperature => &[Unit::Celsius, Unit::Kelvin],
            _ => &Unit::ANGLES,
        }
    }

    /// The largest size a value may have, in the unit used inside (rad, s, N·m, °C): beyond it a double no longer resolves an
    /// arc-second, or nothing of the kind exists.
    pub(super) fn limit(self) -> f64 {
        match self {
            Quantity::Time => 1e11,
            Quantity::Torque => 1e9,
            Quantity::Temperature => 1e6,
            _ => 1e9,
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Unit of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// rad
    Radian,
    /// deg
    Degree,
    /// turn
    Turn,
    /// arcmin
    Arcminute,
    /// arcsec
    Arcsecond,
    /// s
    Second,
    /// ms
    Millisecond,
    /// N.m
    NewtonMetre,
    /// C
    Celsius,
    /// K
    Kelvin,
}

impl Unit {
    const ALL: [Unit; 10] = [
        Unit::Radian,
        Unit::Degree,
        Unit::Turn,
        Unit::Arcminute,
        Unit::Arcsecond,
        Unit::Second,
        Unit::Millisecond,
        Unit::NewtonMetre,
        Unit::Celsius,
        Unit::Kelvin,
    ];

    /// Units of angle, the largest name first that a slip of the pen takes for another.
    pub const ANGLES: [Unit; 5] = [Unit::Radian, Unit::Degree, Unit::Turn, Unit::Arcminute, Unit::Arcsecond];

    /// Its name in a mapping.
    pub fn name(self) -> &'static str {
        match self {
            Unit::Radian => "rad",
            Unit::Degree => "deg",
            Unit::Turn => "turn",
            Unit::Arcminute => "arcmin",
            Unit::Arcsecond => "arcsec",
            Unit::Second => "s",
            Unit::Millisecond => "ms",
            Unit::NewtonMetre => "N.m",
            Unit::Celsius => "C",
            Unit::Kelvin => "K",
        }
    }

    /// One of it in the unit used inside: rad, s, N·m, °C.
    pub fn factor(self) -> f64 {
        use std::f64::consts::TAU;
        match self {
            Unit::Degree => TAU / 360.0,
            Unit::Turn => TAU,
            Unit::Arcminute => TAU / 21_600.0,
            Unit::Arcsecond => TAU / 1_296_000.0,
            Unit::Millisecond => 1e-3,
            Unit::Radian | Unit::Second | Unit::NewtonMetre | Unit::Celsius | Unit::Kelvin => 1.0,
        }
    }

    /// Its zero in the unit used inside.
    pub fn zero(self) -> f64 {
        if self == Unit::Kelvin { -273.15 } else { 0.0 }
    }

    /// The unit that a column is in if its name ends in it, `wave_gen_turn` or `error_arcsec`.
    fn ending(column: &str) -> Option<Unit> {
        let endings = [
            ("_rad", Unit::Radian),
            ("_deg", Unit::Degree),
            ("_turn", Unit::Turn),
            ("_turns", Unit::Turn),
            ("_arcmin", Unit::Arcminute),
            ("_arcsec", Unit::Arcsecond),
            ("_s", Unit::Second),
            ("_ms", Unit::Millisecond),
            ("_n_m", Unit::NewtonMetre),
            ("_c", Unit::Celsius),
            ("_k", Unit::Kelvin),
        ];
        endings.iter().find(|(end, _)| column.ends_with(end)).map(|(_, unit)| *unit)
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A mapping that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("--columns: {0}; for instance --columns generator=wave_gen_turns:turn,error=error_arcsec:arcsec")]
pub struct MappingError(String);

/// Names and units of columns where they differ from `time_s, generator_rad, output_rad, error_arcsec, torque_n_m, temperature_c,
/// orientation_rad`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ColumnMap {
    given: Vec<(Quantity, String, Unit)>,
}

/// A column in use.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// What it holds.
    pub quantity: Quantity,
    /// Its name in the header.
    pub name: String,
    /// Where it stands, from 0.
    pub place: usize,
    /// Its unit.
    pub unit: Unit,
}

impl ColumnMap {
    /// Reads `generator=wave_gen_turns:turn,error=error_arcsec:arcsec`. Without `:unit` a name that ends in a unit says it
    /// (`_rad`, `_deg`, `_turns`, …), else it is that of the default column.
    pub fn parse(text: &str) -> Result<ColumnMap, MappingError> {
        let mut map = ColumnMap::default();
        for entry in text.split(',').map(str::trim) {
            let (name, column) = entry.split_once('=').ok_or_else(|| {
                MappingError(format!("found \"{entry}\", allowed: name=column:unit, separated by commas"))
            })?;
            let name = name.trim();
            let quantity = Quantity::ALL.into_iter().find(|q| q.name() == name).ok_or_else(|| {
                let names = Quantity::ALL.map(Quantity::name);
                let hint = did_you_mean("; ", name, names);
                MappingError(format!("found the name \"{name}\", allowed: {}{hint}", names.join(", ")))
            })?;
            let (column, unit) = match column.rsplit_once(':') {
                None => {
                    let column = column.trim();
                    let ending = Unit::ending(column).filter(|unit| quantity.units().contains(unit));
                    (column, ending.unwrap_or(quantity.default_column().1))
                }
                Some((column, unit)) => {
                    let unit = unit.trim();
                    let known = Unit::ALL.into_iter().find(|u| u.name() == unit);
                    let fits = known.filter(|u| quantity.units().contains(u)).ok_or_else(|| {
                        let units: Vec<_> = quantity.units().iter().map(|u| u.name()).collect();
                        let hint = did_you_mean("; ", unit, units.iter().copied());
                        let units = units.join(", ");
                        MappingError(format!("{name}: found the unit \"{unit}\", allowed: {units}{hint}"))
                    })?;
                    (column.trim(), fits)
                }
            };
            if column.is_empty() {
                return Err(MappingError(format!(
                    "{name}: found no column, allowed: the name of a column of the file"
                )));
            }
            if let Some((before, ..)) = map.given.iter().find(|(q, other, _)| *q == quantity || other == column) {
                let what = if *before == quantity {
                    format!("{name} is there twice")
                } else {
                    format!("column {column} stands for both {before} and {name}")
                };
                return Err(MappingError(what));
            }
            map.given.push((quantity, column.to_owned(), unit));
        }
        Ok(map)
    }

    /// The columns in use of a file with these `names`. Of output and error one is used: the one that was mapped, else the output.
    pub(super) fn resolve(&self, names: &[String], line: u64) -> Result<Vec<Column>, TableProblem> {
        let problem = |what: String| TableProblem { line, what };
        let mut columns = Vec::new();
        for quantity in Quantity::ALL {
            let given = self.given.iter().find(|(q, ..)| *q == quantity);
            let (name, unit) =
                given.map_or_else(|| quantity.default_column(), |(_, name, unit)| (name.as_str(), *unit));
            let mut places = names.iter().enumerate().filter(|(_, n)| *n == name).map(|(place, _)| place);
            match (places.next(), places.next()) {
                (Some(_), Some(_)) => return Err(problem(format!("column {name} is there twice"))),
                (Some(place), None) => columns.push(Column { quantity, name: name.to_owned(), place, unit }),
                (None, _) if given.is_some() => {
                    let hint = meant(name, names);
                    let mut what = format!("column {name} is missing, which --columns gives for {quantity}; {hint}");
                    what.push_str(&found(names));
                    return Err(problem(what));
                }
                (None, _) => {}
            }
        }
        let has = |columns: &[Column], quantity| columns.iter().any(|c| c.quantity == quantity);
        let mapped = |quantity| self.given.iter().any(|(q, ..)| *q == quantity);
        if has(&columns, Quantity::Output) && has(&columns, Quantity::Error) {
            let spare =
                if mapped(Quantity::Error) && !mapped(Quantity::Output) { Quantity::Output } else { Quantity::Error };
            columns.retain(|c| c.quantity != spare);
        }
        let hint = separator(names);
        if !has(&columns, Quantity::Generator) {
            let meant = meant("generator_rad", names);
            return Err(problem(format!("column generator_rad is missing; {hint}{meant}{}", found(names))));
        }
        if !has(&columns, Quantity::Output) && !has(&columns, Quantity::Error) {
            let what = "neither column output_rad nor error_arcsec is there; one is needed";
            let meant = [meant("output_rad", names), meant("error_arcsec", names)].concat();
            return Err(problem(format!("{what}; {hint}{meant}{}", found(names))));
        }
        Ok(columns)
    }

    /// What to say of columns that are not among the `used` ones, though they are nearly called as one that is missing.
    pub(super) fn misspelt(&self, names: &[String], used: &[Column]) -> Vec<String> {
        let spare: Vec<&str> =
            names.iter().map(String::as_str).filter(|name| used.iter().all(|column| column.name != *name)).collect();
        let missing = Quantity::ALL.into_iter().filter(|q| used.iter().all(|column| column.quantity != *q));
        // Of output and error one is used.
        let missing = missing.filter(|q| !matches!(q, Quantity::Output | Quantity::Error));
        missing
            .filter_map(|quantity| {
                let (default, _) = quantity.default_column();
                let name = likeliest(default, spare.iter().copied())?;
                let unit = Unit::ending(name).filter(|unit| quantity.units().contains(unit)).map_or("UNIT", Unit::name);
                Some(format!(
                    "column {name} is not used; if it is {default}, say so with --columns {quantity}={name}:{unit}"
                ))
            })
            .collect()
    }
}

/// The column that may be meant by `wanted`, if there is one.
fn meant(wanted: &str, names: &[String]) -> String {
    likeliest(wanted, names.iter().map(String::as_str)).map_or_else(String::new, |name| question(name) + " ")
}

/// What the header holds, and how to name it.
fn found(names: &[String]) -> String {
    if names.iter().all(|name| name.is_empty()) {
        return "the file has no header".to_owned();
    }
    if names.iter().all(|name| name.is_empty() || name.parse::<f64>().is_ok()) {
        return "the first line has numbers; a line with the names of the columns is needed".to_owned();
    }
    let mut shown: Vec<String> = names.iter().take(12).map(|name| name.chars().take(40).collect()).collect();
    if names.len() > 12 {
        shown.push("…".to_owned());
    }
    format!("found: {}; other names are mapped with --columns generator=NAME:UNIT,…", shown.join(", "))
}

/// Says so if the header is separated by something else than commas.
fn separator(names: &[String]) -> &'static str {
    match names {
        [one] if one.contains(';') => "fields are separated by semicolons; allowed: commas, and a point in numbers; ",
        [one] if one.contains('\t') => "fields are separated by tabs; allowed: commas; ",
        [one] if one.contains('|') => "fields are separated by bars; allowed: commas; ",
        [one] if one.contains(' ') => "fields are separated by spaces; allowed: commas; ",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<String> {
        text.split(',').map(str::to_owned).collect()
    }

    #[test]
    fn a_mapping_names_columns_and_units() {
        let map = ColumnMap::parse("generator=wave_gen_turns:turn, error=error_arcsec,time=t_s").unwrap();
        let columns = map.resolve(&names("t_s,wave_gen_turns,error_arcsec,output_rad"), 1).unwrap();
        let said: Vec<_> = columns.iter().map(|c| (c.quantity.name(), c.place, c.unit.name())).collect();
        assert_eq!(said, [("time", 0, "s"), ("generator", 1, "turn"), ("error", 2, "arcsec")]);
        // A name may hold a colon if the unit is said, and a unit in the name is believed.
        let map = ColumnMap::parse("generator=enc:1:deg,output=load_deg").unwrap();
        let columns = map.resolve(&names("enc:1,load_deg"), 1).unwrap();
        assert_eq!((columns[0].unit, columns[1].unit), (Unit::Degree, Unit::Degree));
    }

    #[test]
    fn the_output_is_used_where_both_are_there() {
        let both = names("generator_rad,error_arcsec,output_rad");
        let columns = ColumnMap::default().resolve(&both, 1).unwrap();
        assert_eq!(columns[1].quantity, Quantity::Output);
    }

    #[test]
    fn units_convert() {
        for (unit, angle) in Unit::ANGLES.into_iter().zip([std::f64::consts::TAU, 360.0, 1.0, 21_600.0, 1_296_000.0]) {
            assert!((unit.factor() * angle - std::f64::consts::TAU).abs() < 1e-12, "{unit}");
        }
        assert_eq!(300.0 * Unit::Kelvin.factor() + Unit::Kelvin.zero(), 300.0 - 273.15);
    }

    #[test]
    fn wrong_mappings_are_refused_each_with_its_own_message() {
        for (text, said) in [
            ("", "found \"\""),
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
            ("generator=a:degrees", "arcmin, arcsec; did you mean `deg`?"),
            ("torque=a:Nm", "allowed: N.m; did you mean `N.m`?"),
            ("temperature=a:c", "allowed: C, K; did you mean `C`?"),
            ("qwertz=a", "temperature, orientation; for instance"),
            ("error=a:parsec", "arcmin, arcsec; did you mean `arcsec`?"),
            ("error=a:mil", "arcmin, arcsec; for instance"),
        ] {
            let error = ColumnMap::parse(text).unwrap_err().to_string();
            assert!(error.starts_with("--columns: ") && error.contains(said), "{text:?} gave {error:?}");
        }
    }

    #[test]
    fn a_missing_column_whose_misspelling_is_there_is_named() {
        let refused = |header: &str| ColumnMap::default().resolve(&names(header), 1).unwrap_err().what;
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
        let what = map.resolve(&names("generator_rad,output_rad,load_n_m"), 1).unwrap_err().what;
        assert!(what.contains("did you mean `load_n_m`?"), "{what}");
        // One that may be missing is not asked for, but told.
        let noted = |header: &str| {
            let names = names(header);
            let map = ColumnMap::default();
            map.misspelt(&names, &map.resolve(&names, 1).unwrap())
        };
        assert_eq!(
            noted("generator_rad,output_rad,torque_Nm,time_ms"),
            [
                "column time_ms is not used; if it is time_s, say so with --columns time=time_ms:ms",
                "column torque_Nm is not used; if it is torque_n_m, say so with --columns torque=torque_Nm:UNIT"
            ]
        );
        assert_eq!(noted("generator_rad,output_rad,torque_n_m,torque_Nm,current_a,error_arcsec"), [""; 0]);
    }
}
