// Small parts that several views share.
import { type ComponentChildren } from "preact";
import { hasInterval, interval, withError } from "../format";
import type { Value } from "../data/report";
import type { Row } from "../charts/export";
import { CopyButton, Tools } from "./tools";

export function Section({ id, title, lead, children }: { id: string; title: string; lead?: ComponentChildren; children: ComponentChildren }) {
  return (
    <section id={id} aria-labelledby={`${id}-title`}>
      <h2 id={`${id}-title`}>{title}</h2>
      {lead && <p class="lead">{lead}</p>}
      {children}
    </section>
  );
}

// `mark`: the noise floor, as a share of the width.
export function Bar({ share, tone, mark, second }: { share: number; tone: string; mark?: number; second?: number }) {
  const percent = (x: number) => `${Math.min(100, Math.max(0, Number.isFinite(x) ? 100 * x : 0))}%`;
  return (
    <svg class="bar" aria-hidden="true">
      <rect width="100%" height="100%" rx="2" fill="var(--track)" />
      <rect width={percent(share)} height="100%" rx="2" fill={`var(--${tone})`} />
      {second !== undefined && Number.isFinite(second) && <line x1={percent(second)} x2={percent(second)} y1="0" y2="100%" stroke="var(--ink)" stroke-width="2" />}
      {mark !== undefined && mark > 0 && <line x1={percent(mark)} x2={percent(mark)} y1="0" y2="100%" stroke="var(--ink)" stroke-width="1.5" stroke-dasharray="3 2.5" />}
    </svg>
  );
}

// Value and interval over zero: the upright line is no effect.
export function IntervalPicture({ value }: { value: Value }) {
  if (!hasInterval(value)) return null;
  const reach = Math.max(Math.abs(value.lower), Math.abs(value.upper)) * 1.05 || 1;
  const x = (of: number) => `${50 + (50 * of) / reach}%`;
  return (
    <svg class="interval" aria-hidden="true">
      <line x1="50%" x2="50%" y1="0" y2="100%" stroke="var(--axis)" />
      <line x1={x(value.lower)} x2={x(value.upper)} y1="50%" y2="50%" stroke="var(--better)" stroke-width="3" stroke-linecap="round" />
      <circle cx={x(value.value)} cy="50%" r="3.6" fill="var(--better)" />
    </svg>
  );
}

const maxValues = 4; // listed of one effect

// The values of an effect, a row each: name, value with error and unit, its interval.
export function ValueRows({ values }: { values: Value[] }) {
  const listed = values.slice(0, values.length > maxValues ? maxValues - 1 : maxValues);
  return (
    <div class="values">
      {listed.map((value) => <div title={interval(value) && `95 % interval ${interval(value)}`}><span class="soft">{[value.name, value.finger, value.object].filter(Boolean).join(" ")}</span><span class="nowrap">{withError(value)}</span><span><IntervalPicture value={value} /></span></div>)}
      {listed.length < values.length && <div><span class="soft">{values.length - listed.length} more</span></div>}
    </div>
  );
}

export interface Column { title: string; number?: boolean }

const shortRows = 12; // printed on one page

interface TableProps {
  title: string; columns: (Column | string)[]; rows: ComponentChildren[][]; csv?: () => Row[]; tone?: (row: number) => string | undefined;
  caption?: ComponentChildren;
  stacked?: boolean; // on a phone every row is a block, its cells below one another
}

export function Table({ title, columns, rows, csv, tone, caption, stacked }: TableProps) {
  const heads = columns.map((column) => (typeof column === "string" ? { title: column } : column));
  return (
    <figure class={`table${rows.length > shortRows ? "" : " short"}${stacked ? " stacked" : ""}`}>
      {csv && <div class="plot-head"><div class="plot-title">{title}</div><Tools title={title} rows={csv} /></div>}
      <div class="scroll" tabIndex={0} role="region" aria-label={title}>
        <table>
          <thead><tr>{heads.map((head) => (head.title ? <th scope="col" class={head.number ? "num" : undefined}>{head.title}</th> : <td />))}</tr></thead>
          <tbody>
            {rows.map((row, i) => (
              <tr class={tone?.(i)}>{row.map((cell, k) => <td class={heads[k]?.number ? "num" : undefined} data-title={stacked ? heads[k]?.title : undefined}>{cell}</td>)}</tr>
            ))}
          </tbody>
        </table>
      </div>
      {caption && <figcaption>{caption}</figcaption>}
    </figure>
  );
}

export function Code({ text, label }: { text: string; label: string }) {
  return (
    <div class="code">
      <pre tabIndex={0} role="region" aria-label={label}>{text}</pre>
      <CopyButton text={text} />
    </div>
  );
}

export function Terms({ terms }: { terms: [string, ComponentChildren][] }) {
  const known = terms.filter(([, text]) => text !== "" && text !== null && text !== undefined && text !== false);
  if (!known.length) return null;
  return <dl>{known.map(([term, text]) => <div><dt>{term}</dt><dd>{text}</dd></div>)}</dl>;
}

export function Key({ keys }: { keys: { colour: string; text: string }[] }) {
  return (
    <span class="keys">
      {keys.map(({ colour, text }) => <span><svg aria-hidden="true" width="11" height="11"><rect width="11" height="11" rx="3" fill={colour} /></svg>{text}</span>)}
    </span>
  );
}
