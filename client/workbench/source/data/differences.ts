// Two reports, number by number as they are shown: equal is what reads the same.
import { error, fixed, probability, share, withError } from "../format";
import type { DataReport, Report } from "./report";

export interface Difference { part: string; name: string; from: string; to: string; change: string }

interface Entry { text: string; value?: number }

const dataName = (report: Report, data: DataReport) => (report.data.length > 1 ? `${data.kind.toLowerCase()}, ` : "");

function entriesOf(report: Report): Map<string, Entry> {
  const entries = new Map<string, Entry>();
  const add = (part: string, name: string, text: string, value?: number) => entries.set(`${part}\n${name}`, { text, value });
  add("Verdict", "word", report.verdict === "VERDICT_UNSPECIFIED" ? "comparison" : report.verdict);
  add("Verdict", "P(nothing is missing)", report.p_nothing_missing === undefined ? "not assessed" : probability(report.p_nothing_missing));
  add("Model", "name and hash", `${report.model_name} ${report.model_hash.slice(0, 12)}`);
  for (const step of report.steps) {
    add("Step", step.effect, "added");
    for (const value of step.parameters) add("Value", [step.effect, value.name, value.finger, value.object].filter(Boolean).join(" "), withError(value), value.value);
  }
  for (const refit of report.refitted) for (const value of refit.parameters) add("Value", [refit.effect, value.name, value.finger, value.object].filter(Boolean).join(" "), withError(value), value.value);
  for (const data of report.data) {
    const of = dataName(report, data);
    const rmse = (name: string, value: number) => { if (value > 0) add("Error", of + name, error(data.kind, value), value); };
    add("Data", `${of}count`, String(data.count), data.count);
    add("Data", `${of}set aside`, String(data.set_aside?.count ?? 0), data.set_aside?.count ?? 0);
    rmse("noise floor", data.noise_floor);
    rmse("given model", data.initial.rmse);
    rmse("given model, unseen", data.initial.heldout_rmse);
    rmse("improved model", data.final.rmse);
    rmse("improved model, unseen", data.final.heldout_rmse);
    for (const group of data.groups) add(`By ${group.kind.toLowerCase()}`, of + group.name, error(data.kind, group.rmse), group.rmse);
    for (const slice of data.where) add("Where", of + slice.slice, `${share(slice.share_of_excess_error)}, ${error(data.kind, slice.rmse)}`, slice.rmse);
  }
  return entries;
}

export function differences(from: Report, to: Report): Difference[] {
  const before = entriesOf(from);
  const after = entriesOf(to);
  return [...new Set([...after.keys(), ...before.keys()])].map((key) => {
    const [part, name] = key.split("\n");
    const a = before.get(key);
    const b = after.get(key);
    const ratio = a?.value && b?.value !== undefined ? b.value / a.value : Number.NaN;
    const change = Number.isFinite(ratio) && a!.text !== b!.text && ratio > 0 ? `${ratio >= 1 ? "+" : ""}${fixed(100 * (ratio - 1), Math.abs(ratio - 1) < 0.1 ? 1 : 0)}\u2009%` : "";
    return { part, name, from: a?.text ?? "absent", to: b?.text ?? "absent", change };
  });
}
