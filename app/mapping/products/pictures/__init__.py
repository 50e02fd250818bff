"""Maps as pictures: overlays, tiles, sheets, legends, and the one scale of colours."""
