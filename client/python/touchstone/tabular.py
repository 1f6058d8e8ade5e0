"""Results as tables and figures: what reports, their parts and batches share for notebooks, pandas, Arrow and matplotlib."""

from __future__ import annotations

import dataclasses
import html
import importlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from .printable import printable

SHOWN_ROWS = 20  # of a table in a notebook


class Tabular:
    """Shown as a table by Jupyter. pandas, pyarrow and matplotlib are needed by the method of theirs alone.

    A class says what its columns are (_table), what stands above the table (_heading) and how it is drawn (_draw).
    """

    __slots__ = ()

    def _table(self) -> Mapping[str, Any]:
        """{name: one value per row}: arrays, (rows, ...) too, or sequences."""
        raise NotImplementedError

    def _heading(self) -> str:
        """A sentence or two above the table."""
        return repr(self)

    def _draw(self, axes: Any) -> None:
        """Into matplotlib's Axes."""
        raise NotImplementedError

    def to_pandas(self) -> Any:
        """A pandas.DataFrame; a column of several numbers a row becomes one column for each ("descriptor_us_0")."""
        pandas = _needed("pandas", "to_pandas()")
        return pandas.DataFrame(dict(_flat(self._table())))

    def to_arrow(self) -> Any:
        """A pyarrow.Table; a column of several numbers a row is a fixed-size list, without a copy."""
        arrow = _needed("pyarrow", "to_arrow()")
        return arrow.table({name: _arrow_array(arrow, values) for name, values in self._table().items()})

    def plot(self, axes: Any = None) -> Any:
        """Draws it into matplotlib's Axes, new ones by default, and returns them."""
        if axes is None:
            axes = _needed("matplotlib.pyplot", "plot()").subplots()[1]
        self._draw(axes)
        return axes

    def _repr_html_(self) -> str:
        columns = dict(_flat(self._table()))
        rows = min((len(values) for values in columns.values()), default=0)
        body = [_line("td", [_cell(values[k]) for values in columns.values()]) for k in range(min(rows, SHOWN_ROWS))]
        more = f"<p>{rows - SHOWN_ROWS:,} more rows</p>" if rows > SHOWN_ROWS else ""
        return f"<p>{_escaped(self._heading())}</p><table>{_line('th', columns)}{''.join(body)}</table>{more}"


_Row = TypeVar("_Row")


class Rows(tuple[_Row, ...], Tabular):
    """Entries of one kind of dataclass, as a tuple and as a table of their fields."""

    __slots__ = ()

    def _table(self) -> Mapping[str, Any]:
        return columns_of(self)

    def __repr__(self) -> str:
        shown = ", ".join(map(repr, self[:3]))
        return printable(f"({shown}{f', ... {len(self) - 3} more' if len(self) > 3 else ',' if len(self) == 1 else ''})")

    def _heading(self) -> str:
        return f"{len(self)} {type(self[0]).__name__ if self else 'entries'}"

    def _draw(self, axes: Any) -> None:
        draw = getattr(type(self[0]), "_draw_all", None) if self else None
        if draw is None:
            raise NotImplementedError("there is nothing to draw")
        draw(self, axes)


def columns_of(rows: Iterable[Any]) -> dict[str, list[Any]]:
    """{field: values} of dataclasses, without messages of the protocol; a tuple or list of texts as one text."""
    rows = list(rows)
    names = [field.name for field in dataclasses.fields(rows[0]) if field.name != "message"] if rows else []
    return {name: [_plain(getattr(row, name)) for row in rows] for name in names}


def bars(axes: Any, names: Sequence[str], values: Sequence[float], **look: Any) -> None:
    """Named bars, the first on top."""
    axes.barh(range(len(names)), values, **look)
    axes.set_yticks(range(len(names)), [printable(name) for name in names])
    axes.invert_yaxis()


def intervals(axes: Any, names: Sequence[str], values: Sequence[float], ends: Sequence[tuple[float, float]]) -> None:
    """Named values with their intervals, the first on top; a line at zero."""
    size = np.array([[value - low, high - value] for value, (low, high) in zip(values, ends)]).reshape(-1, 2).T
    axes.errorbar(values, range(len(names)), xerr=np.abs(size), fmt="o", capsize=3)
    axes.set_yticks(range(len(names)), [printable(name) for name in names])
    axes.axvline(0, color="0.7", linewidth=1)
    axes.set_ylim(len(names) - 0.5, -0.5)


def _plain(value: Any) -> Any:
    if isinstance(value, (tuple, list)) and all(isinstance(part, str) for part in value):
        return ", ".join(value)
    if isinstance(value, (tuple, list)) and value and all(dataclasses.is_dataclass(part) for part in value):
        return ", ".join(f"{part.name} = {part.value:.6g}" if hasattr(part, "value") else str(part) for part in value)
    if isinstance(value, dict):
        return {str(key): list(part) if isinstance(part, tuple) else part for key, part in value.items()}  # as Arrow wants it
    return value


def _needed(module: str, what: str) -> Any:
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        name = module.partition(".")[0]
        if (error.name or "").partition(".")[0] != name:
            raise
        raise ModuleNotFoundError(f"{what} needs {name}, which is not installed: pip install {name}", name=name) from None


def _flat(columns: Mapping[str, Any]) -> Iterable[tuple[str, Any]]:
    """One entry a row: (rows, n) and (rows, n, m) as columns of their own, larger ones as arrays."""
    for name, values in columns.items():
        if not isinstance(values, np.ndarray) or values.ndim == 1:
            yield name, list(values) if isinstance(values, tuple) else values
        elif values.ndim > 3 or values[0:1].size > 64:
            yield name, list(values)
        else:
            flat = values.reshape(len(values), -1)
            for k, place in enumerate(np.ndindex(values.shape[1:])):
                yield "_".join(map(str, (name, *place))), flat[:, k]


def _arrow_array(arrow: Any, values: Any) -> Any:
    if not isinstance(values, np.ndarray):
        return arrow.array(list(values))
    found = arrow.array(np.ascontiguousarray(values).reshape(-1))
    for size in reversed(values.shape[1:]):
        found = arrow.FixedSizeListArray.from_arrays(found, size)
    return found


def _line(tag: str, cells: Iterable[str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{_escaped(cell)}</{tag}>" for cell in cells) + "</tr>"


def _cell(value: Any) -> str:
    if isinstance(value, (float, np.floating)):
        return f"{value:.5g}"
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {' x '.join(map(str, value.shape))}"
    if isinstance(value, bytes):
        return f"{len(value):,} bytes"
    return "" if value is None else str(value)


def _escaped(text: Any) -> str:
    return html.escape(printable(str(text)))
