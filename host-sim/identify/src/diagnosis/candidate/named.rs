//! Columns and shape parameters by name: what a law says of its own coefficients stays true when a column is put in
//! between.

use super::Shape;
use crate::causes::ParameterName;

/// The role of a column of a law, to find its coefficient again. A wave is two columns of one role, cosine and sine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tag(pub &'static str);

impl Tag {
    /// A column whose coefficient nobody asks for.
    pub(crate) const PLAIN: Tag = Tag("");
    /// The law at its size: the only column that it has, or the one that all others are deviations of.
    pub(crate) const SIZE: Tag = Tag("size");
    /// The wave that a law is: two columns.
    pub(crate) const WAVE: Tag = Tag("wave");
}

/// Coefficients with what their columns are.
#[derive(Clone, Copy, Debug)]
pub struct Coefficients<'c> {
    roles: &'c [Tag],
    values: &'c [f64],
    sizes: Option<&'c [f64]>,
}

impl<'c> Coefficients<'c> {
    /// Coefficients of columns of these roles.
    pub fn new(roles: &'c [Tag], values: &'c [f64]) -> Coefficients<'c> {
        Coefficients { roles, values, sizes: None }
    }

    /// With the root mean squares of the columns, as many as there are roles.
    pub(crate) fn of_sizes(self, sizes: &'c [f64]) -> Coefficients<'c> {
        Coefficients { sizes: Some(sizes), ..self }
    }

    /// Those of all columns of a role, in their order.
    pub fn all(self, role: Tag) -> impl Iterator<Item = f64> {
        self.roles.iter().zip(self.values).filter(move |(r, _)| **r == role).map(|(_, c)| *c)
    }

    /// That of the first column of a role. What has no column adds nothing: 0.
    pub fn of(self, role: Tag) -> f64 {
        self.all(role).next().unwrap_or(0.0)
    }

    /// Root mean square of the part of the first column of a role, without a sign: 0 where the law has no such column
    /// here. Where the columns are not known all are taken to be alike.
    pub(crate) fn adds(self, role: Tag) -> f64 {
        let Some(at) = self.roles.iter().position(|of| *of == role) else { return 0.0 };
        let size = self.sizes.and_then(|sizes| sizes.get(at)).copied().unwrap_or(1.0);
        self.values.get(at).map_or(0.0, |coefficient| (coefficient * size).abs())
    }

    /// Those of the cosine and the sine of a wave; 0 where the law has no such wave here.
    pub fn wave(self, role: Tag) -> [f64; 2] {
        let mut both = self.all(role);
        [0, 1].map(|_| both.next().unwrap_or(0.0))
    }
}

/// Values of the shape parameters of a law.
#[derive(Clone, Copy, Debug)]
pub struct Shaped<'s> {
    shapes: &'s [Shape],
    values: &'s [f64],
}

impl<'s> Shaped<'s> {
    /// Values of these shape parameters.
    pub fn new(shapes: &'s [Shape], values: &'s [f64]) -> Shaped<'s> {
        Shaped { shapes, values }
    }

    /// The value of a shape parameter, if the law has it here.
    pub fn get(self, name: ParameterName) -> Option<f64> {
        self.shapes.iter().zip(self.values).find(|(shape, _)| shape.name == name).map(|(_, value)| *value)
    }

    /// The value of a shape parameter that the law always has.
    ///
    /// # Panics
    /// The law has none of this name.
    pub fn of(self, name: ParameterName) -> f64 {
        self.get(name).unwrap_or_else(|| panic!("a law asks for {name}, which is none of its shape parameters"))
    }

    /// All values, with some of them changed.
    pub fn with(self, changed: &[(ParameterName, f64)]) -> Vec<f64> {
        let new = |name: ParameterName| changed.iter().find(|(n, _)| *n == name).map(|(_, value)| *value);
        self.shapes.iter().zip(self.values).map(|(shape, value)| new(shape.name).unwrap_or(*value)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ParameterName as Name;

    #[test]
    fn a_coefficient_is_found_wherever_its_column_stands() {
        let wave = Tag("wave");
        let values = [7.0, 1.0, 2.0, 3.0];
        for roles in [[Tag::PLAIN, wave, wave, Tag::SIZE], [Tag::SIZE, wave, wave, Tag::PLAIN]] {
            let c = Coefficients::new(&roles, &values);
            assert_eq!(c.wave(wave), [1.0, 2.0]);
            assert_eq!(c.of(Tag::SIZE), if roles[0] == Tag::SIZE { 7.0 } else { 3.0 });
            assert_eq!((c.of(Tag("none")), c.wave(Tag("none"))), (0.0, [0.0; 2]));
        }
    }

    #[test]
    fn a_shape_parameter_is_found_and_changed_by_its_name() {
        let shapes = [Shape::evenly(Name::LagS, 0.0, 9.0, 1), Shape::angle(Name::PhaseRad, 6.0, 1)];
        let shape = Shaped::new(&shapes, &[4.0, 2.0]);
        assert_eq!((shape.of(Name::PhaseRad), shape.get(Name::Exponent)), (2.0, None));
        assert_eq!(shape.with(&[(Name::LagS, 5.0)]), [5.0, 2.0]);
    }
}
