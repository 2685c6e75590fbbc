"""``gearstab info``: what is known of a system before a sweep, and of a result after it."""
