// The live workbench in Debian's chromium, with the real touchstone behind it: TOUCHSTONE_BIN is the program.
import { spawnSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, statSync, watch, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { after, before, test } from "node:test";
import assert from "node:assert/strict";
import { join } from "node:path";
import { launch } from "./chromium.mjs";
import { dragSlider, ended, errors, fits, program, ready, served, shot, started, violations } from "./workbench.mjs";

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

    // A page that is loaded again has its model still.
    await page.reload();
    await ready(page, 2);
    assert.deepEqual(await errors(page), [given, better]);

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
    // A slider that does not rest cuts no comparison off: each of them ends in an error that is shown.
    let asked = 0;
    page.on("request", (request) => { asked += request.url().endsWith("/Compare") ? 1 : 0; });
    const waits = await dragSlider(page, "tip_radius", Array.from({ length: 10 }, (_, k) => String(0.5 + 0.35 * ((k * 7) % 10))));
    console.log(`while it does not rest a new error after ${waits.map((time) => time.toFixed(0)).join(", ")} ms`);
    await ready(page, 3);
    assert.ok(asked <= waits.length + 4, `${asked} comparisons for ${waits.length} errors`);
    const slider = page.locator(".slider", { hasText: "tip_radius" }).locator("input");
    for (const value of ["0.6", "1.2", "1.8", "2"]) await slider.fill(value);
    await ready(page, 3);
    assert.match(await page.locator(".slider", { hasText: "tip_radius" }).innerText(), /\b2\smm/);
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

const touchstone = (...args) => assert.equal(spawnSync(program, args, { cwd: folder, stdio: "inherit" }).status, 0);

test("an effect that no catalogue has, as a formula", async () => {
  touchstone("model", "new", "--name", "plain", "-o", "plain.yaml");
  touchstone("model", "add", "plain.yaml", "formula", "name=screw", "adds=travel_mm", "expression=k * sin(2*pi*travel_mm/lead)", "k=0.4", "k_unit=mm", "k_min=-1", "k_max=1", "lead=9", "lead_unit=mm", "lead_min=2", "lead_max=20", "-o", "screw.yaml");
  touchstone("plan", "lat20", "--plan", "faces", "-o", "faces.csv");
  touchstone("touch", "--plan", "faces.csv", "--model", "screw.yaml", "-o", "screw.csv");
  await served(browser, folder, ["screw.csv", "--model", "plain.yaml"], { colorScheme: "dark" }, async (page, server, said) => {
    await ready(page, 1);
    await page.getByText("Add an effect of your own: a formula").click();
    const box = page.getByLabel("Formula", { exact: true });
    await box.fill("k * sin(2*pi*");
    const fault = page.locator(".formula-fault");
    await fault.waitFor();
    assert.match(await fault.innerText(), /character \d+/);
    assert.ok(await page.getByRole("button", { name: "Add the formula" }).isDisabled());
    await shot(page, "formula-error");
    assert.deepEqual(await violations(page), []);
    await box.press("End");
    await page.locator(".offered").getByRole("button", { name: "travel_mm", exact: true }).click();
    await box.press("End");
    await box.pressSequentially("/lead)");
    await fault.waitFor({ state: "detached" });
    const row = (name) => page.locator(".formula-parameter", { hasText: name });
    await row("lead").waitFor();
    await page.getByLabel("Name", { exact: true }).fill("screw");
    await row("k").first().getByLabel("value").fill("0.4");
    for (const [label, value] of [["value", "9"], ["from", "2"], ["to", "20"]]) await row("lead").getByLabel(label, { exact: true }).fill(value);
    await shot(page, "formula");
    await page.getByRole("button", { name: "Add the formula" }).click();
    await ready(page, 2);
    const [given, better] = await errors(page);
    assert.ok(better < 0.5 * given, `${given} -> ${better}`);
    await timeOfSlider(page, "screw", 0, 2);
    await ready(page, 3);
    assert.ok((await errors(page))[2] > 2 * better, `${await errors(page)}`);
    await page.getByRole("button", { name: "Undo" }).click();
    await page.getByRole("button", { name: "Undo" }).click();
    await ready(page, 1);
    said.length = 0; // chromium itself tells of the answer 400 to an expression with an error
  });
});

test("the next server goes on where one is killed, and the page says so where none answers", async () => {
  const servers = [];
  for (let k = 0; k < 2; ++k) servers.push(await started("touchstone-server", ["--listen", "127.0.0.1:0"], folder));
  const at = servers.map((one) => one.line.split(" ").pop());
  try {
    await served(browser, folder, ["--server", at.join(",")], {}, async (page, server, said) => {
      await page.getByRole("button", { name: "Open the example" }).click();
      await ready(page, 1);
      await page.getByText(`simulated by ${at[0]}`).waitFor();
      // In the middle of a diagnosis.
      await page.getByRole("button", { name: "Find what is missing" }).click();
      await page.getByRole("button", { name: "Cancel" }).waitFor();
      servers[0].child.kill("SIGKILL");
      await page.getByRole("heading", { name: "What is missing" }).waitFor();
      await page.getByText(`simulated by ${at[1]}`).waitFor();
      servers[1].child.kill("SIGKILL");
      await ended(servers[1].child);
      await page.getByRole("button", { name: "Find what is missing" }).click();
      await page.getByText("Disconnected").waitFor();
      await shot(page, "no-server");
      assert.deepEqual(await violations(page), []);
      said.length = 0;
    });
  } finally { for (const one of servers) one.child.kill("SIGKILL"); }
});

test("measurements too large for a request are sent again to a server that is started anew, and to the next one", async () => {
  touchstone("model", "new", "--name", "plain", "-o", "large.yaml");
  touchstone("plan", "lat20", "--plan", "faces", "--count", "192", "-o", "large-plan.csv");
  touchstone("touch", "--plan", "large-plan.csv", "--model", "large.yaml", "-o", "small.csv");
  // More than 16 MiB: digits that say nothing.
  const [head, ...rows] = readFileSync(join(folder, "small.csv"), "utf8").trimEnd().split("\n");
  writeFileSync(join(folder, "large.csv"), `${head},cov_wide\n${rows.map((row) => `${row},0.5${"0".repeat(100000)}`).join("\n")}\n`);
  assert.ok(statSync(join(folder, "large.csv")).size > 16 << 20);
  const start = (port) => started("touchstone-server", ["--listen", `127.0.0.1:${port}`], folder);
  const servers = [await start(0), await start(0)];
  const at = servers.map((one) => one.line.split(" ").pop());
  try {
    await served(browser, folder, ["large.csv", "--model", "large.yaml", "--server", at.join(",")], {}, async (page, server, said) => {
      await ready(page, 1);
      const [given] = await errors(page);
      servers[0].child.kill("SIGKILL");
      await ended(servers[0].child);
      await page.getByRole("button", { name: "Find what is missing" }).click();
      await page.getByRole("heading", { name: "What is missing" }).waitFor();
      await page.getByText(`simulated by ${at[1]}`).waitFor();
      // None is there; then one is, with nothing of what was.
      servers[1].child.kill("SIGKILL");
      await ended(servers[1].child);
      await page.getByRole("button", { name: "Find what is missing" }).click();
      await page.getByText("Disconnected").waitFor();
      servers[1] = await start(at[1].split(":")[1]);
      await page.getByRole("button", { name: "Try again" }).click();
      await page.waitForFunction(() => document.querySelector(".live-status")?.textContent === "Up to date.");
      assert.deepEqual(await errors(page), [given]);
      said.length = 0;
    });
  } finally { for (const one of servers) one.child.kill("SIGKILL"); }
});

test("a formula over the pixels of photographs", async () => {
  touchstone("model", "new", "--name", "lens", "-o", "lens.yaml");
  touchstone("model", "add", "lens.yaml", "formula", "name=glare", "adds=grey", "expression=k * radius^2", "k=30", "k_unit=grey", "k_min=-60", "k_max=60", "-o", "glare.yaml");
  const views = [0, 60, 120, 180, 240, 300].map((deg) => [400 * Math.cos((deg * Math.PI) / 180), 400 * Math.sin((deg * Math.PI) / 180), 150]);
  const set = join(folder, "photos");
  mkdirSync(set);
  const file = (i) => `p-${String(i).padStart(4, "0")}.png`;
  writeFileSync(join(set, "images.csv"), `image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,up_z\n${views.map((eye, i) => [i, file(i), "lat20", ...eye.map((x) => x.toFixed(3)), 0, 0, 0, 0, 0, 1].join(",")).join("\n")}\n`);
  const size = 96, focal = size / 2 / Math.tan(Math.PI / 8);
  writeFileSync(join(set, "camera.yaml"), `{width_px: ${size}, height_px: ${size}, fx_px: ${focal}, fy_px: ${focal}, cx_px: ${size / 2}, cy_px: ${size / 2}}\n`);
  touchstone("capture", "lat20", "--plan", join(set, "images.csv"), "--image", `${size}x${size}`, "--model", "glare.yaml", "--renderer", "cpu", "-o", join(set, "p.png"));
  await served(browser, folder, ["photos", "--model", "lens.yaml"], { colorScheme: "light" }, async (page, server, said) => {
    await ready(page, 1);
    await page.getByText("Add an effect of your own: a formula").click();
    const offered = page.locator(".offered");
    await offered.getByRole("button", { name: "radius", exact: true }).waitFor();
    assert.equal(await offered.getByRole("button", { name: "travel_mm", exact: true }).count(), 0);
    const box = page.getByLabel("Formula", { exact: true });
    await box.fill("k * radius^");
    await page.locator(".formula-fault mark").waitFor();
    await box.fill("k * ");
    await page.locator(".formula-fault").waitFor();
    await box.press("End");
    await offered.getByRole("button", { name: "radius", exact: true }).click();
    await box.press("End");
    await box.pressSequentially("^2");
    await page.locator(".formula-fault").waitFor({ state: "detached" });
    const row = page.locator(".formula-parameter");
    await row.waitFor();
    assert.equal(await row.count(), 1);
    assert.equal(await row.getByLabel("unit").inputValue(), "grey");
    await page.getByLabel("Name", { exact: true }).fill("glare");
    for (const [label, value] of [["value", "30"], ["from", "-60"], ["to", "60"]]) await row.getByLabel(label, { exact: true }).fill(value);
    await shot(page, "formula-photographs");
    assert.deepEqual(await violations(page), []);
    await page.getByRole("button", { name: "Add the formula" }).click();
    await ready(page, 2);
    const [given, better] = await errors(page);
    assert.ok(better < 0.5 * given, `${given} -> ${better}`);
    assert.match(await page.locator(".live h2").innerText(), /photos \u00b7/);
    await timeOfSlider(page, "glare", 0, 2);
    await ready(page, 3);
    assert.ok(Math.abs((await errors(page))[2] - given) < 0.1 * given, `${await errors(page)}`); // without its size nothing is left of it
    await shot(page, "photographs");
    said.length = 0; // chromium itself tells of the answer 400 to an expression with an error
  });
});

test("--open shows no token to other users", async () => {
  const tools = join(folder, "bin");
  mkdirSync(tools);
  writeFileSync(join(tools, "xdg-open"), `#!/bin/sh\nprintf '%s' "$1" > ${folder}/asked.part && mv ${folder}/asked.part ${folder}/asked\n`, { mode: 0o755 });
  const came = new Promise((done) => { const watcher = watch(folder, (kind, name) => { if (name === "asked") { watcher.close(); done(); } }); });
  const { child, line } = await started("touchstone", ["workbench", "--renderer", "cpu", "--open"], folder, { ...process.env, PATH: `${tools}:${process.env.PATH}` });
  try {
    await came;
    const file = readFileSync(join(folder, "asked"), "utf8");
    assert.ok(!file.includes(line.split("token=")[1]));
    assert.equal(statSync(file).mode & 0o777, 0o600);
    const page = await browser.newPage();
    await page.goto(`file://${file}`);
    await page.getByRole("button", { name: "Open the example" }).waitFor();
    await page.close();
    child.kill("SIGTERM");
    await ended(child);
    assert.ok(!existsSync(file));
  } finally { child.kill("SIGKILL"); }
});
