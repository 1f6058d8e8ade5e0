// An effect of one's own: a formula, the variables that it may use, and its errors where they are.
import { useEffect, useRef, useState } from "preact/hooks";
import { type FormulaParameter, type FormulaWords, formulaWords, namesIn } from "../data/formula";
import { addFormula, working } from "../data/live";
import { page, touches } from "../state";
import { isPictures, typeset } from "../format";

// What it may add to, by what was measured.
const ofTouches: Record<string, string> = { travel_mm: "travel until contact (mm)", time_us: "contact time (\u00b5s)" };
const ofPhotographs: Record<string, string> = { grey: "grey level of a pixel (0 to 255)" };
const unitOf: Record<string, string> = { travel_mm: "mm", time_us: "us", grey: "grey" };
const fresh = (name: string, to: string): FormulaParameter => ({ name, value: "0", unit: unitOf[to], min: "-1", max: "1" });

// "character 7: ..." of the parser, on the text that it is about.
function Fault({ text, message, onShow }: { text: string; message: string; onShow(at: number): void }) {
  const at = /character (\d+)/.exec(message);
  const index = at ? Math.min(Number(at[1]) - 1, text.length) : -1;
  return (
    <div class="formula-fault" role="alert">
      {index >= 0 && <button type="button" class="link" onClick={() => onShow(index)} title="Go to the error"><code>{text.slice(0, index)}<mark>{text.slice(index, index + 1) || "\u2423"}</mark>{text.slice(index + 1)}</code></button>}
      <div>{typeset(message)}</div>
    </div>
  );
}

export function Formula() {
  const [words, setWords] = useState<FormulaWords | null>(null);
  const [text, setText] = useState("");
  const [name, setName] = useState("");
  const [chosen, setTo] = useState("");
  const [parameters, setParameters] = useState<FormulaParameter[]>([]);
  const [fault, setFault] = useState("");
  const box = useRef<HTMLTextAreaElement>(null);
  const asked = useRef(0);
  const open = async (event: Event) => {
    if (!(event.currentTarget as HTMLDetailsElement).open || words) return;
    try { setWords(await formulaWords()); } catch (reason) { setFault((reason as Error).message); }
  };
  const kinds = page.value?.report.data.map((data) => data.kind) ?? [];
  const adds: Record<string, string> = { ...(kinds.length && kinds.every(isPictures) ? {} : ofTouches), ...(kinds.includes("PHOTOGRAPHS") ? ofPhotographs : {}) };
  const to = chosen in adds ? chosen : Object.keys(adds)[0];
  const offered: { name: string; unit: string; meaning: string }[] = (to === "grey" ? words?.pixel_variables : words?.variables) ?? [];
  const covariates = to === "grey" ? [] : (touches.value?.columns ?? []).map((column) => column.name).filter((one) => one.startsWith("cov_"));
  const known = new Set(offered.map((one) => one.name));
  useEffect(() => {
    const mine = ++asked.current; // of texts that were typed meanwhile the last counts
    if (!text.trim()) { setFault(""); setParameters([]); return; }
    void namesIn(text).then((names) => {
      if (mine !== asked.current) return;
      setFault("");
      const own = names.filter((one) => !known.has(one) && !one.startsWith("cov_"));
      setParameters((before) => own.map((one) => before.find((other) => other.name === one) ?? fresh(one, to)));
    }, (reason: Error) => { if (mine === asked.current) setFault(reason.message); });
  }, [text, words, to]);
  const insert = (word: string) => {
    const element = box.current!;
    element.setRangeText(word, element.selectionStart, element.selectionEnd, "end");
    setText(element.value);
    element.focus();
  };
  const show = (at: number) => { box.current!.focus(); box.current!.setSelectionRange(at, at + 1); };
  const set = (which: string, part: Partial<FormulaParameter>) => setParameters((all) => all.map((one) => (one.name === which ? { ...one, ...part } : one)));
  const add = async (event: Event) => {
    event.preventDefault();
    const wrong = await addFormula(name.trim(), to, text.trim(), parameters);
    if (wrong) return setFault(wrong);
    setText(""); setName(""); setParameters([]); setFault("");
  };
  if (!to) return null; // boards have no effect of one's own
  return (
    <details class="formula" onToggle={(event) => void open(event)}>
      <summary>Add an effect of your own: a formula</summary>
      <form onSubmit={(event) => void add(event)}>
        <div class="row">
          <label>Name <input value={name} required pattern="[A-Za-z][A-Za-z0-9_]*" title="Letters, digits and _, a letter first" placeholder={to === "grey" ? "glare" : "lead_screw"} onInput={(event) => setName(event.currentTarget.value)} /></label>
          <label>It adds to the <select value={to} onChange={(event) => setTo(event.currentTarget.value)}>{Object.entries(adds).map(([key, title]) => <option value={key}>{title}</option>)}</select></label>
        </div>
        <label>Formula <textarea ref={box} rows={2} value={text} required spellcheck={false} aria-invalid={!!fault} placeholder={to === "grey" ? "k * radius^2" : "k * sin(2*pi*travel_mm/lead)"} onInput={(event) => setText(event.currentTarget.value)} /></label>
        {fault && <Fault text={text} message={fault} onShow={show} />}
        {words && (
          <div class="offered" role="group" aria-label="Variables">
            {offered.map((one) => <button type="button" class="small" title={`${one.meaning}${one.unit ? ` (${one.unit})` : ""}`} onClick={() => insert(one.name)}>{one.name}</button>)}
            {covariates.map((one) => <button type="button" class="small" title="A column of the measurements" onClick={() => insert(one)}>{one}</button>)}
            <details><summary>Functions</summary>{[...words.functions.map((one) => ({ text: one.usage, meaning: one.meaning })), ...words.constants.map((one) => ({ text: one.name, meaning: one.meaning }))].map((one) => <div><code>{one.text}</code> <span class="soft">{one.meaning}</span></div>)}</details>
          </div>
        )}
        {parameters.map((one) => (
          <div class="row formula-parameter">
            <b>{one.name}</b>
            <label>value <input value={one.value} inputMode="decimal" onInput={(event) => set(one.name, { value: event.currentTarget.value })} /></label>
            <label>unit <select value={one.unit} onChange={(event) => set(one.name, { unit: event.currentTarget.value })}>{words?.units.map((unit) => <option value={unit}>{unit || "none"}</option>)}</select></label>
            <label>from <input value={one.min} inputMode="decimal" onInput={(event) => set(one.name, { min: event.currentTarget.value })} /></label>
            <label>to <input value={one.max} inputMode="decimal" onInput={(event) => set(one.name, { max: event.currentTarget.value })} /></label>
          </div>
        ))}
        <div class="row"><button type="submit" class="main" disabled={!!fault || !text.trim() || !name.trim() || !!working.value}>Add the formula</button><span class="soft">Its values are fitted by <i>Find what is missing</i>; Undo takes it away.</span></div>
      </form>
    </details>
  );
}
