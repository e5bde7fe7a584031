//! Access control of the links. A client is a ground station or an offboard program. Its link must be signed or reachable from
//! this machine only, unless the user allows unsigned links explicitly. The vehicle's link may be unsigned and reachable, with a
//! warning.

use anyhow::{Result, bail};

use crate::flight::runtime::VehicleLink;
use crate::link::address::Address;

/// Refuses unsigned links that other machines can reach, unless the user allows them. Returns a warning for allowed
/// links, and `None` if no other machine can reach an unsigned link.
pub fn check<'a>(
    unsigned: impl Iterator<Item = &'a Address>,
    asked: Asked,
) -> Result<Option<String>> {
    let open: Vec<String> =
        unsigned.filter(|address| !address.stays_here()).map(Address::to_string).collect();
    if open.is_empty() {
        return Ok(None);
    }
    let links = open.join(", ");
    if asked == Asked::Nothing {
        bail!(
            "other machines can reach {links} and steer the aircraft: sign the link (`greylag link key FILE`, then \
             --sign FILE), or allow it with --insecure"
        );
    }
    Ok(Some(format!("INSECURE: whoever reaches {links} steers the aircraft")))
}

/// Warning about an unsigned vehicle's link that other machines can reach; `None` for any other link.
pub fn vehicle(address: &Address, link: VehicleLink) -> Option<String> {
    (link == VehicleLink::Open && !address.stays_here()).then(|| {
        format!(
            "INSECURE: whoever reaches {address} can send false states of the vehicle: sign its link (--sign FILE \
             --sign-vehicle)"
        )
    })
}

/// Links to clients that the user allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// Only signed links, and links that only this machine can reach.
    Nothing,
    /// Also unsigned links that other machines can reach.
    Insecure,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_leaves_this_machine_unsigned_is_refused_until_it_is_asked_for_and_then_said() {
        let addresses = |texts: &[&str]| -> Vec<Address> {
            texts.iter().map(|text| text.parse().unwrap()).collect()
        };
        let here = addresses(&["udpin:127.0.0.1:14550", "udpout:127.0.0.1:14540"]);
        assert_eq!(check(here.iter(), Asked::Nothing).unwrap(), None);
        let open = addresses(&["udpin:127.0.0.1:14550", "udpin:0.0.0.0:14550"]);
        let refused = check(open.iter(), Asked::Nothing).unwrap_err().to_string();
        assert!(
            refused.contains("udpin:0.0.0.0:14550") && refused.contains("greylag link key"),
            "{refused}"
        );
        assert!(!refused.contains("127.0.0.1"), "{refused}");
        let said = check(open.iter(), Asked::Insecure).unwrap().unwrap();
        assert!(said.contains("INSECURE: whoever reaches udpin:0.0.0.0:14550"), "{said}");
    }

    #[test]
    fn an_unsigned_vehicle_link_that_other_machines_reach_is_warned_of() {
        let open: Address = "udpin:0.0.0.0:14560".parse().unwrap();
        let said = vehicle(&open, VehicleLink::Open).unwrap();
        assert!(said.contains("udpin:0.0.0.0:14560") && said.contains("--sign-vehicle"), "{said}");
        assert_eq!(vehicle(&open, VehicleLink::Signed), None);
        for here in ["udpin:127.0.0.1:14560", "serial:/dev/ttyAMA0:921600"] {
            assert_eq!(vehicle(&here.parse().unwrap(), VehicleLink::Open), None, "{here}");
        }
    }
}
