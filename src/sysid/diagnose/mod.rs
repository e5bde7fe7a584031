//! Which physical effect a model lacks.

mod catalogue;
mod cells;
mod columns;
mod features;
mod gather;
mod local;
mod noise;
mod nulls;
mod projected;
mod rank;
mod result;
mod round;
mod sensors;
mod whiten;

pub use result::{
    Advice, Candidate, ChannelLeft, Curve, Decoy, Diagnosis, FlightEstimate, Measurement, Nulls,
    Parameter, Settings, Tuned, Verdict,
};

#[doc(hidden)]
pub mod bench {
    //! Temporary.
    use super::*;
    use crate::model::GreyBox;
    use crate::sysid::compare::flight::Prepared;
    use crate::sysid::reconstruction::Reconstruction;
    pub fn go(model: &GreyBox, flights: &[Reconstruction], n: usize) -> (f64, Vec<(String, f64, f64, f64, Vec<f64>)>) {
        let slowest = 0.5 * model.airframe.envelope.airspeed_min_mps;
        let t = std::time::Instant::now();
        let prepared: Vec<Prepared> = flights.iter().map(|f| Prepared::new(f, slowest).unwrap()).collect();
        let sensors = flights.iter().zip(&prepared).map(|(f, p)| sensors::widths(f, p.dt)).collect();
        let problem = round::Problem { flights: prepared, prior: model.coefficients().iter().map(|c| (c.value, c.width())).collect(), sensors, seed: 1 };
        let r0 = round::Round::new(&problem, model.clone(), &[]).unwrap();
        let tuned = r0.tuned();
        let t1 = t.elapsed();
        for c in tuned.coefficients() { let o = model.coefficients().iter().find(|x| x.name == c.name).unwrap(); if o.width() > 0.0 && std::env::var("V").is_ok() { eprintln!("{} {} -> {}", c.name, o.value, c.value); } }
        let entries = catalogue::candidates(model, &[]);
        let mut r = round::Round::new(&problem, tuned, &entries).unwrap();
        let t2 = t.elapsed();
        let s = r.rank();
        let t3 = t.elapsed();
        let b = nulls::best(&r.projected, &r.trials, 1, n);
        let t4 = t.elapsed();
        if std::env::var("V").is_ok() { eprintln!("{t1:?} {t2:?} {t3:?} {t4:?} ny {} blocks {} rss {}", r.projected.width(), r.cells.blocks(), r.projected.total[(r.projected.width(), r.projected.width())]);
        eprintln!("nulls {:?}", b.iter().step_by(n / 10).collect::<Vec<_>>()); }
        (nulls::threshold(&b, 0.01), s.into_iter().map(|(k, s)| (r.trials[k].id.to_string(), s.evidence, s.gain, s.wald, s.values)).collect())
    }
}
