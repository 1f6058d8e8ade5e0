import { expect, test } from "vitest";
import { csvText } from "./export";
import { rangeOf, ticks, tickTexts } from "./scale";

test("ticks are round and within the range", () => {
  expect(ticks([-1.3, 4.2], 3)).toEqual([0, 2, 4]);
  expect(ticks([0, 100], 5)).toEqual([0, 20, 40, 60, 80, 100]);
  expect(ticks([3, 3], 5)).toEqual([]);
  // One tick is no scale.
  expect(ticks([-80, 95], 3.1)).toEqual([-50, 0, 50]);
});

test("the labels of an axis have as many decimals", () => {
  expect(tickTexts([-0.5, 0, 0.25])).toEqual(["\u22120.50", "0.00", "0.25"]);
  expect(tickTexts([0, 200, 400])).toEqual(["0", "200", "400"]);
});

test("a range holds all that is known and is never empty", () => {
  expect(rangeOf([Number.NaN, 0, 10], 0)).toEqual([0, 10]);
  const [low, high] = rangeOf([5, 5]);
  expect(low).toBeLessThan(high);
  expect(rangeOf([])).toEqual([0, 1]);
});

test("CSV quotes what would break it, and no text is a formula", () => {
  expect(csvText([["a,b", 'say "x"', 1.5], ["=1+1", Number.NaN, "-x"]])).toBe('"a,b","say ""x""",1.5\r\n\'=1+1,,\'-x\r\n');
});
