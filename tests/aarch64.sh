#!/usr/bin/env bash
# The numerics of an aarch64, on which there are NEON and a multiply-add that is always fused: built for it and run by
# qemu. The gradient of training in lanes, formulas, and the numbers that an x86-64 computed; with LIBRARY=1 the tests of
# the library too, which compiles it once more.
#
#   [LIBRARY=1] tests/aarch64.sh [FEATURES]      (learn by default; none for the companion alone, some minutes faster)
#
# Needs qemu-aarch64 and aarch64-linux-gnu-gcc (Debian: qemu-user, gcc-aarch64-linux-gnu, libc6-dev-arm64-cross) and the
# target (rustup target add aarch64-unknown-linux-gnu). Exit status 77: one of them is not installed.
set -euo pipefail
cd "$(dirname "$0")/.."
triple=aarch64-unknown-linux-gnu
for tool in qemu-aarch64 aarch64-linux-gnu-gcc; do
  command -v "$tool" >/dev/null || { echo "no $tool"; exit 77; }
done
[ -d "$(rustc --print sysroot)/lib/rustlib/$triple" ] || { echo "no $triple: rustup target add $triple"; exit 77; }

# apart from the other builds, whose tests call cargo and would wait for this one
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-target/aarch64}
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64 -L /usr/aarch64-linux-gnu"
build=(--ignore-rust-version --target "$triple" --no-default-features --features "${1-learn}")

cargo test "${build[@]}" --test learn --test physics -- --nocapture gradient:: formula:: portable_numbers::
if [ -n "${LIBRARY:-}" ]; then
  # not the rooms that open sockets, logs or pages: nothing there is of one processor
  cargo test "${build[@]}" --lib -- num:: physics:: model:: control:: learn::
fi
