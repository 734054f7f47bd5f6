"""Decoders of image files that the compiled one does not read, a module a library; nothing is chosen by guessing."""

from __future__ import annotations

from bgars.io.decoders.exr import read_exr
from bgars.io.decoders.hdr import read_hdr
from bgars.io.decoders.npy import read_npy
from bgars.io.decoders.pfm import read_pfm
from bgars.io.decoders.pillow import read_pillow
from bgars.io.decoders.raw import read_raw
from bgars.io.decoders.tiff import read_tiff, read_tiff_pages

__all__ = ["read_exr", "read_hdr", "read_npy", "read_pfm", "read_pillow", "read_raw", "read_tiff", "read_tiff_pages"]
