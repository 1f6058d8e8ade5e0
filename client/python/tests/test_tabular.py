"""Results as tables, figures and tensors: what stands in them is what the results say, and what is missing is named."""

import dataclasses
import importlib
import re
import types
from typing import Any

import numpy as np
import pytest

import touchstone
from touchstone import report_parts, tabular
from touchstone.report import Report
from touchstone.v1 import diagnosis_pb2

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
def results(client, measured):
    """{name: a result of each kind}."""
    diagnosed, compared = client.diagnose(measured, NOMINAL), client.compare(measured, NOMINAL, other_model=HIDDEN)
    checked = client.check(measured, NOMINAL)
    batch = next(iter(client.dataset(["lat00", "lat20"], samples=6, seed=1, columns=("index", "object", "descriptor", "contact"))))
    return {"diagnosed": diagnosed, "steps": diagnosed.steps, "checked": checked, "detectable": checked.detectable,
            "explained": client.explain("speed_error", measured, NOMINAL).explained, "versus": compared.versus, "batch": batch}


KINDS = ("diagnosed", "steps", "checked", "detectable", "explained", "versus", "batch")


@pytest.mark.parametrize("kind", KINDS)
def test_a_result_is_a_table_in_a_notebook(results, kind):
    result = results[kind]
    assert isinstance(result, touchstone.Tabular)
    shown = result._repr_html_()
    assert shown.count("<table>") == 1 and re.search(r"<tr><th>\w+</th>", shown)
    rows = len(next(iter(result._table().values())))
    assert shown.count("<tr>") == 1 + min(rows, tabular.SHOWN_ROWS)
    assert len(repr(result)) < 3000 and "message" not in repr(result)


@pytest.mark.parametrize("kind", KINDS)
def test_pandas_and_arrow_have_the_same_rows(results, kind):
    pandas = pytest.importorskip("pandas", reason="pandas is not installed; to_pandas() needs it.")
    pytest.importorskip("pyarrow", reason="pyarrow is not installed; to_arrow() needs it.")
    frame, table = results[kind].to_pandas(), results[kind].to_arrow()
    assert isinstance(frame, pandas.DataFrame) and len(frame) == table.num_rows > 0
    for name in table.column_names:
        if name in frame:
            assert frame[name].astype(object).where(frame[name].notna(), None).tolist() == table.column(name).to_pylist()


@pytest.mark.parametrize("kind", KINDS)
def test_a_result_is_drawn(results, kind):
    pyplot = pytest.importorskip("matplotlib.pyplot", reason="matplotlib is not installed; plot() needs it.")
    axes = results[kind].plot()
    assert axes.get_xlabel() and axes.has_data()
    assert results[kind].plot(axes) is axes
    pyplot.close(axes.figure)


def test_the_numbers_are_those_of_the_result(results):
    report, versus, explained = results["diagnosed"], results["versus"], results["explained"]
    ladder = report._table()
    assert ladder["model"] == ["given", "+ speed_error"] and ladder["unit"] == ["us", "us"]
    assert ladder["rmse"] == [report.rmse_us, report.data[0].after_step[0].rmse]
    assert report.steps._table()["effect"] == ["speed_error"] and report.steps == tuple(report.steps)
    assert versus._table()["rmse_difference"] == [versus.rmse_difference] and versus._table()["low"] == [versus.interval[0]]
    assert explained._table()["value"] == [explained.values[0].value] and explained._table()["name"] == ["relative"]
    assert results["checked"]._table()["effect"] == [value.effect for value in results["detectable"]]


def test_text_of_people_is_escaped():
    hostile = "<script>alert('x')</script>\x1b[31m"
    report = Report(diagnosis_pb2.Report(summary=hostile, data=[diagnosis_pb2.DataReport(
        kind=diagnosis_pb2.DataReport.TOUCHES, session=hostile, unit="us", initial=diagnosis_pb2.Quality(rmse=1))]))
    shown = report._repr_html_()
    assert "<script>" not in shown and shown.count("&lt;script&gt;") == 2 and "\x1b" not in shown


def test_a_large_table_says_how_much_is_left_out():
    step = report_parts.Step("a", (), 0.5, (), "", ())
    shown = touchstone.Rows([step] * 1030)._repr_html_()
    assert shown.count("<tr>") == 21 and "1,010 more rows" in shown
    assert touchstone.Rows([])._repr_html_().count("<td>") == 0


@pytest.mark.parametrize("method, module", [("to_pandas", "pandas"), ("to_arrow", "pyarrow"), ("plot", "matplotlib")])
def test_what_is_not_installed_is_named_with_the_way_to_get_it(monkeypatch, method, module):
    def absent(name, *rest):
        if name.partition(".")[0] == module:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return importlib.import_module(name, *rest)

    monkeypatch.setattr(tabular, "importlib", types.SimpleNamespace(import_module=absent))
    with pytest.raises(ModuleNotFoundError, match=rf"{method}\(\) needs {module}, which is not installed: pip install {module}"):
        getattr(touchstone.Rows([report_parts.Step("a", (), 0.5, (), "", ())]), method)()


def test_values_of_several_sessions_are_a_table_too():
    pytest.importorskip("pyarrow", reason="pyarrow is not installed; to_arrow() needs it.")
    by_session = {0: (1.5, 0.1), 2: (1.7, 0.2)}
    fields: dict[str, Any] = dict.fromkeys((field.name for field in dataclasses.fields(report_parts.ComparedValue)), "x")
    value = report_parts.ComparedValue(**{**fields, "by_session": by_session, "interval": (0.1, 0.3)})
    table = touchstone.Rows([value, value]).to_arrow()
    assert table.column("by_session").to_pylist()[1] == {"0": [1.5, 0.1], "2": [1.7, 0.2]}
    assert table.column("interval").to_pylist()[0] == [0.1, 0.3]


def test_columns_of_several_numbers_become_columns_each(results):
    batch = results["batch"]
    flat = dict(tabular._flat(batch._table()))
    np.testing.assert_array_equal(flat["descriptor_us_2"], batch["descriptor_us"][:, 2])
    np.testing.assert_array_equal(flat["contact_point_mm_1_2"], batch["contact_point_mm"][:, 1, 2])
    assert "descriptor_us" not in flat


def test_arrow_holds_arrays_without_a_copy(results):
    pytest.importorskip("pyarrow", reason="pyarrow is not installed; to_arrow() needs it.")
    batch = results["batch"]
    column = batch.to_arrow().column("contact_point_mm").chunk(0)
    assert column.type.list_size == 3 and column.to_pylist() == batch["contact_point_mm"].tolist()
    assert column.flatten().flatten().buffers()[1].address == batch["contact_point_mm"].ctypes.data


def test_columns_have_the_types_that_are_told(client):
    batch = next(iter(client.dataset(["lat00", "lat20"], samples=4, columns=("index", "object", "descriptor", "image"),
                                     image=touchstone.image(16, 16, depth=True, mask=True))))
    columns = batch.columns()
    assert columns["object"].dtype == np.int64 and columns["object"].tolist() == [0, 1, 0, 1]
    assert columns["index"].dtype == np.uint64 and columns["descriptor_us"].dtype == np.float32
    assert set(columns) == set(batch) <= set(touchstone.Columns.__annotations__)
    # The source's own columns stay as they are sent.
    assert next(iter(client.dataset(["lat00"], samples=4, units="si")))["object"].dtype == np.int32


def test_tensors_share_the_memory_of_the_batch(client):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed; to_torch() needs it.")
    batch = next(iter(client.dataset(["lat00", "lat20"], samples=4, columns=("object", "descriptor", "image"), image=(16, 16))))
    before = batch["image"].copy()
    tensors = batch.to_torch()
    assert tensors["image"].shape == (4, 1, 16, 16) and tensors["object"].dtype == torch.int64
    for name in ("image", "descriptor_us", "object"):
        assert tensors[name].data_ptr() == batch[name].ctypes.data
    np.testing.assert_array_equal(tensors["image"].permute(0, 2, 3, 1), before)
    # By DLPack too, and they outlive the batch.
    shared = torch.utils.dlpack.from_dlpack(tensors["image"])
    del batch, tensors
    np.testing.assert_array_equal(shared.permute(0, 2, 3, 1), before)
