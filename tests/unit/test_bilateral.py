"""Bilateral integration: against its slow twin, on surfaces in closed form, and where it must refuse."""

from __future__ import annotations

import bgars
import numpy as np
import pytest
from bilateral_scenes import camera_matrix, rays, terrace, unit
from slow_bilateral import integrate as slow

SIZE = 60


def bilateral(normals: np.ndarray, **options: object) -> bgars.HeightMap:
    return bgars.integrate_normals(normals.astype(np.float32), method="bilateral", **options)  # type: ignore[call-overload, no-any-return]


def perspective(normals: np.ndarray, camera: np.ndarray, **options: object) -> bgars.DepthMap:
    pinhole = bgars.Pinhole(camera)
    return bgars.integrate_normals(normals.astype(np.float32), method="bilateral", camera=pinhole, **options)  # type: ignore[call-overload, no-any-return]


def fit_of(found: bgars.HeightMap | bgars.DepthMap) -> bgars.BilateralFit:
    assert found.bilateral is not None
    return found.bilateral


def holes(size: int = SIZE) -> np.ndarray:
    mask = np.random.default_rng(3).random((size, size)) > 0.1
    mask[:5, :7] = False
    return mask


@pytest.mark.parametrize("camera", [None, camera_matrix(SIZE)])
@pytest.mark.parametrize("rounds", [1, 2, 5])
def test_every_round_is_that_of_the_slow_twin(camera: np.ndarray | None, rounds: int) -> None:
    """Energies depend on solution and weights; both are compared while the weights still change."""
    _, normals = terrace()
    normals = unit(normals + np.random.default_rng(1).normal(0, 0.05, normals.shape)).astype(np.float32)
    # The largest part of the mask alone: constants of others are arbitrary.
    mask = holes()
    first = bilateral(normals, mask=mask)
    mask = first.labels == np.argmax([part.pixels for part in first.components])
    expected, energies, _ = slow(normals.astype(np.float64), mask, camera, rounds=rounds)
    options = {"mask": mask, "max_iters": rounds}
    found = bilateral(normals, **options) if camera is None else perspective(normals, camera, **options)
    assert fit_of(found).energies == pytest.approx(energies, rel=1e-4)
    height = found.height_px if isinstance(found, bgars.HeightMap) else -np.log(found.depth)
    scale = np.nanmax(abs(expected))
    assert np.nanmax(abs(height - expected)) < 1e-3 * scale


@pytest.mark.parametrize("camera", [None, camera_matrix(SIZE) * [[1.0], [1.1], [1.0]]])
def test_compatible_is_the_published_iteration_to_the_last_digits(camera: np.ndarray | None) -> None:
    """Systems that are left at 1e-3: only the same iterates, stopped at the same ones, give the same energies."""
    _, normals = terrace()
    normals = unit(normals + np.random.default_rng(1).normal(0, 0.05, normals.shape)).astype(np.float32)
    mask = holes()
    first = bilateral(normals, mask=mask)
    mask = first.labels == np.argmax([part.pixels for part in first.components])
    expected, energies, inner = slow(normals.astype(np.float64), mask, camera, inner_tolerance=1e-3, published=True)
    options = {"mask": mask, "solver": "compatible"}
    found = bilateral(normals, **options) if camera is None else perspective(normals, camera, **options)
    fit = fit_of(found)
    assert found.iterations == inner
    assert fit.energies == pytest.approx(energies, rel=1e-10)
    # Heights and depths are stored in single precision.
    if isinstance(found, bgars.HeightMap):
        assert np.nanmax(abs(found.height_px - expected)) < 1e-6 * np.nanmax(abs(expected))
    else:
        assert np.nanmax(abs(found.depth * np.exp(expected) - 1.0)) < 1e-6


def test_a_jump_stays_a_jump_where_least_squares_smears_it() -> None:
    """Two planes, one tilted along their seam: no surface without a jump has these normals."""
    row, col = np.indices((SIZE, SIZE))
    tilted = col >= SIZE // 2
    height = np.where(tilted, -0.3 * row, 0.0)
    normals = unit(np.stack([np.zeros(row.shape), np.where(tilted, -0.3, 0.0), np.ones(row.shape)], axis=-1))

    def worst(found: np.ndarray) -> float:
        """Each side's own constant removed: how far the jump reaches into the planes."""
        return max(float(np.std((found - height)[side])) for side in (tilted, ~tilted))

    plain = bgars.integrate_normals(normals.astype(np.float32)).height_px
    fit = bilateral(normals, k=10.0)
    assert worst(plain) > 0.5
    assert worst(fit.height_px) < 0.03
    jumps = fit_of(fit).jumps()
    assert jumps[:, SIZE // 2 - 1 : SIZE // 2 + 1].mean() > 0.6
    assert not jumps[:, : SIZE // 2 - 2].any()
    assert not jumps[:, SIZE // 2 + 2 :].any()


@pytest.mark.parametrize("solver", ["converged", "compatible"])
def test_a_plane_under_perspective(solver: str) -> None:
    normal = unit(np.array([0.3, -0.2, 1.0]))
    depth = 1.0 / -(rays(SIZE) @ normal)  # n . (depth ray) = -1
    normals = np.broadcast_to(normal, (SIZE, SIZE, 3)).copy()
    found = perspective(normals, camera_matrix(SIZE), solver=solver)
    scale = np.median(depth / found.depth)
    # One-sided differences of a logarithm that is not linear: first order, and alike on both sides.
    assert np.abs(found.depth * scale / depth - 1).max() < 5e-3
    assert fit_of(found).converged
    assert found.depth.dtype == np.float32


def test_a_sphere_under_perspective_is_first_order() -> None:
    errors = []
    for size in (60, 120):
        ray = rays(size)
        centre = np.array([0.05, 0.02, -4.0])
        # |t ray - centre| = 0.6
        a, b, c = (ray**2).sum(-1), ray @ centre, centre @ centre - 0.6**2
        discriminant = b**2 - a * c
        mask = discriminant > 0.03 * b**2 * 0.1
        depth = (b - np.sqrt(np.where(mask, discriminant, 1.0))) / a
        normals = unit(depth[..., None] * ray - centre)
        found = perspective(normals, camera_matrix(size), mask=mask)
        scale = np.median((depth / found.depth)[mask])
        errors.append(np.abs(found.depth * scale - depth)[mask].mean())
    assert errors[0] < 0.01
    assert errors[1] < 0.75 * errors[0]


def test_compatible_agrees_with_converged() -> None:
    _, normals = terrace()
    compatible = bilateral(normals, solver="compatible")
    exact = bilateral(normals, solver="converged")
    assert np.abs(exact.height_px - compatible.height_px).max() < 0.05
    assert exact.residual <= 1e-6
    assert compatible.residual <= 1e-3


@pytest.mark.parametrize("solver", ["converged", "compatible"])
def test_bits_are_the_same_for_any_number_of_threads(solver: str) -> None:
    _, normals = terrace(130)
    one, two, three = (bilateral(normals, solver=solver, threads=threads, mask=holes(130)) for threads in (1, 2, 3))
    for other in (two, three):
        assert one.height_px.tobytes() == other.height_px.tobytes()
        assert fit_of(one).rightward.tobytes() == fit_of(other).rightward.tobytes()
        assert fit_of(one).energies.tolist() == fit_of(other).energies.tolist()


def test_k_of_zero_never_sees_a_jump() -> None:
    _, normals = terrace()
    fit = fit_of(bilateral(normals, k=0.0))
    assert (fit.rightward == 0.5).all()
    assert (fit.upward == 0.5).all()
    assert len(fit.energies) == 2


def test_an_iteration_limit_is_told_not_raised() -> None:
    _, normals = terrace()
    fit = fit_of(bilateral(normals, max_iters=1))
    assert not fit.converged
    assert len(fit.energies) == 1


def test_weights_silence_a_wrong_pixel() -> None:
    normals = np.zeros((5, 9, 3))
    normals[..., 2] = 1.0
    normals[:, 4] = unit(np.array([-0.8, 0.0, 0.6]))
    trust = np.ones((5, 9))
    trust[:, 4] = 1e-6
    found = bilateral(normals, weights=trust)
    assert np.abs(found.height_px[:, 8] - found.height_px[:, 0]).max() < 1e-3


def test_ctrl_c_and_progress() -> None:
    # Much work: what is done within a tenth of a second tells no progress.
    _, normals = terrace(1200)
    seen = []

    def stop(iteration: int, change: float) -> None:
        seen.append((iteration, change))
        msg = "enough"
        raise KeyboardInterrupt(msg)

    noisy = unit(normals + np.random.default_rng(0).normal(0, 0.3, normals.shape))
    noisy[..., 2] = abs(noisy[..., 2])
    with pytest.raises(KeyboardInterrupt, match="enough"):
        bilateral(noisy, progress=stop, tol=1e-12)
    assert len(seen) == 1


BAD: list[tuple[dict[str, object], str]] = [
    ({"k": -1.0}, r"k: must be finite and at least 0, got -1"),
    ({"k": float("nan")}, r"k: must be finite"),
    ({"tol": 0.0}, r"tol: must be finite and above 0, got 0"),
    ({"max_iters": 0}, r"max_iters: must be at least 1, got 0"),
    ({"solver": "best"}, r"solver: must be one of converged, compatible; got 'best'"),
    ({"camera": np.eye(3)}, r"camera: must be a bgars.Pinhole, got ndarray"),
    ({"mask": np.zeros((60, 60), bool)}, r"mask: no pixel"),
]


@pytest.mark.parametrize(("options", "message"), BAD)
def test_bad_arguments_are_named(options: dict[str, object], message: str) -> None:
    with pytest.raises(bgars.InputError, match=message):
        bilateral(terrace()[1], **options)


def test_a_camera_needs_bilateral_and_a_front() -> None:
    _, normals = terrace()
    with pytest.raises(bgars.InputError, match="only method 'bilateral'"):
        bgars.integrate_normals(normals, camera=bgars.Pinhole(camera_matrix(SIZE)))
    with pytest.raises(bgars.InputError, match="3600 of 3600 face away from the camera"):
        perspective(-normals, camera_matrix(SIZE), mask=np.ones((SIZE, SIZE), bool))


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.eye(4), r"finite \(3, 3\) matrix, got shape \(4, 4\)"),
        (np.diag([-1.0, 1.0, 1.0]), "focal lengths must be above 0, got -1 and 1"),
        (np.array([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]), "no skew"),
    ],
)
def test_a_camera_that_is_none(matrix: np.ndarray, message: str) -> None:
    with pytest.raises(bgars.InputError, match=message):
        bgars.Pinhole(matrix)
