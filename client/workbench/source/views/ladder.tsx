// The ladder: the error after each effect, held-out beside it, down to the noise floor. Of several kinds of data, all of them.
import { Bar, Section, Table } from "../parts/parts";
import { error, probability, sized, withError } from "../format";
import { joint, page, step } from "../state";
import type { DataReport, Rung, Value } from "../data/report";

const tones = { given: "given", refit: "better", step: "better", suggestion: "suggested", floor: "floor" };

function StepButton({ at, name }: { at: number; name: string }) {
  const chosen = step.value === at;
  const choose = () => {
    step.value = chosen ? null : at;
    if (!chosen) document.getElementById(`step-${at}`)?.scrollIntoView({ block: "nearest", behavior: "smooth" });
  };
  return <button type="button" class="link" aria-pressed={chosen} onClick={choose}>{name}</button>;
}

function Rungs() {
  const { words, report } = page.value!;
  const main = report.data[words.main ?? 0];
  const largest = Math.max(...words.ladder.map((rung) => Math.max(rung.rmse ?? 0, rung.heldout_rmse ?? 0)));
  const floor = words.ladder.find((rung) => rung.kind === "floor")?.rmse ?? 0;
  let number = 0;
  return (
    <ol class="ladder">
      {words.ladder.map((rung) => {
        const at = rung.kind === "step" ? number++ : null;
        const chosen = at !== null && step.value === at;
        return (
          <li class={`rung ${rung.kind}${chosen ? " chosen" : ""}`}>
            <span class="rung-name">{at === null ? rung.name : <StepButton at={at} name={rung.name} />}</span>
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

// A kind of data in words: what its errors are of.
const kinds: Record<string, [string, string]> = { TOUCHES: ["touches", "contact times"], PHOTOGRAPHS: ["pictures", "grey levels"], BOARDS: ["boards", "pixels"], DISTRIBUTIONS: ["touches without poses", "contact times"] };
const kindName = (data: DataReport) => kinds[data.kind]?.[0] ?? data.kind;

// The rungs of all kinds, those of one name beside one another.
function joinedRungs(ladders: Rung[][]): { rung: Rung; of: (Rung | undefined)[] }[] {
  const order = ["given", "refit", "step", "suggestion", "floor"];
  const key = (rung: Rung) => (rung.kind === "floor" ? rung.kind : `${rung.kind} ${rung.name}`);
  const keys = [...new Map(ladders.flat().map((rung) => [key(rung), rung])).entries()].sort((a, b) => order.indexOf(a[1].kind) - order.indexOf(b[1].kind));
  return keys.map(([wanted, rung]) => ({ rung, of: ladders.map((rungs) => rungs.find((one) => key(one) === wanted)) }));
}

// Every kind of data in a column of its own, in its unit and on its own scale.
function JointRungs() {
  const { words, report } = page.value!;
  const ladders = report.data.map((_, i) => words.of_data[i].ladder ?? []);
  const largest = ladders.map((rungs) => Math.max(...rungs.map((rung) => Math.max(rung.rmse ?? 0, rung.heldout_rmse ?? 0))) || 1);
  const floors = ladders.map((rungs) => rungs.find((rung) => rung.kind === "floor")?.rmse ?? 0);
  let number = 0;
  return (
    <>
      <div class="rung joint-rung joint-heads" aria-hidden="true"><span />{report.data.map((data) => <span><b>{kindName(data)}</b> <span class="soft">{kinds[data.kind]?.[1]}</span></span>)}</div>
      <ol class="ladder">
        {joinedRungs(ladders).map(({ rung, of }) => {
          const at = rung.kind === "step" ? number++ : null;
          const chosen = at !== null && step.value === at;
          const by = at === null ? [] : report.steps[at].shown_by;
          return (
            <li class={`rung joint-rung ${rung.kind}${chosen ? " chosen" : ""}`}>
              <span class="rung-name">{at === null ? rung.kind === "floor" ? "noise floor" : rung.name : <StepButton at={at} name={rung.name} />}
                {by.length > 0 && <small> shown by {by.length > 1 ? "both" : `${kinds[by[0]]?.[0] ?? by[0]} alone`}</small>}</span>
              {of.map((one, k) => (
                <span class="joint-cell">
                  <span class="joint-kind">{kindName(report.data[k])}</span>
                  {one ? <>
                    <Bar share={(one.rmse ?? 0) / largest[k]} tone={tones[one.kind]} mark={one.kind === "floor" ? undefined : floors[k] / largest[k]} second={one.heldout_rmse === null ? undefined : one.heldout_rmse / largest[k]} />
                    <span class="rung-error">{error(report.data[k].kind, one.rmse)}</span>
                    <small class="joint-note">{[one.name.endsWith(", at most") && "at most", one.heldout_rmse !== null && `${error(report.data[k].kind, one.heldout_rmse)} unseen`, one.lack_of_fit_p !== null && `lack of fit p ${probability(one.lack_of_fit_p)}`].filter(Boolean).join(", ")}</small>
                  </> : <span class="soft">{"\u2013"}</span>}
                </span>
              ))}
            </li>
          );
        })}
      </ol>
    </>
  );
}

function ValuesOfBoth() {
  const { report } = page.value!;
  const values = [...report.refitted, ...report.steps].flatMap((one) => one.parameters.filter((value) => value.alone?.length).map((value) => ({ effect: one.effect, value })));
  const alone = (value: Value, data: DataReport) => {
    const own = value.alone.find(({ kind }) => kind === data.kind);
    return own ? `\u00b1\u00a0${sized(own.std_error, value.unit)}` : "says nothing";
  };
  if (!values.length) return null;
  return (
    <Table title="Values that both kinds of data show" columns={["Value", { title: "from both", number: true }, ...report.data.map((data) => ({ title: `${kindName(data)} alone`, number: true }))]}
      rows={values.map(({ effect, value }) => [`${effect} ${value.name}${value.finger && ` ${value.finger}`}${value.object && ` of ${value.object}`}`, withError(value), ...report.data.map((data) => alone(value, data))])}
      csv={() => [["effect", "parameter", "finger", "object", "unit", "value", "std_error", ...report.data.map((data) => `std_error_${data.kind.toLowerCase()}_alone`)],
        ...values.map(({ effect, value }) => [effect, value.name, value.finger, value.object, value.unit, value.value, value.std_error, ...report.data.map((data) => value.alone.find(({ kind }) => kind === data.kind)?.std_error ?? "")])]}
      caption="Fitted to the sum of both log likelihoods. Alone: the standard error that either kind would leave by itself." />
  );
}

export function Ladder() {
  const { words } = page.value!;
  if (!words.ladder.length) return null;
  return (
    <Section id="ladder" title="Ladder" lead={`The error of the model, change by change, down to the noise floor${joint.value ? ": of each kind of data, in its own unit and on its own scale" : ""}.`}>
      {joint.value ? <JointRungs /> : <Rungs />}
      <p class="note">Bar: RMSE of the residuals on these data. Upright line: the same on data left out of the fit. Dashed: the noise floor. Lack of fit p: how likely that much misfit beyond noise is if nothing were missing. A click on a step shows what it is.</p>
      {joint.value && <ValuesOfBoth />}
    </Section>
  );
}
