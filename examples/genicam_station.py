"""Any GenICam camera through its maker's GenTL producer and harvesters (pip install harvesters), for bgars capture:

    GENTL_PRODUCER=/opt/maker/lib/producer.cti \\
    bgars capture genicam_station:Station -o INBOX/SN0042 --lights 8 --rig rig/capture.toml

Without a camera: the package genicam, which comes with harvesters, holds a virtual one, viky.cti.
"""

from __future__ import annotations

import atexit
import os
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import genicam
import numpy as np
from harvesters.core import Harvester
from led_controller import TextLights

PRODUCER = os.environ.get("GENTL_PRODUCER") or str(Path(genicam.__file__).with_name("viky.cti"))
EXPOSURE_US = 8000.0
PIXELS = ("Mono12", "Mono8", "RGB8", "RGBa8")
"""The first that the camera has."""
CHANNELS = {"RGB8": 3, "RGBa8": 4}
LEDS: tuple[str, int] | None = None  # ("192.168.0.7", 5000)
TIMEOUT_S = 5.0


class Station:
    """The first camera that the producer sees, triggered by software, one light after the other."""

    def __init__(self) -> None:
        self.harvester = Harvester()
        self.harvester.add_file(PRODUCER)
        self.harvester.update()
        self.camera = self.harvester.create(0)
        atexit.register(self.close)
        self.lights = None if LEDS is None else TextLights(*LEDS)
        self.nodes = self.camera.remote_device.node_map
        for name in ("ExposureAuto", "GainAuto", "BalanceWhiteAuto"):
            self._set(name, "Off")
        known = self.nodes.PixelFormat.symbolics
        self._set("PixelFormat", next((form for form in PIXELS if form in known), self.nodes.PixelFormat.value))
        self._set("ExposureTime", EXPOSURE_US)
        self.is_triggered = all(
            self._set(name, value)
            for name, value in (("TriggerSelector", "FrameStart"), ("TriggerMode", "On"), ("TriggerSource", "Software"))
        )

    def grab(self, light: int) -> np.ndarray[Any, Any]:
        with nullcontext() if self.lights is None else self.lights.on(light):
            # Started for each image: a camera without a trigger must not show one from before the light burnt.
            self.camera.start()
            try:
                if self.is_triggered:
                    self.nodes.TriggerSoftware.execute()
                with self.camera.fetch(timeout=TIMEOUT_S) as buffer:
                    return self._pixels(buffer.payload.components[0])
            finally:
                self.camera.stop()

    def close(self) -> None:
        self.camera.destroy()
        self.harvester.reset()

    def _pixels(self, part: Any) -> np.ndarray[Any, Any]:  # noqa: ANN401 - harvesters has no types
        """A copy: the buffer goes back to the camera."""
        channels = CHANNELS.get(part.data_format, 1)
        image = np.array(part.data).reshape(part.height, part.width, channels)
        return image[:, :, 0] if channels == 1 else image[:, :, :3]

    def _set(self, name: str, value: object) -> bool:
        """Set what this model has; return whether it has it."""
        node = getattr(self.nodes, name, None)
        if node is None:
            return False
        node.value = value
        return True
