"""A Basler camera through pypylon (pip install pypylon), for bgars capture:

    bgars capture pylon_station:Station -o INBOX/SN0042 --lights 8 --rig rig/capture.toml

Without a camera: PYLON_CAMEMU=1 makes pylon's own emulator appear.
"""

from __future__ import annotations

import atexit
from contextlib import nullcontext
from typing import Any

import numpy as np
from led_controller import TextLights
from pypylon import genicam, pylon

EXPOSURE_US = 8000.0
PIXELS = ("Mono12", "Mono8")
"""The first that the camera has. Linear, and the same for all lights."""
LEDS: tuple[str, int] | None = None  # ("192.168.0.7", 5000)
TIMEOUT_MS = 5000


class Station:
    """One camera, triggered by software, one light after the other."""

    def __init__(self) -> None:
        self.camera = pylon.InstantCamera(pylon.TlFactory.GetInstance().CreateFirstDevice())
        self.camera.Open()
        atexit.register(self.camera.Close)
        self.lights = None if LEDS is None else TextLights(*LEDS)
        # What changes from image to image by itself would be taken for shape.
        for name in ("ExposureAuto", "GainAuto", "BalanceWhiteAuto"):
            self._set(name, "Off")
        self._set("PixelFormat", next(form for form in PIXELS if form in self.camera.PixelFormat.Symbolics))
        for name in ("ExposureTime", "ExposureTimeAbs"):
            self._set(name, EXPOSURE_US)
        for name, value in (("TriggerSelector", "FrameStart"), ("TriggerMode", "On"), ("TriggerSource", "Software")):
            self._set(name, value)
        self.camera.StartGrabbing(pylon.GrabStrategy_OneByOne)

    def grab(self, light: int) -> np.ndarray[Any, Any]:
        with nullcontext() if self.lights is None else self.lights.on(light):
            if self.camera.CanWaitForFrameTriggerReady():
                self.camera.WaitForFrameTriggerReady(TIMEOUT_MS, pylon.TimeoutHandling_ThrowException)
            self.camera.ExecuteSoftwareTrigger()
            taken = self.camera.RetrieveResult(TIMEOUT_MS, pylon.TimeoutHandling_ThrowException)
        try:
            if not taken.GrabSucceeded():
                msg = f"camera: light {light}: {taken.GetErrorDescription()}"
                raise OSError(msg)
            return np.array(taken.Array)
        finally:
            taken.Release()

    def _set(self, name: str, value: object) -> None:
        """Set what this model has; the names differ between the families."""
        node = self.camera.GetNodeMap().GetNode(name)
        if node is not None and genicam.IsWritable(node):
            getattr(self.camera, name).Value = value
