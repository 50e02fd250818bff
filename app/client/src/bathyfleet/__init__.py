"""What programs outside of the service import: :mod:`bathyfleet.client` speaks to it over its REST interface."""
