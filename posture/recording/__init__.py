"""Recordings of people: files, columns and signs, signals on an even time base, indices, groups and figures."""
