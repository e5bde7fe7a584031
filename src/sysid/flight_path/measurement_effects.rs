//! Errors of the measurement that look like missing physics, as entries of the catalogue of effects.
//!
//! They are decided by the reconstruction of the flight path, before any aerodynamics: their
//! parameters are its [nuisances](crate::flight_path), under the same names.

use greylag_physics::effects::{Coefficient, Description, Entry, coefficient};

/// Source of the formulas of sensor errors that act on the path.
const PATH: &str = "kinematics of a rigid body, which hold no aerodynamics; Klein and Morelli, Aircraft System \
                    Identification, section 10.2";

/// Every measurement effect there is.
pub const MEASUREMENT_EFFECTS: [Description; 6] = [
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
        description: "The angle-of-attack vane stands askew.",
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
        description: "The sideslip vane stands askew.",
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
        description: "Gyros or accelerometers show a constant beside what they measure; that of a gyro drifts.",
        formula: "ω_measured = ω + b_ω + d_ω (t − t_middle), f_measured = f + b_f",
        source: PATH,
        coefficients: &IMU,
        ..measured(&Entry {
            channels: &[],
            look_alikes: &["propeller_gyro", "asymmetry", "external_load", "thrust_scale"],
            separated_by: "steady flight on several headings and banks, and a stand still before take-off",
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
            separated_by: "fast rolls and pull-ups: kinematics tell the skew without the surfaces",
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

const SKEW: [Coefficient; 5] = [
    coefficient("skew_attitude", "delay of the attitude behind the gyros", "s", (-0.1, 0.1)),
    coefficient("skew_accelerometer", "delay of the accelerometers", "s", (-0.1, 0.1)),
    coefficient("skew_airspeed", "delay of the airspeed", "s", (-0.1, 0.1)),
    coefficient("skew_vanes", "delay of the vanes", "s", (-0.1, 0.1)),
    coefficient("skew_velocity", "delay of the velocity over ground", "s", (-0.1, 0.1)),
];

/// What all of them share: no shape constants, no table.
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

    /// The reconstruction estimates exactly these constants, under these names and in these units;
    /// the Earth's rate, known from the latitude, is no error of a sensor.
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
