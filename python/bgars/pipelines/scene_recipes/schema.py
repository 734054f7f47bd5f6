"""What a simulation recipe may hold; ranges are checked by the records that it becomes."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from bgars.io.strict_toml import Strict

__all__ = [
    "BallArrayRecipe",
    "BallRecipe",
    "BallsRecipe",
    "BoardRecipe",
    "BridgeRecipe",
    "CameraRecipe",
    "DefectRecipe",
    "HemisphereRecipe",
    "MaterialRecipe",
    "PlaneRecipe",
    "RigRecipe",
    "SceneRecipe",
    "SimulationRecipe",
]

Vector = tuple[float, float, float]
Distribution = Literal["beckmann", "gaussian", "ggx"]


class LobeRecipe(Strict):
    """A second lobe; one of hardness and roughness."""

    i_s: float
    hardness: float | None = None
    roughness: float | None = None
    distribution: Distribution = "beckmann"


class VariationRecipe(Strict):
    """Relative standard deviations from ball to ball."""

    i_d: float = 0.0
    i_s: float = 0.0
    roughness: float = 0.0


class MaterialRecipe(Strict):
    """:class:`bgars.Material`."""

    i_d: float = 0.5
    i_s: float = 1.0
    hardness: float | None = None
    roughness: float | None = None
    distribution: Distribution = "beckmann"
    second_lobe: LobeRecipe | None = None
    masking: Literal["cook-torrance", "smith", "none"] = "cook-torrance"
    fresnel: Literal["off", "schlick"] = "off"
    f0: float = 0.8
    variation: VariationRecipe = VariationRecipe()


class TextureRecipe(Strict):
    """:class:`bgars.Texture`."""

    contrast: float = 0.25
    scale_um: float = 500.0
    seed: int = 0


class BoardRecipe(Strict):
    """:class:`bgars.Board`; `i_d` for a matte one, or a whole material. `albedo_map` is a ``.npy`` file."""

    i_d: float | None = None
    material: MaterialRecipe | None = None
    tilt_x_deg: float = 0.0
    tilt_y_deg: float = 0.0
    bow_um: float = 0.0
    bow_radius_um: float = 10_000.0
    texture: TextureRecipe | None = None
    albedo_map: str | None = None


class DefectRecipe(Strict):
    """:class:`bgars.Defect`."""

    old_names: ClassVar = {"flat_um": "flat_top_depth_um"}

    kind: Literal["missing", "offset", "size", "flattened", "clipped"]
    dx_um: float = 0.0
    dy_um: float = 0.0
    scale: float = 1.0
    height: float = 0.85
    width: float = 1.08
    flat_top_depth_um: float = 0.0


class BridgeRecipe(Strict):
    """:class:`bgars.Bridge`."""

    first: str
    second: str
    radius_um: float = 150.0
    z_um: float | None = None


class JitterRecipe(Strict):
    """:class:`bgars.Jitter`."""

    height_um: float = 0.0
    radius_um: float = 0.0
    position_um: float = 0.0


class PlaneRecipe(Strict):
    """An empty board."""

    kind: Literal["plane"]
    size_um: tuple[float, float] = (2000.0, 2000.0)
    board: BoardRecipe = BoardRecipe()


class HemisphereRecipe(Strict):
    """A ball cut at its equator."""

    kind: Literal["hemisphere"]
    radius_um: float = 300.0
    x_um: float = 0.0
    y_um: float = 0.0
    board: BoardRecipe = BoardRecipe()


class BallRecipe(Strict):
    """One truncated ball."""

    kind: Literal["ball"]
    diameter_um: float = 600.0
    height_um: float = 500.0
    x_um: float = 0.0
    y_um: float = 0.0
    defect: DefectRecipe | None = None
    board: BoardRecipe = BoardRecipe()


class BallArrayRecipe(Strict):
    """A grid of truncated balls."""

    kind: Literal["ball_array"]
    rows: int
    cols: int
    pitch_um: float = 1000.0
    diameter_um: float = 600.0
    height_um: float = 500.0
    centre_um: tuple[float, float] = (0.0, 0.0)
    rotation_deg: float = 0.0
    seed: int = 0
    jitter: JitterRecipe = JitterRecipe()
    defects: dict[str, DefectRecipe] = Field(default_factory=dict)
    bridges: tuple[BridgeRecipe, ...] = ()
    board: BoardRecipe = BoardRecipe()


class OneBallRecipe(Strict):
    """:class:`bgars.Ball`, all of it."""

    old_names: ClassVar = {"q": "aspect_ratio", "flat_um": "flat_top_depth_um"}

    x_um: float
    y_um: float
    radius_um: float
    centre_z_um: float
    aspect_ratio: float = 1.0
    flat_top_depth_um: float = 0.0
    name: str = "A1"
    row: int = 1
    col: int = 1
    x_nominal_um: float | None = None
    y_nominal_um: float | None = None
    present: bool = True
    defect: str = "none"


class BallsRecipe(Strict):
    """Balls one by one; what ``scene.json`` beside a simulated capture holds."""

    kind: Literal["balls"]
    balls: tuple[OneBallRecipe, ...] = ()
    bridges: tuple[BridgeRecipe, ...] = ()
    size_um: tuple[float, float] = (2000.0, 2000.0)
    board: BoardRecipe = BoardRecipe()


SceneRecipe = Annotated[
    PlaneRecipe | HemisphereRecipe | BallRecipe | BallArrayRecipe | BallsRecipe, Field(discriminator="kind")
]


class RingRecipe(Strict):
    """:meth:`bgars.LightRig.ring`."""

    count: int = 8
    elevation_deg: float = 45.0
    azimuth0_deg: float = 0.0


class RigRecipe(Strict):
    """The lights: exactly one of the first four keys; a ring of 8 at 45 degrees by default."""

    ring: RingRecipe | None = None
    angles_deg: list[tuple[float, float]] | None = None
    directions: list[Vector] | None = None
    positions_um: list[Vector] | None = None
    intensities: list[float] | None = None
    intensity_distance_um: float | list[float] | None = None
    u_deg: float | list[float] | None = None


class CameraRecipe(Strict):
    """:class:`bgars.Camera`."""

    pixel_pitch_um: float = 10.0
    shape: tuple[int, int] | None = None
    bit_depth: Literal[8, 10, 12, 16] = 8
    gain: float = 1.0
    full_well_e: float | None = None
    read_noise_levels: float = 0.0
    black_level: float = 0.0
    gamma: float = 1.0
    response_table: list[tuple[float, float]] | None = None
    saturation: float | None = None
    supersample: int = 1
    blur_px: float = 0.0


class SimulationRecipe(Strict):
    """A whole recipe. `bgars` is the version that wrote it; it changes nothing."""

    description: str = ""
    bgars: str | None = None
    seed: int = 0
    scene: SceneRecipe
    rig: RigRecipe = RigRecipe()
    material: MaterialRecipe = MaterialRecipe()
    camera: CameraRecipe = CameraRecipe()
