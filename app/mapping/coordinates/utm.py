"""UTM zones: which one a place lies in."""

NORTH_END_DEG, SOUTH_END_DEG = 84.0, -80.0
"""Nearer to the poles there are no zones, but the universal polar stereographic projection."""

WIDER_ZONES = (
    (56.0, 64.0, 3.0, 12.0, 32),
    (72.0, 84.0, 0.0, 9.0, 31),
    (72.0, 84.0, 9.0, 21.0, 33),
    (72.0, 84.0, 21.0, 33.0, 35),
    (72.0, 84.0, 33.0, 42.0, 37),
)
"""South, north, west and east end, and number, of the zones off Norway and about Svalbard that are not of 6 degrees."""


def utm_epsg(lat_deg: float, lon_deg: float) -> int:
    """Return the EPSG code of the UTM zone of a place, or of universal polar stereographic, WGS 84."""
    if lat_deg > NORTH_END_DEG:
        return 5041
    if lat_deg < SOUTH_END_DEG:
        return 5042
    usual = int((lon_deg + 180.0) // 6.0) % 60 + 1
    wider = (
        zone for south, north, west, east, zone in WIDER_ZONES if south <= lat_deg < north and west <= lon_deg < east
    )
    zone = next(wider, usual)
    return (32600 if lat_deg >= 0.0 else 32700) + zone
