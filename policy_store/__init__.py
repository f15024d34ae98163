"""The policy library: source tasks, their checkpoints and the search for similar ones."""
