//! Gauss-Legendre rules of any order.

/// Points and weights of the n-point rule on [-1, 1], ascending.
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .rev()
        .map(|i| {
            // Newton on the Legendre polynomial from the Chebyshev-like guess (Abramowitz and Stegun 22.16.6).
            let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut derivative = 1.0;
            for _ in 0..50 {
                let (mut p, mut previous) = (1.0, 0.0);
                for k in 0..n {
                    let next = ((2 * k + 1) as f64 * x * p - k as f64 * previous) / (k + 1) as f64;
                    previous = p;
                    p = next;
                }
                derivative = n as f64 * (x * p - previous) / (x * x - 1.0);
                let step = p / derivative;
                x -= step;
                if step.abs() < 1e-15 {
                    break;
                }
            }
            (x, 2.0 / ((1.0 - x * x) * derivative * derivative))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_integrate_polynomials_of_degree_2n_minus_1() {
        for n in 1..=20 {
            let rule = gauss_legendre(n);
            assert!(rule.windows(2).all(|w| w[0].0 < w[1].0));
            for degree in 0..2 * n {
                let integral: f64 = rule.iter().map(|(x, w)| w * x.powi(degree as i32)).sum();
                let exact = if degree % 2 == 0 { 2.0 / (degree as f64 + 1.0) } else { 0.0 };
                assert!((integral - exact).abs() < 1e-13, "n {n}, degree {degree}: {integral}");
            }
        }
    }
}
