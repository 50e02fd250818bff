"""Sites: places that are surveyed again and again.

``sites`` keeps them and their missions, ``site_models`` what their surveys found together and what changed between two.
"""
