// Pages for the tests: the built template with data of tests/data, or with reports that touchstone wrote.
import { mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { gunzipSync } from "node:zlib";

const here = new URL(".", import.meta.url).pathname;
const folder = mkdtempSync(join(tmpdir(), "touchstone-page-"));

// As client/report/html_report.cpp fills it.
export function pageOf(data, name) {
  const template = readFileSync(process.env.TOUCHSTONE_PAGE ?? join(here, "../dist/page.html"), "utf8");
  const json = JSON.stringify(data).replace(/</g, "\\u003c").replace(/>/g, "\\u003e");
  const path = join(folder, `${name}.html`);
  writeFileSync(path, template.split("@TOUCHSTONE_DATA@").join(json));
  return `file://${path}`;
}

// What `touchstone diagnose --html` put into a page: data/NAME.json.gz; see data/README.md.
export const sample = (name) => JSON.parse(gunzipSync(readFileSync(join(here, `data/${name}.json.gz`))).toString("utf8"));
