"""A measured set as what recognisers are tested on: touches, groups of poses, and which of them a model was fitted to."""

from __future__ import annotations

import csv
import dataclasses
import os
import pathlib
from collections.abc import Sequence

import numpy as np

import touchstone
from touchstone.whole_file import whole_file

from ..touch_data import TouchData


@dataclasses.dataclass(frozen=True)
class MeasuredSet:
    """Attributes:
      data: the touches of which every finger reported, but for those that were fitted.
      path: of a measurement file that has them.
      incomplete: touches that are left out because a finger reported nothing.
      fitted: touches that are left out because the better model was fitted to their poses; None: it is not known which those are.
      standoff_mm: of most touches.
    """

    data: TouchData
    path: pathlib.Path
    incomplete: int
    fitted: int | None
    standoff_mm: float


def read(path: str | os.PathLike[str], fitted: str | os.PathLike[str] | None, spacing_mm: float, fingers: int,
         folder: pathlib.Path) -> MeasuredSet:
    """`folder`: for a file of the touches that remain, if some do not."""
    name = os.fspath(path)
    rows = touchstone.read_plan(path)
    data, standoff_mm = _data(name, rows, spacing_mm, fingers)
    keep, left = np.ones(len(data), bool), None
    if fitted is not None:
        known = touchstone.read_plan(fitted)
        other, _ = _data(os.fspath(fitted), known, spacing_mm, fingers)
        keep = ~np.isin(data.poses(), other.poses())
        left = int((~keep).sum())
        if not keep.any():
            raise touchstone.InvalidRequest(
                f"{name}: every pose is also in {os.fspath(fitted)}, which the better model was fitted to; give other touches as the "
                "set, or diagnose a part of it and test on the rest.")
    whole = np.isfinite(data.times_us).all(1)
    kept = pathlib.Path(path)
    if left:
        kept = folder / "tested.csv"
        _copy_rows(pathlib.Path(path), kept, keep)
    return MeasuredSet(data[keep & whole], kept, int((keep & ~whole).sum()), left, standoff_mm)


def _data(name: str, rows: Sequence[touchstone.Row], spacing_mm: float, fingers: int) -> tuple[TouchData, float]:
    if not rows:
        raise touchstone.InvalidRequest(f"{name} has no touches.")
    if len(rows[0].time_us) != fingers:
        have = len(rows[0].time_us)
        what = f"contact times of {have} fingers" if have else "no contact times: it is a plan; measure it first"
        raise touchstone.InvalidRequest(f"{name} has {what}, the model has {fingers} fingers.")
    speeds = np.array([row.command.speed_mm_s[0] for row in rows])
    if np.ptp(speeds) > 1e-6:
        raise touchstone.InvalidRequest(f"{name} has touches at {' and '.join(f'{speed:g}' for speed in np.unique(speeds))} mm/s; a recogniser "
                                        "sees one speed: give a set of one.")
    objects = tuple(dict.fromkeys(row.object for row in rows))
    times = np.array([row.time_us for row in rows], float)
    first = np.min(np.where(np.isnan(times), np.inf, times), 1, keepdims=True)
    columns = {what: np.concatenate([getattr(row.command, what) for row in rows]) for what in ("target_mm", "approach", "lateral")}
    standoff = np.median([row.command.standoff_mm[0] for row in rows])
    return TouchData(objects, np.array([objects.index(row.object) for row in rows]), times - first, image=None, speed_mm_s=float(speeds[0]),
                     spacing_mm=spacing_mm, **columns), float(standoff)


def _copy_rows(source: pathlib.Path, to: pathlib.Path, keep: np.ndarray) -> None:
    """Those rows of a measurement file, with all columns."""
    with source.open(newline="", encoding="utf-8") as file:
        header, *rows = (row for row in csv.reader(file) if row)
    with whole_file(to, newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([header, *(row for row, kept in zip(rows, keep) if kept)])


@dataclasses.dataclass(frozen=True)
class Groups:
    """Poses of one object each, as many as a set has touches; every round of them is a set. No pose is in two groups.

    Attributes:
      rows: (sets, touches) rows of the data.
      group: (sets,) which group a set is of.
      objects: (groups,) whose groups they are.
    """

    rows: np.ndarray
    group: np.ndarray
    objects: np.ndarray

    def shares(self, right: np.ndarray) -> np.ndarray:
        """(groups,) the mean of what each set got."""
        return np.bincount(self.group, right, len(self.objects)) / np.bincount(self.group, minlength=len(self.objects))

    def folds(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """(groups,) a fold for each, of every object as many."""
        fold = np.empty(len(self.objects), int)
        for each in np.unique(self.objects):
            mine = rng.permutation(np.flatnonzero(self.objects == each))
            fold[mine] = np.arange(len(mine)) % count
        return fold


def groups(name: str, data: TouchData, touches: int, rng: np.random.Generator) -> Groups:
    """Of poses drawn at random; what is left over of an object is left out. InvalidRequest if an object has fewer than two groups."""
    rows: list[np.ndarray] = []
    group: list[int] = []
    objects: list[int] = []
    poses = data.poses()
    for k, what in enumerate(data.objects):
        mine = np.flatnonzero(data.object == k)
        of_pose = [mine[poses[mine] == pose] for pose in rng.permutation(np.unique(poses[mine]))]
        if len(of_pose) < 2 * touches:
            raise touchstone.InvalidRequest(
                f"{name} has {len(of_pose)} poses of {what} that can be used; sets of {touches} touches need {2 * touches} at least: one group to "
                f"train on, one to test. Measure more, or ask for smaller sets (touches={max(len(of_pose) // 2, 1)}).")
        for begin in range(0, len(of_pose) // touches * touches, touches):
            part = of_pose[begin:begin + touches]
            rounds = min(map(len, part))
            rows += [np.array([each[r] for each in part]) for r in range(rounds)]
            group += [len(objects)] * rounds
            objects.append(k)
    return Groups(np.array(rows), np.array(group), np.array(objects))
