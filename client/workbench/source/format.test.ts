import { expect, test } from "vitest";
import type { Value } from "./data/report";
import { count, error, fixed, interval, join, number, probability, share, typeset, withError } from "./format";

const value = (fields: Partial<Value>): Value => ({ name: "radius_mm", value: 2.98, std_error: 0.02, unit: "mm", finger: "", object: "", lower: Number.NaN, upper: Number.NaN, alone: [], ...fields });

test("numbers have three figures and powers of ten beyond", () => {
  expect(number(41.04)).toBe("41.0");
  expect(number(-0.0123)).toBe("\u22120.0123");
  expect(number(3e-9)).toBe("3.0\u00d710\u207b\u2079");
  expect(number(Number.NaN)).toBe("n/a");
  expect(fixed(-0.0001, 2)).toBe("0.00");
  expect(count(20160)).toBe("20\u2009160");
});

test("errors are written in the unit that fits", () => {
  expect(error("TOUCHES", 41000)).toBe("41.0\u00a0ms");
  expect(error("TOUCHES", 850)).toBe("850\u00a0\u00b5s");
  expect(error("PHOTOGRAPHS", 12.34)).toBe("12.3\u00a0grey");
});

test("probabilities and shares do not pretend to be exact", () => {
  expect(probability(1e-20)).toMatch(/^</);
  expect(probability(0.4)).toBe("0.40");
  expect(share(0.985)).toBe("99\u2009%");
});

test("values have as many digits as their error allows", () => {
  expect(withError(value({}))).toBe("2.980\u00a0\u00b1\u00a00.020\u00a0mm");
  expect(withError(value({ value: 5000, std_error: 100, unit: "us" }))).toBe("5.00\u00a0\u00b1\u00a00.10\u00a0ms");
  expect(interval(value({ lower: 2.94, upper: 3.02 }))).toBe("2.94 to 3.02\u00a0mm");
  expect(interval(value({}))).toBe("");
});

test("sentences are set in type, names are left alone", () => {
  expect(typeset("-3.1 +- 0.2 us")).toBe("\u22123.1\u00a0\u00b1\u00a00.2\u00a0\u00b5s");
  expect(typeset("41.0 -> 5.0 ms")).toBe("41.0 \u2192 5.0\u00a0ms");
  expect(typeset("lat-10 and cov_us_2 s3e")).toBe("lat-10 and cov_us_2 s3e");
  expect(join(["a", "b", "c"], "or")).toBe("a, b or c");
});
