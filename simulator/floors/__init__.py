"""Sea floors: generated, unseen, or read from terrain files. Others use ``terrain.Terrain``."""
