"""A thousand clients, each with a connection of its own, read a dataset each: all get the same bytes."""

from __future__ import annotations

import asyncio
import hashlib
import random

import grpc

from programs import Result, Server, describe
from touchstone.v1 import source_pb2

SAMPLES = 20_000


async def _read(target: str, refusals: list[str]) -> str:
    request = source_pb2.StreamDatasetRequest(batch_size=4096)
    request.spec.objects.append("lat00")
    request.spec.plan.sphere.SetInParent()
    request.spec.samples, request.spec.seed = SAMPLES, 1
    async with grpc.aio.insecure_channel(target, options=[("grpc.use_local_subchannel_pool", 1), ("grpc.enable_http_proxy", 0)]) as channel:
        call = channel.unary_stream("/touchstone.v1.Source/StreamDataset", request_serializer=source_pb2.StreamDatasetRequest.SerializeToString,
                                    response_deserializer=source_pb2.StreamDatasetResponse.FromString)
        while True:
            digest = hashlib.sha256()
            try:
                async for response in call(request, timeout=300):
                    for column in response.batch.columns:
                        digest.update(column.data)
                return digest.hexdigest()
            except grpc.aio.AioRpcError as error:
                # Over the limit of streams: a client comes again.
                if error.code() != grpc.StatusCode.RESOURCE_EXHAUSTED:
                    raise
                refusals.append(error.details() or "")
                await asyncio.sleep(random.uniform(0.2, 1.0))


async def _all(target, clients, refusals):
    return await asyncio.gather(*(_read(target, refusals) for _ in range(clients)), return_exceptions=True)


def run(clients: int = 1000) -> Result:
    """clients: how many at once."""
    result, refusals = Result(), []
    # As many addresses as one machine has: the limit of connections per address is for other machines.
    with Server("--max-connections-per-address", str(clients + 10)) as server:
        answers = asyncio.run(_all(server.target, clients, refusals))
        failed = [answer for answer in answers if isinstance(answer, BaseException)]
        result.expect(not failed, f"{len(failed)} of {clients} clients failed, the first: {failed[:1]}")
        result.expect(len(set(map(str, answers))) == 1, "clients got different bytes")
        result.expect(all("limit" in words or "max_streams" in words for words in refusals), f"a refusal does not name its limit: {refusals[:1]}")
        with server.channel() as channel:
            describe(channel)
        result.seen.append(f"{clients} clients read {SAMPLES:,} samples each, all the same bytes; {len(refusals)} times one was told that there "
                           f"are too many streams and came again; the server has {server.resident_bytes() >> 20} MiB and {server.threads()} threads")
    return result
