//! Forces and moments on the airframe, by channel.

use greylag_num::Real;

/// A direction in which an effect may act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Drag alone, N, along the airflow, positive backwards; thrust is in `BodyX`. `ChannelId::Drag` of the weak form
    /// is drag less thrust.
    Drag,
    /// Lift, N, upward across the airflow.
    Lift,
    /// Aerodynamic side force, N, to the right.
    Side,
    /// Force along body x that does not turn with the airflow (thrust), N.
    BodyX,
    /// Rolling moment l, N m.
    Roll,
    /// Pitching moment m, N m.
    Pitch,
    /// Yawing moment n, N m.
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

/// Forces in N, moments in N m about the centre of gravity, one per [`Channel`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench<R = f64>([R; 7]);

impl<R: Real> Wrench<R> {
    /// No force, no moment.
    #[inline(always)]
    pub fn zero() -> Self {
        Wrench([R::zero(); 7])
    }
    /// Adds `amount` to one channel.
    #[inline(always)]
    pub fn add(&mut self, channel: Channel, amount: R) {
        self.0[channel as usize] += amount;
    }
    /// The amount in one channel.
    #[inline(always)]
    pub fn get(&self, channel: Channel) -> R {
        self.0[channel as usize]
    }
    /// The difference `self` − `other`, by channel.
    #[inline(always)]
    pub fn minus(&self, other: &Self) -> Self {
        let mut difference = *self;
        for (a, b) in difference.0.iter_mut().zip(&other.0) {
            *a -= *b;
        }
        difference
    }
}
