"""A message about a number says the number that was sent: every numeric field of a request, with odd values, at a real server."""

import re

import grpc
import pytest
from google.protobuf.descriptor import FieldDescriptor

from touchstone.v1 import source_pb2, source_pb2_grpc, types_pb2

ODD = {
    FieldDescriptor.CPPTYPE_DOUBLE: (-1.2345678901e-7, 123456789.125, 0.1 + 0.2, -0.0005, 1.0005),
    FieldDescriptor.CPPTYPE_UINT32: (2**32 - 1, 5000, 70001),
    FieldDescriptor.CPPTYPE_UINT64: (2**64 - 1, 2**53 + 1),
    FieldDescriptor.CPPTYPE_ENUM: (77,),
}


def numbers(message, path=""):
    """Each number of a message, and what follows from that it is set: (message, field, odd value, path)."""
    for field in message.DESCRIPTOR.fields:
        if field.cpp_type == FieldDescriptor.CPPTYPE_MESSAGE:
            if field.message_type.GetOptions().map_entry:
                continue
            if field.label == FieldDescriptor.LABEL_REPEATED:
                for k, part in enumerate(getattr(message, field.name)):
                    yield from numbers(part, f"{path}{field.name}[{k}].")
            elif message.HasField(field.name):
                yield from numbers(getattr(message, field.name), f"{path}{field.name}.")
        elif field.label != FieldDescriptor.LABEL_REPEATED:
            for value in ODD.get(field.cpp_type, ()):
                yield message, field, value, path + field.name


def says(text, value):
    """Whether one of the numbers in a text is this one; whole numbers digit by digit."""
    found = re.findall(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", text)
    return str(value) in found if isinstance(value, int) else any(float(number) == value for number in found)


def touch():
    request = source_pb2.TouchRequest(object="lat20")
    one = request.touches.add(standoff_m=0.05, speed_m_s=0.02, stroke_m=0.1, session_time_s=1)
    one.target_m.z, one.approach.z, one.lateral.x = 0.07, -1, 1
    return request


def dataset(plan, image):
    request = source_pb2.StreamDatasetRequest(batch_size=16)
    request.spec.objects.append("lat20")
    request.spec.samples = 4
    getattr(request.spec.plan, plan).SetInParent()
    if image:
        request.spec.image.width = request.spec.image.height = 8
        request.spec.image.encoding = types_pb2.IMAGE_ENCODING_JPEG
    return request


@pytest.mark.parametrize("method, request_", [
    ("Touch", touch()), ("StreamDataset", dataset("sphere", False)), ("StreamDataset", dataset("faces", False)),
    ("StreamDataset", dataset("sphere", True))],
    ids=["touch", "sphere", "faces", "image"])
def test_a_message_about_a_number_says_what_was_sent(server, method, request_):
    wrong, refused = [], 0
    with grpc.insecure_channel(server.target, options=[("grpc.enable_http_proxy", 0)]) as channel:
        call = getattr(source_pb2_grpc.SourceStub(channel), method)
        for k in range(len(list(numbers(request_)))):
            sent = type(request_).FromString(request_.SerializeToString())
            message, field, value, path = list(numbers(sent))[k]
            setattr(message, field.name, value)
            try:
                answer = call(sent, timeout=60)
                if method == "StreamDataset":
                    next(answer, None)
                    answer.cancel()
            except grpc.RpcError as error:
                refused += 1
                if not says(error.details() or "", value):
                    wrong.append(f"{path} = {value}: {error.details()}")
    assert not wrong
    assert refused > 10


def test_vectors_are_quoted_as_they_were_sent_and_not_at_length_one(server):
    request = touch()
    request.touches[0].approach.z = -1.0005
    request.touches[0].lateral.z = 0.02
    with grpc.insecure_channel(server.target, options=[("grpc.enable_http_proxy", 0)]) as channel:
        with pytest.raises(grpc.RpcError) as refused:
            source_pb2_grpc.SourceStub(channel).Touch(request, timeout=60)
    assert "approach = (0, 0, -1.0005)" in (refused.value.details() or "")
