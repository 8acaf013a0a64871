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

    #[test]
    fn every_name_is_read() {
        assert_eq!("all".parse::<GeneratorNames>().unwrap().0, GeneratorKind::ALL);
        for kind in GeneratorKind::ALL {
            assert_eq!(kind.name().parse::<GeneratorNames>().unwrap().0, [kind]);
        }
    }
}
