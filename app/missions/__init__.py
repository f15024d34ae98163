"""Missions: a day that is flown, event by event, and the plan that follows it."""
