"""A recogniser that a user wrote in a file, and the one that is tried without.

The file is Python. It must have

    def fit(features, labels, seed):
        '''features: (sets, F) float array; labels: (sets,) int, the number of the object; seed: int.

        Returns an object with predict(features) -> (sets,) the labels that it gives.
        '''

and may have

    def features(times_us, speed_mm_s, spacing_mm):
        '''times_us: (sets, touches, fingers) contact times in microseconds less the first finger's.

        Returns (sets, F), what fit and predict are given. Without it: the sorted local curvatures of each set's touches; with
        other than three fingers the times themselves.
        '''
"""

from __future__ import annotations

import contextlib
import os
import pathlib
import sys
import traceback
import types
from collections.abc import Iterator
from typing import Any

import numpy as np

import touchstone

from .. import features
from ..recognisers import SEEDS
from ..touch_data import TouchData


class FileError(touchstone.InvalidRequest):
    """What is wrong with the file of a recogniser, with its line."""


class Recogniser:
    """Attributes:
      name: of it in words.
    """

    def __init__(self, path: str | os.PathLike[str] | None = None):
        """`path`: of the file; None: XGBoost, as the experiments train it."""
        self.name = "XGBoost" if path is None else os.fspath(path)
        self._path = None if path is None else pathlib.Path(path)
        self._module: Any = None if self._path is None else self._load(self._path)

    def new(self, seed: int, objects: int) -> _Untrained:
        """Of so many objects."""
        return _Untrained(self, seed, objects)

    def features(self, data: TouchData, rows: np.ndarray) -> np.ndarray:
        """(sets, F) what is seen of the sets whose touches are these (sets, touches) rows."""
        given = getattr(self._module, "features", None)
        if given is None:
            three = data.times_us.shape[1] == 3
            return features.curvatures(data, rows) if three else features.triples(data, rows)
        with self.watched("features()"):
            found = np.asarray(given(data.times_us[rows], data.speed_mm_s, data.spacing_mm), float)
        if found.ndim != 2 or len(found) != len(rows):
            raise FileError(f"{self.line_of(given)}: features() gave an array of shape {found.shape} for {len(rows)} sets; "
                            f"({len(rows)}, F) would be right.")
        return found

    def fit(self, values: np.ndarray, labels: np.ndarray, seed: int) -> Any:
        if self._path is None:
            return SEEDS["XGBoost"](seed).fit(values, labels)
        with self.watched("fit()"):
            trained = self._module.fit(values, labels, seed)
        if not callable(getattr(trained, "predict", None)):
            raise FileError(f"{self.line_of(self._module.fit)}: fit() returned {type(trained).__name__}, which has no predict(features).")
        return trained

    @contextlib.contextmanager
    def watched(self, what: str) -> Iterator[None]:
        """What the user's code raises becomes a FileError that names the line."""
        try:
            yield
        except (Exception, SystemExit) as error:
            if self._path is None:
                raise
            raise FileError(f"{self._place(error)}: {what} raised {type(error).__name__}: {error}") from error

    def line_of(self, function: Any) -> str:
        """FILE:LINE of a function of the file; the file alone of another one."""
        code = getattr(function, "__code__", None)
        return f"{self.name}:{code.co_firstlineno}" if code is not None and code.co_filename == os.path.abspath(self.name) else self.name

    def _place(self, error: BaseException) -> str:
        """The deepest line of the file that was under way."""
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__)
                 if frame.filename == os.path.abspath(self.name)]
        return f"{self.name}:{lines[-1]}" if lines else self.name

    def _load(self, path: pathlib.Path) -> Any:
        try:
            code = compile(path.read_bytes(), os.path.abspath(path), "exec")
        except OSError as error:
            raise FileError(f"{path}: {error.strerror}.") from None
        except (SyntaxError, ValueError) as error:
            raise FileError(f"{path}:{getattr(error, 'lineno', None) or 1}: {getattr(error, 'msg', error)}") from None
        name = f"touchstone_recogniser_{path.stem}"
        module: Any = types.ModuleType(name)
        module.__file__ = str(path)
        sys.modules[name] = module  # so that what it makes can be pickled, for several processes of its own
        sys.path.insert(0, str(path.parent.resolve()))  # its neighbours can be imported, as by `python FILE.py`
        with self.watched("the file"):
            exec(code, module.__dict__)
        if not callable(getattr(module, "fit", None)):
            raise FileError(f"{path} has no function fit(features, labels, seed).")
        return module


class _Untrained:
    """As scikit-learn's: what recognisers.Trained trains and asks."""

    def __init__(self, recogniser: Recogniser, seed: int, objects: int):
        self._recogniser, self._seed, self._objects = recogniser, seed, objects

    def fit(self, values: np.ndarray, labels: np.ndarray) -> _Untrained:
        self._trained = self._recogniser.fit(values, labels, self._seed)
        return self

    def predict(self, values: np.ndarray) -> np.ndarray:
        name = self._recogniser.line_of(self._trained.predict)
        with self._recogniser.watched("predict()"):
            said = np.asarray(self._trained.predict(values))
        if said.shape != (len(values),):
            raise FileError(f"{name}: predict() gave an array of shape {said.shape} for {len(values)} sets; ({len(values)},) "
                            "would be right: a label for each.")
        if said.dtype.kind not in "iufb" or not np.isin(said, np.arange(self._objects)).all():
            strange = next(one for one in said.tolist() if one not in range(self._objects))
            raise FileError(f"{name}: predict() gave {strange!r}; labels are whole numbers from 0 to {self._objects - 1}, as fit() "
                            "is given them.")
        return said.astype(int)
