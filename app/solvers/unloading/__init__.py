"""Planned unloading for every algorithm: its best plan, unloaded at best, improved by a search of its own."""
