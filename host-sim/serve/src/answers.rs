//! Addresses to answers.

use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{DefaultBodyLimit, Path, RawQuery, Request, State};
use axum::http::header::{self, HeaderValue};
use axum::http::{Response, StatusCode};
use axum::middleware::{self, Next};
use axum::routing::{delete, get, post, put};
use axum::serve::Listener;
use serde::{Deserialize, Serialize};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::spawn_blocking;
use tokio::time::{Instant, Sleep, sleep};

use crate::Shared;
use crate::drive::{self, ReadError};
use crate::folder::{Folder, FolderEntry, FolderError, LARGEST_FILE};
use crate::guard::{FILE_POLICY, NoEntry, PAGE_POLICY, RESULT_POLICY, harden};
use crate::jobs::JobError;
use crate::work::{DriveAsked, WorkAsked};
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_report::assets;

/// Connections at a time (a guess): a browser opens six, and a few windows of it a few times that; a process may have
/// 1024 files open.
const MOST_CONNECTIONS: usize = 256;
/// Limit of the time until a connection has said what it wants: those that say nothing do not keep others out.
const LONGEST_HEAD: Duration = Duration::from_secs(5);
/// The end of what a request says first.
const END_OF_HEAD: &[u8; 4] = b"\r\n\r\n";
/// Limit of a request in words, bytes: the longest value of a field, and some.
const LARGEST_REQUEST: usize = 256 << 10;
/// Limit of files received at a time: each is held whole.
const MOST_RECEIVING: usize = 2;
/// How long a connection may be open with nothing passing: longer than a page waits for a change.
const LONGEST_IDLE: Duration = Duration::from_secs(40);
/// How long a page waits for a change, until it is answered that there was none.
const LONGEST_WAIT: Duration = Duration::from_secs(20);

/// The page, its style and its modules.
const INDEX: &str = include_str!("../web/index.html");
const STYLE: &str = include_str!("../web/bench.css");
const MODULES: [(&str, &str); 9] = [
    ("api.js", include_str!("../web/api.js")),
    ("bench.js", include_str!("../web/bench.js")),
    ("draw.js", include_str!("../web/draw.js")),
    ("drive-bench.js", include_str!("../web/drive-bench.js")),
    ("elements.js", include_str!("../web/elements.js")),
    ("jobs.js", include_str!("../web/jobs.js")),
    ("log-bench.js", include_str!("../web/log-bench.js")),
    ("results.js", include_str!("../web/results.js")),
    ("table-bench.js", include_str!("../web/table-bench.js")),
];

type Answer = Response<Body>;
type Of = State<Arc<Shared>>;

pub(crate) fn routes(shared: Arc<Shared>) -> Router {
    let receiving = Arc::new(Semaphore::new(MOST_RECEIVING));
    let received = put(move |State(shared): Of, Path(name): Path<String>, request: Request| {
        receive(shared, receiving.clone(), name, request)
    });
    Router::new()
        .route("/", get(index))
        .route("/app/{name}", get(module))
        .route("/api/state", get(state))
        .route("/api/jobs", get(jobs).post(add_job))
        .route("/api/jobs/{id}", delete(cancel_job))
        .route("/api/drive", post(show_drive))
        .route("/api/files/{name}", received.layer(DefaultBodyLimit::max(LARGEST_FILE as usize)))
        .route("/files/{*name}", get(file))
        .fallback(|| async { words(StatusCode::NOT_FOUND, "nothing has this address") })
        .layer(DefaultBodyLimit::max(LARGEST_REQUEST))
        .layer(middleware::from_fn_with_state(shared.clone(), guarded))
        .with_state(shared)
}

/// Lets through who may ask, and hardens every answer.
async fn guarded(State(shared): Of, request: Request, next: Next) -> Answer {
    let place = shared.guard.check_place(request.method(), request.headers());
    let has_token = shared.guard.check_token(request.headers());
    let mut answer = match (place, has_token) {
        (Err(why), _) => words(StatusCode::FORBIDDEN, why),
        // The address that was printed.
        (Ok(()), _) if request.uri().path() == "/" && request.uri().query().is_some() => {
            entered(&shared, request.uri().query().unwrap_or_default())
        }
        (Ok(()), Err(why)) => words(StatusCode::FORBIDDEN, why),
        (Ok(()), Ok(())) => next.run(request).await,
    };
    harden(answer.headers_mut());
    answer
}

/// Takes the key of the address into a cookie, and the address without it.
fn entered(shared: &Shared, query: &str) -> Answer {
    if !value(Some(query), "token").is_some_and(|token| shared.guard.is_token(token)) {
        return words(StatusCode::FORBIDDEN, NoEntry::Token);
    }
    let mut answer = words(StatusCode::SEE_OTHER, "");
    answer.headers_mut().insert(header::LOCATION, HeaderValue::from_static("/"));
    if let Ok(cookie) = HeaderValue::from_str(&shared.guard.cookie()) {
        answer.headers_mut().insert(header::SET_COOKIE, cookie);
    }
    answer
}

fn bytes(content: impl Into<Body>, kind: &'static str, policy: &'static str) -> Answer {
    let mut answer = Response::new(content.into());
    answer.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
    answer.headers_mut().insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(policy));
    answer
}

fn words(status: StatusCode, what: impl ToString) -> Answer {
    let mut answer = bytes(format!("{}\n", what.to_string()), "text/plain; charset=utf-8", FILE_POLICY);
    *answer.status_mut() = status;
    answer
}

fn json(value: &impl Serialize) -> Answer {
    match serde_json::to_vec(value) {
        Ok(text) => bytes(text, "application/json", FILE_POLICY),
        Err(error) => words(StatusCode::INTERNAL_SERVER_ERROR, error),
    }
}

/// Work that reads and writes files, beside the thread that answers.
async fn aside(work: impl FnOnce() -> Answer + Send + 'static) -> Answer {
    spawn_blocking(work).await.unwrap_or_else(|_| {
        words(StatusCode::INTERNAL_SERVER_ERROR, "this request ended unforeseen; the server goes on")
    })
}

fn refused(error: &FolderError) -> Answer {
    let status = match error {
        FolderError::Name(_) | FolderError::NoFile(_) => StatusCode::BAD_REQUEST,
        FolderError::Absent(_) => StatusCode::NOT_FOUND,
        FolderError::Large(..) => StatusCode::PAYLOAD_TOO_LARGE,
        FolderError::Full => StatusCode::INSUFFICIENT_STORAGE,
        FolderError::Io(..) | FolderError::Output(_) => StatusCode::INTERNAL_SERVER_ERROR,
    };
    words(status, error)
}

async fn index() -> Answer {
    bytes(INDEX, "text/html; charset=utf-8", PAGE_POLICY)
}

async fn module(Path(name): Path<String>) -> Answer {
    const SCRIPT: &str = "text/javascript; charset=utf-8";
    match name.as_str() {
        "bench.css" => bytes(format!("{}\n{STYLE}", *assets::STYLE), "text/css; charset=utf-8", FILE_POLICY),
        "uplot.js" => bytes(assets::UPLOT, SCRIPT, FILE_POLICY),
        _ => match MODULES.iter().chain(&assets::MODULES).find(|(of, _)| *of == name) {
            Some((_, source)) => bytes(*source, SCRIPT, FILE_POLICY),
            None => words(StatusCode::NOT_FOUND, "nothing has this address"),
        },
    }
}

/// Head of a page.
#[derive(Serialize)]
struct Begin {
    version: &'static str,
    folder: String,
    built_in: &'static [&'static str],
    generators: Vec<&'static str>,
    files: Vec<FolderEntry>,
    largest_file: u64,
}

async fn state(State(shared): Of) -> Answer {
    aside(move || {
        json(&Begin {
            version: env!("CARGO_PKG_VERSION"),
            folder: shared.folder.path().display().to_string(),
            built_in: &Drive::BUILT_IN,
            generators: GeneratorKind::ALL.iter().map(|kind| kind.name()).collect(),
            files: shared.folder.entries(),
            largest_file: LARGEST_FILE,
        })
    })
    .await
}

/// All jobs, once there is a change after the one that is named.
async fn jobs(State(shared): Of, RawQuery(query): RawQuery) -> Answer {
    if let Some(after) = value(query.as_deref(), "after").and_then(|after| after.parse::<u64>().ok()) {
        let mut watch = shared.jobs.watch();
        // No change in this time is an answer too.
        let _ = tokio::time::timeout(LONGEST_WAIT, watch.wait_for(|revision| *revision > after)).await;
    }
    json(&shared.jobs.seen())
}

async fn add_job(State(shared): Of, body: Bytes) -> Answer {
    let work: WorkAsked = match serde_json::from_slice(&body) {
        Ok(work) => work,
        Err(error) => return words(StatusCode::BAD_REQUEST, error),
    };
    aside(move || match shared.jobs.add(work) {
        Ok(job) => {
            let mut answer = json(&job);
            *answer.status_mut() = StatusCode::ACCEPTED;
            answer
        }
        Err(error @ JobError::Work(_)) => words(StatusCode::BAD_REQUEST, error),
        Err(error @ JobError::Full) => words(StatusCode::TOO_MANY_REQUESTS, error),
        Err(error @ JobError::Folder(_)) => words(StatusCode::INTERNAL_SERVER_ERROR, error),
    })
    .await
}

async fn cancel_job(State(shared): Of, Path(id): Path<String>) -> Answer {
    let Ok(id) = id.parse::<u64>() else { return words(StatusCode::NOT_FOUND, "no such job") };
    aside(move || match shared.jobs.job(id) {
        None => words(StatusCode::NOT_FOUND, "no such job"),
        Some(_) => json(&serde_json::json!({ "ended": shared.jobs.cancel(id) })),
    })
    .await
}

/// A drive and its generator.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ShowDrive {
    drive: DriveAsked,
    generator: GeneratorKind,
    /// Whether gaps between teeth are looked for.
    #[serde(default)]
    gaps: bool,
}

async fn show_drive(State(shared): Of, body: Bytes) -> Answer {
    let asked: ShowDrive = match serde_json::from_slice(&body) {
        Ok(asked) => asked,
        Err(error) => return words(StatusCode::BAD_REQUEST, error),
    };
    aside(move || match drive::show(&shared.folder, &asked.drive, asked.generator, asked.gaps) {
        Ok(shown) => json(&shown),
        Err(ReadError::Folder(error)) => refused(&error),
        Err(ReadError::Drive(error)) => words(StatusCode::BAD_REQUEST, error),
    })
    .await
}

async fn receive(shared: Arc<Shared>, receiving: Arc<Semaphore>, name: String, request: Request) -> Answer {
    // Refused before it is read, where it says how large it is.
    let says =
        request.headers().get(header::CONTENT_LENGTH).and_then(|length| length.to_str().ok()?.parse::<u64>().ok());
    match says {
        None => return words(StatusCode::LENGTH_REQUIRED, "how large is it?"),
        Some(length) if length > LARGEST_FILE => return refused(&FolderError::Large(name, length)),
        Some(_) => {}
    }
    let Ok(_permit) = receiving.acquire_owned().await else {
        return words(StatusCode::SERVICE_UNAVAILABLE, "the server ends");
    };
    let Ok(content) = axum::body::to_bytes(request.into_body(), LARGEST_FILE as usize).await else {
        return words(StatusCode::BAD_REQUEST, "the file did not come whole");
    };
    aside(move || match shared.folder.receive(&name, &content) {
        Ok(name) => json(&serde_json::json!({ "name": name })),
        Err(error) => refused(&error),
    })
    .await
}

/// Value of a name in a query; none of a name alone.
fn value<'q>(query: Option<&'q str>, name: &str) -> Option<&'q str> {
    let mut parts = query?.split('&').map(|part| part.split_once('=').unwrap_or((part, "")));
    parts.find_map(|(of, value)| (of == name).then_some(value))
}

async fn file(State(shared): Of, Path(name): Path<String>, RawQuery(query): RawQuery) -> Answer {
    let query = query.as_deref();
    let head = value(query, "head").and_then(|head| head.parse::<u64>().ok()).map(|head| head.min(LARGEST_FILE));
    let (download, page) = (value(query, "download").is_some(), value(query, "page").is_some());
    aside(move || sent(&shared.folder, &name, head, download, page)).await
}

/// A file: as a page of its own if it is one and that is asked for, else as what no browser runs.
fn sent(folder: &Folder, name: &str, head: Option<u64>, download: bool, page: bool) -> Answer {
    let content = match folder.read(name, head) {
        Ok(content) => content,
        Err(error) => return refused(&error),
    };
    let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending);
    let mut answer = match ending {
        "html" if page => bytes(content, "text/html; charset=utf-8", RESULT_POLICY),
        "json" => bytes(content, "application/json", FILE_POLICY),
        "fxt" | "gz" | "parquet" => bytes(content, "application/octet-stream", FILE_POLICY),
        _ => bytes(content, "text/plain; charset=utf-8", FILE_POLICY),
    };
    if download {
        let plain = name.rsplit('/').next().unwrap_or(name);
        // A plain word: nothing in it has to be quoted.
        if let Ok(value) = HeaderValue::from_str(&format!("attachment; filename=\"{plain}\"")) {
            answer.headers_mut().insert(header::CONTENT_DISPOSITION, value);
        }
    }
    answer
}

/// A listener with a limit on connections at a time.
pub(crate) struct FewConnections {
    listener: TcpListener,
    open: Arc<Semaphore>,
}

impl FewConnections {
    pub(crate) fn new(listener: TcpListener) -> FewConnections {
        FewConnections { listener, open: Arc::new(Semaphore::new(MOST_CONNECTIONS)) }
    }
}

/// A connection, counted while it lasts; it ends when nothing passes for a while.
pub(crate) struct Connection {
    stream: TcpStream,
    idle: Pin<Box<Sleep>>,
    /// Bytes of [`END_OF_HEAD`] that have come, one after another.
    ended: usize,
    _permit: Option<OwnedSemaphorePermit>,
}

impl Connection {
    /// Looks for the end of the first request's head.
    fn look(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.ended = match END_OF_HEAD.get(self.ended) {
                None => return,
                Some(wanted) if wanted == byte => self.ended + 1,
                Some(_) => usize::from(*byte == END_OF_HEAD[0]),
            };
        }
    }

    /// Something passed.
    fn awake<T>(&mut self, passed: Poll<io::Result<T>>) -> Poll<io::Result<T>> {
        if matches!(passed, Poll::Ready(Ok(_))) && self.ended == END_OF_HEAD.len() {
            self.idle.as_mut().reset(Instant::now() + LONGEST_IDLE);
        }
        passed
    }
}

impl Listener for FewConnections {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        let permit = self.open.clone().acquire_owned().await.ok();
        let (stream, from) = Listener::accept(&mut self.listener).await;
        (Connection { stream, idle: Box::pin(sleep(LONGEST_HEAD)), ended: 0, _permit: permit }, from)
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

impl AsyncRead for Connection {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, to: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let before = to.filled().len();
        let passed = Pin::new(&mut self.stream).poll_read(cx, to);
        self.look(&to.filled()[before..]);
        if passed.is_pending() && self.idle.as_mut().poll(cx).is_ready() {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        self.awake(passed)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, from: &[u8]) -> Poll<io::Result<usize>> {
        let passed = Pin::new(&mut self.stream).poll_write(cx, from);
        self.awake(passed)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
