//! skyloop: a hardware-in-the-loop star-tracker emulator. Input: attitude. Output: labelled frames.
//!
//! # A frame
//!
//! ```
//! use skyloop::{Config, Emulator, VehicleState, parse_utc};
//!
//! let mut config = Config::defaults()?; // camera fai-nir, no objects in orbit
//! let mut emulator = Emulator::new(&mut config);
//! let epoch = parse_utc("2026-06-01T12:00:00Z")?;
//! let q = [-0.070834, -0.644137, 0.733522, -0.204975]; // x, y, z, w: ICRF to body
//! let state = VehicleState::new(1, epoch, q, [0.0; 3], None)?;
//! let exposed = emulator.expose(&state, 0)?;
//! println!("{} stars in {} pixels", exposed.label.objects.len(), exposed.frame.dn.len());
//! # assert!(!exposed.label.objects.is_empty());
//! # assert_eq!(exposed.frame.dn.len(), 256 * 256);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # A client on a link
//!
//! A server and a flight computer on the two ends of a memory link. Other links work
//! likewise: `udp://127.0.0.1:4810`, a serial port or a CAN bus.
//!
//! ```
//! use skyloop::{Config, Emulator, Server, client, flight, link};
//! use skyloop::protocols::{Output, personality::NATIVE};
//! use std::ops::ControlFlow::Continue;
//! use std::sync::atomic::{AtomicBool, Ordering};
//!
//! let mut config = Config::builtin()?;
//! let mut mission = flight::mission(&config)?; // the attitudes of the scene's [sequence]
//! mission.frames = 3;
//! let (wire, port) = link::loopback("memory", &link::Options::default())?;
//! let links = [(wire, link::Roles::ALL)];
//! let clock = skyloop::config::Clock::Stepped;
//! let mut server =
//!     Server::new(Emulator::new(&mut config), links, Output::default(), clock, &NATIVE);
//! let stop = AtomicBool::new(false);
//! let report = std::thread::scope(|scope| {
//!     scope.spawn(|| server.run(&stop, None, |_| {}));
//!     let client = client::flight_computer::FlightComputer::new(port, mission);
//!     let report = client.run(|_| Continue(()));
//!     stop.store(true, Ordering::Relaxed);
//!     report
//! })?;
//! println!("{report}");
//! # assert_eq!(report.frames, 3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Structure
//!
//! Data flows in one direction; each value is made in one place and then only read:
//!
//! ```text
//! bytes -> Command -> VehicleState -> View -> Scene -> Plan -> Frame + Label -> Reply -> bytes
//! ```
//!
//! | crate | contents |
//! |---|---|
//! | [`orbit`] | orbital elements, their files, SGP4/SDP4 for whole catalogues, tracks |
//! | `skyloop-base` | [`load`]: configuration files; [`rng`]: keyed random numbers |
//! | `skyloop-render` | [`attitude`], [`camera`], [`sky`], [`scene`], [`effect`], [`plan`], [`label`], [`engine`] |
//! | [`link`] | UDP, serial lines, CAN; faults; capture |
//! | [`config`] | scene and run files; [`flight`]: their missions |
//! | `skyloop-live` | [`serve`]: commands in, frames out by their deadlines; [`timing`], [`metrics`], [`soak`] |
//! | [`measure`] | times and errors of settings |
//! | `skyloop` | [`output`]: files; [`passes`]: passes through the field |
//! | [`protocols`] | the wire format, `no_std` |
//! | [`client`] | a mock flight computer: the other end of the link |

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod output;
pub mod passes;

pub use skyloop_base::{abort, load, range, rng};
pub use skyloop_config::{self as config, Config, flight};
pub use skyloop_firmware_sim as client;
pub use skyloop_link as link;
pub use skyloop_live::serve::Server;
pub use skyloop_live::{host, metrics, realtime, serve, soak, stats, timing};
pub use skyloop_measure as measure;
pub use skyloop_orbit::time::parse_utc;
pub use skyloop_orbit::{self as orbit};
pub use skyloop_protocols as protocols;
pub use skyloop_render::attitude::{Attitude, VehicleState};
pub use skyloop_render::camera::Camera;
pub use skyloop_render::engine::{Emulator, ExposedFrame};
pub use skyloop_render::frame::Frame;
pub use skyloop_render::label::Label;
pub use skyloop_render::{
    attitude, camera, effect, engine, fidelity, footprint, frame, kernels, label, light_curve,
    plan, render, render_pool, scene, sensitivity, sky, track,
};
