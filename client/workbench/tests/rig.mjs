// The view Touch in Debian's chromium, with the emulated rig behind a real gateway.
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { after, before, test } from "node:test";
import assert from "node:assert/strict";
import { dirname, join } from "node:path";
import { launch } from "./chromium.mjs";
import { ended, fits, program, ready, served, shot, started, violations } from "./workbench.mjs";

let browser;
let folder;
let emulator;
let gateway;
before(async () => {
  folder = mkdtempSync(join(tmpdir(), "touchstone-rig-"));
  browser = await launch();
  emulator = await started("touchstone-rig-emulator", ["--dir", join(folder, "rig"), "--speedup", "20", "--finger-give-mm", "1000", "--no-camera", "--seed", "7", "--sigma-us", "2000", "--hide", "tip_radius.radius_mm=2"], folder);
  gateway = await started("touchstone-gateway", ["--config", emulator.line.split(" ").pop(), "--listen", "127.0.0.1:0"], folder);
});
after(async () => {
  await browser?.close();
  for (const one of [gateway, emulator]) { one?.child.kill("SIGTERM"); if (one) await ended(one.child); }
  rmSync(folder, { recursive: true });
});
const address = () => gateway.line.split(" ").pop();
const button = (page, name) => page.getByRole("button", { name, exact: true });
const pill = (page) => page.locator(".rig-bar .pill").innerText();

// As a person does: opens the panel, says that nobody is near, and moves the arm.
async function agree(page, name) {
  await button(page, name).click();
  assert.ok(await button(page, "Move the arm").isDisabled());
  await page.getByLabel("I see the rig, and nobody is within its reach.").check();
  await button(page, "Move the arm").click();
}
async function plan(page, session, samples, rounds, csv) {
  await page.getByLabel("Session").fill(session);
  if (csv) await page.locator('input[type="file"][accept*="csv"]').setInputFiles({ name: "plan.csv", mimeType: "text/csv", buffer: Buffer.from(csv) });
  else {
    await page.locator("fieldset").getByLabel("lat20", { exact: true }).check();
    await page.getByLabel("Touches per face").fill(String(samples));
    await page.getByLabel("Rounds").fill(String(rounds));
  }
  await button(page, "Dry run").click();
  await page.getByRole("heading", { name: /Dry run of/ }).waitFor();
}
const idle = (page) => page.waitForFunction(() => document.querySelector(".rig-bar .pill")?.textContent === "standing still" && !document.querySelector(".rig-job"));
const touches = (page, count) => page.waitForFunction((least) => {
  const shown = [...document.querySelectorAll("#touch p[role=status]")].map((one) => /^(\d+) touch/.exec(one.textContent)?.[1]).find(Boolean);
  return Number(shown) >= least;
}, count);

test("a plan, its dry run, a run, and what it measured, compared", async () => {
  await served(browser, folder, ["--rig", address()], { colorScheme: "light" }, async (page) => {
    await button(page, "Take control").waitFor();
    await shot(page, "touch-free");
    assert.deepEqual(await violations(page), []);
    assert.ok(await button(page, "Stop").isVisible());
    await button(page, "Take control").click();
    await page.getByText("You control the rig.", { exact: true }).waitFor();
    await plan(page, "first", 2, 1);
    assert.match(await page.locator("#touch").innerText(), /Nothing was moved\./);
    // What would be touched, and in which order, is seen before anything moves.
    const drawn = page.locator(".planned");
    await drawn.locator(".overlay text", { hasText: "mm" }).waitFor();
    const planned = Number(/(\d+) planned/.exec(await drawn.innerText())[1]);
    assert.match(await drawn.locator("output").innerText(), new RegExp(`^${planned} of ${planned}: touch \\d+$`));
    assert.match(await drawn.innerText(), /Each dot is where one finger would meet the object/);
    await drawn.locator("input[type=range]").fill("0");
    assert.match(await drawn.locator("output").innerText(), new RegExp(`^1 of ${planned}: touch \\d+$`));
    await drawn.scrollIntoViewIfNeeded();
    await shot(page, "touch-planned");
    await shot(page, "touch-dry-run");
    assert.deepEqual(await violations(page), []);
    await agree(page, "Start \u2026");
    await touches(page, 2);
    await shot(page, "touch-running");
    await idle(page);
    const possible = Number(/(\d+) of \d+ touches possible/.exec(await page.locator("#touch").innerText())[1]);
    assert.ok(possible >= 4);
    await touches(page, possible);
    await button(page, "Compare with the model").click();
    await ready(page, 1);
    await shot(page, "touch-compared");
    assert.deepEqual(await violations(page), []);
    await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
    assert.ok(await button(page, "Stop").isVisible());
    const saved = page.waitForEvent("download");
    await button(page, "Save as CSV").click();
    assert.match(readFileSync(await (await saved).path(), "utf8"), /cov_emulated/);
    await button(page, "Release control").click();
    await page.getByText("Nobody controls the rig.").first().waitFor();
  });
});

test("Stop of a spectator is answered within 200 ms with ten pages open, while every connection of the browser is taken", async () => {
  await served(browser, folder, ["--rig", address()], {}, async (page, server, said, url) => {
    await button(page, "Take control").click();
    await page.getByText("You control the rig.", { exact: true }).waitFor();
    await plan(page, "stopped", 8, 4);
    const others = [];
    for (let i = 0; i < 9; ++i) {
      const other = await page.context().newPage();
      await other.goto(url);
      await other.locator(".rig-who").filter({ hasText: "page 1 controls the rig; you look on." }).waitFor();
      others.push(other);
    }
    const last = others[8];
    assert.equal(await last.getByRole("button", { name: /^Start/ }).count(), 0);
    await agree(page, "Start \u2026");
    await touches(last, 1);
    // Control does not change hands while the arm is at work.
    await button(last, "Ask for control").click();
    assert.ok(await button(last, "Take control").isDisabled());
    await page.getByText("page 10 asks for control.").waitFor();
    // Every page holds a connection with a call that does not end.
    for (const other of others) await other.evaluate(() => { for (let i = 0; i < 4; ++i) void fetch("/local/watch", { headers: { "x-touchstone-token": sessionStorage.getItem("token") } }).catch(() => undefined); });
    await button(last, "Stop").click();
    await last.locator(".rig-pressed").filter({ hasNotText: "Stopping" }).waitFor();
    const answer = await last.locator(".rig-pressed").innerText();
    assert.match(answer, /Stopped; nothing moves\./);
    const ms = Number(/after (\d+) ms/.exec(answer)[1]);
    console.log(`Stop is answered after ${ms} ms with ten pages open and all connections taken`);
    assert.ok(ms <= 200, `${ms} ms`);
    await shot(last, "touch-stopped");
    for (const other of others) await other.close();
    await page.waitForFunction(() => document.querySelector(".rig-bar .pill")?.textContent === "stopped" && !document.querySelector(".rig-job"));
    assert.ok(await page.getByRole("button", { name: /^Start/ }).isDisabled());
    // It holds until a person says why the rig may move again; and then nothing moves by itself.
    assert.ok(await button(page, "Release the stop").isDisabled());
    await page.getByLabel("Why may the rig move again?").fill("tried on purpose");
    await button(page, "Release the stop").click();
    await idle(page);
    await page.waitForFunction(() => !document.querySelector("#touch .warnings"));
    await page.getByRole("button", { name: /^Start/ }).waitFor();
    assert.equal(await pill(page), "standing still");
    said.length = 0; // calls that were cut
  });
});

test("control is asked for, handed over, and stays with a page that is loaded again", async () => {
  await served(browser, folder, ["--rig", address()], { viewport: { width: 390, height: 844 }, colorScheme: "dark" }, async (page, server, said, url) => {
    await button(page, "Take control").click();
    await page.getByText("You control the rig.", { exact: true }).waitFor();
    const other = await page.context().newPage();
    await other.goto(url);
    await button(other, "Ask for control").click();
    await button(page, "Hand over to page 2").click();
    await other.getByText("You control the rig.", { exact: true }).waitFor();
    await page.getByText("page 2 controls the rig; you look on.").waitFor();
    await shot(page, "touch-narrow");
    assert.ok(await fits(page));
    assert.deepEqual(await violations(page), []);
    await other.reload();
    await other.getByText("You control the rig.", { exact: true }).waitFor();
    await other.close();
  });
});

test("control of a page that is closed, or killed, is given back, but never while the arm is at work", async () => {
  await served(browser, folder, ["--rig", address()], {}, async (page, server, said, url) => {
    const controlling = async () => {
      const other = await page.context().newPage();
      await other.goto(url);
      await button(other, "Take control").click();
      await other.getByText("You control the rig.", { exact: true }).waitFor();
      return other;
    };
    const closed = await controlling();
    await page.getByText("page 2 controls the rig; you look on.").waitFor();
    await page.getByText("Also here: page 2.").waitFor();
    let began = performance.now();
    await closed.close();
    await page.getByText("page 2, which controlled the rig, went; its lease was given back").waitFor();
    console.log(`control of a page that was closed is free after ${((performance.now() - began) / 1000).toFixed(1)} s`);
    await button(page, "Take control").waitFor();
    assert.equal(await page.locator(".rig-pages").count(), 0);

    // Killed while it rests.
    const killed = await controlling();
    await killed.goto("chrome://crash").catch(() => undefined);
    began = performance.now();
    await page.getByText("page 3, which controlled the rig, went; its lease was given back").waitFor();
    console.log(`control of a page that was killed is free after ${((performance.now() - began) / 1000).toFixed(1)} s`);

    // Closed in the middle of a run: it ends first.
    const left = await controlling();
    await plan(left, "left", 6, 1);
    await agree(left, "Start \u2026");
    await touches(page, 1);
    await left.close();
    await page.locator("#touch").getByText(/page 4 controls the rig, but is gone: its lease is given back once this has ended/).waitFor();
    await shot(page, "touch-gone");
    await page.getByText("page 4, which controlled the rig, went; its lease was given back").waitFor();
    const possible = Number(/(\d+) of \d+ touches possible/.exec(await page.locator("#touch").innerText())[1]);
    await touches(page, possible);
    await button(page, "Take control").waitFor();
    assert.deepEqual(await violations(page), []);
  });
});

test("the lease of another program is taken on purpose alone, and its page says who took it", async () => {
  await served(browser, folder, ["--rig", address()], {}, async (page) => {
    await button(page, "Take control").click();
    await page.getByText("You control the rig.", { exact: true }).waitFor();
    await served(browser, folder, ["--rig", address()], {}, async (other) => {
      await other.getByText(/ holds the rig.s lease\./).waitFor();
      assert.equal(await button(other, "Take control").count(), 0);
      await button(other, "Take the lease from them").click();
      await other.getByText("You control the rig.", { exact: true }).waitFor();
      await page.getByText(/ took the lease/).waitFor();
      await page.getByText(/ holds the rig.s lease\./).waitFor();
    });
  });
});

test("where a person changes the object the page asks, and the arm waits until somebody has agreed", async () => {
  const own = mkdtempSync(join(tmpdir(), "touchstone-hands-"));
  const rig = await started("touchstone-rig-emulator", ["--dir", join(own, "rig"), "--speedup", "20", "--finger-give-mm", "1000", "--no-camera", "--seed", "8"], own);
  const config = rig.line.split(" ").pop();
  writeFileSync(config, readFileSync(config, "utf8").replace(/^mount_command.*$/m, ""));
  const control = JSON.parse(readFileSync(join(own, "rig", "emulator.json"), "utf8")).control.port;
  const hands = await started("touchstone-gateway", ["--config", config, "--listen", "127.0.0.1:0"], own);
  try {
    await served(browser, own, ["--rig", hands.line.split(" ").pop()], { colorScheme: "dark" }, async (page, server, said, url) => {
      await button(page, "Take control").click();
      await page.getByText("You control the rig.", { exact: true }).waitFor();
      await plan(page, "hands", 1, 1);
      await agree(page, "Start \u2026");
      const asked = page.locator("#touch .warnings p");
      await asked.filter({ hasText: "Put lat20 on the fixture" }).waitFor();
      assert.equal(await page.locator("#touch h3", { hasText: "Measured" }).count(), 0);
      await shot(page, "touch-asked");
      assert.deepEqual(await violations(page), []);
      const face = /face ([+-][xyz])/.exec(await asked.innerText())[1];
      const told = spawnSync(join(dirname(program), "touchstone-rig-emulator"), ["tell", `127.0.0.1:${control}`, "mount", "lat20", face]);
      assert.equal(told.status, 0, String(told.stderr));
      await agree(page, "It lies there \u2026");
      await touches(page, 1);
      // The next face: Stop while the page asks ends the run.
      await asked.filter({ hasText: "Turn lat20" }).waitFor();
      await button(page, "Stop").click();
      await asked.filter({ hasText: "Stopped" }).waitFor();
      await page.waitForFunction(() => !document.querySelector(".rig-job"));
      // Asked again, and the page that controls is closed: nobody can answer, so that the run ends and the lease goes back.
      await page.getByLabel("Why may the rig move again?").fill("tried on purpose");
      await button(page, "Release the stop").click();
      await idle(page);
      const other = await page.context().newPage();
      await other.goto(url);
      await other.getByText("page 1 controls the rig; you look on.").waitFor();
      await agree(page, "Start again \u2026");
      await asked.filter({ hasText: "Turn lat20" }).waitFor();
      await page.close();
      await other.getByText(/page 1, which controlled the rig, went while the rig waited for a person to do this: Turn lat20/).waitFor();
      await button(other, "Take control").waitFor();
    });
  } finally {
    for (const one of [hands, rig]) { one.child.kill("SIGTERM"); await ended(one.child); }
    rmSync(own, { recursive: true });
  }
});

test("a page without a workbench says so, and the rig without one stops", async () => {
  await served(browser, folder, ["--rig", address()], {}, async (page, server, said, url) => {
    await button(page, "Take control").click();
    await page.getByText("You control the rig.", { exact: true }).waitFor();
    await plan(page, "killed", 8, 4);
    await agree(page, "Start \u2026");
    await touches(page, 1);
    server.kill("SIGKILL");
    await page.getByText("No news from touchstone workbench").waitFor();
    await button(page, "Stop").click();
    await page.getByText("PRESS THE EMERGENCY STOP").waitFor();
    await shot(page, "touch-killed");
    said.length = 0;
  });
  // The lease ran out: the gateway has ended the motion, and another workbench may work the rig.
  await served(browser, folder, ["--rig", address()], {}, async (page) => {
    await button(page, "Take control").click();
    await page.getByText("You control the rig.", { exact: true }).waitFor();
    await plan(page, "killed", 8, 4);
    await page.getByRole("button", { name: /^Start/ }).waitFor();
  });
});
