"""Every reader of a file, with whole files for it: a new reader is one line of `READERS`."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import tifffile
from bgars.files.light_files import read_filenames, read_intensities, read_lp
from bgars.files.light_formats import read_light_file
from bgars.io.images import decode_stack
from bgars.io.masks import read_mask
from bgars.io.normal_map import read_stored_normals
from bgars.io.response import read_response_table
from bgars.io.surface_file import read_surface
from bgars.records.flat_field import FlatField
from bgars.station.verify import read_known
from scipy.io import savemat


def normals() -> np.ndarray:
    rows, cols = np.mgrid[:12, :14]
    field = np.stack([np.sin(rows / 5) / 3, np.cos(cols / 4) / 3, np.ones((12, 14))], axis=-1)
    return (field / np.linalg.norm(field, axis=2, keepdims=True)).astype(np.float32)


def make_corpus(folder: Path) -> None:
    """Whole files of every format, small."""
    folder.mkdir(parents=True)
    codes = np.rint((normals() + 1) * 127.5).astype(np.uint8)
    wide = codes.astype(np.uint16) * 257
    iio.imwrite(folder / "n8.png", codes)
    iio.imwrite(folder / "n.jpg", codes, quality=90)
    iio.imwrite(folder / "n.bmp", codes)
    bgars.write_normal_map(normals(), folder / "n16.png")
    for name, values, options in (
        ("n8.tif", codes, {}),
        ("n16.tif", wide, {}),
        ("nf.tif", normals(), {}),
        ("nz.tif", codes, {"compression": "zlib"}),
        ("nt.tif", np.tile(codes, (3, 3, 1)), {"tile": (16, 16)}),
    ):
        tifffile.imwrite(folder / name, values, photometric="rgb", **options)
    np.save(folder / "n.npy", normals())
    np.savez_compressed(folder / "n.npz", normals=normals())
    height = bgars.HeightMap.from_array(normals()[..., 0], pixel_pitch_um=5.0)
    for name in ("h.tif", "h.npy"):
        bgars.write_height(height, folder / name)
    tifffile.imwrite(folder / "hz.tif", normals()[..., 0], compression="zlib", rowsperstrip=3)
    tifffile.imwrite(folder / "ht.tif", np.tile(normals()[..., 0], (3, 3)), tile=(16, 16))
    tifffile.imwrite(folder / "hb.tif", normals()[..., 0], bigtiff=True, byteorder=">")
    tifffile.imwrite(folder / "hp.tif", np.stack([normals()[..., 0]] * 3), photometric="minisblack")
    grey = codes[..., 2]
    iio.imwrite(folder / "g.png", grey)
    iio.imwrite(folder / "g.tif", grey)
    (folder / "g.pgm").write_bytes(b"P5\n14 12\n255\n" + grey.tobytes())
    (folder / "l.lp").write_text("3\na.png 0 0 1\nb.png 0.5 0 0.8\nc.png 0 0.5 0.8\n", encoding="utf-8")
    (folder / "i.txt").write_text("1.0 0.9 1.1\n1.0 1.0 1.0\n", encoding="utf-8")
    (folder / "f.txt").write_text("a.png\nb.png\n", encoding="utf-8")
    shutil.copy(bgars.sample_part_recipe(), folder / "part.toml")
    capture = bgars.read_capture(bgars.sample_capture())
    result = bgars.inspect(capture, surface=True)
    (folder / "result.json").write_text(result.to_json(), encoding="utf-8")
    bgars.write_report(result, folder / "page.html", capture=capture)
    lobe = bgars.SurfaceLobe(strength_level=255.0, roughness=0.2, tail=0.0)
    bgars.write_material(bgars.SurfaceMaterial(30.0, 0.0, 0.0, (lobe,), "smith", gains=(1.0,) * 8), folder / "m.toml")
    (folder / "p.csv").write_text("name,x_um,y_um\nA1,0,0\nA2,800,0\n", encoding="utf-8")
    recipes = Path(bgars.__file__).parent / "pipelines" / "scene_recipes" / "named"
    for name in ("hemisphere", "defects-5x5"):
        shutil.copy(recipes / f"{name}.toml", folder / f"scene-{name}.toml")
    scene = bgars.read_scene("hemisphere")
    assert scene.scene is not None
    (folder / "scene.json").write_text(json.dumps({"scene": {"kind": "plane"}}), encoding="utf-8")
    make_dialects(folder)
    make_captures(folder)
    (folder / "r.csv").write_text("part,ball,characteristic,reference\n1,A1,top_um,500\n", encoding="utf-8")


def make_dialects(folder: Path) -> None:
    """Lights and images in other programs' formats, responses, stations."""
    directions = bgars.LightRig.ring(4).directions
    rows = [[round(float(value), 6) for value in row] for row in directions]
    plain = "\n".join(" ".join(map(str, row)) for row in rows)
    (folder / "lights.txt").write_text(f"{len(rows)}\n{plain}\n", encoding="utf-8")
    named = "".join(f"img{at};{';'.join(map(str, row))}\n" for at, row in enumerate(rows))
    (folder / "lights.csv").write_text("file;x;y;z\n" + named, encoding="utf-8")
    comma = plain.replace(" ", "\t").replace(".", ",")
    (folder / "lights.tsv").write_bytes(f"x\ty\tz\n{comma}\n".encode("utf-16"))
    (folder / "lights.json").write_text(
        json.dumps(
            {"lights": [{"viewId": at, "direction": row, "intensity": [1, 1, 1]} for at, row in enumerate(rows)]}
        ),
        encoding="utf-8",
    )
    (folder / "lights.dome").write_text(
        json.dumps({"directions": [dict(zip("xyz", row, strict=True)) for row in rows], "ledAdjust": []}),
        encoding="utf-8",
    )
    (folder / "lights-led.txt").write_text(
        "N_img nrows ncols f x0 y0 mean_distance\n1 9 11 100 5 4 300\n1 2 3 0 0 1 1 1 1 0 0\n", encoding="utf-8"
    )
    np.save(folder / "lights.npy", directions)
    for name, packed in (("lights.mat", False), ("lights-z.mat", True)):
        savemat(folder / name, {"L": directions, "intensities": np.ones(4), "text": "x"}, do_compression=packed)
    grey = np.arange(168, dtype=np.uint8).reshape(12, 14)
    for suffix in ("tga", "webp", "gif"):
        iio.imwrite(folder / f"d.{suffix}", np.stack([grey] * 3, axis=-1))
    np.save(folder / "d.npy", grey)
    iio.imwrite(folder / "d.tif", grey, plugin="pillow", compression="tiff_lzw")
    (folder / "d.pfm").write_bytes(b"PF\n3 2\n1.0\n" + bytes(72))
    (folder / "d.hdr").write_bytes(
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 9\n" + (b"\2\2\0\x09" + b"\x89\x10" * 4) * 2
    )
    (folder / "response.csv").write_text(
        "".join(f"{level},{level**2 / 255}\n" for level in range(256)), encoding="utf-8"
    )
    rig, u = bgars.LightRig.from_directions(directions, u_deg=0.05), np.full(4, 0.05)
    levels = np.linspace(0, 1, 9)
    station = bgars.Station(
        lights=bgars.LightCalibration(rig, u, u, u, "mirror", (), 0.02, u_intensities=np.full(4, 0.01)),
        flat=FlatField(np.ones((4, 6)), 2, (12, 14)),
        response=bgars.ResponseCurve(levels, levels**2, 0.001, "sums"),
        scale=bgars.Scale(3.4, 0.002, distortion=0.004, points=80),
    )
    bgars.write_station(station, folder / "station.toml")
    (folder / "known.csv").write_text("name,height_um,diameter_um,u_um\nA1,400,500,0.2\nA2,410,,\n", encoding="utf-8")


def make_captures(folder: Path) -> None:
    """A capture: its images are not touched, what describes it is."""
    for light in range(4):
        iio.imwrite(folder / f"light_{light}.png", np.full((6, 7), 50 * light + 30, np.uint8))
    (folder / "capture.toml").write_text(
        'images = ["light_0.png", "light_1.png", "light_2.png", "light_3.png"]\npixel_pitch_um = 10.0\n'
        "response = { gamma = 2.2 }\nblack_level = 1.0\nsaturation = 250\n"
        "[lights]\nring = { count = 4, elevation_deg = 45.0, azimuth0_deg = 0.0 }\n[part]\nserial = 'S1'\n",
        encoding="utf-8",
    )


def _side(path: Path) -> object:
    from bgars.report.html.photograph import read_side_files  # noqa: PLC0415 - draws in matplotlib

    return read_side_files(path)


def _positions(path: Path) -> object:
    recipe = path.with_name("of-positions.toml")
    recipe.write_text(f"name = 'x'\npositions = {json.dumps(path.name)}\n", encoding="utf-8")
    return bgars.read_part_recipe(recipe)


def _images(path: Path) -> object:
    return decode_stack([path], max_megapixels=16.0)


def _capture(path: Path) -> object:
    return bgars.read_capture(path.parent, max_megapixels=1.0)


# name: (what reads a path, patterns of its whole files)
READERS: dict[str, tuple[Callable[[Path], object], tuple[str, ...]]] = {
    "height map": (bgars.read_height, ("h*.tif", "h.npy")),
    "normal map": (read_stored_normals, ("n*.png", "n.jpg", "n.bmp", "n*.tif", "n.np[yz]")),
    "image": (_images, ("g.*", "n8.png", "n.jpg", "n.bmp", "n8.tif")),
    "result": (bgars.read_result, ("result.json",)),
    "part recipe": (bgars.read_part_recipe, ("part.toml",)),
    "positions": (_positions, ("p.csv",)),
    "material": (bgars.read_material, ("m.toml",)),
    "scene": (bgars.read_scene, ("scene*.toml", "scene.json")),
    "lp": (read_lp, ("l.lp",)),
    "intensities": (read_intensities, ("i.txt",)),
    "file names": (read_filenames, ("f.txt",)),
    "references": (bgars.read_references, ("r.csv",)),
    "lights": (read_light_file, ("lights*",)),
    "other images": (_images, ("d.*",)),
    "mask": (lambda path: read_mask(path, (12, 14)), ("g.*", "d.[tgwn]*", "n8.png")),
    "response": (lambda path: read_response_table(path, 255.0), ("response.csv",)),
    "station": (bgars.read_station, ("station.toml",)),
    "known sizes": (read_known, ("known.csv",)),
    "capture": (_capture, ("capture.toml", "light_2.png")),
    "surface": (read_surface, ("surface.npz",)),
    "page source": (_side, ("report.json",)),
}
