"""From tasks to library entries: what a task is described by, and the policies that are shipped."""
