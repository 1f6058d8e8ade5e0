// The object: its mesh with the residuals painted on, every contact, the selected touch with its fingers, the next touches.
import { useEffect, useRef, useState } from "preact/hooks";
import { css, diverging, isDark, rgbOf } from "../colour";
import { tickText } from "../charts/scale";
import { Tools } from "../parts/tools";
import { count, error, isPictures, unitFor } from "../format";
import { paint, refined, unpacked } from "../object/paint";
import { movingPoints, type ObjectScene, type Rod } from "../object/scene";
import { imageOf, overlayOf, Stage } from "../object/stage";
import { entry, improved, limit as colourScale, object, page, selectTouch, shown, theme, touchIndex, touches, walk } from "../state";
import type { Touches } from "../data/touches";
import type { DataReport } from "../data/report";
import { describeCell } from "./compare";

// Of the object that is shown: cells of the table, in the order of the dots.
function cellsOf(table: Touches, name: string): number[] {
  const wanted = table.objects.indexOf(name);
  const list: number[] = [];
  for (let cell = 0; cell < table.cells; ++cell) if (table.object[table.touchOf(cell)] === wanted && !Number.isNaN(table.residual[cell])) list.push(cell);
  return list;
}

function contactsOf(table: Touches, cells: number[]): Float32Array {
  const positions = new Float32Array(3 * cells.length);
  cells.forEach((cell, i) => { for (let k = 0; k < 3; ++k) positions[3 * i + k] = table.contact[3 * cell + k]; });
  return positions;
}

function objectToShow(table: Touches, data: DataReport): string {
  if (object.value !== null) return object.value;
  if (touchIndex.value !== null) return table.objects[table.object[touchIndex.value]];
  const groups = data.groups.filter((group) => group.kind === "OBJECT").sort((a, b) => b.share_of_excess_error - a.share_of_excess_error);
  return groups[0]?.name ?? table.objects[0] ?? "";
}

function Scale({ limit, data }: { limit: number; data: DataReport }) {
  const unit = unitFor(data.kind, limit);
  const steps = 41;
  const x = (value: number) => 10 + 140 * (value / limit + 1);
  const floor = data.noise_floor;
  return (
    <svg class="colour-scale" viewBox="0 0 300 52" role="img" aria-label={`Colours: blue ${error(data.kind, limit)} earlier than simulated, grey none, orange later`}>
      {Array.from({ length: steps }, (_, i) => <rect x={10 + (280 * i) / steps} y="4" width={280 / steps + 0.5} height="12" fill={css(diverging((2 * i) / (steps - 1) - 1))} />)}
      {floor > 0 && floor < limit && [-floor, floor].map((value) => <line x1={x(value)} x2={x(value)} y1="1" y2="19" stroke="var(--ink)" stroke-width="1.5" />)}
      <g fill="var(--soft)" font-size="11" text-anchor="middle">
        {[-limit, 0, limit].map((value) => <text x={Math.min(278, Math.max(22, x(value)))} y="31">{value > 0 ? "+" : ""}{tickText(Number((value * unit.factor).toPrecision(3)))}</text>)}
        <text x="10" y="46" text-anchor="start">earlier</text><text x="150" y="46">residual ({unit.symbol}){floor > 0 && floor < limit ? "; bars: noise floor" : ""}</text><text x="290" y="46" text-anchor="end">later</text>
      </g>
    </svg>
  );
}

// Of the model's predictions, from the surest contact to the least sure one, x from 0 to 1: never the grey of what was not measured.
const unsureColour = (x: number, night = isDark()) => diverging(0.25 + 0.75 * x, night);

function UncertaintyScale({ low, high, data }: { low: number; high: number; data: DataReport }) {
  const steps = 41;
  return (
    <svg class="colour-scale" viewBox="0 0 300 52" role="img" aria-label={`Painted: standard uncertainty from ${error(data.kind, low)}, pale orange, to ${error(data.kind, high)}, orange`}>
      {Array.from({ length: steps }, (_, i) => <rect x={10 + (280 * i) / steps} y="4" width={280 / steps + 0.5} height="12" fill={css(unsureColour(i / (steps - 1)))} />)}
      <g fill="var(--soft)" font-size="11">
        <text x="10" y="31">{error(data.kind, low)}</text><text x="290" y="31" text-anchor="end">{error(data.kind, high)}</text>
        <text x="150" y="46" text-anchor="middle">painted: standard uncertainty of a predicted time</text>
      </g>
    </svg>
  );
}

const along = (from: number[], direction: number[], length: number) => from.map((x, k) => x + length * direction[k]);

function touchRods(table: Touches, n: number, size: number, limit: number): Rod[] {
  const approach = [0, 1, 2].map((k) => table.approach[3 * n + k]);
  const values = table.residuals(improved.value);
  return table.cellsOf(n).flatMap((cell): Rod[] => {
    const contact = [0, 1, 2].map((k) => table.contact[3 * cell + k]);
    if (contact.some(Number.isNaN)) return [];
    return [{ from: along(contact, approach, -0.42 * size), to: contact, colour: rgbOf(`--f${table.fingerOf(cell) % 6}`), width: 0.009 * size, tip: "ball", tipColour: diverging(values[cell] / limit) }];
  });
}

export function ObjectView() {
  const table = touches.value;
  const data = entry.value?.data;
  const [scene, setScene] = useState<ObjectScene | null>(null);
  const [painted, setPainted] = useState(true);
  const [unsure, setUnsure] = useState(false); // painted in the place of the residuals
  const name = table && data ? objectToShow(table, data) : "";
  const limit = colourScale.value;
  const cells = useRef<{ of: string; table: Touches | null; list: number[] }>({ of: "", table: null, list: [] });
  if (table && (cells.current.of !== name || cells.current.table !== table)) cells.current = { of: name, table, list: cellsOf(table, name) };
  const list = cells.current.list;
  const sureness = data && page.value!.words.of_data[page.value!.report.data.indexOf(data)]?.uncertainty?.[name];
  const uncertainty = unsure && sureness ? unpacked(sureness) : null;
  const mesh = useRef<ReturnType<typeof refined> | null>(null);

  useEffect(() => {
    if (!scene || !table || !data) return;
    const outline = data.outlines.find((one) => one.object === name);
    mesh.current = outline ? refined(outline.vertices_mm, outline.triangles) : null;
    scene.setMesh(mesh.current, contactsOf(table, list));
  }, [scene, table, name]);

  const mask = shown.value;
  const night = isDark();
  useEffect(() => {
    if (!scene || !table) return;
    const values = table.residuals(improved.value);
    const positions = contactsOf(table, list);
    const palette = Array.from({ length: 256 }, (_, i) => diverging(i / 127.5 - 1, night));
    const tone = (value: number) => palette[Math.min(255, Math.max(0, Math.round(127.5 * (value / limit + 1))))] ?? palette[128];
    const colours = new Uint8Array(3 * list.length);
    const seen = new Uint8Array(list.length);
    list.forEach((cell, i) => {
      colours.set(tone(values[cell]), 3 * i);
      seen[i] = mask[cell];
    });
    scene.setContacts({ positions, colours, shown: seen });
    if (mesh.current) {
      const solid = rgbOf("--solid");
      const known = list.filter((cell) => mask[cell] && !Number.isNaN(values[cell]) && !Number.isNaN(table.contact[3 * cell]));
      const from = painted ? known : [];
      if (painted && uncertainty) {
        const { points, values: unsureBy, low, high } = uncertainty;
        scene.paint(paint(mesh.current, points, unsureBy, 0.055 * scene.size, solid, (value) => unsureColour((value - low) / (high - low), night)));
      } else scene.paint(paint(mesh.current, contactsOf(table, from), Float32Array.from(from, (cell) => values[cell]), 0.055 * scene.size, solid, tone));
    }
  }, [scene, table, name, mask, improved.value, night, painted, unsure, theme.value]);

  const next = page.value!.report.next.map((one, i) => ({ one, i })).filter(({ one }) => one.touch && one.object === name);
  const arrows = scene ? next.map(({ one, i }) => {
    const target = [one.touch!.target_m.x, one.touch!.target_m.y, one.touch!.target_m.z].map((x) => 1000 * x);
    const approach = [one.touch!.approach.x, one.touch!.approach.y, one.touch!.approach.z];
    const out = along(target, approach, -0.5 * scene.size);
    return { from: along(out, approach, -0.16 * scene.size), to: out, label: along(out, approach, -0.2 * scene.size), text: String(i + 1) };
  }) : [];
  useEffect(() => {
    if (!scene || !table) return;
    const onIt = touchIndex.value !== null && table.objects[table.object[touchIndex.value]] === name;
    scene.setRods([...(onIt ? touchRods(table, touchIndex.value!, scene.size, limit) : []), ...arrows.map(({ from, to }): Rod => ({ from, to, colour: rgbOf("--next"), width: 0.007 * scene.size, tip: "cone" }))]);
  }, [scene, table, name, touchIndex.value, improved.value, theme.value, night]);

  if (!table || !data || isPictures(data.kind)) return null;
  return (
    <figure class="object-view">
      <div class="plot-head">
        <div class="plot-title"><b>{name}</b> <span class="soft">{count(list.length)} contacts</span></div>
        <label class="check"><input type="checkbox" checked={painted} onChange={(event) => setPainted(event.currentTarget.checked)} /> paint</label>
        {sureness && <label class="check"><input type="checkbox" checked={unsure} disabled={!painted} onChange={(event) => setUnsure(event.currentTarget.checked)} /> uncertainty</label>}
        <Tools title={`Residuals on ${name}`} svg={() => overlayOf(scene)} under={() => imageOf(scene)}
          rows={() => [["touch", "finger", "x_mm", "y_mm", "z_mm", `residual_${data.unit}`, `after_${data.unit}`], ...list.filter((cell) => mask[cell]).map((cell) => [table.number[table.touchOf(cell)], table.names[table.fingerOf(cell)], table.contact[3 * cell], table.contact[3 * cell + 1], table.contact[3 * cell + 2], table.residual[cell], table.after[cell]])]} />
      </div>
      <Stage many={list.length > movingPoints} label={`Residuals on ${name}. Arrow keys turn it, plus and minus zoom, Enter goes to the next touch, the worst first.`} labels={arrows.map(({ label, text }) => ({ at: label, text }))} onScene={setScene}
        describe={(dot) => describeCell(table, data.kind, list[dot])} onPick={(dot) => selectTouch(dot >= 0 ? table.touchOf(list[dot]) : null)} onEnter={() => walk(1)} />
      <figcaption><div><Scale limit={limit} data={data} />{painted && uncertainty && <UncertaintyScale low={uncertainty.low} high={uncertainty.high} data={data} />}</div><span>{painted && uncertainty && "Painted is how sure the improved model is of a contact time; where it is grey nothing was measured near. "}Each dot is one finger&rsquo;s contact, where the given model puts it{painted && uncertainty ? "." : "; between them their mean is painted."}{list.length > movingPoints && ` While it turns, an even sample of ${count(movingPoints)} is drawn.`}{next.length > 0 && " Numbered arrows: the next touches."}</span></figcaption>
    </figure>
  );
}
