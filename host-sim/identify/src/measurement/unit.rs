//! Units of columns, and how a written value becomes one: `deg`, `-N.m`, `count/16777216`, `A*3.5`, `V*20-0.4`.

use std::f64::consts::TAU;

use super::Refusal;
use flexspline_base::suggest::did_you_mean;

table! {
    /// Unit of a column, with its family, how people write it (its name in a mapping first) and its size in the unit
    /// used inside (rad, s, N·m, °C). The size of a count, an ampere and a volt is that of the result of its gain: a
    /// turn, a N·m.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[allow(missing_docs, reason = "a row begins with the name in a mapping")]
    pub enum Unit: (Family, &'static [&'static str], f64) {
        Radian = (Family::Angle, &["rad"], 1.0),
        Degree = (Family::Angle, &["deg", "°", "degree", "degrees"], TAU / 360.0),
        /// gon: 400 make a turn
        Gon = (Family::Angle, &["gon"], TAU / 400.0),
        Turn = (Family::Angle, &["turn", "turns", "rev", "revs"], TAU),
        Arcminute = (Family::Angle, &["arcmin"], TAU / 21_600.0),
        Arcsecond = (Family::Angle, &["arcsec"], TAU / 1_296_000.0),
        Milliradian = (Family::Angle, &["mrad"], 1e-3),
        /// Counts of an encoder; how many make a turn has to be said.
        Count = (Family::Angle, &["count", "counts", "cnt", "inc", "incs", "tick", "ticks"], TAU),
        Second = (Family::Time, &["s", "sec", "seconds"], 1.0),
        Millisecond = (Family::Time, &["ms"], 1e-3),
        Microsecond = (Family::Time, &["us", "µs", "μs"], 1e-6),
        Nanosecond = (Family::Time, &["ns"], 1e-9),
        Minute = (Family::Time, &["min"], 60.0),
        Hour = (Family::Time, &["h"], 3600.0),
        /// d: days, as spreadsheets count time.
        Day = (Family::Time, &["d", "days", "day"], 86_400.0),
        /// Date and time, or time of day, as text.
        Iso = (Family::Time, &["iso"], 1.0),
        NewtonMetre = (Family::Torque, &["N.m", "Nm", "N·m", "N*m", "N-m", "N m"], 1.0),
        NewtonCentimetre = (Family::Torque, &["N.cm", "Ncm", "N·cm"], 1e-2),
        NewtonMillimetre = (Family::Torque, &["N.mm", "Nmm", "N·mm"], 1e-3),
        MillinewtonMetre = (Family::Torque, &["mN.m", "mNm", "mN·m"], 1e-3),
        KilonewtonMetre = (Family::Torque, &["kN.m", "kNm", "kN·m"], 1e3),
        PoundInch = (Family::Torque, &["lbf.in", "in.lbf", "in-lb", "lb-in", "lbf-in"], POUND_FORCE_N * 0.0254),
        PoundFoot = (Family::Torque, &["lbf.ft", "ft.lbf", "ft-lb", "lb-ft", "lbf-ft"], POUND_FORCE_N * 0.3048),
        KilogramCentimetre = (Family::Torque, &["kgf.cm", "kg.cm"], KILOGRAM_FORCE_N * 1e-2),
        KilogramMetre = (Family::Torque, &["kgf.m", "kg.m"], KILOGRAM_FORCE_N),
        OunceInch = (Family::Torque, &["ozf.in", "oz.in", "oz-in"], POUND_FORCE_N / 16.0 * 0.0254),
        /// A: a current; its torque for an ampere has to be said.
        Ampere = (Family::Torque, &["A"], 1.0),
        /// mA, likewise.
        Milliampere = (Family::Torque, &["mA"], 1.0),
        /// V of a transducer, likewise.
        Volt = (Family::Torque, &["V"], 1.0),
        Celsius = (Family::Temperature, &["C", "°C", "degC"], 1.0),
        Kelvin = (Family::Temperature, &["K"], 1.0),
        Fahrenheit = (Family::Temperature, &["F", "°F", "degF"], 5.0 / 9.0),
    }
}

/// The kilogram-force, N: by definition, a kilogram times the standard acceleration, 9.806 65 m/s².
const KILOGRAM_FORCE_N: f64 = 9.806_65;
/// The pound-force, N: 0.453 592 37 kg (1959) times that.
const POUND_FORCE_N: f64 = 4.448_221_615_260_5;

/// The quantity that a unit measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Family {
    /// An angle.
    Angle,
    /// A time.
    Time,
    /// A torque, or a signal in proportion to one.
    Torque,
    /// A temperature.
    Temperature,
}

impl Family {
    /// Its units.
    pub(crate) fn units(self) -> impl Iterator<Item = Unit> {
        Unit::ALL.into_iter().filter(move |unit| unit.family() == self)
    }

    /// The refusal of a unit that is not one of its.
    pub(crate) fn refusal(self, unit: &str) -> String {
        let units: Vec<_> = self.units().map(Unit::name).collect();
        let hint = did_you_mean("; ", unit, units.iter().copied());
        format!("found the unit \"{unit}\", allowed: {}{hint}", units.join(", "))
    }
}

/// Words at the end of a name that are more often something else: `torque_min`, `q_d`.
const NOT_IN_NAMES: [&str; 6] = ["min", "h", "d", "F", "day", "iso"];

impl Unit {
    /// Units of angle that one may take for another, the largest name first that a slip of the pen takes for another.
    pub(crate) const ANGLES: [Unit; 5] = [Unit::Radian, Unit::Degree, Unit::Turn, Unit::Arcminute, Unit::Arcsecond];

    /// Units of a torque that have a size of their own.
    pub(crate) fn of_a_torque() -> impl Iterator<Item = Unit> {
        Family::Torque.units().filter(|unit| unit.needs_gain().is_none())
    }

    /// Its name in a mapping.
    pub fn name(self) -> &'static str {
        self.row().1[0]
    }

    /// Its size in the unit used inside: rad, s, N·m, °C.
    pub(crate) fn factor(self) -> f64 {
        self.row().2
    }

    /// The quantity that it measures.
    pub(crate) fn family(self) -> Family {
        self.row().0
    }

    /// Its zero in the unit used inside.
    pub(crate) fn zero(self) -> f64 {
        match self {
            Unit::Kelvin => -273.15,
            Unit::Fahrenheit => -160.0 / 9.0,
            _ => 0.0,
        }
    }

    /// A unit as it stands in a line of units, with or without brackets.
    pub(crate) fn in_brackets(field: &str) -> Option<Unit> {
        Unit::written(super::reader::unit_word(field))
    }

    /// The gain that has to be given with it, for a unit that has no size of its own.
    fn needs_gain(self) -> Option<&'static str> {
        match self {
            Unit::Count => Some("how many counts make a turn, for instance count/16777216"),
            Unit::Ampere | Unit::Milliampere => {
                Some("the torque at the output for one, for instance A*3.5 or mA*0.0035, or --torque-constant")
            }
            Unit::Volt => Some("the torque for a volt, for instance V*20"),
            _ => None,
        }
    }

    /// The unit that people write so, if it is one.
    pub(super) fn written(text: &str) -> Option<Unit> {
        Unit::ALL.into_iter().find(|unit| unit.row().1.contains(&text))
    }

    /// The text in brackets at the end of a name, known as a unit or not: `deg` of `Winkel [deg]`. A place in a list is
    /// none: `position[2]`.
    pub(crate) fn bracketed(column: &str) -> Option<&str> {
        let inside = |(open, close)| Some(column.trim_end().strip_suffix(close)?.rsplit_once(open)?.1.trim());
        let text = [('[', ']'), ('(', ')')].into_iter().find_map(inside)?;
        (!text.starts_with(|first: char| first.is_ascii_digit())).then_some(text).filter(|text| !text.is_empty())
    }

    /// The unit that a column is in if its name says it: `wave_gen_turn`, `error_arcsec`, `Winkel [deg]`, `load (Nm)`.
    pub(crate) fn in_name(column: &str) -> Option<Unit> {
        if let Some(text) = Unit::bracketed(column) {
            return Unit::written(text);
        }
        // `torque_kgf_cm`, `torque_knm`, `load_Lb_In`: all that a torque's unit may lack in a name is dots and case.
        let plain = |text: &str| text.chars().filter(char::is_ascii_alphabetic).collect::<String>().to_lowercase();
        let words = column.match_indices('_').map(|(at, _)| plain(&column[at..]));
        let of_torque =
            |word: String| Unit::of_a_torque().find(|unit| unit.row().1.iter().any(|text| plain(text) == word));
        let (_, word) = column.rsplit_once('_')?;
        let capital = if ["c", "k"].contains(&word) { &word.to_uppercase() } else { word };
        let written = Unit::written(capital).filter(|_| !NOT_IN_NAMES.contains(&word));
        written.or_else(|| words.filter_map(of_torque).next_back())
    }
}

shown_by_name!(Unit::name);

/// How a number of a column is read: `gain · number + offset` in a unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Unit of the result; a count is then a turn.
    pub unit: Unit,
    /// Factor of a number.
    pub gain: f64,
    /// Added to the product, in the unit.
    pub offset: f64,
}

impl Reading {
    /// A number as it stands, in a unit.
    pub fn of(unit: Unit) -> Reading {
        Reading { unit, gain: 1.0, offset: 0.0 }
    }

    /// A number in the unit used inside: rad, s, N·m, °C.
    pub fn value(&self, number: f64) -> f64 {
        (self.gain * number + self.offset) * self.unit.factor() + self.unit.zero()
    }

    /// The unit in which faults are looked for: a count divided is a turn.
    pub(crate) fn plain_unit(&self) -> Unit {
        if self.unit == Unit::Count { Unit::Turn } else { self.unit }
    }

    /// Reads `[-]unit` and any number of `*g`, `/g`, `+o`, `-o`, done from left to right; numbers may be `2^24`.
    /// `torque_per_ampere` stands in where a current has no gain.
    ///
    /// # Errors
    /// The text found and what is allowed.
    pub(crate) fn parse(text: &str, allowed: Family, torque_per_ampere: Option<f64>) -> Result<Reading, Refusal> {
        let text = text.trim();
        if let Some(unit) = Unit::written(text).filter(|unit| unit.family() == allowed) {
            return Reading::of(unit).complete(false, torque_per_ampere);
        }
        let (sign, rest) = text.strip_prefix('-').map_or((1.0, text), |rest| (-1.0, rest.trim_start()));
        let end = rest.find(['*', '/', '+', '-']).unwrap_or(rest.len());
        let word = rest[..end].trim();
        let unit = Unit::written(word)
            .filter(|unit| unit.family() == allowed)
            .ok_or_else(|| Refusal(allowed.refusal(word)))?;
        let (mut gain, mut offset, mut scaled) = (sign, 0.0, false);
        let mut rest = rest[end..].trim_start();
        while let Some(operator) = rest.chars().next() {
            let (number, after) = leading_number(rest[1..].trim_start()).ok_or_else(|| {
                Refusal(format!(
                    "found \"{rest}\" after the unit, allowed: *, /, + or - and a number, for instance count/16777216 \
                     or V*20-0.4"
                ))
            })?;
            match operator {
                '*' => (gain, offset, scaled) = (gain * number, offset * number, true),
                '/' => (gain, offset, scaled) = (gain / number, offset / number, true),
                '+' => offset += number,
                _ => offset -= number,
            }
            rest = after.trim_start();
        }
        if !(gain.is_finite() && offset.is_finite() && gain != 0.0) {
            return Err(Refusal(format!("found \"{text}\", allowed: a gain that is finite and not zero")));
        }
        Reading { unit, gain, offset }.complete(scaled, torque_per_ampere)
    }

    /// With the gain that a current has by `torque_per_ampere`, or the error that one is missing.
    fn complete(mut self, scaled: bool, torque_per_ampere: Option<f64>) -> Result<Reading, Refusal> {
        let Some(needs) = self.unit.needs_gain().filter(|_| !scaled) else { return Ok(self) };
        let ampere = match self.unit {
            Unit::Ampere => torque_per_ampere,
            Unit::Milliampere => torque_per_ampere.map(|torque| 1e-3 * torque),
            _ => None,
        };
        self.gain *= ampere.ok_or_else(|| Refusal(format!("{} needs a number: {needs}", self.unit)))?;
        Ok(self)
    }
}

/// A number at the beginning of a text, such as `1e-3` or `2^24`, and what follows it.
fn leading_number(text: &str) -> Option<(f64, &str)> {
    // The longest beginning that is one, of what numbers are written with: `inf` and `nan` are words.
    let plain = |text: &str| {
        let long = text.bytes().take_while(|byte| b"0123456789.+-eE".contains(byte)).count();
        (1..=long).rev().find_map(|end| Some((text[..end].parse::<f64>().ok()?, end)))
    };
    let (base, end) = plain(text)?;
    let rest = &text[end..];
    match rest.strip_prefix('^') {
        None => Some((base, rest)),
        Some(power) => plain(power).map(|(exponent, end)| (base.powf(exponent), &power[end..])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_convert() {
        for (unit, angle) in Unit::ANGLES.into_iter().zip([std::f64::consts::TAU, 360.0, 1.0, 21_600.0, 1_296_000.0]) {
            assert!((unit.factor() * angle - std::f64::consts::TAU).abs() < 1e-12, "{unit}");
        }
        let read =
            |text: &str, allowed: Family, number: f64| Reading::parse(text, allowed, None).unwrap().value(number);
        assert_eq!(read("K", Family::Temperature, 300.0), 300.0 - 273.15);
        assert!((read("F", Family::Temperature, 212.0) - 100.0).abs() < 1e-12);
        assert!((read("lbf.ft", Family::Torque, 1.0) - 1.355_817_948_331_400_4).abs() < 1e-12);
        assert!((read("min", Family::Time, 2.0) - 120.0).abs() < 1e-12);
        for unit in Unit::ALL {
            assert_eq!(Unit::written(unit.name()), Some(unit));
        }
    }

    #[test]
    fn a_reading_has_a_sign_a_gain_and_an_offset() {
        for (text, allowed, number, due) in [
            ("count/16777216", Family::Angle, 4_194_304.0, TAU / 4.0),
            ("-count/2^24", Family::Angle, 4_194_304.0, -TAU / 4.0),
            ("turn/100", Family::Angle, 50.0, TAU / 2.0),
            ("-deg", Family::Angle, 90.0, -TAU / 4.0),
            ("deg*2+10", Family::Angle, 40.0, TAU / 4.0),
            (" - mrad * 1e1 ", Family::Angle, 100.0, -1.0),
            ("Nm", Family::Torque, 2.0, 2.0),
            ("N.cm", Family::Torque, 200.0, 2.0),
            ("Nmm", Family::Torque, 2000.0, 2.0),
            ("gon", Family::Angle, 100.0, TAU / 4.0),
            ("V*20-0.5", Family::Torque, 0.1, 1.5),
            ("mA*0.0035", Family::Torque, 1000.0, 3.5),
            ("N-m", Family::Torque, 2.0, 2.0),
            ("us", Family::Time, 2e6, 2.0),
        ] {
            let reading = Reading::parse(text, allowed, None).unwrap_or_else(|wrong| panic!("{text}: {wrong:?}"));
            assert!((reading.value(number) - due).abs() < 1e-9, "{text}: {}", reading.value(number));
        }
        let amperes = Reading::parse("-mA", Family::Torque, Some(3.5)).unwrap();
        assert!((amperes.value(2000.0) + 7.0).abs() < 1e-9);
    }

    #[test]
    fn a_wrong_reading_says_what_is_missing() {
        for (text, allowed, said) in [
            ("count", Family::Angle, "counts make a turn"),
            ("A", Family::Torque, "--torque-constant"),
            ("deg*", Family::Angle, "found \"*\""),
            ("deg*0", Family::Angle, "not zero"),
            ("deg/0", Family::Angle, "finite"),
            ("deg*2x", Family::Angle, "after the unit"),
            ("grad", Family::Angle, "found the unit \"grad\", allowed: rad, deg"),
            ("deg", Family::Time, "found the unit \"deg\", allowed: s, ms"),
        ] {
            match Reading::parse(text, allowed, None) {
                Err(Refusal(what)) => assert!(what.contains(said), "{text}: {what}"),
                other => panic!("{text}: {other:?}"),
            }
        }
    }

    #[test]
    fn a_name_says_its_unit() {
        for (name, unit) in [
            ("wave_gen_turns", Unit::Turn),
            ("Winkel [°]", Unit::Degree),
            ("load (Nm)", Unit::NewtonMetre),
            ("torque_Nm", Unit::NewtonMetre),
            ("torque_n_m", Unit::NewtonMetre),
            ("torque_knm", Unit::KilonewtonMetre),
            ("load_kgf_cm", Unit::KilogramCentimetre),
            ("joint_torque_ozin", Unit::OunceInch),
            ("t_ms", Unit::Millisecond),
        ] {
            assert_eq!(Unit::in_name(name), Some(unit), "{name}");
        }
        assert_eq!(Unit::in_name("psi"), None);
    }
}
