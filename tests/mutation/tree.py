"""A copy of the sources of a commit, into which the mutants are written and which is then built."""

import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import tarfile

import cpp_sites
import python_sites

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PROGRAMS = ("touchstone-server", "touchstone-gateway", "touchstone", "touchstone-probe")
PYTHON_PACKAGE = "client/python/touchstone"
_SITES = "build/sites"  # configured only: every file by itself, as libclang reads it


class Tree:
    def __init__(self, folder):
        self.root = pathlib.Path(folder) / "src"
        self.bin = self.root / "build/release/bin"
        self.python = self.root / "build/venv/bin/python"
        self._commands = {}

    def copy(self, commit):
        shutil.rmtree(self.root, ignore_errors=True)
        self.root.mkdir(parents=True)
        with subprocess.Popen(["git", "-C", ROOT, "archive", commit], stdout=subprocess.PIPE) as archive:
            with tarfile.open(fileobj=archive.stdout, mode="r|") as files:
                files.extractall(self.root)
        if archive.returncode:
            raise SystemExit(f"tests/mutation/run: git archive {commit} failed")
        # Tests look for data beside the repository.
        shared, link = ROOT.parent / "shared", self.root.parent / "shared"
        if shared.exists() and not link.exists():
            link.symlink_to(shared.resolve())
        (self.root / "tests/mutation").mkdir(exist_ok=True)
        shutil.copy(HERE / "mutant.h", self.root / "tests/mutation/mutant.h")
        shutil.copy(HERE / "touchstone_mutant.py", self.root / PYTHON_PACKAGE / "_mutant.py")

    def shell(self, script, log):
        """Runs what deploy/common.sh of the copy provides; True where it went well."""
        with open(self.root.parent / log, "ab") as output:
            return subprocess.run(["bash", "-c", f". deploy/common.sh; {script}"], cwd=self.root, stdin=subprocess.DEVNULL,
                                  stdout=output, stderr=subprocess.STDOUT, check=False).returncode == 0

    def configure(self):
        headers = f"ninja -C {_SITES} -t targets all | sed -n 's/^\\(generated.*\\.pb\\.h\\):.*/\\1/p' | xargs ninja -C {_SITES}"
        if not self.shell(f"set -e; cmake --preset release -B {_SITES} -DTOUCHSTONE_UNITY=OFF -DTOUCHSTONE_PRECOMPILE=OFF; {headers}",
                          "configure.log"):
            raise SystemExit(f"tests/mutation/run: the copy cannot be configured, see {self.root.parent}/configure.log")

    def load_commands(self):
        for entry in json.loads((self.root / _SITES / "compile_commands.json").read_text()):
            path = os.path.relpath(entry["file"], self.root)
            self._commands[path] = cpp_sites.compiler_flags(shlex.split(entry["command"]))

    def product_files(self):
        """{C++ file: the source file that it is read with}: what the programs are made of, in server/ and client/."""
        inputs = subprocess.run(["ninja", "-C", self.root / _SITES, "-t", "inputs", *(f"bin/{name}" for name in PROGRAMS)],
                                capture_output=True, text=True, check=True).stdout.split()
        paths = [os.path.relpath(path, self.root) for path in inputs]
        units = sorted({path for path in paths if re.match(r"(server|client)/.*\.cpp$", path) and path in self._commands})
        if not units:
            raise SystemExit("tests/mutation/run: ninja names no source file of the programs")
        files = {unit: unit for unit in units}
        # Headers: with a source file that includes them itself, best their own, or else through other headers.
        for unit in units:
            for header in self._includes(unit):
                if header not in files or unit == header[:-2] + ".cpp":
                    files[header] = unit
        pending = [path for path in files if path.endswith(".h")]
        while pending:
            header = pending.pop()
            for other in self._includes(header):
                if other not in files:
                    files[other] = files[header]
                    pending.append(other)
        return files

    def _includes(self, path):
        text = (self.root / path).read_text(errors="replace")
        return [name for name in re.findall(r'^#include "((?:server|client)/[^"]+\.h)"', text, re.MULTILINE) if (self.root / name).exists()]

    def python_files(self):
        return sorted(f"{PYTHON_PACKAGE}/{path.name}" for path in (self.root / PYTHON_PACKAGE).glob("*.py")
                      if path.name not in ("_mutant.py", "version.py"))

    def lines(self, paths):
        return sum((self.root / path).read_bytes().count(b"\n") for path in paths)

    def cpp_file(self, path, unit):
        return cpp_sites.File(self.root / path, self.root / unit, self._commands[unit])

    def python_file(self, path):
        return python_sites.File(self.root / path)

    def original(self, commit, path):
        return subprocess.run(["git", "-C", ROOT, "show", f"{commit}:{path}"], capture_output=True, check=True).stdout

    def write(self, number, mutant, source):
        module = python_sites if mutant.path.endswith(".py") else cpp_sites
        (self.root / mutant.path).write_bytes(module.mutated(source, number, mutant))

    def restore(self, commit, path):
        (self.root / path).write_bytes(self.original(commit, path))

    def build(self, log, targets=()):
        """True where all programs and tests are built and the Python packages installed, or these targets are built."""
        configure = "[[ -f build/release/build.ninja ]] || cmake --preset release -B build/release"
        return self.shell(f'({configure}) && nice -n 5 ninja -C build/release -k 0 -j "$(jobs_that_fit)" {" ".join(targets)}',
                          log) and (bool(targets) or self.shell("install_python_package && install_python_test_packages", log))

    def files_in_errors(self, log):
        """What the compiler names around its errors."""
        named = set()
        for line in (self.root.parent / log).read_text(errors="replace").splitlines():
            if re.search(r": (fatal )?error: |[Ii]n file included from|^ +from ", line):
                named.update(re.findall(r"(?:^|[ /])((?:server|client)/[\w/.-]+\.(?:h|cpp))\b", line))
        return named
