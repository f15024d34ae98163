"""One network for every number of UAVs, targets and materials: the service's own mode of QMIX."""
