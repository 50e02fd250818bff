"""What operators say of beams: of each the last word counts, however pings come."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.mapping.swath.rulings import BeamRulings, BeamSet, Edit

BEAMS = 11
TIMES = [0.1 * k for k in range(7)]

chosen = st.dictionaries(st.sampled_from(TIMES), st.sets(st.integers(0, BEAMS - 1)), max_size=5)
words = st.lists(st.tuples(st.booleans(), st.sampled_from(["a", "b"]), chosen), max_size=6)


def beam_set(beams: dict[float, set[int]]) -> BeamSet:
    wide = np.zeros((len(beams), BEAMS), dtype=np.bool_)
    for row, places in enumerate(beams.values()):
        wide[row, list(places)] = True
    return BeamSet.of(np.array(list(beams)), wide)


@given(said=words, order=st.permutations(TIMES), wide=st.integers(1, 20))
def test_of_each_beam_the_last_word_counts(
    said: list[tuple[bool, str, dict[float, set[int]]]], order: list[float], wide: int
) -> None:
    expected: dict[tuple[str, float, int], bool] = {}
    for rejects, vehicle, beams in said:
        expected |= {(vehicle, time_s, beam): rejects for time_s, places in beams.items() for beam in places}
    rulings = BeamRulings([Edit(rejects, {vehicle: beam_set(beams)}) for rejects, vehicle, beams in said])
    for rejects, found in ((True, rulings.rejected), (False, rulings.restored)):
        assert sum(len(one) for one in found.values()) == sum(word is rejects for word in expected.values())
        for vehicle, own in found.items():
            among = own.among(np.array([*order, 99.0]), wide)
            assert among.shape == (len(order) + 1, wide)
            assert not among[-1].any(), "nothing was said of that ping"
            for row, time_s in enumerate(order):
                told = {beam for beam in range(wide) if expected.get((vehicle, time_s, beam)) is rejects}
                assert set(np.flatnonzero(among[row]).tolist()) == told
