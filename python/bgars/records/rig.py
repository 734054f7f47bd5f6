"""Light rigs: where the light of each image comes from, and how strong it is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bgars import _bgars
from bgars.errors import InputError
from bgars.files.light_files import read_lp
from bgars.files.light_formats import MAX_LIGHTS
from bgars.files.light_names import light_name
from bgars.records.plain_arrays import plain
from bgars.records.scalar_checks import number
from bgars.records.short import Short

if TYPE_CHECKING:
    from os import PathLike

__all__ = ["STAND_IN_DEG", "LightRig", "directions_from_angles"]

MIN_LIGHTS = 3
STAND_IN_DEG = 90.0
"""Uncertainty of lights that stand in for a rig that was not described."""
MOST_SHOWN = 10**20
"""Numbers from here on have too many digits for a message."""


@dataclass(frozen=True, eq=False, repr=False)
class LightRig(Short):
    """The lights of a capture, one per image.

    Make one with :meth:`ring`, :meth:`from_directions`, :meth:`from_angles`, :meth:`from_positions` or :meth:`from_lp`.

    Attributes
    ----------
    directions : (L, 3) float64
        Unit vectors from the surface to the light (near lights: seen from the image centre on the board).
    intensities : (L,) float64
        Relative intensity of each light.
    positions_um : (L, 3) float64 or None
        LED positions of a near rig; origin = image centre on the board plane.
    intensity_distance_um : (L,) float64 or None
        Near rig: the distance at which the intensities hold.
    files : tuple of str
        Image file of each light, where the rig came with names (``.lp``).
    u_deg : (L,) float64 or None
        Standard uncertainty of each direction, on either of the two axes across it, in degrees; near lights: as seen
        from the image centre on the board. None when unknown.
    """

    directions: NDArray[np.float64]
    intensities: NDArray[np.float64]
    positions_um: NDArray[np.float64] | None = None
    intensity_distance_um: NDArray[np.float64] | None = None
    files: tuple[str, ...] = ()
    u_deg: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.directions)

    @property
    def is_near(self) -> bool:
        """True for point lights near the part."""
        return self.positions_um is not None

    @property
    def azimuths_deg(self) -> NDArray[np.float64]:
        """(L,) azimuths in degrees, counter-clockwise from +x as seen in the image, in [0, 360)."""
        azimuths_deg: NDArray[np.float64] = np.degrees(np.arctan2(self.directions[:, 1], self.directions[:, 0])) % 360.0
        return azimuths_deg

    @property
    def elevations_deg(self) -> NDArray[np.float64]:
        """(L,) elevations above the image plane in degrees."""
        elevations_deg: NDArray[np.float64] = np.degrees(np.arcsin(np.clip(self.directions[:, 2], -1.0, 1.0)))
        return elevations_deg

    @classmethod
    def ring(
        cls,
        count: int = 8,
        *,
        elevation_deg: float = 45.0,
        azimuth0_deg: float = 0.0,
        intensities: ArrayLike | None = None,
        u_deg: ArrayLike | None = None,
    ) -> LightRig:
        """Build a ring of distant lights, evenly spaced, counter-clockwise from +x.

        Parameters
        ----------
        count : int
            Number of lights, at least 3.
        elevation_deg : float
            Angle above the image plane, in (0, 90).
        azimuth0_deg : float
            Azimuth of the first light.
        intensities : (count,) array_like, optional
            Relative intensities; 1 by default.
        u_deg : float or (count,) array_like, optional
            Standard uncertainty of the directions in degrees, of every constructor; unknown by default.

        Raises
        ------
        InputError
            A count below 3 or an elevation out of range.

        Examples
        --------
        >>> LightRig.ring(8, elevation_deg=45.0).directions[2].round(3).tolist()
        [0.0, 0.707, 0.707]
        """
        if isinstance(count, bool) or not isinstance(count, int | np.integer):
            msg = f"count: must be a whole number, got {count!r}"
            raise InputError(msg)
        if not MIN_LIGHTS <= count <= MAX_LIGHTS:
            told = count if abs(count) < MOST_SHOWN else "a number of many digits"
            msg = f"count: a ring needs at least {MIN_LIGHTS} lights and has at most {MAX_LIGHTS}, got {told}"
            raise InputError(msg)
        azimuth0_deg, elevation_deg = number("azimuth0_deg", azimuth0_deg), number("elevation_deg", elevation_deg)
        azimuths_deg = azimuth0_deg + 360.0 / count * np.arange(count)
        angles_deg = np.column_stack([azimuths_deg, np.full(count, elevation_deg)])
        return cls.from_angles(angles_deg, intensities=intensities, u_deg=u_deg)

    @classmethod
    def from_angles(
        cls, angles_deg: ArrayLike, *, intensities: ArrayLike | None = None, u_deg: ArrayLike | None = None
    ) -> LightRig:
        """Build distant lights from (L, 2) pairs (azimuth, elevation) in degrees.

        Raises
        ------
        InputError
            A wrong shape, or an elevation outside (0, 90].

        Examples
        --------
        >>> LightRig.from_angles([[0, 45], [120, 45], [240, 90]]).directions[2].round(6).tolist()
        [-0.0, -0.0, 1.0]
        """
        return cls.from_directions(directions_from_angles(angles_deg), intensities=intensities, u_deg=u_deg)

    @classmethod
    def from_directions(
        cls,
        directions: ArrayLike,
        *,
        intensities: ArrayLike | None = None,
        files: tuple[str, ...] = (),
        u_deg: ArrayLike | None = None,
    ) -> LightRig:
        """Build distant lights from (L, 3) unit vectors, surface to light.

        Raises
        ------
        InputError
            Fewer than 3 lights, a wrong shape, or a vector that is not a unit vector within 1 %.

        Examples
        --------
        >>> len(LightRig.from_directions([[0.6, 0, 0.8], [-0.6, 0, 0.8], [0, 0.6, 0.8]]))
        3
        """
        vectors = _bgars.unit_directions(_rows(directions, "light_directions"))
        count = len(vectors)
        return cls(vectors, _intensities(intensities, count), files=files, u_deg=_uncertainties(u_deg, count))

    @classmethod
    def from_positions(
        cls,
        positions_um: ArrayLike,
        *,
        intensities: ArrayLike | None = None,
        intensity_distance_um: float | None = None,
        u_deg: ArrayLike | None = None,
    ) -> LightRig:
        """Build near point lights from (L, 3) LED positions in micrometres.

        Parameters
        ----------
        positions_um : (L, 3) array_like
            Origin = image centre on the board plane; x right, y up, z toward the camera.
        intensities : (L,) array_like, optional
            Irradiance on a facing plane at `intensity_distance_um`; 1 by default.
        intensity_distance_um : float, optional
            Distance at which the intensities hold; by default each light's own distance from the origin.
        u_deg : float or (L,) array_like, optional
            Standard uncertainty of the directions from the origin, in degrees; unknown by default.

        Raises
        ------
        InputError
            Fewer than 3 lights, or a light that is not above the board.

        Examples
        --------
        >>> leds_um = [[40_000, 0, 40_000], [-40_000, 0, 40_000], [0, 40_000, 40_000]]
        >>> LightRig.from_positions(leds_um).elevations_deg.round(1).tolist()
        [45.0, 45.0, 45.0]
        """
        positions = _vectors(positions_um, "light_positions")
        below = np.flatnonzero(positions[:, 2] <= 0)
        if below.size:
            index = int(below[0])
            msg = f"light_positions[{index}]: must be above the board plane (z > 0), got z = {positions[index, 2]:g} um"
            raise InputError(msg)
        distances = np.linalg.norm(positions, axis=1)
        if intensity_distance_um is None:
            reference = distances
        elif np.isfinite(intensity_distance_um) and intensity_distance_um > 0:
            reference = np.full(len(positions), float(intensity_distance_um))
        else:
            msg = f"intensity_distance_um: must be finite and above 0, got {intensity_distance_um:g}"
            raise InputError(msg)
        count = len(positions)
        return cls(
            positions / distances[:, None],
            _intensities(intensities, count),
            positions,
            reference,
            u_deg=_uncertainties(u_deg, count),
        )

    @classmethod
    def from_lp(
        cls, path: str | PathLike[str], *, intensities: ArrayLike | None = None, u_deg: ArrayLike | None = None
    ) -> LightRig:
        """Read an RTI light position file: a count, then ``file x y z`` per line (vectors are normalised).

        Warns with :class:`~bgars.CaptureWarning` of what had to be assumed.

        Raises
        ------
        FileFormatError
            The file is missing or a line does not parse.
        InputError
            Fewer than 3 lights.
        """
        directions, files = read_lp(path)
        return cls.from_directions(directions, intensities=intensities, files=files, u_deg=u_deg)

    def take(self, indices: NDArray[np.intp]) -> LightRig:
        """Return the lights at `indices`, in that order."""
        return LightRig(
            self.directions[indices],
            self.intensities[indices],
            None if self.positions_um is None else self.positions_um[indices],
            None if self.intensity_distance_um is None else self.intensity_distance_um[indices],
            tuple(self.files[index] for index in indices) if self.files else (),
            None if self.u_deg is None else self.u_deg[indices],
        )

    def with_intensities(self, intensities: ArrayLike, *, files: tuple[str, ...] = ()) -> LightRig:
        """Return the same lights with other intensities and image file names."""
        return replace(self, intensities=_intensities(intensities, len(self)), files=files)

    def with_u_deg(self, u_deg: ArrayLike | None) -> LightRig:
        """Return the same lights with one uncertainty of direction for all, or one per light, in degrees.

        Examples
        --------
        >>> LightRig.ring(4).with_u_deg(0.05).u_deg.tolist()
        [0.05, 0.05, 0.05, 0.05]
        """
        return replace(self, u_deg=_uncertainties(u_deg, len(self)))


def directions_from_angles(angles_deg: ArrayLike) -> NDArray[np.float64]:
    """Return (L, 3) unit vectors of (L, 2) pairs (azimuth, elevation) in degrees."""
    angles = plain("angles_deg", angles_deg, np.float64)
    if angles.ndim != 2 or angles.shape[1] != 2:  # noqa: PLR2004 - a pair
        msg = f"angles_deg: must have shape (L, 2) = azimuth, elevation, got {angles.shape}"
        raise InputError(msg)
    wrong = np.flatnonzero(~((angles[:, 1] > 0) & (angles[:, 1] <= 90)))  # noqa: PLR2004 - the zenith
    if wrong.size:
        index = int(wrong[0])
        msg = f"elevation_deg: {light_name(index)} must lie in (0, 90], got {angles[index, 1]:g}"
        raise InputError(msg)
    azimuth, elevation = np.radians(angles).T
    return np.column_stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )


def _rows(values: ArrayLike, name: str) -> NDArray[np.float64]:
    """A row per light."""
    vectors = plain(name, values, np.float64)
    if vectors.ndim != 2 or vectors.shape[1] != 3:  # noqa: PLR2004 - x, y, z
        msg = f"{name}: must have shape (L, 3), got {vectors.shape}"
        raise InputError(msg)
    if len(vectors) < MIN_LIGHTS:
        msg = f"{name}: at least {MIN_LIGHTS} lights are needed, got {len(vectors)}"
        raise InputError(msg)
    return vectors


def _vectors(values: ArrayLike, name: str) -> NDArray[np.float64]:
    """A row per light, of finite numbers."""
    vectors = _rows(values, name)
    if not np.isfinite(vectors).all():
        index = int(np.flatnonzero(~np.isfinite(vectors).all(axis=1))[0])
        msg = f"{name}[{index}]: must be finite, got {vectors[index].tolist()}"
        raise InputError(msg)
    return vectors


def _intensities(values: ArrayLike | None, count: int) -> NDArray[np.float64]:
    if values is None:
        return np.array([1.0] * count)
    intensities = plain("light_intensities", values, np.float64)
    if intensities.shape != (count,):
        msg = f"light_intensities: must have shape ({count},), one per light, got {intensities.shape}"
        raise InputError(msg)
    return _positive("light_intensities", intensities)


def _uncertainties(u_deg: ArrayLike | None, count: int) -> NDArray[np.float64] | None:
    """One standard uncertainty a light; None when unknown."""
    if u_deg is None:
        return None
    values = plain("u_deg", u_deg, np.float64).copy()
    if values.ndim == 0:
        values = np.repeat(values, count)
    if values.shape != (count,):
        msg = f"u_deg: must be one number, or have shape ({count},), one per light, got {values.shape}"
        raise InputError(msg)
    return _positive("u_deg", values)


def _positive(name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values (L,), where all are finite and above 0."""
    wrong = np.flatnonzero(~(np.isfinite(values) & (values > 0)))
    if wrong.size:
        index = int(wrong[0])
        msg = f"{name}[{index}]: must be finite and above 0, got {values[index]:g}"
        raise InputError(msg)
    return values
