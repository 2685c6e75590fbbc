"""Which tongues a region holds."""
