"""Routes of maps: as JSON, pictures, tiles, files, lines; sites; and what GIS ask for (``ogc``, ``wms``)."""
