//! The table of commands: one row a command.

use super::handlers::{self, Call, Condition};
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
    /// The link that brings the truth.
    Truth,
    /// Likewise, for settings of the first camera. A further camera takes its settings over its own links.
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
    /// Checked in this order before the handler runs.
    conditions: &'static [Condition],
    pub answer: Answer,
    handler: Handler,
    /// Whether further cameras get a copy.
    pub is_relayed: bool,
}

impl Row {
    fn new(
        name: &'static str,
        sender: Sender,
        conditions: &'static [Condition],
        answer: Answer,
        handler: impl FnOnce(&mut State, &Call<'_>) -> Result<(), Refusal> + 'static,
    ) -> Row {
        Row {
            name,
            sender,
            conditions,
            answer,
            handler: Box::new(handler),
            is_relayed: false,
        }
    }

    fn relayed(self) -> Row {
        Row {
            is_relayed: true,
            ..self
        }
    }

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
}

/// The row of a command, with its values bound to the handler.
pub(super) fn row(command: Command) -> Row {
    match command {
        Command::Attitude(attitude) => Row::new("Attitude", Truth, &[], Silent, move |s, c| {
            handlers::attitude(s, c, &attitude)
        })
        .relayed(),
        Command::Trigger { number, start } => {
            Row::new("Trigger", Truth, &[], Silent, move |s, c| {
                handlers::trigger(s, c, number, start)
            })
            .relayed()
        }
        Command::Pause => Row::new("Pause", Truth, &[], Ack, handlers::pause).relayed(),
        Command::Resume => Row::new("Resume", Truth, &[], Ack, handlers::resume).relayed(),
        Command::Exposure { seconds } => Row::new("Exposure", Camera, &[], Ack, move |s, c| {
            handlers::exposure(s, c, seconds)
        }),
        Command::Gain { e_per_dn } => Row::new("Gain", Camera, &[], Ack, move |s, _| {
            handlers::gain(s, e_per_dn)
        }),
        Command::FrameRate { hz } => Row::new("FrameRate", Camera, &[Cadence], Ack, move |s, c| {
            handlers::frame_rate(s, c, hz)
        }),
        Command::SingleShot => Row::new(
            "SingleShot",
            Camera,
            &[Cadence, HasAttitude, NotPaused, NoSingleShot],
            Ack,
            handlers::single_shot,
        ),
        Command::Reset => Row::new("Reset", Any, &[], Ack, handlers::reset).relayed(),
        Command::Ping => Row::new("Ping", Any, &[], AckAndStatus, |_, _| Ok(())),
        Command::Credit { packets } => Row::new("Credit", Any, &[], Silent, move |s, c| {
            handlers::credit(s, c, packets)
        }),
        Command::Output(output) => Row::new("Output", Any, &[], Ack, move |s, c| {
            handlers::output(s, c, output)
        }),
        Command::Positions(positions) => Row::new("Positions", Any, &[], Ack, move |s, c| {
            handlers::positions(s, c, positions)
        }),
        Command::Resend {
            frame,
            first,
            count,
        } => Row::new("Resend", Any, &[AddressProved], Silent, move |s, c| {
            handlers::resend(s, c, frame, first, count)
        }),
        Command::Fault(fault) => Row::new("Fault", Any, &[], Ack, move |s, c| {
            handlers::fault(s, c, &fault)
        }),
    }
}

fn not_the_truth(session: &Session) -> Refusal {
    let truth = session.channels.iter().find(|channel| channel.roles.truth);
    let address = truth.map_or("another link", |channel| &channel.wire.address);
    Refusal::not_supported(format!(
        "this link takes no Attitude, Trigger, Pause or Resume, and no settings of the first camera: send them over {address}"
    ))
}
