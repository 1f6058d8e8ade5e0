// gRPC-Web over fetch, and as much of protobuf's wire format as the page needs: evidence and reports go through it as bytes.

const bytesOf = new TextEncoder();
const textOf = new TextDecoder();

function varint(value: number): number[] {
  const out: number[] = [];
  for (; value > 127; value = Math.floor(value / 128)) out.push((value % 128) | 128);
  return [...out, value];
}

export function joined(...parts: Uint8Array[]): Uint8Array<ArrayBuffer> {
  const all = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) { all.set(part, at); at += part.length; }
  return all;
}

// A field of bytes, text or a message.
export function field(number: number, content: Uint8Array | string): Uint8Array {
  const bytes = typeof content === "string" ? bytesOf.encode(content) : content;
  return joined(new Uint8Array([...varint(number * 8 + 2), ...varint(bytes.length)]), bytes);
}

// The fields of a message: of bytes, or the eight bytes of a double; others are skipped.
export function* fieldsOf(message: Uint8Array): Generator<{ number: number; bytes: Uint8Array }> {
  let at = 0;
  const next = () => {
    let value = 0;
    for (let scale = 1; ; scale *= 128) {
      if (at >= message.length) throw new Error("the answer is cut off");
      const byte = message[at++];
      value += (byte & 127) * scale;
      if (byte < 128) return value;
    }
  };
  while (at < message.length) {
    const tag = next();
    const kind = tag & 7;
    if (kind === 0) { next(); continue; }
    const length = kind === 2 ? next() : kind === 1 ? 8 : 4;
    if (at + length > message.length) throw new Error("the answer is cut off");
    yield { number: Math.floor(tag / 8), bytes: message.subarray(at, at + length) };
    at += length;
  }
}

export const text = (bytes: Uint8Array) => textOf.decode(bytes);
export const double = (bytes: Uint8Array) => new DataView(bytes.buffer, bytes.byteOffset, 8).getFloat64(0, true);

// The workbench itself did not answer.
export class Disconnected extends Error {}
// A status of gRPC's other than OK.
export class CallError extends Error {
  constructor(readonly code: number, message: string) { super(message); }
}

const unescaped = (message: string) => { try { return decodeURIComponent(message); } catch { return message; } };

function throwUnlessOk(status: string | null | undefined, message: string | null | undefined): void {
  if (status !== "0") throw new CallError(Number(status ?? 2), unescaped(message ?? "") || "the answer ended without a status");
}

// Frames as they come: a byte of flags, four of length, content.
export async function* frames(body: ReadableStream<Uint8Array>): AsyncGenerator<{ flags: number; content: Uint8Array }> {
  const reader = body.getReader();
  let rest = new Uint8Array(0);
  for (;;) {
    while (rest.length >= 5) {
      const length = new DataView(rest.buffer, rest.byteOffset).getUint32(1);
      if (rest.length < 5 + length) break;
      yield { flags: rest[0], content: rest.subarray(5, 5 + length) };
      rest = rest.subarray(5 + length);
    }
    const { done, value } = await reader.read();
    if (done) break;
    rest = joined(rest, value);
  }
  if (rest.length) throw new Disconnected("the answer was cut off");
}

export async function request(path: string, init: RequestInit, token: string): Promise<Response> {
  try {
    return await fetch(path, { ...init, headers: { ...init.headers, "x-touchstone-token": token } });
  } catch (reason) {
    if ((reason as Error).name === "AbortError") throw reason;
    throw new Disconnected("touchstone workbench does not answer");
  }
}

// A call with one message; every message of the answer goes to `take`.
export async function call(method: string, message: Uint8Array, token: string, signal: AbortSignal, take: (message: Uint8Array) => void, answeredBy: (server: string) => void = () => undefined): Promise<void> {
  const head = new Uint8Array(5);
  new DataView(head.buffer).setUint32(1, message.length);
  const response = await request(`/touchstone.v1.${method}`, { method: "POST", body: joined(head, message), signal, headers: { "content-type": "application/grpc-web+proto", "x-grpc-web": "1" } }, token);
  if (!response.ok) throw new CallError(7, (await response.text()).trim());
  if (response.headers.has("x-touchstone-server")) answeredBy(response.headers.get("x-touchstone-server")!);
  if (response.headers.has("grpc-status")) return throwUnlessOk(response.headers.get("grpc-status"), response.headers.get("grpc-message"));
  let trailers: Map<string, string> | null = null;
  try {
    // To the end, behind the trailers too: an answer that is left before it keeps its connection.
    for await (const { flags, content } of frames(response.body!)) {
      if (flags & 0x80) trailers = new Map(text(content).split("\r\n").map((line) => [line.slice(0, line.indexOf(":")).toLowerCase(), line.slice(line.indexOf(":") + 1).trim()]));
      else take(content);
    }
  } catch (reason) {
    if (reason instanceof TypeError) throw new Disconnected("touchstone workbench ended in the middle of an answer");
    throw reason;
  }
  if (!trailers) throw new Disconnected("the answer ended without a status");
  throwUnlessOk(trailers.get("grpc-status"), trailers.get("grpc-message"));
}
