//! `flexspline serve`: the bench in a browser. A server on this machine alone, for one folder.
//!
//! | module | what it decides |
//! |---|---|
//! | [`guard`] | who may ask |
//! | [`folder`] | which names are files, and that none lies outside |
//! | [`work`] | what may be asked for, and which command that is |
//! | [`jobs`] | commands in their lines: processes of this program, their records |
//! | [`drive`] | fields, mistakes and drawing of a drive while sliders move |
//! | `answers` | addresses to answers |
//! | `web/` | the page |
//!
//! Nothing is computed here that a command does not compute, but the drawing of a drive. What a page shows are the
//! files that commands wrote into the folder.
#![forbid(unsafe_code)]

mod answers;
pub mod drive;
pub mod folder;
pub mod guard;
pub mod jobs;
pub mod work;

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;

use thiserror::Error;

use folder::{Folder, FolderError};
use guard::Guard;
use jobs::Jobs;

/// Where and for what.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The folder that is read and written.
    pub folder: PathBuf,
    /// The port; 0 for any that is free.
    pub port: u16,
    /// The program whose commands do the work.
    pub program: PathBuf,
    /// Jobs of one line at a time, if not as many as is usual.
    pub jobs_at_a_time: Option<usize>,
}

/// Why there is no server.
#[derive(Debug, Error)]
pub enum ServeError {
    /// The folder.
    #[error("{0}")]
    Folder(#[from] FolderError),
    /// The port.
    #[error("port {0} of 127.0.0.1: {1}; allowed: a free port, or 0 for any")]
    Port(u16, std::io::Error),
    /// The system.
    #[error("cannot serve: {0}")]
    System(std::io::Error),
    /// The system has no random numbers.
    #[error("no random numbers for the key of the address: {0}")]
    Random(getrandom::Error),
}

/// A server that listens.
pub struct Server {
    listener: TcpListener,
    shared: Arc<Shared>,
}

/// State behind the answers.
struct Shared {
    folder: Arc<Folder>,
    guard: Guard,
    jobs: Arc<Jobs>,
}

impl Server {
    /// Listens on the loopback.
    ///
    /// # Errors
    /// There is no such folder, or the port is taken.
    pub fn new(settings: Settings) -> Result<Server, ServeError> {
        let folder = Arc::new(Folder::new(&settings.folder)?);
        let at = SocketAddr::from((Ipv4Addr::LOCALHOST, settings.port));
        let listener = TcpListener::bind(at).map_err(|error| ServeError::Port(settings.port, error))?;
        let port = listener.local_addr().map_err(ServeError::System)?.port();
        let guard = Guard::new(port).map_err(ServeError::Random)?;
        let jobs = Jobs::new(folder.clone(), settings.program, settings.jobs_at_a_time);
        Ok(Server { listener, shared: Arc::new(Shared { folder, guard, jobs }) })
    }

    /// The address to open, with the key of this run.
    pub fn address(&self) -> String {
        self.shared.guard.address()
    }

    /// The jobs, to end them with the server.
    pub fn jobs(&self) -> Arc<Jobs> {
        self.shared.jobs.clone()
    }

    /// Answers, until the process ends.
    ///
    /// # Errors
    /// The system does not let it listen.
    pub fn run(self) -> Result<(), ServeError> {
        self.listener.set_nonblocking(true).map_err(ServeError::System)?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(ServeError::System)?;
        runtime.block_on(async {
            let listener = tokio::net::TcpListener::from_std(self.listener).map_err(ServeError::System)?;
            axum::serve(answers::FewConnections::new(listener), answers::routes(self.shared))
                .await
                .map_err(ServeError::System)
        })
    }
}
