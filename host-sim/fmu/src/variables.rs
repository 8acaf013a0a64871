//! Variables of a model: name, type, unit, range, and when an importer may set or read them.

/// Units, by the symbol that is shown: exponents of kg, m, s, K, rad; factor and offset to them.
pub const UNITS: [(&str, [i8; 5], f64, f64); 12] = [
    ("rad", [0, 0, 0, 0, 1], 1.0, 0.0),
    ("rad/s", [0, 0, -1, 0, 1], 1.0, 0.0),
    ("rad/s2", [0, 0, -2, 0, 1], 1.0, 0.0),
    ("arcsec", [0, 0, 0, 0, 1], core::f64::consts::PI / 648_000.0, 0.0),
    ("N.m", [1, 2, -2, 0, 0], 1.0, 0.0),
    ("J", [1, 2, -2, 0, 0], 1.0, 0.0),
    ("kg.m2", [1, 2, 0, 0, 0], 1.0, 0.0),
    ("degC", [0, 0, 0, 1, 0], 1.0, 273.15),
    ("s", [0, 0, 1, 0, 0], 1.0, 0.0),
    ("Hz", [0, 0, -1, 0, 0], 1.0, 0.0),
    ("rad/rad", [0, 0, 0, 0, 0], 1.0, 0.0),
    ("1", [0, 0, 0, 0, 0], 1.0, 0.0),
];

/// A list of named numbers, from 0 on.
#[derive(Debug, PartialEq, Eq)]
pub struct Choices {
    /// Name of the type.
    pub name: &'static str,
    /// Names, and what they mean.
    pub items: &'static [(&'static str, &'static str)],
}

type Text = &'static str;

/// Type of a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FmiType {
    /// A number with a unit.
    Real(&'static str),
    /// A whole number.
    Integer,
    /// Yes or no.
    Boolean,
    /// One of a list; read and set as an integer.
    Choice(&'static Choices),
    /// Text; constants only.
    Text,
}

/// Role of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FmiRole {
    /// Set before the initialisation ends.
    Parameter,
    /// Set at any communication point.
    Tunable,
    /// Set at any communication point, and may change between.
    Input,
    /// Read; changes in steps only.
    Output,
    /// Read; changes all the time.
    Motion,
    /// Never changes.
    Constant,
}

/// A variable; its value reference is its place in the list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: &'static str,
    /// Its type.
    pub kind: FmiType,
    /// Its role.
    pub role: FmiRole,
    /// Where it starts, unless the resources say otherwise; integers, choices and yes (1) or no (0) as numbers.
    pub start: f64,
    /// Least and largest value that is taken, for parameters.
    pub range: [f64; 2],
    /// Description, with its sign.
    pub says: &'static str,
}

/// A positive number.
pub(crate) const POSITIVE: [f64; 2] = [1e-9, 1e9];
/// Zero or a positive number.
pub(crate) const NOT_NEGATIVE: [f64; 2] = [0.0, 1e9];
/// Any number.
const ANY: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

impl Variable {
    /// A parameter: a number with a unit, within a range.
    pub(crate) const fn real(name: Text, unit: Text, start: f64, range: [f64; 2], says: Text) -> Variable {
        Variable { name, kind: FmiType::Real(unit), role: FmiRole::Parameter, start, range, says }
    }

    /// A parameter: a whole number within a range.
    pub(crate) const fn whole(name: Text, start: f64, range: [f64; 2], says: Text) -> Variable {
        Variable { name, kind: FmiType::Integer, role: FmiRole::Parameter, start, range, says }
    }

    /// A parameter: yes or no.
    pub(crate) const fn boolean(name: Text, start: bool, says: Text) -> Variable {
        let start = if start { 1.0 } else { 0.0 };
        Variable { name, kind: FmiType::Boolean, role: FmiRole::Parameter, start, range: ANY, says }
    }

    /// One of a list.
    pub(crate) const fn choice(name: Text, of: &'static Choices, role: FmiRole, start: f64, says: Text) -> Variable {
        Variable { name, kind: FmiType::Choice(of), role, start, range: ANY, says }
    }

    /// An input.
    pub(crate) const fn input(name: Text, unit: Text, start: f64, says: Text) -> Variable {
        Variable { name, kind: FmiType::Real(unit), role: FmiRole::Input, start, range: ANY, says }
    }

    /// An output that changes in steps.
    pub(crate) const fn output(name: Text, kind: FmiType, says: Text) -> Variable {
        Variable { name, kind, role: FmiRole::Output, start: 0.0, range: ANY, says }
    }

    /// An output that changes all the time.
    pub(crate) const fn motion(name: Text, unit: Text, says: Text) -> Variable {
        Variable { name, kind: FmiType::Real(unit), role: FmiRole::Motion, start: 0.0, range: ANY, says }
    }

    /// A constant.
    pub(crate) const fn constant(name: Text, kind: FmiType, says: Text) -> Variable {
        Variable { name, kind, role: FmiRole::Constant, start: 0.0, range: ANY, says }
    }

    /// Whether it is an output.
    pub const fn is_output(&self) -> bool {
        matches!(self.role, FmiRole::Output | FmiRole::Motion)
    }

    /// Least and largest value that is taken.
    pub(crate) fn bounds(&self) -> [f64; 2] {
        match self.kind {
            FmiType::Boolean => [0.0, 1.0],
            FmiType::Choice(choices) => [0.0, choices.items.len() as f64 - 1.0],
            _ => self.range,
        }
    }

    /// Whether an importer may set it to this value: a finite number in its range, whole where it has to be.
    pub fn allows(&self, value: f64) -> bool {
        let [least, most] = self.bounds();
        let whole = matches!(self.kind, FmiType::Real(_)) || value == value.trunc();
        // What an input may not be is said when it is used: a sensor may fail.
        self.role == FmiRole::Input || (value.is_finite() && value >= least && value <= most && whole)
    }
}

/// The models of this library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelKind {
    /// The core's joint over a table.
    Compensation,
    /// A joint with mass.
    Joint,
}

impl ModelKind {
    /// Both.
    pub const ALL: [ModelKind; 2] = [ModelKind::Compensation, ModelKind::Joint];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            ModelKind::Compensation => "compensation",
            ModelKind::Joint => "joint",
        }
    }

    /// Its name in an FMU: that of its library, too.
    pub fn identifier(self) -> String {
        format!("flexspline_{}", self.name())
    }

    /// Its variables.
    pub const fn variables(self) -> &'static [Variable] {
        match self {
            ModelKind::Compensation => crate::compensation::VARIABLES,
            ModelKind::Joint => crate::joint::VARIABLES,
        }
    }

    /// Where a variable of this name is.
    pub fn place(self, name: &str) -> Option<usize> {
        self.variables().iter().position(|variable| variable.name == name)
    }
}

/// A list of variables, and a constant for the place of each.
macro_rules! variables {
    ($($place:ident => $variable:expr;)+) => {
        // A model need not look at all of them.
        #[allow(clippy::upper_case_acronyms, non_camel_case_types, dead_code)]
        enum VariablePlace {
            $($place),+
        }
        $(#[allow(dead_code)]
        const $place: usize = VariablePlace::$place as usize;)+

        /// All of them.
        pub(crate) const VARIABLES: &[Variable] = &[$($variable),+];
    };
}
pub(crate) use variables;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_have_names_of_their_own_known_units_and_starts_that_they_allow() {
        for kind in ModelKind::ALL {
            for (place, variable) in kind.variables().iter().enumerate() {
                assert_eq!(kind.place(variable.name), Some(place), "{}", variable.name);
                assert!(variable.is_output() || variable.allows(variable.start), "{}", variable.name);
                if let FmiType::Real(unit) = variable.kind {
                    assert!(UNITS.iter().any(|(name, ..)| *name == unit), "{}: {unit}", variable.name);
                }
            }
        }
    }
}
