"""Market methods, by which UAVs agree with messages and without a server, for comparison; see README.md."""
