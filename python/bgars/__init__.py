"""Photometric stereo for shiny parts: one camera, several lights, one image per light.

The data flows one way: a capture becomes normals, normals become a height map, a height map becomes a mesh.

>>> import bgars
>>> capture = bgars.read_capture(bgars.sample_capture())
>>> field = bgars.estimate_normals(capture)
>>> height = bgars.integrate_normals(field)
>>> mesh = bgars.mesh_from_height(height, field)

The public names stand in ``__init__.pyi``; each is imported when it is first used.
"""

from importlib import import_module

import lazy_loader

from bgars.extras import EXTRA_OF, how_to_install

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    if name not in __all__:
        # bgars.errors and the like, as if `import bgars` had loaded them.
        try:
            return import_module(f"bgars.{name}")
        except ModuleNotFoundError as error:
            if error.name != f"bgars.{name}":
                raise
            msg = f"module 'bgars' has no attribute {name!r}"
            raise AttributeError(msg) from None
    try:
        return _load(name)
    except ModuleNotFoundError as error:
        if error.name not in EXTRA_OF:
            raise
        msg = f"bgars.{name} {how_to_install(error.name)}"
        raise ModuleNotFoundError(msg, name=error.name) from None
