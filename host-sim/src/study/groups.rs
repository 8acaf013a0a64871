//! Which variants are computed from nothing, and which begin where those around them show.

use flexspline_algebra::{Mat, cholesky};

/// Variants that lead, at most: their trails are held in memory.
const MOST_LEADERS: usize = 32;
/// Values of a field of words are further apart than all fields of numbers together: there are at most 32.
const WORDS_APART: f64 = 100.0;
/// Fields that change the numbers of nodes: nothing can be shown from one value to another.
const OF_MESHES: [&str; 2] = ["flexspline.teeth", "circular_spline.teeth"];
/// What not meeting the place of a variant costs against using leaders that are far, and the distance below which all are as near. Guesses
/// that make the weights those of a plane through the nearest.
const PLANE: f64 = 1e4;
const AS_NEAR: f64 = 1e-3;
/// Largest weight of a leader; a plane that needs more is not gone on.
const LARGEST_WEIGHT: f64 = 2.5;

/// The places of variants in the space of their fields.
pub struct Places(Vec<Vec<f64>>);

impl Places {
    /// Of the values of all variants: numbers as a share of their range, words far apart.
    pub fn new(fields: &[&str], variants: &[Vec<String>]) -> Places {
        let of_field = |(field, path): (usize, &&str)| -> Vec<f64> {
            let words: Vec<&str> = variants.iter().map(|values| values[field].as_str()).collect();
            let numbers: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
            match numbers.filter(|_| !OF_MESHES.contains(path)) {
                Some(numbers) => {
                    let low = numbers.iter().copied().fold(f64::INFINITY, f64::min);
                    let high = numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                    let range = if high > low { high - low } else { 1.0 };
                    numbers.into_iter().map(|number| (number - low) / range).collect()
                }
                None => {
                    let first = |word: &str| words.iter().position(|other| *other == word).unwrap_or(0);
                    words.iter().map(|word| WORDS_APART * first(word) as f64).collect()
                }
            }
        };
        let by_field: Vec<Vec<f64>> = fields.iter().enumerate().map(of_field).collect();
        Places((0..variants.len()).map(|k| by_field.iter().map(|field| field[k]).collect()).collect())
    }

    fn apart(&self, a: usize, b: usize) -> f64 {
        self.0[a].iter().zip(&self.0[b]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    }

    /// The variants that lead: as many as the square root of their number, each as far from those before as there is one (Gonzalez 1985).
    pub fn leaders(&self) -> Vec<usize> {
        let all = self.0.len();
        let count = ((all as f64).sqrt().ceil() as usize).min(MOST_LEADERS);
        let mut leaders = Vec::new();
        let mut nearest = vec![f64::INFINITY; all];
        let mut next = (all > 0).then_some(0);
        while let Some(leader) = next.filter(|_| leaders.len() < count) {
            leaders.push(leader);
            nearest.iter_mut().enumerate().for_each(|(k, near)| *near = near.min(self.apart(k, leader)));
            // The first of those furthest from every leader.
            let furthest = (0..all).reduce(|a, b| if nearest[b] > nearest[a] { b } else { a });
            next = furthest.filter(|k| nearest[*k] > 0.0);
        }
        leaders
    }

    /// How much each of `leaders` shows to a variant: weights of the plane through the nearest of them; nothing where all are far.
    pub fn weights(&self, leaders: &[usize], variant: usize) -> Vec<(usize, f64)> {
        let fields = self.0[variant].len();
        let mut near: Vec<(usize, f64)> = leaders
            .iter()
            .enumerate()
            .map(|(k, leader)| (k, self.apart(*leader, variant)))
            .filter(|(_, apart)| *apart < 0.5 * WORDS_APART)
            .collect();
        near.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        near.truncate(2 * fields + 2);
        let Some(&(nearest, _)) = near.first() else { return Vec::new() };
        let beside = |k: usize| self.0[leaders[near[k].0]].iter().zip(&self.0[variant]).map(|(a, b)| a - b);
        let matrix = Mat::from_fn(near.len(), near.len(), |i, j| {
            let own = if i == j { near[i].1.powi(2) + AS_NEAR.powi(2) } else { 0.0 };
            own + PLANE * beside(i).zip(beside(j)).map(|(a, b)| a * b).sum::<f64>()
        });
        let ones = Mat::from_fn(near.len(), 1, |_, _| 1.0);
        let alone = vec![(nearest, 1.0)];
        let Ok(factor) = cholesky(matrix.as_ref()) else { return alone };
        let solved = factor.solve(ones.as_ref());
        let sum: f64 = (0..near.len()).map(|k| solved[(k, 0)]).sum();
        let weights: Vec<(usize, f64)> =
            near.iter().enumerate().map(|(k, (leader, _))| (*leader, solved[(k, 0)] / sum)).collect();
        if weights.iter().all(|(_, weight)| weight.abs() < LARGEST_WEIGHT) { weights } else { alone }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(fields: &[&str], values: &[&[&str]]) -> Places {
        let variants: Vec<Vec<String>> =
            values.iter().map(|row| row.iter().map(|v| (*v).to_owned()).collect()).collect();
        Places::new(fields, &variants)
    }

    #[test]
    fn leaders_are_far_apart_and_each_once() {
        let line: Vec<Vec<String>> = (0..9).map(|k| vec![k.to_string()]).collect();
        assert_eq!(Places::new(&["a"], &line).leaders(), [0, 8, 4]);
        assert_eq!(places(&["a"], &[&["1"], &["1"], &["1"], &["1"]]).leaders(), [0]);
        assert_eq!(Places::new(&["a"], &[]).leaders(), [0; 0]);
    }

    /// What is straight in the fields is met by the weights, between the leaders and a little beyond.
    #[test]
    fn weights_meet_what_is_straight() {
        let all = places(
            &["a", "b"],
            &[&["0", "0"], &["1", "0"], &["0", "2"], &["1", "2"], &["0.3", "1.1"], &["0.9", "0.1"]],
        );
        let leaders = [0, 1, 2, 3];
        let straight = |place: &[f64]| 7.0 + 3.0 * place[0] - 5.0 * place[1];
        for variant in [4, 5] {
            let weights = all.weights(&leaders, variant);
            let met: f64 = weights.iter().map(|(k, weight)| weight * straight(&all.0[leaders[*k]])).sum();
            assert!((met - straight(&all.0[variant])).abs() < 0.01, "{met}: {weights:?}");
            assert!((weights.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn words_and_teeth_show_nothing_to_others() {
        let words = places(&["kind", "a"], &[&["cup", "1"], &["hat", "1.1"], &["cup", "9"]]);
        assert_eq!(words.weights(&[0], 2).len(), 1);
        assert_eq!(words.weights(&[1], 2), []);
        let teeth = places(&["flexspline.teeth"], &[&["200"], &["202"]]);
        assert_eq!(teeth.weights(&[0], 1), []);
    }
}
