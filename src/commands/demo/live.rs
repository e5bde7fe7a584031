//! Output of the demonstration in flight: one line per target attitude, and on a terminal an attitude indicator. The part of
//! the flight with one target is a leg.

use std::io::{IsTerminal, Write};
use std::time::Duration;

use super::client::View;
use super::indicator::{self, ROWS};
use super::schedule::{Leg, Legs};

/// Interval between two drawings.
const EVERY: Duration = Duration::from_millis(100);
/// Width of the bar that shows the elapsed part of a leg, characters.
const BAR: usize = 24;

/// Prints one line per leg when the leg ends. A terminal also shows the attitude during the leg.
pub struct Live<'a> {
    legs: &'a Legs,
    terminal: bool,
    leg: Option<usize>,
    line: String,
    shown: Duration,
    /// Number of lines of the last drawing, which the next one replaces.
    drawn: usize,
}

/// Prints `rows`. A closed standard output must not end the flight, so errors are ignored.
fn show(rows: &[impl std::fmt::Display]) {
    let mut out = std::io::stdout().lock();
    let _ = rows.iter().try_for_each(|row| writeln!(out, "{row}")).and_then(|()| out.flush());
}

impl Live<'_> {
    /// Prints the column titles of the lines.
    pub fn begin(legs: &Legs) -> Live<'_> {
        println!("   target roll/pitch     roll    pitch   error   airspeed  altitude");
        let dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        Live {
            legs,
            terminal: std::io::stdout().is_terminal() && !dumb,
            leg: None,
            line: String::new(),
            shown: Duration::ZERO,
            drawn: 0,
        }
    }

    /// Shows `view` at the time `seconds` (s) after the start of the leg with index `leg`.
    pub fn show(&mut self, leg: usize, seconds: f64, view: &View) {
        if self.leg != Some(leg) {
            self.end();
            (self.leg, self.shown) = (Some(leg), Duration::ZERO);
        }
        let now = Duration::from_secs_f64(seconds.clamp(0.0, self.legs.seconds));
        let target = self.legs.legs[leg];
        self.line = line(seconds, &target, view);
        if self.terminal && now >= self.shown {
            self.shown = now + EVERY;
            let what = format!("target {} of {}", leg + 1, self.legs.legs.len());
            let flown = seconds / self.legs.seconds;
            self.draw(&block(&what, flown, &target, view));
        }
    }

    /// Ends the present leg: erases the drawing and prints the last line of the leg.
    pub fn end(&mut self) {
        if self.leg.take().is_some() {
            self.wipe();
            show(&[&self.line]);
        }
    }

    fn draw(&mut self, rows: &[String]) {
        self.wipe();
        show(rows);
        self.drawn = rows.len();
    }

    /// Erases the last drawing: moves the cursor up and clears the lines below it.
    fn wipe(&mut self) {
        if self.drawn > 0 {
            let _ = write!(std::io::stdout(), "\u{1b}[{}A\u{1b}[J", self.drawn);
            self.drawn = 0;
        }
    }
}

/// Mean of the magnitudes of the roll error and the pitch error, degrees.
fn error_deg(target: &Leg, view: &View) -> f64 {
    let (roll, pitch) = (view.roll.to_degrees(), view.pitch.to_degrees());
    0.5 * ((roll - target.roll_deg).abs() + (pitch - target.pitch_deg).abs())
}

fn line(seconds: f64, target: &Leg, view: &View) -> String {
    format!(
        "{:>5.1} s {:>5.0}/{:>3.0} deg {:>8.2} {:>8.2} {:>7.3} {:>7.1} m/s {:>6.0} m",
        seconds,
        target.roll_deg,
        target.pitch_deg,
        view.roll.to_degrees(),
        view.pitch.to_degrees(),
        error_deg(target, view),
        view.airspeed,
        view.altitude
    )
}

/// The rows of the attitude indicator, with numbers to the right. `flown` is the elapsed fraction of the leg.
fn block(what: &str, flown: f64, target: &Leg, view: &View) -> Vec<String> {
    let (roll, pitch) = (view.roll.to_degrees(), view.pitch.to_degrees());
    let done = (flown.clamp(0.0, 1.0) * BAR as f64).round() as usize;
    let beside: [String; ROWS] = [
        what.to_owned(),
        format!("{}{}", "█".repeat(done), "·".repeat(BAR - done)),
        String::new(),
        format!("roll  {roll:>8.2}° of {:>4.0}°", target.roll_deg),
        format!("pitch {pitch:>8.2}° of {:>4.0}°", target.pitch_deg),
        format!("error {:>8.3}°", error_deg(target, view)),
        String::new(),
        format!("airspeed {:>7.1} m/s", view.airspeed),
        format!("altitude {:>7.0} m", view.altitude),
    ];
    let rows = indicator::rows(roll, pitch);
    rows.iter().zip(&beside).map(|(row, text)| format!("  │{row}│  {text}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Difficulty;

    #[test]
    fn the_block_fits_a_terminal_and_says_what_is_flown() {
        let target = Leg { roll_deg: -58.0, pitch_deg: 28.0, difficulty: Difficulty::Hard };
        let view =
            View { roll: -1.0, pitch: 0.4, airspeed: 21.0, altitude: 500.0, ..View::default() };
        let rows = block("target 6 of 6", 0.5, &target, &view);
        assert_eq!(rows.len(), ROWS);
        assert!(rows.iter().all(|row| row.chars().count() < 80), "{rows:#?}");
        let all = rows.join("\n");
        for part in ["target 6 of 6", "-57.30° of  -58°", "████████████····", "21.0 m/s"]
        {
            assert!(all.contains(part), "{part}: {all}");
        }
    }
}
