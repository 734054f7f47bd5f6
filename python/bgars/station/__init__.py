"""A station, calibrated once: where the lights are, how even they are, the camera's response, and the scale."""

from bgars.station.drift import drift
from bgars.station.flat import calibrate_flat
from bgars.station.lights import calibrate_lights
from bgars.station.response import response_from_bracket, response_from_sums, srgb_response
from bgars.station.scale import calibrate_scale
from bgars.station.verify import Known, read_known, verify

__all__ = [
    "Known",
    "calibrate_flat",
    "calibrate_lights",
    "calibrate_scale",
    "drift",
    "read_known",
    "response_from_bracket",
    "response_from_sums",
    "srgb_response",
    "verify",
]
