//! Who may talk to the server: whoever has the token, from a page of this server, asking for one of its names.
//!
//! The token keeps other users of the machine out. The check of `Host` keeps out pages of other sites whose name has been pointed
//! at this machine (DNS rebinding), the check of `Origin` those that open sockets across sites.

use axum::http::HeaderMap;
use axum::http::header::{HOST, ORIGIN};
use std::net::{IpAddr, SocketAddr};

/// What a request must show.
#[derive(Clone, Debug)]
pub struct Guard {
    token: String,
    address: SocketAddr,
    /// Names by which the server may be called besides its address and, on loopback, `localhost`. Empty: any, because the user has
    /// asked to listen on all addresses.
    any_host: bool,
}

impl Guard {
    /// A guard with this token, or a new random one of 128 bits.
    pub fn new(address: SocketAddr, token: Option<String>) -> Result<Self, String> {
        let token = match token {
            Some(token) => token,
            None => {
                let mut bytes = [0_u8; 16];
                getrandom::fill(&mut bytes).map_err(|e| format!("no random numbers for the token: {e}"))?;
                bytes.iter().map(|b| format!("{b:02x}")).collect()
            }
        };
        Ok(Self { token, address, any_host: address.ip().is_unspecified() })
    }

    /// The token.
    pub fn token(&self) -> &str {
        &self.token
    }

    /// Whether this is the token. Takes as long for nearly right ones as for wrong ones.
    pub fn knows(&self, token: &str) -> bool {
        let difference = token.bytes().zip(self.token.bytes()).fold(0, |d, (a, b)| d | (a ^ b));
        token.len() == self.token.len() && difference == 0
    }

    /// Whether the request is for this server.
    pub fn is_for_us(&self, headers: &HeaderMap) -> bool {
        let host = headers.get(HOST).and_then(|h| h.to_str().ok());
        host.is_some_and(|host| self.is_our_name(host))
    }

    /// Whether a page of this server asks. Programs other than browsers send no origin.
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
        let (name, port) = host.rsplit_once(':').filter(|(n, _)| !n.ends_with(':')).unwrap_or((host, "80"));
        if port.parse() != Ok(self.address.port()) {
            return false;
        }
        let name = name.trim_start_matches('[').trim_end_matches(']');
        let ip = name.parse::<IpAddr>().ok();
        self.any_host
            || ip == Some(self.address.ip())
            || (self.address.ip().is_loopback() && (name == "localhost" || ip.is_some_and(|ip| ip.is_loopback())))
    }
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
        for bad in ["127.0.0.1:8081", "evil.example:8080", "localhost", "localhost:8080.evil.example", ""] {
            assert!(!guard.is_for_us(&headers(bad, None)), "{bad}");
        }
        assert!(!guard.is_for_us(&HeaderMap::new()));
    }

    #[test]
    fn pages_of_other_sites_are_kept_out() {
        let guard = guard("127.0.0.1:8080");
        assert!(guard.is_from_us(&headers("localhost:8080", Some("http://localhost:8080"))));
        assert!(guard.is_from_us(&headers("localhost:8080", None)));
        for bad in ["http://evil.example", "https://localhost:8080", "null", "http://127.0.0.1:8080"] {
            assert!(!guard.is_from_us(&headers("localhost:8080", Some(bad))), "{bad}");
        }
    }

    #[test]
    fn tokens_differ_and_only_the_whole_one_is_known() {
        let (a, b) = (guard("127.0.0.1:1"), guard("127.0.0.1:1"));
        assert!(a.knows(a.token()) && !a.knows(b.token()) && !a.knows("") && !a.knows(&a.token()[1..]));
    }
}
