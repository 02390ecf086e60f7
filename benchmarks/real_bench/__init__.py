"""Virtual benches of a simulator that shares no physics with the package, with what real benches do."""
