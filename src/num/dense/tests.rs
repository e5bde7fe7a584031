//! Tests of [`Dense`]. Outputs in several number types are compared with the definition of the network, and derivatives with
//! central differences.

use super::*;
use crate::{Dual, Lanes, stream};

/// A network whose layer sizes are not multiples of the sizes of a SIMD block.
fn network() -> Dense {
    let mut network = Dense::silent(&[3, 21, 9, 2], &mut stream::stream(5, &[])).unwrap();
    let mut rng = stream::stream(6, &[]);
    let last = network.parameters().len() - 20;
    network.parameters_mut()[last..].iter_mut().for_each(|p| *p = rng.random_range(-1.0..1.0));
    network
}

/// The output of `network` for `input`, computed in double precision from the definition.
fn by_hand(network: &Dense, input: [f64; 3]) -> Vec<f64> {
    let mut x = input.to_vec();
    let last = network.sizes().len() - 2;
    for (k, layer) in network.layers().enumerate() {
        let outputs = layer.bias.len();
        x = (0..outputs)
            .map(|j| {
                let sum: f64 =
                    (0..x.len()).map(|i| x[i] * f64::from(layer.weights[i * outputs + j])).sum();
                let y = sum + f64::from(layer.bias[j]);
                if k < last { y.max(0.0) } else { y }
            })
            .collect();
    }
    x
}

#[test]
fn answers_are_the_definition_over_every_scalar() {
    let network = network();
    for k in 0..20 {
        let x = [0, 1, 2].map(|i| ((7 * k + i) as f64).sin());
        let expected = by_hand(&network, x);
        let plain: [f64; 2] = network.evaluate(x);
        let lanes: [Lanes<4>; 2] = network.evaluate(x.map(Lanes::from_f64));
        let fused: [Lanes<4, true>; 2] = network.evaluate(x.map(Lanes::from_f64));
        for i in 0..2 {
            // tolerance for the rounding of sums of 21 terms of order one
            assert!((plain[i] - expected[i]).abs() < 1e-14);
            for lane in [lanes[i].0[3], fused[i].0[0]] {
                assert!((f64::from(lane) - expected[i]).abs() < 3e-6);
            }
        }
    }
}

#[test]
fn wide_networks_answer_in_a_room_of_their_own() {
    let network = Dense::uniform(&[3, 300, 21, 2], &mut stream::stream(7, &[])).unwrap();
    let (mut room, mut single) = (Units::new(0.0_f64), Units::new(0.0_f32));
    let mut lanes = Units::new(Lanes::<4>::zero());
    for k in 0..20 {
        let x = [0, 1, 2].map(|i| ((5 * k + i) as f64).cos());
        let expected = by_hand(&network, x);
        let plain = network.evaluate_in(&mut room, &x);
        let one = network.evaluate_one(&mut single, &x.map(|x| x as f32));
        let lanes = network.evaluate_in(&mut lanes, &x.map(Lanes::from_f64));
        for i in 0..2 {
            // tolerance for the rounding of sums of 300 terms below one
            assert!((plain[i] - expected[i]).abs() < 1e-14);
            assert!((f64::from(one[i]) - expected[i]).abs() < 1e-6);
            assert!((f64::from(lanes[i].0[2]) - expected[i]).abs() < 1e-6);
        }
    }
}

#[test]
fn derivatives_agree_with_central_differences() {
    let network = network();
    let x = [0.3, -0.8, 0.5];
    let dual: [Dual<3>; 2] = network.evaluate([0, 1, 2].map(|i| Dual::variable(x[i], i)));
    for (i, _) in x.iter().enumerate() {
        let moved = |h: f64| {
            let mut x = x;
            x[i] += h;
            network.evaluate::<f64, 3, 2>(x)
        };
        let (up, down) = (moved(1e-6), moved(-1e-6));
        for o in 0..2 {
            // the network is piecewise linear, so the difference quotient has rounding errors only
            assert!((dual[o].gradient[i] - (up[o] - down[o]) / 2e-6).abs() < 1e-8);
        }
    }
}

#[test]
fn starts_silent_and_refuses_what_does_not_fit() {
    let network = Dense::silent(&[9, 64, 64, 8], &mut stream::stream(1, &[])).unwrap();
    assert_eq!(network.evaluate([0.7_f64; 9]), [0.0_f64; 8]);
    assert!(network.parameters()[..9 * 64].iter().all(|w| w.abs() <= 1.0 / 3.0 && *w != 0.0));
    assert!(matches!(Dense::new(&[2, 1], vec![0.0; 2]), Err(DenseError::Count { .. })));
    assert!(matches!(Dense::new(&[2], vec![]), Err(DenseError::Sizes(_))));
    assert!(matches!(Dense::new(&[2, 513], vec![0.0; 1539]), Err(DenseError::Sizes(_))));
    assert_eq!(Dense::new(&[1, 1], vec![1.0, f32::NAN]), Err(DenseError::NotFinite(1)));
}
