// Where the page's data come from. A file carries them in a <script>; of a live workbench (live.ts) that says so.
import type { PageData, Report } from "./report";

export interface Source { load(): Promise<PageData> }

// Keys whose values are texts of people: "NaN" is a name there.
const texts = new Set(["name", "object", "objects", "finger", "fingers", "session", "slice", "labels", "effect"]);
const numbers: Record<string, number> = { NaN: Number.NaN, Infinity: Number.POSITIVE_INFINITY, "-Infinity": Number.NEGATIVE_INFINITY };

// Protobuf JSON writes numbers that are not known as strings. The table of touches is left to its typed arrays.
function withNumbers(value: unknown, key: string): unknown {
  if (typeof value === "string") return value in numbers && !texts.has(key) ? numbers[value] : value;
  if (Array.isArray(value)) {
    for (let i = 0; i < value.length; ++i) value[i] = withNumbers(value[i], key);
  } else if (value !== null && typeof value === "object" && key !== "touch_table") {
    const record = value as Record<string, unknown>;
    for (const name of Object.keys(record)) record[name] = withNumbers(record[name], name);
  }
  return value;
}

export function parsePageData(text: string): PageData {
  const data = JSON.parse(text) as PageData;
  if (!data.report || !data.words) throw new Error("the data have no report");
  withNumbers(data.report, "");
  return data;
}

// What client/workbench_server puts in the place of a report.
export const isLive = () => document.getElementById("touchstone-data")?.textContent?.trim() === '{"live":true}';

export class FileSource implements Source {
  async load(): Promise<PageData> {
    const element = document.getElementById("touchstone-data");
    if (!element?.textContent) throw new Error("the file has no data; was it cut off?");
    return parsePageData(element.textContent);
  }
}

// A report of another run, to compare with: what --html or --json wrote.
export function parseOtherReport(text: string): Report {
  let json = text;
  if (text.trimStart().startsWith("<")) {
    const page = new DOMParser().parseFromString(text, "text/html");
    json = page.getElementById("touchstone-data")?.textContent ?? "";
    if (!json) throw new Error("this page is not a report of Touchstone");
  }
  const parsed = JSON.parse(json) as PageData | Report;
  const report = "report" in parsed ? parsed.report : parsed;
  if (!Array.isArray(report.data) || !Array.isArray(report.steps)) throw new Error("this JSON is not a report of Touchstone");
  return withNumbers(report, "") as Report;
}
