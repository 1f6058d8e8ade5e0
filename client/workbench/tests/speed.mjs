// How fast the page is with 100,000 touches on one object, at 1280 x 800 on WebGL in software: loading, turning the object.
import { launch } from "./chromium.mjs";
import { pageOf, sample } from "./pages.mjs";

const touches = Number(process.argv[2] ?? 100000);
const data = sample("touches");
const one = data.report.data[0];
const table = one.touch_table;
const fingers = one.fingers.length;
const from = table.touch.length;
// The touches of the sample again and again, a little apart.
const repeat = (list, width) => Array.from({ length: touches * width }, (_, i) => list[((Math.floor(i / width) % from) * width) + (i % width)]);
const near = (list, width) => repeat(list, width).map((value) => (value === "NaN" ? value : Number((value * (1 + 0.08 * (Math.random() - 0.5))).toPrecision(5))));
Object.assign(table, {
  touches_in_all: touches, touch: Array.from({ length: touches }, (_, i) => String(i)), object: Array(touches).fill(0), target_mm: near(table.target_mm, 3), approach: repeat(table.approach, 3), lateral: repeat(table.lateral, 3),
  standoff_mm: repeat(table.standoff_mm, 1), contact_mm: near(table.contact_mm, 3 * fingers), simulated: near(table.simulated, fingers), residual: near(table.residual, fingers), after: near(table.after, fingers),
  covariates: table.covariates.map((column) => ({ ...column, values: repeat(column.values, column.values.length / from) })),
  slices: table.slices.map(() => ({ cells: Array.from({ length: touches }, (_, i) => 3 * i) })),
});
const browser = await launch();
const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
page.on("pageerror", (error) => console.error(error.stack));
const address = pageOf(data, "speed");
const began = Date.now();
await page.goto(address);
await page.waitForSelector(".overlay");
console.log(`${touches} touches, ${touches * fingers} contacts: loaded and drawn in ${((Date.now() - began) / 1000).toFixed(2)} s`);
const canvas = page.locator(".stage canvas");
await canvas.scrollIntoViewIfNeeded();
// Processor time, which a busy machine does not change: of the process that draws, and of the page's own.
const session = await browser.newBrowserCDPSession();
const used = async (type) => (await session.send("SystemInfo.getProcessInfo")).processInfo.filter((one) => one.type === type).reduce((sum, one) => sum + one.cpuTime, 0);
const [gpu, own] = [await used("GPU"), await used("renderer")];
const rate = await canvas.evaluate(async (element) => {
  const box = element.getBoundingClientRect();
  const send = (type, x) => element.dispatchEvent(new PointerEvent(type, { clientX: box.left + x, clientY: box.top + 150, pointerId: 1, bubbles: true }));
  element.setPointerCapture = () => {};
  const frame = () => new Promise(requestAnimationFrame);
  send("pointerdown", 100);
  for (let i = 0; i < 5; ++i) { send("pointermove", 100 + i); await frame(); }
  const start = performance.now();
  const frames = 60;
  for (let i = 0; i < frames; ++i) { send("pointermove", 105 + 2 * i); await frame(); }
  // The last picture is drawn when its pixels can be read.
  element.getContext("webgl2").readPixels(0, 0, 1, 1, 6408, 5121, new Uint8Array(4));
  return (1000 * frames) / (performance.now() - start);
});
console.log(`turning: ${rate.toFixed(1)} frames a second; processor time a frame: ${((1000 * ((await used("GPU")) - gpu)) / 65).toFixed(1)} ms to draw, ${((1000 * ((await used("renderer")) - own)) / 65).toFixed(1)} ms in the page`);
const clicked = await page.evaluate(async () => {
  const start = performance.now();
  document.querySelector("button.slice").click();
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  return performance.now() - start;
});
console.log(`a click on a slice is shown after ${clicked.toFixed(0)} ms`);
await browser.close();
