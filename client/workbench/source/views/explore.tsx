// The object and the comparison side by side: what is chosen in one is seen in the other.
import { Section } from "../parts/parts";
import { entry, touches } from "../state";
import { Compare, TouchCard } from "./compare";
import { Filters } from "./filters";
import { ObjectView } from "./object";

export function Explore() {
  const table = touches.value;
  const data = entry.value?.data;
  if (!table || !data) return null;
  return (
    <Section id="touches" title="Touch by touch">
      <Filters />
      <div class="explore"><ObjectView /><div class="explore-side"><Compare /><TouchCard table={table} data={data} /></div></div>
    </Section>
  );
}
