//! All calls next to a tick, from C and from Rust in one sequence: the same bits. And what each call refuses.

use super::tests::{INPUT, LIMITS, TABLE, active, made, table};
use super::*;
use FlexsplineStatus::{
    Argument, Mode as NoMode, NotInitialised, Ok as Done, OtherJoint, OtherTable, Overlap, Pointer, Saved, TooLarge,
};
use core::ffi::{CStr, c_char};
use core::ptr::{null, null_mut};
use flexspline::testing::fixture;
use flexspline::{
    Aged, Approach, Direction, Encoder, EncoderSettings, EncoderWrap, Table, TorquePath, TorqueReading, TorqueSettings,
};
use flexspline_estimation::{
    AdaptSettings, AdaptState, Coefficient, Disturbance, Inertias, Learning, LoadTorque, MaxwellSlip, Measured, NOBODY,
    Noise, OnlineCalibration, PredictorState, Seen, SlipElement, SlipState, Term, TorqueSlipElement, TwoMassObserver,
    Verdict, saved_adapt_bytes, saved_slip_bytes,
};
use flexspline_telemetry::{Recorder, Ring};
use std::string::ToString;
use std::vec::Vec;

/// Memory for an object, full of what was there before.
macro_rules! room {
    ($type:ident) => {
        $type { opaque: [MaybeUninit::new(0x5a5a_5a5a_5a5a_5a5a); _] }
    };
}

const COEFFICIENTS: [FlexsplineCoefficient; 5] = [
    FlexsplineCoefficient { limit: 2e-4, initial_std: 1e-4, term: FLEXSPLINE_TERM_MEAN, order: 0 },
    FlexsplineCoefficient { limit: 1e-5, initial_std: 5e-6, term: FLEXSPLINE_TERM_WIND_UP, order: 0 },
    FlexsplineCoefficient { limit: 5e-5, initial_std: 2e-5, term: FLEXSPLINE_TERM_HALF_WIDTH, order: 0 },
    FlexsplineCoefficient { limit: 1e-4, initial_std: 5e-5, term: FLEXSPLINE_TERM_COSINE, order: 2 },
    FlexsplineCoefficient { limit: 1e-4, initial_std: 5e-5, term: FLEXSPLINE_TERM_SINE, order: 2 },
];

const LEARN: FlexsplineLearnSettings = FlexsplineLearnSettings {
    noise_rad: 2e-6,
    memory_measurements: 300.0,
    gate: 5.0,
    settle_rad: 1e-5,
    torque_limit_n_m: 20.0,
};

fn adapter(joint: &Joint, store: &Store) -> OnlineCalibration<5> {
    let terms = [Term::Mean, Term::WindUp, Term::HalfWidth, Term::Cos(2), Term::Sin(2)];
    let mut places = terms.into_iter().zip(COEFFICIENTS);
    let coefficients = core::array::from_fn(|_| {
        let (term, FlexsplineCoefficient { limit, initial_std, .. }) = places.next().unwrap();
        Coefficient { term, limit, initial_std }
    });
    let settings = AdaptSettings {
        coefficients,
        noise_rad: LEARN.noise_rad,
        memory_measurements: LEARN.memory_measurements,
        gate: LEARN.gate,
        settle_rad: LEARN.settle_rad,
        torque_limit_n_m: LEARN.torque_limit_n_m,
    };
    OnlineCalibration::new(&settings, joint, store, 0).unwrap()
}

const SPRINGS: [FlexsplineSpring; 3] = [
    FlexsplineSpring { width: 1e-4, gain: 0.05 },
    FlexsplineSpring { width: 3e-4, gain: 0.03 },
    FlexsplineSpring { width: 6e-4, gain: -0.02 },
];
const TORQUE_SPRINGS: [FlexsplineSpring; 2] =
    [FlexsplineSpring { width: 0.5, gain: 4e-6 }, FlexsplineSpring { width: 2.0, gain: 1.5e-6 }];

fn banks() -> (MaxwellSlip<3>, MaxwellSlip<2, LoadTorque>) {
    let spring = |s: FlexsplineSpring| SlipElement { width_rad: s.width, gain: s.gain };
    let torque = |s: FlexsplineSpring| TorqueSlipElement { width_n_m: s.width, gain_rad_per_n_m: s.gain };
    (MaxwellSlip::new(SPRINGS.map(spring)).unwrap(), MaxwellSlip::of_torque(TORQUE_SPRINGS.map(torque)).unwrap())
}

const TORQUE: FlexsplineTorqueSettings =
    FlexsplineTorqueSettings { tick_s: 1e-3, bandwidth_hz: 20.0, drag_n_m: 0.4, table_drag_n_m: 0.05, hold_n_m: 0.1 };

const ENCODER: FlexsplineEncoderSettings =
    FlexsplineEncoderSettings { zero_counts: 1234, counts_per_turn: 20_000, wrap_bits: 16, reversed: 1 };

fn encoder() -> Encoder {
    let wrap = EncoderWrap::Bits(16);
    Encoder::new(EncoderSettings { counts_per_turn: 20_000, wrap, reversed: true, zero_counts: 1234 }).unwrap()
}

const INERTIAS: FlexsplineInertias =
    FlexsplineInertias { motor_kg_m2: 1.0, load_kg_m2: 3.0, stiffness_n_m_per_rad: 3e4, damping_n_m_s_per_rad: 20.0 };
const NOISE: FlexsplineNoise =
    FlexsplineNoise { torque_n_m: 0.5, load_change_n_m: 0.2, speed_rad_s: 1e-4, twist_rad: 1e-6, has_twist: 1 };

fn predictor() -> TwoMassObserver {
    let inertias = Inertias {
        motor_kg_m2: INERTIAS.motor_kg_m2,
        load_kg_m2: INERTIAS.load_kg_m2,
        stiffness_n_m_per_rad: INERTIAS.stiffness_n_m_per_rad,
        damping_n_m_s_per_rad: INERTIAS.damping_n_m_s_per_rad,
    };
    let noise = Noise { torque_n_m: 0.5, load_change_n_m: 0.2, speed_rad_s: 1e-4, twist_rad: Some(1e-6) };
    TwoMassObserver::new(inertias, noise, 1e-3).unwrap()
}

/// All in one loop, each fed by what the one before gave, in C and in Rust.
#[test]
#[cfg_attr(miri, ignore = "takes too long")]
fn a_mixed_sequence_is_the_same_bits_from_c_and_from_rust() {
    let ((mut o, table), images) = (active(), Images::new(&TABLE[0], &TABLE[1]));
    assert_eq!(flexspline_state_request(&mut o.state, FLEXSPLINE_MODE_TRACKING), Done);
    let joint = Joint::new(fixture::drive(), LIMITS, Overrun::FadeOut { ticks: 50 }).unwrap();
    let (mut store, mut state) = (Store::new(), JointState::new());
    store.activate(&images, &fixture::drive(), 20.0).unwrap();
    state.request(Mode::Tracking).unwrap();

    // Beside it, from C.
    let (mut c_encoder, mut c_path, mut c_aged) =
        (room!(FlexsplineEncoder), room!(FlexsplineTorquePath), room!(FlexsplineAged));
    let (mut c_learner, mut c_slip, mut c_torque_slip) =
        (room!(FlexsplineLearner), room!(FlexsplineSlip), room!(FlexsplineSlip));
    let (mut c_predictor, mut c_observer, mut c_recorder) =
        (room!(FlexsplinePredictor), room!(FlexsplineObserver), room!(FlexsplineRecorder));
    assert_eq!(flexspline_encoder_init(&mut c_encoder, &ENCODER), Done);
    assert_eq!(flexspline_torque_init_sensor(&mut c_path, &TORQUE, 0.05, 50.0), Done);
    assert_eq!(flexspline_aged_init(&mut c_aged, 4), Done);
    assert_eq!(flexspline_learner_init(&mut c_learner, &LEARN, COEFFICIENTS.as_ptr(), 5), Done);
    assert_eq!(flexspline_learner_bind(&mut c_learner, &o.joint, &*o.store, 0), Done);
    assert_eq!(flexspline_learner_set(&mut c_learner, FLEXSPLINE_LEARNING_ON), Done);
    assert_eq!(flexspline_slip_init(&mut c_slip, FLEXSPLINE_SLIP_OF_OUTPUT, SPRINGS.as_ptr(), 3), Done);
    let kind = FLEXSPLINE_SLIP_OF_TORQUE;
    assert_eq!(flexspline_slip_init(&mut c_torque_slip, kind, TORQUE_SPRINGS.as_ptr(), 2), Done);
    assert_eq!(flexspline_predictor_of(&mut c_predictor, &INERTIAS, &NOISE, 1e-3), Done);
    assert_eq!(flexspline_observer_init(&mut c_observer), Done);
    assert_eq!(flexspline_recorder_init(&mut c_recorder, 8, 10, 0, FLEXSPLINE_FULL_LOSE_OLDEST), Done);
    let mut c_records = [FlexsplineRecord::default(); 8];
    // And from Rust.
    let (encoder, adapter, predictor, (bank, torque_bank)) = (encoder(), adapter(&joint, &store), predictor(), banks());
    let mut path = TorquePath::new(TorqueSettings {
        tick_s: TORQUE.tick_s,
        bandwidth_hz: TORQUE.bandwidth_hz,
        drag_n_m: TORQUE.drag_n_m,
        table_drag_n_m: TORQUE.table_drag_n_m,
        hold_n_m: TORQUE.hold_n_m,
        settle_s: 0.05,
        largest_n_m: 50.0,
    })
    .unwrap();
    let (mut aged, mut learnt, mut observer) = (Aged::new(4), adapter.start(), PredictorState::new());
    learnt.set_learning(Learning::On);
    let (mut springs, mut torque_springs) = (SlipState::<3>::unknown(), SlipState::<2, LoadTorque>::unknown());
    let mut recorder = Recorder::new(Ring::<8>::new(), core::num::NonZeroU32::new(10).unwrap());

    let start = encoder.reading(1 << 30);
    assert_eq!(flexspline_encoder_start(&mut c_encoder, start, 0), Done);
    let mut at = encoder.start(start, 0).unwrap();
    let (mut c_adjustment, mut own, mut adjustment) =
        (room!(FlexsplineAdjustment), Adjustment::default(), Adjustment::default());
    assert_eq!(flexspline_adjustment_init(&mut c_adjustment), Done);
    let (mut used, mut taken, mut moved, mut corrected) = (0, 0, 0i64, 0);
    for tick in 0..4000u32 {
        // A second forward, a second back, with a load that goes to and fro and a sensor that is silent at times.
        let forward = tick / 1000 % 2 == 0;
        moved += if forward { 37 } else { -41 };
        let direction = if forward { 1 } else { -1 };
        let reading = start.wrapping_sub(moved as u64) & 0xffff;
        // The highest bit is wrong now and then.
        let reading = reading ^ (((tick % 97 == 96) as u64) << 15);
        let mut c_angle = 0;
        assert_eq!(flexspline_joint_read(&o.joint, &o.state, &mut c_encoder, reading, &mut c_angle), Done);
        let angle = joint.read(&state, &encoder, &mut at, reading).unwrap();
        assert_eq!((Some(c_angle), c_angle), (encoder.angle(&at), angle.counts()));

        let load = 8.0 - 0.02 * (tick % 800) as f32;
        let (silent, in_mesh) = (tick % 50 > 42, tick % 7 == 0);
        let (mut c_fresh, mut c_torque, mut c_stale) = (0.0f32, 0.0f32, 9);
        assert_eq!(flexspline_aged_tick(&mut c_aged, !silent as u8, load, &mut c_fresh), Done);
        assert_eq!(flexspline_torque_tick(&mut c_path, in_mesh as u8, c_fresh, direction, &mut c_torque), Done);
        assert_eq!(flexspline_aged_is_stale(&c_aged, &mut c_stale), Done);
        let fresh = aged.tick((!silent).then_some(load));
        let read = if in_mesh { TorqueReading::InMesh(fresh) } else { TorqueReading::OnLoad(fresh) };
        let torque = path.tick(read, if forward { Direction::Forward } else { Direction::Backward });
        assert_eq!((c_fresh.to_bits(), c_torque.to_bits()), (fresh.to_bits(), torque.to_bits()));
        assert_eq!(c_stale == 1, aged.is_stale());

        let target = 11_000_000 + moved * 2_000;
        let c_input = FlexsplineInput {
            generator_counts: c_angle,
            target_counts: target,
            torque_n_m: c_torque,
            missed_ticks: u16::from(tick == 777),
            has_generator: u8::from(tick % 97 != 5),
            mean_counts: 0,
            half_width_counts: 0,
        };
        let generator = angle;
        let input = Input {
            generator: (tick % 97 != 5).then_some(generator),
            target: OutputAngle::from_counts(target),
            torque_n_m: torque,
            missed_ticks: u16::from(tick == 777),
            adjustment,
        };
        let mut c_out = FlexsplineOutput::default();
        let (store_at, state_at) = (&raw mut *o.store, &raw mut o.state);
        let ticked =
            flexspline_tick_adjusted(&o.joint, &table, store_at, state_at, &c_input, &c_adjustment, &mut c_out);
        assert_eq!(ticked, Done);
        let out = joint.tick(&images, &mut store, &mut state, &input);
        assert_eq!((c_out.command_counts, c_out.output_counts), (out.command.counts(), out.output.counts()));
        assert_eq!((c_out.correction_rad, c_out.flags), (out.correction_rad, out.flags.bits()));
        assert_eq!((c_out.uncertainty_rad, c_out.quality), (out.uncertainty_rad, out.quality.code()));
        corrected += u32::from(out.correction_rad != 0.0 && out.flags == Flags::default());

        // A star now and then: the output is off by what the learner is to find.
        let star = tick % 3 == 0;
        let off = 60_000 + if forward { -9_000 } else { 9_000 } - tick as i64 % 11 * 500;
        let measured = out.output.counts() + off - i64::from(adjustment.mean_counts());
        let mut c_adapted = FlexsplineAdapted::default();
        // Of the adjustment its own alone.
        let (mean_counts, half_width_counts) = (own.mean_counts(), own.half_width_counts());
        let c_own = FlexsplineInput { mean_counts, half_width_counts, ..c_input };
        let learns = Input { adjustment: own, ..input };
        let found =
            flexspline_learner_update(&mut c_learner, &o.state, &c_own, &c_out, star as u8, measured, &mut c_adapted);
        assert_eq!(found, Done);
        let measured = star.then_some(OutputAngle::from_counts(measured));
        let adapted = adapter.update(&mut learnt, &Seen { input: &learns, output: &out, play: state.play(), measured });
        assert_eq!(c_adapted.mean_counts, adapted.adjustment.mean_counts(), "{tick}");
        assert_eq!(c_adapted.half_width_counts, adapted.adjustment.half_width_counts(), "{tick}");
        assert_eq!(c_adapted.uncertainty_rad.to_bits(), adapted.uncertainty_rad.to_bits(), "{tick}");
        used += u32::from(c_adapted.verdict == FLEXSPLINE_VERDICT_USED);
        assert_eq!(c_adapted.verdict == FLEXSPLINE_VERDICT_USED, adapted.verdict == Verdict::Used);

        let (mut c_nominal, mut c_slip_report, mut c_slip_report_torque) =
            (0, FlexsplineSlipReport::default(), FlexsplineSlipReport::default());
        assert_eq!(flexspline_nominal_output(&o.joint, c_angle, &mut c_nominal), Done);
        assert_eq!(flexspline_slip_update(&mut c_slip, c_nominal, &mut c_slip_report), Done);
        assert_eq!(flexspline_slip_update_torque(&mut c_torque_slip, c_torque, &mut c_slip_report_torque), Done);
        let slip = bank.update(&mut springs, joint.drive().nominal_output(generator));
        let slip_torque = torque_bank.update(&mut torque_springs, torque);
        for (c, rust, known) in [
            (&c_slip_report, slip, springs.is_known()),
            (&c_slip_report_torque, slip_torque, torque_springs.is_known()),
        ] {
            assert_eq!(
                (c.error_rad.to_bits(), c.uncertainty_rad.to_bits()),
                (rust.error_rad.to_bits(), rust.uncertainty_rad.to_bits())
            );
            assert_eq!((c.mean_counts, c.is_known == 1), (rust.mean_counts(), known));
        }
        let lost = if c_adapted.verdict == FLEXSPLINE_VERDICT_LOST { c_adapted.uncertainty_rad } else { 0.0 };
        assert_eq!(flexspline_adjustment_init(&mut c_adjustment), Done);
        for (mean, half, uncertainty_rad) in [
            (c_adapted.mean_counts, c_adapted.half_width_counts, lost),
            (c_slip_report.mean_counts, 0, c_slip_report.uncertainty_rad),
            (c_slip_report_torque.mean_counts, 0, c_slip_report_torque.uncertainty_rad),
        ] {
            assert_eq!(flexspline_adjustment_add(&mut c_adjustment, mean, half, uncertainty_rad), Done);
        }
        own = adapted.adjustment;
        adjustment = slip_torque.added_to(slip.added_to(own));
        assert_eq!(get::<_, Adjustment>(&c_adjustment, Object::Adjustment), Ok(&adjustment));

        let c_measured =
            FlexsplineMeasured { torque_n_m: load, speed_rad_s: 0.02 * direction as f32, twist_rad: load * 3e-5 };
        assert_eq!(flexspline_observer_step(&mut c_observer, &c_predictor, &c_measured), Done);
        let FlexsplineMeasured { torque_n_m, speed_rad_s, twist_rad } = c_measured;
        predictor.step(&mut observer, &Measured { torque_n_m, speed_rad_s, twist_rad });

        let at_once = tick % 331 == 0;
        let list = c_records.as_mut_ptr();
        let seen = flexspline_recorder_see(&mut c_recorder, list, tick, at_once as u8, &o.state, &*o.store, &c_out);
        assert_eq!(seen, Done);
        if at_once {
            recorder.record_now(tick, &state, &store, &out);
        } else {
            recorder.record(tick, &state, &store, &out);
        }
        // Slower than they come: some are lost.
        if tick % 12 == 0 {
            let (mut c_record, mut is_taken) = (FlexsplineRecord::default(), 9);
            let list = c_records.as_ptr();
            assert_eq!(flexspline_recorder_take(&mut c_recorder, list, &mut c_record, &mut is_taken), Done);
            let record = recorder.sink().take();
            assert_eq!(is_taken == 1, record.is_some());
            if let Some(record) = record {
                let (mut bytes, mut back) = ([0; FLEXSPLINE_RECORD_BYTES], FlexsplineRecord::default());
                assert_eq!(flexspline_record_encode(&c_record, &mut bytes), Done);
                assert_eq!(bytes, record.encode(), "{tick}");
                assert_eq!(flexspline_record_decode(bytes.as_ptr(), &mut back), Done);
                assert_eq!(
                    (back.tick, back.lost, back.output_counts),
                    (c_record.tick, c_record.lost, c_record.output_counts)
                );
                (taken, bytes[9]) = (taken + 1, !bytes[9]);
                assert_eq!(flexspline_record_decode(bytes.as_ptr(), &mut back), Saved);
            }
        }

        if tick % 100 == 60 {
            questions(&o, &joint, &store, &state, generator, target, torque);
        }
        if tick == 2500 {
            // Across a reset: the bytes are the same, and so is what follows.
            let (mut bytes, mut written) = ([0; FLEXSPLINE_SAVED_LEARNER_BYTES], 0);
            let mut expected = [0; saved_adapt_bytes(5)];
            assert_eq!(flexspline_learner_save(&c_learner, bytes.as_mut_ptr(), bytes.len(), &mut written), Done);
            assert_eq!(adapter.save(&learnt, &mut expected), Some(written));
            assert_eq!(bytes[..written], expected);
            assert_eq!(flexspline_learner_init(&mut c_learner, &LEARN, COEFFICIENTS.as_ptr(), 5), Done);
            assert_eq!(flexspline_learner_bind(&mut c_learner, &o.joint, &*o.store, 0), Done);
            assert_eq!(flexspline_learner_restore(&mut c_learner, bytes.as_ptr(), written), Done);
            assert_eq!(flexspline_learner_set(&mut c_learner, FLEXSPLINE_LEARNING_ON), Done);
            learnt = adapter.restore(&expected).unwrap();
            learnt.set_learning(Learning::On);
            let mut expected = [0; saved_slip_bytes(3)];
            assert_eq!(flexspline_slip_save(&c_slip, bytes.as_mut_ptr(), bytes.len(), &mut written), Done);
            assert_eq!(bank.save_first(&springs, NOBODY, 3, &mut expected), Some(written));
            assert_eq!(bytes[..written], expected);
            assert_eq!(flexspline_slip_set(&mut c_slip, 0), Done);
            assert_eq!(flexspline_slip_restore(&mut c_slip, bytes.as_ptr(), written), Done);
            let mut expected = [0; saved_slip_bytes(2)];
            assert_eq!(flexspline_slip_save(&c_torque_slip, bytes.as_mut_ptr(), bytes.len(), &mut written), Done);
            assert_eq!(torque_bank.save_first(&torque_springs, NOBODY, 2, &mut expected), Some(written));
            assert_eq!(bytes[..written], expected);
            // Springs of another kind are others.
            assert_eq!(flexspline_slip_restore(&mut c_slip, bytes.as_ptr(), written), Saved);
        }
    }
    // What is compared is something.
    assert!(used > 300 && taken > 200 && corrected > 1000, "{used} {taken} {corrected}");
    let mut report = FlexsplineLearnerReport::default();
    assert_eq!(flexspline_learner_report(&c_learner, &mut report), Done);
    let counters = learnt.counters();
    assert_eq!((report.used, report.outliers, report.quiet), (counters.used, counters.outliers, counters.quiet));
    assert_eq!(
        (report.unsettled, report.untrusted, report.limited),
        (counters.unsettled, counters.untrusted, counters.limited)
    );
    assert_eq!((report.learning, report.coefficients), (FLEXSPLINE_LEARNING_ON, 5));
    for (place, (value, std)) in (0..).zip(adapter.coefficients(&learnt)) {
        let mut found = FlexsplineLearnt::default();
        assert_eq!(flexspline_learner_coefficient(&c_learner, place, &mut found), Done);
        assert_eq!((found.value.to_bits(), found.std.to_bits()), (value.to_bits(), std.to_bits()));
        assert!(value != 0.0);
    }
    let mut seen = FlexsplineObserverReport::default();
    assert_eq!(flexspline_observer_report(&c_observer, &mut seen), Done);
    assert_eq!((seen.twist_rad, seen.load_torque_n_m), (observer.twist_rad(), observer.load_torque_n_m()));
    let (mut parts, mut bound) = ([0.0; FLEXSPLINE_PREDICTOR_PARTS], [0.0; 4]);
    assert_eq!(flexspline_predictor_parts(&c_predictor, &mut parts), Done);
    assert_eq!(parts, predictor.parts());
    let off = FlexsplineDisturbance { torque_n_m: 0.5, load_change_n_m: 0.05, speed_rad_s: 1e-4, twist_rad: 1e-6 };
    assert_eq!(flexspline_predictor_state_bound(&c_predictor, &off, &mut bound), Done);
    let off = Disturbance { torque_n_m: 0.5, load_change_n_m: 0.05, speed_rad_s: 1e-4, twist_rad: 1e-6 };
    assert_eq!(bound, predictor.state_bound(&off));
}

/// Queries of a table outside a tick.
fn questions(
    o: &super::tests::Objects,
    joint: &Joint,
    store: &Store,
    state: &JointState,
    generator: GeneratorAngle,
    target: i64,
    torque: f32,
) {
    let mut found = FlexsplinePrediction::default();
    let then = generator.offset_counts(1 << 28);
    assert_eq!(flexspline_forward(&o.joint, &*o.store, &o.state, then.counts(), torque, &mut found), Done);
    let expected = joint.forward(store, &mut state.play().clone(), then, torque);
    assert_eq!((found.output_counts, found.nominal_counts), (expected.output.counts(), expected.nominal.counts()));
    assert_eq!(found.transmission_error_rad.to_bits(), expected.transmission_error_rad.to_bits());
    assert_eq!((found.uncertainty_rad, found.quality), (expected.uncertainty_rad, expected.quality.code()));
    let approaches = [
        (1, Approach::Moving(Direction::Forward)),
        (-1, Approach::Moving(Direction::Backward)),
        (0, Approach::From(state.play())),
    ];
    for (direction, approach) in approaches {
        let mut found = FlexsplineCommand::default();
        let asked = flexspline_inverse(&o.joint, &*o.store, &o.state, target, torque, direction, &mut found);
        let expected = joint.inverse(store, OutputAngle::from_counts(target), torque, approach);
        assert_eq!((asked, found.generator_counts), (Done, expected.generator.counts()));
        assert_eq!(found.predicted_error_rad.to_bits(), expected.predicted_error_rad.to_bits());
        assert_eq!((found.uncertainty_rad, found.quality), (expected.uncertainty_rad, expected.quality.code()));
    }
    let mut found = FlexsplineLocated::default();
    assert_eq!(flexspline_joint_locate(&o.joint, &*o.store, target, 1e-5, torque, 2.0, &mut found), Done);
    let output = OutputAngle::from_counts(target);
    let expected = joint.locate(store, output, 1e-5, torque, 2.0);
    assert_eq!((found.generator_counts, found.turns), (expected.generator.counts(), expected.turns));
    assert_eq!((found.half_width_rad, found.quality), (expected.half_width_rad, expected.quality.code()));
    let parts = [expected.of_reading_rad, expected.of_play_rad, expected.of_load_rad];
    assert_eq!([found.of_reading_rad, found.of_play_rad, found.of_load_rad], parts);
    let mut c_adjustment = room!(FlexsplineAdjustment);
    assert_eq!(flexspline_adjustment_init(&mut c_adjustment), Done);
    assert_eq!(flexspline_adjustment_add(&mut c_adjustment, 20_000, -3_000, 1e-6), Done);
    let adjusted = Adjustment::new(20_000, -3_000).with_uncertainty(1e-6);
    for (direction, play, given, adjustment) in [
        (1, PlayState::after_motion(Direction::Forward), null(), Adjustment::default()),
        (-1, PlayState::after_motion(Direction::Backward), &raw const c_adjustment, adjusted),
        (0, *state.play(), &raw const c_adjustment, adjusted),
    ] {
        let mut found = FlexsplineTorqueFromWindUp::default();
        let (now, to) = (generator.counts(), &mut found);
        let asked = flexspline_joint_torque(&o.joint, &*o.store, &o.state, given, direction, now, target, 1e-5, to);
        let expected = joint.torque(store, &play, &adjustment, generator, output, 1e-5);
        assert_eq!((asked, found.torque_n_m.to_bits()), (Done, expected.torque_n_m.to_bits()));
        assert_eq!([found.low_n_m, found.high_n_m], [expected.low_n_m, expected.high_n_m]);
        assert_eq!(found.quality, expected.quality.code());
    }
    let mut rate = 0.0f32;
    let asked = flexspline_rate_ahead(&o.joint, &*o.store, target, -0.01, torque, 4e-3, &mut rate);
    let expected = joint.rate_ahead(store, OutputAngle::from_counts(target), -0.01, torque, 4e-3);
    assert_eq!((asked, rate.to_bits()), (Done, expected.to_bits()));
    let mut ahead = FlexsplineMotionAhead::default();
    let asked = flexspline_motion_ahead(&o.joint, &*o.store, target, -0.01, 0.2, torque, 4e-3, &mut ahead);
    let expected = joint.motion_ahead(store, OutputAngle::from_counts(target), [-0.01, 0.2], torque, 4e-3);
    assert_eq!(asked, Done);
    assert_eq!([ahead.rate_rad_s, ahead.acceleration_rad_s2], expected);
    let (mut play, mut back) = (FlexsplinePlay::default(), 0);
    assert_eq!(flexspline_state_play(&o.state, &mut play), Done);
    let expected = state.play();
    assert_eq!((play.offset_rad, play.uncertainty_rad), (expected.offset_rad(), expected.uncertainty_rad()));
    assert_eq!((play.is_known == 1, play.is_started), (expected.is_known(), 1));
    assert_eq!(play.output_counts, expected.output().unwrap().counts());
    assert_eq!(play.nominal_counts, expected.nominal().unwrap().counts());
    assert_eq!(flexspline_nominal_generator(&o.joint, play.nominal_counts, &mut back), Done);
    assert_eq!(back, joint.drive().nominal_generator(expected.nominal().unwrap()).counts());
    let mut ratio = 0.0;
    assert_eq!((flexspline_ratio(&o.joint, &mut ratio), ratio), (Done, joint.drive().ratio()));
}

#[test]
fn an_image_tells_what_it_is() {
    let mut image = fixture::image(true);
    let mut report = FlexsplineImageReport::default();
    assert_eq!(flexspline_image_report(image.as_ptr(), image.len(), &mut report), Done);
    let table = Table::check(&image).unwrap();
    assert_eq!((report.table_id, report.torque_range_n_m), (table.id().0, table.torque_range_n_m()));
    assert_eq!((report.flexspline_teeth, report.circular_spline_teeth, report.fixed_member), (188, 190, 0));
    assert_eq!(report.temperature_range_c, table.temperature_range_c());
    assert_eq!((report.error_limit_rad, report.generator), (table.error_limit_rad(), table.generator_kind().code()));
    let sheet_scatter = table.sheet_scatter().unwrap_or(0.0);
    let inside = image.as_mut_ptr().cast::<FlexsplineImageReport>();
    let inside = if inside.is_aligned() { inside } else { image.as_mut_ptr().wrapping_add(4).cast() };
    if inside.is_aligned() {
        assert_eq!(flexspline_image_report(image.as_ptr(), image.len(), inside), Overlap);
    }
    assert_eq!(flexspline_image_report(null(), 9, &mut report), Pointer);
    let mut scatter = f32::NAN;
    assert_eq!(flexspline_image_sheet_scatter(image.as_ptr(), image.len(), &mut scatter), Done);
    assert_eq!(scatter, sheet_scatter);
    assert_eq!(flexspline_image_sheet_scatter(null(), 9, &mut scatter), Pointer);
    image[900] ^= 1;
    assert_eq!(flexspline_image_report(image.as_ptr(), image.len(), &mut report), FlexsplineStatus::Image);
}

/// Any bit of the mark of every object of a tick, and of what feeds it: the calls go on, and a call that writes makes
/// the mark anew.
#[test]
fn a_bit_of_a_mark_refuses_nothing() {
    let marks = Object::ALL;
    for (i, one) in marks.iter().enumerate() {
        for other in marks[..i].iter().map(|other| spread(*other)).chain([0, u32::MAX, 0x5a5a_5a5a]) {
            assert!((spread(*one) ^ other).count_ones() >= 4, "{one:?} {other:x}");
        }
    }
    let (mut o, table) = active();
    let mut out = FlexsplineOutput::default();
    for bit in 0..32 {
        let marks = |o: &mut super::tests::Objects| -> [*mut u32; 3] {
            [(&raw mut *o.store).cast(), (&raw mut o.joint).cast(), (&raw mut o.state).cast()]
        };
        // SAFETY: the first word of each is its mark.
        marks(&mut o).iter().for_each(|mark| unsafe { **mark ^= 1 << bit });
        assert_eq!(flexspline_tick(&o.joint, &table, &mut *o.store, &mut o.state, &INPUT, &mut out), Done, "{bit}");
        assert_eq!(flexspline_joint_mend(&mut o.joint), Done);
        // SAFETY: as above.
        let found = marks(&mut o).map(|mark| unsafe { *mark });
        assert_eq!(found, [Object::Store, Object::Joint, Object::State].map(spread), "{bit}");
    }
    // SAFETY: as above.
    unsafe { *(&raw mut o.state).cast::<u32>() ^= 3 };
    assert_eq!(flexspline_tick(&o.joint, &table, &mut *o.store, &mut o.state, &INPUT, &mut out), NotInitialised);
}

#[test]
fn each_number_has_its_name() {
    // SAFETY: texts of the library.
    let text = |name: *const c_char| unsafe { CStr::from_ptr(name) }.to_str().unwrap();
    let one: &[(extern "C" fn(u8) -> *const c_char, &[&str])] = &[
        (flexspline_mode_name, &["off", "tracking", "hold", "safe"]),
        (flexspline_quality_name, &["in range", "uncertain", "extrapolated", "disabled"]),
        (flexspline_health_name, &["sound", "one image", "lost", "empty", "torn"]),
        (flexspline_overrun_name, &["skip and count", "hold last", "fade out"]),
        (flexspline_fixed_member_name, &["flexspline", "circular spline"]),
        (flexspline_generator_name, &["other", "two-roller", "four-roller", "double-disc", "cam"]),
        (flexspline_progress_name, &["checking", "filling", "done"]),
        (flexspline_identity_name, &["hashing", "same", "other"]),
        (flexspline_learning_name, &["off", "frozen", "on"]),
        (flexspline_term_name, &["mean", "wind-up", "half-width", "cosine", "sine"]),
        (flexspline_verdict_name, &["idle", "used", "quiet", "outlier", "unsettled", "unexcited", "untrusted", "lost"]),
    ];
    for (name, names) in one {
        let found: Vec<_> = (0..names.len() as u8).map(|code| text(name(code))).collect();
        assert_eq!((found.as_slice(), text(name(names.len() as u8)), text(name(255))), (*names, "?", "?"));
    }
    let bits = |name: extern "C" fn(u16) -> *const c_char| {
        let found: Vec<_> = (0..16).map(|bit| text(name(1 << bit))).take_while(|name| *name != "?").collect();
        assert_eq!((text(name(0)), text(name(3)), text(name(0x8000))), ("?", "?", "?"));
        found.join(", ")
    };
    let flags = "sample lost, glitch, overrun, held back, not corrected, table doubt, state torn, joint torn, safe, \
                 other images, bounded";
    assert_eq!(bits(flexspline_flag_name), flags);
    let implausible = "generator lost, generator still, generator sign, generator ratio, output still, output sign, \
                       output ratio, torque still, torque sign, torque ratio, lost";
    assert_eq!(bits(flexspline_implausible_name), implausible);
    let events = "mode, health, page damaged, table doubt, fallback, recovered, overrun, state torn";
    assert_eq!(bits(flexspline_event_name), events);
    let texts: Vec<_> = (0..=18).map(|status| text(flexspline_status_text(status))).collect();
    assert!(texts.iter().enumerate().all(|(i, one)| *one != "?" && !texts[..i].contains(one)), "{texts:?}");
    assert_eq!(text(flexspline_status_text(FlexsplineStatus::SelfTest as i32)), "the self-test failed");
    assert_eq!((text(flexspline_status_text(19)), text(flexspline_status_text(-1))), ("?", "?"));
    let modes = [Mode::Off, Mode::Tracking, Mode::Hold, Mode::Safe];
    for (code, mode) in (0..).zip(modes) {
        for (next_code, next) in (0..).zip(modes) {
            assert_eq!(flexspline_mode_may_become(code, next_code) == 1, mode.may_become(next), "{mode:?} {next:?}");
        }
        assert_eq!((flexspline_mode_may_become(code, 4), flexspline_mode_may_become(4, code)), (0, 0));
    }
    let version =
        [FLEXSPLINE_VERSION_MAJOR, FLEXSPLINE_VERSION_MINOR, FLEXSPLINE_VERSION_PATCH].map(|part| part.to_string());
    assert_eq!(text(flexspline_version()), version.join("."));
    assert_eq!(flexspline_version_number(), FLEXSPLINE_VERSION_NUMBER);
}

#[test]
fn angles_and_groups_are_those_of_rust() {
    let mut counts = 9;
    assert_eq!(
        (flexspline_counts_from_rad(0.01, &mut counts), counts),
        (Done, OutputAngle::from_rad(0.01).unwrap().counts())
    );
    assert_eq!(
        (flexspline_counts_from_rad(f64::NAN, &mut counts), counts),
        (Argument, OutputAngle::from_rad(0.01).unwrap().counts())
    );
    assert_eq!(flexspline_counts_from_rad(1.0, null_mut()), Pointer);
    assert_eq!(flexspline_rad_from_counts(1 << 32), core::f64::consts::TAU);
    assert_eq!(flexspline_rad_between(5 << 32, (5 << 32) + (1 << 30)), core::f32::consts::FRAC_PI_2);
    assert!((0..100).all(|tick| flexspline_is_due(tick, 10, 3) == u8::from(tick % 10 == 3)));
    assert_eq!((flexspline_is_due(0, 0, 0), flexspline_is_due(5, 5, 5)), (0, 0));
}

/// A list of records of each kind when it is full, next to the queues of Rust.
#[test]
fn a_full_list_loses_what_it_was_told_to_lose() {
    let o = made();
    let out = FlexsplineOutput::default();
    for (full, expected) in [(FLEXSPLINE_FULL_LOSE_OLDEST, [7, 8, 9]), (FLEXSPLINE_FULL_LOSE_NEW, [0, 1, 2])] {
        let (mut recorder, mut list) = (room!(FlexsplineRecorder), [FlexsplineRecord::default(); 3]);
        assert_eq!(flexspline_recorder_init(&mut recorder, 3, 1, 0, full), Done);
        for tick in 0..10 {
            let at = list.as_mut_ptr();
            assert_eq!(flexspline_recorder_see(&mut recorder, at, tick, 0, &o.state, &*o.store, &out), Done);
        }
        let (mut record, mut is_taken, mut found) = (FlexsplineRecord::default(), 1, Vec::new());
        loop {
            assert_eq!(flexspline_recorder_take(&mut recorder, list.as_ptr(), &mut record, &mut is_taken), Done);
            if is_taken == 0 {
                break;
            }
            found.push(record.tick);
        }
        assert_eq!(found, expected);
        // Seven were lost, and the next says so.
        let at = list.as_mut_ptr();
        assert_eq!(flexspline_recorder_see(&mut recorder, at, 10, 0, &o.state, &*o.store, &out), Done);
        assert_eq!(flexspline_recorder_take(&mut recorder, list.as_ptr(), &mut record, &mut is_taken), Done);
        assert_eq!((record.tick, record.number, record.lost, is_taken), (10, 10, 7, 1));
    }
}

#[test]
fn what_is_not_allowed_is_refused() {
    let o = made();
    let mut recorder = room!(FlexsplineRecorder);
    for (places, divisor, offset, full) in [(0, 1, 0, 0), (1, 0, 0, 0), (1, 5, 5, 0), (1, 1, 0, 2)] {
        assert_eq!(flexspline_recorder_init(&mut recorder, places, divisor, offset, full), Argument);
    }
    let (mut list, out) = ([FlexsplineRecord::default(); 3], FlexsplineOutput::default());
    let at = list.as_mut_ptr();
    assert_eq!(flexspline_recorder_see(&mut recorder, at, 0, 0, &o.state, &*o.store, &out), NotInitialised);
    assert_eq!(flexspline_recorder_init(&mut recorder, 3, 1, 0, 0), Done);
    let within = (&raw const o.state).cast_mut().cast::<FlexsplineRecord>();
    assert_eq!(flexspline_recorder_see(&mut recorder, within, 0, 0, &o.state, &*o.store, &out), Overlap);
    let mut is_taken = 9;
    let last = at.wrapping_add(2);
    assert_eq!(flexspline_recorder_take(&mut recorder, at, last, &mut is_taken), Overlap);
    let (mut bytes, bad) = ([0; FLEXSPLINE_RECORD_BYTES], FlexsplineRecord { mode: 4, ..FlexsplineRecord::default() });
    assert_eq!(flexspline_record_encode(&bad, &mut bytes), Argument);
    let bad = FlexsplineRecord { health: 5, ..FlexsplineRecord::default() };
    assert_eq!((flexspline_record_encode(&bad, &mut bytes), bytes), (Argument, [0; FLEXSPLINE_RECORD_BYTES]));
    let mut old =
        flexspline_telemetry::Record::of(0, &JointState::new(), &Store::new(), &given(&out).unwrap()).encode();
    old[2] = 1;
    assert_eq!(flexspline_record_decode(old.as_ptr(), at), Argument);

    let mut learner = room!(FlexsplineLearner);
    let init = |learner: &mut FlexsplineLearner, settings: &FlexsplineLearnSettings, list: &[FlexsplineCoefficient]| {
        flexspline_learner_init(learner, settings, list.as_ptr(), list.len() as u8)
    };
    assert_eq!(flexspline_learner_set(&mut learner, 0), NotInitialised);
    assert_eq!(init(&mut learner, &LEARN, &[]), Argument);
    assert_eq!(init(&mut learner, &LEARN, &[COEFFICIENTS[0]; 8]), Argument);
    assert_eq!(flexspline_learner_init(&mut learner, &LEARN, null(), 2), Pointer);
    assert_eq!(init(&mut learner, &FlexsplineLearnSettings { gate: 0.5, ..LEARN }, &COEFFICIENTS), Argument);
    for wrong in [
        FlexsplineCoefficient { term: 5, ..COEFFICIENTS[0] },
        FlexsplineCoefficient { order: 1, ..COEFFICIENTS[0] },
        FlexsplineCoefficient { order: 0, ..COEFFICIENTS[3] },
        FlexsplineCoefficient { limit: f32::NAN, ..COEFFICIENTS[0] },
    ] {
        assert_eq!(init(&mut learner, &LEARN, &[wrong]), Argument, "{wrong:?}");
    }
    assert_eq!(init(&mut learner, &LEARN, &COEFFICIENTS), Done);
    assert_eq!(flexspline_learner_set(&mut learner, 3), Argument);
    let (mut learnt, mut adapted) = (FlexsplineLearnt::default(), FlexsplineAdapted::default());
    assert_eq!(flexspline_learner_coefficient(&learner, 5, &mut learnt), Argument);
    let bad = FlexsplineOutput { quality: 4, ..out };
    let update = |learner: &mut FlexsplineLearner, output, adapted| {
        flexspline_learner_update(learner, &o.state, &INPUT, output, 0, 0, adapted)
    };
    assert_eq!(update(&mut learner, &bad, &mut adapted), Argument);
    let inside = (&raw mut learner).cast::<FlexsplineAdapted>().wrapping_add(2);
    assert_eq!(update(&mut learner, &out, inside), Overlap);
    let (mut bytes, mut written) = ([0; 200], 77);
    assert_eq!(flexspline_learner_save(&learner, bytes.as_mut_ptr(), 111, &mut written), TooLarge);
    assert_eq!((flexspline_learner_save(&learner, bytes.as_mut_ptr(), 112, &mut written), written), (Done, 112));
    bytes[3] ^= 1;
    assert_eq!(flexspline_learner_restore(&mut learner, bytes.as_ptr(), 112), Saved);
    bytes[3] ^= 1;
    assert_eq!(flexspline_learner_restore(&mut learner, bytes.as_ptr(), 111), Saved);
    assert_eq!(flexspline_learner_restore(&mut learner, bytes.as_ptr(), 112), Done);
    // Bound to a joint, a table and a unit; refused, the learner is as it was.
    let nothing = room!(FlexsplineJoint);
    assert_eq!(flexspline_learner_bind(&mut learner, &nothing, &*o.store, 1), NotInitialised);
    assert_eq!(flexspline_learner_bind(&mut learner, &o.joint, (&raw const learner).cast(), 1), Overlap);
    assert_eq!(flexspline_learner_bind(&mut learner, &o.joint, &*o.store, 1), Argument);
    let mut o = o;
    assert_eq!(flexspline_store_activate(&mut *o.store, &o.joint, &table(), 20.0), Done);
    let mut bound = [[0; 200]; 2];
    for (bytes, unit) in bound.iter_mut().zip([1, 2]) {
        assert_eq!(flexspline_learner_bind(&mut learner, &o.joint, &*o.store, unit), Done);
        assert_eq!(flexspline_learner_save(&learner, bytes.as_mut_ptr(), 112, &mut written), Done);
    }
    for (saved, expected) in [(&bytes, OtherTable), (&bound[0], OtherJoint), (&bound[1], Done)] {
        assert_eq!(flexspline_learner_restore(&mut learner, saved.as_ptr(), 112), expected);
        let mut after = [0; 200];
        assert_eq!(flexspline_learner_save(&learner, after.as_mut_ptr(), 112, &mut written), Done);
        assert_eq!(after, bound[1]);
    }
    assert_eq!(flexspline_learner_reset(&mut learner), Done);
    let (joint, empty) = (get(&o.joint, Object::Joint).unwrap(), Store::new());
    let other: Result<AdaptState<5>, _> = adapter(joint, &empty).restore(&bytes);
    assert!(other.is_ok());

    let mut slip = room!(FlexsplineSlip);
    let init = |slip: &mut FlexsplineSlip, variable, spring| flexspline_slip_init(slip, variable, &spring, 1);
    let wide = FlexsplineSpring { width: 0.06, gain: 0.5 };
    // Together more than an adjustment can be.
    let strong = FlexsplineSpring { width: 0.06, gain: 1.0 };
    assert_eq!(init(&mut slip, FLEXSPLINE_SLIP_OF_TORQUE, strong), Argument);
    assert_eq!((init(&mut slip, 0, wide), init(&mut slip, 2, SPRINGS[0])), (Argument, Argument));
    assert_eq!(flexspline_slip_set(&mut slip, 0), NotInitialised);
    assert_eq!(init(&mut slip, FLEXSPLINE_SLIP_OF_TORQUE, wide), Done);
    let mut report = FlexsplineSlipReport::default();
    assert_eq!(flexspline_slip_update(&mut slip, 0, &mut report), Argument);
    assert_eq!(flexspline_slip_save(&slip, bytes.as_mut_ptr(), 200, &mut written), TooLarge);
    assert_eq!(flexspline_slip_update_torque(&mut slip, 0.1, &mut report), Done);
    assert_eq!(flexspline_slip_save(&slip, bytes.as_mut_ptr(), 200, &mut written), Done);
    assert_eq!((written, flexspline_slip_set(&mut slip, 2)), (44, Argument));

    let mut path = room!(FlexsplineTorquePath);
    let mut torque = 0.0;
    assert_eq!(flexspline_torque_init(&mut path, &FlexsplineTorqueSettings { tick_s: 0.0, ..TORQUE }), Argument);
    assert_eq!(flexspline_torque_tick(&mut path, 0, 1.0, 1, &mut torque), NotInitialised);
    assert_eq!(flexspline_torque_init_sensor(&mut path, &TORQUE, -1.0, 50.0), Argument);
    assert_eq!(flexspline_torque_init_sensor(&mut path, &TORQUE, 0.1, f32::NAN), Argument);
    assert_eq!(flexspline_torque_init(&mut path, &TORQUE), Done);
    assert_eq!(flexspline_torque_tick(&mut path, 0, 1.0, 0, &mut torque), Argument);
    assert_eq!(flexspline_torque_tick(&mut path, 2, 1.0, 1, &mut torque), Argument);
    let mut aged = room!(FlexsplineAged);
    assert_eq!(flexspline_aged_tick(&mut aged, 1, 1.0, &mut torque), NotInitialised);

    let mut encoder = room!(FlexsplineEncoder);
    let mut angle = 0;
    let wrong = FlexsplineEncoderSettings { wrap_bits: 65, ..ENCODER };
    assert_eq!(flexspline_encoder_init(&mut encoder, &wrong), Argument);
    let wrong = FlexsplineEncoderSettings { reversed: 2, ..ENCODER };
    assert_eq!(flexspline_encoder_init(&mut encoder, &wrong), Argument);
    assert_eq!(flexspline_encoder_init(&mut encoder, &ENCODER), Done);
    assert_eq!(flexspline_encoder_read(&mut encoder, 5, &mut angle), NotInitialised);
    assert_eq!(flexspline_encoder_start(&mut encoder, 1 << 16, 0), Argument);
    assert_eq!(flexspline_encoder_start(&mut encoder, 5, 0), Done);
    assert_eq!(flexspline_encoder_read(&mut encoder, 1 << 16, &mut angle), Argument);
    let mut reading = 0;
    assert_eq!((flexspline_encoder_reading(&encoder, 0, &mut reading), reading), (Done, 1234));
    assert_eq!(flexspline_encoder_read(&mut encoder, 6, &mut angle), Done);
    let mut by_joint = |encoder: &mut FlexsplineEncoder, reading| {
        let status = flexspline_joint_read(&o.joint, &o.state, encoder, reading, &mut angle);
        (status, angle)
    };
    assert_eq!(by_joint(&mut encoder, 1234), (Done, 0));
    assert_eq!(by_joint(&mut encoder, 1 << 16), (Argument, 0));
    assert_eq!(by_joint(&mut room!(FlexsplineEncoder), 5).0, NotInitialised);
    let itself = (&raw mut encoder).cast::<i64>();
    assert_eq!(flexspline_joint_read(&o.joint, &o.state, &mut encoder, 5, itself), Overlap);

    let mut predictor = room!(FlexsplinePredictor);
    let wrong = FlexsplineInertias { load_kg_m2: 0.0, ..INERTIAS };
    assert_eq!(flexspline_predictor_of(&mut predictor, &wrong, &NOISE, 1e-3), Argument);
    // A store without a table.
    assert_eq!(flexspline_store_init(&mut *o.store), Done);
    let mut rate = 0.0f32;
    let ask = |ahead_s, rate| flexspline_rate_ahead(&o.joint, &*o.store, 0, 0.01, 1.0, ahead_s, rate);
    assert_eq!((ask(0.0, &mut rate), ask(f32::NAN, &mut rate)), (Argument, Argument));
    assert_eq!(ask(1e-3, &mut rate), Done);
    assert!(rate.is_nan(), "no table");
    let mut ahead = FlexsplineMotionAhead::default();
    let ask = |acceleration, ahead_s, ahead| {
        flexspline_motion_ahead(&o.joint, &*o.store, 0, 0.01, acceleration, 1.0, ahead_s, ahead)
    };
    assert_eq!((ask(f32::NAN, 1e-3, &mut ahead), ask(0.1, 0.0, &mut ahead)), (Argument, Argument));
    assert_eq!(ask(0.1, 1e-3, &mut ahead), Done);
    assert!(ahead.rate_rad_s.is_nan() && ahead.acceleration_rad_s2.is_nan(), "no table");
    let mut command = FlexsplineCommand::default();
    assert_eq!(flexspline_inverse(&o.joint, &*o.store, &o.state, 0, 0.0, 2, &mut command), Argument);
    let mut torque = FlexsplineTorqueFromWindUp::default();
    let ask = |adjustment, direction, torque| {
        flexspline_joint_torque(&o.joint, &*o.store, &o.state, adjustment, direction, 0, 0, 1e-5, torque)
    };
    assert_eq!(ask(null(), 2, &mut torque), Argument);
    let nothing = room!(FlexsplineAdjustment);
    assert_eq!(ask(&nothing, 1, &mut torque), NotInitialised);
    let inside = (&raw const nothing).cast_mut().cast();
    assert_eq!((ask(&nothing, 1, inside), ask(null(), 1, null_mut())), (Overlap, Pointer));
    assert_eq!((ask(null(), 0, &mut torque), torque.quality), (Done, FLEXSPLINE_QUALITY_DISABLED));
    let mut located = FlexsplineLocated::default();
    let asked = flexspline_joint_locate(&o.joint, &*o.store, 0, 1e-5, 0.0, 0.0, &mut located);
    assert_eq!((asked, located.turns, located.quality), (Done, 0, FLEXSPLINE_QUALITY_DISABLED));
    let mut other = made();
    assert_eq!(flexspline_state_request(&mut other.state, FLEXSPLINE_MODE_HOLD), NoMode);
    let mut input = INPUT;
    assert_eq!(flexspline_input_add_rad(&mut input, 1.0, f32::NAN), Done);
    assert_eq!((input.mean_counts, input.half_width_counts), (Adjustment::MAX_COUNTS, 0));
    assert_eq!(flexspline_input_add(&mut input, i32::MIN, 7), Done);
    assert_eq!((input.mean_counts, input.half_width_counts), (-Adjustment::MAX_COUNTS, 7));
}
