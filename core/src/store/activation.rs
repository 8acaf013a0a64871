//! A table on its way from two images into a store, in steps that are short enough for a slow rate group between ticks.

use super::copies::{SLACK, STORE_WORDS};
use super::health::{ActivateError, STORE_PAGES};
use super::images::Images;
use super::source::{ACTIVE, Source};
use super::{Damaged, Scrub, Store, Strangers};
use crate::drive::Drive;
use crate::error::ImageError;
use crate::table::{Check, TableId, Words};
use crate::whole::{pair, same, sums};

/// Words of the images that a step compares, and of the copies that it fills.
const COMPARED: usize = 64;
const FILLED: usize = 8;

/// What a step does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Whether both images are the same, words of them.
    Compare,
    /// The first image is checked, or the second.
    First,
    Second,
    Clear,
    Fill,
}

/// How far an activation is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The images are checked; the store is as it was, and goes on with its table.
    Checking,
    /// They passed; the store is filled, and has no table meanwhile.
    Filling,
    /// The table is in use from the next tick on.
    Done(TableId),
}

/// A table on its way into a store: [`Store::begin`]. Nothing of images or store is kept in it.
///
/// Ticks go on between its steps. While it checks, with the table in use; while it fills, without correction, so a firmware that has to go on
/// correcting fills a second store and exchanges the two between two ticks: then the table before is also the way back. To give up,
/// drop it; before the first [`Progress::Filling`] the store has not been touched.
#[derive(Clone, Copy, Debug)]
pub struct Activation {
    drive: Drive,
    /// Bits of the temperature, °C; again, each of them turned.
    pub(super) temperature: [u32; 2],
    stage: Stage,
    at: usize,
    same: bool,
    check: Check,
    /// What is wrong with the first image.
    first: Option<ImageError>,
    pub(super) found: Option<Found>,
}

/// What the store will know of the table, and how much of it was filled: it lies in memory from step to step, so it has sums.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    source: Source,
    id: TableId,
    /// All ones if the second image is the sound one, else 0.
    of_second: u32,
    pub(super) filled: u32,
    sums: [u32; 2],
}

impl Found {
    #[inline(never)]
    const fn sums(&self) -> u64 {
        let [a, b, c, d, e, f, g, h] = self.id.0;
        sums!(
            pair(self.source.sums());
            u32::from_le_bytes([a, b, c, d]),
            u32::from_le_bytes([e, f, g, h]),
            self.of_second,
            self.filled,
        )
    }

    fn is_whole(&self) -> bool {
        same(pair(self.sums()), self.sums)
    }
}

impl Activation {
    pub(super) const fn new(drive: Drive, temperature_c: f32) -> Self {
        Self {
            drive,
            temperature: [temperature_c.to_bits(), !temperature_c.to_bits()],
            stage: Stage::Compare,
            at: 0,
            same: true,
            check: Check::NEW,
            first: None,
            found: None,
        }
    }

    /// Does at most 2000 instructions of it on a Cortex-M4F. Give the same images and the same store with every step; a store of which
    /// steps went into two activations has a mixture, which its ticks find and do not use.
    ///
    /// # Errors
    /// [`ActivateError`]; the store has not been touched then, and further steps say the same.
    pub fn step(&mut self, store: &mut Store, images: &Images<'_>) -> Result<Progress, ActivateError> {
        let [first, second] = images.words;
        match self.stage {
            Stage::Compare => self.compare(first, second),
            Stage::First => match self.check.step(first.as_flattened()) {
                Ok(true) => {
                    self.found = Some(self.accept(images, first, 0)?);
                    self.go_on(if self.same { Stage::Clear } else { Stage::Second });
                }
                Ok(false) => {}
                Err(error) if self.same => return Err(ActivateError::Image(error)),
                Err(error) => {
                    self.first = Some(error);
                    self.go_on(Stage::Second);
                }
            },
            Stage::Second => match (self.check.step(second.as_flattened()), self.first) {
                (Ok(false), _) => {}
                // Only where the images differ is the second a question.
                (Ok(true), None) => return Err(ActivateError::TwoTables),
                (Ok(true), Some(_)) => {
                    self.found = Some(self.accept(images, second, u32::MAX)?);
                    self.go_on(Stage::Clear);
                }
                (Err(_), Some(error)) => return Err(ActivateError::Image(error)),
                (Err(_), None) => self.go_on(Stage::Clear),
            },
            Stage::Clear | Stage::Fill => {
                return self.fill(store, first, second);
            }
        }
        Ok(Progress::Checking)
    }

    fn go_on(&mut self, stage: Stage) {
        (self.stage, self.at, self.check) = (stage, 0, Check::NEW);
    }

    /// Compares words of the images.
    fn compare(&mut self, first: Words<'_>, second: Words<'_>) {
        let end = self.at.saturating_add(COMPARED);
        self.same &= first.len() == second.len() && (self.at..end).all(|at| first.get(at) == second.get(at));
        self.at = end;
        if end >= first.len() {
            self.go_on(Stage::First);
        }
    }

    /// Whether a table that passed can be taken.
    fn accept(&self, images: &Images<'_>, words: Words<'_>, of_second: u32) -> Result<Found, ActivateError> {
        let Some(table) = self.check.table(words.as_flattened()) else {
            return Err(ActivateError::Image(ImageError::Magic));
        };
        if images.overlap() {
            return Err(ActivateError::SameImage);
        }
        if *table.drive() != self.drive {
            return Err(ActivateError::OtherDrive);
        }
        let source = Source::new(&table);
        if source.used as usize > STORE_WORDS {
            return Err(ActivateError::TooLarge { needed: source.used as usize });
        }
        if table.page_count() > STORE_PAGES {
            return Err(ActivateError::TooManyPages { found: table.page_count() });
        }
        let [bits, again] = self.temperature;
        if bits != !again {
            return Err(ActivateError::Torn);
        }
        let source = source.at_temperature(words, f32::from_bits(bits));
        let mut found = Found { source, id: table.id(), of_second, filled: 0, sums: [0; 2] };
        found.sums = pair(found.sums());
        Ok(found)
    }

    /// Takes the table before out of the store, then fills words of both copies, and after the last puts the table into use.
    fn fill(&mut self, store: &mut Store, first: Words<'_>, second: Words<'_>) -> Result<Progress, ActivateError> {
        let found = self.found.as_mut().filter(|found| found.is_whole()).ok_or(ActivateError::Torn)?;
        if self.stage == Stage::Clear {
            store.know(&Source { marks: found.source.marks & !ACTIVE, ..found.source });
            self.stage = Stage::Fill;
            return Ok(Progress::Filling);
        }
        let images = [if found.of_second == 0 { first } else { second }; 2];
        let all = STORE_WORDS.saturating_add(SLACK);
        let from = found.filled as usize;
        let to = from.saturating_add(FILLED).min(all);
        for place in from..to {
            // What is read beyond the last word in use is zero.
            let used = place < found.source.used as usize;
            let fresh = found.source.fresh(&images, place as u32, Strangers::NONE, [0; 2]).value;
            let value = if used { fresh } else { 0 };
            store.first.put(place, value);
            store.second.put(place, value);
        }
        found.filled = to as u32;
        found.sums = pair(found.sums());
        if to < all {
            return Ok(Progress::Filling);
        }
        store.know(&found.source);
        store.next = 0;
        store.scrub = Scrub::START;
        store.damaged = Damaged::NONE;
        store.id = [found.id; 2];
        Ok(Progress::Done(found.id))
    }
}

#[cfg(test)]
crate::upset::upsets!(Found { source, id, of_second, filled, sums });
