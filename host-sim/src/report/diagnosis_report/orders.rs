//! Which orders each cause makes, for the marks in the spectra.

use crate::diagnosis::report::Cause;
use crate::nominal::{Fixed, Nominal};
use crate::residual::Axis;

/// What an order is counted against.
#[derive(Clone, Copy, PartialEq)]
enum Turn {
    /// The wave on the flexspline.
    Flexspline,
    /// The wave on the circular spline.
    CircularSpline,
    /// The generator.
    Generator,
    /// The output.
    Output,
}

impl Turn {
    /// Turns of it in a generator turn.
    fn per_generator_turn(self, nominal: &Nominal) -> f64 {
        let against_output = Axis::GeneratorLessOutput.turns_per_generator_turn(nominal.ratio);
        let flexspline_turns = nominal.teeth.is_some_and(|teeth| teeth.fixed == Fixed::CircularSpline);
        match self {
            Turn::Flexspline if flexspline_turns => against_output,
            Turn::CircularSpline if !flexspline_turns => against_output,
            Turn::Flexspline | Turn::CircularSpline | Turn::Generator => 1.0,
            Turn::Output => 1.0 / nominal.ratio.abs(),
        }
    }
}

/// Orders of a cause, each counted against its own turn.
fn of(cause: &Cause, nominal: &Nominal) -> Vec<(Turn, f64)> {
    let all = |turn: Turn, orders: &[f64]| orders.iter().map(|order| (turn, *order)).collect::<Vec<_>>();
    let parameter = |name: &str| cause.parameters.get(name).map(|p| p.value);
    let harmonic = || match parameter("harmonic") {
        Some(harmonic) if harmonic >= 1.0 => vec![harmonic.round()],
        _ => vec![1.0, 2.0],
    };
    match cause.name.as_str() {
        "circular_spline_eccentricity" => all(Turn::CircularSpline, &[2.0, 4.0]),
        "flexspline_runout" => all(Turn::Flexspline, &[2.0, 4.0]),
        "circular_spline_ovality" => all(Turn::CircularSpline, &[2.0]),
        "flexspline_pitch_error" => all(Turn::Flexspline, &harmonic()),
        "circular_spline_pitch_error" => all(Turn::CircularSpline, &harmonic()),
        "generator_eccentricity" => [all(Turn::Flexspline, &[1.0]), all(Turn::CircularSpline, &[1.0])].concat(),
        "cam_form_error" => {
            let teeth = f64::from(nominal.teeth_or_of_two_waves().flexspline);
            all(Turn::Generator, &[4.0, 6.0, teeth])
        }
        "damaged_tooth" => {
            let ring = parameter("wheel").or_else(|| parameter("on_circular_spline")).is_some_and(|wheel| wheel > 0.5);
            all(if ring { Turn::CircularSpline } else { Turn::Flexspline }, &[2.0, 4.0, 6.0])
        }
        "gravity_side_load" => all(Turn::Generator, &[2.0, 4.0]),
        "generator_encoder_eccentricity" => all(Turn::Generator, &[1.0]),
        "output_encoder_eccentricity" | "gravity_torque" => all(Turn::Output, &[1.0]),
        _ => Vec::new(),
    }
}

/// Orders of a cause in the spectrum of an angle.
pub(super) fn along(cause: &Cause, axis: Axis, nominal: &Nominal) -> Vec<f64> {
    let turns = axis.turns_per_generator_turn(nominal.ratio).abs();
    of(cause, nominal).into_iter().map(|(turn, order)| order * turn.per_generator_turn(nominal) / turns).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesize::catalogue_drive;
    use std::collections::BTreeMap;

    #[test]
    fn an_error_of_the_ring_stands_at_a_whole_order_of_its_own_turn() {
        let cause = |name: &str| Cause {
            name: name.into(),
            confidence: 0.9,
            parameters: BTreeMap::new(),
            held_out_gain: 0.5,
            size_arcsec: 5.0,
            look_alikes: Vec::new(),
        };
        let nominal = catalogue_drive();
        let ring = cause("circular_spline_ovality");
        for (axis, order) in
            [(Axis::Generator, 2.0 * 94.0 / 95.0), (Axis::GeneratorLessOutput, 2.0), (Axis::Output, 2.0 * 94.0)]
        {
            let found = along(&ring, axis, &nominal);
            assert!((found[0] - order).abs() < 1e-9, "{axis:?}: {found:?}");
        }
        // With the circular spline fixed it is the flexspline that turns.
        let mut other = nominal.clone();
        other.teeth = other.teeth.map(|teeth| crate::nominal::Teeth { fixed: Fixed::CircularSpline, ..teeth });
        other.ratio = -94.0;
        assert!((along(&ring, Axis::Generator, &other)[0] - 2.0).abs() < 1e-9);
        let runout = along(&cause("flexspline_runout"), Axis::Generator, &other);
        assert!((runout[0] - 2.0 * 95.0 / 94.0).abs() < 1e-9, "{runout:?}");
        assert_eq!(along(&cause("sensor_latency"), Axis::Generator, &nominal), [] as [f64; 0]);
    }
}
