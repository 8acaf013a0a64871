//! What variants are asked for, each alone, and where none has all of it the one that comes nearest.

use serde::Serialize;

use super::judge::{Constraint, clears};
use super::{RunStatus, StudyRun};
use flexspline_base::robust::least_and_most;
use flexspline_mechanics::drive::GeneratorKind;

/// One thing that is asked of a variant, and how many of a generator have it, whatever else they lack.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Asked {
    /// The generator.
    pub generator: GeneratorKind,
    /// What is asked: `converged`, `teeth clear`, or a constraint as `--keep` takes it.
    pub what: String,
    /// Variants that have it.
    pub meet_alone: usize,
    /// All variants.
    pub of: usize,
    /// Least and largest value of the figure over all variants that have one; missing of what is no figure.
    pub found: Option<[f64; 2]>,
}

/// The variant that comes nearest to what is asked.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Nearest {
    /// The generator.
    pub generator: GeneratorKind,
    /// Number of the variant.
    pub variant: usize,
    /// What it does not keep to.
    pub misses: Vec<Miss>,
}

/// A constraint that a variant does not keep to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Miss {
    /// The figure.
    pub figure: &'static str,
    /// Its value; missing where the variant has none.
    pub value: Option<f64>,
    /// The end of the range that it misses; of a value that is missing the least one, where there is one.
    pub limit: f64,
    /// Whether the value should be at most the limit; otherwise at least.
    pub at_most: bool,
}

impl Miss {
    /// On which side of the limit the value should be.
    pub fn side(&self) -> &'static str {
        if self.at_most { "at most" } else { "at least" }
    }
}

/// How many variants of a generator have each thing that is asked, alone.
pub fn asked(runs: &[StudyRun], constraints: &[Constraint], generator: GeneratorKind) -> Vec<Asked> {
    let all: Vec<&StudyRun> = runs.iter().filter(|run| run.generator == generator).collect();
    let one = |what: String, found, has: &dyn Fn(&StudyRun) -> bool| Asked {
        generator,
        what,
        meet_alone: all.iter().filter(|run| has(run)).count(),
        of: all.len(),
        found,
    };
    let mut told = vec![
        one("converged".to_owned(), None, &|run| run.status == RunStatus::Converged),
        one("teeth clear".to_owned(), None, &|run| clears(&run.sheet)),
    ];
    told.extend(constraints.iter().map(|constraint| {
        let found = range(all.iter().filter_map(|run| constraint.value(&run.sheet)));
        one(constraint.to_string(), found, &|run| constraint.keeps(&run.sheet))
    }));
    told
}

/// Of the variants of a generator that converge and whose teeth clear, the one that misses the constraints by least: by
/// the sum of what is missing, each over the range in which the figure was found. A figure that a variant does not
/// have, or that is missed where it has no range, counts as missed by a whole one. None where there is no such variant,
/// or where one meets.
pub fn nearest(runs: &[StudyRun], constraints: &[Constraint], generator: GeneratorKind) -> Option<Nearest> {
    let all = || runs.iter().filter(|run| run.generator == generator);
    if all().any(|run| run.meets) {
        return None;
    }
    let spans: Vec<f64> = constraints
        .iter()
        .map(|constraint| {
            let found = range(all().filter_map(|run| constraint.value(&run.sheet)));
            // A figure that is the same everywhere is missed over its own size.
            found.map_or(0.0, |[low, high]| if high > low { high - low } else { high.abs() })
        })
        .collect();
    let distance = |run: &StudyRun| -> f64 {
        let each = constraints.iter().zip(&spans).map(|(constraint, span)| match constraint.lacks(&run.sheet) {
            Some(0.0) => 0.0,
            Some(lack) if *span > 0.0 => lack / span,
            _ => 1.0,
        });
        each.sum()
    };
    let sound = all().filter(|run| run.status == RunStatus::Converged && clears(&run.sheet));
    let best = sound.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    let misses = constraints.iter().filter(|constraint| !constraint.keeps(&best.sheet)).map(|constraint| {
        let value = constraint.value(&best.sheet);
        let at_most = value.map_or(!constraint.least.is_finite(), |value| value > constraint.most);
        let limit = if at_most { constraint.most } else { constraint.least };
        Miss { figure: constraint.figure, value, limit, at_most }
    });
    Some(Nearest { generator, variant: best.variant, misses: misses.collect() })
}

/// Least and largest of these; none of none.
fn range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let (low, high) = least_and_most(values);
    (low <= high).then_some([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::judge::judge;
    use crate::study::tests::made_up;

    const CAM: GeneratorKind = GeneratorKind::Cam;

    fn constraints(texts: &[&str]) -> Vec<Constraint> {
        texts.iter().map(|text| text.parse().unwrap()).collect()
    }

    /// Each is met by some variant and both by none. The second misses a tenth of the range of one figure, the others
    /// more.
    #[test]
    fn each_constraint_is_counted_alone_and_the_nearest_variant_says_what_it_misses() {
        let keep = constraints(&["kinematic_error_pp_arcsec=..1.5", "max_von_mises_mpa=..250"]);
        let mut runs = [(1.0, 400.0), (1.2, 270.0), (2.0, 200.0)].map(|(e, s)| made_up(1, 1.0, e, s)).to_vec();
        runs.push(made_up(4, 1.0, 1.0, 200.0));
        (0..).zip(&mut runs).for_each(|(k, run)| run.variant = k + 1);
        // The fourth would meet all of it, but its teeth interfere.
        runs[3].sheet.rigid_gap_um = Some(-5.0);
        judge(&mut runs, &keep, &[], &[]);
        let told = asked(&runs, &keep, CAM);
        let counts: Vec<(&str, usize)> = told.iter().map(|asked| (asked.what.as_str(), asked.meet_alone)).collect();
        assert_eq!(
            counts,
            [
                ("converged", 4),
                ("teeth clear", 3),
                ("kinematic_error_pp_arcsec=..1.5", 3),
                ("max_von_mises_mpa=..250", 2)
            ]
        );
        assert_eq!((told[2].of, told[2].found), (4, Some([1.0, 2.0])));
        let nearest = nearest(&runs, &keep, CAM).unwrap();
        let miss = Miss { figure: "max_von_mises_mpa", value: Some(270.0), limit: 250.0, at_most: true };
        assert_eq!((nearest.variant, nearest.misses), (2, vec![miss]));
    }

    /// A value that is there, and none, each against a range that is open at either end or at none.
    #[test]
    fn a_miss_says_on_which_side_of_the_limit_the_value_should_be() {
        for (value, range, due) in [
            (Some(270.0), "..250", "at most 250"),
            (Some(270.0), "100..250", "at most 250"),
            (Some(50.0), "100..250", "at least 100"),
            (Some(50.0), "100..", "at least 100"),
            (None, "..250", "at most 250"),
            (None, "100..250", "at least 100"),
            (None, "100..", "at least 100"),
        ] {
            let keep = constraints(&[&format!("max_von_mises_mpa={range}")]);
            let mut runs = vec![made_up(1, 1.0, 1.0, 0.0)];
            runs[0].sheet.max_von_mises_mpa = value;
            judge(&mut runs, &keep, &[], &[]);
            let miss = nearest(&runs, &keep, CAM).unwrap().misses.remove(0);
            assert_eq!(format!("{} {}", miss.side(), miss.limit), due, "{value:?} {range}");
        }
    }

    /// A figure that no variant has does not hide which of them is nearer in another, nor does one that is 0
    /// everywhere.
    #[test]
    fn what_no_variant_has_leaves_the_nearest_to_the_other_figures() {
        let mut runs = [3.0, 2.0, 4.0].map(|e| made_up(1, 1.0, e, 0.0)).to_vec();
        (0..).zip(&mut runs).for_each(|(k, run)| run.variant = k + 1);
        for other in ["wind_up_arcsec=..10", "max_von_mises_mpa=1.."] {
            let keep = constraints(&[other, "kinematic_error_pp_arcsec=..1"]);
            judge(&mut runs, &keep, &[], &[]);
            assert_eq!(nearest(&runs, &keep, CAM).unwrap().variant, 2, "{other}");
        }
    }

    #[test]
    fn where_one_meets_or_none_is_sound_none_is_nearest() {
        let keep = constraints(&["max_von_mises_mpa=..250"]);
        let mut runs = vec![made_up(1, 1.0, 1.0, 200.0)];
        judge(&mut runs, &keep, &[], &[]);
        assert_eq!(nearest(&runs, &keep, CAM), None);
        runs[0].status = RunStatus::Failed;
        judge(&mut runs, &keep, &[], &[]);
        assert!(!runs[0].meets);
        assert_eq!(nearest(&runs, &keep, CAM), None);
    }
}
