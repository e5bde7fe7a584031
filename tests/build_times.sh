#!/usr/bin/env bash
# Processor time of builds: from nothing, and after one edited line until a test program is built. In a clone, on an idle machine:
#
#     tests/build_times.sh FOLDER      FOLDER: a clone of the repository; its target folder is removed
#
# Prints user and system time, wall time and the memory of the largest process. Figures: results/notes/2026-11-29-build-time.md.
set -euo pipefail
cd "$1"
[ -f Cargo.toml ] && [ -d .git ] || { echo "$1 is no clone of the repository" >&2; exit 1; }
[ -z "$(git status --porcelain --untracked-files=no)" ] || { echo "$1 has changes: they would be mixed with the edited line" >&2; exit 1; }
log=$(mktemp)
trap 'git checkout -q -- src; rm -f "$log"' EXIT

timed() { # label, command
  local label=$1
  shift
  /usr/bin/time -o "$log" -f "$label: user %U s, system %S s, wall %e s, %M kB" "$@" >/dev/null 2>&1
  tail -1 "$log"
}

edited() { # label, source file, command
  local label=$1 file=$2
  shift 2
  "$@" >/dev/null 2>&1
  # a statement at the beginning of the file's first function
  perl -0pi -e 's/(\n *(?:pub(?:\([a-z]+\))? )?fn \w+\([^{;]*\{\n)/$1    std::hint::black_box(1);\n/' "$file"
  timed "$label" "$@"
  git checkout -q -- "$file"
}

rm -rf target
timed "cargo verify --no-run from nothing" cargo verify --no-run
for room in sysid:src/sysid/diagnose/regression/local.rs physics:src/physics/airframe.rs report:src/report/kit/decimate.rs flight:src/flight/pilot/telemetry.rs; do
  IFS=: read -r name file <<<"$room"
  edited "$name, a line edited, unit tests" "$file" cargo test --ignore-rust-version --package "greylag-$name" --lib --no-run
  edited "$name, a line edited, its test program" "$file" cargo test --ignore-rust-version --workspace --features greylag/sitl,greylag/learn --test "$name" --no-run
done
rm -rf target
timed "cargo demo from nothing" cargo build --release --ignore-rust-version --no-default-features --features demo --bin greylag
