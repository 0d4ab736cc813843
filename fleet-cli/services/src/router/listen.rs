//! Where a router may listen without identities.

use std::net::IpAddr;
use xtb_client::{Error, ErrorKind, Result};

/// Whether a router may listen on `endpoint`: with TLS always, without it where no other computer can reach it, or if
/// that is wanted (`insecure`), with a warning.
///
/// # Errors
/// [`ErrorKind::Invalid`]: others could reach it.
pub fn check_listen(endpoint: &str, insecure: bool) -> Result<Option<String>> {
    let Some(address) = reachable(endpoint) else { return Ok(None) };
    let danger = format!("whoever reaches {address} could drive every robot");
    if insecure {
        return Ok(Some(format!("{danger}: it listens without identities (--insecure)")));
    }
    let port = address.rsplit_once(':').map_or("7447", |(_, port)| port);
    Err(Error::new(ErrorKind::Invalid, danger).hint(format!(
        "give everybody an identity: `fleet-cli pki init`, then --listen tls/0.0.0.0:{port}; or keep it to this \
         computer with --listen tcp/127.0.0.1:{port}; or open it to all with --insecure"
    )))
}

/// The address of an endpoint that others can reach without an identity.
fn reachable(endpoint: &str) -> Option<&str> {
    let (protocol, rest) = endpoint.split_once('/')?;
    // `tcp/10.0.0.1:7447?metadata#config`
    let address = rest.split(['?', '#']).next().unwrap_or(rest);
    let local = match protocol {
        "tls" | "unixpipe" | "unixsock-stream" => true,
        _ => is_loopback(host(address)),
    };
    (!local).then_some(address)
}

/// Without the port and brackets.
fn host(address: &str) -> &str {
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    host.trim_start_matches('[').trim_end_matches(']')
}

fn is_loopback(host: &str) -> bool {
    match host.parse::<IpAddr>() {
        Ok(IpAddr::V6(v6)) => v6.is_loopback() || v6.to_ipv4_mapped().is_some_and(|v4| v4.is_loopback()),
        Ok(IpAddr::V4(v4)) => v4.is_loopback(),
        Err(_) => host == "localhost",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_identities_a_router_listens_to_this_computer_alone() {
        for local in [
            "tcp/127.0.0.1:7447",
            "tcp/127.1.2.3:0",
            "tcp/localhost:7447",
            "tcp/[::1]:7447",
            "tcp/[::ffff:127.0.0.1]:7447",
            "tls/0.0.0.0:7447",
            "tls/10.0.0.1:7447",
        ] {
            assert_eq!(check_listen(local, false), Ok(None), "{local}");
            assert_eq!(check_listen(local, true), Ok(None), "{local}");
        }
        for open in [
            "tcp/0.0.0.0:7447",
            "tcp/[::]:7447",
            "tcp/10.0.0.1:7447",
            "tcp/lab-pc:7447",
            "udp/10.0.0.1:7447",
            "ws/10.0.0.1:7447",
            "quic/10.0.0.1:7447",
            "tcp/127.0.0.1.example.org:7447",
            "tcp/10.0.0.1:7447#iface=lo",
        ] {
            let refused = check_listen(open, false).unwrap_err();
            assert_eq!(refused.kind, ErrorKind::Invalid, "{open}");
            let warning = check_listen(open, true).unwrap().unwrap();
            assert!(warning.contains("could drive every robot"), "{warning}");
        }
    }

    #[test]
    fn a_refusal_says_whom_it_would_let_in_and_how_to_go_on() {
        let refused = check_listen("tcp/10.0.0.1:7448", false).unwrap_err();
        assert_eq!(refused.message, "whoever reaches 10.0.0.1:7448 could drive every robot");
        for way in ["fleet-cli pki init", "--listen tls/0.0.0.0:7448", "--insecure"] {
            assert!(refused.hint.contains(way), "{}", refused.hint);
        }
    }
}
