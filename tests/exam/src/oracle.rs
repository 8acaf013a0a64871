//! Best knowledge that a case allows: how far an effect stands out of the noise once the
//! catalogue's parameters have floated, and which causes are like it on these rows.
//!
//! An effect is weighed by what it adds to the residual of the catalogue's model, read at the angles and the torque
//! that the log itself would hold without noise. A rival is like it where the span of the rival's signatures leaves
//! less than can be seen. The span is linear and wide (every phase, every flank, several laws), so it rather finds one
//! look-alike too many.

use std::f64::consts::TAU;

use crate::ARCSEC;
use crate::cause::Cause;
use crate::drive::{
    BACKLASH_SPREAD, CIRCULAR_SPLINE, Drive, FLEXSPLINE, FRICTION_SPREAD, HARMONIC_SPREAD, PHASE_SPREAD_RAD,
    STIFFNESS_SPREAD, Unit,
};
use crate::noise::{Sensors, Whitening};
use crate::record::Record;
use crate::scales::{FREE, LEAST_D, SPREAD, Scales, Weight, difference, least_rms_arcsec};

/// Rows on which it works.
const ROWS: usize = 8000;

/// Error (arcsec) of the catalogue's model with the parameters of a unit, as the contract words it: lines, play that
/// the load or the friction holds, wind-up; and the flank on which the model stands.
pub fn nominal(drive: &Drive, unit: &Unit, generator_rad: &[f64], torque_n_m: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let half = 0.5 * drive.backlash_arcsec * unit.backlash;
    let friction = drive.friction_torque_n_m * unit.friction;
    let mut rest: Option<f64> = None;
    let rows = generator_rad.iter().zip(torque_n_m);
    rows.map(|(psi, torque)| {
        let exact = psi / drive.ratio() * ARCSEC;
        let teeth = exact + drive.lines_arcsec(unit, *psi);
        let wanted = if torque.abs() > friction { teeth + half * torque.signum() } else { rest.unwrap_or(teeth) };
        let position = wanted.clamp(teeth - half, teeth + half);
        rest = Some(position);
        let flank = if half > 0.0 { ((position - teeth) / half).clamp(-1.0, 1.0) } else { torque.signum() };
        (position - exact + drive.wind_up_arcsec(*torque) / unit.stiffness, flank)
    })
    .unzip()
}

/// Residual of the catalogue's model at clean readings, arcsec.
pub fn residual(drive: &Drive, run: &Record) -> Vec<f64> {
    let model = nominal(drive, &Unit::nominal(drive), &run.generator_read_rad, &run.torque_n_m).0;
    difference(&run.error_arcsec(drive.ratio()), &model)
}

/// 1 where the load lies on a flank, 0 near the friction of the hub and for a tenth of a second after a change of
/// flanks.
fn settled(drive: &Drive, torque_n_m: &[f64], flank: &[f64]) -> Vec<f64> {
    let mut since = 0;
    (0..flank.len())
        .map(|at| {
            let changed = at > 0 && (flank[at] - flank[at - 1]).abs() > 0.5;
            since = if changed { 0 } else { since + 1 };
            let near = torque_n_m[at].abs() < 1.4 * drive.friction_torque_n_m;
            if near || (since < 12 && at > 12) { 0.0 } else { 1.0 }
        })
        .collect()
}

/// The rows of one case, ready to weigh effects on.
pub struct Oracle<'a> {
    drive: &'a Drive,
    thinned: Record,
    /// Generator as read, at the thinned rows.
    generator_rad: Vec<f64>,
    output_rad: Vec<f64>,
    flank: Vec<f64>,
    picks: Vec<usize>,
    /// Rows that are weighed: 1, or 0 while a load with inertia is on its way through the clearance.
    weighed: Vec<f64>,
    scales: Scales,
    /// White noise with all that makes the reading scatter, arcsec.
    pub floor_arcsec: f64,
}

impl<'a> Oracle<'a> {
    /// For a log without hidden effects. `jitter_s` is the scatter of the instants at which the angles are read, where
    /// the drive moves while it is read; `zeroed`: the output was set to zero in each session.
    pub fn new(
        drive: &'a Drive,
        unit: &Unit,
        run: &Record,
        sensors: &Sensors,
        jitter_s: Option<f64>,
        zeroed: bool,
    ) -> Self {
        let thin = run.time_s.len().div_ceil(ROWS);
        let picks = run.picks(thin);
        let thinned = run.thinned(thin, &picks);
        let pick = |values: &[f64]| -> Vec<f64> { picks.iter().map(|at| values[*at]).collect() };
        let fast = run.speed_rad_s.iter().map(|v| v * v).sum::<f64>() / run.speed_rad_s.len() as f64;
        let blur = jitter_s.unwrap_or(0.0) * fast.sqrt() / drive.ratio().abs() * ARCSEC;
        let floor_arcsec = sensors.floor_arcsec(drive).hypot(blur);
        let whitening =
            Whitening::new(&thinned, floor_arcsec / (thin as f64).sqrt(), sensors.wander_arcsec, sensors.wander_s);
        let model = |unit: &Unit| nominal(drive, unit, &run.generator_read_rad, &run.torque_n_m);
        let (at_unit, flank) = model(unit);
        let weighed: Vec<f64> = match jitter_s {
            Some(_) => pick(&settled(drive, &run.torque_n_m, &flank)),
            None => vec![1.0; picks.len()],
        };
        let mut floating = Vec::new();
        let count = if zeroed { thinned.session_start.len() } else { 1 };
        for session in 0..count {
            let from = thinned.session_start[session];
            let to = if zeroed { thinned.session_start.get(session + 1).copied() } else { None };
            let to = to.unwrap_or(picks.len());
            floating.push(((0..picks.len()).map(|at| f64::from(u8::from((from..to).contains(&at)))).collect(), FREE));
        }
        let mut units = vec![
            Unit { stiffness: unit.stiffness + STIFFNESS_SPREAD, ..unit.clone() },
            Unit { backlash: unit.backlash + BACKLASH_SPREAD, ..unit.clone() },
            Unit { friction: unit.friction + FRICTION_SPREAD, ..unit.clone() },
        ];
        for at in 0..unit.harmonics.len() {
            let mut louder = unit.clone();
            louder.harmonics[at].0 += HARMONIC_SPREAD;
            let mut shifted = unit.clone();
            shifted.harmonics[at].1 += PHASE_SPREAD_RAD;
            units.extend([louder, shifted]);
        }
        floating.extend(units.iter().map(|moved| (pick(&difference(&model(moved).0, &at_unit)), SPREAD)));
        for (column, _) in &mut floating {
            column.iter_mut().zip(&weighed).for_each(|(x, weight)| *x *= weight);
        }
        Self {
            drive,
            generator_rad: pick(&run.generator_read_rad),
            output_rad: pick(&run.output_read_rad),
            flank: pick(&flank),
            thinned,
            picks,
            weighed,
            scales: Scales::new(whitening, floating),
            floor_arcsec,
        }
    }

    /// Contribution of an effect, from the residuals with it and without it.
    pub fn added(&self, with: &[f64], without: &[f64]) -> Vec<f64> {
        self.picks.iter().zip(&self.weighed).map(|(at, weight)| weight * (with[*at] - without[*at])).collect()
    }

    pub fn weigh(&self, added: &[f64]) -> Weight {
        self.scales.weigh(added)
    }

    /// Causes whose signatures leave less of it than can be seen, with the distance left.
    ///
    /// Either less than [`LEAST_D`], or no more than a sixth of it and less than counts as there: who does not know the
    /// plant's own law to its last digit cannot hold such a remainder against a rival.
    pub fn look_alikes(&self, added: &[f64], own: Option<Cause>, white_arcsec: f64) -> Vec<(Cause, f64)> {
        let whole = self.weigh(added).d;
        let mut found = Vec::new();
        for &rival in Cause::ALL.iter().filter(|rival| Some(**rival) != own) {
            let span = self.span(rival);
            if span.is_empty() {
                continue;
            }
            let weighed = |column: Vec<f64>| column.iter().zip(&self.weighed).map(|(x, weight)| x * weight).collect();
            let span: Vec<_> = span.into_iter().map(weighed).collect();
            let left = self.scales.weigh_with(added, &span);
            let least = left.rms_arcsec < least_rms_arcsec(white_arcsec) && left.d < whole / 6.0;
            if left.d < LEAST_D || least {
                found.push((rival, left.d));
            }
        }
        found.sort_by(|a, b| a.1.total_cmp(&b.1));
        found
    }

    /// Columns that hold the signatures of a cause; none of one that nothing is like (a jump, a pulse).
    fn span(&self, cause: Cause) -> Vec<Vec<f64>> {
        let rated = self.drive.rated_n_m;
        let count = self.picks.len();
        let column = |f: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..count).map(f).collect() };
        let psi = |at: usize| self.generator_rad[at];
        let out = |at: usize| self.output_rad[at];
        let on_wheel = |at: usize, wheel: usize| self.drive.wheels_rad(psi(at), out(at))[wheel];
        let torque = |at: usize| self.thinned.torque_n_m[at] / rated;
        let warmer = |at: usize| self.thinned.temperature_c[at] - 20.0;
        let speed = |at: usize| self.thinned.speed_rad_s[at];
        let sign = |at: usize| self.flank[at];
        let fades = |at: usize| (-3.0 * torque(at).abs()).exp();
        let world = |at: usize| self.thinned.orientation_rad[at];
        let lines = |angle: &dyn Fn(usize) -> f64, orders: &[f64], by: &[&dyn Fn(usize) -> f64]| {
            let mut columns = Vec::new();
            for factor in by {
                for order in orders {
                    columns.push(column(&|at| factor(at) * (order * angle(at)).sin()));
                    columns.push(column(&|at| factor(at) * (order * angle(at)).cos()));
                }
            }
            columns
        };
        let one = |_: usize| 1.0;
        let shared: [&dyn Fn(usize) -> f64; 4] = [&one, &sign, &fades, &|at| fades(at) * sign(at)];
        let widths = || [column(&sign), column(&|at| sign(at) * fades(at)), column(&fades)];
        match cause {
            Cause::CircularSplineEccentricity | Cause::FlexsplineRunout | Cause::GravitySideLoad => {
                let angle = |at: usize| match cause {
                    Cause::FlexsplineRunout => on_wheel(at, FLEXSPLINE),
                    Cause::GravitySideLoad => psi(at) + world(at),
                    _ => on_wheel(at, CIRCULAR_SPLINE),
                };
                lines(&angle, &[2.0, 4.0, 6.0], &shared).into_iter().chain(widths()).collect()
            }
            Cause::CircularSplineOvality => lines(&|at| on_wheel(at, CIRCULAR_SPLINE), &[2.0, 4.0], &[&one, &sign]),
            Cause::FlexsplinePitchError => lines(&|at| on_wheel(at, FLEXSPLINE), &[1.0, 2.0, 4.0], &shared),
            Cause::CircularSplinePitchError => lines(&|at| on_wheel(at, CIRCULAR_SPLINE), &[1.0, 2.0, 4.0], &shared),
            Cause::GeneratorEccentricity => {
                let mut all = lines(&|at| on_wheel(at, FLEXSPLINE), &[1.0], &shared);
                all.extend(lines(&|at| on_wheel(at, CIRCULAR_SPLINE), &[1.0], &shared));
                all.extend(widths());
                all
            }
            Cause::CamFormError => {
                let mut all = lines(&psi, &[self.drive.mesh_order()], &[&one, &sign]);
                all.push(column(&sign));
                all
            }
            Cause::BacklashGrowth => vec![column(&sign)],
            Cause::Wear => {
                let travelled = self.travelled();
                let end = self.thinned.time_s[count - 1];
                vec![
                    column(&|at| sign(at) * travelled[at]),
                    column(&|at| sign(at) * travelled[at].sqrt()),
                    column(&|at| sign(at) * self.thinned.time_s[at] / end),
                ]
            }
            Cause::StiffnessError => vec![column(&torque), column(&|at| torque(at).abs())],
            Cause::StiffnessHardening => {
                vec![column(&torque), column(&|at| torque(at).powi(3)), column(&|at| (torque(at) * 8.0).tanh())]
            }
            Cause::TorsionalHysteresis => [0.05, 0.15, 0.3, 0.6]
                .iter()
                .map(|half| {
                    let mut held = 0.0_f64;
                    (0..count)
                        .map(|at| {
                            held = held.clamp(torque(at) - half, torque(at) + half);
                            held - torque(at)
                        })
                        .collect()
                })
                .collect(),
            Cause::ThermalClearance => {
                let lagged: Vec<Vec<f64>> = [60.0, 300.0].iter().map(|lag| self.lagged(*lag)).collect();
                vec![
                    column(&|at| sign(at) * warmer(at)),
                    column(&|at| sign(at) * lagged[0][at]),
                    column(&|at| sign(at) * lagged[1][at]),
                ]
            }
            Cause::ThermalStiffness => {
                vec![column(&|at| torque(at) * warmer(at)), column(&|at| torque(at) * warmer(at).powi(2))]
            }
            Cause::LubricantViscosity => {
                let mut all = Vec::new();
                for power in [0.0, 0.6, 1.0] {
                    for colder in [0.0, 0.03, 0.06] {
                        all.push(column(&|at| {
                            speed(at).signum() * speed(at).abs().powf(power) * (-colder * warmer(at)).exp()
                        }));
                    }
                }
                all
            }
            Cause::GravityTorque => {
                let angle = |at: usize| out(at) + world(at);
                lines(&angle, &[1.0], &[&one])
            }
            Cause::OutputEncoderEccentricity => lines(&out, &[1.0], &[&one]),
            Cause::GeneratorEncoderEccentricity => lines(&psi, &[1.0], &[&one]),
            Cause::SensorLatency => {
                let end = self.thinned.time_s[count - 1];
                vec![column(&speed), column(&|at| speed(at) * self.thinned.time_s[at] / end)]
            }
            Cause::RatioError => vec![column(&psi)],
            Cause::TorsionalResonance => {
                let step = self.thinned.step_s;
                let slope = |values: &dyn Fn(usize) -> f64, at: usize| {
                    if at == 0 { 0.0 } else { (values(at) - values(at - 1)) / step }
                };
                vec![column(&|at| slope(&speed, at)), column(&|at| slope(&torque, at))]
            }
            Cause::DamagedTooth | Cause::Ratcheting => Vec::new(),
        }
    }

    fn travelled(&self) -> Vec<f64> {
        let mut path = 0.0;
        let mut last = self.generator_rad[0];
        let mut sums = Vec::with_capacity(self.picks.len());
        for psi in &self.generator_rad {
            path += (psi - last).abs().min(TAU * 50.0);
            last = *psi;
            sums.push(path);
        }
        sums.iter().map(|sum| sum / path.max(1e-9)).collect()
    }

    /// The temperature above 20 °C behind a lag, s.
    fn lagged(&self, lag_s: f64) -> Vec<f64> {
        let mut now = self.thinned.temperature_c[0];
        let mut last_s = self.thinned.time_s[0];
        let rows = self.thinned.time_s.iter().zip(&self.thinned.temperature_c);
        rows.map(|(time_s, warm)| {
            now += (warm - now) * (1.0 - (-(time_s - last_s) / lag_s).exp());
            last_s = *time_s;
            now - 20.0
        })
        .collect()
    }
}
