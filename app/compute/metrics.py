"""Figures about heavy work for GET /metrics."""

from prometheus_client import Counter, Gauge

WORK = Counter("bathyfleet_heavy_work_total", "Pieces of heavy work by where they were done", ["where"])
REPEATED = Counter(
    "bathyfleet_heavy_work_repeated_total",
    "Pieces of heavy work that the cluster did not bring to an end by why",
    ["why"],
)
CLUSTER_WORKERS = Gauge("bathyfleet_cluster_workers", "Workers of the cluster that heavy work is given to; 0: none is")
