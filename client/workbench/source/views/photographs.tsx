// Photographs: measured, rendered and what is left, side by side; picture by picture.
import { useEffect, useRef } from "preact/hooks";
import { Bar, Section, Table } from "../parts/parts";
import { count, error, fixed, signedError } from "../format";
import { hasImproved, object, page, picture, rankedPictures } from "../state";
import type { DataReport, PhotographMap } from "../data/report";

const maxListed = 24;

function SideBySide({ map }: { map: PhotographMap }) {
  const both = hasImproved.value;
  const scale = `\u00b1${fixed(map.residual_scale, 0)}`;
  const pictures: [string, string][] = [
    ["measured", map.measured_png], [both ? "rendered before" : "rendered", map.before_png], ...(both ? [["rendered after", map.after_png] as [string, string]] : []),
    [`residual${both ? " before" : ""}, ${scale}`, map.residual_before_png], ...(both ? [[`residual after, ${scale}`, map.residual_after_png] as [string, string]] : []),
  ];
  return (
    <figure class={picture.value === map.image ? "photos chosen" : "photos"} id={`picture-${map.image}`}>
      <figcaption><b>Image {map.image}</b>, {map.object}</figcaption>
      <div class="photo-row">
        {pictures.filter(([, png]) => png).map(([title, png]) => <figure><img src={`data:image/png;base64,${png}`} alt={`${title}, image ${map.image}`} /><figcaption>{title}</figcaption></figure>)}
      </div>
    </figure>
  );
}

function Outlines({ data }: { data: DataReport }) {
  const one = data.photographs!;
  if (!Number.isFinite(one.silhouette_iou)) return null;
  const both = hasImproved.value;
  const row = (name: string, before: number, after: number, digits: number, unit: string) => [name, `${fixed(before, digits)}${unit}`, ...(both ? [`${fixed(after, digits)}${unit}`] : [])];
  return (
    <Table title="Outline of the object" columns={["Outline of the object", { title: "given model", number: true }, ...(both ? [{ title: "improved model", number: true }] : [])]}
      csv={() => [["of", "given", "improved"], ["silhouette_iou", one.silhouette_iou, one.silhouette_iou_after], ["contour_distance_px", one.contour_distance_px, one.contour_distance_after_px]]}
      rows={[row("Overlap, measured against expected (IoU)", one.silhouette_iou, one.silhouette_iou_after, 3, ""), row("Distance of the outlines, root mean square", one.contour_distance_px, one.contour_distance_after_px, 2, "\u00a0px")]}
      caption="The measured outline is what stands out of the picture&rsquo;s background. Where the object is expected to be as bright as the background nothing can be told, and nothing is counted." />
  );
}

function OneByOne({ data }: { data: DataReport }) {
  const list = rankedPictures.value.filter((one) => data.photographs!.photographs.includes(one));
  if (data.photographs!.photographs.length < 2 || !list.length) return null;
  const both = hasImproved.value;
  const mapped = new Set(data.photographs!.maps.map((map) => map.image));
  const listed = list.slice(0, maxListed);
  const chosen = list.find((one) => one.image === picture.value);
  if (chosen && !listed.includes(chosen)) listed.push(chosen);
  return (
    <Table title="Picture by picture" columns={["Image", "Object", { title: "RMSE", number: true }, "", ...(both ? [{ title: "improved", number: true }] : []), { title: "mean residual", number: true }, { title: "outline IoU", number: true }, { title: "outline apart", number: true }]}
      tone={(row) => (listed[row].image === picture.value ? "chosen" : undefined)}
      csv={() => [["image", "object", "rmse_grey", "rmse_after_grey", "mean_residual_grey", "silhouette_iou", "contour_distance_px"], ...list.map((one) => [one.image, one.object, one.rmse, one.rmse_after, one.mean_residual, one.silhouette_iou, one.contour_distance_px])]}
      rows={listed.map((one) => [
        <button type="button" class="link" aria-pressed={picture.value === one.image} title={mapped.has(one.image) ? "Stands side by side above" : undefined} onClick={() => { picture.value = picture.value === one.image ? null : one.image; }}>{one.image}</button>,
        one.object, error(data.kind, one.rmse), <Bar share={one.rmse / list[0].rmse} tone="given" mark={data.noise_floor / list[0].rmse} />, ...(both ? [error(data.kind, one.rmse_after)] : []),
        signedError(data.kind, one.mean_residual), fixed(one.silhouette_iou, 3), Number.isFinite(one.contour_distance_px) ? `${fixed(one.contour_distance_px, 2)}\u00a0px` : "n/a"])}
      caption={list.length > maxListed ? `The ${maxListed} of ${list.length} pictures that are off most; the CSV has all.` : "All pictures, the worst first."} />
  );
}

export function Photographs() {
  const shown = useRef(picture.value);
  useEffect(() => {
    if (picture.value === shown.current) return;
    shown.current = picture.value;
    if (picture.value !== null) document.getElementById(`picture-${picture.value}`)?.scrollIntoView({ block: "nearest", behavior: "smooth" });
  }, [picture.value]);
  const known = page.value!.report.data.filter((data) => data.photographs);
  if (!known.length) return null;
  return (
    <Section id="photographs" title="Photographs" lead="A few pictures side by side: those that are off most, and one of middling error.">
      {known.map((data) => (
        <>
          {object.value !== null && <p class="row">{rankedPictures.value.length} of {count(data.photographs!.photographs.length)} pictures: those of {object.value}. <button type="button" class="small" onClick={() => { object.value = null; }}>Show all</button></p>}
          {data.photographs!.maps.filter((map) => object.value === null || map.object === object.value).map((map) => <SideBySide map={map} />)}
          {data.photographs!.maps.length > 0 && <p class="note">Before: as the given model expects the picture, after: as the improved one does. Residuals are measured minus expected: red where the picture is brighter than expected, blue where it is darker, white where it is as expected; full colour at the grey levels that the caption gives, the same before and after.</p>}
          <Outlines data={data} /><OneByOne data={data} />
        </>
      ))}
    </Section>
  );
}
