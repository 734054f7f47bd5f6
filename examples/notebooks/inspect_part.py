# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # Inspect a part
#
# Every ball of a BGA measured and judged against limits, with an uncertainty for every number.
#
# The part is simulated: 25 balls, some of them defective on purpose. With your own part:
# `capture = bgars.read_capture("FOLDER")`.

# %%
import bgars

setup = bgars.read_scene("defects-5x5")
capture, truth = bgars.simulate(setup.scene, setup.rig, setup.material, setup.camera, seed=setup.seed)
_ = capture.plot(0)
# %% [markdown]
# A recipe says what the part should be: layout, nominal sizes, limits. It is a TOML file; this one comes with bgars.

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
# A difference should be within U for about 95 balls in 100.

# %%
true_top_um = {ball.name: ball.top_um for ball in truth.balls}
print("ball   top in um      U   truth")
for ball in result.balls[:10]:
    if ball.present and ball.name in true_top_um:
        print(f"{ball.name:4} {ball.top_um:11.1f} {2 * ball.u_top_um:6.1f} {true_top_um[ball.name]:7.1f}")

# %% [markdown]
# ## For others
#
# A page with pictures that opens in any browser, and a file for machines.

# %%
from pathlib import Path

Path("result.json").write_text(result.to_json(), encoding="utf-8")
