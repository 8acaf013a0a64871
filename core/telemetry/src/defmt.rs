//! [`Event`] for a log by `defmt`: by name, without `core::fmt`.

use crate::Event;
use defmt::{Format, Formatter, write};
use flexspline::{Health, Mode};

/// A value of the core, which knows nothing of logs, by its name.
struct Named<T>(T);

impl Format for Named<&Mode> {
    fn format(&self, f: Formatter<'_>) {
        match self.0 {
            Mode::Off => write!(f, "off"),
            Mode::Tracking => write!(f, "tracking"),
            Mode::Hold => write!(f, "hold"),
            Mode::Safe => write!(f, "safe"),
        }
    }
}

impl Format for Named<&Health> {
    fn format(&self, f: Formatter<'_>) {
        match self.0 {
            Health::Sound => write!(f, "sound"),
            Health::OneImage => write!(f, "one image"),
            Health::Lost => write!(f, "lost"),
            Health::Empty => write!(f, "empty"),
            Health::Torn => write!(f, "torn"),
        }
    }
}

impl Format for Event {
    fn format(&self, f: Formatter<'_>) {
        match self {
            Self::Mode { from, to } => write!(f, "Mode {{ from: {}, to: {} }}", Named(from), Named(to)),
            Self::Health { from, to } => write!(f, "Health {{ from: {}, to: {} }}", Named(from), Named(to)),
            Self::PageDamaged { image, page } => {
                write!(f, "PageDamaged {{ image: {=usize}, page: {=usize} }}", image, page)
            }
            Self::TableDoubt => write!(f, "TableDoubt"),
            Self::Fallback => write!(f, "Fallback"),
            Self::Recovered => write!(f, "Recovered"),
            Self::Overrun { missed_ticks } => write!(f, "Overrun {{ missed_ticks: {=u32} }}", missed_ticks),
            Self::StateTorn => write!(f, "StateTorn"),
        }
    }
}
