//! A pseudo-terminal: the master end here, the other end opened by clients by name, again and
//! again.
//!
//! Linux: a master without a client takes some 20,480 octets, which the next client would read.
//! Settings of a client, exclusive use included, outlast it. The master gets POLLHUP only after a
//! first client has closed.

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

/// Pause before looking again for a client, or for room.
const SOON: Duration = Duration::from_millis(10);

/// One pseudo-terminal.
pub(super) struct Pseudo {
    /// The name that clients open, if it is not the system's own.
    name: Option<Name>,
    state: Mutex<State>,
}

struct State {
    master: Arc<OwnedFd>,
    /// The system's name of the other end.
    device: String,
    /// Whether a client holds it.
    held: bool,
    /// How many clients there were.
    clients: u32,
}

/// What the master heard.
#[derive(Debug, PartialEq)]
pub(super) enum MasterRead {
    /// So many octets; whether they had to be waited for.
    Octets { length: usize, waited: bool },
    /// Nothing.
    Silence,
    /// The client has gone.
    Left,
    /// Nobody holds the other end.
    NoReader,
}

/// What became of octets written.
#[derive(Debug, PartialEq)]
pub(super) enum Written {
    /// So many have left; the others find no room.
    Octets(usize),
    /// The client has gone.
    NoReader,
}

impl Pseudo {
    /// A new pseudo-terminal, with a name of its own in the file system if one is given.
    pub fn open(name: Option<&Path>) -> Result<Pseudo, Refusal> {
        let (master, device) = pair().map_err(|source| Refusal {
            action: "open a pseudo-terminal",
            source,
            remedy: "check that /dev/ptmx and /dev/pts exist".to_string(),
        })?;
        let name = name.map(|name| Name::give(name, &device)).transpose()?;
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

    /// What a client opens.
    pub fn name(&self) -> String {
        match &self.name {
            Some(name) => name.path.display().to_string(),
            None => lock(&self.state).device.clone(),
        }
    }

    /// Reads what has come, waiting `wait` at most. For one thread: it notices clients come and go.
    pub fn receive(&self, buffer: &mut [u8], wait: Duration) -> io::Result<MasterRead> {
        let master = lock(&self.state).master.clone();
        let mut waited = false;
        loop {
            match rustix::io::read(&master, &mut *buffer) {
                Ok(length) if length > 0 => {
                    lock(&self.state).come();
                    return Ok(MasterRead::Octets { length, waited });
                }
                Err(Errno::INTR) => continue,
                Err(Errno::AGAIN) => {}
                // Hung up, which ends with the next client.
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
            lock(&self.state).come();
        }
    }

    fn hung_up(&self, wait: Duration) -> io::Result<MasterRead> {
        let mut state = lock(&self.state);
        if !std::mem::take(&mut state.held) {
            drop(state);
            std::thread::sleep(SOON.min(wait));
            return Ok(MasterRead::NoReader);
        }
        if let Err(error) = calm(&state.master, &state.device) {
            // It was left in exclusive use: only a new one can be opened again.
            tracing::debug!(%error, "{} is replaced", state.device);
            let (master, device) = pair()?;
            if let Some(name) = &self.name {
                name.lead(&state.device, &device)?;
            }
            (state.master, state.device) = (Arc::new(master), device);
        }
        Ok(MasterRead::Left)
    }

    /// Writes what fits, if client number `client` (none: any) holds the other end.
    pub fn write(&self, bytes: &[u8], client: Option<u32>) -> io::Result<Written> {
        let mut state = lock(&self.state);
        if !state.held
            && !ready(&state.master, PollFlags::OUT, Duration::ZERO)?.contains(PollFlags::HUP)
        {
            state.come();
        }
        if !state.held || client.is_some_and(|client| client != state.clients) {
            return Ok(Written::NoReader);
        }
        match rustix::io::write(&state.master, bytes) {
            Ok(length) => Ok(Written::Octets(length)),
            Err(Errno::AGAIN | Errno::INTR) => Ok(Written::Octets(0)),
            Err(Errno::IO) => Ok(Written::NoReader),
            Err(error) => Err(error.into()),
        }
    }

    /// Waits for room, a short time at most.
    pub fn wait_for_room(&self) -> io::Result<()> {
        let master = lock(&self.state).master.clone();
        if ready(&master, PollFlags::OUT, SOON)?.contains(PollFlags::HUP) {
            std::thread::sleep(SOON);
        }
        Ok(())
    }

    /// Whether a client holds the other end, as far as has been noticed.
    pub fn is_held(&self) -> bool {
        lock(&self.state).held
    }

    /// How many clients there were, the present one included.
    pub fn clients(&self) -> u32 {
        lock(&self.state).clients
    }

    /// Takes the name away, if it is still this pseudo-terminal's.
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
    /// Notes that a client holds the other end.
    fn come(&mut self) {
        let new = !std::mem::replace(&mut self.held, true);
        self.clients = self.clients.wrapping_add(u32::from(new));
    }
}

/// A master that does not block and the name of its other end, raw and closed.
fn pair() -> io::Result<(OwnedFd, String)> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let device = ptsname(&master, Vec::new())?;
    let device = device.to_string_lossy().into_owned();
    rustix::fs::fcntl_setfl(&master, OFlags::NONBLOCK)?;
    // Some systems have no settings of the master's own.
    let _ = make_raw(&master);
    calm(&master, &device)?;
    Ok((master, device))
}

/// Clears what a client left: unread octets, settings, exclusive use. Leaves the end hung up.
fn calm(master: &OwnedFd, device: &str) -> io::Result<()> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let other = rustix::fs::open(device, flags, Mode::empty())?;
    ioctl_tiocnxcl(&other)?;
    // What lies between the two, then what has arrived; what the client wrote is still heard.
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

    /// Hears until something happens.
    fn event(pseudo: &Pseudo, buffer: &mut [u8]) -> MasterRead {
        let heard = (0..200).map(|_| pseudo.receive(buffer, WAIT).unwrap());
        let mut events =
            heard.filter(|heard| !matches!(heard, MasterRead::Silence | MasterRead::NoReader));
        events.next().unwrap()
    }

    #[test]
    fn clients_come_and_go_and_leave_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("port");
        let pseudo = Pseudo::open(Some(&name)).unwrap_or_else(|e| panic!("{}", e.source));
        let mut buffer = [0; 100];
        assert_eq!(
            pseudo.receive(&mut buffer, WAIT).unwrap(),
            MasterRead::NoReader
        );
        assert_eq!(pseudo.write(b"lost", None).unwrap(), Written::NoReader);
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
            assert_eq!(unread.kind(), io::ErrorKind::TimedOut, "nothing stale");
            assert_eq!(
                pseudo.write(b"to", Some(round)).unwrap(),
                Written::Octets(2)
            );
            assert_eq!(
                pseudo.write(b"-", Some(round - 1)).unwrap(),
                Written::NoReader
            );
            assert_eq!(port.read(&mut buffer).unwrap(), 2);
            // Until there is no room; all of it stays unread.
            while pseudo.write(&[7; 1000], None).unwrap() != Written::Octets(0) {}
            port.write_all(b"from").unwrap();
            drop(port);
            // What a client has written before it went is heard.
            let heard = event(&pseudo, &mut buffer);
            assert!(matches!(heard, MasterRead::Octets { length: 4, .. }));
            assert_eq!(event(&pseudo, &mut buffer), MasterRead::Left);
        }
        drop(pseudo);
        assert!(name.symlink_metadata().is_err());
    }

    #[test]
    fn a_port_that_can_only_be_replaced_keeps_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("port");
        let pseudo = Pseudo::open(Some(&name)).ok().unwrap();
        let port = client(&pseudo);
        assert_eq!(pseudo.write(b"-", None).unwrap(), Written::Octets(1));
        let before = lock(&pseudo.state).device.clone();
        // As one that was left in exclusive use and refuses to be opened.
        lock(&pseudo.state).device = "/dev/pts/none".to_string();
        std::fs::remove_file(&name).unwrap();
        std::os::unix::fs::symlink("/dev/pts/none", &name).unwrap();
        drop(port);
        assert_eq!(event(&pseudo, &mut [0; 9]), MasterRead::Left);
        assert_ne!(lock(&pseudo.state).device, before);
        let _port = client(&pseudo);
        assert_eq!(pseudo.write(b"-", Some(2)).unwrap(), Written::Octets(1));
    }
}
