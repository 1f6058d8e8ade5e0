"""A stock gRPC client, knowing nothing of Touchstone but an address, lists and calls every method by reflection."""
import os
import pathlib
import shutil
import subprocess
import sys

import grpc
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool

try:  # protobuf 4.22 and later
    from google.protobuf.message_factory import GetMessageClass
except ImportError:
    from google.protobuf.message_factory import MessageFactory
    GetMessageClass = MessageFactory().GetPrototype  # type: ignore[attr-defined]  # of protobuf before 4.22

ROOT = pathlib.Path(__file__).resolve().parents[2]
SERVER = os.environ.get("TOUCHSTONE_SERVER_PROGRAM", str(ROOT / "build/release/bin/touchstone-server"))
GRPC_PROTO = pathlib.Path("/usr/share/grpc-proto")


@pytest.fixture(scope="module")
def channel():
    server = subprocess.Popen([SERVER, "--listen", "127.0.0.1:0", "--log-level", "off", "--supershape-triangles", "2000"],
                              stdout=subprocess.PIPE, text=True)
    address = server.stdout.readline().split()[-1]
    with grpc.insecure_channel(address) as channel:
        yield channel
    server.terminate()
    assert server.wait(timeout=60) == 0


@pytest.fixture(scope="module")
def reflection(tmp_path_factory):
    """The standard reflection stubs, generated from Debian's grpc-proto."""
    if not GRPC_PROTO.exists():
        pytest.skip("grpc-proto is not installed")
    folder = tmp_path_factory.mktemp("reflection")
    plugin = shutil.which("grpc_python_plugin")
    subprocess.run(["protoc", "-I", GRPC_PROTO, f"--python_out={folder}", f"--grpc_out={folder}",
                    f"--plugin=protoc-gen-grpc={plugin}", "grpc/reflection/v1alpha/reflection.proto"], check=True)
    # Beside the installed package grpc, not inside it.
    sys.path.insert(0, str(folder / "grpc" / "reflection" / "v1alpha"))
    import importlib
    return importlib.import_module("reflection_pb2")


def services_of(channel, reflection):
    """Every described service: name -> service descriptor."""
    call = channel.stream_stream("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
                                 request_serializer=reflection.ServerReflectionRequest.SerializeToString,
                                 response_deserializer=reflection.ServerReflectionResponse.FromString)

    def ask(**fields):
        (response,) = call(iter([reflection.ServerReflectionRequest(**fields)]))
        assert not response.HasField("error_response"), response.error_response
        return response

    names = [service.name for service in ask(list_services="*").list_services_response.service]
    pool, files = descriptor_pool.DescriptorPool(), {}
    for name in names:
        for data in ask(file_containing_symbol=name).file_descriptor_response.file_descriptor_proto:
            file = descriptor_pb2.FileDescriptorProto.FromString(data)
            files[file.name] = file

    def add(name):
        if name not in files:
            return
        file = files.pop(name)
        for needed in file.dependency:
            add(needed)
        pool.Add(file)

    for name in list(files):
        add(name)
    return {name: pool.FindServiceByName(name) for name in names}


def test_every_service_is_listed_and_described(channel, reflection):
    names = services_of(channel, reflection).keys()
    assert {"touchstone.v1.Source", "touchstone.v1.Control", "touchstone.v1.Models", "grpc.health.v1.Health"} <= set(names)


def test_every_method_answers_an_empty_request_with_a_result_or_a_reason(channel, reflection):
    called = 0
    for name, service in services_of(channel, reflection).items():
        for method in service.methods:
            if name.startswith("grpc."):
                continue
            request, response = GetMessageClass(method.input_type), GetMessageClass(method.output_type)
            path, streams = f"/{name}/{method.name}", method.name == "StreamDataset"
            make = channel.unary_stream if streams else channel.unary_unary
            try:
                result = make(path, request_serializer=request.SerializeToString,
                              response_deserializer=response.FromString)(request(), timeout=60)
                list(result) if streams else result
            except grpc.RpcError as error:
                assert error.code() in (grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.NOT_FOUND,
                                        grpc.StatusCode.ABORTED), (path, error.code(), error.details())
                assert len(error.details() or "") > 20, (path, error.details())
            called += 1
    assert called >= 14
