//! Beside the library, not in it: within it, faer would be compiled once more for these tests.

use std::f64::consts::TAU;

use flexspline_algebra::{Complex, Mat, NotPositiveDefinite, cholesky, product, spectrum};

/// Entries that look random, and twice as many rows as columns.
fn tall(columns: usize) -> Mat {
    let mut random = fastrand::Rng::with_seed(3);
    Mat::from_fn(2 * columns, columns, |_, _| random.f64() - 0.5)
}

#[test]
fn a_factor_solves_what_it_was_made_of() {
    let a = tall(30);
    let square = product(a.transpose(), a.as_ref());
    let factor = cholesky(square.as_ref()).unwrap();
    let identity = product(square.as_ref(), factor.inverse().as_ref());
    let solved = product(square.as_ref(), factor.solve(a.transpose()).as_ref());
    for i in 0..30 {
        for j in 0..30 {
            assert!((identity[(i, j)] - f64::from(u8::from(i == j))).abs() < 1e-12);
            assert!((solved[(i, j)] - a[(j, i)]).abs() < 1e-12);
        }
    }
}

#[test]
fn what_is_not_positive_definite_is_refused() {
    let flat = Mat::from_fn(3, 3, |_, _| 1.0);
    let negative = Mat::from_fn(3, 3, |i, j| if i == j { -1.0 } else { 0.0 });
    assert_eq!(cholesky(negative.as_ref()).err(), Some(NotPositiveDefinite));
    assert_eq!(cholesky(flat.as_ref()).err(), Some(NotPositiveDefinite));
}

#[test]
fn a_wave_stands_where_it_belongs() {
    for length in [48_usize, 75] {
        let wave: Vec<f64> = (0..length).map(|n| 0.5 + 3.0 * (TAU * 7.0 * n as f64 / length as f64).sin()).collect();
        let sums = spectrum(&mut wave.clone());
        for (k, sum) in sums.iter().enumerate() {
            let due = match k {
                0 => Complex::new(0.5, 0.0),
                7 => Complex::new(0.0, -1.5),
                _ => Complex::default(),
            };
            assert!((sum / length as f64 - due).norm() < 1e-13, "{length}, {k}: {sum}");
        }
    }
}
