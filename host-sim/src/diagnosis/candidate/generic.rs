//! Deviations without a cause in the library. They compete with the causes: where one of them tells the data better, no cause is
//! named for it.

use super::{Excitation, Law, by_row, main};

fn law(name: &str, values: impl Fn(&Excitation<'_>, usize) -> f64 + Send + Sync + 'static) -> Law {
    let mut law = Law::new(name, move |on, _| {
        let column = by_row(on, |k| values(on, k));
        let size = super::super::rows::rms(&column).max(1e-12);
        vec![main(column.into_iter().map(|v| v / size).collect(), 20.0)]
    });
    law.named = false;
    law
}

fn wave(name: String, angle: fn(&Excitation<'_>, usize) -> f64, order: f64) -> Law {
    let mut law = Law::new(&name, move |on, _| {
        vec![
            main(by_row(on, |k| (order * angle(on, k)).cos()), 15.0),
            main(by_row(on, |k| (order * angle(on, k)).sin()), 15.0),
        ]
    });
    law.named = false;
    law
}

/// A line at any order of an angle or of time: `unit` is what it is counted against.
#[must_use]
pub fn line(unit: &str, order: f64) -> Law {
    let angle: fn(&Excitation<'_>, usize) -> f64 = match unit {
        "generator turn" => |on, k| on.rows.generator[k],
        "turn on the circular spline" => |on, k| on.rows.on_circular_spline[k],
        "output turn" => |on, k| on.rows.output[k],
        _ => |on, k| 2.0 * std::f64::consts::PI * on.rows.time[k],
    };
    wave(format!("line of {order:.4} per {unit}"), angle, order)
}

/// Everything without a name that is always tried.
#[must_use]
pub fn unnamed(on: &Excitation<'_>) -> Vec<Law> {
    let rows = on.rows;
    let mut laws = Vec::new();
    if rows.recorded.temperature {
        laws.push(law("offset with temperature", |on, k| on.rows.temperature[k] - on.nominal.temperature_c));
        laws.push(law("offset with temperature squared", |on, k| {
            (on.rows.temperature[k] - on.nominal.temperature_c).powi(2)
        }));
    }
    if rows.recorded.time {
        laws.push(law("offset with time", |on, k| on.rows.time[k] - on.rows.time[0]));
        let since = |rows: &super::super::rows::Rows| {
            let mut since = vec![0.0; rows.len()];
            for session in &rows.sessions {
                for k in session.clone() {
                    since[k] = rows.time[k] - rows.time[session.start];
                }
            }
            since
        };
        let since = since(rows);
        let again = since.clone();
        laws.push(law("creep since the session began (logarithm)", move |_, k| (1.0 + since[k]).ln()));
        laws.push(law("settling since the session began (exponential, 20 s)", move |_, k| (-again[k] / 20.0).exp()));
        laws.push(law("offset with the magnitude of speed", |on, k| on.rows.speed[k].abs()));
        laws.push(law("offset with speed squared", |on, k| on.rows.speed[k].powi(2)));
        laws.push(law("offset with speed squared, by direction", |on, k| {
            on.rows.speed[k].powi(2) * on.rows.direction[k]
        }));
    }
    laws.push(law("offset by direction", |on, k| on.rows.direction[k]));
    if on.load > 0.0 {
        laws.push(law("offset with the magnitude of torque", |on, k| on.rows.torque[k].abs()));
        laws.push(law("offset with torque squared", |on, k| on.rows.torque[k].powi(2)));
        laws.push(law("torque by direction", |on, k| on.rows.torque[k].abs() * on.rows.direction[k]));
        if rows.recorded.time {
            laws.push(law("wind-up with time", |on, k| on.base.wind_up[k] * (on.rows.time[k] - on.rows.time[0])));
        }
    }
    for order in [3.0, 5.0, 7.0, 8.0, 10.0, 12.0] {
        laws.push(line("generator turn", order));
    }
    for order in [2.0, 3.0] {
        laws.push(line("output turn", order));
    }
    laws
}
