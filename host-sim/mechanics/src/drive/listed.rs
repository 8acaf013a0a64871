//! Every field of a drive for a program that shows them: what the file says of it, with its value.

use serde::Serialize;

use super::fields::{self, Slot};
use super::spec::Drive;

/// A field of a drive.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ListedField {
    /// `section.key`, as `--set` takes it.
    pub path: &'static str,
    /// Meaning, unit and sign.
    pub meaning: &'static str,
    /// Its value, as `--set` takes it; `None` of a list that is not one number.
    pub value: Option<String>,
    /// Kind of value.
    pub kind: FieldKind,
    /// Least and largest number allowed, in the unit of the key; of a number.
    pub range: Option<[f64; 2]>,
    /// Allowed words; of a word.
    pub words: Vec<&'static str>,
    /// Whether it is an imperfection, which an ideal drive has not.
    pub is_imperfection: bool,
}

/// Kind of value of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FieldKind {
    /// A number.
    Number,
    /// A number, or `rigid`.
    NumberOrRigid,
    /// A whole number.
    Count,
    /// One of a few words.
    Word,
    /// A list, which is edited in a file.
    List,
}

impl Drive {
    /// Every field in the order of a written file, with its value.
    pub fn fields(&self) -> Vec<ListedField> {
        let mut listed = Vec::new();
        fields::for_each(self, |field, slot| {
            let (kind, value) = match &slot {
                Slot::Real(number) => (FieldKind::Number, Some(number.to_string())),
                Slot::RealOrRigid(number) => {
                    (FieldKind::NumberOrRigid, Some(number.map_or("rigid".to_owned(), |number| number.to_string())))
                }
                Slot::Count(number) => (FieldKind::Count, Some(number.to_string())),
                Slot::Word(word) => (FieldKind::Word, Some(word.chosen().to_owned())),
                Slot::List(_) | Slot::Harmonics(_) | Slot::Damage(_) => (FieldKind::List, None),
            };
            let words = if let Slot::Word(word) = slot { word.names() } else { Vec::new() };
            let numeric = matches!(kind, FieldKind::Number | FieldKind::NumberOrRigid | FieldKind::Count);
            listed.push(ListedField {
                path: field.path,
                meaning: field.meaning,
                value,
                kind,
                range: numeric.then_some([field.range.low, field.range.high]),
                words,
                is_imperfection: field.is_imperfection(),
            });
        });
        listed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every listed value can be set again, and gives the same drive.
    #[test]
    fn every_value_listed_is_one_that_can_be_set() {
        for name in Drive::BUILT_IN {
            let drive = Drive::built_in(name).unwrap();
            let listed = drive.fields();
            assert!(listed.len() > 60, "{}", listed.len());
            for field in &listed {
                let Some(value) = &field.value else { continue };
                let again = drive.with_set(&format!("{}={value}", field.path));
                assert_eq!(again.unwrap().hash(), drive.hash(), "{name}: {}", field.path);
                let number = value.parse::<f64>().ok();
                let inside = field.range.zip(number).is_none_or(|([low, high], x)| low <= x && x <= high);
                assert!(inside, "{name}: {} = {value}", field.path);
            }
        }
    }
}
