"""The files of a page, named where nothing is drawn."""

__all__ = ["REPORT_FILES"]

REPORT_FILES = {
    "report.html": "open in a browser: verdict, balls, charts and a 3-D view on one page that needs no network",
    "photograph.jpg": "the part as the camera saw it, for `bgars report`",
    "report.json": "where the photograph lies, and the lights, for `bgars report`",
    "surface.npz": "height map of the part, for the 3-D view of `bgars report`",
}
