// What is selected, shared by all views. The URL's hash holds it, so that a link shows the same.
import { computed, effect, signal } from "@preact/signals";
import type { PageData, Report } from "./data/report";
import { colourLimit } from "./charts/scale";
import { Touches } from "./data/touches";

export const page = signal<PageData | null>(null);
export const baseline = signal<{ name: string; report: Report } | null>(null);
export type Theme = "auto" | "light" | "dark";
export const theme = signal<Theme>("auto");

export const improved = signal(false); // residuals of the improved model instead of the given one
export const session = signal(-1); // entry of report.data with touches; -1: the one that the page is about
export const slice = signal<number | null>(null);
export const object = signal<string | null>(null);
export const finger = signal<number | null>(null);
export const touch = signal<number | null>(null); // its number in the file
export const picture = signal<string | null>(null);
export const covariate = signal<string>(""); // "": the one that the residual depends on most
export const step = signal<number | null>(null); // of the ladder

// Touches and pictures that were diagnosed together: every kind has its errors, in its unit.
export const joint = computed(() => (page.value?.words.of_data ?? []).some((one) => one.ladder));

export const hasImproved = computed(() => !!page.value?.report.improved_model_yaml);

// Entries of several sessions share the page; a click on a session shows its touches.
export const touchEntries = computed(() =>
  (page.value?.report.data ?? []).map((data, index) => ({ data, index })).filter(({ data }) => data.touch_table));
export const entry = computed(() => touchEntries.value.find(({ index }) => index === session.value) ?? touchEntries.value.find(({ index }) => index === page.value?.words.main) ?? touchEntries.value[0]);
// Entries that the views show: of several sessions the one that is chosen.
export const shownData = computed(() => {
  const report = page.value?.report;
  return !report ? [] : report.sessions && entry.value ? [entry.value.data] : report.data;
});
export const touches = computed(() => (entry.value ? new Touches(entry.value.data) : null));

// Half the width of the colours' scale: of the given model, so that colours before and after mean the same.
export const limit = computed(() => (touches.value ? colourLimit(touches.value.residual) : 1));

// 1 for every cell that slice, object and finger let through and that has a residual.
export const shown = computed(() => {
  const table = touches.value;
  if (!table) return new Uint8Array(0);
  const mask = new Uint8Array(table.cells);
  const values = table.residuals(improved.value);
  let inSlice: Uint8Array | null = null;
  if (slice.value !== null) {
    inSlice = new Uint8Array(table.cells);
    for (const cell of table.slices[slice.value] ?? []) inSlice[cell] = 1;
  }
  const wanted = object.value === null ? -1 : table.objects.indexOf(object.value);
  for (let cell = 0; cell < table.cells; ++cell) {
    if (Number.isNaN(values[cell])) continue;
    if (finger.value !== null && table.fingerOf(cell) !== finger.value) continue;
    if (wanted >= 0 && table.object[table.touchOf(cell)] !== wanted) continue;
    if (inSlice && !inSlice[cell]) continue;
    mask[cell] = 1;
  }
  return mask;
});

export const shownTouches = computed(() => {
  const table = touches.value;
  const mask = shown.value;
  const list: number[] = [];
  if (!table) return list;
  for (let cell = 0; cell < table.cells; ++cell) if (mask[cell] && list[list.length - 1] !== table.touchOf(cell)) list.push(table.touchOf(cell));
  return list;
});

export const touchIndex = computed(() => {
  const index = touch.value === null ? -1 : (touches.value?.find(touch.value) ?? -1);
  return index < 0 ? null : index;
});

// Worst first, of what is shown.
export const ranked = computed(() => {
  const table = touches.value;
  if (!table) return [];
  const values = table.residuals(improved.value);
  const norms = new Map(shownTouches.value.map((n) => [n, table.norm(n, values)]));
  return [...norms.keys()].sort((a, b) => norms.get(b)! - norms.get(a)!);
});

export function selectTouch(index: number | null): void {
  const table = touches.value;
  touch.value = index === null || !table ? null : table.number[index];
  if (index !== null && table && object.value !== null) object.value = table.objects[table.object[index]];
}

// The next or the previous one of the list that starts with the worst.
export function walk(by: number): void {
  const list = ranked.value;
  if (!list.length) return;
  const at = touchIndex.value === null ? -1 : list.indexOf(touchIndex.value);
  selectTouch(list[at < 0 ? (by > 0 ? 0 : list.length - 1) : (at + by + list.length) % list.length]);
}

// Of the photographs that are shown, the worst first.
export const rankedPictures = computed(() =>
  shownData.value.flatMap((data) => data.photographs?.photographs ?? []).filter((one) => object.value === null || one.object === object.value).sort((a, b) => b.rmse - a.rmse));

// Where there are photographs alone, they are what is gone through.
export function walkPictures(by: number): void {
  const list = rankedPictures.value.map((one) => one.image);
  if (!list.length) return;
  const at = picture.value === null ? -1 : list.indexOf(picture.value);
  picture.value = list[at < 0 ? (by > 0 ? 0 : list.length - 1) : (at + by + list.length) % list.length];
}

export function clearFilters(): void {
  slice.value = object.value = finger.value = touch.value = picture.value = null;
}

export const parity = "parity";

// What the residuals are drawn over: the choice, else the covariate that the error depends on most surely, else parity.
export const shownCovariate = computed(() => {
  const table = touches.value;
  const known = (name: string) => table?.columns.some((column) => column.name === name);
  if (covariate.value) return known(covariate.value) ? covariate.value : parity;
  const telling = [...(entry.value?.data.curves ?? [])].filter((curve) => curve.p < 0.01 && known(curve.covariate)).sort((a, b) => a.p - b.p);
  return telling[0]?.covariate ?? parity;
});

interface Field { key: string; read(): string; write(text: string): void }

const optionalNumber = (key: string, of: typeof slice): Field => ({
  key, read: () => (of.value === null ? "" : String(of.value)),
  write: (text) => { of.value = text !== "" && Number.isInteger(Number(text)) ? Number(text) : null; },
});
const optionalText = (key: string, of: typeof object): Field => ({
  key, read: () => of.value ?? "", write: (text) => { of.value = text || null; },
});

const fields: Field[] = [
  optionalNumber("slice", slice), optionalText("object", object), optionalNumber("finger", finger), optionalNumber("touch", touch),
  optionalText("picture", picture), optionalNumber("step", step),
  { key: "model", read: () => (improved.value ? "improved" : ""), write: (text) => { improved.value = text === "improved"; } },
  { key: "session", read: () => (session.value >= 0 ? String(session.value) : ""), write: (text) => { session.value = text !== "" && Number.isInteger(Number(text)) ? Number(text) : -1; } },
  { key: "by", read: () => covariate.value, write: (text) => { covariate.value = text; } },
];

export function readHash(): void {
  const hash = new URLSearchParams(location.hash.slice(1));
  for (const field of fields) field.write(hash.get(field.key) ?? "");
  if (!hasImproved.value) improved.value = false;
}

export function followHash(): void {
  if (location.hash.includes("=")) readHash();
  addEventListener("hashchange", () => { if (location.hash.includes("=") || !location.hash) readHash(); });
  effect(() => {
    const hash = new URLSearchParams();
    for (const field of fields) {
      const text = field.read();
      if (text) hash.set(field.key, text);
    }
    const wanted = hash.size ? `#${hash}` : "";
    // A page inside a frame of a notebook has no address of its own.
    try {
      if (wanted !== location.hash && (wanted || location.hash.includes("="))) history.replaceState(null, "", wanted || location.pathname);
    } catch { /* the selection works without */ }
  });
}
