//! The lattice on which a channel's values lie: its resolution.

use flexspline_base::robust::median_of;

/// Rows looked at, in each of a few places. *Guess*: it bounds the time; steps show in far fewer.
const ROWS: usize = 4096;
/// A multiple of the step beyond which a gap between neighbouring values says nothing. *Guess*: at 50 steps an error of
/// the step of a per cent is half a step.
const FARTHEST: f64 = 50.0;
/// Mean distance of the gaps from whole multiples, in steps, that a lattice stays below; 0.25 is chance. *Guess*: a
/// third of that.
const WHOLE: f64 = 0.08;

/// The step of the lattice on which `values` lie, or `None` if they lie on none.
pub(in crate::measurement) fn lattice(values: &[f64]) -> Option<f64> {
    let places = (values.len() / ROWS).clamp(1, 5);
    let mut found: Vec<f64> = (0..places)
        .filter_map(|k| {
            let from = (values.len() - ROWS.min(values.len())) * k / places.max(2).saturating_sub(1).max(1);
            of_piece(&values[from.min(values.len())..(from + ROWS).min(values.len())])
        })
        .collect();
    // A piece in which few steps occur shows a multiple of the lattice; most pieces have to show one.
    (2 * found.len() > places).then(|| median_of(&mut found))
}

fn of_piece(values: &[f64]) -> Option<f64> {
    let mut sorted: Vec<f64> = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let range = sorted.last()? - sorted.first()?;
    let size = sorted.last()?.abs().max(sorted.first()?.abs());
    let least = (1e-9 * range).max(1e-13 * size);
    let mut gaps: Vec<f64> = sorted.windows(2).map(|v| v[1] - v[0]).filter(|gap| *gap > least).collect();
    gaps.sort_unstable_by(f64::total_cmp);
    let mut step = *gaps.first()?;
    let (mut kk, mut kg, mut off, mut count) = (0.0, 0.0, 0.0, 0);
    for gap in &gaps {
        let k = (gap / step).round();
        if k > FARTHEST {
            break;
        }
        off += (gap / step - k).abs();
        kk += k * k;
        kg += k * gap;
        count += 1;
        step = kg / kk;
    }
    // Few gaps do if each value occurs many times.
    let enough = count >= 8 || (count >= 2 && 20 * (gaps.len() + 1) <= values.len());
    (enough && off < WHOLE * f64::from(count)).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_of_a_lattice_is_found() {
        let mut random = fastrand::Rng::with_seed(2);
        for step in [4.8e-6, 1e-4, 0.7] {
            for moves in [0.3, 3.0] {
                let values: Vec<f64> = (0..30_000)
                    .map(|k| ((f64::from(k) * 0.1 * moves + 2.0 * random.f64()).round() * step * 1e8).round() / 1e8)
                    .collect();
                let found = lattice(&values).expect("a lattice");
                assert!((found / step - 1.0).abs() < 0.02, "{step} {moves}: {found}");
            }
        }
    }

    #[test]
    fn continuous_values_lie_on_none() {
        for seed in 0..200 {
            let mut random = fastrand::Rng::with_seed(seed);
            let values: Vec<f64> = (0..5_000).map(|k| f64::from(k) * 1e-4 + random.f64()).collect();
            assert_eq!(lattice(&values), None, "seed {seed}");
        }
    }

    #[test]
    fn nothing_and_a_constant_lie_on_none() {
        assert_eq!(lattice(&[]), None);
        assert_eq!(lattice(&[2.0; 500]), None);
    }
}
