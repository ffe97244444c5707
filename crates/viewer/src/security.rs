//! Access rules: a request must present the token, come from a page of this server, and address the
//! server by one of its names.
//!
//! The token keeps other users of the machine out. The check of `Host` keeps out pages of other
//! sites whose name was redirected to this machine (DNS rebinding), the check of `Origin` those
//! that open sockets across sites.
//!
//! A browser is started with a one-time code in the place of the token, because other users can
//! read its command line. The code redirects to the address with the token once, within a short
//! time, and on Linux only for a program of the same user (see [`crate::peer`]).

use crate::session::lock;
use axum::extract::Request;
use axum::http::HeaderMap;
use axum::http::header::{HOST, ORIGIN};
use std::net::{IpAddr, SocketAddr};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// First component of the path that holds a one-time code. A token is longer.
pub const ONCE: &str = "once";
/// Time for which a code is valid: a browser may take a while to start.
const CODE_TIME: Duration = Duration::from_secs(60);

/// The rules that requests must satisfy.
#[derive(Debug)]
pub struct Guard {
    token: String,
    /// The last code until it is used, and the time when it was issued.
    code: Mutex<Option<(String, Instant)>>,
    address: SocketAddr,
    /// True if requests may name any host, because the user asked to listen on all addresses.
    /// Otherwise they must name the server's address or, on loopback, `localhost`.
    any_host: bool,
}

impl Guard {
    /// A guard with this token, or a new random one of 128 bits.
    pub fn new(address: SocketAddr, token: Option<String>) -> Result<Self, String> {
        let token = match token {
            Some(token) => token,
            None => secret()?,
        };
        Ok(Self { token, code: Mutex::new(None), address, any_host: address.ip().is_unspecified() })
    }

    /// The token.
    pub fn token(&self) -> &str {
        &self.token
    }

    /// True if this is the token.
    pub fn knows(&self, token: &str) -> bool {
        is_same(token, &self.token)
    }

    /// Issues a new code in the place of the token; the previous one becomes invalid.
    pub fn new_code(&self) -> Result<String, String> {
        let code = secret()?;
        *lock(&self.code) = Some((code.clone(), Instant::now()));
        Ok(code)
    }

    /// True if this is the code and it is still valid. The code is used up by this call.
    pub fn takes_code(&self, code: &str) -> bool {
        let is_it = |(known, given): &mut (String, Instant)| {
            given.elapsed() < CODE_TIME && is_same(code, known)
        };
        lock(&self.code).take_if(is_it).is_some()
    }

    /// Checks that a request states host and origin unambiguously. Anything that proxies and
    /// servers could interpret differently is an error.
    pub fn check_form(&self, request: &Request) -> Result<(), String> {
        let (headers, uri) = (request.headers(), request.uri());
        let mut hosts = headers.get_all(HOST).iter();
        let (Some(host), None) = (hosts.next(), hosts.next()) else {
            return Err("a request has one Host".into());
        };
        let is_plain = |b: &u8| b.is_ascii_alphanumeric() || b".-_:[]".contains(b);
        if !host.as_bytes().iter().all(is_plain) {
            return Err("Host is a name or address, and a port".into());
        }
        if headers.get_all(ORIGIN).iter().count() > 1 {
            return Err("a request has one Origin at most".into());
        }
        if uri.authority().is_some_and(|a| a.as_str() != host)
            || uri.scheme_str().is_some_and(|s| s != "http")
        {
            return Err("the address asked for is not that of Host".into());
        }
        Ok(())
    }

    /// True if the request addresses this server.
    pub fn is_for_us(&self, headers: &HeaderMap) -> bool {
        let host = headers.get(HOST).and_then(|h| h.to_str().ok());
        host.is_some_and(|host| self.is_our_name(host))
    }

    /// True if a page of this server sent the request. Programs other than browsers send no origin.
    pub fn is_from_us(&self, headers: &HeaderMap) -> bool {
        match headers.get(ORIGIN).map(|o| o.to_str()) {
            None => true,
            Some(Ok(origin)) => origin.strip_prefix("http://").is_some_and(|host| {
                let asked = headers.get(HOST).and_then(|h| h.to_str().ok());
                self.is_our_name(host) && asked == Some(host)
            }),
            Some(Err(_)) => false,
        }
    }

    fn is_our_name(&self, host: &str) -> bool {
        let (name, port) =
            host.rsplit_once(':').filter(|(n, _)| !n.ends_with(':')).unwrap_or((host, "80"));
        if port.parse() != Ok(self.address.port()) {
            return false;
        }
        let name = name.trim_start_matches('[').trim_end_matches(']');
        let ip = name.parse::<IpAddr>().ok();
        self.any_host
            || ip == Some(self.address.ip())
            || (self.address.ip().is_loopback()
                && (name == "localhost" || ip.is_some_and(|ip| ip.is_loopback())))
    }
}

/// A token of 128 random bits.
fn secret() -> Result<String, String> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes).map_err(|e| format!("no random numbers for the token: {e}"))?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

/// Compares two texts in constant time: a text that is nearly right takes as long as a wrong one.
fn is_same(text: &str, secret: &str) -> bool {
    let difference = text.bytes().zip(secret.bytes()).fold(0, |d, (a, b)| d | (a ^ b));
    text.len() == secret.len() && difference == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn guard(address: &str) -> Guard {
        Guard::new(address.parse().expect("an address"), None).expect("random numbers")
    }

    fn headers(host: &'static str, origin: Option<&'static str>) -> HeaderMap {
        let mut headers = HeaderMap::from_iter([(HOST, HeaderValue::from_static(host))]);
        if let Some(origin) = origin {
            headers.insert(ORIGIN, HeaderValue::from_static(origin));
        }
        headers
    }

    #[test]
    fn only_names_of_this_machine_are_ours() {
        let guard = guard("127.0.0.1:8080");
        for good in ["127.0.0.1:8080", "localhost:8080", "[::1]:8080"] {
            assert!(guard.is_for_us(&headers(good, None)), "{good}");
        }
        for bad in
            ["127.0.0.1:8081", "evil.example:8080", "localhost", "localhost:8080.evil.example", ""]
        {
            assert!(!guard.is_for_us(&headers(bad, None)), "{bad}");
        }
        assert!(!guard.is_for_us(&HeaderMap::new()));
    }

    #[test]
    fn pages_of_other_sites_are_kept_out() {
        let guard = guard("127.0.0.1:8080");
        assert!(guard.is_from_us(&headers("localhost:8080", Some("http://localhost:8080"))));
        assert!(guard.is_from_us(&headers("localhost:8080", None)));
        for bad in
            ["http://evil.example", "https://localhost:8080", "null", "http://127.0.0.1:8080"]
        {
            assert!(!guard.is_from_us(&headers("localhost:8080", Some(bad))), "{bad}");
        }
    }

    #[test]
    fn tokens_differ_and_only_the_whole_one_is_known() {
        let (a, b) = (guard("127.0.0.1:1"), guard("127.0.0.1:1"));
        assert!(
            a.knows(a.token()) && !a.knows(b.token()) && !a.knows("") && !a.knows(&a.token()[1..])
        );
    }

    #[test]
    fn a_code_is_taken_once() {
        let guard = guard("127.0.0.1:1");
        assert!(!guard.takes_code("") && !guard.takes_code(guard.token()));
        let old = guard.new_code().expect("random numbers");
        let code = guard.new_code().expect("random numbers");
        assert!(code != guard.token() && !guard.takes_code(&old));
        assert!(guard.takes_code(&code) && !guard.takes_code(&code));
    }

    #[test]
    fn what_can_be_read_in_two_ways_is_refused() {
        let guard = guard("127.0.0.1:8080");
        let is_fine = |uri: &str, headers: &[(&str, &str)]| {
            let request = headers
                .iter()
                .fold(Request::builder().uri(uri), |r, (name, value)| r.header(*name, *value));
            guard.check_form(&request.body(axum::body::Body::empty()).expect("a request")).is_ok()
        };
        let host = ("host", "localhost:8080");
        assert!(is_fine("/", &[host, ("origin", "http://localhost:8080")]));
        assert!(is_fine("http://localhost:8080/", &[host]));
        let other = ("host", "evil.example");
        let bad: [(&str, &[(&str, &str)]); 8] = [
            ("/", &[]),
            ("/", &[host, host]),
            ("/", &[host, other]),
            ("/", &[("host", "evil.example@localhost:8080")]),
            ("/", &[host, ("origin", "http://localhost:8080"), ("origin", "http://evil.example")]),
            ("http://evil.example/", &[host]),
            ("http://localhost/", &[host]),
            ("https://localhost:8080/", &[host]),
        ];
        for (uri, headers) in bad {
            assert!(!is_fine(uri, headers), "{uri} {headers:?}");
        }
    }
}
