//! Message streams of the simulated controller; most are off until a companion requests them.

use crate::plant::{Travel, Truth};
use crate::shim::codec::{AoaSsa, Encoder, ServoOutputRaw, VfrHud};
use crate::shim::telemetry::{self, FRAME_US, StateFrame};

/// Sea-level density of the standard atmosphere, kg/m³.
const SEA_LEVEL: f64 = 1.225;

/// Longest period of a stream, µs: the largest that MESSAGE_INTERVAL can report.
const LONGEST_US: f64 = i32::MAX as f64;

/// Command result MAV_RESULT_DENIED.
pub(super) const DENIED: u8 = 2;

/// A stream with its period and the time of its next message, µs; `None` for a stream that is off.
#[derive(Clone, Copy, Debug)]
struct Row {
    id: u32,
    interval_us: Option<u64>,
    due_us: u64,
}

/// Equipment of the aircraft that the messages report.
#[derive(Clone, Copy, Debug)]
pub(super) struct Equipment {
    /// Travel of the surfaces.
    pub travel: Travel,
    /// MAV_SYS_STATUS_SENSOR bits of the RC receiver; 0 if no RC transmitter is bound.
    pub receiver: u32,
}

/// The streams, in the order in which they are sent.
#[derive(Clone, Debug)]
pub(super) struct Streams {
    rows: [Row; 8],
    equipment: Equipment,
    last_us: u64,
}

impl Streams {
    /// The streams of an aircraft with `equipment`, at the default rates.
    pub(super) fn new(equipment: Equipment) -> Self {
        let row = |id, interval_us| Row { id, interval_us, due_us: 0 };
        // Default rates of a telemetry port.
        let rows = [
            row(31, None),
            row(105, None),
            row(74, Some(250_000)),
            row(11020, None),
            row(36, None),
            row(33, Some(500_000)),
            row(231, None),
            row(1, Some(1_000_000)),
        ];
        Streams { rows, equipment, last_us: 0 }
    }

    /// Sets a stream and returns the MAV_RESULT of SET_MESSAGE_INTERVAL. A rate above the step rate is limited to the step rate,
    /// as in PX4. A rate above `denied_hz`, Hz, is denied and changes nothing, as in ArduPilot.
    pub(super) fn set(&mut self, id: u32, interval_us: f32, denied_hz: f64) -> u8 {
        let Some(row) = self.rows.iter_mut().find(|row| row.id == id) else {
            // MAV_RESULT_UNSUPPORTED.
            return 3;
        };
        // The tolerance of 1 µs covers rounding.
        if interval_us > 0.0 && f64::from(interval_us) + 1.0 < 1e6 / denied_hz {
            return DENIED;
        }
        row.interval_us = match interval_us {
            us if us > 0.0 => Some(f64::from(us).clamp(FRAME_US as f64, LONGEST_US) as u64),
            _ => None,
        };
        0
    }

    /// Whether the message can be sent as a stream.
    pub(super) fn knows(&self, id: u32) -> bool {
        self.rows.iter().any(|row| row.id == id)
    }

    /// Period of a stream, µs; −1 if it is off, 0 if the controller does not have it.
    pub(super) fn interval_us(&self, id: u32) -> i32 {
        let row = self.rows.iter().find(|row| row.id == id);
        row.map_or(0, |row| row.interval_us.map_or(-1, |us| us as i32))
    }

    /// Appends one message, independent of its stream.
    pub(super) fn send_once(
        &self,
        id: u32,
        now: u64,
        measured: &Truth,
        home_m: f64,
        encoder: &mut Encoder,
        out: &mut Vec<u8>,
    ) {
        if self.knows(id) {
            encode(id, now, measured, home_m, self.equipment, encoder, out);
        }
    }

    /// Appends the messages that are due.
    pub(super) fn send(
        &mut self,
        frame: &StateFrame,
        measured: &Truth,
        home_m: f64,
        encoder: &mut Encoder,
        out: &mut Vec<u8>,
    ) {
        let now = frame.time_us;
        if now + FRAME_US < self.last_us {
            // The clock has been set back.
            self.rows.iter_mut().for_each(|row| row.due_us = now);
        }
        self.last_us = now;
        for row in &mut self.rows {
            let Some(interval) = row.interval_us.filter(|_| now >= row.due_us) else { continue };
            row.due_us = (row.due_us + interval).max(now.saturating_sub(interval) + 1);
            encode(row.id, now, measured, home_m, self.equipment, encoder, out);
        }
    }
}

fn encode(
    id: u32,
    now: u64,
    measured: &Truth,
    home_m: f64,
    equipment: Equipment,
    encoder: &mut Encoder,
    out: &mut Vec<u8>,
) {
    match id {
        31 => encoder.encode(&telemetry::attitude(now, measured), out),
        105 => encoder.encode(&telemetry::imu(now, measured), out),
        74 => encoder.encode(&hud(measured), out),
        11020 => encoder.encode(
            &AoaSsa {
                time_usec: now,
                aoa: measured.alpha_rad.to_degrees() as f32,
                ssa: measured.beta_rad.to_degrees() as f32,
            },
            out,
        ),
        36 => encoder.encode(&servos(now, measured, equipment.travel), out),
        33 => encoder.encode(&telemetry::position(now, measured, home_m), out),
        231 => encoder.encode(&telemetry::wind(now, measured), out),
        _ => {
            let mut health = telemetry::health();
            health.onboard_control_sensors_present |= equipment.receiver;
            health.onboard_control_sensors_enabled |= equipment.receiver;
            health.onboard_control_sensors_health |= equipment.receiver;
            encoder.encode(&health, out);
        }
    }
}

/// VFR_HUD with the equivalent airspeed, as both stacks send it.
fn hud(measured: &Truth) -> VfrHud {
    let equivalent = measured.airspeed_mps * (measured.air_density_kgpm3 / SEA_LEVEL).sqrt();
    VfrHud { airspeed: equivalent as f32, ..telemetry::hud(measured) }
}

fn servos(now: u64, measured: &Truth, travel: Travel) -> ServoOutputRaw {
    let surface = |rad: f64, full_rad: f64| (1500.0 + 500.0 * rad / full_rad).round() as u16;
    let mut servo = [0; 8];
    servo[0] = surface(measured.aileron_rad, travel.aileron.largest_rad());
    servo[1] = surface(measured.elevator_rad, travel.elevator.largest_rad());
    servo[2] = (1000.0 + 1000.0 * measured.throttle).round() as u16;
    ServoOutputRaw { time_usec: now as u32, servo, ..ServoOutputRaw::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_without_end_is_limited_to_what_can_be_reported() {
        let mut streams = Streams::new(Equipment { travel: Travel::X8, receiver: 0 });
        let (mut encoder, mut out) = (Encoder::new(1, 1), Vec::new());
        let mut send = |streams: &mut Streams, time_us: u64| {
            let truth =
                Truth { static_pressure_pa: 1e5, air_density_kgpm3: 1.2, ..Truth::default() };
            let frame = StateFrame::new(time_us, &truth, Travel::X8);
            out.clear();
            streams.send(&frame, &truth, 0.0, &mut encoder, &mut out);
            out.len()
        };
        assert!(send(&mut streams, 10_000_000) > 0);
        assert_eq!(streams.set(74, f32::INFINITY, f64::INFINITY), 0);
        assert_eq!(streams.interval_us(74), i32::MAX);
        assert!(send(&mut streams, 20_000_000) > 0);
    }
}
