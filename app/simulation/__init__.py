"""The one simulator: problems as arrays, compiled replay and episodes, generated problems."""
