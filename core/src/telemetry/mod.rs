//! Reports of a joint: records for the ground, events for a log.

#[cfg(feature = "defmt")]
mod defmt;
mod events;
mod records;

pub use events::{Event, Events, Watch};
#[cfg(any(test, feature = "c-api"))]
pub(crate) use records::is_due;
pub use records::{Queue, RECORD_BYTES, Reader, Record, RecordError, Recorder, Ring, Sink, Writer};
