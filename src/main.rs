//! Entry point of the program `greylag`.

use std::process::ExitCode;

/// Allocations from this size on are returned to the system as soon as they are freed, bytes. By default glibc raises the limit to
/// 32 MB, and after an hour's log the program then keeps 80 MB that nothing uses.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const RETURNED: libc::c_int = 8 << 20;

fn main() -> ExitCode {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: the call sets a parameter of the allocator, before any other thread runs
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, RETURNED);
    }
    greylag::commands::main()
}
