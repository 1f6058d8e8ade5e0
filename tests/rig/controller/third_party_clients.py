"""Checks that clients of other makers accept the emulated controller: ur_rtde's receive interface, and urx.

    python3 third_party_clients.py EMULATED_CONTROLLER VENV [--install]

VENV is a virtual environment with the packages; --install makes it first (from PyPI). Skips, saying so, what is
missing (exit code 77 if everything is). The emulator is a test tool: no number seen here was measured on anything.
"""

import os
import subprocess
import sys

ADDRESS = "127.0.0.77"  # a loopback address of its own: both packages insist on the standard ports
PACKAGES = {"ur_rtde": "rtde_receive", "urx": "urx"}
SKIPPED = 77

RECEIVE = r'''
import sys, time
import rtde_receive
receive = rtde_receive.RTDEReceiveInterface(sys.argv[1])
assert receive.isConnected()
names = sorted(name for name in dir(receive) if name.startswith("get") and name not in ("getDigitalInState", "getDigitalOutState"))
read, lacking = 0, []
for name in names:
    getter = getattr(receive, name)
    try:
        try:
            getter()
        except TypeError:  # takes the number of a register
            getter(12)
        read += 1
    except RuntimeError:  # what ur_rtde itself does not ask a CB3 for
        lacking.append(name)
assert not lacking or sys.argv[2] == "ur3", lacking
assert read >= 40, (read, lacking)
first = receive.getTimestamp()
assert first > 40, first
time.sleep(0.2)
assert receive.getTimestamp() > first
assert receive.getRobotMode() == 7 and receive.getSafetyMode() == 1
assert len(receive.getActualQ()) == 6 and len(receive.getActualTCPPose()) == 6
assert abs(receive.getActualQ()[1] + 1.5708) < 1e-3
receive.disconnect()
print("read", read, "getters", "without " + ", ".join(lacking) if lacking else "")
'''

URX = r'''
import sys, time
import urx
robot = urx.Robot(sys.argv[1])
try:
    begin = robot.secmon.get_cartesian_info(True)
    z = begin["Z"]
    robot.send_program("movel(pose_trans(get_target_tcp_pose(), p[0,0,0.02,0,0,0]), a=1.2, v=0.1)")
    until = time.time() + 20
    while abs(robot.secmon.get_cartesian_info(True)["Z"] - (z - 0.02)) > 1e-4:
        assert time.time() < until, "did not arrive"
    assert len(robot.getj()) == 6
    print("moved 20 mm")
finally:
    robot.close()
'''


def has(python, module):
    return subprocess.run([python, "-c", "import " + module], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                          check=False).returncode == 0


def main(arguments):
    install = "--install" in arguments
    places = [argument for argument in arguments if argument != "--install"]
    if len(places) != 2:
        print(__doc__)
        return 2
    emulator, environment = places
    python = os.path.join(environment, "bin", "python")
    if install:
        subprocess.run([sys.executable, "-m", "venv", environment], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *PACKAGES], check=True)
    failed = ran = 0
    for model in ("ur3e", "ur3"):
        for package, module in PACKAGES.items():
            if not has(python, module):
                print(f"SKIPPED {package} on {model}: not installed in {environment}")
                continue
            with subprocess.Popen([emulator, "--model=" + model, "--address=" + ADDRESS], stdin=subprocess.PIPE,
                                  stdout=subprocess.PIPE, text=True) as process:
                try:
                    process.stdout.readline()
                    script = RECEIVE if package == "ur_rtde" else URX
                    done = subprocess.run([python, "-c", script, ADDRESS, model], capture_output=True, text=True, timeout=120,
                                          check=False)
                finally:
                    process.stdin.close()
            ran += 1
            failed += done.returncode != 0
            print(f"{'PASSED' if done.returncode == 0 else 'FAILED'} {package} on {model}: {done.stdout.strip()}")
            if done.returncode != 0:
                print(done.stderr)
    return 1 if failed else 0 if ran else SKIPPED


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
