// Numbers as people read them. The rules are those of client/report/words/words.cpp.
import type { DataReport, Kind, Value } from "./data/report";

const minus = "\u2212";
const thin = "\u2009";

function signed(text: string): string { return text.replace(/^-/, minus); }

// `digits` significant digits, no exponent between 1e-4 and 1e7; "n/a" where it is not known.
export function number(value: number | null | undefined, digits = 3): string {
  if (value === null || value === undefined || Number.isNaN(value)) return "n/a";
  if (!Number.isFinite(value)) return value > 0 ? "\u221e" : `${minus}\u221e`;
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e7 || size < 1e-4) {
    const [mantissa, exponent] = value.toExponential(Math.min(digits - 1, 1)).split("e");
    const power = superscript(Number(exponent));
    return signed(mantissa === "1.0" || mantissa === "1" ? `10${power}` : `${mantissa}\u00d710${power}`);
  }
  const places = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return signed(value.toFixed(places));
}

export function fixed(value: number, places: number): string {
  if (Number.isNaN(value)) return "n/a";
  const text = value.toFixed(places);
  return signed(Number(text) === 0 ? text.replace("-", "") : text);
}

function superscript(exponent: number): string {
  return String(exponent).replace("-", "\u207b").replace(/\d/g, (digit) => "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[Number(digit)]);
}

// Whole numbers of at least five digits in groups.
export function count(value: number): string {
  return value < 10000 ? String(value) : String(value).replace(/\B(?=(\d{3})+$)/g, thin);
}

export function probability(p: number | null | undefined): string {
  if (p === null || p === undefined || Number.isNaN(p)) return "n/a";
  if (p < 1e-15) return `<${thin}10\u207b\u00b9\u2075`;
  return p < 0.001 ? number(p, 1) : p.toFixed(p < 0.1 ? 3 : 2);
}

export function effectProbability(p: number): string {
  return p < 0.01 ? `<${thin}0.01` : p > 0.99 ? `>${thin}0.99` : p.toFixed(2);
}

export function share(value: number): string {
  return Number.isNaN(value) ? "n/a" : `${fixed(100 * value, Math.abs(value) < 0.0995 || value > 0.995 ? 1 : 0)}${thin}%`;
}

export interface Unit { symbol: string; factor: number }

// The unit that fits errors of this size on an axis, and the factor from the report's unit into it.
export function unitFor(kind: Kind, size: number): Unit {
  if (kind === "PHOTOGRAPHS") return { symbol: "grey levels", factor: 1 };
  if (kind === "BOARDS") return { symbol: "px", factor: 1 };
  if (size >= 999500) return { symbol: "s", factor: 1e-6 };
  return size >= 999.5 ? { symbol: "ms", factor: 1e-3 } : { symbol: "\u00b5s", factor: 1 };
}

// "41.0 ms", "12.3 grey", "0.123 px".
export function error(kind: Kind, value: number | null | undefined): string {
  if (value === null || value === undefined || Number.isNaN(value)) return "n/a";
  const unit = unitFor(kind, Math.abs(value));
  const symbol = kind === "PHOTOGRAPHS" ? "grey" : unit.symbol;
  const size = Math.abs(value);
  const text = kind === "PHOTOGRAPHS" ? fixed(value, size < 9.995 ? 2 : size < 99.95 ? 1 : 0) : number(value * unit.factor);
  return `${text}\u00a0${symbol}`;
}

export function signedError(kind: Kind, value: number): string {
  return `${value > 0 ? "+" : ""}${error(kind, value)}`;
}

export const isPictures = (kind: Kind) => kind === "PHOTOGRAPHS" || kind === "BOARDS";
export const readings = (data: DataReport) => (isPictures(data.kind) ? "pictures" : "touches");

// "radius_mm", with the finger, axis and object: "latency_us of finger l", "translation_mm x, lat10".
export function valueName(value: Value): string {
  const entry = value.finger ? (/^[xyz]$/.test(value.finger) ? ` ${value.finger}` : ` of finger ${value.finger}`) : "";
  return `${value.name}${entry}${value.object ? `, ${value.object}` : ""}`;
}

export const unitSymbol = (unit: string) => (unit === "us" ? "\u00b5s" : unit === "deg" ? "\u00b0" : unit);

// Times in the unit for people; others as they are.
function scaled(value: Value): { factor: number; symbol: string } {
  if (value.unit !== "us") return { factor: 1, symbol: unitSymbol(value.unit) };
  const unit = unitFor("TOUCHES", Math.max(Math.abs(value.value), value.std_error || 0));
  return { factor: unit.factor, symbol: unit.symbol };
}

const spaced = (symbol: string) => (symbol ? (symbol === "\u00b0" ? symbol : `\u00a0${symbol}`) : "");

// "2.98 ± 0.02 mm": as many digits as the error allows.
export function withError(value: Value): string {
  const { factor, symbol } = scaled(value);
  const x = value.value * factor;
  const sigma = value.std_error * factor;
  if (!(sigma > 0) || !Number.isFinite(sigma)) return `${number(x)}${spaced(symbol)}`;
  const places = Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(sigma))));
  return `${fixed(x, places)}\u00a0\u00b1\u00a0${sigma.toFixed(places)}${spaced(symbol)}`;
}

export function before(value: Value): string {
  if (value.before === undefined) return "";
  const { factor, symbol } = scaled(value);
  return `${number(value.before * factor)}${spaced(symbol)}`;
}

export function hasInterval(value: Value): boolean {
  return Number.isFinite(value.lower) && Number.isFinite(value.upper) && value.lower < value.upper;
}

export function interval(value: Value): string {
  if (!hasInterval(value)) return "";
  const { factor, symbol } = scaled(value);
  return `${number(value.lower * factor)} to ${number(value.upper * factor)}${spaced(symbol)}`;
}

// "incidence (°)" of incidence_deg.
export function covariateName(name: string): string {
  if (name === "first") return "later finger (0) or first (1)";
  const stem = name.startsWith("cov_") ? name : name.replace(/_(mm_s2|mm_s|per_m|mm|deg|us|s)$/, "");
  return stem === name ? name.replace(/^touch_number$/, "touch number") : stem.replace(/_/g, " ");
}

export function covariate(name: string, unit: string): string {
  return `${covariateName(name)}${unit ? ` (${unitSymbol(unit)})` : ""}`;
}

export function join(words: string[], last: string): string {
  if (words.length < 2) return words.join("");
  return `${words.slice(0, -1).join(", ")} ${last} ${words[words.length - 1]}`;
}

// ASCII of the sentences, set in type.
export function typeset(text: string): string {
  return text
    .replace(/(^|[ ([])-(?=\d)/g, `$1${minus}`)
    .replace(/ ?\+- /g, "\u00a0\u00b1\u00a0")
    .replace(/<->/g, "\u2194")
    .replace(/->/g, "\u2192")
    .replace(/(\d) us\b/g, "$1\u00a0\u00b5s")
    .replace(/(\d) (ms|s|mm|mm\/s|%|px|grey)(?![\w/])/g, "$1\u00a0$2")
    .replace(/(\d) deg\b/g, "$1\u00b0")
    .replace(/\b1e-?(\d+)\b/g, (all, power: string) => `10${superscript(all.includes("-") ? -Number(power) : Number(power))}`)
    .replace(/(\d)e(-?\d+)\b/g, (_, digit: string, power: string) => `${digit}\u00d710${superscript(Number(power))}`);
}
