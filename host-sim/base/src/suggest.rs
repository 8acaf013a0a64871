//! Suggestions for misspelt names: one rule for keys, columns, effects, generators and units.
//!
//! Case and the signs between words do not count. A known name is suggested if it differs by at most one letter in
//! three (Damerau and Levenshtein: letters changed, left out, put in, exchanged), has its words cut short, in another
//! order or but for the unit at the end, or if one of the two is a whole word of the other at its beginning or end.
//! Anything farther is no suggestion: a wrong one costs more than none.

use strsim::damerau_levenshtein;
use thiserror::Error;

/// A name that is none of those known.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "{what} \"{found}\": allowed are {}{}", known.join(", "), did_you_mean("; ", found, known.iter().copied())
)]
pub struct UnknownName {
    /// Kind of the named thing.
    pub what: &'static str,
    /// The name.
    pub found: String,
    /// The names that there are.
    pub known: &'static [&'static str],
}

/// Shortest word that stands for the longer name it begins or ends.
const SHORTEST_WORD: usize = 3;

/// Letters of the longest unit that ends a name, `arcsec`.
const LONGEST_UNIT: usize = 6;

/// Letters of a name beyond which it is no name (a guess): a quote that nobody closed makes a file of one, and
/// comparing takes the product of the letters of both.
const LONGEST_NAME: usize = 200;

/// The name of `known` that `found` is likely to mean; `None` if it is one of them, or like none.
pub fn likeliest<'k>(found: &str, known: impl IntoIterator<Item = &'k str>) -> Option<&'k str> {
    let meant = words(found);
    known
        .into_iter()
        .filter(|name| found.len().max(name.len()) <= LONGEST_NAME)
        .filter_map(|name| Some((distance(&meant, &words(name))?, name)))
        .min_by_key(|(far, _)| *far)
        .and_then(|(_, name)| (name != found).then_some(name))
}

/// The path of `known`, `section.key`, that `found` is likely to mean: the same key in a section like the one found, or
/// one there that goes on where it ends; the same key in any other; else a key like it.
pub fn likeliest_path<'k>(found: &str, known: &[&'k str]) -> Option<&'k str> {
    fn split(path: &str) -> (&str, &str) {
        path.rsplit_once('.').unwrap_or(("", path))
    }
    let (section, key) = split(found);
    let sections = || known.iter().map(|path| split(path).0);
    let at = |section: &str, key: &str| known.iter().copied().find(|path| split(path) == (section, key));
    let anywhere = |key: &str| known.iter().copied().find(|path| split(path).1 == key);
    let meant = if sections().any(|known| known == section) { Some(section) } else { likeliest(section, sections()) };
    meant
        .and_then(|section| {
            let goes_on = |path: &&str| split(path).1.strip_prefix(key).is_some_and(|rest| rest.starts_with('_'));
            at(section, key).or_else(|| known.iter().copied().find(|path| split(path).0 == section && goes_on(path)))
        })
        .or_else(|| anywhere(key))
        .or_else(|| {
            let section = meant?;
            let keys = known.iter().map(|path| split(path)).filter(|(of, _)| *of == section).map(|(_, key)| key);
            at(section, likeliest(key, keys)?)
        })
        .or_else(|| anywhere(likeliest(key, known.iter().map(|path| split(path).1))?))
}

/// `` did you mean `…`? `` behind `before`, or nothing.
pub fn did_you_mean<'k>(before: &str, found: &str, known: impl IntoIterator<Item = &'k str>) -> String {
    likeliest(found, known).map_or_else(String::new, |name| before.to_owned() + &question(name))
}

/// Begin and end of a suggestion in a message.
pub const MARKS: [&str; 2] = ["did you mean `", "`?"];

/// `` did you mean `name`? ``
pub fn question(name: &str) -> String {
    format!("{}{name}{}", MARKS[0], MARKS[1])
}

/// The words of a name, in small letters.
fn words(name: &str) -> Vec<String> {
    name.to_lowercase().split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).map(str::to_owned).collect()
}

/// How far two names are apart: letters that differ, and which rule found it; `None` if nobody would mean the one by
/// the other.
fn distance(found: &[String], known: &[String]) -> Option<(usize, usize)> {
    let (a, b) = (found.concat(), known.concat());
    if a.is_empty() || b.is_empty() {
        return None;
    }
    let letters = a.chars().count().max(b.chars().count());
    let apart = damerau_levenshtein(&a, &b);
    if apart == 0 {
        return Some((0, 0));
    }
    let begins = |a: &String, b: &String| a == b || (a.len() >= SHORTEST_WORD && b.starts_with(a.as_str()));
    if known.len() > 1 && found.len() == known.len() && found.iter().zip(known).all(|(a, b)| begins(a, b)) {
        return Some((1, 1));
    }
    // The same in another unit.
    let unit = |words: &[String]| words.last().is_some_and(|word| word.len() <= LONGEST_UNIT);
    let besides_unit =
        known.len() > 1 && found.len() == known.len() && found[..found.len() - 1] == known[..known.len() - 1];
    if besides_unit && unit(found) && unit(known) {
        return Some((apart, 1));
    }
    // A name of two letters is another name as soon as one of them differs.
    if letters > 2 && apart <= (letters / 3).max(1) {
        return Some((apart, 0));
    }
    let sorted = |words: &[String]| {
        let mut words = words.to_vec();
        words.sort();
        words.concat()
    };
    let reordered = damerau_levenshtein(&sorted(found), &sorted(known));
    if found.len() > 1 && found.len() == known.len() && reordered <= letters / 6 {
        return Some((reordered, 2));
    }
    let (short, long) = if a.len() < b.len() { (&a, known) } else { (&b, found) };
    let is_short = |part: &[String]| part.concat() == *short;
    let first_words = short.len() > 1 && (1..long.len()).any(|k| is_short(&long[..k]));
    let last_words = (1..long.len()).any(|k| is_short(&long[k..]));
    let beginning = long.len() == 1 && long[0].starts_with(short.as_str());
    let there = first_words || (short.len() >= SHORTEST_WORD && (last_words || beginning));
    there.then_some((apart, 3))
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: [&str; 23] = [
        "flanks.friction_coefficient",
        "flexspline.teeth",
        "flexspline.module_mm",
        "generator.w0_mm",
        "temperature.maximum_c",
        "as_built.circular_spline_eccentricity_um",
        "two-roller",
        "four-roller",
        "double-disc",
        "cam",
        "HHD-95",
        "HHD-95-typical",
        "generator_rad",
        "torque_n_m",
        "phase_rad",
        "temperature_c",
        "backlash_growth",
        "torsional_hysteresis",
        "arcsec",
        "N.m",
        "deg",
        "s",
        "K",
    ];

    #[test]
    fn misspelt_names_are_recognised() {
        for (found, meant) in [
            ("flanks.friction_coeficient", "flanks.friction_coefficient"),
            ("flank.friction_coefficient", "flanks.friction_coefficient"),
            ("flexspline.teeht", "flexspline.teeth"),
            ("Flexspline.Teeth", "flexspline.teeth"),
            ("flexspline.module", "flexspline.module_mm"),
            ("generator.w0", "generator.w0_mm"),
            ("w0_mm", "generator.w0_mm"),
            ("temperature.max_c", "temperature.maximum_c"),
            ("as_built.circular_spline_excentricity_um", "as_built.circular_spline_eccentricity_um"),
            ("two_roller", "two-roller"),
            ("tworoller", "two-roller"),
            ("four-rollers", "four-roller"),
            ("double disk", "double-disc"),
            ("disc-double", "double-disc"),
            ("disc", "double-disc"),
            ("CAM", "cam"),
            ("cams", "cam"),
            ("hhd95", "HHD-95"),
            ("HHD-96", "HHD-95"),
            ("HHD-95-typcal", "HHD-95-typical"),
            ("typical", "HHD-95-typical"),
            ("generator", "generator_rad"),
            ("torque_nm", "torque_n_m"),
            ("temperature_kelvin", "temperature_c"),
            ("phase_deg", "phase_rad"),
            ("torque", "torque_n_m"),
            ("temprature_c", "temperature_c"),
            ("growth_backlash", "backlash_growth"),
            ("torsional_histeresis", "torsional_hysteresis"),
            ("arcseconds", "arcsec"),
            ("Nm", "N.m"),
            ("degrees", "deg"),
            ("k", "K"),
        ] {
            assert_eq!(likeliest(found, KNOWN), Some(meant), "{found}");
        }
    }

    #[test]
    fn garbage_gets_no_suggestion_and_neither_does_a_known_name() {
        for found in
            ["", "_", "x", "m", "qwertz", "gearbox", "cog", "42", "foo.bar", "speed", "lubricant", "drive", "--"]
        {
            assert_eq!(likeliest(found, KNOWN), None, "{found}");
        }
        assert_eq!(likeliest("cam", KNOWN), None);
        let file = "generator_rad ".repeat(100_000);
        assert_eq!((likeliest(&file, KNOWN), likeliest("generator", [file.as_str()])), (None, None));
        assert_eq!(did_you_mean("; ", "cma", KNOWN), "; did you mean `cam`?");
        assert_eq!(did_you_mean("; ", "gearbox", KNOWN), "");
    }
}
