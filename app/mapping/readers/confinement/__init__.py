"""A process that locks itself in before it looks at bytes nobody vouches for.

Each layer holds where another has a hole or the kernel lacks it: Landlock (files, sockets, signals), a seccomp filter
(system calls), namespaces (network), limits (memory, time, processes).
"""

from app.mapping.readers.confinement.sandbox import (
    FORBIDDEN,
    LAYERS,
    LOCKING_CALLS,
    ResourceLimits,
    confine,
    limit,
)

__all__ = ["FORBIDDEN", "LAYERS", "LOCKING_CALLS", "ResourceLimits", "confine", "limit"]
