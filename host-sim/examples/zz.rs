use flexspline_sim::{drive::*, mesh::MeshLevel, stepping::*, turns::*};
use std::ops::ControlFlow;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let drive = Drive::from_toml("x", &std::fs::read_to_string(&a[1]).unwrap()).unwrap();
    let t: f64 = a[2].parse().unwrap();
    let n: usize = a[3].parse().unwrap();
    let mesh: MeshLevel = a[4].parse().unwrap();
    let pitch = std::f64::consts::TAU / 188.0;
    let places: Vec<f64> = (0..n).map(|k| ((k as f64 + 0.5) / n as f64 * 95.0 * 188.0).round() * pitch).collect();
    let its = std::sync::Mutex::new(vec![]);
    let c = std::time::Instant::now();
    let e = errors_over_turns(
        &drive,
        GeneratorKind::Cam,
        t,
        &places,
        SolverSettings { method: Method::Fast, mesh, ..Default::default() },
        &|p| {
            its.lock().unwrap().push(p.iterations);
            ControlFlow::Continue(())
        },
    );
    match e {
        Err(e) => println!("ERR {e}"),
        Ok(e) => {
            let m = e.iter().cloned().fold(f64::MIN, f64::max);
            let l = e.iter().cloned().fold(f64::MAX, f64::min);
            println!("pp {:.3}\" mean {:.4}", (m - l) * 206264.8, e.iter().sum::<f64>() / n as f64 * 206264.8);
        }
    }
    let its = its.lock().unwrap();
    println!("{:?} total {} in {:.1}s", &its[..], its.iter().sum::<usize>(), c.elapsed().as_secs_f64());
}
