//! kernel timing
use flexspline_sim::condense::Kernels;
use std::time::Instant;
fn main() {
    let k = Kernels::default();
    for (m, p) in [(66, 30), (54, 18), (80, 18), (24, 8), (100, 18)] {
        let mut a = vec![0.01; m * m];
        for i in 0..m { a[i * m + i] = 10.0; }
        let mut f = a.clone();
        let n = 20000;
        let t = Instant::now();
        for _ in 0..n { f.copy_from_slice(&a); assert!(k.eliminate(&mut f, m, p, 1.0)); }
        let dt = t.elapsed().as_secs_f64() / n as f64;
        let madds: f64 = (0..p).map(|c| { let r = (m - c) as f64; r * r / 2.0 }).sum();
        println!("{m} {p}: {:.2} us, {:.2} Gmadd/s", dt * 1e6, madds / dt * 1e-9);
    }
}
