//! Short answer (summary) of a comparison, a diagnosis or an amendment: change of the prediction error, added effects (physical
//! contributions to forces and moments), and largest remaining error. Terminal, web page, workbench and JSON all show this
//! answer.
//!
//! The prediction error is that of free runs: simulations of the model with the recorded controls.

pub mod acting;
pub(super) mod between;
mod fitted;
mod numbers;
mod words;

use serde::Serialize;

use super::result::HorizonScore;
pub use acting::{Acting, Compared, Method};
pub use numbers::{Baseline, Decisive, InUse, Left, Numbers, Step, Way};
pub use words::{acts_in, multiple, share};

/// Preferred horizon of an answer, s. If the flights are too short for it, the answer takes the longest shorter horizon that
/// runs of every model reach.
pub const ANSWER_S: f64 = 5.0;

/// An answer in sentences, with their numbers.
#[derive(Clone, Debug, Serialize)]
pub struct Answer {
    /// Sentence on the free-run error of each model, its change from model to model, and the flights on which it was
    /// computed.
    pub error: String,
    /// Sentences on the added effects with their most significant coefficients, and on the state whose prediction improves
    /// most; empty if there is neither.
    pub effect: String,
    /// Sentence on the channels (forces, moments or rates) in which the added effects act, with the share of each channel's variance
    /// that every model leaves unexplained; empty if there is no effect or the shares are unknown.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub acts: String,
    /// Sentence on the largest remaining prediction error, relative to the usual range of its state.
    pub left: String,
    /// The recommended next command; empty if there is none.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub next: String,
    /// All numbers of the sentences.
    pub numbers: Numbers,
}

/// A model in the sequence from the given model to the last model.
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    /// States how the model was derived from the model before it.
    pub way: Way,
    /// Name of the model.
    pub model: &'a str,
    /// Free-run errors of the model.
    pub scores: &'a [HorizonScore],
}

/// Relation between the flights of the free runs and the flights of the fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// The flights of the fit are unknown.
    Unknown,
    /// Some of the flights may have been fitted. The value is the number of fitted flights among them.
    Of(usize),
    /// The flights are the last third of a flight; the first two thirds were fitted.
    LastThird,
}

/// Input of an answer.
#[derive(Clone, Debug)]
pub struct Subject<'a> {
    /// Models in the order of derivation; the first is the given model.
    pub stages: Vec<Stage<'a>>,
    /// Names of the flights.
    pub flights: Vec<String>,
    /// Relation between `flights` and the flights of the fit.
    pub seen: Seen,
    /// Effects that the last model has and the first model lacks, each with its most significant coefficient.
    pub effects: Vec<Decisive>,
    /// Name and errors of a forecast without aerodynamics, for comparison; `None` without a forecast.
    pub baseline: Option<(&'a str, &'a [HorizonScore])>,
}

impl Answer {
    /// The empty answer, for the time before the first result.
    pub fn nothing() -> Answer {
        Answer::of(&Subject {
            stages: Vec::new(),
            flights: Vec::new(),
            seen: Seen::Unknown,
            effects: Vec::new(),
            baseline: None,
        })
    }

    /// The answer for the models and errors of `subject`.
    pub fn of(subject: &Subject) -> Answer {
        let numbers = Numbers::of(subject);
        Answer {
            error: words::error(&numbers),
            effect: words::effect(&numbers),
            acts: String::new(),
            left: words::left(&numbers),
            next: String::new(),
            numbers,
        }
    }

    /// This answer with `next` as the recommended next command.
    pub fn then(self, next: String) -> Answer {
        Answer { next, ..self }
    }

    /// This answer with its sentence on effects replaced by `effect`, for example to state that no effect was found.
    pub fn with_effect(self, effect: String) -> Answer {
        Answer { effect, ..self }
    }

    /// This answer with the channels in which its effects act, from the unexplained `shares` of the models.
    pub fn acting(self, shares: &Compared) -> Answer {
        let ids: Vec<&str> = self.numbers.effects.iter().map(|e| e.id.as_str()).collect();
        let acts = acting::acting(&ids, shares);
        let sentence = words::acts(&ids, &acts, shares.method);
        let method = (!acts.is_empty()).then_some(shares.method);
        Answer { acts: sentence, numbers: Numbers { acts, method, ..self.numbers }, ..self }
    }

    /// The non-empty sentences, without the command.
    pub fn lines(&self) -> impl Iterator<Item = &str> {
        [&self.error, &self.effect, &self.acts, &self.left]
            .into_iter()
            .map(String::as_str)
            .filter(|l| !l.is_empty())
    }

    /// Whether a forecast without aerodynamics errs less than the given model and than every model that was fitted from it.
    pub fn behind_baseline(&self) -> bool {
        self.numbers.all_behind()
    }

    /// The answer as a short phrase: `error at 5 s 0.0873 → 0.00083 (−99.0 %)`.
    pub fn summary(&self) -> String {
        words::summary(&self.numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::StateScore;

    /// A score at 5 s with the given errors of airspeed (m/s) and sideslip (rad).
    fn score(rmse_scaled: f64, airspeed: f64, beta: f64) -> Vec<HorizonScore> {
        let state = |state, rmse: f64, scale: f64| StateScore {
            state,
            rmse,
            rmse_scaled: rmse / scale,
            r2: 0.0,
            theil_u: 0.0,
            bias_share: 0.0,
            variance_share: 0.0,
            covariance_share: 1.0,
        };
        let at = |horizon_s: f64, runs| HorizonScore {
            horizon_s,
            runs,
            diverged: 0,
            divergence_rate: 0.0,
            rmse_scaled,
            states: vec![state("airspeed_mps", airspeed, 10.0), state("beta_rad", beta, 0.3)],
        };
        vec![at(1.0, 9), at(5.0, 7), at(10.0, 5)]
    }

    fn drag() -> Decisive {
        Decisive {
            id: "drag_beta2".into(),
            description: "Drag rises with the square of sideslip".into(),
            coefficient: "CDbeta2".into(),
            value: 0.9912,
            ci95: [0.9859, 0.9965],
            unit: String::new(),
            alike: Vec::new(),
        }
    }

    fn subject<'a>(scores: &'a [(Way, Vec<HorizonScore>)], effects: Vec<Decisive>) -> Subject<'a> {
        let stage =
            |(way, scores): &'a (Way, Vec<HorizonScore>)| Stage { way: *way, model: "m", scores };
        Subject {
            stages: scores.iter().map(stage).collect(),
            flights: vec!["a".into(), "b".into()],
            seen: Seen::Of(0),
            effects,
            baseline: None,
        }
    }

    #[test]
    fn a_forecast_of_the_same_error_is_equal() {
        let scores = [(Way::Given, score(0.5, 1.2, 0.01))];
        for (error, beside) in [(0.5, "equal to"), (0.4, "worse than"), (0.6, "better than")] {
            let forecast = score(error, 1.2, 0.01);
            let baseline = Some(("hold the state", forecast.as_slice()));
            let answer = Answer::of(&Subject { baseline, ..subject(&scores, Vec::new()) });
            let wanted = format!("is 0.5, {beside} the best forecast");
            assert!(answer.error.contains(&wanted), "{}", answer.error);
        }
    }

    #[test]
    fn tuning_and_effect_have_each_their_own_fall() {
        let scores = [
            (Way::Given, score(0.0873, 1.2, 0.01)),
            (Way::Tuned, score(0.0234, 0.5, 0.01)),
            (Way::Effects, score(0.00083, 0.02, 0.002)),
        ];
        let answer = Answer::of(&subject(&scores, vec![drag()]));
        assert_eq!(
            answer.error,
            "On 2 flights not fitted the error at 5 s falls from 0.0873 to 0.0234 by tuning (−73 %) and to 0.00083 with \
             drag_beta2 (a further −96 %; −99.0 % in all)."
        );
        // the effect reduces the scaled error of airspeed most, from 0.05 to 0.002; the scaled error of sideslip, 0.0067,
        // is then the largest
        assert_eq!(
            answer.effect,
            "drag_beta2 (drag rises with the square of sideslip): CDbeta2 = 0.991 (95 %: 0.986 to 0.997). With it the \
             airspeed predicted 5 s ahead is off by 0.02 m/s instead of 0.5 m/s by tuning alone."
        );
        assert_eq!(answer.left, "Largest error left: sideslip, 0.115° after 5 s.");
        assert_eq!(answer.summary(), "error at 5 s 0.0873 → 0.00083 (−99.0 %)");
        let json = serde_json::to_value(&answer).unwrap();
        assert_eq!(json["numbers"]["steps"][2]["error"], 0.00083);
        assert_eq!(json["numbers"]["fitted_flights"], 0);
    }

    #[test]
    fn both_channels_of_an_effect_have_their_shares() {
        use crate::compare::ChannelId::{Pitch, Roll};
        let scores = [
            (Way::Given, score(0.0873, 1.2, 0.01)),
            (Way::Tuned, score(0.0234, 0.5, 0.01)),
            (Way::Effects, score(0.00083, 0.02, 0.002)),
        ];
        let shares = |of: [f64; 2]| {
            let mut all = [f64::NAN; 9];
            let place = |id| crate::compare::ChannelId::ALL.iter().position(|x| *x == id).unwrap();
            (all[place(Roll)], all[place(Pitch)]) = (of[0], of[1]);
            all
        };
        let compared = Compared {
            given: Some(shares([37.2, 0.5])),
            tuned: Some(shares([0.4, 0.2])),
            after: shares([0.001, 0.02]),
            method: Method::OutputError,
        };
        let lag = Decisive { id: "actuator_lag".into(), ..drag() };
        let answer = Answer::of(&subject(&scores, vec![lag])).acting(&compared);
        assert_eq!(
            answer.acts,
            "actuator_lag acts in rolling moment (unexplained: 37.2 times its variance as given, 40 % tuned by output error, \
             0.1 % with it) and in pitching moment (unexplained: 50 % as given, 20 % tuned by output error, 2 % with it)."
        );
        assert!(answer.lines().any(|line| line == answer.acts));
        let json = serde_json::to_value(&answer).unwrap();
        assert_eq!(json["numbers"]["acts"][1]["channel"], "m");
        assert_eq!(json["numbers"]["acts"][1]["after"], 0.02);
        assert_eq!(json["numbers"]["method"], "output_error");
        // without an effect there is nothing to place
        let none = Answer::of(&subject(&scores[..2], Vec::new())).acting(&compared);
        assert!(none.acts.is_empty() && none.numbers.method.is_none());
    }

    #[test]
    fn the_gain_is_shown_in_the_state_on_which_the_effect_acts() {
        // sideslip gains 0.06 of its scale, airspeed 0.05
        let scores = [
            (Way::Given, score(0.08, 1.2, 0.03)),
            (Way::Tuned, score(0.02, 0.6, 0.02)),
            (Way::Effects, score(0.01, 0.1, 0.002)),
        ];
        let state = |effects| Answer::of(&subject(&scores, effects)).numbers.in_use.unwrap().state;
        assert_eq!(state(vec![drag()]), "airspeed_mps");
        assert_eq!(state(vec![Decisive { id: "no such effect".into(), ..drag() }]), "beta_rad");
        // a gain of a hundredth in airspeed is not notable
        let little = [
            (Way::Given, score(0.08, 1.2, 0.03)),
            (Way::Tuned, score(0.02, 0.6, 0.02)),
            (Way::Effects, score(0.01, 0.59, 0.002)),
        ];
        let answer = Answer::of(&subject(&little, vec![drag()]));
        assert_eq!(answer.numbers.in_use.as_ref().unwrap().state, "beta_rad");
        // what is left is stated even if the sentence before it has the same state
        let same = [
            (Way::Given, score(0.08, 1.2, 0.03)),
            (Way::Tuned, score(0.02, 0.6, 0.02)),
            (Way::Effects, score(0.01, 0.1, 0.001)),
        ];
        let answer = Answer::of(&subject(&same, vec![drag()]));
        assert_eq!(answer.left, "Largest error left: airspeed, 0.1 m/s after 5 s.");
    }

    #[test]
    fn what_makes_it_worse_rises() {
        let scores = [
            (Way::Given, score(0.02, 0.5, 0.01)),
            (Way::Tuned, score(0.04, 0.7, 0.01)),
            (Way::Effects, score(0.03, 0.6, 0.01)),
        ];
        let said = Answer::of(&subject(&scores, vec![drag()])).error;
        assert!(
            said.contains("rises from 0.02 to 0.04 by tuning (+100 %) and falls to 0.03"),
            "{said}"
        );
        let one = Answer::of(&subject(&scores[..1], Vec::new()));
        assert_eq!(one.error, "On 2 flights not fitted the error at 5 s is 0.02.");
        assert!(one.effect.is_empty() && one.summary() == "error at 5 s 0.02");
        assert_eq!(one.left, "Of the predicted states, airspeed is worst: 0.5 m/s after 5 s.");
    }

    #[test]
    fn a_model_that_tuning_makes_worse_is_kept() {
        let scores = [(Way::Given, score(0.02, 0.5, 0.01)), (Way::Tuned, score(0.04, 0.4, 0.06))];
        let tuned = Answer::of(&subject(&scores, Vec::new()));
        assert_eq!(
            tuned.error,
            "Keep the model as it is: on 2 flights not fitted its error at 5 s is 0.02; tuned it is 0.04."
        );
        // the largest error is that of the model as given, and no gain of the tuned model is praised
        assert_eq!(tuned.left, "Largest error of the model as given: airspeed, 0.5 m/s after 5 s.");
        assert_eq!(tuned.summary(), "error at 5 s 0.02 (model as it is)");
        assert_eq!(tuned.effect, "");
        let fitted = Answer::of(&Subject { seen: Seen::Of(2), ..subject(&scores, Vec::new()) });
        assert_eq!(
            fitted.error,
            "Keep the model as it is: its error at 5 s is 0.02; tuning it to these flights makes it 0.04."
        );
    }

    #[test]
    fn a_model_worse_than_straight_flight_is_said_to_be_so_first() {
        let straight = score(0.3, 1.0, 0.01);
        let baseline = Some(("fly straight on", straight.as_slice()));
        let of = |errors: &[(Way, f64)]| {
            let scores: Vec<_> =
                errors.iter().map(|(way, e)| (*way, score(*e, 0.5, 0.01))).collect();
            Answer::of(&Subject { baseline, seen: Seen::Of(2), ..subject(&scores, vec![drag()]) })
        };
        let worse = of(&[(Way::Given, 0.5), (Way::Tuned, 0.6)]);
        assert_eq!(
            worse.error,
            "The model is worse than a forecast without aerodynamics (fly straight on, 0.3): its error at 5 s is 0.5, tuned \
             to these flights 0.6. Check axes, signs and units of the logs, fly more and richer manoeuvres, or fit it from \
             scratch."
        );
        assert!(worse.behind_baseline());
        let still = of(&[(Way::Given, 0.5), (Way::Tuned, 0.4), (Way::Effects, 0.35)]);
        assert!(
            still.error.contains("flights 0.4, with drag_beta2 0.35. Check"),
            "{}",
            still.error
        );
        let cured = of(&[(Way::Given, 0.5), (Way::Tuned, 0.2)]);
        assert_eq!(
            cured.error,
            "As given, the model is worse than a forecast without aerodynamics (fly straight on, 0.3). On the 2 flights that \
             it was fitted to, the error at 5 s falls from 0.5 to 0.2 by tuning (−60 %). Relative to \
             that forecast the error changes by −33 %."
        );
        assert!(!cured.behind_baseline());
        // of a better model nothing is said about straight flight, whatever tuning does to it
        let better = of(&[(Way::Given, 0.2), (Way::Tuned, 0.4)]);
        assert!(better.error.starts_with("Keep the model as it is"), "{}", better.error);
        assert!(!better.behind_baseline());
    }

    #[test]
    fn flights_of_the_fit_are_called_so() {
        let scores = [(Way::Given, score(0.02, 0.5, 0.01))];
        let of = |flights: &[&str]| {
            let flights: Vec<String> = flights.iter().map(|f| (*f).to_owned()).collect();
            let seen = Seen::Of(flights.len());
            Answer::of(&Subject { flights, seen, ..subject(&scores, Vec::new()) }).error
        };
        assert!(of(&["a", "b"]).starts_with("On the 2 flights that it was fitted to, the error"));
        assert!(of(&["a"]).starts_with("On the flight that it was fitted to, the error"));
    }

    #[test]
    fn flights_too_short_for_the_horizon_are_answered_at_a_shorter_one() {
        let mut short = score(0.02, 0.5, 0.01);
        short[1].runs = 0;
        let scores = [(Way::Given, short.clone()), (Way::Other, short)];
        let answer = Answer::of(&subject(&scores, Vec::new()));
        assert_eq!(answer.numbers.horizon_s, 1.0);
        assert!(answer.error.contains("at 1 s stays at 0.02"), "{}", answer.error);
        let none = Answer::of(&subject(&[], Vec::new()));
        assert_eq!(none.error, "No free run is long enough for an error to be given.");
    }
}
