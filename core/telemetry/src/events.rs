//! Changes from tick to tick that are worth a line in a log: modes, doubts about the table, pages, corrections that
//! could not be made.
//!
//! [`Watch::see`] compares a tick with the one before; what it returns can be sent, counted, or, with the feature
//! `defmt`, logged ([`Events::log`]). Only edges are events, so a fault that stays gives one line.

use flexspline::{Flags, Health, JointState, Mode, Output, Store};

/// Something that changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The joint changed its mode.
    Mode {
        /// Before.
        from: Mode,
        /// Now.
        to: Mode,
    },
    /// The table changed its health.
    Health {
        /// Before.
        from: Health,
        /// Now.
        to: Health,
    },
    /// A page of one image is damaged and can be written again from the other.
    PageDamaged {
        /// Image: 0 or 1.
        image: usize,
        /// Page.
        page: usize,
    },
    /// The copies of the table began to disagree in what was read.
    TableDoubt,
    /// No correction can be made from now on; the last one is kept or fades out.
    Fallback,
    /// Corrections are made again.
    Recovered,
    /// A tick came late, after ticks that did not.
    Overrun {
        /// Ticks missed since the start.
        missed_ticks: u32,
    },
    /// The state was not whole.
    StateTorn,
}

/// Largest number of events of one tick.
const MOST: usize = 7;

/// The events of one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Events {
    events: [Option<Event>; MOST],
}

impl Events {
    /// One after another.
    pub fn iter(&self) -> impl Iterator<Item = Event> + '_ {
        self.events.iter().copied().flatten()
    }

    /// Logs each, with the number of the tick: a page or table lost as an error, what needs looking at as a warning,
    /// the rest as information.
    #[cfg(feature = "defmt")]
    pub fn log(&self, tick: u32) {
        for event in self.iter() {
            match event {
                Event::Health { to: Health::Lost, .. } => defmt::error!("tick {=u32}: {}", tick, event),
                Event::Mode { to: Mode::Off | Mode::Tracking | Mode::Hold, .. } | Event::Recovered => {
                    defmt::info!("tick {=u32}: {}", tick, event);
                }
                _ => defmt::warn!("tick {=u32}: {}", tick, event),
            }
        }
    }
}

/// Knows how the last tick was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Watch {
    mode: Mode,
    health: Health,
    page: Option<(usize, usize)>,
    flags: u16,
}

impl Default for Watch {
    fn default() -> Self {
        Self::new()
    }
}

impl Watch {
    /// Before the first tick: off, without a table.
    #[must_use]
    pub const fn new() -> Self {
        Self { mode: Mode::Off, health: Health::Empty, page: None, flags: 0 }
    }

    /// One tick, after [`Joint::tick`](flexspline::Joint::tick).
    pub fn see(&mut self, state: &JointState, store: &Store, output: &Output) -> Events {
        let before = *self;
        let (mode, health, page, flags) = (state.mode(), store.health(), store.damaged_page(), output.flags.bits());
        *self = Self { mode, health, page, flags };
        let rises = |flag: Flags| flags & !before.flags & flag.bits() != 0;
        let falls = |flag: Flags| before.flags & !flags & flag.bits() != 0;
        let uncorrected = Flags::NOT_CORRECTED;
        let change = if rises(uncorrected) {
            Some(Event::Fallback)
        } else if falls(uncorrected) {
            Some(Event::Recovered)
        } else {
            None
        };
        let missed_ticks = state.missed_ticks();
        Events {
            events: [
                (mode != before.mode).then_some(Event::Mode { from: before.mode, to: mode }),
                (health != before.health).then_some(Event::Health { from: before.health, to: health }),
                page.filter(|_| page != before.page).map(|(image, page)| Event::PageDamaged { image, page }),
                rises(Flags::TABLE_DOUBT).then_some(Event::TableDoubt),
                change,
                rises(Flags::OVERRUN).then_some(Event::Overrun { missed_ticks }),
                rises(Flags::STATE_TORN).then_some(Event::StateTorn),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline::testing::fixture;
    use flexspline::{Adjustment, GeneratorAngle, Images, Input, Joint, OutputAngle, Overrun};
    use std::vec::Vec;

    #[test]
    fn a_life_in_events() {
        let image = fixture::image(false);
        let mut damaged = image.clone();
        damaged[700] ^= 4;
        let images = Images::new(&image, &damaged);
        let joint = Joint::new(fixture::drive(), fixture::LIMITS, Overrun::SkipAndCount).unwrap();
        let (mut store, mut state, mut watch) = (Store::new(), JointState::new(), Watch::new());
        let mut tick = |store: &mut Store, state: &mut JointState, torque_n_m, missed_ticks| {
            let input = Input {
                generator: Some(GeneratorAngle::ZERO),
                target: OutputAngle::ZERO,
                torque_n_m,
                missed_ticks,
                adjustment: Adjustment::default(),
            };
            let output = joint.tick(&images, store, state, &input);
            watch.see(state, store, &output).iter().collect::<Vec<_>>()
        };
        assert_eq!(tick(&mut store, &mut state, 5.0, 0), [Event::Fallback]);
        assert_eq!(tick(&mut store, &mut state, 5.0, 0), []);
        store.activate(&images, &fixture::drive(), 20.0).unwrap();
        state.request(Mode::Tracking).unwrap();
        let begun = tick(&mut store, &mut state, 5.0, 0);
        let mode = Event::Mode { from: Mode::Off, to: Mode::Tracking };
        assert_eq!(begun, [mode, Event::Health { from: Health::Empty, to: Health::Sound }, Event::Recovered]);
        assert_eq!(tick(&mut store, &mut state, f32::NAN, 2), [Event::Fallback, Event::Overrun { missed_ticks: 2 }]);
        assert_eq!(tick(&mut store, &mut state, f32::NAN, 1), []);
        assert_eq!(tick(&mut store, &mut state, 5.0, 0), [Event::Recovered]);
        store.check_images(&images, 100_000);
        let found = tick(&mut store, &mut state, 5.0, 0);
        let health = Event::Health { from: Health::Sound, to: Health::OneImage };
        assert_eq!(found, [health, Event::PageDamaged { image: 1, page: 2 }]);
        // Every word in use, so that one that is read is among them.
        (0..store.used_words()).for_each(|word| store.upset(0, word, 1 << 20));
        let doubt = tick(&mut store, &mut state, 5.0, 0);
        assert_eq!(doubt, [Event::TableDoubt]);
    }
}
