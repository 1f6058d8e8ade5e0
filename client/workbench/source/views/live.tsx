// The live workbench, above the report: what is missing, the model as it grows, and the error as it falls.
import { useRef } from "preact/hooks";
import { Bar, ValueRows } from "../parts/parts";
import { effectProbability, error, plain, readings, share, spaced, typeset, unitSymbol } from "../format";
import { joint, page } from "../state";
import { Formula } from "./formula";
import { type Lost, type ModelEffect, byHand, cancel, diagnose, diagnosis, failure, model, moved, openExample, origin, place, rungs, save, setValue, stale, take, undo, working } from "../data/live";

const help: Record<NonNullable<Lost>, string> = {
  workbench: "If the program has ended, save the model first: this page cannot reach a new one. Then start touchstone workbench again, with --model and the saved file, and open the address that it prints.",
  server: "The page and the model stay. With several servers (--server A,B) the next one goes on by itself; here none answers. Try again when one does.",
};

function Failure() {
  const { message, lost, again } = failure.value!;
  return (
    <div class="warnings live-failed" role="alert">
      <p>{lost ? "Disconnected" : "That did not work"}</p>
      <div>{typeset(message)}{/[.!?]$/.test(message) ? "" : "."} {lost && help[lost]} {stale.value && page.value && "What follows is of the model before this change."}</div>
      <div class="row">
        {lost === "workbench" && model.value && <button type="button" class="main" onClick={save}>Save the model</button>}
        <button type="button" onClick={again}>Try again</button>
      </div>
    </div>
  );
}

function Status() {
  if (failure.value) return <Failure />;
  const now = working.value;
  if (!now) return <p class="live-status" role="status">{rungs.value.length ? "Up to date." : ""}</p>;
  return (
    <p class="live-status" role="status">
      {typeset(now.what)}{now.what !== byHand && <>{now.stage && <> {"\u00b7"} {typeset(now.stage)}</>} <progress max={1} value={now.done || undefined} aria-label="Progress" /></>}
      {now.cancellable && <button type="button" onClick={cancel}>Cancel</button>}
    </p>
  );
}

const change = (given: number, now: number) => (given > 0 && Number.isFinite(now) ? `${now > given ? "+" : "\u2212"}${share(Math.abs(now / given - 1))}` : "");

// Of touches and pictures together: a column for each kind, in its unit and on its own scale.
function JointLadder() {
  const { report, words } = page.value!;
  const kinds = report.data.map((data, k) => {
    const floor = words.of_data[k].floor;
    return { data, floor, given: rungs.value[0].errors[k], largest: Math.max(...rungs.value.map((rung) => rung.errors[k] || 0), floor) || 1 };
  });
  const last = rungs.value.length - 1;
  return (
    <>
      <ol class="ladder" aria-label="The error after each change">
        {rungs.value.map((rung, i) => (
          <li class={`rung joint-rung live-rung${i === last && stale.value ? " stale" : ""}`} data-rmse={rung.rmse}>
            <span class="rung-name">{rung.name || "given model"}</span>
            {kinds.map(({ data, floor, given, largest }, k) => {
              const rmse = rung.errors[k];
              return (
                <span class="joint-cell">
                  <Bar share={(rmse || 0) / largest} tone={i ? "better" : "given"} mark={floor / largest} />
                  <span class="rung-error">{Number.isFinite(rmse) ? error(data.kind, rmse) : "\u2026"}</span>
                  <small class="joint-note">{readings(data)}{i > 0 && change(given, rmse) && `: ${change(given, rmse)}`}</small>
                </span>
              );
            })}
          </li>
        ))}
      </ol>
      <p class="note">Bar: RMSE of the residuals of each kind of data. Dashed: its noise floor, {kinds.map(({ data, floor }) => error(data.kind, floor)).join(" and ")}; no model gets far below it.</p>
    </>
  );
}

function LiveLadder() {
  if (joint.value) return <JointLadder />;
  const shown = page.value;
  const main = shown?.report.data[shown.words.main ?? 0];
  const kind = main?.kind ?? "TOUCHES";
  const floor = shown?.words.of_data[shown.words.main ?? 0]?.floor ?? 0;
  const largest = Math.max(...rungs.value.map((rung) => rung.rmse || 0), floor) || 1;
  const last = rungs.value.length - 1;
  const given = rungs.value[0].rmse;
  return (
    <>
      <ol class="ladder" aria-label="The error after each change">
        {rungs.value.map((rung, i) => (
          <li class={`rung live-rung${i === last && stale.value ? " stale" : ""}`} data-rmse={rung.rmse}>
            <span class="rung-name">{rung.name || "given model"}</span>
            <span class="rung-bar"><Bar share={(rung.rmse || 0) / largest} tone={i ? "better" : "given"} mark={floor / largest} /></span>
            <span class="rung-error">{Number.isFinite(rung.rmse) ? error(kind, rung.rmse) : "\u2026"}</span>
            <span class="rung-change">{i > 0 && change(given, rung.rmse)}</span>
          </li>
        ))}
      </ol>
      <p class="note">Bar: RMSE of the residuals{floor > 0 && `. Dashed: the noise floor, ${error(kind, floor)}; no model gets far below it`}.</p>
    </>
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
        {report.refitted.map((one) => (
          <li>
            <span><b>{one.effect}</b> has other values<ValueRows values={one.parameters} /></span>
            <Take there={taken.has(`change ${one.effect}`)} effect={one.effect} sign="change" verb="Change" />
          </li>
        ))}
        {report.steps.map((one) => (
          <li>
            <span>
              <b>{one.effect}</b> <span class="soft">probability {effectProbability(one.probability)}</span><ValueRows values={one.parameters} />
              {one.meaning && <span class="live-meaning">{typeset(one.meaning)}</span>}
              {one.equivalent.length > 0 && <span class="live-meaning">These data cannot tell it from {one.equivalent.join(", ")}. {typeset(one.discriminating_measurement)}</span>}
            </span>
            <Take there={has.has(one.effect)} effect={one.effect} sign="+" verb="Add" />
          </li>
        ))}
      </ul>
    </div>
  );
}

function Take({ there, effect, sign, verb }: { there: boolean; effect: string; sign: string; verb: string }) {
  if (there) return <span class="live-there">{"\u2713"} in the model</span>;
  return <button type="button" class="main" disabled={!!working.value} onClick={() => void take(effect, sign)}>{verb} {effect}</button>;
}

// 1, 2 or 5 of a power of ten: about a hundred steps.
function niceStep(span: number): number {
  const power = 10 ** Math.floor(Math.log10(span / 100));
  return power * (span / 100 / power < 2 ? 1 : span / 100 / power < 5 ? 2 : 5);
}

function Slider({ effect, parameter, entry }: { effect: ModelEffect; parameter: number; entry: number }) {
  const one = effect.parameters[parameter];
  const move = moved.value;
  const mine = move && move.effect.name === effect.name && move.parameter === parameter && move.entry === entry;
  const value = mine ? move.value : one.values[entry];
  // The range stays while the slider is moved, and is made anew for a value that comes from elsewhere.
  const range = useRef<[number, number] | null>(null);
  if (!range.current || value < range.current[0] || value > range.current[1]) {
    const near = Math.max(4 * Math.abs(one.typical - one.neutral), 1.5 * Math.abs(value - one.neutral));
    // A formula's own parameter has no typical size: its bounds are what its author gave.
    range.current = near > 0 ? [Math.max(one.lower, one.neutral - near), Math.min(one.upper, one.neutral + near)] : [one.lower, one.upper];
  }
  const [low, high] = range.current;
  return (
    <label class="slider" title={one.meaning}>
      <span>{effect.name} <span class="soft">{one.name}{one.values.length > 1 ? ` ${entry + 1}` : ""}</span></span>
      <input type="range" min={low} max={high} step={niceStep(high - low)} value={value} onInput={(event) => setValue({ effect, parameter, entry, value: Number(Number(event.currentTarget.value).toPrecision(6)) })} />
      <output>{plain(Number(value.toPrecision(4)))}{spaced(unitSymbol(one.unit))}</output>
    </label>
  );
}

function Values() {
  const effects = model.value!.effects.filter((effect) => effect.editable && !effect.per_object && effect.parameters.some((one) => one.values.length));
  if (!effects.length) return null;
  return (
    <div class="live-values">
      <h3>Values</h3>
      {effects.flatMap((effect) => effect.parameters.flatMap((one, p) => one.values.map((_, i) => <Slider key={`${effect.name} ${one.name} ${i}`} effect={effect} parameter={p} entry={i} />)))}
    </div>
  );
}

function Empty() {
  return (
    <section class="live live-empty" aria-labelledby="live-title">
      <h1 id="live-title">Touchstone workbench</h1>
      <p class="summary">See where a model of touch fails, find the effect that it lacks, add it, and watch the error fall.</p>
      <Status />
      {place.value && !working.value && (
        <>
          <p><button type="button" class="main" onClick={() => void openExample()}>Open the example</button></p>
          <p class="soft">576 simulated touches of three objects, and a model that lacks one effect. No rig takes part.</p>
          <h2>Your own measurements</h2>
          <p>Start it with a set of them and a model:</p>
          <div class="code"><pre>touchstone workbench set.csv --model nominal.yaml --mesh-dir meshes --open</pre></div>
        </>
      )}
    </section>
  );
}

export function Live() {
  if (!rungs.value.length) return <Empty />;
  const has = new Set(model.value!.effects.map((effect) => effect.name));
  const addable = diagnosis.value?.steps.some((one) => !has.has(one.effect));
  return (
    <section class="live" aria-labelledby="live-title">
      <h2 id="live-title">Workbench <small>{origin.value} {"\u00b7"} simulated by {place.value?.source ?? ""}</small></h2>
      <div class="row live-acts">
        <button type="button" class={addable ? undefined : "main"} disabled={!!working.value} onClick={() => void diagnose()}>Find what is missing</button>
        <button type="button" disabled={rungs.value.length < 2} onClick={undo}>Undo</button>
        <button type="button" onClick={save}>Save the model</button>
      </div>
      <Status />
      <LiveLadder />
      <Found />
      <Values />
      <Formula />
    </section>
  );
}
