//! The thread that makes frames, so that packets come and go meanwhile.

use skyloop_base::abort::Abort;
use skyloop_link::lock;
use skyloop_render::attitude::VehicleState;
use skyloop_render::camera::Camera;
use skyloop_render::engine::{Emulator, Opening, Shot, Witness};
use skyloop_render::fidelity::Fidelity;
use skyloop_render::scene::Unobservable;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex};
use std::thread::Thread;
use std::time::{Duration, Instant};

/// What the thread is to do.
pub(super) enum Task {
    /// A frame is made.
    Make(Box<Order>),
    /// A shot's memory is for the next.
    Recycle(Box<Shot>),
}

/// A frame to make.
pub(super) struct Order {
    pub number: u32,
    pub camera: Arc<Camera>,
    pub vehicle: VehicleState,
    /// How many frames were made of the same attitude before.
    pub repeat: u32,
    /// Other tolerances from now on.
    pub fidelity: Option<Fidelity>,
    /// What its label says was done because it would have been late.
    pub overrun: Option<&'static str>,
    /// Whether rows are wanted before all are there.
    pub streams: bool,
    /// Cancels it.
    pub abort: Abort,
    /// Ever coarser tolerances to make it by, where it costs more than it may.
    pub coarser: Vec<Fidelity>,
}

/// How far a frame is.
pub(super) enum Progress {
    /// Its label is done.
    Labelled(Opening),
    /// Digits from a first pixel on, and when they were done.
    Developed(usize, Vec<u16>, Instant),
    /// All of it, when, and how long after it was asked for: other cameras may have had their turn first.
    Made(Box<Shot>, Instant, Duration),
    /// By the tolerances so far it costs more than it may: it is made by the next coarser ones.
    Coarsened,
    /// It was cancelled.
    Abandoned,
    /// It cannot be made.
    Failed(String),
}

/// The server's end. Frames are made one after another, and a frame has a bounded number of parts: so the queues are bounded, too.
pub(super) struct Shooter {
    tasks: Sender<Task>,
    progress: Receiver<Progress>,
    spare: Spare,
}

/// Memory of rows that have been seen, for others.
#[derive(Clone, Default)]
pub(super) struct Spare(Arc<Mutex<Vec<Vec<u16>>>>);

impl Spare {
    /// Rows that are kept at most.
    const MOST: usize = 64;

    fn take(&self) -> Vec<u16> {
        lock(&self.0).pop().unwrap_or_default()
    }

    /// Asks for that of all rows of a frame, so that no server that falls behind has to: bands of so many pixels.
    pub fn fill(&self, bands: usize, pixels: usize) {
        for _ in 0..bands.min(Self::MOST) {
            // Touched, so that it is there.
            self.give(vec![1; pixels]);
        }
    }

    /// Takes memory back.
    pub fn give(&self, mut rows: Vec<u16>) {
        rows.clear();
        let mut spare = lock(&self.0);
        if spare.len() < Self::MOST {
            spare.push(rows);
        }
    }
}

/// The thread's end.
pub(super) struct Darkroom {
    tasks: Receiver<Task>,
    seen: Seen,
}

/// Tells the server, and wakes it.
struct Seen {
    progress: Sender<Progress>,
    server: Thread,
    streams: bool,
    spare: Spare,
}

/// Both ends; `server` is the thread that asks for frames.
pub(super) fn shooter(server: Thread) -> (Shooter, Darkroom) {
    let (to_make, tasks) = channel();
    let (told, progress) = channel();
    let spare = Spare::default();
    let seen = Seen {
        progress: told,
        server,
        streams: false,
        spare: spare.clone(),
    };
    let shooter = Shooter {
        tasks: to_make,
        progress,
        spare,
    };
    (shooter, Darkroom { tasks, seen })
}

impl Shooter {
    /// Gives the thread a task; false if it has ended.
    pub fn give(&self, task: Task) -> bool {
        self.tasks.send(task).is_ok()
    }

    /// Where memory of rows goes that have been seen.
    pub fn spare(&self) -> &Spare {
        &self.spare
    }

    /// What is new, without waiting; an error if the thread has ended.
    pub fn news(&self) -> Result<Option<Progress>, ()> {
        match self.progress.try_recv() {
            Ok(progress) => Ok(Some(progress)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(()),
        }
    }

    /// What is new, waiting for it; an error if the thread has ended.
    pub fn await_news(&self) -> Result<Progress, ()> {
        self.progress.recv().map_err(|_| ())
    }
}

impl Darkroom {
    /// Makes frames until the server drops its end; one camera after another, each by all threads, where several share `turn`.
    pub fn work(mut self, emulator: &mut Emulator, turn: &Mutex<()>) {
        for task in &self.tasks {
            match task {
                Task::Recycle(shot) => emulator.take_back(*shot),
                Task::Make(order) => {
                    if let Some(fidelity) = order.fidelity {
                        emulator.set_fidelity(fidelity);
                    }
                    emulator.overrun = order.overrun;
                    emulator.abort = order.abort.clone();
                    emulator.number_next(order.number);
                    self.seen.streams = order.streams;
                    let Order {
                        camera,
                        vehicle,
                        repeat,
                        ..
                    } = &*order;
                    let ordered = Instant::now();
                    let turn = lock(turn);
                    let mut coarser = order.coarser.iter();
                    let shot = loop {
                        let shot = emulator.shoot_before(&self.seen, camera, vehicle, *repeat);
                        let Err(Unobservable::TooMuchWork { .. }) = shot else {
                            break shot;
                        };
                        let Some(fidelity) = coarser.next() else {
                            break shot;
                        };
                        emulator.set_fidelity(*fidelity);
                        emulator.overrun = Some("coarsen");
                        self.seen.tell(Progress::Coarsened);
                    };
                    drop(turn);
                    self.seen.tell(match shot {
                        Ok(shot) => {
                            Progress::Made(Box::new(shot), Instant::now(), ordered.elapsed())
                        }
                        Err(Unobservable::Abandoned) => Progress::Abandoned,
                        Err(error) => Progress::Failed(error.to_string()),
                    });
                }
            }
        }
    }
}

impl Seen {
    fn tell(&self, progress: Progress) {
        // A server that has gone wants to know nothing.
        let _ = self.progress.send(progress);
        self.server.unpark();
    }
}

impl Witness for Seen {
    fn labelled(&self, opening: Opening) {
        if self.streams {
            self.tell(Progress::Labelled(opening));
        }
    }

    fn developed(&self, first: usize, digits: &[u16]) {
        if self.streams {
            let mut rows = self.spare.take();
            rows.extend_from_slice(digits);
            self.tell(Progress::Developed(first, rows, Instant::now()));
        }
    }
}
