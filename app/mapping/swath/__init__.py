"""Swath sonars: pings, where their beams met the bottom, what was ensonified and what was missed.

``pings`` holds what sonars reported and where beams met the bottom, ``mounting`` how sonars sit in their vehicles,
``patch_test`` estimates that, ``spikes`` finds beams that met something else, ``rulings`` has what operators say of
beams, ``ensonified`` the ground that was seen,
``density`` counts soundings in its cells, ``gridded`` makes depths of them, ``holidays`` finds what was missed. All is
numpy in and out.
"""
