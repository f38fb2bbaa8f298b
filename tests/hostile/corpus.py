"""All hostile inputs, by name."""

from __future__ import annotations

from itertools import chain

from tests.hostile import (
    annotations,
    destroying,
    images,
    names,
    networks,
    options,
    planted,
    recordings,
    servers,
    special_files,
    videos,
)
from tests.hostile.case import Case, unique

MODULES = (
    special_files, images, videos, annotations, recordings, networks, servers, names, options, destroying,
    planted,
)  # fmt: skip


def corpus() -> dict[str, Case]:
    return unique(chain.from_iterable(module.cases() for module in MODULES))
