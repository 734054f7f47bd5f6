# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # A first capture
#
# From eight photographs of a shiny ball to normals, heights and a mesh, and how far to trust them.
#
# A *capture* is a folder with one image per light and a description of the lights. This one comes with bgars; put the
# folder of your own photographs in its place.

# %%
import bgars

capture = bgars.read_capture(bgars.sample_capture())
capture

# %% [markdown]
# One light at a time: the highlight moves over the ball, and its shadow turns on the board.

# %%
import matplotlib.pyplot as plt

figure, axes = plt.subplots(1, 4, figsize=(12, 3.4), layout="constrained")
for light, panel in zip((0, 2, 4, 6), axes, strict=True):
    capture.plot(light, axes=panel)

# %% [markdown]
# Do images and lights belong together? Check this first: lights in the wrong order, or mirrored, make every normal
# wrong.

# %%
print(bgars.check(capture))

# %% [markdown]
# ## Normals
#
# The default method finds the balls, fits the reflectance of their material, and then each normal to the eight values
# of its pixel.

# %%
field = bgars.estimate_normals(capture)
print(field.method_reason)
field

# %%
figure, axes = plt.subplots(1, 2, figsize=(10, 4.4), layout="constrained")
field.plot(axes=axes[0])
error = axes[1].imshow(field.standard_error_deg, vmin=0, vmax=1)
axes[1].set_title("standard error of the normal")
_ = figure.colorbar(error, ax=axes[1], label="degrees")

# %% [markdown]
# A normal that the values of its pixel do not determine is drawn to the sphere of its ball: a *prior*, not a
# measurement. `field.is_measured` distinguishes them.

# %%
print(f"{field.is_measured[field.mask].mean():.1%} of the normals are measured")

# %% [markdown]
# ## Height and mesh
#
# Heights follow from the normals, up to a constant for each connected part. Between ball and board the surface jumps
# where no pixel sees it: the height of the ball above its board is *not* in the normals.

# %%
height = bgars.integrate_normals(field)
_ = height.plot()
# %%
mesh = bgars.mesh_from_height(height, field)
bgars.write_mesh(mesh, "ball.ply")
print(f"{len(mesh.vertices)} vertices, {len(mesh.faces)} faces in ball.ply")

# %% [markdown]
# ## How good is it?
#
# This sample contains its true normals, so that errors can be computed.

# %%
errors = bgars.evaluate(capture).normals
print(f"mean {errors.mean_deg:.2f}, median {errors.median_deg:.2f}, 95th percentile {errors.p95_deg:.2f} degrees")
