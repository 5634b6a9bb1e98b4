"""Measured BRDFs as references: a file for each format, one record for all of them, and the view that a fit has of it."""
