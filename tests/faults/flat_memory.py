"""One stream of many samples: the server's memory does not grow with how many went by."""

from __future__ import annotations

from programs import Result, Server, stream

MAX_GROWTH_BYTES = 16 << 20


def run(samples: int = 50_000_000) -> Result:
    """samples: how many are streamed. A tenth of them goes before the first look: pools and tables fill once."""
    result, read = Result(), 0
    begin: int | None = None
    with Server() as server, server.channel(("grpc.max_receive_message_length", -1)) as channel:
        for response in stream(channel, samples, batch_size=65_536, timeout_s=3600):
            read += response.batch.rows
            if begin is None and read >= samples // 10:
                begin = server.resident_bytes()
        assert begin is not None, "the stream ended before its first tenth"
        growth = server.resident_bytes() - begin
    result.expect(read == samples, f"{read} of {samples} samples came")
    result.expect(growth <= MAX_GROWTH_BYTES, f"the server grew by {growth >> 10} KiB over {samples * 9 // 10:,} samples")
    result.seen.append(f"{samples:,} samples; over the last nine tenths of them the server grew by {growth / 2**20:.1f} MiB of {begin >> 20}")
    return result
