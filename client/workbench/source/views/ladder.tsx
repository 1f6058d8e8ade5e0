// The ladder: the error after each effect, held-out beside it, down to the noise floor. Of several kinds of data, all of them.
import { Bar, Section, Table } from "../parts/parts";
import { error, number, probability, withError } from "../format";
import { page, step } from "../state";
import type { DataReport, Value } from "../data/report";

function Rungs() {
  const { words, report } = page.value!;
  const main = report.data[words.main ?? 0];
  const largest = Math.max(...words.ladder.map((rung) => Math.max(rung.rmse ?? 0, rung.heldout_rmse ?? 0)));
  const floor = words.ladder.find((rung) => rung.kind === "floor")?.rmse ?? 0;
  const tones = { given: "given", refit: "better", step: "better", suggestion: "suggested", floor: "floor" };
  let number = 0;
  return (
    <ol class="ladder">
      {words.ladder.map((rung) => {
        const at = rung.kind === "step" ? number++ : null;
        const chosen = at !== null && step.value === at;
        const choose = () => {
          step.value = chosen ? null : at;
          if (!chosen) document.getElementById(`step-${at}`)?.scrollIntoView({ block: "nearest", behavior: "smooth" });
        };
        return (
          <li class={`rung ${rung.kind}${chosen ? " chosen" : ""}`}>
            <span class="rung-name">{at === null ? rung.name : <button type="button" class="link" aria-pressed={chosen} onClick={choose}>{rung.name}</button>}</span>
            <span class="rung-bar"><Bar share={(rung.rmse ?? 0) / largest} tone={tones[rung.kind]} mark={rung.kind === "floor" ? undefined : floor / largest} second={rung.heldout_rmse === null ? undefined : rung.heldout_rmse / largest} /></span>
            <span class="rung-error">{error(main.kind, rung.rmse)}</span>
            <span class="rung-unseen">{rung.heldout_rmse !== null && <>{error(main.kind, rung.heldout_rmse)} <small>unseen</small></>}</span>
            <span class="rung-p">{rung.lack_of_fit_p !== null && <><small>lack of fit p</small> {probability(rung.lack_of_fit_p)}</>}</span>
          </li>
        );
      })}
    </ol>
  );
}

const kinds: Record<string, string> = { TOUCHES: "touches", PHOTOGRAPHS: "pictures", BOARDS: "boards", DISTRIBUTIONS: "touches without poses" };

function AllKinds() {
  const { report, words } = page.value!;
  const row = (name: string, of: (data: DataReport) => number | undefined, by: string) => [name, ...report.data.map((data) => error(data.kind, of(data))), by];
  const rows = [
    row("given model", (data) => data.initial.rmse, ""),
    ...report.steps.map((one, i) => row(`+ ${words.steps[i]}`, (data) => data.after_step[i]?.rmse, one.shown_by.length > 1 ? "both" : one.shown_by.map((kind) => `${kinds[kind]} alone`).join(""))),
    row("noise floor", (data) => data.noise_floor || Number.NaN, ""),
  ];
  const values = [...report.refitted, ...report.steps].flatMap((one) => one.parameters.filter((value) => value.alone?.length).map((value) => ({ effect: one.effect, value })));
  const alone = (value: Value, data: DataReport) => {
    const own = value.alone.find(({ kind }) => kind === data.kind);
    return own ? `\u00b1\u00a0${number(own.std_error, 2)}\u00a0${value.unit}` : "says nothing";
  };
  return (
    <>
      <h3>Touches and pictures</h3>
      <Table title="Errors of all kinds of data" columns={["Model", ...report.data.map((data) => ({ title: kinds[data.kind] ?? data.kind, number: true })), "Shown by"]} rows={rows}
        caption="RMSE of each kind of data after each step, as a comparison with that model finds it." />
      {values.length > 0 && <Table title="Values that both kinds of data show" columns={["Value", { title: "from both", number: true }, ...report.data.map((data) => ({ title: `${kinds[data.kind]} alone`, number: true }))]}
        rows={values.map(({ effect, value }) => [`${effect} ${value.name}${value.finger && ` ${value.finger}`}${value.object && ` of ${value.object}`}`, withError(value), ...report.data.map((data) => alone(value, data))])}
        caption="Fitted to the sum of both log likelihoods. Alone: the standard error that either kind would leave by itself." />}
    </>
  );
}

export function Ladder() {
  const { words, report } = page.value!;
  if (!words.ladder.length) return null;
  return (
    <Section id="ladder" title="Ladder" lead="The error of the model, change by change, down to the noise floor.">
      <Rungs />
      <p class="note">Bar: RMSE of the residuals on these data. Upright line: the same on data left out of the fit. Dashed: the noise floor. Lack of fit p: how likely that much misfit beyond noise is if nothing were missing. A click on a step shows what it is.</p>
      {report.data.length > 1 && !report.sessions && <AllKinds />}
    </Section>
  );
}
