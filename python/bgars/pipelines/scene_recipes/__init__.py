"""Simulation recipes: read them, run them, write captures with truth."""

from bgars.pipelines.scene_recipes.read import named_recipes, read_scene
from bgars.pipelines.scene_recipes.write import write_simulation, write_simulation_of

__all__ = ["named_recipes", "read_scene", "write_simulation", "write_simulation_of"]
