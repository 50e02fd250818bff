"""Services, networks, disks and people that fail or mean harm."""
