"""Pages of the effects: what `touchstone effects` says of each, and the physics as its source file states it."""
import json
import re

import repository
from commands import output_of
from markdown_text import cell, escaped

STAGES = {"effects-touches.md": ("Effects of touches", ["pose", "contact", "motion", "sensor"]),
          "effects-photographs.md": ("Effects of photographs", ["camera pose", "projection", "shading", "image sensor"])}


def pages(made: dict[str, str]) -> None:
    """Adds the list of all effects and a page for those of touches and of photographs."""
    catalogue = json.loads(output_of("touchstone", "effects", "--json"))
    catalogue = catalogue if isinstance(catalogue, list) else catalogue["effects"]
    listed = {stage for _, stages in STAGES.values() for stage in stages}
    unknown = {effect["stage"] for effect in catalogue} - listed
    if unknown:
        raise SystemExit(f"deploy/site/effects.py: no page has effects of the stage {', '.join(sorted(unknown))}")
    about = (f"{len(catalogue)} physical causes that a model can have, as `touchstone effects` lists them: a model is the nominal rig and "
             "any of them. `touchstone diagnose` looks for them in measured sets.")
    lines = ["# The catalogue of effects", "", about, "", "| Effect | Stage | Parameters | What it is |", "| --- | --- | --- | --- |"]
    for path, (title, stages) in STAGES.items():
        page = [f"# {title}", ""]
        for stage in stages:
            page += [f"## Stage: {stage}", ""]
            for effect in (one for one in catalogue if one["stage"] == stage):
                page += text_of(effect)
                parameters = ", ".join(f"`{one['name']}`" for one in effect["parameters"])
                lines.append(f"| [`{effect['name']}`]({path}#{effect['name']}) | {stage} | {parameters} | {cell(effect['meaning'])} |")
        made[path] = "\n".join(page)
    made["effects.md"] = "\n".join(lines)


def text_of(effect):
    lines = [f"### `{effect['name']}` {{#{effect['name']}}}", "", escaped(effect["meaning"]), ""]
    if physics := physics_of(effect["name"]):
        lines += ["```text", physics, "```", ""]
    if effect["parameters"]:
        lines += ["| Parameter | Unit | Range | Neutral | Typical | Meaning |", "| --- | --- | --- | --- | --- | --- |"]
        for one in effect["parameters"]:
            meaning = one["meaning"] + (" One value per finger." if one["arity"] == "finger" else "")
            meaning += " Their sum is 0." if one["sum_zero"] else ""
            row = [f"`{one['name']}`", cell(one["unit"]), f"{number(one['min'])}&nbsp;to&nbsp;{number(one['max'])}", number(one["default"]),
                   number(one["typical"]), cell(meaning)]
            lines.append(f"| {' | '.join(row)} |")
        lines.append("")
    for key, title in (("signature", "How it shows"), ("check_on_rig", "How to check it on the rig"), ("remedy", "What to do")):
        if effect.get(key):
            lines += [f"**{title}.** {escaped(effect[key])}", ""]
    return lines


def number(value):
    return "" if value is None else f"{value:.6g}"


def physics_of(name: str) -> str:
    """The comment at the head of the effect's source: what happens, and its formula."""
    sources = list((repository.ROOT / "server/effects").glob(f"*/{name}.cpp"))
    if not sources:
        return ""
    head = re.match(r"(?://.*\n)+", sources[0].read_text(encoding="utf-8"))
    return "\n".join(line[2:].removeprefix(" ") for line in head.group().splitlines()) if head else ""
