//! Measures the peak memory and the time of `inspect_all` on a flight log: `cargo run --release --example log_memory -- FILE`.
//!
//! The peak memory is VmHWM of /proc/self/status. The example therefore runs only on Linux. For comparison, pyulog reads the
//! same file with `/usr/bin/time -v python -c "from pyulog import ULog; ULog('FILE', ['vehicle_attitude', …])"`.

use std::path::Path;
use std::time::Instant;

use greylag::logs::{Options, inspect_all};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("give a flight log")?;
    let size = std::fs::metadata(&path)?.len();
    let start = Instant::now();
    let logs = inspect_all(Path::new(&path), &Options::default())?;
    let seconds = start.elapsed().as_secs_f64();
    let rows: usize = logs.iter().map(|log| log.flight.samples.len()).sum();
    let status = std::fs::read_to_string("/proc/self/status")?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or("unknown");
    println!(
        "{:.1} MB, {rows} rows: {seconds:.2} s, peak memory {}",
        size as f64 / 1e6,
        peak.trim()
    );
    Ok(())
}
