// The live workbench over touches and photographs in one set: TOUCHSTONE_BIN is the program.
import { spawnSync } from "node:child_process";
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { after, before, test } from "node:test";
import assert from "node:assert/strict";
import { join } from "node:path";
import { launch } from "./chromium.mjs";
import { fits, program, ready, served, shot, violations } from "./workbench.mjs";

let browser;
let folder;
before(async () => {
  folder = mkdtempSync(join(tmpdir(), "touchstone-joint-"));
  browser = await launch();
});
after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true });
});

function touchstone(...args) {
  const { status, stderr } = spawnSync(program, args, { cwd: folder, encoding: "utf8" });
  assert.equal(status, 0, stderr);
}

// 120 touches and 12 photographs of one of the two objects; the objects lie elsewhere, which both kinds show.
function writeSet() {
  const set = join(folder, "both");
  mkdirSync(set);
  touchstone("model", "new", "--name", "rig", "-o", "rig.yaml");
  touchstone("model", "add", "rig.yaml", "gaussian_noise", "sigma_us=3000", "-o", "touches.yaml");
  touchstone("model", "add", "touches.yaml", "image_noise", "sigma_grey=2", "-o", "given.yaml");
  touchstone("model", "add", "given.yaml", "object_pose", "translation_mm=0.9,-0.6,0.5", "-o", "real.yaml");
  touchstone("plan", "lat20", "lat10", "-o", "plan.csv");
  touchstone("touch", "--plan", "plan.csv", "--model", "real.yaml", "--repeats", "6", "-o", join(set, "touches.csv"));
  const degrees = [0, 60, 120, 180, 240, 300];
  const eyes = [150, 300].flatMap((height) => degrees.map((deg) => [400 * Math.cos((deg * Math.PI) / 180), 400 * Math.sin((deg * Math.PI) / 180), height].map((x) => x.toFixed(3))));
  const rows = eyes.map((eye) => ["lat20", ...eye, 0, 0, 0, 0, 0, 1].join(","));
  writeFileSync(join(set, "images.csv"), `image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,up_z\n${rows.map((row, i) => `${i},p-${String(i).padStart(4, "0")}.png,${row}`).join("\n")}\n`);
  const size = 64, focal = size / 2 / Math.tan(Math.PI / 8);
  writeFileSync(join(set, "camera.yaml"), `{width_px: ${size}, height_px: ${size}, fx_px: ${focal}, fy_px: ${focal}, cx_px: ${size / 2}, cy_px: ${size / 2}}\n`);
  touchstone("capture", "lat20", "--plan", join(set, "images.csv"), "--image", `${size}x${size}`, "--model", "real.yaml", "--renderer", "cpu", "-o", join(set, "p.png"));
}

test("a diagnosis of touches and photographs says how far it is, and both errors stand on the ladder", async () => {
  writeSet();
  await served(browser, folder, ["both", "--model", "given.yaml"], { colorScheme: "light" }, async (page) => {
    await ready(page, 1);
    assert.match(await page.locator("h1").innerText(), /off by .*\sms on touches .* and .*\sgrey on pictures/);
    // Every value that the bar has while it works.
    await page.evaluate(() => {
      window.told = [];
      new MutationObserver(() => {
        const bar = document.querySelector(".live-status progress");
        if (bar && bar.position >= 0 && window.told.at(-1) !== bar.value) window.told.push(bar.value);
      }).observe(document.querySelector(".live-main"), { subtree: true, attributes: true, childList: true, characterData: true });
    });
    await page.getByRole("button", { name: "Find what is missing" }).click();
    await page.getByRole("button", { name: "Add object_pose" }).waitFor({ timeout: 120000 });
    const told = await page.evaluate(() => window.told);
    assert.deepEqual(told, [...told].sort((a, b) => a - b), "the share that is done falls");
    assert.ok(told.filter((done) => done > 0.2 && done < 0.8).length >= 3, `it moves while both are searched: ${told}`);
    const found = await page.locator(".live-found .values > div").allInnerTexts();
    assert.match(found[0], /^translation_mm x\s+0\.\d+\s±\s0\.\d+\smm/);
    await page.getByRole("button", { name: "Add object_pose" }).click();
    await ready(page, 2);
    const [given, better] = await page.locator(".live-rung").evaluateAll((rungs) => rungs.map((rung) => [...rung.querySelectorAll(".rung-error")].map((one) => one.textContent)));
    for (const errors of [given, better]) { assert.match(errors[0], /\d\sms$/); assert.match(errors[1], /\d\sgrey$/); }
    assert.ok(parseFloat(better[0]) < 0.8 * parseFloat(given[0]) && parseFloat(better[1]) < 0.8 * parseFloat(given[1]), `${given} -> ${better}`);
    await shot(page, "joint");
    assert.ok(await fits(page));
    assert.deepEqual(await violations(page), []);
  });
});
