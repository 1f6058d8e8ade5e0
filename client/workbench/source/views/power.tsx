// What touches like these can show: from which size each effect is found, and told from what resembles it.
import { Key, Section, Table } from "../parts/parts";
import { join, sized } from "../format";
import { page } from "../state";
import type { Detectable } from "../data/report";

const found80 = 0.8;
const decades: [number, number] = [-3, 1]; // of a size over what rigs show

const size = (of: number | undefined, one: Detectable) => of === undefined ? "\u2013" : sized(of, one.unit);
const rivalOf = (one: Detectable) => one.rival.startsWith("given:") ? `${one.rival.slice(6)} of the model` : one.rival;

function told(one: Detectable): string {
  if (one.found_from === undefined) return "";
  if (!one.rival) return "at once";
  if (one.told_from === undefined) return one.correlation > 0.9995 ? `never: acts as ${rivalOf(one)}` : `never from ${rivalOf(one)}`;
  return one.told_from <= 1.05 * one.found_from ? "at once" : `${size(one.told_from, one)} from ${rivalOf(one)}`;
}

// Sizes from a thousandth to ten times what rigs show: blank where the effect is missed, pale where it is found and may be taken
// for its rival, full where it is told apart. The dashed line is what rigs show.
function Sizes({ one }: { one: Detectable }) {
  const place = (of: number | undefined) => of === undefined || !(one.typical > 0) ? 1 : Math.min(1, Math.max(0, (Math.log10(of / one.typical) - decades[0]) / (decades[1] - decades[0])));
  const percent = (share: number) => `${100 * share}%`;
  const found = place(one.found_from);
  const apart = one.told_from === undefined ? 1 : place(one.told_from);
  const usual = percent(place(one.typical));
  return (
    <svg class="bar sizes" aria-hidden="true">
      <rect width="100%" height="100%" rx="2" fill="var(--track)" />
      <rect x={percent(found)} width={percent(Math.max(0, apart - found))} height="100%" fill="var(--given)" opacity="0.45" />
      <rect x={percent(apart)} width={percent(1 - apart)} height="100%" fill="var(--better)" />
      <line x1={usual} x2={usual} y1="0" y2="100%" stroke="var(--ink)" stroke-width="1.5" stroke-dasharray="3 2.5" />
    </svg>
  );
}

function missedWords(list: Detectable[]): string {
  const best = new Map<string, number>();
  for (const one of list) best.set(one.effect, Math.max(best.get(one.effect) ?? 0, one.power_at_typical));
  const missed = [...best].filter(([, power]) => power < found80).map(([effect]) => effect);
  return missed.length ? `Missed at the size that rigs usually show: ${join(missed, "and")}.` : "Every effect is found at the size that rigs usually show.";
}

export function Power() {
  const { report } = page.value!;
  const list = report.detectable;
  if (!list.length) return null;
  const plan = report.verdict === "VERDICT_UNSPECIFIED";
  const parting = new Map<string, string[]>();
  for (const one of list) if (one.parted_by) parting.set(one.parted_by, [...new Set([...(parting.get(one.parted_by) ?? []), `${one.effect} from ${rivalOf(one)}`])]);
  return (
    <Section id="power" title={plan ? "What this plan can find" : "What this set could have shown"}
      lead={`${missedWords(list)} Sizes are those that a diagnosis of such a set finds, and tells apart, in four of five sets.`}>
      <p class="row"><Key keys={[{ colour: "var(--better)", text: "found and told apart" }, { colour: "color-mix(in srgb, var(--given) 45%, var(--track))", text: "found, but like its rival" }, { colour: "var(--track)", text: "missed" }]} /><span class="figure-note">0.001 to 10 times what rigs show (dashed), log scale</span></p>
      <Table title={plan ? "Effects of this plan" : "Effects that the model lacks"}
        columns={["Stage", "Effect", "Value", "", { title: "found from", number: true }, { title: "rigs show", number: true }, { title: "power there", number: true }, "told apart from"]}
        rows={list.map((one, i) => [list[i - 1]?.stage === one.stage ? "" : one.stage, list[i - 1]?.effect === one.effect ? "" : one.effect, `${one.parameter}${one.finger ? ` ${one.finger}` : ""}`, <Sizes one={one} />, size(one.found_from, one), size(one.typical, one), one.std_error > 0 ? `${Math.round(100 * one.power_at_typical)}\u00a0%` : "none", told(one)])}
        tone={(row) => list[row].power_at_typical < found80 ? "faint" : undefined}
        csv={() => [["stage", "effect", "value", "finger", "unit", "std_error", "found_from", "typical", "power_at_typical", "rival", "correlation", "told_from"],
          ...list.map((one) => [one.stage, one.effect, one.parameter, one.finger, one.unit, one.std_error, one.found_from ?? "", one.typical, one.power_at_typical, one.rival, one.correlation, one.told_from ?? ""])]} />
      {parting.size > 0 && <dl>{[...parting].map(([measurement, pairs]) => <div><dt>To tell {join(pairs, "and")}</dt><dd>{measurement}</dd></div>)}</dl>}
    </Section>
  );
}
