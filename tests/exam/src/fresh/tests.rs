//! The plants against their own claims: a perfect drive returns the catalogue's error, energy is kept, a seed repeats,
//! and nothing of the truth is in what the diagnosis is given.

use super::hides::range;
use super::joint::Poll;
use super::*;
use crate::bench::rms;
use crate::question::Question;

const EXACT: fn(Poll) -> Poll = |poll| Poll { skew_s: 0.0, jitter_s: 0.0, ..poll };

fn drive(index: u64) -> (Drive, Chance) {
    let mut chance = Chance::new(31, "fresh tests", index);
    (Drive::draw(&mut chance), chance)
}

/// Share of the rows whose residual stays below a bound, and the bound that half of them keep.
fn quantiles(residual: &[f64]) -> [f64; 3] {
    let mut sizes: Vec<f64> = residual.iter().map(|x| x.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    [0.5, 0.95, 0.99].map(|share| sizes[(share * (sizes.len() - 1) as f64) as usize])
}

/// The catalogue's model is quasi-static, so what a perfect joint leaves is the damping of its spring, and up to half
/// of the clearance in the rows in which the load is on its way through it.
#[test]
fn a_perfect_joint_returns_the_error_of_the_catalogue() {
    for index in 0..4 {
        let (drive, mut chance) = drive(index);
        let joint = Joint::draw(&drive, &mut chance);
        let joint = joint.polled(EXACT(joint.poll));
        let (motion, readings) = joint.run(&drive, &Unit::nominal(&drive), &[]);
        let left = residual(&drive, &motion, &readings);
        let [half, most, nearly_all] = quantiles(&left);
        println!("{index}: {half:.3} {most:.3} {nearly_all:.3} rms {:.3} turns {:.0}", rms(&left), motion.turns());
        assert!(half < 0.02 && most < 0.2, "{index}: {half} {most} arcsec");
        assert!(left.iter().all(|x| x.abs() < 1.05 * drive.backlash_arcsec), "{index}");
        assert!(motion.turns() > 47.5, "half an output turn at ratio 95: {}", motion.turns());
    }
}

/// So does a perfect rig, whose catalogue is at rest in the rows in which the load crosses the clearance alone.
#[test]
fn a_perfect_rig_returns_the_error_of_the_catalogue() {
    for index in 0..4 {
        let (drive, mut chance) = drive(index);
        let mut rig = Rig::draw(&drive, &mut chance);
        rig.jitter_s = 0.0;
        let (motion, readings) = rig.run(&drive, &Unit::nominal(&drive), &[]);
        let left = residual(&drive, &motion, &readings);
        let [half, most, nearly_all] = quantiles(&left);
        println!("{index}: {half:.4} {most:.3} {nearly_all:.3} rms {:.3} turns {:.0}", rms(&left), motion.turns());
        assert!(half < 0.01 && most < 0.1, "{index}: {half} {most} arcsec");
        assert!(left.iter().all(|x| x.abs() < 1.05 * drive.backlash_arcsec), "{index}");
        assert!(motion.turns() > 47.5, "half an output turn at ratio 95: {}", motion.turns());
    }
}

#[test]
fn a_perfect_bench_returns_the_error_of_the_catalogue() {
    for index in 0..6 {
        let (drive, mut chance) = drive(index);
        let bench = Metrology::draw(&drive, &[], &mut chance).steady();
        let (motion, readings) = bench.run(&drive, &Unit::nominal(&drive), &[]);
        let [half, most, nearly_all] = quantiles(&residual(&drive, &motion, &readings));
        println!(
            "{index}: {half:.4} {most:.4} {nearly_all:.4} turns {:.0} rows {}",
            motion.turns(),
            motion.time_s.len()
        );
        assert!(half < 1e-6 && most < 0.05 && nearly_all < 1.0, "{index}: {half} {most} {nearly_all} arcsec");
    }
}

/// Work put in is lost or stored. What is missing is the error of the step and of flanks that strike.
#[test]
fn a_joint_keeps_its_energy() {
    for index in 0..4 {
        let (drive, mut chance) = drive(index);
        let joint = Joint::draw(&drive, &mut chance);
        let (.., energy) = joint.run_with_energy(&drive, &Unit::nominal(&drive), &[]);
        let missing = energy.put_in - energy.lost - energy.stored;
        println!("{index}: {energy:?} missing {:.5}", missing / energy.turned_over);
        assert!(missing.abs() < 2e-3 * energy.turned_over, "{index}: {missing} of {energy:?}");
        assert!(energy.lost > 0.05 * energy.turned_over, "friction takes its share: {energy:?}");
    }
}

/// Dahl's friction and the plays give back less than they take, and nothing of it depends on how quickly.
#[test]
fn hysteresis_loses_energy() {
    let (drive, mut chance) = drive(1);
    let joint = Joint::draw(&drive, &mut chance).short();
    let unit = Unit::nominal(&drive);
    let one = Hides { thing: Thing::Cause(Cause::TorsionalHysteresis), size: 20.0, shape: [0.5; 4] };
    let energy = joint.run_with_energy(&drive, &unit, &[one]).2;
    // The elastic part of `stored` leaves out the slip, so its loss is what is missing.
    let missing = energy.put_in - energy.lost - energy.stored;
    assert!(missing > 0.0, "{energy:?}");
}

/// At the ends of their ranges effects are seen and stay finite; at nothing they are nothing.
#[test]
fn every_effect_shows_and_vanishes_with_its_size() {
    let (drive, mut chance) = drive(2);
    let unit = Unit::nominal(&drive);
    let joint = Joint::draw(&drive, &mut chance).short();
    let things = |causes: &[Cause], strangers: &[Stranger]| -> Vec<Thing> {
        let causes = causes.iter().map(|cause| Thing::Cause(*cause));
        causes.chain(strangers.iter().map(|stranger| Thing::Stranger(*stranger))).collect()
    };
    let of_benches = things(hides::OF_BENCHES, Stranger::OF_BENCHES);
    let bench = Metrology::draw(&drive, &of_benches, &mut chance);
    let rig = Rig::draw(&drive, &mut chance);
    let stands = [
        (Stand::Joint(joint), things(Cause::ALL, Stranger::OF_JOINTS)),
        (Stand::Bench(bench), of_benches),
        (Stand::Rig(rig), things(Cause::ALL, Stranger::OF_RIGS)),
    ];
    for (stand, things) in stands {
        let run = |hidden: &[Hides]| {
            let (motion, readings) = match &stand {
                Stand::Joint(joint) => joint.run(&drive, &unit, hidden),
                Stand::Bench(bench) => bench.run(&drive, &unit, hidden),
                Stand::Rig(rig) => rig.run(&drive, &unit, hidden),
            };
            residual(&drive, &motion, &readings)
        };
        let clean = run(&[]);
        for thing in things {
            let (low, high) = range(thing, &drive);
            let mut one = Hides::draw(thing, &drive, &mut chance);
            let added = |one: &Hides, rows: f64| {
                let with = run(std::slice::from_ref(one));
                assert!(with.iter().all(|x| x.is_finite()), "{}", thing.name());
                let mut sizes: Vec<f64> = with.iter().zip(&clean).map(|(a, b)| (a - b).abs()).collect();
                sizes.sort_by(f64::total_cmp);
                rms(&sizes[..(rows * sizes.len() as f64) as usize])
            };
            one.size = high.copysign(one.size);
            let most = added(&one, 0.99);
            if thing == Thing::Cause(Cause::Ratcheting) {
                assert!(most > 100.0, "{most}");
                continue;
            }
            one.size = (1e-4 * low).copysign(one.size);
            // While the friction of the hub holds the load, the catalogue's model may stand on either flank.
            let least = added(&one, 0.9);
            println!("{:<36} {least:.4} {most:.2}", thing.name());
            assert!(most > 0.8 && least < 0.3 * most && least < 0.2, "{}: {least} {most}", thing.name());
        }
    }
}

#[test]
fn a_seed_repeats_a_case_and_the_data_hold_no_truth() {
    use clap::Parser;
    #[derive(Parser)]
    struct Options {
        #[command(flatten)]
        draw: Draw,
    }
    for options in [["--family", "d"], ["--family", "e"], ["--family", "f"], ["--kind", "logger"]] {
        let draw = Options::parse_from(["exam"].into_iter().chain(options)).draw;
        assert!(draw.is_fresh());
        for index in [3] {
            let files_of = |question: &Question| [question.data(), question.nominal_toml()];
            let question = Question::draw(4, index, &draw);
            let files = files_of(&question);
            assert!(files == files_of(&Question::draw(4, index, &draw)));
            assert!(files != files_of(&Question::draw(5, index, &draw)));
            let truth = question.truth();
            assert_eq!(truth.seed, 4);
            for hidden in &truth.hidden {
                for text in &files {
                    assert!(!text.contains(&hidden.name), "{}", hidden.name);
                }
            }
            let header = files[0].lines().next().unwrap();
            assert!(header.starts_with("time_s,generator_rad,output_rad,torque_n_m,temperature_c"), "{header}");
            let rows = files[0].lines().count() - 1;
            assert!((18_000..42_000).contains(&rows), "{rows} rows");
            assert!(!truth.name.contains(&index.to_string()) || truth.name.len() == 12);
        }
    }
}

/// Each fault of a logger leaves its mark: in the rows, in their stamps, or in the model that is told.
#[test]
fn each_fault_of_a_logger_leaves_a_mark() {
    let draw = |fault| Draw { kind: Some(Kind::Logger), fault: Some(fault), ..Draw::default() };
    for &fault in LoggerFault::ALL {
        let case = Fresh::draw(6, 1, &draw(fault));
        let with = (case.data(), case.nominal_toml());
        let clean = match &case.stand {
            Stand::Joint(joint) => {
                let poll = Poll { late_reads: 0.0, stalls_s: (0.0, 0.0), counted: None, ..EXACT(joint.poll) };
                Fresh { fault: None, stand: Stand::Joint(joint.polled(poll)), ..case.clone() }
            }
            Stand::Bench(_) | Stand::Rig(_) => unreachable!("faults of loggers are those of joints"),
        };
        assert!(with != (clean.data(), clean.nominal_toml()), "{}", fault.name());
        assert_eq!(case.unit, Unit::nominal(&case.drive), "a perfect drive");
        assert!(case.hidden.is_empty());
    }
}
