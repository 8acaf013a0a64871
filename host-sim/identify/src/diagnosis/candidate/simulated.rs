//! A cause of known parameters: the way back from the parameters of a report to its law.

use std::borrow::Cow;

use super::{Acting, Excitation, Law, Named, Shape, Tag, Tolerance};
use crate::causes::ParameterName;

/// The values of the parameters of a cause, by their names.
pub(crate) type Values<'v> = &'v dyn Fn(ParameterName) -> f64;

/// A law with numbers: values of its shape parameters, and coefficients that are not the usual ones.
pub(crate) struct Simulated {
    law: Law,
    shape: Vec<f64>,
    coefficients: Vec<(Tag, f64)>,
}

impl Law {
    /// The law with these numbers. A shape parameter that is not among them has the value of the parameter of the cause
    /// that is called so, or else its least one; a column has its usual coefficient: 0 for a deviation. Coefficients of
    /// one role are those of its columns in their order.
    pub(super) fn with(
        self,
        p: Values<'_>,
        shape: &[Named],
        coefficients: impl IntoIterator<Item = (Tag, f64)>,
    ) -> Simulated {
        let parameters = self.cause().map_or(&[][..], |cause| cause.spec().parameters);
        let of_cause = |name: ParameterName| parameters.iter().any(|of| of.name == name).then(|| p(name));
        let given = |name: ParameterName| shape.iter().find(|(of, _)| *of == name).map(|(_, value)| *value);
        let value = |shape: &Shape| given(shape.name).or_else(|| of_cause(shape.name)).unwrap_or(shape.low);
        let shape = self.shapes.iter().map(value).collect();
        Simulated { law: self, shape, coefficients: coefficients.into_iter().collect() }
    }
}

impl Simulated {
    /// The cause as if it had been fitted to these rows.
    pub(crate) fn acting(&self, on: &Excitation<'_>) -> Acting<'_> {
        let mut given = self.coefficients.clone();
        let columns = self.law.columns(on, &self.shape);
        let coefficient = |column: &super::Regressor| match given.iter().position(|(role, _)| *role == column.role) {
            Some(at) => given.remove(at).1,
            None => match column.tolerance {
                Tolerance::Main(prior) => prior.mean,
                Tolerance::Nuisance(_) | Tolerance::Beside(_) => 0.0,
            },
        };
        let coefficients = columns.iter().map(coefficient).collect();
        let roles = columns.iter().map(|column| column.role).collect();
        Acting { law: Cow::Borrowed(&self.law), values: self.shape.clone(), roles, coefficients }
    }
}
