//! A resolution so coarse that no noise blurs it.

use super::lattice::lattice;
use super::{Findings, of_rows};
use crate::measurement::Session;
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::robust::white_noise;

const ARCSEC: f64 = std::f64::consts::PI / 648_000.0;
/// Steps at the output below this are those of good encoders (19 bits a turn), and below what a drive repeats.
const COARSE_RAD: f64 = 2.5 * ARCSEC;
/// Noise of more than this share of a step blurs it, so that averages go below the step; a step alone leaves 0.29 of it.
const BLURRED: f64 = 0.7;

/// Names a resolution of output or generator that is coarse at the output; nothing can be done about it.
pub(in crate::measurement) fn check(sessions: &[Session], gear: &Gear, error_recorded: bool, findings: &mut Findings) {
    let Some(session) = sessions.iter().max_by_key(|session| session.len()) else { return };
    let noise = white_noise(sessions.iter().map(|session| session.error_rad.as_slice()));
    let (channel, step) = if error_recorded {
        (Quantity::Error, lattice(&session.error_rad))
    } else {
        (Quantity::Output, lattice(&session.output_rad(gear.ratio)))
    };
    let at_output = [(channel, step), (Quantity::Generator, lattice(&session.generator_rad).map(|q| q / gear.ratio.abs()))];
    for (channel, step) in at_output {
        let Some(step) = step.filter(|step| *step >= COARSE_RAD && noise <= BLURRED * step) else { continue };
        let mut fault = of_rows(session, FaultName::Quantisation, 0..session.len());
        (fault.channel, fault.treatment) = (Some(channel), Treatment::Kept);
        fault.size_arcsec = Some(step / ARCSEC);
        fault.what = format!(
            "the {channel} has a resolution of {:.2} arcsec at the output, and too little noise to blur it ({:.2} arcsec)",
            step / ARCSEC,
            noise / ARCSEC
        );
        findings.faults.push(fault);
    }
}
