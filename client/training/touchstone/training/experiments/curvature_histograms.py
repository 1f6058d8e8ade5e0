"""Figure 8 of the seed: histograms of local curvature of five objects, ideal, noisy and measured."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from scipy import stats

from .. import figures, plans
from ..context import Context
from ..experiment import Experiment
from ..result import Result, Table

_BINS = np.linspace(-60, 60, 49)  # 1/m


def run(context: Context) -> Result:
    settings = context.settings
    per_object = settings.pick(200, 4000)
    objects = plans.OBJECTS
    sources = {
        "ideal": context.simulated(per_object * len(objects), model=plans.IDEAL),
        "noisy": context.simulated(per_object * len(objects), model=plans.NOISY),
        settings.measured_kind: context.measured(plans.measured(settings), options=plans.RIG),
    }
    values = {name: [data.curvature()[data.object == k] for k in range(len(objects))] for name, data in sources.items()}
    distances = _distances(values, settings.measured_kind)
    result = Result("", "", made_on=[f"{name}: {len(data):,} touches of {len(objects)} objects" for name, data in sources.items()])
    closer = np.mean([row["noisy"] < row["ideal"] for row in distances.values()])
    result.words = [
        (f"With noise in the simulation its histograms come closer to the {settings.measured_kind} ones for "
         f"{closer:.0%} of the objects (Wasserstein distance, 1/m).")]
    result.tables = [Table(f"Wasserstein distance to the {settings.measured_kind} histogram, 1/m", ["object", "ideal", "noisy"],
                           [[name, f"{row['ideal']:.2f}", f"{row['noisy']:.2f}"] for name, row in distances.items()])]
    result.figures = [_draw(context, objects, values)]
    result.data = {"distances": distances, "histograms": {
        name: {o: np.histogram(v, _BINS)[0].tolist() for o, v in zip(objects, each)} for name, each in values.items()},
        "bins": _BINS.tolist()}
    return result


def _distances(values, measured):
    return {name: {kind: float(stats.wasserstein_distance(values[kind][k], values[measured][k])) for kind in ("ideal", "noisy")}
            for k, name in enumerate(plans.OBJECTS)}


def _draw(context, objects, values):
    figure, all_axes = plt.subplots(len(values), len(objects), figsize=(2.1 * len(objects), 1.7 * len(values)), sharex=True,
                                    sharey="row")
    for row, (kind, each) in zip(all_axes, values.items()):
        for axes, name, curvatures in zip(row, objects, each):
            axes.hist(curvatures, _BINS, density=True, color=figures.colour(kind))
            axes.set_yticks([])
            if kind == "ideal":
                axes.set_title(name)
        row[0].set_ylabel(kind)
    figure.supxlabel("local curvature, 1/m")
    return figures.save(figure, context.figure_path("histograms"), "Histograms of local curvature. Each row has one scale.")


EXPERIMENT = Experiment("curvature_histograms", "Histograms of local curvature",
                        "figure 8: histograms of five objects, ideal, noisy and measured, shown without numbers", run, (40, 200))
