"""Recognisers of feature sets, with the parameters that all experiments use."""

from __future__ import annotations

from typing import Any, Callable

import numpy as np
import xgboost
from sklearn import discriminant_analysis, ensemble, linear_model, naive_bayes, neighbors, neural_network, pipeline, preprocessing, svm

from .features import FeatureSets, joined
from .separation import check


def _scaled(recogniser: Any) -> Any:
    return pipeline.make_pipeline(preprocessing.StandardScaler(), recogniser)


# The seed's three: name -> a new, untrained recogniser for a seed.
SEEDS: dict[str, Callable[[int], Any]] = {
    "XGBoost": lambda seed: xgboost.XGBClassifier(n_estimators=100, max_depth=4, learning_rate=0.2, n_jobs=1,
                                                  random_state=seed, verbosity=0),
    "SVM": lambda seed: _scaled(svm.SVC(C=3.0, random_state=seed)),
    "naive Bayes": lambda seed: naive_bayes.GaussianNB(var_smoothing=1e-3),
}
# Ten different ones, to ask whether simulation ranks them as measured data do.
TEN: dict[str, Callable[[int], Any]] = {
    **SEEDS,
    "nearest neighbours": lambda seed: _scaled(neighbors.KNeighborsClassifier(9)),
    "logistic regression": lambda seed: _scaled(linear_model.LogisticRegression(max_iter=500, random_state=seed)),
    "linear discriminant": lambda seed: discriminant_analysis.LinearDiscriminantAnalysis(solver="lsqr", shrinkage="auto"),
    "random forest": lambda seed: ensemble.RandomForestClassifier(200, random_state=seed),
    "extra trees": lambda seed: ensemble.ExtraTreesClassifier(200, random_state=seed),
    "decision tree": lambda seed: _scaled(ensemble.BaggingClassifier(n_estimators=1, random_state=seed)),
    "perceptron": lambda seed: _scaled(neural_network.MLPClassifier((32,), max_iter=300, random_state=seed)),
}


class Trained:
    """A recogniser that was trained on feature sets, and is asked about none of their poses (Leak)."""

    def __init__(self, recogniser: Any, *train: FeatureSets, check_poses: bool = True):
        """`recogniser`: a new one. `check_poses` False: where a leak is what is shown."""
        sets = joined(*train)
        self._recogniser = recogniser.fit(sets.values, sets.objects)
        self._poses = np.unique(sets.poses) if check_poses else np.empty(0, np.int64)

    def predict(self, sets: FeatureSets) -> np.ndarray:
        """(M,) objects."""
        check(self._poses, sets.poses)
        return self._recogniser.predict(sets.values)

    def probabilities(self, sets: FeatureSets) -> np.ndarray:
        """(M, classes)."""
        check(self._poses, sets.poses)
        return self._recogniser.predict_proba(sets.values).astype(float)

    def accuracy(self, sets: FeatureSets) -> float:
        """Share of the sets that it recognises."""
        return float(np.mean(self.predict(sets) == sets.objects))


def accuracy(recogniser: Any, train: FeatureSets, test: FeatureSets) -> float:
    """Of a new recogniser after it was trained."""
    return Trained(recogniser, train).accuracy(test)


def confusion(recogniser: Trained, test: FeatureSets, classes: int) -> np.ndarray:
    """(true, recognised) counts."""
    return np.bincount(test.objects * classes + recogniser.predict(test), minlength=classes**2).reshape(classes, classes)


def shuffled(train: FeatureSets, rng: np.random.Generator) -> FeatureSets:
    """The same sets with their objects exchanged at random: whoever learns from them can know nothing."""
    return FeatureSets(train.values, rng.permutation(train.objects), train.poses)
