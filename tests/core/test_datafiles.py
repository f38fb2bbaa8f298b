"""The data are found beside the package in a checkout, and within it once installed."""

from __future__ import annotations

from hicp_lib.core.datafiles import data_dir


def test_a_wheel_brings_them_within_the_package_and_a_checkout_has_them_beside_it(tmp_path):
    package, beside = tmp_path / "hicp_lib", tmp_path / "data"
    (package / "data").mkdir(parents=True)
    assert data_dir(package) == beside  # an empty folder of that name is not them
    (package / "data" / "detectors.json").write_text("{}")
    assert data_dir(package) == package / "data"
