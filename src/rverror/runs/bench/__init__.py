"""Files as benches write them, read by way of a mapping: text, MAT, HDF5 and TDMS."""
