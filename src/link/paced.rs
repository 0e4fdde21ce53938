//! Octets through pseudo-terminals at the pace of a baud rate.

use super::pace::{Pace, sleep_until};
use super::pseudo::{MasterRead, Pseudo, Written};
use std::io;
use std::time::{Duration, Instant};

/// Octets are handed on in pieces of this time; one octet at least.
pub(super) const PIECE: Duration = Duration::from_millis(1);
/// How long one look for octets lasts.
const LOOK: Duration = Duration::from_millis(50);

/// Hears a pseudo-terminal at the pace of a line.
pub(super) struct PacedReader {
    pace: Pace,
    buffer: Vec<u8>,
}

impl PacedReader {
    pub fn new(baud: u32) -> PacedReader {
        let pace = Pace::of_baud(baud);
        PacedReader {
            buffer: vec![0; pace.bytes_in(PIECE).min(4096)],
            pace,
        }
    }

    /// The next octets, once the last of them has passed; with what else happened.
    pub fn receive(&mut self, pseudo: &Pseudo) -> io::Result<(MasterRead, &[u8])> {
        let heard = pseudo.receive(&mut self.buffer, LOOK)?;
        let now = Instant::now();
        let MasterRead::Octets { length, waited } = heard else {
            self.pace.rest(now);
            return Ok((heard, &[]));
        };
        if waited {
            self.pace.rest(now);
        }
        sleep_until(self.pace.pass(length, now));
        Ok((heard, &self.buffer[..length]))
    }
}

/// Writes all octets; whether they had to wait for room. None if the client has gone, or they are
/// no longer `wanted`.
pub(super) fn write_all(
    to: &Pseudo,
    mut bytes: &[u8],
    client: Option<u32>,
    wanted: &dyn Fn() -> bool,
) -> io::Result<Option<bool>> {
    let mut waited = false;
    while !bytes.is_empty() {
        match to.write(bytes, client)? {
            Written::NoReader => return Ok(None),
            Written::Octets(0) if !wanted() => return Ok(None),
            Written::Octets(0) => {
                waited = true;
                to.wait_for_room()?;
            }
            Written::Octets(length) => bytes = &bytes[length..],
        }
    }
    Ok(Some(waited))
}

/// Carries octets one way while `wanted`. Without a client at the far end they are lost, as on any
/// wire; if it does not read, they wait, as with flow control.
pub(super) fn relay(
    from: &Pseudo,
    to: &Pseudo,
    baud: u32,
    wanted: &dyn Fn() -> bool,
) -> io::Result<()> {
    let mut reader = PacedReader::new(baud);
    while wanted() {
        let (_, bytes) = reader.receive(from)?;
        if let Some(true) = write_all(to, bytes, None, wanted)? {
            reader.pace.rest(Instant::now());
        }
    }
    Ok(())
}
