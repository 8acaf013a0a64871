//! Saved states: damaged ones, and hostile ones with the right checksums.

use crate::Choices;
use crate::image::COUNT_RAD;
use crate::runtime::{any_input, any_joint};
use crate::tables::flying;
use flexspline::{GeneratorAngle, Images, JointState, Mode, PlayState, Store, Table};

/// Where a saved joint has its correction.
const CORRECTION: usize = 56;

fn seal<const N: usize>(bytes: &mut [u8; N]) {
    let (before, sum) = bytes.split_last_chunk_mut::<4>().expect("longer than a checksum");
    *sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(before).to_le_bytes();
}

/// One saved play and one saved joint.
pub fn run(data: &[u8]) {
    let mut choices = Choices::new(data);
    let image = flying(&mut choices);
    let table = Table::check(image).expect("a base");
    let drive = *table.drive();
    let torques: Vec<f32> = table.torque_nodes_n_m().collect();
    let twin = image.clone();
    let images = Images::new(image, &twin);
    let mut store = Store::new();
    store.activate(&images, &drive, 20.0).expect("a base");
    let Ok((joint, mut watch)) = any_joint(drive, &mut choices) else { return };
    let mut bytes = JointState::new().save(&joint, &store);
    let mut play_bytes = PlayState::unknown().save();
    let sealed = choices.any();
    for _ in 0..choices.below(12) {
        let at = choices.below(JointState::SAVED_BYTES);
        match choices.below(3) {
            0 => bytes[at] ^= 1 << choices.below(8),
            1 => bytes[at] = choices.any(),
            _ => bytes[at / 4 * 4..][..4].copy_from_slice(&choices.any::<u32>().to_le_bytes()),
        }
    }
    for _ in 0..choices.below(8) {
        play_bytes[choices.below(PlayState::SAVED_BYTES)] = choices.any();
    }
    if sealed {
        seal(&mut play_bytes);
        seal(&mut bytes);
    }
    if let Some(play) = PlayState::restore(&play_bytes) {
        assert_eq!(play.save(), play_bytes, "a state that is read is the one that was saved");
        assert!(play.uncertainty_rad() >= 0.0);
        let error = play.output().map_or(0.0, |output| output.minus_rad(play.nominal().expect("it has an output")));
        assert!(
            error.abs() <= 1.005 * flexspline::Table::MAX_ERROR_RAD + 2.0 * flexspline::Adjustment::MAX_RAD + 0.2,
            "{play:?}"
        );
    }
    let Ok(mut state) = JointState::restore(&bytes, &joint, &store) else { return };
    assert_eq!(state.save(&joint, &store), bytes);
    assert_eq!(state.mode(), Mode::Off);
    let kept = i32::from_le_bytes(*bytes[CORRECTION..].first_chunk().expect("the correction"));
    let speed = i32::from_le_bytes(*bytes[CORRECTION + 4..].first_chunk().expect("its speed"));
    let fine = |parts: f64| parts * f64::from(COUNT_RAD) / 8.0;
    if !watch.stops_in_time(fine(kept.into()), fine(speed.into())) {
        // No joint with these limits saves that.
        return;
    }
    watch.restart(f64::from(kept) * f64::from(COUNT_RAD) / 8.0);
    if choices.any() {
        state.request(Mode::Tracking).expect("from off");
    }
    let mut generator = drive.nominal_generator(state.play().nominal().unwrap_or_default());
    if choices.any() {
        generator = GeneratorAngle::from_counts(choices.any());
    }
    for _ in 0..40 {
        let input = any_input(&mut choices, &mut generator, &torques, &drive);
        let out = joint.tick(&images, &mut store, &mut state, &input);
        watch.see(&input, &drive, &out);
    }
}
