"""What is watched exists: every series of the dashboard and of the alerts is one of a running server."""

import json
import os
import pathlib
import re
import resource
import subprocess
import urllib.request

import pytest

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
MONITORING = REPOSITORY / "deploy/monitoring"
PROGRAM = os.environ.get("TOUCHSTONE_SERVER_PROGRAM") or REPOSITORY / "build/release/bin/touchstone-server"
SERIES = re.compile(r"\b(?:touchstone|grpc_server)_[a-z_]+\b")


@pytest.fixture
def server(request):
    """Its process and, once it serves, its pages' address."""
    options = ["--self-probe-s", str(getattr(request, "param", 60)), "--supershape-triangles", "2000"]
    with subprocess.Popen([PROGRAM, "--listen", "127.0.0.1:0", "--metrics", "127.0.0.1:0", *options],
                          stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        pages = None
        for line in process.stderr:
            pages = pages or re.search(r"metrics at (http://\S+)/metrics", line)
            if "listening on" in line:
                break
        yield process, pages.group(1)
        process.kill()


def get(url):
    with urllib.request.urlopen(url, timeout=30) as answer:
        return answer.read().decode()


def test_dashboard_and_alerts_name_series_that_exist(server):
    _, pages = server
    exposed = set(SERIES.findall(get(pages + "/metrics")))
    dashboard = json.loads((MONITORING / "touchstone.json").read_text())
    shown = {target["expr"] for panel in dashboard["panels"] for target in panel["targets"]}
    watched = re.findall(r"expr: (.*)", (MONITORING / "alerts.yml").read_text())
    documented = (REPOSITORY / "deploy/README.md").read_text()
    assert len(shown) > 10 and len(watched) > 4
    for expression in [*shown, *watched]:
        assert set(SERIES.findall(expression)) <= exposed, expression
    assert {name for name in exposed if not name.endswith(("_bucket", "_sum", "_count"))} <= set(SERIES.findall(documented))


def test_probes_are_answered(server):
    _, pages = server
    assert get(pages + "/livez") == "alive\n" and get(pages + "/readyz") == "ready\n"


@pytest.mark.parametrize("server", [0.3], indirect=True)
def test_a_server_that_nobody_can_connect_to_any_more_ends_to_be_started_anew(server):
    process, _ = server
    hard = resource.prlimit(process.pid, resource.RLIMIT_NOFILE)[1]
    resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (3, hard))  # as if all files were taken
    said = process.stderr.read()
    assert process.wait(timeout=120) == 70 and "nobody can reach this process any more" in said
