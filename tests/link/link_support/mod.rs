//! What the link's tests share: an autopilot double, and a client that writes and reads frames
//! with rust-mavlink's own code.
#![allow(dead_code)] // each test that includes this module uses its part

pub mod hostile;

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::time::Duration;

use greylag::link::autopilot::*;
use greylag::link::client::{Clients, Now};
use greylag::link::framing::Source;
use greylag::link::peer::{LinkId, PeerId};
use greylag::physics::{ActuatorState, Command, Time};
use mavlink::dialects::ardupilotmega::*;
use mavlink::{MAVLinkV1MessageRaw, MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, Message};

/// Who the companion is.
pub const US: Source = Source { system: 1, component: 1 };

/// An autopilot that obeys and remembers.
pub struct Double {
    pub status: Status,
    pub parameters: Vec<Parameter>,
    pub setpoints: Vec<AttitudeSetpoint>,
    pub sticks: Vec<Sticks>,
    pub arms: Vec<bool>,
    pub modes: Vec<Mode>,
    pub texts: VecDeque<Text>,
}

impl Double {
    pub fn new() -> Self {
        let parameter = |name, value| Parameter { name, value };
        Double {
            status: Status {
                mode: Mode::Hold,
                armed: false,
                failsafe: false,
                vehicle_alive: true,
                attitude: [0.1, -0.05, 1.0],
                rates: [0.01, 0.02, 0.03],
                airspeed: 16.67,
                altitude: 300.0,
                position: [45.0, 7.5],
                velocity: [10.0, 12.0, -0.5],
                target: [0.2, 0.0],
                command: Command { aileron: 0.25, elevator: -0.5, throttle: 0.6, rudder: 0.0 },
                actuators: ActuatorState::default(),
                load: 0.2,
                residuals: [f64::NAN; 6],
                derivatives: [f64::NAN; 4],
            },
            parameters: vec![
                parameter("GL_BANK_MAX", ParameterValue::Real(60.0)),
                parameter("GL_SEED", ParameterValue::Int(7)),
                // Sixteen letters leave no room for a closing zero.
                parameter("GL_SIXTEEN_CHARS", ParameterValue::Real(0.5)),
            ],
            setpoints: vec![],
            sticks: vec![],
            arms: vec![],
            modes: vec![],
            texts: VecDeque::new(),
        }
    }
}

impl Autopilot for Double {
    fn arm(&mut self, _: Time, force: bool) -> Verdict {
        self.arms.push(force);
        self.status.armed = true;
        Verdict::Accepted
    }
    fn disarm(&mut self, _: Time, _: bool) -> Verdict {
        self.status.armed = false;
        Verdict::Accepted
    }
    fn set_mode(&mut self, _: Time, mode: Mode) -> Verdict {
        if mode == Mode::Return {
            return Verdict::Denied("Return is not flown".into());
        }
        if mode == Mode::Offboard && !self.status.armed {
            return Verdict::Rejected("Offboard needs arming".into());
        }
        self.modes.push(mode);
        self.status.mode = mode;
        Verdict::Accepted
    }
    fn attitude_setpoint(&mut self, _: Time, setpoint: AttitudeSetpoint) {
        self.setpoints.push(setpoint);
    }
    fn sticks(&mut self, _: Time, sticks: Sticks) {
        self.sticks.push(sticks);
    }
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }
    fn set_parameter(&mut self, index: usize, value: ParameterValue) -> Verdict {
        if let ParameterValue::Real(x) = value
            && !(0.0..=90.0).contains(&x)
        {
            return Verdict::Denied("it must lie between 0 and 90".into());
        }
        self.parameters[index].value = value;
        Verdict::Accepted
    }
    fn status(&self) -> Status {
        self.status
    }
    fn take_text(&mut self) -> Option<Text> {
        self.texts.pop_front()
    }
}

/// A moment `ms` after the start, both clocks alike.
pub fn at_ms(ms: u64) -> Now {
    Now { host: Duration::from_millis(ms), vehicle: Time::from_micros(ms * 1000) }
}

/// The peer at local port `port`.
pub fn peer(port: u16) -> PeerId {
    PeerId { link: LinkId(0), address: SocketAddr::from(([127, 0, 0, 1], port)) }
}

/// A frame from system 255, component 190 (a ground station), written by rust-mavlink.
pub fn frame(version: MavlinkVersion, message: &MavMessage) -> Vec<u8> {
    frame_from(version, 255, 190, message)
}

/// A frame from any sender.
pub fn frame_from(
    version: MavlinkVersion,
    system: u8,
    component: u8,
    message: &MavMessage,
) -> Vec<u8> {
    let header = MavHeader { system_id: system.into(), component_id: component, sequence: 42 };
    match version {
        MavlinkVersion::V1 => {
            let mut raw = MAVLinkV1MessageRaw::new();
            raw.serialize_message(header, message);
            raw.raw_bytes().to_vec()
        }
        MavlinkVersion::V2 => {
            let mut raw = MAVLinkV2MessageRaw::new();
            raw.serialize_message(header, message);
            raw.raw_bytes().to_vec()
        }
    }
}

/// A MAVLink 2 frame with any payload, for what rust-mavlink's types cannot say.
pub fn raw_frame(id: u32, payload: &[u8]) -> Vec<u8> {
    let extra = MavMessage::extra_crc(id);
    let [a, b, c, _] = id.to_le_bytes();
    let mut bytes = vec![0xFD, payload.len() as u8, 0, 0, 1, 255, 190, a, b, c];
    bytes.extend_from_slice(payload);
    let crc = mavlink::calculate_crc(&bytes[1..], extra);
    bytes.extend(crc.to_le_bytes());
    bytes
}

/// The payload of COMMAND_LONG with any command number.
pub fn command_payload(
    number: u16,
    params: [f32; 7],
    system: u8,
    component: u8,
    confirmation: u8,
) -> Vec<u8> {
    let mut payload: Vec<u8> = params.iter().flat_map(|p| p.to_le_bytes()).collect();
    payload.extend(number.to_le_bytes());
    payload.extend([system, component, confirmation]);
    payload
}

/// COMMAND_LONG to the companion with NaN in the parameters that are not given.
pub fn command(number: u16, params: &[f32]) -> Vec<u8> {
    let mut all = [f32::NAN; 7];
    all[..params.len()].copy_from_slice(params);
    raw_frame(76, &command_payload(number, all, 1, 1, 0))
}

/// A frame taken apart.
#[derive(Clone, Debug)]
pub struct Seen {
    pub peer: PeerId,
    pub version: MavlinkVersion,
    pub sequence: u8,
    pub id: u32,
    pub payload: Vec<u8>,
    pub bytes: Vec<u8>,
}

impl Seen {
    /// The message as rust-mavlink reads it.
    pub fn message(&self) -> MavMessage {
        MavMessage::parse(self.version, self.id, &self.payload).unwrap()
    }
}

/// Takes apart one frame from the companion, checking its header and CRC by hand.
pub fn dissect(peer: PeerId, bytes: &[u8]) -> Seen {
    let v1 = bytes[0] == 0xFE;
    let header = if v1 { 6 } else { 10 };
    let len = bytes[1] as usize;
    assert_eq!(bytes.len(), header + len + 2);
    let (sequence, system, component, id) = match v1 {
        true => (bytes[2], bytes[3], bytes[4], u32::from(bytes[5])),
        false => {
            (bytes[4], bytes[5], bytes[6], u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]))
        }
    };
    assert_eq!((system, component), (US.system, US.component));
    let crc = mavlink::calculate_crc(&bytes[1..header + len], MavMessage::extra_crc(id));
    assert_eq!(crc.to_le_bytes(), bytes[header + len..]);
    Seen {
        peer,
        version: if v1 { MavlinkVersion::V1 } else { MavlinkVersion::V2 },
        sequence,
        id,
        payload: bytes[header..header + len].to_vec(),
        bytes: bytes.to_vec(),
    }
}

/// Everything in the outbox.
pub fn sent(clients: &mut Clients) -> Vec<Seen> {
    clients.drain().map(|(peer, bytes)| dissect(peer, &bytes)).collect()
}

/// Handles one datagram and gives what is sent in answer.
pub fn ask(
    clients: &mut Clients,
    double: &mut Double,
    now: Now,
    port: u16,
    bytes: &[u8],
) -> Vec<Seen> {
    clients.handle(now, peer(port), bytes, double);
    sent(clients)
}

/// The command number and result of every COMMAND_ACK.
pub fn acks(seen: &[Seen]) -> Vec<(u16, u8)> {
    seen.iter()
        .filter(|s| s.id == 77)
        .map(|s| {
            let byte = |i: usize| s.payload.get(i).copied().unwrap_or(0);
            (u16::from_le_bytes([byte(0), byte(1)]), byte(2))
        })
        .collect()
}

/// The words of every STATUSTEXT, as sent.
pub fn texts(seen: &[Seen]) -> Vec<String> {
    seen.iter()
        .filter_map(|s| match s.id {
            253 => match s.message() {
                MavMessage::STATUSTEXT(m) => Some(m.text.to_str().unwrap().to_owned()),
                _ => None,
            },
            _ => None,
        })
        .collect()
}

/// A frame from the shim.
pub fn shim(message: MavMessage) -> Vec<u8> {
    frame_from(MavlinkVersion::V2, 1, 200, &message)
}

/// A state that no two fields share a value in.
pub struct Shown {
    pub imu: HIGHRES_IMU_DATA,
    pub air: VFR_HUD_DATA,
    pub incidence: AOA_SSA_DATA,
    pub actuators: ACTUATOR_OUTPUT_STATUS_DATA,
    pub attitude: ATTITUDE_QUATERNION_DATA,
}

impl Shown {
    pub fn at(time_us: u64) -> Self {
        let mut actuator = [0.0; 32];
        actuator[..5].copy_from_slice(&[0.5, -0.25, 0.6, 2.0, -4.0]);
        // Half of 20° of roll about x.
        let (sin, cos) = 10f32.to_radians().sin_cos();
        Shown {
            imu: HIGHRES_IMU_DATA {
                time_usec: time_us,
                xacc: 0.1,
                yacc: 0.2,
                zacc: -9.7,
                ..Default::default()
            },
            air: VFR_HUD_DATA { airspeed: 16.5, alt: 301.0, ..Default::default() },
            incidence: AOA_SSA_DATA { time_usec: time_us, AOA: 3.0, SSA: -1.5 },
            actuators: ACTUATOR_OUTPUT_STATUS_DATA { time_usec: time_us, active: 5, actuator },
            attitude: ATTITUDE_QUATERNION_DATA {
                time_boot_ms: (time_us / 1000) as u32,
                q1: cos,
                q2: sin,
                rollspeed: 0.01,
                pitchspeed: 0.02,
                yawspeed: 0.03,
                ..Default::default()
            },
        }
    }

    /// The five frames, in order.
    pub fn frames(self) -> [Vec<u8>; 5] {
        [
            shim(MavMessage::HIGHRES_IMU(self.imu)),
            shim(MavMessage::VFR_HUD(self.air)),
            shim(MavMessage::AOA_SSA(self.incidence)),
            shim(MavMessage::ACTUATOR_OUTPUT_STATUS(self.actuators)),
            shim(MavMessage::ATTITUDE_QUATERNION(self.attitude)),
        ]
    }

    /// The state frame's bytes.
    pub fn bytes(self) -> Vec<u8> {
        self.frames().concat()
    }
}
