"""Recognisers of feature sets, with the parameters that all experiments use."""

from __future__ import annotations

from typing import Any, Callable

import numpy as np
import xgboost
from sklearn import discriminant_analysis, ensemble, linear_model, naive_bayes, neighbors, neural_network, pipeline, preprocessing, svm


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


def accuracy(recogniser: Any, train: tuple[np.ndarray, np.ndarray], test: tuple[np.ndarray, np.ndarray]) -> float:
    """Share of the test sets that it recognises after it was trained."""
    return float(np.mean(recogniser.fit(*train).predict(test[0]) == test[1]))


def confusion(recogniser: Any, test: tuple[np.ndarray, np.ndarray], classes: int) -> np.ndarray:
    """(true, recognised) counts of a trained one."""
    return np.bincount(test[1] * classes + recogniser.predict(test[0]), minlength=classes**2).reshape(classes, classes)
