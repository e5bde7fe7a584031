//! Reasons why a flight log cannot be read or used.

use std::path::PathBuf;

use super::csv::CsvError;

/// The reason why a flight log cannot be read or used.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file cannot be read.
    #[error("cannot read flight log {}: {source}: check the path and its permissions", path.display())]
    File {
        /// Path of the log.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is empty.
    #[error("flight log {} is empty: the logger wrote nothing, or the copy failed", path.display())]
    Empty {
        /// Path of the log.
        path: PathBuf,
    },
    /// The file has none of the supported formats.
    #[error("{} is no flight log: {what}", path.display())]
    Foreign {
        /// Path of the file.
        path: PathBuf,
        /// What the file is, if that is known, and which file to give instead.
        what: &'static str,
    },
    /// The path names a flight by its number (`FILE#2`), but the file has fewer flights.
    #[error("flight log {} holds {there} flights: there is no #{asked} in it", path.display())]
    Part {
        /// Path of the log.
        path: PathBuf,
        /// The requested number of the flight.
        asked: usize,
        /// Number of flights in the file.
        there: usize,
    },
    /// The log is of a vehicle without wings.
    #[error("flight log {}: {why}", path.display())]
    Vehicle {
        /// Path of the log.
        path: PathBuf,
        /// Type of the vehicle, and the remedy.
        why: String,
    },
    /// The CSV file cannot be used.
    #[error("{error}{hint}")]
    Csv {
        /// Error of the CSV reader.
        error: CsvError,
        /// Text on columns whose units are probably wrong; may be empty.
        hint: String,
    },
    /// The file has no data for a required column.
    #[error("flight log {} has nothing for column `{column}`: {remedy}", path.display())]
    Missing {
        /// Path of the log.
        path: PathBuf,
        /// Name of the missing column.
        column: &'static str,
        /// Fields from which the column can be read.
        remedy: String,
    },
    /// More than 5 % of the rows are unusable.
    #[error("flight log {}: {dropped} of {rows} rows are unusable ({reasons}; first: row {first}), above 5 %: repair it or read it leniently{hint}", path.display())]
    Unusable {
        /// Path of the log.
        path: PathBuf,
        /// Number of rows that were dropped.
        dropped: usize,
        /// Number of rows in the table.
        rows: usize,
        /// Reasons for dropping, with counts.
        reasons: String,
        /// Number of the first dropped row.
        first: usize,
        /// Text on columns whose units are probably wrong; may be empty.
        hint: String,
    },
}
