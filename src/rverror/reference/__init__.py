"""rverror as a reference for other tools: cases with known answers, and the comparison with them."""
