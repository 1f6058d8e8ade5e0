"""Clients that were not written for this project, against the emulated controller, on both series.

UR's own Python RTDE client is not on PyPI under its own name (its setup.py says UrRtde); urpy 1.2.0 carries it, as
urpy.rtde. ur_rtde is the University of Southern Denmark's, urx is older. deploy/test puts them into
build/other_clients where it reaches PyPI; what is not there is skipped. The emulator is a test tool: no number seen
here was measured on anything.
"""
import importlib.machinery
import os
import pathlib
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(os.environ.get("TOUCHSTONE_BIN", ROOT / "build/release/bin"))
CLIENTS = pathlib.Path(os.environ.get("TOUCHSTONE_OTHER_CLIENTS", ROOT / "build/other_clients"))
CYCLE_S = {"ur3e": 0.002, "ur3": 0.008}
PATIENCE_S = 120


def needs(module):
    """Skips, saying why, where the package is not installed."""
    if importlib.machinery.PathFinder.find_spec(module, [str(CLIENTS)]) is None:
        pytest.skip(f"{module} is not in {CLIENTS}: PyPI could not be reached, or deploy/test was not run")


@pytest.fixture(params=["ur3e", pytest.param("ur3", marks=pytest.mark.second_tier("repeated: the CB3 table over the same code"))])
def controller(request):
    """Model, and a loopback address of its own: the packages insist on the standard ports."""
    pid = os.getpid()
    address = f"127.77.{pid // 250 % 250}.{pid % 250 + 1}"
    process = subprocess.Popen([BIN / "touchstone-emulated-controller", "--model=" + request.param, "--address=" + address],
                               stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        assert "Emulated controller" in process.stdout.readline()
        yield request.param, address
    finally:
        process.stdin.close()
        process.wait(timeout=PATIENCE_S)


def run(script, *arguments):
    """In a process of its own: a client that hangs or crashes is a failure like another."""
    done = subprocess.run([sys.executable, "-c", script, *map(str, arguments)], capture_output=True, text=True,
                          timeout=PATIENCE_S, env={**os.environ, "PYTHONPATH": str(CLIENTS)}, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


UR_CLIENT = r'''
import sys
from urpy.rtde import rtde
address, cycle_s, e_series = sys.argv[1], float(sys.argv[2]), sys.argv[3] == "ur3e"
client = rtde.RTDE(address, 30004)
client.connect()
assert client.get_controller_version()[:2] == ((5, 11) if e_series else (3, 15))
fields = {"timestamp": "DOUBLE", "target_q": "VECTOR6D", "actual_q": "VECTOR6D", "actual_TCP_pose": "VECTOR6D",
          "robot_mode": "INT32", "safety_mode": "INT32", "runtime_state": "UINT32", "robot_status_bits": "UINT32",
          "safety_status_bits": "UINT32", "speed_scaling": "DOUBLE", "target_speed_fraction": "DOUBLE",
          "actual_digital_input_bits": "UINT64", "joint_mode": "VECTOR6INT32", "elbow_position": "VECTOR3D",
          "payload_cog": "VECTOR3D", "output_int_register_24": "INT32", "output_bit_registers0_to_31": "UINT32",
          "input_int_register_24": "INT32", "output_bit_register_64": "BOOL", "safety_status": "INT32"}
if e_series:
    fields["tool_output_mode"] = fields["tool_digital_output0_mode"] = "UINT8"
assert client.send_output_setup(list(fields), list(fields.values()), frequency=1 / cycle_s)
inputs = client.send_input_setup(["input_int_register_24"], ["INT32"])
slider = client.send_input_setup(["speed_slider_mask", "speed_slider_fraction"], ["UINT32", "DOUBLE"])
assert inputs and slider
assert client.send_start()
inputs.input_int_register_24 = 4711
client.send(inputs)
slider.speed_slider_mask, slider.speed_slider_fraction = 1, 0.5
client.send(slider)
stamps, echoed = [], None
while len(stamps) < 300 or echoed is None:
    state = client.receive()
    stamps.append(state.timestamp)
    if state.input_int_register_24 == 4711 and state.target_speed_fraction == 0.5:
        echoed = echoed or state.timestamp
    assert len(stamps) < 3000, "the inputs never came back"
assert state.speed_scaling == 1, "the slider is no limiter"
assert state.robot_mode == 7 and state.safety_mode == 1 and state.runtime_state == 1
for before, after in zip(stamps, stamps[1:]):
    cycles = (after - before) / cycle_s
    assert cycles > 0.5 and abs(cycles - round(cycles)) < 1e-5, (before, after)
client.send_pause()
client.disconnect()
'''


def test_urs_python_client_reads_writes_and_sees_the_controllers_cycles(controller):
    needs("urpy")
    model, address = controller
    run(UR_CLIENT, address, CYCLE_S[model], model)


RECEIVE = r'''
import sys, time
import rtde_receive
receive = rtde_receive.RTDEReceiveInterface(sys.argv[1])
assert receive.isConnected()
# Not read: what ur_rtde reads from other versions of the controller only, and says so.
names = sorted(name for name in dir(receive)
               if name.startswith("get") and name not in ("getDigitalInState", "getDigitalOutState"))
read, lacking = 0, []
for name in names:
    getter = getattr(receive, name)
    try:
        try:
            getter()
        except TypeError:  # takes the number of a register
            getter(12)
        read += 1
    except RuntimeError:
        lacking.append(name)
assert read >= 40, (read, lacking)
first = receive.getTimestamp()
assert first > 40, first
until = time.time() + 60
while receive.getTimestamp() <= first + 0.1:
    assert time.time() < until
assert receive.getRobotMode() == 7 and receive.getSafetyMode() == 1
assert len(receive.getActualQ()) == 6 and len(receive.getActualTCPPose()) == 6
assert abs(receive.getActualQ()[1] + 1.5708) < 1e-3
receive.disconnect()
print(read, "getters;", "without", *lacking)
'''


def test_ur_rtde_receives(controller):
    needs("rtde_receive")
    _, address = controller
    lacking = run(RECEIVE, address).split("without")[1].split()
    # ur_rtde asks controllers from PolyScope 5.23 on for these, and CB3 never for the raw wrench.
    assert set(lacking) <= {"getActualCurrentAsTorque", "getActualMoment", "getFtRawWrench"}, lacking


CONTROL = r'''
import sys, time
import rtde_control, rtde_receive, rtde_io
address = sys.argv[1]
control = rtde_control.RTDEControlInterface(address)  # uploads its program to 30003 and waits until it is ready
receive = rtde_receive.RTDEReceiveInterface(address)
assert control.isConnected() and control.isProgramRunning()

def near(values, wanted, tolerance=1e-3):
    until = time.time() + 60
    while max(abs(a - b) for a, b in zip(values(), wanted)) > tolerance:
        assert time.time() < until, (values(), wanted)

joints = receive.getActualQ()
joints[0] += 0.1
assert control.moveJ(joints, 1.0, 1.4)
near(receive.getActualQ, joints)
pose = receive.getActualTCPPose()
pose[2] += 0.03
assert control.moveL(pose, 0.1, 0.5)
near(lambda: receive.getActualTCPPose()[:3], pose[:3])
assert control.setPayload(0.4, [0, 0, 0.03])
near(lambda: [receive.getPayload(), *receive.getPayloadCog()], [0.4, 0, 0, 0.03])
assert control.setTcp([0, 0, 0.1, 0, 0, 0])
near(control.getTCPOffset, [0, 0, 0.1, 0, 0, 0])
near(lambda: control.getInverseKinematics(receive.getActualTCPPose(), receive.getActualQ()), receive.getActualQ())
joints = receive.getActualQ()
tip = control.getForwardKinematics(joints, [0, 0, 0.1, 0, 0, 0])
near(lambda: tip[:3], receive.getActualTCPPose()[:3])
# Given a tool of zeros ur_rtde 1.6.5 sends 12 numbers of a recipe of 6: an answer, but of the tool that was given before.
near(lambda: control.getForwardKinematics(joints, [0] * 6), tip)
assert control.isSteady()
# An asynchronous motion that is stopped on its way.
pose = receive.getActualTCPPose()
before = pose[2]
pose[2] += 0.05
assert control.moveL(pose, 0.02, 0.5, True)
until = time.time() + 60
while receive.getActualTCPPose()[2] < before + 0.005:
    assert time.time() < until
control.stopL(2.0)
assert receive.getActualTCPPose()[2] < before + 0.04
# speedL writes its command into registers and does not wait for the program to read it: a speedStop that is written
# before the arm moves overwrites it, and the program of ur_rtde ends where it kills a thread that was never run.
before = receive.getActualTCPPose()[2]
assert control.speedL([0, 0, -0.01, 0, 0, 0], 0.5, 0.2)
until = time.time() + 60
while receive.getActualTCPPose()[2] > before - 0.001:
    assert time.time() < until
assert control.speedStop()
# The slider is its own number.
io = rtde_io.RTDEIOInterface(address)
assert io.setSpeedSlider(0.5)
near(lambda: [receive.getTargetSpeedFraction(), receive.getSpeedScaling()], [0.5, 1])
assert abs(receive.getSpeedScalingCombined() - 0.5) < 1e-9
control.stopScript()
until = time.time() + 60
while receive.getRuntimeState() != 1:
    assert time.time() < until, "the program goes on"
'''


def test_ur_rtde_controls(controller):
    needs("rtde_control")
    run(CONTROL, controller[1])


DASHBOARD = r'''
import sys
import dashboard_client
dashboard = dashboard_client.DashboardClient(sys.argv[1])
dashboard.connect()
assert dashboard.isConnected()
assert dashboard.robotmode() == "Robotmode: RUNNING", dashboard.robotmode()
assert dashboard.polyscopeVersion() == ("5.11.0.108249" if sys.argv[2] == "ur3e" else "3.15.8.106339")
assert dashboard.running() is False
if sys.argv[2] == "ur3e":
    assert dashboard.isInRemoteControl() is True
try:
    dashboard.stop()
    raise SystemExit("stop with nothing running is a failure")
except RuntimeError as error:
    assert "Failed to execute: stop" in str(error), error
dashboard.disconnect()
'''


def test_ur_rtdes_dashboard_client_understands_the_answers(controller):
    needs("dashboard_client")
    run(DASHBOARD, controller[1], controller[0])


URX = r'''
import sys, time
import urx
robot = urx.Robot(sys.argv[1])
try:
    z = robot.secmon.get_cartesian_info(True)["Z"]
    robot.send_program("movel(pose_trans(get_target_tcp_pose(), p[0,0,0.02,0,0,0]), a=1.2, v=0.1)")
    until = time.time() + 60
    while abs(robot.secmon.get_cartesian_info(True)["Z"] - (z - 0.02)) > 1e-4:
        assert time.time() < until, "did not arrive"
    assert len(robot.getj()) == 6
finally:
    robot.close()
'''


def test_urx_reads_states_and_sends_programs(controller):
    needs("urx")
    run(URX, controller[1])
