"""start_program of deploy/common.sh, which deploy/demo and deploy/check-install start servers with."""

import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]

_STARTS = 8
_SCRIPT = f"""
. deploy/common.sh
bin=$1
for k in $(seq {_STARTS}); do
  echo "listening on 127.0.0.1:1" > "$1/log"
  start_program program "$1/log" 'listening on'
  echo "$announced"
done
"""


def test_what_an_earlier_run_announced_in_the_log_is_not_read(tmp_path):
    program = tmp_path / "program"
    program.write_text('#!/bin/sh\necho "listening on 127.0.0.1:2"\nexec sleep 60\n')
    program.chmod(0o755)
    ran = subprocess.run(["bash", "-c", _SCRIPT, "start", tmp_path], cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.stdout.split() == ["127.0.0.1:2"] * _STARTS, ran.stderr
