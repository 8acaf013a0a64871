//! What an encoder at the output says of a joint with a table: where the generator is, and what the torque is.
//!
//! A table has two errors at each place and torque, of steady motion forward and backward. The output rests on one of
//! them or between, and both grow with the torque. So the ends of an interval lie on one flank each, at a torque that
//! is an end of its interval, or a node between: a measured table may fall by a little from node to node.

use super::adjustment::{Adjustment, bounded};
use super::runtime::Joint;
use crate::angle::{GeneratorAngle, OutputAngle, RAD_PER_COUNT, counts_from_rad};
use crate::num;
use crate::play::PlayState;
use crate::store::Store;
use crate::table::{Doubt, Memory, Quality, play_at};

/// An end of an interval of torques is found to this part of the way from node to node, 2⁻¹⁰: a thousandth. A guess:
/// 0.03 N·m between nodes that are 30 apart.
const HALVINGS: u32 = 10;

/// Where the generator is: [`Joint::locate`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Located {
    /// Generator angle, the middle of what is possible; the reading times the ratio where it is disabled.
    pub generator: GeneratorAngle,
    /// It lies within ± this, rad of the generator; infinite where it is disabled. The sum of the three below.
    pub half_width_rad: f32,
    /// Part of it that the reading makes.
    pub of_reading_rad: f32,
    /// Part of it that the play makes.
    pub of_play_rad: f32,
    /// The rest: the load, and the table's inverse.
    pub of_load_rad: f32,
    /// Whole turns of the generator that remain possible: 1 where it is located, 0 where it is disabled.
    pub turns: u32,
    /// `InRange`: located. `Uncertain`: more than half a turn to either side remains possible; the largest of the three
    /// parts says why. `Extrapolated`: torque or temperature may lie beyond the table, whose edge is used. `Disabled`:
    /// a number is not finite or a half-width below 0, or there is no table for this joint that is whole.
    pub quality: Quality,
}

/// The torque by the wind-up: [`Joint::torque`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueFromWindUp {
    /// The middle of the interval, within the table's range, N·m; NaN where it is disabled.
    pub torque_n_m: f32,
    /// The torque is no less, N·m; −∞ where the table ends before the reading is reached.
    pub low_n_m: f32,
    /// It is no more, N·m; ∞ likewise.
    pub high_n_m: f32,
    /// `Uncertain`: the flank or the adjustment is not known. `Extrapolated`: the interval is open, or the temperature
    /// lies beyond the table. `Disabled`: as in [`Located`], or the adjustment is lost, or the table has no wind-up
    /// that the reading resolves.
    pub quality: Quality,
}

/// Whether a number can be the half of a width.
fn is_half_width(value: f32) -> bool {
    num::finite(value) && value >= 0.0
}

impl Joint {
    /// Where the generator is, by an absolute reading of the output under a torque, both to within ± their half-widths.
    /// For start-up, where the generator's encoder has another zero each time it is switched on: the answer is the
    /// angle that [`Encoder::start`](crate::Encoder::start) and [`StartUp::new`](crate::StartUp::new) begin with.
    ///
    /// The half-width of the reading includes what the table missed of its samples
    /// ([`Table::projection_worst_rad`](crate::Table::projection_worst_rad)). The turn of the output is the one that is
    /// given. Two inverse solutions at both ends of the torque's interval and at each node between: 2100 to 38 700
    /// instructions.
    #[must_use]
    pub fn locate(
        &self,
        store: &Store,
        output: OutputAngle,
        output_half_width_rad: f32,
        torque_n_m: f32,
        torque_half_width_n_m: f32,
    ) -> Located {
        let drive = self.drive();
        let nothing = Located {
            generator: drive.nominal_generator(output),
            half_width_rad: f32::INFINITY,
            of_reading_rad: f32::INFINITY,
            of_play_rad: f32::INFINITY,
            of_load_rad: f32::INFINITY,
            turns: 0,
            quality: Quality::Disabled,
        };
        if !is_half_width(output_half_width_rad) || !is_half_width(torque_half_width_n_m) {
            return nothing;
        }
        let reading = (counts_from_rad(output_half_width_rad) as i64).wrapping_add(1);
        let mut quality = Quality::InRange;
        // The nominal output less the reading, and half of the play, counts.
        let (mut least, mut most, mut play) = (i64::MAX, i64::MIN, 0);
        let ends = [torque_n_m - torque_half_width_n_m, torque_n_m + torque_half_width_n_m];
        for (torque, mut doubt) in store.torques(ends) {
            let (model, point) = self.at(store, torque);
            doubt.0 |= point.doubt.0;
            let off = reading.wrapping_add(point.jump as i64).wrapping_add(store.plan().hold as i64);
            for (backward, off) in [(false, off), (true, off.wrapping_neg())] {
                let (error, sane) = model.solve(&point, output.offset_counts(off), backward, &mut doubt);
                let nominal = off.wrapping_sub(error as i64);
                (least, most) = (least.min(nominal), most.max(nominal));
                quality = quality.max(point.quality(point.finite & sane & doubt.none(), true));
            }
            play = play.max(point.half_width as i64);
        }
        if quality == Quality::Disabled {
            return nothing;
        }
        let [first, last] = [least, most].map(|off| drive.nominal_generator(output.offset_counts(off)).counts());
        let width = last.wrapping_sub(first);
        let turns = (width.unsigned_abs() >> 32).saturating_add(1) as u32;
        let half = most.wrapping_sub(least).wrapping_add(1) >> 1;
        let play = play.min(half.wrapping_sub(reading));
        let rad = |counts: i64| counts as f32 * (RAD_PER_COUNT * drive.ratio().abs());
        Located {
            generator: GeneratorAngle::from_counts(first.wrapping_add(width >> 1)),
            half_width_rad: rad(half),
            of_reading_rad: rad(reading),
            of_play_rad: rad(play),
            of_load_rad: rad(half.wrapping_sub(reading).wrapping_sub(play)),
            turns,
            quality: match quality {
                Quality::Extrapolated => quality,
                _ if turns > 1 => Quality::Uncertain,
                _ => Quality::InRange,
            },
        }
    }

    /// The torque, by the wind-up: at which the table, at this generator angle and on the flank that `play` knows, has
    /// the output where it is read. On a flank that is not known, or between both, it is any torque from that of the
    /// one to that of the other: twice the drag, and all that the play swallows.
    ///
    /// The flank is known after motion through the whole play, of the state of a joint whose ticks were given the
    /// torque ([`JointState::play`](crate::JointState::play)). Else say [`PlayState::after_motion`] while the output
    /// moves, and [`PlayState::unknown`] where it stands: a load that changes takes it to the other flank. The
    /// half-width of the reading is that of [`Self::locate`]; the adjustment is the one of the tick.
    ///
    /// At each node of the torque axis, and ten times for each end of the interval, a quarter of a tick: 15 500
    /// instructions with the table of a cam, 37 600 with that of two rollers, which has the most nodes.
    #[must_use]
    pub fn torque(
        &self,
        store: &Store,
        play: &PlayState,
        adjustment: &Adjustment,
        generator: GeneratorAngle,
        output: OutputAngle,
        output_half_width_rad: f32,
    ) -> TorqueFromWindUp {
        let nothing = TorqueFromWindUp {
            torque_n_m: f32::NAN,
            low_n_m: f32::NEG_INFINITY,
            high_n_m: f32::INFINITY,
            quality: Quality::Disabled,
        };
        let range = store.torque_range();
        let [least, most] = range;
        let (_, point) = self.at(store, least);
        let quality = point.quality(point.finite & point.doubt.none(), true);
        let Some([mean, half_width, off]) = adjustment.open() else { return nothing };
        if quality == Quality::Disabled || !is_half_width(output_half_width_rad) {
            return nothing;
        }
        let drive = self.drive();
        let nominal = drive.nominal_output(generator);
        let phases = drive.phases(generator, nominal);
        let [forward, backward] = play.flanks_at(nominal);
        let (mut doubt, mut sane) = (Doubt::default(), true);
        // The smallest and the largest error that the output can have under a torque, counts.
        let mut errors_at = |torque: f32, found: Doubt| {
            let point = store.locate(torque, bounded(mean), bounded(half_width));
            doubt.0 |= point.doubt.0 | found.0;
            let play = play_at(store, &point, phases, &mut doubt);
            sane &= play.sane;
            let behind = if backward { play.half } else { play.half.wrapping_neg() };
            let ahead = if forward { play.half.wrapping_neg() } else { play.half };
            [behind.wrapping_sub(point.jump), ahead.wrapping_add(point.jump)].map(|side| play.centre.wrapping_add(side))
        };
        let read = output.minus_small_counts(nominal);
        let uncertain = counts_from_rad(output_half_width_rad).saturating_add(off).saturating_add(1);
        let [read_least, read_most] = [read.saturating_sub(uncertain), read.saturating_add(uncertain)];
        // From a torque at which the error is too small to the next that is enough, and from one that is enough to the
        // next at which it is too large.
        let (mut low, mut high) = ([most, f32::INFINITY], [f32::NEG_INFINITY, least]);
        let mut before = f32::NEG_INFINITY;
        let (mut first, mut last) = (None, 0);
        for (torque, found) in store.torques(range) {
            let [smallest, largest] = errors_at(torque, found);
            if largest >= read_least && low[1] == f32::INFINITY {
                low = [before, torque];
            }
            if smallest <= read_most {
                high = [torque, f32::INFINITY];
            } else if high[1] == f32::INFINITY {
                high[1] = torque;
            }
            (before, first, last) = (torque, first.or(Some(largest)), largest);
        }
        let [low, _] = narrowed(low, |torque| errors_at(torque, Doubt::default())[1] >= read_least);
        let [_, high] = narrowed(high, |torque| errors_at(torque, Doubt::default())[0] > read_most);
        let ends = [low, high];
        let open = ends.map(|end| !num::finite(end));
        let resolved = low <= high && open != [true; 2] && first.is_some_and(|first| first < last);
        if !(sane & doubt.none() & resolved) {
            return nothing;
        }
        let [below, above] = ends.map(|end| num::within(end, range));
        TorqueFromWindUp {
            torque_n_m: 0.5 * (below + above),
            low_n_m: low,
            high_n_m: high,
            quality: match quality {
                _ if open != [false; 2] => Quality::Extrapolated,
                Quality::InRange if (forward == backward) | (off > 0) => Quality::Uncertain,
                _ => quality,
            },
        }
    }
}

/// Halves the way between two torques, of which the second is above what is looked for; one that is open stays.
fn narrowed([mut below, mut above]: [f32; 2], mut is_above: impl FnMut(f32) -> bool) -> [f32; 2] {
    if num::finite(below) && num::finite(above) {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (below + above);
            if is_above(middle) {
                above = middle;
            } else {
                below = middle;
            }
        }
    }
    [below, above]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Drive, FixedMember};
    use crate::fixture::{self, ARCSEC, LIMITS};
    use crate::joint::Overrun;
    use crate::play::Direction;
    use crate::store::Images;
    use crate::table::{Approach, Table, image_bytes};
    use crate::upset::Upset;
    use crate::write::{Provenance, TableData, write_image};
    use std::vec;
    use std::vec::Vec;

    /// A joint and a store with this table, at 20 °C.
    fn joint(drive: Drive, image: &[u8]) -> (Joint, Store) {
        let mut store = Store::new();
        let second = image.to_vec();
        store.activate(&Images::new(image, &second), &drive, 20.0).unwrap();
        (Joint::new(drive, LIMITS, Overrun::HoldLast).unwrap(), store)
    }

    /// A table of two torques, -50 and 50 N·m, with this error at both ends and half of a play.
    fn plain(drive: Drive, mean_rad: &[f32; 2], half_width_rad: f32) -> Vec<u8> {
        let data = TableData {
            drive,
            torque_nodes_n_m: &[-50.0, 50.0],
            temperature_nodes_c: &[20.0],
            ripple_nodes: 0,
            mean_rad,
            half_width_rad: &[half_width_rad; 2],
            mean_ripple_rad: &[],
            half_width_ripple_rad: &[],
            generator_curve_rad: &[],
            material_curve_rad: &[],
            output_curve_rad: &[],
            projection_worst_rad: 0.0,
            projection_rms_rad: 0.0,
        };
        let provenance = Provenance { error_limit_rad: 0.05, temperature_range_c: [20.0; 2], ..fixture::provenance() };
        let mut image = vec![0; image_bytes(2, 1, 0, [0; 3])];
        write_image(&data, &provenance, &mut image, fixture::id).unwrap();
        image
    }

    /// Numbers from 0 to 1 that are the same in every run.
    struct Random(u64);

    impl Random {
        fn part(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }

        fn within(&mut self, size: f64) -> f64 {
            size * (2.0 * self.part() - 1.0)
        }
    }

    /// Errors of steady motion forward and backward, rad.
    fn flanks(generator_rad: f64, torque: f64) -> [f64; 2] {
        [Direction::Forward, Direction::Backward].map(|way| fixture::error(generator_rad, torque, 20.0, way, true))
    }

    /// 10 000 starts: a play of 60″, 17 bits at the output, loads over the table's range that are known to 5 N·m, at
    /// rest anywhere in the play. None is off by more than it says, and one in ten may lie beyond the table.
    #[test]
    fn a_generator_is_located_from_any_start_or_it_is_said() {
        let image = fixture::image(true);
        let (joint, store) = joint(fixture::drive(), &image);
        let missed = f64::from(Table::check(&image).unwrap().projection_worst_rad());
        let bit = core::f64::consts::TAU / f64::from(1 << 17);
        let (mut random, mut located, mut worst, mut widest) = (Random(7), 0, 0.0_f64, 0.0_f64);
        for start in 0..10_000 {
            let (generator, torque) = (random.within(300.0), random.within(50.0));
            let [forward, backward] = flanks(generator, torque);
            let output = generator / 95.0 + forward + random.part() * (backward - forward);
            let reading = OutputAngle::from_rad((output / bit).round() * bit).unwrap();
            let said = (torque + random.within(5.0)) as f32;
            let found = joint.locate(&store, reading, (0.5 * bit + missed) as f32, said, 5.0);
            let off = (found.generator.to_rad() - generator).abs();
            let extrapolates = said.abs() > 45.0;
            assert_eq!(found.quality == Quality::Extrapolated, extrapolates, "{start}: {said} {found:?}");
            assert!(off <= f64::from(found.half_width_rad) && found.turns == 1, "{start}: {off} {found:?}");
            let sum = found.of_reading_rad + found.of_play_rad + found.of_load_rad;
            assert!((sum - found.half_width_rad).abs() < 1e-6, "{found:?}");
            if found.quality == Quality::InRange {
                (located, worst) = (located + 1, worst.max(off));
                widest = widest.max(f64::from(found.half_width_rad));
            }
        }
        std::println!("{located} of 10000 located; off by {worst:.4} rad at most, said ±{widest:.4} rad at most");
        assert!(located > 8900 && worst > 0.5 * widest && widest < 0.06, "{located} {worst} {widest}");
    }

    /// What leaves more than half a turn says so, and by what; with a generator that turns against the output too.
    #[test]
    fn more_than_half_a_turn_is_not_located() {
        for (fixed, ratio) in [(FixedMember::Flexspline, 95.0), (FixedMember::CircularSpline, 94.0)] {
            let drive = Drive::new(188, 190, fixed).unwrap();
            let turn = core::f32::consts::TAU / ratio;
            for (half_play, reading, turns) in
                [(0.01, 0.4 * turn - 0.01, 1), (0.01, 0.6 * turn, 2), (0.04, 0.1 * turn, 2), (0.01, 1.6 * turn, 4)]
            {
                let (joint, store) = joint(drive, &plain(drive, &[-1e-3, 1e-3], half_play));
                let output = OutputAngle::from_rad(0.3).unwrap();
                let found = joint.locate(&store, output, reading, 25.0, 0.0);
                assert_eq!(found.turns, turns, "{found:?}");
                assert_eq!(found.quality == Quality::Uncertain, turns > 1, "{found:?}");
                assert_eq!(found.of_play_rad > found.of_reading_rad, half_play > reading);
                let middle = (0.3 - 0.5e-3) * drive.exact_ratio();
                assert!((found.generator.to_rad() - middle).abs() < 1e-5, "{found:?} {middle}");
                assert!((found.half_width_rad - (half_play + reading) * ratio).abs() < 1e-5, "{found:?}");
                let loaded = joint.locate(&store, output, 0.0, 0.0, 40.0);
                assert!((loaded.of_load_rad - 0.8e-3 * ratio).abs() < 1e-5, "{loaded:?}");
            }
        }
    }

    /// An output that is ahead of ideal wants less of it, whichever way the generator turns.
    #[test]
    fn the_correction_opposes_the_error_for_both_senses() {
        for fixed in [FixedMember::Flexspline, FixedMember::CircularSpline] {
            let drive = Drive::new(188, 190, fixed).unwrap();
            let (joint, store) = joint(drive, &plain(drive, &[0.009, 0.01], 1e-4));
            let forward = Approach::Moving(Direction::Forward);
            let command = joint.inverse(&store, OutputAngle::ZERO, 50.0, forward).generator.to_rad();
            assert!((command + (0.01 - 1e-4) * drive.exact_ratio()).abs() < 1e-6, "{command}");
        }
    }

    #[test]
    fn what_is_no_number_locates_nothing_and_is_no_torque() {
        let (joint, store) = joint(fixture::drive(), &fixture::image(true));
        let (at, play, none) = (OutputAngle::ZERO, PlayState::unknown(), Adjustment::default());
        let wrong = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        for number in wrong {
            for found in [
                joint.locate(&store, at, number, 1.0, 1.0),
                joint.locate(&store, at, 1e-5, number, 1.0),
                joint.locate(&store, at, 1e-5, 1.0, number),
            ] {
                assert_eq!((found.quality, found.turns, found.half_width_rad), (Quality::Disabled, 0, f32::INFINITY));
            }
        }
        for number in wrong.into_iter().chain([-1e-9]) {
            let found = joint.torque(&store, &play, &none, GeneratorAngle::ZERO, at, number);
            assert!(found.quality == Quality::Disabled && found.torque_n_m.is_nan(), "{found:?}");
            assert_eq!([found.low_n_m, found.high_n_m], [f32::NEG_INFINITY, f32::INFINITY]);
        }
        let empty = Store::new();
        assert_eq!(joint.locate(&empty, at, 0.0, 0.0, 0.0).quality, Quality::Disabled);
        let found = joint.torque(&empty, &play, &none, GeneratorAngle::ZERO, at, 0.0);
        assert_eq!(found.quality, Quality::Disabled);
        // A table without wind-up.
        let (joint, store) = self::joint(fixture::drive(), &plain(fixture::drive(), &[1e-4; 2], 1e-4));
        for read in [-1e-3, 0.0, 1e-3] {
            let output = OutputAngle::from_rad(read).unwrap();
            let found = joint.torque(&store, &play, &none, GeneratorAngle::ZERO, output, 1e-6);
            assert_eq!(found.quality, Quality::Disabled, "{read}");
        }
    }

    /// On both flanks and between them, with a reading that is off by up to what it says: the interval holds the
    /// torque.
    #[test]
    fn the_interval_of_a_torque_holds_it() {
        let image = fixture::image(true);
        let (joint, store) = joint(fixture::drive(), &image);
        let missed = f64::from(Table::check(&image).unwrap().projection_worst_rad());
        let noise = 2.0 * ARCSEC;
        let mut random = Random(3);
        let (mut squares, mut wide) = ([0.0; 3], [0.0_f64; 3]);
        for trial in 0..3000 {
            let (generator, torque) = (random.within(300.0), random.within(45.0));
            let [forward, backward] = flanks(generator, torque);
            let (which, play, error) = match trial % 3 {
                0 => (0, PlayState::after_motion(Direction::Forward), forward),
                1 => (1, PlayState::after_motion(Direction::Backward), backward),
                _ => (2, PlayState::unknown(), forward + random.part() * (backward - forward)),
            };
            let output = OutputAngle::from_rad(generator / 95.0 + error + random.within(noise)).unwrap();
            let angle = GeneratorAngle::from_rad(generator).unwrap();
            let found = joint.torque(&store, &play, &Adjustment::default(), angle, output, (noise + missed) as f32);
            let held = f64::from(found.low_n_m) <= torque && torque <= f64::from(found.high_n_m);
            assert!(held, "{trial}: {torque} {found:?}");
            assert_eq!(found.quality == Quality::Uncertain, which == 2, "{trial}: {torque} {found:?}");
            squares[which] += (f64::from(found.torque_n_m) - torque).powi(2) / 1000.0;
            wide[which] = wide[which].max(f64::from(found.high_n_m - found.low_n_m));
        }
        let rms = squares.map(f64::sqrt);
        std::println!("forward, backward, at rest: rms {rms:.3?} N·m, intervals {wide:.3?} N·m wide at most");
        // 2″ are 0.3 N·m at 3e4 N·m/rad; at rest twice the drag comes on top.
        assert!(rms[0] < 0.2 && rms[1] < 0.2 && wide[0] < 0.8 && wide[1] < 0.8, "{rms:?} {wide:?}");
        assert!(wide[2] > 2.9 && wide[2] < 4.5, "{wide:?}");
    }

    /// Ticks and motion leave the flank; at no load the interval goes from the drag of the one to that of the other;
    /// beyond the table it is open.
    #[test]
    fn a_torque_follows_the_flank_and_ends_with_the_table() {
        let (joint, store) = joint(fixture::drive(), &fixture::image(false));
        let mut play = PlayState::unknown();
        let at = |rad: f64| GeneratorAngle::from_rad(rad).unwrap();
        let ask = |play: &PlayState, adjustment: Adjustment, rad: f64, error: f64| {
            let output = OutputAngle::from_rad(rad / 95.0 + error).unwrap();
            joint.torque(&store, play, &adjustment, at(rad), output, 1e-7)
        };
        let none = Adjustment::default();
        for step in 0..100 {
            let _ = joint.forward(&store, &mut play, at(1.0 + 1e-3 * f64::from(step)), 20.0);
        }
        let error = |torque: f64, way| fixture::error(1.2, torque, 20.0, way, false);
        let found = ask(&play, none, 1.2, error(30.0, Direction::Forward));
        assert!(found.quality == Quality::InRange && (found.torque_n_m - 30.0).abs() < 0.1, "{found:?}");
        // Back through the play: the other flank.
        let back = fixture::error(0.6, -7.0, 20.0, Direction::Backward, false);
        let found = ask(&play, none, 0.6, back);
        assert!(found.quality == Quality::InRange && (found.torque_n_m + 7.0).abs() < 0.1, "{found:?}");
        // What an adjustment adds to the error is no torque, and what it is off by widens the interval.
        let learnt = Adjustment::from_rad(5e-5, 0.0);
        let more = ask(&play, learnt, 0.6, back + 5e-5);
        assert!((more.torque_n_m - found.torque_n_m).abs() < 0.01, "{more:?}");
        let wider = ask(&play, learnt.with_uncertainty(3e-5), 0.6, back + 5e-5);
        assert!(wider.quality == Quality::Uncertain && wider.high_n_m - more.high_n_m > 0.8, "{wider:?}");
        // Nothing is known of the flank, no load.
        let found = ask(&PlayState::unknown(), none, 1.2, 0.0);
        assert!(found.quality == Quality::Uncertain && (found.low_n_m + 1.5).abs() < 0.02, "{found:?}");
        assert!((found.high_n_m - 1.5).abs() < 0.02 && found.torque_n_m.abs() < 0.02, "{found:?}");
        let beyond = [error(50.0, Direction::Backward) + 1e-5, error(-50.0, Direction::Forward) - 1e-5];
        let [above, below] = beyond.map(|error| ask(&PlayState::unknown(), none, 1.2, error));
        assert!(above.quality == Quality::Extrapolated && above.high_n_m == f32::INFINITY, "{above:?}");
        assert!(below.quality == Quality::Extrapolated && below.low_n_m == f32::NEG_INFINITY, "{below:?}");
        assert!(above.low_n_m == 50.0 && below.high_n_m == -50.0, "{above:?} {below:?}");
        assert_eq!([above.torque_n_m, below.torque_n_m], [50.0, -50.0]);
    }

    /// Every bit of a store: the same answers, or none.
    #[test]
    fn no_single_bit_of_a_store_gives_another_place_or_torque() {
        let (joint, mut store) = joint(fixture::drive(), &fixture::image(true));
        let (at, play) = (GeneratorAngle::new(3, 7 << 20), PlayState::after_motion(Direction::Forward));
        let output = fixture::drive().nominal_output(at).offset_rad(3e-4);
        let answers = |store: &Store| {
            let torque = joint.torque(store, &play, &Adjustment::default(), at, output, 1e-5);
            (joint.locate(store, output, 1e-5, 4.0, 2.0), torque)
        };
        let expected = answers(&store);
        assert_eq!([expected.0.quality, expected.1.quality], [Quality::InRange; 2], "{expected:?}");
        let mut silenced = [0; 2];
        for bit in 0..store.bits() {
            let flip = |store: &mut Store| store.flip(bit, &mut std::string::String::new());
            flip(&mut store);
            let (located, torque) = answers(&store);
            flip(&mut store);
            assert!(located == expected.0 || located.quality == Quality::Disabled, "{bit}: {located:?}");
            assert!(torque == expected.1 || torque.quality == Quality::Disabled, "{bit}: {torque:?}");
            silenced[0] += u32::from(located != expected.0);
            silenced[1] += u32::from(torque != expected.1);
        }
        std::println!("of {} bits {silenced:?} leave no answer", store.bits());
        assert!(silenced[0] > 1000 && silenced[1] > 1000, "{silenced:?}");
    }
}
