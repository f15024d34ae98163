"""The policy that scores every UAV with every place it may fly to; the surest acts first."""
