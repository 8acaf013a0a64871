use flexspline_sim::drive::{Drive, GeneratorKind};
use flexspline_sim::mesh::*;
use flexspline_sim::stepping::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let kind: GeneratorKind = a[1].parse().unwrap();
    let level: MeshLevel = a[2].parse().unwrap();
    let torque: f64 = a[3].parse().unwrap();
    let steps: usize = a[4].parse().unwrap();
    let dpsi: f64 = a[5].parse().unwrap();
    let ev = |n: &str, d: f64| std::env::var(n).ok().map_or(d, |x| x.parse().unwrap());
    let settings = SolverSettings {
        mesh: level,
        bore_penalty: std::env::var("BP").ok().map(|x| x.parse().unwrap()),
        flank_penalty: ev("FP", 5e7),
        tolerance: ev("TOL", 1e-6),
        bore_points: std::env::var("BN").ok().map(|x| x.parse().unwrap()),
        ..Default::default()
    };
    let p = Problem::new(&Drive::hhd_95(), kind, 20.0, settings).unwrap();
    println!(
        "dof {} fs el {} cs el {}",
        p.degrees_of_freedom(),
        p.flexspline.elements.len(),
        p.circular_spline.elements.len()
    );
    let mut s = Solver::new(&p);
    let t = std::time::Instant::now();
    let r = s.deform(0.0);
    let (mut st, inc) = match r {
        Ok(x) => x,
        Err(e) => {
            println!("{e}");
            return;
        }
    };
    println!("deform {:?} {inc:?}", t.elapsed());
    if torque != 0.0 {
        let t = std::time::Instant::now();
        match s.increment(&st, 0.0, torque) {
            Ok((n, inc)) => {
                st = n;
                println!("load {:?} it {}", t.elapsed(), inc.iterations);
            }
            Err(e) => {
                println!("{e}");
                return;
            }
        }
    }
    let as_ = 206264.806;
    println!("out {:.6} arcsec", st.output_rad * as_);
    let n = (steps as f64 * dpsi.signum()) as i64;
    let _ = n;
    let report = |st: &State| {
        let (mut mx, mut my, mut n, mut asym) = (0.0, 0.0, 0.0, 0.0_f64);
        let nps = p.flexspline.nodes_per_sector;
        let half = p.flexspline.teeth / 2;
        for (i, x) in p.flexspline.nodes.iter().enumerate() {
            if x[0].hypot(x[1]) < p.flexspline.base_radius + 1e-6 {
                mx += st.u[2 * i];
                my += st.u[2 * i + 1];
                n += 1.0;
            }
            let j = (i + half * nps) % p.flexspline.nodes.len();
            asym = asym.max((st.u[2 * i] + st.u[2 * j]).abs()).max((st.u[2 * i + 1] + st.u[2 * j + 1]).abs());
        }
        println!("   mean bore shift {:.3e} {:.3e} point asymmetry {asym:.3e}", mx / n, my / n);
    };
    report(&st);
    for i in 1..=steps {
        let t = std::time::Instant::now();
        let e0 = s.effort;
        let psi = dpsi * i as f64;
        match s.increment(&st, psi, torque) {
            Ok((n, inc)) => {
                st = n;
                report(&st);
                println!(
                    "{i} psi {psi:.5} err {:.7} arcsec it {} fl {} gen {} Mg {:.7} balance {:.1e} res {:.1e} pk {:?} t {:?} asm {:?} con {:?} ana {:?} fac {:?} sol {:?}",
                    (st.output_rad - psi / 95.0) * as_,
                    inc.iterations,
                    inc.flank_contacts,
                    inc.generator_contacts,
                    inc.generator_torque_n_m,
                    inc.flank_torque_n_m + inc.drag_torque_n_m + torque,
                    inc.residual,
                    inc.peak_pressure_mpa,
                    t.elapsed(),
                    s.effort.assembly - e0.assembly,
                    s.effort.contact - e0.contact,
                    s.effort.analysis - e0.analysis,
                    s.effort.factorisation - e0.factorisation,
                    s.effort.solution - e0.solution
                );
            }
            Err(e) => {
                println!("{e}");
                return;
            }
        }
    }
}
