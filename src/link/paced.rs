//! Bytes through pseudo-terminals at the pace of a baud rate.

use super::pace::{Pace, sleep_until};
use super::pseudo::{MasterRead, Pseudo, Written};
use std::io;
use std::time::{Duration, Instant};

/// Airtime of the pieces in which bytes are forwarded; one byte at least.
pub(super) const PIECE: Duration = Duration::from_millis(1);
/// Timeout of one read.
const READ_TIMEOUT: Duration = Duration::from_millis(50);

/// Reads a pseudo-terminal at the pace of a line.
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

    /// The next bytes, once the last of them has passed the line, and the result of the read.
    pub fn receive(&mut self, pseudo: &Pseudo) -> io::Result<(MasterRead, &[u8])> {
        let received = pseudo.receive(&mut self.buffer, READ_TIMEOUT)?;
        let now = Instant::now();
        let MasterRead::Bytes { length, waited } = received else {
            self.pace.idle(now);
            return Ok((received, &[]));
        };
        if waited {
            self.pace.idle(now);
        }
        sleep_until(self.pace.pass(length, now));
        Ok((received, &self.buffer[..length]))
    }
}

/// Writes all bytes; returns whether they had to wait for room. `None` if the client has closed, or
/// the bytes are no longer `wanted`.
pub(super) fn write_all(
    to: &Pseudo,
    mut bytes: &[u8],
    client: Option<u32>,
    wanted: &dyn Fn() -> bool,
) -> io::Result<Option<bool>> {
    let mut waited = false;
    while !bytes.is_empty() {
        match to.write(bytes, client)? {
            Written::NoClient => return Ok(None),
            Written::Bytes(0) if !wanted() => return Ok(None),
            Written::Bytes(0) => {
                waited = true;
                to.wait_for_room()?;
            }
            Written::Bytes(length) => bytes = &bytes[length..],
        }
    }
    Ok(Some(waited))
}

/// Carries bytes in one direction while `wanted`. Without a client at the far end they are lost, as
/// on any wire. If the client does not read, they wait, as with flow control.
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
            reader.pace.idle(Instant::now());
        }
    }
    Ok(())
}
