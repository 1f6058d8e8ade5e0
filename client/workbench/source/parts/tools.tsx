// Copying and saving: every chart and every table has them.
import { useState } from "preact/hooks";
import { type Row, copy, csvText, download, fileName, svgText } from "../charts/export";

export function CopyButton({ text, label = "Copy" }: { text: string; label?: string }) {
  const [said, setSaid] = useState("");
  const act = async () => {
    setSaid((await copy(text)) ? "Copied" : "Not allowed here");
    setTimeout(() => setSaid(""), 1500);
  };
  return <button type="button" class="small" onClick={act}>{said || label}</button>;
}

interface ToolsProps { title: string; rows(): Row[]; svg?: () => SVGSVGElement | null; under?: () => string }

export function Tools({ title, rows, svg, under }: ToolsProps) {
  const [said, setSaid] = useState("");
  const csv = async () => {
    const text = csvText(rows());
    if (await copy(text)) setSaid("copied");
    else download(fileName(title, "csv"), "text/csv", text);
    setTimeout(() => setSaid(""), 1500);
  };
  const picture = () => {
    const element = svg?.();
    if (element) download(fileName(title, "svg"), "image/svg+xml", svgText(element, under?.() ?? ""));
  };
  return (
    <span class="tools">
      <button type="button" onClick={csv} aria-label={`Copy the numbers of ${title} as CSV`}>{said || "CSV"}</button>
      {svg && <button type="button" onClick={picture} aria-label={`Save ${title} as an SVG picture`}>SVG</button>}
    </span>
  );
}
