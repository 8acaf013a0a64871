//! The covariance as `U·D·Uᵀ`: columns of `U` above its diagonal, which is 1, and `D`.

pub(super) fn dot<const N: usize>(a: &[f32; N], b: &[f32; N]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `Uᵀ·h`.
pub(super) fn transform<const N: usize>(u: &[[f32; N]; N], h: &[f32; N]) -> [f32; N] {
    let mut f = *h;
    for (j, (f, column)) in f.iter_mut().zip(u).enumerate() {
        *f += column.iter().zip(h).take(j).map(|(u, h)| u * h).sum::<f32>();
    }
    f
}

/// `U·D·Uᵀ + a·aᵀ` (Agee and Turner).
pub(super) fn wander_by<const N: usize>(d: &mut [f32; N], u: &mut [[f32; N]; N], mut a: [f32; N]) {
    let mut share = 1.0;
    for (j, (d, column)) in d.iter_mut().zip(u).enumerate().rev() {
        let own = a.get(j).copied().unwrap_or(0.0);
        let sum = *d + share * own * own;
        // Neither variance nor wandering: nothing to change.
        if sum > 0.0 {
            let by = share * own / sum;
            for (a, u) in a.iter_mut().zip(column).take(j) {
                *a -= own * *u;
                *u += by * *a;
            }
            share *= *d / sum;
            *d = sum;
        }
    }
}

/// `Σ dᵢ·fᵢ²`: the variance of `h·x`, of `Uᵀ·h` and `D`, or of `h` and a diagonal covariance.
pub(super) fn spread_of<const N: usize>(f: &[f32; N], d: &[f32; N]) -> f32 {
    f.iter().zip(d).map(|(f, d)| d * f * f).sum()
}

/// One measurement with this row and noise (Bierman); returns the gains.
pub(super) fn measure<const N: usize>(d: &mut [f32; N], u: &mut [[f32; N]; N], row: &[f32; N], noise: f32) -> [f32; N] {
    let f = transform(u, row);
    let mut gains = [0.0; N];
    let mut spread = noise;
    for (j, ((d, column), f)) in d.iter_mut().zip(u).zip(f).enumerate() {
        let own = *d * f;
        let (before, back) = (spread, -f / spread);
        spread += own * f;
        *d *= before / spread;
        for (gain, u) in gains.iter_mut().zip(column).take(j) {
            let above = *u;
            *u += *gain * back;
            *gain += above * own;
        }
        if let Some(gain) = gains.get_mut(j) {
            *gain = own;
        }
    }
    gains.map(|gain| gain / spread)
}
