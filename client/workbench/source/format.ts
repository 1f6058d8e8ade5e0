// Numbers as people read them: the digits of numbers.ts, and the rules of client/report/words/words.h (its cases, in
// client/report/words/word_cases.txt, are read by the test of this file too), set in type.
import type { DataReport, Kind, Value } from "./data/report";
import { decimalsFor, fixedNumber, roundedNumber, roundNumber, valueWithError } from "./numbers";

const minus = "\u2212";
const thin = "\u2009";

function superscript(exponent: number): string {
  return String(exponent).replace("-", "\u207b").replace(/\d/g, (digit) => "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[Number(digit)]);
}

// `digits` significant digits, no exponent between 1e-4 and 1e7; "n/a" where it is not known.
export function number(value: number | null | undefined, digits = 3): string {
  return typeset(roundedNumber(value ?? Number.NaN, digits)).replace("infinite", "\u221e");
}

// A round number as it is: "20", "0.05".
export function plain(value: number): string { return typeset(roundNumber(value)); }

export function fixed(value: number, places: number): string { return typeset(fixedNumber(value, places)); }

// Whole numbers of at least five digits in groups.
export function count(value: number): string {
  return value < 10000 ? String(value) : String(value).replace(/\B(?=(\d{3})+$)/g, thin);
}

export function probability(p: number | null | undefined): string {
  if (p === null || p === undefined || Number.isNaN(p)) return "n/a";
  if (p < 1e-15) return typeset("< 1e-15");
  if (p < 0.001) return number(p, 1);
  return p > 0.995 ? "1.00" : fixed(p, p < 0.1 ? 3 : 2);
}

export function effectProbability(p: number): string {
  if (Number.isNaN(p)) return "";
  return typeset(p < 0.005 ? "< 0.01" : p > 0.995 ? "> 0.99" : fixed(p, 2));
}

export function share(value: number): string {
  if (Number.isNaN(value)) return "n/a";
  const percent = 100 * value;
  return typeset(`${fixedNumber(percent, Math.abs(percent) < 9.95 || (percent > 97 && percent < 99.95) ? 1 : 0)} %`);
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
  // Never finer than a hundredth of a grey level.
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

export const unitSymbol = (unit: string) => (unit === "deg" ? "\u00b0" : unit.replace(/^us\b/, "\u00b5s").replace("^2", "\u00b2"));

// Times in the unit for people that fits this size; others as they are.
function scaled(size: number, unit: string): Unit {
  return unit === "us" ? unitFor("TOUCHES", size) : { factor: 1, symbol: unitSymbol(unit) };
}

export const spaced = (symbol: string) => (symbol ? (symbol === "\u00b0" ? symbol : `\u00a0${symbol}`) : "");

// "2.98 \u00b1 0.02 mm": as many digits as the error allows.
export function measured(value: number, stdError: number, unit: string): string {
  const { factor, symbol } = scaled(Math.max(Math.abs(value), stdError || 0), unit);
  return `${typeset(valueWithError(value * factor, stdError * factor))}${spaced(symbol)}`;
}
export const withError = (value: Value) => measured(value.value, value.std_error, value.unit);

export function before(value: Value): string {
  return value.before === undefined ? "" : measured(value.before, 0, value.unit);
}

export function hasInterval(value: Value): boolean {
  return Number.isFinite(value.lower) && Number.isFinite(value.upper) && value.lower < value.upper;
}

export function interval(value: Value): string {
  if (!hasInterval(value)) return "";
  const { factor, symbol } = scaled(Math.max(Math.abs(value.lower), Math.abs(value.upper)), value.unit);
  const decimals = decimalsFor((value.upper - value.lower) * factor, 2);
  return `${fixed(value.lower * factor, decimals)} to ${fixed(value.upper * factor, decimals)}${spaced(symbol)}`;
}

// A size of a value in its unit: "0.16\u00b0", "1.2 ms".
export function sized(value: number, unit: string, digits = 2): string {
  const { factor, symbol } = scaled(Math.abs(value), unit);
  return `${number(value * factor, digits)}${spaced(symbol)}`;
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
    .replace(/built-in/g, "built\u2011in")
    .replace(/(^|[ ([])-(?=\d|infinite)/g, `$1${minus}`)
    .replace(/ ?\+- /g, "\u00a0\u00b1\u00a0")
    .replace(/<->/g, "\u2194")
    .replace(/->/g, "\u2192")
    .replace(/([<>=]) (?=\d)/g, `$1\u00a0`)
    .replace(/(\d) us\b/g, "$1\u00a0\u00b5s")
    .replace(/(\d) (ms|s|mm|mm\/s|%|px|grey)(?![\w/])/g, "$1\u00a0$2")
    .replace(/(\d) deg\b/g, "$1\u00b0")
    .replace(/(?<![\w.])1e(-?\d+)\b/g, (_, power: string) => `10${superscript(Number(power))}`)
    .replace(/(\d)e(-?\d+)\b/g, (_, digit: string, power: string) => `${digit}\u00d710${superscript(Number(power))}`);
}
