// The live workbench, above the report: what is missing, the model as it grows, and the error as it falls.
import { Bar } from "../parts/parts";
import { download } from "../charts/export";
import { effectProbability, error, typeset, withError } from "../format";
import { page } from "../state";
import { type ModelEffect, diagnose, diagnosis, failure, model, openExample, origin, place, rungs, setValue, stale, take, undo, working } from "../data/live";

function Status() {
  const now = working.value;
  const failed = failure.value;
  if (failed) {
    return (
      <div class="warnings live-failed" role="alert">
        <p>{failed.disconnected ? "Disconnected" : "That did not work"}</p>
        {typeset(failed.message)}{/[.!?]$/.test(failed.message) ? "" : "."} {failed.disconnected && "The model is kept here. If touchstone workbench or its server has ended, start it again (workbench with the same --port) and open the address that it prints. "}
        <button type="button" onClick={failed.again}>Try again</button>
      </div>
    );
  }
  return <p class="live-status" role="status">{now ? <>{typeset(now.what)}{now.stage && <> · {typeset(now.stage)}</>} <progress max={1} value={now.done || undefined} aria-label="Progress" /></> : stale.value ? "" : "Up to date."}</p>;
}

function LiveLadder() {
  const kind = page.value?.report.data[page.value.words.main ?? 0]?.kind ?? "TOUCHES";
  const floor = page.value?.words.of_data[page.value.words.main ?? 0]?.floor ?? 0;
  const largest = Math.max(...rungs.value.map((rung) => rung.rmse || 0), floor) || 1;
  const last = rungs.value.length - 1;
  return (
    <ol class="ladder" aria-label="The error after each change">
      {rungs.value.map((rung, i) => (
        <li class={`rung live-rung${i === last && stale.value ? " stale" : ""}`} data-rmse={rung.rmse}>
          <span class="rung-name">{rung.name}</span>
          <span class="rung-bar"><Bar share={(rung.rmse || 0) / largest} tone={i ? "better" : "given"} mark={floor / largest} /></span>
          <span class="rung-error">{Number.isFinite(rung.rmse) ? error(kind, rung.rmse) : "\u2026"}</span>
        </li>
      ))}
    </ol>
  );
}

function Found() {
  const report = diagnosis.value;
  if (!report) return null;
  const has = new Set(model.value!.effects.map((effect) => effect.name));
  const taken = new Set(rungs.value.map((rung) => rung.name));
  return (
    <div class="live-found">
      <h3>What is missing</h3>
      {!report.steps.length && !report.refitted.length && <p>{report.verdict === "ADEQUATE" ? "Nothing: the rest is noise." : "No effect of the catalogue; the report below says what is known."}</p>}
      <ul>
        {report.refitted.map((one) => <li><b>{one.effect}</b> <span class="soft">has other values</span> <button type="button" disabled={taken.has(`change ${one.effect}`)} onClick={() => void take(one.effect, "change")}>Change {one.effect}</button></li>)}
        {report.steps.map((one) => (
          <li>
            <span><b>{one.effect}</b> {one.parameters.slice(0, 2).map((value) => withError(value)).join(", ")} <span class="soft">probability {effectProbability(one.probability)}</span></span>
            <button type="button" disabled={has.has(one.effect)} onClick={() => void take(one.effect, "+")}>{has.has(one.effect) ? `${one.effect} is in the model` : `Add ${one.effect}`}</button>
          </li>
        ))}
      </ul>
    </div>
  );
}

function Sliders({ effect }: { effect: ModelEffect }) {
  if (effect.per_object || !effect.editable) return null;
  return (
    <>
      {effect.parameters.flatMap((one, p) => one.values.map((value, i) => {
        const near = Math.max(4 * Math.abs(one.typical - one.neutral), 1.5 * Math.abs(value - one.neutral));
        const low = Math.max(one.lower, one.neutral - near);
        const high = Math.min(one.upper, one.neutral + near);
        const name = `${effect.name} ${one.name}${one.values.length > 1 ? ` ${i + 1}` : ""}`;
        return (
          <label class="slider" title={one.meaning}>
            <span>{name}</span>
            <input type="range" min={low} max={high} step={(high - low) / 200} value={value} onInput={(event) => setValue(effect, p, i, Number(Number(event.currentTarget.value).toPrecision(4)))} />
            <output>{Number(value.toPrecision(4))} {one.unit}</output>
          </label>
        );
      }))}
    </>
  );
}

export function Live() {
  if (!rungs.value.length) {
    return (
      <section class="live" aria-labelledby="live-title">
        <h1 id="live-title">Touchstone workbench</h1>
        <Status />
        {place.value && !working.value && <>
          <p>No measurements are open. See how it works with 576 simulated touches that hide one effect, or start it with your own:</p>
          <p><code>touchstone workbench set.csv --model nominal.yaml --mesh-dir meshes</code></p>
          <p><button type="button" class="main" onClick={() => void openExample()}>Open the example</button></p>
        </>}
      </section>
    );
  }
  return (
    <section class="live" aria-labelledby="live-title">
      <h2 id="live-title">Workbench <small>{origin.value} · simulated by {place.value?.source ?? ""}</small></h2>
      <div class="row">
        <button type="button" class="main" disabled={!!working.value} onClick={() => void diagnose()}>Find what is missing</button>
        <button type="button" disabled={rungs.value.length < 2} onClick={undo}>Undo</button>
        <button type="button" onClick={() => download(`${model.value!.name || "model"}.yaml`, "text/yaml", model.value!.yaml)}>Save the model</button>
      </div>
      <Status />
      <LiveLadder />
      <Found />
      {model.value!.effects.length > 0 && <div class="live-values"><h3>Values</h3>{model.value!.effects.map((effect) => <Sliders effect={effect} />)}</div>}
      {stale.value && <p class="note stale-note">What follows is of the model before this change.</p>}
    </section>
  );
}
