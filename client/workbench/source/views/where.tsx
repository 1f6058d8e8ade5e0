// Where: slices in words, the worst first; a click on one filters every view. Then errors by group and over covariates.
import { Bar, Key, Section, Table } from "../parts/parts";
import { Plot, type Mark } from "../charts/plot";
import { rangeOf } from "../charts/scale";
import { count, covariate, error, probability, readings, share, signedError, typeset, unitFor } from "../format";
import { shownData, entry, finger, hasImproved, object, page, slice, touches } from "../state";
import { fingerColour } from "../colour";
import type { Curve, DataReport, Group } from "../data/report";

const dependenceP = 0.01;

function Slices({ data, linked }: { data: DataReport; linked: boolean }) {
  if (!data.where.length) return <p class="empty">No part of the data stands out: what error there is lies everywhere.</p>;
  return (
    <ol class="slices">
      {data.where.map((one, i) => {
        const chosen = linked && slice.value === i;
        const body = (
          <>
            <span class="slice-name">{typeset(one.slice)}</span>
            <span class="slice-words">{typeset(one.words)} <small>mean {signedError(data.kind, one.mean_residual)}</small></span>
            <span class="slice-bar"><Bar share={one.share_of_excess_error} tone="given" /></span>
            <span class="slice-share">{share(one.share_of_excess_error)} <small>of the excess</small></span>
            <span class="slice-count">{count(one.count)} <small>{readings(data)}</small></span>
          </>
        );
        return <li>{linked ? <button type="button" class="slice" aria-pressed={chosen} onClick={() => { slice.value = chosen ? null : i; }}>{body}</button> : <div class="slice">{body}</div>}</li>;
      })}
    </ol>
  );
}

const groupTitle = (kind: string) => (kind === "TIME" ? "Time in the session" : kind[0] + kind.slice(1).toLowerCase());

function Groups({ data, linked }: { data: DataReport; linked: boolean }) {
  const kinds = new Map<string, Group[]>();
  for (const group of data.groups) kinds.set(group.kind, [...(kinds.get(group.kind) ?? []), group]);
  const largest = Math.max(...data.groups.map((group) => group.rmse));
  const shown = [...kinds].filter(([, groups]) => groups.length > 1);
  if (!shown.length) return null;
  const name = (kind: string, group: Group) => {
    if (!(linked ? kind === "OBJECT" || kind === "FINGER" : kind === "OBJECT" && data.photographs)) return group.name;
    const index = data.fingers.indexOf(group.name);
    const chosen = kind === "OBJECT" ? object.value === group.name : index >= 0 && finger.value === index;
    const act = () => {
      if (kind === "OBJECT") object.value = chosen ? null : group.name;
      else if (index >= 0) finger.value = chosen ? null : index;
    };
    return <button type="button" class="link" aria-pressed={chosen} onClick={act}>{group.name}</button>;
  };
  return (
    <>
      <h3>By group</h3>
      <div class="grid groups">
        {shown.map(([kind, groups]) => (
          <Table title={`${groupTitle(kind)}${shownData.value.length > 1 ? `, ${readings(data)}` : ""}`} columns={["", "", { title: "RMSE", number: true }, { title: "of excess", number: true }]}
            csv={() => [["group", "count", `rmse_${data.unit}`, `mean_residual_${data.unit}`, "share_of_excess"], ...groups.map((group) => [group.name, group.count, group.rmse, group.mean_residual, group.share_of_excess_error])]}
            rows={groups.map((group) => [name(kind, group), <Bar share={group.rmse / largest} tone="given" mark={data.noise_floor / largest} />, error(data.kind, group.rmse), share(group.share_of_excess_error)])} />
        ))}
      </div>
      <p class="note">RMSE of the given model within each group, all on one scale; dashed the noise floor. Last column: the group&rsquo;s share of the error beyond the floor.</p>
    </>
  );
}

const dependence = (p: number, after: number, improved: boolean) => `p ${probability(p)}${improved ? ` given, ${probability(after)} improved` : ""}`;

function CurvePlot({ data, curve }: { data: DataReport; curve: Curve }) {
  const both = hasImproved.value;
  const fingers = [...new Set(curve.bins.map((bin) => bin.finger))];
  const size = Math.max(...curve.bins.flatMap((bin) => [Math.abs(bin.mean_residual), Math.abs(bin.after)]).filter(Number.isFinite), 0);
  const unit = unitFor(data.kind, size);
  const marks: Mark[] = [];
  const ys: number[] = [0];
  fingers.forEach((name, f) => {
    const bins = curve.bins.filter((bin) => bin.finger === name);
    const at = (value: number) => value * unit.factor;
    for (const bin of bins) ys.push(at(bin.mean_residual), at(bin.mean_residual - (bin.std_error || 0)), at(bin.mean_residual + (bin.std_error || 0)), at(bin.after));
    marks.push({ kind: "whiskers", points: bins.map((bin) => [bin.centre, at(bin.mean_residual - bin.std_error), at(bin.mean_residual + bin.std_error)]), colour: fingerColour(f) });
    marks.push({ kind: "line", points: bins.map((bin) => [bin.centre, at(bin.mean_residual)]), colour: fingerColour(f) });
    if (both) marks.push({ kind: "line", points: bins.map((bin) => [bin.centre, at(bin.after)]), colour: fingerColour(f), dashed: true });
  });
  const still = both && curve.p_after < dependenceP;
  const title = covariate(curve.covariate, curve.unit);
  return (
    <Plot title={`Mean residual over ${title}`} label={`Mean residual of each finger over ${title}, given and improved model`} height={210}
      x={{ title, range: rangeOf(curve.bins.map((bin) => bin.centre)) }} y={{ title: `mean residual (${unit.symbol})`, range: rangeOf(ys, 0.08) }} marks={marks}
      rows={() => [["covariate", "finger", "centre", `mean_residual_${data.unit}`, `std_error_${data.unit}`, `after_${data.unit}`, "count"], ...curve.bins.map((bin) => [curve.covariate, bin.finger, bin.centre, bin.mean_residual, bin.std_error, bin.after, bin.count])]}
      head={<><b>{title}</b> <span class="soft">{dependence(curve.p, curve.p_after, both)}{still ? ": the residual still depends on it" : curve.p < dependenceP ? ": the residual depends on it" : ""}</span></>}
      caption={curve.fingers.length > 0 && curve.fingers.map((one) => `finger ${one.finger} ${dependence(one.p, one.p_after, both)}`).join("; ")} />
  );
}

function Curves({ data }: { data: DataReport }) {
  const numbered = new Set(data.groups.map((group) => group.kind.toLowerCase()));
  const rank = (curve: Curve) => (Number.isNaN(curve.p) ? 2 : Math.min(curve.p, curve.p_after));
  const curves = data.curves.filter((curve) => curve.bins.length && !numbered.has(curve.covariate)).sort((a, b) => rank(a) - rank(b));
  if (!curves.length) return null;
  const open = curves.filter((curve, i) => curve.p < dependenceP || curve.p_after < dependenceP || curve.fingers.length > 0 || i < 4);
  const folded = curves.filter((curve) => !open.includes(curve));
  const fingers = [...new Set(curves.flatMap((curve) => curve.bins.map((bin) => bin.finger)))].filter(Boolean);
  return (
    <>
      <h3>Residual against every covariate</h3>
      <Key keys={fingers.map((name, f) => ({ colour: fingerColour(f), text: `finger ${name}` }))} />
      <div class="grid wide">{open.map((curve) => <CurvePlot data={data} curve={curve} />)}</div>
      {folded.length > 0 && <details><summary>{folded.length} more, on which the residual does not depend</summary><div class="grid wide">{folded.map((curve) => <CurvePlot data={data} curve={curve} />)}</div></details>}
      <p class="note">Means within bins, whiskers one standard error; solid the given model, dashed the improved one. p: of any dependence, by permutation, corrected for the number of covariates. Only differences between fingers are measured, so what one finger does shows in the others with the other sign.</p>
    </>
  );
}

export function Where() {
  const { data } = page.value!.report;
  const known = shownData.value.filter((one) => one.where.length || one.groups.length || one.curves.length);
  if (!known.length) return null;
  return (
    <Section id="where" title="Where" lead={touches.value ? "The parts of the data in which the given model is wrong, the worst first. Choose one: every view shows it alone." : "The parts of the data in which the given model is wrong, the worst first."}>
      {known.map((one) => {
        const linked = entry.value?.data === one;
        return <>{shownData.value.length > 1 && <h3>{page.value!.words.of_data[data.indexOf(one)].kind_name}</h3>}<Slices data={one} linked={linked} /></>;
      })}
      <p class="note">Excess: the mean square error of the given model beyond the noise floor. Residuals are measured minus simulated: positive means that the real contact came later, or the picture is brighter, than the model says.</p>
    </Section>
  );
}

export function Detail() {
  const { data } = page.value!.report;
  const known = shownData.value.filter((one) => one.groups.length || one.curves.length);
  if (!known.length) return null;
  return (
    <Section id="detail" title="Groups and covariates">
      {known.map((one) => <>{shownData.value.length > 1 && <h3>{page.value!.words.of_data[data.indexOf(one)].kind_name}</h3>}<Groups data={one} linked={entry.value?.data === one} /><Curves data={one} /></>)}
    </Section>
  );
}
