//! Reads the text form of a DataFlash log (`.log`) by conversion to the binary form.
//!
//! Mission Planner and older ground stations save the content of a memory card as lines `NAME, value, …`. Lines that begin with
//! FMT declare the types of records, as FMT records do in the binary file. Each line is converted to its binary record. A line
//! that fits no declaration becomes one byte, which the reader of the binary form counts as damage.

use std::collections::HashMap;
use std::io::{self, BufRead, BufReader, Read};

use super::dataflash::{FMT, HEADER, size};
use super::format::DATAFLASH_MAGIC;

/// The first declaration must be among this many lines. Lines on firmware, board and free memory may precede it.
const HEAD: usize = 20;
/// Length of the longest line that is read as one line, bytes.
const LONGEST: u64 = 4096;

/// Whether a file that begins with `start` is a DataFlash log in text form.
pub(super) fn begins(start: &[u8]) -> bool {
    start.split(|b| *b == b'\n').take(HEAD).any(|line| {
        let mut fields = line.split(|b| *b == b',').map(<[u8]>::trim_ascii);
        fields.next() == Some(b"FMT") && fields.next() == Some(b"128")
    })
}

/// A reader that converts a text log to the bytes of a binary one.
pub(super) struct Binary<'a> {
    lines: BufReader<&'a mut dyn Read>,
    /// For each declared record name: its type number, and the format letters of its fields.
    declared: HashMap<String, (u8, String)>,
    /// The line that names the firmware; it precedes the declarations.
    firmware: Option<String>,
    bytes: Vec<u8>,
    from: usize,
}

impl<'a> Binary<'a> {
    /// A reader of the text log in `source`.
    pub fn new(source: &'a mut dyn Read) -> Self {
        let (lines, declared) = (BufReader::new(source), HashMap::new());
        Binary { lines, declared, firmware: None, bytes: Vec::new(), from: 0 }
    }

    /// Appends the binary form of the next line to `bytes`. The result is `false` at the end of the log.
    fn next(&mut self) -> io::Result<bool> {
        let mut line = Vec::new();
        if self.lines.by_ref().take(LONGEST).read_until(b'\n', &mut line)? == 0 {
            return Ok(false);
        }
        let line = String::from_utf8_lossy(&line);
        let line = line.trim();
        let mut fields = line.split(',').map(str::trim);
        let name = fields.next().unwrap_or_default();
        if name == "FMT" {
            let bytes = self.declaration(line);
            self.bytes.extend(bytes.unwrap_or_else(|| vec![0]));
            return Ok(true);
        }
        match self.declared.get(name) {
            Some((kind, letters)) => {
                let values: Vec<&str> = fields.collect();
                self.bytes.extend(record(*kind, letters, &values).unwrap_or_else(|| vec![0]));
            }
            None if self.declared.is_empty() => {
                if line.contains("Ardu") || line.contains("APM:") {
                    self.firmware = Some(line.to_owned());
                }
            }
            None if line.is_empty() => {}
            None => self.bytes.push(0),
        }
        Ok(true)
    }

    /// The FMT record of the line `FMT, type, length, name, letters, label, …`. If the line declares MSG, a MSG record with the
    /// firmware's name follows.
    fn declaration(&mut self, line: &str) -> Option<Vec<u8>> {
        let mut fields = line.splitn(6, ',').map(str::trim).skip(1);
        let (kind, _, name) = (fields.next()?, fields.next()?, fields.next()?);
        let (letters, labels) = (fields.next()?, fields.next().unwrap_or_default());
        let kind: u8 = kind.parse().ok()?;
        let body: usize = letters.bytes().map(size).sum::<Option<usize>>()?;
        let len = u8::try_from(HEADER + body).ok()?;
        let labels: Vec<&str> = labels.split(',').map(str::trim).collect();
        let fixed = |text: &str, width: usize| {
            let mut bytes = text.as_bytes().to_vec();
            bytes.resize(width, 0);
            bytes
        };
        let mut out = [&DATAFLASH_MAGIC[..], &[FMT, kind, len]].concat();
        out.extend([fixed(name, 4), fixed(letters, 16), fixed(&labels.join(","), 64)].concat());
        if kind != FMT {
            self.declared.entry(name.to_owned()).or_insert((kind, letters.to_owned()));
        }
        if name == "MSG"
            && let Some(firmware) = self.firmware.take()
        {
            let value = |l| if b"nNZ".contains(&l) { firmware.as_str() } else { "0" };
            let values: Vec<&str> = letters.bytes().map(value).collect();
            out.extend(record(kind, letters, &values).unwrap_or_default());
        }
        Some(out)
    }
}

impl Read for Binary<'_> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        while self.from == self.bytes.len() {
            self.bytes.clear();
            self.from = 0;
            if !self.next()? {
                return Ok(0);
            }
        }
        let count = to.len().min(self.bytes.len() - self.from);
        to[..count].copy_from_slice(&self.bytes[self.from..self.from + count]);
        self.from += count;
        Ok(count)
    }
}

/// The number in a field with the format `letter`; `None` if the text is not a number. The line then counts as damaged.
fn number(letter: u8, text: &str) -> Option<f64> {
    match (text.trim().parse::<f64>(), letter) {
        (Ok(x), _) => Some(x),
        // C libraries write NaN in many ways, such as `-nan(ind)`
        (Err(_), b'f' | b'd') => Some(f64::NAN),
        // a flight mode may be written as its name
        (Err(_), b'M') => Some(0.0),
        (Err(_), _) => None,
    }
}

/// The binary record of a line with these values; `None` if there are too few values, or if one does not fit the declaration.
fn record(kind: u8, letters: &str, values: &[&str]) -> Option<Vec<u8>> {
    let mut out = [&DATAFLASH_MAGIC[..], &[kind]].concat();
    let last = letters.len().checked_sub(1)?;
    for (i, letter) in letters.bytes().enumerate() {
        // a text in the last field may contain commas and then spans several values
        let rest = if i == last && b"nNZ".contains(&letter) { values.len() } else { i + 1 };
        let text = values.get(i..rest)?.join(",");
        let x = if b"nNZag".contains(&letter) { 0.0 } else { number(letter, &text)? };
        match letter {
            b'b' => out.extend((x as i8).to_le_bytes()),
            b'B' | b'M' => out.push(x as u8),
            b'h' => out.extend((x as i16).to_le_bytes()),
            b'H' => out.extend((x as u16).to_le_bytes()),
            b'c' => out.extend(((x * 100.0).round() as i16).to_le_bytes()),
            b'C' => out.extend(((x * 100.0).round() as u16).to_le_bytes()),
            b'i' => out.extend((x as i32).to_le_bytes()),
            b'I' => out.extend((x as u32).to_le_bytes()),
            b'e' => out.extend(((x * 100.0).round() as i32).to_le_bytes()),
            b'E' => out.extend(((x * 100.0).round() as u32).to_le_bytes()),
            b'L' => out.extend(((x * 1e7).round() as i32).to_le_bytes()),
            b'f' => out.extend((x as f32).to_le_bytes()),
            b'd' => out.extend(x.to_le_bytes()),
            b'q' => out.extend((x as i64).to_le_bytes()),
            b'Q' => out.extend((x as u64).to_le_bytes()),
            _ => {
                let mut bytes = text.trim().as_bytes().to_vec();
                bytes.resize(size(letter)?, 0);
                out.extend(bytes);
            }
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataflash::read;
    use crate::stretches::Keep;

    /// With a NaN as its pulse at full deflection, a surface would be read as always neutral.
    #[test]
    fn a_parameter_that_is_no_number_is_left_out() {
        let log = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
            FMT, 64, 31, PARM, QNf, TimeUS,Name,Value\n\
            PARM, 1, SERVO1_MIN, 1100\nPARM, 1, SERVO1_MAX, nan\nPARM, 1, SERVO1_TRIM, 1500\n";
        let mut source = log.as_bytes();
        let mut binary = Binary::new(&mut source);
        let (lives, _) = read(&mut binary, &|_| true, Keep::All);
        let names: Vec<&str> = lives[0].parameters.keys().map(String::as_str).collect();
        assert_eq!(names, ["SERVO1_MIN", "SERVO1_TRIM"]);
    }

    #[test]
    fn a_line_with_a_number_that_cannot_be_read_is_no_record_of_zeros() {
        let made = |values: &[&str]| record(7, "QfMN", values);
        let whole = made(&["12", "-nan(ind)", "Auto", "a, b"]).unwrap();
        assert_eq!(whole[3..11], 12u64.to_le_bytes());
        assert!(f32::from_le_bytes(whole[11..15].try_into().unwrap()).is_nan());
        assert_eq!(made(&["x12", "0.5", "Auto", "a"]), None);
    }
}
