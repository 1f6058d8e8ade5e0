// The live workbench in Debian's chromium, with the real touchstone behind it: TOUCHSTONE_BIN is the program.
import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import assert from "node:assert/strict";
import { join } from "node:path";
import { launch } from "./chromium.mjs";

const shots = process.env.TOUCHSTONE_SHOTS;
const program = process.env.TOUCHSTONE_BIN;
const axe = readFileSync(new URL("../node_modules/axe-core/axe.min.js", import.meta.url), "utf8");
let browser;
before(async () => { browser = await launch(); });
after(() => browser?.close());

async function served(act, view = {}) {
  const server = spawn(program, ["workbench", "--renderer", "cpu"], { stdio: ["ignore", "pipe", "inherit"] });
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 }, reducedMotion: "reduce", ...view });
  const said = [];
  page.on("console", (message) => { if (message.type() === "error" && !/GPU stall|swiftshader/i.test(message.text())) said.push(message.text()); });
  page.on("pageerror", (error) => said.push(error.stack));
  try {
    let printed = "";
    for await (const piece of server.stdout) { printed += piece; if (printed.includes("\n")) break; }
    await page.goto(printed.trim());
    await act(page, server, said);
    assert.deepEqual(said, []);
  } finally {
    await page.close();
    server.kill("SIGKILL");
  }
}

async function violations(page) {
  await page.evaluate(axe);
  const found = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
  return found.violations.map((one) => `${one.id}: ${one.nodes.map((node) => node.html.slice(0, 140)).slice(0, 3).join(" | ")}`);
}
const shot = async (page, name) => { if (shots) await page.screenshot({ path: join(shots, `${name}.png`) }); };
const errors = (page) => page.locator(".live-rung").evaluateAll((rungs) => rungs.map((rung) => Number(rung.dataset.rmse)));
const ready = (page) => page.waitForFunction(() => document.querySelector(".live-status")?.textContent === "Up to date." && ![...document.querySelectorAll(".live-rung")].some((rung) => rung.dataset.rmse === "NaN"));

async function improved(page) {
  await page.getByRole("button", { name: "Open the example" }).click();
  await ready(page);
  await page.getByRole("button", { name: "Find what is missing" }).click();
  await page.getByRole("button", { name: "Add tip_radius" }).click();
  await page.waitForFunction(() => document.querySelectorAll(".live-rung").length === 2);
  await ready(page);
}

for (const [name, view] of Object.entries({ wide: { colorScheme: "light" }, narrow: { viewport: { width: 390, height: 844 }, colorScheme: "dark" } })) {
  test(`three clicks find the missing effect, and the error falls (${name})`, async () => {
    await served(async (page) => {
      await page.getByRole("button", { name: "Open the example" }).waitFor();
      await shot(page, `live-empty-${name}`);
      await improved(page);
      const [given, better] = await errors(page);
      assert.ok(better < 0.5 * given, `${given} -> ${better}`);
      await shot(page, `live-added-${name}`);
      assert.deepEqual(await violations(page), []);
      assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth));
      const saved = page.waitForEvent("download");
      await page.getByRole("button", { name: "Save the model" }).click();
      assert.match(readFileSync(await (await saved).path(), "utf8"), /tip_radius/);
      await page.getByRole("button", { name: "Undo" }).click();
      await ready(page);
      assert.equal((await errors(page)).length, 1);
    }, view);
  });
}

test("a slider moves the error", async () => {
  await served(async (page) => {
    await improved(page);
    const before = (await errors(page))[1];
    const slider = page.locator(".slider", { hasText: "tip_radius" }).locator("input");
    const began = Date.now();
    await slider.fill("0");
    await page.waitForFunction((old) => Number(document.querySelectorAll(".live-rung")[1].dataset.rmse) > 1.5 * old, before);
    console.log(`a slider's error after ${Date.now() - began} ms`);
  });
});

test("a workbench that was killed is said, with what to do", async () => {
  await served(async (page, server, said) => {
    await improved(page);
    server.kill("SIGKILL");
    await new Promise((ended) => server.once("exit", ended));
    await page.getByRole("button", { name: "Undo" }).click();
    await page.getByText("Disconnected").waitFor();
    await shot(page, "live-disconnected");
    assert.equal(await page.locator(".stale").count() > 0, true);
    said.length = 0; // chromium itself tells of the refused connection
  });
});
