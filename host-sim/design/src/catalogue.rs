//! Catalogue values of a size, for the `[data_sheet]` of a drive that is made like one of them.
//!
//! The figures are those of Harmonic Drive's CSF and CSG cups (Harmonic Drive LLC, CSF/CSG catalogue, pages 14 and 49;
//! Harmonic Drive AG, HFUS-2A 1019658, 11/2014): stiffness and its ranges, which both series share, ratcheting torque
//! and accuracy of each, rated torque of the CSG. That of the CSF is not in these sources. They also say that a single
//! unit may be 30 % off the stiffness.

use serde::Deserialize;

use crate::stated::Stated;

/// One line for each size and ratio; an empty cell is not printed.
const SIZES: &str = include_str!("catalogue.csv");
/// How far single units are off the printed stiffness, ± percent.
pub(crate) const UNIT_SCATTER_PERCENT: f64 = 30.0;

/// Catalogue values of a size and ratio: none of a series, size or ratio that is not at hand.
pub(crate) fn sheet(series: &str, size: f64, ratio: u32) -> Option<Stated> {
    let series = series.to_ascii_uppercase();
    let line = rows().into_iter().find(|row| row.size == size && row.ratio == ratio)?;
    let [rated_n_m, ratcheting_n_m] = match series.as_str() {
        "CSF" => [None, line.ratcheting_csf_n_m],
        "CSG" => [line.rated_csg_n_m, line.ratcheting_csg_n_m],
        _ => return None,
    };
    Some(Stated {
        source: Some(format!("Harmonic Drive {series}-{size}-{ratio}")),
        rated_torque_n_m: rated_n_m,
        t1_n_m: line.t1_n_m,
        t2_n_m: line.t2_n_m,
        k1_n_m_per_rad: line.k1_n_m_per_rad,
        k2_n_m_per_rad: line.k2_n_m_per_rad,
        k3_n_m_per_rad: line.k3_n_m_per_rad,
        ratcheting_torque_n_m: ratcheting_n_m,
        accuracy_arcmin: line.accuracy_arcmin,
        unit_scatter_percent: Some(UNIT_SCATTER_PERCENT),
        ..Stated::default()
    })
}

/// Catalogue values of a size and ratio or, where that ratio is not at hand, of the nearest of the same size,
/// whose source then says so. With it the ratio that the figures are of. A drive's load and stiffness hang on its size
/// far more than on its ratio: from 80 to 160 the stiffness is printed as the same.
pub fn nearest_sheet(series: &str, size: f64, ratio: u32) -> Option<(Stated, u32)> {
    let off = |other: u32| (f64::from(other) / f64::from(ratio)).ln().abs();
    let of_size = rows().into_iter().filter(|row| row.size == size).map(|row| row.ratio);
    let nearest = of_size.min_by(|a, b| off(*a).total_cmp(&off(*b)))?;
    let mut stated = sheet(series, size, nearest)?;
    if nearest != ratio
        && let Some(source) = &mut stated.source
    {
        *source += &format!(" (the nearest ratio at hand to {ratio})");
    }
    Some((stated, nearest))
}

/// The sizes and ratios that are at hand, in words.
pub fn sizes_in_words() -> String {
    let of = |value: fn(&SizeRow) -> f64| {
        let mut values: Vec<f64> = rows().iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
    };
    let (sizes, ratios) = (of(|row| row.size), of(|row| f64::from(row.ratio)));
    format!("CSF and CSG, sizes {sizes}, most of the ratios {ratios}")
}

/// A line.
#[derive(Debug, Deserialize)]
struct SizeRow {
    size: f64,
    ratio: u32,
    rated_csg_n_m: Option<f64>,
    t1_n_m: Option<f64>,
    t2_n_m: Option<f64>,
    k1_n_m_per_rad: Option<f64>,
    k2_n_m_per_rad: Option<f64>,
    k3_n_m_per_rad: Option<f64>,
    ratcheting_csf_n_m: Option<f64>,
    ratcheting_csg_n_m: Option<f64>,
    accuracy_arcmin: Option<f64>,
}

fn rows() -> Vec<SizeRow> {
    csv::Reader::from_reader(SIZES.as_bytes()).into_deserialize().collect::<Result<_, _>>().expect("the file is ours")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As the catalogue's page has them; both series share the stiffness, and neither has what the other alone is sold
    /// with.
    #[test]
    fn a_size_has_its_own_figures() {
        let csg = sheet("CSG", 32.0, 80).unwrap();
        let stated = [csg.rated_torque_n_m, csg.t1_n_m, csg.t2_n_m, csg.k1_n_m_per_rad, csg.k2_n_m_per_rad];
        assert_eq!(stated, [153.0, 29.0, 108.0, 67e3, 110e3].map(Some));
        assert_eq!((csg.k3_n_m_per_rad, csg.ratcheting_torque_n_m), (Some(120e3), Some(1800.0)));
        let csf = sheet("csf", 32.0, 80).unwrap();
        assert_eq!((csf.rated_torque_n_m, csf.ratcheting_torque_n_m), (None, Some(1400.0)));
        assert_eq!(csf.k3_n_m_per_rad, csg.k3_n_m_per_rad);
        assert_eq!(csf.source.as_deref(), Some("Harmonic Drive CSF-32-80"));
        for (series, size, ratio) in [("SHG", 32.0, 80), ("CSG", 33.0, 80), ("CSG", 32.0, 81)] {
            assert_eq!(sheet(series, size, ratio), None);
        }
    }

    /// Of a ratio that is not at hand the nearest stands in, and says so.
    #[test]
    fn the_nearest_ratio_of_a_size_stands_in_and_is_marked() {
        let (stated, ratio) = nearest_sheet("CSG", 32.0, 120).unwrap();
        assert_eq!((ratio, stated.rated_torque_n_m), (100, Some(178.0)));
        let source = "Harmonic Drive CSG-32-100 (the nearest ratio at hand to 120)";
        assert_eq!(stated.source.as_deref(), Some(source));
        let (stated, ratio) = nearest_sheet("CSG", 32.0, 80).unwrap();
        assert_eq!((Some(stated), ratio), (sheet("CSG", 32.0, 80), 80));
        assert_eq!(nearest_sheet("CSG", 33.0, 80), None);
    }

    /// Every line gives all of a sheet, its loads in their order and its stiffness growing.
    #[test]
    fn every_line_makes_a_sheet_that_a_file_takes() {
        for row in rows() {
            let (size, ratio) = (row.size, row.ratio);
            let stated = sheet("CSG", size, ratio).unwrap();
            let read = Stated::of_file("d.toml", &stated.to_toml()).unwrap().unwrap();
            assert_eq!(read, stated, "{size} {ratio}");
            assert!(stated.k1_n_m_per_rad < stated.k2_n_m_per_rad && stated.k2_n_m_per_rad < stated.k3_n_m_per_rad);
            assert!(stated.ratcheting_torque_n_m > stated.rated_torque_n_m);
        }
        assert!(sizes_in_words().contains("sizes 14, 17, 20, 25, 32, 40, most of the ratios 50, 80, 100, 160"));
    }
}
