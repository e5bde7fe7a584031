//! Tests of the combination of estimates, and of flights that are reconstructed again with the result.

use super::*;

/// An estimate of the gain of the angle-of-attack vane.
fn gain(value: f64, sd: f64, shown: bool) -> [Estimate; 1] {
    [Estimate { name: "alpha_gain", value, sd, shown }]
}

#[test]
fn a_flight_that_shows_no_gain_is_given_that_of_the_others_and_its_own_data_count_once() {
    let [a, b, c] = [gain(0.09, 0.01, true), gain(0.07, 0.02, false), gain(0.10, 0.02, false)];
    let set = Installation::of(&[&a, &b, &c]);
    // inverse variances 1, 1/4, 1/4: the other two weigh (0.09 + 0.025) / 1.25
    let [(name, known)] = set.priors(Some(1))[..] else { panic!("{set:?}") };
    assert_eq!(name, "alpha_gain");
    assert!(
        (known.value - 0.092).abs() < 1e-12 && (known.sd - 0.01 / 1.25_f64.sqrt()).abs() < 1e-12
    );
    // prior and own data together are the value of all flights
    let (own, prior) = (0.02_f64.powi(-2), known.sd.powi(-2));
    let all = set.priors(None)[0].1.value;
    assert!(((own * 0.07 + prior * known.value) / (own + prior) - all).abs() < 1e-12);
    let said = set.sentences(&["a", "b", "c"]);
    let text = "The angle-of-attack vane reads 8.8 ± 1.6 % (95 %) too much, as a shows (alpha_gain); the other flights are \
                reconstructed with it too.";
    assert_eq!(said, [text]);
}

#[test]
fn flights_that_contradict_each_other_keep_their_own_values() {
    let [a, b] = [gain(0.09, 0.005, true), gain(0.0, 0.005, false)];
    let set = Installation::of(&[&a, &b]);
    // chi-square is 162: the mean of 0.045 has a standard deviation of 0.0035 · 12.7 = 0.045
    assert!(set.priors(Some(1)).is_empty() && set.priors(None).is_empty());
    let said = set.sentences(&["a", "b"]);
    assert!(
        said[0].starts_with("alpha_gain is shown by a, but")
            && said[0].contains("square 162.0 with 1 degree of freedom)"),
        "{said:?}"
    );
}

#[test]
fn flights_that_scatter_by_chance_do_not_contradict_each_other() {
    let [a, b] = [gain(0.05, 0.008, true), gain(0.035, 0.0078, false)];
    // chi-square is 1.8, which one degree of freedom exceeds with a probability of 18 %
    let said = Installation::of(&[&a, &b]).sentences(&["a", "b"]);
    let [a, b] = [gain(0.09, 0.014, true), gain(0.0, 0.04, false)];
    let weak = Installation::of(&[&a, &b]);
    assert!(said[0].contains("the other flights are reconstructed with it too."), "{said:?}");
    // chi-square is 4.5: 3 % by chance, but the mean of 0.08 has a standard deviation of 0.028
    assert!(weak.priors(Some(1)).is_empty());
    let text = "alpha_gain is shown by a, but the flights together do not determine it: each keeps its own estimate.";
    assert_eq!(weak.sentences(&["a", "b"]), [text]);
}

#[test]
fn a_flight_whose_own_data_contradict_the_others_is_left_without_the_constant() {
    let [a, b, c] = [gain(0.09, 0.005, true), gain(0.085, 0.006, true), gain(0.06, 0.008, false)];
    let set = Installation::of(&[&a, &b, &c, &[]]);
    // 0.028 beside a standard deviation of 0.0089 is chi-square 9.9, 0.2 % by chance
    assert!(set.priors(Some(2)).is_empty());
    assert!(!set.priors(Some(0)).is_empty() && !set.priors(Some(3)).is_empty());
    let said = set.sentences(&["a", "b", "c", "d"]);
    assert!(said[0].ends_with("with it too, but not c, whose own data contradict it."), "{said:?}");
    // a flight that cannot tell the constant from zero takes it, though it is three standard deviations off
    let vague = gain(0.0, 0.029, false);
    assert!(!Installation::of(&[&a, &b, &vague]).priors(Some(2)).is_empty());
    // nobody is left who would take it
    let alone = Installation::of(&[&a, &b, &c]);
    assert!((0..3).all(|k| alone.priors(Some(k)).is_empty()));
    assert!(alone.sentences(&["a", "b", "c"])[0].contains("with 2 degrees of freedom"));
}

#[test]
fn the_tail_of_chi_square_has_the_tables_quantiles() {
    // 99 % quantiles: Abramowitz and Stegun, table 26.8
    for (degrees, quantile) in [(1, 6.6349), (2, 9.21034), (3, 11.3449), (4, 13.2767), (9, 21.6660)]
    {
        let tail = chi_square_tail(quantile, degrees);
        assert!((tail - 0.01).abs() < 1e-6, "{degrees}: {tail}");
    }
    assert_eq!([chi_square_tail(0.0, 1), chi_square_tail(0.0, 4)], [1.0; 2]);
}

#[test]
fn what_all_flights_show_or_none_shows_asks_for_no_second_reconstruction() {
    let [a, b] = [gain(0.09, 0.01, true), gain(0.08, 0.01, true)];
    let all = Installation::of(&[&a, &b]);
    assert!(all.priors(Some(0)).is_empty() && all.sentences(&["a", "b"]).is_empty());
    // a flight outside of the set, such as one held out, still takes it
    assert_eq!(all.priors(None).len(), 1);
    let none = [gain(0.03, 0.01, false), gain(0.02, 0.01, false)];
    let none = Installation::of(&[&none[0], &none[1]]);
    assert_eq!(none, Installation::default());
}

#[test]
fn a_flight_in_gusts_takes_the_value_though_it_has_no_estimate() {
    let a = gain(-0.06, 0.008, true);
    let set = Installation::of(&[&a, &[]]);
    // the only flight with an estimate has nothing to learn from the other one
    assert!(set.priors(Some(0)).is_empty());
    let known = set.priors(Some(1))[0].1;
    assert!((known.value + 0.06).abs() < 1e-12 && (known.sd - 0.008).abs() < 1e-12);
    assert!(set.sentences(&["a", "b"])[0].contains("6.0 ± 1.6 % (95 %) too little, as a shows"));
}

#[test]
fn a_flight_is_reconstructed_once_more_where_another_one_has_something_to_say() {
    let shows = |name: &str, of: &[Estimate]| Reconstruction {
        installation: of.to_vec(),
        ..Reconstruction::empty(name)
    };
    let mut flights = [
        shows("a", &gain(0.09, 0.01, true)),
        shows("b", &gain(0.05, 0.02, false)),
        shows("gusts", &[]),
    ];
    let mut asked = Vec::new();
    let again = |k: usize, priors: &[Prior]| {
        asked.push((k, priors.len()));
        Ok::<_, ()>(Reconstruction::empty("again"))
    };
    share(&mut flights, again).unwrap();
    assert_eq!(asked, [(0, 1), (1, 1), (2, 1)]);
    assert!(flights.iter().all(|f| f.name == "again"));
    let mut alone = [shows("a", &gain(0.09, 0.01, true))];
    share(&mut alone, |_, _| Err("one flight alone is not reconstructed again")).unwrap();
}

#[test]
fn a_rolled_board_is_said_in_degrees() {
    let a = [Estimate { name: "board_roll", value: -0.026, sd: 0.0013, shown: true }];
    let said = Installation::of(&[&a, &[]]).sentences(&["a", "b"]);
    assert!(
        said[0].starts_with("The board is rolled to the left by 1.49 ± 0.15° (95 %)"),
        "{said:?}"
    );
}
