"""Settings of the cluster that cannot be are refused with what would be right; without one nothing is loaded."""

import subprocess
import sys
from typing import Any

import pytest
from pydantic import ValidationError

from app.compute.settings import ComputeSettings

FILES = {"tls_ca_file": "ca.pem", "tls_certificate": "c.pem", "tls_key": "c.key"}


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"scheduler": "10.0.0.5:8786"}, "pattern"),
        ({"scheduler": "tcp://user:word@host:8786"}, "pattern"),
        ({"scheduler": "http://host:8786"}, "pattern"),
        ({"scheduler": "tls://host:8786", "tls_ca_file": "ca.pem"}, "needs tls_certificate, tls_key, too"),
        ({"scheduler": "tcp://host:8786"} | FILES, "for a scheduler at tls://HOST:PORT"),
        ({"scheduler": "tcp://host:8786", "timeout_s": 1}, "greater than or equal to 10"),
    ],
)
def test_what_cannot_be_is_refused(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        ComputeSettings.model_validate(settings)


@pytest.mark.parametrize("scheduler", ["", "tcp://scheduler.example:8786", "tcp://[fd00::5]:8786"])
def test_what_can_be_is_taken(scheduler: str) -> None:
    assert not ComputeSettings(scheduler=scheduler).encrypted
    assert ComputeSettings.model_validate({"scheduler": "tls://host:8786"} | FILES).encrypted


def test_a_start_does_not_load_what_only_a_cluster_needs() -> None:
    program = "import sys, app.compute.compute; assert not {'distributed', 'dask', 'tornado'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True)
