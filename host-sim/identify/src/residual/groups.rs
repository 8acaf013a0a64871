//! Statistics of the residual, rows grouped by what the drive was doing.

use serde::Serialize;

use super::rows::Rows;
use crate::measurement::{least_and_most, median_and_std, quantile_of, sampled};

/// Statistics of some rows, arcsec.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Statistics {
    /// Rows.
    pub count: usize,
    /// Median.
    pub median_arcsec: f64,
    /// Mean.
    pub mean_arcsec: f64,
    /// Robust standard deviation: 1.4826 times the median distance from the median.
    pub spread_arcsec: f64,
    /// Root mean square about zero.
    pub rms_arcsec: f64,
    /// A twentieth of the rows lies below.
    pub low_arcsec: f64,
    /// A twentieth of the rows lies above.
    pub high_arcsec: f64,
}

impl Statistics {
    /// Of these values; `None` of none.
    pub fn of(values: &[f64]) -> Option<Statistics> {
        if values.is_empty() {
            return None;
        }
        let n = values.len() as f64;
        let mut some = sampled(values);
        let (low, high) = (quantile_of(&mut some, 0.05), quantile_of(&mut some, 0.95));
        let (median_arcsec, spread_arcsec) = median_and_std(&mut some);
        Some(Statistics {
            count: values.len(),
            median_arcsec,
            mean_arcsec: values.iter().sum::<f64>() / n,
            spread_arcsec,
            rms_arcsec: (values.iter().map(|value| value * value).sum::<f64>() / n).sqrt(),
            low_arcsec: low,
            high_arcsec: high,
        })
    }
}

/// Rows alike in one respect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Group {
    /// What they are: `forward`, `session 2`, or the range.
    pub label: String,
    /// Lower and upper end of the range, in the unit of the grouping; `None` where it is no range.
    pub range: Option<[f64; 2]>,
    /// Their residual.
    pub statistics: Statistics,
}

/// All rows, grouped in one respect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Grouping {
    /// By what: `direction`, `session`, `torque_n_m`, `temperature_c`, `generator_speed_rad_s`.
    pub by: &'static str,
    /// The groups, in order.
    pub groups: Vec<Group>,
}

pub(super) fn of(rows: &Rows) -> Vec<Grouping> {
    let mut all = vec![
        Grouping {
            by: "direction",
            groups: [(true, "forward"), (false, "backward")]
                .into_iter()
                .filter_map(|(forward, label)| group(rows, label.to_owned(), None, |row| rows.forward[row] == forward))
                .collect(),
        },
        Grouping {
            by: "session",
            groups: rows
                .starts
                .windows(2)
                .enumerate()
                .filter_map(|(number, bounds)| {
                    let statistics = Statistics::of(&rows.value[bounds[0]..bounds[1]])?;
                    Some(Group { label: format!("session {}", number + 1), range: None, statistics })
                })
                .collect(),
        },
    ];
    let columns = [
        ("torque_n_m", rows.column(|session| session.torque_n_m.as_ref()), 5),
        ("temperature_c", rows.column(|session| session.temperature_c.as_ref()), 5),
        ("generator_speed_rad_s", rows.speed(), 3),
    ];
    for (by, column, parts) in columns {
        if let Some(column) = column {
            all.push(Grouping { by, groups: by_quantiles(rows, &column, parts) });
        }
    }
    all
}

fn group(rows: &Rows, label: String, range: Option<[f64; 2]>, is_in: impl Fn(usize) -> bool) -> Option<Group> {
    let values: Vec<f64> = (0..rows.value.len()).filter(|row| is_in(*row)).map(|row| rows.value[row]).collect();
    Statistics::of(&values).map(|statistics| Group { label, range, statistics })
}

/// Parts with about as many rows each; fewer where values repeat.
fn by_quantiles(rows: &Rows, column: &[f64], parts: usize) -> Vec<Group> {
    let mut some = sampled(column);
    let (least, most) = least_and_most(column.iter().copied());
    let mut bounds = vec![least];
    for part in 1..parts {
        let bound = quantile_of(&mut some, part as f64 / parts as f64);
        if bound > bounds[bounds.len() - 1] && bound < most {
            bounds.push(bound);
        }
    }
    bounds.push(most);
    let last = bounds.len() - 2;
    (0..=last)
        .filter_map(|part| {
            let [from, to] = [bounds[part], bounds[part + 1]];
            let label = format!("{from:.3} to {to:.3}");
            group(rows, label, Some([from, to]), |row| {
                column[row] >= from && (column[row] < to || (part == last && column[row] <= to))
            })
        })
        .collect()
}
