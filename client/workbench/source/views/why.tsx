// Why: every effect of the catalogue as the one that is missing, and which of them these data cannot tell apart.
import { Bar, Code, Key, Section, Table, Terms, ValueRows } from "../parts/parts";
import { Plot, type Mark } from "../charts/plot";
import { rangeOf } from "../charts/scale";
import { covariate, covariateName, effectProbability, error, join, number, probability, readings, share, typeset, valueName, withError } from "../format";
import { joint, shownData, page } from "../state";
import { fingerColour } from "../colour";
import type { Candidate, DataReport } from "../data/report";

const unseen = (one: { rmse: number; heldout_rmse: number }) => (one.heldout_rmse > 0 ? one.heldout_rmse : one.rmse);

const scopeWords = (one: Candidate) =>
  one.scope?.kind !== "OBJECT" ? "" : one.scope.objects.length === 1 ? `of ${one.scope.objects[0]} only` : "a value per object";

// Of all kinds of data, the most probable first.
function rankedCandidates(data: DataReport[]): { one: Candidate; data: DataReport }[] {
  return data.flatMap((of) => of.candidates.map((one) => ({ one, data: of }))).sort((a, b) => b.one.probability - a.one.probability);
}

function Candidates() {
  const { report } = page.value!;
  const ranked = rankedCandidates(report.data);
  const fitted = ranked.filter(({ one }) => one.rmse > 0 || !one.note);
  const largest = new Map(report.data.map((data) => [data, Math.max(unseen(data.initial), ...data.candidates.map(unseen))]));
  const none = report.verdict === "UNEXPLAINED" && !report.steps.length;
  const first = report.steps[0];
  const alike = new Set(first?.equivalent.length ? [first.effect, ...first.equivalent] : []);
  const shared = report.data.length > 1 ? report.steps.filter((step) => step.shown_by.length > 1).map((step) => step.effect) : [];
  const faint = (one: Candidate) => one.probability < 0.05 || none;
  const notes = new Map<string, string[]>();
  for (const { one } of ranked) if (!(one.rmse > 0) && one.note) notes.set(one.note, [...(notes.get(one.note) ?? []), one.effect + (one.scope?.kind === "OBJECT" ? " (per object)" : "")]);
  return (
    <>
      {fitted.length > 0 && <Table stacked title="Effects, ranked" tone={(row) => (faint(fitted[row].one) ? "faint" : undefined)}
        columns={["Effect", { title: "Probability", number: true }, { title: "It would leave", number: true }, "", "Value \u00b1 standard error, 95 % interval"]}
        csv={() => [["effect", "scope", "probability", "rmse", "heldout_rmse", "unit", "note"], ...ranked.map(({ one, data }) => [one.effect, scopeWords(one), one.probability, one.rmse, one.heldout_rmse, data.unit, one.note])]}
        rows={fitted.map(({ one, data }) => {
          const left = unseen(one);
          return [
            <><b class="effect">{one.effect}</b><small> {[scopeWords(one), alike.has(one.effect) && "one of these"].filter(Boolean).join(", ")}</small></>,
            effectProbability(one.probability), left > 0 ? error(data.kind, left) : "",
            left > 0 && <Bar share={left / largest.get(data)!} tone={faint(one) ? "area" : "better"} mark={data.noise_floor / largest.get(data)!} />,
            one.note ? typeset(one.note) : <ValueRows values={one.parameters} />,
          ];
        })}
        caption={<>Each effect alone, {shared.length ? `with ${join(shared, "and")} in place` : "as the first to be added"}. It would leave: the RMSE on what was left out of the fit, dashed the noise floor. The upright line of an interval is zero, no effect.{alike.size > 0 && ` Effects marked as one of these fit alike and share a probability of ${effectProbability(first.probability)}.`}</>} />}
      {notes.size > 0 && <details><summary>{[...notes.values()].flat().length} effects that were not fitted, and why</summary><Terms terms={[...notes].map(([note, effects]) => [join(effects, "and"), typeset(note)])} /></details>}
    </>
  );
}

export function Why() {
  const { report, words } = page.value!;
  const known = report.data.some((data) => data.candidates.length);
  if (!known && !words.ambiguities.length) return null;
  const none = report.verdict === "UNEXPLAINED" && !report.steps.length;
  return (
    <Section id="why" title={none ? "What was tried" : "Why"} lead={`Every effect of the catalogue${none ? " alone, judged on" : ", fitted and judged on"} ${join([...new Set((joint.value ? report.data : [report.data[words.main ?? 0]]).map(readings))], "and")} that the fit did not see${none ? ": none explains the error." : "."}`}>
      <Candidates />
      {words.ambiguities.length > 0 && <><h3>What these data cannot tell apart</h3><Terms terms={words.ambiguities.map((one) => [join(one.effects, "or"), typeset(one.to_decide)])} /></>}
    </Section>
  );
}

function CurvePicture({ data }: { data: DataReport }) {
  const curve = data.unexplained.curve!;
  // Over all of the data, where the curve is constant beyond its knots: a step between two knots would look like a slope.
  const centres = data.curves.filter((one) => one.covariate === curve.covariate).flatMap((one) => one.bins.map((bin) => bin.centre));
  const low = Math.min(curve.knots[0], ...centres);
  const high = Math.max(curve.knots[curve.knots.length - 1], ...centres);
  const marks: Mark[] = curve.curves.flatMap((one, f): Mark[] => {
    const points = one.values.map((value, i): [number, number] => [curve.knots[i], value]);
    const colour = curve.curves.length === 1 ? "var(--better)" : fingerColour(f);
    return [{ kind: "line", points: [[low, points[0]?.[1] ?? 0], ...points, [high, points[points.length - 1]?.[1] ?? 0]], colour }, { kind: "dots", points, colour }];
  });
  const title = covariate(curve.covariate, curve.covariate_unit);
  return (
    <Plot title={`The curve over ${title}`} label={`The curve that fits over ${title}`} height={280} marks={marks} x={{ title, range: [low, high] }}
      y={{ title: `added ${curve.unit === "us" ? "time" : "travel"} (${curve.unit === "us" ? "\u00b5s" : curve.unit})`, range: rangeOf([0, ...curve.curves.flatMap((one) => one.values)], 0.08) }}
      rows={() => [[curve.covariate, ...curve.curves.map((one) => one.finger || "every finger")], ...curve.knots.map((knot, i) => [knot, ...curve.curves.map((one) => one.values[i])])]}
      caption={<><Key keys={curve.curves.map((one, f) => ({ colour: curve.curves.length === 1 ? "var(--better)" : fingerColour(f), text: one.finger ? `finger ${one.finger}` : "every finger" }))} /> Linear between its {curve.knots.length} knots (dots), constant beyond them. A penalty keeps it as straight as the data allow; where few touches lie it is a guess. A shift that all fingers share cannot be measured.</>} />
  );
}

function Rest({ data, nearest }: { data: DataReport; nearest: string }) {
  const rest = data.unexplained;
  const left = rest.heldout_rmse > 0 ? `${error(data.kind, rest.heldout_rmse)} on ${readings(data)} left out of the fit; it removes ${share(rest.heldout_gain)} of the excess error there` : "";
  return (
    <>
      {rest.words && <p>{typeset(rest.words)}</p>}
      {rest.covariates.length > 0 && <Table title="What the rest depends on" columns={[rest.covariates.length > 1 ? "The rest depends, on each alone, on" : "The rest depends on", { title: "p", number: true }, { title: "gain in log evidence (nats)", number: true }]}
        rows={rest.covariates.map((one) => [covariateName(one.name), probability(one.p), number(one.gain_nats)])} />}
      {rest.formula && <><h3>A formula that fits, as a suggestion and not a cause</h3><Code text={rest.formula} label="A formula that fits" /><Terms terms={[...rest.parameters.map((value): [string, string] => [valueName(value), withError(value)]), ["It would leave", left], ["Nearest effect", typeset(nearest)]]} /></>}
      {rest.curve && rest.curve.knots.length > 1 && <><h3>The curve that fits, without a name</h3><CurvePicture data={data} />
        <Terms terms={[["It would leave", rest.formula ? "" : left], ["Nearest simple formula", rest.nearest_formula && <><code>{rest.nearest_formula}</code>, with {share(rest.nearest_formula_share)} of the curve&rsquo;s gain in log evidence</>], ["Nearest effect", rest.formula ? "" : typeset(nearest)]]} /></>}
      {(rest.formula_yaml || rest.lookup_yaml) && <><h3>As text; <code>--save-model FILE --with-formula</code> adds it in its place</h3><Code text={rest.formula_yaml || rest.lookup_yaml} label="The suggestion as text" /></>}
    </>
  );
}

export function Unexplained() {
  const { report, words } = page.value!;
  const known = shownData.value.map((data) => ({ data, about: words.of_data[report.data.indexOf(data)] })).filter(({ data: { unexplained: rest } }) => rest.words || rest.covariates.length || rest.formula || rest.curve || rest.lookup_yaml);
  if (!known.length) return null;
  return (
    <Section id="unexplained" title="What no built-in effect explains" lead="A structure that is left after all steps. p: likelihood ratio of the best term, all terms paid for.">
      {known.map(({ data, about }) => <>{known.length > 1 && <h3>{about.kind_name}</h3>}<Rest data={data} nearest={about.nearest_effect} /></>)}
    </Section>
  );
}
