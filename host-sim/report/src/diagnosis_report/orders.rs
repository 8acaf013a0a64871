//! Which orders each cause makes, for the marks in the spectra.

use flexspline::FixedMember;
use flexspline_identify::causes::{Multiple, ParameterName, Turn};
use flexspline_identify::diagnosis::report::Cause;
use flexspline_identify::nominal::Nominal;
use flexspline_identify::residual::Axis;

/// Turns of what an order is counted against in a generator turn.
fn per_generator_turn(turn: Turn, cause: &Cause, nominal: &Nominal) -> f64 {
    let against_output = Axis::GeneratorLessOutput.turns_per_generator_turn(nominal.ratio);
    let flexspline_turns = nominal.teeth.is_some_and(|teeth| teeth.fixed == FixedMember::CircularSpline);
    let on_flexspline = if flexspline_turns { against_output } else { 1.0 };
    let on_circular_spline = if flexspline_turns { 1.0 } else { against_output };
    match turn {
        Turn::Flexspline => on_flexspline,
        Turn::CircularSpline => on_circular_spline,
        Turn::OfWheel if parameter(cause, ParameterName::Wheel).is_some_and(|wheel| wheel > 0.5) => on_circular_spline,
        Turn::OfWheel => on_flexspline,
        Turn::Generator => 1.0,
        Turn::OfEncoder if parameter(cause, ParameterName::Encoder).is_none_or(|encoder| encoder < 0.5) => 1.0,
        Turn::Output | Turn::OfEncoder => 1.0 / nominal.ratio.abs(),
    }
}

fn parameter(cause: &Cause, name: ParameterName) -> Option<f64> {
    cause.parameters.get(name.as_str()).map(|p| p.value)
}

/// How often a wave comes in its turn.
fn times(multiple: Multiple, cause: &Cause, nominal: &Nominal) -> Vec<f64> {
    match multiple {
        Multiple::Fixed(order) => vec![order],
        Multiple::Harmonic => match parameter(cause, ParameterName::Harmonic) {
            Some(harmonic) if harmonic >= 1.0 => vec![harmonic.round()],
            _ => vec![1.0, 2.0],
        },
        Multiple::ToothMesh => vec![f64::from(nominal.teeth_or_of_two_waves().flexspline)],
    }
}

/// Orders of a cause in the spectrum of an angle.
pub(super) fn along(cause: &Cause, axis: Axis, nominal: &Nominal) -> Vec<f64> {
    let turns = axis.turns_per_generator_turn(nominal.ratio).abs();
    let of = |(turn, multiple): &(Turn, Multiple)| {
        let per_turn = per_generator_turn(*turn, cause, nominal) / turns;
        times(*multiple, cause, nominal).into_iter().map(move |order| order * per_turn).collect::<Vec<f64>>()
    };
    cause.name.orders().iter().flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_identify::causes::CauseName;
    use flexspline_identify::synthesize::catalogue_drive;
    use std::collections::BTreeMap;

    #[test]
    fn an_error_of_the_ring_stands_at_a_whole_order_of_its_own_turn() {
        let cause = |name: CauseName| Cause {
            name,
            confidence: 0.9,
            parameters: BTreeMap::new(),
            held_out_gain: 0.5,
            size_arcsec: 5.0,
            look_alikes: Vec::new(),
            look_alike_outside: None,
        };
        let nominal = catalogue_drive();
        let ring = cause(CauseName::CircularSplineOvality);
        for (axis, order) in
            [(Axis::Generator, 2.0 * 94.0 / 95.0), (Axis::GeneratorLessOutput, 2.0), (Axis::Output, 2.0 * 94.0)]
        {
            let found = along(&ring, axis, &nominal);
            assert!((found[0] - order).abs() < 1e-9, "{axis:?}: {found:?}");
        }
        // With the circular spline fixed it is the flexspline that turns.
        let mut other = nominal.clone();
        other.teeth = other
            .teeth
            .map(|teeth| flexspline_identify::nominal::Teeth { fixed: FixedMember::CircularSpline, ..teeth });
        other.ratio = -94.0;
        assert!((along(&ring, Axis::Generator, &other)[0] - 2.0).abs() < 1e-9);
        let runout = along(&cause(CauseName::FlexsplineRunout), Axis::Generator, &other);
        assert!((runout[0] - 2.0 * 95.0 / 94.0).abs() < 1e-9, "{runout:?}");
        assert_eq!(along(&cause(CauseName::SensorLatency), Axis::Generator, &nominal), [] as [f64; 0]);
    }
}
