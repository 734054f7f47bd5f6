# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # Inspect a part
#
# Every ball of a BGA is measured and compared with limits, with an uncertainty for every reading.
#
# The part is simulated: 25 balls, some of them with a defect. For your own part:
# `capture = bgars.read_capture("FOLDER")`.

# %%
import bgars

setup = bgars.read_scene("defects-5x5")
capture, truth = bgars.simulate(setup.scene, setup.rig, setup.material, setup.camera, seed=setup.seed)
_ = capture.plot(0)
# %% [markdown]
# A recipe describes the part as it should be: layout, nominal sizes, limits. This TOML file comes with bgars.

# %%
recipe_path = bgars.sample_part_recipe()
print(recipe_path.read_text(encoding="utf-8"))

# %%
result = bgars.inspect(capture, bgars.read_part_recipe(recipe_path))
result

# %%
_ = result.plot()
# %% [markdown]
# ## Why it failed
#
# A verdict is `pass` inside the limits by U = 2 u, `fail` outside by U, else `undecided` (ISO 14253-1).

# %%
for ball in result.balls:
    if ball.verdict != "pass":
        print(f"{ball.name} {ball.verdict}", *ball.reasons, sep="\n    ")

# %% [markdown]
# ## Measured against the truth
#
# The error should be within U for about 95 balls in 100.

# %%
true_top_um = {ball.name: ball.top_um for ball in truth.balls}
print("ball   top in um      U   truth")
for ball in result.balls[:10]:
    if ball.present and ball.name in true_top_um:
        print(f"{ball.name:4} {ball.top_um:11.1f} {2 * ball.u_top_um:6.1f} {true_top_um[ball.name]:7.1f}")

# %% [markdown]
# ## Output files
#
# A page with pictures for any browser, and a file for other programs.

# %%
from pathlib import Path

Path("result.json").write_text(result.to_json(), encoding="utf-8")
