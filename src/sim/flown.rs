//! JSBSim as a training environment of a policy, with one aircraft: the first training regime of \[GSFM26\] (T. Guerin et al.,
//! 2026, see `src/lib.rs`).

use greylag_sitl::plant::PlantOptions;

use crate::imagined::{Block, Ended, STEPS, Stepped, Validity, WIDTH};
use crate::targets::Stratified;
use crate::world::World;
use crate::{Environment, Simulator, Trouble};
use greylag_control::policy::{ACTIONS, OBSERVATIONS, command, observe};
use greylag_control::task::Task;
use greylag_control::{Observation, Target};
use greylag_num::{Lanes, Real};
use greylag_physics::{Airframe, State};

/// One aircraft in JSBSim as a training environment. Each episode has one target attitude.
pub struct Flown {
    simulator: Simulator,
    validity: Validity,
    seen: Observation,
    target: Target,
    targets: Stratified,
    step: u32,
    lost: u64,
}

impl Flown {
    /// An aircraft in its initial state. Its target is the next one of `targets`. The envelope in `airframe` determines at
    /// which airspeeds the aircraft counts as lost.
    ///
    /// # Errors
    ///
    /// If JSBSim cannot load the aircraft or reset it.
    pub fn new(
        plant: &PlantOptions,
        airframe: &Airframe,
        targets: Stratified,
    ) -> Result<Flown, Trouble> {
        let mut simulator = Simulator::new(plant)?;
        let seen = simulator.reset()?;
        let target = Target { roll: 0.0, pitch: 0.0, airspeed: State::NEUTRAL.airspeed };
        let validity = Validity::of(airframe);
        let mut flown = Flown { simulator, validity, seen, target, targets, step: 0, lost: 0 };
        flown.begin()?;
        Ok(flown)
    }

    fn begin(&mut self) -> Result<(), Trouble> {
        self.target = self.targets.next_target();
        self.seen = self.simulator.reset()?;
        self.step = 0;
        Ok(())
    }

    fn observed(&self) -> [Block; OBSERVATIONS] {
        observe(&self.seen.state, &self.seen.actuators, &self.target).map(Lanes::from_f64)
    }
}

impl World for Flown {
    fn instances(&self) -> usize {
        1
    }

    fn observe(&self, _block: usize) -> [Block; OBSERVATIONS] {
        self.observed()
    }

    fn step(&mut self, _block: usize, action: &[Block; ACTIONS]) -> Result<Stepped, Trouble> {
        // If the simulator fails, for instance because a state is not finite, the aircraft counts as lost. Its state is
        // then that of the step before.
        let left = match self.simulator.step(command(action.map(|x| x.0[0].into()))) {
            Ok(seen) => {
                self.seen = seen;
                self.validity.outside(&seen.state.map(Lanes::from_f64)).0[0] > 0.0
            }
            Err(_) => true,
        };
        self.step += 1;
        let (state, target) = (self.seen.state.map(Block::from_f64), self.target);
        let reward = Task::PAPER.reward(&state, &target.map(Lanes::from_f64));
        let mut ended = [Ended::No; WIDTH];
        ended[0] = match (left, self.step >= STEPS) {
            (true, _) => Ended::Lost,
            (_, true) => Ended::Time,
            _ => Ended::No,
        };
        let stepped = Stepped { observed: self.observed(), reward, ended };
        if ended[0] != Ended::No {
            self.lost += u64::from(left);
            self.begin()?;
        }
        Ok(stepped)
    }

    fn restart(&mut self, targets: u64) -> Result<(), Trouble> {
        self.targets.go_on_after(targets);
        self.begin()
    }

    fn targets(&self) -> u64 {
        self.targets.count()
    }

    fn lost(&self) -> u64 {
        self.lost
    }
}
