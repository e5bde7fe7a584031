//! The mixer: what the controls move, read back; what cannot be flown, by name.

use greylag::physics::Command;
use greylag::physics::mixer::{Does, Effector, Mixer};
use greylag::physics::servos::{Travel, Travels};

fn surface(name: &str, travel: Travel, gains: [f64; 4]) -> Effector {
    Effector {
        name: name.into(),
        does: Does::Deflects(travel),
        gains,
        channel: None,
        command: None,
        position: None,
    }
}

fn motor(name: &str, gains: [f64; 4]) -> Effector {
    Effector { does: Does::Pulls, ..surface(name, Travel::symmetric(1.0), gains) }
}

fn positions(mixer: &Mixer, command: &Command) -> Vec<f64> {
    let given = mixer.mix(command);
    mixer.effectors().iter().zip(given).map(|(e, u)| e.position(u)).collect()
}

const ALL: Command = Command { aileron: 0.3, elevator: -0.4, rudder: 0.2, throttle: 0.6 };

#[test]
fn elevons_are_half_sum_and_half_difference() {
    let t = Travel::symmetric(0.5);
    let elevons = vec![
        surface("left", t, [1.0, 1.0, 0.0, 0.0]),
        surface("right", t, [-1.0, 1.0, 0.0, 0.0]),
        motor("motor", [0.0, 0.0, 0.0, 1.0]),
    ];
    let mixer = Mixer::new(elevons, false).unwrap();
    let [a, e, r, throttle] = mixer.deflections(&[0.3, 0.1, 0.6]);
    assert!((a - 0.1).abs() < 1e-12 && (e - 0.2).abs() < 1e-12, "{a} {e}");
    assert!(r == 0.0 && (throttle - 0.6).abs() < 1e-12);
    let travel = mixer.travels().elevator;
    assert!((travel.most - t.most).abs() < 1e-12 && (travel.least - t.least).abs() < 1e-12);
    // what goes beyond a stop is not flown, and is not read back
    let stopped = positions(&mixer, &Command { aileron: 0.8, elevator: 0.6, ..ALL });
    assert_eq!(stopped[0], 0.5);
    assert!(mixer.deflections(&stopped)[0] < 0.8 * 0.5);
}

#[test]
fn a_v_tail_with_ailerons_apart_and_two_motors_is_read_back_as_it_was_given() {
    let t = Travel::symmetric(0.4);
    let effectors = vec![
        surface("left_aileron", t, [0.9, 0.0, 0.0, 0.0]),
        surface("right_aileron", t, [-0.9, 0.0, 0.0, 0.0]),
        surface("left_ruddervator", t, [0.0, 0.6, 0.4, 0.0]),
        surface("right_ruddervator", t, [0.0, 0.6, -0.4, 0.0]),
        motor("left_motor", [0.0, 0.0, -0.1, 1.0]),
        motor("right_motor", [0.0, 0.0, 0.1, 1.0]),
    ];
    let mixer = Mixer::new(effectors, true).unwrap();
    let found = mixer.deflections(&positions(&mixer, &ALL));
    let travels = mixer.travels();
    let wanted = [
        travels.aileron.deflection(ALL.aileron),
        travels.elevator.deflection(ALL.elevator),
        travels.rudder.unwrap().deflection(ALL.rudder),
        ALL.throttle,
    ];
    for (a, b) in found.into_iter().zip(wanted) {
        assert!((a - b).abs() < 1e-12, "{found:?} for {wanted:?}");
    }
}

/// Differential ailerons go further up than down; the mean of both is what rolls.
#[test]
fn ailerons_of_unequal_travel_roll_by_their_mean() {
    let effectors = vec![
        surface("left", Travel { least: -0.5, most: 0.3 }, [1.0, 0.0, 0.0, 0.0]),
        surface("right", Travel { least: -0.5, most: 0.3 }, [-1.0, 0.0, 0.0, 0.0]),
        surface("elevator", Travel { least: -0.4, most: 0.2 }, [0.0, 1.0, 0.0, 0.0]),
        motor("motor", [0.0, 0.0, 0.0, 1.0]),
    ];
    let mixer = Mixer::new(effectors, false).unwrap();
    let travels = mixer.travels();
    assert!((travels.aileron.most - 0.4).abs() < 1e-12);
    assert!((travels.aileron.least + 0.4).abs() < 1e-12, "{travels:?}");
    assert!((travels.elevator.least + 0.4).abs() < 1e-12, "{travels:?}");
    let short = Travels { elevator: Travel { least: -0.3, most: 0.2 }, ..travels };
    let said = mixer.clone().checked(&short).unwrap_err().to_string();
    assert!(said.contains("controls.elevator") && said.contains("-0.4000"), "{said}");
    assert!(mixer.checked(&travels).is_ok());
}

#[test]
fn what_cannot_be_flown_is_refused_by_name() {
    let t = Travel::symmetric(0.5);
    let alike = vec![
        surface("left", t, [1.0, 1.0, 0.0, 0.0]),
        surface("right", t, [1.0, 1.0, 0.0, 0.0]),
        motor("motor", [0.0, 0.0, 0.0, 1.0]),
    ];
    let said = Mixer::new(alike.clone(), false).unwrap_err().to_string();
    assert!(
        said.contains("singular: left, right move with the elevator as with aileron"),
        "{said}"
    );
    let said = Mixer::new(alike[..1].to_vec(), false).unwrap_err().to_string();
    assert!(said.contains("nothing moves the throttle"), "{said}");
    let tail = vec![surface("tail", t, [1.0, 0.0, 1.0, 0.0])];
    let said = Mixer::new([alike, tail].concat(), false).unwrap_err().to_string();
    assert!(said.contains("tail has rudder") && said.contains("[controls.rudder]"), "{said}");
}
