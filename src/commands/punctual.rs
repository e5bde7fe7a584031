//! Wake-up latency of this computer, measured at the start of a flight, with advice. The latency is the delay with which a
//! thread continues after a sleep of 10 ms.

use std::time::Duration;

use crate::commands::terminal::{complain, say};
use crate::flight::runtime::{Class, Punctuality, take_real_time};

/// Duration of the measurement: 200 sleeps of 10 ms.
const MEASURED: Duration = Duration::from_secs(2);

/// Sets and returns the scheduling class of the calling thread: real time if `wanted` and permitted by the system. Threads
/// that this thread starts later inherit the class.
pub fn class(wanted: bool) -> Class {
    if !wanted {
        return Class::Usual;
    }
    match take_real_time() {
        Ok(()) => Class::RealTime,
        Err(why) => {
            eprintln!(
                "greylag: --realtime: SCHED_FIFO is refused ({why}); flying without it. Permit it with \
                 `sudo setcap cap_sys_nice+ep \"$(command -v greylag)\"`, or start as the service of the package"
            );
            Class::Usual
        }
    }
}

/// Starts a thread that measures the wake-up latency for 2 s and then prints it with advice. `class` is the scheduling class
/// of the calling thread.
pub fn print_timing(class: Class) {
    let measured = move || {
        let punctuality = Punctuality::measure(MEASURED);
        let class_words = if class == Class::RealTime { "SCHED_FIFO, " } else { "" };
        say(format_args!("timing     {class_words}{punctuality}"));
        for line in punctuality.advice(class) {
            say(format_args!("timing     advice: {line}"));
        }
    };
    if let Err(why) = std::thread::Builder::new().name("timing".into()).spawn(measured) {
        complain(format_args!("the punctuality of this computer is not measured: {why}"));
    }
}
