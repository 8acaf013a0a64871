//! A flight in numbers.

use flexspline_motion::flight::{COMPENSATED, CONTROLLERS, Flight, Flown, START_UP_S};
use flexspline_motion::loops::TwoMasses;
use flexspline_motion::scenario::{Scenario, TableKnown, TorqueKnown};
use flexspline_motion::servo::ServoSettings;
use rayon::prelude::*;
use serde::Serialize;

use flexspline_algebra::spectrum as sums_of;
use flexspline_base::figures::NamedFigure;

use super::file::name_of;

/// A time to settle for a reader.
pub fn settles_in(seconds: f64) -> String {
    if seconds.is_finite() { format!("{seconds:.2} s") } else { "never".to_owned() }
}

/// Output less target within this counts as settled, arcsec.
const SETTLED_ARCSEC: f64 = 2.0;
/// Least phase margin, degrees, and least distance of the open loop from −1 of a servo that is sound: the lower ends
/// of what K. J. Åström and R. M. Murray call reasonable (Feedback Systems, 2nd ed. 2021, section 10.3: 30° to 60°,
/// 0.5 to 0.8).
pub const LEAST_PHASE_MARGIN_DEG: f64 = 30.0;
/// Source: see [`LEAST_PHASE_MARGIN_DEG`].
pub const LEAST_DISTANCE: f64 = 0.5;
/// Ticks of one spectrum.
const WINDOW: usize = 4096;

/// One number to each controller.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ByController<T> {
    /// Target times ratio.
    pub none: T,
    /// The unit's own error over the angles, at the mean load.
    pub fourier: T,
    /// The same, by the sign of velocity.
    pub fourier_by_direction: T,
    /// The core.
    pub compensated: T,
    /// The unit's own law and the true torque at rest: what a quasi-static inverse can do.
    pub ideal: T,
}

impl<T: Copy> ByController<T> {
    /// In the order of the controllers.
    pub fn all(&self) -> [T; CONTROLLERS.len()] {
        let ByController { none, fourier, fourier_by_direction, compensated, ideal } = *self;
        [none, fourier, fourier_by_direction, compensated, ideal]
    }
}

/// Results of `flexspline fly`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Results {
    /// Name of the scenario.
    pub scenario: String,
    /// Wave generator.
    pub generator: String,
    /// From what the torque is known (`none` also where no low-pass of the torque in the mesh keeps the margin), and
    /// what the table knows.
    pub torque: String,
    /// See there.
    pub table: String,
    /// Simulated time, s.
    pub seconds: f64,
    /// Output less target.
    pub rms_arcsec: ByController<f64>,
    /// Largest of it.
    pub max_arcsec: ByController<f64>,
    /// Speed of the output less that of the target while that moves evenly, arcsec/s rms; not a number (`null`) where
    /// it never does.
    pub velocity_ripple: ByController<f64>,
    /// The same of a drive without errors, not compensated: what is not the drive's, but encoder, servo, friction and
    /// wind.
    pub velocity_ripple_floor: f64,
    /// Torque in the mesh, N·m, largest.
    pub mesh_n_m: ByController<f64>,
    /// From the end of a slew until the output stays within 2″ of the target, s, mean, infinite where one ends beyond
    /// them; none if the scenario never stands.
    pub settle_s: Option<ByController<f64>>,
    /// Share of what the ideal removes that the core removes; none where the ideal removes next to nothing.
    pub removed: Option<f64>,
    /// Whether the servo is stable with this load, and the compensated joint comes to rest after a knock as the one
    /// without compensation does.
    pub stable: bool,
    /// Low-pass of a torque in the mesh that keeps the margin, Hz.
    pub bandwidth_hz: f64,
    /// Phase margin of the servo, degrees, at Hz; the least distance of its open loop from −1, 0 where it is not
    /// stable.
    pub phase_margin_deg: [f64; 2],
    /// See there.
    pub servo_distance: f64,
    /// Resonances with motor held and free, Hz.
    pub resonances_hz: [f64; 2],
    /// Percent of the wind-up of the table's drive at its largest torque that are no FEM; left out where all is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub empirical_percent: Option<f64>,
    /// Objections to the flight, in sentences; empty if it is sound.
    pub remarks: Vec<String>,
    /// Ticks in which the motor gave all it has, the limiter held back, nothing was corrected, with the core.
    pub limited_ticks: [u32; 3],
    /// Share of ticks in which the torque from the motor's current lay within its bound; none where another is used.
    pub torque_within_bound: Option<f64>,
    /// All bits of all errors of all controllers.
    pub digest: String,
}

impl Results {
    /// Its loops and limits in words, in their order; those that this flight does not have are left out.
    pub fn figures(&self) -> Vec<NamedFigure> {
        let [margin, at_hz] = self.phase_margin_deg;
        let [held, free] = self.resonances_hz;
        let [all, held_back, without] = self.limited_ticks.map(|ticks| Some(f64::from(ticks)));
        // A servo that is not stable has no margin, and swings whatever is corrected.
        let of_margin = |value: f64| (self.servo_distance > 0.0 && value.is_finite()).then_some(value);
        let percent = |share: Option<f64>| share.map(|share| 100.0 * share);
        let at = format!("at {at_hz:.0} Hz");
        [
            ("removed by the core", percent(self.removed.filter(|_| self.stable)), "%", 1, "of what an ideal removes"),
            ("phase margin of the servo", of_margin(margin), "deg", 0, at.as_str()),
            ("its least distance from -1", of_margin(self.servo_distance), "", 2, ""),
            ("empirical part of the wind-up", self.empirical_percent, "%", 0, "output.contact_compliance, not FEM"),
            ("resonance of the held motor", Some(held), "Hz", 0, ""),
            ("resonance of the free motor", Some(free), "Hz", 0, ""),
            ("low-pass of the torque", Some(self.bandwidth_hz), "Hz", 2, ""),
            ("ticks at the limit of the motor", all, "", 0, ""),
            ("ticks in which the limiter held back", held_back, "", 0, ""),
            ("ticks without a correction", without, "", 0, ""),
            ("torque by the current within its bound", percent(self.torque_within_bound), "%", 1, "of the ticks"),
        ]
        .into_iter()
        .filter_map(|(name, value, unit, decimals, caveat)| {
            let [name, caveat] = [name, caveat].map(str::to_owned);
            Some(NamedFigure { name, value: value?, unit, decimals, caveat, what: String::new() })
        })
        .collect()
    }

    /// Whether the servo is stable and a little more delay, gain or inertia would make it ring.
    pub fn servo_is_near_the_edge(&self) -> bool {
        self.servo_distance > 0.0 && !self.servo_is_sound()
    }

    fn servo_is_sound(&self) -> bool {
        is_sound(self.servo_distance, self.phase_margin_deg[0])
    }

    /// Objections to the flight, in sentences; `way_out` says with which paces the servo is sound.
    fn against(&self, way_out: &str) -> Vec<String> {
        let servo_is_stable = self.servo_distance > 0.0;
        let [margin, at_hz] = self.phase_margin_deg;
        let remarks = [
            (
                !servo_is_stable,
                format!("The servo itself is not stable with this load, whatever is compensated; {way_out}."),
            ),
            (
                self.servo_is_near_the_edge(),
                format!(
                    "The servo is near the edge of instability with this load: its phase margin is {margin:.0}° at \
                     {at_hz:.0} Hz ({LEAST_PHASE_MARGIN_DEG}° or more is sound), its least distance from −1 is {:.2} \
                     ({LEAST_DISTANCE} or more); {way_out}.",
                    self.servo_distance
                ),
            ),
            (
                servo_is_stable && !self.stable,
                "With compensation the joint does not come to rest after a knock as it does without.".to_owned(),
            ),
            (
                self.stable && self.rms_arcsec.compensated > self.rms_arcsec.none,
                "Compensation makes this flight worse.".to_owned(),
            ),
        ];
        remarks.into_iter().filter(|(there, _)| *there).map(|(_, remark)| remark).collect()
    }
}

/// Whether a loop at this distance from −1 has room for a little more delay, gain or inertia.
fn is_sound(distance: f64, phase_margin_deg: f64) -> bool {
    distance >= LEAST_DISTANCE && phase_margin_deg >= LEAST_PHASE_MARGIN_DEG
}

/// A point of a curve.
pub type Row = [f64; 2];

/// Where an ideal leaves more than this of the error, no share of what it removes is given. *Guess*.
const IDEAL_REMOVES: f64 = 0.98;

fn by_controller<T: Copy>(flight: &Flight, value: impl Fn(&Flown) -> T) -> ByController<T> {
    let [none, fourier, fourier_by_direction, compensated, ideal] = flight.flown.each_ref().map(value);
    ByController { none, fourier, fourier_by_direction, compensated, ideal }
}

/// The numbers of a flight.
pub fn results(flown: &super::Flown, flight: &Flight) -> Results {
    let scenario = &flown.scenario;
    let rms = by_controller(flight, |flown| flown.error.rms());
    let digest = flight.flown.iter().fold(0_u64, |sum, flown| sum.rotate_left(9) ^ flown.digest);
    let core = &flight.flown[COMPENSATED];
    let current = flight.torque == TorqueKnown::Current;
    let mut results = Results {
        scenario: scenario.name.clone(),
        generator: flown.kind.to_string(),
        torque: name_of(&TorqueKnown::NAMES, flight.torque).to_owned(),
        table: name_of(&TableKnown::NAMES, scenario.table).to_owned(),
        seconds: scenario.seconds(),
        rms_arcsec: rms,
        max_arcsec: by_controller(flight, |flown| flown.error.largest()),
        velocity_ripple: by_controller(flight, |flown| flown.ripple.rms_if_any()),
        velocity_ripple_floor: flight.flawless.ripple.rms_if_any(),
        mesh_n_m: by_controller(flight, |flown| flown.mesh.largest()),
        settle_s: (stands(scenario).next().is_some()).then(|| by_controller(flight, |flown| settle_s(scenario, flown))),
        removed: (rms.ideal < IDEAL_REMOVES * rms.none).then(|| (rms.none - rms.compensated) / (rms.none - rms.ideal)),
        stable: flight.stable,
        bandwidth_hz: flight.bandwidth_hz,
        phase_margin_deg: flight.phase_margin_deg,
        servo_distance: flight.servo_distance,
        resonances_hz: flight.resonances_hz,
        empirical_percent: flown.own.as_ref().and_then(|own| own.empirical_percent),
        remarks: Vec::new(),
        limited_ticks: core.limits,
        torque_within_bound: current.then_some(core.within_bound),
        digest: format!("{digest:016x}"),
    };
    let way_out = if results.servo_is_sound() { String::new() } else { way_out(flight, scenario) };
    results.remarks = results.against(&way_out);
    results
}

/// A pace changes by a fifth a step, down to a tenth in the end; that of the speed loop as far up, too, where it is too
/// slow for the others. A guess: finer than a servo is tuned, and further than one that is nearly right is changed.
const STEP: f64 = 0.8;
/// A guess, see [`STEP`].
const MOST_STEPS: i32 = 10;
/// Paces that a scenario may have, Hz: of speed, position and integral. A guess.
pub(super) const PACES_HZ: [[f64; 2]; 3] = [[0.1, 200.0], [0.1, 100.0], [0.0, 100.0]];

/// With which paces the servo is sound, or what keeps it from that.
fn way_out(flight: &Flight, scenario: &Scenario) -> String {
    const NAMES: [&str; 3] = ["speed_hz", "position_hz", "integral_hz"];
    let servo = &scenario.servo;
    let paces = [servo.speed_hz, servo.position_hz, servo.integral_hz];
    if let Some(sound) = sound_paces(&flight.joint, servo) {
        let changed = NAMES.iter().zip(sound).zip(paces).filter(|((_, to), from)| to != from);
        let said: Vec<String> = changed.map(|((name, to), _)| format!("servo.{name} = {to}")).collect();
        return format!("with {} it is sound, by the same margins", said.join(", "));
    }
    let [held_hz, free_hz] = flight.resonances_hz;
    let (load_kg_m2, motor_kg_m2) = (scenario.load_kg_m2, flight.joint.motor_kg_m2);
    format!(
        "it is sound with no servo.speed_hz from a tenth to ten times this one, servo.position_hz and \
         servo.integral_hz down to a tenth: the load has {:.0} times the inertia that the loops are tuned for \
         ({load_kg_m2} of {motor_kg_m2:.2} kg·m² at the output), and swings on the drive's spring at {held_hz:.1} Hz \
         with the motor held, at {free_hz:.1} Hz with it free",
        load_kg_m2 / motor_kg_m2
    )
}

/// Paces of speed, position and integral with which the servo's loop is sound: the fewest changed, and those least.
fn sound_paces(joint: &TwoMasses, servo: &ServoSettings) -> Option<[f64; 3]> {
    let paces = [servo.speed_hz, servo.position_hz, servo.integral_hz];
    // The printed value is the judged one.
    let changed = |hz: f64, steps: i32| match steps {
        0 => hz,
        _ => format!("{:.1e}", hz * STEP.powi(steps)).parse().unwrap_or(hz),
    };
    let lower = || 0..=MOST_STEPS;
    let of_speed =
        |speed: i32| lower().flat_map(move |position| lower().map(move |integral| [speed, position, integral]));
    let mut all: Vec<[i32; 3]> = (-MOST_STEPS..=MOST_STEPS).flat_map(of_speed).collect();
    all.sort_by_key(|steps| {
        (steps.iter().filter(|steps| **steps != 0).count(), steps.iter().map(|n| n.abs()).sum::<i32>())
    });
    let found = |paces: &[f64; 3]| {
        let [speed_hz, position_hz, integral_hz] = *paces;
        let servo = ServoSettings { speed_hz, position_hz, integral_hz, ..*servo };
        let margin = joint.servo(&servo);
        paces.iter().zip(PACES_HZ).all(|(hz, [low, high])| (low..=high).contains(hz))
            && margin.stable
            && is_sound(margin.distance, joint.phase_margin_deg(&servo)[0])
    };
    let tried = all.into_par_iter().map(|steps| [0, 1, 2].map(|pace| changed(paces[pace], steps[pace])));
    tried.find_first(found)
}

/// From when until when the target stands after it moved, s.
fn stands(scenario: &Scenario) -> impl Iterator<Item = [f64; 2]> + '_ {
    let mut begins = 0.0;
    let mut before = 0.0_f64;
    scenario.legs.iter().filter_map(move |leg| {
        let (from, rate) = (begins, before);
        begins += leg.seconds;
        before = leg.rate_rad_s;
        let stopped = from + rate.abs() / scenario.acceleration_rad_s2;
        (leg.rate_rad_s == 0.0 && rate != 0.0 && stopped < begins).then_some([stopped, begins])
    })
}

fn settle_s(scenario: &Scenario, flown: &Flown) -> f64 {
    let tick_s = scenario.servo.tick_s;
    let index = |time: f64| (((time - START_UP_S) / tick_s).max(0.0) as usize).min(flown.errors.len());
    let (mut sum, mut count) = (0.0, 0.0);
    for [from, to] in stands(scenario) {
        let stretch = &flown.errors[index(from)..index(to)];
        let outside = stretch.iter().rposition(|error| f64::from(error.abs()) > SETTLED_ARCSEC);
        let never = outside.is_some_and(|at| at + 1 == stretch.len());
        sum += if never { f64::INFINITY } else { outside.map_or(0.0, |at| (at + 1) as f64 * tick_s) };
        count += 1.0;
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Amplitude of the error (arcsec) over frequency (Hz): rms of windows of 4 s, by Hann, averaged.
pub fn spectrum(scenario: &Scenario, flown: &Flown) -> Vec<Row> {
    let mut power = vec![0.0; WINDOW / 2 + 1];
    let mut count = 0.0;
    for window in flown.errors.chunks_exact(WINDOW) {
        let mean = window.iter().copied().map(f64::from).sum::<f64>() / WINDOW as f64;
        let mut values: Vec<f64> = window
            .iter()
            .enumerate()
            .map(|(k, value)| {
                let hann = 1.0 - (std::f64::consts::TAU * k as f64 / WINDOW as f64).cos();
                hann * (f64::from(*value) - mean)
            })
            .collect();
        for (sum, line) in power.iter_mut().zip(sums_of(&mut values)) {
            *sum += (line.norm() * 2.0 / WINDOW as f64).powi(2);
        }
        count += 1.0;
    }
    let hz = 1.0 / (WINDOW as f64 * scenario.servo.tick_s);
    let amplitude = |(k, sum): (usize, &f64)| [k as f64 * hz, (sum / f64::max(count, 1.0)).sqrt()];
    power.iter().enumerate().skip(1).take_while(|(k, _)| *k as f64 * hz <= 100.0).map(amplitude).collect()
}
