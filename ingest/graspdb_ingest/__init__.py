"""Recordings to Arrow tables: readers, hand model, tracking, objects, contact, enclosure, features."""
