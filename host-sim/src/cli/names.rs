//! The wave generators that an option names: one, or all.

use std::str::FromStr;

use flexspline_base::suggest::UnknownName;
use flexspline_mechanics::drive::GeneratorKind;

/// Names that the option takes.
const NAMES: [&str; 5] = ["two-roller", "four-roller", "double-disc", "cam", "all"];

/// One wave generator, or all of them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct GeneratorNames(pub(super) Vec<GeneratorKind>);

impl FromStr for GeneratorNames {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<GeneratorNames, UnknownName> {
        if name == "all" {
            return Ok(GeneratorNames(GeneratorKind::ALL.to_vec()));
        }
        let unknown = |_| UnknownName { what: "generator", found: name.to_owned(), known: &NAMES };
        name.parse().map(|kind| GeneratorNames(vec![kind])).map_err(unknown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::mesh::MeshLevel;
    use flexspline_mechanics::stepping::Method;

    fn said<T: FromStr<Err: ToString>>(found: &str) -> String {
        found.parse::<T>().err().unwrap().to_string()
    }

    #[test]
    fn misspelt_names_get_a_suggestion_and_garbage_gets_none() {
        for (found, meant) in [
            ("two_roller", "two-roller"),
            ("tworoller", "two-roller"),
            ("four-rollers", "four-roller"),
            ("double-disk", "double-disc"),
            ("disc", "double-disc"),
            ("Cam", "cam"),
        ] {
            let said = said::<GeneratorKind>(found);
            assert!(said.ends_with(&format!("; did you mean `{meant}`?")), "{said}");
        }
        assert!(said::<GeneratorKind>("cog").ends_with("allowed: two-roller, four-roller, double-disc, cam"));
        assert!(said::<GeneratorNames>("al").ends_with("cam, all; did you mean `all`?"));
        assert!(said::<MeshLevel>("course").ends_with("did you mean `coarse`?"));
        assert!(said::<MeshLevel>("huge").ends_with("fine"));
        assert!(said::<Method>("refrence").ends_with("did you mean `reference`?"));
    }

    #[test]
    fn every_name_is_read() {
        assert_eq!("all".parse::<GeneratorNames>().unwrap().0, GeneratorKind::ALL);
        for kind in GeneratorKind::ALL {
            assert_eq!(kind.name().parse::<GeneratorNames>().unwrap().0, [kind]);
        }
    }
}
