// Several sessions of one rig: the error in each, which values changed, and a control chart of every value.
import { Key, Section, Table } from "../parts/parts";
import { type Mark, Plot } from "../charts/plot";
import { rangeOf } from "../charts/scale";
import { count, error, measured, probability, sized, typeset, unitSymbol } from "../format";
import { entry, page, session } from "../state";
import type { ComparedEffect, ComparedValue, DataReport, Report, SessionValue } from "../data/report";

// A file's name; its path where two have one name (FileLabel of the server).
export function sessionLabel(data: DataReport[], place: number): string {
  const name = (path: string) => path.replace(/\/+$/, "").split("/").pop() || path;
  const own = data[place].session;
  return data.filter((one) => name(one.session) === name(own)).length > 1 ? own : name(own);
}

const valueName = (effect: ComparedEffect, value: ComparedValue) => `${value.name}${value.finger ? ` ${value.finger}` : ""}${effect.object ? ` of ${effect.object}` : ""}`;
const tones: Record<string, string> = { CHANGED: "bad", UNCHANGED: "faint", CANNOT_SAY: "" };

function changeWords(effect: ComparedEffect, value: ComparedValue): string {
  if (value.change === "CHANGED") return `changed by ${measured(value.difference, value.std_error, value.unit)} (p ${probability(effect.p)})`;
  if (value.change === "UNCHANGED") return `unchanged, within ${sized(Math.max(Math.abs(value.lower), Math.abs(value.upper)), value.unit)}`;
  return value.std_error > 0 ? `cannot say: ${sized(value.lower, value.unit)} to ${sized(value.upper, value.unit)}` : "cannot say";
}

// A point a session with two standard errors to either side; the limits are what the other sessions let expect.
function ControlChart({ report, effect, value }: { report: Report; effect: ComparedEffect; value: ComparedValue }) {
  const { sessions } = value;
  const limited = (one: SessionValue) => one.limit_upper > one.limit_lower;
  const label = (one: SessionValue) => sessionLabel(report.data, one.session);
  const told = (one: SessionValue) => `${label(one)}: ${measured(one.value, one.std_error, value.unit)}${one.outside ? ", outside its limits" : ""}`;
  const range = rangeOf(sessions.flatMap((one) => [one.value - 2 * one.std_error, one.value + 2 * one.std_error, ...(limited(one) ? [one.limit_lower, one.limit_upper] : [])]), 0.14);
  const name = `${effect.effect} ${valueName(effect, value)}`;
  const outside = sessions.filter((one) => one.outside).map(label);
  const limits = sessions.map((one, i): [number, number, number] => [i, one.limit_lower, one.limit_upper]).filter((_, i) => limited(sessions[i]));
  const marks: Mark[] = [
    ...(limits.length ? [{ kind: "limits", points: limits, names: ["lower limit", "upper limit"] } as Mark] : []),
    { kind: "line", points: sessions.map((one, i) => [i, one.value]), colour: "var(--axis)" },
    { kind: "whiskers", points: sessions.map((one, i) => [i, one.value - 2 * one.std_error, one.value + 2 * one.std_error]), colour: "var(--ink)" },
    { kind: "points", points: sessions.map((one, i) => ({ x: i, y: one.value, text: told(one), marked: one.outside })), colour: "var(--better)" },
  ];
  return (
    <div class="control">
      <Plot title={name} label={`${name}: ${sessions.map(told).join("; ")}`} height={230} marks={marks} head={<b>{name}</b>}
        x={{ title: "session", range: [-0.5, sessions.length - 0.5], labels: sessions.map((one) => label(one).replace(/\.(csv|db)$/, "")) }}
        y={{ title: value.unit ? `value (${unitSymbol(value.unit)})` : "value", range }}
        rows={() => [["session", "value", "std_error", "limit_lower", "limit_upper", "outside"], ...sessions.map((one) => [report.data[one.session].session, one.value, one.std_error, one.limit_lower, one.limit_upper, one.outside ? 1 : 0])]}
        caption={<>{outside.length > 0 ? <b>Outside: {outside.join(", ")}.</b> : limits.length > 0 && "All within their limits."}{limits.length === 0 && "Limits take five sessions."}
          {value.between_sessions > 0 && ` Scatters by ${sized(value.between_sessions, value.unit)} between sessions, beyond its standard errors.`}</>} />
    </div>
  );
}

export function Sessions() {
  const { report } = page.value!;
  const compared = report.sessions;
  if (!compared) return null;
  const { data } = report;
  const rows = compared.effects.flatMap((effect) => effect.values.map((value) => ({ effect, value })));
  const charted = rows.filter(({ value }) => value.sessions.length > 2);
  const of = (value: ComparedValue, place: number) => value.sessions.find((one) => one.session === place);
  const shown = (value: ComparedValue, place: number) => { const one = of(value, place); return one ? measured(one.value, one.std_error, value.unit) : "\u2013"; };
  const few = data.length <= 3;
  return (
    <Section id="sessions" title="Between the sessions" lead={typeset(compared.words)}>
      <Table title="Sessions" columns={["Session", { title: "Touches", number: true }, { title: "Given model", number: true }, { title: "Its own model", number: true }, { title: "Noise floor", number: true }]}
        rows={data.map((one, place) => [<button type="button" class="link" aria-pressed={entry.value?.index === place} onClick={() => { session.value = place; }}>{sessionLabel(data, place)}</button>, count(one.count),
          one.initial.rmse > 0 ? error(one.kind, one.initial.rmse) : "\u2013", one.final.rmse > 0 ? error(one.kind, one.final.rmse) : "\u2013", one.noise_floor > 0 ? error(one.kind, one.noise_floor) : "\u2013"])}
        csv={() => [["session", "touches", "rmse", "final_rmse", "noise_floor"], ...data.map((one) => [one.session, one.count, one.initial.rmse, one.final.rmse, one.noise_floor])]}
        caption="A click on a session shows its touches in the views below." />
      {rows.length > 0 && <Table title="Values of the model" columns={["Effect", "Value", ...(few ? data.map((_, place) => ({ title: sessionLabel(data, place), number: true })) : ["from", "to"]), "between the sessions that differ most"]}
        rows={rows.map(({ effect, value }, i) => [rows[i - 1]?.effect.effect === effect.effect ? "" : effect.effect, valueName(effect, value),
          ...(few ? data.map((_, place) => shown(value, place)) : [value.from_session, value.to_session].map((place) => `${shown(value, place)} in ${sessionLabel(data, place)}`)),
          `${changeWords(effect, value)}${value.change === "CHANGED" && effect.equivalent.length ? `; or a change of ${effect.equivalent.join(" or ")}` : ""}`])}
        tone={(row) => tones[rows[row].value.change] || undefined}
        csv={() => [["effect", "value", "object", "session", "estimate", "std_error", "change", "p"], ...rows.flatMap(({ effect, value }) => value.sessions.map((one) => [effect.effect, valueName(effect, value), effect.object, data[one.session].session, one.value, one.std_error, value.change, effect.p]))]} />}
      {charted.length > 0 && <>
        <h3>History</h3>
        <p class="row"><Key keys={[{ colour: "var(--better)", text: "a session, two standard errors to either side" }, { colour: "var(--given)", text: "outside its limits" }, { colour: "var(--area)", text: "between its limits: what the other sessions let expect, three standard deviations" }]} /></p>
        <div class="charts">{charted.map(({ effect, value }) => <ControlChart report={report} effect={effect} value={value} />)}</div>
      </>}
    </Section>
  );
}
