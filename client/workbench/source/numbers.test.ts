import { expect, test } from "vitest";
import { fixedNumber, roundedNumber, roundNumber, valueWithError } from "./numbers";
import { casesOf } from "./testing/cases";

const rules: Record<string, (a: number, b: number) => string> = {
  value_with_error: valueWithError, rounded: roundedNumber, fixed: fixedNumber, round: roundNumber,
};

test.each(casesOf("server/base/text/value_text_cases.txt"))("$rule of $values is $text, as in C++", ({ rule, values, text }) => {
  expect(rules[rule](values[0], values[1])).toBe(text);
});
