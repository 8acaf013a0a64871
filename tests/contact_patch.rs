//! Contact forces are the derivatives of the energy of the gaps, balance one another, and pass a uniform pressure on
//! evenly.
//!
//! ```text
//!   bore:   ring shrunk on a round generator      flank:  f_fs  <--|-->  f_cs = -f_fs
//!           .-'''-.   uniform pressure p                  E(u, v, delta) = sum w k <-g>^2 / 2
//!          / .---. \                                      f = -dE/du, torque = -dE/d(delta)
//!         | |  o  | |   Lame: u_a = p a (1+nu)/E ((1-2nu) a^2 + b^2)/(b^2 - a^2)
//! ```
//!
//! Loads: HHD-95 as deformed by its generator, loaded with 20 N·m, disturbed at random by 1e-5 mm; a smooth ring on a
//! generator 6e-6 larger than its bore. References: central differences of the energy and of the forces; Newton's third
//! law; Lame's thick cylinder (Timoshenko and Goodier, Theory of Elasticity, art. 28). Physics wrong if this fails: the
//! direction or the point of attack of a contact force, weights of the integration, a moment that is not that of the
//! forces.

use flexspline_mechanics::contact::{BoreContact, BoreLaw, Configuration, FlankLaw, FlankPair, FlankPoint, OpenEdges};
use flexspline_mechanics::drive::{Drive, GeneratorKind, GeneratorOutline};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Problem, Solver};
use flexspline_tests::motion::{imperfect, loaded, mean, problem, reference};

/// Numbers in [-1, 1] that look random and are always the same.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self, length: usize) -> Vec<f64> {
        (0..length).map(|_| self.next()).collect()
    }
}

fn moved(u: &[f64], by: f64, direction: &[f64]) -> Vec<f64> {
    u.iter().zip(direction).map(|(x, d)| x + by * d).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// All of the bore at once.
struct Bore {
    energy: f64,
    force: Vec<f64>,
    /// Tangent times a direction.
    stiffness_times: Vec<f64>,
    moment: f64,
    peaks: Vec<f64>,
}

fn bore(contact: &BoreContact, law: BoreLaw, outline: &GeneratorOutline, psi: f64, u: &[f64], along: &[f64]) -> Bore {
    let mut all = Bore {
        energy: 0.0,
        force: vec![0.0; u.len()],
        stiffness_times: vec![0.0; u.len()],
        moment: 0.0,
        peaks: vec![],
    };
    contact.evaluate(law, outline, psi, u, &mut OpenEdges::default(), |edge| {
        let unknowns: Vec<usize> =
            contact.edges[edge.edge].iter().flat_map(|n| [2 * *n as usize, 2 * *n as usize + 1]).collect();
        all.energy += edge.energy;
        all.moment += edge.moment;
        all.peaks.push(edge.peak);
        for i in 0..6 {
            all.force[unknowns[i]] += edge.force[i];
            for j in 0..6 {
                let k = edge.stiffness[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
                all.stiffness_times[unknowns[i]] += k * along[unknowns[j]];
            }
        }
    });
    all
}

fn bore_derivatives(drive: &Drive, kind: GeneratorKind) {
    let problem = problem(drive, kind, reference(MeshLevel::Coarse));
    let contact = BoreContact::new(&problem.flexspline, 16);
    let law = BoreLaw::new(1e6, None);
    let psi = 0.0123;
    let mut noise = Noise(1);
    let start = problem.starting_shape(psi).u;
    let disturbance = noise.vector(start.len());
    // Inward by 5e-5 mm, so that something touches.
    let inward: Vec<f64> = problem.flexspline.nodes.iter().flat_map(|x| x.map(|c| -c / x[0].hypot(x[1]))).collect();
    let u = moved(&moved(&start, 5e-5, &inward), 1e-5, &disturbance);
    let direction = noise.vector(u.len());
    let at = |psi: f64, u: &[f64]| bore(&contact, law, &problem.outline, psi, u, &direction);
    let here = at(psi, &u);
    assert!(!here.peaks.is_empty());

    let h = 1e-8;
    let (plus, minus) = (at(psi, &moved(&u, h, &direction)), at(psi, &moved(&u, -h, &direction)));
    let by_difference = (plus.energy - minus.energy) / (2.0 * h);
    let by_force = -dot(&here.force, &direction);
    let scale = norm(&here.force) * norm(&direction) / (u.len() as f64).sqrt();
    let force_error = (by_difference - by_force).abs() / scale;

    let tangent_by_difference: Vec<f64> =
        plus.force.iter().zip(&minus.force).map(|(a, b)| -(a - b) / (2.0 * h)).collect();
    let difference: Vec<f64> = tangent_by_difference.iter().zip(&here.stiffness_times).map(|(a, b)| a - b).collect();
    let tangent_error = norm(&difference) / norm(&here.stiffness_times);

    let turn = 1e-8;
    let (plus, minus) = (at(psi + turn, &u), at(psi - turn, &u));
    let moment_by_difference = (plus.energy - minus.energy) / (2.0 * turn);
    let nodal: f64 = (0..problem.flexspline.nodes.len())
        .map(|n| {
            let x = problem.flexspline.nodes[n];
            (x[0] + u[2 * n]) * here.force[2 * n + 1] - (x[1] + u[2 * n + 1]) * here.force[2 * n]
        })
        .sum();
    let force_sum: f64 = here.force.chunks(2).map(|f| f[0].hypot(f[1])).sum();
    let arm = force_sum * problem.flexspline.base_radius;
    assert!(force_error <= 1e-6);
    // Tight enough to see the part that comes from the curvature of the outline, penetration over radius: 8e-6 under
    // rollers.
    assert!(tangent_error <= 1e-6);
    assert!((moment_by_difference - here.moment).abs() <= 1e-6 * arm);
    assert!((nodal - here.moment).abs() <= 1e-8 * arm);
}

#[test]
fn bore_forces_are_derivatives_of_the_energy() {
    for kind in GeneratorKind::ALL {
        bore_derivatives(&Drive::hhd_95(), kind);
    }
}

#[test]
fn bore_forces_of_a_malformed_generator_are_derivatives_of_the_energy() {
    for kind in GeneratorKind::ALL {
        bore_derivatives(&imperfect(), kind);
    }
}

/// Contact patch test: a uniform pressure is passed on evenly and has the size that Lame gives.
#[test]
fn a_ring_shrunk_on_a_round_generator_feels_lames_pressure() {
    let mut drive = Drive::hhd_95();
    drive.generator.w0_mm = 1e-9;
    // The rest of the drive makes room: nothing of it touches the ring.
    drive.circular_spline.tip_radius_mm = 48.9;
    drive.temperature.flexspline_expansion_per_k = 0.0;
    drive.temperature.generator_expansion_per_k = 1e-6;
    let penalty = 1e4;
    let settings =
        flexspline_mechanics::stepping::SolverSettings { bore_penalty: Some(penalty), ..reference(MeshLevel::Coarse) };
    let mut problem = Problem::smooth_ring(&drive, GeneratorKind::Cam, settings, 188, 2).unwrap();
    problem.outline = GeneratorOutline::new(&drive.at_temperature(26.0), GeneratorKind::Cam).unwrap();
    let mut solver = Solver::new(&problem);
    let (state, _) = solver.deform(0.0).unwrap();

    let contact = BoreContact::new(&problem.flexspline, 16);
    let law = BoreLaw::new(penalty, None);
    let found = bore(&contact, law, &problem.outline, 0.0, &state.u, &state.u);
    let (least, most) =
        (found.peaks.iter().copied().fold(f64::INFINITY, f64::min), found.peaks.iter().copied().fold(0.0, f64::max));

    let (a, b) = (drive.flexspline.bore_radius_mm(), drive.flexspline.root_radius_mm);
    let (e, nu) = (drive.material.youngs_modulus_mpa, drive.material.poissons_ratio);
    let interference = a * 6e-6;
    let yielding = a * (1.0 + nu) / e * ((1.0 - 2.0 * nu) * a * a + b * b) / (b * b - a * a);
    let lame = interference / (yielding + 1.0 / penalty);
    assert_eq!(found.peaks.len(), contact.edges.len());
    assert!((most - least) / lame <= 1e-4, "pressure from {least} to {most} MPa");
    assert!((mean(found.peaks) / lame - 1.0).abs() <= 1e-4, "pressure {most} MPa, Lame {lame} MPa");
}

/// Forces of one pair along a direction of flexspline nodes, circular-spline nodes and output.
struct Flank {
    energy: f64,
    force: Vec<f64>,
    torque: f64,
}

#[test]
#[ignore = "long: tests/run slow"]
fn flank_forces_are_derivatives_of_the_energy_and_balance() {
    flank_derivatives(&Drive::hhd_95(), 1e-5);
}

/// Flanks displaced, turned and worn, on an axis beside that of the housing. The moment about the axis of the output is
/// that of the forces where they act, 20 um beside the nodes that carry them: 4e-4 of 45 mm.
#[test]
#[ignore = "long: tests/run slow"]
fn as_built_flank_forces_are_derivatives_of_the_energy_and_balance() {
    flank_derivatives(&imperfect(), 1e-3);
}

fn flank_derivatives(drive: &Drive, moment_bound: f64) {
    let problem = problem(drive, GeneratorKind::TwoRoller, reference(MeshLevel::Standard));
    let run = loaded(&problem, 20.0);
    let flanks = problem.flanks();
    let mut noise = Noise(7);
    let disturb = |x: &[f64], noise: &mut Noise| moved(x, 1e-5, &noise.vector(x.len()));
    // More load than equilibrium has, so that many points touch.
    let output = run.state().output_rad + 2e-6;
    let (u, v) = (disturb(&run.state().u, &mut noise), disturb(&run.state().v, &mut noise));
    let at = Configuration { u: &u, v: &v, output_rad: output, leans: &[] };

    let mut worst = [0.0_f64; 6];
    let mut touching = 0;
    for friction in [0.0, 10.0] {
        // Ten times the pressure is more than the tangential spring can reach in these small motions: all points stick.
        let law = FlankLaw { stiffness: 5e7, stick_stiffness: 5e6, friction };
        for pair in flanks.near_pairs(at, 0.015) {
            let mut layout = flanks.layout(pair, at);
            if friction > 0.0 {
                let before = Configuration {
                    u: &run.state().u,
                    v: &run.state().v,
                    output_rad: run.state().output_rad,
                    leans: &[],
                };
                flanks.start_friction((pair, before), &Vec::new(), &mut layout.points);
            }
            let Some(here) = flanks.evaluate((pair, at), law, &layout.points) else { continue };
            touching += 1;
            let nodes = |pair: FlankPair| -> (Vec<usize>, Vec<usize>) {
                (flanks.fs_nodes(pair).collect(), flanks.cs_nodes(pair).collect())
            };
            let (fs, cs) = nodes(pair);
            let direction = noise.vector(2 * (fs.len() + cs.len()));
            let output_direction = 0.02 * noise.next();
            let step = |by: f64, points: &[FlankPoint]| -> Flank {
                let (mut u, mut v) = (u.clone(), v.clone());
                for (k, n) in fs.iter().enumerate() {
                    u[2 * n] += by * direction[2 * k];
                    u[2 * n + 1] += by * direction[2 * k + 1];
                }
                for (k, n) in cs.iter().enumerate() {
                    v[2 * n] += by * direction[2 * (fs.len() + k)];
                    v[2 * n + 1] += by * direction[2 * (fs.len() + k) + 1];
                }
                let at = Configuration { u: &u, v: &v, output_rad: output + by * output_direction, leans: &[] };
                let all = flanks.evaluate((pair, at), law, points).unwrap();
                // The peak of a single point is its pressure.
                let energy = points
                    .iter()
                    .filter_map(|p| Some((p.weight, flanks.evaluate((pair, at), law, &[*p])?.load / p.weight)))
                    .map(|(weight, pressure)| 0.5 * weight * pressure * pressure / law.stiffness)
                    .sum();
                Flank { energy, force: all.force, torque: all.torque }
            };
            let h = 1e-9;
            // Points that begin or cease to touch within the step have no derivative.
            let steady: Vec<FlankPoint> = layout
                .points
                .iter()
                .filter(|p| {
                    let touches = |by: f64| {
                        let mut u = u.clone();
                        for (k, n) in fs.iter().enumerate() {
                            u[2 * n] += by * direction[2 * k];
                            u[2 * n + 1] += by * direction[2 * k + 1];
                        }
                        let at = Configuration { u: &u, v: &v, output_rad: output, leans: &[] };
                        flanks.evaluate((pair, at), law, &[**p]).is_some()
                    };
                    touches(1e-7) && touches(-1e-7)
                })
                .copied()
                .collect();
            if steady.is_empty() {
                continue;
            }
            let (plus, minus) = (step(h, &steady), step(-h, &steady));
            let middle = flanks.evaluate((pair, at), law, &steady).unwrap();
            let scale = norm(&middle.force) * norm(&direction) / (direction.len() as f64).sqrt();
            if friction == 0.0 {
                let by_difference = (plus.energy - minus.energy) / (2.0 * h);
                let by_force = -dot(&middle.force, &direction) - middle.torque * output_direction;
                worst[0] = worst[0].max((by_difference - by_force).abs() / scale);
            }
            let n = middle.force.len();
            let times: Vec<f64> = (0..n)
                .map(|i| {
                    (0..n).map(|j| middle.stiffness[i.max(j) * n + i.min(j)] * direction[j]).sum::<f64>()
                        + middle.border[i] * output_direction
                })
                .collect();
            let error: Vec<f64> = (0..n).map(|i| -(plus.force[i] - minus.force[i]) / (2.0 * h) - times[i]).collect();
            let row = if friction == 0.0 { 1 } else { 2 };
            worst[row] = worst[row].max(norm(&error) / norm(&times));
            let torque_rate = dot(&middle.border, &direction) + middle.corner * output_direction;
            let torque_error = -(plus.torque - minus.torque) / (2.0 * h) - torque_rate;
            worst[row] = worst[row].max(torque_error.abs() / torque_rate.abs().max(norm(&times) * 48.0 * 0.1));

            // Action and reaction, and the moment about the axis, of the forces as they act on the nodes.
            let (sin, cos) = output.sin_cos();
            let (mut sum, mut total, mut on_fs, mut on_cs) = ([0.0; 2], 0.0_f64, 0.0, 0.0);
            for (k, n) in fs.iter().enumerate() {
                let f = [here.force[2 * k], here.force[2 * k + 1]];
                let x = problem.flexspline.nodes[*n];
                on_fs += (x[0] + u[2 * n]) * f[1] - (x[1] + u[2 * n + 1]) * f[0];
                sum = [sum[0] + f[0], sum[1] + f[1]];
                total += f[0].hypot(f[1]);
            }
            for (k, n) in cs.iter().enumerate() {
                let k = fs.len() + k;
                let f = [here.force[2 * k], here.force[2 * k + 1]];
                let x = problem.circular_spline.nodes[*n];
                on_cs += (x[0] + v[2 * n]) * f[1] - (x[1] + v[2 * n + 1]) * f[0];
                sum = [sum[0] + cos * f[0] - sin * f[1], sum[1] + sin * f[0] + cos * f[1]];
            }
            worst[3] = worst[3].max(sum[0].hypot(sum[1]) / total);
            worst[4] = worst[4].max((on_fs + here.torque).abs() / here.torque.abs());
            worst[5] = worst[5].max((on_cs - here.torque).abs() / here.torque.abs());
        }
    }
    println!(
        "flanks, {touching} pairs: force against energy {:.1e}, tangent {:.1e}, tangent when sticking {:.1e}, action \
         and reaction {:.1e}, moment on flexspline {:.1e} and on circular spline {:.1e} against the torque",
        worst[0], worst[1], worst[2], worst[3], worst[4], worst[5]
    );
    assert!(touching >= 10);
    // The tangent leaves out how the normal turns with the foot: pressure over radius of curvature, against the
    // penalty, is a few thousandths on the tip rounding of the space.
    assert!(worst[0] <= 1e-5 && worst[1] <= 1e-2 && worst[2] <= 1e-2 && worst[3] <= 1e-12);
    assert!(worst[4] <= moment_bound && worst[5] <= moment_bound);
}
