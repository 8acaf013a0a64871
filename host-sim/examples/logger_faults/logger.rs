//! A logger that reads a bench, and what goes wrong in loggers: each fault as the logger makes it.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use crate::bench::{ARCSEC, Bench, Drive, Truth};
use crate::chance::Chance;

/// What is wrong with a logger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrong {
    Nothing,
    JitterOfReads,
    LateRows,
    Stalls,
    FastClock,
    ClockUnit,
    MissingRows,
    CounterRestarts,
    RegisterWraps,
    TorqueSign,
    TorqueOfMotor,
    TorqueZero,
    TorqueSteps,
    TorqueFrozen,
    Degrees,
    Ratio,
    Outliers,
    Skew,
    FewBits,
    Drift,
    RepeatedRows,
    RowsOutOfOrder,
    SwappedColumns,
    TorqueSaturates,
    CounterSlips,
    MotorRipple,
    SlowFlanks,
}

impl Wrong {
    pub const ALL: [Wrong; 27] = [
        Wrong::Nothing,
        Wrong::JitterOfReads,
        Wrong::LateRows,
        Wrong::Stalls,
        Wrong::FastClock,
        Wrong::ClockUnit,
        Wrong::MissingRows,
        Wrong::CounterRestarts,
        Wrong::RegisterWraps,
        Wrong::TorqueSign,
        Wrong::TorqueOfMotor,
        Wrong::TorqueZero,
        Wrong::TorqueSteps,
        Wrong::TorqueFrozen,
        Wrong::Degrees,
        Wrong::Ratio,
        Wrong::Outliers,
        Wrong::Skew,
        Wrong::FewBits,
        Wrong::Drift,
        Wrong::RepeatedRows,
        Wrong::RowsOutOfOrder,
        Wrong::SwappedColumns,
        Wrong::TorqueSaturates,
        Wrong::CounterSlips,
        Wrong::MotorRipple,
        Wrong::SlowFlanks,
    ];

    pub fn name(self) -> String {
        let mut name = String::new();
        for letter in format!("{self:?}").chars() {
            if letter.is_uppercase() && !name.is_empty() {
                name.push('_');
            }
            name.push(letter.to_ascii_lowercase());
        }
        name
    }

    /// Faults of the data by which it is told rightly; empty where no record can show it, or where it is none of the
    /// logger.
    pub fn told_as(self) -> &'static [&'static str] {
        match self {
            // One angle against the other says nothing of a clock that is fast; nor is it wrong. Slow flanks are the
            // bench's.
            Wrong::Nothing | Wrong::FastClock | Wrong::MotorRipple | Wrong::SlowFlanks => &[],
            Wrong::JitterOfReads => &["read_jitter"],
            Wrong::LateRows => &["read_jitter", "outliers"],
            Wrong::Stalls => &["stalls"],
            Wrong::ClockUnit => &["clock_error"],
            Wrong::MissingRows => &["missing_samples"],
            Wrong::CounterRestarts => &["counter_restart"],
            Wrong::RegisterWraps => &["position_jump"],
            Wrong::TorqueSign => &["torque_sign"],
            Wrong::TorqueOfMotor => &["torque_scale"],
            Wrong::TorqueZero => &["torque_zero"],
            Wrong::TorqueSteps | Wrong::FewBits => &["quantisation"],
            Wrong::TorqueFrozen | Wrong::TorqueSaturates => &["frozen_channel"],
            Wrong::Degrees | Wrong::SwappedColumns => &["unit_mismatch"],
            Wrong::Ratio => &["ratio_proposed"],
            Wrong::Outliers => &["outliers", "read_jitter"],
            Wrong::Skew => &["sensor_latency"],
            Wrong::Drift => &["drift"],
            Wrong::RepeatedRows | Wrong::RowsOutOfOrder => &["clock_error"],
            Wrong::CounterSlips => &["encoder_index_jump", "position_jump"],
        }
    }

    /// The cause that is this fault by another name: these data do not tell one from the other.
    pub fn same_as(self) -> &'static str {
        match self {
            Wrong::Ratio => "ratio_error",
            Wrong::Skew => "sensor_latency",
            // Of the generator, whose encoder this is.
            Wrong::MotorRipple => "encoder_subdivision",
            _ => "",
        }
    }

    /// By how much the ratio of the drive is another than the model's.
    pub fn ratio_off(self, drive: &Drive<'_>) -> f64 {
        if self == Wrong::Ratio { drive.subject.nominal.ratio.signum() } else { 0.0 }
    }
}

/// When the channels of a row were read, s, and what the logger takes for the time.
#[derive(Clone, Copy)]
struct Reads {
    stamp: f64,
    generator: f64,
    output: f64,
    torque: f64,
}

/// A row: time s, angles rad, torque N·m, temperature °C.
pub type Row = [f64; 5];
const TIME: usize = 0;
const GENERATOR: usize = 1;
const OUTPUT: usize = 2;
const TORQUE: usize = 3;

/// A log, and what is true of it.
pub struct Log {
    sessions: Vec<Vec<Row>>,
    with_temperature: bool,
    degrees: bool,
    swapped: bool,
    /// Rows that are missing between others.
    pub missing: usize,
    /// Size of the fault, in words.
    pub size: String,
    /// Whether the rows can show it at all.
    pub shows: bool,
}

/// Median of the size of the generator's speed while it turns, rad/s.
fn speed_of(truths: &[Truth], rate_hz: f64) -> f64 {
    let mut speeds: Vec<f64> = truths
        .iter()
        .flat_map(|truth| {
            let rows = (truth.lasts_s() * rate_hz) as usize;
            (1..rows).map(move |row| {
                let at = |row: usize| truth.at(truth.begin_s + row as f64 / rate_hz)[0];
                (at(row) - at(row - 1)).abs() * rate_hz
            })
        })
        .filter(|speed| *speed > 0.1)
        .collect();
    speeds.sort_by(f64::total_cmp);
    speeds.get(speeds.len() / 2).copied().unwrap_or(1.0)
}

/// Reads a bench with a logger that has something wrong.
pub fn log(wrong: Wrong, bench: &Bench, drive: &Drive<'_>, truths: &[Truth], chance: &mut Chance) -> Log {
    let mut log = Log {
        sessions: Vec::new(),
        with_temperature: bench.with_temperature,
        degrees: wrong == Wrong::Degrees,
        swapped: wrong == Wrong::SwappedColumns,
        missing: 0,
        size: String::new(),
        shows: true,
    };
    let timing = Timing::drawn(wrong, bench, drive, truths, chance, &mut log.size);
    let values = Values::drawn(wrong, bench, drive, chance, &mut log.size);
    for (number, truth) in truths.iter().enumerate() {
        let reads = timing.reads(bench, truth, chance);
        let mut rows: Vec<Row> = reads.iter().map(|at| read(bench, truth, *at, chance)).collect();
        values.spoil(number, drive, &mut rows, chance);
        if wrong == Wrong::MissingRows {
            let before = rows.len();
            let (first, last) = (rows[0], rows[before - 1]);
            rows.retain(|row| *row == first || *row == last || !chance.is(values.share));
            log.missing += before - rows.len();
        }
        log.sessions.push(rows);
    }
    log.shows = shows(wrong, bench, drive, truths, &log.sessions);
    log
}

/// Whether rows can show what is wrong: where it changes nothing that is read, there is nothing to tell.
fn shows(wrong: Wrong, bench: &Bench, drive: &Drive<'_>, truths: &[Truth], sessions: &[Vec<Row>]) -> bool {
    let count = |of: &dyn Fn(&[Row; 2]) -> bool| {
        sessions.iter().flat_map(|rows| rows.windows(2)).filter(|pair| of(&[pair[0], pair[1]])).count()
    };
    let rows = sessions.iter().map(Vec::len).sum::<usize>() as f64;
    match wrong {
        Wrong::RegisterWraps => count(&|[before, after]| (after[GENERATOR] - before[GENERATOR]).abs() > TAU) > 0,
        // A load that is put on in steps may never come near the zero; below friction the flank stays, whatever is
        // read.
        Wrong::TorqueZero => {
            let other_side = |(truth, rows): (&Truth, &Vec<Row>)| {
                let friction = drive.subject.nominal.friction_torque_n_m;
                let wrong = |row: &&Row| truth.at(row[TIME])[2] * row[TORQUE] < 0.0 && row[TORQUE].abs() > friction;
                rows.iter().filter(wrong).count()
            };
            truths.iter().zip(sessions).map(other_side).sum::<usize>() as f64 > 0.01 * rows
        }
        Wrong::TorqueSign | Wrong::TorqueOfMotor => {
            drive.subject.nominal.wind_up_arcsec(bench.load_n_m) > 8.0 * bench.noise_arcsec
        }
        _ => true,
    }
}

/// One row as its encoders and sensors give it.
fn read(bench: &Bench, truth: &Truth, at: Reads, chance: &mut Chance) -> Row {
    let counted = |angle: f64, bits: u32| {
        let step = TAU / 2f64.powi(bits as i32);
        (angle / step).round() * step
    };
    let generator = counted(truth.at(at.generator)[0], bench.bits[0]);
    let output = counted(truth.at(at.output)[1] + bench.noise_arcsec * ARCSEC * chance.gauss(), bench.bits[1]);
    let torque = truth.at(at.torque)[2] + bench.torque_noise_n_m * chance.gauss();
    [at.stamp, generator, output, torque, 22.0 + 0.02 * chance.gauss() + 0.3 * (at.stamp / 900.0).sin()]
}

/// When a logger reads.
struct Timing {
    wrong: Wrong,
    /// A time, s, and a share; what they mean depends on what is wrong.
    time_s: f64,
    share: f64,
    every: usize,
    /// Whether the generator is the one that is read late.
    of_generator: bool,
}

impl Timing {
    fn drawn(
        wrong: Wrong,
        bench: &Bench,
        drive: &Drive<'_>,
        truths: &[Truth],
        chance: &mut Chance,
        size: &mut String,
    ) -> Timing {
        // How long the output takes to turn by the noise of its encoder: what is shorter does not show.
        let noise_s = bench.noise_arcsec * ARCSEC * drive.subject.nominal.ratio.abs() / speed_of(truths, bench.rate_hz);
        let period_s = 1.0 / bench.rate_hz;
        let mut timing = Timing {
            wrong,
            time_s: 0.0,
            share: 0.0,
            every: chance.between([30.0, 120.0]) as usize,
            of_generator: chance.is(0.5),
        };
        match wrong {
            Wrong::JitterOfReads => {
                timing.time_s = chance.by_ratio([1e-4, 5e-4]).max(3.0 * noise_s);
                *size = format!("{:.2} ms rms, {:.1} of the noise", 1e3 * timing.time_s, timing.time_s / noise_s);
            }
            Wrong::LateRows => {
                timing.share = chance.between([0.10, 0.17]);
                timing.time_s = chance.by_ratio([1e-3, 8e-3]).max(4.0 * noise_s);
                *size = format!("{:.0} % late by {:.1} ms on the mean", 100.0 * timing.share, 1e3 * timing.time_s);
            }
            Wrong::Stalls => {
                timing.time_s = chance.between([0.02, 0.05]).max(6.0 * period_s);
                *size = format!("{:.0} ms after {} rows", 1e3 * timing.time_s, timing.every);
            }
            Wrong::FastClock => timing.share = chance.sign() * chance.between([0.005, 0.02]),
            Wrong::MissingRows => timing.share = chance.between([0.1, 0.25]),
            Wrong::Skew => {
                timing.time_s = chance.by_ratio([5e-4, 5e-3]).max(3.0 * noise_s);
                *size = format!("{:.2} ms, {:.1} of the noise", 1e3 * timing.time_s, timing.time_s / noise_s);
            }
            _ => {}
        }
        timing
    }

    fn reads(&self, bench: &Bench, truth: &Truth, chance: &mut Chance) -> Vec<Reads> {
        let period_s = 1.0 / bench.rate_hz;
        let mut stood_s = 0.0;
        (0..bench.rows)
            .map(|row| {
                let counted = truth.begin_s + row as f64 * period_s;
                // A logger that stands still reads later than it counts.
                if self.wrong == Wrong::Stalls && row > 0 && row % self.every == 0 {
                    stood_s += self.time_s * chance.between([0.8, 1.2]);
                }
                let now = counted + stood_s;
                let mut at = Reads { stamp: counted, generator: now, output: now, torque: now };
                let mut later = 0.0;
                match self.wrong {
                    Wrong::JitterOfReads => later = self.time_s * chance.gauss(),
                    Wrong::LateRows if chance.is(self.share) => later = -self.time_s * chance.waiting(),
                    Wrong::Skew => later = -self.time_s,
                    Wrong::FastClock => at.stamp *= 1.0 + self.share,
                    Wrong::ClockUnit => at.stamp *= 1000.0,
                    // Stamps are taken when the operating system comes to it; the angles were latched in time.
                    Wrong::MissingRows => at.stamp += self.share * period_s * chance.gauss().clamp(-2.0, 2.0),
                    _ => {}
                }
                if self.of_generator {
                    at.generator += later;
                } else {
                    at.output += later;
                }
                at
            })
            .collect()
    }
}

/// What a logger does to values and rows.
struct Values {
    wrong: Wrong,
    /// A size and a share; what they mean depends on what is wrong.
    size: f64,
    share: f64,
    turns: Vec<f64>,
}

impl Values {
    fn drawn(wrong: Wrong, bench: &Bench, drive: &Drive<'_>, chance: &mut Chance, size: &mut String) -> Values {
        let mut values = Values { wrong, size: 0.0, share: 0.0, turns: vec![0.0; bench.sessions] };
        let ratio = drive.subject.nominal.ratio.abs();
        match wrong {
            Wrong::MissingRows => values.share = chance.between([0.01, 0.05]),
            Wrong::CounterRestarts => {
                values
                    .turns
                    .iter_mut()
                    .skip(1)
                    .for_each(|turns| *turns = chance.sign() * chance.between([2.0, 90.0]).round());
            }
            Wrong::RegisterWraps => values.size = *chance.of(&[4.0, 8.0, 16.0]),
            Wrong::TorqueOfMotor => values.size = *chance.of(&[1.0 / ratio, 0.01]),
            Wrong::TorqueZero => values.size = bench.load_n_m * chance.sign() * chance.between([0.01, 0.05]),
            Wrong::TorqueSteps => {
                // Steps are of the range of the load, from the least to the largest.
                values.share = chance.by_ratio([0.005, 0.1]);
                values.size = values.share * bench.load_n_m;
                *size = format!("{:.1} % of the load", 100.0 * values.share);
            }
            Wrong::TorqueFrozen => values.share = chance.between([0.05, 0.2]),
            Wrong::Outliers => {
                values.share = chance.between([0.02, 0.15]);
                values.size = bench.noise_arcsec * chance.by_ratio([8.0, 60.0]);
                *size = format!("{:.0} % of {:.0} arcsec", 100.0 * values.share, values.size);
            }
            Wrong::FewBits => {
                let bits = (TAU / (chance.between([4.0, 12.0]) * bench.noise_arcsec * ARCSEC)).log2().floor();
                values.size = TAU / 2f64.powf(bits);
                *size = format!("{bits} bits, steps of {:.1} of the noise", values.size / bench.noise_arcsec / ARCSEC);
            }
            Wrong::Drift => {
                values.size = chance.sign() * chance.by_ratio([500.0, 5000.0]);
                *size = format!("{:.0} arcsec/h", values.size);
            }
            Wrong::RepeatedRows => values.share = chance.between([0.005, 0.05]),
            Wrong::RowsOutOfOrder => values.share = chance.between([0.002, 0.02]),
            Wrong::TorqueSaturates => {
                values.share = chance.between([0.5, 0.8]);
                values.size = values.share * bench.load_n_m;
            }
            Wrong::CounterSlips => {
                values.size = chance.sign() * bench.noise_arcsec * ARCSEC * chance.by_ratio([15.0, 80.0]);
            }
            // Pole pairs of the motor, and six commutations for each.
            Wrong::MotorRipple => {
                values.share = *chance.of(&[4.0, 5.0, 7.0, 8.0, 10.0]) * *chance.of(&[1.0, 2.0, 6.0]);
                values.size = bench.noise_arcsec * ARCSEC * chance.between([2.0, 6.0]);
            }
            _ => {}
        }
        if size.is_empty() {
            let _ = write!(size, "{:.3}, {:.3}", values.size, values.share);
        }
        values
    }

    fn spoil(&self, session: usize, drive: &Drive<'_>, rows: &mut Vec<Row>, chance: &mut Chance) {
        let count = rows.len();
        match self.wrong {
            Wrong::CounterRestarts => {
                let turns: f64 = self.turns[..=session].iter().sum();
                rows.iter_mut().for_each(|row| row[GENERATOR] += TAU * turns);
            }
            Wrong::RegisterWraps => {
                let range = TAU * self.size;
                rows.iter_mut()
                    .for_each(|row| row[GENERATOR] = (row[GENERATOR] + 0.5 * range).rem_euclid(range) - 0.5 * range);
            }
            Wrong::TorqueSign => rows.iter_mut().for_each(|row| row[TORQUE] = -row[TORQUE]),
            Wrong::TorqueOfMotor => rows.iter_mut().for_each(|row| row[TORQUE] *= self.size),
            Wrong::TorqueZero => rows.iter_mut().for_each(|row| row[TORQUE] += self.size),
            Wrong::TorqueSteps => {
                rows.iter_mut().for_each(|row| row[TORQUE] = (row[TORQUE] / self.size).round() * self.size);
            }
            Wrong::TorqueFrozen => {
                for _ in 0..3 {
                    let lasts = (self.share / 3.0 * count as f64) as usize;
                    let from = chance.below(count - lasts);
                    let held = rows[from][TORQUE];
                    rows[from..from + lasts].iter_mut().for_each(|row| row[TORQUE] = held);
                }
            }
            // Encoders and cables mostly err to one side.
            Wrong::Outliers => {
                let side = if session.is_multiple_of(2) { 1.0 } else { -1.0 };
                for row in rows.iter_mut() {
                    if chance.is(self.share) {
                        row[OUTPUT] +=
                            side * self.size * ARCSEC * chance.waiting() * if chance.is(0.9) { 1.0 } else { -1.0 };
                    }
                }
            }
            Wrong::FewBits => {
                rows.iter_mut().for_each(|row| row[OUTPUT] = (row[OUTPUT] / self.size).floor() * self.size);
            }
            Wrong::Drift => {
                rows.iter_mut().for_each(|row| row[OUTPUT] += self.size * ARCSEC * row[TIME] / 3600.0);
            }
            Wrong::RepeatedRows => {
                let mut repeated = Vec::with_capacity(count);
                for row in rows.iter() {
                    repeated.push(*row);
                    if chance.is(self.share) {
                        repeated.push(*row);
                    }
                }
                *rows = repeated;
            }
            // Packets that overtake one another.
            Wrong::RowsOutOfOrder => {
                for row in 1..count {
                    if chance.is(self.share) {
                        rows.swap(row - 1, row);
                    }
                }
            }
            Wrong::TorqueSaturates => {
                rows.iter_mut().for_each(|row| row[TORQUE] = row[TORQUE].clamp(-self.size, self.size));
            }
            Wrong::CounterSlips => {
                // A counter that loses counts loses them: all to one side.
                let slips = 1 + chance.below(3);
                for _ in 0..slips {
                    let from = count / 20 + chance.below(9 * count / 10);
                    let by = self.size * chance.between([0.7, 1.5]);
                    rows[from..].iter_mut().for_each(|row| row[OUTPUT] += by);
                }
            }
            // The motor's own encoder errs by its poles.
            Wrong::MotorRipple => rows.iter_mut().for_each(|row| {
                let ratio = drive.subject.nominal.ratio;
                row[GENERATOR] += self.size * ratio * (self.share * row[GENERATOR]).sin();
            }),
            _ => {}
        }
    }
}

impl Log {
    /// As it stands in the file.
    pub fn csv(&self) -> String {
        let mut names = ["time_s", "generator_rad", "output_rad", "torque_n_m"];
        if self.swapped {
            names.swap(1, 2);
        }
        let mut text = names.join(",");
        text += if self.with_temperature { ",temperature_c\n" } else { "\n" };
        let angle = if self.degrees { 360.0 / TAU } else { 1.0 };
        for row in self.sessions.iter().flatten() {
            let [time, generator, output, torque, temperature] = row;
            let _ = write!(text, "{time:.6},{:.8},{:.10},{torque:.5}", generator * angle, output * angle);
            if self.with_temperature {
                let _ = write!(text, ",{temperature:.3}");
            }
            text.push('\n');
        }
        text
    }
}
