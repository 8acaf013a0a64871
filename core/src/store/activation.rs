//! A table on its way from two images into a store, in steps that are short enough for a slow rate group between ticks.

use super::copies::{SLACK, STORE_WORDS};
use super::health::{ActivateError, STORE_PAGES};
use super::images::Images;
use super::source::{ACTIVE, ImageSource};
use super::{Damaged, Scrub, Store, Strangers};
use crate::drive::Drive;
use crate::error::ImageError;
use crate::table::{ImageCheck, TableId, Words};
use crate::whole::{pair, same, sums};

/// Words of the images that a step compares, and of the copies that it fills.
const COMPARED: usize = 64;
const FILLED: usize = 8;
/// More steps than any activation takes: 512 records of 64 torques and 8 temperatures at 16 steps each, twice for each
/// of two images. What goes on for longer was hit.
const MOST_STEPS: u32 = 40_000;
/// Of [`ActivatedTable::images`].
const OF_SECOND: u32 = 2;

numbered! {
    /// Work of a step.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    enum ActivationStage {
        /// Whether both images are the same, words of them.
        Compare,
        /// The first image is checked, or the second.
        First,
        Second,
        /// Neither is a table: the first is checked again, for what is wrong with it.
        Refuse,
        /// The result is compared with the previous one; if there was none yet, all begins once more.
        Confirm,
        Clear,
        Fill,
    }
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
/// Ticks go on between its steps. While it checks, with the table in use; while it fills, without correction, so a
/// firmware that has to go on correcting fills a second store and exchanges the two between two ticks: then the table
/// before is also the way back. To give up, drop it; before the first [`Progress::Filling`] the store has not been
/// touched.
///
/// The images are checked twice, and what is found must be the same: an upset of what is kept in here between two steps
/// ends in
/// [`ActivateError::Torn`] or another error, or changes nothing.
#[derive(Clone, Copy, Debug)]
pub struct Activation {
    drive: Drive,
    /// Bits of the temperature, °C; again, each of them turned.
    pub(super) temperature: [u32; 2],
    /// Number of the stage: an upset may leave one that there is not.
    stage: u32,
    /// Steps so far.
    taken: u32,
    /// Words compared; 1 after the last check of an image.
    at: usize,
    same: bool,
    check: ImageCheck,
    /// The first image is no table.
    first_refused: bool,
    /// By the checks under way, and by those before.
    pub(super) found: Option<ActivatedTable>,
    confirmed: Option<ActivatedTable>,
}

/// The store's future data on the table, and how much of it was filled: it lies in memory from step to step, so it has
/// sums.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ActivatedTable {
    source: ImageSource,
    id: TableId,
    /// 1 if the images are the same, and 2 if the second is the sound one.
    images: u32,
    pub(super) filled: u32,
    sums: [u32; 2],
}

impl ActivatedTable {
    #[inline(never)]
    const fn sums(&self) -> u64 {
        let [a, b, c, d, e, f, g, h] = self.id.0;
        sums!(
            pair(self.source.sums());
            u32::from_le_bytes([a, b, c, d]),
            u32::from_le_bytes([e, f, g, h]),
            self.images,
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
            stage: ActivationStage::Compare as u32,
            taken: 0,
            at: 0,
            same: true,
            check: ImageCheck::NEW,
            first_refused: false,
            found: None,
            confirmed: None,
        }
    }

    /// Does at most 2000 instructions of it on a Cortex-M4F. Give the same images and the same store with every step; a
    /// store of which steps went into two activations has a mixture, which its ticks find and do not use.
    ///
    /// # Errors
    /// [`ActivateError`]; the store has not been touched then, and further steps say the same.
    pub fn step(&mut self, store: &mut Store, images: &Images<'_>) -> Result<Progress, ActivateError> {
        let [first, second] = images.words;
        self.taken = self.taken.wrapping_add(1);
        let within = self.taken <= MOST_STEPS;
        let stage = ActivationStage::numbered(self.stage).filter(|_| within).ok_or(ActivateError::Torn)?;
        match stage {
            ActivationStage::Compare => self.compare(first, second),
            ActivationStage::First => match self.check.step(first.as_flattened()) {
                Ok(true) if self.at == 0 => self.at = 1,
                // In a step of its own.
                Ok(true) => {
                    self.found = Some(self.accept(images, first, 0)?);
                    self.go_on(if self.same { ActivationStage::Confirm } else { ActivationStage::Second });
                }
                Ok(false) => {}
                Err(error) if self.same => return Err(ActivateError::Image(error)),
                Err(_) => {
                    self.first_refused = true;
                    self.go_on(ActivationStage::Second);
                }
            },
            ActivationStage::Second => match (self.check.step(second.as_flattened()), self.first_refused) {
                (Ok(false), _) => {}
                // Only where the images differ is the second a question.
                (Ok(true), false) => return Err(ActivateError::TwoTables),
                (Ok(true), true) if self.at == 0 => self.at = 1,
                (Ok(true), true) => {
                    self.found = Some(self.accept(images, second, OF_SECOND)?);
                    self.go_on(ActivationStage::Confirm);
                }
                (Err(_), true) => self.go_on(ActivationStage::Refuse),
                (Err(_), false) => self.go_on(ActivationStage::Confirm),
            },
            ActivationStage::Refuse => {
                if self.check.step(first.as_flattened()).map_err(ActivateError::Image)? {
                    return Err(ActivateError::Torn);
                }
            }
            ActivationStage::Confirm => self.confirm()?,
            ActivationStage::Clear | ActivationStage::Fill => {
                return self.fill(stage, store, first, second);
            }
        }
        Ok(Progress::Checking)
    }

    fn go_on(&mut self, stage: ActivationStage) {
        (self.stage, self.at, self.check) = (stage as u32, 0, ImageCheck::NEW);
    }

    /// A result stands if it was found before; else all is checked once more.
    fn confirm(&mut self) -> Result<(), ActivateError> {
        let found = self.found.as_ref().filter(|found| found.is_whole()).ok_or(ActivateError::Torn)?;
        let Some(before) = &self.confirmed else {
            self.confirmed = self.found.take();
            (self.same, self.first_refused) = (true, false);
            self.go_on(ActivationStage::Compare);
            return Ok(());
        };
        // Both whole, so the same if the sums are.
        if !before.is_whole() || !same(before.sums, found.sums) {
            return Err(ActivateError::Torn);
        }
        self.go_on(ActivationStage::Clear);
        Ok(())
    }

    /// Compares words of the images.
    fn compare(&mut self, first: Words<'_>, second: Words<'_>) {
        let end = self.at.saturating_add(COMPARED);
        self.same &= first.len() == second.len() && (self.at..end).all(|at| first.get(at) == second.get(at));
        self.at = end;
        if end >= first.len() {
            self.go_on(ActivationStage::First);
        }
    }

    /// Whether a table that passed can be taken.
    fn accept(&self, images: &Images<'_>, words: Words<'_>, of_second: u32) -> Result<ActivatedTable, ActivateError> {
        let Some(table) = self.check.table(words.as_flattened()) else {
            return Err(ActivateError::Image(ImageError::Magic));
        };
        if images.overlap() {
            return Err(ActivateError::SameImage);
        }
        if *table.drive() != self.drive {
            return Err(ActivateError::OtherDrive);
        }
        let source = ImageSource::new(&table);
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
        let images = of_second | self.same as u32;
        let mut found = ActivatedTable { source, id: table.id(), images, filled: 0, sums: [0; 2] };
        found.sums = pair(found.sums());
        Ok(found)
    }

    /// Takes the table before out of the store, then fills words of both copies, and after the last puts the table into
    /// use.
    fn fill(
        &mut self,
        stage: ActivationStage,
        store: &mut Store,
        first: Words<'_>,
        second: Words<'_>,
    ) -> Result<Progress, ActivateError> {
        let found = self.found.as_mut().filter(|found| found.is_whole()).ok_or(ActivateError::Torn)?;
        if stage == ActivationStage::Clear {
            store.source = [ImageSource { marks: found.source.marks & !ACTIVE, ..found.source }.sealed(); 2];
            self.stage = ActivationStage::Fill as u32;
            return Ok(Progress::Filling);
        }
        let images = [if found.images & OF_SECOND == 0 { first } else { second }; 2];
        let all = STORE_WORDS.saturating_add(SLACK);
        let from = found.filled as usize;
        let to = from.saturating_add(FILLED).min(all);
        for place in from..to {
            // What is read beyond the last word in use is zero.
            let used = place < found.source.used as usize;
            let fresh = found.source.fresh(&images, place as u32, Strangers::NONE, [0; 2]).value;
            let value = if used { fresh } else { 0 };
            store.first.set(place, value);
            store.second.set(place, value);
        }
        found.filled = to as u32;
        found.sums = pair(found.sums());
        if to < all {
            return Ok(Progress::Filling);
        }
        store.source = [found.source.sealed(); 2];
        store.next = 0;
        store.scrub = Scrub::START;
        store.damaged = Damaged::NONE;
        store.id = [found.id; 2];
        let id = found.id;
        // Further steps say the same, however many.
        self.taken = 0;
        Ok(Progress::Done(id))
    }
}

bits_of!(ActivatedTable { source, id, images, filled, sums });
bits_of!(Activation { drive, temperature, stage, taken, at, same, check, first_refused, found, confirmed });
