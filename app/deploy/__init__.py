"""Installing on a computer without internet: units for systemd, and one file with everything.

``python -m app.deploy`` makes the file; ``install.sh`` in it checks and installs it.
"""
