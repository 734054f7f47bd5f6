"""RTI light positions in every dialect: read right, and what had to be assumed is said; or refused in one line."""

from __future__ import annotations

import re
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.files.light_formats import read_light_file
from case_captures import (
    COUNT,
    LIGHTS,
    PLAIN,
    levels,
    lp_lines,
    names_of,
    reads_right,
    refused,
    with_names,
    write_images,
    write_lp,
)


def commas(lines: list[str]) -> list[str]:
    return [line.replace("0.", "0,").replace("-0.", "-0,") for line in lines]


LP_DIALECTS = {
    "plain": (PLAIN, {}, []),
    "tabs": ([line.replace(" ", "\t") for line in PLAIN], {}, []),
    "crlf and blanks": ([line + "  \r" for line in PLAIN] , {}, []),
    "byte order mark": (PLAIN, {"encoding": "utf-8-sig"}, []),
    "utf-16": (PLAIN, {"encoding": "utf-16"}, ["read as UTF-16"]),
    "utf-16 without a mark": (PLAIN, {"encoding": "utf-16-le"}, ["read as UTF-16"]),
    "utf-16 big endian": (PLAIN, {"encoding": "utf-16-be"}, ["read as UTF-16"]),
    "csv": ([line.replace(" ", ",") for line in PLAIN], {}, []),
    "csv with blanks": ([line.replace(" ", ", ") for line in PLAIN], {}, []),
    "semicolons": ([line.replace(" ", ";") for line in PLAIN], {}, []),
    "decimal comma": (commas(PLAIN), {}, ["decimal commas"]),
    "decimal comma and tabs": ([line.replace(" ", "\t") for line in commas(PLAIN)], {}, ["decimal commas"]),
    "decimal comma and semicolons": ([line.replace(" ", ";") for line in commas(PLAIN)], {}, ["decimal commas"]),
    "no count": (PLAIN, {"count": False}, ["no count", f"{COUNT} lights were counted"]),
    "comments": (["# made by a dome", *PLAIN[:4], "", "% more", *PLAIN[4:]], {"count": False}, ["no count"]),
    "trailing comments": ([f"{line} # lamp" for line in PLAIN], {}, []),
    "quotes": (with_names(lambda name: f'"{name}"'), {}, []),
    "single quotes": (with_names(lambda name: f"'{name}'"), {}, []),
    "csv with quotes": ([line.replace(" ", ",") for line in with_names(lambda name: f'"{name}"')], {}, []),
    "windows paths": (with_names(lambda name: rf"C:\Users\me\My RTI\jpeg-exports\{name}"), {}, ["last part of"]),
    "network paths": (with_names(lambda name: rf"\\server\share\rti\{name}"), {}, ["last part of their paths"]),
    "windows paths with slashes": (with_names(lambda name: f"D:/rti/{name}"), {}, ["last part of their paths"]),
    "posix paths": (with_names(lambda name: f"/home/me/rti/{name}"), {}, ["last part of their paths"]),
    "relative paths of elsewhere": (with_names(lambda name: f"../jpeg-exports/{name}"), {}, ["last part of"]),
    "other case": (with_names(str.upper), {}, ["case of letters"]),
    "other extension": (with_names(lambda name: name.replace(".png", ".CR2")), {}, ["by stem"]),
    "no extension": (with_names(lambda name: name.replace(".png", "")), {}, ["by stem"]),
    "windows paths, other extension": (with_names(lambda name: "E:\\" + name.replace("png", "NEF")), {}, ["by stem"]),
    "positions on a dome": (lp_lines([f"img_{i:02d}.png" for i in range(1, COUNT + 1)], LIGHTS * 250), {}, []),
    "positions at unequal distances": (
        lp_lines([f"img_{i:02d}.png" for i in range(1, COUNT + 1)], LIGHTS * np.linspace(200, 300, COUNT)[:, None]),
        {},
        [],
    ),
    "upper-case ending": (PLAIN, {"name": "COIN.LP"}, []),
    "an intensity column": ([f"{line} 1.0" for line in PLAIN], {}, ["fourth number", "intensity"]),
    "the number of the light first": ([f"{index} {line}" for index, line in enumerate(PLAIN)], {}, ["number of the"]),
    "brackets": ([re.sub(r"png (.*)$", r"png (\1)", line).replace(" 0.", ", 0.") for line in PLAIN], {}, []),
    "in another folder": (PLAIN, {"name": "lp/dome.lp"}, ["lp/dome.lp"]),
    "a header": (["filename x y z", *PLAIN], {"count": False}, ["no count"]),
}  # fmt: skip


@pytest.mark.parametrize("dialect", LP_DIALECTS)
def test_lp_dialects(tmp_path: Path, dialect: str) -> None:
    lines, options, words = LP_DIALECTS[dialect]
    write_images(tmp_path)
    write_lp(tmp_path, lines, **options)
    reads_right(tmp_path, *words)


@pytest.mark.parametrize("order", [1, -1])
def test_lights_and_images_go_together_by_name(tmp_path: Path, order: int) -> None:
    write_images(tmp_path)
    write_lp(tmp_path, PLAIN[::order][3:] + PLAIN[::order][:3])
    capture = bgars.read_capture(tmp_path)
    place = [int(path.stem[-2:]) - 1 for path in capture.files]
    np.testing.assert_allclose(capture.rig.directions, LIGHTS[place], atol=1e-5)


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8", "utf-16"])
def test_names_with_umlauts(tmp_path: Path, encoding: str) -> None:
    names = write_images(tmp_path, [f"Münze Größe {index}.png" for index in range(COUNT)])
    write_lp(tmp_path, lp_lines(names), encoding=encoding)
    reads_right(tmp_path, *{"latin-1": ["Windows-1252"], "utf-8": [], "utf-16": ["UTF-16"]}[encoding])


@pytest.mark.parametrize("stem", ["my coin {}", "coin 0.5 {}", "img#{}", "coin_{}.jpg"])
def test_names_that_look_like_something_else(tmp_path: Path, stem: str) -> None:
    names = write_images(tmp_path, [f"{stem.format(index)}.png" for index in range(COUNT)])
    write_lp(tmp_path, lp_lines(names))
    reads_right(tmp_path)


def test_intensities_of_an_lp_file_divide(tmp_path: Path) -> None:
    write_images(tmp_path)
    write_lp(tmp_path, [f"{line} {1 + index / 10}" for index, line in enumerate(PLAIN)])
    with pytest.warns(bgars.CaptureWarning, match="intensity"):
        capture = bgars.read_capture(tmp_path)
    np.testing.assert_allclose(capture.rig.intensities, 1 + np.arange(COUNT) / 10)


@pytest.mark.parametrize("folders", [("assembly-files", "jpeg-exports"), ("Assembly-Files", "original-captures")])
@pytest.mark.parametrize("inside", [False, True])
def test_the_tree_of_rtibuilder(tmp_path: Path, folders: tuple[str, str], inside: bool) -> None:
    lp_folder, image_folder = folders
    names = write_images(tmp_path / image_folder)
    write_lp(tmp_path, lp_lines([rf"C:\RTI\coin\{image_folder}\{name}" for name in names]), name=f"{lp_folder}/coin.lp")
    if inside and lp_folder != "assembly-files":
        pytest.skip("the search from inside knows the folder as RTIBuilder names it")
    reads_right(tmp_path / lp_folder if inside else tmp_path, image_folder)


def test_cropped_images_are_those_that_the_file_names(tmp_path: Path) -> None:
    write_images(tmp_path / "jpeg-exports", images=np.pad(levels(), ((0, 0), (4, 4), (4, 4))))
    names = write_images(tmp_path / "cropped-files")
    write_lp(tmp_path, lp_lines([rf"C:\coin\cropped-files\{name}" for name in names]), name="assembly-files/coin.lp")
    reads_right(tmp_path, "cropped-files")


@pytest.mark.parametrize(
    ("lines", "options", "words"),
    [
        (["6", *PLAIN], {"count": False}, ["lights.lp", "announces 6", "8 follow"]),
        (["9", *PLAIN], {"count": False}, ["lights.lp", "announces 9", "8 follow"]),
        ([*PLAIN[:7], "img_08.png 0 0 0"], {}, ["line 9", "not zero"]),
        ([*PLAIN[:7], "img_08.png nan 0 1"], {}, ["line 9", "file x y z"]),
        ([*PLAIN[:7], "img_08.png 0 1"], {}, ["line 9", "file x y z", "img_08.png 0 1"]),
        ([*PLAIN[:7], "img_07.png 0 0 1"], {}, ["img_07.png", "twice"]),
        ([*PLAIN[:7], "img_99.png 0 0 1"], {}, ["img_99.png", "no such image", "lights.lp", "7 of 8"]),
        ([*PLAIN[:7], "0 0 1"], {}, ["line 9", "file x y z"]),
        ([], {}, ["holds no light"]),
        (["1²2"], {"count": False}, ["line 1", "number of lights"]),
        (["9" * 5000], {"count": False}, ["line 1", "number of lights"]),
        (["img.png 1 2 3"] * 20_000, {"count": False}, ["20000 lines", "at most 10000"]),
    ],
)  # fmt: skip
def test_lp_files_that_cannot_be_right(
    tmp_path: Path, lines: list[str], options: dict[str, bool], words: list[str]
) -> None:
    write_images(tmp_path)
    write_lp(tmp_path, lines, **options)
    refused(tmp_path, *words)


def test_a_stem_that_fits_two_images_is_not_guessed(tmp_path: Path) -> None:
    write_images(tmp_path)
    write_images(tmp_path, [f"img_{index:02d}.bmp" for index in range(1, COUNT + 1)])
    write_lp(tmp_path, with_names(lambda name: name.replace("png", "CR2")))
    refused(tmp_path, "img_01.CR2", "no such image")


@pytest.mark.parametrize("header", ["y x z", "file,z,y,x", "light_y;light_x;light_z"])
def test_columns_in_another_order_are_refused(tmp_path: Path, header: str) -> None:
    path = tmp_path / "lights.csv"
    path.write_text("\n".join([header, *(" ".join(line.split()[1:]) for line in PLAIN)]), encoding="utf-8")
    with pytest.raises(bgars.FileFormatError, match="line 1: the columns must stand in the order x, y, z"):
        read_light_file(path)
    good = {"y x z": "x y z intensity", "file,z,y,x": "lx,ly,lz", "light_y;light_x;light_z": "x y z"}[header]
    lines = path.read_text(encoding="utf-8").split("\n")
    path.write_text("\n".join([good, *lines[1:]]), encoding="utf-8")
    np.testing.assert_allclose(read_light_file(path).vectors, LIGHTS, atol=1e-4)


@pytest.mark.parametrize("header", ["file x y z", "filename,x,y,z", "image\tLx\tLy\tLz"])
def test_a_header_below_the_count_is_not_counted(header: str, tmp_path: Path) -> None:
    between = "," if "," in header else "\t" if "\t" in header else " "
    rows = [line.replace(" ", between) for line in lp_lines(write_images(tmp_path))]
    (tmp_path / "lights.lp").write_text("\n".join([str(COUNT), header, *rows]), encoding="utf-8")
    reads_right(tmp_path)
    (tmp_path / "lights.lp").write_text("\n".join([str(COUNT), header, *rows[:-1]]), encoding="utf-8")
    refused(tmp_path, f"announces {COUNT} lights, but {COUNT - 1} follow")


def test_names_that_look_like_numbers_of_fortran_stay_names(tmp_path: Path) -> None:
    names = names_of("{}D2.png")
    write_images(tmp_path, names)
    write_lp(tmp_path, lp_lines([name.removesuffix(".png") for name in names]))
    reads_right(tmp_path, "by stem")
