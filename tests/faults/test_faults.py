"""The programs of this folder, small: each keeps its promise, and each can see one that is broken."""

import grpc
import pytest

import clock_jumps
import disk_full
import failing_files
import failing_stores
import failover
import flat_memory
import floods
import hostile_bytes
import kill_gateway
import kill_while_writing
import little_memory
import lost_device
import many_clients
import own_cgroup
import programs
import replicas
import silent_and_slow
import slow_streams


def passes(result):
    assert not result.failures, "\n".join(result.failures[:10])
    assert result.seen


def test_what_was_acknowledged_before_a_kill_is_there():
    passes(kill_while_writing.run(kills=8))


def test_a_killed_gateway_keeps_the_touches_it_acknowledged():
    passes(kill_gateway.run(kills=4))


def test_of_two_replicas_one_gets_a_name():
    passes(replicas.run(names=10))


def test_a_full_disk_loses_nothing_that_was_acknowledged():
    try:
        passes(disk_full.run())
    except PermissionError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("limit_mib, streams", [(300, 10), pytest.param(600, 40, marks=pytest.mark.second_tier(
    "repeated: a larger group and more streams"))])
def test_a_server_lives_within_the_memory_limit_of_its_own_cgroup(limit_mib, streams):
    try:
        passes(own_cgroup.run(limit_mib, streams))
    except PermissionError as error:
        pytest.skip(str(error))


QUICK_FAULTS = ("full from then on", "killed")  # that differ in what the program can still do; the tests in C++ have all of them


@pytest.mark.parametrize("command, faults", [
    *(("export .h5", (fault,)) for fault in QUICK_FAULTS),
    pytest.param("import .csv", QUICK_FAULTS, marks=pytest.mark.second_tier("long: two hundred kills of an import")),
    pytest.param("", (), marks=pytest.mark.second_tier("repeated: every other command that writes"), id="all")])
def test_a_failing_disk_or_a_kill_leaves_whole_files_or_none(command, faults):
    chosen = [fault for fault in failing_files.FAULTS if not faults or fault.name in faults]
    passes(failing_files.run((command,) if command else (), chosen))


def test_libraries_without_memory_do_not_hang_a_program():
    result = programs.Result()
    result.seen.append(little_memory.run_starts((260, 350), result))
    passes(result)


def test_a_server_whose_disk_fails_keeps_what_it_acknowledged():
    result = programs.Result()
    result.seen.append(failing_stores.run_server(failing_stores.LIVING[:2], 9, result))
    passes(result)


def test_a_gateway_whose_disk_fails_keeps_what_it_acknowledged():
    result = programs.Result()
    result.seen.append(failing_stores.run_gateway(failing_stores.LIVING[:2], 7, result))
    passes(result)


@pytest.mark.second_tier("repeated: every call instead of some")
def test_servers_whose_disks_fail_keep_what_they_acknowledged():
    passes(failing_stores.run())


@pytest.mark.second_tier("repeated: the same commands with less memory each time")
def test_a_program_without_memory_says_so_and_leaves_whole_files_or_none():
    passes(little_memory.run())


HOSTILE_PARTS = 4


@pytest.mark.parametrize("part", range(HOSTILE_PARTS))
@pytest.mark.parametrize("source", hostile_bytes.SOURCES, ids=["server", "gateway"])
def test_every_method_answers_hostile_bytes(source, part):
    passes(hostile_bytes.run(calls=8, sources=(source,), part=(part, HOSTILE_PARTS)))


def test_the_second_server_takes_over_where_the_first_is_killed():
    passes(failover.run(blows=2, signals=("SIGKILL",), samples=20_000))


@pytest.mark.second_tier("repeated: more blows, and such that only silence tells, 8 s each")
@pytest.mark.parametrize("client", ["command line", "python"])
def test_the_second_server_takes_over_whatever_happens_to_the_first(client):
    passes(failover.run(blows=30, clients=(client,)))


def test_many_clients_get_the_same_bytes():
    passes(many_clients.run(clients=60))


def test_memory_is_flat_over_a_long_stream():
    passes(flat_memory.run(samples=5_000_000))


@pytest.mark.parametrize("handshake_s", [1, pytest.param(10, marks=pytest.mark.second_tier(
    "long: limits of a server as they are by default"))])
def test_silent_and_slow_clients_do_not_shut_others_out(handshake_s):
    passes(silent_and_slow.run(handshake_s=handshake_s))


QUICK_FLOODS = ("rapid resets of streams", "whole calls of every other method", "heads without an end", "pings whose answers nobody reads",
                "reflection without a message")


@pytest.mark.parametrize("seconds, names", [(1.5, QUICK_FLOODS), pytest.param(60, (), marks=pytest.mark.second_tier(
    "long: every flood for a minute"))], ids=["some", "all"])
@pytest.mark.parametrize("source", floods.SOURCES)
def test_a_flood_keeps_nobody_from_asking_and_stopping(seconds, names, source):
    passes(floods.run(seconds=seconds, names=names, sources=(source,), slack=10 if names else 1))


@pytest.mark.parametrize("part", clock_jumps.PARTS)
def test_a_clock_that_is_set_changes_no_limit_and_no_byte(part):
    passes(clock_jumps.run(jumps=8, names=("an hour back",), parts=(part,)))


@pytest.mark.second_tier("repeated: more jumps of the host's clock")
def test_clocks_that_are_set_by_years_change_no_limit_and_no_byte():
    passes(clock_jumps.run(jumps=20, names=("an hour back", "fifteen years ahead")))


@pytest.mark.parametrize("pictures, resets, absences", [(600, 4, 1), pytest.param(6000, 10, 2, marks=pytest.mark.second_tier(
    "repeated: more losses of a graphics device"))])
def test_a_graphics_device_that_is_lost_changes_no_picture(pictures, resets, absences):
    passes(lost_device.run(pictures, resets, absences))


@pytest.mark.parametrize("kinds", [slow_streams.KINDS[:1], pytest.param(slow_streams.KINDS, marks=pytest.mark.second_tier(
    "repeated: streams that are slow for other reasons"))], ids=["one", "all"])
def test_a_quick_stream_does_not_wait_for_slow_ones_of_its_address(kinds):
    passes(slow_streams.run(streams=4, times=3, kinds=kinds))


def test_a_loss_and_a_tear_are_seen():
    written, result = kill_while_writing.Written(), programs.Result()
    with programs.scratch() as folder, programs.Server("--sessions-dir", folder) as server, server.channel() as channel:
        programs.create_session(channel, "torn", programs.measurements(40, 1.0))
        written.sent = {"torn": programs.measurements(40, 2.0), "lost": b""}
        written.acknowledged = {"torn", "lost"}
        kill_while_writing.check(server, written, result)
    assert len(result.failures) == 2 and "lost" in result.failures[0] and "torn" in result.failures[1]


def test_a_touch_that_a_session_lost_or_changed_is_seen():
    from touchstone.v1 import source_pb2

    answers = {}
    for number, first_s in enumerate((0.001, 0.002, 0.003)):
        answer = source_pb2.TouchResponse()
        answer.results.add().contact_time_s.extend([first_s, 0.5, float("nan")])
        answers[number] = answer.SerializeToString()
    result = programs.Result()
    kill_gateway.compare(b"touch,t_l_us,t_m_us,t_r_us\n0,1000,500000,\n1,2000.5,500000,\n", answers, result)
    assert len(result.failures) == 3 and "touch 1" in result.failures[0] and "touch 2" in result.failures[1]


def test_hostile_messages_reach_every_field_of_a_request():
    import random

    request_class = {name: message for name, message, _ in hostile_bytes.methods()}["/touchstone.v1.Source/StreamDataset"]
    fields = set()
    for seed in range(60):
        message = request_class()
        hostile_bytes.fill(message, random.Random(seed))
        fields |= {field.name for field, _ in message.ListFields()} | {f"spec.{field.name}" for field, _ in message.spec.ListFields()}
    missing = {field.name for field in request_class.DESCRIPTOR.fields} - fields
    assert not missing and "spec.plan" in fields


def test_a_server_that_ended_is_seen():
    with programs.Server() as server, server.channel() as channel:
        server.kill()
        assert not server.alive()
        with pytest.raises(grpc.RpcError):
            programs.describe(channel, timeout_s=1)
