//! The server as a browser, and as somebody with bad intentions, meets it: whole requests over the loopback.
#![cfg(unix)]

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::thread;
use std::time::Duration;

use flexspline_serve::{Server, Settings};

struct Bench {
    place: tempfile::TempDir,
    host: String,
    token: String,
    cookie: String,
}

/// An answer: status, headers in lower case, body.
struct Answer {
    status: u16,
    head: String,
    body: String,
}

impl Bench {
    fn new() -> Bench {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("a.csv"), "t,x\n1,2\n").unwrap();
        let program = place.path().join("flexspline.sh");
        fs::write(&program, "#!/bin/sh\necho '{}'\n").unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        let settings = Settings { folder: place.path().to_owned(), port: 0, program, jobs_at_a_time: None };
        let server = Server::new(settings).unwrap();
        let address = server.address();
        thread::spawn(move || server.run());
        let (host, token) = address.strip_prefix("http://").unwrap().split_once("/?token=").unwrap();
        let port = host.split_once(':').unwrap().1;
        let cookie = format!("flexspline-{port}={token}");
        Bench { place, host: host.to_owned(), token: token.to_owned(), cookie }
    }

    /// A request as it stands.
    fn raw(&self, request: &str) -> Answer {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut bytes = Vec::new();
        // A server that closes early has answered before.
        let _ = stream.read_to_end(&mut bytes);
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
        Answer { status, head: head.to_lowercase(), body: body.to_owned() }
    }

    /// A request without a body by a name of the host, with these headers.
    fn by(&self, what: &str, host: &str, headers: &str) -> Answer {
        self.raw(&format!("{what} HTTP/1.1\r\nHost: {host}\r\n{headers}Connection: close\r\n\r\n"))
    }

    /// A request of the page.
    fn ask(&self, method: &str, path: &str, body: &str) -> Answer {
        let Bench { host, cookie, .. } = self;
        let origin = if method == "GET" { String::new() } else { format!("Origin: http://{host}\r\n") };
        self.raw(&format!(
            "{method} {path} HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\n{origin}Content-Length: {}\r\nConnection: \
             close\r\n\r\n{body}",
            body.len()
        ))
    }
}

#[test]
fn the_address_lets_in_and_nothing_else_does() {
    let bench = Bench::new();
    let Bench { host, token, cookie, .. } = &bench;
    let get = |path: &str, more: &str| bench.by(&format!("GET {path}"), host, more);
    let entered = get(&format!("/?token={token}"), "");
    assert_eq!(entered.status, 303);
    assert!(
        entered.head.contains(&format!("set-cookie: {cookie}; path=/; httponly; samesite=strict")),
        "{}",
        entered.head
    );
    for path in ["/", "/api/state", "/files/a.csv", "/app/bench.js", "/nothing", "/?token=0123", "/?token="] {
        assert_eq!(get(path, "").status, 403, "{path}");
    }
    let name = cookie.split_once('=').unwrap().0;
    for (cookie, status) in [
        (format!("{name}={}", "0".repeat(token.len())), 403),
        (format!("flexspline-1={token}"), 403),
        (format!("{cookie}0"), 403),
        (name.to_owned(), 403),
        (format!("other=1; {cookie}; x=y"), 200),
    ] {
        assert_eq!(get("/", &format!("Cookie: {cookie}\r\n")).status, status, "{cookie}");
    }
    let page = get("/", &format!("Cookie: {cookie}\r\n"));
    assert_eq!(page.status, 200);
    assert!(page.head.contains("content-security-policy: default-src 'none'; script-src 'self'"), "{}", page.head);
    for header in ["x-content-type-options: nosniff", "referrer-policy: no-referrer", "cache-control: no-store"] {
        assert!(page.head.contains(header), "{header}");
    }
    assert!(!page.head.contains("access-control"), "{}", page.head);
    // Everything that the page names is there.
    for part in page.body.split(['"', '\'']).filter(|part| part.starts_with("/app/")) {
        assert_eq!(bench.ask("GET", part, "").status, 200, "{part}");
    }
}

#[test]
fn a_request_by_another_name_or_of_another_page_is_refused() {
    let bench = Bench::new();
    let Bench { host, token, cookie, .. } = &bench;
    let port = host.split_once(':').unwrap().1;
    let evil = format!("evil.example:{port}");
    for (name, more) in [
        (evil.as_str(), ""),
        ("127.0.0.1", ""),
        ("127.0.0.1:1", ""),
        (host, "Host: evil.example\r\n"),
        (host, "Origin: http://evil.example\r\n"),
        (host, "Origin: null\r\n"),
        (host, &format!("Origin: https://{host}\r\n")),
        (host, &format!("Origin: http://{host}.evil.example\r\n")),
        (host, &format!("Origin: http://localhost:{port}\r\n")),
        (host, &format!("Origin: http://{host}\r\nOrigin: http://evil.example\r\n")),
        (host, "Sec-Fetch-Site: cross-site\r\n"),
        (host, "Sec-Fetch-Site: same-site\r\n"),
    ] {
        for path in ["/", "/api/state", &format!("/?token={token}")] {
            let answer = bench.by(&format!("GET {path}"), name, &format!("Cookie: {cookie}\r\n{more}"));
            assert_eq!(answer.status, 403, "{name} {more} {path}");
        }
    }
    for (name, more) in [(host.replace("127.0.0.1", "localhost"), ""), (host.clone(), "Sec-Fetch-Site: none\r\n")] {
        assert_eq!(bench.by("GET /", &name, &format!("Cookie: {cookie}\r\n{more}")).status, 200, "{name} {more}");
    }
    // What changes something says that it is of this server.
    let request = format!(
        "POST /api/jobs HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\nContent-Length: 2\r\nConnection: \
         close\r\n\r\n{{}}"
    );
    assert_eq!(bench.raw(&request).status, 403);
    let preflight = "Origin: http://evil.example\r\nAccess-Control-Request-Method: POST\r\n";
    let answer = bench.by("OPTIONS /api/jobs", host, preflight);
    assert!(answer.status == 403 && !answer.head.contains("access-control"), "{}", answer.head);
}

#[test]
fn nothing_outside_the_folder_is_sent_or_written() {
    let bench = Bench::new();
    let outside = tempfile::tempdir().unwrap();
    fs::write(outside.path().join("secret"), "secret").unwrap();
    symlink(outside.path().join("secret"), bench.place.path().join("link.csv")).unwrap();
    symlink(outside.path(), bench.place.path().join("way")).unwrap();
    fs::create_dir(bench.place.path().join("out")).unwrap();
    fs::write(bench.place.path().join("out/b.json"), "{}").unwrap();
    symlink(bench.place.path().join("out"), bench.place.path().join("within")).unwrap();
    assert_eq!(bench.ask("GET", "/files/out/b.json", "").body, "{}");
    let listed = bench.ask("GET", "/api/state", "").body;
    assert!(listed.contains("out/b.json") && !listed.contains("link.csv") && !listed.contains("within"), "{listed}");
    assert_eq!(bench.ask("GET", "/files/a.csv", "").body, "t,x\n1,2\n");
    for path in [
        "/files/../secret",
        "/files/..%2f..%2fetc%2fpasswd",
        "/files/%2e%2e/secret",
        "/files//etc/passwd",
        "/files/%2fetc/passwd",
        "/files/link.csv",
        "/files/way/secret",
        "/files/within/b.json",
        "/files/out//b.json",
        "/files/out",
        "/files/out/",
        "/files/absent",
        "/files/.hidden",
        "/files/a.csv%00",
        "/files/",
        "/app/..%2f..%2fCargo.toml",
    ] {
        let answer = bench.ask("GET", path, "");
        assert!((400..500).contains(&answer.status), "{path}: {}", answer.status);
        assert!(!answer.body.contains("secret\n") && !answer.body.contains("root:"), "{path}");
    }
    for name in ["..%2fx.csv", "%2e%2e", ".x", "-x", "%2ftmp%2fx", "way%2fx", "bench", "a%20b", "a%00"] {
        let answer = bench.ask("PUT", &format!("/api/files/{name}"), "x");
        assert_eq!(answer.status, 400, "{name}: {}", answer.body);
    }
    // Through a link nothing is written: the file gets another name.
    let answer = bench.ask("PUT", "/api/files/link.csv", "mine");
    assert_eq!((answer.status, answer.body.as_str()), (200, r#"{"name":"link-2.csv"}"#));
    assert_eq!(fs::read_to_string(outside.path().join("secret")).unwrap(), "secret");
    assert_eq!(fs::read_dir(outside.path()).unwrap().count(), 1);
}

#[test]
fn a_page_of_a_result_has_no_rights() {
    let bench = Bench::new();
    fs::write(bench.place.path().join("report.html"), "<script>fetch('/api/state')</script>").unwrap();
    let shown = bench.ask("GET", "/files/report.html?page", "");
    let policy = shown.head.lines().find(|line| line.starts_with("content-security-policy")).unwrap();
    assert!(policy.contains("sandbox allow-scripts") && policy.contains("default-src 'none'"), "{policy}");
    assert!(!policy.contains("allow-same-origin") && !policy.contains("connect-src"), "{policy}");
    // Not asked for as a page it is none.
    assert!(bench.ask("GET", "/files/report.html", "").head.contains("content-type: text/plain"));
    let sent = bench.ask("GET", "/files/report.html?download", "");
    assert!(sent.head.contains("content-disposition: attachment; filename=\"report.html\""), "{}", sent.head);
}

#[test]
fn what_is_too_large_or_has_no_size_is_refused_before_it_is_read() {
    let bench = Bench::new();
    let Bench { host, cookie, .. } = &bench;
    let head =
        format!("HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\nOrigin: http://{host}\r\nConnection: close\r\n");
    let large = bench.raw(&format!("PUT /api/files/large.csv {head}Content-Length: 999999999999\r\n\r\nx"));
    assert_eq!(large.status, 413, "{}", large.body);
    let endless = bench.raw(&format!("PUT /api/files/large.csv {head}Transfer-Encoding: chunked\r\n\r\n1\r\nx\r\n"));
    assert_eq!(endless.status, 411, "{}", endless.body);
    let words = bench.ask("POST", "/api/jobs", &" ".repeat(1 << 20));
    assert_eq!(words.status, 413, "{}", words.body);
    assert!(!bench.place.path().join("large.csv").exists());
}

#[test]
fn a_job_is_what_was_asked_for_or_a_reason() {
    let bench = Bench::new();
    for bad in [
        "",
        "[]",
        "{}",
        r#"{"work":"sh"}"#,
        r#"{"work":"look","files":["../a.csv"]}"#,
        "{\"work\":\"look\",\"files\":[]}",
    ] {
        assert_eq!(bench.ask("POST", "/api/jobs", bad).status, 400, "{bad}");
    }
    let added = bench.ask("POST", "/api/jobs", r#"{"work":"look","files":["a.csv"]}"#);
    assert_eq!(added.status, 202, "{}", added.body);
    let seen = (0..200).map(|_| bench.ask("GET", "/api/jobs", "").body).find(|body| {
        thread::sleep(Duration::from_millis(20));
        body.contains(r#""state":"done""#)
    });
    assert!(seen.is_some());
    assert_eq!(bench.ask("GET", "/files/bench/look-1/look.json", "").body, "{}\n");
    assert_eq!(bench.ask("DELETE", "/api/jobs/1", "").body, r#"{"ended":false}"#);
    assert_eq!(bench.ask("DELETE", "/api/jobs/99", "").status, 404);
    assert_eq!(bench.ask("DELETE", "/api/jobs/x", "").status, 404);
}

#[test]
fn a_drive_is_shown_or_what_is_wrong_with_it() {
    let bench = Bench::new();
    let shown = bench.ask("POST", "/api/drive", r#"{"drive":{"drive":"HHD-95"},"generator":"cam"}"#);
    assert_eq!(shown.status, 200);
    assert!(shown.body.contains(r#""path":"generator.w0_mm""#) && shown.body.contains(r#""problems":[]"#));
    let wrong = r#"{"drive":{"drive":"HHD-95","sets":{"generator.w0_mm":"-1"}},"generator":"cam"}"#;
    let wrong = bench.ask("POST", "/api/drive", wrong);
    assert!(wrong.status == 200 && wrong.body.contains("allowed: above 0"), "{}", wrong.body);
    assert_eq!(bench.ask("POST", "/api/drive", r#"{"drive":{"drive":"../x"},"generator":"cam"}"#).status, 400);
    assert_eq!(bench.ask("POST", "/api/drive", r#"{"drive":{"drive":"a.csv"},"generator":"cam"}"#).status, 400);
}

/// 10 000 requests beside connections that say nothing: the server answers on.
#[test]
fn many_requests_do_not_end_the_server() {
    let bench = Bench::new();
    let idle: Vec<TcpStream> = (0..30).map(|_| TcpStream::connect(&bench.host).unwrap()).collect();
    thread::scope(|scope| {
        for worker in 0..8 {
            let bench = &bench;
            scope.spawn(move || {
                for k in 0..1250 {
                    let answer = match k % 4 {
                        0 => bench.ask("GET", "/api/state", ""),
                        1 => bench.ask("GET", "/files/../../etc/passwd", ""),
                        2 => bench.by("GET /", &format!("x{worker}"), ""),
                        _ => bench.raw("\u{1}\u{2}garbage\r\n\r\n"),
                    };
                    let fits = match k % 4 {
                        0 => answer.status == 200,
                        2 => answer.status == 403,
                        _ => (400..500).contains(&answer.status),
                    };
                    assert!(fits, "{k}: {} {}", answer.status, answer.head);
                }
            });
        }
    });
    drop(idle);
    assert_eq!(bench.ask("GET", "/api/state", "").status, 200);
}

/// 100 pages that each queue a job at once: each gets its job or the answer that the queue is full, and all are done.
#[test]
fn of_a_hundred_jobs_at_once_each_is_done_or_refused() {
    let bench = Bench::new();
    let answers: Vec<Answer> = thread::scope(|scope| {
        let ask = || bench.ask("POST", "/api/jobs", r#"{"work":"look","files":["a.csv"]}"#);
        let all: Vec<_> = (0..100).map(|_| scope.spawn(ask)).collect();
        all.into_iter().map(|one| one.join().unwrap()).collect()
    });
    let taken = answers.iter().filter(|answer| answer.status == 202).count();
    assert!(taken >= 32, "{taken}");
    for refused in answers.iter().filter(|answer| answer.status != 202) {
        assert!(refused.status == 429 && refused.body.contains("cancel one"), "{}", refused.body);
    }
    let done = |bench: &Bench| bench.ask("GET", "/api/jobs", "").body.matches(r#""state":"done""#).count();
    let begun = std::time::Instant::now();
    while done(&bench) < taken {
        assert!(begun.elapsed() < Duration::from_secs(60), "{} of {taken}", done(&bench));
        thread::sleep(Duration::from_millis(20));
    }
    // None shares its folder with another.
    assert_eq!(fs::read_dir(bench.place.path().join("bench")).unwrap().count(), taken);
    assert!((1..=taken).all(|id| bench.place.path().join(format!("bench/look-{id}/look.json")).is_file()));
}

/// Uploads that end early leave nothing; those of one name at once each get a name of their own.
#[test]
fn uploads_that_break_off_or_come_at_once_spoil_no_file() {
    let bench = Bench::new();
    let Bench { host, cookie, .. } = &bench;
    let head = format!("HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\nOrigin: http://{host}\r\n");
    for _ in 0..4 {
        let mut stream = TcpStream::connect(host).unwrap();
        stream.write_all(format!("PUT /api/files/b.csv {head}Content-Length: 1000\r\n\r\nhalf").as_bytes()).unwrap();
    }
    thread::scope(|scope| {
        for k in 0..20 {
            let bench = &bench;
            scope.spawn(move || assert_eq!(bench.ask("PUT", "/api/files/b.csv", &format!("of {k}\n")).status, 200));
        }
    });
    let names =
        fs::read_dir(bench.place.path()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut received: Vec<String> = names
        .filter(|name| name.starts_with("b"))
        .map(|name| fs::read_to_string(bench.place.path().join(name)).unwrap())
        .collect();
    received.sort();
    let mut sent: Vec<String> = (0..20).map(|k| format!("of {k}\n")).collect();
    sent.sort();
    assert_eq!(received, sent);
    assert!(
        !fs::read_dir(bench.place.path()).unwrap().any(|e| e.unwrap().file_name().to_string_lossy().contains("part"))
    );
}

/// Connections that say half a line, more than there may be: they are closed, and others get their answer.
#[test]
#[ignore = "long: tests/run slow"]
fn connections_that_say_nothing_do_not_keep_others_out() {
    let bench = Bench::new();
    let idle: Vec<TcpStream> = (0..300)
        .map(|_| {
            let mut stream = TcpStream::connect(&bench.host).unwrap();
            stream.write_all(b"GET / HTTP/1.1\r\nHost: ").unwrap();
            stream
        })
        .collect();
    assert_eq!(bench.ask("GET", "/api/state", "").status, 200);
    drop(idle);
    // One that has said what it wants is waited with: longer than the others had.
    let begun = std::time::Instant::now();
    let answer = bench.ask("GET", "/api/jobs?after=1000000", "");
    assert_eq!(answer.status, 200);
    assert!(begun.elapsed() > Duration::from_secs(15), "{:?}", begun.elapsed());
}
