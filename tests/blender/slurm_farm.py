"""Debian's Slurm on the loopback address: a controller and workers of one core each, in a folder of
their own, which end with the block that started them.
"""

from __future__ import annotations

import getpass
import os
import re
import secrets
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scontrol")
_BELIEVED = 4.0
"""Seconds, above BatchStartTimeout and MessageTimeout."""
_PATH = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"


def missing_programs() -> list[str]:
    """What has to be installed first (Debian: munge slurm-client slurmctld slurmd)."""
    return [name for name in PROGRAMS if shutil.which(name, path=_PATH) is None]


class SlurmFarm:
    """Workers are called w1, w2, …"""

    def __init__(self, folder: Path, workers: int) -> None:
        self.folder = folder
        self.names = [f"w{number}" for number in range(1, workers + 1)]
        self.variables = {**os.environ, "PATH": _PATH, "SLURM_CONF": str(folder / "slurm.conf")}
        self._running: dict[str, subprocess.Popen] = {}

    def start(self) -> None:
        """Raises TimeoutError where the workers do not come up."""
        key = self.folder / "munge.key"
        key.write_bytes(secrets.token_bytes(1024))
        key.chmod(0o400)
        for name in ("state", "spool"):
            (self.folder / name).mkdir()
        (self.folder / "slurm.conf").write_text(self._configuration())
        files = {"key": "munge.key", "socket": "munge.socket", "pid": "munge.pid"}
        files |= {"log": "munge.log", "seed": "munge.seed"}
        options = [
            f"--{name if name == 'socket' else f'{name}-file'}={self.folder / file}"
            for name, file in files.items()
        ]
        self._launch("munged", "munged", "--foreground", "--force", *options)
        wait_for(lambda: (self.folder / "munge.socket").exists(), "munged")
        self._launch("slurmctld", "slurmctld", "-D")
        for name in self.names:
            self.start_worker(name)
        wait_for(lambda: self._idle() == len(self.names), f"Slurm's workers ({self.folder})")

    def stop(self) -> None:
        """Ends all jobs and programs."""
        if "slurmctld" in self._running:
            self.slurm("scancel", "--user", getpass.getuser(), check=False)
        for process in reversed(self._running.values()):
            process.terminate()
        for process in self._running.values():
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        for name in self.names:
            _kill(self._processes_of(name))

    def start_worker(self, name: str) -> None:
        self._launch(name, "slurmd", "-D", "-N", name)

    def restart_worker(self, name: str) -> None:
        """As a machine that loses its power and comes back: nothing of it says goodbye. It comes
        back once Slurm believes what it says of its task.
        """
        task = self._processes_of(name)
        age = max((_age(pid) for pid in task), default=0.0)
        _kill([self._running[name].pid, *task])
        self._running.pop(name).wait()
        time.sleep(max(0.0, _BELIEVED - age))
        self.start_worker(name)

    def cpu_seconds(self, name: str) -> float:
        """What the task that a worker runs has taken so far."""
        ticks = 0
        for pid in self._processes_of(name):
            with suppress(OSError):
                fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
                ticks += int(fields[11]) + int(fields[12])
        return ticks / os.sysconf("SC_CLK_TCK")

    def slurm(self, *command: str, check: bool = True) -> str:
        """What a program of Slurm, or a script that calls them, says."""
        done = subprocess.run(
            command, env=self.variables, cwd=self.folder, capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 0 or not check, f"{command}: {done.stdout}{done.stderr}"
        return done.stdout.strip()

    def wait_for_end(self, seconds: float) -> None:
        """Of all jobs."""
        wait_for(lambda: not self.slurm("squeue", "--noheader"), "the jobs", seconds, every=0.2)

    def exit_codes(self, job: str) -> set[str]:
        """Of the tasks of a job that ended a short time ago."""
        return set(re.findall(r"ExitCode=(\S+)", self.slurm("scontrol", "show", "job", job)))

    def restarts(self) -> int:
        """How often tasks were put into the queue again."""
        shown = self.slurm("scontrol", "show", "job")
        return sum(map(int, re.findall(r"Restarts=(\d+)", shown)))

    def output(self) -> str:
        """What the jobs wrote."""
        files = sorted(self.folder.glob("slurm-*.out"))
        return "\n".join(path.read_text(errors="replace") for path in files)

    def _configuration(self) -> str:
        host, user, folder = socket.gethostname().split(".")[0], getpass.getuser(), self.folder
        ports = _free_ports(1 + len(self.names))
        nodes = "\n".join(
            f"NodeName={name} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=1"
            for name, port in zip(self.names, ports[1:], strict=True)
        )
        return f"""
ClusterName=glint
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
AuthType=auth/munge
# jobs that go back into the queue wait for their old credential to expire
AuthInfo=socket={folder}/munge.socket,cred_expire=5
SlurmUser={user}
SlurmdUser={user}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool/%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmdParameters=config_overrides
SchedulerParameters=sched_interval=1,sched_min_interval=0,batch_sched_delay=0
MpiDefault=none
ReturnToService=2
SlurmdTimeout=10
# a worker that starts again says which tasks it has; of tasks that are younger than these two it is
# not believed, and asked again a minute later
BatchStartTimeout=1
MessageTimeout=2
{nodes}
PartitionName=farm Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""

    def _idle(self) -> int:
        shown = self.slurm("sinfo", "--noheader", "--Node", "--format=%T", check=False)
        return shown.split().count("idle")

    def _launch(self, name: str, *command: str) -> None:
        with (self.folder / f"{name}.said").open("ab") as said:
            self._running[name] = subprocess.Popen(
                command, stdout=said, stderr=said, env=self.variables, start_new_session=True
            )

    def _processes_of(self, name: str) -> list[int]:
        """Of the tasks of a worker: their environments name it and this farm; and what started
        them, `slurmstepd`.
        """
        marks = (f"SLURMD_NODENAME={name}", f"SLURM_CONF={self.variables['SLURM_CONF']}")
        found = []
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                variables = (folder / "environ").read_bytes().decode(errors="replace").split("\0")
                command = (folder / "cmdline").read_bytes().decode(errors="replace")
            except OSError:
                continue
            if set(marks) <= set(variables):
                found.append(int(folder.name))
            elif command.startswith("slurmstepd") and marks[1] in variables:
                found += [int(folder.name)] if self._started_by(name, int(folder.name)) else []
        return found

    def _started_by(self, name: str, pid: int) -> bool:
        marks = f"{self.folder}/spool/{name}", f"{self.folder}/{name}.log"
        try:
            files = [str(link.readlink()) for link in Path(f"/proc/{pid}/fd").iterdir()]
        except OSError:
            return False
        return any(file.startswith(marks) for file in files)


@contextmanager
def slurm_farm(workers: int) -> Iterator[SlurmFarm]:
    """A farm that runs within."""
    folder = Path(tempfile.mkdtemp(prefix="slurm-"))  # short: sockets' paths have 108 bytes
    farm = SlurmFarm(folder, workers)
    try:
        farm.start()
        yield farm
    finally:
        farm.stop()
        shutil.rmtree(folder, ignore_errors=True)


def wait_for(
    is_so: Callable[[], object], what: str, seconds: float = 30.0, every: float = 0.05
) -> None:
    """Raises TimeoutError where it does not become so."""
    end = time.monotonic() + seconds
    while not is_so():
        if time.monotonic() > end:
            raise TimeoutError(f"waited {seconds:g} s for {what}")
        time.sleep(every)


def _kill(pids: list[int]) -> None:
    for pid in pids:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            continue


def _age(pid: int) -> float:
    """Seconds since a process began."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    uptime = float(Path("/proc/uptime").read_text().split()[0])
    return uptime - int(fields[19]) / os.sysconf("SC_CLK_TCK")


def _free_ports(count: int) -> list[int]:
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports
