//! Images: any bytes, and wrong numbers under right checksums.

use crate::Choices;
use crate::tables::{BASES, Numbers, hostile_axis};
use flexspline::{Approach, Direction, GeneratorAngle, OutputAngle, PlayState, Quality, Table};
use std::f32::consts::TAU;

/// One count, rad.
pub const COUNT_RAD: f32 = TAU / 4_294_967_296.0;

/// One image. The first byte says where it comes from.
pub fn run(data: &[u8]) {
    let mut choices = Choices::new(data);
    let Some(image) = hostile(&mut choices) else { return };
    if let Ok(table) = Table::check(&image) {
        keeps_its_promises(&table, &mut choices);
    }
}

/// An image: any bytes, a sound one damaged on the way, one with wrong numbers under right checksums, or one of any
/// numbers.
pub fn hostile(choices: &mut Choices<'_>) -> Option<Vec<u8>> {
    match choices.below(4) {
        0 => Some(choices.bytes(65_535).to_vec()),
        1 => {
            let mut image = BASES[choices.below(BASES.len())].clone();
            change_bytes(&mut image, choices);
            Some(image)
        }
        2 => {
            let mut image = BASES[choices.below(BASES.len())].clone();
            change_numbers(&mut image, choices);
            Some(image)
        }
        _ => {
            let mut image = Numbers::any(choices)?.image().ok()?;
            if choices.any() {
                change_numbers(&mut image, choices);
            }
            Some(image)
        }
    }
}

/// Damage on the way: checksums stay as they were.
pub fn change_bytes(image: &mut Vec<u8>, choices: &mut Choices<'_>) {
    for _ in 0..=choices.below(4) {
        let at = choices.below(image.len().max(1));
        match choices.below(4) {
            0 => image.truncate(at),
            1 => image.insert(at.min(image.len()), choices.any()),
            2 => image.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 1 << choices.below(8)),
            _ => image.iter_mut().skip(at).take(4).for_each(|byte| *byte = choices.any()),
        }
    }
}

fn word(image: &[u8], at: usize) -> u32 {
    image.get(4 * at..).and_then(|rest| rest.first_chunk()).map_or(0, |bytes| u32::from_le_bytes(*bytes))
}

fn put(image: &mut [u8], at: usize, value: u32) {
    if let Some(place) = image.get_mut(4 * at..).and_then(|rest| rest.first_chunk_mut::<4>()) {
        *place = value.to_le_bytes();
    }
}

/// Wrong numbers, then the checksums and whatever follows from the numbers made right: what is left are the checks of
/// meaning.
pub fn change_numbers(image: &mut [u8], choices: &mut Choices<'_>) {
    for _ in 0..=choices.below(12) {
        let low = |at: usize, image: &[u8]| word(image, at) as usize & 0xffff;
        let high = |at: usize, image: &[u8]| word(image, at) as usize >> 16;
        // Where the header says that nodes and records are, their steps, and the counts.
        let (nodes, records, record) = (low(41, image), low(42, image), low(43, image));
        let (torques, temperatures) = (usize::from(image[110]).max(1), usize::from(image[111]).max(1));
        match choices.below(9) {
            // A word of the header that a step reads, or of an axis.
            0 => put(image, 26 + choices.below(110), choices.any()),
            1 => put(image, 26 + choices.below(110), choices.wild().to_bits()),
            2 => {
                let at = 26 + choices.below(110);
                put(image, at, word(image, at) ^ 1 << choices.below(32));
            }
            // D, its slope or H of a node; the mark in the last bit of H stays.
            3 | 4 => {
                let at = nodes + choices.below((torques.max(2) * temperatures * 3).min(65_535));
                let value = choices.wild() * [1.0, 1e3, 1e6][choices.below(3)];
                let bits = value.to_bits();
                put(image, at, if (at - nodes) % 3 == 2 { bits & !1 | word(image, at) & 1 } else { bits });
            }
            // A ripple coefficient, closed at the wrap.
            5 if record > 3 => {
                let first = records + record * choices.below((torques * temperatures).min(65_535));
                let (node, value) = (choices.below(record - 3), choices.any());
                for position in 0..record {
                    if (position + record - 4) % (record - 3) == node {
                        put(image, first + position, value);
                    }
                }
            }
            // A coefficient of a curve, likewise.
            6 => {
                let curve = 44 + choices.below(3);
                let (first, count) = (low(curve, image), high(curve, image));
                if count > 0 {
                    let (node, value) =
                        (choices.below(count), (choices.part() * 10f64.powi(choices.below(9) as i32)) as i32);
                    for position in 0..count + 3 {
                        if (position + count - 1) % count == node {
                            put(image, first + position, value as u32);
                        }
                    }
                }
            }
            // The ripple unit.
            7 => put(image, 29, (f64::from(word(image, 29)) * 10f64.powf(2.0 * choices.part())) as u32),
            _ => {
                let at = choices.below(image.len() / 4);
                put(image, at, choices.any());
            }
        }
    }
    flexspline::testing::reseal(image);
}

/// The stated limits of an accepted table hold for every input.
pub fn keeps_its_promises(table: &Table<'_>, choices: &mut Choices<'_>) {
    let bounds = table.bounds();
    assert!(bounds.slope >= 0.0 && bounds.slope < 1.0 && bounds.curve_slope <= bounds.slope, "{bounds:?}");
    assert!(bounds.error_rad >= 0.0 && bounds.error_rad <= table.error_limit_rad(), "{bounds:?}");
    assert!(table.error_limit_rad() <= Table::MAX_ERROR_RAD);
    assert!(table.inverse_error_bound_rad() >= 0.0 && table.inverse_error_bound_rad() <= Table::MAX_INVERSE_ERROR_RAD);
    assert!((1..=Table::MAX_INVERSE_ITERATIONS).contains(&table.inverse_iterations()));
    let torque_nodes: Vec<f32> = table.torque_nodes_n_m().collect();
    let temperature_nodes: Vec<f32> = table.temperature_nodes_c().collect();
    // Rounding of the integers: a few counts for each part.
    let most = 1.0001 * bounds.error_rad + 16.0 * COUNT_RAD;
    let mut play = PlayState::unknown();
    for number in 0..24 {
        if number > 8 && choices.is_empty() {
            break;
        }
        let torque = hostile_axis(choices, &torque_nodes);
        let temperature = hostile_axis(choices, &temperature_nodes);
        let [torque_least, torque_most] = table.torque_range_n_m();
        let [least, warmest] = table.temperature_range_c();
        let finite = torque.is_finite() && temperature.is_finite();
        let inside = torque >= torque_least && torque <= torque_most && temperature >= least && temperature <= warmest;

        let generator = GeneratorAngle::from_counts(choices.any());
        let found = table.forward(&mut play, generator, torque, temperature);
        let expected = match (finite, inside) {
            (false, _) => found.quality == Quality::Disabled && found.transmission_error_rad == 0.0,
            (true, false) => found.quality == Quality::Extrapolated,
            (true, true) => matches!(found.quality, Quality::InRange | Quality::Uncertain),
        };
        assert!(expected, "{found:?} at {torque} N.m, {temperature} C");
        assert!(found.quality != Quality::InRange || (play.is_known() && found.uncertainty_rad == 0.0), "{found:?}");
        assert!(found.transmission_error_rad.abs() <= most, "{found:?}, at most {most}");
        let uncertainty = found.uncertainty_rad;
        assert!((0.0..=Table::MAX_ERROR_RAD * 4.2).contains(&uncertainty), "{found:?}");
        let near = play;
        let target = found.output.offset_rad((choices.part() * 1e-3) as f32);
        let command = table.inverse(target, torque, temperature, Approach::From(&near));
        assert!(
            command.predicted_error_rad.abs() <= most + table.inverse_error_bound_rad(),
            "{command:?}, at most {most}"
        );
        // What the iterations leave may lie beyond a limit that is this close to the table's own errors.
        let close = most + table.inverse_error_bound_rad() > table.error_limit_rad();
        let disabled = command.quality == Quality::Disabled;
        assert!(if finite { !disabled || close } else { disabled }, "{command:?}");
        if finite {
            steady_motion(table, generator, [torque, temperature], most);
        }
    }
}

/// Forward and backward motion: within the bound, in order, and inverted.
fn steady_motion(table: &Table<'_>, generator: GeneratorAngle, [torque, temperature]: [f32; 2], most: f32) {
    // Within the turns for which phases of a ratio that is no multiple of 2⁻³² are exact.
    let generator = GeneratorAngle::new(generator.turns() % 8, generator.fraction());
    let [ahead, behind] = [Direction::Forward, Direction::Backward].map(|direction| {
        let error =
            table.steady_error_rad(generator, torque, temperature, direction).expect("finite and within bounds");
        assert!(error.abs() <= most, "{error}, at most {most}");
        let mut play = PlayState::after_motion(direction);
        let there = table.forward(&mut play, generator, torque, temperature);
        assert!((there.transmission_error_rad - error).abs() <= 2.0 * COUNT_RAD, "{there:?} {error}");
        let target = there.output;
        let command = table.inverse(target, torque, temperature, Approach::Moving(direction));
        let mut play = PlayState::after_motion(direction);
        let reached = table.forward(&mut play, command.generator, torque, temperature);
        // A generator that turns slower than the output moves it by more than a count with each of its own.
        let count = COUNT_RAD * (1.0 / table.drive().ratio().abs()).max(1.0);
        let (off, allowed) = (reached.output.minus_rad(target).abs(), table.inverse_error_bound_rad() + 8.0 * count);
        assert!(off <= allowed, "{off} rad off, at most {allowed}: {table:?}");
        let predicted = OutputAngle::minus_rad(reached.nominal.offset_rad(command.predicted_error_rad), target).abs();
        assert!(predicted <= allowed, "predicted {predicted} rad off, at most {allowed}: {table:?}");
        error
    });
    assert!(ahead <= behind + 4.0 * COUNT_RAD, "a negative play: {ahead} {behind}");
}
