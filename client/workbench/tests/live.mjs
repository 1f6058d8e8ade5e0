// The live workbench in Debian's chromium, with the real touchstone behind it: TOUCHSTONE_BIN is the program.
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { after, before, test } from "node:test";
import assert from "node:assert/strict";
import { join } from "node:path";
import { launch } from "./chromium.mjs";
import { errors, fits, program, ready, served, shot, violations } from "./workbench.mjs";

let browser;
let folder;
before(async () => {
  folder = mkdtempSync(join(tmpdir(), "touchstone-live-"));
  browser = await launch();
});
after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true });
});

// Clicks as a person does, counted.
function clicker(page) {
  let count = 0;
  const click = async (name) => { ++count; await page.getByRole("button", { name }).click(); };
  return { click, count: () => count };
}

// Milliseconds from a slider's event to the error of the rung `at` in the document, by the page's own clock.
const timeOfSlider = (page, name, value, at) => page.evaluate(([name, value, at]) => new Promise((done) => {
  const slider = [...document.querySelectorAll(".slider")].find((one) => one.textContent.includes(name)).querySelector("input");
  const rung = () => document.querySelectorAll(".live-rung")[at]?.dataset.rmse;
  const before = rung();
  const began = performance.now();
  const watch = new MutationObserver(() => {
    if (rung() === undefined || rung() === "NaN" || rung() === before) return;
    watch.disconnect();
    done(performance.now() - began);
  });
  watch.observe(document.querySelector(".live-main"), { subtree: true, attributes: true, childList: true });
  slider.value = value;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
}), [name, value, at]);

test("from an empty page to the missing effect, its values, and a workbench that is killed", async () => {
  await served(browser, folder, [], { colorScheme: "light" }, async (page, server, said) => {
    const person = clicker(page);
    await page.getByRole("button", { name: "Open the example" }).waitFor();
    await shot(page, "empty");
    assert.deepEqual(await violations(page), []);
    await person.click("Open the example");
    await ready(page, 1);
    await shot(page, "opened");
    await person.click("Find what is missing");
    await page.getByRole("button", { name: "Cancel" }).waitFor();
    await shot(page, "finding");
    await page.getByRole("button", { name: "Add tip_radius" }).waitFor();
    await shot(page, "found");
    await person.click("Add tip_radius");
    await ready(page, 2);
    const [given, better] = await errors(page);
    assert.ok(better < 0.5 * given, `${given} -> ${better}`);
    await shot(page, "added");
    assert.ok(person.count() < 8);
    assert.deepEqual(await violations(page), []);

    const saved = page.waitForEvent("download");
    await person.click("Save the model");
    assert.match(readFileSync(await (await saved).path(), "utf8"), /tip_radius/);

    // A slider: its error follows, the last of many values wins, and Undo takes all of them away.
    const times = [];
    for (const value of [0.5, 4, 1, 3, 0]) {
      times.push(await timeOfSlider(page, "tip_radius", value, 2));
      await ready(page, 3);
    }
    console.log(`a slider's error after ${times.map((time) => time.toFixed(0)).join(", ")} ms`);
    assert.ok((await errors(page))[2] > 1.5 * better);
    const slider = page.locator(".slider", { hasText: "tip_radius" }).locator("input");
    for (const value of ["0.6", "1.2", "1.8", "2"]) await slider.fill(value);
    await ready(page, 3);
    assert.match(await page.locator(".slider", { hasText: "tip_radius" }).innerText(), /2\.000 mm/);
    assert.ok((await errors(page))[2] < 1.05 * better);
    await shot(page, "slider");
    await person.click("Undo");
    await ready(page, 2);
    assert.deepEqual(await errors(page), [given, better]);

    server.kill("SIGKILL");
    await new Promise((ended) => server.once("exit", ended));
    await person.click("Undo");
    await page.getByText("Disconnected").waitFor();
    await shot(page, "disconnected");
    assert.equal(await page.locator(".stale").count(), 2);
    assert.deepEqual(await violations(page), []);
    said.length = 0; // chromium itself tells of the refused connection
  });
});

test("a phone in the dark shows measurements with hostile names", async () => {
  const evil = "<img src=x onerror=alert(1)>.csv";
  const touchstone = (...args) => assert.equal(spawnSync(program, args, { cwd: folder, stdio: "inherit" }).status, 0);
  touchstone("model", "new", "--name", "<s>nominal</s>", "-o", "model.yaml");
  touchstone("plan", "lat20", "--plan", "faces", "-o", "plan.csv");
  touchstone("touch", "--plan", "plan.csv", "--model", "model.yaml", "-o", evil);
  await served(browser, folder, [evil, "--model", "model.yaml"], { viewport: { width: 390, height: 844 }, colorScheme: "dark" }, async (page) => {
    await ready(page, 1);
    assert.equal(await page.locator("img, s").count(), 0);
    assert.equal(await page.locator("script").count(), 2);
    assert.match(await page.locator(".live h2").innerText(), /<img src=x/);
    await shot(page, "narrow");
    assert.ok(await fits(page));
    assert.deepEqual(await violations(page), []);
  });
});
