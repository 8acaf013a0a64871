//! The tick: any settings that are allowed, any samples, torques, missed ticks and modes.

use crate::Choices;
use crate::image::COUNT_RAD;
use crate::tables::{flying, hostile_axis};
use flexspline::{
    Adjustment, Drive, GeneratorAngle, Images, Input, Joint, JointState, Limits, Mode, Output, OutputAngle, Overrun,
    Quality, SettingError, Store, Table,
};

/// Parts of a count in which the correction is kept.
const FINE_RAD: f64 = COUNT_RAD as f64 / 8.0;

/// A joint of any settings, and the limits it has.
pub fn any_joint(drive: Drive, choices: &mut Choices<'_>) -> Result<(Joint, Watch), SettingError> {
    let limits = if choices.below(4) == 0 {
        Limits {
            tick_s: choices.wild().abs(),
            rate_rad_s: choices.wild(),
            acceleration_rad_s2: choices.wild(),
            generator_rate_rad_s: choices.wild(),
            debounce_ticks: choices.any(),
            deadband_rad: choices.wild(),
        }
    } else {
        let decade = |choices: &mut Choices<'_>, least: i32, most: i32| {
            10f32.powi(least + choices.below((most - least) as usize + 1) as i32)
        };
        Limits {
            tick_s: decade(choices, -4, -2),
            rate_rad_s: decade(choices, -5, 0),
            acceleration_rad_s2: decade(choices, -4, 5),
            generator_rate_rad_s: decade(choices, 0, 3).min(100.0),
            debounce_ticks: choices.below(8) as u16,
            deadband_rad: if choices.any() { 1e-6 } else { 0.0 },
        }
    };
    let overrun = match choices.below(4) {
        0 => Overrun::SkipAndCount,
        1 => Overrun::HoldLast,
        2 => Overrun::FadeOut { ticks: choices.any() },
        _ => Overrun::FadeOut { ticks: choices.below(30) as u16 },
    };
    Ok((Joint::new(drive, limits, overrun)?, Watch::new(&limits)))
}

/// Watches the correction from tick to tick.
pub struct Watch {
    rate: f64,
    acceleration: f64,
    /// The last correction and the one before, rad, as far as they are known.
    last: [Option<f64>; 2],
}

impl Watch {
    /// Of a joint with these limits that makes no correction yet.
    pub fn new(limits: &Limits) -> Self {
        let tick = f64::from(limits.tick_s);
        let rate = f64::from(limits.rate_rad_s) * tick;
        Self { rate, acceleration: f64::from(limits.acceleration_rad_s2) * tick * tick, last: [Some(0.0); 2] }
    }

    /// Starts with this correction instead, the speed not known.
    pub fn restart(&mut self, correction_rad: f64) {
        self.last = [Some(correction_rad), None];
    }

    /// Whether a correction with this speed, rad and rad in a tick, can be stopped before it is larger than any table
    /// gives.
    pub fn stops_in_time(&self, correction_rad: f64, speed_rad: f64) -> bool {
        let speed = speed_rad.abs().min(self.rate);
        correction_rad.abs() + speed + speed * speed / (2.0 * self.acceleration) <= f64::from(Table::MAX_ERROR_RAD)
    }

    /// One tick's output.
    pub fn see(&mut self, input: &Input, drive: &Drive, out: &Output) {
        let now = f64::from(out.correction_rad);
        assert!(now.abs() <= 1.005 * f64::from(Table::MAX_ERROR_RAD), "{out:?}");
        assert!(
            out.held_back_rad.is_finite() && out.transmission_error_rad.abs() <= 1.002 * Table::MAX_ERROR_RAD,
            "{out:?}"
        );
        assert!(out.uncertainty_rad >= 0.0 && out.uncertainty_rad.is_finite(), "{out:?}");
        // Single precision of the output, and the parts in which it is kept.
        let rounding = 4.0 * FINE_RAD + 1.2e-7 * f64::from(Table::MAX_ERROR_RAD);
        let [last, before] = self.last;
        if let Some(last) = last {
            let step = (now - last).abs();
            assert!(step <= 1.0001 * self.rate + rounding, "rate {step}, at most {}: {out:?}", self.rate);
            if let Some(before) = before {
                let change = ((now - last) - (last - before)).abs();
                let most = 1.0001 * self.acceleration + 2.0 * rounding;
                assert!(change <= most, "acceleration {change}, at most {most}: {out:?}");
            }
        }
        self.last = [Some(now), last];
        // The command is the target less the correction, and nothing else; where turns wrap it wraps too.
        if input.target.turns().unsigned_abs() < 1 << 24 {
            let expected = drive.nominal_generator(input.target.offset_rad(-out.correction_rad));
            let off = out.command.minus_counts(expected).unsigned_abs() as f64;
            assert!(off <= f64::from(drive.ratio().abs()) * 8.0, "{off} counts: {out:?}");
        }
    }
}

/// A tick's measurements: in motion, or anything.
pub fn any_input(choices: &mut Choices<'_>, generator: &mut GeneratorAngle, torques: &[f32], drive: &Drive) -> Input {
    match choices.below(16) {
        0 => *generator = GeneratorAngle::from_counts(choices.any()),
        1 => *generator = generator.offset_counts(choices.any::<i32>().into()),
        _ => *generator = generator.offset_rad((0.09 * choices.part()) as f32),
    }
    let sample = if choices.below(12) == 0 { None } else { Some(*generator) };
    let target = match choices.below(16) {
        0 => OutputAngle::from_counts(choices.any()),
        1 => OutputAngle::from_counts(if choices.any() { i64::MIN } else { i64::MAX }),
        _ => drive.nominal_output(*generator).offset_rad((1e-3 * choices.part()) as f32),
    };
    let missed_ticks = if choices.below(8) == 0 { choices.any() } else { 0 };
    let adjustment = Adjustment::default();
    Input { generator: sample, target, torque_n_m: hostile_axis(choices, torques), missed_ticks, adjustment }
}

/// One joint, some hundred ticks.
pub fn run(data: &[u8]) {
    let mut choices = Choices::new(data);
    let image = flying(&mut choices);
    let table = Table::check(image).expect("a base");
    let torques: Vec<f32> = table.torque_nodes_n_m().collect();
    let drive = *table.drive();
    let Ok((joint, mut watch)) = any_joint(drive, &mut choices) else { return };
    let twin = image.clone();
    let images = Images::new(image, &twin);
    let (mut store, mut state) = (Store::new(), JointState::new());
    if choices.below(8) > 0 {
        store.activate(&images, &drive, 20.0).expect("a base");
    }
    let mut generator = GeneratorAngle::ZERO;
    let mut last = None;
    for _ in 0..600 {
        if choices.is_empty() {
            break;
        }
        match choices.below(24) {
            0 => drop(state.request([Mode::Off, Mode::Tracking, Mode::Hold, Mode::Safe][choices.below(4)])),
            1 => state = JointState::restore(&state.save(&joint, &store), &joint, &store).expect("just saved"),
            2 => drop(store.set_temperature(&images, choices.wild())),
            3 => store.check_images(&images, choices.below(300)),
            4 | 5 => drop(state.request(Mode::Tracking)),
            _ => {}
        }
        let input = any_input(&mut choices, &mut generator, &torques, &drive);
        let out = joint.tick(&images, &mut store, &mut state, &input);
        watch.see(&input, &drive, &out);
        last = Some(input);
    }
    // Left alone, the correction comes to what is wanted and stays there.
    let Some(input) = last.filter(|_| watch.acceleration >= 0.05 * watch.rate && watch.rate > 1e-4) else { return };
    let _ = state.request(Mode::Off);
    let _ = state.request(Mode::Tracking);
    let calm = Input { generator: Some(generator), torque_n_m: torques[0], missed_ticks: 0, ..input };
    let mut still = 0;
    for _ in 0..140_000 {
        let now = joint.tick(&images, &mut store, &mut state, &calm);
        watch.see(&calm, &drive, &now);
        let settled = f64::from(now.held_back_rad.abs()) <= f64::from(COUNT_RAD) || now.quality == Quality::Disabled;
        // After a fade of the longest kind and a settling it stays.
        still = if settled { still + 1 } else { 0 };
        if still > 300 && state.missed_ticks() == 0 || still > 2000 {
            return;
        }
    }
    panic!("still held back after all these ticks, or moving to and fro");
}
