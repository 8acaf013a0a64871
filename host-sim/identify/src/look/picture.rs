//! The result as text for a terminal.

use std::fmt::Write as _;

use super::{Looked, Role, TimeKind};

/// The result as text.
pub fn text(looked: &Looked) -> String {
    let mut text = String::new();
    let decimals = if looked.decimal_comma { ", decimal commas" } else { "" };
    let header = looked.header_line.map_or("no names".to_owned(), |line| format!("names in line {line}"));
    let _ = writeln!(
        text,
        "{}: {} rows in {} session{}; separator {}{decimals}; {header}",
        looked.files.join(", "),
        looked.rows,
        looked.sessions,
        if looked.sessions == 1 { "" } else { "s" },
        looked.separator
    );
    if looked.odd_rows > 0 {
        let _ = writeln!(text, "  {} rows are longer or shorter than the header", looked.odd_rows);
    }
    let _ = writeln!(text, "\n   #  column                    role         unit              sure   from … to");
    for (place, column) in looked.columns.iter().enumerate() {
        let role = serde_json::to_value(column.role).ok();
        let role = role.as_ref().and_then(|role| role.as_str()).unwrap_or_default();
        let range = if column.least <= column.most {
            format!("{:.6} … {:.6}", column.least, column.most)
        } else {
            "–".to_owned()
        };
        let _ = writeln!(
            text,
            "{} {:>2}  {:<24.24}  {:<11}  {:<16}  {:>3.0} %  {range}",
            if column.used { '*' } else { ' ' },
            place + 1,
            column.name,
            if column.role == Role::Unknown { "?" } else { role },
            column.unit.as_deref().unwrap_or("?"),
            100.0 * column.confidence
        );
        if !column.why.is_empty() {
            let _ = writeln!(text, "        {}", column.why.join("; "));
        }
    }
    text.push('\n');
    let time = match looked.time {
        TimeKind::Measured => "time: measured, stamps of a clock",
        TimeKind::Counted => "time: counted, every step the same: stalls and lost rows cannot be seen in it",
        TimeKind::None => "time: none (--rate HZ if the rows come at a rate)",
    };
    let period = looked.period_s.map_or(String::new(), |period| format!("; {:.6} s from row to row", period));
    let _ = writeln!(text, "{time}{period}");
    if let (Some(found), Some(proposed)) = (looked.ratio_found, looked.ratio_proposed) {
        let _ = writeln!(text, "ratio: {found:.3} in the rows, {proposed} proposed");
    }
    if let Some(coverage) = &looked.coverage {
        let [forward, backward, still] = coverage.directions;
        let _ = writeln!(
            text,
            "turns: {:.2} of the generator, {:.3} of the output; {:.0} % forward, {:.0} % backward, {:.0} % at rest",
            coverage.generator_turns,
            coverage.output_turns,
            100.0 * forward,
            100.0 * backward,
            100.0 * still
        );
        if let Some([low, high]) = coverage.torque_n_m {
            let _ = writeln!(text, "torque: {low:.3} to {high:.3} N·m, positive where it turns the output forward");
        }
        if let Some([low, high]) = coverage.temperature_c {
            let _ = writeln!(text, "temperature: {low:.1} to {high:.1} C");
        }
        if let Some([median, most]) = coverage.speed_rpm {
            let _ = writeln!(text, "generator speed: {median:.2} rpm median, {most:.2} rpm at most");
        }
    }
    for note in &looked.notes {
        let _ = writeln!(text, "note: {note}");
    }
    text
}
