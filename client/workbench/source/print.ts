// A printed page: light, as wide as paper, nothing folded. The browser takes its picture as soon as `beforeprint` has been heard, so
// that everything is drawn anew within it.
import { options } from "preact";
import { theme } from "./state";

interface Printed { measure?(): void; draw?(): void; after?(): void }
const all = new Set<Printed>();

// `measure` is called once the page is as wide as paper, `draw` when all have been drawn at that width, `after` when it is printed.
// Returns what ends it.
export function onPrint(one: Printed): () => void {
  all.add(one);
  return () => { all.delete(one); };
}

export function followPrint(): void {
  const scheduling = options as typeof options & { requestAnimationFrame?: (flush: () => void) => void };
  const waiting: (() => void)[] = [];
  const queue = (act: () => void) => { waiting.push(act); };
  const settle = () => { for (let left = 1000; waiting.length && left; --left) waiting.shift()!(); };
  let restore: (() => void) | null = null;
  addEventListener("beforeprint", () => {
    if (restore) return;
    const { debounceRendering, requestAnimationFrame } = scheduling;
    const style = document.documentElement.style;
    const [chosen, scheme] = [theme.value, style.colorScheme];
    const folded = [...document.querySelectorAll<HTMLDetailsElement>("main details:not([open])")];
    restore = () => {
      document.documentElement.classList.remove("printing");
      for (const one of folded) one.open = false;
      style.colorScheme = scheme;
      theme.value = chosen;
      for (const one of all) one.after?.();
    };
    scheduling.debounceRendering = queue;
    scheduling.requestAnimationFrame = queue;
    document.documentElement.classList.add("printing");
    for (const one of folded) one.open = true;
    style.colorScheme = "light";
    theme.value = "light";
    settle();
    for (const one of all) one.measure?.();
    settle();
    for (const one of all) one.draw?.();
    scheduling.debounceRendering = debounceRendering;
    scheduling.requestAnimationFrame = requestAnimationFrame;
  });
  addEventListener("afterprint", () => { restore?.(); restore = null; });
}
