//! The table of commands, one row per command.

use super::handlers::{
    Call, Condition, attitude, credit, exposure, fault, frame_rate, gain, output, pause, positions,
    resend, reset, resume, single_shot, trigger,
};
use super::refusal::Refusal;
use super::session::Session;
use super::state::State;
use Answer::{Ack, AckAndStatus, Silent};
use Condition::{AddressProved, Cadence, HasAttitude, NoSingleShot, NotPaused};
use Sender::{Any, Camera, Truth};
use skyloop_protocols::Command;

/// The link that may send a command.
#[derive(Clone, Copy, PartialEq)]
enum Sender {
    /// The link that carries the truth.
    Truth,
    /// The same, for settings of the first camera. A further camera gets its settings over its own
    /// links.
    Camera,
    Any,
}

/// The answer to an accepted command.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Answer {
    Silent,
    Ack,
    AckAndStatus,
}

type Handler = Box<dyn FnOnce(&mut State, &Call<'_>) -> Result<(), Refusal>>;

/// A row of the table.
pub(super) struct Row {
    pub name: &'static str,
    sender: Sender,
    pub answer: Answer,
    handler: Handler,
    /// Checked in this order before the handler runs.
    conditions: &'static [Condition],
    /// Whether further cameras get a copy.
    pub is_relayed: bool,
}

impl Row {
    /// Checks sender and conditions, and runs the handler.
    pub fn run(self, state: &mut State, call: &Call<'_>) -> Result<(), Refusal> {
        let is_for_truth = match self.sender {
            Truth => true,
            Camera => !state.followers.is_follower,
            Any => false,
        };
        if is_for_truth && !state.session.channels[call.link].roles.truth {
            return Err(not_the_truth(&state.session));
        }
        for condition in self.conditions {
            condition.check(state, call.link, self.name)?;
        }
        (self.handler)(state, call)
    }

    fn when(self, conditions: &'static [Condition]) -> Row {
        Row { conditions, ..self }
    }

    fn relayed(self) -> Row {
        Row {
            is_relayed: true,
            ..self
        }
    }
}

fn row(
    name: &'static str,
    sender: Sender,
    answer: Answer,
    handler: impl FnOnce(&mut State, &Call<'_>) -> Result<(), Refusal> + 'static,
) -> Row {
    Row {
        name,
        sender,
        answer,
        handler: Box::new(handler),
        conditions: &[],
        is_relayed: sender == Truth,
    }
}

/// The row of a command, with its values bound to the handler. Commands about the vehicle (`Truth`)
/// are relayed to further cameras.
pub(super) fn row_of(command: Command) -> Row {
    const SHOT: &[Condition] = &[Cadence, HasAttitude, NotPaused, NoSingleShot];
    match command {
        Command::Attitude(a) => row("Attitude", Truth, Silent, move |s, c| attitude(s, c, &a)),
        Command::Trigger { number, start } => row("Trigger", Truth, Silent, move |s, c| {
            trigger(s, c, number, start)
        }),
        Command::Pause => row("Pause", Truth, Ack, pause),
        Command::Resume => row("Resume", Truth, Ack, resume),
        Command::Exposure { seconds } => {
            row("Exposure", Camera, Ack, move |s, c| exposure(s, c, seconds))
        }
        Command::Gain { e_per_dn } => row("Gain", Camera, Ack, move |s, _| gain(s, e_per_dn)),
        Command::FrameRate { hz } => {
            row("FrameRate", Camera, Ack, move |s, c| frame_rate(s, c, hz)).when(&[Cadence])
        }
        Command::SingleShot => row("SingleShot", Camera, Ack, single_shot).when(SHOT),
        Command::Reset => row("Reset", Any, Ack, reset).relayed(),
        Command::Ping => row("Ping", Any, AckAndStatus, |_, _| Ok(())),
        Command::Credit { packets } => {
            row("Credit", Any, Silent, move |s, c| credit(s, c, packets))
        }
        Command::Output(o) => row("Output", Any, Ack, move |s, c| output(s, c, o)),
        Command::Positions(p) => row("Positions", Any, Ack, move |s, c| positions(s, c, p)),
        Command::Resend {
            frame,
            first,
            count,
        } => row("Resend", Any, Silent, move |s, c| {
            resend(s, c, frame, first, count)
        })
        .when(&[AddressProved]),
        Command::Fault(f) => row("Fault", Any, Ack, move |s, c| fault(s, c, &f)),
    }
}

fn not_the_truth(session: &Session) -> Refusal {
    let truth = session.channels.iter().find(|channel| channel.roles.truth);
    let address = truth.map_or("another link", |channel| &channel.wire.address);
    Refusal::not_supported(format!(
        "this link takes no Attitude, Trigger, Pause or Resume, and no settings of the first camera: send them over {address}"
    ))
}
