//! Options that take one of a few names: an error says what is allowed and what may have been meant, and a shell
//! completes them.

use std::error::Error;
use std::ffi::OsStr;
use std::str::FromStr;

use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};

use flexspline_base::suggest::did_you_mean;
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::Method;

type BoxedError = Box<dyn Error + Send + Sync>;

/// Reads one of `names`.
#[derive(Clone)]
pub(super) struct Named<T> {
    names: Vec<&'static str>,
    read: fn(&str) -> Result<T, BoxedError>,
}

impl<T: Clone + Send + Sync + 'static> TypedValueParser for Named<T> {
    type Value = T;

    fn parse_ref(&self, command: &clap::Command, arg: Option<&clap::Arg>, value: &OsStr) -> Result<T, clap::Error> {
        let read = self.read;
        StringValueParser::new().try_map(move |text: String| read(&text)).parse_ref(command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(self.names.iter().copied().map(PossibleValue::new)))
    }
}

/// These names, read as the type reads them.
fn of<T: FromStr<Err: Error + Send + Sync + 'static>>(names: impl IntoIterator<Item = &'static str>) -> Named<T> {
    Named { names: names.into_iter().collect(), read: |text| Ok(text.parse::<T>()?) }
}

/// One wave generator.
pub(super) fn generator() -> Named<GeneratorKind> {
    of(GeneratorKind::ALL.map(GeneratorKind::name))
}

/// A mesh level.
pub(super) fn mesh() -> Named<MeshLevel> {
    of(MeshLevel::NAMES)
}

/// A solver.
pub(super) fn solver() -> Named<Method> {
    of(Method::NAMES)
}

/// One wave generator, or all of them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct GeneratorNames(pub(super) Vec<GeneratorKind>);

/// One wave generator, or `all`.
pub(super) fn generators() -> Named<GeneratorNames> {
    let mut names = generator().names;
    names.push("all");
    Named { names, read: read_generators }
}

fn read_generators(name: &str) -> Result<GeneratorNames, BoxedError> {
    if name == "all" {
        return Ok(GeneratorNames(GeneratorKind::ALL.to_vec()));
    }
    name.parse().map(|kind| GeneratorNames(vec![kind])).map_err(|_| {
        let known = GeneratorKind::ALL.map(GeneratorKind::name);
        let hint = did_you_mean("; ", name, known.into_iter().chain(["all"]));
        format!("generator {name:?} is not known; allowed: {}, all{hint}", known.join(", ")).into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misspelt_names_get_a_suggestion_and_garbage_gets_none() {
        let said = |found: &str| (generator().read)(found).unwrap_err().to_string();
        for (found, meant) in [
            ("two_roller", "two-roller"),
            ("tworoller", "two-roller"),
            ("four-rollers", "four-roller"),
            ("double-disk", "double-disc"),
            ("disc", "double-disc"),
            ("Cam", "cam"),
        ] {
            assert!(said(found).ends_with(&format!("; did you mean `{meant}`?")), "{}", said(found));
        }
        assert!(said("cog").ends_with("allowed: two-roller, four-roller, double-disc, cam"));
        assert!(read_generators("al").unwrap_err().to_string().ends_with("cam, all; did you mean `all`?"));
        assert!((mesh().read)("course").unwrap_err().to_string().ends_with("did you mean `coarse`?"));
        assert!((mesh().read)("huge").unwrap_err().to_string().ends_with("fine"));
        assert!((solver().read)("refrence").unwrap_err().to_string().ends_with("did you mean `reference`?"));
    }

    #[test]
    fn every_name_that_is_offered_is_read() {
        for name in generators().names {
            assert!(read_generators(name).is_ok());
        }
        assert!(generator().names.iter().all(|name| (generator().read)(name).is_ok()));
        assert!(mesh().names.iter().all(|name| (mesh().read)(name).is_ok()));
        assert!(solver().names.iter().all(|name| (solver().read)(name).is_ok()));
    }
}
