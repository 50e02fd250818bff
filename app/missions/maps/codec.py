"""A mission's map as bytes: every layer exactly as it was made."""

import io
import json
import zlib

import numpy as np

from app.mapping.types import BathymetricMap, Grid
from app.missions.maps.builder import BuiltMap, Doubted, digest_of

LAYERS = ("depth_m", "sd_m", "count", "sounded", "roughness")
OPTIONAL = ("prior", "process_sd_m", "bound_sd_m", "precision", "horizontal_sd_m", "shared_sd_m")
FASTEST = 1
"""Depths hardly get smaller; what lies outside of the area does at any level."""


def pack(bathymetry: BathymetricMap, doubted: Doubted) -> bytes:
    """Return a map and what it leaves out as bytes."""
    grid = bathymetry.grid
    facts = {
        "grid": [grid.west_m, grid.south_m, grid.cell_m, grid.rows, grid.cols],
        "correlation_length_m": bathymetry.correlation_length_m,
        "model": bathymetry.model,
        "reasons": [reason for _, reason in doubted],
    }
    arrays = {name: getattr(bathymetry, name) for name in LAYERS}
    arrays |= {name: layer for name in OPTIONAL if (layer := getattr(bathymetry, name)) is not None}
    arrays["doubted"] = np.array([row for row, _ in doubted], dtype=float).reshape(-1, 4)
    arrays["facts"] = np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8)
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, **arrays)
    return zlib.compress(content.getbuffer(), FASTEST)


def unpack(content: bytes, digest: str, soundings: int, *, thorough: bool) -> tuple[BuiltMap, Doubted]:
    """Return the map, as the first one of this process, and what it leaves out.

    Raises
    ------
    ValueError
        When the bytes are not those of the map that had this digest.
    """
    try:
        with np.load(io.BytesIO(zlib.decompress(content)), allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        facts = json.loads(arrays.pop("facts").tobytes())
        doubted = list(zip(arrays.pop("doubted"), facts["reasons"], strict=True))
        bathymetry = BathymetricMap(
            grid=Grid(*facts["grid"]),
            correlation_length_m=facts["correlation_length_m"],
            model=facts["model"],
            **arrays,
        )
    except (zlib.error, KeyError, TypeError, OSError) as error:
        raise ValueError(f"this is no stored map: {error}") from error
    if digest_of(bathymetry) != digest:
        raise ValueError("the stored map is not the one that was made: its digest differs")
    return BuiltMap(1, soundings, bathymetry, digest, thorough), doubted
