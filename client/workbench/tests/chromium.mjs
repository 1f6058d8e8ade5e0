// Debian's chromium, with WebGL in software: the same picture on every machine.
import { existsSync } from "node:fs";
import { chromium } from "playwright-core";

export const executable = process.env.CHROMIUM ?? "/usr/bin/chromium";
export const hasChromium = () => existsSync(executable);

export function launch() {
  return chromium.launch({ executablePath: executable, args: ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"] });
}
