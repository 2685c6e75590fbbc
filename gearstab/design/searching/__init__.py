"""Looking for the design with the least objective, or for those of several between which nothing but taste decides."""
