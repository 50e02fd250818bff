"""Files and sockets that the process may have open at a time."""

import resource

import structlog

OTHERS = 512
"""Besides connections of clients: the database, vehicles, files."""

log = structlog.get_logger(__name__)


def allow_descriptors(connections: int) -> None:
    """Let the process open as many connections as set up, as far as the system's hard limit allows.

    Where it does not, strangers could take the last descriptor, without which not even an operator is let in.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    # Sockets that are being closed, and views that became WebSockets, come on top of the connections.
    wanted = 2 * connections + OTHERS
    if soft == resource.RLIM_INFINITY or soft >= wanted:
        return
    allowed = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
    resource.setrlimit(resource.RLIMIT_NOFILE, (allowed, hard))
    if allowed < wanted:
        log.warning(
            "the system allows few open files: lower max_connections or raise it", allowed=allowed, right=wanted
        )
