#!/usr/bin/env bash
# A Slurm of one machine, all of it in one folder: no root but for the packages, no systemd, loopback only. For tests and
# measurements; what it schedules runs on this machine.
#
#   scripts/slurm.sh install                       installs the packages (root), or says what is missing
#   scripts/slurm.sh up FOLDER [CPUS] [MEMORY]     starts it; then: . FOLDER/env.sh
#   scripts/slurm.sh down FOLDER                   cancels all jobs, ends it
#
# CPUS may be more than there are; MEMORY is in MiB. OWNER names a process without which it does not go on: it ends by itself
# soon after that process. HIDDEN names a folder that is empty on its node (root), as one that is not shared; NODE_DISK one that
# jobs find as SLURM_TMPDIR.
# PARTITION_LIMIT (min, 60), KILL_WAIT (s, 2) and MIN_JOB_AGE (s, 300) are set in its configuration.
set -euo pipefail
HERE=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
readonly HERE PACKAGES=(munge slurmctld slurmd slurm-client)
export PATH=$PATH:/usr/sbin:/sbin

say() { printf 'slurm: %s\n' "$*" >&2; }

lacking() {
    local program
    for program in munged slurmctld slurmd sbatch squeue scancel sinfo srun; do
        command -v "$program" >/dev/null || { echo "$program"; return; }
    done
}

install_packages() {
    [ -n "$(lacking)" ] || return 0
    # for scripts/system_packages.sh
    # shellcheck disable=SC2034
    readonly SPEAKER=slurm LOCAL=$HERE/../.local LOG=$HERE/../.local/slurm.log APT_STATE=$HERE/../.local/apt
    # shellcheck source-path=SCRIPTDIR/..
    . "$HERE/system_packages.sh"
    mkdir -p "$LOCAL"
    : >"$LOG"
    say "installing a Slurm to test with"
    # the packages would start it as services of the system where there is systemd
    system_install "${PACKAGES[@]}" || say "sweeps on Slurm are not tested: that takes the system's packages ${PACKAGES[*]}"
}

free_port() {
    python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'
}

alive() { [ -s "$1" ] && kill -0 "$(cat "$1")" 2>/dev/null; }

configure() {
    local folder=$1 cpus=$2 memory=$3 host control daemon
    host=$(hostname -s) control=$(free_port) daemon=$(free_port)
    cat >"$folder/slurm.conf" <<CONFIGURATION
ClusterName=one_folder
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$control
SlurmdPort=$daemon
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
AuthType=auth/munge
AuthInfo=socket=$folder/munge/socket
CredType=cred/munge
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/log/slurmctld.log
SlurmdLogFile=$folder/log/slurmd.log
SlurmctldDebug=info
SlurmdDebug=info
# no cgroups: processes by their groups, memory by looking at them every second
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=task=1
JobAcctGatherParams=OverMemoryKill
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
DefMemPerCPU=500
SlurmdParameters=config_overrides
SchedulerType=sched/backfill
SchedulerParameters=sched_min_interval=0,batch_sched_delay=0,bf_interval=1,sched_interval=5
ReturnToService=2
KillWait=${KILL_WAIT:-2}
OverTimeLimit=0
InactiveLimit=0
MinJobAge=${MIN_JOB_AGE:-300}
SlurmctldTimeout=30
SlurmdTimeout=30
JobRequeue=0
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc=$folder/log/jobs.log
NodeName=node1 NodeHostname=$host NodeAddr=127.0.0.1 Port=$daemon CPUs=$cpus RealMemory=$memory State=UNKNOWN
PartitionName=main Nodes=node1 Default=YES DefaultTime=5 MaxTime=${PARTITION_LIMIT:-60} OverSubscribe=NO State=UP
CONFIGURATION
    if [ -n "${NODE_DISK:-}" ]; then
        printf '#!/bin/sh\necho "export SLURM_TMPDIR=%s"\n' "$NODE_DISK" >"$folder/bin/prolog"
        chmod +x "$folder/bin/prolog"
        echo "TaskProlog=$folder/bin/prolog" >>"$folder/slurm.conf"
    fi
    # Snakemake's plugin for steps of jobs keeps SLURM_CONF from its inner srun: this one knows its cluster
    printf '#!/bin/sh\nSLURM_CONF="%s" exec "%s" "$@"\n' "$folder/slurm.conf" "$(command -v srun)" >"$folder/bin/srun"
    chmod +x "$folder/bin/srun"
    printf 'export SLURM_CONF="%s" PATH="%s:$PATH"\n' "$folder/slurm.conf" "$folder/bin" >"$folder/env.sh"
}

# Ends the rest when the owner is gone.
watch_owner() {
    # a session of its own: what ends the owner's processes by group does not end this one
    setsid bash -c 'tail --pid="$1" -f /dev/null; exec bash "$2" down "$3"' watch "$1" "$HERE/slurm.sh" "$2" \
        >/dev/null 2>&1 </dev/null &
    echo $! >"$2/watch.pid"
}

up() {
    local folder node=()
    [ -z "$(lacking)" ] || { say "$(lacking) is missing; scripts/slurm.sh install brings it"; exit 1; }
    mkdir -p "$1"
    folder=$(cd "$1" && pwd)
    mkdir -p "$folder"/{munge,state,spool,log,bin}
    chmod 755 "$folder" "$folder/munge"
    chmod 700 "$folder/state"
    [ -z "${OWNER:-}" ] || watch_owner "$OWNER" "$folder"
    (umask 077 && head -c 128 /dev/urandom >"$folder/munge/key")
    munged --force --key-file="$folder/munge/key" --socket="$folder/munge/socket" --pid-file="$folder/munge/pid" \
        --log-file="$folder/munge/log" --seed-file="$folder/munge/seed" --num-threads=2 </dev/null >/dev/null 2>&1
    configure "$folder" "${2:-4}" "${3:-8000}"
    export SLURM_CONF=$folder/slurm.conf
    setsid slurmctld -D -f "$SLURM_CONF" >"$folder/log/slurmctld.out" 2>&1 </dev/null &
    echo $! >"$folder/control.pid"
    if [ -n "${HIDDEN:-}" ]; then
        # shellcheck disable=SC2016
        node=(unshare --mount sh -c 'mount -t tmpfs hidden "$0" && exec "$@"' "$HIDDEN")
    fi
    setsid "${node[@]}" slurmd -D -N node1 -f "$SLURM_CONF" >"$folder/log/slurmd.out" 2>&1 </dev/null &
    echo $! >"$folder/node.pid"
    SECONDS=0
    # by the clock: without slurmctld each sinfo tries again for seconds
    while [ $SECONDS -lt 30 ] && alive "$folder/control.pid" && alive "$folder/node.pid"; do
        case "$(timeout 5 sinfo -h -N -n node1 -o %t 2>/dev/null)" in idle | mix | alloc) return 0 ;; esac
        sleep 0.1
    done
    say "did not come up"
    tail -n 20 "$folder"/log/*.log "$folder"/log/*.out >&2 || true
    down "$folder"
    exit 1
}

down() {
    local folder file pid
    folder=$(cd "$1" && pwd)
    export SLURM_CONF=$folder/slurm.conf
    if alive "$folder/control.pid"; then
        timeout 5 scancel --me 2>/dev/null || true
        SECONDS=0
        while [ $SECONDS -lt 8 ] && [ -n "$(timeout 5 squeue -h 2>/dev/null)" ]; do sleep 0.1; done
    fi
    for file in node.pid control.pid munge/pid; do
        alive "$folder/$file" || continue
        pid=$(cat "$folder/$file")
        kill "$pid" 2>/dev/null || true
        SECONDS=0
        while [ $SECONDS -lt 10 ] && kill -0 "$pid" 2>/dev/null; do sleep 0.1; done
        kill -9 "$pid" 2>/dev/null || true
        rm -f "$folder/$file"
    done
    if alive "$folder/watch.pid" && [ "$(cat "$folder/watch.pid")" != $$ ]; then
        # of its group: tail, too
        kill -- "-$(cat "$folder/watch.pid")" 2>/dev/null || true
    fi
    rm -f "$folder/watch.pid"
}

case "${1:-}" in
install) install_packages ;;
up | down)
    [ $# -ge 2 ] || { say "$1 takes a folder"; exit 2; }
    "$@"
    ;;
*)
    say "install, up FOLDER [CPUS] [MEMORY], or down FOLDER"
    exit 2
    ;;
esac
