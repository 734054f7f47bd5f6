"""Commands that are ended by Ctrl-C or SIGTERM: a line, an exit code, and nothing half-written."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from stored_parts import filled_store

SLOW_STATION = """
import signal, time
import numpy as np

signal.signal(signal.SIGINT, signal.default_int_handler)  # a parent in the background may have it ignored


class Station:
    def grab(self, light):
        if light == 3:
            open("begun", "w").close()
            time.sleep(60)
        return np.full((40, 40), 50, np.uint8)
"""
LONG_QUERY = """
import signal, time
from pathlib import Path
from threading import Timer

signal.signal(signal.SIGINT, signal.default_int_handler)
from bgars.cli import main
from bgars.store import query

ask = query._answer

def noted(*given):
    Timer(0.5, Path("begun").touch).start()
    return ask(*given)

query._answer = noted
main()
"""


def started(command: list[str], folder: Path) -> subprocess.Popen[str]:
    """A command that has begun to write."""
    running = subprocess.Popen(
        [sys.executable, *command], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    wait_until((folder / "begun").exists, running)
    return running


def wait_until(holds: Callable[[], bool], running: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + 120
    while not holds():
        assert running.poll() is None, running.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.skipif(os.name == "nt", reason="signals there are others")
@pytest.mark.parametrize(("ended_by", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_capture_that_is_ended_leaves_nothing(tmp_path: Path, ended_by: signal.Signals, code: int) -> None:
    (tmp_path / "slow_station.py").write_text(SLOW_STATION, encoding="utf-8")
    running = started(["-m", "bgars", "capture", "slow_station:Station", "-o", "inbox/SN1"], tmp_path)
    assert list((tmp_path / "inbox").iterdir()), "it is being written"
    running.send_signal(ended_by)
    out, err = running.communicate(timeout=60)
    assert (running.returncode, out, err) == (code, "", "interrupted; nothing half-written stays behind\n")
    assert list((tmp_path / "inbox").iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="signals there are others")
@pytest.mark.parametrize(("ended_by", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_query_that_takes_long_can_be_ended(tmp_path: Path, ended_by: signal.Signals, code: int) -> None:
    filled_store(tmp_path / "store", 1)
    running = started(
        [
            "-c",
            LONG_QUERY,
            "query",
            "store",
            "select count(*) from range(100000) a, range(9999999) b where a.range * b.range % 7 = 3",
        ],
        tmp_path,
    )
    running.send_signal(ended_by)
    out, err = running.communicate(timeout=60)
    assert (running.returncode, out, err) == (code, "", "interrupted; nothing half-written stays behind\n")
