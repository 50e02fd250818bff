"""Plans of SGP-Tools for ``survey_peers.py``, in a Python of its own: it needs numpy < 2 and TensorFlow.

    python benchmarks/planning/sgp_tools.py

Reads one JSON object per line from standard input and answers each with one line; ``plan`` says what they hold. Needs
nothing of this project. Everything is SGP-Tools' own: hyperparameters (``get_model_params``), first routes (k-means and
``run_tsp``), and paths (``ContinuousSGP`` with an ``IPPTransform``, distance budget included).
"""

import json
import os
import sys
import time
from importlib.metadata import PackageNotFoundError, version
from typing import Any

OBJECTIVE_PER_SIDE = 36
"""The sparse GP is to explain a grid of that many points per side."""
LEARN_STEPS, LEARN_FROM = 150, 500
"""Steps of the search for hyperparameters, and of how many soundings at most, evenly thinned."""
TSP_S = 120
"""Never reached: the solver ends where no exchange of its shortens the tour."""
TOUR_PER_ROOT = 1.0
"""Its tours through n points of an area A are about this times sqrt(n A) long."""
BUDGET_WEIGHT = 20.0
"""A path that is too long by its whole budget costs that many times the size of the objective."""
ATTENTIVE_SCALES = 5


def plan(asked: dict[str, Any]) -> dict[str, Any]:
    """Return paths and how long they took, in CPU seconds of one thread.

    ``asked``: ``side_m`` (2), ``starts_m`` (vehicles, 2), ``distance_m`` of each vehicle, ``max_step_m``, ``soundings``
    (n, 3) east, north, depth to learn from, ``kernel`` ("matern32", "rbf" or "attentive"), ``iterations``, ``seed``;
    and, to go on with a plan, its ``paths_m`` (vehicles, waypoints, 2) and how many of their waypoints are ``visited``.
    """
    tf.random.set_seed(asked["seed"])
    side = np.array(asked["side_m"])
    scale = side.max() / np.sqrt(12.0)
    starts = (np.array(asked["starts_m"]) - side / 2) / scale
    budget = asked["distance_m"] / scale
    begun = time.process_time()
    kernel, noise = learn(asked, side, scale)
    learned = time.process_time()
    axes = [(np.arange(OBJECTIVE_PER_SIDE) + 0.5) / OBJECTIVE_PER_SIDE * s - s / 2 for s in side]
    objective = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2) / scale
    if asked.get("paths_m") is None:
        paths = first_routes(objective, starts, budget, asked["seed"])
        visited = 1
    else:
        paths, visited = (np.array(asked["paths_m"]) - side / 2) / scale, asked["visited"]
    routed = time.process_time()
    vehicles, waypoints = paths.shape[:2]
    leg = asked["distance_m"] / (waypoints - 1)
    rate = max(2, int(leg / asked["max_step_m"]) + 1)
    transform = IPPTransform(
        sampling_rate=rate,
        distance_budget=budget,
        num_robots=vehicles,
        Xu_fixed=paths[:, :visited],
        aggregate_fov=rate > 2,
    )
    method = get_method("ContinuousSGP")(
        waypoints,
        objective,
        kernel,
        noise,
        transform,
        num_robots=vehicles,
        X_init=paths.reshape(-1, 2),
    )
    size = abs(float(method.sgpr.elbo()))
    transform.constraint_weight = BUDGET_WEIGHT * size / budget
    before = float(method.sgpr.elbo())
    found = method.optimize(max_steps=asked["iterations"])
    ended = time.process_time()
    lengths = np.linalg.norm(np.diff(found, axis=1), axis=2).sum(axis=1) * scale
    metres = np.clip(found * scale + side / 2, 0.0, side)
    return {
        "paths_m": metres.tolist(),
        "length_m": lengths.tolist(),
        "sampling_rate": rate,
        "waypoints": waypoints,
        "elbo": [before, float(method.sgpr.elbo())],
        "noise_variance": float(noise),
        "lengthscale_m": float(kernel.lengthscales.numpy() * scale) if asked["kernel"] != "attentive" else None,
        "learn_s": learned - begun,
        "route_s": routed - learned,
        "optimise_s": ended - routed,
        "versions": versions(),
    }


def learn(asked: dict[str, Any], side: Any, scale: Any) -> tuple[Any, Any]:
    """Return kernel and noise variance from standardised soundings."""
    data = np.array(asked["soundings"])
    data = data[:: -(-len(data) // LEARN_FROM)]
    places = (data[:, :2] - side / 2) / scale
    depths = ((data[:, 2] - data[:, 2].mean()) / data[:, 2].std())[:, None]
    if asked["kernel"] == "attentive":
        kernel = get_kernel("Attentive")(np.geomspace(0.05, 2.0, ATTENTIVE_SCALES), num_dim=2)
    else:
        chosen = {"matern32": gpflow.kernels.Matern32, "rbf": gpflow.kernels.SquaredExponential}[asked["kernel"]]
        kernel = chosen(lengthscales=0.3)
    _, noise, kernel = get_model_params(
        places, depths, kernel=kernel, noise_variance=0.05, max_steps=LEARN_STEPS, verbose=False
    )
    return kernel, max(float(noise), 1e-4)


def first_routes(objective: Any, starts: Any, budget: float, seed: int) -> Any:
    """Return routes (vehicles, waypoints, 2) through as many k-means points as the budget pays for.

    Each vehicle has its share of equal size from west to east: SGP-Tools' solver with limits for several vehicles found
    nothing for that many points in a minute.
    """
    vehicles = len(starts)
    area = np.prod(np.ptp(objective, axis=0)) / vehicles
    count = int(min(0.8 * len(objective) / vehicles, (budget / TOUR_PER_ROOT) ** 2 / area))
    for _ in range(10):
        points = get_inducing_pts(objective, vehicles * count, seed=seed)
        shares = points[np.argsort(points[:, 0])].reshape(vehicles, count, 2)
        routes, lengths = [], []
        for start, share in zip(starts, shares, strict=True):
            route, length = run_tsp(share, 1, start_nodes=start[None], resample=count + 1, time_limit=TSP_S)
            if route is None:
                raise RuntimeError("SGP-Tools' run_tsp found no route")
            routes.append(route[0])
            lengths.append(length[0])
        if max(lengths) <= budget:
            return np.array(routes)
        count = int(count * min(0.97, (budget / max(lengths)) ** 2))
    raise RuntimeError("SGP-Tools found no routes within the budget")


def versions() -> dict[str, str]:
    """Return the versions of what plans."""
    names = ("sgptools", "gpflow", "tensorflow", "ortools", "numpy")
    return {"python": sys.version.split()[0], **{name: version(name) for name in names}}


def main() -> None:
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what libraries print is not an answer
    for line in sys.stdin:
        print(json.dumps(plan(json.loads(line))), file=out, flush=True)


if __name__ == "__main__":
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
    try:
        version("sgptools")
    except PackageNotFoundError:
        sys.exit("there is no sgptools in this Python")
    import gpflow
    import numpy as np
    import tensorflow as tf
    from sgptools.core.transformations import IPPTransform
    from sgptools.kernels import get_kernel
    from sgptools.methods import get_method
    from sgptools.utils.gpflow import get_model_params
    from sgptools.utils.misc import get_inducing_pts
    from sgptools.utils.tsp import run_tsp

    main()
