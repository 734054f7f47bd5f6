# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # Compare methods
#
# A glossy object with known normals, all methods, and one of your own; then a photograph, if you have the data.

# %%
import os
from pathlib import Path

import bgars
import matplotlib.pyplot as plt
import numpy as np

# %% [markdown]
# ## A glossy ball
#
# Half of its reflected light is diffuse, half is specular: eight highlights, one per light.

# %%
scene = bgars.Scene.ball(600, height_um=450)
capture, truth = bgars.simulate(
    scene,
    bgars.LightRig.ring(8, elevation_deg=45),
    bgars.Material(i_d=0.5, i_s=1.0, hardness=40),
    bgars.Camera(pixel_pitch_um=6, bit_depth=12),
    seed=1,
)
_ = capture.plot(0)

# %% [markdown]
# ## A method of your own
#
# Any function of a capture that returns normals can be compared. This one solves for the three darkest lights, which is
# naive: shadows count as data.


# %%
def darkest_three(capture: bgars.Capture) -> np.ndarray:
    """Least squares over the three darkest lights of each pixel."""
    values = capture.images.reshape(len(capture.images), -1).astype(float)
    chosen = np.argsort(values, axis=0)[:3]
    lights = capture.rig.directions[chosen.T]
    scaled = np.linalg.solve(lights + 1e-9 * np.eye(3), np.take_along_axis(values, chosen, 0).T[..., None])[..., 0]
    length = np.linalg.norm(scaled, axis=1, keepdims=True)
    return (scaled / np.maximum(length, 1e-12)).reshape(*capture.images.shape[1:], 3)


bgars.register_method("darkest-three", darkest_three)

# %%
METHODS = ("lambertian", "specular-filter", "robust-filter", "reflectance", "darkest-three")
print("method            mean   median   95th percentile, degrees")
for method in METHODS:
    errors = bgars.evaluate(capture, method=method, truth=truth).normals
    print(f"{method:15} {errors.mean_deg:6.2f} {errors.median_deg:8.2f} {errors.p95_deg:8.2f}")

# %%
figure, axes = plt.subplots(1, 4, figsize=(13, 3.6), layout="constrained")
for method, panel in zip(METHODS[:4], axes, strict=True):
    field = bgars.estimate_normals(capture, method=method)
    error_deg = bgars.angular_error_deg(field.normals, truth.normals)
    picture = panel.imshow(error_deg, vmin=0, vmax=20, cmap="magma")
    panel.set(title=method, xticks=[], yticks=[])
_ = figure.colorbar(picture, ax=axes, label="angular error in degrees")
# %% [markdown]
# ## A photograph
#
# From the DiLiGenT benchmark (Shi et al., 2016), if the environment variable `BGARS_DATA` names a folder that contains
# it. Light scatters from one part of the object to another, and no model fits exactly: errors are larger than in any
# simulation.

# %%
folder = Path(os.environ.get("BGARS_DATA", "."), "real", "dil_cat")
if folder.is_dir():
    cat = bgars.read_capture(folder)
    for method in ("lambertian", "robust-filter"):
        print(f"{method:15} {bgars.evaluate(cat, method=method).normals.mean_deg:6.2f}")
else:
    print("no photograph here: set BGARS_DATA")
