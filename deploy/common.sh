# What deploy/demo and deploy/test share; sourced, not run. Sets: root, bin, python.
# shellcheck shell=bash

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=$root/build/release/bin
python=$root/build/venv/bin/python
cd "$root" || exit

# Object files are found again by ccache although a clone lies elsewhere, and outlive the clone.
export CCACHE_BASEDIR=$root CCACHE_NOHASHDIR=1

# Jobs of a build: one a core, but 1.5 GB of memory each (the protocol's translation units need it).
jobs_that_fit() {
  local cores memory_kb
  cores=$(nproc)
  memory_kb=$(sed -n 's/^MemAvailable: *\([0-9]*\) kB/\1/p' /proc/meminfo)
  local fit=$((memory_kb / 1500000))
  ((fit >= 1)) || fit=1
  echo $((fit < cores ? fit : cores))
}

# build PRESET DIRECTORY [cmake option ...] [-- target ...]: configures if nothing is configured there yet and
# builds. CMake configures again by itself where its files have changed.
build() {
  local preset=$1 directory=$2
  shift 2
  local options=() targets=()
  while [[ $# -gt 0 && $1 != -- ]]; do
    options+=("$1")
    shift
  done
  [[ $# -le 1 ]] || targets=(--target "${@:2}")
  if [[ ! -f $directory/build.ninja ]]; then
    cmake --preset "$preset" -B "$directory" "${options[@]}" || return
  fi
  cmake --build "$directory" -j "$(jobs_that_fit)" "${targets[@]}"
}

# The Python package, built as the wheel that users install, in build/venv over Debian's NumPy and gRPC. Nothing
# is done when the files of the package are those that were installed last.
install_python_package() {
  local sources stamp=$root/build/venv/touchstone.sha256
  # What the wheel is made of; generated stubs and what setuptools leaves behind are not.
  sources=$(find client/python proto -type f -not -path '*/tests/*' -not -path '*/build/*' -not -path '*/dist/*' \
    -not -path '*.egg-info/*' -not -name '*_pb2*' -not -name '*.pyc' -print0 | sort -z | xargs -0 sha256sum)
  if [[ -x $python && -f $stamp && $(< "$stamp") == "$sources" ]]; then return; fi
  # Debian's own interpreter: another one in PATH would not see Debian's packages.
  [[ -x $python ]] || /usr/bin/python3 -m venv --system-site-packages build/venv || return
  rm -rf build/wheel
  "$python" -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir build/wheel client/python || return
  "$python" -m pip install --quiet --no-deps --no-index --force-reinstall build/wheel/*.whl || return
  printf '%s' "$sources" > "$stamp"
}

server_pid=
server_address=

# start_server LOG [flag ...]: starts touchstone-server on a free port, waits until its health check says SERVING,
# and sets server_address. It is stopped by stop_server, at the latest when the script ends.
start_server() {
  local log=$1
  shift
  trap stop_server EXIT
  trap 'exit 130' INT
  trap 'exit 143' TERM
  "$bin/touchstone-server" --listen 127.0.0.1:0 "$@" > "$log" 2>&1 < /dev/null &
  server_pid=$!
  # Port 0 is any free one; the line 'listening on HOST:PORT' tells which.
  local tries=0
  until server_address=$(sed -nE '/listening on /{s/.*listening on ([^ ]+).*/\1/p;q}' "$log") && [[ -n $server_address ]]; do
    if ! kill -0 "$server_pid" 2> /dev/null || ((++tries > 300)); then
      echo "touchstone-server did not start; its log, $log:" >&2
      tail -n 20 "$log" >&2
      return 1
    fi
    sleep 0.1
  done
  "$python" deploy/wait-until-serving "$server_address" 30
}

# Asks it to drain and end; an exit status other than 0 is an error.
stop_server() {
  [[ -n $server_pid ]] || return 0
  local pid=$server_pid
  server_pid=
  kill -TERM "$pid" 2> /dev/null || true
  # A server that does not end in 20 s is killed, and then its status tells it.
  (sleep 20 && kill -KILL "$pid") > /dev/null 2>&1 &
  local watchdog=$! status=0
  wait "$pid" || status=$?
  kill "$watchdog" 2> /dev/null || true
  if ((status != 0)); then
    echo "touchstone-server ended with exit status $status" >&2
    return 1
  fi
}
