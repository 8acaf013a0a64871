//! The order of rows by their stamps: newest first, unsorted.

use flexspline_base::robust::{median_of, sampled};

/// Share of the steps that fall where rows stand from the newest to the oldest. *Guess*: between them sessions may
/// begin.
const FALLING: f64 = 0.9;
/// Share of the rows that are out of order in a file without order: a clock that is set back, or a stray stamp, is
/// seldom. *Guess*.
const UNSORTED: f64 = 0.05;
/// Sorted rows are those of one clock if this share of their steps is within half of the usual one. *Guess*.
const EVEN: f64 = 0.8;
/// Fewest steps that show an order. *Guess*: fewer may fall by chance.
const FEWEST: usize = 8;

/// The order of the rows by their stamps where they do not stand in it, and what is to be said of that.
pub fn order(time: &[f64]) -> Option<(Vec<usize>, String)> {
    let finite: Vec<usize> = (0..time.len()).filter(|row| time[*row].is_finite()).collect();
    let steps: Vec<f64> = finite.windows(2).map(|pair| time[pair[1]] - time[pair[0]]).collect();
    let falls = steps.iter().filter(|step| **step < 0.0).count();
    let moves = steps.iter().filter(|step| **step != 0.0).count();
    if moves < FEWEST || (falls as f64) < UNSORTED * moves as f64 {
        return None;
    }
    if falls as f64 >= FALLING * moves as f64 {
        let what = "the rows stand from the newest to the oldest: they are turned round".to_owned();
        return Some(((0..time.len()).rev().collect(), what));
    }
    let mut sorted = finite;
    sorted.sort_by(|a, b| time[*a].total_cmp(&time[*b]));
    let steps: Vec<f64> = sorted.windows(2).map(|pair| time[pair[1]] - time[pair[0]]).collect();
    let usual = median_of(&mut sampled(&steps));
    let even = steps.iter().filter(|step| (**step - usual).abs() <= 0.5 * usual).count();
    let of_one_clock = usual > 0.0 && even as f64 >= EVEN * steps.len() as f64;
    of_one_clock.then(|| {
        let what = format!("the rows do not stand in the order of their time ({falls} run back): they are sorted");
        (sorted, what)
    })
}
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_put_in_order() {
        let time: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
        assert_eq!(order(&time), None);
        let newest: Vec<f64> = time.iter().rev().copied().collect();
        assert_eq!(order(&newest).unwrap().0[0], 199);
        // Written by two threads: pairs are exchanged.
        let mixed: Vec<f64> = (0..200).map(|k| time[k ^ 1]).collect();
        let sorted = order(&mixed).unwrap().0;
        assert!(sorted.iter().map(|row| mixed[*row]).eq(time.iter().copied()));
        // Sessions that begin at zero are not mixed.
        let sessions: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k % 12)).collect();
        assert_eq!(order(&sessions), None);
        let stray: Vec<f64> = (0..200).map(|k| if k == 70 { 5.0 } else { time[k] }).collect();
        assert_eq!(order(&stray), None);
    }
}
