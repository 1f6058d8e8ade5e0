// The verdict first: one word, one sentence, the chance that nothing is missing, and what limits the report.
import { Code, Section } from "../parts/parts";
import { error, probability, typeset } from "../format";
import { page, theme, type Theme } from "../state";

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
  const about = words.main !== undefined ? words.of_data[words.main] : undefined;
  const figures: [string, string, string][] = [];
  if (main && main.initial.rmse > 0) {
    figures.push(["Error of the given model", error(main.kind, main.initial.rmse), words.times_the_floor ? typeset(words.times_the_floor) : "RMSE of the residuals"]);
    if (main.final.rmse > 0 && main.final.rmse < main.initial.rmse)
      figures.push(["After what is proposed", error(main.kind, main.final.rmse), main.final.heldout_rmse > 0 ? `${error(main.kind, main.final.heldout_rmse)} on what the fit did not see` : ""]);
    if (about && about.floor > 0)
      figures.push([about.floor_is_bound ? "Noise floor, at most" : "Noise floor", error(main.kind, about.floor), about.floor_is_bound ? "no repeats: a bound from the best model" : "from repeats of the same measurement"]);
  }
  if (report.p_nothing_missing !== undefined)
    figures.push(["P(nothing is missing)", probability(report.p_nothing_missing), `over ${report.hypotheses_tried} hypotheses`]);
  return (
    <header class="top">
      <p class="kicker">
        <span class={`pill ${tones[word] ?? "wrong"}`} data-verdict={word}>{wordOf}</span>
        <span class="what">Touchstone{report.model_name && <> · model <b>{report.model_name}</b></>}{report.model_hash && <> <code title={report.model_hash}>{report.model_hash.slice(0, 12)}</code></>}{main?.session && <> · {main.session}</>}</span>
        <ThemeChoice />
      </p>
      <h1>{typeset(words.headline)}</h1>
      {figures.length > 0 && <div class="figures">{figures.map(([name, value, note]) => <div><span class="figure-name">{name}</span><span class="figure-value">{value}</span><span class="figure-note">{note}</span></div>)}</div>}
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

