//! Division of the windows (of the weak form) of all flights into cells. A cell contains the windows of one channel of one
//! flight in which the residual is finite. A run is a sequence of adjacent windows. A block is a stretch of about 4 s.

use nalgebra::DMatrix;

use crate::diagnose::regression::columns::Ready;
use crate::diagnose::regression::gather::Column;
use crate::diagnose::regression::local::CHANNELS;
use crate::diagnose::regression::whiten::Whitener;

/// Length of a block of windows whose errors are treated as correlated, s.
pub const BLOCK_S: f64 = 4.0;

/// Regressors (columns) of one flight with their indices among all regressors.
pub type Placed = Vec<(usize, Column)>;

/// The windows of one channel of one flight.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Index of the flight.
    pub flight: usize,
    /// Index of the channel.
    pub channel: usize,
    /// Indices of the windows with a finite residual, ascending.
    pub windows: Vec<usize>,
    /// End of each run of adjacent windows, exclusive, as an index into `windows`.
    pub runs: Vec<usize>,
    /// Number of the block of each window. The numbers are unique over all flights.
    pub blocks: Vec<usize>,
}

/// The cells of all flights, with the flight of every block.
#[derive(Clone, Debug)]
pub struct Cells {
    /// Cells in the order of flights, then channels. Cells without windows are left out.
    pub list: Vec<Cell>,
    /// Index of the flight of each block.
    pub flight_of_block: Vec<usize>,
}

impl Cells {
    /// Divides `flights` into cells.
    pub fn new(flights: &[Ready]) -> Cells {
        let mut cells = Cells { list: Vec::new(), flight_of_block: Vec::new() };
        for (flight, ready) in flights.iter().enumerate() {
            let block_of = cells.number(flight, ready);
            for channel in 0..CHANNELS {
                let cell = cell(flight, channel, ready, &block_of);
                if !cell.windows.is_empty() {
                    cells.list.push(cell);
                }
            }
        }
        cells
    }

    /// Number of the block of each window of `ready`. Each segment is divided into equal blocks of about `BLOCK_S`.
    fn number(&mut self, flight: usize, ready: &Ready) -> Vec<usize> {
        let windows = &ready.acting.windows;
        let mut block_of = Vec::with_capacity(windows.len());
        for run in windows.chunk_by(|a, b| a.segment == b.segment) {
            let (start, end) = (run[0].time_s, run[run.len() - 1].time_s);
            let count = ((end - start) / BLOCK_S).round().max(1.0);
            let length = (end - start) / count;
            let first = self.flight_of_block.len();
            for window in run {
                let place = ((window.time_s - start) / length.max(1e-9)).min(count - 1.0);
                block_of.push(first + place.max(0.0) as usize);
            }
            self.flight_of_block.resize(first + count as usize, flight);
        }
        block_of
    }

    /// Number of blocks over all flights.
    pub fn blocks(&self) -> usize {
        self.flight_of_block.len()
    }
}

fn cell(flight: usize, channel: usize, ready: &Ready, block_of: &[usize]) -> Cell {
    let values = &ready.residual[channel];
    let windows: Vec<usize> = (0..values.len()).filter(|w| values[*w].is_finite()).collect();
    let segment = |w: usize| ready.acting.windows[w].segment;
    let runs = (1..=windows.len())
        .filter(|&k| {
            k == windows.len()
                || windows[k] != windows[k - 1] + 1
                || segment(windows[k]) != segment(windows[k - 1])
        })
        .collect();
    let blocks = windows.iter().map(|w| block_of[*w]).collect();
    Cell { flight, channel, windows, runs, blocks }
}

impl Cell {
    /// Splits `values` into the runs of the cell. `values` has one entry for each window of the flight.
    pub fn split(&self, values: &[f64]) -> Vec<Vec<f64>> {
        let mut start = 0;
        let cut = |&end: &usize| {
            let run = self.windows[start..end].iter().map(|w| values[*w]).collect();
            start = end;
            run
        };
        self.runs.iter().map(cut).collect()
    }

    /// Whitens `values`, which has one entry for each window of the flight. Returns one entry for each window of the
    /// cell.
    pub fn whitened(&self, values: &[f64], whitener: &Whitener) -> Vec<f64> {
        self.split(values).iter().flat_map(|run| whitener.apply(run)).collect()
    }

    /// Returns the whitened columns of `placed` that are not zero in the channel, with their indices.
    pub fn matrix(&self, placed: &Placed, whitener: &Whitener) -> (Vec<usize>, DMatrix<f64>) {
        let mut places = Vec::new();
        let mut data = Vec::new();
        for (place, column) in placed {
            if !column[self.channel].is_empty() {
                places.push(*place);
                data.extend(self.whitened(&column[self.channel], whitener));
            }
        }
        (places.clone(), DMatrix::from_vec(self.windows.len(), places.len(), data))
    }

    /// Rows of each block in the cell: block number, first row, last row + 1.
    pub fn rows_of_blocks(&self) -> Vec<(usize, usize, usize)> {
        let mut rows: Vec<(usize, usize, usize)> = Vec::new();
        for (row, block) in self.blocks.iter().enumerate() {
            match rows.last_mut() {
                Some((last, _, end)) if last == block => *end = row + 1,
                _ => rows.push((*block, row, row + 1)),
            }
        }
        rows
    }
}
