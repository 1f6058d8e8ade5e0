"""The disk fails at the n-th call of a program that writes files, or the program is killed there: for every n, until it comes
through. What it wrote is then whole or not there, and its exit status says which."""

from __future__ import annotations

import ctypes
import dataclasses
import errno
import json
import mmap
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import zlib

from programs import CLIENT, SERVER, Result, measurements, model_yaml, scratch

LIBRARY = "touchstone-failing-files"
MAX_CALLS = 20_000


class Plan(ctypes.Structure):
    """As failing_files.cpp lays it out."""

    _fields_ = [("folder", ctypes.c_char * 1024), ("fails_at", ctypes.c_int32), ("mode", ctypes.c_int32), ("error", ctypes.c_int32),
                ("calls", ctypes.c_int32), ("failed", ctypes.c_char * 64)]


@dataclasses.dataclass(frozen=True)
class Fault:
    """What the n-th call meets."""

    name: str
    mode: int
    error: int = 0
    passes: bool = False  # a program has to come through it
    kills: bool = False


NO_FAULT = Fault("none", 0)
FAULTS = (Fault("full from then on", 1, errno.ENOSPC), Fault("fails once", 0, errno.EIO), Fault("interrupted", 0, errno.EINTR),
          Fault("short", 2, passes=True), Fault("killed", 3, kills=True))


class FailingDisk:
    """The environment of a program whose calls on the files below a folder fail as said.

    Attributes:
      plan: what fails; what was seen.
    """

    def __init__(self, folder: pathlib.Path, state: pathlib.Path):
        state.write_bytes(bytes(ctypes.sizeof(Plan)))
        with state.open("r+b") as file:
            self._mapped = mmap.mmap(file.fileno(), ctypes.sizeof(Plan))
        self.plan = Plan.from_buffer(self._mapped)
        self.plan.folder = os.fsencode(folder.resolve())
        self.environment = {"LD_PRELOAD": str(SERVER.parent / f"{LIBRARY}.so"), "TOUCHSTONE_FAILING_FILES": str(state)}

    def set(self, fault: Fault, call: int) -> None:
        """call: which fails, from 1; 0: none."""
        self.plan.mode, self.plan.error, self.plan.calls, self.plan.failed = fault.mode, fault.error, 0, b""
        self.plan.fails_at = call

    def reached(self) -> bool:
        return self.plan.calls >= self.plan.fails_at


@dataclasses.dataclass(frozen=True)
class Command:
    """A command that writes below a folder. IN and OUT in its words are folders; `before` is what stands in OUT already."""

    name: str
    words: tuple[str, ...]
    before: tuple[str, ...] = ()  # copied from IN
    together: bool = False  # several files that are one thing: all or none
    resumes: bool = False  # the same command, run again, goes on with what is there
    python: bool = False  # words are an expression of Python

    def in_folder(self, word: str, inputs: pathlib.Path, out: pathlib.Path) -> str:
        return word.replace("IN/", f"{inputs}/").replace("OUT/", f"{out}/")


COMMANDS = (
    Command("export .h5", ("session", "export", "IN/session.db", "-o", "OUT/set.h5")),
    Command("replace .h5", ("session", "export", "IN/session.db", "--force", "-o", "OUT/old.h5"), before=("old.h5",)),
    Command("export .csv", ("session", "export", "IN/session.db", "-o", "OUT/set.csv")),
    Command("import .csv", ("session", "import", "IN/set.csv", "--session", "new", "-o", "OUT/journal.db")),
    Command("import .h5", ("session", "import", "IN/set.h5", "--session", "new", "-o", "OUT/journal.db")),
    Command("import beside others", ("session", "import", "IN/set.csv", "--session", "new", "-o", "OUT/session.db"), before=("session.db",)),
    Command("delete from a journal", ("session", "delete", "OUT/session.db", "a"), before=("session.db",)),
    Command("image set to .h5", ("session", "export", "IN/photos", "-o", "OUT/photos.h5")),
    Command("image set from .h5", ("session", "import", "IN/photos.h5", "-o", "OUT/photos"), together=True),
    Command("image set fixed", ("session", "fix", "IN/photos", "--mirror", "left-right", "-o", "OUT/photos"), together=True),
    Command("pictures normalised", ("normalize", "IN/photos", "-o", "OUT/photos"), together=True),
    Command("measurements fixed", ("session", "fix", "IN/set.csv", "--scale-times", "2", "-o", "OUT/fixed.csv")),
    Command("model", ("model", "new", "--spacing-mm", "30", "-o", "OUT/nominal.yaml")),
    Command("mesh", ("mesh", "supershape", "lat20", "--triangles", "400", "-o", "OUT/lat20.off")),
    Command("mesh corrected", ("mesh", "correct", "IN/lat00.off", "--map", "IN/lat00.surface.csv", "-o", "OUT/lat00.off")),
    Command("plan", ("plan", "lat20", "--count", "20", "-o", "OUT/plan.csv")),
    Command("touches", ("touch", "lat20", "--approach", "0,0,-1", "-o", "OUT/touches.csv")),
    Command("picture, depth and mask", ("capture", "lat20", "--approach", "0,0,-1", "--image", "32x32", "--depth", "--mask", "--renderer",
                                        "cpu", "-o", "OUT/side.png")),
    Command("reports", ("compare", "IN/set.csv", "--model", "IN/model.yaml", "--html", "OUT/report.html", "--json", "OUT/report.json")),
    Command("Python's measurements",
            ("from touchstone import measurements as m; m.write_measurements('OUT/set.csv', m.read_plan('IN/plan.csv'), force=True)",),
            python=True),
    Command("diagnosis", ("diagnose", "IN/set.csv", "--model", "IN/model.yaml", "--save-model", "OUT/found.yaml", "--html",
                          "OUT/report.html", "--json", "OUT/report.json")),
    Command("rehearsal's state", ("rehearse", "IN/plan.csv", "--model", "IN/noisy.yaml", "--effects", "object_scale", "--pairs", "0",
                                  "--sets", "1", "--state", "OUT/rehearsed.jsonl"), resumes=True),
    Command("measurements of another tool", ("import", "IN/parquet/data/train-00000-of-00001.parquet", "-o", "OUT/set.csv")),
    *(Command(f"export, {kind}", ("export", "IN/set.csv", "--to", kind, "-o", "OUT/data"), together=True)
      for kind in ("parquet", "lerobot", "webdataset", "hdf5", "mcap")),
    *(Command(f"dataset, {kind}", ("stream", "--samples", "12", "--shard-size", "6", "--to", kind, "--out", "OUT/data"), resumes=True)
      for kind in ("hdf5", "webdataset", "folder")),
)


def png(width: int, height: int, shade: int) -> bytes:
    """A grey picture with a dark square on white."""
    rows = b"".join(b"\0" + bytes(shade if width // 4 < x < 3 * width // 4 and height // 4 < y < 3 * height // 4 else 255 for x in range(width))
                    for y in range(height))

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)) + chunk(b"IDAT", zlib.compress(rows))
            + chunk(b"IEND", b""))


def client(words, environment=None, program=(str(CLIENT),)) -> subprocess.CompletedProcess:
    return subprocess.run([*program, *words], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL,
                          env=os.environ | {"TOUCHSTONE_PYTHON": sys.executable} | (environment or {}))


def _made(words) -> None:
    done = client(words)
    if done.returncode:
        raise RuntimeError(f"{words}: {done.stderr}")


def make_inputs(folder: pathlib.Path) -> None:
    (folder / "set.csv").write_bytes(measurements(60, 100_000.0))
    (folder / "model.yaml").write_text(model_yaml("tips", 2))
    (folder / "noisy.yaml").write_text(model_yaml("noisy", 2) + "  - gaussian_noise: {sigma_us: 500}\n")
    (folder / "old.h5").write_bytes(b"what was there before")
    photos = folder / "photos"
    photos.mkdir()
    (photos / "camera.yaml").write_text("{width_px: 32, height_px: 32, fx_px: 40, fy_px: 40, cx_px: 16, cy_px: 16}\n")
    rows = ["image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,up_z"]
    for k in range(3):
        (photos / f"picture_{k}.png").write_bytes(png(32, 32, 20 * k))
        rows.append(f"{k},picture_{k}.png,lat20,{300 + k},0,0,0,0,0,0,0,1")
    (photos / "images.csv").write_text("\n".join(rows) + "\n")
    (photos / "touches.csv").write_bytes(measurements(3, 5.0))
    _made(("session", "import", f"{folder}/set.csv", "--session", "a", "-o", f"{folder}/session.db"))
    _made(("session", "export", f"{folder}/session.db", "-o", f"{folder}/set.h5"))
    _made(("session", "export", f"{photos}", "-o", f"{folder}/photos.h5"))
    _made(("mesh", "supershape", "lat00", "--triangles", "200", "-o", f"{folder}/lat00.off"))
    _made(("plan", "lat20", "--count", "20", "-o", f"{folder}/plan.csv"))
    _made(("export", f"{folder}/set.csv", "--to", "parquet", "-o", f"{folder}/parquet"))
    (folder / "lat00.surface.csv").write_text("object,x_mm,y_mm,z_mm,departure_mm,std_dev_mm,length_mm,rms_mm\n"
                                              "lat00,0,0,75,0.5,0.1,20,0.5\nlat00,75,0,0,0.2,0.1,20,0.5\n")


def sessions_of(path: pathlib.Path) -> dict[str, str]:
    """Each session of a journal, and what it exports; of those in the trash the name."""
    if not path.exists() or not path.stat().st_size:
        return {}
    listed = client(("session", "list", str(path), "--json"))
    if "is empty" in listed.stderr:  # no table was made yet
        return {}
    if listed.returncode:
        return {"unreadable": listed.stderr}
    found = {}
    for session in json.loads(listed.stdout)["sessions"]:
        done = client(("session", "export", str(path), session["name"], "-o", "-"))
        found[session["name"]] = done.stdout or done.stderr
    for session in json.loads(client(("session", "list", str(path), "--deleted", "--json")).stdout)["sessions"]:
        found[f"deleted {session['name']}"] = ""
    return found


# SQLite needs its own files beside a journal, to recover when it is opened next.
JOURNAL_ENDINGS = (".db", ".db-journal", ".db-wal", ".db-shm", ".db.lock")


def content_of(folder: pathlib.Path) -> dict[str, object]:
    """Each file's bytes, by its name; of a journal its sessions."""
    found: dict[str, object] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.suffix == ".db":
            found |= {f"{name}: {session}": text for session, text in sessions_of(path).items()}
        elif path.is_file() and not name.endswith(JOURNAL_ENDINGS):
            found[name] = path.read_bytes()
    return found


def is_temporary(name: str) -> bool:
    return name.endswith((".part", ".part-journal", ".draft")) or ".part/" in name or ".lock" in name


def differences(command: Command, fault: Fault, found: dict, before: dict, after: dict, done: bool) -> list[str]:
    """What of the files found is neither as before nor as after the command; `done`: as it says itself."""
    wrong = []
    for name, data in found.items():
        if is_temporary(name) and (fault.kills or command.resumes):
            continue
        # A dataset's list of shards grows while it is written, and so do the sets of a rehearsal.
        if command.resumes and not done and (is_temporary(name) or name.endswith((".json", ".jsonl"))):
            continue
        if data != after.get(name) and data != before.get(name):
            wrong.append(f"{name} is {'torn' if name in after or name in before else 'left behind'}")
    missing = [name for name in after if found.get(name) != after[name]]
    if done and missing:
        wrong.append(f"it says that all is well, without {missing[:3]}")
    lost = [name for name in before if name not in found and name in after]
    if lost:
        wrong.append(f"lost {lost}")
    if command.together and not done and missing and "photos/images.csv" in found:
        wrong.append(f"an image set without {missing[:3]}")
    return wrong


class Trial:
    """Runs a command anew, with a fault at one of its calls."""

    def __init__(self, command: Command, folder: pathlib.Path, inputs: pathlib.Path):
        self.command, self.inputs, self.out = command, inputs, folder / "out"
        self.disk = FailingDisk(self.out, folder / "plan")
        self.words = [command.in_folder(word, inputs, self.out) for word in command.words]

    def run(self, fault: Fault, call: int) -> subprocess.CompletedProcess:
        shutil.rmtree(self.out, ignore_errors=True)
        self.out.mkdir()
        for name in self.command.before:
            shutil.copy(self.inputs / name, self.out / name)
        self.disk.set(fault, call)
        done = self.again(self.disk.environment)
        self.disk.plan.fails_at = 0
        return done

    def again(self, environment=None) -> subprocess.CompletedProcess:
        return client(self.words, environment, (sys.executable, "-c") if self.command.python else (str(CLIENT),))


def run_command(command: Command, faults, folder: pathlib.Path, inputs: pathlib.Path, result: Result) -> str:
    """Every fault at every call of one command. Gives what was seen."""
    trial = Trial(command, folder, inputs)
    before = {name: data for name, data in content_of(inputs).items() if name.split(":")[0] in command.before}
    done = trial.run(NO_FAULT, 0)
    if done.returncode:
        raise RuntimeError(f"{command.name}: {done.stderr}")
    after, calls, failed = content_of(trial.out), trial.disk.plan.calls, 0
    for fault in faults:
        for call in range(1, calls + 1):
            done = trial.run(fault, call)
            where = f"{command.name}, {fault.name} at call {call} of {calls} ({trial.disk.plan.failed.decode()})"
            success = done.returncode == 0
            failed += not success
            if fault.kills:
                result.expect(done.returncode == -9 or success, f"{where}: status {done.returncode}")
            else:
                result.expect(0 <= done.returncode < 126, f"{where}: status {done.returncode}: {done.stderr[-200:]}")
                result.expect(success or bool(done.stderr.strip()), f"{where}: no word of what is wrong")
                result.expect(success or not fault.passes, f"{where}: status {done.returncode}: {done.stderr[-200:]}")
            for wrong in differences(command, fault, content_of(trial.out), before, after, success):
                result.failures.append(f"{where}: {wrong}")
            if not success and fault.kills:
                _again(trial, where, after, result)
    return f"{command.name}: {calls} calls, {failed} of {calls * len(faults)} runs refused or killed"


def _again(trial: Trial, where: str, after: dict, result: Result) -> None:
    """What a killed command left is in nobody's way."""
    found = content_of(trial.out)
    complete = all(found.get(name) == data for name, data in after.items())
    if complete or (trial.command.together and "photos/images.csv" in found):
        return
    done = trial.again()
    result.expect(done.returncode == 0, f"{where}: the same command again: {done.stderr[-200:]}")
    found = content_of(trial.out)
    missing = [name for name in after if found.get(name) != after[name]]
    result.expect(not missing, f"{where}: the same command again leaves out {missing[:3]}")


def run(names: tuple[str, ...] = (), faults=FAULTS) -> Result:
    """names: of the commands; empty: all."""
    result = Result()
    with scratch() as folder:
        inputs = pathlib.Path(folder) / "in"
        inputs.mkdir()
        make_inputs(inputs)
        for command in COMMANDS:
            if not names or command.name in names:
                result.seen.append(run_command(command, faults, pathlib.Path(folder), inputs, result))
    return result
