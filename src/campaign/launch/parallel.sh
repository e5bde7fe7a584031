#!/usr/bin/env bash
# Runs campaign @NAME@ with GNU parallel. The cells of a stage run in parallel. A stage starts after the stage before it.
set -euo pipefail
export GREYLAG=@PROGRAM@ CAMPAIGN=@FILE@ OUT=@OUT@ RAYON_NUM_THREADS=1
mkdir -p "$OUT/logs"
one() {
  # exit status 75: another attempt may succeed; above 128: killed, for example for lack of memory; 1: no attempt will succeed
  for attempt in $(seq @ATTEMPTS@); do
    "$GREYLAG" campaign run "$CAMPAIGN" --out "$OUT" --cell "$1" > "$OUT/logs/$1.txt" 2>&1 && return 0
    status=$?
    case $status in 75 | 1[3-9]?) sleep 5 ;; *) return "$status" ;; esac
  done
  return 75
}
export -f one
stage() {
  seq "$2" "$3" | SHELL=/bin/bash parallel --joblog "$OUT/logs/$1.joblog" @OPTIONS@ one {} \
    || echo "stage $1: not all cells are done"
}
@STAGES@
