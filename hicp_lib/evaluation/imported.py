"""Detections made elsewhere, taken into the comparison beside the detectors that are run here."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from hicp_lib.annotations import Annotations, read_detections
from hicp_lib.detectors.base import Detections
from hicp_lib.errors import InputError

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+:-]{0,39}")


def read_imported(
    items: Sequence[str], truth: Mapping[str, Annotations]
) -> dict[tuple[str, str], dict[int, Detections]]:
    """Detections by (subset, "NAME-imported"), as `hicp_lib.evaluation.compare` takes them.

    The suffix tells them from a detector of that name which is run here.

    Parameters
    ----------
    items : "NAME=DIR" each; DIR holds a file of detections per subset, such as `basic.json` and
        `headless.json`, as `hicp import` and `hicp detect` write them
    truth : subset -> annotations

    Raises
    ------
    InputError
        For items of another form, names used twice, and files that are absent or do not fit.
    """
    found: dict[tuple[str, str], dict[int, Detections]] = {}
    for item in items:
        name, equals, folder = item.partition("=")
        if not equals or not _NAME.fullmatch(name) or not folder:
            raise InputError(f"imported {item!r}: expected NAME=DIR, such as mmpose=my_detections/mmpose")
        for subset, people in truth.items():
            key = (subset, f"{name}-imported")
            if key in found:
                raise InputError(f"imported {item!r}: the name {name!r} is in use; give another")
            found[key] = read_detections(Path(folder) / f"{subset}.json", people)
    return found
