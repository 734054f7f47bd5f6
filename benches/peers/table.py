"""Rows as Markdown tables: what compare.py prints and what docs/performance.md shows, character for character."""

from __future__ import annotations

from typing import Any

Rows = list[dict[str, Any]]
YES_NO = {True: "yes", False: "**no**", None: ""}
SIGN = {"at least": ">=", "at most": "<="}


def of_kind(rows: Rows, kind: str, group: str | None = None) -> Rows:
    """Rows of one kind (and one group)."""
    return [row for row in rows if row["kind"] == kind and group in {None, row["group"]}]


def markdown(header: list[str], lines: list[list[str]]) -> list[str]:
    """A table with columns as wide as they need to be, so that it reads as text too."""
    widths = [max(len(line[column]) for line in [header, *lines]) for column in range(len(header))]
    rule = ["-" * width for width in widths]
    return [
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) + " |"
        for line in [header, rule, *lines]
    ]


def ratio_table(rows: Rows) -> list[str]:
    """The comparisons; how to read a ratio is in its limit: >= is peer / bgars, <= is bgars / peer."""
    header = ["what", "size", "threads", "bgars (s)", "peer", "peer (s)", "ratio", "is", "limit", "met"]
    quotient = {"at least": "peer / bgars", "at most": "bgars / peer"}
    lines = [
        [
            row["what"],
            row["size"],
            str(row["threads"]),
            f"{row['bgars_s']:.3g}",
            row["peer"],
            f"{row['peer_s']:.3g}",
            f"{row['ratio']:.3g}",
            quotient[row["bound"]],
            _limit(row),
            YES_NO[row["met"]],
        ]
        for row in rows
    ]
    return markdown(header, lines)


def check_table(rows: Rows) -> list[str]:
    """Figures that are no times."""
    header = ["figure", "size", "threads", "value", "unit", "limit", "met"]
    lines = [
        [
            row["what"],
            row["size"],
            str(row["threads"]),
            f"{row['value']:.3g}",
            row["unit"],
            _limit(row),
            YES_NO[row["met"]],
        ]
        for row in rows
    ]
    return markdown(header, lines)


def scaling_table(rows: Rows) -> list[str]:
    """Seconds a megapixel by size: level where the cost is linear."""
    header = ["shape", "megapixels", "threads", "iterations", "seconds", "seconds a megapixel"]
    lines = [
        [
            row["shape"],
            f"{row['megapixels']:.3g}",
            str(row["threads"]),
            str(row["iterations"]),
            f"{row['seconds']:.3g}",
            f"{row['seconds'] / row['megapixels']:.3g}",
        ]
        for row in rows
    ]
    return markdown(header, lines)


def roofline_table(rows: Rows) -> list[str]:
    """The share of the copy rate that is reached: 100 % is a pass that is bound by memory alone."""
    header = ["pass", "size", "threads", "bytes a pixel", "operations a pixel", "operations a byte", "copy (GB/s)"]
    header += ["bound by memory (MP/s)", "reached (MP/s)", "share", "operations (G/s)"]
    lines = []
    for row in rows:
        reached = row["pixels"] / row["seconds"]
        bound = row["copy_bytes_per_s"] / row["bytes_per_pixel"]
        lines.append(
            [
                row["what"],
                row["size"],
                str(row["threads"]),
                f"{row['bytes_per_pixel']:.0f}",
                f"{row['operations_per_pixel']:.0f}",
                f"{row['operations_per_pixel'] / row['bytes_per_pixel']:.2g}",
                f"{row['copy_bytes_per_s'] / 1e9:.3g}",
                f"{bound / 1e6:.3g}",
                f"{reached / 1e6:.3g}",
                f"{100 * reached / bound:.0f} %",
                f"{reached * row['operations_per_pixel'] / 1e9:.3g}",
            ]
        )
    return markdown(header, lines)


def skipped_lines(rows: Rows) -> list[str]:
    """What could not be measured."""
    return [f"Skipped: {row['what']} ({row['why']})." for row in rows]


def machine_line(machine: dict[str, Any]) -> str:
    """One sentence about the machine and the versions."""
    versions = ", ".join(f"{name} {number}" for name, number in machine["versions"].items())
    parts = (machine["processor"], machine["vectors"], f"{machine['cores']} cores", machine["system"])
    return f"Machine: {', '.join(parts)}. Versions: {versions}."


TABLES = {"ratio": ratio_table, "check": check_table, "point": scaling_table, "roofline": roofline_table}


def group_lines(rows: Rows, group: str) -> list[str]:
    """All tables of a group, an empty line after each."""
    lines = []
    for kind, table in TABLES.items():
        chosen = of_kind(rows, kind, group)
        if chosen:
            lines += [*table(chosen), ""]
    skipped = skipped_lines(of_kind(rows, "skipped", group))
    return lines + ([*skipped, ""] if skipped else [])


def _limit(row: dict[str, Any]) -> str:
    return "" if row["limit"] is None else f"{SIGN[row['bound']]} {row['limit']:g}"
