//! Channels that were recorded more slowly than the angles: one value in several rows, nothing between.

use super::super::columns::Quantity;
use super::super::faults::straight;
use super::super::log::Log;

/// Share of the distances between values that are the usual one (one row more or less), at least: a slower clock, not
/// holes. *Guess*: a clock that is slower loses a value now and then.
const REGULAR: f64 = 0.9;
/// Fewest values that show a rhythm. *Guess*: fewer may be evenly spaced by chance.
const FEWEST: usize = 8;

/// Fills the rows between the values of slower channels by straight lines.
pub fn fill(log: &mut Log, notes: &mut Vec<String>) {
    for channel in [Quantity::Torque, Quantity::Temperature, Quantity::Orientation] {
        let Some(values) = log.get_mut(channel) else { continue };
        let Some(every) = rhythm(values) else { continue };
        let there: Vec<usize> = (0..values.len()).filter(|row| values[*row].is_finite()).collect();
        for pair in there.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            // Beyond two of its periods values are missing, as for any channel.
            if b - a <= 2 * every {
                straight(values, a, b);
            }
        }
        let (first, last) = (there[0], there[there.len() - 1]);
        let rows = values.len();
        for row in (first.saturating_sub(every)..first).chain(last + 1..rows.min(last + 1 + every)) {
            values[row] = values[if row < first { first } else { last }];
        }
        notes.push(format!(
            "the {channel} has a value in one of {every} rows: between them it is a straight line, at the ends it is \
             held"
        ));
    }
}

/// One value in how many rows, if they come regularly.
fn rhythm(values: &[f64]) -> Option<usize> {
    let there: Vec<usize> = (0..values.len()).filter(|row| values[*row].is_finite()).collect();
    if there.len() < FEWEST {
        return None;
    }
    let mut distances: Vec<usize> = there.windows(2).map(|pair| pair[1] - pair[0]).collect();
    distances.sort_unstable();
    let usual = distances[distances.len() / 2];
    let near = distances.iter().filter(|distance| distance.abs_diff(usual) <= 1).count();
    (usual >= 2 && near as f64 >= REGULAR * distances.len() as f64).then_some(usual)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slower_channel_is_told_from_holes() {
        let every = |n: usize| -> Vec<f64> { (0..400).map(|k| if k % n == 3 { k as f64 } else { f64::NAN }).collect() };
        assert_eq!(rhythm(&every(10)), Some(10));
        assert_eq!(rhythm(&every(200)), None);
        let holes: Vec<f64> = (0..400).map(|k| if k % 7 == 3 { f64::NAN } else { 1.0 }).collect();
        assert_eq!(rhythm(&holes), None);
        let mut log = Log::default();
        log.line = (0..400).collect();
        log.put(Quantity::Torque, every(10));
        let mut notes = Vec::new();
        fill(&mut log, &mut notes);
        let filled = log.get(Quantity::Torque).unwrap();
        assert!(filled.iter().all(|value| value.is_finite()));
        assert!((filled[8] - 8.0).abs() < 1e-12 && filled[0] == 3.0 && filled[399] == 393.0);
        assert_eq!(notes.len(), 1);
    }
}
