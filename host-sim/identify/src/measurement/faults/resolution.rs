//! The lattice on which the values of a channel lie, and a resolution so coarse that no noise blurs it.

use std::ops::Range;

use super::{ARCSEC, Findings};
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::log::Log;
use flexspline_base::robust::{median_of, white_noise};

/// Steps at the output below this are those of good encoders, and below what a drive repeats. *Source*: derived, 19
/// bits a turn; that these are the good ones is a guess.
const COARSE_RAD: f64 = 2.5 * ARCSEC;
/// Noise of more than this share of a step blurs it, so that averages go below the step; a step alone leaves 0.29 of
/// it. *Guess*: half a step of noise, of which an average shows next to nothing, makes 0.58 with the rounding, and the
/// noise of a file is known to a fifth.
const BLURRED: f64 = 0.7;

/// A step is real if the output leaves this share of it as noise… *Guess*: half of the 0.29 that rounding leaves.
const SEEN: f64 = 0.15;
/// …or, in even motion, rows are off those beside them by a quarter of a step in this share, each at its time. *Guess*:
/// an exact channel is so nowhere.
const UNEVEN: f64 = 0.1;
/// A generator that goes from stop to stop by the same angle lies on a lattice too, and is exact. What is rounded is in
/// the error, which differs by 0.4 steps on the mean from one reading to another: where half of them differ by less
/// than this share, nothing is. *Guess*.
const ROUNDED: f64 = 0.1;
/// Rows from one reading to another. At a speed that is nearly a whole number of steps to a row the next one is rounded
/// by just about as much, and a later one is not. *Guess*: octaves, of which one is not near a whole number.
const APART: [usize; 4] = [1, 2, 4, 8];

/// Rows looked at, in each of a few places. *Guess*: it bounds the time; steps show in far fewer.
const ROWS: usize = 4096;
/// A multiple of the step beyond which a gap between neighbouring values says nothing. *Guess*: at 50 steps an error of
/// the step of a per cent is half a step.
const FARTHEST: f64 = 50.0;
/// Mean distance of the gaps from whole multiples, in steps, that a lattice stays below; 0.25 is chance. *Guess*: a
/// third of that.
const WHOLE: f64 = 0.08;

/// The step of the lattice on which `values` lie, or `None` if they lie on none.
pub(super) fn lattice(values: &[f64]) -> Option<f64> {
    let places = (values.len() / ROWS).clamp(1, 5);
    let of_place = |k: usize| {
        let from = values.len().saturating_sub(ROWS) * k / (places - 1).max(1);
        of_piece(&values[from..(from + ROWS).min(values.len())])
    };
    let mut found: Vec<f64> = (0..places).filter_map(of_place).collect();
    // A piece in which few steps occur shows a multiple of the lattice; most pieces have to show one.
    (2 * found.len() > places).then(|| median_of(&mut found))
}

fn of_piece(values: &[f64]) -> Option<f64> {
    let mut sorted: Vec<f64> = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let range = sorted.last()? - sorted.first()?;
    let size = sorted.last()?.abs().max(sorted.first()?.abs());
    let least = (1e-9 * range).max(1e-13 * size);
    let mut gaps: Vec<f64> = sorted.windows(2).map(|v| v[1] - v[0]).filter(|gap| *gap > least).collect();
    gaps.sort_unstable_by(f64::total_cmp);
    let mut step = *gaps.first()?;
    let (mut kk, mut kg, mut off, mut count) = (0.0, 0.0, 0.0, 0);
    for gap in &gaps {
        let k = (gap / step).round();
        if k > FARTHEST {
            break;
        }
        off += (gap / step - k).abs();
        kk += k * k;
        kg += k * gap;
        count += 1;
        step = kg / kk;
    }
    // Few gaps do if each value occurs many times.
    let enough = count >= 8 || (count >= 2 && 20 * (gaps.len() + 1) <= values.len());
    (enough && off < WHOLE * f64::from(count)).then_some(step)
}

/// Resolutions that show in the data, in rad at the output.
pub(super) fn seen(log: &Log, gear: &Gear) -> Vec<(Quantity, f64)> {
    let Some(rows) = longest(log) else { return Vec::new() };
    let (generator, error) = (&log.of(Quantity::Generator)[rows.clone()], &log.of(Quantity::Error)[rows.clone()]);
    let output = &log.output_rad(gear.ratio)[rows.clone()];
    let noise = white_noise(log.pieces(log.of(Quantity::Error)));
    // Where rows are missing, an even motion does not move by the same in each.
    let time = log.get(Quantity::Time).map(|time| &time[rows]);
    let between = |k: usize| time.map_or(0.5, |time| (time[k] - time[k - 1]) / (time[k + 1] - time[k - 1]));
    let uneven = |values: &[f64], step: f64| {
        let off = |(k, v): (usize, &[f64])| (v[1] - v[0] - between(k) * (v[2] - v[0])).abs();
        let bends = (1..).zip(values.windows(3)).filter(|row| off(*row) > 0.25 * step).count();
        bends as f64 >= UNEVEN * values.len() as f64
    };
    let mut found = Vec::new();
    let (channel, measured) = if log.error_recorded { (Quantity::Error, error) } else { (Quantity::Output, output) };
    if let Some(step) = lattice(measured)
        && (noise >= SEEN * step || uneven(measured, step))
    {
        found.push((channel, step));
    }
    if let Some(step) = lattice(generator)
        && uneven(generator, step)
        && differs(generator, error, step) >= ROUNDED * step / gear.ratio.abs()
    {
        found.push((Quantity::Generator, step / gear.ratio.abs()));
    }
    found
}

/// The longest session.
fn longest(log: &Log) -> Option<Range<usize>> {
    log.sessions().max_by_key(Range::len)
}

/// By how much the error differs, at the median, from one row to another where a channel has moved by a step or more,
/// rad: at that distance of [`APART`] where it differs most.
fn differs(channel: &[f64], error: &[f64], step: f64) -> f64 {
    let at = |apart: usize| {
        let moved = (apart..channel.len()).filter(|row| (channel[*row] - channel[row - apart]).abs() > 0.5 * step);
        median_of(&mut moved.map(|row| (error[row] - error[row - apart]).abs()).collect::<Vec<f64>>())
    };
    APART.into_iter().map(at).fold(0.0, f64::max)
}

/// Names a resolution of output or generator that is coarse at the output; nothing can be done about it but to know
/// that rounding is a noise.
pub(in crate::measurement) fn check(log: &mut Log, gear: &Gear, findings: &mut Findings) {
    let noise = white_noise(log.pieces(log.of(Quantity::Error)));
    for (channel, step) in seen(log, gear) {
        if step < COARSE_RAD || noise > BLURRED * step {
            continue;
        }
        log.coarse_rad = log.coarse_rad.max(step);
        let fault = log.fault(FaultName::Quantisation, longest(log).unwrap_or_default());
        findings.add(fault, channel, Treatment::Kept, |fault| {
            fault.size_arcsec = Some(step / ARCSEC);
            format!(
                "the {channel} has a resolution of {:.2} arcsec at the output, and too little noise to blur it ({:.2} \
                 arcsec)",
                step / ARCSEC,
                noise / ARCSEC
            )
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Session;

    /// Ratio of the made-up drive. *Guess*: a round one; any would do.
    const RATIO: f64 = 100.0;

    fn session(rows: u32, generator: impl Fn(f64) -> f64, read_as: impl Fn(f64) -> f64) -> Session {
        let mut random = fastrand::Rng::with_seed(3);
        let mut session = Session::default();
        for k in 0..rows {
            let psi = generator(f64::from(k));
            let noise = (random.f64() + random.f64() + random.f64() - 1.5) * 2.0;
            let output = psi / RATIO + (15.0 * (2.0 * psi).sin() + 1.7 * noise) * ARCSEC;
            session.push([f64::NAN, read_as(psi), output - read_as(psi) / RATIO, f64::NAN]);
        }
        session
    }

    fn of_generator(session: Session) -> Option<f64> {
        let found = Log::on(&mut [session], |log| seen(log, &Gear::of_ratio(RATIO)));
        found.into_iter().find(|(channel, _)| *channel == Quantity::Generator).map(|(_, step)| step)
    }

    #[test]
    fn stops_at_even_distances_are_no_resolution() {
        // Seven readings at each stop.
        let stops = |k: f64| 1.1 * (k / 7.0).floor();
        assert_eq!(of_generator(session(6000, stops, |psi| psi)), None);
    }

    #[test]
    fn an_even_motion_of_which_rows_are_missing_is_no_resolution() {
        let mut random = fastrand::Rng::with_seed(4);
        let mut session = session(6000, |k| 0.002 * k, |psi| psi);
        session.time_s = Some((0..6000).map(|k| 0.02 * f64::from(k)).collect());
        session.leave_out(&(0..6000).map(|_| random.f64() < 0.1).collect::<Vec<bool>>());
        assert_eq!(of_generator(session), None);
    }

    #[test]
    fn a_coarse_encoder_is_one_at_a_speed_of_nearly_whole_steps_to_a_row() {
        // Of 8 bits a turn, in legs of three and of six steps to a row, and a little more, with rests between.
        let step = std::f64::consts::TAU / 256.0;
        let turns = |k: f64| {
            let (leg, in_leg) = ((k / 400.0).floor(), (k % 400.0).min(330.0));
            let by = if leg % 2.0 == 0.0 { 3.056 } else { -6.11 };
            step * (by * in_leg + (leg / 2.0).ceil() * 330.0 * 3.056 - (leg / 2.0).floor() * 330.0 * 6.11)
        };
        let found = of_generator(session(6000, turns, |psi| step * (psi / step).round()));
        assert!((found.expect("coarse") * RATIO - step).abs() < 1e-3 * step, "{found:?}");
    }

    #[test]
    fn a_coarse_encoder_of_a_generator_that_turns_on_is_one() {
        // Steps of 0.1 rad of the generator are 206 arcsec at the output.
        let found = of_generator(session(6000, |k| 0.037 * k, |psi| 0.1 * (psi / 0.1).floor()));
        assert!((found.expect("coarse") * RATIO - 0.1).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn the_step_of_a_lattice_is_found() {
        let mut random = fastrand::Rng::with_seed(2);
        for step in [4.8e-6, 1e-4, 0.7] {
            for moves in [0.3, 3.0] {
                let values: Vec<f64> = (0..30_000)
                    .map(|k| ((f64::from(k) * 0.1 * moves + 2.0 * random.f64()).round() * step * 1e8).round() / 1e8)
                    .collect();
                let found = lattice(&values).expect("a lattice");
                assert!((found / step - 1.0).abs() < 0.02, "{step} {moves}: {found}");
            }
        }
    }

    #[test]
    fn continuous_values_lie_on_none() {
        for seed in 0..200 {
            let mut random = fastrand::Rng::with_seed(seed);
            let values: Vec<f64> = (0..5_000).map(|k| f64::from(k) * 1e-4 + random.f64()).collect();
            assert_eq!(lattice(&values), None, "seed {seed}");
        }
    }

    #[test]
    fn nothing_and_a_constant_lie_on_none() {
        assert_eq!(lattice(&[]), None);
        assert_eq!(lattice(&[2.0; 500]), None);
    }
}
