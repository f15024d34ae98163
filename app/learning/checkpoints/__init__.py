"""Policies as bytes, and the policies that a library has: reading, checking, choosing, exporting."""
