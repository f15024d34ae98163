"""Task allocation of UAV swarms: domain, simulator, solvers, learning, jobs and the REST service."""

__version__ = "0.3.0"
