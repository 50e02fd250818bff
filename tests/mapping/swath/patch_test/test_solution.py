"""Cells that lines share, and the equations of their differences, against plain and slow reckonings."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from app.arrays import FloatArray, IntArray
from app.mapping.swath.patch_test.cells import SharedCells, shared_cells
from app.mapping.swath.patch_test.solution import HUBER, UNKNOWN_SD, Equations, LineErrors

ERRORS = LineErrors(0.3, 0.05)


TIMES = np.linspace(0.0, 60.0, 4000)


def beams(seed: int) -> tuple[FloatArray, FloatArray, IntArray]:
    """Beams of three lines over a plane, their changes, and their lines; the second line lies deeper."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, 8.0, (4000, 2))
    line = rng.integers(0, 3, len(places))
    down = 10.0 + 0.2 * places[:, 0] - 0.1 * places[:, 1] + 0.05 * (line == 1) + 0.002 * rng.standard_normal(len(line))
    return np.column_stack([places, down]), rng.standard_normal((len(line), 5, 3)), line


def test_cells_hold_what_lines_say_of_them_one_by_one() -> None:
    where, change, line = beams(0)
    cells = shared_cells(where, change, line, TIMES, (1.0, 4.0), 10.0)
    assert cells.cells == 64
    assert len(cells) == 3 * 64
    np.testing.assert_allclose(cells.slope, np.tile([0.2, -0.1], (len(cells), 1)), atol=0.02)
    row, of = 0, 0
    for east in range(8):
        for north in range(8):
            inside = (np.floor(where[:, 0]) == east) & (np.floor(where[:, 1]) == north)
            middle = where[inside, :2].mean(axis=0)
            for number in range(3):
                own = inside & (line == number)
                assert (cells.cell[row], cells.line[row]) == (of, number)
                true = 10.0 + 0.2 * middle[0] - 0.1 * middle[1] + 0.05 * (number == 1)
                assert abs(cells.depth_m[row] - true) < 0.006
                steep = cells.slope[row]
                moved = [-float((change[own, k, :2] @ steep).mean()) for k in range(5)]
                moved[4] += float(change[own, 4, 2].mean())
                moved[0] += float(change[own, 0, 2].mean())
                np.testing.assert_allclose(cells.change[row], moved, atol=1e-12)
                row += 1
            of += 1


def test_a_line_alone_in_a_cell_or_with_few_beams_does_not_count() -> None:
    where, change, line = beams(0)
    alone = where[:, 0] > 4.0
    kept = ~alone | (line == 2)
    cells = shared_cells(where[kept], change[kept], line[kept], TIMES[kept], (1.0, 4.0), 10.0)
    assert cells.cells == 32
    few = np.concatenate([np.flatnonzero(line == 0)[:3], np.flatnonzero(line == 1)])
    assert len(shared_cells(where[few], change[few], line[few], TIMES[few], (8.0, 8.0), 10.0)) == 0


def test_slopes_that_are_noise_tell_nothing() -> None:
    rng = np.random.default_rng(3)
    where, change, line = beams(3)
    where[:, 2] = 10.0 + 0.02 * rng.standard_normal(len(where))
    cells = shared_cells(where, change, line, TIMES, (1.0, 4.0), 10.0)
    assert (cells.slope == 0.0).all()
    assert (cells.change[:, 1:4] == 0.0).all()


def some_cells(seed: int) -> SharedCells:
    rng = np.random.default_rng(seed)
    cell, line = np.repeat(np.arange(60), 3), np.tile(np.arange(3), 60)
    slope = np.repeat(rng.normal(0.0, 0.2, (60, 2)), 3, axis=0)
    change = rng.normal(0.0, 5.0, (180, 5))
    depth = np.repeat(rng.normal(10.0, 1.0, 60), 3) - change @ [0.01, -0.02, 0.005, 0.001, 0.0005]
    depth += 0.02 * rng.standard_normal(180)
    depth[7] += 1.0
    return SharedCells(cell, line, cell // 4, depth, np.full(180, 0.02), change, rng.uniform(-1.0, 1.0, 180), slope)


def moves(cells: SharedCells, line_m: FloatArray) -> FloatArray:
    """By how much the depths of rows change when lines (3, 3) lie off."""
    own = line_m[cells.line]
    return np.asarray(own[:, 2] - (cells.slope * own[:, :2]).sum(axis=1))


@pytest.mark.parametrize("free", [[0, 1, 2, 3], [0, 1], [0, 2, 3]])
def test_a_step_is_that_of_a_slow_search_with_the_depth_of_every_cell_unknown(free: list[int]) -> None:
    cells = some_cells(1)
    step = Equations(cells, ERRORS).solve(free)
    doubted = [k for k in range(5) if k not in free and UNKNOWN_SD[k]]
    own = [*free, *doubted]

    lines, depths = slice(len(own), len(own) + 9), slice(len(own) + 9, None)

    def off(x: FloatArray) -> FloatArray:
        found = cells.depth_m + cells.change[:, own] @ x[: len(own)] - x[depths][cells.cell]
        return np.asarray(found + moves(cells, x[lines].reshape(3, 3)))

    def left(x: FloatArray) -> FloatArray:
        r = off(x) / cells.sd_m / scale
        # The square root of Huber's loss: straight beyond some deviations.
        far = np.abs(r) > HUBER
        r = np.where(far, np.sign(r) * np.sqrt(np.maximum(2.0 * HUBER * np.abs(r) - HUBER**2, 0.0)), r)
        shifts = x[lines].reshape(3, 3) / [0.3, 0.3, 0.05]
        return np.concatenate([r, x[len(free) : len(own)] / UNKNOWN_SD[doubted], shifts.ravel()])

    scale = 1.0
    slow = np.concatenate([np.zeros(len(own) + 9), np.bincount(cells.cell, cells.depth_m) / 3])
    for _ in range(4):
        slow = least_squares(left, slow, xtol=1e-14, ftol=1e-14, gtol=1e-14).x
        dof = (len(cells) - cells.cells - len(own)) / len(cells)
        scale = max(1.0, 1.4826 * float(np.median(np.abs(off(slow) / cells.sd_m))) / np.sqrt(dof))
    np.testing.assert_allclose(step.change, slow[: len(free)], atol=2e-5)
    assert (step.sd < 0.02).all()
    np.testing.assert_allclose(step.line_m, slow[lines].reshape(3, 3), atol=2e-3)
