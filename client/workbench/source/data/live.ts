// The live workbench: the same page data as a file's, made anew from the evidence and the model as it is edited.
import { computed, effect, signal } from "@preact/signals";
import type { Report } from "./report";
import { parsePageData } from "./load";
import { CallError, Disconnected, call, double, field, fieldsOf, joined, request, text } from "./wire";
import type { FormulaParameter } from "./formula";
import { startRig } from "./rig";
import { download } from "../charts/export";
import { followHash, page, session } from "../state";

export interface Parameter { name: string; unit: string; lower: number; upper: number; typical: number; neutral: number; meaning: string; values: number[] }
export interface ModelEffect { name: string; per_object: boolean; editable: boolean; parameters: Parameter[] }
export interface Model { yaml: string; hash: string; name: string; effects: ModelEffect[] }
// `errors`: of every kind of data, in the order of the report; `rmse` is that which the page is about.
export interface Rung { name: string; model: Model; rmse: number; errors: number[] }

export const live = signal(false);
export const place = signal<{ evidence: boolean; origin: string; source: string; rig: string; stop_port: number } | null>(null);
export const origin = signal("");
export const rungs = signal<Rung[]>([]); // the given model, then one per change
export const diagnosis = signal<Report | null>(null);
export const working = signal<{ what: string; stage: string; done: number; cancellable: boolean } | null>(null);
// Who does not answer: the workbench itself, or the server that it asks.
export type Lost = "workbench" | "server" | null;
export const failure = signal<{ message: string; lost: Lost; again: () => void } | null>(null);
export const model = computed(() => rungs.value[rungs.value.length - 1]?.model ?? null);
// What is shown below is of another model than the last one.
export const stale = signal(false);
// A slider's value that the model has not taken yet.
export interface Move { effect: ModelEffect; parameter: number; entry: number; value: number }
export const moved = signal<Move | null>(null);

let token = "";
let evidence: Uint8Array = new Uint8Array(0);
let sentAhead = false; // the evidence names a session, whose measurements were too large for a request
let running = new AbortController();
let drawing = new AbortController(); // of the views
let saved = ""; // the model that was saved last
export const byHand = "values by hand"; // the rung of the sliders

const invalidArgument = 3, notFound = 5, resourceExhausted = 8, unavailable = 14; // grpc::StatusCode

export async function local(path: string, init: RequestInit = {}): Promise<Response> {
  const response = await request(`/local/${path}`, init, token);
  if (!response.ok) throw new CallError(response.status === 503 ? unavailable : response.status === 413 ? resourceExhausted : invalidArgument, (await response.text()).trim());
  return response;
}

// One thing at a time: what is asked last cancels what is under way.
async function doing(what: string, act: (signal: AbortSignal) => Promise<void>, cancellable = false): Promise<void> {
  running.abort();
  if (what !== byHand) moved.value = null;
  const mine = (running = new AbortController());
  working.value = { what, stage: "", done: 0, cancellable };
  failure.value = null;
  try {
    await act(mine.signal);
  } catch (reason) {
    if (mine.signal.aborted) return;
    const lost = reason instanceof Disconnected ? "workbench" : reason instanceof CallError && reason.code === unavailable ? "server" : null;
    failure.value = { message: (reason as Error).message, lost, again: () => void doing(what, act, cancellable) };
  } finally {
    if (running === mine) working.value = null;
  }
}

// Compare or Diagnose with this model; the report's bytes.
async function ask(method: string, yaml: string, signal: AbortSignal): Promise<Uint8Array> {
  for (let left = maxRepairs; ; --left) {
    try { return await askOnce(method, yaml, signal); } catch (reason) {
      if (!(reason instanceof CallError) || signal.aborted || !left) throw reason;
      // A server that was lost in the middle: the workbench finds the next one, and the whole is asked again.
      if (reason.code === unavailable) continue;
      // The server does not know what was sent ahead to the one before it, or to itself before it was started again.
      if (reason.code !== notFound || !sentAhead) throw reason;
      if (working.value) working.value = { ...working.value, stage: "sending the measurements again", done: 0 };
      try { await local("send-ahead", { method: "POST", signal }); } catch (refused) {
        throw refused instanceof CallError && refused.code === invalidArgument ? reason : refused; // a session of the server's own is gone
      }
    }
  }
}
const maxRepairs = 2; // a server that is lost, and one that lacks the measurements

async function askOnce(method: string, yaml: string, signal: AbortSignal): Promise<Uint8Array> {
  let report: Uint8Array | null = null;
  // A field that comes again wins: the model of the evidence is replaced, the rest stays as it came.
  const asked = field(1, joined(evidence, field(3, field(3, yaml))));
  await call(`Diagnosis/${method}`, asked, token, signal, (message) => {
    for (const { number, bytes } of fieldsOf(message)) {
      if (number === 2) { report = bytes.slice(); continue; }
      const progress = { stage: "", done: 0 };
      for (const part of fieldsOf(bytes)) if (part.number === 1) progress.stage = text(part.bytes); else if (part.number === 2) progress.done = double(part.bytes);
      if (working.value) working.value = { ...working.value, ...progress };
    }
  }, (server) => { if (place.value && place.value.source !== server) place.value = { ...place.value, source: server }; });
  if (!report) throw new Error("the answer has no report");
  return report;
}

// The RMSE of the given model in every entry of a serialized Report: data[].initial.rmse.
function errorsIn(report: Uint8Array): number[] {
  const inside = (message: Uint8Array, wanted: number) => [...fieldsOf(message)].filter(({ number }) => number === wanted).map(({ bytes }) => bytes);
  return inside(report, 10).map((data) => {
    const quality = inside(data, 10)[0];
    const rmse = quality && inside(quality, 1)[0];
    return rmse ? double(rmse) : quality ? 0 : Number.NaN;
  });
}

// The report of the last rung: its error at once, the views once the browser has painted it and no slider has moved for `restMs`:
// to draw them takes longer than to compare, and a slider that moves on would wait for it.
async function show(report: Uint8Array, signal: AbortSignal, restMs = 0): Promise<Report | null> {
  const setError = (entry: number) => {
    const errors = errorsIn(report);
    rungs.value = rungs.value.map((rung, i) => (i === rungs.value.length - 1 ? { ...rung, rmse: errors[entry] ?? Number.NaN, errors } : rung));
  };
  setError(page.value?.words.main ?? 0);
  if (moved.value) return null; // a slider's next value waits already
  const mine = (drawing = new AbortController());
  try {
    await painted();
    if (restMs) await rest(restMs, mine.signal);
    const data = parsePageData(await (await local("words", { method: "POST", body: report as BodyInit, signal: AbortSignal.any([signal, mine.signal]) })).text());
    signal.throwIfAborted();
    mine.signal.throwIfAborted();
    setError(data.words.main ?? 0);
    page.value = data;
    session.value = -1;
    stale.value = false;
    return data.report;
  } catch (reason) {
    if (mine.signal.aborted && !signal.aborted) return null;
    throw reason;
  }
}

// A hidden page paints nothing, and does not wait for it.
const painted = () => new Promise<void>((done) => {
  if (document.hidden) return done();
  requestAnimationFrame(() => setTimeout(done));
});

const rest = (ms: number, signal: AbortSignal) => new Promise<void>((done, moved) => {
  const timer = setTimeout(done, ms);
  signal.addEventListener("abort", () => { clearTimeout(timer); moved(signal.reason as Error); }, { once: true });
  if (signal.aborted) { clearTimeout(timer); moved(signal.reason as Error); }
});
const sliderRestMs = 150; // a hand that drags a slider says something every frame

async function change(of: Record<string, unknown>): Promise<Model> {
  return (await local("model", { method: "POST", body: JSON.stringify(of) })).json() as Promise<Model>;
}

const compareLast = async (signal: AbortSignal, restMs = 0) => { await show(await ask("Compare", model.value!.yaml, signal), signal, restMs); };

// What a reload of the page needs: where the measurements came from, and the model with its steps.
interface Kept { token: string; path: string; saved: string; rungs: { name: string; yaml: string; rmse: number | null; errors: (number | null)[] }[] }
const known = (of: number) => (Number.isFinite(of) ? of : null);
let opened = "";
function keepWork(): void {
  if (!opened || !rungs.value.length) return;
  const kept: Kept = { token, path: opened, saved, rungs: rungs.value.map(({ name, model: { yaml }, rmse, errors }) => ({ name, yaml, rmse: known(rmse), errors: errors.map(known) })) };
  try { sessionStorage.setItem("work", JSON.stringify(kept)); } catch { /* too large: a reload begins anew */ }
}
function keptWork(): Kept | null {
  const kept = JSON.parse(sessionStorage.getItem("work") ?? "null") as Kept | null;
  return kept?.token === token ? kept : null;
}
async function reopen({ path, saved: before, rungs: steps }: Kept): Promise<void> {
  await doing("Opening again", async (signal) => {
    await readEvidence(path, signal);
    const models = await Promise.all(steps.map(({ yaml }) => change({ yaml, change: "none" })));
    signal.throwIfAborted();
    saved = before;
    rungs.value = steps.map(({ name, rmse, errors }, i) => ({ name, model: models[i], rmse: rmse ?? Number.NaN, errors: (errors ?? []).map((one) => one ?? Number.NaN) }));
    await compareLast(signal);
  });
}

// The model's text that comes along.
async function readEvidence(path: string, signal: AbortSignal): Promise<string> {
  evidence = new Uint8Array(await (await local(path, { signal })).arrayBuffer());
  opened = path;
  sentAhead = false;
  let yaml = "", measured = false;
  for (const { number, bytes } of fieldsOf(evidence)) {
    if (number === 1) sentAhead = true;
    if (number === 1 || number === 2 || number === 8) measured = true;
    if (number === 7) origin.value = text(bytes);
    if (number === 3) for (const part of fieldsOf(bytes)) if (part.number === 3) yaml = text(part.bytes);
    // Photographs alone have a name of their own; they come last.
    if (number === 9 && !measured) for (const part of fieldsOf(bytes)) if (part.number === 4) origin.value = text(part.bytes);
  }
  return yaml;
}

async function open(path: string, what: string, keep = false): Promise<void> {
  await doing(what, async (signal) => {
    const yaml = await readEvidence(path, signal);
    // The model of the page stays where there is one: other measurements, the same question.
    const given = keep && model.value ? model.value : await change({ yaml, change: "none" });
    if (!keep) saved = given.yaml;
    rungs.value = [{ name: given.name, model: given, rmse: Number.NaN, errors: [] }];
    diagnosis.value = null;
    await compareLast(signal);
  });
}

export const openExample = () => open("evidence?example", "Making the example");
export const openRigSet = () => open("evidence?rig", "Comparing", /*keep=*/true);

export const diagnose = () => doing("Looking for what is missing", async (signal) => {
  diagnosis.value = await show(await ask("Diagnose", model.value!.yaml, signal), signal);
}, /*cancellable=*/true);

// Ends what is under way; what is shown stays.
export function cancel(): void {
  running.abort();
  working.value = null;
}

export function save(): void {
  saved = model.value!.yaml;
  download(`${model.value!.name || "model"}.yaml`, "text/yaml", saved);
}

export function take(effect: string, sign: string): Promise<void> {
  const before = rungs.value; // tried again, it is added once
  const asked = { yaml: model.value!.yaml, change: "take", effect, from: diagnosis.value!.improved_model_yaml };
  return doing(`${sign} ${effect}`, async (signal) => {
    const next = await change(asked);
    signal.throwIfAborted();
    rungs.value = [...before, { name: `${sign} ${effect}`, model: next, rmse: Number.NaN, errors: [] }];
    stale.value = true;
    await compareLast(signal);
  });
}

export function undo(): void {
  if (rungs.value.length < 2) return;
  rungs.value = rungs.value.slice(0, -1);
  stale.value = true;
  void doing("Back to the model before", compareLast);
}

// What is wrong with it, or nothing: then it is in the model.
export async function addFormula(name: string, adds: string, expression: string, parameters: FormulaParameter[]): Promise<string> {
  const assignments = [`name=${name}`, `adds=${adds}`, `expression=${expression}`,
    ...parameters.flatMap((one) => [`${one.name}=${one.value}`, ...(one.unit ? [`${one.name}_unit=${one.unit}`] : []), `${one.name}_min=${one.min}`, `${one.name}_max=${one.max}`])];
  let next: Model;
  try { next = await change({ yaml: model.value!.yaml, change: "formula", assignments }); } catch (reason) { return (reason as Error).message; }
  rungs.value = [...rungs.value, { name: `+ ${name}`, model: next, rmse: Number.NaN, errors: [] }];
  stale.value = true;
  void doing(`+ ${name}`, compareLast);
  return "";
}

// A slider's value. Values that come while one is compared wait, and the last of them is the next: the error follows a slider
// that moves all the time. All of them are one rung, which Undo takes away.
export function setValue(move: Move): void {
  moved.value = move;
  drawing.abort();
  if (working.value?.what === byHand) return; // the comparison under way ends, else a hand that moves on would see no error
  stale.value = true;
  void doing(byHand, async (signal) => {
    do {
      if (moved.value) await takeValue(moved.value, signal);
      await compareLast(signal, sliderRestMs);
    } while (moved.value);
  });
}

async function takeValue(move: Move, signal: AbortSignal): Promise<void> {
  const { effect, parameter, entry, value } = move;
  const assignments = effect.parameters.map((one, p) => `${one.name}=${one.values.map((old, i) => (p === parameter && i === entry ? value : old)).join(",")}`);
  const next = await change({ yaml: model.value!.yaml, change: "set", effect: effect.name, assignments });
  signal.throwIfAborted();
  const last = rungs.value[rungs.value.length - 1];
  const again = last.name === byHand;
  rungs.value = [...(again ? rungs.value.slice(0, -1) : rungs.value), { name: byHand, model: next, rmse: again ? last.rmse : Number.NaN, errors: again ? last.errors : [] }];
  if (moved.value === move) moved.value = null;
}

export async function startLive(): Promise<void> {
  live.value = true;
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given) {
    sessionStorage.setItem("token", given);
    history.replaceState(null, "", location.pathname);
  }
  token = given ?? sessionStorage.getItem("token") ?? "";
  await doing("Connecting", async (signal) => { place.value = await (await local("state", { signal })).json(); });
  addEventListener("beforeunload", (event) => { if (model.value && model.value.yaml !== saved) event.preventDefault(); });
  if (place.value?.rig) startRig(token, place.value.stop_port);
  followHash();
  effect(() => { void rungs.value; keepWork(); });
  const kept = keptWork();
  if (kept) await reopen(kept);
  else if (place.value?.evidence) await open("evidence", "Comparing");
}
