"""Sections of a document as a configuration holds them; what is wrong is reported to the document."""
