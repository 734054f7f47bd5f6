# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # Simulate your own set-up
#
# Before you buy lamps and a lens: how accurately would a set-up like yours measure?

# %%
import bgars
import matplotlib.pyplot as plt
import numpy as np

# %% [markdown]
# ## The part
#
# Nine balls of 600 um at a pitch of 1.5 mm, with realistic variation.

# %%
scene = bgars.Scene.ball_array(
    3,
    3,
    pitch_um=1500,
    diameter_um=600,
    height_um=500,
    jitter=bgars.Jitter(height_um=5, radius_um=3, position_um=4),
    seed=4,
    board=bgars.Board(bgars.Material.matte(0.25), texture=bgars.Texture(0.2)),
)


def photograph(elevation_deg: float, pixel_pitch_um: float) -> tuple[bgars.Capture, bgars.SimulatedTruth]:
    """Capture of the part under eight lamps at this elevation, 8 bits, with the noise of an ordinary sensor."""
    return bgars.simulate(
        scene,
        bgars.LightRig.ring(8, elevation_deg=elevation_deg),
        bgars.Material(i_d=0.4, i_s=1.0, hardness=40),
        bgars.Camera(pixel_pitch_um=pixel_pitch_um, bit_depth=8, full_well_e=12000, read_noise_levels=0.5),
        seed=1,
    )


# %%
figure, axes = plt.subplots(1, 3, figsize=(12, 4.2), layout="constrained")
for elevation_deg, panel in zip((30, 45, 60), axes, strict=True):
    photograph(elevation_deg, 15)[0].plot(0, axes=panel).set_title(f"lamps at {elevation_deg} degrees")

# %% [markdown]
# Lower lamps cast longer shadows, which carry the height; too low, they reach the next ball.
#
# ## What determines the accuracy?
#
# For each set-up: the standard uncertainty that bgars states for the height of a ball, and the true error.

# %%
print("elevation   pixel   balls with a height   stated u   true error (rms), um")
for elevation_deg, pixel_pitch_um in ((30, 15), (45, 15), (60, 15), (45, 10)):
    capture, truth = photograph(elevation_deg, pixel_pitch_um)
    result = bgars.inspect(capture)
    true_um = {ball.name: ball.top_um for ball in truth.balls}
    measured = [ball for ball in result.balls if np.isfinite(ball.top_um)]
    rms_um = np.sqrt(np.mean([(ball.top_um - true_um[ball.name]) ** 2 for ball in measured]))
    u_um = np.median([ball.u_top_um for ball in measured])
    print(f"{elevation_deg:5} deg {pixel_pitch_um:5} um {len(measured):14} of 9 {u_um:14.2f} {rms_um:14.2f}")

# %% [markdown]
# Stated uncertainties include what a simulation leaves out, such as wrong light directions; so they are larger than the
# errors here, as they should be.
# A [calibrated station](https://github.com/bgars/bgars/blob/main/docs/station.md) reduces them.
