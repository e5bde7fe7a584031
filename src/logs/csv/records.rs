//! Reads the records of a CSV table line by line. Fields of a table without quotes are read without a copy.

use std::io::{self, BufRead, Cursor, Read};
use std::ops::Range;

use memchr::{memchr_iter, memchr2};

/// Whole lines of a source. A last line without a line end is left out, because it may lack digits.
pub(super) struct Lines<'a> {
    source: &'a mut dyn BufRead,
    line: Vec<u8>,
    from: usize,
    /// Whether the source ended in the middle of a line.
    pub cut_short: bool,
}

impl<'a> Lines<'a> {
    pub fn new(source: &'a mut dyn BufRead) -> Self {
        Lines { source, line: Vec::new(), from: 0, cut_short: false }
    }

    /// Reads the next line with its line end. Returns `false` after the last line.
    fn next(&mut self) -> io::Result<bool> {
        self.line.clear();
        self.from = 0;
        self.source.read_until(b'\n', &mut self.line)?;
        if self.line.last().is_some_and(|b| *b != b'\n') {
            self.cut_short = true;
            self.line.clear();
        }
        Ok(!self.line.is_empty())
    }
}

impl Read for Lines<'_> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        if self.from == self.line.len() && !self.next()? {
            return Ok(0);
        }
        let count = to.len().min(self.line.len() - self.from);
        to[..count].copy_from_slice(&self.line[self.from..self.from + count]);
        self.from += count;
        Ok(count)
    }
}

type Quoted<'a> = ::csv::Reader<io::Chain<Cursor<Vec<u8>>, Lines<'a>>>;

/// Source of the records.
enum Origin<'a> {
    Plain(Lines<'a>),
    /// A reader that handles quotes. It is used from the first line that contains a quote, or a carriage return before
    /// its end.
    Quoted(Box<Quoted<'a>>),
    /// No source, after an error.
    Nothing,
}

/// The records of a table.
pub(super) struct Records<'a> {
    from: Origin<'a>,
    /// Separator of the fields; known from the first line on.
    pub delimiter: u8,
    begun: bool,
    record: ::csv::ByteRecord,
    ends: Vec<usize>,
}

/// The fields of one record.
#[derive(Clone, Copy)]
pub(super) struct Fields<'a> {
    bytes: &'a [u8],
    /// Index in `bytes` of the end of each field. The next field begins `between` bytes later.
    ends: &'a [usize],
    between: usize,
}

impl<'a> Fields<'a> {
    pub fn len(self) -> usize {
        self.ends.len()
    }

    pub fn iter(self) -> impl Iterator<Item = &'a [u8]> {
        let mut start = 0;
        self.ends.iter().map(move |end| {
            let field = self.bytes.get(start..*end).unwrap_or_default();
            start = end + self.between;
            field
        })
    }

    /// Number of lines that the record spans. It is more than one if a quoted field contains line ends.
    pub fn lines(self) -> usize {
        let open = self.bytes.last().is_none_or(|b| *b != b'\n');
        memchr_iter(b'\n', self.bytes).count() + usize::from(open)
    }

    pub fn get(self, i: usize) -> Option<&'a [u8]> {
        let start = if i == 0 { 0 } else { self.ends.get(i - 1)? + self.between };
        self.bytes.get(start..*self.ends.get(i)?)
    }
}

/// Separator of a table's columns, from its first line: a comma if it is at least as frequent as the semicolon, else the more
/// frequent of semicolon and tab. A comma if there is none of the three.
fn separator(header: &[u8]) -> u8 {
    let count = |by: u8| header.iter().filter(|b| **b == by).count();
    if count(b',') > 0 && count(b';') <= count(b',') {
        return b',';
    }
    [b';', b'\t']
        .into_iter()
        .max_by_key(|by| count(*by))
        .filter(|by| count(*by) > 0)
        .unwrap_or(b',')
}

/// Byte order mark of UTF-8 at the beginning of a text.
const MARK: &[u8] = b"\xEF\xBB\xBF";

impl<'a> Records<'a> {
    pub fn new(source: &'a mut dyn BufRead) -> Self {
        Records {
            from: Origin::Plain(Lines::new(source)),
            delimiter: b',',
            begun: false,
            record: ::csv::ByteRecord::new(),
            ends: Vec::new(),
        }
    }

    /// The next record; `None` after the last one.
    pub fn next(&mut self) -> Result<Option<Fields<'_>>, ::csv::Error> {
        if let Some(line) = self.plain()? {
            let Origin::Plain(lines) = &self.from else { return Ok(None) };
            return Ok(Some(Fields { bytes: &lines.line[line], ends: &self.ends, between: 1 }));
        }
        let Origin::Quoted(reader) = &mut self.from else { return Ok(None) };
        if !reader.read_byte_record(&mut self.record)? {
            return Ok(None);
        }
        self.ends.clear();
        let ends = (0..self.record.len()).filter_map(|i| self.record.range(i)).map(|r| r.end);
        self.ends.extend(ends);
        Ok(Some(Fields { bytes: self.record.as_slice(), ends: &self.ends, between: 0 }))
    }

    /// Reads the next line that is not empty and returns its range in the line buffer. Returns `None` at the end, and from the
    /// first line on that needs the reader for quotes.
    fn plain(&mut self) -> Result<Option<Range<usize>>, ::csv::Error> {
        while let Origin::Plain(lines) = &mut self.from {
            if !lines.next()? {
                return Ok(None);
            }
            let first = !std::mem::replace(&mut self.begun, true);
            if first {
                self.delimiter = separator(lines.line.split(|b| *b == b'\n').next().unwrap_or(&[]));
            }
            let line = content(&lines.line);
            if memchr2(b'"', b'\r', line).is_some() {
                self.quoted();
                break;
            }
            let marked = first && line.starts_with(MARK);
            let from = if marked { MARK.len() } else { 0 };
            let (line, to) = (&line[from..], line.len());
            if line.is_empty() {
                continue;
            }
            self.ends.clear();
            self.ends.extend(memchr_iter(self.delimiter, line));
            self.ends.push(line.len());
            return Ok(Some(from..to));
        }
        Ok(None)
    }

    /// Hands the present line and all following ones to a reader that handles quotes.
    fn quoted(&mut self) {
        if let Origin::Plain(mut lines) = std::mem::replace(&mut self.from, Origin::Nothing) {
            let line = Cursor::new(std::mem::take(&mut lines.line));
            lines.from = 0;
            let mut builder = ::csv::ReaderBuilder::new();
            let builder = builder.flexible(true).has_headers(false).delimiter(self.delimiter);
            self.from = Origin::Quoted(Box::new(builder.from_reader(line.chain(lines))));
        }
    }

    /// Whether the source ended in the middle of a line.
    pub fn cut_short(&self) -> bool {
        match &self.from {
            Origin::Plain(lines) => lines.cut_short,
            Origin::Quoted(reader) => reader.get_ref().get_ref().1.cut_short,
            Origin::Nothing => false,
        }
    }
}

/// A line without its end.
fn content(line: &[u8]) -> &[u8] {
    let end = line.iter().rposition(|b| *b != b'\n' && *b != b'\r').map_or(0, |i| i + 1);
    &line[..end]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The records as [`Records`] reads them, and as the reader that handles quotes reads the whole text.
    fn both(text: &[u8]) -> [Vec<Vec<Vec<u8>>>; 2] {
        let mut source = io::BufReader::with_capacity(7, text);
        let mut records = Records::new(&mut source);
        let mut own = Vec::new();
        while let Some(fields) = records.next().unwrap() {
            own.push((0..fields.len()).map(|i| fields.get(i).unwrap().to_vec()).collect());
        }
        let end = text.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
        assert_eq!(records.cut_short(), end < text.len());
        let mut builder = ::csv::ReaderBuilder::new();
        let builder = builder.flexible(true).has_headers(false).delimiter(records.delimiter);
        let other = builder.from_reader(&text[..end]).into_byte_records();
        let other = other.map(|r| r.unwrap().iter().map(<[u8]>::to_vec).collect()).collect();
        [own, other]
    }

    #[test]
    fn the_records_are_those_of_the_reader_that_knows_quotes() {
        for text in [
            &b"a,b,c\n1,2,3\n\n4,,6\n7,8\n9,10,11,12\n1,2"[..],
            b"\xEF\xBB\xBFa;b\r\n1;2\r\n\r\n3;4\r\n",
            b"a,b\n1,\"2,\n3\"\n4,5\n\"6\"\"\",7\n",
            b"\"a\",\"b\"\n1,2\n\"3,4\n",
            b"a\tb\n1\t2\r3\t4\n5\t6\n",
            b"\n\na,b\n1,2\n",
            b"a,b\r\r\n1,2\n3,4\"\n5\n",
            b"",
            b"a,b",
        ] {
            let [own, other] = both(text);
            assert_eq!(own, other, "{}", String::from_utf8_lossy(text));
        }
    }
}
