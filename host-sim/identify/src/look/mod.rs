//! The contents of log files of a gear on a bench: separators, columns with role and unit, ratio, counts of a turn,
//! sign of a torque, time, coverage; and the mapping to read them with.
//!
//! Names, units and numbers are asked in this order. Whatever is guessed says why, and how sure it is; nothing is used
//! silently: the mapping is proposed, and the reader takes it only when it is given.

mod column;
mod coverage;
mod pair;
mod picture;
mod relation;
mod turns;
mod words;

use std::f64::consts::TAU;
use std::sync::Arc;

use serde::Serialize;

use crate::measurement::raw::RawFile;
use crate::measurement::{
    APART, MappedColumn, MeasuredError, Quantity, ReadRows, Reading, Unit, continued, median_of, sampled,
};
use column::Facts;
pub(crate) use coverage::Coverage;
use pair::pair;
pub use picture::text;
use relation::{CLEAR, torque_says};
use turns::{proposed_ratio, units_of_counts};
use words::NameMeaning;

table! {
    /// The contents of a column, as far as they can be decided, and their place in a mapping, if they have one.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Role: Option<Quantity> {
        /// Time.
        Time = Some(Quantity::Time),
        /// Generator angle.
        Generator = Some(Quantity::Generator),
        /// Output angle.
        Output = Some(Quantity::Output),
        /// Output angle less generator over ratio.
        Error = Some(Quantity::Error),
        /// Load torque.
        Torque = Some(Quantity::Torque),
        /// A motor current, which may stand for the torque.
        Current = Some(Quantity::Torque),
        /// Temperature.
        Temperature = Some(Quantity::Temperature),
        /// Angle against gravity.
        Orientation = Some(Quantity::Orientation),
        /// A speed: not needed.
        Speed = None,
        /// A value that was commanded, not measured.
        Command = None,
        /// Not known.
        #[default]
        Unknown = None,
    }
}

impl Role {
    fn is_angle(self) -> bool {
        matches!(self, Role::Generator | Role::Output | Role::Orientation)
    }
}

/// A column.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct LookedColumn {
    /// Its name, `#1` and so on where the file has none.
    pub name: String,
    /// Its contents.
    pub role: Role,
    /// Its unit, with sign and gain as a mapping takes it; `None` if it cannot be decided.
    pub unit: Option<String>,
    /// How sure role and unit are, 0 to 1: a judgement, not a probability.
    pub confidence: f64,
    /// Why.
    pub why: Vec<String>,
    /// Least number.
    pub least: f64,
    /// Largest.
    pub most: f64,
    /// Smallest change from row to row.
    pub step: f64,
    /// Rows without a number.
    pub missing: usize,
    /// Counts of a turn, where they are counts and that can be decided.
    pub counts_per_turn: Option<f64>,
    /// Whether the proposed mapping uses it.
    pub used: bool,
}

/// Kinds of time in a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TimeKind {
    /// Stamps of a clock, which jitter.
    Measured,
    /// Rows times a period.
    Counted,
    /// No time.
    None,
}

/// Contents of the files.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Looked {
    /// The files.
    pub files: Vec<String>,
    /// Rows of all.
    pub rows: usize,
    /// Rows of another width than the header.
    pub odd_rows: usize,
    /// Between fields.
    pub separator: &'static str,
    /// Whether decimals follow a comma.
    pub decimal_comma: bool,
    /// Line of the names of the first file; `None` if it names none.
    pub header_line: Option<u64>,
    /// The columns.
    pub columns: Vec<LookedColumn>,
    /// Turns of the generator for one of the output as the rows have it, signed.
    pub ratio_found: Option<f64>,
    /// The whole number next to it.
    pub ratio_proposed: Option<f64>,
    /// Sessions: files, and their parts between gaps in time.
    pub sessions: usize,
    /// The kind of time.
    pub time: TimeKind,
    /// Median of the time from row to row, s, if a time was found.
    pub period_s: Option<f64>,
    /// The turns, loads, temperatures and speeds of the rows.
    pub coverage: Option<Coverage>,
    /// The value for `--columns`; `None` if generator and output, or an error, cannot be decided.
    pub columns_option: Option<String>,
    /// Questions to whoever knows the bench.
    pub notes: Vec<String>,
}

/// A column at work.
#[derive(Clone, Default)]
struct Guess {
    /// As it is reported; its unit is written last.
    column: LookedColumn,
    /// Its name in a mapping.
    name: String,
    facts: Facts,
    said: NameMeaning,
    unit: Option<Unit>,
    /// A unit that is written and not known.
    unknown_unit: Option<String>,
    negative: bool,
    /// Numbers made continuous.
    values: Vec<f64>,
    /// File of each number, from 0.
    of_file: Arc<[f64]>,
}

impl Guess {
    fn because(&mut self, why: impl Into<String>, confidence: f64) {
        self.column.why.push(why.into());
        self.column.confidence = confidence;
    }

    /// Whether it has this role and is in use.
    fn serves_as(&self, role: Role) -> bool {
        self.column.used && self.column.role == role
    }

    /// One of its numbers, rad, if that can be decided.
    fn rad(&self) -> Option<f64> {
        turns::rad(self.unit?, self.column.counts_per_turn)
    }

    /// Its numbers, rad, if that can be decided.
    fn in_rad(&self) -> Option<Vec<f64>> {
        let rad = self.rad()?;
        Some(self.values.iter().map(|value| rad * value).collect())
    }

    /// Whether a time is in days as spreadsheets count them: a date from 1954 to 2119, and rows at most a quarter of an
    /// hour apart.
    fn is_in_days(&self) -> bool {
        let Facts { least, most, step, whole, .. } = self.facts;
        least >= 20_000.0 && most <= 80_000.0 && most - least < 1000.0 && !whole && step < 0.01
    }

    fn moves(&self) -> bool {
        self.facts.finite >= 16 && !self.facts.constant()
    }

    /// Whether it may be of one of these joints: no number says against it.
    fn of_joints(&self, joints: &[u32]) -> bool {
        joints.is_empty() || self.said.joint.is_none_or(|joint| joints.contains(&joint))
    }

    /// The column of the reader by the mapping, if it is in use.
    fn mapped(&self, place: usize) -> Option<MappedColumn> {
        let quantity = self.column.role.row().filter(|_| self.column.used)?;
        let reading = Reading::parse(&self.written()?, quantity.family(), None).ok()?;
        Some(MappedColumn { quantity, name: self.name.clone(), place, reading, said: false })
    }

    /// The unit as a mapping takes it.
    fn written(&self) -> Option<String> {
        let sign = if self.negative { "-" } else { "" };
        turns::written(self.unit?, self.column.counts_per_turn).map(|unit| sign.to_owned() + &unit)
    }

    /// Its entry in a mapping, with a word in place of a unit that is open.
    fn entry(&self) -> String {
        let open = if self.unit.is_some() { "count/COUNTS" } else { "UNIT" };
        let quantity = self.column.role.row().map_or("", Quantity::name);
        format!("{quantity}={}:{}", self.name, self.written().as_deref().unwrap_or(open))
    }
}

/// The column in use for a role.
fn used(guesses: &[Guess], role: Role) -> Option<&Guess> {
    guesses.iter().find(|guess| guess.serves_as(role))
}

/// Looks at files of one bench.
///
/// # Errors
/// The files do not have the same columns.
pub fn look(files: &[RawFile]) -> Result<Looked, MeasuredError> {
    let first = files.first().ok_or_else(|| MeasuredError::of_file("look", &"no file"))?;
    let layout = &first.sheet.layout;
    if let Some(other) = files.iter().find(|other| other.sheet.layout.names != layout.names) {
        let [has, due] = [other, first].map(|file| file.sheet.layout.names.join(", "));
        let what = format!("columns {has}, but {} has {due}; allowed: logs of one form together", first.file);
        return Err(MeasuredError::of_file(&other.file, &what));
    }
    let of_file = |file: &RawFile, note: String| if files.len() > 1 { format!("{}: {note}", file.file) } else { note };
    let mut notes: Vec<String> = Vec::new();
    for file in files {
        let said = file.sheet.notes.iter().chain(&file.columns.notes).cloned();
        notes.extend(said.map(|note| of_file(file, note)));
    }
    let rows: Arc<[f64]> =
        files.iter().enumerate().flat_map(|(k, file)| vec![k as f64; file.columns.lines.len()]).collect();
    let mut guesses: Vec<Guess> = (0..layout.names.len()).map(|place| guess(files, place, &rows)).collect();
    time(&mut guesses, first.columns.lines.len());
    units_of_counts(&mut guesses);
    let ratio = pair(&mut guesses, &mut notes);
    notes.extend(apart(&guesses).filter(|_| ratio.is_none()));
    settle(&mut guesses);
    let proposed = ratio.map(proposed_ratio);
    let error = error_rad(&guesses, proposed);
    torque(&mut guesses, error.as_deref(), &mut notes);
    ask_for_units(&mut guesses, &mut notes);
    let mut columns_option = option(&guesses, &mut notes);
    // From here on the rows are those that `calibrate` and `diagnose` have by this mapping.
    let columns: Vec<MappedColumn> = guesses.iter().enumerate().filter_map(|(k, guess)| guess.mapped(k)).collect();
    let mut read = Vec::new();
    for file in files {
        let (mut rows, refused) = ReadRows::of_raw(file, &columns, ratio);
        notes.extend(rows.notes.drain(..).map(|note| of_file(file, note)));
        if rows.milliseconds {
            // The refusal holds both readings; the mapping holds the one that fits the rows.
            let time = guesses.iter_mut().filter(|guess| guess.serves_as(Role::Time));
            time.for_each(|time| time.unit = Some(Unit::Millisecond));
            columns_option = option(&guesses, &mut Vec::new());
        }
        // A cell in use that is no number, or a row of another width, is for people to mend.
        if let Some(refused) = refused {
            let mend = if rows.milliseconds { "" } else { ": mend it or take it out" };
            let then = columns_option.take().map_or(String::new(), |columns| format!("; then --columns {columns}"));
            notes.push(format!("{refused}{mend}{then}"));
        }
        read.push(rows);
    }
    let (time, period_s) = clock(&read);
    Ok(Looked {
        files: files.iter().map(|file| file.file.clone()).collect(),
        rows: rows.len(),
        odd_rows: files.iter().map(|file| file.columns.odd.len()).sum(),
        separator: layout.separator.name(),
        decimal_comma: layout.decimal_comma,
        header_line: layout.has_names.then_some(layout.header_line),
        ratio_found: ratio,
        ratio_proposed: proposed,
        sessions: read.iter().map(|rows| rows.log.sessions().count().max(1)).sum(),
        time,
        period_s,
        coverage: coverage::of(&read),
        columns_option,
        columns: guesses.into_iter().map(|guess| LookedColumn { unit: guess.written(), ..guess.column }).collect(),
        notes,
    })
}

/// The contents of a column by its name and its numbers alone.
fn guess(files: &[RawFile], place: usize, of_file: &Arc<[f64]>) -> Guess {
    let layout = &files[0].sheet.layout;
    let (name, unit) = (&layout.names[place], layout.units.get(place).filter(|unit| !unit.is_empty()));
    let mut cells = files[0].columns.cells[place].clone();
    files[1..].iter().for_each(|file| cells.values.extend_from_slice(&file.columns.cells[place].values));
    let facts = Facts::of(&cells);
    let said = if layout.has_names { words::said(name, unit.map(String::as_str)) } else { NameMeaning::default() };
    let mut values = std::mem::take(&mut cells.values);
    facts.anew.into_iter().for_each(|anew| continued(&mut values, anew.span));
    let (least, most, step, missing) = (facts.least, facts.most, facts.step, values.len() - facts.finite);
    let column = LookedColumn { name: name.clone(), least, most, step, missing, ..LookedColumn::default() };
    let name_in_mapping = name_in_mapping(&layout.names, place);
    let mut guess =
        Guess { column, name: name_in_mapping, facts, said, values, of_file: of_file.clone(), ..Guess::default() };
    if cells.times.count > 0 && cells.times.count + cells.empty + cells.words.count >= guess.values.len() {
        (guess.column.role, guess.unit) = (Role::Time, Some(Unit::Iso));
        guess.because("times written as text", 0.95);
        return guess;
    }
    if guess.facts.finite == 0 {
        guess.because(if cells.words.count > 0 { "words" } else { "empty" }, 0.9);
        return guess;
    }
    let role = if said.commanded && said.role != Some(Role::Torque) { Some(Role::Command) } else { said.role };
    if let Some(role) = role {
        guess.column.role = role;
        let (why, sure) = if said.commanded { ("its name: wanted, not measured", 0.6) } else { ("its name", 0.8) };
        guess.because(why, sure);
    } else if said.angle {
        guess.because("its name: an angle", 0.5);
    }
    if guess.facts.constant() {
        guess.because(format!("keeps the value {}", guess.facts.least), 0.3);
    }
    if let Some(anew) = guess.facts.anew {
        guess.column.why.push(anew.text(""));
    }
    let by = if unit.is_some() { "line of units" } else { "name" };
    let written = unit.map(String::as_str).or_else(|| Unit::bracketed(name));
    guess.unknown_unit =
        written.filter(|unit| !["-", "1"].contains(unit) && Unit::in_brackets(unit).is_none()).map(str::to_owned);
    let unit = unit.and_then(|unit| Unit::in_brackets(unit)).or_else(|| Unit::in_name(name));
    let role = guess.column.role;
    if let Some(unit) = unit.filter(|unit| fits(role, *unit)) {
        guess.unit = Some(unit);
        guess.column.why.push(format!("{unit} by its {by}"));
    } else if role.is_angle() || matches!(role, Role::Unknown | Role::Command) {
        unit_of_numbers(&mut guess, name);
    } else if let Some(unit) = match role {
        Role::Torque => Some(Unit::NewtonMetre),
        Role::Error => Some(Unit::Arcsecond),
        Role::Temperature => Some(Unit::Celsius),
        _ => None,
    } {
        guess.unit = Some(unit);
        guess.because(format!("{unit}, for want of a unit"), 0.5);
    }
    guess
}

/// Whether a unit is one of the role.
fn fits(role: Role, unit: Unit) -> bool {
    match role {
        Role::Current => matches!(unit, Unit::Ampere | Unit::Milliampere),
        Role::Speed => false,
        _ => role.row().is_none_or(|quantity| quantity.family() == unit.family()),
    }
}

/// The unit of an angle by the turn after which it begins anew, or by whole numbers.
fn unit_of_numbers(guess: &mut Guess, name: &str) {
    let is_turn = |span: f64, unit: Unit| (span * unit.factor() / TAU - 1.0).abs() < 1e-9;
    let by_turn = guess.facts.anew.and_then(|anew| Unit::ANGLES.into_iter().find(|unit| is_turn(anew.span, *unit)));
    let counted = ["inc", "count", "tick", "cnt"].iter().any(|word| name.to_lowercase().contains(word));
    if let Some(unit) = by_turn {
        guess.unit = Some(unit);
        guess.column.why.push(format!("{unit} by the turn"));
    } else if guess.facts.whole && (counted || guess.facts.most - guess.facts.least > 1000.0) {
        guess.unit = Some(Unit::Count);
        guess.column.why.push("whole numbers: counts".to_owned());
    }
}

/// A sentence on generator and output if no row has both.
fn apart(guesses: &[Guess]) -> Option<String> {
    let of = |role: Role| guesses.iter().position(|guess| guess.column.role == role && guess.moves());
    let (generator, output) = (of(Role::Generator)?, of(Role::Output)?);
    let mut both = guesses[generator].values.iter().zip(&guesses[output].values);
    let apart = both.all(|(generator, output)| generator.is_nan() || output.is_nan());
    apart.then(|| format!("columns {} and {}{APART}", generator + 1, output + 1))
}

/// The column of time: by name, or the one that rises evenly.
fn time(guesses: &mut [Guess], first_file: usize) {
    if guesses.iter().all(|guess| guess.column.role != Role::Time) {
        let evenly = |guess: &Guess| {
            let steps: Vec<f64> = guess.values[..first_file].windows(2).map(|pair| pair[1] - pair[0]).collect();
            let usual = median_of(&mut sampled(&steps));
            // One step in ten may be of another length.
            let odd = steps.iter().filter(|step| (*step - usual).abs() > 0.5 * usual).count();
            guess.facts.rises && usual > 0.0 && 10 * odd < steps.len()
        };
        // Where more than one does, the first: loggers begin with the time.
        let nameless = |guess: &Guess| guess.column.role == Role::Unknown && !guess.said.angle;
        if let Some(guess) = guesses.iter_mut().find(|guess| nameless(guess) && guess.moves() && evenly(guess)) {
            (guess.column.role, guess.unit) = (Role::Time, None);
            guess.because("rises evenly from row to row", 0.5);
        }
    }
    // Of several that are called so, one that moves.
    let best = guesses.iter().position(|guess| guess.column.role == Role::Time && guess.moves());
    for (place, guess) in guesses.iter_mut().enumerate().filter(|(_, guess)| guess.column.role == Role::Time) {
        guess.column.used = Some(place) == best;
        if guess.unit.is_none() {
            // Seconds since 1970 have ten digits, their thousandths thirteen.
            let size = guess.facts.most;
            let (unit, why) = match size {
                s if s > 1e17 => (Unit::Nanosecond, "nanoseconds since 1970"),
                s if s > 1e14 => (Unit::Microsecond, "microseconds since 1970"),
                s if s > 1e11 => (Unit::Millisecond, "milliseconds since 1970"),
                s if s > 1e9 => (Unit::Second, "seconds since 1970"),
                _ if guess.is_in_days() => (Unit::Day, "days since 1900, as spreadsheets count"),
                _ => (Unit::Second, "s, for want of a unit"),
            };
            guess.unit = Some(unit);
            guess.because(why, if size > 1e9 { guess.column.confidence } else { guess.column.confidence.min(0.6) });
        }
    }
}

/// Roles that only one column may have, besides the output, which a pair decides: the first that moves.
fn settle(guesses: &mut [Guess]) {
    let paired = used(guesses, Role::Output).is_some();
    let joints = pair::joints(guesses);
    for role in [Role::Generator, Role::Error, Role::Temperature, Role::Orientation] {
        // An error is not needed in addition to an output.
        if used(guesses, role).is_some() || role == Role::Error && paired {
            continue;
        }
        let may = |guess: &Guess| guess.column.role == role && guess.moves();
        let place = guesses.iter().position(|guess| may(guess) && guess.of_joints(&joints));
        let Some(place) = place.or_else(|| guesses.iter().position(may)) else { continue };
        let guess = &mut guesses[place];
        guess.column.used = true;
        if guess.unit.is_none() && role.is_angle() {
            guess.unit = Some(Unit::Radian);
            guess.because("rad, for want of a unit", 0.4);
        }
    }
}

/// The error (rad) as far as it can be computed.
fn error_rad(guesses: &[Guess], ratio: Option<f64>) -> Option<Vec<f64>> {
    let (Some(generator), Some(output), Some(ratio)) =
        (used(guesses, Role::Generator), used(guesses, Role::Output), ratio)
    else {
        return used(guesses, Role::Error)?.in_rad();
    };
    let (generator, output) = (generator.in_rad()?, output.in_rad()?);
    Some(output.iter().zip(&generator).map(|(output, generator)| output - generator / ratio).collect())
}

/// Numbers, with commas.
fn listed<T: ToString>(numbers: impl IntoIterator<Item = T>) -> String {
    numbers.into_iter().map(|number| number.to_string()).collect::<Vec<_>>().join(", ")
}

/// Which column may be the torque, and which way it counts.
fn torque(guesses: &mut [Guess], error: Option<&[f64]>, notes: &mut Vec<String>) {
    let output = used(guesses, Role::Output).and_then(Guess::in_rad);
    let joints = pair::joints(guesses);
    let may = |guess: &Guess| matches!(guess.column.role, Role::Torque | Role::Current) && guess.moves();
    let candidates: Vec<usize> =
        (0..guesses.len()).filter(|k| may(&guesses[*k]) && guesses[*k].of_joints(&joints)).collect();
    if candidates.is_empty() && guesses.iter().any(may) {
        notes.push(format!("the columns of torque are of other joints than {}: none is proposed", listed(&joints)));
        return;
    }
    // A torque before a current, what was measured before what was wanted, then what explains more per cent; of two
    // that are one torque in two units, the last.
    let mut best: Option<((bool, bool, f64), usize)> = None;
    for &k in &candidates {
        let guess = &mut guesses[k];
        let is_torque = guess.column.role == Role::Torque;
        let says =
            error.zip(output.as_deref()).and_then(|(error, o)| torque_says(error, o, &guess.values, &guess.of_file));
        let (slope, share) = says.unwrap_or_default();
        if share > CLEAR {
            guess.negative = slope < 0.0;
            let (way, percent) = (if guess.negative { "against" } else { "with" }, 100.0 * share);
            let why =
                format!("the error moves {way} it: it explains {percent:.0} % in addition to the turn of the output");
            guess.because(why, if is_torque { 0.8 } else { 0.5 });
        } else {
            guess.because("its sign does not show here", 0.4);
        }
        let rank = (is_torque, !guess.said.commanded, (100.0 * share).round());
        if best.is_none_or(|(most, _)| rank >= most) {
            best = Some((rank, k));
        }
    }
    let Some((_, best)) = best else {
        // A load that does not change is a load: without it the table would be one for none.
        let constant = |guess: &&mut Guess| guess.column.role == Role::Torque && guess.facts.finite > 0;
        guesses.iter_mut().find(constant).into_iter().for_each(|guess| guess.column.used = true);
        return;
    };
    let (place, guess) = (best + 1, &mut guesses[best]);
    let written = guess.written().unwrap_or_else(|| "A*GAIN".to_owned());
    guess.column.used = !written.contains("GAIN");
    if !guess.column.used {
        let unit = guess.unit.map_or("current", Unit::name);
        notes.push(format!(
            "column {place} is in {unit}: give the torque for one of it in place of GAIN, torque=#{place}:{written}"
        ));
    }
    if candidates.len() > 1 {
        let all = listed(candidates.iter().map(|k| k + 1));
        notes.push(format!("columns {all} may be the torque: column {place} is proposed"));
    }
    if guess.negative {
        notes.push(format!("column {place} counts the torque the other way round: it is proposed with a minus"));
    }
}

/// Asks for the units of columns in use that are written and not known.
fn ask_for_units(guesses: &mut [Guess], notes: &mut Vec<String>) {
    for (place, guess) in guesses.iter_mut().enumerate().filter(|(_, guess)| guess.column.used) {
        let Some((unit, quantity)) = guess.unknown_unit.take().zip(guess.column.role.row()) else { continue };
        let refusal = quantity.family().refusal(&unit);
        (guess.unit, guess.column.counts_per_turn, guess.column.confidence) = (None, None, 0.0);
        notes.push(format!("column {}, {quantity}: {refusal}", place + 1));
    }
}

/// Kind of time and median step, s.
fn clock(read: &[ReadRows]) -> (TimeKind, Option<f64>) {
    let steps = || read.iter().flat_map(|rows| rows.stamps_s.windows(2).map(|pair| pair[1] - pair[0]));
    let forward: Vec<f64> = steps().filter(|step| *step > 0.0).collect();
    if forward.is_empty() {
        return (TimeKind::None, None);
    }
    let period = median_of(&mut sampled(&forward));
    // Stamps of a clock differ by more than they are rounded to.
    let finest = steps().map(f64::abs).filter(|step| *step > 0.0).fold(period, f64::min);
    let latest = read.iter().flat_map(|rows| &rows.stamps_s).fold(0.0, |most: f64, at| most.max(at.abs()));
    let rounded = 1.01e-3 * finest + 1e-9 * latest;
    let even = forward.iter().filter(|step| (*step - period).abs() <= rounded.max(1e-4 * period)).count();
    let kind = if even as f64 > 0.98 * forward.len() as f64 { TimeKind::Counted } else { TimeKind::Measured };
    (kind, Some(period))
}

/// The mapping, if generator and output or an error are known.
fn option(guesses: &[Guess], notes: &mut Vec<String>) -> Option<String> {
    let mut entries: Vec<String> = guesses.iter().filter(|guess| guess.column.used).map(Guess::entry).collect();
    let [generator, output, error] =
        [Role::Generator, Role::Output, Role::Error].map(|role| used(guesses, role).is_some());
    let mut open = guesses.iter().filter(|guess| guess.column.used && guess.written().is_none()).count();
    if open > 0 {
        // Without the turn of the one, nothing shows that another angle follows it.
        let is_other = |guess: &&Guess| guess.said.angle && guess.column.role == Role::Unknown && guess.moves();
        let mut others = guesses.iter().filter(is_other);
        if let (true, false, Some(other), None) = (generator, output || error, others.next(), others.next()) {
            entries.push(format!("output{}", other.entry()));
            open += usize::from(other.written().is_none());
        }
        let (entries, which) = (entries.join(","), if open == 1 { "that column" } else { "these columns" });
        let (what, word) = if entries.contains("UNIT") { ("unit", "UNIT") } else { ("counts of a turn", "COUNTS") };
        notes.push(format!("give the {what} of {which} in place of {word}: --columns {entries}"));
        return None;
    }
    if generator && (output || error) {
        return Some(entries.join(","));
    }
    // The column of a role by its name, in use or not.
    let named = |role: Role| guesses.iter().find(|guess| guess.column.role == role && guess.moves());
    let entry = |role: Role| {
        let unit = used(guesses, role).and_then(Guess::written).unwrap_or_else(|| "UNIT".to_owned());
        format!("{}:{unit}", named(role).map_or("NAME", |guess| &guess.name))
    };
    let what = if generator && named(Role::Output).is_some() {
        "the column that is called an output does not follow the generator as one, in its unit"
    } else {
        "which columns are generator and output is not known"
    };
    let (generator, output) = (entry(Role::Generator), entry(Role::Output));
    notes.push(format!("{what}: name them, --columns generator={generator},output={output}"));
    None
}

/// A column as a mapping names it: names with signs of the mapping in them, and names that are there twice, go by
/// number.
fn name_in_mapping(names: &[String], place: usize) -> String {
    let name = &names[place];
    let twice = names.iter().filter(|other| *other == name).count() > 1;
    let plain = !twice && !name.is_empty() && !name.contains([',', ':', '=', '"', '\'']);
    if plain { name.clone() } else { format!("#{}", place + 1) }
}

#[cfg(test)]
mod tests;
