"""Which program holds a port of this machine, as far as Linux shows."""

from __future__ import annotations

from pathlib import Path

_PROC = Path("/proc")


def holder_of_udp_port(port: int) -> str:
    """The program and process id that hold a UDP port, empty when that cannot be found out."""
    try:
        rows = (_PROC / "net" / "udp").read_text().splitlines()[1:]
    except OSError:
        return ""
    fields = [row.split() for row in rows]
    inodes = {f"socket:[{field[9]}]" for field in fields if int(field[1].rpartition(":")[2], 16) == port}
    if not inodes:
        return ""
    for process in _PROC.glob("[0-9]*"):
        try:
            if any(str(link.readlink()) in inodes for link in (process / "fd").iterdir()):
                return f"{(process / 'comm').read_text().strip()} (process {process.name})"
        except OSError:
            continue
    return ""
