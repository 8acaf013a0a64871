//! Causes among each other. Most add up. Some do not: a load that gravity adds passes through the springs that slip,
//! makes the load ring and turns the flank over like any other load; a clearance that has grown decides when an
//! eccentric wheel binds; and two wheels off their axis, or one under a generator that is, meet in the same two
//! zones of teeth, of which only the one ahead carries.
//!
//! So a law is evaluated on the excitation as the causes that act on it leave it. Of two that meet in the zones the
//! later one is evaluated with the earlier in place, and together they make what both do.

use std::borrow::Cow;

use super::{Coefficients, Excitation, Law, Tag};
use crate::causes::Kin;
use crate::diagnosis::base::Base;
use crate::diagnosis::rows::{Rows, add_scaled, combined};

/// How far causes bring one zone of teeth ahead of the other, row by row, arcsec: on the flank that turns the output
/// forward, and on the other one.
pub(crate) type Zones = [Vec<f64>; 2];

/// A cause as it was fitted.
#[derive(Clone)]
pub(crate) struct Acting<'l> {
    /// Its law.
    pub law: Cow<'l, Law>,
    /// Shape parameters.
    pub values: Vec<f64>,
    /// The roles of its columns.
    pub roles: Vec<Tag>,
    /// Coefficients of its columns.
    pub coefficients: Vec<f64>,
}

/// The excitation of a cause as others leave it.
pub(crate) struct Among {
    /// Under the load with what they add.
    loaded: Option<(Rows, Base)>,
    /// Change of half the clearance by them, arcsec.
    widened: Option<Vec<f64>>,
    zones: Option<Zones>,
}

/// The base parameter that a stiffness error is out of tolerance of.
pub(super) const STIFFNESS: &str = "stiffness";

impl Law {
    /// Whether this cause changes what another one does. Two that meet in the zones act on each other: the order
    /// decides.
    pub(crate) fn acts_on(&self, other: &Law) -> bool {
        // A spring that is out of tolerance is one under the torque recorded.
        self.is_load() && !other.is_load() && other.acts.tolerance_of != Some(STIFFNESS)
            || other.acts.meets_zones && (self.acts.zones.is_some() || self.wrong.kin == Kin::Clearance)
    }

    /// Whether two act on each other.
    pub(crate) fn meets(&self, other: &Law) -> bool {
        self.acts.meets_zones && other.acts.meets_zones
    }
}

impl Among {
    /// The excitation that `acting` causes leave; nothing where none of them does anything to others.
    pub fn of(on: &Excitation<'_>, acting: &[Acting<'_>]) -> Option<Among> {
        let mut among = Among { loaded: None, widened: None, zones: None };
        for cause in acting {
            if let Some(load) = cause.law.load(on, &cause.values) {
                let (rows, _) = among.loaded.get_or_insert_with(|| (on.rows.clone(), on.base.without_floating()));
                add_scaled(&mut rows.torque, &load, 1.0);
            }
        }
        if let Some((rows, base)) = &mut among.loaded {
            base.load_with(rows, on.nominal);
        }
        let (mut widened, mut zones): (Option<Vec<f64>>, Option<Zones>) = (None, None);
        {
            let on = among.excitation(on);
            for cause in acting {
                if cause.law.wrong.kin == Kin::Clearance {
                    let sum = widened.get_or_insert_with(|| vec![0.0; on.rows.len()]);
                    add_scaled(sum, &half_width(&on, cause), 1.0);
                }
                let coefficients = Coefficients::new(&cause.roles, &cause.coefficients);
                if let Some(more) = cause.law.zones(&on, &cause.values, coefficients) {
                    let sum = zones.get_or_insert_with(|| [0; 2].map(|_| vec![0.0; on.rows.len()]));
                    sum.iter_mut().zip(&more).for_each(|(sum, more)| add_scaled(sum, more, 1.0));
                }
            }
        }
        (among.widened, among.zones) = (widened, zones);
        let changed = among.loaded.is_some() || among.widened.is_some() || among.zones.is_some();
        changed.then_some(among)
    }

    /// The excitation as it is left.
    pub(crate) fn excitation<'a>(&'a self, on: &Excitation<'a>) -> Excitation<'a> {
        let (rows, base) = self.loaded.as_ref().map_or((on.rows, on.base), |(rows, base)| (rows, base));
        Excitation { rows, base, widened: self.widened.as_deref(), zones: self.zones.as_ref(), ..*on }
    }
}

/// The excitation as others leave it, or as it was recorded.
pub(crate) fn left_by<'a>(among: Option<&'a Among>, on: &Excitation<'a>) -> Excitation<'a> {
    among.map_or(*on, |among| among.excitation(on))
}

/// Change of half the clearance by a cause: its effect where the forward flank carries.
fn half_width(on: &Excitation<'_>, cause: &Acting<'_>) -> Vec<f64> {
    let mut forward = on.base.without_floating();
    forward.flank.fill(1.0);
    let on = Excitation { base: &forward, ..*on };
    let columns = cause.law.columns(&on, &cause.values);
    combined(on.rows.len(), columns.iter().map(|column| column.values.as_slice()), &cause.coefficients)
}

/// Columns of causes that are there together, in their order.
pub(crate) fn together(on: &Excitation<'_>, causes: &[Acting<'_>]) -> Vec<Vec<super::Regressor>> {
    (0..causes.len())
        .map(|k| {
            let others = causes.iter().enumerate().filter(|(j, other)| {
                *j != k && other.law.acts_on(&causes[k].law) && (*j < k || !other.law.meets(&causes[k].law))
            });
            let acting: Vec<Acting<'_>> = others.map(|(_, acting)| acting.clone()).collect();
            let among = Among::of(on, &acting);
            causes[k].law.columns(&left_by(among.as_ref(), on), &causes[k].values)
        })
        .collect()
}

/// What each of the causes that are there together adds to the error, arcsec, row by row.
pub(crate) fn added(on: &Excitation<'_>, causes: &[Acting<'_>]) -> Vec<Vec<f64>> {
    let of = |(cause, columns): (&Acting<'_>, Vec<super::Regressor>)| {
        combined(on.rows.len(), columns.iter().map(|column| column.values.as_slice()), &cause.coefficients)
    };
    causes.iter().zip(together(on, causes)).map(of).collect()
}
