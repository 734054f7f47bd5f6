"""A station without a camera: the images of folders, one folder per part, as if they were taken now.

    bgars capture folder_station:Station -o INBOX/SN0042 --lights 8 --rig rig/capture.toml

``folder:PATH`` does the same for one folder without any code; here the next part comes with every start.
"""

from __future__ import annotations

import os
from pathlib import Path

from bgars.line.camera import FolderCamera

PARTS = os.environ.get("PARTS", "parts")
COUNTER = Path(PARTS) / ".next"


def Station() -> FolderCamera:  # noqa: N802 - the command's word for it
    folders = sorted(path for path in Path(PARTS).iterdir() if path.is_dir())
    number = int(COUNTER.read_text()) if COUNTER.is_file() else 0
    COUNTER.write_text(str(number + 1))
    return FolderCamera(folders[number % len(folders)])
