//! Known answers of what a tick is made of, for a slow rate group: whether processor and program still do what they
//! did.

use crate::angle::{GeneratorAngle, OutputAngle};
use crate::crc::crc32;
use crate::drive::{Drive, FixedMember};
use crate::num;
use crate::play::PlayState;
use crate::whole::{SUMS_START, sums};
use core::fmt;
use core::hint::black_box;

/// Part of the self-test with a wrong answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelfTestError {
    /// The CRC-32 of records and images.
    Crc,
    /// The sums over what is kept twice.
    Sums,
    /// The products of 64 bits that turn generator angles into output angles and back.
    Angles,
    /// The play.
    Play,
    /// Single precision: sums, products, a quotient, a root, and to integers and back.
    Numbers,
}

impl fmt::Display for SelfTestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let part = match self {
            Self::Crc => "CRC-32",
            Self::Sums => "sums",
            Self::Angles => "angles",
            Self::Play => "play",
            Self::Numbers => "single precision",
        };
        write!(f, "self-test: {part} gave another answer than it must")
    }
}

impl core::error::Error for SelfTestError {}

/// Answers of the parts.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Answers {
    crc: u32,
    sums: u64,
    angles: [i64; 4],
    play: [i32; 4],
    numbers: [u32; 6],
}

/// Words with bits in all columns.
const WORDS: [u32; 4] = [0x0123_4567, 0x89ab_cdef, 0xfedc_ba98, 0x7654_3210];
/// −12 345 turns and a part, and 7 turns and a part.
const COUNTS: [i64; 2] = [-53_021_371_269_120_001, 31_415_926_535];
/// Forward, backward by less than the play, further; and at other centres and half-widths.
const MOVES: [(i64, i32, i32); 4] = [(0, 100, 5000), (9000, -50, 5000), (5000, 0, 5500), (-40_000, 70, 4000)];
const NUMBERS: [f32; 2] = [12.345_678, -0.007_654_321];
/// The check value of CRC-32/ISO-HDLC, which its catalogues give.
const CHECK: u32 = 0xcbf4_3926;

const fn sums_of([a, b, c, d]: [u32; 4]) -> u64 {
    sums!(SUMS_START; a, b, c, d)
}

const fn angles_of([first, second]: [i64; 2]) -> [i64; 4] {
    // Whole and broken ratio, both senses.
    let (Ok(one), Ok(other)) =
        (Drive::new(188, 190, FixedMember::Flexspline), Drive::new(200, 203, FixedMember::CircularSpline))
    else {
        return [0; 4];
    };
    [
        one.nominal_output(GeneratorAngle::from_counts(first)).counts(),
        one.nominal_generator(OutputAngle::from_counts(second)).counts(),
        other.nominal_output(GeneratorAngle::from_counts(first)).counts(),
        other.nominal_generator(OutputAngle::from_counts(second)).counts(),
    ]
}

const fn play_of([a, b, c, d]: [(i64, i32, i32); 4]) -> [i32; 4] {
    let mut play = PlayState::unknown();
    [follow(&mut play, a), follow(&mut play, b), follow(&mut play, c), follow(&mut play, d)]
}

const fn follow(play: &mut PlayState, (nominal, centre, half): (i64, i32, i32)) -> i32 {
    play.update(OutputAngle::from_counts(nominal), centre, half, true)
}

impl Answers {
    /// Found by the compiler, but those of single precision: they are of IEEE 754 and were found on a host, bit by bit
    /// the same on the target.
    const EXPECTED: Self = Self {
        crc: CHECK,
        sums: sums_of(WORDS),
        angles: angles_of(COUNTS),
        play: play_of(MOVES),
        numbers: [0x4145_688c, 0xbdc1_880e, 0xc4c9_9ce7, 0x4060_df82, 12, 0x4140_0000],
    };

    fn now() -> Self {
        let [a, b] = black_box(NUMBERS);
        let whole = a as i32;
        Self {
            crc: crc32(&black_box(*b"123456789")),
            sums: sums_of(black_box(WORDS)),
            angles: angles_of(black_box(COUNTS)),
            play: play_of(black_box(MOVES)),
            numbers: [
                (a + b).to_bits(),
                (a * b).to_bits(),
                (a / b).to_bits(),
                num::sqrt::<3>(a).to_bits(),
                whole as u32,
                (black_box(whole) as f32).to_bits(),
            ],
        }
    }

    fn judged(&self) -> Result<(), SelfTestError> {
        let Self { crc, sums, angles, play, numbers } = Self::EXPECTED;
        let parts = [
            (self.crc == crc, SelfTestError::Crc),
            (self.sums == sums, SelfTestError::Sums),
            (self.angles == angles, SelfTestError::Angles),
            (self.play == play, SelfTestError::Play),
            (self.numbers == numbers, SelfTestError::Numbers),
        ];
        parts.into_iter().find(|(same, _)| !same).map_or(Ok(()), |(_, error)| Err(error))
    }
}

/// Gives the parts of a tick known inputs and compares what they make of it. Some thousand instructions, nothing of
/// joints, tables or state is touched.
///
/// # Errors
/// [`SelfTestError`]: the first part with another answer. Processor, registers or the program's memory are not what
/// they were; no correction of this program can be trusted.
#[inline(never)]
pub fn self_test() -> Result<(), SelfTestError> {
    Answers::now().judged()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_self_test_passes_here() {
        assert_eq!(Answers::now(), Answers::EXPECTED);
        assert_eq!(self_test(), Ok(()));
    }

    /// Each wrong answer is reported with its part.
    #[test]
    fn another_answer_is_told_by_its_part() {
        let sound = Answers::EXPECTED;
        for bit in 0..32 {
            let mut crc = sound;
            crc.crc ^= 1 << bit;
            assert_eq!(crc.judged(), Err(SelfTestError::Crc));
            let mut sums = sound;
            sums.sums ^= 1 << (2 * bit);
            assert_eq!(sums.judged(), Err(SelfTestError::Sums));
            for i in 0..4 {
                let mut angles = sound;
                angles.angles[i] ^= 1 << (bit + 16);
                assert_eq!(angles.judged(), Err(SelfTestError::Angles));
                let mut play = sound;
                play.play[i] ^= 1 << bit;
                assert_eq!(play.judged(), Err(SelfTestError::Play));
            }
            for i in 0..6 {
                let mut numbers = sound;
                numbers.numbers[i] ^= 1 << bit;
                assert_eq!(numbers.judged(), Err(SelfTestError::Numbers));
            }
        }
    }

    /// The answers are those of the play and of the ratios, not of any arithmetic.
    #[test]
    fn the_known_answers_are_right() {
        let Answers { play, angles, numbers, .. } = Answers::EXPECTED;
        // Anywhere within 100 ± 5000; what was furthest ahead is taken along; all of it stands; then the other flank
        // takes all of it along.
        assert_eq!(play, [100, (-5050 + 5100 - 9000) / 2, (-5050 + 5100 - 9000) / 2 + 4000, 70 + 4000]);
        let [first, second] = COUNTS.map(|counts| counts as f64);
        let expected = [first / 95.0, second * 95.0, first / (-200.0 / 3.0), second * (-200.0 / 3.0)];
        for (angle, expected) in angles.into_iter().zip(expected) {
            assert!((angle as f64 - expected).abs() <= 1.0 + expected.abs() * 1e-15, "{angle} {expected}");
        }
        let [a, b] = NUMBERS.map(f64::from);
        for (found, expected) in numbers.into_iter().zip([a + b, a * b, a / b, a.sqrt()]) {
            let found = f64::from(f32::from_bits(found));
            assert!((found / expected - 1.0).abs() < 4e-7, "{found} {expected}");
        }
    }
}
