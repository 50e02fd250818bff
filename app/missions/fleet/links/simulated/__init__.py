"""What the link ``sim`` is made of: how vehicles come into the world, and how one lives there."""
