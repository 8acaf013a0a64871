//! What the core says of tables and of hostile images, for `tests/c99/driver.c` to find again with the reader in C.
//!
//! ```sh
//! c99 OUT TICKS IMAGES TABLE.fxt...
//! ```
//! So many ticks in all, spread over the tables named and those of [`tables::BASES`]; then so many hostile images, and
//! some ticks with each that is accepted. Little-endian records, told in [`Vectors`].

use flexspline::{
    Approach, Command, Direction, Field, GeneratorAngle, ImageError, OutputAngle, PlayState, Prediction, Table,
};
use flexspline_fuzz::{Choices, image, tables};
use std::io::{BufWriter, Write};

/// Records: 1, an image: length, bytes, verdict and what is known of the table. 2, a call: kind, two angles, torque,
/// temperature, what it gives, and the play after it. 3, a saved play: bytes, and whether they are restored. 0, the
/// end.
struct Vectors<W> {
    out: W,
    calls: u64,
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
    flexspline::reseal(&mut image);
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
    let mut vectors = Vectors { out, calls: 0, accepted: 0, refused: Default::default() };
    let mut mixed = Mixed(1);
    let mut sound: Vec<Vec<u8>> = named.iter().map(std::fs::read).collect::<Result<_, _>>()?;
    sound.extend(tables::BASES.iter().cloned());
    for image in &sound {
        vectors.image(image)?;
        let table = Table::check(image).map_err(|error| error.to_string())?;
        vectors.ticks(&table, ticks.div_ceil(sound.len()), &mut mixed)?;
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
            }
        }
    }
    vectors.out.write_all(&[0])?;
    vectors.out.flush()?;
    println!("{} calls, {} images accepted, refused by reason: {:?}", vectors.calls, vectors.accepted, vectors.refused);
    Ok(())
}
