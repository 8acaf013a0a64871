//! Time written as text: ISO 8601 (`2026-11-22T14:05:00.25Z`, `14:05:00.250`) and the usual forms of day, month and
//! half days.

use jiff::Timestamp;
use jiff::civil::{DateTime, Time};
use jiff::fmt::strtime;

/// Seconds of a day, by definition.
pub(in crate::measurement) const DAY_S: f64 = 86_400.0;
/// Forms other than those of ISO 8601. Of two that read the same text the first is taken: with AM and PM the month
/// stands first, else the day.
const FORMS: [&str; 9] = [
    "%d.%m.%Y %H:%M:%S%.f",
    "%m/%d/%Y %I:%M:%S%.f %p",
    "%d/%m/%Y %I:%M:%S%.f %p",
    "%d/%m/%Y %H:%M:%S%.f",
    "%m/%d/%Y %H:%M:%S%.f",
    "%Y/%m/%d %H:%M:%S%.f",
    "%d-%b-%Y %H:%M:%S%.f",
    "%Y-%m-%d %I:%M:%S%.f %p",
    "%I:%M:%S%.f %p",
];

/// The form of a column of times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TimeForm {
    /// ISO 8601.
    Iso,
    /// As `strptime` reads it.
    Written(&'static str),
}

/// A time that was read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stamp {
    /// s since 1970-01-01 where a date is said, else since midnight.
    pub seconds: f64,
    /// Whether a date is said.
    pub has_date: bool,
}

/// A time in ISO 8601, s: since 1970 where a date is said, else since midnight. `None` if it is none.
pub(in crate::measurement) fn seconds(text: &str) -> Option<f64> {
    TimeForm::Iso.read(text).map(|stamp| stamp.seconds)
}

/// The form in which all of these texts, at least one, are times.
pub(super) fn form<'a>(texts: impl Iterator<Item = &'a str> + Clone) -> Option<TimeForm> {
    let timely = |text: &str| text.contains([':', 'T']) && text.starts_with(|c: char| c.is_ascii_digit());
    if !texts.clone().next().is_some_and(timely) {
        return None;
    }
    let forms = std::iter::once(TimeForm::Iso).chain(FORMS.into_iter().map(TimeForm::Written));
    forms.into_iter().find(|form| texts.clone().all(|text| form.read(text).is_some()))
}

/// Whether a text is a date without a time.
pub(super) fn is_date(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_digit()) && form([format!("{text} 00:00:00").as_str()].into_iter()).is_some()
}

impl TimeForm {
    /// A time in this form.
    pub fn read(self, text: &str) -> Option<Stamp> {
        // A comma before decimals is one of ISO 8601 as well, but not of `strptime`.
        match self {
            TimeForm::Iso => iso(text),
            TimeForm::Written(form) => {
                let read = strtime::parse(form, text.replace(',', ".")).ok()?;
                match read.to_datetime() {
                    Ok(at) => Some(of_date(at)),
                    Err(_) if !form.contains("%Y") => Some(of_day(read.to_time().ok()?)),
                    Err(_) => None,
                }
            }
        }
    }
}

fn iso(text: &str) -> Option<Stamp> {
    if let Ok(at) = text.parse::<Timestamp>() {
        return Some(Stamp { seconds: at.as_duration().as_secs_f64(), has_date: true });
    }
    if let Ok(at) = text.parse::<DateTime>() {
        // A date alone is no time.
        return text.contains([':', 'T']).then(|| of_date(at));
    }
    text.contains(':').then(|| text.parse().ok().map(of_day)).flatten()
}

fn of_day(time: Time) -> Stamp {
    Stamp { seconds: time.duration_since(Time::midnight()).as_secs_f64(), has_date: false }
}

fn of_date(at: DateTime) -> Stamp {
    Stamp { seconds: at.duration_since(DateTime::constant(1970, 1, 1, 0, 0, 0, 0)).as_secs_f64(), has_date: true }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<f64> {
        form([text].into_iter())?.read(text).map(|stamp| stamp.seconds)
    }

    #[test]
    fn times_are_read_as_they_are_written() {
        for (text, due) in [
            ("1970-01-01T00:00:00Z", 0.0),
            ("2000-03-01 00:00:00", 951_868_800.0),
            ("2026-11-22T14:05:00.25Z", 1_795_356_300.25),
            ("2026-11-22T15:05:00.25+01:00", 1_795_356_300.25),
            ("2026-11-22T15:05:00.25+0100", 1_795_356_300.25),
            ("22.11.2026 14:05:00,25", 1_795_356_300.25),
            ("11/22/2026 02:05:00.25 PM", 1_795_356_300.25),
            ("22/11/2026 14:05:00.25", 1_795_356_300.25),
            ("22-Nov-2026 14:05:00.25", 1_795_356_300.25),
            ("20261122T140500.25Z", 1_795_356_300.25),
            ("12:00:01 AM", 1.0),
            ("12:00:01 PM", 43_201.0),
            ("14:05:00.5", 50_700.5),
        ] {
            assert_eq!(read(text), Some(due), "{text}");
        }
    }

    #[test]
    fn what_is_no_time_is_none() {
        for text in ["", "1.5", "12", "2026-11-22", "25:00:00", "12:61", "2026-13-01 00:00:00", "a:b", "state: 5"] {
            assert_eq!(read(text), None, "{text}");
        }
        for text in ["2026-02-30 00:00:00", "13:05:00 PM"] {
            assert_eq!(read(text), None, "{text}");
        }
        assert!(is_date("2026-11-22") && is_date("22.11.2026") && !is_date("1.5") && !is_date("14:05:00"));
    }

    #[test]
    fn the_day_is_found_by_what_is_no_month() {
        let first = |texts: &[&str]| form(texts.iter().copied()).unwrap().read(texts[0]).unwrap().seconds;
        let (may, april) = (first(&["05/04/2025 11:59:50 AM"]), first(&["05/04/2025 11:59:50"]));
        assert_eq!(april - may, -29.0 * DAY_S + 0.0);
        assert_eq!(first(&["05/04/2025 11:59:50", "13/04/2025 11:59:50"]), april);
        assert_eq!(first(&["05/04/2025 11:59:50", "05/14/2025 11:59:50"]), may);
    }
}
