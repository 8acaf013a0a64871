//! probe
use flexspline_sim::drive::{Drive, GeneratorKind};
use flexspline_sim::mesh::MeshLevel;
use flexspline_sim::stepping::{Method, Problem, Solver, SolverSettings};
use cpu_time::ProcessTime as Instant0;
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let kind: GeneratorKind = args[1].parse().unwrap();
    let torque: f64 = args[2].parse().unwrap();
    let n: usize = args[3].parse().unwrap();
    let mesh: MeshLevel = args[4].parse().unwrap();
    let mut outs = vec![];
    for method in [Method::Fast, Method::Reference] {
        if args.len() > 5 && method == Method::Reference { continue; }
        let t = Instant::now();
        let problem = Problem::new(&Drive::hhd_95(), kind, 20.0, SolverSettings { method, mesh, ..Default::default() }).unwrap();
        println!("{method:?} problem {:.3} s dof {}", t.elapsed().as_secs_f64(), problem.degrees_of_freedom());
        let t = Instant::now();
        let mut solver = Solver::new(&problem);
        let (mut state, inc) = solver.deform(0.0).unwrap();
        println!("deform {:.3} s  it {} out {:.4}", t.elapsed().as_secs_f64(), inc.iterations, (state.output_rad) * 206264.806);
        let mut list = vec![];
        if torque != 0.0 {
            let t = Instant::now();
            let (s, inc) = solver.increment(&state, 0.0, torque).unwrap();
            println!("load {:.3} s  it {} out {:.4}  compl {:.6e} peak {:?}", t.elapsed().as_secs_f64(), inc.iterations, (s.output_rad) * 206264.806, inc.compliance_rad_per_n_m, inc.peak_pressure_mpa);
            state = s;
            list.push(state.output_rad * 206264.806);
        }
        let mut before = solver.effort; let mut cpu = Instant0::now();
        let mut t = Instant::now();
        let mut its = 0;
        for k in 1..=2*n {
            if k == n + 1 { let e = solver.effort; println!("first half: {:.2} factors, {:.1} it, cpu {:.2} ms", (e.factorisations - before.factorisations) as f64 / n as f64, its as f64 / n as f64, cpu.elapsed().as_secs_f64() * 1e3 / n as f64); before = e; cpu = Instant0::now(); t = Instant::now(); its = 0; }
            let (s, inc) = solver.increment(&state, 0.01 * k as f64, torque).unwrap();
            its += inc.iterations;
            state = s;
            list.push((state.output_rad - state.generator_rad / 95.0) * 206264.806);
            if k <= 3 { println!("  it {} err {:.4} torque {:.5} flanks {} bore {} res {:.1e}", inc.iterations, list.last().unwrap(), inc.generator_torque_n_m, inc.flank_contacts, inc.generator_contacts, inc.residual); }
        }
        let e = solver.effort;
        let ms = |a: std::time::Duration, b: std::time::Duration| (b - a).as_secs_f64() * 1e3 / n as f64;
        println!("{:.2} factors; cpu {:.2} ms; per increment {:.2} ms, {:.1} it: assembly {:.2} contact {:.2} analysis {:.2} factor {:.2} solve {:.2}", (e.factorisations - before.factorisations) as f64 / n as f64, cpu.elapsed().as_secs_f64() * 1e3 / n as f64, t.elapsed().as_secs_f64() * 1e3 / n as f64, its as f64 / n as f64, ms(before.assembly, e.assembly), ms(before.contact, e.contact), ms(before.analysis, e.analysis), ms(before.factorisation, e.factorisation), ms(before.solution, e.solution));
        outs.push(list);
    }
    if outs.len() == 2 {
        let d = outs[0].iter().zip(&outs[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("largest difference {d:.5} arcsec; ranges {:?}", outs[1].last());
    }
}
