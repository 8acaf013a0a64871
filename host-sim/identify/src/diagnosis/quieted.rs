//! A torque that is read with more noise than the output shows: what a torque does to the output is then not what its
//! column says row by row. Laws of the torque would be told by its noise: what lags it loses that noise, and looks like
//! creep.

use super::channels::slope_arcsec;
use super::rows::quantile;
use crate::measurement::Session;
use crate::nominal::Nominal;
use flexspline_base::robust::white_noise;
use flexspline_base::units::ARCSEC_PER_RAD;

/// The noise of the torque, wound up, is this multiple of that of the output: a real load would wind it up. *Guess*.
const LOUDER: f64 = 1.5;
/// Rows on either side of which the mean is taken, … *Guess*: 17 rows have a quarter of the noise of one.
const BESIDE: usize = 8;
/// … as far as they are no farther from the row than this number of standard deviations of the noise: a step of the
/// load stays one (the sigma filter of Lee 1983, with 2). *Guess*: 2.8 standard deviations of the difference of two
/// rows.
const NEAR: f64 = 4.0;

/// Takes the noise out of the torque where it is not the load's, and gives a note that says so.
pub(super) fn torque(sessions: &mut [Session], nominal: &Nominal) -> Option<String> {
    let torques = || sessions.iter().filter_map(|session| session.torque_n_m.as_deref());
    let noise = white_noise(torques());
    let load = quantile(torques().flatten().map(|torque| torque.abs()), 0.98);
    let of_output = ARCSEC_PER_RAD * white_noise(sessions.iter().map(|session| session.error_rad.as_slice()));
    let wound_up = slope_arcsec(nominal, load) * noise;
    if noise <= 0.0 || wound_up <= LOUDER * of_output {
        return None;
    }
    sessions.iter_mut().for_each(|session| quiet(session, NEAR * noise));
    Some(format!(
        "the torque is read with a noise of {noise:.3} N·m, which would move the output by {wound_up:.1} arcsec and \
         does not ({of_output:.1} arcsec is there): each row has the mean of up to {BESIDE} rows on either side, \
         steps of the load left as they are"
    ))
}

/// Mean of each row with its neighbours that are as close as noise may bring them.
fn quiet(session: &mut Session, near: f64) {
    let Some(torque) = &mut session.torque_n_m else { return };
    let mean = |k: usize| {
        let around = &torque[k.saturating_sub(BESIDE)..(k + BESIDE + 1).min(torque.len())];
        let (sum, count) = around
            .iter()
            .filter(|beside| (*beside - torque[k]).abs() <= near)
            .fold((0.0, 0usize), |(sum, count), beside| (sum + beside, count + 1));
        sum / count.max(1) as f64
    };
    *torque = (0..torque.len()).map(mean).collect();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesize::catalogue_drive;

    /// A load in steps, read with `noise` N·m, on a drive whose output shows `shown` of it.
    fn recording(noise: f64, shown: f64, nominal: &Nominal) -> Vec<Session> {
        let mut random = fastrand::Rng::with_seed(4);
        let mut session = Session::default();
        let (mut torque, mut error) = (Vec::new(), Vec::new());
        for k in 0..4000usize {
            let load = if (k / 250).is_multiple_of(2) { 60.0 } else { -60.0 };
            let of_reading = noise * (random.f64() + random.f64() + random.f64() + random.f64() - 2.0) * 3f64.sqrt();
            torque.push(load + of_reading);
            let read = random.f64() - 0.5;
            error.push((nominal.wind_up_arcsec(load + shown * of_reading) + read) / ARCSEC_PER_RAD);
        }
        (session.torque_n_m, session.error_rad) = (Some(torque), error);
        vec![session]
    }

    #[test]
    fn noise_of_the_reading_is_taken_out_and_steps_and_real_loads_are_not() {
        let nominal = catalogue_drive();
        let mut noisy = recording(2.0, 0.0, &nominal);
        assert!(torque(&mut noisy, &nominal).is_some());
        let read = noisy[0].torque_n_m.clone().unwrap();
        let off = |k: usize| read[k].abs() - 60.0;
        let left = (0..4000).map(|k| off(k).powi(2)).sum::<f64>() / 4000.0;
        assert!(left.sqrt() < 0.6, "{left}");
        assert!((0..4000).all(|k| off(k).abs() < 3.0), "a step is blurred");
        let mut real = recording(2.0, 1.0, &nominal);
        let before = real[0].torque_n_m.clone();
        assert!(torque(&mut real, &nominal).is_none() && real[0].torque_n_m == before);
    }
}
