//! Tests of flights in real time, on machines that may stand still.
//!
//! What must answer within 10 ms can't be judged on a machine that wakes nobody for a second. Each such test
//! runs beside a thread that sleeps and notes how late it wakes. A test that fails while the machine stood
//! still is run again, with no other test in real time of its program beside it, and left undecided, in so many
//! words on standard error, if the machine never ran through. `GREYLAG_REQUIRE_REAL_TIME=1` makes that a failure too.

use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{PoisonError, RwLock};
use std::time::{Duration, Instant};

/// A thread that wakes later than this has stood still.
const STILL: Duration = Duration::from_millis(100);
/// Runs of a test at most.
const RUNS: usize = 3;
/// With more pauses than this in one run, another has no better prospects.
const HOPELESS: usize = 3;

/// Held by all tests in real time at their first run, and by one alone at another.
static BESIDE_OTHERS: RwLock<()> = RwLock::new(());

/// How often the machine stood still while `work` was done, and what became of that.
fn watched(work: impl FnOnce()) -> (std::thread::Result<()>, usize) {
    let (ended, pauses) = (AtomicBool::new(false), AtomicUsize::new(0));
    let result = std::thread::scope(|scope| {
        scope.spawn(|| {
            while !ended.load(Ordering::Relaxed) {
                let before = Instant::now();
                std::thread::sleep(Duration::from_millis(5));
                pauses.fetch_add(usize::from(before.elapsed() > STILL), Ordering::Relaxed);
            }
        });
        let result = catch_unwind(AssertUnwindSafe(work));
        ended.store(true, Ordering::Relaxed);
        result
    });
    (result, pauses.load(Ordering::Relaxed))
}

/// Runs `test`, called `name`, until it passes or fails on a machine that ran through.
pub fn in_real_time(name: &str, test: impl Fn()) {
    for run in 1..=RUNS {
        let (result, pauses) = if run == 1 {
            let _beside = BESIDE_OTHERS.read().unwrap_or_else(PoisonError::into_inner);
            watched(&test)
        } else {
            let _alone = BESIDE_OTHERS.write().unwrap_or_else(PoisonError::into_inner);
            watched(&test)
        };
        let Err(failure) = result else { return };
        let required = std::env::var_os("GREYLAG_REQUIRE_REAL_TIME").is_some_and(|v| v == "1");
        if pauses == 0 || required {
            resume_unwind(failure);
        }
        if run == RUNS || pauses > HOPELESS {
            // Written past the test harness, which hides what a passing test prints.
            let words = format!(
                "\n*** NOT DECIDED {name}: it failed, and this machine stood still {pauses} times meanwhile; \
                 run it where nothing else runs\n\n"
            );
            std::io::stderr().write_all(words.as_bytes()).unwrap();
            return;
        }
    }
}

/// Makes tests in real time of the functions named.
#[allow(unused_macros)]
macro_rules! tests {
    ($($name:ident),* $(,)?) => {
        mod in_real_time {
            $(
                #[test]
                fn $name() {
                    crate::real_time::in_real_time(stringify!($name), super::$name);
                }
            )*
        }
    };
}
#[allow(unused_imports)]
pub(crate) use tests;
