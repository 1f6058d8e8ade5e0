// A chart with two axes: lines, steps, whiskers and dots as SVG, a cloud of points on a canvas beneath.
import { type ComponentChildren } from "preact";
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { onPrint } from "../print";
import { theme } from "../state";
import { Tools } from "../parts/tools";
import { type Cloud, type Frame, cloudSvg, drawCloud, nearest } from "./cloud";
import type { Row } from "./export";
import { type Range, ticks, tickTexts } from "./scale";

export interface Axis { title: string; range: Range; labels?: string[] }

export type Mark =
  | { kind: "line"; points: [number, number][]; colour: string; dashed?: boolean }
  | { kind: "dots"; points: [number, number][]; colour: string }
  | { kind: "whiskers"; points: [number, number, number][]; colour: string }
  | { kind: "steps"; edges: number[]; values: number[]; colour: string; filled?: boolean }
  | { kind: "band"; low: number; high: number }
  // Between two limits that may differ from place to place, half a step to either side; the name stands at each limit.
  | { kind: "limits"; points: [number, number, number][]; names: [string, string] }
  // Each says what it is under the mouse; what is marked is a diamond in another colour.
  | { kind: "points"; points: { x: number; y: number; text: string; marked: boolean }[]; colour: string };

export interface PlotProps {
  title: string; // also of the files
  label: string; // for people who do not see it
  x: Axis; y: Axis; height: number; marks: Mark[]; cloud?: Cloud;
  rows(): Row[];
  onPick?(point: number): void;
  describe?(point: number): string;
  head?: ComponentChildren; caption?: ComponentChildren;
}

const right = 12, top = 10, bottom = 40;
const letter = 6.4; // px of a label

// Its width is that of its place.
function useWidth(): [(element: HTMLDivElement | null) => void, number] {
  const [width, setWidth] = useState(0);
  const observer = useRef<ResizeObserver | null>(null);
  const printed = useRef<(() => void) | null>(null);
  const attach = useRef((element: HTMLDivElement | null) => {
    observer.current?.disconnect();
    printed.current?.();
    if (!element) return;
    setWidth(element.clientWidth);
    printed.current = onPrint({ measure: () => setWidth(element.clientWidth) });
    observer.current = new ResizeObserver(() => setWidth(element.clientWidth));
    observer.current.observe(element);
  });
  return [attach.current, width];
}

function MarkShape({ mark, frame }: { mark: Mark; frame: Frame }) {
  const path = (points: [number, number][]) =>
    points.filter(([x, y]) => Number.isFinite(x) && Number.isFinite(y)).map(([x, y], i) => `${i ? "L" : "M"}${frame.x(x).toFixed(1)} ${frame.y(y).toFixed(1)}`).join("");
  switch (mark.kind) {
    case "line":
      return <path d={path(mark.points)} fill="none" stroke={mark.colour} stroke-width="1.8" stroke-linejoin="round" stroke-dasharray={mark.dashed ? "5 4" : undefined} />;
    case "dots":
      return <g fill={mark.colour}>{mark.points.filter(([, y]) => Number.isFinite(y)).map(([x, y]) => <circle cx={frame.x(x)} cy={frame.y(y)} r="2.6" />)}</g>;
    case "whiskers":
      return <path fill="none" stroke={mark.colour} stroke-width="1" opacity=".7"
        d={mark.points.filter((p) => p.every(Number.isFinite)).map(([x, low, high]) => `M${frame.x(x).toFixed(1)} ${frame.y(low).toFixed(1)}V${frame.y(high).toFixed(1)}`).join("")} />;
    case "steps": {
      const { edges, values } = mark;
      let d = `M${frame.x(edges[0])} ${frame.y(0)}`;
      values.forEach((value, i) => { d += `V${frame.y(Number.isFinite(value) ? value : 0).toFixed(1)}H${frame.x(edges[i + 1]).toFixed(1)}`; });
      d += `V${frame.y(0)}`;
      return mark.filled ? <path d={`${d}Z`} fill={mark.colour} /> : <path d={d} fill="none" stroke={mark.colour} stroke-width="1.6" />;
    }
    case "band":
      return <rect x="0" width={frame.width} y={frame.y(mark.high)} height={Math.max(0.5, frame.y(mark.low) - frame.y(mark.high))} fill="var(--band)" />;
    case "limits": {
      const half = frame.x(0.5) - frame.x(0);
      const edge = (of: 1 | 2) => mark.points.map((point) => `M${(frame.x(point[0]) - half).toFixed(1)} ${frame.y(point[of]).toFixed(1)}h${(2 * half).toFixed(1)}`).join("");
      const last = mark.points[mark.points.length - 1];
      return (
        <g class="limits">
          {mark.points.map(([x, low, high]) => <rect x={frame.x(x) - half} width={2 * half} y={frame.y(high)} height={Math.max(0.5, frame.y(low) - frame.y(high))} fill="var(--band)" />)}
          <path d={`${edge(1)}${edge(2)}`} fill="none" stroke="var(--floor)" stroke-dasharray="4 3" />
          {last && <g fill="var(--soft)" font-size="11.5" text-anchor="end">
            <text x={frame.x(last[0]) + half - 3} y={frame.y(last[2]) - 4}>{mark.names[1]}</text><text x={frame.x(last[0]) + half - 3} y={frame.y(last[1]) + 13}>{mark.names[0]}</text>
          </g>}
        </g>
      );
    }
    case "points":
      return <>{mark.points.map(({ x, y, text, marked }) => (
        <g class="named"><title>{text}</title>
          {marked
            ? <rect x={frame.x(x) - 4.5} y={frame.y(y) - 4.5} width="9" height="9" transform={`rotate(45 ${frame.x(x)} ${frame.y(y)})`} fill="var(--given)" stroke="var(--ink)" />
            : <circle cx={frame.x(x)} cy={frame.y(y)} r="3.8" fill={mark.colour} />}
        </g>))}</>;
  }
}

// Every label that has room, the last one always: those before it give way.
function labelTicks(labels: string[], width: number): number[] {
  const widest = Math.max(...labels.map((label) => label.length)) * letter + 10;
  const every = Math.max(1, Math.ceil((widest * labels.length) / width));
  return labels.map((_, i) => i).filter((i) => (labels.length - 1 - i) % every === 0);
}

export function Plot(props: PlotProps) {
  const [attach, full] = useWidth();
  const svg = useRef<SVGSVGElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const [hover, setHover] = useState("");
  const height = Math.max(40, props.height - top - bottom);
  const yTicks = ticks(props.y.range, Math.max(2, height / 45));
  const yTexts = tickTexts(yTicks);
  // Room for the widest label beside the title.
  const left = Math.max(52, 28 + letter * Math.max(0, ...yTexts.map((text) => text.length)));
  const width = Math.max(40, full - left - right);
  const along = (range: Range, size: number) => (value: number) => ((value - range[0]) / (range[1] - range[0])) * size;
  const across = along(props.x.range, width);
  const up = along(props.y.range, height);
  const frame: Frame = { x: across, y: (value) => height - up(value), width, height };
  const draw = () => { if (canvas.current && props.cloud && full > 0) drawCloud(canvas.current, props.cloud, frame); };
  useLayoutEffect(draw, [props.cloud, full, props.height, theme.value, ...props.x.range, ...props.y.range]);
  useEffect(() => {
    const query = matchMedia("(prefers-color-scheme: dark)");
    query.addEventListener("change", draw);
    return () => query.removeEventListener("change", draw);
  });
  const at = (event: MouseEvent) => {
    const box = canvas.current!.getBoundingClientRect();
    return nearest(props.cloud!, frame, event.clientX - box.left, event.clientY - box.top);
  };
  const move = (event: MouseEvent) => {
    const point = at(event);
    setHover(point >= 0 && props.describe ? props.describe(point) : "");
  };
  const xTicks = props.x.labels ? labelTicks(props.x.labels, width) : ticks(props.x.range, Math.max(2, width / 80));
  const xTexts = props.x.labels ? xTicks.map((x) => props.x.labels![x]) : tickTexts(xTicks);
  // The last name of a place may end at the edge.
  const atEdge = (i: number) => !!props.x.labels && frame.x(xTicks[i]) + (letter / 2) * xTexts[i].length > width + right;
  return (
    <figure class="plot">
      <div class="plot-head">
        <div class="plot-title">{props.head ?? props.title}</div>
        <Tools title={props.title} rows={props.rows} svg={() => svg.current} under={() =>
          props.cloud ? `<g transform="translate(${left} ${top})" fill="none">${cloudSvg(props.cloud, frame)}</g>` : ""} />
      </div>
      <div class="plot-body" ref={attach} style={{ height: `${props.height}px` }}>
        {full > 0 && (
          <>
            {props.cloud && (
              <canvas ref={canvas} class={props.onPick ? "cloud pick" : "cloud"} aria-hidden="true" onClick={(event) => { const point = at(event); if (point >= 0) props.onPick?.(point); }}
                onMouseMove={props.describe ? move : undefined} onMouseLeave={() => setHover("")}
                style={{ left: `${left}px`, top: `${top}px`, width: `${width}px`, height: `${height}px` }} />
            )}
            <svg ref={svg} width={full} height={props.height} viewBox={`0 0 ${full} ${props.height}`} role="img" aria-label={props.label}>
              <g transform={`translate(${left} ${top})`}>
                {yTicks.map((y) => <line x1="0" x2={width} y1={frame.y(y)} y2={frame.y(y)} stroke={y === 0 ? "var(--axis)" : "var(--grid)"} />)}
                {!props.x.labels && xTicks.map((x) => <line y1="0" y2={height} x1={frame.x(x)} x2={frame.x(x)} stroke="var(--grid)" />)}
                {props.marks.map((mark) => <MarkShape mark={mark} frame={frame} />)}
                <g fill="var(--soft)" font-size="11.5">
                  {yTicks.map((y, i) => <text x="-8" y={frame.y(y) + 4} text-anchor="end">{yTexts[i]}</text>)}
                  {xTicks.map((x, i) => <text x={atEdge(i) ? width + right : frame.x(x)} y={height + 17} text-anchor={atEdge(i) ? "end" : "middle"}>{xTexts[i]}</text>)}
                </g>
                <g fill="var(--soft)" font-size="12">
                  <text x={width} y={height + 34} text-anchor="end">{props.x.title}</text>
                  <text text-anchor="middle" transform={`translate(${12 - left} ${height / 2}) rotate(-90)`}>{props.y.title}</text>
                </g>
              </g>
            </svg>
          </>
        )}
        {hover && <div class="hover" role="status">{hover}</div>}
      </div>
      {props.caption && <figcaption>{props.caption}</figcaption>}
    </figure>
  );
}
