"""How sure the predictions of a fitted model are, and models drawn from what a report leaves open."""

import numpy as np
import pytest

import touchstone

NOMINAL = "touchstone: model/1\nname: nominal_rig\neffects:\n  - gaussian_noise: {sigma_us: 2000}\n"
HIDDEN = NOMINAL.replace("nominal_rig", "fast_rig") + "  - speed_error: {relative: 0.08}\n"


@pytest.fixture(scope="module")
def client(server):
    return touchstone.connect(server.target)


@pytest.fixture(scope="module")
def measured(client, two_rounds):
    """By a rig that is too fast."""
    return two_rounds(client, HIDDEN)


@pytest.fixture(scope="module")
def report(client, measured):
    return client.diagnose(measured, NOMINAL)


def test_a_report_has_a_budget_of_its_own_touches(report):
    lat20, everything = report.uncertainty
    assert (lat20.object, everything.object) == ("lat20", "")
    assert lat20.combined == pytest.approx(np.sqrt(lat20.parameters**2 + lat20.surface**2 + lat20.repeatability**2))
    assert lat20.source == "repeatability" and lat20.share == pytest.approx((lat20.repeatability / lat20.combined)**2)
    assert lat20.reproducibility is None and lat20.beyond_measured == 0
    assert next(iter(lat20.contributions)) == "repeatability"


def test_a_plan_gets_a_budget_and_a_figure(client, report, measured, tmp_path):
    found = client.uncertainty(report, measured)
    assert found.verdict == "" and "is predicted with a standard uncertainty of" in found.summary
    report.save(tmp_path / "report.json")
    assert client.uncertainty(tmp_path / "report.json", measured).uncertainty == found.uncertainty
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    axes = found.uncertainty.plot()
    assert [text.get_text() for text in axes.get_legend().get_texts()][:1] == ["parameters"]


def test_a_budget_is_a_table(report):
    pytest.importorskip("pandas")
    frame = report.uncertainty.to_pandas()
    assert list(frame["object"]) == ["lat20", ""] and frame["combined"].min() > 0


def test_a_dataset_has_uncertainties_and_models_of_its_own(client, report):
    def stream(**how):
        batches = list(client.dataset("lat20", samples=300, seed=3, **how))
        return {name: np.concatenate([batch[name] for batch in batches]) for name in batches[0]}

    plain = stream(model=report.improved_model)
    sure = stream(uncertainty=report)
    assert sure["std_uncertainty_us"].shape == (300, 3) and sure["beyond_measured"].dtype == np.uint8
    assert (sure["std_uncertainty_us"] > 1600).all() and (sure["descriptor_us"] == plain["descriptor_us"]).all()
    drawn = stream(models_from=report, columns=["index", "descriptor", "model_values"])
    again = stream(models_from=report, columns=["index", "descriptor", "model_values"], batch_size=7)
    assert all((drawn[name] == again[name]).all() for name in drawn)
    names = [value.parameter for value in report.message.posterior.values]
    relative = drawn["model_values"][:, names.index("relative")]
    value = report.message.posterior.values[names.index("relative")]
    assert relative.mean() == pytest.approx(value.value, abs=5 * value.std_error / np.sqrt(300))
    assert relative.std() == pytest.approx(value.std_error, rel=0.25)


def test_what_has_no_posterior_is_refused(client, report, measured, tmp_path):
    with pytest.raises(touchstone.InvalidRequest, match="says nothing of how sure its model is"):
        client.dataset("lat20", samples=3, models_from=client.compare(measured, NOMINAL))
    with pytest.raises(touchstone.InvalidRequest, match=r"absent\.json"):
        client.uncertainty(tmp_path / "absent.json", measured)
    with pytest.raises(touchstone.InvalidRequest, match="is that of model 'nominal_rig_better'"):
        next(iter(client.dataset("lat20", samples=3, models_from=report, model=NOMINAL)))
    other = client.diagnose(measured, HIDDEN)
    with pytest.raises(touchstone.InvalidRequest, match="two reports"):
        client.dataset("lat20", samples=3, models_from=report, uncertainty=other)
