"""Names and values between the wire and the lab."""

import numpy as np
import pytest

from touchstone import units


@pytest.mark.parametrize("si, lab", [
    ("descriptor_s", "descriptor_us"),
    ("contact_time_s", "contact_time_us"),
    ("speed_m_s", "speed_mm_s"),
    ("standoff_m", "standoff_mm"),
    ("step_angle_rad", "step_angle_deg"),
    ("session_time_s", "session_time_s"),
    ("normal", "normal"),
    ("mask", "mask"),
])
def test_every_name_keeps_its_unit(si, lab):
    assert units.lab_name(si) == lab


@pytest.mark.parametrize("name, lab, si", [("speed_m_s", 20, 0.02), ("standoff_m", 60, 0.06), ("x_rad", 180, np.pi)])
def test_values_convert_exactly_where_a_double_can(name, lab, si):
    assert units.si_value(name, lab) == si
    assert units.lab_value(name, si) == pytest.approx(lab, rel=1e-15)


def test_arrays_keep_their_type_and_are_not_copied_without_need():
    times = np.array([1e-3, 2e-6], np.float32)
    assert units.lab_array("descriptor_s", times).dtype == np.float32
    np.testing.assert_allclose(units.lab_array("descriptor_s", times), [1000, 2], rtol=1e-6)
    assert units.lab_array("normal", times) is times
