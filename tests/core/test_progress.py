"""Bars are for people who wait: on a terminal, and not for what is done at once."""

import io
import sys

import pytest

from hicp_lib.core import progress
from hicp_lib.core.progress import with_bar


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("stream", "delay_s", "told"), [(io.StringIO, 0, False), (Terminal, 0, True), (Terminal, 2, False)]
)
def test_a_bar_is_shown_on_a_terminal_and_after_a_while_only(monkeypatch, stream, delay_s, told):
    made, bar = stream(), progress.tqdm
    monkeypatch.setattr(sys, "stderr", made)
    monkeypatch.setattr(
        progress, "tqdm", lambda *of, **how: bar(*of, **how | {"delay": delay_s and how["delay"]})
    )
    assert list(with_bar(range(3), "counting")) == [0, 1, 2]
    assert ("counting" in made.getvalue()) == told
