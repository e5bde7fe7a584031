//! Sensor model: converts the plant's truth to measurements of the flight controller.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::options::{Bias, Noise};
use crate::plant::Truth;

/// Number of the random stream for the sensors; frame faults use other streams.
const STREAM: u64 = 1;

/// Sensors with constant errors and white noise.
#[derive(Clone, Debug)]
pub struct Sensors {
    noise: Noise,
    bias: Bias,
    random: ChaCha8Rng,
}

impl Sensors {
    /// Sensors with noise that depends only on `seed`.
    pub fn new(noise: Noise, bias: Bias, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STREAM);
        Sensors { noise, bias, random }
    }

    /// Measurement of `truth`: scale error, then bias, then noise.
    ///
    /// The number of random draws does not depend on the options. A change of one sensor's noise therefore leaves the noise of
    /// the others unchanged.
    pub fn measure(&mut self, truth: &Truth) -> Truth {
        let (noise, bias) = (self.noise, self.bias);
        let mut draw = |deviation: f64| {
            let unit: f64 = StandardNormal.sample(&mut self.random);
            deviation * unit
        };
        let mut rates = [truth.p_radps, truth.q_radps, truth.r_radps];
        let mut force = truth.specific_force_mps2;
        for axis in 0..3 {
            rates[axis] += bias.gyro_radps[axis] + draw(noise.gyro_radps);
            force[axis] += bias.accelerometer_mps2[axis] + draw(noise.accelerometer_mps2);
        }
        Truth {
            p_radps: rates[0],
            q_radps: rates[1],
            r_radps: rates[2],
            specific_force_mps2: force,
            roll_rad: truth.roll_rad + bias.attitude_rad[0] + draw(noise.attitude_rad),
            pitch_rad: truth.pitch_rad + bias.attitude_rad[1] + draw(noise.attitude_rad),
            yaw_rad: truth.yaw_rad + bias.attitude_rad[2] + draw(noise.attitude_rad),
            airspeed_mps: truth.airspeed_mps * bias.airspeed_scale + draw(noise.airspeed_mps),
            alpha_rad: truth.alpha_rad + bias.alpha_rad + draw(noise.vane_rad),
            beta_rad: truth.beta_rad + bias.beta_rad + draw(noise.vane_rad),
            altitude_m: truth.altitude_m + draw(noise.altitude_m),
            ..*truth
        }
    }
}
