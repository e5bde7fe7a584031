//! The learning curve of a policy: evaluations in its training environment, as a table on disk.
//!
//! An evaluation flies the policy to commanded attitudes, which are easy or hard targets by their size (Table II of \[GSFM26\],
//! T. Guerin et al., 2026, see `src/lib.rs`). The settled error of a target is the mean of the RMSE in roll and in pitch at the
//! end of the flight.

use std::fs::File;
use std::io::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::checkpoint::write_whole;
use greylag_num::statistics::{interquartile_mean, quantile};

/// File name of a curve.
pub const CURVE: &str = "curve.csv";
/// Names of the columns, in the order of [`CurvePoint::line`].
pub const COLUMNS: &str =
    "steps,updates,seconds,easy_deg,hard_deg,divergence_rate,loss,reward,episodes,lost";
/// At the knee of a curve, this fraction of the reduction from the first to the smallest error is reached.
const KNEE: f64 = 0.9;

/// One evaluation, with the progress of the training. Values that were not measured are NaN.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Number of environment steps so far, all aircraft together.
    pub steps: u64,
    /// Number of updates so far.
    pub updates: u64,
    /// Computing time so far, over all processes that continued this training, s.
    pub seconds: f64,
    /// Mean settled error on easy targets, degrees.
    pub easy_deg: f64,
    /// Mean settled error on hard targets, degrees.
    pub hard_deg: f64,
    /// Fraction of the targets that diverged (settled error over 10°).
    pub divergence_rate: f64,
    /// Mean loss of the critics.
    pub loss: f64,
    /// Mean reward per training step. For TD3 it is `PolicyProgress::reward`.
    pub reward: f64,
    /// Number of episodes started.
    pub episodes: u64,
    /// Number of episodes that ended outside the model's validity limits.
    pub lost: u64,
}

impl CurvePoint {
    /// The point as a row of the table.
    pub fn line(&self) -> String {
        format!(
            "{},{},{:.0},{:.3},{:.3},{:.3},{:.4},{:.5},{},{}",
            self.steps,
            self.updates,
            self.seconds,
            self.easy_deg,
            self.hard_deg,
            self.divergence_rate,
            self.loss,
            self.reward,
            self.episodes,
            self.lost
        )
    }

    /// Sum of the mean settled errors on easy and hard targets, degrees. If the targets were not flown, the negative reward;
    /// infinite without either. The best point has the smallest value.
    pub fn badness(&self) -> f64 {
        let error = self.easy_deg + self.hard_deg;
        match (error.is_nan(), self.reward.is_nan()) {
            (false, _) => error,
            (true, false) => -self.reward,
            (true, true) => f64::INFINITY,
        }
    }
}

/// A curve cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("reading the learning curve {path}: {source}")]
pub struct CurveError {
    path: String,
    source: csv::Error,
}

impl CurveError {
    /// Whether there is no file.
    fn is_not_found(&self) -> bool {
        matches!(self.source.kind(), csv::ErrorKind::Io(why) if why.kind() == std::io::ErrorKind::NotFound)
    }
}

/// The points of the curve in `path`.
///
/// # Errors
///
/// If the file does not exist, or a row is not a point.
pub fn read(path: &Path) -> Result<Vec<CurvePoint>, CurveError> {
    let rows = csv::Reader::from_path(path).and_then(|mut file| file.deserialize().collect());
    rows.map_err(|source| CurveError { path: path.display().to_string(), source })
}

/// Index of the best point; the last of several equal points. `None` without points.
pub fn best(points: &[CurvePoint]) -> Option<usize> {
    (0..points.len()).rev().min_by(|a, b| points[*a].badness().total_cmp(&points[*b].badness()))
}

/// The knee of the curve: the first point at which nine tenths of the reduction from the first to the smallest value of
/// [`CurvePoint::badness`] are reached. `None` without points.
pub fn knee(points: &[CurvePoint]) -> Option<&CurvePoint> {
    let (first, best) = (points.first()?.badness(), points[best(points)?].badness());
    points.iter().find(|p| p.badness() <= first - KNEE * (first - best))
}

/// Spread of a quantity over several curves, one for each seed: interquartile mean (Agarwal et al. 2021), smallest and largest
/// value. Each list has one value for each abscissa.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spread {
    /// Interquartile mean over the seeds.
    pub middle: Vec<f64>,
    /// Smallest value of the seeds.
    pub low: Vec<f64>,
    /// Largest value of the seeds.
    pub high: Vec<f64>,
}

/// The spread over `curves` of the quantity that `get` returns, at the abscissae `at`. `over` returns the abscissa of a point,
/// for example its time. Each curve is interpolated linearly. The spread is NaN where any curve has not begun or has ended.
pub fn spread(
    curves: &[&[CurvePoint]],
    over: impl Fn(&CurvePoint) -> f64,
    get: impl Fn(&CurvePoint) -> f64,
    at: &[f64],
) -> Spread {
    let mut spread = Spread::default();
    for &x in at {
        let value = |points: &&[CurvePoint]| {
            let after = points.partition_point(|p| over(p) < x);
            let (Some(b), Some(a)) = (points.get(after), points.get(after.saturating_sub(1)))
            else {
                return f64::NAN;
            };
            match (over(b) == x, after) {
                (true, _) => get(b),
                (false, 0) => f64::NAN,
                _ => get(a) + (get(b) - get(a)) * (x - over(a)) / (over(b) - over(a)),
            }
        };
        let values: Vec<f64> = curves.iter().map(value).collect();
        let whole = values.iter().all(|v| v.is_finite());
        let of = |f: &dyn Fn(&[f64]) -> f64| if whole { f(&values) } else { f64::NAN };
        spread.middle.push(of(&interquartile_mean));
        spread.low.push(of(&|v| quantile(v, 0.0)));
        spread.high.push(of(&|v| quantile(v, 1.0)));
    }
    spread
}

/// A curve in a file to which points are appended.
pub struct CurveFile {
    file: File,
    points: Vec<CurvePoint>,
}

impl CurveFile {
    /// Opens the curve in `path` to continue it after `steps` environment steps. Later points are removed, by an
    /// atomic replacement of the file. If there is no file, a new curve is started.
    ///
    /// # Errors
    ///
    /// If there is a file that cannot be read, or if the file cannot be written. An unreadable file is left as it is.
    pub fn open(path: &Path, steps: u64) -> std::io::Result<CurveFile> {
        let mut points = match read(path) {
            Err(why) if why.is_not_found() => Vec::new(),
            points => points.map_err(std::io::Error::other)?,
        };
        points.retain(|p| p.steps <= steps);
        let lines: String = points.iter().map(|point| point.line() + "\n").collect();
        write_whole(path, format!("{COLUMNS}\n{lines}").as_bytes())?;
        Ok(CurveFile { file: File::options().append(true).open(path)?, points })
    }

    /// Points of the curve so far.
    pub fn points(&self) -> &[CurvePoint] {
        &self.points
    }

    /// The smallest value of `CurvePoint::badness` so far; infinite without points.
    pub fn best(&self) -> f64 {
        best(&self.points).map_or(f64::INFINITY, |i| self.points[i].badness())
    }

    /// Computing time up to the last point, s. Zero without points.
    pub fn seconds(&self) -> f64 {
        self.points.last().map_or(0.0, |p| p.seconds)
    }

    /// Appends `point` to the curve and to its file.
    ///
    /// # Errors
    ///
    /// If the file cannot be written.
    pub fn add(&mut self, point: CurvePoint) -> std::io::Result<()> {
        self.points.push(point);
        writeln!(self.file, "{}", point.line())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(steps: u64, easy_deg: f64) -> CurvePoint {
        CurvePoint {
            steps,
            updates: steps,
            seconds: steps as f64,
            easy_deg,
            hard_deg: 0.0,
            divergence_rate: 0.0,
            loss: f64::NAN,
            reward: -0.1,
            episodes: 3,
            lost: 1,
        }
    }

    #[test]
    fn a_curve_is_read_as_it_was_written_and_goes_on_from_its_checkpoint() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(CURVE);
        let mut file = CurveFile::open(&path, 0).unwrap();
        assert!(file.best().is_infinite() && file.seconds() == 0.0);
        for (steps, error) in [(10, 8.0), (20, 2.0), (30, 1.0)] {
            file.add(point(steps, error)).unwrap();
        }
        drop(file);
        let again = CurveFile::open(&path, 20).unwrap();
        assert_eq!([again.best(), again.seconds()], [2.0, 20.0]);
        let read = read(&path).unwrap();
        assert!(read.len() == 2 && read[1].easy_deg == 2.0 && read[1].loss.is_nan());
        std::fs::write(&path, "steps\nmany\n").unwrap();
        assert!(super::read(&path).unwrap_err().to_string().contains("curve.csv"));
    }

    #[test]
    fn a_curve_that_cannot_be_read_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(CURVE);
        std::fs::write(&path, "steps\nmany\n").unwrap();
        let error = CurveFile::open(&path, 10).map(|_| ()).unwrap_err();
        assert!(error.to_string().contains("curve.csv"), "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "steps\nmany\n");
        // A file that was created but not yet written is an empty curve.
        std::fs::write(&path, "").unwrap();
        assert!(CurveFile::open(&path, 10).unwrap().points().is_empty());
    }

    /// If a program ends while it shortens the curve, the old file or the new file remains.
    #[test]
    fn a_curve_is_shortened_in_a_new_file() {
        use std::io::Read as _;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(CURVE);
        let mut file = CurveFile::open(&path, 0).unwrap();
        [10, 20, 30].into_iter().for_each(|steps| file.add(point(steps, 1.0)).unwrap());
        let mut before = File::open(&path).unwrap();
        let mut again = CurveFile::open(&path, 20).unwrap();
        again.add(point(25, 1.0)).unwrap();
        let mut text = String::new();
        before.read_to_string(&mut text).unwrap();
        assert_eq!(text.lines().count(), 4, "{text}");
        assert_eq!(read(&path).unwrap().last().map(|p| p.steps), Some(25));
    }

    #[test]
    fn a_point_without_error_and_reward_is_not_the_best() {
        let nothing = CurvePoint { easy_deg: f64::NAN, reward: f64::NAN, ..point(2, 0.0) };
        assert_eq!(best(&[point(1, 3.0), nothing]), Some(0));
        assert_eq!(CurvePoint { reward: -0.2, ..nothing }.badness(), 0.2);
        assert_eq!(nothing.badness(), f64::INFINITY);
    }

    #[test]
    fn the_knee_is_where_nine_tenths_of_the_way_are_made() {
        let points = [(1, 11.0), (2, 3.0), (3, 1.9), (4, 1.0), (5, 1.5)].map(|(s, e)| point(s, e));
        assert_eq!(knee(&points).unwrap().steps, 3);
        assert_eq!(best(&points), Some(3));
        assert!(knee(&[]).is_none());
    }

    #[test]
    fn seeds_spread_where_all_of_them_have_been() {
        let curves = [
            vec![point(0, 4.0), point(10, 2.0)],
            vec![point(0, 8.0), point(5, 6.0), point(10, 4.0)],
        ];
        let curves = curves.each_ref().map(Vec::as_slice);
        let spread = spread(&curves, |p| p.seconds, |p| p.easy_deg, &[0.0, 5.0, 10.0, 11.0]);
        assert_eq!(spread.middle[..3], [6.0, 4.5, 3.0]);
        assert_eq!((spread.low[1], spread.high[1]), (3.0, 6.0));
        assert!(spread.middle[3].is_nan());
        // a curve without points has no value
        let empty = super::spread(&[&[]], |p| p.seconds, |p| p.easy_deg, &[0.0]);
        assert!(empty.middle[0].is_nan());
    }
}
