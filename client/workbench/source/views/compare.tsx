// Compare: parity or the residual against any covariate, touch by touch; histograms of measured and simulated.
import { Key, Section, Table } from "../parts/parts";
import { Plot, type Mark } from "../charts/plot";
import { type Range, rangeOf } from "../charts/scale";
import { count, covariate, covariateName, error, fixed, probability, signedError, unitFor } from "../format";
import { shownData, covariate as by, entry, hasImproved, improved, object, parity, ranked, selectTouch, shown, shownCovariate, touchIndex, touches } from "../state";
import { fingerColour } from "../colour";
import type { Touches } from "../data/touches";
import type { DataReport, Histogram, Kind } from "../data/report";

// 99.6 % of the values, so that a single outlier does not flatten the rest.
function robust(values: Float32Array, always: number[] = []): Range {
  const step = Math.max(1, Math.floor(values.length / 30000));
  const known: number[] = [];
  for (let i = 0; i < values.length; i += step) if (Number.isFinite(values[i])) known.push(values[i]);
  known.sort((a, b) => a - b);
  const cut = known.length > 1000 ? Math.floor(known.length * 0.002) : 0;
  return rangeOf([...always, known[cut] ?? 0, known[known.length - 1 - cut] ?? 0]);
}

export function describeCell(table: Touches, kind: Kind, cell: number): string {
  const touch = table.touchOf(cell);
  return `touch ${table.number[touch]}, ${table.objects[table.object[touch]] ?? ""}, finger ${table.names[table.fingerOf(cell)]}: ${signedError(kind, table.residuals(improved.value)[cell])}`;
}

function TouchPlot({ table, data }: { table: Touches; data: DataReport }) {
  const values = table.residuals(improved.value);
  const column = table.columns.find(({ name }) => name === shownCovariate.value);
  const x = new Float32Array(table.cells);
  const y = new Float32Array(table.cells);
  const group = new Uint8Array(table.cells);
  let size = 0;
  for (let cell = 0; cell < table.cells; ++cell) if (Number.isFinite(table.simulated[cell])) size = Math.max(size, column ? Math.abs(table.residual[cell]) : Math.abs(table.simulated[cell]));
  const unit = unitFor(data.kind, size);
  for (let cell = 0; cell < table.cells; ++cell) {
    const measured = table.simulated[cell] + table.residual[cell];
    x[cell] = column ? column.at(cell) : (measured - values[cell]) * unit.factor;
    y[cell] = column ? values[cell] * unit.factor : measured * unit.factor;
    group[cell] = table.fingerOf(cell) % 6;
  }
  const xRange = column ? robust(x) : robust(y);
  const yRange: Range = column ? robust(Float32Array.from(table.residual, (value) => value * unit.factor), [0]) : xRange;
  const marks: Mark[] = [];
  if (column && data.noise_floor > 0) marks.push({ kind: "band", low: -data.noise_floor * unit.factor, high: data.noise_floor * unit.factor });
  if (!column) marks.push({ kind: "line", points: [[xRange[0], xRange[0]], [xRange[1], xRange[1]]], colour: "var(--ink)", dashed: true });
  const marked = touchIndex.value === null ? [] : table.cellsOf(touchIndex.value);
  const model = improved.value ? "improved model" : "given model";
  const title = column ? `Residual over ${covariateName(column.name)}` : "Measured against simulated";
  return (
    <Plot title={title} label={`${title}, ${model}, one dot per finger and touch`} height={380}
      x={column ? { title: covariate(column.name, column.unit), range: column.labels.length ? [-0.5, column.labels.length - 0.5] : xRange, labels: column.labels.length && column.labels.length < 9 ? column.labels : undefined } : { title: `simulated (${unit.symbol})`, range: xRange }}
      y={{ title: `${column ? "residual" : "measured"} (${unit.symbol})`, range: yRange }}
      marks={marks} cloud={{ x, y, group, colours: ["--f0", "--f1", "--f2", "--f3", "--f4", "--f5"], shown: shown.value, marked }}
      onPick={(cell) => selectTouch(table.touchOf(cell))} describe={(cell) => describeCell(table, data.kind, cell)}
      rows={() => [["touch", "object", "finger", column ? column.name : `simulated_${data.unit}`, column ? `residual_${data.unit}` : `measured_${data.unit}`],
        ...Array.from({ length: table.cells }, (_, cell) => cell).filter((cell) => shown.value[cell]).map((cell) => [table.number[table.touchOf(cell)], table.objects[table.object[table.touchOf(cell)]] ?? "", table.names[table.fingerOf(cell)],
          column ? column.at(cell) : x[cell] / unit.factor, column ? values[cell] : y[cell] / unit.factor])]}
      head={
        <label class="axis-choice">{column ? "Residual against" : "Measured against"} <select value={shownCovariate.value} onChange={(event) => { by.value = event.currentTarget.value; }}>
          <option value={parity}>simulated (parity)</option>
          {table.columns.map(({ name }) => <option value={name}>{covariateName(name)}</option>)}
        </select></label>
      }
      caption={<><Key keys={table.names.map((name, f) => ({ colour: fingerColour(f), text: `finger ${name}` }))} /> {column ? "Grey band: the noise floor of one finger." : "Contact times of a touch, relative to each other; on the dashed line measured and simulated agree."}{" "}
        {table.inAll > table.size ? `${count(table.size)} of ${count(table.inAll)} touches are drawn, whole poses spread evenly.` : ""} Click a dot to see its touch.</>} />
  );
}

export function TouchCard({ table, data }: { table: Touches; data: DataReport }) {
  const n = touchIndex.value;
  if (n === null) return <p class="soft touch-hint">No touch is chosen. Click a dot, or go through them with <kbd>[</kbd> and <kbd>]</kbd>, the worst first.</p>;
  const place = (list: Float32Array, at: number, digits: number) => [0, 1, 2].map((k) => fixed(list[3 * at + k], digits)).join(" ");
  const rank = ranked.value.indexOf(n);
  return (
    <div class="touch-card" data-touch={table.number[n]}>
      <h3>Touch {table.number[n]} on {table.objects[table.object[n]]}{rank >= 0 && <span class="soft"> · {rank + 1} of {count(ranked.value.length)} by size</span>}</h3>
      <Table title={`Touch ${table.number[n]}`} columns={["Finger", { title: "measured", number: true }, { title: "residual", number: true }, ...(hasImproved.value ? [{ title: "improved", number: true }] : []), { title: "contact x y z (mm)", number: true }]}
        csv={() => [["touch", "object", "finger", `measured_${data.unit}`, `residual_${data.unit}`, `after_${data.unit}`, "contact_x_mm", "contact_y_mm", "contact_z_mm"], ...table.cellsOf(n).map((cell) => [table.number[n], table.objects[table.object[n]] ?? "", table.names[table.fingerOf(cell)], table.simulated[cell] + table.residual[cell], table.residual[cell], table.after[cell], ...[0, 1, 2].map((k) => table.contact[3 * cell + k])])]}
        rows={table.cellsOf(n).map((cell) => [table.names[table.fingerOf(cell)], error(data.kind, table.simulated[cell] + table.residual[cell]), signedError(data.kind, table.residual[cell]), ...(hasImproved.value ? [signedError(data.kind, table.after[cell])] : []), place(table.contact, cell, 1)])} />
      <p class="soft">Target {place(table.target, n, 1)} mm, approach {place(table.approach, n, 2)}. {table.columns.filter((column) => ["speed_mm_s", "session_time_s", "round", "face"].includes(column.name) && Number.isFinite(column.at(n * table.fingers)))
        .map((column) => { const value = column.at(n * table.fingers); return `${covariate(column.name, column.unit)} ${column.labels[value] ?? Math.round(value * 10) / 10}`; }).join(", ")}</p>
    </div>
  );
}

function HistogramPlot({ data, one }: { data: DataReport; one: Histogram }) {
  const curvature = one.quantity === "CURVATURE_PER_M";
  const unit = curvature ? { symbol: "1/m", factor: 1 } : unitFor(data.kind, Math.max(...one.edges.map(Math.abs)));
  const edges = one.edges.map((edge) => edge * unit.factor);
  const peak = Math.max(...[...one.measured, ...one.simulated, ...one.improved].filter(Number.isFinite), 0) || 1;
  const part = (values: number[]) => values.map((value) => (100 * value) / peak);
  const marks: Mark[] = [{ kind: "steps", edges, values: part(one.measured), colour: "var(--area)", filled: true }, { kind: "steps", edges, values: part(one.simulated), colour: "var(--given)" }];
  if (hasImproved.value && one.improved.length) marks.push({ kind: "steps", edges, values: part(one.improved), colour: "var(--better)" });
  const title = `${curvature ? "Local curvature" : "Descriptor"}, ${one.object || "all objects"}`;
  return (
    <Plot title={title} label={`Histogram of ${title}: measured, given and improved model`} height={190} x={{ title: `${curvature ? "local curvature" : "descriptor"} (${unit.symbol})`, range: [edges[0], edges[edges.length - 1]] }}
      y={{ title: "% of peak", range: [0, 106] }} marks={marks}
      rows={() => [["from", "to", "measured", "simulated", "improved"], ...one.measured.map((value, i) => [one.edges[i], one.edges[i + 1], value, one.simulated[i], one.improved[i] ?? Number.NaN])]}
      head={<b>{one.object || "all objects"}</b>} caption={`p ${probability(one.p_simulated)} given${hasImproved.value ? `, ${probability(one.p_improved)} improved` : ""}`} />
  );
}

export function Histograms() {
  const known = shownData.value.filter((data) => data.histograms.some((one) => one.edges.length > 1));
  if (!known.length) return null;
  const keys = [{ colour: "var(--area)", text: "measured" }, { colour: "var(--given)", text: "given model" }, ...(hasImproved.value ? [{ colour: "var(--better)", text: "improved model" }] : [])];
  return (
    <Section id="histograms" title="Histograms" lead={<Key keys={keys} />}>
      {known.map((data) => ["TOUCH_DESCRIPTOR", "CURVATURE_PER_M"].map((quantity) => {
        const list = data.histograms.filter((one) => one.edges.length > 1 && (one.quantity === quantity));
        if (!list.length) return null;
        const wanted = object.value === null ? list : list.filter((one) => !one.object || one.object === object.value);
        return <><h3>{quantity === "CURVATURE_PER_M" ? "Local curvature" : "Descriptor"}</h3><div class="grid small-plots">{wanted.map((one) => <HistogramPlot data={data} one={one} />)}</div></>;
      }))}
      <p class="note">Descriptor: a finger&rsquo;s contact time after the first finger&rsquo;s. Local curvature, for three fingers: speed × (t<sub>l</sub> − 2 t<sub>m</sub> + t<sub>r</sub>) / spacing², positive where the surface is convex. p: that measured and simulated touches come from one distribution, by permutation.</p>
    </Section>
  );
}

export function Compare() {
  const table = touches.value;
  const data = entry.value?.data;
  return table && data ? <TouchPlot table={table} data={data} /> : null;
}
