"""The formats: one small module each, which registers a `Writer`."""
