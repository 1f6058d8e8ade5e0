"""README.md of what is exported, a dataset card: what each column means, and where the rows come from."""

from __future__ import annotations

import json
from typing import Any

from ..version import __version__
from .table import Table

_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"), (10_000_000, "1M<n<10M"))


def manifest_name(shards: bool) -> str:
    """Of what says how the dataset was made: dataset.json beside the shards that it lists, else another name."""
    return "dataset.json" if shards else "touchstone.json"


def write_card(table: Table, layout: str, front_matter: dict[str, Any] | None = None, *, shards: bool = False) -> str:
    """The text. `layout` says what lies where; `front_matter` is added to the YAML at its head; `shards`: those of the manifest lie
    beside it."""
    size = next((word for limit, word in _SIZES if table.rows < limit), "n>10M")
    head = {"pretty_name": table.name, "tags": ["touchstone", "robotics", "tactile"], "task_categories": ["robotics"],
            "size_categories": [size], **(front_matter or {})}
    # JSON is YAML.
    lines = ["---", *(f"{name}: {json.dumps(value, ensure_ascii=False)}" for name, value in head.items()), "---", "", f"# {table.name}", ""]
    lines += [f"{table.rows} rows, exported by touchstone {__version__}. {layout}", "", "## Columns", "",
              "| column | type | shape | unit | meaning |", "| --- | --- | --- | --- | --- |"]
    for column in table.columns:
        kind = f"{column.encoding.upper()} file" if column.encoding else column.dtype
        lines.append(f"| `{column.name}` | {kind} | {' x '.join(map(str, column.shape)) or '1'} | {column.unit} | {column.meaning} |")
    lines += ["", "Lengths are in mm, times in us, the object frame is right-handed with z up, as in the mesh file.", ""]
    if table.objects:
        lines += ["## Objects", "", ", ".join(f"{k}: {name}" for k, name in enumerate(table.objects)), ""]
    return "\n".join(lines + _provenance(table, manifest_name(shards))) + "\n"


def _provenance(table: Table, manifest: str) -> list[str]:
    found = table.provenance
    lines = ["## Provenance", ""]
    if found["kind"] == "dataset":
        model = found["model"]
        lines += [f"Simulated by touchstone {found['versions']['source']}, seed {found['seed']}, model {model['name']} (hash `{model['hash']}`).",
                  f"The same bytes once more, anywhere: `touchstone stream --like {manifest} --out again`.", "",
                  "The specification:", "", "```json", json.dumps(found["specification"], indent=2), "```", "",
                  "The model:", "", "```yaml", model.get("yaml", "").rstrip(), "```", "",
                  "The meshes:", "", *(f"- {entry['name']}: `{entry['mesh_hash']}`" for entry in found["objects"])]
    else:
        lines += [f"{found['kind'].capitalize()} `{found['file']}`, SHA-256 `{found['sha256']}`."]
        if found.get("camera"):
            lines += ["", "The lens:", "", "```yaml", found["camera"].rstrip(), "```"]
    return lines
