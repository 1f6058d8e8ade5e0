// Always in sight where there is a rig: Stop, what the rig does, whose its lease is.
import { useLayoutEffect, useRef } from "preact/hooks";
import { controllerWent, controls, desk, otherPages, pageName, press, silent, stop } from "../data/rig";

export const stateWords: Record<string, string> = {
  idle: "standing still", busy: "at work", draining: "the gateway is ending", stopped: "stopped", protective_stop: "protective stop", safeguard_stop: "safeguard stop",
  recovery: "outside its limits", emergency_stop: "emergency stop", powered_off: "not powered", disconnected: "not connected", fault: "fault",
};
const good = new Set(["idle", "busy"]);

function Pressed() {
  const now = press.value;
  if (!now) return null;
  const text = now.state === "sending" ? "Stopping \u2026"
    : now.state === "stopped" ? `Stopped; nothing moves. Answered after ${now.ms.toFixed(0)} ms.`
    : now.state === "moves" ? `THE STOP WAS SENT, BUT NOT CONFIRMED: ${now.text || "press the emergency stop if anything moves"}`
    : `${now.text}. PRESS THE EMERGENCY STOP if anything moves.`;
  return <p class={`rig-pressed ${now.state === "failed" || now.state === "moves" ? "bad" : ""}`} role="alert">{text}</p>;
}

// What sticks below it needs to know how tall it is.
function useHeight() {
  const bar = useRef<HTMLElement>(null);
  useLayoutEffect(() => {
    const tell = () => document.documentElement.style.setProperty("--rig-bar", `${bar.current!.offsetHeight}px`);
    const observer = new ResizeObserver(tell);
    observer.observe(bar.current!);
    return () => observer.disconnect();
  }, []);
  return bar;
}

export function RigBar() {
  const bar = useHeight();
  const now = desk.value;
  const rig = now?.rig;
  const lost = silent.value || !rig?.answers;
  const state = !now ? "connecting" : silent.value ? "no news" : stateWords[rig?.state ?? ""] ?? rig?.state ?? "";
  const total = now?.checked?.possible ?? 0;
  return (
    <header class="rig-bar" aria-label="Rig" ref={bar}>
      <div class="rig-line">
        <button type="button" class="stop" onClick={() => void stop()} title="Ends every motion now. A software stop, not safety-rated">Stop</button>
        <span class={`pill ${lost ? "wrong" : good.has(rig!.state!) ? "good" : "wrong"}`} role="status">{state}</span>
        {now && <span class="rig-who">
          {controls.value ? "You control the rig." : now.controller ? `${pageName(now.controller)} controls the rig${controllerWent.value ? ", but is gone" : ""}; you look on.` : now.rig.lease_holder ? `${now.rig.lease_holder} holds the lease.` : "Nobody controls the rig."}
        </span>}
        {otherPages.value.length > 0 && <span class="soft rig-pages">Also here: {otherPages.value.map((page) => `page ${page.number}${page.hidden ? " (hidden)" : ""}`).join(", ")}.</span>}
        {now?.job && <span class="rig-job">{now.ask ? "waiting for a person" : now.job}{now.job_moves && total > 0 && now.job === "touching" && <> {"\u00b7"} {now.done} of {total} <progress max={total} value={now.done} aria-label="Touches made" /></>}</span>}
        {rig?.emulated && <span class="soft">emulated rig</span>}
      </div>
      {silent.value && now && <p class="rig-pressed bad" role="alert">No news from touchstone workbench: what is shown may not be so any more. The emergency stop works without it.</p>}
      {!silent.value && now && !rig?.answers && <p class="rig-pressed bad" role="alert">The gateway {now.address} does not answer. {rig?.last_error}</p>}
      <Pressed />
    </header>
  );
}
