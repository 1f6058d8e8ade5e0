// A second report pinned as the baseline: what differs first, what is equal folded.
import { useState } from "preact/hooks";
import { Section, Table } from "../parts/parts";
import { differences, type Difference } from "../data/differences";
import { parseOtherReport } from "../data/load";
import { baseline, page } from "../state";

function Rows({ rows, title }: { rows: Difference[]; title: string }) {
  return <Table title={title} columns={["", "", { title: "baseline", number: true }, { title: "this report", number: true }, { title: "change", number: true }]} rows={rows.map((row) => [row.part, row.name, row.from, row.to, row.change])}
    csv={() => [["part", "name", "baseline", "this report", "change"], ...rows.map((row) => [row.part, row.name, row.from, row.to, row.change])]} />;
}

export function Baseline() {
  const [failed, setFailed] = useState("");
  const read = async (file: File | undefined) => {
    if (!file) return;
    try {
      baseline.value = { name: file.name, report: parseOtherReport(await file.text()) };
      setFailed("");
    } catch (reason) {
      setFailed(`${file.name}: ${reason instanceof Error ? reason.message : String(reason)}`);
    }
  };
  const other = baseline.value;
  const rows = other ? differences(other.report, page.value!.report) : [];
  const changed = rows.filter((row) => row.from !== row.to);
  const equal = rows.filter((row) => row.from === row.to);
  return (
    <Section id="baseline" title="Against another report" lead="Pin a report of another model or session (its HTML or JSON file): what differs stands first.">
      <p class="row"><label class="file">Baseline <input type="file" accept=".html,.json" onChange={(event) => void read(event.currentTarget.files?.[0])} /></label>{other && <><span>{other.name}</span><button type="button" class="small" onClick={() => { baseline.value = null; }}>Unpin</button></>}</p>
      {failed && <p class="failed" role="alert">{failed}</p>}
      {other && (changed.length ? <Rows rows={changed} title="Differences" /> : <p class="empty">The two reports say the same.</p>)}
      {other && equal.length > 0 && <details><summary>{equal.length} equal</summary><Rows rows={equal} title="Equal in both" /></details>}
    </Section>
  );
}
