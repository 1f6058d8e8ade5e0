import { expect, test } from "vitest";
import type { Value } from "./data/report";
import { count, effectProbability, error, fixed, interval, join, number, probability, share, signedError, sized, typeset, withError } from "./format";
import { casesOf } from "./testing/cases";

const value = (fields: Partial<Value>): Value => ({ name: "radius_mm", value: 2.98, std_error: 0.02, unit: "mm", finger: "", object: "", lower: Number.NaN, upper: Number.NaN, alone: [], ...fields });

const rules: Record<string, (unit: string, a: number, b: number) => string> = {
  time: (_, us) => error("TOUCHES", us), signed_time: (_, us) => signedError("TOUCHES", us), grey: (_, level) => error("PHOTOGRAPHS", level), px: (_, size) => error("BOARDS", size),
  probability: (_, p) => probability(p), effect_probability: (_, p) => effectProbability(p), share: (_, part) => share(part), count: (_, of) => count(of),
  value: (unit, of, std_error) => withError(value({ value: of, std_error, unit })), size: (unit, of) => sized(of, unit), interval: (unit, lower, upper) => interval(value({ lower, upper, unit })),
};
const plain = (text: string) => text.replace(/[\u00a0\u2009]/g, " ");

test.each(casesOf("client/report/words/word_cases.txt"))("$rule of $values is $text, set in type", ({ rule, values, text }) => {
  const [name, unit = ""] = rule.split(" ");
  expect(plain(rules[name](unit, values[0], values[1]))).toBe(plain(typeset(text)));
});

test("numbers are set in type", () => {
  expect(number(-0.0123)).toBe("\u22120.0123");
  expect(number(3e-9)).toBe("3\u00d710\u207b\u2079");
  expect(number(-Number.POSITIVE_INFINITY)).toBe("\u2212\u221e");
  expect(fixed(-0.0001, 2)).toBe("0.00");
  expect(withError(value({}))).toBe("2.98\u00a0\u00b1\u00a00.02\u00a0mm");
  expect(interval(value({}))).toBe("");
});

test("sentences are set in type, names are left alone", () => {
  expect(typeset("-3.1 +- 0.2 us")).toBe("\u22123.1\u00a0\u00b1\u00a00.2\u00a0\u00b5s");
  expect(typeset("p 1.2e-5 and 1e-9")).toBe("p 1.2\u00d710\u207b\u2075 and 10\u207b\u2079");
  expect(typeset("(p < 0.001)")).toBe("(p <\u00a00.001)");
  expect(typeset("41.0 -> 5.0 ms")).toBe("41.0 \u2192 5.0\u00a0ms");
  expect(typeset("lat-10 and cov_us_2 s3e")).toBe("lat-10 and cov_us_2 s3e");
  expect(join(["a", "b", "c"], "or")).toBe("a, b or c");
});
