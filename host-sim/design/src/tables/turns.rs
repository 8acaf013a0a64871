//! FEM sweeps of a drive that does not repeat from tooth to tooth: every imperfection of
//! [`flexspline_mechanics::drive::AsBuilt`] but uniform wear and temperature.
//!
//! The difference between such a drive and the same one without them depends on where generator and output stand in
//! their turns. It is geometry: friction has little part in it, and without friction contact converges several times
//! faster. So two sweeps are put together:
//!
//! * the drive without the imperfections, over one tooth pitch at every node, as [`crate::tables::sweep`] does it;
//! * the *deviation*, the output with the imperfections less the output without, both frictionless, at a few loads of
//!   either sign, from many places. The places cover the turn of the generator and the turn of the output as evenly as
//!   so few points can (the additive recurrence of the plastic number), so that harmonics of ψ, δ and ψ − δ do not pass
//!   for one another.
//!
//! The places lie whole flexspline pitches apart. There the drive without imperfections is in one state, and the drive
//! with them nearly so: under each load it jumps from place to place ([`Motion::jump`]).
//!
//! The samples are those of the first sweep, each at every place, with the deviation there added: between loads linear
//! in the cube root of the load, within the pitch along the harmonics that the table will hold.
//!
//! The table has one curve for each of the angles, the same at every load. What of the deviation changes with the load
//! or the flank that bears (an eccentricity is felt less where more teeth share it, and from another side by the other
//! flank), or depends on two angles at once, stays as a difference that the table states; what the putting together
//! misses is seen by `validate`.

use std::f64::consts::TAU;

use flexspline_algebra::{Mat, cholesky, product};
use flexspline_make::Sample;
use rayon::prelude::*;

use super::project::{GENERATOR_ORDERS, MATERIAL_ORDERS, OUTPUT_ORDERS};
use super::sweep::{KnownNode, Observer, Sampler, SweepPlan, TorqueSweep, TorqueSweepError, Work, report, sweep};
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Problem, SolveError, SolverSettings};

/// Places of generator and output for each sign of the load.
const PLACES: usize = 32;
/// Loads of each sign.
const LEVELS: usize = 5;
/// The lightest of them, N m.
const LIGHTEST_N_M: f64 = 0.1;
/// Drag under which the deviation is looked at, N m: that of the ideal drive.
const SMOOTH_DRAG_N_M: f64 = 0.02;
/// The plastic number: `p³ = p + 1`.
const PLASTIC: f64 = 1.324_717_957_244_746;

/// Increments that the deviation takes, about.
pub(crate) const DEVIATION_INCREMENTS: usize = 2 * LEVELS * (PLACES + 4);

/// Runs the sweep of one generator at the torque and temperature nodes of the plan, for any drive: one that repeats
/// from tooth to tooth is swept over one pitch ([`sweep`]), any other over whole turns of generator and output. Nodes
/// that are `known` are not computed again; they and the `sampler` are of the drive without the imperfections.
pub(crate) fn sweep_turns(
    drive: &Drive,
    kind: GeneratorKind,
    plan: &SweepPlan,
    known: &[KnownNode],
    sampler: &Sampler<'_>,
    settings: SolverSettings,
    observe: &Observer,
) -> Result<TorqueSweep, TorqueSweepError> {
    let repeating = Drive { as_built: drive.as_built.uniform_part(), ..drive.clone() };
    let mut whole = sweep(&repeating, kind, plan, known, sampler, settings)?;
    if drive.as_built.first_not_uniform().is_none() {
        return Ok(whole);
    }

    let temperature_c = drive.temperature.reference_c;
    let problem = |drive: &Drive| {
        let mut smooth = drive.clone();
        smooth.flanks.friction_coefficient = 0.0;
        smooth.output.drag_torque_n_m = SMOOTH_DRAG_N_M;
        Problem::new(&smooth, kind, temperature_c, settings)
    };
    let (with, without) = (problem(drive)?, problem(&repeating)?);
    let largest = plan.torque_nodes_n_m.iter().fold(0.0_f32, |m, t| m.max(t.abs()));
    let levels = levels(f64::from(largest) + drive.output.drag_torque_n_m);
    let runs: Vec<(usize, f64)> = (0..LEVELS).rev().flat_map(|level| [(level, 1.0), (level, -1.0)]).collect();
    let done = runs
        .par_iter()
        .map(|&(level, sign)| {
            let torque_n_m = sign * levels[level];
            let mut count = Count { observe, work: Work::default() };
            let all_alike = count.errors(&without, &[0.0], torque_n_m)?[0];
            let places = places(drive, sign);
            let deviation: Vec<f64> =
                count.errors(&with, &places, torque_n_m)?.into_iter().map(|error| error - all_alike).collect();
            let run = TurnRun { level, sign, deviation };
            Ok((run, count.work))
        })
        .collect::<Result<Vec<_>, TorqueSweepError>>()?;
    done.iter().for_each(|(_, work)| whole.work.add(*work));
    let deviations = Deviations::new(drive, levels, done.into_iter().map(|(run, _)| run).collect());
    whole.samples = whole.samples.iter().flat_map(|sample| deviations.spread(drive, sample)).collect();
    whole.places = PLACES;
    Ok(whole)
}

/// Loads at which the deviation is looked at, light to heavy, evenly in their cube roots, N m.
fn levels(largest_n_m: f64) -> [f64; LEVELS] {
    let (first, last) = (LIGHTEST_N_M.cbrt(), largest_n_m.cbrt());
    std::array::from_fn(|k| (first + (last - first) * k as f64 / (LEVELS - 1) as f64).powi(3))
}

/// Generator angles of the places, ascending: evenly spread over one turn of the output and one turn of the generator,
/// whole flexspline pitches apart; others for either sign of the load.
fn places(drive: &Drive, sign: f64) -> Vec<f64> {
    let pitch = TAU / f64::from(drive.flexspline.teeth);
    let mut places: Vec<f64> = (0..PLACES)
        .map(|k| {
            let number = (2 * k + 1 + usize::from(sign < 0.0)) as f64;
            let (output, generator) = ((number / PLASTIC).fract(), (number / (PLASTIC * PLASTIC)).fract());
            let turns = (output * drive.ratio().abs()).floor();
            ((turns + generator) * TAU / pitch).round() * pitch
        })
        .collect();
    places.sort_by(f64::total_cmp);
    places
}

/// Goes from place to place and counts.
struct Count<'a> {
    observe: &'a Observer<'a>,
    work: Work,
}

impl Count<'_> {
    fn report(&mut self, motion: &Motion<'_>) -> Result<(), TorqueSweepError> {
        report(self.observe, motion, motion.problem().drive.temperature.reference_c, &mut self.work)
    }

    /// The transmission error at places in ascending order, under one load.
    fn errors(&mut self, problem: &Problem, places: &[f64], torque_n_m: f64) -> Result<Vec<f64>, TorqueSweepError> {
        let Some(first) = places.first() else { return Ok(Vec::new()) };
        // Loaded one pitch before a place, so that the drive arrives there moving forward.
        let pitch = problem.flexspline.pitch();
        let mut motion = Motion::deformed(problem, first - pitch)?;
        motion.load(torque_n_m)?;
        self.report(&motion)?;
        let mut errors = Vec::with_capacity(places.len());
        for &place in places {
            match motion.jump(place) {
                // Too different from the last place: deformed and loaded afresh.
                Err(SolveError::NotConverged { .. }) => {
                    motion.deform(place - pitch)?;
                    motion.load(torque_n_m)?;
                    self.report(&motion)?;
                    motion.turn_to(place)?;
                }
                jumped => jumped?,
            }
            self.report(&motion)?;
            errors.push(motion.error_rad());
        }
        Ok(errors)
    }
}

/// Output with imperfections less output without, at every place of a sign under one load, rad.
struct TurnRun {
    level: usize,
    sign: f64,
    deviation: Vec<f64>,
}

/// The deviation at places and loads.
struct Deviations {
    /// Loads, N m, light to heavy.
    levels: [f64; LEVELS],
    /// Of loads that turn the output forward, then of those that turn it back: places and, at each, the deviation under
    /// each load.
    signs: [(Vec<f64>, Vec<[f64; LEVELS]>); 2],
    /// Amplitudes of the harmonics that all loads have in common, of the cosine and the sine in turn.
    amplitudes: Vec<f64>,
}

impl Deviations {
    fn new(drive: &Drive, levels: [f64; LEVELS], runs: Vec<TurnRun>) -> Deviations {
        let mut signs = [1.0, -1.0].map(|sign| (places(drive, sign), vec![[0.0; LEVELS]; PLACES]));
        for run in runs {
            let deviations = &mut signs[usize::from(run.sign < 0.0)].1;
            deviations.iter_mut().zip(run.deviation).for_each(|(at, rad)| at[run.level] = rad);
        }
        let amplitudes = common_harmonics(drive, &signs);
        Deviations { levels, signs, amplitudes }
    }

    /// A sample of the drive without imperfections, at every place, with the deviation there.
    fn spread<'a>(&'a self, drive: &'a Drive, sample: &'a Sample) -> impl Iterator<Item = Sample> + 'a {
        let flank_n_m = sample.torque_n_m - f64::from(sample.direction.sign()) * drive.output.drag_torque_n_m;
        let (places, deviations) = &self.signs[usize::from(flank_n_m < 0.0)];
        let pitch = TAU / f64::from(drive.flexspline.teeth);
        let error = sample.output_rad - sample.generator_rad / drive.ratio();
        let within = sample.generator_rad.rem_euclid(pitch);
        places.iter().zip(deviations).map(move |(place, at)| {
            let generator_rad = place + within;
            let along = self.common(drive, generator_rad) - self.common(drive, *place);
            let deviation = between(&self.levels, at, flank_n_m.abs()) + along;
            Sample { generator_rad, output_rad: generator_rad / drive.ratio() + error + deviation, ..*sample }
        })
    }

    fn common(&self, drive: &Drive, generator_rad: f64) -> f64 {
        harmonics(drive, generator_rad).iter().zip(&self.amplitudes).map(|(a, b)| a * b).sum()
    }
}

/// Cosine and sine of every order that a table holds.
fn harmonics(drive: &Drive, generator_rad: f64) -> Vec<f64> {
    let output = generator_rad / drive.ratio();
    let of = |orders: &'static [u16], angle: f64| {
        orders.iter().flat_map(move |order| {
            let (sin, cos) = (f64::from(*order) * angle).sin_cos();
            [cos, sin]
        })
    };
    of(&GENERATOR_ORDERS, generator_rad)
        .chain(of(&MATERIAL_ORDERS, generator_rad - output))
        .chain(of(&OUTPUT_ORDERS, output))
        .collect()
}

/// The harmonics that all loads of both signs have in common, by least squares; each sign and load has a mean of its
/// own.
fn common_harmonics(drive: &Drive, signs: &[(Vec<f64>, Vec<[f64; LEVELS]>); 2]) -> Vec<f64> {
    // The means are taken out of columns and data alike. The columns of a sign are the same under every load.
    let mut normal: Option<(Mat, Mat)> = None;
    for (places, deviations) in signs {
        let rows: Vec<Vec<f64>> = places.iter().map(|place| harmonics(drive, *place)).collect();
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / places.len() as f64;
        let columns = Mat::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j] - mean(&mut rows.iter().map(|r| r[j])));
        let data = Mat::from_fn(rows.len(), 1, |i, _| deviations[i].iter().sum::<f64>() / LEVELS as f64);
        let part = (product(columns.transpose(), columns.as_ref()), product(columns.transpose(), data.as_ref()));
        normal = Some(normal.map_or(part.clone(), |(matrix, right)| (matrix + &part.0, right + &part.1)));
    }
    let Some((matrix, right)) = normal else { return Vec::new() };
    let factor = cholesky(matrix.as_ref()).expect("the places distinguish the harmonics");
    let solution = factor.solve(right.as_ref());
    (0..solution.nrows()).map(|k| solution[(k, 0)]).collect()
}

/// Value at a load, linear in its cube root; beyond the levels that of the nearest.
fn between(levels: &[f64; LEVELS], values: &[f64; LEVELS], load_n_m: f64) -> f64 {
    let (first, last) = (levels[0].cbrt(), levels[LEVELS - 1].cbrt());
    let along = ((load_n_m.cbrt() - first) / (last - first)).clamp(0.0, 1.0) * (LEVELS - 1) as f64;
    let below = (along as usize).min(LEVELS - 2);
    values[below] + (along - below as f64) * (values[below + 1] - values[below])
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline::Direction;
    use flexspline_mechanics::drive::Harmonic;

    #[test]
    fn places_tell_the_three_angles_apart() {
        let drive = Drive::hhd_95();
        for sign in [1.0, -1.0] {
            let places = places(&drive, sign);
            assert!(places.iter().all(|p| (0.0..=TAU * 95.0).contains(p)));
            // Cosines and sines of the orders of ψ, ψ − δ and δ are nearly orthogonal over the places of either sign.
            let rows: Vec<Vec<f64>> = places.iter().map(|place| harmonics(&drive, *place)).collect();
            for (a, b) in (0..20).flat_map(|a| (0..a).map(move |b| (a, b))) {
                let mean = rows.iter().map(|row| row[a] * row[b]).sum::<f64>() / rows.len() as f64;
                assert!(mean.abs() < 0.4, "columns {a}, {b}: {mean}");
            }
        }
    }

    #[test]
    fn harmonics_common_to_all_loads_are_found_whatever_the_means() {
        let drive = Drive::hhd_95();
        let amplitudes: Vec<f64> = (0..20).map(|k| (f64::from(k) + 1.0) * 1e-6).collect();
        let runs = (0..LEVELS).flat_map(|level| [(level, 1.0), (level, -1.0)]).map(|(level, sign)| {
            let deviation = |place: &f64| {
                let sum: f64 = harmonics(&drive, *place).iter().zip(&amplitudes).map(|(a, b)| a * b).sum();
                sum + 1e-4 * sign * level as f64
            };
            TurnRun { level, sign, deviation: places(&drive, sign).iter().map(deviation).collect() }
        });
        let found = Deviations::new(&drive, levels(200.0), runs.collect());
        for (found, expected) in found.amplitudes.iter().zip(&amplitudes) {
            assert!((found - expected).abs() < 1e-15, "{found} {expected}");
        }
    }

    #[test]
    fn between_loads_the_deviation_goes_with_the_cube_root() {
        let levels: [f64; LEVELS] = std::array::from_fn(|k| (k as f64 + 1.0).powi(3));
        let values: [f64; LEVELS] = std::array::from_fn(|k| (k * k) as f64);
        for (load, expected) in [(0.1, 0.0), (1.0, 0.0), (3.375, 0.5), (27.0, 4.0), (42.875, 6.5), (1e3, 16.0)] {
            assert!((between(&levels, &values, load) - expected).abs() < 1e-12, "{load}");
        }
    }

    /// A pitch error of the flexspline teeth that bear displaces the output by itself, whatever the load: at every
    /// place the sample is the one without, displaced by the harmonic there.
    #[test]
    fn a_sample_is_spread_with_the_deviation_of_each_place() {
        let mut drive = Drive::hhd_95();
        drive.as_built.flexspline_pitch_harmonics = vec![Harmonic { order: 2, amplitude_um: 5.0, phase_deg: 0.0 }];
        let deviation = |psi: f64| 1e-4 * (2.0 * psi - 0.3).cos();
        let runs = (0..LEVELS).flat_map(|level| [(level, 1.0), (level, -1.0)]).map(|(level, sign)| TurnRun {
            level,
            sign,
            deviation: places(&drive, sign).into_iter().map(deviation).collect(),
        });
        let deviations = Deviations::new(&drive, levels(50.0), runs.collect());
        let (generator_rad, torque_n_m) = (0.3 * TAU / 188.0, -7.0);
        let output_rad = generator_rad / 95.0 + 3e-4;
        let sample =
            Sample { generator_rad, torque_n_m, temperature_c: 20.0, direction: Direction::Backward, output_rad };
        let spread: Vec<Sample> = deviations.spread(&drive, &sample).collect();
        assert_eq!(spread.len(), PLACES);
        for (at, place) in spread.iter().zip(places(&drive, -1.0)) {
            assert!((at.generator_rad - place - generator_rad).abs() < 1e-12);
            let error = at.output_rad - at.generator_rad / 95.0;
            assert!((error - 3e-4 - deviation(at.generator_rad)).abs() < 1e-12, "{error}");
            assert_eq!((at.torque_n_m, at.direction), (torque_n_m, Direction::Backward));
        }
    }
}
