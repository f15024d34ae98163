"""How the policy for every size is made: demonstrations, corrections, training, production."""
