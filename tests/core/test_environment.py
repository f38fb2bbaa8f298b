"""Variables are set for a block, by one thread at a time, and then all is as before."""

import os
import threading
from concurrent.futures import ThreadPoolExecutor

import cv2
import pytest

from hicp_lib.core.environment import with_variables
from hicp_lib.core.executor import single_threaded_opencv
from hicp_lib.core.files import write_bytes


def test_variables_are_as_before_also_after_an_error(monkeypatch):
    monkeypatch.setenv("HICP_A", "1")
    monkeypatch.delenv("HICP_B", raising=False)
    with pytest.raises(KeyError), with_variables(HICP_A="2", HICP_B="3"):
        with with_variables(HICP_A="4"):
            assert os.environ["HICP_A"] == "4"
        assert (os.environ["HICP_A"], os.environ["HICP_B"]) == ("2", "3")
        raise KeyError
    assert os.environ["HICP_A"] == "1" and "HICP_B" not in os.environ


def test_threads_that_overlap_leave_nothing_behind(monkeypatch):
    monkeypatch.delenv("HICP_A", raising=False)
    inside, leave = threading.Event(), threading.Event()

    def first() -> None:
        with with_variables(HICP_A="1"), single_threaded_opencv():
            inside.set()
            leave.wait()

    def second() -> None:
        inside.wait()
        with single_threaded_opencv():
            leave.set()
            with with_variables(HICP_A="2"):
                pass

    before = cv2.getNumThreads()
    cv2.setNumThreads(2)
    with ThreadPoolExecutor(2) as executor:
        [work.result() for work in [executor.submit(first), executor.submit(second)]]
    assert "HICP_A" not in os.environ and cv2.getNumThreads() == 2
    cv2.setNumThreads(before)


@pytest.mark.skipif(os.name != "posix", reason="no mask of permissions")
def test_files_get_the_callers_permissions_and_the_mask_is_never_touched(tmp_path, monkeypatch):
    before = os.umask(0o027)
    monkeypatch.setattr(os, "umask", lambda mask: pytest.fail("the mask is everybody's"))
    write_bytes(tmp_path / "a", b"")
    monkeypatch.undo()
    os.umask(before)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o640
