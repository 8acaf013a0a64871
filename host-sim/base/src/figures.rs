//! Figures of a result in words: one list, which the terminal and the page of a command both print.

use std::fmt::Write as _;

/// A number of a result with its name and unit.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedFigure {
    /// Its name.
    pub name: String,
    /// Its value, in `unit`.
    pub value: f64,
    /// Its unit, as a terminal prints it: `arcsec`, `N·m`; empty for a number alone.
    pub unit: &'static str,
    /// Decimals on a terminal.
    pub decimals: usize,
    /// A remark that belongs to the value; may be empty.
    pub caveat: String,
    /// What it is; may be empty.
    pub what: String,
}

/// The figures for a terminal, a line each.
pub fn lines(figures: &[NamedFigure]) -> String {
    let mut text = String::new();
    for NamedFigure { name, value, unit, decimals, caveat, .. } in figures {
        let comma = if unit.is_empty() || caveat.is_empty() { "" } else { ", " };
        let _ = writeln!(text, "  {name:<36} {value:>12.decimals$} {unit}{comma}{caveat}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_is_a_line_with_its_unit_and_its_caveat() {
        let figure = |unit, caveat: &str| NamedFigure {
            name: "backlash".to_owned(),
            value: 23.4567,
            unit,
            decimals: 2,
            caveat: caveat.to_owned(),
            what: String::new(),
        };
        let text = lines(&[figure("arcsec", "without load"), figure("", "of 30")]);
        let words: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(words[0], ["backlash", "23.46", "arcsec,", "without", "load"]);
        assert_eq!(words[1], ["backlash", "23.46", "of", "30"]);
    }
}
