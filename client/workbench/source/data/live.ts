// The live workbench: the same page data as a file's, made anew from the evidence and the model as it is edited.
import { computed, signal } from "@preact/signals";
import type { Report } from "./report";
import { parsePageData } from "./load";
import { CallError, Disconnected, call, double, field, fieldsOf, joined, request, text } from "./wire";
import { page, session, touchEntries } from "../state";

export interface Parameter { name: string; unit: string; lower: number; upper: number; typical: number; neutral: number; meaning: string; values: number[] }
export interface ModelEffect { name: string; per_object: boolean; editable: boolean; parameters: Parameter[] }
export interface Model { yaml: string; hash: string; name: string; effects: ModelEffect[] }
export interface Rung { name: string; model: Model; rmse: number }

export const live = signal(false);
export const place = signal<{ evidence: boolean; origin: string; source: string } | null>(null);
export const origin = signal("");
export const rungs = signal<Rung[]>([]); // the given model, then one per change
export const diagnosis = signal<Report | null>(null);
export const working = signal<{ what: string; stage: string; done: number } | null>(null);
export const failure = signal<{ message: string; disconnected: boolean; again: () => void } | null>(null);
export const model = computed(() => rungs.value[rungs.value.length - 1]?.model ?? null);
// What is shown below is of another model than the last one.
export const stale = signal(false);

let token = "";
let evidence: Uint8Array = new Uint8Array(0);
let running = new AbortController();

async function local(path: string, init: RequestInit = {}): Promise<Response> {
  const response = await request(`/local/${path}`, init, token);
  if (!response.ok) throw new CallError(3, (await response.text()).trim());
  return response;
}

// One thing at a time: what is asked last cancels what is under way.
async function doing(what: string, act: (signal: AbortSignal) => Promise<void>): Promise<void> {
  running.abort();
  const mine = (running = new AbortController());
  working.value = { what, stage: "", done: 0 };
  failure.value = null;
  try {
    await act(mine.signal);
  } catch (reason) {
    if (mine.signal.aborted) return;
    const error = reason as Error;
    failure.value = { message: error.message, disconnected: error instanceof Disconnected || (error instanceof CallError && error.code === 14), again: () => void doing(what, act) };
  } finally {
    if (running === mine) working.value = null;
  }
}

// Compare or Diagnose with this model; the report's bytes.
async function ask(method: string, yaml: string, signal: AbortSignal): Promise<Uint8Array> {
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
  });
  if (!report) throw new Error("the answer has no report");
  return report;
}

async function show(report: Uint8Array, signal: AbortSignal) {
  const data = parsePageData(await (await local("words", { method: "POST", body: report as BodyInit, signal })).text());
  if (signal.aborted) throw new DOMException("", "AbortError");
  page.value = data;
  session.value = touchEntries.value[0]?.index ?? 0;
  stale.value = false;
  return data;
}

const errorOf = (report: Report) => report.data[0]?.initial?.rmse ?? Number.NaN;

async function change(of: Record<string, unknown>): Promise<Model> {
  return (await local("model", { method: "POST", body: JSON.stringify(of) })).json() as Promise<Model>;
}

async function compareLast(signal: AbortSignal): Promise<void> {
  const data = await show(await ask("Compare", model.value!.yaml, signal), signal);
  rungs.value = rungs.value.map((rung, i) => (i === rungs.value.length - 1 ? { ...rung, rmse: errorOf(data.report) } : rung));
}

async function open(path: string, what: string): Promise<void> {
  await doing(what, async (signal) => {
    evidence = new Uint8Array(await (await local(path, { signal })).arrayBuffer());
    let yaml = "";
    for (const { number, bytes } of fieldsOf(evidence)) {
      if (number === 7) origin.value = text(bytes);
      if (number === 3) for (const part of fieldsOf(bytes)) if (part.number === 3) yaml = text(part.bytes);
    }
    const given = await change({ yaml, change: "none" });
    rungs.value = [{ name: given.name, model: given, rmse: Number.NaN }];
    diagnosis.value = null;
    await compareLast(signal);
  });
}

export const openExample = () => open("evidence?example", "Making the example");

export const diagnose = () => doing("Looking for what is missing", async (signal) => {
  const data = await show(await ask("Diagnose", model.value!.yaml, signal), signal);
  diagnosis.value = data.report;
});

export function take(effect: string, sign: string): Promise<void> {
  return doing(`${sign} ${effect}`, async (signal) => {
    const next = await change({ yaml: model.value!.yaml, change: "take", effect, from: diagnosis.value!.improved_model_yaml });
    rungs.value = [...rungs.value, { name: `${sign} ${effect}`, model: next, rmse: Number.NaN }];
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

// A slider's value; the last rung changes, since a value is no further step.
export function setValue(effect: ModelEffect, parameter: number, entry: number, value: number): void {
  const assignments = effect.parameters.map((one, p) => `${one.name}=${one.values.map((old, i) => (p === parameter && i === entry ? value : old)).join(",")}`);
  stale.value = true;
  void doing(`${effect.name} at ${value}`, async (signal) => {
    const next = await change({ yaml: model.value!.yaml, change: "set", effect: effect.name, assignments });
    if (signal.aborted) return;
    rungs.value = rungs.value.map((rung, i) => (i === rungs.value.length - 1 ? { ...rung, model: next } : rung));
    await compareLast(signal);
  });
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
  if (place.value?.evidence) await open("evidence", "Comparing");
}
