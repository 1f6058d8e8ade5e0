// The page in Debian's chromium: what a person does, and what they see. Screenshots in $TOUCHSTONE_SHOTS, if set.
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import assert from "node:assert/strict";
import { join } from "node:path";
import { executable, hasChromium, launch } from "./chromium.mjs";
import { pageOf, sample } from "./pages.mjs";

const shots = process.env.TOUCHSTONE_SHOTS;
const axe = readFileSync(new URL("../node_modules/axe-core/axe.min.js", import.meta.url), "utf8");
const touches = sample("touches");
const photographs = sample("photographs");
const plan = sample("plan");
const sessions = sample("sessions");
const joint = sample("joint");
let browser;

before(async () => {
  assert.ok(hasChromium(), `there is no ${executable}: deploy/setup installs chromium, or name another one in CHROMIUM`);
  browser = await launch();
});
after(() => browser?.close());

// Opens it; at the end nothing may have been said on the console, and nothing fetched.
async function opened(data, act, { width = 1280, height = 800, scheme = "light", hash = "", name = "page" } = {}) {
  const page = await browser.newPage({ viewport: { width, height }, colorScheme: scheme, reducedMotion: "reduce" });
  const said = [];
  const fetched = [];
  page.on("console", (message) => { if (message.type() !== "log" && !/GPU stall|swiftshader/i.test(message.text())) said.push(message.text()); });
  page.on("pageerror", (error) => said.push(error.stack));
  page.on("request", (request) => { if (/^(https?|wss?):/.test(request.url())) fetched.push(request.url()); });
  page.on("dialog", (dialog) => { said.push(`dialog: ${dialog.message()}`); void dialog.dismiss(); });
  try {
    await page.goto(pageOf(data, name) + hash);
    await page.waitForSelector("h1");
    await act(page);
    if (shots) await page.screenshot({ path: join(shots, `${name}.png`), fullPage: true });
    assert.deepEqual(said, []);
    assert.deepEqual(fetched, []);
  } finally {
    await page.close();
  }
}

const shownCount = (page) => page.locator("[data-shown]").getAttribute("data-shown").then(Number);

async function violations(page) {
  await page.evaluate(axe);
  const found = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
  return found.violations.map((one) => `${one.id}: ${one.nodes.map((node) => node.html.slice(0, 140)).slice(0, 3).join(" | ")}`);
}

test("the verdict is the first that is read, with the errors and the floor", async () => {
  await opened(touches, async (page) => {
    assert.equal(await page.locator("[data-verdict]").getAttribute("data-verdict"), touches.report.verdict);
    assert.match(await page.locator("h1").innerText(), /tip_radius/);
    assert.equal(await page.locator("h1").count(), 1);
    assert.equal(await page.locator(".rung").count(), touches.words.ladder.length);
  }, { name: "verdict" });
});

test("a click on a slice filters touches, object and plot, and the address says so", async () => {
  await opened(touches, async (page) => {
    assert.equal(await shownCount(page), touches.report.data[0].count);
    await page.locator("button.slice").first().click();
    await page.waitForFunction(() => location.hash.includes("slice=0"));
    assert.equal(await shownCount(page), touches.report.data[0].where[0].count);
    await page.getByRole("button", { name: /Remove the filter/ }).click();
    assert.equal(await shownCount(page), touches.report.data[0].count);
  }, { name: "slice" });
});

test("the improved model is saved as the report holds it", async () => {
  await opened(touches, async (page) => {
    await page.locator("details.model summary").click();
    const saved = page.waitForEvent("download");
    await page.getByRole("button", { name: "Save the improved model" }).click();
    assert.equal(readFileSync(await (await saved).path(), "utf8"), touches.report.improved_model_yaml);
  }, { name: "saved model" });
});

test("an address brings back what was selected", async () => {
  const touch = touches.report.data[0].worst_touches[0].touch;
  await opened(touches, async (page) => {
    await page.waitForSelector(`[data-touch="${touch}"]`);
    assert.equal(await page.locator(".filters select").first().inputValue(), touches.report.data[0].worst_touches[0].object);
    assert.equal(await page.getByRole("button", { name: "improved", exact: true }).getAttribute("aria-pressed"), "true");
  }, { hash: `#touch=${touch}&object=${touches.report.data[0].worst_touches[0].object}&model=improved`, name: "address" });
});

test("a click on a contact of the object selects its touch in the plot", async () => {
  await opened(touches, async (page) => {
    const canvas = page.locator(".stage canvas");
    await canvas.scrollIntoViewIfNeeded();
    await page.waitForSelector(".overlay");
    const box = await canvas.boundingBox();
    // Wherever the mouse finds a contact, which the page then names.
    let found = false;
    for (let y = 0.3; y < 0.75 && !found; y += 0.03) {
      for (let x = 0.3; x < 0.7 && !found; x += 0.015) {
        await page.mouse.move(box.x + x * box.width, box.y + y * box.height);
        if (await page.locator(".stage .hover").count()) {
          const name = await page.locator(".stage .hover").innerText();
          await page.mouse.down();
          await page.mouse.up();
          const number = name.match(/^touch (\d+)/)[1];
          await page.waitForSelector(`[data-touch="${number}"]`);
          assert.match(await page.evaluate(() => location.hash), new RegExp(`touch=${number}`));
          found = true;
        }
      }
    }
    assert.ok(found, "no contact under the mouse");
  }, { name: "contact" });
});

test("keys go through the touches, the worst first", async () => {
  await opened(touches, async (page) => {
    await page.keyboard.press("]");
    await page.waitForSelector(`[data-touch="${touches.report.data[0].worst_touches[0].touch}"]`);
    await page.keyboard.press("Escape");
    assert.equal(await page.locator("[data-touch]").count(), 0);
  }, { name: "keys" });
});

test("a step of the ladder shows what it is", async () => {
  await opened(touches, async (page) => {
    await page.locator(".rung.step button").first().click();
    assert.equal(await page.locator("#step-0.chosen").count(), 1);
  }, { name: "step" });
});

test("a report pinned as the baseline shows differences first and folds what is equal", async () => {
  const other = structuredClone(touches);
  other.report.data[0].initial.rmse *= 2;
  await opened(touches, async (page) => {
    await page.setInputFiles("input[type=file]", { name: "other.json", mimeType: "application/json", buffer: Buffer.from(JSON.stringify(other.report)) });
    await page.waitForSelector("text=Differences");
    const rows = page.locator("#baseline figure").first().locator("tbody tr");
    assert.equal(await rows.count(), 1);
    assert.match(await rows.first().innerText(), /given model/);
    await page.setInputFiles("input[type=file]", { name: "no.json", mimeType: "application/json", buffer: Buffer.from("{}") });
    await page.waitForSelector("#baseline [role=alert]");
  }, { name: "baseline" });
});

test("photographs stand beside what was rendered and what is left", async () => {
  await opened(photographs, async (page) => {
    const images = page.locator("#photographs img");
    assert.equal(await images.count(), photographs.report.data[0].photographs.maps.length * 5);
    assert.ok(await images.first().evaluate((image) => image.complete && image.naturalWidth > 0));
  }, { name: "photographs" });
});

test("photographs are gone through with keys, and filtered by object, as touches are", async () => {
  const list = [...photographs.report.data[0].photographs.photographs].sort((a, b) => b.rmse - a.rmse);
  const { image, object } = list[0];
  await opened(photographs, async (page) => {
    await page.keyboard.press("]");
    await page.waitForFunction((wanted) => new URLSearchParams(location.hash.slice(1)).get("picture") === wanted, image);
    assert.equal(await page.locator("#photographs tr.chosen button").innerText(), image);
    await page.locator("#detail .groups").getByRole("button", { name: object, exact: true }).click();
    const own = list.filter((one) => one.object === object).length;
    await page.getByText(`${own} of ${list.length} pictures: those of ${object}.`).waitFor();
    assert.equal(await page.locator("#photographs .photos").count(), photographs.report.data[0].photographs.maps.filter((map) => map.object === object).length);
    await page.keyboard.press("Escape");
    await page.waitForFunction(() => !location.hash.includes("="));
    assert.equal(await page.locator("#photographs tr.chosen").count(), 0);
  }, { name: "photographs-keys" });
});

test("names of people are text, wherever they stand", async () => {
  const evil = "</script><img src=x onerror=alert(1)><script>alert(2)</script>\"'";
  const data = structuredClone(touches);
  const put = (value) => {
    for (const key of Object.keys(value)) {
      if (typeof value[key] === "string" && ["name", "object", "effect", "session", "words", "slice", "meaning", "model_name", "summary", "title", "covariate", "headline", "note"].includes(key)) value[key] = evil;
      else if (key === "objects" || key === "fingers" || key === "warnings") { if (Array.isArray(value[key])) value[key] = value[key].map((one) => (typeof one === "string" ? evil : one)); }
      else if (value[key] && typeof value[key] === "object") put(value[key]);
    }
  };
  put(data);
  await opened(data, async (page) => {
    assert.equal(await page.locator("img").count(), 0);
    assert.equal(await page.locator("script").count(), 2);
    assert.match(await page.locator("h1").innerText(), /<img src=x/);
  }, { name: "hostile" });
});

test("data that are cut off, and a report of nothing, are said in words", async () => {
  await opened({}, async (page) => { assert.match(await page.locator("[role=alert]").innerText(), /no report/); }, { name: "broken" });
  const nothing = { report: { ...touches.report, verdict: "VERDICT_UNSPECIFIED", data: [], steps: [], refitted: [], warnings: [], improved_model_yaml: "" },
    words: { ...touches.words, headline: "Nothing could be compared.", ladder: [], commands: [], of_data: [], main: undefined } };
  await opened(nothing, async (page) => { assert.match(await page.locator("h1").innerText(), /Nothing/); }, { name: "nothing" });
});

test("a phone shows all of it without scrolling sideways", async () => {
  for (const [data, name] of [[touches, "phone"], [photographs, "phone-photographs"], [joint, "phone-joint"], [sessions, "phone-sessions"]])
    await opened(data, async (page) => {
      assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= 390);
    }, { width: 390, height: 844, name });
});

test("the page of a plan says what it finds, with a bar for every value and no error", async () => {
  await opened(plan, async (page) => {
    assert.equal(await page.locator(".pill").innerText(), "plan");
    assert.match(await page.locator("h1").innerText(), /this plan finds \d+ at the size/);
    assert.equal(await page.locator("#power .sizes").count(), plan.report.detectable.length);
    assert.match(await page.locator("#power").innerText(), /never: acts as clock_skew/);
    assert.equal(await page.locator("#ladder, #where, #touches").count(), 0);
    assert.match(await page.locator("#data").innerText(), /5\.00\sms, as it was given/);
    assert.deepEqual(await violations(page), []);
  }, { name: "plan" });
});

test("the page of several sessions names what changed, and charts every value with its limits", async () => {
  await opened(sessions, async (page) => {
    assert.match(await page.locator("h1").innerText(), /lacks tip_radius; with it in 2026-11-05\.csv the error falls/);
    const part = page.locator("#sessions");
    assert.match(await part.innerText(), /Changed: tip_radius radius_mm from .* in 2026-11-01\.csv to .* in 2026-11-04\.csv/);
    assert.equal(await part.locator(".control .plot-body svg").count(), 1);
    assert.equal(await part.locator(".control svg .named").count(), 5);
    assert.match(await part.locator(".control figcaption").innerText(), /Outside: 2026-11-04\.csv/);
    // A session that is chosen is the one whose touches are shown, and the address holds it.
    await part.getByRole("button", { name: "2026-11-04.csv" }).click();
    assert.match(page.url(), /session=3/);
    assert.equal(await part.getByRole("button", { name: "2026-11-04.csv" }).getAttribute("aria-pressed"), "true");
    assert.deepEqual(await violations(page), []);
  }, { name: "sessions" });
});

test("a control chart has axes with units, names its limits, and can be read in light, dark and on a phone", async () => {
  for (const [scheme, width] of [["light", 1280], ["dark", 1280], ["light", 400], ["dark", 400]])
    await opened(sessions, async (page) => {
      const chart = page.locator("#sessions .control svg[role=img]").first();
      const texts = await chart.locator("text").allTextContents();
      for (const wanted of ["session", "value (mm)", "upper limit", "lower limit", "2026-11-05"]) assert.ok(texts.includes(wanted), `${wanted} of ${texts}`);
      assert.ok(texts.filter((text) => /^[\u2212\d.]+$/.test(text)).length >= 3, `the axis of values has a scale: ${texts}`);
      // No label lies over another, and none beyond the picture.
      const faults = await chart.evaluate((svg) => {
        const within = svg.getBoundingClientRect();
        const boxes = [...svg.querySelectorAll("text")].map((text) => [text.textContent, text.getBoundingClientRect()]);
        const over = boxes.flatMap(([a, p], i) => boxes.slice(i + 1).filter(([, q]) => p.left < q.right - 1 && q.left < p.right - 1 && p.top < q.bottom - 3 && q.top < p.bottom - 3).map(([b]) => `${a} over ${b}`));
        return [...over, ...boxes.filter(([, box]) => box.left < within.left - 1 || box.right > within.right + 1).map(([a]) => `${a} is cut`)];
      });
      assert.deepEqual(faults, []);
      assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= width);
      assert.deepEqual(await violations(page), []);
    }, { scheme, width, name: `control-${scheme}-${width}` });
});

test("a joint report tells of touches and pictures, each in its unit", async () => {
  for (const width of [1280, 400])
    await opened(joint, async (page) => {
      const figures = await page.locator(".figures").innerText();
      for (const wanted of [/11\.1\sms/, /6\.03\sgrey/, /2\.95\sms/, /1\.43\sgrey/, /2\.76\sms/]) assert.match(figures, wanted);
      const rungs = await page.locator("#ladder .joint-rung.step, #ladder .joint-rung.given, #ladder .joint-rung.floor").allInnerTexts();
      assert.equal(rungs.length, 3);
      for (const rung of rungs) { assert.match(rung, /\d\sms/); assert.match(rung, /\d\sgrey/); }
      assert.match(await page.locator(".facts").innerText(), /Noise floor of the touches 2\.76\sms.* Noise floor of the pictures 1\.43\sgrey/);
      assert.match(await page.locator("#why .lead").innerText(), /touches and pictures that the fit did not see/);
      assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= width);
      assert.deepEqual(await violations(page), []);
    }, { width, name: `joint-${width}` });
});

test("effects stand by falling probability, whatever kind of data they explain, a row for every value", async () => {
  await opened(joint, async (page) => {
    const rows = await page.locator("#why tbody tr").evaluateAll((all) => all.map((row) => [row.cells[1].innerText, [...row.querySelectorAll(".values > div")].map((one) => one.innerText)]));
    const shown = rows.map(([p]) => Number(p.replace(/[<>\s]/g, "")));
    assert.deepEqual(shown, [...shown].sort((a, b) => b - a));
    assert.ok(new Set(joint.report.data.map((data) => data.candidates.find((one) => one.rmse > 0)?.effect)).size > 1, "both kinds have candidates");
    for (const [, values] of rows) for (const value of values) assert.match(value, /^\w+( \w+)*\s+[\u2212\d]|^\d+ more$/);
  }, { name: "why-joint" });
});

test("what would decide names what it tells from what", async () => {
  await opened(photographs, async (page) => {
    const terms = page.locator("#step-0 dt");
    assert.ok((await terms.allInnerTexts()).includes("To tell exposure from the albedo of all objects"));
  }, { name: "to-tell" });
});

test("a printed page is light, as wide as paper, and loses no view", async () => {
  for (const [data, name, views] of [[touches, "touches", ["ladder", "todo", "where", "touches", "why", "power", "detail", "histograms", "data"]], [photographs, "photographs", ["ladder", "photographs", "why", "detail"]], [sessions, "sessions", ["sessions", "touches", "histograms"]]])
    await opened(data, async (page) => {
      if (name === "touches") await page.waitForSelector(".overlay");
      await page.emulateMedia({ media: "print", colorScheme: "dark" });
      // The browser takes its picture as soon as this event has been heard.
      const printed = await page.evaluate(() => {
        dispatchEvent(new Event("beforeprint"));
        const main = document.querySelector("main").getBoundingClientRect();
        const wide = [...document.querySelectorAll("main svg, main img, main table, main canvas")].filter((one) => {
          const box = one.getBoundingClientRect();
          const within = (one.closest("figure.plot, figure.control, figure.table") ?? one.parentElement).getBoundingClientRect();
          return box.width > 0 && (box.left < main.left - 1 || box.right > main.right + 1 || box.right > within.right + 1);
        });
        const paper = document.querySelector("canvas.paper");
        const pixels = paper ? paper.getContext("2d").getImageData(0, 0, paper.width, paper.height).data : [];
        let drawn = 0, light = 0;
        for (let i = 0; i < pixels.length; i += 4) if (pixels[i + 3]) { ++drawn; light += pixels[i] + pixels[i + 1] + pixels[i + 2] > 384 ? 1 : 0; }
        return {
          background: getComputedStyle(document.body).backgroundColor, width: main.width, folded: document.querySelectorAll("main details:not([open])").length,
          views: [...document.querySelectorAll("main section")].filter((one) => one.getBoundingClientRect().height > 40).map((one) => one.id),
          wide: wide.map((one) => one.outerHTML.slice(0, 160)), drawn: paper ? drawn / (pixels.length / 4) : 1, light: paper ? light / drawn : 1,
        };
      });
      assert.equal(printed.background, "rgb(255, 255, 255)");
      assert.ok(printed.width <= 696, `${printed.width} px`);
      assert.equal(printed.folded, 0);
      assert.deepEqual(views.filter((view) => !printed.views.includes(view)), []);
      assert.deepEqual(printed.wide, []);
      assert.ok(printed.drawn > 0.05 && printed.light > 0.6, `${printed.drawn} of the object is drawn, ${printed.light} of that light`);
      await page.evaluate(() => dispatchEvent(new Event("afterprint")));
      await page.emulateMedia({ media: "screen", colorScheme: "dark" });
      await page.waitForFunction(() => getComputedStyle(document.body).backgroundColor !== "rgb(255, 255, 255)" && document.querySelectorAll("main details:not([open])").length > 0);
      if (shots) await page.pdf({ path: join(shots, `${name}.pdf`), printBackground: true });
    }, { scheme: "dark", name: `print-${name}` });
});

test("axe finds nothing, in light and in dark", async () => {
  for (const scheme of ["light", "dark"])
    for (const [data, name] of [[touches, "touches"], [photographs, "photographs"]])
      await opened(data, async (page) => { assert.deepEqual(await violations(page), []); }, { scheme, name: `${name}-${scheme}`, hash: data === touches ? "#touch=5" : "" });
});
