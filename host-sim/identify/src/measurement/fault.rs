//! Faults of data, as opposed to those of the drive.

use serde::Serialize;

use super::Session;
use super::columns::Quantity;

table! {
    /// Name of a data fault.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum FaultName: (&'static str, &'static str) {
        /// The count of an encoder is off by a constant from some instant on.
        EncoderIndexJump = ("encoder_index_jump", "check the cable, the shield and the index of the encoder"),
        /// A channel repeats one value while it should change.
        FrozenChannel = ("frozen_channel",
            "log every channel anew in each row; check the bus for values that are repeated"),
        /// Values or rows that were not recorded.
        MissingSamples = ("missing_samples", "log at a rate that bus and disk keep up with"),
        /// Time that runs back, stands, jumps or jitters.
        ClockError = ("clock_error", "stamp each row with the clock of the controller when the angles are read"),
        /// Single rows that neither the rows before nor those after bear out.
        Outliers = ("outliers", "check the cable and the interface of the encoder; latch both angles together"),
        /// A unit, a sign or a column taken for another.
        UnitMismatch = ("unit_mismatch",
            "map the columns with their units: --columns generator=NAME:UNIT,output=NAME:UNIT,torque=NAME:UNIT"),
        /// A resolution too coarse for the noise to blur it.
        Quantisation = ("quantisation", "log the full resolution of the encoder and of the torque"),
        /// A zero that moves with time, the same in every state of the drive.
        Drift = ("drift", "let bench and encoder come to a steady temperature; look after the mount of the encoder"),
        /// The two angles are not read at one instant, and the time between them scatters.
        ReadJitter = ("read_jitter",
            "latch both angles by one signal, or read both in one cycle of the bus; turn more slowly meanwhile"),
        /// The logger stands still after each block of this many rows, and its time counts on.
        Stalls = ("stalls",
            "log the time of a clock instead of counting rows; write to disk outside of the loop that reads"),
        /// The counter of an angle begins anew between sessions, whole turns of the motor off.
        CounterRestart = ("counter_restart", "log the turns of the motor, or home it before each session"),
        /// The torque counts against the sign that the wind-up shows.
        TorqueSign = ("torque_sign",
            "turn the sign of the torque round: it is positive where it turns the output forward"),
        /// The torque is of another shaft, in another unit, or of something else.
        TorqueScale = ("torque_scale", "log the torque at the output of this drive, in N·m"),
        /// The torque reads a load where there is none.
        TorqueZero = ("torque_zero", "set the torque sensor to zero while the output bears no load, warm as in use"),
        /// The count of an angle leaps by whole turns, or its zero is another one from a session on.
        PositionJump = ("position_jump", "log the position unwrapped, and keep its zero from session to session"),
        /// Rows are means over some time.
        AveragedRows = ("averaged_rows",
            "log what is read at one instant, or take means over less time than the output takes to its other flank"),
    }
}

impl FaultName {
    /// Its name in files, snake case.
    pub const fn as_str(self) -> &'static str {
        self.row().0
    }

    /// The change at the bench or in the logger by which it does not come back.
    pub const fn advice(self) -> &'static str {
        self.row().1
    }
}

/// The remedy for a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Treatment {
    /// Undone: the values used are not those of the file.
    Repaired,
    /// The rows, or the whole channel, are left out.
    Masked,
    /// Nothing: the values are used as they are.
    Kept,
}

/// A fault of the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fault {
    /// Its name.
    pub name: FaultName,
    /// The channel, if one is to blame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<Quantity>,
    /// When it begins, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// When it ends, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub until_s: Option<f64>,
    /// First line concerned.
    pub first_line: u64,
    /// Last line concerned.
    pub last_line: u64,
    /// Rows concerned; where rows are missing, how many.
    pub rows: u64,
    /// Size at the output, arcsec: of a jump signed, else of the largest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_arcsec: Option<f64>,
    /// The remedy that was applied.
    pub treatment: Treatment,
    /// One sentence for a reader.
    pub what: String,
    /// The change at the bench or in the logger by which it does not come back.
    pub advice: &'static str,
    /// Numbers of its own.
    #[serde(flatten)]
    pub measures: Measures,
}

impl Fault {
    /// A fault of `rows` rows within two lines of the file, the values kept as they are; the rest is still to say.
    pub(crate) fn new(name: FaultName, [first_line, last_line]: [u64; 2], rows: u64) -> Fault {
        Fault {
            name,
            channel: None,
            time_s: None,
            until_s: None,
            first_line,
            last_line,
            rows,
            size_arcsec: None,
            treatment: Treatment::Kept,
            what: String::new(),
            advice: name.advice(),
            measures: Measures::default(),
        }
    }

    /// An index that an encoder lost before a row of a session: the error steps, by about so much, and stays.
    pub(crate) fn lost_index(session: &Session, row: usize, size_arcsec: f64, then: &str) -> Fault {
        let what = format!(
            "the error steps by about {size_arcsec:.0} arcsec within one row and stays there, whatever else the drive \
             does: an encoder has lost its index, or a load that is not recorded has turned the flank over{then}"
        );
        let time_s = session.time_s.as_ref().map(|time| time[row]);
        let fault = Fault::new(FaultName::EncoderIndexJump, [session.line[row]; 2], 1);
        let (channel, treatment) = (Some(Quantity::Error), Treatment::Repaired);
        Fault { size_arcsec: Some(size_arcsec), time_s, what, channel, treatment, ..fault }
    }

    /// A fault of these rows, each a line and its time (s), in the order of the file; none without rows.
    pub(super) fn of_rows(name: FaultName, rows: impl IntoIterator<Item = (u64, Option<f64>)>) -> Option<Fault> {
        let mut rows = rows.into_iter();
        let (first_line, time_s) = rows.next()?;
        let (count, (last_line, until_s)) = rows.fold((1, (first_line, time_s)), |(count, _), row| (count + 1, row));
        Some(Fault { time_s, until_s, ..Fault::new(name, [first_line, last_line], count) })
    }
}

/// Numbers that only some faults have.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Measures {
    /// Scatter of the time between the readings of the two angles, one standard deviation, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jitter_ms: Option<f64>,
    /// Rows whose angles were read far apart, which are left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub late_rows: Option<u64>,
    /// The logger stands still after each block of this many rows, none where it does so irregularly; or a channel has
    /// a new value in one row of this many.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every_rows: Option<u64>,
    /// For so long (median), ms; or the time over which a row is a mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_ms: Option<f64>,
    /// Turns of the motor, with the sign of what the generator's angle lacks; the largest of several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turns: Option<i64>,
    /// Torque that is read without a load, N·m, …
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zero_n_m: Option<f64>,
    /// … and its standard deviation, N·m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zero_std_n_m: Option<f64>,
    /// Rate of a drift, arcsec/h.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arcsec_per_hour: Option<f64>,
}
