//! What to record next, to tell look-alikes apart.

/// Chooses from a menu.
#[must_use]
pub fn next(cause: &str, alike: &[String]) -> Option<String> {
    let any = |names: &[&str]| names.contains(&cause) || alike.iter().any(|a| names.contains(&a.as_str()));
    let text = if any(&["gravity_side_load", "gravity_torque"]) {
        "the same run with the drive turned by 90 and 180 degrees against gravity"
    } else if any(&["thermal_clearance", "thermal_stiffness", "wear", "lubricant_viscosity"]) {
        "a soak at three temperatures, cold, hot and cold again, with torque steps of both signs at each"
    } else if any(&["sensor_latency", "torsional_resonance"]) {
        "torque steps at standstill, and constant speed slow and fast in both directions"
    } else if any(&["torsional_hysteresis", "stiffness_hardening", "stiffness_error", "backlash_growth"]) {
        "torque triangles of three amplitudes through zero, generator at rest"
    } else {
        "at least one output turn in each direction, at two torques of either sign"
    };
    Some(text.to_owned())
}
