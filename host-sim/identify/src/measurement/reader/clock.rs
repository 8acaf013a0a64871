//! Time written as text: `2026-11-22T14:05:00.25Z`, `22.11.2026 14:05:00,25`, `05/04/2025 11:59:50.000 AM`,
//! `25 May 2025 14:05`, `20250504T142611`, `14:05:00.250`.

use jiff::civil::Date;

/// Seconds of a day.
pub(in crate::measurement) const DAY_S: f64 = 86_400.0;
/// Beginnings of the names of months, English and German where it differs.
const MONTHS: [(&str, i8); 17] = [
    ("jan", 1),
    ("feb", 2),
    ("mar", 3),
    ("mär", 3),
    ("mrz", 3),
    ("apr", 4),
    ("may", 5),
    ("mai", 5),
    ("jun", 6),
    ("jul", 7),
    ("aug", 8),
    ("sep", 9),
    ("oct", 10),
    ("okt", 10),
    ("nov", 11),
    ("dec", 12),
    ("dez", 12),
];

/// Which of two numbers before a year is the day, where neither is above twelve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Order {
    /// 25/5/2025
    #[default]
    DayFirst,
    /// 5/25/2025
    MonthFirst,
}

/// A time that was read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stamp {
    /// s since 1970-01-01 where a date is said, else since midnight.
    pub seconds: f64,
    /// Whether a date is said.
    pub has_date: bool,
    /// Whether it is in universal time or says how far from it.
    pub has_zone: bool,
}

/// A time written as text, s: since 1970 where a date is said, else since midnight. `None` if it is none.
pub(in crate::measurement) fn seconds(text: &str) -> Option<f64> {
    stamp(text, Order::default()).map(|stamp| stamp.seconds)
}

/// A time written as text.
pub(super) fn stamp(text: &str, order: Order) -> Option<Stamp> {
    let text = text.trim();
    if !text.as_bytes().first()?.is_ascii_alphanumeric() {
        return None;
    }
    if !text.contains(':') {
        return compact(text);
    }
    // The date, if there is one, stands on either side of the clock.
    let clock_ends = |from: usize| text[from..].find([' ', '\t']).map_or(text.len(), |at| from + at);
    let colon = text.find(':')?;
    let begins = text[..colon].rfind([' ', '\t', 'T', '_']).map_or(0, |at| at + 1);
    let (before, clock, after) = (
        text[..begins].trim_end_matches(['T', ' ', '\t', '_', ',']),
        &text[begins..clock_ends(begins)],
        text[clock_ends(begins)..].trim(),
    );
    let (clock, zone_s) = zone(clock)?;
    let (mut half_day_s, mut zone_s, mut date) = (None, zone_s, before.trim().to_owned());
    for word in after.split_whitespace() {
        match word.to_ascii_lowercase().replace('.', "").as_str() {
            "am" => half_day_s = Some(0.0),
            "pm" => half_day_s = Some(0.5 * DAY_S),
            "utc" | "gmt" | "z" => zone_s = Some(0.0),
            other => match zone(word) {
                Some(("", Some(ahead))) => zone_s = Some(ahead),
                // The name of a zone (CET, PST): all stamps of a log have the same, or the clock is set back, which is
                // looked for.
                _ if (3..=5).contains(&other.len())
                    && other.bytes().all(|b| b.is_ascii_alphabetic())
                    && month(other).is_none() => {}
                _ => date = format!("{date} {word}"),
            },
        }
    }
    let mut of_day = of_day(clock)?;
    if let Some(half) = half_day_s {
        if !(3600.0..13.0 * 3600.0).contains(&of_day) {
            return None;
        }
        of_day = of_day % (0.5 * DAY_S) + half;
    }
    let days = if date.is_empty() { 0.0 } else { days(&date, order)? };
    let seconds = days * DAY_S + of_day - zone_s.unwrap_or(0.0);
    Some(Stamp { seconds, has_date: !date.is_empty(), has_zone: zone_s.is_some() })
}

/// Whether a text is a date without a time.
pub(super) fn is_date(text: &str) -> bool {
    !text.contains(':') && days(text, Order::default()).is_some()
}

/// Which number is the day in these dates: what one above twelve shows, else as where half days are counted (`AM`),
/// else the day first.
pub(super) fn order<'a>(texts: impl Iterator<Item = &'a str>) -> Order {
    let mut found = Order::DayFirst;
    for text in texts.filter(|text| text.contains('/')) {
        let mut numbers = text.split(|c: char| !c.is_ascii_digit()).map(|part| part.parse::<u32>().unwrap_or(0));
        match (numbers.next(), numbers.next()) {
            (Some(first), _) if (13..=31).contains(&first) => return Order::DayFirst,
            (Some(1..=12), Some(second)) if (13..=31).contains(&second) => return Order::MonthFirst,
            _ => {}
        }
        let last = text.trim_end().trim_end_matches('.');
        if last.ends_with(['M', 'm']) {
            found = Order::MonthFirst;
        }
    }
    found
}

/// `hh:mm[:ss[.f]]` or `hh:mm:ss:fff`, s.
fn of_day(text: &str) -> Option<f64> {
    let mut parts = text.split(':');
    let whole = |part: &str, most: f64| {
        let digits = (1..=2).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit());
        part.parse::<f64>().ok().filter(|value| digits && *value <= most)
    };
    let hours = whole(parts.next()?, 24.0)?;
    let minutes = whole(parts.next()?, 59.0)?;
    let seconds = match parts.next() {
        None => 0.0,
        Some(part) => {
            let part = part.replace(',', ".");
            let plain = part.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.') && !part.starts_with('.');
            part.parse::<f64>().ok().filter(|s| plain && *s < 61.0)?
        }
    };
    let part = match parts.next() {
        None => 0.0,
        Some(part) if seconds.fract() == 0.0 && part.len() <= 9 && part.bytes().all(|b| b.is_ascii_digit()) => {
            part.parse::<f64>().ok()? / 10f64.powi(i32::try_from(part.len()).ok()?)
        }
        Some(_) => return None,
    };
    parts.next().is_none().then_some(hours * 3600.0 + minutes * 60.0 + seconds + part)
}

/// The clock without its zone, and how far the zone is ahead, s, where it is said.
fn zone(text: &str) -> Option<(&str, Option<f64>)> {
    if let Some(clock) = text.strip_suffix(['Z', 'z']) {
        return Some((clock, Some(0.0)));
    }
    let Some(at) = text.rfind(['+', '-']) else { return Some((text, None)) };
    let (clock, zone) = text.split_at(at);
    let sign = if zone.starts_with('-') { -1.0 } else { 1.0 };
    let zone = &zone[1..];
    let ahead = if zone.contains(':') {
        of_day(zone)?
    } else {
        let number: f64 = zone.parse().ok().filter(|_| zone.len() == 2 || zone.len() == 4)?;
        if zone.len() == 2 { 3600.0 * number } else { 3600.0 * (number / 100.0).floor() + 60.0 * (number % 100.0) }
    };
    Some((clock, Some(sign * ahead)))
}

/// `20250504T142611[.25][Z]`: date and clock without signs between.
fn compact(text: &str) -> Option<Stamp> {
    let (date, clock) = text.split_once(['T', '_'])?;
    let (clock, zone_s) = zone(clock)?;
    let digits = |text: &str, from: usize, to: usize| {
        text.get(from..to).filter(|part| part.bytes().all(|byte| byte.is_ascii_digit()))?.parse::<i16>().ok()
    };
    let sound = date.len() == 8
        && (clock.len() == 6 || clock.as_bytes().get(6).is_some_and(|byte| matches!(byte, b'.' | b',')));
    if !sound {
        return None;
    }
    let days = days_of(digits(date, 0, 4)?, digits(date, 4, 6)?, digits(date, 6, 8)?)?;
    let written = format!("{}:{}:{}", &clock[..2], clock.get(2..4)?, clock.get(4..)?);
    let seconds = days * DAY_S + of_day(&written)? - zone_s.unwrap_or(0.0);
    Some(Stamp { seconds, has_date: true, has_zone: zone_s.is_some() })
}

/// Days since 1970-01-01 of `2026-11-22`, `2026/11/22`, `22.11.2026`, `22/11/2026`, `22-Nov-2026`, `Nov 22, 2026`.
fn days(text: &str, order: Order) -> Option<f64> {
    let parts: Vec<&str> = text
        .split(['-', '/', '.', ' ', ','])
        .filter(|part| !part.is_empty())
        .filter(|part| !is_weekday(part))
        .collect();
    let [a, b, c] = parts.as_slice() else { return None };
    let number = |part: &str| part.parse::<i16>().ok().filter(|_| part.bytes().all(|byte| byte.is_ascii_digit()));
    let year = |part: &str| number(part).map(|year| if part.len() == 2 { 2000 + year } else { year });
    if let Some(month) = month(b) {
        return days_of(year(c)?, month, number(a)?);
    }
    if let Some(month) = month(a) {
        return days_of(year(c)?, month, number(b)?);
    }
    if a.len() == 4 {
        return days_of(number(a)?, number(b)?, number(c)?);
    }
    let (a, b, c) = (number(a)?, number(b)?, year(c)?);
    // With strokes the month may come first; with points and lines it does not.
    let month_first = text.contains('/') && (b > 12 || (order == Order::MonthFirst && a <= 12));
    if month_first { days_of(c, a, b) } else { days_of(c, b, a) }
}

fn is_weekday(word: &str) -> bool {
    let word = word.to_ascii_lowercase();
    ["mon", "tue", "wed", "thu", "fri", "sat", "sun"].iter().any(|day| word.starts_with(day))
        && word.bytes().all(|byte| byte.is_ascii_alphabetic())
        && month(&word).is_none()
}

fn month(word: &str) -> Option<i16> {
    let word = word.to_lowercase();
    if !word.chars().all(char::is_alphabetic) {
        return None;
    }
    MONTHS.iter().find(|(name, _)| word.starts_with(name)).map(|(_, month)| i16::from(*month))
}

fn days_of(year: i16, month: i16, day: i16) -> Option<f64> {
    let date = Date::new(year, i8::try_from(month).ok()?, i8::try_from(day).ok()?).ok().filter(|_| year >= 1900)?;
    let since = date.since(Date::constant(1970, 1, 1)).ok()?;
    Some(f64::from(since.get_days()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_as_they_are_written() {
        for (text, due) in [
            ("1970-01-01T00:00:00Z", 0.0),
            ("2000-03-01 00:00:00", 951_868_800.0),
            ("2026-11-22T14:05:00.25Z", 1_795_356_300.25),
            ("2026-11-22T15:05:00.25+01:00", 1_795_356_300.25),
            ("2026-11-22T15:05:00.25+0100", 1_795_356_300.25),
            ("2026-11-22 15:05:00.25 +0100", 1_795_356_300.25),
            ("22.11.2026 14:05:00,25", 1_795_356_300.25),
            ("11/22/2026 02:05:00.25 PM", 1_795_356_300.25),
            ("11/22/2026 2:05:00.25 p.m.", 1_795_356_300.25),
            ("22/11/2026 14:05:00.25", 1_795_356_300.25),
            ("22-Nov-2026 14:05:00.25", 1_795_356_300.25),
            ("Sun Nov 22, 2026 14:05:00.25 UTC", 1_795_356_300.25),
            ("20261122T140500.25Z", 1_795_356_300.25),
            ("20261122_140500", 1_795_356_300.0),
            ("14:05:00.25 22.11.2026", 1_795_356_300.25),
            ("14:05:00:250", 50_700.25),
            ("12:00:01 AM", 1.0),
            ("12:00:01 PM", 43_201.0),
            ("14:05:00.5", 50_700.5),
            ("14:05", 50_700.0),
        ] {
            assert_eq!(seconds(text), Some(due), "{text}");
        }
    }

    #[test]
    fn what_is_no_time_is_none() {
        for text in [
            "",
            "1.5",
            "12",
            "2026-11-22",
            "25:00:00",
            "12:61",
            "2026-13-01 00:00:00",
            "2026-02-30 00:00:00",
            "a:b",
            "state: 5",
            "13:05:00 PM",
            "0:05:00 AM",
        ] {
            assert_eq!(seconds(text), None, "{text}");
        }
        assert!(is_date("2026-11-22") && is_date("22.11.26") && !is_date("1.5") && !is_date("14:05:00"));
    }

    #[test]
    fn the_day_is_found_by_what_is_no_month() {
        let day = |texts: &[&str]| order(texts.iter().copied());
        assert_eq!(day(&["05/04/2025 11:59:50 AM"]), Order::MonthFirst);
        assert_eq!(day(&["05/04/2025 11:59:50", "13/04/2025 11:59:50"]), Order::DayFirst);
        assert_eq!(day(&["05/04/2025 11:59:50", "05/14/2025 11:59:50"]), Order::MonthFirst);
        let first = |order| stamp("05/04/2025 12:00", order).unwrap().seconds;
        assert_eq!(first(Order::DayFirst) - first(Order::MonthFirst), -29.0 * DAY_S);
    }
}
