"""Estimates in a database against measurements of the same thing."""
