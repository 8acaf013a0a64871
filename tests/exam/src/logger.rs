//! Faults of loggers and of those who set them up, on a drive that has nothing: it is exactly as its catalogue says. A
//! name of a cause is wrong; the fault is to be reported.

use std::f64::consts::TAU;

use crate::chance::Chance;
use crate::drive::Drive;
use crate::joint::Poll;

macro_rules! faults {
    ($($variant:ident $name:literal [$($reported:literal),*]),* $(,)?) => {
        #[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
        #[value(rename_all = "snake_case")]
        pub enum LoggerFault { $($variant),* }

        impl LoggerFault {
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),* }
            }

            /// Names in `diagnosis.json` that report it, of faults and of causes that are the same thing. Where there
            /// are none, nothing in the angles is wrong, and silence is right.
            pub fn reported_as(self) -> &'static [&'static str] {
                match self { $(Self::$variant => &[$($reported),*]),* }
            }
        }
    };
}

faults! {
    ReadJitter "read_jitter" ["clock_error"],
    ReadSkew "read_skew" ["read_jitter", "clock_error", "sensor_latency"],
    LateRows "late_rows" ["read_jitter", "clock_error", "outliers"],
    Stalls "stalls" ["clock_error", "missing_samples"],
    CountedClock "counted_clock" [],
    TorqueSign "torque_sign" [],
    TorqueOfMotorSide "torque_of_motor_side" ["torque_scale", "unit_mismatch"],
    TorqueOfAnotherChannel "torque_of_another_channel" ["torque_scale", "torque_sign", "unit_mismatch"],
    DegreesAsRad "degrees_as_rad" ["unit_mismatch"],
    RatioOffByOne "ratio_off_by_one" ["ratio_mismatch", "unit_mismatch", "ratio_error"],
    CounterRestart "counter_restart" ["encoder_index_jump", "position_jump"],
    RepeatedRows "repeated_rows" ["clock_error"],
    DroppedRows "dropped_rows" [],
    OutputSign "output_sign" ["unit_mismatch", "ratio_mismatch"],
    MillisecondsAsSeconds "milliseconds_as_seconds" ["unit_mismatch", "clock_error"],
    CoarseSteps "coarse_steps" ["quantisation"],
    WrapsAt16Bit "wraps_at_16_bit" ["encoder_index_jump", "position_jump", "counter_restart", "unit_mismatch"],
}

impl LoggerFault {
    /// Whether there is anything to report: a clock that counts and rows that are left out harm no pair of angles.
    pub fn can_be_reported(self) -> bool {
        !matches!(self, Self::CountedClock | Self::DroppedRows)
    }

    /// Words of a refusal that names the fault and the mapping that mends it; none where a refusal is no answer.
    pub fn refused_with(self) -> &'static [&'static str] {
        match self {
            Self::DegreesAsRad => &["--columns generator=generator_rad:deg", "--columns output=output_rad:deg"],
            Self::OutputSign => &["--columns output=output_rad:-rad"],
            Self::MillisecondsAsSeconds => &["--columns time=time_s:ms"],
            _ => &[],
        }
    }

    /// The logger with the fault.
    pub fn poll(self, poll: Poll, chance: &mut Chance) -> Poll {
        match self {
            Self::ReadJitter => Poll { jitter_s: chance.log_uniform(5e-5, 5e-4), ..poll },
            Self::ReadSkew => Poll { skew_s: chance.sign() * chance.log_uniform(3e-4, 5e-3), ..poll },
            Self::LateRows => Poll { late_reads: chance.uniform(0.10, 0.17), ..poll },
            Self::Stalls => Poll { stalls_s: (0.030, 0.046), counted: Some(1.0), ..poll },
            Self::CountedClock => Poll { counted: Some(1.0 + chance.sign() * chance.log_uniform(1e-3, 3e-2)), ..poll },
            _ => poll,
        }
    }

    /// Damages the rows: time, generator, output, torque, temperature, orientation.
    pub fn spoil(self, rows: &mut Vec<[f64; 6]>, session_start: &[usize], drive: &Drive, chance: &mut Chance) {
        match self {
            Self::TorqueSign => rows.iter_mut().for_each(|row| row[3] = -row[3]),
            Self::TorqueOfMotorSide => rows.iter_mut().for_each(|row| row[3] /= drive.ratio()),
            Self::TorqueOfAnotherChannel => {
                // That of a neighbour who swings at his own pace.
                let (hz, share) = (chance.uniform(0.05, 0.4), chance.uniform(0.3, 0.8));
                let (mean, phase) = (chance.uniform(-0.2, 0.2), chance.phase());
                for row in rows {
                    row[3] =
                        drive.rated_n_m * (mean + share * (TAU * hz * row[0] + phase).sin()) + 0.01 * chance.normal();
                }
            }
            Self::DegreesAsRad => match chance.below(3) {
                0 => rows.iter_mut().for_each(|row| row[1] = row[1].to_degrees()),
                1 => rows.iter_mut().for_each(|row| row[2] = row[2].to_degrees()),
                _ => rows.iter_mut().for_each(|row| (row[1], row[2]) = (row[1].to_degrees(), row[2].to_degrees())),
            },
            Self::CounterRestart => {
                let mut off = 0.0;
                for (at, row) in rows.iter_mut().enumerate() {
                    if at > 0 && session_start.contains(&at) {
                        off = TAU * (40.0 * chance.normal()).round();
                    }
                    row[1] -= off;
                }
            }
            Self::RepeatedRows => {
                let share = chance.log_uniform(0.002, 0.05);
                let doubled = rows.drain(..).flat_map(|row| {
                    let times = if chance.one_in(share) { 2 } else { 1 };
                    std::iter::repeat_n(row, times)
                });
                *rows = doubled.collect::<Vec<_>>();
            }
            Self::DroppedRows => {
                let share = chance.log_uniform(0.005, 0.1);
                rows.retain(|_| !chance.one_in(share));
            }
            Self::OutputSign => rows.iter_mut().for_each(|row| row[2] = -row[2]),
            Self::MillisecondsAsSeconds => rows.iter_mut().for_each(|row| row[0] *= 1000.0),
            Self::CoarseSteps => {
                let step = TAU / f64::from(1 << (13 + chance.below(3)));
                rows.iter_mut().for_each(|row| row[2] = (row[2] / step).round() * step);
            }
            Self::WrapsAt16Bit => {
                // 4096 counts a turn in a register of 16 bit: it wraps every sixteen turns of the generator.
                let turns = 16.0 * TAU;
                rows.iter_mut().for_each(|row| row[1] = (row[1] + 0.5 * turns).rem_euclid(turns) - 0.5 * turns);
            }
            Self::ReadJitter
            | Self::ReadSkew
            | Self::LateRows
            | Self::Stalls
            | Self::CountedClock
            | Self::RatioOffByOne => {}
        }
    }

    /// The catalogue that the diagnosis is given.
    pub fn catalogue(self, drive: &Drive) -> Drive {
        let mut given = drive.clone();
        if self == Self::RatioOffByOne {
            given.flexspline_teeth += 2;
            given.circular_spline_teeth += 2;
        }
        given
    }
}
