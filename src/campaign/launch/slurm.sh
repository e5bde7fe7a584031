#!/usr/bin/env bash
# Campaign @NAME@ on Slurm: an array of jobs a stage, each stage after the one before.
set -euo pipefail
export GREYLAG=@PROGRAM@ CAMPAIGN=@FILE@ OUT=@OUT@
mkdir -p "$OUT/logs"
before=
stage() {
  # arrays count from 0, for Slurm bounds their numbers
  # status 75: a later attempt may succeed; above 128: killed, as for want of memory; 1: none will
  job=$(FIRST=$2 sbatch --parsable --job-name="@NAME@-$1" --array="0-$(($3 - $2))" --requeue --open-mode=append \
    --output="$OUT/logs/$1-%a.txt" ${before:+--dependency=afterany:$before} @OPTIONS@ <<'JOB'
#!/usr/bin/env bash
# processors of this job only
export RAYON_NUM_THREADS="${SLURM_CPUS_PER_TASK:-1}"
for attempt in $(seq @ATTEMPTS@); do
  "$GREYLAG" campaign run "$CAMPAIGN" --out "$OUT" --cell "$((FIRST + SLURM_ARRAY_TASK_ID))" && exit 0
  status=$?
  case $status in 75 | 1[3-9]?) sleep 5 ;; *) exit "$status" ;; esac
done
exit 75
JOB
  )
  before=${job%%;*}
  echo "stage $1: job $before, cells $2 to $3"
}
@STAGES@
