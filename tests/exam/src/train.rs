//! The march in time that families G and H share: a generator, teeth with clearance, a hub that the friction of the
//! housing holds, a spring, a flange, a torque sensor and a load with inertia. The models of hidden effects, the
//! generator's motor, the run and the load are each family's own (`gimbal.rs`, `arm.rs`).
//!
//! Angles at the output are arcsec here. A torque is positive where it turns the output forward.

use std::f64::consts::{PI, TAU};

use crate::ARCSEC;
use crate::chance::Chance;
use crate::drive::{Drive, Unit};
use crate::hides::Hides;
use crate::record::{Record, Row};

/// The drive at one instant.
#[derive(Debug, Clone, Copy, Default)]
pub struct Now {
    pub step_s: f64,
    /// From the first session on, gaps included.
    pub time_s: f64,
    pub since_s: f64,
    /// Share of all rows that are over, 0 to 1.
    pub done: f64,
    /// Share of the generator's path, 0 to 1.
    pub path: f64,
    pub generator_rad: f64,
    pub speed_rad_s: f64,
    /// Its way in this step.
    pub moved_rad: f64,
    pub output_rad: f64,
    pub output_rad_s: f64,
    pub output_arcsec_s2: f64,
    /// In the spring.
    pub torque_n_m: f64,
    /// The same over the rated torque, signed.
    pub load: f64,
    /// In the log.
    pub column_c: f64,
    /// The gear itself: behind the column by a lag.
    pub gear_c: f64,
    /// The housing: behind by a long lag.
    pub housing_c: f64,
    /// Of the housing about its axis.
    pub orientation_rad: f64,
    /// Load and flange together.
    pub inertia_kg_m2: f64,
    /// Place of contact on the flexspline, and on the circular spline.
    pub wheel_rad: [f64; 2],
}

/// Additions of hidden effects at an instant.
#[derive(Debug, Clone, Copy, Default)]
pub struct Adds {
    /// Places of the flanks that bear forward and backward load, in each of the two zones of contact.
    pub zones: [[f64; 2]; 2],
    /// The same where both zones have it alike.
    pub flanks: [f64; 2],
    /// Torque on the flange that the sensor does not hold, N m.
    pub unseen_n_m: f64,
    pub output_arcsec: f64,
    /// In the reading of the generator, as an angle at the output.
    pub generator_arcsec: f64,
    pub delay_s: f64,
    pub torque_n_m: f64,
}

impl Adds {
    pub fn both(&mut self, zone: usize, arcsec: f64) {
        self.zones[zone][0] += arcsec;
        self.zones[zone][1] += arcsec;
    }

    /// A displaced axis at an angle to a zone, which the two flanks feel in directions `pressure_rad` to either side.
    pub fn displaced(&mut self, zone: usize, arcsec: f64, angle_rad: f64, pressure_rad: f64) {
        self.zones[zone][0] += arcsec * (angle_rad + pressure_rad).sin();
        self.zones[zone][1] += arcsec * (angle_rad - pressure_rad).sin();
    }

    /// More clearance on the forward and on the backward side.
    pub fn wider(&mut self, forward: f64, backward: f64) {
        self.flanks[0] += forward;
        self.flanks[1] -= backward;
    }
}

/// Memory of a model.
pub type Memory = [f64; 6];
/// Hidden effects at a time, at most.
const MOST: usize = 3;

/// Models of a family.
pub trait Laws {
    /// How much the nearer of two zones still carries alone: 1 without load, 0 once both bear alike. `over` is the
    /// deflection of one zone under the whole load over the distance between the two.
    fn alone(&self, over: f64) -> f64;
    fn add(&self, one: &Hides, now: &Now, memory: &mut Memory, to: &mut Adds);
    /// Wind-up that an effect adds, arcsec, under this torque, at which the unit alone winds up by `own`. The
    /// memory is a trial that is thrown away where the torque turns out otherwise.
    fn wind_up(&self, one: &Hides, own: f64, torque_n_m: f64, now: &Now, memory: &mut Memory) -> f64;
    /// One step of the generator's motor: `state` is angle and speed, `wanted` what is asked of it.
    fn turn(&self, wanted: [f64; 2], state: &mut [f64; 2], load: f64, step_s: f64);
    fn load_n_m(&self, session: &Session, at: usize, now: &Now) -> f64;
}

/// One session: what is asked of the generator and what the world does, step by step.
#[derive(Debug, Clone, Default)]
pub struct Session {
    pub pause_s: f64,
    pub away_rad: f64,
    pub speed_rad_s: Vec<f64>,
    /// Torque from outside.
    pub load_n_m: Vec<f64>,
    /// As the sensor shows it.
    pub column_c: Vec<f64>,
    /// Of the housing about its axis.
    pub orientation_rad: f64,
    /// Torque and phase of the load that hangs on the output.
    pub hung: (f64, f64),
    /// Load and flange together.
    pub inertia_kg_m2: f64,
}

/// Step, rows and what scatters.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    pub step_s: f64,
    pub stride: usize,
    /// Scatter of the instants of reading.
    pub jitter_s: f64,
    pub damping_rad_s: f64,
    /// Lag of the gear and of the housing behind the column.
    pub lags_s: [f64; 2],
    pub seed: u64,
    pub orientation_known: bool,
}

/// Time in which everything comes to rest before a session.
const SETTLE_S: f64 = 1.5;

/// The gear with what is hidden in it.
struct Train<'a, L: Laws> {
    laws: &'a L,
    drive: &'a Drive,
    unit: &'a Unit,
    hidden: &'a [Hides],
    memory: [Memory; MOST],
}

impl<L: Laws> Train<'_, L> {
    /// Wind-up of unit and hidden effects.
    fn wind_up(&self, torque_n_m: f64, now: &Now, memory: &mut [Memory]) -> f64 {
        let own = self.drive.wind_up_arcsec(torque_n_m) / self.unit.stiffness;
        let with = self.hidden.iter().zip(memory);
        own + with.map(|(one, memory)| self.laws.wind_up(one, own, torque_n_m, now, memory)).sum::<f64>()
    }

    /// Torque at this wind-up (secant method, from the last torque).
    fn torque(&self, wound_arcsec: f64, now: &Now) -> f64 {
        let miss = |torque| self.wind_up(torque, now, &mut { self.memory }) - wound_arcsec;
        let scale = self.drive.first_stiffness() * self.unit.stiffness / ARCSEC;
        let (mut at, mut off) = (now.torque_n_m, miss(now.torque_n_m));
        let mut slope = scale;
        for _ in 0..12 {
            if off.abs() < 1e-4 {
                break;
            }
            let next = at - off * slope;
            let left = miss(next);
            if (left - off).abs() > 1e-12 {
                slope = ((next - at) / (left - off)).clamp(0.1 * scale, 8.0 * scale);
            }
            (at, off) = (next, left);
        }
        at
    }

    /// Where the teeth stop the hub backward and forward.
    fn limits(&self, now: &Now, adds: &Adds) -> (f64, f64) {
        let psi = now.generator_rad;
        let teeth = psi / self.drive.ratio() * ARCSEC + self.drive.lines_arcsec(self.unit, psi);
        let half = 0.5 * self.drive.backlash_arcsec * self.unit.backlash;
        // One zone has half of the stiffness of the teeth.
        let zone = 2.0 * ARCSEC / (self.unit.tooth_stiffness * self.drive.first_stiffness());
        let shared = |flank: usize, load_n_m: f64| {
            let (a, b) = (adds.zones[0][flank], adds.zones[1][flank]);
            let apart = (a - b).abs();
            let alone = if apart > 1e-9 { self.laws.alone(load_n_m.max(0.0) * zone / apart) } else { 0.0 };
            (0.5 * (a + b), 0.5 * apart * alone)
        };
        let (ahead, nearer) = shared(0, now.torque_n_m);
        let (behind, farther) = shared(1, -now.torque_n_m);
        let high = teeth + half + ahead - nearer + adds.flanks[0];
        let low = teeth - half + behind + farther + adds.flanks[1];
        if low <= high { (low, high) } else { (0.5 * (low + high), 0.5 * (low + high)) }
    }
}

/// Marches through the sessions.
pub fn run<L: Laws>(
    laws: &L,
    drive: &Drive,
    unit: &Unit,
    hidden: &[Hides],
    sessions: &[Session],
    pace: &Pace,
) -> Record {
    let dt = pace.step_s;
    let mut train = Train { laws, drive, unit, hidden, memory: [[0.0; 6]; MOST] };
    let mut chance = Chance::new(pace.seed, "instants", 0);
    let mut record = Record::new(dt * pace.stride as f64, pace.orientation_known);
    let steps: usize = sessions.iter().map(|session| session.speed_rad_s.len()).sum();
    let way: f64 = sessions.iter().flat_map(|session| &session.speed_rad_s).map(|v| v.abs()).sum();
    let friction = drive.friction_torque_n_m * unit.friction;
    let (mut step, mut path, mut start_s, mut wanted) = (0, 0.0, 0.0, 0.0);
    let mut now = Now { step_s: dt, ..Now::default() };
    for session in sessions {
        start_s += session.pause_s;
        wanted += session.away_rad;
        record.begin_session();
        let settle = (SETTLE_S / dt) as usize;
        let mut state = [wanted, 0.0];
        (now.gear_c, now.housing_c) = (session.column_c[0], session.column_c[0]);
        (now.orientation_rad, now.inertia_kg_m2) = (session.orientation_rad, session.inertia_kg_m2);
        now.generator_rad = wanted;
        now.output_arcsec_s2 = 0.0;
        let mut hub = wanted / drive.ratio() * ARCSEC;
        let (mut output, mut speed) = (hub + drive.wind_up_arcsec(now.torque_n_m), 0.0);
        let mut trace = Vec::with_capacity(settle + session.speed_rad_s.len());
        let mut reads: Vec<(usize, f64, f64)> = Vec::new();
        for count in 0..settle + session.speed_rad_s.len() {
            let (at, runs) = (count.saturating_sub(settle), count >= settle);
            let asked = if runs { session.speed_rad_s[at] } else { 0.0 };
            wanted += asked * dt;
            path += asked.abs();
            step += usize::from(runs);
            laws.turn([wanted, asked], &mut state, now.load, dt);
            now.moved_rad = if count == 0 { 0.0 } else { state[0] - now.generator_rad };
            [now.generator_rad, now.speed_rad_s] = state;
            now.since_s = (count as f64 - settle as f64) * dt;
            now.time_s = start_s + now.since_s;
            now.done = step as f64 / steps as f64;
            now.path = path / way;
            now.column_c = session.column_c[at];
            now.gear_c += (now.column_c - now.gear_c) * dt / pace.lags_s[0];
            now.housing_c += (now.column_c - now.housing_c) * dt / pace.lags_s[1];
            (now.output_rad, now.output_rad_s) = (output / ARCSEC, speed / ARCSEC);
            now.wheel_rad = drive.wheels_rad(now.generator_rad, now.output_rad);

            let mut adds = Adds::default();
            for (one, memory) in hidden.iter().zip(&mut train.memory) {
                laws.add(one, &now, memory, &mut adds);
            }
            // The load draws the hub through the clearance against the friction, the generator pushes it with a flank.
            let (low, high) = train.limits(&now, &adds);
            hub = hub.clamp(low, high);
            let mut torque = train.torque(output - hub, &now);
            if torque.abs() > friction {
                let held = friction.copysign(torque);
                let free = output - train.wind_up(held, &now, &mut { train.memory });
                let slid = if torque > 0.0 { free.clamp(hub, high) } else { free.clamp(low, hub) };
                if slid != hub {
                    hub = slid;
                    torque = train.torque(output - hub, &now);
                }
            }
            let mut memory = train.memory;
            train.wind_up(torque, &now, &mut memory);
            train.memory = memory;
            (now.torque_n_m, now.load) = (torque, torque / drive.rated_n_m);

            trace.push(output);
            if runs && at % pace.stride == 0 {
                let scatter = [(); 2].map(|()| pace.jitter_s * chance.normal());
                let read = now.generator_rad + scatter[0] * now.speed_rad_s;
                let sense = adds.generator_arcsec / ARCSEC * drive.ratio();
                record.push(&Row {
                    time_s: now.time_s,
                    generator_rad: now.generator_rad,
                    speed_rad_s: now.speed_rad_s,
                    torque_n_m: torque - adds.unseen_n_m + adds.torque_n_m,
                    temperature_c: now.column_c,
                    orientation_rad: session.orientation_rad,
                });
                record.generator_read_rad.push(read + sense);
                reads.push((count, scatter[1] - adds.delay_s, adds.output_arcsec));
            }
            let outside = laws.load_n_m(session, at, &now);
            let drag = pace.damping_rad_s * speed;
            now.output_arcsec_s2 = (outside - torque + adds.unseen_n_m) / session.inertia_kg_m2 * ARCSEC - drag;
            speed += now.output_arcsec_s2 * dt;
            output += speed * dt;
        }
        wanted = state[0];
        start_s = now.time_s + dt;
        for (count, later_s, adds) in reads {
            let place = (count as f64 + later_s / dt).clamp(0.0, trace.len() as f64 - 1.001);
            let (from, part) = (place as usize, place.fract());
            record.output_read_rad.push((trace[from] + part * (trace[from + 1] - trace[from]) + adds) / ARCSEC);
        }
    }
    record
}

/// Where contact zone `zone` stands on a wheel.
pub fn place(wheel_rad: f64, zone: usize) -> f64 {
    wheel_rad + PI * zone as f64
}

/// An angle in -π..π.
pub fn near_zero(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}

/// Between 0 and 1 in a smooth way.
pub fn ease(share: f64) -> f64 {
    let x = share.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// A wish as a motor follows it: limited acceleration, then a lag.
pub fn eased(wishes: impl Iterator<Item = f64>, limit_rad_s2: f64, lag_s: f64, step_s: f64) -> Vec<f64> {
    let (mut limited, mut smooth) = (0.0_f64, 0.0_f64);
    let follow = |wish: f64| {
        limited += (wish - limited).clamp(-limit_rad_s2 * step_s, limit_rad_s2 * step_s);
        smooth += (limited - smooth) * (step_s / lag_s);
        smooth
    };
    wishes.map(follow).collect()
}

/// Smooth path through levels that are held for a while each.
pub fn stairs(count: usize, step_s: f64, hold_s: (f64, f64), ramp_s: f64, chance: &mut Chance) -> Vec<f64> {
    let (mut level, mut until, mut now) = (0.0, 0.0, 0.0);
    let mut values = Vec::with_capacity(count);
    for at in 0..count {
        let t = at as f64 * step_s;
        if t >= until {
            level = chance.uniform(-1.0, 1.0);
            until = t + chance.uniform(hold_s.0, hold_s.1);
        }
        if at == 0 {
            now = level;
        }
        now += (level - now).clamp(-step_s / ramp_s, step_s / ramp_s);
        values.push(now);
    }
    values
}
