//! Command and position properties of an aircraft: aileron, elevator, rudder and throttle, or each surface by itself.

use jsbsim::{Error, Fdm, NodeId};

use super::linked::Linked;
use super::lookup::{look, needed};
use super::mixing::Mixing;
use super::options::THROTTLE_COMMAND;
use super::{Inputs, PlantError, PlantOptions, Properties};

/// Nodes of commands and positions.
pub(super) enum Steering {
    /// Aileron, elevator, rudder and throttle commands.
    Usual(Usual),
    /// Surfaces and motors with separate commands.
    Mixed(Box<Mixed>),
}

pub(super) struct Usual {
    surfaces: [Linked; 2],
    /// Command and position of the rudder.
    rudder: Option<[Linked; 2]>,
    /// Command of each throttle; empty on a glider.
    throttles: Vec<NodeId>,
    positions: [Linked; 2],
    throttle_position: Option<NodeId>,
}

pub(super) struct Mixed {
    mixing: Mixing,
    /// Command of each surface and motor; `None` if it follows the usual commands.
    commands: Vec<Option<NodeId>>,
    positions: Vec<NodeId>,
    /// The usual commands (aileron, elevator, rudder), which move the surfaces without a separate command.
    usual: [Option<NodeId>; 3],
    throttles: Vec<NodeId>,
}

impl Steering {
    /// Looks up the properties on a loaded aircraft.
    pub(super) fn find(fdm: &Fdm, options: &PlantOptions) -> Result<Self, PlantError> {
        let look = |name: &str| look(fdm, name);
        let node = |name: &str| needed(fdm, &options.aircraft, name);
        let p = &options.properties;
        let throttles = numbered(fdm, &p.throttle_command);
        if let Some(mixing) = &options.mixing {
            let of = |name: &Option<String>| name.as_deref().map(&node).transpose();
            let commands =
                mixing.moved().iter().map(|m| of(&m.command)).collect::<Result<Vec<_>, _>>()?;
            let positions = mixing.moved().iter().map(|m| node(&m.position));
            return Ok(Steering::Mixed(Box::new(Mixed {
                positions: positions.collect::<Result<_, _>>()?,
                commands,
                mixing: mixing.clone(),
                usual: [
                    look(&p.aileron_command),
                    look(&p.elevator_command),
                    look(&p.rudder_command),
                ],
                throttles,
            })));
        }
        let is_glider = throttles.is_empty() && p.throttle_command == THROTTLE_COMMAND;
        if throttles.is_empty() && !is_glider {
            node(&p.throttle_command)?;
        }
        let linked = |text: &str| Linked::find(fdm, &options.aircraft, text);
        Ok(Steering::Usual(Usual {
            surfaces: [linked(&p.aileron_command)?, linked(&p.elevator_command)?],
            rudder: rudder(fdm, &options.aircraft, p)?,
            throttles,
            positions: [
                Linked::look(fdm, &p.aileron_position)
                    .map_or_else(|| linked(p.aileron_fallback()), Ok)?,
                linked(&p.elevator_position)?,
            ],
            throttle_position: (!is_glider).then(|| node(&p.throttle_position)).transpose()?,
        }))
    }

    /// Writes the commands to their JSBSim properties.
    pub(super) fn command(&self, fdm: &mut Fdm, inputs: &Inputs) -> Result<(), Error> {
        let values = [inputs.aileron, inputs.elevator, inputs.rudder];
        let throttles = match self {
            Steering::Usual(usual) => {
                let rudder = usual.rudder.as_ref().map(|[command, _]| command);
                let surfaces = usual.surfaces.iter().chain(rudder);
                let mut written = Vec::with_capacity(4);
                surfaces.zip(values).for_each(|(linked, value)| linked.add(value, &mut written));
                for (node, value) in written {
                    fdm.write_node(node, value)?;
                }
                &usual.throttles
            }
            Steering::Mixed(mixed) => {
                for (node, value) in mixed.usual.iter().zip(values) {
                    if let Some(node) = node {
                        fdm.write_node(*node, value)?;
                    }
                }
                &mixed.throttles
            }
        };
        for throttle in throttles {
            fdm.write_node(*throttle, inputs.throttle)?;
        }
        if let Steering::Mixed(mixed) = self {
            for (command, given) in mixed.commands.iter().zip(mixed.mixing.mix(inputs)) {
                if let Some(node) = command {
                    fdm.write_node(*node, given)?;
                }
            }
        }
        Ok(())
    }

    /// Present aileron, elevator and rudder positions (rad) and throttle position (0..1).
    pub(super) fn positions(&self, fdm: &mut Fdm) -> Result<[f64; 4], Error> {
        match self {
            Steering::Usual(usual) => {
                let [aileron, elevator] = &usual.positions;
                let throttle = usual.throttle_position.map_or(Ok(0.0), |n| fdm.read_node(n));
                let rudder = usual.rudder.as_ref().map_or(Ok(0.0), |[_, place]| place.read(fdm));
                Ok([aileron.read(fdm)?, elevator.read(fdm)?, rudder?, throttle?])
            }
            Steering::Mixed(mixed) => {
                let positions: Result<Vec<f64>, Error> =
                    mixed.positions.iter().map(|node| fdm.read_node(*node)).collect();
                Ok(mixed.mixing.controls(&positions?))
            }
        }
    }

    /// Whether the aircraft has no throttle.
    pub(super) fn is_glider(&self) -> bool {
        match self {
            Steering::Usual(usual) => usual.throttles.is_empty(),
            Steering::Mixed(_) => false,
        }
    }
}

/// Command and position of the rudder; a rudder that is named in the options must exist.
fn rudder(
    fdm: &Fdm,
    aircraft: &str,
    names: &Properties,
) -> Result<Option<[Linked; 2]>, PlantError> {
    let Properties { rudder_command, rudder_position, .. } = names;
    let usual = Properties::default();
    if (rudder_command, rudder_position) == (&usual.rudder_command, &usual.rudder_position) {
        let both = Linked::look(fdm, rudder_command).zip(Linked::look(fdm, rudder_position));
        return Ok(both.map(|(c, p)| [c, p]));
    }
    let find = |text: &str| Linked::find(fdm, aircraft, text);
    Ok(Some([find(rudder_command)?, find(rudder_position)?]))
}

/// The nodes `NAME`, `NAME[1]`, … up to the first that does not exist.
fn numbered(fdm: &Fdm, name: &str) -> Vec<NodeId> {
    let names = (0..).map(|i| if i == 0 { name.to_owned() } else { format!("{name}[{i}]") });
    names.map_while(|name| fdm.node(&name).ok().flatten()).collect()
}
