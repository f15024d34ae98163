"""Missions and vehicles that speak MAVLink, as a client of the API: telemetry in, flights out."""
