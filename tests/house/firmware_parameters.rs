//! The parameters that are shipped for PX4 and ArduPlane: what the companion checks, it finds in them as it wants it.

use std::collections::BTreeMap;
use std::path::Path;

use greylag::link::vehicle::real::profile::{Need, Presence};
use greylag::link::vehicle::{Authority, Stack};

/// Names and values of a shipped file, as the simulator reads it.
fn shipped(name: &str) -> BTreeMap<String, f64> {
    let path = Path::new("params/x8").join(name);
    greylag_sitl::parameter_file::read(&path).unwrap().into_iter().collect()
}

/// What firmware has by itself as it is needed, so that no file sets it: calibration of the radio, order of its channels, trims.
const BY_ITSELF: [&str; 6] = ["RC1_", "RC2_", "RC3_", "RCMAP_", "TRIM_", "IMU_GYRO_CUTOFF"];

#[test]
fn what_is_checked_is_shipped_as_it_is_wanted() {
    for (file, stack) in [("arduplane.parm", Stack::Ardupilot), ("px4.parm", Stack::Px4)] {
        let parameters = shipped(file);
        for authority in [Authority::Surfaces, Authority::Attitude] {
            for rule in stack.rules(authority) {
                let known = rule.names.iter().find_map(|name| Some((name, parameters.get(*name)?)));
                let Some((name, value)) = known else {
                    let own = BY_ITSELF.iter().any(|start| rule.names[0].starts_with(start));
                    assert!(
                        own || rule.presence == Presence::Optional,
                        "{file} lacks {:?}",
                        rule.names
                    );
                    continue;
                };
                assert!(
                    rule.need.allows(*value, 1),
                    "{file}: {name} {value} is not {:?}",
                    rule.need
                );
                // The value that a refusal tells to set is the one that is shipped.
                let same = rule.remedy == *value || matches!(rule.need, Need::Between(..));
                assert!(same, "{file}: {name} {value}, and {} where it is refused", rule.remedy);
            }
        }
    }
}

/// Each shipped file with those that name it.
const NAMED_BY: [(&str, &[&str]); 2] = [
    (
        "arduplane.parm",
        &[
            "SAFETY.md",
            "docs/reference/engagement-contract.md",
            "docs/tutorials/fly-with-px4-and-ardupilot.md",
            "docs/how-to/ardupilot-sitl-on-jsbsim.md",
            "tests/firmware/stacks.py",
        ],
    ),
    (
        "px4.parm",
        &[
            "SAFETY.md",
            "docs/reference/engagement-contract.md",
            "docs/tutorials/fly-with-px4-and-ardupilot.md",
            "docs/how-to/px4-sitl-on-jsbsim.md",
            "docs/how-to/connect-a-flight-controller.md",
            "tests/firmware/stacks.py",
        ],
    ),
];

#[test]
fn pages_and_checks_name_the_files() {
    for (file, pages) in NAMED_BY {
        let shipped = shipped(file);
        for page in pages {
            let text = std::fs::read_to_string(page).unwrap();
            assert!(text.contains(file), "{page}");
            // What a file sets is not set again with other values.
            for (name, value) in shipped.iter().filter(|_| page.ends_with(".md")) {
                for named in [format!("`{name}` "), format!("param set {name} ")] {
                    let other = text.split(&named).skip(1).filter_map(|rest| {
                        let word: String =
                            rest.chars().take_while(|c| c.is_ascii_digit() || *c == '.').collect();
                        word.trim_end_matches('.').parse::<f64>().ok()
                    });
                    for other in other {
                        assert!(
                            other == *value || EXPLAINED.contains(&(name, other)),
                            "{page}: {name} {other}, shipped {value}"
                        );
                    }
                }
            }
        }
    }
}

/// Values that a page speaks of beside those that are shipped.
const EXPLAINED: [(&str, f64); 5] = [
    ("NAV_RCL_ACT", 7.0),
    ("MAV_GCS_SYSID_HI", 255.0),
    ("FS_GCS_ENABL", 0.0),
    ("FS_LONG_ACTN", 0.0),
    ("FS_LONG_TIMEOUT", 1.5),
];
