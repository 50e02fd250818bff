"""Point clouds are read by other programs with every sounding at its place, time, depth and source."""

import io
from pathlib import Path

import laspy
import numpy as np
import pyproj

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.projected import ProjectedFrame
from app.mapping.products.point_cloud import PointCloudFile

FRAME = LocalFrame(41.185, -8.705)
LEAP_S = 18


def soundings(count: int, seed: int) -> FloatArray:
    """Return time, east, north, depth, deviation, angle, (6, count)."""
    rng = np.random.default_rng(seed)
    low, high = [1.795e9, -500.0, -500.0, -1.0, 0.01, -1.1], [1.796e9, 500.0, 500.0, 60.0, 0.6, 1.1]
    return rng.uniform(low, high, (count, 6)).T


def test_a_cloud_in_pieces_is_read_with_everything_at_its_place(tmp_path: Path) -> None:
    beams, single = soundings(20_000, 1), soundings(300, 2)
    path = tmp_path / "cloud.laz"
    with path.open("w+b") as file:
        cloud = PointCloudFile(file, ProjectedFrame(32629, FRAME), ["lauv-1", "näytös"], "mean sea level")
        cloud.add("näytös", *beams[:, :12_000])
        cloud.add("lauv-1", *single[:5])
        cloud.add("näytös", *beams[:, 12_000:])
        cloud.close()
    read = laspy.read(path)
    assert (read.header.version, read.header.point_format.id) == (laspy.header.Version(1, 4), 6)
    crs = read.header.parse_crs()
    assert crs is not None
    assert crs.to_epsg() == 32629
    source = np.asarray(read.point_source_id)
    assert [int((source == number).sum()) for number in (1, 2)] == [300, 20_000]
    assert (np.asarray(read.classification) == 40).all()
    back = pyproj.Transformer.from_crs(crs, 4326, always_xy=True)
    for number, (time_s, east_m, north_m, depth_m, sd_m, angle_rad) in ((1, single), (2, beams)):
        mine = source == number
        lon, lat = back.transform(np.asarray(read.x)[mine], np.asarray(read.y)[mine])
        east, north = FRAME.to_local(lat, lon)
        assert np.abs(east - east_m).max() < 0.002
        assert np.abs(north - north_m).max() < 0.002
        assert np.abs(np.asarray(read.z)[mine] + depth_m).max() < 0.001
        assert np.allclose(np.asarray(read["depth_sd"])[mine], sd_m, rtol=1e-6)
        gps_s = np.asarray(read.gps_time)[mine] + 1e9
        assert np.allclose(gps_s + 315_964_800 - LEAP_S, time_s, atol=1e-3)
        angles = np.asarray(read.scan_angle)[mine] * 0.006
        assert np.allclose(angles, np.degrees(angle_rad) if number == 2 else 0.0, atol=0.0031)
    [own] = [vlr for vlr in read.header.vlrs if vlr.user_id == "bathyfleet"]
    assert own.record_data.decode() == (
        "z: minus the depth from mean sea level, metres; sources: 1 lauv-1; 2 näytös"
    )  # fmt: skip


def test_a_cloud_of_nothing_can_be_read() -> None:
    file = io.BytesIO()
    PointCloudFile(file, ProjectedFrame(25829, FRAME), [], "chart datum").close()
    file.seek(0)
    assert len(laspy.read(file).points) == 0
