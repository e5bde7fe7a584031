//! Runs the simulated controller in real time over a link.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use super::FlightController;
use crate::shim::codec::Parser;
use crate::shim::error::ShimError;
use crate::shim::flight::Over;
use crate::shim::link::{Arrival, Link};
use crate::shim::options::ShimOptions;
use crate::shim::summary::{Event, Notice, Summary};
use crate::shim::telemetry::FRAME_US;

const PERIOD: Duration = Duration::from_micros(FRAME_US);
/// Delay of a cycle beyond which it counts as late.
const LATE: Duration = Duration::from_millis(2);
/// Delay of a cycle beyond which the schedule restarts at the present time.
const HOPELESS: Duration = Duration::from_millis(100);
/// Time between two polls of the link.
const LOOK: Duration = Duration::from_micros(500);
/// Largest number of arrivals that one poll handles.
const ARRIVALS: usize = 200;

/// Runs until a stop request or the end of the flight.
pub(in crate::shim) fn fly(
    mut link: Link,
    options: &ShimOptions,
    controller: &mut FlightController,
    stop: &AtomicBool,
    observer: &mut dyn FnMut(Notice),
) -> Result<Summary, ShimError> {
    let mut summary = Summary::default();
    observer(Notice { time_s: 0.0, event: Event::Open(options.link.clone(), link.local()) });
    let begun = Instant::now();
    let mut deadline = begun;
    let mut mode = controller.mode();
    let outcome = loop {
        if stop.load(Ordering::Relaxed) {
            break Ok(None);
        }
        deadline = begin(deadline, &mut summary);
        let mut bytes = Vec::new();
        controller.show(&mut bytes);
        summary.frames += 1;
        if !bytes.is_empty() {
            summary.unsent_frames += u64::from(!link.send(&bytes));
        }
        deadline += PERIOD;
        converse_until(&mut link, controller, deadline);
        match controller.fly() {
            Ok(None) => {}
            ended => break ended,
        }
        if controller.mode() != mode {
            mode = controller.mode();
            let time_s = controller.now_us() as f64 * 1e-6;
            observer(Notice { time_s, event: Event::Mode(format!("{mode:?}")) });
        }
    };
    finish(controller, summary, begun, outcome)
}

fn finish(
    controller: &mut FlightController,
    mut summary: Summary,
    begun: Instant,
    outcome: Result<Option<Over>, ShimError>,
) -> Result<Summary, ShimError> {
    summary.answers = controller.counts.sticks + controller.counts.targets;
    summary.foreign_frames = controller.counts.ignored;
    summary.bad_frames = controller.bad_frames();
    let flight = controller.flight();
    flight.finish()?;
    summary.over = outcome?;
    summary.flown_s = flight.flown_s();
    summary.simulated_s = flight.flown_s();
    summary.wall_s = begun.elapsed().as_secs_f64();
    Ok(summary)
}

/// Records the lateness of this cycle and returns the deadline from which the next cycle counts.
fn begin(deadline: Instant, summary: &mut Summary) -> Instant {
    let now = Instant::now();
    let late = now.saturating_duration_since(deadline);
    summary.latest_cycle = summary.latest_cycle.max(late);
    summary.late_cycles += u64::from(late > LATE);
    if late > HOPELESS { now } else { deadline }
}

/// Receives and handles messages until `deadline`.
fn converse_until(link: &mut Link, controller: &mut FlightController, deadline: Instant) {
    loop {
        for _ in 0..ARRIVALS {
            match link.receive() {
                Arrival::Nothing => break,
                Arrival::Datagram(bytes, from) => {
                    controller.receive(bytes);
                    // a datagram without a frame, as from a port scan, must not take the link
                    let mut heard = false;
                    Parser::default().datagram(bytes, &mut |_| heard = true);
                    if heard {
                        link.adopt(from);
                    }
                }
                Arrival::Bytes(bytes) => controller.receive(bytes),
                Arrival::Connected(_) | Arrival::Closed => controller.restart_stream(),
            }
        }
        let now = Instant::now();
        if now >= deadline {
            return;
        }
        thread::sleep(LOOK.min(deadline.saturating_duration_since(now)));
    }
}
