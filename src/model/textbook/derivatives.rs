//! Aerodynamic and thrust coefficients from textbook formulas. Each [`Estimate`] is a name, a value, a relative standard
//! deviation and a source.

use super::{Estimate, Figures, Measures, Tail, helmbold};

/// Tailplane: volume coefficient, tail arm in chords, efficiency, elevator effectiveness.
const TAIL: [f64; 4] = [0.5, 2.8, 0.95, 0.5];
/// Fin: volume coefficient, tail arm in spans, lift slope (1/rad), rudder effectiveness.
const FIN: [f64; 4] = [0.04, 0.4, 3.0, 0.55];
/// Oswald efficiency factor of the wing.
const EFFICIENCY: f64 = 0.85;

impl Measures {
    /// Returns `conventional` or `flying_wing`, depending on the tail of the aircraft.
    fn source(&self, conventional: &'static str, flying_wing: &'static str) -> &'static str {
        match self.tail {
            Tail::Conventional => conventional,
            Tail::FlyingWing => flying_wing,
        }
    }

    /// Lift slope of wing and tailplane, 1/rad.
    pub(super) fn slope(&self, f: &Figures) -> f64 {
        match self.tail {
            Tail::FlyingWing => f.wing,
            Tail::Conventional => f.wing + tailplane() * TAIL[0] / TAIL[1] * (1.0 - downwash(f)),
        }
    }

    /// Lift and pitching moment derivatives with respect to the elevator, 1/rad.
    fn elevator(&self, f: &Figures) -> [f64; 2] {
        match self.tail {
            Tail::Conventional => {
                let lift = tailplane() * TAIL[3] * TAIL[0] / TAIL[1];
                [lift, -lift * TAIL[1]]
            }
            Tail::FlyingWing => [0.07 * f.wing, -0.8 * 0.07 * f.wing],
        }
    }

    pub(super) fn zero_lift(&self) -> f64 {
        if self.tail == Tail::Conventional { 0.25 } else { 0.08 }
    }

    pub(super) fn lift(&self, f: &Figures) -> Vec<Estimate> {
        let rate = match self.tail {
            Tail::Conventional => 2.0 * tailplane() * TAIL[0],
            Tail::FlyingWing => 0.9 * f.wing,
        };
        let slope = self.source("Helmbold, with downwash at the tailplane", "Helmbold");
        let damping = self.source("Etkin and Reid 5.4", "estimate: 0.9 of the wing's lift slope");
        let elevator = self.source(
            "tail volume 0.5, elevator effectiveness 0.5",
            "elevons: 0.07 of the wing's lift slope, scaled to published small aircraft",
        );
        vec![
            ("CL0", self.zero_lift(), 0.5, "estimate: camber and incidence of the wing"),
            ("CLalpha", self.slope(f), 0.1, slope),
            ("CLq", rate, 0.5, damping),
            ("CLde", self.elevator(f)[0], 0.5, elevator),
        ]
    }

    pub(super) fn drag(&self, f: &Figures) -> Vec<Estimate> {
        let (base, zero) = (0.03, self.zero_lift());
        let k = 1.0 / induced(f);
        vec![
            ("CD0", base + k * zero * zero, 0.5, "estimate: a small clean aircraft"),
            ("CDalpha", 2.0 * k * zero * self.slope(f), 0.5, "lift squared over pi e AR, e = 0.85"),
            ("CDq", 0.0, 0.0, "none"),
            ("CDde", 0.0, 0.0, "none"),
        ]
    }

    pub(super) fn induced_drag(&self, f: &Figures) -> Estimate {
        let value = self.slope(f).powi(2) / induced(f);
        ("CDalpha2", value, 0.25, "lift squared over pi e AR, e = 0.85")
    }

    pub(super) fn side(&self, _: &Figures) -> Vec<Estimate> {
        let fin = if self.tail == Tail::Conventional { FIN[2] * FIN[0] / FIN[1] } else { 0.15 };
        let slip = self
            .source("fin volume 0.04, and the fuselage", "estimate: winglets 0.15, fuselage 0.05");
        let rate = self.source(
            "Etkin and Reid 5.8",
            "estimate: the side force of the winglets at 0.4 spans behind the centre of mass",
        );
        vec![
            ("CY0", 0.0, 0.0, "symmetric"),
            ("CYbeta", -fin - 0.05, 0.5, slip),
            ("CYp", 0.0, 0.0, "small"),
            ("CYr", 2.0 * fin * FIN[1], 0.5, rate),
            ("CYda", 0.0, 0.0, "small"),
        ]
    }

    pub(super) fn roll(&self, f: &Figures) -> Vec<Estimate> {
        vec![
            ("Cl0", 0.0, 0.0, "symmetric"),
            ("Clbeta", -0.08, 0.5, "estimate: some dihedral"),
            ("Clp", -0.1 * f.wing, 0.25, "strip theory, scaled to published small aircraft"),
            ("Clr", f.lift / 4.0, 0.5, "Etkin and Reid 5.8"),
            ("Clda", 0.032 * f.wing, 0.5, "scaled to published small aircraft"),
        ]
    }

    pub(super) fn pitch(&self, f: &Figures) -> Vec<Estimate> {
        let (margin, damping) = match self.tail {
            Tail::Conventional => (0.12, -2.2 * tailplane() * TAIL[0] * TAIL[1]),
            Tail::FlyingWing => (0.08, -0.35 * f.wing),
        };
        let slope = -margin * self.slope(f);
        let alpha = (f.lift - self.zero_lift()) / self.slope(f);
        let rate = self.source("Etkin and Reid 5.4", "estimate: -0.35 of the wing's lift slope");
        let elevator = self.source(
            "tail volume 0.5, elevator effectiveness 0.5",
            "elevons: their lift at 0.8 chords behind the centre of mass, scaled to published small aircraft",
        );
        vec![
            ("Cm0", -slope * alpha, 0.5, "trimmed at the cruise airspeed without elevator"),
            ("Cmalpha", slope, 0.5, "estimate: static margin"),
            ("Cmq", damping, 0.3, rate),
            ("Cmde", self.elevator(f)[1], 0.5, elevator),
        ]
    }

    pub(super) fn yaw(&self, f: &Figures) -> Vec<Estimate> {
        let conventional = self.tail == Tail::Conventional;
        let fin = FIN[0] * FIN[2];
        let (stiffness, damping) =
            if conventional { (fin - 0.05, -2.0 * FIN[1] * fin) } else { (0.03, -0.04) };
        let winglets = "estimate: winglets of a flying wing";
        vec![
            ("Cn0", 0.0, 0.0, "symmetric"),
            ("Cnbeta", stiffness, 0.5, self.source("fin volume 0.04 less the fuselage", winglets)),
            ("Cnp", -f.lift / 8.0, 0.5, "Etkin and Reid 5.8"),
            ("Cnr", damping, 0.5, self.source("fin volume 0.04", winglets)),
            ("Cnda", -0.005, 1.0, "adverse yaw of published small aircraft"),
        ]
    }

    /// Thrust T = Ts (δ² − δ V/Vp) of a fixed-pitch propeller with static thrust Ts (N) and pitch speed Vp (m/s). The motor's
    /// voltage is assumed to be proportional to the throttle δ.
    pub(super) fn thrust(&self) -> Vec<Estimate> {
        let (rest, source) = (self.static_thrust, "static thrust and pitch speed");
        vec![
            ("T0_n", 0.0, 0.0, source),
            ("Tt_n", 0.0, 0.0, source),
            ("Ttt_n", rest, 0.2, source),
            ("TV_nspm", 0.0, 0.0, source),
            ("TtV_nspm", -rest / self.pitch_speed, 0.3, source),
            ("TVV_ns2pm2", 0.0, 0.0, source),
        ]
    }
}

/// Derivatives of side force, rolling and yawing moment with respect to a rudder on the fin, 1/rad.
pub(super) fn rudder() -> Vec<Estimate> {
    let force = FIN[2] * FIN[3] * FIN[0] / FIN[1];
    let source = "fin volume 0.04, rudder effectiveness 0.55";
    vec![
        ("CYdr", force, 0.5, source),
        ("Cldr", 0.05 * force, 1.0, source),
        ("Cndr", -force * FIN[1], 0.5, source),
    ]
}

/// Lift slope of the tailplane multiplied by its efficiency, 1/rad.
fn tailplane() -> f64 {
    TAIL[2] * helmbold(4.5)
}

/// Downwash derivative dε/dα at the tailplane.
fn downwash(f: &Figures) -> f64 {
    2.0 * f.wing / (std::f64::consts::PI * f.aspect)
}

/// The factor π e AR in the induced drag CL²/(π e AR).
pub(super) fn induced(f: &Figures) -> f64 {
    std::f64::consts::PI * EFFICIENCY * f.aspect
}
