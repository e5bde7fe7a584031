#!/usr/bin/env bash
# Campaign @NAME@ with GNU parallel: the cells of a stage side by side, each stage after the one before.
set -euo pipefail
export GREYLAG=@PROGRAM@ CAMPAIGN=@FILE@ OUT=@OUT@ RAYON_NUM_THREADS=1
mkdir -p "$OUT/logs"
one() {
  # status 75: a later attempt may succeed; above 128: killed, as for want of memory; 1: none will
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
