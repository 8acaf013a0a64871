//! Where a curve of known orders is sampled.

/// How many even places over a turn are enough, within bounds, so that no order (waves in the turn) folds onto another:
/// they stay apart by `apart`. A prime; the most that are allowed, where none of them separates the orders.
pub fn places_that_tell_apart(orders: &[f64], [least, most]: [usize; 2], apart: f64) -> usize {
    let tells_apart = |count: &usize| {
        let fold = |order: &f64| (order - (order / *count as f64).round() * *count as f64).abs();
        let mut folded: Vec<f64> = orders.iter().map(fold).collect();
        folded.sort_by(f64::total_cmp);
        folded.windows(2).all(|pair| pair[1] - pair[0] > apart)
    };
    let is_prime = |count: &usize| (2..).take_while(|k| k * k <= *count).all(|k| !count.is_multiple_of(k));
    (least..=most).filter(is_prime).find(tells_apart).unwrap_or(most)
}
