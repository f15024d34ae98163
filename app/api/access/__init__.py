"""Who may do what: API keys, their roles, and the guard in front of the routes."""
