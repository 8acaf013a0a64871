use super::*;
use crate::error::ImageError;
use crate::fixture;
use crate::table::TableModel;
use crate::upset::Upset;
use crate::{
    Adjustment, FixedMember, Flags, GeneratorAngle, Input, Joint, JointState, Limits, Mode, Output, Overrun, PlayState,
    Quality, Table,
};
use std::sync::LazyLock;
use std::vec::Vec;

static IMAGE: LazyLock<Vec<u8>> = LazyLock::new(|| fixture::image(true));
static TWIN: LazyLock<Vec<u8>> = LazyLock::new(|| IMAGE.clone());

fn joint() -> Joint {
    let limits = Limits { rate_rad_s: 0.1, acceleration_rad_s2: 20.0, ..fixture::LIMITS };
    Joint::new(fixture::drive(), limits, Overrun::SkipAndCount).unwrap()
}

fn active(temperature_c: f32) -> Store {
    let mut store = Store::new();
    let images = Images::new(&IMAGE, &TWIN);
    assert_eq!(store.activate(&images, &fixture::drive(), temperature_c).map(|id| id.0), Ok(fixture::id(&unnamed())));
    store
}

/// Every word of the copies made anew.
fn pass(store: &mut Store, images: &Images<'_>) {
    let strangers = store.strangers(images);
    (0..store.used_words()).for_each(|_| store.renew(images, strangers));
}

/// The body with the id zero.
fn unnamed() -> Vec<u8> {
    let table = Table::check(&IMAGE).unwrap();
    let mut body = IMAGE[..table.body_bytes].to_vec();
    body[48..56].fill(0);
    body
}

/// Numbers that look random, the same in every run.
struct Mixed(u64);

impl Mixed {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }

    /// −1 to 1.
    fn part(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A motion with reversals over all torques.
struct Motion {
    mixed: Mixed,
    generator: GeneratorAngle,
    speed: f64,
    torque: f32,
}

impl Motion {
    fn new(seed: u64) -> Self {
        Self { mixed: Mixed(seed), generator: GeneratorAngle::ZERO, speed: 0.0, torque: 0.0 }
    }

    fn next(&mut self) -> Input {
        if self.mixed.below(50) == 0 {
            self.speed = 0.3 * self.mixed.part();
            self.torque = (50.0 * self.mixed.part()) as f32;
        }
        self.generator = self.generator.offset_rad(self.speed as f32);
        let target = fixture::drive().nominal_output(self.generator).offset_rad(1e-4 * self.mixed.part() as f32);
        Input {
            generator: Some(self.generator),
            target,
            torque_n_m: self.torque,
            missed_ticks: 0,
            adjustment: Adjustment::default(),
        }
    }
}

/// Whether an answer is neither the one of a joint that is not hit nor says that it is not to be used.
fn unlike(a: &Output, b: &Output) -> bool {
    let flagged = |out: &Output| out.flags.contains(Flags::NOT_CORRECTED) && out.quality == Quality::Disabled;
    Output { flags: b.flags, ..*a } != *b && !flagged(a)
}

#[test]
fn the_copies_say_what_the_table_says() {
    // At each node, beside and between them, and beyond the last.
    for temperature in [-41.0, -40.0, -11.0, 19.999_998, 20.0, 33.3, 79.99, 80.0, 85.0] {
        let (mut store, table) = (active(temperature), Table::check(&IMAGE).unwrap());
        let images = Images::new(&IMAGE, &TWIN);
        let (mut state, mut play) = (JointState::new(), PlayState::unknown());
        let mut motion = Motion::new(1);
        for _ in 0..5000 {
            let input = motion.next();
            let found = joint().tick(&images, &mut store, &mut state, &input);
            let expected = table.forward(&mut play, motion.generator, input.torque_n_m, temperature);
            assert_eq!(found.output, expected.output, "at {temperature}");
            assert_eq!(found.transmission_error_rad.to_bits(), expected.transmission_error_rad.to_bits());
            for backward in [false, true] {
                let mut doubt = Doubt(0);
                let point = store.locate(input.torque_n_m, 0, 0);
                let copied = TableModel { memory: &store, drive: table.drive() };
                let copied = copied.solve(&point, input.target, backward, &mut doubt);
                let point = table.at(input.torque_n_m, temperature).unwrap();
                let read = TableModel { memory: &table, drive: table.drive() };
                assert_eq!(copied, read.solve(&point, input.target, backward, &mut doubt), "at {temperature}");
            }
        }
    }
}

/// Joints of one table that share a store: each holds what it would hold alone, through a change of temperature, an
/// upset of the copies and of what is known of the table, and where another joint's state is lost.
#[test]
fn joints_of_one_table_share_a_store() {
    const JOINTS: usize = 4;
    let images = Images::new(&IMAGE, &TWIN);
    let mut shared = active(20.0);
    let mut alone: Vec<Store> = (0..JOINTS).map(|_| active(20.0)).collect();
    let mut motions: Vec<Motion> = (0..JOINTS as u64).map(Motion::new).collect();
    let mut states = std::vec![[JointState::new(); 2]; JOINTS];
    for state in states.iter_mut().flatten() {
        state.request(Mode::Tracking).unwrap();
    }
    let (mut doubted, mut corrected, mut safe) = (0, 0, 0);
    for tick in 0..6000 {
        match tick {
            1000 => (0..shared.source_bits()).step_by(97).for_each(|bit| {
                // One copy of what is known of the table.
                if bit < shared.source_bits() / 2 {
                    shared.flip_source(bit)
                }
            }),
            // A joint's state, both copies: it is safe, and nobody else.
            2000 => {
                let [of_one, _] = &mut states[1];
                [40, of_one.bits() / 2 + 40]
                    .into_iter()
                    .for_each(|bit| of_one.flip(bit, &mut std::string::String::new()));
            }
            3000 => alone.iter_mut().chain([&mut shared]).for_each(|store| {
                assert!(store.set_temperature(&images, 55.5));
            }),
            4000 => (0..shared.used_words()).for_each(|word| shared.upset(word % 2, word, 1 << (word % 32))),
            _ => {}
        }
        for (number, (motion, [together, single])) in motions.iter_mut().zip(&mut states).enumerate() {
            let input = motion.next();
            let found = joint().tick(&images, &mut shared, together, &input);
            let expected = joint().tick(&images, &mut alone[number], single, &input);
            if number == 1 && tick >= 2000 {
                safe += found.flags.contains(Flags::SAFE) as usize;
                continue;
            }
            // Only what was hit and mended is reported, to the joint that found it.
            assert_eq!(Output { flags: expected.flags, ..found }, expected, "joint {number}, tick {tick}");
            let reported = |out: &Output| out.flags.bits() & !Flags::TABLE_DOUBT.bits();
            assert_eq!(reported(&found), reported(&expected), "joint {number}, tick {tick}");
            doubted += found.flags.contains(Flags::TABLE_DOUBT) as usize;
            corrected += !found.flags.contains(Flags::NOT_CORRECTED) as usize;
        }
        shared.check_images(&images, 2);
        alone.iter_mut().for_each(|store| store.check_images(&images, 2));
    }
    assert!(doubted > 1 && corrected > 3 * 5900 && safe == 4000, "{doubted} {corrected} {safe}");
}

/// A caller's mistake: two joints, one state. Where their generators are further apart than a tick allows, every tick
/// of the second says so, as the first takes the count of glitches back.
#[test]
fn a_state_shared_by_two_joints_is_told_where_they_are_apart() {
    let images = Images::new(&IMAGE, &TWIN);
    for (apart_rad, reported) in [(5.0, true), (1e-4, false)] {
        let (mut store, mut state) = (active(20.0), JointState::new());
        let (mut motion, mut glitches) = (Motion::new(3), 0);
        for _ in 0..500 {
            let input = motion.next();
            let beside = input.generator.map(|generator| generator.offset_rad(apart_rad));
            let _ = joint().tick(&images, &mut store, &mut state, &input);
            let found = joint().tick(&images, &mut store, &mut state, &Input { generator: beside, ..input });
            glitches += found.flags.contains(Flags::GLITCH) as usize;
        }
        assert_eq!(glitches, if reported { 500 } else { 0 }, "{apart_rad} rad apart");
    }
}

/// A caller's mistake: the table of another unit of the same teeth is a table of the drive. Only its id differs.
#[test]
fn another_table_of_the_same_drive_is_told_by_its_id_alone() {
    let other = fixture::image(false);
    let other_twin = other.clone();
    let images = Images::new(&other, &other_twin);
    let mut store = Store::new();
    let id = store.activate(&images, &fixture::drive(), 20.0).unwrap();
    assert!(id == store.id() && id != active(20.0).id());
    let found = joint().tick(&images, &mut store, &mut JointState::new(), &Motion::new(4).next());
    assert!(!found.flags.contains(Flags::TABLE_DOUBT) && !found.flags.contains(Flags::NOT_CORRECTED));
    // A state of the one is not restored with the other: saved before a change of tables.
    let saved = JointState::new().save(&joint(), &active(20.0));
    assert!(JointState::restore(&saved, &joint(), &store).is_err());
}

#[test]
fn the_copies_follow_the_temperature_within_a_pass() {
    let (mut moved, still) = (active(-40.0), active(55.0));
    let images = Images::new(&IMAGE, &TWIN);
    assert!(moved.set_temperature(&images, 55.0));
    assert_ne!(moved.first, still.first);
    pass(&mut moved, &images);
    assert!(moved.first == still.first && moved.second == still.second);
    assert!(!moved.set_temperature(&images, f32::NAN));
    assert_eq!((moved.counters().passes, moved.counters().words_skipped), (1, 0));
    // Beyond the range the edge holds and is marked.
    assert!(moved.set_temperature(&images, 81.0));
    let point = moved.locate(5.0, 0, 0);
    assert_eq!(point.quality(true, true), Quality::Extrapolated);
}

#[test]
fn every_bit_of_what_a_step_reads_is_compared() {
    let sound = active(20.0);
    let images = Images::new(&IMAGE, &TWIN);
    let input = Motion::new(3).next();
    let reference = joint().tick(&images, &mut sound.clone(), &mut JointState::new(), &input);
    let mut noticed = 0;
    for word in 0..sound.used_words() {
        for (copy, bit) in [(0, word % 32), (1, (word + 7) % 32)] {
            let mut store = sound.clone();
            store.upset(copy, word, 1 << bit);
            let found = joint().tick(&images, &mut store, &mut JointState::new(), &input);
            assert!(!unlike(&found, &reference), "copy {copy} word {word} bit {bit}");
            noticed += usize::from(found.flags.contains(Flags::TABLE_DOUBT));
        }
    }
    // Two nodes, three of each, and the ripple and curves around two phases, in both copies.
    assert!(noticed > 2 * (2 + 6 + 2 * 3 + 2 * 9), "{noticed}");
}

/// Random flips in copies and images while the loop runs: every output either equals that of a joint without upsets or
/// says that it is not to be used. Returns flips, ticks in doubt, words mended, pages found damaged.
fn campaign(flips: usize, seed: u64) -> [usize; 4] {
    let (mut sound, mut hit) = (active(20.0), active(20.0));
    let mut images = [IMAGE.clone(), IMAGE.clone()];
    let (mut state, mut motion, mut mixed) = (JointState::new(), Motion::new(seed), Mixed(seed ^ 0xabcd));
    state.request(Mode::Tracking).unwrap();
    let (mut done, mut flagged) = (0, 0);
    while done < flips {
        // Single bits, neighbours, whole words, bursts over words.
        let used = hit.used_words();
        let word = mixed.below(used);
        let mask = match mixed.below(4) {
            0 | 1 => 1 << mixed.below(32),
            2 => 3u32.rotate_left(mixed.below(32) as u32),
            _ => mixed.next() as u32 | 1,
        };
        match mixed.below(8) {
            0 => {
                let (image, at) = (mixed.below(2), mixed.below(IMAGE.len()));
                images[image][at] ^= 1 << mixed.below(8);
            }
            1 => (0..4).for_each(|i| hit.upset(mixed.below(2), (word + i) % used, mask.rotate_left(i as u32))),
            _ => hit.upset(mixed.below(2), word, mask),
        }
        // The same bit of the same word in both copies at a time is the fault that two copies cannot detect.
        for word in 0..used {
            let [a, b, c] = [&hit.first, &hit.second, &sound.first].map(|copy| copy.words::<1>(word));
            if a == b && a != c {
                hit.upset(0, word, mask);
            }
        }
        done += mask.count_ones() as usize;
        let input = motion.next();
        let mut copy = state;
        let both = Images::new(&IMAGE, &TWIN);
        let expected = joint().tick(&both, &mut sound, &mut state, &input);
        let seen = Images::new(&images[0], &images[1]);
        let found = joint().tick(&seen, &mut hit, &mut copy, &input);
        assert!(!unlike(&found, &expected), "after {done} flips: {found:?} {expected:?}");
        flagged += usize::from(found.flags.contains(Flags::TABLE_DOUBT));
        hit.check_images(&seen, 64);
        if let Some((image, page)) = hit.damaged_page() {
            let good = images[1 - image].clone();
            if Images::mend_page(&mut images[image], &good, page) {
                hit.mended(image, page);
            }
        }
        if hit.health() == Health::Lost {
            // What firmware would do: send the table again.
            images = [IMAGE.clone(), IMAGE.clone()];
            hit.activate(&Images::new(&images[0], &images[1]), &fixture::drive(), 20.0).unwrap();
        }
    }
    let counters = hit.counters();
    [done, flagged, counters.words_mended as usize, counters.pages_damaged as usize]
}

#[test]
fn no_upset_is_used() {
    let [flips, flagged, mended, pages] = campaign(30_000, 1);
    assert!(flips >= 30_000 && flagged > 100 && mended > 500 && pages > 50, "{flagged} {mended} {pages}");
}

#[test]
fn a_damaged_page_of_one_image_is_named_and_mended() {
    let mut damaged = IMAGE.clone();
    damaged[1000] ^= 4;
    let mut store = active(20.0);
    let images = Images::new(&damaged, &IMAGE);
    store.check_images(&images, 2 * IMAGE.len() / 4 + 128);
    assert_eq!((store.health(), store.damaged_page()), (Health::OneImage, Some((0, 3))));
    // Meanwhile the copies are made from the other.
    let (before, skipped) = (store.first.clone(), store.counters().words_skipped);
    store.set_temperature(&images, 21.0);
    store.set_temperature(&images, 20.0);
    pass(&mut store, &images);
    assert!(store.first == before && store.counters().words_skipped == skipped);
    assert!(Images::mend_page(&mut damaged, &IMAGE, 3));
    assert_eq!(damaged, *IMAGE);
    // Not from a page that is damaged itself, nor beyond the last, nor for an image of another size.
    let mut bad = IMAGE.clone();
    bad[800] ^= 1;
    for (good, page) in [(&bad[..], 3), (&IMAGE[..], 99), (&IMAGE[4..], 3)] {
        assert!(!Images::mend_page(&mut damaged, good, page));
        assert_eq!(damaged, *IMAGE);
    }
    let images = Images::new(&damaged, &IMAGE);
    store.check_images(&images, 2 * IMAGE.len() / 4 + 128);
    assert_eq!((store.health(), store.damaged_page()), (Health::Sound, None));
}

#[test]
fn a_page_damaged_in_both_images_is_lost_and_the_copies_stay() {
    let (mut first, mut second) = (IMAGE.clone(), IMAGE.clone());
    (first[1000], second[1001]) = (first[1000] ^ 4, second[1001] ^ 4);
    let mut store = active(20.0);
    let before = (store.first.clone(), store.second.clone());
    let images = Images::new(&first, &second);
    store.check_images(&images, 2 * IMAGE.len() / 4 + 128);
    assert_eq!((store.health(), store.damaged_page()), (Health::Lost, None));
    assert!(store.set_temperature(&images, 60.0));
    pass(&mut store, &images);
    assert!(store.counters().words_skipped > 0);
    let kept = (0..store.used_words()).filter(|&i| store.first.0[i] == before.0.0[i]).count();
    assert!(kept > 64, "{kept}");
    assert!(store.first == store.second);
}

#[test]
fn what_is_no_table_of_this_drive_is_not_activated() {
    let mut damaged = IMAGE.clone();
    damaged[2000] ^= 1;
    let drive = fixture::drive();
    let mut store = Store::new();
    assert_eq!(store.health(), Health::Empty);
    let nothing = joint().tick(&Images::new(&[], &[]), &mut store, &mut JointState::new(), &Motion::new(1).next());
    assert_eq!((nothing.quality, nothing.correction_rad), (Quality::Disabled, 0.0));
    let refused = store.activate(&Images::new(&damaged, &damaged.clone()), &drive, 20.0);
    assert!(matches!(refused, Err(ActivateError::Image(ImageError::Crc { .. }))), "{refused:?}");
    let other = Drive::new(190, 192, drive.fixed()).unwrap();
    let refused = store.activate(&Images::new(&IMAGE, &TWIN), &other, 20.0);
    assert_eq!(refused, Err(ActivateError::OtherDrive));
    assert_eq!(store.health(), Health::Empty);
    // One image is enough.
    assert!(store.activate(&Images::new(&damaged, &IMAGE), &drive, 20.0).is_ok());
    assert_eq!(store.first, active(20.0).first);
}

/// Found by a fuzzer: page 3 of one image is damaged, found, and written again; then the same page of the other is hit.
#[test]
fn after_a_page_is_mended_the_other_image_is_no_longer_believed_alone() {
    let mut images = [IMAGE.clone(), IMAGE.clone()];
    images[0][1000] ^= 4;
    let mut store = active(20.0);
    store.check_images(&Images::new(&images[0], &images[1]), 2 * IMAGE.len() / 4 + 128);
    assert_eq!(store.damaged_page(), Some((0, 3)));
    let good = images[1].clone();
    assert!(Images::mend_page(&mut images[0], &good, 3));
    store.mended(0, 3);
    assert_eq!((store.health(), store.damaged_page()), (Health::Sound, None));
    let before = store.first.clone();
    (768..1024).step_by(4).for_each(|at| images[1][at] ^= 0x40);
    pass(&mut store, &Images::new(&images[0], &images[1]));
    assert!(store.first == before);
    assert!(store.counters().words_skipped > 0);
}

/// With a bit for each page modulo 32, damage of page 33 of one image would have been looked for in page 1 of the
/// other. Found by a fuzzer: a word is blended from two pages; one is damaged in one image, and known, the other in the
/// other, and not found yet.
#[test]
fn beside_a_damaged_page_another_page_of_the_other_image_is_not_believed_alone() {
    let pages = IMAGE.len().div_ceil(PAGE_BYTES);
    let mut skipped = 0;
    for (page, other) in (0..pages).flat_map(|page| (0..pages).map(move |other| (page, other))) {
        if page == other {
            continue;
        }
        let mut images = [IMAGE.clone(), IMAGE.clone()];
        images[0][page * PAGE_BYTES] ^= 1;
        let mut store = active(35.0);
        let sound = store.first.clone();
        store.check_images(&Images::new(&images[0], &images[1]), 2 * IMAGE.len() / 4 + 128);
        images[1][other * PAGE_BYTES..].iter_mut().take(PAGE_BYTES).for_each(|byte| *byte ^= 2);
        let seen = Images::new(&images[0], &images[1]);
        // No page is checked meanwhile.
        pass(&mut store, &seen);
        assert!(store.first == sound && store.second == sound, "page {page} of one image, {other} of the other");
        skipped += store.counters().words_skipped;
    }
    assert!(skipped > 0, "nothing was in question");
}

/// A page that is checked while it is written again is not taken for damaged.
#[test]
fn a_page_mended_while_it_is_checked_is_not_found_damaged() {
    let mut images = [IMAGE.clone(), IMAGE.clone()];
    let mut store = active(20.0);
    images[0][10] ^= 4;
    // Half of page 0, with what is wrong in it.
    store.check_images(&Images::new(&images[0], &images[1]), PAGE_BYTES / 8);
    let good = images[1].clone();
    assert!(Images::mend_page(&mut images[0], &good, 0));
    store.mended(0, 0);
    store.check_images(&Images::new(&images[0], &images[1]), PAGE_BYTES / 4);
    assert_eq!((store.health(), store.damaged_page()), (Health::Sound, None));
}

/// Of a drive without error.
fn image_of(torques: usize, temperatures_c: &[f32]) -> Vec<u8> {
    let nodes: Vec<f32> = (0..torques).map(|i| i as f32).collect();
    fixture::image_of(&nodes, &std::vec![0.0; torques * temperatures_c.len()], temperatures_c, 16)
}

/// As many torque nodes as the store has room for, and one more.
#[test]
fn a_table_is_activated_if_the_store_has_room_for_it() {
    // The axes, and for each torque node 3 words and 20 of its ripple.
    let most = (Store::WORDS - 72) / 23;
    for torques in [most, most + 1] {
        let image = image_of(torques, &[20.0]);
        let needed = 72 + 23 * torques;
        assert_eq!(Store::room_for(&Table::check(&image).unwrap()), needed + Store::ROOM - Store::WORDS);
        let found = Store::new().activate(&Images::new(&image, &image.clone()), &fixture::drive(), 20.0).err();
        assert_eq!(found, (torques > most).then_some(ActivateError::TooLarge { needed }));
    }
}

#[test]
fn an_image_with_more_pages_than_bits_is_not_activated() {
    let image = image_of(14, &[-40.0, -20.0, 0.0, 20.0, 40.0, 60.0, 70.0, 80.0]);
    let pages = Table::check(&image).unwrap().page_count();
    assert!(pages > Store::PAGES && 72 + 14 * 23 <= Store::WORDS, "{pages}");
    let refused = Store::new().activate(&Images::new(&image, &image.clone()), &fixture::drive(), 20.0);
    assert_eq!(refused, Err(ActivateError::TooManyPages { found: pages }));
}

/// Words that both have would follow the temperature, the others not.
#[test]
fn two_tables_are_not_activated_as_one() {
    let mut other = IMAGE.clone();
    // Another drive description: a table all the same.
    other[16] ^= 1;
    crate::table::reseal(&mut other);
    assert!(Table::check(&other).is_ok());
    let mut store = active(20.0);
    let refused = store.activate(&Images::new(&other, &IMAGE), &fixture::drive(), 60.0);
    assert_eq!(refused, Err(ActivateError::TwoTables));
    assert_eq!(store.first, active(20.0).first);
}

/// One copy of what is known of the table is hit: the tick is done again with the other.
#[test]
fn a_changed_plan_is_noticed_and_mended() {
    let sound = active(20.0);
    let images = Images::new(&IMAGE, &TWIN);
    let input = Motion::new(3).next();
    let reference = joint().tick(&images, &mut sound.clone(), &mut JointState::new(), &input);
    for bit in 0..sound.source.bits() {
        let mut store = sound.clone();
        store.source.flip(bit, &mut std::string::String::new());
        let found = joint().tick(&images, &mut store, &mut JointState::new(), &input);
        let reported = bit < sound.source.bits() / 2;
        assert_eq!(found.flags, reference.flags.with(Flags::TABLE_DOUBT, reported), "{bit}");
        assert!(!unlike(&found, &reference) && found.quality == reference.quality, "{bit}");
        // A slow group finds the others.
        store.check_images(&images, 1);
        assert_eq!(store.source, sound.source, "{bit}");
    }
}

/// Both are: nothing is corrected, and the health says what is needed.
#[test]
fn a_plan_that_is_lost_asks_for_the_table_to_be_activated_again() {
    let mut store = active(20.0);
    let images = Images::new(&IMAGE, &TWIN);
    for bit in [7, store.source.bits() / 2 + 300] {
        store.source.flip(bit, &mut std::string::String::new());
    }
    let found = joint().tick(&images, &mut store, &mut JointState::new(), &Motion::new(3).next());
    assert!(found.flags.contains(Flags::TABLE_DOUBT) && found.quality == Quality::Disabled);
    assert_eq!((store.health(), store.set_temperature(&images, 20.0)), (Health::Torn, false));
    assert!(store.activate(&images, &fixture::drive(), 20.0).is_ok());
    assert_eq!(store.health(), Health::Sound);
}

/// The images are those of another table from one tick to the next.
#[test]
fn images_replaced_under_the_store_are_told_and_not_used() {
    let mut other = IMAGE.clone();
    other[16] ^= 1;
    crate::table::reseal(&mut other);
    let other_twin = other.clone();
    let mut store = active(20.0);
    let (before, mut state) = (store.first.clone(), JointState::new());
    for replaced in [Images::new(&other, &other_twin), Images::new(&IMAGE, &IMAGE)] {
        assert_eq!(store.set_temperature(&replaced, 60.0), replaced.is_one());
        let found = joint().tick(&replaced, &mut store, &mut state, &Motion::new(1).next());
        assert!(found.flags.contains(Flags::OTHER_IMAGES) && !found.flags.contains(Flags::NOT_CORRECTED));
        pass(&mut store, &replaced);
        assert!(store.first == before && store.second == before);
    }
    // One of them: words that both have could follow the temperature, the others not, so none does.
    let half = Images::new(&IMAGE, &other);
    assert!(store.set_temperature(&Images::new(&IMAGE, &TWIN), 20.0) && !store.set_temperature(&half, 60.0));
    let found = joint().tick(&half, &mut store, &mut state, &Motion::new(1).next());
    assert!(found.flags.contains(Flags::OTHER_IMAGES));
    pass(&mut store, &half);
    assert!(store.first == before && store.second == before);
}

/// The word by which a store knows an image is hit itself: reported, mended like a page, and no word is made anew from
/// what differs.
#[test]
fn the_seal_of_an_image_is_mended_like_a_page() {
    let mut hit = IMAGE.clone();
    *hit.last_mut().unwrap() ^= 8;
    let (mut store, mut state) = (active(20.0), JointState::new());
    let mut reported = |images: &Images<'_>| {
        let found = joint().tick(images, &mut store, &mut state, &Motion::new(1).next());
        found.flags.contains(Flags::OTHER_IMAGES)
    };
    assert!(reported(&Images::new(&hit, &IMAGE)) && reported(&Images::new(&IMAGE, &hit)));
    let pages = Table::check(&IMAGE).unwrap().page_count();
    assert!(Images::mend_page(&mut hit, &IMAGE, pages) && hit == *IMAGE);
    let mut bad = IMAGE.clone();
    bad[40] ^= 1;
    assert!(!Images::mend_page(&mut hit, &bad, pages) && !Images::mend_page(&mut hit, &IMAGE, pages + 1));
    assert!(!reported(&Images::new(&hit, &TWIN)));
}

#[test]
fn one_image_given_twice_is_not_activated() {
    let mut store = Store::new();
    let refused = store.activate(&Images::new(&IMAGE, &IMAGE), &fixture::drive(), 20.0);
    assert_eq!(refused, Err(ActivateError::SameImage));
    assert_eq!(store.health(), Health::Empty);
}

/// A dead thermistor at boot.
#[test]
fn a_temperature_that_is_not_finite_activates_nothing() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut store = Store::new();
        let refused = store.activate(&Images::new(&IMAGE, &TWIN), &fixture::drive(), bad);
        assert!(matches!(refused, Err(ActivateError::Temperature { .. })), "{refused:?}");
        assert_eq!(store.health(), Health::Empty);
        let found =
            joint().tick(&Images::new(&IMAGE, &TWIN), &mut store, &mut JointState::new(), &Motion::new(1).next());
        assert_eq!(found.quality, Quality::Disabled);
        // And a table in use goes on.
        let mut store = active(20.0);
        assert!(store.activate(&Images::new(&IMAGE, &TWIN), &fixture::drive(), bad).is_err());
        assert_eq!((store.health(), store.first == active(20.0).first), (Health::Sound, true));
    }
}

#[test]
fn the_joint_of_another_drive_is_not_corrected() {
    let other = Joint::new(Drive::new(200, 202, FixedMember::Flexspline).unwrap(), fixture::LIMITS, Overrun::HoldLast);
    let mut store = active(20.0);
    let images = Images::new(&IMAGE, &TWIN);
    let found = other.unwrap().tick(&images, &mut store, &mut JointState::new(), &Motion::new(1).next());
    assert!(found.flags.contains(Flags::TABLE_DOUBT) && found.flags.contains(Flags::NOT_CORRECTED));
    assert_eq!((found.quality, found.correction_rad), (Quality::Disabled, 0.0));
}

/// Two stores: a table is checked and filled in beside the one in use, in the background; between two ticks they are
/// exchanged, and back.
#[test]
fn a_new_table_takes_over_between_two_ticks_and_can_be_rolled_back() {
    let other = fixture::image(false);
    let other_twin = other.clone();
    let (old, new) = (Images::new(&IMAGE, &TWIN), Images::new(&other, &other_twin));
    let (mut in_use, mut standby) = (active(20.0), Store::new());
    let mut state = JointState::new();
    state.request(Mode::Tracking).unwrap();
    let (mut motion, mut last) = (Motion::new(5), None);
    let mut flown = Vec::new();
    for tick in 0..1200 {
        let images = match tick {
            400 => {
                standby.activate(&new, &fixture::drive(), 20.0).unwrap();
                core::mem::swap(&mut in_use, &mut standby);
                &new
            }
            // The table before is still there.
            800 => {
                core::mem::swap(&mut in_use, &mut standby);
                &old
            }
            _ => [&old, &new][usize::from((400..800).contains(&tick))],
        };
        let found = joint().tick(images, &mut in_use, &mut state, &motion.next());
        assert!(!found.flags.contains(Flags::TABLE_DOUBT) && !found.flags.contains(Flags::OTHER_IMAGES), "{tick}");
        assert!(!found.flags.contains(Flags::NOT_CORRECTED) && found.quality != Quality::Disabled, "{tick}");
        // A joint of 0.1 rad/s at a thousand ticks a second.
        let moved = last.map_or(0.0, |last: f32| (found.correction_rad - last).abs());
        assert!(moved <= 1.001e-4, "{tick}: {moved}");
        last = Some(found.correction_rad);
        flown.push(in_use.id());
    }
    let [first, second] = [&IMAGE[..], &other].map(|image| Table::check(image).unwrap().id());
    assert_ne!(first, second);
    assert!((0..1200).all(|tick| flown[tick] == if (400..800).contains(&tick) { second } else { first }));
}

/// In a static it is zeroed memory, not a copy in flash that goes over the stack.
#[test]
fn an_empty_store_is_all_zeros() {
    let mut store = Store::new();
    let bits = store.bits();
    for bit in 0..bits {
        store.flip(bit, &mut std::string::String::new());
    }
    // Every bit was zero, so every one is set now.
    let reported = std::format!("{store:?}");
    let numbers: Vec<&str> = reported.split(|c: char| !c.is_ascii_alphanumeric() && c != '-').collect();
    assert!(!numbers.iter().any(|number| number.parse() == Ok(0u32)), "a zero in {reported:.400}");
    let whole = Store::new();
    assert!(whole.source[0].is_whole() && whole.source[1].is_whole() && whole.damaged.pages() == [0; 2]);
}

/// Steps of an activation into a store until it is done or fails.
fn steps(
    activation: &mut Activation,
    store: &mut Store,
    images: &Images<'_>,
    mut between: impl FnMut(usize, Progress, &mut Activation, &mut Store),
) -> Result<TableId, ActivateError> {
    for step in 0..50_000 {
        match activation.step(store, images)? {
            Progress::Done(id) => return Ok(id),
            progress => between(step, progress, activation, store),
        }
    }
    panic!("it does not end")
}

/// While the images are checked the store flies on with its table, to the bit; then it is as if it had been activated
/// at once.
#[test]
#[cfg_attr(miri, ignore = "takes too long")]
fn an_activation_in_steps_leaves_the_table_in_use_until_the_new_one_has_passed() {
    let other = fixture::image(false);
    let other_twin = other.clone();
    let (old, new) = (Images::new(&IMAGE, &TWIN), Images::new(&other, &other_twin));
    let (mut store, mut twin) = (active(20.0), active(20.0));
    let mut states = [JointState::new(); 2];
    states.iter_mut().for_each(|state| state.request(Mode::Tracking).unwrap());
    let mut motion = Motion::new(5);
    let (mut checked, mut filled) = (0, 0);
    let mut activation = Store::begin(&fixture::drive(), 20.0).unwrap();
    let found = steps(&mut activation, &mut store, &new, |_, progress, _, store| {
        let input = motion.next();
        let [first, second] = &mut states;
        let out = joint().tick(&old, store, first, &input);
        let expected = joint().tick(&old, &mut twin, second, &input);
        if progress == Progress::Checking {
            assert_eq!(out, expected);
            checked += 1;
        } else {
            assert!(out.flags.contains(Flags::NOT_CORRECTED) && store.health() == Health::Empty);
            filled += 1;
        }
    });
    assert!(checked > 300 && filled > 50, "{checked} {filled}");
    assert_eq!(found, Ok(Table::check(&other).unwrap().id()));
    let mut at_once = Store::new();
    at_once.activate(&new, &fixture::drive(), 20.0).unwrap();
    assert!(store.is_like(&at_once) && store.health() == Health::Sound);
    // It says so again, and changes nothing.
    assert_eq!(activation.step(&mut store, &new), found.map(Progress::Done));
    assert!(store.is_like(&at_once));
}

/// A refusal holds in every later step too, and the store is as it was.
#[test]
fn an_activation_that_fails_has_not_touched_the_store() {
    let other = fixture::image(false);
    let mut damaged = IMAGE.clone();
    damaged[3000] ^= 1;
    let refused = [
        (Images::new(&damaged, &damaged[..]), "a damaged one"),
        (Images::new(&IMAGE, &other), "two tables"),
        (Images::new(&IMAGE, &IMAGE), "one image"),
    ];
    for (images, name) in refused {
        let mut store = active(20.0);
        let mut activation = Store::begin(&fixture::drive(), 20.0).unwrap();
        let found = steps(&mut activation, &mut store, &images, |_, progress, _, _| {
            assert_eq!(progress, Progress::Checking, "{name}");
        });
        assert!(found.is_err() && activation.step(&mut store, &images).is_err(), "{name}: {found:?}");
        assert!(store.is_like(&active(20.0)), "{name}");
    }
}

/// Every bit of what an activation keeps, among its checks, before it fills and while it does: what comes out is the
/// table of the images at the temperature that was given, or an error, and in the end.
#[test]
#[cfg_attr(miri, ignore = "takes too long")]
fn no_single_bit_of_an_activation_makes_another_table() {
    let image = fixture::image(false);
    let twin = image.clone();
    let images = Images::new(&image, &twin);
    let mut expected = Store::new();
    expected.activate(&images, &fixture::drive(), 25.0).unwrap();
    let (mut kept, mut all) = (Vec::new(), 0);
    let mut activation = Store::begin(&fixture::drive(), 25.0).unwrap();
    steps(&mut activation, &mut Store::new(), &images, |step, progress, now, store| {
        let filled = now.found.map_or(0, |found| found.filled);
        if step % 37 == 0 && progress == Progress::Checking
            || progress == Progress::Filling && [0, 160].contains(&filled)
        {
            kept.push((*now, store.clone()));
        }
        all = step;
    })
    .unwrap();
    let (mut torn, mut other, mut harmless) = (0, 0, 0);
    for (sound, store) in &kept {
        for bit in 0..sound.bits() {
            let (mut hit, mut store, mut path) = (*sound, store.clone(), std::string::String::new());
            hit.flip(bit, &mut path);
            let mut taken = 0;
            match steps(&mut hit, &mut store, &images, |_, _, _, _| taken += 1) {
                Ok(_) => {
                    assert!(store.is_like(&expected), "{path} {bit}");
                    harmless += 1;
                }
                Err(error) => {
                    assert_ne!(store.health(), Health::Sound, "{path} {bit}: {error:?}");
                    torn += usize::from(error == ActivateError::Torn);
                    other += usize::from(error != ActivateError::Torn);
                }
            }
            // Where a length was hit; the fixture takes some 900.
            assert!(taken <= 40_000, "{path} {bit}: {taken} steps of {all}");
        }
    }
    std::println!("{} moments: {torn} torn, {other} refused otherwise, {harmless} harmless", kept.len());
    assert!(kept.len() > 10 && torn > 2000 && other > 1000 && harmless > 1000);
    // What the store knows while it is filled is not used for it.
    let (activation, filling) = kept.last().unwrap();
    for bit in 0..filling.source_bits() {
        let (mut hit, mut store) = (*activation, filling.clone());
        store.flip_source(bit);
        steps(&mut hit, &mut store, &images, |_, _, _, _| {}).unwrap();
        assert!(store.is_like(&expected));
    }
}

/// Both images are no table, and differ: what is wrong with the first is said.
#[test]
fn of_two_damaged_images_the_first_says_what_is_wrong() {
    let (mut first, mut second) = (IMAGE.clone(), IMAGE.clone());
    first[0] ^= 1;
    second[8] = 77;
    let refused = Store::new().activate(&Images::new(&first, &second), &fixture::drive(), 20.0);
    assert_eq!(refused, Err(ActivateError::Image(ImageError::Magic)));
}

/// The store's data on the table is checked after everything that a tick reads of it: a flip within the tick is found
/// in it.
#[test]
fn a_flip_within_a_tick_is_found_in_it() {
    let world = active(20.0);
    for bit in 0..world.source_bits() / 2 {
        let mut store = world.clone();
        let point = store.locate(5.0, 0, 0);
        store.flip_source(bit);
        assert!(point.doubt.none() && !store.table_status(&Images::new(&IMAGE, &TWIN)).0, "{bit}");
    }
}
