"""Reports: one self-contained HTML page for designs, campaigns, identifications, verifications and comparisons."""
