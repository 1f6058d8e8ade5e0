// What the dry run would touch, on the object: every touch in its order, the path of the tip, and what the rig cannot make.
import { useEffect, useMemo, useState } from "preact/hooks";
import { type RGB, isDark, rgbOf } from "../colour";
import { type DrawnTouch, type PlanDrawing, desk, planDrawing } from "../data/rig";
import { count } from "../format";
import { refined } from "../object/paint";
import { firstHit } from "../object/ray";
import { type Line, type ObjectScene, type Rod, type View, movingPoints } from "../object/scene";
import { Stage, imageOf, overlayOf } from "../object/stage";
import { Tools } from "../parts/tools";
import { theme } from "../state";

interface Planned { touch: DrawnTouch; possible: boolean; reason: string; contacts: number[][] } // contacts: per finger, mm

const along = (from: number[], direction: number[], length: number) => from.map((x, k) => x + length * direction[k]);

// Where each finger would meet the object; without a mesh, where the touch aims.
function contactsOf(touch: DrawnTouch, fingers: number, spacingMm: number, mesh: { vertices_mm: number[]; triangles: number[] }): number[][] {
  return Array.from({ length: fingers }, (_, i) => {
    const aim = along(touch.target_mm, touch.lateral, (i - (fingers - 1) / 2) * spacingMm);
    const start = along(aim, touch.approach, -touch.standoff_mm);
    const far = firstHit(start, touch.approach, mesh.vertices_mm, mesh.triangles);
    return Number.isFinite(far) ? along(start, touch.approach, far) : aim;
  });
}

// The edges of a box, as pairs of points.
function boxEdges([x0, y0, z0]: number[], [x1, y1, z1]: number[]): number[] {
  const corner = (i: number) => [i & 1 ? x1 : x0, i & 2 ? y1 : y0, i & 4 ? z1 : z0];
  return Array.from({ length: 8 }, (_, i) => [1, 2, 4].filter((bit) => !(i & bit)).flatMap((bit) => [...corner(i), ...corner(i | bit)])).flat();
}

// From beside the way that most touches come, so near that their beginnings are seen.
function viewOf(planned: Planned[]): View {
  const [x, y, z] = [0, 1, 2].map((k) => -planned.reduce((sum, one) => sum + one.touch.approach[k], 0) / planned.length);
  const level = Math.hypot(x, y);
  return { azimuth: level > 0.3 ? Math.atan2(y, x) + 0.5 : 0.9, elevation: 0.7 * Math.atan2(z, level) + 0.3, zoom: 0.72 };
}

const pairs = (path: number[]) => Array.from({ length: Math.max(0, path.length / 3 - 1) }, (_, i) => path.slice(3 * i, 3 * i + 6)).flat();
const mixed = (from: RGB, to: RGB, share: number) => from.map((x, k) => Math.round(x + share * (to[k] - x))) as RGB;

export function PlannedView() {
  const [drawing, setDrawing] = useState<PlanDrawing | null>(null);
  const [failed, setFailed] = useState("");
  const check = desk.value!.check;
  useEffect(() => {
    setFailed("");
    void planDrawing().then(setDrawing, (reason: Error) => setFailed(reason.message));
  }, [check]);
  if (failed) return <p class="failed" role="alert">The planned touches are not drawn: {failed}</p>;
  if (!drawing || drawing.check !== check) return <p class="soft" role="status">Drawing the planned touches.</p>;
  return drawing.setups.length || drawing.impossible.length ? <PlannedScene key={check} drawing={drawing} /> : null;
}

function PlannedScene({ drawing }: { drawing: PlanDrawing }) {
  const [scene, setScene] = useState<ObjectScene | null>(null);
  const [setup, setSetup] = useState(0);
  const [wanted, setAt] = useState<number | null>(null); // of the setup's touches, then of the impossible ones; null: the last that is made
  const { fingers, spacing_m } = desk.value!.rig;
  const shown = drawing.setups[setup];
  const object = drawing.objects[shown?.object ?? drawing.impossible[0].object];
  const planned = useMemo(() => {
    const made = (touch: DrawnTouch, possible: boolean, reason = ""): Planned => ({ touch, possible, reason, contacts: contactsOf(touch, fingers ?? 3, 1000 * (spacing_m ?? 0), object) });
    return [...(shown?.touches ?? []).map((touch) => made(touch, true)), ...drawing.impossible.filter((one) => drawing.objects[one.object] === object).map((one) => made(one, false, one.reason))];
  }, [drawing, setup]);
  const possible = shown?.touches.length ?? 0;
  const at = wanted ?? Math.max(0, possible - 1);
  const chosen = planned[at];
  const night = isDark();
  const describe = (one: Planned) => `${one.possible ? `${planned.indexOf(one) + 1} of ${possible}: ` : "impossible: "}touch ${one.touch.touch}${one.reason && `, ${one.reason}`}`;

  useEffect(() => {
    if (!scene) return;
    const mesh = object.triangles.length ? refined(object.vertices_mm, object.triangles) : null;
    const box = object.low_mm && object.high_mm ? boxEdges(object.low_mm, object.high_mm) : [];
    scene.setMesh(mesh, Float32Array.from(box.length ? box : planned.flatMap((one) => one.contacts.flat())));
    const solid = rgbOf("--solid");
    if (mesh) scene.paint(Uint8Array.from(mesh.positions, (_, i) => solid[i % 3]));
  }, [scene, object, night, theme.value]);
  useEffect(() => { if (scene) { scene.view = viewOf(planned); scene.draw(); } }, [scene, planned]);

  useEffect(() => {
    if (!scene) return;
    const [pale, deep, wrong, path, ink] = ["--paper", "--better", "--given", "--axis", "--ink"].map(rgbOf);
    const positions = Float32Array.from(planned.flatMap((one) => one.contacts.flat()));
    const colours = Uint8Array.from(planned.flatMap((one, i) => one.contacts.flatMap(() => (one.possible ? mixed(pale, deep, possible > 1 ? i / (possible - 1) : 1) : wrong))));
    // What is made up to the chosen one stands out.
    const seen = Uint8Array.from(planned.flatMap((one, i) => one.contacts.map(() => (!one.possible || i <= at ? 1 : 0))));
    scene.setContacts({ positions, colours, shown: seen });
    const box = !object.triangles.length && object.low_mm && object.high_mm ? boxEdges(object.low_mm, object.high_mm) : [];
    const lines: Line[] = [{ points: box, colour: ink }, { points: planned.filter((one, i) => one.possible && i <= at).flatMap((one) => pairs(one.touch.path_mm)), colour: path }];
    scene.setLines(lines);
    const size = scene.size;
    const rods = (chosen?.contacts ?? []).map((contact, f): Rod => ({ from: along(contact, chosen.touch.approach, -Math.min(chosen.touch.standoff_mm, 0.45 * size)), to: contact, colour: chosen.possible ? rgbOf(`--f${f % 6}`) : wrong, width: 0.008 * size, tip: "cone" }));
    scene.setRods([...rods, ...rodsOfPath(chosen?.touch.path_mm ?? [], chosen?.possible ? deep : wrong, 0.003 * size)]);
  }, [scene, planned, at, night, theme.value]);

  const label = (index: number) => ({ at: along(planned[index].contacts[0], planned[index].touch.approach, -0.16 * (scene?.size ?? 1)), text: String(index + 1) });
  const labels = scene && possible ? [...new Set([0, Math.min(at, possible - 1), possible - 1])].map(label) : [];
  return (
    <figure class="object-view planned">
      <div class="plot-head">
        <div class="plot-title"><b>{object.name}</b> <span class="soft">{shown && `face ${shown.up_face} up, `}{count(possible)} planned{planned.length > possible && `, ${count(planned.length - possible)} impossible`}</span></div>
        {drawing.setups.length > 1 && <label class="check">Setup <select value={setup} onChange={(event) => { setSetup(Number(event.currentTarget.value)); setAt(null); }}>{drawing.setups.map((one, i) => <option value={i}>{i + 1}: {drawing.objects[one.object].name}, face {one.up_face} up</option>)}</select></label>}
        <Tools title={`Planned touches of ${object.name}`} svg={() => overlayOf(scene)} under={() => imageOf(scene)}
          rows={() => [["order", "touch", "possible", "reason", "finger", "x_mm", "y_mm", "z_mm"], ...planned.flatMap((one, i) => one.contacts.map((contact, f) => [one.possible ? i + 1 : "", one.touch.touch, one.possible ? "yes" : "no", one.reason, f + 1, ...contact.map((x) => Number(x.toFixed(2)))]))]} />
      </div>
      <Stage many={3 * planned.length > movingPoints} label={`Planned touches of ${object.name}. Arrow keys turn it, plus and minus zoom, Enter goes to the next touch.`} labels={labels} onScene={setScene}
        describe={(dot) => describe(planned[Math.floor(dot / (fingers ?? 3))])} onPick={(dot) => { if (dot >= 0) setAt(Math.floor(dot / (fingers ?? 3))); }} onEnter={() => setAt((at + 1) % planned.length)} />
      <label class="planned-order">Order <input type="range" min={0} max={planned.length - 1} value={at} aria-valuetext={chosen && describe(chosen)} onInput={(event) => setAt(Number(event.currentTarget.value))} /> <output>{chosen && describe(chosen)}</output></label>
      <figcaption>
        {object.triangles.length ? "Each dot is where one finger would meet the object" : "Each dot is where one finger aims; the mesh is not here, and its box is drawn"}; first <span class="order-key" aria-hidden="true" /> last. {planned.length > possible && "Orange: the rig cannot make it. "}The line is the way of the tip up to the chosen touch, as the gateway checked it; way and order start where the rig stands now.
        {drawing.touches > drawing.setups.reduce((sum, one) => sum + one.touches.length, drawing.impossible.length) && ` Of ${count(drawing.touches)} touches an even sample is drawn.`}
      </figcaption>
    </figure>
  );
}

const rodsOfPath = (path: number[], colour: RGB, width: number): Rod[] =>
  Array.from({ length: Math.max(0, path.length / 3 - 1) }, (_, i) => ({ from: path.slice(3 * i, 3 * i + 3), to: path.slice(3 * i + 3, 3 * i + 6), colour, width }));
