//! Forces and moments on the airframe, one value per channel.

use greylag_num::Real;

/// A force or moment component in which an effect may act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Drag along the airflow, N, positive backwards, without thrust (see `BodyX`). The channel `ChannelId::Drag` of a
    /// comparison is drag minus thrust.
    Drag,
    /// Lift across the airflow, N, positive upward.
    Lift,
    /// Aerodynamic side force, N, positive to the right.
    Side,
    /// Force along body x that does not turn with the airflow (thrust), N, positive forward.
    BodyX,
    /// Rolling moment l about body x, N m.
    Roll,
    /// Pitching moment m about body y, N m.
    Pitch,
    /// Yawing moment n about body z, N m.
    Yaw,
}

impl Channel {
    /// All channels, in the order of [`Wrench`].
    pub const ALL: [Channel; 7] = [
        Channel::Drag,
        Channel::Lift,
        Channel::Side,
        Channel::BodyX,
        Channel::Roll,
        Channel::Pitch,
        Channel::Yaw,
    ];
}

/// Forces (N) and moments about the centre of gravity (N m), one value per [`Channel`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench<R = f64>([R; 7]);

impl<R: Real> Wrench<R> {
    /// The wrench without forces and moments.
    #[inline(always)]
    pub fn zero() -> Self {
        Wrench([R::zero(); 7])
    }
    /// Adds `amount` (N or N m) to a channel.
    #[inline(always)]
    pub fn add(&mut self, channel: Channel, amount: R) {
        self.0[channel as usize] += amount;
    }
    /// The value (N or N m) in a channel.
    #[inline(always)]
    pub fn get(&self, channel: Channel) -> R {
        self.0[channel as usize]
    }
    /// The difference `self` − `other` in each channel.
    #[inline(always)]
    pub fn minus(&self, other: &Self) -> Self {
        let mut difference = *self;
        for (a, b) in difference.0.iter_mut().zip(&other.0) {
            *a -= *b;
        }
        difference
    }
}
