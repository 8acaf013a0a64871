use super::layout::{HEADER_BYTES, ID_OFFSET};
use super::sums::{derive, page_intact, seal};
use super::*;
use crate::angle::RAD_PER_COUNT;
use crate::crc::crc32;
use crate::drive::Phases;
use crate::error::{DriveError, Field, ImageError};
use crate::fixture;
use crate::table::read::play_at;
use crate::table::{GeneratorKind, Table, TableId};
use crate::write::{Provenance, TableData, WriteError, quantise, write_image};
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

/// Where nodes and records of the image of `fixture::image(false)` start, bytes.
const NODES: usize = 4 * word::CURVES;
const NODE_BYTES: usize = 4 * NODE_WORDS;
const RECORDS: usize = NODES + 3 * 11 * NODE_BYTES;
const RECORD_BYTES: usize = 4 * 20;

/// A small table with every part; ripple alternates in sign.
fn data() -> TableData<'static> {
    const RIPPLE: [f32; 32] = {
        let mut ripple = [1.0e-6; 32];
        let mut i = 0;
        while i < 32 {
            ripple[i] = if i % 2 == 0 { 1.0e-6 } else { -0.7e-6 };
            i += 1;
        }
        ripple
    };
    TableData {
        drive: fixture::drive(),
        torque_nodes_n_m: &[-1.0, 1.0],
        temperature_nodes_c: &[0.0, 40.0],
        ripple_nodes: 8,
        mean_rad: &[-1.0e-3, 1.0e-3, -2.0e-3, 2.0e-3],
        half_width_rad: &[1.0e-4, 2.0e-4, 3.0e-4, 4.0e-4],
        mean_ripple_rad: &RIPPLE,
        half_width_ripple_rad: &RIPPLE,
        generator_curve_rad: &[1.0e-5, -1.0e-5, 2.0e-5, 0.0],
        material_curve_rad: &[],
        output_curve_rad: &[1.0e-4, 0.0, -1.0e-4, 0.0, 0.0],
        projection_worst_rad: 2.0e-8,
        projection_rms_rad: 1.0e-8,
    }
}

/// A table at 20 °C without ripple and curves.
fn plain<'a>(torque_nodes_n_m: &'a [f32], mean_rad: &'a [f32], half_width_rad: &'a [f32]) -> TableData<'a> {
    TableData {
        torque_nodes_n_m,
        temperature_nodes_c: &[20.0],
        ripple_nodes: 0,
        mean_rad,
        half_width_rad,
        mean_ripple_rad: &[],
        half_width_ripple_rad: &[],
        generator_curve_rad: &[],
        output_curve_rad: &[],
        ..data()
    }
}

fn provenance() -> Provenance<'static> {
    Provenance { torque_range_n_m: [-1.0, 0.5], temperature_range_c: [0.0, 40.0], ..fixture::provenance() }
}

fn write(data: &TableData<'_>, provenance: &Provenance<'_>) -> Result<Vec<u8>, WriteError> {
    let mut out = vec![0xff; 4096];
    let bytes = write_image(data, provenance, &mut out, fixture::id)?;
    out.truncate(bytes);
    Ok(out)
}

#[test]
fn what_is_written_is_read_back() {
    let image = write(&data(), &provenance()).unwrap();
    assert_eq!(image.len(), image_bytes(2, 2, 8, [4, 0, 5]));
    let table = Table::check(&image).unwrap();
    assert_eq!(*table.drive(), fixture::drive());
    assert_eq!(table.generator_kind(), GeneratorKind::Cam);
    assert_eq!(table.drive_hash(), [0x5a; 32]);
    assert_eq!((table.tool_version(), table.mesh_level()), ("flexspline 0.1.0", "closed form"));
    assert_eq!((table.solver_residual(), table.projection_worst_rad()), (1e-9, 2.0e-8));
    assert_eq!(table.projection_rms_rad(), 1.0e-8);
    assert_eq!((table.torque_range_n_m(), table.temperature_range_c()), ([-1.0, 0.5], [0.0, 40.0]));
    assert!(table.torque_nodes_n_m().eq([-1.0, 1.0]) && table.temperature_nodes_c().eq([0.0, 40.0]));
    assert_eq!(table.error_limit_rad(), 0.02);
    assert_eq!(table.ripple_axis().len(), 8);
    // At every node and on both sides what was written, to the quantisation.
    let (unit, count) = (1.7e-6 / 32767.0, 1.5e-9);
    for (temperature_node, temperature) in [0.0, 40.0].into_iter().enumerate() {
        for (torque_node, torque) in [-1.0f32, 0.5].into_iter().enumerate() {
            let point = table.at(torque, temperature).unwrap();
            let share = (torque + 1.0) / 2.0;
            let at = |values: &[f32]| {
                let first = 2 * temperature_node;
                values[first] * (1.0 - share) + values[first + 1] * share
            };
            assert!((point.mean_rad() - at(data().mean_rad)).abs() < 2.0 * count, "{torque_node}");
            let half = point.half_width as f32 * RAD_PER_COUNT;
            assert!((half - at(data().half_width_rad)).abs() < 2.0 * count);
            for node in 0..8 {
                let phase = ((node as u64) << 32).div_ceil(8) as u32;
                let phases = Phases { generator: 0, material: 0, output: 0, tooth: phase };
                let play = play_at(&table, &point, phases, &mut Default::default());
                let ripple = |values: &[f32]| {
                    let value = |node: usize| {
                        let record = (2 * temperature_node) * 8 + node % 8;
                        values[record] * (1.0 - share) + values[record + 8] * share
                    };
                    0.125 * (value(node + 7) + 6.0 * value(node) + value(node + 1))
                };
                // A at ψ = 0 and C at δ = 0.
                let curves = (-0.0 + 6.0 * 1.0e-5 - 1.0e-5 + 6.0 * 1.0e-4) * 0.125;
                let centre = at(data().mean_rad) + ripple(data().mean_ripple_rad) + curves;
                assert!((play.centre as f32 * RAD_PER_COUNT - centre).abs() < 4.0 * count + unit);
                let half = at(data().half_width_rad) + ripple(data().half_width_ripple_rad);
                assert!((play.half as f32 * RAD_PER_COUNT - half).abs() < 4.0 * count + unit);
            }
        }
    }
}

#[test]
fn the_id_is_that_of_the_body_with_the_id_zero() {
    let mut image = write(&data(), &provenance()).unwrap();
    let table = Table::check(&image).unwrap();
    let (id, body_bytes) = (table.id(), table.body_bytes);
    assert_eq!(id, TableId(fixture::id(&table.hashed().concat())));
    image[ID_OFFSET..ID_OFFSET + 8].fill(0);
    assert_eq!(id, TableId(fixture::id(&image[..body_bytes])));
    assert_eq!(std::format!("{}", TableId([0, 1, 2, 0xab, 4, 5, 6, 0xff])), "000102ab040506ff");
}

#[test]
fn quantisation_rounds_to_nearest() {
    assert_eq!([0.49, 0.51, -0.49, -0.51, 32767.0].map(quantise), [0, 1, 0, -1, 32767]);
    assert_eq!(quantise(f64::NAN), 0);
}

#[test]
fn a_half_width_that_touches_zero_stays_writable() {
    for i in 0..500u32 {
        // Rounding of the lowest ripple goes up for some and down for others.
        let lowest = 1.0e-9 * (1.0 + 0.618_034 * i as f32);
        let mut ripple = data().half_width_ripple_rad.to_vec();
        ripple[3] = -lowest;
        ripple.iter_mut().filter(|h| **h < -lowest).for_each(|h| *h = -lowest);
        let touching = TableData { half_width_rad: &[lowest; 4], half_width_ripple_rad: &ripple, ..data() };
        let written = write(&touching, &provenance());
        assert!(written.is_ok(), "{lowest}: {written:?}");
    }
}

#[test]
fn the_stated_sizes_hold() {
    assert_eq!(image_bytes(25, 3, 8, [32; 3]), 5556);
    assert_eq!(image_bytes(60, 2, 8, [0; 3]), 7872);
    assert_eq!(
        fixture::image(false).len(),
        image_bytes(fixture::TORQUES.len(), fixture::TEMPERATURES.len(), 16, [0; 3])
    );
}

#[test]
fn pages_cover_the_body_and_find_their_damage() {
    let mut image = fixture::image(false);
    let table = Table::check(&image).unwrap();
    let (pages, body_bytes) = (table.page_count(), table.body_bytes);
    assert_eq!((0..pages).map(|page| table.page(page).unwrap().len()).sum::<usize>(), body_bytes);
    assert!((0..pages).all(|page| table.is_page_intact(page)));
    assert!(!table.is_page_intact(pages) && table.page(pages).is_none());
    image[2 * PAGE_BYTES] ^= 1;
    assert!(page_intact(&image, body_bytes, 1) && !page_intact(&image, body_bytes, 2));
}

#[test]
fn unaligned_images_are_read() {
    let image = fixture::image(false);
    for shift in 0..4 {
        let mut shifted = vec![0; shift];
        shifted.extend_from_slice(&image);
        assert!(Table::check(&shifted[shift..]).is_ok());
    }
}

#[test]
fn no_single_bit_may_flip() {
    let mut image = write(&data(), &provenance()).unwrap();
    for bit in 0..image.len() * 8 {
        image[bit / 8] ^= 1 << (bit % 8);
        assert!(Table::check(&image).is_err(), "bit {bit}");
        image[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(Table::check(&image).is_ok());
}

/// The error after `damage`, with every checksum made right again: what a broken or hostile writer would send.
fn resealed(damage: impl FnOnce(&mut Vec<u8>)) -> ImageError {
    let mut image = fixture::image(false);
    let body_bytes = Table::check(&image).unwrap().body_bytes;
    damage(&mut image);
    seal(&mut image, body_bytes);
    Table::check(&image).expect_err("accepted")
}

fn put(offset: usize, value: f32) -> impl FnOnce(&mut Vec<u8>) {
    move |image| image[offset..offset + 4].copy_from_slice(&value.to_le_bytes())
}

#[test]
fn each_damage_of_the_envelope_has_its_own_error() {
    let image = fixture::image(false);
    let damaged = |damage: fn(&mut Vec<u8>)| {
        let mut image = image.clone();
        damage(&mut image);
        Table::check(&image).unwrap_err()
    };
    let short = damaged(|image| image.truncate(100));
    assert_eq!(short, ImageError::TooShort { found: 100, needed: image_bytes(1, 1, 0, [0; 3]) });
    assert_eq!(Table::check(&[]).unwrap_err(), ImageError::TooShort { found: 0, needed: 584 });
    assert_eq!(damaged(|image| image[0] = 0), ImageError::Magic);
    // What a text-mode transfer does.
    assert_eq!(damaged(|image| _ = image.remove(4)), ImageError::Magic);
    assert_eq!(damaged(|image| image[8] = 2), ImageError::Version { found: 2, allowed: 3 });
    assert_eq!(damaged(|image| image.swap(10, 11)), ImageError::ByteOrder { found: 0xfffe });
    let full = image.len();
    assert_eq!(damaged(|image| _ = image.pop()), ImageError::Length { stated: full, found: full - 1 });
    assert_eq!(damaged(|image| image.push(0)), ImageError::Length { stated: full, found: full + 1 });
    assert!(matches!(damaged(|image| image[300] ^= 4), ImageError::Crc { .. }));
    assert!(matches!(damaged(|image| image[16] ^= 4), ImageError::Crc { .. }));
    let one_page = damaged(|image| {
        image[3 * PAGE_BYTES] ^= 4;
        let (before, last) = image.split_last_chunk_mut::<4>().unwrap();
        *last = crc32(before).to_le_bytes();
    });
    assert_eq!(one_page, ImageError::PageCrc { page: 3 });
}

#[test]
fn each_damage_of_the_header_has_its_own_error() {
    assert_eq!(resealed(|image| image[230] = 1), ImageError::Reserved { offset: 230 });
    assert_eq!(resealed(|image| image[57] = 7), ImageError::Text { field: Field::ToolVersion });
    assert_eq!(resealed(|image| image[102] = b'x'), ImageError::Text { field: Field::MeshLevel });
    assert_eq!(resealed(|image| image[104] = 5), ImageError::GeneratorKind { found: 5 });
    assert_eq!(resealed(|image| image[105] = 2), ImageError::FixedMember { found: 2 });
    let teeth = DriveError { flexspline_teeth: 190, circular_spline_teeth: 190 };
    assert_eq!(resealed(|image| image[106] = 190), ImageError::Teeth(teeth));
    for (offset, found, field, least, most) in [
        (110, 0, Field::TorqueNodes, 1, 64),
        (110, 65, Field::TorqueNodes, 1, 64),
        (111, 9, Field::TemperatureNodes, 1, 8),
        (112, 3, Field::RippleNodes, 4, 32),
        (112, 33, Field::RippleNodes, 4, 32),
        (113, 3, Field::GeneratorCurve, 4, 128),
        (114, 255, Field::MaterialCurve, 4, 128),
        (115, 129, Field::OutputCurve, 4, 128),
    ] {
        let error = resealed(|image| image[offset] = found);
        assert_eq!(error, ImageError::Count { field, found: found as usize, least, most });
    }
    assert!(matches!(resealed(|image| image[110] = 12), ImageError::Size { .. }));
    let outside = |offset, value, field| {
        let error = resealed(put(offset, value));
        assert!(matches!(error, ImageError::OutOfRange { field: named, .. } if named == field), "{error}");
    };
    outside(124, -1.0, Field::SolverResidual);
    outside(128, 0.06, Field::ProjectionWorst);
    outside(132, 0.01, Field::ProjectionRms);
    outside(136, -50.1, Field::TorqueRange);
    outside(140, -50.1, Field::TorqueRange);
    outside(148, 80.1, Field::TemperatureRange);
    // What follows from other numbers must do so: unit of the ripple aside, each of these words.
    for at in [120, 156, 160, 164, 166, 168, 170, 172, 174, 176, 180, 184, 188, 192, 196] {
        let error = resealed(|image| image[at] ^= 1);
        assert_eq!(error, ImageError::Derived { offset: at / 4 * 4 });
    }
    outside(152, 0.0, Field::ErrorLimit);
    outside(152, 0.051, Field::ErrorLimit);
    for (offset, field, index) in [
        (124, Field::SolverResidual, 0),
        (132, Field::ProjectionRms, 0),
        (140, Field::TorqueRange, 1),
        (144, Field::TemperatureRange, 0),
        (152, Field::ErrorLimit, 0),
    ] {
        assert_eq!(resealed(put(offset, f32::NAN)), ImageError::NotFinite { field, index });
    }
}

#[test]
fn each_damage_of_the_numbers_has_its_own_error() {
    let node = |i: usize| HEADER_BYTES + 4 * i;
    let infinite = ImageError::NotFinite { field: Field::TorqueNodes, index: 10 };
    assert_eq!(resealed(put(node(10), f32::INFINITY)), infinite);
    // Equal nodes are no jump: they have no interval to interpolate in.
    let equal = ImageError::NotIncreasing { field: Field::TorqueNodes, index: 4 };
    assert_eq!(resealed(put(node(4), -1.51)), equal);
    let falling = ImageError::NotIncreasing { field: Field::TemperatureNodes, index: 2 };
    assert_eq!(resealed(put(node(66), 19.0)), falling);
    assert_eq!(resealed(put(node(11), 99.0)), ImageError::Derived { offset: node(11) });
    let at_node = |i: usize| NODES + NODE_BYTES * i;
    let error = resealed(put(at_node(5), f32::NEG_INFINITY));
    assert_eq!(error, ImageError::NotFinite { field: Field::Mean, index: 5 });
    for (place, field) in [(4, Field::MeanSlope), (8, Field::HalfWidth)] {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let error = resealed(put(at_node(12) + place, value));
            assert_eq!(error, ImageError::NotFinite { field, index: 12 });
        }
    }
    // At the end of the axis, in the middle, and a slope that overflows: 30 N·m on, a third of it is too much.
    for (index, slope) in [(0, 2.0e6), (9, 2.0e6), (10, -2.0e6), (4, f32::MAX), (32, -f32::MAX)] {
        let error = resealed(put(at_node(index) + 4, slope));
        assert!(matches!(error, ImageError::ErrorBound { allowed_rad: 0.02, .. }), "{index}: {error}");
    }
    let error = resealed(put(at_node(20), 3.0e7));
    assert!(matches!(error, ImageError::ErrorBound { allowed_rad: 0.02, .. }), "{error}");
    let error = resealed(put(at_node(7) + 8, -1.0));
    assert!(matches!(error, ImageError::OutOfRange { field: Field::HalfWidth, .. }), "{error}");
    // The mark of a jump is where the nodes put it.
    let error = resealed(|image| image[at_node(7) + 8] ^= 1);
    assert_eq!(error, ImageError::Derived { offset: at_node(7) + 8 });
    let record = |i: usize| RECORDS + RECORD_BYTES * i;
    // Half-width below its own ripple, at temperature 1 and torque 2.
    let error = resealed(put(at_node(13) + 8, 30.0));
    assert!(matches!(error, ImageError::NegativeHalfWidth { temperature: 1, torque: 2, .. }), "{error}");
    // The repeated nodes at either end of a record.
    for index in [0, 17, 18, 19, 20, 39] {
        let offset = record(3) + 2 * index;
        let error = resealed(|image| image[offset] ^= 1);
        assert_eq!(error, ImageError::NotClosed { field: Field::MeanRipple, index });
    }
    // Ripple sixty times as large, where the half-width allows it: the same at every node of the last record.
    let error = resealed(|image| {
        let unit = u32::from_le_bytes(*image[116..].first_chunk().unwrap());
        image[116..120].copy_from_slice(&(unit * 60).to_le_bytes());
        for record in image[RECORDS..RECORDS + 33 * RECORD_BYTES].chunks_exact_mut(RECORD_BYTES) {
            // The half-width ripple goes.
            record.copy_within(0..RECORD_BYTES / 2, RECORD_BYTES / 2);
        }
    });
    assert!(matches!(error, ImageError::Slope { found } if found > 1.0 && found < 20.0), "{error}");
}

/// With every checksum right and every bound of the format kept: what no drive does is refused, by a rule that has a
/// name.
#[test]
fn a_wind_up_that_no_drive_has_is_refused() {
    let ends = |torque: &[f32]| [torque[0], torque[torque.len() - 1]];
    let case = |torque: &[f32], mean: &[f32], half: &[f32]| {
        let limits = Provenance { torque_range_n_m: ends(torque), error_limit_rad: 0.05, ..provenance() };
        write(&plain(torque, mean, half), &limits).map(|_| ())
    };
    // The rule, and the torque node that it names.
    let named = |found: Result<(), WriteError>| match found {
        Err(WriteError::Refused(ImageError::Falls { torque, temperature: 0, .. })) => ("falls", torque),
        Err(WriteError::Refused(ImageError::Steep { torque, temperature: 0, .. })) => ("steep", torque),
        found => panic!("{found:?}"),
    };
    let axis = [-20.0, -5.0, 0.0, 5.0, 20.0];
    let sound = [-6e-4, -2e-4, 0.0, 2e-4, 6e-4];
    assert_eq!(case(&axis, &sound, &[1e-4; 5]), Ok(()));
    // Noise of measurement passes.
    assert_eq!(case(&axis, &[0.0, 5e-6, 0.0, 5e-6, 0.0], &[1e-4; 5]), Ok(()));
    // A thousandth of a newton metre, and two hundredths of a radian: up and down, and only up.
    assert_eq!(named(case(&[-1e-3, 0.0, 1e-3], &[-0.02, 0.02, -0.02], &[0.0; 3])), ("steep", 1));
    assert_eq!(named(case(&[0.0, 1e-3], &[-0.02, 0.02], &[0.0; 2])), ("steep", 1));
    // The sign of the torque turned; gives way at 5 N·m; the mean rises, one flank falls.
    assert_eq!(named(case(&axis, &sound.map(|d| -d), &[1e-4; 5])), ("falls", 1));
    assert_eq!(named(case(&axis, &[-6e-4, -2e-4, 0.0, -1e-4, 6e-4], &[1e-4; 5])), ("falls", 3));
    assert_eq!(named(case(&axis, &sound, &[1e-4, 1e-4, 1e-4, 5e-4, 5e-4])), ("falls", 3));
    // A jump of a clearance, and one beyond half a tooth pitch of 190.
    let jump = [-20.0, -0.01, 0.01, 20.0];
    assert_eq!(case(&jump, &[-6e-4, -3e-4, 3e-4, 6e-4], &[0.0; 4]), Ok(()));
    assert_eq!(named(case(&jump, &[-0.0181, -0.018, 0.018, 0.0181], &[0.0; 4])), ("steep", 2));
}

#[test]
fn the_bounds_hold_and_are_close() {
    let image = fixture::image(true);
    let bounds = Table::check(&image).unwrap().bounds;
    let (mut steepest, mut largest): (f64, f64) = (0.0, 0.0);
    for i in 0..100_000 {
        let generator = 596.9 * (i as f64 * 0.618_033_988).rem_euclid(1.0);
        for direction in [crate::Direction::Forward, crate::Direction::Backward] {
            let error = |generator| fixture::error(generator, 50.0, 80.0, direction, true);
            let slope = (error(generator + 1e-6) - error(generator - 1e-6)) / 2e-6 * 95.0;
            steepest = steepest.max(slope.abs());
            largest = largest.max(error(generator).abs());
        }
    }
    let (slope, error) = (bounds.slope as f64, bounds.error_rad as f64);
    assert!(steepest < slope && slope < 1.3 * steepest, "{steepest} {slope}");
    assert!(largest < error && error < 1.1 * largest, "{largest} {error}");
}

#[test]
fn a_limit_as_small_as_what_the_table_gives_disables_nothing() {
    let data = TableData {
        mean_rad: &[0.0; 4],
        half_width_rad: &[0.0; 4],
        mean_ripple_rad: &[2.0e-8; 32],
        half_width_ripple_rad: &[0.0; 32],
        generator_curve_rad: &[2.0e-8, -1.0e-8, 1.5e-8, 0.0],
        output_curve_rad: &[3.0e-8, 0.0, -3.0e-8, 0.0, 0.0],
        ..data()
    };
    let wide = write(&data, &provenance()).unwrap();
    let reached = Table::check(&wide).unwrap().bounds.error_rad;
    let tight = write(&data, &Provenance { error_limit_rad: reached, ..provenance() }).unwrap();
    let table = Table::check(&tight).unwrap();
    for i in 0..2000 {
        let target = crate::OutputAngle::from_counts(i * 8_589_934);
        for direction in [crate::Direction::Forward, crate::Direction::Backward] {
            let command = table.inverse(target, 0.5, 20.0, crate::Approach::Moving(direction));
            assert_eq!(command.quality, crate::Quality::InRange, "{i}");
            assert!(table.steady_error_rad(command.generator, 0.5, 20.0, direction).is_some(), "{i}");
        }
    }
}

#[test]
fn short_axes_give_flat_tables() {
    // One node alone, and an end of the axis that a jump cuts off.
    for nodes in [&[0.0][..], &[0.0, 2.0, 20.0, 40.0]] {
        let image = fixture::image_of(nodes, &[1.0e-3; 4][..nodes.len()], &[20.0], 0);
        let table = Table::check(&image).unwrap();
        for torque in [-1.0, 0.0, 0.5, 1.9, 2.0, 7.0, 40.0, 50.0] {
            assert!((table.at(torque, 20.0).unwrap().mean_rad() - 1.0e-3).abs() < 2e-9, "{torque}");
        }
    }
}

/// Only the mark as the host writes it is one; what units are off their wind-up then is stated, at torques that are
/// numbers, and of no other table.
#[test]
fn a_table_that_a_data_sheet_completed_says_how_far_units_scatter() {
    let of = |mesh_level: &str| {
        let image = write(&data(), &Provenance { mesh_level, ..provenance() }).unwrap();
        let table = Table::check(&image).unwrap();
        let wind_up = table.at(1.0, 40.0).unwrap().mean_rad().abs();
        let not_finite = table.sheet_uncertainty_rad(f32::NAN, 20.0);
        (table.sheet_scatter(), table.sheet_uncertainty_rad(1.0, 40.0), wind_up, not_finite)
    };
    for (mesh, scatter) in [("standard, sheet +-30 %", 0.3f32), ("fine, sheet +-5 %", 0.05)] {
        let (found, uncertainty, wind_up, not_finite) = of(mesh);
        assert!(found.is_some_and(|found| (found - scatter).abs() < 1e-6), "{found:?}");
        // A unit that is softer by s winds up 1 / (1 - s) times as far.
        assert!(wind_up > 1e-6 && (uncertainty - (1.0 / (1.0 - scatter) - 1.0) * wind_up).abs() < 1e-9);
        assert_eq!(not_finite, 0.0);
    }
    // The play that a load takes up is no wind-up, on either side.
    let jumps = [-20.0, -2.01, -1.99, 1.99, 2.01, 20.0];
    let completed = Provenance {
        mesh_level: "coarse, sheet +-30 %",
        torque_range_n_m: [-20.0, 20.0],
        temperature_range_c: [20.0; 2],
        ..provenance()
    };
    let image = write(&plain(&jumps, &[-5e-4, -2e-4, 0.0, 0.0, 2e-4, 5e-4], &[1e-4; 6]), &completed).unwrap();
    let table = Table::check(&image).unwrap();
    for (torque, wind_up) in [(20.0, 3e-4), (-20.0, 3e-4), (2.01, 0.0), (-1.5, 0.0), (0.0, 0.0)] {
        let uncertainty = table.sheet_uncertainty_rad(torque, 20.0);
        assert!((uncertainty - 0.3 / 0.7 * wind_up).abs() < 1e-8, "{torque}: {uncertainty}");
    }
    for mesh in ["standard", "", "sheet +-30 %", ", sheet +- %", ", sheet +-0 %", ", sheet +-130 %", "a, sheet +-30 %%"]
    {
        assert_eq!((of(mesh).0, of(mesh).1), (None, 0.0), "{mesh}");
    }
}

#[test]
fn the_writer_names_what_does_not_fit() {
    let mut small = [0; 300];
    let needed = image_bytes(2, 2, 8, [4, 0, 5]);
    let found = write_image(&data(), &provenance(), &mut small, fixture::id);
    assert_eq!(found, Err(WriteError::BufferTooSmall { needed, found: 300 }));
    let short = TableData { half_width_rad: &[1e-4; 3], ..data() };
    let expected = WriteError::Shape { field: Field::HalfWidth, found: 3, needed: 4 };
    assert_eq!(write(&short, &provenance()), Err(expected));
    let long = Provenance { mesh_level: "a mesh that takes too many words", ..provenance() };
    let expected = WriteError::TextTooLong { field: Field::MeshLevel, found: 32 };
    assert_eq!(write(&data(), &long), Err(expected));
    let foreign = Provenance { tool_version: "Σ", ..provenance() };
    let expected = WriteError::Refused(ImageError::Text { field: Field::ToolVersion });
    assert_eq!(write(&data(), &foreign), Err(expected));
    let many = plain(&[0.0; 65], &[0.0; 65], &[0.0; 65]);
    let expected = ImageError::Count { field: Field::TorqueNodes, found: 65, least: 1, most: 64 };
    assert_eq!(write(&many, &provenance()), Err(WriteError::Refused(expected)));
    let mut ripple = [0.0; 32];
    ripple[9] = f32::NAN;
    let undefined = TableData { mean_ripple_rad: &ripple, ..data() };
    let expected = ImageError::NotFinite { field: Field::MeanRipple, index: 9 };
    assert_eq!(write(&undefined, &provenance()), Err(WriteError::Refused(expected)));
}

proptest! {
    #[test]
    fn arbitrary_bytes_neither_panic_nor_pass(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        prop_assert!(Table::check(&bytes).is_err());
    }

    /// Slopes of any size and sign are either refused or leave every torque within the stated bounds.
    #[test]
    fn slopes_never_give_more_than_the_table_states(
        slopes in prop::collection::vec((0usize..33, -1.0f32..1.0, -4i32..8), 1..12),
        torque in -60.0f32..60.0, temperature in -50.0f32..90.0,
    ) {
        let mut image = fixture::image(false);
        let body_bytes = Table::check(&image).unwrap().body_bytes;
        for (record, mantissa, decade) in slopes {
            put(NODES + NODE_BYTES * record + 4, mantissa * 1.0e6 * 10.0f32.powi(-decade))(&mut image);
        }
        let _ = derive(&mut image, body_bytes);
        seal(&mut image, body_bytes);
        if let Ok(table) = Table::check(&image) {
            for torque in [torque, 0.3 * torque, 0.05 * torque] {
                let found = table.at(torque, temperature).unwrap();
                let reached = (found.mean.abs() + found.half_width) as f32 * RAD_PER_COUNT;
                prop_assert!(reached <= 1.0001 * table.bounds.error_rad, "{} at {}", reached, torque);
            }
        }
    }

    /// Past the checksums, any damage is either refused or leaves a table within its stated bounds.
    #[test]
    fn resealed_damage_never_gives_more_than_the_table_states(
        damage in prop::collection::vec((104usize..3000, any::<u8>()), 1..6),
        generator in any::<i64>(), torque in any::<f32>(), temperature in any::<f32>(),
    ) {
        let mut image = write(&data(), &provenance()).unwrap();
        let body_bytes = Table::check(&image).unwrap().body_bytes;
        for (offset, value) in damage {
            image[offset.min(body_bytes - 1)] = value;
        }
        seal(&mut image, body_bytes);
        let _ = derive(&mut image, body_bytes);
        seal(&mut image, body_bytes);
        if let Ok(table) = Table::check(&image) {
            let generator = crate::GeneratorAngle::from_counts(generator);
            let mut state = crate::PlayState::unknown();
            let found = table.forward(&mut state, generator, torque, temperature);
            prop_assert!(found.transmission_error_rad.abs() <= 1.0001 * table.bounds.error_rad);
            prop_assert_eq!(
                found.quality == crate::Quality::Disabled, !(torque.is_finite() && temperature.is_finite()),
            );
        }
    }
}
