use super::super::tests::{INPUT, TABLE, active, made, pair};
use super::super::*;
use super::*;
use core::ptr::{null, null_mut};
use flexspline::testing::fixture;
use std::vec::Vec;

fn upload() -> FlexsplineUpload {
    FlexsplineUpload { opaque: [MaybeUninit::zeroed(); FLEXSPLINE_UPLOAD_WORDS] }
}

#[test]
fn a_table_comes_in_chunks_and_is_activated() {
    use FlexsplineStatus::{Image, Incomplete, NotInitialised, Ok, Order, Overlap, Pointer, TooLarge};
    let image = &TABLE[0];
    let (mut buffer, mut upload, mut id) = (std::vec![0u8; image.len()], upload(), [0; 8]);
    let send = |upload: &mut FlexsplineUpload, buffer: &mut Vec<u8>, offset: usize, chunk: &[u8]| {
        flexspline_upload_chunk(upload, buffer.as_mut_ptr(), buffer.len(), offset, chunk.as_ptr(), chunk.len())
    };
    assert_eq!(send(&mut upload, &mut buffer, 0, &image[..8]), NotInitialised);
    assert_eq!(flexspline_upload_begin(null_mut(), 4), Pointer);
    assert_eq!(flexspline_upload_begin(&mut upload, image.len()), Ok);
    for (number, chunk) in image.chunks(100).enumerate() {
        // Not the next one, then the next.
        assert_eq!(send(&mut upload, &mut buffer, 100 * number + 1, chunk), Order);
        assert_eq!(send(&mut upload, &mut buffer, 100 * number, chunk), Ok);
        if number == 3 {
            let found = flexspline_upload_finish(&upload, buffer.as_ptr(), buffer.len(), &mut id);
            assert_eq!((found, id), (Incomplete, [0; 8]));
        }
    }
    assert_eq!(send(&mut upload, &mut buffer, image.len(), &[1]), TooLarge);
    assert_eq!(flexspline_upload_finish(&upload, buffer.as_ptr(), buffer.len(), &mut id), Ok);
    assert_eq!((id, &buffer), (flexspline::Table::check(image).unwrap().id().0, image));
    // The buffer is an image, for a store that had none.
    let twin = buffer.clone();
    let (mut o, table) = (made(), pair(&buffer, &twin));
    assert_eq!(flexspline_store_activate(&mut *o.store, &o.joint, &table, 20.0), Ok);
    // What came is no table; a buffer too small; what is read is what is written.
    buffer[300] ^= 1;
    assert_eq!(flexspline_upload_finish(&upload, buffer.as_ptr(), buffer.len(), &mut id), Image);
    assert_eq!(flexspline_upload_finish(&upload, buffer.as_ptr(), 99, &mut id), TooLarge);
    assert_eq!(flexspline_upload_begin(&mut upload, image.len() + 1), Ok);
    assert_eq!(send(&mut upload, &mut buffer, 0, &image[..4]), TooLarge);
    let inside =
        flexspline_upload_chunk(&mut upload, buffer.as_mut_ptr(), 200, 0, buffer.as_ptr().wrapping_add(199), 4);
    assert_eq!(inside, Overlap);
}

/// A table whose checksums are right, of a drive with its torque turned.
#[test]
fn what_no_drive_does_has_a_status_of_its_own() {
    let mut turned = fixture::image(false);
    // D and its slope of every node, from word 136 on.
    for node in 0..33 {
        for word in [0, 1] {
            turned[4 * (136 + 3 * node + word) + 3] ^= 0x80;
        }
    }
    flexspline::testing::reseal(&mut turned);
    let twin = turned.clone();
    let (mut o, table) = (made(), pair(&turned, &twin));
    let found = flexspline_store_activate(&mut *o.store, &o.joint, &table, 20.0);
    assert_eq!(found, FlexsplineStatus::Implausible);
}

#[test]
fn events_and_records_are_those_of_rust() {
    let (mut o, table) = active();
    let mut watch = FlexsplineWatch { opaque: [MaybeUninit::zeroed(); FLEXSPLINE_WATCH_WORDS] };
    let (mut out, mut events) = (FlexsplineOutput::default(), FlexsplineEvents::default());
    let see = |watch: &mut FlexsplineWatch, o: &super::super::tests::Objects, out, events| {
        flexspline_watch_see(watch, &o.state, &*o.store, out, events)
    };
    assert_eq!(see(&mut watch, &o, &out, &mut events), FlexsplineStatus::NotInitialised);
    assert_eq!(flexspline_watch_init(&mut watch), FlexsplineStatus::Ok);
    assert_eq!(flexspline_state_request(&mut o.state, 1), FlexsplineStatus::Ok);
    let mut reported = Vec::new();
    for (missed_ticks, torque_n_m) in [(0, 5.0), (0, f32::NAN), (2, 5.0), (0, 5.0)] {
        let input = FlexsplineInput { missed_ticks, torque_n_m, ..INPUT };
        let found = flexspline_tick(&o.joint, &table, &mut *o.store, &mut o.state, &input, &mut out);
        assert_eq!((found, see(&mut watch, &o, &out, &mut events)), (FlexsplineStatus::Ok, FlexsplineStatus::Ok));
        reported.push(events.events);
        if missed_ticks > 0 {
            assert_eq!(events.missed_ticks, 2);
        }
        if reported.len() == 1 {
            let changed = (events.mode_before, events.mode, events.health_before, events.health);
            assert_eq!(changed, (0, 1, 3, 0));
        }
    }
    let begun = FLEXSPLINE_EVENT_MODE | FLEXSPLINE_EVENT_HEALTH;
    let back = FLEXSPLINE_EVENT_RECOVERED | FLEXSPLINE_EVENT_OVERRUN;
    assert_eq!(reported, [begun, FLEXSPLINE_EVENT_FALLBACK, back, 0]);

    let mut bytes = [0; FLEXSPLINE_RECORD_BYTES];
    let found = flexspline_record(77, 5, 1, &o.state, &*o.store, &out, &mut bytes);
    let record = Record::decode(&bytes).unwrap();
    assert_eq!((found, record.tick, record.number, record.lost), (FlexsplineStatus::Ok, 77, 5, 1));
    assert_eq!((record.output_counts, record.missed_ticks, record.mode), (out.output_counts, 2, Mode::Tracking));
    out.quality = 4;
    assert_eq!(see(&mut watch, &o, &out, &mut events), FlexsplineStatus::Argument);
    assert_eq!(flexspline_record(0, 0, 0, &o.state, &*o.store, &out, null_mut()), FlexsplineStatus::Pointer);
}

#[test]
#[cfg_attr(miri, ignore = "finds the gains of a predictor: takes too long")]
fn what_lies_ahead_is_what_rust_says() {
    use flexspline::PlayState;
    use flexspline_estimation::{Inertias, Noise};
    let (o, _) = active();
    let inertias =
        Inertias { motor_kg_m2: 1.0, load_kg_m2: 3.0, stiffness_n_m_per_rad: 3.0e4, damping_n_m_s_per_rad: 20.0 };
    let noise = Noise { torque_n_m: 0.5, load_change_n_m: 0.2, speed_rad_s: 1e-4, twist_rad: Some(1e-6) };
    let rust = TwoMassObserver::new(inertias, noise, 1e-3).unwrap();
    let parts = rust.parts();
    let mut predictor = FlexsplinePredictor { opaque: [MaybeUninit::zeroed(); FLEXSPLINE_PREDICTOR_WORDS] };
    let mut observer = FlexsplineObserver { opaque: [MaybeUninit::zeroed(); FLEXSPLINE_OBSERVER_WORDS] };
    assert_eq!(flexspline_predictor_init(&mut predictor, null()), FlexsplineStatus::Pointer);
    let zeros = [f32::NAN; FLEXSPLINE_PREDICTOR_PARTS];
    assert_eq!(flexspline_predictor_init(&mut predictor, &zeros), FlexsplineStatus::Argument);
    let measured = FlexsplineMeasured { torque_n_m: 12.0, speed_rad_s: 0.01, twist_rad: 4e-4 };
    assert_eq!(flexspline_observer_step(&mut observer, &predictor, &measured), FlexsplineStatus::NotInitialised);
    assert_eq!(flexspline_predictor_init(&mut predictor, &parts), FlexsplineStatus::Ok);
    assert_eq!(flexspline_observer_init(&mut observer), FlexsplineStatus::Ok);
    let mut state = PredictorState::new();
    for _ in 0..50 {
        assert_eq!(flexspline_observer_step(&mut observer, &predictor, &measured), FlexsplineStatus::Ok);
        rust.step(&mut state, &Measured { torque_n_m: 12.0, speed_rad_s: 0.01, twist_rad: 4e-4 });
    }
    let mut seen = FlexsplineObserverReport::default();
    assert_eq!(flexspline_observer_report(&observer, &mut seen), FlexsplineStatus::Ok);
    assert_eq!((seen.twist_rad, seen.load_torque_n_m), (state.twist_rad(), state.load_torque_n_m()));
    assert!(seen.twist_rad > 1e-5);

    let now = FlexsplineNow {
        generator_counts: 1 << 30,
        measured_counts: 11_000_000,
        measured_bound_rad: 1e-6,
        torque_n_m: 12.0,
        torque_off_n_m: 0.5,
        load_change_n_m: 0.05,
        state_bound: [2e-6, 1e-4, 1e-3, 0.5],
        ticks: 10,
        has_measured: 1,
    };
    let mut ahead = FlexsplineAhead::default();
    let predict = |now: *const FlexsplineNow, ahead: *mut FlexsplineAhead| {
        flexspline_predict(&predictor, &observer, &o.joint, &*o.store, &o.state, now, ahead)
    };
    assert_eq!(predict(&now, &mut ahead), FlexsplineStatus::Ok);
    let off = Disturbance { torque_n_m: 0.5, load_change_n_m: 0.05, ..Disturbance::default() };
    let turned = rust.ahead(&state, 12.0, 10, now.state_bound, &off);
    let joint: &Joint = get(&o.joint, Object::Joint).unwrap();
    let store: &Store = get(&*o.store, Object::Store).unwrap();
    let from = Now {
        generator: GeneratorAngle::from_counts(1 << 30),
        play: &PlayState::unknown(),
        measured: Some(OutputAngle::from_counts(11_000_000)),
        measured_bound_rad: 1e-6,
    };
    let expected = rust.output_ahead(joint, store, &state, &turned, &from);
    assert_eq!((ahead.output_counts, ahead.bound_rad), (expected.output.counts(), expected.bound_rad));
    assert_eq!((ahead.load_rad, ahead.motor_rad), (turned.load_rad, turned.motor_rad));
    assert!(ahead.load_rad != 0.0 && ahead.bound_rad > 0.0);
    let inside = (&raw const now).cast_mut().cast::<FlexsplineAhead>();
    assert_eq!(predict(&now, inside), FlexsplineStatus::Overlap);
}
