//! Ticks of a joint, as records of fixed size: into a bounded queue in the tick, out of it and to the ground when there
//! is time.
//!
//! [`Recorder::record`] is called each tick and keeps every n-th. It never waits. Where a record goes,
//! and what happens when there is no room, is a type:
//!
//! | sink | where reader and writer are | when full |
//! |---|---|---|
//! | [`Ring`] | together, or behind a lock of the caller's | the oldest record is lost: the end of a story is kept |
//! | [`Queue`] | the same | the new record is lost: its beginning is kept |
//! | [`Writer`], of [`Queue::split`] | apart, without a lock: interrupt and background | the new record is lost |
//!
//! Each record states how many were lost before it and has a number of its own, so a gap is seen at the other end.
//!
//! # A record as bytes
//! [`Record::encode`] and [`Record::decode`]; [`RECORD_BYTES`] bytes, little endian, CRC-32 (ISO-HDLC) at the end:
//!
//! | offset | type | what |
//! |---|---|---|
//! | 0 | 2 bytes | `FX` |
//! | 2 | `u8` | version: 2 |
//! | 3 | `u8` | bits 0–1 quality (in range, uncertain, extrapolated, disabled), 2–3 mode (off, tracking, hold, safe), |
//! | | | bits 4–6 health of the table (sound, one image, lost, empty, torn), 7 zero |
//! | 4 | `u16` | number of the record; wraps |
//! | 6 | `u16` | records lost since the start; wraps |
//! | 8 | `u32` | number of the tick |
//! | 12 | `u16` | flags ([`Flags::bits`]) |
//! | 14 | `u16` | ticks missed since the start; wraps, as all counters |
//! | 16 | `i64` | estimated output, 2⁻³² turn |
//! | 24 | `f32` | transmission error, rad |
//! | 28 | `f32` | its uncertainty, rad |
//! | 32 | `f32` | correction, rad at the output |
//! | 36 | `f32` | held back of the correction, rad |
//! | 40 | `u16` | ticks in doubt |
//! | 42 | `u16` | words mended |
//! | 44 | `u16` | words skipped |
//! | 46 | `u16` | pages found damaged |
//! | 48 | `u32` | CRC-32 of the 48 bytes before |

use core::fmt;
use core::num::NonZeroU32;
use flexspline::shared::{crc32, seal};
use flexspline::{Counters, Flags, Health, JointState, Mode, Output, OutputAngle, Quality, Store};

/// Size of a record as bytes.
pub const RECORD_BYTES: usize = 52;
const MARK: [u8; 2] = *b"FX";
const VERSION: u8 = 2;

/// One tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Number of the record; wraps.
    pub number: u16,
    /// Records lost since the start; wraps.
    pub lost: u16,
    /// Number of the tick.
    pub tick: u32,
    /// How far estimate and correction can be trusted.
    pub quality: Quality,
    /// The joint's use of its correction.
    pub mode: Mode,
    /// How the table is.
    pub health: Health,
    /// Bits of the [`Flags`].
    pub flags: u16,
    /// Ticks missed since the start; wraps, as all counters.
    pub missed_ticks: u16,
    /// Estimated output, 2⁻³² turn.
    pub output_counts: i64,
    /// Transmission error, rad.
    pub transmission_error_rad: f32,
    /// It lies within ± this, rad.
    pub uncertainty_rad: f32,
    /// Correction, rad at the output.
    pub correction_rad: f32,
    /// Part of it that the limiter held back, rad.
    pub held_back_rad: f32,
    /// [`Counters::doubtful_ticks`].
    pub doubtful_ticks: u16,
    /// [`Counters::words_mended`].
    pub words_mended: u16,
    /// [`Counters::words_skipped`].
    pub words_skipped: u16,
    /// [`Counters::pages_damaged`].
    pub pages_damaged: u16,
}

/// Why bytes are no record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RecordError {
    /// They do not begin with `FX`.
    Mark,
    /// Another version.
    Version {
        /// Version found; 2 is read.
        found: u8,
    },
    /// The CRC-32 does not match.
    Crc {
        /// In the record.
        stated: u32,
        /// Computed.
        computed: u32,
    },
    /// Bits that must be zero are not.
    Reserved,
}

impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Mark => f.write_str("not a record: it must begin with FX"),
            Self::Version { found } => write!(f, "record of version {found}, {VERSION} is read"),
            Self::Crc { stated, computed } => write!(f, "CRC-32 {stated:#010x} stated, {computed:#010x} computed"),
            Self::Reserved => f.write_str("bits that must be zero are not"),
        }
    }
}

impl core::error::Error for RecordError {}

impl Record {
    /// Record of a tick; number and losses are set by a [`Recorder`].
    #[must_use]
    pub fn of(tick: u32, state: &JointState, store: &Store, output: &Output) -> Self {
        let Counters { doubtful_ticks, words_mended, words_skipped, pages_damaged, .. } = store.counters();
        Self {
            number: 0,
            lost: 0,
            tick,
            quality: output.quality,
            mode: state.mode(),
            health: store.health(),
            flags: output.flags.bits(),
            missed_ticks: state.missed_ticks() as u16,
            output_counts: output.output.counts(),
            transmission_error_rad: output.transmission_error_rad,
            uncertainty_rad: output.uncertainty_rad,
            correction_rad: output.correction_rad,
            held_back_rad: output.held_back_rad,
            doubtful_ticks: doubtful_ticks as u16,
            words_mended: words_mended as u16,
            words_skipped: words_skipped as u16,
            pages_damaged: pages_damaged as u16,
        }
    }

    /// The estimated output.
    pub const fn output(&self) -> OutputAngle {
        OutputAngle::from_counts(self.output_counts)
    }

    /// Whether all of `flags` were set.
    #[must_use]
    pub const fn has(&self, flags: Flags) -> bool {
        self.flags & flags.bits() == flags.bits()
    }

    /// As bytes. Not in the tick: the checksum alone takes some 250 instructions.
    #[must_use]
    pub fn encode(&self) -> [u8; RECORD_BYTES] {
        let states = self.quality.code() | (self.mode.code() as u8) << 2 | self.health.code() << 4;
        let pair = |low: u16, high: u16| low as u32 | (high as u32) << 16;
        let [mark, x] = MARK;
        let words = [
            u32::from_le_bytes([mark, x, VERSION, states]),
            pair(self.number, self.lost),
            self.tick,
            pair(self.flags, self.missed_ticks),
            self.output_counts as u32,
            (self.output_counts >> 32) as u32,
            self.transmission_error_rad.to_bits(),
            self.uncertainty_rad.to_bits(),
            self.correction_rad.to_bits(),
            self.held_back_rad.to_bits(),
            pair(self.doubtful_ticks, self.words_mended),
            pair(self.words_skipped, self.pages_damaged),
        ];
        let mut bytes = [0; RECORD_BYTES];
        seal(&mut bytes, words);
        bytes
    }

    /// From bytes.
    ///
    /// # Errors
    /// [`RecordError`].
    pub fn decode(bytes: &[u8; RECORD_BYTES]) -> Result<Self, RecordError> {
        let words = bytes.as_chunks::<4>().0;
        let word = |i: usize| u32::from_le_bytes(words.get(i).copied().unwrap_or_default());
        let low = |i| word(i) as u16;
        let high = |i| (word(i) >> 16) as u16;
        let number = |i| f32::from_bits(word(i));
        let [mark, x, version, states] = word(0).to_le_bytes();
        if [mark, x] != MARK {
            return Err(RecordError::Mark);
        }
        if version != VERSION {
            return Err(RecordError::Version { found: version });
        }
        let contents = bytes.first_chunk::<48>().unwrap_or(&[0; 48]);
        let (stated, computed) = (word(12), crc32(contents));
        if stated != computed {
            return Err(RecordError::Crc { stated, computed });
        }
        Ok(Self {
            number: low(1),
            lost: high(1),
            tick: word(2),
            quality: Quality::from_code(states & 3).ok_or(RecordError::Reserved)?,
            mode: Mode::from_code((states >> 2 & 3) as u32),
            health: Health::from_code(states >> 4).ok_or(RecordError::Reserved)?,
            flags: low(3),
            missed_ticks: high(3),
            output_counts: (word(5) as i64) << 32 | word(4) as i64,
            transmission_error_rad: number(6),
            uncertainty_rad: number(7),
            correction_rad: number(8),
            held_back_rad: number(9),
            doubtful_ticks: low(10),
            words_mended: high(10),
            words_skipped: low(11),
            pages_damaged: high(11),
        })
    }
}

/// Where records go.
pub trait Sink {
    /// Takes a record at once; true if one was lost by that: this one, or one that was there.
    fn put(&mut self, record: Record) -> bool;
}

/// The last `N` records: a new one takes the place of the oldest.
#[derive(Debug, Default)]
pub struct Ring<const N: usize> {
    records: heapless::Deque<Record, N>,
}

impl<const N: usize> Ring<N> {
    /// Without records.
    #[must_use]
    pub const fn new() -> Self {
        Self { records: heapless::Deque::new() }
    }

    /// Takes the oldest record out.
    pub fn take(&mut self) -> Option<Record> {
        self.records.pop_front()
    }
}

impl<const N: usize> Sink for Ring<N> {
    #[inline]
    fn put(&mut self, record: Record) -> bool {
        let full = self.records.is_full();
        if full {
            let _ = self.records.pop_front();
        }
        // There is room now, unless there is none at all.
        self.records.push_back(record).is_err() | full
    }
}

/// The first `N − 1` records: a new one is lost while it is full. `N` a power of two costs least.
#[derive(Debug)]
pub struct Queue<const N: usize> {
    records: heapless::spsc::Queue<Record, N>,
}

impl<const N: usize> Default for Queue<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Queue<N> {
    /// Without records.
    #[must_use]
    pub const fn new() -> Self {
        Self { records: heapless::spsc::Queue::new() }
    }

    /// Takes the oldest record out.
    pub fn take(&mut self) -> Option<Record> {
        self.records.dequeue()
    }

    /// A writer for the tick and a reader for the background; neither waits for the other.
    pub fn split(&mut self) -> (Writer<'_, N>, Reader<'_, N>) {
        let (producer, consumer) = self.records.split();
        (Writer { producer }, Reader { consumer })
    }
}

impl<const N: usize> Sink for Queue<N> {
    #[inline]
    fn put(&mut self, record: Record) -> bool {
        self.records.enqueue(record).is_err()
    }
}

/// The end of a [`Queue`] that records go into.
pub struct Writer<'q, const N: usize> {
    producer: heapless::spsc::Producer<'q, Record, N>,
}

impl<const N: usize> Sink for Writer<'_, N> {
    #[inline]
    fn put(&mut self, record: Record) -> bool {
        self.producer.enqueue(record).is_err()
    }
}

/// The end of a [`Queue`] that records come out of.
pub struct Reader<'q, const N: usize> {
    consumer: heapless::spsc::Consumer<'q, Record, N>,
}

impl<const N: usize> Reader<'_, N> {
    /// Takes the oldest record out.
    pub fn take(&mut self) -> Option<Record> {
        self.consumer.dequeue()
    }
}

/// Whether tick number `tick` is one of every `divisor`-th from `offset` on; of none where there can be none.
#[must_use]
pub fn is_due(tick: u32, divisor: u32, offset: u32) -> bool {
    tick.checked_rem(divisor) == Some(offset)
}

/// Records every n-th tick.
#[derive(Debug)]
pub struct Recorder<S> {
    sink: S,
    every: NonZeroU32,
    number: u16,
    lost: u32,
}

impl<S: Sink> Recorder<S> {
    /// Records the ticks whose number is a multiple of `every`.
    #[must_use]
    pub const fn new(sink: S, every: NonZeroU32) -> Self {
        Self { sink, every, number: 0, lost: 0 }
    }

    /// One tick, after [`Joint::tick`](flexspline::Joint::tick): recorded if it is due. True if a record was lost.
    #[inline]
    pub fn record(&mut self, tick: u32, state: &JointState, store: &Store, output: &Output) -> bool {
        is_due(tick, self.every.get(), 0) && self.record_now(tick, state, store, output)
    }

    /// Records a tick whether due or not: something happened.
    #[inline]
    pub fn record_now(&mut self, tick: u32, state: &JointState, store: &Store, output: &Output) -> bool {
        let record = Record { number: self.number, lost: self.lost as u16, ..Record::of(tick, state, store, output) };
        self.number = self.number.wrapping_add(1);
        let lost = self.sink.put(record);
        self.lost = self.lost.wrapping_add(u32::from(lost));
        lost
    }

    /// Records lost since the start; wraps.
    #[must_use]
    pub const fn lost(&self) -> u32 {
        self.lost
    }

    /// Where they go.
    pub const fn sink(&mut self) -> &mut S {
        &mut self.sink
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline::GeneratorAngle;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn output(error: f32) -> Output {
        Output {
            command: GeneratorAngle::ZERO,
            output: OutputAngle::from_counts(-5),
            transmission_error_rad: error,
            uncertainty_rad: 2.0,
            correction_rad: 3.0,
            held_back_rad: 4.0,
            quality: Quality::Uncertain,
            flags: Flags::GLITCH,
        }
    }

    fn filled<S: Sink>(sink: S, ticks: u32, divisor: u32) -> Recorder<S> {
        let mut recorder = Recorder::new(sink, NonZeroU32::new(divisor).unwrap());
        let (state, store) = (JointState::new(), Store::new());
        for tick in 0..ticks {
            recorder.record(tick, &state, &store, &output(tick as f32));
        }
        recorder
    }

    #[test]
    fn a_full_ring_keeps_the_last_and_a_full_queue_the_first() {
        let mut ring = filled(Ring::<8>::new(), 200, 10);
        let kept: Vec<Record> = core::iter::from_fn(|| ring.sink().take()).collect();
        assert_eq!(kept.iter().map(|r| r.tick).collect::<Vec<_>>(), [120, 130, 140, 150, 160, 170, 180, 190]);
        assert_eq!(kept.iter().map(|r| r.lost).collect::<Vec<_>>(), [4, 5, 6, 7, 8, 9, 10, 11]);
        assert_eq!(ring.lost(), 12);

        let mut queue = filled(Queue::<8>::new(), 200, 10);
        let kept: Vec<Record> = core::iter::from_fn(|| queue.sink().take()).collect();
        assert_eq!(kept.iter().map(|r| r.tick).collect::<Vec<_>>(), [0, 10, 20, 30, 40, 50, 60]);
        assert_eq!(queue.lost(), 13);
        // The first record after the gap reports it.
        assert!(!queue.record_now(201, &JointState::new(), &Store::new(), &output(0.0)));
        let next = queue.sink().take().unwrap();
        assert_eq!((next.number, next.lost, next.tick), (20, 13, 201));
    }

    #[test]
    fn writer_and_reader_share_a_queue() {
        let mut queue = Queue::<16>::new();
        let (writer, mut reader) = queue.split();
        let total = std::thread::scope(|scope| {
            let writing = scope.spawn(move || {
                let mut recorder = filled(writer, 5000, 1);
                // Until there is room again, so that the last is not lost.
                while recorder.record_now(5000, &JointState::new(), &Store::new(), &output(0.0)) {
                    std::thread::yield_now();
                }
                recorder.lost()
            });
            let (mut taken, mut next) = (0u32, 0u32);
            loop {
                let Some(record) = reader.take() else { continue };
                taken += 1;
                assert!(record.tick >= next, "{} after {next}", record.tick);
                next = record.tick + 1;
                if record.tick == 5000 {
                    break (taken, record.number, writing.join().unwrap());
                }
            }
        });
        let (taken, number, lost) = total;
        // Numbers of records wrap, and a full queue is asked again many times on a busy machine.
        assert_eq!((taken + lost) as u16, number.wrapping_add(1));
    }

    #[test]
    fn damaged_records_are_refused_and_named() {
        let bytes = Record::of(7, &JointState::new(), &Store::new(), &output(1.0)).encode();
        for bit in 0..RECORD_BYTES * 8 {
            let mut damaged = bytes;
            damaged[bit / 8] ^= 1 << (bit % 8);
            let error = Record::decode(&damaged).unwrap_err();
            match bit / 8 {
                0 | 1 => assert_eq!(error, RecordError::Mark),
                2 => assert!(matches!(error, RecordError::Version { .. })),
                _ => assert!(matches!(error, RecordError::Crc { .. })),
            }
        }
        let mut reserved = bytes;
        reserved[3] |= 0x40;
        let crc = crc32(&reserved[..48]);
        reserved[48..].copy_from_slice(&crc.to_le_bytes());
        assert_eq!(Record::decode(&reserved), Err(RecordError::Reserved));
    }

    proptest! {
        #[test]
        fn records_come_back_from_their_bytes(
            numbers in prop::array::uniform8(any::<u16>()), tick in any::<u32>(), output_counts in any::<i64>(),
            values in prop::array::uniform4(-1e3f32..1e3), states in prop::array::uniform3(0usize..4),
        ) {
            let [quality, mode, health] = states;
            let record = Record {
                number: numbers[0], lost: numbers[1], tick,
                quality: [Quality::InRange, Quality::Uncertain, Quality::Extrapolated, Quality::Disabled][quality],
                mode: [Mode::Off, Mode::Tracking, Mode::Hold, Mode::Safe][mode],
                health: [Health::Sound, Health::OneImage, Health::Lost, Health::Empty][health],
                flags: numbers[2], missed_ticks: numbers[3], output_counts,
                transmission_error_rad: values[0], uncertainty_rad: values[1], correction_rad: values[2],
                held_back_rad: values[3],
                doubtful_ticks: numbers[4], words_mended: numbers[5], words_skipped: numbers[6],
                pages_damaged: numbers[7],
            };
            prop_assert_eq!(Record::decode(&record.encode()), Ok(record));
        }

        #[test]
        fn any_bytes_are_a_record_or_an_error(
            half in prop::array::uniform32(any::<u8>()), other in prop::array::uniform20(any::<u8>()),
        ) {
            let mut bytes = [0; RECORD_BYTES];
            bytes[..32].copy_from_slice(&half);
            bytes[32..].copy_from_slice(&other);
            prop_assert!(Record::decode(&bytes).is_err());
        }
    }
}
