"""The book's page on simulated sensors says what the settings are."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from hicp_lib.simulation.sensors.motion_capture import QUALISYS
from hicp_lib.simulation.sensors.stereo_camera import D435, D435_VGA
from hicp_lib.simulation.sensors.time_of_flight import AZURE_KINECT

PAGE = Path(__file__).parents[3] / "book" / "sensors.md"


@pytest.mark.parametrize(("settings", "column"), [(D435, 0), (D435_VGA, 1), (AZURE_KINECT, 2), (QUALISYS, 0)])
def test_every_setting_is_documented_with_its_value(settings, column):
    rows = dict(re.findall(r"^\| `(\w+)` \| (.+?) \|[^|]*$", PAGE.read_text(), re.M))
    for field in fields(settings):
        value = rows[field.name].split(" | ")[column]
        assert float({"True": 1}.get(value, value)) == getattr(settings, field.name), field.name
