"""`touchstone stream --slurm` on a real Slurm cluster of three nodes on this machine, one of which dies."""
import filecmp
import json
import re
import subprocess

import pytest

import slurm_cluster

pytestmark = pytest.mark.skipif(bool(slurm_cluster.what_is_missing()), reason=slurm_cluster.what_is_missing())

SHARDS = 12
SPECIFICATION = ["--objects", "lat20,lat00", "--samples", str(500 * SHARDS), "--shard-size", "500", "--seed", "5",
                 "--image", "192x192", "--renderer", "cpu"]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    with slurm_cluster.SlurmCluster(tmp_path_factory.mktemp("slurm") / "cluster") as running:
        yield running


@pytest.fixture(scope="module")
def whole(bin_folder, tmp_path_factory):
    """The dataset as one process writes it."""
    folder = tmp_path_factory.mktemp("whole") / "data"
    subprocess.run([bin_folder / "touchstone", "stream", *SPECIFICATION, "--out", folder, "--quiet"], check=True, timeout=300)
    return folder


def submit(cluster, bin_folder, out, *options):
    done = cluster.run(bin_folder / "touchstone", "stream", *SPECIFICATION, "--out", out, "--slurm", "--json", *options)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def logs(out):
    return "".join(f"--- {path}\n{path.read_text()}" for path in sorted((out / "slurm").glob("*.log")))


def assert_same_dataset(out, whole):
    files = sorted(path.name for path in whole.iterdir())
    assert sorted(path.name for path in out.iterdir() if path.name != "slurm") == files, logs(out)
    _, different, unreadable = filecmp.cmpfiles(whole, out, files, shallow=False)
    assert not different and not unreadable


def test_a_node_that_dies_in_the_middle_changes_no_byte(cluster, bin_folder, whole, tmp_path):
    out = tmp_path / "data"
    submitted = submit(cluster, bin_folder, out, "--slurm-tasks", "6")
    assert (submitted["tasks"], submitted["shards"], submitted["complete"]) == (6, SHARDS, False)

    def victim():
        """A task that runs, has finished one of its two shards and begun another; and what it has of that."""
        for task in cluster.tasks():
            if task["JobState"] != "RUNNING" or not task.get("ArrayTaskId", "").isdigit():
                continue
            first, second = (out / f"shard-{shard:06d}.tar" for shard in range(int(task["ArrayTaskId"]), SHARDS, 6))
            part = second.with_suffix(".tar.part")
            if first.exists() and part.exists():
                return task, part
        return None

    found = []
    for _ in range(3):
        cluster.wait_until(lambda: found.append(victim()) or found[-1], 120, lambda: "no task was seen at work\n" + logs(out))
        task, part = found[-1]
        cluster.kill_node(task["NodeList"])
        if part.exists():
            break
        cluster.start_node(task["NodeList"])  # it had just finished: another one
    # Slurm misses the node, gives its task to another one, and the task begins again.
    restarted = {}

    def ended():
        for each in cluster.tasks():
            if int(each.get("Restarts", 0)) > 0:
                restarted[each["ArrayTaskId"]] = each
        return not cluster.run("squeue", "--noheader").stdout.strip()

    cluster.wait_until(ended, 240, lambda: cluster.run("squeue").stdout + logs(out))
    assert task["ArrayTaskId"] in restarted
    assert cluster.node_states()[task["NodeList"]].startswith("down")
    assert_same_dataset(out, whole)
    verified = subprocess.run([bin_folder / "touchstone", "dataset", "verify", out], capture_output=True, text=True, timeout=60, check=False)
    assert verified.returncode == 0, verified.stderr
    cluster.start_node(task["NodeList"])

    # The same command finds everything finished.
    assert submit(cluster, bin_folder, out, "--slurm-tasks", "6") == {
        "folder": str(out), "shards": SHARDS, "shards_found": SHARDS, "tasks": 0, "complete": True}


def test_only_what_is_missing_is_submitted_again(cluster, bin_folder, whole, tmp_path):
    out = tmp_path / "data"
    subprocess.run(["cp", "-r", whole, out], check=True)
    (out / "shard-000004.tar").unlink()
    submitted = submit(cluster, bin_folder, out)
    assert (submitted["tasks"], submitted["shards_found"]) == (1, SHARDS - 1)
    assert "#SBATCH --array=4\n" in (out / "slurm/array.sh").read_text()
    cluster.wait_until_ended(120)
    assert_same_dataset(out, whole)


def test_a_changed_shard_is_named_before_anything_is_submitted(cluster, bin_folder, whole, tmp_path):
    out = tmp_path / "data"
    subprocess.run(["cp", "-r", whole, out], check=True)
    with open(out / "shard-000004.tar", "r+b") as shard:
        shard.seek(700)
        byte = shard.read(1)
        shard.seek(700)
        shard.write(bytes([byte[0] ^ 1]))
    done = cluster.run(bin_folder / "touchstone", "stream", *SPECIFICATION, "--out", out, "--slurm")
    assert done.returncode == 2 and "shard-000004.tar" in done.stderr
    assert not (out / "slurm").exists()


def test_an_array_waits_for_an_earlier_one_of_the_same_dataset(cluster, bin_folder, whole, tmp_path):
    out = tmp_path / "data"
    submit(cluster, bin_folder, out, "--slurm-option=--begin=now+2")
    submit(cluster, bin_folder, out)
    cluster.wait_until_ended(240)
    assert_same_dataset(out, whole)
    assert "another run is writing there" not in logs(out)


def test_a_task_whose_server_cannot_be_reached_is_tried_again(cluster, bin_folder, whole, tmp_path):
    out = tmp_path / "data"
    program = bin_folder / "touchstone-server"

    def start_server(listen):
        """The server, which listens by then, and its address."""
        started = subprocess.Popen([program, "--listen", listen, "--renderer", "cpu"], stdout=subprocess.PIPE,
                                   stderr=subprocess.DEVNULL, text=True)
        return started, re.search(r"listening on (\S+)", started.stdout.readline()).group(1)

    specification = [word for word in SPECIFICATION if word not in ("--renderer", "cpu")]
    server, address = start_server("127.0.0.1:0")
    try:
        done = cluster.run(bin_folder / "touchstone", "stream", *specification, "--out", out, "--server", address,
                           "--wait-s", "2", "--slurm", "--slurm-tasks", "2", "--slurm-option=--hold", "--json")
        assert done.returncode == 0, done.stderr
        server.kill()
        server.wait()
        assert cluster.run("scontrol", "release", json.loads(done.stdout)["slurm_job"]).returncode == 0
        cluster.wait_until(lambda: any(int(task.get("Restarts", 0)) > 0 for task in cluster.tasks()), 60,
                           lambda: "no task was started again\n" + cluster.run("squeue").stdout + logs(out))
        server, _ = start_server(address)
        cluster.wait_until_ended(240)
        # dataset.json differs: here the server chose the renderer.
        shards = [path.name for path in whole.glob("shard-*")]
        assert filecmp.cmpfiles(whole, out, shards, shallow=False) == (shards, [], [])
        assert subprocess.run([bin_folder / "touchstone", "dataset", "verify", out, "--quiet"], timeout=60, check=False).returncode == 0
    finally:
        server.kill()
        server.wait()
