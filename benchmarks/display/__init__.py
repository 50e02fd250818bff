"""How soon and at what cost what is measured is seen: by the page, by many viewers, in tiles and QGIS."""
