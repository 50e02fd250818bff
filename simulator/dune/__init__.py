"""Fake DUNE nodes: vehicles that speak IMC over UDP as LSTS vehicles do."""

from simulator.dune.fleet import DuneFleet, VehicleSpec, default_specs
from simulator.dune.node import FakeDune
from simulator.dune.options import DuneOptions

__all__ = ["DuneFleet", "DuneOptions", "FakeDune", "VehicleSpec", "default_specs"]
