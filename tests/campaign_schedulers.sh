#!/usr/bin/env bash
# A campaign on a real Slurm of one node, on HyperQueue and under GNU parallel: two cells or more are killed on each, by
# scancel and by SIGKILL, and the results are those of a local run to the bit.
#
#   tests/campaign_schedulers.sh GREYLAG FILE.toml [slurm|hyperqueue|parallel]...
#
# Needs root for munged (Debian: slurm-wlm, munge), and for HyperQueue `hq` or a Python ($PYTHON) with the package hyperqueue.
# GNU parallel: Debian's package parallel. Exit status 77: a scheduler that was asked for is not installed.
set -euo pipefail
greylag=$(realpath "$1") file=$(realpath "$2")
here=$(dirname "$(realpath "$0")")
shift 2
[ $# -gt 0 ] || set -- slurm hyperqueue
work=$(mktemp -d)
started=()
finish() {
  for pid in "${started[@]}"; do kill "$pid" 2>/dev/null || true; done
  sleep 1
  if [ -z "${KEEP:-}" ]; then rm -rf "$work" || true; fi
}
trap finish EXIT

need() { command -v "$1" >/dev/null || PATH=$PATH:/usr/sbin command -v "$1" >/dev/null || { echo "no $1"; exit 77; }; }
PATH=$PATH:/usr/sbin:/sbin

one_node_slurm() {
  for tool in munged slurmctld slurmd sbatch; do need $tool; done
  mkdir -p "$work"/{munge,state,spool}
  chmod 700 "$work/munge"
  chmod 755 "$work"
  dd if=/dev/urandom of="$work/munge/key" bs=1024 count=1 status=none
  chmod 400 "$work/munge/key"
  munged --foreground --force --key-file="$work/munge/key" --socket="$work/munge/socket" \
    --pid-file="$work/munge/pid" --log-file="$work/munge/log" --seed-file="$work/munge/seed" > "$work/munged.txt" 2>&1 &
  started+=($!)
  host=$(hostname -s)
  cat > "$work/slurm.conf" <<CONF
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CredType=cred/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/ctld.pid
SlurmdPidFile=$work/d.pid
SlurmctldLogFile=$work/ctld.log
SlurmdLogFile=$work/d.log
ReturnToService=2
MinJobAge=3600
KillWait=5
SlurmdParameters=config_overrides
SchedulerParameters=sched_interval=1,batch_sched_delay=0
NodeName=$host NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
  export SLURM_CONF="$work/slurm.conf"
  for _ in $(seq 50); do [ -S "$work/munge/socket" ] && break; sleep 0.1; done
  slurmctld -D -f "$SLURM_CONF" > "$work/ctld.txt" 2>&1 &
  started+=($!)
  slurmd -D -f "$SLURM_CONF" -N "$host" > "$work/slurmd.txt" 2>&1 &
  started+=($!)
  for _ in $(seq 100); do sinfo -h -o %t 2>/dev/null | grep -q idle && return; sleep 0.3; done
  echo "slurm did not come up"; tail -5 "$work"/*.log "$work"/*.txt; exit 1
}

# the processes of this campaign's cells, and no others
cells() { pgrep -f -- "campaign run $file --out $work/$1 --cell" || true; }

wait_slurm() { while squeue -h -o %T | grep -q .; do sleep 0.5; done; }

on_slurm() {
  one_node_slurm
  cd /
  for kill in scancel KILL none; do
    "$greylag" campaign run "$file" --out "$work/slurm" --launcher slurm --submit
    if [ "$kill" != none ]; then
      for _ in $(seq 100); do [ -n "$(cells slurm)" ] && break; sleep 0.1; done
      sleep 0.7
      if [ "$kill" = scancel ]; then scancel --user="$(id -un)"; else kill -KILL $(cells slurm) 2> /dev/null && echo "slurm: killed" || true; fi
    fi
    wait_slurm
    "$greylag" campaign gather "$file" --out "$work/slurm" | head -1 || true
  done
}

# The program hq with a server and a worker here, or the package of PyPI, which has the engine without the program.
one_node_hyperqueue() {
  if ! command -v hq > /dev/null; then
    "${PYTHON:-python3}" -c 'import hyperqueue' 2> /dev/null || { echo "no hq and no Python package hyperqueue"; exit 77; }
    mkdir -p "$work/bin"
    printf '#!/bin/sh\nexec "%s" "%s" "$@"\n' "${PYTHON:-python3}" "$here/hq_through_python.py" > "$work/bin/hq"
    chmod +x "$work/bin/hq"
    PATH=$work/bin:$PATH
    return
  fi
  export HQ_SERVER_DIR="$work/hq"
  hq server start > "$work/hq-server.txt" 2>&1 &
  started+=($!)
  for _ in $(seq 50); do hq server info > /dev/null 2>&1 && break; sleep 0.2; done
  hq worker start --cpus 2 > "$work/hq-worker.txt" 2>&1 &
  started+=($!)
}

# Submits under launcher $1, and kills the cells that run, twice: the launcher's script tries them again.
submit_and_kill() {
  "$greylag" campaign run "$file" --out "$work/$1" --launcher "$1" --submit > "$work/$1.txt" 2>&1 &
  submit=$!
  killed=0
  for _ in 1 2; do
    for _ in $(seq 200); do [ -n "$(cells "$1")" ] && break; sleep 0.1; done
    sleep 0.2
    kill -KILL $(cells "$1") 2> /dev/null && killed=$((killed + 1)) || true
  done
  wait "$submit"
  [ "$killed" = 2 ] || { echo "$1: cells were killed $killed times of 2; their commands are too short, give another campaign"; exit 1; }
  echo "$1: killed twice"
}

on_hyperqueue() {
  one_node_hyperqueue
  submit_and_kill hyperqueue
}

# GNU parallel's joblog has exit value 0 for a job that a signal killed, so the script looks at each cell's own status.
on_parallel() {
  need parallel
  submit_and_kill parallel
}

"$greylag" campaign run "$file" --out "$work/local" --local
"$greylag" campaign gather "$file" --out "$work/local" --results "$work/local.jsonl" > /dev/null
for scheduler in "$@"; do
  "on_$scheduler"
  "$greylag" campaign gather "$file" --out "$work/$scheduler" --results "$work/$scheduler.jsonl" > /dev/null
  cmp "$work/local.jsonl" "$work/$scheduler.jsonl"
  echo "$scheduler: the same $(wc -l < "$work/local.jsonl") lines as the local run, to the bit"
done
