//! Catalogue entries for measurement errors, and for wind, that may look like an effect (a physical contribution to forces and
//! moments) that a model lacks. The catalogue lists what may explain the errors of a model.
//!
//! The flight-path reconstruction estimates these errors from kinematics alone, without aerodynamics. The coefficients of the
//! entries are the [constants](crate::flight_path) that it estimates, with the same names.

use greylag_physics::effects::{Coefficient, Description, Entry, coefficient};

/// Source of the formulas that follow from kinematics.
const PATH: &str = "kinematics of a rigid body, which hold no aerodynamics; Klein and Morelli, Aircraft System \
                    Identification, section 10.2";

/// Descriptions of all measurement effects.
pub const MEASUREMENT_EFFECTS: [Description; 11] = [
    Description {
        id: "steady_wind",
        description: "The air moves over the ground.",
        formula: "v_ground = v_air + w, north-east-down",
        source: PATH,
        coefficients: &[
            coefficient("wind_north", "velocity of the air to the north", "m/s", (-50.0, 50.0)),
            coefficient("wind_east", "velocity of the air to the east", "m/s", (-50.0, 50.0)),
            coefficient("wind_down", "velocity of the air downward", "m/s", (-10.0, 10.0)),
        ],
        ..measured(&Entry {
            channels: &[],
            look_alikes: &["airspeed_scale", "alpha_bias", "beta_bias"],
            separated_by: "a full turn: over the ground its sign changes with the heading",
            example: &[],
            starts: &[],
        })
    },
    Description {
        id: "alpha_bias",
        description: "The angle-of-attack vane is misaligned.",
        formula: "α_measured = α + b",
        source: PATH,
        coefficients: &[coefficient("alpha_bias", "measured less true", "rad", (-0.3, 0.3))],
        ..measured(&Entry {
            channels: &[],
            look_alikes: &["steady_wind", "lift_linear.CL0", "pitch_linear.Cm0"],
            separated_by: "level flight at several airspeeds, upwind and downwind",
            example: &[],
            starts: &[],
        })
    },
    Description {
        id: "beta_bias",
        description: "The sideslip vane is misaligned.",
        formula: "β_measured = β + b",
        source: PATH,
        coefficients: &[coefficient("beta_bias", "measured less true", "rad", (-0.3, 0.3))],
        ..measured(&Entry {
            channels: &[],
            look_alikes: &["asymmetry", "steady_wind"],
            separated_by: "straight flight on two opposite headings, and turns to both sides",
            example: &[],
            starts: &[],
        })
    },
    Description {
        id: "airspeed_scale",
        description: "The airspeed reads too high or too low by a share.",
        formula: "V_measured = (1 + s) V",
        source: PATH,
        coefficients: &[coefficient("airspeed_scale", "measured by true, less 1", "", (-0.5, 0.5))],
        ..measured(&Entry {
            channels: &[],
            look_alikes: &["steady_wind", "air_density"],
            separated_by: "several headings with the velocity over ground logged",
            example: &[],
            starts: &[],
        })
    },
    Description {
        id: "imu_bias",
        description: "Gyros or accelerometers have a constant bias; that of a gyro drifts.",
        formula: "ω_measured = ω + b_ω + d_ω (t − t_middle), f_measured = f + b_f",
        source: PATH,
        coefficients: &IMU,
        ..measured(&Entry {
            channels: &[],
            look_alikes: &["propeller_gyro", "asymmetry", "external_load", "thrust_scale"],
            separated_by: "steady flight on several headings and banks, and a standstill before take-off",
            example: &[],
            starts: &[],
        })
    },
    Description {
        id: "vane_gain",
        description: "A vane turns more or less than the flow: upwash of the wing or the body, or its calibration.",
        formula: "α_measured = (1 + g) α + b",
        source: PATH,
        coefficients: &[
            coefficient("alpha_gain", "measured by true, less 1, of α", "", (-0.5, 0.5)),
            coefficient("beta_gain", "measured by true, less 1, of β", "", (-0.5, 0.5)),
        ],
        ..measured(&Entry {
            channels: &[],
            look_alikes: &["lift_linear.CLalpha", "drag_alpha2", "pitch_linear.Cmalpha"],
            separated_by: "slow flight and pull-ups with the velocity over ground logged",
            example: &[],
            starts: &[],
        })
    },
    Description {
        id: "imu_gain",
        description: "Gyros or accelerometers show more or less than there is, by a share.",
        formula: "ω_measured = (1 + g) (ω + b), f_measured = (1 + g) (f + b)",
        source: PATH,
        coefficients: &GAINS,
        ..measured(&Entry {
            channels: &[],
            look_alikes: &["mass_error", "inertia_xz", "roll_linear.Clp", "pitch_linear.Cmq"],
            separated_by: "steep banks held and fast rolls with attitude and velocity over ground logged",
            example: &[],
            starts: &[],
        })
    },
    Description {
        id: "airspeed_offset",
        description: "The airspeed reads too high or too low by a constant.",
        formula: "V_measured = (1 + s) V + b",
        source: PATH,
        coefficients: &[coefficient("airspeed_offset", "measured less true", "m/s", (-10.0, 10.0))],
        ..measured(&Entry {
            channels: &[],
            look_alikes: &["airspeed_scale", "steady_wind"],
            separated_by: "slow and fast flight on several headings with the velocity over ground logged",
            example: &[],
            starts: &[],
        })
    },
    Description {
        id: "heading_offset",
        description: "The measured heading is misaligned with the velocity over ground.",
        formula: "ψ_measured = ψ + b",
        source: PATH,
        coefficients: &[coefficient("heading_offset", "measured less true", "rad", (-0.5, 0.5))],
        ..measured(&Entry {
            channels: &[],
            look_alikes: &["steady_wind", "beta_bias", "asymmetry"],
            separated_by: "turns to both sides through all headings",
            example: &[],
            starts: &[],
        })
    },
    Description {
        id: "vanes_askew",
        description: "The vanes and the board with gyros and accelerometers are rolled against each other.",
        formula: "x_board = x + g (0, z, −y), for x = (x, y, z) in the axes of the vanes",
        source: PATH,
        coefficients: &[coefficient(
            "board_roll",
            "rotation about the forward axis from the vanes to the board",
            "rad",
            (-0.5, 0.5),
        )],
        ..measured(&Entry {
            channels: &[],
            look_alikes: &["vane_gain", "inertia_xz", "asymmetry"],
            separated_by: "sideslips and pull-ups with both vanes and the velocity over ground logged",
            example: &[],
            starts: &[],
        })
    },
    Description {
        id: "clock_skew",
        description: "A group of sensors is logged late.",
        formula: "x_measured(t) = x(t − T), a T for each group; the gyros set the clock",
        source: "one clock per group of sensors; 5 ms of it look like a delay of the surfaces",
        coefficients: &SKEW,
        ..measured(&Entry {
            channels: &[],
            look_alikes: &["time_delay", "actuator_lag", "unsteady_lift"],
            separated_by: "fast rolls and pull-ups: kinematics determine the skew without the surfaces",
            example: &[],
            starts: &[],
        })
    },
];

const IMU: [Coefficient; 9] = [
    coefficient("gyro_bias_p", "of the roll gyro", "rad/s", (-0.5, 0.5)),
    coefficient("gyro_bias_q", "of the pitch gyro", "rad/s", (-0.5, 0.5)),
    coefficient("gyro_bias_r", "of the yaw gyro", "rad/s", (-0.5, 0.5)),
    coefficient(
        "gyro_drift_p",
        "change of the roll gyro's bias with time",
        "rad/s²",
        (-1e-3, 1e-3),
    ),
    coefficient(
        "gyro_drift_q",
        "change of the pitch gyro's bias with time",
        "rad/s²",
        (-1e-3, 1e-3),
    ),
    coefficient("gyro_drift_r", "change of the yaw gyro's bias with time", "rad/s²", (-1e-3, 1e-3)),
    coefficient("accelerometer_bias_x", "of the forward accelerometer", "m/s²", (-5.0, 5.0)),
    coefficient("accelerometer_bias_y", "of the rightward accelerometer", "m/s²", (-5.0, 5.0)),
    coefficient("accelerometer_bias_z", "of the downward accelerometer", "m/s²", (-5.0, 5.0)),
];

const GAINS: [Coefficient; 6] = [
    coefficient("gyro_gain_p", "of the roll gyro, less 1", "", (-0.5, 0.5)),
    coefficient("gyro_gain_q", "of the pitch gyro, less 1", "", (-0.5, 0.5)),
    coefficient("gyro_gain_r", "of the yaw gyro, less 1", "", (-0.5, 0.5)),
    coefficient("accelerometer_gain_x", "of the forward accelerometer, less 1", "", (-0.5, 0.5)),
    coefficient("accelerometer_gain_y", "of the rightward accelerometer, less 1", "", (-0.5, 0.5)),
    coefficient("accelerometer_gain_z", "of the downward accelerometer, less 1", "", (-0.5, 0.5)),
];

const SKEW: [Coefficient; 5] = [
    coefficient("skew_attitude", "delay of the attitude behind the gyros", "s", (-2.0, 2.0)),
    coefficient("skew_accelerometer", "delay of the accelerometers", "s", (-2.0, 2.0)),
    coefficient("skew_airspeed", "delay of the airspeed", "s", (-2.0, 2.0)),
    coefficient("skew_vanes", "delay of the vanes", "s", (-2.0, 2.0)),
    coefficient("skew_velocity", "delay of the velocity over ground", "s", (-2.0, 2.0)),
];

/// A description with the catalogue entry `entry` and without nonlinear coefficients or tables. The other fields are empty.
const fn measured(entry: &Entry) -> Description {
    Description {
        id: "",
        description: "",
        formula: "",
        source: "",
        coefficients: &[],
        shape: 0,
        table: None,
        grid: None,
        replaces: &[],
        entry: Some(*entry),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight_path::nuisance;

    /// The reconstruction estimates exactly these constants, with these names and units. The Earth's rate is not among them,
    /// because it is not a sensor error.
    #[test]
    fn parameters_are_the_nuisances_of_the_reconstruction() {
        let mut ours: Vec<_> = MEASUREMENT_EFFECTS
            .iter()
            .flat_map(|about| about.coefficients)
            .map(|c| (c.name, c.unit))
            .collect();
        let mut theirs: Vec<_> = nuisance::NAMES[..nuisance::BEND].to_vec();
        ours.sort_unstable();
        theirs.sort_unstable();
        assert_eq!(ours, theirs);
    }
}
