// The digits that a number deserves: the rules of server/base/text/value_text.h, in its ASCII ("+-", "3e-9"); format.ts sets it in
// type. Both tests read server/base/text/value_text_cases.txt.

const maxDigits = 7; // beyond them nobody reads a value, however small its error

// As printf's %.*f: a half that a double holds exactly goes to the even digit, which toFixed rounds up.
function toDecimals(value: number, decimals: number): string {
  const exact = Math.abs(value).toFixed(Math.min(100, decimals + 60));
  const point = exact.indexOf(".");
  const kept = exact.slice(0, point + 1 + decimals).replace(/\.$/, "");
  const half = /^50*$/.test(exact.slice(point + 1 + decimals));
  return half && Number(kept[kept.length - 1]) % 2 === 0 ? `${value < 0 ? "-" : ""}${kept}` : value.toFixed(decimals);
}

// "3e-9" rather than "3.00e-9", and no "+".
const shortExponent = (text: string) => text.replace(/(\.\d*?)0+e/, "$1e").replace(".e", "e").replace("e+", "e");

// Decimals that show `digits` significant digits, after rounding: 0.9996 with three is 1.00.
export function decimalsFor(value: number, digits: number): number {
  if (!(Math.abs(value) > 0) || !Number.isFinite(value)) return 0;
  const exponent = Number(value.toExponential(digits - 1).split("e")[1]);
  return Math.min(9, Math.max(0, digits - 1 - exponent));
}

// Decimals of a value so that its error shows one digit, or two if that digit is a 1.
function decimalsForError(error: number): number {
  const decimals = decimalsFor(error, 1);
  return error * 10 ** decimals < 1.95 ? decimalsFor(error, 2) : decimals;
}

// With `decimals` decimals; never "-0.0"; "n/a" for NaN.
export function fixedNumber(value: number, decimals: number): string {
  if (Number.isNaN(value)) return "n/a";
  const text = toDecimals(value, decimals);
  return /[1-9]/.test(text) ? text : text.replace("-", "");
}

// `digits` significant digits, no exponent between 1e-4 and 1e7.
export function roundedNumber(value: number, digits: number): string {
  if (Number.isNaN(value)) return "n/a";
  if (!Number.isFinite(value)) return value > 0 ? "infinite" : "-infinite";
  const size = Math.abs(value);
  if (size === 0) return "0";
  if (size < 1e-4 || size >= 1e7) return shortExponent(value.toExponential(digits - 1));
  return fixedNumber(value, decimalsFor(value, digits));
}

// A round number as it is, to six digits.
export function roundNumber(value: number): string {
  if (value === 0 || !Number.isFinite(value)) return roundedNumber(value, 6);
  const exponent = Number(value.toExponential(5).split("e")[1]);
  if (exponent < -4 || exponent >= 6) return shortExponent(value.toExponential(5));
  const text = toDecimals(value, 5 - exponent);
  return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

// "2.98 +- 0.02"; the value alone where the error is 0 or not finite.
export function valueWithError(value: number, error: number): string {
  if (!(error > 1e-9) || !Number.isFinite(error) || error >= 1e7) return error === 0 ? roundNumber(value) : roundedNumber(value, 3);
  const decimals = decimalsForError(error);
  const shown = Math.min(decimals, decimalsFor(Math.max(Math.abs(value), error), maxDigits));
  return `${fixedNumber(value, shown)} +- ${shown === decimals ? fixedNumber(error, decimals) : roundedNumber(error, 2)}`;
}
