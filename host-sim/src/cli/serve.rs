//! `flexspline serve`: the bench in a browser.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use clap::Args;
use serde::Serialize;

use super::{Context, Failure, say, stop};
use flexspline_serve::{ServeError, Server, Settings};

/// Open the bench in a browser: drop a log, draw a drive, make tables, and see what each of them does
///
/// A server on this machine alone (127.0.0.1), for one folder: it reads and writes nothing outside it, loads nothing
/// from anywhere else, and whoever has not the address that it prints gets no answer. Logs that are dropped on the page
/// are copied into the folder.
///
/// Whatever a page shows is what a command of `flexspline` wrote into the folder, below bench/, and the page shows that
/// command. The other way round, results that commands wrote into the folder open in the bench. Work goes on when the
/// page is closed; a server that is started again finds what was finished.
///
/// Ctrl-C ends it, with all that it has started.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline serve --open
  flexspline serve measurements --port 8100

The first page asks what there is:
  a drive on paper      sliders, teeth as they move, a pitch of contact FEM when they rest; tables
  a catalogue's drive   the same, from a size such as CSG-25-80
  a log                 columns as they are taken for, the verdict, a table of the unit
  a table               what it leaves of a log, its error over a turn, files for firmware

--drive, --set and --out are those of the commands that the bench runs; here they have no use.")]
pub(super) struct Serve {
    /// The folder of the bench
    #[arg(value_name = "FOLDER", default_value = ".")]
    folder: PathBuf,
    /// Port of 127.0.0.1; 0 takes one that is free
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
    /// Open the address in the browser of this machine
    #[arg(long)]
    open: bool,
    /// Jobs at a time, of short and of long ones each [default: two short ones where there are two cores, one long one]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=16))]
    jobs: Option<u8>,
}

/// Report that `--json` prints, once it listens.
#[derive(Serialize)]
struct Listening<'a> {
    schema_version: u32,
    address: &'a str,
    folder: String,
}

impl Serve {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let given = context.changes_the_drive().or(context.has_out().then_some("--out"));
        if let Some(option) = given {
            return Err(Failure::BadInput(format!("{option}: has no use with serve, whose pages say it for each job")));
        }
        let program = std::env::current_exe()
            .map_err(|error| Failure::Failed(format!("cannot tell where this program is: {error}")))?;
        let jobs_at_a_time = self.jobs.map(usize::from);
        let settings = Settings { folder: self.folder.clone(), port: self.port, program, jobs_at_a_time };
        let server = Server::new(settings).map_err(|error| match error {
            ServeError::Folder(_) | ServeError::Port(..) => Failure::BadInput(error.to_string()),
            _ => Failure::Failed(error.to_string()),
        })?;
        let address = server.address();
        let jobs = server.jobs();
        stop::ends_by_signal(move || {
            jobs.end();
            say::talk("the bench is closed");
        });
        let folder = self.folder.display().to_string();
        if context.quiet() {
            // Without its address there is no way in.
            say::data(&address)?;
        }
        context.print(&Listening { schema_version: 1, address: &address, folder: folder.clone() }, || {
            format!("the bench of {folder} is at {address}\nthis address is for you alone; Ctrl-C closes the bench")
        })?;
        if self.open && !opened(&address) {
            say::talk("no browser could be opened here: open the address yourself");
        }
        server.run().map_err(|error| Failure::Failed(error.to_string()))
    }
}

/// Hands the address to whatever opens addresses on this machine.
fn opened(address: &str) -> bool {
    let (program, arguments): (&str, &[&str]) = if cfg!(target_os = "macos") {
        ("open", &[])
    } else if cfg!(windows) {
        ("rundll32", &["url.dll,FileProtocolHandler"])
    } else {
        ("xdg-open", &[])
    };
    let started = Command::new(program)
        .args(arguments)
        .arg(address)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    // Waited for elsewhere, as some of them stay as long as the browser does.
    started.map(|mut child| drop(std::thread::spawn(move || child.wait()))).is_ok()
}
