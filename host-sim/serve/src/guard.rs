//! Who may ask: a page of this server, in the browser of whoever started it.
//!
//! - Other users and programs of this machine: the token of this run, in the address once, then in a cookie that
//!   scripts cannot read.
//! - A name of somebody's that leads to 127.0.0.1 (DNS rebinding): `Host` is an address of this server.
//! - Other pages in the same browser: `Origin` is this server wherever it is given, and it is given with all that
//!   changes something; `Sec-Fetch-Site` is not that of another site; the cookie is `SameSite=Strict`; no answer allows
//!   another origin to read it.
//! - Scripts in names, logs and reports: a content security policy, scripts of this server alone, nothing from
//!   elsewhere.

use axum::http::Method;
use axum::http::header::{self, HeaderMap, HeaderName, HeaderValue};
use thiserror::Error;

/// Bytes of a token: 128 bits, which nobody guesses.
const TOKEN_BYTES: usize = 16;

/// Policy for a page of this server: it may load and ask for itself, and pictures that it made.
pub const PAGE_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
                               connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; \
                               frame-ancestors 'none'";
/// Policy for the page of a result: run its own scripts in an origin that is nobody's, and ask for nothing.
pub const RESULT_POLICY: &str = "sandbox allow-scripts allow-downloads allow-modals; default-src 'none'; script-src \
                                 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; frame-ancestors \
                                 'self'";
/// Policy for any other file: nothing.
pub(crate) const FILE_POLICY: &str = "sandbox; default-src 'none'";

/// The token of one run, and where the server listens.
#[derive(Debug, Clone)]
pub struct Guard {
    token: String,
    port: u16,
}

/// Why somebody may not ask.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum NoEntry {
    /// `Host` is no address of this server.
    #[error("this server answers as 127.0.0.1 and localhost alone")]
    Host,
    /// The request is of another page.
    #[error("this request is of another page; allowed: pages of this server")]
    Origin,
    /// No token, or that of another run.
    #[error("open the address that `flexspline serve` printed: it holds the key of this run")]
    Token,
}

impl Guard {
    /// A guard with a new token.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn new(port: u16) -> Result<Guard, getrandom::Error> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Guard { token: bytes.iter().map(|byte| format!("{byte:02x}")).collect(), port })
    }

    /// The address to open.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/?token={}", self.port, self.token)
    }

    /// The name of the cookie. Cookies do not know ports, and another server of this machine may have one too.
    fn cookie_name(&self) -> String {
        format!("flexspline-{}", self.port)
    }

    /// The cookie that holds the token.
    pub fn cookie(&self) -> String {
        format!("{}={}; Path=/; HttpOnly; SameSite=Strict", self.cookie_name(), self.token)
    }

    /// Whether this is the token of this run; takes the same time whatever is wrong with it.
    pub(crate) fn is_token(&self, found: &str) -> bool {
        let same = found.bytes().zip(self.token.bytes()).fold(0, |all, (a, b)| all | (a ^ b));
        found.len() == self.token.len() && same == 0
    }

    /// The names under which this server may be addressed.
    fn hosts(&self) -> [String; 2] {
        ["127.0.0.1", "localhost"].map(|name| format!("{name}:{}", self.port))
    }

    /// Whether the request may be of a page of this server, whoever asks.
    ///
    /// # Errors
    /// `Host`, `Origin` or `Sec-Fetch-Site` say otherwise.
    pub(crate) fn check_place(&self, method: &Method, headers: &HeaderMap) -> Result<(), NoEntry> {
        let only = |name: HeaderName| {
            let mut all = headers.get_all(name).iter();
            (all.next().and_then(|value| value.to_str().ok()), all.next().is_some())
        };
        let (host, several) = only(header::HOST);
        if several || !host.is_some_and(|host| self.hosts().iter().any(|own| own == host)) {
            return Err(NoEntry::Host);
        }
        let reads = matches!(*method, Method::GET | Method::HEAD);
        let (origin, several) = only(header::ORIGIN);
        let own = |origin: &str| host.is_some_and(|host| origin.strip_prefix("http://") == Some(host));
        match origin {
            _ if several => return Err(NoEntry::Origin),
            Some(origin) if !own(origin) => return Err(NoEntry::Origin),
            None if headers.contains_key(header::ORIGIN) || !reads => return Err(NoEntry::Origin),
            _ => {}
        }
        let site = headers.get("sec-fetch-site").map(|site| site.as_bytes());
        match site {
            None | Some(b"same-origin" | b"none") => Ok(()),
            // A page of a result has no origin of its own: it may be shown, and asks for nothing.
            Some(_) => Err(NoEntry::Origin),
        }
    }

    /// Whether the request has the token of this run.
    ///
    /// # Errors
    /// It has not.
    pub(crate) fn check_token(&self, headers: &HeaderMap) -> Result<(), NoEntry> {
        let name = self.cookie_name();
        let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
        let found = cookies
            .flat_map(|all| all.split(';'))
            .filter_map(|cookie| cookie.trim().split_once('='))
            .any(|(of, token)| of == name && self.is_token(token));
        if found { Ok(()) } else { Err(NoEntry::Token) }
    }
}

/// Puts on an answer what every answer has: nothing is kept, guessed, framed or passed to others.
pub(crate) fn harden(headers: &mut HeaderMap) {
    let every = [
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
        (HeaderName::from_static("permissions-policy"), "camera=(), microphone=(), geolocation=()"),
    ];
    for (name, value) in every {
        headers.insert(name, HeaderValue::from_static(value));
    }
    headers.entry(header::CONTENT_SECURITY_POLICY).or_insert(HeaderValue::from_static(FILE_POLICY));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_are_long_and_each_run_has_its_own() {
        let [one, other] = [Guard::new(1).unwrap(), Guard::new(1).unwrap()];
        assert_eq!(one.token.len(), 2 * TOKEN_BYTES);
        assert_ne!(one.token, other.token);
        assert!(one.is_token(&one.token) && !one.is_token(&other.token));
        assert!(!one.is_token("") && !one.is_token(&one.token[1..]) && !one.is_token(&format!("{}0", one.token)));
    }

    #[test]
    fn every_answer_is_hardened_and_a_page_keeps_its_own_policy() {
        let mut map = HeaderMap::new();
        harden(&mut map);
        assert_eq!(map[header::CONTENT_SECURITY_POLICY], FILE_POLICY);
        assert!(!map.contains_key(header::ACCESS_CONTROL_ALLOW_ORIGIN));
        map.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(PAGE_POLICY));
        harden(&mut map);
        assert_eq!(map[header::CONTENT_SECURITY_POLICY], PAGE_POLICY);
    }
}
