//! An attitude indicator made of text characters. It shows the horizon as seen from the aircraft.

/// Number of rows of the indicator; odd, so that one row is the middle.
pub const ROWS: usize = 9;
/// Number of columns of the indicator; odd, so that one column is the middle.
const COLUMNS: usize = 27;
/// Pitch angle that one row represents, degrees.
const DEGREES_A_ROW: f64 = 10.0;
/// Ratio of the height of a character to its width.
const ASPECT: f64 = 2.0;

/// The rows of characters for an attitude in degrees. `░` is the ground, and the aircraft symbol stays in the middle.
pub fn rows(roll_deg: f64, pitch_deg: f64) -> [String; ROWS] {
    let (sin, cos) = roll_deg.to_radians().sin_cos();
    let middle = |n: usize| (n / 2) as f64;
    std::array::from_fn(|row| {
        // `down` and `right` are the distances below and to the right of the middle, in heights of a row
        let down = row as f64 - middle(ROWS);
        let cell = |column: usize| {
            let right = (column as f64 - middle(COLUMNS)) / ASPECT;
            match (down, right) {
                (0.0, 0.0) => '◇',
                (0.0, x) if (1.0..=2.0).contains(&x.abs()) => '━',
                // the horizon sinks as the nose rises, and its right end rises as the right wing drops
                _ if down * cos + right * sin > pitch_deg / DEGREES_A_ROW => '░',
                _ => ' ',
            }
        };
        (0..COLUMNS).map(cell).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ground(rows: &[String]) -> usize {
        rows.iter().flat_map(|row| row.chars()).filter(|c| *c == '░').count()
    }

    #[test]
    fn level_flight_has_the_sky_above_and_the_ground_below() {
        let rows = rows(0.0, 0.0);
        assert_eq!(ground(&rows[..=ROWS / 2]), 0);
        assert_eq!(ground(&rows[ROWS / 2 + 1..]), (ROWS / 2) * COLUMNS);
        assert!(rows.iter().all(|row| row.chars().count() == COLUMNS));
        assert!(rows[ROWS / 2].contains("━ ◇ ━"), "{:?}", rows[ROWS / 2]);
    }

    #[test]
    fn nose_up_shows_sky_and_right_wing_down_shows_ground_on_the_right() {
        assert!(ground(&rows(0.0, 20.0)) < ground(&rows(0.0, 0.0)));
        assert!(ground(&rows(0.0, -20.0)) > ground(&rows(0.0, 0.0)));
        let banked = rows(45.0, 0.0);
        let side = |right: bool| -> usize {
            let half = |row: &String| -> String {
                let letters: Vec<char> = row.chars().collect();
                let (left, rest) = letters.split_at(COLUMNS / 2);
                (if right { rest } else { left }).iter().collect()
            };
            ground(&banked.iter().map(half).collect::<Vec<_>>())
        };
        assert!(side(true) > 2 * side(false), "{banked:#?}");
        // in inverted flight the ground is above
        assert!(
            ground(&rows(180.0, 0.0)[..ROWS / 2]) > 4 * ground(&rows(180.0, 0.0)[ROWS / 2 + 1..])
        );
    }
}
