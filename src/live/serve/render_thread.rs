//! The thread that renders frames, so that packets are exchanged meanwhile.

use skyloop_base::abort::Abort;
use skyloop_link::lock;
use skyloop_render::attitude::VehicleState;
use skyloop_render::camera::Camera;
use skyloop_render::engine::{Emulator, ExposedFrame, FrameInfo, FrameObserver};
use skyloop_render::fidelity::Fidelity;
use skyloop_render::scene::Unobservable;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex};
use std::thread::Thread;
use std::time::{Duration, Instant};

pub(super) enum Task {
    Render(Box<RenderOrder>),
    /// Reuse the memory of a frame.
    Recycle(Box<ExposedFrame>),
}

pub(super) struct RenderOrder {
    pub number: u32,
    pub camera: Arc<Camera>,
    pub vehicle: VehicleState,
    /// Number of earlier frames of the same attitude.
    pub repeat: u32,
    /// New tolerances from this frame on.
    pub fidelity: Option<Fidelity>,
    /// Lateness in its label.
    pub overrun: Option<&'static str>,
    /// Whether rows are reported before the frame is complete.
    pub streams: bool,
    /// Cancels the frame.
    pub abort: Abort,
    /// Coarser and coarser tolerances, for a frame beyond the work limit.
    pub coarser: Vec<Fidelity>,
}

/// Events of the thread.
pub(super) enum RenderEvent {
    /// The label is complete.
    Labelled(FrameInfo),
    /// Pixel values from a first pixel on, and when they were ready.
    Rows(usize, Vec<u16>, Instant),
    /// The complete frame, when it was ready, and the time since its order, which includes the
    /// turns of other cameras.
    Complete(Box<ExposedFrame>, Instant, Duration),
    /// The frame exceeds the work limit: the next coarser tolerances are used.
    Coarsened,
    Abandoned,
    Failed(String),
}

/// The server's end. Frames are rendered one after another and have a bounded number of parts, so
/// the queues are bounded, too.
pub(super) struct Renderer {
    tasks: Sender<Task>,
    events: Receiver<RenderEvent>,
    buffers: RowBuffers,
}

/// Buffers of rows, for reuse.
#[derive(Clone, Default)]
pub(super) struct RowBuffers(Arc<Mutex<Vec<Vec<u16>>>>);

impl RowBuffers {
    const MAX: usize = 64;

    fn take(&self) -> Vec<u16> {
        lock(&self.0).pop().unwrap_or_default()
    }

    /// Allocates `bands` buffers of `pixels` beforehand, so that none is allocated while frames are
    /// late.
    pub fn fill(&self, bands: usize, pixels: usize) {
        for _ in 0..bands.min(Self::MAX) {
            // Written, so that the system maps the memory.
            self.put(vec![1; pixels]);
        }
    }

    /// Returns a buffer.
    pub fn put(&self, mut rows: Vec<u16>) {
        rows.clear();
        let mut buffers = lock(&self.0);
        if buffers.len() < Self::MAX {
            buffers.push(rows);
        }
    }
}

/// The thread's end.
pub(super) struct RenderThread {
    tasks: Receiver<Task>,
    reporter: Reporter,
}

/// Sends events to the server, and wakes it.
struct Reporter {
    events: Sender<RenderEvent>,
    server: Thread,
    streams: bool,
    buffers: RowBuffers,
}

/// Both ends; `server` is the thread that orders frames.
pub(super) fn renderer(server: Thread) -> (Renderer, RenderThread) {
    let (to_thread, tasks) = channel();
    let (to_server, events) = channel();
    let buffers = RowBuffers::default();
    let reporter = Reporter {
        events: to_server,
        server,
        streams: false,
        buffers: buffers.clone(),
    };
    let renderer = Renderer {
        tasks: to_thread,
        events,
        buffers,
    };
    (renderer, RenderThread { tasks, reporter })
}

impl Renderer {
    /// Orders a task; false if the thread has ended.
    pub fn order(&self, task: Task) -> bool {
        self.tasks.send(task).is_ok()
    }

    pub fn buffers(&self) -> &RowBuffers {
        &self.buffers
    }

    /// The next event, without waiting; an error if the thread has ended.
    pub fn poll(&self) -> Result<Option<RenderEvent>, ()> {
        match self.events.try_recv() {
            Ok(event) => Ok(Some(event)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(()),
        }
    }

    /// Waits for the next event; an error if the thread has ended.
    pub fn wait(&self) -> Result<RenderEvent, ()> {
        self.events.recv().map_err(|_| ())
    }
}

impl RenderThread {
    /// Renders frames until the server closes its end. Cameras that share `turn` render one after
    /// another, each with all threads.
    pub fn run(mut self, emulator: &mut Emulator, turn: &Mutex<()>) {
        for task in self.tasks {
            match task {
                Task::Recycle(exposed) => emulator.take_back(*exposed),
                Task::Render(order) => {
                    self.reporter.streams = order.streams;
                    self.reporter
                        .send(render(&order, emulator, turn, &self.reporter));
                }
            }
        }
    }
}

/// Renders a frame, with coarser tolerances if it exceeds the work limit.
fn render(
    order: &RenderOrder,
    emulator: &mut Emulator,
    turn: &Mutex<()>,
    reporter: &Reporter,
) -> RenderEvent {
    if let Some(fidelity) = order.fidelity {
        emulator.set_fidelity(fidelity);
    }
    emulator.overrun = order.overrun;
    emulator.abort = order.abort.clone();
    emulator.number_next(order.number);
    let ordered = Instant::now();
    let turn = lock(turn);
    let mut coarser = order.coarser.iter();
    let exposed = loop {
        let exposed =
            emulator.expose_observed(reporter, &order.camera, &order.vehicle, order.repeat);
        let exceeds = matches!(exposed, Err(Unobservable::TooMuchWork { .. }));
        let Some(fidelity) = coarser.next().filter(|_| exceeds) else {
            break exposed;
        };
        emulator.set_fidelity(*fidelity);
        emulator.overrun = Some("coarsen");
        reporter.send(RenderEvent::Coarsened);
    };
    drop(turn);
    match exposed {
        Ok(exposed) => RenderEvent::Complete(Box::new(exposed), Instant::now(), ordered.elapsed()),
        Err(Unobservable::Abandoned) => RenderEvent::Abandoned,
        Err(error) => RenderEvent::Failed(error.to_string()),
    }
}

impl Reporter {
    fn send(&self, event: RenderEvent) {
        // The server may have ended.
        let _ = self.events.send(event);
        self.server.unpark();
    }
}

impl FrameObserver for Reporter {
    fn labelled(&self, opening: FrameInfo) {
        if self.streams {
            self.send(RenderEvent::Labelled(opening));
        }
    }

    fn rows_done(&self, first: usize, dn: &[u16]) {
        if self.streams {
            let mut rows = self.buffers.take();
            rows.extend_from_slice(dn);
            self.send(RenderEvent::Rows(first, rows, Instant::now()));
        }
    }
}
