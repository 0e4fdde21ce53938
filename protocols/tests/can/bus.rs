//! Two nodes and a channel between them that may lose, repeat and swap frames.

use crate::common::Random;
use skyloop_protocols::can::{Busy, CanFrame, Counts, Lane, Node, Parameters, Side};
use skyloop_protocols::{Ack, Attitude, Command, MAX_PACKET, OrbitState, Reply, WireTime, apid};
use std::collections::VecDeque;

/// Faults of a channel, each in one of so many frames; 0: never.
#[derive(Clone, Copy, Default, Debug)]
pub struct Damage {
    pub drop: usize,
    pub repeat: usize,
    pub swap: usize,
}

/// Two nodes with the packets to send and the received packets: `[Emulator, Client]`.
pub struct Bus {
    pub nodes: [Node; 2],
    pub queues: [[VecDeque<Vec<u8>>; 2]; 2],
    pub received: [Vec<Vec<u8>>; 2],
    pub now_us: u64,
    pub frames: u64,
    pub random: Random,
    damage: Damage,
    held: [Option<CanFrame>; 2],
}

impl Bus {
    pub fn new(parameters: Parameters, damage: Damage, seed: u64) -> Self {
        Self {
            nodes: [Side::Emulator, Side::Client].map(|side| Node::with(side, parameters)),
            queues: Default::default(),
            received: Default::default(),
            now_us: 0,
            frames: 0,
            random: Random(seed),
            damage,
            held: [None; 2],
        }
    }

    pub fn perfect(fd: bool) -> Self {
        Self::new(parameters(fd), Damage::default(), 1)
    }

    /// Queues a packet at an end, in the queue of its lane.
    pub fn push(&mut self, from: usize, packet: Vec<u8>) {
        let lane = self.nodes[from].lane(&packet);
        self.queues[from][lane as usize].push_back(packet);
    }

    pub fn counts(&self, end: usize) -> Counts {
        self.nodes[end].counts()
    }

    /// Passes packets to the nodes until their lanes are busy.
    pub fn feed(&mut self) {
        for (node, queues) in self.nodes.iter_mut().zip(&mut self.queues) {
            for queue in queues {
                while let Some(packet) = queue.front() {
                    match node.send(packet, self.now_us) {
                        Ok(()) => drop(queue.pop_front()),
                        Err(Busy(Lane::Plain | Lane::Long)) => break,
                    }
                }
            }
        }
    }

    fn deliver(&mut self, to: usize, frame: &CanFrame) {
        if let Some(packet) = self.nodes[to].receive(frame, self.now_us) {
            self.received[to].push(packet.to_vec());
        }
    }

    fn transmit(&mut self, from: usize, frame: CanFrame) {
        let to = 1 - from;
        let Damage { drop, repeat, swap } = self.damage;
        if self.random.one_in(drop) {
            return;
        }
        if self.held[to].is_none() && self.random.one_in(swap) {
            self.held[to] = Some(frame);
            return;
        }
        self.deliver(to, &frame);
        if self.random.one_in(repeat) {
            self.deliver(to, &frame);
        }
        if let Some(late) = self.held[to].take() {
            self.deliver(to, &late);
        }
    }

    /// Transmits a frame from each end, if one is due; 100 µs each. False: none was due.
    pub fn step(&mut self) -> bool {
        let before = self.frames;
        for from in 0..2 {
            if let Some(frame) = self.nodes[from].next_frame(self.now_us) {
                assert!(frame.is_valid());
                self.frames += 1;
                self.now_us += 100;
                self.transmit(from, frame);
            }
        }
        self.frames > before
    }

    /// Runs until both ends are idle.
    pub fn run(&mut self) {
        loop {
            self.feed();
            if !self.step() {
                let wake = self.nodes.iter().filter_map(Node::wake_at).min();
                let Some(wake) = wake else { break };
                let now = self.now_us;
                assert!(wake > now, "due at {wake} but silent at {now}");
                self.now_us = wake;
            }
        }
        for (node, queues) in self.nodes.iter().zip(&self.queues) {
            assert!(queues.iter().all(VecDeque::is_empty));
            assert!(node.is_idle(Lane::Plain) && node.is_idle(Lane::Long));
        }
    }
}

pub fn parameters(fd: bool) -> Parameters {
    if fd {
        Parameters::FD
    } else {
        Parameters::CLASSIC
    }
}

/// An attitude as a packet.
pub fn attitude(sequence: u32, state: bool) -> Vec<u8> {
    let x = f64::from(sequence) * 1e-3;
    let command = Command::Attitude(Attitude {
        sequence,
        q_icrf_to_body: [-0.070834, -0.644137, 0.733522, -0.204975],
        rates_rad_s: [x.sin(), -x.cos(), 0.0],
        state: state.then_some(OrbitState {
            position_m: [-4_340_768.444 + x, 848_975.278, -5_362_534.303],
            velocity_m_s: [5_544.406_469, -3_022.740_43, -4_386.550_226 - x],
        }),
    });
    let time = 0x7397_DF7B_1234_5677 + u64::from(sequence);
    command_packet(&command, sequence as u16, time)
}

pub fn command_packet(command: &Command, count: u16, time: u64) -> Vec<u8> {
    let mut buffer = [0; MAX_PACKET];
    let length = command.encode(count, WireTime(time), &mut buffer);
    buffer[..length.expect("encodes")].to_vec()
}

/// An answer to the `Command` of this sequence count.
pub fn ack_packet(sequence_count: u16, count: u16, time: u64) -> Vec<u8> {
    let apid = apid::COMMAND;
    let mut buffer = [0; MAX_PACKET];
    let length = Reply::Ack(Ack {
        apid,
        sequence_count,
    })
    .encode(count, WireTime(time), &mut buffer);
    buffer[..length.expect("encodes")].to_vec()
}

/// Random bytes that are no packet, seeded by their length and a number.
pub fn bytes(length: usize, mark: u64) -> Vec<u8> {
    let mut random = Random(mark ^ (length as u64) << 32);
    (0..length).map(|_| random.next() as u8).collect()
}
