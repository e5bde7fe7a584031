//! The variables that a formula of an effect file may contain, one line per variable.

use super::dimension::Dimension;
use crate::effects::Needs;
use crate::{Channel, Point};
use greylag_num::Real;

const ANGLE: Dimension = Dimension::NONE;
const RATE: Dimension = Dimension::new(0, 0, -1);
const SPEED: Dimension = Dimension::new(0, 1, -1);
const LENGTH: Dimension = Dimension::new(0, 1, 0);
const AREA: Dimension = Dimension::new(0, 2, 0);
const PRESSURE: Dimension = Dimension::new(1, -1, -2);

macro_rules! variables {
    ($($id:ident $name:literal $alias:literal $dimension:ident $low:literal $high:literal $needs:ident $meaning:literal
       => |$at:ident| $value:expr;)*) => {
        /// A variable of a formula.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Variable { $(#[doc = $meaning] $id,)* }

        impl Variable {
            /// All variables, in the order of the list in this file.
            pub const ALL: &'static [Variable] = &[$(Variable::$id),*];

            /// Name in a formula.
            pub const fn name(self) -> &'static str {
                match self { $(Variable::$id => $name,)* }
            }

            /// Alternative name in a formula.
            pub const fn alias(self) -> &'static str {
                match self { $(Variable::$id => $alias,)* }
            }

            /// Meaning, with its unit.
            pub const fn meaning(self) -> &'static str {
                match self { $(Variable::$id => $meaning,)* }
            }

            /// Dimension of the variable.
            pub const fn dimension(self) -> Dimension {
                match self { $(Variable::$id => $dimension,)* }
            }

            /// Range in which formulas are tested for finite values, in the variable's unit.
            pub const fn range(self) -> [f64; 2] {
                match self { $(Variable::$id => [$low, $high],)* }
            }

            /// Data needed to evaluate the variable.
            pub const fn needs(self) -> Needs {
                match self { $(Variable::$id => Needs::$needs,)* }
            }

            /// Value at the point `at`, in SI units.
            #[inline(always)]
            pub fn value<R: Real>(self, at: &Point<R>) -> R {
                match self { $(Variable::$id => { let $at = at; $value })* }
            }
        }
    };
}

variables! {
    Roll "roll" "phi" ANGLE -1.5 1.5 Point "roll angle, rad" => |at| at.state.roll;
    Pitch "pitch" "theta" ANGLE -1.2 1.2 Point "pitch angle, rad" => |at| at.state.pitch;
    Airspeed "airspeed" "V" SPEED 5.0 60.0 Point "true airspeed, m/s" => |at| at.state.airspeed;
    RollRate "p" "roll_rate" RATE -6.0 6.0 Point "roll rate, rad/s" => |at| at.state.p;
    PitchRate "q" "pitch_rate" RATE -4.0 4.0 Point "pitch rate, rad/s" => |at| at.state.q;
    YawRate "r" "yaw_rate" RATE -4.0 4.0 Point "yaw rate, rad/s" => |at| at.state.r;
    Alpha "alpha" "α" ANGLE -0.6 1.0 Point "angle of attack, rad" => |at| at.state.alpha;
    Beta "beta" "β" ANGLE -0.6 0.6 Point "sideslip angle, rad" => |at| at.state.beta;
    Aileron "aileron" "δa" ANGLE -0.6 0.6 Point "aileron deflection, rad" => |at| at.controls.aileron;
    Elevator "elevator" "δe" ANGLE -0.6 0.6 Point "elevator deflection, rad, positive down" => |at| at.controls.elevator;
    Rudder "rudder" "δr" ANGLE -0.6 0.6 Point "rudder deflection, rad, positive yaws left" => |at| at.controls.rudder;
    Throttle "throttle" "δt" ANGLE 0.0 1.0 Point "throttle position, 0 to 1" => |at| at.controls.throttle;
    RollRateHat "p_hat" "pb_2V" ANGLE -0.5 0.5 Point "roll rate as bp/2V" => |at| at.air.p_hat;
    PitchRateHat "q_hat" "qc_2V" ANGLE -0.1 0.1 Point "pitch rate as cq/2V" => |at| at.air.q_hat;
    YawRateHat "r_hat" "rb_2V" ANGLE -0.3 0.3 Point "yaw rate as br/2V" => |at| at.air.r_hat;
    Pressure "qbar" "dynamic_pressure" PRESSURE 15.0 2500.0 Point "dynamic pressure, Pa" => |at| at.air.q_s.scale(1.0 / at.geometry.area);
    PressureArea "qbar_S" "Q" FORCE 2.0 12500.0 Point "dynamic pressure times wing area, N" => |at| at.air.q_s;
    Altitude "altitude" "h" LENGTH -100.0 5000.0 Point "altitude above mean sea level, m" => |at| R::from_f64(at.air.altitude);
    Area "S" "wing_area" AREA 0.1 5.0 Point "wing area, m²" => |at| R::from_f64(at.geometry.area);
    Span "b" "span" LENGTH 0.5 6.0 Point "span, m" => |at| R::from_f64(at.geometry.span);
    Chord "c" "chord" LENGTH 0.1 1.5 Point "mean chord, m" => |at| R::from_f64(at.geometry.chord);
    Thrust "thrust" "T" FORCE -20.0 200.0 Base "thrust of the effects of the catalogue, N" => |at| at.base.wrench.get(Channel::BodyX);
    Lift "lift" "L" FORCE -300.0 600.0 Base "lift of the effects of the catalogue, N" => |at| at.base.wrench.get(Channel::Lift);
    AlphaRate "alpha_dot" "alpha_rate" RATE -6.0 6.0 Rate "rate of the angle of attack, rad/s" => |at| at.base.rate.alpha;
    BetaRate "beta_dot" "beta_rate" RATE -6.0 6.0 Rate "rate of the sideslip angle, rad/s" => |at| at.base.rate.beta;
}

const FORCE: Dimension = Dimension::FORCE;

impl Variable {
    /// The variable with the name or alternative name `name`. `None` if there is no such variable.
    pub fn from_name(name: &str) -> Option<Variable> {
        Variable::ALL.iter().copied().find(|v| v.name() == name || v.alias() == name)
    }
}
