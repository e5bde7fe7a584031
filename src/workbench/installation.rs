//! Constants of the sensors' installation, such as the gain of a vane, that only some flights of a session show. They are used for
//! all flights.

use std::sync::Arc;

use super::bench::Inner;
use super::flights::Loaded;
use super::session::Role;
use greylag_sysid::flight_path::installation::{Estimate, Installation, Prior};

impl Inner {
    /// Reconstructs those flights again for which the flights with the role Fit now give other constants of the installation than
    /// before. A flight whose log can no longer be read stays as it is.
    pub fn share_installation(&mut self) {
        let (installation, fit) = self.installation();
        let priors = |k: usize| installation.priors(fit.iter().position(|place| *place == k));
        let other = |(k, flight): (usize, &Result<Arc<Loaded>, String>)| {
            let now = priors(k);
            flight.as_ref().is_ok_and(|f| f.priors != now).then_some((k, now))
        };
        let others: Vec<(usize, Vec<Prior>)> =
            self.flights.iter().enumerate().filter_map(other).collect();
        for (k, priors) in others {
            let entry = &self.session.logs[k];
            let read = Loaded::read_as(entry, &self.folder, (&self.options, &self.model), priors);
            let (Ok(before), Ok(mut again)) = (self.flights[k].clone(), read) else { continue };
            again.alone = before.alone.clone();
            self.flights[k] = Ok(Arc::new(again));
        }
    }

    /// Sentences on the constants of the installation that the flights with the role Fit share.
    pub fn said_of_installation(&self) -> Vec<String> {
        let (installation, fit) = self.installation();
        let names = self.names(&fit);
        installation.sentences(&names.iter().map(String::as_str).collect::<Vec<_>>())
    }

    /// The constants of the installation by the flights with the role Fit, and the indices of these flights.
    fn installation(&self) -> (Installation, Vec<usize>) {
        let fit = self.usable(&[Role::Fit]);
        let own = fit.iter().filter_map(|k| self.flights[*k].as_ref().ok());
        let alone: Vec<&[Estimate]> = own.map(|flight| flight.alone.as_slice()).collect();
        (Installation::of(&alone), fit)
    }
}
