"""What the process learns from the soundings: its kernel, and its length by what the map is for."""

import numpy as np

from app.arrays import IntArray
from app.mapping.gaussian_process.calibration import gaps
from app.mapping.gaussian_process.roughness import HOLE_NEIGHBOURS, neighbours_beyond
from app.mapping.kriging.conditionals import families
from app.mapping.kriging.kernels import KERNEL_CODES, KernelName
from app.mapping.kriging.kriging import Conditioned, krige_holes
from app.mapping.kriging.levels import TwoLevels
from app.mapping.kriging.likelihood import Hyperparameters, RestrictedLikelihood, spread_subset
from app.mapping.kriging.scales import LocalScales, uniform_scales

ROUGHEST: KernelName = "matern32"
KERNEL_LADDER: tuple[KernelName, ...] = (ROUGHEST, "matern52", "gaussian")
KERNEL_GAIN = 0.05  # of log likelihood per sounding, to prefer a smoother kernel
CHOICE_OF_KERNEL_POINTS = 200
FAMILIES = 600
"""Soundings whose likelihood given their neighbours is added to that of the subset."""

LENGTH_FACTORS = (1.5, 2.2, 3.3)
LENGTHEN_FROM = 30  # soundings; fewer cannot choose
CHOICE_POINTS = 400
CHOICE_MARGIN = 0.02  # a longer length must predict better by this much
GAP_FACTOR = 1.5  # radius of the holes over the median distance of places to their nearest sounding


def likelihood_of(
    levels: TwoLevels, kernel: KernelName, subset: IntArray, scales: LocalScales, *, learn: bool
) -> RestrictedLikelihood:
    """Return the likelihood of the fine soundings ``subset`` and, where there are more, of some given their neighbours.

    ``scales`` are those of all soundings. The trend is found by the subset alone: who does not ``learn`` by the
    likelihood needs no others.
    """
    fine, n = levels.fine, levels.n_fine
    likelihood = _likelihood_of_subset(levels, kernel, subset, scales)
    if not learn:
        return likelihood
    chosen = families(levels.fine_tree, FAMILIES) if n > len(subset) else None
    if chosen is None:
        return likelihood
    return likelihood.also(chosen, levels.points[:n], fine.depth_m, fine.sd_m**2, scales.take(np.arange(n)))


def _likelihood_of_subset(
    levels: TwoLevels, kernel: KernelName, subset: IntArray, scales: LocalScales
) -> RestrictedLikelihood:
    fine = levels.fine
    return RestrictedLikelihood(
        kernel, levels.points[subset], fine.depth_m[subset], fine.sd_m[subset] ** 2, scales.take(subset)
    )


def conditioned(
    levels: TwoLevels,
    kernel: KernelName,
    hyper: Hyperparameters,
    likelihood: RestrictedLikelihood,
    scales: LocalScales,
) -> Conditioned:
    """Return the process that knows all soundings, its trend found by ``likelihood``."""
    noise = hyper.noise_scale * levels.soundings.sd_m**2
    return Conditioned(kernel, levels, noise, hyper.length_m, hyper.amplitude_m, likelihood.trend(hyper), scales)


def choose_kernel(levels: TwoLevels, widest_m: float) -> tuple[KernelName, Hyperparameters]:
    """Climb from the roughest kernel to smoother ones while the likelihood gains enough by it.

    Only spread soundings have a say: close ones tell how smooth the sea floor is over a metre, and by them a kernel may
    be chosen that overshoots between survey lines. And it has to predict soundings across gaps of the survey, narrower
    than ``widest_m``, no worse than the roughest does: what is likely may still foretell badly, and is then neither
    sure of the floor nor right. Returns the kernel and a beginning for its hyperparameters.
    """
    subset = spread_subset(levels.fine_tree, CHOICE_OF_KERNEL_POINTS)
    uniform = uniform_scales(len(levels.soundings))
    likelihood = _likelihood_of_subset(levels, ROUGHEST, subset, uniform)
    rough, least = likelihood.maximise(None)
    holes = _holes(levels, widest_m)
    allowed = _loss(levels, ROUGHEST, rough, likelihood, uniform, holes)
    best, kept = ROUGHEST, rough
    for kernel in KERNEL_LADDER[1:]:
        likelihood = _likelihood_of_subset(levels, kernel, subset, uniform)
        hyper, value = likelihood.maximise(kept)
        if not value < least - KERNEL_GAIN * len(subset):
            break
        if _loss(levels, kernel, hyper, likelihood, uniform, holes) > allowed:
            break
        best, least, kept = kernel, value, hyper
    return best, kept


def _holes(levels: TwoLevels, widest_m: float) -> tuple[IntArray, IntArray] | None:
    """Return soundings to predict, (h,), and those from across a gap to do it by, (h, k); None where too few tell."""
    n, gap = levels.n_fine, gaps(levels.fine_tree)
    gap = gap[gap < widest_m]
    if n < LENGTHEN_FROM or len(gap) == 0:
        return None
    rows = np.unique(np.linspace(0, n - 1, min(n, CHOICE_POINTS)).astype(np.int64))
    return rows, neighbours_beyond(levels.fine_tree, rows, GAP_FACTOR * float(np.median(gap)), HOLE_NEIGHBOURS)


def _loss(
    levels: TwoLevels,
    kernel: KernelName,
    hyper: Hyperparameters,
    likelihood: RestrictedLikelihood,
    scales: LocalScales,
    holes: tuple[IntArray, IntArray] | None,
) -> float:
    """Return the mean square error of predictions across gaps, m²; infinite where nothing can be predicted."""
    if holes is None:
        return np.inf
    n, fine = levels.n_fine, levels.fine
    points, own = levels.points[:n], scales.take(np.arange(n))
    error, _, _ = krige_holes(
        KERNEL_CODES[kernel],
        points,
        fine.depth_m - likelihood.trend(hyper)(points),
        hyper.noise_scale * fine.sd_m**2,
        own.scaled_metric(hyper.length_m),
        hyper.amplitude_m * own.amplitude,
        *holes,
    )
    known = np.isfinite(error)
    return float(np.mean(error[known] ** 2)) if known.any() else np.inf


def lengthen(
    levels: TwoLevels,
    kernel: KernelName,
    hyper: Hyperparameters,
    likelihood: RestrictedLikelihood,
    scales: LocalScales,
    widest_m: float,
) -> Hyperparameters:
    """Choose the length by how well soundings are predicted across the gaps that the survey leaves.

    Where a sea floor is patchy, the likelihood shortens the length to explain steep places, and the map falls
    back to the trend between the lines. Amplitude grows with length: the variance of short differences stays. Gaps of
    ``widest_m`` and more are places that the survey left out.
    """
    holes = _holes(levels, widest_m)
    best, least = hyper, _loss(levels, kernel, hyper, likelihood, scales, holes)
    for factor in LENGTH_FACTORS:
        candidate = Hyperparameters(hyper.length_m * factor, hyper.amplitude_m * factor, hyper.noise_scale)
        loss = _loss(levels, kernel, candidate, likelihood, scales, holes) * (1.0 + CHOICE_MARGIN)
        if loss < least:
            best, least = candidate, loss
    return best
