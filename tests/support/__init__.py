"""What several tests need: builders, services, fakes, a browser; fixtures are in the ``conftest`` files."""
