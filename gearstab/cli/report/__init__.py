"""``gearstab report``: what was found out, put on pages, as HTML or PDF."""
