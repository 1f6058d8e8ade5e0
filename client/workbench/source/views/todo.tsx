// What to do: mistakes of the file to fix, effects to add, values to change, the improved model.
import { Bar, Code, IntervalPicture, Section, Table, Terms } from "../parts/parts";
import { before, effectProbability, error, interval, join, typeset, valueName, withError } from "../format";
import { download } from "../charts/export";
import { page, step } from "../state";
import type { Step, Value } from "../data/report";

function Values({ values, title }: { values: Value[]; title: string }) {
  if (!values.length) return null;
  const changed = values.some((value) => value.before !== undefined);
  return (
    <Table title={title}
      columns={["Parameter", ...(changed ? [{ title: "in the model", number: true }] : []), { title: "value \u00b1 standard error", number: true }, { title: "95 % interval", number: true }, ""]}
      csv={() => [["parameter", "finger", "object", "unit", "before", "value", "std_error", "lower", "upper"], ...values.map((value) => [value.name, value.finger, value.object, value.unit, value.before ?? "", value.value, value.std_error, value.lower, value.upper])]}
      rows={values.map((value) => [valueName(value), ...(changed ? [before(value)] : []), withError(value), interval(value), <IntervalPicture value={value} />])} />
  );
}

function StepBody({ one, place }: { one: Step; place: number }) {
  const alike = [one.effect, ...one.equivalent];
  const p = effectProbability(one.probability);
  return (
    <>
      {one.meaning && <p>{typeset(one.meaning)}</p>}
      {one.words && <p>{typeset(one.words)}</p>}
      {one.equivalent.length > 0 && <p><strong>These data cannot tell {join(alike, "and")} apart.</strong></p>}
      <Values values={one.parameters} title={`Values of ${one.effect}`} />
      <Terms terms={[
        [page.value!.words.to_tell[place], typeset(one.discriminating_measurement)], ["To check on the rig", typeset(one.check_on_rig)], ["To fix it", typeset(one.remedy)],
        ["Scope", one.scope?.kind === "OBJECT" ? "one value per object" : ""],
        ["Probability", one.probability > 0 ? (one.equivalent.length ? `${p} that it is one of these ${alike.length}, among all effects that could take their place` : `${p} among all effects that could take its place`) : ""],
      ]} />
    </>
  );
}

export function Problems() {
  const { report, words } = page.value!;
  if (!report.data_problems.length) return null;
  return (
    <Section id="check" title="Check the data" lead="A mistake in the file explains the error far better than physics can. No effect was looked for: fix the file, and diagnose again.">
      <ol class="steps">
        {report.data_problems.map((problem, i) => {
          const kind = report.data[problem.data_index]?.kind ?? "TOUCHES";
          const largest = Math.max(problem.error_before, problem.error_after);
          return (
            <li>
              <h3>{typeset(words.problems[i]?.title ?? problem.kind)}</h3>
              <p>{typeset(problem.words)}</p>
              {problem.error_before > 0 && problem.error_after > 0 && (
                <Table title="Error of the given model on the file as it is and fixed" columns={["The file", "", { title: "RMSE of the given model", number: true }]}
                  rows={[["as it is", <Bar share={problem.error_before / largest} tone="given" />, error(kind, problem.error_before)], ["fixed", <Bar share={problem.error_after / largest} tone="better" />, error(kind, problem.error_after)]]} />
              )}
              {problem.fix && <Code text={words.problems[i]?.fix || problem.fix} label="Command that fixes the file" />}
            </li>
          );
        })}
      </ol>
    </Section>
  );
}

export function Todo() {
  const { report, words } = page.value!;
  if (!report.refitted.length && !report.steps.length && !report.superfluous.length && !report.improved_model_yaml) return null;
  return (
    <Section id="todo" title="What to do">
      <ol class="steps">
        {report.refitted.map((refit) => <li><h3>Change {refit.effect}</h3><Values values={refit.parameters} title={`Values of ${refit.effect}`} /></li>)}
        {report.steps.map((one, i) => <li id={`step-${i}`} class={step.value === i ? "chosen" : undefined}><h3>Add {words.steps[i] ?? one.effect}</h3><StepBody one={one} place={i} /></li>)}
      </ol>
      {report.superfluous.length > 0 && <p>The data do without {join(report.superfluous, "and")}: significantly zero, and no worse without.</p>}
      {report.improved_model_yaml && (
        <details class="model">
          <summary>The improved model{report.improved_model_hash && <> <code title={report.improved_model_hash}>{report.improved_model_hash.slice(0, 12)}</code></>}</summary>
          <Code text={report.improved_model_yaml} label="The improved model" />
          <button type="button" onClick={() => download("better.yaml", "text/yaml", report.improved_model_yaml)}>Save the improved model</button>
        </details>
      )}
    </Section>
  );
}
