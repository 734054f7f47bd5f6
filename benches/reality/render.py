"""Radiance of a part under each lamp, and the truth of each pixel, from the renderer's own rays."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from balls import smooth_board_mm
from lamps import lamp_directions, lamp_points
from rendered import Rendered
from scene import RenderScene

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray
    from setup_records import Setup

BALL_ABOVE_MM = 0.045
"""What lies higher above the board than its relief can belongs to a ball."""
LED_SAMPLES, SEGMENT_SAMPLES, INDIRECT_SAMPLES = 4, 1, 9
"""Samples a pixel for each point of a lamp, and for reflections between balls and board."""
INDIRECT_BLUR_PX = 2.0


def render(mitsuba: ModuleType, setup: Setup) -> Rendered:
    """Render a part: 10 to 60 s on two cores."""
    with tempfile.TemporaryDirectory() as folder:
        scene = RenderScene(mitsuba, setup, Path(folder))
        normals, z_mm, ball, mixed = _truth_maps(scene)
        nominal, true = lamp_directions(setup)
        radiance = np.array([_one_lamp(scene, ball, middle, lamp) for lamp, middle in enumerate(true)])
    return Rendered(radiance, normals.astype(np.float32), z_mm, ball, mixed, nominal, true, scene.truths)


def _truth_maps(
    scene: RenderScene,
) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.int16], NDArray[np.bool_]]:
    """Normals, height, number of the ball, and pixels near an outline, without fibres."""
    mitsuba, view = scene.mitsuba, scene.setup.view
    shape = view.height, view.width
    row, col = np.mgrid[0 : view.height, 0 : view.width]
    middle = [((axis.ravel() + 0.5) / count).astype("f4") for axis, count in ((col, view.width), (row, view.height))]
    ray, _ = scene.clean.sensors()[0].sample_ray(0.0, 0.5, mitsuba.Point2f(*middle), mitsuba.Point2f(0.5))
    hit = scene.clean.ray_intersect(mitsuba.Ray3f(ray))
    places = np.array(hit.p).T.reshape(*shape, 3).astype(float)
    normals = np.array(hit.sh_frame.n).T.reshape(*shape, 3).astype(float)
    valid = np.array(hit.is_valid()).reshape(shape).astype(bool)
    ground = smooth_board_mm(scene.setup, places[..., 0], places[..., 1])
    high = (places[..., 2] - ground > BALL_ABOVE_MM) & valid
    centres = np.array([(ball.x_mm, ball.y_mm) for ball in scene.balls])
    reach = np.array([1.12 * ball.radius_mm for ball in scene.balls])
    beyond = np.linalg.norm(places[high][:, None, :2] - centres[None], axis=-1) - reach
    ball = np.zeros(shape, np.int16)
    ball[high] = np.array([one.number for one in scene.balls])[beyond.argmin(1)]
    mixed = ~valid
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            mixed |= np.roll(ball, (down, right), (0, 1)) != ball
    return normals, places[..., 2].astype(np.float32), ball, mixed


def _one_lamp(
    scene: RenderScene, ball: NDArray[np.int16], middle: NDArray[np.float64], lamp: int
) -> NDArray[np.float32]:
    """Radiance (rows, columns) under one lamp: direct light of its points, reflections of its middle."""
    mitsuba, setup = scene.mitsuba, scene.setup
    size = setup.view.width, setup.view.height

    def image(integrator: dict[str, Any], sensor: int, samples: int, seed: int) -> NDArray[np.float64]:
        loaded = mitsuba.load_dict(integrator)
        found = np.array(mitsuba.render(scene.whole, sensor=sensor, integrator=loaded, spp=samples, seed=seed))
        return found.reshape(found.shape[:2]).astype(np.float64)

    def half_image(segments: int) -> NDArray[np.float64]:
        integrator = {"type": "path", "max_depth": segments, "rr_depth": 100}
        return image(integrator, 1, INDIRECT_SAMPLES, 1000 * lamp + 1)

    scene.set_light(middle)
    reflected = half_image(setup.solder.path_segments) - half_image(2)
    reflected = cv2.resize(reflected, size, interpolation=cv2.INTER_NEAREST)
    radiance = np.zeros(ball.shape)
    samples = SEGMENT_SAMPLES if setup.rig.segment_deg else LED_SAMPLES
    direct = {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0}
    for index, (point, share) in enumerate(zip(*lamp_points(setup.rig, middle, lamp), strict=True)):
        scene.set_light(point)
        radiance = radiance + share * image(direct, 0, samples, 5000 + 100 * lamp + index)
    for region in (ball == 0, ball != 0):
        radiance[region] += _blur_within(reflected, region)[region]
    return radiance.astype(np.float32)


def _blur_within(image: NDArray[np.float64], region: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Blur (against the noise of few samples) that takes nothing from outside a region."""
    weight = region.astype(float)
    total, norm = (cv2.GaussianBlur(values, (0, 0), INDIRECT_BLUR_PX) for values in (image * weight, weight))
    return np.asarray(total / np.maximum(norm, 1e-9))
