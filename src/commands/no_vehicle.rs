//! What `greylag fly` says, and what it keeps, if no vehicle is seen.

use std::fs;

use crate::commands::fly::ProfileName;
use crate::commands::terminal::say;
use crate::flight::runtime::Summary;
use crate::link::address::Address;

/// Sentence that no vehicle of the kind `profile` is seen at the address `vehicle` yet, and what to do.
pub fn yet(profile: ProfileName, vehicle: &Address) -> String {
    format!("no vehicle yet on {vehicle}; {}", remedy(profile, vehicle))
}

fn remedy(profile: ProfileName, vehicle: &Address) -> String {
    let name = match profile {
        ProfileName::Sitl => "the simulator",
        ProfileName::Px4 => "PX4",
        ProfileName::Ardupilot => "ArduPilot",
    };
    match (vehicle, profile) {
        (Address::UdpIn(_), ProfileName::Sitl) => "start one with `cargo sitl`".into(),
        (Address::UdpIn(_), _) => {
            format!("start {name}, or its simulator, so that it sends MAVLink to this address")
        }
        (Address::TcpIn(_), _) => format!("start {name} so that it connects to this address"),
        (Address::UdpOut(_) | Address::TcpOut(_), _) => {
            format!("start {name} there, or its simulator, or correct --vehicle")
        }
        (Address::Serial { .. }, _) => {
            format!("check cable, power and baud rate, and that {name} sends MAVLink on this port")
        }
    }
}

/// Says that no vehicle was seen, if so. The recording is removed if it is empty.
pub fn tell(summary: &mut Summary) {
    if summary.vehicle.states > 0 {
        return;
    }
    let (frames, clients) = (summary.vehicle.frames, summary.clients.frames);
    let (heard, garbled) = (frames.good > 0, frames.bad() > 0);
    let silent = !heard && !garbled && clients.good == 0;
    let removed = summary.recording.take_if(|(folder, written)| {
        silent && written.rows == 0 && fs::remove_dir_all(folder).is_ok()
    });
    match (heard, garbled) {
        (true, _) => say(format_args!("MAVLink was received, but no state of a vehicle to fly by")),
        (false, true) => say(format_args!(
            "no vehicle was seen: bytes arrive, but no valid MAVLink frame; check the baud rate"
        )),
        (false, false) if removed.is_some() => {
            say(format_args!("no vehicle was seen; the empty recording was removed"))
        }
        (false, false) => say(format_args!("no vehicle was seen")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_advice_fits_vehicle_and_address() {
        let said = |profile, address: &str| yet(profile, &address.parse().unwrap());
        let sitl = said(ProfileName::Sitl, "udpin:127.0.0.1:14600");
        assert!(sitl.ends_with("start one with `cargo sitl`"), "{sitl}");
        for (profile, address, word) in [
            (ProfileName::Ardupilot, "tcpout:127.0.0.1:5760", "start ArduPilot there"),
            (ProfileName::Px4, "udpin:0.0.0.0:14540", "start PX4, or its simulator"),
            (ProfileName::Px4, "serial:/dev/ttyACM0:921600", "baud rate"),
        ] {
            let said = said(profile, address);
            assert!(said.contains(word) && !said.contains("cargo sitl"), "{said}");
        }
    }
}
