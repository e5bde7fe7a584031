//! Inputs and observable state of a plant, in SI units.

/// Deflection of the X8's surfaces at full command, rad (read back from the public simulator).
#[allow(clippy::approx_constant)] // Not π/6: the aircraft's file says 0.5235.
pub const FULL_DEFLECTION_RAD: f64 = 0.5235;

/// The state at which an episode starts; velocities are relative to the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Roll angle φ, rad; right wing down positive.
    pub roll_rad: f64,
    /// Pitch angle θ, rad; nose up positive.
    pub pitch_rad: f64,
    /// Yaw angle ψ from true north, rad; clockwise positive.
    pub yaw_rad: f64,
    /// True airspeed, m/s, positive.
    pub airspeed_mps: f64,
    /// Angle of attack, rad; positive if the relative wind comes from below.
    pub alpha_rad: f64,
    /// Sideslip angle, rad; positive if the relative wind comes from the right.
    pub beta_rad: f64,
    /// Roll rate, body axes, rad/s; right wing down positive.
    pub p_radps: f64,
    /// Pitch rate, body axes, rad/s; nose up positive.
    pub q_radps: f64,
    /// Yaw rate, body axes, rad/s; nose right positive.
    pub r_radps: f64,
    /// Altitude above mean sea level, m.
    pub altitude_m: f64,
}

impl Start {
    /// The start of an episode: wings level, zero angle of attack and sideslip, 16.67 m/s, 600 m, not trimmed (section V-A of
    /// \[GSFM26\]).
    pub const NEUTRAL: Start = Start {
        roll_rad: 0.0,
        pitch_rad: 0.0,
        yaw_rad: 0.0,
        airspeed_mps: 16.67,
        alpha_rad: 0.0,
        beta_rad: 0.0,
        p_radps: 0.0,
        q_radps: 0.0,
        r_radps: 0.0,
        altitude_m: 600.0,
    };

    pub(super) fn is_flyable(&self) -> bool {
        let Start { roll_rad, pitch_rad, yaw_rad, alpha_rad, beta_rad, p_radps, q_radps, .. } =
            *self;
        [roll_rad, pitch_rad, yaw_rad, alpha_rad, beta_rad, p_radps, q_radps, self.r_radps]
            .iter()
            .all(|x| x.is_finite() && x.abs() < 100.0)
            && (0.1..=1000.0).contains(&self.airspeed_mps)
            && (-400.0..=80_000.0).contains(&self.altitude_m)
    }
}

impl Default for Start {
    fn default() -> Self {
        Start::NEUTRAL
    }
}

/// Normalised commands for one step.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Inputs {
    /// Aileron, −1..1; positive rolls right.
    pub aileron: f64,
    /// Elevator, −1..1; positive pitches down.
    pub elevator: f64,
    /// Throttle command, 0..1.
    pub throttle: f64,
    /// Rudder, −1..1; positive yaws left.
    pub rudder: f64,
}

impl Inputs {
    /// The inputs limited to their ranges.
    pub fn clamped(self) -> Self {
        Inputs {
            aileron: self.aileron.clamp(-1.0, 1.0),
            elevator: self.elevator.clamp(-1.0, 1.0),
            throttle: self.throttle.clamp(0.0, 1.0),
            rudder: self.rudder.clamp(-1.0, 1.0),
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        [self.aileron, self.elevator, self.throttle, self.rudder].iter().all(|x| x.is_finite())
    }
}

/// True state of the plant after a step, without sensor errors.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Truth {
    /// Time since the reset, s.
    pub time_s: f64,
    /// Roll angle φ, rad; right wing down positive.
    pub roll_rad: f64,
    /// Pitch angle θ, rad; nose up positive.
    pub pitch_rad: f64,
    /// Yaw angle ψ from true north, rad; clockwise positive.
    pub yaw_rad: f64,
    /// Roll rate relative to the earth, body axes, rad/s; right wing down positive.
    pub p_radps: f64,
    /// Pitch rate relative to the earth, body axes, rad/s; nose up positive.
    pub q_radps: f64,
    /// Yaw rate relative to the earth, body axes, rad/s; nose right positive.
    pub r_radps: f64,
    /// True airspeed, relative to the air including turbulence, m/s.
    pub airspeed_mps: f64,
    /// Angle of attack relative to the air, rad; positive if the relative wind comes from below.
    pub alpha_rad: f64,
    /// Sideslip angle relative to the air, rad; positive if the relative wind comes from the right.
    pub beta_rad: f64,
    /// Specific force at the centre of gravity, body axes (forward-right-down), m/s²; −9.81 on z in level flight.
    pub specific_force_mps2: [f64; 3],
    /// Velocity over the ground, north-east-down, m/s.
    pub velocity_ned_mps: [f64; 3],
    /// Velocity of the air over the ground including gusts and turbulence, north-east-down, m/s.
    pub wind_ned_mps: [f64; 3],
    /// Geodetic latitude, deg, north positive.
    pub latitude_deg: f64,
    /// Geodetic longitude, deg, east positive.
    pub longitude_deg: f64,
    /// Altitude above mean sea level, m.
    pub altitude_m: f64,
    /// Density of the air, kg/m³.
    pub air_density_kgpm3: f64,
    /// Static pressure of the air, Pa.
    pub static_pressure_pa: f64,
    /// Deflection of the aileron, rad; positive rolls right.
    pub aileron_rad: f64,
    /// Aileron rate, rad/s: the change of the deflection over the last step, divided by the step.
    pub aileron_rate_radps: f64,
    /// Deflection of the elevator, rad; positive pitches down.
    pub elevator_rad: f64,
    /// Elevator rate, rad/s: the change of the deflection over the last step, divided by the step.
    pub elevator_rate_radps: f64,
    /// Position of the throttle, 0..1.
    pub throttle: f64,
    /// Deflection of the rudder, rad; positive yaws left; 0 for an aircraft without a rudder.
    pub rudder_rad: f64,
    /// Rudder rate, rad/s: the change of the deflection over the last step, divided by the step.
    pub rudder_rate_radps: f64,
    /// Thrust along the body x axis, N, including hidden effects on the thrust.
    pub thrust_n: f64,
}

impl Truth {
    pub(super) fn first_non_finite(&self) -> Option<&'static str> {
        [
            ("attitude", self.roll_rad + self.pitch_rad + self.yaw_rad),
            ("rotation rate", self.p_radps + self.q_radps + self.r_radps),
            ("airspeed", self.airspeed_mps),
            ("flow angle", self.alpha_rad + self.beta_rad),
            ("specific force", self.specific_force_mps2.iter().sum()),
            ("velocity", self.velocity_ned_mps.iter().sum()),
            ("position", self.latitude_deg + self.longitude_deg + self.altitude_m),
            ("air", self.air_density_kgpm3 + self.static_pressure_pa),
            ("actuator", self.aileron_rad + self.elevator_rad + self.throttle + self.rudder_rad),
            ("thrust", self.thrust_n),
        ]
        .into_iter()
        .find_map(|(name, value)| (!value.is_finite()).then_some(name))
    }
}
