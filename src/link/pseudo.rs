//! The master end of a pseudo-terminal. Clients open the other end by name, one after another.
//!
//! Linux: a master without a client buffers some 20,480 bytes, which the next client would read.
//! Settings of a client, exclusive use included, remain after it closes. The master gets POLLHUP
//! only after a first client has closed.

use super::lock::lock;
use super::name::Name;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{
    OptionalActions, QueueSelector, ioctl_tiocnxcl, tcflush, tcgetattr, tcsetattr,
};
use skyloop_firmware_sim::port::Refusal;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Pause before the next check for a client or for room.
const SOON: Duration = Duration::from_millis(10);

pub(super) struct Pseudo {
    /// The name that clients open, if not the system's name.
    name: Option<Name>,
    state: Mutex<State>,
}

struct State {
    master: Arc<OwnedFd>,
    /// The system's name of the other end.
    device: String,
    /// Whether a client has it open.
    held: bool,
    /// Number of clients so far.
    clients: u32,
}

/// What the master received.
#[derive(Debug, PartialEq)]
pub(super) enum MasterRead {
    /// This many bytes; `waited`: none were there at first.
    Bytes { length: usize, waited: bool },
    /// A client, and no bytes.
    Silence,
    /// The client has closed.
    Left,
    /// No client has the other end open.
    NoClient,
}

#[derive(Debug, PartialEq)]
pub(super) enum Written {
    /// Number of written bytes; there is no room for the others.
    Bytes(usize),
    /// The client has closed.
    NoClient,
}

impl Pseudo {
    /// A new pseudo-terminal, with a symbolic link if a name is given.
    pub fn open(name: Option<&Path>) -> Result<Pseudo, Refusal> {
        let (master, device) = pair().map_err(|source| Refusal {
            action: "open a pseudo-terminal",
            source,
            remedy: "check that /dev/ptmx and /dev/pts exist".to_string(),
        })?;
        let name = name.map(|name| Name::create(name, &device)).transpose()?;
        Ok(Pseudo {
            name,
            state: Mutex::new(State {
                master: Arc::new(master),
                device,
                held: false,
                clients: 0,
            }),
        })
    }

    pub fn name(&self) -> String {
        match &self.name {
            Some(name) => name.path.display().to_string(),
            None => lock(&self.state).device.clone(),
        }
    }

    /// Reads the received bytes, waiting at most `wait`. Only one thread may call it, since it
    /// detects when clients open and close.
    pub fn receive(&self, buffer: &mut [u8], wait: Duration) -> io::Result<MasterRead> {
        let master = lock(&self.state).master.clone();
        let mut waited = false;
        loop {
            match rustix::io::read(&master, &mut *buffer) {
                Ok(length) if length > 0 => {
                    lock(&self.state).note_client();
                    return Ok(MasterRead::Bytes { length, waited });
                }
                Err(Errno::INTR) => continue,
                Err(Errno::AGAIN) => {}
                // Hung up until the next client opens.
                Ok(_) | Err(Errno::IO) => return self.hung_up(wait),
                Err(error) => return Err(error.into()),
            }
            if waited {
                return Ok(MasterRead::Silence);
            }
            waited = true;
            let events = ready(&master, PollFlags::IN, wait)?;
            if events.contains(PollFlags::HUP) {
                continue;
            }
            lock(&self.state).note_client();
        }
    }

    fn hung_up(&self, wait: Duration) -> io::Result<MasterRead> {
        let mut state = lock(&self.state);
        if !std::mem::take(&mut state.held) {
            drop(state);
            std::thread::sleep(SOON.min(wait));
            return Ok(MasterRead::NoClient);
        }
        if let Err(error) = reset(&state.master, &state.device) {
            // The client left it in exclusive use: only a new one can be opened again.
            tracing::debug!(%error, "{} is replaced", state.device);
            let (master, device) = pair()?;
            if let Some(name) = &self.name {
                name.redirect(&state.device, &device)?;
            }
            (state.master, state.device) = (Arc::new(master), device);
        }
        Ok(MasterRead::Left)
    }

    /// Writes bytes that fit, if client number `client` (`None`: any) has the other end open.
    pub fn write(&self, bytes: &[u8], client: Option<u32>) -> io::Result<Written> {
        let mut state = lock(&self.state);
        if !state.held
            && !ready(&state.master, PollFlags::OUT, Duration::ZERO)?.contains(PollFlags::HUP)
        {
            state.note_client();
        }
        if !state.held || client.is_some_and(|client| client != state.clients) {
            return Ok(Written::NoClient);
        }
        match rustix::io::write(&state.master, bytes) {
            Ok(length) => Ok(Written::Bytes(length)),
            Err(Errno::AGAIN | Errno::INTR) => Ok(Written::Bytes(0)),
            Err(Errno::IO) => Ok(Written::NoClient),
            Err(error) => Err(error.into()),
        }
    }

    /// Waits for room, for a short time.
    pub fn wait_for_room(&self) -> io::Result<()> {
        let master = lock(&self.state).master.clone();
        if ready(&master, PollFlags::OUT, SOON)?.contains(PollFlags::HUP) {
            std::thread::sleep(SOON);
        }
        Ok(())
    }

    /// Whether a client has the other end open, as last detected.
    pub fn is_held(&self) -> bool {
        lock(&self.state).held
    }

    /// Number of clients so far, including the present one.
    pub fn clients(&self) -> u32 {
        lock(&self.state).clients
    }

    /// Removes the name, if it still leads to this pseudo-terminal.
    pub fn remove_name(&self) {
        if let Some(name) = &self.name {
            name.remove(&lock(&self.state).device);
        }
    }
}

impl Drop for Pseudo {
    fn drop(&mut self) {
        self.remove_name();
    }
}

impl State {
    /// Notes that a client has the other end open.
    fn note_client(&mut self) {
        let new = !std::mem::replace(&mut self.held, true);
        self.clients = self.clients.wrapping_add(u32::from(new));
    }
}

/// A non-blocking master and the name of its other end, raw and closed.
fn pair() -> io::Result<(OwnedFd, String)> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let device = ptsname(&master, Vec::new())?;
    let device = device.to_string_lossy().into_owned();
    rustix::fs::fcntl_setfl(&master, OFlags::NONBLOCK)?;
    // On some systems the master has no settings.
    let _ = make_raw(&master);
    reset(&master, &device)?;
    Ok((master, device))
}

/// Clears unread bytes, settings and exclusive use of a closed client. Leaves the end hung up.
fn reset(master: &OwnedFd, device: &str) -> io::Result<()> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let other = rustix::fs::open(device, flags, Mode::empty())?;
    ioctl_tiocnxcl(&other)?;
    // Flushes bytes in transit, then those that have arrived. Bytes written by the client remain.
    tcflush(master, QueueSelector::OFlush)?;
    tcflush(&other, QueueSelector::IFlush)?;
    make_raw(&other)
}

fn make_raw(end: impl AsFd) -> io::Result<()> {
    let mut settings = tcgetattr(&end)?;
    settings.make_raw();
    Ok(tcsetattr(&end, OptionalActions::Now, &settings)?)
}

fn ready(master: &OwnedFd, events: PollFlags, wait: Duration) -> io::Result<PollFlags> {
    let mut fds = [PollFd::new(master, events)];
    let wait = rustix::event::Timespec {
        tv_sec: wait.as_secs().try_into().unwrap_or(i64::MAX),
        tv_nsec: wait.subsec_nanos().into(),
    };
    match poll(&mut fds, Some(&wait)) {
        Ok(_) => Ok(fds[0].revents()),
        Err(Errno::INTR) => Ok(PollFlags::empty()),
        Err(error) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serialport::TTYPort;
    use std::io::{Read, Write};

    const WAIT: Duration = Duration::from_millis(100);

    fn client(pseudo: &Pseudo) -> TTYPort {
        let port = serialport::new(pseudo.name(), 115_200).timeout(WAIT);
        port.open_native().unwrap()
    }

    /// Reads until bytes come or the client closes.
    fn event(pseudo: &Pseudo, buffer: &mut [u8]) -> MasterRead {
        let received = (0..200).map(|_| pseudo.receive(buffer, WAIT).unwrap());
        let mut events = received
            .filter(|received| !matches!(received, MasterRead::Silence | MasterRead::NoClient));
        events.next().unwrap()
    }

    #[test]
    fn successive_clients_start_without_leftovers() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("port");
        let pseudo = Pseudo::open(Some(&name)).unwrap_or_else(|e| panic!("{}", e.source));
        let mut buffer = [0; 100];
        assert_eq!(
            pseudo.receive(&mut buffer, WAIT).unwrap(),
            MasterRead::NoClient
        );
        assert_eq!(pseudo.write(b"lost", None).unwrap(), Written::NoClient);
        for round in 1..=3 {
            let mut port = client(&pseudo);
            if round == 1 {
                assert_eq!(
                    pseudo.receive(&mut buffer, WAIT).unwrap(),
                    MasterRead::Silence
                );
                assert_eq!(pseudo.clients(), 1);
            }
            let unread = port.read(&mut buffer).unwrap_err();
            assert_eq!(unread.kind(), io::ErrorKind::TimedOut, "no stale bytes");
            assert_eq!(pseudo.write(b"to", Some(round)).unwrap(), Written::Bytes(2));
            assert_eq!(
                pseudo.write(b"-", Some(round - 1)).unwrap(),
                Written::NoClient
            );
            assert_eq!(port.read(&mut buffer).unwrap(), 2);
            // Until there is no room; all remains unread.
            while pseudo.write(&[7; 1000], None).unwrap() != Written::Bytes(0) {}
            port.write_all(b"from").unwrap();
            drop(port);
            // Bytes written before the client closed are received.
            let received = event(&pseudo, &mut buffer);
            assert!(matches!(received, MasterRead::Bytes { length: 4, .. }));
            assert_eq!(event(&pseudo, &mut buffer), MasterRead::Left);
        }
        drop(pseudo);
        assert!(name.symlink_metadata().is_err());
    }

    #[test]
    fn replaced_port_has_the_same_name() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("port");
        let pseudo = Pseudo::open(Some(&name)).ok().unwrap();
        let port = client(&pseudo);
        assert_eq!(pseudo.write(b"-", None).unwrap(), Written::Bytes(1));
        let before = lock(&pseudo.state).device.clone();
        // Like a device in exclusive use, which cannot be opened.
        lock(&pseudo.state).device = "/dev/pts/none".to_string();
        std::fs::remove_file(&name).unwrap();
        std::os::unix::fs::symlink("/dev/pts/none", &name).unwrap();
        drop(port);
        assert_eq!(event(&pseudo, &mut [0; 9]), MasterRead::Left);
        assert_ne!(lock(&pseudo.state).device, before);
        let _port = client(&pseudo);
        assert_eq!(pseudo.write(b"-", Some(2)).unwrap(), Written::Bytes(1));
    }
}
