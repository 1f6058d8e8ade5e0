# What deploy/demo and deploy/test share; sourced, not run. Sets: root, bin, python.
# shellcheck shell=bash

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=$root/build/release/bin
python=$root/build/venv/bin/python
cd "$root" || exit

# Object files are found again by ccache although a clone lies elsewhere, and outlive the clone.
# The slackness is what ccache asks for to be used with precompiled headers; those are large.
export CCACHE_BASEDIR=$root CCACHE_NOHASHDIR=1 CCACHE_MAXSIZE=${CCACHE_MAXSIZE-12G}
export CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime

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

# wheel_options LIBRARIES: what CMake is told of programs for a wheel, one option a line; LIBRARIES is the folder of the libraries.
# Without OpenCV: its cameras would bring FFmpeg, GStreamer and GDAL, 240 MB more. With a static libarchive and the libraries
# that the dynamic one names, since its only call of glibc 2.36 is then answered by server/base/process/arc4random_buf.cpp, and the
# glibc 2.35 of Ubuntu 22.04 is enough.
wheel_options() {
  printf '%s\n' -DTOUCHSTONE_CAMERA=OFF "-Dpkgcfg_lib_ARCHIVE_archive=$1/libarchive.a" \
    "-DCMAKE_CXX_STANDARD_LIBRARIES=$(readelf -d "$1/libarchive.so" | sed -n 's/.*(NEEDED).*\[\(.*\)\].*/-l:\1/p' | paste -sd ' ')"
}

# build_arm64 TARGET ...: builds programs for a wheel of 64-bit ARM in build/arm64, with the libraries of a Debian 12 root in
# build/arm64_root that is unpacked and not set up.
build_arm64() {
  local sysroot=$root/build/arm64_root libraries link options
  # What the group build names, less what runs on this machine.
  libraries=$(awk '/^\[/ { inside = $1 == "[build]" } inside && /^[a-z0-9]/ { print $1 }' deploy/packages.txt |
    grep -vE '^(g\+\+|cmake|ninja-build|mold|ccache|pkg-config|git|npm|libopencv-.*)$' | paste -sd ,)
  if [[ ! -f $sysroot.made || $(< "$sysroot.made") != "$libraries" ]]; then
    rm -rf "$sysroot" build/arm64
    mmdebstrap --quiet --architectures=arm64 --variant=extract --include="$libraries" bookworm "$sysroot" || return
    # As seen from within the root: links lead to the root's files, and to what its alternatives would be.
    find "$sysroot" -type l -lname '/*' | while read -r link; do
      ln -sfnr "$sysroot$(readlink "$link")" "$link"
    done
    ln -s hdf5-serial.pc "$sysroot/usr/lib/aarch64-linux-gnu/pkgconfig/hdf5.pc"
    printf '%s' "$libraries" > "$sysroot.made"
  fi
  mapfile -t options < <(wheel_options "$sysroot/usr/lib/aarch64-linux-gnu")
  build release build/arm64 --toolchain "$root/cmake/aarch64.cmake" -DTOUCHSTONE_SYSROOT="$sysroot" "${options[@]}" -- "$@"
}

# The Python packages, built as the wheels that users install, in build/venv over Debian's NumPy and gRPC. Nothing
# is done when the files of the packages are those that were installed last.
install_python_package() {
  local sources stamp=$root/build/venv/touchstone.sha256
  # What the wheels are made of; generated stubs and what setuptools leaves behind are not.
  sources=$(find client/python client/training proto -type f -not -path '*/tests/*' -not -path '*/build/*' -not -path '*/dist/*' \
    -not -path '*.egg-info/*' -not -name '*_pb2*' -not -name '*.pyc' -print0 | sort -z | xargs -0 sha256sum)
  if [[ -x $python && -f $stamp && $(< "$stamp") == "$sources" ]]; then return; fi
  # Debian's own interpreter: another one in PATH would not see Debian's packages.
  [[ -x $python ]] || /usr/bin/python3 -m venv --system-site-packages build/venv || return
  rm -rf build/wheel
  "$python" -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir build/wheel client/python client/training || return
  # The distribution's name of before 0.3; its files are those of the new one.
  "$python" -m pip uninstall --quiet --yes touchstone 2>/dev/null || true
  "$python" -m pip install --quiet --no-deps --no-index --force-reinstall build/wheel/*.whl || return
  printf '%s' "$sources" > "$stamp"
}

# Clients of other makers, for tests/end_to_end/test_other_clients.py, beside the environment and not in it. Where PyPI
# cannot be reached those tests are skipped, and say so; that is no failure.
install_other_clients() {
  local wanted='ur_rtde==1.6.5 urpy==1.2.0 urx==0.11.0 math3d==4.0.0' into=$root/build/other_clients
  if [[ -f $into/installed && $(< "$into/installed") == "$wanted" ]]; then return; fi
  rm -rf "$into"
  # shellcheck disable=SC2086
  if "$python" -m pip install --quiet --disable-pip-version-check --retries 1 --timeout 10 --no-deps --target "$into" $wanted
  then
    printf '%s' "$wanted" > "$into/installed"
  else
    echo "PyPI cannot be reached: tests with clients of other makers are skipped"
  fi
}

# What the Python tests need from PyPI, in build/venv. Nothing is done when the list is the one that was installed last.
# Where PyPI cannot be reached those tests are skipped, and say so; that is no failure.
install_python_test_packages() {
  local stamp=$root/build/venv/python-packages.txt
  cmp -s deploy/python-packages.txt "$stamp" && return
  # Without what they depend on: they run on Debian's packages, whose versions pip would replace.
  if "$python" -m pip install --quiet --disable-pip-version-check --retries 1 --timeout 10 --no-deps \
    --requirement deploy/python-packages.txt; then
    cp deploy/python-packages.txt "$stamp"
  else
    echo "PyPI cannot be reached: tests that need $(grep -o '^[a-z0-9_-]*' deploy/python-packages.txt | paste -sd ' ') are skipped"
  fi
}

# An environment of its own with PyPI's current gRPC, protobuf and NumPy beside Grain, Ray and datasets, which need them: for
# test_grain.py, test_ray.py and test_formats.py of client/python/tests. Where PyPI cannot be reached those are skipped, and say so.
install_current_python() {
  local wanted='grain==0.2.18 ray[data]==2.60.0 grpcio==1.85.1 protobuf==7.36.2 numpy==2.4.6 datasets==5.2.0 pillow==12.0.0' into=$root/build/current_venv
  if [[ ! -f $into/installed || $(< "$into/installed") != "$wanted" ]]; then
    rm -rf "$into"
    /usr/bin/python3 -m venv "$into" || return
    # shellcheck disable=SC2086
    if ! "$into/bin/python" -m pip install --quiet --disable-pip-version-check --retries 1 --timeout 10 $wanted; then
      echo "PyPI cannot be reached: the tests with Grain, Ray and datasets are skipped"
      return 0
    fi
    printf '%s' "$wanted" > "$into/installed"
  fi
  "$into/bin/python" -m pip install --quiet --no-deps --no-index --force-reinstall build/wheel/touchstone_sim-*.whl
}

# The schemas of Kubernetes and of Argo's workflows, for tests/cluster, in an environment of their own. Where PyPI cannot be
# reached those tests are skipped, and say so.
install_cluster_checks() {
  local wanted='kubernetes-validate==1.37.0 hera==7.1.0' into=$root/build/cluster_venv
  if [[ -f $into/installed && $(< "$into/installed") == "$wanted" ]]; then return; fi
  rm -rf "$into"
  /usr/bin/python3 -m venv --system-site-packages "$into" || return
  # shellcheck disable=SC2086
  if "$into/bin/python" -m pip install --quiet --disable-pip-version-check --retries 1 --timeout 10 $wanted; then
    printf '%s' "$wanted" > "$into/installed"
  else
    echo "PyPI cannot be reached: the schemas of the manifests are not checked"
  fi
}

# What runs in the background, "PID NAME" each; stop_programs ends it.
programs=()

# start_program NAME LOG READY [argument ...]: starts a program of the build with its output in LOG, waits until a line
# says READY, and sets `announced` to the word that follows. It is stopped by stop_programs, at the latest when the script
# ends.
start_program() {
  local name=$1 log=$2 ready=$3 pid tries=0
  shift 3
  trap stop_programs EXIT
  trap 'exit 130' INT
  trap 'exit 143' TERM
  : > "$log"  # before the program runs: what an earlier one announced there is not read
  "$bin/$name" "$@" >> "$log" 2>&1 < /dev/null &
  pid=$!
  programs+=("$pid $name")
  until announced=$(sed -nE "/$ready /{s/.*$ready ([^ ]+).*/\\1/p;q}" "$log") && [[ -n $announced ]]; do
    if ! kill -0 "$pid" 2> /dev/null || ((++tries > 600)); then
      echo "$name did not start; its log, $log:" >&2
      tail -n 20 "$log" >&2
      return 1
    fi
    sleep 0.1
  done
}

# Asks what was started to drain and end, the last first; an exit status other than 0 is an error.
stop_programs() {
  local failed=0
  while [[ ${#programs[@]} -gt 0 ]]; do
    local pid name status=0
    read -r pid name <<< "${programs[-1]}"
    unset 'programs[-1]'
    kill -TERM "$pid" 2> /dev/null || true
    # What does not end in 20 s is killed, and then its status tells it.
    (sleep 20 && kill -KILL "$pid") > /dev/null 2>&1 &
    local watchdog=$!
    wait "$pid" || status=$?
    kill "$watchdog" 2> /dev/null || true
    ((status == 0)) || { echo "$name ended with exit status $status" >&2 && failed=1; }
  done
  return "$failed"
}

# start_server LOG [flag ...]: touchstone-server on a free port; sets server_address when its health check says SERVING.
start_server() {
  start_program touchstone-server "$1" 'listening on' --listen 127.0.0.1:0 "${@:2}" || return
  server_address=$announced
  "$python" deploy/wait-until-serving "$server_address" 30
}
