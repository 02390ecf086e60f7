"""The closed loop on order tables: waves of some orders under many conditions."""
