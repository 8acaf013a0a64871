//! Catalogue values of a size, for the `[data_sheet]` of a drive that is made like one of them.
//!
//! The figures are those of Harmonic Drive's cups and silk hats, which share one table of stiffness (Harmonic Drive
//! LLC, CSF/CSG catalogue, pages 14 and 49; Harmonic Drive AG, HFUS-2A 1019658, 11/2014; `catalogue.csv` says which is
//! whose). They also say that a single unit may be 30 % off the stiffness. It is printed for i = 30, 50, and 80 and
//! above: between these and below nobody knows, so that no figures of another ratio stand in.

use serde::Deserialize;

use crate::stated::Stated;

/// One line for each size and ratio; an empty cell is not printed.
const SIZES: &str = include_str!("catalogue.csv");
/// How far single units are off the printed stiffness, ± percent.
pub(crate) const UNIT_SCATTER_PERCENT: f64 = 30.0;
/// Series with these figures; the last two with torques of their own.
pub const SERIES: [&str; 6] = ["CSF", "SHF", "HFUC", "HFUS", "CSG", "SHG"];
/// Ratios that share one stiffness.
const HIGH_RATIOS: std::ops::RangeInclusive<u32> = 80..=160;

/// The series of that name, whatever its case; clones have an L before it (LCSG).
pub fn series(name: &str) -> Option<&'static str> {
    let name = name.to_ascii_uppercase();
    SERIES.into_iter().find(|known| [Some(name.as_str()), name.strip_prefix('L')].contains(&Some(*known)))
}

/// Catalogue values of a size and ratio. Of a size between two printed ones T1, T2 and K alone, by the cube of the
/// size; none of a series or ratio that is not at hand, or of a size beyond the printed ones.
pub fn sheet(name: &str, size: f64, ratio: u32) -> Option<Stated> {
    let series = series(name)?;
    let own = usize::from(["CSG", "SHG"].contains(&series));
    let rows = of_ratio(ratio, own);
    let above = rows.iter().find(|row| row.size >= size)?;
    let below = rows.iter().rfind(|row| row.size <= size)?;
    let of = |size: f64| format!("{series}-{size}-{ratio}");
    let (row, source) = if above.size == size {
        (above.clone(), format!("Harmonic Drive {}", of(size)))
    } else {
        let source =
            format!("between Harmonic Drive {} and {}, by the cube of the size", of(below.size), of(above.size));
        (SizeRow::between(below, above, size), source)
    };
    let other = rows.iter().find(|row| row.ratio != ratio && [below.size, above.size].contains(&row.size));
    let shared = other.map_or_else(String::new, |other| {
        format!("; i = {ratio} is not printed: its stiffness is that of i = {}, as of all from 80 to 160", other.ratio)
    });
    let clone = if name.eq_ignore_ascii_case(series) { "" } else { ", of which this is a clone by its name" };
    let [t1_n_m, t2_n_m, k1_n_m_per_rad, k2_n_m_per_rad, k3_n_m_per_rad] = row.stiffness.map(Some);
    Some(Stated {
        source: Some(source + clone + &shared),
        rated_torque_n_m: row.rated_n_m[own],
        t1_n_m,
        t2_n_m,
        k1_n_m_per_rad,
        k2_n_m_per_rad,
        k3_n_m_per_rad,
        ratcheting_torque_n_m: row.ratcheting_n_m[own],
        accuracy_arcmin: row.accuracy_arcmin,
        unit_scatter_percent: Some(UNIT_SCATTER_PERCENT),
        ..Stated::default()
    })
}

/// What is at hand, in words.
pub fn sizes_in_words() -> String {
    let sizes = |ratio: u32| {
        let rows = of_ratio(ratio, 0);
        format!("{} to {}", rows[0].size, rows[rows.len() - 1].size)
    };
    let (series, high) = (SERIES.join(", ") + " (these two from i = 50 and size 14)", HIGH_RATIOS.end());
    format!("{series} of i = 30 (sizes {}), 50 ({}) and 80 to {high} ({})", sizes(30), sizes(50), sizes(80))
}

/// A line.
#[derive(Debug, Clone, Deserialize)]
struct SizeRow {
    size: f64,
    ratio: u32,
    /// Of CSF and its kin, and of CSG and SHG.
    rated_n_m: [Option<f64>; 2],
    /// T1, T2 (N·m), K1, K2, K3 (N·m/rad).
    stiffness: [f64; 5],
    ratcheting_n_m: [Option<f64>; 2],
    accuracy_arcmin: Option<f64>,
}

impl SizeRow {
    /// A size between two: what is printed of them, over the cube of the size, goes from one to the other in
    /// proportion; to three digits.
    fn between(below: &SizeRow, above: &SizeRow, size: f64) -> SizeRow {
        let share = (size - below.size) / (above.size - below.size);
        let stiffness = std::array::from_fn(|k| {
            let [from, to] = [below, above].map(|row| row.stiffness[k] / row.size.powi(3));
            let value = size.powi(3) * (from + share * (to - from));
            format!("{value:.2e}").parse().unwrap_or(value)
        });
        SizeRow { size, ..SizeRow { stiffness, ..below.clone() }.stiffness_alone() }
    }

    fn stiffness_alone(self) -> SizeRow {
        SizeRow { rated_n_m: [None; 2], ratcheting_n_m: [None; 2], accuracy_arcmin: None, ..self }
    }
}

/// Sizes with a ratio, ascending; of one that is not printed but shares its stiffness with others, the stiffness alone.
/// Of series with `own` torques (1) those alone that have one: they are not made smaller, nor with lower ratios.
fn of_ratio(ratio: u32, own: usize) -> Vec<SizeRow> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).comment(Some(b'#')).from_reader(SIZES.as_bytes());
    let mut rows: Vec<SizeRow> = reader.deserialize().collect::<Result<_, _>>().expect("the file is ours");
    let shares = |row: &SizeRow| HIGH_RATIOS.contains(&ratio) && HIGH_RATIOS.contains(&row.ratio);
    rows.retain(|row| (row.ratio == ratio || shares(row)) && (own == 0 || row.rated_n_m[own].is_some()));
    rows.sort_by(|a, b| a.size.total_cmp(&b.size).then((a.ratio != ratio).cmp(&(b.ratio != ratio))));
    rows.dedup_by_key(|row| row.size);
    rows.into_iter().map(|row| if row.ratio == ratio { row } else { row.stiffness_alone() }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As the catalogue's page has them; all series share the stiffness, and none has what another alone is sold with.
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
        // HFUS-20-30: its own, not those of i = 50, which are 2.1 to 2.5 times as stiff.
        let slow = sheet("HFUS", 20.0, 30).unwrap();
        assert_eq!(
            (slow.rated_torque_n_m, slow.k1_n_m_per_rad, slow.k3_n_m_per_rad),
            (Some(15.0), Some(5.7e3), Some(11e3))
        );
        let clone = sheet("LCSG", 32.0, 80).unwrap();
        assert_eq!(Stated { source: csg.source.clone(), ..clone.clone() }, csg);
        assert!(clone.source.unwrap().contains("Harmonic Drive CSG-32-80, of which this is a clone"));
    }

    /// From 80 on the stiffness is that of every ratio, and nothing else is; below it is that of its own alone.
    #[test]
    fn a_ratio_has_no_figures_of_another_but_the_stiffness_from_80_on() {
        let [odd, like] = [90, 100].map(|ratio| sheet("CSG", 25.0, ratio).unwrap());
        assert_eq!((odd.k1_n_m_per_rad, odd.t2_n_m), (like.k1_n_m_per_rad, like.t2_n_m));
        assert_eq!((odd.rated_torque_n_m, odd.ratcheting_torque_n_m), (None, None));
        assert!(odd.source.unwrap().contains("i = 90 is not printed: its stiffness is that of i = 80"));
        for (name, size, ratio) in [
            ("CSG", 25.0, 60),
            ("CSF", 25.0, 40),
            ("CSG", 25.0, 200),
            ("CSF", 40.0, 30),
            ("CSG", 25.0, 30),
            ("CSG", 90.0, 100),
            ("CSF", 8.0, 100),
            ("CSD", 25.0, 100),
        ] {
            assert_eq!(sheet(name, size, ratio), None, "{name}-{size}-{ratio}");
        }
        assert!(sizes_in_words().contains("i = 30 (sizes 14 to 32), 50 (11 to 90) and 80 to 160 (11 to 90)"));
    }

    /// Every printed size from its neighbours: within 9 % from size 20 on (measured: 8.4 %, K2 of CSF-32-50).
    #[test]
    fn a_size_between_two_follows_from_the_cube() {
        let mut worst = 0.0_f64;
        for ratio in [50, 80] {
            let rows = of_ratio(ratio, 0);
            for three in rows.windows(3).filter(|three| three[0].size >= 20.0) {
                let found = SizeRow::between(&three[0], &three[2], three[1].size);
                let off = |k: usize| (found.stiffness[k] / three[1].stiffness[k] - 1.0).abs();
                worst = (0..5).map(off).fold(worst, f64::max);
            }
        }
        println!("off by {worst:.4} at most");
        assert!((0.08..0.09).contains(&worst), "{worst}");
        let between = sheet("CSG", 28.0, 100).unwrap();
        assert!(between.rated_torque_n_m.is_none() && between.source.unwrap().contains("CSG-25-100 and CSG-32-100"));
    }

    /// Every line gives all of a sheet, its loads in their order and its stiffness growing.
    #[test]
    fn every_line_makes_a_sheet_that_a_file_takes() {
        for series in SERIES {
            let own = usize::from(series.ends_with('G'));
            for row in [30, 50, 80, 100, 120, 160].into_iter().flat_map(|ratio| of_ratio(ratio, own)) {
                let stated = sheet(series, row.size, row.ratio).unwrap();
                let read = Stated::of_file("d.toml", &stated.to_toml()).unwrap().unwrap();
                assert_eq!(read, stated, "{series} {row:?}");
                assert!(stated.k1_n_m_per_rad < stated.k2_n_m_per_rad && stated.k2_n_m_per_rad < stated.k3_n_m_per_rad);
            }
        }
    }
}
