//! Flight modes of the simulated stacks and their mode numbers.

use super::Personality;
use crate::shim::codec::AvailableModes;

/// A flight mode, named by its behaviour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// The sticks move the surfaces: MANUAL.
    Manual,
    /// The controller follows attitude targets: OFFBOARD, GUIDED.
    Guided,
    /// The controller flies autonomously: HOLD, LOITER.
    Hold,
    /// Return mode after a failsafe: RTL. The simulation flies level instead of returning.
    Return,
    /// ArduPilot's short failsafe: CIRCLE. The simulation flies level instead. PX4 never enters this mode.
    Circle,
}

impl Mode {
    /// The modes that a companion can request.
    pub(super) const ALL: [Mode; 4] = [Mode::Manual, Mode::Guided, Mode::Hold, Mode::Return];

    /// Main mode and sub-mode, as numbered by the stack.
    fn numbers(self, personality: Personality) -> (u32, u32) {
        match (personality, self) {
            (Personality::Px4, Mode::Manual) => (1, 0),
            (Personality::Px4, Mode::Guided) => (6, 0),
            (Personality::Px4, Mode::Hold | Mode::Circle) => (4, 3),
            (Personality::Px4, Mode::Return) => (4, 5),
            (Personality::Ardupilot, Mode::Manual) => (0, 0),
            (Personality::Ardupilot, Mode::Guided) => (15, 0),
            (Personality::Ardupilot, Mode::Hold) => (12, 0),
            (Personality::Ardupilot, Mode::Return) => (11, 0),
            (Personality::Ardupilot, Mode::Circle) => (1, 0),
        }
    }

    /// Value of `custom_mode` in HEARTBEAT.
    pub(super) fn number(self, personality: Personality) -> u32 {
        let (main, sub) = self.numbers(personality);
        match personality {
            Personality::Px4 => main << 16 | sub << 24,
            Personality::Ardupilot => main,
        }
    }

    /// AVAILABLE_MODES for this mode, which has the index `at`, from 0.
    pub(super) fn available(self, personality: Personality, at: usize) -> AvailableModes {
        let (name, standard_mode) = match (personality, self) {
            (_, Mode::Manual) => ("Manual", 0),
            (Personality::Px4, Mode::Guided) => ("Offboard", 0),
            (Personality::Ardupilot, Mode::Guided) => ("Guided", 0),
            (Personality::Px4, Mode::Hold) => ("Hold", 0),
            (Personality::Ardupilot, Mode::Hold) => ("Loiter", 0),
            (_, Mode::Circle) => ("Circle", 0),
            // MAV_STANDARD_MODE_SAFE_RECOVERY.
            (_, Mode::Return) => ("Return", 5),
        };
        let mut mode_name = [0; 32];
        mode_name[..name.len()].copy_from_slice(name.as_bytes());
        AvailableModes {
            custom_mode: self.number(personality),
            properties: 0,
            number_modes: Mode::ALL.len() as u8,
            mode_index: at as u8 + 1,
            standard_mode,
            mode_name,
            more: [0; 3],
        }
    }

    /// The mode that DO_SET_MODE requests; `None` if the stack has no such mode.
    pub(super) fn of(personality: Personality, main: f32, sub: f32) -> Option<Mode> {
        Mode::ALL.into_iter().find(|mode| {
            let (own_main, own_sub) = mode.numbers(personality);
            let sub_fits = personality == Personality::Ardupilot || sub == own_sub as f32;
            main == own_main as f32 && sub_fits
        })
    }
}
