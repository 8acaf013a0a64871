//! A program run as a child: its processor time, its memory, and a limit on both.

use std::fs::{File, read_to_string};
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use rustix::param::clock_ticks_per_second;

use crate::dat::{Table, tables};

/// How often a running child is looked at.
const LOOK: Duration = Duration::from_millis(50);

/// Resources that a child used.
#[derive(Debug, Clone, PartialEq)]
pub struct Used {
    /// Processor time in user mode, s.
    pub cpu_s: f64,
    /// Largest resident memory up to a look ago, MB.
    pub memory_mb: f64,
    /// Processor time (s) when the watched file had each of its lines, from the first.
    pub cpu_at_line_s: Vec<f64>,
}

/// Where a child stops being worth waiting for.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Processor time, s.
    pub cpu_s: f64,
    /// Resident memory, MB.
    pub memory_mb: f64,
}

/// Runs a command to its end, its output in `log`. A file that grows by a line for each thing done (`watched`) dates
/// these.
pub fn run(command: &mut Command, log: &Path, watched: Option<&Path>, limits: Limits) -> Result<Used, String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let failed = |error: &dyn std::fmt::Display| format!("{name}: {error}");
    let output = File::create(log).map_err(|error| failed(&error))?;
    let errors = output.try_clone().map_err(|error| failed(&error))?;
    let mut child =
        command.stdin(Stdio::null()).stdout(output).stderr(errors).spawn().map_err(|error| failed(&error))?;
    let process = format!("/proc/{}", child.id());
    let mut used = Used { cpu_s: 0.0, memory_mb: 0.0, cpu_at_line_s: Vec::new() };
    // A process that has ended and is not yet waited for still says how long it computed, but not its memory.
    loop {
        let stat = read_to_string(format!("{process}/stat")).map_err(|error| failed(&error))?;
        let (state, cpu_s) = state(&stat).ok_or_else(|| failed(&format!("{process}/stat reads {stat}")))?;
        used.cpu_s = cpu_s;
        if let Some(watched) = watched {
            let lines = read_to_string(watched).map_or(0, |text| text.lines().count());
            used.cpu_at_line_s.resize(lines.max(used.cpu_at_line_s.len()), cpu_s);
        }
        if state == "Z" {
            break;
        }
        let status = read_to_string(format!("{process}/status"));
        used.memory_mb = status.ok().and_then(|status| memory_mb(&status)).unwrap_or(0.0).max(used.memory_mb);
        let over = if cpu_s > limits.cpu_s {
            Some(format!("{cpu_s:.0} s of processor time, allowed {:.0}", limits.cpu_s))
        } else if used.memory_mb > limits.memory_mb {
            Some(format!("{:.0} MB of memory, allowed {:.0}", used.memory_mb, limits.memory_mb))
        } else {
            None
        };
        if let Some(over) = over {
            child.kill().and_then(|()| child.wait()).map_err(|error| failed(&error))?;
            return Err(failed(&format!("stopped after {over}; see {}", log.display())));
        }
        sleep(LOOK);
    }
    let ended = child.wait().map_err(|error| failed(&error))?;
    if ended.success() { Ok(used) } else { Err(failed(&format!("ended with {ended}; see {}", log.display()))) }
}

/// CalculiX on the deck `job`.inp of a folder; its tables.
pub fn calculix(ccx: &Path, folder: &Path, job: &str, limits: Limits) -> Result<(Used, Vec<Table>), String> {
    let used = ccx_alone(ccx, folder, job, limits)?;
    let dat = folder.join(job).with_extension("dat");
    let text = read_to_string(&dat).map_err(|error| format!("{}: {error}", dat.display()))?;
    Ok((used, tables(&text).map_err(|error| format!("{}: {error}", dat.display()))?))
}

/// The same, its output left unread.
pub fn ccx_alone(ccx: &Path, folder: &Path, job: &str, limits: Limits) -> Result<Used, String> {
    let mut command = Command::new("nice");
    command.args(["-n", "15"]).arg(ccx).arg(job).current_dir(folder).env("OMP_NUM_THREADS", "1");
    run(&mut command, &folder.join("ccx.log"), None, limits)
}

/// State and processor time in user mode (s) from `/proc/PID/stat`.
fn state(stat: &str) -> Option<(&str, f64)> {
    // The name of the program, in brackets, may hold spaces and brackets.
    let (_, fields) = stat.rsplit_once(") ")?;
    let mut fields = fields.split(' ');
    let state = fields.next()?;
    let ticks: u64 = fields.nth(10)?.parse().ok()?;
    Some((state, ticks as f64 / clock_ticks_per_second() as f64))
}

/// Largest resident memory (MB) from `/proc/PID/status`.
fn memory_mb(status: &str) -> Option<f64> {
    let kilobytes = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(kilobytes.trim().strip_suffix(" kB")?.parse::<f64>().ok()? / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { cpu_s: 20.0, memory_mb: 500.0 };

    #[test]
    fn a_child_is_measured_and_its_lines_are_dated() {
        let folder = std::env::temp_dir().join(format!("peers-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let busy = "for k in 1 2; do i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done; echo $k >> lines; done";
        let used = run(
            Command::new("sh").args(["-c", busy]).current_dir(&folder),
            &folder.join("log"),
            Some(&folder.join("lines")),
            LIMITS,
        );
        let endless = run(
            Command::new("sh").args(["-c", "while :; do :; done"]).current_dir(&folder),
            &folder.join("log"),
            None,
            Limits { cpu_s: 0.2, ..LIMITS },
        );
        let failing =
            run(Command::new("sh").args(["-c", "exit 3"]).current_dir(&folder), &folder.join("log"), None, LIMITS);
        std::fs::remove_dir_all(&folder).unwrap();
        let used = used.unwrap();
        assert!(used.cpu_s > 0.01 && used.memory_mb > 0.1, "{used:?}");
        let [first, second] = used.cpu_at_line_s[..] else { panic!("{used:?}") };
        assert!(0.0 < first && first < second && second <= used.cpu_s + 0.02, "{used:?}");
        assert!(endless.unwrap_err().contains("processor time"));
        assert!(failing.unwrap_err().contains("exit status: 3"));
    }
}
