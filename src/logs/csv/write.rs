//! Writing a flight as CSV.

use std::io::Write;
use std::path::Path;

use super::CsvError;
use crate::columns::COLUMNS;
use crate::{Flight, Sample};

/// Writes `flight` to `out`. Missing values become empty fields. Numbers have enough digits to be read back without rounding.
///
/// # Errors
/// If `out` cannot be written.
pub fn write(flight: &Flight, out: impl Write) -> std::io::Result<()> {
    let mut rows = Rows::new(out, &[])?;
    flight.samples.iter().try_for_each(|sample| rows.row(sample, &[]))?;
    rows.flush()
}

/// Writes `flight` to a new file.
///
/// # Errors
/// If the file exists or cannot be written.
pub fn save(flight: &Flight, path: &Path) -> Result<(), CsvError> {
    let fail = |doing| move |source| CsvError::File { doing, path: path.to_owned(), source };
    let file = std::fs::File::create_new(path).map_err(fail("create"))?;
    write(flight, std::io::BufWriter::new(file)).map_err(fail("write"))
}

/// Writes a log row by row.
#[derive(Debug)]
pub struct Rows<W: Write> {
    out: W,
    line: String,
}

impl<W: Write> Rows<W> {
    /// Writes the header: the columns of the log format, then `extra`.
    ///
    /// # Errors
    /// If `out` cannot be written.
    pub fn new(mut out: W, extra: &[&str]) -> std::io::Result<Self> {
        let names: Vec<&str> = COLUMNS.iter().map(|c| c.0).chain(extra.iter().copied()).collect();
        writeln!(out, "{}", names.join(","))?;
        Ok(Rows { out, line: String::with_capacity(512) })
    }

    /// Writes a sample, then the fields `extra` in the header's order. They must not contain commas or quotes.
    ///
    /// # Errors
    /// If the writer cannot be written.
    pub fn row(&mut self, sample: &Sample, extra: &[&str]) -> std::io::Result<()> {
        use std::fmt::Write as _;
        self.line.clear();
        for (i, (_, get, _)) in COLUMNS.iter().enumerate() {
            if i > 0 {
                self.line.push(',');
            }
            let x = get(sample);
            if x.is_finite() {
                let _ = write!(self.line, "{x}");
            }
        }
        for field in extra {
            self.line.push(',');
            self.line.push_str(field);
        }
        self.line.push('\n');
        self.out.write_all(self.line.as_bytes())
    }

    /// Flushes the writer.
    ///
    /// # Errors
    /// If the writer cannot be flushed.
    pub fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
}
