// Touch: a plan at the rig, from its dry run to its measurements. Nothing moves before a person has said so here.
import { type ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";
import { fingerColour } from "../colour";
import { Plot } from "../charts/plot";
import { rangeOf } from "../charts/scale";
import { download } from "../charts/export";
import { Key, Section, Table } from "../parts/parts";
import { type Checked, act, asksAlready, controllerWent, controls, desk, measuredCsv, pageName, press, refused, touched } from "../data/rig";
import { openRigSet, working } from "../data/live";
import { PlannedView } from "./planned";
import { count } from "../format";

const durationWords = (s: number) => (s < 90 ? `${Math.max(1, Math.round(s))} s` : s < 5400 ? `${Math.round(s / 60)} min` : `${(s / 3600).toFixed(1)} h`);
const touches = (n: number) => `${count(n)} ${n === 1 ? "touch" : "touches"}`;

// An act that moves the arm: a person agrees to exactly this, each time.
function Agreed({ label, what, onAgree, disabled }: { label: string; what: ComponentChildren; onAgree(): void; disabled?: boolean }) {
  const [open, setOpen] = useState(false);
  const [seen, setSeen] = useState(false);
  const close = () => { setOpen(false); setSeen(false); };
  useEffect(() => { if (disabled) close(); }, [disabled]);
  if (!open) return <button type="button" class="main" disabled={disabled} onClick={() => setOpen(true)}>{label}</button>;
  return (
    <div class="agree" role="group" aria-label={label}>
      <div>{what}</div>
      <label class="check-line"><input type="checkbox" checked={seen} onInput={(event) => setSeen(event.currentTarget.checked)} /> I see the rig, and nobody is within its reach.</label>
      <div class="row">
        <button type="button" class="main" disabled={!seen || disabled} onClick={() => { close(); onAgree(); }}>Move the arm</button>
        <button type="button" onClick={close}>Not now</button>
      </div>
    </div>
  );
}

function Control() {
  const now = desk.value!;
  const holder = now.rig.lease_holder ?? "";
  const busy = now.job !== "";
  if (controls.value) {
    return (
      <div class="row">
        <span>You control the rig. Other pages look on; every page can stop it.</span>
        {now.requests.map((id) => <span class="asked">{pageName(id)} asks for control. <button type="button" disabled={busy} onClick={() => void act("give", { to: id })}>Hand over to {pageName(id)}</button></span>)}
        {now.requests.length > 0 && <button type="button" onClick={() => void act("decline")}>Decline</button>}
        <button type="button" disabled={busy} onClick={() => void act("release")}>Release control</button>
      </div>
    );
  }
  if (now.controller) {
    return (
      <div class="row">
        <span>{pageName(now.controller)} controls the rig{controllerWent.value && `, but is gone: its lease is given back ${busy ? "once this has ended" : "now"}`}.</span>
        <button type="button" disabled={asksAlready.value} onClick={() => void act("request")}>{asksAlready.value ? "Asked for control" : "Ask for control"}</button>
        <button type="button" disabled={busy} title={busy ? "Not while the rig is at work" : "Agree with whoever sits there first"} onClick={() => void act("take")}>Take control</button>
      </div>
    );
  }
  return (
    <div class="row">
      {holder
        ? <><span>{holder} holds the rig{"\u2019"}s lease.</span><button type="button" disabled={busy || now.rig.moving} title="Agree with them first; not while the rig moves" onClick={() => void act("take_lease")}>Take the lease from them</button></>
        : <><span>Nobody controls the rig.</span><button type="button" class="main" disabled={busy || !now.rig.answers} onClick={() => void act("acquire")}>Take control</button></>}
    </div>
  );
}

function Stopped() {
  const [reason, setReason] = useState("");
  const { rig, job } = desk.value!;
  if (!rig.stop_reason) return null;
  return (
    <form class="warnings" onSubmit={(event) => { event.preventDefault(); press.value = null; void act("reset", { reason }).then((done) => { if (done) setReason(""); }); }}>
      <p>Stopped</p>
      <div>{rig.stop_reason}. It holds until somebody releases it.</div>
      {controls.value
        ? <div class="row"><label>Why may the rig move again? <input value={reason} maxLength={300} placeholder="cable freed" onInput={(event) => setReason(event.currentTarget.value)} /></label>
          <button type="submit" disabled={!reason.trim() || job !== ""}>Release the stop</button><span class="soft">This moves nothing.</span></div>
        : <div class="soft">Whoever controls the rig can release it.</div>}
    </form>
  );
}

const faces = 6; // of an object's box

function PlanForm() {
  const now = desk.value!;
  const { objects } = now;
  const [chosen, setChosen] = useState<string[]>([]);
  const [samples, setSamples] = useState(4);
  const [rounds, setRounds] = useState(2);
  const [speed, setSpeed] = useState(20);
  const [session, setSession] = useState("");
  const [csv, setCsv] = useState<{ origin: string; csv: string } | null>(null);
  const picked = chosen.length ? chosen : now.rig.object ? [now.rig.object] : [];
  const name = session.trim() || `page-${new Date().toISOString().slice(0, 16).replace(/[:T]/g, "-")}`;
  const check = () => {
    setSession(name); // the same name resumes
    void act("check", { plan: { session: name, ...(csv ?? { objects: picked, samples_per_face: samples, rounds, speed_mm_s: speed }) } });
  };
  const field = (label: string, value: number, set: (x: number) => void, low: number, high: number, unit = "") => (
    <label>{label} <input type="number" step="any" min={low} max={high} value={value} disabled={!!csv} onInput={(event) => set(Number(event.currentTarget.value))} /> {unit}</label>
  );
  const mayCheck = (!now.controller || controls.value) && now.job === "" && !!now.rig.answers;
  return (
    <form class="plan" onSubmit={(event) => { event.preventDefault(); check(); }}>
      {!csv && <fieldset><legend>Objects</legend>
        {objects.map((one) => <label class="check-line"><input type="checkbox" checked={picked.includes(one)} onInput={(event) => setChosen(event.currentTarget.checked ? [...picked, one] : picked.filter((other) => other !== one))} /> {one}</label>)}
      </fieldset>}
      <div class="row">
        {field("Touches per face", samples, setSamples, 1, 1000)}
        {field("Rounds", rounds, setRounds, 1, 1000)}
        {field("Speed", speed, setSpeed, now.rig.min_speed_mm_s ?? 0.1, now.rig.max_speed_mm_s ?? 1000, "mm/s")}
        <label>Session <input value={session} placeholder={name} pattern="[A-Za-z0-9_.\-]{1,64}" title="1 to 64 letters, digits, dots, dashes" onInput={(event) => setSession(event.currentTarget.value)} /></label>
      </div>
      <div class="row">
        <label>or a plan as CSV <input type="file" accept=".csv,text/csv" onChange={(event) => { const file = event.currentTarget.files?.[0]; if (!file) setCsv(null); else void file.text().then((text) => setCsv({ origin: file.name, csv: text })); }} /></label>
        <button type="submit" disabled={!mayCheck || (!csv && !picked.length)}>Dry run</button>
        {!csv && picked.length > 0 && <span class="soft">{touches(faces * picked.length * samples * rounds)}; those that the rig cannot make are found by the dry run. It moves nothing.</span>}
      </div>
    </form>
  );
}

function DryRun({ checked }: { checked: Checked }) {
  const now = desk.value!;
  const impossible = checked.touches - checked.possible;
  const resumes = now.done > 0;
  const what = <>The arm makes {touches(checked.possible)}, about {durationWords(checked.duration_s)} of motion, in {checked.groups.length === 1 ? "one setup" : `${checked.groups.length} setups`}: {checked.groups.map((group) => `${group.object} with face ${group.up_face} up`).join(", ")}.{now.rig.mounts_itself ? " The rig changes the object by itself." : ""}{impossible > 0 ? ` ${touches(impossible)} that the rig cannot make ${impossible === 1 ? "is" : "are"} left out.` : ""} Touches that session {checked.session} has already are not made again.</>;
  return (
    <>
      <h3>Dry run of {checked.origin}</h3>
      <p>{checked.possible} of {touches(checked.touches)} possible, {durationWords(checked.duration_s)} of motion. Nothing was moved.</p>
      {checked.groups.length > 0 && <Table title="Setups" columns={["Object", "Face up", { title: "Touches", number: true }, { title: "Time", number: true }]}
        rows={checked.groups.map((group) => [group.object, group.up_face, count(group.touches), durationWords(group.duration_s)])} />}
      <PlannedView />
      {impossible > 0 && <details><summary>{touches(impossible)} impossible here</summary><ul>{checked.impossible.map((one) => <li>Touch {one.touch} of {one.object}: {one.reason}</li>)}{impossible > checked.impossible.length && <li>and {impossible - checked.impossible.length} more</li>}</ul></details>}
      {checked.notes.length > 0 && <details><summary>Notes</summary><ul>{checked.notes.map((note) => <li>{note}</li>)}</ul></details>}
      {controls.value && checked.possible > 0 && <Agreed key={`start ${now.check}`} label={resumes ? "Start again \u2026" : "Start \u2026"} disabled={now.job !== "" || !!now.rig.stop_reason} what={what}
        onAgree={() => { press.value = null; void act("start", { check: now.check, confirmed: true, skip_impossible: impossible > 0 }); }} />}
      {!controls.value && <p class="soft">To start, take control.</p>}
    </>
  );
}

function Asked() {
  const { ask, ask_id } = desk.value!;
  if (!ask) return null;
  return (
    <div class="warnings" role="alert">
      <p>{ask}</p>
      {controls.value ? <Agreed key={`mounted ${ask_id}`} label={"It lies there \u2026"} what={<>{ask}. The arm moves on when you agree.</>} onAgree={() => void act("mounted", { ask: ask_id, confirmed: true })} /> : <div>Whoever controls the rig does that.</div>}
    </div>
  );
}

const maxShown = 300; // dots of a finger

function Measured() {
  const all = touched.value;
  const [said, setSaid] = useState("");
  if (!all.length) return null;
  const fingers = all[0].times_us.length;
  const first = Math.max(0, all.length - maxShown);
  const shown = all.slice(first);
  const ms = (time: number | null) => (time === null ? Number.NaN : time / 1000);
  const save = async () => {
    try { download(`${desk.value!.checked?.session ?? "set"}.csv`, "text/csv", await measuredCsv()); setSaid(""); } catch (reason) { setSaid((reason as Error).message); }
  };
  const missed = all.filter((one) => one.times_us.includes(null)).length;
  return (
    <>
      <h3>Measured</h3>
      <p role="status">{touches(all.length)}{missed > 0 && `, ${missed} in which a finger met nothing`}. The last: touch {all[all.length - 1].touch} of {all[all.length - 1].object}.</p>
      <Plot title="Contact after the first finger" label="Time of contact after the first finger, touch by touch" height={220}
        marks={Array.from({ length: fingers }, (_, f) => ({ kind: "dots" as const, colour: fingerColour(f), points: shown.map((one, i): [number, number] => [first + i + 1, ms(one.times_us[f])]) }))}
        x={{ title: "touch", range: [first + 0.5, Math.max(first + 10, all.length) + 0.5] }} y={{ title: "after the first contact (ms)", range: rangeOf([0, ...shown.flatMap((one) => one.times_us.map(ms))], 0.08) }}
        rows={() => [["touch", "object", ...Array.from({ length: fingers }, (_, f) => `finger_${f + 1}_us`)], ...all.map((one) => [one.touch, one.object, ...one.times_us.map((time) => time ?? "")])]}
        caption={<Key keys={Array.from({ length: fingers }, (_, f) => ({ colour: fingerColour(f), text: `finger ${f + 1}` }))} />} />
      <div class="row"><button type="button" class="main" disabled={!!working.value} onClick={() => void openRigSet()}>Compare with the model</button><button type="button" onClick={() => void save()}>Save as CSV</button>{said && <span class="failed" role="alert">{said}</span>}</div>
    </>
  );
}

export function Touch() {
  const now = desk.value;
  if (!now) return <Section id="touch" title="Touch"><p role="status">Connecting to the rig.</p></Section>;
  const { rig } = now;
  return (
    <Section id="touch" title="Touch" lead={<>{now.address}{rig.arm && <> {"\u00b7"} arm {rig.arm}</>}{rig.effector && <> {"\u00b7"} end effector {rig.effector}</>}{rig.object && <> {"\u00b7"} {rig.object} lies with face {rig.up_face} up</>}</>}>
      <Control />
      {(refused.value || now.error) && <p class="failed" role="alert">{refused.value || now.error}</p>}
      {!refused.value && !now.error && now.text && <p class="soft" role="status">{now.text}</p>}
      <Stopped />
      <Asked />
      {controls.value && !rig.powered && rig.answers && <div class="row"><Agreed label={"Power the arm on \u2026"} disabled={now.job !== ""} what="Powers the arm on and releases its brakes, with a click and a small movement of the joints." onAgree={() => void act("power_on", { confirmed: true })} /></div>}
      <h3>Plan</h3>
      <PlanForm />
      {now.checked && <DryRun checked={now.checked} />}
      <Measured />
      {controls.value && rig.powered && <details><summary>More motions</summary><Agreed label={"Go home \u2026"} disabled={now.job !== "" || !!rig.stop_reason} what="The arm backs out along the tool's axis and goes to its home position." onAgree={() => void act("home", { confirmed: true })} /></details>}
      {rig.safety_notice && <p class="note">{rig.safety_notice}</p>}
    </Section>
  );
}
