#!/usr/bin/env bash
# Runs campaign @NAME@ on Slurm. Each stage is an array of jobs and starts after the stage before it.
set -euo pipefail
export GREYLAG=@PROGRAM@ CAMPAIGN=@FILE@ OUT=@OUT@
mkdir -p "$OUT/logs"
before=
stage() {
  # the indices of each array start at 0, because Slurm limits the largest index
  # exit status 75: another attempt may succeed; above 128: killed, for example for lack of memory; 1: no attempt will succeed
  job=$(FIRST=$2 sbatch --parsable --job-name="@NAME@-$1" --array="0-$(($3 - $2))" --requeue --open-mode=append \
    --output="$OUT/logs/$1-%a.txt" ${before:+--dependency=afterany:$before} @OPTIONS@ <<'JOB'
#!/usr/bin/env bash
# only the processors of this job are used
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
