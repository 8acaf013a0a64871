//! x
use flexspline_sim::closed_loop::{map::DenseMap, flight::{*, gear::Gear, antenna::*, profile::*}};
use flexspline_sim::drive::{Drive, GeneratorKind};
use flexspline_sim::sweep::rated_torque_n_m;
use flexspline_sim::{samples, tables};
use std::path::Path;
fn make(dir: &str, kind: GeneratorKind) {
    use flexspline_sim::stepping::*;
    use tables::ARCSEC_PER_RAD;
    let drive = Drive::hhd_95();
    let settings = SolverSettings { method: Method::Fast, ..SolverSettings::default() };
        let t = std::time::Instant::now();
        let map = match DenseMap::compute(&drive, kind, rated_torque_n_m(kind), settings) { Ok(m)=>m, Err(e)=>{println!("{kind}: {e}"); return} };
        println!("{kind}: {:?}", t.elapsed());
        std::fs::write(format!("{dir}/{kind}.csv"), map.to_csv()).unwrap();
        let gear = Gear::new(map.view(), 23.0);
        let problem = Problem::new(&drive, kind, 23.0, settings).unwrap();
        let mut solver = Solver::new(&problem);
        let (mut state, _) = solver.deform(0.1).unwrap();
        let mut rng = fastrand::Rng::with_seed(3);
        let (mut worst, mut sum, mut n)=(0.0f64,0.0,0);
        let t = std::time::Instant::now();
        let mut inc=0;
        for k in 0..40 {
            let f = rated_torque_n_m(kind)*((k as f64+rng.f64())/40.0).powi(4)+ 1e-3;
            state = solver.increment(&state, state.generator_rad, f+0.02).unwrap().0;
            for j in 0..8 {
                state = solver.increment(&state, state.generator_rad+0.003+0.004*rng.f64(), f+0.02).unwrap().0; inc+=2;
                if j<1 || state.output_rate<0.5/95.0 {continue}
                let e = state.output_rad-state.generator_rad/95.0;
                let d = (gear.elastic_error_rad(state.generator_rad, f, 1.0)-e)*ARCSEC_PER_RAD;
                if d.abs()>0.2 {println!("F {f:.5} psi {:.4} fem {:.3} diff {d:.3}", state.generator_rad, e*ARCSEC_PER_RAD)}
                worst=worst.max(d.abs()); sum+=d*d; n+=1;
            }
        }
        println!("   worst {worst:.4} rms {:.4} n {n} {:?} inc {inc}", (sum/n as f64).sqrt(), t.elapsed());
}
fn main() {
    let drive = Drive::hhd_95();
    let dir = std::env::args().nth(1).unwrap();
    if let Some(kind) = std::env::args().nth(2) {
        for kind in kind.split(',') { make(&dir, kind.parse().unwrap()); }
        return;
    }
    for kind in GeneratorKind::ALL {
        let file = format!("{dir}/{kind}.csv");
        let Ok(text) = std::fs::read_to_string(&file) else { println!("no {file}"); continue };
        let map = DenseMap::parse(kind, &file, &text).unwrap();
        let path = format!("tests/firmware/samples/{kind}.samples.csv");
        let bytes = std::fs::read(&path).unwrap();
        let s = samples::read(Path::new(&path)).unwrap();
        let table = tables::from_samples(&drive, kind, &s, "x", &bytes, Default::default()).unwrap();
        for (name, profile) in [("full", ANTENNA), ("brief", BRIEF)] {
        let t = std::time::Instant::now();
        let largest = rated_torque_n_m(kind);
        let plants = std::array::from_fn(|_| Gear::new(map.view(), 0.0));
        let mean = profile.moments(largest).map(|m| m.torque_n_m).sum::<f64>() / f64::from(profile.ticks());
        let mut antenna = Antenna::new(&table.image, plants, largest, mean, 0.0).unwrap();
        let mut out = String::from("t,target,rate,torque,unc,sign,mean,torq,core,held,corr\n");
        use std::fmt::Write;
        for m in profile.moments(largest) {
            let p = antenna.tick(&m);
            let e = p.errors_rad.map(|e| e * tables::ARCSEC_PER_RAD);
            writeln!(out, "{:.3},{:.7},{:.6},{:.4},{:.3},{:.3},{:.3},{:.3},{:.4},{},{:.3}", m.time_s, m.target_rad, m.rate_rad_s, m.torque_n_m, e[0],e[1],e[2],e[3],e[4], p.held_back as u8, f64::from(antenna.core.out.unwrap().correction_rad)*tables::ARCSEC_PER_RAD).unwrap();
        }
        println!("{kind} {name} {:?}", t.elapsed());
        std::fs::write(format!("{dir}/{kind}-{name}.run.csv"), out).unwrap();
        for (name, s) in CONTROLLERS.iter().zip(antenna.scores()) {
            println!("  {name:24} whole {:9.3} {:9.3}  free {:9.3} {:9.3} ({:.3})  steady {:9.3} {:9.3}  free {:9.3} {:9.3}", s.whole.rms_arcsec(), s.whole.max_arcsec(), s.free.rms_arcsec(), s.free.max_arcsec(), 1.0-f64::from(s.free.count())/f64::from(s.whole.count()), s.steady.rms_arcsec(), s.steady.max_arcsec(), s.steady_free.rms_arcsec(), s.steady_free.max_arcsec());
        }
        }
    }
}
