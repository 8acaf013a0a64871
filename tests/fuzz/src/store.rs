//! The store: bits of copies and images flip while ticks run.

use crate::Choices;
use crate::runtime::any_input;
use crate::tables::{BASES, flying};
use flexspline::{
    Flags, GeneratorAngle, Images, Input, Joint, JointState, Limits, Mode, Output, Overrun, Quality, Store, Table,
};

/// Object that flips.
#[derive(Clone, Copy, PartialEq)]
enum Flips {
    /// Bits of one copy and of one image.
    OneSide,
    /// Bits of both images, never in the same page or its checksum, and of one copy.
    OtherPages,
    /// Anything; and temperatures and tables change.
    Anything,
}

/// A store that is hit beside one that is not.
pub fn run(data: &[u8]) {
    let mut choices = Choices::new(data);
    let sound = flying(&mut choices);
    let table = Table::check(sound).expect("a base");
    let drive = *table.drive();
    let torques: Vec<f32> = table.torque_nodes_n_m().collect();
    let limit_rad = 1.002 * table.error_limit_rad();
    let limits = Limits {
        tick_s: 1e-3,
        rate_rad_s: 5.0,
        acceleration_rad_s2: 5e3,
        generator_rate_rad_s: 600.0,
        debounce_ticks: 3,
        deadband_rad: 1e-6,
    };
    let joint = Joint::new(drive, limits, Overrun::SkipAndCount).expect("limits of a joint");
    let flips = [Flips::OneSide, Flips::OtherPages, Flips::Anything][choices.below(3)];
    let (side, copy) = (choices.below(2), choices.below(2));
    let mut images = [sound.clone(), sound.clone()];
    let mut hit = Store::new();
    let second = sound.clone();
    hit.activate(&Images::new(sound, &second), &drive, 20.0).expect("a base");
    let mut twin = hit.clone();
    let mut state = JointState::new();
    state.request(Mode::Tracking).expect("from off");
    let mut generator = GeneratorAngle::ZERO;
    // A page and its checksum are one: that of the whole is the page after the last.
    let last = table.page_count();
    let body: usize = (0..last).filter_map(|page| table.page(page)).map(<[u8]>::len).sum();
    let page_of = |at: usize| if at < body { at / Table::PAGE_BYTES } else { (at - body) / 4 };
    let mut owner = vec![None; last + 1];
    for _ in 0..400 {
        if choices.is_empty() {
            break;
        }
        for _ in 0..choices.below(3) {
            let at = choices.below(images[0].len().min(images[1].len()).min(65_535));
            let (image, into) = match flips {
                Flips::OneSide => (side, copy),
                Flips::OtherPages => (*owner[page_of(at)].get_or_insert(choices.below(2)), copy),
                Flips::Anything => (choices.below(2), choices.below(2)),
            };
            match choices.below(4) {
                0 => images[image][at] ^= 1 << choices.below(8),
                1 => images[image][at] = choices.any(),
                2 => hit.upset(into, choices.below(hit.used_words().max(1)), 1 << choices.below(32)),
                _ => hit.upset(into, choices.below(hit.used_words().max(1)), choices.any()),
            }
        }
        let seen = Images::new(&images[0], &images[1]);
        if flips == Flips::Anything {
            match choices.below(12) {
                0 => drop(hit.set_temperature(&seen, choices.wild())),
                1 => drop(hit.activate(&seen, &drive, choices.wild())),
                2 => {
                    let other = &BASES[choices.below(BASES.len())];
                    let other_drive = *Table::check(other).expect("a base").drive();
                    if hit.activate(&Images::new(other, &other.clone()), &drive, 20.0).is_ok() {
                        assert_eq!(other_drive, drive);
                        images = [other.clone(), other.clone()];
                    }
                }
                _ => {}
            }
        }
        let seen = Images::new(&images[0], &images[1]);
        let input = any_input(&mut choices, &mut generator, &torques, &drive);
        let mut copied = state;
        let found = joint.tick(&seen, &mut hit, &mut copied, &input);
        assert!(found.correction_rad.abs() <= limit_rad, "{found:?}");
        assert!(found.transmission_error_rad.abs() <= limit_rad, "{found:?}");
        let expected = joint.tick(&Images::new(sound, &second), &mut twin, &mut state, &Input { ..input });
        if flips == Flips::Anything {
            state = copied;
        } else {
            let unused = found.flags.contains(Flags::NOT_CORRECTED) && found.quality == Quality::Disabled;
            assert!(
                unused || Output { flags: expected.flags, ..found } == expected,
                "{found:?} instead of {expected:?}"
            );
        }
        hit.check_images(&seen, choices.below(600));
        if let Some((image, page)) = hit.damaged_page().filter(|_| choices.below(4) == 0) {
            let good = images[1 - image].clone();
            if Images::mend_page(&mut images[image], &good, page) {
                hit.mended(image, page);
            }
            if let (Flips::OtherPages, Some(owner)) = (flips, owner.get_mut(page)) {
                // A page written again may be hit on either side.
                let same = |image: &Vec<u8>| (0..sound.len()).all(|at| page_of(at) != page || image[at] == sound[at]);
                if images.iter().all(same) {
                    *owner = None;
                }
            }
        }
    }
}
