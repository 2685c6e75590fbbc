"""Parts that all figures are drawn with: style, text, headings, names of tongues, grids."""
