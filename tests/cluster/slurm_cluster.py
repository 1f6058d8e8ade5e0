"""A Slurm cluster on this machine: a slurmctld and several slurmd on ports of their own, each a node of one core."""
import contextlib
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import time

PROGRAMS = ("slurmctld", "slurmd", "sbatch", "squeue", "scontrol")


def what_is_missing():
    """Why no cluster can be started here; empty if one can."""
    missing = [name for name in PROGRAMS if not shutil.which(name)]
    if missing:
        return f"{', '.join(missing)} not installed: deploy/setup --cluster"
    return "" if os.geteuid() == 0 else "slurmd runs as root only"


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    try:
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]
    finally:
        for each in sockets:
            each.close()


class SlurmCluster:
    """Started by `with`; `environment` is for sbatch and its like."""

    def __init__(self, folder, nodes=3):
        self.folder = pathlib.Path(folder)
        self.nodes = [f"n{number}" for number in range(1, nodes + 1)]
        self.environment = {**os.environ, "SLURM_CONF": str(self.folder / "slurm.conf")}
        self._processes = {}
        self._log = None

    def __enter__(self):
        self.folder.mkdir(parents=True)
        (self.folder / "state").mkdir()
        host = socket.gethostname().split(".")[0]
        controller, *ports = free_ports(1 + len(self.nodes))
        lines = [
            "ClusterName=touchstone", f"SlurmctldHost={host}(127.0.0.1)", f"SlurmctldPort={controller}",
            # No key to share: whoever reaches the ports may submit. On a machine alone, for a test.
            "AuthType=auth/none", "CredType=cred/none",
            "ProctrackType=proctrack/linuxproc", "TaskPlugin=task/none", "SlurmUser=root", "SlurmdUser=root",
            "SelectType=select/cons_tres", "SelectTypeParameters=CR_CPU", "SlurmdParameters=config_overrides",
            "JobAcctGatherType=jobacct_gather/none", "AccountingStorageType=accounting_storage/none",
            "MpiDefault=none", "ReturnToService=2", "JobRequeue=1",
            # A dead node is noticed within seconds, not within the five minutes of a real cluster.
            # A task that is begun again waits until its credential has expired, by default two minutes.
            "AuthInfo=cred_expire=5", "SlurmdTimeout=8", "KillWait=2", "SchedulerParameters=batch_sched_delay=0,sched_interval=1",
            f"StateSaveLocation={self.folder}/state", f"SlurmdSpoolDir={self.folder}/spool.%n",
            f"SlurmctldPidFile={self.folder}/slurmctld.pid", f"SlurmdPidFile={self.folder}/slurmd.%n.pid",
            f"SlurmctldLogFile={self.folder}/slurmctld.log", f"SlurmdLogFile={self.folder}/slurmd.%n.log",
        ]
        lines += [f"NodeName={name} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=1 State=UNKNOWN"
                  for name, port in zip(self.nodes, ports)]
        lines.append(f"PartitionName=all Nodes={','.join(self.nodes)} Default=YES MaxTime=INFINITE State=UP")
        (self.folder / "slurm.conf").write_text("\n".join(lines) + "\n")
        self._log = open(self.folder / "output.log", "wb")
        try:
            self._start("slurmctld", "slurmctld", "-D")
            for name in self.nodes:
                self.start_node(name)
            self.wait_until(lambda: all(state == "idle" for state in self.node_states().values()), 60,
                            lambda: f"nodes are not idle: {self.node_states()}; {self.folder}")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for node in self.nodes:
            self.kill_node(node)
        for process in self._processes.values():
            process.terminate()
        for process in self._processes.values():
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if self._log:
            self._log.close()

    def _start(self, key, *command):
        self._processes[key] = subprocess.Popen(command, env=self.environment, stdin=subprocess.DEVNULL, stdout=self._log,
                                                stderr=self._log, start_new_session=True)

    def start_node(self, name):
        self._start(name, "slurmd", "-D", "-N", name)

    def kill_node(self, name):
        """All of a node at once, as when its power fails: slurmd, and what runs in its jobs."""
        process = self._processes.pop(name, None)
        if process is None:
            return
        # Held first, so that none of them is left to tell the controller what became of another.
        process.send_signal(signal.SIGSTOP)
        pids = self._processes_of(name)
        for what in (signal.SIGSTOP, signal.SIGKILL):
            for pid in pids:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, what)
        process.kill()
        process.wait()

    def _processes_of(self, name):
        """Of a node's jobs: their environment says whose they are; their slurmstepd, whose does not, is their parent."""
        marks = {f"SLURM_CONF={self.folder}/slurm.conf".encode(), f"SLURMD_NODENAME={name}".encode()}
        found = set()
        for entry in pathlib.Path("/proc").iterdir():
            try:
                if entry.name.isdigit() and marks <= set((entry / "environ").read_bytes().split(b"\0")):
                    found.add(int(entry.name))
                    parent = (entry / "stat").read_text().rpartition(")")[2].split()[1]
                    if pathlib.Path("/proc", parent, "comm").read_text().strip() == "slurmstepd":
                        found.add(int(parent))
            except OSError:
                pass
        return found

    def run(self, *command, **options):
        return subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=120, check=False, **options)

    def node_states(self):
        output = self.run("sinfo", "--noheader", "--Node", "--format=%N %T").stdout
        return dict(line.split() for line in output.splitlines())

    def tasks(self):
        """Of every array task that has not ended, and of those that have just ended: the fields of `scontrol show job`."""
        output = self.run("scontrol", "--oneliner", "show", "job").stdout
        return [dict(word.partition("=")[::2] for word in line.split()) for line in output.splitlines() if "JobId=" in line]

    def wait_until_ended(self, timeout_s):
        self.wait_until(lambda: not self.run("squeue", "--noheader").stdout.strip(), timeout_s,
                        lambda: "still in the queue:\n" + self.run("squeue").stdout)

    @staticmethod
    def wait_until(condition, timeout_s, explain):
        end = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end, explain()
            time.sleep(0.2)
