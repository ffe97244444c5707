//! Determines which user runs the program at the other end of a local connection.

use std::net::SocketAddr;

/// True if the same user runs both ends of a connection. Linux reports the users of connections
/// within the machine. False if the user is not known.
#[cfg(target_os = "linux")]
pub fn is_same_user(own: SocketAddr, peer: SocketAddr) -> bool {
    // Both ends of the connection are in the table of sockets, which names the user of each.
    let tables = ["/proc/self/net/tcp", "/proc/self/net/tcp6"]
        .map(|p| std::fs::read_to_string(p).unwrap_or_default());
    let user_of = |local, remote| tables.iter().find_map(|table| user_in(table, local, remote));
    let user = user_of(own, peer);
    user.is_some() && user == user_of(peer, own)
}

/// Always true: other systems do not report the users of a connection, so the one-time code alone
/// decides.
#[cfg(not(target_os = "linux"))]
pub fn is_same_user(_own: SocketAddr, _peer: SocketAddr) -> bool {
    true
}

/// The user of the socket with these addresses, from a table like `/proc/net/tcp`.
#[cfg(target_os = "linux")]
fn user_in(table: &str, local: SocketAddr, remote: SocketAddr) -> Option<u32> {
    let is_it = |text: &str, address: SocketAddr| {
        parsed(text).is_some_and(|a| a.0 == address.ip().to_canonical() && a.1 == address.port())
    };
    table.lines().find_map(|line| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let &[_, here, there, _, _, _, _, user, ..] = &fields[..] else { return None };
        (is_it(here, local) && is_it(there, remote)).then(|| user.parse().ok())?
    })
}

/// Parses an address such as `0100007F:1F90`: its words in native byte order, and the port.
#[cfg(target_os = "linux")]
fn parsed(text: &str) -> Option<(std::net::IpAddr, u16)> {
    use std::net::{Ipv4Addr, Ipv6Addr};
    let (address, port) = text.split_once(':')?;
    let words = address
        .as_bytes()
        .chunks(8)
        .map(|w| u32::from_str_radix(std::str::from_utf8(w).ok()?, 16).ok());
    let bytes: Vec<u8> =
        words.collect::<Option<Vec<u32>>>()?.into_iter().flat_map(u32::to_ne_bytes).collect();
    let address = match bytes.len() {
        4 => Ipv4Addr::from(<[u8; 4]>::try_from(bytes).ok()?).into(),
        _ => Ipv6Addr::from(<[u8; 16]>::try_from(bytes).ok()?).to_canonical(),
    };
    Some((address, u16::from_str_radix(port, 16).ok()?))
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use std::net::{TcpListener, TcpStream};

    #[test]
    fn both_ends_of_a_connection_of_one_user_are_found() {
        for address in ["127.0.0.1:0", "[::]:0"] {
            let Ok(listener) = TcpListener::bind(address) else { continue };
            let port = listener.local_addr().expect("it is bound").port();
            let client = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
            let (server, peer) = listener.accept().expect("a client has connected");
            assert!(is_same_user(server.local_addr().expect("it is connected"), peer), "{address}");
            drop(client);
        }
    }

    #[test]
    fn a_socket_of_another_user_and_one_that_is_not_there_are_not_ours() {
        let table = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   \
            uid  timeout inode\n   \
                     0: 0100007F:1F90 0100007F:C001 01 00000000:00000000 00:00000000 00000000  \
                     1000        0 1\n   \
                     1: 0100007F:C001 0100007F:1F90 01 00000000:00000000 00:00000000 00000000  \
                     1001        0 2\n";
        let [own, peer] = ["127.0.0.1:8080", "127.0.0.1:49153"]
            .map(|a| a.parse::<SocketAddr>().expect("an address"));
        if cfg!(target_endian = "little") {
            assert_eq!(
                (user_in(table, own, peer), user_in(table, peer, own)),
                (Some(1000), Some(1001))
            );
        }
        assert_eq!(user_in(table, own, own), None);
        assert!(!is_same_user(own, own));
    }
}
