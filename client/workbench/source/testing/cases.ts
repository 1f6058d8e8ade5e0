import { readFileSync } from "node:fs";

// The cases that a C++ test reads too: the rule, its arguments, the text.
export function casesOf(path: string): { rule: string; values: number[]; text: string }[] {
  const lines = readFileSync(new URL(`../../../../${path}`, import.meta.url), "utf8").split("\n").filter((line) => line && !line.startsWith("#"));
  return lines.map((line) => {
    const [rule, values, text] = line.split(/ \| ?/);
    return { rule, values: values.split(" ").map((one) => (/inf/.test(one) ? Number(one.replace("inf", "Infinity")) : Number(one))), text };
  });
}
