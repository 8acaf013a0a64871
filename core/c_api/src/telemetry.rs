//! Records of telemetry: kept in the tick, taken out and sent when there is time.

use super::*;
use flexspline_telemetry::{Record, RecordError, is_due};

/// Eight-byte words of a [`FlexsplineRecorder`].
pub const FLEXSPLINE_RECORDER_WORDS: usize = 4;

/// Where all places hold a record: the oldest is lost, the end of a story is kept.
pub const FLEXSPLINE_FULL_LOSE_OLDEST: u8 = 0;
/// The new one is lost, the beginning is kept.
pub const FLEXSPLINE_FULL_LOSE_NEW: u8 = 1;

/// Which records of the caller's list wait to be sent.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineRecorder {
    pub(super) opaque: [MaybeUninit<u64>; FLEXSPLINE_RECORDER_WORDS],
}

/// One tick, as it is kept and as it was sent.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineRecord {
    /// Estimated output, counts of 2^-32 turn.
    pub output_counts: i64,
    /// Number of the tick.
    pub tick: u32,
    /// Transmission error, rad.
    pub transmission_error_rad: f32,
    /// It lies within +- this, rad.
    pub uncertainty_rad: f32,
    /// Correction, rad at the output: target less command over ratio.
    pub correction_rad: f32,
    /// Part of it that the limiter held back, rad.
    pub held_back_rad: f32,
    /// Number of the record; wraps.
    pub number: u16,
    /// Records lost since the start; wraps.
    pub lost: u16,
    /// `FLEXSPLINE_FLAG_...`.
    pub flags: u16,
    /// Ticks missed since the start; wraps, as all counters.
    pub missed_ticks: u16,
    /// Ticks that were done again because something was not whole.
    pub doubtful_ticks: u16,
    /// Words of the copies that were found to differ and made anew.
    pub words_mended: u16,
    /// Words that could not be made anew.
    pub words_skipped: u16,
    /// Pages of an image found damaged.
    pub pages_damaged: u16,
    /// `FLEXSPLINE_QUALITY_...`.
    pub quality: u8,
    /// `FLEXSPLINE_MODE_...`.
    pub mode: u8,
    /// `FLEXSPLINE_HEALTH_...`.
    pub health: u8,
}

/// Which places of a list are filled, and how many records there were.
#[derive(Clone, Copy)]
struct KeptRing {
    divisor: u32,
    offset: u32,
    places: u16,
    first: u16,
    filled: u16,
    number: u16,
    lost: u16,
    lose_new: bool,
}

fn c_record(record: &Record) -> FlexsplineRecord {
    FlexsplineRecord {
        output_counts: record.output_counts,
        tick: record.tick,
        transmission_error_rad: record.transmission_error_rad,
        uncertainty_rad: record.uncertainty_rad,
        correction_rad: record.correction_rad,
        held_back_rad: record.held_back_rad,
        number: record.number,
        lost: record.lost,
        flags: record.flags,
        missed_ticks: record.missed_ticks,
        doubtful_ticks: record.doubtful_ticks,
        words_mended: record.words_mended,
        words_skipped: record.words_skipped,
        pages_damaged: record.pages_damaged,
        quality: record.quality.code(),
        mode: record.mode.code() as u8,
        health: record.health.code(),
    }
}

fn read(record: &FlexsplineRecord) -> Result<Record, FlexsplineStatus> {
    let (quality, health) = (Quality::from_code(record.quality), Health::from_code(record.health));
    let (Some(quality), Some(health), ..=FLEXSPLINE_MODE_SAFE) = (quality, health, record.mode) else {
        return Err(FlexsplineStatus::Argument);
    };
    Ok(Record {
        number: record.number,
        lost: record.lost,
        tick: record.tick,
        quality,
        mode: Mode::from_code(record.mode as u32),
        health,
        flags: record.flags,
        missed_ticks: record.missed_ticks,
        output_counts: record.output_counts,
        transmission_error_rad: record.transmission_error_rad,
        uncertainty_rad: record.uncertainty_rad,
        correction_rad: record.correction_rad,
        held_back_rad: record.held_back_rad,
        doubtful_ticks: record.doubtful_ticks,
        words_mended: record.words_mended,
        words_skipped: record.words_skipped,
        pages_damaged: record.pages_damaged,
    })
}

impl KeptRing {
    /// Position N records behind the first.
    fn place(&self, behind: u16) -> u16 {
        let sum = (self.first as u32).wrapping_add(behind as u32);
        sum.checked_rem(self.places as u32).unwrap_or(0) as u16
    }

    /// The place for a new record, if it is kept. What is lost is counted.
    fn place_for_new(&mut self) -> Option<u16> {
        self.number = self.number.wrapping_add(1);
        if self.filled < self.places {
            self.filled = self.filled.wrapping_add(1);
        } else {
            self.lost = self.lost.wrapping_add(1);
            if self.lose_new {
                return None;
            }
            self.first = self.place(1);
        }
        Some(self.place(self.filled.wrapping_sub(1)))
    }

    /// The place of the oldest, which is free then.
    fn take(&mut self) -> Option<u16> {
        let left = self.filled.checked_sub(1)?;
        let place = self.first;
        (self.first, self.filled) = (self.place(1), left);
        Some(place)
    }
}

/// Length in bytes of a list of records.
fn length(places: u16) -> usize {
    size_of::<FlexsplineRecord>().saturating_mul(places as usize)
}

/// Makes a recorder for a list of the given number of records (1 or more), which is the caller's and given with every
/// call. It keeps every `divisor`-th tick, from `offset` on; `full` (`FLEXSPLINE_FULL_...`) says what is lost where
/// there is no room.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_recorder_init(
    recorder: *mut FlexsplineRecorder,
    places: u16,
    divisor: u32,
    offset: u32,
    full: u8,
) -> FlexsplineStatus {
    status(|| {
        let lose_new = match full {
            FLEXSPLINE_FULL_LOSE_OLDEST => false,
            FLEXSPLINE_FULL_LOSE_NEW => true,
            _ => return Err(FlexsplineStatus::Argument),
        };
        if places == 0 || offset >= divisor {
            return Err(FlexsplineStatus::Argument);
        }
        let ring = KeptRing { divisor, offset, places, first: 0, filled: 0, number: 0, lost: 0, lose_new };
        put(recorder, Object::Recorder, ring)
    })
}

/// One tick, after `flexspline_tick`: kept if it is due, or whether due or not (`at_once` 1: something happened). Never
/// waits. `records` are those that the recorder was made for.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_recorder_see(
    recorder: *mut FlexsplineRecorder,
    records: *mut FlexsplineRecord,
    tick: u32,
    at_once: u8,
    state: *const FlexsplineState,
    store: *const FlexsplineStore,
    output: *const FlexsplineOutput,
) -> FlexsplineStatus {
    status(|| {
        usable(records)?;
        let given = given(output)?;
        clear(span(recorder), [span(state), span(store), span(output)])?;
        let kept: &mut KeptRing = get_mut(recorder, Object::Recorder)?;
        clear((records as usize, length(kept.places)), [span(recorder), span(state), span(store), span(output)])?;
        let (state, store) = (state_of(state)?, store_of(store)?);
        if at_once == 0 && !is_due(tick, kept.divisor, kept.offset) {
            return Ok(());
        }
        let (number, lost) = (kept.number, kept.lost);
        let record = c_record(&Record { number, lost, ..Record::of(tick, state, store, &given) });
        match kept.place_for_new() {
            Some(place) => give(records.wrapping_add(place as usize), record),
            None => Ok(()),
        }
    })
}

/// Takes the oldest record out: `is_taken` is 1, or 0 if none waits, and `record` is as it was. With the interrupt of
/// the tick held off.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_recorder_take(
    recorder: *mut FlexsplineRecorder,
    records: *const FlexsplineRecord,
    record: *mut FlexsplineRecord,
    is_taken: *mut u8,
) -> FlexsplineStatus {
    answer(is_taken, [span(recorder), span(record)], || {
        usable(records)?;
        usable(record)?;
        apart([span(recorder), span(record)])?;
        let kept: &mut KeptRing = get_mut(recorder, Object::Recorder)?;
        let list = (records as usize, length(kept.places));
        clear(list, [span(recorder), span(record), span(is_taken)])?;
        let found = kept.take();
        if let Some(place) = found {
            give(record, copied(records.wrapping_add(place as usize))?)?;
        }
        Ok(found.is_some() as u8)
    })
}

/// Writes a record as `FLEXSPLINE_RECORD_BYTES` bytes with a CRC-32, for the ground: docs/telemetry.xtce.xml is their
/// dictionary. `FLEXSPLINE_STATUS_ARGUMENT` if its quality, mode or health is none.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_record_encode(
    record: *const FlexsplineRecord,
    bytes: *mut [u8; FLEXSPLINE_RECORD_BYTES],
) -> FlexsplineStatus {
    answer(bytes, [span(record)], || Ok(read(&copied(record)?)?.encode()))
}

/// Reads such bytes (`FLEXSPLINE_RECORD_BYTES`), on the ground: `FLEXSPLINE_STATUS_SAVED` if they are damaged or no
/// record, `FLEXSPLINE_STATUS_ARGUMENT` if they are one of another version.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_record_decode(first: *const u8, record: *mut FlexsplineRecord) -> FlexsplineStatus {
    answer(record, [(first as usize, FLEXSPLINE_RECORD_BYTES)], || {
        let found = Record::decode(&copied(first.cast::<[u8; FLEXSPLINE_RECORD_BYTES]>())?);
        found.map(|record| c_record(&record)).map_err(|error| match error {
            RecordError::Version { .. } => FlexsplineStatus::Argument,
            RecordError::Mark | RecordError::Crc { .. } | RecordError::Reserved => FlexsplineStatus::Saved,
        })
    })
}
