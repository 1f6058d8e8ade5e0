// The rig of --rig as every page sees it: one stream of states for all pages of a browser, the acts of this page, and Stop.
import { computed, signal } from "@preact/signals";
import { CallError, request } from "./wire";

export interface Rig {
  answers: boolean; state: string; stop_reason: string; lease_holder: string; moving: boolean; object: string; up_face: string; mounts_itself: boolean;
  arm: string; powered: boolean; phase: string; tip_mm: [number, number, number]; effector: string; pressed: boolean[]; last_error: string; emulated: boolean;
  safety_notice: string; fingers: number; max_speed_mm_s: number; min_speed_mm_s: number; spacing_m: number;
}
export interface Group { object: string; up_face: string; touches: number; duration_s: number }
export interface Checked {
  session: string; origin: string; touches: number; possible: number; duration_s: number; groups: Group[];
  impossible: { touch: number; object: string; reason: string }[]; notes: string[];
}
// touch_drawing.h; object frame, mm.
export interface DrawnTouch { touch: number; target_mm: number[]; approach: number[]; lateral: number[]; standoff_mm: number; path_mm: number[] }
export interface PlanDrawing {
  check: number; touches: number; objects: { name: string; low_mm?: number[]; high_mm?: number[]; vertices_mm: number[]; triangles: number[] }[];
  setups: { object: number; up_face: string; touches: DrawnTouch[] }[]; impossible: (DrawnTouch & { object: number; reason: string })[];
}
export interface Desk {
  rig: Partial<Rig>; address: string; objects: string[]; pages: Record<string, { number: number; hidden: boolean; there: boolean }>; controller: string; leased: boolean; requests: string[];
  job: string; job_moves: boolean; stopping: boolean; ask: string; ask_id: number; check: number; checked: Checked | null; done: number; error: string; text: string;
}
export interface Touched { touch: number; object: string; up_face: string; times_us: (number | null)[] }

export const desk = signal<Desk | null>(null);
export const touched = signal<Touched[]>([]);
// The last news are older than they should be: what is shown may not be so any more.
export const silent = signal(false);
export const refused = signal(""); // the act that was not done, and why
export type Press = { state: "sending" | "stopped" | "moves" | "failed"; text: string; ms: number };
export const press = signal<Press | null>(null);

const reloaded = () => (performance.getEntriesByType("navigation")[0] as PerformanceNavigationTiming | undefined)?.type === "reload";
// Kept over a reload, and new in a tab that was duplicated.
const me = (() => {
  const kept = reloaded() ? sessionStorage.getItem("page") : null;
  const id = kept ?? crypto.randomUUID();
  sessionStorage.setItem("page", id);
  return id;
})();

export const controls = computed(() => desk.value?.controller === me && desk.value.leased);
export const pageName = (id: string) => (id === me ? "this page" : `page ${desk.value?.pages[id]?.number ?? "?"}`);
// The other pages that are there, and whether somebody sees them.
export const otherPages = computed(() => Object.entries(desk.value?.pages ?? {}).filter(([id, page]) => id !== me && page.there).map(([, page]) => page).sort((a, b) => a.number - b.number));
export const controllerWent = computed(() => desk.value?.pages[desk.value.controller]?.there === false);
export const asksAlready = computed(() => desk.value?.requests.includes(me) ?? false);

const heardEveryMs = 2000; // this page says that it is there: pages.cpp
const silentAfterMs = 3000; // the workbench says something every second
const againAfterMs = 1000;
const stopAnswerMs = 5000; // then a person must know that nothing answered
let token = "";
let stopPort = 0;
let heard = 0;
let list = -1;
let items: Touched[] = [];

interface News { state: Desk; list: number; first: number; items: Touched[] }

function take(news: News): void {
  heard = performance.now();
  silent.value = false;
  if (!news.state.rig) return; // nothing is known yet
  if (news.list !== list) items = [];
  list = news.list;
  if (news.first > items.length) return; // a part is missing; the whole list is asked for
  if (news.items.length) items = [...items.slice(0, news.first), ...news.items];
  if (touched.value !== items) touched.value = items;
  desk.value = news.state;
}

// Lines of JSON, as they come.
async function* lines(body: ReadableStream<Uint8Array>): AsyncGenerator<string> {
  const reader = body.pipeThrough(new TextDecoderStream() as unknown as TransformStream<Uint8Array, string>).getReader();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    const parts = (rest + value).split("\n");
    rest = parts.pop()!;
    yield* parts;
  }
}

// The page that holds the lock reads the stream, for all pages of the browser: six of them would take all the connections that a
// browser opens. A page that is hidden gives the lock to one that is seen.
function follow(): void {
  const channel = new BroadcastChannel("touchstone-rig");
  channel.onmessage = ({ data }) => {
    if (data === "whole?") { if (leading && desk.value) channel.postMessage({ state: desk.value, list, first: 0, items }); return; }
    const missing = (data as News).list !== list ? (data as News).first > 0 : (data as News).first > items.length;
    if (missing) channel.postMessage("whole?");
    else take(data as News);
  };
  let leading = false;
  let lead = new AbortController();
  const begin = async () => {
    lead = new AbortController();
    const { signal } = lead;
    channel.postMessage("whole?");
    try {
      await navigator.locks.request("touchstone-rig", { signal }, async () => {
        leading = true;
        while (!signal.aborted) {
          try {
            const response = await request("/local/watch", { signal }, token);
            if (!response.ok) throw new CallError(3, await response.text());
            for await (const line of lines(response.body!)) {
              const news = JSON.parse(line) as News;
              take(news);
              channel.postMessage(news);
            }
          } catch { /* tried again */ }
          if (!signal.aborted) { silent.value = true; await new Promise((again) => setTimeout(again, againAfterMs)); }
        }
      });
    } catch { /* hidden */ } finally { leading = false; }
  };
  document.addEventListener("visibilitychange", () => { if (document.hidden) lead.abort(); else void begin(); });
  setInterval(() => { if (!document.hidden && performance.now() - heard > silentAfterMs) silent.value = true; }, 500);
  if (!document.hidden) void begin();
}

export async function act(name: string, more: Record<string, unknown> = {}): Promise<boolean> {
  refused.value = "";
  try {
    const response = await request("/local/rig", { method: "POST", body: JSON.stringify({ page: me, act: name, hidden: document.hidden, ...more }) }, token);
    if (!response.ok) throw new CallError(9, (await response.text()).trim());
    return true;
  } catch (reason) {
    refused.value = (reason as Error).message;
    return false;
  }
}

// By two ways at once: a port of its own, where no connection is waited for, and the page's, which is there too where ports are
// forwarded. The workbench stops once.
export async function stop(): Promise<void> {
  const began = performance.now();
  const body = JSON.stringify({ token, press: crypto.randomUUID(), reason: "stopped on the page" });
  press.value = { state: "sending", text: "", ms: 0 };
  const answered = async (sent: Promise<Response>) => {
    const response = await sent;
    const text = (await response.text()).trim();
    if (!response.ok) throw new Error(text);
    return JSON.parse(text) as { standstill: boolean; not_confirmed: string };
  };
  const ways = [
    fetch(`${location.protocol}//${location.hostname}:${stopPort}/local/stop`, { method: "POST", body, headers: { "content-type": "text/plain" }, signal: AbortSignal.timeout(stopAnswerMs) }),
    request("/local/stop", { method: "POST", body, signal: AbortSignal.timeout(stopAnswerMs) }, token),
  ].map(answered);
  try {
    const { standstill, not_confirmed } = await Promise.any(ways);
    press.value = { state: standstill ? "stopped" : "moves", text: not_confirmed, ms: performance.now() - began };
  } catch (reason) {
    const told = (reason as AggregateError).errors.map((one: Error) => one.message).find((text) => /STOP/.test(text));
    press.value = { state: "failed", text: told ?? "touchstone workbench does not answer", ms: performance.now() - began };
  }
}

async function ofRig(what: string): Promise<Response> {
  const response = await request(`/local/rig/${what}`, {}, token);
  if (!response.ok) throw new CallError(9, (await response.text()).trim());
  return response;
}
export const measuredCsv = async () => (await ofRig("set.csv")).text();
export const planDrawing = async () => (await ofRig("drawing")).json() as Promise<PlanDrawing>;

export function startRig(key: string, port: number): void {
  token = key;
  stopPort = port;
  stayPresent();
  follow();
}

// The workbench knows which pages there are: the rig's lease does not stay with one that is closed, or was killed.
function stayPresent(): void {
  const say = (name: "hello" | "bye", begins = false) =>
    void request("/local/rig", { method: "POST", body: JSON.stringify({ page: me, act: name, hidden: document.hidden, begins }), keepalive: true }, token).catch(() => undefined);
  say("hello", /*begins=*/true);
  setInterval(() => say("hello"), heardEveryMs);
  document.addEventListener("visibilitychange", () => say("hello"));
  addEventListener("pageshow", (event) => { if (event.persisted) say("hello", /*begins=*/true); });
  addEventListener("pagehide", () => say("bye"));
}
