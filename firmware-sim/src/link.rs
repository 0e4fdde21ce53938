//! A link by its address.

use crate::port::{Port, PortError, UdpPort};
use crate::serial::SerialPort;

/// Opens `udp://HOST:PORT` or `serial://PATH[?baud=N]`.
///
/// # Errors
/// [`PortError::Address`] if the text names no link, [`PortError::Io`] if it cannot be opened.
pub fn open(link: &str) -> Result<Box<dyn Port + Send>, PortError> {
    let wrong = |reason: String| PortError::Address {
        text: link.into(),
        reason,
    };
    if let Some(address) = link.strip_prefix("udp://") {
        let address = address
            .parse()
            .map_err(|_| wrong(format!("\"{address}\" is no IP address and port")))?;
        Ok(Box::new(UdpPort::connect(address)?))
    } else if let Some(rest) = link.strip_prefix("serial://") {
        const DEFAULT_BAUD: u32 = 115_200;
        let (path, options) = rest.split_once('?').unwrap_or((rest, ""));
        let baud = match options.strip_prefix("baud=").map(str::parse) {
            Some(Ok(baud)) if baud > 0 => baud,
            None if options.is_empty() => DEFAULT_BAUD,
            _ => return Err(wrong(format!("\"{options}\" is not baud=NUMBER"))),
        };
        Ok(Box::new(SerialPort::open(path, baud)?))
    } else {
        Err(wrong(
            "it starts neither with udp:// nor with serial://".into(),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_that_are_none_are_refused_with_an_example() {
        for (text, part) in [
            ("udp://127.0.0.1", "no IP address and port"),
            ("udp://localhost:5", "no IP address and port"),
            ("tcp://127.0.0.1:5", "neither"),
            ("serial:///dev/ttyX?baud=fast", "baud=NUMBER"),
            ("serial:///dev/ttyX?baud=0", "baud=NUMBER"),
        ] {
            let error = open(text).err().unwrap().to_string();
            assert!(
                error.contains(part) && error.contains("udp://127.0.0.1:PORT"),
                "{text}: {error}"
            );
        }
        let error = open("serial:///dev/there-is-no-such-port")
            .err()
            .unwrap()
            .to_string();
        assert!(error.contains("/dev/there-is-no-such-port"), "{error}");
    }
}
