"""Models of other programs as the section ``system`` of kind ``matrices``, and systems as files for other programs."""
