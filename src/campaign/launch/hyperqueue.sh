#!/usr/bin/env bash
# Runs campaign @NAME@ on HyperQueue. Each stage is an array of tasks and starts after the stage before it.
set -euo pipefail
export GREYLAG=@PROGRAM@ CAMPAIGN=@FILE@ OUT=@OUT@
mkdir -p "$OUT/logs"
stage() {
  # exit status 75: another attempt may succeed; above 128: killed, for example for lack of memory; 1: no attempt will succeed
  hq submit --wait --name "@NAME@-$1" --array "$2-$3" --crash-limit @ATTEMPTS@ \
    --stdout "$OUT/logs/$1-%{TASK_ID}.txt" --stderr "$OUT/logs/$1-%{TASK_ID}.err.txt" \
    --env GREYLAG="$GREYLAG" --env CAMPAIGN="$CAMPAIGN" --env OUT="$OUT" --env RAYON_NUM_THREADS=1 @OPTIONS@ \
    -- bash -c 'for attempt in $(seq @ATTEMPTS@); do
        "$GREYLAG" campaign run "$CAMPAIGN" --out "$OUT" --cell "$HQ_TASK_ID" && exit 0
        status=$?; case $status in 75 | 1[3-9]?) sleep 5 ;; *) exit "$status" ;; esac
      done; exit 75' || echo "stage $1: not all cells are done"
}
@STAGES@
