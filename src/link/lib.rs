//! MAVLink: addresses, transports, frames, and the links to the vehicle and to clients.
//!
//! Only [`transport`] has sockets and a clock. It runs on tokio and passes the received bytes on through channels. All other
//! modules take bytes and time as arguments and return bytes. [`vehicle`] connects to the flight controller, [`client`] to
//! ground stations and offboard programs. Only `wire` uses MAVLink message types.
//!
//! Example of a control thread (`pilot` is any [`autopilot::Autopilot`]):
//!
//! ```no_run
//! use std::time::Instant;
//!
//! use crossbeam_channel::{bounded, select};
//! use greylag_link::autopilot::Autopilot;
//! use greylag_link::client::{Clients, Now};
//! use greylag_link::framing::Source;
//! use greylag_link::peer::LinkId;
//! use greylag_link::transport::{Arrival, Network};
//! use greylag_link::vehicle::{Demand, Outputs, Sitl, Vehicle};
//! use greylag_physics::Time;
//! use greylag_physics::servos::Travels;
//!
//! fn serve(pilot: &mut dyn Autopilot) -> Result<(), Box<dyn std::error::Error>> {
//!     let network = Network::start()?;
//!     // The vehicle has its own channel and can therefore be served first.
//!     let (to_vehicle, from_vehicle) = bounded(256);
//!     let (to_clients, from_clients) = bounded(1024);
//!     let vehicle_link =
//!         network.open(LinkId(0), &"udpin:127.0.0.1:14600".parse()?, "--vehicle", to_vehicle)?;
//!     let client_link =
//!         network.open(LinkId(1), &"udpin:0.0.0.0:14550".parse()?, "--client", to_clients)?;
//!     let mut vehicle = Vehicle::Sitl(Sitl::new(1, Travels::alike(0.5235)));
//!     let mut clients = Clients::new(Source { system: 1, component: 1 });
//!     let start = Instant::now();
//!     let mut now = Now { host: start.elapsed(), vehicle: Time::default() };
//!     if let Some(peer) = client_link.target() {
//!         clients.welcome(now, peer);
//!     }
//!     loop {
//!         select! {
//!             recv(from_vehicle) -> arrival => if let Arrival::Packet(packet) = arrival? {
//!                 let mut newest = None;
//!                 vehicle.handle(start.elapsed(), packet.peer, &packet.bytes, |t| newest = Some(t));
//!                 if let Some(state) = newest {
//!                     now.vehicle = state.time; // Here the pilot decides on the demand.
//!                     let demand =
//!                         Demand { outputs: Outputs::Disarmed, attitude: [0.0; 2], fault: None };
//!                     let frame = vehicle.answer(start.elapsed(), state.time, &demand);
//!                     vehicle_link.send(packet.peer, frame);
//!                 }
//!             },
//!             default(std::time::Duration::from_millis(10)) => {}
//!         }
//!         now.host = start.elapsed();
//!         for arrival in from_clients.try_iter().take(64) {
//!             match arrival {
//!                 Arrival::Packet(packet) => clients.handle(now, packet.peer, &packet.bytes, pilot),
//!                 Arrival::Opened(peer) => clients.welcome(now, peer),
//!                 Arrival::Closed(peer) => clients.forget(peer),
//!                 Arrival::Remark(remark) => eprintln!("{remark}"),
//!             }
//!         }
//!         clients.poll(now, pilot);
//!         clients.drain().for_each(|(peer, frame)| client_link.send(peer, frame));
//!     }
//! }
//! ```

pub mod address;
pub mod autopilot;
pub mod client;
pub mod framing;
pub mod offboard;
pub mod peer;
pub mod routing;
pub mod signing;
pub mod transport;
pub mod vehicle;
mod wire;

pub use wire::logged;
