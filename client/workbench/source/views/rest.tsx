// What to measure next, sets without poses, the data behind the report, how the numbers came about, how to make it again.
import { Code, Section, Table, Terms } from "../parts/parts";
import { count, error, fixed, isPictures, join, number, plain, probability, readings, signedError, typeset, unitFor } from "../format";
import { shownData, entry, page, selectTouch, touches } from "../state";
import type { DataReport } from "../data/report";

export function Next() {
  const { report, words } = page.value!;
  const all = report.next.map((one, i) => ({ one, verdict: words.next[i] ?? "" }));
  const list = all.filter(({ one }) => one.touch);
  const pictures = all.filter(({ one }) => one.photograph);
  if (!list.length && !pictures.length) return null;
  const place = (v: { x: number; y: number; z: number }, factor: number, digits: number) => [v.x, v.y, v.z].map((x) => fixed(factor * x, digits)).join(" ");
  const purposes = new Map(all.map(({ one, verdict }) => [one.purpose, verdict]));
  const apart = (separation: number) => (separation > 0 ? number(separation, 2) : "");
  return (
    <Section id="next" title="Measure next" lead={`${list.length ? "Touches" : "Pictures"} that would tell the remaining explanations apart.`}>
      {[...purposes].filter(([purpose]) => purpose).map(([purpose, verdict]) => <p><b>{typeset(purpose)}</b>{verdict && `: it takes ${typeset(verdict)}.`}</p>)}
      {list.length > 0 && <Table title="Next touches" columns={[{ title: "No.", number: true }, "Object", { title: "target x y z (mm)", number: true }, { title: "approach", number: true }, { title: "speed (mm/s)", number: true }, { title: "apart (sigmas)", number: true }, "What it is for"]}
        csv={() => [["no", "object", "target_x_mm", "target_y_mm", "target_z_mm", "approach_x", "approach_y", "approach_z", "speed_mm_s", "separation", "purpose"], ...list.map(({ one }, i) => { const t = one.touch!; return [i + 1, one.object, 1000 * t.target_m.x, 1000 * t.target_m.y, 1000 * t.target_m.z, t.approach.x, t.approach.y, t.approach.z, 1000 * t.speed_m_s, one.separation, one.purpose]; })]}
        rows={list.map(({ one }, i) => [i + 1, one.object, place(one.touch!.target_m, 1000, 1), place(one.touch!.approach, 1, 2), plain(1000 * one.touch!.speed_m_s), apart(one.separation), typeset(one.purpose)])}
        caption="Apart: the expected difference between the explanations, in standard deviations of the noise. The object above shows them as arrows." />}
      {pictures.length > 0 && <Table title="Next pictures" columns={[{ title: "No.", number: true }, "Object", { title: "eye x y z (mm)", number: true }, { title: "at x y z (mm)", number: true }, { title: "up", number: true }, { title: "apart (sigmas)", number: true }, "What it is for"]}
        csv={() => [["no", "object", "eye_x_mm", "eye_y_mm", "eye_z_mm", "at_x_mm", "at_y_mm", "at_z_mm", "separation", "purpose"], ...pictures.map(({ one }, i) => { const c = one.photograph!; return [i + 1, one.object, 1000 * c.eye_m.x, 1000 * c.eye_m.y, 1000 * c.eye_m.z, 1000 * c.at_m.x, 1000 * c.at_m.y, 1000 * c.at_m.z, one.separation, one.purpose]; })]}
        rows={pictures.map(({ one }, i) => [i + 1, one.object, place(one.photograph!.eye_m, 1000, 1), place(one.photograph!.at_m, 1000, 1), place(one.photograph!.up, 1, 2), apart(one.separation), typeset(one.purpose)])} />}
    </Section>
  );
}

export function Distributions() {
  const known = page.value!.report.data.filter((data) => data.distributions);
  if (!known.length) return null;
  return (
    <Section id="distributions" title="Distributions" lead="The set has no poses, so touches cannot be compared one by one.">
      {known.map(({ distributions }) => {
        const all = distributions!;
        const value = (x: number, unit: string) => (unit === "us" ? error("TOUCHES", x) : `${number(x)}${unit && `\u00a0${unit}`}`);
        return (
          <>
            <p>Energy distance {number(all.energy_distance)}, p {probability(all.p)}, against {count(all.simulated_touches)} simulated touches{all.plan && ` (${typeset(all.plan)})`}.</p>
            {all.findings.length > 0 && <Table title="What repeats show" columns={["Finding", { title: "p", number: true }, "Effects that would do it"]} rows={all.findings.map((one) => [typeset(one.words), probability(one.p), one.compatible_effects.length ? join(one.compatible_effects, "or") : "none of the catalogue"])}
              caption="p: how often repeats that change places within their pose, or Gaussian noise, show as much; paid for every test." />}
            {all.statistics.length > 0 && <Table title="Distributions against the model" columns={["Statistic", { title: "measured", number: true }, { title: "simulated", number: true }, { title: "p", number: true }]} tone={(row) => (all.statistics[row].p < 0.01 ? undefined : "faint")}
              csv={() => [["statistic", "measured", "simulated", "unit", "p"], ...all.statistics.map((one) => [one.name, one.measured, one.simulated, one.unit, one.p])]} rows={all.statistics.map((one) => [one.name, value(one.measured, one.unit), value(one.simulated, one.unit), probability(one.p)])} />}
            {all.compatible_effects.length > 0 && <p>The difference could be explained by {join(all.compatible_effects, "or")}. Only touches with poses can tell which.</p>}
            <p class="note">p: how often a set that the model makes in the same way (same objects, touches and rounds, other poses) lies as far from a large simulated one; by the energy distance between descriptors, and of each statistic by the Kolmogorov-Smirnov distance.</p>
          </>
        );
      })}
    </Section>
  );
}

function floorWords(data: DataReport, floor: number, bound: boolean): string {
  if (!(floor > 0)) return "";
  const noise = data.noise;
  if (!bound && noise && !noise.from_repeats && !noise.is_rounding) return `${error(data.kind, floor)}, as it was given`;
  const sure = noise && noise.lower > 0 && noise.lower < noise.upper ? `, 95 % interval ${error(data.kind, noise.lower)} to ${error(data.kind, noise.upper)}` : "";
  return `${bound ? "at most " : ""}${error(data.kind, floor)}${sure}, from ${bound ? "the best model\u2019s residuals" : `repeats of the same ${isPictures(data.kind) ? "picture" : "touch"}`}${noise?.degrees_of_freedom ? `, ${count(noise.degrees_of_freedom)} degrees of freedom` : ""}`;
}

function OneSet({ data, index }: { data: DataReport; index: number }) {
  const about = page.value!.words.of_data[index];
  const set = data.set;
  const table = touches.value;
  const linked = entry.value?.data === data && table;
  const aside = data.set_aside;
  const touchName = (text: string) => {
    const at = linked ? table.find(Number(text)) : -1;
    return at < 0 ? text : <button type="button" class="link" onClick={() => selectTouch(at)}>{text}</button>;
  };
  return (
    <>
      <Terms terms={[
        ["Rows in the file", set && set.rows > 0 ? `${count(set.rows)}, of which ${count(data.count)} used` : ""], ["Objects", set ? set.objects.join(", ") : ""],
        ["Speeds", set?.speeds_mm_s.length ? `${set.speeds_mm_s.map(plain).join(", ")} mm/s` : ""],
        [isPictures(data.kind) ? "Noise floor per pixel" : "Noise floor per finger", floorWords(data, about.floor, about.floor_is_bound)], ["Mean residual of each finger", typeset(about.finger_bias)],
        ["Fingers that reported nothing", set?.missed_contacts ? count(set.missed_contacts) : ""], ["Outliers", aside?.outliers ? count(aside.outliers) : ""], ["Set aside", aside?.words ? typeset(aside.words) : ""],
        ["Needed for a verdict", data.needed ? `${count(data.needed)} ${readings(data)}` : ""],
      ]} />
      {aside && aside.rows.length > 0 && <Table title="Rows not used" columns={[{ title: "Rows", number: true }, "Why", "Touch numbers"]} csv={() => [["rows", "reason", "examples"], ...aside.rows.map((one) => [one.rows, one.reason, one.examples.join(" ")])]}
        rows={aside.rows.map((one) => [count(one.rows), typeset(one.reason), `${one.examples.join(", ")}${one.rows > one.examples.length ? ", \u2026" : ""}`])} />}
      {data.worst_touches.length > 0 && <Table title="Worst touches" columns={[{ title: "Touch", number: true }, "Object", { title: "size", number: true }, ...data.worst_touches[0].residual.map((_, i) => ({ title: `finger ${data.fingers[i] ?? i}`, number: true }))]}
        csv={() => [["touch", "object", `size_${data.unit}`, ...data.worst_touches[0].residual.map((_, i) => data.fingers[i] ?? String(i))], ...data.worst_touches.map((one) => [one.touch, one.object, one.norm, ...one.residual])]}
        rows={data.worst_touches.map((one) => [touchName(one.touch), one.object, error(data.kind, one.norm), ...one.residual.map((x) => (Number.isNaN(x) ? "none" : signedError(data.kind, x)))])}
        caption="The given model&rsquo;s residuals per finger, and their size over the touch: the square root of the sum of squares." />}
    </>
  );
}

export function Data() {
  const { report, words } = page.value!;
  if (!report.data.length) return null;
  return <Section id="data" title="The data">{shownData.value.map((data) => { const i = report.data.indexOf(data); return <>{shownData.value.length > 1 && <h3>{words.of_data[i].kind_name}</h3>}<OneSet data={data} index={i} /></>; })}</Section>;
}

const methods: [string, string][] = [
  ["Residual", "Measured minus simulated contact times of the same commanded touch, less the mean over the fingers that reported: only differences between fingers are measured."],
  ["RMSE", "Square root of the sum of squared residuals over the sum of (reporting fingers \u2212 1). For a perfect model it equals the noise of one finger."],
  ["Noise floor", "The same quantity among repeats of the same commanded touch; without repeats an upper bound from the best model\u2019s residuals."],
  ["Excess error", "The mean square error beyond the noise floor\u2019s."],
  ["Unseen touches", "Touches left out of a fit that is made anew without them: each object in turn, each fifth of the poses, each fifth of the session; of the three the largest error. For candidates objects, or poses where there are few objects, and one linear step instead of a new fit."],
  ["Lack-of-fit p", "Probability of at least this much misfit beyond the scatter of repeats if nothing were missing."],
  ["Probability of an effect", "Of being the one that is missing, among all effects that could take its place."],
  ["Mean residual", "Positive: the real contact comes later than the model says."],
];
const pictureMethods: [string, string][] = [
  ["Residual", "Measured minus expected grey level of a pixel (0 to 255), for the commanded pose of the camera; of colour pictures the mean of the three channels."],
  ["RMSE", "Square root of the mean squared residual over all pixels of all pictures."],
  ["Noise floor", "The standard deviation of one pixel among repeats of the same picture; without repeats an upper bound, from what neighbouring pixels differ by."],
  ["Excess error", "The mean square error beyond the noise floor\u2019s."],
  ["Unseen pictures", "Pictures left out of a fit that is made anew without them, group by group; of the groups the largest error."],
  ["Lack-of-fit p", "Probability of at least this much misfit beyond the noise if nothing were missing."],
  ["Mean residual", "Positive: the picture is brighter than the model says."],
];

export function Methods() {
  const known = page.value!.report.data.filter((data) => data.initial.rmse > 0);
  if (!known.length) return null;
  const kinds = [known.some((data) => !isPictures(data.kind)) && methods, known.some((data) => isPictures(data.kind)) && pictureMethods];
  return <Section id="methods" title="How the numbers were computed">{kinds.map((terms) => terms && <Terms terms={terms} />)}</Section>;
}

export function Provenance() {
  const { report, words } = page.value!;
  const from = report.provenance;
  const hash = (hex: string) => hex && <code title={hex}>{hex.slice(0, 16)}</code>;
  return (
    <>
      {from && (
        <Section id="provenance" title="How to make this report again" lead="The same files, model, seed and version give the same numbers. Hashes in full are in the JSON report, and where the mouse rests on one.">
          {words.command && <Code text={words.command} label="The command" />}
          <Terms terms={[
            ["Made", from.date], ["Version", from.client_version && from.client_version !== report.version ? `${report.version} of the server, ${from.client_version} of the client` : report.version], ["Seed", from.seed],
            ["Set", from.set_sha256 && <>{report.data[words.main ?? 0]?.session}, SHA-256 {hash(from.set_sha256)}</>], ["Model", report.model_hash && <>{report.model_name}, hash {hash(report.model_hash)}</>],
          ]} />
          {from.meshes.length > 0 && <Table title="Meshes" columns={["Object", "Mesh file", "SHA-256 of the file", "Hash of the geometry"]} rows={from.meshes.map((mesh) => [mesh.object, mesh.path || "of the server", hash(mesh.file_sha256), hash(mesh.mesh_hash)])} />}
        </Section>
      )}
      <footer>Made by Touchstone {report.version}{report.duration_s > 0 && ` in ${number(report.duration_s * 1e6 * unitFor("TOUCHES", report.duration_s * 1e6).factor)} ${unitFor("TOUCHES", report.duration_s * 1e6).symbol}`}. This file is self-contained: it loads nothing.</footer>
    </>
  );
}
