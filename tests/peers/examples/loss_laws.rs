//! Two laws of a torsional loop on measured ones: `loss_laws FILE.csv …`
//!
//! Each file has `cycle, t_s, torque_est_Nm, angle_arcmin` (others are passed over): the output held, the torque taken
//! up and down, first through small cycles, then through large ones, which are numbered from 100 on. Both laws are
//! fitted to all large cycles but the last, by least squares over the same curve of the torque (1, T, T |T|, T³), and
//! tell the last and the small ones, from one run through the whole record:
//!
//! - springs that slip (Maxwell; `MaxwellSlip` of the core): the angle lags by what
//!   `zᵢ ← clamp(zᵢ + ΔT, −wᵢ, wᵢ)` hold, `wᵢ` at fixed shares of the largest torque;
//! - a loss that follows the load (mujoco issue 3528, fitted there to strain wave drives):
//!   `ż = (ω − |ω| z)/h`, `τ = µ_avg |T| z + µ_dif T z²` and viscous, over a spring; `h` is searched for.

use std::process::ExitCode;

use flexspline_algebra::{Mat, cholesky};

/// Shares of the largest torque at which the springs slip. A guess: a factor of three from one to the next.
const SLIPS: [f64; 4] = [0.02, 0.06, 0.2, 0.6];
/// Cycles from this number on go to the full torque.
const FIRST_LARGE: u32 = 100;

struct Record {
    cycle: Vec<u32>,
    time_s: Vec<f64>,
    torque_n_m: Vec<f64>,
    angle_arcmin: Vec<f64>,
}

fn read(path: &str) -> Result<Record, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{path}: {error}"))?;
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or("").split(',').collect();
    let at = |name: &str| header.iter().position(|column| *column == name).ok_or(format!("{path}: no column {name}"));
    let at = [at("cycle")?, at("t_s")?, at("torque_est_Nm")?, at("angle_arcmin")?];
    let mut record = Record { cycle: vec![], time_s: vec![], torque_n_m: vec![], angle_arcmin: vec![] };
    for (k, line) in lines.enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |at: usize| {
            let cell = cells.get(at).copied().unwrap_or("");
            cell.parse::<f64>().map_err(|_| format!("{path}:{}: {}: \"{cell}\" is no number", k + 2, header[at]))
        };
        record.cycle.push(number(at[0])? as u32);
        record.time_s.push(number(at[1])?);
        record.torque_n_m.push(number(at[2])?);
        record.angle_arcmin.push(number(at[3])?);
    }
    Ok(record)
}

impl Record {
    fn largest_n_m(&self) -> f64 {
        self.torque_n_m.iter().fold(0.0, |most: f64, torque| most.max(torque.abs()))
    }

    /// The curve of the torque that both laws are over.
    fn curve(&self) -> Vec<Vec<f64>> {
        let most = self.largest_n_m();
        let of = |f: fn(f64) -> f64| self.torque_n_m.iter().map(|torque| f(torque / most)).collect();
        vec![of(|_| 1.0), of(|t| t), of(|t| t * t.abs()), of(|t| t.powi(3))]
    }

    fn springs_that_slip(&self) -> Vec<Vec<f64>> {
        let most = self.largest_n_m();
        SLIPS
            .iter()
            .map(|share| {
                let (width, mut held, mut before) = (share * most, 0.0, 0.0);
                let follow = |torque: &f64| {
                    held = f64::clamp(held + torque - before, -width, width);
                    before = *torque;
                    held / width
                };
                self.torque_n_m.iter().map(follow).collect()
            })
            .collect()
    }

    /// The loss at this `h`, arcmin.
    fn loss_of_the_load(&self, h: f64) -> Vec<Vec<f64>> {
        let most = self.largest_n_m();
        let mut columns = vec![Vec::new(); 3];
        let mut z = 0.0;
        for k in 0..self.cycle.len() {
            let last = k.saturating_sub(1);
            let moved = self.angle_arcmin[k] - self.angle_arcmin[last];
            // Exact while the angle moves one way.
            z = moved.signum() + (z - moved.signum()) * (-moved.abs() / h).exp();
            let load = self.torque_n_m[k] / most;
            columns[0].push(load.abs() * z);
            columns[1].push(load * z * z);
            columns[2].push(moved / (self.time_s[k] - self.time_s[last]).max(1e-3));
        }
        columns
    }
}

/// Least squares of these columns over the rows that `used` takes: what they leave of all rows.
fn left(columns: &[Vec<f64>], angle: &[f64], used: impl Fn(usize) -> bool) -> Vec<f64> {
    let rows: Vec<usize> = (0..angle.len()).filter(|k| used(*k)).collect();
    let n = columns.len();
    let scale: Vec<f64> =
        columns.iter().map(|c| rows.iter().map(|k| c[*k] * c[*k]).sum::<f64>().sqrt().max(f64::MIN_POSITIVE)).collect();
    let product = |i: usize, values: &[f64]| rows.iter().map(|k| columns[i][*k] * values[*k]).sum::<f64>() / scale[i];
    // A trace of a ridge: columns may be alike.
    let gram = Mat::from_fn(n, n, |i, j| product(i, &columns[j]) / scale[j] + if i == j { 1e-10 } else { 0.0 });
    let right = Mat::from_fn(n, 1, |i, _| product(i, angle));
    let found = cholesky(gram.as_ref()).expect("a ridge is on the diagonal").solve(right.as_ref());
    (0..angle.len()).map(|k| angle[k] - (0..n).map(|i| found[(i, 0)] / scale[i] * columns[i][k]).sum::<f64>()).collect()
}

fn rms(values: &[f64], used: impl Fn(usize) -> bool) -> f64 {
    let used: Vec<f64> = values.iter().enumerate().filter(|(k, _)| used(*k)).map(|(_, v)| *v).collect();
    (used.iter().map(|v| v * v).sum::<f64>() / used.len().max(1) as f64).sqrt()
}

fn compare(path: &str) -> Result<(), String> {
    let record = read(path)?;
    let last = record.cycle.iter().copied().max().unwrap_or(0);
    let fitted = |k: usize| (FIRST_LARGE..last).contains(&record.cycle[k]);
    let (told, small) = (|k: usize| record.cycle[k] == last, |k: usize| record.cycle[k] < FIRST_LARGE);
    if !(0..record.cycle.len()).any(fitted) {
        return Err(format!("{path}: column cycle: largest {last}, allowed: from {} on", FIRST_LARGE + 1));
    }
    println!("{path}: arcmin rms left of the large cycles fitted, of the last one, of the small ones about their mean");
    let print = |law: &str, left: &[f64]| {
        let count = (0..left.len()).filter(|k| small(*k)).count().max(1) as f64;
        let mean = (0..left.len()).filter(|k| small(*k)).map(|k| left[k]).sum::<f64>() / count;
        let about: Vec<f64> = left.iter().map(|v| v - mean).collect();
        println!("  {law:<36} {:7.2} {:7.2} {:7.2}", rms(left, fitted), rms(left, told), rms(&about, small));
    };
    let angle = &record.angle_arcmin;
    let with = |more: Vec<Vec<f64>>| left(&[record.curve(), more].concat(), angle, fitted);
    print("a curve of the torque alone", &with(Vec::new()));
    print("springs that slip", &with(record.springs_that_slip()));
    let of_the_load = |more: &dyn Fn() -> Vec<Vec<f64>>| {
        let tried = (0..40).map(|k| 0.1 * 1.25_f64.powi(k)).map(|h| {
            let left = with([record.loss_of_the_load(h), more()].concat());
            (rms(&left, fitted), h, left)
        });
        tried.min_by(|a, b| a.0.total_cmp(&b.0)).expect("forty were tried")
    };
    let (_, h, alone) = of_the_load(&Vec::new);
    print(&format!("a loss that follows the load, h {h:.2}'"), &alone);
    let (_, _, both) = of_the_load(&|| record.springs_that_slip());
    print("both", &both);
    Ok(())
}

fn main() -> ExitCode {
    let files: Vec<String> = std::env::args().skip(1).collect();
    if files.is_empty() {
        eprintln!("usage: loss_laws FILE.csv ...");
        return ExitCode::from(2);
    }
    for file in &files {
        if let Err(error) = compare(file) {
            eprintln!("error: {error}");
            return ExitCode::from(2);
        }
    }
    ExitCode::SUCCESS
}
