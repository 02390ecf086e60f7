"""The likelihood of samples: a drive's runs of any travel, and what differs between a reducer's periods."""
