"""The check on bare systems says in one line why it cannot be tried; `.ci/run` goes by its exit code."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from hicp_lib.core.checkout import CHECKOUT

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="chroot and mounts of Linux")


def test_what_cannot_be_tried_is_told_in_one_line(tmp_path):
    done = subprocess.run(
        [CHECKOUT / "tools" / "bare_machine.sh", "nowhere", "false"], capture_output=True, text=True,
        env=os.environ | {"BARE_DIR": str(tmp_path / "bare")},
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("bare_machine: ") and done.stderr.count("\n") == 1
    assert any(words in done.stderr for words in ("needs root", "may not mount", "expected bookworm, trixie"))
    assert str(tmp_path) not in open("/proc/mounts").read()
