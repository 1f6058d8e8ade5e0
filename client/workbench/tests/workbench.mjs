// `touchstone workbench` with the page that it serves, for tests: TOUCHSTONE_BIN is the program, its other programs lie beside it.
import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import assert from "node:assert/strict";

export const program = process.env.TOUCHSTONE_BIN;
const shots = process.env.TOUCHSTONE_SHOTS;
const axe = readFileSync(new URL("../node_modules/axe-core/axe.min.js", import.meta.url), "utf8");

// Starts a program and waits for its first line; `name` lies beside touchstone.
export async function started(name, args, cwd, env = process.env) {
  const child = spawn(join(dirname(program), name), args, { stdio: ["ignore", "pipe", "ignore"], cwd, env });
  let printed = "";
  for await (const piece of child.stdout) {
    printed += piece;
    if (printed.includes("\n")) break;
  }
  assert.ok(printed.includes("\n"), `${name} ${args.join(" ")} ended`);
  return { child, line: printed.split("\n")[0].trim() };
}
export const ended = (child) => (child.exitCode !== null || child.signalCode !== null ? Promise.resolve() : new Promise((done) => child.once("exit", done)));

// What the console of a page says, which must be nothing.
export function listen(page) {
  const said = [];
  page.on("console", (message) => { if (message.type() === "error" && !/GPU stall|swiftshader/i.test(message.text())) said.push(message.text()); });
  page.on("pageerror", (error) => said.push(error.stack));
  return said;
}

// `act` gets the page, the process, what the console said, which must be nothing at the end, and the page's address.
export async function served(browser, folder, options, view, act) {
  const { child, line } = await started("touchstone", ["workbench", "--renderer", "cpu", ...options], folder);
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, reducedMotion: "reduce", ...view });
  const page = await context.newPage();
  const said = listen(page);
  try {
    await page.goto(line);
    await act(page, child, said, line);
    assert.deepEqual(said, []);
  } finally {
    await context.close();
    child.kill("SIGKILL");
  }
}

export async function violations(page) {
  await page.evaluate(axe);
  const found = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
  return found.violations.map((one) => `${one.id}: ${one.nodes.map((node) => node.html.slice(0, 140)).slice(0, 3).join(" | ")}`);
}
export const shot = async (page, name) => { if (shots) await page.screenshot({ path: join(shots, `live-${name}.png`) }); };
export const errors = (page) => page.locator(".live-rung").evaluateAll((rungs) => rungs.map((rung) => Number(rung.dataset.rmse)));
export const ready = (page, rungs) => page.waitForFunction((count) => {
  const shown = [...document.querySelectorAll(".live-rung")].map((rung) => rung.dataset.rmse);
  return document.querySelector(".live-status")?.textContent === "Up to date." && shown.length === count && !shown.includes("NaN");
}, rungs);
export const fits = (page) => page.evaluate(() => document.documentElement.scrollWidth <= innerWidth);


// The slider `name` gets a value each 20 ms and never rests, until as many errors were shown: milliseconds from one to the next.
export const dragSlider = (page, name, values) => page.evaluate(([name, values]) => new Promise((done, failed) => {
  setTimeout(() => failed(new Error(`${waits.length} of ${values.length} errors were shown within 30 s`)), 30000);
  const slider = [...document.querySelectorAll(".slider")].find((one) => one.textContent.includes(name)).querySelector("input");
  const last = () => [...document.querySelectorAll(".live-rung")].at(-1).dataset.rmse;
  let shown = last();
  let since = performance.now();
  const waits = [];
  let next = 0;
  const timer = setInterval(() => {
    slider.value = values[next++ % values.length];
    slider.dispatchEvent(new Event("input", { bubbles: true }));
  }, 20);
  const watch = new MutationObserver(() => {
    if (["NaN", shown].includes(last())) return;
    shown = last();
    waits.push(performance.now() - since);
    since = performance.now();
    if (waits.length < values.length) return;
    watch.disconnect();
    clearInterval(timer);
    done(waits);
  });
  watch.observe(document.querySelector(".live-main"), { subtree: true, attributes: true, childList: true });
}), [name, values]);
