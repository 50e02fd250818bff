"""Routes when the team changes: no remaining part is lost, a newcomer gets a share."""

import numpy as np

from app.arrays import FloatArray
from app.exploration.lines.lattice import route_length


def hand_over(
    routes: dict[str, FloatArray], vehicles: tuple[str, ...], en_m: FloatArray, *, both_ways: bool = True
) -> dict[str, FloatArray]:
    """Return a route (k, 2) for each of ``vehicles``, which are at ``en_m`` (n_vehicles, 2).

    The rest of a vehicle that left goes to the one whose own rest ends closest to it; a newcomer takes the second half
    of the longest rest. Where all have left, the rests go to the newcomer that is closest to the first of them, and
    the others take their halves from it. ``both_ways``: whether these may be flown from their ends, too.
    """
    here = dict(zip(vehicles, en_m, strict=True))
    result = {name: routes[name] for name in vehicles if name in routes}
    if not result:
        begins_m = next((routes[name][0] for name in sorted(routes) if len(routes[name])), en_m[0])
        result[min(vehicles, key=lambda name: float(np.hypot(*(here[name] - begins_m))))] = np.zeros((0, 2))
    for name in sorted(routes.keys() - here.keys()):
        rest = routes[name]
        if len(rest):
            ends = {k: route[-1] if len(route) else here[k] for k, route in result.items()}
            heir = min(sorted(ends), key=lambda k: float(np.hypot(*(ends[k] - rest[0]))))
            result[heir] = np.vstack([result[heir], rest])
    for name in vehicles:
        if name not in result:
            donor = max(sorted(result), key=lambda k: route_length(here[k], result[k]))
            result[donor], result[name] = halves(result[donor], here[name], both_ways=both_ways)
    return result


def halves(rest: FloatArray, taker_m: FloatArray, *, both_ways: bool = True) -> tuple[FloatArray, FloatArray]:
    """Return a rest (k, 2) in two: what its vehicle keeps, and what one at ``taker_m`` (2,) takes.

    Where it may be flown ``both_ways`` that begins on the taker's side.
    """
    half = (len(rest) + 1) // 2
    # The piece between the halves may be a whole line: it belongs to the second one.
    begin = half - 1 if len(rest) > half else half
    taken = rest[begin:]
    backwards = both_ways and len(taken) > 1 and np.hypot(*(taken[-1] - taker_m)) < np.hypot(*(taken[0] - taker_m))
    return rest[:half], taken[::-1] if backwards else taken
