from typing import Any

import pytest

from imc_bridge import BridgeSettings


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("id", 0),
        ("id", 0xFFFF),
        ("name", ""),
        ("port", 0),
        ("announce_ports", ()),
        ("announce_ports", (70000,)),
        ("multicast_group", "10.0.0.1"),
        ("interfaces", ("eth0",)),
        ("time_scale", 0.0),
        ("reference_period_s", 5.0),
        ("plan_id", ""),
        ("altimeter", "sideways"),
        ("lost_after_s", -1.0),
    ],
)
def test_wrong_values_are_refused_by_name(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"\n{field}\b.*\n.*(should|no multicast|use an IPv4 address)"):
        BridgeSettings(**{field: value})
