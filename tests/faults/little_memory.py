"""Commands and a server get less memory than they ask for (RLIMIT_AS): each says so and ends with a status, never by a signal, and what
it wrote is whole or not there."""

from __future__ import annotations

import pathlib
import subprocess

import grpc

import failing_files
from programs import CLIENT, GATEWAY, SERVER, Result, Server, create_session, measurements, scratch

NAMES = ("export .h5", "import .csv", "image set from .h5", "mesh", "plan", "reports")
MIB = 1 << 20


def _limits_mib(words: list[str], steps: int) -> list[int]:
    """From what the program needs to say its version to what the command needs."""
    def comes_through(limit_mib: int, what: list[str]) -> bool:
        return subprocess.run(_limited(limit_mib, what), capture_output=True, check=False).returncode == 0

    low = next(limit for limit in range(50, 8000, 50) if comes_through(limit, [str(CLIENT), "--version"]))
    high = next(limit for limit in range(low, 16000, 200) if comes_through(limit, words))
    return sorted({low + (high - low) * k // steps for k in range(steps + 1)})


def _limited(limit_mib: int, words: list[str]) -> list[str]:
    return ["prlimit", f"--as={limit_mib * MIB}", *words]


def run_command(command: failing_files.Command, steps: int, folder: pathlib.Path, inputs: pathlib.Path, result: Result) -> str:
    out = folder / "out"
    words = [str(CLIENT), *(command.in_folder(word, inputs, out) for word in command.words)]

    def anew() -> list[str]:
        subprocess.run(["rm", "-rf", str(out)], check=True)
        out.mkdir()
        return words

    limits = _limits_mib(["sh", "-c", 'rm -rf "$0"; mkdir "$0"; exec "$@"', str(out), *words], steps)
    subprocess.run(anew(), capture_output=True, check=True)
    after, refused = failing_files.content_of(out), 0
    for limit in limits:
        done = subprocess.run(_limited(limit, anew()), capture_output=True, text=True, check=False)
        where = f"{command.name} with {limit} MiB"
        result.expect(0 <= done.returncode < 126, f"{where}: status {done.returncode}: {done.stderr[-200:]}")
        result.expect(done.returncode == 0 or bool(done.stderr.strip()), f"{where}: no word of what is wrong")
        found = {name: data for name, data in failing_files.content_of(out).items() if not failing_files.is_temporary(name)}
        result.expect(all(after.get(name) == data for name, data in found.items()), f"{where}: something is torn: {sorted(found)}")
        result.expect(done.returncode != 0 or found == after, f"{where}: it says that all is well")
        refused += done.returncode != 0
    return f"{command.name}: {refused} of {len(limits)} limits from {limits[0]} to {limits[-1]} MiB are too small, and it says so"


def run_server(limits_mib: tuple[int, ...], result: Result) -> str:
    refused = ended = 0
    for limit in limits_mib:
        with scratch() as folder:
            try:
                server = Server("--sessions-dir", folder, "--max-sessions-mib", "100000", "--max-session-mib", "2000", memory_mib=limit)
            except RuntimeError as error:
                result.expect("memory" in str(error), f"a server of {limit} MiB does not start and does not say why: {error}")
                ended += 1
                continue
            with server, server.channel() as channel:
                for k in range(12):
                    try:
                        create_session(channel, f"s{k}", measurements(4000 << k, 1.0), piece=1 << 20)
                    except grpc.RpcError as error:
                        result.expect(error.code() in (grpc.StatusCode.RESOURCE_EXHAUSTED, grpc.StatusCode.UNAVAILABLE),
                                      f"{limit} MiB: {error.code()}: {error.details()}")
                        refused += 1
                        break
                if not server.alive():
                    status = server.process.wait()
                    result.expect(status == 71, f"{limit} MiB: the server ended with {status}: {''.join(server.log)[-300:]}")
                    ended += 1
    return f"a server of {limits_mib} MiB: {refused} sessions were refused, {ended} processes ended and said why"


START_LIMITS_MIB = (120, 200, 260, 300, 350, 400, 500)
START_S = 20.0  # far more than a program takes that does not hang
WORDS_OF_WANT = ("not enough memory", "failed to map segment", "cannot allocate")  # the last two are the dynamic linker's


def run_starts(limits_mib: tuple[int, ...], result: Result) -> str:
    """Programs whose libraries get no memory before main() is reached."""
    started = refused = 0
    with scratch() as folder:
        (pathlib.Path(folder) / "set.csv").write_bytes(measurements(30, 1000.0))
        for words in ([str(CLIENT), "--help"], [str(CLIENT), "diagnose", f"{folder}/set.csv"], [str(SERVER), "--version"],
                      [str(GATEWAY), "--version"]):
            for limit in limits_mib:
                where = f"{words[0].rsplit('/', 1)[-1]} {words[1]} with {limit} MiB"
                try:
                    done = subprocess.run(_limited(limit, words), capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL,
                                          timeout=START_S)
                except subprocess.TimeoutExpired:
                    result.failures.append(f"{where}: it hangs")
                    continue
                said = any(word in done.stderr for word in WORDS_OF_WANT)
                result.expect(0 <= done.returncode < 128 and (done.returncode == 0 or said),
                              f"{where}: status {done.returncode}: {done.stderr[-200:]}")
                started, refused = started + (done.returncode == 0), refused + (done.returncode != 0)
    return f"starts with {limits_mib} MiB: {started} came through, {refused} said that there is not enough memory"


def run(steps: int = 12, names: tuple[str, ...] = NAMES, limits_mib: tuple[int, ...] = (1500, 2500, 4000)) -> Result:
    """steps: limits that are tried of each command; limits_mib: of a server."""
    result = Result()
    result.seen.append(run_starts(START_LIMITS_MIB, result))
    with scratch() as folder:
        inputs = pathlib.Path(folder) / "in"
        inputs.mkdir()
        failing_files.make_inputs(inputs)
        for command in failing_files.COMMANDS:
            if command.name in names:
                result.seen.append(run_command(command, steps, pathlib.Path(folder), inputs, result))
    if limits_mib:
        result.seen.append(run_server(limits_mib, result))
    return result
