// Colours of the page as numbers, for canvas and WebGL. Every pair that must be told apart differs in lightness too.
import { theme } from "./state";

export type RGB = [number, number, number]; // 0 to 255

// Residuals: blue is early or darker, orange late or brighter; grey is none. After vik (Crameri 2018).
const light: RGB[] = [[3, 62, 125], [66, 139, 186], [205, 205, 203], [214, 140, 82], [139, 39, 6]];
const dark: RGB[] = [[176, 219, 255], [74, 148, 204], [84, 92, 102], [212, 124, 62], [255, 211, 166]];

export const isDark = () =>
  theme.value === "dark" || (theme.value === "auto" && matchMedia("(prefers-color-scheme: dark)").matches);

// `x` from -1 to 1.
export function diverging(x: number, night = isDark()): RGB {
  const stops = night ? dark : light;
  const at = (Math.min(1, Math.max(-1, x)) + 1) * 2;
  const low = Math.min(3, Math.floor(at));
  const part = at - low;
  return stops[low].map((value, k) => Math.round(value + part * (stops[low + 1][k] - value))) as RGB;
}

export const css = ([r, g, b]: RGB) => `rgb(${r} ${g} ${b})`;

let probe: HTMLElement | null = null;

// What a custom property of the page's style is in the theme of now: "rgb(1, 2, 3)".
export function resolved(name: string): string {
  if (!probe) {
    probe = document.createElement("span");
    probe.hidden = true;
    document.body.append(probe);
  }
  probe.style.color = `var(${name})`;
  return getComputedStyle(probe).color;
}

export function rgbOf(name: string): RGB {
  const parts = resolved(name).match(/[\d.]+/g) ?? ["0", "0", "0"];
  return [Number(parts[0]), Number(parts[1]), Number(parts[2])];
}

export const fingerColour = (finger: number) => `var(--f${finger % 6})`;
