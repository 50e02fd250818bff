"""Charts of the report as SVG: lines and letters that stay sharp, and can be searched."""

from collections.abc import Mapping, Sequence
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from shapely.geometry import LineString

from app.arrays import FloatArray
from app.missions.report.texts import Texts

FONT = "DejaVu Sans, Arial, sans-serif"
INK, FAINT, BAR, WARN = "#1c2733", "#c9d1d9", "#3e6695", "#b03a2e"
TRACKS = ("#3e6695", "#c2701f", "#2e7d6e", "#8c50b8", "#a03c50", "#6b7a1f")
MOST_TICKS = 7
ROUND_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
TRACK_DETAIL = 1.0 / 1500.0
"""Tracks are drawn to within this part of the chart's size."""


def _text(x: float, y: float, text: str, *, size: float = 9, anchor: str = "middle", colour: str = INK) -> str:
    place = f'x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" text-anchor="{anchor}"'
    return f'<text {place} fill="{colour}">{escape(text)}</text>'


def _line(x1: float, y1: float, x2: float, y2: float, colour: str = INK, width: float = 0.8, more: str = "") -> str:
    return (
        f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}" '
        f'stroke-width="{width:g}"{more}/>'
    )


def _svg(width: float, height: float, title: str, parts: Sequence[str]) -> bytes:
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
        f'height="{height:g}" font-family={quoteattr(FONT)} role="img" aria-label={quoteattr(title)}>'
    )
    return "".join([head, *parts, "</svg>"]).encode()


def ticks(low: float, high: float, most: int = MOST_TICKS) -> FloatArray:
    """Return round numbers between two, at most so many."""
    span = high - low
    if not span > 0.0:
        return np.array([low])
    decade = 10.0 ** np.floor(np.log10(span / most))
    step = next(part * decade for part in ROUND_STEPS if span / (part * decade) <= most)
    return np.asarray(np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step)


def _decimals(values: FloatArray) -> int:
    step = float(np.min(np.diff(values))) if len(values) > 1 else 1.0
    return next((d for d in range(7) if abs(step - round(step, d)) < 1e-9 * max(step, 1e-6) + 1e-12), 6)


def histogram(edges_m: Sequence[float], counts: Sequence[int], t: Texts) -> bytes:
    """Return bars of how many differences there are of each size; the outer bars hold those beyond the ends, too."""
    width, height, left, below, above = 520.0, 210.0, 48.0, 38.0, 10.0
    low, high, most = edges_m[0], edges_m[-1], max(max(counts), 1)
    across, up = (width - left - 12.0) / (high - low), (height - below - above) / most

    def x_of(value: float) -> float:
        return left + (value - low) * across

    base = height - below
    parts = []
    for count in ticks(0, most, 5).tolist():
        if count == int(count):
            y = base - count * up
            parts += [
                _line(left, y, width - 12.0, y, FAINT, 0.5),
                _text(left - 4, y + 3, t.number(count), anchor="end"),
            ]
    for first, last, count in zip(edges_m[:-1], edges_m[1:], counts, strict=True):
        x, bar = x_of(first), (last - first) * across
        parts.append(
            f'<rect x="{x + 0.5:.2f}" y="{base - count * up:.2f}" width="{max(bar - 1.0, 0.5):.2f}" '
            f'height="{count * up:.2f}" fill="{BAR}"/>'
        )
    marks = ticks(low, high)
    for value in marks.tolist():
        parts += [_line(x_of(value), base, x_of(value), base + 3)]
        parts.append(_text(x_of(value), base + 13, t.number(value, _decimals(marks))))
    if low < 0.0 < high:
        parts.append(_line(x_of(0.0), above, x_of(0.0), base, INK, 0.8, ' stroke-dasharray="3 2"'))
    parts += [_line(left, base, width - 12.0, base), _text(left + (width - left) / 2, height - 6, t("axis_difference"))]
    parts.append(
        f'<text transform="translate(11 {height / 2 - 10:.1f}) rotate(-90)" font-size="9" text-anchor="middle" '
        f'fill="{INK}">{escape(t("axis_crossings"))}</text>'
    )
    return _svg(width, height, t("caption_histogram"), parts)


def by_angle(bins: Sequence[Mapping[str, float | None]], t: Texts) -> bytes:
    """Return mean differences of crosslines' beams, with a standard deviation to both sides, over their angles."""
    width, height, left, below, above = 520.0, 210.0, 56.0, 38.0, 10.0
    means = np.array([one["mean_m"] for one in bins], dtype=float)
    sds = np.array([one["sd_m"] or 0.0 for one in bins], dtype=float)
    low, high = float((means - sds).min()), float((means + sds).max())
    reach = max(abs(low), abs(high), 0.01) * 1.1
    first, last = float(bins[0]["from_deg"] or 0.0), float(bins[-1]["to_deg"] or 0.0)
    base = height - below
    across, up = (width - left - 12.0) / (last - first), (base - above) / (2 * reach)

    def y_of(value: float) -> float:
        return base - (value + reach) * up

    marks, parts = ticks(-reach, reach, 5), []
    for value in marks.tolist():
        parts += [_line(left, y_of(value), width - 12.0, y_of(value), FAINT, 0.5)]
        parts.append(_text(left - 4, y_of(value) + 3, t.number(value, _decimals(marks)), anchor="end"))
    parts.append(_line(left, y_of(0.0), width - 12.0, y_of(0.0)))
    for one, mean, sd in zip(bins, means.tolist(), sds.tolist(), strict=True):
        x = left + (0.5 * (float(one["from_deg"] or 0.0) + float(one["to_deg"] or 0.0)) - first) * across
        parts.append(_line(x, y_of(mean - sd), x, y_of(mean + sd), BAR, 1.2))
        parts.append(f'<circle cx="{x:.1f}" cy="{y_of(mean):.1f}" r="2.6" fill="{BAR}"/>')
    for value in ticks(first, last, 9).tolist():
        x = left + (value - first) * across
        parts += [_line(x, base, x, base + 3), _text(x, base + 13, t.number(value))]
    parts += [_line(left, base, width - 12.0, base), _text(left + (width - left) / 2, height - 6, t("axis_angle"))]
    parts.append(
        f'<text transform="translate(11 {height / 2 - 10:.1f}) rotate(-90)" font-size="9" text-anchor="middle" '
        f'fill="{INK}">{escape(t("axis_difference"))}</text>'
    )
    return _svg(width, height, t("caption_by_angle"), parts)


def _shortened(name: str, most: int = 24) -> str:
    return name if len(name) <= most else f"{name[: most - 1]}…"


def overview(
    area_m: FloatArray,
    zones_m: Sequence[FloatArray],
    points_m: FloatArray,
    tracks_m: Mapping[str, FloatArray],
    crossings: Sequence[tuple[float, float, bool]],
    t: Texts,
) -> bytes:
    """Return where the survey was: area, zones and tracks in metres of the local frame, north up.

    Parameters
    ----------
    area_m, zones_m, tracks_m
        Vertices (n, 2), east and north.
    points_m
        Recovery points, (n, 2).
    crossings
        East, north, and whether the difference there is an outlier.
    """
    everything = np.concatenate([area_m, points_m, *(track for track in tracks_m.values() if len(track))])
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = 0.04 * float((high - low).max())
    low, high = low - margin, high + margin
    size = high - low
    left, below, above, legend = 52.0, 34.0, 8.0, 150.0
    scale = min(330.0 / size[0], 300.0 / size[1])
    width, height = left + size[0] * scale + legend, max(above + size[1] * scale + below, 150.0)
    base, right = above + size[1] * scale, left + size[0] * scale

    def at(place: Sequence[float]) -> tuple[float, float]:
        return left + (place[0] - low[0]) * scale, base - (place[1] - low[1]) * scale

    def ring(vertices: FloatArray, style: str) -> str:
        corners = " ".join("{:.1f},{:.1f}".format(*at(place)) for place in vertices.tolist())
        return f'<polygon points="{corners}" {style}/>'

    parts = [
        f'<rect x="{left:g}" y="{above:g}" width="{size[0] * scale:.1f}" height="{size[1] * scale:.1f}" '
        'fill="#f4f8fb"/>',
        ring(area_m, f'fill="#dcebf3" stroke="{INK}" stroke-width="1"'),
    ]
    parts += [ring(zone, f'fill="{WARN}" fill-opacity="0.25" stroke="{WARN}" stroke-width="1"') for zone in zones_m]
    named = [(f'fill="#dcebf3" stroke="{INK}"', t("legend_area"))]
    if zones_m:
        named.append((f'fill="{WARN}" fill-opacity="0.25" stroke="{WARN}"', t("legend_zone")))
    for number, (name, track) in enumerate(tracks_m.items()):
        if len(track) >= 2:
            colour = TRACKS[number % len(TRACKS)]
            line = np.asarray(LineString(track).simplify(float(size.max()) * TRACK_DETAIL).coords)
            corners = " ".join("{:.1f},{:.1f}".format(*at(place)) for place in line.tolist())
            parts.append(f'<polyline points="{corners}" fill="none" stroke="{colour}" stroke-width="0.8"/>')
            if number < len(TRACKS):
                named.append((f'fill="{colour}"', _shortened(name)))
    for east_m, north_m, outlier in sorted(crossings, key=lambda one: one[2]):
        x, y = at((east_m, north_m))
        colour = WARN if outlier else INK
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{2.2 if outlier else 1.2}" fill="{colour}"/>')
    if crossings:
        named.append((f'fill="{INK}"', t("legend_crossing")))
        if any(outlier for *_, outlier in crossings):
            named.append((f'fill="{WARN}"', t("legend_outlier")))
    for place in points_m.tolist():
        x, y = at(place)
        parts.append(f'<path d="M{x:.1f} {y - 5:.1f}l4.5 8h-9z" fill="#f4c450" stroke="{INK}" stroke-width="0.8"/>')
    if len(points_m):
        named.append((f'fill="#f4c450" stroke="{INK}"', t("legend_recovery")))
    parts.append(
        f'<rect x="{left:g}" y="{above:g}" width="{size[0] * scale:.1f}" height="{size[1] * scale:.1f}" fill="none" '
        f'stroke="{INK}" stroke-width="0.8"/>'
    )
    for value in ticks(float(low[0]), float(high[0]), 5).tolist():
        x, _ = at((value, low[1]))
        parts += [_line(x, base, x, base + 3), _text(x, base + 12, t.number(value), size=8)]
    for value in ticks(float(low[1]), float(high[1]), 5).tolist():
        _, y = at((low[0], value))
        parts += [_line(left - 3, y, left, y), _text(left - 5, y + 3, t.number(value), size=8, anchor="end")]
    parts.append(_text((left + right) / 2, base + 26, t("axis_east"), size=8))
    parts.append(
        f'<text transform="translate(10 {(above + base) / 2:.1f}) rotate(-90)" font-size="8" text-anchor="middle" '
        f'fill="{INK}">{escape(t("axis_north"))}</text>'
    )
    for number, (style, words) in enumerate(named):
        y = above + 8 + 15 * number
        parts.append(f'<rect x="{right + 12:.1f}" y="{y - 6:.1f}" width="9" height="9" {style}/>')
        parts.append(_text(right + 26, y + 2, words, size=8, anchor="start"))
    return _svg(width, max(height, above + 15.0 * len(named) + 8), t("caption_overview"), parts)
