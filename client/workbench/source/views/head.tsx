// The verdict first: one word, one sentence, the chance that nothing is missing, and what limits the report.
import { Code, Section } from "../parts/parts";
import { error, probability, readings, typeset } from "../format";
import { joint, page, theme, type Theme } from "../state";
import type { DataReport, WordsOfData } from "../data/report";

const tones: Record<string, string> = { ADEQUATE: "good", TOO_LITTLE_DATA: "plain", "": "plain" };

function ThemeChoice() {
  const next: Record<Theme, Theme> = { auto: "light", light: "dark", dark: "auto" };
  const name: Record<Theme, string> = { auto: "Theme: system", light: "Theme: light", dark: "Theme: dark" };
  return <button type="button" class="small quiet" onClick={() => { theme.value = next[theme.value]; }}>{name[theme.value]}</button>;
}

export function Head() {
  const { report, words } = page.value!;
  const main = report.data[words.main ?? 0];
  const word = report.verdict === "VERDICT_UNSPECIFIED" ? "" : report.verdict;
  const wordOf = word ? word.toLowerCase().replace(/_/g, " ") : report.detectable.length ? "plan" : "comparison";
  // A figure: what it is, and for each kind of data its value and what there is to say of it.
  const figures: [string, [string, string][]][] = [];
  const shown = joint.value ? report.data : main ? [main] : [];
  const per = (name: string, tell: (data: DataReport, about: WordsOfData) => [string, string] | null) => {
    const lines = shown.flatMap((data) => {
      const line = tell(data, words.of_data[report.data.indexOf(data)]);
      return line ? [[line[0], joint.value ? [readings(data), line[1]].filter(Boolean).join(": ") : line[1]] as [string, string]] : [];
    });
    if (lines.length) figures.push([name, lines]);
  };
  if (main && main.initial.rmse > 0) {
    per("Error of the given model", (data, about) => [error(data.kind, data.initial.rmse), typeset((joint.value ? about.times_the_floor : words.times_the_floor) || "RMSE of the residuals")]);
    if (shown.some((data) => data.final.rmse > 0 && data.final.rmse < data.initial.rmse))
      per("After what is proposed", (data) => [error(data.kind, data.final.rmse), data.final.heldout_rmse > 0 ? `${error(data.kind, data.final.heldout_rmse)} on what the fit did not see` : ""]);
    per("Noise floor", (data, about) => about?.floor > 0 ? [error(data.kind, about.floor), about.floor_is_bound ? "at most: no repeats, a bound from the best model" : "from repeats of the same measurement"] : null);
  }
  if (report.p_nothing_missing !== undefined)
    figures.push(["P(nothing is missing)", [[probability(report.p_nothing_missing), `over ${report.hypotheses_tried} hypotheses`]]]);
  return (
    <header class="top">
      <p class="kicker">
        <span class={`pill ${tones[word] ?? "wrong"}`} data-verdict={word}>{wordOf}</span>
        <span class="what">Touchstone{report.model_name && <> · model <b>{report.model_name}</b></>}{report.model_hash && <> <code title={report.model_hash}>{report.model_hash.slice(0, 12)}</code></>}{main?.session && <> · {main.session}</>}</span>
        <ThemeChoice />
      </p>
      <h1>{typeset(words.headline)}</h1>
      {figures.length > 0 && <div class="figures">{figures.map(([name, lines]) => <div><span class="figure-name">{name}</span>{lines.map(([value, note]) => <><span class="figure-value">{value}</span><span class="figure-note">{note}</span></>)}</div>)}</div>}
      {words.summary && <p class="summary">{typeset(words.summary)}</p>}
      <p class="facts">
        {typeset(words.data)}.{typeset(words.floor)} {words.nothing_missing && typeset(words.nothing_missing)} {words.finger_scatter && `Of the fingers, ${typeset(words.finger_scatter)}.`}
        {report.data.some((data) => data.emulated) && " An emulator made these data, all or some: they measure nothing."}
      </p>
      {report.warnings.length > 0 && <aside class="warnings" aria-label="What limits this report"><p>What limits this report</p><ul>{report.warnings.map((warning) => <li>{typeset(warning)}</li>)}</ul></aside>}
    </header>
  );
}

export function Commands() {
  const { words } = page.value!;
  if (!words.commands.length) return null;
  return (
    <Section id="commands" title="Commands that come next">
      {words.commands.map((next) => <div class="command"><h3>{next.purpose}</h3><Code text={next.command} label={next.purpose} /></div>)}
    </Section>
  );
}

