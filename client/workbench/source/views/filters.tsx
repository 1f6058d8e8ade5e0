// What is selected, always in sight: the same for every view.
import { clearFilters, entry, finger, hasImproved, improved, object, page, selectTouch, session, shownTouches, slice, touch, touchEntries, touches, walk } from "../state";
import { count, typeset } from "../format";

function Chip({ text, clear }: { text: string; clear(): void }) {
  return <button type="button" class="chip" onClick={clear} aria-label={`Remove the filter ${text}`}>{text} <span aria-hidden="true">×</span></button>;
}

export function Filters() {
  const table = touches.value;
  const data = entry.value?.data;
  if (!table || !data) return null;
  const all = shownTouches.value.length === table.size;
  const any = slice.value !== null || object.value !== null || finger.value !== null || touch.value !== null;
  return (
    <div class="filters" role="toolbar" aria-label="What every view shows">
      <strong class="filter-count" aria-live="polite" data-shown={shownTouches.value.length}>{all ? `All ${count(table.size)}` : `${count(shownTouches.value.length)} of ${count(table.size)}`} touches</strong>
      {table.inAll > table.size && <span class="soft">a sample of {count(table.inAll)}</span>}
      {slice.value !== null && data.where[slice.value] && <Chip text={typeset(data.where[slice.value].slice)} clear={() => { slice.value = null; }} />}
      {touch.value !== null && <Chip text={`touch ${touch.value}`} clear={() => selectTouch(null)} />}
      <label>Object <select value={object.value ?? ""} onChange={(event) => { object.value = event.currentTarget.value || null; }}>
        <option value="">all</option>{table.objects.map((name) => <option value={name}>{name}</option>)}</select></label>
      <span class="segments" role="group" aria-label="Finger">
        {table.names.map((name, f) => <button type="button" aria-pressed={finger.value === f} onClick={() => { finger.value = finger.value === f ? null : f; }}>
          <svg aria-hidden="true" width="9" height="9"><circle cx="4.5" cy="4.5" r="4.5" fill={`var(--f${f % 6})`} /></svg>{name}</button>)}
      </span>
      {hasImproved.value && <span class="segments" role="group" aria-label="Residuals of">
        <button type="button" aria-pressed={!improved.value} onClick={() => { improved.value = false; }}>given model</button>
        <button type="button" aria-pressed={improved.value} onClick={() => { improved.value = true; }}>improved</button>
      </span>}
      {touchEntries.value.length > 1 && <label>Session <select value={String(entry.value?.index ?? 0)} onChange={(event) => { session.value = Number(event.currentTarget.value); clearFilters(); }}>
        {touchEntries.value.map(({ data: one, index }) => <option value={String(index)}>{one.session || page.value!.words.of_data[index].kind_name}</option>)}</select></label>}
      <span class="segments" role="group" aria-label="Touch by touch, the worst first">
        <button type="button" onClick={() => walk(-1)} disabled={!shownTouches.value.length} aria-label="The touch before">‹</button>
        <button type="button" onClick={() => walk(1)} disabled={!shownTouches.value.length} aria-label="The next touch, the worst first">› worst</button>
      </span>
      {any && <button type="button" class="small quiet" onClick={clearFilters}>Clear</button>}
    </div>
  );
}
