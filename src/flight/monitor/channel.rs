//! The six channels of the model monitor, with their names and the likely causes of a deviation. The monitor compares measured
//! specific forces and angular accelerations with those that the model predicts.

use std::fmt;

/// A component of specific force (m/s²) or angular acceleration (rad/s²) in body axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Specific force along body x.
    Forward,
    /// Specific force along body y.
    Side,
    /// Specific force along body z.
    Normal,
    /// Angular acceleration about body x.
    Roll,
    /// Angular acceleration about body y.
    Pitch,
    /// Angular acceleration about body z.
    Yaw,
}

impl Channel {
    /// All channels in the order of their index.
    pub const ALL: [Channel; 6] = [
        Channel::Forward,
        Channel::Side,
        Channel::Normal,
        Channel::Roll,
        Channel::Pitch,
        Channel::Yaw,
    ];
}

impl Channel {
    /// Index of the channel's plane of motion: 0 longitudinal, 1 lateral.
    pub(super) fn plane(self) -> usize {
        match self {
            Channel::Forward | Channel::Normal | Channel::Pitch => 0,
            Channel::Side | Channel::Roll | Channel::Yaw => 1,
        }
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Channel::Forward => "drag and thrust",
            Channel::Side => "side force",
            Channel::Normal => "lift",
            Channel::Roll => "rolling moment",
            Channel::Pitch => "pitching moment",
            Channel::Yaw => "yawing moment",
        })
    }
}

/// A warning that a channel's residual (measurement minus prediction) has left the band that the model's uncertainty explains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Warning {
    /// The channel whose residual is largest relative to the half width of its band.
    pub channel: Channel,
    /// Residual divided by the half width of its band, signed and dimensionless. The residual is outside the band if the
    /// magnitude exceeds 1.
    pub share: f64,
    /// Whether the residual is correlated with the deflection of the surface that controls this channel.
    pub follows_surface: bool,
}

impl Warning {
    /// The likely cause, as text.
    pub fn suspect(&self) -> &'static str {
        match (self.channel, self.follows_surface) {
            (Channel::Roll, true) => "an aileron that sticks or moves less than commanded",
            (Channel::Pitch, true) => "an elevator that sticks or moves less than commanded",
            (Channel::Yaw, true) => "a rudder that sticks or moves less than commanded",
            // z points down: a positive residual means too little lift.
            (Channel::Normal, _) if self.share > 0.0 => {
                "ice on the wing, a heavier load, a wrong airspeed or incidence"
            }
            (Channel::Normal, _) => "a lighter load, a wrong airspeed or incidence",
            (Channel::Forward, _) if self.share < 0.0 => {
                "ice or damage, a failing motor, a wrong airspeed"
            }
            (Channel::Forward, _) => "a wrong airspeed or throttle, a lighter load",
            (Channel::Side, _) => {
                "a sideslip that is wrong (compass, alignment), or damage on one side"
            }
            (Channel::Roll, _) => "a load shifted sideways, ice on one wing, a stuck aileron",
            (Channel::Pitch, _) => "a load shifted fore or aft, ice, a stuck elevator",
            (Channel::Yaw, _) => {
                "a sideslip that is wrong (compass, alignment), thrust or drag on one side, a stuck rudder"
            }
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Warning { channel, share, .. } = self;
        let (share, suspect) = (share.abs(), self.suspect());
        write!(
            f,
            "{channel} deviates from the model ({share:.1} times its band): suspect {suspect}"
        )
    }
}
