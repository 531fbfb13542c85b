//! Where a craft is reached: `USER@HOST[:PORT]`.

use std::str::FromStr;

/// `USER@HOST[:PORT]`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Destination {
    /// As ssh takes it.
    pub(crate) user_at_host: String,
    pub(crate) port: Option<u16>,
}

impl FromStr for Destination {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!("{text:?} is no destination; write USER@HOST or USER@HOST:PORT, such as root@192.168.7.2")
        };
        let (user, rest) = text.split_once('@').ok_or_else(wrong)?;
        // An IPv6 address has colons of its own and stands in brackets.
        let (host, port) = match rest.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
            Some((host, "")) => (host, None),
            Some((host, port)) => (host, Some(port.strip_prefix(':').ok_or_else(wrong)?)),
            None => rest.split_once(':').map_or((rest, None), |(host, port)| (host, Some(port))),
        };
        let port = port.map(|port| port.parse().map_err(|_| wrong())).transpose()?;
        // What begins with a dash would be an option of ssh.
        let plain = |name: &str| {
            !name.is_empty()
                && !name.starts_with('-')
                && name.chars().all(|c| c.is_ascii_alphanumeric() || "._-:".contains(c))
        };
        if !plain(user) || !plain(host) {
            return Err(wrong());
        }
        Ok(Self { user_at_host: format!("{user}@{host}"), port })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn destination(text: &str) -> Result<(String, Option<u16>), String> {
        text.parse::<Destination>().map(|to| (to.user_at_host, to.port))
    }

    #[test]
    fn destinations_are_users_at_hosts() {
        assert_eq!(destination("root@192.168.7.2"), Ok(("root@192.168.7.2".into(), None)));
        assert_eq!(destination("me@craft-1.local:2222"), Ok(("me@craft-1.local".into(), Some(2222))));
        assert_eq!(destination("me@[fe80::1]:22"), Ok(("me@fe80::1".into(), Some(22))));
        for wrong in [
            "",
            "host",
            "@host",
            "me@",
            "me@host:",
            "me@host:x",
            "me@host:70000",
            "-oProxyCommand=x@h",
            "me@-x",
            "me@h;ls",
            "me@[::1]22",
        ] {
            assert!(destination(wrong).is_err_and(|error| error.contains("USER@HOST")), "{wrong}");
        }
    }
}
