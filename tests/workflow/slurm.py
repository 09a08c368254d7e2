"""A real SLURM of one node, from Debian's packages slurm-wlm and munge, for as long as a test needs it.

Everything it writes lies in one folder, its ports are free ones, and nothing of the system's own configuration is read
or changed. It starts without systemd and needs root.
"""

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "sinfo")
CONFIGURATION = """
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmctldPort={controller}
SlurmdPort={node}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
TaskProlog={folder}/prolog.sh
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
MinJobAge=3600
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory={memory} State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def missing() -> str:
    """Why no SLURM can be started here; empty where it can."""
    lacking = [p for p in PROGRAMS if shutil.which(p, path=_path()) is None]
    if lacking:
        return f"needs {', '.join(lacking)} (apt install slurm-wlm munge)"
    return "" if os.geteuid() == 0 else "needs root"


@contextmanager
def running(folder: Path) -> Iterator[dict[str, str]]:
    """The environment in which SLURM's programs find it; started before, stopped after."""
    folder.mkdir(parents=True)
    for name in ("state", "spool"):
        (folder / name).mkdir()
    key = folder / "munge.key"
    key.write_bytes(os.urandom(1024))
    key.chmod(0o600)
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20
    host, (controller, node) = socket.gethostname().split(".")[0], _free_ports(2)
    names = dict(host=host, folder=folder, controller=controller, node=node, memory=int(0.9 * memory))
    configuration = folder / "slurm.conf"
    configuration.write_text(CONFIGURATION.format(**names))
    # Snakemake's executor takes SLURM_CONF out of the environment in which a job calls srun, so that srun looks where
    # the system's configuration lies. In a job this one stands before it and says where ours lies.
    real = shutil.which("srun", path=_path())
    _write_program(folder / "bin" / "srun", f'SLURM_CONF={configuration} exec {real} "$@"')
    path = f"{folder / 'bin'}:{_path()}"
    _write_program(folder / "prolog.sh", f"echo export PATH={path}")
    environment = {**os.environ, "SLURM_CONF": str(configuration), "PATH": path}
    munged = ["munged", "--foreground", "--force", f"--key-file={key}", f"--socket={folder}/munge.socket"]
    munged += [f"--{name}-file={folder}/munge.{name}" for name in ("pid", "log", "seed")]
    started = []
    try:
        for command in (munged, ["slurmctld", "-D", "-i"], ["slurmd", "-D"]):
            log = open(folder / f"{command[0]}.out", "wb")
            started.append(subprocess.Popen(command, env=environment, stdout=log, stderr=log))
            time.sleep(1.0)
        _wait_until_idle(environment, folder)
        yield environment
    finally:
        for process in reversed(started):
            process.terminate()
        for process in reversed(started):
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _write_program(file: Path, line: str) -> None:
    file.parent.mkdir(exist_ok=True)
    file.write_text(f"#!/bin/sh\n{line}\n")
    file.chmod(0o755)


def _wait_until_idle(environment: dict[str, str], folder: Path, seconds: float = 120.0) -> None:
    end, said = time.monotonic() + seconds, ""
    while time.monotonic() < end:
        asked = subprocess.run(["sinfo", "-h", "-o", "%t"], env=environment, capture_output=True, text=True)
        said = asked.stdout + asked.stderr
        if asked.stdout.strip() in ("idle", "mix"):
            return
        time.sleep(1.0)
    logs = "\n".join(f"{p.name}: {p.read_text(errors='replace')[-2000:]}" for p in sorted(folder.glob("*.out")))
    raise RuntimeError(f"SLURM does not come up: {said}\n{logs}")


def _free_ports(count: int) -> list[int]:
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def _path() -> str:
    return os.environ.get("PATH", "") + ":/usr/sbin:/sbin"
