//! Channels (forces, moments and rates) in which models are compared with flights, and regime variables, such as the angle of
//! attack, which describe the flight condition.

use serde::Serialize;

/// A channel in which measured and predicted values are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum ChannelId {
    /// Drag minus the component of thrust opposite to it, N, positive backwards. Accelerometers do not distinguish drag from
    /// thrust.
    /// The channel `physics::Channel::Drag` of an effect is the drag alone.
    #[serde(rename = "D")]
    Drag,
    /// Lift plus the component of thrust along it, N, positive upwards.
    #[serde(rename = "L")]
    Lift,
    /// Side force, N, positive to the right.
    #[serde(rename = "Y")]
    Side,
    /// Rolling moment l, N m, positive right wing down.
    #[serde(rename = "l")]
    Roll,
    /// Pitching moment m, N m, positive nose up.
    #[serde(rename = "m")]
    Pitch,
    /// Yawing moment n, N m, positive nose right.
    #[serde(rename = "n")]
    Yaw,
    /// Rate of airspeed, m/s².
    #[serde(rename = "V")]
    Airspeed,
    /// Rate of the angle of attack, rad/s.
    #[serde(rename = "alpha")]
    Alpha,
    /// Rate of sideslip, rad/s.
    #[serde(rename = "beta")]
    Beta,
}

impl ChannelId {
    /// All channels in the order forces, moments, rates of V, α and β.
    pub const ALL: [ChannelId; 9] = [
        ChannelId::Drag,
        ChannelId::Lift,
        ChannelId::Side,
        ChannelId::Roll,
        ChannelId::Pitch,
        ChannelId::Yaw,
        ChannelId::Airspeed,
        ChannelId::Alpha,
        ChannelId::Beta,
    ];

    /// Name in tables and plots.
    pub const fn name(self) -> &'static str {
        match self {
            ChannelId::Drag => "drag less thrust",
            ChannelId::Lift => "lift",
            ChannelId::Side => "side force",
            ChannelId::Roll => "rolling moment",
            ChannelId::Pitch => "pitching moment",
            ChannelId::Yaw => "yawing moment",
            ChannelId::Airspeed => "rate of airspeed",
            ChannelId::Alpha => "rate of angle of attack",
            ChannelId::Beta => "rate of sideslip",
        }
    }

    /// Symbol in the equations.
    pub const fn symbol(self) -> &'static str {
        match self {
            ChannelId::Drag => "D",
            ChannelId::Lift => "L",
            ChannelId::Side => "Y",
            ChannelId::Roll => "l",
            ChannelId::Pitch => "m",
            ChannelId::Yaw => "n",
            ChannelId::Airspeed => "V̇",
            ChannelId::Alpha => "α̇",
            ChannelId::Beta => "β̇",
        }
    }

    /// Unit of the channel's values and residuals.
    pub const fn unit(self) -> &'static str {
        match self {
            ChannelId::Drag | ChannelId::Lift | ChannelId::Side => "N",
            ChannelId::Roll | ChannelId::Pitch | ChannelId::Yaw => "N m",
            ChannelId::Airspeed => "m/s²",
            ChannelId::Alpha | ChannelId::Beta => "rad/s",
        }
    }
}

/// A quantity that describes the flight condition in a window, a short stretch of flight over which data are averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RegimeVariable {
    /// Angle of attack α, °.
    Alpha,
    /// Sideslip angle β, °.
    Beta,
    /// True airspeed V, m/s.
    Airspeed,
    /// Throttle position, 0..1.
    Throttle,
    /// Roll rate p, °/s.
    P,
    /// Pitch rate q, °/s.
    Q,
    /// Yaw rate r, °/s.
    R,
    /// Deflection of the ailerons, °.
    Aileron,
    /// Deflection of the elevator, °.
    Elevator,
    /// Rate of the aileron deflection, °/s.
    AileronRate,
    /// Rate of the elevator deflection, °/s.
    ElevatorRate,
    /// Altitude above mean sea level, m.
    Altitude,
    /// Time since the first sample of the reconstructed flight, s.
    Time,
    /// Index of the flight.
    Flight,
}

impl RegimeVariable {
    /// The continuous variables: all variables except the flight.
    pub const CONTINUOUS: [RegimeVariable; 13] = [
        RegimeVariable::Alpha,
        RegimeVariable::Beta,
        RegimeVariable::Airspeed,
        RegimeVariable::Throttle,
        RegimeVariable::P,
        RegimeVariable::Q,
        RegimeVariable::R,
        RegimeVariable::Aileron,
        RegimeVariable::Elevator,
        RegimeVariable::AileronRate,
        RegimeVariable::ElevatorRate,
        RegimeVariable::Altitude,
        RegimeVariable::Time,
    ];

    /// Name in plots.
    pub const fn name(self) -> &'static str {
        match self {
            RegimeVariable::Alpha => "angle of attack",
            RegimeVariable::Beta => "sideslip",
            RegimeVariable::Airspeed => "airspeed",
            RegimeVariable::Throttle => "throttle",
            RegimeVariable::P => "roll rate",
            RegimeVariable::Q => "pitch rate",
            RegimeVariable::R => "yaw rate",
            RegimeVariable::Aileron => "aileron",
            RegimeVariable::Elevator => "elevator",
            RegimeVariable::AileronRate => "aileron movement",
            RegimeVariable::ElevatorRate => "elevator movement",
            RegimeVariable::Altitude => "altitude",
            RegimeVariable::Time => "time",
            RegimeVariable::Flight => "flight",
        }
    }

    /// Unit of the variable's values and bins.
    pub const fn unit(self) -> &'static str {
        use RegimeVariable as V;
        match self {
            V::Alpha | V::Beta | V::Aileron | V::Elevator => "°",
            V::P | V::Q | V::R | V::AileronRate | V::ElevatorRate => "°/s",
            V::Airspeed => "m/s",
            V::Altitude => "m",
            V::Time => "s",
            V::Throttle | V::Flight => "",
        }
    }
}
