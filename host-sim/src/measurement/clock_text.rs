//! Time written as text: `2026-11-22T14:05:00.25Z`, `22.11.2026 14:05:00,25`, `14:05:00.250`.

/// Seconds of a day.
pub(super) const DAY_S: f64 = 86_400.0;

/// A time written as text, s: since 1970 where a date is said, else since midnight. `None` if it is none.
pub(super) fn seconds(text: &str) -> Option<f64> {
    let text = text.trim();
    let (date, rest) = match text.find(['T', ' ']) {
        Some(at) if text.is_char_boundary(at) => (Some(&text[..at]), text[at + 1..].trim()),
        _ => (None, text),
    };
    let days = date.map_or(Some(0.0), days)?;
    let (clock, zone_s) = zone(rest)?;
    Some(days * DAY_S + of_day(clock)? - zone_s)
}

/// Whether a text is a time of day without a date.
pub(super) fn has_no_date(text: &str) -> bool {
    !text.trim().contains(['T', ' '])
}

/// `hh:mm[:ss[.f]]`, s.
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
            let plain = part.starts_with(|c: char| c.is_ascii_digit()) && !part.contains(['e', 'E']);
            part.parse::<f64>().ok().filter(|s| plain && *s < 61.0)?
        }
    };
    parts.next().is_none().then_some(hours * 3600.0 + minutes * 60.0 + seconds)
}

/// The clock without its zone, and how far the zone is ahead, s.
fn zone(text: &str) -> Option<(&str, f64)> {
    if let Some(clock) = text.strip_suffix('Z') {
        return Some((clock, 0.0));
    }
    let Some(at) = text.rfind(['+', '-']) else { return Some((text, 0.0)) };
    let (clock, zone) = text.split_at(at);
    let sign = if zone.starts_with('-') { -1.0 } else { 1.0 };
    let zone = &zone[1..];
    let ahead = if zone.contains(':') {
        of_day(zone)?
    } else {
        let number: f64 = zone.parse().ok().filter(|_| zone.len() == 2 || zone.len() == 4)?;
        if zone.len() == 2 { 3600.0 * number } else { 3600.0 * (number / 100.0).floor() + 60.0 * (number % 100.0) }
    };
    Some((clock, sign * ahead))
}

/// Days since 1970-01-01 of `2026-11-22`, `2026/11/22` or `22.11.2026`.
fn days(text: &str) -> Option<f64> {
    let separator = ['-', '/', '.'].into_iter().find(|c| text.contains(*c))?;
    let mut parts = text.split(separator).map(|part| part.parse::<i64>().ok());
    let (a, b, c) = (parts.next()??, parts.next()??, parts.next()??);
    // A day before its month is written with points; with strokes nobody can tell, so the year must come first.
    let (year, month, day) = if separator == '.' { (c, b, a) } else { (a, b, c) };
    let sound = (1900..=9999).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day);
    if !sound || parts.next().is_some() {
        return None;
    }
    // Days of the civil calendar, counted in years that begin in March: the leap day is then their last.
    let year = if month <= 2 { year - 1 } else { year };
    let (era, of_era) = (year.div_euclid(400), year.rem_euclid(400));
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let since = era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468;
    Some(since as f64)
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
            ("22.11.2026 14:05:00,25", 1_795_356_300.25),
            ("14:05:00.5", 50_700.5),
            ("14:05", 50_700.0),
        ] {
            assert_eq!(seconds(text), Some(due), "{text}");
        }
    }

    #[test]
    fn what_is_no_time_is_none() {
        for text in
            ["", "1.5", "12", "2026-11-22", "25:00:00", "12:61", "2026-13-01 00:00:00", "a:b", "11/22/2026 14:05:00"]
        {
            assert_eq!(seconds(text), None, "{text}");
        }
    }
}
