// Stills for the README: the verdict, the touches of the worst slice, and the verdict of the model that was saved.
//
//   node tests/stills.mjs REPORT.html AFTER.html FOLDER
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { launch } from "./chromium.mjs";

const [report, after, folder] = process.argv.slice(2);
const browser = await launch();

async function still(file, name, prepare = async () => {}) {
  const page = await browser.newPage({
    viewport: { width: 1160, height: 720 }, colorScheme: "light", reducedMotion: "reduce",
  });
  await page.goto(pathToFileURL(resolve(file)).href);
  await page.waitForSelector("h1");
  await prepare(page);
  await page.waitForTimeout(1500); // the object is drawn
  await page.screenshot({ path: join(folder, `${name}.png`) });
  await page.close();
}

await still(report, "lacks");
await still(report, "touches", async (page) => {
  await page.locator("#where button.slice").first().click();
  await page.evaluate(() => document.querySelector("#touches").scrollIntoView());
});
await still(after, "adequate");
await browser.close();
