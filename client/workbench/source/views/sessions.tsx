// Several sessions of one rig: the error in each, which values changed, and a control chart of every value.
import { useRef } from "preact/hooks";
import { Key, Section, Table } from "../parts/parts";
import { Tools } from "../parts/tools";
import { count, error, number, probability, typeset, unitSymbol } from "../format";
import { entry, page, session } from "../state";
import type { ComparedEffect, ComparedValue, DataReport, Report, SessionValue } from "../data/report";

// A file's name; its path where two have one name (FileLabel of the server).
export function sessionLabel(data: DataReport[], place: number): string {
  const name = (path: string) => path.replace(/\/+$/, "").split("/").pop() || path;
  const own = data[place].session;
  return data.filter((one) => name(one.session) === name(own)).length > 1 ? own : name(own);
}

const valueName = (effect: ComparedEffect, value: ComparedValue) => `${value.name}${value.finger ? ` ${value.finger}` : ""}${effect.object ? ` of ${effect.object}` : ""}`;
const withUnit = (text: string, unit: string) => unit ? `${text}\u2009${unitSymbol(unit)}` : text;
const tones: Record<string, string> = { CHANGED: "bad", UNCHANGED: "faint", CANNOT_SAY: "" };

// As many decimals as the error leaves.
function withError(value: number, std_error: number): string {
  if (!(std_error > 0)) return number(value, 3);
  const places = Math.min(9, Math.max(0, 1 - Math.floor(Math.log10(std_error))));
  return `${value.toFixed(places).replace("-", "\u2212")} \u00b1 ${std_error.toFixed(places)}`;
}

function changeWords(effect: ComparedEffect, value: ComparedValue): string {
  if (value.change === "CHANGED") return `changed by ${withUnit(withError(value.difference, value.std_error), value.unit)} (p ${probability(effect.p)})`;
  if (value.change === "UNCHANGED") return `unchanged, within ${withUnit(number(Math.max(Math.abs(value.lower), Math.abs(value.upper)), 2), value.unit)}`;
  return value.std_error > 0 ? `cannot say: ${number(value.lower, 2)} to ${withUnit(number(value.upper, 2), value.unit)}` : "cannot say";
}

const width = 360, height = 120, edge = 10;

// A point a session with its standard error; the band is what the other sessions let expect.
function ControlChart({ report, effect, value }: { report: Report; effect: ComparedEffect; value: ComparedValue }) {
  const drawn = useRef<SVGSVGElement>(null);
  const limited = (one: SessionValue) => one.limit_upper > one.limit_lower;
  const low = Math.min(...value.sessions.map((one) => Math.min(one.value - 2 * one.std_error, limited(one) ? one.limit_lower : Infinity)));
  const high = Math.max(...value.sessions.map((one) => Math.max(one.value + 2 * one.std_error, limited(one) ? one.limit_upper : -Infinity)));
  if (!(high > low)) return null;
  const step = (width - 2 * edge) / Math.max(1, value.sessions.length);
  const x = (place: number) => edge + (place + 0.5) * step;
  const y = (of: number) => edge + (1 - (of - low) / (high - low)) * (height - 2 * edge);
  const name = `${effect.effect} ${valueName(effect, value)}`;
  const outside = value.sessions.filter((one) => one.outside).map((one) => sessionLabel(report.data, one.session));
  const said = `${name}: ${value.sessions.map((one) => `${sessionLabel(report.data, one.session)} ${withError(one.value, one.std_error)}${one.outside ? ", outside its limits" : ""}`).join("; ")}`;
  return (
    <figure class="chart control">
      <div class="plot-head"><div class="plot-title">{name}{value.unit && <span class="faint">, {unitSymbol(value.unit)}</span>}</div>
        <Tools title={name} svg={() => drawn.current} rows={() => [["session", "value", "std_error", "limit_lower", "limit_upper", "outside"], ...value.sessions.map((one) => [report.data[one.session].session, one.value, one.std_error, one.limit_lower, one.limit_upper, one.outside ? 1 : 0])]} /></div>
      <svg ref={drawn} viewBox={`0 0 ${width} ${height}`} role="img" aria-label={said}>
        {value.sessions.map((one, i) => limited(one) && <rect x={x(i) - step / 2} width={step} y={y(one.limit_upper)} height={Math.max(1, y(one.limit_lower) - y(one.limit_upper))} fill="var(--pale)" />)}
        <polyline points={value.sessions.map((one, i) => `${x(i)},${y(one.value)}`).join(" ")} fill="none" stroke="var(--axis)" />
        {value.sessions.map((one, i) => (
          <g>
            <title>{`${sessionLabel(report.data, one.session)}: ${withError(one.value, one.std_error)}`}</title>
            <line x1={x(i)} x2={x(i)} y1={y(one.value - 2 * one.std_error)} y2={y(one.value + 2 * one.std_error)} stroke="var(--ink)" stroke-width="1.2" />
            {one.outside
              ? <rect x={x(i) - 4.5} y={y(one.value) - 4.5} width="9" height="9" transform={`rotate(45 ${x(i)} ${y(one.value)})`} fill="var(--given)" stroke="var(--ink)" />
              : <circle cx={x(i)} cy={y(one.value)} r="3.6" fill="var(--better)" />}
          </g>))}
      </svg>
      <figcaption>{number(low, 3)} to {withUnit(number(high, 3), value.unit)}, {sessionLabel(report.data, value.sessions[0].session)} to {sessionLabel(report.data, value.sessions[value.sessions.length - 1].session)}.{outside.length > 0 && <b> Outside: {outside.join(", ")}.</b>}
        {value.between_sessions > 0 && ` Scatters by ${withUnit(number(value.between_sessions, 2), value.unit)} between sessions, beyond its standard errors.`}</figcaption>
    </figure>
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
  const shown = (value: ComparedValue, place: number) => { const one = of(value, place); return one ? withError(one.value, one.std_error) : "\u2013"; };
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
        <p class="row"><Key keys={[{ colour: "var(--better)", text: "a session, two standard errors to either side" }, { colour: "var(--given)", text: "outside its limits" }, { colour: "var(--pale)", text: "what the other sessions let expect, three standard deviations" }]} /></p>
        <div class="charts">{charted.map(({ effect, value }) => <ControlChart report={report} effect={effect} value={value} />)}</div>
      </>}
    </Section>
  );
}
