//! Relative errors of the stability derivatives that aerodynamic tools compute: standard deviations as fractions of the value.
//!
//! The errors are read from `params/widths/widths.csv`. They combine two sources. One is the tool's errors on aircraft whose
//! derivatives were identified in flight or measured in a wind tunnel (`params/widths/measured.csv`, with sources). The other is
//! a prior guess, which counts as much as two aircraft, because few were measured. The result is w² = (2 g² + Σ e²) / (2 + n),
//! with the guess g and the relative errors e of n aircraft. `cargo run --no-default-features --example derivative_widths`
//! computes the file.

use std::fmt;
use std::sync::LazyLock;

/// A tool that computes derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Tool {
    /// Textbook formulas from mass, span and area (`greylag aircraft new`).
    Textbook,
    /// AVL, from its text output.
    Avl,
    /// OptVL, with AVL's vortex lattice.
    OptVl,
    /// AeroSandbox with its method `VortexLatticeMethod`.
    AeroSandboxLattice,
    /// AeroSandbox with its method `AeroBuildup`.
    AeroBuildup,
    /// AeroSandbox with its method `LiftingLine`.
    LiftingLine,
    /// XFLR5, from its stability analysis.
    Xflr5,
}

impl Tool {
    /// All tools, in the order of the enumeration.
    pub const ALL: [Tool; 7] = [
        Tool::Textbook,
        Tool::Avl,
        Tool::OptVl,
        Tool::AeroSandboxLattice,
        Tool::AeroBuildup,
        Tool::LiftingLine,
        Tool::Xflr5,
    ];

    /// Name of the tool in the tables.
    pub fn name(self) -> &'static str {
        match self {
            Tool::Textbook => "textbook",
            Tool::Avl => "avl",
            Tool::OptVl => "optvl",
            Tool::AeroSandboxLattice => "aerosandbox-lattice",
            Tool::AeroBuildup => "aerobuildup",
            Tool::LiftingLine => "lifting-line",
            Tool::Xflr5 => "xflr5",
        }
    }

    /// Name of the family of similar tools. Its errors are used if the table has none for this tool. AVL, OptVL and XFLR5 form
    /// one family, because their errors are similar.
    pub fn family(self) -> &'static str {
        match self {
            Tool::Avl | Tool::OptVl | Tool::Xflr5 => "lattice",
            other => other.name(),
        }
    }

    /// Text that a model file states as the source of a coefficient.
    pub(super) fn source(self) -> &'static str {
        match self {
            Tool::Textbook => "textbook",
            Tool::Avl => "vortex lattice (AVL)",
            Tool::OptVl => "vortex lattice (OptVL)",
            Tool::AeroSandboxLattice => "vortex lattice (AeroSandbox)",
            Tool::AeroBuildup => "AeroSandbox's AeroBuildup",
            Tool::LiftingLine => "AeroSandbox's lifting line",
            Tool::Xflr5 => "XFLR5",
        }
    }

    /// Text for the user: why the derivatives of `control` may be zero, and what to do.
    pub(super) fn of_controls(self, control: &str) -> String {
        match self {
            Tool::AeroSandboxLattice => format!(
                "AeroSandbox's lattice ignores deflected surfaces; the {control}'s coefficients are textbook estimates. Take controls from OptVL or AVL"
            ),
            _ => format!(
                "see that the {control} has a gain in the geometry; its coefficients are textbook estimates"
            ),
        }
    }

    /// Whether the tool computes the pitching moment of a wing section by its flap. AeroSandbox 4.2.10 treats a flap as a change
    /// of the angle of attack, so that Cmde of an elevon is far too small or has the wrong sign
    /// (`findings/aerosandbox-elevon-moment.sh`). On a tail the moment of the lift outweighs it.
    pub(super) fn has_flap_moment(self) -> bool {
        !matches!(self, Tool::AeroBuildup | Tool::LiftingLine)
    }

    /// Text for the user: why Cmde of a flying wing is not used.
    pub(super) fn of_elevons(self) -> String {
        format!(
            "{self} (4.2.10) leaves out a flapped section's own pitching moment, which makes an elevon's far too small or of the wrong sign; CLde, Cmde are textbook estimates. Take them from OptVL or AVL"
        )
    }

    /// Text for the user: why a damping derivative may be missing.
    pub(super) fn of_damping(self) -> &'static str {
        match self {
            Tool::LiftingLine => "AeroSandbox's lifting line does not model rotation",
            _ => "the run did not model rotation, or its reference lengths are wrong",
        }
    }
}

impl fmt::Display for Tool {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.source())
    }
}

/// Entries of the table: tool or family, derivative, relative standard deviation.
static WIDTHS: LazyLock<Vec<(&str, &str, f64)>> = LazyLock::new(|| {
    let lines = include_str!("../../../params/widths/widths.csv").lines();
    let columns = |line: &'static str| {
        let mut parts = line.split(',');
        Some((parts.next()?, parts.next()?, parts.next()?.parse().ok()?))
    };
    lines.filter(|line| !line.starts_with('#')).skip(1).filter_map(columns).collect()
});

/// Relative standard deviation of the derivative `name` (for example `CLalpha`) from `tool`. `None` if the table lacks it.
pub fn of(tool: Tool, name: &str) -> Option<f64> {
    let by = |tool: &str| WIDTHS.iter().find(|w| w.0 == tool && w.1 == name).map(|w| w.2);
    by(tool.name()).or_else(|| by(tool.family()))
}
