// How soon the error follows a slider of the live page: 50 single moves, then 50 while the slider does not rest, over 960 residuals
// (320 touches of five objects, three fingers each) unless told otherwise. Where the time goes, by the browser's own clock.
//   TOUCHSTONE_BIN=build/release/bin/touchstone npm run slider [-- TOUCHES_PER_OBJECT]
import { spawnSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { launch } from "./chromium.mjs";
import { dragSlider, program, ready, served } from "./workbench.mjs";

const touches = Number(process.argv[2] ?? 64);
const moves = 50;
const folder = mkdtempSync(join(tmpdir(), "touchstone-slider-"));
const touchstone = (...args) => { if (spawnSync(program, args, { cwd: folder, stdio: "inherit" }).status !== 0) throw new Error(args.join(" ")); };
const at = (times, share) => [...times].sort((a, b) => a - b)[Math.min(times.length - 1, Math.floor(share * times.length))];
const words = (times) => `median ${at(times, 0.5).toFixed(0)} ms, of ten the slowest ${at(times, 0.9).toFixed(0)} ms, worst ${Math.max(...times).toFixed(0)} ms`;

// In the page: moves the slider, and waits for the error that follows; what was fetched for it.
const move = ([value]) => new Promise((done) => {
  const slider = document.querySelector(".slider input");
  const last = () => [...document.querySelectorAll(".live-rung")].at(-1).dataset.rmse;
  const before = last();
  performance.clearResourceTimings();
  const began = performance.now();
  const watch = new MutationObserver(() => {
    if (["NaN", before].includes(last())) return;
    watch.disconnect();
    const took = performance.now() - began;
    const parts = () => performance.getEntriesByType("resource").filter((one) => one.startTime >= began).map((one) => [one.name.split("/").pop(), one.startTime - began, one.responseEnd - began]);
    requestAnimationFrame(() => setTimeout(() => {
      const painted = performance.now() - began;
      setTimeout(() => done({ took, painted, parts: parts() }), 300);
    }));
  });
  watch.observe(document.querySelector(".live-main"), { subtree: true, attributes: true, childList: true });
  slider.value = value;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
});

const browser = await launch();
try {
  touchstone("model", "new", "--name", "nominal", "-o", "nominal.yaml");
  touchstone("model", "add", "nominal.yaml", "tip_radius", "radius_mm=2", "-o", "tip.yaml");
  touchstone("model", "add", "tip.yaml", "gaussian_noise", "sigma_us=5000", "-o", "noisy.yaml");
  touchstone("plan", "lat00,lat05,lat10,lat15,lat20", "--plan", "faces", "--count", String(touches), "--quiet", "-o", "plan.csv");
  touchstone("touch", "--plan", "plan.csv", "--model", "noisy.yaml", "--seed", "7", "--quiet", "-o", "set.csv");
  await served(browser, folder, ["set.csv", "--model", "tip.yaml"], {}, async (page) => {
    await ready(page, 1);
    await page.evaluate(() => new Promise((drawn) => requestIdleCallback(drawn)));
    console.log(`${5 * touches} touches, ${15 * touches} residuals`);
    const all = [];
    for (let k = 0; k < moves; ++k) {
      all.push(await page.evaluate(move, [String(0.5 + 0.05 * ((k * 7) % 50) + 0.001)]));
      await ready(page, 2);
    }
    console.log(`a move by itself: ${words(all.map((one) => one.took))}; painted: ${words(all.map((one) => one.painted))}; the first ${all[0].took.toFixed(0)} ms`);
    for (const name of new Set(all.flatMap((one) => one.parts.map(([name]) => name)))) {
      const of = all.flatMap((one) => one.parts.filter(([part]) => part === name));
      console.log(`  ${name}: begins after ${at(of.map((one) => one[1]), 0.5).toFixed(0)} ms, takes ${words(of.map((one) => one[2] - one[1]))}`);
    }
    console.log(`  the first: ${all[0].parts.map(([name, from, to]) => `${name} ${from.toFixed(0)} to ${to.toFixed(0)} ms`).join(", ")}`);
    const waits = await dragSlider(page, "tip_radius", Array.from({ length: moves }, (_, k) => String(0.5 + 0.05 * ((k * 7) % 50))));
    console.log(`while it does not rest a new error: ${words(waits)}`);
  });
} finally {
  await browser.close();
  rmSync(folder, { recursive: true });
}
