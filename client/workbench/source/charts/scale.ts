// Ticks and ranges of axes.

export type Range = [number, number];

const minTicks = 3; // fewer give an axis no scale

// Round numbers within the range, about `wanted` of them.
export function ticks([low, high]: Range, wanted: number): number[] {
  const span = high - low;
  if (!(span > 0) || !Number.isFinite(span)) return [];
  const at = (rough: number) => {
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = power * ([1, 2, 5, 10].find((round) => round * power >= rough * 0.999) ?? 10);
    const list: number[] = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) list.push(Number((k * step).toPrecision(12)));
    return list;
  };
  for (let rough = span / Math.max(1, wanted); ; rough /= 2) {
    const list = at(rough);
    if (list.length >= minTicks) return list;
  }
}

// Of all finite values, with a margin of 4 %; never empty.
export function rangeOf(values: Iterable<number>, margin = 0.04): Range {
  let low = Number.POSITIVE_INFINITY;
  let high = Number.NEGATIVE_INFINITY;
  for (const value of values) {
    if (!Number.isFinite(value)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (low > high) return [0, 1];
  if (low === high) return [low - (Math.abs(low) || 1) * 0.5, high + (Math.abs(high) || 1) * 0.5];
  const extra = margin * (high - low);
  return [low - extra, high + extra];
}

// Of one axis: all with as many decimals.
export function tickTexts(list: number[]): string[] {
  const decimals = Math.max(0, ...list.map((value) => (String(value).split("e")[0].split(".")[1] ?? "").length));
  return list.map((value) => (Math.abs(value) >= 1e6 || list.some((one) => one !== 0 && Math.abs(one) < 1e-4) ? tickText(value) : value.toFixed(decimals).replace(/^-(?=[0.]*$)/, "").replace("-", "\u2212")));
}

export function tickText(value: number): string {
  const size = Math.abs(value);
  const text = size !== 0 && (size >= 1e6 || size < 1e-4) ? value.toExponential() : String(value);
  return text.replace("-", "\u2212");
}

// Half the width of the colour scale: 98 % of the sizes lie within; a round number.
export function colourLimit(values: Float32Array): number {
  const step = Math.max(1, Math.floor(values.length / 20000));
  const sizes: number[] = [];
  for (let i = 0; i < values.length; i += step) if (!Number.isNaN(values[i])) sizes.push(Math.abs(values[i]));
  sizes.sort((a, b) => a - b);
  const size = sizes[Math.floor(sizes.length * 0.98)] ?? 0;
  if (!(size > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(size));
  return power * ([1, 1.5, 2, 3, 4, 5, 6, 8, 10].find((round) => size <= round * power * 1.0001) ?? 10);
}
