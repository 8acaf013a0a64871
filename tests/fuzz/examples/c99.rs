//! Answers of the core for tables and hostile images, for `tests/c99/driver.c` to find again with the reader in C.
//!
//! ```sh
//! c99 OUT TICKS IMAGES TABLE.fxt...
//! ```
//! The number of ticks in all, spread over the tables named and those of [`tables::BASES`]; then the number of hostile
//! images, and some ticks with each that is accepted. Little-endian records, told in [`Vectors`].

use flexspline::{
    Adjustment, Approach, Command, Direction, Encoder, EncoderSettings, EncoderState, EncoderWrap, Field, Flags,
    GeneratorAngle, ImageError, Images, Input, Joint, JointState, Limits, Mode, OutputAngle, Overrun, PlayState,
    Prediction, Store, Table,
};
use flexspline_fuzz::{Choices, image, tables};
use std::io::{BufWriter, Write};

/// Records: 1, an image: length, bytes, verdict and what is known of the table. 2, a call: kind, two angles, torque,
/// temperature, what it gives, and the play after it. 3, a saved play: bytes, and whether they are restored. 4, the
/// limits of a joint, which of them is refused, the acceleration of its generator if there is one, and whether it is
/// taken. 5, a tick: what is asked of the mode and whether it may be, the
/// input, what the tick gives. 6, settings of an encoder, and whether they can be. 8, what a joint makes of a
/// reading of it, and whether it takes it. 7, a call of it: kind, reading or
/// angle, whether it is taken, the angle or reading. 0, the end.
struct Vectors<W> {
    out: W,
    calls: u64,
    ticks: u64,
    glitches: u64,
    encoders_lost: u64,
    accepted: u64,
    refused: std::collections::BTreeMap<u8, u64>,
}

/// One count, rad.
const COUNT_RAD: f64 = std::f64::consts::TAU / 4_294_967_296.0;

/// Numbers that look random, the same in every run.
struct Mixed(u64);

impl Mixed {
    fn number(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// From 0 to 1.
    fn unit(&mut self) -> f64 {
        (self.number() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count.div_ceil(8)).flat_map(|_| self.number().to_le_bytes()).take(count).collect()
    }
}

/// Numbers of `fxt_field`.
fn field_code(field: Field) -> u8 {
    match field {
        Field::ToolVersion => 1,
        Field::MeshLevel => 2,
        Field::TorqueNodes => 3,
        Field::TemperatureNodes => 4,
        Field::RippleNodes => 5,
        Field::GeneratorCurve => 6,
        Field::MaterialCurve => 7,
        Field::OutputCurve => 8,
        Field::Mean => 9,
        Field::HalfWidth => 10,
        Field::MeanSlope => 11,
        Field::MeanRipple => 12,
        Field::SolverResidual => 13,
        Field::ProjectionWorst => 14,
        Field::ProjectionRms => 15,
        Field::TorqueRange => 16,
        Field::TemperatureRange => 17,
        Field::ErrorLimit => 18,
        // No image error names it: both ripples of a record are one.
        Field::HalfWidthRipple => 255,
    }
}

/// `fxt_verdict` of a refusal: reason, field, index, temperature.
fn verdict(error: ImageError) -> (u8, u8, u32, u32) {
    let of = |reason, index: usize| (reason, 0, index as u32, 0);
    match error {
        ImageError::TooShort { .. } => of(1, 0),
        ImageError::Magic => of(2, 0),
        ImageError::Version { found, .. } => of(3, found.into()),
        ImageError::ByteOrder { found } => of(4, found.into()),
        ImageError::Length { stated, .. } => of(5, stated),
        ImageError::Crc { computed, .. } => (6, 0, computed, 0),
        ImageError::PageCrc { page } => of(7, page),
        ImageError::Reserved { offset } => of(8, offset),
        ImageError::Text { field } => (9, field_code(field), 0, 0),
        ImageError::GeneratorKind { found } => of(10, found.into()),
        ImageError::FixedMember { found } => of(11, found.into()),
        ImageError::Teeth(teeth) => of(12, teeth.flexspline_teeth.into()),
        ImageError::Count { field, found, .. } => (13, field_code(field), found as u32, 0),
        ImageError::Size { needed, .. } => of(14, needed),
        ImageError::NotFinite { field, index } => (15, field_code(field), index as u32, 0),
        ImageError::NotIncreasing { field, index } => (16, field_code(field), index as u32, 0),
        ImageError::NotClosed { field, index } => (17, field_code(field), index as u32, 0),
        ImageError::Derived { offset } => of(18, offset),
        ImageError::OutOfRange { field, .. } => (19, field_code(field), 0, 0),
        ImageError::NegativeHalfWidth { temperature, torque, .. } => (20, 0, torque as u32, temperature as u32),
        ImageError::ErrorBound { .. } => of(21, 0),
        ImageError::Slope { .. } => of(22, 0),
        ImageError::Falls { temperature, torque, .. } => (23, 0, torque as u32, temperature as u32),
        ImageError::Steep { temperature, torque, .. } => (24, 0, torque as u32, temperature as u32),
        ImageError::Inverse { .. } => of(25, 0),
    }
}

impl<W: Write> Vectors<W> {
    fn image(&mut self, image: &[u8]) -> std::io::Result<()> {
        self.out.write_all(&[1])?;
        self.out.write_all(&(image.len() as u32).to_le_bytes())?;
        self.out.write_all(image)?;
        let (reason, field, index, temperature) = Table::check(image).map_or_else(verdict, |_| (0, 0, 0, 0));
        self.out.write_all(&[reason, field])?;
        self.words(&[index, temperature])?;
        *self.refused.entry(reason).or_default() += 1;
        let Ok(table) = Table::check(image) else { return Ok(()) };
        self.accepted += 1;
        let bounds = table.bounds();
        let [torque_least, torque_most] = table.torque_range_n_m();
        let [least, most] = table.temperature_range_c();
        self.out.write_all(&table.id().0)?;
        self.numbers(&[
            bounds.error_rad,
            bounds.periodic_rad,
            bounds.slope,
            bounds.curve_slope,
            bounds.ripple_cells,
            bounds.rounding_rad,
            table.inverse_error_bound_rad(),
            table.drive().ratio(),
            torque_least,
            torque_most,
            least,
            most,
        ])?;
        self.words(&[table.inverse_iterations().into(), table.page_count() as u32])
    }

    fn words(&mut self, words: &[u32]) -> std::io::Result<()> {
        words.iter().try_for_each(|word| self.out.write_all(&word.to_le_bytes()))
    }

    fn numbers(&mut self, numbers: &[f32]) -> std::io::Result<()> {
        numbers.iter().try_for_each(|number| self.words(&[number.to_bits()]))
    }

    fn angle(&mut self, counts: i64) -> std::io::Result<()> {
        self.out.write_all(&counts.to_le_bytes())
    }

    fn prediction(&mut self, found: &Prediction) -> std::io::Result<()> {
        self.angle(found.output.counts())?;
        self.angle(found.nominal.counts())?;
        self.numbers(&[found.transmission_error_rad, found.uncertainty_rad])?;
        self.words(&[found.quality as u32])
    }

    fn command(&mut self, found: &Command) -> std::io::Result<()> {
        self.angle(found.generator.counts())?;
        self.numbers(&[found.predicted_error_rad, found.uncertainty_rad])?;
        self.words(&[found.quality as u32])
    }

    /// A call of each kind of `tests/c99/driver.c`.
    fn call(&mut self, table: &Table<'_>, play: &mut PlayState, kind: u8, asked: &Asked) -> std::io::Result<()> {
        let Asked { generator, target, torque, temperature } = *asked;
        self.out.write_all(&[2, kind])?;
        self.angle(generator.counts())?;
        self.angle(target.counts())?;
        self.numbers(&[torque, temperature])?;
        self.calls += 1;
        match kind {
            0 => self.prediction(&table.forward(play, generator, torque, temperature))?,
            1 => self.command(&table.inverse(target, torque, temperature, Approach::Moving(Direction::Forward)))?,
            2 => self.command(&table.inverse(target, torque, temperature, Approach::Moving(Direction::Backward)))?,
            3 => self.command(&table.inverse(target, torque, temperature, Approach::From(play)))?,
            4 => {
                let (prediction, command) = table.step(play, generator, target, torque, temperature);
                self.prediction(&prediction)?;
                self.command(&command)?;
            }
            5 | 6 => {
                let direction = if kind == 5 { Direction::Forward } else { Direction::Backward };
                let error = table.steady_error_rad(generator, torque, temperature, direction);
                self.words(&[error.is_some() as u32, error.map_or(0, f32::to_bits)])?;
            }
            7 => *play = PlayState::unknown(),
            8 => *play = PlayState::after_motion(Direction::Forward),
            _ => *play = PlayState::after_motion(Direction::Backward),
        }
        self.numbers(&[play.offset_rad(), play.uncertainty_rad()])?;
        self.out.write_all(&play.save())
    }

    /// A saved play, damaged or not.
    fn saved(&mut self, play: &PlayState, mixed: &mut Mixed) -> std::io::Result<()> {
        let mut bytes = play.save();
        let number = mixed.number();
        if !number.is_multiple_of(4) {
            bytes[number as usize / 4 % 28] ^= 1 << (number >> 40 & 7);
        }
        self.out.write_all(&[3])?;
        self.out.write_all(&bytes)?;
        self.out.write_all(&[PlayState::restore(&bytes).is_some() as u8])
    }

    /// Mixed motion: reversals, standing, leaps, torques at, between and beyond nodes, what is not finite; all kinds of
    /// calls.
    fn ticks(&mut self, table: &Table<'_>, ticks: usize, mixed: &mut Mixed) -> std::io::Result<()> {
        let torques: Vec<f32> = table.torque_nodes_n_m().collect();
        let temperatures: Vec<f32> = table.temperature_nodes_c().collect();
        let (mut play, mut generator, mut speed, mut output) = (PlayState::unknown(), 0i64, 0i64, 0i64);
        let (mut torque, mut temperature) = (0.0, 20.0);
        for _ in 0..ticks {
            let number = mixed.number();
            if number.is_multiple_of(32) {
                let bytes = mixed.bytes(64);
                let mut choices = Choices::new(&bytes);
                torque = tables::hostile_axis(&mut choices, &torques);
                temperature = tables::hostile_axis(&mut choices, &temperatures);
                speed = (mixed.number() as i64) >> (36 + mixed.number() % 28);
            }
            if number.is_multiple_of(4099) {
                generator = mixed.number() as i64;
            }
            generator = generator.wrapping_add(speed);
            let kind = match number >> 32 & 31 {
                0..8 => 0,
                8..10 => 1,
                10..12 => 2,
                12..15 => 3,
                15..29 => 4,
                29 => 5,
                30 => 6,
                _ if number >> 40 & 31 == 0 => 7 + (number >> 50) as u8 % 3,
                _ => 4,
            };
            let ahead = (mixed.number() as i64) >> (32 + mixed.number() % 32);
            let mut target = if number >> 45 & 7 == 0 { output } else { output.wrapping_add(ahead) };
            // Any angle, also those whose command wraps.
            if number.is_multiple_of(1021) {
                target = mixed.number() as i64;
            }
            let asked = Asked {
                generator: GeneratorAngle::from_counts(generator),
                target: OutputAngle::from_counts(target),
                torque,
                temperature,
            };
            self.call(table, &mut play, kind, &asked)?;
            output = play.output().map_or(0, OutputAngle::counts);
            if number.is_multiple_of(64) {
                self.saved(&play, mixed)?;
            }
        }
        Ok(())
    }
    /// Ticks of joints with this table, at temperatures at nodes, beside, between and beyond them.
    fn joints(&mut self, image: &[u8], runs: usize, ticks: usize, mixed: &mut Mixed) -> std::io::Result<()> {
        let table = Table::check(image).expect("accepted");
        let nodes: Vec<f32> = table.temperature_nodes_c().collect();
        let second = image.to_vec();
        let images = Images::new(image, &second);
        for run in 0..runs {
            let [least, most] = table.temperature_range_c();
            let bytes = mixed.bytes(16);
            let axis = Some(tables::hostile_axis(&mut Choices::new(&bytes), &nodes)).filter(|found| found.is_finite());
            let node = nodes[mixed.number() as usize % nodes.len()];
            let temperature = match run % 4 {
                0 => axis.unwrap_or(nodes[0] - 1.0),
                1 => node,
                2 => f32::from_bits(node.to_bits() ^ 1),
                _ => least + (most - least) * mixed.unit() as f32,
            };
            let mut store = Store::new();
            // A table may be too large for a store.
            if store.activate(&images, table.drive(), temperature).is_err() {
                return Ok(());
            }
            let Some(joint) = self.joint(&table, mixed)? else { continue };
            self.motion(&table, &joint, (&mut store, &images, temperature), ticks, mixed)?;
        }
        Ok(())
    }

    /// A joint with limits that can be, or with one that cannot.
    fn joint(&mut self, table: &Table<'_>, mixed: &mut Mixed) -> std::io::Result<Option<Joint>> {
        let mut decade = |least: f64, most: f64| 10f64.powf(least + (most - least) * mixed.unit()) as f32;
        let mut limits = Limits {
            tick_s: decade(-4.0, -2.0),
            rate_rad_s: decade(-4.0, 0.6),
            acceleration_rad_s2: decade(-3.0, 4.0),
            generator_rate_rad_s: decade(0.0, 2.4),
            debounce_ticks: 0,
            deadband_rad: decade(-8.0, -4.0),
        };
        let number = mixed.number();
        limits.debounce_ticks = if number & 7 == 0 { (number >> 8) as u16 } else { (number >> 8 & 15) as u16 };
        limits.deadband_rad = if number & 0x30 == 0 { 0.0 } else { limits.deadband_rad };
        if number & 0xc0 == 0 {
            let bad =
                [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-40, 1e-9, 1e12, -0.0, f32::from_bits((number >> 16) as u32)];
            let found = bad[(number >> 50) as usize % bad.len()];
            match number >> 56 & 7 {
                0 => limits.tick_s = found,
                1 => limits.rate_rad_s = found,
                2 => limits.acceleration_rad_s2 = found,
                3 => limits.generator_rate_rad_s = found,
                _ => limits.deadband_rad = found,
            }
        }
        let ticks = if number >> 33 & 7 == 0 { (number >> 36) as u16 } else { (number >> 36 & 31) as u16 };
        let code = number >> 30 & 3;
        let overrun = [Overrun::SkipAndCount, Overrun::HoldLast, Overrun::FadeOut { ticks }];
        let overrun = overrun[code.min(2) as usize];
        let made = Joint::new(*table.drive(), limits, overrun);
        let names = ["tick_s", "rate_rad_s", "acceleration_rad_s2", "generator_rate_rad_s", "deadband_rad"];
        let refused = made.as_ref().err().map(|error| names.iter().position(|&name| name == error.name));
        self.out.write_all(&[4])?;
        let Limits { tick_s, rate_rad_s, acceleration_rad_s2, generator_rate_rad_s, deadband_rad, debounce_ticks } =
            limits;
        self.numbers(&[tick_s, rate_rad_s, acceleration_rad_s2, generator_rate_rad_s, deadband_rad])?;
        self.words(&[u32::from(debounce_ticks) | u32::from(ticks) << 16, code.min(2) as u32])?;
        self.out.write_all(&[refused.map_or(0, |at| at.expect("a setting of these") as u8 + 1)])?;
        // Without one, with one of a generator, and with any number.
        let number = mixed.number();
        let given = match number & 3 {
            0 => None,
            1 => Some(f32::from_bits((number >> 8) as u32)),
            _ => Some(10f64.powf(1.0 + 6.0 * mixed.unit()) as f32),
        };
        let limited =
            made.as_ref().ok().zip(given).and_then(|(joint, most)| joint.with_generator_acceleration(most).ok());
        self.out.write_all(&[given.is_some() as u8])?;
        self.numbers(&[given.unwrap_or_default()])?;
        self.out.write_all(&[limited.is_some() as u8])?;
        Ok(limited.or(made.ok()))
    }

    /// A joint that follows targets, with noise, glitches, samples and ticks that are missing, modes, and inputs that
    /// are no number.
    fn motion(
        &mut self,
        table: &Table<'_>,
        joint: &Joint,
        (store, images, temperature): (&mut Store, &Images<'_>, f32),
        ticks: usize,
        mixed: &mut Mixed,
    ) -> std::io::Result<()> {
        let torques: Vec<f32> = table.torque_nodes_n_m().collect();
        let modes = [Mode::Off, Mode::Tracking, Mode::Hold, Mode::Safe];
        let mut state = JointState::new();
        let (mut torque, mut target, mut speed, mut late) = (0.0, mixed.number() as i64 >> 20, 0i64, false);
        let mut generator = table.drive().nominal_generator(OutputAngle::from_counts(target)).counts();
        let encoder = self.settings(mixed)?;
        let mut at: Option<EncoderState> = None;
        for tick in 0..ticks {
            let number = mixed.number();
            if tick == 0 || number.is_multiple_of(64) {
                let bytes = mixed.bytes(64);
                torque = tables::hostile_axis(&mut Choices::new(&bytes), &torques);
                speed = (mixed.number() as i64) >> (40 + mixed.number() % 24);
                // For a while every tick comes late.
                late = number >> 7 & 7 == 0;
            }
            target = target.wrapping_add(speed);
            if number.is_multiple_of(2053) {
                target = mixed.number() as i64;
            }
            // Tracking at first; later whatever may be asked for.
            let asked = match number >> 32 & 127 {
                _ if tick == 0 => 1,
                code @ 0..4 => code as usize,
                4..8 => 1,
                8 if number >> 40 & 7 == 0 => 4,
                _ => 5,
            };
            let taken = match asked {
                0..4 => state.request(modes[asked]).is_ok(),
                4 => {
                    state.forget_side();
                    true
                }
                _ => true,
            };
            let noise = (mixed.number() as i64) >> (64 - (number >> 42 & 31));
            let glitch = if number >> 48 & 63 == 0 { (mixed.number() as i64) >> 20 } else { 0 };
            let sample = generator.wrapping_add(noise).wrapping_add(glitch);
            let has_generator = number >> 54 & 15 != 0;
            let some = if number >> 58 == 0 { (mixed.number() & 3) as u16 } else { 0 };
            let missed_ticks = if late { some.max(1) } else { some };
            let input = Input {
                generator: has_generator.then_some(GeneratorAngle::from_counts(sample)),
                target: OutputAngle::from_counts(target),
                torque_n_m: torque,
                missed_ticks,
                adjustment: Adjustment::default(),
            };
            let found = joint.tick(images, store, &mut state, &input);
            self.glitches += u64::from(found.flags.contains(Flags::GLITCH));
            let reported = [
                Flags::SAMPLE_LOST,
                Flags::GLITCH,
                Flags::OVERRUN,
                Flags::HELD_BACK,
                Flags::NOT_CORRECTED,
                Flags::SAFE,
            ];
            let known = reported.iter().fold(0, |bits, flag| bits | flag.bits());
            assert_eq!(found.flags.bits() & !known, 0, "{:?}", found.flags);
            self.out.write_all(&[5, asked as u8, taken as u8, has_generator as u8])?;
            self.angle(sample)?;
            self.angle(target)?;
            self.numbers(&[torque, temperature])?;
            self.words(&[missed_ticks.into()])?;
            self.angle(found.command.counts())?;
            self.angle(found.output.counts())?;
            self.numbers(&[
                found.transmission_error_rad,
                found.uncertainty_rad,
                found.correction_rad,
                found.held_back_rad,
            ])?;
            self.words(&[found.quality as u32, found.flags.bits().into(), state.missed_ticks()])?;
            self.ticks += 1;
            // Where it was told to go, as long as that is not a leap.
            generator = found.command.counts();
            let Some(encoder) = encoder.as_ref() else { continue };
            let number = mixed.number();
            let wrong = if number & 3 == 0 { 1 << (number >> 8 & 31) } else { 0 };
            let reading = encoder.reading(generator) ^ wrong;
            let mut now = at.or_else(|| encoder.start(reading, 0));
            let read = now.as_mut().and_then(|now| joint.read(&state, encoder, now, reading));
            // Without a start a reading that is not taken begins nothing.
            at = if read.is_some() || at.is_some() { now } else { None };
            let is_lost = at.is_some_and(|at| at.is_lost());
            self.out.write_all(&[8])?;
            self.angle(reading as i64)?;
            self.out.write_all(&[read.is_some() as u8, is_lost as u8])?;
            self.angle(read.map_or(0, GeneratorAngle::counts))?;
            // Now and then one that is lost is started anew.
            if is_lost && number >> 16 & 3 == 0 {
                self.encoders_lost += 1;
                let started = encoder.start(reading, generator);
                at = started.or(at);
                self.out.write_all(&[7, 0])?;
                self.angle(reading as i64)?;
                self.out.write_all(&[started.is_some() as u8])?;
                self.angle(generator)?;
            }
        }
        Ok(())
    }

    /// Any settings of an encoder, and the encoder if they can be.
    fn settings(&mut self, mixed: &mut Mixed) -> std::io::Result<Option<Encoder>> {
        let number = mixed.number();
        let bits = match number & 3 {
            0 => 0,
            1 => (number >> 8 & 127) as u8,
            _ => 16 + (number >> 8 & 15) as u8,
        };
        let per_turn = (mixed.number() as u32) >> (number >> 16 & 31);
        let zero_counts = (mixed.number() as i64) >> (number >> 24 & 63);
        let reversed = number >> 40 & 1 != 0;
        let wrap = if bits == 0 { EncoderWrap::Turn } else { EncoderWrap::Bits(bits) };
        let made = Encoder::new(EncoderSettings { counts_per_turn: per_turn, wrap, reversed, zero_counts });
        self.out.write_all(&[6])?;
        self.words(&[per_turn])?;
        self.out.write_all(&[bits, reversed as u8])?;
        self.angle(zero_counts)?;
        self.out.write_all(&[made.is_ok() as u8])?;
        Ok(made.ok())
    }

    /// An encoder of any settings, and calls of it.
    fn encoder(&mut self, calls: usize, mixed: &mut Mixed) -> std::io::Result<()> {
        let Some(encoder) = self.settings(mixed)? else { return Ok(()) };
        let mut state: Option<EncoderState> = None;
        let (mut at, mut speed) = ((mixed.number() as i64) >> 8, 0i64);
        for _ in 0..calls {
            let number = mixed.number();
            if number & 15 == 0 {
                speed = (mixed.number() as i64) >> (mixed.number() & 63);
            }
            at = at.wrapping_add(speed);
            let reading = match number >> 4 & 7 {
                0 => mixed.number() >> (mixed.number() & 63),
                _ => encoder.reading(at),
            };
            let kind = if number >> 8 & 63 == 0 { 0 } else { 1 + (number >> 16 & 3 == 0) as u8 };
            let (asked, taken, told) = match kind {
                0 => {
                    let started = encoder.start(reading, at);
                    state = started.or(state);
                    (reading, started.is_some(), at)
                }
                1 => {
                    let started = state.or_else(|| encoder.start(reading, 0));
                    let mut now = started;
                    let taken = match &mut now {
                        Some(now) if state.is_some() => encoder.read(now, reading),
                        Some(_) => true,
                        None => false,
                    };
                    state = now.or(state);
                    (reading, taken, state.filter(|_| taken).map_or(0, |state| encoder.angle(&state).unwrap_or(0)))
                }
                _ => (at as u64, true, encoder.reading(at) as i64),
            };
            self.out.write_all(&[7, kind])?;
            self.angle(asked as i64)?;
            self.out.write_all(&[taken as u8])?;
            self.angle(told)?;
        }
        Ok(())
    }
}

/// A sound table whose numbers of one kind are moved by `part` of a large change, under right checksums: a step of D at
/// a torque node, H, the slope of D at a node, the ripple unit, or a curve.
fn moved(base: &[u8], [kind, split, sign]: [usize; 3], part: f64) -> Vec<u8> {
    let mut image = base.to_vec();
    let (torques, temperatures) = (usize::from(image[110]), usize::from(image[111]));
    let nodes = 4 * usize::from(u16::from_le_bytes([image[164], image[165]]));
    let part = if sign == 0 { part } else { -part };
    let change = |place: &mut [u8], to: &dyn Fn(f64) -> f64| {
        let before = f32::from_le_bytes(place.try_into().expect("four bytes"));
        let bits = (to(before.into()) as f32).to_bits() & !1 | before.to_bits() & 1;
        place.copy_from_slice(&bits.to_le_bytes());
    };
    for index in 0..torques * temperatures {
        let node = &mut image[nodes + 12 * index..][..12];
        let side = if index % torques < split { -1.0 } else { 1.0 };
        match kind {
            0 => change(&mut node[..4], &|mean| mean + side * part * 9e-3 / COUNT_RAD),
            1 => change(&mut node[8..], &|half| half * (1.0 + 30.0 * part).max(0.0)),
            2 if index % torques == split => change(&mut node[4..8], &|slope| slope + part * 0.3 / COUNT_RAD),
            _ => {}
        }
    }
    let word = |image: &[u8], at: usize| u32::from_le_bytes(image[at..at + 4].try_into().expect("four bytes"));
    if kind == 3 {
        let unit = f64::from(word(&image, 116)) * 10f64.powf(3.0 * part);
        image[116..120].copy_from_slice(&(unit as u32).to_le_bytes());
    }
    if kind == 4 {
        for at in (4 * 136..nodes).step_by(4) {
            let value = (f64::from(word(&image, at) as i32) * 10f64.powf(3.0 * part)) as i32;
            image[at..at + 4].copy_from_slice(&value.to_le_bytes());
        }
    }
    flexspline::testing::reseal(&mut image);
    image
}

/// A sound table whose last interval of torque is a jump, of no height.
fn jump_at_the_end(base: &[u8]) -> Vec<u8> {
    let mut image = base.to_vec();
    let (torques, temperatures) = (usize::from(image[110]), usize::from(image[111]));
    let nodes = 4 * usize::from(u16::from_le_bytes([image[164], image[165]]));
    let number = |image: &[u8], at: usize| f32::from_le_bytes(image[at..at + 4].try_into().expect("four bytes"));
    let last = 4 * (64 + torques - 1);
    let [before, wide] = [number(&image, last - 4), number(&image, last - 4) - number(&image, last - 8)];
    let end = (before + wide / 16.0).to_le_bytes();
    // The last node, and the end of the range.
    [last, 140].into_iter().for_each(|at| image[at..at + 4].copy_from_slice(&end));
    for temperature in 1..=temperatures {
        let last = nodes + 12 * (temperature * torques - 1);
        image.copy_within(last - 12..last, last);
        image[last - 4] |= 1;
        image[last + 8] &= !1;
    }
    flexspline::testing::reseal(&mut image);
    image
}

/// The two images next to each other of which one is accepted and one is not; or the end of the change, if it is
/// accepted too.
fn at_the_limit(choices: &mut Choices<'_>) -> [Vec<u8>; 2] {
    let base = &tables::BASES[[1, 2, 3, 5][choices.below(4)]];
    // As often as not at the jump at −1.5 N·m.
    let split = if choices.any() { 4.min(usize::from(base[110]) - 1) } else { choices.below(base[110].into()) };
    let of = [choices.below(5), split, choices.below(2)];
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if Table::check(&moved(base, of, middle)).is_ok() { low = middle } else { high = middle }
    }
    [low, high].map(|part| moved(base, of, part))
}

struct Asked {
    generator: GeneratorAngle,
    target: OutputAngle,
    torque: f32,
    temperature: f32,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [out, ticks, images, named @ ..] = &arguments[..] else {
        return Err("c99 OUT TICKS IMAGES TABLE.fxt...".into());
    };
    let (ticks, images): (usize, usize) = (ticks.parse()?, images.parse()?);
    let out = BufWriter::new(std::fs::File::create(out)?);
    let refused = Default::default();
    let mut vectors = Vectors { out, calls: 0, ticks: 0, glitches: 0, encoders_lost: 0, accepted: 0, refused };
    let mut mixed = Mixed(1);
    let mut sound: Vec<Vec<u8>> = named.iter().map(std::fs::read).collect::<Result<_, _>>()?;
    sound.extend(tables::BASES.iter().cloned());
    sound.push(jump_at_the_end(&tables::BASES[2]));
    for image in &sound {
        vectors.image(image)?;
        let table = Table::check(image).map_err(|error| error.to_string())?;
        vectors.ticks(&table, ticks.div_ceil(sound.len()), &mut mixed)?;
        vectors.joints(image, 40, ticks.div_ceil(40 * sound.len()), &mut mixed)?;
    }
    // A flexspline without teeth.
    let mut toothless = tables::BASES[2].clone();
    toothless[106..108].fill(0);
    flexspline::testing::reseal(&mut toothless);
    vectors.image(&toothless)?;
    // A wind-up that no number holds between its nodes.
    vectors.image(&moved(&tables::BASES[2], [2, 1, 0], 1e30))?;
    for _ in 0..ticks / 40 {
        vectors.encoder(40, &mut mixed)?;
    }
    for number in 0..images {
        let bytes = mixed.bytes(2048);
        let mut choices = Choices::new(&bytes);
        // Every third of a table that was named, some at a limit, the others as the fuzz target of images makes them.
        let hostile = if number.is_multiple_of(3) && !named.is_empty() {
            let mut image = sound[choices.below(named.len())].clone();
            if number.is_multiple_of(2) {
                image::change_bytes(&mut image, &mut choices);
            } else {
                image::change_numbers(&mut image, &mut choices);
            }
            vec![image]
        } else if number.is_multiple_of(31) {
            at_the_limit(&mut choices).to_vec()
        } else {
            image::hostile(&mut choices).into_iter().collect()
        };
        for image in hostile {
            vectors.image(&image)?;
            if let Ok(table) = Table::check(&image) {
                vectors.ticks(&table, 16, &mut mixed)?;
                vectors.joints(&image, 1, 16, &mut mixed)?;
            }
        }
    }
    vectors.out.write_all(&[0])?;
    vectors.out.flush()?;
    let Vectors { calls, ticks, glitches, encoders_lost, accepted, refused, .. } = vectors;
    println!("{calls} calls, {ticks} ticks of joints, {glitches} glitches, {encoders_lost} encoders lost");
    println!("{accepted} images accepted, refused by reason: {refused:?}");
    Ok(())
}
