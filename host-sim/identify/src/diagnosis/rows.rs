//! The rows of all sessions in one place, with what follows from them: speed, direction, travel, and angles on each
//! wheel.

use std::f64::consts::PI;
use std::ops::Range;

use crate::least_squares::dot;
pub(crate) use crate::least_squares::{add_scaled, combined};
pub(crate) use crate::measurement::rms;
use crate::measurement::{Session, cubic_at_zero, quantile_of, rates, turns, white_noise};
use crate::nominal::Nominal;
use flexspline::FixedMember;
pub(super) use flexspline_base::statistics::mean;
use flexspline_base::units::ARCSEC_PER_RAD;

/// Four rows around one give its angle as long as they span no more than this multiple of what the inner two do.
/// *Guess*: even rows give 2, and one lost row 2.5 at most.
const FAR_APART: f64 = 4.0;

/// Rows to either side of one that its mean is taken over. *Guess*: octaves.
const WINDOWS: [usize; 7] = [0, 1, 2, 4, 8, 16, 32];
/// Rows by which the error may follow the load late, or before it. *Guess*: a slow loop reads so far apart.
const ROWS_OFF: usize = 16;
/// Share of the wind-up of what changes from row to row that the error follows where it is load. *Guess*.
const FOLLOWED: f64 = 0.1;
/// What noise of the torque winds up matters from this share of the noise of the error on. *Guess*: with a third a row
/// scatters by a twentieth more.
const MATTERS: f64 = 0.3;
/// A mean is known to this many of its standard deviations. *Guess*: the method asks for two to three.
const KNOWN_TO: f64 = 2.0;
/// An output that has come back by this much, arcsec, … *Guess*: friction slips within a few arc-seconds.
const TURNS_ROUND_ARCSEC: f64 = 3.0;
/// … and by this many times the noise of its path, moves the other way. *Guess*: of 10⁵ rows none is as far off.
const TURNS_ROUND_OF_NOISE: f64 = 8.0;

/// Which columns were recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordedColumns {
    /// Time.
    pub time: bool,
    /// Torque.
    pub torque: bool,
    /// Temperature.
    pub temperature: bool,
    /// Orientation.
    pub orientation: bool,
}

/// Rows of all sessions one after another; all vectors have the same length.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// Where each session stands; a session without rows is empty.
    pub sessions: Vec<Range<usize>>,
    /// Which sessions are learnt from. The others have a history (time, travel, temperature) all the same.
    pub used: Vec<bool>,
    /// What was recorded.
    pub recorded: RecordedColumns,
    /// Time, s; row numbers where it was not recorded.
    pub time: Vec<f64>,
    /// Time since the session began, s.
    pub since: Vec<f64>,
    /// Generator angle, rad.
    pub generator: Vec<f64>,
    /// Output error, arcsec.
    pub error: Vec<f64>,
    /// Load torque, N·m; 0 where it was not recorded.
    pub torque: Vec<f64>,
    /// Temperature, °C; nominal where it was not recorded.
    pub temperature: Vec<f64>,
    /// Orientation, rad; 0 where it was not recorded.
    pub orientation: Vec<f64>,
    /// Generator speed, rad/s (rad per row without time).
    pub speed: Vec<f64>,
    /// Direction of the output, ±1, held while it stands; positive where the generator that moves it turns forward.
    pub direction: Vec<f64>,
    /// Generator travel since the first row, rad, sessions joined.
    pub travel: Vec<f64>,
    /// Nominal output angle, rad.
    pub output: Vec<f64>,
    /// Angle of the wave on the flexspline's material, rad.
    pub on_flexspline: Vec<f64>,
    /// Angle of the wave on the circular spline's material, rad.
    pub on_circular_spline: Vec<f64>,
    /// Noise of each row against that of a row of mean worth; 1 where all rows are alike.
    pub loudness: Vec<f64>,
    /// Whether angles are not read at one instant, so that rows differ in noise.
    pub jitters: bool,
    /// Time by which one angle may be read before the other on the mean, for all that is known of how they are read, s.
    pub unsure_s: f64,
    /// What rounding to a coarse resolution leaves in a row, one standard deviation, arcsec; 0 where noise blurs it.
    pub rounding: f64,
    /// Sessions from which on the zero of the error is another one.
    pub zeros: Vec<usize>,
    /// Median sample period, s.
    pub period: f64,
}

impl Rows {
    /// Joins sessions; all are learnt from, but for those of three rows or fewer.
    pub fn new(sessions: &[Session], nominal: &Nominal) -> Rows {
        let mut rows = Rows::default();
        let all = |has: fn(&Session) -> bool| sessions.iter().all(has) && !sessions.is_empty();
        rows.recorded = RecordedColumns {
            time: all(|s| s.time_s.is_some()),
            torque: all(|s| s.torque_n_m.is_some()),
            temperature: all(|s| s.temperature_c.is_some()),
            orientation: all(|s| s.orientation_rad.is_some()),
        };
        let or = |column: &Option<Vec<f64>>, recorded: bool, len: usize, usual: f64| match column {
            Some(values) if recorded => values.clone(),
            _ => vec![usual; len],
        };
        for session in sessions {
            let (from, len) = (rows.generator.len(), session.len());
            rows.generator.extend(&session.generator_rad);
            rows.error.extend(session.error_rad.iter().map(|e| e * ARCSEC_PER_RAD));
            rows.torque.extend(or(&session.torque_n_m, rows.recorded.torque, len, 0.0));
            rows.temperature.extend(or(&session.temperature_c, rows.recorded.temperature, len, nominal.temperature_c));
            rows.orientation.extend(or(&session.orientation_rad, rows.recorded.orientation, len, 0.0));
            match &session.time_s {
                Some(time) if rows.recorded.time => rows.time.extend(time),
                _ => rows.time.extend((from..from + len).map(|k| k as f64)),
            }
            let begin = rows.time.get(from).copied().unwrap_or(0.0);
            rows.since.extend(rows.time[from..].iter().map(|time| time - begin).collect::<Vec<f64>>());
            rows.jitters |= session.loudness.is_some();
            rows.loudness.extend(or(&session.loudness, true, len, 1.0));
            rows.unsure_s = rows.unsure_s.max(session.unsure_s);
            rows.rounding = rows.rounding.max(session.coarse_rad * ARCSEC_PER_RAD / 12f64.sqrt());
            if session.own_zero {
                rows.zeros.push(rows.sessions.len());
            }
            rows.sessions.push(from..from + len);
            rows.used.push(len > 3);
        }
        if rows.jitters {
            rows.generator = rows.by_neighbours();
        }
        rows.torque = rows.load(nominal);
        rows.derive(nominal);
        rows
    }

    /// The load without the noise of its sensor, where what changes from row to row is noise: the error follows none of
    /// it, at once or some rows off. The drive winds up by the load alone, and noise would pass for a softer spring, or
    /// for a load that comes late (errors in variables; Fuller, Measurement Error Models, 1987, 1.1).
    fn load(&self, nominal: &Nominal) -> Vec<f64> {
        let of_session = |session: &Range<usize>| {
            let torque = &self.torque[session.clone()];
            let wound: Vec<f64> = torque.iter().map(|torque| nominal.wind_up_arcsec(*torque)).collect();
            let columns = [&self.error[session.clone()], &wound];
            let [of_error, of_torque] = columns.map(|column| white_noise([column]));
            let [error, wound] = columns.map(bends);
            let inner = wound.get(ROWS_OFF..wound.len().saturating_sub(ROWS_OFF)).unwrap_or_default();
            let follows = |off: usize| dot(inner, &error[off..][..inner.len()]).abs() > FOLLOWED * dot(inner, inner);
            // Sessions that nobody has measured have no error, and no noise.
            let matters = of_torque > MATTERS * of_error && dot(&error, &error) > 0.0;
            let is_noise = !inner.is_empty() && matters && !(0..=2 * ROWS_OFF).any(follows);
            if is_noise { without_noise(torque) } else { torque.to_vec() }
        };
        self.sessions.iter().flat_map(of_session).collect()
    }

    /// The generator angle of each row as those beside it have it: a cubic in time through the two before and the two
    /// after. The instant at which a row was read is in its error, and whatever follows the angle itself would follow
    /// that.
    fn by_neighbours(&self) -> Vec<f64> {
        let mut angle = self.generator.clone();
        for session in &self.sessions {
            for k in session.start + 2..session.end.saturating_sub(2) {
                let beside = [k - 2, k - 1, k + 1, k + 2];
                let t = beside.map(|j| self.time[j] - self.time[k]);
                if t[3] - t[0] > FAR_APART * (t[2] - t[1]).max(0.0) || t.windows(2).any(|t| t[1] <= t[0]) {
                    continue;
                }
                angle[k] = cubic_at_zero([0, 1, 2, 3].map(|j| (t[j], self.generator[beside[j]])));
            }
        }
        angle
    }

    /// Learns from these sessions alone, as far as they have rows enough.
    pub(crate) fn learning_from(mut self, used: &[bool]) -> Rows {
        for (k, session) in self.used.iter_mut().enumerate() {
            *session &= used.get(k).copied().unwrap_or(false);
        }
        self
    }

    /// With each column changed by `of`; the sessions are these then.
    pub fn each(&self, sessions: Vec<Range<usize>>, of: impl Fn(&[f64]) -> Vec<f64>) -> Rows {
        Rows {
            sessions,
            used: self.used.clone(),
            recorded: self.recorded,
            time: of(&self.time),
            since: of(&self.since),
            generator: of(&self.generator),
            error: of(&self.error),
            torque: of(&self.torque),
            temperature: of(&self.temperature),
            orientation: of(&self.orientation),
            speed: of(&self.speed),
            direction: of(&self.direction),
            travel: of(&self.travel),
            output: of(&self.output),
            on_flexspline: of(&self.on_flexspline),
            on_circular_spline: of(&self.on_circular_spline),
            loudness: of(&self.loudness),
            jitters: self.jitters,
            zeros: self.zeros.clone(),
            unsure_s: self.unsure_s,
            rounding: self.rounding,
            period: self.period,
        }
    }

    /// Sessions that are learnt from.
    pub(crate) fn sessions_used(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        self.sessions.iter().zip(&self.used).filter(|(_, used)| **used).map(|(session, _)| session.clone())
    }

    /// Highest order per turn of the generator of which half of the rows that move see a period or more in two: beyond,
    /// a wave is on these rows what one of a lower order is, or a constant.
    pub(crate) fn highest_order(&self) -> f64 {
        let steps = self.sessions_used().flat_map(|session| {
            self.generator[session].windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect::<Vec<f64>>()
        });
        sampled_twice(&mut steps.filter(|step| *step > 0.0).collect::<Vec<f64>>(), 0.5)
    }

    /// Rows that are learnt from.
    pub(crate) fn count_used(&self) -> usize {
        self.sessions_used().map(|session| session.len()).sum()
    }

    fn derive(&mut self, nominal: &Nominal) {
        let n = self.len();
        let mut periods: Vec<f64> = Vec::with_capacity(n);
        self.speed = rates(&self.sessions, &self.time, &self.generator);
        self.travel = vec![0.0; n];
        let mut travel = 0.0;
        for session in self.sessions.clone() {
            for k in session.clone() {
                if k > session.start {
                    travel += (self.generator[k] - self.generator[k - 1]).abs();
                    periods.push(self.time[k] - self.time[k - 1]);
                }
                self.travel[k] = travel;
            }
        }
        periods.sort_by(f64::total_cmp);
        self.period = periods.get(periods.len() / 2).copied().filter(|p| *p > 0.0).unwrap_or(1.0);
        self.output = self.generator.iter().map(|psi| psi / nominal.ratio).collect();
        self.direction = self.sessions.iter().flat_map(|session| self.ways(session, nominal)).collect();
        let turning = nominal.teeth.map(|teeth| teeth.fixed);
        let against = |moves: bool| -> Vec<f64> {
            self.generator.iter().zip(&self.output).map(|(psi, out)| psi - if moves { *out } else { 0.0 }).collect()
        };
        self.on_flexspline = against(turning == Some(FixedMember::CircularSpline));
        self.on_circular_spline = against(turning != Some(FixedMember::CircularSpline));
    }

    /// Ways in which the output moves in a session, whether the generator moves it or a load that changes; until it has
    /// clearly moved that of the generator, and none where that stands.
    fn ways(&self, session: &Range<usize>, nominal: &Nominal) -> Vec<f64> {
        let moved = |k: usize| self.output[k] * ARCSEC_PER_RAD + nominal.wind_up_arcsec(self.torque[k]);
        let path: Vec<f64> = session.clone().map(|k| nominal.ratio.signum() * moved(k)).collect();
        let turns = turns(&path, TURNS_ROUND_ARCSEC + TURNS_ROUND_OF_NOISE * white_noise([&path[..]]));
        let at_first = |speed: f64| if speed == 0.0 { 0.0 } else { speed.signum() };
        let speeds = &self.speed[session.clone()];
        turns.iter().zip(speeds).map(|((way, _), speed)| if *way == 0.0 { at_first(*speed) } else { *way }).collect()
    }

    /// Rows.
    pub fn len(&self) -> usize {
        self.generator.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.generator.is_empty()
    }

    /// Values of the rows after a first-order lag of `lag_s`. Each session begins with its first value; where the lag
    /// `goes_on`, with the state that the session before had reached, nearer to that value by the time between them.
    pub(super) fn lagged(&self, values: &[f64], lag_s: f64, goes_on: bool) -> Vec<f64> {
        let mut reached = vec![0.0; self.len()];
        let mut last: Option<usize> = None;
        for session in &self.sessions {
            let first = values[session.start];
            let gap_s = |last: usize| self.time[session.start] - self.time[last];
            // Where clocks begin anew nobody knows how long it had.
            let mut state = match last.filter(|last| goes_on && gap_s(*last) >= 0.0) {
                Some(last) => first + (reached[last] - first) * (-gap_s(last) / lag_s).exp(),
                None => first,
            };
            for k in session.clone() {
                if k > session.start {
                    let dt = (self.time[k] - self.time[k - 1]).max(0.0);
                    state += (values[k] - state) * (1.0 - (-dt / lag_s).exp());
                }
                reached[k] = state;
            }
            last = session.clone().last();
        }
        reached
    }

    /// A high percentile of the torque's magnitude, N·m: the scale of the load.
    pub(crate) fn load_scale(&self) -> f64 {
        quantile(self.torque.iter().map(|t| t.abs()), 0.98)
    }
}

/// Second differences.
fn bends(values: &[f64]) -> Vec<f64> {
    values.windows(3).map(|v| v[0] - 2.0 * v[1] + v[2]).collect()
}

/// Values of which each is the mean over the widest window in which no narrower one says otherwise under their white
/// noise (intersection of confidence intervals; Goldenshluger and Nemirovski, Math. Methods Stat. 6, 135, 1997). A step
/// stays one.
fn without_noise(values: &[f64]) -> Vec<f64> {
    let (noise, mut quiet, mut sums) = (white_noise([values]), values.to_vec(), vec![0.0]);
    values.iter().for_each(|value| sums.push(sums[sums.len() - 1] + value));
    for (k, quiet) in quiet.iter_mut().enumerate() {
        let [mut low, mut high] = [f64::NEG_INFINITY, f64::INFINITY];
        for half in WINDOWS.into_iter().take_while(|half| *half <= k.min(values.len() - 1 - k)) {
            let count = (2 * half + 1) as f64;
            let mean = (sums[k + half + 1] - sums[k - half]) / count;
            let known = KNOWN_TO * noise / count.sqrt();
            (low, high) = (low.max(mean - known), high.min(mean + known));
            if low > high {
                break;
            }
            *quiet = mean;
        }
    }
    quiet
}

/// Highest order per turn of which a share of the steps (rad, which are reordered) sees each wave twice or more; no
/// limit without steps.
pub(crate) fn sampled_twice(steps: &mut [f64], share: f64) -> f64 {
    let step = quantile_of(steps, share);
    if step > 0.0 { PI / step } else { f64::INFINITY }
}

/// A session in parts of `stride` rows (at least one); the last may be shorter.
pub(crate) fn parts(session: &Range<usize>, stride: usize) -> impl Iterator<Item = Range<usize>> + use<> {
    let (stride, end) = (stride.max(1), session.end);
    session.clone().step_by(stride).map(move |from| from..(from + stride).min(end))
}

/// Quantile of those numbers that are finite; 0 of none.
pub(crate) fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut values: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    quantile_of(&mut values, share)
}

/// Standard deviation about zero that a few outliers do not move: half of normal numbers lie within 0.6745 of it.
pub(crate) fn robust_std(values: impl Iterator<Item = f64>) -> f64 {
    quantile(values.map(f64::abs), 0.5) / 0.6745
}
