// The picture of an object, and what a person does with it: turn it, come nearer, point at a dot, pick one.
import { useEffect, useRef, useState } from "preact/hooks";
import { tickText } from "../charts/scale";
import { onPrint } from "../print";
import { ObjectScene } from "./scene";

// A length that is round and at most 110 px.
function scaleBar(pixelsPerMm: number): { mm: number; px: number } {
  const most = 110 / pixelsPerMm;
  const power = 10 ** Math.floor(Math.log10(most));
  const mm = ([5, 2, 1].find((round) => round * power <= most) ?? 1) * power;
  return { mm, px: mm * pixelsPerMm };
}

function Overlay({ scene, labels }: { scene: ObjectScene; labels: { at: number[]; text: string }[] }) {
  const [, redraw] = useState(0);
  useEffect(() => { scene.onDraw = () => redraw((n) => n + 1); redraw(1); }, [scene]);
  const { clientWidth: width, clientHeight: height } = scene.canvas;
  const origin = scene.project(0, 0, 0);
  const bar = scaleBar(scene.pixelsPerMm());
  const axis = (k: number) => {
    const tip = scene.project(k === 0 ? 1 : 0, k === 1 ? 1 : 0, k === 2 ? 1 : 0);
    const factor = 30 / scene.pixelsPerMm();
    return [(tip.x - origin.x) * factor, (tip.y - origin.y) * factor];
  };
  if (!Number.isFinite(bar.px) || !width) return null;
  return (
    <svg class="overlay" viewBox={`0 0 ${width} ${height}`} aria-hidden="true">
      <g transform={`translate(44 ${height - 44})`}>
        {["x", "y", "z"].map((name, k) => { const [x, y] = axis(k); return <><line x2={x} y2={y} stroke="var(--ink)" stroke-width="1.6" /><text x={x * 1.28} y={y * 1.28 + 4} text-anchor="middle" font-size="12" fill="var(--ink)">{name}</text></>; })}
      </g>
      <g transform={`translate(${width - 14} ${height - 16})`}>
        <path d={`M${-bar.px} -5V0H0V-5`} fill="none" stroke="var(--ink)" stroke-width="1.6" /><text x={-bar.px / 2} y="-7" text-anchor="middle" font-size="12" fill="var(--ink)">{tickText(Number(bar.mm.toPrecision(3)))} mm</text>
      </g>
      {labels.map(({ at, text }) => { const p = scene.project(at[0], at[1], at[2]); return <text x={p.x} y={p.y} font-size="13" font-weight="700" text-anchor="middle" fill="var(--ink)" paint-order="stroke" stroke="var(--paper)" stroke-width="3">{text}</text>; })}
    </svg>
  );
}

// Between two events of a pointer the view may be drawn anew.
const drag: { current: { held: [number, number] | null; moved: number } } = { current: { held: null, moved: 0 } };

interface StageProps {
  many: boolean; // dots: then their edges are not smooth
  label: string; // for people who do not see it
  labels: { at: number[]; text: string }[]; // mm
  onScene(scene: ObjectScene | null): void;
  describe(dot: number): string;
  onPick(dot: number): void; // -1: none
  onEnter(): void; // the key
}

export function Stage({ many, label, labels, onScene, describe, onPick, onEnter }: StageProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [scene, setScene] = useState<ObjectScene | null>(null);
  const [failed, setFailed] = useState("");
  const [hover, setHover] = useState("");
  useEffect(() => {
    let made: ObjectScene;
    try {
      made = new ObjectScene(canvas.current!, many);
    } catch {
      setFailed("This browser has no WebGL, which the object needs; every other view works without it.");
      return;
    }
    const observer = new ResizeObserver(() => made.resize(made.canvas.clientWidth, made.canvas.clientHeight));
    observer.observe(made.canvas);
    setScene(made);
    onScene(made);
    const paper = document.createElement("canvas");
    paper.className = "paper";
    const printed = onPrint({ draw: () => { made.copyTo(paper); made.canvas.after(paper); }, after: () => paper.remove() });
    return () => { printed(); observer.disconnect(); made.dispose(); onScene(null); };
  }, []);
  const place = (event: PointerEvent | MouseEvent): [number, number] => { const box = canvas.current!.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  const down = (event: PointerEvent) => { drag.current = { held: [event.clientX, event.clientY], moved: 0 }; canvas.current!.setPointerCapture(event.pointerId); scene?.hold(true); };
  const move = (event: PointerEvent) => {
    if (!scene) return;
    const now = drag.current;
    if (now.held) {
      const [dx, dy] = [event.clientX - now.held[0], event.clientY - now.held[1]];
      now.moved += Math.abs(dx) + Math.abs(dy);
      now.held = [event.clientX, event.clientY];
      scene.turn(dx * 0.009, dy * 0.009);
    } else {
      const at = scene.pick(...place(event));
      setHover(at >= 0 ? describe(at) : "");
    }
  };
  const up = (event: PointerEvent) => {
    const moved = drag.current.moved;
    drag.current = { held: null, moved: 0 };
    scene?.hold(false);
    if (moved <= 4 && scene) onPick(scene.pick(...place(event)));
  };
  const keys: Record<string, () => void> = {
    ArrowLeft: () => scene?.turn(0.12, 0), ArrowRight: () => scene?.turn(-0.12, 0), ArrowUp: () => scene?.turn(0, 0.12), ArrowDown: () => scene?.turn(0, -0.12),
    "+": () => scene?.zoom(1.2), "=": () => scene?.zoom(1.2), "-": () => scene?.zoom(1 / 1.2), Enter: onEnter,
  };
  return (
    <div class="stage">
      {failed ? <p class="empty">{failed}</p> : (
        <canvas ref={canvas} tabIndex={0} role="application" aria-label={label}
          onPointerDown={down} onPointerMove={move} onPointerUp={up} onPointerCancel={() => { drag.current = { held: null, moved: 0 }; scene?.hold(false); }} onPointerLeave={() => setHover("")}
          onWheel={(event) => { if (event.ctrlKey) { event.preventDefault(); scene?.zoom(event.deltaY < 0 ? 1.1 : 1 / 1.1); } }}
          onKeyDown={(event) => { const act = keys[event.key]; if (act && !event.ctrlKey) { event.preventDefault(); act(); } }} />
      )}
      {scene && <Overlay scene={scene} labels={labels} />}
      <span class="zoom"><button type="button" aria-label="Nearer" onClick={() => scene?.zoom(1.25)}>+</button><button type="button" aria-label="Farther" onClick={() => scene?.zoom(1 / 1.25)}>−</button></span>
      {hover && <div class="hover" role="status">{hover}</div>}
    </div>
  );
}

// Of the picture as a file: the drawing over it, and itself.
export const overlayOf = (scene: ObjectScene | null) => scene?.canvas.parentElement?.querySelector<SVGSVGElement>("svg.overlay") ?? null;
export const imageOf = (scene: ObjectScene | null) => (scene ? `<image width="${scene.canvas.clientWidth}" height="${scene.canvas.clientHeight}" href="${scene.picture()}"/>` : "");
