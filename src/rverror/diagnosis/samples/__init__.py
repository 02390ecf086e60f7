"""The likelihood of samples: what the runs of a geared drive say, of any travel."""
