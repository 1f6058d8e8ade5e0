// The page: the verdict first, then the ladder and what to do, then the evidence for it.
import { useEffect } from "preact/hooks";
import { page, theme, touches, walk, walkPictures, clearFilters } from "./state";
import { Baseline } from "./views/baseline";
import { Histograms } from "./views/compare";
import { Explore } from "./views/explore";
import { Commands, Head } from "./views/head";
import { Ladder } from "./views/ladder";
import { Live } from "./views/live";
import { place, rungs, stale } from "./data/live";
import { Photographs } from "./views/photographs";
import { Power } from "./views/power";
import { Data, Distributions, Methods, Next, Provenance } from "./views/rest";
import { RigBar } from "./views/rig_bar";
import { Sessions } from "./views/sessions";
import { Problems, Todo } from "./views/todo";
import { Touch } from "./views/touch";
import { Detail, Where } from "./views/where";
import { Unexplained, Why } from "./views/why";

const links: [string, string][] = [["ladder", "Ladder"], ["check", "Check"], ["sessions", "Sessions"], ["todo", "To do"], ["where", "Where"], ["touches", "Touches"], ["photographs", "Photographs"], ["why", "Why"], ["unexplained", "Unexplained"], ["power", "Power"], ["detail", "Groups"], ["histograms", "Histograms"], ["next", "Next"], ["baseline", "Baseline"], ["data", "Data"]];

function Navigation() {
  const { report } = page.value!;
  const any = (test: (data: (typeof report.data)[0]) => unknown) => report.data.some(test);
  const there: Record<string, unknown> = {
    ladder: page.value!.words.ladder.length, check: report.data_problems.length, sessions: report.sessions, todo: report.steps.length || report.refitted.length || report.improved_model_yaml, where: any((d) => d.where.length || d.groups.length || d.curves.length),
    touches: any((d) => d.touch_table), photographs: any((d) => d.photographs), why: any((d) => d.candidates.length), unexplained: any((d) => d.unexplained.words || d.unexplained.covariates.length || d.unexplained.formula || d.unexplained.curve),
    power: report.detectable.length, detail: any((d) => d.groups.length || d.curves.length), histograms: any((d) => d.histograms.length), next: report.next.length, baseline: true, data: report.data.length,
  };
  return <nav aria-label="Parts of the page"><ul>{links.filter(([id]) => there[id]).map(([id, text]) => <li><button type="button" class="link" onClick={() => document.getElementById(id)?.scrollIntoView({ behavior: "smooth" })}>{text}</button></li>)}</ul></nav>;
}

// [ and ] go through the touches, or else the photographs, from wherever the keyboard is, unless it types.
function useKeys() {
  useEffect(() => {
    const act = (event: KeyboardEvent) => {
      if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT|TEXTAREA)$/.test((event.target as HTMLElement).tagName)) return;
      const go = touches.value ? walk : walkPictures;
      if (event.key === "]") go(1);
      else if (event.key === "[") go(-1);
      else if (event.key === "Escape") clearFilters();
    };
    addEventListener("keydown", act);
    return () => removeEventListener("keydown", act);
  }, []);
}

export function App() {
  useKeys();
  useEffect(() => { document.documentElement.style.colorScheme = theme.value === "auto" ? "light dark" : theme.value; }, [theme.value]);
  const { report } = page.value!;
  // Where nothing of the catalogue is the answer, what is known of the rest comes before what was tried.
  const noName = report.verdict === "UNEXPLAINED" && !report.steps.length;
  return (
    <>
      <Navigation />
      <main>
        <Head /><Problems /><Sessions /><Ladder /><Todo /><Commands /><Distributions />
        {noName && <Unexplained />}
        <Where /><Explore /><Photographs /><Why />
        {!noName && <Unexplained />}
        <Power /><Detail /><Histograms /><Next /><Baseline /><Data /><Methods /><Provenance />
      </main>
    </>
  );
}

// The workbench above, the report of its model below.
export function LiveApp() {
  return (
    <>
      {place.value?.rig && <RigBar />}
      <div class={`live-main${place.value?.rig && !rungs.value.length ? " unopened" : ""}`} role={page.value ? "region" : "main"} aria-label="Workbench"><Live />{place.value?.rig && <Touch />}</div>
      {page.value && <div class={stale.value ? "stale" : undefined}><App /></div>}
    </>
  );
}
